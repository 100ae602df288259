"""P1's figures: 1a to 3b of the paper, steady error against settling, and what the filters believe of themselves."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.translate import quote_name, term, tr
from radarsim.report import (
    caption_remarks,
    case_selection,
    consistency_figures,
    figure_lines,
    key_labels,
    panel_layout,
    tables,
    time_figures,
)
from radarsim.report.drawing.model import GREY, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.drawing.scales import Scale
from radarsim.report.math_text import plain_text
from radarsim.report.quantities import RADIAL
from radarsim.studies.range_doppler.tables import PERIODS, Result

if TYPE_CHECKING:
    import pandas as pd

DRAWN_FROM = {"settling": ("steady",)}


PAPER_CONFIG = "range_doppler"  # the config whose figures show what the paper's show
FIGURE_NUMBERS = {
    **{"sigma_r": "1a", "gain_r": "1b", "sigma_Vr": "2a", "gain_Vr": "2b"},
    **{"sigma_ar": "3a", "gain_ar": "3b"},
}


def figures(
    results: Sequence[Result], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """The figures sigma_r … gain_ar (1a … 3b of the paper), and `settling` where the manoeuvre variance is swept."""
    figures_by_name = time_figures.component_figures(results, tables_by_name, RADIAL, experiment)
    figures_by_name = {name: _with_wave_bands(figure, results) for name, figure in figures_by_name.items()}
    if experiment.stem == PAPER_CONFIG:
        figures_by_name |= {
            name: caption_remarks.with_figure_number(figures_by_name[name], FIGURE_NUMBERS[name])
            for name in figures_by_name
            if name in FIGURE_NUMBERS
        }
    settling_names = set(case_selection.cases_for_figure(experiment, "settling"))
    settling_cases = [result for result in results if result.name in settling_names]
    if figure := settling_figure(settling_cases, tables_by_name["steady"]):
        figures_by_name["settling"] = figure
    selected_cases, left_out = case_selection.select_cases_by_panel(
        case_selection.unswept_cases(results), case_selection.cases_for_figure(experiment, "consistency")
    )
    if selected_cases:
        figures_by_name["consistency"] = consistency_figure(selected_cases, tables_by_name["consistency"], left_out)
    return {name: drawing for name, drawing in figures_by_name.items() if drawing}


BANDS = {"metre": term("metre"), "decimetre": term("decimetre"), "centimetre": term("centimetre")}


def _with_wave_bands(figure: Figure, results: Sequence[Result]) -> Figure:
    """A figure whose lines are named by radars of several wave bands, with the band after each name."""
    named = [(key_labels.case_label(result), result.spec.radar.band) for result in results]
    bands = {label: BANDS[band] for label, band in named if band in BANDS}
    if len(set(bands.values())) < 2 or len(bands) < len(named):
        return figure

    def with_band(name: str) -> str:
        return f"{name} ({tr(bands[name])})" if name in bands else name

    panels = (
        replace(
            panel,
            marks=tuple(
                replace(mark, label=with_band(mark.label), name=with_band(mark.name))
                if isinstance(mark, Line)
                else mark
                for mark in panel.marks
            ),
        )
        for panel in figure.panels
    )
    return replace(figure, panels=tuple(panels))


def consistency_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> Figure:
    """NEES per component against time: a panel for each radar or swept value, of several radars for each filter."""
    rows = tables.group_by(table, "case", "filter")
    if len(results) == 1 or any(result.swept_values for result in results):
        nees = {(*key, "nees"): filter_rows for key, filter_rows in rows.items()}
        panels = consistency_figures.nees_panels(results, nees)
    else:
        names = list(dict.fromkeys(name for result in results for name in result.axes.filters))
        panels = [_consistency_panel(results, rows, name) for name in names]
    return consistency_figures.nees_figure(panels, left_out)


BEST_MARKER = 7  # marker of the best manoeuvre variance
AXIS_MARGIN_FACTOR = 1.5  # above and below all points of a logarithmic axis, as a factor
LETTER_WIDTH, LABEL_HEIGHT, TOUCHING_DISTANCE = (
    0.031,
    0.09,
    0.02,
)  # of a label, as shares of a panel; how near points share one
MAX_NAMED_CASES = 2  # cases that are named at the ends of lines in half a page


def _consistency_panel(results: Sequence[Result], rows: dict[Any, Any], name: str) -> Panel:
    marks: list = [Reference(1)]
    for i, result in enumerate(results):
        if (result.name, name) in rows:
            marks.append(
                figure_lines.line_from_rows(rows[result.name, name], ("t_s", "nees"), key_labels.case_label(result), i)
            )
    y, title = panel_layout.fitting_axis(tr(consistency_figures.NEES), marks), key_labels.escape_dollars(name)
    return Panel(panel_layout.time_axis(), y, tuple(marks), title, direct=len(results) <= MAX_NAMED_CASES)


def settling_figure(results: Sequence[Result], table: "pd.DataFrame") -> Figure | None:
    """Steady σ of the range against its settling time over D_M, with the ten-period line and the best D_M named."""
    rows = table[table["component"] == "r"]
    panels: list[Panel] = []
    steady = rows[np.isfinite(rows["settling_s"])]["steady_sigma"]
    sigma_limits = float(steady.min()) / AXIS_MARGIN_FACTOR, float(steady.max()) * AXIS_MARGIN_FACTOR
    for title, members in case_selection.group_by_panel(results, np.inf).items():
        radar_rows = rows[rows["case"].isin([r.name for r in members])].drop_duplicates(
            ["filter", "manoeuvre_variance"]
        )
        if radar_rows["manoeuvre_variance"].nunique() > 1:
            panels.append(_settling_panel(title, members[0], radar_rows, sigma_limits))
    titles = [panel.title for panel in panels]
    panels = case_selection.pick_evenly(panels, case_selection.MAX_PANELS)
    if not panels:
        return None
    caption = tr(
        "Exact steady RMS error of the range versus the time to settle within 5 % of it. Grey lines join equal "
        "manoeuvre variances. Star: the least that settles within ten scan periods (dotted)."
    )
    if names := _unsettled_filters(panels):
        caption += " " + tr("Without one: {names}.", names=caption_remarks.join_few_names(map(quote_name, names)))
    caption += case_selection.left_out_remark(titles, [panel.title for panel in panels])
    return panel_layout.arrange_columns(
        Figure("settling", tr("Steady error versus settling time"), caption, tuple(panels))
    )


def _unsettled_filters(panels: Sequence[Panel]) -> list[str]:
    """The filters of each panel that nowhere settle within the paper's limit: those without a star."""
    return [
        plain_text(", ".join(filter(None, (panel.title, star.name.partition(":")[0]))))
        for panel in panels
        for star in panel.marks
        if isinstance(star, Line) and star.style.marker == BEST_MARKER and not len(star.y)
    ]


