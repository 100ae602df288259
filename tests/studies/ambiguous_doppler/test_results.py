"""Tables, figures, sentences and recorded plots of a small run."""

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.app.configs import load
from radarsim.errors import ConfigError, PlotFault
from radarsim.recorded import fit, plots
from radarsim.report import notes, statistics
from radarsim.studies import registry
from radarsim.studies.ambiguous_doppler import figures, study, track
from radarsim.studies.ambiguous_doppler.kernels import records, rows
from radarsim.studies.ambiguous_doppler.tables import FEW_FOLDS
from tests.recorded import whole
from tests.studies.ambiguous_doppler.conftest import tolerances
from tests.tolerances import assert_rounded, mean_error


@pytest.fixture(scope="module")
def found():
    return radarsim.run("ambiguous_rls4", realisations=3000)


def test_folds(found):
    folds = found.tables["folds"]
    assert set(folds["filter"]) == {"nearest fold", "no memory", "best hypothesis", "memory"}
    assert (folds["right_lo"] <= folds["right"]).all()
    assert (folds["right"] <= folds["listed"]).all()
    memory = folds[folds["filter"] == "memory"].set_index("k")
    assert memory.loc[8, "right"] > 0.98
    assert memory.loc[1, "hypotheses"] == pytest.approx(210, abs=1)  # as many as spans fit into the prior
    nearest = folds[folds["filter"] == "nearest fold"]
    assert (nearest["hypotheses"] == 1).all()
    assert (nearest["right"].diff().dropna() <= 0).all()  # once lost, always lost


def test_calibration_is_of_filters_that_remember(found):
    table = found.tables["calibration"]
    assert set(table["filter"]) == {"best hypothesis", "memory"}
    assert table.groupby(["filter", "k"])["n"].sum().eq(3000).all()
    assert ((table["expected"] >= table["bin_lo"]) & (table["expected"] <= table["bin_hi"])).all()


def test_gains_beside_the_oracle(found):
    gains = found.tables["gains"]
    own = gains[(gains["filter"] == "oracle")]
    assert own["above_oracle_percent"].isna().all()
    curves = found.curves.set_index(["filter", "component", "k"])["sigma"]
    row = gains[(gains["filter"] == "memory") & (gains["component"] == "Vr") & (gains["k"] == 5)].iloc[0]
    ratio = curves["memory", "Vr", 5] / curves["oracle", "Vr", 5]
    assert_rounded(row["above_oracle_percent"], 100 * (ratio - 1), size=100 * ratio, operations=5)
    assert row["above_oracle_lo"] < row["above_oracle_percent"] < row["above_oracle_hi"]


def test_sentences_tell_from_which_scan_on_it_is_as_good(found):
    experiment = load("ambiguous_rls4")
    one = registry.study("ambiguous_doppler")
    assert one.question(experiment) == "How much is the folded velocity of RLS 4 worth, and from which scan on?"
    (sentence,) = one.answer(found.cases, found.tables)
    assert sentence.startswith("RLS 4, D = 15 m/s, memory: ")
    assert "all folds are right in" in sentence


def test_orders_and_their_sentence():
    made = radarsim.run("orders", realisations=1000)
    table = made.tables["orders"]
    total = table.groupby(["case", "filter", "k"])["weight"].sum().to_numpy()
    assert_rounded(total, np.ones(len(total)), operations=1000)  # means of so many
    assert set(table["filter"]) == {"likelihood", "expected error", "intersection"}
    assert len(made.tables["folds"]) == 0
    sentences = registry.study("ambiguous_doppler").answer(made.cases, made.tables)
    first, *sentences = sentences
    assert len(sentences) == 3
    assert all("the best combination" in sentence for sentence in sentences)
    curves = made.curves.query("component == 'r' and k > 1")
    largest = curves.assign(exact=curves["exact_sigma"].fillna(curves["sigma"])).groupby("filter")["exact"].max()
    singles = largest[["order 0", "order 1", "order 2", "order 2 range only"]]
    assert first.startswith(f"{largest.idxmin()} keeps σ of the range after the first plot within ")
    assert f"the best single order, {singles.idxmin()}, comes to " in first
    assert "in all 3 cases" in first
    assert {"orders", "sigma_r"} <= set(made.figures)


