"""Tracks that false plots begin, drawn where they are confirmed, and where they live long: more plots in their gates.

Of a share of the realisations the gate of a tentative track contains false plots more often than it should, of another
that of a confirmed one too, and each realisation counts with the ratio of the laws (importance sampling). What is drawn
at a scan is the number in a box in q and bearing about the gate, within the sector: zero or not, with the probability h
that it is not, in place of the p = 1 - exp(-μ) of a Poisson number of mean μ, and then a Poisson number that is not
zero. Positions in the box are uniform, as they are in the field; what is in the box but outside the gate is not seen.
The ratio of the laws is that of the answers "zero or not" alone, (1 - h) / (1 - p) or h / p each scan.

h is the number of plots that the rule m of n still needs over the scans that are left, at least p: were p the same at
all scans, and small, all patterns of plots that confirm the track would have equal weights. No h is better then: with i
plots to come in j scans, η the chance that a plot of the box is in the gate, the least second moment of the weight is
M(i, j) = min over h of M(i-1, j-1)/(ηh) + M(i, j-1)/(1-h) = (√(M(i-1, j-1)/η) + √M(i, j-1))² in units of (ηp)^(2i), so
√M(i, j) = η^(-i/2) C(j, i) by Pascal's rule, at h = i/j. Of a confirmed track h is one over the misses in a row that
still drop it. Letters as in `field`, and

    p, h        probability that the box contains a false plot: as it is, and as it is drawn
    ratio       a law that is drawn from over the law itself

The target's track, drawn where it ends, and weights that make up for it (importance sampling).

A share of the realisations is drawn as it is, the others by laws of three kinds:

    runs        the target's plots are missed more often than they should, once its track is confirmed, until as many
                misses in a row have come as the law is for
    far         errors of the plots of a young track are stretched along one direction, in range and bearing
    false       the gate of the young track contains a false plot more often than it should, until one has come
    seduced     likewise, in place of the target's plot: that is missed, and a false one comes

Each realisation counts with the law itself over the mixture of all. Of runs, the ratio of the laws is at first that of
the answers "detected or not". For a tracker a plot outside its gate is a miss like one that is not there; so where the
plots' errors are no longer stretched, it is that of the answers "in the gate or not" alone,

    (1 - h) / P_D   for a plot in the gate,     (h + (1 - h) c) / (1 - P_D + P_D c)   for none,

with h the probability that the target is not detected, as drawn, and c that its plot, if there is one, is outside the
gate: both follow from the scans before. Of false plots it is as above, of the last law that of the answers "both or
not". Letters as in `gate`, and

    c           probability that the target's plot is outside the gate
    p           probability that the box about a gate contains a false plot
    u, s        direction of errors, a unit vector; how much they are stretched along it
    ratio       of a law that is drawn from over the law itself
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import add_drawn, add_weight, uniform, uniforms
from radarsim.studies.sonar.clutter.kernels import tracker
from radarsim.studies.sonar.kernels.shared_gains import move_and_measure
from radarsim.studies.sonar.kernels.steps import CHUNK, copy_row
from radarsim.studies.sonar.kernels.sums import Course

MAX_BOX_MEAN = 16.0  # false plots in a box: with more, the gate contains some anyway, and the field is left as it is
NO_PLOT = (0.0, 0.0, 0.0)  # of the target
MAX_RATIO = 1e280  # far beyond any ratio whose reciprocal counts
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


class Box(NamedTuple):
    """A box of size dq by db from q on and from bearing b on, relative to the track; its mean number of false plots."""

    q: float
    dq: float
    b: float
    db: float
    mean: float


@inline
def gate_box(cells, gate, threshold):
    """The box about a gate, within the sector."""
    q0, dq, nq, b0, db, nb, ring, density = cells
    half_r, half_b = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    r_min, r_max = max(gate.r - half_r, 0.0), gate.r + half_r
    q_min, q_max = max(0.5 * r_min * r_min, q0), min(0.5 * r_max * r_max, q0 + dq * nq)
    sector = nb * db
    if ring:
        half_b = min(half_b, 0.5 * sector)
        b_left, b_right = -half_b, half_b
    else:
        # As in `tracker.add_false_plots`: without whole turns, relative to the middle of the sector.
        b = gate.b - tracker.TURN * np.floor((gate.b - b0) / tracker.TURN - 0.5 * sector / tracker.TURN + 0.5)
        b_left, b_right = max(-half_b, b0 - b), min(half_b, b0 + sector - b)
    depth, width = max(q_max - q_min, 0.0), max(b_right - b_left, 0.0)
    return Box(q_min, depth, b_left, width, density * depth * width)


@inline
def positive_poisson(mean, p, v):
    """A Poisson number that is not zero, by inversion of v; p is the probability that it is not zero."""
    n, term = 1, mean * math.exp(-mean) / p
    while v >= term and n < 200:
        v -= term
        n += 1
        term *= mean / n
    return n


@inline
def draw_plots_in_gate(keys, realisation, k, gate, threshold, box, p, h):
    """Draw the plots in a gate's box at scan k: those within the gate, and whether there is any in the box."""
    gated_plots, (irr, irb, ibb, _) = tracker.empty_gate(), tracker.inverse_two(gate.S[0], gate.S[1], gate.S[2])
    u, spare = tracker.random_words(keys[0], keys[1], realisation, k, 0)
    any_in_box = uniform(u) < h
    if any_in_box:
        for n in range(positive_poisson(box.mean, p, uniform(u) / h)):
            u_q, u_b, spare = tracker.plot_position(keys[0], keys[1], realisation, k, n, spare)
            nu_r, nu_b = math.sqrt(2.0 * (box.q + box.dq * u_q)) - gate.r, box.b + box.db * u_b
            gated_plots = tracker.add_plot(gated_plots, nu_r, nu_b, 1.0, (irr, irb, ibb), threshold)
    return gated_plots, any_in_box


