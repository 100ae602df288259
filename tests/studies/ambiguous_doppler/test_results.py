"""Tables, figures, sentences and recorded plots of a small run."""

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.errors import ConfigError, PlotFault
from radarsim.language.translate import quote_name
from radarsim.recordings import csv_output
from radarsim.recordings.fit import fit
from radarsim.report import interval_notes, statistics
from radarsim.studies import registry
from radarsim.studies.ambiguous_doppler import (
    fold_resolver,
    hypothesis_fan,
    plot_likelihood,
    recorded_plots,
    study,
    tracking,
)
from radarsim.studies.ambiguous_doppler.kernels import layout, realisations, recorded_rows
from radarsim.studies.ambiguous_doppler.tables import FEW_FOLDS
from radarsim.studies.counted_scans import result_scans
from tests.answers import answer_texts
from tests.recordings import plot_files
from tests.studies.ambiguous_doppler.conftest import tolerances
from tests.tolerances import assert_rounded, mean_error


@pytest.fixture(scope="module")
def result():
    return radarsim.run("ambiguous_rls4", realisations=3000)


def test_folds(result):
    folds = result.tables["folds"]
    assert set(folds["filter"]) == {"nearest fold", "no memory", "best hypothesis", "memory"}
    assert (folds["right_lo"] <= folds["right"]).all()
    assert (folds["right"] <= folds["listed"]).all()
    memory = folds[folds["filter"] == "memory"].set_index("k")
    assert memory.loc[8, "right"] > 0.98
    assert memory.loc[1, "hypotheses"] == pytest.approx(210, abs=1)  # as many as spans fit into the prior
    nearest = folds[folds["filter"] == "nearest fold"]
    assert (nearest["hypotheses"] == 1).all()
    assert (nearest["right"].diff().dropna() <= 0).all()  # once lost, always lost


def test_calibration_is_of_filters_that_remember(result):
    table = result.tables["calibration"]
    assert set(table["filter"]) == {"best hypothesis", "memory"}
    assert table.groupby(["filter", "k"])["n"].sum().eq(3000).all()
    assert ((table["expected"] >= table["bin_lo"]) & (table["expected"] <= table["bin_hi"])).all()


def test_gains_beside_the_oracle(result):
    gains = result.tables["gains"]
    oracle_gains = gains[(gains["filter"] == "oracle")]
    assert oracle_gains["excess_over_oracle_percent"].isna().all()
    curves = result.curves.set_index(["filter", "component", "k"])["sigma"]
    row = gains[(gains["filter"] == "memory") & (gains["component"] == "Vr") & (gains["k"] == 5)].iloc[0]
    ratio = curves["memory", "Vr", 5] / curves["oracle", "Vr", 5]
    assert_rounded(row["excess_over_oracle_percent"], 100 * (ratio - 1), size=100 * ratio, operations=5)
    assert (
        row["excess_over_oracle_percent_lo"] < row["excess_over_oracle_percent"] < row["excess_over_oracle_percent_hi"]
    )


def test_answer_names_the_scan_from_which_folded_velocity_is_as_good(result):
    experiment = load("ambiguous_rls4")
    folded = registry.study("ambiguous_doppler")
    assert (
        folded.question(experiment)
        == "From which scan on is ambiguous Doppler as good as unfolded velocity for the radar RLS 4?"
    )
    sentence, _ = answer_texts(folded, result.cases, result.tables)
    assert sentence.startswith("RLS 4, D = 15 m/s, “memory”: ")
    assert "all folds are right in" in sentence


