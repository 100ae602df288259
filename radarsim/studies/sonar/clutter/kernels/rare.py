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

MOST_MEAN = 16.0  # of a box: where it is larger, false plots are in the gate anyway, and the field is as it is
NO_PLOT = (0.0, 0.0, 0.0)  # of the target
LARGEST = 1e280  # of the ratio: far beyond any whose reciprocal counts
# Which law a track is drawn from; ratios so far of the laws under which tracks are confirmed, and held on; scans held.
ROWS = 4
LAW, FOUND, LONG, HELD = range(ROWS)


class Shift(NamedTuple):
    """How tracks that false plots begin are drawn.

    choice (2,) is the key of the stream that chooses the law of each; plots (2,) that of the plots in boxes. shares
    (3,) of the laws: as they are, so that they are confirmed, and so that they are held on; the sum is one."""

    choice: np.ndarray
    plots: np.ndarray
    shares: np.ndarray


class WeightedSums(NamedTuple):
    """Sums of a block by weights w, for F trackers.

    held (F, K, 4): Σw, Σw², number and Σw⁴ of tracks held for at least 1 … K scans from their confirmation on;
    drawn (F, 3): number of plain ones, Σw and Σw² of all."""

    held: np.ndarray
    drawn: np.ndarray


class Box(NamedTuple):
    """A box of size dq by db from q on and from b on, which is counted from the track; mean number of false plots."""

    q: float
    dq: float
    b: float
    db: float
    mean: float


@inline
def box_of(cells, gate, threshold):
    """The box about a gate, within the sector."""
    q0, dq, nq, b0, db, nb, ring, density = cells
    wide, high = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    near, far = max(gate.r - wide, 0.0), gate.r + wide
    least, most = max(0.5 * near * near, q0), min(0.5 * far * far, q0 + dq * nq)
    sector = nb * db
    if ring:
        high = min(high, 0.5 * sector)
        left, right = -high, high
    else:
        # As in `with_false_plots`: less whole turns from the middle of the sector.
        b = gate.b - tracker.TURN * np.floor((gate.b - b0) / tracker.TURN - 0.5 * sector / tracker.TURN + 0.5)
        left, right = max(-high, b0 - b), min(high, b0 + sector - b)
    deep, broad = max(most - least, 0.0), max(right - left, 0.0)
    return Box(least, deep, left, broad, density * deep * broad)


@inline
def number_when_any(mean, p, v):
    """A Poisson number of this mean that is not zero, by inversion of v; p is the probability that it is not."""
    n, term = 1, mean * math.exp(-mean) / p
    while v >= term and n < 200:
        v -= term
        n += 1
        term *= mean / n
    return n


@inline
def with_drawn_plots(keys, realisation, k, gate, threshold, box, p, h):
    """The plots in a gate of those drawn in its box at scan k, and whether there are any in the box."""
    gated, (irr, irb, ibb, _) = tracker.empty_gate(), tracker.inverse_two(gate.S[0], gate.S[1], gate.S[2])
    u, spare = tracker.cell_words(keys[0], keys[1], realisation, k, 0)
    some = uniform(u) < h
    if some:
        for n in range(number_when_any(box.mean, p, uniform(u) / h)):
            u_q, u_b, spare = tracker.place_in(keys[0], keys[1], realisation, k, n, spare)
            nu_r, nu_b = math.sqrt(2.0 * (box.q + box.dq * u_q)) - gate.r, box.b + box.db * u_b
            gated = tracker.with_plot(gated, nu_r, nu_b, 1.0, (irr, irb, ibb), threshold)
    return gated, some


