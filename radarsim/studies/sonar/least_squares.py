"""Generalised least squares of one coordinate: optimal weights, and the smallest possible σ."""

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.sonar.plot_errors import error_covariance


def design_matrix(t: np.ndarray, size: int) -> np.ndarray:
    """Rows (n, size) that map the state at the last of the times t to the values at all of them."""
    since = t - t[-1]
    return np.stack([np.ones_like(since), since, since**2 / 2], axis=1)[:, :size]


def generalised_least_squares(t: np.ndarray, C: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Optimal weights (size, n) for the state at the last plot, and their covariance (AᵀC⁻¹A)⁻¹ (size, size).

    t (n,) in s; C (n, n) the covariance of the errors of the plots. Solved by a triangular factor of C and a QR
    factorisation in unit time, so that no digits are lost for ρ = 0.99 or long tracks."""
    span = max(t[-1] - t[0], 1e-300)
    scale = np.array([1.0, 1.0 / span, 1.0 / span**2])[:size]
    factor = np.linalg.cholesky(C)
    whitened = np.linalg.solve(factor, design_matrix(t, size) * scale)
    q, r = np.linalg.qr(whitened)
    weights = np.linalg.solve(r, q.T) @ np.linalg.inv(factor)
    root = np.linalg.inv(r)
    return scale[:, None] * weights, np.outer(scale, scale) * (root @ root.T)


def optimal_sigma(t: np.ndarray, sigma: np.ndarray, rho: float, period: float, size: int) -> np.ndarray:
    """The smallest possible σ (size,) of the state at the last time.

    sigma (n,) are the standard deviations of the plots, infinite where they are missed."""
    detected = np.isfinite(sigma)
    C = error_covariance(sigma[detected], rho, t[detected], period)
    _, P = generalised_least_squares(t[detected], C, size)
    F = transition(t[-1] - t[detected][-1], size)
    return np.sqrt(np.diagonal(F @ P @ F.T))
