"""Sonar filters whose gains differ between realisations, because plots are missed at random or have random weights.

These are the filters of `shared_gains`, but what the module `filters` computes once for all realisations is computed
here for each of them, in chunks. All filters but the windows start by least squares in information form. Growing memory
and the differenced filter continue so; the Kalman filters and those of fixed gain switch to covariances. The steps and
the letters are those of `steps`; F filters, C coordinates, K scans."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import U, uniforms
from radarsim.studies.sonar.kernels import detector
from radarsim.studies.sonar.kernels.shared_gains import CHUNK, Sums, move_and_measure
from radarsim.studies.sonar.kernels.steps import (
    ROW,
    Filters,
    Model,
    Plots,
    copy_row,
    fit_window,
    remember_plots,
    update_recursive,
)
from radarsim.studies.sonar.kernels.sums import Course, add_ahead, add_sums, rows_of

INFORMATION, COVARIANCE, FIXED, WINDOW, ADAPTIVE, IMM = range(6)
PLACED = 8.0  # as world.PLACED


class Detections(NamedTuple):
    """Which scans give a plot.

    key (2,) of the noise stream; certain (K,) is 1 where a scan always gives a plot, 0 where it never does, and -1
    where it does with `probability`."""

    key: np.ndarray
    certain: np.ndarray
    probability: float


class Conversion(NamedTuple):
    """How plots are converted to the coordinates of the filters."""

    weight: np.ndarray  #: (K, C) of a plot that is not converted
    frame: int  #: 0: coordinates as measured, 1: plain conversion of the first two, 2: the unbiased one
    measured: np.ndarray  #: (K, 2) true range and bearing, where they are converted
    spread: np.ndarray  #: (2,) standard deviations of their plots


class RealisationBank(NamedTuple):
    """F filters."""

    kind: np.ndarray  #: (F,)
    size: np.ndarray  #: (F,) of the state
    length: np.ndarray  #: (F,) of a window or of the start of a fixed-gain filter
    carry: np.ndarray  #: (F, K, C) correlation c that the filter assumes
    manoeuvre: np.ndarray  #: (F, C) variance q, in nominal plots and periods
    settled: np.ndarray  #: (F, C, 3) gains of a fixed-gain filter, likewise
    memory: int  #: number of plots that are kept for windows and detectors
    period: float  #: s
    sigma: np.ndarray  #: (C,) of a nominal plot, m or rad
    adaptive: detector.AdaptiveRules
    interacting: detector.ModelPairs


class BlockSums(NamedTuple):
    """Sums of a block over realisations, and estimates that are kept one by one."""

    errors: Sums
    alarms: detector.Alarms
    #: (F, K, C, 3) Σp, Σp² of the probability of a manoeuvre, Σ of the plots in memory; of filters that respond
    modes: np.ndarray
    kept_scans: np.ndarray  #: (A,) scans whose estimates are kept
    #: (A, F, 2, 6, count) of the first two coordinates: value, rate, believed variance of the value, covariance,
    #: variance of the rate, and 1 where the state is complete
    kept_estimates: np.ndarray
    realisation_errors: (
        np.ndarray
    )  #: (F, K, C, S, count or 0) errors of all realisations, NaN where a filter has no estimate


# ---- plots --------------------------------------------------------------------------------------------------------
@kernel
def detect(detections, first, k, detected):
    """Set detected (n,) to 1 for the realisations, from number `first` on, in which scan k gives a plot, else to 0."""
    k0, k1, start, limit = detections.key[0], detections.key[1], U(first), detections.probability
    if detections.certain[k] >= 0:
        detected[:] = float(detections.certain[k])
        return
    for i in range(detected.size):
        a, _ = uniforms(k0, k1, start + U(i), k)
        detected[i] = 1.0 if a < limit else 0.0


@kernel
def fill_plots(world, detections, first, source_row, plots, deviation):
    """Write plots (C, K, n) of realisations from `first` on, NaN where there is none, or their errors.

    source_row 0 for plots, 1 for errors. deviation (C, 2, K, n) of value and rate is written where a target moves at
    random."""
    work, detected, scans = np.zeros((plots.shape[0], 4, CHUNK)), np.empty(CHUNK), plots.shape[1]
    moves = np.any(world.walk > 0.0)
    for done in range(0, plots.shape[2], CHUNK):
        n = min(CHUNK, plots.shape[2] - done)
        work[:] = 0.0
        for k in range(scans):
            move_and_measure(world, first + done, k, work)
            detect(detections, first + done, k, detected)
            for c in range(plots.shape[0]):
                values, plots_of_scan = work[c, source_row], plots[c, k]
                for i in range(n):
                    plots_of_scan[done + i] = values[i] if detected[i] > 0.0 else np.nan
                if moves:
                    for j in range(2):
                        for i in range(n):
                            deviation[c, j, k, done + i] = work[c, 2 + j, i]


@kernel
def convert(conversion, sigma, k, plots, detected, running_mean, z, weight):
    """Plots z (C, n) in the coordinates of the filters and their weights (C, n), from measured plots (C', 4, n).

    sigma (C,) of a nominal plot; running_mean (3, n): mean range and bearing of the last plots, and their number. The
    plain conversion computes weights at the plot itself, the unbiased one at earlier plots: a weight that is correlated
    with the error of its own plot would cause a bias again. Bordonaro, Willett and Bar-Shalom (2014) decorrelate it
    likewise, by the predicted position. See `world.places`."""
    for c in range(z.shape[0]):
        w = conversion.weight[k, c]
        for i in range(detected.size):
            z[c, i] = plots[c, 0, i]
            weight[c, i] = w * detected[i]
    if conversion.frame == 0:
        return
    sr, sb = conversion.spread[0] ** 2, conversion.spread[1] ** 2
    nominal_x, nominal_y = sigma[0] ** 2, sigma[1] ** 2
    grow = np.exp(sb) if conversion.frame == 2 else 1.0
    root, shrink = np.sqrt(grow), np.exp(-2.0 * sb)
    for i in range(detected.size):
        r, b = conversion.measured[k, 0] + plots[0, 1, i], conversion.measured[k, 1] + plots[1, 1, i]
        co, si = np.cos(b), np.sin(b)
        z[0, i], z[1, i] = root * r * co, root * r * si
        if conversion.frame == 1:
            across = r * r * sb
            xx, yy = sr * co * co + across * si * si, sr * si * si + across * co * co
        else:
            r_now, b_now = r, b
            if running_mean[2, i] > 0.0:
                r, b = running_mean[0, i], running_mean[1, i]
                co, si = np.cos(b), np.sin(b)
            if detected[i] > 0.0:
                running_mean[2, i] = min(running_mean[2, i] + 1.0, PLACED)
                running_mean[0, i] += (r_now - running_mean[0, i]) / running_mean[2, i]
                running_mean[1, i] += (b_now - running_mean[1, i]) / running_mean[2, i]
            power, twice = 0.5 * grow * (r * r + sr), shrink * (co * co - si * si)
            xx, yy = power * (1.0 + twice) - r * r * co * co, power * (1.0 - twice) - r * r * si * si
        weight[0, i], weight[1, i] = detected[i] * nominal_x / xx, detected[i] * nominal_y / yy


@part
def count_plots(weight, n, n_now):
    """Count the plots of a scan: n before it and n_now up to it, (C, CHUNK) each."""
    for c in range(n.shape[0]):
        for i in range(n.shape[1]):
            n[c, i] = n_now[c, i]
            n_now[c, i] += weight[c, i] > 0.0


@kernel
def filter_scan(bank, f, c, k, dt, filters, plots):
    """Update filter f in coordinate c with scan k, in place, dt after the scan before."""
    size, length, kind, period = bank.size[f], bank.length[f], bank.kind[f], bank.period
    if kind == ADAPTIVE:
        detector.update_adaptive(filters, plots, f, c, bank.adaptive, size, length, dt, period)
    elif kind == IMM:
        detector.update_imm(filters, plots, f, c, bank.interacting, size, dt, period, bank.sigma[c])
    elif kind == WINDOW:
        fit_window(filters, plots, f, c, length, size, period)
    else:
        gain = bank.settled[f, c]
        fixed = (gain[0], gain[1], gain[2])
        model = Model(size, max(size, length), bank.carry[f, k, c], bank.manoeuvre[f, c], fixed)
        update_recursive(filters, plots, f, c, kind != INFORMATION, model, dt, period)


# ---- sums ---------------------------------------------------------------------------------------------------------
@part
def add_modes(kind, kind_rows, used, out, modes):
    """Add the modes of a filter to modes (3,); kind_rows are its rows in `Filters`, out (3,) is scratch."""
    if kind == ADAPTIVE:
        detector.mode_sums(kind_rows, detector.MODE, detector.PLOTS, used, out)
    elif kind == IMM:
        detector.mode_sums(kind_rows, detector.PROBABILITY + 1, -1, used, out)
    else:
        return
    for j in range(3):
        modes[j] += out[j]


@part
def keep(x, P, n, size, units, first, count, estimates):
    """Store the estimate of a coordinate and its believed covariance, of `count` realisations, in estimates (6, total).

    From number `first` on; n (CHUNK,) plots so far, units (σ, period)."""
    sigma, period = units
    for i in range(count):
        estimates[0, first + i], estimates[1, first + i] = x[0, i], x[1, i]
        estimates[5, first + i] = 1.0 if n[i] >= size else 0.0
        estimates[2, first + i] = P[0, i] * sigma * sigma
        estimates[3, first + i] = P[1, i] * sigma * sigma / period
        estimates[4, first + i] = P[3, i] * sigma * sigma / (period * period)


@part
def keep_errors(x, course, c, n, first, count, errors):
    """Store the errors of `count` realisations in a coordinate in errors (S, total) from number `first` on.

    NaN where a component has no estimate; n (CHUNK,) plots so far."""
    truth, shift = course.truth[c], course.shift[c]
    for j in range(errors.shape[0]):
        for i in range(count):
            errors[j, first + i] = x[j, i] - (truth[j] + shift[j, i]) if n[i] > j + 0.5 else np.nan


# ---- a block ------------------------------------------------------------------------------------------------------
class Chunk(NamedTuple):
    """A chunk of a block at scan k, dt after the previous scan.

    `count` realisations from number `first` of the block on; used (CHUNK,) is 1 for these realisations; course: of the
    targets in all coordinates."""

    first: int
    count: int
    k: int
    dt: float
    used: np.ndarray
    course: Course


@part
def step_filters(bank, baseline, chunk, filters, plots, out, sums):
    """Update all filters in all coordinates with one scan, and add its sums; out (7,) is scratch."""
    k, course = chunk.k, chunk.course
    for c in range(plots.z.shape[0]):
        units = (bank.sigma[c], bank.period)
        n, x_base, size_base = plots.n_now[c], filters.x[baseline, c], bank.size[baseline]
        for j in range(bank.size.size):  # the baseline first: gains of the others refer to its estimates
            f = baseline if j == 0 else (j - 1 if j <= baseline else j)
            filter_scan(bank, f, c, k, chunk.dt, filters, plots)
            add_modes(bank.kind[f], filters.kind_rows[f, c], chunk.used, out, sums.modes[f, k, c])
            for a in range(sums.kept_scans.size if c < 2 else 0):
                if sums.kept_scans[a] == k:
                    estimates = sums.kept_estimates[a, f, c]
                    keep(filters.x[f, c], filters.P, n, bank.size[f], units, chunk.first, chunk.count, estimates)
            if sums.realisation_errors.shape[4] > 0:
                keep_errors(
                    filters.x[f, c],
                    course,
                    c,
                    n,
                    chunk.first,
                    chunk.count,
                    sums.realisation_errors[f, k, c, : bank.size[f]],
                )
            rows = rows_of(filters.x[f, c], course, c, n, chunk.used)
            add_sums(rows, filters.P, bank.size[f], x_base, size_base, units, (f, k, c), out, sums.errors)


@kernel
def simulate_block(world, detections, conversion, bank, detectors, first, total, baseline, sums):
    """Add the sums of realisations first … first + total - 1 to sums, a BlockSums; gains refer to filter `baseline`.

    The last chunk is always computed in full, but only the requested realisations are summed."""
    F, K, C = bank.carry.shape
    rows = detector.ROWS if (bank.kind == IMM).any() else 10
    x, Y, kind_rows = np.empty((F, C, 4, CHUNK)), np.empty((F, C, 8, CHUNK)), np.empty((F, C, rows, CHUNK))
    filters = Filters(x, Y, kind_rows, np.empty((6, CHUNK)))
    z, weight, n, n_now = np.empty((C, CHUNK)), np.empty((C, CHUNK)), np.empty((C, CHUNK)), np.empty((C, CHUNK))
    recent, T = np.empty((C, 3, bank.memory, ROW)), np.empty((detectors.plots.size, C + 1, CHUNK))
    plots, measured = Plots(z, weight, n, n_now, recent, T), np.empty((world.walk.size, 4, CHUNK))
    shift, running_mean, detected = np.zeros((C, 3, CHUNK)), np.empty((3, CHUNK)), np.empty(CHUNK)
    passed, used, out = np.empty((*detectors.threshold.shape, CHUNK)), np.ones(CHUNK), np.empty(7)
    for done in range(0, total, CHUNK):
        x[:], Y[:], kind_rows[:], recent[:], measured[:], n_now[:], running_mean[:] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        used[total - done :], passed[:] = 0.0, 0.0
        for k in range(K):
            dt, course = world.dt[k], Course(world.truth[k], shift)
            move_and_measure(world, first + done, k, measured)
            detect(detections, first + done, k, detected)
            convert(conversion, bank.sigma, k, measured, detected, running_mean, z, weight)
            for c in range(C):
                copy_row(measured[c, 2], shift[c, 0])
                copy_row(measured[c, 3], shift[c, 1])
            if k > 0:
                for c in range(C):
                    for f in range(F):
                        sums_ahead = sums.errors.ahead[f, k - 1, c]
                        add_ahead(
                            rows_of(x[f, c], course, c, n_now[c], used), bank.size[f], dt, address(out), sums_ahead
                        )
            count_plots(weight, n, n_now)
            for c in range(C):
                if recent.shape[2] > 0:
                    remember_plots(recent[c], z[c], weight[c], dt / bank.period)
            detector.detector_statistics(detectors, k, recent, bank.sigma, n_now, weight, T)
            detector.add_alarms(detectors, k, T, used, passed, sums.alarms)
            chunk = Chunk(done, min(CHUNK, total - done), k, dt, used, course)
            step_filters(bank, baseline, chunk, filters, plots, out, sums)
