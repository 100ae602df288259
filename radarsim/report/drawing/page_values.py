"""The values of a figure's markers, and where they lie, for its titles on a page."""

import math
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.transforms import Bbox

from radarsim.report.drawing.line_points import marker_indices, thin_line
from radarsim.report.drawing.marks import MAX_WRITTEN_CELLS
from radarsim.report.drawing.model import Axis as AxisSpec
from radarsim.report.drawing.model import Bars, Heat, Line, Panel
from radarsim.report.drawing.page_figure import HEADLINE_ID, ValueMark, cell_text, value_text

MAX_VALUE_MARKS = 160  # scattered points of a line that can be read on a page
MAX_VALUE_CELLS = 400  # of a map, whose values can be read on a page


def headline_height_pt(canvas: Canvas) -> float:
    """From the top of a figure to the lower edge of its headline, points; zero without one."""
    headline = next((text for text in canvas.texts if text.get_gid() == HEADLINE_ID), None)
    if headline is None:
        return 0.0
    return float(canvas.bbox.y1 - headline.get_window_extent().y0) * 72 / canvas.dpi


def value_marks(axes: Axes, panel: Panel) -> list[ValueMark]:
    """Positions and texts of the values of a panel that a reader of a page can point at."""
    marks: list[ValueMark] = []
    for mark in panel.marks:
        if isinstance(mark, Line):
            marks += _line_values(axes, panel, mark)
        elif isinstance(mark, Bars):
            marks += _bar_values(axes, panel, mark)
        elif isinstance(mark, Heat):
            marks += _cell_values(axes, panel, mark)
    return marks


def _line_values(axes: Axes, panel: Panel, line: Line) -> list[ValueMark]:
    """The values at a line's markers, or where they would be; none of a crowd of points."""
    line = thin_line(line)
    if line.style.dash is None and len(line.x) > MAX_VALUE_MARKS:
        return []
    indices = np.array(marker_indices(line), int)
    x, y = np.asarray(line.x, float)[indices], np.asarray(line.y, float)[indices]
    with np.errstate(divide="ignore", invalid="ignore"):
        points = _page_points(axes, x, y)
    inside = _inside(axes, points)
    columns = [None if ends is None else np.asarray(ends, float)[indices] for ends in (line.lo, line.hi, line.exact)]
    marks = []
    for n in np.flatnonzero(inside):
        lo, hi, exact = (None if column is None else float(column[n]) for column in columns)
        text = value_text(line.name or line.label, panel, float(x[n]), float(y[n]), lo, hi, exact)
        marks.append(ValueMark(float(points[n, 0]), float(points[n, 1]), text))
    return marks


def _bar_values(axes: Axes, panel: Panel, bars: Bars) -> list[ValueMark]:
    tops = _page_points(axes, np.arange(len(bars.names)), np.asarray(bars.values, float))
    marks = []
    for n, name in enumerate(bars.names):
        lo, hi = (None if ends is None else float(ends[n]) for ends in (bars.lo, bars.hi))
        if np.isfinite(tops[n]).all():
            text = value_text(name, replace(panel, x=AxisSpec("")), math.nan, float(bars.values[n]), lo, hi, None)
            marks.append(ValueMark(float(tops[n, 0]), float(tops[n, 1]), text))
    return marks


def _cell_values(axes: Axes, panel: Panel, heat: Heat) -> list[ValueMark]:
    """The values of a map's cells, unless they are written in, or too many."""
    if not MAX_WRITTEN_CELLS < heat.values.size <= MAX_VALUE_CELLS:
        return []
    corners = _page_points(axes, np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    width, height = np.abs(corners[1] - corners[0]).tolist()
    marks = []
    for (row, column), value in np.ndenumerate(heat.values):
        if np.isfinite(value):
            x, y = _page_points(axes, np.array([column]), np.array([row]))[0].tolist()
            marks.append(ValueMark(x, y, cell_text(panel, heat, row, column), width, height))
    return marks


def _page_points(axes: Axes, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points (n, 2) of the data as points of the SVG, from its upper left corner."""
    canvas = axes.figure
    pixels = axes.transData.transform(np.column_stack([x, y]).astype(float))
    return (pixels * [1, -1] + [0, canvas.bbox.y1]) * 72 / canvas.dpi


def _inside(axes: Axes, points: np.ndarray) -> np.ndarray:
    """Which points of the SVG lie in a panel or on its edge."""
    canvas = axes.figure
    box = Bbox(axes.get_window_extent().get_points() * 72 / canvas.dpi)
    height = canvas.bbox.y1 * 72 / canvas.dpi
    x, y = points[:, 0], height - points[:, 1]
    return (x >= box.x0 - 1) & (x <= box.x1 + 1) & (y >= box.y0 - 1) & (y <= box.y1 + 1)
