"""Numbers that stand for no value, as 0 or -999 among the velocities of a moving target, or 65535 among ranges.

A number that often stands for none, or is there again and again far from those beside it, stands for none where these
agree with each other and not with it. Velocities must also agree with the change of the range: a target that stops, or
moves across the line of sight, has a velocity of 0. A target that stands, and cells of a coarse measurement, repeat
numbers too, but near those beside them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.language.translate import term, tr
from radarsim.recordings.doppler_scale import FOOT_M, KMH_MPS, KNOT_MPS
from radarsim.recordings.grouping import rows_by_name

COLUMNS = ("t_s", "range_m", "velocity_mps")


class _Limits(NamedTuple):
    """How far numbers of a column lie at least from those beside them if they stand for none; the period of angles; in
    which units numbers that often stand for none are read; whether a target cannot go so far while nobody looks."""

    far: float
    period: float = 0.0
    units: tuple[float, ...] = (1.0,)
    is_place: bool = False


LIMITS = {
    "range_m": _Limits(1000.0, units=(1.0, 1000.0, 1852.0, 0.3048, 0.9144), is_place=True),
    "bearing_rad": _Limits(0.1, 2 * np.pi, (1.0, np.pi / 180)),
    "altitude_m": _Limits(1000.0, units=(1.0, 0.3048, 30.48)),
    "latitude_deg": _Limits(0.05, is_place=True),
    "longitude_deg": _Limits(0.05, 360.0, is_place=True),
}
FAR_VELOCITY = _Limits(5.0)
FILL_NUMBERS = (  # of either sign, besides 0
    *(99.0, 99.9, 99.99, 999.0, 999.9, 999.99, 9999.0, 9999.9, 9999.99, 99_999.0, 999_999.0, 1e5, 1e6),
    *(327.67, 327.68, 3276.7, 3276.8, 32_767.0, 32_768.0, 65_535.0),
)
UNITS_MPS = 1.0, KNOT_MPS, KMH_MPS, FOOT_M
FILL_MPS = np.unique([0.0, *(number * unit for number in FILL_NUMBERS for unit in UNITS_MPS)])
UNIT_ROUNDING = 1e-9  # relative, of a conversion
MIN_MISS_MPS, MIN_MISS_SCATTERS = 5.0, 20.0  # from the velocities beside it; in their median second differences
MIN_REPEATS, MIN_REPEAT_SCATTERS = 3, 3.0  # rows of a track with one number, and by how much these miss, over 5 σ
MAX_RATE_SHARE = 0.25  # of that miss, by which the change of the range may miss the velocities beside it
NEARER_SHARE = 0.5  # from which the change of the range is nearer to the number itself
RATE_ROWS = 3  # to either side, over which the change of the range is taken
MIN_ROWS = 5  # of a track, with other velocities
FAR_STEPS, FAR_SCATTERS = 10.0, 20.0  # steps between other numbers, and their median second differences
OFF_SCATTERS, OFF_SHARE = 5.0, 0.05  # of rows with a number that is a fill elsewhere: second differences; of far
MIN_FILLS, MIN_USUAL_FILLS = 3, 2  # rows with a number, and with one of FILL_NUMBERS
MAX_BESIDE_STEPS = 5.0  # usual steps of time to another number: not over a gap
MIN_ALTERNATING_SHARE = 0.1  # of rows with a number, if rows are far from those beside them throughout
MIN_OTHER_NUMBERS = 3  # different ones of a track
MIN_ISOLATION = 0.25  # of the miss of a velocity: that far no other is from it, as folded ones are
FILL_NOTE = term("velocities that stand for none, as 0 or -999 among others: {count} of {all}; they are left out")
FILL_NOTES = {
    "range_m": term("ranges that stand for none, as 65535 again and again: {count} of {all}; they are left out"),
    "bearing_rad": term("bearings that stand for none, as 0 again and again: {count} of {all}; they are left out"),
    "altitude_m": term("altitudes that stand for none, as 0 again and again: {count} of {all}; they are left out"),
    "velocity_mps": FILL_NOTE,
}


def remove_fills(columns: Mapping[str, np.ndarray], tracks: Sequence[str]) -> Counter[str]:
    """Make the numbers that stand for none not-a-number, in place, in the columns (n,) of LIMITS and in velocities, of
    rows of tracks, '' of no track; returns how many these are, by column."""
    counts = Counter[str]()
    order = _track_order(columns["t_s"], tracks)
    for name, limits in LIMITS.items():
        if name in columns and (numbers := _repeated_numbers(columns[name], order, limits)).size:
            fills = np.zeros(len(tracks), dtype=bool)
            for track, rows in rows_by_name(tracks).items():
                is_number = np.isin(columns[name][rows], numbers)
                if track and is_number.any():
                    fills[rows] = _are_repeated_fills(columns["t_s"][rows], columns[name][rows], is_number, limits)
            counts[name] = _enough_fills(columns[name], fills, limits)
    if set(COLUMNS) <= set(columns):
        numbers = _repeated_numbers(columns["velocity_mps"], order, FAR_VELOCITY)
        counts["velocity_mps"] = _remove_fill_velocities(columns, tracks, numbers)
    return counts


def fill_notes(counts: Mapping[str, int], rows: int) -> list[str]:
    """What is left out of so many rows, by column."""
    return [tr(FILL_NOTES[name], count=count, all=rows) for name, count in counts.items() if count]


def _track_order(t: np.ndarray, tracks: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """The rows (n,) of tracks in the order of their times, track by track, and the numbers of their tracks."""
    numbers = dict(zip(dict.fromkeys(tracks), range(len(tracks)), strict=False))
    row_numbers = np.array([numbers[track] for track in tracks], dtype=int)
    order = np.lexsort((t, row_numbers))
    return order, row_numbers[order]


def _repeated_numbers(values: np.ndarray, order: tuple[np.ndarray, np.ndarray], limits: _Limits) -> np.ndarray:
    """The numbers among values (n,) that may stand for none: repeated, and far from those beside them."""
    x, tracks = values[order[0]], order[1]
    is_known = np.isfinite(x)
    x, tracks = x[is_known], tracks[is_known]
    if x.size < MIN_ROWS:
        return x[:0]
    starts = np.flatnonzero(np.append(True, (np.diff(x) != 0) | (np.diff(tracks) != 0)))
    run_values, lengths = x[starts], np.diff(np.append(starts, x.size))
    steps = _distance(np.diff(run_values), limits)
    steps = np.where(np.diff(tracks[starts]) == 0, steps, np.inf)
    nearest = np.minimum(np.append(np.inf, steps), np.append(steps, np.inf))
    is_beside = np.isfinite(nearest)
    usual = float(np.median(nearest[is_beside])) if is_beside.any() else 0.0
    if usual > limits.far:
        is_far, least = is_beside, int(MIN_ALTERNATING_SHARE * x.size)
    else:
        is_far, least = is_beside & (nearest > max(FAR_STEPS * usual, limits.far)), 0
    if not is_far.any():
        return x[:0]
    numbers, indices = np.unique(run_values[is_far], return_inverse=True)
    rows = np.bincount(indices, lengths[is_far])
    is_usual = _are_fill_numbers(numbers, limits)
    return numbers[(rows >= np.where(is_usual, MIN_USUAL_FILLS, MIN_FILLS)) & (rows >= least)]


def _are_fill_numbers(numbers: np.ndarray, limits: _Limits) -> np.ndarray:
    """Whether numbers are among FILL_NUMBERS, or 0, in a unit of their column."""
    sizes = np.abs(numbers)[:, None]
    known = np.array([0.0, 1.0, *(number * unit for number in FILL_NUMBERS for unit in limits.units)])
    return (np.abs(sizes - known) <= UNIT_ROUNDING * known).any(axis=1)


def _are_repeated_fills(t: np.ndarray, x: np.ndarray, is_number: np.ndarray, limits: _Limits) -> np.ndarray:
    """Which of the suspected numbers among the values (n,) of a track lie far from the others."""
    order = np.argsort(t, kind="stable")
    t, x, is_number = t[order], x[order], is_number[order]
    is_other = np.isfinite(x) & ~is_number
    result = np.zeros(len(x), dtype=bool)
    others = np.unwrap(x[is_other], period=limits.period) if limits.period else x[is_other]
    is_usual = _are_fill_numbers(x, limits)
    is_suspected = is_number & (is_usual if len(np.unique(others)) < MIN_OTHER_NUMBERS else True)
    if others.size < MIN_ROWS or (is_number.sum() > others.size and not is_usual[is_number].all()):
        return result
    scatter = float(np.median(np.abs(np.diff(others, n=2))))
    usual = max(FAR_STEPS * float(np.median(np.abs(np.diff(others)))), FAR_SCATTERS * scatter, limits.far)
    misses = _distance(x - np.interp(t, t[is_other], others), limits)
    is_inside = (t > t[is_other][0]) & (t < t[is_other][-1])
    is_beside = np.abs(t[:, None] - _times_beside(t, t[is_other])).min(axis=1) <= MAX_BESIDE_STEPS * np.median(
        np.diff(t)
    )
    is_fill = is_suspected & (misses > usual) & (is_inside | limits.is_place) & is_beside
    # Where a number stands for none, it does so in the rows in which it is not so far, and at the ends of the track.
    is_off = misses > max(OFF_SCATTERS * scatter, OFF_SHARE * limits.far)
    result[order] = is_suspected & is_off & np.isin(x, x[is_fill])
    return result


def _times_beside(t: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The times of others before and after times (n,), or the nearest (n, 2)."""
    after = np.minimum(np.searchsorted(others, t), len(others) - 1)
    return np.stack([others[np.maximum(after - 1, 0)], others[after]], axis=1)


