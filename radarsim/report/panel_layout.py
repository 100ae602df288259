"""Axes, legends and arrangement of panels; lines of losses near one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import quote_name, tr
from radarsim.report import caption_remarks
from radarsim.report.case_selection import MAX_MISSING_NAMES
from radarsim.report.drawing.model import (
    COLUMN_MM,
    MAX_PANEL_LINES,
    PAGE_MM,
    Axis,
    Figure,
    Line,
    Mark,
    Panel,
    Reference,
    Style,
)
from radarsim.report.key_labels import (
    degrees_factor_and_unit,
    escape_dollars,
    key_label,
    key_symbol,
    label_with_unit,
    without_markup,
)

WIDE_MM = 120.0  # one panel of many lines
RARE_LOSS = 0.1  # of a share's loss: below it the loss is drawn logarithmically
LOG_RATIO = 20  # ratio of values from which an axis is logarithmic
PANEL_RATIO = 5.0  # of the largest values of panels side by side, from which their shared axis is logarithmic
FLAT_RATIO = 2.0  # ratio of values up to which an axis begins near them: from zero they would fill less than half of it
NEAR_ZERO = 1e-5  # of the largest σ: below it a logarithmic axis would show rounding
WIDEST_BAND, LOG_MARGIN, MARGIN = 2.0, 1.12, 0.05  # of a shared axis: how far bands count, and room at its ends


def with_legend_cell(panels: Sequence[Panel]) -> list[Panel]:
    """Panels with one legend in a cell of its own, with names from the lines; unchanged if lines are too many."""
    if any(len(_lines(panel)) > MAX_PANEL_LINES for panel in panels):
        return list(panels)
    keys = {mark.label: mark.style for panel in panels for mark in panel.marks if isinstance(mark, Line) and mark.label}
    blank = [
        replace(
            panel,
            marks=tuple(
                replace(m, label="", name=m.name or m.label) if isinstance(m, Line) else m for m in panel.marks
            ),
        )
        for panel in panels
    ]
    return [*blank, Panel(panels[0].x, panels[0].y, (), keys=tuple(keys.items()))]


def time_axis() -> Axis:
    """The axis of time that figures of all studies share."""
    return Axis(tr("time from the first plot, s"), limits=(0, None))


def count_axis(label: str, highest: float) -> Axis:
    """An axis of whole numbers from zero, with ticks at whole numbers only."""
    step = next(s * 10**p for p in range(9) for s in (1, 2, 5) if highest / (s * 10**p) <= 8)
    return Axis(label, limits=(0, None), ticks=tuple((float(n), str(n)) for n in range(0, int(highest) + 1, step)))


def fitting_axis(label: str, marks: Sequence[Mark]) -> Axis:
    """An axis of positive values: from zero, or near them if they would fill less than half of it; logarithmic where
    the least would otherwise lie on zero."""
    values = _columns_y([mark for mark in marks if isinstance(mark, Line)])
    values = values[np.isfinite(values)]
    if values.size and 0 < values.max() < FLAT_RATIO * values.min():
        return Axis(label)
    values = values[values > 0]
    if not values.size or values.max() <= LOG_RATIO * values.min():
        return Axis(label, limits=(0, None))
    low = NEAR_ZERO * float(values.max())
    return Axis(label, "log", (float(values[values > low].min()) / 2, None) if values.min() < low else (None, None))


def complement_line(line: Line) -> Line:
    """A line of the complement of a share."""
    lo, hi, exact = (None if part is None else 1 - part for part in (line.hi, line.lo, line.exact))
    return replace(line, y=1 - line.y, lo=lo, hi=hi, exact=exact)


def has_rare_losses(lines: Sequence[Line]) -> bool:
    """Whether any of some shares is mostly so near one that its losses matter, and has losses to show."""
    return any(float(np.median(line.y)) > 1 - RARE_LOSS and np.count_nonzero(line.y < 1) > 1 for line in lines)


def loss_axis(label: str, lines: Sequence[Line]) -> Axis:
    """A logarithmic axis of losses, from half the least non-zero one: zero has no point."""
    values = np.concatenate([line.y for line in lines] or [np.ones(1)])
    return Axis(label, "log", (float(values[values > 0].min(initial=1.0)) / 2, None))


def loss_lines(lines: Sequence[Line]) -> tuple[tuple[Line, ...], str]:
    """The complements of shares that have a loss, and the names of the others, for a caption."""
    losses = tuple(map(complement_line, lines))
    visible = tuple(line for line in losses if (line.y > 0).any())
    names = [quote_name(without_markup(line.name or line.label)) for line in losses if not (line.y > 0).any()]
    remark = (
        " " + tr("Without failures: {names}.", names=caption_remarks.join_few_names(names, MAX_MISSING_NAMES))
        if names
        else ""
    )
    return visible, remark


def share_y_axis(panels: Sequence[Panel]) -> list[Panel]:
    """Panels of lines side by side: those of one quantity share the axis of y that holds all."""
    filled = [panel for panel in panels if panel.marks]
    lines = [mark for panel in filled for mark in panel.marks if isinstance(mark, Line)]
    if len(filled) < 2 or len({panel.y.label for panel in filled}) > 1 or not lines or any(p.y.ticks for p in filled):
        return list(panels)
    limited = [panel.y for panel in filled if None not in panel.y.limits]
    logarithmic = [panel.y for panel in filled if panel.y.scale == "log"]
    fitted = _shared_fitting_axis(filled)
    is_fitted = any(panel.y.limits == (0, None) for panel in filled) or all(map(_has_fitting_axis, filled))
    y = (limited or logarithmic or [fitted if is_fitted else filled[0].y])[0]
    if y.scale == fitted.scale == "log" and y.limits == (None, None):
        y = replace(y, limits=fitted.limits)
    if not limited:
        y = replace(y, limits=holding(lines, y))
    return [replace(panel, y=y) for panel in panels]


def _shared_fitting_axis(panels: Sequence[Panel]) -> Axis:
    """The fitting axis of all panels; logarithmic where some panel's lines would all lie near zero."""
    lines = [[mark for mark in panel.marks if isinstance(mark, Line)] for panel in panels]
    fitted = fitting_axis(panels[0].y.label, [line for panel_lines in lines for line in panel_lines])
    values = [column[np.isfinite(column)] for column in (_columns_y(panel_lines) for panel_lines in lines)]
    known = [column for column in values if column.size]
    highest = [float(column.max()) for column in known]
    is_positive = all(float(column.min()) > 0 for column in known)
    if is_positive and highest and fitted.scale == "linear" and max(highest) > PANEL_RATIO * min(highest):
        return Axis(fitted.label, "log")
    return fitted


