"""Kalman gains of linear filters scan by scan, and their steady state."""

from dataclasses import dataclass
from functools import reduce

import numpy as np

SETTLED_CHANGE = 1e-14  # relative change of a limit's components that counts as settled
MAX_DOUBLINGS = 60
MAX_PERIOD = 64  # longest period of plots, in scans, that is looked for


@dataclass(frozen=True)
class Matrices:
    """A filter of n states and D numbers over K scans, as the kernels take it.

    F, Q, P (n, n), x (n,), H (K, D, n), R (K, D): its model, R variances; see (K, D, n), sigma (K, D): of its plots;
    gains (K, D, n): its own, or the Kalman gains. has_own_gains: whether it has its own."""

    F: np.ndarray
    Q: np.ndarray
    x: np.ndarray
    P: np.ndarray
    H: np.ndarray
    R: np.ndarray
    see: np.ndarray
    sigma: np.ndarray
    gains: np.ndarray
    has_own_gains: bool


def kalman(F: np.ndarray, Q: np.ndarray, P: np.ndarray, H: np.ndarray, R: np.ndarray) -> np.ndarray:
    """The gains (K, D, n) of a Kalman filter (Bar-Shalom et al. 2001, section 5.2), with P at the first scan."""
    gains = np.empty_like(H)
    for k in range(len(H)):
        P = F @ P @ F.T + Q if k else P
        gains[k], P = updated(P, H[k], R[k])
    return gains


def updated(P: np.ndarray, H: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The gains (D, n) of numbers processed one after the other, and P after them, by Joseph's form."""
    gains = np.empty_like(H)
    for d, (h, r) in enumerate(zip(H, R, strict=True)):
        gains[d] = P @ h / (h @ P @ h + r)
        A = np.eye(h.size) - np.outer(gains[d], h)
        P = A @ P @ A.T + r * np.outer(gains[d], gains[d])
    return gains, P


def period(*arrays: np.ndarray) -> int:
    """The period, in scans, of arrays (K, …); K where they have none."""
    scans = len(arrays[0])
    for p in range(1, min(MAX_PERIOD, scans // 2) + 1):
        if all(np.array_equal(array[p:], array[:-p]) for array in arrays):
            return p
    return scans


@np.errstate(all="ignore")  # growth without end has no limit
def steady(model: Matrices) -> tuple[np.ndarray, np.ndarray]:
    """The limit over a period of p scans of a Kalman filter's gains (p, D, n), and its P before the first of them. P
    goes from scan to scan as A (P⁻¹ + J)⁻¹ A' + C with A = F, C = Q, J = H'R⁻¹H. Two such steps are one of the same
    form, so 2^m periods take m of them (structured doubling: Chu, Fan & Lin 2005)."""
    eye, phases = np.eye(model.x.size), range(period(model.H, model.R))
    try:
        A, C, J = reduce(_after, ((model.F, model.Q, (model.H[k].T / model.R[k]) @ model.H[k]) for k in phases))
        P = C
        for _ in range(MAX_DOUBLINGS):
            A, C, J = _after((A, C, J), (A, C, J))
            previous, P = P, A @ np.linalg.solve(eye + model.P @ J, model.P) @ A.T + C
            sigma = np.sqrt(np.diag(P))
            if not np.isfinite(P).all() or (np.abs(P - previous) <= SETTLED_CHANGE * np.outer(sigma, sigma)).all():
                break
    except np.linalg.LinAlgError:
        P = np.full_like(model.P, np.nan)
    gains = []
    for k in phases:
        scan_gains, P_after = updated(P, model.H[k], model.R[k])
        gains.append(scan_gains)
        P = model.F @ P_after @ model.F.T + model.Q
    return np.stack(gains), P


Step = tuple[np.ndarray, np.ndarray, np.ndarray]


def _after(earlier: Step, later: Step) -> Step:
    """Two steps of `steady` as one."""
    (A, C, J), (B, E, M) = earlier, later
    eye = np.eye(len(A))
    between = np.linalg.solve(eye + C @ M, np.hstack([A, C]))
    moved_state, spread = between[:, : len(A)], between[:, len(A) :]
    symmetrised = B @ spread @ B.T + E, A.T @ M @ moved_state + J
    return B @ moved_state, *((part + part.T) / 2 for part in symmetrised)
