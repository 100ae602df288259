"""Recognise a clock that was set within a recording, by the places of the targets.

Where a clock is set back by S, rows of the same recorded time lie S apart on the targets' paths. Sorted by time they
would zigzag; with the rows before it S earlier they lie on one path. Both are fitted with parabolas. A clock that is
set by less than a scan leaves the times in order, but a step that is no whole number of scans."""

from typing import NamedTuple

import numpy as np

MAX_SET_BACKS = 4  # in a recording
MAX_MISSED_SCANS = 4  # while the clock was set back
FITTED_ROWS = 8  # of a track, on each side
MIN_SIDE_ROWS, MIN_FITTED_ROWS = 2, 5  # on each side, and together
MIN_MISFIT_RATIO = 4.0  # of sums of squares: rows sorted by time, over those of a clock that was set back
SCAN_TOLERANCE, MIN_REGULAR_SHARE = 0.1, 0.9  # of a scan, of whole scans; of the steps that are such
MIN_STEPS = 20  # of a track
SMALL_STEP_ROWS, SMALL_STEP_GAIN = 20, 20.0  # fitted on each side for a step below a scan; twice the log-likelihood
RELATIVE_RESOLUTION = 1e-6  # of the distances between rows, below which misfits are rounding


class SetBack(NamedTuple):
    """A clock that was set back by size_s, or on if that is negative; before: the rows (m,) before that; until_s: the
    last time of them."""

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
    falls = {number: _falls(t, positions, rows) for number, rows in enumerate(tracks)}
    return _find_step(
        t, positions, tracks, {number: rows for number, rows in falls.items() if rows.size}, is_small=False
    )


def find_small_step(t: np.ndarray, positions: np.ndarray, tracks: list[np.ndarray]) -> SetBack | None:
    """The first time by which the clock of a radar that scans regularly was set, less than a scan, where times rise."""
    odd_steps = {}
    for number, rows in enumerate(tracks):
        steps = np.diff(t[rows])
        is_whole = (
            are_whole_scans(steps, float(np.median(steps))) if len(steps) >= MIN_STEPS else np.ones(0, dtype=bool)
        )
        if not is_whole.all() and is_whole.mean() >= MIN_REGULAR_SHARE:
            odd_steps[number] = np.flatnonzero(~is_whole)
    return _find_step(t, positions, tracks, odd_steps, is_small=True)


def are_whole_scans(steps_s: np.ndarray, scan_s: float) -> np.ndarray:
    """Whether steps of time (n,) are whole numbers of scans."""
    scans = steps_s / scan_s
    return (np.abs(scans - np.rint(scans)) < SCAN_TOLERANCE) & (scans > SCAN_TOLERANCE)


def may_be_small_step(numbers: np.ndarray, t: np.ndarray, steps: np.ndarray) -> bool:
    """Whether the clock may have been set by less than a scan in a batch of rows (n,), with the numbers of their
    tracks, times and steps before them: most steps are whole scans, and the others are of one time, in most tracks."""
    is_known = np.isfinite(steps)
    numbers, t, steps = (values[is_known] for values in (numbers, t, steps))
    if len(steps) < MIN_STEPS or not (scan_s := float(np.median(steps))) > 0:
        return False
    is_odd = ~are_whole_scans(steps, scan_s)
    if not is_odd.any() or is_odd.mean() > 1 - MIN_REGULAR_SHARE:
        return False
    moments = np.unique(t[is_odd] // (2 * scan_s))
    return moments.size <= 2 * MAX_SET_BACKS and 2 * is_odd.sum() >= len(np.unique(numbers))


def _find_step(
    t: np.ndarray, positions: np.ndarray, tracks: list[np.ndarray], first_falls: dict[int, np.ndarray], is_small: bool
) -> SetBack | None:
    """The first step of the clock at the steps of tracks, by their number, if the places say so."""
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
    joins = [
        _join(t, tracks[number], end, SMALL_STEP_ROWS if is_small else FITTED_ROWS) for number, end in ends.items()
    ]
    steps = np.concatenate([np.diff(t[rows]) for rows in tracks])
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    gap = float(np.median([t[last] - t[first] for last, first in pairs]))
    sizes = [gap + scans * usual for scans in range(1, MAX_MISSED_SCANS + 2)]
    if is_small:
        sizes = [size for size in sizes if abs(size) < usual]
    size = _fitted_size(t, positions, joins, sizes, SMALL_STEP_GAIN if is_small else None)
    return None if size is None else SetBack(size, before, float(t[before].max()))


def _falls(t: np.ndarray, positions: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Where the next row of a track is earlier, or elsewhere at the same time."""
    steps = np.diff(t[rows])
    is_elsewhere = (np.diff(positions[rows], axis=0) != 0).any(axis=1)
    return np.flatnonzero((steps < 0) | ((steps == 0) & is_elsewhere))


def _join(t: np.ndarray, rows: np.ndarray, end: int, most: int) -> _Join:
    """The rows of a track next to index `end`, at most so many on each side, as far as its times rise."""
    is_fall = np.append(np.diff(t[rows]) < 0, True)
    falls = np.flatnonzero(is_fall) + 1
    first = max([0, *falls[falls < end].tolist()])
    last = min(falls[falls > end].tolist(), default=end)
    return _Join(rows[max(first, end - most) : end], rows[end : min(last, end + most)])


def _fitted_size(
    t: np.ndarray, positions: np.ndarray, joins: list[_Join], sizes: list[float], gain: float | None
) -> float | None:
    """The size of a set-back that puts the rows on one path; None where the recorded times do so nearly as well.

    gain: of the fit that is needed, where it is not a share of the misfit."""
    recorded, rows = _misfit(t, positions, joins, 0.0)
    if not rows or not sizes:
        return None
    misfits = [_misfit(t, positions, joins, size)[0] for size in sizes]
    best = int(np.argmin(misfits))
    return sizes[best] if recorded - misfits[best] > (gain or rows * np.log(MIN_MISFIT_RATIO)) else None


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
