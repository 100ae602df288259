"""Figures of tracks over recorded plots: plan view, estimates, residuals, innovations, probabilities."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.language.translate import tr
from radarsim.recordings.positions import PlotPositions
from radarsim.recordings.tracking_result import TrackingResult
from radarsim.report import case_selection, coinciding_lines, key_labels
from radarsim.report.drawing.model import COLUMN_MM, GREY, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.statistics import Z95, normalised_bounds
from radarsim.studies.recording_interface import Track

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


def track_figures(followed: TrackingResult) -> dict[str, Figure]:
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
    return {
        name: coinciding_lines.join_coinciding_lines(figure) for name, figure in figures.items() if figure is not None
    }


def _track_label(name: object) -> str:
    return tr("track {number}", number=name)


def _filter_keys(track: Track) -> list[tuple[str, Style]]:
    return [(key_labels.escape_dollars(name), Style(f, f)) for f, name in enumerate(track.filters[:MAX_FILTERS])]


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
    view = _PlanView(paths, styles, [_track_label(key_labels.escape_dollars(name)) for name in positions], unit, unit_m)
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


def estimate_figure(track: Track) -> Figure:
    """A panel for each component: the filters' estimates with their standard deviations, and the plots."""
    figure_panels = []
    for c in range(len(track.components)):
        plots = _plots_of_component(track, c)
        marks = [*([plots] if plots else []), *_estimate_lines(track, c)]
        if marks:
            component, component_unit = track.components[c]
            factor, unit = key_labels.degrees_factor_and_unit(component_unit)
            limits = _usual_limits(factor * track.estimate[..., c])
            y = Axis(key_labels.label_with_unit(key_labels.component_symbol(component), unit), limits=limits)
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
    factor, _ = key_labels.degrees_factor_and_unit(track.components[c][1])
    plots = track.residual[..., d] + track.estimate[..., c]  # the same for every filter that has an estimate
    first_filter, has_plot = np.isfinite(plots).argmax(axis=0), np.isfinite(plots).any(axis=0)
    plots = plots[first_filter, np.arange(plots.shape[1])]
    return Line(track.t_s[has_plot], factor * plots[has_plot], "", PLOT_STYLE, name=tr("plots"))


def _estimate_lines(track: Track, c: int) -> list[Line]:
    factor, _ = key_labels.degrees_factor_and_unit(track.components[c][1])
    lines = []
    for f, name in enumerate(track.filters[:MAX_FILTERS]):
        x, half = factor * track.estimate[f, :, c], factor * Z95 * track.sigma[f, :, c]
        if np.isfinite(x).any():
            lines.append(Line(track.t_s, x, "", Style(f, f), x - half, x + half, name=key_labels.escape_dollars(name)))
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
    factor, unit = key_labels.degrees_factor_and_unit(measured_unit)
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
    axis = Axis(key_labels.label_with_unit(label, unit), limits=_usual_limits(residuals))
    return Panel(_time_axis(), axis, tuple(marks), key_labels.escape_dollars(track.filters[f]), direct=False)


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
        lines.append(Line(t, mean, "", Style(f, f), name=key_labels.escape_dollars(filter_name)))
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
    return Panel(_time_axis(), y, (Reference(1.0), *lines, *bounds), key_labels.escape_dollars(name), direct=False)


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
            figure_panels.append(Panel(_time_axis(), y, marks, key_labels.escape_dollars(name), direct=False))
    if not figure_panels:
        return None
    caption = tr("Probabilities of each filter's models, in the order of the config.")
    title = tr("Probabilities of the models")
    return _figure_of_panels("probabilities", title, caption, figure_panels[: case_selection.MAX_CASES])
