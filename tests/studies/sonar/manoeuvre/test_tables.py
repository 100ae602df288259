"""Tables, figures, claims and words of manoeuvres from a small run of the shipped config."""

import numpy as np
import pytest

import radarsim
from radarsim.api import result_content
from radarsim.api.configs import load
from radarsim.papers.sonar.manoeuvre import measures as measured
from radarsim.papers.verdict_rule import REFUTED
from radarsim.report import case_selection, wording
from radarsim.report.drawing import canvas
from radarsim.report.drawing.model import Reference
from radarsim.studies.sonar import STUDY
from radarsim.studies.sonar.closed_forms import sigma_acceleration
from radarsim.studies.sonar.manoeuvre import detection_laws
from tests.answers import answer_texts
from tests.studies.sonar.precision import PARABOLA, TERMS
from tests.tolerances import assert_rounded, sigma_error

N = 2000
OWN = {"roc", "detection", "delay", "modes", "uses"}
ACCELERATIONS = [0, 0.2138, 0.8]


@pytest.fixture(scope="module")
def result():
    swept = f"sweep.target.acceleration_mps2={ACCELERATIONS}"
    return radarsim.run(load("sonar_manoeuvre", [swept, f"realisations={N}"]))


@pytest.fixture(scope="module")
def tables(result):
    return result.tables


def case(acceleration):
    return f"sonar_manoeuvre target.acceleration_mps2={acceleration}"


def test_detections_lie_about_the_exact_law(tables):
    rows = tables["detections"]
    assert list(rows.columns[:9]) == [
        *("case", "filter", "component", "plots", "threshold_k", "false_alarm_probability", "k", "t_s", "n")
    ]
    assert (rows["n"] == N).all()
    inside = (rows["probability_lo"] <= rows["exact_probability"]) & (
        rows["exact_probability"] <= rows["probability_hi"]
    )
    assert 0.93 < inside.mean() < 0.985  # discrete counts: Wilson's intervals cover somewhat unevenly
    assert set(rows["component"]) == {"r", "b", "joint"}
    assert set(rows[rows["case"] == case(0)]["phase"]) == {"steady"}
    assert set(rows[rows["case"] == case(0.8)]["phase"]) == {"steady", "manoeuvre", "after"}
    whole = rows[(rows["case"] == case(0.2138)) & (rows["filter"] == "5 plots") & (rows["component"] == "r")]
    assert whole[whole["k"] == 27]["shift"].to_numpy() == pytest.approx(1.0, rel=5e-5 / 0.2138)  # its four digits


def test_delays_grow_to_the_class(tables):
    rows = tables["delays"]
    one = rows[(rows["case"] == case(0.8)) & (rows["filter"] == "5 plots") & (rows["component"] == "r")]
    one = one[(one["event"] == "alarm") & np.isclose(one["false_alarm_probability"], 0.01)]
    assert one["delay_s"].to_list() == [5.0 * i for i in range(1, 9)]
    assert (one["probability"].diff().dropna() >= 0).all()
    assert one["exact_probability"].isna().all()
    apart = rows[(rows["filter"] == "4 plots, apart") & (rows["event"] == "alarm")]
    assert (
        (apart["probability_lo"] <= apart["exact_probability"])
        & (apart["exact_probability"] <= apart["probability_hi"])
    ).mean() > 0.8
    named = tables["classes"].set_index(["case", "filter", "component", "false_alarm_probability", "truth"])
    row = named.loc[(case(0.8), "5 plots", "r", one["false_alarm_probability"].iloc[0], "manoeuvre")]
    assert row["called_manoeuvring_share"] == one["probability"].iloc[-1]
    assert_rounded(row["error_probability"], 1 - row["called_manoeuvring_share"], size=1.0)
    assert row["error_probability_lo"] <= row["error_probability"] < row["error_probability_hi"]
    assert row["duration_s"] == 40
    assert set(tables["classes"][tables["classes"]["case"] == case(0)]["truth"]) == {"steady"}


