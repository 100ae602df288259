"""Tracks of range and bearing, eight at a time: foretelling with the innovation's covariance, and the update.

The state is that of two lines, (r, vr) and (b, vb), each with the recursion of the plain Kalman filter of this study
(`sonar_steps.informed` up to two plots, then `believed`); probabilistic association ties them by a covariance between
them, four numbers which are zero, and change no bit, as long as every plot taken is certain. Plots are taken in one
coordinate after the other, which their independent errors allow. Covariances are in nominal plots and periods.

Rows of the arrays are of one chunk, as in `sonar_steps`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel
from radarsim.kernels.lanes import address, full, get, put, where_greater
from radarsim.kernels.linear import extrapolated
from radarsim.studies.sonar.kernels.steps import CHUNK, GROUPS, believed, eight, informed, put_six, six

NOWHERE = (0.0, 0.0, 0.0)


class Tracks(NamedTuple):
    """A chunk of tracks of one tracker: x (2, 4, CHUNK) estimates, as in `sonar`; y (2, 8, CHUNK) information; P (2, 6,
    CHUNK) covariance of each line; across (4, CHUNK) that between them, (r, vr) by (b, vb); plots (CHUNK,) so far.
    """

    x: np.ndarray
    y: np.ndarray
    P: np.ndarray
    across: np.ndarray
    plots: np.ndarray


def no_tracks() -> Tracks:
    """A chunk without a track."""
    shapes = ((2, 4, CHUNK), (2, 8, CHUNK), (2, 6, CHUNK), (4, CHUNK), (CHUNK,))
    return Tracks(*(aligned_zeros(*shape) for shape in shapes))


@kernel
def forget(tracks, i):
    """Empty the place of track i."""
    tracks.x[:, :, i], tracks.y[:, :, i], tracks.P[:, :, i] = 0.0, 0.0, 0.0
    tracks.across[:, i], tracks.plots[i] = 0.0, 0.0


# ---- one group ----------------------------------------------------------------------------------------------------
@inline
def four(a, i):
    """Four rows of group i."""
    return get(a, i), get(a, GROUPS + i), get(a, 2 * GROUPS + i), get(a, 3 * GROUPS + i)


@inline
def line_foretold(p, before, tau, manoeuvre):
    """Covariance (6) of a line after tau periods: the plain filter's step without a plot."""
    zero = full(0.0)
    s = (p[0], p[1], p[2], p[3], p[4], p[5], zero, zero, zero, zero)
    g = (zero, zero, zero, zero)
    _, _, P = believed(s, g, p, before, zero, tau, 0.0, 2, 2, manoeuvre, NOWHERE)
    return P


@inline
def across_foretold(c, tau):
    """Covariance between the lines (4) after tau periods."""
    top, low = c[0] + tau * c[2], c[1] + tau * c[3]
    return top + tau * low, low, c[2] + tau * c[3], c[3]


@inline
def line_taken(P, y, before, w):
    """Gain (2) and covariance (6) of a line with a plot taken where w is 1; y (8) the information with it."""
    zero = full(0.0)
    _, g, p = y
    s = (P[0], P[1], P[2], P[3], P[4], P[5], zero, zero, zero, zero)
    _, gain, taken = believed(s, g, p, before, w, 0.0, 0.0, 2, 2, 0.0, NOWHERE)
    return gain, taken


@inline
def less(P, g, k):
    """Covariance (6) of a line less g kᵀ, symmetric since g is k scaled."""
    return P[0] - g[0] * k[0], P[1] - g[0] * k[1], P[2], P[3] - g[1] * k[1], P[4], P[5]


@inline
def more(P, K, L, rr, rb, bb):
    """Covariance (6) of a line plus [K L] Σ [K L]ᵀ, K and L its gains (2) for the two innovations."""
    u0, u1 = rr * K[0] + rb * L[0], rr * K[1] + rb * L[1]
    w0, w1 = rb * K[0] + bb * L[0], rb * K[1] + bb * L[1]
    return (
        P[0] + u0 * K[0] + w0 * L[0],
        P[1] + u0 * K[1] + w0 * L[1],
        P[2],
        P[3] + u1 * K[1] + w1 * L[1],
        P[4],
        P[5],
    )


