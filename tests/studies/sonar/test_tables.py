"""P3's tables, figures and claims from small runs: the right rows, the right words, verdicts from intervals."""

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api import result_content
from radarsim.papers.study_claims import claims_of
from radarsim.papers.verdict_rule import CONFIRMED, REFUTED
from radarsim.report import statistics
from radarsim.report.drawing import canvas
from radarsim.studies.sonar import STUDY, closed_forms, plot_errors
from radarsim.studies.sonar.smoothing_figures import conversion_figure, plots_figure
from tests.studies.sonar import counted_operations as counted
from tests.studies.sonar.precision import LINE, TERMS
from tests.tolerances import Z, assert_rounded, scaled_condition, sigma_error

FIGURES = {
    "sonar_smoothing": {"plots", "smoothing_gains", "sigma_r", "sigma_vb"},
    "sonar_correlated": {"believed", "sigma_r"},
    "sonar_missed": {"missed", "sigma_b"},
    "sonar_conversion": {"conversion", "sigma_x", "sigma_vy"},
    "sonar_fluctuating": {"sweep_target", "sigma_r"},
}


@pytest.fixture(scope="module")
def results():
    return {stem: radarsim.run(stem, realisations=3000) for stem in FIGURES}


def test_each_config_has_its_figures_and_they_draw(results):
    for stem, wanted in FIGURES.items():
        described = result_content.case_figures(results[stem].cases, results[stem].tables, results[stem].experiment)
        assert wanted <= set(described)
        for name in wanted & {"plots", "believed", "missed", "conversion", "smoothing_gains"}:
            drawn = canvas.render(described[name])
            assert drawn.axes
            assert described[name].caption


def test_filters_of_equal_accuracy_are_named_together(results):
    """Without process noise the Kalman filter is growing memory; and what is asked is answered first."""
    first, *_, optimistic, _ = results["sonar_fluctuating"].answer
    assert "least with “growing” and “kalman”, " in first
    start = (
        "Most optimistic filter from the manoeuvre on (120 s): “growing” and “kalman” (target = sonar turning), whose "
    )
    assert optimistic.startswith(f"{start}RMS error is ")
    first, second, *_ = results["sonar_correlated"].answer
    assert first.startswith("Most optimistic filter from the first scan on: “naive” (ρ = 0.9")
    curves = results["sonar_correlated"].tables["curves"]
    assert f" {(curves['exact_sigma'] / curves['believed_sigma']).max():.3g} times" in first
    assert "least with “augmented” and “differenced”, " in second


def test_the_answer_on_missed_plots_has_what_they_cost(results):
    """At half of the plots against all; the scans without a plot miss it in both."""
    first, note, *_ = results["sonar_missed"].answer
    curves = results["sonar_missed"].curves.query("component == 'r'")
    final = curves[curves["k"] == curves["k"].max()].pivot(
        index="filter", columns="case", values=["sigma", "exact_sigma"]
    )
    ends = [f"sonar_missed sensor.detection_probability={p}" for p in ("0.5", "1")]
    ratios = final["sigma"][ends[0]] / final["exact_sigma"][ends[1]]
    assert first.startswith("P_D = 0.5, RMS error of the range after 95 s relative to that at P_D = 1 (95 % for all ")
    assert f": {ratios.min():.2f} [" in first
    assert f"] (“{ratios.idxmin()}”) to {ratios.max():.2f} [" in first
    assert note == "Scans 8, 9, 10 are always missed, at P_D = 1 too."


def test_the_answer_on_accuracy_has_range_and_bearing(results):
    starts = [sentence.partition(" after ")[0] for sentence in results["sonar_smoothing"].answer[:2]]
    assert starts == ["RMS error of the range", "RMS error of the bearing"]


def test_the_answer_on_conversion_is_the_largest_bias_and_its_figure_has_several(results):
    table = results["sonar_conversion"].tables["conversion"]
    plain = table[table["frame"] == "cartesian"]
    worst = plain.loc[plain["formula_m"].abs().idxmax()]
    told = results["sonar_conversion"].answer[0]
    bias, ratio = worst["formula_m"], worst["formula_m"] / worst["sigma_range_m"]
    words = f"conversion up to {bias:.3g} m, {ratio:.3g} σ of the range (σ_β = 8°); with".replace("-", "−")
    assert f"{words} the unbiased one none." in told
    half_width = (plain["bias_m_hi"] - plain["bias_m_lo"]) / 2
    assert ((plain["bias_m"] - plain["formula_m"]).abs() < 2 * half_width).all()  # so that it may be called exact
    assert conversion_figure(table[table["across_m"] == table["across_m"].max()]) is None


