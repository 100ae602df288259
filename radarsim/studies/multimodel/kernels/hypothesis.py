"""A hypothesis of nine states for eight realisations: merged of others, and predicted and updated in one go.

A hypothesis (P2 eq. 1) takes HYPOTHESIS rows of the work array: mean, covariance in six blocks (see `blocks`),
probability. What a step needs is held in lanes too (models over the interval, transition probabilities), because
after a missed plot each realisation has an interval of its own.
"""

import numpy as np

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import any_greater, full, get, put, row, rows, where_greater
from radarsim.kernels.symmetric import (
    dot,
    factored,
    predicted_axis,
    predicted_cross,
    predicted_own,
    scaled,
    shrunk_cross,
    shrunk_own,
    whitened,
)

MOST = 5  # models in a bank
MEAN, OWN, CROSS, PROBABILITY = 0, 9, 27, 54  # rows within a hypothesis; mean and own blocks by axis, cross: xy, xz, yz
HYPOTHESIS = 56
BANK = MOST * HYPOTHESIS
SPARE = 2 * BANK  # hypotheses before they are merged (GPB2), and the merged output
WEIGHT = 3 * BANK
SHARE = WEIGHT + MOST
RESULT = SHARE + MOST  # normalised innovation squared and determinant of S, of each model
RESULT_GROUP = RESULT + 2 * MOST  # the same of each group (GPB2)
MODEL = RESULT_GROUP + 2 * MOST  # F and Q of each model over the present interval
TRANSITION = MODEL + 11 * MOST
WAIT = TRANSITION + MOST * MOST  # seconds since the last plot
ESTIMATE = WAIT + 1  # the last output mean
NOISE = ESTIMATE + 9  # measurement covariance at the prediction
SURPRISE = NOISE + 6  # normalised innovation squared of the hypothesis that was thought most probable before the plot
MERGED = SURPRISE + 1  # hypotheses that went into merges of more than one, and the number of such merges, in a scan
WORK = MERGED + 2

PLOT = 10  # rows of a plot: position x, y, z; covariance xx, xy, xz, yy, yz, zz; 1 where detected, else 0
VARIANCE, POSITION, MODELS, INNOVATION, MERGES = 9, 18, 21, 26, 27  # rows of an output after the mean: see `output`
OUTPUT = 29


def work_arrays() -> tuple[np.ndarray, np.ndarray]:
    """Memory of one filter for eight realisations: rows, and whole numbers (see `multimodel_strip.filter_strip`)."""
    return rows(WORK), np.array([0, -1, 1, 0])


@inline
def get3(pointer, first):
    """Three neighbours in memory, from number `first` on."""
    return get(pointer, first), get(pointer, first + 1), get(pointer, first + 2)


@inline
def get6(pointer, first):
    """Six neighbours in memory, from number `first` on."""
    return get3(pointer, first) + get3(pointer, first + 3)


@inline
def put3(pointer, first, x):
    """Write three neighbours, from number `first` on."""
    put(pointer, first, x[0])
    put(pointer, first + 1, x[1])
    put(pointer, first + 2, x[2])


@inline
def put6(pointer, first, x):
    """Write six neighbours, from number `first` on."""
    put3(pointer, first, (x[0], x[1], x[2]))
    put3(pointer, first + 3, (x[3], x[4], x[5]))


@inline
def put9(pointer, first, x):
    """Write nine neighbours, from number `first` on."""
    put6(pointer, first, (x[0], x[1], x[2], x[3], x[4], x[5]))
    put3(pointer, first + 6, (x[6], x[7], x[8]))


# ---- merging: eq. (4) with the shares of any rule --------
# Addresses say which axis and block is meant: a number in the call would be compiled anew for each of its values.
@inline
def mixed_mean(listed, count, shares, means):
    """Share-weighted mean of one axis over the listed hypotheses; means: row of that axis."""
    if count == 1:
        return get3(means, listed[0])
    a, b, c = full(0.0), full(0.0), full(0.0)
    for n in range(count):
        w, x = get(shares, n), get3(means, listed[n])
        a, b, c = a + w * x[0], b + w * x[1], c + w * x[2]
    return a, b, c


@inline
def offset(means, hypothesis, mean):
    """Three numbers of a hypothesis' mean less those of `mean`."""
    x = get3(means, hypothesis)
    return x[0] - mean[0], x[1] - mean[1], x[2] - mean[2]


@inline
def mixed_own(listed, count, shares, block, means, mean):
    """Share-weighted own block of one axis, with the spread of the means."""
    if count == 1:
        return get6(block, listed[0])
    p = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        w, q, d = get(shares, n), get6(block, listed[n]), offset(means, listed[n], mean)
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
def mixed_cross(listed, count, shares, block, means, mean, others, other):
    """Share-weighted block between two axes, with the spread of the means."""
    if count == 1:
        return get6(block, listed[0]) + get3(block, listed[0] + 6)
    c = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        w, q, r = get(shares, n), get6(block, listed[n]), get3(block, listed[n] + 6)
        d, e = offset(means, listed[n], mean), offset(others, listed[n], other)
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


