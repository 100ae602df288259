"""Exact errors of many versions of the paper's filters at once: its own recursion, eqs. (8) and (12), on arrays.

A version is a form and size of the manoeuvre covariance and a way to start; B of them run side by side. Packed
covariances are the paper's b, c, e, d, f, g. The two measurements of a scan are taken one after the other, which for
independent errors is the same as both at once."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from radarsim.kernels.kalman_algebra import CORRECT, NO_NOISE, TAKE, constant_acceleration, pack, predict_covariance
from radarsim.physics.motion import (
    acceleration_step_covariance,
    manoeuvre_covariance,
    transition,
    white_jerk_covariance,
)
from radarsim.studies.range_doppler.filter_design import least_squares_start, observation

Form = Literal["random_jerk", "white_jerk", "white_jerk_rate", "acceleration_step", "normalised"]
Start = Literal[
    "weighted", "unweighted", "process_noise", "first_differences", "three_and_three", "four_and_four", "five_and_five"
]
FORMS: tuple[Form, ...] = get_args(Form)
START_NAMES: tuple[Start, ...] = get_args(Start)
Version = tuple[Form, float, Start]  # form of Q, D_M, start
START_SCANS = {"three_and_three": (3, 3), "four_and_four": (4, 4), "five_and_five": (5, 5)}  # range only, with velocity
USUAL_SCANS = (3, 2)


def covariance_of(form: Form, variance: float, sigma_range_m: float, dt: float) -> np.ndarray:
    """Q (3, 3) of one scan, by the meaning of the number D_M.

    random_jerk: eq. (6), the variance of a jerk that is constant over the scan, (m/s³)². white_jerk: the spectral
    density of a white jerk, m²/s⁵. white_jerk_rate: D_M Δt in place of that density. acceleration_step: the variance of
    a step of acceleration, (m/s²)². normalised: C_M of eq. (5), so that D_M is the number times σ_r²."""
    if form == "random_jerk":
        return manoeuvre_covariance(variance, dt)
    if form == "normalised":
        return manoeuvre_covariance(variance * sigma_range_m**2, dt)
    if form == "acceleration_step":
        return acceleration_step_covariance(variance / dt**2, dt)
    return white_jerk_covariance(variance if form == "white_jerk_rate" else variance / dt, dt)


def start_covariances(
    start: Start, observes: int, sigma: np.ndarray, dt: float, Q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariances (B, 3, 3) of B starts, believed and true, at the last of the scans that make them.

    observes is 1 (range) or 2 (and velocity); sigma (2,); Q (B, 3, 3) of a scan, which only `process_noise` uses: the
    others believe what is true of a target that does not manoeuvre while they start."""
    scans = first_scan(start, observes)
    if start == "process_noise":
        weights, believed = _start_with_process_noise(observes, scans, sigma, dt, Q)
        return believed, np.einsum("...ijk,j,...ljk->...il", weights, sigma**2, weights)
    if start == "first_differences":
        weights = _first_differences(observes, dt)
    else:
        weights, _ = least_squares_start(observes, scans, np.ones(2) if start == "unweighted" else sigma, dt)
    true = np.einsum("ijk,j,ljk->il", weights, sigma**2, weights)
    every = np.broadcast_to(true, (len(Q), 3, 3))
    return every, every


def first_scan(start: Start, observes: int) -> int:
    """The scan, from 1, of the first estimate of a filter."""
    return START_SCANS.get(start, USUAL_SCANS)[observes - 1]


def _first_differences(observes: int, dt: float) -> np.ndarray:
    """Weights (3, 2, scans): the last plot, and differences of the plots for what is not measured."""
    if observes == 1:
        weights = np.zeros((3, 2, 3))
        weights[0, 0, 2] = 1.0
        weights[1, 0] = np.array([0.0, -1.0, 1.0]) / dt
        weights[2, 0] = np.array([1.0, -2.0, 1.0]) / dt**2
        return weights
    weights = np.zeros((3, 2, 2))
    weights[0, 0, 1] = weights[1, 1, 1] = 1.0
    weights[2, 1] = np.array([-1.0, 1.0]) / dt
    return weights