def test_of_several_radars_the_answer_counts_those_in_which_folded_velocity_is_as_good():
    made = radarsim.run("ambiguous", realisations=400)
    first = made.answer[0]
    gains = made.gains.query("component == 'Vr' and filter == 'memory'").groupby("case").tail(1)
    good = int((gains["above_oracle_hi"] <= 5).sum())
    assert first.startswith(
        f"memory: as good as unfolded velocity, within 5 %, in {good} of 4 cases by the last scan; "
    )
    worst = gains.loc[gains["above_oracle_percent"].idxmax(), "case"]
    assert first.split("; ")[1].startswith(worst.replace("ambiguous_rls", "RLS "))


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        (
            (4.9, 3.7, 6.1),
            "σ of the velocity is 4.9 % [3.7, 6.1] above that of unfolded velocity at scan 15, the last: too",
        ),
        (
            (5.1, 4.1, 6.2),
            "σ of the velocity is still 5.1 % [4.1, 6.2] above that of unfolded velocity at scan 15, the last;",
        ),
    ],
)
def test_an_interval_about_five_per_cent_is_not_told_as_above_it(found, ends, words):
    gains = found.tables["gains"].copy()
    last = (gains["component"] == "Vr") & (gains["filter"] == "memory") & (gains["k"] == 15)
    gains.loc[last, ["above_oracle_percent", "above_oracle_lo", "above_oracle_hi"]] = ends
    (told,) = registry.study("ambiguous_doppler").answer(found.cases, {**found.tables, "gains": gains})
    assert words in told


@pytest.mark.parametrize("combine", [False, True])
def test_without_any_plot_nothing_is_said(combine):
    orders = "orders: [1, 2], combine: likelihood, manoeuvre_variance: [100, 1e-3]"
    more = [f"filters=[{{name: one, doppler: folded, {orders}}}]"] if combine else []
    made = radarsim.run("ambiguous_rls4", realisations=8, overrides=["radar.detection_probability=1e-9", *more])
    assert (made.tables["curves"]["n"] == 0).all()
    assert len(made.tables["folds"]) == 0
    assert registry.study("ambiguous_doppler").answer(made.cases, made.tables) == []


def test_fan_holds_what_the_filter_estimates():
    """The weighted mean of the listed hypotheses is the filter's estimate, scan by scan."""
    case = load("ambiguous_rls4").cases[0]
    plan = study.prepare(case)
    _, out = study.sums.simulated(plan.world, plan.banks, 0)
    shown, (tolerance, _) = figures.fan(case, 5, 6), tolerances(case, np.ones(15))
    for k, (v, a, p) in enumerate(shown.lists):
        mean = out[plan.banks.bank[5], k, :3, 7]
        assert p @ v == pytest.approx(mean[1], rel=0, abs=tolerance[1])
        assert p @ a == pytest.approx(mean[2], rel=0, abs=tolerance[2])
        assert (np.diff(p) <= 0).all()


@pytest.mark.parametrize("keys", [(), ("radar.detection_probability=0.7",), ("radar.repetition_rate_hz=[1000, 1200]",)])
def test_track_over_simulated_plots_is_the_study(keys):
    """Recorded at the config's own times, the trackers' estimates are those of the kernels."""
    case = load("ambiguous_rls4", [*keys, "filters.2.hypotheses=2"]).cases[0]
    plan = study.prepare(case)
    plots, out = study.sums.simulated(plan.world, plan.banks, 8)
    columns = track.Recorded().simulated(case, 11)
    seen = ~np.isnan(columns["range_m"])
    assert np.array_equal(columns["range_m"][seen], plots[seen, 0, 3])
    assert (np.abs(columns["velocity_mps"][seen]) <= plan.world.spans[seen] / 2).all()
    given = columns | {"velocity_mps": columns["velocity_mps"].copy()}
    made = track.Tracker(case).feed(given)
    started = np.cumsum(seen) > 0
    names = [one.name for one in case.spec.filters]
    assert set(names) - set(made.filters) == {"oracle"}  # recorded velocities are folded
    for f, name in enumerate(made.filters):
        bank, place = (of[names.index(name)] for of in (plan.banks.bank, plan.banks.place))
        apart = np.abs(made.estimate[f] - out[bank, :, place : place + 3, 3])[started]
        assert (apart <= tolerances(case, seen)[0]).all()
        assert np.isnan(made.estimate[f][~started]).all()


