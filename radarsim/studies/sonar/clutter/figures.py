"""P3's figures of tracks among false plots, described: confirmation, life, accuracy, false tracks, classes, a map."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.map import realisation_map

KEYS = {
    "false_plots_per_km2": ("sensor.false_plots_per_km2", "false plots per km² and scan"),
    "detection_probability": ("sensor.detection_probability", "detection probability"),
    "gate_probability": ("gate_probability", "gate probability"),
}
WIDE = 150.0


def figures(results: Sequence[CaseResult[ClutterAxes]], made: Mapping) -> dict[str, Figure | None]:
    """The figures of these cases, all of trackers."""
    if not results:
        return {}
    return {
        "track_map": map_figure(middle(results)),
        "confirmation": confirmation_figure(results, made["tracks"]),
        "track_life": life_figure(results, made),
        "false_tracks": false_figure(results, made["tracking"]),
        "track_classes": classes_figure(results, made["track_classes"]),
    }


def middle(results: Sequence[CaseResult[ClutterAxes]]) -> CaseResult:
    """The case in the middle, for figures of one."""
    return results[(len(results) - 1) // 2]


def axis_over(words: str, values) -> Axis:
    """An axis of swept values: logarithmic where they span more than a factor of twenty."""
    least, most = float(np.min(values)), float(np.max(values))
    return Axis(words, "log" if least > 0 and most / least > 20 else "linear")


def swept_over(tracking) -> tuple[str, str] | None:
    """The column that cases differ in most, and its words: density, detection probability or gate; None if in none."""
    values = {column: tracking[column].nunique() for column in KEYS}
    column = max(values, key=values.get)
    return (column, KEYS[column][1]) if values[column] > 1 else None


def lined(tracking, column: str) -> dict[tuple[str, str], str]:
    """What the line is called that a tracker of a case is a point of: the tracker, and what else is swept beside."""
    others = [other for other in KEYS if other != column and tracking[other].nunique() > 1]
    names = {}
    for _, row in tracking.iterrows():
        beside = "".join(f", {KEYS[other][1]} {row[other]:g}" for other in others)
        names[row["case"], row["filter"]] = row["filter"] + beside
    return names


def confirmation_figure(results: Sequence[CaseResult[ClutterAxes]], tracks) -> Figure | None:
    """Probability of a confirmed track by time: a panel for each case, a line for each tracker."""
    groups, drawn = common.groups(tracks, "case", "filter"), []
    for result in results[: panels.MOST]:
        marks = []
        for n, f in enumerate(result.axes.filters):
            rows = groups.get((result.name, f))
            if rows is None:
                continue
            v = [rows[key].to_numpy(dtype=float) for key in ("t_s", "confirmed", "confirmed_lo", "confirmed_hi")]
            known = rows["exact_confirmed"].to_numpy(dtype=float)
            exact = known if np.isfinite(known).any() else None
            marks.append(Line(v[0], v[1], panels.literal(f), Style(n, n, n), v[2], v[3], exact))
            kept = [rows[key].to_numpy(dtype=float) for key in ("kept", "kept_lo", "kept_hi")]
            marks.append(Line(v[0], kept[0], "", Style(n, n, None, 0.7), kept[1], kept[2]))
        if marks:
            keys = (("thin: kept at that time", Style(0, 0, None, 0.7)),) if not drawn else ()
            y = Axis("probability", limits=(0, 1.02))
            panel = Panel(Axis(panels.TIME, limits=(0, None)), y, tuple(marks), _words(result), keys, direct=False)
            drawn.append(panel)
    if not drawn:
        return None
    left = len(results) - panels.MOST
    caption = (
        f"Probability that a track of the target was confirmed by that time, of {panels.realisations(results)}; thin "
        "lines: that a confirmed track is there and on the target. Bands: 95 % intervals. Crosses: exact."
    ) + (f" {left} further cases are in the tables alone." if left > 0 else "")
    return Figure(
        "confirmation", "Probability of a confirmed track", caption, tuple(drawn), min(2, len(drawn)), PAGE_MM
    )


def _words(result: CaseResult[ClutterAxes]) -> str:
    """A case's swept keys as words."""
    names = dict(KEYS.values())
    parts = [f"{names.get(key, panels.symbol_of(key))}: {panels.number(value)}" for key, value in result.swept]
    return ", ".join(parts)


