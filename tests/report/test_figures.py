"""Figures: what is drawn is what is described, in the same bytes each time, and no user's name breaks them."""

import gc
import warnings
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.axis import XAxis

from radarsim.report import (
    case_selection,
    coinciding_lines,
    key_labels,
    panel_layout,
    sweep_figures,
    tables,
    time_figures,
    wording,
)
from radarsim.report.drawing import canvas as drawing_canvas
from radarsim.report.drawing import legend_placement, line_names, line_points, marks, page_figure, style
from radarsim.report.drawing.model import Axis, Bars, Figure, Heat, Line, Note, Panel, Reference, Style
from radarsim.report.quantities import Component
from radarsim.studies.range_doppler import figures as range_doppler_figures
from radarsim.studies.range_doppler import tables as range_doppler
from tests.tolerances import assert_rounded


def one(*marks, **panel):
    return Figure("one", "One", "A figure.", (Panel(Axis("x, s"), Axis("y, m"), marks, **panel),))


def line(n=20, **style):
    x = np.arange(n, dtype=float)
    return Line(x, np.cos(x), "line", Style(**style), np.cos(x) - 0.1, np.cos(x) + 0.1, np.cos(x))


def drawn(figure):
    return drawing_canvas.render(figure).axes[0]


def test_the_line_is_drawn_as_given():
    described = line()
    axes = drawn(one(described))
    curve, crosses = axes.lines
    np.testing.assert_array_equal(curve.get_xdata(), described.x)
    np.testing.assert_array_equal(curve.get_ydata(), described.y)
    assert set(crosses.get_ydata()) <= set(described.exact)
    band = axes.collections[0].get_paths()[0].vertices
    assert set(described.lo) | set(described.hi) <= set(band[:, 1])
    assert axes.get_xlabel() == "x, s"


def test_a_point_of_a_band_without_a_neighbour_has_a_whisker():
    y = np.array([5, 5, np.nan, 5])
    axes = drawn(one(Line(np.arange(4.0), y, "a", lo=y - 2, hi=y + 1)))
    np.testing.assert_array_equal(axes.collections[1].get_segments(), [[[3, 3], [3, 6]]])
    y = np.where(np.arange(60) == 55, 5.0, np.nan)
    assert drawn(one(Line(np.arange(60.0), y, "a", Style(0, 0, 0)))).lines[0].get_markevery()[-2:] == [55, 56]