@inline
def associate_in_box(keys, rule, draw_index, gate, plot, box, law_probability, drawn_probability):
    """Associate one track with plots drawn in its box.

    Returns the association, the factor of the ratio of the law that shifts the track, and whether any plot is in the
    box. draw_index: realisation and scan. plot: of the target, as in `tracker.associate_track`. law_probability is the
    h of that law, drawn_probability that of the law that the track is drawn from; both are raised to at least p."""
    p = -math.expm1(-box.mean)
    h = max(law_probability, p)
    gated_plots, any_in_box = draw_plots_in_gate(
        keys, draw_index[0], draw_index[1], gate, rule.gate, box, p, max(drawn_probability, p)
    )
    if plot[0] > 0.0:
        irr, irb, ibb, _ = tracker.inverse_two(gate.S[0], gate.S[1], gate.S[2])
        gated_plots = tracker.add_plot(gated_plots, plot[1] - gate.r, plot[2] - gate.b, 0.0, (irr, irb, ibb), rule.gate)
    association = tracker.associate_gated_plots(gated_plots, rule, gate.r, gate.S, gate.settled)
    return association, h / p if any_in_box else (1.0 - h) / (1.0 - p), any_in_box


@part
def associate_false_tracks(field, shift, trackers, f, scan, work, sampling, counts):
    """Associate the false plots of a scan, drawn in boxes or from the field, with every track of a chunk.

    Writes work.association (6, CHUNK) as `tracker.associate` does; sampling (ROWS, CHUNK) holds the ratios."""
    draws, out, counts_address, status = tracker.field_draws(field), work.association, address(counts), work.status[f]
    predicted, plots, rule = work.predicted, work.plots[f], tracker.association_rule(trackers, f)
    status_address, out_address, m, n = address(status), address(out), trackers.m[f], trackers.n[f]
    keys, max_misses, holds = (shift.plots[0], shift.plots[1]), trackers.misses[f], shift.shares[2] > 0.0
    for i in range(scan.count):
        if status[tracker.STATE, i] == tracker.NONE:
            out[:, i] = 0.0
            continue
        status[tracker.TIME_SINCE_PLOT, i] += scan.dt
        position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = tracker.track_gate(position, S, plots[i] > 1.5, rule.speed * status[tracker.TIME_SINCE_PLOT, i])
        box, tentative = gate_box(draws.cells, gate, rule.gate), status[tracker.STATE, i] == tracker.TENTATIVE
        if (tentative or holds) and 0.0 < box.mean <= MAX_BOX_MEAN:
            law_probability = (
                (m - status[tracker.HITS, i]) / (n - status[tracker.AGE, i])
                if tentative
                else 1.0 / (max_misses - status[tracker.MISSES, i])
            )
            drawn_probability = law_probability if sampling[LAW, i] > (0.0 if tentative else 1.0) else 0.0
            association, factor, _ = associate_in_box(
                keys, rule, (scan.first + i, scan.k), gate, NO_PLOT, box, law_probability, drawn_probability
            )
            sampling[CONFIRMED_RATIO, i] = min(sampling[CONFIRMED_RATIO, i] * (factor if tentative else 1.0), MAX_RATIO)
            sampling[HELD_RATIO, i] = min(sampling[HELD_RATIO, i] * factor, MAX_RATIO)
        else:
            association = tracker.associate_track(draws, rule, scan.first + i, scan.k, NO_PLOT, gate, counts_address)
        tracker.record_association(status_address, i, association, out_address)


