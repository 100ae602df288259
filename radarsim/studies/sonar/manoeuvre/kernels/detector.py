"""Detectors of manoeuvres (P3 eq. 3) on each realisation's last plots, and the filters that answer to them.

A detector's statistic is â²/σ_a², the acceleration of a parabola through the last n plots against its own variance; of
all coordinates jointly it is the sum. Rows of the arrays are of one chunk, as in `sonar_steps`; times are in periods,
weights relative to the nominal plot.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address, any_greater, full, get, put, total, where_greater
from radarsim.kernels.linear import extrapolated
from radarsim.studies.sonar.kernels.steps import GROUPS, inverse, put_six, six, times

UNTESTED = -1.0  # the statistic where there was no test: it exceeds no threshold
MODE, QUIET, PLOTS = range(3)  # rows of an adaptive filter's memory: 1 in a manoeuvre, tests without alarm, plots used


class Detectors(NamedTuple):
    """D detectors on C coordinates, and groups of them G: each coordinate, then all jointly.

    plots (D,) of the parabola, every (D,) scans from one test to the next; threshold (D, G, T), of which a detector has
    the first thresholds (D,); phase (K,) 0 before the manoeuvre, 1 while it lasts, 2 after it.
    """

    plots: np.ndarray
    every: np.ndarray
    threshold: np.ndarray
    thresholds: np.ndarray
    phase: np.ndarray


class AdaptiveRules(NamedTuple):
    """What F filters do about a manoeuvre, read of adaptive ones alone.

    detector (F,) and group (F, C) whose statistic is compared with threshold (F, C); raises (F,) the degree, else the
    memory is held short; quiet (F,) tests without an alarm end the manoeuvre.
    """

    detector: np.ndarray
    group: np.ndarray
    threshold: np.ndarray
    raises: np.ndarray
    quiet: np.ndarray


class Alarms(NamedTuple):
    """Sums over realisations: tested (D, G, K) at a scan, alarms (D, G, T, K), and first (D, G, T, K) of a phase.

    The first event of a phase is the first alarm before the manoeuvre, the first while it lasts, and after it the
    first test without an alarm.
    """

    tested: np.ndarray
    alarms: np.ndarray
    first: np.ndarray


# ---- tests --------------------------------------------------------------------------------------------------------
@inline
def normal_equations(a, length, longest, i):
    """Of a parabola through the last `length` plots of group i in memory, at the present: Y (6), Yx (3), the newest
    plot.

    Plots are taken from the newest one, lest their figures be lost in sums.
    """
    zero = full(0.0)
    y0, y1, y2, y3, y4, y5, b0, b1, b2 = zero, zero, zero, zero, zero, zero, zero, zero, zero
    newest = get(a, i)
    for q in range(length):
        here = q * GROUPS + i
        z = get(a, here) - newest
        age, w = get(a, longest * GROUPS + here), get(a, 2 * longest * GROUPS + here)
        one, two = zero - age, 0.5 * age * age
        w1, w2 = w * one, w * two
        y0, y1, y2, y3, y4, y5 = y0 + w, y1 + w1, y2 + w2, y3 + w1 * one, y4 + w1 * two, y5 + w2 * two
        b0, b1, b2 = b0 + w * z, b1 + w1 * z, b2 + w2 * z
    return (y0, y1, y2, y3, y4, y5), (b0, b1, b2), newest


@part
def curvature(memory, length, sigma, count, weight, q):
    """Statistic (CHUNK,) of one coordinate's last `length` plots; UNTESTED where there are fewer, or no new one."""
    a, ac, aw, aq = address(memory), address(count), address(weight), address(q)
    zero, enough, most, none = full(0.0), full(length - 0.5), full(3.0), full(UNTESTED)
    per = 1.0 / (sigma * sigma)
    for i in range(GROUPS):
        Y, b, _ = normal_equations(a, length, memory.shape[1], i)
        tested = where_greater(get(aw, i), zero, get(ac, i), zero)
        p = inverse(Y, where_greater(tested, enough, most, zero))
        bend = p[2] * b[0] + p[4] * b[1] + p[5] * b[2]
        value = per * (bend * bend) / where_greater(tested, enough, p[5], full(1.0))
        put(aq, i, where_greater(tested, enough, value, none))


@part
def joined(q):
    """The joint statistic, last row of q (C + 1, CHUNK): the sum of all, UNTESTED where any is."""
    a, least, none = address(q), full(0.5 * UNTESTED), full(UNTESTED)
    for i in range(GROUPS):
        value = full(0.0)
        for c in range(q.shape[0] - 1):
            one = get(a, c * GROUPS + i)
            value = where_greater(one, least, where_greater(value, least, value + one, none), none)
        put(a, (q.shape[0] - 1) * GROUPS + i, value)


@kernel
def examine(detectors, k, memory, sigma, count, weight, q):
    """Statistics q (D, G, CHUNK) of all detectors at scan k; memory (C, 3, L, CHUNK), count and weight (C, CHUNK)."""
    for d in range(detectors.plots.size):
        if (k + 1 - detectors.plots[d]) % detectors.every[d] != 0:
            q[d] = UNTESTED
            continue
        for c in range(memory.shape[0]):
            curvature(memory[c], detectors.plots[d], sigma[c], count[c], weight[c], q[d, c])
        joined(q[d])


