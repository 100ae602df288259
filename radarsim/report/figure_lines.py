"""Lines of figures from rows of tables, and how filters and cases are distinguished."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import tables as common
from radarsim.report.drawing.model import Line, Panel, Reference, Style
from radarsim.report.key_labels import (
    config_device,
    escape_dollars,
    format_degrees,
    format_value,
    is_written_as_power,
    key_axis_factor,
    shorten_mapping,
    swept_description,
)
from radarsim.report.panel_layout import fitting_axis, keyed_panels, time_axis

if TYPE_CHECKING:
    import pandas as pd


SIGMA = ("t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")  # columns of a line of σ against time
GAIN = ("t_s", "gain_percent", "gain_lo", "gain_hi", "exact_percent")


def scale_line(line: Line, factor: float) -> Line:
    """A line in another unit."""
    if factor == 1.0:
        return line
    parts = {name: getattr(line, name) for name in ("y", "lo", "hi", "exact")}
    return replace(line, **{name: part * factor for name, part in parts.items() if part is not None})


def line_from_rows(
    rows: "pd.DataFrame", columns: Sequence[str], label: str, style: Style | int, name: str = ""
) -> Line:
    """A line of x and y from two columns of rows; further columns give the ends of its band, and exact values. A
    numeric style is that of the filter with this number."""
    x, y, *more = (rows[column].to_numpy(dtype=float) for column in columns)
    lo, hi = more[:2] or (None, None)
    exact = more[2] if more[2:] and np.isfinite(more[2]).any() else None
    look = Style(style, style, style) if isinstance(style, int) else style
    return Line(x, y, label, look, lo, hi, exact, name)


def line_from_tables(
    x: np.ndarray, rows: Sequence["pd.Series"], columns: Sequence[str], label: str, style: Style
) -> Line:
    """`line_from_rows` over x (n,) of n rows of several tables."""
    return line_from_rows(
        common.frame({"x": x} | {name: [row[name] for row in rows] for name in columns}), ("x", *columns), label, style
    )


def all_filters(results: Sequence[CaseResult]) -> list[str]:
    """The filters of all cases of a figure, each once: a filter's place in it decides how its line looks."""
    return list(dict.fromkeys(f for result in results for f in result.axes.filters))


def case_lines(
    members: Sequence[CaseResult], rows: Mapping, component: str, columns: Sequence[str], filters: Sequence[str]
) -> list[Line]:
    """A line for each filter of each case of a panel: named by the filter if there is one case, else by the swept
    value.

    rows by case, filter and component; columns as for `line_from_rows`; filters as of `all_filters`: a filter has the
    same style in all panels of a figure."""
    marks: list[Line] = []
    for i, result in enumerate(members):
        for f in result.axes.filters:
            case_rows = rows.get((result.name, f, component))
            if case_rows is None:
                continue
            style = line_style(filters.index(f), i, len(members))
            if len(members) == 1:
                marks.append(line_from_rows(case_rows, columns, escape_dollars(f), style, escape_dollars(f)))
            else:
                key, value = result.swept_values[-1] if result.swept_values else ("", config_device(result))
                values = [dict(member.swept_values).get(key) for member in members]
                text = (
                    _shown_value(result, key, shorten_mapping(result, key, value, values))
                    if key
                    else format_value(value)
                )
                marks.append(
                    line_from_rows(case_rows, columns, text, style, f"{escape_dollars(f)}, {swept_description(result)}")
                )
    return marks


def _shown_value(result: CaseResult, key: str, value: object) -> str:
    """A value of a key without its unit, as on its axis."""
    factor = key_axis_factor(result, key)
    is_turned = factor != 1.0 and isinstance(value, int | float) and not isinstance(value, bool)
    return format_degrees(factor * float(str(value))) if is_turned else format_value(value, is_written_as_power(key))


def ratio_panels(
    title: str, members: Sequence[CaseResult], rows: Mapping, label: str, filters: Sequence[str]
) -> list[Panel]:
    """Panels of any quantity of the members about one; rows by case, filter and its column, against t_s."""
    column = next(key[2] for key in rows)
    marks = case_lines(members, rows, column, ("t_s", column), filters)
    panel = Panel(time_axis(), fitting_axis(label, marks), (Reference(1), *marks), title)
    return keyed_panels(panel, members, filters) if marks else []


def line_style(nth_filter: int, nth_case: int, cases: int) -> Style:
    """Filters differ by dash and marker; cases by shade; filters of a single case by colour too."""
    colour = nth_filter if cases == 1 else nth_case / (cases - 1)
    return Style(colour, nth_filter, nth_filter)