@inline
def associate_drawn(keys, rule, place, gate, plot, box, needed, drawn):
    """The Association of one track with plots drawn in its box, and the factor of the ratio of the law that shifts it.

    Then whether there are any in the box. place: realisation and scan. plot as in `associate_track`: of the target.
    needed: the probability h of that law; drawn: of the law that the track is drawn from; each if it is not under p."""
    p = -math.expm1(-box.mean)
    h = max(needed, p)
    gated, some = with_drawn_plots(keys, place[0], place[1], gate, rule.gate, box, p, max(drawn, p))
    if plot[0] > 0.0:
        irr, irb, ibb, _ = tracker.inverse_two(gate.S[0], gate.S[1], gate.S[2])
        gated = tracker.with_plot(gated, plot[1] - gate.r, plot[2] - gate.b, 0.0, (irr, irb, ibb), rule.gate)
    found = tracker.associated(gated, rule, gate.r, gate.S, gate.settled)
    return found, h / p if some else (1.0 - h) / (1.0 - p), some


@part
def associate_false(field, shift, trackers, f, scan, work, own, counts):
    """Associate a scan's false plots with every track of a chunk: those drawn in boxes, or those of the field. The
    results go to work.association (6, CHUNK), as those of `tracker.associate`; own (ROWS, CHUNK) has the ratios."""
    draws, out, tally, status = tracker.draws_of(field), work.association, address(counts), work.status[f]
    predicted, plots, rule = work.predicted, work.plots[f], tracker.rule_of(trackers, f)
    lives, taken, m, n = address(status), address(out), trackers.m[f], trackers.n[f]
    keys, most, held_on = (shift.plots[0], shift.plots[1]), trackers.misses[f], shift.shares[2] > 0.0
    for i in range(scan.count):
        if status[tracker.STATE, i] == tracker.NONE:
            out[:, i] = 0.0
            continue
        status[tracker.SINCE, i] += scan.dt
        place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = tracker.gate_of(place, S, plots[i] > 1.5, rule.speed * status[tracker.SINCE, i])
        box, tentative = box_of(draws.cells, gate, rule.gate), status[tracker.STATE, i] == tracker.TENTATIVE
        if (tentative or held_on) and 0.0 < box.mean <= MOST_MEAN:
            rest = (
                (m - status[tracker.HITS, i]) / (n - status[tracker.AGE, i])
                if tentative
                else 1.0 / (most - status[tracker.MISSES, i])
            )
            drawn = rest if own[LAW, i] > (0.0 if tentative else 1.0) else 0.0
            found, factor, _ = associate_drawn(keys, rule, (scan.first + i, scan.k), gate, NO_PLOT, box, rest, drawn)
            own[FOUND, i] = min(own[FOUND, i] * (factor if tentative else 1.0), LARGEST)
            own[LONG, i] = min(own[LONG, i] * factor, LARGEST)
        else:
            found = tracker.associate_track(draws, rule, scan.first + i, scan.k, NO_PLOT, gate, tally)
        tracker.settle(lives, i, found, taken)


@part
def begin_false(shift, first, n, status, own):
    """Choose the laws of the n tracks that have begun; only scores of the plain ones are counted."""
    for i in range(n):
        u, _ = uniforms(shift.choice[0], shift.choice[1], first + i, 0)
        own[LAW, i] = 0.0 if u < shift.shares[0] else 1.0 if u < shift.shares[0] + shift.shares[1] else 2.0
        own[FOUND, i], own[LONG, i], own[HELD, i] = 1.0, 1.0, 0.0
        if own[LAW, i] > 0.0:
            status[tracker.FIRST, i] = -1.0


@inline
def weight_of(shares, own, i):
    """The weight of track i so far: the law itself over the mixture of all."""
    return 1.0 / (shares[0] + shares[1] * own[FOUND, i] + shares[2] * own[LONG, i])


@part
def add_held(shares, own, state, n, held):
    """Count a scan of the n tracks that are confirmed, by their weights so far; state (CHUNK,)."""
    for i in range(n):
        if state[i] == tracker.CONFIRMED:
            add_weight(weight_of(shares, own, i), held, int(own[HELD, i]))
            own[HELD, i] += 1.0


