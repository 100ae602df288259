"""Two Kalman filters of one coordinate that interact (IMM: Blom & Bar-Shalom 1988), eight realisations at a time.

Both have the same state and differ in their manoeuvre variance. Means, covariances and times are in nominal σ and
periods; a state is (x, v, a) and its covariance packed (xx, xv, xa, vv, va, aa), as in `blocks`. Rows of the arrays are
of one chunk, as in `sonar_steps`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import address, exponential, full, get, put, root, total, where_greater
from radarsim.kernels.linear import extrapolated
from radarsim.kernels.symmetric import predicted_axis, predicted_own
from radarsim.studies.sonar.kernels.steps import GROUPS, eight, informed, put_six, six

MEAN, COVARIANCE, PROBABILITY, ROWS = 0, 6, 18, 20  # rows of its memory: two means, two covariances, two probabilities


class ModelPairs(NamedTuple):
    """Models of F filters, read of interacting ones alone.

    manoeuvre (F, C, 2) variances in nominal plots and periods; stay (F, 2) the probability that each model lasts from
    scan to scan.
    """

    manoeuvre: np.ndarray
    stay: np.ndarray


@inline
def merged(p, x, P, q, y, Q):
    """Mean and covariance of two states of probabilities p and q, p + q = 1."""
    m0, m1, m2 = p * x[0] + q * y[0], p * x[1] + q * y[1], p * x[2] + q * y[2]
    d0, d1, d2, both = x[0] - y[0], x[1] - y[1], x[2] - y[2], p * q
    return (m0, m1, m2), (
        p * P[0] + q * Q[0] + both * d0 * d0,
        p * P[1] + q * Q[1] + both * d0 * d1,
        p * P[2] + q * Q[2] + both * d0 * d2,
        p * P[3] + q * Q[3] + both * d1 * d1,
        p * P[4] + q * Q[4] + both * d1 * d2,
        p * P[5] + q * Q[5] + both * d2 * d2,
    )


@inline
def manoeuvred(variance, tau, size):
    """Covariance (6) that a random derivative of order `size`, constant over tau, adds."""
    half = 0.5 * tau * tau
    g0, g1, g2 = (half, tau, 0.0) if size == 2 else (tau * half / 3.0, half, tau)
    return (
        variance * g0 * g0,
        variance * g0 * g1,
        variance * g0 * g2,
        variance * g1 * g1,
        variance * g1 * g2,
        variance * g2 * g2,
    )


@inline
def filtered(x, P, tau, added, z, w):
    """Predict and update with a plot of weight w, zero where missed; also its normalised innovation squared and 1 + w
    S."""
    x0, x1, x2 = predicted_axis(x, (tau, 0.5 * tau * tau, 1.0, tau, 1.0))
    P = predicted_own(P, (tau, 0.5 * tau * tau, 1.0, tau, 1.0), added)
    spread = w * P[0] + 1.0
    per, e = w / spread, z - x0
    g0, g1, g2 = per * P[0], per * P[1], per * P[2]
    updated = (P[0] / spread, P[1] / spread, P[2] / spread, P[3] - g1 * P[1], P[4] - g1 * P[2], P[5] - g2 * P[2])
    return (x0 + g0 * e, x1 + g1 * e, x2 + g2 * e), updated, per * e * e, spread


@inline
def either(early, x, y):
    """Three numbers of the first where early (1 or 0), else of the second."""
    half = full(0.5)
    return (
        where_greater(early, half, x[0], y[0]),
        where_greater(early, half, x[1], y[1]),
        where_greater(early, half, x[2], y[2]),
    )


@part
def interact(size, stay, manoeuvre, dt, period, sigma, estimate, y, s, z, weight, before, P):
    """One scan, in place, of estimate (4, CHUNK), y (8, CHUNK), s (>= ROWS, CHUNK); leaves P (6, CHUNK).

    The first `size` plots go into both models by least squares, at the long-run probabilities of their chain.
    """
    ax, ay, at, az = address(estimate), address(y), address(s), address(z)
    aw, ab, ap = address(weight), address(before), address(P)
    tau, per, one, zero, first = dt / period, 1.0 / period, full(1.0), full(0.0), full(size - 0.5)
    calm, moved = manoeuvred(manoeuvre[0], tau, size), manoeuvred(manoeuvre[1], tau, size)
    leave, back = 1.0 - stay[0], 1.0 - stay[1]
    prior = back / (leave + back)
    for i in range(GROUPS):
        w, b, plot = get(aw, i), get(ab, i), get(az, i)
        known, g, start = informed(eight(ay, i), b, w, tau, 0.0, size)
        put_six(ay, i, known)
        put(ay, 6 * GROUPS + i, known[6])
        put(ay, 7 * GROUPS + i, known[7])
        early = where_greater(b, first, zero, one)
        r, v, a = extrapolated(get(ax, i), get(ax, GROUPS + i), get(ax, 2 * GROUPS + i), dt)
        residual = plot - r
        unit = 1.0 / sigma
        r, v, a = r + g[0] * residual, v + per * g[1] * residual, a + per * per * g[2] * residual
        begun = (unit * r, unit * period * v, unit * period * period * a)
        # Mix, predict, update; a model that has lost all probability keeps the other's state.
        p, q = get(at, PROBABILITY * GROUPS + i), get(at, (PROBABILITY + 1) * GROUPS + i)
        x = six(at, MEAN * GROUPS + i)
        x1, x2 = x[:3], x[3:]
        P1, P2 = six(at, COVARIANCE * GROUPS + i), six(at, (COVARIANCE + 6) * GROUPS + i)
        c1, c2 = stay[0] * p + back * q, leave * p + stay[1] * q
        to1, to2 = stay[0] * p / where_greater(c1, zero, c1, one), leave * p / where_greater(c2, zero, c2, one)
        n1, N1 = merged(to1, x1, P1, one - to1, x2, P2)
        n2, N2 = merged(to2, x1, P1, one - to2, x2, P2)
        n1, N1, u1, d1 = filtered(n1, N1, tau, calm, unit * plot, w)
        n2, N2, u2, d2 = filtered(n2, N2, tau, moved, unit * plot, w)
        least = where_greater(u1, u2, u2, u1)
        c1, c2 = c1 * exponential(0.5 * (least - u1)) / root(d1), c2 * exponential(0.5 * (least - u2)) / root(d2)
        p = where_greater(early, zero, full(prior), c1 / where_greater(c1 + c2, zero, c1 + c2, one))
        x1, x2 = either(early, begun, n1), either(early, begun, n2)
        P1 = either(early, start[:3], N1[:3]) + either(early, start[3:], N1[3:])
        P2 = either(early, start[:3], N2[:3]) + either(early, start[3:], N2[3:])
        m, M = merged(p, x1, P1, one - p, x2, P2)
        put(ax, i, where_greater(early, zero, r, sigma * m[0]))
        put(ax, GROUPS + i, where_greater(early, zero, v, sigma * per * m[1]))
        put(ax, 2 * GROUPS + i, where_greater(early, zero, a, sigma * per * per * m[2]))
        put_six(ap, i, M)
        put(at, PROBABILITY * GROUPS + i, p)
        put(at, (PROBABILITY + 1) * GROUPS + i, one - p)
        put_six(at, MEAN * GROUPS + i, x1 + x2)
        put_six(at, COVARIANCE * GROUPS + i, P1)
        put_six(at, (COVARIANCE + 6) * GROUPS + i, P2)


@part
def mode_sums(s, row, memory, used, out):
    """Σp, Σp² of the probability in a row of s (CHUNK wide), and Σ of the plots in row `memory`, none if negative: out
    (3,)."""
    a, au, zero = address(s), address(used), full(0.0)
    s1, s2, s3 = zero, zero, zero
    for i in range(GROUPS):
        u = get(au, i)
        p = u * get(a, row * GROUPS + i)
        s1, s2 = s1 + p, s2 + p * p
        if memory >= 0:
            s3 = s3 + u * get(a, memory * GROUPS + i)
    out[0], out[1], out[2] = total(s1), total(s2), total(s3)
