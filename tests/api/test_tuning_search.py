"""The search of `tune`: the lowest of several hollows, whichever sample it sees, chosen on another."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from radarsim.api.design import root_search, tuning_search
from radarsim.api.design.tuning_intervals import keys_without_effect
from radarsim.api.design.tuning_search import choose_starts, find_minimum, linkage_distance
from radarsim.api.design.tuning_space import SearchedKey

WIDTH = math.log(10)  # of a hollow, on the logarithmic scale of the keys
DEEP, SHALLOW = 1.0, 1.3


@dataclass
class Hollows:
    """A cost with hollows at given places, of different depths. A sample tilts it; fewer realisations tilt it more."""

    keys: int
    hollows: list
    exact: bool = True
    tilt: float = 0.0
    seed: int = 0
    pilot_realisations: int = 200
    searched: tuple = ()
    calls: list = field(default_factory=list)

    def __post_init__(self):
        self.searched = self.searched or tuple(
            SearchedKey((f"key{i}",), 1.0, root_search.search_range(1e-4, 1e4)) for i in range(self.keys)
        )
        self.direction = np.random.default_rng(self.seed).standard_normal(self.keys)

    def __call__(self, place, count=None):
        self.calls.append(count)
        u = np.log(place)
        depths = [
            2.0 - (2.0 - low) * math.exp(-((np.linalg.norm(u - np.log(hollow)) / WIDTH) ** 2) / 2)
            for hollow, low in self.hollows
        ]
        noise = self.tilt * float(self.direction @ u) / math.sqrt(count or 1000)
        return min(depths) * math.exp(noise) + 1e-3 * float(u @ u) / len(u)


def random_hollows(keys, seed):
    """A deep hollow and a shallow one, apart from each other; the shallow one at the stated place."""
    rng = np.random.default_rng(seed)
    place = np.exp(rng.choice([-1, 1], keys) * rng.uniform(2 * WIDTH, 3 * WIDTH, keys))
    return [(tuple(place), DEEP), ((1.0,) * keys, SHALLOW)]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("keys", [1, 2])
def test_the_lower_of_two_hollows_is_found(keys, seed):
    hollows = random_hollows(keys, seed)
    objective = Hollows(keys, hollows)
    found = find_minimum(objective, objective)
    assert np.log(found.place) == pytest.approx(np.log(hollows[0][0]), abs=0.2 * WIDTH)
    assert found.end_costs[0] == objective(found.place) < found.end_costs[-1]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("keys", [1, 2])
def test_whatever_the_sample_the_lower_is_found(keys, seed):
    hollows = random_hollows(keys, 3)
    objective, chooser = (Hollows(keys, hollows, exact=False, tilt=0.1, seed=one) for one in (seed, 100 + seed))
    found = find_minimum(objective, chooser)
    assert np.log(found.place) == pytest.approx(np.log(hollows[0][0]), abs=0.5 * WIDTH)


def test_the_second_sample_chooses():
    """What is lower by the noise of the search alone is not chosen."""
    hollows = random_hollows(2, 1)
    swapped = [(hollows[0][0], SHALLOW), (hollows[1][0], DEEP)]
    found = find_minimum(Hollows(2, swapped, exact=False), Hollows(2, hollows, exact=False))
    assert np.log(found.place) == pytest.approx(np.log(hollows[0][0]), abs=0.5 * WIDTH)
    assert list(found.end_costs) == sorted(found.end_costs)


def test_the_stated_place_is_kept_where_nothing_is_better():
    stated_only = Hollows(2, [((1.0, 1.0), DEEP)], exact=False)
    elsewhere = Hollows(2, [((20.0, 20.0), DEEP)], exact=False)
    assert find_minimum(elsewhere, stated_only).place == (1.0, 1.0)


def test_first_rounds_take_few_realisations():
    objective = Hollows(2, random_hollows(2, 1), exact=False)
    find_minimum(objective, Hollows(2, random_hollows(2, 1), exact=False))
    assert objective.calls.count(200) > objective.calls.count(None) > 0


def test_whole_numbers_are_held_in_each_search():
    whole = SearchedKey(("n",), 2.0, root_search.search_range(1, 9, True))
    real = SearchedKey(("x",), 1.0, root_search.search_range(1e-4, 1e4))
    objective = Hollows(2, [((7.0, 1e-2), DEEP), ((2.0, 1.0), SHALLOW)], searched=(whole, real))
    found = find_minimum(objective, objective)
    assert found.place[0] == 7
    assert found.place[1] == pytest.approx(1e-2, rel=0.1)


def test_whole_numbers_alone_have_no_local_searches():
    whole = SearchedKey(("n",), 2.0, root_search.search_range(1, 9, True))
    objective = Hollows(1, [((7.0,), DEEP)], searched=(whole,))
    found = find_minimum(objective, objective)
    assert (found.place, found.end_costs) == ((7.0,), ())


def test_a_start_has_no_better_place_near_it():
    key = SearchedKey(("x",), 1.0, root_search.search_range(1e-4, 1e4))
    values = key.search_range.grid(81)
    objective = Hollows(1, [((1e-3,), DEEP), ((1e2,), SHALLOW)])
    costs = sorted((objective((x,)), (x,)) for x in values)
    assert choose_starts((key,), costs) == [(pytest.approx(1e-3),), (pytest.approx(1e2),)]


def test_the_linkage_distance_shrinks_with_places():
    assert linkage_distance(2, 400) < linkage_distance(2, 100) < linkage_distance(2, 10)
    assert linkage_distance(0, 10) == linkage_distance(2, 1) == math.inf
    assert linkage_distance(2, 100) == pytest.approx(math.sqrt(2 * math.log(100) / 100 / math.pi))


def test_the_starts_are_few():
    rng = np.random.default_rng(1)
    hollows = [(tuple(np.exp(rng.uniform(-9, 9, 5))), rng.uniform(1, 2)) for _ in range(40)]
    objective = Hollows(5, hollows)
    places = [tuple(np.exp(rng.uniform(-9, 9, 5))) for _ in range(300)]
    costs = sorted((objective(place), place) for place in places)
    assert 1 < len(choose_starts(objective.searched, costs)) <= tuning_search.MAX_STARTS


class Slope:
    """A cost that grows with its first key, and refuses the ends of the second, which has no part in it."""

    searched = (
        SearchedKey(("size",), 1.0, root_search.search_range(0.1, 10)),
        SearchedKey(("gate",), 0.9, root_search.search_range(0.5, 1)),
    )

    def __call__(self, place):
        return place[0] if 0.5 < place[1] < 1 else math.inf


def test_a_key_has_no_effect_where_nothing_changes_inside_its_range():
    assert keys_without_effect(Slope()) == Slope.searched[1:]