@inline
def mixed(work, listed, count):
    """Means of the three axes, own blocks, blocks between axes: of the listed hypotheses, by the shares."""
    shares, p, q, r = row(work, SHARE), row(work, MEAN), row(work, MEAN + 3), row(work, MEAN + 6)
    x, y, z = (
        mixed_mean(listed, count, shares, p),
        mixed_mean(listed, count, shares, q),
        mixed_mean(listed, count, shares, r),
    )
    return (
        (x, y, z),
        (
            mixed_own(listed, count, shares, row(work, OWN), p, x),
            mixed_own(listed, count, shares, row(work, OWN + 6), q, y),
            mixed_own(listed, count, shares, row(work, OWN + 12), r, z),
        ),
        (
            mixed_cross(listed, count, shares, row(work, CROSS), p, x, q, y),
            mixed_cross(listed, count, shares, row(work, CROSS + 9), p, x, r, z),
            mixed_cross(listed, count, shares, row(work, CROSS + 18), q, y, r, z),
        ),
    )


@inline
def written(target, means, own, cross):
    """Write means and packed covariances of the three axes into a hypothesis."""
    put9(target, MEAN, means[0] + means[1] + means[2])
    put6(target, OWN, own[0])
    put6(target, OWN + 6, own[1])
    put6(target, OWN + 12, own[2])
    put9(target, CROSS, cross[0])
    put9(target, CROSS + 9, cross[1])
    put9(target, CROSS + 18, cross[2])


@part
def merged(work, listed, count, target):
    """Write the merge of the listed hypotheses, by the shares, to the address `target`."""
    means, own, cross = mixed(work, listed, count)
    written(target, means, own, cross)


# ---- prediction and update: eqs. (6) and (9) --------
@part
def advanced(work, listed, count, target, model, result, plot, noise):
    """Merge the listed hypotheses, predict with the model in row `model`, update with a plot, write to `target`.

    target, plot, noise: addresses of a hypothesis, of the plot (PLOT rows) and of its covariance (6 rows). Rows
    result and result + 1 take the normalised innovation squared and the determinant of its covariance (0, 1 where
    the plot is missed).
    """
    f = get(work, model), get(work, model + 1), get(work, model + 2), get(work, model + 3), get(work, model + 4)
    q, merge, zero = get6(work, model + 5), mixed(work, listed, count), full(0.0)
    if any_greater(f[4], zero):
        updated(work, merge, f, q, target, result, plot, noise)
    else:
        # A model without acceleration: with these zeros the compiler leaves out half of the operations.
        f, q = (f[0], zero, f[2], zero, zero), (q[0], q[1], zero, q[3], zero, zero)
        updated(work, merge, f, q, target, result, plot, noise)


@inline
def updated(work, merge, f, q, target, result, plot, noise):
    """Predict a merge (means, own and cross blocks) with F and Q, update it with a plot, write it: see `advanced`."""
    means, own, cross = merge
    a, b, c = predicted_own(own[0], f, q), predicted_own(own[1], f, q), predicted_own(own[2], f, q)
    d, e, g = predicted_cross(cross[0], f), predicted_cross(cross[1], f), predicted_cross(cross[2], f)
    x, y, z = predicted_axis(means[0], f), predicted_axis(means[1], f), predicted_axis(means[2], f)

    r = get6(noise, 0)
    lower, i, determinant = factored((a[0] + r[0], d[0] + r[1], e[0] + r[2], b[0] + r[3], g[0] + r[4], c[0] + r[5]))
    detected = get(plot, 9)
    i = i[0] * detected, i[1] * detected, i[2] * detected
    v = whitened((get(plot, 0) - x[0], get(plot, 1) - y[0], get(plot, 2) - z[0]), lower)
    put(work, result, dot(scaled(v, i), v))
    put(work, result + 1, where_greater(detected, full(0.5), determinant, full(1.0)))

    # Rows of P H', the columns of P that belong to the three coordinates, whitened: P H' S⁻¹ H P is their product.
    hx = whitened((a[0], d[0], e[0]), lower), whitened((a[1], d[3], e[3]), lower), whitened((a[2], d[6], e[6]), lower)
    hy = whitened((d[0], b[0], g[0]), lower), whitened((d[1], b[1], g[3]), lower), whitened((d[2], b[2], g[6]), lower)
    hz = whitened((e[0], g[0], c[0]), lower), whitened((e[1], g[1], c[1]), lower), whitened((e[2], g[2], c[2]), lower)
    gx = scaled(hx[0], i), scaled(hx[1], i), scaled(hx[2], i)
    gy = scaled(hy[0], i), scaled(hy[1], i), scaled(hy[2], i)
    gz = scaled(hz[0], i), scaled(hz[1], i), scaled(hz[2], i)
    written(
        target,
        (
            (x[0] + dot(gx[0], v), x[1] + dot(gx[1], v), x[2] + dot(gx[2], v)),
            (y[0] + dot(gy[0], v), y[1] + dot(gy[1], v), y[2] + dot(gy[2], v)),
            (z[0] + dot(gz[0], v), z[1] + dot(gz[1], v), z[2] + dot(gz[2], v)),
        ),
        (shrunk_own(a, gx, hx), shrunk_own(b, gy, hy), shrunk_own(c, gz, hz)),
        (shrunk_cross(d, gx, hy), shrunk_cross(e, gx, hz), shrunk_cross(g, gy, hz)),
    )