@part
def choose_false_laws(shift, first, n, status, sampling):
    """Choose the laws of n new tracks; scores are counted only of those drawn as they are."""
    for i in range(n):
        u, _ = uniforms(shift.choice[0], shift.choice[1], first + i, 0)
        sampling[LAW, i] = 0.0 if u < shift.shares[0] else 1.0 if u < shift.shares[0] + shift.shares[1] else 2.0
        sampling[CONFIRMED_RATIO, i], sampling[HELD_RATIO, i], sampling[SCANS_HELD, i] = 1.0, 1.0, 0.0
        if sampling[LAW, i] > 0.0:
            status[tracker.FIRST, i] = -1.0


@inline
def track_weight(shares, sampling, i):
    """The weight of track i so far: the law itself over the mixture of all laws."""
    return 1.0 / (shares[0] + shares[1] * sampling[CONFIRMED_RATIO, i] + shares[2] * sampling[HELD_RATIO, i])


@part
def count_held_tracks(shares, sampling, state, n, held_sums):
    """Count the confirmed tracks among n at a scan, by their weights so far; state (CHUNK,)."""
    for i in range(n):
        if state[i] == tracker.CONFIRMED:
            add_weight(track_weight(shares, sampling, i), held_sums, int(sampling[SCANS_HELD, i]))
            sampling[SCANS_HELD, i] += 1.0


@part
def step_false_tracks(field, shift, trackers, f, scan, work, sampling, counts):
    """Process scan k > 0 of the tracks of a chunk; return whether any is alive."""
    tracks, status, manoeuvre = tracker.tracks_of_tracker(work, f), work.status[f], trackers.manoeuvre[f]
    tracker.predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate_false_tracks(field, shift, trackers, f, scan, work, sampling, counts)
    joint = trackers.association[f] == tracker.PDA
    tracker.update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, joint, work.association)
    return tracker.judge_false_tracks(trackers, f, scan.count, tracks, status, counts)


@kernel
def simulate_false_tracks(seeds, field, shift, trackers, work, dt, first, total, scores, sums):
    """Add the weighted sums of tracks that false plots begin at scan 0 to sums.

    Scores of the tracks drawn as they are go to scores (F, T + 1). Other arguments as in
    `tracker.simulate_false_tracks`."""
    z = np.empty((2, CHUNK))
    detected = np.ones(CHUNK)
    counts = np.zeros(tracker.COUNTS)
    sampling = np.zeros((ROWS, CHUNK))
    for done in range(0, total, CHUNK):
        tracker.reset_tracks(work)
        n = min(CHUNK, total - done)
        tracker.draw_uniform_positions(seeds, field, first + done, n, z)
        for f in range(trackers.gate.size):
            tracks, status = tracker.tracks_of_tracker(work, f), work.status[f]
            if trackers.association[f] == tracker.KNOWN:
                continue
            scan, target = tracker.Scan(first + done, n, 0, dt[0]), tracker.Target(detected, z, True)
            tracker.step_tracker(trackers, f, field, scan, tracks, target, work, counts)
            choose_false_laws(shift, first + done, n, status, sampling)
            for k in range(1, dt.size):
                scan = tracker.Scan(first + done, n, k, dt[k])
                any_alive = step_false_tracks(field, shift, trackers, f, scan, work, sampling, counts)
                count_held_tracks(shift.shares, sampling, status[tracker.STATE], n, sums.held[f])
                if not any_alive:
                    break
            for i in range(n):
                add_drawn(track_weight(shift.shares, sampling, i), sampling[LAW, i] == 0.0, sums.drawn[f])
            tracker.add_scores(trackers.thresholds, n, status[tracker.FIRST], status[tracker.BEST], scores[f])


