"""Manoeuvre detectors (P3 eq. 3) on the last plots of each realisation, and the filters that respond to them.

The statistic of a detector is â²/σ_a²: the squared acceleration of a parabola through the last plots over its variance.
For all coordinates jointly it is the sum. Letters as in `sonar.kernels.steps`, and

    Y x = b    normal equations of a parabola: Y (6), b (3)
    T          statistic, UNTESTED where there was no test
    mode       1 in a manoeuvre, else 0
    quiet      tests without an alarm in a row

recent (3, L, ROW) holds the last L plots of a coordinate: plot, age, weight, the newest first.

Two interacting Kalman filters of one coordinate (IMM: Blom & Bar-Shalom 1988), eight realisations at a time.

Both have the same state and differ in their manoeuvre variance. Letters as in `sonar.kernels.steps`; for each model

    x, P    (3), (6)   state and covariance, in units of the nominal σ and of the period
    Q       (6)        covariance that a manoeuvre adds
    mu                 probability of the model after this scan's plot
    c                  probability of the model before it (Blom and Bar-Shalom's c bar)
    nis                normalised innovation squared; S: variance of the innovation, 1 where the plot is missed

and p_ij, the probability of a transition from model i to model j from scan to scan."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import algebra, lanes
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address, choose3, choose6, full, get, get6, put, put3, put6, total, where_greater
from radarsim.studies.sonar.kernels import steps
from radarsim.studies.sonar.kernels.steps import (
    GROUPS,
    leading_inverse,
    least_squares,
    manoeuvre_covariance,
    memory_addresses,
)

# ---- detector --------------------------------------------------------------------------------------------------------
UNTESTED = -1.0  # the statistic where there was no test: it exceeds no threshold
MODE, QUIET, PLOTS = range(3)  # further rows of an adaptive filter's memory; PLOTS: number of plots that it uses


class Detectors(NamedTuple):
    """D detectors, each for G groups of coordinates: each of C coordinates, then all jointly."""

    plots: np.ndarray  #: (D,) of the parabola
    every: np.ndarray  #: (D,) scans from one test to the next
    threshold: np.ndarray  #: (D, G, T)
    thresholds: np.ndarray  #: (D,) how many of these are used
    phase: np.ndarray  #: (K,) 0 before the manoeuvre, 1 during it, 2 after it


class AdaptiveRules(NamedTuple):
    """How F filters respond to a manoeuvre; read only for adaptive ones."""

    detector: np.ndarray  #: (F,) whose statistic is looked at
    group: np.ndarray  #: (F, C) of its coordinates
    threshold: np.ndarray  #: (F, C) that it is compared with
    raises: np.ndarray  #: (F,) an alarm raises the degree, else it keeps the memory short
    quiet: np.ndarray  #: (F,) tests without an alarm that end the manoeuvre


class Alarms(NamedTuple):
    """Numbers of realisations by scan."""

    tested: np.ndarray  #: (D, G, K)
    alarms: np.ndarray  #: (D, G, T, K)
    #: (D, G, T, K) first event of a phase: alarm before the manoeuvre, alarm during it, test without one after it
    first: np.ndarray


# ---- tests --------------------------------------------------------------------------------------------------------
@inline
def parabola(recent, length, longest, i):
    """The normal equations of a parabola, Y (6) and b (3), relative to the newest plot; and the newest plot.

    Relative to the newest plot the sums lose no digits."""
    newest = get(recent, i)
    Y, b = steps.normal_equations(recent, length, longest, i, newest, 0.5)
    return Y, b, newest


@part
def acceleration_statistic(recent, length, sigma, n, weight, T):
    """Statistic T (CHUNK,) of one coordinate's last `length` plots; UNTESTED where there are fewer, or no new one."""
    a, an, aw, statistic = address(recent), address(n), address(weight), address(T)
    zero, enough, full_rank, untested = full(0.0), full(length - 0.5), full(3.0), full(UNTESTED)
    per = 1.0 / (sigma * sigma)
    for i in range(GROUPS):
        Y, b, _ = parabola(a, length, recent.shape[1], i)
        tested = where_greater(get(aw, i), zero, get(an, i), zero)
        P = leading_inverse(Y, where_greater(tested, enough, full_rank, zero))
        acceleration = P[2] * b[0] + P[4] * b[1] + P[5] * b[2]
        value = per * (acceleration * acceleration) / where_greater(tested, enough, P[5], full(1.0))
        put(statistic, i, where_greater(tested, enough, value, untested))


