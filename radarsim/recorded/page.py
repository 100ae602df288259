"""The report of tracks over recorded plots: figures, tables and sentences on one self-contained page.

The filters' own innovations decide whether the configured accuracies fit. For a consistent filter the squares of the
innovations, divided by their predicted variance, average 1 for each degree of freedom (NIS). A larger average means
that the plots are worse than configured, or that the target manoeuvres more than the filter assumes; a smaller one
means that the plots are better."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.document import SHIPPED
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.language import few, listed, plural, power_of_ten, term, tr
from radarsim.recorded import fit
from radarsim.recorded.fit import Advice, FilterComparison, Finding, UsedRows
from radarsim.recorded.follow import Followed, InnovationTally, recording_interface
from radarsim.recorded.plots import PlotPositions
from radarsim.report import panels
from radarsim.report.drawing import COLUMN_MM, GREY, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.statistics import Z95, normalised_bounds
from radarsim.report.wording import labelled, number, significant_digits
from radarsim.report.wording import unit as unit_of
from radarsim.studies.interface import BIAS, CORRELATION, OUTLIERS, Turning

# ---- figures ---------------------------------------------------------------------------------------------------------
PLOT_STYLE = Style(GREY, None, 0, size_pt=1.6)
BOUND_STYLE = Style(GREY, 1, width_pt=0.8)
RADAR_STYLE = Style(0, None, 2, size_pt=5.0)
MAX_FILTERS = 8
MAX_COLOURED_TRACKS = 8  # further tracks are grey
MAX_RESIDUAL_PANELS = 9
MAX_DOTS = 300  # of a filter in a panel of residuals
NIS_WINDOW = 15  # innovations in a mean over time
PLAN_PANEL_MM, PANEL_MM = 74.0, 52.0  # height of a panel: of a plan view, of others
NIS_TICKS = (0.01, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, 1000.0)
KILOMETRES_FROM_M = 2e4  # a plan view that reaches this far has an axis in km


def track_figures(followed: Followed) -> dict[str, Figure]:
    """The available figures by name: `track`, `plan`, `residuals`, `nis` and `probabilities`.

    With several tracks, the plan view shows the plots of all, and every other figure the longest track."""
    positions = {name: result.positions for name, result in followed.tracks.items()} or {"": followed.positions}
    longest_first = sorted(positions, key=lambda name: positions[name] is not followed.positions)
    track = followed.figure_track
    assert track is not None  # a file without rows is refused
    figures = {
        "track": estimate_figure(track),
        "plan": plan_figure(track, {name: positions[name] for name in longest_first}),
        "residuals": residual_figure(track),
        "nis": innovation_figure(track),
        "probabilities": probability_figure(track),
    }
    return {name: panels.joined(figure) for name, figure in figures.items() if figure is not None}


def _track_label(name: object) -> str:
    return tr("track {number}", number=name)


def _filter_keys(track: Track) -> list[tuple[str, Style]]:
    return [(panels.literal(name), Style(f, f)) for f, name in enumerate(track.filters[:MAX_FILTERS])]


def _time_axis() -> Axis:
    return Axis(tr("time, s"))


def _figure_of_panels(
    name: str, title: str, caption: str, figure_panels: list[Panel], keys: Sequence[tuple[str, Style]] = ()
) -> Figure:
    """A figure of panels; with keys, its legend takes a cell of its own."""
    if keys:
        figure_panels = [*figure_panels, Panel(_time_axis(), _time_axis(), (), keys=tuple(keys))]
    columns = min(2 if len(figure_panels) == 4 else 3, len(figure_panels))
    width = PAGE_MM if columns > 1 else COLUMN_MM
    return Figure(name, title, caption, tuple(figure_panels), columns, width, PANEL_MM)


def _usual_limits(values: np.ndarray) -> tuple[float | None, float | None]:
    """Axis limits: the range of 99 % of the values and 30 % more, so that the start does not dominate."""
    finite = values[np.isfinite(values)]
    if finite.size < 50:
        return None, None
    low, high = np.quantile(finite, [0.005, 0.995])
    margin = 0.3 * (high - low)
    return (float(low - margin), float(high + margin)) if margin else (None, None)


# ---- where ----------------------------------------------------------------------------------------------------------
class _PlanView(NamedTuple):
    """Positions of tracks to draw, their styles and legend entries, and the unit and its size in m."""

    paths: list[PlotPositions]
    styles: list[Style]
    labels: list[str]
    unit: str
    unit_m: float


def plan_figure(track: Track, positions: Mapping[str, PlotPositions]) -> Figure | None:
    """Plan view with equal units and the radar at the origin, and the range over time; None if no range is known."""
    paths = [path for path in _drawable_paths(track, positions) if len(path.t_s)]
    if not paths:
        return None
    farthest = np.nanmax(np.abs(np.concatenate([path.positions for path in paths])))
    unit, unit_m = ("km", 1e3) if farthest > KILOMETRES_FROM_M else ("m", 1.0)
    styles = [Style(i if i < MAX_COLOURED_TRACKS else GREY, None, 0, size_pt=1.6) for i in range(len(paths))]
    view = _PlanView(paths, styles, [_track_label(panels.literal(name)) for name in positions], unit, unit_m)
    has_plan = np.isfinite(np.concatenate([path.positions[:, :2] for path in paths])).all(axis=1).any()
    end_labels = _end_labels(paths[0], unit_m) if has_plan else []
    figure_panels = [_plan_panel(view, end_labels), _range_panel(view)] if has_plan else [_range_panel(view)]
    if len(paths) > 1:
        figure_panels.append(_plan_legend(view))
    columns = min(len(figure_panels), 2)
    width = PAGE_MM if columns > 1 else COLUMN_MM
    caption = _plan_caption(bool(has_plan), bool(end_labels))
    return Figure("plan", tr("Positions"), caption, tuple(figure_panels), columns, width, PLAN_PANEL_MM)


def _plot_names(view: _PlanView) -> list[str]:
    """The names of the points of each path: of its track, if there are several."""
    return view.labels if len(view.paths) > 1 else [tr("plots")]


def _range_panel(view: _PlanView) -> Panel:
    lines = [
        Line(path.t_s, path.positions[:, 2] / view.unit_m, "", style, name=name)
        for path, style, name in zip(view.paths, view.styles, _plot_names(view), strict=False)
    ]
    return Panel(_time_axis(), Axis(tr("range, {unit}", unit=view.unit)), tuple(lines), tr("Range"), direct=False)


def _plan_panel(view: _PlanView, end_labels: list) -> Panel:
    marks: list = [
        Line(path.positions[:, 1] / view.unit_m, path.positions[:, 0] / view.unit_m, "", style, name=name)
        for path, style, name in zip(view.paths, view.styles, _plot_names(view), strict=False)
    ]
    marks.append(Line(np.zeros(1), np.zeros(1), "", RADAR_STYLE, name=tr("radar")))
    east, north = Axis(tr("east, {unit}", unit=view.unit)), Axis(tr("north, {unit}", unit=view.unit))
    return Panel(east, north, (*marks, *end_labels), tr("Plan view"), direct=False, equal=True)


def _plan_legend(view: _PlanView) -> Panel:
    """An empty panel with the legend: the radar, the coloured tracks, and how many are grey."""
    keys = list(zip(view.labels[:MAX_COLOURED_TRACKS], view.styles, strict=False))
    if len(view.paths) > MAX_COLOURED_TRACKS:
        keys.append((tr("{count} more", count=len(view.paths) - MAX_COLOURED_TRACKS), view.styles[-1]))
    return Panel(_time_axis(), _time_axis(), (), keys=((tr("radar"), RADAR_STYLE), *keys))


def _plan_caption(has_plan: bool, has_ends: bool) -> str:
    if not has_plan:
        return tr("The range of the plots over time; the file does not give their bearing.")
    caption = tr("Positions of the plots. Triangle: the radar.")
    caption += " " + tr("Start and end of the longest track with their times.") if has_ends else ""
    return caption + " " + tr("Where a file has no heights, slant range replaces ground range.")


def _drawable_paths(track: Track, positions: Mapping[str, PlotPositions]) -> list[PlotPositions]:
    """The positions of the plots of each track.

    If a single track has antenna angles instead of bearings, its plots are computed from estimates and residuals."""
    names = [name for name, _ in track.components]
    if len(positions) == 1 and {"x", "y", "z"} <= set(names) and track.residual is not None:
        (path,) = positions.values()
        if not np.isfinite(path.positions[:, :2]).any():
            plots = track.estimate[..., [names.index(axis) for axis in "xyz"]] + track.residual
            f = int(np.isfinite(plots).all(axis=2).sum(axis=1).argmax())
            is_complete = np.isfinite(plots[f]).all(axis=1)
            x, y, z = plots[f, is_complete].T
            return [PlotPositions(track.t_s[is_complete], np.stack([x, z, np.sqrt(x**2 + y**2 + z**2)], axis=1))]
    return list(positions.values())


def _end_labels(path: PlotPositions, unit_m: float) -> list:
    """Labels at the first and the last position of a track, on the side away from the track.

    Plots that share a time, as false ones do, are no track and get no labels."""
    placed = np.flatnonzero(np.isfinite(path.positions[:, :2]).all(axis=1))
    if not placed.size or (np.diff(path.t_s[placed]) == 0).any():
        return []
    third = max(len(placed) // 3, 1)  # the direction at an end is that of the nearest third
    start = (placed[0], placed[min(third, len(placed) - 1)], tr("start"))
    labels = []
    for i, inner, title in (start, (placed[-1], placed[-third], tr("end"))):
        north, east = path.positions[i, :2] - path.positions[inner, :2]
        side = ("s" if north >= 0 else "n") + ("e" if east >= 0 else "w")
        text = tr("{what}, {t_s:g} s", what=title, t_s=path.t_s[i])
        labels.append(Note(path.positions[i, 1] / unit_m, path.positions[i, 0] / unit_m, text, side))
    return labels


# ---- estimates and their errors --------------------------------------------------------------------------------------
def estimate_figure(track: Track) -> Figure:
    """A panel for each component: the filters' estimates with their standard deviations, and the plots."""
    figure_panels = []
    for c in range(len(track.components)):
        plots = _plots_of_component(track, c)
        marks = [*([plots] if plots else []), *_estimate_lines(track, c)]
        if marks:
            component, component_unit = track.components[c]
            factor, unit = panels.in_degrees(component_unit)
            limits = _usual_limits(factor * track.estimate[..., c])
            y = Axis(panels.with_unit(panels.letter(component), unit), limits=limits)
            figure_panels.append(Panel(_time_axis(), y, tuple(marks), direct=False))
    caption = tr(
        "Estimates over the recorded plots; bands: twice each filter's own standard deviation (95 % if "
        "the filter is consistent)."
    )
    keys = [(tr("plots"), PLOT_STYLE), *_filter_keys(track)]
    return _figure_of_panels("track", tr("Track"), caption, figure_panels, keys)


