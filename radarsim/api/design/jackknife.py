"""The interval of a number from its values without one batch each (jackknife)."""

import math

import numpy as np

from radarsim.report import statistics

ROUNDING_PERCENT = 1e-9  # changes below it, in per cent, may be rounding
ROUNDING_RATIO = ROUNDING_PERCENT / 100  # the same as a ratio; for gains, in points, it is still smaller


def jackknife_interval(leave_one_out: np.ndarray, value: float) -> tuple[float, float, float]:
    """A value with its 95 % interval from the n values without one batch each (n,); n = 1 if it is exact.

    This is the jackknife over groups (Shao & Tu, The Jackknife and Bootstrap, 1995, sec. 2.3). A single batch may have
    no estimate, for instance where few realisations lock."""
    n = len(leave_one_out)
    if np.all(np.abs(leave_one_out) < ROUNDING_RATIO) and abs(value) < ROUNDING_RATIO:
        return 0.0, 0.0, 0.0
    error = 0.0 if n == 1 else (n - 1) / math.sqrt(n) * float(np.std(leave_one_out, ddof=1))
    half_width = 0.0 if n == 1 else float(statistics.student(n - 1)) * error
    return value, value - half_width, value + half_width