def _columns_y(lines: Sequence[Line]) -> np.ndarray:
    """The values of all lines one after the other."""
    return np.concatenate([np.zeros(0), *(np.asarray(line.y, float) for line in lines)])


def _has_fitting_axis(panel: Panel) -> bool:
    """Whether the axis of y of a panel is that of `fitting_axis`, which shows no values about zero."""
    is_about_zero = any(isinstance(mark, Reference) and mark.value == 0 for mark in panel.marks)
    return not is_about_zero and panel.y == fitting_axis(panel.y.label, panel.marks)


def holding(lines: Sequence[Line], y: Axis) -> tuple[float, float]:
    """Limits that hold all lines, and their bands except bounds far beyond them."""
    values = _finite_values(y, [column for line in lines for column in (line.y, line.exact)])
    bands = _finite_values(y, [column for line in lines for column in (line.lo, line.hi)])
    lowest, highest = bands.min(initial=values.min()), bands.max(initial=values.max())
    if y.scale == "log":
        low = float(max(values.min() / WIDEST_BAND, lowest)) / LOG_MARGIN
        high = float(min(values.max() * WIDEST_BAND, highest)) * LOG_MARGIN
        return y.limits[0] or low, high
    span = float(values.max() - values.min()) or 1.0
    low = float(max(values.min() - span, lowest)) - MARGIN * span
    high = float(min(values.max() + span, highest)) + MARGIN * span
    return low if y.limits[0] is None else y.limits[0], high


def _finite_values(y: Axis, columns: Sequence[np.ndarray | None]) -> np.ndarray:
    """The values of the columns that are known and that the axis can show."""
    values = np.concatenate([np.zeros(0), *(np.asarray(column, float) for column in columns if column is not None)])
    return values[np.isfinite(values) & (values > 0 if y.scale == "log" else True)]


def arrange_columns(figure: Figure) -> Figure:
    """A figure with as many columns as its panels fill, at one of the widths of a page."""
    count = len([panel for panel in figure.panels if panel.marks])
    panels = tuple(share_y_axis(figure.panels))
    axes = {(panel.y.label, panel.y.scale, panel.y.limits, panel.y.ticks) for panel in panels if panel.marks}
    figure = replace(figure, panels=panels, share_y=count > 1 and len(axes) == 1)
    if count == 1:
        wide = len(_lines(figure.panels[0])) > MAX_PANEL_LINES
        return replace(figure, columns=1, width_mm=WIDE_MM if wide else COLUMN_MM, panel_height_mm=64.0)
    return replace(figure, columns=2 if count in (2, 4) else 3, width_mm=PAGE_MM, panel_height_mm=56.0)


def keyed_panels(
    panel: Panel, members: Sequence[CaseResult], filters: Sequence[str], baseline: bool = True
) -> list[Panel]:
    """A panel in which a legend explains dashes by filter, and swept values are named at the ends of the lines; of more
    lines than a panel can hold, a panel for each filter.

    filters as for `case_lines`; baseline: whether to draw the baseline filter."""
    if len(members) == 1:
        return [panel]
    drawn = {
        f for result in members for n, f in enumerate(result.axes.filters) if baseline or n != result.axes.baseline
    }
    names = {n: escape_dollars(f) for n, f in enumerate(filters) if f in drawn}
    panel = replace(panel, line_title=key_title(members[0]) if members[0].swept_values else "")
    if len(names) == 1:
        return [panel]
    if len(_lines(panel)) <= MAX_PANEL_LINES:
        return [replace(panel, keys=tuple((name, Style(0, n, n)) for n, name in names.items()))]
    return [_panel_of_filter(panel, n, name) for n, name in names.items()]


def _panel_of_filter(panel: Panel, nth_filter: int, name: str) -> Panel:
    """A panel with only the lines of one filter, all of one look but for their shades."""
    marks = (mark for mark in panel.marks if not isinstance(mark, Line) or mark.style.dash == nth_filter)
    alike = (
        replace(mark, style=replace(mark.style, dash=0, marker=0)) if isinstance(mark, Line) else mark for mark in marks
    )
    return replace(panel, marks=tuple(alike), title=", ".join(filter(None, (panel.title, name))))


def key_title(result: CaseResult) -> str:
    """The title of a legend of the last swept key's values: its letter or name, and its unit."""
    key = result.swept_values[-1][0]
    return label_with_unit(key_symbol(result, key), degrees_factor_and_unit(key_label(result, key).unit)[1])


def _lines(panel: Panel) -> list[Line]:
    """The lines of a panel, without its scattered points."""
    return [mark for mark in panel.marks if isinstance(mark, Line) and mark.style.dash is not None]
