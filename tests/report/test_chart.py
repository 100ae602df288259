"""Charts of the page: what is drawn lies where the data says, what a pointer reads is the data, text stays text."""

import re

import numpy as np
import pytest

from radarsim.report import chart
from radarsim.report.drawing import Axis, Bars, Figure, Heat, Line, Note, Panel, Reference, Style
from tests.tolerances import assert_rounded, rounding

PAGES = ("#ffffff", "#0f1419")


def one(*marks, x=None, y=None, **figure):
    panel = Panel(x or Axis("t, s"), y or Axis("$\\sigma$ of $V_r$, m/s"), marks, "the panel", remark="one\ntwo")
    return chart.chart(Figure("one", "One", "A figure.", (panel,)), **figure)


def line(n=20, label="a", **style):
    x = np.arange(n, dtype=float)
    return Line(x, 10 + np.cos(x), label, Style(**style), 8 + np.cos(x), 12 + np.cos(x), 10 + np.cos(x))


def points(svg, css):
    """The corners of the first path of a class, from its relative steps."""
    path = re.search(rf'<path class="{css}" d="([^"]+)"', svg)[1]
    at, found = np.zeros(2), []
    for kind, x, y in re.findall(r"([Ml])(-?[\d.]+) (-?[\d.]+)", path):
        at = (at if kind == "l" else 0) + np.array([float(x), float(y)])
        found.append(at)
    return np.array(found)


def test_the_curve_lies_where_the_data_says_and_the_pointer_reads_the_data():
    mark = line()
    panel = one(mark).panels[0]
    data = panel.data
    x, y = (chart.Scale(bool(a[0]), *a[1:]) for a in (data["x"], data["y"]))
    drawn = points(panel.svg, "l")
    tenth = 0.05 + rounding(drawn.max(), len(drawn))  # corners are at tenths, and their steps are added up here
    np.testing.assert_allclose(drawn[:, 0], x.place(mark.x), rtol=0, atol=tenth)
    np.testing.assert_allclose(drawn[:, 1], y.place(mark.y), rtol=0, atol=tenth)
    kept = data["lines"][0]
    for key, values in (("y", mark.y), ("l", mark.lo), ("h", mark.hi), ("e", mark.exact)):
        np.testing.assert_allclose(kept[key], values, rtol=0.5e-4)  # five digits
    assert data["xs"] == [mark.x.tolist()]
    assert (kept["n"], data["yl"]) == ("a", "σ of V_r, m/s")


def test_curves_of_one_name_share_a_switch_and_unnamed_ones_have_none():
    panels = tuple(
        Panel(Axis("x"), Axis("y"), marks) for marks in ((line(), line(label="b")), (line(),), (line(label=""),))
    )
    made = chart.chart(Figure("f", "F", "", panels))
    assert [(one.group, str(one.name)) for one in made.switches] == [(0, "a"), (1, "b")]
    assert [[kept["g"] for kept in panel.data["lines"]] for panel in made.panels] == [[0, 1], [0], [-1]]
    assert [panel.svg.count('data-g="0"') for panel in made.panels] == [1, 1, 0]
    named = chart.chart(Figure("f", "F", "", (Panel(Axis("x"), Axis("y"), (Line(np.ones(1), np.ones(1), name="c"),)),)))
    assert str(named.switches[0].name) == "c"


def test_a_band_is_drawn_only_where_it_can_be_seen():
    wide, x = line(), np.arange(20.0)
    narrow = Line(x, 100 * x, "n", Style(), 100 * x - 0.1, 100 * x + 0.1)
    assert 'class="b"' in one(wide).panels[0].svg
    assert 'class="b"' not in one(narrow).panels[0].svg
    assert 'class="w"' in one(line(dash=None, marker=0)).panels[0].svg


def test_gaps_and_endless_intervals():
    y = np.array([1.0, np.nan, 2.0, 3.0])
    hi = np.array([np.inf, np.nan, 2.5, 3.5])
    panel = one(Line(np.arange(4.0), y, "g", Style(), y - 0.5, hi)).panels[0]
    assert len(re.findall("M", re.search(r'class="l" d="([^"]+)"', panel.svg)[1])) == 2
    assert panel.data["lines"][0]["y"] == [1.0, None, 2.0, 3.0]
    assert "nan" not in panel.svg
    assert "inf" not in panel.svg


def test_long_lines_are_thinned_and_keep_their_last_point():
    data = one(line(1001), points=100).panels[0].data
    assert len(data["xs"][0]) <= 101
    assert data["xs"][0][-1] == 1000


def test_all_kinds_of_marks():
    heat = Heat(np.array([1.0, 10.0, 100.0]), np.arange(2.0), np.array([[1.0, 2, 3], [4, np.nan, 6]]), "share")
    panel = one(heat).panels[0]
    assert panel.svg.count("<path fill=") == 5
    assert panel.data["heat"] == {
        "v": [[1, 2, 3], [4, None, 6]],
        "l": "share",
        "x": ["1", "10", "100"],
        "y": ["0", "1"],
    }
    bars = one(Bars(("p", "q"), np.array([1.0, 2.0]), np.array([0.5, 1.0]), np.array([2.0, 3.0]))).panels[0]
    assert {">p<", ">q<"} <= set(re.findall(">[pq]<", bars.svg))
    assert bars.data["lines"][0]["h"] == [2.0, 3.0]
    svg = (
        one(line(), Reference(9.0, label="nine"), Reference(3.0, "x", "three"), Note(1, 9, "note", "sw")).panels[0].svg
    )
    assert {"nine", "three", "note"} <= set(re.findall(r">(nine|three|note)<", svg))


