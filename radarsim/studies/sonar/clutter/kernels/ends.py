"""The target's track, drawn where it ends: runs of missed plots, and weights that make up for them.

Of a share of the realisations the target's plots are missed more often than they should, once its track is confirmed,
until as many misses in a row as the law of a realisation is for have come; each counts with the ratio of the laws
(importance sampling). False plots, and the errors of the plots, are drawn as they are. For a tracker a plot outside its
gate is a miss like one that is not there, so the ratio is that of the answers "taken into the gate or not" alone:

    (1 - h) / P_D   for a plot in the gate,     (h + (1 - h) c) / (1 - P_D + P_D c)   for none,

with h the probability that the target is not detected, as drawn, and c that its plot, if there is one, is outside the
gate: both follow from the scans before. Were the ratio that of "detected or not", a track that ends by plots outside
its gate, which laws for misses hardly draw, would have a large weight. Letters as in `gate`, and

    c           probability that the target's plot is outside the gate
    ratio       of a law that is drawn from over the law itself
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.random import uniforms
from radarsim.studies.sonar.clutter.kernels.blocks import measure_target
from radarsim.studies.sonar.clutter.kernels.counts import COUNTS
from radarsim.studies.sonar.clutter.kernels.gate import KNOWN, OPEN, PDA, distance_squared, inverse_two
from radarsim.studies.sonar.clutter.kernels.rules import CONFIRMED, MISSES, STATE, judge, off_target
from radarsim.studies.sonar.clutter.kernels.rules import ENDS as TRACKS_ENDED
from radarsim.studies.sonar.clutter.kernels.sums import add_drawn, add_weight
from radarsim.studies.sonar.clutter.kernels.tracker import (
    Scan,
    Target,
    Workspace,
    associate,
    reset,
    rule_of,
    tracks_of,
)
from radarsim.studies.sonar.clutter.kernels.tracks import predict, update
from radarsim.studies.sonar.kernels.steps import CHUNK
from radarsim.studies.sonar.kernels.sums import Course

NODES = 32
WIDEST = 8.5  # σ of a plot: further from its mean it is once in 10¹⁶
LARGEST = 1e280  # of a ratio: far beyond any whose reciprocal counts
KINDS = 2
DROPPED, LOST = range(KINDS)
# Which law a track is drawn from; the longest run of misses since its confirmation; whether it has ended; then the
# ratio so far of each law.
LAW, LONGEST, ENDED, RATIO = range(4)


class Ends(NamedTuple):
    """How the target's tracks of F trackers are drawn, by R laws beside the law itself.

    choice (2,) is the key of the stream that chooses the law of each realisation. shares (F, 1 + R) of the law itself
    and of the others; the sum is one. length (F, R) of the run of misses that a law is for; undetected (F, R, L, K) the
    probability that the target is not detected at scan k by tracks with i misses in a row.
    """

    choice: np.ndarray
    shares: np.ndarray
    length: np.ndarray
    undetected: np.ndarray


class Laws(NamedTuple):
    """What `Ends` holds of one tracker, and the χ² of its gate."""

    shares: np.ndarray
    length: np.ndarray
    undetected: np.ndarray
    gate: float


class Plots(NamedTuple):
    """The law of the target's plots at a scan: their course, about which they lie, and their σ (2,) in m and rad."""

    course: Course
    sigma: np.ndarray


class Chunk(NamedTuple):
    """Arrays of a chunk: work arrays of the trackers, own (F, RATIO + R, CHUNK), the target's plots and their law, and
    what `judge` writes.
    """

    work: Workspace
    own: np.ndarray
    target: Target
    plots: Plots
    kept: np.ndarray
    counts: np.ndarray


class EndSums(NamedTuple):
    """Sums of a block by weights w, for F trackers over K scans.

    ended (F, K, KINDS, 4): Σw, Σw², number and Σw⁴ of realisations whose first confirmed track of the target ends at a
    scan: is dropped, or lost; ended_drawn (F, 3): number of plain ones, Σw and Σw² of all.
    """

    ended: np.ndarray
    ended_drawn: np.ndarray


