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
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import add_drawn, add_weight, uniform, uniforms
from radarsim.studies.sonar.clutter.kernels import tracker
from radarsim.studies.sonar.kernels.steps import CHUNK

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
