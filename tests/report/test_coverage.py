"""Of the studies' own realisations: 95 % intervals cover as often as they say where no note stands."""

import math

import numpy as np
import pandas as pd
import pytest

from radarsim.api.configs import load
from radarsim.report import interval_notes, statistics
from radarsim.studies.range_doppler import study as range_doppler
from tests.report.coverage import HIGH, LOW, every, kept, table


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


SEEDS, N = 200, 1000
# Configs with `rare`: overrides, and realisations.
WEIGHTED = {
    "discriminator_rare": (["sweep.estimators.0.lock_probability=[0.99, 0.9999, 0.999999]"], 4000),
    "sonar_clutter_rare": (["sweep.sensor.false_plots_per_km2=[0.01, 0.1]"], N),
    "sonar_clutter_ends": (["sweep.sensor.false_plots_per_km2=[0, 0.001]"], 4000),
    "ambiguous_rare": (["sweep.radar.repetition_rate_hz=[700, 900, 1100]"], N),
}


def right(experiment, n, seeds):
    """Every interval of every table: what is unmarked covers 93 … 97 %."""
    found = kept(experiment, n, seeds)
    assert ("curves", "sigma") in found
    for key, one in found.items():
        assert not one.wrong(seeds, HIGH).size, (key, one.held[one.wrong(seeds, HIGH)])
        if one.unmarked.sum() >= len(one.held) * seeds / 20:  # what is left of a table that is marked is a choice of it
            assert LOW - 2 * one.error <= one.share <= HIGH + 2 * one.error, (key, one.share, one.error)


@pytest.mark.slow
def test_unmarked_intervals_cover_in_the_first_study():
    right(load("rls2", ["scans=5", f"realisations={N}"]), N, 25)


@pytest.mark.slow
def test_unmarked_intervals_of_every_shipped_config_cover_and_marked_ones_do_not():
    """Of every table: docs/trust.md shows what it prints."""
    found = every()
    found = found[found["note"].ne(str(interval_notes.BELIEVED_VARIES))]
    found = found.assign(marked=found["note"].ne(""))
    count, held = (found.groupby("marked")[name].sum() for name in ("intervals", "held"))
    share = held / count
    assert 0.945 < share[False] < 0.965, table(found)
    assert share[True] < share[False] - 0.05, table(found)
    free = found[~found["marked"]].groupby("study")[["intervals", "held"]].sum()
    assert (free["held"] / free["intervals"]).between(0.94, 0.97).all(), table(found)


@pytest.mark.slow
@pytest.mark.parametrize("config", WEIGHTED)
def test_unmarked_weighted_rates_cover(config):
    """Of rates by importance sampling, and of the shares that other tables take from the same weights."""
    overrides, n = WEIGHTED[config]
    found = kept(load(config, [*overrides, f"realisations={n}"]), n, SEEDS)
    assert ("rare", "event_rate") in found
    for key in found.keys() & {
        ("rare", "event_rate"),
        ("folds", "right"),
        ("folds", "beyond_half_interval_share"),
        ("locks", "lock_rate"),
    }:
        one = found[key]
        assert not one.wrong(SEEDS).size, (key, one.held[one.wrong(SEEDS)])
        if one.unmarked.sum() >= len(one.held) * SEEDS / 20:
            assert LOW - 2 * one.error <= one.share <= HIGH + 2 * one.error, (key, one.share, one.error)


@pytest.mark.parametrize("reach", [0.0, None])
def test_rare_errors_that_last_are_marked_where_a_sample_lacks_them(reach, monkeypatch):
    """An error of 30 σ in one of 1500 realisations, for three of 60 scans: its own scan marks a row too seldom.

    The rows of these scans cover; with the mark of the neighbours taken away they do not, or the test is worth nothing.
    """
    rng, runs, scans = np.random.default_rng(15), 50, 60
    if reach is not None:
        monkeypatch.setattr(interval_notes, "fewest_effective_nearby", lambda curves: curves["n_eff"].to_numpy())
    unmarked, held = np.zeros(scans, dtype=int), np.zeros(scans, dtype=int)
    truth = math.sqrt(1 + 3 / 1500 * 900)
    for _ in range(runs):
        e = rng.normal(size=(N, scans))
        for start in range(scans):
            e[rng.random(N) < 1 / 1500, start : start + 3] += 30
        squares = e**2
        m2, m4 = squares.sum(axis=0), (squares**2).sum(axis=0)
        of, effective = statistics.root_mean_square(m2, m4, N), statistics.effective(m2, m4, N)
        curves = pd.DataFrame({"case": "a", "filter": "f", "component": "x", "k": range(scans), "n_eff": effective})
        free = interval_notes.fewest_effective_nearby(curves) >= interval_notes.MIN_EFFECTIVE
        unmarked += free
        held += free & (of.lo <= truth) & (truth <= of.hi)
    share = held.sum() / max(unmarked.sum(), 1)
    assert share < 0.5 if reach is not None else unmarked.sum() < 0.01 * runs * scans
