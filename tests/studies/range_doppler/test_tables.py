"""P1's own tables against what is known, and its figures against the tables."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from radarsim.report import key_labels, statistics, tables
from radarsim.report.drawing import canvas
from radarsim.report.drawing.model import Line, Style
from radarsim.studies.range_doppler import answer, steady_state
from radarsim.studies.range_doppler import figures as range_doppler_figures
from radarsim.studies.range_doppler import tables as range_doppler
from tests.answers import answer_texts
from tests.tolerances import assert_rounded, rounding


def made_of(results):
    return {"curves": tables.curves(results), "gains": tables.gains(results), **range_doppler.tables(results)}


def drawn_of(results, made=None, stem="mine"):
    """Its figures, each showing every case."""
    everything = SimpleNamespace(
        stem=stem, cases_in_figure=lambda name: [SimpleNamespace(name=r.name) for r in results]
    )
    return range_doppler_figures.figures(results, made or made_of(results), everything)


def steady_row(table, case, name, component="r"):
    rows = table[(table["case"] == case) & (table["filter"] == name) & (table["component"] == component)]
    return rows.iloc[0]


# The paper's own D_M: settling of σ_r in scan periods, range only and with Doppler.
@pytest.mark.parametrize(
    ("case", "name", "periods"),
    [
        ("rls1", "r", 4),
        ("rls2", "r", 9),
        ("rls3", "r", 19),
        ("rls5", "r", 11),
        ("rls4", "r+Vr", 7),
        ("rls5", "r+Vr", 15),
    ],
)
def test_settling_of_the_papers_radars(paper, case, name, periods):
    row = steady_row(range_doppler.steady(paper), case, name)
    assert row["settling_periods"] == periods
    assert row["under_10_periods"] == (periods < 10)


def test_settling_and_the_best_are_exact(swept):
    """At D_M = 10⁻⁴ σ_r is 5.037 % above its steady value at 90 s: not under ten periods, whatever is measured."""
    right = range_doppler.steady(swept)
    row = steady_row(right, "rls2 manoeuvre_variance=0.0001", "r+Vr")
    assert (row["settling_s"], row["under_10_periods"], row["best"]) == (100.0, False, False)
    best = steady_row(right, "rls2 manoeuvre_variance=0.001", "r+Vr")
    assert (round(best["steady_sigma"], 1), best["settling_s"], best["best"]) == (154.7, 30.0, True)
    lower = [replace(one, sums=one.sums | {"error": one.sums["error"] * [1, 0.998, 1, 0.996]}) for one in swept]
    assert range_doppler.steady(lower)["best"].equals(right["best"])
    assert range_doppler.steady(lower)["settling_s"].equals(right["settling_s"])


def test_steady_values_over_the_manoeuvre_variance(swept):
    table = range_doppler.steady(swept)
    rows = table[table["component"] == "r"]
    for name, values in (("r", (142, 165, 189, 211, 229)), ("r+Vr", (134, 147, 155, 157, 158.5))):
        np.testing.assert_allclose(rows[rows["filter"] == name]["steady_sigma"], values, rtol=0, atol=0.5)  # as printed
    best = rows[rows["best"]].set_index("filter")["manoeuvre_variance"]
    assert best["r"] == 1e-3
    assert best["r+Vr"] == 1e-3


def test_the_worst_is_named_by_exact_values():
    """A sample that errs puts the largest σ and bias at another scan; the sentence names the scan of the exact ones."""
    rows = pd.DataFrame({"t_s": [10.0, 20.0], "sigma": [5.2, 5.0], "exact_sigma": [4.9, 5.1]})
    rows = rows.assign(
        sigma_lo=rows["sigma"] - 0.3,
        sigma_hi=rows["sigma"] + 0.3,
        bias=[-2.0, 1.9],
        bias_se=0.1,
        exact_bias=[-1.8, 2.1],
    )
    clause = answer._worst_errors(rows, "r")
    assert clause.text.endswith("largest RMS range error 5.1 m at 20 s, largest bias 2.1 m at 20 s")


def test_no_best_where_nothing_is_compared(paper):
    assert not range_doppler.steady(paper)["best"].any()


def test_settling_for_good():
    t = np.arange(6) * 10.0
    value = np.array([2.0, 1.02, 1.2, 1.04, 1.0, 1.0])
    exact = statistics.Estimate(value, value, value)
    assert range_doppler.settling(exact, t, 1.0) == (30.0, 30.0, 30.0)
    wide = statistics.Estimate(value, value - 0.02, value + 0.02)
    assert range_doppler.settling(wide, t, 1.0) == (30.0, 30.0, 40.0)
    never = statistics.Estimate(value + 1, value + 1, value + 1)
    assert range_doppler.settling(never, t, 1.0).value == np.inf


def test_radar_table(paper):
    table = range_doppler.tables(paper)["radar"]
    assert_rounded(table["C_theta"], [0.25, 25 / 9, 100 / 9, 25, 100], operations=5)
    assert (table["speed_mps"] == 310).all()  # −250 m/s at first, 4 m/s² for 140 s
    assert_rounded(table["doppler_hz"], np.array([1000 / 3, 4000, 4000, 20000, 20000]) * 310 / 300, operations=5)
    assert_rounded(table["unambiguous_velocity_mps"], [900, 75, 75, 15, 15], operations=5)


def test_consistency_before_the_filter_adds_manoeuvre(paper):
    """At its least-squares start a filter is right about itself; later it allows for manoeuvres that are not there."""
    tables = range_doppler.tables(paper)
    table, curves = tables["consistency"], tables["curves"]
    sigma = curves.assign(ratio=curves["sigma"] / curves["believed_sigma"])
    start = table[(table["filter"] == "r") & (table["k"] <= 3)]
    tolerance = rounding(138, 30)  # κ of a parabola through three ranges, in units of its errors
    np.testing.assert_allclose(start["nees"], 1, rtol=tolerance)
    np.testing.assert_allclose(sigma[(sigma["filter"] == "r") & (sigma["k"] <= 3)]["ratio"], 1, rtol=tolerance)
    assert set(start["nees_verdict"]) == {"consistent"}
    assert set(table[table["k"] >= 6]["nees_verdict"]) == {"pessimistic"}
    assert (sigma[sigma["k"] >= 6]["ratio"] < 1).all()


def test_exact_values_of_the_normalised_error(paper):
    """Sums that are their expectation give the exact NEES: to rounding, and within its interval."""
    table = range_doppler.tables(paper)["consistency"]
    np.testing.assert_allclose(table["nees"], table["exact_nees"], rtol=rounding(138, 30))  # κ: as above
    assert ((table["nees_lo"] < table["nees"]) & (table["nees"] < table["nees_hi"])).all()


def test_bounds_of_the_normalised_error(paper):
    from scipy.special import chdtri

    row = range_doppler.tables(paper)["consistency"].iloc[5]
    freedom = 3 * paper[0].count
    share, next_term = 0.025 / 15, freedom**-1.5  # of fifteen scans; what Wilson and Hilferty's quantiles leave out
    assert row["nees_bound_lo"] == pytest.approx(chdtri(freedom, 1 - share) / freedom, abs=next_term)
    assert row["nees_bound_hi"] == pytest.approx(chdtri(freedom, share) / freedom, abs=next_term)


def test_captions_have_the_papers_figure_numbers_where_they_are_of_its_experiment(expected_radar):
    results = [expected_radar("rls2")]
    numbers = {"sigma_r": "1a", "gain_r": "1b", "sigma_Vr": "2a", "gain_Vr": "2b", "sigma_ar": "3a", "gain_ar": "3b"}
    for name, one in drawn_of(results, stem="range_doppler").items():
        told = f"Figure {numbers[name]} of the paper." if name in numbers else "of the paper."
        assert (told in one.caption) is (name in numbers)
    assert not any("of the paper." in one.caption for one in drawn_of(results).values())


def test_consistency_figure_draws_the_table(paper):
    made = made_of(paper)
    first, second = drawn_of(paper, made)["consistency"].panels
    assert (first.title, second.title) == ("r", "r+Vr")
    rows = tables.group_by(made["consistency"], "case", "filter")
    lines = [mark for mark in second.marks if isinstance(mark, Line)]
    for line, result in zip(lines, paper, strict=True):
        np.testing.assert_array_equal(line.y, rows[result.name, "r+Vr"]["nees"])


def test_settling_figure_draws_the_table(swept):
    made = made_of(swept)
    (panel,) = drawn_of(swept, made)["settling"].panels
    (line,) = [mark for mark in panel.marks if isinstance(mark, Line) and mark.style == Style(1, 1, 1)]
    rows = made["steady"][(made["steady"]["filter"] == "r+Vr") & (made["steady"]["component"] == "r")]
    np.testing.assert_array_equal(line.y, rows["steady_sigma"])
    np.testing.assert_array_equal(line.x, rows["settling_s"])


@pytest.mark.slow
def test_labels_of_settled_points_do_not_touch(expected_radar):
    radars, variances = ("rls1", "rls2", "rls3", "rls4", "rls5"), (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    results = [expected_radar(radar, v, f"{radar} D_M={v:g}") for radar in radars for v in variances]
    labelled = []
    for axes in canvas.render(drawn_of(results)["settling"]).axes:
        places = [note.get_window_extent() for note in axes.texts if note.get_text().startswith("10")]
        assert not any(a.overlaps(b) for a, b in combinations(places, 2))
        assert all(one.y1 < axes.get_window_extent().y1 for one in places)
        labelled.append(len(places))
    assert labelled == [4, 4, 4, 5, 5, 0]  # RLS 1: two points share one; RLS 2 and 3: one does not settle


def test_dynamic_error_is_drawn_where_there_is_one(expected_radar):
    target = {"kind": "jerk_pulse", "coefficients": [1e5, -250], "start_s": 50, "jerk_mps3": 1, "duration_s": 20}
    results = [expected_radar("rls2", target=target)]
    made = made_of(results)
    panels = drawn_of(results, made)["dynamic_r"].panels
    rows = tables.group_by(made["curves"], "filter", "component")["r", "r"]
    bias, spread = (next(mark for mark in panel.marks if isinstance(mark, Line)) for panel in panels)
    np.testing.assert_array_equal(bias.y, rows["bias"])
    np.testing.assert_array_equal(spread.y, rows["spread"])
    assert_rounded(rows["bias"], results[0].axes.exact_bias[0, :, 0], operations=4)


def test_answer_tells_the_last_gain_of_each_component(paper):
    made = made_of(paper[1:2])
    told = answer_texts(answer, paper[1:2], made)
    assert len(told) == 3
    assert "at 140 s, the last scan, the RMS error is 18.3 % lower" in told[0]
    assert "than with range alone" in told[0]
    assert "at best" not in told[0]  # once settled, it stays what it is
    assert "RLS 1" in answer_texts(answer, paper, made_of(paper))[2]
    assert "higher (RLS 1)" in answer_texts(answer, paper, made_of(paper))[2]


S_BAND = {"sigma_range_m": 60, "sigma_velocity_mps": 3, "scan_period_s": 4}


@pytest.mark.parametrize(("detection", "words"), [(1, " in the long run"), (0.9, " with every plot in the long run")])
def test_a_gain_that_has_not_settled_is_quoted_with_that_of_the_long_run(expected_radar, detection, words):
    """Against another solution of the steady state, by doubling."""
    C_theta, Lambda = 60**2 / (4 * 3) ** 2, 4**3 * 1e-3**0.5 / 60
    known = steady_state.exact_gains(np.array([C_theta]), np.array([Lambda]))[:, 0]
    results = [expected_radar("rls2", radar=S_BAND | {"detection_probability": detection})]
    told = answer_texts(answer, results, made_of(results))[:3]
    for sentence, gain in zip(told, known, strict=True):
        assert f"; still changing: {gain:.1f} % lower{words}" in sentence
    longer = [expected_radar("rls2", radar=S_BAND | {"detection_probability": detection}, scans=40)]
    if detection == 1:
        assert "still changing" not in " ".join(answer_texts(answer, longer, made_of(longer)))


def test_a_target_that_breaks_the_model_has_no_gain_of_the_long_run(expected_radar):
    target = {"kind": "jerk_pulse", "coefficients": [1e5, -250], "start_s": 20, "jerk_mps3": 1, "duration_s": 20}
    results = [expected_radar("rls2", radar=S_BAND, target=target)]
    assert "still changing" not in " ".join(answer_texts(answer, results, made_of(results)))


def test_of_several_radars_those_are_named_that_have_not_settled(expected_radar):
    results = [expected_radar("rls2", name="mine", radar=S_BAND), expected_radar("rls4", name="rls4")]
    told = answer_texts(answer, results, made_of(results))[0]
    assert told.count("in the long run") == 1
    assert "still changing: 36.5 % lower (" in told


def test_answer_names_a_baseline_that_observes_more(expected_radar):
    velocity = [
        {"name": f"D {v}", "observes": ["range", "velocity"], "manoeuvre_variance": v, "initial_scans": 3}
        for v in (1e-3, 1e-2)
    ]
    results = [expected_radar("rls2", filters=velocity)]
    assert "than with filter D 0.001" in answer_texts(answer, results, made_of(results))[0]


def test_inputs_have_a_row_for_each_radar_that_differs(expected_radar, swept):
    values = (1, 4, 16)
    results = [
        expected_radar("rls2", name=f"rls2 radar.sigma_velocity_mps={v}", radar={"sigma_velocity_mps": v})
        for v in values
    ]
    table = range_doppler.inputs(results)
    assert list(table["σ_V, m/s"]) == list(values)
    np.testing.assert_array_equal(table["C_θ"], range_doppler.tables(results)["radar"]["C_theta"])
    (row,) = range_doppler.inputs(swept).to_dict("records")
    assert row["D_M, (m/s³)²"] == "10⁻⁵, 10⁻⁴, 10⁻³, 10⁻², 10⁻¹"
    assert "P_D" not in row
    results = [expected_radar("rls2", name=f"rls2 {v}", radar={"detection_probability": v}) for v in (1, 0.9)]
    assert list(range_doppler.inputs(results)["P_D"]) == ["0.9, 1"]  # missed plots are on the page


BRAKING = {"kind": "acceleration_start", "coefficients": [1e5, -250], "start_s": 50, "acceleration_mps2": 20}


def greatest_loss(made):
    rows = made["gains"][made["gains"]["component"] == "r"]
    row = rows.loc[rows["exact_percent"].idxmin()]
    assert row["exact_percent"] < -10
    return f"at worst {-row['exact_percent']:.1f} % higher, at {row['t_s']:g} s"


def test_answer_tells_the_greatest_loss(expected_radar):
    """One case, and the one of several that is no case of the last scan's ends."""
    sharp = {"sigma_range_m": 80, "sigma_velocity_mps": 4, "scan_period_s": 6}
    results = [expected_radar("rls2", 1e-4, target=BRAKING, radar=sharp)]
    made = made_of(results)
    words = greatest_loss(made)
    assert answer_texts(answer, results, made)[0].endswith(f"; from the manoeuvre on (54 s) {words}.")
    others = [expected_radar("rls2", name="calm"), expected_radar("rls5", name="fine"), *results]
    made = made_of(others)
    words = greatest_loss(made)
    assert answer_texts(answer, others, made)[0].endswith(f"; from the manoeuvre on (54 s) {words}, with RLS 2.")


