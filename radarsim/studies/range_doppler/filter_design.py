"""From keys to gains: the least-squares start and the Kalman gains of P1's filters, eqs. (5), (6), (9), (13).

The gains do not depend on the data: they are designed once, and applied N times.

The state is x = (r, V_r, a_r), a plot z = (range, radial velocity); a filter observes the range alone or both."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.kernels import kalman_algebra
from radarsim.physics.motion import process_noise, transition


@dataclass(frozen=True)
class LinearFilter:
    """One designed filter over K scans."""

    observes: int  #: 1 (range) or 2 (range and velocity)
    start: int  #: scan, from 1, of the first least-squares estimate
    weights: np.ndarray  #: (3, 2, start) make it from the plots so far
    gains: np.ndarray  #: (K, 3, 2) zero up to the start
    believed: np.ndarray  #: (K, 3, 3) covariance that the filter claims
    available: np.ndarray  #: (K, 3) which components it estimates
    noise: tuple[float, ...]  #: its Q, packed
    has_given_gains: bool = False  #: whether its gains are those of a package, not the Kalman filter's of this Q


def observation(observes: int) -> np.ndarray:
    """H of eq. (10): the first `observes` rows of the unit matrix, (observes, 3)."""
    return np.eye(3)[:observes]


def least_squares(times: np.ndarray, present: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Weighted least squares on plots at times (n,), s, as a state at time 0: weights (3, 2, n), covariance (3, 3).

    present (n, 2): which numbers there are; sigma (2,) holds the standard deviations of range (m) and radial velocity
    (m/s). None where they do not determine a state. Solved in scaled units (state per interval, rows per sigma) so that
    periods of milliseconds and of hours are equally well conditioned."""
    unit = max(float(np.ptp(times)), 1e-9) / max(len(times) - 1, 1)
    scale = np.array([1.0, 1.0 / unit, 1.0 / unit**2])
    A = np.concatenate([transition(t)[:2] * scale / sigma[:, None] for t in times])[present.ravel()]
    if np.linalg.matrix_rank(A) < 3:
        return None
    solution = scale[:, None] * np.linalg.pinv(A)
    weights = np.zeros((3, len(times), 2))
    weights[:, present] = solution
    return (weights / sigma).swapaxes(1, 2), solution @ solution.T


def least_squares_start(observes: int, start: int, sigma: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """As `least_squares`, on the first `start` scans, at the last of them: weights (3, 2, start), covariance (3, 3)."""
    present = np.broadcast_to(np.arange(2) < observes, (start, 2))
    solution = least_squares(dt * np.arange(1 - start, 1), present, sigma)
    if solution is None:
        raise ValueError("too few plots for a start")
    return solution


def noise_by_time(noise: str, manoeuvre_variance: float, period: float) -> np.ndarray:
    """What `motion.process_noise` adds over a scan period (s), for plots at uneven times, as `kernels.gap_noise` says:
    the period, the variance of the jerk, and the densities of the acceleration's steps and of white jerk (4,)."""
    numbers = np.array([period, 0.0, 0.0, 0.0])
    kind = ("random_jerk", "white_acceleration", "white_jerk").index(noise)
    numbers[1 + kind] = manoeuvre_variance * (period if kind else 1.0)
    return numbers


def design(
    observes: int,
    start: int,
    manoeuvre_variance: float,
    sigma: np.ndarray,
    dt: float,
    scans: int,
    noise: str = "random_jerk",
) -> LinearFilter:
    """The paper's filter: least squares on `start` scans, then eqs. (5), (9), (13) with M of eq. (6); sigma (2,).

    Before the start the estimates are the plots themselves: the range, and the velocity where it is observed. `noise`
    is the form of the process noise, see `motion.process_noise`."""
    F, Q = (
        kalman_algebra.constant_acceleration(dt),
        tuple(map(float, kalman_algebra.pack(process_noise(noise, manoeuvre_variance, dt)))),
    )
    R, present = tuple(map(float, sigma**2)), (True, observes == 2)
    weights, covariance = least_squares_start(observes, start, sigma, dt)
    gains, believed = np.zeros((scans, 3, 2)), np.zeros((scans, 6))
    available = np.ones((scans, 3), dtype=bool)
    available[: start - 1, observes:] = False
    believed[: start - 1, [0, 3][:observes]] = sigma[:observes] ** 2
    P = tuple(map(float, kalman_algebra.pack(covariance)))
    believed[start - 1] = P
    scans_after_start: list[tuple[float, ...]] = []
    while len(scans_after_start) < scans - start:
        previous = P
        P, range_gain, velocity_gain = update_covariance(P, F, Q, R, present)
        scans_after_start.append(P + range_gain + velocity_gain)
        if previous == P:  # stationary to the last bit, and so it stays
            scans_after_start += [scans_after_start[-1]] * (scans - start - len(scans_after_start))
    designed_scans = np.array(scans_after_start).reshape(-1, 12)
    believed[start:], gains[start:] = designed_scans[:, :6], designed_scans[:, 6:].reshape(-1, 2, 3).swapaxes(1, 2)
    return LinearFilter(observes, start, weights, gains, kalman_algebra.unpack(believed.T), available, Q)


def update_covariance(P: Any, F: Any, Q: Any, R: Any, present: Any) -> tuple[Any, Any, Any]:
    """A covariance after a scan, packed, and its gains (3,) on range and velocity where they are present; R (2,)."""
    P, range_gain, velocity_gain = kalman_algebra.predict_covariance(P, F, Q), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if present[0]:
        P, range_gain, _ = kalman_algebra.take_value(P, R[0], 1.0)
    if present[1]:  # taken after the range, so that it moves what that makes of the estimate
        P, velocity_gain, _ = kalman_algebra.take_rate(P, R[1], 1.0)
        range_gain = kalman_algebra.add_scaled(range_gain, -range_gain[1], velocity_gain)
    return P, range_gain, velocity_gain
