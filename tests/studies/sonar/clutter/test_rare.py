"""Rare false tracks: against a textbook twin on the same words, exact laws of two plots, and plain sampling."""

import math
from dataclasses import replace

import numpy as np
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.api.design.sampled_solve import RESIDUE
from radarsim.api.design.solve import solve
from radarsim.errors import ConfigError
from radarsim.kernels import random
from radarsim.studies.sonar import STUDY
from radarsim.studies.sonar.clutter import plots, tracker_design
from radarsim.studies.sonar.clutter.kernels import track_sums
from radarsim.studies.sonar.clutter.kernels.rare_false_tracks import FalseTrackLaws
from tests.studies.sonar.clutter.naive_false import FalseTrack
from tests.studies.sonar.clutter.test_study import config, simulated, tracker
from tests.studies.sonar.precision import LINE, TERMS
from tests.tolerances import EPSILON, assert_rounded, share_error

RARE = {"events": ["false_tracks"]}
LONG = {"events": ["false_tracks", "long_false_tracks"]}
SECTOR = ((7e3, 11e3), (math.radians(5), math.radians(40)))
FOUR_OF_SIX = tracker("four of six", m=4, n=6)


def case_of(filters, density, sought=True, scans=10, rare=RARE, **sensor):
    """A case whose false tracks are sought, or are not."""
    keys = config(filters, density, 0.9, scans, **sensor)
    return load(keys | ({"rare": rare} if sought else {})).cases[0]


def plan_of(*of, **more):
    return STUDY.prepare(case_of(*of, **more))


def reseeded(plan, seed):
    """The plan under other false plots."""
    keys = [random.stream(seed, str(i)) for i in range(4)]
    shift = None if plan.false_track_laws is None else FalseTrackLaws(keys[2], keys[3], plan.false_track_laws.shares)
    field = plan.false_track_field._replace(key=keys[1])
    return replace(plan, false_track_key=keys[0], false_track_field=field, false_track_laws=shift)


def share(plan, n, f=0):
    """The weighted share of tracks that are confirmed, its standard error and effective events."""
    return share_of(simulated(plan, n)["held"], n, f)


def share_of(held, n, f):
    """The same of sums over n realisations, which hold all filters."""
    weight, squared, *_ = held[f, 0]
    p = weight / n
    return p, math.sqrt(max(squared / n - p * p, 0) / n), weight**2 / squared


def brute(plan, n, f=0):
    """The share of n plain tracks that are confirmed, and its standard error."""
    found = simulated(plan, n)["begun"][f, :, track_sums.FALSE_NEWLY_CONFIRMED].sum()
    return found / n, math.sqrt(max(found, 1)) / n


def words_of(key, realisation):
    """What gives the words of a draw at a scan."""

    def words(k, draw):
        x, y = np.empty(1, dtype=np.uint64), np.empty(1, dtype=np.uint64)
        random.fill_words(key, realisation, (k << 12) + draw, x, y)
        return [int(x[0]), int(y[0])]

    return words


def uniforms(key, realisation):
    a, b = np.empty(1), np.empty(1)
    random.fill_uniform_pairs(key, realisation, 0, a, b)
    return a[0], b[0]


