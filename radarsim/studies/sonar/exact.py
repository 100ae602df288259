"""Exact results of P3: generalised least squares, closed forms, true errors of any linear filter.

Everything is for one coordinate; its state (value, rate, acceleration) has `size` 2 or 3 components, for degree 1 or 2.
"""

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.sonar.world import Values, error_covariance


def design_matrix(t: np.ndarray, size: int) -> np.ndarray:
    """Rows (n, size) that map the state at the last of the times t to the values at all of them."""
    since = t - t[-1]
    return np.stack([np.ones_like(since), since, since**2 / 2], axis=1)[:, :size]


def generalised_least_squares(t: np.ndarray, C: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Optimal weights (size, n) for the state at the last plot, and their covariance (AᵀC⁻¹A)⁻¹ (size, size).

    t (n,) in s; C (n, n) the covariance of the errors of the plots. Solved by a triangular factor of C and a QR
    factorisation in unit time, so that no digits are lost for ρ = 0.99 or long tracks.
    """
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

    sigma (n,) are the standard deviations of the plots, infinite where they are missed.
    """
    detected = np.isfinite(sigma)
    C = error_covariance(sigma[detected], rho, t[detected], period)
    _, P = generalised_least_squares(t[detected], C, size)
    F = transition(t[-1] - t[detected][-1], size)
    return np.sqrt(np.diagonal(F @ P @ F.T))


# ---- the paper's closed forms, degree 1, equal intervals and weights ----------------------------------------------
def sigma_smoothed(n: Values) -> Values:
    """σ of the smoothed coordinate at the last of n plots, per σ of a plot (formula below P3 eq. 2)."""
    return np.sqrt(2 * (2 * n - 1) / (n * (n + 1)))


def sigma_extrapolated(n: Values) -> Values:
    """σ of the coordinate extrapolated by one scan from n plots, per σ of a plot (formula below P3 eq. 2)."""
    return np.sqrt(2 * (2 * n + 1) / (n * (n - 1)))


def sigma_acceleration(n: Values, period: float) -> Values:
    """σ of the acceleration of a quadratic through n plots, per σ of a plot (P3 eq. 3)."""
    return np.sqrt(720 / (n * (n**2 - 1) * (n**2 - 4))) / period**2


def gains_closed(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A_n and B_n of P3 (14): gains of the residual in coordinate and velocity (per period)."""
    return 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))


# ---- true errors of a given filter --------------------------------------------------------------------------------
def recursive_errors(
    gain: np.ndarray,
    carry: np.ndarray,
    t: np.ndarray,
    truth: np.ndarray,
    steps: np.ndarray,
    sigma: np.ndarray,
    walk: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Bias (M, K, 3) and covariance (M, K, 3, 3) of a recursive filter's error, for M patterns of missed plots at once.

    gain (M, K, 4) for value, rate, acceleration and the carried error; carry (K,) the correlation that the filter
    assumes from scan to scan; truth (K, 3); steps (K,) the true correlation of neighbouring errors; sigma (K,) of the
    plots; walk the standard deviation of a random acceleration, constant over each interval. The error of the estimate
    (3), the carried error and the true error of the plot are propagated jointly: the linear recursion reads nothing
    else.
    """
    patterns, scans = gain.shape[:2]
    mean, S = np.zeros((patterns, 5)), np.zeros((patterns, 5, 5))
    mean[:, :3] = -truth[0]
    bias, covariance = np.zeros((patterns, scans, 3)), np.zeros((patterns, scans, 3, 3))
    for k in range(scans):
        a, defect = steps[k], np.zeros(3)
        A, Q = np.zeros((5, 5)), np.zeros((5, 5))
        A[:3, :3] = np.eye(3)
        if k:
            dt = t[k] - t[k - 1]
            A[:3, :3] = transition(dt)
            pushed = np.array([dt**2 / 2, dt, 0.0]) * walk
            Q[:3, :3] = np.outer(pushed, pushed)
            defect = A[:3, :3] @ truth[k - 1] - truth[k]
        A[3, 3] = carry[k]
        A[4, 4] = a  # σ may differ between sensors; errors are then uncorrelated and a is 0
        Q[4, 4] = sigma[k] ** 2 * (1 - a * a)
        U = np.tile(np.eye(5), (patterns, 1, 1))
        U[:, :4] += gain[:, k, :, None] * np.array([-1.0, 0.0, 0.0, -1.0, 1.0])
        T = U @ A
        mean = np.einsum("mij,mj->mi", T, mean) + U[:, :, :3] @ defect
        S = T @ S @ T.transpose(0, 2, 1) + U @ Q @ U.transpose(0, 2, 1)
        bias[:, k], covariance[:, k] = mean[:, :3], S[:, :3, :3]
    return bias, covariance


def weighted_errors(
    weights: np.ndarray, first: int, t: np.ndarray, truth: np.ndarray, C: np.ndarray, walk: float, origin: int
) -> tuple[np.ndarray, np.ndarray]:
    """Bias (M, 3) and covariance (M, 3, 3) of an estimate with weights (M, 3, n) of the plots first … first + n - 1.

    The estimate is of the state at the last of these scans. C (n, n) is the covariance of the plots; a random
    acceleration `walk`, if any, acts from scan `origin` on (earlier effects cancel once the estimate reproduces
    straight lines).
    """
    n = weights.shape[2]
    last = first + n - 1
    bias = weights @ truth[first : last + 1, 0] - truth[last]
    covariance = weights @ C @ weights.transpose(0, 2, 1)
    for i in range(origin + 1, last + 1) if walk else ():
        dt = t[i] - t[i - 1]
        pushed = np.array([dt**2 / 2, dt, 0.0]) * walk
        since = t[first : last + 1] - t[i]
        moved = np.where(since >= -1e-9 * dt, pushed[0] + pushed[1] * since, 0.0)
        effect = weights @ moved - transition(t[last] - t[i]) @ pushed
        covariance = covariance + effect[:, :, None] * effect[:, None, :]
    return bias, covariance


def consistency(believed: np.ndarray, bias: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Expected normalised squared error tr(P⁻¹(S + m mᵀ)) (…,).

    It is the size of the state for a consistent filter and larger for an optimistic one.
    """
    moment = covariance + bias[..., :, None] * bias[..., None, :]
    return np.trace(np.linalg.solve(believed, moment), axis1=-2, axis2=-1)
