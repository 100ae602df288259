"""P1's study: every σ within its statistical error of the exact value; the same check fails for planted faults."""

import types

import numpy as np
import pytest
from numba import njit

from radarsim.app.configs import load
from radarsim.app.work import CaseWork
from radarsim.engine.collect import collect
from radarsim.kernels import linear as kernels
from radarsim.studies.identity import identity
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import filters

RADARS = ("rls1", "rls2", "rls3", "rls4", "rls5")
N = 100_000
LIMIT = 5.85  # of the largest of 600 unit normals: exceeded by chance once in 300 000 runs


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
    assert np.abs(z).max() < LIMIT
    # The deviations are unit normals, though correlated over scans: neither too large nor too small as a whole.
    assert 0.2 < np.sqrt(np.mean(z**2)) < 2.5


def designed(radar, variance_factor=1.0, velocity_factor=1.0):
    """Gains (F, K, 3, 2) of a radar with its manoeuvre variance or its velocity error believed otherwise."""
    spec = load(radar).cases[0].spec
    sigma = np.array([spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps * velocity_factor])
    dt, scans = spec.radar.scan_period_s, spec.scans
    return np.stack(
        [
            filters.design(
                len(f.observes), f.initial_scans, f.manoeuvre_variance * variance_factor, sigma, dt, scans
            ).gains
            for f in spec.filters
        ]
    )


def with_shared_noise(monkeypatch):
    """The block kernel compiled again, with plots whose velocity noise is the range noise."""
    fill_plots = kernels.fill_plots

    def reused(key, first, scan, mean, sigma, z, w):
        fill_plots(key, first, scan, mean, sigma, z, w)
        for i in range(z.size):
            w[i] = mean[1] + sigma[1] * (z[i] - mean[0]) / sigma[0]

    code = kernels.add_block.py_func.__code__
    names = {**vars(kernels), "fill_plots": njit(reused)}
    monkeypatch.setattr(kernels, "add_block", njit(types.FunctionType(code, names)))


def test_the_check_finds_a_manoeuvre_variance_five_per_cent_off():
    assert max(np.abs(deviations(work_of(r, gains=designed(r, variance_factor=1.05)))).max() for r in RADARS) > LIMIT


def test_the_check_finds_a_velocity_error_three_per_cent_off():
    for radar in RADARS:
        sigma = work_of(radar).plan.axes.sigma * [1.0, 1.03]
        assert np.abs(deviations(work_of(radar, sigma=sigma))).max() > LIMIT


def test_the_check_finds_a_velocity_error_believed_three_per_cent_off():
    assert max(np.abs(deviations(work_of(r, gains=designed(r, velocity_factor=1.03)))).max() for r in RADARS) > LIMIT


def test_the_check_finds_gains_one_scan_late():
    for radar in RADARS:
        gains = work_of(radar).plan.problem.gains
        late = np.concatenate([gains[:, :1], gains[:, :-1]], axis=1)
        assert np.abs(deviations(work_of(radar, gains=late))).max() > LIMIT


def test_the_check_finds_noise_shared_by_range_and_velocity(monkeypatch):
    with_shared_noise(monkeypatch)
    assert min(np.abs(deviations(work_of(r))).max() for r in RADARS) > LIMIT


def test_bias_of_a_turning_target_is_the_exact_one():
    work = CaseWork(load("rls2", ["target=turn"]).cases[0])
    sums = collect(work, N)
    axes = work.plan.axes
    moments = work.plan.layout.unpack(sums.values)["error"] / sums.count
    spread = np.sqrt(moments[..., 1] - moments[..., 0] ** 2)
    z = (moments[..., 0] - axes.exact_bias)[axes.available] / spread[axes.available] * np.sqrt(N)
    assert np.abs(z).max() < LIMIT
    assert np.nanmax(np.abs(axes.exact_bias[:, :, 0])) > 3 * spread[0, -1, 0]


def test_c_theta_is_the_papers_table():
    expected = {"rls1": 0.25, "rls2": 2.78, "rls3": 11.11, "rls4": 25, "rls5": 100}
    found = {radar: work_of(radar).plan.axes.C_theta for radar in RADARS}
    assert found == pytest.approx(expected, abs=0.005)


def test_cases_that_differ_only_in_filters_share_their_noise():
    one, other = (load("rls2", ["filters.0.manoeuvre_variance=" + v]).cases[0] for v in ("1e-3", "1e-2"))
    np.testing.assert_array_equal(noise_key(one, "plots"), noise_key(other, "plots"))
    assert identity(one) != identity(other)
    another = load("rls2", ["radar.sigma_range_m=251"]).cases[0]
    assert (noise_key(one, "plots") != noise_key(another, "plots")).any()


def test_identity_ignores_names_and_realisations():
    plain = load("rls2").cases[0]
    for change in ("realisations=7", "radar.name=other", "filters.0.name=mine"):
        assert identity(load("rls2", [change]).cases[0]) == identity(plain)
    for change in ("seed=3", "scans=14", "radar.scan_period_s=9", "target=turn"):
        assert identity(load("rls2", [change]).cases[0]) != identity(plain)


def test_non_finite_numbers_are_found_and_explained():
    work = work_of("rls2")
    gains = work.plan.problem.gains.copy()
    gains[1, 7, 2, 0] = np.nan
    spoiled = work_of("rls2", gains=gains)
    lines = spoiled.explain(0, 3)
    assert lines[0] == "rls2: filter 'r+Vr', scan 8: 3 of 3 realisations not finite"
    assert len(lines) == 15 - 7
