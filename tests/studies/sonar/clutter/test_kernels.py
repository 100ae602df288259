"""Trackers among false plots: against a textbook twin on the same plots, against the plain filter to the last bit."""

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.studies.sonar import STUDY
from radarsim.studies.sonar.clutter import plots, tracker_design
from radarsim.studies.sonar.clutter.kernels import false_plots, gate, gate_area, track_sums
from radarsim.studies.sonar.clutter.tracker_design import tracker_specs
from tests.studies.sonar.clutter import naive
from tests.studies.sonar.clutter import test_study as given
from tests.studies.sonar.precision import LINE, TERMS
from tests.tolerances import Z, assert_rounded, mean_error, rounding, sigma_error

T, SIGMA = 5.0, np.array([30.0, np.radians(1)])
STATE = (LINE * 600 + 9e3) / 30  # κ of a track whose plots are 9 km away and 600 m apart, of σ 30 m


def tracker(association, gate=0.99, m=2, n=3, name=None, **more):
    return given.tracker(name or association, association, m, n, gate, **{"manoeuvre_variance": 1e-3} | more)


config = partial(given.config, scans=30)


def prepared(*of, **more):
    case = load(config(*of, **more)).cases[0]
    return case, STUDY.prepare(case)


def sums_of(plan, first, count=1):
    return plan.layout.unpack(STUDY.simulate(plan, first, count))


@pytest.mark.parametrize("density", [0.0, 1.0, 5.0])
def test_estimates_are_the_twins(density):
    """Nearest plot and PDA, with misses, drops and losses, realisation by realisation."""
    filters = [
        tracker("nearest"),
        tracker("pda"),
        tracker("pda", 0.9, 3, 4, "other", manoeuvre_variance=1e-2, drop_after_misses=2),
    ]
    case, plan = prepared(filters, density=density, detection=0.8)
    wanted, t, compared = tracker_specs(case.spec), plan.axes.t_s, 0
    for realisation in (0, 1, 2, 3, 511, 70_000):
        sums = sums_of(plan, realisation)
        z, true = plots.target_plots(plan.axes.world, plan.axes.detections, realisation)
        false = [plots.false_plots(plan.axes.field, realisation, k).T for k in range(len(t))]
        for f, choice in enumerate(wanted):
            gate = tracker_design.gate_threshold(choice.gate_probability)
            of = (choice, SIGMA, 0.8, choice.gate_probability, gate, density / 1e6, T)
            for k, (state, x, P) in enumerate(naive.follow(t, z, false, true, *of)):
                assert sums["counts"][f, k, track_sums.CONFIRMED_COUNT] == (state == 2)
                assert sums["counts"][f, k, track_sums.TENTATIVE_COUNT] == (state == 1)
                if state == 2:
                    error = x - plan.axes.world.truth[k, :, :2].ravel()
                    # Likelihoods of plots in the gate, and what a covariance has of these, are exponentials of γ/2.
                    variance = np.diag(P)
                    assert_rounded(sums["error"][f, k, :, 0], error, np.sqrt(variance), STATE * gate, 30 * TERMS)
                    assert_rounded(sums["believed"][f, k], variance, condition=STATE * gate, operations=30 * TERMS)
                    compared += 1
    assert compared > 200


def test_without_clutter_trackers_are_the_plain_filter():
    """With open gates and with closed ones that no plot misses: the oracle's filter, and the study's own kernel."""
    for probability in (1.0, 1 - 1e-12):
        filters = [tracker(kind, probability) for kind in ("known", "nearest", "pda")]
        _, plan = prepared(filters)
        case = load(config([{"name": "plain", "kind": "kalman", "manoeuvre_variance": 1e-3}], detection=0.5)).cases[0]
        plain = STUDY.prepare(case)
        plain = dataclasses.replace(
            plain,
            world=plain.world._replace(plots=plan.axes.world.plots, motion=plan.axes.world.motion),
            detections=plain.detections._replace(certain=np.ones(30, dtype=np.int64)),
        )
        for realisation in (0, 5, 12345):
            error = sums_of(plan, realisation)["error"][..., 0]
            assert (error[1] == error[0]).all()
            assert (error[2] == error[0]).all()
            own = sums_of(plain, realisation)
            sigma = np.sqrt(own["believed"][0, 1:])
            assert_rounded(error[0, 1:], own["error"][0, 1:, :, 0], sigma, STATE, 30 * TERMS)


def test_a_lone_plot_is_certain_for_nearest_whatever_the_gate_and_density():
    """Open gate, false plots expected but none there: the nearest plot is the plain filter; PDA doubts it."""
    _, plan = prepared([tracker("known", 1.0), tracker("nearest", 1.0), tracker("pda", 0.999)])
    doubting = dataclasses.replace(plan, trackers=plan.trackers._replace(density=5e-6))
    error = sums_of(doubting, 3)["error"][..., 0]
    assert (error[1, 2:] == error[0, 2:]).all()
    assert np.abs(error[2, 5:] - error[0, 5:])[:, 0].max() > rounding(STATE, 30 * TERMS) * SIGMA[0]


