"""Trackers among false and missed plots (P3): prediction, association and update of a chunk of tracks.

Each tracker has one track a realisation. Plots are associated one realisation after the other, since the numbers of
false plots in the gates differ; covariances are then updated for eight realisations at a time (`tracks`).

Letters as in `gate` and `tracks`; f numbers trackers, i realisations of a chunk, k scans.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, part
from radarsim.kernels.lanes import address
from radarsim.studies.sonar.clutter.kernels import counts as at
from radarsim.studies.sonar.clutter.kernels import rules as life
from radarsim.studies.sonar.clutter.kernels.field import draws_of, with_false_plots
from radarsim.studies.sonar.clutter.kernels.gate import (
    CLOSEST,
    KNOWN,
    OPEN,
    PDA,
    Gate,
    Rule,
    associated,
    distance_squared,
    empty_gate,
    inverse_two,
    with_plot,
)
from radarsim.studies.sonar.clutter.kernels.tracks import Tracks, clear, predict, update
from radarsim.studies.sonar.kernels.steps import CHUNK


class Trackers(NamedTuple):
    """F trackers.

    association (F,), gate (F,) as χ², inside (F,) its probability; m and n (F,) of the rule that confirms, misses (F,)
    in a row that drop a track, lost (F,) in σ of a plot; speed (F,) of targets in m/s; manoeuvre (F, 2) variances q in
    nominal plots and periods. detection probability and density per m² of false plots as the trackers assume them;
    period in s and sigma (2,) of a plot; thresholds (T,) of the score.
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
    """Work arrays of a chunk for F trackers: the fields of `Tracks` and the status (F, ROWS, CHUNK) of each, and for
    one tracker at a time the predictions (5, CHUNK) and associations (6, CHUNK), as in `tracks`.
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
    """Scan k of a chunk, dt after the scan before: `count` realisations from number `first` on."""

    first: int
    count: int
    k: int
    dt: float


class Target(NamedTuple):
    """The target's plots at a scan: detected (CHUNK,) 1 or 0, z (2, CHUNK); begins: whether they begin tracks."""

    detected: np.ndarray
    z: np.ndarray
    begins: bool


def workspace(count: int) -> Workspace:
    """Work arrays of this many trackers."""
    shapes = ((2, 4), (2, 8), (2, 6), (4,), (), (life.ROWS,))
    own = [aligned_zeros(count, *shape, CHUNK) for shape in shapes]
    return Workspace(*own, aligned_zeros(5, CHUNK), aligned_zeros(6, CHUNK))


@part
def reset(work):
    """Set the work arrays to a state without any tracks."""
    work.x[:], work.Y[:], work.P[:], work.C[:] = 0.0, 0.0, 0.0, 0.0
    work.plots[:], work.status[:], work.association[:] = 0.0, 0.0, 0.0
    work.status[:, life.FIRST] = -1.0


@inline
def tracks_of(work, f):
    """The tracks of tracker f."""
    return Tracks(work.x[f], work.Y[f], work.P[f], work.C[f], work.plots[f])


@inline
def rule_of(trackers, f):
    """How tracker f chooses among plots."""
    association, gate, inside, speed = trackers.association[f], trackers.gate[f], trackers.inside[f], trackers.speed[f]
    return Rule(association, gate, trackers.detection, inside, trackers.density, speed)


# ---- association --------------------------------------------------------------------------------------------------
@inline
def associate_track(draws, rule, realisation, k, plot, gate, counts):
    """The Association of one track at scan k; counts is the address of the scan's counts.

    plot is 1 if there is a plot of the target, else 0, with its range and bearing.
    """
    gated, known = empty_gate(), rule.association == KNOWN
    nu_r, nu_b = plot[1] - gate.r, plot[2] - gate.b
    irr, irb, ibb, det = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    S_inverse = (irr, irb, ibb)
    if plot[0] > 0.0:
        gated = with_plot(gated, nu_r, nu_b, 0.0, S_inverse, OPEN if known else rule.gate)
        if gate.settled:
            counts[at.PLOTS] += 1.0
            counts[at.INSIDE] += distance_squared(nu_r, nu_b, S_inverse) <= rule.gate
    cells = draws.cells
    if cells.density > 0.0:
        among_false = with_false_plots(gated, draws, realisation, k, gate, rule.gate)
        if gate.settled:
            sector = cells.dq * cells.nq * cells.db * cells.nb
            counts[at.FALSE] += among_false.false_count
            counts[at.EXPECTED] += cells.density * min(max(gate.r, 0.0) * np.pi * rule.gate * np.sqrt(det), sector)
        gated = gated if known else among_false
    if gate.settled:
        counts[at.LOOKED] += 1.0
    return associated(gated, rule, gate.r, gate.S, gate.settled)


