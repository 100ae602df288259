"""Sums over the errors of bursts: moments of the locked and of all, locks, histograms of the residuals (P4)."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel

BINS_PER_OCTAVE, FEWEST_OCTAVES, OCTAVES = 4, -6, 18  # of |e|/σ: from 1/64 to 4096, outer bins open
BINS = BINS_PER_OCTAVE * OCTAVES
# What `locks` counts, in its order: bursts within 5 and 3 potential bounds, within 5 and 3 posterior ones, and within 3
# of either at this and all earlier windows.
LOCKS = ("lock", "three", "posterior", "posterior_three", "always_three", "always_posterior_three")


class Sums(NamedTuple):
    """Sums over bursts of F estimators, K windows and C components of θ, with their shapes.

    error (F, K, C, 4)         Σe … Σe⁴ of the locked bursts, in units of the potential bound of the window
    error_all (F, K, C, 4)     the same of all bursts
    locks (F, K, 6)            counted bursts, see LOCKS
    residuals (F, K, C, BINS)  histograms of |e| over the posterior bound
    passes (F, 2)              passes over the data, and their squares
    """

    error: np.ndarray
    error_all: np.ndarray
    locks: np.ndarray
    residuals: np.ndarray
    passes: np.ndarray


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
def accumulate(errors, options, potential, posterior, sums):
    """Sums over errors (n, F, K, 6), in turns over the burst, of locked and of all realisations.

    potential and posterior (F, K, 6) are the bounds without and with the prior, in the same unit; sums is a `Sums`, of
    which `passes` stays as it is.
    """
    n, size = errors.shape[0], sums.error.shape[2]
    e, within = np.empty((size, n)), np.empty(n)
    always, always_posterior = np.empty(n), np.empty(n)
    for f in range(options.size):
        always[:], always_posterior[:] = 1.0, 1.0
        for k in range(options[f].windows):
            a, b, own = 1.0 / potential[f, k], 1.0 / posterior[f, k], sums.locks[f, k]
            for i in range(n):
                worst = worst_posterior = 0.0
                for j in range(size):
                    x = errors[i, f, k, j]
                    e[j, i] = x
                    worst, worst_posterior = max(worst, abs(x) * a[j]), max(worst_posterior, abs(x) * b[j])
                within[i] = 1.0 if worst < 5.0 else 0.0
                always[i] *= 1.0 if worst < 3.0 else 0.0
                always_posterior[i] *= 1.0 if worst_posterior < 3.0 else 0.0
                own[0] += within[i]
                own[1] += 1.0 if worst < 3.0 else 0.0
                own[2] += 1.0 if worst_posterior < 5.0 else 0.0
                own[3] += 1.0 if worst_posterior < 3.0 else 0.0
                own[4] += always[i]
                own[5] += always_posterior[i]
            for j in range(size):
                error, error_all, residuals = sums.error[f, k, j], sums.error_all[f, k, j], sums.residuals[f, k, j]
                add_component(e[j], within, a[j], b[j], error, error_all, residuals)
