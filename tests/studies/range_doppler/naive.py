"""Textbook twin of the linear kernels: one realisation, plain NumPy, and the paper's closed forms (P1 eqs. 5-13).

Slow and short on purpose; shares no line with the package. With it, to what rounding such filters are known.
"""

import numpy as np

from tests.tolerances import rounding, scaled_condition


def precision(covariances, scans=None, loss=1.0):
    """Relative rounding of σ, and of estimates over σ, of a filter that believes these covariances (K, 3, 3).

    Ten operations a scan of numbers whose condition is the worst of them; nothing is forgotten within so many scans.
    """
    return rounding(loss * scaled_condition(covariances).max(), 10 * (scans or len(covariances)))


def update_loss(covariances, Q, sigma, dt):
    """How many times more was known to vary before a plot than is left of it: digits lost in their difference."""
    predicted = transition(dt) @ covariances @ transition(dt).T + Q
    return 1 + (np.diagonal(predicted, axis1=-2, axis2=-1)[..., : len(sigma)] / np.square(sigma)).max()


def transition(dt):
    """B, eq. (3)."""
    return np.array([[1.0, dt, dt**2 / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def manoeuvre(variance, dt):
    """M, eq. (6): a random jerk of this variance, constant over a scan."""
    g = np.array([dt**3 / 6.0, dt**2 / 2.0, dt])
    return variance * np.outer(g, g)


def observation(observes):
    """H, eq. (10)."""
    return np.eye(3)[:observes]


def start(plots, observes, scans, sigma, dt):
    """Weighted least squares at the last of `scans` plots (scans, 2): the estimate (3,) and its covariance (3, 3)."""
    H, R = observation(observes), np.diag(np.asarray(sigma)[:observes] ** 2)
    information, vector = np.zeros((3, 3)), np.zeros(3)
    for k in range(scans):
        A = H @ transition((k - scans + 1) * dt)
        information += A.T @ np.linalg.inv(R) @ A
        vector += A.T @ np.linalg.inv(R) @ plots[k, :observes]
    P = np.linalg.inv(information)
    return P @ vector, P


def kalman(plots, observes, scans, variance, sigma, dt):
    """The filter over plots (K, 2): estimates (K, 3), NaN where there is none yet, and covariances (K, 3, 3)."""
    B, M, H = transition(dt), manoeuvre(variance, dt), observation(observes)
    R = np.diag(np.asarray(sigma)[:observes] ** 2)
    estimates, covariances = np.full((len(plots), 3), np.nan), np.full((len(plots), 3, 3), np.nan)
    for k in range(scans - 1):
        estimates[k, :observes] = plots[k, :observes]
    x, P = start(plots, observes, scans, sigma, dt)
    estimates[scans - 1], covariances[scans - 1] = x, P
    for k in range(scans, len(plots)):
        x, P = B @ x, B @ P @ B.T + M
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (plots[k, :observes] - H @ x), P - K @ H @ P
        estimates[k], covariances[k] = x, P
    return estimates, covariances


def extrapolated_normalised(C, CM):
    """Eq. (8): the nine elements of the extrapolation's covariance per D_fr in units of the scan period.

    C (3, 3) is the estimate's, CM = D_M dt^6 / D_fr.
    """
    (c11, c12, c13), (_, c22, c23), (_, _, c33) = C
    e11 = c11 + 2 * c12 + c13 + c22 + c23 + c33 / 4 + CM / 36
    e12 = c12 + c13 + c22 + 1.5 * c23 + c33 / 2 + CM / 12
    e13 = c13 + c23 + c33 / 2 + CM / 6
    e22 = c22 + 2 * c23 + c33 + CM / 4
    e23 = c23 + c33 + CM / 2
    e33 = c33 + CM
    return np.array([[e11, e12, e13], [e12, e22, e23], [e13, e23, e33]])


def gains_normalised(E, C_theta):
    """Eq. (12): the six gains (3, 2) of range and velocity, in units of the scan period, for an extrapolation E (3, 3).

    C_theta = D_fr / (dt² D_fVr); zero is a radar that does not measure the velocity.
    """
    (e11, e12, e13), (_, e22, e23), _ = E
    determinant = (1 + e11) * (1 + C_theta * e22) - C_theta * e12**2
    minor = [e11 * e22 - e12**2, 0.0, e13 * e22 - e12 * e23]
    of_range = [e11 + C_theta * minor[0], e12, e13 + C_theta * minor[2]]
    of_velocity = [e12, e22 + e11 * e22 - e12**2, e23 + e11 * e23 - e12 * e13]
    return np.stack([np.array(of_range), C_theta * np.array(of_velocity)], axis=1) / determinant


def gains(observes, scans, variance, sigma, dt, K):
    """Gains (K, 3, 2) by the closed forms, zero up to the start."""
    units = np.array([1.0, 1.0 / dt, 1.0 / dt**2])
    CM, C_theta = variance * dt**6 / sigma[0] ** 2, sigma[0] ** 2 / (dt * sigma[1]) ** 2 if observes == 2 else 0.0
    _, P = start(np.zeros((scans, 2)), observes, scans, sigma, dt)
    C, H = P / np.outer(units, units) / sigma[0] ** 2, np.eye(3)[:2]
    out = np.zeros((K, 3, 2))
    for k in range(scans, K):
        E = extrapolated_normalised(C, CM)
        g = gains_normalised(E, C_theta)
        C = E - g @ H @ E
        out[k] = units[:, None] * g / units[:2]
    return out
