"""How well a search determines the keys: the range over which one is as good, the interval of its best value."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from radarsim.api.design.jackknife import jackknife_interval
from radarsim.api.design.tuning_cost import FamilyCost
from radarsim.api.design.tuning_search import from_unit, move_keys
from radarsim.api.design.tuning_space import (
    MIN_PROBABILITY,
    NEAR_END,
    Path,
    Place,
    ProbabilityRange,
    SearchedKey,
    from_scale,
    is_at_end,
)
from radarsim.errors import ConfigError

FLAT_CHANGE = 1e-3  # of the quantity: within it a key is as good as tuned
NO_CHANGE = 1e-9  # of the quantity: largest change where a key has no effect
STEP = 0.25  # on the scale of the search, of derivatives of sampled values


def flat_interval(cost: FamilyCost, best: Place, i: int) -> tuple[float, float]:
    """The range of a key over which the exact quantity is within 0.1 % of its minimum."""
    search_range, limit = cost.searched[i].search_range, (1 + FLAT_CHANGE) * cost(best)
    ends = []
    for end in (search_range.low, search_range.high):
        inside, outside = search_range.to_scale(best[i]), search_range.to_scale(end)
        if cost((*best[:i], end, *best[i + 1 :])) > limit:
            for _ in range(24):
                middle = (inside + outside) / 2
                is_flat = cost((*best[:i], search_range.from_scale(middle), *best[i + 1 :])) <= limit
                inside, outside = (middle, outside) if is_flat else (inside, middle)
            outside = inside
        ends.append(search_range.from_scale(outside))
    return ends[0], ends[1]


def keys_without_effect(cost: FamilyCost, place: Place | None = None) -> tuple[SearchedKey, ...]:
    """The keys of which none changes anything over its whole searched range. Default: about the stated values."""
    start = tuple(key.stated for key in cost.searched) if place is None else place
    return tuple(
        key for i, key in enumerate(cost.searched) if key.largest_path is None and _has_no_effect(cost, start, i)
    )


def _has_no_effect(cost: FamilyCost, place: Place, i: int) -> bool:
    """Whether a key changes nothing from near one end of its range to the other: a config may refuse the ends."""
    ends = (from_unit(cost.searched[i], u) for u in (NEAR_END, 1 - NEAR_END))
    values = (cost((*place[:i], x, *place[i + 1 :])) for x in ends)
    return all(math.isclose(value, cost(place), rel_tol=NO_CHANGE) for value in values)


def equally_good(chooser: FamilyCost, best: Place, ends: Sequence[Place]) -> tuple[Place, ...]:
    """The ends of other searches that are as good as the best: to 0.1 % where exact; elsewhere those whose paired
    difference on the sample that chose the best may be none."""
    if chooser.exact:
        return tuple(end for end in ends if chooser(end) <= (1 + FLAT_CHANGE) * chooser(best))
    best_costs, equal = chooser.batch_costs(best), list[Place]()
    for end in ends:
        differences = chooser.batch_costs(end) - best_costs
        _, lo, hi = jackknife_interval(differences[1:], float(differences[0]))
        equal += [end] if lo <= 0 <= hi else []
    return tuple(equal)


def spread_of_tuning(cost: FamilyCost, best: Place) -> dict[Path, tuple[float, float]]:
    """The 95 % intervals of the best values of real numbers, from how far they move without each of the batches.

    Each move is a Newton step from the best place with the gradient of the remaining batches. Empty where the quantity
    has no minimum on this scale, for instance where it is flat or jumps, or at an end of the range."""
    searched = [
        replace(key, search_range=replace(key.search_range, whole_numbers=True)) if is_at_end(key, x) else key
        for key, x in zip(cost.searched, best, strict=True)
    ]
    scale_place = np.array(
        [
            key.search_range.to_scale(x)
            for key, x in zip(searched, best, strict=True)
            if not key.search_range.whole_numbers
        ]
    )

    def costs(u: np.ndarray) -> np.ndarray:
        return cost.batch_costs(move_keys(searched, best, u))

    if not len(scale_place):
        return {}
    try:
        slopes, curvature = _derivatives(costs, scale_place)
    except ConfigError:
        return {}
    if not np.isfinite(curvature).all() or np.linalg.eigvalsh(curvature)[0] <= 0:
        return {}
    newton = scale_place[:, None] - np.linalg.solve(curvature, slopes - slopes[:, :1])
    values = [from_scale(searched, move_keys(searched, best, u), cost.filter_keys) for u in newton.T]
    intervals = {}
    for path in values[0]:
        matching_keys = [key for key in searched if key.path == path and key.largest_path is None]
        if matching_keys and matching_keys[0].search_range.whole_numbers:
            continue
        search_range = (
            matching_keys[0].search_range
            if matching_keys
            else ProbabilityRange(MIN_PROBABILITY**2, 1 - MIN_PROBABILITY**2, False)
        )
        inner = np.array(
            [
                search_range.to_scale(min(max(place_values[path], search_range.low), search_range.high))
                for place_values in values
            ]
        )
        _, lo, hi = jackknife_interval(inner[1:], float(inner[0]))
        intervals[path] = search_range.from_scale(lo), search_range.from_scale(hi)
    return intervals


def _derivatives(costs: Callable[[np.ndarray], np.ndarray], u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (n, 1 + batches) of costs (1 + batches,) at a place u (n,) of the scale, and the curvature (n, n) of the
    first."""
    size, steps = len(u), STEP * np.eye(len(u))
    centre_costs = costs(u)
    upper_costs, lower_costs = ([costs(u + sign * step) for step in steps] for sign in (1, -1))
    diagonal_costs = {(i, j): costs(u + steps[i] + steps[j]) for i, j in itertools.combinations(range(size), 2)}
    slopes = (np.array(upper_costs) - np.array(lower_costs)) / (2 * STEP)
    curvature = np.diag(
        [(a[0] - 2 * centre_costs[0] + b[0]) / STEP**2 for a, b in zip(upper_costs, lower_costs, strict=True)]
    )
    for (i, j), diagonal in diagonal_costs.items():
        curvature[i, j] = curvature[j, i] = (
            diagonal[0] - upper_costs[i][0] - upper_costs[j][0] + centre_costs[0]
        ) / STEP**2
    return slopes, curvature
