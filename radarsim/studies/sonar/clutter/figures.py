"""P3's figures of tracks among false plots: a map, confirmation, track life and accuracy, false tracks, classes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import few, listed, term, tr
from radarsim.report import panels, tables, wording
from radarsim.report.drawing import GREY, PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.studies.sonar.clutter.filters import ClutterAxes, TrackerSpec, conditions, gate_threshold, tracker_specs
from radarsim.studies.sonar.clutter.tables import ENDED
from radarsim.studies.sonar.clutter.track import confirmed_tracks, false_plots, target_plots

if TYPE_CHECKING:
    import pandas as pd

KEYS = {  # columns of the table of tracking, and the keys that they hold
    "false_plots_per_km2": "sensor.false_plots_per_km2",
    "detection_probability": "sensor.detection_probability",
    "gate_probability": "gate_probability",
}
LIFE = term("mean time between ends of a confirmed track (no point: no end occurred)")
ENDS = term("probability, by importance sampling, that the target's first confirmed track has ended")
ZERO_AWAY = 3.0  # from zero to the least value above it on a logarithmic axis, as a factor
UPPER = Style(GREY, None, 4)
LEVEL = 0.02  # of its largest value: what changes less over a sweep is said, not drawn
Results = Sequence[CaseResult[ClutterAxes]]
DRAWN_FROM = {"confirmation": ("tracks",), "track_life": ("tracking", "curves", "rare"), "false_tracks": ("tracking",)}


def figures(results: Results, made: "Mapping[str, pd.DataFrame]") -> dict[str, Figure | None]:
    """The figures of these cases, all of which have trackers."""
    if not results:
        return {}
    drawn = {
        "track_life": life_figure(results, made),
        "track_map": map_figure(middle(results)),
        "confirmation": confirmation_figure(results, made["tracks"]),
        "false_tracks": false_figure(results, made["tracking"]),
        "track_classes": classes_figure(results, made["track_classes"]),
    }
    return drawn


def middle(results: Results) -> CaseResult[ClutterAxes]:
    """The case in the middle, for figures of a single case."""
    return results[(len(results) - 1) // 2]


def axis_over(result: CaseResult[ClutterAxes], column: str, table: "pd.DataFrame") -> "tuple[Axis, pd.DataFrame]":
    """An axis of the swept values of a column of KEYS, logarithmic if they span more than a factor of twenty, and the
    rows with their places on it: zero stands left of the least one."""
    label, values = panels.axis_of(result, KEYS[column]), np.unique(table[column].to_numpy(float))
    above = values[values > 0]
    if not len(above) or above[-1] / above[0] <= panels.WIDE:
        return Axis(label), table
    if values[0] > 0:
        return Axis(label, "log"), table
    zero = above[0] / ZERO_AWAY
    ticks = ((zero, "0"), *((float(value), wording.number(float(value), 4)) for value in above))
    return Axis(label, "log", ticks=ticks), table.assign(**{column: table[column].replace(0.0, zero)})


def swept_column(tracking: "pd.DataFrame") -> str | None:
    """The column of KEYS that has the most different values; None if all cases have the same ones."""
    counts = {column: tracking[column].nunique() for column in KEYS}
    column = max(KEYS, key=lambda key: counts[key])
    return column if counts[column] > 1 else None


def by_line(tracking: "pd.DataFrame", column: str, result: CaseResult[ClutterAxes]) -> "pd.DataFrame":
    """The rows with the name of their line, over column, in place of the filter: the tracker and what else is swept.

    result is one of the cases."""
    others = [other for other in KEYS if other != column and tracking[other].nunique() > 1]
    names = tracking["filter"].map(panels.literal).astype(object)
    for other in others:
        symbol = panels.symbol_of(result, KEYS[other])
        names = names + [f", {symbol} = {panels.with_its_unit(result, KEYS[other], v)}" for v in tracking[other]]
    return tracking.assign(filter=names)


def confirmation_figure(results: Results, tracks: "pd.DataFrame") -> Figure | None:
    """Probability of a confirmed track against time: a panel for each case, a line for each tracker."""
    groups = tables.groups(tracks, "case", "filter")
    confirmed = ("t_s", "confirmed", "confirmed_lo", "confirmed_hi", "exact_confirmed")
    drawn: list[Panel] = []
    some = panels.spread_out(results, panels.MOST)
    for result in some:
        marks = []
        for n, f in enumerate(result.axes.filters):
            if (result.name, f) in groups:
                rows = groups[result.name, f]
                marks.append(panels.line(rows, confirmed, panels.literal(f), n))
                marks.append(panels.line(rows, ("t_s", "kept", "kept_lo", "kept_hi"), "", Style(n, n, None, 0.7)))
        if marks:
            keys = ((tr("thin: kept at that time"), Style(0, 0, None, 0.7)),) if not drawn else ()
            y = Axis(tr("probability"), limits=(0, 1))
            drawn.append(Panel(panels.time_axis(), y, tuple(marks), _swept(result), keys, direct=False))
    if not drawn:
        return None
    caption = (
        tr(
            "Probability that a track of the target was confirmed by that time, of {realisations}; thin "
            "lines: that a confirmed track exists and is on the target. Bands: 95 % intervals.",
            realisations=panels.realisations(results),
        )
    ) + panels.cases_left_out(results, some)
    title = tr("Probability of a confirmed track")
    return Figure("confirmation", title, caption, tuple(drawn), min(2, len(drawn)), PAGE_MM)


def _swept(result: CaseResult[ClutterAxes]) -> str:
    """The swept keys of a case and their values, at length."""
    pairs = ((panels.key_label(result, key).text, panels.with_its_unit(result, key, v)) for key, v in result.swept)
    return ", ".join(f"{name}: {value}" for name, value in pairs)


def life_figure(results: Results, made: "Mapping[str, pd.DataFrame]") -> Figure | None:
    """Track life, time to confirmation, wrong plots and accuracy of the tracks kept, over what is swept."""
    tracking = made["tracking"]
    column = swept_column(tracking)
    if column is None:
        return None
    x, tracking = axis_over(results[0], column, tracking)
    curves = made["curves"]
    cases = tracking[["case", *KEYS]].drop_duplicates("case")
    at_end = tables.where(curves, component="r", k=results[0].axes.k[-1]).merge(cases, on="case", how="left")
    ended = made["rare"][made["rare"]["sought"] & (made["rare"]["event"] == ENDED)] if "rare" in made else at_end[:0]
    life = ("life_s", "life", tr("track life"), "s", tracking, tr(LIFE))
    if len(ended):
        rates = ended.merge(cases, on="case", how="left")
        life = ("rate", "rate", tr("share of tracks ended by the last scan"), "", rates, tr(ENDS))
    time, wrong = tr("time to confirmation"), tr("share of wrong plots")
    quantities = (
        life,
        ("time_to_confirm_s", "time", time, "s", tracking, tr("mean time to its confirmation")),
        ("wrong_share", "wrong", wrong, "", tracking, tr("weight of false plots among those used")),
        (
            *("sigma", "sigma", tr("$\\sigma$ of $r$ of kept tracks"), "m", at_end),
            tr("root-mean-square error of the range of the tracks kept at the end"),
        ),
    )
    drawn, said, level = [], [], []
    for value, ends, quantity, unit, table, words in quantities:
        lines = _lines(by_line(table, column, results[0]), column, value, ends)
        known = [line.y[np.isfinite(line.y)] for line in lines]
        if all(np.ptp(values) <= LEVEL * values.max() for values in known if len(values)):
            level += [_level(quantity, unit, np.concatenate(known))]
        else:
            label = panels.with_unit(quantity, unit)
            y = Axis(label, "log") if value == life[0] else Axis(label, limits=(0, None))
            drawn.append(Panel(x, y, tuple(lines), direct=False))
            said.append(words)
    if not drawn:
        return None
    words = listed(said)
    caption = tr(
        "{panels}, of {realisations}. Bands: 95 % intervals.",
        panels=words[0].upper() + words[1:],
        realisations=panels.realisations(results),
    )
    if level := [words for words in level if words]:
        caption += " " + tr("Not drawn, as it does not change over the sweep: {quantities}.", quantities=listed(level))
    columns = min(2, len(drawn))
    width = panels.WIDE_MM if columns == 1 else PAGE_MM
    return Figure("track_life", tr("Track life and accuracy"), caption, tuple(drawn), columns, width, 58)


def _level(quantity: str, unit: str, values: np.ndarray) -> str:
    """A quantity that does not change, with its values (n,) over the trackers; empty where there is none."""
    if not len(values):
        return ""
    extremes = dict.fromkeys(wording.number(float(end), 3) for end in (values.min(), values.max()))
    number = " ".join(filter(None, ("–".join(extremes), panels.unit_of(unit))))
    return f"{wording.spoken(quantity)} ({number})"


def _lines(table: "pd.DataFrame", x: str, value: str, ends: str) -> list[Line]:
    """A line for each filter of a table's values over x, none where infinite; an infinite end of an interval too."""
    lines = []
    for n, (name, rows) in enumerate(table.groupby("filter", sort=False)):
        rows = rows.sort_values(x).replace(np.inf, np.nan)
        lo, hi = (rows[key].where(np.isfinite(rows[key]), rows[value]) for key in (f"{ends}_lo", f"{ends}_hi"))
        lines.append(panels.line(rows.assign(lo=lo, hi=hi), (x, value, "lo", "hi"), str(name), n))
    return lines


