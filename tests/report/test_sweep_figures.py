"""Figures that a sweep has by itself: what is drawn is σ at the last scan; and the page of claims."""

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest

from radarsim.api import result_content, run
from radarsim.language.current import use_language
from radarsim.papers.claim_rows import measured_words
from radarsim.report import case_selection, figure_lines, gain_maps, key_labels, math_text, sweep_figures, tables
from radarsim.report.drawing import canvas, legend_placement
from radarsim.report.drawing.model import MAX_PANEL_LINES, Line
from radarsim.report.quantities import Component


def swept(config, *overrides, n=200):
    result = run.run(config, realisations=n, overrides=overrides)
    return result, result_content.case_figures(result.cases, result.tables, result.experiment)


def test_one_key_is_a_family_of_curves():
    key = "radar.sigma_velocity_mps"
    result, drawn = swept("rls2", f"sweep.{key}=[1,40,5,15]")
    figure = drawn["sweep_sigma_velocity_mps"]
    assert [panel.x.scale for panel in figure.panels] == ["log"] * 3
    rows = tables.group_by(result.curves, "case", "filter", "component")
    for panel, component in zip(figure.panels, ("r", "Vr", "ar"), strict=True):
        for mark, name in zip(panel.marks, ("r", "r+Vr"), strict=True):
            np.testing.assert_array_equal(mark.x, [1, 5, 15, 40])
            last = [rows[f"rls2 {key}={v}", name, component].iloc[-1] for v in (1, 5, 15, 40)]
            np.testing.assert_array_equal(mark.y, [row["sigma"] for row in last])
            np.testing.assert_array_equal(mark.lo, [row["sigma_lo"] for row in last])
            np.testing.assert_array_equal(mark.exact, [row["exact_sigma"] for row in last])


@pytest.mark.parametrize(
    ("component", "words"),
    [("r", "r"), ("Vr", "V_r"), ("b", "β"), ("vb", "v_β"), ("ab", "a_β"), ("ve", "v_ε"), ("speed", "speed")],
)
def test_axes_name_components_by_their_letters(component, words):
    assert math_text.plain_text(key_labels.component_symbol(component)) == words


def test_two_keys_are_a_map():
    result, drawn = swept("rls2", "sweep.scans=[15,10]", "sweep.radar.sigma_range_m=[50,100,250]")
    figure = drawn["sweep_scans_sigma_range_m"]
    assert [panel.title for panel in figure.panels] == ["r", "r+Vr"]
    rows = tables.group_by(result.curves, "case", "filter", "component")
    heat = figure.panels[1].marks[0]
    for i, r in enumerate((50, 100, 250)):
        for j, k in enumerate((10, 15)):
            assert heat.values[i, j] == rows[f"rls2 scans={k} radar.sigma_range_m={r}", "r+Vr", "r"]["sigma"].iloc[-1]


def test_gains_over_two_keys_are_maps_with_their_intervals_and_sentences():
    result, _ = swept("rls2", "sweep.scans=[15,10]", "sweep.radar.sigma_range_m=[50,100,250]")
    # As measured, without what is known exactly.
    gains, components = result.gains.assign(exact_percent=np.nan), [Component("r", "m", words="range")]
    (figure,) = gain_maps.gain_map_figures(result.cases, gains, components).values()
    (panel,) = figure.panels
    rows, heat = tables.group_by(gains, "case", "component"), panel.marks[0]
    last = {
        (k, r): rows[f"rls2 scans={k} radar.sigma_range_m={r}", "r"].iloc[-1] for k in (10, 15) for r in (50, 100, 250)
    }
    for (i, r), (j, k) in itertools.product(enumerate((50, 100, 250)), enumerate((10, 15))):
        assert heat.values[i, j] == last[k, r]["gain_percent"]
        assert heat.half_widths[i, j] == pytest.approx((last[k, r]["gain_hi"] - last[k, r]["gain_lo"]) / 2)
    (sentence,) = gain_maps.gain_map_sentences(result.cases, gains, components)
    least, greatest = (choose(last.items(), key=lambda item: item[1]["gain_percent"]) for choose in (min, max))
    for (k, r), row in (least, greatest):
        assert f"{row['gain_percent']:.3g} %" in sentence.text
        assert f"scans = {k}, σ of the measured range = {r} m" in sentence.text or f"{r} m" in sentence.text
    assert "(95 % for all 6 simulated values together)" in sentence.text
    assert not list(gain_maps.map_groups(run.run("rls2", realisations=8).cases))


