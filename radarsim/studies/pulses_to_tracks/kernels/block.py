"""A block over all scans: range, forecast, burst, estimate, update; and the sums over realisations.

A filter runs over the realisations of a block scan by scan, so that bursts of the same entry of its menu are estimated
eight at a time. States are errors: estimate minus truth."""

import math

import numpy as np

from radarsim.bursts.kernels.scoring_lanes import PASSES, lane
from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.kalman_algebra import add_scaled, take_rate, take_second_rate, take_value
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels.burst_estimate import allocate_burst_arrays, estimate_bursts
from radarsim.studies.pulses_to_tracks.kernels.fold_hypotheses import take_folds, take_ranges_in_hypotheses
from radarsim.studies.pulses_to_tracks.kernels.layout import (
    AGES,
    AS_MEASURED,
    BOUND,
    GATED,
    TAKEN,
    WRONG_FOLD,
    Work,
    allocate_hypotheses,
)
from radarsim.studies.pulses_to_tracks.kernels.steps import (
    fold,
    lock_weight,
    mix_states,
    predict_state,
    put_state,
    score_burst,
    start_state,
    state_of,
)


@kernel_part
def take_ranges(world, options, k, first, tracks):
    """Predict all tracks (n, 9) to scan k and take its range; the first sets it, and draws the designation."""
    variance = world.sigma_r**2
    for i in range(tracks.shape[0]):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        if k == 0:
            x, P = start_state(world, first + i, noise)
        else:
            x, P = state_of(tracks, i)
            x, P = predict_state(world, options, k, x, P)
            P, gain, _ = take_value(P, variance, 1.0)
            x = add_scaled(x, noise - x[0], gain)
        put_state(tracks, i, x, P)


@inline
def menu_level(options, c, sigma):
    """The level of a menu with the smallest standard deviation that is not below sigma."""
    step = math.floor(math.log(options.top[c] / sigma) / options.ratio[c] + 1e-9)
    return int(min(max(step, 0.0), options.levels[c] - 1.0))


@kernel_part
def make_forecasts(world, options, k, first, work):
    """Fill in the errors (n, 2) of the forecasts of velocity and acceleration, and the entries (n,) of the menu.

    The velocity's error is folded, as a burst shows a velocity only modulo its span."""
    tracks, forecasts, entries = work.tracks, work.forecasts, work.entries
    for i in range(tracks.shape[0]):
        if options.track:
            forecasts[i, 0], forecasts[i, 1] = fold(tracks[i, 1], world.span), tracks[i, 2]
            v, a = menu_level(options, 0, math.sqrt(tracks[i, 6])), menu_level(options, 1, math.sqrt(tracks[i, 8]))
            entries[i] = a * options.levels[0] + v
        else:
            x, y = normals(world.keys[3, 0], world.keys[3, 1], first + i, k)
            forecasts[i, 0], forecasts[i, 1], entries[i] = options.fixed[0] * x, options.fixed[1] * y, 0


@kernel_part
def sorted_indices(entries):
    """The indices that sort entries (n,), equal ones in their order.

    A counting sort, as distinct entries are few: Numba's own takes a second to compile."""
    count, max_entry = entries.size, 0
    for i in range(count):
        max_entry = max(max_entry, entries[i])
    start, order = np.zeros(max_entry + 2, np.int64), np.empty(count, np.int64)
    for i in range(count):
        start[entries[i] + 1] += 1
    for entry in range(max_entry):
        start[entry + 1] += start[entry]
    for i in range(count):
        order[start[entries[i]]] = i
        start[entries[i]] += 1
    return order


@kernel_part
def estimate_all(world, filters, f, k, first, work):
    """Estimate the bursts of scan k, entry by entry: fills in errors (n, 2), and counts passes."""
    realisations, forecast_errors, estimates = np.empty(WIDTH, np.int64), np.empty((WIDTH, 2)), np.empty((WIDTH, 2))
    entries, measured, forecasts, passes = work.entries, work.measured, work.forecasts, work.passes
    estimate_work = work.burst_arrays[0]
    order = sorted_indices(entries)
    begin = 0
    while begin < order.size:
        entry, end = entries[order[begin]], begin
        while end < order.size and end - begin < WIDTH and entries[order[end]] == entry:
            end += 1
        for n in range(WIDTH):
            i = order[min(begin + n, end - 1)]  # an incomplete strip repeats its last realisation
            realisations[n], forecast_errors[n, 0], forecast_errors[n, 1] = first + i, forecasts[i, 0], forecasts[i, 1]
        estimate_bursts(world, filters, f, k, entry, realisations, forecast_errors, work.burst_arrays, estimates)
        for n in range(end - begin):
            measured[order[begin + n], 0], measured[order[begin + n], 1] = estimates[n, 0], estimates[n, 1]
            passes[order[begin + n]] += estimate_work[lane(PASSES, n)]
        begin = end