@part
def joint_statistic(T):
    """The joint statistic, last row of T (C + 1, CHUNK): the sum of all, UNTESTED where any is."""
    a, test_level, untested = address(T), full(0.5 * UNTESTED), full(UNTESTED)
    for i in range(GROUPS):
        value = full(0.0)
        for c in range(T.shape[0] - 1):
            statistic = get(a, c * GROUPS + i)
            value = where_greater(
                statistic, test_level, where_greater(value, test_level, value + statistic, untested), untested
            )
        put(a, (T.shape[0] - 1) * GROUPS + i, value)


@kernel
def detector_statistics(detectors, k, recent, sigma, n, weight, T):
    """Statistics T (D, G, CHUNK) of all detectors at scan k; recent (C, 3, L, ROW), n and weight (C, CHUNK)."""
    for d in range(detectors.plots.size):
        if (k + 1 - detectors.plots[d]) % detectors.every[d] != 0:
            T[d] = UNTESTED
            continue
        for c in range(recent.shape[0]):
            acceleration_statistic(recent[c], detectors.plots[d], sigma[c], n[c], weight[c], T[d, c])
        joint_statistic(T[d])


@part
def count_alarms(T, threshold, ended, used, passed):
    """Numbers of alarms and of first events of a phase in a chunk; passed (CHUNK,) is 1 after the first event."""
    statistic, au, ap, zero = address(T), address(used), address(passed), full(0.0)
    level, test_level, alarms, first = full(threshold), full(0.5 * UNTESTED), zero, zero
    for i in range(GROUPS):
        value, u, passed_before = get(statistic, i), get(au, i), get(ap, i)
        alarm = where_greater(value, level, u, zero)
        event = where_greater(value, test_level, u - alarm, zero) if ended else alarm
        new = where_greater(event, passed_before, event, zero)
        put(ap, i, passed_before + new)
        alarms, first = alarms + alarm, first + new
    return total(alarms), total(first)


@part
def count_tests(T, used):
    """The number of realisations of a chunk that were tested."""
    statistic, au, zero, test_level = address(T), address(used), full(0.0), full(0.5 * UNTESTED)
    tested = zero
    for i in range(GROUPS):
        tested = tested + where_greater(get(statistic, i), test_level, get(au, i), zero)
    return total(tested)


@part
def add_alarms(detectors, k, T, used, passed, sums):
    """Add the tests of scan k with statistics T (D, G, CHUNK); passed (D, G, thresholds, CHUNK)."""
    phase = detectors.phase[k]
    if k > 0 and phase != detectors.phase[k - 1]:
        passed[:] = 0.0
    for d in range(detectors.plots.size):
        for g in range(T.shape[1]):
            sums.tested[d, g, k] += count_tests(T[d, g], used)
            for j in range(detectors.thresholds[d]):
                alarms, first = count_alarms(T[d, g], detectors.threshold[d, g, j], phase == 2, used, passed[d, g, j])
                sums.alarms[d, g, j, k] += alarms
                sums.first[d, g, j, k] += first


# ---- the adaptive filter ------------------------------------------------------------------------------------------
@inline
def next_mode(T, threshold, mode, quiet, patience):
    """Mode and number of successive quiet tests after a statistic T."""
    zeros, ones = full(0.0), full(1.0)
    quiet = where_greater(T, full(0.5 * UNTESTED), quiet + ones, quiet)
    quiet = where_greater(T, threshold, zeros, quiet)
    mode = where_greater(quiet, patience - 0.5, zeros, mode)
    return where_greater(T, threshold, ones, mode), quiet


@inline
def update_adaptive(filters, plots, f, c, rules, size, length, dt, period):
    """Update an adaptive filter with one scan, in place; its rows are MODE, QUIET, PLOTS.

    It is growing memory of degree size - 1, restarted with the last `length` plots at every change of mode. An alarm
    sets the mode, and `quiet` successive tests without an alarm reset it; see AdaptiveRules."""
    ax, ay, am, ap, az, aw, an = memory_addresses(filters, plots, f, c)
    T, recent, raises = plots.T[rules.detector[f], rules.group[f, c]], plots.recent[c], rules.raises[f]
    statistic, ar, longest = address(T), address(recent), recent.shape[1]
    zeros, ones, half, threshold = full(0.0), full(1.0), full(0.5), full(rules.threshold[f, c])
    tau, per, twice, F = dt / period, 1.0 / period, 1.0 / (period * period), algebra.constant_acceleration(dt)
    full_rank, short, patience = full(float(size)), full(float(length)), full(float(rules.quiet[f]))
    raised_rank = full(3.0) if raises else full_rank
    for i in range(GROUPS):
        w, mode = get(aw, i), get(am, i)
        detected = where_greater(w, zeros, ones, zeros)
        Y = algebra.predicted_information(get6(ay, i, GROUPS), tau)
        Y = (Y[0] + w, Y[1], Y[2], Y[3], Y[4], Y[5])
        current_rank, rank = where_greater(mode, half, raised_rank, full_rank), get(an, i) + detected
        P = leading_inverse(Y, where_greater(rank, current_rank, current_rank, rank))
        x = algebra.predicted(lanes.get3(ax, i, GROUPS), F)
        x = algebra.add_scaled(x, w * (get(az, i) - x[0]), (P[0], per * P[1], twice * P[2]))
        mode_now, quiet = next_mode(get(statistic, i), threshold, mode, get(am, QUIET * GROUPS + i), patience)
        plots_kept = get(am, PLOTS * GROUPS + i) + detected
        restarted = (mode_now - mode) * (mode_now - mode) + (zeros if raises else mode_now)
        if lanes.any_greater(restarted, half):
            Y_recent, b, newest = parabola(ar, length, longest, i)
            P_recent = leading_inverse(Y_recent, where_greater(mode_now, half, raised_rank, full_rank))
            r, v, a = algebra.times(P_recent, b)
            x = choose3(restarted, half, (newest + r, per * v, twice * a), x)
            plots_kept = where_greater(restarted, half, short, plots_kept)
            P = choose6(restarted, half, P_recent, P)
            Y = choose6(restarted, half, Y_recent, Y)
        put6(ay, i, Y, GROUPS)
        put6(ap, i, P, GROUPS)
        put3(ax, i, x, GROUPS)
        put3(am, i, (mode_now, quiet, plots_kept), GROUPS)