def test_whiskers_of_a_lone_point_are_off_the_axis():
    y = np.array([1.0, np.nan, 2.0, 2.0])
    lone = Line(np.arange(4.0), y, "a", lo=y - 1, hi=y + 1)
    ends = [drawn(one(line)).get_xlim()[0] for line in (lone, replace(lone, y=y[[0, 2, 2, 2]]))]
    assert ends[0] < -0.15 < ends[1] < 0
    nowhere = np.full(4, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn(one(lone, Line(nowhere, nowhere, "b")))


def test_a_title_is_not_broken_before_a_unit():
    panel = replace(one(Line(np.arange(3.0), np.arange(3.0))).panels[0], title="false plots per scan: 0.03 km⁻²")
    axes = drawing_canvas.render(Figure("f", "", "", (panel,) * 3, 3, 175.0)).axes[0]
    assert axes.get_title(loc="left").split("\n") == ["false plots per scan:", "0.03\xa0km⁻²"]


def test_lines_that_never_lose_are_named_and_not_drawn():
    shares = [Line(np.arange(3.0), np.array(y), name) for y, name in (([1, 1, 1], "a"), ([1, 0.9, 0.8], "b"))]
    (line,), said = panel_layout.loss_lines(shares)
    assert line.label == "b"
    assert_rounded(line.y, [0, 0.1, 0.2], size=1)
    assert said == " Without failures: a."
    assert panel_layout.loss_lines([replace(shares[1], y=np.full(3, 0.5))])[1] == ""


def test_markers_and_crosses_take_turns():
    axes = drawn(one(line(marker=0)))
    curve, crosses = axes.lines
    marked = curve.get_xdata()[curve.get_markevery()]
    assert not set(marked) & set(crosses.get_xdata())


def test_all_kinds_of_marks_and_a_log_axis():
    heat = Heat(np.arange(3.0), np.arange(2.0), np.arange(6.0).reshape(2, 3), "value")
    bars = Bars(("a", "b"), np.array([1.0, 2.0]), np.array([0.9, 1.8]), np.array([1.1, 2.2]))
    pair = (Panel(Axis("x"), Axis("y"), (heat,)), Panel(Axis("x"), Axis("y"), (bars,)))
    drawing_canvas.save(Figure("two", "Two", "Two kinds.", pair, columns=2))
    scatter = line(dash=None, marker=1)
    axis = Axis("y", "log", (0.1, None), ((0.1, "low"), (1.0, "high")))
    marks = (scatter, Reference(0.5, "x", "half"), Reference(0.5, label="half"), Note(1.0, 1.0, "here", "sw"))
    axes = drawing_canvas.render(Figure("log", "", "", (Panel(Axis("x"), axis, marks),))).axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["low", "high"]
    assert axes.get_yscale() == "log"


def test_few_lines_are_named_at_their_ends_many_in_a_legend():
    few = drawn(one(*[Line(np.arange(3.0), np.full(3, float(i)), f"l{i}") for i in range(3)]))
    assert [text.get_text() for text in few.texts] == ["l0", "l1", "l2"]
    assert few.get_legend() is None
    many = drawn(one(*[Line(np.arange(3.0), np.full(3, float(i)), f"l{i}") for i in range(30)]))
    assert len(many.figure.legends[0].get_texts()) == 30
    keyed = drawn(one(line(), keys=(("solid", Style()),), key_title="what"))
    assert keyed.figure.legends[0].get_title().get_text() == "what"


@pytest.mark.parametrize("width", [85.0, 120.0, 175.0])
@pytest.mark.parametrize("panels", [1, 2, 3, 5])
def test_lines_too_many_for_a_legend_are_named_at_their_ends(panels, width):
    names = ("r", "r+V, random jerk", "modified and combined", *(f"filter {n}" for n in range(5)))
    lines = tuple(Line(np.arange(3.0), np.full(3, float(n)), name, Style(n, n, n)) for n, name in enumerate(names))
    panel = Panel(Axis("x"), Axis("y"), lines, direct=False)
    figure = Figure("f", "", "", (panel,) * panels, 3, 175.0, 58.0)
    canvas = drawing_canvas.render(legend_placement.at_width(figure, width))
    assert not canvas.legends
    assert canvas.get_figheight() * 25.4 < 297
    for axes in canvas.axes:
        assert sorted(text.get_text().replace("\n", " ") for text in axes.texts) == sorted(names)
        boxes = sorted((text.get_window_extent() for text in axes.texts), key=lambda box: box.y0)
        assert all(above.y0 > below.y1 - 3 for below, above in pairwise(boxes))
        assert max(box.x1 for box in boxes) <= canvas.bbox.x1


def test_lines_of_several_filters_and_values_have_a_panel_for_each_filter(expected_radar):
    results = [expected_radar("rls2", 10.0**-n, f"rls2 D={n}") for n in range(1, 6)]
    component = Component("r", "m", "$r$", "range")
    figures = {
        count: time_figures.sigma_figure("sigma_r", chosen, curves_of(chosen), component)
        for count in (3, 5)
        if (chosen := results[:count])
    }
    (together,) = figures[3].panels
    assert [name for name, _ in together.keys] == ["r", "r+Vr"]
    assert [panel.title for panel in figures[5].panels] == ["RLS 2, r", "RLS 2, r+Vr"]
    assert all(len(panel.marks) == 5 and not panel.keys for panel in figures[5].panels)


def curve_of(values):
    return Line(np.arange(float(len(values))), np.array(values, float), "a")


def test_the_key_of_names_at_ends_is_told_though_a_legend_has_nothing_else():
    lines = tuple(Line(np.arange(3.0), np.full(3, n), f"{n}", Style(n / 2, 0)) for n in range(3))
    (legend,) = drawn(one(*lines, line_title="aspect angle, °")).figure.legends
    assert legend.get_title().get_text() == "at the lines: aspect angle, °"


def test_panels_side_by_side_share_an_axis_that_shows_no_rounding():
    near, far = (Panel(Axis("x"), panel_layout.fitting_axis("σ", [one_line]), (one_line,)) for one_line in DIPPED)
    low, _ = panel_layout.share_y_axis([near, far])[0].y.limits
    assert low > 1e-5


def shared_axis(*curves_drawn):
    panels = [Panel(Axis("x"), panel_layout.fitting_axis("σ", [curve]), (curve,)) for curve in curves_drawn]
    return panel_layout.share_y_axis(panels)[0].y


def test_flat_curves_of_different_sizes_share_an_axis_on_which_none_lies_near_zero():
    near = shared_axis(curve_of([4, 4.2]), curve_of([1, 1.1]))
    assert (near.scale, near.limits[0]) == ("linear", 0)
    assert near.limits[1] > 4.2
    assert shared_axis(curve_of([15, 16]), curve_of([1, 1.1])).scale == "log"
    assert shared_axis(curve_of([15, 16]), curve_of([0, 1.1])).scale == "linear"


DIPPED = curve_of([20, 0.5, 10]), curve_of([20, 1e-8, 0.5])


def curves_of(results):
    return tables.group_by(tables.curves(results), "case", "filter", "component")


def test_an_axis_begins_near_its_curves_if_from_zero_they_would_fill_less_than_half():
    near, far = (panel_layout.fitting_axis("σ", [curve_of(values)]) for values in ([250, 150], [250, 120]))
    assert near.limits == (None, None)
    assert far.limits == (0, None)
    figure = one(Line(np.arange(2.0), np.array([250.0, 150.0]), "a"))
    strokes = [curve for curve in drawn(figure).lines if isinstance(curve.get_marker(), tuple)]
    assert len(strokes) == 1
    assert len(drawn(replace(figure, panels=(replace(figure.panels[0], y=far),))).lines) == 1


def test_the_bias_of_an_estimate_from_one_plot_hides_no_other(expected_radar):
    result = expected_radar("rls2")
    t = np.arange(6.0)
    rows = {"t_s": t, "bias": [-250.0, 1, 2, -2, 1, 0], "bias_se": 0.1, "spread": 1.0}
    component = Component("r", "m", "$r$", "range")

    def dynamic(bias):
        curves_by_key = {(result.name, f, "r"): pd.DataFrame(rows | {"bias": bias}) for f in result.axes.filters}
        return time_figures.dynamic_figure("dynamic_r", [result], curves_by_key, component)

    hidden, seen = dynamic(rows["bias"]), dynamic([-3.0, 1, 2, -2, 1, 0])
    assert -3 < hidden.panels[0].y.limits[0] < -2
    assert "off the axis" in hidden.caption
    assert seen.panels[0].y.limits == (None, None)
    assert "off the axis" not in seen.caption


def test_a_legend_has_the_order_of_the_lines_at_their_ends():
    x, ends = np.arange(3.0), {"low": 1.0, "high": 9.0, "middle": 5.0}
    lines = (Line(x, np.full(3, end), name, Style(n, n), exact=x) for n, (name, end) in enumerate(ends.items()))
    (legend,) = drawn(one(*lines, direct=False)).figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["high", "middle", "low", "exact"]


def curves(*values, names="abc", **more):
    """A panel of lines with these values over the same places."""
    marks = (
        Line(np.arange(3.0), np.asarray(y, float), n, Style(i, i))
        for i, (n, y) in enumerate(zip(names, values, strict=False))
    )
    return Panel(Axis("x"), Axis("y", limits=(0, None)), tuple(marks), **more)


def test_lines_that_coincide_in_every_panel_are_drawn_once_and_named_together():
    near, far = [1.0, 2.0, 3.001], [1.0, 2.0, 3.1]
    both = coinciding_lines.join_coinciding_lines(
        Figure("f", "", "Drawn.", (curves([1, 2, 3], near, [0, 0, 9]), curves([4, 5, 6], [4, 5, 6])))
    )
    assert [[mark.label for mark in panel.marks] for panel in both.panels] == [["a = b", "c"], ["a = b"]]
    assert both.has_joined_names
    for apart in (
        (curves([1, 2, 3], far),),  # seen to differ
        (curves([1, 2, 3], near), curves([4, 5, 6], [4, 5, 7])),  # in one panel
        (curves([1, 2, 3], near), curves([4, 5, 6])),  # in one panel there is only one of them
        (curves([1, 2, 3], [1, 2, np.nan]),),
        (curves([1, 1, 1], [1.1, 1.1, 1.1], [0, 0, 90]),),  # a tenth apart, on an axis that hides it
        (replace(curves([0, 0, 0], [0, 0, 0], [1, 10, 100]), y=Axis("y", "log")),),  # not drawn at all
    ):
        figure = Figure("f", "", "Drawn.", apart)
        assert coinciding_lines.join_coinciding_lines(figure) is figure


def test_a_swept_value_that_joined_names_share_is_told_once():
    x = np.arange(3.0)
    names = [f"{tracker}, $P_D$ = {chance}" for chance in (0.7, 0.9) for tracker in ("nearest", "PDA")]
    lines = tuple(Line(x, x + (n > 1), name, Style(n, n, n)) for n, name in enumerate(names))
    (panel,) = coinciding_lines.join_coinciding_lines(one(*lines)).panels
    assert [mark.label for mark in panel.marks] == ["nearest = PDA, $P_D$ = 0.7", "nearest = PDA, $P_D$ = 0.9"]


def test_points_without_an_interval_are_thin_and_open_and_the_key_says_so():
    x = np.arange(5.0)
    ends = np.array([0.5, np.nan, np.nan, 2.5, 3.5])
    for dash in (0, None):
        whole, rough = (Line(x, x, "a", Style(0, dash, 0), low, x + 1) for low in (x - 1, ends))
        rough = replace(rough, hi=np.where(np.isnan(ends), np.nan, rough.hi))
        assert not line_points.rough_points(whole).any()
        assert not line_points.rough_points(replace(rough, lo=None)).any()  # a line that has no band
        assert not line_points.rough_points(replace(rough, exact=x)).any()
        thin, sure = drawn(one(rough)).lines
        assert thin.get_linewidth() < sure.get_linewidth()
        assert thin.get_markerfacecolor() == "white"
        assert thin.get_alpha() < 1
        assert thin.get_markevery() == [1, 2]
        np.testing.assert_array_equal(np.isfinite(sure.get_ydata()), np.isfinite(ends))
        np.testing.assert_array_equal(thin.get_ydata(), [0, 1, 2, 3, np.nan])
        (legend,) = drawn(one(rough, direct=False)).figure.legends
        assert "rough" in [text.get_text() for text in legend.get_texts()]
        assert len(drawn(one(whole)).lines) == 1


def test_bars_without_an_interval_are_open():
    bars = Bars(("a", "b"), np.ones(2), np.array([0.5, np.nan]), np.array([1.5, np.nan]))
    sure, rough = drawn(one(bars)).patches
    assert sure.get_facecolor()[3] > 0
    assert rough.get_facecolor()[3] == 0


def test_lines_that_a_legend_of_names_explains_are_joined_there_and_those_told_apart_by_dash_are_not():
    unnamed = panel_layout.with_legend_cell([curves([1, 2, 3], [1, 2, 3]), curves([2, 2, 2], [2, 2, 2])])
    joined = coinciding_lines.join_coinciding_lines(Figure("f", "", "", tuple(unnamed)))
    assert [[mark.name for mark in panel.marks] for panel in joined.panels] == [["a = b"], ["a = b"], []]
    assert [words for words, _ in joined.panels[-1].keys] == ["a = b"]
    swept = curves([1, 2, 3], [1, 2, 3])
    swept = replace(swept, marks=tuple(replace(mark, label="1", name=f"{mark.label}, 1") for mark in swept.marks))
    figure = Figure("f", "", "", (swept,))
    assert coinciding_lines.join_coinciding_lines(figure) is figure


def test_words_along_the_top_lie_between_a_panel_and_its_title():
    axes = drawn(one(line(), Note(1.0, np.nan, "start", "top"), title="the title"))
    (words,) = [text for text in axes.texts if text.get_text() == "start"]
    box, title = words.get_window_extent(), axes._left_title.get_window_extent()
    assert axes.get_window_extent().y1 <= box.y0 < box.y1 <= title.y0
    assert axes.transData.transform((1.0, 0.0))[0] == pytest.approx((box.x0 + box.x1) / 2, abs=1)  # a pixel


def test_a_line_beyond_its_axis_takes_no_room():
    panel = Panel(Axis("x"), Axis("y", limits=(99.98, 99.99)), (line(), Reference(0)))
    (axes,) = drawing_canvas.render(Figure("f", "", "", (panel,))).axes
    assert axes.get_tightbbox().height < 2 * axes.bbox.height


def test_words_of_a_line_at_the_left_rim_stand_right_of_it():
    for value, side in ((1.0, "left"), (9.0, "right")):
        panel = Panel(Axis("x", limits=(0, 10)), Axis("y"), (line(), Reference(value, "x", "shipped")))
        axes = drawing_canvas.render(Figure("f", "", "", (panel,))).axes[0]
        assert [text.get_ha() for text in axes.texts if "shipped" in text.get_text()] == [side]


def test_panels_of_one_column_have_their_own_heights():
    short, tall = (Panel(Axis("x"), Axis("y"), (line(),), height_mm=height) for height in (30.0, 90.0))
    canvas = drawing_canvas.render(Figure("f", "", "", (short, tall)))
    height = 120 + 5.5  # with the legend of the crosses
    assert_rounded(canvas.get_size_inches()[1] * 25.4, height, operations=6)
    low, high = (axes.get_window_extent().height for axes in canvas.axes)
    assert high > 2.5 * low


def test_a_legend_lies_on_no_curve_and_stands_once_a_figure():
    marks = tuple(Line(np.arange(3.0), np.full(3, float(i)), f"filter {i}", Style(i, i, i)) for i in range(6))
    panel = Panel(Axis("x"), Axis("y"), marks, direct=False)
    canvas = drawing_canvas.render(Figure("f", "", "", (panel,) * 4, columns=2))
    (legend,) = canvas.legends
    assert len(legend.get_texts()) == 6
    box = legend.get_window_extent()
    for axes in canvas.axes:
        assert axes.get_legend() is None
        assert not box.overlaps(axes.get_tightbbox())
    assert box.x0 >= 0
    assert box.x1 <= canvas.bbox.x1


def test_panels_that_name_different_things_alike_keep_their_legends():
    first = Panel(Axis("x"), Axis("y"), (Line(np.arange(3.0), np.arange(3.0), "a", Style(0)),), direct=False)
    other = Panel(Axis("x"), Axis("y"), (Line(np.arange(3.0), np.arange(3.0), "a", Style(1)),), direct=False)
    canvas = drawing_canvas.render(Figure("f", "", "", (first, other), columns=2))
    assert not canvas.legends
    assert all(len(axes.get_legend().get_texts()) == 1 for axes in canvas.axes)
    for axes in canvas.axes:
        assert axes.get_legend().get_window_extent().y1 < axes.get_window_extent().y0


def test_panels_that_name_one_look_otherwise_keep_their_legends():
    one, other = (
        Panel(Axis("x"), Axis("y"), (Line(np.arange(3.0), np.arange(3.0), name, Style(0)),), direct=False)
        for name in ("uniform 5", "uniform 30")
    )
    canvas = drawing_canvas.render(Figure("f", "", "", (one, other), columns=2))
    assert not canvas.legends
    assert [axes.get_legend().get_texts()[0].get_text() for axes in canvas.axes] == ["uniform 5", "uniform 30"]


def test_log_axes_have_round_ticks():
    t = np.arange(3.0)

    def ticks(low, high):
        values = Line(t, np.array([low, np.sqrt(low * high), high]))
        axes = drawing_canvas.render(Figure("f", "", "", (Panel(Axis("x"), Axis("y", "log"), (values,)),))).axes[0]
        low, high = axes.get_ylim()
        return [text.get_text() for text in axes.get_yticklabels() if low <= text.get_position()[1] <= high]

    assert ticks(6, 95) == ["10", "20", "50", "100"]
    assert ticks(0.26, 6000) == ["0.2", "1", "10", "100", "1000", "5000"]  # those beyond the powers of ten
    assert ticks(0.91, 0.99) == ["0.92", "0.94", "0.96", "0.98"]
    assert ticks(1e-4, 1) == ["0.0001", "0.001", "0.01", "0.1", "1"]
    assert ticks(1e-5, 0.1) == ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]  # all raised, not some


