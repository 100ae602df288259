"""Manoeuvre detectors (P3 eq. 3) on the last plots of each realisation, and the filters that respond to them.

The statistic of a detector is â²/σ_a²: the squared acceleration of a parabola through the last plots over its variance.
For all coordinates jointly it is the sum. Letters as in `sonar.kernels.steps`, and

    Y x = b    normal equations of a parabola: Y (6), b (3)
    T          statistic, UNTESTED where there was no test
    mode       1 in a manoeuvre, else 0
    quiet      tests without an alarm in a row

recent (3, L, ROW) holds the last L plots of a coordinate: plot, age, weight, the newest first.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import add_scaled, constant_acceleration, predicted, predicted_information, times
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import (
    address,
    any_greater,
    choose3,
    choose6,
    full,
    get,
    get3,
    get6,
    put,
    put3,
    put6,
    total,
    where_greater,
)
from radarsim.studies.sonar.kernels.steps import GROUPS, leading_inverse, memory_of, normal_equations

UNTESTED = -1.0  # the statistic where there was no test: it exceeds no threshold
MODE, QUIET, PLOTS = range(3)  # further rows of an adaptive filter's memory; PLOTS: number of plots that it uses


class Detectors(NamedTuple):
    """D detectors, each for G groups of coordinates: each of C coordinates, then all jointly.

    plots (D,) of the parabola, every (D,) scans from one test to the next; threshold (D, G, T), of which the first
    thresholds (D,) are used; phase (K,) is 0 before the manoeuvre, 1 during it, 2 after it.
    """

    plots: np.ndarray
    every: np.ndarray
    threshold: np.ndarray
    thresholds: np.ndarray
    phase: np.ndarray


class AdaptiveRules(NamedTuple):
    """How F filters respond to a manoeuvre; read only for adaptive ones.

    detector (F,) and group (F, C) whose statistic is compared with threshold (F, C); raises (F,): an alarm raises the
    degree, else it keeps the memory short; quiet (F,) tests without an alarm end the manoeuvre.
    """

    detector: np.ndarray
    group: np.ndarray
    threshold: np.ndarray
    raises: np.ndarray
    quiet: np.ndarray


class Alarms(NamedTuple):
    """Numbers of realisations by scan: tested (D, G, K), with an alarm (D, G, T, K), with the first event (D, G, T, K).

    The first event of a phase is the first alarm before the manoeuvre, the first alarm during it, and after it the
    first test without an alarm.
    """

    tested: np.ndarray
    alarms: np.ndarray
    first: np.ndarray


# ---- tests --------------------------------------------------------------------------------------------------------
@inline
def parabola(recent, length, longest, i):
    """Normal equations of a parabola: Y (6), b (3) relative to the newest plot, and the newest plot.

    Without the newest plot's value the sums lose no digits.
    """
    newest = get(recent, i)
    Y, b = normal_equations(recent, length, longest, i, newest, 0.5)
    return Y, b, newest


@part
def curvature(recent, length, sigma, n, weight, T):
    """Statistic T (CHUNK,) of one coordinate's last `length` plots; UNTESTED where there are fewer, or no new one."""
    a, an, aw, at = address(recent), address(n), address(weight), address(T)
    zero, enough, most, none = full(0.0), full(length - 0.5), full(3.0), full(UNTESTED)
    per = 1.0 / (sigma * sigma)
    for i in range(GROUPS):
        Y, b, _ = parabola(a, length, recent.shape[1], i)
        tested = where_greater(get(aw, i), zero, get(an, i), zero)
        P = leading_inverse(Y, where_greater(tested, enough, most, zero))
        acceleration = P[2] * b[0] + P[4] * b[1] + P[5] * b[2]
        value = per * (acceleration * acceleration) / where_greater(tested, enough, P[5], full(1.0))
        put(at, i, where_greater(tested, enough, value, none))


@part
def joint_statistic(T):
    """The joint statistic, last row of T (C + 1, CHUNK): the sum of all, UNTESTED where any is."""
    a, least, none = address(T), full(0.5 * UNTESTED), full(UNTESTED)
    for i in range(GROUPS):
        value = full(0.0)
        for c in range(T.shape[0] - 1):
            one = get(a, c * GROUPS + i)
            value = where_greater(one, least, where_greater(value, least, value + one, none), none)
        put(a, (T.shape[0] - 1) * GROUPS + i, value)


@kernel
def detector_statistics(detectors, k, recent, sigma, n, weight, T):
    """Statistics T (D, G, CHUNK) of all detectors at scan k; recent (C, 3, L, ROW), n and weight (C, CHUNK)."""
    for d in range(detectors.plots.size):
        if (k + 1 - detectors.plots[d]) % detectors.every[d] != 0:
            T[d] = UNTESTED
            continue
        for c in range(recent.shape[0]):
            curvature(recent[c], detectors.plots[d], sigma[c], n[c], weight[c], T[d, c])
        joint_statistic(T[d])