def _start_with_process_noise(
    observes: int, scans: int, sigma: np.ndarray, dt: float, Q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Generalised least squares on a state that the noise Q (B, 3, 3) moves: weights (B, 3, 2, scans), covariances. The
    state at scan n − j is F⁻ʲ x less what the j last steps added, carried back."""
    unit = np.array([1.0, 1.0 / dt, 1.0 / dt**2])  # one size for all columns
    H, back = observation(observes), np.linalg.inv(transition(dt))
    powers = [H @ np.linalg.matrix_power(back, j) for j in range(scans)]
    A = np.concatenate([powers[scans - 1 - k] for k in range(scans)]) * unit
    size = scans * observes
    C = np.zeros((len(Q), size, size)) + np.diag(np.tile(sigma[:observes] ** 2, scans))
    for i in range(1, scans):  # the push between scans i and i + 1 lies behind all earlier plots
        carried = np.concatenate([powers[i + 1 - k] for k in range(1, i + 1)])
        C[:, : len(carried), : len(carried)] += carried @ Q @ carried.T
    root = np.linalg.cholesky(C)
    solution = unit[:, None] * np.linalg.pinv(np.linalg.solve(root, np.broadcast_to(A, (len(Q), *A.shape))))
    rows = solution @ np.linalg.inv(root)
    weights = np.zeros((len(Q), 3, 2, scans))
    weights[:, :, :observes] = rows.reshape(-1, 3, scans, observes).transpose(0, 1, 3, 2)
    return weights, solution @ solution.transpose(0, 2, 1)


class Errors(NamedTuple):
    """σ of B versions over K scans, (B, K, 3): the true one on a quadratic truth, and the believed one. Not-a-number
    where there is no estimate. The believed one is the true one on a truth that moves as the filter believes, once it
    has started."""

    true: np.ndarray
    believed: np.ndarray


def errors(
    versions: Sequence[Version], observes: int, sigma: np.ndarray, dt: float, scans: int, Q: np.ndarray | None = None
) -> Errors:
    """σ of B versions by the exact recursion, of filters that observe the range (1) or range and velocity (2).

    sigma (2,); Q (B, 3, 3) as `covariances` gives it, where it is at hand."""
    Q = covariances(versions, sigma[0], dt) if Q is None else Q
    names = [start for _, _, start in versions]
    first = np.array([first_scan(name, observes) for name in names])
    P, S = _starts(names, observes, sigma, dt, Q)
    true, believed = np.full((2, scans, 3, len(versions)), np.nan)
    for begin in np.unique(first):
        indices = np.flatnonzero(first == begin)
        curves = _recursion(P[indices], S[indices], Q[indices], observes, sigma, dt, scans - begin)
        for sigmas, curve in zip((true, believed), curves, strict=True):
            sigmas[: begin - 1, :observes, indices] = sigma[:observes, None]
            sigmas[begin - 1 :, :, indices] = curve
    return Errors(true.transpose(2, 0, 1), believed.transpose(2, 0, 1))


def covariances(versions: Sequence[Version], sigma_range_m: float, dt: float) -> np.ndarray:
    """Q (B, 3, 3) of versions."""
    unit = {form: covariance_of(form, 1.0, sigma_range_m, dt) for form in FORMS}
    return np.array([variance * unit[form] for form, variance, _ in versions])


def _starts(
    names: Sequence[Start], observes: int, sigma: np.ndarray, dt: float, Q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    believed, true = np.empty((2, len(names), 3, 3))
    for name in START_NAMES:
        if (indices := np.flatnonzero([start == name for start in names])).size:
            believed[indices], true[indices] = start_covariances(name, observes, sigma, dt, Q[indices])
    return believed, true


def _recursion(
    P: Any, S: Any, Q: np.ndarray, observes: int, sigma: np.ndarray, dt: float, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """True and believed σ, (steps + 1, 3, B), from the covariances believed P and true S at the start on."""
    P, S, q, F = pack(P), pack(S), pack(Q), constant_acceleration(dt)
    true, believed = np.empty((2, steps + 1, 3, len(Q)))
    for k in range(steps + 1):
        if k:
            P, S = predict_covariance(P, F, q), predict_covariance(S, F, NO_NOISE)
            for m in range(observes):
                P, gain, _ = TAKE[m](P, sigma[m] ** 2, 1.0)
                S = CORRECT[m](S, sigma[m] ** 2, gain)
        for sigmas, covariance in ((true, S), (believed, P)):
            np.sqrt([covariance[0], covariance[3], covariance[5]], out=sigmas[k])
        if (
            k % SCANS_BETWEEN_CHECKS == SCANS_BETWEEN_CHECKS - 1
            and _steady(true[k - 1 : k + 1])
            and _steady(believed[k - 1 : k + 1])
        ):
            true[k:], believed[k:] = true[k], believed[k]
            break
    return true, believed


SCANS_BETWEEN_CHECKS = 16  # scans between looks whether all σ have settled
SETTLED_CHANGE = 1e-14  # relative change of a scan: some roundings


def _steady(sigma: np.ndarray) -> bool:
    """Whether σ of two scans (2, …) are the same but for rounding."""
    return bool((abs(sigma[1] - sigma[0]) <= SETTLED_CHANGE * sigma[1]).all())


def errors_of_both_filters(
    radar: tuple[float, float, float], versions: Sequence[Version], scans: int
) -> tuple[Errors, Errors]:
    """Errors of range only, and of range and velocity, of versions on a radar (σ_r, σ_V, Δt)."""
    sigma, dt = np.array(radar[:2], dtype=float), float(radar[2])
    Q = covariances(versions, sigma[0], dt)
    return errors(versions, 1, sigma, dt, scans, Q), errors(versions, 2, sigma, dt, scans, Q)


def gain(base: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Relative gain (17) in % of σ over `base`, that of range only: arrays of any shape."""
    return 100 * (base - sigma) / base
