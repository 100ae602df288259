"""Exact steady errors and gains of radars, and the expected NEES of a filter.

The true errors of a linear filter are those of its gains applied to the true covariance of the plots, not to the one
that the filter believes."""

import numpy as np

from radarsim.physics.motion import manoeuvre_covariance, process_noise, transition

DOUBLINGS = 20  # a million scans: hundreds of memories where a memory has thousands


def exact_gains(C_theta: np.ndarray, Lambda: np.ndarray) -> np.ndarray:
    """Exact steady gains (3, n) in per cent of radars with these numbers (n,), their scan period in them."""
    base = steady_variances(np.zeros_like(C_theta), Lambda)
    return 100 * (1 - np.sqrt(steady_variances(C_theta, Lambda) / base))


def steady_variances(C_theta: np.ndarray, Lambda: np.ndarray) -> np.ndarray:
    """Steady variances (3, n) of the filters of many radars at once, each in units of its own; C_θ = 0: range alone. As
    `steady_state`, by doubling: each round of the Riccati equation's iteration does as many scans as all before
    (Anderson, Int. J. Control 28, 1978, 295-306), and so does each of the sum of what the noise leaves."""
    n, time_unit = len(Lambda), np.maximum(1.0, Lambda ** (-1 / 3))  # time in memories τ₂, where longer than a scan
    F = np.stack([transition(1 / u) for u in time_unit])
    Q = np.stack(
        [manoeuvre_covariance(noise_index**2 * u**6, 1 / u) for noise_index, u in zip(Lambda, time_unit, strict=True)]
    )
    information = np.zeros((n, 3, 3))  # HᵀR⁻¹H
    information[:, 0, 0], information[:, 1, 1] = 1.0, C_theta / time_unit**2
    P, A, G = Q, F.transpose(0, 2, 1), information
    for _ in range(DOUBLINGS):
        W = np.linalg.inv(np.eye(3) + G @ P)
        P, A, G = (P + A.transpose(0, 2, 1) @ P @ W @ A, A @ W @ A, G + A @ W @ G @ A.transpose(0, 2, 1))
    I_minus_KH = np.linalg.inv(np.eye(3) + P @ information)  # I − KH
    believed = I_minus_KH @ P
    S, M = believed @ information @ believed.transpose(0, 2, 1), I_minus_KH @ F  # K R Kᵀ, with K = believed HᵀR⁻¹
    for _ in range(DOUBLINGS):
        S, M = S + M @ S @ M.transpose(0, 2, 1), M @ M
    return np.diagonal(S, axis1=1, axis2=2).T


def steady_state(
    observes: int, manoeuvre_variance: float, sigma: np.ndarray, dt: float, noise: str = "random_jerk"
) -> tuple[np.ndarray, np.ndarray]:
    """Steady covariances (3, 3): the one the filter believes, and the true one on a truth without manoeuvre. The
    believed one solves the discrete algebraic Riccati equation; the true one is the fixed point of the error recursion
    under the steady gain (a Lyapunov equation)."""
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
    I_minus_KH = np.eye(3) - K @ H
    believed = I_minus_KH @ extrapolated @ I_minus_KH.T + K @ R @ K.T
    true = solve_discrete_lyapunov(I_minus_KH @ F, K @ R @ K.T)
    to_units = np.outer(scale, scale)
    return believed * to_units, true * to_units


def normalised_error(
    believed: np.ndarray, bias: np.ndarray, moment: np.ndarray, available: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of eᵀP⁻¹e per estimated component (…,) of a Gaussian error e; not-a-number without components
    and where P is singular.

    believed (…, 3, 3) is P, bias (…, 3) the mean m of e, moment (…, 3, 3) its second moment M = E eeᵀ, available
    (…, 3) the components of e that there are. The mean is tr P⁻¹M, the variance 2 tr (P⁻¹M)² - 2 (mᵀP⁻¹m)²."""
    spread = np.diagonal(believed, axis1=-2, axis2=-1)
    scale = np.where(spread > 0, spread, np.inf) ** -0.5  # m, m/s and m/s² brought to one size before solving
    unit = scale[..., :, None] * scale[..., None, :]
    mean, variance = np.full(available.shape[:-1], np.nan), np.full(available.shape[:-1], np.nan)
    for pattern in np.unique(available.reshape(-1, 3), axis=0):
        components, has_pattern = np.flatnonzero(pattern), np.all(available == pattern, axis=-1)
        if components.size:
            P, M = ((part * unit)[has_pattern][:, components][:, :, components] for part in (believed, moment))
            m = (bias * scale)[has_pattern][:, components, None]
            P[np.linalg.slogdet(P).sign == 0] = np.nan  # of a filter that diverges, by rounding; solve would raise
            ratio = np.linalg.solve(P, M)
            shift = (m * np.linalg.solve(P, m)).sum(axis=(1, 2))
            mean[has_pattern] = np.trace(ratio, axis1=1, axis2=2) / components.size
            variance[has_pattern] = 2 * (np.einsum("nij,nji->n", ratio, ratio) - shift**2) / components.size**2
    return mean, variance
