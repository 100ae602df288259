"""The hypotheses of one realisation, scan by scan, for the figure that shows them.

The study's figures: σ and gains between their brackets, right folds, lost tracks, hypotheses as a fan, orders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH
from radarsim.language import term, tr
from radarsim.report import panels, seen, sweeps, tables
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.report.quantities import RADIAL
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.ambiguous_doppler.study import prepare
from radarsim.studies.ambiguous_doppler.tables import Result

if TYPE_CHECKING:
    import pandas as pd


# ---- map -------------------------------------------------------------------------------------------------------------
LANE = WIDTH - 1  # the realisation of a group whose list the kernel leaves behind


@dataclass(frozen=True)
class Fan:
    """Of one realisation and filter: times t (K,), true velocities (K,), and by scan the list of hypotheses. Each list
    is (velocity (n,) m/s, acceleration (n,) m/s², probability (n,)), the most probable first."""

    t_s: np.ndarray
    truth: np.ndarray
    lists: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]


def fan(case: Case, number: int, scans: int) -> Fan:
    """The lists of filter `number` over the first scans, in realisation 7 of the case."""
    alone = {"filters": (case.spec.filters[number],), "baseline": None, "rare": None}
    only: Any = case.spec.model_copy(update=alone)
    plan = prepare(Case(case.name, case.stem, case.study, only, case.swept, case.realisations, case.seed))
    lists = []
    for k in range(1, scans + 1):
        world = plan.world._replace(
            truth=plan.world.truth[:k].copy(), t=plan.world.t[:k].copy(), spans=plan.world.spans[:k].copy()
        )
        plots, out, listed = sums.simulate_hypotheses(world, plan.banks, 0)
        count = int(out[0, -1, records.COUNT, LANE])
        which = int(plots[:, records.DETECTED, LANE].sum()) % 2  # each plot is written from one list into the other
        own = listed.reshape(COLUMNS, -1)[4 * which : 4 * which + 4, :count]
        weight = np.exp(own[3] - own[3].max(initial=-np.inf))
        order = np.argsort(-weight, kind="stable")
        lists.append((own[1][order], own[2][order], weight[order] / weight.sum()))
        truth = plots[:, records.TRUTH + 1, LANE]
    return Fan(plan.world.t[:scans], truth, tuple(lists))


# ---- figures ---------------------------------------------------------------------------------------------------------
DRAWN_FROM = {"right": ("folds",), "lost": ("folds",)}


def figures(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]", experiment: Experiment) -> dict[str, Figure]:
    """sigma_r … gain_ar; right and lost; hypotheses; orders."""
    drawn = panels.per_component(results, made, RADIAL, experiment)
    for name, (column, words, caption) in SHARES.items():
        some, left_out = panels.shown_families(results, panels.named(experiment, name))
        figure = share_figure(name, some, made["folds"], (column, tr(words), tr(caption) + left_out)) if some else None
        drawn |= {name: figure} if figure else {}
    drawn |= hypotheses_figure(experiment.shown_in("hypotheses"))
    some, left_out = panels.shown(results, panels.named(experiment, "orders"))
    drawn |= orders_figure(some, made["orders"], left_out)
    return {name: one for name, one in seen.all_begun(drawn, SEEN).items() if one} | rare_figure(results, made["folds"])


SEEN = {"right": seen.highest_at_the_end, "lost": seen.at_the_end, "orders": seen.highest_at_the_end}

SHARES = {  # figure: column of folds.csv, what it is, caption
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
    name: str, results: Sequence[Result], table: "pd.DataFrame", of: tuple[str, str, str]
) -> Figure | None:
    """A share of realisations against time: a panel for each config, a line for each filter and swept value.

    of is a value of SHARES: the column of the table, the axis, the caption."""
    rows = tables.groups(table, "case", "filter")
    filters = panels.filters_of(results)
    every = panels.by_panel(results).items()
    drawn = [_share_panel(title, members, rows, of[:2], filters) for title, members in every]
    drawn = [panel for panel in drawn if panel.marks]
    if not drawn:
        return None
    return panels.in_columns(Figure(name, of[1], of[2], tuple(drawn)))


def rare_figure(results: Sequence[Result], table: "pd.DataFrame") -> dict[str, Figure]:
    """Instead of `right`, where all folds are right almost always: how often not at the last scan, over a swept key."""
    drawn: list[Panel] = []
    said: list[str] = []
    rows = tables.groups(table, "case", "filter")
    for (_, keys), members in sweeps.families(results).items():
        x, axis = sweeps.places(members[0], keys[0], [dict(one.swept)[keys[0]] for one in members])
        order = np.argsort(x)
        marks: list[Line] = []
        for f in members[0].axes.filters:
            if all((one.name, f) in rows for one in members):
                ends = [rows[members[i].name, f].iloc[-1] for i in order]
                look = panels.look(len(marks), 0, 1)
                marks.append(panels.line_of(x[order], ends, ("right", "right_lo", "right_hi"), panels.literal(f), look))
        if len(keys) > 1 or axis.ticks or not marks or min(float(mark.y.min()) for mark in marks) < 1 - panels.RARE:
            return {}
        losses, none = panels.ever_lost(marks)
        said += [none]
        drawn += [Panel(axis, panels.loss_axis(tr("P(a fold is wrong)"), losses), losses)] if losses else []
    if not drawn:
        return {}
    caption = tr(
        "Share of realisations in which a fold is wrong by the last scan, for the best hypothesis, of "
        "{realisations} each. Bands: 95 % intervals.",
        realisations=panels.realisations(results),
    ) + "".join(dict.fromkeys(said))
    figure = panels.in_columns(Figure("right", tr("P(a fold is wrong)"), caption, tuple(drawn)))
    return {"right": seen.begun(figure, seen.extremes(figure))}


def _share_panel(
    title: str, members: Sequence[Result], rows: Mapping, of: tuple[str, str], filters: Sequence[str]
) -> Panel:
    columns = ("t_s", of[0], f"{of[0]}_lo", f"{of[0]}_hi", *(["exact_right"] if of[0] == "right" else []))
    marks = panels.lines_of(members, {(*key, of[0]): own for key, own in rows.items()}, of[0], columns, filters)
    lines = [mark for mark in marks if isinstance(mark, Line)]
    rare = lines and max(float(line.y[-1]) for line in lines) < panels.RARE
    panel = Panel(
        panels.time_axis(), panels.loss_axis(of[1], lines) if rare else Axis(of[1], limits=(0, 1)), tuple(marks), title
    )
    return panels.keyed(panel, members, filters)


def hypotheses_figure(cases: Sequence[Case]) -> dict[str, Figure]:
    """The hypotheses of one realisation as a fan: a panel for each config, of the first filter that remembers."""
    drawn: list[Panel] = []
    shown: dict[str, Fan] = {}
    stems: list[str] = []
    for case in cases:
        remember = [i for i, one in enumerate(case.spec.filters) if (one.hypotheses or 1) > 1 and one.combine is None]
        if not remember or case.stem in stems:
            continue
        stems.append(case.stem)
        if len(drawn) < FANS:
            shown[case.stem] = fan(case, remember[-1], min(FAN_SCANS, case.spec.scans))
            drawn.append(_fan_panel(case, shown[case.stem], remember[-1]))
    if not drawn:
        return {}
    named = panels.distinct([(panel.title, config) for panel, config in zip(drawn, shown, strict=True)], drawn)
    drawn = [replace(panel, title=title) for title, panel in named.items()]
    counts = [len(velocities) for velocities, _, _ in next(iter(shown.values())).lists]
    caption = tr(
        "Fold sequences kept, {name}: {first} at first, {last} after {scans} scans. One realisation "
        "(number 7): after each scan a line for every sequence kept, with its velocity and acceleration, "
        "up to the next scan; brighter and broader lines are more probable. Dots: the true velocity.",
        **{"first": counts[0], "last": counts[-1], "scans": len(counts), "name": panels.plain(drawn[0].title)},
    ) + panels.left_out(stems, list(shown))
    columns = min(2, len(drawn))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    return {"hypotheses": Figure("hypotheses", tr("Pruning of hypotheses"), caption, tuple(drawn), columns, width, 70)}


FANS, FAN_SCANS, FAN_LINES = 4, 8, 40  # panels; scans of one; most lines of a scan


def _fan_panel(case: Case, of: Fan, number: int) -> Panel:
    marks: list = []
    dt = case.spec.radar.scan_period_s
    for t, (v, a, p) in zip(of.t_s, of.lists, strict=True):
        for velocity, acceleration, weight in zip(v[:FAN_LINES], a[:FAN_LINES], p[:FAN_LINES], strict=True):
            ink = weight / p[0]
            style = Style(0.15 + 0.85 * ink, 0, None, 0.25 + 1.75 * weight)
            marks.append(
                Line(np.array([t, t + 0.92 * dt]), velocity + acceleration * np.array([0, 0.92 * dt]), "", style)
            )
    marks.append(Line(of.t_s, of.truth, "", Style(1, None, 0, size_pt=3.5), name=tr("true velocity")))
    title = f"{panels.literal(case.spec.device or case.stem)}, {panels.literal(case.spec.filters[number].name)}"
    low, high = of.truth.min() - FAN_SPANS * case.spec.radar.spans_mps[0], of.truth.max()
    limits = (low, high + FAN_SPANS * case.spec.radar.spans_mps[0])
    x, y = replace(panels.time_axis(), limits=(None, None)), Axis(tr("radial velocity, m/s"), limits=limits)
    return Panel(x, y, tuple(marks), title, direct=False)


FAN_SPANS = 8  # spans shown to either side of the true velocities


def orders_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> dict[str, Figure]:
    """Mean weight of each order in the range against time: a panel for each filter that combines orders."""
    drawn = []
    for (case, name), own in tables.groups(table, "case", "filter").items():
        result = next((one for one in results if one.name == case), None)
        if result is None:
            continue
        marks = tuple(
            panels.line(rows, ("t_s", "weight"), tr("order {number}", number=order), panels.look(order, 0, 1))
            for order, rows in ((n, own[own["order"] == n]) for n in range(3))
            if len(rows)
        )
        words = panels.literal(name) if len(results) == 1 else f"{panels.label(result)}, {panels.literal(name)}"
        drawn.append(Panel(panels.time_axis(), Axis(tr("mean weight in the range")), marks, words))
    if not drawn:
        return {}
    caption = tr("Weights of the orders in the estimate of range, mean over realisations; shares may be negative.")
    titles = [panel.title for panel in drawn]
    caption += panels.left_out(titles, panels.spread_out(titles, panels.MOST_PANELS)) + left_out
    columns = min(3, len(drawn))
    drawn = panels.spread_out(drawn, panels.MOST_PANELS)
    shown = tuple(panels.in_legend(drawn)) if len(drawn) > 1 else tuple(drawn)
    return {
        "orders": Figure(
            "orders", tr("Weights of orders"), caption, shown, columns, PAGE_MM if columns > 1 else COLUMN_MM
        )
    }
