"""P3's figures: σ of each component against time, lines from rows of tables; and the figures of smoothing.

Of filters that know their plots: gain of each plot, gains, believed and true σ, misses, conversion."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import numeral, term, tr
from radarsim.report import panels, tables
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Line, Mark, Panel, Reference, Style
from radarsim.report.quantities import Component
from radarsim.studies.sonar.world import GivenPlotsAxes, SonarAxes

if TYPE_CHECKING:
    import pandas as pd

COMPONENTS = (
    Component("r", "m", "$r$", term("range")),
    Component("vr", "m/s", "$v_r$", term("radial velocity")),
    Component("ar", "m/s2", "$a_r$", term("radial acceleration")),
    Component("b", "rad", "$\\beta$", term("bearing")),
    Component("vb", "rad/s", "$v_\\beta$", term("bearing rate")),
    Component("ab", "rad/s2", "$a_\\beta$", term("second rate of the bearing")),
    Component("x", "m", "$x$", term("distance north")),
    Component("vx", "m/s", "$v_x$", term("velocity north")),
    Component("ax", "m/s2", "$a_x$", term("acceleration north")),
    Component("y", "m", "$y$", term("distance east")),
    Component("vy", "m/s", "$v_y$", term("velocity east")),
    Component("ay", "m/s2", "$a_y$", term("acceleration east")),
    Component("d", "m", "$d$", term("depth")),
    Component("vd", "m/s", "$v_d$", term("rate of depth")),
    Component("ad", "m/s2", "$a_d$", term("second rate of depth")),
    Component("e", "rad", "$\\varepsilon$", term("elevation")),
    Component("ve", "rad/s", "$v_\\varepsilon$", term("rate of elevation")),
    Component("ae", "rad/s2", "$a_\\varepsilon$", term("second rate of elevation")),
)
BY_NAME = {component.name: component for component in COMPONENTS}


QUANTITY_TERMS = {  # of the position or motion, by its name in the table
    "smoothed": term("smoothed"),
    "extrapolated": term("extrapolated"),
    "acceleration": term("acceleration"),
}
DRAWN_FROM = {"missed": ("curves",), "believed": ("curves", "consistency")}


def figures(
    results: Sequence[CaseResult[SonarAxes]], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure | None]:
    """sigma_<component> of every component that some case has; and the figures of filters that know their plots."""
    curves = tables.groups(tables_by_name["curves"], "case", "filter", "component")
    figures_by_name: dict[str, Figure | None] = {}
    for component in COMPONENTS:
        name = f"sigma_{component.name}"
        results_with_component = [result for result in results if component.name in dict(result.axes.components)]
        chosen, left_out = panels.shown(results_with_component, panels.named(experiment, name))
        if chosen:
            figure = sigma_figure(name, chosen, curves, component, left_out)
            if figure and len(results) == 1:
                figure = panels.floored(
                    figure, tables_by_name["curves"], component.name, panels.in_degrees(component.unit)[0]
                )
            figures_by_name[name] = figure
    given_plots_results: Any = [result for result in results if isinstance(result.axes, GivenPlotsAxes)]
    of_tables = {"plots": plots_figure, "smoothing_gains": gains_figure, "conversion": conversion_figure}
    smoothing_figures = {name: draw(tables_by_name[name]) for name, draw in of_tables.items() if name in tables_by_name}
    smoothing_figures["believed"] = believed_figure(
        given_plots_results, tables_by_name["curves"], tables_by_name["consistency"]
    )
    smoothing_figures["missed"] = missed_figure(given_plots_results, tables_by_name["curves"])
    return figures_by_name | smoothing_figures


def case_lines(
    result: CaseResult[SonarAxes], groups: "Mapping[Any, pd.DataFrame]", component: str, columns: Sequence[str]
) -> list[Line]:
    """A line for each filter of a case that has rows; groups are by case, filter and component."""
    keys = enumerate((result.name, f, component) for f in result.axes.filters)
    return [panels.line(groups[key], columns, key[1], n) for n, key in keys if key in groups]


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
    factor, unit = panels.in_degrees(component.unit)
    shared = panels.shared_keys(results)
    for result in results:
        marks = [panels.scaled(line, factor) for line in case_lines(result, curves, component.name, panels.SIGMA)]
        if marks:
            y = panels.fitting_axis(panels.sigma_of(component.symbol, unit), marks)
            marks_of_panel: tuple[Mark, ...] = (*manoeuvre_lines(result), *marks)
            title = panels.swept(result, without=shared)
            figure_panels.append(Panel(panels.time_axis(), y, marks_of_panel, title, direct=False))
    if not figure_panels:
        return None
    caption = (
        tr(
            "Root-mean-square error of the {name} about the truth against time, of {count:,} realisations. "
            "Bands: 95 % intervals; a band that is not visible is narrower than the line.",
            name=component.words,
            count=results[0].count,
        )
        + (" " + tr("Dotted: beginning and end of the manoeuvre.") if any(map(manoeuvre_lines, results)) else "")
        + left_out
    )
    if shared:
        same = panels.swept(results[0], without={key for key, _ in results[0].swept} - shared)
        caption += " " + tr("All panels: {values}.", values=panels.plain(same))
    figure = panels.in_columns(Figure(name, tr("σ of the {name}", name=component.words), caption, tuple(figure_panels)))
    return figure


# ---- smoothing -----------------------------------------------------------------------------------------------------
def plots_figure(table: "pd.DataFrame") -> Figure | None:
    """σ per σ of a plot against the number of plots with the paper's formulas, and the gain of each further plot."""
    rows = table[(table["component"] == table["component"].iloc[0]) & (table["degree"] == 1) & (table["plots"] <= 20)]
    if rows.empty:
        return None
    accuracy: list[Mark] = [Reference(1.0, label=tr("one plot"))]
    bought: list[Mark] = []
    for n, (quantity, quantity_rows) in enumerate(rows.groupby("what", sort=False)):
        accuracy.append(
            panels.line(
                quantity_rows,
                ("plots", "ratio", "ratio_lo", "ratio_hi", "formula"),
                tr(QUANTITY_TERMS[str(quantity)]),
                n,
            )
        )
        x, measured, formula = (
            quantity_rows[key].to_numpy(dtype=float)[1:]
            for key in ("plots", "bought_percent", "formula_bought_percent")
        )
        bought.append(Line(x, measured, tr(QUANTITY_TERMS[str(quantity)]), Style(n, n, n), exact=formula))
    x_axis = panels.counts(tr("plots n"), float(rows["plots"].max()))
    left = Axis(tr("$\\sigma$ / $\\sigma$ of a plot"), limits=(0, None))
    has_loss = bool((rows["bought_percent"] < 0).any())  # by chance: of few realisations
    right = Axis(tr("gained by the n-th plot, %"), limits=(None if has_loss else 0, None))
    figure_panels = (
        Panel(x_axis, left, tuple(accuracy), key_title=tr("measured"), direct=False, crosses=tr("the paper's formula")),
        Panel(x_axis, right, tuple(bought), direct=False, crosses=tr("the paper's formula")),
    )
    caption = tr(
        "Left: σ of the position at the last plot (smoothed) and one scan ahead (extrapolated) in σ "
        "of a single plot, growing memory of degree 1. Right: by how "
        "much the n-th plot lowers that σ."
    )
    return Figure("plots", tr("Benefit of each further plot"), caption, figure_panels, 2, PAGE_MM)