def _enough_fills(values: np.ndarray, fills: np.ndarray, limits: _Limits) -> int:
    """Make the numbers that are fills (n,) often enough not-a-number, in place; returns how many rows these are."""
    numbers, indices, counts = np.unique(values[fills], return_inverse=True, return_counts=True)
    is_enough = counts >= np.where(_are_fill_numbers(numbers, limits), MIN_USUAL_FILLS, MIN_FILLS)
    rows = np.flatnonzero(fills)[is_enough[indices]]
    values[rows] = np.nan
    return len(rows)


def _distance(differences: np.ndarray, limits: _Limits) -> np.ndarray:
    """The size of differences, of angles the shorter way."""
    if not limits.period:
        return np.abs(differences)
    return np.abs((differences + limits.period / 2) % limits.period - limits.period / 2)


def _remove_fill_velocities(columns: Mapping[str, np.ndarray], tracks: Sequence[str], numbers: np.ndarray) -> int:
    """Make the velocities that stand for none not-a-number, in place, in COLUMNS (n,) of rows of tracks, '' of no
    track; numbers: that are repeated far from others. Returns how many these are."""
    t, r, v = (columns[name] for name in COLUMNS)
    is_repeated = np.isin(v, numbers) if numbers.size else np.zeros(len(v), dtype=bool)
    is_candidate = _is_fill_number(v) | is_repeated
    if not is_candidate.any():
        return 0
    fills = np.zeros(len(v), dtype=bool)
    for name, rows in rows_by_name(tracks).items():
        if name and is_candidate[rows].any():
            order = rows[np.argsort(t[rows], kind="stable")]
            fills[order] = _are_fills(t[order], r[order], v[order], is_candidate[order], is_repeated[order])
    v[fills] = np.nan
    return int(fills.sum())