@pytest.mark.parametrize("width", [30, 45, 85])
@pytest.mark.parametrize(("low", "high"), [(0.0015, 0.35), (1e-5, 0.1), (20, 4e5)])
def test_numbers_at_an_axis_stand_apart_however_narrow_it_is(width, low, high):
    values = Line(np.geomspace(low, high, 5), np.arange(5.0))
    axes = drawing_canvas.render(
        Figure("f", "", "", (Panel(Axis("x", "log"), Axis("y"), (values,)),), width_mm=width)
    ).axes[0]
    axes.figure.canvas.draw()
    left, right = axes.get_xlim()
    boxes = [t.get_window_extent() for t in axes.get_xticklabels() if left <= t.get_position()[0] <= right]
    assert len(boxes) >= 1
    for one, other in pairwise(boxes):
        assert other.x0 > one.x1


def test_a_share_is_drawn_whole_up_to_one():
    panel = Panel(Axis("x"), Axis("share", limits=(0, 1)), (Line(np.arange(3.0), np.ones(3)),))
    axes = drawing_canvas.render(Figure("f", "", "", (panel,))).axes[0]
    assert axes.get_ylim() == (0, 1)
    assert not axes.lines[0].get_clip_on()


def test_maps_side_by_side_have_one_scale_of_colours():
    heats = [Heat(np.arange(2.0), np.arange(2.0), np.full((2, 2), v) + np.eye(2), "σ") for v in (1.0, 5.0)]
    both = tuple(Panel(Axis("x"), Axis("y"), (heat,)) for heat in heats)
    axes = drawing_canvas.render(Figure("f", "", "", both, columns=2)).axes[:2]
    assert {one.collections[0].get_clim() for one in axes} == {(1.0, 6.0)}