@pytest.mark.parametrize(
    ("config", "overrides", "name"),
    [
        ("sonar_smoothing", ("sweep.sensor.scan_period_s=[2,5]", "scans=8"), "sweep_scan_period_s"),
        ("sonar_smoothing", ("sweep.target=[sonar_straight,sonar_fluctuating]", "scans=8"), "sweep_target"),
        ("multimodel_1hz", ("sweep.sensor.sigma_range_m=[1,20]", "scans=30"), "sweep_sigma_range_m"),
    ],
)
def test_every_study_of_tracks_draws_its_sweeps(config, overrides, name):
    result, drawn = swept(config, *overrides, n=16)
    filters = result.cases[0].axes.filters
    for panel in drawn[name].panels:
        named = [mark for mark in panel.marks if mark.label]
        assert sum(len(mark.x) * len(mark.label.split(" = ")) for mark in named) == 2 * len(filters)
        assert all(np.isfinite([mark.x, mark.y]).all() for mark in named)


def test_many_filters_over_names_have_a_row_each():
    _, drawn = swept("sonar_smoothing", "sweep.target=[sonar_straight,sonar_fluctuating]", "scans=8", n=16)
    figure = drawn["sweep_target"]
    rows = [text for _, text in figure.panels[0].y.ticks]
    assert len(rows) > MAX_PANEL_LINES
    assert figure.share_y
    for panel in figure.panels:
        assert panel.y.limits[0] > panel.y.limits[1]  # from the top down
        assert {mark.label for mark in panel.marks if mark.label} == {"sonar straight", "sonar fluctuating"}


@pytest.mark.slow
def test_several_configs_over_one_key_share_a_figure_and_an_axis():
    _, drawn = swept("manoeuvre_variance", n=50)
    assert [name for name in drawn if name.startswith("sweep")] == ["sweep_manoeuvre_variance"]
    figure = drawn["sweep_manoeuvre_variance"]
    assert [panel.title for panel in figure.panels] == [f"RLS {n}" for n in range(1, 6)]
    assert len({panel.y for panel in figure.panels}) == 1
    assert figure.share_y


def test_values_that_are_no_numbers_are_points_from_least_to_largest():
    """No line joins what has no order of its own; every panel has the order of the leading component."""
    result, drawn = swept("rls2_manoeuvres", n=50)
    panels_ = drawn["sweep_target"].panels
    assert all(mark.style.dash is None for panel in panels_ for mark in panel.marks)
    assert len({panel.x.ticks for panel in panels_}) == 1
    leading = panels_[0].marks[0]
    assert list(leading.y) == sorted(leading.y)
    rows = result.curves[(result.curves["filter"] == "r") & (result.curves["component"] == "r")]
    assert sorted(leading.y) == sorted(rows.groupby("case")["sigma"].last())
    for a, b in zip(panels_[0].marks, panels_[0].marks[1:], strict=False):
        assert (b.x > a.x).all()
        assert np.abs(b.x - np.arange(len(b.x))).max() < 0.5


def test_no_sweep_no_figure(expected_radar):
    assert sweep_figures.sweep_figures([expected_radar("rls2")], {}) == {}


def test_measured_values_are_written_to_two_figures_of_their_half_width():
    def said(value, lo, hi, unit="%"):
        return measured_words({"measured": value, "judged_lo": lo, "judged_hi": hi, "unit": unit, "exact": ""})

    assert said(82.7032, 82.33, 83.07) == "82.70 [82.33, 83.07] %"
    assert said(-6.5e-5, -1.3e-4, 4e-7) == "−0.000065 [−0.000130, 0.000000] %"
    assert said(9.0, 9.0, 10.0, "Δt") == "9 [9, 10] Δt"
    assert said(np.inf, np.inf, np.inf, "Δt") == "∞ Δt"
    assert said(0.53452248, 0.53452248, 0.53452248, "") == "0.5345"