def assert_weights_rounded(found, wanted, scans, share=1.0):
    """Weights, and their powers up to the fourth, of tracks over so many scans.

    Each scan multiplies a ratio of probabilities, of which the smallest is `share`; they are as well known as the
    state in σ, whose plots are under 11 km away and less than 1 km apart, of σ 30 m, beside an integral's 10⁻¹³.
    """
    state = (LINE * 1e3 + 11e3) / 30
    assert_rounded(found, wanted, condition=4 * scans / share * (state + 1e-13 / EPSILON), operations=scans * TERMS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("density", "rare"),
    [*(pytest.param(*of, marks=pytest.mark.slow) for of in ((0.05, RARE), (0.5, LONG))), (2.0, RARE), (0.05, LONG)],
)
def test_weights_and_lives_are_the_twins(density, rare):
    """Nearest plot and PDA, three rules: which tracks are held how long, and their weights, realisation by one."""
    filters = [tracker("near"), tracker("pda", "pda", 3, 5), tracker("wide", m=4, n=6, gate=0.9999)]
    case = case_of(filters, density, scans=12, rare=rare)
    plan = STUDY.prepare(case)
    given, shares, seen = tracker_design.tracking_conditions(case.spec), plan.false_track_laws.shares, np.zeros(3)
    for realisation in range(150):
        sums = plan.layout.unpack(STUDY.simulate(plan, realisation, 1))
        u, v = uniforms(plan.false_track_key, realisation)
        (near, far), (left, right) = SECTOR
        first = np.array([math.sqrt(near**2 + (far**2 - near**2) * u), left + (right - left) * v])
        law = int(np.searchsorted(np.cumsum(shares), uniforms(plan.false_track_laws.choice, realisation)[0]))
        words = words_of(plan.false_track_laws.plots, realisation)
        for f, choice in enumerate(tracker_design.tracker_specs(case.spec)):
            gate = tracker_design.gate_threshold(choice.gate_probability)
            field = lambda k, i=realisation: plots.false_plots(plan.false_track_field, i, k).T  # noqa: E731
            weight, held = FalseTrack(choice, given, gate, SECTOR, words, field).follow(first, 12, law, shares)
            assert_weights_rounded(sums["drawn"][f], [float(law == 0), weight, weight**2], 12)
            expected = np.zeros((12, 4))
            expected[: len(held)] = np.array([[w, w**2, 1, w**4] for w in held]).reshape(-1, 4)
            assert_weights_rounded(sums["held"][f], expected, 12)
            seen += len(held) > 0, len(held) > 3, law == 0
    assert seen[0] > 100
    assert seen[1] > 10
    assert seen[2] > 20


@pytest.mark.slow_cases_except("sector1")
@pytest.mark.parametrize(
    "sector",
    [
        {"range_m": [7e3, 11e3], "bearing_deg": [5, 40]},
        {"range_m": [7e3, 7.3e3], "bearing_deg": [175, 181]},  # most gates are cut by an edge
        {"range_m": [7e3, 11e3], "bearing_deg": [-180, 180]},
    ],
)
def test_pairs_of_false_plots_are_confirmed_as_their_exact_law_says(sector):
    """2 of 3 and 2 of 5, down to once in 10⁵: a Poisson number in the part of the gate within the sector."""
    filters = [tracker("2 of 3", m=2, n=3), tracker("2 of 5", "pda", 2, 5, 0.999)]
    for density in (1e-4, 1e-2, 0.3):
        plan = plan_of(filters, density, scans=6, sector=sector)
        held = simulated(plan, 20_000)["held"]
        for f, exactly in enumerate(plan.axes.exact_begun.sum(axis=1)):
            p, error, _ = share_of(held, 20_000, f)
            assert abs(p - exactly) < 4 * error, (density, p, exactly, error)
            assert error < 0.02 * exactly


def test_the_mean_weight_is_one_and_none_is_over_one_by_the_plain_share():
    plan = plan_of([tracker("a"), FOUR_OF_SIX], 0.1)
    plain, weight, squared = np.moveaxis(simulated(plan, 20_000)["drawn"], 1, 0)
    error = np.sqrt((squared / 20_000 - (weight / 20_000) ** 2) / 20_000)
    assert (np.abs(weight / 20_000 - 1) < 4 * error).all()
    assert (np.abs(plain / 20_000 - 0.1) < share_error(0.1, 20_000)).all()
    for i in range(50):
        assert STUDY.simulate(plan, i, 1).max() >= 0
        assert plan.layout.unpack(STUDY.simulate(plan, i, 1))["drawn"][:, 1].max() <= 10.0


@pytest.mark.slow
@pytest.mark.parametrize("density", [0.3, pytest.param(1.5, marks=pytest.mark.slow)])
def test_false_tracks_are_those_of_plain_sampling(density):
    """3 of 4 and 4 of 6, of nearest plot and PDA, confirmed and held on, against plain tracks of other noise."""
    filters = [tracker("a"), tracker("b", "pda", 4, 6)]
    weighted, plain = plan_of(filters, density), reseeded(plan_of(filters, density, sought=False), 5)
    held, begun = simulated(weighted, 20_000)["held"], simulated(plain, 100_000)["begun"]
    for f in range(2):
        p, error, _ = share_of(held, 20_000, f)
        other, its = brute(plain, 100_000, f)
        assert abs(p - other) < 4 * math.hypot(error, its)
        life = held[f, :, 0].sum() / held[f, 0, 0]
        its_life = begun[f, :, track_sums.FALSE_CONFIRMED].sum() / begun[f, :, track_sums.FALSE_NEWLY_CONFIRMED].sum()
        assert life == pytest.approx(its_life, rel=4 * math.hypot(error / p, its / other))  # lives spread as their mean