def test_the_least_cells_of_a_map_of_errors_are_framed_as_far_as_they_are_written_alike():
    values = np.array([[93.104, 93.098, np.nan], [120.0, 93.2, 94.0]])
    errors, shares = (Heat(np.arange(3), np.arange(2), values, "σ, m", is_error=is_error) for is_error in (True, False))
    assert marks.best_cells(errors) == [(0, 0), (0, 1)]
    assert marks.best_cells(shares) == marks.best_cells(replace(errors, values=np.full((2, 3), np.nan))) == []
    assert marks.best_cells(replace(errors, values=np.full((2, 3), 44.8))) == []  # all alike
    assert [patch.get_xy() for patch in drawn(one(errors)).patches] == [(-0.5, -0.5), (0.5, -0.5)]


def test_a_share_just_under_one_is_never_written_as_one():
    shares = np.array([[1.0, 0.99975, 0.99951], [0.99999, 0.5, 0.0]])
    heat = Panel(Axis("x"), Axis("y"), (Heat(np.arange(3.0), np.arange(2.0), shares, "share"),))
    drawing = drawing_canvas.draw(Figure("f", "F", "Shares.", (heat,)))
    written = [text.get_text() for text in drawing_canvas.render(drawing.figure).axes[0].texts]
    assert written == ["1", "0.9998", "0.9995", "0.99999", "0.5", "0"]
    assert all(f">{text}<" in page_figure.embed(drawing, "p") for text in written)
    assert wording.estimate((0.99996, 0.9, 1.0)) == "0.99996 [0.90000, 1.00000]"
    assert [wording.significant_digits(value) for value in (0.99999, 1.0, 1.00001)] == ["0.99999", "1.000", "1.000"]
    nan = float("nan")
    assert [wording.share(value, nan, nan) for value in (100.0, 99.9999)] == ["100 %", "99.9999 %"]