@pytest.mark.slow
def test_two_keys_make_a_panel_a_value_and_a_map_and_leave_nothing_out():
    keys = ("sweep.radar.sigma_velocity_mps=[1, 5, 15]", "sweep.manoeuvre_variance=[1e-4, 1e-3, 1e-2]")
    _, described = swept({"include": ["rls2"]}, *keys, n=50)
    for name in ("sigma_r", "gain_r", "consistency"):
        assert [panel.title for panel in described[name].panels] == [f"$σ_V$ = {v} m/s" for v in (1, 5, 15)], name
        lines = [[mark for mark in panel.marks if isinstance(mark, Line)] for panel in described[name].panels]
        assert {len(own) for own in lines} == {3 if name == "gain_r" else 6}
    plan = legend_placement.plan_legends(described["sigma_r"])
    assert plan.at_ends == (True,) * 3
    assert {line.label for line in legend_placement.named_lines(plan.panels[0])} == {"10⁻⁴", "10⁻³", "10⁻²"}
    assert list(plan.common.keys) == ["r", "r+Vr", "exact"]
    assert plan.common.title == "at the lines: $D_M$, (m/s³)²"
    assert described["sweep_sigma_velocity_mps_manoeuvre_variance"].panels[0].marks[0].values.shape == (3, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of a layout that finds no room
        for figure in described.values():
            canvas.save(figure, ("svg",))


@pytest.mark.slow
def test_of_very_many_cases_the_caption_says_how_many_are_left_out():
    velocities, variances = list(range(1, 15)), [10.0**-n for n in range(10)]
    keys = (f"sweep.radar.sigma_velocity_mps={velocities}", f"sweep.manoeuvre_variance={variances}")
    _, described = swept({"include": ["rls2"]}, *keys, n=50)
    sigma = described["sigma_r"]
    assert len(sigma.panels) == 12
    assert sigma.panels[-1].title == "$σ_V$ = 14 m/s"  # the ends are among those shown
    assert sigma.caption.endswith(f" Shown: {12 * 8} of {14 * 10}; the others are in the tables.")


def test_lists_and_long_names_at_an_axis_and_in_titles():
    assert key_labels.format_value((1000.0, 1200.0)) == "1000, 1200"
    result = run.run("ambiguous_turns", realisations=8, figures=False)
    first, second = result.cases[:2]
    key = first.swept_values[0][0]
    assert key_labels.swept_description(first) == "$F_r$ = 1000, 1200 Hz"
    _, axis = sweep_figures.axis_positions(first, key, [dict(one.swept_values)[key] for one in (first, second)])
    assert [words for _, words in axis.ticks] == ["1000, 1200", "1000, 1200,\n1400"]
    _, axis = sweep_figures.axis_positions(first, key, ["aeroballistic_gentle", "weaving"])
    assert [words for _, words in axis.ticks] == ["aeroballistic\ngentle", "weaving"]


def test_targets_that_are_swept_are_named_by_their_kind_and_what_sets_them_apart():
    """In whole they are wider than a page."""
    past = {"kind": "fly_by", "distance_m": 15e3, "speed_mps": 280.0, "start_range_m": 40e3}
    targets = [past, past | {"speed_mps": 100.0, "sigma_position_m": 800.0}, {"kind": "recorded", "file": "flight.csv"}]
    words = ["fly by, speed 280 m/s", "fly by, speed 100 m/s, σ of the first position 800 m", "recorded"]
    result = run.run("rls2", realisations=8, figures=False, overrides=["scans=4"]).cases[0]
    assert [key_labels.shorten_mapping(result, "target", one, targets) for one in targets] == words
    whole = "distance of closest approach 15,000 m, speed 280 m/s, range at the first plot 40,000 m"
    assert (
        key_labels.swept_description(replace(result, swept_values=(("target", past),))) == f"target = fly by, {whole}"
    )
    x, axis = sweep_figures.axis_positions(result, "target", targets)
    assert x.tolist() == [0, 1, 2]
    assert [" ".join(shown.split()) for _, shown in axis.ticks] == words
    lines = figure_lines.case_lines(
        [replace(result, name=f"rls2 {n}", swept_values=(("target", one),)) for n, one in enumerate(targets)],
        {(f"rls2 {n}", "r", "r"): tables.frame({"x": [n], "y": [n]}) for n in range(3)},
        *("r", ("x", "y"), ["r"]),
    )
    assert [one.label for one in lines] == words


def test_panels_of_several_configs_that_would_be_called_the_same_are_told_by_their_config():
    result = run.run("ambiguous_stagger", realisations=8, figures=False)
    plain, *swept = case_selection.group_by_panel(result.cases)
    assert [plain, *swept] == ["RLS 4", "RLS 4, $F_r$ = 1000, 1200 Hz", "RLS 4, $F_r$ = 1000, 1200, 1400 Hz"]
    again = [*result.cases, replace(result.cases[0], name="other")]
    assert list(case_selection.group_by_panel(again)) == ["ambiguous_rls4, RLS 4", *swept, "other, RLS 4"]


def test_a_filter_looks_the_same_in_all_panels_of_a_figure():
    """Of ambiguous_stagger the second config has a filter more, before others that both have."""
    result = run.run("ambiguous_stagger", realisations=30, figures=False)
    drawn = result_content.case_figures(result.cases, result.tables, result.experiment)
    styles = {}
    for one in (mark for panel in drawn["sigma_r"].panels for mark in panel.marks):
        styles.setdefault(one.label, set()).add(one.style)
    assert {"remainder", "no memory", "memory"} <= styles.keys()
    assert all(len(own) == 1 for own in styles.values())


@pytest.mark.parametrize(("code", "words"), [("en", "turn rate = 1°/s"), ("ru", "угловая скорость поворота = 1°/с")])
def test_an_angle_is_told_in_degrees_in_every_language(code, words):
    key = "target.turns.0.rate_radps"
    result = run.run("sonar_manoeuvre_turning", realisations=8, overrides=[f"sweep.{key}=[0.01745]"], figures=False)
    with use_language(code):
        assert key_labels.swept_description(result.cases[0], without=["frame"]) == words
        assert key_labels.key_axis_label(result.cases[0], key).partition(", ")[2] == words[-3:]
