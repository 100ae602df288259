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


def test_crosses_are_explained_once_and_unusual_ones_in_their_caption():
    without, with_some = figure((line("a", 1.0),)), figure((line("a", 1.0, exact=T),))
    assert caption_remarks.with_meaning_of_crosses(without).caption == "How."
    assert caption_remarks.with_meaning_of_crosses(with_some).caption == "How."
    assert caption_remarks.conventions([without]) == ""
    assert caption_remarks.conventions([without, with_some]) == "Crosses: exact values."
    named = replace(with_some, panels=tuple(replace(panel, crosses="the law") for panel in with_some.panels))
    assert caption_remarks.with_meaning_of_crosses(named).caption == "How. Crosses: the law."
    assert caption_remarks.conventions([named]) == ""
    unknown = figure((line("a", 1.0, exact=np.full(5, np.nan)),))
    assert caption_remarks.with_meaning_of_crosses(unknown).caption == "How."
    assert caption_remarks.conventions([unknown]) == ""


def test_lines_below_a_limit_are_named_with_their_panels_if_there_are_several():
    assert caption_remarks.lines_below(figure((line("a", 1.0), line("b", -3.0))), -2.0) == "b"
    two = figure((line("a", -3.0),), (line("a", -3.0),))
    panels = tuple(replace(panel, title=f"case {n}") for n, panel in enumerate(two.panels))
    assert caption_remarks.lines_below(replace(two, panels=panels), -2.0) == "“case 0, a” and “case 1, a”"
    assert caption_remarks.lines_below(two, -4.0) == ""


def test_conventions_are_those_that_figures_need():
    ends = np.array([1.0, 1.0, np.nan, 1.0, 1.0])
    banded = figure((replace(line("a", 1.0), lo=T, hi=T + 1),))
    rough = figure((replace(line("a", 1.0), lo=ends, hi=ends),))
    assert caption_remarks.conventions([banded]) == "Bands and whiskers: 95 % intervals."
    assert caption_remarks.conventions([rough]).endswith("rough, as a note in the table says.")
    quantiles = replace(banded, panels=tuple(replace(panel, has_intervals=False) for panel in banded.panels))
    assert caption_remarks.conventions([quantiles]) == ""
    both = caption_remarks.conventions([banded, quantiles])
    assert both == "Bands and whiskers: 95 % intervals, unless a legend says otherwise."
    joined = replace(quantiles, has_joined_names=True)
    assert caption_remarks.conventions([joined]) == "“=” joins the names of coinciding curves."
    (panel,) = figure((line("a", 0.0),)).panels
    zeros = replace(joined, panels=(replace(panel, y=Axis("y", "log")),), has_joined_names=False)
    assert caption_remarks.conventions([zeros]) == "Logarithmic axes show no zeros."
