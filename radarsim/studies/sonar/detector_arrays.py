"""Manoeuvre detectors as arrays for the kernels, and how filters respond to manoeuvres."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.studies.sonar.kernels.detector import Detectors


class AdaptiveRule(NamedTuple):
    """How an adaptive filter responds to its detector."""

    threshold: np.ndarray  #: (C,) of the statistic
    every: int  #: scans from one test to the next
    joint: bool  #: one test of all coordinates
    raises: bool  #: an alarm raises the degree, else it keeps the memory short
    quiet: int  #: tests without an alarm that end the manoeuvre


class ModelPair(NamedTuple):
    """Two models that interact: manoeuvre variances (C, 2), probabilities (2,) to last from scan to scan."""

    variance: np.ndarray
    stay: np.ndarray


class DetectorTest(NamedTuple):
    """A test of the last plots every so many scans, with thresholds (G, T); no thresholds if only a filter needs it."""

    plots: int
    every: int
    thresholds: np.ndarray


def detector_arrays(
    measured: Sequence[DetectorTest], needed: Iterable[tuple[int, int]], phase: np.ndarray, coordinates: int
) -> Detectors:
    """The measured detectors, then those that adaptive filters need in addition; phase (K,) of the manoeuvre.

    needed holds plots, and scans from one test to the next."""
    tests, no_thresholds = list(measured), np.zeros((coordinates + 1, 0))
    for plots, every in needed:
        if (plots, every) not in [test[:2] for test in tests]:
            tests.append(DetectorTest(plots, every, no_thresholds))
    count = np.array([test.thresholds.shape[1] for test in tests], dtype=np.int64)
    threshold = np.zeros((len(tests), coordinates + 1, max(count, default=0)))
    for d, test in enumerate(tests):
        threshold[d, :, : count[d]] = test.thresholds
    return Detectors(
        plots=np.array([test.plots for test in tests], dtype=np.int64),
        every=np.array([test.every for test in tests], dtype=np.int64),
        threshold=threshold,
        thresholds=count,
        phase=phase,
    )
