"""Tables and figures of tracks among false plots: what they say of the sums, and that their intervals cover."""

import numpy as np
import pytest
from scipy import stats

import radarsim
from radarsim.language.translate import quote_name
from radarsim.report import wording
from radarsim.studies.sonar.clutter import answer, figures, intervals
from radarsim.studies.sonar.clutter.kernels import track_sums
from tests.answers import answer_texts
from tests.tolerances import assert_rounded, share_error


def config(**more):
    rules = {"kind": "kalman", "manoeuvre_variance": 1e-4}
    return {
        "study": "sonar",
        "sensor": {
            **{"sigma_range_m": 30.0, "sigma_bearing_deg": 1.0, "scan_period_s": 5.0, "detection_probability": 0.8},
            "sector": {"range_m": [5e3, 12e3], "bearing_deg": [0, 40]},
        },
        "target": "sonar_straight",
        "filters": [
            {"name": "nearest", "association": "nearest", "initiation": {"m": 2, "n": 3}, **rules},
            {"name": "PDA", "association": "pda", **rules},
            {"name": "told", "association": "known", **rules},
        ],
        "scans": 16,
        "sweep": {"sensor.false_plots_per_km2": [0.0, 1.0, 2.0]},
        "realisations": 2000,
    } | more


@pytest.fixture(scope="module")
def result():
    return radarsim.run(config())


def estimate_text(row, column, unit=""):
    return wording.estimate((row[column], row[f"{column}_lo"], row[f"{column}_hi"]), unit, ",.3g")


def test_the_answer_has_each_case_and_ranks_no_tracker_by_its_life(result):
    rows, run_s = result.tables["tracking"], result.cases[0].axes.t_s[-1]
    by_case = {}
    *on_cases, note = result.answer
    assert note == "Note: the target's track is a confirmed one near the target, whichever plots it uses."
    for sentence in on_cases:
        by_case.setdefault(sentence.partition(": ")[0], []).append(sentence)
    assert len(by_case) == rows["case"].nunique()
    for (subject, of_case), (_, case_rows) in zip(by_case.items(), rows.groupby("case", sort=False), strict=True):
        assert subject.startswith("clutter density = ")
        sentence = " ".join(of_case)
        for row in case_rows.to_dict("records"):
            assert f"{quote_name(row['filter'])} confirms " in sentence
            assert f", keeps it for {estimate_text(row, 'life_s', 's')}" in sentence
            assert (
                f"] (extrapolated from {run_s:g} s)"
                in sentence.partition(f"{quote_name(row['filter'])} confirms ")[2].partition("false tracks")[0]
            ) == (row["life_s"] > run_s)
            assert f" {estimate_text(row, 'false_tracks_per_hour')}" in sentence


def test_a_tracker_that_confirms_nothing_keeps_no_track(result):
    """Which is not that it loses none."""
    table = result.tables["tracking"].copy()
    lost = table["filter"] == "PDA"
    table.loc[lost, ["confirmed_share", "ends_per_hour", "life_s", "time_to_confirm_s"]] = [0.0, np.nan, np.nan, np.nan]
    first, *_ = answer_texts(answer, result.cases, {"tracking": table})
    assert ": “nearest” confirms " in first
    assert first.endswith("; PDA confirms no track.")
    table.loc[:, ["confirmed_share", "ends_per_hour"]] = [0.0, np.nan]
    assert "confirms no track" in answer_texts(answer, result.cases, {"tracking": table})[0]