def test_orders_and_their_sentence():
    result = radarsim.run("orders", realisations=1000)
    table = result.tables["orders"]
    total = table.groupby(["case", "filter", "k"])["weight"].sum().to_numpy()
    assert_rounded(total, np.ones(len(total)), operations=1000)  # means of so many
    assert set(table["filter"]) == {"likelihood", "expected error", "intersection"}
    assert len(result.tables["folds"]) == 0
    sentences = answer_texts(registry.study("ambiguous_doppler"), result.cases, result.tables)
    first, by_case, weak_point, *sentences, prior = sentences
    assert prior.endswith(" m/s²."), "no D in the answer, and none explained"
    assert len(sentences) == 3
    assert all("the best combination" in sentence for sentence in sentences)
    study, curves = registry.study("ambiguous_doppler"), result.curves.query("component == 'r'")
    scans = {case.name: result_scans(study, case) for case in result.cases}
    assert [counted.reason for counted in scans.values()] == ["settled", "manoeuvre", "settled"]
    curves = curves[curves["k"] >= curves["case"].map({name: counted.k for name, counted in scans.items()})]
    largest = curves.assign(exact=curves["exact_sigma"].fillna(curves["sigma"])).groupby("filter")["exact"].max()
    singles = largest[["order 0", "order 1", "order 2", "order 2 range only"]]
    text = "The largest RMS range error after the start of the track in 3 cases is smallest with "
    assert first.startswith(f"{text}{quote_name(largest.idxmin())}: ")
    assert f"with the best single model order, {quote_name(singles.idxmin())}, it is " in first
    by_filter = curves.assign(exact=curves["exact_sigma"].fillna(curves["sigma"])).groupby(["case", "filter"])["exact"]
    singles_by_case = by_filter.max().unstack()[list(singles.index)]
    assert (
        by_case
        == "Best single model order of each case, by the same error: "
        + "; ".join(
            f"{quote_name(row.idxmin())}, {row.min():.4g} m ({'target = ' + case.partition('=')[2].replace('_', ' ')})"
            for case, row in singles_by_case.loc[list(scans)].iterrows()
        )
        + "."
    )
    assert weak_point.startswith(f"Weak point of {quote_name(largest.idxmin())}: the RMS error of the ")
    assert {"orders", "sigma_r"} <= set(result.figures)


def test_answer_counts_radars_with_folded_velocity_as_good():
    result = radarsim.run("ambiguous", realisations=400)
    first = result.answer[0]
    gains = result.gains.query("component == 'Vr' and filter == 'memory'").groupby("case").tail(1)
    is_good = gains["excess_over_oracle_percent_hi"] <= 5
    is_undecided = (
        ~is_good & (gains["excess_over_oracle_percent_lo"] <= 5) & (gains["excess_over_oracle_percent"] < 100)
    )
    assert first.startswith(
        f"“memory”: the RMS velocity error is within 5 % of that with unfolded velocity in {is_good.sum()} of 4 cases "
        f"at the last scan, undecided in {is_undecided.sum()}"
    )
    worst = gains.loc[gains["excess_over_oracle_percent"].idxmax(), "case"]
    assert f"worst case, {worst.replace('ambiguous_rls', 'RLS ')}: " in " ".join(result.answer[:2])


def test_worst_case_is_said_to_tie(result):
    """Two cases of the same tables: neither is worse."""
    gains = result.tables["gains"].copy()
    columns = ["excess_over_oracle_percent", "excess_over_oracle_percent_lo", "excess_over_oracle_percent_hi"]
    gains.loc[(gains["component"] == "Vr") & (gains["filter"] == "memory"), columns] = (500.0, 400.0, 600.0)
    tables = {**result.tables, "gains": gains}
    first, *_ = answer_texts(registry.study("ambiguous_doppler"), [result.cases[0]] * 3, tables)
    assert first.endswith(", as in 2 other cases.")


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        (
            (4.9, -3.7, 6.1),
            "the RMS velocity error differs by +4.90 % [−3.70, +6.10] from that of unfolded velocity at scan 15, the "
            "last: undecided whether within 5 %;",
        ),
        (
            (5.3, 4.1, 6.2),
            "the RMS velocity error differs by +5.30 % [+4.10, +6.20] from that of unfolded velocity at scan 15, the "
            "last: undecided whether within 5 %;",
        ),
        (
            (6.2, 5.1, 7.4),
            "the RMS velocity error is still 6.20 % [5.10, 7.40] above that of unfolded velocity at scan 15, the last;",
        ),
    ],
)
def test_interval_around_five_percent_is_not_called_above(result, ends, words):
    gains = result.tables["gains"].copy()
    last = (gains["component"] == "Vr") & (gains["filter"] == "memory") & (gains["k"] == 15)
    gains.loc[
        last, ["excess_over_oracle_percent", "excess_over_oracle_percent_lo", "excess_over_oracle_percent_hi"]
    ] = ends
    sentence, prior = answer_texts(registry.study("ambiguous_doppler"), result.cases, {**result.tables, "gains": gains})
    assert words in sentence
    assert prior.startswith("Note: prior of the filters: ")
    assert prior.endswith("; D is the unambiguous interval of the velocity.")


@pytest.mark.parametrize("combine", [False, True])
def test_answer_is_empty_without_plots(combine):
    orders = "orders: [1, 2], combine: likelihood, manoeuvre_variance: [100, 1e-3]"
    more = [f"filters=[{{name: one, doppler: folded, {orders}}}]"] if combine else []
    result = radarsim.run("ambiguous_rls4", realisations=8, overrides=["radar.detection_probability=1e-9", *more])
    assert (result.tables["curves"]["n"] == 0).all()
    assert len(result.tables["folds"]) == 0
    assert answer_texts(registry.study("ambiguous_doppler"), result.cases, result.tables) == []


