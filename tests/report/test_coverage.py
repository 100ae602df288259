"""Of the study's own realisations: 95 % intervals cover the exact σ and gains as often as they say."""

import math

import numpy as np
import pytest

from radarsim.app.configs import load
from radarsim.report import statistics
from radarsim.studies.range_doppler import study as range_doppler


def covered(repetitions, count, radar_config):
    """Share of intervals that hold the exact value, for σ and for paired gains, by scan and component."""
    case = load(radar_config("rls2")).cases[0]
    plan = range_doppler.prepare(case)
    exact = plan.axes.exact_sigma
    gain = 100 * (1 - exact[1] / exact[0])
    of_sigma, of_gain = np.zeros(exact.shape), np.zeros(gain.shape)
    for i in range(repetitions):
        sums = plan.layout.unpack(range_doppler.simulate(plan, i * count, count))
        e = sums["error"]
        sigma = statistics.errors(e, count).sigma
        of_sigma += (sigma.lo <= exact) & (exact <= sigma.hi)
        paired = statistics.gain(e[1, ..., 1], e[1, ..., 3], e[0, ..., 1], e[0, ..., 3], sums["paired"][1], count)
        of_gain += (paired.lo <= gain) & (gain <= paired.hi)
    both = plan.axes.available[0] & plan.axes.available[1]
    both[0] = False  # the same measured range in both: no noise in the gain
    return of_sigma[plan.axes.available] / repetitions, of_gain[both] / repetitions


def check(shares, repetitions):
    """Each share within five standard errors of 95 %, and their mean within half a per cent and its own error."""
    error = math.sqrt(0.95 * 0.05 / repetitions)
    assert np.all(np.abs(shares - 0.95) < 5 * error + 0.005)
    assert abs(shares.mean() - 0.95) < 2 * error + 0.003


def test_coverage_of_sigma_and_gain(radar_config):
    for shares in covered(300, 400, radar_config):
        check(shares, 300)


@pytest.mark.slow
@pytest.mark.parametrize("count", [50, 1000])
def test_coverage_over_two_thousand_repetitions(count, radar_config):
    for shares in covered(2000, count, radar_config):
        check(shares, 2000)
