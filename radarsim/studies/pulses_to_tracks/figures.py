"""The study's figures: σ and gains, locks by scan, errors of the bursts' estimates, the cost of a lost burst."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.translate import term, tr
from radarsim.report import case_selection, figure_lines, key_labels, panel_layout, sweep_figures, tables, time_figures
from radarsim.report.drawing.model import PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.report.quantities import RADIAL
from radarsim.report.statistics import MIN_EVENTS
from radarsim.studies.pulses_to_tracks.kernels.layout import AGES
from radarsim.studies.pulses_to_tracks.tables import Result

if TYPE_CHECKING:
    import pandas as pd

MIN_REALISATIONS_OF_POINT = 30  # for a point to be drawn
MIN_LOSSES = 2  # points of a line of losses: one alone is in the table
ROOM = 0.06  # of an axis' length, beside its points
DRAWN_FROM = {"threshold": ("locks", "curves"), "measured": ("estimates",)}


def figures(
    results: Sequence[Result], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """sigma_r … gain_ar; folds; locks, measured, losses of cases without a sweep, threshold of the others."""
    figures_by_name = time_figures.component_figures(results, tables_by_name, RADIAL, experiment)
    for name, (draw, title, caption) in STUDY_FIGURES.items():
        unswept = [result for result in case_selection.unswept_cases(results) if not result.swept_values]
        visible, left_out = case_selection.select_cases(
            results if name == "folds" else unswept, case_selection.cases_for_figure(experiment, name)
        )
        visible_panels = [panel for result in visible if (panel := draw(result, tables_by_name)).marks]
        if visible_panels:
            figures_by_name[name] = _figure(name, tr(title), tr(caption) + left_out, visible_panels)
    figures_by_name |= threshold_figure(results, tables_by_name)
    return {name: figure for name, figure in figures_by_name.items() if figure}


def _figure(name: str, title: str, caption: str, figure_panels: list[Panel]) -> Figure:
    if len(figure_panels) > 1:
        figure_panels = panel_layout.with_legend_cell(figure_panels)
    return panel_layout.arrange_columns(Figure(name, title, caption, tuple(figure_panels)))


def _title(result: Result) -> str:
    return key_labels.swept_title(result) or key_labels.config_device(result)


def threshold_figure(results: Sequence[Result], tables_by_name: "Mapping[str, pd.DataFrame]") -> dict[str, Figure]:
    """Share of bursts that locked, and σ of range at the last scan, against one swept number, for each config."""
    threshold_panels: list[Panel] = []
    for (_, keys), members in sweep_figures.group_swept_cases(results).items():
        x, axis = sweep_figures.axis_positions(
            members[0], keys[0], [dict(result.swept_values)[keys[0]] for result in members]
        )
        if len(keys) == 1 and not axis.ticks:
            axis = _with_room(axis, x)
            threshold_panels += _threshold_panels([members[i] for i in np.argsort(x)], np.sort(x), axis, tables_by_name)
    if not any(panel.marks for panel in threshold_panels):
        return {}
    caption = tr(
        "P(not locked): share of bursts at the worst scan whose velocity (or acceleration, if used) errs by more "
        "than five times its Cramér–Rao bound. Points without failures, and curves of a single point, are left out."
    )
    figure = Figure(
        "threshold",
        tr("The threshold"),
        caption,
        tuple(panel_layout.with_legend_cell(threshold_panels)),
        3,
        PAGE_MM,
        60,
    )
    return {"threshold": figure}


def _with_room(axis: Axis, x: np.ndarray) -> Axis:
    """The axis with room beside the first and the last of the values x (n,): whiskers lie on no other axis."""
    low, high = (np.log(x.min()), np.log(x.max())) if axis.scale == "log" else (x.min(), x.max())
    ends = np.array([low, high]) + np.array([-ROOM, ROOM]) * (high - low)
    left, right = np.exp(ends) if axis.scale == "log" else ends
    return replace(axis, limits=(float(left), float(right)))


def _threshold_panels(
    members: Sequence[Result], x: np.ndarray, axis: Axis, tables_by_name: "Mapping[str, pd.DataFrame]"
) -> list[Panel]:
    """The two panels of cases in the order of their swept values x (n,); none if no estimator fails often enough."""
    locks: list[Line] = []
    sigmas: list[Line] = []
    curves = tables.group_by(tables_by_name["curves"], "case", "filter", "component")
    for n, name in enumerate(members[0].axes.filters):
        style, label = figure_lines.line_style(n, 0, 1), key_labels.escape_dollars(name)
        final_sigmas = np.array([sweep_figures.final_sigma(result, name, "r", curves) for result in members])
        exact = final_sigmas[:, 3] if np.isfinite(final_sigmas[:, 3]).any() else None
        sigmas.append(Line(x, final_sigmas[:, 0], label, style, final_sigmas[:, 1], final_sigmas[:, 2], exact))
        if members[0].axes.ideal[n] >= 0:
            shares = np.array([_locked(result, tables_by_name["locks"], name) for result in members])
            locks.append(Line(x, shares[:, 0], label, style, shares[:, 1], shares[:, 2]))
    y = panel_layout.fitting_axis(tr("$\\sigma$ of $r$ at the end, m"), sigmas)
    range_panel = Panel(axis, y, tuple(sigmas), key_labels.config_device(members[0]))
    losses = map(panel_layout.complement_line, locks)
    lines_of_losses = tuple(line for line in losses if np.count_nonzero(line.y > 0) >= MIN_LOSSES)
    if not lines_of_losses:
        return []
    axis_y = panel_layout.loss_axis(tr("P(not locked)"), lines_of_losses)
    return [Panel(axis, axis_y, lines_of_losses, key_labels.config_device(members[0])), range_panel]


def _locked(result: Result, locks: "pd.DataFrame", name: str) -> tuple[float, float, float]:
    """The least share of locks over the scans, with its interval."""
    rows = tables.select_rows(locks, case=result.name, filter=name)
    row = rows.iloc[int(rows["lock_rate"].to_numpy().argmin())]
    return float(row["lock_rate"]), float(row["lock_lo"]), float(row["lock_hi"])


def _line(result: Result, name: str, rows: "pd.DataFrame", columns: Sequence[str]) -> Line:
    """A filter's line, which looks the same in every figure of its case."""
    return figure_lines.line_from_rows(
        rows, columns, key_labels.escape_dollars(name), figure_lines.line_style(result.axes.filters.index(name), 0, 1)
    )