COMBINED = {
    "likelihood": "combine: likelihood",
    "expected error": "combine: expected_error, manoeuvres: {acceleration_mps2: 20, duration_s: 30}",
    "intersection": "combine: intersection",
}


@pytest.mark.parametrize(
    ("doppler", "more"),
    [
        ("none", ""),
        ("unfolded", ""),
        ("folded", ", hypotheses: 40"),
        ("folded", ", estimate: best"),
        ("folded", ", merge: each_scan"),
    ],
)
def test_track_follows_combined_orders_as_the_study_does(doppler, more):
    orders = f"orders: [0, 1, 2], manoeuvre_variance: [9e4, 4, 1e-3], doppler: {doppler}{more}"
    filters = ", ".join(f"{{name: {name}, {orders}, {how}}}" for name, how in COMBINED.items())
    keys = [f"filters=[{filters}]", "scans=12", "target={kind: acceleration_pulse, coefficients: [100e3, -250], "]
    keys[-1] += "acceleration_g: 2, start_s: 60, duration_s: 30}"
    case = load("ambiguous_rls2", [*keys, "baseline=likelihood"]).cases[0]
    plan = study.prepare(case)
    plots, out = study.sums.simulated(plan.world, plan.banks, 8)
    velocity = plots[:, records.UNFOLDED if doppler == "unfolded" else records.VELOCITY, 3]
    found = track.Tracker(case).feed({"t_s": plan.world.t, "range_m": plots[:, 0, 3], "velocity_mps": velocity})
    for f, name in enumerate(found.filters):
        place = plan.banks.place[f]
        own = out[plan.banks.bank[f], :, place : place + 3, 3]
        assert (np.abs(found.estimate[f] - own) <= tolerances(case, np.ones(12))[0]).all(), name
    # The sigma that is given beside is that of an expected error where it is exact.
    sigma = found.sigma[1]
    E = plan.axes.oracle_sigma[1] if doppler == "folded" else plan.axes.exact_sigma[1]
    assert sigma.shape == E.shape
    assert (sigma > 0).all()


def test_track_of_combined_orders_over_gaps():
    """Rows that lack a value, or are not there, are no fault; from the first range on there are estimates."""
    case = load("orders").cases[0]
    t = np.array([0.0, 10, 20, 33, 40, 90, 100])
    z = np.array([np.nan, 1e5, 97.5e3, np.nan, 90e3, 77.5e3, 75e3])
    v = np.array([-250.0, np.nan, -245, -251, np.nan, -240, -250])
    tracker = track.Tracker(case)
    found = tracker.feed({"t_s": t, "range_m": z, "velocity_mps": v})
    assert np.isnan(found.estimate[:, 0]).all()
    assert np.isfinite(found.estimate[:, 1:, 0]).all()
    assert np.abs(found.estimate[:, -1, 0] - 75e3).max() < 1500
    more = np.arange(110.0, 1110.0, 10)
    many = tracker.feed({"t_s": more, "range_m": 75e3 - 250 * (more - 100), "velocity_mps": np.full(100, -250.0)})
    assert np.abs(many.estimate[:, -1, 1] + 250).max() < 60
    assert max(len(one.onsets) for one in tracker.filters if hasattr(one, "onsets")) == case.spec.scans


