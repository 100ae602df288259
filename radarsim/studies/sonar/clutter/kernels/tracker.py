"""Tracks among false and missed plots (P3): a target's track, and tracks that false plots begin, in chunks.

Each tracker has one track a realisation. It looks at the target's plot, if there is one, and at the false plots of the
field in its gate, one realisation after the other since their numbers differ; covariances then go eight realisations
at a time (`sonar_tracks`). Every plot that no track took begins a track: of the target's plots, one at a time, of the
false ones one in each realisation, whose place is drawn evenly over the sector. By the theorem of Slivnyak and Mecke
the plots about it are again the field's, and the expected number of false tracks is their density times its share.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import uniforms
from radarsim.studies.sonar.clutter.kernels.field import (
    CLOSEST,
    KNOWN,
    OPEN,
    PDA,
    Rule,
    decided,
    false_plots,
    inverse_two,
    nothing_seen,
    seen,
)
from radarsim.studies.sonar.clutter.kernels.tracks import Tracks, foretell, forget, take
from radarsim.studies.sonar.kernels.patterns import detect
from radarsim.studies.sonar.kernels.shared_gains import move_and_measure
from radarsim.studies.sonar.kernels.steps import CHUNK
from radarsim.studies.sonar.kernels.sums import add_sums, ahead_sums

NONE, TENTATIVE, CONFIRMED = range(3)
# Rows of a track's life: state, scans since its first plot, plots taken, misses in a row, time since the last plot,
# score and its greatest value, whether it is the realisation's first track, whether one was confirmed before; then
# sums over the realisation: ends of confirmed tracks, scans with one, weight of false plots taken, plots taken.
ROWS = 13
STATE, AGE, HITS, MISSES, SINCE, SCORE, BEST, FIRST, BEFORE, ENDS, HELD, WRONG, TAKEN = range(ROWS)
# What is counted at each scan: tentative tracks, kept ones, first confirmations, lost, dropped, tentative ones dropped,
# tracks foretold, target's plots then, those in the gate, false ones in it and their expected number.
COUNTS = 11
TRYING, KEPT, FOUND, LOST, DROPPED, FAILED, LOOKED, PLOTS, INSIDE, FALSE, EXPECTED = range(COUNTS)
FALSE_COUNTS = 3  # of tracks that false plots began: tentative, confirmed, first confirmations


class Trackers(NamedTuple):
    """F trackers: association (F,), gate (F,) as χ², inside (F,) its probability, m and n (F,), misses (F,) that drop,
    speed (F,) m/s, lost (F,) in σ of a plot, manoeuvre (F, 2) in nominal plots and periods; detection and density (per
    m²) that they reckon with; thresholds (T,) of the score.
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
    thresholds: np.ndarray


class TrackSums(NamedTuple):
    """What is added up besides `sonar.Sums`: counts (F, K, COUNTS), begun (F, K, FALSE_COUNTS) of false tracks, ratios
    (F, 2, 5) and scores (2, F, T + 1) of the target's first tracks and of false ones, the last their number.

    A ratio is Σa, Σa², Σb, Σb², Σab over realisations: ends of tracks to scans held, false weight to plots taken.
    """

    counts: np.ndarray
    begun: np.ndarray
    ratios: np.ndarray
    scores: np.ndarray


@inline
def look(k0, k1, share, grid, density, rule, realisation, scan, settled, z, place, S, counts):
    """What association makes of the plots in one gate, as `decided`; counts (a COUNTS address) of its scan.

    z (2) is the target's plot with whether it came; place (r, b) and S (rr, rb, bb) are foretold.
    """
    so_far, known = nothing_seen(), rule.association == KNOWN
    nu_r, nu_b = z[1] - place[0], z[2] - place[1]
    irr, irb, ibb, det = inverse_two(*S)
    if z[0] > 0.0:
        so_far = seen(so_far, nu_r, nu_b, 0.0, irr, irb, ibb, OPEN if known else rule.gate)
        if settled:
            counts[PLOTS] += 1.0
            counts[INSIDE] += irr * nu_r * nu_r + 2.0 * irb * nu_r * nu_b + ibb * nu_b * nu_b <= rule.gate
    if density > 0.0:
        near = false_plots(k0, k1, share, grid, realisation, scan, rule.gate, place, S, so_far)
        if settled:
            sector = grid[1] * grid[2] * grid[4] * grid[5]
            counts[FALSE] += near[1]
            counts[EXPECTED] += density * min(max(place[0], 0.0) * np.pi * rule.gate * np.sqrt(det), sector)
        so_far = so_far if known else near
    if settled:
        counts[LOOKED] += 1.0
    return decided(so_far, rule, place[0], S, settled)


