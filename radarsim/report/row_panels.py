"""Panels of rows: values of many filters, each on a row with its name, as points with whiskers."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.report.drawing.model import PAGE_MM, Axis, Figure, Line, Mark, Panel, Style

if TYPE_CHECKING:
    import pandas as pd

ROW_SPREAD = 0.56  # of a row, over which its points are spread
ROW_MM, POINT_MM, AXIS_MM = 3.6, 1.5, 14.0  # height of a row, of each point on it at least, and of axis and title
WHISKER_PT = 0.8


class RowSeries(NamedTuple):
    """A value of each row with its interval, and its exact value where known, (rows,) each; NaN where there is none."""

    name: str
    values: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    exact: np.ndarray | None = None


def filter_series(name: str, table: "pd.DataFrame", column: str, filters: Sequence[str]) -> RowSeries:
    """A column of a table, which has a row for each filter, with its interval in the columns `_lo` and `_hi`."""
    by_filter = table.set_index("filter").reindex(list(filters))
    return RowSeries(name, *(by_filter[f"{column}{end}"].to_numpy(float) for end in ("", "_lo", "_hi")))


def row_panel(x: Axis, names: Sequence[str], series: Sequence[RowSeries], title: str, others: Sequence[Mark]) -> Panel:
    """A panel of rows from the top down, named at the left; a point of each series on every row.

    others: marks besides the points."""
    rows = np.arange(float(len(names)))
    marks: list[Mark] = list(others)
    for n, one_series in enumerate(series):
        places = rows + ROW_SPREAD * ((n + 0.5) / len(series) - 0.5)
        marks += _series_marks(one_series, places, Style(n, None, n))
    y = Axis("", limits=(len(names) - 0.5, -0.5), ticks=tuple(zip(rows.tolist(), names, strict=True)))
    return Panel(x, y, tuple(marks), title, direct=False)


def _series_marks(series: RowSeries, places: np.ndarray, style: Style) -> list[Mark]:
    """The points of a series, their whiskers, and crosses at exact values."""
    gap = np.full(len(places), np.nan)
    ends, at_ends = np.ravel([series.lo, series.hi, gap], "F"), np.ravel([places, places, gap], "F")
    whiskers = Line(ends, at_ends, "", replace(style, dash=0, marker=None, width_pt=WHISKER_PT))
    marks: list[Mark] = [whiskers, Line(series.values, places, series.name, style)]
    if series.exact is not None and np.isfinite(series.exact).any():
        marks.append(Line(series.exact, gap, style=style, exact=places))
    return marks


def row_figure(name: str, title: str, caption: str, panels: Sequence[Panel]) -> Figure:
    """A figure of panels with the same rows, whose names stand at the left of each line of panels."""
    series = max(sum(bool(mark.label) for mark in panel.marks if isinstance(mark, Line)) for panel in panels)
    height = AXIS_MM + len(panels[0].y.ticks) * max(ROW_MM, POINT_MM * series)
    columns = 2 if len(panels) in (2, 4) else min(3, len(panels))
    return Figure(name, title, caption, tuple(panels), columns, PAGE_MM, height, share_y=columns > 1)
