"""Plots of cases among false ones: those of one realisation, and the trackers over recorded ones."""

from collections.abc import Mapping

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.clutter import filters as design
from radarsim.studies.sonar.clutter.kernels.field import Field, whole_field
from radarsim.studies.sonar.clutter.multitrack import confirmed_tracks
from radarsim.studies.sonar.clutter.study import SIZE
from radarsim.studies.sonar.clutter.world import detections
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.kernels import shared_gains as sonar_kernels
from radarsim.studies.sonar.scene import build_scene
from radarsim.studies.sonar.track import MOST_ROWS


def target_plots(
    world: sonar_kernels.World, detections: pattern_kernels.Detections, realisation: int
) -> tuple[np.ndarray, np.ndarray]:
    """Plots (K, 2) of the target in one realisation, NaN where missed, and its true positions (K, 2)."""
    K, plots, detected = len(world.dt), np.zeros((2, 4, 1)), np.empty(1)
    z, true = np.full((K, 2), np.nan), world.truth[:, :2, 0].copy()
    for k in range(K):
        sonar_kernels.move_and_measure(world, realisation, k, plots)
        pattern_kernels.detect(detections, realisation, k, detected)
        true[k] += plots[:, 2, 0]
        if detected[0]:
            z[k] = plots[:, 0, 0]
    return z, true


def false_plots(field: Field, realisation: int, scan: int) -> np.ndarray:
    """All false plots (2, n) of a scan, range and bearing."""
    cells = field.cells
    if cells.density == 0:
        return np.zeros((2, 0))
    room = np.empty((2, int(20 + 2 * cells.density * cells.dq * cells.nq * cells.db * cells.nb)))
    n = whole_field(field, realisation, scan, *room)
    while n > room.shape[1]:
        room = np.empty((2, n))
        n = whole_field(field, realisation, scan, *room)
    return room[:, :n]


def simulated(case: Case, realisation: int) -> dict[str, np.ndarray]:
    """All plots of one realisation in the sector, in order of time and bearing, as the columns of a file of plots.

    true_target is 1 for the target's plots and 0 for false ones; true_range_m and true_bearing_rad are the target's. A
    scan without plots has one row without values.
    """
    spec, scene = case.spec, build_scene(case)
    field = design.field(noise_key(case, "false"), spec.sensor.sector, design.conditions(spec))
    z, true = target_plots(base.world(case, scene), detections(case, scene), realisation)
    rows: list[tuple[float, ...]] = []
    for k, t in enumerate(scene.t):
        own = [(z[k, 0], z[k, 1], 1.0)] if np.isfinite(z[k, 0]) else []
        plots = [*own, *((r, b, 0.0) for r, b in false_plots(field, realisation, k).T)] or [(np.nan, np.nan, np.nan)]
        rows += [(t, r, b, is_target, *true[k]) for r, b, is_target in sorted(plots, key=lambda plot: plot[1])]
    names = ("t_s", "range_m", "bearing_rad", "true_target", "true_range_m", "true_bearing_rad")
    return dict(zip(names, np.array(rows).T, strict=True))


class Tracker:
    """The trackers of a case over recorded plots, of which several may have the same time.

    Every confirmed track is returned, from its first plot on. A row without range or bearing is not a plot, but its
    time is that of a scan. Filters with association `known` are left out; raises ConfigError where there are no others.
    Tracks are described in `multitrack`.
    """

    most_rows = MOST_ROWS
    several = True

    def __init__(self, case: Case):
        self.case = case

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The tracks over all rows: columns (n,), NaN where a value is missing."""
        spec, specs = self.case.spec, design.tracker_specs(self.case.spec)
        chosen = [f for f, one in enumerate(specs) if one.association != "known"]
        if not chosen:
            raise ConfigError(
                f"{self.case.name}: filters: it is not known which plots are the target's: nearest or pda is needed"
            )
        t, row = np.unique(columns["t_s"], return_inverse=True)
        plots = np.stack([columns["range_m"], columns["bearing_rad"]])
        complete = np.isfinite(plots).all(axis=0)
        scans = [(time, *plots[:, complete & (row == k)]) for k, time in enumerate(t)]
        by_filter = {f: confirmed_tracks(specs[f], design.conditions(spec), scans) for f in chosen}
        tracks = [(f, n, track) for f, found in by_filter.items() for n, track in enumerate(found, start=1)]
        estimate, sigma = np.full((2, len(tracks), len(t), 4), np.nan)
        score = np.full((len(tracks), len(t)), np.nan)
        for i, (_, _, track) in enumerate(tracks):
            estimate[i, track.scans], sigma[i, track.scans] = track.states, np.sqrt(track.variances)
            score[i, track.scans] = track.scores
        return Track(
            filters=tuple(spec.filters[f].name for f, _, _ in tracks),
            components=base.labels(spec, SIZE),
            t_s=t,
            estimate=estimate,
            sigma=sigma,
            numbers=np.array([n for _, n, _ in tracks]),
            score=score,
        )
