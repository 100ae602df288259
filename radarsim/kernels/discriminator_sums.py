"""Sums over the errors of bursts: moments of the locked and of all, locks, histograms of the residuals (P4)."""

import numpy as np

from radarsim.kernels.compile import inline, kernel

BINS_PER_OCTAVE, FEWEST_OCTAVES, OCTAVES = 4, -6, 18  # of |e|/σ: from 1/64 to 4096, outer bins open
BINS = BINS_PER_OCTAVE * OCTAVES


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
def accumulate(errors, size, options, potential, posterior, error, error_all, locks, residuals):
    """Adds errors (n, F, K, 6), in turns over the burst, to the sums of locked and of all realisations.

    potential and posterior (F, K, 6) are the bounds without and with the prior, in the same unit. error and error_all
    (F, K, size, 4) take Σe … Σe⁴, in units of the potential bound; residuals (F, K, size, BINS) the histogram of
    |e| over the posterior bound. locks (F, K, 6) counts bursts within 5 and 3 potential bounds, within 5 and 3
    posterior ones, and within 3 potential, 3 posterior ones at this and all earlier windows.
    """
    for i in range(errors.shape[0]):
        for f in range(options.size):
            always = always_posterior = True
            for k in range(options[f].windows):
                worst = worst_posterior = 0.0
                for j in range(size):
                    e = abs(errors[i, f, k, j])
                    worst = max(worst, e / potential[f, k, j])
                    ratio = e / posterior[f, k, j]
                    worst_posterior = max(worst_posterior, ratio)
                    residuals[f, k, j, bin_of(ratio)] += 1.0
                always &= worst < 3.0
                always_posterior &= worst_posterior < 3.0
                locks[f, k, 0] += 1.0 if worst < 5.0 else 0.0
                locks[f, k, 1] += 1.0 if worst < 3.0 else 0.0
                locks[f, k, 2] += 1.0 if worst_posterior < 5.0 else 0.0
                locks[f, k, 3] += 1.0 if worst_posterior < 3.0 else 0.0
                locks[f, k, 4] += 1.0 if always else 0.0
                locks[f, k, 5] += 1.0 if always_posterior else 0.0
                for j in range(size):
                    e = errors[i, f, k, j] / potential[f, k, j]
                    ee = e * e
                    if worst < 5.0:
                        error[f, k, j, 0] += e
                        error[f, k, j, 1] += ee
                        error[f, k, j, 2] += ee * e
                        error[f, k, j, 3] += ee * ee
                    error_all[f, k, j, 0] += e
                    error_all[f, k, j, 1] += ee
                    error_all[f, k, j, 2] += ee * e
                    error_all[f, k, j, 3] += ee * ee