def test_a_ground_track_has_one_scale_north_and_east():
    track = Line(np.array([0.0, 10.0]), np.array([0.0, 1.0]))
    axes = drawing_canvas.render(Figure("f", "", "", (Panel(Axis("east"), Axis("north"), (track,), equal=True),))).axes[
        0
    ]
    axes.apply_aspect()
    (x0, y0), (x1, y1) = axes.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    assert x1 - x0 == pytest.approx(y1 - y0, rel=0.005, abs=0)  # from where on Matplotlib leaves it


def test_labels_at_ends_do_not_overlap():
    near = [Line(np.arange(3.0), np.full(3, 1 + i / 1000), f"l{i}") for i in range(5)]
    axes = drawn(one(*near))
    boxes = [text.get_window_extent() for text in axes.texts]
    for lower, upper in pairwise(boxes):
        assert upper.y0 >= lower.y0 + 0.9 * lower.height


def test_a_line_that_leaves_a_cut_axis_keeps_its_name_within_the_panel():
    low = Line(np.arange(3.0), np.array([0.0, -50.0, -3e4]), "lost")
    panel = Panel(Axis("x"), Axis("y", limits=(-100.0, 100.0)), (low, replace(low, y=np.ones(3), label="kept")))
    canvas = drawing_canvas.render(Figure("f", "", "", (panel,)))
    (axes,) = canvas.axes
    box = axes.get_window_extent()
    assert box.height > 0.6 * canvas.bbox.height  # laid out
    assert all(box.y0 - 1 <= text.get_window_extent().y0 <= box.y1 for text in axes.texts)


@pytest.mark.parametrize("wanted", [[0.0, 0.1, 0.2], [0.0, 5.0, 5.1, 9.9], [9.0, 9.1], [3.0]])
def test_separated(wanted):
    placed = line_names.spread_positions(np.array(wanted), np.ones(len(wanted) - 1), 0.0, 10.0)
    assert np.all(np.diff(placed) >= 1 - 1e-12)
    assert placed.min() >= 0
    assert placed.max() <= 10
    apart = np.array([1.0, 4.0, 8.0])
    np.testing.assert_array_equal(line_names.spread_positions(apart, np.ones(2), 0.0, 10.0), apart)


def test_same_bytes_each_time():
    assert drawing_canvas.save(one(line()), ("svg", "png", "pdf")) == drawing_canvas.save(
        one(line()), ("svg", "png", "pdf")
    )


def of_all_kinds():
    """A narrow figure of logarithmic axes, fewer ticks than wanted, a remark, a long title, a map, a ground track."""
    decades = replace(line(), x=10.0 ** np.arange(20), y=np.logspace(-3, 2, 20), lo=None, hi=None, exact=None)
    long = replace(line(), x=np.linspace(20.0, 4e5, 20))
    heat = Heat(np.arange(3.0), np.arange(2.0), np.arange(6.0).reshape(2, 3), "value")
    log = Axis("$x$, s", "log"), Axis("$\\sigma$ of $y$, m", "log")
    whole = (
        *(
            Panel(*log, (decades,), title="a title, of two, parts of a line", remark="said"),
            Panel(Axis("x"), Axis("y"), (long,)),
        ),
        *(Panel(Axis("x", ticks=((1.0, "one"),)), Axis("y"), (line(),)), Panel(Axis("x"), Axis("y"), (heat,))),
        Panel(Axis("east, m"), Axis("north, m"), (line(), Reference(0.5, label="half")), equal=True),
    )
    return Figure("all", "All", "Every kind.", whole, columns=3, width_mm=100.0)


