"""Figures of σ, gain, bias and spread against time, of every study."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.translate import quote_name, term, tr
from radarsim.report import caption_remarks
from radarsim.report import tables as common
from radarsim.report.case_selection import (
    MAX_PANELS,
    cases_for_figure,
    group_by_panel,
    left_out_remark,
    pick_evenly,
    realisations_text,
    select_cases_by_panel,
)
from radarsim.report.drawing.model import (
    COLUMN_MM,
    GREY,
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
from radarsim.report.figure_lines import GAIN, SIGMA, all_filters, case_lines, line_from_rows, scale_line
from radarsim.report.key_labels import (
    case_label,
    config_device,
    degrees_factor_and_unit,
    escape_dollars,
    label_with_unit,
    sigma_axis_label,
    swept_title,
)
from radarsim.report.panel_layout import WIDE_MM, arrange_columns, fitting_axis, holding, keyed_panels, time_axis
from radarsim.report.quantities import Component
from radarsim.report.statistics import Z95

if TYPE_CHECKING:
    import pandas as pd


CUT_LOSS_PERCENT = 100.0  # per cent at which much lower gains are cut
MAX_FIRST_RATIO = 3.0  # of the largest bias at the first plot to that at later ones, on one axis
LONGEST_INSIDE = 28  # letters of a name in a legend inside a panel of many lines


def sigma_figure(name: str, results: Sequence[CaseResult], curves: Mapping, component: Component) -> Figure:
    """σ(t) of one component: a panel for each config, a line for each filter and swept value.

    curves is tables.group_by(table, "case", "filter", "component")."""
    groups = group_by_panel(results)
    filters = all_filters(results)
    panels = [
        panel
        for title, members in groups.items()
        for panel in _sigma_panels(title, members, curves, component, filters)
    ]
    caption = tr(
        "Root-mean-square error of the {quantity} versus time, from {realisations}.",
        quantity=component.words,
        realisations=realisations_text(results),
    )
    title = tr("RMS error of the {quantity}", quantity=component.words)
    figure = arrange_columns(Figure(name, title, caption, tuple(panels)))
    return figure


def with_floor(figure: Figure, curves: "pd.DataFrame", component: str, factor: float = 1.0) -> Figure:
    """A figure of σ of one case, of few lines, with its floor. Of filters that have other plots it is that of those
    with the most."""
    rows = curves[curves["component"].eq(component) & curves["floor"].notna()] if "floor" in curves else curves[:0]
    if not len(rows) or len(figure.panels) != 1 or len(figure.panels[0].marks) > MAX_PANEL_LINES:
        return figure
    lowest = factor * rows.groupby("t_s", sort=True)["floor"].min()
    (panel,) = figure.panels
    line = Line(lowest.index.to_numpy(), lowest.to_numpy(), tr("CRB"), GUIDE)
    panel = replace(panel, marks=(*panel.marks, line))
    posterior = rows["floor_kind"].str.startswith("posterior").all()
    remark = tr("Grey: posterior Cramér–Rao bound (CRB).") if posterior else tr(UNDER_UNBIASED)
    return replace(figure, panels=(panel,), caption=f"{figure.caption} {remark}")


UNDER_UNBIASED = term("Grey: Cramér–Rao bound (CRB) of unbiased estimators.")
GUIDE = Style(GREY, 0, width_pt=0.8)


def _sigma_panels(
    title: str, members: Sequence[CaseResult], curves: Mapping, component: Component, filters: Sequence[str]
) -> list[Panel]:
    factor, unit = degrees_factor_and_unit(component.unit)
    marks = [scale_line(line, factor) for line in case_lines(members, curves, component.name, SIGMA, filters)]
    y = fitting_axis(sigma_axis_label(component.symbol, unit), marks)
    return keyed_panels(Panel(time_axis(), y, tuple(marks), title), members, filters) if marks else []


def gain_figure(name: str, results: Sequence[CaseResult], gains: Mapping, component: Component) -> Figure:
    """Relative gain of one component against time, a line for each case and filter.

    One panel where no config is swept; else one for each of `group_by_panel`. gains is tables.group_by(table, "case",
    "filter", "component")."""
    caption = tr(
        "Gain over filter {base}, from {realisations} with the same noise for all filters.",
        base=quote_name(results[0].axes.filters[results[0].axes.baseline]),
        realisations=realisations_text(results),
    )
    y = Axis(tr("gain in $\\sigma$ of {symbol}, %", symbol=component.symbol))
    title = tr("Gain in the RMS error of the {quantity}", quantity=component.words)
    has_several_gains = any(len(result.axes.filters) > 2 for result in results)
    if any(result.swept_values for result in results) or (has_several_gains and len(results) > 1):
        panels, filters = [], all_filters(results)
        for panel_title, members in group_by_panel(results).items():
            if lines := case_lines(members, gains, component.name, GAIN, filters):
                panel = Panel(time_axis(), *_cut(y, lines), panel_title)
                panels += keyed_panels(panel, members, filters, baseline=False)
        return _with_remark_on_losses(arrange_columns(Figure(name, title, caption, tuple(panels))))
    marks = _gain_lines(results, gains, component, has_several_gains)
    # Many long names would cover the lines: the legend is beside the panel.
    has_long_names = any(isinstance(mark, Line) and len(mark.label) > LONGEST_INSIDE for mark in marks)
    is_beside = len(marks) > 3 and has_long_names
    panel = Panel(time_axis(), *_cut(y, marks), direct=not is_beside, legend="right" if is_beside else "best")
    width = PAGE_MM if is_beside else COLUMN_MM if len(results) < 3 else WIDE_MM
    return _with_remark_on_losses(Figure(name, title, caption, (panel,), width_mm=width))


def _gain_lines(
    results: Sequence[CaseResult], gains: Mapping, component: Component, has_several_gains: bool
) -> list[Mark]:
    """The lines of a single panel of gains, named by case and filter as far as these differ."""
    marks: list[Mark] = []
    for i, result in enumerate(results):
        for n, filter_name in enumerate(result.axes.filters):
            rows = gains.get((result.name, filter_name, component.name))
            if rows is not None:
                case = case_label(result) if len(results) > 1 else ""
                own_name = escape_dollars(filter_name) if has_several_gains or len(results) == 1 else ""
                text = ", ".join(filter(None, (case, own_name)))
                look_number = n if has_several_gains else i
                style = Style(i if len(results) > 1 else n, look_number, look_number)
                marks.append(line_from_rows(rows, GAIN, text, style, text))
    return marks


def _with_remark_on_losses(figure: Figure) -> Figure:
    """A figure of gains, with a remark in its caption where losses are cut."""
    if not any(panel.y.limits[0] == -CUT_LOSS_PERCENT for panel in figure.panels):
        return figure
    names = caption_remarks.lines_below(figure, -CUT_LOSS_PERCENT)
    remark = tr("Losses above {loss:g} % are off the axis: {names}.", loss=CUT_LOSS_PERCENT, names=names)
    return replace(figure, caption=f"{figure.caption} {remark}")


def _cut(y: Axis, lines: Sequence[Mark]) -> tuple[Axis, tuple[Mark, ...]]:
    """The axis of gains and its marks: losses far beyond 100 % would hide everything else, and are cut."""
    values = [mark.y[np.isfinite(mark.y)] for mark in lines if isinstance(mark, Line)]
    lowest = min((float(column.min()) for column in values if column.size), default=0.0)
    return replace(y, limits=(-CUT_LOSS_PERCENT, 100.0)) if lowest < -2 * CUT_LOSS_PERCENT else y, (
        Reference(0),
        *lines,
    )


def component_figures(
    results: Sequence[CaseResult],
    tables: "Mapping[str, pd.DataFrame]",
    components: Iterable[Component],
    experiment: Experiment,
) -> dict[str, Figure]:
    """gain_<component> and sigma_<component> of every component; each with the cases that the config names for it."""
    curves, gains = (common.group_by(tables[name], "case", "filter", "component") for name in ("curves", "gains"))
    figures = {}
    for component in components:
        for kind, draw, rows in (
            ("gain", gain_figure, gains),
            ("sigma", sigma_figure, curves),
            ("dynamic", dynamic_figure, curves),
        ):
            name = f"{kind}_{component.name}"
            visible, remark = select_cases_by_panel(results, cases_for_figure(experiment, name))
            figure = draw(name, visible, rows, component) if visible else None
            if figure and any(isinstance(mark, Line) for panel in figure.panels for mark in panel.marks):
                if kind == "sigma" and len(results) == 1:
                    factor, _ = degrees_factor_and_unit(component.unit)
                    figure = with_floor(figure, tables["curves"], component.name, factor)
                figures[name] = replace(figure, caption=figure.caption + remark)
    return figures


def dynamic_figure(name: str, results: Sequence[CaseResult], curves: Mapping, component: Component) -> Figure | None:
    """Dynamic error (bias) and fluctuation error (spread) of one component, a panel of each for each case that has
    both. None where no case's bias exceeds its spread anywhere: then σ suffices."""
    pairs: list[tuple[Panel, Panel]] = []
    for result in results:
        filter_rows = {
            f: curves[(result.name, f, component.name)]
            for f in result.axes.filters
            if (result.name, f, component.name) in curves
        }
        if any((abs(rows["bias"]) > rows["spread"]).any() for rows in filter_rows.values()):
            pairs.append(_dynamic_panels(result, filter_rows, component))
    if not pairs:
        return None
    caption = tr(
        "Bias and standard deviation of the {quantity} error, from {realisations}. Cases whose bias is never the "
        "larger are left out.",
        quantity=component.words,
        realisations=realisations_text(results),
    )
    titles = [panel.title for panel, _ in pairs]
    pairs = pick_evenly(pairs, MAX_PANELS // 2)
    caption += left_out_remark(titles, [panel.title for panel, _ in pairs])
    if any(bias.y.limits != (None, None) for bias, _ in pairs):
        caption += " " + tr("The first bias is off the axis.")
    title = tr("Dynamic and fluctuation error of the {quantity}", quantity=component.words)
    return Figure(name, title, caption, tuple(panel for pair in pairs for panel in pair), 2, PAGE_MM, 56.0)


def _dynamic_panels(
    result: CaseResult, filter_rows: "Mapping[str, pd.DataFrame]", component: Component
) -> tuple[Panel, Panel]:
    """The panels of bias and of spread of a case, a line for each filter."""
    factor, unit = degrees_factor_and_unit(component.unit)
    biases: list[Mark] = [Reference(0)]
    spreads: list[Mark] = []
    for n, (f, rows) in enumerate(filter_rows.items()):
        t, name, style = rows["t_s"].to_numpy(), escape_dollars(f), Style(n, n, n)
        bias, half = factor * rows["bias"].to_numpy(), factor * Z95 * rows["bias_se"].to_numpy()
        biases.append(Line(t, bias, name, style, bias - half, bias + half, name=name))
        spreads.append(Line(t, factor * rows["spread"].to_numpy(), name, style, name=name))
    title = swept_title(result) or config_device(result)
    bias_axis = _bias_axis(label_with_unit(tr("bias of {symbol}", symbol=component.symbol), unit), biases)
    label = label_with_unit(tr("standard deviation of {symbol}", symbol=component.symbol), unit)
    return (
        Panel(time_axis(), bias_axis, tuple(biases), title),
        Panel(time_axis(), fitting_axis(label, spreads), tuple(spreads), title),
    )


def _bias_axis(label: str, marks: Sequence[Mark]) -> Axis:
    """An axis of biases; without those at the first plot where they would hide the others: an estimate from one plot
    may err by the whole quantity."""
    lines = [mark for mark in marks if isinstance(mark, Line) and len(mark.x) > 1]
    later = [replace(line, x=line.x[1:], y=line.y[1:], lo=None, hi=None) for line in lines]
    first, highest = (
        max((_largest(line.y[part]) for line in lines), default=0.0) for part in (slice(1), slice(1, None))
    )
    return Axis(label, limits=holding(later, Axis(label))) if first > MAX_FIRST_RATIO * highest > 0 else Axis(label)


def _largest(values: np.ndarray) -> float:
    """The largest magnitude of values."""
    return float(np.nanmax(np.abs(values), initial=0.0))