def test_answer_is_silent_of_a_loss_that_is_none(paper):
    one = paper[3:4]
    made = made_of(one)
    first = made["gains"][made["gains"]["component"] == "r"]
    assert (first["exact_percent"] > -1).all()
    assert "at worst" not in answer_texts(answer, one, made)[0]


def test_answer_tells_the_variance_of_its_gains_where_others_are_swept(paper, swept):
    results = [*paper[:1], *swept]
    first = answer_texts(answer, results, made_of(results))[0]
    assert "than with range alone, at D_M = 10⁻³" in first
    assert "D_M" not in answer_texts(answer, paper[:1], made_of(paper[:1]))[0]


BEST = "(least steady RMS range error among those that settle"


def test_answer_tells_the_best_variance(swept):
    told = answer_texts(answer, swept, made_of(swept))[0]  # before the gains: it is what is asked
    assert told.startswith(f"RLS 2, best D_M {BEST} in under 10 scan periods): ")
    assert ": r 10⁻³ (189.1 m, settled after 90 s); r+Vr 10⁻³ (154." in told


def test_a_target_that_breaks_the_model(expected_radar):
    target = {"kind": "jerk_pulse", "coefficients": [1e5, -250], "start_s": 50, "jerk_mps3": 1, "duration_s": 20}
    results = [expected_radar("rls2", target=target)]
    made = made_of(results)
    assert made["steady"].empty
    rows = made["curves"][(made["curves"]["component"] == "r") & (made["curves"]["filter"] == "r")]
    worst = rows.loc[rows["exact_sigma"].idxmax()]
    told = answer_texts(answer, results, made)[-1]
    assert f"r: largest RMS range error {worst['exact_sigma']:.4g} m" in told
    assert f"at {worst['t_s']:g} s, largest bias " in told


