"""Filters that respond to manoeuvres, run over recorded plots by the kernels of the simulation.

The kernels process a chunk of realisations; here all of them are the same track.
"""

from collections.abc import Sequence

import numpy as np

from radarsim.studies.sonar import filters as banks
from radarsim.studies.sonar.filters import detector_arrays
from radarsim.studies.sonar.kernels import detector, patterns
from radarsim.studies.sonar.kernels.detector import ROWS
from radarsim.studies.sonar.kernels.shared_gains import CHUNK
from radarsim.studies.sonar.kernels.steps import ROW, remember


def estimate_recorded(
    specs: Sequence[banks.FilterSpec],
    t: np.ndarray,
    period: float,
    sigma: np.ndarray,
    z: np.ndarray,
    weight: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (F, n, C, 3) and covariances (F, n, C, 3, 3) from plots z (C, n) of weights (C, n), zero where missing.

    t (n,) in s; sigma (C,) of a plot of weight one. A detector that tests every so many scans counts the rows.
    """
    F, C, n = len(specs), len(z), len(t)
    detectors = detector_arrays([], banks.needed_tests(specs), np.zeros(n, dtype=np.int64), C)
    bank = banks.per_realisation_bank(specs, t, period, sigma, detectors)
    x, Y, further = (np.zeros((F, C, rows, CHUNK)) for rows in (4, 8, ROWS))
    filters = patterns.Filters(x, Y, further, np.empty((6, CHUNK)))
    recent, T = np.zeros((C, 3, bank.memory, ROW)), np.zeros((len(detectors.plots), C + 1, CHUNK))
    count = np.zeros((C, CHUNK))
    estimates, covariances = np.zeros((F, n, C, 3)), np.zeros((F, n, C, 3, 3))
    scale = period ** -np.arange(3.0)
    packed = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    for k, dt in enumerate(np.diff(t, prepend=t[0])):
        plot, w = (np.repeat(values[:, k : k + 1], CHUNK, axis=1) for values in (z, weight))
        before, count = count, count + (w > 0)
        for c in range(C if bank.memory else 0):
            remember(recent[c], plot[c], w[c], dt / period)
        detector.detector_statistics(detectors, k, recent, sigma, count, w, T)
        plots = patterns.Plots(plot, w, before, count, recent, T)
        for f, c in np.ndindex(F, C):
            patterns.filter_scan(bank, f, c, k, dt, filters, plots)
            estimates[f, k, c] = x[f, c, :3, 0]
            covariances[f, k, c] = filters.P[packed, 0] * sigma[c] ** 2 * np.outer(scale, scale)
    return estimates, covariances
