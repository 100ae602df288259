"""A map of one realisation among false plots: the target's course, all plots, confirmed tracks and their gates."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.studies.sonar.clutter.filters import ClutterAxes, TrackerSpec, conditions, gate_threshold, tracker_specs
from radarsim.studies.sonar.clutter.track import confirmed_tracks, false_plots, target_plots

NEAR_M = 2500.0  # the map shows what is nearer than this to the target's course
EVERY = 4  # scans between the gates that the map shows
Curve = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class RealisationMap:
    """Realisation 0 as seen by one tracker; positions are (north, east) in m, curves are pairs of arrays."""

    tracker: str  #: name of the tracker; empty if all filters know the target's plots.
    truth: Curve  #: the target's course, K points.
    plots: Curve  #: the target's plots.
    false: Curve  #: the false plots of all scans near the course.
    tracks: list[Curve]  #: the confirmed tracks, one curve each, first the one that lies nearest to the course.
    gates: list[Curve]  #: edges of its gates at every `EVERY`-th scan, one curve each.
    #: southern and northern, western and eastern edge of the map.
    window: tuple[tuple[float, float], tuple[float, float]]


def realisation_map(result: CaseResult[ClutterAxes]) -> RealisationMap:
    """The map of a case, seen by its first tracker that has to find its plots, near the target's course."""
    spec, axes, specs = result.spec, result.axes, tracker_specs(result.spec)
    z, true = target_plots(axes.world, axes.detections, 0)
    course = _flat(*true.T)
    (south, north), (west, east) = ((side.min() - NEAR_M, side.max() + NEAR_M) for side in course)
    scans, false = [], []
    for k, t in enumerate(np.cumsum(axes.world.dt)):
        r, b = false_plots(axes.field, 0, k)
        x, y = _flat(r, b)
        near = (south < x) & (x < north) & (west < y) & (y < east)
        false.append(np.stack([x[near], y[near]]))
        own = z[k][:, None] if np.isfinite(z[k, 0]) else np.zeros((2, 0))
        plots = np.concatenate([own, np.stack([r[near], b[near]])], axis=1)
        scans.append((t, plots[0], plots[1]))
    f = next((i for i, one in enumerate(specs) if one.association != "known"), None)
    found = [] if f is None else confirmed_tracks(specs[f], conditions(spec), scans)
    states = [np.array(track.states) for track in found]
    tracks = [_flat(own[:, 0], own[:, 2]) for own in states]
    order = sorted(range(len(found)), key=lambda n: _distance(tracks[n], course))
    gates = [
        _ellipse(gate, specs[f or 0])
        for n in order[:1]
        for k, gate in zip(found[n].scans, found[n].gates, strict=True)
        if not k % EVERY
    ]
    north_of_false, east_of_false = np.concatenate(false, axis=1)
    return RealisationMap(
        tracker="" if f is None else spec.filters[f].name,
        truth=course,
        plots=_flat(*z[np.isfinite(z[:, 0])].T),
        false=(north_of_false, east_of_false),
        tracks=[tracks[n] for n in order],
        gates=[gate for gate in gates if np.isfinite(gate[0]).all()],
        window=((south, north), (west, east)),
    )


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
