"""The search of `radarsim tune`: the values of keys with which the quantity is best.

A quantity may have several hollows. Places over the whole range are tried first; from each of the best that has no
better one near it a local search starts (multi-level single linkage, Rinnooy Kan & Timmer, Math. Programming 39, 1987,
57-78). Of a sampled quantity the first rounds take few realisations, and fewer places take part in each round: a
minimum over many places of little noise would be one of the noise. Where the searches ended is compared on a second
sample, so that the best is not the one that fits its noise best."""

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from radarsim.api.design.tuning_space import DIGITS, MAX_WHOLE_COMBINATIONS, Place, SearchedKey
from radarsim.errors import ConfigError, argument

# Of exact and of sampled values: how closely the scale is searched, and the logarithm of what is minimised.
SCALE_TOLERANCE, COST_TOLERANCE = {True: 1e-7, False: 1e-2}, {True: 1e-12, False: 1e-6}
PILOT_POINTS = 13  # values of a key in the scan of a sampled quantity
SPREAD_PLACES_PER_KEY, MIN_SPREAD_KEYS = 32, 2  # places over all keys together, where there are several
MAX_STARTS, MAX_FINALISTS = 6, 3  # local searches, and those that are continued with all realisations
SAME_END = 0.01  # distance, of a range of one, within which two searches ended in the same hollow


class LocalSearch(NamedTuple):
    """A simplex search (Nelder and Mead): its first step on the scale of the search, and the most values a key."""

    step: float
    max_values_per_key: int


FIRST_SEARCH = {True: LocalSearch(0.5, 40), False: LocalSearch(1.0, 20)}  # of every start, by whether it is exact
FINAL_SEARCHES = {  # of the finalists, one after the other
    True: (LocalSearch(0.5, 200), LocalSearch(0.1, 200)),
    False: (LocalSearch(0.5, 30), LocalSearch(0.1, 15)),
}

EXPECTED_VALUES_PER_KEY = {True: 100, False: 40}  # of the searches of a finalist, by whether it is exact


class CostFunction(Protocol):
    """What is minimised: a cost at a place, of all realisations or of fewer."""

    searched: Sequence[SearchedKey]
    exact: bool

    @property
    def pilot_realisations(self) -> int: ...

    def __call__(self, place: Place, count: int | None = None) -> float: ...


class FoundMinimum(NamedTuple):
    """The best place; the costs at which the local searches ended, ascending, on the sample that chose the best; and
    those ends, in the same order, that lie in other hollows than the best."""

    place: Place
    end_costs: tuple[float, ...]
    other_hollows: tuple[Place, ...]


def find_minimum(cost: CostFunction, chooser: CostFunction) -> FoundMinimum:
    """The place with the smallest cost; chooser: the cost on a second sample, the cost itself where it is exact.

    The stated place is among those that are compared."""
    searched, stated = cost.searched, tuple(key.stated for key in cost.searched)
    pilot = None if cost.exact else cost.pilot_realisations
    starts = choose_starts(searched, _evaluate(cost, first_places(cost), pilot))
    first_ends = [search_locally(cost, start, FIRST_SEARCH[cost.exact], pilot) for start in starts]
    finalists, others = _split_finalists(searched, _evaluate(cost, first_ends, pilot))
    for search in FINAL_SEARCHES[cost.exact]:
        finalists = [search_locally(cost, end, search, None) for end in finalists]
    ends = [tuple(float(f"{x:.{DIGITS}g}") for x in end) for end in (*finalists, *others)]
    ends, best = sorted(ends, key=chooser), min((stated, *ends), key=chooser)
    other_hollows = tuple(end for end in ends if _distance(searched, end, best) > SAME_END)
    costs = tuple(chooser(end) for end in ends) if _real_indices(searched) else ()
    return FoundMinimum(best, costs, other_hollows)


def _split_finalists(
    searched: Sequence[SearchedKey], costs: Sequence[tuple[float, Place]]
) -> tuple[list[Place], list[Place]]:
    """The ends of the first searches that are continued, the best of each hollow, and the others."""
    finalists, others = list[Place](), list[Place]()
    for _, place in costs:
        is_new = all(_distance(searched, place, finalist) > SAME_END for finalist in finalists)
        (finalists if is_new and len(finalists) < MAX_FINALISTS else others).append(place)
    return finalists, others


def _evaluate(cost: CostFunction, places: Sequence[Place], count: int | None) -> list[tuple[float, Place]]:
    """The places that have an estimate, with their costs, ascending."""
    costs = [(cost(place, count), place) for place in dict.fromkeys(places)]
    return sorted(pair for pair in costs if math.isfinite(pair[0]))


def first_places(cost: CostFunction) -> list[Place]:
    """Places over the whole range.

    For each combination of whole numbers, the real numbers are scanned one after the other from their stated values;
    then all keys change together, by a Sobol sequence."""
    searched = cost.searched
    pilot = None if cost.exact else cost.pilot_realisations
    whole_grids = [key.search_range.grid() if key.search_range.whole_numbers else [key.stated] for key in searched]
    if math.prod(map(len, whole_grids)) > MAX_WHOLE_COMBINATIONS:
        raise ConfigError(f"{argument('free', '--free')}: too many whole numbers to try: give KEY=LOW:HIGH")
    places = [tuple(key.stated for key in searched), *_spread_places(searched, whole_grids)]
    for combination in itertools.product(*whole_grids):
        if not math.isfinite(cost(combination, pilot)):
            continue
        best = combination
        places.append(combination)
        for i in _real_indices(searched):
            grid = searched[i].search_range.grid(None if cost.exact else PILOT_POINTS)
            candidates = [best, *((*best[:i], x, *best[i + 1 :]) for x in grid)]
            best = min(candidates, key=lambda place: cost(place, pilot))
            places += candidates
    return places


