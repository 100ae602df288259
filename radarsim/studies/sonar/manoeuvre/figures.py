"""P3's figures on manoeuvres: ROC, detection over its strength, delay, filters through it; uses of a track."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Line, Panel, Reference, Style
from radarsim.studies.sonar.figures import QUANTITIES
from radarsim.studies.sonar.manoeuvre import exact
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes

USUAL = 0.01  # false alarms a test at which detectors are compared, or what comes nearest
MOST_PANELS = 4
BESIDE_LEGEND = 3  # panels of a figure whose legend takes the place of one
SYMBOLS = {"course": "course", "speed": "speed", "x_ahead": "$x$ ahead", "y_ahead": "$y$ ahead"}
SYMBOLS |= {"cpa": "CPA", "t_cpa": "$t$ to CPA"}
RATIOS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)  # ticks of a measured over a believed σ
STRENGTHS = {"acceleration_mps2": "acceleration, m/s²", "rate_radps": "turn rate, rad/s"}


def figures(results: Sequence[CaseResult[ManoeuvreAxes]], made: Mapping) -> dict[str, Figure | None]:
    """The figures of cases with detectors, filters that respond to manoeuvres, or uses."""
    watched = [result for result in results if result.spec.detectors and "detections" in made]
    moving = [result for result in watched if result.axes.manoeuvre_s]
    responding = [result for result in results if "modes" in result.sums]
    found = {
        "roc": roc_figure(spread_out(moving), made["detections"]) if moving else None,
        "detection": detection_figure(watched, made["detections"]) if moving else None,
        "delay": delay_figure(spread_out(moving), made["delays"]) if moving else None,
        "response": response_figure(spread_out(responding, BESIDE_LEGEND), made["curves"]) if responding else None,
        "modes": modes_figure(spread_out(responding, BESIDE_LEGEND), made["modes"]) if responding else None,
        "uses": uses_figure([r for r in results if "uses" in r.sums], made["uses"]) if "uses" in made else None,
    }
    return {name: figure for name, figure in found.items() if figure}


def spread_out(
    results: Sequence[CaseResult[ManoeuvreAxes]], most: int = MOST_PANELS
) -> list[CaseResult[ManoeuvreAxes]]:
    """At most so many of the cases, from the first to the last."""
    if len(results) <= most:
        return list(results)
    return [results[i] for i in np.linspace(0, len(results) - 1, most).round().astype(int)]


def left_out(shown: Sequence, results: Sequence) -> str:
    """Words on the cases that a figure does not show."""
    return f" {len(results) - len(shown)} further cases are in the tables alone." if len(shown) < len(results) else ""


def usual(rows, detector: str):
    """The rows of a detector at the threshold whose false alarms come nearest the usual share, first coordinate."""
    own = rows[rows["filter"] == detector]
    own = own[own["component"] == own["component"].iloc[0]]
    away = (np.log(own["false_alarm_probability"]) - np.log(USUAL)).abs()
    return own[away <= away.min() + 1e-9]


def every_scan(result: CaseResult[ManoeuvreAxes]) -> list[str]:
    """Detectors that test at every scan, and whose false alarms are about the usual ones."""
    found = []
    for one, limits in zip(result.spec.detectors, result.axes.thresholds, strict=True):
        shares = exact.false_alarm(limits[0])
        if one.test_every == 1 and np.min(np.abs(np.log(shares / USUAL))) < 0.1:
            found.append(one.name)
    return found


def last_of(rows, phase: str):
    """The rows of the last test of a phase."""
    own = rows[rows["phase"] == phase]
    return own[own["k"] == own["k"].max()]


def roc_figure(results: Sequence[CaseResult[ManoeuvreAxes]], detections) -> Figure | None:
    """Probability of detection at the manoeuvre's last scan against that of a false alarm at the last before it."""
    drawn = []
    for result in results:
        rows, marks = detections[detections["case"] == result.name], []
        for n, name in enumerate(every_scan(result)):
            own = rows[rows["filter"] == name]
            own = own[own["component"] == own["component"].iloc[0]]
            before, during = (last_of(own, phase).sort_values("threshold_k") for phase in ("steady", "manoeuvre"))
            if not len(before) or not len(during):
                continue
            shift = during["shift"].iloc[0]
            if np.isfinite(shift):
                share = np.geomspace(3e-4, 0.5, 60)
                marks.append(Line(share, exact.detection(exact.threshold(share), shift), name, Style(n, n)))
            v = [during[key].to_numpy() for key in ("probability", "lo", "hi")]
            label = "" if np.isfinite(shift) else name
            marks.append(Line(before["probability"].to_numpy(), v[0], label, Style(n, None, n), v[1], v[2]))
        if marks:
            x = Axis("false alarms a test", "log", limits=(3e-4, 0.5))
            y = Axis("detection probability", limits=(0, 1.02))
            drawn.append(
                Panel(x, y, tuple(marks), _title(result), direct=False, legend="best" if not drawn else "none")
            )
    caption = (
        "Detectors of manoeuvres in the range: probability of an alarm at the last scan of the manoeuvre against that "
        f"at the last scan before it. Lines: exact laws; markers: measured, of {results[0].count:,} realisations, with "
        "95 % intervals."
    )
    return _figure("roc", "What a detector sees, and what it imagines", caption, drawn)


