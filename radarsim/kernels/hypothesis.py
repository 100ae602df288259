"""A hypothesis of nine states for eight realisations: merged of others, and predicted and updated in one go.

A hypothesis (P2 eq. 1) takes HYPOTHESIS rows of the work array: mean, covariance in six blocks (see `blocks`), probability.
What a step needs is held in lanes too (models over the interval, transition probabilities), because after a missed plot
each realisation has an interval of its own.
"""

import numpy as np

from radarsim.kernels.blocks import (
    dot,
    inverse,
    predicted_axis,
    predicted_cross,
    predicted_own,
    shrunk_cross,
    shrunk_own,
    times_symmetric,
)
from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.lanes import full, get, put, rows, where_greater

MOST = 5  # models in a bank
MEAN, OWN, CROSS, PROBABILITY = 0, 9, 27, 54  # rows within a hypothesis; mean and own blocks by axis, cross: xy, xz, yz
HYPOTHESIS = 56
BANK = MOST * HYPOTHESIS
SPARE = 2 * BANK  # hypotheses before they are merged (GPB2), and the merged output
WEIGHT = 3 * BANK
SHARE = WEIGHT + MOST
RESULT = SHARE + MOST  # normalised innovation squared and determinant of S, of each model
GROUP = RESULT + 2 * MOST  # the smallest normalised innovation squared of each group (GPB2)
MODEL = GROUP + MOST  # F and Q of each model over the present interval
TRANSITION = MODEL + 11 * MOST
WAIT = TRANSITION + MOST * MOST  # seconds since the last plot
ESTIMATE = WAIT + 1  # the last output mean
NOISE = ESTIMATE + 9  # measurement covariance at the prediction
MAIN = NOISE + 6  # the most probable model after the last plot (GPB1)
WORK = MAIN + 2

PLOT = 10  # rows of a plot: position x, y, z; covariance xx, xy, xz, yy, yz, zz; 1 where detected, else 0
VARIANCE, POSITION, MODELS, INNOVATION = 9, 18, 21, 26  # rows of an output after the mean: see `output`
OUTPUT = 28


def work_arrays() -> tuple[np.ndarray, np.ndarray]:
    """Empty memory of one filter for eight realisations: rows, and whole numbers (bank in use, interval held, settled, list)."""
    return rows(WORK), np.zeros(4 + MOST, dtype=np.int64)


@inline
def get3(work, row):
    return get(work, row), get(work, row + 1), get(work, row + 2)


@inline
def get6(work, row):
    return get3(work, row) + get3(work, row + 3)


@inline
def put3(work, row, x):
    put(work, row, x[0])
    put(work, row + 1, x[1])
    put(work, row + 2, x[2])


@inline
def put6(work, row, x):
    put3(work, row, (x[0], x[1], x[2]))
    put3(work, row + 3, (x[3], x[4], x[5]))


@inline
def put9(work, row, x):
    put6(work, row, (x[0], x[1], x[2], x[3], x[4], x[5]))
    put3(work, row + 6, (x[6], x[7], x[8]))


# ---- merging: eq. (4) with the shares of any rule -----------------------------------------------------------------------------
@inline
def mixed_mean(work, listed, count, axis):
    """Share-weighted mean of one axis over the listed hypotheses."""
    if count == 1:
        return get3(work, listed[0] + MEAN + 3 * axis)
    a, b, c = full(0.0), full(0.0), full(0.0)
    for n in range(count):
        w, x = get(work, SHARE + n), get3(work, listed[n] + MEAN + 3 * axis)
        a, b, c = a + w * x[0], b + w * x[1], c + w * x[2]
    return a, b, c


@inline
def offset(work, row, mean):
    x = get3(work, row)
    return x[0] - mean[0], x[1] - mean[1], x[2] - mean[2]


@inline
def mixed_own(work, listed, count, axis, mean):
    """Share-weighted own block of one axis, with the spread of the means."""
    first = OWN + 6 * axis
    if count == 1:
        return get6(work, listed[0] + first)
    p = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        w, q = get(work, SHARE + n), get6(work, listed[n] + first)
        d = offset(work, listed[n] + MEAN + 3 * axis, mean)
        p = (
            p[0] + w * (q[0] + d[0] * d[0]),
            p[1] + w * (q[1] + d[0] * d[1]),
            p[2] + w * (q[2] + d[0] * d[2]),
            p[3] + w * (q[3] + d[1] * d[1]),
            p[4] + w * (q[4] + d[1] * d[2]),
            p[5] + w * (q[5] + d[2] * d[2]),
        )
    return p


@inline
def mixed_cross(work, listed, count, pair, axis, mean, other, other_mean):
    """Share-weighted block between two axes, with the spread of the means."""
    first = CROSS + 9 * pair
    if count == 1:
        return get6(work, listed[0] + first) + get3(work, listed[0] + first + 6)
    c = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        w, q, r = get(work, SHARE + n), get6(work, listed[n] + first), get3(work, listed[n] + first + 6)
        d = offset(work, listed[n] + MEAN + 3 * axis, mean)
        e = offset(work, listed[n] + MEAN + 3 * other, other_mean)
        c = (
            c[0] + w * (q[0] + d[0] * e[0]),
            c[1] + w * (q[1] + d[0] * e[1]),
            c[2] + w * (q[2] + d[0] * e[2]),
            c[3] + w * (q[3] + d[1] * e[0]),
            c[4] + w * (q[4] + d[1] * e[1]),
            c[5] + w * (q[5] + d[1] * e[2]),
            c[6] + w * (r[0] + d[2] * e[0]),
            c[7] + w * (r[1] + d[2] * e[1]),
            c[8] + w * (r[2] + d[2] * e[2]),
        )
    return c


