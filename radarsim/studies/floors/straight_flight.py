"""The bound for straight flight in the plane."""

import numpy as np

from radarsim.studies.floors.bound import FALSE_REDUCTION, Bound
from radarsim.studies.floors.missed_plots import missed_plots_bound
from radarsim.studies.floors.static import static_bound

NEEDED, SETTLING = 1, 2  # plots from which a component has a bound; plots that determine the flight


def straight_flight_bound(
    t_s: np.ndarray,
    rows: np.ndarray,
    R: np.ndarray,
    maps: np.ndarray,
    detection: float,
    information_shares: np.ndarray | None = None,
) -> Bound:
    """The bound of components at times t_s (K,), whose derivatives by the state (x, y, vx, vy) are maps (K, C, 4).

    rows (K, m, 4): those of a plot's numbers; R (m, m): the covariance of its errors; detection: the probability of
    each plot but the first; information_shares (K,): what is left of a plot's information among false plots, see
    `radarsim.studies.floors.false_plots`; of that bound and the one by plots of known origin the greater counts."""
    t, F = t_s - t_s[0], np.tile(np.eye(4), (len(t_s), 1, 1))
    F[:, 0, 2] = F[:, 1, 3] = t
    H = rows @ F
    gained = H.swapaxes(1, 2) @ np.linalg.solve(R, H)
    prior = np.zeros((4, 4))
    if detection == 1:
        known = static_bound(prior, gained, maps @ F, reached=False)
    else:
        chance, counts = np.full(len(t), detection), np.ones(maps.shape[:2])
        chance[0] = 1.0
        known = missed_plots_bound(prior, gained, maps @ F, chance, counts, (NEEDED,) * maps.shape[1], SETTLING)
    if information_shares is None:
        return known
    shares = np.r_[1.0, information_shares[1:]]
    # Over realisations with two plots, which determine the flight; as of missed plots alone.
    is_determined = 1 - (1 - detection) ** np.arange(len(t))
    sigma = static_bound(prior, gained * shares[:, None, None], maps @ F).sigma * is_determined[:, None]
    is_greater = np.nan_to_num(sigma) > np.nan_to_num(known.sigma)
    kinds = tuple(np.where(is_greater.all(axis=1), FALSE_REDUCTION, known.patterns).tolist())
    blank = np.full_like(known.lagged, np.nan), np.full_like(known.smoothed, np.nan)
    return Bound(np.where(is_greater, sigma, known.sigma), *blank, kinds, False)