# ---- ends ------------------------------------------------------------------------------------------------------------
YOUNG_SCANS = 3.0  # a track is young in the scans of the rule that confirms it, and in so many more
QUADRATURE_NODES = 48  # error under 10⁻¹³ for gates up to 60 σ² wide
MAX_LOG_RATIO = 600.0  # far beyond any ratio whose reciprocal counts
MAX_SIGMAS = 8.5  # a plot is farther from its mean once in 10¹⁶
END_KINDS = 4  # the last two: a false plot came into the gate of the young track, but not in place of the target's
DROPPED, LOST, DROPPED_AFTER, LOST_AFTER = range(END_KINDS)
# Rows of the state of importance sampling of a realisation, after LAW (0 is the law itself): the longest run of misses
# since the confirmation; whether the track has ended; whether a false plot has come, and one in place of the target's;
# p of this scan, 0 where no plot is drawn in a box; by how much errors in range and bearing are stretched; ratios of
# the laws.
LONGEST_RUN, HAS_ENDED, FALSE_CAME, SEDUCED, BOX_PROBABILITY, PUSH_R, PUSH_B, FIRST_RATIO = range(1, 9)


class EndLaws(NamedTuple):
    """The laws from which the target's tracks of F trackers are drawn: R of runs, N of far plots, 2 of false plots."""

    choice: np.ndarray  #: (2,) key of the stream that chooses the law of each realisation
    plots: np.ndarray  #: (2,) key of false plots in boxes
    shares: np.ndarray  #: (F, 1 + R + N + 2) of the law itself and of the other laws, in this order; the sum is one
    length: np.ndarray  #: (F, R) length of the run of misses that a law produces
    #: (F, R, L, K) probability that the target is not detected at scan k by tracks with i misses in a row
    undetected: np.ndarray
    young: np.ndarray  #: (F, J) the first scans that may give a plot, -1 where there are fewer
    direction: np.ndarray  #: (F, N, J) of the errors at these
    stretch: np.ndarray  #: (F, N) of them


class TrackerLaws(NamedTuple):
    """The `EndLaws` of one tracker, without the axis F; its rule, and the age up to which a track is young."""

    shares: np.ndarray  #: (1 + R + N + 2,)
    length: np.ndarray  #: (R,)
    undetected: np.ndarray  #: (R, L, K)
    young: np.ndarray  #: (J,)
    direction: np.ndarray  #: (N, J)
    stretch: np.ndarray  #: (N,)
    rule: tracker.AssociationRule
    young_age: float


class EndSums(NamedTuple):
    """Sums of a block by weights w, for F trackers over K scans."""

    #: (F, K, END_KINDS, 4) Σw, Σw², number, Σw⁴ of realisations whose first confirmed track ends at a scan
    ended: np.ndarray
    ended_drawn: np.ndarray  #: (F, 3) number of realisations drawn as they are, Σw and Σw² of all


@inline
def normal_cdf(x):
    """Distribution function of the unit normal."""
    return 0.5 * math.erfc(-math.sqrt(0.5) * x)


@kernel
def probability_outside_gate(off, S, threshold, sigma):
    """c: the probability that a plot is outside a gate of covariance S (rr, rb, bb).

    off (r, b) is the plot's mean relative to the centre of the gate, sigma (r, b) its σ, in m and rad; the errors in
    range and bearing are independent. Integrates over the range the density times the probability that the bearing is
    in the gate. With the sine of an angle for the range the integrand is smooth and periodic, so that the midpoint rule
    converges exponentially."""
    (off_r, off_b), (sigma_r, sigma_b) = off, sigma
    if threshold >= tracker.OPEN_GATE:
        return 0.0
    half_r, slope = math.sqrt(threshold * S[0]), S[1] / S[0]
    x_min, x_max = max(-half_r, off_r - MAX_SIGMAS * sigma_r), min(half_r, off_r + MAX_SIGMAS * sigma_r)
    if x_min >= x_max:
        return 1.0
    across = (S[2] - S[1] * slope) / S[0]
    middle, half, total = 0.5 * (x_min + x_max), 0.5 * (x_max - x_min), 0.0
    for j in range(QUADRATURE_NODES):
        angle = math.pi * ((j + 0.5) / QUADRATURE_NODES - 0.5)
        x = middle + half * math.sin(angle)
        half_chord = math.sqrt(max((half_r * half_r - x * x) * across, 0.0))
        z, centre = (x - off_r) / sigma_r, slope * x - off_b
        inside = normal_cdf((centre + half_chord) / sigma_b) - normal_cdf((centre - half_chord) / sigma_b)
        total += math.cos(angle) * math.exp(-0.5 * z * z) * inside
    share = total * half * math.pi / QUADRATURE_NODES / (sigma_r * math.sqrt(2.0 * math.pi))
    return min(max(1.0 - share, 0.0), 1.0)