@kernel
def merged(work, listed, count, target):
    """Write the merge of the listed hypotheses, by shares, to row `target`."""
    x, y, z = mixed_mean(work, listed, count, 0), mixed_mean(work, listed, count, 1), mixed_mean(work, listed, count, 2)
    a, b, c = mixed_own(work, listed, count, 0, x), mixed_own(work, listed, count, 1, y), mixed_own(work, listed, count, 2, z)
    d = mixed_cross(work, listed, count, 0, 0, x, 1, y)
    e = mixed_cross(work, listed, count, 1, 0, x, 2, z)
    f = mixed_cross(work, listed, count, 2, 1, y, 2, z)
    written(work, target, x, y, z, a, b, c, d, e, f)


@inline
def written(work, target, x, y, z, a, b, c, d, e, f):
    put3(work, target + MEAN, x)
    put3(work, target + MEAN + 3, y)
    put3(work, target + MEAN + 6, z)
    put6(work, target + OWN, a)
    put6(work, target + OWN + 6, b)
    put6(work, target + OWN + 12, c)
    put9(work, target + CROSS, d)
    put9(work, target + CROSS + 9, e)
    put9(work, target + CROSS + 18, f)


# ---- prediction and update: eqs. (6) and (9) -----------------------------------------------------------------------------------
@kernel
def advanced(work, listed, count, target, model, result, plots, plot, noises, noise):
    """Merge the listed hypotheses, predict with the model in row `model`, update with a plot, write to row `target`.

    plots, plot: the plot's array and row; noises, noise: array and row of its covariance (6). Rows result, result + 1 take
    the normalised innovation squared and the determinant of its covariance (0 and 1 where the plot is missed).
    """
    f = get(work, model), get(work, model + 1), get(work, model + 2), get(work, model + 3), get(work, model + 4)
    q = get6(work, model + 5)
    mx, my, mz = mixed_mean(work, listed, count, 0), mixed_mean(work, listed, count, 1), mixed_mean(work, listed, count, 2)
    a = predicted_own(mixed_own(work, listed, count, 0, mx), f, q)
    b = predicted_own(mixed_own(work, listed, count, 1, my), f, q)
    c = predicted_own(mixed_own(work, listed, count, 2, mz), f, q)
    d = predicted_cross(mixed_cross(work, listed, count, 0, 0, mx, 1, my), f)
    e = predicted_cross(mixed_cross(work, listed, count, 1, 0, mx, 2, mz), f)
    g = predicted_cross(mixed_cross(work, listed, count, 2, 1, my, 2, mz), f)
    x, y, z = predicted_axis(mx, f), predicted_axis(my, f), predicted_axis(mz, f)

    r = get6(noises, noise)
    i, determinant = inverse((a[0] + r[0], d[0] + r[1], e[0] + r[2], b[0] + r[3], g[0] + r[4], c[0] + r[5]))
    detected = get(plots, plot + 9)
    i = i[0] * detected, i[1] * detected, i[2] * detected, i[3] * detected, i[4] * detected, i[5] * detected
    innovation = get(plots, plot) - x[0], get(plots, plot + 1) - y[0], get(plots, plot + 2) - z[0]
    v = times_symmetric(innovation, i)
    put(work, result, dot(innovation, v))
    put(work, result + 1, where_greater(detected, full(0.5), determinant, full(1.0)))

    # Rows of P H': the columns of P that belong to the three coordinates.
    hx = (a[0], d[0], e[0]), (a[1], d[3], e[3]), (a[2], d[6], e[6])
    hy = (d[0], b[0], g[0]), (d[1], b[1], g[3]), (d[2], b[2], g[6])
    hz = (e[0], g[0], c[0]), (e[1], g[1], c[1]), (e[2], g[2], c[2])
    gx = times_symmetric(hx[0], i), times_symmetric(hx[1], i), times_symmetric(hx[2], i)
    gy = times_symmetric(hy[0], i), times_symmetric(hy[1], i), times_symmetric(hy[2], i)
    gz = times_symmetric(hz[0], i), times_symmetric(hz[1], i), times_symmetric(hz[2], i)
    written(
        work,
        target,
        (x[0] + dot(hx[0], v), x[1] + dot(hx[1], v), x[2] + dot(hx[2], v)),
        (y[0] + dot(hy[0], v), y[1] + dot(hy[1], v), y[2] + dot(hy[2], v)),
        (z[0] + dot(hz[0], v), z[1] + dot(hz[1], v), z[2] + dot(hz[2], v)),
        shrunk_own(a, gx, hx),
        shrunk_own(b, gy, hy),
        shrunk_own(c, gz, hz),
        shrunk_cross(d, gx, hy),
        shrunk_cross(e, gx, hz),
        shrunk_cross(g, gy, hz),
    )