def detection_figure(results: Sequence[CaseResult[ManoeuvreAxes]], detections) -> Figure | None:
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
        strength = np.array([dict(r.swept)[key] for r in members], dtype=float)
        marks = []
        for n, name in enumerate(every_scan(members[0])):
            points = [_at_strongest(r, detections, name) for r in members]
            v = {part: np.array([point[part] for point in points]) for part in ("probability", "lo", "hi", "exact")}
            known = v["exact"] if np.isfinite(v["exact"]).all() else None
            marks.append(Line(strength, v["probability"], name, Style(n, n, n), v["lo"], v["hi"], known))
        title = ", ".join(f"{panels.symbol_of(k)} = {panels.number(v)}" for k, v in others)
        x, y = Axis(STRENGTHS[key.rpartition(".")[2]]), Axis("detection probability", limits=(0, 1.02))
        drawn.append(Panel(x, y, tuple(marks), title, direct=False, legend="right"))
    caption = (
        f"Probability of an alarm of detectors in the range at about {USUAL:g} false alarms a test, at the last scan "
        "of the manoeuvre (of a steady target, at the last of all), against the manoeuvre's strength. Bands: 95 % "
        "intervals, where not seen narrower than the line. Crosses: exact laws."
    )
    return _figure("detection", "Detection over the strength of the manoeuvre", caption, drawn)


def _at_strongest(result: CaseResult[ManoeuvreAxes], detections, name: str):
    own = usual(detections[detections["case"] == result.name], name)
    during = last_of(own, "manoeuvre")
    return (during if len(during) else last_of(own, "steady")).iloc[0]


def delay_figure(results: Sequence[CaseResult[ManoeuvreAxes]], delays) -> Figure | None:
    """Probability that an alarm has come, against the time since the manoeuvre began."""
    drawn = []
    for result in results:
        rows, marks = delays[delays["case"] == result.name], []
        apart = [one.name for one, so in zip(result.spec.detectors, result.axes.independent, strict=True) if so]
        for n, name in enumerate([*every_scan(result), *apart]):
            own = usual(rows, name)
            own = own[own["event"] == "alarm"]
            if not len(own):
                continue
            v = [own[key].to_numpy(dtype=float) for key in ("delay_s", "probability", "lo", "hi", "exact")]
            marks.append(Line(*v[:2], name, Style(n, n, n), *v[2:4], v[4] if np.isfinite(v[4]).all() else None))
        if marks:
            x, y = Axis("time since it began, s", limits=(0, None)), Axis("an alarm has come", limits=(0, 1.02))
            drawn.append(
                Panel(x, y, tuple(marks), _title(result), direct=False, legend="best" if not drawn else "none")
            )
    caption = (
        "Probability that the first alarm of a detector in the range has come, against the time since the manoeuvre "
        f"began, at about {USUAL:g} false alarms a test. Crosses: exact, where windows are apart and tests "
        "independent; overlapping windows have no closed law. Bands: 95 % intervals."
    )
    return _figure("delay", "How soon a manoeuvre is seen", caption, drawn)


def response_figure(results: Sequence[CaseResult[ManoeuvreAxes]], curves) -> Figure | None:
    """σ of the first coordinate through the manoeuvre, a line for each filter."""
    groups = common.groups(curves, "case", "filter", "component")
    drawn = []
    for result in results:
        (component, unit), marks = result.axes.components[0], _ends(result)
        for n, f in enumerate(result.axes.filters):
            rows = groups.get((result.name, f, component))
            if rows is None:
                continue
            v = [rows[key].to_numpy(dtype=float) for key in ("t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")]
            known = v[4] if np.isfinite(v[4]).any() else None
            marks.append(Line(*v[:2], f, Style(n, n, n), *v[2:4], known))
        y = Axis(f"$\\sigma$ of {QUANTITIES[component].symbol}, {unit}", "log")
        drawn.append(Panel(Axis(panels.TIME, limits=(0, None)), y, tuple(marks), _title(result), direct=False))
    caption = (
        f"Root-mean-square error of the first coordinate about the truth on the same plots, of "
        f"{results[0].count:,} realisations. Dashed: the manoeuvre begins and ends. Crosses: exact values."
    )
    return _figure("response", "Filters through a manoeuvre", caption, _one_legend(drawn))


