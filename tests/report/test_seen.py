"""What captions say is to be seen: the lines that end lowest and highest, what intervals leave open, crosses."""

from dataclasses import replace

import numpy as np

from radarsim.report import seen
from radarsim.report.drawing import Axis, Figure, Heat, Line, Panel

T = np.arange(5.0)


def line(name, last, half=0.1, exact=None):
    y = np.linspace(9.0, last, 5)
    ends = (y - half, y + half) if half is not None else (None, None)
    return Line(T, y, name, lo=ends[0], hi=ends[1], exact=exact)


def figure(*panels, title="σ of the range"):
    return Figure("f", title, "How.", tuple(Panel(Axis("t"), Axis("y"), lines) for lines in panels))


def test_of_one_panel_the_lowest_and_the_highest_with_their_values():
    made = figure((line("r", 3.0), line("r+Vr", 1.0), line("none", 2.0)))
    made = replace(made, panels=(replace(made.panels[0], y=Axis("$a$, m/s²")),))
    assert seen.at_the_end(made) == "At the end lowest: r+Vr (1 m/s²); highest: r (3 m/s²)."
    assert seen.highest_at_the_end(made) == "At the end highest: r (3 m/s²); lowest: r+Vr (1 m/s²)."


def test_lines_whose_intervals_overlap_are_told_together():
    made = figure((line("a", 1.0), line("b", 1.15), line("c", 3.0)))
    assert "lowest: a and b (1–1.15)" in seen.at_the_end(made)
    assert "highest: c (3)" in seen.at_the_end(made)
    level = figure((line("a", 1.0), line("b", 1.1)))
    assert seen.at_the_end(level) == "At the end all are within each other's intervals."


def test_a_line_of_unknown_interval_is_told_roughly():
    nothing = np.full(5, np.nan)
    high = Line(T, np.linspace(9.0, 278.0, 5), "cured, gated", lo=nothing, hi=nothing)
    told = seen.at_the_end(figure((line("a", 1.0), line("c", 3.0), high)))
    assert told == "At the end lowest: a (1); highest: cured, gated (about 278)."
    low = replace(high, y=np.linspace(9.0, 1.04, 5))
    assert "lowest: a and “cured, gated” (about 1–1.04)" in seen.at_the_end(
        figure((line("a", 1.0), low, line("c", 3.0)))
    )


def test_a_line_ends_where_its_last_known_point_is():
    short = line("b", 0.5)
    short = replace(short, y=np.append(short.y[:3], [np.nan, np.nan]))  # 9, 6.875, 4.75
    assert seen.at_the_end(figure((line("a", 1.0), short))) == "At the end lowest: a (1); highest: b (4.75)."


def test_intervals_that_share_no_value_are_not_all_alike():
    """Both others overlap the lowest's interval, and not each other's."""
    wide = Line(T, np.linspace(9.0, 1.0, 5), "wide", lo=np.full(5, 0.5), hi=np.full(5, 2.0))
    near = Line(T, np.linspace(9.0, 1.2, 5), "near", lo=np.full(5, 1.1), hi=np.full(5, 1.3))
    far = Line(T, np.linspace(9.0, 1.8, 5), "far", lo=np.full(5, 1.7), hi=np.full(5, 1.9))
    told = seen.at_the_end(figure((wide, near, far)))
    assert told == "At the end lowest: wide, near and far (1–1.8); highest: wide and far (1–1.8)."


def titled(*panels):
    made = figure(*panels)
    return replace(made, panels=tuple(replace(one, title=f"case {n}") for n, one in enumerate(made.panels)))


def test_of_several_panels_each_and_the_extremes_of_all():
    low, high = (line("a", 1.0), line("b", 3.0)), (line("a", 4.0), line("b", 2.0))
    assert seen.at_the_end(titled(low, low)) == (
        "At the end lowest in every panel: a. "
        "Of all panels lowest 1 (“case 0, a” and “case 1, a”), highest 3 (“case 0, b” and “case 1, b”)."
    )
    assert seen.at_the_end(titled(low, low, high)) == (
        "At the end lowest: case 0 and case 1: a; case 2: b. "
        "Of all panels lowest 1 (“case 0, a” and “case 1, a”), highest 4 (case 2, a)."
    )
    assert seen.highest_at_the_end(titled(low, high)).startswith("At the end highest: case 0: b; case 1: a. ")
    assert "lowest: a in 3; b in 2 of 5 panels." in seen.at_the_end(titled(low, low, low, high, high))
    lines = [line(name, n) for n, name in enumerate("abcde")]
    each = [(one, line("f", 9.0)) for one in lines]
    assert "a in 1; b in 1; c in 1; others in 2 of 5 panels." in seen.at_the_end(titled(*each))


def test_a_set_is_told_in_one_order():
    one = (line("a", 1.0), line("b", 1.01), line("c", 3.0))
    other = (line("a", 1.01), line("b", 1.0), line("c", 3.0))
    assert seen.at_the_end(titled(one, other)).startswith("At the end lowest in every panel: a and b. ")