def test_answer_of_a_single_filter(expected_radar):
    one = {"name": "only", "observes": ["range"], "manoeuvre_variance": 1e-3}
    results = [expected_radar("rls2", filters=[one])]
    (sentence,) = answer_texts(answer, results, made_of(results))
    assert "“only”: the RMS range error at 140 s is 189.3 m" in sentence


# ---- a world less tidy ----------------------------------------------------------------------------------------------


def told_of(results):
    return answer_texts(answer, results, made_of(results))


def test_answer_compares_at_a_common_time(expected_radar):
    """Twenty scans each: the slow radar ends later."""
    results = [
        expected_radar("rls2", name=f"rls2 radar.scan_period_s={dt}", radar={"scan_period_s": dt}, scans=20)
        for dt in (4, 6, 12)
    ]
    made, told = made_of(results), told_of(results)[0]
    rows = made["gains"][(made["gains"]["component"] == "r") & (made["gains"]["t_s"] == 72)]
    assert (
        "at 72 s, the last time that all have in common, the RMS error is " in told
    )  # 76 s is the end of the shortest
    for gain in (rows["exact_percent"].min(), rows["exact_percent"].max()):
        assert f"{gain:.1f} %" in told


def test_answer_names_the_best_variance_on_a_manoeuvring_target(expected_case, radar_config):
    from radarsim.api.configs import load

    values = [1e-4, 1e-2, 1.0, 10.0]
    source = {**radar_config("rls2", target=BRAKING), "sweep": {"manoeuvre_variance": values}}
    results = [expected_case(case) for case in load(source).cases]
    worst = np.array([result.axes.exact_sigma[:, 5:, 0].max(axis=1) for result in results])
    told = next(one for one in told_of(results) if ", best D_M, by the largest RMS error of the range" in one)
    for f, name in enumerate(("r", "r+Vr")):
        best = values[int(worst[:, f].argmin())]
        equal = [value for value, sigma in zip(values, worst[:, f], strict=True) if sigma < 1.01 * worst[:, f].min()]
        texts = [key_labels.format_value(value, powers=True) for value in equal]
        if name == "r+Vr":
            assert equal == [best]
            assert f"{name} {texts[0]} (RMS error {worst[:, f].min():.4g} m, at " in told
        else:
            ends = " to ".join(f"{sigma:.4g}" for sigma in sorted(worst[worst[:, f] < 1.01 * worst[:, f].min(), f]))
            assert f"{name} {texts[0]} and {texts[1]} do equally well (RMS error {ends} m)" in told
    assert not any("further cases break the model" in one for one in told_of(results))


def test_answer_says_that_velocities_are_not_folded(expected_radar):
    plain, rated = expected_radar("rls2"), expected_radar("rls2", radar={"repetition_rate_hz": 1000})
    assert not any("unambiguous" in one for one in told_of([plain]))
    (said,) = [one for one in told_of([rated]) if "unambiguous" in one]
    assert "an unambiguous interval of 75 m/s, which folds the target's 310 m/s" in said
    fast = expected_radar("rls2", radar={"repetition_rate_hz": 1e5})
    assert not any("unambiguous" in one for one in told_of([fast]))


def test_answer_gives_the_variance_that_was_looked_for(expected_radar):
    filters = [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": {"minimise": "sigma_r", "over": over}}
        for over in ("worst",)
    ]
    turning = expected_radar("rls2", target=BRAKING, filters=filters)
    found = float(turning.axes.manoeuvre_variance[0])
    said = told_of([turning])[-1]
    assert f"r {found:g} (sigma_r is least at its worst from 50 s on)" in said
    calm = expected_radar("rls2", filters=filters)
    assert "no minimum inside" in told_of([calm])[-1]
