"""Plots of each realisation: which are missed, and how they are converted to the coordinates of the filters."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.random import U, uniforms
from radarsim.studies.sonar.kernels.shared_gains import CHUNK
from radarsim.studies.sonar.kernels.world import move_and_measure

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
    likewise, by the predicted position. See `conversion.weighting_positions`."""
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


@kernel_part
def count_plots(weight, n, n_now):
    """Count the plots of a scan: n before it and n_now up to it, (C, CHUNK) each."""
    for c in range(n.shape[0]):
        for i in range(n.shape[1]):
            n[c, i] = n_now[c, i]
            n_now[c, i] += weight[c, i] > 0.0