def test_mean_of_fan_is_the_estimate():
    """The weighted mean of the listed hypotheses is the filter's estimate, scan by scan."""
    case = load("ambiguous_rls4").cases[0]
    plan = study.prepare(case)
    _, out = realisations.simulate_outputs(plan.world, plan.banks, 0)
    fan, (tolerance, _) = hypothesis_fan.fan(case, 5, 6), tolerances(case, np.ones(15))
    for k, (v, a, p) in enumerate(fan.lists):
        mean = out[plan.banks.bank[5], k, :3, 7]
        assert p @ v == pytest.approx(mean[1], rel=0, abs=tolerance[1])
        assert p @ a == pytest.approx(mean[2], rel=0, abs=tolerance[2])
        assert (np.diff(p) <= 0).all()


@pytest.mark.parametrize("keys", [(), ("radar.detection_probability=0.7",), ("radar.repetition_rate_hz=[1000, 1200]",)])
def test_track_over_simulated_plots_equals_the_study(keys):
    """Recorded at the config's own times, the trackers' estimates are those of the kernels. The prior of a run is that
    of the first scan, of a recording that of the first plot: the realisation has a plot at the first scan."""
    case = load("ambiguous_rls4", [*keys, "filters.2.hypotheses=2"]).cases[0]
    plan = study.prepare(case)
    plots, out = realisations.simulate_outputs(plan.world, plan.banks, 8)
    recorded = [recorded_plots.FoldedRecordedPlots().simulated(case, 8 + lane) for lane in range(8)]
    lane = next(lane for lane in range(3, 8) if np.isfinite(recorded[lane]["range_m"][0]))
    columns = recorded[lane]
    is_detected = ~np.isnan(columns["range_m"])
    assert np.array_equal(columns["range_m"][is_detected], plots[is_detected, 0, lane])
    assert (np.abs(columns["velocity_mps"][is_detected]) <= plan.world.spans[is_detected] / 2).all()
    recorded_columns = columns | {"velocity_mps": columns["velocity_mps"].copy()}
    tracks = tracking.Tracker(case).feed(recorded_columns)
    started = np.cumsum(is_detected) > 0
    names = [options.name for options in case.spec.filters]
    assert set(names) - set(tracks.filters) == {"oracle"}  # recorded velocities are folded
    for f, name in enumerate(tracks.filters):
        bank, field = (by_filter[names.index(name)] for by_filter in (plan.banks.bank, plan.banks.estimate_field))
        difference = np.abs(tracks.estimate[f] - out[bank, :, field : field + 3, lane])[started]
        assert (difference <= tolerances(case, is_detected)[0]).all()
        assert np.isnan(tracks.estimate[f][~started]).all()


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
def test_track_of_combined_orders_equals_the_study(doppler, more):
    orders = f"orders: [0, 1, 2], manoeuvre_variance: [9e4, 4, 1e-3], doppler: {doppler}{more}"
    filters = ", ".join(f"{{name: {name}, {orders}, {how}}}" for name, how in COMBINED.items())
    keys = [f"filters=[{filters}]", "scans=12", "target={kind: acceleration_pulse, coefficients: [100e3, -250], "]
    keys[-1] += "acceleration_g: 2, start_s: 60, duration_s: 30}"
    case = load("ambiguous_rls2", [*keys, "baseline=likelihood"]).cases[0]
    plan = study.prepare(case)
    plots, out = realisations.simulate_outputs(plan.world, plan.banks, 8)
    velocity = plots[:, layout.UNFOLDED if doppler == "unfolded" else layout.VELOCITY, 3]
    tracks = tracking.Tracker(case).feed({"t_s": plan.world.t, "range_m": plots[:, 0, 3], "velocity_mps": velocity})
    for f, name in enumerate(tracks.filters):
        place = plan.banks.estimate_field[f]
        output = out[plan.banks.bank[f], :, place : place + 3, 3]
        assert (np.abs(tracks.estimate[f] - output) <= tolerances(case, np.ones(12))[0]).all(), name
    # The sigma that is given beside is that of an expected error where it is exact.
    sigma = tracks.sigma[1]
    E = plan.axes.oracle_sigma[1] if doppler == "folded" else plan.axes.exact_sigma[1]
    assert sigma.shape == E.shape
    assert (sigma > 0).all()


