"""Transition matrices and process noise of targets in one coordinate."""

import numpy as np

MAX_ROUNDING = 1e-7  # of a correlation: what rounding may leave
NEGLIGIBLE_SHARE = 1e-15  # of the largest element of a covariance: a variance that is only rounding


def transition(dt: float, size: int = 3) -> np.ndarray:
    """Transition matrix (size, size) of value, rate, …: element i, j is dt**(j - i) / (j - i)! (P1 eq. 3, its B)."""
    F = np.eye(size)
    for lag in range(1, size):
        F += np.diag(np.full(size - lag, dt**lag / float(np.prod(range(1, lag + 1)))), lag)
    return F


def transitions(dt: np.ndarray, size: int = 3) -> np.ndarray:
    """The transition matrices (n, size, size) over times (n,)."""
    F, power = np.tile(np.eye(size), (len(dt), 1, 1)), np.ones(len(dt))
    for lag in range(1, size):
        power = power * dt / lag
        for i in range(size - lag):
            F[:, i, i + lag] = power
    return F


def white_jerk_covariance(variance: float, dt: float) -> np.ndarray:
    """Covariance (3, 3) that white jerk of spectral density variance · dt, in (m/s³)² s, adds over a scan. A jerk that
    white noise gives has, averaged over a scan, the variance `variance`, (m/s³)². (Bar-Shalom, Li & Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, eq. 6.2.3-7.)"""
    g = [[dt**4 / 20, dt**3 / 8, dt**2 / 6], [dt**3 / 8, dt**2 / 3, dt / 2], [dt**2 / 6, dt / 2, 1.0]]
    return variance * dt**2 * np.array(g)


def acceleration_step_covariance(variance: float, dt: float) -> np.ndarray:
    """Covariance (3, 3) that a step of the acceleration at the beginning of a scan, of variance · dt², adds by its end.
    The piecewise constant Wiener acceleration (Bar-Shalom, Li & Kirubarajan 2001, eq. 6.3.3-4), with the acceleration
    gaining in a scan what a jerk of this variance, (m/s³)², gives it."""
    g = np.array([dt**2 / 2, dt, 1.0])
    return variance * dt**2 * np.outer(g, g)


def process_noise(kind: str, variance: float, dt: float) -> np.ndarray:
    """Q (3, 3) of a scan: `random_jerk` (P1 eq. 6), `white_jerk` or `white_acceleration`; variance is D_M, (m/s³)²."""
    covariances = {
        "random_jerk": manoeuvre_covariance,
        "white_jerk": white_jerk_covariance,
        "white_acceleration": acceleration_step_covariance,
    }
    return covariances[kind](variance, dt)


def manoeuvre_covariance(variance: float, dt: float, size: int = 3) -> np.ndarray:
    """Covariance (size, size) that a random derivative of order `size`, constant over the scan, adds (P1 eq. 6, its M).
    For size 3 the variance is that of a random jerk, (m/s³)²; for size 2 of a random acceleration, (m/s²)²."""
    g = transition(dt, size + 1)[:-1, -1]
    return variance * np.outer(g, g)


def is_covariance(matrix: np.ndarray) -> bool:
    """Whether a finite matrix (n, n) is symmetric and not negative, up to rounding: of any units, by correlations."""
    rounding = NEGLIGIBLE_SHARE * (np.abs(matrix).max() or 1.0)
    sigma = np.sqrt(np.maximum(np.diag(matrix), rounding))
    scaled = matrix / np.outer(sigma, sigma)  # else m² would hide what is wrong of rad²
    asymmetry = np.abs(scaled - scaled.T).max()
    np.fill_diagonal(scaled, np.diag(scaled).clip(0))
    return bool(
        np.diag(matrix).min() >= -rounding
        and asymmetry <= MAX_ROUNDING
        and np.linalg.eigvalsh(scaled)[0] >= -MAX_ROUNDING
    )