def spread_count(searched: Sequence[SearchedKey]) -> int:
    """How many places of a Sobol sequence are tried: a power of two, none for one key, which is scanned densely."""
    real_keys = len(_real_indices(searched))
    return 0 if real_keys < MIN_SPREAD_KEYS else 2 ** round(math.log2(SPREAD_PLACES_PER_KEY * real_keys))


def expected_places(cost: CostFunction) -> tuple[int, int]:
    """About how many places are tried in the first rounds, and with all realisations."""
    searched = cost.searched
    real_indices, combinations = _real_indices(searched), 1
    for key in searched:
        combinations *= len(key.search_range.grid()) if key.search_range.whole_numbers else 1
    points = None if cost.exact else PILOT_POINTS
    scans = combinations * max(1, sum(len(searched[i].search_range.grid(points)) for i in real_indices))
    starts = MAX_STARTS if len(real_indices) >= MIN_SPREAD_KEYS else min(MAX_STARTS, combinations)
    first_values = starts * FIRST_SEARCH[cost.exact].max_values_per_key * len(real_indices)
    final_values = min(starts, MAX_FINALISTS) * EXPECTED_VALUES_PER_KEY[cost.exact] * len(real_indices)
    return scans + spread_count(searched) + first_values, final_values


def _spread_places(searched: Sequence[SearchedKey], whole_grids: Sequence[Sequence[float]]) -> list[Place]:
    """Places of a Sobol sequence over all keys, the same in each search."""
    count = spread_count(searched)
    if not count:
        return []
    from scipy.stats import qmc

    # Moved by half of their step, so that none is at an end.
    units = qmc.Sobol(len(searched), scramble=False).random_base2(round(math.log2(count))) + 0.5 / count
    return [
        tuple(
            grid[int(u * len(grid))] if key.search_range.whole_numbers else from_unit(key, float(u))
            for key, grid, u in zip(searched, whole_grids, unit, strict=True)
        )
        for unit in units
    ]


def choose_starts(searched: Sequence[SearchedKey], costs: Sequence[tuple[float, Place]]) -> list[Place]:
    """The best places that have no better one near them, at most MAX_STARTS; costs: each with its place, ascending.

    Near is a distance below that of multi-level single linkage, with all keys scaled to a range of one, and the same
    whole numbers."""
    limit = linkage_distance(len(_real_indices(searched)), len(costs))
    places, starts = [place for _, place in costs], list[Place]()
    for rank, place in enumerate(places):
        if len(starts) < MAX_STARTS and all(_distance(searched, place, better) > limit for better in places[:rank]):
            starts.append(place)
    return starts or [tuple(key.stated for key in searched)]


def linkage_distance(keys: int, places: int) -> float:
    """The distance, in a unit cube, within which a better place keeps one from being a start (Rinnooy Kan & Timmer,
    eq. 9, σ = 2)."""
    if not keys or places < 2:
        return math.inf
    volume = math.gamma(1 + keys / 2) * 2 * math.log(places) / places
    return volume ** (1 / keys) / math.sqrt(math.pi)


def search_locally(cost: CostFunction, start: Place, search: LocalSearch, count: int | None) -> Place:
    """The end of a simplex search of the real numbers from a place; count: realisations, None for all."""
    from scipy.optimize import minimize

    searched = cost.searched
    real_indices = _real_indices(searched)
    if not real_indices:
        return start
    scale_place = np.array([searched[i].search_range.to_scale(start[i]) for i in real_indices])

    def logarithm(u: np.ndarray) -> float:
        return float(np.log(max(cost(move_keys(searched, start, u), count), 1e-300)))

    options: Any = {
        "initial_simplex": np.vstack([scale_place, scale_place + search.step * np.eye(len(scale_place))]),
        "xatol": SCALE_TOLERANCE[cost.exact],
        "fatol": COST_TOLERANCE[cost.exact],
        "maxfev": search.max_values_per_key * len(scale_place),
    }
    end = move_keys(searched, start, minimize(logarithm, scale_place, method="Nelder-Mead", options=options).x)
    return min((start, end), key=lambda place: cost(place, count))


def move_keys(searched: Sequence[SearchedKey], best: Place, scale_place: np.ndarray) -> Place:
    """A place with its real numbers moved to these positions (n,) on the scales of the search."""
    coordinates = iter(scale_place)
    return tuple(
        x if key.search_range.whole_numbers else key.search_range.from_scale(float(next(coordinates)))
        for key, x in zip(searched, best, strict=True)
    )


def _real_indices(searched: Sequence[SearchedKey]) -> list[int]:
    """The keys that are real numbers."""
    return [i for i, key in enumerate(searched) if not key.search_range.whole_numbers]


def _distance(searched: Sequence[SearchedKey], place: Place, other: Place) -> float:
    """The distance of two places with each key scaled to a range of one; infinite where whole numbers differ."""
    if any(key.search_range.whole_numbers and x != y for key, x, y in zip(searched, place, other, strict=True)):
        return math.inf
    return math.dist(
        *([_to_unit(searched[i], values[i]) for i in _real_indices(searched)] for values in (place, other))
    )


def _to_unit(key: SearchedKey, x: float) -> float:
    """A value's position on the scale of the search, from 0 to 1 over the range."""
    low, high = (key.search_range.to_scale(end) for end in (key.search_range.low, key.search_range.high))
    return (key.search_range.to_scale(x) - low) / (high - low)


def from_unit(key: SearchedKey, u: float) -> float:
    """The value at a position from 0 to 1 on the scale of the search."""
    low, high = (key.search_range.to_scale(end) for end in (key.search_range.low, key.search_range.high))
    return key.search_range.from_scale(low + u * (high - low))
