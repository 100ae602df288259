"""Blocks of realisations of trackers: the target's track, and tracks that false plots begin.

Every plot that no track takes begins a track. The target's plots do so one at a time. Of the false plots, one begins a
track in each realisation, at a position drawn uniformly over the sector. By the theorem of Slivnyak and Mecke the plots
about it are again those of the field, and the expected number of false tracks is their density times the share that is
confirmed. Letters as in `tracker`."""

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lanes import address
from radarsim.studies.sonar.clutter.kernels.false_plots import draw_uniform_positions
from radarsim.studies.sonar.clutter.kernels.gate import KNOWN
from radarsim.studies.sonar.clutter.kernels.single_tracks import (
    Scan,
    Target,
    reset_tracks,
    step_tracker,
    tracks_of_tracker,
)
from radarsim.studies.sonar.clutter.kernels.track_rules import (
    BEST,
    CONFIRMED_SCANS,
    ENDS,
    FALSE_WEIGHT,
    FIRST,
    PLOTS_TAKEN,
    judge_false_tracks,
    judge_known_association,
    judge_target_track,
)
from radarsim.studies.sonar.clutter.kernels.track_sums import (
    COUNTS,
    ENDS_PER_SCAN,
    WRONG_PER_PLOT,
    add_errors,
    add_ratio,
    add_scores,
)
from radarsim.studies.sonar.kernels.chunks import CHUNK, copy_row
from radarsim.studies.sonar.kernels.plots import detect
from radarsim.studies.sonar.kernels.sums import Course, add_ahead, rows_of
from radarsim.studies.sonar.kernels.world import move_and_measure


@kernel_part
def measure_target(world, first, k, plots, z, shift):
    """Write the target's plots at scan k to z (2, CHUNK), and its deviation from its course to shift (2, 3, CHUNK).

    In realisations from number `first` on; plots (2, 4, CHUNK) as in `move_and_measure`."""
    move_and_measure(world, first, k, plots)
    for c in range(2):
        copy_row(plots[c, 0], z[c])
        copy_row(plots[c, 2], shift[c, 0])
        copy_row(plots[c, 3], shift[c, 1])


@kernel
def simulate_block(world, detections, field, trackers, work, first, total, sums):
    """Add the sums of the target's tracks in realisations first … first + total - 1 to sums, a TrackSums."""
    F, K, status = trackers.chi_square.size, world.dt.size, work.status
    plots, shift, z = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK)), np.empty((2, CHUNK))
    detected, used, plot_counts = np.empty(CHUNK), np.ones(CHUNK), np.empty((F, CHUNK))
    counts, scratch, target = np.zeros(COUNTS), np.empty(7), Target(detected, z, True)
    for done in range(0, total, CHUNK):
        reset_tracks(work)
        plots[:], plot_counts[:] = 0.0, 0.0
        n = min(CHUNK, total - done)
        used[n:] = 0.0
        for k in range(K):
            scan, course = Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            measure_target(world, first + done, k, plots, z, shift)
            detect(detections, first + done, k, detected)
            for f in range(F):
                tracks = tracks_of_tracker(work, f)
                for c in range(2 if k > 0 else 0):
                    rows = rows_of(tracks.x[c], course, c, plot_counts[f], used)
                    add_ahead(rows, 2, scan.dt, address(scratch), sums.errors.ahead[f, k - 1, c])
                counts[:] = 0.0
                step_tracker(trackers, f, field, scan, tracks, target, work, counts)
                if trackers.association[f] == KNOWN:
                    judge_known_association(tracks, status[f], n, plot_counts[f], counts)
                else:
                    judge_target_track(trackers, f, n, tracks, status[f], course, plot_counts[f], counts)
                for j in range(COUNTS):
                    sums.counts[f, k, j] += counts[j]
                add_errors(trackers, tracks, f, k, course, plot_counts[f], used, scratch, sums.errors)
        for f in range(F):
            add_ratio(status[f, ENDS], status[f, CONFIRMED_SCANS], n, sums.ratios[f, ENDS_PER_SCAN])
            add_ratio(status[f, FALSE_WEIGHT], status[f, PLOTS_TAKEN], n, sums.ratios[f, WRONG_PER_PLOT])
            add_scores(trackers.score_thresholds, n, status[f, FIRST], status[f, BEST], sums.scores[0, f])


@kernel
def simulate_false_tracks(key, field, trackers, work, dt, first, total, sums):
    """Add the sums of tracks that false plots begin at scan 0: one plot a realisation, uniform over the sector.

    key (2,) of the stream of their positions; dt (K,) intervals before each scan."""
    z, detected, counts, undetected = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(COUNTS), np.zeros(CHUNK)
    for done in range(0, total, CHUNK):
        reset_tracks(work)
        n = min(CHUNK, total - done)
        draw_uniform_positions(key, field, first + done, n, z)
        for f in range(trackers.chi_square.size):
            tracks, status = tracks_of_tracker(work, f), work.status[f]
            if trackers.association[f] == KNOWN:
                continue
            for k in range(dt.size):
                target = Target(detected if k == 0 else undetected, z, k == 0)
                step_tracker(trackers, f, field, Scan(first + done, n, k, dt[k]), tracks, target, work, counts)
                if not judge_false_tracks(trackers, f, n, tracks, status, sums.begun[f, k]):
                    break
            add_scores(trackers.score_thresholds, n, status[FIRST], status[BEST], sums.scores[1, f])
