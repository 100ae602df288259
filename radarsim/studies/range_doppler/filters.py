"""Kalman filters of the second order whose gains do not depend on the data: designed once, applied N times.

The state is x = (r, V_r, a_r), a plot z = (range, radial velocity); a filter observes the range alone or both.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.kernels.algebra import (
    add_scaled,
    constant_acceleration,
    pack,
    predicted_covariance,
    take_rate,
    take_value,
    unpack,
)
from radarsim.physics.motion import process_noise, transition


@dataclass(frozen=True)
class LinearFilter:
    """One designed filter over K scans.

    observes is 1 (range) or 2 (range and velocity); start is the scan, from 1, of the first least-squares estimate;
    weights (3, 2, start) make it from the plots so far; gains (K, 3, 2) are zero up to it. believed (K, 3, 3) is the
    covariance that the filter claims, and available (K, 3) says which components it estimates; noise is its Q, packed.
    """

    observes: int
    start: int
    weights: np.ndarray
    gains: np.ndarray
    believed: np.ndarray
    available: np.ndarray
    noise: tuple[float, ...]


def observation(observes: int) -> np.ndarray:
    """H of eq. (10): the first `observes` rows of the unit matrix, (observes, 3)."""
    return np.eye(3)[:observes]


def least_squares(times: np.ndarray, there: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Weighted least squares on plots at times (n,), s, as a state at time 0: weights (3, 2, n), covariance (3, 3).

    there (n, 2) says which numbers there are; sigma (2,) holds the standard deviations of range (m) and radial velocity
    (m/s). None where they do not determine a state. Solved in scaled units (state per interval, rows per sigma) so that
    periods of milliseconds and of hours are equally well conditioned.
    """
    unit = max(float(np.ptp(times)), 1e-9) / max(len(times) - 1, 1)
    scale = np.array([1.0, 1.0 / unit, 1.0 / unit**2])
    A = np.concatenate([transition(t)[:2] * scale / sigma[:, None] for t in times])[there.ravel()]
    if np.linalg.matrix_rank(A) < 3:
        return None
    solution = scale[:, None] * np.linalg.pinv(A)
    weights = np.zeros((3, len(times), 2))
    weights[:, there] = solution
    return (weights / sigma).swapaxes(1, 2), solution @ solution.T


def least_squares_start(observes: int, start: int, sigma: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """As `least_squares`, on the first `start` scans, at the last of them: weights (3, 2, start), covariance (3, 3)."""
    there = np.broadcast_to(np.arange(2) < observes, (start, 2))
    found = least_squares(dt * np.arange(1 - start, 1), there, sigma)
    if found is None:
        raise ValueError("too few plots for a start")
    return found


def noise_by_time(noise: str, manoeuvre_variance: float, period: float) -> np.ndarray:
    """Process noise over any time t, (2, 6) packed: Q_ij = a_ij t^(5 − i − j) + b_ij t^(6 − i − j), i and j from 0.

    What `physics.motion.process_noise` adds over a scan period (s), for plots at uneven times: the jerk stays constant
    between two plots; white jerk keeps its density; of the acceleration's steps there are as many as periods.
    """
    made = np.zeros((2, 6))
    of_a_second = np.array(pack(process_noise(noise, manoeuvre_variance, 1.0)))
    made[int(noise == "random_jerk")] = of_a_second * (1.0 if noise == "random_jerk" else period)
    return made


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
    is the form of the process noise, see `physics.motion.process_noise`.
    """
    F, Q = constant_acceleration(dt), tuple(map(float, pack(process_noise(noise, manoeuvre_variance, dt))))
    R_range, R_velocity = map(float, sigma**2)
    weights, covariance = least_squares_start(observes, start, sigma, dt)
    gains, believed = np.zeros((scans, 3, 2)), np.zeros((scans, 6))
    available = np.ones((scans, 3), dtype=bool)
    available[: start - 1, observes:] = False
    believed[: start - 1, [0, 3][:observes]] = sigma[:observes] ** 2
    P = tuple(map(float, pack(covariance)))
    believed[start - 1] = P
    for k in range(start, scans):
        before = P
        P, gain, _ = take_value(predicted_covariance(P, F, Q), R_range, 1.0)
        if observes == 2:  # taken after the range, so that it moves what that makes of the estimate
            P, of_velocity, _ = take_rate(P, R_velocity, 1.0)
            gains[k, :, 1], gain = of_velocity, add_scaled(gain, -gain[1], of_velocity)
        gains[k, :, 0], believed[k] = gain, P
        if before == P:  # stationary to the last bit, and so it stays
            gains[k:], believed[k:] = gains[k], P
            break
    return LinearFilter(observes, start, weights, gains, unpack(believed.T), available, Q)
