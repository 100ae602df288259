"""What sentences say of a row: exact first, paired next; extremes that noise chose have an interval for all of them."""

import numpy as np
import pandas as pd
import pytest

from radarsim.report import compared_value, gain_sentences, statistics
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import GAIN, SIGMA
from radarsim.report.statistics import Estimate


def gain_value(value, low, high, exact=np.nan):
    row = {"gain_percent": value, "gain_lo": low, "gain_hi": high, "exact_percent": exact}
    return compared_value.row_value(row, GAIN)


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        ((0.03, 0.01, 0.04), "less than 0.1 % lower or higher"),
        ((-0.01, -0.04, 0.02), "less than 0.1 % lower or higher"),
        ((-0.04, -0.2, 0.1), "not significantly lower or higher (gain 0.0 % [−0.2, 0.1])"),
        ((1.6, -1.0, 4.1, -1.26), "1.3 % higher"),
        ((1.9, -0.7, 4.4, 1.41), "1.4 % lower"),
        ((33.8, 31.1, 36.7, 30.97), "31.0 % lower"),
        ((1.9, -0.7, 4.4, 0.04), "less than 0.1 % lower or higher"),
        ((1.9, -0.7, 4.4, np.nan), "not significantly lower or higher (gain 1.9 % [−0.7, 4.4])"),
        ((-0.4, -0.8, -0.01), "0.40 % [0.01, 0.80] higher"),
        ((33.04, 32.7, 33.4), "33.0 % [32.7, 33.4] lower"),
        ((-150, -200, -110), "higher by a factor of 2.50 [2.10, 3.00]"),
        ((-150, -200, -110, -151), "higher by a factor of 2.51"),
    ],
)
def test_a_gain_in_words(gain, words):
    assert gain_sentences.comparison_text(gain_value(*gain)) == words


def test_equal_filters_are_called_equal_and_what_was_not_seen_is_said():
    equal = gain_value(0.0, -1e-6, 1e-6)
    assert gain_sentences.is_equal(equal)
    assert not gain_sentences.is_equal(gain_value(0.0, -0.1, 0.1))
    assert gain_sentences.percent_text(equal, 1000) == (
        "identical in all 1000 realisations: a difference in fewer than 0.3 % would not have shown"
    )
    assert gain_sentences.percent_text(gain_value(-0.707, -0.999, -0.416), 1000) == "−0.707 % [−0.999, −0.416]"
    assert gain_sentences.number_text(equal) == "0 %"  # as one end of a range
    assert gain_sentences.number_text(gain_value(0.0, -1e-6, 1e-6, 0.0)) == "0 %"


CURVES = pd.DataFrame(
    {
        "case": "a", "component": "r", "k": 1, "filter": ["base", "mine", "some"], "n": [1000, 1000, 950],
        "sigma": [160.0, 161.3, 139.3], "sigma_lo": [153.0, 152.0, 134.0], "sigma_hi": [167.0, 171.8, 144.0],
        "exact_sigma": [154.7, np.nan, np.nan],
    }
)  # fmt: skip
GAINS = pd.DataFrame(
    {
        "case": "a", "component": "r", "k": 1, "filter": ["mine", "some"], "baseline": "base",
        "gain_percent": [-0.707, 1.0], "gain_lo": [-0.999, 0.9], "gain_hi": [-0.416, 1.1], "exact_percent": np.nan,
    }
)  # fmt: skip


def test_sigma_beside_an_exact_rival_is_the_exact_one_times_the_paired_ratio():
    rows = {row["filter"]: row for _, row in CURVES.iterrows()}
    tables = {"curves": CURVES, "gains": GAINS}
    assert compared_value.sigma_value(rows["base"], tables).text("m") == "154.7 m"
    assert compared_value.sigma_value(rows["mine"], tables).text("m") == "155.8 m [155.3, 156.2]"
    assert (
        compared_value.sigma_value(rows["some"], tables).text("m") == "139.3 m [134.0, 144.0]"
    )  # of other realisations


