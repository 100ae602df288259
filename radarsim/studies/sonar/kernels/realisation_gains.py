"""Sonar filters whose gains differ between realisations, because plots are missed at random or have random weights.

These are the filters of `shared_gains`, but the design that `radarsim.studies.sonar.filter_design` computes once for
all realisations is computed here for each of them, in chunks. All filters except the windows start by least squares in
information form. Growing memory and the differenced filter continue so; the Kalman filters and those of fixed gain
switch to covariances. The steps and the letters are those of `steps`; F filters, C coordinates, K scans."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lanes import address
from radarsim.studies.sonar.kernels import adaptive as kernels_adaptive
from radarsim.studies.sonar.kernels import detector, imm, mode_sums
from radarsim.studies.sonar.kernels.chunks import ROW, copy_row
from radarsim.studies.sonar.kernels.kalman import Model
from radarsim.studies.sonar.kernels.plots import convert, count_plots, detect
from radarsim.studies.sonar.kernels.shared_gains import CHUNK, Sums
from radarsim.studies.sonar.kernels.steps import Filters, Plots, update_recursive
from radarsim.studies.sonar.kernels.sums import Course, add_ahead, add_sums, rows_of
from radarsim.studies.sonar.kernels.windows import fit_window, remember_plots
from radarsim.studies.sonar.kernels.world import move_and_measure

INFORMATION, COVARIANCE, FIXED, WINDOW, ADAPTIVE, IMM = range(6)


class RealisationBank(NamedTuple):
    """F filters."""

    kind: np.ndarray  #: (F,)
    size: np.ndarray  #: (F,) of the state
    length: np.ndarray  #: (F,) of a window or of the start of a fixed-gain filter
    carry: np.ndarray  #: (F, K, C) correlation c that the filter assumes
    manoeuvre: np.ndarray  #: (F, C) variance q, in nominal plots and periods
    steady_gains: np.ndarray  #: (F, C, 3) gains of a fixed-gain filter, likewise
    memory: int  #: number of plots that are kept for windows and detectors
    period: float  #: s
    sigma: np.ndarray  #: (C,) of a nominal plot, m or rad
    adaptive: kernels_adaptive.AdaptiveRules
    interacting: imm.ModelPairs


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


@kernel
def filter_scan(bank, f, c, k, dt, filters, plots):
    """Update filter f in coordinate c with scan k, in place, dt after the scan before."""
    size, length, kind, period = bank.size[f], bank.length[f], bank.kind[f], bank.period
    if kind == ADAPTIVE:
        kernels_adaptive.update_adaptive(filters, plots, f, c, bank.adaptive, size, length, dt, period)
    elif kind == IMM:
        imm.update_imm(filters, plots, f, c, bank.interacting, size, dt, period, bank.sigma[c])
    elif kind == WINDOW:
        fit_window(filters, plots, f, c, length, size, period)
    else:
        gain = bank.steady_gains[f, c]
        fixed = (gain[0], gain[1], gain[2])
        model = Model(size, max(size, length), bank.carry[f, k, c], bank.manoeuvre[f, c], fixed)
        update_recursive(filters, plots, f, c, kind != INFORMATION, model, dt, period)


@kernel_part
def add_modes(kind, kind_rows, used, out, modes):
    """Add the modes of a filter to modes (3,); kind_rows are its rows in `Filters`, out (3,) is scratch."""
    if kind == ADAPTIVE:
        mode_sums.mode_sums(kind_rows, kernels_adaptive.MODE, kernels_adaptive.PLOTS, used, out)
    elif kind == IMM:
        mode_sums.mode_sums(kind_rows, imm.PROBABILITY + 1, -1, used, out)
    else:
        return
    for j in range(3):
        modes[j] += out[j]


@kernel_part
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


@kernel_part
def keep_errors(x, course, c, n, first, count, errors):
    """Store the errors of `count` realisations in a coordinate in errors (S, total) from number `first` on.

    NaN where a component has no estimate; n (CHUNK,) plots so far."""
    truth, shift = course.truth[c], course.shift[c]
    for j in range(errors.shape[0]):
        for i in range(count):
            errors[j, first + i] = x[j, i] - (truth[j] + shift[j, i]) if n[i] > j + 0.5 else np.nan


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


@kernel_part
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
    rows = imm.ROWS if (bank.kind == IMM).any() else 10
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