@part
def begin(tracks, life, i, z, taken, fresh):
    """A track of one plot."""
    forget(tracks, i)
    taken[:, i] = 0.0
    taken[0, i], taken[1, i], taken[2, i] = 1.0, z[0, i], z[1, i]
    life[STATE, i], life[AGE, i], life[HITS, i], life[MISSES, i] = TENTATIVE, 1.0, 1.0, 0.0
    life[SINCE, i], life[SCORE, i], life[FIRST, i] = 0.0, 0.0, fresh


@part
def associate(field, rule, first, scan, n, dt, tracks, life, came, z, again, foretold, speed, taken, counts):
    """What every track of a chunk takes of a scan's plots, into taken (6, CHUNK). again: where there is no track, the
    target's plot begins one. n of the chunk are realisations that count.
    """
    k0, k1, share, tally = field.key[0], field.key[1], address(field.share), address(counts)
    grid = (field.q0, field.dq, field.nq, field.b0, field.db, field.nb, field.ring)
    for i in range(n):
        if life[STATE, i] == NONE:
            taken[:, i] = 0.0
            if again and came[i] > 0.0:
                begin(tracks, life, i, z, taken, 0.0 if life[FIRST, i] >= 0.0 else 1.0)
            continue
        life[SINCE, i] += dt
        r, S, settled = foretold[0, i], (foretold[2, i], foretold[3, i], foretold[4, i]), tracks.plots[i] > 1.5
        if not settled:  # of one plot: nothing is known of its velocity but how fast targets are
            reach = speed * life[SINCE, i]
            S = (S[0] + reach * reach, S[1], S[2] + (reach / max(r, CLOSEST)) ** 2)
        nr, nb, rr, rb, bb, took, wrong, score = look(
            *(k0, k1, share, grid, field.density, rule, first + i, scan, settled, (came[i], z[0, i], z[1, i])),
            *((r, foretold[1, i]), S, tally),
        )
        taken[0, i], taken[1, i], taken[2, i] = took, nr, nb
        taken[3, i], taken[4, i], taken[5, i] = rr, rb, bb
        if life[STATE, i] == CONFIRMED:
            life[WRONG, i] += wrong
            life[TAKEN, i] += took
        life[AGE, i] += 1.0
        life[SCORE, i] += score
        if life[FIRST, i] > 0.0:
            life[BEST, i] = max(life[BEST, i], life[SCORE, i])
        if took > 0.0:
            life[HITS, i] += 1.0
            life[MISSES, i], life[SINCE, i] = 0.0, 0.0
        else:
            life[MISSES, i] += 1.0


@kernel
def next_state(state, hits, misses, age, m, n, most):
    """State of a track after a scan, by the rules m of n and of misses."""
    if state == TENTATIVE:
        if hits >= m:
            return CONFIRMED
        return TENTATIVE if hits + (n - age) >= m else NONE
    return NONE if misses >= most else CONFIRMED


