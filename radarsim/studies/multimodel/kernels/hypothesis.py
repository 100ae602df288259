"""A hypothesis of nine states for eight realisations: merged from others, predicted and updated.

A hypothesis (P2 eq. 1) is HYPOTHESIS rows of the work array, see `layout`. Letters, each of eight lanes:

    mu           share of a hypothesis in a merge, eq. (4)
    x, y, z      mean of an axis (3)
    P            a block of the covariance: of one axis (6) or between two axes (9), packed as in
                 `radarsim.kernels.kalman_algebra`; xx, yy, zz, xy, xz, yz: which block it is
    d, e         mean of a hypothesis minus the merged mean, of one axis (3) and of another
    F, Q         a model over the interval, the same for each axis (5 and 6 elements)
    R            covariance of the plot (6)
    v            whitened innovation L⁻¹ (plot - H x) (3)
    S = L D L'   covariance of the innovation H P H' + R (6); L (3), the diagonal of D⁻¹ is i (3)
    wx, wy, wz   rows of P H' L'⁻¹ of an axis (3 x 3)
    gx, gy, gz   the same times D⁻¹, so that K (plot - H x) = g v and K S K' = g w' (K: the gain)

`work`, `target`, `plot` and all other arguments that are not tuples are addresses. `listed` (count,) are the rows of
the hypotheses to be merged; their shares are in the rows `layout.SHARE` …"""

import numpy as np

from radarsim.kernels import kalman_algebra, lane_matrices
from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.kalman_algebra import (
    dot,
    predict_covariance,
    predict_cross,
    predict_state,
    scale_row,
    shrink_block,
    whiten,
)
from radarsim.kernels.lane_matrices import get3, get6, put6
from radarsim.kernels.lanes import any_greater, full, get, put, row, rows, where_greater
from radarsim.studies.multimodel.kernels import layout


def work_arrays() -> tuple[np.ndarray, np.ndarray]:
    """The memory of a filter for eight realisations: rows (WORK), and the numbers CURRENT, PREPARED, NONE_WAITING."""
    numbers = np.zeros(4, dtype=np.int64)
    numbers[layout.CURRENT], numbers[layout.PREPARED], numbers[layout.NONE_WAITING] = 0, -1, 1
    return rows(layout.WORK), numbers


@inline
def put9(pointer, first, x):
    """Write nine consecutive rows, from row `first` on."""
    put6(pointer, first, (x[0], x[1], x[2], x[3], x[4], x[5]))
    lane_matrices.put3(pointer, first + 6, (x[6], x[7], x[8]))


# Axis and block are passed as addresses: a number in the call would be compiled again for each of its values.
@inline
def mixed_mean(listed, count, shares, means):
    """Mean of one axis (3): Σ mu x over the listed hypotheses; means: row of that axis."""
    if count == 1:
        return get3(means, listed[0])
    a, b, c = full(0.0), full(0.0), full(0.0)
    for n in range(count):
        mu, x = get(shares, n), get3(means, listed[n])
        a, b, c = a + mu * x[0], b + mu * x[1], c + mu * x[2]
    return a, b, c


@inline
def offset(means, hypothesis, mean):
    """One axis (3) of a hypothesis' mean minus that of `mean`."""
    x = get3(means, hypothesis)
    return x[0] - mean[0], x[1] - mean[1], x[2] - mean[2]


@inline
def mixed_own(listed, count, shares, block, means, mean):
    """Own block of one axis: Σ mu (P + d d') over the listed hypotheses."""
    if count == 1:
        return get6(block, listed[0])
    p = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        p = kalman_algebra.add_spread(p, get(shares, n), get6(block, listed[n]), offset(means, listed[n], mean))
    return p


