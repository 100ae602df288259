"""Notes where an interval covers less than it says, none elsewhere; and what is said of them above an answer."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api import result as api_result
from radarsim.api import result_content
from radarsim.config.find_files import SHIPPED
from radarsim.report import answer_warnings, interval_notes, statistics
from radarsim.report.drawing.line_points import rough_points
from radarsim.report.quantities import Quantity
from radarsim.report.row_notes import concerns, has_note, note_texts
from radarsim.report.sentences import MeasuredInterval, Sentence, as_sentence
from radarsim.report.statistics import MIN_TRUSTED_REALISATIONS
from radarsim.studies import registry


def test_effective_realisations_mark_a_row_whatever_n():
    n = np.full(5, 10_000.0)
    fewest = np.array([interval_notes.MIN_EFFECTIVE - 1, interval_notes.MIN_EFFECTIVE, np.inf, np.nan, 5.0])
    assert list(interval_notes.heavy_tail_notes(n, fewest)) == [
        interval_notes.HEAVY_TAILS,
        "",
        "",
        "",
        interval_notes.HEAVY_TAILS,
    ]


@pytest.mark.parametrize("n", [20, 60, 300])
def test_gaussian_errors_of_few_realisations_have_no_tails(n):
    """Half of them count, however few they are; those of a tenth of the realisations would."""
    assert list(interval_notes.heavy_tail_notes(np.full(2, float(n)), np.array([n / 2, n / 10]))) == [
        "",
        interval_notes.HEAVY_TAILS,
    ]


@pytest.mark.parametrize("count", [50, 300])
def test_a_sound_run_of_few_realisations_has_no_marks(count):
    made = radarsim.run("sonar_smoothing", realisations=count, overrides=["scans=5"]).tables
    assert not [name for name, table in made.items() if "note" in table]


def test_figures_get_no_interval_that_a_note_marks():
    """Of any table, only the intervals that the note is about; what an interval is of marks none."""
    heavy, varies = interval_notes.HEAVY_TAILS, interval_notes.BELIEVED_VARIES
    notes = np.array(["", heavy, heavy.about("gain"), varies, "of a user study"], dtype=object)
    columns = ["sigma", "sigma_lo", "sigma_hi", "gain_lo", "gain_hi"]
    table = pd.DataFrame(np.ones((5, 5)), columns=columns).assign(note=notes)
    left = interval_notes.without_noted_intervals({"any": table})["any"]
    assert left["sigma"].tolist() == [1] * 5
    assert left[["sigma_lo", "sigma_hi"]].notna().all(axis=1).tolist() == [True, False, True, True, False]
    assert left[["gain_lo", "gain_hi"]].notna().all(axis=1).tolist() == [True, False, False, True, False]
    assert table[columns].notna().all(axis=None)


def test_each_row_has_the_text_of_its_own_note():
    heavy = interval_notes.HEAVY_TAILS
    notes = np.array([heavy, "", heavy.about("gain"), "of a user study", heavy], dtype=object)
    texts = [heavy.text, "", f"gain: {heavy.text}", "of a user study", heavy.text]
    assert note_texts(pd.DataFrame({"note": notes})) == note_texts(pd.DataFrame({"note": texts})) == texts
    assert note_texts(pd.DataFrame({"n": [1]})) == []


def test_no_figure_of_bursts_has_a_band_where_their_table_has_a_note():
    """Measured velocities at 200 realisations: the rarest losses decide σ, and the least certain point has no band."""
    ran = radarsim.run("pulses_rls2", realisations=200, figures=False)
    figure = result_content.case_figures(ran.cases, ran.tables, ran.experiment)["measured"]
    rows = ran.tables["estimates"].query("component == 'Vr'")
    lines = [mark for panel in figure.panels for mark in panel.marks if mark.lo is not None]
    are_marked = [
        [concerns(note, "sigma_all") for note in filter_rows["note"]]
        for _, filter_rows in rows.groupby("filter", sort=False)
    ]
    assert any(map(any, are_marked))
    assert [np.isnan(line.lo).tolist() for line in lines] == are_marked
    assert [rough_points(line).tolist() for line in lines] == are_marked


def test_a_gain_rests_on_the_fewer_of_its_two_filters():
    rows = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.5, "sigma_lo": 1.0, "sigma_hi": 2.0}
    curves = pd.DataFrame([{**rows, "filter": "one", "n_eff": 2000.0}, {**rows, "filter": "two", "n_eff": 20.0}])
    gain = {"baseline": "two", "gain_percent": 0.5, "gain_lo": 0.0, "gain_hi": 1.0, "exact_percent": np.nan}
    gains = pd.DataFrame([{**rows, "filter": "one", **gain}])
    noted = interval_notes.add_notes({"curves": curves, "gains": gains.drop(columns="n")}, [])
    assert list(noted["curves"]["note"]) == ["", interval_notes.HEAVY_TAILS]
    assert list(noted["gains"]["note"]) == [interval_notes.HEAVY_TAILS]


def test_a_scan_near_one_with_heavy_tails_is_marked_too():
    of = [{"case": "a", "component": c, "k": k, "n": 5000, "filter": f} for f in "fg" for c in "xy" for k in range(60)]
    curves = pd.DataFrame(of).assign(sigma=1.0, sigma_lo=0.9, sigma_hi=1.1, n_eff=2500.0)
    curves.loc[(curves["filter"] == "g") & (curves["component"] == "x") & (curves["k"] == 20), "n_eff"] = 30.0
    noted = interval_notes.add_notes({"curves": curves}, [])["curves"].set_index(["filter", "component", "k"])["note"]
    near = noted[noted == interval_notes.HEAVY_TAILS].index.tolist()
    assert near == [("g", "x", k) for k in range(14, 27)]  # a tenth of 60 scans on either side
    assert (noted == "").sum() == 240 - 13


@pytest.mark.parametrize(
    ("half", "exact", "alike"), [(0.3, np.nan, True), (5.0, np.nan, False), (0.3, 3.0, False), (0.0, np.nan, False)]
)
def test_gains_of_filters_that_err_nearly_alike_are_marked(half, exact, alike):
    """Independent σ to ± 4 % would give a gain to ± 5.7; the same filter twice has no chance in it."""
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.0, "sigma_lo": 0.96, "sigma_hi": 1.04}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    gain = {"gain_percent": 0.0, "gain_lo": -half, "gain_hi": half, "exact_percent": exact}
    gains = pd.DataFrame([{**row, "filter": "one", "baseline": "two", **gain}]).drop(columns="n")
    noted = interval_notes.add_notes({"curves": curves, "gains": gains}, [])["gains"]
    assert list(noted.get("note", [""])) == [interval_notes.ALIKE_FILTERS if alike else ""]


@pytest.mark.parametrize(("value", "alike"), [(0.0, True), (-95.0, False), (95.0, True)])
def test_a_paired_quantity_that_a_study_declares_is_marked_likewise(value, alike):
    """As wide as ± 0.3 % of the other σ: wide of a σ that is a twentieth of it, not of one that is twice as much."""
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.0, "sigma_lo": 0.96, "sigma_hi": 1.04}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    above = {"above_percent": value, "above_lo": value - 0.3, "above_hi": value + 0.3}
    table = pd.DataFrame([{**row, "filter": "one", **above}]).drop(columns="n")
    declared = Quantity("above", "above", "apart", "above_percent|above", kind="signed", unit="%", paired=True)
    noted = interval_notes.add_notes({"curves": curves, "apart": table}, [], quantities=[declared])["apart"]
    assert list(noted.get("note", [""])) == [interval_notes.ALIKE_FILTERS if alike else ""]


@pytest.mark.parametrize("share", [1.0, 0.002])
def test_a_gain_is_marked_where_few_realisations_differ_and_covers_where_all_do(share):
    """1000 runs of 1000 realisations of two filters whose squared errors differ in this share of them."""
    runs, n, rng = 1000, 1000, np.random.default_rng(6)
    b = rng.standard_normal((runs, n))
    there = rng.random((runs, n)) < share
    e = b + there * rng.standard_normal((runs, n)) * (0.02 if share == 1 else 1.0)
    true = 100 * (1 - np.sqrt(1 + share * (0.02**2 if share == 1 else 1.0)))
    sums = [(one**power).sum(1) for one in (e, b) for power in (2, 4)]
    gain = statistics.gain(*sums, (e**2 * b**2).sum(1), n)
    differ = e**2 - b**2
    square, fourth = ((differ**power).sum(1)[:, None, None] for power in (2, 4))
    marked = interval_notes.rests_on_few_differences(square, fourth, np.full((runs, 1, 1), float(n))).ravel()
    inside = (gain.lo < true) & (true < gain.hi)
    if share == 1:
        assert marked.mean() < 0.03
        assert abs(inside[~marked].mean() - 0.95) < 3 * np.sqrt(0.95 * 0.05 / runs)
    else:
        assert marked.all()
        assert inside.mean() < 0.8


def test_a_gain_of_all_there_is_divides_by_nothing():
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 0.0, "sigma_lo": 0.0, "sigma_hi": 0.0}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    gain = {"gain_percent": 100.0, "gain_lo": 100.0, "gain_hi": 100.0, "exact_percent": np.nan}
    gains = pd.DataFrame([{**row, "filter": "one", "baseline": "two", **gain}]).drop(columns="n")
    with np.errstate(all="raise"):
        noted = interval_notes.add_notes({"curves": curves, "gains": gains}, [])["gains"]
    assert list(noted.get("note", [""])) == [""]


def test_a_table_keeps_the_notes_that_it_brings():
    table = pd.DataFrame(
        {"case": "a", "n": [5000, 500], "n_eff": 2500.0, "filter": "f", "component": "x", "k": [1, 99]}
    )
    table = table.assign(ratio=1.0, ratio_lo=0.9, ratio_hi=1.1)
    made = {"curves": pd.DataFrame(), "ratios": table.assign(note=["own", ""])}
    assert list(interval_notes.add_notes(made, [])["ratios"]["note"]) == ["own", ""]
    assert list(made["ratios"]["note"]) == ["own", ""]
    assert "note" not in interval_notes.add_notes(made | {"ratios": table.assign(note="")}, [])["ratios"]


@pytest.mark.parametrize("exact", [True, False])
def test_no_note_stands_beside_an_exact_value(exact):
    """Whether the sample agrees with it or not; of a bound, which a filter need not reach, it does."""
    row = {"case": "a", "component": "x", "filter": "f", "n": 5000, "sigma": 1.0, "sigma_lo": 0.9, "sigma_hi": 1.1}
    curves = pd.DataFrame(
        [{**row, "k": k, "n_eff": 20.0, "exact_sigma": of} for k, of in enumerate((1.0, 5.0, np.nan))]
    )
    noted = interval_notes.add_notes({"curves": curves}, [], exact)["curves"]
    assert list(noted["note"]) == ["" if exact else interval_notes.HEAVY_TAILS] * 2 + [interval_notes.HEAVY_TAILS]


S_BAND = (
    *("radar.sigma_range_m=60", "radar.sigma_velocity_mps=3", "radar.scan_period_s=4"),
    "radar.detection_probability=0.9",
)


def test_the_answer_of_a_radar_that_misses_plots_stands_without_a_warning():
    """Its exact values stand beside it: 23 rows were said to rest on 'under 200, the least on 20334'. Only rows next
    to the start, whose errors are heavy-tailed, have a note."""
    result = radarsim.run("rls2", realisations=2000, overrides=list(S_BAND))
    assert not result.warnings
    for table in (result.curves, result.gains):
        assert table["k"][has_note(table)].max() <= 8


def sigma_of(*rows):
    """A sentence that gives the interval of σ in these rows of curves."""
    return Sentence("σ.", tuple(MeasuredInterval("curves", row, "sigma") for row in rows))


def test_warning_is_about_the_intervals_that_the_answer_rests_on():
    """In one line, whatever other rows of whatever table have a note; none where none of its own has."""
    results = [SimpleNamespace(name="a", count=5000)]
    of = [{"case": "a", "component": "x", "k": k, "n": 5000, "filter": f} for f in "fg" for k in range(60)]
    curves = pd.DataFrame(of).assign(sigma=1.0, sigma_lo=0.9, sigma_hi=1.1, n_eff=2500.0)
    curves.loc[20, "n_eff"] = 30.0
    made = interval_notes.add_notes({"curves": curves, "gains": pd.DataFrame()}, results)
    assert has_note(made["curves"]).sum() == 13
    assert not answer_warnings.answer_warnings(results, made, [sigma_of(0, 59, 80)])
    (line,) = answer_warnings.answer_warnings(results, made, [sigma_of(0, 14, 80)])
    assert line == (  # 5000 × 100/30
        "An interval of the answer is too narrow (f): few realisations decide it. Run with -n 2e4."
    )
    (line,) = answer_warnings.answer_warnings(results, made, [sigma_of(14), sigma_of(15, 26, 27), sigma_of(14)])
    assert line.startswith("3 intervals of the answer are too narrow (f): few realisations decide them. ")
    (line,) = answer_warnings.answer_warnings(
        [SimpleNamespace(name="a", count=MIN_TRUSTED_REALISATIONS - 1)], made, [sigma_of(14)]
    )
    assert f"{MIN_TRUSTED_REALISATIONS - 1} realisations are rough" in line


def test_note_on_one_interval_gives_no_warning_of_another():
    row = {"case": "a", "filter": "f", "n": 5000, "sigma_lo": 0.9, "sigma_hi": 1.1, "gain_lo": 1.0, "gain_hi": 3.0}
    made = {
        "stages": pd.DataFrame([row | {"note": interval_notes.HEAVY_TAILS.about("gain")}]),
        "curves": pd.DataFrame(),
    }
    results = [SimpleNamespace(name="a", count=5000)]
    assert str(made["stages"]["note"][0]).startswith("gain: under 100 effective")
    assert not answer_warnings.answer_warnings(results, made, [Sentence("", (MeasuredInterval("stages", 0, "sigma"),))])
    (line,) = answer_warnings.answer_warnings(results, made, [Sentence("", (MeasuredInterval("stages", 0, "gain"),))])
    assert "may be too narrow" in line
    assert "(f)" in line


def test_note_on_what_an_interval_leaves_out_gives_no_warning():
    row = {
        "case": "a",
        "filter": "f",
        "n": 5000,
        "ratio_lo": 0.9,
        "ratio_hi": 1.1,
        "note": interval_notes.BELIEVED_VARIES,
    }
    made = {"believed": pd.DataFrame([row]), "curves": pd.DataFrame()}
    results = [SimpleNamespace(name="a", count=5000)]
    assert not answer_warnings.answer_warnings(
        results, made, [Sentence("", (MeasuredInterval("believed", 0, "ratio"),))]
    )


def test_words_of_notes_and_sentences_change_no_number_and_no_mark(monkeypatch):
    """The same tables, but for the notes' texts, and the same warnings, whatever is written in either."""
    result = radarsim.run("orders", realisations=MIN_TRUSTED_REALISATIONS)
    (warning,) = (line for line in result.warnings if "of the answer" in line)
    other_text = replace(interval_notes.HEAVY_TAILS, text="rarely large")
    for module in (answer_warnings, interval_notes):
        monkeypatch.setattr(module, "HEAVY_TAILS", other_text)
    from radarsim.studies.ambiguous_doppler import answer as ambiguous_doppler_answer

    answer = ambiguous_doppler_answer.answer
    monkeypatch.setattr(
        ambiguous_doppler_answer, "answer", lambda *of: [one.with_text("nothing") for one in answer(*of)]
    )
    again = api_result.Result(result.experiment, result.cases, result.facts)
    assert set(again.answer) == {"nothing"}
    assert list(again.warnings) == list(result.warnings)
    assert warning in again.warnings
    for name, table in result.tables.items():
        expected, numbers = (one.drop(columns="note", errors="ignore") for one in (table, again.tables[name]))
        pd.testing.assert_frame_equal(numbers, expected)
        assert ("note" in table) == ("note" in again.tables[name])
        if "note" in table:
            assert ((table["note"] == "") == (again.tables[name]["note"] == "")).all()


