"""P3's figures on manoeuvres: ROC, detection by strength, delay, filters during the manoeuvre; uses of a track."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report import case_selection, figure_lines, key_labels, panel_layout, row_panels, tables
from radarsim.report.drawing.model import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Panel, Reference, Style
from radarsim.studies.sonar.manoeuvre import detection_laws
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from radarsim.studies.sonar.sigma_figure import case_lines, manoeuvre_lines

if TYPE_CHECKING:
    import pandas as pd

USUAL_FALSE_ALARM_RATE = 0.01  # false alarms per test at which detectors are compared, or the nearest rate to it
MAX_PANELS = 4
SYMBOLS = {
    **{"course": term("course"), "speed": term("speed"), "x_ahead": term("$x$ ahead"), "y_ahead": term("$y$ ahead")},
    **{"cpa": term("CPA"), "t_cpa": term("$t$ to CPA")},
}
RATIOS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)  # ticks of a measured over a believed σ
STRENGTHS = ("acceleration_mps2", "rate_radps")  # keys that say how strong a manoeuvre is
Results = Sequence[CaseResult[ManoeuvreAxes]]
TABLES_OF_FIGURES = {"roc": ("detections",), "detection": ("detections",), "delay": ("delays",)}


def figures(results: Results, tables_by_name: "Mapping[str, pd.DataFrame]") -> dict[str, Figure | None]:
    """The figures of cases with detectors, filters that respond to manoeuvres, or uses."""
    results_with_detectors = [result for result in results if result.spec.detectors and "detections" in tables_by_name]
    results_with_manoeuvre = [result for result in results_with_detectors if result.axes.manoeuvre_s]
    responding = [result for result in results if "modes" in result.sums]
    figures_by_name: dict[str, Figure | None] = {}
    if results_with_manoeuvre:
        chosen, sentence = spread_cases(results_with_manoeuvre)
        figures_by_name["detection"] = detection_figure(results_with_detectors, tables_by_name["detections"])
        figures_by_name["roc"] = _with_sentence(roc_figure(chosen, tables_by_name["detections"]), sentence)
        figures_by_name["delay"] = _with_sentence(delay_figure(chosen, tables_by_name["delays"]), sentence)
    if responding:
        chosen, sentence = spread_cases(responding)
        figures_by_name["modes"] = _with_sentence(modes_figure(chosen, tables_by_name["modes"]), sentence)
    if "uses" in tables_by_name:
        figures_by_name["uses"] = uses_figure(
            [result for result in results if "uses" in result.sums], tables_by_name["uses"]
        )
    return figures_by_name


def spread_cases(results: Results) -> tuple[list[CaseResult[ManoeuvreAxes]], str]:
    """Four of the cases at most, evenly spaced from the first to the last, and words on the others."""
    chosen = case_selection.pick_evenly(results, MAX_PANELS)
    return chosen, case_selection.cases_left_out_remark(results, chosen)


def _with_sentence(figure: Figure | None, sentence: str) -> Figure | None:
    """The figure with a further sentence in its caption."""
    return replace(figure, caption=figure.caption + sentence) if figure else None


def first_component(rows: "pd.DataFrame", detector: str) -> "pd.DataFrame":
    """The rows of a detector in the first coordinate."""
    rows = rows[rows["filter"] == detector]
    return rows[rows["component"] == rows["component"].iloc[0]]


def usual_rows(rows: "pd.DataFrame", detector: str) -> "pd.DataFrame":
    """The rows of a detector, first coordinate, at the threshold whose false alarm rate is nearest the usual one."""
    rows = first_component(rows, detector)
    distance = (np.log(rows["false_alarm_probability"]) - np.log(USUAL_FALSE_ALARM_RATE)).abs()
    return rows[distance <= distance.min() + 1e-9]


def usual_detectors(result: CaseResult[ManoeuvreAxes]) -> list[str]:
    """The detectors that test at every scan and whose false alarm rate is about the usual one."""
    names = []
    for detector, limits in zip(result.spec.detectors, result.axes.thresholds, strict=True):
        rates = detection_laws.false_alarm(limits[0])
        if detector.test_every == 1 and np.min(np.abs(np.log(rates / USUAL_FALSE_ALARM_RATE))) < 0.1:
            names.append(detector.name)
    return names


def last_test_of_phase(rows: "pd.DataFrame", phase: str) -> "pd.DataFrame":
    """The rows of the last test of a phase."""
    rows = rows[rows["phase"] == phase]
    return rows[rows["k"] == rows["k"].max()]


def roc_figure(results: Results, detections: "pd.DataFrame") -> Figure | None:
    """Detection probability at the manoeuvre's last scan against that of a false alarm at the last scan before it."""
    figure_panels: list[Panel] = []
    for result in results:
        rows, marks = detections[detections["case"] == result.name], []
        for n, name in enumerate(usual_detectors(result)):
            steady, manoeuvring = (
                last_test_of_phase(first_component(rows, name), phase).sort_values("threshold_k")
                for phase in ("steady", "manoeuvre")
            )
            if not len(steady) or not len(manoeuvring):
                continue
            shift = manoeuvring["shift"].iloc[0]
            if np.isfinite(shift):
                share = np.geomspace(3e-4, 0.5, 60)
                marks.append(
                    Line(share, detection_laws.detection(detection_laws.threshold(share), shift), name, Style(n, n))
                )
            points = manoeuvring.assign(false_alarms=steady["probability"].to_numpy())
            label = "" if np.isfinite(shift) else name
            marks.append(
                figure_lines.line_from_rows(
                    points,
                    ("false_alarms", "probability", "probability_lo", "probability_hi"),
                    label,
                    Style(n, None, n),
                )
            )
        if marks:
            x = Axis(tr("false alarms a test"), "log", limits=(3e-4, 0.5))
            y = Axis(tr("detection probability"), limits=(0, 1))
            figure_panels.append(Panel(x, y, tuple(marks), _swept_values(result), direct=False))
    caption = tr(
        "Detectors of manoeuvres in the range: alarm probability at the last scan of the manoeuvre versus that at "
        "the last scan before it. Lines: exact; markers: measured, from {count:,} realisations.",
        count=results[0].count,
    )
    return _figure_of_panels("roc", tr("Detections and false alarms"), caption, figure_panels)


