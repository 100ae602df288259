"""P3's figures that all its parts have, described: σ of each component against time."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.studies.sonar.axes import SonarAxes

QUANTITIES = {
    "r": panels.Quantity("$r$", "range"),
    "vr": panels.Quantity("$v_r$", "radial velocity"),
    "ar": panels.Quantity("$a_r$", "radial acceleration"),
    "b": panels.Quantity("$\\beta$", "bearing"),
    "vb": panels.Quantity("$v_\\beta$", "bearing rate"),
    "ab": panels.Quantity("$a_\\beta$", "second rate of the bearing"),
    "x": panels.Quantity("$x$", "way north"),
    "vx": panels.Quantity("$v_x$", "velocity north"),
    "ax": panels.Quantity("$a_x$", "acceleration north"),
    "y": panels.Quantity("$y$", "way east"),
    "vy": panels.Quantity("$v_y$", "velocity east"),
    "ay": panels.Quantity("$a_y$", "acceleration east"),
    "d": panels.Quantity("$d$", "depth"),
    "vd": panels.Quantity("$v_d$", "rate of depth"),
    "ad": panels.Quantity("$a_d$", "second rate of depth"),
    "e": panels.Quantity("$\\varepsilon$", "elevation"),
    "ve": panels.Quantity("$v_\\varepsilon$", "rate of elevation"),
    "ae": panels.Quantity("$a_\\varepsilon$", "second rate of elevation"),
}
MOST_IN_PANEL = 5  # filters whose legend leaves room for the curves


def figures(results: Sequence[CaseResult[SonarAxes]], made: Mapping, experiment: Experiment) -> dict[str, Figure]:
    """sigma_<component> of every component that some case has."""
    curves = common.groups(made["curves"], "case", "filter", "component")
    drawn = {}
    for component, of in QUANTITIES.items():
        name = f"sigma_{component}"
        chosen, left_out = panels.shown(results, [case.name for case in experiment.shown_in(name)])
        if any(component in dict(result.axes.components) for result in chosen):
            drawn[name] = sigma_figure(name, chosen, curves, component, of, left_out)
    return {name: figure for name, figure in drawn.items() if figure}


def sigma_figure(
    name: str,
    results: Sequence[CaseResult[SonarAxes]],
    curves: Mapping,
    component: str,
    of: panels.Quantity,
    left_out: str,
) -> Figure | None:
    """σ(t) of one component: a panel for each case, a line for each filter."""
    drawn = []
    for result in results:
        marks = []
        for n, f in enumerate(result.axes.filters):
            rows = curves.get((result.name, f, component))
            if rows is None:
                continue
            unit = rows["unit"].iloc[0]
            v = {
                key: rows[key].to_numpy(dtype=float) for key in ("t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")
            }
            known = v["exact_sigma"] if np.isfinite(v["exact_sigma"]).any() else None
            marks.append(Line(v["t_s"], v["sigma"], f, Style(n, n, n), v["sigma_lo"], v["sigma_hi"], known))
        if marks:
            y = Axis(panels.with_unit(f"$\\sigma$ of {of.symbol}", unit), limits=(0, None))
            drawn.append(
                Panel(Axis(panels.TIME, limits=(0, None)), y, tuple(marks), panels.swept(result), direct=False)
            )
    if not drawn:
        return None
    caption = (
        f"Root-mean-square error of the {of.name} about the truth against time, of {results[0].count:,} realisations. "
        "Bands: 95 % intervals, where not seen narrower than the line. Crosses: exact values." + left_out
    )
    if len(results[0].axes.filters) > MOST_IN_PANEL:
        drawn = panels.in_legend(drawn)
    columns = min(2, len(drawn))
    return Figure(name, f"σ of the {of.name}", caption, tuple(drawn), columns, 95.0 if columns == 1 else PAGE_MM, 62)