def test_plain_text_of_a_user_study_rests_on_every_filter_at_the_last_scan():
    rows = [{"case": "a", "filter": f, "component": "x", "k": k} for f in "fg" for k in (1, 2)]
    made = {"curves": pd.DataFrame(rows), "gains": pd.DataFrame(rows[2:]).assign(baseline="f")}
    sentence = as_sentence("Done.", made)
    assert str(sentence) == "Done."
    assert set(sentence.intervals) == {("curves", 1, "sigma"), ("curves", 3, "sigma"), ("gains", 1, "gain")}
    assert as_sentence(sigma_of(2), made) == sigma_of(2)


def check_notes_and_warning(config):
    """Of a shipped config: no note beside an exact value; a warning at most, on intervals that are in the answer."""
    result = radarsim.run(config, realisations=MIN_TRUSTED_REALISATIONS)
    study, made = registry.study(result.experiment.study), result.tables
    for table in made.values():
        exact = [name for name in table if name in ("exact_sigma", "exact_percent", "exact_right")]
        if "note" in table and exact and study.exact_errors:
            assert not table.loc[table[exact].notna().all(axis=1), "note"].any()
    warnings = [line for line in result.warnings if "of the answer" in line]
    assert len(warnings) <= 1
    assert not any("rare event" in line for line in result.warnings)
    answer = [one for one in study.answer(result.cases, made) if not isinstance(one, str)]
    assert len(answer) == len(study.answer(result.cases, made))  # no shipped study leaves it open
    for table, row, name in (interval for sentence in answer for interval in sentence.intervals):
        columns = [column for column in made[table] if str(column).startswith(name)]
        assert {f"{name}_lo", f"{name}_hi"} <= set(columns) or {"lo", "hi"} <= set(made[table])
        assert row in made[table].index
    rows = answer_warnings.affected_rows(result._tables, answer).values()
    assert bool(warnings) == bool(rows)
    for line in warnings:
        count = re.match(r"An |[\d,]+", line)[0].replace("An ", "1")
        assert int(count.replace(",", "")) == sum(map(len, rows))
        names = list(dict.fromkeys(name for of in rows for name in of["filter"]))
        assert all(name in line for name in names[:3])


