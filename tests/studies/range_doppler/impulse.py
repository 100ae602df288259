"""σ of the textbook filter without a recursion for errors: from its weights of every plot, found by impulses."""

import numpy as np

from tests.studies.range_doppler import naive


def sigmas(observes, scans, variance, sigma, dt, start=None):
    """σ (3,) at the last of `scans` plots of a filter on plots of a truth that it follows exactly.

    The filter is linear in its plots, so an impulse in one of them gives its weight of that one.
    """
    square = np.zeros(3)
    for k in range(scans):
        for i in range(observes):
            plots = np.zeros((scans, 2))
            plots[k, i] = sigma[i]
            estimates, _ = naive.kalman(plots, observes, start or (3, 2)[observes - 1], variance, sigma, dt)
            square += estimates[-1] ** 2
    return np.sqrt(square)


def gains(scans, variance, sigma, dt):
    """Gains (3,) of range and velocity against the range alone, per cent."""
    return 100 * (1 - sigmas(2, scans, variance, sigma, dt) / sigmas(1, scans, variance, sigma, dt))
