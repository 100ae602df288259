"""Textbook twins of the sonar filters: one coordinate, one realisation, one plot after the other, plain NumPy.

Each takes times t (K,), plots z (K,) with not-a-number where missed, and gives estimates (K, size) with not-a-number
where there is none, and their covariances (K, size, size). Nothing here is shared with the package.
"""

import numpy as np


def F(dt, size):
    return np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])[:size, :size]


def Q(dt, size, variance):
    g = np.array([dt**2 / 2, dt]) if size == 2 else np.array([dt**3 / 6, dt**2 / 2, dt])
    return variance * np.outer(g, g)


def batch(t, z, size, sigma, rho=0.0, period=1.0, last=None):
    """Generalised least squares on all plots so far (or the last few) at every scan, by the normal equations.

    Plots are taken relative to the last one, so that no digits are lost to what they have in common.
    """
    x, P = np.full((len(t), size), np.nan), np.full((len(t), size, size), np.nan)
    for k in range(len(t)):
        at = [j for j in range(k + 1) if not np.isnan(z[j])][-(last or k + 1) :]
        m = min(len(at), size)
        s = t[at] - t[k]
        A = np.stack([s**0, s, s**2 / 2], axis=1)[:, :m]
        lags = np.rint(np.abs(s[:, None] - s[None, :]) / period).astype(int)
        inverse = np.linalg.inv(sigma**2 * (rho**lags if rho else np.eye(len(at))))
        P[k, :m, :m] = np.linalg.inv(A.T @ inverse @ A)
        x[k, :m] = P[k, :m, :m] @ A.T @ inverse @ (z[at] - z[at[-1]])
        x[k, 0] += z[at[-1]]
    return x, P


def kalman(t, z, size, sigma, variance=0.0, gain=None):
    """Kalman filter (11), or one with the settled `gain` (size,), from the least-squares start."""
    x, P = batch(t, z, size, sigma)
    started = np.flatnonzero(~np.isnan(z))[size - 1]
    H = np.eye(size)[:1]
    for k in range(started + 1, len(t)):
        A = F(t[k] - t[k - 1], size)
        x[k], P[k] = A @ x[k - 1], A @ P[k - 1] @ A.T + Q(t[k] - t[k - 1], size, variance)
        if np.isnan(z[k]):
            continue
        K = P[k] @ H.T / (H @ P[k] @ H.T + sigma**2) if gain is None else gain[:, None]
        x[k] = x[k] + K[:, 0] * (z[k] - x[k, 0])
        left = np.eye(size) - K @ H
        P[k] = left @ P[k] @ left.T + sigma**2 * K @ K.T
    return x, P


def augmented(t, z, size, sigma, rho, variance=0.0, period=1.0):
    """The filter of the state with the error beside it and exact plots, steps 1-4 with the plus and H = [H | I]."""
    x, P = batch(t, z, size, sigma, rho, period)
    started = np.flatnonzero(~np.isnan(z))[size - 1]
    H = np.eye(size + 1)[:1] + np.eye(size + 1)[-1:]
    y = np.append(x[started], z[started] - x[started, 0])
    joint = np.vstack([np.eye(size), -np.eye(size)[:1]])
    S = joint @ P[started] @ joint.T
    for k in range(started + 1, len(t)):
        dt = t[k] - t[k - 1]
        A, N = np.zeros((size + 1, size + 1)), np.zeros((size + 1, size + 1))
        A[:size, :size], N[:size, :size] = F(dt, size), Q(dt, size, variance)
        A[-1, -1] = rho ** round(dt / period)
        N[-1, -1] = sigma**2 * (1 - A[-1, -1] ** 2)
        y, S = A @ y, A @ S @ A.T + N
        if not np.isnan(z[k]):
            K = S @ H.T / (H @ S @ H.T)
            y, S = y + K[:, 0] * (z[k] - H @ y), S - K @ H @ S
        x[k], P[k] = y[:size], S[:size, :size]
    return x, P


def differenced(t, z, size, sigma, rho, period=1.0):
    """Plain recursive least squares on u_n - ρ^m u_{n-m} with H' = H F - ρ^m H, on the state at the previous plot."""
    x, P = batch(t, z, size, sigma, rho, period)
    plots = np.flatnonzero(~np.isnan(z))
    H = np.eye(size)[:1]
    last = plots[size - 1]
    for k in range(last + 1, len(t)):
        A = F(t[k] - t[last], size)
        if np.isnan(z[k]):
            x[k], P[k] = A @ x[last], A @ P[last] @ A.T
            continue
        c = rho ** round((t[k] - t[last]) / period)
        row = H @ A - c * H
        K = P[last] @ row.T / (row @ P[last] @ row.T + sigma**2 * (1 - c * c))
        x[k] = A @ (x[last] + K[:, 0] * (z[k] - c * z[last] - row @ x[last]))
        P[k] = A @ (P[last] - K @ row @ P[last]) @ A.T
        last = k
    return x, P
