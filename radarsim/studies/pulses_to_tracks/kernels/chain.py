"""The chain over all scans of a block: range, forecast, burst, estimate, update; and the sums over realisations.

A filter runs over the realisations of a block scan by scan, so that bursts of one entry of its menu are estimated eight
side by side. States are errors: estimate less truth.
"""

import math

import numpy as np

from radarsim.bursts.kernels.lanes import PASSES, lane
from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.random import normals
from radarsim.kernels.symmetric import predicted_axis, predicted_own
from radarsim.studies.pulses_to_tracks.kernels.estimate import estimate, room_for
from radarsim.studies.pulses_to_tracks.kernels.records import (
    AGES,
    AS_MEASURED,
    BOUND,
    GATED,
    LOCKED,
    LOCKED_3,
    TAKEN,
    WRONG_FOLD,
)
from radarsim.studies.pulses_to_tracks.kernels.steps import (
    acceleration_taken,
    lock_weight,
    mixed,
    range_taken,
    velocity_taken,
)


@inline
def state_of(row):
    """x (3) and P (6) of a row (9,)."""
    return (row[0], row[1], row[2]), (row[3], row[4], row[5], row[6], row[7], row[8])


@inline
def put_state(row, x, P):
    """Write x and P into a row (9,)."""
    row[0], row[1], row[2] = x
    row[3], row[4], row[5], row[6], row[7], row[8] = P


@kernel
def take_ranges(world, own, k, first, tracks):
    """Predict all tracks (n, 9) to scan k and take its range; the first sets it, and draws the designation."""
    missed, variance, Q = world.missed[k], world.sigma_r**2, own.noise
    for i in range(tracks.shape[0]):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        if k == 0:
            v, a = normals(world.keys[2, 0], world.keys[2, 1], first + i, 0)
            x = noise, world.prior[0] * v, world.prior[1] * a
            P = variance, 0.0, 0.0, world.prior[0] ** 2, 0.0, world.prior[1] ** 2
        else:
            x, P = state_of(tracks[i])
            x = predicted_axis(x, world.motion)
            x = x[0] + missed[0], x[1] + missed[1], x[2] + missed[2]
            q = (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]) if k >= own.start else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            P = predicted_own(P, world.motion, q)
            x, P = range_taken(x, P, noise, variance)
        put_state(tracks[i], x, P)


@inline
def level(own, c, sigma):
    """The level of a menu whose standard deviation is the least that is no less than sigma."""
    down = math.floor(math.log(own.top[c] / sigma) / own.ratio[c] + 1e-9)
    return int(min(max(down, 0.0), own.levels[c] - 1.0))


@kernel
def make_forecasts(world, own, k, first, tracks, forecasts, entries):
    """Errors (n, 2) of the forecasts of velocity and acceleration, and entries (n,) of the menu."""
    for i in range(tracks.shape[0]):
        if own.track:
            forecasts[i, 0], forecasts[i, 1] = tracks[i, 1], tracks[i, 2]
            v, a = level(own, 0, math.sqrt(tracks[i, 6])), level(own, 1, math.sqrt(tracks[i, 8]))
            entries[i] = a * own.levels[0] + v
        else:
            x, y = normals(world.keys[3, 0], world.keys[3, 1], first + i, k)
            forecasts[i, 0], forecasts[i, 1], entries[i] = own.fixed[0] * x, own.fixed[1] * y, 0


@kernel
def estimate_all(world, filters, f, k, first, forecasts, entries, room, measured):
    """Estimates (n, 2) of the bursts of scan k, less the truth, an entry at a time. Returns passes, and squared."""
    who, eight, found = np.empty(WIDTH, np.int64), np.empty((WIDTH, 2)), np.empty((WIDTH, 2))
    order = np.argsort(entries, kind="mergesort")
    begin, passes, squares = 0, 0.0, 0.0
    while begin < order.size:
        entry, end = entries[order[begin]], begin
        while end < order.size and end - begin < WIDTH and entries[order[end]] == entry:
            end += 1
        for n in range(WIDTH):
            i = order[min(begin + n, end - 1)]  # a strip that is not full repeats its last
            who[n], eight[n, 0], eight[n, 1] = first + i, forecasts[i, 0], forecasts[i, 1]
        estimate(world, filters, f, k, entry, who, eight, room, found)
        for n in range(end - begin):
            measured[order[begin + n], 0], measured[order[begin + n], 1] = found[n, 0], found[n, 1]
            own = room[0][lane(PASSES, n)]
            passes, squares = passes + own, squares + own * own
        begin = end
    return passes, squares


@inline
def folded(x, span):
    """x, less the nearest whole number of spans."""
    return x - span * np.rint(x / span)