def test_track_of_combined_orders_over_gaps():
    """Rows that lack a value, or are not there, are no fault; from the first range on there are estimates."""
    case = load("orders").cases[0]
    t = np.array([0.0, 10, 20, 33, 40, 90, 100])
    z = np.array([np.nan, 1e5, 97.5e3, np.nan, 90e3, 77.5e3, 75e3])
    v = np.array([-250.0, np.nan, -245, -251, np.nan, -240, -250])
    tracker = tracking.Tracker(case)
    tracks = tracker.feed({"t_s": t, "range_m": z, "velocity_mps": v})
    assert np.isnan(tracks.estimate[:, 0]).all()
    assert np.isfinite(tracks.estimate[:, 1:, 0]).all()
    assert np.abs(tracks.estimate[:, -1, 0] - 75e3).max() < 1500
    more = np.arange(110.0, 1110.0, 10)
    many = tracker.feed({"t_s": more, "range_m": 75e3 - 250 * (more - 100), "velocity_mps": np.full(100, -250.0)})
    assert np.abs(many.estimate[:, -1, 1] + 250).max() < 60
    assert max(len(follower.onsets) for follower in tracker.followers if hasattr(follower, "onsets")) == case.spec.scans


def test_track_of_remainders_equals_the_study():
    keys = ["radar.repetition_rate_hz=[1000, 1200, 1400]", "radar.detection_probability=0.7"]
    filter_yaml = "{name: remainder, doppler: remainder, manoeuvre_variance: 1e-3}"
    case = load("ambiguous_rls4", [*keys, f"filters=[{filter_yaml}]"]).cases[0]
    plan = study.prepare(case)
    _, out = realisations.simulate_outputs(plan.world, plan.banks, 8)
    columns = recorded_plots.FoldedRecordedPlots().simulated(case, 11)
    tracks = tracking.Tracker(case).feed(columns)
    has_estimate = np.isfinite(tracks.estimate[0, :, 0])
    assert has_estimate.sum() > 8
    difference = np.abs(tracks.estimate[0] - out[0, :, :3, 3])[has_estimate]
    assert (difference <= tolerances(case, np.isfinite(columns["range_m"]))[0]).all()


def test_remainder_depends_on_the_folded_velocity_only():
    """However many spans too large it is written."""
    folds = fold_resolver.FoldResolver(
        load("ambiguous_rls4", ["radar.repetition_rate_hz=[1000, 1200]"]).cases[0].spec.radar
    )
    folds.begin_row(0.0, 15.0)
    assert np.isnan(folds.remainder(2.0 + 15 * 2**20))
    folds.begin_row(10.0, 18.0)
    assert folds.remainder(5.0 + 18 * 2**40) == -13.0  # -13 + 15 = 2 and -13 + 18 = 5, and no other in ± 45
    folds.begin_row(20.0, 15.0)
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
def test_too_many_folds_are_reported_with_their_row(tmp_path, change, words):
    experiment = load("ambiguous_rls4", ["filters=[{name: memory, doppler: folded, manoeuvre_variance: 1e-3}]"])
    t = np.arange(15) * 10.0
    csv_output.write_columns({"t_s": t, "range_m": 1e5 + 0 * t, "velocity_mps": 0 * t} | change, tmp_path / "plots.csv")
    with warnings.catch_warnings(action="error"), pytest.raises(ConfigError) as error:
        plot_files.track(experiment, tmp_path / "plots.csv")
    assert words in str(error.value)


def test_too_many_folds_have_no_likelihood():
    """A prior σ of 300 m/s over spans of 0.5 mm/s: 10⁷ folds of the first velocity, which the ranges would tell."""
    exact = "radar.sigma_range_m=1e-4", "radar.sigma_velocity_mps=3e-4"
    case = load(
        "ambiguous_rls4", [*exact, "filters=[{name: memory, doppler: folded, manoeuvre_variance: 1e-17}]"]
    ).cases[0]
    t, rng = np.arange(15) * 10.0, np.random.default_rng(1)
    ranges = 1e5 + 1e-4 * rng.normal(size=15)
    columns = {"t_s": t, "range_m": ranges, "velocity_mps": 0 * t, "span_mps": np.full(15, 5e-4)}
    likelihood = plot_likelihood.PlotLikelihood(case, case.spec.filters[0], [columns])
    assert likelihood(likelihood.stated) == -np.inf
    _, sigma, _ = fit.fit_keys(likelihood).keys  # unless the velocities tell nothing
    assert sigma.lo > 0.6 * 5e-4