# ---- laws -----------------------------------------------------------------------------------------------------------
@part
def write_young_errors(world, young, first, errors):
    """Write the errors of the target's plots at the scans `young` (J,), over their σ, to errors (J, 2, CHUNK)."""
    plots = np.zeros((2, 4, CHUNK))
    for j in range(young.size):
        move_and_measure(world, first, max(young[j], 0), plots)
        for c in range(2):
            for i in range(CHUNK):
                errors[j, c, i] = plots[c, 1, i] / world.fresh[young[j], c] if young[j] >= 0 else 0.0


@inline
def project_errors(direction, errors, c, i):
    """Project the errors (J, 2, CHUNK) of realisation i in coordinate c onto a direction u (J,)."""
    total = 0.0
    for j in range(direction.size):
        total += direction[j] * errors[j, c, i]
    return total


@inline
def inner_product(u, v):
    """The inner product of two directions."""
    total = 0.0
    for j in range(u.size):
        total += u[j] * v[j]
    return total


@part
def choose_end_laws(choice, laws, first, n, errors, sampling):
    """Choose the laws of n realisations from number `first` on, stretch errors, and set the ratios of the laws."""
    runs, direction, stretch = laws.length.size, laws.direction, laws.stretch
    for i in range(n):
        u, _ = uniforms(choice[0], choice[1], first + i, 0)
        law, total = 0, laws.shares[0]
        while u >= total and law < laws.shares.size - 1:
            law += 1
            total += laws.shares[law]
        sampling[:, i] = 0.0
        sampling[LAW, i], sampling[FIRST_RATIO:, i] = float(law), 1.0
        stretch_law = law - 1 - runs
        if 0 <= stretch_law < len(direction):
            sampling[PUSH_R, i] = (stretch[stretch_law] - 1.0) * project_errors(direction[stretch_law], errors, 0, i)
            sampling[PUSH_B, i] = (stretch[stretch_law] - 1.0) * project_errors(direction[stretch_law], errors, 1, i)
        else:
            stretch_law = 0  # no error is stretched
        for j in range(len(direction)):
            cosine = inner_product(direction[j], direction[stretch_law])
            r = project_errors(direction[j], errors, 0, i) + cosine * sampling[PUSH_R, i]
            b = project_errors(direction[j], errors, 1, i) + cosine * sampling[PUSH_B, i]
            square = stretch[j] * stretch[j]
            sampling[FIRST_RATIO + runs + j, i] = (
                math.exp(min(0.5 * (r * r + b * b) * (1.0 - 1.0 / square), MAX_LOG_RATIO)) / square
            )


@part
def stretch_plots(laws, k, n, z, sigma, sampling, out):
    """Write the target's plots (2, CHUNK) at scan k to out, with errors stretched by the law of each realisation."""
    runs = laws.length.size
    copy_row(z[0], out[0])
    copy_row(z[1], out[1])
    for j in range(laws.young.size):
        for i in range(n if laws.young[j] == k else 0):
            stretch_law = int(sampling[LAW, i]) - 1 - runs
            if 0 <= stretch_law < len(laws.direction):
                out[0, i] += laws.direction[stretch_law, j] * sampling[PUSH_R, i] * sigma[0]
                out[1, i] += laws.direction[stretch_law, j] * sampling[PUSH_B, i] * sigma[1]


@inline
def tracker_laws(ends, trackers, f):
    """The laws of tracker f."""
    stretched, rule = (ends.young[f], ends.direction[f], ends.stretch[f]), tracker.association_rule(trackers, f)
    return TrackerLaws(
        ends.shares[f], ends.length[f], ends.undetected[f], *stretched, rule, trackers.n[f] + YOUNG_SCANS
    )


