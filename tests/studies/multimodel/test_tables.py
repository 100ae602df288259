"""P2's tables, figures and claims, on a small run of the shipped config."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api import result_content
from radarsim.language.current import use_language
from radarsim.papers.claims_table import NOT_JUDGED
from radarsim.papers.multimodel.measures import Evidence
from radarsim.papers.study_claims import claims_of
from radarsim.papers.verdict_rule import CONFIRMED
from radarsim.report import typeset
from radarsim.report.drawing import canvas as drawing_canvas
from radarsim.report.drawing.model import Line, Note
from radarsim.report.statistics import Estimate
from radarsim.studies.multimodel import STUDY, answer, figures, stage_ranking
from tests.answers import answer_texts
from tests.tolerances import assert_rounded, rounding

CLAIMS = claims_of(STUDY).claims


@pytest.fixture(scope="module")
def result():
    return radarsim.run("multimodel", realisations=16)


def test_tables_have_the_contracts_columns(result):
    columns = ["case", "filter", "model", "k", "t_s", "n", "probability", "probability_lo", "probability_hi"]
    assert list(result.tables["probabilities"].columns[:9]) == columns
    assert set(result.curves["component"]) == {"x", "vx", "ax", "y", "vy", "ay", "z", "vz", "az"}
    assert list(result.curves["k"].unique()) == [*range(10, 3725, 10), 3725]
    assert result.curves["exact_sigma"].isna().all()
    assert set(result.gains["baseline"]) == {"MMA2-122"}


def test_probabilities_sum_to_one(result):
    rows = result.tables["probabilities"]
    assert set(rows["filter"]) == {"MMA2-122", "MMA2-11"}
    total = rows.groupby(["filter", "k"])["probability"].sum()
    assert np.allclose(total, 1, rtol=0, atol=rounding(operations=2 * result.cases[0].count))
    assert (rows["probability_lo"] <= rows["probability"]).all()


def test_stages_are_the_mean_squares_of_the_curves(result):
    rows = result.tables["stages"].set_index(["filter", "stage", "component"])
    curve = result.curves[(result.curves["filter"] == "Kalman-2 1") & (result.curves["component"] == "y")]
    inside = curve[(curve["t_s"] >= 20) & (curve["t_s"] < 125)]
    assert np.isclose(
        rows.loc[("Kalman-2 1", "ballistic", "y"), "sigma"], np.sqrt((inside["sigma"] ** 2).mean()), rtol=0.1
    )
    assert len(rows) == 6 * 4 * 9


def test_operations_and_consistency(result):
    rows = result.tables["operations"].set_index(["filter", "stage"])["operations"]
    assert rows["Kalman-1 5", "whole"] == 366
    assert rows["Kalman-2 1", "whole"] == 738
    assert 366 + 2 * 738 < rows["MMA2-122", "ballistic"] < rows["MMA2-122", "manoeuvre"]
    nis = result.tables["consistency"].set_index(["filter", "stage"])["nis"]
    assert abs(nis["Kalman-2 20", "ballistic"] - 1) < 0.1
    assert nis["Kalman-1 5", "manoeuvre"] > 10


def test_gains_between_any_two_filters_are_paired(result):
    (case,) = result.cases
    evidence = Evidence(result.cases, result.tables, {case.name: {"filters": set(range(len(case.axes.filters)))}})
    (key,) = CLAIMS[0].parts[0].cases
    gain = evidence.stage_gain(key, key[2][0], key[2][3], "ballistic", "y")
    s = np.array(case.sums["stage"])[[0, 3], 1, 3, 0] / case.count
    assert_rounded(gain.value, 100 * (1 - np.sqrt(s[0] / s[1])), size=100, operations=6)
    assert gain.lo < gain.value < gain.hi


def test_claims_of_this_config_are_judged_and_no_others(result):
    rows = result.tables["claims"]
    assert set(rows["claim"]) == {c.id for c in CLAIMS if c.config == "multimodel"}
    assert (rows.loc[rows["claim"] == "P2.11", "verdict"] == CONFIRMED).all()


@pytest.mark.slow
def test_other_flights_have_no_claims(result):
    changed = radarsim.run("multimodel", realisations=8, overrides=["target.lag_s=2"])
    table = changed.tables["claims"]
    assert table["class"].eq(NOT_JUDGED).all()
    assert table["reason"].str.contains("target.lag_s is 2, the paper's 1").all()


def test_figures_are_described(result):
    # `families` needs two families and rules.
    assert set(result.figures) == {*STUDY.keys().figure_names, "claims"} - {"families"}
    assert result.figure("trajectory") is not None
    for panel in result._figures_by_name["sigma_y"].panels:
        tops = [(mark.text, mark.x) for mark in panel.marks if isinstance(mark, Note) and mark.place == "top"]
        end = float(result.cases[0].axes.t_s[-1])
        assert tops == [("start", 10), ("ballistic", 72.5), ("manoeuvre", 147.5), ("after", (170 + end) / 2)]


def test_one_flight_is_drawn_once_however_often_a_plot_comes(result):
    case = result.cases[0]
    rows = slice(1, None, 3)
    axes = replace(case.axes, t_s=case.axes.t_s[rows], truth=case.axes.truth[rows], stage=case.axes.stage[rows])
    thinned = replace(case, axes=axes)
    other = replace(thinned, axes=replace(axes, truth=1.1 * axes.truth))
    for cases, counts in (
        ((thinned, case), [len(case.axes.t_s)]),
        ((case, other), [len(case.axes.t_s), len(axes.t_s)]),
    ):
        marks = figures.trajectory(cases).panels[0].marks
        assert [len(mark.x) for mark in marks if isinstance(mark, Line) and mark.style.dash is not None] == counts


@pytest.mark.slow
def test_all_stages_are_named_and_their_names_do_not_overlap():
    result = radarsim.run("multimodel_recorded", realisations=3)
    names = ("начало", "прямая", "разворот", "набор высоты", "обратный разворот", "после")
    with use_language("ru"):
        case_figures = result_content.case_figures(result.cases, result.tables, result.experiment)
    for figure_name in ("sigma_y", "trajectory"):
        canvas = drawing_canvas.render(case_figures[figure_name])
        (*_, axes) = canvas.axes
        boxes = [text.get_window_extent() for text in axes.texts if text.get_text() in names]
        assert len(boxes) == len(names)
        assert not any(a.overlaps(b) for n, a in enumerate(boxes) for b in boxes[n + 1 :])


def test_answer_names_the_filter_closest_to_the_best_of_each_stage(result):
    first, following, height, climb = answer_texts(answer, result.cases, result.tables)
    for stage in ("start", "ballistic", "manoeuvre", "after"):
        assert stage in height
        assert stage in climb
    assert "m/s [" in climb
    stages = result.tables["stages"]
    wide = stages[stages["component"] == "y"].pivot_table(index="stage", columns="filter", values="sigma")
    above = 100 * (wide.div(wide.min(axis=1), axis=0) - 1)
    (best, smallest), (second, more) = above.max().sort_values().iloc[:2].items()
    stage, looks = above[best].idxmax(), wide.size
    together = f"95 % for all {looks} comparisons together"
    least = "above the least of a stage ("
    assert first.startswith(f"{best} is best overall: its RMS height error is at most {smallest:#.3g} % [")
    assert first.endswith(f"] {least}{stage}; {together}).")
    assert following.startswith(f"Next is {second}, whose RMS height error is up to {more:#.3g} % [")
    assert following.endswith(f"] {least}{above[second].idxmax()}; {together}).")
    gain = stage_ranking.paired_gain(result.cases[0], stage, best, wide.loc[stage].idxmin())
    low, high = (float(end) for end in re.search(r" % \[(.*?), (.*?)\]", first).groups())
    assert low < -gain.hi < -gain.lo < high  # paired on the same noise, and wider, as it was chosen
    every = f"95 % for all {wide.shape[1]} filters together"
    assert height.startswith(f"Least RMS error of the height by stage ({every}): start: ")


def test_least_of_what_noise_orders_is_not_ranked(monkeypatch):
    """Filters that are equal, or whose order another seed may turn, are named together; nothing is called closest."""
    names, gains = ["a", "same", "near", "far"], {"same": (0, 0), "near": (-2.99, 2.7), "far": (5, 9)}
    stages = pd.DataFrame({"filter": names, "sigma": [10.0, 10.0, 10.01, 11.0]})
    stages = stages.assign(case="one", stage="start", sigma_lo=1.0, sigma_hi=99.0, component="y", unit="m")

    def paired_gain(result, stage, name, other, component="y"):
        low, high = gains[other] if name == "a" else sorted(-end for end in gains[name])
        return Estimate((low + high) / 2, low, high)

    monkeypatch.setattr(stage_ranking, "paired_gain", paired_gain)
    case = SimpleNamespace(name="one", swept_values=(), spec=SimpleNamespace(device=""))
    assert stage_ranking.least_filters(case, stages, stages.iloc[0]) == ("a = “same”", "“near”")
    sentence, *_ = answer_texts(answer, [case], {"stages": stages})
    assert sentence.startswith(
        "Least RMS error of the height by stage (95 % for all 3 filters together): start: a = “same”, 10 m ["
    )
    assert sentence.endswith("] (not distinguished from “near”).")

    sentence, *_ = answer_texts(answer, [case], {"stages": stages[:2]})
    assert sentence == "RMS error of the height by stage: start: a = “same”, 10.0 m [1.0, 99.0]."  # nothing is least


def test_answer_on_several_cases_names_the_best_overall(monkeypatch):
    """Of the filters that all cases have; one that is best everywhere is never above the least."""
    rows = [  # a is 10 % above the least, b up to 100 %
        *(("one", "start", "a", 11.0), ("one", "start", "b", 10.0), ("one", "start", "only here", 1.0)),
        *(("two", "start", "a", 10.0), ("two", "start", "b", 20.0)),
    ]
    columns = {"sigma_lo": 1.0, "sigma_hi": 99.0, "component": "y", "unit": "m"}
    stages = pd.DataFrame(rows, columns=["case", "stage", "filter", "sigma"]).assign(**columns)
    cases = [SimpleNamespace(name=name, swept_values=(), spec=SimpleNamespace(device="")) for name in ("one", "two")]
    sigma = stages.set_index(["case", "stage", "filter"])["sigma"]

    def paired_gain(result, stage, name, other, component="y"):
        gain = 100 * (1 - sigma[result.name, stage, name] / sigma[result.name, stage, other])
        return Estimate(gain, gain - 1, gain + 1)

    monkeypatch.setattr(stage_ranking, "paired_gain", paired_gain)
    assert answer_texts(answer, cases, {"stages": stages}) == [
        "a is best overall: its RMS height error is at most 10.0 % [8.7, 11.3] above the least of a stage "
        "(one, start; 95 % for all 4 comparisons together).",
        "Next is b, whose RMS height error is up to 100 % [99, 101] above the least of a stage (two, start; 95 % for "
        "all 4 comparisons together).",
    ]
    single_answer = answer_texts(answer, cases, {"stages": stages[stages["filter"] == "b"]})
    assert single_answer == [
        "one, RMS error of the height by stage: start: b, 10.0 m [1.0, 99.0].",
        "two, RMS error of the height by stage: start: b, 20.0 m [1.0, 99.0].",
    ]
    vy_stages = pd.concat([stages[3:], stages[3:].assign(component="vy")], ignore_index=True)
    sentence, *_ = answer_texts(answer, cases[1:], {"stages": vy_stages})
    assert sentence == (
        "a is best overall: its RMS height error is the least in every stage; that of the next, b, is up to 100 % "
        "[99, 101] above it (start; 95 % for both comparisons together)."
    )


def test_answer_names_the_filters_among_which_noise_decides(monkeypatch):
    """Of several cases the stages of each follow, after the name of the case."""
    sigma = {("one", "a"): 10.0, ("one", "b"): 12.0, ("two", "a"): 12.1, ("two", "b"): 10.0}
    rows = [(case, "start", name, size) for (case, name), size in sigma.items()]
    columns = {"sigma_lo": 1.0, "sigma_hi": 99.0, "component": "y", "unit": "m"}
    stages = pd.DataFrame(rows, columns=["case", "stage", "filter", "sigma"]).assign(**columns)

    def paired_gain(result, stage, name, other, component="y"):
        gain = 100 * (1 - sigma[result.name, name] / sigma[result.name, other])
        return Estimate(gain, gain - 30, gain + 30)

    monkeypatch.setattr(stage_ranking, "paired_gain", paired_gain)
    cases = [SimpleNamespace(name=name, swept_values=(), spec=SimpleNamespace(device="")) for name in ("one", "two")]
    undecided, least, *of_cases = answer_texts(answer, cases, {"stages": stages})
    assert undecided == (
        "No filter is surely best overall in RMS height error: b and a are not distinguished (95 % for all 4 "
        "comparisons together)."
    )
    assert least.startswith("The RMS height error of b is never more than 20.0 % [")
    assert least.endswith(
        "] above the least of a stage (one, start, where a is best; 95 % for all 4 comparisons together)."
    )
    assert [text.partition(" by stage")[0] for text in of_cases] == [
        f"{name}, least RMS error of the height" for name in ("one", "two")
    ]


def test_time_per_update_is_only_in_the_record_and_the_report(tmp_path):
    """Counted operations are a table; what a clock measured is none."""
    radarsim.run("multimodel_1hz", realisations=8, out=tmp_path, figures=False)
    folder = tmp_path / "multimodel_1hz"
    (measured,) = json.loads((folder / "run.json").read_text())["seconds_per_update"].values()
    assert list(measured) == ["MMA2-122", "MMA2-11", "Kalman-1 20", "Kalman-1 5", "Kalman-2 20", "Kalman-2 1"]
    assert all(seconds > 0 for seconds in measured.values())
    page = (folder / "report.html").read_text()
    assert "Cost versus accuracy" in page
    assert typeset.cell_text(1e9 * measured["Kalman-2 1"]) in page
    assert not any("measured, ns" in path.read_text() for path in folder.glob("*.csv"))


def test_rules_whose_points_coincide_share_a_name():
    rules, families = ("best", "combined", "modified_combined"), ("gpb1", "imm", "gpb2")
    designs = [SimpleNamespace(family=family, merge=rule, models=()) for family in families for rule in rules]
    names = [f"{design.family} {design.merge}" for design in designs]
    result = SimpleNamespace(name="c", axes=SimpleNamespace(filters=names), spec=SimpleNamespace(filters=designs))
    table = pd.DataFrame({"case": "c", "stage": "start", "filter": names, "component": "y"})
    table["operations"] = [1000.0, 2000.0, 2001.0] * 3
    table["sigma"] = [90.0, 50.0, 50.1] * 3
    table["sigma_lo"], table["sigma_hi"] = table["sigma"] - 1, table["sigma"] + 1
    figure = figures.cost([result], {"stages": table, "operations": table})
    assert [text for text, _ in figure.panels[-1].keys][:2] == ["best", "combined = modified combined"]
    assert len(figure.panels[0].marks) == 6
