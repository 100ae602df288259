"""Each kernel against its textbook twin, realisation by realisation; the optimum against all sequences of folds."""

import numpy as np
import pytest

from radarsim.studies.ambiguous_doppler import study
from radarsim.studies.ambiguous_doppler.kernels import layout, realisations
from tests.studies.ambiguous_doppler import naive
from tests.studies.ambiguous_doppler.conftest import (
    BEST,
    FIXED,
    MEMORY,
    NEAREST,
    NO_MEMORY,
    ORACLE,
    RANGE_ONLY,
    make_case,
    tolerances,
)

REMAINDER = {"name": "remainder", "doppler": "remainder"}
SLOW = {"kind": "random_polynomial", "sigma_velocity_mps": 20.0, "sigma_acceleration_mps2": 0.02}
SINGLE = (RANGE_ONLY, ORACLE, NEAREST)
HOW = {"range only": "none", "oracle": "unfolded", "nearest fold": "nearest"}


def simulate_lanes(case, lanes=8):
    """Of some realisations: plots as the twins take them, and outputs (B, K, OUTPUT) of the kernels."""
    plan = study.prepare(case)
    plots, out = realisations.simulate_outputs(plan.world, plan.banks, 16)
    columns = plots[:, [layout.RANGE, layout.VELOCITY, layout.UNFOLDED, layout.DETECTED]]
    for lane in range(lanes):
        yield plan, columns[:, :, lane], out[..., lane]


def twin(case, options):
    radar = case.spec.radar
    sigma = (radar.sigma_range_m, radar.sigma_velocity_mps)
    return naive.Kalman(options, case.spec.prior, sigma, radar.scan_period_s)


def has_started_by_scan(plots):
    return np.cumsum(plots[:, 3]) > 0


@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("radar", ["RLS 2", "RLS 5"])
def test_filters_of_one_hypothesis(radar, order, detection):
    variance = {0: 1e4, 1: 4.0, 2: 1e-3}[order]
    filters = [options | {"orders": [order]} for options in SINGLE]
    case = make_case(radar, filters, 12, FIXED, variance, detection_probability=detection)
    for plan, plots, out in simulate_lanes(case):
        for options, output in zip(case.spec.filters, out, strict=True):
            x, right = naive.single_hypothesis_states(twin(case, options), plots, plan.world.spans, HOW[options.name])
            has_started = has_started_by_scan(plots)
            tolerance, _ = naive.rounding_errors(twin(case, options), plots[:, 3])
            assert (np.abs(output[:, layout.MEAN : layout.MEAN + 3] - x)[has_started] <= tolerance).all()
            assert np.array_equal(output[has_started, layout.RIGHT], right[has_started])


@pytest.mark.slow_cases_except("RLS 2-1.0", "RLS 4-0.6")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize("radar", ["RLS 2", "RLS 4"])
def test_merging_filter(radar, detection):
    case = make_case(radar, [NO_MEMORY], 8, detection_probability=detection)
    for plan, plots, out in simulate_lanes(case, 4):
        x = naive.merged_fold_states(twin(case, case.spec.filters[0]), plots, plan.world.spans, 160)
        tolerance, _ = tolerances(case, plots[:, 3])
        assert (np.abs(out[0, :, :3] - x)[has_started_by_scan(plots)] <= tolerance).all()


@pytest.mark.slow_cases("forty*", "many-1.0")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize(
    ("max_hypotheses", "prune_below"), [(40, 1e-6), (7, 1e-3), (1000, 1e-4)], ids=["forty", "seven", "many"]
)
def test_remembering_filter(max_hypotheses, prune_below, detection):
    options = {"hypotheses": max_hypotheses, "prune_below": prune_below}
    stagger = [1000.0, 1200.0, 1400.0]
    keys = {"detection_probability": detection, "repetition_rate_hz": stagger}
    case = make_case("RLS 2", [MEMORY | options, BEST | options], 5, **keys)
    for plan, plots, out in simulate_lanes(case, 4):
        expected = naive.hypothesis_outputs(
            twin(case, case.spec.filters[0]), plots, plan.world.spans, max_hypotheses, prune_below, 24
        )
        has_started = has_started_by_scan(plots)
        assert len(out) == 1  # the two filters share a list
        exactly = [layout.RIGHT, layout.LISTED, layout.COUNT]
        assert np.array_equal(out[0][has_started][:, exactly], expected[has_started][:, exactly])
        difference = (out[0][:, : layout.WEIGHTS] - expected)[has_started]
        of_estimates, of_weights = tolerances(case, plots[:, 3])
        assert (np.abs(difference[:, :6]) <= np.tile(of_estimates, 2)).all()
        assert np.abs(difference[:, layout.PROBABILITY]).max() < of_weights


@pytest.mark.parametrize("detection", [1.0, 0.6])
def test_remainder_of_two_scans(detection):
    """Velocities by trying all, gains by the textbook; a velocity only where the plot before had another rate."""
    rates = [1000.0, 1200.0, 1400.0]
    case = make_case("RLS 4", [REMAINDER], 12, SLOW, detection_probability=detection, repetition_rate_hz=rates)
    solved_count = 0
    for _, plots, out in simulate_lanes(case):
        solved, previous = np.full(12, np.nan), None
        for k in np.flatnonzero(plots[:, 3]):
            if previous is not None and k % 3 != previous % 3:
                solved[k] = naive.chinese_remainder(
                    plots[k, 1], rates[k % 3], plots[previous, 1], rates[previous % 3], 0.03
                )
            previous = k
        x = naive.with_velocities(twin(case, case.spec.filters[0]), plots, solved)
        has_started = has_started_by_scan(plots)
        tolerance, _ = tolerances(case, plots[:, 3])
        assert (np.abs(out[0, :, :3] - x)[has_started] <= tolerance).all()
        right = np.abs(solved - plots[:, 2]) < 7.5  # half the smallest span
        assert np.array_equal(out[0, plots[:, 3] > 0, layout.RIGHT], right[plots[:, 3] > 0])
        solved_count += right.sum()
    assert 20 < solved_count < 8 * 11


@pytest.mark.parametrize("variance", [0.0, 1e-2])
@pytest.mark.parametrize("scans", [2, 3, 4])
def test_unbounded_list_is_the_sum_over_all_sequences(scans, variance):
    unbounded = {"hypotheses": 20_000, "prune_below": 0.0}
    prior = {"sigma_velocity_mps": 30.0, "sigma_acceleration_mps2": 2.0}
    target = {"kind": "random_polynomial", "range_m": 1000.0}
    # Spans of 60 and 72 m/s: with six folds to either side, sequences left out weigh under exp(-50).
    keys = {"repetition_rate_hz": [800.0, 960.0], "sigma_range_m": 40.0}
    case = make_case("RLS 3", [MEMORY | unbounded], scans, target, variance, prior=prior, **keys)
    sigma = (40.0, 15.0)
    for plan, plots, out in simulate_lanes(case):
        options, spans = case.spec.filters[0], plan.world.spans
        mean, probability = naive.enumerate_sequences(options, case.spec.prior, sigma, 5.0, plots, spans, 6)
        of_estimates, of_weights = tolerances(case, plots[:, 3], np.array([1000.0, 30.0, 2.0]))
        assert (np.abs(out[0, -1, :3] - mean) <= of_estimates).all()
        assert abs(out[0, -1, layout.PROBABILITY] - probability) < of_weights
