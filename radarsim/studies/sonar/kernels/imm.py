"""Two interacting Kalman filters of one coordinate (IMM: Blom & Bar-Shalom 1988), eight realisations at a time.

Both have the same state and differ in their manoeuvre variance. Letters as in `sonar.kernels.steps`; for each model

    x, P    (3), (6)   state and covariance, in units of the nominal σ and of the period
    Q       (6)        covariance that a manoeuvre adds
    mu                 probability of the model after this scan's plot
    c                  probability of the model before it (Blom and Bar-Shalom's c bar)
    nis                normalised innovation squared; S: variance of the innovation, 1 where the plot is missed

and p_ij, the probability of a transition from model i to model j from scan to scan.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import (
    add_outer,
    add_scaled,
    constant_acceleration,
    predicted,
    predicted_covariance,
    take_value,
)
from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import (
    address,
    choose3,
    choose6,
    exponential,
    full,
    get,
    get3,
    get6,
    put,
    put3,
    put6,
    root,
    total,
    where_greater,
)
from radarsim.studies.sonar.kernels.steps import (
    GROUPS,
    get_information,
    least_squares,
    manoeuvre_covariance,
    memory_of,
    put_information,
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


@inline
def merged(mu1, x1, P1, mu2, x2, P2):
    """Mean and covariance of a mixture of two states with weights mu1 + mu2 = 1."""
    m = mu1 * x1[0] + mu2 * x2[0], mu1 * x1[1] + mu2 * x2[1], mu1 * x1[2] + mu2 * x2[2]
    d = x1[0] - x2[0], x1[1] - x2[1], x1[2] - x2[2]
    P = (
        mu1 * P1[0] + mu2 * P2[0],
        mu1 * P1[1] + mu2 * P2[1],
        mu1 * P1[2] + mu2 * P2[2],
        mu1 * P1[3] + mu2 * P2[3],
        mu1 * P1[4] + mu2 * P2[4],
        mu1 * P1[5] + mu2 * P2[5],
    )
    return m, add_outer(P, mu1 * mu2, d)


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
def filtered(x, P, tau, Q, z, w):
    """Predict and update with a plot z of weight w, zero where missed: x, P, nis and S."""
    zero, one, F = full(0.0), full(1.0), constant_acceleration(tau)
    x, taken = predicted(x, F), where_greater(w, zero, one, zero)
    P, g, S = take_value(predicted_covariance(P, F, Q), 1.0 / where_greater(w, zero, w, one), taken)
    e = z - x[0]
    return add_scaled(x, e, g), P, taken * e * e / S, where_greater(w, zero, S, one)


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


@inline
def interact(filters, plots, f, c, pairs, size, dt, period, sigma):
    """Update an IMM with one scan, in place; further rows STATE, COVARIANCE and PROBABILITY.

    Both models start by least squares on the first `size` plots, with the stationary probabilities of their Markov
    chain.
    """
    ax, ay, am, ap, az, aw, an = memory_of(filters, plots, f, c)
    tau, per, unit, one, zero = dt / period, 1.0 / period, 1.0 / sigma, full(1.0), full(0.0)
    first_scans, half, F = full(size - 0.5), full(0.5), constant_acceleration(dt)
    q, stay = pairs.manoeuvre[f, c], pairs.stay[f]
    Q = (manoeuvre_covariance(q[0], tau, size), manoeuvre_covariance(q[1], tau, size))
    p11, p22 = stay[0], stay[1]
    p12, p21 = 1.0 - p11, 1.0 - p22
    stationary = full(p21 / (p12 + p21))
    to_first, to_second = PROBABILITY * GROUPS, (PROBABILITY + 1) * GROUPS
    P_first, P_second = COVARIANCE * GROUPS, (COVARIANCE + 6) * GROUPS
    for i in range(GROUPS):
        z, w, n = get(az, i), get(aw, i), get(an, i)
        Y, K, P_start = least_squares(get_information(ay, i), n, w, tau, 0.0, size)
        put_information(ay, i, Y)
        x_now = predicted(get3(ax, i, GROUPS), F)
        x_now = add_scaled(x_now, z - x_now[0], (K[0], per * K[1], per * per * K[2]))
        x_start = (unit * x_now[0], unit * period * x_now[1], unit * period * period * x_now[2])
        x, mu = get6(am, STATE * GROUPS + i, GROUPS), (get(am, to_first + i), get(am, to_second + i))
        first, second = (x[:3], get6(am, P_first + i, GROUPS)), (x[3:], get6(am, P_second + i, GROUPS))
        first, second, mu1 = imm_step(first, second, mu, (p11, p12, p21, p22), tau, Q, unit * z, w)
        early = where_greater(n, first_scans, zero, one)
        mu1 = where_greater(early, zero, stationary, mu1)
        x1, P1 = choose3(early, half, x_start, first[0]), choose6(early, half, P_start, first[1])
        x2, P2 = choose3(early, half, x_start, second[0]), choose6(early, half, P_start, second[1])
        x, P = merged(mu1, x1, P1, one - mu1, x2, P2)
        x = (sigma * x[0], sigma * per * x[1], sigma * per * per * x[2])
        put3(ax, i, choose3(early, zero, x_now, x), GROUPS)
        put6(ap, i, P, GROUPS)
        put(am, to_first + i, mu1)
        put(am, to_second + i, one - mu1)
        put6(am, STATE * GROUPS + i, x1 + x2, GROUPS)
        put6(am, P_first + i, P1, GROUPS)
        put6(am, P_second + i, P2, GROUPS)


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
