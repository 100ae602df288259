"""Rare ends of the target's track: against a chain's exact law, a textbook twin, and plain sampling."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.kernels import random
from radarsim.report import rare_events
from radarsim.studies.sonar import STUDY
from radarsim.studies.sonar.clutter import plots, tables, tracker_design
from radarsim.studies.sonar.clutter.kernels import track_sums
from radarsim.studies.sonar.clutter.kernels.outside_gate import probability_outside_gate
from radarsim.studies.sonar.kernels.chunks import CHUNK
from radarsim.studies.sonar.kernels.world import move_and_measure
from tests.studies.sonar.clutter import naive_ends
from tests.studies.sonar.clutter.test_rare import assert_weights_rounded, words_of
from tests.studies.sonar.clutter.test_study import config, simulated, tracker
from tests.tolerances import assert_rounded, share_error

RARE = {"events": ["ended_tracks"]}
SECTOR = ((7e3, 11e3), (math.radians(5), math.radians(40)))
N = 20_000


def keys_of(filters, density, detection, scans, sought=True, **more):
    """The keys of a case whose ends of the target's track are sought, or are not."""
    keys = config(filters, density, detection, scans) | more
    return keys | ({"rare": RARE} if sought else {})


def plan_of(*of, **more):
    return STUDY.prepare(load(keys_of(*of, **more)).cases[0])


def reseeded(plan, seed):
    """The plan with other noise."""
    keys = [random.stream(seed, str(i)) for i in range(5)]
    axes = plan.axes
    axes = replace(
        axes,
        world=axes.world._replace(plots=keys[0]),
        detections=axes.detections._replace(key=keys[1]),
        field=axes.field._replace(key=keys[2]),
    )
    ends = None if plan.end_laws is None else plan.end_laws._replace(choice=keys[3], plots=keys[4])
    return replace(plan, axes=axes, end_laws=ends)


def shares(plan, n=N):
    """The weighted shares (F, K) that have ended by each scan, their standard errors, and effective events."""
    weight, squared = np.moveaxis(simulated(plan, n)["ended"].sum(axis=2).cumsum(axis=1)[..., :2], -1, 0)
    p = weight / n
    return p, np.sqrt(np.maximum(squared / n - p * p, 0) / n), weight**2 / np.maximum(squared, 1e-300)


def one_law(plan):
    """The plan with every realisation drawn as it is: how plain sampling knows the first ends."""
    own = np.zeros_like(plan.end_laws.shares)
    own[:, 0] = 1.0
    return replace(plan, end_laws=plan.end_laws._replace(shares=own))


# ---- exact ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("gate", [4.0, 9.21, 30.0])
def test_the_probability_outside_a_gate_is_that_of_a_sum(gate):
    """Off the centre by nothing, by the gate and beyond it; gates narrow and wide, correlated or not."""
    sigma, generator = np.array([30.0, 0.0175]), np.random.default_rng(3)
    for size in (1.0, 1.2, 2.0, 8.0, 60.0):
        for correlation in (0.0, 0.7):
            S = size * np.array([[1, correlation * (size > 1)], [correlation * (size > 1), 1]])
            S *= np.outer(sigma, sigma)
            for reach in (0.0, 0.5, 1.0, 1.5):
                off = reach * math.sqrt(gate * size) * sigma * generator.uniform(-1, 1, 2)
                c = probability_outside_gate(tuple(off), (S[0, 0], S[0, 1], S[1, 1]), gate, tuple(sigma))
                # What the kernel states of gates up to 60 σ² wide, and each part of the quadrature; 48 nodes have
                # an error of 2·10⁻¹⁰ at most where a gate is up to 2000 σ² wide.
                wanted, precision = naive_ends.missing(off, S, gate, sigma), 3e-13 if gate * size <= 60 else 1e-9
                assert c == pytest.approx(wanted, abs=precision)
    assert probability_outside_gate((1.0, 0.0), (900.0, 0.0, 3e-4), 1e30, tuple(sigma)) == 0.0


RULES = [(0.9, 3, 4, 4), (0.95, 3, 4, 4), (0.98, 4, 6, 4), (0.98, 3, 4, 5), (0.99, 2, 3, 5), (0.98, 3, 5, 6)]


