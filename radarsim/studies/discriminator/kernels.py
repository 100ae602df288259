"""Sums over the errors of bursts: moments of the locked and of all, locks, histograms of the residuals (P4).

Bursts whose noise is shifted towards a loss of lock, and the weights that make up for it (importance sampling).

The unit normals z of a burst are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the law that they should have to the one that they have is

    w(z) = 1 / (α₀ + Σ α_m e^{s_m u_mᵀ z − s_m²/2}),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135)."""

import math
from typing import NamedTuple

import numpy as np

from radarsim.bursts.kernels.lanes import PRIOR, lane
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put
from radarsim.kernels.random import part_of

# ---- sums ------------------------------------------------------------------------------------------------------------
BINS_PER_OCTAVE, FEWEST_OCTAVES, OCTAVES = 4, -6, 18  # of |e|/σ: from 1/64 to 4096, outer bins open
BINS = BINS_PER_OCTAVE * OCTAVES
# What `locks` counts, in its order: bursts within 5 and 3 potential bounds, within 5 and 3 posterior ones, and within 3
# of either at this and all earlier windows.
LOCKS = ("lock", "three", "posterior", "posterior_three", "always_three", "always_posterior_three")


class Sums(NamedTuple):
    """Sums over bursts of F estimators, K windows and C components of θ, with their shapes."""

    error: np.ndarray  #: (F, K, C, 4) Σe … Σe⁴ of the locked bursts, in units of the potential bound of the window
    error_all: np.ndarray  #: (F, K, C, 4) the same of all bursts
    locks: np.ndarray  #: (F, K, 6) counted bursts, see LOCKS
    residuals: np.ndarray  #: (F, K, C, BINS) histograms of |e| over the posterior bound
    passes: np.ndarray  #: (F, 2) passes over the data, and their squares


@inline
def bin_of(ratio):
    """Quarter octave of a positive number: exponent and two bits of the mantissa are the number's own leading bits."""
    index = (np.float64(ratio).view(np.int64) >> np.int64(50)) - np.int64(BINS_PER_OCTAVE * (1023 + FEWEST_OCTAVES))
    return min(max(index, np.int64(0)), np.int64(BINS - 1))


def bin_edges() -> np.ndarray:
    """Edges (BINS + 1,) of the bins of |e|/σ."""
    octave, quarter = np.divmod(np.arange(BINS + 1), BINS_PER_OCTAVE)
    return 2.0 ** (octave + FEWEST_OCTAVES) * (1.0 + quarter / BINS_PER_OCTAVE)


@kernel
def add_component(e, within, potential, posterior, error, error_all, residuals):
    """Adds one component's errors e (n,) of a window, see `accumulate`; within (n,) is 1 where the burst is locked."""
    a1 = a2 = a3 = a4 = l1 = l2 = l3 = l4 = 0.0
    for i in range(e.size):
        x = e[i] * potential
        xx, locked = x * x, within[i]
        a1, a2, a3, a4 = a1 + x, a2 + xx, a3 + xx * x, a4 + xx * xx
        l1, l2, l3, l4 = l1 + locked * x, l2 + locked * xx, l3 + locked * (xx * x), l4 + locked * (xx * xx)
        residuals[bin_of(abs(e[i]) * posterior)] += 1.0
    error_all[0], error_all[1], error_all[2], error_all[3] = a1, a2, a3, a4
    error[0], error[1], error[2], error[3] = l1, l2, l3, l4


@kernel
def judge(errors, potential, posterior, windows, met):
    """Which of LOCKS hold, 1 or 0, into met (n, K, 6), of errors (n, K, 6) of an estimator of so many windows.

    potential and posterior (K, C) are the bounds without and with the prior, of the C components that count."""
    for i in range(errors.shape[0]):
        always = always_posterior = 1.0
        for k in range(windows):
            worst = worst_posterior = 0.0
            for j in range(potential.shape[1]):
                x = abs(errors[i, k, j])
                worst = max(worst, x * (1.0 / potential[k, j]))
                worst_posterior = max(worst_posterior, x * (1.0 / posterior[k, j]))
            always *= 1.0 if worst < 3.0 else 0.0
            always_posterior *= 1.0 if worst_posterior < 3.0 else 0.0
            met[i, k, 0] = 1.0 if worst < 5.0 else 0.0
            met[i, k, 1] = 1.0 if worst < 3.0 else 0.0
            met[i, k, 2] = 1.0 if worst_posterior < 5.0 else 0.0
            met[i, k, 3] = 1.0 if worst_posterior < 3.0 else 0.0
            met[i, k, 4] = always
            met[i, k, 5] = always_posterior


