"""A map of one realisation among false plots: the target's course, plots, confirmed tracks and their gates."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.studies.sonar.clutter import filters as design
from radarsim.studies.sonar.clutter.multitrack import confirmed_tracks
from radarsim.studies.sonar.clutter.study import tracker_specs
from radarsim.studies.sonar.clutter.track import conditions, false_plots, target_plots

NEAR_M = 2500.0  # of the target's course: what the map shows
EVERY = 4  # scans between the gates that it shows
Curve = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class RealisationMap:
    """Realisation 0 as one tracker sees it; every place is (north, east) in m, curves are pairs of arrays.

    Attributes:
        tracker: name of the tracker; empty where there is none that has to find its plots.
        truth: the target's course, K points.
        plots: the target's plots.
        false: the false plots of all scans near the course.
        tracks: the confirmed tracks, a curve each.
        gates: edges of their gates at every `EVERY`-th scan, a curve each.
        window: southern and northern, western and eastern edge of what is shown.
    """

    tracker: str
    truth: Curve
    plots: Curve
    false: Curve
    tracks: list[Curve]
    gates: list[Curve]
    window: tuple[tuple[float, float], tuple[float, float]]


def realisation_map(result: CaseResult) -> RealisationMap:
    """The map of a case, as seen by its first tracker that is not given its plots: what lies near the course."""
    spec, axes, specs = result.spec, result.axes, tracker_specs(result.spec)
    z, true = target_plots(axes.world, axes.observation, 0)
    course = _flat(*true.T)
    (south, north), (west, east) = ((side.min() - NEAR_M, side.max() + NEAR_M) for side in course)
    scans, seen = [], []
    for k, t in enumerate(np.cumsum(axes.world.dt)):
        r, b = false_plots(axes.field, 0, k)
        x, y = _flat(r, b)
        near = (south < x) & (x < north) & (west < y) & (y < east)
        seen.append(np.stack([x[near], y[near]]))
        own = z[k][:, None] if np.isfinite(z[k, 0]) else np.zeros((2, 0))
        scans.append((t, *np.concatenate([own, np.stack([r[near], b[near]])], axis=1)))
    f = next((i for i, one in enumerate(specs) if one.association != "known"), None)
    lives = [] if f is None else confirmed_tracks(specs[f], *conditions(spec), scans)
    tracks, gates = [], []
    for life in lives:
        states = np.array(life.states)
        tracks.append(_flat(states[:, 0], states[:, 2]))
        gates += [_ellipse(g, specs[f]) for k, g in zip(life.scans, life.gates, strict=True) if not k % EVERY]
    return RealisationMap(
        tracker="" if f is None else spec.filters[f].name,
        truth=course,
        plots=_flat(*z[np.isfinite(z[:, 0])].T),
        false=tuple(np.concatenate(seen, axis=1)),
        tracks=tracks,
        gates=[gate for gate in gates if np.isfinite(gate[0]).all()],
        window=((south, north), (west, east)),
    )


def _flat(r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ways north and east."""
    return r * np.cos(b), r * np.sin(b)


def _ellipse(gate: np.ndarray, tracker: design.TrackerSpec) -> tuple[np.ndarray, np.ndarray]:
    """A gate's edge on the map; of an open gate a small circle."""
    angle, (r, b, rr, rb, bb) = np.linspace(0, 2 * np.pi, 61), gate
    size = np.sqrt(design.gate_threshold(min(tracker.gate_probability, 0.9999)))
    low = rb / np.sqrt(rr)
    u, v = size * np.cos(angle), size * np.sin(angle)
    return _flat(r + np.sqrt(rr) * u, b + low * u + np.sqrt(max(bb - low**2, 0.0)) * v)