def test_the_field_is_poisson_and_even_in_area():
    """Numbers in a sector, over realisations, and places of their plots, against their laws."""
    _, plan = prepared([tracker("pda")], density=2.0)
    area = plan.axes.area_m2
    found = [plots.false_plots(plan.axes.field, i, 3) for i in range(2000)]
    number = np.array([one.shape[1] for one in found])
    mean = 2e-6 * area
    assert abs(number.mean() - mean) < mean_error(2000, np.sqrt(mean))
    assert abs(number.var() / mean - 1) < 2 * sigma_error(2000)
    r, b = np.concatenate(found, axis=1)
    for values, low, high in ((r**2, 49e6, 121e6), (b, np.radians(5), np.radians(40))):
        u = np.sort((values - low) / (high - low))
        distance = np.abs(u - (np.arange(u.size) + 0.5) / u.size).max()
        assert distance < 2.2 / np.sqrt(u.size)  # Kolmogorov: exceeded once in 10⁴


def test_a_full_circle_has_no_seam():
    """A target on the seam of a full circle is tracked among as many false plots as elsewhere."""
    target = {"kind": "polynomial", "frame": "polar", "range_m": [9e3, -4.0], "bearing_deg": [0.0, 0.0]}
    counts = []
    for first in (0.0, -180.0):
        one = config([tracker("known")], density=2.0)
        one["target"], one["sensor"]["sector"] = target, {"range_m": [7e3, 11e3], "bearing_deg": [first, first + 360]}
        plan = STUDY.prepare(load(one).cases[0])
        found = sums_of(plan, 0, 512)["counts"][0]
        assert found[2:, track_sums.TARGET_PLOT_COUNT].sum() == 512 * 28
        counts.append(found[:, track_sums.FALSE_IN_GATE_COUNT].sum() / found[:, track_sums.EXPECTED_FALSE_COUNT].sum())
        expected = found[:, track_sums.EXPECTED_FALSE_COUNT].sum()
    assert np.abs(np.array(counts) - 1).max() < Z / np.sqrt(expected)


# ---- the area of a gate within the sector ----------------------------------------------------------------------------
def gate_and_sector(seed):
    """A gate of any size and slant about a sector from 1 to 15 km, over its edges or not; every fifth is a circle."""
    rng = np.random.default_rng(seed)
    half, ring = (math.pi, True) if seed % 5 == 0 else (rng.uniform(0.2, 1.0), False)
    cells = false_plots.Cells(0.5e6, (0.5 * 15e3**2 - 0.5e6) / 20, 20, 0.3 - half, half / 5, 10, ring, 1e-6)
    sigma, rho = np.array([rng.uniform(30, 3000), rng.uniform(0.01, 0.9)]), rng.uniform(-0.95, 0.95)
    S = sigma[0] ** 2, rho * sigma[0] * sigma[1], sigma[1] ** 2
    place = rng.uniform(500, 16e3), 0.3 + rng.uniform(-1.2, 1.2) * half + 2 * math.pi * rng.integers(-1, 2)
    return gate.Gate(*place, S, True), cells, rng.uniform(1, 20)


@pytest.mark.parametrize("seed", range(25))
def test_the_area_of_a_gate_within_the_sector_is_that_of_its_points(seed):
    """Points of equal area in the gate's disc; those along its edges, of n² about 8 n, may count to either side."""
    n = 700
    (r, b, S, _), cells, threshold = gate_and_sector(seed)
    root = np.linalg.cholesky(threshold * np.array([[S[0], S[1]], [S[1], S[2]]]))
    radius, angle = np.sqrt((np.arange(n) + 0.5) / n)[:, None], 2 * np.pi * (np.arange(n) + 0.5) / n
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    off = b - 0.3 if not cells.ring else 0.0
    bearing = off - 2 * np.pi * np.round(off / (2 * np.pi)) + root[1, 0] * u + root[1, 1] * v
    ranges, half = r + root[0, 0] * u, 0.5 * cells.nb * cells.db
    inside = (np.abs(bearing) <= half) & (ranges >= 1e3) & (ranges <= 15e3)
    scale = math.pi * root[0, 0] * root[1, 1]
    det = S[0] * S[2] - S[1] ** 2
    found = gate_area.gate_area.py_func(gate.Gate(r, b, S, True), det, threshold, cells)
    assert found == pytest.approx(scale * (ranges * inside).mean(), abs=8 / n * scale * (r + root[0, 0]))


def test_a_gate_within_the_sector_has_its_own_area_and_an_open_one_the_sectors():
    _, cells, _ = gate_and_sector(1)
    small = gate.Gate(8e3, 0.3, (900.0, 0.0, 3e-4), True)
    area = gate_area.gate_area.py_func(small, 900.0 * 3e-4, 9.0, cells)
    assert_rounded(area, 8e3 * math.pi * 9 * math.sqrt(0.27), operations=8)
    whole = gate_area.gate_area.py_func(small, 0.27, gate.OPEN_GATE, cells)
    assert_rounded(whole, 0.5 * (15e3**2 - 1e6) * cells.nb * cells.db, operations=8)
