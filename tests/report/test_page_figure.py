"""Figures in a page: each value has its title where it is drawn, ids are unique, text stays text and is escaped."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from radarsim.language.current import use_language
from radarsim.report.drawing import canvas, page_figure, page_values
from radarsim.report.drawing.model import Axis, Bars, Figure, Heat, Line, Panel, Style


def page_svg(*panels, prefix="p", **figure):
    drawn = canvas.draw(Figure("one", "One", "A figure.", panels, **figure))
    return page_figure.embed(drawn, prefix)


def panel(*marks, x="time, s", y="$\\sigma$ of $V_r$, m/s", **keys):
    return Panel(Axis(x), Axis(y), marks, **keys)


def curve(n=5, label="a", **style):
    x = np.arange(n, dtype=float)
    return Line(x, 10 + x, label, Style(marker=0, **style), 8 + x, 12 + x, 10.5 + x)


def titles(svg):
    return [element.text for element in ElementTree.fromstring(svg).iter("title")]


def test_each_marker_is_titled_with_curve_time_value_interval_and_exact_value():
    assert titles(page_svg(panel(curve(2)))) == [
        "a\ntime, s: 0\nσ of V_r, m/s: 10 [8, 12], exact 10.5",
        "a\ntime, s: 1\nσ of V_r, m/s: 11 [9, 13], exact 11.5",
    ]


def test_titles_lie_upon_the_markers():
    line = Line(np.arange(3.0), np.array([0.0, 2.0, 1.0]), style=Style(marker=0))
    svg = ElementTree.fromstring(page_svg(panel(line)))
    values = [(float(circle.get("cx")), float(circle.get("cy"))) for circle in svg.iter("circle")]
    markers = next(group for group in svg.iter("g") if "fill:#ffffff" in group.get("style", "")).findall("use")
    assert len(values) == len(markers) == 3
    np.testing.assert_allclose(values, [(float(use.get("x")), float(use.get("y"))) for use in markers], atol=0.06)


def test_missing_and_infinite_ends_of_intervals():
    y = np.array([1.0, np.nan, 2.0])
    line = Line(np.arange(3.0), y, "g", Style(marker=0), y - 0.5, np.array([np.inf, np.nan, np.nan]))
    assert titles(page_svg(panel(line, x="t", y="y"))) == ["g\nt: 0\ny: 1 [0.5, ∞]", "g\nt: 2\ny: 2 [1.5, ∞]"]
    nothing = np.full(3, np.nan)
    unknown = Line(np.arange(3.0), y, "g", lo=nothing, hi=nothing)
    assert titles(page_svg(panel(unknown, x="t", y="y")))[0] == "g\nt: 0\ny: 1"


def test_points_outside_the_axes_have_no_title():
    limited = Panel(Axis("t"), Axis("y", limits=(0.0, 12.2)), (curve(5),))
    assert len(titles(page_svg(limited))) == 3
    logarithmic = Panel(Axis("t"), Axis("y", "log"), (Line(np.arange(3.0), np.array([0.0, 1.0, 10.0]), "a"),))
    assert len(titles(page_svg(logarithmic))) == 2


def test_bars_and_categories_are_named_and_cells_of_a_large_map():
    bars = Bars(("p", "q"), np.array([1.0, 2.0]), np.array([0.5, 1.0]), np.array([2.0, 3.0]))
    assert titles(page_svg(panel(bars, y="share"))) == ["p\nshare: 1 [0.5, 2]", "q\nshare: 2 [1, 3]"]
    categories = Panel(Axis("", ticks=((0.0, "first"), (1.0, "second"))), Axis("n"), (curve(2, ""),))
    assert titles(page_svg(categories))[1].startswith("second\nn: 11")
    values = np.arange(110.0).reshape(10, 11)
    values[0, 0] = np.nan
    heat = titles(page_svg(panel(Heat(np.arange(11.0), np.arange(10.0), values, "gain, %"), x="x", y="y")))
    assert len(heat) == 109
    assert heat[0] == "x: 1\ny: 0\ngain, %: 1"
    written = Heat(np.arange(2.0), np.arange(2.0), np.ones((2, 2)), "gain")
    assert titles(page_svg(panel(written))) == []  # the values stand in the cells


def test_a_crowd_of_points_has_no_titles():
    crowd = curve(page_values.MAX_VALUE_MARKS + 1, dash=None)
    assert titles(page_svg(panel(crowd, curve(2)))) == titles(page_svg(panel(curve(2))))


def test_ids_are_those_that_are_used_and_begin_with_the_prefix():
    both = page_svg(panel(curve()), prefix="svg0") + page_svg(panel(curve()), prefix="svg1")
    ids, used = re.findall(r' id="([^"]+)"', both), set(re.findall(r'(?:href="|url\()#([^")]+)', both))
    assert len(ids) == len(set(ids))
    assert set(ids) == used
    assert {name.split("-")[0] for name in ids} == {"svg0", "svg1"}


def test_the_headline_is_in_the_file_alone():
    drawn = canvas.draw(Figure("one", "One", "A figure.", (panel(curve()),), headline="The answer."))
    svg = page_figure.embed(drawn, "p")
    assert b"The answer." in drawn.files["svg"]
    assert "The answer." not in svg
    _, top, _, height = (float(v) for v in ElementTree.fromstring(svg).get("viewBox").split())
    whole = float(re.search(rb'viewBox="0 0 [\d.]+ ([\d.]+)"', drawn.files["svg"])[1])
    assert 3 < top < 20
    assert top + height == pytest.approx(whole, abs=0.02)


def test_text_stays_text_and_is_escaped():
    hostile = "<script>&\"'"
    named = Panel(Axis(hostile), Axis(hostile), (curve(label=hostile),), hostile, remark=hostile)
    svg = page_figure.embed(canvas.draw(Figure("f", hostile, hostile, (named,))), "p")
    assert "<script" not in svg
    assert svg.count("&lt;script&gt;") >= 8
    assert "<metadata" not in svg
    assert ">time, s</text>" in page_svg(panel(curve()))


def test_control_characters_are_replaced():
    assert ">a�b�</text>" in page_svg(panel(curve(label="a\x07b\uffff")))


def test_the_page_is_drawn_from_the_bytes_of_the_file():
    described = Figure("one", "One", "A figure.", (panel(curve()),))
    drawn = canvas.draw(described, ("svg", "pdf"))
    assert drawn.files == canvas.save(described, ("svg", "pdf"))
    assert drawn.svg is drawn.files["svg"]
    assert canvas.draw(described, ("png",)).svg == drawn.svg


def test_titles_are_in_the_language_of_the_page():
    line = Line(np.zeros(1), np.array([0.5]), "a", exact=np.array([0.25]))
    with use_language("ru"):
        (title,) = titles(page_svg(panel(line)))
    assert title.endswith("0,5, точно 0,25")