@inline
def undetected_probability(laws, law, longest, misses, k, detection):
    """h: the probability under a law that the target of a confirmed track is not detected; 0 is the law itself."""
    if 0 < law <= laws.length.size and longest < laws.length[law - 1]:
        return laws.undetected[law - 1, misses, k]
    return 1.0 - detection


@part
def set_box_probabilities(field, laws, scan, tracks, status, predicted, sampling):
    """Set the p of this scan: false plots are drawn in a box while a track is young."""
    cells, plots = field.cells, tracks.plots
    for i in range(scan.count):
        sampling[BOX_PROBABILITY, i] = 0.0
        if (
            status[tracker.STATE, i] != tracker.NONE
            and status[tracker.AGE, i] < laws.young_age
            and laws.shares[-1] > 0.0
        ):
            position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
            reach = laws.rule.speed * (status[tracker.TIME_SINCE_PLOT, i] + scan.dt)
            mean = gate_box(cells, tracker.track_gate(position, S, plots[i] > 1.5, reach), laws.rule.gate).mean
            sampling[BOX_PROBABILITY, i] = -math.expm1(-mean) if 0.0 < mean <= MAX_BOX_MEAN else 0.0


@inline
def hastened_probability(laws, age):
    """The probability, as drawn, that an event that has not come yet comes at this scan of a young track.

    Early scans are preferred: with L scans left it is L times as likely now as at the last of them."""
    return 2.0 / (laws.young_age - age + 1.0)


@inline
def seduction_probability(laws, age, miss_probability, p):
    """η: the probability, as drawn, that the target's plot is missed and a false one is in the box."""
    return max(hastened_probability(laws, age), miss_probability * p)


@inline
def miss_probability_with_seduction(eta, miss_probability, p):
    """The probability that the target's plot is missed, where a miss with a false plot in the box is drawn with η."""
    return eta + (1.0 - eta) * miss_probability * (1.0 - p) / (1.0 - miss_probability * p)


@inline
def can_be_seduced(laws, k, certain, sampling, i):
    """Whether the law of seduction shifts realisation i at scan k: not where "missed" means "not in the gate"."""
    return sampling[BOX_PROBABILITY, i] > 0.0 and sampling[SEDUCED, i] == 0.0 and certain < 0 and k <= laws.young.max()


@part
def detect_by_laws(detections, laws, scan, status, predicted, target, course, sigma, sampling):
    """Set target.detected by the law of each realisation, and update the ratios of runs in sampling.

    To be called before association: predicted (5, CHUNK) belongs to this scan; plots lie about course with σ (2,) in m
    and rad. A realisation whose track has ended has no more plots."""
    k, certain, detection = scan.k, detections.certain[scan.k], detections.probability
    detected, z, longest_law, unstretched = target.detected, target.z, laws.length.max(), k > laws.young.max()
    for i in range(scan.count):
        u, _ = uniforms(detections.key[0], detections.key[1], scan.first + i, k)
        law, h = int(sampling[LAW, i]), 1.0 - detection
        if law == laws.shares.size - 1 and can_be_seduced(laws, k, certain, sampling, i):
            h = miss_probability_with_seduction(
                seduction_probability(laws, status[tracker.AGE, i], h, sampling[BOX_PROBABILITY, i]),
                h,
                sampling[BOX_PROBABILITY, i],
            )
        if sampling[HAS_ENDED, i] > 0.0 or certain >= 0 or status[tracker.STATE, i] != tracker.CONFIRMED:
            is_detected = u < 1.0 - h if certain < 0 else certain > 0
            detected[i] = 1.0 if is_detected and sampling[HAS_ENDED, i] == 0.0 else 0.0
            continue
        misses, longest = int(status[tracker.MISSES, i]), max(sampling[LONGEST_RUN, i], status[tracker.MISSES, i])
        sampling[LONGEST_RUN, i] = longest
        h = undetected_probability(laws, law, longest, misses, k, detection) if law <= laws.length.size else h
        detected[i] = 1.0 if u < 1.0 - h else 0.0
        if longest >= longest_law:  # under every law plots are then missed as they are
            continue
        in_gate, c = detected[i] > 0.0, 0.0
        if unstretched:
            S = (predicted[2, i], predicted[3, i], predicted[4, i])
            irr, irb, ibb, _ = tracker.inverse_two(S[0], S[1], S[2])
            nu = (z[0, i] - predicted[0, i], z[1, i] - predicted[1, i])
            in_gate = in_gate and tracker.distance_squared(nu[0], nu[1], (irr, irb, ibb)) <= laws.rule.gate
            if not in_gate:
                off_r = course.truth[0, 0] + course.shift[0, 0, i] - predicted[0, i]
                off_b = course.truth[1, 0] + course.shift[1, 0, i] - predicted[1, i]
                c = probability_outside_gate((off_r, off_b), S, laws.rule.gate, (sigma[0], sigma[1]))
        for j in range(laws.length.size):
            h = undetected_probability(laws, j + 1, longest, misses, k, detection)
            factor = (1.0 - h) / detection if in_gate else (h + (1.0 - h) * c) / (1.0 - detection + detection * c)
            sampling[FIRST_RATIO + j, i] = min(sampling[FIRST_RATIO + j, i] * factor, MAX_RATIO)


