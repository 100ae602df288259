"""Detectors of manoeuvres and the filters that answer to them, as the arrays that the kernels take."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.studies.sonar.manoeuvre.kernels.detector import Switching, Watch
from radarsim.studies.sonar.manoeuvre.kernels.imm import Interacting


class Rule(NamedTuple):
    """How an adaptive filter answers: threshold (C,) of its detector, tests every so many scans, jointly or not.

    raises the degree, else holds its memory short; quiet tests without an alarm end the manoeuvre.
    """

    threshold: np.ndarray
    every: int
    joint: bool
    raises: bool
    quiet: int


class Models(NamedTuple):
    """Two models that interact: manoeuvre variances (C, 2), probabilities (2,) to last from scan to scan."""

    variance: np.ndarray
    stay: np.ndarray


@dataclass(frozen=True)
class Trials:
    """All tests of a case: (plots, scans from one to the next) of each, and thresholds (G, T) of the measured ones.

    The measured ones come first; the others are what adaptive filters lean on.
    """

    kinds: tuple[tuple[int, int], ...]
    thresholds: tuple[np.ndarray, ...] = ()

    @property
    def longest(self) -> int:
        """Plots that must be kept."""
        return max((plots for plots, _ in self.kinds), default=0)


def trials_of(measured: Sequence[tuple[int, int]], thresholds: Sequence[np.ndarray], answers: Sequence) -> Trials:
    """The measured detectors, then those of adaptive filters not among them; answers: (rule or None, plots)."""
    kinds = list(measured)
    for answer, plots in answers:
        if isinstance(answer, Rule) and (plots, answer.every) not in kinds:
            kinds.append((plots, answer.every))
    return Trials(tuple(kinds), tuple(thresholds))


def watch(trials: Trials, phase: np.ndarray, coordinates: int) -> Watch:
    """The kernels' detectors; phase (K,) of the manoeuvre."""
    count = [limits.shape[1] for limits in trials.thresholds] + [0] * (len(trials.kinds) - len(trials.thresholds))
    threshold = np.zeros((len(trials.kinds), coordinates + 1, max(count, default=0)))
    for d, limits in enumerate(trials.thresholds):
        threshold[d, :, : limits.shape[1]] = limits
    return Watch(
        plots=np.array([plots for plots, _ in trials.kinds], dtype=np.int64),
        every=np.array([every for _, every in trials.kinds], dtype=np.int64),
        threshold=threshold,
        thresholds=np.array(count, dtype=np.int64),
        phase=phase,
    )


def switching(answers: Sequence, plots: Sequence[int], trials: Trials, coordinates: int) -> Switching:
    """Rules of F filters; those of filters without one are not read."""
    F = len(answers)
    detector, group = np.zeros(F, dtype=np.int64), np.zeros((F, coordinates), dtype=np.int64)
    threshold, raises, quiet = np.zeros((F, coordinates)), np.zeros(F, dtype=np.bool_), np.ones(F, dtype=np.int64)
    for f, rule in enumerate(answers):
        if isinstance(rule, Rule):
            detector[f] = trials.kinds.index((plots[f], rule.every))
            group[f] = coordinates if rule.joint else np.arange(coordinates)
            threshold[f], raises[f], quiet[f] = rule.threshold, rule.raises, rule.quiet
    return Switching(detector, group, threshold, raises, quiet)


def interacting(answers: Sequence, sizes: Sequence[int], period: float, nominal: np.ndarray) -> Interacting:
    """Models of F filters in nominal plots (C,) and periods; those of filters without any are not read."""
    manoeuvre, stay = np.zeros((len(answers), len(nominal), 2)), np.full((len(answers), 2), 0.5)
    for f, models in enumerate(answers):
        if isinstance(models, Models):
            manoeuvre[f] = models.variance * period ** (2 * sizes[f]) / nominal[:, None] ** 2
            stay[f] = models.stay
    return Interacting(manoeuvre, stay)
