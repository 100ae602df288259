"""The bursts of eight realisations: their sums are drawn, and estimated by a filter's estimator.

As in P4's kernels an estimate is its deviation from the truth, in turns over the burst."""

import numpy as np

from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.scoring_lanes import LIVE, PASSES, PRIOR, X, lane, merge, step
from radarsim.bursts.kernels.scoring_lanes import ROWS as WORK
from radarsim.bursts.kernels.sequence_lanes import evaluate, put_block_sums, take_window
from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, rows
from radarsim.kernels.random import LANE_BITS, U, threefry, words_to_normals
from radarsim.studies.pulses_to_tracks.kernels.layout import BOUND, SEQUENCE
from radarsim.studies.pulses_to_tracks.kernels.spectrum import highest_line

BLOCKS_AT_ONCE = 64  # blocks whose normals are drawn before their sums are computed: 32 KiB


@kernel_part
def draw_pairs(k0, k1, realisations, pair, a, b):
    """Fill flat arrays a and b with unit normals of realisations (8,), for pairs `pair`, `pair` + 1, …

    As `fill_normal_strip`. Realisations are copied first so that the other loops run in vector registers: five times
    faster."""
    x, y = a.view(np.uint64), b.view(np.uint64)
    for i in range(a.size // 2):
        x[i] = U(realisations[i & (WIDTH - 1)])
    for i in range(a.size // 2):
        x[i], y[i] = threefry(x[i], (pair >> U(1)) + (U(i) >> U(LANE_BITS)), k0, k1)
    words_to_normals(a, b)


@kernel
def draw_sums(world, k, realisations, a, b, block_sums):
    """Fill rows with the block sums of scan k of realisations (8,); as `bursts.kernels.sequence_lanes.draw_strip`."""
    k0, k1 = world.keys[1, 0], world.keys[1, 1]
    blocks, factor = world.mean.shape[0], world.factor[world.noise_law[k]]
    for begin in range(0, blocks, BLOCKS_AT_ONCE):
        end = min(begin + BLOCKS_AT_ONCE, blocks)
        pair = U(2 * (blocks * k + begin))
        draw_pairs(k0, k1, realisations, pair, a[: 2 * WIDTH * (end - begin)], b[: 2 * WIDTH * (end - begin)])
        put_block_sums(world.mean[begin:end], factor[begin:end], a, b, block_sums[4 * WIDTH * begin :])


@kernel_part
def put_forecast(world, forecast, work):
    """Write the errors of forecasts (8, 2) of velocity and acceleration as errors of the phase's coefficients."""
    zero, turns = full(0.0), world.to_turns
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
    for n in range(WIDTH):
        v, a = forecast[n, 0], forecast[n, 1]
        work[lane(PRIOR + 1, n)] = turns[0, 0] * v + turns[0, 1] * a
        work[lane(PRIOR + 2, n)] = turns[1, 1] * a
    for j in range(SIZE):
        put(work, X + j, get(work, PRIOR + j))


@kernel_part
def put_ideal_estimate(world, k, window, work, sums, block_sums):
    """Write the ideal estimate, which reaches the Cramér–Rao bound: one step from the truth, linear in the noise."""
    zero = full(0.0)
    physics, table = world.physics[k], address(world.tables[0])
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
        put(work, X + j, zero)
    merge(block_sums, table, address(world.tables[1]), window.table, window.weights, window.blocks, sums)
    evaluate(physics, work, sums, table, window, 0)
    put(work, LIVE, full(1.0))
    step(work, window, physics.amplitude / physics.sigma**2, False, full(1.0))


@kernel
def estimate_bursts(world, filters, f, k, entry, realisations, forecast, work_arrays, estimates):
    """Fill estimates (8, 2) with the errors of velocity and acceleration at the middle of the bursts of scan k.

    For realisations (8,) by the estimator of filter f, with the windows of an entry of its menu; forecast (8, 2) errs
    by its values. The passes over a window's data are left in row PASSES of the first work array."""
    work_array, sums_array, block_sums_array, a, b, re, im = work_arrays
    draw_sums(world, k, realisations, a, b, block_sums_array)
    work, sums, block_sums = address(work_array), address(sums_array), address(block_sums_array)
    physics, options, free = world.physics[k], filters.filters[f], filters.windows[filters.whole_burst[f, k]]
    put(work, PASSES, full(0.0))
    if options.kind == BOUND:
        put_ideal_estimate(world, k, free, work, sums, block_sums)
    else:
        tables = address(world.tables[0]), address(world.tables[1])
        put_forecast(world, forecast, work)
        if options.kind == SEQUENCE:
            first = filters.first_window[f, k, entry]
            for w in range(filters.window_count[f, k, entry]):
                window = filters.windows[first + w]
                take_window(physics, block_sums, tables, window, filters.options[f], w == 0, work, sums)
        else:
            highest_line(
                *(block_sums, physics.pulses, world.offset[k], world.twiddle, world.bit_reversed),
                *(work, address(re), address(im)),
            )
        # The filter must not get its forecast twice: the last step uses the likelihood alone.
        take_window(physics, block_sums, tables, free, filters.last_options[f], options.kind != SEQUENCE, work, sums)
    measured = world.measured
    for n in range(WIDTH):
        for c in range(2):
            total = 0.0
            for j in range(SIZE):
                total += measured[c, j] * work[lane(X + j, n)]
            estimates[n, c] = total


def allocate_burst_arrays(blocks: int, lines: int) -> tuple:
    """Allocate work arrays for eight bursts: estimates, sums of a window, block sums, normals, a spectrum."""
    return (
        *(rows(WORK), rows(4 * blocks), rows(4 * blocks), rows(2 * BLOCKS_AT_ONCE), rows(2 * BLOCKS_AT_ONCE)),
        *(rows(lines), rows(lines)),
    )
