"""Figures of filters with known association: gain of each plot, gains, believed σ, missed plots, conversion."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report import figure_lines, key_labels, panel_layout, tables
from radarsim.report.drawing.model import PAGE_MM, Axis, Figure, Line, Mark, Panel, Reference, Style
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.components import COMPONENTS_BY_NAME
from radarsim.studies.sonar.tables import GAIN_COLUMNS

if TYPE_CHECKING:
    import pandas as pd


QUANTITY_TERMS = {  # of the position or motion, by its name in the table
    "smoothed": term("smoothed"),
    "extrapolated": term("extrapolated"),
    "acceleration": term("acceleration"),
}


def plots_figure(table: "pd.DataFrame") -> Figure | None:
    """σ per σ of a plot against the number of plots with the paper's formulas, and the gain of each further plot."""
    rows = table[(table["component"] == table["component"].iloc[0]) & (table["degree"] == 1) & (table["plots"] <= 20)]
    if rows.empty:
        return None
    sigma_lines: list[Mark] = [Reference(1.0, label=tr("one plot"))]
    gain_lines: list[Mark] = []
    for n, (quantity, quantity_rows) in enumerate(rows.groupby("quantity", sort=False)):
        sigma_lines.append(
            figure_lines.line_from_rows(
                quantity_rows,
                ("plots", "ratio", "ratio_lo", "ratio_hi", "formula"),
                tr(QUANTITY_TERMS[str(quantity)]),
                n,
            )
        )
        x, measured, formula = (
            quantity_rows[key].to_numpy(dtype=float)[1:]
            for key in ("plots", "reduction_percent", "formula_reduction_percent")
        )
        gain_lines.append(Line(x, measured, tr(QUANTITY_TERMS[str(quantity)]), Style(n, n, n), exact=formula))
    x_axis = panel_layout.count_axis(tr("plots n"), float(rows["plots"].max()))
    sigma_axis = Axis(tr("$\\sigma$ / $\\sigma$ of a plot"), limits=(0, None))
    has_loss = bool((rows["reduction_percent"] < 0).any())  # by chance: of few realisations
    gain_axis = Axis(tr("gained by the n-th plot, %"), limits=(None if has_loss else 0, None))
    figure_panels = (
        Panel(
            x_axis,
            sigma_axis,
            tuple(sigma_lines),
            key_title=tr("measured"),
            direct=False,
            crosses=tr("the paper's formula"),
        ),
        Panel(x_axis, gain_axis, tuple(gain_lines), direct=False, crosses=tr("the paper's formula")),
    )
    caption = tr(
        "Growing memory of degree 1. Left: σ of the position at the last plot (smoothed) and one scan ahead "
        "(extrapolated), relative to σ of a plot. Right: how much the n-th plot lowers it."
    )
    return Figure("plots", tr("Benefit of each further plot"), caption, figure_panels, 2, PAGE_MM)


