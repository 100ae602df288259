"""What is known of P3 without sampling: generalised least squares, closed forms, true errors of any linear filter.

Everything concerns one coordinate with states (value, rate, acceleration) of `size` 2 or 3 components, that is of
degree 1 or 2.
"""

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.sonar.world import error_covariance


def design_matrix(t: np.ndarray, size: int) -> np.ndarray:
    """Rows (n, size) that give the plots at times t from the state at the last of them."""
    since = t - t[-1]
    return np.stack([np.ones_like(since), since, since**2 / 2], axis=1)[:, :size]


def generalised_least_squares(t: np.ndarray, C: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Optimal weights (size, n) for the state at the last plot, and their covariance (AᵀC⁻¹A)⁻¹ (size, size).

    t (n,) in s; C (n, n) the covariance of the plots' errors. Solved by a triangular factor of C and a QR
    factorisation in unit time, so that ρ = 0.99 and long tracks lose no figures.
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
    """Least σ (size,) of the state at the last time, from plots of standard deviations sigma (n,), infinite where
    missed.
    """
    came = np.isfinite(sigma)
    C = error_covariance(sigma[came], rho, t[came], period)
    _, P = generalised_least_squares(t[came], C, size)
    F = transition(t[-1] - t[came][-1], size)
    return np.sqrt(np.diagonal(F @ P @ F.T))


def error_of_weights(weights: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Covariance W C Wᵀ of any unbiased linear estimate with weights W (size, n)."""
    return weights @ C @ weights.T


# ---- the paper's closed forms, degree 1, equal intervals and weights ----------------------------------------------
def sigma_smoothed(n):
    """σ of the smoothed coordinate at the last of n plots, per σ of a plot (formula below P3 eq. 2)."""
    return np.sqrt(2 * (2 * n - 1) / (n * (n + 1)))


def sigma_extrapolated(n):
    """σ of the coordinate extrapolated by one scan from n plots, per σ of a plot (formula below P3 eq. 2)."""
    return np.sqrt(2 * (2 * n + 1) / (n * (n - 1)))


def sigma_acceleration(n, period):
    """σ of the acceleration of a quadratic through n plots, per σ of a plot (P3 eq. 3)."""
    return np.sqrt(720 / (n * (n**2 - 1) * (n**2 - 4))) / period**2


def gains_closed(n):
    """A_n and B_n of P3 (14): weights of the residual in coordinate and velocity (per period)."""
    return 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))


def memory_closed(n):
    """f_n, g_n, h_n, K_n of P3 step 5 for unit weights."""
    return n, n * (n - 1) / 2, n * (n - 1) * (2 * n - 1) / 6, n**2 * (n**2 - 1) / 12


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
    plots; walk the standard deviation of a random acceleration, constant over each interval. Propagated jointly: the
    estimate's error (3), the carried error and the plot's true error, which is all that the linear recursion reads.
    """
    patterns, scans = gain.shape[:2]
    mean, S = np.zeros((patterns, 5)), np.zeros((patterns, 5, 5))
    mean[:, :3] = -truth[0]
    bias, covariance = np.zeros((patterns, scans, 3)), np.zeros((patterns, scans, 3, 3))
    for k in range(scans):
        F, a = np.eye(3), steps[k]
        pushed = np.zeros(3)
        A, defect = np.zeros((5, 5)), np.zeros(3)
        if k:
            dt = t[k] - t[k - 1]
            F = transition(dt)
            pushed = np.array([dt**2 / 2, dt, 0.0]) * walk
            defect = F @ truth[k - 1] - truth[k]
        A[:3, :3], A[3, 3] = F, carry[k]
        # A plot's σ may change from sensor to sensor; errors are then uncorrelated and a is 0.
        A[4, 4] = a
        Q = np.zeros((5, 5))
        Q[:3, :3] = np.outer(pushed, pushed)
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
    """Bias (M, 3) and covariance (M, 3, 3) of an estimate made of weights (M, 3, n) of the plots first … first + n - 1.

    The estimate is of the state at the last of these scans. C (n, n) covers the plots; a random acceleration `walk`,
    if any, acts from scan `origin` on (what lies before cancels once the estimate reproduces straight lines).
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
    """Expected normalised squared error tr(P⁻¹(S + m mᵀ)) (…,): `size` for a consistent filter, more for an optimistic
    one.
    """
    moment = covariance + bias[..., :, None] * bias[..., None, :]
    return np.trace(np.linalg.solve(believed, moment), axis1=-2, axis2=-1)