def narrowed():
    """A figure whose layout leaves so little to its panel that fewer numbers stand at it than before."""
    names = Axis("y", ticks=((0.0, "a long name of no deviation"), (0.5, "and of one")))
    x = np.linspace(20.0, 4e5, 20)
    return Figure("narrow", "Narrow", "Wide names.", (Panel(Axis("x"), names, (replace(line(), x=x),)),), width_mm=70.0)


def shared():
    """Two panels with one axis of y."""
    return replace(of_all_kinds(), panels=of_all_kinds().panels[:2], share_y=True)


@pytest.mark.slow_cases_except("narrowed")
@pytest.mark.parametrize("make", [of_all_kinds, narrowed, shared])
def test_cached_ticks_change_no_picture(monkeypatch, make):
    kinds = ("png", "svg") if make is of_all_kinds else ("png", "svg", "pdf")
    remembered = drawing_canvas.save(make(), kinds)
    monkeypatch.setattr(drawing_canvas, "CACHED_METHODS", ())
    assert drawing_canvas.save(make(), kinds) == remembered


def test_ticks_are_placed_once_for_each_place_of_a_panel(monkeypatch):
    placed = []
    for name in drawing_canvas.CACHED_METHODS:  # of this version of Matplotlib
        assert hasattr(XAxis, name)
    plain = XAxis._update_ticks
    monkeypatch.setattr(XAxis, "_update_ticks", lambda axis: placed.append(axis) or plain(axis))
    drawing_canvas.save(one(line()), ("png", "svg"))
    assert len(placed) == 4  # by the layout twice, for each picture once


def test_a_figure_that_is_handed_out_remembers_nothing():
    axes = drawn(one(line()))
    assert not [side for side in (axes.xaxis, axes.yaxis) if vars(side).keys() & set(drawing_canvas.CACHED_METHODS)]
    axes.set_xticks([3.0])
    axes.figure.canvas.draw()
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["3"]


@pytest.mark.slow
def test_titles_stand_where_matplotlib_would_place_them(monkeypatch):
    chosen = drawing_canvas.save(of_all_kinds(), ("svg", "png"))
    monkeypatch.setitem(style.STYLE, "axes.titley", None)
    assert drawing_canvas.save(of_all_kinds(), ("svg", "png")) == chosen


def test_garbage_is_collected_again_after_a_figure_whatever_comes_of_it():
    assert gc.isenabled()
    drawing_canvas.save(one(line()), ("svg",))
    assert gc.isenabled()
    with pytest.raises(KeyError, match="no format"):
        drawing_canvas.save(one(line()), ("no format",))
    assert gc.isenabled()
    gc.disable()
    try:
        drawing_canvas.save(one(line()), ("svg",))
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_size_in_millimetres():
    described = one(replace(line(), exact=None))
    width, height = drawing_canvas.render(described).get_size_inches() * 25.4
    assert_rounded(width, described.width_mm, operations=2)
    assert_rounded(height, described.panel_height_mm, operations=2)


def test_long_lines_are_thinned_and_short_ones_are_whole():
    assert len(drawn(one(line(5000))).lines[0].get_xdata()) <= line_points.MAX_POINTS
    assert len(drawn(one(line(1999))).lines[0].get_xdata()) == 1999


HOSTILE = ["<script>alert(1)</script>", r"$\frac{$", "漢 & " + 60 * "x"]


