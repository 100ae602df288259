"""Kalman filters of the second order whose gains do not depend on the data: designed once, applied N times.

The state is x = (r, V_r, a_r), a plot z = (range, radial velocity); a filter observes the range alone or both.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.physics.motion import process_noise, transition


@dataclass(frozen=True)
class LinearFilter:
    """One designed filter over K scans.

    observes is 1 (range) or 2 (range and velocity); start is the scan, from 1, of the first least-squares estimate;
    weights (3, 2, start) make it from the plots so far; gains (K, 3, 2) are zero up to it. believed (K, 3, 3) is the
    covariance that the filter claims, and available (K, 3) says which components it estimates.
    """

    observes: int
    start: int
    weights: np.ndarray
    gains: np.ndarray
    believed: np.ndarray
    available: np.ndarray


def observation(observes: int) -> np.ndarray:
    """H of eq. (10): the first `observes` rows of the unit matrix, (observes, 3)."""
    return np.eye(3)[:observes]


def least_squares_start(observes: int, start: int, sigma: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Weighted least squares on the first `start` scans: weights (3, 2, start), covariance (3, 3) at the last of them.

    sigma (2,) holds the standard deviations of range (m) and radial velocity (m/s). Solved in scaled units (state per
    scan period, rows per sigma) so that periods of milliseconds and of hours are equally well conditioned.
    """
    scale = np.array([1.0, 1.0 / dt, 1.0 / dt**2])
    rows = [
        observation(observes) @ transition((k - start + 1) * dt) * scale / sigma[:observes, None] for k in range(start)
    ]
    A = np.concatenate(rows)
    solution = scale[:, None] * np.linalg.pinv(A)
    weights = np.zeros((3, 2, start))
    weights[:, :observes] = (solution.reshape(3, start, observes) / sigma[:observes]).transpose(0, 2, 1)
    return weights, solution @ solution.T


def noise_by_time(noise: str, manoeuvre_variance: float, period: float) -> np.ndarray:
    """Process noise over any time t, (2, 3, 3): Q_ij = a_ij t^(5 − i − j) + b_ij t^(6 − i − j), i and j from 0.

    What `physics.motion.process_noise` adds over a scan period (s), for plots at uneven times: the jerk stays constant
    between two plots; white jerk keeps its density; of the acceleration's steps there are as many as periods.
    """
    made = np.zeros((2, 3, 3))
    of_a_second = process_noise(noise, manoeuvre_variance, 1.0)
    made[int(noise == "random_jerk")] = of_a_second * (1.0 if noise == "random_jerk" else period)
    return made


def noise_over(noise: np.ndarray, t: float) -> np.ndarray:
    """Q (3, 3) over a time t (s), of the coefficients (2, 3, 3) that `noise_by_time` gives."""
    power = 5 - np.add.outer(np.arange(3), np.arange(3))
    return np.asarray(noise[0] * t**power + noise[1] * t ** (power + 1))


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
    F, Q = transition(dt), process_noise(noise, manoeuvre_variance, dt)
    H, R = observation(observes), np.diag(sigma[:observes] ** 2)
    weights, P = least_squares_start(observes, start, sigma, dt)
    gains, believed = np.zeros((scans, 3, 2)), np.zeros((scans, 3, 3))
    available = np.ones((scans, 3), dtype=bool)
    available[: start - 1, observes:] = False
    for k in range(start - 1):
        believed[k, :observes, :observes] = R
    believed[start - 1] = P
    for k in range(start, scans):
        P = F @ P @ F.T + Q
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        joseph = np.eye(3) - K @ H
        P = joseph @ P @ joseph.T + K @ R @ K.T
        P = (P + P.T) / 2
        gains[k, :, :observes], believed[k] = K, P
        if np.array_equal(P, believed[k - 1]):  # stationary to the last bit, and so it stays
            gains[k:], believed[k:] = gains[k], P
            break
    return LinearFilter(observes, start, weights, gains, believed, available)
