"""Plots of cases among false ones: of one realisation, and the trackers over recorded ones."""

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
from radarsim.studies.sonar.clutter.study import SIZE, tracker_specs
from radarsim.studies.sonar.clutter.world import observation_of
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.kernels import shared_gains as sonar_kernels
from radarsim.studies.sonar.scene import scene
from radarsim.studies.sonar.track import MOST_ROWS


def target_plots(world: sonar_kernels.World, observation: pattern_kernels.Observation, realisation: int):
    """Plots (K, 2) of the target in one realisation, not-a-number where missed, and its true places (K, 2)."""
    K, plots, detected = len(world.dt), np.zeros((2, 4, 1)), np.empty(1)
    z, true = np.full((K, 2), np.nan), world.truth[:, :2, 0].copy()
    for k in range(K):
        sonar_kernels.move_and_measure(world, realisation, k, plots)
        pattern_kernels.detect(observation, realisation, k, detected)
        true[k] += plots[:, 2, 0]
        if detected[0]:
            z[k] = plots[:, 0, 0]
    return z, true


def false_plots(field: Field, realisation: int, scan: int) -> np.ndarray:
    """All false plots (2, n) of a scan, range and bearing."""
    if field.density == 0:
        return np.zeros((2, 0))
    room = np.empty((2, int(20 + 2 * field.density * field.dq * field.nq * field.db * field.nb)))
    n = whole_field(field, realisation, scan, *room)
    while n > room.shape[1]:
        room = np.empty((2, n))
        n = whole_field(field, realisation, scan, *room)
    return room[:, :n]


def conditions(spec) -> tuple[float, np.ndarray, float, float]:
    """Period, σ of a plot (2,), detection probability, density per m²."""
    sensor = spec.sensor
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad])
    return sensor.scan_period_s, sigma, sensor.detection_probability, sensor.false_plots_per_km2 / 1e6


def simulated(case: Case, realisation: int) -> dict[str, np.ndarray]:
    """All plots of one realisation in the sector, in order of time and bearing, as the columns of a file of plots.

    true_target is 1 for the target's plots, 0 for false ones; true_range_m and true_bearing_rad are the target's. A
    scan without a plot has one row without values.
    """
    spec, seen = case.spec, scene(case.spec)
    field = design.field(noise_key(case, "false"), spec.sensor.sector, conditions(spec)[3], seen.nominal)
    z, true = target_plots(base.world(case, seen), observation_of(case, seen), realisation)
    rows = []
    for k, t in enumerate(seen.t):
        own = [(z[k, 0], z[k, 1], 1.0)] if np.isfinite(z[k, 0]) else []
        scan = [*own, *((r, b, 0.0) for r, b in false_plots(field, realisation, k).T)] or [(np.nan, np.nan, np.nan)]
        rows += [(t, r, b, whose, *true[k]) for r, b, whose in sorted(scan, key=lambda row: row[1])]
    names = ("t_s", "range_m", "bearing_rad", "true_target", "true_range_m", "true_bearing_rad")
    return dict(zip(names, np.array(rows).T, strict=True))


class Tracker:
    """The trackers of a case over recorded plots, several of a time: every confirmed track, from its first plot on.

    A row without range or bearing is no plot, but its time is a scan. A tracker that would have to be given its plots
    is left out; raises ConfigError where there is no other. What tracks are stands in `multitrack`.
    """

    most_rows = MOST_ROWS
    several = True

    def __init__(self, case: Case):
        self.case = case

    def feed(self, recorded: Mapping[str, np.ndarray]) -> Track:
        """The tracks over all rows: columns (n,), not-a-number where a value is missing."""
        spec, wanted = self.case.spec, tracker_specs(self.case.spec)
        some = [f for f, one in enumerate(wanted) if one.association != "known"]
        if not some:
            raise ConfigError(
                f"{self.case.name}: filters: nobody can tell which plots are the target's: nearest or pda is needed"
            )
        t, at = np.unique(recorded["t_s"], return_inverse=True)
        plots = np.stack([recorded["range_m"], recorded["bearing_rad"]])
        there = np.isfinite(plots).all(axis=0)
        scans = [(time, *plots[:, there & (at == k)]) for k, time in enumerate(t)]
        found = {f: confirmed_tracks(wanted[f], *conditions(spec), scans) for f in some}
        lives = [(f, n, life) for f, tracks in found.items() for n, life in enumerate(tracks, start=1)]
        estimate, sigma = np.full((2, len(lives), len(t), 4), np.nan)
        score = np.full((len(lives), len(t)), np.nan)
        for i, (_, _, life) in enumerate(lives):
            estimate[i, life.scans], sigma[i, life.scans] = life.states, np.sqrt(life.variances)
            score[i, life.scans] = life.scores
        names = tuple(spec.filters[f].name for f, _, _ in lives)
        return Track(
            *(names, base.labels(spec, SIZE), t, estimate, sigma),
            numbers=np.array([n for _, n, _ in lives]),
            score=score,
        )