@pytest.mark.parametrize("name", HOSTILE)
def test_any_name_can_be_drawn(name, expected_radar):
    filters = [
        {"name": name, "observes": ["range"], "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
    ]
    results = [expected_radar("rls2", filters=filters, radar={"name": name})]
    made = {"curves": tables.curves(results), "gains": tables.gains(results), **range_doppler.tables(results)}
    shown = SimpleNamespace(stem="mine", cases_in_figure=lambda figure: [SimpleNamespace(name=results[0].name)])
    drawn = range_doppler_figures.figures(results, made, shown)
    for figure in (drawn["sigma_r"], drawn["gain_r"]):
        saved = drawing_canvas.save(figure, ("svg",))["svg"].decode()
        assert "<script" not in saved
    assert key_labels.plain_case_label(results[0]) == name


def test_numbers_for_people():
    assert [key_labels.format_value(v, powers=True) for v in (1e-3, 0.1, 1, 250.0)] == ["10⁻³", "10⁻¹", "1", "250"]
    assert [
        key_labels.format_value(v) for v in (1e-3, 0.1, 1, 100, 1000.0, 1e5, 250.0, 0.00025, -2.5, "fly_by", True)
    ] == [*("0.001", "0.1", "1", "100", "1000", "10⁵", "250", "0.00025", "−2.5", "fly by", "True")]


def test_angles_given_in_radians_are_shown_in_degrees():
    result = SimpleNamespace(spec=None, swept_values=(("target.turn.rate_radps", 0.00873),))
    assert key_labels.swept_description(result).endswith("= 0.5°/s")
    assert key_labels.key_axis_label(result, "target.turn.rate_radps").endswith(", °/s")
    x, axis = sweep_figures.axis_positions(result, "target.turn.rate_radps", [0.0, 0.01745])
    assert axis.label.endswith(", °/s")
    assert_rounded(x, [0, 0.01745 * 180 / np.pi], operations=2)
    assert key_labels.degrees_factor_and_unit("rad/s2")[1] == "°/s2"
    assert key_labels.label_with_unit("a", "°/s2") == "a, °/s²"


def shown_together(*values, log=False):
    """A panel a value, of one line with an interval of ± 0.1."""
    t = np.arange(4.0)
    axis = Axis("σ", "log") if log else Axis("σ", limits=(0, None))
    lines = [Line(t, np.full(4, v), "r", lo=np.full(4, v - 0.1), hi=np.full(4, v + 0.1)) for v in values]
    return [Panel(Axis("t"), axis, (one,), f"panel {n}") for n, one in enumerate(lines)]


def test_panels_side_by_side_have_one_kind_of_scale():
    linear, log = shown_together(1.0)[0], shown_together(2.0, log=True)[0]
    assert [panel.y.scale for panel in panel_layout.share_y_axis([linear, log])] == ["log", "log"]
    assert panel_layout.share_y_axis([linear])[0].y == linear.y
    others = [linear, replace(log, y=Axis("V"))]
    assert panel_layout.share_y_axis(others) == others


@pytest.mark.parametrize(("values", "scale"), [((1.0, 3.0), "linear"), ((1.0, 300.0), "log")])
def test_panels_of_one_quantity_share_the_axis_that_holds_all_of_them(values, scale):
    figure = panel_layout.arrange_columns(Figure("f", "F", "F.", tuple(shown_together(*values))))
    assert figure.share_y
    (y,) = {panel.y for panel in figure.panels}
    assert y.scale == scale
    low, high = y.limits
    lines = [mark for panel in figure.panels for mark in panel.marks]
    assert low < min(line.lo.min() for line in lines)
    assert high > max(line.hi.max() for line in lines)
    axes = drawing_canvas.render(figure).axes
    assert [one.get_ylabel() for one in axes] == ["σ", ""]
    assert axes[0].get_ylim() == axes[1].get_ylim() == y.limits


@pytest.mark.parametrize(
    ("step", "count"), [(10.0, 15), (5.0, 29), (5.0, 30), (2.5, 89), (1.0, 100), (0.1, 2001), (1, 7)]
)
def test_ticks_stand_at_scans_and_at_the_last(step, count):
    """Those between are even; no number is nearer to the next than half of that."""
    x = step * np.arange(count)
    axes = drawing_canvas.render(one(Line(x, 1.0 + x, "a"))).axes[0]
    ticks = np.asarray(axes.get_xticks())
    assert (ticks[0], ticks[-1]) == (0.0, x[-1])
    assert_rounded(ticks / step, np.round(ticks / step), operations=2)
    gaps = np.diff(ticks)
    assert_rounded(gaps[:-1], gaps[0] * np.ones(len(gaps) - 1), x[-1], operations=2)
    assert 0.5 <= gaps[-1] / gaps[0] < 1.5
    assert 3 <= len(ticks) <= 8


def test_uneven_times_have_round_ticks():
    x = np.array([0.0, 1.0, 2.5, 7.1, 9.9, 13.7])
    assert list(drawing_canvas.render(one(Line(x, x, "a"))).axes[0].get_xticks()) == [0, 2.5, 5, 7.5, 10, 12.5]
    x = 523.599 * np.arange(5)  # even, but no number that is said
    assert list(drawing_canvas.render(one(Line(x, x, "a"))).axes[0].get_xticks()) == [0, 500, 1000, 1500, 2000]


def test_a_line_that_ends_beyond_its_axis_is_marked_so():
    x = np.arange(6.0)
    lines = (
        Line(x, -x, "in", Style(0, 0)),
        Line(x, -100 * x, "below", Style(1, 0)),
        Line(x, 90 * x, "above", Style(2, 0)),
    )
    figure = Figure("f", "F", "F.", (Panel(Axis("t"), Axis("gain", limits=(-100.0, 100.0)), lines),))
    (axes,) = drawing_canvas.render(figure).axes
    assert {text.get_text() for text in axes.texts} == {"in", "below ↓", "above ↑"}


def test_an_axis_of_sigma_shows_no_rounding():
    sigma = Line(np.arange(4.0), np.array([1e-9, 0.5, 5.0, 50.0]))
    axis = panel_layout.fitting_axis("σ", [sigma])
    assert axis.scale == "log"
    assert axis.limits == (0.25, None)
    assert panel_layout.fitting_axis("σ", [replace(sigma, y=np.array([0.0, 1.0, 2.0, 15.0]))]).scale == "linear"


def test_cases_of_many_filters_have_a_panel_each_where_lines_would_be_too_many(expected_radar, monkeypatch):
    results = [expected_radar("rls2", 10.0**-n, f"rls2 D={n}") for n in range(1, 8)]
    assert [len(members) for members in case_selection.group_by_panel(results).values()] == [7]  # of two filters each
    monkeypatch.setattr(case_selection, "FEW_FILTERS", 1)
    groups = case_selection.group_by_panel(results)
    assert [len(members) for members in groups.values()] == [1] * 7
    assert len(set(groups)) == 7
    assert [len(members) for members in case_selection.group_by_panel(results[:3]).values()] == [3]
    assert len(case_selection.group_by_panel(results, np.inf)) == 1


def test_losses_far_below_are_cut_and_the_caption_says_so():
    def gains(least):
        rows = {"t_s": [0.0, 1.0], "gain_percent": [10.0, least], "gain_lo": [9.0, least], "gain_hi": [11.0, least]}
        return tables.frame(rows | {"exact_percent": [np.nan, np.nan]})

    result = SimpleNamespace(
        name="a",
        swept_values=(),
        count=100,
        spec=SimpleNamespace(device="A"),
        axes=SimpleNamespace(filters=("r", "v"), baseline=0),
    )
    drawn = {
        least: time_figures.gain_figure(
            "gain_r", [result], {("a", "v", "r"): gains(least)}, Component("r", "m", "r", "range")
        )
        for least in (-150.0, -30000.0)
    }
    assert drawn[-30000.0].panels[0].y.limits == (-100.0, 100.0)
    assert "off the axis" in drawn[-30000.0].caption
    assert drawn[-150.0].panels[0].y.limits == (None, None)
    assert "off the axis" not in drawn[-150.0].caption


def test_scattered_points_are_all_drawn():
    axes = drawn(one(line(60, dash=None, marker=1)))
    curve = axes.lines[0]
    assert len(curve.get_markevery()) == 60
    assert len(curve.get_xdata()) == 60


def test_several_panels_have_their_legend_in_a_cell_of_its_own():
    marks = tuple(Line(np.arange(3.0), np.full(3, float(i)), f"filter {i}", Style(i, i, i)) for i in range(6))
    whole = panel_layout.with_legend_cell([Panel(Axis("x"), Axis("y"), marks), Panel(Axis("x"), Axis("y"), marks)])
    assert [words for words, _ in whole[-1].keys] == [f"filter {i}" for i in range(6)]
    assert not whole[-1].marks
    assert [mark.name for mark in whole[1].marks] == [f"filter {i}" for i in range(6)]
    assert not any(mark.label for panel in whole for mark in panel.marks)
    canvas = drawing_canvas.render(Figure("f", "", "", tuple(whole), columns=2))
    (legend,) = canvas.legends
    assert [text.get_text() for text in legend.get_texts()] == [f"filter {i}" for i in range(6)]
    assert len(canvas.axes) == 2


@pytest.mark.parametrize(("highest", "last"), [(3, 3), (20, 20), (40, 40), (95, 80), (1000, 1000)])
def test_counts_have_ticks_at_whole_numbers(highest, last):
    ticks = [value for value, _ in panel_layout.count_axis("n", highest).ticks]
    assert all(value == int(value) for value in ticks)
    assert ticks[-1] == last
    assert len(ticks) <= 9


def test_a_sweep_is_shown_whole_in_figures_with_a_panel_for_each_config(expected_radar):
    results = [expected_radar(stem, 10.0**-n, f"{stem} D={n}") for stem in ("rls1", "rls2") for n in range(1, 6)]
    names = [result.name for result in results]
    shown, left_out = case_selection.select_cases_by_panel(results, names)
    assert [result.name for result in shown] == names
    assert left_out == ""
    some, left_out = case_selection.select_cases(results, names)
    assert left_out == " Shown: 8 of 10; the others are in the tables."
    assert [some[0].name, some[-1].name] == [names[0], names[-1]]


def test_crosses_have_the_name_of_what_they_are():
    panel = Panel(Axis("x"), Axis("y"), (line(),), crosses="formula")
    (legend,) = drawing_canvas.render(Figure("f", "", "", (panel,))).legends
    assert [text.get_text() for text in legend.get_texts()] == ["formula"]


def test_up_to_sixteen_points_measured_and_exact_stand_together():
    for points, together in ((5, True), (16, True), (17, False)):
        curve, crosses = drawn(one(line(points, marker=0))).lines
        marked = set(curve.get_xdata()[curve.get_markevery()])
        assert (marked == set(crosses.get_xdata())) is together


def test_titles_are_broken_after_commas_and_long_parts_between_words():
    words = "gate_probability = 0.5, sensor.detection_probability = 0.7, $D_M$ = 1"
    assert style.wrap(words, 200) == words
    assert style.wrap(words, 50) == "gate_probability = 0.5,\nsensor.detection_probability = 0.7, $D_M$ = 1"
    assert style.wrap("σ = 0.5°, frame of coordinates = cartesian unbiased", 26) == (
        "σ = 0.5°,\nframe of coordinates =\ncartesian unbiased"
    )
    assert style.wrap("", 5) == ""


def test_no_two_of_many_scattered_series_look_alike():
    looks = [style.line_options(Style(n, None, n)) for n in range(40)]
    assert len({(look["color"], look["marker"]) for look in looks}) == 40
    assert len({look["marker"] for look in looks}) == len(style.MARKERS)


def test_a_gain_that_is_nowhere_known_is_drawn_as_nothing_and_cuts_no_axis():
    """A filter without an error has no gain against itself: warnings are errors here."""
    nowhere, loss = (Line(np.arange(3.0), y, "f") for y in (np.full(3, np.nan), np.array([np.nan, -1e4, 5.0])))
    axis, marks = time_figures._cut(Axis("gain"), [nowhere])
    assert axis.limits == Axis("gain").limits
    assert marks[1:] == (nowhere,)
    assert time_figures._cut(Axis("gain"), [nowhere, loss])[0].limits == (-time_figures.CUT_LOSS_PERCENT, 100.0)


@pytest.mark.parametrize(("label", "turned"), [("$\\Lambda$", 0), ("$c$", 0), ("$\\sigma$, m", 90), ("gain, %", 90)])
def test_a_letter_beside_an_axis_stands_upright(label, turned):
    figure = Figure("one", "One", "A figure.", (Panel(Axis("x, s"), Axis(label), (line(),)),))
    assert drawn(figure).yaxis.label.get_rotation() == turned


def test_a_headline_stands_over_the_panels_and_inside_the_figure():
    described = replace(one(line(), title="panel"), headline="a sentence of $ 5 and many words, " * 6)
    canvas = drawing_canvas.render(described)
    box = canvas._suptitle.get_window_extent()
    assert canvas._suptitle.get_text().count("\n") >= 3
    assert box.y0 >= canvas.axes[0].title.get_window_extent().y1 >= canvas.axes[0].get_window_extent().y1
    assert box.y1 <= canvas.bbox.height
    assert 0 <= box.x0 < box.x1 <= canvas.bbox.width
    plain = drawing_canvas.render(replace(described, headline=""))
    assert canvas.get_figheight() > plain.get_figheight()