@inline
def mixed_cross(listed, count, shares, block, means, mean, other_means, other_mean):
    """Block between two axes: Σ mu (P + d e') over the listed hypotheses."""
    if count == 1:
        return get6(block, listed[0]) + get3(block, listed[0] + 6)
    c = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        mu, P = get(shares, n), get6(block, listed[n]) + get3(block, listed[n] + 6)
        d, e = offset(means, listed[n], mean), offset(other_means, listed[n], other_mean)
        c = (
            c[0] + mu * (P[0] + d[0] * e[0]),
            c[1] + mu * (P[1] + d[0] * e[1]),
            c[2] + mu * (P[2] + d[0] * e[2]),
            c[3] + mu * (P[3] + d[1] * e[0]),
            c[4] + mu * (P[4] + d[1] * e[1]),
            c[5] + mu * (P[5] + d[1] * e[2]),
            c[6] + mu * (P[6] + d[2] * e[0]),
            c[7] + mu * (P[7] + d[2] * e[1]),
            c[8] + mu * (P[8] + d[2] * e[2]),
        )
    return c


@inline
def mix_hypotheses(work, listed, count):
    """Mix the listed hypotheses by their shares: means of the three axes, their own blocks, blocks between axes."""
    shares = row(work, layout.SHARE)
    of_x = row(work, layout.MEAN)
    of_y = row(work, layout.MEAN + 3)
    of_z = row(work, layout.MEAN + 6)
    x = mixed_mean(listed, count, shares, of_x)
    y = mixed_mean(listed, count, shares, of_y)
    z = mixed_mean(listed, count, shares, of_z)
    return (
        (x, y, z),
        (
            mixed_own(listed, count, shares, row(work, layout.OWN), of_x, x),
            mixed_own(listed, count, shares, row(work, layout.OWN + 6), of_y, y),
            mixed_own(listed, count, shares, row(work, layout.OWN + 12), of_z, z),
        ),
        (
            mixed_cross(listed, count, shares, row(work, layout.CROSS), of_x, x, of_y, y),
            mixed_cross(listed, count, shares, row(work, layout.CROSS + 9), of_x, x, of_z, z),
            mixed_cross(listed, count, shares, row(work, layout.CROSS + 18), of_y, y, of_z, z),
        ),
    )


@inline
def put_hypothesis(target, means, own_blocks, cross):
    """Write means and packed covariances of the three axes into a hypothesis."""
    put9(target, layout.MEAN, means[0] + means[1] + means[2])
    put6(target, layout.OWN, own_blocks[0])
    put6(target, layout.OWN + 6, own_blocks[1])
    put6(target, layout.OWN + 12, own_blocks[2])
    put9(target, layout.CROSS, cross[0])
    put9(target, layout.CROSS + 9, cross[1])
    put9(target, layout.CROSS + 18, cross[2])


@kernel_part
def merge(work, listed, count, target):
    """Merge the listed hypotheses by their shares into the hypothesis at the address `target`."""
    means, own_blocks, cross = mix_hypotheses(work, listed, count)
    put_hypothesis(target, means, own_blocks, cross)


@kernel_part
def advance(work, listed, count, target, model, result, plot, noise):
    """Merge the listed hypotheses, predict with the model in row `model`, update with a plot, write to `target`.

    target, plot, noise: addresses of a hypothesis, of the plot (PLOT rows) and of R (6 rows). The rows result and
    result + 1 are set to the normalised innovation squared v' S⁻¹ v and the determinant of S (0, 1 if the plot is
    missed)."""
    F = get(work, model), get(work, model + 1), get(work, model + 2), get(work, model + 3), get(work, model + 4)
    Q, mixture, zero = get6(work, model + layout.MODEL_Q), mix_hypotheses(work, listed, count), full(0.0)
    if any_greater(F[4], zero):
        predict_and_update(work, mixture, F, Q, target, result, plot, noise)
    else:
        # A model without acceleration: with these zeros the compiler leaves out half of the operations.
        F, Q = (F[0], zero, F[2], zero, zero), (Q[0], Q[1], zero, Q[3], zero, zero)
        predict_and_update(work, mixture, F, Q, target, result, plot, noise)