def test_tables_say_what_the_sums_hold(result):
    tracks, tracking, gates = (result.tables[name] for name in ("tracks", "tracking", "gates"))
    assert len(tracks) == 3 * 2 * 16
    assert len(tracking) == 6
    case = result.cases[2]
    counts = case.sums["counts"][1]
    rows = tracks[(tracks["case"] == case.name) & (tracks["filter"] == "PDA")]
    assert (rows["kept_share"] == counts[:, track_sums.CONFIRMED_COUNT] / 2000).all()
    assert rows["n_lost"].sum() == counts[:, track_sums.LOST_COUNT].sum()
    row = tracking[(tracking["case"] == case.name) & (tracking["filter"] == "PDA")].iloc[0]
    held = counts[:, track_sums.CONFIRMED_COUNT].sum() * 5.0
    ends = counts[:, [track_sums.LOST_COUNT, track_sums.DROPPED_COUNT]].sum()
    assert_rounded(row["life_s"], held / ends, operations=6)
    assert_rounded(row["ends_per_hour"], 3600 * ends / held, operations=6)
    assert row["life_s_lo"] < row["life_s"] < row["life_s_hi"]
    area = np.radians(40) * (144 - 25) / 2  # km²
    assert_rounded(row["false_tracks_per_hour"], 2.0 * area * 720 * row["false_confirmed_share"], operations=10)
    assert set(gates["filter"]) == {"nearest", "PDA", "told"}
    known = gates[(gates["filter"] == "told")]
    assert (known["false_in_gate_lo"] <= known["exact_false_in_gate"] * 1.2).all()
    assert result.gains.empty


def test_without_false_plots_there_are_no_false_tracks(result):
    clean = result.tables["tracking"].iloc[:2]
    assert (clean[["false_tracks_per_hour", "false_confirmed_share", "wrong_share"]] == 0).all().all()
    assert (clean["exact_false_confirmed_share"] == 0).all()


def test_exact_share_of_false_pairs_stands_beside_the_measured_one(result):
    rows = result.tables["tracking"]
    pairs = rows[(rows["filter"] == "nearest") & (rows["false_plots_per_km2"] > 0)]
    assert np.isfinite(pairs["exact_false_confirmed_share"]).all()
    off = (pairs["false_confirmed_share"] - pairs["exact_false_confirmed_share"]).abs()
    assert (off < share_error(pairs["exact_false_confirmed_share"], 2000)).all()
    assert rows[rows["filter"] == "PDA"].iloc[1:]["exact_false_confirmed_share"].isna().all()


def test_classes_fall_with_the_threshold_and_keep_the_bound(result):
    for _, rows in result.tables["track_classes"].groupby(["case", "filter"]):
        assert (np.diff(rows["true_called_false_share"]) >= 0).all()
        if (rows["n_false"] > 0).all():
            assert (np.diff(rows["false_called_true_share"]) <= 0).all()
            called = np.round(rows["false_called_true_share"] * rows["n_false"])
            assert (
                stats.binom.sf(called - 1, rows["n_false"], rows["false_called_true_bound"]) > 1e-6
            ).all()  # of 124 looks


@pytest.mark.slow
def test_figures_are_those_of_the_experiment(result):
    names = {"track_map", "confirmation", "track_life", "false_tracks", "track_classes", "sigma_r"}
    assert names <= set(result.figures)
    for name in names:
        assert result.figure(name) is not None


def test_false_tracks_that_did_not_occur_are_drawn_as_the_upper_end_of_their_interval(result):
    table = result.tables["tracking"].copy()
    rows, sparse = (
        table.columns.get_indexer(["false_tracks_per_hour", "false_tracks_per_hour_lo"]),
        table["false_plots_per_km2"] == 1,
    )
    table.iloc[sparse.to_numpy().nonzero()[0], rows] = 0.0
    figure = figures.false_figure(result.cases, table)
    *lines, upper = figure.panels[0].marks
    for line, name in zip(lines, ("nearest", "PDA"), strict=True):
        row = table[(table["filter"] == name) & (table["false_plots_per_km2"] == 2)].iloc[0]
        np.testing.assert_array_equal(line.x, [1, 2])  # and no point without false plots
        np.testing.assert_array_equal(line.y, [np.nan, row["false_tracks_per_hour"]])
        assert (line.lo[1], line.hi[1]) == (row["false_tracks_per_hour_lo"], row["false_tracks_per_hour_hi"])
    np.testing.assert_array_equal(upper.y, table[sparse]["false_tracks_per_hour_hi"])
    assert figure.panels[0].keys == (("none occurred: upper end of the interval", upper.style),)
    assert "Plots that confirm a track: 2 of 3 (“nearest”); 3 of 4 (PDA)." in figure.caption
    table.loc[table["filter"] == "PDA", "false_tracks_per_hour"] = 0.0
    assert figures.false_figure(result.cases, table).caption.endswith("Zero throughout: PDA.")
    assert figures.false_figure(result.cases, table.assign(false_tracks_per_hour=0.0)) is None


