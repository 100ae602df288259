"""Tracks among false and missed plots (P3): a target's track, and tracks that false plots begin, in chunks.

Each tracker has one track a realisation. It looks at the target's plot, if there is one, and at the false plots of the
field in its gate, one realisation after the other since their numbers differ; covariances then go eight realisations
at a time (`tracks`). Every plot that no track took begins a track: of the target's plots, one at a time, of the false
ones one in each realisation, whose place is drawn evenly over the sector. By the theorem of Slivnyak and Mecke the
plots about it are again the field's, and the expected number of false tracks is their density times its share.

Letters as in `field` and `tracks`; f numbers trackers, i realisations of a chunk, k scans.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import uniforms
from radarsim.studies.sonar.clutter.kernels.counts import (
    COUNTS,
    DROPPED,
    ENDS_PER_SCAN,
    EXPECTED,
    FAILED,
    FALSE,
    FALSE_FOUND,
    FALSE_KEPT,
    FALSE_TRYING,
    FOUND,
    INSIDE,
    KEPT,
    LOOKED,
    LOST,
    PLOTS,
    TRYING,
    WRONG_PER_PLOT,
)
from radarsim.studies.sonar.clutter.kernels.field import (
    CLOSEST,
    KNOWN,
    OPEN,
    PDA,
    Gate,
    Rule,
    associated,
    distance_squared,
    empty_gate,
    grid_of,
    inverse_two,
    with_false_plots,
    with_plot,
)
from radarsim.studies.sonar.clutter.kernels.sums import add_ahead, add_errors, add_ratio, add_scores
from radarsim.studies.sonar.clutter.kernels.tracks import Tracks, clear, predict, update
from radarsim.studies.sonar.kernels.patterns import detect
from radarsim.studies.sonar.kernels.shared_gains import move_and_measure
from radarsim.studies.sonar.kernels.steps import CHUNK
from radarsim.studies.sonar.kernels.sums import Counted, Course

NONE, TENTATIVE, CONFIRMED = range(3)
# Rows of a track's status: state, scans since its first plot, plots taken, misses in a row, time since the last plot,
# score and its greatest value, whether it is the realisation's first track, whether one was confirmed before; then
# sums over the realisation: ends of confirmed tracks, scans with one, weight of false plots taken, plots taken.
ROWS = 13
STATE, AGE, HITS, MISSES, SINCE, SCORE, BEST, FIRST, BEFORE, ENDS, HELD, WRONG, TAKEN = range(ROWS)


class Trackers(NamedTuple):
    """F trackers.

    association (F,), gate (F,) as χ², inside (F,) its probability; m and n (F,) of the rule that confirms, misses (F,)
    in a row that drop a track, lost (F,) in σ of a plot; speed (F,) m/s of targets; manoeuvre (F, 2) variances q in
    nominal plots and periods. detection and density (per m²) are those that they assume; period in s and sigma (2,) of
    a plot; thresholds (T,) of the score.
    """

    association: np.ndarray
    gate: np.ndarray
    inside: np.ndarray
    m: np.ndarray
    n: np.ndarray
    misses: np.ndarray
    speed: np.ndarray
    lost: np.ndarray
    manoeuvre: np.ndarray
    detection: float
    density: float
    period: float
    sigma: np.ndarray
    thresholds: np.ndarray


class Workspace(NamedTuple):
    """Work arrays for a chunk of F trackers: `Tracks` of each, their status (F, ROWS, CHUNK), and of one tracker what
    is predicted (5, CHUNK) and what association gives (6, CHUNK), as in `tracks`.
    """

    x: np.ndarray
    Y: np.ndarray
    P: np.ndarray
    C: np.ndarray
    plots: np.ndarray
    status: np.ndarray
    predicted: np.ndarray
    association: np.ndarray


class Scan(NamedTuple):
    """Scan k of a chunk, dt after the scan before: realisations from number `first` on, of which `count` count."""

    first: int
    count: int
    k: int
    dt: float


class Target(NamedTuple):
    """The target's plots at a scan: detected (CHUNK,) 1 or 0, z (2, CHUNK); begins: one without a track begins one."""

    detected: np.ndarray
    z: np.ndarray
    begins: bool


