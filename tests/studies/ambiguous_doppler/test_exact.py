"""Exact σ, exact probabilities, calibration: against simulation, within statistical error at every scan."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from radarsim.studies.ambiguous_doppler import exact_errors, study
from tests.studies.ambiguous_doppler.conftest import (
    FIXED,
    MEMORY,
    NEAREST,
    ORACLE,
    RANDOM,
    RANGE_ONLY,
    make_case,
    plan_and_sums,
)
from tests.tolerances import Z, assert_rounded, rounding, sigma_error

N = 100_000
SURE = np.sqrt(rounding(operations=10))  # of σ: a spread that is zero but for the rounding of a difference of squares


def sigma(sums):
    return np.sqrt(sums.error[..., 1] / sums.estimates)


@pytest.mark.parametrize("target", [RANDOM, FIXED], ids=["random", "fixed"])
@pytest.mark.parametrize("radar", ["RLS 2", "RLS 4", "RLS 5"])
def test_range_only_and_oracle_are_exact(radar, target):
    plan, sums = plan_and_sums(make_case(radar, [RANGE_ONLY, ORACLE], 15, target), N)
    z = (sigma(sums) / plan.axes.exact_sigma - 1) * np.sqrt(2 * N)
    assert np.abs(z).max() < Z
    # Correlated over scans: the mean square of ten unit normals is beyond these once in 300 000 looks.
    assert 0.2 < np.sqrt(np.mean(z**2)) < 2.5
    mean = sums.error[..., 0] / N
    spread = np.sqrt(np.maximum(plan.axes.exact_sigma**2 - plan.axes.exact_bias**2, 0))
    random = spread > SURE * plan.axes.exact_sigma  # at the first scan a fixed velocity is missed by itself
    assert np.abs((mean - plan.axes.exact_bias) / np.where(random, spread, 1) * np.sqrt(N))[random].max() < Z
    assert_rounded(mean[~random], plan.axes.exact_bias[~random], operations=N)


TURN = {"kind": "turn", "range_m": 60e3, "speed_mps": 250.0, "aspect_deg": 180.0, "start_s": 40.0}
TARGETS = {
    "turn": TURN | {"acceleration_g": 3.0, "duration_s": 20.0},
    "brake": {"kind": "acceleration_start", "coefficients": [100e3, -250.0], "start_s": 40.0, "acceleration_mps2": 5.0},
    "fly-by": {"kind": "fly_by", "distance_m": 8e3, "speed_mps": 300.0, "start_range_m": 25e3},
    "recorded": {"kind": "recorded", "file": str(Path(__file__).parents[3] / "scenarios" / "recorded.csv")},
}


@pytest.mark.parametrize("kind", TARGETS)
def test_targets_that_break_the_model(kind):
    """σ of the oracle and its bias are exact: whatever moved the target is in the truth."""
    n = 20_000
    plan, sums = plan_and_sums(make_case("RLS 2", [RANGE_ONLY, ORACLE], 12, TARGETS[kind]), n)
    exact_sigma, exact_bias = plan.axes.exact_sigma, plan.axes.exact_bias
    errs = exact_sigma > 0  # who flies straight in has no acceleration to miss at the first scan
    z = (sigma(sums) - exact_sigma)[errs] / exact_sigma[errs] * np.sqrt(2 * n)
    assert np.abs(z).max() < Z
    mean = sums.error[..., 0] / n
    spread = np.sqrt(np.maximum(exact_sigma**2 - exact_bias**2, 0))
    random = spread > SURE * exact_sigma
    assert np.abs((mean - exact_bias)[random] / spread[random] * np.sqrt(n)).max() < Z
    assert np.abs(exact_bias[1, 3:, 1]).max() > 1  # it does break the model


@pytest.mark.parametrize("order", [0, 1])
def test_lower_orders_are_exact(order):
    filters = [RANGE_ONLY | {"orders": [order]}, ORACLE | {"orders": [order]}]
    plan, sums = plan_and_sums(make_case("RLS 2", filters, 15, FIXED, 25.0), N)
    is_known = np.isfinite(plan.axes.exact_sigma)
    assert np.array_equal(is_known, plan.axes.available)
    assert is_known[:, 0].sum(axis=1).tolist() == ([1, 2] if order == 0 else [2, 2])
    z = (sigma(sums) / plan.axes.exact_sigma - 1)[is_known] * np.sqrt(2 * N)
    # e² of a biased error varies less than 2σ⁴: the deviations are smaller than unit normals, never larger.
    assert np.abs(z).max() < Z


def binomial(count, n, p):
    """Whether counts `found` of n lie within the interval that is missed as seldom as Z standard errors."""
    chance = stats.norm.sf(Z)
    return (stats.binom.ppf(chance, n, p) <= count) & (count <= stats.binom.isf(chance, n, p))


@pytest.mark.parametrize(("radar", "scans"), [("RLS 2", 15), ("RLS 3", 29), ("RLS 4", 15), ("RLS 5", 29)])
def test_rate_of_right_nearest_folds_is_the_product(radar, scans):
    """Over all scans of the published runs; the product falls from one half to one in 10⁶ and less."""
    plan, sums = plan_and_sums(make_case(radar, [NEAREST], scans, variance=0.0), N)
    p, right_counts = plan.axes.exact_right[0], sums.folds[0, :, 0]
    assert np.isfinite(p).all()
    assert (p[1:] <= p[:-1]).all()
    assert binomial(right_counts, N, p).all()


REMAINDER = {"name": "remainder", "doppler": "remainder"}
SLOW = {"kind": "random_polynomial", "sigma_velocity_mps": 15.0, "sigma_acceleration_mps2": 0.01}
STEADY = {"kind": "polynomial", "coefficients": [100e3, -40.0, 0.05]}


@pytest.mark.parametrize("target", [RANDOM, SLOW, STEADY], ids=["drawn", "slow", "fixed"])
@pytest.mark.parametrize("rates", [[1000.0, 1200.0], [1000.0, 1200.0, 1400.0]], ids=["two rates", "three"])
def test_rate_of_right_remainders_is_exact(rates, target):
    plan, sums = plan_and_sums(make_case("RLS 4", [REMAINDER], 15, target, repetition_rate_hz=rates), N)
    p, right_counts = plan.axes.exact_right[0], sums.folds[0, :, 0]
    assert p[0] == 0
    assert (p[1:] > 0.001).all()
    assert binomial(right_counts, N, p).all()
    sure = plan.axes.oracle_sigma[0]
    assert (sigma(sums)[0, 1:, 1] > sure[1:, 1]).all()  # wrong ones cost


def test_remainder_probability_by_hand():
    """Two spans of 15 and 18 m/s and a still target: right where the difference of two noises of 1 m/s is under 1.5."""
    rate = {"repetition_rate_hz": [1000.0, 1200.0], "wavelength_m": 0.03}
    plan = study.prepare(make_case("RLS 4", [REMAINDER], 4, {"kind": "polynomial", "coefficients": [1e5]}, **rate))
    wrong_by_a_span = [
        stats.norm.cdf(15 * i + 1.5, scale=2**0.5) - stats.norm.cdf(15 * i - 1.5, scale=2**0.5) for i in (1, 2)
    ]
    expected = stats.norm.cdf(1.5 / 2**0.5) - stats.norm.cdf(-1.5 / 2**0.5) + 2 * sum(wrong_by_a_span)
    assert_rounded(plan.axes.exact_right[0, 1:], np.full(3, expected), operations=20)  # ten values of Φ


@pytest.mark.slow_cases_except("RLS 4")
@pytest.mark.parametrize("radar", ["RLS 2", pytest.param("RLS 3", marks=pytest.mark.slow), "RLS 4", "RLS 5"])
def test_probabilities_of_the_best_hypothesis_are_calibrated(radar, matched):
    """Where truth and filter agree the best is right as often as its probability says, in every bin, at every scan."""
    _, sums = matched(radar)
    n, right, expected = np.moveaxis(sums.calibration[3], -1, 0)
    some = n > 0
    mean = np.where(some, expected / np.where(some, n, 1), 0.5)
    # Within a bin probabilities differ by at most a tenth; the variance of a sum of events is at most n p (1 - p).
    deviation = (right - expected)[some] / np.sqrt(np.maximum(n * mean * (1 - mean), 1.0))[some]
    assert np.abs(deviation).max() < Z
    assert some.sum() >= 20  # two bins a scan, at the least
    assert n.sum() == 10 * N


@pytest.mark.parametrize("radar", ["RLS 2", "RLS 4"])
def test_memory_lies_between_nearest_fold_and_oracle(radar, matched):
    """The optimum is no worse than the filter of range alone, nor better than the one that knows the folds."""
    _, sums = matched(radar)
    range_only, oracle, _, memory = sigma(sums)
    error = sigma_error(N, sums.error[..., 3] / N / sigma(sums) ** 4)  # as if independent: on the same plots it is less
    assert (memory < range_only * (1 + np.hypot(error[0], error[3]))).all()
    assert (memory > oracle * (1 - np.hypot(error[1], error[3]))).all()


def test_no_exact_probability_if_truth_and_filter_differ():
    def is_known(**changes):
        plan = study.prepare(make_case("RLS 4", [NEAREST, MEMORY], 4, **({"variance": 0.0} | changes)))
        return np.isfinite(plan.axes.exact_right).any(axis=1).tolist()

    assert is_known() == [True, False]
    assert is_known(variance=1e-3) == [False, False]
    assert is_known(target=FIXED) == [False, False]
    assert is_known(target=RANDOM | {"sigma_velocity_mps": 100.0}) == [False, False]
    assert is_known(detection_probability=0.9) == [False, False]


def test_product_of_teunissen():
    """Two scans of a span of two standard deviations: erf(1/√2)² = 0.4660649…"""
    gains = exact_errors.Gains(
        np.eye(3), np.zeros((2, 3)), np.zeros((2, 3)), np.array([4.0, 9.0]), np.ones(2), np.zeros((2, 3, 3))
    )
    expected = [0.6826894921370859, 0.6826894921370859**2]
    assert_rounded(exact_errors.nearest_fold_probability(gains, np.array([4.0, 6.0])), expected, operations=5)
