"""The bursts of eight realisations: their sums drawn, and what a filter's estimator makes of them.

As in P4's kernels an estimate is its deviation from the truth, in turns over the burst.
"""

import numpy as np

from radarsim.bursts.kernels.lanes import LIVE, PASSES, PRIOR, X, lane, merge, step
from radarsim.bursts.kernels.lanes import ROWS as WORK
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.strip import evaluate, put_drawn, take_window
from radarsim.kernels.compile import kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, rows
from radarsim.kernels.random import LANE_BITS, U, threefry, words_to_normals
from radarsim.studies.pulses_to_tracks.kernels import records as rec
from radarsim.studies.pulses_to_tracks.kernels.spectrum import highest_line

AT_ONCE = 64  # blocks whose normals are drawn before their sums are made: 32 KiB


@part
def draw_pairs(k0, k1, who, pair, a, b):
    """Unit normals of the realisations who (8,) over pairs `pair`, `pair` + 1, …, both even, into flat a and b.

    As `fill_normal_strip`. Who is read so that all but the first loop run in vector registers: five times faster.
    """
    x, y = a.view(np.uint64), b.view(np.uint64)
    for i in range(a.size // 2):
        x[i] = U(who[i & (WIDTH - 1)])
    for i in range(a.size // 2):
        x[i], y[i] = threefry(x[i], (pair >> U(1)) + (U(i) >> U(LANE_BITS)), k0, k1)
    words_to_normals(a, b)


@kernel
def draw_sums(world, k, who, a, b, drawn):
    """Block sums of scan k of the realisations who (8,) into rows; as `bursts.kernels.strip.draw_strip`."""
    k0, k1 = world.keys[1, 0], world.keys[1, 1]
    blocks, factor = world.mean.shape[0], world.factor[world.law[k]]
    for begin in range(0, blocks, AT_ONCE):
        end = min(begin + AT_ONCE, blocks)
        pair = U(2 * (blocks * k + begin))
        draw_pairs(k0, k1, who, pair, a[: 2 * WIDTH * (end - begin)], b[: 2 * WIDTH * (end - begin)])
        put_drawn(world.mean[begin:end], factor[begin:end], a, b, drawn[4 * WIDTH * begin :])


@part
def put_forecast(world, forecast, work):
    """Errors of the forecast (8, 2) of velocity and acceleration as those of the phase's coefficients."""
    zero, turns = full(0.0), world.to_turns
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
    for n in range(WIDTH):
        v, a = forecast[n, 0], forecast[n, 1]
        work[lane(PRIOR + 1, n)] = turns[0, 0] * v + turns[0, 1] * a
        work[lane(PRIOR + 2, n)] = turns[1, 1] * a
    for j in range(SIZE):
        put(work, X + j, get(work, PRIOR + j))


@part
def ideal(world, k, window, work, sums, drawn):
    """The estimate that the Fisher bound allows: one step from the truth, linear in the noise."""
    zero = full(0.0)
    physics, table = world.physics[k], address(world.tables[0])
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
        put(work, X + j, zero)
    merge(drawn, table, address(world.tables[1]), window.table, window.weights, window.blocks, sums)
    evaluate(physics, work, sums, table, window, 0)
    put(work, LIVE, full(1.0))
    step(work, window, physics.amplitude / physics.sigma**2, False, full(1.0))


@kernel
def estimate(world, filters, f, k, entry, who, forecast, room, found):
    """Velocity and acceleration at the middle of the bursts of scan k, less the true ones, into found (8, 2).

    By the estimator of filter f with windows of an entry of its menu, of the realisations who (8,), whose forecasts err
    by forecast (8, 2). Returns the passes over a window's data of each as the sum over the first eight lanes of work.
    """
    work_, sums_, drawn_, a, b, re, im = room
    draw_sums(world, k, who, a, b, drawn_)
    work, sums, drawn = address(work_), address(sums_), address(drawn_)
    physics, own, free = world.physics[k], filters.filters[f], filters.windows[filters.free[f, k]]
    put(work, PASSES, full(0.0))
    if own.kind == rec.BOUND:
        ideal(world, k, free, work, sums, drawn)
    else:
        tables = address(world.tables[0]), address(world.tables[1])
        put_forecast(world, forecast, work)
        if own.kind == rec.SEQUENCE:
            first = filters.first[f, k, entry]
            for w in range(filters.count[f, k, entry]):
                window = filters.windows[first + w]
                take_window(physics, drawn, tables, window, filters.options[f], w == 0, work, sums)
        else:
            highest_line(
                *(drawn, physics.pulses, world.offset[k], world.twiddle, world.reversed),
                *(work, address(re), address(im)),
            )
        # What goes to the filter must not hold the forecast once more: the last step is on the likelihood alone.
        take_window(physics, drawn, tables, free, filters.last[f], own.kind != rec.SEQUENCE, work, sums)
    measured = world.measured
    for n in range(WIDTH):
        for c in range(2):
            total = 0.0
            for j in range(SIZE):
                total += measured[c, j] * work[lane(X + j, n)]
            found[n, c] = total


def room_for(blocks: int, lines: int) -> tuple:
    """Work arrays for eight bursts: estimates, sums of a window, sums drawn, normals, a spectrum."""
    return (
        *(rows(WORK), rows(4 * blocks), rows(4 * blocks), rows(2 * AT_ONCE), rows(2 * AT_ONCE)),
        *(rows(lines), rows(lines)),
    )