def workspace(count: int) -> Workspace:
    """Work arrays of that many trackers."""
    shapes = ((2, 4), (2, 8), (2, 6), (4,), (), (ROWS,))
    own = [aligned_zeros(count, *shape, CHUNK) for shape in shapes]
    return Workspace(*own, aligned_zeros(5, CHUNK), aligned_zeros(6, CHUNK))


@part
def reset(work):
    """Nothing is tracked yet."""
    work.x[:], work.Y[:], work.P[:], work.C[:] = 0.0, 0.0, 0.0, 0.0
    work.plots[:], work.status[:], work.association[:] = 0.0, 0.0, 0.0
    work.status[:, FIRST] = -1.0


@inline
def tracks_of(work, f):
    """The tracks of tracker f."""
    return Tracks(work.x[f], work.Y[f], work.P[f], work.C[f], work.plots[f])


# ---- association --------------------------------------------------------------------------------------------------
@inline
def associate_track(grid, rule, realisation, k, plot, gate, counts):
    """The Association of one track at scan k; counts (a COUNTS address) of the scan.

    plot is whether the target's plot is there, and its range and bearing.
    """
    gated, known = empty_gate(), rule.association == KNOWN
    nu_r, nu_b = plot[1] - gate.r, plot[2] - gate.b
    irr, irb, ibb, det = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    S_inverse = (irr, irb, ibb)
    if plot[0] > 0.0:
        gated = with_plot(gated, nu_r, nu_b, 0.0, S_inverse, OPEN if known else rule.gate)
        if gate.settled:
            counts[PLOTS] += 1.0
            counts[INSIDE] += distance_squared(nu_r, nu_b, S_inverse) <= rule.gate
    if grid.density > 0.0:
        among_false = with_false_plots(gated, grid, realisation, k, gate, rule.gate)
        if gate.settled:
            sector = grid.dq * grid.nq * grid.db * grid.nb
            counts[FALSE] += among_false.false_count
            counts[EXPECTED] += grid.density * min(max(gate.r, 0.0) * np.pi * rule.gate * np.sqrt(det), sector)
        gated = gated if known else among_false
    if gate.settled:
        counts[LOOKED] += 1.0
    return associated(gated, rule, gate.r, gate.S, gate.settled)


@part
def begin(tracks, status, i, z, association):
    """A track of one plot."""
    clear(tracks, i)
    association[:, i] = 0.0
    association[0, i], association[1, i], association[2, i] = 1.0, z[0, i], z[1, i]
    status[STATE, i], status[AGE, i], status[HITS, i], status[MISSES, i] = TENTATIVE, 1.0, 1.0, 0.0
    status[SINCE, i], status[SCORE, i], status[FIRST, i] = 0.0, 0.0, 0.0 if status[FIRST, i] >= 0.0 else 1.0


@inline
def gate_of(place, S, settled, reach):
    """The gate of a track; of one plot nothing is known of its velocity but how fast targets are: reach in m."""
    r, b = place
    if not settled:
        S = (S[0] + reach * reach, S[1], S[2] + (reach / max(r, CLOSEST)) ** 2)
    return Gate(r, b, S, settled)