def gains_figure(table: "pd.DataFrame") -> Figure:
    """A_n and B_n as measured and by the closed forms."""
    first = table.iloc[0]
    rows = tables.select_rows(table, filter=first["filter"], component=first["component"])
    marks = [
        figure_lines.line_from_rows(
            rows, ("plots", column, f"{column}_lo", f"{column}_hi", f"{column}_formula"), f"${letter}_n$", n
        )
        for n, (letter, column) in enumerate(GAIN_COLUMNS.items())
    ]
    caption = tr(
        "Weights of the residual in position and velocity of growing memory, from the measured "
        "errors (var r / σ² and T₀ cov(r, v) / σ²)."
    )
    if table["case"].nunique() > 1:
        caption += tr(" Case: {case}.", case=first["case"])
    x = panel_layout.count_axis(tr("plots n"), float(rows["plots"].max()))
    panel = Panel(x, Axis(tr("gain"), "log"), tuple(marks), crosses=tr("equation (14) of the paper"))
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
        tables.select_rows(table, k=last, component=component).set_index(["case", "filter"])
        for table in (curves, consistency)
    )
    sigma_lines: list[Mark] = []
    nees_lines: list[Mark] = [Reference(1.0)]
    for n, f in enumerate(cases[0].axes.filters):
        keys = [(r.name, f) for r in cases]
        rows = true_rows.loc[keys]
        true, claimed = rows["sigma"].to_numpy() / sigma, rows["believed_sigma"].to_numpy() / sigma
        bounds = (rows[key].to_numpy() / sigma for key in ("sigma_lo", "sigma_hi"))
        sigma_lines.append(Line(rho, true, f, Style(n, n, n), *bounds))
        if np.max(np.abs(claimed / true - 1)) > 0.05:
            sigma_lines.append(Line(rho, claimed, tr("{f}: own σ", f=f), Style(n, None, n)))
        rows = consistency_rows.loc[keys].assign(rho=rho)
        nees_lines.append(figure_lines.line_from_rows(rows, ("rho", "nees", "nees_lo", "nees_hi", "exact_nees"), f, n))
    caption = tr(
        "Left: RMS error of the {name} at plot {last} in σ of a plot, true (lines) and the filter's own (markers "
        "alone, where they differ by over 5 %). Right: normalised squared error per component, one (dotted) if "
        "consistent.",
        name=COMPONENTS_BY_NAME[component].words,
        last=last,
    )
    x = Axis(tr("correlation $\\rho$ of neighbouring errors"))
    y = Axis(tr("$\\sigma$ / $\\sigma$ of a plot"), limits=(0, 1.75))
    figure_panels = (
        Panel(x, y, tuple(sigma_lines), direct=False, legend="upper left"),
        Panel(x, Axis(tr("normalised squared error"), "log"), tuple(nees_lines), direct=False),
    )
    return Figure("believed", tr("Consistency of a filter"), caption, figure_panels, 2, PAGE_MM)


def missed_figure(results: Sequence[CaseResult[GivenPlotsAxes]], curves: "pd.DataFrame") -> Figure | None:
    """σ of the first coordinate against time: a panel for each filter, a line for each detection probability."""
    cases = [r for r in results if r.spec.frame == "polar"]
    if len({r.spec.sensor.detection_probability for r in cases}) < 2:
        return None
    component = COMPONENTS_BY_NAME[cases[0].axes.components[0][0]]
    groups = tables.group_by(curves[curves["component"] == component.name], "case", "filter")
    y = Axis(key_labels.sigma_axis_label(component.symbol, component.unit), limits=(0, None))
    figure_panels = []
    for f in cases[0].axes.filters:
        marks = []
        for n, result in enumerate(cases):
            if (result.name, f) in groups:
                probability = numeral(f"{result.spec.sensor.detection_probability:g}")
                style = Style(n / max(1, len(cases) - 1), n, n)
                marks.append(
                    figure_lines.line_from_rows(
                        groups[result.name, f], figure_lines.SIGMA, probability, style, f"$P_D$ = {probability}"
                    )
                )
        figure_panels.append(Panel(panel_layout.time_axis(), y, tuple(marks), f, key_title="$P_D$", direct=False))
    gap = cases[0].spec.sensor.missed_scans
    caption = tr(
        "RMS error of the {name} for several detection probabilities, one panel per filter, from {count:,} "
        "realisations; exact over all patterns of misses if these can be enumerated.",
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
    names = ("bias_m", "bias_m_lo", "bias_m_hi", "formula_m")
    for n, (frame, rows) in enumerate(table.groupby("frame", sort=False)):
        rows = rows.sort_values("across_m")
        rows = rows.assign(**{name: rows[name] / rows["sigma_range_m"] for name in names})
        label = tr("plain") if frame == "cartesian" else tr("unbiased")
        marks.append(figure_lines.line_from_rows(rows, ("across_m", *names), label, n))
    caption = tr(
        "Mean error of the converted plot along the line of sight, divided by σ of the range, versus range "
        "× σ of the bearing. Exact: (exp(−σ²/2) − 1) r, and zero."
    )
    x, y = Axis(tr("range × σ of the bearing, m"), limits=(0, None)), Axis(tr("bias / σ of the range"))
    return Figure(
        "conversion", tr("Bias of the conversion to x, y"), caption, (Panel(x, y, tuple(marks), direct=False),)
    )