def test_what_does_not_change_over_a_sweep_is_said_and_rare_ends_are_drawn():
    result = radarsim.run("sonar_clutter_ends", realisations=60)
    figure = result._figures_by_name["track_life"]
    assert figure.panels[0].y.label == "share of tracks ended by the last scan"
    assert "time to confirmation, s" not in {panel.y.label for panel in figure.panels}
    table = result.tables["tracking"]
    least, most = (
        wording.number(float(end), 3) for end in (table["time_to_confirm_s"].min(), table["time_to_confirm_s"].max())
    )
    assert f"Constant over the sweep: time to confirmation ({least}–{most} s)" in figure.caption
    rare = result.tables["rare"]
    ended = rare[rare["sought"] & (rare["filter"] == "PDA")]
    line = next(mark for mark in figure.panels[0].marks if mark.label == "PDA")
    np.testing.assert_array_equal(line.y, ended["event_rate"])
    assert figure.panels[0].x.ticks[0] == (line.x[0], "0")  # zero has a place on the logarithmic axis
    np.testing.assert_array_equal(line.x[1:], [3e-4, 1e-3, 3e-3, 1e-2])
    assert_rounded(line.x[0], 1e-4, operations=4)  # a third of the next, in logarithms


def test_intervals_of_a_ratio_and_of_a_poisson_number_cover():
    rng, inside, n = np.random.default_rng(5), 0, 200
    for _ in range(1000):
        held = rng.poisson(30, n) + 1.0
        ends = rng.poisson(0.02 * held)
        sums = [ends.sum(), (ends**2).sum(), held.sum(), (held**2).sum(), (ends * held).sum()]
        of = intervals.ratio_of_sums(np.array(sums, dtype=float), n)
        inside += of.lo <= 0.02 <= of.hi
    assert inside >= stats.binom.ppf(5e-5, 1000, 0.94)
    count = rng.poisson(7.0, 20_000)
    of = intervals.poisson_rate(count, 1.0)
    assert np.mean((of.lo <= 7.0) & (of.hi >= 7.0)) >= 0.95 - share_error(0.05, 20_000)
    # Wilson and Hilferty's largest error is that of two events, 0.2246 for 0.2422; of none the end is zero.
    assert of.lo == pytest.approx(np.where(count, stats.chi2.ppf(0.025, 2 * count) / 2, 0.0), abs=0.0176)


def test_ratio_without_events_or_exposure():
    none = intervals.ratio_of_sums(np.array([0.0, 0.0, 100.0, 1.0, 0.0]), 10)
    assert (none.value, none.lo) == (0.0, 0.0)
    assert none.hi == pytest.approx(3.689 / 100, rel=0.006)  # Wilson and Hilferty's 3.668
    assert np.isnan(intervals.ratio_of_sums(np.zeros(5), 10).value)


def test_mean_time_has_the_interval_of_its_spread():
    of = intervals.mean_event_time(np.array([0.0, 5.0, 10.0]), np.array([0.0, 300.0, 100.0]))
    assert of.value == 6.25
    assert of.hi - of.value == pytest.approx(1.966 * np.sqrt(4.6875 / 399), rel=5e-4 / 1.966)  # Student's printed value
    assert np.isnan(intervals.mean_event_time(np.array([0.0]), np.array([0.0])).value)