def modes_figure(results: Sequence[CaseResult[ManoeuvreAxes]], modes) -> Figure | None:
    """Probability of a manoeuvre that filters live by, against time."""
    groups = common.groups(modes, "case", "filter", "component")
    drawn = []
    for result in results:
        component, marks = result.axes.components[0][0], _ends(result)
        for n, f in enumerate(result.axes.filters):
            rows = groups.get((result.name, f, component))
            if rows is not None:
                v = [rows[key].to_numpy(dtype=float) for key in ("t_s", "probability", "lo", "hi")]
                marks.append(Line(*v[:2], f, Style(n, n, n), *v[2:]))
        y = Axis("manoeuvre taken for granted", limits=(0, 1.02))
        drawn.append(Panel(Axis(panels.TIME, limits=(0, None)), y, tuple(marks), _title(result), direct=False))
    caption = (
        "Share of realisations in which an adaptive filter is in its manoeuvring mode, and mean probability of the "
        "manoeuvring model of an imm, first coordinate. Dashed: the manoeuvre begins and ends."
    )
    return _figure("modes", "What filters take the target to be doing", caption, _one_legend(drawn))


def uses_figure(results: Sequence[CaseResult[ManoeuvreAxes]], uses) -> Figure | None:
    """Measured over believed σ of what a track is used for, a panel for each moment."""
    result = results[0]
    rows, names = uses[uses["case"] == result.name], list(SYMBOLS)
    drawn = []
    for when, own in rows.groupby("t_s", sort=True):
        marks = [Reference(1.0, label="")]
        for n, (f, part) in enumerate(own.groupby("filter", sort=False)):
            x = np.array([names.index(name) for name in part["component"]]) + 0.08 * (n - len(result.axes.filters) / 2)
            v = [part[key].to_numpy(dtype=float) for key in ("ratio", "ratio_lo", "ratio_hi")]
            marks.append(Line(x, v[0], f, Style(n, None, n), *v[1:]))
        ticks = tuple((float(i), words) for i, words in enumerate(SYMBOLS.values()))
        low, high = own["ratio"].min(), own["ratio"].max()
        seen = tuple((value, f"{value:g}") for value in RATIOS if low <= value <= high or value == 1)
        y = Axis("measured / believed $\\sigma$", "log", ticks=seen)
        drawn.append(Panel(Axis("", ticks=ticks), y, tuple(marks), f"t = {when:g} s", direct=False))
    caption = (
        f"σ about the truth over the one computed from the track's covariance to first order{_of(result)}, of "
        f"{result.count:,} realisations, with 95 % intervals."
    )
    return _figure("uses", "What a track is used for", caption + left_out([result], results), _one_legend(drawn), 2)


def _of(result: CaseResult[ManoeuvreAxes]) -> str:
    return f" ({panels.plain(_title(result))})" if result.swept else ""


def _ends(result: CaseResult[ManoeuvreAxes]) -> list:
    """Lines where the manoeuvre begins and ends."""
    times = result.axes.manoeuvre_s or ()
    return [Reference(when, "x") for when in times if 0 < when < result.axes.t_s[-1]]


def _title(result: CaseResult[ManoeuvreAxes]) -> str:
    """The swept values, a strength with its unit."""
    units = {key: words.rpartition(", ")[2] for key, words in STRENGTHS.items()}
    words = [f"{panels.number(v)} {units.get(key.rpartition('.')[2], '')}".rstrip() for key, v in result.swept]
    return ", ".join(words)


def _one_legend(drawn: list[Panel]) -> list[Panel]:
    """A legend of its own after panels that all have the same lines."""
    keys = tuple((mark.label, mark.style) for mark in drawn[0].marks if isinstance(mark, Line))
    bare = [Panel(p.x, p.y, p.marks, p.title, direct=False, legend="none") for p in drawn]
    return [*bare, Panel(Axis(""), Axis(""), (), keys=keys)]


def _figure(name: str, title: str, caption: str, drawn: list[Panel], most: int = 3) -> Figure | None:
    if not drawn:
        return None
    columns = 2 if len(drawn) in (2, 4) else min(most, len(drawn))
    return Figure(name, title, caption, tuple(drawn), columns, 95.0 if columns == 1 else PAGE_MM, 58)
