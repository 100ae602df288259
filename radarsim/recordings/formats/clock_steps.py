"""Recognise a clock that was set back by any time within a recording, by the places of the targets.

Where a clock is set back by S, rows of the same recorded time lie S apart on the targets' paths. Sorted by time they
would zigzag; with the rows before it S earlier they lie on one path. Both are fitted with parabolas."""

from typing import NamedTuple

import numpy as np

MAX_SET_BACKS = 4  # in a recording
MAX_MISSED_SCANS = 4  # while the clock was set back
FITTED_ROWS = 8  # of a track, on each side
MIN_SIDE_ROWS, MIN_FITTED_ROWS = 2, 5  # on each side, and together
MIN_MISFIT_RATIO = 4.0  # of sums of squares: rows sorted by time, over those of a clock that was set back
RELATIVE_RESOLUTION = 1e-6  # of the distances between rows, below which misfits are rounding


class SetBack(NamedTuple):
    """A clock that was set back by size_s; before: the rows (m,) before that; until_s: the last time of them."""

    size_s: float
    before: np.ndarray
    until_s: float


class _Join(NamedTuple):
    """The rows of a track on both sides of where its clock may have been set back."""

    before: np.ndarray
    after: np.ndarray


def find_set_back(t: np.ndarray, positions: np.ndarray, tracks: list[np.ndarray]) -> SetBack | None:
    """The first set-back of the clock of a recording, times (n,) and positions (n, d) of its rows, tracks: the rows of
    each in the order of the file; None where times do not fall, or the rows are only out of order."""
    first_falls = {number: falls for number, rows in enumerate(tracks) if (falls := _falls(t, positions, rows)).size}
    if not first_falls:
        return None
    pairs = [tracks[number][falls[0] : falls[0] + 2] for number, falls in first_falls.items()]
    last_before, first_after = max(int(pair[0]) for pair in pairs), min(int(pair[1]) for pair in pairs)
    if last_before < first_after:  # in the order of the records: all tracks at once
        ends = {number: int(np.searchsorted(rows, first_after)) for number, rows in enumerate(tracks)}
        before = np.arange(first_after)
    elif all(falls.size == 1 for falls in first_falls.values()):  # track by track
        ends = {number: int(falls[0]) + 1 for number, falls in first_falls.items()}
        latest = max(float(t[pair[0]]) for pair in pairs)
        parts = [
            rows[: ends[number]] if number in ends else rows for number, rows in enumerate(tracks)
            if number in ends or t[rows].max() <= latest
        ]  # fmt: skip
        before = np.sort(np.concatenate(parts))
    else:
        return None
    joins = [_join(t, tracks[number], end) for number, end in ends.items()]
    steps = np.concatenate([np.diff(t[rows]) for rows in tracks])
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    gap = float(np.median([t[last] - t[first] for last, first in pairs]))
    size = _fitted_size(t, positions, joins, [gap + scans * usual for scans in range(1, MAX_MISSED_SCANS + 2)])
    return None if size is None else SetBack(size, before, float(t[before].max()))


def _falls(t: np.ndarray, positions: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Where the next row of a track is earlier, or elsewhere at the same time."""
    steps = np.diff(t[rows])
    is_elsewhere = (np.diff(positions[rows], axis=0) != 0).any(axis=1)
    return np.flatnonzero((steps < 0) | ((steps == 0) & is_elsewhere))


def _join(t: np.ndarray, rows: np.ndarray, end: int) -> _Join:
    """The rows of a track next to index `end`, on each side as far as its times rise."""
    is_fall = np.append(np.diff(t[rows]) < 0, True)
    falls = np.flatnonzero(is_fall) + 1
    first = max([0, *falls[falls < end].tolist()])
    last = min(falls[falls > end].tolist(), default=end)
    return _Join(rows[max(first, end - FITTED_ROWS) : end], rows[end : min(last, end + FITTED_ROWS)])


def _fitted_size(t: np.ndarray, positions: np.ndarray, joins: list[_Join], sizes: list[float]) -> float | None:
    """The size of a set-back that puts the rows on one path; None where the recorded times do so nearly as well."""
    recorded, rows = _misfit(t, positions, joins, 0.0)
    if not rows:
        return None
    misfits = [_misfit(t, positions, joins, size)[0] for size in sizes]
    best = int(np.argmin(misfits))
    return sizes[best] if recorded - misfits[best] > rows * np.log(MIN_MISFIT_RATIO) else None


def _misfit(t: np.ndarray, positions: np.ndarray, joins: list[_Join], size_s: float) -> tuple[float, int]:
    """How far the rows of all tracks lie from a parabola each, if the rows before are so much earlier: the sum of the
    logarithms of the squares, by rows; and the rows."""
    total, count = 0.0, 0
    for join in joins:
        rows = np.concatenate([join.before, join.after])
        times = t[rows] - np.where(np.arange(rows.size) < join.before.size, size_s, 0.0)
        places = positions[rows]
        is_known = np.isfinite(places).all(axis=1)
        if min(join.before.size, join.after.size) < MIN_SIDE_ROWS or is_known.sum() < MIN_FITTED_ROWS:
            continue
        times, places = times[is_known], places[is_known]
        span = float(np.ptp(times)) or 1.0
        powers = ((times - times.mean()) / span)[:, None] ** np.arange(3)
        residuals = places - powers @ np.linalg.lstsq(powers, places, rcond=None)[0]
        smallest = (RELATIVE_RESOLUTION * float(np.ptp(places, axis=0).max())) ** 2 + np.finfo(float).tiny
        total += rows.size * float(np.log(np.square(residuals).sum() + smallest))
        count += rows.size
    return total, count
