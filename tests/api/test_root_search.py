"""Roots on a range: several, touching, jumping, undefined in places; whole numbers; against known roots."""

import math

import numpy as np
import pytest

from radarsim.api.design import root_search
from tests.tolerances import assert_rounded, rounding

RANGE = root_search.search_range(0.01, 100.0)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (lambda x: x - 3, [3]),
        (lambda x: 1 / x - 3, [1 / 3]),
        (lambda x: math.log(x) ** 2 - 4, [math.exp(-2), math.exp(2)]),
        (lambda x: (x - 2) ** 2 - 1e-4, [1.99, 2.01]),  # between two places of the scan
        (lambda x: 1e-4 - (x - 2) ** 2, [1.99, 2.01]),
        (lambda x: math.tanh(50 * (x - 7)), [7]),
        (lambda x: x**9 - 5**9, [5]),
    ],
)
def test_all_roots_are_found_to_rounding(function, expected):
    assert root_search.find_roots(function, RANGE).roots == pytest.approx(expected, rel=root_search.EXACT_WIDTH)


@pytest.mark.parametrize("off", [0.9, 0.99, 0.999999, 1.0, 1.001, 1.1])
@pytest.mark.parametrize("function", [lambda x: math.log(x / 5), lambda x: 1 / x - 0.2, lambda x: x**3 - 125])
def test_a_root_is_found_near_one_that_is_a_little_off(function, off):
    assert root_search.find_root_near(function, RANGE, 5 * off, 0.0) == pytest.approx(
        5, rel=root_search.NEAR_ROOT_WIDTH
    )


@pytest.mark.parametrize("off", [0.999, 0.999999, 1.0, 1.001])
@pytest.mark.parametrize(
    ("function", "rising"),
    [(lambda x: math.log(x / 5), 1.0), (lambda x: 1 / x - 0.2, -0.21), (lambda x: x**3 - 125, 370)],
)
def test_secants_end_at_the_root_in_few_steps(function, rising, off):
    """rising is right to a few per cent, as that of a rougher function is."""
    looks = []

    def seen(x):
        looks.append(x)
        return function(x)

    found = root_search.refine_root(seen, RANGE, 5 * off, rising, 0.0)
    assert found == pytest.approx(5, rel=2 * root_search.SECANT_TOLERANCE)  # of a slope that is a few per cent off
    assert len(looks) <= 4


def test_secants_give_up_where_a_step_brings_no_nearer():
    assert root_search.refine_root(lambda x: 1 + x, RANGE, 5.0, 0.0, 0.0) is None
    assert root_search.refine_root(lambda x: 1 + (x - 5) ** 2, RANGE, 5.001, 0.05, 0.0) is None
    assert root_search.refine_root(lambda x: math.copysign(1, x - 5), RANGE, 5.1, 5.0, 0.0) is None
    assert root_search.refine_root(lambda x: 1e-3 if x < 5 else 1.5e-3, RANGE, 5.1, 5.0, 0.01) is not None


def test_a_function_that_keeps_its_sign_has_no_root_near():
    assert root_search.find_root_near(lambda x: 1 + x, RANGE, 5.0, 0.0) is None
    assert root_search.find_root_near(lambda x: (x - 5) ** 2 + 1e-3, RANGE, 5.0, 0.0) is None


def test_many_roots_on_a_linear_scale():
    found = root_search.find_roots(math.sin, root_search.search_range(1.0, 19.5)).roots
    assert found == pytest.approx([math.pi * n for n in range(1, 7)], rel=root_search.EXACT_WIDTH)


def test_random_cubics_against_their_roots():
    """All three where they stand apart by more than a step of the scan; else one or three, each a root."""
    rng = np.random.default_rng(5)
    step = math.log(100 / 0.01) / 24
    allowed = root_search.EXACT_WIDTH + rounding(4, 4)  # the logarithms of values are up to 4
    for _ in range(200):
        logs, sign = np.sort(rng.uniform(math.log(0.02), math.log(50), 3)), rng.choice([-1, 1])

        def function(x, logs=logs, sign=sign):
            return sign * float(np.prod(math.log(x) - logs))

        found = np.log(root_search.find_roots(function, RANGE).roots)
        if np.diff(logs).min() > step:
            assert found == pytest.approx(logs, rel=0, abs=allowed)
        assert len(found) in (1, 3)
        assert np.abs(found[:, None] - logs).min(axis=1).max() < allowed


@pytest.mark.parametrize(("turn", "sign"), [(0.37, 1), (2.0, -1), (61.0, 1)])
def test_where_there_is_no_root_the_limit_is_the_turn(turn, sign):
    found = root_search.find_roots(lambda x: sign * (math.log(x / turn) ** 2 + 0.25), RANGE)
    assert found.roots == ()
    # The square of the distance is lost beside 0.25.
    assert found.nearest == pytest.approx(turn, rel=math.sqrt(rounding(0.25, 4)))
    assert_rounded(found.nearest_value, sign * 0.25, operations=4)


def test_where_there_is_no_root_the_limit_may_be_an_end():
    found = root_search.find_roots(lambda x: x + 1, RANGE)
    assert (found.roots, found.nearest) == ((), 0.01)


def test_a_root_in_the_last_defined_step_is_found():
    found = root_search.find_roots(lambda x: math.nan if x > 3.2 else x - 3.15, RANGE)
    assert found.roots == pytest.approx([3.15], rel=root_search.EXACT_WIDTH)
    beyond = root_search.find_roots(lambda x: math.nan if x > 3.2 else x - 3.3, RANGE)
    assert beyond.roots == ()
    assert beyond.nearest == pytest.approx(3.2, rel=math.log(1e4) / 24 / 2**10)  # of a step, halved ten times


def test_a_function_that_is_defined_nowhere_is_refused():
    with pytest.raises(root_search.UndefinedFunctionError, match="not defined"):
        root_search.find_roots(lambda x: math.nan, RANGE)


def test_a_jump_over_zero_is_closed_to_the_jump():
    (root,) = root_search.find_roots(lambda x: -1.0 if x < 7.3 else 1.0, RANGE).roots
    assert root == pytest.approx(7.3, rel=root_search.EXACT_WIDTH)


@pytest.mark.parametrize(("low", "high"), [(2, 30), (2, 100_000)])
@pytest.mark.parametrize("edge", [5, 17, 29])
def test_of_whole_numbers_one_beside_the_change(low, high, edge):
    over = root_search.search_range(low, high, whole_numbers=True)
    seen = []

    def function(n):
        seen.append(n)
        return n - edge + 0.5

    (root,) = root_search.find_roots(function, over).roots
    assert root in (edge - 1, edge)
    assert all(float(n).is_integer() for n in seen)


def test_the_search_takes_few_values():
    count = 0

    def function(x):
        nonlocal count
        count += 1
        return math.log(x) - 1

    root_search.find_roots(function, root_search.search_range(1e-3, 1e3))
    assert count <= 45


def test_a_change_of_sign_across_a_gap_is_no_root():
    over = root_search.search_range(-1.0, 2.0)
    found = root_search.find_roots(lambda x: math.nan if -0.001 < x < 0.001 else x / abs(x) * (1 + x * x), over)
    assert found.roots == ()
    nearest = 0.001 + 3 / 24 / 2**10  # a step, halved ten times
    assert abs(found.nearest_value) == pytest.approx(1, rel=0, abs=nearest**2)