@part
def scan_false(field, shift, trackers, f, scan, work, own, counts):
    """Process scan k > 0 of the tracks of a chunk; returns whether any is left."""
    tracks, status, manoeuvre = tracker.tracks_of(work, f), work.status[f], trackers.manoeuvre[f]
    tracker.predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate_false(field, shift, trackers, f, scan, work, own, counts)
    joint = trackers.association[f] == tracker.PDA
    tracker.update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, joint, work.association)
    return tracker.judge_false(trackers, f, scan.count, tracks, status, counts)


@kernel
def simulate_false(seeds, field, shift, trackers, work, dt, first, total, scores, sums):
    """Add the weighted sums of tracks that false plots begin at scan 0 to sums, and scores of the plain ones to scores.
    Arguments as those of `tracker.simulate_false`; scores (F, T + 1)."""
    z, detected, counts, own = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(tracker.COUNTS), np.zeros((ROWS, CHUNK))
    for done in range(0, total, CHUNK):
        tracker.reset(work)
        n = min(CHUNK, total - done)
        tracker.even_places(seeds, field, first + done, n, z)
        for f in range(trackers.gate.size):
            tracks, status = tracker.tracks_of(work, f), work.status[f]
            if trackers.association[f] == tracker.KNOWN:
                continue
            scan, target = tracker.Scan(first + done, n, 0, dt[0]), tracker.Target(detected, z, True)
            tracker.step(trackers, f, field, scan, tracks, target, work, counts)
            begin_false(shift, first + done, n, status, own)
            for k in range(1, dt.size):
                scan = tracker.Scan(first + done, n, k, dt[k])
                left = scan_false(field, shift, trackers, f, scan, work, own, counts)
                add_held(shift.shares, own, status[tracker.STATE], n, sums.held[f])
                if not left:
                    break
            for i in range(n):
                add_drawn(weight_of(shift.shares, own, i), own[LAW, i] == 0.0, sums.drawn[f])
            tracker.add_scores(trackers.thresholds, n, status[tracker.FIRST], status[tracker.BEST], scores[f])


# ---- ends ------------------------------------------------------------------------------------------------------------
FURTHER = 3.0  # scans after those of the rule that confirms in which a track is young
NODES = 48  # error under 10⁻¹³ for gates up to 60 σ² wide
MOST_LOG = 600.0  # of a ratio: far beyond any whose reciprocal counts
WIDEST = 8.5  # σ of a plot: further from its mean it is once in 10¹⁶
KINDS = 4  # the latter two where a false plot came about the young track, though none in place of the target's
DROPPED, LOST, DROPPED_AFTER, LOST_AFTER = range(KINDS)
# After LAW, 0 being the law itself: the longest run of misses since its confirmation; whether it has ended; whether a
# false plot has come, and one in place of the target's; p of this scan, 0 where it is not drawn; by how much errors in
# range and bearing are stretched; ratios of the laws.
LONGEST, ENDED, CAME, SEDUCED, BOX, PUSH_R, PUSH_B, RATIO = range(1, 9)


class Ends(NamedTuple):
    """How the target's tracks of F trackers are drawn, by R laws of runs, N of far plots, and two of false plots."""

    choice: np.ndarray  #: (2,) key of the stream that chooses the law of each realisation
    plots: np.ndarray  #: (2,) that of false plots in boxes
    shares: np.ndarray  #: (F, 1 + R + N + 2) of the law itself and of the others, in this order; the sum is one
    length: np.ndarray  #: (F, R) of the run of misses that a law is for
    #: (F, R, L, K) probability that the target is not detected at scan k by tracks with i misses in a row
    undetected: np.ndarray
    young: np.ndarray  #: (F, J) the first scans that may give a plot, -1 where there are fewer
    direction: np.ndarray  #: (F, N, J) of the errors at these
    stretch: np.ndarray  #: (F, N) of them


class Laws(NamedTuple):
    """What `Ends` holds of one tracker, without the axis F, its rule, and the scans in which a track is young."""

    shares: np.ndarray  #: (1 + R + N + 2,)
    length: np.ndarray  #: (R,)
    undetected: np.ndarray  #: (R, L, K)
    young: np.ndarray  #: (J,)
    direction: np.ndarray  #: (N, J)
    stretch: np.ndarray  #: (N,)
    rule: tracker.Rule
    young_age: float


