"""Each kernel against its textbook twin, realisation by realisation; the optimum against all sequences of folds."""

import numpy as np
import pytest

from radarsim.studies.ambiguous_doppler import study
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from tests.studies.ambiguous_doppler import naive
from tests.studies.ambiguous_doppler.conftest import (
    BEST,
    FIXED,
    MEMORY,
    NEAREST,
    NO_MEMORY,
    ORACLE,
    RANGE_ONLY,
    made,
    tolerances,
)

REMAINDER = {"name": "remainder", "doppler": "remainder"}
SLOW = {"kind": "random_polynomial", "sigma_velocity_mps": 20.0, "sigma_acceleration_mps2": 0.02}
SINGLE = (RANGE_ONLY, ORACLE, NEAREST)
HOW = {"range only": "none", "oracle": "unfolded", "nearest fold": "nearest"}


def compared(case, lanes=8):
    """Of some realisations: plots as the twins take them, and outputs (B, K, OUTPUT) of the kernels."""
    plan = study.prepare(case)
    plots, out = sums.simulate_outputs(plan.world, plan.banks, 16)
    columns = plots[:, [records.RANGE, records.VELOCITY, records.UNFOLDED, records.DETECTED]]
    for lane in range(lanes):
        yield plan, columns[:, :, lane], out[..., lane]


def twin(case, one):
    radar = case.spec.radar
    sigma = (radar.sigma_range_m, radar.sigma_velocity_mps)
    return naive.Kalman(one, case.spec.prior, sigma, radar.scan_period_s)


def started(plots):
    return np.cumsum(plots[:, 3]) > 0


@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("radar", ["RLS 2", "RLS 5"])
def test_filters_of_one_hypothesis(radar, order, detection):
    variance = {0: 1e4, 1: 4.0, 2: 1e-3}[order]
    filters = [one | {"orders": [order]} for one in SINGLE]
    case = made(radar, filters, 12, FIXED, variance, detection_probability=detection)
    for plan, plots, out in compared(case):
        for one, own in zip(case.spec.filters, out, strict=True):
            x, right = naive.single(twin(case, one), plots, plan.world.spans, HOW[one.name])
            there = started(plots)
            tolerance, _ = naive.precision(twin(case, one), plots[:, 3])
            assert (np.abs(own[:, records.MEAN : records.MEAN + 3] - x)[there] <= tolerance).all()
            assert np.array_equal(own[there, records.RIGHT], right[there])


@pytest.mark.slow_cases_except("RLS 2-1.0", "RLS 4-0.6")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize("radar", ["RLS 2", "RLS 4"])
def test_merging_filter(radar, detection):
    case = made(radar, [NO_MEMORY], 8, detection_probability=detection)
    for plan, plots, out in compared(case, 4):
        x = naive.merged(twin(case, case.spec.filters[0]), plots, plan.world.spans, 160)
        tolerance, _ = tolerances(case, plots[:, 3])
        assert (np.abs(out[0, :, :3] - x)[started(plots)] <= tolerance).all()


@pytest.mark.slow_cases("forty*", "many-1.0")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize(("most", "prune_below"), [(40, 1e-6), (7, 1e-3), (1000, 1e-4)], ids=["forty", "seven", "many"])
def test_remembering_filter(most, prune_below, detection):
    options = {"hypotheses": most, "prune_below": prune_below}
    stagger = [1000.0, 1200.0, 1400.0]
    keys = {"detection_probability": detection, "repetition_rate_hz": stagger}
    case = made("RLS 2", [MEMORY | options, BEST | options], 5, **keys)
    for plan, plots, out in compared(case, 4):
        found = naive.remembering(twin(case, case.spec.filters[0]), plots, plan.world.spans, most, prune_below, 24)
        there = started(plots)
        assert len(out) == 1  # the two filters share a list
        exactly = [records.RIGHT, records.LISTED, records.COUNT]
        assert np.array_equal(out[0][there][:, exactly], found[there][:, exactly])
        apart = (out[0][:, : records.WEIGHTS] - found)[there]
        of_estimates, of_weights = tolerances(case, plots[:, 3])
        assert (np.abs(apart[:, :6]) <= np.tile(of_estimates, 2)).all()
        assert np.abs(apart[:, records.PROBABILITY]).max() < of_weights


@pytest.mark.parametrize("detection", [1.0, 0.6])
def test_remainder_of_two_scans(detection):
    """Velocities by trying all, gains by the textbook; a velocity only where the plot before had another rate."""
    rates = [1000.0, 1200.0, 1400.0]
    case = made("RLS 4", [REMAINDER], 12, SLOW, detection_probability=detection, repetition_rate_hz=rates)
    seen = 0
    for _, plots, out in compared(case):
        solved, before = np.full(12, np.nan), None
        for k in np.flatnonzero(plots[:, 3]):
            if before is not None and k % 3 != before % 3:
                solved[k] = naive.remainder(plots[k, 1], rates[k % 3], plots[before, 1], rates[before % 3], 0.03)
            before = k
        x = naive.with_velocities(twin(case, case.spec.filters[0]), plots, solved)
        there = started(plots)
        tolerance, _ = tolerances(case, plots[:, 3])
        assert (np.abs(out[0, :, :3] - x)[there] <= tolerance).all()
        right = np.abs(solved - plots[:, 2]) < 7.5  # half the smallest span
        assert np.array_equal(out[0, plots[:, 3] > 0, records.RIGHT], right[plots[:, 3] > 0])
        seen += right.sum()
    assert 20 < seen < 8 * 11


@pytest.mark.parametrize("variance", [0.0, 1e-2])
@pytest.mark.parametrize("scans", [2, 3, 4])
def test_without_bounds_it_is_the_sum_over_all_sequences_of_folds(scans, variance):
    unbounded = {"hypotheses": 20_000, "prune_below": 0.0}
    prior = {"sigma_velocity_mps": 30.0, "sigma_acceleration_mps2": 2.0}
    target = {"kind": "random_polynomial", "range_m": 1000.0}
    # Spans of 60 and 72 m/s: with six folds to either side, sequences left out weigh under exp(-50).
    keys = {"repetition_rate_hz": [800.0, 960.0], "sigma_range_m": 40.0}
    case = made("RLS 3", [MEMORY | unbounded], scans, target, variance, prior=prior, **keys)
    sigma = (40.0, 15.0)
    for plan, plots, out in compared(case):
        one, spans = case.spec.filters[0], plan.world.spans
        mean, probability = naive.enumerated(one, case.spec.prior, sigma, 5.0, plots, spans, 6)
        of_estimates, of_weights = tolerances(case, plots[:, 3], np.array([1000.0, 30.0, 2.0]))
        assert (np.abs(out[0, -1, :3] - mean) <= of_estimates).all()
        assert abs(out[0, -1, records.PROBABILITY] - probability) < of_weights