def test_a_remainder_is_followed_as_the_study_does():
    keys = ["radar.repetition_rate_hz=[1000, 1200, 1400]", "radar.detection_probability=0.7"]
    one = "{name: remainder, doppler: remainder, manoeuvre_variance: 1e-3}"
    case = load("ambiguous_rls4", [*keys, f"filters=[{one}]"]).cases[0]
    plan = study.prepare(case)
    _, out = study.sums.simulated(plan.world, plan.banks, 8)
    columns = track.Recorded().simulated(case, 11)
    made = track.Tracker(case).feed(columns)
    there = np.isfinite(made.estimate[0, :, 0])
    assert there.sum() > 8
    apart = np.abs(made.estimate[0] - out[0, :, :3, 3])[there]
    assert (apart <= tolerances(case, np.isfinite(columns["range_m"]))[0]).all()


def test_a_velocity_counts_in_the_remainder_as_it_folds():
    """However many spans too large it is written."""
    folds = track.Folds(load("ambiguous_rls4", ["radar.repetition_rate_hz=[1000, 1200]"]).cases[0].spec.radar)
    folds.begin(0.0, 15.0)
    assert np.isnan(folds.remainder(2.0 + 15 * 2**20))
    folds.begin(10.0, 18.0)
    assert folds.remainder(5.0 + 18 * 2**40) == -13.0  # -13 + 15 = 2 and -13 + 18 = 5, and no other in ± 45
    folds.begin(20.0, 15.0)
    assert folds.remainder(3.7e16) == 40.0  # folded -5; 40 is the nearest of -5 + 15 n to 5 + 18 m, which has 41


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"span_mps": np.full(15, 1e-9)}, "plots.csv:2: velocity_mps: its σ before, 300.002 m/s, leaves more than 1e"),
        ({"t_s": np.append(np.arange(14.0) * 10, 1e15)}, "plots.csv:16: velocity_mps: "),
        ({"span_mps": np.zeros(15)}, "plots.csv:2:4: span_mps: must be > 0, got 0"),
        ({"span_mps": np.full(15, -5.0)}, "plots.csv:2:4: span_mps: must be > 0, got -5"),
    ],
)
def test_plots_with_too_many_folds_are_a_fault_of_their_row(tmp_path, change, words):
    experiment = load("ambiguous_rls4", ["filters=[{name: memory, doppler: folded, manoeuvre_variance: 1e-3}]"])
    t = np.arange(15) * 10.0
    plots.write_columns({"t_s": t, "range_m": 1e5 + 0 * t, "velocity_mps": 0 * t} | change, tmp_path / "plots.csv")
    with warnings.catch_warnings(action="error"), pytest.raises(ConfigError) as error:
        whole.track(experiment, tmp_path / "plots.csv")
    assert words in str(error.value)


@pytest.mark.slow
def test_plots_with_too_many_folds_have_no_likelihood():
    case = load("ambiguous_rls4").cases[0]
    t = np.arange(15) * 1e7  # over which a speed may have become anything
    columns = {"t_s": t, "range_m": 1e5 + 0 * t, "velocity_mps": 0 * t, "span_mps": np.full(15, 2.0)}
    likelihood = track.PlotLikelihood(case, case.spec.filters[5], [columns])
    assert likelihood(likelihood.stated) == -np.inf
    _, sigma, _ = fit.fit_keys(likelihood).keys  # unless the velocities tell nothing
    assert sigma.value >= 2.0


def test_sequences_of_folds_are_counted_before_they_are_made():
    folds = track.Folds(load("ambiguous_rls4").cases[0].spec.radar)
    folds.begin(0.0, 18.0)
    most = (rows.MOST_LOOKED_AT / 2) ** 2 * 4  # a reach of half as many spans as may be, to either side
    assert folds.innovations(np.zeros(1), np.array([most * 0.999])).shape[1] <= rows.MOST_LOOKED_AT + 1
    for e, S in ((np.zeros(1), most * 1.001), (np.zeros(300), most / 299**2), (np.zeros(1), np.nan), (np.zeros(1), 0)):
        with pytest.raises(PlotFault, match="velocity_mps"):
            folds.innovations(e, np.array([S]))