def test_one_line_a_panel_is_told_with_its_panel():
    assert seen.at_the_end(figure((line("a", 1.0),))) == "Y: from 1 to 9 (a)."
    assert seen.at_the_end(titled((line("a", 1.0),), (line("a", 12.0),))) == (
        "Y: highest 12 (case 1, a), lowest 1 (case 0, a)."
    )


def test_gains_are_told_once_and_maps():
    gain = Line(T, np.array([0.0, 30.0, 35.0, 20.0, 18.0]), "r+Vr")
    assert seen.most(figure((gain,), title="Gain")) == "At most 35 % (r+Vr, at 2 s); 18 % at the end."
    rising = replace(gain, y=np.sort(gain.y))
    assert seen.most(figure((rising,), title="Gain")) == "At most 35 % (r+Vr), at the end."
    heat = Heat(T[:2], T[:2], np.array([[0.5, np.nan], [0.25, 1.0]]), "share, m")
    made = titled((heat,), (replace(heat, values=heat.values / 2),))
    assert seen.extremes(made) == "Share: highest 1 m (case 0), lowest 0.125 m (case 1)."


def test_extremes_and_readings_at_a_place():
    made = titled((line("a", 1.0), line("b", 3.0)), (line("c", 12.0),))
    assert seen.extremes(made) == "Y: highest 12 (case 1, c), lowest 1 (case 0, a)."
    assert seen.reading_at(2.0)(made) == "Y at 2: highest 10.5 (case 1, c), lowest 5 (case 0, a)."
    short = replace(line("d", 1.0), x=T - 3)
    beyond = figure((line("a", 1.0), line("b", 3.0), short))
    assert seen.reading_at(2.0)(beyond) == "Y at 2: highest 6 (b), lowest 5 (a). 1 of 3 lines does not reach it."
    assert seen.extremes(figure(())) == ""
    level = [Line(T, np.full(5, 1.0), name) for name in "ab"]
    assert seen.extremes(figure(level)) == "Y: 1 (a and b)."
    alone = (Line(T, np.where(T == 2, 5.0, np.nan), "a"), Line(T, np.full(5, np.nan), "b"))
    assert seen.extremes(figure(alone)) == "Y: 5 (a)."  # a point is no more than that
    both = (line("a", 1.0), Line(T, np.full(5, 9.0), "b"))
    assert seen.extremes(figure(both)) == "Y: highest 9 (a and b), lowest 1 (a)."


def test_extremes_tell_of_every_quantity():
    """σ of a range and a share are no numbers to be compared; Greek letters have no capitals here."""
    made = figure((line("a", 1.0),), (line("b", 900.0),))
    one, other = (
        replace(panel, y=Axis(label))
        for panel, label in zip(made.panels, ("$\\sigma$ of $r$, m", "share of locks"), strict=True)
    )
    mixed = replace(made, panels=(one, other))
    assert seen.extremes(mixed) == seen.at_the_end(mixed)
    assert seen.extremes(mixed) == "σ of r: from 1 m to 9 m (a). Share of locks: from 9 to 900 (b)."
    bracket = replace(made, panels=(replace(one, y=Axis("NEES (1: right, below: shy)")),))
    assert seen.extremes(bracket) == "NEES (1: right, below: shy): from 1 to 9 (a)."
    unnamed = replace(made, panels=tuple(replace(panel, y=Axis("")) for panel in made.panels))
    assert seen.extremes(unnamed) == "σ of the range: highest 900 (b), lowest 1 (a)."


def test_figures_by_name():
    made = figure((line("a", 1.0), line("b", 3.0)))
    begun = seen.all_begun({"f": made, "g": made, "h": None}, {"f": lambda _: "Seen.", "h": lambda _: "Never."})
    assert begun["f"].caption == "Seen. How."
    assert begun["g"] is made
    assert begun["h"] is None


def test_crosses_are_told_of_where_there_are_any():
    without, with_some = figure((line("a", 1.0),)), figure((line("a", 1.0, exact=T),))
    assert seen.crossed(without).caption == "How."
    assert seen.crossed(with_some).caption == "How. Crosses: exact values."
    hidden = figure((line("a", 1.0, exact=np.full(5, np.nan)),))
    assert seen.crossed(hidden).caption == "How."


def test_every_figure_of_a_run_tells_of_its_crosses_and_of_nothing_else(tmp_path):
    from radarsim.app import result as output
    from radarsim.app.run import run

    for config in ("rls2", "sonar_asynchronous"):
        result = run(config, realisations=400)
        for name, one in output.case_figures(result.cases, result.tables, result.experiment).items():
            lines = [m for panel in one.panels for m in panel.marks if isinstance(m, Line) and m.exact is not None]
            crossed = any(np.isfinite(m.exact).any() for m in lines)
            assert ("Crosses" in one.caption) is crossed, name
