"""The study's figures: σ and gains between their brackets, and how often all folds are right."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Panel, Reference
from radarsim.studies.ambiguous_doppler.tables import Result

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = {
    "r": panels.Quantity("$r$", "range"),
    "Vr": panels.Quantity("$V_r$", "radial velocity"),
    "ar": panels.Quantity("$a_r$", "radial acceleration"),
}


def figures(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]", experiment: Experiment) -> dict[str, Figure]:
    """sigma_r … gain_ar, and `right`."""
    curves = common.groups(made["curves"], "case", "filter", "component")
    gains = common.groups(made["gains"], "case", "filter", "component")

    def chosen(name: str) -> list[str]:
        return [case.name for case in experiment.shown_in(name)]

    drawn = panels.per_component(results, curves, gains, QUANTITIES, chosen)
    some, left_out = panels.shown_families(results, chosen("right"))
    figure = right_figure(some, made["folds"], left_out) if some else None
    return drawn | ({"right": figure} if figure else {})


def right_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> Figure | None:
    """P(all folds right) against time: a panel for each config, a line for each filter and swept value."""
    rows = common.groups(table, "case", "filter")
    drawn = [_right_panel(members, rows) for members in panels.families(results).values()]
    drawn = [panel for panel in drawn if len(panel.marks) > 1]
    if not drawn:
        return None
    caption = (
        "Share of realisations in which all folds so far are right, of the best hypothesis. Bands: 95 % intervals. "
        "Crosses: exact, of the nearest fold where truth and filter agree."
    )
    columns = min(2, len(drawn))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    return Figure("right", "All folds right", caption + left_out, tuple(drawn), columns, width)


def _right_panel(members: Sequence[Result], rows: Mapping) -> Panel:
    marks: list = [Reference(1)]
    shown = [(result, f) for result in members for f in result.axes.filters if (result.name, f) in rows]
    names = list(dict.fromkeys(f for _, f in shown))
    for result, f in shown:
        own = rows[(result.name, f)]
        i = list(members).index(result)
        words = ", ".join(filter(None, (panels.literal(f) if len(names) > 1 else "", panels.swept(result))))
        x, y, lo, hi, exact = (own[name].to_numpy() for name in ("t_s", "right", "right_lo", "right_hi", "exact_right"))
        style = panels.look(names.index(f), i, len(members))
        marks.append(Line(x, y, words or panels.literal(f), style, lo, hi, exact if np.isfinite(exact).any() else None))
    y_axis = Axis("P(all folds right)", limits=(0, 1.05))
    return Panel(Axis(panels.TIME, limits=(0, None)), y_axis, tuple(marks), panels.device(members[0]))