def false_figure(results: Results, tracking: "pd.DataFrame") -> Figure | None:
    """False tracks per hour over what is swept, on a logarithmic axis; of none that occurred, how many there may be.
    Without false plots there are no false tracks, and no point."""
    column, rate = swept_column(tracking), "false_tracks_per_hour"
    rows = tracking[tracking["false_plots_per_km2"] > 0]
    if column is None or not (rows[rate] > 0).any():
        return None
    rules: dict[str, list[str]] = {}
    for name, count, of in rows[["filter", "m", "of"]].drop_duplicates("filter").itertuples(index=False, name=None):
        rules.setdefault(tr("{count} of {of}", count=int(count), of=int(of)), []).append(name)
    x, rows = axis_over(results[0], column, by_line(rows, column, results[0]))
    none = rows[rows[rate] == 0]
    upper = Line(none[column].to_numpy(), none["false_hi"].to_numpy(), "", UPPER)
    rows = rows.assign(**{name: rows[name].where(rows[rate] > 0) for name in (rate, "false_lo", "false_hi")})
    keys = ((tr("none occurred: upper end of the interval"), UPPER),) if len(none) else ()
    marks = (*_lines(rows, column, rate, "false"), *([upper] if keys else []))
    caption = tr(
        "False tracks confirmed per hour in the whole sector; every false plot starts a tentative track. Plots that "
        "confirm it: {rules}. {realisations} per case. Bands and bars: 95 % intervals.",
        rules="; ".join(f"{rule} ({few(names)})" for rule, names in rules.items()),
        realisations=panels.realisations(results),
    )
    if never := rows.groupby("filter", sort=False)[rate].sum().loc[lambda rates: rates == 0].index.tolist():
        caption += " " + tr("Zero throughout, so not drawn: {names}.", names=few(never))
    panel = Panel(x, Axis(tr("false tracks per hour"), "log"), marks, keys=keys, direct=False)
    return Figure("false_tracks", tr("False tracks"), caption, (panel,), width_mm=panels.WIDE_MM)


