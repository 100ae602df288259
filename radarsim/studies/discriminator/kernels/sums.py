"""Sums over the errors of bursts: moments, locks, histograms."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel

BINS_PER_OCTAVE, MIN_OCTAVE, OCTAVES = 4, -6, 18  # of |e|/σ: from 1/64 to 4096, outer bins open
BINS = BINS_PER_OCTAVE * OCTAVES
# What `locks` counts, in its order: bursts within 5 and 3 Cramér–Rao bounds, within 5 and 3 posterior ones, and within
# 3 of either at this and all earlier windows.
LOCKS = ("lock", "three", "posterior", "posterior_three", "always_three", "always_posterior_three")


class Sums(NamedTuple):
    """Sums over bursts of F estimators, K windows and C components of θ, with their shapes."""

    error: np.ndarray  #: (F, K, C, 4) Σe … Σe⁴ of the locked bursts, in units of the Cramér–Rao bound of the window
    error_all: np.ndarray  #: (F, K, C, 4) the same of all bursts
    locks: np.ndarray  #: (F, K, 6) counted bursts, see LOCKS
    residuals: np.ndarray  #: (F, K, C, BINS) histograms of |e| over the posterior bound
    passes: np.ndarray  #: (F, 2) passes over the data, and their squares


@inline
def bin_index(ratio):
    """Quarter octave of a positive number: exponent and two bits of the mantissa are the number's own leading bits."""
    index = (np.float64(ratio).view(np.int64) >> np.int64(50)) - np.int64(BINS_PER_OCTAVE * (1023 + MIN_OCTAVE))
    return min(max(index, np.int64(0)), np.int64(BINS - 1))


def bin_edges() -> np.ndarray:
    """Edges (BINS + 1,) of the bins of |e|/σ."""
    octave, quarter = np.divmod(np.arange(BINS + 1), BINS_PER_OCTAVE)
    return 2.0 ** (octave + MIN_OCTAVE) * (1.0 + quarter / BINS_PER_OCTAVE)


@kernel
def add_component(e, within, potential, posterior, error, error_all, residuals):
    """Add one component's errors e (n,) of a window, see `accumulate`; within (n,) is 1 where the burst is locked."""
    a1 = a2 = a3 = a4 = l1 = l2 = l3 = l4 = 0.0
    for i in range(e.size):
        x = e[i] * potential
        xx, locked = x * x, within[i]
        a1, a2, a3, a4 = a1 + x, a2 + xx, a3 + xx * x, a4 + xx * xx
        l1, l2, l3, l4 = l1 + locked * x, l2 + locked * xx, l3 + locked * (xx * x), l4 + locked * (xx * xx)
        residuals[bin_index(abs(e[i]) * posterior)] += 1.0
    error_all[0], error_all[1], error_all[2], error_all[3] = a1, a2, a3, a4
    error[0], error[1], error[2], error[3] = l1, l2, l3, l4


@kernel
def mark_locks(errors, potential, posterior, windows, lock_flags):
    """Write which of LOCKS hold, 1 or 0, into lock_flags (n, K, 6), for errors (n, K, 6) of an estimator.

    potential and posterior (K, C) are the bounds without and with the prior, of the C components that count;
    windows is the number of windows that the estimator has."""
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
            lock_flags[i, k, 0] = 1.0 if worst < 5.0 else 0.0
            lock_flags[i, k, 1] = 1.0 if worst < 3.0 else 0.0
            lock_flags[i, k, 2] = 1.0 if worst_posterior < 5.0 else 0.0
            lock_flags[i, k, 3] = 1.0 if worst_posterior < 3.0 else 0.0
            lock_flags[i, k, 4] = always
            lock_flags[i, k, 5] = always_posterior


@kernel
def accumulate(errors, options, potential, posterior, sums):
    """Accumulate errors (n, F, K, 6), in turns over the burst, of locked and of all realisations.

    potential and posterior (F, K, 6) are the bounds without and with the prior, in the same unit; sums is a `Sums`, of
    which `passes` stays as it is."""
    n, size = errors.shape[0], sums.error.shape[2]
    e, within, lock_flags = np.empty(n), np.empty(n), np.empty((n, errors.shape[2], len(LOCKS)))
    for f in range(options.size):
        mark_locks(errors[:, f], potential[f, :, :size], posterior[f, :, :size], options[f].windows, lock_flags)
        for k in range(options[f].windows):
            for i in range(n):
                within[i] = lock_flags[i, k, 0]
                for lock in range(len(LOCKS)):
                    sums.locks[f, k, lock] += lock_flags[i, k, lock]
            for j in range(size):
                for i in range(n):
                    e[i] = errors[i, f, k, j]
                error, error_all, residuals = sums.error[f, k, j], sums.error_all[f, k, j], sums.residuals[f, k, j]
                add_component(
                    e, within, 1.0 / potential[f, k, j], 1.0 / posterior[f, k, j], error, error_all, residuals
                )


@kernel
def accumulate_losses(errors, options, potential, posterior, weights, losses):
    """Add to losses (F, K, 6, 4) the bursts that fail each condition of LOCKS: Σw, Σw², their number, Σw⁴.

    errors (n, F, K, 6), potential and posterior as for `accumulate`; weights (n,) of the bursts. Components that
    are not used have no error."""
    n = errors.shape[0]
    lock_flags = np.empty((n, errors.shape[2], len(LOCKS)))
    for f in range(options.size):
        mark_locks(errors[:, f], potential[f], posterior[f], options[f].windows, lock_flags)
        for k in range(options[f].windows):
            for i in range(n):
                for lock in range(len(LOCKS)):
                    if lock_flags[i, k, lock] == 0.0:
                        # As `mixtures.add_event_weight`, which is compiled to other last digits here.
                        losses[f, k, lock, 0] += weights[i]
                        losses[f, k, lock, 1] += weights[i] * weights[i]
                        losses[f, k, lock, 2] += 1.0
                        losses[f, k, lock, 3] += weights[i] ** 4
