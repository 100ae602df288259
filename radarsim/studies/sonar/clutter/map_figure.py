"""The map of one realisation: course, plots, gates and tracks near the target."""

from collections.abc import Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import quote_name, tr
from radarsim.report import key_labels
from radarsim.report.drawing.model import GREY, Axis, Figure, Line, Panel, Style
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.multi_tracker import confirmed_tracks
from radarsim.studies.sonar.clutter.plots import false_plots, target_plots
from radarsim.studies.sonar.clutter.tracker_design import (
    TrackerSpec,
    gate_threshold,
    tracker_specs,
    tracking_conditions,
)
from radarsim.studies.sonar.config import Keys

MAP_MARGIN_M = 1000.0  # around the target's course
GATE_INTERVAL_SCANS = 4  # scans between the gates that the map shows
Curve = tuple[np.ndarray, np.ndarray]  # distances north and east, m


def map_figure(result: CaseResult[ClutterAxes]) -> Figure:
    """A map of realisation 0 of a case near the target's course.

    The course and the target's plots, false plots, and the confirmed tracks and gates of the first tracker that has to
    find its plots."""
    spec, axes = result.spec, result.axes
    z, true = target_plots(axes.world, axes.detections, 0)
    course = _north_east(*true.T)
    (south, north), (west, east) = ((side.min() - MAP_MARGIN_M, side.max() + MAP_MARGIN_M) for side in course)
    scans, (false_north, false_east) = _plots_within(axes, z, (south, north), (west, east))
    f, tracks, gates = _tracks_and_gates(spec, scans, course)
    marks = [_map_line((false_north, false_east), tr("false plots"), Style(GREY, None, 0, 1.1, 1.0))]
    curves = (
        (tr("its gates"), gates, Style(3, 0, None, 0.6)),
        (tr("other tracks"), tracks[1:], Style(GREY, 0, None, 1.0)),
        (tr("track nearest to the course"), tracks[:1], Style(2, 0, None, 1.8)),
    )
    for label, group, style in curves:
        marks += [_map_line(curve, "" if n else label, style) for n, curve in enumerate(group)]
    marks.insert(1, _map_line(_north_east(*z[np.isfinite(z[:, 0])].T), tr("target plots"), Style(1, None, 1, 1.1, 2.0)))
    marks.append(_map_line(course, tr("target"), Style(0, 1, None, 1.8)))
    caption = tr(
        "Realisation 0 of {name}, filter {tracker}, over {k} scans. Confirmed tracks near the target: {tracks}; "
        "false plots: {false}. Gates of every fourth scan.",
        tracks=len(tracks),
        false=len(false_north),
        name=key_labels.plain_case_label(result),
        tracker="" if f is None else quote_name(spec.filters[f].name),
        k=len(axes.k),
    )
    x_axis = Axis(tr("distance east, km"), limits=(west / 1e3, east / 1e3))
    y_axis = Axis(tr("distance north, km"), limits=(south / 1e3, north / 1e3))
    panel, title = Panel(x_axis, y_axis, tuple(marks), direct=False, equal=True), tr("Plots, gates and tracks")
    return Figure("track_map", title, caption, (panel,), panel_height_mm=100)


def _plots_within(
    axes: ClutterAxes, z: np.ndarray, north_limits: tuple[float, float], east_limits: tuple[float, float]
) -> tuple[list[tuple[float, np.ndarray, np.ndarray]], Curve]:
    """Scans (t, r, b) with the target's plots z (K, 2) and the false plots within limits; and these false plots."""
    scans, false_positions = [], []
    for k, t in enumerate(np.cumsum(axes.world.dt)):
        r, b = false_plots(axes.field, 0, k)
        x, y = _north_east(r, b)
        is_near = (north_limits[0] < x) & (x < north_limits[1]) & (east_limits[0] < y) & (y < east_limits[1])
        false_positions.append(np.stack([x[is_near], y[is_near]]))
        target_plot = z[k][:, None] if np.isfinite(z[k, 0]) else np.zeros((2, 0))
        r, b = np.concatenate([target_plot, np.stack([r[is_near], b[is_near]])], axis=1)
        scans.append((float(t), r, b))
    north, east = np.concatenate(false_positions, axis=1)
    return scans, (north, east)


def _tracks_and_gates(
    spec: Keys, scans: Sequence[tuple[float, np.ndarray, np.ndarray]], course: Curve
) -> tuple[int | None, list[Curve], list[Curve]]:
    """The first tracker that has to find its plots, its confirmed tracks, and gates of the nearest track.

    Tracks are ordered by their distance to the course."""
    specs = tracker_specs(spec)
    f = next((i for i, tracker in enumerate(specs) if tracker.association != "known"), None)
    if f is None:
        return None, [], []
    histories = confirmed_tracks(specs[f], tracking_conditions(spec), scans)
    states = [np.array(track.states) for track in histories]
    track_curves = [_north_east(track_states[:, 0], track_states[:, 2]) for track_states in states]
    order = sorted(range(len(histories)), key=lambda n: _median_distance(track_curves[n], course))
    gates = [
        _gate_outline(gate, specs[f])
        for n in order[:1]
        for k, gate in zip(histories[n].scans, histories[n].predictions, strict=True)
        if not k % GATE_INTERVAL_SCANS
    ]
    return f, [track_curves[n] for n in order], [gate for gate in gates if np.isfinite(gate[0]).all()]


def _map_line(curve: Curve, label: str, style: Style) -> Line:
    return Line(curve[1] * 1e-3, curve[0] * 1e-3, label, style)


def _north_east(r: np.ndarray, b: np.ndarray) -> Curve:
    """Distances north and east of a position in range and bearing."""
    return r * np.cos(b), r * np.sin(b)


def _median_distance(track: Curve, course: Curve) -> float:
    """The median distance of a track's points to the course, m."""
    north, east = (
        track_values[:, None] - course_values for track_values, course_values in zip(track, course, strict=True)
    )
    return float(np.median(np.hypot(north, east).min(axis=1)))


def _gate_outline(gate: np.ndarray, tracker: TrackerSpec) -> Curve:
    """The edge of a gate on the map; an open gate is drawn as if its probability were 0.9999."""
    angle, (r, b, rr, rb, bb) = np.linspace(0, 2 * np.pi, 61), gate
    size = np.sqrt(gate_threshold(min(tracker.gate_probability, 0.9999)))
    low = rb / np.sqrt(rr)
    u, v = size * np.cos(angle), size * np.sin(angle)
    return _north_east(r + np.sqrt(rr) * u, b + low * u + np.sqrt(max(bb - low**2, 0.0)) * v)