class EndSums(NamedTuple):
    """Sums of a block by weights w, for F trackers over K scans."""

    #: (F, K, KINDS, 4) Σw, Σw², number, Σw⁴ of realisations whose first confirmed track of the target ends at a scan
    ended: np.ndarray
    ended_drawn: np.ndarray  #: (F, 3) number of plain ones, Σw and Σw² of all


@inline
def normal_below(x):
    """Distribution function of the unit normal."""
    return 0.5 * math.erfc(-math.sqrt(0.5) * x)


@kernel
def outside(off, S, threshold, sigma):
    """c: the probability that a plot is outside a gate of covariance S (rr, rb, bb), from whose centre its mean is off.

    off and sigma (r, b), in m and rad: the plot's errors in range and bearing are independent. The integral over the
    range of the density there times the share between both ends of the gate in bearing; with the sine of an angle for
    the range it is smooth and periodic, so that the midpoint rule converges exponentially."""
    (off_r, off_b), (sigma_r, sigma_b) = off, sigma
    if threshold >= tracker.OPEN:
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
def young_errors(world, young, first, errors):
    """Write the errors of the target's plots at the scans `young` (J,), over their σ, to errors (J, 2, CHUNK)."""
    plots = np.zeros((2, 4, CHUNK))
    for j in range(young.size):
        move_and_measure(world, first, max(young[j], 0), plots)
        for c in range(2):
            for i in range(CHUNK):
                errors[j, c, i] = plots[c, 1, i] / world.fresh[young[j], c] if young[j] >= 0 else 0.0


@inline
def along(direction, errors, c, i):
    """uᵀ of the errors (J, 2, CHUNK) of realisation i in coordinate c."""
    total = 0.0
    for j in range(direction.size):
        total += direction[j] * errors[j, c, i]
    return total


@inline
def between(one, other):
    """uᵀu of two directions."""
    total = 0.0
    for j in range(one.size):
        total += one[j] * other[j]
    return total


@part
def begin_drawn(choice, laws, first, n, errors, own):
    """Choose the laws of n realisations from number `first` on, stretch errors, and set the ratios that follow."""
    runs, direction, stretch = laws.length.size, laws.direction, laws.stretch
    for i in range(n):
        u, _ = uniforms(choice[0], choice[1], first + i, 0)
        law, total = 0, laws.shares[0]
        while u >= total and law < laws.shares.size - 1:
            law += 1
            total += laws.shares[law]
        own[:, i] = 0.0
        own[LAW, i], own[RATIO:, i] = float(law), 1.0
        far = law - 1 - runs
        if 0 <= far < len(direction):
            own[PUSH_R, i] = (stretch[far] - 1.0) * along(direction[far], errors, 0, i)
            own[PUSH_B, i] = (stretch[far] - 1.0) * along(direction[far], errors, 1, i)
        else:
            far = 0  # nothing is added
        for j in range(len(direction)):
            part_of = between(direction[j], direction[far])
            r = along(direction[j], errors, 0, i) + part_of * own[PUSH_R, i]
            b = along(direction[j], errors, 1, i) + part_of * own[PUSH_B, i]
            squared = stretch[j] * stretch[j]
            own[RATIO + runs + j, i] = math.exp(min(0.5 * (r * r + b * b) * (1.0 - 1.0 / squared), MOST_LOG)) / squared


@part
def stretched(laws, k, n, z, sigma, own, out):
    """Write the target's plots (2, CHUNK) at scan k to out, with their errors as each realisation's law has them."""
    runs = laws.length.size
    copy_row(z[0], out[0])
    copy_row(z[1], out[1])
    for j in range(laws.young.size):
        for i in range(n if laws.young[j] == k else 0):
            far = int(own[LAW, i]) - 1 - runs
            if 0 <= far < len(laws.direction):
                out[0, i] += laws.direction[far, j] * own[PUSH_R, i] * sigma[0]
                out[1, i] += laws.direction[far, j] * own[PUSH_B, i] * sigma[1]