@kernel_part
def take_estimates(world, filters, f, k, work, sums):
    """Take the estimates (n, 2) of a scan into the tracks; counts and errors are added to the sums."""
    options, sigma, span, tracks = filters.filters[f], filters.sigma[f, k], world.span, work.tracks
    locks, error_sums, takes = sums.locks[f, k], sums.measured[f, k], options.takes
    measured, ages = work.measured, work.ages
    for i in range(tracks.shape[0]):
        x, P = state_of(tracks, i)
        v, a = measured[i, 0], measured[i, 1]
        e = v - x[1] if options.kind == BOUND else fold(v - x[1], span)
        wrong = 1.0 if abs(e + x[1]) > 0.5 * span else 0.0
        v = v if options.kind == BOUND else fold(v, span)
        score_burst(sigma, takes, v, a, i, ages, locks, error_sums)
        R, gain, S = take_rate(P, sigma[0] ** 2, 1.0)
        y = add_scaled(x, e, gain)
        distance, determinant = e * e / S, S
        if takes == 2:
            e = a - y[2]
            R, gain, S = take_second_rate(R, sigma[1] ** 2, 1.0)
            y = add_scaled(y, e, gain)
            distance, determinant = distance + e * e / S, determinant * S
        weight = 1.0
        if options.use == GATED:
            weight = 1.0 if distance <= options.gate else 0.0
        elif options.use != AS_MEASURED:
            weight = lock_weight(distance, determinant, takes, options.lock, options.density)
        if weight == 1.0:
            x, P = y, R
        elif weight > 0.0:
            x, P = mix_states(x, P, y, R, weight)
        put_state(tracks, i, x, P)
        locks[TAKEN] += weight
        locks[WRONG_FOLD] += wrong * weight


@kernel_part
def add_errors(tracks, ages, takes, errors, error, age, loss):
    """Store the errors (n, 3) of a scan and add their powers to the sums."""
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


@kernel_part
def run_filter(world, filters, f, first, work, errors, sums):
    """Run a filter over all scans of realisations first, first + 1, …; fills in errors (K, n, 3)."""
    options, tracks, ages = filters.filters[f], work.tracks, work.ages
    ages[:], work.passes[:] = AGES - 1, 0.0
    for k in range(world.model_defects.shape[0]):
        if options.max_hypotheses > 1:
            take_ranges_in_hypotheses(world, options, k, first, work)
        else:
            take_ranges(world, options, k, first, tracks)
        if options.takes:
            make_forecasts(world, options, k, first, work)
            estimate_all(world, filters, f, k, first, work)
            if options.max_hypotheses > 1:
                take_folds(world, filters, f, k, work, sums)
            else:
                take_estimates(world, filters, f, k, work, sums)
        add_errors(tracks, ages, options.takes, errors[k], sums.error[f, k], sums.ages[f, k], sums.losses[f, k])
    for passes in work.passes:
        sums.passes[f, 0] += passes
        sums.passes[f, 1] += passes * passes


@kernel_part
def add_pairs(errors, base, paired):
    """Add e² times another filter's; errors and base (K, n, 3)."""
    for k in range(errors.shape[0]):
        for i in range(errors.shape[1]):
            for c in range(3):
                paired[k, c] += errors[k, i, c] ** 2 * base[k, i, c] ** 2


@kernel
def run_block(world, filters, first, work, errors, sums):
    """Run all filters over a block with the arrays that `simulate_block` allocates."""
    for f in range(filters.filters.size):
        run_filter(world, filters, f, first, work, errors[f], sums)
    for f in range(filters.filters.size):
        add_pairs(errors[f], errors[filters.baseline], sums.paired[f])
        if filters.ideals[f] >= 0:
            add_pairs(errors[f], errors[filters.ideals[f]], sums.paired_ideal[f])


def simulate_block(world, filters, sums, first, count) -> np.ndarray:
    """Add realisations first … first + count − 1 to the sums; returns their errors (F, K, count, 3)."""
    scans = world.model_defects.shape[0]
    errors = np.zeros((filters.filters.size, scans, count, 3))
    work = Work(
        tracks=np.zeros((count, 9)),
        forecasts=np.zeros((count, 2)),
        entries=np.zeros(count, np.int64),
        measured=np.zeros((count, 2)),
        ages=np.zeros(count, np.int64),
        passes=np.zeros(count),
        burst_arrays=allocate_burst_arrays(world.mean.shape[0], world.bit_reversed.size),
        hypotheses=allocate_hypotheses(count, int(filters.filters["max_hypotheses"].max())),
    )
    run_block(world, filters, first, work, errors, sums)
    return errors