def life_figure(results: Sequence[CaseResult[ClutterAxes]], made: Mapping) -> Figure | None:
    """Track life, time to confirmation, wrong plots and accuracy of the kept tracks over what is swept."""
    tracking = made["tracking"]
    over = swept_over(tracking)
    if over is None:
        return None
    column, words = over
    names = lined(tracking, column)
    shown_rows = tracking.assign(filter=[names[key] for key in zip(tracking["case"], tracking["filter"], strict=True)])
    axis = axis_over(words, tracking[column])
    shown = {
        "life": ("life_s", Axis("track life, s", "log")),
        "time": ("time_to_confirm_s", Axis("time to confirmation, s", limits=(0, None))),
        "wrong": ("wrong_share", Axis("share of wrong plots", limits=(0, None))),
    }
    found = tuple(
        Panel(axis, y, tuple(_lines(shown_rows, column, value, ends)), direct=False)
        for ends, (value, y) in shown.items()
    )
    accuracy = _lines(_at_end(results, made["curves"], tracking, column), column, "sigma", "sigma")
    y = Axis("$\\sigma$ of $r$ of kept tracks, m", limits=(0, None))
    found += (Panel(axis, y, tuple(accuracy), direct=False),)
    caption = (
        "Mean time between ends of a confirmed track (no point: no end was seen), mean time to its confirmation, "
        "weight of false plots among those taken, and root-mean-square error of the range of the tracks kept at the "
        f"end, of {panels.realisations(results)}. Bands: 95 % intervals."
    )
    return Figure("track_life", "Track life and accuracy", caption, found, 2, PAGE_MM, 58)


def _at_end(results: Sequence[CaseResult[ClutterAxes]], curves, tracking, column: str):
    """Rows of the range's σ at the last scan, with the swept value and the line of their case."""
    rows = curves[(curves["component"] == "r") & (curves["k"] == results[0].axes.k[-1])]
    at = tracking.groupby("case")[column].first()
    beside = {case: name.removeprefix(f) for (case, f), name in lined(tracking, column).items()}
    names = [f + beside[case] for case, f in zip(rows["case"], rows["filter"], strict=True)]
    return rows.assign(**{column: rows["case"].map(at), "filter": names})


def _lines(table, x: str, value: str, ends: str) -> list[Line]:
    """A line for each filter of a table's value over x, where it is finite, an infinite end of an interval left out."""
    lines = []
    for n, (name, rows) in enumerate(table.groupby("filter", sort=False)):
        rows = rows[np.isfinite(rows[value])].sort_values(x)
        y, lo, hi = (rows[key].to_numpy(dtype=float) for key in (value, f"{ends}_lo", f"{ends}_hi"))
        lo, hi = np.where(np.isfinite(lo), lo, y), np.where(np.isfinite(hi), hi, y)
        lines.append(Line(rows[x].to_numpy(dtype=float), y, panels.literal(name), Style(n, n, n), lo, hi))
    return lines