def test_what_a_plot_buys_has_the_papers_formulas(results):
    table = results["sonar_smoothing"].tables["plots"]
    rows = table[(table["degree"] == 1) & (table["component"] == "b") & (table["quantity"] == "smoothed")]
    assert (rows["formula"] == closed_forms.sigma_smoothed(rows["plots"])).all()
    assert rows["ratio"].to_numpy() == pytest.approx(rows["formula"].to_numpy(), rel=sigma_error(3000))
    rows = table[(table["quantity"] == "acceleration") & (table["component"] == "r")]
    assert rows["ratio"].to_numpy() == pytest.approx(rows["formula"].to_numpy(), rel=sigma_error(3000))


def test_believed_and_consistency(results):
    made = results["sonar_correlated"].tables
    case = "sonar_correlated sensor.error_correlation=0.9"
    rows = made["consistency"].set_index(["case", "filter", "component", "k"])
    naive, aware = rows.loc[(case, "naive", "r", 20)], rows.loc[(case, "augmented", "r", 20)]
    assert naive["nees_verdict"] == "optimistic"
    assert naive["nees_lo"] < naive["exact_nees"] < naive["nees_hi"]
    errors = np.linalg.cond(plot_errors.error_covariance(np.ones(20), 0.9, np.arange(20.0), 1.0))
    assert_rounded(aware["exact_nees"], 1.0, condition=LINE * errors, operations=20 * TERMS)
    row = made["curves"].set_index(["case", "filter", "component", "k"]).loc[(case, "naive", "r", 20)]
    assert row["believed_sigma"] == pytest.approx(30 * 0.4309, abs=30 * 5e-5)  # four printed digits
    assert row["sigma"] / row["believed_sigma"] == pytest.approx(1.0377 / 0.4309, rel=sigma_error(3000))


def test_conversion_table(results):
    table = results["sonar_conversion"].tables["conversion"]
    plain = table[table["frame"] == "cartesian"]
    assert_rounded(plain["formula_m"], 15e3 * np.expm1(-(plain["sigma_bearing_rad"] ** 2) / 2), operations=6)
    assert (table[table["frame"] != "cartesian"]["formula_m"] == 0).all()
    middle, half = (table["bias_m_hi"] + table["bias_m_lo"]) / 2, (table["bias_m_hi"] - table["bias_m_lo"]) / 2
    assert (np.abs(middle - table["formula_m"]) < Z / statistics.Z95 * half).all()


def test_operations_are_counted(results):
    table = results["sonar_smoothing"].tables["operations"].set_index("algorithm")
    found = {"recursion (12)-(14)": counted.recursion(), "Kalman (11), degree 1": counted.kalman_of(2)}
    found |= {"differenced": counted.differenced(), "augmented": counted.augmented()}
    found |= {f"least squares (2) on {n} plots": counted.batch_of(n) for n in (2, 3, 5, 6, 10)}
    assert set(found) == set(table.index)
    for name, of in found.items():
        assert table.loc[name, ["products", "sums", "operations"]].tolist() == [of.products, of.sums, of.total]


def test_counted_formulas_are_the_filters():
    """What is counted computes: recursion and batch agree with each other on numbers."""
    numbers = counted.Number
    tally = counted.Tally()

    def wrap(values):
        return [numbers(float(v), tally) for v in values]

    times, plots, weights = [0, 1, 2.5, 3], [3.0, 5.2, 7.9, 9.1], [1.0, 0.5, 2.0, 1.0]
    memory, estimate = wrap([1, 0, 0, 0]), wrap([3.0, 0])
    for k in range(1, 4):
        step = wrap([times[k] - times[k - 1]])[0]
        u, w = wrap([plots[k]])[0], wrap([weights[k]])[0]
        memory, estimate = counted.line_step(memory, estimate, u, w, step)
    anew = counted.batch(wrap(times), wrap(plots), wrap(weights))
    A = np.vander(np.array(times) - times[-1], 2, increasing=True)
    kappa = scaled_condition(np.linalg.inv((A.T * weights) @ A))
    size = np.full(2, max(plots))
    assert_rounded([n.value for n in estimate], [n.value for n in anew], size, kappa, operations=4 * TERMS)


