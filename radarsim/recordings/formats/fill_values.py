"""Velocities that stand for no value, as 0 or -999 among those of a moving target.

A number that often stands for none is one only where the velocities before and after it and the change of the range
agree with each other and not with it: a target that stops, or moves across the line of sight, has a velocity of 0."""

import numpy as np

from radarsim.language.translate import term
from radarsim.recordings.doppler_scale import FOOT_M, KMH_MPS, KNOT_MPS
from radarsim.recordings.formats.records import PLOTS, Batch
from radarsim.recordings.grouping import rows_by_name

FILL_NUMBERS = 999.0, 999.9, 9999.0, 9999.9, 32767.0, 32768.0, 99999.0  # of either sign, besides 0
UNITS_MPS = 1.0, KNOT_MPS, KMH_MPS, FOOT_M
FILL_MPS = np.array([0.0, *(number * unit for number in FILL_NUMBERS for unit in UNITS_MPS)])
UNIT_ROUNDING = 1e-9  # relative, of a conversion
MIN_MISS_MPS, MIN_MISS_SCATTERS = 5.0, 20.0  # from the velocities beside it; in their median second differences
MAX_RATE_SHARE = 0.25  # of that miss, by which the change of the range may miss the velocities beside it
RATE_ROWS = 3  # to either side, over which the change of the range is taken
MIN_ROWS = 5  # of a track, with other velocities
FILL_NOTE = term("velocities that stand for none, as 0 or -999 among others: {count} of {all}; they are left out")


def remove_fill_velocities(batch: Batch) -> int:
    """Make the velocities of plots that stand for none not-a-number, in place; returns how many these are."""
    if batch.kind != PLOTS:
        return 0
    v = batch.columns["velocity_mps"]
    is_candidate = np.isclose(np.abs(v)[:, None], FILL_MPS, rtol=UNIT_ROUNDING, atol=0.0).any(axis=1)
    if not is_candidate.any():
        return 0
    fills = np.zeros(len(v), dtype=bool)
    for name, rows in rows_by_name(batch.track).items():
        if name and is_candidate[rows].any():
            order = rows[np.argsort(batch.columns["t_s"][rows], kind="stable")]
            t, r = batch.columns["t_s"][order], batch.columns["range_m"][order]
            fills[order] = _are_fills(t, r, v[order], is_candidate[order])
    v[fills] = np.nan
    return int(fills.sum())


def _are_fills(t: np.ndarray, r: np.ndarray, v: np.ndarray, is_candidate: np.ndarray) -> np.ndarray:
    """Which candidates among the velocities (n,) of a track stand for none."""
    result, is_known = np.zeros(len(v), dtype=bool), np.isfinite(v) & ~is_candidate
    if is_known.sum() < MIN_ROWS:
        return result
    rows = np.flatnonzero(is_candidate)
    expected = np.interp(t[rows], t[is_known], v[is_known])
    misses = np.abs(v[rows] - expected)
    is_off = misses > max(MIN_MISS_MPS, MIN_MISS_SCATTERS * float(np.median(np.abs(np.diff(v[is_known], n=2)))))
    first, last = np.maximum(rows - RATE_ROWS, 0), np.minimum(rows + RATE_ROWS, len(v) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        rates = (r[last] - r[first]) / (t[last] - t[first])
    result[rows] = is_off & (np.abs(rates - expected) < MAX_RATE_SHARE * misses)
    return result