def false_figure(results: Sequence[CaseResult[ClutterAxes]], tracking) -> Figure | None:
    """False tracks an hour over what is swept, on a logarithmic axis."""
    over = swept_over(tracking)
    rows = tracking[tracking["false_tracks_per_hour"] > 0]
    if over is None or rows.empty:
        return None
    column, words = over
    names, rules = lined(tracking, column), {}
    for _, row in rows.iterrows():
        rules[names[row["case"], row["filter"]]] = f"{row['m']:.0f} of {row['of']:.0f}"
    rows = rows.assign(filter=[names[key] for key in zip(rows["case"], rows["filter"], strict=True)])
    lines = [Line(m.x, m.y, m.label, m.style, np.maximum(m.lo, m.y / 10), m.hi) for m in _lines(rows, column, *FALSE)]
    lines = [Line(m.x, m.y, f"{m.label} ({rules[m.label]})", m.style, m.lo, m.hi) for m in lines]
    caption = (
        "False tracks confirmed in an hour in the whole sector, every false plot beginning a tentative track, of "
        f"{panels.realisations(results)} such plots a case. Bands: 95 % intervals."
    )
    panel = Panel(axis_over(words, rows[column]), Axis("false tracks per hour", "log"), tuple(lines), direct=False)
    return Figure("false_tracks", "False tracks", caption, (panel,), width_mm=WIDE)


FALSE = ("false_tracks_per_hour", "false")


def classes_figure(results: Sequence[CaseResult[ClutterAxes]], classes) -> Figure | None:
    """Error rates of the class by score, over its threshold, of one case."""
    case = middle(results)
    table = classes[(classes["case"] == case.name) & (classes["n_false"] > 0)]
    if table.empty:
        return None
    drawn = []
    for value, ends, words, scale in (
        ("false_called_true", "false", "false tracks called true", "log"),
        ("true_called_false", "true", "target's tracks called false", "linear"),
    ):
        rows = table[table[value] > 0] if scale == "log" else table
        marks = [Line(m.x, m.y, m.label, m.style, m.lo, m.hi) for m in _lines(rows, "threshold", value, ends)]
        if value == "false_called_true" and marks:
            longest = max(marks, key=lambda m: len(m.x))
            marks.append(Line(longest.x, np.exp(-longest.x), "bound", Style(7, 1, None)))
        if marks:
            x = Axis("threshold of the score")
            y = Axis(f"share of {words}", scale, (None, None) if scale == "log" else (0, None))
            drawn.append(Panel(x, y, tuple(marks), direct=False))
    caption = (
        "Error rates of calling a track true once its score (logarithm of the likelihood ratio) reaches a threshold, "
        f"of {panels.realisations(results)} tracks each. Left: of tracks that false plots began; no more than "
        "exp(−threshold) of them can (bound). Right: of the target's first tracks. Bands: 95 % intervals."
        + (f" Case: {_words(case)}." if case.swept else "")
    )
    return Figure("track_classes", "True or false by the score", caption, tuple(drawn), 2, PAGE_MM) if drawn else None


def map_figure(result: CaseResult[ClutterAxes]) -> Figure | None:
    """Plots, gates and tracks of realisation 0 of a case, on the map."""
    seen = realisation_map(result)
    km = 1e-3
    marks = [
        Line(seen.false[1] * km, seen.false[0] * km, "false plots", Style(7, None, 0, 1.1, 1.0)),
        Line(seen.truth[1] * km, seen.truth[0] * km, "target", Style(1, 1, None)),
        Line(seen.plots[1] * km, seen.plots[0] * km, "its plots", Style(1, None, 1, 1.1, 2.0)),
    ]
    for n, (x, y) in enumerate(seen.tracks):
        marks.append(Line(y * km, x * km, "tracks" if n == 0 else "", Style(2, 0, None, 1.3)))
    for n, (x, y) in enumerate(seen.gates):
        marks.append(Line(y * km, x * km, "gates" if n == 0 else "", Style(3, 0, None, 0.6)))
    (south, north), (west, east) = seen.window
    caption = (
        f"Realisation 0 of {result.name}, tracker {seen.tracker}: the target's course and plots, the false plots of "
        f"all {len(result.axes.k)} scans, the confirmed tracks and their gates at every fourth scan, near the target."
    )
    panel = Panel(
        Axis("way east, km", limits=(west * km, east * km)),
        Axis("way north, km", limits=(south * km, north * km)),
        tuple(marks),
        direct=False,
        legend="right",
    )
    return Figure("track_map", "Plots, gates and tracks", caption, (panel,), width_mm=WIDE, panel_height_mm=100)