@pytest.mark.parametrize(("detection", "m", "n", "misses"), RULES)
def test_runs_of_misses_end_tracks_as_their_exact_law_says(detection, m, n, misses):
    """Open gates, no false plots, a target never far: from 10⁻³ down to 10⁻⁹, at every scan of the curve."""
    plan = plan_of(
        [tracker("a", m=m, n=n, gate=1.0, drop_after_misses=misses, lost_beyond_sigmas=1e9)], 0, detection, 25
    )
    exactly = naive_ends.ended_by(detection, m, n, misses, 25)
    p, error, effective = (of[0] for of in shares(plan))
    possible = exactly > 0
    assert not p[~possible].any()
    assert (np.abs(p - exactly) <= 4 * error)[possible].all(), (p, exactly, error)
    assert error[-1] < 0.025 * exactly[-1]
    assert effective[-1] > 2000
    assert 1e-9 < exactly[-1] < 5e-3


def test_the_mean_weight_is_one_and_none_is_over_one_by_the_plain_share():
    plan = plan_of([tracker("a"), tracker("b", "pda", 4, 6)], 0.1, 0.9, 15)
    plain, weight, squared = np.moveaxis(simulated(plan, N)["ended_drawn"], 1, 0)
    error = np.sqrt((squared / N - (weight / N) ** 2) / N)
    assert (np.abs(weight / N - 1) < 4 * error).all()
    assert (np.abs(plain / N - 0.1) < share_error(0.1, N)).all()
    for i in range(50):
        assert plan.layout.unpack(STUDY.simulate(plan, i, 1))["ended_drawn"][:, 1].max() <= 10.0


# ---- a twin ---------------------------------------------------------------------------------------------------------
def errors_of(plan, realisation, scans):
    """The errors (K, 2) of the target's plots, over their σ."""
    out, own = np.zeros((2, 4, CHUNK)), np.empty((scans, 2))
    for k in range(scans):
        move_and_measure(plan.axes.world, realisation, k, out)
        own[k] = out[:, 1, 0] / plan.axes.world.fresh[k, :2]
    return own


def uniform_of(key, realisation, pair):
    a, b = np.empty(1), np.empty(1)
    random.fill_uniform_pairs(key, realisation, pair, a, b)
    return a[0]


@pytest.mark.slow_cases("0.05-0.8")
@pytest.mark.parametrize(
    ("density", "detection"), [pytest.param(0.0, 0.9, marks=pytest.mark.slow), (0.05, 0.8), (2.0, 0.9)]
)
def test_weights_and_ends_are_the_twins(density, detection):
    """Nearest plot and PDA, four rules: when and how a track ends, and its weight, realisation by one."""
    filters = [
        tracker("near", drop_after_misses=2),
        tracker("pda", "pda", 3, 5, 0.999),
        tracker("open", m=2, n=3, gate=1.0, lost_beyond_sigmas=3.0),
        tracker("early", m=4, n=6, gate=0.9),
    ]
    scans = 18
    keys = keys_of(filters, density, detection, scans)
    case = load(keys).cases[0]
    plan = STUDY.prepare(case)
    given, ends, seen = tracker_design.tracking_conditions(case.spec), plan.end_laws, np.zeros(4)
    truth = plan.axes.world.truth[:, :2, 0]
    for realisation in range(40):
        sums = plan.layout.unpack(STUDY.simulate(plan, realisation, 1))
        errors = errors_of(plan, realisation, scans)
        u = np.array([uniform_of(plan.axes.detections.key, realisation, k) for k in range(scans)])
        field = lambda k, i=realisation: plots.false_plots(plan.axes.field, i, k).T  # noqa: E731
        for f, choice in enumerate(tracker_design.tracker_specs(case.spec)):
            gate = tracker_design.gate_threshold(choice.gate_probability)
            laws = naive_ends.Laws(choice, given, gate, scans, choice.misses)
            mixed = ends.shares[f][ends.shares[f] > 0]
            law = int(np.searchsorted(np.cumsum(mixed), uniform_of(ends.choice, realisation, 0)))
            twin = naive_ends.TargetTrack(choice, given, gate, SECTOR, words_of(ends.plots, realisation), field)
            k, lost, came, weight = twin.end(laws, law, mixed, truth, errors, u, scans)
            assert_weights_rounded(sums["ended_drawn"][f], [float(law == 0), weight, weight**2], scans, 1 - detection)
            expected = np.zeros((scans, 4, 4))
            if k is not None:
                expected[k, int(lost) + 2 * came] = weight, weight**2, 1, weight**4
            assert_weights_rounded(sums["ended"][f], expected, scans, 1 - detection)
            seen += k is not None, lost, law == 0, k is not None and k > 12
    # Every tenth realisation is drawn as it is, and then for all four filters: at least one of the forty.
    assert (seen >= [21, 2, len(filters), 2]).all(), seen


# ---- plain sampling -------------------------------------------------------------------------------------------------
HARD = [
    (0.9, 0.0, 0.9999, 4),
    (0.98, 0.0, 0.999, 4),
    (0.98, 0.003, 0.9999, 3),
    (0.9, 0.03, 0.999, 3),
    (0.98, 0.01, 0.99, 3),
]


