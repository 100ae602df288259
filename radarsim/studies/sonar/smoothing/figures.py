"""Figures of filters that are given their plots (P3), described: what plots buy, gains, believed against true, misses,
the conversion's bias.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Line, Panel, Reference, Style
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.figures import QUANTITIES

WIDE = 150.0


def figures(results: Sequence[CaseResult[GivenPlotsAxes]], made: Mapping) -> dict[str, Figure | None]:
    """The figures of these cases, beside those of all parts; None where they are not such that it can be drawn."""
    return {
        "plots": plots_figure(made.get("plots")),
        "smoothing_gains": gains_figure(made.get("smoothing_gains")),
        "believed": believed_figure(results, made["believed"], made["consistency"]),
        "missed": missed_figure(results, made["curves"]),
        "conversion": conversion_figure(made.get("conversion")),
    }


def plots_figure(table) -> Figure | None:
    """σ per plot's σ against the number of plots with the paper's formulas, and what each further plot buys."""
    if table is None:
        return None
    rows = table[(table["component"] == table["component"].iloc[0]) & (table["degree"] == 1) & (table["plots"] <= 20)]
    if rows.empty:
        return None
    accuracy, bought = [Reference(1.0, label="one plot")], []
    for n, (what, own_rows) in enumerate(rows.groupby("what", sort=False)):
        x = own_rows["plots"].to_numpy(dtype=float)
        lo, hi, formula = (own_rows[key].to_numpy(dtype=float) for key in ("ratio_lo", "ratio_hi", "formula"))
        accuracy.append(Line(x, own_rows["ratio"].to_numpy(), what, Style(n, n, n), lo, hi, formula))
        take = own_rows["bought_percent"].to_numpy()[1:], own_rows["formula_bought_percent"].to_numpy()[1:]
        bought.append(Line(x[1:], take[0], what, Style(n, n, n), exact=take[1]))
    x = panels.counts("plots n", float(rows["plots"].max()))
    caption = (
        "Left: σ of the position at the last plot (smoothed) and one scan ahead (extrapolated) in σ of a single plot, "
        "growing memory of degree 1. Crosses: the paper's formulas. Right: by how much the n-th plot lowers that σ."
    )
    return Figure(
        "plots",
        "What each further plot buys",
        caption,
        (
            Panel(
                x,
                Axis("$\\sigma$ / $\\sigma$ of a plot", limits=(0, None)),
                tuple(accuracy),
                key_title="measured",
                direct=False,
                crosses="the paper's formula",
            ),
            Panel(x, Axis("bought by the n-th plot, %", limits=(0, None)), tuple(bought), direct=False),
        ),
        2,
        WIDE,
    )


def gains_figure(table) -> Figure | None:
    """A_n and B_n, measured and by the closed forms."""
    if table is None:
        return None
    first = table.iloc[0]
    rows = table[(table["filter"] == first["filter"]) & (table["component"] == first["component"])]
    x = rows["plots"].to_numpy(dtype=float)
    marks = [
        Line(
            x,
            rows[key].to_numpy(),
            f"${key}_n$",
            Style(n, n, n),
            rows[f"{key}_lo"].to_numpy(),
            rows[f"{key}_hi"].to_numpy(),
            rows[f"{key}_formula"].to_numpy(),
        )
        for n, key in enumerate(("A", "B"))
    ]
    caption = (
        "Weights of the residual in position and velocity of growing memory, from the measured errors (var r / σ² and "
        "T₀ cov(r, v) / σ²). Crosses: the paper's (14). They go to zero: new plots count less and less."
    )
    if table["case"].nunique() > 1:
        caption += f" Case: {first['case']}."
    x = panels.counts("plots n", float(x.max()))
    panel = Panel(x, Axis("gain", "log"), tuple(marks), crosses="the paper's (14)")
    return Figure("smoothing_gains", "Gains of growing memory", caption, (panel,))


def believed_figure(results: Sequence[CaseResult[GivenPlotsAxes]], believed, consistency) -> Figure | None:
    """True and believed σ, and the normalised error, over the correlation of the errors."""
    cases = [r for r in results if isinstance(r.spec.sensor.error_correlation, float) and r.spec.frame == "polar"]
    cases.sort(key=lambda r: r.spec.sensor.error_correlation)
    if len({r.spec.sensor.error_correlation for r in cases}) < 3 or len(cases) > len({r.name for r in cases}):
        return None
    rho = np.array([r.spec.sensor.error_correlation for r in cases])
    sigma = cases[0].axes.sigma[0]
    last, component = int(cases[0].axes.k[-1]), cases[0].axes.components[0][0]
    at_end = {
        key: table[(table["k"] == last) & (table["component"] == component)].set_index(["case", "filter"])
        for key, table in (("believed", believed), ("consistency", consistency))
    }
    left, right = [], [Reference(1.0, label="consistent")]
    for n, f in enumerate(cases[0].axes.filters):
        rows = at_end["believed"].loc[[(r.name, f) for r in cases]]
        true = rows["sigma"].to_numpy() / sigma
        ends = ((rows[key] * rows["believed_sigma"]).to_numpy() / sigma for key in ("ratio_lo", "ratio_hi"))
        left.append(Line(rho, true, f, Style(n, n, n), *ends))
        claimed = rows["believed_sigma"].to_numpy() / sigma
        if np.max(np.abs(claimed / true - 1)) > 0.05:
            left.append(Line(rho, claimed, f"{f}: believed", Style(n, None, n)))
        rows = at_end["consistency"].loc[[(r.name, f) for r in cases]]
        values = [rows[key].to_numpy(dtype=float) for key in ("nees", "nees_lo", "nees_hi", "exact_nees")]
        right.append(Line(rho, values[0], f, Style(n, n, n), *values[1:3], values[3]))
    caption = (
        f"Left: σ of the {QUANTITIES[component].name} at plot {last} in σ of a plot, true (lines) and as the filter "
        "believes it (markers alone, where they differ by over 5 %). Right: normalised squared error per component, 1 "
        "for a consistent filter; crosses: by calculation."
    )
    x = Axis("correlation $\\rho$ of neighbouring errors")
    return Figure(
        "believed",
        "What a filter believes of itself",
        caption,
        (
            Panel(
                x,
                Axis("$\\sigma$ / $\\sigma$ of a plot", limits=(0, 1.75)),
                tuple(left),
                direct=False,
                legend="upper left",
            ),
            Panel(x, Axis("normalised squared error", "log"), tuple(right), direct=False),
        ),
        2,
        PAGE_MM,
    )


def missed_figure(results: Sequence[CaseResult[GivenPlotsAxes]], curves) -> Figure | None:
    """σ of the first coordinate over time: a panel for each filter, a line for each detection probability."""
    cases = [r for r in results if r.spec.frame == "polar"]
    if len({r.spec.sensor.detection_probability for r in cases}) < 2:
        return None
    component = cases[0].axes.components[0][0]
    groups = common.groups(curves[curves["component"] == component], "case", "filter")
    drawn = []
    for f in cases[0].axes.filters:
        marks = []
        for n, result in enumerate(cases):
            rows = groups.get((result.name, f))
            if rows is None:
                continue
            v = [rows[key].to_numpy(dtype=float) for key in ("t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")]
            words = f"{result.spec.sensor.detection_probability:g}"
            style = Style(n / max(1, len(cases) - 1), n, n)
            marks.append(Line(*v[:2], words, style, v[2], v[3], v[4], name=f"$P_D$ = {words}"))
        y = Axis(f"$\\sigma$ of {QUANTITIES[component].symbol}, {rows['unit'].iloc[0]}", limits=(0, None))
        drawn.append(Panel(Axis(panels.TIME, limits=(0, None)), y, tuple(marks), f, key_title="$P_D$", direct=False))
    gap = cases[0].spec.sensor.missed_scans
    caption = (
        f"σ of the {QUANTITIES[component].name} for several detection probabilities (legend), one panel a filter, of "
        f"{cases[0].count:,} realisations. Crosses: exact values, means over all patterns of misses where these can be "
        "enumerated." + (f" Scans {', '.join(map(str, gap))} never give a plot." if gap else "")
    )
    columns = min(3, len(drawn))
    return Figure("missed", "What missed plots cost", caption, tuple(drawn), columns, PAGE_MM, 54)


def conversion_figure(table) -> Figure | None:
    """Bias of the converted plot against range × bearing error, in σ of the range."""
    if table is None or len(table) < 3:
        return None
    marks = [Reference(-1.0, label="one σ of the range")]
    for n, (frame, rows) in enumerate(table.groupby("frame", sort=False)):
        rows = rows.sort_values("across_m")
        value, lo, hi, known = (
            rows[key].to_numpy() / rows["sigma_range_m"].to_numpy()
            for key in ("bias_m", "bias_lo", "bias_hi", "formula_m")
        )
        name = {"cartesian": "plain", "cartesian_unbiased": "unbiased"}[frame]
        marks.append(Line(rows["across_m"].to_numpy(), value, name, Style(n, n, n), lo, hi, known))
    caption = (
        "Mean error of the converted plot along the line of sight, in σ of the range, over range × σ of the bearing. "
        "Bands: 95 % intervals. Crosses: (exp(−σ²/2) − 1) r, and zero. The plain conversion pulls the target in."
    )
    x, y = Axis("range × σ of the bearing, m", limits=(0, None)), Axis("bias / σ of the range")
    return Figure("conversion", "Bias of the conversion to x, y", caption, (Panel(x, y, tuple(marks), direct=False),))
