"""Correlated errors of plots."""

import numpy as np


def correlation(rho: float, lags: np.ndarray) -> np.ndarray:
    """ρ to the power of the lags, in periods, an array of any shape (P3 eq. 15).

    A negative ρ has a meaning at whole periods only, so its lags are rounded."""
    if rho < 0:
        lags = np.rint(lags)
        return np.where(lags % 2 == 1, -1.0, 1.0) * np.abs(rho) ** lags
    return np.power(rho, lags) if rho > 0 else np.where(lags == 0, 1.0, 0.0)


def step_correlations(rho: float, t: np.ndarray, period: float) -> np.ndarray:
    """Correlation (K,) of the errors at t[k] and t[k - 1]; 0 at k = 0, and for white errors."""
    return np.concatenate([[0.0], correlation(rho, np.diff(t) / period)]) if rho else np.zeros(len(t))


def error_covariance(sigma: np.ndarray, rho: float, t: np.ndarray, period: float) -> np.ndarray:
    """Covariance (K, K) of the stationary errors of plots with standard deviations sigma (K,), in one coordinate."""
    C = np.outer(sigma, sigma) * correlation(rho, np.abs(t[:, None] - t[None, :]) / period)
    return C if rho else np.diag(np.diag(C))