@inline
def predict_and_update(work, mixture, F, Q, target, result, plot, noise):
    """Predict a mixture (means, own blocks, blocks between axes), update it with a plot, write it; see `advance`."""
    predicted = predict(mixture, F, Q)
    x, y, z = predicted[0]
    # i: the diagonal of D⁻¹
    L, i, determinant = kalman_algebra.factorise(innovation_covariance(predicted, get6(noise, 0)))
    detected = get(plot, layout.DETECTED)
    i = i[0] * detected, i[1] * detected, i[2] * detected
    v = whiten(
        (
            get(plot, layout.POSITION) - x[0],
            get(plot, layout.POSITION + 1) - y[0],
            get(plot, layout.POSITION + 2) - z[0],
        ),
        L,
    )
    put(work, result, dot(scale_row(v, i), v))
    put(work, result + 1, where_greater(detected, full(0.5), determinant, full(1.0)))

    wx, wy, wz = whitened_columns(predicted, L)
    gx = scale_row(wx[0], i), scale_row(wx[1], i), scale_row(wx[2], i)
    gy = scale_row(wy[0], i), scale_row(wy[1], i), scale_row(wy[2], i)
    gz = scale_row(wz[0], i), scale_row(wz[1], i), scale_row(wz[2], i)
    means = (
        (x[0] + dot(gx[0], v), x[1] + dot(gx[1], v), x[2] + dot(gx[2], v)),
        (y[0] + dot(gy[0], v), y[1] + dot(gy[1], v), y[2] + dot(gy[2], v)),
        (z[0] + dot(gz[0], v), z[1] + dot(gz[1], v), z[2] + dot(gz[2], v)),
    )
    put_updated(target, predicted, means, (gx, gy, gz), (wx, wy, wz))


@inline
def predict(mixture, F, Q):
    """Predict a mixture (means, own blocks, blocks between axes) with a model."""
    (x, y, z), (xx, yy, zz), (xy, xz, yz) = mixture
    return (
        (predict_state(x, F), predict_state(y, F), predict_state(z, F)),
        (predict_covariance(xx, F, Q), predict_covariance(yy, F, Q), predict_covariance(zz, F, Q)),
        (predict_cross(xy, F), predict_cross(xz, F), predict_cross(yz, F)),
    )


@inline
def innovation_covariance(predicted, R):
    """S = H P H' + R of a predicted hypothesis, packed."""
    _, (xx, yy, zz), (xy, xz, yz) = predicted
    return xx[0] + R[0], xy[0] + R[1], xz[0] + R[2], yy[0] + R[3], yz[0] + R[4], zz[0] + R[5]


@inline
def whitened_columns(predicted, L):
    """The rows of P H' of each axis, whitened: wx, wy, wz."""
    x, y, z = position_rows(predicted)
    return (
        (whiten(x[0], L), whiten(x[1], L), whiten(x[2], L)),
        (whiten(y[0], L), whiten(y[1], L), whiten(y[2], L)),
        (whiten(z[0], L), whiten(z[1], L), whiten(z[2], L)),
    )


@inline
def position_rows(predicted):
    """The rows of P H', which are the columns of P that belong to the three coordinates, of each axis (3 x 3)."""
    _, (xx, yy, zz), (xy, xz, yz) = predicted
    return (
        ((xx[0], xy[0], xz[0]), (xx[1], xy[3], xz[3]), (xx[2], xy[6], xz[6])),
        ((xy[0], yy[0], yz[0]), (xy[1], yy[1], yz[3]), (xy[2], yy[2], yz[6])),
        ((xz[0], yz[0], zz[0]), (xz[1], yz[1], zz[1]), (xz[2], yz[2], zz[2])),
    )


@inline
def put_updated(target, predicted, means, g, w):
    """Write a predicted hypothesis with its updated means, and its covariance less G W'."""
    _, (xx, yy, zz), (xy, xz, yz) = predicted
    (gx, gy, gz), (wx, wy, wz) = g, w
    put_hypothesis(
        target,
        means,
        (shrink_block(xx, gx, wx), shrink_block(yy, gy, wy), shrink_block(zz, gz, wz)),
        (
            kalman_algebra.shrink_cross(xy, gx, wy),
            kalman_algebra.shrink_cross(xz, gx, wz),
            kalman_algebra.shrink_cross(yz, gy, wz),
        ),
    )