@inline
def laws_of(ends, trackers, f):
    """The laws of tracker f."""
    far, rule = (ends.young[f], ends.direction[f], ends.stretch[f]), tracker.rule_of(trackers, f)
    return Laws(ends.shares[f], ends.length[f], ends.undetected[f], *far, rule, trackers.n[f] + FURTHER)


@inline
def undetected_by(laws, law, longest, misses, k, detection):
    """h: the probability that the target of a confirmed track is not detected under a law; 0 is the law itself."""
    if 0 < law <= laws.length.size and longest < laws.length[law - 1]:
        return laws.undetected[law - 1, misses, k]
    return 1.0 - detection


@part
def look(field, laws, scan, tracks, status, predicted, own):
    """Set p of this scan, where false plots are drawn in a box: while a track is young."""
    cells, plots = field.cells, tracks.plots
    for i in range(scan.count):
        own[BOX, i] = 0.0
        if (
            status[tracker.STATE, i] != tracker.NONE
            and status[tracker.AGE, i] < laws.young_age
            and laws.shares[-1] > 0.0
        ):
            place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
            reach = laws.rule.speed * (status[tracker.SINCE, i] + scan.dt)
            mean = box_of(cells, tracker.gate_of(place, S, plots[i] > 1.5, reach), laws.rule.gate).mean
            own[BOX, i] = -math.expm1(-mean) if 0.0 < mean <= MOST_MEAN else 0.0


@inline
def sooner(laws, age):
    """The probability of what has not come yet to come at this scan of a young track, as drawn: rather sooner. With L
    scans left it is L times as likely now as at the last of them."""
    return 2.0 / (laws.young_age - age + 1.0)


@inline
def seduction(laws, age, missed, p):
    """η: the probability that the target's plot is missed and a false one is in the box, as it is drawn."""
    return max(sooner(laws, age), missed * p)


@inline
def missed_if_seduced(eta, missed, p):
    """The probability that the target's plot is missed, where that and a false plot in the box are drawn with η."""
    return eta + (1.0 - eta) * missed * (1.0 - p) / (1.0 - missed * p)


@inline
def may_be_seduced(laws, k, certain, own, i):
    """Whether the law of seduction shifts realisation i at scan k: not where "missed" is "not in the gate"."""
    return own[BOX, i] > 0.0 and own[SEDUCED, i] == 0.0 and certain < 0 and k <= laws.young.max()


@part
def detect_drawn(detections, laws, scan, status, predicted, target, course, sigma, own):
    """Set target.detected as each realisation's law has it, and bring the ratios of runs in own up to date.

    Before association: predicted (5, CHUNK) belongs to this scan; plots lie about course with σ (2,) in m and rad. A
    realisation whose track has ended has no more plots."""
    k, certain, detection = scan.k, detections.certain[scan.k], detections.probability
    detected, z, most, free = target.detected, target.z, laws.length.max(), k > laws.young.max()
    for i in range(scan.count):
        u, _ = uniforms(detections.key[0], detections.key[1], scan.first + i, k)
        law, h = int(own[LAW, i]), 1.0 - detection
        if law == laws.shares.size - 1 and may_be_seduced(laws, k, certain, own, i):
            h = missed_if_seduced(seduction(laws, status[tracker.AGE, i], h, own[BOX, i]), h, own[BOX, i])
        if own[ENDED, i] > 0.0 or certain >= 0 or status[tracker.STATE, i] != tracker.CONFIRMED:
            seen = u < 1.0 - h if certain < 0 else certain > 0
            detected[i] = 1.0 if seen and own[ENDED, i] == 0.0 else 0.0
            continue
        misses, longest = int(status[tracker.MISSES, i]), max(own[LONGEST, i], status[tracker.MISSES, i])
        own[LONGEST, i] = longest
        h = undetected_by(laws, law, longest, misses, k, detection) if law <= laws.length.size else h
        detected[i] = 1.0 if u < 1.0 - h else 0.0
        if longest >= most:  # whatever law it is drawn from, the rest is as it is
            continue
        hit, c = detected[i] > 0.0, 0.0
        if free:
            S = (predicted[2, i], predicted[3, i], predicted[4, i])
            irr, irb, ibb, _ = tracker.inverse_two(S[0], S[1], S[2])
            nu = (z[0, i] - predicted[0, i], z[1, i] - predicted[1, i])
            hit = hit and tracker.distance_squared(nu[0], nu[1], (irr, irb, ibb)) <= laws.rule.gate
            if not hit:
                off_r = course.truth[0, 0] + course.shift[0, 0, i] - predicted[0, i]
                off_b = course.truth[1, 0] + course.shift[1, 0, i] - predicted[1, i]
                c = outside((off_r, off_b), S, laws.rule.gate, (sigma[0], sigma[1]))
        for j in range(laws.length.size):
            h = undetected_by(laws, j + 1, longest, misses, k, detection)
            factor = (1.0 - h) / detection if hit else (h + (1.0 - h) * c) / (1.0 - detection + detection * c)
            own[RATIO + j, i] = min(own[RATIO + j, i] * factor, LARGEST)


