"""Statistics from sums: exact algebra on hand cases, and the coverage of every interval by simulation."""

import math

import numpy as np
import pytest

from radarsim.report import statistics
from tests.tolerances import assert_rounded, mean_error, rounding


def moments(e):
    """Sums of e … e⁴ over the last axis."""
    return np.stack([(e**p).sum(axis=-1) for p in (1, 2, 3, 4)], axis=-1)


def test_by_hand():
    of = statistics.errors(moments(np.array([1.0, 3.0])), 2)
    assert of.sigma.value == math.sqrt(5)  # of a quotient that is exact
    assert of.bias == 2
    assert of.spread == 1
    assert of.bias_se == 1  # sample deviation √2 over √2
    assert_rounded(of.sigma.value**2, of.bias**2 + of.spread**2, operations=2)


def test_mean_by_hand():
    of = statistics.mean(4.0, 10.0, 2)  # of 1 and 3: the sample deviation √2 over √2 is 1
    assert (of.value, of.hi - of.value, of.value - of.lo) == (2, statistics.student(1), statistics.student(1))
    assert tuple(statistics.mean(2.0, 4.0, 1)) == (2, -np.inf, np.inf)


def test_student_against_the_library():
    from scipy.special import stdtrit

    freedom = np.array([4, 5, 9, 29, 999, 1e6])
    np.testing.assert_allclose(statistics.student(freedom), stdtrit(freedom, 0.975), rtol=4e-4)  # as it states
    assert statistics.student(0) == np.inf


def test_gaussian_interval_is_the_chi_square_one():
    from scipy.special import chdtri

    n = 100_000.0
    of = statistics.root_mean_square(n, n * (1 + 2 * (n - 1) / (n + 2)), n)
    # Wilson and Hilferty's quantiles err by 1/n of the half-width, as Student's t for the normal quantile does.
    half = statistics.Z95 / math.sqrt(2 * n)
    further = (statistics.Z95**2 + 1) / n
    assert of.lo == pytest.approx(math.sqrt(n / chdtri(n, 0.025)), rel=half * further)
    assert of.hi == pytest.approx(math.sqrt(n / chdtri(n, 0.975)), rel=half * further)
    assert (of.hi - of.lo) / 2 == pytest.approx(half, rel=further)


def test_the_same_error_gains_nothing_for_certain():
    e = moments(np.random.default_rng(4).normal(size=50))
    of = statistics.gain(e[1], e[3], e[1], e[3], e[3], 50)
    np.testing.assert_array_equal([of.value, of.lo, of.hi], 0)  # m + m − 2m is exact


def test_rate_is_wilsons():
    of = statistics.rate(np.array([0, 5, 10]), 10)
    np.testing.assert_allclose(of.lo, [0, 0.2366, 0.7225], rtol=0, atol=0.5e-4)  # as printed
    np.testing.assert_allclose(of.hi, [0.2775, 0.7634, 1], rtol=0, atol=0.5e-4)


def test_difference_adds_in_squares():
    one, other = statistics.Estimate(10.0, 7.0, 14.0), statistics.Estimate(1.0, -2.0, 5.0)
    assert statistics.difference(one, other) == (9.0, 9.0 - 5.0, 9.0 + 5.0)


def test_difference_with_what_never_settles_says_nothing_and_warns_of_nothing():
    one, never = statistics.Estimate(12.0, 7.0, np.inf), statistics.Estimate(np.inf, 0.0, np.inf)
    assert np.isnan([statistics.difference(one, never).lo, statistics.difference(never, never).value]).all()


def test_bias_far_over_spread():
    e = 1e6 + np.random.default_rng(7).normal(size=10_000)
    of = statistics.errors(moments(e), e.size)
    # What is left of squares 10¹² as large, summed in blocks and by pairs: 25 roundings; half of it for the root.
    allowed = rounding(1e12, 25) / 2
    assert of.spread == pytest.approx(e.std(), rel=allowed)
    assert of.sigma.lo <= of.sigma.value <= of.sigma.hi
    assert of.sigma.hi - of.sigma.lo == pytest.approx(2 * statistics.Z95 * e.std() / 100, rel=allowed)


def test_empty_and_degenerate_samples():
    none = statistics.errors(np.zeros(4), 0)
    assert np.isnan([none.sigma.value, none.sigma.lo, none.sigma.hi, none.bias, none.spread]).all()
    still = statistics.errors(np.zeros(4), 7)
    assert tuple(still.sigma) == (0, 0, 0)
    one = statistics.errors(np.array([2.0, 4.0, 8.0, 16.0]), 1)
    assert (one.sigma.lo, one.sigma.value, one.sigma.hi) == (0, 2, np.inf)
    assert np.isnan(one.bias_se)


def test_effective_realisations():
    """n/(κ − 1): half of n for Gaussian errors; endless of equal squares; one large error alone counts as one."""
    e = np.random.default_rng(1).standard_normal(200_000)
    found = statistics.effective(np.sum(e**2), np.sum(e**4), e.size)
    assert found == pytest.approx(e.size / 2, rel=mean_error(e.size, math.sqrt(24)) / 2)  # var κ̂ is 24/n
    assert statistics.effective(10.0, 10.0, 10) == np.inf
    assert_rounded(statistics.effective(1.0, 1.0, 1000), 1000 / 999, operations=3)
    assert np.isnan(statistics.effective(0.0, 0.0, 0))


def test_a_weighted_share_of_one_has_the_interval_of_the_plain_trials():
    """Weights may add up to n and more; how often it does not happen, only realisations of the law itself tell."""
    for total in (1000.0, 1001.0):
        of = statistics.weighted_rate(total, 2000.0, 1000.0, 100.0)
        np.testing.assert_array_equal(of, statistics.rate(100.0, 100.0))


@pytest.mark.parametrize("n", [1, 3, 100, 106, 109, 315, 1000, 12345])
def test_the_interval_of_a_share_holds_the_share(n):
    """Of none and of all too, where rounding once left 1 above the upper end."""
    for count in {0, 1, n // 3, n - 1, n}:
        of = statistics.rate(count, n)
        assert of.lo <= of.value <= of.hi
    every = statistics.rate(n, n)
    assert every.hi == 1
    assert statistics.rate(0, n).lo == 0