@part
def count_alarms(T, threshold, ended, used, passed):
    """Numbers of alarms and of first events of a phase in a chunk; passed (CHUNK,) is 1 after the first event."""
    at, au, ap, zero = address(T), address(used), address(passed), full(0.0)
    level, least, alarms, first = full(threshold), full(0.5 * UNTESTED), zero, zero
    for i in range(GROUPS):
        value, u, before = get(at, i), get(au, i), get(ap, i)
        alarm = where_greater(value, level, u, zero)
        event = where_greater(value, least, u - alarm, zero) if ended else alarm
        new = where_greater(event, before, event, zero)
        put(ap, i, before + new)
        alarms, first = alarms + alarm, first + new
    return total(alarms), total(first)


@part
def count_tested(T, used):
    """The number of realisations of a chunk that were tested."""
    at, au, zero, least = address(T), address(used), full(0.0), full(0.5 * UNTESTED)
    tested = zero
    for i in range(GROUPS):
        tested = tested + where_greater(get(at, i), least, get(au, i), zero)
    return total(tested)


@part
def add_alarms(detectors, k, T, used, passed, sums):
    """Add the tests of scan k with statistics T (D, G, CHUNK); passed (D, G, thresholds, CHUNK)."""
    phase = detectors.phase[k]
    if k > 0 and phase != detectors.phase[k - 1]:
        passed[:] = 0.0
    for d in range(detectors.plots.size):
        for g in range(T.shape[1]):
            sums.tested[d, g, k] += count_tested(T[d, g], used)
            for j in range(detectors.thresholds[d]):
                alarms, first = count_alarms(T[d, g], detectors.threshold[d, g, j], phase == 2, used, passed[d, g, j])
                sums.alarms[d, g, j, k] += alarms
                sums.first[d, g, j, k] += first


# ---- the adaptive filter ------------------------------------------------------------------------------------------
@inline
def next_mode(T, threshold, mode, quiet, patience):
    """Mode and number of successive quiet tests after a statistic T."""
    zero, one = full(0.0), full(1.0)
    quiet = where_greater(T, full(0.5 * UNTESTED), quiet + one, quiet)
    quiet = where_greater(T, threshold, zero, quiet)
    mode = where_greater(quiet, patience - 0.5, zero, mode)
    return where_greater(T, threshold, one, mode), quiet


@inline
def adapt(filters, plots, f, c, rules, size, length, dt, period):
    """Update an adaptive filter with one scan, in place; further rows MODE, QUIET, PLOTS.

    It is growing memory of degree size - 1, restarted with the last `length` plots at every change of mode. An alarm
    sets the mode, and `quiet` successive tests without one reset it; see AdaptiveRules.
    """
    ax, ay, am, ap, az, aw, an = memory_of(filters, plots, f, c)
    T, recent, raises = plots.T[rules.detector[f], rules.group[f, c]], plots.recent[c], rules.raises[f]
    at, ar, longest = address(T), address(recent), recent.shape[1]
    zero, one, half, threshold = full(0.0), full(1.0), full(0.5), full(rules.threshold[f, c])
    tau, per, twice, F = dt / period, 1.0 / period, 1.0 / (period * period), constant_acceleration(dt)
    most, short, patience = full(float(size)), full(float(length)), full(float(rules.quiet[f]))
    raised = full(3.0) if raises else most
    for i in range(GROUPS):
        w, mode = get(aw, i), get(am, i)
        detected = where_greater(w, zero, one, zero)
        Y = predicted_information(get6(ay, i, GROUPS), tau)
        Y = (Y[0] + w, Y[1], Y[2], Y[3], Y[4], Y[5])
        most_now, rank = where_greater(mode, half, raised, most), get(an, i) + detected
        P = leading_inverse(Y, where_greater(rank, most_now, most_now, rank))
        x = predicted(get3(ax, i, GROUPS), F)
        x = add_scaled(x, w * (get(az, i) - x[0]), (P[0], per * P[1], twice * P[2]))
        mode_now, quiet = next_mode(get(at, i), threshold, mode, get(am, QUIET * GROUPS + i), patience)
        kept = get(am, PLOTS * GROUPS + i) + detected
        restarted = (mode_now - mode) * (mode_now - mode) + (zero if raises else mode_now)
        if any_greater(restarted, half):
            Y_recent, b, newest = parabola(ar, length, longest, i)
            P_recent = leading_inverse(Y_recent, where_greater(mode_now, half, raised, most))
            r, v, a = times(P_recent, b)
            x = choose3(restarted, half, (newest + r, per * v, twice * a), x)
            kept = where_greater(restarted, half, short, kept)
            P = choose6(restarted, half, P_recent, P)
            Y = choose6(restarted, half, Y_recent, Y)
        put6(ay, i, Y, GROUPS)
        put6(ap, i, P, GROUPS)
        put3(ax, i, x, GROUPS)
        put3(am, i, (mode_now, quiet, kept), GROUPS)