# ---- imm -------------------------------------------------------------------------------------------------------------
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
    return m, algebra.add_outer(P, mu1 * mu2, d)


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
    zeros, ones, F = full(0.0), full(1.0), algebra.constant_acceleration(tau)
    x, detected = algebra.predicted(x, F), where_greater(w, zeros, ones, zeros)
    P, g, S = algebra.take_value(
        algebra.predicted_covariance(P, F, Q), 1.0 / where_greater(w, zeros, w, ones), detected
    )
    e = z - x[0]
    return algebra.add_scaled(x, e, g), P, detected * e * e / S, where_greater(w, zeros, S, ones)


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
    c1 = c1 * lanes.exponential(0.5 * (min_nis - nis1)) / lanes.root(S1)
    c2 = c2 * lanes.exponential(0.5 * (min_nis - nis2)) / lanes.root(S2)
    return (x1, P1), (x2, P2), c1 / where_greater(c1 + c2, zeros, c1 + c2, ones)


@inline
def update_imm(filters, plots, f, c, pairs, size, dt, period, sigma):
    """Update an IMM with one scan, in place; its rows are STATE, COVARIANCE and PROBABILITY.

    Both models start by least squares on the first `size` plots, with the stationary probabilities of their Markov
    chain."""
    ax, ay, am, ap, az, aw, an = memory_addresses(filters, plots, f, c)
    tau, per, unit, ones, zeros = dt / period, 1.0 / period, 1.0 / sigma, full(1.0), full(0.0)
    first_scans, half, F = full(size - 0.5), full(0.5), algebra.constant_acceleration(dt)
    q, stay = pairs.manoeuvre[f, c], pairs.stay[f]
    Q = (manoeuvre_covariance(q[0], tau, size), manoeuvre_covariance(q[1], tau, size))
    p11, p22 = stay[0], stay[1]
    p12, p21 = 1.0 - p11, 1.0 - p22
    stationary = full(p21 / (p12 + p21))
    to_first, to_second = PROBABILITY * GROUPS, (PROBABILITY + 1) * GROUPS
    P_first, P_second = COVARIANCE * GROUPS, (COVARIANCE + 6) * GROUPS
    for i in range(GROUPS):
        z, w, n = get(az, i), get(aw, i), get(an, i)
        Y, K, P_start = least_squares(steps.get_information(ay, i), n, w, tau, 0.0, size)
        steps.put_information(ay, i, Y)
        x_now = algebra.predicted(lanes.get3(ax, i, GROUPS), F)
        x_now = algebra.add_scaled(x_now, z - x_now[0], (K[0], per * K[1], per * per * K[2]))
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


@part
def mode_sums(kind_rows, row, row_plots, used, out):
    """Write Σp and Σp² of the probability in one of kind_rows, and Σ of the filter's plots in memory, to out (3,).

    row_plots is the row with the number of plots, negative where there is none."""
    a, au, zero = address(kind_rows), address(used), full(0.0)
    s1, s2, s3 = zero, zero, zero
    for i in range(GROUPS):
        u = get(au, i)
        p = u * get(a, row * GROUPS + i)
        s1, s2 = s1 + p, s2 + p * p
        if row_plots >= 0:
            s3 = s3 + u * get(a, row_plots * GROUPS + i)
    out[0], out[1], out[2] = total(s1), total(s2), total(s3)
