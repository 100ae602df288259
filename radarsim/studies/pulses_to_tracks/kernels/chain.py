"""The chain over all scans of a block: range, forecast, burst, estimate, update; and the sums over realisations.

A filter runs over the realisations of a block scan by scan, so that bursts of one entry of its menu are estimated eight
side by side. States are errors: estimate less truth.
"""

import math

import numpy as np

from radarsim.bursts.kernels.lanes import PASSES, lane
from radarsim.kernels.algebra import add_scaled, take_rate, take_second_rate, take_value
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels import records as rec
from radarsim.studies.pulses_to_tracks.kernels.estimate import estimate, room_for
from radarsim.studies.pulses_to_tracks.kernels.folds import ranges_to_hypotheses, take_folds
from radarsim.studies.pulses_to_tracks.kernels.records import Work, hypotheses
from radarsim.studies.pulses_to_tracks.kernels.steps import (
    a_scan_later,
    begun,
    folded,
    lock_weight,
    mixed,
    put_state,
    scored,
    state_of,
)


@part
def take_ranges(world, own, k, first, tracks):
    """Predict all tracks (n, 9) to scan k and take its range; the first sets it, and draws the designation."""
    variance = world.sigma_r**2
    for i in range(tracks.shape[0]):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        if k == 0:
            x, P = begun(world, first + i, noise)
        else:
            x, P = state_of(tracks, i)
            x, P = a_scan_later(world, own, k, x, P)
            P, gain, _ = take_value(P, variance, 1.0)
            x = add_scaled(x, noise - x[0], gain)
        put_state(tracks, i, x, P)


@inline
def level(own, c, sigma):
    """The level of a menu whose standard deviation is the least that is no less than sigma."""
    down = math.floor(math.log(own.top[c] / sigma) / own.ratio[c] + 1e-9)
    return int(min(max(down, 0.0), own.levels[c] - 1.0))


@part
def make_forecasts(world, own, k, first, work):
    """Errors (n, 2) of the forecasts of velocity and acceleration, and entries (n,) of the menu.

    A burst knows of a velocity what is left of whole spans.
    """
    tracks, forecasts, entries = work.tracks, work.forecasts, work.entries
    for i in range(tracks.shape[0]):
        if own.track:
            forecasts[i, 0], forecasts[i, 1] = folded(tracks[i, 1], world.span), tracks[i, 2]
            v, a = level(own, 0, math.sqrt(tracks[i, 6])), level(own, 1, math.sqrt(tracks[i, 8]))
            entries[i] = a * own.levels[0] + v
        else:
            x, y = normals(world.keys[3, 0], world.keys[3, 1], first + i, k)
            forecasts[i, 0], forecasts[i, 1], entries[i] = own.fixed[0] * x, own.fixed[1] * y, 0


@part
def in_order(entries):
    """The places of the entries (n,) in rising order, equal ones as they come.

    A counting sort, since entries are few: Numba's own takes a second to compile.
    """
    count, most = entries.size, 0
    for i in range(count):
        most = max(most, entries[i])
    start, order = np.zeros(most + 2, np.int64), np.empty(count, np.int64)
    for i in range(count):
        start[entries[i] + 1] += 1
    for entry in range(most):
        start[entry + 1] += start[entry]
    for i in range(count):
        order[start[entries[i]]] = i
        start[entries[i]] += 1
    return order


@part
def estimate_all(world, filters, f, k, first, work):
    """Estimates (n, 2) of the bursts of scan k, less the truth, an entry at a time; passes are counted."""
    who, eight, found = np.empty(WIDTH, np.int64), np.empty((WIDTH, 2)), np.empty((WIDTH, 2))
    entries, measured, forecasts, passes = work.entries, work.measured, work.forecasts, work.passes
    made = work.room[0]
    order = in_order(entries)
    begin = 0
    while begin < order.size:
        entry, end = entries[order[begin]], begin
        while end < order.size and end - begin < WIDTH and entries[order[end]] == entry:
            end += 1
        for n in range(WIDTH):
            i = order[min(begin + n, end - 1)]  # a strip that is not full repeats its last
            who[n], eight[n, 0], eight[n, 1] = first + i, forecasts[i, 0], forecasts[i, 1]
        estimate(world, filters, f, k, entry, who, eight, work.room, found)
        for n in range(end - begin):
            measured[order[begin + n], 0], measured[order[begin + n], 1] = found[n, 0], found[n, 1]
            passes[order[begin + n]] += made[lane(PASSES, n)]
        begin = end


