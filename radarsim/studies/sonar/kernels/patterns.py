"""Sonar filters where every realisation has its own pattern of missed plots, or weights: gains go along with it.

The same filters as in `sonar`, with what `filters.sonar` reckons once now reckoned for each realisation, in chunks.
All but the windows take least squares in information form up to their start; growing memory and the differenced
filter go on with it, the Kalman filters and those of fixed gain go over to covariances. The steps are in `sonar_steps`.
Inside, times are in periods and weights relative to the nominal plot; a weight of zero is a missed plot.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import kernel, part
from radarsim.kernels.random import U, uniforms
from radarsim.studies.sonar.kernels.shared_gains import CHUNK, move_and_measure
from radarsim.studies.sonar.kernels.steps import fit, recur, remember
from radarsim.studies.sonar.kernels.sums import add_ahead, add_sums
from radarsim.studies.sonar.manoeuvre.kernels.detector import MODE, PLOTS, AdaptiveRules, adapt, add_alarms, examine
from radarsim.studies.sonar.manoeuvre.kernels.imm import PROBABILITY, ROWS, ModelPairs, interact, mode_sums

INFORMATION, COVARIANCE, FIXED, WINDOW, ADAPTIVE, IMM = range(6)
PLACED = 8.0  # as models.sonar.PLACED


class Observation(NamedTuple):
    """Which plots come, and how they are turned into what the filters take.

    misses (2,) is the key of the stream of detections; certain (K,) is 1 where the plot always comes, 0 where never,
    else -1: with `probability`. weight (K, C) of a plot that comes; period in s and nominal sigma (C,) make gains
    physical. frame is 0 for coordinates as measured, 1 for the plain conversion of the first two, 2 for the unbiased
    one; measured (K, 2) then holds the true range and bearing and spread (2,) their standard deviations.
    """

    misses: np.ndarray
    certain: np.ndarray
    probability: float
    weight: np.ndarray
    period: float
    sigma: np.ndarray
    frame: int
    measured: np.ndarray
    spread: np.ndarray


class RealisationBank(NamedTuple):
    """F filters: kind (F,), size (F,) of the state, length (F,) of a window or of the start of a fixed filter.

    carry (F, K, C) correlation that the filter assumes, manoeuvre (F, C) variance in nominal plots and periods, settled
    (F, C, 3) gains of a fixed filter, likewise. memory is how many plots are kept for windows and detectors.
    """

    kind: np.ndarray
    size: np.ndarray
    length: np.ndarray
    carry: np.ndarray
    manoeuvre: np.ndarray
    settled: np.ndarray
    memory: int
    switching: AdaptiveRules
    interacting: ModelPairs


class FurtherSums(NamedTuple):
    """What is added up of filters that answer to manoeuvres, and what is kept of estimates.

    modes (F, K, C, 3): Σp, Σp² of the probability of a manoeuvre, and Σ of the plots in memory. at (A,) are scans, and
    kept (A, F, 2, 6, count) of the first two coordinates there: value, rate, variance of the value, covariance,
    variance of the rate, all as believed, and 1 where the state is complete.
    """

    modes: np.ndarray
    at: np.ndarray
    kept: np.ndarray


# ---- plots --------------------------------------------------------------------------------------------------------
@kernel
def detect(observation, first, k, seen):
    """Whether the plot of scan k came, 1 or 0, in seen (n,)."""
    k0, k1, start, limit = observation.misses[0], observation.misses[1], U(first), observation.probability
    if observation.certain[k] >= 0:
        seen[:] = float(observation.certain[k])
        return
    for i in range(seen.size):
        a, _ = uniforms(k0, k1, start + U(i), k)
        seen[i] = 1.0 if a < limit else 0.0


@kernel
def weigh(observation, k, plots, seen, place, z, weight):
    """Plots z (C, n) and their weights (C, n) from what was measured: plots (C', 4, n), rows 0 and 1.

    place (3, n) holds mean range and bearing of the last plots, and how many they are. The plain conversion has its
    weights from the plot itself; the unbiased one from the plots before, lest a weight go with the error of its own
    plot, which would be a bias again (the decorrelation of Bordonaro, Willett and Bar-Shalom 2014, who take the
    predicted place). See `models.sonar.places`.
    """
    for c in range(z.shape[0]):
        w = observation.weight[k, c]
        for i in range(seen.size):
            z[c, i] = plots[c, 0, i]
            weight[c, i] = w * seen[i]
    if observation.frame == 0:
        return
    sr, sb = observation.spread[0] ** 2, observation.spread[1] ** 2
    nominal_x, nominal_y = observation.sigma[0] ** 2, observation.sigma[1] ** 2
    grow = np.exp(sb) if observation.frame == 2 else 1.0
    root, shrink = np.sqrt(grow), np.exp(-2.0 * sb)
    for i in range(seen.size):
        r, b = observation.measured[k, 0] + plots[0, 1, i], observation.measured[k, 1] + plots[1, 1, i]
        co, si = np.cos(b), np.sin(b)
        z[0, i], z[1, i] = root * r * co, root * r * si
        if observation.frame == 1:
            across = r * r * sb
            xx, yy = sr * co * co + across * si * si, sr * si * si + across * co * co
        else:
            r_now, b_now = r, b
            if place[2, i] > 0.0:
                r, b = place[0, i], place[1, i]
                co, si = np.cos(b), np.sin(b)
            if seen[i] > 0.0:
                place[2, i] = min(place[2, i] + 1.0, PLACED)
                place[0, i] += (r_now - place[0, i]) / place[2, i]
                place[1, i] += (b_now - place[1, i]) / place[2, i]
            power, twice = 0.5 * grow * (r * r + sr), shrink * (co * co - si * si)
            xx, yy = power * (1.0 + twice) - r * r * co * co, power * (1.0 - twice) - r * r * si * si
        weight[0, i], weight[1, i] = seen[i] * nominal_x / xx, seen[i] * nominal_y / yy


@kernel
def filter_scan(bank, observation, f, c, k, dt, x, y, s, memory, z, weight, before, count, q, P):
    """Scan k of filter f in coordinate c, in place: x (4, n), y (8, n), s (>= 10, n), memory (3, L, n).

    q (D, G, n) statistics of the detectors. Leaves P (6, n).
    """
    size, carry = bank.size[f], bank.carry[f, k, c]
    if bank.kind[f] == ADAPTIVE:
        rule = bank.switching
        d, length = rule.detector[f], bank.length[f]
        adapt(
            *(size, rule.raises[f], length, rule.quiet[f], rule.threshold[f, c], q[d, rule.group[f, c]]),
            *(dt, observation.period, x, y, s, memory, z, weight, before, P),
        )
        return
    if bank.kind[f] == IMM:
        models = bank.interacting
        interact(
            *(size, models.stay[f], models.manoeuvre[f, c], dt, observation.period, observation.sigma[c]),
            *(x, y, s, z, weight, before, P),
        )
        return
    if bank.kind[f] == WINDOW:
        fit(x, memory, bank.length[f], size, observation.period, count, P)
        return
    start, by_covariance = max(size, bank.length[f]), bank.kind[f] != INFORMATION
    manoeuvre, settled = bank.manoeuvre[f, c], bank.settled[f, c]
    recur(by_covariance, size, start, dt, observation.period, carry, manoeuvre, settled, x, y, s, z, weight, before, P)


@part
def add_modes(bank, s, f, c, k, used, out, modes):
    """Add the modes of filter f in coordinate c at scan k; s its memory."""
    if bank.kind[f] == ADAPTIVE:
        mode_sums(s, MODE, PLOTS, used, out)
    elif bank.kind[f] == IMM:
        mode_sums(s, PROBABILITY + 1, -1, used, out)
    else:
        return
    for j in range(3):
        modes[f, k, c, j] += out[j]


@part
def keep(x, P, count, size, unit, period, first, n, kept):
    """A coordinate's estimate and what is believed of it, of n realisations, into kept (6, total) from `first` on."""
    for i in range(n):
        kept[0, first + i], kept[1, first + i] = x[0, i], x[1, i]
        kept[5, first + i] = 1.0 if count[i] >= size else 0.0
        kept[2, first + i] = P[0, i] * unit * unit
        kept[3, first + i] = P[1, i] * unit * unit / period
        kept[4, first + i] = P[3, i] * unit * unit / (period * period)


@kernel
def simulate_block(world, observation, bank, detectors, first, total, baseline, sums, alarms, further):
    """Add the sums of realisations first … first + total - 1; a partial chunk is computed in full and summed in
    part."""
    filters, scans, coordinates = bank.carry.shape
    x, y = np.empty((filters, coordinates, 4, CHUNK)), np.empty((filters, coordinates, 8, CHUNK))
    s, P = np.empty((filters, coordinates, ROWS if (bank.kind == IMM).any() else 10, CHUNK)), np.empty((6, CHUNK))
    memory = np.empty((coordinates, 3, bank.memory, CHUNK))
    q, passed = np.empty((detectors.plots.size, coordinates + 1, CHUNK)), np.empty((*detectors.threshold.shape, CHUNK))
    plots, shift = np.empty((world.walk.size, 4, CHUNK)), np.zeros((coordinates, 3, CHUNK))
    z, weight, seen = np.empty((coordinates, CHUNK)), np.empty((coordinates, CHUNK)), np.empty(CHUNK)
    place, before, count = np.empty((3, CHUNK)), np.empty((coordinates, CHUNK)), np.empty((coordinates, CHUNK))
    used, out = np.ones(CHUNK), np.empty(7)
    order = np.append(np.array([baseline]), np.delete(np.arange(filters), baseline))  # the others are set against it
    for done in range(0, total, CHUNK):
        x[:], y[:], s[:], memory[:], plots[:], count[:], place[:] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        used[total - done :], passed[:] = 0.0, 0.0
        for k in range(scans):
            dt, truth = world.dt[k], world.truth[k]
            move_and_measure(world, first + done, k, plots)
            detect(observation, first + done, k, seen)
            weigh(observation, k, plots, seen, place, z, weight)
            shift[:, :2] = plots[:coordinates, 2:]
            if k > 0:
                add_ahead(bank.size, x, shift, truth, count, used, k, dt, out, sums)
            before[:] = count
            count += weight > 0.0
            for c in range(coordinates):
                if memory.shape[2] > 0:
                    remember(memory[c], z[c], weight[c], dt / observation.period)
            examine(detectors, k, memory, observation.sigma, count, weight, q)
            add_alarms(detectors, k, q, used, passed, alarms)
            for c in range(coordinates):
                for f in order:
                    filter_scan(
                        *(bank, observation, f, c, k, dt, x[f, c], y[f, c], s[f, c], memory[c], z[c], weight[c]),
                        *(before[c], count[c], q, P),
                    )
                    add_modes(bank, s[f, c], f, c, k, used, out, further.modes)
                    for a in range(further.at.size if c < 2 else 0):
                        if further.at[a] == k:
                            shown = min(CHUNK, total - done)
                            unit, into = observation.sigma[c], further.kept[a, f, c]
                            keep(x[f, c], P, count[c], bank.size[f], unit, observation.period, done, shown, into)
                    add_sums(
                        *(
                            bank.size[f],
                            observation.sigma[c],
                            observation.period,
                            x[f, c],
                            x[baseline, c],
                            bank.size[baseline],
                            P,
                        ),
                        *(shift[c], truth[c], count[c], used, f, k, c, out, sums),
                    )