def test_claims_are_judged_where_their_cases_are(results):
    found = {stem: set(result.tables["claims"]["claim"]) for stem, result in results.items()}
    assert {"P3.1", "P3.2", "P3.3", "P3.4", "P3.11"} <= found["sonar_smoothing"]
    assert found["sonar_correlated"] == {"P3.6", "P3.12", "P3.17"}
    assert found["sonar_missed"] == {"P3.5"}
    rows = results["sonar_missed"].tables["claims"]
    assert set(rows["verdict"]) == {CONFIRMED}
    assert [claim.id for claim in claims_of(STUDY).claims] == [f"P3.{n}" for n in range(1, 20)]


@pytest.fixture(scope="module")
def walking():
    return radarsim.run("sonar_fluctuating", realisations=200, figures=False).tables["claims"].set_index("claim")


def test_the_filter_as_printed_is_growing_memory(walking):
    """(11) has no process noise: nothing is gained on it, and what a filter with such noise gains is not counted."""
    own = walking.loc["P3.15"]
    assert set(own["class"]) == {"no material difference"}
    assert own["exact"].tolist() == pytest.approx([1, 15.017 / 30.2325], rel=5e-4 / 15.017 + 5e-5 / 30.2325)
    assert own["extension"].tolist() == [False, True]
    same = walking.loc["P3.14"].iloc[-1]
    assert_rounded(same["exact"], 1.0, condition=LINE, operations=60 * TERMS)
    assert (same["verdict"], same["extension"]) == ("no material difference", True)
    assert set(walking.loc["P3.14", "class"]) == {CONFIRMED}


def test_a_subscript_of_a_scan_contradicts_no_print(walking):
    assert set(walking.loc["P3.16", "class"]) == {"not judgeable as stated"}
    assert walking.loc["P3.16", "reason"].str.contains("one subscript of a machine-read scan").all()


def test_coordinates_apart_are_those_at_once_on_a_linear_trajectory_alone(walking):
    """Of independent errors and constant rates nothing is lost; of a straight course 4 % in two minutes."""
    own = walking.loc["P3.19"]
    assert set(own["class"]) == {CONFIRMED}
    assert own["exact"].tolist() == pytest.approx([1, 1, 1.0422, 1.0137], abs=5e-5)
    assert own["verdict"].tolist() == [CONFIRMED] * 2 + [REFUTED] * 2
    assert own["extension"].tolist() == [False, False, True, True]


def test_what_is_known_exactly_is_judged_exactly(results):
    """Least squares that knows no closed form against the exact σ of the filter, and in every part that has one."""
    result = results["sonar_smoothing"]
    rows = result.tables["claims"]
    own = rows[rows["claim"].isin([f"P3.{n}" for n in (1, 2, 3, 4, 11, 14, 18)])]
    assert len(own) > 20
    assert own["exact"].notna().all()
    formulas = own[own["quantity"].str.endswith("over the formula")]
    assert len(formulas) == 20
    precision = {"condition": LINE, "operations": 20 * TERMS}
    assert_rounded(formulas["exact"], np.ones(20), **precision)
    curves = result.tables["curves"].set_index(["filter", "component", "k"])["exact_sigma"]
    sigma = curves["growing", "r", 1]
    bought = own[own["quantity"].str.startswith("RMS error of the recursion after 20")]["exact"].item()
    assert_rounded(bought, curves["growing", "r", 20] / curves["growing", "r", 6], **precision)
    ahead = own.loc[own["claim"] == "P3.18", "exact"].to_numpy()
    assert_rounded(
        ahead[:2], closed_forms.sigma_extrapolated(np.array([3, 6])) / closed_forms.sigma_extrapolated(2), **precision
    )
    for n in (2, 3, 5, 8, 20):
        row = own[own["quantity"] == f"smoothed RMS error after {n} plots, over the formula"]
        smoothed = row["exact"].item() * closed_forms.sigma_smoothed(n)
        assert_rounded(smoothed, curves["growing", "r", n] / sigma, **precision)


@pytest.mark.parametrize(("percent", "low"), [(-3.0, None), (3.0, 0)])
def test_the_axis_of_further_plots_reaches_below_zero_where_one_loses(percent, low):
    table = pd.DataFrame({"component": "r", "degree": 1, "quantity": "smoothed", "plots": [2, 3, 4]})
    table[["ratio", "ratio_lo", "ratio_hi", "formula"]] = 1.0
    table[["reduction_percent", "formula_reduction_percent"]] = [[np.nan] * 2, [5.0, 5.0], [percent, 5.0]]
    figure = plots_figure(table)
    assert figure is not None
    assert figure.panels[1].y.limits == (low, None)