@inline
def drawn_false(laws, k, certain, missed, detected, status, own, i):
    """How a false plot is drawn about the young track of realisation i. The probability h of the law of false plots,
    that of the law that the realisation is drawn from, and η, zero where it is not shifted. missed: the probability
    that the target is not detected; detected: whether it is."""
    age, law, last = status[tracker.AGE, i], int(own[LAW, i]), laws.shares.size - 1
    needed = sooner(laws, age) if own[CAME, i] == 0.0 else 0.0
    eta = seduction(laws, age, missed, own[BOX, i]) if may_be_seduced(laws, k, certain, own, i) else 0.0
    drawn = needed if law == last - 1 else 0.0
    if law == last and eta > 0.0 and not detected:
        drawn = eta / missed_if_seduced(eta, missed, own[BOX, i])
    return needed, drawn, eta


@part
def associate_young(field, detections, keys, laws, scan, tracks, status, target, work, own, counts):
    """Associate a scan's plots with every track, as `tracker.associate`; about young tracks false plots are drawn. The
    ratios of the laws of false plots, the last two, are brought up to date; keys belong to those plots."""
    draws, out, rule, tally = tracker.draws_of(field), work.association, laws.rule, address(counts)
    predicted, detected, z, lives = work.predicted, target.detected, target.z, address(status)
    last, missed = own.shape[0] - 1, 1.0 - detections.probability
    for i in range(scan.count):
        if status[tracker.STATE, i] == tracker.NONE:
            out[:, i] = 0.0
            if detected[i] > 0.0:
                tracker.begin(tracks, status, i, z, out)
            continue
        status[tracker.SINCE, i] += scan.dt
        place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = tracker.gate_of(place, S, tracks.plots[i] > 1.5, rule.speed * status[tracker.SINCE, i])
        plot, realisation = (detected[i], z[0, i], z[1, i]), scan.first + i
        if own[BOX, i] > 0.0:
            certain, box, seen = detections.certain[scan.k], box_of(draws.cells, gate, rule.gate), detected[i] > 0.0
            needed, drawn, eta = drawn_false(laws, scan.k, certain, missed, seen, status, own, i)
            found, factor, some = associate_drawn(keys, rule, (realisation, scan.k), gate, plot, box, needed, drawn)
            own[last - 1, i] = min(own[last - 1, i] * factor, LARGEST)
            own[CAME, i] = 1.0 if some else own[CAME, i]
            if eta > 0.0:
                both, plainly = some and not seen, missed * own[BOX, i]
                own[last, i] = min(own[last, i] * (eta / plainly if both else (1.0 - eta) / (1.0 - plainly)), LARGEST)
                own[SEDUCED, i] = 1.0 if both else 0.0
        else:
            found = tracker.associate_track(draws, rule, realisation, scan.k, plot, gate, tally)
        tracker.settle(lives, i, found, address(out))