def detection_figure(results: Results, detections: "pd.DataFrame") -> Figure | None:
    """Probability of detection against the manoeuvre's strength, a line for each detector."""
    key = next((key for key, value in results[0].swept_values if key.rpartition(".")[2] in STRENGTHS), None)
    if key is None:
        return None
    families: dict[tuple, list[CaseResult[ManoeuvreAxes]]] = {}
    for result in results:
        if key in dict(result.swept_values):
            families.setdefault(tuple(pair for pair in result.swept_values if pair[0] != key), []).append(result)
    figure_panels = []
    for other_keys, members in families.items():
        members.sort(key=lambda r: dict(r.swept_values)[key])
        strength = key_labels.key_axis_factor(members[0], key) * np.array(
            [dict(r.swept_values)[key] for r in members], dtype=float
        )
        marks = []
        for n, name in enumerate(usual_detectors(members[0])):
            points = [_last_row(r, detections, name) for r in members]
            exact_column = (
                ("exact_probability",) if all(np.isfinite(point["exact_probability"]) for point in points) else ()
            )
            columns = ("probability", "probability_lo", "probability_hi", *exact_column)
            marks.append(figure_lines.line_from_tables(strength, points, columns, name, Style(n, n, n)))
        title = ", ".join(key_labels.value_with_unit(members[0], k, v) for k, v in other_keys)
        x, y = Axis(key_labels.key_axis_label(members[0], key)), Axis(tr("detection probability"), limits=(0, 1))
        figure_panels.append(Panel(x, y, tuple(marks), title, direct=False))
    caption = tr(
        "Detection probability of detectors in the range at the last scan of the manoeuvre (of the run, if there is "
        "none), for P_FA ≈ {usual:g} per test, versus the strength of the manoeuvre.",
        usual=USUAL_FALSE_ALARM_RATE,
    )
    return _figure_of_panels("detection", tr("Detection versus manoeuvre strength"), caption, figure_panels)


def _last_row(result: CaseResult[ManoeuvreAxes], detections: "pd.DataFrame", name: str) -> "pd.Series":
    rows = usual_rows(detections[detections["case"] == result.name], name)
    during = last_test_of_phase(rows, "manoeuvre")
    return (during if len(during) else last_test_of_phase(rows, "steady")).iloc[0]


