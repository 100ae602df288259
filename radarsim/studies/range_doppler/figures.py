"""P1's figures: 1a to 3b of the paper, steady error against settling, and what the filters believe of themselves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language import term
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.studies.range_doppler.tables import PERIODS, Result

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = {
    "r": panels.Quantity("$r$", term("range")),
    "Vr": panels.Quantity("$V_r$", term("radial velocity")),
    "ar": panels.Quantity("$a_r$", term("radial acceleration")),
}


def figures(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]", experiment: Experiment) -> dict[str, Figure]:
    """sigma_r … gain_ar (the paper's figures 1a … 3b), and `settling` where the manoeuvre variance is swept."""
    curves = common.groups(made["curves"], "case", "filter", "component")
    gains = common.groups(made["gains"], "case", "filter", "component")

    def chosen(name: str) -> list[str]:
        return [case.name for case in experiment.shown_in(name)]

    drawn = panels.per_component(results, curves, gains, QUANTITIES, chosen)
    some = [result for result in results if result.name in set(chosen("settling"))]
    figure = settling_figure(some, made["steady"])
    drawn |= {"settling": figure} if figure else {}
    some, left_out = panels.shown(panels.unswept(results), chosen("consistency"))
    return drawn | ({"consistency": consistency_figure(some, made["consistency"], left_out)} if some else {})


def consistency_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> Figure:
    """NEES per component against time: a panel for each filter, a line for each case."""
    rows = common.groups(table, "case", "filter")
    names = list(dict.fromkeys(name for result in results for name in result.axes.filters))
    drawn = tuple(_consistency_panel(results, rows, name) for name in names)
    caption = (
        "Mean of the normalised squared error eᵀP⁻¹e per estimated component, P the covariance that the filter "
        "believes; one (dotted) for a filter that is right about itself, more for an optimistic one, less for a "
        "pessimistic one."
    )
    columns = min(2, len(drawn))
    if len(results) > panels.MOST_AT_ENDS or any(len(panels.label(result)) > LONG for result in results):
        drawn = tuple(panels.in_legend(drawn))
        columns = min(3, len(drawn))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    return Figure("consistency", "What the filters believe of themselves", caption + left_out, drawn, columns, width)


LONG = 16  # letters of a label from which names do not fit beside half a page
WIDE = 100  # largest over least NEES from which its axis is logarithmic


def _consistency_panel(results: Sequence[Result], rows: dict[Any, Any], name: str) -> Panel:
    marks: list = [Reference(1)]
    for i, result in enumerate(results):
        if (result.name, name) in rows:
            own = rows[result.name, name]
            style = Style(i, i, i)
            marks.append(Line(own["t_s"].to_numpy(), own["nees"].to_numpy(), panels.label(result), style))
    values = np.concatenate([mark.y for mark in marks[1:]] or [np.ones(1)])
    wide = values.min() > 0 and values.max() > WIDE * values.min()
    words = "NEES per component\n(1 = consistent, below = pessimistic)"
    y = Axis(words, "log") if wide else Axis(words, limits=(0, None))
    return Panel(panels.time_axis(), y, tuple(marks), panels.literal(name))


def settling_figure(results: Sequence[Result], table: "pd.DataFrame") -> Figure | None:
    """Steady σ of the range against its settling time over D_M, with the ten-period line and the best D_M named."""
    rows = table[table["component"] == "r"]
    drawn: list[Panel] = []
    for members in panels.families(results).values():
        own = rows[rows["case"].isin([r.name for r in members])].drop_duplicates(["filter", "manoeuvre_variance"])
        if own["manoeuvre_variance"].nunique() > 1:
            drawn.append(_settling_panel(members[0], own))
    drawn = drawn[: panels.MOST]
    if not drawn:
        return None
    caption = (
        "Exact steady σ of the range against the settling time of the measured σ (within 5 % of the steady value, for "
        "good); grey lines join equal manoeuvre variances D_M, named in (m/s³)². Dotted: ten scan periods, the paper's "
        "limit; star: the least steady error under it. What does not settle within the run is named and left out."
    )
    columns = min(3, len(drawn))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    if len(drawn) % columns:  # a cell is free: the legend has it
        drawn = [replace(panel, legend="none") for panel in drawn] + [replace(drawn[0], marks=(), title="")]
    else:
        drawn[1:] = [replace(panel, legend="none") for panel in drawn[1:]]
    return Figure("settling", "Steady error against settling time", caption, tuple(drawn), columns, width)


def _settling_panel(result: Result, rows: "pd.DataFrame") -> Panel:
    """rows: of one radar and the range, one for each filter and manoeuvre variance."""
    settled = rows[np.isfinite(rows["settling_s"])]
    limit = PERIODS * result.axes.scan_period_s
    marks: list = [Reference(limit, "x")]
    for variance, same in settled.sort_values("steady_sigma").groupby("manoeuvre_variance"):
        t, sigma = same["settling_s"].to_numpy(), same["steady_sigma"].to_numpy()
        marks.append(Line(t, sigma, "", Style(7, 0, width_pt=0.5)))
        marks.append(Note(float(t[-1]), float(sigma[-1]), panels.number(float(variance), powers=True)))
    keys = []
    for n, name in enumerate(result.axes.filters):
        own = settled[settled["filter"] == name].sort_values("manoeuvre_variance")
        best, style = own[own["best"]], Style(n, n, n)
        words, star = panels.literal(name), Style(n, None, 7, size_pt=8)
        marks.append(Line(own["settling_s"].to_numpy(), own["steady_sigma"].to_numpy(), "", style, name=words))
        x, y = (best[key].to_numpy() for key in ("settling_s", "steady_sigma"))
        marks.append(Line(x, y, "", star, name=f"{words}: best $D_M$"))
        keys.append((panels.literal(name), style))
    longest = max([limit, *settled["settling_s"]])
    x = Axis("settling time of $\\sigma$ of $r$, s", limits=(-0.04 * longest, 1.15 * longest))
    keys += [("best $D_M$", Style(0, None, 7, size_pt=8)), (f"{PERIODS} scan periods", Style(7, 2, width_pt=0.7))]
    y, title = Axis("steady $\\sigma$ of $r$, m"), "at the points: $D_M$, (m/s³)²"
    remark = _not_settled(rows[~np.isfinite(rows["settling_s"])])
    return Panel(x, y, tuple(marks), panels.device(result), tuple(keys), title, direct=False, remark=remark)


def _not_settled(rows: "pd.DataFrame") -> str:
    """Words on the manoeuvre variances that do not settle within the run: a line for each."""
    found = [
        (panels.number(same["manoeuvre_variance"].iloc[0], powers=True), panels.literal(", ".join(same["filter"])))
        for _, same in rows.groupby("manoeuvre_variance")
    ]
    return "\n".join(f"{variance} ({names}): not settled" for variance, names in found)
