"""The sequence of discriminators on eight bursts at a time.

A window goes on until all eight bursts have finished it; those that finish earlier keep their estimate, so that no
burst's estimate depends on the others."""

import numpy as np

from radarsim.bursts.kernels import scoring_lanes
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.scoring_lanes import fraction, lane, merge, score
from radarsim.bursts.kernels.sequence import scoring_kernel, window_kernel
from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, rows
from radarsim.kernels.random import fill_normal_strip


@kernel_part
def evaluate(physics, work, sums, table, window, state):
    """L, the coherent sum and the gradient of a window at the estimates of eight bursts; they have no further state."""
    for j in range(SIZE):
        put(work, scoring_lanes.B + j, window.powers[j] * get(work, scoring_lanes.X + j))
    score(work, sums, table, window.table, window.blocks, physics.image, physics.amplitude)


follow = window_kernel(evaluate, scoring_kernel(evaluate))


@kernel_part
def take_window(physics, block_sums, tables, window, options, first, work, sums):
    """One window of an estimator on eight bursts, the first or a later one: the estimate in work moves.

    block_sums are rows; tables are addresses of those of `block_sums.WindowTables`: of blocks and of weights."""
    table, weights = tables
    merge(block_sums, table, weights, window.table, window.weights, window.blocks, sums)
    follow(physics, physics.amplitude, work, sums, table, 0, window, options, first)


@kernel
def run_strip(physics, block_sums, tables, windows, options, work, sums, errors):
    """All windows (K,) of an estimator on eight bursts; writes errors (up to 8, K, 6), in turns over the burst.

    block_sums are rows, tables those of `block_sums.WindowTables`. Passes are left in work."""
    table, weights = address(tables[0]), address(tables[1])
    work, sums, block_sums = address(work), address(sums), address(block_sums)
    for j in range(SIZE):
        put(work, scoring_lanes.X + j, full(0.0) if options.from_truth else get(work, scoring_lanes.PRIOR + j))
    put(work, scoring_lanes.PASSES, full(0.0))
    for k in range(options.windows):
        take_window(physics, block_sums, (table, weights), windows[k], options, k == 0, work, sums)
        for j in range(SIZE):
            error = get(work, scoring_lanes.X + j)
            put(work, scoring_lanes.START + j, fraction(error) if j == 0 else error)
        for n in range(errors.shape[0]):
            for j in range(SIZE):
                errors[n, k, j] = work[lane(scoring_lanes.START + j, n)]


@kernel
def draw_forecasts(key, first, sigma, work):
    """Errors of the forecasts of realisations first … first + 7, of standard deviations sigma (6,); as `draw_prior`."""
    a, b = np.empty(SIZE // 2 * WIDTH), np.empty(SIZE // 2 * WIDTH)
    fill_normal_strip(key, first, 0, a, b)
    work, a, b = address(work), address(a), address(b)
    for pair in range(SIZE // 2):
        put(work, scoring_lanes.PRIOR + 2 * pair, sigma[2 * pair] * get(a, pair))
        put(work, scoring_lanes.PRIOR + 2 * pair + 1, sigma[2 * pair + 1] * get(b, pair))


@kernel
def draw_strip(key, first, mean, factor, a, b, block_sums):
    """Block sums of realisations first … first + 7 into rows; draws 2i and 2i + 1 make block i."""
    fill_normal_strip(key, first, 0, a, b)
    put_block_sums(mean, factor, a, b, block_sums)


@kernel
def put_block_sums(mean, factor, a, b, block_sums):
    """Block sums into rows, of normals a and b: numbers 2i and 2i + 1 of either make block i."""
    a, b, block_sums = address(a), address(b), address(block_sums)
    for i in range(mean.shape[0]):
        n0, n1, n2, n3 = get(a, 2 * i), get(b, 2 * i), get(a, 2 * i + 1), get(b, 2 * i + 1)
        f = factor[i]
        put(block_sums, 4 * i, mean[i, 0] + f[0] * n0)
        put(block_sums, 4 * i + 1, mean[i, 1] + f[1] * n0 + f[2] * n1)
        put(block_sums, 4 * i + 2, mean[i, 2] + f[3] * n0 + f[4] * n1 + f[5] * n2)
        put(block_sums, 4 * i + 3, mean[i, 3] + f[6] * n0 + f[7] * n1 + f[8] * n2 + f[9] * n3)


@kernel
def run_strips(physics, mean, factor, tables, windows, options, keys, first, sigma, room, errors, passes):
    """`estimate_strips` with its work arrays in room."""
    work, sums, block_sums, a, b = room
    for start in range(0, errors.shape[0], WIDTH):
        stop = min(start + WIDTH, errors.shape[0])
        draw_forecasts(keys[1], first + start, sigma, work)
        draw_strip(keys[0], first + start, mean, factor, a, b, block_sums)
        for e in range(options.size):
            run_strip(physics, block_sums, tables, windows[e], options[e], work, sums, errors[start:stop, e])
            for n in range(stop - start):
                passes[start + n, e] = int(work[lane(scoring_lanes.PASSES, n)])


def allocate_work_arrays(blocks: int) -> tuple[np.ndarray, ...]:
    """Work arrays for eight bursts of so many blocks: estimates, sums of a window, sums drawn, normals."""
    return rows(scoring_lanes.ROWS), rows(4 * blocks), rows(4 * blocks), rows(2 * blocks), rows(2 * blocks)


def estimate_strips(physics, law, tables, windows, options, noise, first, out) -> None:
    """As `sequence.estimate_block`, with block sums: errors (n, F, K, 6) and passes (n, F) are written.

    law describes the sums drawn: mean (blocks, 4) and factor (blocks, 10); noise the keys (2, 2), and sigma (6,) of the
    forecast's errors; tables: of `block_sums.WindowTables`; out = (errors, passes). All is relative to the truth."""
    (mean, factor), (keys, sigma) = law, noise
    run_strips(
        physics, mean, factor, tables, windows, options, keys, first, sigma, allocate_work_arrays(len(mean)), *out
    )