def delay_figure(results: Results, delays: "pd.DataFrame") -> Figure | None:
    """Probability that alarm raised, against the time since the manoeuvre began."""
    figure_panels: list[Panel] = []
    for result in results:
        rows, marks = delays[delays["case"] == result.name], []
        detectors = zip(result.spec.detectors, result.axes.independent, strict=True)
        independent_names = [detector.name for detector, independent in detectors if independent]
        for n, name in enumerate([*usual_detectors(result), *independent_names]):
            alarms = usual_rows(rows, name)
            alarms = alarms[alarms["event"] == "alarm"]
            if len(alarms):
                marks.append(
                    figure_lines.line_from_rows(
                        alarms,
                        ("delay_s", "probability", "probability_lo", "probability_hi", "exact_probability"),
                        name,
                        n,
                    )
                )
        if marks:
            x, y = Axis(tr("time since it began, s"), limits=(0, None)), Axis(tr("alarm raised"), limits=(0, 1))
            figure_panels.append(Panel(x, y, tuple(marks), _swept_values(result), direct=False))
    caption = tr(
        "Probability that a detector in the range has alarmed versus the time since the manoeuvre began, for P_FA ≈ "
        "{usual:g} per test; exact if windows do not overlap.",
        usual=USUAL_FALSE_ALARM_RATE,
    )
    return _figure_of_panels("delay", tr("How soon a manoeuvre is detected"), caption, figure_panels)


def modes_figure(results: Results, modes: "pd.DataFrame") -> Figure | None:
    """Probability that filters assign to a manoeuvre, against time."""
    groups = tables.group_by(modes, "case", "filter", "component")
    figure_panels = []
    for result in results:
        lines = case_lines(
            result, groups, result.axes.components[0][0], ("t_s", "probability", "probability_lo", "probability_hi")
        )
        y = Axis(tr("probability of a manoeuvre"), limits=(0, 1))
        figure_panels.append(
            Panel(panel_layout.time_axis(), y, (*manoeuvre_lines(result), *lines), _swept_values(result), direct=False)
        )
    caption = tr(
        "Share of realisations with an adaptive filter in its manoeuvring mode, or mean probability of the "
        "manoeuvring model (IMM), first coordinate. Dotted: beginning and end of the manoeuvre."
    )
    return _figure_of_panels("modes", tr("Manoeuvre state assumed by the filters"), caption, figure_panels)


def uses_figure(results: Results, uses: "pd.DataFrame") -> Figure | None:
    """Measured over believed σ of the quantities derived from a track: a panel for each, a row for each filter."""
    result = results[0]
    rows = uses[uses["case"] == result.name]
    filters = [f for f in result.axes.filters if f in set(rows["filter"])]
    low, high = panel_layout.holding(
        [figure_lines.line_from_rows(rows, ("ratio", "ratio", "ratio_lo", "ratio_hi"), "", 0)], Axis("", "log")
    )
    ticks = tuple((float(value), numeral(f"{value:g}")) for value in RATIOS if low <= value <= high or value == 1)
    x = Axis(tr("measured / computed $\\sigma$"), "log", (low, high), ticks)
    figure_panels = []
    for name, title in SYMBOLS.items():
        if not len(of_quantity := rows[rows["component"] == name]):
            continue
        series = [
            row_panels.filter_series(tr("t = {t_s:g} s", t_s=t_s), at_time, "ratio", filters)
            for t_s, at_time in of_quantity.groupby("t_s", sort=True)
        ]
        names = list(map(key_labels.escape_dollars, filters))
        figure_panels.append(row_panels.row_panel(x, names, series, tr(title), [Reference(1.0, "x")]))
    if not figure_panels:
        return None
    case = f" ({key_labels.without_markup(_swept_values(result))})" if result.swept_values else ""
    caption = (
        tr(
            "RMS error divided by σ computed from the track's covariance to first order{case}, from {count:,} "
            "realisations.",
            case=case,
            count=result.count,
        )
    ) + case_selection.cases_left_out_remark(results, results[:1])
    return row_panels.row_figure("uses", tr("Quantities derived from a track"), caption, figure_panels)


def _swept_values(result: CaseResult[ManoeuvreAxes]) -> str:
    """The swept values, a strength with its unit."""
    return ", ".join(key_labels.value_with_unit(result, key, value) for key, value in result.swept_values)


def _figure_of_panels(
    name: str, title: str, caption: str, figure_panels: Sequence[Panel], max_columns: int = 3
) -> Figure | None:
    if not figure_panels:
        return None
    columns = 2 if len(figure_panels) in (2, 4) else min(max_columns, len(figure_panels))
    return Figure(name, title, caption, tuple(figure_panels), columns, COLUMN_MM if columns == 1 else PAGE_MM, 58)
