"""Tracks of range and bearing, eight at a time: prediction with the innovation's covariance, and the update.

The state is that of two lines, (r, vr) and (b, vb), each with the recursion of a plain Kalman filter (after
`steps.least_squares` up to two plots). Probabilistic association causes a covariance between
them: four numbers, which are exactly zero as long as every plot taken is certain. The coordinates of a plot are
processed one after the other, which is possible because their errors are independent. Letters as in
`sonar.kernels.steps`, and

    P_r, P_b    (6)   covariances of the two lines; their third component is zero
    C           (4)   covariance between them, (r, vr) by (b, vb), packed by rows
    nu_r, nu_b        innovations in range and bearing, in m and rad
    S           (3)   covariance of the innovations: rr, rb, bb
    V           (3)   additional covariance of innovations that may not be the target's: rr, rb, bb
    K_rb        (2)   gain of the line in range for the innovation in bearing; likewise K_rr, K_br, K_bb
    n, w              plots of a track before this scan; 1 where it takes a plot, else 0

P, C and K are in nominal plots and periods. Arrays contain a chunk, as in `steps`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import add_outer, constant_acceleration, predicted, predicted_covariance, take_value
from radarsim.kernels.compile import aligned_zeros, inline, kernel
from radarsim.kernels.lanes import (
    address,
    choose3,
    choose6,
    full,
    get,
    get3,
    get4,
    get6,
    put,
    put4,
    put6,
    where_greater,
)
from radarsim.studies.sonar.kernels.steps import (
    CHUNK,
    GROUPS,
    get_information,
    least_squares,
    manoeuvre_covariance,
    put_information,
)

STARTED = 2.0  # plots from which a line is no longer least squares


class Tracks(NamedTuple):
    """A chunk of tracks of one tracker; lines in range and in bearing.

    x (2, 4, CHUNK) states, Y (2, 8, CHUNK) information and P (2, 6, CHUNK) covariance of each line, as in `steps`; C
    (4, CHUNK) covariance between the lines; plots (CHUNK,) so far.
    """

    x: np.ndarray
    Y: np.ndarray
    P: np.ndarray
    C: np.ndarray
    plots: np.ndarray


def no_tracks() -> Tracks:
    """A chunk without a track."""
    shapes = ((2, 4, CHUNK), (2, 8, CHUNK), (2, 6, CHUNK), (4, CHUNK), (CHUNK,))
    return Tracks(*(aligned_zeros(*shape) for shape in shapes))


@kernel
def clear(tracks, i):
    """Clear the place of track i."""
    tracks.x[:, :, i], tracks.Y[:, :, i], tracks.P[:, :, i] = 0.0, 0.0, 0.0
    tracks.C[:, i], tracks.plots[i] = 0.0, 0.0


# ---- prediction ---------------------------------------------------------------------------------------------------
@inline
def predicted_line(P, n, tau, q):
    """Covariance (6) of a line after tau periods."""
    moved = predicted_covariance(P, constant_acceleration(tau), manoeuvre_covariance(q, tau, 2))
    return choose6(full(STARTED), n, P, moved)


@inline
def predicted_between(C, tau):
    """F C Fᵀ of the covariance between the lines, after tau periods."""
    top, low = C[0] + tau * C[2], C[1] + tau * C[3]
    return top + tau * low, low, C[2] + tau * C[3], C[3]


@kernel
def predict(tracks, dt, period, sigma, manoeuvre, forecast):
    """Write positions and innovation covariances after dt to forecast (5, CHUNK): r, b, S (rr, rb, bb); in m, rad.

    sigma (2,) of a nominal plot; manoeuvre (2,) variances q of the lines.
    """
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    ac, an, out, tau = address(tracks.C), address(tracks.plots), address(forecast), dt / period
    rr, rb, bb, F = sigma[0] * sigma[0], sigma[0] * sigma[1], sigma[1] * sigma[1], constant_acceleration(dt)
    for i in range(GROUPS):
        n, (r, _, _), (b, _, _) = get(an, i), predicted(get3(ar, i, GROUPS), F), predicted(get3(ab, i, GROUPS), F)
        P_r = predicted_line(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predicted_line(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        C, _, _, _ = predicted_between(get4(ac, i, GROUPS), tau)
        put(out, i, r)
        put(out, GROUPS + i, b)
        put(out, 2 * GROUPS + i, rr * (P_r[0] + 1.0))
        put(out, 3 * GROUPS + i, rb * C)
        put(out, 4 * GROUPS + i, bb * (P_b[0] + 1.0))


# ---- update -------------------------------------------------------------------------------------------------------
@inline
def updated_line(P, start, n, w):
    """Gain K (3) and covariance P (6) of a line after a plot; start (K, P) are those of least squares."""
    P, K, _ = take_value(P, 1.0, w)
    first = full(STARTED)
    return choose3(first, n, start[0][:3], K), choose6(first, n, start[1], P)


@inline
def transposed(C):
    """Cᵀ: the covariance between the lines in the other order."""
    return C[0], C[2], C[1], C[3]


@inline
def updated_pair(P, P_other, C, start, n, w):
    """Both lines after a plot of one: gains K and K_other (2), covariances P and P_other (6), and C (4) between them.

    P is of the line that has the plot, start (K, P) its least squares; C is that line by the other.
    """
    h = (C[0], C[1])  # covariance of the measured value with the other line
    scale = w / (P[0] + 1.0)
    K, P = updated_line(P, start, n, w)
    K_other = (h[0] * scale, h[1] * scale)
    P_other = add_outer(P_other, full(0.0) - scale, (h[0], h[1], 0.0))
    C = (C[0] - K[0] * h[0], C[1] - K[0] * h[1], C[2] - K[1] * h[0], C[3] - K[1] * h[1])
    return K, K_other, P, P_other, C


@inline
def with_scatter(P, K, L, V):
    """P (6) of a line plus [K L] V [K L]ᵀ, K and L its gains (2) for the two innovations."""
    u0, u1 = V[0] * K[0] + V[1] * L[0], V[0] * K[1] + V[1] * L[1]
    v0, v1 = V[1] * K[0] + V[2] * L[0], V[1] * K[1] + V[2] * L[1]
    xx, xv, vv = P[0] + u0 * K[0] + v0 * L[0], P[1] + u0 * K[1] + v0 * L[1], P[3] + u1 * K[1] + v1 * L[1]
    return xx, xv, P[2], vv, P[4], P[5]


@inline
def between_with_scatter(C, K_r, K_b, V):
    """C (4) plus [K_rr K_rb] V [K_br K_bb]ᵀ; K_r and K_b are these pairs of gains."""
    (K_rr, K_rb), (K_br, K_bb) = K_r, K_b
    u0, u1 = V[0] * K_br[0] + V[1] * K_bb[0], V[0] * K_br[1] + V[1] * K_bb[1]
    v0, v1 = V[1] * K_br[0] + V[2] * K_bb[0], V[1] * K_br[1] + V[2] * K_bb[1]
    return (
        C[0] + K_rr[0] * u0 + K_rb[0] * v0,
        C[1] + K_rr[0] * u1 + K_rb[0] * v1,
        C[2] + K_rr[1] * u0 + K_rb[1] * v0,
        C[3] + K_rr[1] * u1 + K_rb[1] * v1,
    )


@inline
def jointly_updated(P, C, starts, n, w, V):
    """Both lines after a plot that may not be the target's: gains (K_rr, K_br, K_rb, K_bb), P (P_r, P_b), and C.

    The range of the plot is processed first, then its bearing: K_rb and K_bb are gains for the part of the innovation
    in bearing that the innovation in range does not explain. starts are the least squares (K, P) of both lines.
    """
    K_rr, K_br, P_r, P_b, C = updated_pair(P[0], P[1], C, starts[0], n, w)
    K_bb, K_rb, P_b, P_r, C = updated_pair(P_b, P_r, transposed(C), starts[1], n, w)
    # Gains for the two innovations, both processed at once.
    K_r = ((K_rr[0] - K_rb[0] * K_br[0], K_rr[1] - K_rb[1] * K_br[0]), K_rb)
    K_b = ((K_br[0] - K_bb[0] * K_br[0], K_br[1] - K_bb[1] * K_br[0]), K_bb)
    P_r, P_b = with_scatter(P_r, K_r[0], K_r[1], V), with_scatter(P_b, K_b[0], K_b[1], V)
    return (K_rr, K_br, K_rb, K_bb), (P_r, P_b), between_with_scatter(transposed(C), K_r, K_b, V)


@kernel
def update(tracks, dt, period, sigma, manoeuvre, joint, association):
    """Update all tracks with one scan, in place; association (6, CHUNK) is what `tracker.associate` writes.

    Its rows: 1 if a plot is taken, else 0; innovations in range and bearing; V (rr, rb, bb), in m and rad. joint: V may
    differ from zero.
    """
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    yr, yb, ac, an = address(tracks.Y[0]), address(tracks.Y[1]), address(tracks.C), address(tracks.plots)
    at, tau, per, F = address(association), dt / period, 1.0 / period, constant_acceleration(dt)
    r_per_b, b_per_r, per_r, per_b = sigma[0] / sigma[1], sigma[1] / sigma[0], 1.0 / sigma[0], 1.0 / sigma[1]
    for i in range(GROUPS):
        n, w, nu_r, nu_b = get(an, i), get(at, i), get(at, GROUPS + i), get(at, 2 * GROUPS + i)
        (r, vr, _), (b, vb, _) = predicted(get3(ar, i, GROUPS), F), predicted(get3(ab, i, GROUPS), F)
        Y_r, K_start_r, P_start_r = least_squares(get_information(yr, i), n, w, tau, 0.0, 2)
        Y_b, K_start_b, P_start_b = least_squares(get_information(yb, i), n, w, tau, 0.0, 2)
        P_r = predicted_line(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predicted_line(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        if joint:
            rr, rb = per_r * per_r * get(at, 3 * GROUPS + i), per_r * per_b * get(at, 4 * GROUPS + i)
            V = (rr, rb, per_b * per_b * get(at, 5 * GROUPS + i))
            starts = ((K_start_r, P_start_r), (K_start_b, P_start_b))
            C = predicted_between(get4(ac, i, GROUPS), tau)
            K, (P_r, P_b), C = jointly_updated((P_r, P_b), C, starts, n, w, V)
            K_rr, K_br, K_rb, K_bb = K
            put4(ac, i, C, GROUPS)
            nu_b = nu_b - (b_per_r * K_br[0]) * nu_r
            r, vr = r + (r_per_b * K_rb[0]) * nu_b, vr + (per * r_per_b * K_rb[1]) * nu_b
            b, vb = b + (b_per_r * K_br[0]) * nu_r, vb + (per * b_per_r * K_br[1]) * nu_r
        else:
            K_rr, P_r = updated_line(P_r, (K_start_r, P_start_r), n, w)
            K_bb, P_b = updated_line(P_b, (K_start_b, P_start_b), n, w)
        put(ar, i, r + K_rr[0] * nu_r)
        put(ar, GROUPS + i, vr + per * K_rr[1] * nu_r)
        put(ab, i, b + K_bb[0] * nu_b)
        put(ab, GROUPS + i, vb + per * K_bb[1] * nu_b)
        put6(pr, i, P_r, GROUPS)
        put6(pb, i, P_b, GROUPS)
        put_information(yr, i, Y_r)
        put_information(yb, i, Y_b)
        put(an, i, n + where_greater(w, full(0.0), full(1.0), full(0.0)))