@inline
def false_plot_probabilities(laws, k, certain, miss_probability, detected, status, sampling, i):
    """The probabilities with which a false plot is drawn about the young track of realisation i.

    Returns h of the law of false plots, h of the law that the realisation is drawn from, and η, zero where seduction
    does not shift it. miss_probability: that the target is not detected; detected: whether it is."""
    age, law, last = status[tracker.AGE, i], int(sampling[LAW, i]), laws.shares.size - 1
    law_probability = hastened_probability(laws, age) if sampling[FALSE_CAME, i] == 0.0 else 0.0
    eta = (
        seduction_probability(laws, age, miss_probability, sampling[BOX_PROBABILITY, i])
        if can_be_seduced(laws, k, certain, sampling, i)
        else 0.0
    )
    drawn_probability = law_probability if law == last - 1 else 0.0
    if law == last and eta > 0.0 and not detected:
        drawn_probability = eta / miss_probability_with_seduction(eta, miss_probability, sampling[BOX_PROBABILITY, i])
    return law_probability, drawn_probability, eta


@part
def associate_young_tracks(field, detections, keys, laws, scan, tracks, status, target, work, sampling, counts):
    """Associate a scan's plots with every track, as `tracker.associate` does, but draw false plots about young tracks.

    Updates the ratios of the last two laws, those of false plots; keys belong to these plots."""
    draws, out, rule, counts_address = tracker.field_draws(field), work.association, laws.rule, address(counts)
    predicted, detected, z, status_address = work.predicted, target.detected, target.z, address(status)
    last, miss_probability = sampling.shape[0] - 1, 1.0 - detections.probability
    for i in range(scan.count):
        if status[tracker.STATE, i] == tracker.NONE:
            out[:, i] = 0.0
            if detected[i] > 0.0:
                tracker.begin_track(tracks, status, i, z, out)
            continue
        status[tracker.TIME_SINCE_PLOT, i] += scan.dt
        position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = tracker.track_gate(position, S, tracks.plots[i] > 1.5, rule.speed * status[tracker.TIME_SINCE_PLOT, i])
        plot, realisation = (detected[i], z[0, i], z[1, i]), scan.first + i
        if sampling[BOX_PROBABILITY, i] > 0.0:
            certain = detections.certain[scan.k]
            box = gate_box(draws.cells, gate, rule.gate)
            is_detected = detected[i] > 0.0
            law_probability, drawn_probability, eta = false_plot_probabilities(
                laws, scan.k, certain, miss_probability, is_detected, status, sampling, i
            )
            association, factor, any_in_box = associate_in_box(
                keys, rule, (realisation, scan.k), gate, plot, box, law_probability, drawn_probability
            )
            sampling[last - 1, i] = min(sampling[last - 1, i] * factor, MAX_RATIO)
            sampling[FALSE_CAME, i] = 1.0 if any_in_box else sampling[FALSE_CAME, i]
            if eta > 0.0:
                seduced = any_in_box and not is_detected
                plain_probability = miss_probability * sampling[BOX_PROBABILITY, i]
                sampling[last, i] = min(
                    sampling[last, i]
                    * (eta / plain_probability if seduced else (1.0 - eta) / (1.0 - plain_probability)),
                    MAX_RATIO,
                )
                sampling[SEDUCED, i] = 1.0 if seduced else 0.0
        else:
            association = tracker.associate_track(draws, rule, realisation, scan.k, plot, gate, counts_address)
        tracker.record_association(status_address, i, association, address(out))


