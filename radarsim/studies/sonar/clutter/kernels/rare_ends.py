"""The target's track, drawn where it ends, and the weights that make up for it.

`rare_end_laws` has the laws from which it is drawn, and their ratios (importance sampling)."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.mixtures import add_event_weight, add_realisation_weight
from radarsim.studies.sonar.clutter.kernels import (
    association,
    blocks,
    gate,
    single_tracks,
    track_prediction,
    track_rules,
    track_sums,
    track_update,
)
from radarsim.studies.sonar.clutter.kernels.rare_end_laws import (
    FALSE_CAME,
    FIRST_RATIO,
    HAS_ENDED,
    SEDUCED,
    associate_young_tracks,
    choose_end_laws,
    detect_by_laws,
    set_box_probabilities,
    stretch_plots,
    tracker_laws,
    write_young_errors,
)
from radarsim.studies.sonar.clutter.kernels.rare_false_tracks import LAW
from radarsim.studies.sonar.kernels.chunks import CHUNK
from radarsim.studies.sonar.kernels.sums import Course

END_KINDS = 4  # the last two: a false plot came into the gate of the young track, but not in place of the target's
DROPPED, LOST, DROPPED_AFTER, LOST_AFTER = range(END_KINDS)


class EndSums(NamedTuple):
    """Sums of a block by weights w, for F trackers over K scans."""

    #: (F, K, END_KINDS, 4) Σw, Σw², number, Σw⁴ of realisations whose first confirmed track ends at a scan
    ended: np.ndarray
    ended_drawn: np.ndarray  #: (F, 3) number of realisations drawn as they are, Σw and Σw² of all


@inline
def realisation_weight(shares, sampling, i):
    """The weight of realisation i so far: the law itself over the mixture of all laws."""
    total = shares[0]
    for j in range(shares.size - 1):
        total += shares[1 + j] * sampling[FIRST_RATIO + j, i]
    return 1.0 / total


@kernel_part
def count_ended_tracks(limits, n, tracks, status, course, laws, sampling, ended):
    """Count the n realisations whose first confirmed track ends at this scan by their weights, in ended (END_KINDS, 4).

    limits: misses in a row that drop a track, and the error (r, b), in m and rad, with which it has lost its target."""
    misses, lost_error = limits
    for i in range(n):
        if status[track_rules.ENDS, i] > 0.0 and sampling[HAS_ENDED, i] == 0.0:
            sampling[HAS_ENDED, i] = 1.0
            lost = status[track_rules.MISSES, i] < misses and track_rules.is_off_target(tracks, course, lost_error, i)
            false_beside_target = sampling[FALSE_CAME, i] > 0.0 and sampling[SEDUCED, i] == 0.0
            kind = (LOST if lost else DROPPED) + (DROPPED_AFTER if false_beside_target else 0)
            add_event_weight(realisation_weight(laws.shares, sampling, i), ended, kind)


@kernel
def simulate_ends(world, detections, field, trackers, ends, work, first, total, sums):
    """Add the weighted ends of the target's first confirmed tracks to sums, an EndSums.

    Arguments as in `blocks.simulate_block`."""
    F, K = trackers.chi_square.size, world.dt.size
    plots, shift = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK))
    measured, z, detected = np.empty((2, CHUNK)), np.empty((2, CHUNK)), np.empty(CHUNK)
    sampling, plot_counts = np.empty((F, FIRST_RATIO + ends.shares.shape[1] - 1, CHUNK)), np.empty(CHUNK)
    counts, keys, target = (
        np.zeros(track_sums.COUNTS),
        (ends.plots[0], ends.plots[1]),
        single_tracks.Target(detected, z, True),
    )
    errors = np.empty((ends.young.shape[1], 2, CHUNK))
    for done in range(0, total, CHUNK):
        single_tracks.reset_tracks(work)
        plots[:] = 0.0
        n = min(CHUNK, total - done)
        for f in range(F):
            write_young_errors(world, ends.young[f], first + done, errors)
            choose_end_laws(ends.choice, tracker_laws(ends, trackers, f), first + done, n, errors, sampling[f])
        for k in range(K):
            scan, course = single_tracks.Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            blocks.measure_target(world, first + done, k, plots, measured, shift)
            sigma = world.fresh[k]
            for f in range(F):
                if trackers.association[f] == gate.KNOWN:
                    continue
                laws = tracker_laws(ends, trackers, f)
                tracks = single_tracks.tracks_of_tracker(work, f)
                status = work.status[f]
                motion = trackers.period, trackers.sigma, trackers.manoeuvre[f]
                track_prediction.predict(tracks, scan.dt, *motion, work.predicted)
                stretch_plots(laws, k, n, measured, sigma, sampling[f], z)
                set_box_probabilities(field, laws, scan, tracks, status, work.predicted, sampling[f])
                detect_by_laws(detections, laws, scan, status, work.predicted, target, course, sigma, sampling[f])
                if laws.shares[-1] > 0.0:
                    associate_young_tracks(
                        field, detections, keys, laws, scan, tracks, status, target, work, sampling[f], counts
                    )
                else:
                    association.associate(field, laws.rule, scan, tracks, status, target, work, counts)
                joint = trackers.association[f] == gate.PDA
                track_update.update(tracks, scan.dt, *motion, joint, work.association)
                track_rules.judge_target_track(trackers, f, n, tracks, status, course, plot_counts, counts)
                lost_error = (trackers.lost[f] * trackers.sigma[0], trackers.lost[f] * trackers.sigma[1])
                count_ended_tracks(
                    (trackers.misses[f], lost_error), n, tracks, status, course, laws, sampling[f], sums.ended[f, k]
                )
        for f in range(F):
            for i in range(n):
                if trackers.association[f] != gate.KNOWN:
                    add_realisation_weight(
                        realisation_weight(ends.shares[f], sampling[f], i),
                        sampling[f, LAW, i] == 0.0,
                        sums.ended_drawn[f],
                    )