@part
def tell(q, threshold, ended, used, passed):
    """How many of a chunk give an alarm, and how many their first event of a phase; passed (CHUNK,) 1 after it."""
    aq, au, ap, zero = address(q), address(used), address(passed), full(0.0)
    level, least, alarms, first = full(threshold), full(0.5 * UNTESTED), zero, zero
    for i in range(GROUPS):
        value, u, before = get(aq, i), get(au, i), get(ap, i)
        alarm = where_greater(value, level, u, zero)
        event = where_greater(value, least, u - alarm, zero) if ended else alarm
        new = where_greater(event, before, event, zero)
        put(ap, i, before + new)
        alarms, first = alarms + alarm, first + new
    return total(alarms), total(first)


@part
def tally(q, used):
    """How many of a chunk were tested."""
    aq, au, zero, least = address(q), address(used), full(0.0), full(0.5 * UNTESTED)
    tested = zero
    for i in range(GROUPS):
        tested = tested + where_greater(get(aq, i), least, get(au, i), zero)
    return total(tested)


@part
def add_alarms(detectors, k, q, used, passed, sums):
    """Add the tests of scan k; passed (D, G, T, CHUNK)."""
    phase = detectors.phase[k]
    if k > 0 and phase != detectors.phase[k - 1]:
        passed[:] = 0.0
    for d in range(detectors.plots.size):
        for g in range(q.shape[1]):
            sums.tested[d, g, k] += tally(q[d, g], used)
            for t in range(detectors.thresholds[d]):
                alarms, first = tell(q[d, g], detectors.threshold[d, g, t], phase == 2, used, passed[d, g, t])
                sums.alarms[d, g, t, k] += alarms
                sums.first[d, g, t, k] += first


# ---- the adaptive filter ------------------------------------------------------------------------------------------
@inline
def grown(y, w, tau):
    """Information y (6) of a parabola, moved on by tau and with a new plot of weight w."""
    y00, y01, y02, y11, y12, y22 = y
    half = 0.5 * tau * tau
    u0, u1, u2 = half * y00 - tau * y01 + y02, half * y01 - tau * y11 + y12, half * y02 - tau * y12 + y22
    y11, y01 = tau * (tau * y00 - 2.0 * y01) + y11, y01 - tau * y00
    return y00 + w, y01, u0, y11, u1 - tau * u0, half * u0 - tau * u1 + u2


@inline
def decided(q, threshold, mode, quiet, patience):
    """Mode (1 in a manoeuvre) and number of tests without an alarm in a row, by a statistic."""
    zero, one = full(0.0), full(1.0)
    calm = where_greater(q, full(0.5 * UNTESTED), quiet + one, quiet)
    calm = where_greater(q, threshold, zero, calm)
    over = where_greater(calm, patience - 0.5, zero, mode)
    return where_greater(q, threshold, one, over), calm


@part
def adapt(size, raises, length, patience, threshold, q, dt, period, x, y, s, memory, z, weight, before, P):
    """One scan, in place: growing memory of degree size - 1, begun anew with the last `length` plots at every change.

    An alarm sets the mode, `patience` tests without one in a row take it back. In a manoeuvre the degree is 2, or the
    memory is held at `length` plots. x (4, CHUNK), y (8, CHUNK), s (>= 3, CHUNK); q (CHUNK,) statistics of this scan;
    leaves P (6, CHUNK).
    """
    ax, ay, at, am, az = address(x), address(y), address(s), address(memory), address(z)
    aw, ab, aq, ap = address(weight), address(before), address(q), address(P)
    zero, one, limit, few, short = full(0.0), full(1.0), full(threshold), full(float(size)), full(float(length))
    tau, per, twice, half = dt / period, 1.0 / period, 1.0 / (period * period), full(0.5)
    raised = full(3.0) if raises else few
    calm_enough = full(float(patience))
    for i in range(GROUPS):
        w, mode = get(aw, i), get(at, i)
        came = where_greater(w, zero, one, zero)
        Y = grown(six(ay, i), w, tau)
        degree, rank = where_greater(mode, half, raised, few), get(ab, i) + came
        p = inverse(Y, where_greater(rank, degree, degree, rank))
        r, v, a = extrapolated(get(ax, i), get(ax, GROUPS + i), get(ax, 2 * GROUPS + i), dt)
        residual = w * (get(az, i) - r)
        r, v, a = r + p[0] * residual, v + per * p[1] * residual, a + twice * p[2] * residual
        new, calm = decided(get(aq, i), limit, mode, get(at, QUIET * GROUPS + i), calm_enough)
        plots = get(at, PLOTS * GROUPS + i) + came
        changed = (new - mode) * (new - mode) + (zero if raises else new)
        if any_greater(changed, half):
            fresh, b, newest = normal_equations(am, length, memory.shape[1], i)
            degree = where_greater(new, half, raised, few)
            fit = inverse(fresh, degree)
            r0, v0, a0 = times(fit, b)
            r, v = where_greater(changed, half, newest + r0, r), where_greater(changed, half, per * v0, v)
            a, plots = where_greater(changed, half, twice * a0, a), where_greater(changed, half, short, plots)
            p = chosen(changed, fit, p)
            Y = chosen(changed, fresh, Y)
        put_six(ay, i, Y)
        put_six(ap, i, p)
        put(ax, i, r)
        put(ax, GROUPS + i, v)
        put(ax, 2 * GROUPS + i, a)
        put(at, i, new)
        put(at, QUIET * GROUPS + i, calm)
        put(at, PLOTS * GROUPS + i, plots)


@inline
def chosen(mask, yes, no):
    """Six numbers where the mask is over a half, else six others."""
    half = full(0.5)
    return (
        where_greater(mask, half, yes[0], no[0]),
        where_greater(mask, half, yes[1], no[1]),
        where_greater(mask, half, yes[2], no[2]),
        where_greater(mask, half, yes[3], no[3]),
        where_greater(mask, half, yes[4], no[4]),
        where_greater(mask, half, yes[5], no[5]),
    )
