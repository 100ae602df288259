"""Tracks that false plots begin, drawn where they are confirmed and where they live long (importance sampling).

In a share of the realisations the gate of a tentative track contains false plots more often than it should, in another
share that of a confirmed track too, and each realisation counts with the ratio of the laws. `rare_boxes` has the boxes
in which false plots are drawn, and the letters p, h and ratio.

For a tentative track h is the number of plots that the rule m of n still needs over the scans that are left, at least
p. If p were the same at all scans, and small, all patterns of plots that confirm the track would have equal weights. No
h is better then: with i plots to come in j scans, η the chance that a plot of the box is in the gate, the least second
moment of the weight is M(i, j) = min over h of M(i-1, j-1)/(ηh) + M(i, j-1)/(1-h) = (√(M(i-1, j-1)/η) + √M(i, j-1))² in
units of (ηp)^(2i), so √M(i, j) = η^(-i/2) C(j, i) by Pascal's rule, at h = i/j. Of a confirmed track h is one over the
misses in a row that still drop it."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.lanes import address
from radarsim.kernels.mixtures import add_event_weight, add_realisation_weight
from radarsim.kernels.random import uniforms
from radarsim.studies.sonar.clutter.kernels import association as kernels_association
from radarsim.studies.sonar.clutter.kernels import (
    false_plots,
    single_tracks,
    track_prediction,
    track_rules,
    track_sums,
    track_update,
)
from radarsim.studies.sonar.clutter.kernels import gate as kernels_gate
from radarsim.studies.sonar.clutter.kernels.rare_boxes import MAX_BOX_MEAN, MAX_RATIO, associate_in_box, gate_box
from radarsim.studies.sonar.kernels.chunks import CHUNK

NO_PLOT = (0.0, 0.0, 0.0)  # of the target
# Rows of the state of importance sampling of a false track: the law that it is drawn from; the ratios so far of the
# laws under which tracks are confirmed, and under which they live long; scans with a confirmed track.
ROWS = 4
LAW, CONFIRMED_RATIO, HELD_RATIO, SCANS_HELD = range(ROWS)


class FalseTrackLaws(NamedTuple):
    """The laws from which tracks that false plots begin are drawn.

    choice (2,) is the key of the stream that chooses the law of each track; plots (2,) is that of the plots in boxes.
    shares (3,): of tracks drawn as they are, so that they are confirmed, and so that they live long; the sum is one."""

    choice: np.ndarray
    plots: np.ndarray
    shares: np.ndarray


class WeightedSums(NamedTuple):
    """Sums of a block by weights w, for F trackers.

    held (F, K, 4): Σw, Σw², number and Σw⁴ of tracks held for at least 1 … K scans from their confirmation on;
    drawn (F, 3): number of tracks drawn as they are, Σw and Σw² of all tracks."""

    held: np.ndarray
    drawn: np.ndarray


@kernel_part
def associate_false_tracks(field, shift, trackers, f, scan, work, sampling, counts):
    """Associate the false plots of a scan, drawn in boxes or from the field, with every track of a chunk.

    Writes work.association (6, CHUNK) as `association.associate` does; sampling (ROWS, CHUNK) holds the ratios."""
    draws, out, counts_address, status = (
        false_plots.field_draws(field),
        work.association,
        address(counts),
        work.status[f],
    )
    predicted, plots, rule = work.predicted, work.plots[f], single_tracks.association_rule(trackers, f)
    status_address, out_address, m, n = address(status), address(out), trackers.m[f], trackers.n[f]
    keys, max_misses, holds = (shift.plots[0], shift.plots[1]), trackers.misses[f], shift.shares[2] > 0.0
    for i in range(scan.count):
        if status[track_rules.STATE, i] == track_rules.NONE:
            out[:, i] = 0.0
            continue
        status[track_rules.TIME_SINCE_PLOT, i] += scan.dt
        position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = kernels_gate.track_gate(position, S, plots[i] > 1.5, rule.speed * status[track_rules.TIME_SINCE_PLOT, i])
        box, tentative = (
            gate_box(draws.cells, gate, rule.chi_square),
            status[track_rules.STATE, i] == track_rules.TENTATIVE,
        )
        if (tentative or holds) and 0.0 < box.mean <= MAX_BOX_MEAN:
            law_probability = (
                (m - status[track_rules.HITS, i]) / (n - status[track_rules.AGE, i])
                if tentative
                else 1.0 / (max_misses - status[track_rules.MISSES, i])
            )
            drawn_probability = law_probability if sampling[LAW, i] > (0.0 if tentative else 1.0) else 0.0
            association, factor, _ = associate_in_box(
                keys, rule, (scan.first + i, scan.k), gate, NO_PLOT, box, law_probability, drawn_probability
            )
            sampling[CONFIRMED_RATIO, i] = min(sampling[CONFIRMED_RATIO, i] * (factor if tentative else 1.0), MAX_RATIO)
            sampling[HELD_RATIO, i] = min(sampling[HELD_RATIO, i] * factor, MAX_RATIO)
        else:
            association = kernels_association.associate_track(
                draws, rule, scan.first + i, scan.k, NO_PLOT, gate, counts_address
            )
        kernels_association.record_association(status_address, i, association, out_address)


@kernel_part
def choose_false_laws(shift, first, n, status, sampling):
    """Choose the laws of n new tracks; scores are counted only of those drawn as they are."""
    for i in range(n):
        u, _ = uniforms(shift.choice[0], shift.choice[1], first + i, 0)
        sampling[LAW, i] = 0.0 if u < shift.shares[0] else 1.0 if u < shift.shares[0] + shift.shares[1] else 2.0
        sampling[CONFIRMED_RATIO, i], sampling[HELD_RATIO, i], sampling[SCANS_HELD, i] = 1.0, 1.0, 0.0
        if sampling[LAW, i] > 0.0:
            status[track_rules.FIRST, i] = -1.0


@inline
def track_weight(shares, sampling, i):
    """The weight of track i so far: the law itself over the mixture of all laws."""
    return 1.0 / (shares[0] + shares[1] * sampling[CONFIRMED_RATIO, i] + shares[2] * sampling[HELD_RATIO, i])


@kernel_part
def count_held_tracks(shares, sampling, state, n, held_sums):
    """Count the confirmed tracks among n at a scan, by their weights so far; state (CHUNK,)."""
    for i in range(n):
        if state[i] == track_rules.CONFIRMED:
            add_event_weight(track_weight(shares, sampling, i), held_sums, int(sampling[SCANS_HELD, i]))
            sampling[SCANS_HELD, i] += 1.0


@kernel_part
def step_false_tracks(field, shift, trackers, f, scan, work, sampling, counts):
    """Process scan k > 0 of the tracks of a chunk; return whether any is alive."""
    tracks, status, manoeuvre = single_tracks.tracks_of_tracker(work, f), work.status[f], trackers.manoeuvre[f]
    track_prediction.predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate_false_tracks(field, shift, trackers, f, scan, work, sampling, counts)
    joint = trackers.association[f] == kernels_gate.PDA
    track_update.update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, joint, work.association)
    return track_rules.judge_false_tracks(trackers, f, scan.count, tracks, status, counts)


@kernel
def simulate_false_tracks(seeds, field, shift, trackers, work, dt, first, total, scores, sums):
    """Add the weighted sums of tracks that false plots begin at scan 0 to sums.

    Scores of the tracks drawn as they are go to scores (F, T + 1). Other arguments as in
    `blocks.simulate_false_tracks`."""
    z = np.empty((2, CHUNK))
    detected = np.ones(CHUNK)
    counts = np.zeros(track_sums.COUNTS)
    sampling = np.zeros((ROWS, CHUNK))
    for done in range(0, total, CHUNK):
        single_tracks.reset_tracks(work)
        n = min(CHUNK, total - done)
        false_plots.draw_uniform_positions(seeds, field, first + done, n, z)
        for f in range(trackers.chi_square.size):
            tracks, status = single_tracks.tracks_of_tracker(work, f), work.status[f]
            if trackers.association[f] == kernels_gate.KNOWN:
                continue
            scan, target = single_tracks.Scan(first + done, n, 0, dt[0]), single_tracks.Target(detected, z, True)
            single_tracks.step_tracker(trackers, f, field, scan, tracks, target, work, counts)
            choose_false_laws(shift, first + done, n, status, sampling)
            for k in range(1, dt.size):
                scan = single_tracks.Scan(first + done, n, k, dt[k])
                any_alive = step_false_tracks(field, shift, trackers, f, scan, work, sampling, counts)
                count_held_tracks(shift.shares, sampling, status[track_rules.STATE], n, sums.held[f])
                if not any_alive:
                    break
            for i in range(n):
                add_realisation_weight(track_weight(shift.shares, sampling, i), sampling[LAW, i] == 0.0, sums.drawn[f])
            track_sums.add_scores(
                trackers.score_thresholds, n, status[track_rules.FIRST], status[track_rules.BEST], scores[f]
            )
