"""P1's study: every σ within its statistical error of the exact value, noise and identity of a case."""

import numpy as np
import pytest

from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.engine.collect import collect
from tests.tolerances import Z

RADARS = ("rls1", "rls2", "rls3", "rls4", "rls5")
N = 100_000


def deviations(work, n=N):
    """(σ/exact - 1)·√(2N) for every filter, scan and component that has an estimate."""
    sums = collect(work, n)
    axes = work.plan.axes
    sigma = np.sqrt(work.plan.layout.unpack(sums.values)["error"][..., 1] / sums.count)
    return (sigma / axes.exact_sigma - 1)[axes.available] * np.sqrt(2 * n)


def work_of(radar, **changes):
    """The work of a shipped radar, parts of its problem changed after the exact values were made."""
    work = CaseWork(load(radar).cases[0])
    work.plan.__dict__["problem"] = work.plan.problem._replace(**changes)
    return work


@pytest.mark.parametrize("radar", RADARS)
def test_every_sigma_is_exact_within_its_statistical_error(radar):
    z = deviations(work_of(radar))
    assert np.abs(z).max() < Z
    # Unit normals, though correlated over scans: the mean square of ten is beyond these once in 300 000 looks.
    assert 0.2 < np.sqrt(np.mean(z**2)) < 2.5


def test_bias_of_a_turning_target_is_the_exact_one():
    work = CaseWork(load("rls2", ["target=turn"]).cases[0])
    sums = collect(work, N)
    axes = work.plan.axes
    moments = work.plan.layout.unpack(sums.values)["error"] / sums.count
    spread = np.sqrt(moments[..., 1] - moments[..., 0] ** 2)
    z = (moments[..., 0] - axes.exact_bias)[axes.available] / spread[axes.available] * np.sqrt(N)
    assert np.abs(z).max() < Z
    assert np.nanmax(np.abs(axes.exact_bias[:, :, 0])) > 3 * spread[0, -1, 0]


def test_non_finite_numbers_are_found_and_explained():
    work = work_of("rls2")
    gains = work.plan.problem.gains.copy()
    gains[1, 7, 2, 0] = np.nan
    spoiled = work_of("rls2", gains=gains)
    lines = spoiled.explain(0, 3)
    assert lines[0] == "rls2: filter 'r+Vr', scan 8: 3 of 3 realisations not finite"
    assert len(lines) == 15 - 7