# ---- a chunk ------------------------------------------------------------------------------------------------------
@kernel
def foretell(tracks, dt, period, sigma, manoeuvre, foretold):
    """Positions and innovation covariances after dt into foretold (5, CHUNK): r, b, S (rr, rb, bb); in m and rad."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    ac, an, out, tau = address(tracks.across), address(tracks.plots), address(foretold), dt / period
    rr, rb, bb = sigma[0] * sigma[0], sigma[0] * sigma[1], sigma[1] * sigma[1]
    for i in range(GROUPS):
        n = get(an, i)
        r, _, _ = extrapolated(get(ar, i), get(ar, GROUPS + i), get(ar, 2 * GROUPS + i), dt)
        b, _, _ = extrapolated(get(ab, i), get(ab, GROUPS + i), get(ab, 2 * GROUPS + i), dt)
        P = line_foretold(six(pr, i), n, tau, manoeuvre[0])
        Q = line_foretold(six(pb, i), n, tau, manoeuvre[1])
        c, _, _, _ = across_foretold(four(ac, i), tau)
        put(out, i, r)
        put(out, GROUPS + i, b)
        put(out, 2 * GROUPS + i, rr * (P[0] + 1.0))
        put(out, 3 * GROUPS + i, rb * c)
        put(out, 4 * GROUPS + i, bb * (Q[0] + 1.0))


@kernel
def take(tracks, dt, period, sigma, manoeuvre, joint, taken):
    """One scan of all tracks, in place; taken (6, CHUNK) is what association gave.

    Whether a plot is taken (1 or 0), innovation in range and bearing, and the extra scatter (rr, rb, bb) of one that is
    not certain, in m and rad. joint: there may be such scatter.
    """
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    yr, yb, ac, an, at = (
        *(address(tracks.y[0]), address(tracks.y[1]), address(tracks.across), address(tracks.plots)),
        address(taken),
    )
    tau, per, ratio = dt / period, 1.0 / period, sigma[0] / sigma[1]
    back, one_r, one_b = sigma[1] / sigma[0], 1.0 / sigma[0], 1.0 / sigma[1]
    for i in range(GROUPS):
        n, w = get(an, i), get(at, i)
        nu_r, nu_b = get(at, GROUPS + i), get(at, 2 * GROUPS + i)
        r, vr, _ = extrapolated(get(ar, i), get(ar, GROUPS + i), get(ar, 2 * GROUPS + i), dt)
        b, vb, _ = extrapolated(get(ab, i), get(ab, GROUPS + i), get(ab, 2 * GROUPS + i), dt)
        information_r = informed(eight(yr, i), n, w, tau, 0.0, 2)
        information_b = informed(eight(yb, i), n, w, tau, 0.0, 2)
        P = line_foretold(six(pr, i), n, tau, manoeuvre[0])
        Q = line_foretold(six(pb, i), n, tau, manoeuvre[1])
        if joint:
            c = across_foretold(four(ac, i), tau)
            # The plot in range, then that in bearing: k and h are covariances with the other line's position.
            k = (c[0], c[1])
            scale = w / (P[0] + 1.0)
            g, P = line_taken(P, information_r, n, w)
            kb = (k[0] * scale, k[1] * scale)
            Q = less(Q, kb, k)
            c = (c[0] - g[0] * k[0], c[1] - g[0] * k[1], c[2] - g[1] * k[0], c[3] - g[1] * k[1])
            h = (c[0], c[2])
            scale = w / (Q[0] + 1.0)
            f, Q = line_taken(Q, information_b, n, w)
            hr = (h[0] * scale, h[1] * scale)
            P = less(P, hr, h)
            c = (c[0] - h[0] * f[0], c[1] - h[0] * f[1], c[2] - h[1] * f[0], c[3] - h[1] * f[1])
            nu_b = nu_b - (back * kb[0]) * nu_r
            # Gains for the two innovations at once: (G, B) of the line in range, (A, f) of that in bearing.
            G, A = (g[0] - hr[0] * kb[0], g[1] - hr[1] * kb[0]), (kb[0] - f[0] * kb[0], kb[1] - f[1] * kb[0])
            rr, rb = one_r * one_r * get(at, 3 * GROUPS + i), one_r * one_b * get(at, 4 * GROUPS + i)
            bb = one_b * one_b * get(at, 5 * GROUPS + i)
            P, Q = more(P, G, hr, rr, rb, bb), more(Q, A, f, rr, rb, bb)
            u0, u1 = rr * A[0] + rb * f[0], rr * A[1] + rb * f[1]
            v0, v1 = rb * A[0] + bb * f[0], rb * A[1] + bb * f[1]
            put(ac, i, c[0] + G[0] * u0 + hr[0] * v0)
            put(ac, GROUPS + i, c[1] + G[0] * u1 + hr[0] * v1)
            put(ac, 2 * GROUPS + i, c[2] + G[1] * u0 + hr[1] * v0)
            put(ac, 3 * GROUPS + i, c[3] + G[1] * u1 + hr[1] * v1)
            r, vr = r + (ratio * hr[0]) * nu_b, vr + (per * ratio * hr[1]) * nu_b
            b, vb = b + (back * kb[0]) * nu_r, vb + (per * back * kb[1]) * nu_r
        else:
            g, P = line_taken(P, information_r, n, w)
            f, Q = line_taken(Q, information_b, n, w)
        put(ar, i, r + g[0] * nu_r)
        put(ar, GROUPS + i, vr + per * g[1] * nu_r)
        put(ab, i, b + f[0] * nu_b)
        put(ab, GROUPS + i, vb + per * f[1] * nu_b)
        put_six(pr, i, P)
        put_six(pb, i, Q)
        put_six(yr, i, information_r[0])
        put(yr, 6 * GROUPS + i, information_r[0][6])
        put(yr, 7 * GROUPS + i, information_r[0][7])
        put_six(yb, i, information_b[0])
        put(yb, 6 * GROUPS + i, information_b[0][6])
        put(yb, 7 * GROUPS + i, information_b[0][7])
        put(an, i, n + where_greater(w, full(0.0), full(1.0), full(0.0)))