def _is_fill_number(v: np.ndarray) -> np.ndarray:
    """Whether velocities (n,) are among FILL_MPS, but for the rounding of a unit."""
    speeds = np.abs(v)
    places = np.searchsorted(FILL_MPS, speeds * (1 - UNIT_ROUNDING))
    nearest = FILL_MPS[np.minimum(places, len(FILL_MPS) - 1)]
    return np.abs(speeds - nearest) <= UNIT_ROUNDING * nearest


def _are_fills(
    t: np.ndarray, r: np.ndarray, v: np.ndarray, is_candidate: np.ndarray, is_repeated: np.ndarray
) -> np.ndarray:
    """Which candidates among the velocities (n,) of a track stand for none; is_repeated: those that are repeated far
    from others."""
    result, is_known = np.zeros(len(v), dtype=bool), np.isfinite(v) & ~is_candidate
    if is_known.sum() < MIN_ROWS:
        return result
    rows = np.flatnonzero(is_candidate)
    expected = np.interp(t[rows], t[is_known], v[is_known])
    misses = np.abs(v[rows] - expected)
    scatter = float(np.median(np.abs(np.diff(v[is_known], n=2))))
    first, last = np.maximum(rows - RATE_ROWS, 0), np.minimum(rows + RATE_ROWS, len(v) - 1)
    if np.isnan(r).any() and (is_measured := np.isfinite(r)).any():
        r = np.interp(t, t[is_measured], r[is_measured])
    with np.errstate(invalid="ignore", divide="ignore"):
        rates = (r[last] - r[first]) / (t[last] - t[first])
        shares = np.abs(rates - expected) / misses
    result[rows] = (misses > max(MIN_MISS_MPS, MIN_MISS_SCATTERS * scatter)) & (shares < MAX_RATE_SHARE)
    for number in np.unique(v[rows]):
        is_number = v[rows] == number
        is_far = np.median(misses[is_number]) > max(MIN_MISS_MPS, MIN_REPEAT_SCATTERS * scatter)
        if is_number.sum() >= MIN_REPEATS and is_far and np.median(shares[is_number]) < MAX_RATE_SHARE:
            result[rows[is_number & (shares < NEARER_SHARE)]] = True
        nearest = np.abs(v[is_known] - number).min()
        if is_repeated[rows[is_number]].all() and nearest < MIN_ISOLATION * np.median(misses[is_number]):
            result[rows[is_number]] &= _is_fill_number(v[rows[is_number]])
    return result