@part
def judge(trackers, f, n, tracks, life, sigma, truth, shift, kept, counts):
    """The rules over every track of the target after a scan; kept (CHUNK,) is 2 where it has one.

    Of an oracle's filter every track is kept from its second plot on. A confirmed track ends as it is dropped, be it
    for misses or because its place has grown too uncertain, or as it is lost: too far from the target.
    """
    lost, uncertain = trackers.lost[f], trackers.lost[f] * trackers.lost[f]
    for i in range(n):
        state = life[STATE, i]
        kept[i] = 0.0
        if state == NONE:
            continue
        if trackers.association[f] == KNOWN:
            kept[i] = 2.0 if tracks.plots[i] > 1.5 else 0.0
            life[STATE, i] = CONFIRMED if kept[i] > 0.0 else TENTATIVE
            counts[KEPT] += kept[i] > 0.0
            life[HELD, i] += kept[i] > 0.0
            continue
        rules = trackers.m[f], trackers.n[f], trackers.misses[f]
        now = next_state(state, life[HITS, i], life[MISSES, i], life[AGE, i], *rules)
        if now == CONFIRMED:
            off = abs(tracks.x[0, 0, i] - truth[0, 0] - shift[0, 0, i]) > lost * sigma[0]
            off |= abs(tracks.x[1, 0, i] - truth[1, 0] - shift[1, 0, i]) > lost * sigma[1]
            vague = max(tracks.P[0, 0, i], tracks.P[1, 0, i]) > uncertain
            if state == CONFIRMED and (off or vague):
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
            life[HELD, i] += 1.0
            counts[FOUND] += life[BEFORE, i] == 0.0
            life[BEFORE, i] = 1.0
        elif now == TENTATIVE:
            counts[TRYING] += 1.0
        elif state == CONFIRMED:
            life[ENDS, i] += 1.0
        if now == NONE:
            life[FIRST, i] = 0.0
        life[STATE, i] = now


@part
def judge_false(trackers, f, n, tracks, life, begun):
    """The rules over every track that a false plot began; gives whether any is left."""
    uncertain, left = trackers.lost[f] * trackers.lost[f], False
    for i in range(n):
        state = life[STATE, i]
        if state == NONE:
            continue
        rules = trackers.m[f], trackers.n[f], trackers.misses[f]
        now = next_state(state, life[HITS, i], life[MISSES, i], life[AGE, i], *rules)
        if state == CONFIRMED and max(tracks.P[0, 0, i], tracks.P[1, 0, i]) > uncertain:
            now = NONE
        begun[0] += now == TENTATIVE
        begun[1] += now == CONFIRMED
        begun[2] += now == CONFIRMED and state == TENTATIVE
        life[STATE, i] = now
        left |= now != NONE
    return left


@part
def add_scores(thresholds, n, life, scores):
    """How many first tracks' scores reached each threshold, and how many first tracks there were."""
    for i in range(n):
        if life[FIRST, i] >= 0.0:
            scores[thresholds.size] += 1.0
            for t in range(thresholds.size):
                scores[t] += life[BEST, i] >= thresholds[t]


@part
def add_ratio(a, b, n, ratio):
    """Σa, Σa², Σb, Σb², Σab over n realisations."""
    for i in range(n):
        one, other = a[i], b[i]
        ratio[0] += one
        ratio[1] += one * one
        ratio[2] += other
        ratio[3] += other * other
        ratio[4] += one * other


@part
def scan(trackers, f, field, first, k, n, dt, period, sigma, tracks, life, came, z, again, foretold, taken, counts):
    """Scan k of tracker f: foretell, associate, update."""
    foretell(tracks, dt, period, sigma, trackers.manoeuvre[f], foretold)
    rule = Rule(trackers.association[f], trackers.gate[f], trackers.detection, trackers.inside[f], trackers.density)
    associate(field, rule, first, k, n, dt, tracks, life, came, z, again, foretold, trackers.speed[f], taken, counts)
    take(tracks, dt, period, sigma, trackers.manoeuvre[f], trackers.association[f] == PDA, taken)


class Workspace(NamedTuple):
    """Room for a chunk of F trackers: `Tracks` of each, their lives (F, ROWS, CHUNK), what is foretold and taken."""

    x: np.ndarray
    y: np.ndarray
    P: np.ndarray
    across: np.ndarray
    plots: np.ndarray
    life: np.ndarray
    foretold: np.ndarray
    taken: np.ndarray


def workspace(count: int) -> Workspace:
    """Room for that many trackers."""
    shapes = ((2, 4), (2, 8), (2, 6), (4,), (), (ROWS,))
    return Workspace(
        *(aligned_zeros(count, *shape, CHUNK) for shape in shapes), *(aligned_zeros(n, CHUNK) for n in (5, 6))
    )


