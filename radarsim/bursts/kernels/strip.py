"""The sequence of discriminators over block sums, eight bursts side by side: `sequence`, for the fast engine.

A window goes on until all eight bursts are done with it; those that are done earlier stay where they are, so that no
burst's estimate depends on its neighbours.
"""

import math

import numpy as np

from radarsim.bursts.kernels import lanes as at
from radarsim.bursts.kernels.lanes import copy, fraction, lane, log_posterior, merge, score, step
from radarsim.bursts.kernels.scoring import SIZE, TURN
from radarsim.bursts.kernels.sequence import LEAST_COHERENCE
from radarsim.kernels.compile import kernel, part
from radarsim.kernels.lanes import WIDTH, address, any_greater, full, get, put, rows, where_greater
from radarsim.kernels.random import fill_normal_strip


@part
def evaluate(physics, work, sums, table, window):
    """L, the coherent sum and the gradient of a window at the estimate."""
    for j in range(SIZE):
        put(work, at.B + j, window.powers[j] * get(work, at.X + j))
    score(work, sums, table, window.table, window.blocks, physics.image, physics.amplitude)


@part
def search(physics, work, sums, table, window, options, needed):
    """Moves the lanes that need it to the best of the points along the direction in which hand-overs err."""
    weight, half, points = physics.amplitude / physics.sigma**2, full(0.5), options.search
    copy(work, at.X, at.BEGUN)
    put(work, at.BEST, log_posterior(work, window, weight))
    put(work, at.CHOSEN, full(0.0))
    for point in range(-points, points + 2):
        last = point > points
        away = options.spacing * get(work, at.CHOSEN) if last else full(options.spacing * point)
        for j in range(SIZE):
            put(work, at.X + j, get(work, at.BEGUN + j) + window.direction[j] * away)
        if point == 0:
            continue
        evaluate(physics, work, sums, table, window)
        if not last:
            found, best = log_posterior(work, window, weight), get(work, at.BEST)
            better = where_greater(found, best, needed, full(0.0))
            put(work, at.BEST, where_greater(better, half, found, best))
            put(work, at.CHOSEN, where_greater(better, half, full(float(point)), get(work, at.CHOSEN)))
    put(work, at.PASSES, get(work, at.PASSES) + (2.0 * points + 1.0) * needed)


@part
def scored(physics, work, sums, table, window, options, searching):
    """Scoring within a window until its stop rule."""
    numbers = window.pulses * physics.samples_per_pulse
    share = 1.0 if physics.complex_samples else 0.5
    level, weight = share * numbers * physics.amplitude, physics.amplitude / physics.sigma**2
    error = physics.sigma * math.sqrt(share * numbers) / level
    zero, one = full(0.0), full(1.0)
    put(work, at.LIVE, one)
    for number in range(options.steps):
        evaluate(physics, work, sums, table, window)
        put(work, at.PASSES, get(work, at.PASSES) + get(work, at.LIVE))
        if number == 0 and searching:
            enough = full(1.0 - options.margin * error)
            needed = where_greater(enough, (1.0 / level) * get(work, at.COHERENT), one, zero)
            if any_greater(needed, zero):
                search(physics, work, sums, table, window, options, needed)
        coherence = one
        if options.coherent:
            coherence = (1.0 / level) * get(work, at.COHERENT) + 3.0 * error  # with a margin for noise
            coherence = where_greater(one, coherence, coherence, one)
            coherence = where_greater(coherence, full(LEAST_COHERENCE), coherence, full(LEAST_COHERENCE))
        step(work, window, weight, options.coherent, coherence)
        live = where_greater(get(work, at.SQUARED), full(options.tolerance**2), get(work, at.LIVE), zero)
        put(work, at.LIVE, live)
        if not any_greater(live, zero):
            break


@part
def first_phase(physics, work, sums, table, window):
    """Puts the phase, the rest as forecast, at the argument of Σ u e^{-jψ}, where the likelihood is largest."""
    evaluate(physics, work, sums, table, window)
    for n in range(WIDTH):
        work[lane(at.X, n)] += math.atan2(work[lane(at.SLOPES, n)], work[lane(at.COHERENT, n)]) / TURN
    put(work, at.PASSES, get(work, at.PASSES) + 1.0)


@part
def best_of_phases(physics, work, sums, table, window, options):
    """The first window scored from equally spaced phases; the end with the largest posterior is kept."""
    weight = physics.amplitude / physics.sigma**2
    copy(work, at.X, at.BEGUN)
    put(work, at.BEST, full(-math.inf))
    for phase in range(options.phases):
        copy(work, at.BEGUN, at.X)
        put(work, at.X, get(work, at.X) + phase / options.phases)
        scored(physics, work, sums, table, window, options, False)
        evaluate(physics, work, sums, table, window)
        put(work, at.PASSES, get(work, at.PASSES) + 1.0)
        found, best = log_posterior(work, window, weight), get(work, at.BEST)
        for j in range(SIZE):
            put(
                work,
                at.KEPT + j,
                where_greater(found, best, get(work, at.X + j), get(work, at.KEPT + j)),
            )
        put(work, at.BEST, where_greater(found, best, found, best))
    copy(work, at.KEPT, at.X)


