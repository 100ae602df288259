"""Captions say what crosses mean where there are any, and name the lines that an axis cuts."""

from dataclasses import replace

import numpy as np

from radarsim.report import caption_remarks
from radarsim.report.drawing.model import Axis, Figure, Line, Panel

T = np.arange(5.0)


def line(name, last, exact=None):
    return Line(T, np.linspace(9.0, last, 5), name, exact=exact)


def figure(*panels):
    return Figure("f", "σ of the range", "How.", tuple(Panel(Axis("t"), Axis("y"), lines) for lines in panels))


def test_caption_says_what_crosses_mean_only_where_a_point_has_one():
    without, with_some = figure((line("a", 1.0),)), figure((line("a", 1.0, exact=T),))
    assert caption_remarks.with_meaning_of_crosses(without).caption == "How."
    assert caption_remarks.with_meaning_of_crosses(with_some).caption == "How. Crosses: exact values."
    unknown = figure((line("a", 1.0, exact=np.full(5, np.nan)),))
    assert caption_remarks.with_meaning_of_crosses(unknown).caption == "How."


def test_lines_below_a_limit_are_named_with_their_panels_if_there_are_several():
    assert caption_remarks.lines_below(figure((line("a", 1.0), line("b", -3.0))), -2.0) == "b"
    two = figure((line("a", -3.0),), (line("a", -3.0),))
    panels = tuple(replace(panel, title=f"case {n}") for n, panel in enumerate(two.panels))
    assert caption_remarks.lines_below(replace(two, panels=panels), -2.0) == "“case 0, a” and “case 1, a”"
    assert caption_remarks.lines_below(two, -4.0) == ""


def test_every_figure_of_a_run_says_what_its_crosses_mean_and_no_other_does():
    from radarsim.api import result_content
    from radarsim.api.run import run

    for config in ("rls2", "sonar_asynchronous"):
        result = run(config, realisations=400)
        for name, one in result_content.case_figures(result.cases, result.tables, result.experiment).items():
            lines = [m for panel in one.panels for m in panel.marks if isinstance(m, Line) and m.exact is not None]
            crossed = any(np.isfinite(m.exact).any() for m in lines)
            assert ("Crosses" in one.caption) is crossed, name