@inline
def normal_below(x):
    """Distribution function of the unit normal."""
    return 0.5 * math.erfc(-math.sqrt(0.5) * x)


@kernel
def outside(off, S, threshold, sigma):
    """c: the probability that a plot is outside a gate of covariance S (rr, rb, bb), from whose centre its mean is off.

    off and sigma (r, b), in m and rad: the plot's errors in range and bearing are independent. The integral over the
    range of the density there times the share between both ends of the gate in bearing; with the sine of an angle for
    the range it is smooth and periodic, so that the midpoint rule converges exponentially.
    """
    (off_r, off_b), (sigma_r, sigma_b) = off, sigma
    if threshold >= OPEN:
        return 0.0
    wide, slope = math.sqrt(threshold * S[0]), S[1] / S[0]
    low, high = max(-wide, off_r - WIDEST * sigma_r), min(wide, off_r + WIDEST * sigma_r)
    if low >= high:
        return 1.0
    across = (S[2] - S[1] * slope) / S[0]
    middle, half, total = 0.5 * (low + high), 0.5 * (high - low), 0.0
    for j in range(NODES):
        angle = math.pi * ((j + 0.5) / NODES - 0.5)
        x = middle + half * math.sin(angle)
        deep = math.sqrt(max((wide * wide - x * x) * across, 0.0))
        z, centre = (x - off_r) / sigma_r, slope * x - off_b
        inside = normal_below((centre + deep) / sigma_b) - normal_below((centre - deep) / sigma_b)
        total += math.cos(angle) * math.exp(-0.5 * z * z) * inside
    share = total * half * math.pi / NODES / (sigma_r * math.sqrt(2.0 * math.pi))
    return min(max(1.0 - share, 0.0), 1.0)


# ---- laws -----------------------------------------------------------------------------------------------------------
@part
def begin_drawn(ends, f, first, n, own):
    """Choose the laws of n realisations from number `first` on, for tracker f."""
    for i in range(n):
        u, _ = uniforms(ends.choice[0], ends.choice[1], first + i, 0)
        law, total = 0, ends.shares[f, 0]
        while u >= total and law < ends.length.shape[1]:
            law += 1
            total += ends.shares[f, law]
        own[LAW, i], own[LONGEST, i], own[ENDED, i] = float(law), 0.0, 0.0
        own[RATIO:, i] = 1.0


@inline
def undetected_by(laws, law, longest, misses, k, detection):
    """h: the probability that the target of a confirmed track is not detected under a law; 0 is the law itself."""
    if law > 0 and longest < laws.length[law - 1]:
        return laws.undetected[law - 1, misses, k]
    return 1.0 - detection


@part
def detect_drawn(detections, laws, scan, status, predicted, target, plots, own):
    """Set target.detected as each realisation's law has it, and bring the ratios in own (RATIO + R, CHUNK) up to date.

    Before association: predicted (5, CHUNK) is of this scan. A realisation whose track has ended has no more plots.
    """
    k, certain, detection = scan.k, detections.certain[scan.k], detections.probability
    detected, z, most = target.detected, target.z, laws.length.max()
    for i in range(scan.count):
        u, _ = uniforms(detections.key[0], detections.key[1], scan.first + i, k)
        if own[ENDED, i] > 0.0 or certain >= 0 or status[STATE, i] != CONFIRMED:
            seen = u < detection if certain < 0 else certain > 0
            detected[i] = 1.0 if seen and own[ENDED, i] == 0.0 else 0.0
            continue
        misses, longest = int(status[MISSES, i]), max(own[LONGEST, i], status[MISSES, i])
        own[LONGEST, i] = longest
        h = undetected_by(laws, int(own[LAW, i]), longest, misses, k, detection)
        detected[i] = 1.0 if u < 1.0 - h else 0.0
        if longest >= most:  # whatever law it is drawn from, the rest is as it is
            continue
        hit, c = detected[i] > 0.0, 0.0
        S = (predicted[2, i], predicted[3, i], predicted[4, i])
        if hit:
            irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
            hit = distance_squared(z[0, i] - predicted[0, i], z[1, i] - predicted[1, i], (irr, irb, ibb)) <= laws.gate
        if not hit:
            mean_r, mean_b = plots.course.shift[0, 0, i], plots.course.shift[1, 0, i]
            mean_r, mean_b = mean_r + plots.course.truth[0, 0], mean_b + plots.course.truth[1, 0]
            off = (mean_r - predicted[0, i], mean_b - predicted[1, i])
            c = outside(off, S, laws.gate, (plots.sigma[0], plots.sigma[1]))
        for j in range(laws.length.size):
            h = undetected_by(laws, j + 1, longest, misses, k, detection)
            factor = (1.0 - h) / detection if hit else (h + (1.0 - h) * c) / (1.0 - detection + detection * c)
            own[RATIO + j, i] = min(own[RATIO + j, i] * factor, LARGEST)