def classes_figure(results: Results, classes: "pd.DataFrame") -> Figure | None:
    """Error rates of the classification by the score, over its threshold, of one case."""
    case = middle(results)
    table = classes[(classes["case"] == case.name) & (classes["n_false"] > 0)]
    if table.empty:
        return None
    table = table.assign(filter=table["filter"].map(panels.literal))
    x = Axis(tr("threshold of the score"))
    false = _lines(table[table["false_called_true"] > 0], "threshold", "false_called_true", "false")
    true = _lines(table, "threshold", "true_called_false", "true")
    drawn = []
    if false:
        longest = max(false, key=lambda mark: len(mark.x))
        bound = Line(longest.x, np.exp(-longest.x), tr("bound"), Style(GREY, 1, None))
        y = Axis(tr("share of false tracks declared true"), "log")
        drawn.append(Panel(x, y, (*false, bound), direct=False))
    if true:
        y = Axis(tr("share of target's tracks declared false"), limits=(0, None))
        drawn.append(Panel(x, y, tuple(true), direct=False))
    caption = tr(
        "Error rates of declaring a track true once its score (logarithm of the likelihood ratio) "
        "reaches a threshold, of {realisations} of each kind. Left: tracks started by false plots, at "
        "most exp(−threshold) of them (bound). Right: the target's first tracks. Bands: 95 % intervals.",
        realisations=panels.realisations(results),
    ) + (tr(" Case: {swept}.", swept=_swept(case)) if case.swept else "")
    return (
        Figure("track_classes", tr("True and false tracks by score"), caption, tuple(drawn), 2, PAGE_MM)
        if drawn
        else None
    )


NEAR_M = 2500.0  # the map shows what is nearer than this to the target's course
EVERY = 4  # scans between the gates that the map shows
Curve = tuple[np.ndarray, np.ndarray]  # distances north and east, m


