"""Figures that all parts of P3 have: σ of each component against time; and lines of figures, from rows of tables."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import term, tr
from radarsim.report import panels, seen, tables
from radarsim.report.drawing import Figure, Line, Panel
from radarsim.studies.sonar.world import SonarAxes

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = {
    "r": panels.Quantity("$r$", term("range")),
    "vr": panels.Quantity("$v_r$", term("radial velocity")),
    "ar": panels.Quantity("$a_r$", term("radial acceleration")),
    "b": panels.Quantity("$\\beta$", term("bearing")),
    "vb": panels.Quantity("$v_\\beta$", term("bearing rate")),
    "ab": panels.Quantity("$a_\\beta$", term("second rate of the bearing")),
    "x": panels.Quantity("$x$", term("distance north")),
    "vx": panels.Quantity("$v_x$", term("velocity north")),
    "ax": panels.Quantity("$a_x$", term("acceleration north")),
    "y": panels.Quantity("$y$", term("distance east")),
    "vy": panels.Quantity("$v_y$", term("velocity east")),
    "ay": panels.Quantity("$a_y$", term("acceleration east")),
    "d": panels.Quantity("$d$", term("depth")),
    "vd": panels.Quantity("$v_d$", term("rate of depth")),
    "ad": panels.Quantity("$a_d$", term("second rate of depth")),
    "e": panels.Quantity("$\\varepsilon$", term("elevation")),
    "ve": panels.Quantity("$v_\\varepsilon$", term("rate of elevation")),
    "ae": panels.Quantity("$a_\\varepsilon$", term("second rate of elevation")),
}


def figures(
    results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """sigma_<component> of every component that some case has."""
    curves = tables.groups(made["curves"], "case", "filter", "component")
    drawn: dict[str, Figure | None] = {}
    for component in QUANTITIES:
        name = f"sigma_{component}"
        having = [result for result in results if component in dict(result.axes.components)]
        chosen, left_out = panels.shown(having, panels.named(experiment, name))
        if chosen:
            drawn[name] = sigma_figure(name, chosen, curves, component, left_out)
    return {name: figure for name, figure in drawn.items() if figure}


def case_lines(
    result: CaseResult[SonarAxes], groups: "Mapping[Any, pd.DataFrame]", component: str, columns: Sequence[str]
) -> list[Line]:
    """A line for each filter of a case that has rows; groups are by case, filter and component."""
    places = enumerate((result.name, f, component) for f in result.axes.filters)
    return [panels.line(groups[place], columns, place[1], n) for n, place in places if place in groups]


def sigma_figure(
    name: str,
    results: Sequence[CaseResult[SonarAxes]],
    curves: "Mapping[Any, pd.DataFrame]",
    component: str,
    left_out: str,
) -> Figure | None:
    """σ(t) of one component: a panel for each case, a line for each filter."""
    quantity, drawn = QUANTITIES[component], []
    for result in results:
        factor, unit = panels.in_degrees(dict(result.axes.components).get(component, ""))
        marks = [panels.scaled(one, factor) for one in case_lines(result, curves, component, panels.SIGMA)]
        if marks:
            y = panels.fitting_axis(panels.with_unit(f"$\\sigma$ of {quantity.symbol}", unit), marks)
            drawn.append(Panel(panels.time_axis(), y, tuple(marks), panels.swept(result), direct=False))
    if not drawn:
        return None
    drawn, same = panels.differing(panels.one_scale(drawn))
    caption = (
        tr(
            "Root-mean-square error of the {name} about the truth against time, of {count:,} "
            "realisations. Bands: 95 % intervals, where not seen narrower than the line.",
            name=quantity.name,
            count=results[0].count,
        )
        + same
        + left_out
    )
    figure = panels.in_columns(Figure(name, tr("σ of the {name}", name=quantity.name), caption, tuple(drawn)))
    return seen.begun(figure, seen.at_the_end(figure))