def compared(detection, density, gate, misses, scans=20):
    """Nearest plot and PDA: a plan with ends sought, and one of other noise without, drawn as it is."""
    filters = [tracker(kind, kind, gate=gate, drop_after_misses=misses) for kind in ("nearest", "pda")]
    return plan_of(filters, density, detection, scans)


@pytest.mark.slow
@pytest.mark.parametrize("of", [pytest.param((0.7, 0.03, 0.99, 3), marks=pytest.mark.slow), (0.8, 0.0, 0.9, 4)])
def test_ends_are_those_of_plain_sampling(of):
    """At 10⁻¹ and 10⁻², by each scan; and the first ends drawn as they are, without weights."""
    plan = compared(*of)
    (p, error, _), (other, its, _) = shares(plan), shares(reseeded(one_law(plan), 5), 30_000)
    seen = its > 0
    assert (np.abs(p - other)[seen] < 4.5 * np.hypot(error, its)[seen]).all()
    assert (p[:, -1] > 0.005).all()


def test_realisations_drawn_as_they_are_have_the_tracks_of_plain_sampling():
    """Without false plots those of the other tables, as long as no track has ended before."""
    plan = one_law(compared(0.8, 0.0, 0.99, 2, 12))
    for i in range(40):
        sums = plan.layout.unpack(STUDY.simulate(plan, i, 1))
        for f in range(2):
            ends = sums["counts"][f][:, [track_sums.DROPPED_COUNT, track_sums.LOST_COUNT]]
            first = ends * (np.cumsum(ends.sum(axis=1)) == 1)[:, None] * (ends.sum(axis=1) > 0)[:, None]
            assert (sums["ended"][f, :, :2, 2] == first).all()
            assert (sums["ended"][f, :, :2, 0] == first).all()


@pytest.mark.slow
@pytest.mark.parametrize("of", HARD)
def test_ends_are_those_of_plain_sampling_on_twenty_seeds(of):
    """From 10⁻² to 2·10⁻⁴: every difference within its 99.99 % bounds, their mean within three standard errors."""
    plan, n = compared(*of), 200_000
    sought = np.array([[part[:, -1] for part in shares(reseeded(plan, seed))[:2]] for seed in range(20)])
    plain = np.array([shares(reseeded(one_law(plan), 100 + seed), n)[0][:, -1] for seed in range(20)])
    z = (sought[:, 0] - plain) / np.hypot(sought[:, 1], np.sqrt(plain.mean(axis=0) / n))
    assert np.abs(z).max() < 3.9
    assert (np.abs(np.mean(z, axis=0)) < 3 / math.sqrt(20)).all()


# ---- tables, words, keys --------------------------------------------------------------------------------------------
def test_the_target_and_false_tracks_are_left_alone():
    """All other sums have the bits that they have without the event, with false tracks sought and not."""
    for others in ([], ["false_tracks"]):
        alone = keys_of([tracker("a")], 0.3, 0.9, 10, sought=False)
        both = alone | {"rare": {"events": [*others, "ended_tracks"]}}
        alone |= {"rare": {"events": others}} if others else {}
        alone, both = (STUDY.prepare(load(keys).cases[0]) for keys in (alone, both))
        sums, more = (plan.layout.unpack(STUDY.simulate(plan, 0, 700)) for plan in (alone, both))
        assert set(more) - set(sums) == {"ended", "ended_drawn"}
        assert all((sums[name] == more[name]).all() for name in sums)


def test_tables_tell_the_curve_and_how_tracks_end():
    filters = [tracker("a", gate=0.999, drop_after_misses=4), tracker("told", "known"), tracker("b", "pda", gate=1.0)]
    result = radarsim.run(keys_of(filters, 0.0, 0.95, 20), realisations=5000)
    table, sums = result.tables["rare"], result.cases[0].sums
    assert list(table["filter"].unique()) == ["a", "b"]
    for f, name in ((0, "a"), (2, "b")):
        own = table[table["filter"] == name]
        curve = own[own["event"] == "target's track ended"]
        assert (np.diff(curve["event_rate"]) >= 0).all()
        assert list(curve["sought"]) == [False] * (len(curve) - 1) + [True]
        assert curve.iloc[-1][["k", "t_s"]].tolist() == [20, 95.0]
        weight, squared, number, _ = sums["ended"][f].sum(axis=(0, 1))
        assert_rounded(
            curve.iloc[-1]["event_rate"], weight / 5000, operations=20 * 4
        )  # sums over scans and ways to end
        assert curve.iloc[-1]["events"] == number
        assert_rounded(curve.iloc[-1]["n_eff"], weight**2 / squared, operations=3 * 20 * 4)
        how = own[own["event"] != "target's track ended"].set_index("event")["event_rate"]
        assert list(how.index) == ["target's track dropped", "target's track lost"]
        assert_rounded(how.sum(), curve.iloc[-1]["event_rate"], operations=20 * 4)
    lost = "confirmed track is lost by the last scan (importance sampling): "
    assert [sentence.split(lost)[1][0] for sentence in result.answer if lost in sentence] == ["a", "b"]
    assert [sentence[:11] for sentence in result.answer if "confirms" in sentence] == ["a confirms ", "b confirms "]
    assert not result.tables["rare"]["event"].str.contains("false").any()