def map_figure(result: CaseResult[ClutterAxes]) -> Figure:
    """Realisation 0 of a case on a map, near the target's course: its course and plots, false plots, and the confirmed
    tracks and gates of the first tracker that has to find its plots."""
    spec, axes, specs = result.spec, result.axes, tracker_specs(result.spec)
    z, true = target_plots(axes.world, axes.detections, 0)
    course = _flat(*true.T)
    (south, north), (west, east) = ((side.min() - NEAR_M, side.max() + NEAR_M) for side in course)
    scans, near_ones = [], []
    for k, t in enumerate(np.cumsum(axes.world.dt)):
        r, b = false_plots(axes.field, 0, k)
        x, y = _flat(r, b)
        near = (south < x) & (x < north) & (west < y) & (y < east)
        near_ones.append(np.stack([x[near], y[near]]))
        own = z[k][:, None] if np.isfinite(z[k, 0]) else np.zeros((2, 0))
        scans.append((t, *np.concatenate([own, np.stack([r[near], b[near]])], axis=1)))
    f = next((i for i, one in enumerate(specs) if one.association != "known"), None)
    found = [] if f is None else confirmed_tracks(specs[f], conditions(spec), scans)
    states = [np.array(track.states) for track in found]
    every = [_flat(own[:, 0], own[:, 2]) for own in states]
    order = sorted(range(len(found)), key=lambda n: _distance(every[n], course))
    tracks, false = [every[n] for n in order], np.concatenate(near_ones, axis=1)
    gates = [
        _ellipse(gate, specs[f or 0])
        for n in order[:1]
        for k, gate in zip(found[n].scans, found[n].gates, strict=True)
        if not k % EVERY
    ]
    marks = [_on_map((false[0], false[1]), tr("false plots"), Style(GREY, None, 0, 1.1, 1.0))]
    curves = (
        (tr("its gates"), [gate for gate in gates if np.isfinite(gate[0]).all()], Style(3, 0, None, 0.6)),
        (tr("other tracks"), tracks[1:], Style(GREY, 0, None, 1.0)),
        (tr("track nearest to the course"), tracks[:1], Style(2, 0, None, 1.8)),
    )
    for label, drawn, style in curves:
        marks += [_on_map(one, "" if n else label, style) for n, one in enumerate(drawn)]
    marks.append(_on_map(course, tr("target"), Style(1, 1, None)))
    marks.append(_on_map(_flat(*z[np.isfinite(z[:, 0])].T), tr("target plots"), Style(1, None, 1, 1.1, 2.0)))
    caption = tr(
        "Confirmed tracks near the target: {tracks}, among {false} false plots in {k} scans. The target's course and "
        "plots, the false plots of all scans, the tracks, and at every fourth scan the gate of the one nearest to the "
        "course, in realisation 0 of {name}, tracker {tracker}.",
        tracks=len(tracks),
        false=len(false[0]),
        name=panels.plain_label(result),
        tracker="" if f is None else spec.filters[f].name,
        k=len(axes.k),
    )
    x_axis = Axis(tr("distance east, km"), limits=(west / 1e3, east / 1e3))
    y_axis = Axis(tr("distance north, km"), limits=(south / 1e3, north / 1e3))
    panel, title = Panel(x_axis, y_axis, tuple(marks), direct=False, equal=True), tr("Plots, gates and tracks")
    return Figure("track_map", title, caption, (panel,), width_mm=panels.WIDE_MM, panel_height_mm=100)


def _on_map(curve: Curve, label: str, style: Style) -> Line:
    return Line(curve[1] * 1e-3, curve[0] * 1e-3, label, style)


def _flat(r: np.ndarray, b: np.ndarray) -> Curve:
    """Distances north and east."""
    return r * np.cos(b), r * np.sin(b)


def _distance(track: Curve, course: Curve) -> float:
    """The median distance of a track's points to the course, m."""
    north, east = (own[:, None] - other for own, other in zip(track, course, strict=True))
    return float(np.median(np.hypot(north, east).min(axis=1)))


def _ellipse(gate: np.ndarray, tracker: TrackerSpec) -> Curve:
    """The edge of a gate on the map; an open gate is drawn as if its probability were 0.9999."""
    angle, (r, b, rr, rb, bb) = np.linspace(0, 2 * np.pi, 61), gate
    size = np.sqrt(gate_threshold(min(tracker.gate_probability, 0.9999)))
    low = rb / np.sqrt(rr)
    u, v = size * np.cos(angle), size * np.sin(angle)
    return _flat(r + np.sqrt(rr) * u, b + low * u + np.sqrt(max(bb - low**2, 0.0)) * v)