@part
def associate(field, rule, scan, tracks, status, target, work, counts):
    """What every track of a chunk takes of a scan's plots, into work.association (6, CHUNK).

    Its rows: whether a plot is taken, innovations (r, b) and their further covariance V (rr, rb, bb); of a track that
    begins here the plot itself for the innovations.
    """
    # Arrays are taken out of their records once: each time is a counted reference.
    grid, out, tally, plots = grid_of(field), work.association, address(counts), tracks.plots
    detected, z, predicted = target.detected, target.z, work.predicted
    for i in range(scan.count):
        if status[STATE, i] == NONE:
            out[:, i] = 0.0
            if target.begins and detected[i] > 0.0:
                begin(tracks, status, i, z, out)
            continue
        status[SINCE, i] += scan.dt
        place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = gate_of(place, S, plots[i] > 1.5, rule.speed * status[SINCE, i])
        plot = (detected[i], z[0, i], z[1, i])
        found = associate_track(grid, rule, scan.first + i, scan.k, plot, gate, tally)
        out[0, i], out[1, i], out[2, i] = found.taken, found.nu_r, found.nu_b
        out[3, i], out[4, i], out[5, i] = found.rr, found.rb, found.bb
        if status[STATE, i] == CONFIRMED:
            status[WRONG, i] += found.false_share
            status[TAKEN, i] += found.taken
        status[AGE, i] += 1.0
        status[SCORE, i] += found.score
        if status[FIRST, i] > 0.0:
            status[BEST, i] = max(status[BEST, i], status[SCORE, i])
        if found.taken > 0.0:
            status[HITS, i] += 1.0
            status[MISSES, i], status[SINCE, i] = 0.0, 0.0
        else:
            status[MISSES, i] += 1.0


@part
def step(trackers, f, field, scan, tracks, target, work, counts):
    """One scan of tracker f: predict, associate, update."""
    manoeuvre, association = trackers.manoeuvre[f], trackers.association[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    rule = Rule(
        association, trackers.gate[f], trackers.detection, trackers.inside[f], trackers.density, trackers.speed[f]
    )
    associate(field, rule, scan, tracks, work.status[f], target, work, counts)
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, association == PDA, work.association)


# ---- rules --------------------------------------------------------------------------------------------------------
@kernel
def next_state(state, hits, misses, age, m, n, most):
    """State of a track after a scan, by the rules m of n and of misses."""
    if state == TENTATIVE:
        if hits >= m:
            return CONFIRMED
        return TENTATIVE if hits + (n - age) >= m else NONE
    return NONE if misses >= most else CONFIRMED


@part
def judge_known(tracks, status, n, kept, counts):
    """Of an oracle's filter every track is kept from its second plot on; arguments as for `judge`."""
    plots = tracks.plots
    for i in range(n):
        kept[i] = 0.0
        if status[STATE, i] == NONE:
            continue
        kept[i] = 2.0 if plots[i] > 1.5 else 0.0
        status[STATE, i] = CONFIRMED if kept[i] > 0.0 else TENTATIVE
        counts[KEPT] += kept[i] > 0.0
        status[HELD, i] += kept[i] > 0.0


@part
def judge(trackers, f, n, tracks, status, course, kept, counts):
    """The rules over every track of the target after a scan; kept (CHUNK,) is 2 where it has one.

    A confirmed track ends as it is dropped, be it for misses or because its place has grown too uncertain, or as it is
    lost: too far from the target. n realisations count.
    """
    limit, m, of, misses = trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    x, P, truth, shift = tracks.x, tracks.P, course.truth, course.shift
    limit_r, limit_b = limit * trackers.sigma[0], limit * trackers.sigma[1]
    for i in range(n):
        state = status[STATE, i]
        kept[i] = 0.0
        if state == NONE:
            continue
        now = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, of, misses)
        if now == CONFIRMED:
            off = abs(x[0, 0, i] - truth[0, 0] - shift[0, 0, i]) > limit_r
            off |= abs(x[1, 0, i] - truth[1, 0] - shift[1, 0, i]) > limit_b
            uncertain = max(P[0, 0, i], P[1, 0, i]) > limit * limit
            if state == CONFIRMED and (off or uncertain):
                counts[LOST if off else DROPPED] += 1.0
                now = NONE
            elif off:  # confirmed on other plots than the target's
                counts[FAILED] += 1.0
                now = NONE
        elif now == NONE:
            counts[DROPPED if state == CONFIRMED else FAILED] += 1.0
        if now == CONFIRMED:
            kept[i] = 2.0
            counts[KEPT] += 1.0
            status[HELD, i] += 1.0
            counts[FOUND] += status[BEFORE, i] == 0.0
            status[BEFORE, i] = 1.0
        elif now == TENTATIVE:
            counts[TRYING] += 1.0
        elif state == CONFIRMED:
            status[ENDS, i] += 1.0
        if now == NONE:
            status[FIRST, i] = 0.0
        status[STATE, i] = now


