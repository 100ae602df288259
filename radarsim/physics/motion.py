"""Polynomial motion over one scan: transition matrices and the covariance of a random manoeuvre."""

import numpy as np


def transition(dt: float, size: int = 3) -> np.ndarray:
    """Transition matrix (size, size) of value, rate, …: element i, j is dt**(j - i) / (j - i)! (P1 eq. 3, its B)."""
    F = np.eye(size)
    for lag in range(1, size):
        F += np.diag(np.full(size - lag, dt**lag / float(np.prod(range(1, lag + 1)))), lag)
    return F


def manoeuvre_covariance(variance: float, dt: float, size: int = 3) -> np.ndarray:
    """Covariance (size, size) that a random derivative of order `size`, constant over the scan, adds (P1 eq. 6, its M).

    For size 3 the variance is that of a random jerk, (m/s³)²; for size 2 of a random acceleration, (m/s²)².
    """
    g = transition(dt, size + 1)[:-1, -1]
    return variance * np.outer(g, g)
