"""The bound for straight flight in the plane, by plots in range, bearing and radial velocity whose origin is known."""

from collections.abc import Sequence

import numpy as np

from radarsim.kernels.polar_plots import errors_covariance, polar_rows, speed_and_course_rows
from radarsim.physics.motion import transition
from radarsim.studies.floors.bound import Bound
from radarsim.studies.floors.missed_plots import missed_plots_bound
from radarsim.studies.floors.static import static_bound

SETTLING = 3  # plots that determine position and velocity, the bearings of two being too inaccurate for the bound to be


def straight_flight_bound(
    t_s: np.ndarray,
    states: Sequence[Sequence[float]],
    sigma: Sequence[float],
    correlation: float,
    measured: int,
    detection: float,
) -> Bound:
    """The bound of range, bearing, speed and course at times t_s (K,) of a flight with these states (K, 4).

    sigma, correlation: of the errors of range, bearing and velocity; measured: how many of these numbers plots have;
    detection: the probability of each plot but the first."""
    R = np.zeros((3, 3))
    R[np.triu_indices(3)] = errors_covariance(sigma, correlation)
    R = (R + np.triu(R, 1).T)[:measured, :measured]
    gained, maps = [], []
    for t, state in zip(t_s - t_s[0], states, strict=True):
        F = np.kron(transition(float(t), 2), np.eye(2))
        H = np.array(polar_rows(state))[:measured] @ F
        gained.append(H.T @ np.linalg.solve(R, H))
        maps.append(np.array([*polar_rows(state)[:2], *speed_and_course_rows(state)]) @ F)
    prior, information, derivatives = np.zeros((4, 4)), np.array(gained), np.array(maps)
    if detection == 1:
        return static_bound(prior, information, derivatives, reached=False)
    chance, counts = np.full(len(t_s), detection), np.ones(derivatives.shape[:2])
    chance[0] = 1.0
    return missed_plots_bound(prior, information, derivatives, chance, counts, (1, 1, 2, 2), SETTLING - 1)