def _settling_panel(title: str, result: Result, rows: "pd.DataFrame", sigma_limits: tuple[float, float]) -> Panel:
    """Steady σ against settling time for one radar.

    rows: σ of the range, one row for each filter and manoeuvre variance; sigma_limits: limits of the axis of y."""
    settled = rows[np.isfinite(rows["settling_s"])]
    limit = PERIODS * result.axes.scan_period_s
    longest = max([limit, *settled["settling_s"]])
    time_limits = -0.04 * longest, 1.15 * longest
    marks: list = [Reference(limit, "x")]
    points: list[tuple[float, float, str]] = []
    for variance, variance_rows in settled.sort_values("steady_sigma").groupby("manoeuvre_variance"):
        t, sigma = variance_rows["settling_s"].to_numpy(), variance_rows["steady_sigma"].to_numpy()
        marks.append(Line(t, sigma, "", Style(GREY, 0, width_pt=0.5)))
        points.append((float(t[-1]), float(sigma[-1]), key_labels.format_value(float(variance), powers=True)))
    marks += _labels(points, limit, Scale(False, *time_limits, 0.0, 1.0), Scale(True, *sigma_limits, 0.0, 1.0))
    keys = []
    for n, name in enumerate(result.axes.filters):
        filter_rows = settled[settled["filter"] == name].sort_values("manoeuvre_variance")
        best, style = filter_rows[filter_rows["best"]], Style(n, n, n)
        label, star = key_labels.escape_dollars(name), Style(n, None, BEST_MARKER, size_pt=8)
        marks.append(
            Line(filter_rows["settling_s"].to_numpy(), filter_rows["steady_sigma"].to_numpy(), "", style, name=label)
        )
        best_point = best["settling_s"].to_numpy(), best["steady_sigma"].to_numpy()
        marks.append(Line(*best_point, "", star, name=tr("{words}: best $D_M$", words=label)))
        keys.append((key_labels.escape_dollars(name), style))
    keys += [
        (tr("best $D_M$"), Style(0, None, BEST_MARKER, size_pt=8)),
        (tr("{periods} scan periods", periods=PERIODS), Style(GREY, 2, width_pt=0.7)),
    ]
    x = Axis(tr("settling time of $\\sigma$ of $r$, s"), limits=time_limits)
    y, key_title = Axis(tr("steady $\\sigma$ of $r$, m"), "log", sigma_limits), tr("at the points: $D_M$, (m/s³)²")
    remark = _not_settled(rows[~np.isfinite(rows["settling_s"])])
    return Panel(x, y, tuple(marks), title, tuple(keys), key_title, direct=False, remark=remark)


