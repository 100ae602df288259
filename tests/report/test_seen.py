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
    assert seen.at_the_end(made, "m/s2") == ("At the end lowest: r+Vr (1 m/s²); highest: r (3 m/s²).")


def test_lines_whose_intervals_overlap_are_told_together():
    made = figure((line("a", 1.0), line("b", 1.15), line("c", 3.0)))
    assert "lowest: a and b (1)" in seen.at_the_end(made)
    assert "highest: c (3)" in seen.at_the_end(made)
    level = figure((line("a", 1.0), line("b", 1.1)))
    assert seen.at_the_end(level) == "At the end all are within each other's intervals."


def test_a_line_of_unknown_interval_is_neither_lowest_nor_highest():
    nothing = np.full(5, np.nan)
    unknown = Line(T, np.linspace(9.0, 0.5, 5), "b", lo=nothing, hi=nothing)
    assert seen.at_the_end(figure((line("a", 1.0), unknown))) == "Y: highest 9 (a), lowest 0.5 (b)."
    alike = figure((line("a", 1.0), line("c", 1.1), unknown))
    assert seen.at_the_end(alike).startswith("Y: highest ")  # not "all are within each other's intervals"
    told = seen.at_the_end(figure((line("a", 1.0), unknown, line("c", 3.0))))
    assert told == "At the end lowest: a (1); highest: c (3)."


def test_of_several_panels_how_often_which():
    low, high = (line("a", 1.0), line("b", 3.0)), (line("a", 3.0), line("b", 1.0))
    assert seen.at_the_end(figure(low, low)) == "At the end lowest in every panel: a."
    assert seen.at_the_end(figure(low, low, high)) == "At the end lowest: a in 2 and b in 1 of 3 panels."
    assert seen.at_the_end(figure((line("a", 1.0),))) == ""


def test_gains_and_maps():
    gain = Line(T, np.array([0.0, 30.0, 35.0, 20.0, 18.0]), "r+Vr")
    assert seen.most(figure((gain,), title="Gain")) == "At most 35 % (r+Vr, at 2 s); 18 % at the end."
    heat = Heat(T[:2], T[:2], np.array([[0.5, np.nan], [0.25, 1.0]]), "share")
    assert seen.over(figure((heat,), title="Lock")) == "From 0.25 to 1."


def test_extremes_and_readings_at_a_place():
    made = figure((line("a", 1.0), line("b", 3.0)), (line("c", 12.0),))
    made = replace(made, panels=tuple(replace(one, title=f"case {n}") for n, one in enumerate(made.panels)))
    assert seen.extremes(made, "m") == "Y: highest 12 m (case 1, c), lowest 1 m (case 0, a)."
    assert seen.reading_at(2.0)(made) == "Y at 2: highest 10.5 (case 1, c), lowest 5 (case 0, a)."
    first = replace(made, panels=(replace(made.panels[0], y=Axis("time to a track, s")), made.panels[1]))
    assert seen.first_extremes(first) == "Time to a track: highest 9 s (a), lowest 1 s (a)."
    assert seen.highest_at_the_end(made) == "At the end highest: b."
    assert seen.extremes(figure(())) == ""


def test_extremes_name_their_quantity_and_mix_no_two():
    """σ of a range and a share are no numbers to be compared; Greek letters have no capitals here."""
    range_m, share = Axis("$\\sigma$ of $r$, m"), Axis("share of locks")
    made = figure((line("a", 1.0),), (line("b", 900.0),))
    one, other = made.panels
    mixed = replace(made, panels=(replace(one, y=range_m), replace(other, y=share)))
    assert seen.extremes(mixed) == "σ of r: highest 9 m (a), lowest 1 m (a)."
    assert seen.extremes(replace(mixed, panels=mixed.panels[::-1])) == "Share of locks: highest 900 (b), lowest 9 (b)."
    bracket = replace(made, panels=(replace(one, y=Axis("NEES (1: right, below: shy)")),))
    assert seen.extremes(bracket) == "NEES (1: right, below: shy): highest 9 (a), lowest 1 (a)."
    unnamed = replace(made, panels=tuple(replace(panel, y=Axis("")) for panel in made.panels))
    assert seen.extremes(unnamed).startswith("σ of the range: highest 900 (b)")


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
    from radarsim.app import output
    from radarsim.app.run import run

    for config in ("rls2", "sonar_asynchronous"):
        result = run(config, realisations=400)
        for name, one in output.figures(result.cases, result.tables, result.experiment).items():
            lines = [m for panel in one.panels for m in panel.marks if isinstance(m, Line) and m.exact is not None]
            crossed = any(np.isfinite(m.exact).any() for m in lines)
            assert ("Crosses" in one.caption) is crossed, name
