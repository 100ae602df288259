"""Two interacting Kalman filters of one coordinate (IMM: Blom & Bar-Shalom 1988), eight realisations at a time.

Both have the same state and differ in their manoeuvre variance. Letters as in `sonar.kernels.steps`; for each model

    x, P    (3), (6)   state and covariance, in units of the nominal σ and of the period
    Q       (6)        covariance that a manoeuvre adds
    mu                 probability of the model after this scan's plot
    c                  probability of the model before it (Blom and Bar-Shalom's c bar)
    nis                normalised innovation squared; S: variance of the innovation over that of the plot

and p_ij, the probability of a transition from model i to model j from scan to scan.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import predicted, predicted_covariance
from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import address, exponential, full, get, put, root, total, where_greater
from radarsim.kernels.linear import extrapolated
from radarsim.studies.sonar.kernels.steps import (
    GROUPS,
    eight,
    least_squares,
    put_eight,
    put_six,
    put_three,
    six,
    six_where_greater,
    three_where_greater,
)

# Further rows of the filter's memory: states of both models, covariances of both, probabilities of both.
STATE, COVARIANCE, PROBABILITY, ROWS = 0, 6, 18, 20


class ModelPairs(NamedTuple):
    """The models of F filters; read only for interacting ones.

    manoeuvre (F, C, 2) variances in nominal plots and periods; stay (F, 2) probabilities that each model lasts from
    scan to scan.
    """

    manoeuvre: np.ndarray
    stay: np.ndarray


class ModelPair(NamedTuple):
    """The models of one filter in one coordinate: size of the state, manoeuvre variances q (2,), stay (2,) as above."""

    size: int
    q: np.ndarray
    stay: np.ndarray


@inline
def merged(mu1, x1, P1, mu2, x2, P2):
    """Mean and covariance of a mixture of two states with weights mu1 + mu2 = 1."""
    m0, m1, m2 = mu1 * x1[0] + mu2 * x2[0], mu1 * x1[1] + mu2 * x2[1], mu1 * x1[2] + mu2 * x2[2]
    d0, d1, d2, both = x1[0] - x2[0], x1[1] - x2[1], x1[2] - x2[2], mu1 * mu2
    return (m0, m1, m2), (
        mu1 * P1[0] + mu2 * P2[0] + both * d0 * d0,
        mu1 * P1[1] + mu2 * P2[1] + both * d0 * d1,
        mu1 * P1[2] + mu2 * P2[2] + both * d0 * d2,
        mu1 * P1[3] + mu2 * P2[3] + both * d1 * d1,
        mu1 * P1[4] + mu2 * P2[4] + both * d1 * d2,
        mu1 * P1[5] + mu2 * P2[5] + both * d2 * d2,
    )


@inline
def mixed(c, from_first, first, second):
    """State and covariance of a model before the scan, mixed from (x, P) of both models.

    c is the model's probability and from_first the part of it that comes from the first model. A model without any
    probability takes the state of the second model.
    """
    zero, one = full(0.0), full(1.0)
    mu = from_first / where_greater(c, zero, c, one)
    return merged(mu, first[0], first[1], one - mu, second[0], second[1])


@inline
def manoeuvre_covariance(q, tau, size):
    """Q (6) of a random derivative of order `size` and variance q, constant over tau."""
    half = 0.5 * tau * tau
    g0, g1, g2 = (half, tau, 0.0) if size == 2 else (tau * half / 3.0, half, tau)
    return q * g0 * g0, q * g0 * g1, q * g0 * g2, q * g1 * g1, q * g1 * g2, q * g2 * g2


@inline
def filtered(x, P, tau, Q, z, w):
    """Predict and update with a plot z of weight w, zero where missed: x, P, nis and S = 1 + w H P Hᵀ."""
    F = (tau, 0.5 * tau * tau, 1.0, tau, 1.0)
    r, v, a = predicted(x, F)
    P = predicted_covariance(P, F, Q)
    S = w * P[0] + 1.0
    per, e = w / S, z - r
    k0, k1, k2 = per * P[0], per * P[1], per * P[2]
    P = (P[0] / S, P[1] / S, P[2] / S, P[3] - k1 * P[1], P[4] - k1 * P[2], P[5] - k2 * P[2])
    return (r + k0 * e, v + k1 * e, a + k2 * e), P, per * e * e, S


@inline
def imm_step(first, second, mu, chain, tau, Q, z, w):
    """Mix, predict and update: both models' (x, P), and the probability of the first.

    first, second, mu (2) are the models' (x, P) and probabilities after the previous scan; chain (p11, p12, p21, p22);
    Q (2) of each model; z in units of the nominal σ.
    """
    (mu1, mu2), (p11, p12, p21, p22), one, zero = mu, chain, full(1.0), full(0.0)
    c1, c2 = p11 * mu1 + p21 * mu2, p12 * mu1 + p22 * mu2
    x1, P1 = mixed(c1, p11 * mu1, first, second)
    x2, P2 = mixed(c2, p12 * mu1, first, second)
    x1, P1, nis1, S1 = filtered(x1, P1, tau, Q[0], z, w)
    x2, P2, nis2, S2 = filtered(x2, P2, tau, Q[1], z, w)
    least = where_greater(nis1, nis2, nis2, nis1)
    c1, c2 = c1 * exponential(0.5 * (least - nis1)) / root(S1), c2 * exponential(0.5 * (least - nis2)) / root(S2)
    return (x1, P1), (x2, P2), c1 / where_greater(c1 + c2, zero, c1 + c2, one)


@part
def interact(models, dt, period, sigma, memory, plot, P):
    """Update an IMM with one scan, in place, and write P (6, CHUNK).

    memory: x, Y and further rows STATE, COVARIANCE and PROBABILITY. Both models start by least squares on the first
    `size` plots, with the stationary probabilities of their Markov chain.
    """
    ax, ay, am, ap = address(memory.x), address(memory.Y), address(memory.further), address(P)
    az, aw, an = address(plot.z), address(plot.w), address(plot.n)
    tau, per, unit, one, zero, size = dt / period, 1.0 / period, 1.0 / sigma, full(1.0), full(0.0), models.size
    first_scans, half = full(size - 0.5), full(0.5)
    Q = (manoeuvre_covariance(models.q[0], tau, size), manoeuvre_covariance(models.q[1], tau, size))
    p11, p22 = models.stay[0], models.stay[1]
    p12, p21 = 1.0 - p11, 1.0 - p22
    stationary = full(p21 / (p12 + p21))
    for i in range(GROUPS):
        z, w, n = get(az, i), get(aw, i), get(an, i)
        Y, K, P_start = least_squares(eight(ay, i), n, w, tau, 0.0, size)
        put_eight(ay, i, Y)
        r, v, a = extrapolated(get(ax, i), get(ax, GROUPS + i), get(ax, 2 * GROUPS + i), dt)
        innovation = z - r
        r, v, a = r + K[0] * innovation, v + per * K[1] * innovation, a + per * per * K[2] * innovation
        x_start = (unit * r, unit * period * v, unit * period * period * a)
        x, mu = (
            six(am, STATE * GROUPS + i),
            (get(am, PROBABILITY * GROUPS + i), get(am, (PROBABILITY + 1) * GROUPS + i)),
        )
        first = (x[:3], six(am, COVARIANCE * GROUPS + i))
        second = (x[3:], six(am, (COVARIANCE + 6) * GROUPS + i))
        first, second, mu1 = imm_step(first, second, mu, (p11, p12, p21, p22), tau, Q, unit * z, w)
        early = where_greater(n, first_scans, zero, one)
        mu1 = where_greater(early, zero, stationary, mu1)
        x1, P1 = three_where_greater(early, half, x_start, first[0]), six_where_greater(early, half, P_start, first[1])
        x2, P2 = (
            three_where_greater(early, half, x_start, second[0]),
            six_where_greater(early, half, P_start, second[1]),
        )
        x, P_now = merged(mu1, x1, P1, one - mu1, x2, P2)
        x = (sigma * x[0], sigma * per * x[1], sigma * per * per * x[2])
        put_three(ax, i, three_where_greater(early, zero, (r, v, a), x))
        put_six(ap, i, P_now)
        put(am, PROBABILITY * GROUPS + i, mu1)
        put(am, (PROBABILITY + 1) * GROUPS + i, one - mu1)
        put_six(am, STATE * GROUPS + i, x1 + x2)
        put_six(am, COVARIANCE * GROUPS + i, P1)
        put_six(am, (COVARIANCE + 6) * GROUPS + i, P2)


@part
def mode_sums(further, row, row_plots, used, out):
    """Write Σp and Σp² of the probability in one of a filter's further rows, and Σ of its plots in memory, to out (3,).

    row_plots is the row with the number of plots, negative where there is none.
    """
    a, au, zero = address(further), address(used), full(0.0)
    s1, s2, s3 = zero, zero, zero
    for i in range(GROUPS):
        u = get(au, i)
        p = u * get(a, row * GROUPS + i)
        s1, s2 = s1 + p, s2 + p * p
        if row_plots >= 0:
            s3 = s3 + u * get(a, row_plots * GROUPS + i)
    out[0], out[1], out[2] = total(s1), total(s2), total(s3)