def test_few_events_in_one_way_of_ending_are_told():
    """Of 1000 effective events none is what the note of the row is about: a part of them."""
    drawn = rare_events.SamplingWeights(4_000_000, 400_000, 4e6, 4e7)
    ways = np.zeros((1, 4, 4))  # Σw, Σw², number, Σw⁴ of each way of ending
    ways[0, 0] = 1e3, 1e3, 1000, 1e3
    sure, unsure = ways.copy(), ways.copy()
    sure[0, 2] = ways[0, 0]
    unsure[0, 2] = 30.0, 90.0, 10, 810.0
    assert tables.ends_note(drawn, sure, True)[0] == ""
    assert tables.ends_note(drawn, unsure, True)[0] == rare_events.IN_PART
    assert tables.ends_note(drawn, unsure, False)[0] == ""
    kinds = tables.KINDS_BY_EVENT["target's track dropped"]
    assert tables.ends_note(drawn, ways, False, kinds)[0] == ""
    row = {"case": "c", "filter": "f", "k": 9, "t_s": 1.0, "event": "e", "sought": True, "n": 4000, "rate": 1e-3}
    row |= {"n_eff": 1e3, "mean_weight": 1.0, "mean_weight_se": 0.1, "note": rare_events.IN_PART}
    assert rare_events.mean_weight_warnings(pd.DataFrame([row])) == []
    # Of few realisations the error of the mean weight is not known.
    few = {"n": 100, "mean_weight": 0.3, "mean_weight_se": 0.01, "note": ""}
    assert rare_events.mean_weight_warnings(pd.DataFrame([row | few])) == []
    assert "the mean weight is 0.3" in rare_events.mean_weight_warnings(pd.DataFrame([row | few | {"n": 200}]))[0]


@pytest.mark.parametrize(
    ("detection", "events", "words"),
    [
        (1.0, ["ended_tracks"], "rare.events: ended_tracks needs plots that are missed: sensor.detection_probability"),
        (0.9, ["ended_tracks"] * 2, "rare.events: must differ: ended_tracks is there twice"),
        (0.9, ["ended_tracks", "false_tracks"], "rare: needs false plots"),
    ],
)
def test_wrong_values_are_told_by_their_key(detection, events, words):
    with pytest.raises(ConfigError) as error:
        load(config([tracker("a")], 0.0, detection) | {"rare": {"events": events}})
    assert any(words in line for line in error.value.lines), error.value.lines


# ---- coverage -------------------------------------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize("of", [(0.9, 0.0, 0.9999, 4), (0.98, 0.001, 0.9999, 3), (0.98, 0.0, 0.999, 4)])
def test_intervals_of_unmarked_rows_cover(of):
    """Of 200 seeds of 4000 realisations, about the mean of them all: 91 % to 99 % where half are unmarked at least."""
    plan, unmarked, covered = compared(*of), [], []
    sums = [simulated(reseeded(plan, seed), 4000) for seed in range(200)]
    ended = np.array([one["ended"].sum(axis=1) for one in sums])
    for f in range(2):
        rate = ended[:, f, :, 0].sum(axis=1).mean() / 4000
        for one, of_seed in zip(sums, ended, strict=True):
            drawn, counted = (
                rare_events.SamplingWeights(4000, *one["ended_drawn"][f]),
                rare_events.EventWeights(*of_seed[f].sum(axis=0)[:, None]),
            )
            estimate = rare_events.event_rate(counted, drawn)
            unmarked.append(tables.ends_note(drawn, of_seed[f][None], of[1] > 0)[0] == "")
            covered.append(float(estimate.lo[0]) <= rate <= float(estimate.hi[0]))
    unmarked, covered = np.array(unmarked), np.array(covered)
    if unmarked.mean() > 0.5:
        assert 0.91 < covered[unmarked].mean() < 0.99
