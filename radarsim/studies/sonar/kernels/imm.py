"""Two interacting Kalman filters of one coordinate (IMM: Blom & Bar-Shalom 1988), eight realisations at a time.

Both have the same state and differ in their manoeuvre variance. Letters as in `sonar.kernels.steps`; for each model

    x, P    (3), (6)   state and covariance, in units of the nominal σ and of the period
    Q       (6)        covariance that a manoeuvre adds
    mu                 probability of the model after this scan's plot
    c                  probability of the model before it (Blom and Bar-Shalom's c bar)
    nis                normalised innovation squared; S: variance of the innovation, 1 where the plot is missed

and p_ij, the probability of a transition from model i to model j from scan to scan."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra, lane_matrices, lanes
from radarsim.kernels.compiler import inline
from radarsim.kernels.gap_noise import manoeuvre_noise
from radarsim.kernels.lane_matrices import choose3, choose6, get6, put3, put6
from radarsim.kernels.lanes import full, get, put, where_greater
from radarsim.studies.sonar.kernels import steps
from radarsim.studies.sonar.kernels.chunks import GROUPS
from radarsim.studies.sonar.kernels.least_squares import least_squares
from radarsim.studies.sonar.kernels.steps import memory_addresses

# Further rows of the filter's memory: states of both models, covariances of both, probabilities of both.
STATE, COVARIANCE, PROBABILITY, ROWS = 0, 6, 18, 20


class ModelPairs(NamedTuple):
    """The models of F filters; read only for interacting ones."""

    manoeuvre: np.ndarray  #: (F, C, 2) variances in nominal plots and periods
    stay: np.ndarray  #: (F, 2) probabilities that each model lasts from scan to scan


@inline
def merge_states(mu1, x1, P1, mu2, x2, P2):
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
    return m, kalman_algebra.add_outer(P, mu1 * mu2, d)


@inline
def mix_states(c, from_first, first, second):
    """State and covariance of a model before the scan, mixed from (x, P) of both models.

    c is the model's probability and from_first the part of it that comes from the first model. A model without any
    probability takes the state of the second model."""
    zeros, ones = full(0.0), full(1.0)
    mu = from_first / where_greater(c, zeros, c, ones)
    return merge_states(mu, first[0], first[1], ones - mu, second[0], second[1])


@inline
def update_model(x, P, tau, Q, z, w):
    """Predict and update with a plot z of weight w, zero where missed: x, P, nis and S."""
    zeros, ones, F = full(0.0), full(1.0), kalman_algebra.constant_acceleration(tau)
    x, detected = kalman_algebra.predict_state(x, F), where_greater(w, zeros, ones, zeros)
    P, g, S = kalman_algebra.take_value(
        kalman_algebra.predict_covariance(P, F, Q), 1.0 / where_greater(w, zeros, w, ones), detected
    )
    e = z - x[0]
    return kalman_algebra.add_scaled(x, e, g), P, detected * e * e / S, where_greater(w, zeros, S, ones)


@inline
def imm_step(first, second, mu, chain, tau, Q, z, w):
    """Mix, predict and update: both models' (x, P), and the probability of the first.

    first, second, mu (2) are the models' (x, P) and probabilities after the previous scan; chain (p11, p12, p21, p22);
    Q (2) of each model; z in units of the nominal σ."""
    (mu1, mu2), (p11, p12, p21, p22), ones, zeros = mu, chain, full(1.0), full(0.0)
    c1, c2 = p11 * mu1 + p21 * mu2, p12 * mu1 + p22 * mu2
    x1, P1 = mix_states(c1, p11 * mu1, first, second)
    x2, P2 = mix_states(c2, p12 * mu1, first, second)
    x1, P1, nis1, S1 = update_model(x1, P1, tau, Q[0], z, w)
    x2, P2, nis2, S2 = update_model(x2, P2, tau, Q[1], z, w)
    min_nis = where_greater(nis1, nis2, nis2, nis1)
    c1 = c1 * lanes.exponential(0.5 * (min_nis - nis1)) / lanes.square_root(S1)
    c2 = c2 * lanes.exponential(0.5 * (min_nis - nis2)) / lanes.square_root(S2)
    return (x1, P1), (x2, P2), c1 / where_greater(c1 + c2, zeros, c1 + c2, ones)


@inline
def update_imm(filters, plots, f, c, pairs, size, dt, period, sigma):
    """Update an IMM with one scan, in place; its rows are STATE, COVARIANCE and PROBABILITY.

    Both models start by least squares on the first `size` plots, with the stationary probabilities of their Markov
    chain."""
    ax, ay, am, ap, az, aw, an = memory_addresses(filters, plots, f, c)
    tau, per, unit, ones, zeros = dt / period, 1.0 / period, 1.0 / sigma, full(1.0), full(0.0)
    first_scans, half, F = full(size - 0.5), full(0.5), kalman_algebra.constant_acceleration(dt)
    q, stay = pairs.manoeuvre[f, c], pairs.stay[f]
    Q = (manoeuvre_noise(q[0], tau, 1.0, size), manoeuvre_noise(q[1], tau, 1.0, size))
    p11, p22 = stay[0], stay[1]
    p12, p21 = 1.0 - p11, 1.0 - p22
    stationary = full(p21 / (p12 + p21))
    to_first, to_second = PROBABILITY * GROUPS, (PROBABILITY + 1) * GROUPS
    P_first, P_second = COVARIANCE * GROUPS, (COVARIANCE + 6) * GROUPS
    for i in range(GROUPS):
        z, w, n = get(az, i), get(aw, i), get(an, i)
        Y, K, P_start = least_squares(steps.get_information(ay, i), n, w, tau, 0.0, size)
        steps.put_information(ay, i, Y)
        x_now = kalman_algebra.predict_state(lane_matrices.get3(ax, i, GROUPS), F)
        x_now = kalman_algebra.add_scaled(x_now, z - x_now[0], (K[0], per * K[1], per * per * K[2]))
        x_start = (unit * x_now[0], unit * period * x_now[1], unit * period * period * x_now[2])
        x, mu = get6(am, STATE * GROUPS + i, GROUPS), (get(am, to_first + i), get(am, to_second + i))
        first, second = (x[:3], get6(am, P_first + i, GROUPS)), (x[3:], get6(am, P_second + i, GROUPS))
        first, second, mu1 = imm_step(first, second, mu, (p11, p12, p21, p22), tau, Q, unit * z, w)
        early = where_greater(n, first_scans, zeros, ones)
        mu1 = where_greater(early, zeros, stationary, mu1)
        x1, P1 = choose3(early, half, x_start, first[0]), choose6(early, half, P_start, first[1])
        x2, P2 = choose3(early, half, x_start, second[0]), choose6(early, half, P_start, second[1])
        x, P = merge_states(mu1, x1, P1, ones - mu1, x2, P2)
        x = (sigma * x[0], sigma * per * x[1], sigma * per * per * x[2])
        put3(ax, i, choose3(early, zeros, x_now, x), GROUPS)
        put6(ap, i, P, GROUPS)
        put(am, to_first + i, mu1)
        put(am, to_second + i, ones - mu1)
        put6(am, STATE * GROUPS + i, x1 + x2, GROUPS)
        put6(am, P_first + i, P1, GROUPS)
        put6(am, P_second + i, P2, GROUPS)