def _plots_of_component(track: Track, c: int) -> Line | None:
    """The plots in component c: residual plus estimate; None if c is a rate or is not measured."""
    components_per_number = max(1, len(track.components) // max(1, len(track.measured)))
    d, derivative = divmod(c, components_per_number)
    if track.residual is None or derivative or d >= len(track.measured):
        return None
    factor, _ = panels.in_degrees(track.components[c][1])
    plots = track.residual[..., d] + track.estimate[..., c]  # the same for every filter that has an estimate
    first_filter, has_plot = np.isfinite(plots).argmax(axis=0), np.isfinite(plots).any(axis=0)
    plots = plots[first_filter, np.arange(plots.shape[1])]
    return Line(track.t_s[has_plot], factor * plots[has_plot], "", PLOT_STYLE, name=tr("plots"))


def _estimate_lines(track: Track, c: int) -> list[Line]:
    factor, _ = panels.in_degrees(track.components[c][1])
    lines = []
    for f, name in enumerate(track.filters[:MAX_FILTERS]):
        x, half = factor * track.estimate[f, :, c], factor * Z95 * track.sigma[f, :, c]
        if np.isfinite(x).any():
            lines.append(Line(track.t_s, x, "", Style(f, f), x - half, x + half, name=panels.literal(name)))
    return lines


def residual_figure(track: Track) -> Figure | None:
    """Plot minus estimate between its ± 2 σ bounds, a panel for each filter and each measured number."""
    if track.residual is None:
        return None
    filter_count = max(MAX_RESIDUAL_PANELS // len(track.measured), 1)
    candidates = [
        _residual_panel(track, f, d)
        for f in range(min(filter_count, len(track.filters)))
        for d in range(len(track.measured))
    ]
    figure_panels = [panel for panel in candidates if panel is not None]
    caption = tr(
        "Difference of each plot from the estimate after it. Dashed: twice the filter's own standard "
        "deviation of that difference; 95 % of the plots lie between if the filter is consistent."
    )
    if (filters := len(track.filters)) > filter_count:
        caption += tr(" The first {fitting} of {filters} filters are drawn.", fitting=filter_count, filters=filters)
    return _figure_of_panels("residuals", tr("Residuals"), caption, figure_panels) if figure_panels else None


def _residual_panel(track: Track, f: int, d: int) -> Panel | None:
    """The residuals of filter f in the measured number d; None if it has none."""
    assert track.residual is not None  # residual_figure has checked it
    name, measured_unit = track.measured[d]
    factor, unit = panels.in_degrees(measured_unit)
    rows = np.flatnonzero(np.isfinite(track.residual[f, :, d]))
    if not rows.size:
        return None
    rows = rows[:: -(-rows.size // MAX_DOTS)]
    t, residuals = track.t_s[rows], factor * track.residual[f, rows, d]
    marks: list = [Reference(0.0), Line(t, residuals, "", Style(f, None, 0, size_pt=1.8), name=tr("plots"))]
    if track.residual_sigma is not None and np.isfinite(track.residual_sigma[f, rows, d]).any():
        bound = 2 * factor * track.residual_sigma[f, rows, d]
        marks += [Line(t, bound, "", BOUND_STYLE, name="± 2 σ"), Line(t, -bound, "", BOUND_STYLE, name="± 2 σ")]
    label = tr("residual of {measured}", measured=name.rpartition("_")[0])
    axis = Axis(panels.with_unit(label, unit), limits=_usual_limits(residuals))
    return Panel(_time_axis(), axis, tuple(marks), panels.literal(track.filters[f]), direct=False)


def innovation_figure(track: Track) -> Figure | None:
    """The mean of the normalised innovations squared over the last NIS_WINDOW plots, a panel for each test."""
    if track.nis is None:
        return None
    candidates = [_innovation_panel(track, q) for q in range(len(track.tested))]
    figure_panels = [panel for panel in candidates if panel is not None]
    caption = tr(
        "Normalised innovation squared, averaged over {window} plots: 1 for a consistent filter, whose "
        "averages lie between the dashed bounds in 95 % of cases. Above: plots worse than stated, or a "
        "manoeuvre.",
        window=NIS_WINDOW,
    )
    keys = [*_filter_keys(track), (tr("bounds"), BOUND_STYLE)]
    return _figure_of_panels("nis", tr("Innovations"), caption, figure_panels, keys) if figure_panels else None


def _innovation_panel(track: Track, q: int) -> Panel | None:
    """The running means of test q; None if no filter has enough innovations."""
    assert track.nis is not None  # innovation_figure has checked it
    name, freedom = track.tested[q]
    lines: list[Line] = []
    for f, filter_name in enumerate(track.filters[:MAX_FILTERS]):
        rows = np.flatnonzero(np.isfinite(track.nis[f, :, q]))
        if len(rows) < NIS_WINDOW:
            continue
        sums = np.cumsum(np.append(0.0, track.nis[f, rows, q])) / (NIS_WINDOW * freedom)
        t, mean = track.t_s[rows[NIS_WINDOW - 1 :]], sums[NIS_WINDOW:] - sums[:-NIS_WINDOW]
        lines.append(Line(t, mean, "", Style(f, f), name=panels.literal(filter_name)))
    if not lines:
        return None
    time_range = np.array([lines[0].x[0], max(line.x[-1] for line in lines)])
    bounds = [
        Line(time_range, np.full(2, value), "", BOUND_STYLE, name=tr("bounds"))
        for value in normalised_bounds(NIS_WINDOW * freedom)
    ]
    values = np.concatenate([line.y for line in (*lines, *bounds)])
    ticks = tuple((tick, f"{tick:g}") for tick in NIS_TICKS if values.min() <= tick <= values.max())
    y = Axis(tr("mean NIS"), "log", ticks=ticks)
    return Panel(_time_axis(), y, (Reference(1.0), *lines, *bounds), panels.literal(name), direct=False)


def probability_figure(track: Track) -> Figure | None:
    """Probabilities of the models, a panel for each multiple-model filter."""
    if track.probability is None:
        return None
    figure_panels = []
    for f, name in enumerate(track.filters):
        has_model = np.isfinite(track.probability[f]).any(axis=0)
        if has_model.sum() > 1:
            marks = tuple(
                Line(track.t_s, track.probability[f, :, m], tr("model {number}", number=m + 1), Style(m, m))
                for m in np.flatnonzero(has_model).tolist()
            )
            y = Axis(tr("probability"), limits=(0, 1))
            figure_panels.append(Panel(_time_axis(), y, marks, panels.literal(name), direct=False))
    if not figure_panels:
        return None
    caption = tr("Probabilities of each filter's models, in the order of the config.")
    title = tr("Probabilities of the models")
    return _figure_of_panels("probabilities", title, caption, figure_panels[: panels.MOST])


# ---- accuracy --------------------------------------------------------------------------------------------------------
MIN_TESTS = 10  # with fewer tests there is no verdict
FITS, TOO_SMALL, TOO_LARGE = term("fits"), term("too small"), term("too large")
TOO_FEW_PLOTS, FOLD_LOST, MAYBE_TOO_SMALL = term("too few plots"), term("fold lost"), term("too small?")


@dataclass(frozen=True)
class Judged:
    """The test of a filter's innovations in one measured number: its mean NIS, the bounds of that for a consistent
    filter, and the verdict on the configured σ."""

    filter: str
    name: str
    tests: int
    nis: float
    lo: float
    hi: float
    verdict: str


def judged(followed: Followed) -> list[Judged]:
    """The tests of all filters."""
    all_tests = [_test_innovations(tally) for tally in followed.tallies.values()]
    return [replace(test, verdict=_verdict_with_folds(followed.case, test, all_tests)) for test in all_tests]


def _test_innovations(tally: InnovationTally) -> Judged:
    """The verdict at 95 %."""
    lo, hi = map(float, normalised_bounds(max(tally.count * tally.freedom, 1)))
    verdict = TOO_SMALL if tally.mean > hi else TOO_LARGE if tally.mean < lo else FITS
    if tally.count < MIN_TESTS:
        verdict = TOO_FEW_PLOTS
    return Judged(tally.filter, tally.name, tally.count, tally.mean, lo, hi, verdict)


def _verdict_with_folds(case: Case, test: Judged, all_tests: Sequence[Judged]) -> str:
    """The verdict of a test; a filter that unfolds velocities by itself may have chosen a wrong fold, which shows where
    another filter fits the same plots."""
    interface = recording_interface(case)
    unfolding_filters = {member.name for member in case.spec.members if interface.unfolds(member)}
    if test.verdict != TOO_SMALL or test.filter not in unfolding_filters:
        return test.verdict
    fits_elsewhere = any(
        test_of_filter.name == test.name and test_of_filter.verdict in (FITS, TOO_LARGE) for test_of_filter in all_tests
    )
    return FOLD_LOST if fits_elsewhere else MAYBE_TOO_SMALL


# ---- words -----------------------------------------------------------------------------------------------------------
MAX_RATIO_POWER = 6  # a larger power of ten of a ratio of likelihoods says no more than that one model is wrong
EQUAL_FILTERS_GAIN = 1e-6  # difference of the log-likelihood below which two filters are the same
CLEAR_GAIN = 3.0  # difference of the log-likelihood, a factor of twenty, from which one filter is clearly the best


class Statement(NamedTuple):
    """A line for the user: its label, '' if it continues the line above, and its text."""

    label: str
    text: str


def _terminal_lines(statements: Sequence[Statement]) -> list[str]:
    return [labelled(*statement) for statement in statements]


def verdict(followed: Followed, judged: Sequence[Judged], advised: Advice | None) -> list[str]:
    """Lines with the best filter and the changes advised, by the likelihood; without one, the consistent filters."""
    return _terminal_lines(answer_statements(followed, judged, advised))


def answer_statements(followed: Followed, tests: Sequence[Judged], advice: Advice | None) -> list[Statement]:
    """The best filter and the changes advised, by the likelihood; without one, the consistent filters."""
    return consistent_filters(tests) if advice is None else advice_statements(followed, advice)


def rows(followed: Followed) -> list[str]:
    """Lines with the numbers of rows and tracks, the time covered, missing values, and gaps."""
    return _terminal_lines(plot_statements(followed))


def plot_statements(followed: Followed) -> list[Statement]:
    """The numbers of rows and tracks, the time covered, missing values, and gaps."""
    statements = [*_row_statements(followed), *_missing_statements(followed)]
    if names := followed.filters_without_estimate:
        text = tr("{names}: no estimate from these plots", names=few(names, len(names)))
        statements.append(Statement("no rows", text))
    if names := followed.filters_without_test:
        text = tr("{names}: no innovation with a covariance, so no test", names=few(names, len(names)))
        statements.append(Statement("untested", text))
    if followed.gaps:
        text = tr(
            "{count} longer than three times the usual interval of {usual:g} s; the longest {longest:g} s, "
            "after {at:g} s",
            count=followed.gaps,
            usual=followed.median_s,
            longest=followed.longest_gap_s,
            at=followed.longest_gap_at_s,
        )
        statements.append(Statement("gaps", text))
    return statements


def _row_statements(followed: Followed) -> list[Statement]:
    """How many rows there are, of how many tracks, and which were not used."""
    span, first = followed.last_s - followed.first_s, followed.first_s
    row_count = counted(followed.rows)
    text = tr("{rows} over {span:g} s, from {first:g} s", rows=row_count, span=span, first=first)
    statements = [Statement("plots", text)]
    if followed.tracks:
        longest = counted(max(result.rows for result in followed.tracks.values()))
        text = tr("{count}, the longest of {rows}", count=len(followed.tracks), rows=longest)
        statements.append(Statement("tracks", text))
    if followed.trackless_rows:
        text = tr("{rows} outside any track", rows=counted(followed.trackless_rows))
        statements.append(Statement("passed", text))
    if followed.reused_numbers:
        numbers = plural("{count} track number", "{count} track numbers", followed.reused_numbers)
        text = tr("{numbers} used again after a gap: each begins a new track", numbers=numbers)
        statements.append(Statement("again", text))
    if followed.doubles:
        plots = plural("{count} plot", "{count} plots", followed.doubles)
        text = tr("{plots} left out: the same scan has one nearer to the track", plots=plots)
        statements.append(Statement("doubles", text))
    return statements


def _missing_statements(followed: Followed) -> list[Statement]:
    """The missing values of each column, and the filters whose columns the file has not."""
    counts = [tr("{count} of {name}", count=count, name=name) for name, count in followed.missing.items() if count]
    statements = [Statement("missing", ", ".join(counts))] if counts else []
    for name, columns in followed.filters_without_plots.items():
        fields = {"name": name, "columns": listed(columns)}
        text = tr("{name} used no plot, because it needs {columns}: predictions only", **fields)
        statements.append(Statement("missing", text))
    return statements


def counted(rows: int) -> str:
    """1 row, 2 rows."""
    return plural("{count} row", "{count} rows", rows)


def errors(followed: Followed) -> list[dict[str, Any]]:
    """A table of the filters' errors, where the file has the truth: a row each, by column."""
    columns = ("filter", "component", "RMS error", "unit", "of own σ", "estimates")
    table = [
        (sums.filter, sums.component, sums.rms, tr(unit_of(sums.unit)), sums.ratio, sums.count)
        for sums in followed.errors.values()
        if sums.count
    ]
    return [dict(zip(columns, row, strict=True)) for row in table]


ERRORS, TESTS = (term("Errors against the truth"), term("Innovations (NIS of a consistent filter: 1)"))
VERDICT_MEANINGS = {
    TOO_SMALL: term(
        "the plots are less accurate than stated, or the target manoeuvres harder than the filter allows for"
    ),
    TOO_LARGE: term("the plots are more accurate than stated, or the filter allows for harder manoeuvres than occur"),
    FOLD_LOST: term("the velocity is unfolded by a wrong number of spans; other filters fit the same plots"),
    MAYBE_TOO_SMALL: term("a wrong fold, plots less accurate than stated, or harder manoeuvres than allowed for"),
}


def tests(judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """A table of the tests of the innovations: a row each, by column."""
    columns = ("filter", "number", "plots", "NIS", "95 % from", "95 % to", "stated σ")
    table = [
        (test.filter, test.name, test.tests, test.nis, test.lo, test.hi, tr(test.verdict))
        for test in judged
        if test.tests
    ]
    return [dict(zip(columns, row, strict=True)) for row in table]


NUMBERS = {  # the columns of numbers in these tables, and their formats
    **{"RMS error": "#.4g", "of own σ": "#.3g", "estimates": ".0f"},
    **{"plots": ".0f", "NIS": ".3g", "95 % from": ".3g", "95 % to": ".3g"},
}


def findings(judged: Sequence[Judged]) -> list[str]:
    """The meaning of the verdicts that occur."""
    verdicts = {test.verdict for test in judged if test.tests}
    return [f"{tr(verdict)}: {tr(meaning)}" for verdict, meaning in VERDICT_MEANINGS.items() if verdict in verdicts]


def consistent_filters(tests: Sequence[Judged]) -> list[Statement]:
    """The filters that are consistent in all their tests, unless all are."""
    verdicts: dict[str, set[str]] = {}
    for test in tests:
        verdicts.setdefault(test.filter, set()).add(test.verdict)
    names = [name for name, own_verdicts in verdicts.items() if own_verdicts == {FITS}]
    text = tr("{names}: consistent in all tests", names=few(names, len(names)))
    return [Statement("", text)] if 0 < len(names) < len(verdicts) else []


def advice_statements(followed: Followed, advice: Advice) -> list[Statement]:
    """The filter that predicts the plots best, and errors in the numbers of the one that takes most columns."""
    comparison, statements = advice.comparison, []
    if len(comparison.log_ratios) > 1 and advice.folding is None:
        statements.append(Statement("best", _best_filter_text(comparison)))
    if advice.folding is not None:
        statements.append(Statement("advice", fit.folding_message(advice.folding, followed.case)))
    elif not advice.findings:
        text = plural(
            "the stated values of {filter} agree with {count} row",
            "the stated values of {filter} agree with {count} rows",
            advice.used_rows.rows,
            filter=comparison.most_columns,
        )
        statements.append(Statement("advice", text))
    for finding in advice.findings:
        statements.append(Statement("advice", finding_text(finding, comparison.most_columns)))
    return [*statements, *_used_rows_statement(followed, advice.used_rows)]


def _best_filter_text(comparison: FilterComparison) -> str:
    """The best filters, and how many times less likely the plots are under the others."""
    gaps = comparison.log_ratios
    best = [name for name, gap in gaps.items() if gap < EQUAL_FILTERS_GAIN or name == comparison.best]
    less_likely = sorted(((name, gap) for name, gap in gaps.items() if name not in best), key=itemgetter(1))
    if not less_likely:
        return few(best, len(best))
    names_by_ratio: dict[str, list[str]] = {}
    for name, gap in less_likely:
        names_by_ratio.setdefault(times(gap), []).append(name)
    ratios = ", ".join(
        tr("{times} times under {name}", times=ratio, name=few(names, len(names)))
        for ratio, names in names_by_ratio.items()
    )
    best_names = few(best, len(best))
    if less_likely[0][1] <= CLEAR_GAIN:
        best_names = tr("{name} (not clearly)", name=best_names)
    return tr("{best}; the plots are less likely under the others: {others}", best=best_names, others=ratios)


def _used_rows_statement(followed: Followed, used_rows: UsedRows) -> list[Statement]:
    """The rows on which best filter and advice rest, unless these are all."""
    if used_rows.rows >= followed.rows:
        return []
    text = tr(
        "from {rows} of {all}, in {stretches} stretches spread over all tracks and the whole time",
        rows=counted(used_rows.rows),
        all=followed.rows,
        stretches=used_rows.stretches,
    )
    return [Statement("", text)]


def times(gain: float) -> str:
    """The likelihood ratio of a difference of logarithms, as text: 12, 10⁵, or over 10⁶."""
    power = gain / math.log(10)
    if power > MAX_RATIO_POWER:
        return tr("over {number}", number=power_of_ten(MAX_RATIO_POWER))
    if round(power) >= 4:
        return power_of_ten(round(power))
    return significant_digits(math.exp(gain), "#.2g" if gain < math.log(99) else ".0f")


def finding_text(finding: Finding, filter_name: str) -> str:
    """An error in the configured numbers, its weight, and the cost of a smaller manoeuvre variance."""
    if finding.from_zero:
        fields = {"what": what(finding.name, finding.value), "times": times(finding.gain)}
        text = tr("{what}; the plots are then {times} times as likely", **fields)
    else:
        text = tr("{key}: the plots cannot distinguish it from zero; that is no reason to lower it", key=finding.name)
    if finding.turning is None:
        return text
    cost = _turn_cost(finding.turning, filter_name)
    if not finding.from_zero:
        cost = tr("at {value} {cost}", value=number(finding.value, 2), cost=cost)
    return f"{text}; {cost}"


def _turn_cost(turn: Turning, filter_name: str) -> str:
    """The largest error in a turn with a changed value, and that with the configured one."""
    return tr(
        "in a turn of {load:g} g without missed plots the largest error of {filter} in {component} would be {changed}, "
        "not {stated} {unit}",
        load=turn.acceleration_g,
        filter=filter_name,
        component=turn.component,
        changed=number(turn.changed, 3),
        stated=number(turn.stated, 3),
        unit=tr(unit_of(turn.unit)),
    )


def what(name: str, value: float) -> str:
    """The text of an explanation: a key with its value, or one of EXPLANATIONS."""
    if name == OUTLIERS:
        share = significant_digits(100 * value, "#.2g")
        return tr("outliers: {share} % of the plots have errors of ten times their σ", share=share)
    if name == BIAS:
        size = significant_digits(value, "#.3g")
        return tr("the measured velocities have a common bias of {size} of their σ", size=size)
    if name == CORRELATION:
        size = significant_digits(value, "#.2g")
        return tr("errors persist from plot to plot: the correlation of neighbours is {size}", size=size)
    return f"--set {name}={value:.3g}"


# ---- page ------------------------------------------------------------------------------------------------------------
NAME = "report.html"


@np.errstate(all="ignore")  # of a filter that diverged
def write(
    followed: Followed,
    experiment: Experiment,
    source: str | os.PathLike,
    judged: Sequence[Judged],
    advised: Advice | None,
    folder: str | os.PathLike,
) -> list[str]:
    """Write the page and `figures/` into a folder, and return the names of the figures.

    Raises StoreError, or, with nothing written, ConfigError where a file would overwrite the plots or the config."""
    from radarsim.report import files, html
    from radarsim.report.figures import draw

    source_name = os.path.basename(os.fspath(source))
    drawings = {name: draw(figure) for name, figure in track_figures(followed).items()}
    page = html.track_page(
        experiment.stem,
        source_name,
        _sentences(answer_statements(followed, judged, advised)) or [_no_answer_reason(followed)],
        _sentences(plot_statements(followed)),
        list(drawings.values()),
        {tr(ERRORS): errors(followed), tr(TESTS): tests(judged), tr("Tracks"): _track_table(followed)},
        html.config_yaml(experiment.resolved),
        f"radarsim track {_config_argument(experiment)} {source_name}",
    )
    contents = {NAME: page.encode()}
    for name, drawing in drawings.items():
        contents |= {f"figures/{name}.{kind}": data for kind, data in drawing.files.items()}
    for path in (Path(folder, name) for name in contents):
        if any(files.same_file(path, input_file) for input_file in (source, experiment.path) if input_file):
            raise ConfigError(f"{path}: would be overwritten; choose another folder")
    files.replace_all(Path(folder), contents)
    return list(drawings)


def _config_argument(experiment: Experiment) -> str:
    """The config in a command: a shipped one by its name, others by their path."""
    path = experiment.path
    return path if path and not Path(path).is_relative_to(SHIPPED) else experiment.stem


def _no_answer_reason(followed: Followed) -> str:
    """Why the plots do not tell which filter is best."""
    if followed.filters_without_test:
        return tr("The plots do not tell which filter is best: the filters give no innovation with a covariance.")
    return tr("Too few plots to judge the filters by.")


def _sentences(statements: Sequence[Statement]) -> list[str]:
    """Statements as sentences: a label gets a colon, and a statement without one is appended to the previous."""
    sentences: list[str] = []
    for statement in statements:
        label, text = tr(statement.label), statement.text.strip()
        if statement.label:
            sentences.append(f"{label[:1].upper()}{label[1:]}: {text}")
        elif sentences:
            sentences[-1] += f", {text}"
        else:
            sentences.append(text)
    return [f"{sentence}." for sentence in sentences]


def _track_table(followed: Followed) -> list[dict[str, object]]:
    return [
        {"track": name, "rows": result.rows, "from, s": result.first_s, "to, s": result.last_s, "gaps": result.gaps}
        for name, result in followed.tracks.items()
    ]