def test_thresholds_are_the_laws(tables):
    rows = tables["thresholds"]
    rows = rows[(rows["case"] == case(0)) & (rows["filter"] == "8 plots") & (rows["component"] == "r")]
    row = rows[np.isclose(rows["false_alarm_probability"], 0.01)].iloc[0]
    assert row["threshold_k"] == pytest.approx(6.6349, abs=5e-5)
    k, sigma = row["threshold_k"], 10 * sigma_acceleration(8.0, 5.0)
    assert_rounded(row["sigma_acceleration"], sigma, condition=PARABOLA, operations=8 * TERMS)
    assert_rounded(row["threshold_acceleration"], np.sqrt(k) * row["sigma_acceleration"], operations=4)
    reach = row["acceleration_for_90_percent"] / row["sigma_acceleration"]
    assert detection_laws.detection(k, reach) == pytest.approx(0.9, abs=1e-12)  # the search's precision
    variance = k * 720 / (5.0**4 * 8 * 63 * 60)
    assert_rounded(row["threshold_to_plot_variance"], variance, condition=PARABOLA, operations=8 * TERMS)


def test_modes_and_memory(tables):
    rows = tables["modes"].set_index(["case", "filter", "component", "k"])
    assert rows.loc[(case(0), "degree by 5", "r", 4), "memory_plots"] == 4
    assert rows.loc[(case(0), "degree by 5", "r", 4), "probability"] == 0
    assert rows.loc[(case(0.8), "degree by 8", "r", 28), "probability"] > 0.98
    assert rows.loc[(case(0.8), "degree by 8", "r", 28), "memory_plots"] < 15
    assert rows.loc[(case(0), "degree by 8", "r", 45), "memory_plots"] > 25
    assert np.isnan(rows.loc[(case(0.8), "imm", "r", 28), "memory_plots"])
    assert rows.loc[(case(0.8), "imm", "r", 28), "probability"] > 0.8


def test_uses_tell_where_the_first_order_holds_and_where_not(tables):
    rows = tables["uses"].set_index(["case", "filter", "component", "t_s"]).sort_index()
    good = rows.xs((case(0), "growing")).xs(220.0, level="t_s")
    assert good["ratio"].to_numpy() == pytest.approx(1, abs=sigma_error(N))
    assert set(good["first_order"]) == {"holds within 5 %"}
    near = rows.loc[(case(0), "window 5", "cpa", 220.0)]
    assert near["first_order"] == "fails: near zero"
    assert near["distance_in_sigma"] < 3
    assert near["ratio"] < 0.8
    assert (rows["n"] == N).all()
    assert rows.loc[(case(0.8), "growing", "speed", 140.0), "first_order"] == "error larger"


@pytest.mark.slow
def test_figures_draw(result):
    described = result_content.case_figures(result.cases, result.tables, result.experiment)
    assert set(described) >= OWN
    for name in OWN:
        assert canvas.render(described[name]).axes
        assert described[name].caption.endswith(".")


def test_a_case_without_detectors_has_its_own_figures_alone():
    changes = ["detectors=[]", "sweep.target.acceleration_mps2=[0.4]", "uses.at_s=[100]", "realisations=64"]
    made = load("sonar_manoeuvre", changes)
    result = radarsim.run(made)
    described = result_content.case_figures(result.cases, result.tables, result.experiment)
    assert OWN & set(described) == {"modes", "uses"}
    assert "detections" not in result.tables
    assert STUDY.question(made).startswith("How well are course, speed")


def test_cases_in_several_frames_stand_side_by_side():
    result = radarsim.run(
        load("sonar_manoeuvre_turning", ["sweep.target.turns.0.rate_radps=[0.07]", "realisations=64"])
    )
    described = result_content.case_figures(result.cases, result.tables, result.experiment)
    assert [panel.title for panel in described["modes"].panels[:2]] == ["4.01°/s, polar", "4.01°/s, cartesian unbiased"]
    for name in ("sigma_r", "sigma_x"):
        dotted = [mark.value for mark in described[name].panels[0].marks if isinstance(mark, Reference)]
        assert dotted == list(result.cases[0].axes.manoeuvre_s)
        assert "Dotted: beginning and end of the manoeuvre." in described[name].caption
    assert {"roc", "detection", "delay", "modes"} <= set(described)
    assert result.tables["detections"]["exact_probability"].isna().mean() == 0.5