def test_text_is_escaped_everywhere():
    hostile = "<script>&\"'"
    mark = Line(np.arange(3.0), np.arange(3.0), hostile)
    figure = Figure("f", hostile, hostile, (Panel(Axis(hostile), Axis(hostile), (mark,), hostile, remark=hostile),))
    made = chart.chart(figure)
    whole = "".join([*(p.svg + p.title + p.remark for p in made.panels), *(s.name + s.sample for s in made.switches)])
    assert "<script" not in whole
    assert whole.count("&lt;script&gt;") >= 6
    assert 'aria-label="&lt;script&gt;&amp;&#34;&#39;' in whole


def test_mathematical_text():
    assert chart.spoken("$\\sigma$ of $V_r$, $\\dot y$, 5 \\$, $10^{-3}$") == "σ of V_r, y\u0307, 5 $, 10^-3"
    assert chart.html("$v_\\beta$") == "<i>v</i><sub>β</sub>"
    assert chart.html("$D_M$ & co") == "<i>D</i><sub>M</sub> &amp; co"
    assert chart.tspans("a $b_c$ d", 10) == (
        'a <tspan font-style="italic">b</tspan><tspan dy="2.5" font-size="7.5">c</tspan><tspan dy="-2.5"> d</tspan>'
    )


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 140, ["0", "50", "100"]),
        (-1, 1, ["−1", "−0.5", "0", "0.5", "1"]),
        (0, 3e6, ["0", "10⁶", "2·10⁶", "3·10⁶"]),
        (2.5, 2.6, ["2.5", "2.525", "2.55", "2.575", "2.6"]),
    ],
)
def test_linear_ticks_are_round(low, high, expected):
    assert [text for _, text in chart.Scale(False, low, high, 0, 100).ticks(4)] == expected


def test_logarithmic_ticks():
    texts = [text for _, text in chart.Scale(True, 0.009, 120, 0, 100).ticks(5)]
    assert texts == ["0.01", "0.1", "1", "10", "100"]
    assert [text for _, text in chart.Scale(True, 8, 600, 0, 100).ticks(5)] == ["10", "20", "50", "100", "200", "500"]
    assert len(chart.Scale(True, 1e-12, 1e12, 0, 100).ticks(5)) <= 8
    inside = [v for v, _ in chart.Scale(True, 20, 90, 0, 100).ticks(5)]
    assert all(20 <= v <= 90 for v in inside)


@pytest.mark.parametrize("values", [[], [np.nan], [5.0], [0.0], [-3.0, -3.0]])
def test_a_scale_for_any_data(values):
    for kind in ("linear", "log"):
        made = chart.scale(Axis("x", kind), [np.array(values, dtype=float)], "y", 0, 100)
        assert made.low < made.high
        assert made.ticks(5)


def test_curves_stand_out_from_both_pages_and_from_each_other_in_grey():
    styles = [Style(n) for n in range(8)] + [Style(share) for share in np.linspace(0, 1, 9).tolist()]
    for style in styles:
        for colour, page in zip(chart.ink_colours(style), PAGES, strict=True):
            assert chart.contrast(colour, page) >= 3, (style, colour, page)
    assert len(set(chart.DASHES)) == len(chart.DASHES)
    assert len(set(chart.MARKERS)) == len(chart.MARKERS)


def test_contrast_is_that_of_the_standard():
    assert_rounded(chart.contrast("#ffffff", "#000000"), 21, operations=4)
    assert chart.contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)


def test_paths_are_short():
    x = np.arange(100.0)
    assert len(chart.path(x, np.sin(x) * 50 + 100)) < 12 * len(x)


def test_where_neither_end_is_known_there_is_no_band():
    x, y, nothing = np.arange(6.0), np.full(6, 5.0), np.full(6, np.nan)
    assert 'class="b"' not in one(Line(x, y, "a", lo=nothing, hi=nothing)).panels[0].svg
    lo, hi = y - 2, y + 2
    lo[2], hi[2] = np.nan, np.nan
    band = re.search(r'class="b" d="([^"]*)"', one(Line(x, y, "a", lo=lo, hi=hi)).panels[0].svg)[1]
    assert band.count("M") == band.count("z") == 2
    open_end = re.search(r'class="b" d="([^"]*)"', one(Line(x, y, "a", lo=y - 2, hi=np.full(6, np.inf))).panels[0].svg)[
        1
    ]
    assert open_end.count("M") == 1


def test_a_point_of_a_band_without_a_neighbour_has_a_whisker():
    x, y = np.arange(6.0), np.array([5, 5, np.nan, 5, np.nan, 5])
    drawn = one(Line(x, y, "a", lo=y - 2, hi=y + 2)).panels[0].svg
    assert [re.search(rf'class="{kind}" d="([^"]*)"', drawn)[1].count("M") for kind in "bw"] == [1, 2]


def test_points_that_a_logarithmic_axis_lacks_do_not_widen_the_other_and_lone_ones_are_marked():
    x, y = np.arange(1.0, 101.0), np.zeros(100)
    y[[50, 51, 52, 77]] = 1.0
    lines = Line(x, y, "a", Style(0, 0, 0))
    panel = chart.chart(Figure("f", "t", "c", (Panel(Axis("x"), Axis("y", "log"), (lines,)),))).panels[0]
    _, low, high, *_ = panel.data["x"]
    assert 49 < low < 51
    assert 78 < high < 80
    markers = re.search(r'class="m" d="([^"]*)"', panel.svg)[1].count("M")
    assert markers == len({i for i in range(0, 100, 7) if y[i]} | {77})