@kernel
def take_estimates(world, own, sigma, measured, tracks, ages, locks, of_measured):
    """Take the estimates (n, 2) of a scan into the tracks; counts and errors of them are added to the sums.

    sigma (2,) are the Fisher bounds, which the filter believes in; ages (n,) scans since a burst was lost.
    """
    span, takes = world.span, own.takes
    for i in range(tracks.shape[0]):
        x, P = state_of(tracks[i])
        v, a = measured[i, 0], measured[i, 1]
        e = v - x[1] if own.kind == BOUND else folded(v - x[1], span)
        wrong = 1.0 if abs(e + x[1]) > 0.5 * span else 0.0
        v = v if own.kind == BOUND else folded(v, span)
        worst = abs(v) / sigma[0]
        if takes == 2:
            worst = max(worst, abs(a) / sigma[1])
        y, R, S = velocity_taken(x, P, e, sigma[0] ** 2)
        distance, determinant = e * e / S, S
        if takes == 2:
            e = a - y[2]
            y, R, S = acceleration_taken(y, R, e, sigma[1] ** 2)
            distance, determinant = distance + e * e / S, determinant * S
        weight = 1.0
        if own.use == GATED:
            weight = 1.0 if distance <= own.gate else 0.0
        elif own.use != AS_MEASURED:
            weight = lock_weight(distance, determinant, takes, own.lock, own.density)
        if weight == 1.0:
            x, P = y, R
        elif weight > 0.0:
            x, P = mixed(x, P, y, R, weight)
        put_state(tracks[i], x, P)
        locked = worst < 5.0
        ages[i] = min(ages[i] + 1, AGES - 1) if locked else 0
        locks[LOCKED] += 1.0 if locked else 0.0
        locks[LOCKED_3] += 1.0 if worst < 3.0 else 0.0
        locks[TAKEN] += weight
        locks[WRONG_FOLD] += wrong * weight
        for c in range(takes):
            square = v * v if c == 0 else a * a
            of_measured[c, 1, 0] += square
            of_measured[c, 1, 1] += square * square
            of_measured[c, 0, 0] += square if locked else 0.0
            of_measured[c, 0, 1] += square * square if locked else 0.0


@kernel
def add_errors(tracks, ages, takes, errors, error, age, loss):
    """Keep the errors (n, 3) of a scan and add their powers to the sums."""
    for i in range(tracks.shape[0]):
        age[ages[i]] += 1.0 if takes else 0.0
        for c in range(3):
            e = tracks[i, c]
            errors[i, c] = e
            error[c, 0] += e
            error[c, 1] += e * e
            error[c, 2] += e * e * e
            error[c, 3] += e * e * e * e
            if takes:
                loss[ages[i], c, 0] += e * e
                loss[ages[i], c, 1] += e * e * e * e


@kernel
def run_filter(world, filters, f, first, room, tracks, errors, sums):
    """A filter over all scans of realisations first, first + 1, …; errors (K, n, 3) are written."""
    own, n = filters.filters[f], tracks.shape[0]
    forecasts, measured = np.zeros((n, 2)), np.zeros((n, 2))
    entries, ages = np.zeros(n, np.int64), np.full(n, AGES - 1)
    for k in range(world.missed.shape[0]):
        take_ranges(world, own, k, first, tracks)
        if own.takes:
            make_forecasts(world, own, k, first, tracks, forecasts, entries)
            passes, squares = estimate_all(world, filters, f, k, first, forecasts, entries, room, measured)
            sums.passes[f, 0] += passes
            sums.passes[f, 1] += squares
            take_estimates(
                *(world, own, filters.sigma[f, k], measured, tracks, ages),
                *(sums.locks[f, k], sums.measured[f, k]),
            )
        add_errors(tracks, ages, own.takes, errors[k], sums.error[f, k], sums.ages[f, k], sums.losses[f, k])


@kernel
def add_pairs(errors, base, paired):
    """Add e² times the baseline's; errors and base (K, n, 3)."""
    for k in range(errors.shape[0]):
        for i in range(errors.shape[1]):
            for c in range(3):
                paired[k, c] += errors[k, i, c] ** 2 * base[k, i, c] ** 2


@kernel
def run_block(world, filters, first, room, tracks, errors, sums):
    """`simulate_block` with its work arrays."""
    for f in range(filters.filters.size):
        run_filter(world, filters, f, first, room, tracks, errors[f], sums)
    for f in range(filters.filters.size):
        add_pairs(errors[f], errors[filters.baseline], sums.paired[f])


def simulate_block(world, filters, sums, first, count) -> np.ndarray:
    """Add realisations first … first + count − 1 to the sums; gives their errors (F, K, count, 3)."""
    scans = world.missed.shape[0]
    errors = np.zeros((filters.filters.size, scans, count, 3))
    room = room_for(world.mean.shape[0], world.reversed.size)
    run_block(world, filters, first, room, np.zeros((count, 9)), errors, sums)
    return errors