@part
def take_estimates(world, filters, f, k, work, sums):
    """Take the estimates (n, 2) of a scan into the tracks; counts and errors of them are added to the sums."""
    own, sigma, span, tracks = filters.filters[f], filters.sigma[f, k], world.span, work.tracks
    locks, of_measured, takes = sums.locks[f, k], sums.measured[f, k], own.takes
    measured, ages = work.measured, work.ages
    for i in range(tracks.shape[0]):
        x, P = state_of(tracks, i)
        v, a = measured[i, 0], measured[i, 1]
        e = v - x[1] if own.kind == rec.BOUND else folded(v - x[1], span)
        wrong = 1.0 if abs(e + x[1]) > 0.5 * span else 0.0
        v = v if own.kind == rec.BOUND else folded(v, span)
        scored(sigma, takes, v, a, i, ages, locks, of_measured)
        R, gain, S = take_rate(P, sigma[0] ** 2, 1.0)
        y = add_scaled(x, e, gain)
        distance, determinant = e * e / S, S
        if takes == 2:
            e = a - y[2]
            R, gain, S = take_second_rate(R, sigma[1] ** 2, 1.0)
            y = add_scaled(y, e, gain)
            distance, determinant = distance + e * e / S, determinant * S
        weight = 1.0
        if own.use == rec.GATED:
            weight = 1.0 if distance <= own.gate else 0.0
        elif own.use != rec.AS_MEASURED:
            weight = lock_weight(distance, determinant, takes, own.lock, own.density)
        if weight == 1.0:
            x, P = y, R
        elif weight > 0.0:
            x, P = mixed(x, P, y, R, weight)
        put_state(tracks, i, x, P)
        locks[rec.TAKEN] += weight
        locks[rec.WRONG_FOLD] += wrong * weight


@part
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


@part
def run_filter(world, filters, f, first, work, errors, sums):
    """A filter over all scans of realisations first, first + 1, …; errors (K, n, 3) are written."""
    own, tracks, ages = filters.filters[f], work.tracks, work.ages
    ages[:], work.passes[:] = rec.AGES - 1, 0.0
    for k in range(world.missed.shape[0]):
        if own.kept > 1:
            ranges_to_hypotheses(world, own, k, first, work)
        else:
            take_ranges(world, own, k, first, tracks)
        if own.takes:
            make_forecasts(world, own, k, first, work)
            estimate_all(world, filters, f, k, first, work)
            if own.kept > 1:
                take_folds(world, filters, f, k, work, sums)
            else:
                take_estimates(world, filters, f, k, work, sums)
        add_errors(tracks, ages, own.takes, errors[k], sums.error[f, k], sums.ages[f, k], sums.losses[f, k])
    for passes in work.passes:
        sums.passes[f, 0] += passes
        sums.passes[f, 1] += passes * passes


@part
def add_pairs(errors, base, paired):
    """Add e² times the baseline's; errors and base (K, n, 3)."""
    for k in range(errors.shape[0]):
        for i in range(errors.shape[1]):
            for c in range(3):
                paired[k, c] += errors[k, i, c] ** 2 * base[k, i, c] ** 2


@kernel
def run_block(world, filters, first, work, errors, sums):
    """`simulate_block` with its work arrays."""
    for f in range(filters.filters.size):
        run_filter(world, filters, f, first, work, errors[f], sums)
    for f in range(filters.filters.size):
        add_pairs(errors[f], errors[filters.baseline], sums.paired[f])


def simulate_block(world, filters, sums, first, count) -> np.ndarray:
    """Add realisations first … first + count − 1 to the sums; gives their errors (F, K, count, 3)."""
    scans = world.missed.shape[0]
    errors = np.zeros((filters.filters.size, scans, count, 3))
    work = Work(
        tracks=np.zeros((count, 9)),
        forecasts=np.zeros((count, 2)),
        entries=np.zeros(count, np.int64),
        measured=np.zeros((count, 2)),
        ages=np.zeros(count, np.int64),
        passes=np.zeros(count),
        room=room_for(world.mean.shape[0], world.reversed.size),
        held=hypotheses(count, int(filters.filters["kept"].max())),
    )
    run_block(world, filters, first, work, errors, sums)
    return errors