@part
def take_window(physics, drawn, tables, window, options, first, work, sums):
    """One window of an estimator on eight bursts, the first or a later one: the estimate in work moves.

    drawn are rows of the blocks' sums, tables the addresses of those of `blocks.Tables`: of the blocks, and weights.
    """
    table, weights = tables
    merge(drawn, table, weights, window.table, window.weights, window.blocks, sums)
    starts = first and not options.from_truth
    if starts and options.phases > 0:
        best_of_phases(physics, work, sums, table, window, options)
    else:
        if starts:
            first_phase(physics, work, sums, table, window)
        scored(physics, work, sums, table, window, options, not first and options.search > 0)


@kernel
def run_strip(physics, drawn, tables, windows, options, work, sums, errors):
    """All windows (K,) of an estimator on eight bursts; writes errors (up to 8, K, 6), in turns over the burst.

    drawn are rows of the blocks' sums, tables those of `blocks.Tables`. Passes are left in work.
    """
    table, weights = address(tables[0]), address(tables[1])
    work, sums, drawn = address(work), address(sums), address(drawn)
    for j in range(SIZE):
        put(work, at.X + j, full(0.0) if options.from_truth else get(work, at.PRIOR + j))
    put(work, at.PASSES, full(0.0))
    for k in range(options.windows):
        take_window(physics, drawn, (table, weights), windows[k], options, k == 0, work, sums)
        for j in range(SIZE):
            error = get(work, at.X + j)
            put(work, at.BEGUN + j, fraction(error) if j == 0 else error)
        for n in range(errors.shape[0]):
            for j in range(SIZE):
                errors[n, k, j] = work[lane(at.BEGUN + j, n)]


@kernel
def draw_forecasts(key, first, sigma, work):
    """Errors of the forecasts of realisations first … first + 7, of standard deviations sigma (6,); as `draw_prior`."""
    a, b = np.empty(SIZE // 2 * WIDTH), np.empty(SIZE // 2 * WIDTH)
    fill_normal_strip(key, first, 0, a, b)
    work, a, b = address(work), address(a), address(b)
    for pair in range(SIZE // 2):
        put(work, at.PRIOR + 2 * pair, sigma[2 * pair] * get(a, pair))
        put(work, at.PRIOR + 2 * pair + 1, sigma[2 * pair + 1] * get(b, pair))


@kernel
def draw_strip(key, first, mean, factor, a, b, drawn):
    """Block sums of realisations first … first + 7 into rows; draws 2i and 2i + 1 make block i."""
    fill_normal_strip(key, first, 0, a, b)
    put_drawn(mean, factor, a, b, drawn)


@kernel
def put_drawn(mean, factor, a, b, drawn):
    """Block sums into rows, of normals a and b: numbers 2i and 2i + 1 of either make block i."""
    a, b, drawn = address(a), address(b), address(drawn)
    for i in range(mean.shape[0]):
        n0, n1, n2, n3 = get(a, 2 * i), get(b, 2 * i), get(a, 2 * i + 1), get(b, 2 * i + 1)
        f = factor[i]
        put(drawn, 4 * i, mean[i, 0] + f[0] * n0)
        put(drawn, 4 * i + 1, mean[i, 1] + f[1] * n0 + f[2] * n1)
        put(drawn, 4 * i + 2, mean[i, 2] + f[3] * n0 + f[4] * n1 + f[5] * n2)
        put(drawn, 4 * i + 3, mean[i, 3] + f[6] * n0 + f[7] * n1 + f[8] * n2 + f[9] * n3)


@kernel
def run_strips(physics, mean, factor, tables, windows, options, keys, first, sigma, room, errors, passes):
    """`estimate_strips` with its work arrays in room."""
    work, sums, drawn, a, b = room
    for start in range(0, errors.shape[0], WIDTH):
        stop = min(start + WIDTH, errors.shape[0])
        draw_forecasts(keys[1], first + start, sigma, work)
        draw_strip(keys[0], first + start, mean, factor, a, b, drawn)
        for e in range(options.size):
            run_strip(physics, drawn, tables, windows[e], options[e], work, sums, errors[start:stop, e])
            for n in range(stop - start):
                passes[start + n, e] = int(work[lane(at.PASSES, n)])


def room_for(blocks: int) -> tuple[np.ndarray, ...]:
    """Work arrays for eight bursts of so many blocks: estimates, sums of a window, sums drawn, normals."""
    return rows(at.ROWS), rows(4 * blocks), rows(4 * blocks), rows(2 * blocks), rows(2 * blocks)


def estimate_strips(physics, law, tables, windows, options, noise, first, out) -> None:
    """As `sequence.estimate_block`, with block sums: errors (n, F, K, 6) and passes (n, F) are written.

    law is of the sums drawn: mean (blocks, 4) and factor (blocks, 10); noise the keys (2, 2), and sigma (6,) of the
    forecast's errors; tables those of `blocks.Tables`; out = (errors, passes). All is relative to the truth.
    """
    (mean, factor), (keys, sigma) = law, noise
    run_strips(physics, mean, factor, tables, windows, options, keys, first, sigma, room_for(len(mean)), *out)
