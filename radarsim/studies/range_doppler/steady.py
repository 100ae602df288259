"""Exact steady gains of many radars at once: the map of the chart, with the scan period in it."""

import numpy as np

from radarsim.physics.motion import manoeuvre_covariance, transition

DOUBLINGS = 20  # a million scans: hundreds of memories where a memory has thousands


def exact_gains(C_theta: np.ndarray, Lambda: np.ndarray) -> np.ndarray:
    """Exact steady gains (3, n) in per cent of radars with these numbers (n,), their scan period in them."""
    base = errors_of_many(np.zeros_like(C_theta), Lambda)
    return 100 * (1 - np.sqrt(errors_of_many(C_theta, Lambda) / base))


def errors_of_many(C_theta: np.ndarray, Lambda: np.ndarray) -> np.ndarray:
    """Steady variances (3, n) of the filters of many radars at once, each in units of its own; C_θ = 0: range alone.

    As `exact.steady_state`, by doubling: each round of the Riccati equation's iteration does as many scans as all
    before (Anderson, Int. J. Control 28, 1978, 295-306), and so does each of the sum of what the noise leaves.
    """
    n, unit = len(Lambda), np.maximum(1.0, Lambda ** (-1 / 3))  # time in memories τ₂, where longer than a scan
    F = np.stack([transition(1 / u) for u in unit])
    Q = np.stack([manoeuvre_covariance(one**2 * u**6, 1 / u) for one, u in zip(Lambda, unit, strict=True)])
    information = np.zeros((n, 3, 3))  # HᵀR⁻¹H
    information[:, 0, 0], information[:, 1, 1] = 1.0, C_theta / unit**2
    P, A, G = Q, F.transpose(0, 2, 1), information
    for _ in range(DOUBLINGS):
        W = np.linalg.inv(np.eye(3) + G @ P)
        P, A, G = (P + A.transpose(0, 2, 1) @ P @ W @ A, A @ W @ A, G + A @ W @ G @ A.transpose(0, 2, 1))
    kept = np.linalg.inv(np.eye(3) + P @ information)  # I − KH
    believed = kept @ P
    S, M = believed @ information @ believed.transpose(0, 2, 1), kept @ F  # K R Kᵀ, with K = believed HᵀR⁻¹
    for _ in range(DOUBLINGS):
        S, M = S + M @ S @ M.transpose(0, 2, 1), M @ M
    return np.diagonal(S, axis1=1, axis2=2).T