@pytest.mark.slow
@pytest.mark.parametrize(("rule", "density"), [((3, 4), 0.3), ((4, 6), 0.3), ((4, 6), 0.15)])
def test_false_tracks_are_those_of_plain_sampling_on_twenty_seeds(rule, density):
    """From 0.1 to 5·10⁻³: every difference within its 99.99 % bounds, their mean within three standard errors."""
    weighted, plain = (plan_of([tracker("a", m=rule[0], n=rule[1])], density, sought=one) for one in (True, False))
    z = []
    for seed in range(20):
        p, error, _ = share(reseeded(weighted, seed), 20_000)
        other, its = brute(reseeded(plain, 100 + seed), 100_000)
        z.append((p - other) / math.hypot(error, its))
    assert np.abs(z).max() < 3.9
    assert abs(np.mean(z)) < 3 / math.sqrt(20)
    assert 0.3 < np.mean(np.square(z)) < 2.2


def test_the_tail_of_their_life_is_that_of_tracks_that_are_not_held_on():
    """How long they are held, sought and not, at 0.3 per km²; sought down to where the other has no track at all."""
    filters = [tracker("a"), tracker("b", "pda")]
    sought, plain = plan_of(filters, 0.3, scans=25, rare=LONG), plan_of(filters, 0.3, scans=25)
    n, compared = 20_000, 0
    tails = [simulated(reseeded(plan, 3 + i), n)["held"] for i, plan in enumerate((sought, plain))]
    for f in range(2):
        (p, error, effective), (other, its, least) = (
            (tail[f, :, 0] / n, np.sqrt(tail[f, :, 1]) / n, tail[f, :, 0] ** 2 / np.maximum(tail[f, :, 1], 1e-300))
            for tail in tails
        )
        known = least > 30
        compared += known[3:].sum()
        assert (np.abs(p - other)[known] < 4 * np.hypot(error, its)[known]).all()
        assert (effective[:13] > 100).all()
    assert compared >= 8
    assert (tails[1][0, 12:, 2] == 0).any()


def shipped():
    """4 of 6 at 0.03 false plots per km², as it is shipped."""
    return load("sonar_clutter_rare", ["sweep.sensor.false_plots_per_km2=[0.03]", "scans=10"]).cases[0]


def test_four_of_six_at_the_shipped_size_is_known_to_a_twentieth():
    """False tracks so rare that 20 000 plain realisations have about two."""
    plan = STUDY.prepare(shipped())
    p, error, effective = share(plan, 20_000, 2)
    assert p == pytest.approx(1.13e-4, abs=4 * error)
    assert error < 0.05 * p
    assert effective > 400


@pytest.mark.slow
def test_twenty_runs_scatter_as_their_intervals_say():
    plan = STUDY.prepare(shipped())
    found = np.array([share(reseeded(plan, seed), 20_000, 2) for seed in range(20)])
    assert found[:, 0].std() < 0.05 * found[:, 0].mean()
    z = (found[:, 0] - found[:, 0].mean()) / found[:, 1]
    assert 0.3 < np.mean(z**2) < 2.2


def test_gates_full_of_false_plots_are_left_as_they_are():
    """Where a box has more than sixteen of them in the mean, all weights are one and tracks those of plain sampling."""
    filters = [tracker("open", gate=1.0), tracker("open, PDA", "pda", gate=1.0)]
    weighted, plain = plan_of(filters, 2.0), plan_of(filters, 2.0, sought=False)
    drawn, begun = simulated(weighted, 700), simulated(plain, 700)["begun"]
    assert (drawn["drawn"][:, 1:] == 700).all()
    assert (drawn["held"][:, 0, 2] == begun[:, :, track_sums.FALSE_NEWLY_CONFIRMED].sum(axis=1)).all()
    assert (drawn["held"][:, :, 2].sum(axis=1) == begun[:, :, track_sums.FALSE_CONFIRMED].sum(axis=1)).all()


def test_the_target_is_left_alone():
    weighted, plain = plan_of([tracker("a")], 0.3), plan_of([tracker("a")], 0.3, sought=False)
    whole = weighted.layout.unpack(STUDY.simulate(weighted, 0, 700))
    alone = plain.layout.unpack(STUDY.simulate(plain, 0, 700))
    for name in ("error", "counts", "ratios"):
        assert (whole[name] == alone[name]).all()
    assert (whole["scores"][0] == alone["scores"][0]).all()
    assert whole["scores"][1, 0, -1] == whole["drawn"][0, 0]  # of false tracks, those of the plain ones