@kernel
def reset(room):
    """Nothing is tracked yet."""
    room.x[:], room.y[:], room.P[:], room.across[:] = 0.0, 0.0, 0.0, 0.0
    room.plots[:], room.life[:], room.taken[:] = 0.0, 0.0, 0.0
    room.life[:, FIRST] = -1.0


@kernel
def simulate_block(world, observation, field, trackers, room, first, total, sums, ways):
    """Add the sums of the target's tracks in realisations first … first + total - 1."""
    F, K, x, life = trackers.gate.size, world.dt.size, room.x, room.life
    plots, shift, z = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK)), np.empty((2, CHUNK))
    came, used, kept = np.empty(CHUNK), np.ones(CHUNK), np.empty((F, CHUNK))
    counts, out, lines = np.zeros(COUNTS), np.empty(7), x.shape[1]  # two, but as a number known to the compiler all
    # that is inlined would be compiled twice
    for done in range(0, total, CHUNK):
        reset(room)
        plots[:], kept[:] = 0.0, 0.0
        n = min(CHUNK, total - done)
        used[n:] = 0.0
        for k in range(K):
            dt, truth = world.dt[k], world.truth[k]
            move_and_measure(world, first + done, k, plots)
            detect(observation, first + done, k, came)
            shift[:, :2], z[:] = plots[:, 2:], plots[:, 0]
            for f in range(F):
                tracks = Tracks(x[f], room.y[f], room.P[f], room.across[f], room.plots[f])
                if k > 0:
                    for c in range(lines):
                        ahead_sums(x[f, c], shift[c, 0], truth[c, 0], dt, kept[f], used, lines, out)
                        for q in range(4):
                            sums.ahead[f, k - 1, c, q] += out[q]
                counts[:] = 0.0
                scan(
                    *(
                        trackers,
                        f,
                        field,
                        first + done,
                        k,
                        n,
                        dt,
                        observation.period,
                        observation.sigma,
                        tracks,
                        life[f],
                        came,
                        z,
                    ),
                    *(True, room.foretold, room.taken, counts),
                )
                judge(trackers, f, n, tracks, life[f], observation.sigma, truth, shift, kept[f], counts)
                ways.counts[f, k] += counts
                for c in range(lines):
                    add_sums(
                        *(
                            lines,
                            observation.sigma[c],
                            observation.period,
                            x[f, c],
                            x[f, c],
                            0,
                            room.P[f, c],
                            shift[c],
                            truth[c],
                        ),
                        *(kept[f], used, f, k, c, out, sums),
                    )
        for f in range(F):
            add_ratio(life[f, ENDS], life[f, HELD], n, ways.ratios[f, 0])
            add_ratio(life[f, WRONG], life[f, TAKEN], n, ways.ratios[f, 1])
            add_scores(trackers.thresholds, n, life[f], ways.scores[0, f])


@kernel
def simulate_false(seeds, observation, field, trackers, room, dts, first, total, ways):
    """Add the sums of tracks that false plots begin: one plot a realisation, evenly over the sector, at scan 0."""
    F, K, life = trackers.gate.size, dts.size, room.life
    z, came, counts, nothing = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(COUNTS), np.zeros(CHUNK)
    for done in range(0, total, CHUNK):
        reset(room)
        n = min(CHUNK, total - done)
        for i in range(n):
            u, v = uniforms(seeds[0], seeds[1], first + done + i, 0)
            z[0, i] = np.sqrt(2.0 * (field.q0 + field.dq * field.nq * u))
            z[1, i] = field.b0 + field.db * field.nb * v
        for f in range(F):
            tracks = Tracks(room.x[f], room.y[f], room.P[f], room.across[f], room.plots[f])
            if trackers.association[f] == KNOWN:
                continue
            for k in range(K):
                there = came if k == 0 else nothing
                scan(
                    *(
                        trackers,
                        f,
                        field,
                        first + done,
                        k,
                        n,
                        dts[k],
                        observation.period,
                        observation.sigma,
                        tracks,
                        life[f],
                    ),
                    *(there, z, k == 0, room.foretold, room.taken, counts),
                )
                if not judge_false(trackers, f, n, tracks, life[f], ways.begun[f, k]):
                    break
            add_scores(trackers.thresholds, n, life[f], ways.scores[1, f])