# ---- sums -----------------------------------------------------------------------------------------------------------
@inline
def weight_of(shares, own, i):
    """The weight of realisation i so far: the law itself over the mixture of all."""
    total = shares[0]
    for j in range(shares.size - 1):
        total += shares[1 + j] * own[RATIO + j, i]
    return 1.0 / total


@part
def add_ended(limit, n, tracks, status, course, laws, own, ended):
    """Count the n realisations whose first confirmed track ends at this scan by their weights, in ended (KINDS, 4).

    limit (r, b): the error, in m and rad, beyond which a track has lost its target.
    """
    for i in range(n):
        if status[TRACKS_ENDED, i] > 0.0 and own[ENDED, i] == 0.0:
            own[ENDED, i] = 1.0
            add_weight(weight_of(laws.shares, own, i), ended, LOST if off_target(tracks, course, limit, i) else DROPPED)


# ---- a block --------------------------------------------------------------------------------------------------------
@part
def scan_target(detections, field, trackers, laws, f, scan, chunk):
    """Process a scan of the target's tracks of tracker f: detection as drawn, association, update, and the rules."""
    work, own, target, plots, kept, counts = chunk
    tracks, status, manoeuvre = tracks_of(work, f), work.status[f], trackers.manoeuvre[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    detect_drawn(detections, laws, scan, status, work.predicted, target, plots, own[f])
    associate(field, rule_of(trackers, f), scan, tracks, status, target, work, counts)
    joint = trackers.association[f] == PDA
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, joint, work.association)
    judge(trackers, f, scan.count, tracks, status, plots.course, kept, counts)


@kernel
def simulate_ends(world, detections, field, trackers, ends, work, first, total, sums):
    """Add the weighted ends of the target's first confirmed tracks to sums, an EndSums.

    Arguments as those of `blocks.simulate_block`: of realisations drawn as they are the tracks are the same.
    """
    F, K, R = trackers.gate.size, world.dt.size, ends.length.shape[1]
    plots, shift, z = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK)), np.empty((2, CHUNK))
    own, kept, counts = np.empty((F, RATIO + R, CHUNK)), np.empty(CHUNK), np.zeros(COUNTS)
    target = Target(np.empty(CHUNK), z, True)
    for done in range(0, total, CHUNK):
        reset(work)
        plots[:] = 0.0
        n = min(CHUNK, total - done)
        for f in range(F):
            begin_drawn(ends, f, first + done, n, own[f])
        for k in range(K):
            scan, course = Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            measure_target(world, first + done, k, plots, z, shift)
            chunk = Chunk(work, own, target, Plots(course, world.fresh[k]), kept, counts)
            for f in range(F):
                if trackers.association[f] == KNOWN:
                    continue
                laws = Laws(ends.shares[f], ends.length[f], ends.undetected[f], trackers.gate[f])
                scan_target(detections, field, trackers, laws, f, scan, chunk)
                limit = (trackers.lost[f] * trackers.sigma[0], trackers.lost[f] * trackers.sigma[1])
                add_ended(limit, n, tracks_of(work, f), work.status[f], course, laws, own[f], sums.ended[f, k])
        for f in range(F):
            for i in range(n):
                if trackers.association[f] != KNOWN:
                    add_drawn(weight_of(ends.shares[f], own[f], i), own[f, LAW, i] == 0.0, sums.ended_drawn[f])