def result_of(n, filters, density=0.03, **more):
    return radarsim.run(config(filters, density, 0.9) | {"rare": RARE} | more, realisations=n)


def test_tables_tell_the_rate_and_how_well_it_is_known():
    result = result_of(5000, [FOUR_OF_SIX, tracker("b", "pda"), tracker("told", "known")])
    table, tracking, sums = result.tables["rare"], result.tables["tracking"], result.cases[0].sums
    assert list(table["filter"].unique()) == ["four of six", "b"]
    first = table[table["sought"]]
    assert list(first["event"]) == ["false track"] * 2
    for f in range(2):
        row, of = first.iloc[f], tracking.iloc[f]
        weight, squared, number, _ = sums["held"][f, 0]
        assert row["event_rate"] == of["false_confirmed_share"] == weight / 5000
        assert row["events"] == number
        assert_rounded(row["n_eff"], weight**2 / squared, operations=3)
        assert row["variance_factor"] > 100
        an_hour = 0.03e-6 * result.cases[0].axes.area_m2 * 720
        assert_rounded(of["false_tracks_per_hour"], an_hour * row["event_rate"], operations=6)
        assert_rounded(of["false_tracks_per_hour_lo"], an_hour * row["event_rate_lo"], operations=6)
        own = table[table["filter"] == row["filter"]]
        assert (np.diff(own["event_rate"]) <= 0).all()  # the tail of the life: held for one scan more
        assert_rounded(of["false_life_s"], 5.0 * own["event_rate"].sum() / row["event_rate"], operations=3 * len(own))
    assert "importance sampling" in " ".join(result.answer)
    assert not any("rare event" in line for line in result.warnings)
    assert "note" not in result.tables["tracks"] or not result.tables["tracks"]["note"].str.contains("events").any()


@pytest.mark.slow
def test_solve_takes_the_weighted_rate():
    """The gate at which 4 of 6 has half as many, from 1500 false plots, of which plainly hardly one is confirmed."""
    keys = config([FOUR_OF_SIX], 0.03, 0.9, 8) | {"rare": RARE, "realisations": 1500}
    at = radarsim.run(keys).tables["tracking"]["false_tracks_per_hour"][0]
    found = solve(keys, "gate_probability", false_tracks="four of six", equals=0.5 * at, between=(0.9, 0.999))
    assert found.lo < found.value < found.hi < 0.99
    assert found.hi - found.lo < 0.02
    again = radarsim.run(keys, overrides=[f"gate_probability={found.value}"]).tables["tracking"].iloc[0]
    assert abs(again["false_tracks_per_hour"] - 0.5 * at) < RESIDUE * (
        again["false_tracks_per_hour_hi"] - again["false_tracks_per_hour_lo"]
    )


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"rare": {"events": []}}, "rare.events"),
        ({"rare": {"events": ["false tracks"]}}, "rare.events.0"),
        ({"rare": {"events": ["false_tracks"] * 2}}, "rare.events: must differ: false_tracks is there twice"),
        ({"rare": RARE | {"shift": 3}}, "rare.shift: unknown key"),
        ({"rare": RARE, "filters": [tracker("a", "known")]}, "rare: needs a filter that has to find its plots"),
        ({"rare": RARE, "sensor.false_plots_per_km2": 0.0}, "rare: needs false plots"),
        ({"rare": {}}, "rare.events: "),
        ({"rare": 3}, "rare: "),
    ],
)
def test_wrong_values_are_told_by_their_key(keys, words):
    whole = config([tracker("a")], 0.1)
    whole["sensor"]["false_plots_per_km2"] = keys.pop("sensor.false_plots_per_km2", 0.1)
    with pytest.raises(ConfigError) as error:
        load(whole | keys)
    assert any(words in line for line in error.value.lines), error.value.lines


def test_filters_that_know_their_plots_have_nothing_that_is_rare():
    smoothing = {"name": "plain", "kind": "kalman"}
    keys = config([smoothing])
    keys["sensor"].pop("sector")
    with pytest.raises(ConfigError, match="rare: needs a filter that has to find its plots"):
        load(keys | {"rare": RARE})
