"""The adaptive filter, which a manoeuvre detector switches.

Letters as in `detector`, and

    mode       1 in a manoeuvre, else 0
    quiet      tests without an alarm in a row"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra, lane_matrices, lanes
from radarsim.kernels.compiler import inline
from radarsim.kernels.lane_matrices import choose3, choose6, get6, put3, put6
from radarsim.kernels.lanes import address, full, get, where_greater
from radarsim.studies.sonar.kernels.chunks import GROUPS
from radarsim.studies.sonar.kernels.detector import UNTESTED, parabola
from radarsim.studies.sonar.kernels.normal_equations import leading_inverse
from radarsim.studies.sonar.kernels.steps import memory_addresses

MODE, QUIET, PLOTS = range(3)  # further rows of an adaptive filter's memory; PLOTS: number of plots that it uses


class AdaptiveRules(NamedTuple):
    """How F filters respond to a manoeuvre; read only for adaptive ones."""

    detector: np.ndarray  #: (F,) whose statistic is looked at
    group: np.ndarray  #: (F, C) of its coordinates
    threshold: np.ndarray  #: (F, C) that it is compared with
    raises: np.ndarray  #: (F,) an alarm raises the degree, else it keeps the memory short
    quiet: np.ndarray  #: (F,) tests without an alarm that end the manoeuvre


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
    tau, per, twice, F = dt / period, 1.0 / period, 1.0 / (period * period), kalman_algebra.constant_acceleration(dt)
    full_rank, short, patience = full(float(size)), full(float(length)), full(float(rules.quiet[f]))
    raised_rank = full(3.0) if raises else full_rank
    for i in range(GROUPS):
        w, mode = get(aw, i), get(am, i)
        detected = where_greater(w, zeros, ones, zeros)
        Y = kalman_algebra.predict_information(get6(ay, i, GROUPS), tau)
        Y = (Y[0] + w, Y[1], Y[2], Y[3], Y[4], Y[5])
        current_rank, rank = where_greater(mode, half, raised_rank, full_rank), get(an, i) + detected
        P = leading_inverse(Y, where_greater(rank, current_rank, current_rank, rank))
        x = kalman_algebra.predict_state(lane_matrices.get3(ax, i, GROUPS), F)
        x = kalman_algebra.add_scaled(x, w * (get(az, i) - x[0]), (P[0], per * P[1], twice * P[2]))
        mode_now, quiet = next_mode(get(statistic, i), threshold, mode, get(am, QUIET * GROUPS + i), patience)
        plots_kept = get(am, PLOTS * GROUPS + i) + detected
        restarted = (mode_now - mode) * (mode_now - mode) + (zeros if raises else mode_now)
        if lanes.any_greater(restarted, half):
            Y_recent, b, newest = parabola(ar, length, longest, i)
            P_recent = leading_inverse(Y_recent, where_greater(mode_now, half, raised_rank, full_rank))
            r, v, a = kalman_algebra.times(P_recent, b)
            x = choose3(restarted, half, (newest + r, per * v, twice * a), x)
            plots_kept = where_greater(restarted, half, short, plots_kept)
            P = choose6(restarted, half, P_recent, P)
            Y = choose6(restarted, half, Y_recent, Y)
        put6(ay, i, Y, GROUPS)
        put6(ap, i, P, GROUPS)
        put3(ax, i, x, GROUPS)
        put3(am, i, (mode_now, quiet, plots_kept), GROUPS)
