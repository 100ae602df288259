"""The study's figures: σ and gains, right folds, lost tracks, hypotheses as a fan, weights of orders."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.translate import term, tr
from radarsim.report import case_selection, figure_lines, key_labels, panel_layout, sweep_figures, tables, time_figures
from radarsim.report.drawing.model import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Panel
from radarsim.report.quantities import RADIAL
from radarsim.studies.ambiguous_doppler.hypothesis_fan import hypotheses_figure
from radarsim.studies.ambiguous_doppler.tables import BEYOND_SHARE, Result

if TYPE_CHECKING:
    import pandas as pd


DRAWN_FROM = {"right": ("folds.right",), "lost": (f"folds.{BEYOND_SHARE}",)}


def figures(
    results: Sequence[Result], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """sigma_r … gain_ar; right and lost; hypotheses; orders."""
    figures_by_name = time_figures.component_figures(results, tables_by_name, RADIAL, experiment)
    for name, (column, title, caption) in SHARES.items():
        visible, left_out = case_selection.select_cases_by_panel(
            results, case_selection.cases_for_figure(experiment, name)
        )
        labels = column, tr(title), tr(caption) + left_out
        if visible and (figure := share_figure(name, visible, tables_by_name["folds"], labels)):
            figures_by_name[name] = figure
    figures_by_name |= hypotheses_figure(experiment.cases_in_figure("hypotheses"))
    visible, left_out = case_selection.select_cases(results, case_selection.cases_for_figure(experiment, "orders"))
    figures_by_name |= orders_figure(visible, tables_by_name["orders"], left_out)
    figures_by_name = {name: figure for name, figure in figures_by_name.items() if figure}
    return figures_by_name | rare_figure(results, tables_by_name["folds"])


SHARES = {  # figure: column of folds.csv, title of the axis, caption
    "right": (
        "right",
        term("P(all folds right)"),
        term(
            "Share of realisations in which the best hypothesis has all folds right so far. Exact for the nearest "
            "fold (if the filter's model is true) and for the Chinese remainder of two scans."
        ),
    ),
    "lost": (
        BEYOND_SHARE,
        term("P(velocity off by over D/2)"),
        term("Share of realisations whose velocity is off by more than half the unambiguous interval."),
    ),
}


def share_figure(
    name: str, results: Sequence[Result], table: "pd.DataFrame", labels: tuple[str, str, str]
) -> Figure | None:
    """A share of realisations against time: a panel for each config, a line for each filter and swept value.

    labels is a value of SHARES: the column of the table, the axis, the caption."""
    rows = tables.group_by(table, "case", "filter")
    filters = figure_lines.all_filters(results)
    panels_by_title = case_selection.group_by_panel(results).items()
    share_panels = [
        panel
        for title, members in panels_by_title
        for panel in _share_panels(title, members, rows, labels[:2], filters)
    ]
    if not share_panels:
        return None
    return panel_layout.arrange_columns(Figure(name, labels[1], labels[2], tuple(share_panels)))


def rare_figure(results: Sequence[Result], table: "pd.DataFrame") -> dict[str, Figure]:
    """The share of realisations with a wrong fold by the last scan, over a swept key.

    It replaces the figure `right` where all folds are almost always right."""
    rare_panels: list[Panel] = []
    notes: list[str] = []
    rows = tables.group_by(table, "case", "filter")
    for (_, keys), members in sweep_figures.group_swept_cases(results).items():
        x, axis = sweep_figures.axis_positions(
            members[0], keys[0], [dict(result.swept_values)[keys[0]] for result in members]
        )
        order = np.argsort(x)
        marks: list[Line] = []
        for f in members[0].axes.filters:
            if all((result.name, f) in rows for result in members):
                final_rows = [rows[members[i].name, f].iloc[-1] for i in order]
                look = figure_lines.line_style(len(marks), 0, 1)
                marks.append(
                    figure_lines.line_from_tables(
                        x[order], final_rows, ("right", "right_lo", "right_hi"), key_labels.escape_dollars(f), look
                    )
                )
        if (
            len(keys) > 1
            or axis.ticks
            or not marks
            or min(float(mark.y.min()) for mark in marks) < 1 - panel_layout.RARE_LOSS
        ):
            return {}
        losses, note = panel_layout.loss_lines(marks)
        notes += [note]
        rare_panels += [Panel(axis, panel_layout.loss_axis(tr("P(a fold is wrong)"), losses), losses)] if losses else []
    if not rare_panels:
        return {}
    is_sampled = any(result.spec.rare is not None for result in results)
    sample = (
        term("Importance sampling: {realisations} per case, weighted.")
        if is_sampled
        else term("From {realisations} each.")
    )
    parts = (
        tr("Share of realisations in which the best hypothesis has a wrong fold by the last scan."),
        tr(sample, realisations=case_selection.realisations_text(results)),
    )
    caption = " ".join(parts) + "".join(dict.fromkeys(notes))
    figure = panel_layout.arrange_columns(Figure("right", tr("P(a fold is wrong)"), caption, tuple(rare_panels)))
    return {"right": figure}


def _share_panels(
    title: str, members: Sequence[Result], rows: Mapping, labels: tuple[str, str], filters: Sequence[str]
) -> list[Panel]:
    column, axis_title = labels
    exact = ["exact_right"] if column == "right" else []
    columns = ("t_s", column, f"{column}_lo", f"{column}_hi", *exact)
    rows_by_key = {(*key, column): filter_rows for key, filter_rows in rows.items()}
    marks = figure_lines.case_lines(members, rows_by_key, column, columns, filters)
    lines = [mark for mark in marks if isinstance(mark, Line)]
    rare = lines and max(float(line.y[-1]) for line in lines) < panel_layout.RARE_LOSS
    panel = Panel(
        panel_layout.time_axis(),
        panel_layout.loss_axis(axis_title, lines) if rare else Axis(axis_title, limits=(0, 1)),
        tuple(marks),
        title,
    )
    return panel_layout.keyed_panels(panel, members, filters) if marks else []


def orders_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> dict[str, Figure]:
    """Mean weight of each order in the range against time: a panel for each filter that combines orders."""
    order_panels = []
    for (case, name), filter_rows in tables.group_by(table, "case", "filter").items():
        result = next((r for r in results if r.name == case), None)
        if result is None:
            continue
        marks = tuple(
            figure_lines.line_from_rows(
                rows, ("t_s", "weight"), tr("order {number}", number=order), figure_lines.line_style(order, 0, 1)
            )
            for order, rows in ((n, filter_rows[filter_rows["order"] == n]) for n in range(3))
            if len(rows)
        )
        panel_title = (
            key_labels.escape_dollars(name)
            if len(results) == 1
            else f"{key_labels.case_label(result)}, {key_labels.escape_dollars(name)}"
        )
        order_panels.append(Panel(panel_layout.time_axis(), Axis(tr("mean weight in the range")), marks, panel_title))
    if not order_panels:
        return {}
    caption = tr(
        "Weights of the model orders in the estimate of range, mean over realisations; shares may be negative."
    )
    titles = [panel.title for panel in order_panels]
    caption += (
        case_selection.left_out_remark(titles, case_selection.pick_evenly(titles, case_selection.MAX_PANELS)) + left_out
    )
    columns = min(3, len(order_panels))
    order_panels = case_selection.pick_evenly(order_panels, case_selection.MAX_PANELS)
    visible = tuple(panel_layout.with_legend_cell(order_panels)) if len(order_panels) > 1 else tuple(order_panels)
    return {
        "orders": Figure(
            "orders", tr("Weights of model orders"), caption, visible, columns, PAGE_MM if columns > 1 else COLUMN_MM
        )
    }