# ---- sums -----------------------------------------------------------------------------------------------------------
@inline
def weight_of_ends(shares, own, i):
    """The weight of realisation i so far: the law itself over the mixture of all."""
    total = shares[0]
    for j in range(shares.size - 1):
        total += shares[1 + j] * own[RATIO + j, i]
    return 1.0 / total


@part
def add_ended(limits, n, tracks, status, course, laws, own, ended):
    """Count the n realisations whose first confirmed track ends at this scan by their weights, in ended (KINDS, 4).

    limits: misses in a row that drop a track, and the error (r, b), in m and rad, with which it has lost its target."""
    misses, beyond = limits
    for i in range(n):
        if status[tracker.ENDS, i] > 0.0 and own[ENDED, i] == 0.0:
            own[ENDED, i] = 1.0
            lost = status[tracker.MISSES, i] < misses and tracker.off_target(tracks, course, beyond, i)
            beside = own[CAME, i] > 0.0 and own[SEDUCED, i] == 0.0
            kind = (LOST if lost else DROPPED) + (DROPPED_AFTER if beside else 0)
            add_weight(weight_of_ends(laws.shares, own, i), ended, kind)


# ---- a block --------------------------------------------------------------------------------------------------------
@kernel
def simulate_ends(world, detections, field, trackers, ends, work, first, total, sums):
    """Add the weighted ends of the target's first confirmed tracks to sums, an EndSums. Arguments as those of
    `tracker.simulate_block`."""
    F, K = trackers.gate.size, world.dt.size
    plots, shift = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK))
    measured, z, detected = np.empty((2, CHUNK)), np.empty((2, CHUNK)), np.empty(CHUNK)
    own, kept = np.empty((F, RATIO + ends.shares.shape[1] - 1, CHUNK)), np.empty(CHUNK)
    counts, keys, target = np.zeros(tracker.COUNTS), (ends.plots[0], ends.plots[1]), tracker.Target(detected, z, True)
    errors = np.empty((ends.young.shape[1], 2, CHUNK))
    for done in range(0, total, CHUNK):
        tracker.reset(work)
        plots[:] = 0.0
        n = min(CHUNK, total - done)
        for f in range(F):
            young_errors(world, ends.young[f], first + done, errors)
            begin_drawn(ends.choice, laws_of(ends, trackers, f), first + done, n, errors, own[f])
        for k in range(K):
            scan, course = tracker.Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            tracker.measure_target(world, first + done, k, plots, measured, shift)
            sigma = world.fresh[k]
            for f in range(F):
                if trackers.association[f] == tracker.KNOWN:
                    continue
                laws, tracks, status = laws_of(ends, trackers, f), tracker.tracks_of(work, f), work.status[f]
                motion = trackers.period, trackers.sigma, trackers.manoeuvre[f]
                tracker.predict(tracks, scan.dt, *motion, work.predicted)
                stretched(laws, k, n, measured, sigma, own[f], z)
                look(field, laws, scan, tracks, status, work.predicted, own[f])
                detect_drawn(detections, laws, scan, status, work.predicted, target, course, sigma, own[f])
                if laws.shares[-1] > 0.0:
                    associate_young(field, detections, keys, laws, scan, tracks, status, target, work, own[f], counts)
                else:
                    tracker.associate(field, laws.rule, scan, tracks, status, target, work, counts)
                joint = trackers.association[f] == tracker.PDA
                tracker.update(tracks, scan.dt, *motion, joint, work.association)
                tracker.judge(trackers, f, n, tracks, status, course, kept, counts)
                beyond = (trackers.lost[f] * trackers.sigma[0], trackers.lost[f] * trackers.sigma[1])
                add_ended((trackers.misses[f], beyond), n, tracks, status, course, laws, own[f], sums.ended[f, k])
        for f in range(F):
            for i in range(n):
                if trackers.association[f] != tracker.KNOWN:
                    add_drawn(weight_of_ends(ends.shares[f], own[f], i), own[f, LAW, i] == 0.0, sums.ended_drawn[f])