@part
def begin(tracks, status, i, z, association):
    """Begin a track with one plot."""
    clear(tracks, i)
    association[:, i] = 0.0
    association[0, i], association[1, i], association[2, i] = 1.0, z[0, i], z[1, i]
    status[life.STATE, i], status[life.AGE, i], status[life.HITS, i], status[life.MISSES, i] = (
        life.TENTATIVE,
        1.0,
        1.0,
        0.0,
    )
    status[life.SINCE, i], status[life.SCORE, i], status[life.FIRST, i] = (
        0.0,
        0.0,
        0.0 if status[life.FIRST, i] >= 0.0 else 1.0,
    )


@inline
def gate_of(place, S, settled, reach):
    """The gate of a track; the velocity after one plot is unknown, and a target may have moved by `reach`, in m."""
    r, b = place
    if not settled:
        S = (S[0] + reach * reach, S[1], S[2] + (reach / max(r, CLOSEST)) ** 2)
    return Gate(r, b, S, settled)


@inline
def settle(status, i, found, out):
    """Write the Association of track i to the rows of out (6, CHUNK), and count it in the track's status (ROWS, CHUNK).

    Both are addresses: Numba may count references to arrays for every track.
    """
    rows = (found.taken, found.nu_r, found.nu_b, found.rr, found.rb, found.bb)
    for j in range(6):
        out[j * CHUNK + i] = rows[j]
    if status[life.STATE * CHUNK + i] == life.CONFIRMED:
        status[life.WRONG * CHUNK + i] += found.false_share
        status[life.TAKEN * CHUNK + i] += found.taken
    status[life.AGE * CHUNK + i] += 1.0
    score = status[life.SCORE * CHUNK + i] + found.score
    status[life.SCORE * CHUNK + i] = score
    if status[life.FIRST * CHUNK + i] > 0.0:
        status[life.BEST * CHUNK + i] = max(status[life.BEST * CHUNK + i], score)
    if found.taken > 0.0:
        status[life.HITS * CHUNK + i] += 1.0
        status[life.MISSES * CHUNK + i] = 0.0
        status[life.SINCE * CHUNK + i] = 0.0
    else:
        status[life.MISSES * CHUNK + i] += 1.0


@part
def associate(field, rule, scan, tracks, status, target, work, counts):
    """Associate a scan's plots with every track of a chunk; the results go to work.association (6, CHUNK).

    Its rows: 1 if a plot is taken, else 0; innovations (r, b) and their additional covariance V (rr, rb, bb). A track
    that begins here has the plot itself in place of the innovations.
    """
    # Arrays are taken out of their records once, because every access counts a reference.
    draws, out, tally, plots = draws_of(field), work.association, address(counts), tracks.plots
    detected, z, predicted, lives, taken = target.detected, target.z, work.predicted, address(status), address(out)
    for i in range(scan.count):
        if status[life.STATE, i] == life.NONE:
            out[:, i] = 0.0
            if target.begins and detected[i] > 0.0:
                begin(tracks, status, i, z, out)
            continue
        status[life.SINCE, i] += scan.dt
        place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = gate_of(place, S, plots[i] > 1.5, rule.speed * status[life.SINCE, i])
        plot = (detected[i], z[0, i], z[1, i])
        found = associate_track(draws, rule, scan.first + i, scan.k, plot, gate, tally)
        settle(lives, i, found, taken)


@part
def step(trackers, f, field, scan, tracks, target, work, counts):
    """Predict, associate and update all tracks of tracker f at one scan."""
    manoeuvre, association = trackers.manoeuvre[f], trackers.association[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate(field, rule_of(trackers, f), scan, tracks, work.status[f], target, work, counts)
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, association == PDA, work.association)