def test_folds_are_counted_before_sequences_are_built():
    folds = fold_resolver.FoldResolver(load("ambiguous_rls4").cases[0].spec.radar)
    folds.begin_row(0.0, 18.0)
    max_variance = (recorded_rows.MAX_SEQUENCES / 2) ** 2 * 4  # a reach of half as many spans as may be, to either side
    assert folds.innovations(np.zeros(1), np.array([max_variance * 0.999])).shape[1] <= recorded_rows.MAX_SEQUENCES + 1
    for e, S in (
        (np.zeros(1), max_variance * 1.001),
        (np.zeros(300), max_variance / 299**2),
        (np.zeros(1), np.nan),
        (np.zeros(1), 0),
    ):
        with pytest.raises(PlotFault, match="velocity_mps"):
            folds.innovations(e, np.array([S]))


def test_fan_of_a_case_with_rare_folds_shows_plain_realisations():
    """The fan holds one filter alone, which need not be the one whose wrong folds are rare."""
    case = load("ambiguous_rare").cases[0]
    filter_index = next(i for i, options in enumerate(case.spec.filters) if (options.hypotheses or 1) > 1)
    fan = hypothesis_fan.fan(case, filter_index, 3)
    plain = replace(case, spec=case.spec.model_copy(update={"rare": None}))
    assert case.spec.rare is not None
    np.testing.assert_array_equal(fan.truth, hypothesis_fan.fan(plain, filter_index, 3).truth)
    assert len(fan.lists) == 3


def test_value_of_memory_is_measured_by_the_error():
    """Folds merged at each scan are right next to never, and lower σ of the velocity all the same."""
    result = radarsim.run("ambiguous", realisations=2000, figures=False)
    folds = result.tables["folds"]
    assert folds[(folds["filter"] == "no memory") & (folds["k"] > 10)]["right"].max() < 0.05
    claims = result.tables["claims"]
    memory_claims = claims[claims["claim"] == "P1.E2"]
    assert set(memory_claims["class"]) == {"refuted"}
    nearest = memory_claims["quantity"].str.endswith("nearest fold")
    assert set(memory_claims[nearest]["verdict"]) == {"confirmed"}
    last = memory_claims[~nearest & memory_claims["quantity"].str.contains("last scan")]
    assert len(last) == 4
    assert set(last["verdict"]) == {"refuted"}


def test_sigma_is_marked_where_few_false_velocities_were_seen():
    """Of filters that unfold, and of what is compared with them; one that needs not is left alone."""
    tables = radarsim.run("ambiguous_rls5", realisations=300, overrides=["scans=12", "baseline=memory"]).tables
    folds = tables["folds"].set_index(["filter", "k"])
    few = (folds["n"] * folds["beyond_half_interval_share"]).round() < statistics.MIN_EVENTS
    assert few.any()
    assert not few.all()
    curves, gains = tables["curves"], tables["gains"]
    is_marked = pd.Series([bool(few.get((row.filter, row.k), False)) for row in curves.itertuples()])
    assert (curves["note"] == str(FEW_FOLDS))[~is_marked].sum() == 0
    assert curves["note"][is_marked].isin([str(FEW_FOLDS), str(interval_notes.HEAVY_TAILS)]).all()
    assert (curves["note"] == str(FEW_FOLDS)).any()
    late = gains[(gains["filter"] == "range only") & (gains["k"] == 12)]
    assert late["note"].isin([str(FEW_FOLDS), str(interval_notes.HEAVY_TAILS)]).all()  # its baseline unfolds


@pytest.mark.parametrize("name", ["no memory", "best hypothesis", "memory"])
def test_configured_plots_pass_the_checks_while_folds_are_undecided(name):
    """NIS of the ranges of 12 realisations, of one degree of freedom at each of 29 scans: the variance of one is 2."""
    case = load("ambiguous_rls2", ["scans=30"]).cases[0]
    tested = []
    for realisation in range(12):
        columns = {
            key: column
            for key, column in recorded_plots.FoldedRecordedPlots().simulated(case, realisation).items()
            if "true" not in key
        }
        tracks = tracking.Tracker(case).feed(columns)
        assert "oracle" not in tracks.filters  # a recording has no true folds
        tested.append(tracks.nis[tracks.filters.index(name), 1:, 0])
    tested = np.concatenate(tested)
    assert abs(np.nanmean(tested) - 1) < mean_error(np.isfinite(tested).sum(), np.sqrt(2))


def test_an_infinite_gain_is_judged_without_a_warning():
    """At the first scan the known velocity is its own estimate: σ is zero, and any filter's gain −∞."""
    overrides = {"target": "random_polynomial", "target.sigma_velocity_mps": 0}
    gains = radarsim.run("ambiguous_rls2", overrides=overrides, realisations=200).tables["gains"]
    assert np.isneginf(gains["exact_percent"]).any()
