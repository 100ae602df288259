"""Panels of more lines than a legend can explain: as few columns, and as much height, as names at their ends need."""

from dataclasses import replace

from radarsim.report.drawing.legend_placement import (
    END_NAME_MM,
    MAX_END_NAME_LETTERS,
    MAX_END_NAMES_SHARE,
    MAX_FIGURE_MM,
    name_rows,
    named_lines,
    plan_legends,
)
from radarsim.report.drawing.model import MAX_PANEL_LINES, Figure, Line, Panel
from radarsim.report.drawing.style import LETTER_MM, wrap


def is_crowded(panel: Panel) -> bool:
    """Whether a panel has more named lines than a legend can explain."""
    return len([line for line in named_lines(panel) if line.style.dash is not None]) > MAX_PANEL_LINES


def with_names_at_ends(figure: Figure) -> Figure:
    """The figure with all lines named at their ends, if a panel is crowded and the names fit on a page."""
    panels = [panel for panel in figure.panels if panel.marks]
    if not any(map(is_crowded, panels)):
        return figure
    column_counts = range(min(figure.columns, len(panels)), 0, -1)
    choices = (_in_columns(figure, columns, is_broken) for is_broken in (False, True) for columns in column_counts)
    return next(filter(_fits, choices), figure)


def _fits(figure: Figure) -> bool:
    """Whether the names of all lines have room at their ends."""
    plan = plan_legends(figure)
    return all(plan.at_ends) and _rows(figure) * figure.panel_height_mm <= MAX_FIGURE_MM


def _rows(figure: Figure) -> int:
    return -(-sum(bool(panel.marks) for panel in figure.panels) // figure.columns)


def _in_columns(figure: Figure, columns: int, is_broken: bool) -> Figure:
    """The figure in so many columns, its panels high enough for the names, which are broken into rows if so asked."""
    letters = MAX_END_NAMES_SHARE * figure.width_mm / columns / LETTER_MM if is_broken else MAX_END_NAME_LETTERS
    panels = tuple(_with_broken_names(panel, letters) for panel in figure.panels)
    figure = replace(figure, panels=panels, columns=columns)
    height = min(figure.panel_height_mm, MAX_FIGURE_MM / _rows(figure))
    names_mm = END_NAME_MM * max(name_rows(panel) for panel in panels)
    return replace(figure, panel_height_mm=max(height, names_mm))


def _with_broken_names(panel: Panel, letters: float) -> Panel:
    marks = (replace(mark, label=wrap(mark.label, letters)) if isinstance(mark, Line) else mark for mark in panel.marks)
    return replace(panel, marks=tuple(marks), direct=True)
