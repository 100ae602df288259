"""Tracks that false plots begin, drawn where they are confirmed: more false plots in their gates while tentative.

Of a share of the realisations the gate of a tentative track contains false plots more often than it should, and each
realisation counts with the ratio of the two laws (importance sampling). What is drawn at a scan is the number in a box
in q and bearing about the gate, within the sector: zero or not, with the probability h that it is not, in place of the
p = 1 - exp(-μ) of a Poisson number of mean μ, and then a Poisson number that is not zero. Positions in the box are
uniform, as they are in the field; what is in the box but outside the gate is not seen. The ratio of the laws is that of
the answers "zero or not" alone, (1 - h) / (1 - p) or h / p each scan.

h is the number of plots that the rule m of n still needs over the scans that are left, at least p: were p the same at
all scans, and small, all patterns of plots that confirm the track would have equal weights. Letters as in `field`, and

    p, h        probability that the box contains a false plot: as it is, and as it is drawn
    ratio       the law that is drawn from over the law itself
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import uniform, uniforms
from radarsim.studies.sonar.clutter.kernels.counts import COUNTS
from radarsim.studies.sonar.clutter.kernels.field import TURN, cell_words, draws_of, even_places, place_in
from radarsim.studies.sonar.clutter.kernels.gate import KNOWN, PDA, associated, empty_gate, inverse_two, with_plot
from radarsim.studies.sonar.clutter.kernels.rules import (
    AGE,
    BEST,
    CONFIRMED,
    FIRST,
    HITS,
    NONE,
    SINCE,
    STATE,
    TENTATIVE,
    judge_false,
)
from radarsim.studies.sonar.clutter.kernels.sums import add_scores
from radarsim.studies.sonar.clutter.kernels.tracker import (
    Scan,
    Target,
    associate_track,
    gate_of,
    reset,
    rule_of,
    settle,
    step,
    tracks_of,
)
from radarsim.studies.sonar.clutter.kernels.tracks import predict, update
from radarsim.studies.sonar.kernels.steps import CHUNK

MOST_MEAN = 16.0  # of a box: where it is larger, false plots are in the gate anyway, and the field is as it is
LARGEST = 1e280  # of the ratio: far beyond any whose reciprocal counts
ROWS = 3
PLAIN, RATIO, HELD = range(ROWS)  # 1 if drawn from the law itself, else 0; the ratio so far; scans held


class Shift(NamedTuple):
    """How tracks that false plots begin are drawn.

    choice (2,) is the key of the stream that chooses the plain ones, a share `plain` of all; plots (2,) that of the
    plots in boxes.
    """

    choice: np.ndarray
    plots: np.ndarray
    plain: float


class WeightedSums(NamedTuple):
    """Sums of a block by weights w, for F trackers.

    held (F, K, 3): Σw, Σw² and number of tracks that were held for at least 1 … K scans from their confirmation on;
    drawn (F, 3): number of plain ones, Σw and Σw² of all.
    """

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
        b = gate.b - TURN * np.floor((gate.b - b0) / TURN - 0.5 * sector / TURN + 0.5)
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
    gated, (irr, irb, ibb, _) = empty_gate(), inverse_two(gate.S[0], gate.S[1], gate.S[2])
    u, spare = cell_words(keys[0], keys[1], realisation, k, 0)
    some = uniform(u) < h
    if some:
        for n in range(number_when_any(box.mean, p, uniform(u) / h)):
            word = spare
            if n % 2 == 1:
                word, spare = cell_words(keys[0], keys[1], realisation, k, (n + 1) // 2)
            u_q, u_b = place_in(word)
            nu_r, nu_b = math.sqrt(2.0 * (box.q + box.dq * u_q)) - gate.r, box.b + box.db * u_b
            gated = with_plot(gated, nu_r, nu_b, 1.0, (irr, irb, ibb), threshold)
    return gated, some


@inline
def associate_drawn(keys, rule, realisation, k, gate, box, needed, plain):
    """The Association of one tentative track with plots drawn in its box, and the factor of its ratio.

    needed: plots that the rule still needs over the scans that are left.
    """
    p = -math.expm1(-box.mean)
    h = max(needed, p)
    gated, some = with_drawn_plots(keys, realisation, k, gate, rule.gate, box, p, p if plain else h)
    return associated(gated, rule, gate.r, gate.S, gate.settled), h / p if some else (1.0 - h) / (1.0 - p)


@part
def associate_false(field, shift, trackers, f, scan, work, own, counts):
    """Associate a scan's false plots with every track of a chunk: of tentative ones, those drawn in boxes.

    The results go to work.association (6, CHUNK), as those of `tracker.associate`.
    """
    draws, out, tally, status = draws_of(field), work.association, address(counts), work.status[f]
    predicted, plots, rule, m, n = work.predicted, work.plots[f], rule_of(trackers, f), trackers.m[f], trackers.n[f]
    keys = shift.plots[0], shift.plots[1]
    for i in range(scan.count):
        if status[STATE, i] == NONE:
            out[:, i] = 0.0
            continue
        status[SINCE, i] += scan.dt
        place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = gate_of(place, S, plots[i] > 1.5, rule.speed * status[SINCE, i])
        box = box_of(draws.cells, gate, rule.gate)
        if status[STATE, i] == TENTATIVE and 0.0 < box.mean <= MOST_MEAN:
            needed = (m - status[HITS, i]) / (n - status[AGE, i])
            drawn = (scan.first + i, scan.k, gate, box, needed, own[PLAIN, i] > 0.0)
            found, factor = associate_drawn(keys, rule, *drawn)
            own[RATIO, i] = min(own[RATIO, i] * factor, LARGEST)
        else:
            found = associate_track(draws, rule, scan.first + i, scan.k, (0.0, 0.0, 0.0), gate, tally)
        settle(status, i, found, out)


@part
def begin_false(shift, first, n, status, own):
    """Choose which of the n tracks that have begun are plain; the scores of the others are not counted."""
    for i in range(n):
        u, _ = uniforms(shift.choice[0], shift.choice[1], first + i, 0)
        own[PLAIN, i], own[RATIO, i], own[HELD, i] = 1.0 if u < shift.plain else 0.0, 1.0, 0.0
        if own[PLAIN, i] == 0.0:
            status[FIRST, i] = -1.0


@part
def add_weighted(plain, own, n, held, drawn):
    """Add the weights of n tracks, 1 / (α + (1 - α) ratio) with α the plain share, to the sums of one tracker."""
    for i in range(n):
        w = 1.0 / (plain + (1.0 - plain) * own[RATIO, i])
        drawn[0] += own[PLAIN, i]
        drawn[1] += w
        drawn[2] += w * w
        for j in range(int(own[HELD, i])):
            held[j, 0] += w
            held[j, 1] += w * w
            held[j, 2] += 1.0


@part
def scan_false(field, shift, trackers, f, scan, work, own, counts):
    """Process scan k > 0 of the tracks of a chunk; returns whether any is left."""
    tracks, status, manoeuvre = tracks_of(work, f), work.status[f], trackers.manoeuvre[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate_false(field, shift, trackers, f, scan, work, own, counts)
    joint = trackers.association[f] == PDA
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, joint, work.association)
    left = judge_false(trackers, f, scan.count, tracks, status, counts)
    for i in range(scan.count):
        own[HELD, i] += status[STATE, i] == CONFIRMED
    return left


@kernel
def simulate_false(seeds, field, shift, trackers, work, dt, first, total, scores, sums):
    """Add the weighted sums of tracks that false plots begin at scan 0 to sums, and scores of the plain ones to scores.

    Arguments as those of `blocks.simulate_false`; scores (F, T + 1).
    """
    z, detected, counts, own = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(COUNTS), np.zeros((ROWS, CHUNK))
    for done in range(0, total, CHUNK):
        reset(work)
        n = min(CHUNK, total - done)
        even_places(seeds, field, first + done, n, z)
        for f in range(trackers.gate.size):
            tracks, status = tracks_of(work, f), work.status[f]
            if trackers.association[f] == KNOWN:
                continue
            step(trackers, f, field, Scan(first + done, n, 0, dt[0]), tracks, Target(detected, z, True), work, counts)
            begin_false(shift, first + done, n, status, own)
            for k in range(1, dt.size):
                if not scan_false(field, shift, trackers, f, Scan(first + done, n, k, dt[k]), work, own, counts):
                    break
            add_weighted(shift.plain, own, n, sums.held[f], sums.drawn[f])
            add_scores(trackers.thresholds, n, status[FIRST], status[BEST], scores[f])
