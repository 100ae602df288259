"""P3's figures on manoeuvres: ROC, detection by strength, delay, filters during the manoeuvre; uses of a track."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import numeral, term, tr
from radarsim.report import panels, tables
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Mark, Panel, Reference, Style
from radarsim.studies.sonar.figures import case_lines, ends
from radarsim.studies.sonar.manoeuvre import exact
from radarsim.studies.sonar.manoeuvre.exact import ManoeuvreAxes

if TYPE_CHECKING:
    import pandas as pd

USUAL = 0.01  # false alarms per test at which detectors are compared, or the nearest rate to it
MOST_PANELS = 4
SYMBOLS = {
    **{"course": term("course"), "speed": term("speed"), "x_ahead": term("$x$ ahead"), "y_ahead": term("$y$ ahead")},
    **{"cpa": term("CPA"), "t_cpa": term("$t$ to CPA")},
}
RATIOS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)  # ticks of a measured over a believed σ
STRENGTHS = ("acceleration_mps2", "rate_radps")  # keys that say how strong a manoeuvre is
Results = Sequence[CaseResult[ManoeuvreAxes]]
DRAWN_FROM = {"roc": ("detections",), "detection": ("detections",), "delay": ("delays",)}


def figures(results: Results, made: "Mapping[str, pd.DataFrame]") -> dict[str, Figure | None]:
    """The figures of cases with detectors, filters that respond to manoeuvres, or uses."""
    measured = [result for result in results if result.spec.detectors and "detections" in made]
    moving = [result for result in measured if result.axes.manoeuvre_s]
    responding = [result for result in results if "modes" in result.sums]
    drawn: dict[str, Figure | None] = {}
    if moving:
        some, left = shown(moving)
        drawn["detection"] = detection_figure(measured, made["detections"])
        drawn["roc"] = _said(roc_figure(some, made["detections"]), left)
        drawn["delay"] = _said(delay_figure(some, made["delays"]), left)
    if responding:
        some, left = shown(responding)
        drawn["modes"] = _said(modes_figure(some, made["modes"]), left)
    if "uses" in made:
        drawn["uses"] = uses_figure([result for result in results if "uses" in result.sums], made["uses"])
    return drawn


def shown(results: Results) -> tuple[list[CaseResult[ManoeuvreAxes]], str]:
    """Four of the cases at most, evenly spaced from the first to the last, and words on the others."""
    some = panels.spread_out(results, MOST_PANELS)
    return some, panels.cases_left_out(results, some)


def _said(figure: Figure | None, more: str) -> Figure | None:
    """The figure with a further sentence in its caption."""
    return replace(figure, caption=figure.caption + more) if figure else None


def first_component(rows: "pd.DataFrame", detector: str) -> "pd.DataFrame":
    """The rows of a detector in the first coordinate."""
    rows = rows[rows["filter"] == detector]
    return rows[rows["component"] == rows["component"].iloc[0]]


def usual(rows: "pd.DataFrame", detector: str) -> "pd.DataFrame":
    """The rows of a detector, first coordinate, at the threshold whose false alarm rate is nearest the usual one."""
    rows = first_component(rows, detector)
    distance = (np.log(rows["false_alarm_probability"]) - np.log(USUAL)).abs()
    return rows[distance <= distance.min() + 1e-9]


def every_scan(result: CaseResult[ManoeuvreAxes]) -> list[str]:
    """The detectors that test at every scan and whose false alarm rate is about the usual one."""
    names = []
    for detector, limits in zip(result.spec.detectors, result.axes.thresholds, strict=True):
        rates = exact.false_alarm(limits[0])
        if detector.test_every == 1 and np.min(np.abs(np.log(rates / USUAL))) < 0.1:
            names.append(detector.name)
    return names


def last_of(rows: "pd.DataFrame", phase: str) -> "pd.DataFrame":
    """The rows of the last test of a phase."""
    rows = rows[rows["phase"] == phase]
    return rows[rows["k"] == rows["k"].max()]


def roc_figure(results: Results, detections: "pd.DataFrame") -> Figure | None:
    """Detection probability at the manoeuvre's last scan against that of a false alarm at the last scan before it."""
    drawn: list[Panel] = []
    for result in results:
        rows, marks = detections[detections["case"] == result.name], []
        for n, name in enumerate(every_scan(result)):
            before, during = (
                last_of(first_component(rows, name), phase).sort_values("threshold_k")
                for phase in ("steady", "manoeuvre")
            )
            if not len(before) or not len(during):
                continue
            shift = during["shift"].iloc[0]
            if np.isfinite(shift):
                share = np.geomspace(3e-4, 0.5, 60)
                marks.append(Line(share, exact.detection(exact.threshold(share), shift), name, Style(n, n)))
            points = during.assign(false_alarms=before["probability"].to_numpy())
            label = "" if np.isfinite(shift) else name
            marks.append(panels.line(points, ("false_alarms", "probability", "lo", "hi"), label, Style(n, None, n)))
        if marks:
            x = Axis(tr("false alarms a test"), "log", limits=(3e-4, 0.5))
            y = Axis(tr("detection probability"), limits=(0, 1))
            drawn.append(Panel(x, y, tuple(marks), _title(result), direct=False))
    caption = tr(
        "Detectors of manoeuvres in the range: probability of an alarm at the last scan of the "
        "manoeuvre against that at the last scan before it. Lines: exact laws; markers: measured, of "
        "{count:,} realisations, with 95 % intervals.",
        count=results[0].count,
    )
    return _figure("roc", tr("Detections and false alarms"), caption, drawn)