@kernel
def accumulate(errors, options, potential, posterior, sums):
    """Sums over errors (n, F, K, 6), in turns over the burst, of locked and of all realisations.

    potential and posterior (F, K, 6) are the bounds without and with the prior, in the same unit; sums is a `Sums`, of
    which `passes` stays as it is."""
    n, size = errors.shape[0], sums.error.shape[2]
    e, within, met = np.empty(n), np.empty(n), np.empty((n, errors.shape[2], len(LOCKS)))
    for f in range(options.size):
        judge(errors[:, f], potential[f, :, :size], posterior[f, :, :size], options[f].windows, met)
        for k in range(options[f].windows):
            for i in range(n):
                within[i] = met[i, k, 0]
                for lock in range(len(LOCKS)):
                    sums.locks[f, k, lock] += met[i, k, lock]
            for j in range(size):
                for i in range(n):
                    e[i] = errors[i, f, k, j]
                error, error_all, residuals = sums.error[f, k, j], sums.error_all[f, k, j], sums.residuals[f, k, j]
                add_component(
                    e, within, 1.0 / potential[f, k, j], 1.0 / posterior[f, k, j], error, error_all, residuals
                )


@kernel
def accumulate_losses(errors, options, potential, posterior, weights, losses):
    """Adds to losses (F, K, 6, 4), of what LOCKS counts, the bursts that fail it: Σw, Σw², their number, Σw⁴.

    errors (n, F, K, 6), potential and posterior as for `accumulate`; weights (n,) of the bursts. Components that
    are not used have no error."""
    n = errors.shape[0]
    met = np.empty((n, errors.shape[2], len(LOCKS)))
    for f in range(options.size):
        judge(errors[:, f], potential[f], posterior[f], options[f].windows, met)
        for k in range(options[f].windows):
            for i in range(n):
                for lock in range(len(LOCKS)):
                    if met[i, k, lock] == 0.0:
                        # As `add_weight`, which is compiled to other last digits here.
                        losses[f, k, lock, 0] += weights[i]
                        losses[f, k, lock, 1] += weights[i] * weights[i]
                        losses[f, k, lock, 2] += 1.0
                        losses[f, k, lock, 3] += weights[i] ** 4


# ---- rare ------------------------------------------------------------------------------------------------------------
class Mixture(NamedTuple):
    """A mixture of M directions beside the plain law, over the normals of the forecast and of B blocks."""

    cumulative: np.ndarray  #: (M + 1,) running sums of the shares α, the plain one first; the last is 1
    shift: np.ndarray  #: (M,) s_m
    forecast: np.ndarray  #: (M, 6) u_m's part in the forecast's normals, times their σ: turns over the burst
    weight: np.ndarray  #: (M, 6) u_m's part over these σ, zero where one is zero
    first: np.ndarray  #: (M, 2B) u_m's part in the first normals of the draws, and
    second: np.ndarray  #: (M, 2B) in the second ones


@kernel
def choose(key, first, cumulative, chosen):
    """Which part of the mixture each of realisations first, first + 1, … is drawn from, into chosen (n,). 0 is the
    plain law, m the shift along direction m − 1."""
    for i in range(chosen.size):
        chosen[i] = part_of(key, cumulative, first + i)


@kernel
def move(mixture, chosen, work, a, b):
    """Shifts the forecasts in work and the normals a and b (2B rows of eight) of eight bursts as chosen (8,) says."""
    for n in range(WIDTH):
        if chosen[n] == 0:
            continue
        m = chosen[n] - 1
        step = mixture.shift[m]
        for j in range(SIZE):
            work[lane(PRIOR + j, n)] += step * mixture.forecast[m, j]
        for r in range(mixture.first.shape[1]):
            a[lane(r, n)] += step * mixture.first[m, r]
            b[lane(r, n)] += step * mixture.second[m, r]


@part
def project(mixture, m, work, a, b, along):
    """u_mᵀ z of eight bursts into the row along; all but the mixture are addresses."""
    x = full(0.0)
    for j in range(SIZE):
        x = x + mixture.weight[m, j] * get(work, PRIOR + j)
    for r in range(mixture.first.shape[1]):
        x = x + mixture.first[m, r] * get(a, r) + mixture.second[m, r] * get(b, r)
    put(along, 0, x)


@kernel
def weigh(mixture, work, a, b, along, weights):
    """Weights (n,) of up to eight bursts from the forecasts in work and normals a and b; along has room for a row."""
    law, shift = mixture.cumulative, mixture.shift
    density = np.full(WIDTH, law[0])
    for m in range(shift.size):
        project(mixture, m, address(work), address(a), address(b), address(along))
        share, level = law[m + 1] - law[m], 0.5 * shift[m] * shift[m]
        for n in range(WIDTH):
            density[n] += share * math.exp(shift[m] * along[n] - level)
    for n in range(weights.size):
        weights[n] = 1.0 / density[n]