@pytest.mark.slow_cases("sonar_missed")
@pytest.mark.parametrize(
    "config", [pytest.param("ambiguous_missed", marks=pytest.mark.slow), "pulses_rls4", "sonar_missed", "rls2"]
)
def test_warning_is_true_of_the_answer(config):
    check_notes_and_warning(config)


@pytest.mark.slow
@pytest.mark.parametrize("config", sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml")))
def test_warning_is_true_of_the_answer_of_every_shipped_config(config):
    check_notes_and_warning(config)


def test_notes_say_what_their_rows_have():
    """Under a hundred: each marked row has so few, there or within a tenth of the run, and no other has."""
    made = radarsim.run("multimodel_1hz", realisations=1000).curves
    fewest = interval_notes.fewest_effective_nearby(made)
    np.testing.assert_array_equal(made["note"] != "", fewest < interval_notes.MIN_EFFECTIVE)
    assert set(made["note"]) == {"", str(interval_notes.HEAVY_TAILS)}


def test_filters_whose_names_hold_a_comma_are_told_apart():
    results = [SimpleNamespace(name=name, count=MIN_TRUSTED_REALISATIONS - 1) for name in ("PDA", "PDA, 4 of 6")]
    assert answer_warnings.few_realisations_warning(results)[0].startswith("PDA and “PDA, 4 of 6”: ")