def detection_figure(results: Results, detections: "pd.DataFrame") -> Figure | None:
    """Probability of detection against the manoeuvre's strength, a line for each detector."""
    key = next((key for key, value in results[0].swept if key.rpartition(".")[2] in STRENGTHS), None)
    if key is None:
        return None
    families: dict[tuple, list[CaseResult[ManoeuvreAxes]]] = {}
    for result in results:
        if key in dict(result.swept):
            families.setdefault(tuple(pair for pair in result.swept if pair[0] != key), []).append(result)
    drawn = []
    for others, members in families.items():
        members.sort(key=lambda r: dict(r.swept)[key])
        strength = panels.axis_factor(members[0], key) * np.array([dict(r.swept)[key] for r in members], dtype=float)
        marks = []
        for n, name in enumerate(every_scan(members[0])):
            points = [_at_strongest(r, detections, name) for r in members]
            known = ("exact",) if all(np.isfinite(point["exact"]) for point in points) else ()
            columns = ("probability", "lo", "hi", *known)
            marks.append(panels.line_of(strength, points, columns, name, Style(n, n, n)))
        title = ", ".join(panels.with_its_unit(members[0], k, v) for k, v in others)
        x, y = Axis(panels.axis_of(members[0], key)), Axis(tr("detection probability"), limits=(0, 1))
        drawn.append(Panel(x, y, tuple(marks), title, direct=False))
    caption = tr(
        "Probability of an alarm of detectors in the range at about {usual:g} false alarms a test, at "
        "the last scan of the manoeuvre (for a steady target, at the last scan), against the manoeuvre's "
        "strength. Bands: 95 % intervals; a band that is not visible is narrower than the line.",
        usual=USUAL,
    )
    return _figure("detection", tr("Detection against the strength of the manoeuvre"), caption, drawn)


def _at_strongest(result: CaseResult[ManoeuvreAxes], detections: "pd.DataFrame", name: str) -> "pd.Series":
    rows = usual(detections[detections["case"] == result.name], name)
    during = last_of(rows, "manoeuvre")
    return (during if len(during) else last_of(rows, "steady")).iloc[0]