def gains_figure(table: "pd.DataFrame") -> Figure:
    """A_n and B_n as measured and by the closed forms."""
    first = table.iloc[0]
    rows = tables.where(table, filter=first["filter"], component=first["component"])
    marks = [
        panels.line(rows, ("plots", key, f"{key}_lo", f"{key}_hi", f"{key}_formula"), f"${key}_n$", n)
        for n, key in enumerate(("A", "B"))
    ]
    caption = tr(
        "Weights of the residual in position and velocity of growing memory, from the measured "
        "errors (var r / σ² and T₀ cov(r, v) / σ²). They go to zero: new "
        "plots count less and less."
    )
    if table["case"].nunique() > 1:
        caption += tr(" Case: {case}.", case=first["case"])
    x = panels.counts(tr("plots n"), float(rows["plots"].max()))
    panel = Panel(x, Axis(tr("gain"), "log"), tuple(marks), crosses=tr("the paper's (14)"))
    return Figure("smoothing_gains", tr("Gains of growing memory"), caption, (panel,))


def believed_figure(
    results: Sequence[CaseResult[GivenPlotsAxes]], curves: "pd.DataFrame", consistency: "pd.DataFrame"
) -> Figure | None:
    """True and believed σ, and the normalised error, against the correlation of the errors."""
    cases = [r for r in results if isinstance(r.spec.sensor.error_correlation, float) and r.spec.frame == "polar"]
    cases.sort(key=lambda r: r.spec.sensor.error_correlation)
    if len({r.spec.sensor.error_correlation for r in cases}) < 3 or len(cases) > len({r.name for r in cases}):
        return None
    rho = np.array([r.spec.sensor.error_correlation for r in cases])
    sigma = cases[0].axes.sigma[0]
    last, component = int(cases[0].axes.k[-1]), cases[0].axes.components[0][0]
    true_rows, consistency_rows = (
        tables.where(table, k=last, component=component).set_index(["case", "filter"])
        for table in (curves, consistency)
    )
    left: list[Mark] = []
    right: list[Mark] = [Reference(1.0, label=tr("consistent"))]
    for n, f in enumerate(cases[0].axes.filters):
        keys = [(r.name, f) for r in cases]
        rows = true_rows.loc[keys]
        true, claimed = rows["sigma"].to_numpy() / sigma, rows["believed_sigma"].to_numpy() / sigma
        bounds = (rows[key].to_numpy() / sigma for key in ("sigma_lo", "sigma_hi"))
        left.append(Line(rho, true, f, Style(n, n, n), *bounds))
        if np.max(np.abs(claimed / true - 1)) > 0.05:
            left.append(Line(rho, claimed, tr("{f}: own σ", f=f), Style(n, None, n)))
        rows = consistency_rows.loc[keys].assign(rho=rho)
        right.append(panels.line(rows, ("rho", "nees", "nees_lo", "nees_hi", "exact_nees"), f, n))
    caption = tr(
        "Left: σ of the {name} at plot {last} in σ of a plot, true (lines) and the filter's own (markers "
        "alone, where they differ by over 5 %). Right: normalised squared error per component, 1 for a "
        "consistent filter.",
        name=BY_NAME[component].words,
        last=last,
    )
    x = Axis(tr("correlation $\\rho$ of neighbouring errors"))
    y = Axis(tr("$\\sigma$ / $\\sigma$ of a plot"), limits=(0, 1.75))
    figure_panels = (
        Panel(x, y, tuple(left), direct=False, legend="upper left"),
        Panel(x, Axis(tr("normalised squared error"), "log"), tuple(right), direct=False),
    )
    return Figure("believed", tr("Consistency of a filter"), caption, figure_panels, 2, PAGE_MM)