def locks_panel(result: Result, tables_by_name: "Mapping[str, pd.DataFrame]") -> Panel:
    """Share of bursts that locked against time, a line for each estimator."""
    rows = tables.group_by(tables.select_rows(tables_by_name["locks"], case=result.name), "filter")
    marks = []
    ideal_filters = {options.name for options in result.spec.filters if options.estimator == "fisher_bound"}
    for (name,), filter_rows in rows.items():
        if ((1 - filter_rows["lock_rate"]) * filter_rows["n"]).sum() >= MIN_EVENTS and name not in ideal_filters:
            marks.append(
                panel_layout.complement_line(
                    _line(result, name, filter_rows, ("t_s", "lock_rate", "lock_lo", "lock_hi"))
                )
            )
    y_axis = panel_layout.loss_axis(tr("P(not locked)"), marks)
    return Panel(panel_layout.time_axis(), y_axis, tuple(marks), _title(result))


def folds_panel(result: Result, tables_by_name: "Mapping[str, pd.DataFrame]") -> Panel:
    """How often the best hypothesis has no wrong fold against time, a line for each filter that keeps several."""
    rows = tables.group_by(tables.select_rows(tables_by_name["folds"], case=result.name), "filter")
    marks = [
        _line(result, name, filter_rows, ("t_s", "right", "right_lo", "right_hi"))
        for (name,), filter_rows in rows.items()
    ]
    return Panel(
        panel_layout.time_axis(), Axis(tr("P(no wrong ambiguity)"), limits=(0, 1)), tuple(marks), _title(result)
    )


def measured_panel(result: Result, tables_by_name: "Mapping[str, pd.DataFrame]") -> Panel:
    """Errors of the measured velocity of all bursts against time, and the Cramér–Rao bound."""
    rows = tables.group_by(tables.select_rows(tables_by_name["estimates"], case=result.name, component="Vr"), "filter")
    columns = ("t_s", "sigma_all", "sigma_all_lo", "sigma_all_hi")
    marks = [_line(result, name, filter_rows, columns) for (name,), filter_rows in rows.items()]
    if rows:
        marks.append(
            figure_lines.line_from_rows(next(iter(rows.values())), ("t_s", "crb"), tr("Cramér–Rao bound"), Style(9, 1))
        )
    y = panel_layout.fitting_axis(tr("$\\sigma$ of measured $V_r$, m/s"), marks)
    return Panel(panel_layout.time_axis(), y, tuple(marks), _title(result))


def losses_panel(result: Result, tables_by_name: "Mapping[str, pd.DataFrame]") -> Panel:
    """σ of the range at the last scan by the scans since a burst was lost, a line for each filter that lost some."""
    range_rows = tables.select_rows(tables_by_name["losses"], case=result.name, component="r", k=result.axes.k[-1])
    marks = []
    for (name,), rows in tables.group_by(range_rows, "filter").items():
        rows = rows[rows["n"] >= MIN_REALISATIONS_OF_POINT]
        if len(rows) > 1:
            rows = rows.assign(sigma_hi=np.minimum(rows["sigma_hi"], 1e3 * rows["sigma"]))
            marks.append(_line(result, name, rows, ("since_loss", "sigma", "sigma_lo", "sigma_hi")))
    ticks = tuple((float(age), str(age) if age < AGES - 1 else f"{age}+") for age in range(AGES))
    x_axis = Axis(tr("scans since a burst was lost"), ticks=ticks)
    y = panel_layout.fitting_axis(tr("$\\sigma$ of $r$ at the last scan, m"), marks)
    return Panel(x_axis, y, tuple(marks), _title(result))


Draw = Callable[[Result, "Mapping[str, pd.DataFrame]"], Panel]
STUDY_FIGURES: dict[str, tuple[Draw, str, str]] = {
    "locks": (
        locks_panel,
        term("Bursts that do not lock"),
        term(
            "Share of bursts whose velocity (or acceleration, where used) is in error by more than five "
            "times its Cramér–Rao bound. Idealisations, and estimators that lost fewer than 20 "
            "bursts in all, are left out."
        ),
    ),
    "folds": (
        folds_panel,
        term("Folds that are right"),
        term(
            "Share of realisations in which a filter's best hypothesis has used no velocity in a wrong fold "
            "so far. Filters that use the nearest fold are left out."
        ),
    ),
    "measured": (
        measured_panel,
        term("What the bursts measure"),
        term("Root-mean-square error of the burst's velocity over all bursts, including those that did not lock."),
    ),
    "losses": (
        losses_panel,
        term("What a lost burst costs"),
        term(
            "Root-mean-square error of the range at the last scan, by the number of scans since the last "
            "burst that did not lock."
        ),
    ),
}
