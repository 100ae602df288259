"""Simulated plots among false ones, and the trackers over recorded plots."""

from collections.abc import Mapping

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.missed_scans import with_missed_scans
from radarsim.studies.noise import noise_key
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots
from radarsim.studies.recording_interface import Track
from radarsim.studies.sonar import kernel_inputs, labels
from radarsim.studies.sonar.clutter import tracker_design
from radarsim.studies.sonar.clutter.multi_tracker import confirmed_tracks
from radarsim.studies.sonar.clutter.plots import sector_plots
from radarsim.studies.sonar.clutter.study import SIZE
from radarsim.studies.sonar.clutter.target_detections import detected_plots
from radarsim.studies.sonar.scene import build_scene
from radarsim.studies.sonar.tracking import MAX_ROWS


def simulated_plots(case: Case) -> DrawPlots:
    """Draw all plots in the sector in realisations of a case, ordered by bearing in each scan.

    true_target is 1 for the target's plots and 0 for false ones; true_range_m and true_bearing_rad are the target's."""
    spec, scene = case.spec, build_scene(case)
    field = tracker_design.field(noise_key(case, "false"), spec.sensor.sector, tracker_design.tracking_conditions(spec))
    world, detections = kernel_inputs.kernel_world(case, scene), detected_plots(case, scene)

    def draw(first: int, count: int) -> SimulatedPlots:
        target_positions, deviation = kernel_inputs.draw_plots(world, detections, first, count)
        r, b, target = sector_plots(field, first, target_positions)
        truth = kernel_inputs.true_states(scene, deviation, count, SIZE)
        truth_columns = {"true_target": target, "true_range_m": truth[..., 0], "true_bearing_rad": truth[..., SIZE]}
        return SimulatedPlots(
            scene.t, {"range_m": r, "bearing_rad": b}, labels.labels(spec, SIZE), truth, truth_columns, first
        )

    return draw


class Tracker:
    """The trackers of a case over recorded plots, of which several may have the same time.

    Every confirmed track is returned, from its first plot on. A row without range or bearing is not a plot, but its
    time is that of a scan. Filters with association `known` are left out; raises ConfigError where there are no others.
    `MultiTracker` decides how tracks share plots."""

    most_rows = MAX_ROWS
    several = True

    def __init__(self, case: Case):
        self.case = case

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The tracks over all rows: columns (n,), NaN where a value is missing."""
        spec, specs = self.case.spec, tracker_design.tracker_specs(self.case.spec)
        filter_indices = [f for f, tracker_spec in enumerate(specs) if tracker_spec.association != "known"]
        if not filter_indices:
            raise ConfigError(
                f"{self.case.name}: filters: it is not known which plots are the target's: use nearest or pda"
            )
        t, scan = np.unique(columns["t_s"], return_inverse=True)
        times, places = with_missed_scans(t, spec.sensor.scan_period_s)
        plots = np.stack([columns["range_m"], columns["bearing_rad"]])
        complete = np.isfinite(plots).all(axis=0)
        scans = [(time, *plots[:, complete & (places[scan] == k)]) for k, time in enumerate(times)]
        by_filter = {
            f: confirmed_tracks(specs[f], tracker_design.tracking_conditions(spec), scans) for f in filter_indices
        }
        tracks = [(f, n, track) for f, histories in by_filter.items() for n, track in enumerate(histories, start=1)]
        estimate, sigma = np.full((2, len(tracks), len(times), 4), np.nan)
        score = np.full((len(tracks), len(times)), np.nan)
        for i, (_, _, track) in enumerate(tracks):
            estimate[i, track.scans], sigma[i, track.scans] = track.states, np.sqrt(track.variances)
            score[i, track.scans] = track.scores
        return Track(
            filters=tuple(spec.filters[f].name for f, _, _ in tracks),
            components=labels.labels(spec, SIZE),
            t_s=t,
            estimate=estimate[:, places],
            sigma=sigma[:, places],
            numbers=np.array([n for _, n, _ in tracks]),
            score=score[:, places],
        )
