"""The figure of σ of each component against time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.language.translate import tr
from radarsim.report import figure_lines, key_labels, panel_layout
from radarsim.report.drawing.model import Figure, Line, Mark, Panel, Reference
from radarsim.report.quantities import Component
from radarsim.studies.sonar.axes import SonarAxes

if TYPE_CHECKING:
    import pandas as pd


def case_lines(
    result: CaseResult[SonarAxes], groups: "Mapping[Any, pd.DataFrame]", component: str, columns: Sequence[str]
) -> list[Line]:
    """A line for each filter of a case that has rows; groups are by case, filter and component."""
    keys = enumerate((result.name, f, component) for f in result.axes.filters)
    return [figure_lines.line_from_rows(groups[key], columns, key[1], n) for n, key in keys if key in groups]


def manoeuvre_lines(result: CaseResult) -> list[Reference]:
    """Lines at the start and the end of a manoeuvre, where there is one."""
    times = getattr(result.axes, "manoeuvre_s", None) or ()
    return [Reference(when, "x") for when in times if 0 < when < result.axes.t_s[-1]]


def sigma_figure(
    name: str,
    results: Sequence[CaseResult[SonarAxes]],
    curves: "Mapping[Any, pd.DataFrame]",
    component: Component,
    left_out: str,
) -> Figure | None:
    """σ(t) of one component: a panel for each case, a line for each filter."""
    figure_panels = []
    factor, unit = key_labels.degrees_factor_and_unit(component.unit)
    shared = key_labels.shared_keys(results)
    for result in results:
        marks = [
            figure_lines.scale_line(line, factor)
            for line in case_lines(result, curves, component.name, figure_lines.SIGMA)
        ]
        if marks:
            y = panel_layout.fitting_axis(key_labels.sigma_axis_label(component.symbol, unit), marks)
            marks_of_panel: tuple[Mark, ...] = (*manoeuvre_lines(result), *marks)
            title = key_labels.swept_title(result, without=shared)
            figure_panels.append(Panel(panel_layout.time_axis(), y, marks_of_panel, title, direct=False))
    if not figure_panels:
        return None
    caption = (
        tr(
            "Root-mean-square error of the {name} versus time, from {count:,} realisations.",
            name=component.words,
            count=results[0].count,
        )
        + (" " + tr("Dotted: beginning and end of the manoeuvre.") if any(map(manoeuvre_lines, results)) else "")
        + left_out
    )
    if shared:
        same = key_labels.swept_description(results[0], without={key for key, _ in results[0].swept_values} - shared)
        caption += " " + tr("All panels: {values}.", values=key_labels.without_markup(same))
    figure = panel_layout.arrange_columns(
        Figure(name, tr("RMS error of the {name}", name=component.words), caption, tuple(figure_panels))
    )
    return figure
