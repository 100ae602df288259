"""Velocities that stand for no value, as 0 or -999 among those of a moving target.

A number that often stands for none is one only where the velocities before and after it and the change of the range
agree with each other and not with it: a target that stops, or moves across the line of sight, has a velocity of 0."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.language.translate import term
from radarsim.recordings.doppler_scale import FOOT_M, KMH_MPS, KNOT_MPS
from radarsim.recordings.grouping import rows_by_name

COLUMNS = ("t_s", "range_m", "velocity_mps")
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
FILL_NOTE = term("velocities that stand for none, as 0 or -999 among others: {count} of {all}; they are left out")


def remove_fill_velocities(columns: Mapping[str, np.ndarray], tracks: Sequence[str]) -> int:
    """Make the velocities that stand for none not-a-number, in place, in COLUMNS (n,) of rows of tracks, '' of no
    track; returns how many these are."""
    t, r, v = (columns[name] for name in COLUMNS)
    is_candidate = _is_fill_number(v)
    if not is_candidate.any():
        return 0
    fills = np.zeros(len(v), dtype=bool)
    for name, rows in rows_by_name(tracks).items():
        if name and is_candidate[rows].any():
            order = rows[np.argsort(t[rows], kind="stable")]
            fills[order] = _are_fills(t[order], r[order], v[order], is_candidate[order])
    v[fills] = np.nan
    return int(fills.sum())


def _is_fill_number(v: np.ndarray) -> np.ndarray:
    """Whether velocities (n,) are among FILL_MPS, but for the rounding of a unit."""
    speeds = np.abs(v)
    places = np.searchsorted(FILL_MPS, speeds * (1 - UNIT_ROUNDING))
    nearest = FILL_MPS[np.minimum(places, len(FILL_MPS) - 1)]
    return np.abs(speeds - nearest) <= UNIT_ROUNDING * nearest


def _are_fills(t: np.ndarray, r: np.ndarray, v: np.ndarray, is_candidate: np.ndarray) -> np.ndarray:
    """Which candidates among the velocities (n,) of a track stand for none."""
    result, is_known = np.zeros(len(v), dtype=bool), np.isfinite(v) & ~is_candidate
    if is_known.sum() < MIN_ROWS:
        return result
    rows = np.flatnonzero(is_candidate)
    expected = np.interp(t[rows], t[is_known], v[is_known])
    misses = np.abs(v[rows] - expected)
    scatter = float(np.median(np.abs(np.diff(v[is_known], n=2))))
    first, last = np.maximum(rows - RATE_ROWS, 0), np.minimum(rows + RATE_ROWS, len(v) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        rates = (r[last] - r[first]) / (t[last] - t[first])
        shares = np.abs(rates - expected) / misses
    result[rows] = (misses > max(MIN_MISS_MPS, MIN_MISS_SCATTERS * scatter)) & (shares < MAX_RATE_SHARE)
    for number in np.unique(v[rows]):
        is_number = v[rows] == number
        is_far = np.median(misses[is_number]) > max(MIN_MISS_MPS, MIN_REPEAT_SCATTERS * scatter)
        if is_number.sum() >= MIN_REPEATS and is_far and np.median(shares[is_number]) < MAX_RATE_SHARE:
            result[rows[is_number & (shares < NEARER_SHARE)]] = True
    return result