def test_a_detector_that_never_has_its_plots():
    missed = "sensor.missed_scans=[3, 4, 5, 6]"
    changes = ["scans=6", "detectors=[{name: d, plots: 5, threshold_k: [1.0]}]", "uses={horizon_s: 60}", missed]
    changes += ["filters=[{name: g, kind: growing_memory}]", "target.start_s=10", "realisations=64"]
    made = load("sonar_manoeuvre", [*changes, "sweep.target.acceleration_mps2=[0.8]"])
    result = radarsim.run(made)
    assert "detections" not in result.tables
    assert set(result_content.case_figures(result.cases, result.tables, made)) & OWN == {"uses"}
    assert answer_texts(STUDY, result.cases, result.tables)


def test_claims_are_judged(result, tables):
    rows = tables["claims"]
    assert set(rows["claim"]) == {"P3.8", "P3.9", "P3.10"}
    row = rows[rows["claim"] == "P3.9"].iloc[0]
    assert row["lo"] < 0.523 < row["hi"]
    assert row["verdict"] == REFUTED
    ratios = rows[rows["quantity"].str.startswith("acceleration at the threshold")]["measured"]
    assert ratios.to_numpy() == pytest.approx([0.5345, 0.2887], abs=5e-5)
    strong = result.cases[2]
    delays = tables["delays"]
    own = delays[(delays["case"] == strong.name) & (delays["filter"] == "8 plots") & (delays["component"] == "r")]
    own = own[(own["event"] == "alarm") & np.isclose(own["false_alarm_probability"], 0.01)]
    # Mean of a time cut at the end: the area over the probability that it has come.
    mean = 5 + 5 * (1 - own["probability"].to_numpy()[:-1]).sum()
    assert_rounded(measured.mean_delay(strong, 8).value, mean, size=5.0 * len(own), operations=3 * len(own))


def test_words(result, tables):
    told = answer_texts(STUDY, result.cases, tables)
    assert STUDY.question(result.experiment).startswith("How soon and how surely is a manoeuvre detected")
    assert any("10 plots" in sentence for sentence in told)
    assert any(
        sentence.startswith("Ratio of the RMS error to that predicted by the track's covariance (“growing”, ")
        for sentence in told
    )
    assert all(sentence.endswith(".") for sentence in told)


def test_the_answer_has_the_time_to_an_alarm_and_that_of_false_ones(result, tables):
    """Against the rows that the figure `delay` draws."""
    told = answer_texts(STUDY, result.cases, tables)
    delays = tables["delays"]
    rows = delays[(delays["component"] == "r") & np.isclose(delays["false_alarm_probability"], 0.01)]
    strongest = rows[rows["case"] == result.cases[-1].name].groupby(["event", "filter"])
    (before,) = [
        sentence for sentence in told if sentence.startswith("False alarm within the 100 s before the manoeuvre")
    ]
    (during,) = [
        sentence for sentence in told if sentence.startswith("a = 0.8 m/s², alarm by the end of the manoeuvre")
    ]
    for name in ("10 plots", "4 plots"):
        alarms, false = (strongest.get_group((event, name)) for event in ("alarm", "false alarm"))
        half_s = alarms.loc[alarms["probability"] >= 0.5, "delay_s"].iloc[0]
        assert f"“{name}” in {share_text(alarms)} of realisations, in half of them within {half_s:g} s" in during
        assert f"“{name}” in {share_text(false)} of realisations" in before


def share_text(rows):
    """The share at the last scan, as sentences write it."""
    return wording.share(*(100 * rows.iloc[-1][f"probability{end}"] for end in ("", "_lo", "_hi")))


def test_of_many_cases_the_ends_are_shown():
    assert case_selection.pick_evenly(list(range(10)), 3) == [0, 4, 9]
    assert case_selection.pick_evenly([1, 2], 3) == [1, 2]


def test_an_answer_of_many_cases_tells_the_ends():
    assert case_selection.select_reported([1, 2, 3]) == ([1, 2, 3], [])
    assert case_selection.select_reported([1, 2, 3], 2) == ([1, 3], ["The other case is in the tables."])
    assert case_selection.select_reported([1, 2, 3, 4]) == ([1, 4], ["The other 2 cases are in the tables."])
