"""Detectors of manoeuvres and the filters that respond to them, as the arrays that the kernels take."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.studies.sonar.kernels.detector import AdaptiveRules, Detectors
from radarsim.studies.sonar.kernels.imm import ModelPairs


class AdaptiveRule(NamedTuple):
    """How an adaptive filter responds: threshold (C,) of its detector, tests every so many scans, jointly or not.

    raises the degree, else holds its memory short; quiet tests without an alarm end the manoeuvre.
    """

    threshold: np.ndarray
    every: int
    joint: bool
    raises: bool
    quiet: int


class ModelPair(NamedTuple):
    """Two models that interact: manoeuvre variances (C, 2), probabilities (2,) to last from scan to scan."""

    variance: np.ndarray
    stay: np.ndarray


@dataclass(frozen=True)
class DetectorTests:
    """All tests of a case: (plots, scans from one to the next) of each, and thresholds (G, T) of the measured ones.

    The measured ones come first; the others are what adaptive filters need.
    """

    kinds: tuple[tuple[int, int], ...]
    thresholds: tuple[np.ndarray, ...] = ()

    @property
    def longest(self) -> int:
        """Plots that must be kept."""
        return max((plots for plots, _ in self.kinds), default=0)


def detector_tests(
    measured: Sequence[tuple[int, int]], thresholds: Sequence[np.ndarray], responses: Sequence
) -> DetectorTests:
    """The measured detectors, then those of adaptive filters not among them; responses: (rule or None, plots)."""
    kinds = list(measured)
    for response, plots in responses:
        if isinstance(response, AdaptiveRule) and (plots, response.every) not in kinds:
            kinds.append((plots, response.every))
    return DetectorTests(tuple(kinds), tuple(thresholds))


def detector_arrays(tests: DetectorTests, phase: np.ndarray, coordinates: int) -> Detectors:
    """The kernels' detectors; phase (K,) of the manoeuvre."""
    count = [limits.shape[1] for limits in tests.thresholds] + [0] * (len(tests.kinds) - len(tests.thresholds))
    threshold = np.zeros((len(tests.kinds), coordinates + 1, max(count, default=0)))
    for d, limits in enumerate(tests.thresholds):
        threshold[d, :, : limits.shape[1]] = limits
    return Detectors(
        plots=np.array([plots for plots, _ in tests.kinds], dtype=np.int64),
        every=np.array([every for _, every in tests.kinds], dtype=np.int64),
        threshold=threshold,
        thresholds=np.array(count, dtype=np.int64),
        phase=phase,
    )


def adaptive_rules(responses: Sequence, plots: Sequence[int], tests: DetectorTests, coordinates: int) -> AdaptiveRules:
    """Rules of F filters; those of filters without one are not read."""
    F = len(responses)
    detector, group = np.zeros(F, dtype=np.int64), np.zeros((F, coordinates), dtype=np.int64)
    threshold, raises, quiet = np.zeros((F, coordinates)), np.zeros(F, dtype=np.bool_), np.ones(F, dtype=np.int64)
    for f, rule in enumerate(responses):
        if isinstance(rule, AdaptiveRule):
            detector[f] = tests.kinds.index((plots[f], rule.every))
            group[f] = coordinates if rule.joint else np.arange(coordinates)
            threshold[f], raises[f], quiet[f] = rule.threshold, rule.raises, rule.quiet
    return AdaptiveRules(detector, group, threshold, raises, quiet)


def model_pairs(responses: Sequence, sizes: Sequence[int], period: float, nominal: np.ndarray) -> ModelPairs:
    """Models of F filters in nominal plots (C,) and periods; those of filters without any are not read."""
    manoeuvre, stay = np.zeros((len(responses), len(nominal), 2)), np.full((len(responses), 2), 0.5)
    for f, models in enumerate(responses):
        if isinstance(models, ModelPair):
            manoeuvre[f] = models.variance * period ** (2 * sizes[f]) / nominal[:, None] ** 2
            stay[f] = models.stay
    return ModelPairs(manoeuvre, stay)