def test_two_sigmas_are_compared_by_what_is_known_best():
    rows = {row["filter"]: row for _, row in CURVES.iterrows()}
    tables = {"curves": CURVES, "gains": GAINS}
    gain = compared_value.sigma_gain(rows["base"], rows["mine"], tables)
    assert 0 < gain.lo < gain.value < gain.hi < 1.1  # unpaired, 161.3 [152, 171.8] against 154.7 decides nothing
    reverse = compared_value.sigma_gain(rows["mine"], rows["base"], tables)
    np.testing.assert_allclose(reverse, [-0.707, -0.999, -0.416])
    exact = compared_value.sigma_gain(rows["base"], rows["base"], tables)
    assert (exact.lo, exact.hi) == (0.0, 0.0)


def test_an_extreme_is_the_exact_one_or_says_that_it_was_chosen():
    rows = pd.DataFrame({"gain_percent": [33.8, 30.0], "gain_lo": [31.1, 28.0], "gain_hi": [36.7, 32.0]})
    row, value = compared_value.extreme(rows, GAIN)
    assert (row.name, value.looks) == (0, 2)
    assert value.estimate.lo < 31.1 < 36.7 < value.estimate.hi
    assert value.choice_remark() == " (95 % for both simulated values together)"
    row, value = compared_value.extreme(rows.assign(exact_percent=[30.9, 31.2]), GAIN)
    assert (row.name, value.value, value.is_exact, value.choice_remark()) == (1, 31.2, True, "")


@pytest.mark.parametrize(
    ("widen", "estimate"),
    [
        (statistics.simultaneous_sizes, Estimate(10.0, 8.0, 13.0)),
        (statistics.simultaneous_gains, Estimate(10.0, 5.0, 14.7)),
        (statistics.simultaneous_shares, statistics.rate(0, 100)),
        (statistics.simultaneous_shares, statistics.rate(3, 100)),
        (statistics.simultaneous_shares, statistics.rate(100, 100)),
    ],
)
def test_intervals_that_hold_together_are_those_of_one_where_there_is_one(widen, estimate):
    np.testing.assert_allclose(widen(estimate, 1), estimate, rtol=1e-12, atol=1e-15)
    wider = widen(estimate, 20)
    assert wider.lo <= estimate.lo <= estimate.hi <= wider.hi
    assert wider.hi - wider.lo > 1.4 * (estimate.hi - estimate.lo)


def test_the_largest_of_many_measured_values_is_held_by_its_interval():
    """Of 28 equal gains the largest lies above its plain interval in half the samples, within the wider one in 95 %."""
    noise = np.random.default_rng(1).standard_normal((2000, 28))
    largest = noise.max(axis=1)
    half = statistics.simultaneous_sizes(Estimate(1.0, np.exp(-1.96e-3), np.exp(1.96e-3)), 28)
    reach = np.log(half.hi) * 1e3
    assert np.mean(largest > 1.96) > 0.45
    assert np.mean(largest > reach) < 0.04


def test_values_that_noise_orders_are_not_distinguished():
    close = [ComparedValue(Estimate(v, v - 1, v + 1), False) for v in (10.0, 11.0, 13.0)]
    assert not compared_value.are_distinguished(close[0], close[1])
    assert compared_value.are_distinguished(close[0], close[2])
    exact = [ComparedValue(Estimate(v, v, v), True) for v in (1.0, 1.0)]
    assert not compared_value.are_distinguished(*exact)
    assert SIGMA.exact_column == "exact_sigma"


def test_a_remark_stands_once_behind_the_last_value_with_an_interval():
    measured, exact = (ComparedValue(Estimate(5.0, 4.0, 6.0), is_exact).chosen_among(4) for is_exact in (False, True))
    remark = " (95 % for all 4 simulated values together)"
    assert compared_value.choice_remark([exact, measured]) == compared_value.choice_remark([measured]) == remark
    assert compared_value.choice_remark([exact, exact]) == ""