def _labels(points: Sequence[tuple[float, float, str]], limit: float, x: Scale, y: Scale) -> list[Note]:
    """Labels of points (x, y, text), to the right or left so that few meet another label, a curve or the limit.

    Points that nearly coincide share a label."""
    joined: list[tuple[float, float, str]] = []
    for t, sigma, label in sorted(points):
        if (
            joined
            and math.dist(*((x.position(u), y.position(v)) for u, v, *_ in ((t, sigma), joined[-1])))
            < TOUCHING_DISTANCE
        ):
            joined[-1] = (*joined[-1][:2], f"{joined[-1][2]}, {label}")
        else:
            joined.append((t, sigma, label))
    line = (float(x.position(limit)),) * 2 + (0.0, 1.0)  # left, right, lower and upper edge, as shares of the panel
    layouts: list[tuple[float, list[Note], tuple[float, ...]]] = [(0.0, [], (-1.0,) * 4)]  # the best, by the last label
    previous_point = 0.0, 0.0
    for t, sigma, label in joined:
        u, v, width = float(x.position(t)), float(y.position(sigma)), LETTER_WIDTH * len(label)
        # A curve that falls steeply from the left is in the way of a label at the left.
        is_steep = (previous_point[1] - v) * width > TOUCHING_DISTANCE * (u - previous_point[0])
        placements = (
            ("ne", (u, u + width, v, v + LABEL_HEIGHT), 0.0),
            ("nw", (u - width, u, v, v + LABEL_HEIGHT), is_steep + 0.1 + 9 * (u < width)),
        )
        layouts = [
            min(
                (
                    (
                        cost + penalty + _overlap(box, line) / 2 + _overlap(box, last),
                        [*notes, Note(t, sigma, label, place)],
                        box,
                    )
                    for cost, notes, last in layouts
                ),
                key=itemgetter(0),
            )
            for place, box, penalty in placements
        ]
        previous_point = u, v
    return min(layouts, key=itemgetter(0))[1]


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Whether two boxes overlap."""
    return a[0] <= b[1] and b[0] <= a[1] and a[2] <= b[3] and b[2] <= a[3]


def _not_settled(rows: "pd.DataFrame") -> str:
    """A remark on the manoeuvre variances that do not settle within the run, a line for each."""
    labels = [
        (
            key_labels.format_value(variance_rows["manoeuvre_variance"].iloc[0], powers=True),
            key_labels.escape_dollars(", ".join(variance_rows["filter"])),
        )
        for _, variance_rows in rows.groupby("manoeuvre_variance")
    ]
    return "\n".join(
        tr("{variance} ({names}): not settled", variance=variance, names=names) for variance, names in labels
    )