# ---- sums -----------------------------------------------------------------------------------------------------------
@inline
def realisation_weight(shares, sampling, i):
    """The weight of realisation i so far: the law itself over the mixture of all laws."""
    total = shares[0]
    for j in range(shares.size - 1):
        total += shares[1 + j] * sampling[FIRST_RATIO + j, i]
    return 1.0 / total


@part
def count_ended_tracks(limits, n, tracks, status, course, laws, sampling, ended):
    """Count the n realisations whose first confirmed track ends at this scan by their weights, in ended (END_KINDS, 4).

    limits: misses in a row that drop a track, and the error (r, b), in m and rad, with which it has lost its target."""
    misses, lost_error = limits
    for i in range(n):
        if status[tracker.ENDS, i] > 0.0 and sampling[HAS_ENDED, i] == 0.0:
            sampling[HAS_ENDED, i] = 1.0
            lost = status[tracker.MISSES, i] < misses and tracker.is_off_target(tracks, course, lost_error, i)
            false_beside_target = sampling[FALSE_CAME, i] > 0.0 and sampling[SEDUCED, i] == 0.0
            kind = (LOST if lost else DROPPED) + (DROPPED_AFTER if false_beside_target else 0)
            add_weight(realisation_weight(laws.shares, sampling, i), ended, kind)


# ---- a block --------------------------------------------------------------------------------------------------------
@kernel
def simulate_ends(world, detections, field, trackers, ends, work, first, total, sums):
    """Add the weighted ends of the target's first confirmed tracks to sums, an EndSums.

    Arguments as in `tracker.simulate_block`."""
    F, K = trackers.gate.size, world.dt.size
    plots, shift = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK))
    measured, z, detected = np.empty((2, CHUNK)), np.empty((2, CHUNK)), np.empty(CHUNK)
    sampling, plot_counts = np.empty((F, FIRST_RATIO + ends.shares.shape[1] - 1, CHUNK)), np.empty(CHUNK)
    counts, keys, target = np.zeros(tracker.COUNTS), (ends.plots[0], ends.plots[1]), tracker.Target(detected, z, True)
    errors = np.empty((ends.young.shape[1], 2, CHUNK))
    for done in range(0, total, CHUNK):
        tracker.reset_tracks(work)
        plots[:] = 0.0
        n = min(CHUNK, total - done)
        for f in range(F):
            write_young_errors(world, ends.young[f], first + done, errors)
            choose_end_laws(ends.choice, tracker_laws(ends, trackers, f), first + done, n, errors, sampling[f])
        for k in range(K):
            scan, course = tracker.Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            tracker.measure_target(world, first + done, k, plots, measured, shift)
            sigma = world.fresh[k]
            for f in range(F):
                if trackers.association[f] == tracker.KNOWN:
                    continue
                laws = tracker_laws(ends, trackers, f)
                tracks = tracker.tracks_of_tracker(work, f)
                status = work.status[f]
                motion = trackers.period, trackers.sigma, trackers.manoeuvre[f]
                tracker.predict(tracks, scan.dt, *motion, work.predicted)
                stretch_plots(laws, k, n, measured, sigma, sampling[f], z)
                set_box_probabilities(field, laws, scan, tracks, status, work.predicted, sampling[f])
                detect_by_laws(detections, laws, scan, status, work.predicted, target, course, sigma, sampling[f])
                if laws.shares[-1] > 0.0:
                    associate_young_tracks(
                        field, detections, keys, laws, scan, tracks, status, target, work, sampling[f], counts
                    )
                else:
                    tracker.associate(field, laws.rule, scan, tracks, status, target, work, counts)
                joint = trackers.association[f] == tracker.PDA
                tracker.update(tracks, scan.dt, *motion, joint, work.association)
                tracker.judge_target_track(trackers, f, n, tracks, status, course, plot_counts, counts)
                lost_error = (trackers.lost[f] * trackers.sigma[0], trackers.lost[f] * trackers.sigma[1])
                count_ended_tracks(
                    (trackers.misses[f], lost_error), n, tracks, status, course, laws, sampling[f], sums.ended[f, k]
                )
        for f in range(F):
            for i in range(n):
                if trackers.association[f] != tracker.KNOWN:
                    add_drawn(
                        realisation_weight(ends.shares[f], sampling[f], i),
                        sampling[f, LAW, i] == 0.0,
                        sums.ended_drawn[f],
                    )