@part
def judge_false(trackers, f, n, tracks, status, begun):
    """The rules over every track that a false plot began; gives whether any is left."""
    limit, m, of, misses = trackers.lost[f] * trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, left = tracks.P, False
    for i in range(n):
        state = status[STATE, i]
        if state == NONE:
            continue
        now = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, of, misses)
        if state == CONFIRMED and max(P[0, 0, i], P[1, 0, i]) > limit:
            now = NONE
        begun[FALSE_TRYING] += now == TENTATIVE
        begun[FALSE_KEPT] += now == CONFIRMED
        begun[FALSE_FOUND] += now == CONFIRMED and state == TENTATIVE
        status[STATE, i] = now
        left |= now != NONE
    return left


# ---- a block ------------------------------------------------------------------------------------------------------
@kernel
def simulate_block(world, observation, field, trackers, work, first, total, sums):
    """Add the sums of the target's tracks in realisations first … first + total - 1 to sums, TrackSums."""
    F, K, status = trackers.gate.size, world.dt.size, work.status
    plots, shift, z = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK)), np.empty((2, CHUNK))
    detected, used, kept = np.empty(CHUNK), np.ones(CHUNK), np.empty((F, CHUNK))
    counts, out, target = np.zeros(COUNTS), np.empty(7), Target(detected, z, True)
    for done in range(0, total, CHUNK):
        reset(work)
        plots[:], kept[:] = 0.0, 0.0
        n = min(CHUNK, total - done)
        used[n:] = 0.0
        for k in range(K):
            scan, course = Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            move_and_measure(world, first + done, k, plots)
            detect(observation, first + done, k, detected)
            shift[:, :2], z[:] = plots[:, 2:], plots[:, 0]
            for f in range(F):
                tracks, counted = tracks_of(work, f), Counted(kept[f], used)
                if k > 0:
                    add_ahead(tracks, f, k, scan.dt, course, counted, out, sums.errors)
                counts[:] = 0.0
                step(trackers, f, field, scan, tracks, target, work, counts)
                if trackers.association[f] == KNOWN:
                    judge_known(tracks, status[f], n, kept[f], counts)
                else:
                    judge(trackers, f, n, tracks, status[f], course, kept[f], counts)
                sums.counts[f, k] += counts
                add_errors(trackers, tracks, f, k, course, counted, out, sums.errors)
        for f in range(F):
            add_ratio(status[f, ENDS], status[f, HELD], n, sums.ratios[f, ENDS_PER_SCAN])
            add_ratio(status[f, WRONG], status[f, TAKEN], n, sums.ratios[f, WRONG_PER_PLOT])
            add_scores(trackers.thresholds, n, status[f, FIRST], status[f, BEST], sums.scores[0, f])


@kernel
def simulate_false(key, field, trackers, work, dt, first, total, sums):
    """Add the sums of tracks that false plots begin: one plot a realisation, evenly over the sector, at scan 0.

    key (2,) of the places; dt (K,) intervals before each scan.
    """
    z, detected, counts, nothing = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(COUNTS), np.zeros(CHUNK)
    for done in range(0, total, CHUNK):
        reset(work)
        n = min(CHUNK, total - done)
        for i in range(n):
            u, v = uniforms(key[0], key[1], first + done + i, 0)
            z[0, i] = np.sqrt(2.0 * (field.q0 + field.dq * field.nq * u))
            z[1, i] = field.b0 + field.db * field.nb * v
        for f in range(trackers.gate.size):
            tracks, status = tracks_of(work, f), work.status[f]
            if trackers.association[f] == KNOWN:
                continue
            for k in range(dt.size):
                target = Target(detected if k == 0 else nothing, z, k == 0)
                step(trackers, f, field, Scan(first + done, n, k, dt[k]), tracks, target, work, counts)
                if not judge_false(trackers, f, n, tracks, status, sums.begun[f, k]):
                    break
            add_scores(trackers.thresholds, n, status[FIRST], status[BEST], sums.scores[1, f])