def delay_figure(results: Results, delays: "pd.DataFrame") -> Figure | None:
    """Probability that alarm raised, against the time since the manoeuvre began."""
    drawn: list[Panel] = []
    for result in results:
        rows, marks = delays[delays["case"] == result.name], []
        detectors = zip(result.spec.detectors, result.axes.independent, strict=True)
        apart = [detector.name for detector, independent in detectors if independent]
        for n, name in enumerate([*every_scan(result), *apart]):
            alarms = usual(rows, name)
            alarms = alarms[alarms["event"] == "alarm"]
            if len(alarms):
                marks.append(panels.line(alarms, ("delay_s", "probability", "lo", "hi", "exact"), name, n))
        if marks:
            x, y = Axis(tr("time since it began, s"), limits=(0, None)), Axis(tr("alarm raised"), limits=(0, 1))
            drawn.append(Panel(x, y, tuple(marks), _title(result), direct=False))
    caption = tr(
        "Probability that a detector in the range has raised its first alarm, against the time since the "
        "manoeuvre began, at about {usual:g} false alarms a test. It is known exactly where windows do "
        "not overlap and tests are independent; overlapping windows have no closed form. Bands: 95 % "
        "intervals.",
        usual=USUAL,
    )
    return _figure("delay", tr("How soon a manoeuvre is detected"), caption, drawn)


def modes_figure(results: Results, modes: "pd.DataFrame") -> Figure | None:
    """Probability that filters assign to a manoeuvre, against time."""
    groups = tables.groups(modes, "case", "filter", "component")
    drawn = []
    for result in results:
        lines = case_lines(result, groups, result.axes.components[0][0], ("t_s", "probability", "lo", "hi"))
        y = Axis(tr("probability of a manoeuvre"), limits=(0, 1))
        drawn.append(Panel(panels.time_axis(), y, (*ends(result), *lines), _title(result), direct=False))
    caption = tr(
        "Share of realisations in which an adaptive filter is in its manoeuvring mode, and mean "
        "probability of the manoeuvring model of an imm, first coordinate. Dotted: beginning and end of "
        "the manoeuvre."
    )
    return _figure("modes", tr("Manoeuvre state assumed by the filters"), caption, drawn)


def uses_figure(results: Results, uses: "pd.DataFrame") -> Figure | None:
    """Measured over believed σ of the quantities derived from a track, a panel for each time."""
    result = results[0]
    rows, names = uses[uses["case"] == result.name], list(SYMBOLS)
    ticks = tuple((float(i), tr(label)) for i, label in enumerate(SYMBOLS.values()))
    drawn = []
    for when, at_time in rows.groupby("t_s", sort=True):
        marks: list[Mark] = [Reference(1.0, label="")]
        for n, (f, part) in enumerate(at_time.groupby("filter", sort=False)):
            x = np.array([names.index(name) for name in part["component"]]) + 0.08 * (n - len(result.axes.filters) / 2)
            columns = ("x", "ratio", "ratio_lo", "ratio_hi")
            marks.append(panels.line(part.assign(x=x), columns, str(f), Style(n, None, n)))
        low, high = at_time["ratio"].min(), at_time["ratio"].max()
        shown = tuple((float(value), numeral(f"{value:g}")) for value in RATIOS if low <= value <= high or value == 1)
        y = Axis(tr("measured / computed $\\sigma$"), "log", ticks=shown)
        drawn.append(Panel(Axis("", ticks=ticks), y, tuple(marks), tr("t = {t_s:g} s", t_s=when), direct=False))
    case = f" ({panels.plain(_title(result))})" if result.swept else ""
    caption = (
        tr(
            "σ about the truth over the one computed from the track's covariance to first order{case}, "
            "of {count:,} realisations, with 95 % intervals.",
            case=case,
            count=result.count,
        )
    ) + panels.cases_left_out(results, results[:1])
    return _figure("uses", tr("Quantities derived from a track"), caption, drawn, 2)


def _title(result: CaseResult[ManoeuvreAxes]) -> str:
    """The swept values, a strength with its unit."""
    return ", ".join(panels.with_its_unit(result, key, value) for key, value in result.swept)


def _figure(name: str, title: str, caption: str, drawn: Sequence[Panel], most: int = 3) -> Figure | None:
    if not drawn:
        return None
    columns = 2 if len(drawn) in (2, 4) else min(most, len(drawn))
    return Figure(name, title, caption, tuple(drawn), columns, COLUMN_MM if columns == 1 else PAGE_MM, 58)