def missed_figure(results: Sequence[CaseResult[GivenPlotsAxes]], curves: "pd.DataFrame") -> Figure | None:
    """σ of the first coordinate against time: a panel for each filter, a line for each detection probability."""
    cases = [r for r in results if r.spec.frame == "polar"]
    if len({r.spec.sensor.detection_probability for r in cases}) < 2:
        return None
    component = BY_NAME[cases[0].axes.components[0][0]]
    groups = tables.groups(curves[curves["component"] == component.name], "case", "filter")
    y = Axis(panels.sigma_of(component.symbol, component.unit), limits=(0, None))
    figure_panels = []
    for f in cases[0].axes.filters:
        marks = []
        for n, result in enumerate(cases):
            if (result.name, f) in groups:
                probability = numeral(f"{result.spec.sensor.detection_probability:g}")
                style = Style(n / max(1, len(cases) - 1), n, n)
                marks.append(
                    panels.line(groups[result.name, f], panels.SIGMA, probability, style, f"$P_D$ = {probability}")
                )
        figure_panels.append(Panel(panels.time_axis(), y, tuple(marks), f, key_title="$P_D$", direct=False))
    gap = cases[0].spec.sensor.missed_scans
    caption = tr(
        "σ of the {name} for several detection probabilities (legend), one panel per filter, of "
        "{count:,} realisations. Exact values are means over all patterns of misses, where these can be "
        "enumerated.",
        name=component.words,
        count=cases[0].count,
    ) + (tr(" Scans {scans} never give a plot.", scans=", ".join(map(str, gap))) if gap else "")
    columns = min(3, len(figure_panels))
    return Figure("missed", tr("What missed plots cost"), caption, tuple(figure_panels), columns, PAGE_MM, 54)


def conversion_figure(table: "pd.DataFrame") -> Figure | None:
    """Bias of the converted plot against range × bearing error, in σ of the range; none of a single such product."""
    if table["across_m"].round(6).nunique() < 2:
        return None
    marks: list[Mark] = [Reference(-1.0, label=tr("one σ of the range"))]
    names = ("bias_m", "bias_lo", "bias_hi", "formula_m")
    for n, (frame, rows) in enumerate(table.groupby("frame", sort=False)):
        rows = rows.sort_values("across_m")
        rows = rows.assign(**{name: rows[name] / rows["sigma_range_m"] for name in names})
        label = tr("plain") if frame == "cartesian" else tr("unbiased")
        marks.append(panels.line(rows, ("across_m", *names), label, n))
    caption = tr(
        "Mean error of the converted plot along the line of sight, in σ of the range, over range × σ "
        "of the bearing. Bands: 95 % intervals. Exact: (exp(−σ²/2) − 1) r, and zero. The plain "
        "conversion pulls the target in."
    )
    x, y = Axis(tr("range × σ of the bearing, m"), limits=(0, None)), Axis(tr("bias / σ of the range"))
    return Figure(
        "conversion", tr("Bias of the conversion to x, y"), caption, (Panel(x, y, tuple(marks), direct=False),)
    )
