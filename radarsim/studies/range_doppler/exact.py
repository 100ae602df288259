"""Exact errors of a linear filter: its gains applied to the true plots' covariance, not to the one it believes.

When truth and model agree there is no manoeuvre, so the error covariance runs through the filter's own gains without
process noise; where the truth leaves the model, the mean error (dynamic error, bias) runs beside it.
"""

import numpy as np

from radarsim.kernels.algebra import unpack
from radarsim.physics.motion import process_noise, transition
from radarsim.studies.range_doppler import propagation
from radarsim.studies.range_doppler.filters import LinearFilter
from radarsim.studies.range_doppler.propagation import Plots


def error_recursion(
    one: LinearFilter, plots: Plots, truth: np.ndarray, dt: float, drawn: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Lasting errors E (K, 3, C) and covariance S (K, 3, 3) of what noise makes, at every scan of a truth (K, 3).

    See `propagation`, of which drawn is. Before the start the estimates are the plots.
    """
    defect, observes, begun = propagation.defects(truth, dt, plots, drawn), one.observes, one.start - 1
    E, S = np.zeros_like(defect), np.zeros((len(truth), 6))
    E[:begun, :observes], S[:begun, 0] = plots.inputs[:observes], plots.sigma[0] ** 2
    S[:begun, 3] = plots.sigma[1] ** 2 if observes > 1 else 0.0
    start = propagation.started(one.weights, one.believed[begun], plots, defect, dt)
    E[begun], S[begun] = start.E[:, :, 0], start.S
    further = propagation.scans(start, observes, plots, one.noise, defect[one.start :], dt)
    for k, errors in enumerate(further, one.start):
        E[k], S[k] = np.reshape(errors.E, (3, -1)), errors.S
    return E, unpack(S.T)


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
