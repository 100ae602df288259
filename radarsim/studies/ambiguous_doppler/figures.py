"""The hypotheses of one realisation, scan by scan, for their figure.

The study's figures: σ and gains, right folds, lost tracks, hypotheses as a fan, weights of orders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH
from radarsim.language import term, tr
from radarsim.report import panels, sweeps, tables
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.report.quantities import RADIAL
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.ambiguous_doppler.study import prepare
from radarsim.studies.ambiguous_doppler.tables import Result

if TYPE_CHECKING:
    import pandas as pd


# ---- map -------------------------------------------------------------------------------------------------------------
LANE = WIDTH - 1  # the realisation of a group whose list is left in memory


@dataclass(frozen=True)
class Fan:
    """The hypotheses of a filter in one realisation: times (K,), true velocities (K,), and a list for each scan.

    A list is (velocity (n,) m/s, acceleration (n,) m/s², probability (n,)), the most probable first."""

    t_s: np.ndarray
    truth: np.ndarray
    lists: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]


def fan(case: Case, filter_index: int, scans: int) -> Fan:
    """The lists of a filter over the first scans, in realisation 7 of the case."""
    single_filter = {"filters": (case.spec.filters[filter_index],), "baseline": None, "rare": None}
    single_spec: Any = case.spec.model_copy(update=single_filter)
    plan = prepare(Case(case.name, case.stem, case.study, single_spec, case.swept, case.realisations, case.seed))
    lists = []
    for k in range(1, scans + 1):
        world = plan.world._replace(
            truth=plan.world.truth[:k].copy(), t=plan.world.t[:k].copy(), spans=plan.world.spans[:k].copy()
        )
        plots, out, columns = sums.simulate_hypotheses(world, plan.banks, 0)
        count = int(out[0, -1, records.COUNT, LANE])
        list_index = int(plots[:, records.DETECTED, LANE].sum()) % 2  # each plot moves hypotheses to the other list
        hypotheses = columns.reshape(COLUMNS, -1)[4 * list_index : 4 * list_index + 4, :count]
        weight = np.exp(hypotheses[3] - hypotheses[3].max(initial=-np.inf))
        order = np.argsort(-weight, kind="stable")
        lists.append((hypotheses[1][order], hypotheses[2][order], weight[order] / weight.sum()))
        truth = plots[:, records.TRUTH + 1, LANE]
    return Fan(plan.world.t[:scans], truth, tuple(lists))


# ---- figures ---------------------------------------------------------------------------------------------------------
DRAWN_FROM = {"right": ("folds",), "lost": ("folds",)}


def figures(
    results: Sequence[Result], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """sigma_r … gain_ar; right and lost; hypotheses; orders."""
    figures_by_name = panels.per_component(results, tables_by_name, RADIAL, experiment)
    for name, (column, title, caption) in SHARES.items():
        visible, left_out = panels.shown_families(results, panels.named(experiment, name))
        labels = column, tr(title), tr(caption) + left_out
        if visible and (figure := share_figure(name, visible, tables_by_name["folds"], labels)):
            figures_by_name[name] = figure
    figures_by_name |= hypotheses_figure(experiment.shown_in("hypotheses"))
    visible, left_out = panels.shown(results, panels.named(experiment, "orders"))
    figures_by_name |= orders_figure(visible, tables_by_name["orders"], left_out)
    figures_by_name = {name: figure for name, figure in figures_by_name.items() if figure}
    return figures_by_name | rare_figure(results, tables_by_name["folds"])


SHARES = {  # figure: column of folds.csv, title of the axis, caption
    "right": (
        "right",
        term("P(all folds right)"),
        term(
            "Share of realisations in which all folds so far are right, for the best hypothesis. Bands: 95 % "
            "intervals. Exact values are known for the nearest fold where truth and filter agree, and for "
            "the Chinese remainder of two scans."
        ),
    ),
    "lost": (
        "beyond",
        term("P(velocity off by over D/2)"),
        term("Share of realisations whose velocity is off by more than half the span. Bands: 95 % intervals."),
    ),
}


def share_figure(
    name: str, results: Sequence[Result], table: "pd.DataFrame", labels: tuple[str, str, str]
) -> Figure | None:
    """A share of realisations against time: a panel for each config, a line for each filter and swept value.

    labels is a value of SHARES: the column of the table, the axis, the caption."""
    rows = tables.groups(table, "case", "filter")
    filters = panels.filters_of(results)
    panels_by_title = panels.by_panel(results).items()
    share_panels = [_share_panel(title, members, rows, labels[:2], filters) for title, members in panels_by_title]
    share_panels = [panel for panel in share_panels if panel.marks]
    if not share_panels:
        return None
    return panels.in_columns(Figure(name, labels[1], labels[2], tuple(share_panels)))


def rare_figure(results: Sequence[Result], table: "pd.DataFrame") -> dict[str, Figure]:
    """The share of realisations with a wrong fold by the last scan, over a swept key.

    It replaces the figure `right` where all folds are almost always right."""
    rare_panels: list[Panel] = []
    notes: list[str] = []
    rows = tables.groups(table, "case", "filter")
    for (_, keys), members in sweeps.families(results).items():
        x, axis = sweeps.places(members[0], keys[0], [dict(result.swept)[keys[0]] for result in members])
        order = np.argsort(x)
        marks: list[Line] = []
        for f in members[0].axes.filters:
            if all((result.name, f) in rows for result in members):
                final_rows = [rows[members[i].name, f].iloc[-1] for i in order]
                look = panels.look(len(marks), 0, 1)
                marks.append(
                    panels.line_of(x[order], final_rows, ("right", "right_lo", "right_hi"), panels.literal(f), look)
                )
        if len(keys) > 1 or axis.ticks or not marks or min(float(mark.y.min()) for mark in marks) < 1 - panels.RARE:
            return {}
        losses, note = panels.ever_lost(marks)
        notes += [note]
        rare_panels += [Panel(axis, panels.loss_axis(tr("P(a fold is wrong)"), losses), losses)] if losses else []
    if not rare_panels:
        return {}
    caption = tr(
        "Share of realisations in which a fold is wrong by the last scan, for the best hypothesis, of "
        "{realisations} each. Bands: 95 % intervals.",
        realisations=panels.realisations(results),
    ) + "".join(dict.fromkeys(notes))
    figure = panels.in_columns(Figure("right", tr("P(a fold is wrong)"), caption, tuple(rare_panels)))
    return {"right": figure}


def _share_panel(
    title: str, members: Sequence[Result], rows: Mapping, labels: tuple[str, str], filters: Sequence[str]
) -> Panel:
    column, axis_title = labels
    exact = ["exact_right"] if column == "right" else []
    columns = ("t_s", column, f"{column}_lo", f"{column}_hi", *exact)
    rows_by_key = {(*key, column): filter_rows for key, filter_rows in rows.items()}
    marks = panels.lines_of(members, rows_by_key, column, columns, filters)
    lines = [mark for mark in marks if isinstance(mark, Line)]
    rare = lines and max(float(line.y[-1]) for line in lines) < panels.RARE
    panel = Panel(
        panels.time_axis(),
        panels.loss_axis(axis_title, lines) if rare else Axis(axis_title, limits=(0, 1)),
        tuple(marks),
        title,
    )
    return panels.keyed(panel, members, filters)


def hypotheses_figure(cases: Sequence[Case]) -> dict[str, Figure]:
    """The hypotheses of one realisation as a fan: a panel for each config, for its last filter that keeps several."""
    fan_panels: list[Panel] = []
    fans: dict[str, Fan] = {}
    stems: list[str] = []
    for case in cases:
        remembering = [i for i, o in enumerate(case.spec.filters) if (o.hypotheses or 1) > 1 and o.combine is None]
        if not remembering or case.stem in stems:
            continue
        stems.append(case.stem)
        if len(fan_panels) < MAX_FANS:
            fans[case.stem] = fan(case, remembering[-1], min(FAN_SCANS, case.spec.scans))
            fan_panels.append(_fan_panel(case, fans[case.stem], remembering[-1]))
    if not fan_panels:
        return {}
    panels_by_title = panels.distinct(
        [(panel.title, config) for panel, config in zip(fan_panels, fans, strict=True)], fan_panels
    )
    fan_panels = [replace(panel, title=title) for title, panel in panels_by_title.items()]
    counts = [len(velocities) for velocities, _, _ in next(iter(fans.values())).lists]
    caption = tr(
        "Fold sequences kept, {name}: {first} at first, {last} after {scans} scans. One realisation "
        "(number 7): after each scan a line for every sequence kept, with its velocity and acceleration, "
        "up to the next scan; brighter and broader lines are more probable. Dots: the true velocity.",
        **{"first": counts[0], "last": counts[-1], "scans": len(counts), "name": panels.plain(fan_panels[0].title)},
    ) + panels.left_out(stems, list(fans))
    columns = min(2, len(fan_panels))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    return {
        "hypotheses": Figure("hypotheses", tr("Pruning of hypotheses"), caption, tuple(fan_panels), columns, width, 70)
    }


MAX_FANS, FAN_SCANS, MAX_FAN_LINES = 4, 8, 40  # panels; scans of a panel; lines of a scan


def _fan_panel(case: Case, hypotheses: Fan, filter_index: int) -> Panel:
    marks: list = []
    dt = case.spec.radar.scan_period_s
    for t, (v, a, p) in zip(hypotheses.t_s, hypotheses.lists, strict=True):
        for velocity, acceleration, weight in zip(v[:MAX_FAN_LINES], a[:MAX_FAN_LINES], p[:MAX_FAN_LINES], strict=True):
            shade = weight / p[0]
            style = Style(0.15 + 0.85 * shade, 0, None, 0.25 + 1.75 * weight)
            marks.append(
                Line(np.array([t, t + 0.92 * dt]), velocity + acceleration * np.array([0, 0.92 * dt]), "", style)
            )
    marks.append(Line(hypotheses.t_s, hypotheses.truth, "", Style(1, None, 0, size_pt=3.5), name=tr("true velocity")))
    title = f"{panels.literal(case.spec.device or case.stem)}, {panels.literal(case.spec.filters[filter_index].name)}"
    low, high = hypotheses.truth.min() - FAN_SPANS * case.spec.radar.spans_mps[0], hypotheses.truth.max()
    limits = (low, high + FAN_SPANS * case.spec.radar.spans_mps[0])
    x, y = replace(panels.time_axis(), limits=(None, None)), Axis(tr("radial velocity, m/s"), limits=limits)
    return Panel(x, y, tuple(marks), title, direct=False)


FAN_SPANS = 8  # spans shown to either side of the true velocities


def orders_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> dict[str, Figure]:
    """Mean weight of each order in the range against time: a panel for each filter that combines orders."""
    order_panels = []
    for (case, name), filter_rows in tables.groups(table, "case", "filter").items():
        result = next((r for r in results if r.name == case), None)
        if result is None:
            continue
        marks = tuple(
            panels.line(rows, ("t_s", "weight"), tr("order {number}", number=order), panels.look(order, 0, 1))
            for order, rows in ((n, filter_rows[filter_rows["order"] == n]) for n in range(3))
            if len(rows)
        )
        panel_title = panels.literal(name) if len(results) == 1 else f"{panels.label(result)}, {panels.literal(name)}"
        order_panels.append(Panel(panels.time_axis(), Axis(tr("mean weight in the range")), marks, panel_title))
    if not order_panels:
        return {}
    caption = tr("Weights of the orders in the estimate of range, mean over realisations; shares may be negative.")
    titles = [panel.title for panel in order_panels]
    caption += panels.left_out(titles, panels.spread_out(titles, panels.MOST_PANELS)) + left_out
    columns = min(3, len(order_panels))
    order_panels = panels.spread_out(order_panels, panels.MOST_PANELS)
    visible = tuple(panels.in_legend(order_panels)) if len(order_panels) > 1 else tuple(order_panels)
    return {
        "orders": Figure(
            "orders", tr("Weights of orders"), caption, visible, columns, PAGE_MM if columns > 1 else COLUMN_MM
        )
    }
