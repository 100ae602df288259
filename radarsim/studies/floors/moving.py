"""The bound for states that noise moves, by recursion, and for smoothing."""

from collections.abc import Callable

import numpy as np

from radarsim.studies.floors.bound import (
    ENUMERATION,
    LAGS,
    REDUCTION,
    Bound,
    decompose_information,
    sigma_from_information,
)
from radarsim.studies.floors.missed_plots import MAX_IGNORED_CHANGE, likeliest_patterns, pattern_mean


def information_after_noise(M: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Information (…, n, n) on states after noise of covariance Q is added: (M⁻¹ + Q)⁻¹, also for a singular M."""
    information: np.ndarray = np.linalg.solve(np.eye(M.shape[-1]) + M @ Q, M)
    return (information + information.swapaxes(-1, -2)) / 2


def moving_bound(
    J: np.ndarray, scan_information: np.ndarray, F: np.ndarray, Q: np.ndarray, component_count: int
) -> Bound:
    """The bound for the first components of states that noise moves, by the recursion of their information.

    J (n, n): before the first scan; scan_information (K, n, n): by each scan's plots; F, Q (K, n, n): from the previous
    scan."""
    forward, maps = np.zeros_like(scan_information), np.eye(component_count, len(J))
    for k, information in enumerate(scan_information):
        if k:
            back = np.linalg.inv(F[k])
            J = information_after_noise(back.T @ J @ back, Q[k])
        forward[k] = J = J + information

    def sigma_with(B: np.ndarray) -> np.ndarray:
        return sigma_from_information(decompose_information(forward + B), maps)

    return _smoothed(sigma_with, scan_information, F, Q)


def driven_bound(
    P: np.ndarray, F: np.ndarray, Q: np.ndarray, H: np.ndarray, R: np.ndarray, detection: float, component_count: int
) -> Bound:
    """As `moving`, for states whose covariance P (n, n) at the first scan is known and may be singular.

    The plots have rows H (K, D, n) and variances R (K, D), and come with the probability `detection`."""
    states, share, mean, enumerating = P[None], np.ones(1), P[None], True
    forward, sigma, kinds = np.zeros((len(H), *P.shape)), np.zeros((len(H), component_count)), []
    for k in range(len(H)):
        if k:
            states, mean = (F[k] @ covariance @ F[k].T + Q[k] for covariance in (states, mean))
        mean = _after_plot(mean, H[k], R[k] / max(detection, np.finfo(float).tiny))
        enumerated = reduced = np.diagonal(mean[0])[:component_count]
        if enumerating:
            (pattern, has_plot), share = likeliest_patterns(np.array([detection, 1 - detection])[:, None] * share)
            states = np.where(has_plot[:, None, None] > 0, _after_plot(states, H[k], R[k])[pattern], states[pattern])
            enumerated = pattern_mean(share, np.diagonal(states, axis1=1, axis2=2)[:, :component_count], 1.0)
        forward[k] = states[0]
        sigma[k] = np.sqrt(np.maximum(enumerated, reduced))
        enumerating = enumerating and not (reduced > enumerated * (1 + MAX_IGNORED_CHANGE)).any()
        kinds.append(ENUMERATION if enumerating else REDUCTION)
    if detection < 1:
        blank = np.full(sigma.shape, np.nan)
        return Bound(sigma, np.stack([blank] * len(LAGS)), blank, tuple(kinds), False)

    def sigma_with(B: np.ndarray) -> np.ndarray:
        covariances = np.linalg.solve(np.eye(len(P)) + forward @ B, forward)
        sigma: np.ndarray = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, :component_count])
        return sigma

    return _smoothed(sigma_with, np.einsum("kdi,kdj,kd->kij", H, H, 1 / R), F, Q)


def _after_plot(P: np.ndarray, H: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Covariances (S, n, n) after the numbers of a plot, rows H (D, n) with variances R (D,), by Joseph's form."""
    for h, r in zip(H, R, strict=True):
        gain = (P @ h) / (P @ h @ h + r)[:, None]
        A = np.eye(len(h)) - gain[:, :, None] * h
        P = A @ P @ A.swapaxes(1, 2) + r * gain[:, :, None] * gain[:, None, :]
    return P


def _smoothed(
    sigma_with: Callable[[np.ndarray], np.ndarray], scan_information: np.ndarray, F: np.ndarray, Q: np.ndarray
) -> Bound:
    """The bound by sigma_with(B): σ (K, C) with the information B (K, n, n) of later scans on each state."""
    scans = len(scan_information)

    def information_before(B: np.ndarray, next_scans: slice) -> np.ndarray:
        """Information at scans from that at the next ones, without the plots of the scans themselves."""
        information: np.ndarray = (
            F[next_scans].swapaxes(1, 2)
            @ information_after_noise(B + scan_information[next_scans], Q[next_scans])
            @ F[next_scans]
        )
        return information

    def lagged_sigma(lag: int) -> np.ndarray:
        remaining = max(scans - lag, 0)
        B = np.zeros_like(scan_information)
        for step in range(lag, 0, -1):
            B[:remaining] = information_before(B[:remaining], slice(step, remaining + step))
        sigma = sigma_with(B)
        sigma[remaining:] = np.nan
        return sigma

    B = np.zeros_like(scan_information)
    for k in range(scans - 1, 0, -1):
        B[k - 1] = information_before(B[k : k + 1], slice(k, k + 1))[0]
    return Bound(lagged_sigma(0), np.stack([lagged_sigma(lag) for lag in LAGS]), sigma_with(B), ("",) * scans)
