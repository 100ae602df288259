"""The search of `radarsim tune`: the values of keys with which the quantity is best."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from radarsim.api.design.tuning_objective import Objective
from radarsim.api.design.tuning_space import DIGITS, MAX_WHOLE_COMBINATIONS, Place, SearchedKey
from radarsim.errors import ConfigError, argument

# Of exact and of sampled values: how closely the scale is searched, and the logarithm of what is minimised; the most
# values a key of a simplex.
SCALE_TOLERANCE, COST_TOLERANCE, MAX_VALUES_PER_KEY = (
    {True: 1e-7, False: 1e-2},
    {True: 1e-12, False: 1e-6},
    {True: 200, False: 50},
)
SIMPLEX_STEPS = 0.5, 0.1  # first steps, one simplex after the other
PILOT_POINTS = 13  # values of a key in the scan of a sampled quantity


def find_minimum(objective: Objective) -> Place:
    """The place with the smallest cost.

    For each combination of whole numbers, the real numbers are scanned one after the other; simplexes (Nelder and Mead)
    then start from the best place."""
    from scipy.optimize import minimize

    searched, start = objective.searched, tuple(key.stated for key in objective.searched)
    real_indices = [i for i, key in enumerate(searched) if not key.search_range.whole_numbers]
    pilot = None if objective.exact else objective.pilot_realisations
    grids = [key.search_range.grid() if key.search_range.whole_numbers else [key.stated] for key in searched]
    if math.prod(map(len, grids)) > MAX_WHOLE_COMBINATIONS:
        raise ConfigError(f"{argument('free', '--free')}: too many whole numbers to try: give KEY=LOW:HIGH")

    def scan_real_keys(best: Place) -> Place:
        for i in real_indices:
            candidates = [
                (*best[:i], x, *best[i + 1 :])
                for x in searched[i].search_range.grid(None if objective.exact else PILOT_POINTS)
            ]
            best = min((best, *candidates), key=lambda place: objective(place, pilot))
        return best

    possible = [place for place in itertools.product(*grids) if math.isfinite(objective(place, pilot))]
    best = min(map(scan_real_keys, possible), key=lambda place: objective(place, pilot), default=start)
    for step in SIMPLEX_STEPS if real_indices else ():
        scale_place = np.array([searched[i].search_range.to_scale(best[i]) for i in real_indices])
        options: Any = {
            "initial_simplex": np.vstack([scale_place, scale_place + step * np.eye(len(scale_place))]),
            "xatol": SCALE_TOLERANCE[objective.exact],
        }
        options |= {
            "fatol": COST_TOLERANCE[objective.exact],
            "maxfev": MAX_VALUES_PER_KEY[objective.exact] * len(scale_place),
        }
        logarithm: Any = lambda u, best=best: float(np.log(max(objective(move_keys(searched, best, u)), 1e-300)))  # noqa: E731
        best = move_keys(searched, best, minimize(logarithm, scale_place, method="Nelder-Mead", options=options).x)
    best = tuple(float(f"{x:.{DIGITS}g}") for x in best)
    return min((start, best), key=objective)


def move_keys(searched: Sequence[SearchedKey], best: Place, scale_place: np.ndarray) -> Place:
    """A place with its real numbers moved to these positions (n,) on the scales of the search."""
    coordinates = iter(scale_place)
    return tuple(
        x if key.search_range.whole_numbers else key.search_range.from_scale(float(next(coordinates)))
        for key, x in zip(searched, best, strict=True)
    )
