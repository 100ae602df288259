"""Exact errors of a linear filter: its gains applied to the true plots' covariance, not to the one it believes.

When truth and model agree there is no manoeuvre, so the error covariance runs through the filter's own gains without
process noise; where the truth leaves the model, the mean error (dynamic error, bias) runs beside it.
"""

import numpy as np

from radarsim.physics.motion import process_noise, transition


def start_errors(weights: np.ndarray, truth: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (3,) and covariance (3, 3) of the error of the least-squares start.

    weights (3, 2, n); truth (K, 3), of which the first n scans are used; sigma (2,) of the plots.
    """
    n = weights.shape[2]
    bias = np.einsum("ijk,kj->i", weights, truth[:n, :2]) - truth[n - 1]
    covariance = np.einsum("ijk,j,ljk->il", weights, sigma**2, weights)
    return bias, covariance


def error_recursion(
    weights: np.ndarray, gains: np.ndarray, observes: int, truth: np.ndarray, sigma: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Bias (K, 3) and covariance (K, 3, 3) of the error at every scan.

    S⁺ = (I - KH) B S Bᵀ (I - KH)ᵀ + K R Kᵀ, and the bias likewise with the model's defect B x - x⁺ of the truth added.
    Before the start the estimates are the plots. weights (3, 2, n), gains (K, 3, 2), truth (K, 3), sigma (2,).
    """
    scans, start = len(gains), weights.shape[2]
    F, H = transition(dt), np.eye(3)[:observes]
    R = np.diag(sigma[:observes] ** 2)
    bias, covariance = np.zeros((scans, 3)), np.zeros((scans, 3, 3))
    covariance[: start - 1, :observes, :observes] = R
    bias[start - 1], covariance[start - 1] = start_errors(weights, truth, sigma)
    defect = truth[:-1] @ F.T - truth[1:]
    settled = False
    for k in range(start, scans):
        if not (settled and np.array_equal(gains[k], gains[k - 1])):
            K = gains[k, :, :observes]
            kept = np.eye(3) - K @ H
            A = kept @ F
            S = A @ covariance[k - 1] @ A.T + K @ R @ K.T
            covariance[k] = (S + S.T) / 2
            settled = np.array_equal(covariance[k], covariance[k - 1])
        else:  # the covariance is stationary to the last bit while the gain does not change
            covariance[k] = covariance[k - 1]
        bias[k] = A @ bias[k - 1] + kept @ defect[k - 1]
    return bias, covariance


def bias_response(weights: np.ndarray, gains: np.ndarray, observes: int, dt: float) -> np.ndarray:
    """The error (K, 3, 2) that a range one metre too long, and a velocity one m/s too high, in every plot lead to."""
    scans, start = len(gains), weights.shape[2]
    F, H, inputs = transition(dt), np.eye(3)[:observes], np.eye(2)[:observes]
    response = np.zeros((scans, 3, 2))
    response[: start - 1, :observes] = inputs
    response[start - 1] = weights.sum(axis=2)
    for k in range(start, scans):
        K = gains[k, :, :observes]
        response[k] = (np.eye(3) - K @ H) @ F @ response[k - 1] + K @ inputs
    return response


def defect_response(
    weights: np.ndarray, gains: np.ndarray, observes: int, defects: np.ndarray, dt: float
) -> np.ndarray:
    """The errors (K, 3, C) that truths lead to which leave the model by defects (K, 3, C), F x − x⁺, scan by scan."""
    scans, start = len(gains), weights.shape[2]
    F, H = transition(dt), np.eye(3)[:observes]
    response, truth = np.zeros_like(defects), np.zeros((start, *defects.shape[1:]))
    for k in range(1, start):  # from zero, as the start forgets what a filter of the model can follow
        truth[k] = F @ truth[k - 1] - defects[k]
    response[start - 1] = np.einsum("ijk,kjc->ic", weights, truth[:, :2]) - truth[-1]
    for k in range(start, scans):
        kept = np.eye(3) - gains[k, :, :observes] @ H
        response[k] = kept @ (F @ response[k - 1] + defects[k])
    return response


def steady_state(
    observes: int, manoeuvre_variance: float, sigma: np.ndarray, dt: float, noise: str = "random_jerk"
) -> tuple[np.ndarray, np.ndarray]:
    """Steady covariances (3, 3): the one the filter believes, and the true one on a truth without manoeuvre.

    The believed one solves the discrete algebraic Riccati equation; the true one is the fixed point of the error
    recursion under the steady gain (a Lyapunov equation).
    """
    from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

    # Time counted in the filter's own memory, (σ_r²/D_M)^(1/6), where longer than a scan: then no state is tiny.
    unit = max(dt, (sigma[0] ** 2 / manoeuvre_variance) ** (1 / 6))
    scale = sigma[0] * np.array([1.0, 1.0 / unit, 1.0 / unit**2])
    step = dt / unit
    F, H = transition(step), np.eye(3)[:observes]
    R = np.diag((sigma / scale[:2])[:observes] ** 2)
    Q = process_noise(noise, manoeuvre_variance * unit**6 / sigma[0] ** 2, step)
    extrapolated = solve_discrete_are(F.T, H.T, Q, R)
    K = np.linalg.solve(H @ extrapolated @ H.T + R, H @ extrapolated).T
    kept = np.eye(3) - K @ H
    believed = kept @ extrapolated @ kept.T + K @ R @ K.T
    true = solve_discrete_lyapunov(kept @ F, K @ R @ K.T)
    to_units = np.outer(scale, scale)
    return believed * to_units, true * to_units


def normalised_error(
    believed: np.ndarray, bias: np.ndarray, moment: np.ndarray, available: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of eᵀP⁻¹e per estimated component (…,) of a Gaussian error e; not-a-number without components.

    believed (…, 3, 3) is P, bias (…, 3) the mean m of e, moment (…, 3, 3) its second moment M = E eeᵀ, available
    (…, 3) the components of e that there are. The mean is tr P⁻¹M, the variance 2 tr (P⁻¹M)² - 2 (mᵀP⁻¹m)².
    """
    spread = np.diagonal(believed, axis1=-2, axis2=-1)
    scale = np.where(spread > 0, spread, np.inf) ** -0.5  # m, m/s and m/s² brought to one size before solving
    unit = scale[..., :, None] * scale[..., None, :]
    mean, variance = np.full(available.shape[:-1], np.nan), np.full(available.shape[:-1], np.nan)
    for pattern in np.unique(available.reshape(-1, 3), axis=0):
        known, where = np.flatnonzero(pattern), np.all(available == pattern, axis=-1)
        if known.size:
            P, M = ((part * unit)[where][:, known][:, :, known] for part in (believed, moment))
            m = (bias * scale)[where][:, known, None]
            ratio = np.linalg.solve(P, M)
            shift = (m * np.linalg.solve(P, m)).sum(axis=(1, 2))
            mean[where] = np.trace(ratio, axis1=1, axis2=2) / known.size
            variance[where] = 2 * (np.einsum("nij,nji->n", ratio, ratio) - shift**2) / known.size**2
    return mean, variance