def test_the_fan_of_a_case_with_rare_folds_is_of_plots_as_they_fall():
    """The fan holds one filter alone, which need not be the one whose wrong folds are rare."""
    case = load("ambiguous_rare").cases[0]
    number = next(i for i, one in enumerate(case.spec.filters) if (one.hypotheses or 1) > 1)
    shown = figures.fan(case, number, 3)
    plain = replace(case, spec=case.spec.model_copy(update={"rare": None}))
    assert case.spec.rare is not None
    np.testing.assert_array_equal(shown.truth, figures.fan(plain, number, 3).truth)
    assert len(shown.lists) == 3


def test_what_memory_is_worth_is_measured_by_the_error_and_not_by_right_folds():
    """Folds merged at each scan are right next to never, and lower σ of the velocity all the same."""
    result = radarsim.run("ambiguous", realisations=2000, figures=False)
    folds = result.tables["folds"]
    assert folds[(folds["filter"] == "no memory") & (folds["k"] > 10)]["right"].max() < 0.05
    claims = result.tables["claims"]
    own = claims[claims["claim"] == "P1.E2"]
    assert set(own["class"]) == {"refuted"}
    nearest = own["what"].str.endswith("nearest fold")
    assert set(own[nearest]["verdict"]) == {"confirmed"}
    last = own[~nearest & own["what"].str.contains("last scan")]
    assert len(last) == 4
    assert set(last["verdict"]) == {"refuted"}


def test_sigma_is_marked_where_few_false_velocities_were_seen():
    """Of filters that unfold, and of what is compared with them; one that needs not is left alone."""
    made = radarsim.run("ambiguous_rls5", realisations=300, overrides=["scans=12", "baseline=memory"]).tables
    folds = made["folds"].set_index(["filter", "k"])
    few = (folds["n"] * folds["beyond"]).round() < statistics.FEW_EVENTS
    assert few.any()
    assert not few.all()
    curves, gains = made["curves"], made["gains"]
    own = pd.Series([bool(few.get((row.filter, row.k), False)) for row in curves.itertuples()])
    assert (curves["note"] == FEW_FOLDS)[~own].sum() == 0
    assert curves["note"][own].isin([FEW_FOLDS, notes.HEAVY]).all()
    assert (curves["note"] == FEW_FOLDS).any()
    late = gains[(gains["filter"] == "range only") & (gains["k"] == 12)]
    assert late["note"].isin([FEW_FOLDS, notes.HEAVY]).all()  # its baseline unfolds


@pytest.mark.parametrize("name", ["no memory", "best hypothesis", "memory"])
def test_plots_as_stated_are_found_so_while_folds_are_undecided(name):
    """NIS of the ranges of 12 realisations, of one degree of freedom at each of 29 scans: the variance of one is 2."""
    case = load("ambiguous_rls2", ["scans=30"]).cases[0]
    tested = []
    for realisation in range(12):
        columns = {
            key: column for key, column in track.Recorded().simulated(case, realisation).items() if "true" not in key
        }
        made = track.Tracker(case).feed(columns)
        assert "oracle" not in made.filters  # a recording has no true folds
        tested.append(made.nis[made.filters.index(name), 1:, 0])
    tested = np.concatenate(tested)
    assert abs(np.nanmean(tested) - 1) < mean_error(np.isfinite(tested).sum(), np.sqrt(2))


def test_an_infinite_gain_is_judged_without_a_warning():
    """At the first scan the known velocity is its own estimate: σ is zero, and any filter's gain −∞."""
    known = {"target": "random_polynomial", "target.sigma_velocity_mps": 0}
    gains = radarsim.run("ambiguous_rls2", overrides=known, realisations=200).tables["gains"]
    assert np.isneginf(gains["exact_percent"]).any()
