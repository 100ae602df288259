"""The bound for straight flight in the plane, by plots whose origin is known."""

import numpy as np

from radarsim.studies.floors.bound import Bound
from radarsim.studies.floors.missed_plots import missed_plots_bound
from radarsim.studies.floors.static import static_bound

NEEDED, SETTLING = 1, 2  # plots from which a component has a bound; plots that determine the flight


def straight_flight_bound(
    t_s: np.ndarray, rows: np.ndarray, R: np.ndarray, maps: np.ndarray, detection: float
) -> Bound:
    """The bound of components at times t_s (K,), whose derivatives by the state (x, y, vx, vy) are maps (K, C, 4).

    rows (K, m, 4): those of a plot's numbers; R (m, m): the covariance of its errors; detection: the probability of
    each plot but the first."""
    t, F = t_s - t_s[0], np.tile(np.eye(4), (len(t_s), 1, 1))
    F[:, 0, 2] = F[:, 1, 3] = t
    H = rows @ F
    gained = H.swapaxes(1, 2) @ np.linalg.solve(R, H)
    prior = np.zeros((4, 4))
    if detection == 1:
        return static_bound(prior, gained, maps @ F, reached=False)
    chance, counts = np.full(len(t), detection), np.ones(maps.shape[:2])
    chance[0] = 1.0
    return missed_plots_bound(prior, gained, maps @ F, chance, counts, (NEEDED,) * maps.shape[1], SETTLING)
