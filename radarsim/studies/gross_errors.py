"""Gross errors at the start of recorded tracks, and which numbers of a track are outliers.

A filter starts from the first plots. One of them that is far off would make outliers of all that follow, so it is left
out: from the first plots the parabola is found that passes nearest to the majority (least median of squares, Rousseeuw
1984), and a number far from it is a gross error."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

START_PLOTS = 15  # from which the parabola is found
MIN_START_PLOTS = 8
TRIPLE_STRIDE = 4  # of all triples of them every so manieth: enough to have some without an error
LEAST_JUMP = 0.4  # of that distance by which a gross error leaves its neighbours too
CLEAR_SIGMAS = 20.0  # from which it is named
GROSS_SIGMAS = 6.0  # of the scale that is found, of a gross error: of sound tracks in 3 of 1000


def without_gross_starts(
    columns: Mapping[str, np.ndarray], measured: Sequence[str], start_count: int, limit: float = GROSS_SIGMAS
) -> dict[str, np.ndarray]:
    """Columns (n,) of a track, of those measured with not-a-number for gross errors among the first plots, until
    `start_count` sound ones have come. limit: of a sound number's distance from its neighbours, in their scale."""
    cleaned = dict(columns)
    for name in measured:
        finite = np.flatnonzero(np.isfinite(columns[name]))[:START_PLOTS]
        gross = gross_errors(columns["t_s"][finite], columns[name][finite], limit)
        gross &= np.cumsum(~gross) < start_count
        if gross.any():
            cleaned[name] = columns[name].copy()
            cleaned[name][finite[gross]] = np.nan
    return cleaned


def gross_errors(t: np.ndarray, z: np.ndarray, limit: float) -> np.ndarray:
    """Which numbers z (n,) at times t are gross errors (n,): none where too few tell."""
    count = len(z)
    if count < MIN_START_PLOTS:
        return np.zeros(count, dtype=bool)
    times = (t - t[0]) / (t[-1] - t[0])
    powers = times[:, None] ** np.arange(3)
    triples = np.array(list(itertools.combinations(range(count), 3)))[::TRIPLE_STRIDE]
    coefficients = np.linalg.solve(powers[triples], z[triples][..., None])[..., 0]
    residuals = np.abs(z - coefficients @ powers.T)
    majority = np.sort(residuals, axis=1)[:, (count + 3) // 2]
    best = int(majority.argmin())
    # The median of a normal law, and the correction for few plots, as Rousseeuw and Leroy (1987) have them.
    scale = 1.4826 * (1 + 5 / (count - 3)) * float(majority[best])
    if scale == 0:
        return np.zeros(count, dtype=bool)
    far, gross = residuals[best] > limit * scale, np.zeros(count, dtype=bool)
    # Two errors of one size may be on a parabola with their neighbours: where one is known, the other shows.
    while True:
        more = [
            i
            for i in np.flatnonzero(far & ~gross).tolist()
            if _neighbour_residual(times, z, i, gross) > LEAST_JUMP * residuals[best][i]
        ]
        if not more:
            return gross
        gross[more] = True


def _neighbour_residual(t: np.ndarray, z: np.ndarray, i: int, gross: np.ndarray) -> float:
    """The distance of number i from the parabola through the three numbers after it that are no gross errors, of the
    last ones before it: small where a target manoeuvres, which moves on smoothly."""
    others = np.flatnonzero(~gross)
    before, after = others[others < i], others[others > i]
    neighbours = after[:3] if len(after) >= 3 else before[-3:]
    weights = [np.prod([(t[i] - t[k]) / (t[j] - t[k]) for k in neighbours if k != j]) for j in neighbours]
    return float(abs(z[i] - np.array(weights) @ z[neighbours]))


def data_span(tracks: Sequence[Mapping[str, np.ndarray]], measured: Sequence[str]) -> np.ndarray:
    """The span of the data of all tracks, of each column measured (m,); zero where nothing is."""
    columns = [np.concatenate([track[name] for track in tracks]) for name in measured]
    finite = [column[np.isfinite(column)] for column in columns]
    return np.array([float(np.ptp(column)) if column.size else 0.0 for column in finite])


def soundness_by_column(
    measured: Sequence[str],
    tracks: Sequence[Mapping[str, np.ndarray]],
    cleaned_tracks: Sequence[Mapping[str, np.ndarray]],
    judged: Sequence[tuple[int, np.ndarray, np.ndarray]],
) -> list[dict[str, np.ndarray]]:
    """The times t_s of tracks, and the probability of each number that it is no outlier, by column; not-a-number where
    it is missing; (n,) each.

    cleaned_tracks: the same `without_gross_starts`. judged: the number of a track, rows of it (k,), and their
    probabilities (k, m)."""
    result = [{name: np.where(np.isfinite(track[name]), 1.0, np.nan) for name in measured} for track in tracks]
    for number, rows, soundness in judged:
        for i, name in enumerate(measured):
            column = result[number][name]
            column[rows] = np.where(np.isfinite(column[rows]), soundness[:, i], np.nan)
    for track, cleaned, probabilities in zip(tracks, cleaned_tracks, result, strict=True):
        for name in measured:
            if cleaned[name] is not track[name]:
                clear = without_gross_starts(track, (name,), START_PLOTS, CLEAR_SIGMAS)[name]
                is_gross = np.isfinite(track[name]) & ~np.isfinite(cleaned[name])
                probabilities[name][is_gross & ~np.isfinite(clear)] = 0.0
    return [{"t_s": track["t_s"], **probabilities} for track, probabilities in zip(tracks, result, strict=True)]
