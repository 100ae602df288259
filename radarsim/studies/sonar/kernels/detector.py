"""Manoeuvre detectors (P3 eq. 3) on the last plots of each realisation.

The statistic of a detector is â²/σ_a²: the squared acceleration of a parabola through the last plots over its variance.
For all coordinates jointly it is the sum. Letters as in `sonar.kernels.steps`, and

    Y x = b    normal equations of a parabola: Y (6), b (3)
    T          statistic, UNTESTED where there was no test

recent (3, L, ROW) holds the last L plots of a coordinate: plot, age, weight, the newest first."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.lanes import address, full, get, put, total, where_greater
from radarsim.studies.sonar.kernels import normal_equations
from radarsim.studies.sonar.kernels.chunks import GROUPS
from radarsim.studies.sonar.kernels.normal_equations import leading_inverse

UNTESTED = -1.0  # the statistic where there was no test: it exceeds no threshold


class Detectors(NamedTuple):
    """D detectors, each for G groups of coordinates: each of C coordinates, then all jointly."""

    plots: np.ndarray  #: (D,) of the parabola
    every: np.ndarray  #: (D,) scans from one test to the next
    threshold: np.ndarray  #: (D, G, T)
    thresholds: np.ndarray  #: (D,) how many of these are used
    phase: np.ndarray  #: (K,) 0 before the manoeuvre, 1 during it, 2 after it


class Alarms(NamedTuple):
    """Numbers of realisations by scan."""

    tested: np.ndarray  #: (D, G, K)
    alarms: np.ndarray  #: (D, G, T, K)
    #: (D, G, T, K) first event of a phase: alarm before the manoeuvre, alarm during it, test without one after it
    first: np.ndarray


@inline
def parabola(recent, length, longest, i):
    """The normal equations of a parabola, Y (6) and b (3), relative to the newest plot; and the newest plot.

    Relative to the newest plot the sums lose no digits."""
    newest = get(recent, i)
    Y, b = normal_equations.normal_equations(recent, length, longest, i, newest, 0.5)
    return Y, b, newest


@kernel_part
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


@kernel_part
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


@kernel_part
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


@kernel_part
def count_tests(T, used):
    """The number of realisations of a chunk that were tested."""
    statistic, au, zero, test_level = address(T), address(used), full(0.0), full(0.5 * UNTESTED)
    tested = zero
    for i in range(GROUPS):
        tested = tested + where_greater(get(statistic, i), test_level, get(au, i), zero)
    return total(tested)


@kernel_part
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
