"""Find the errors of a radar that its four biases do not hold, from what they leave.

Each of ERRORS is added alone and tested (`cluster_errors.evidence`). Those with a name join the model one after the
other, the best first, until none is missing; those without only say what the residuals still go with. A sound recording
is called unsound in one of a thousand: that is the chance of all tests together."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from radarsim.recordings.formats.records import BIASES
from radarsim.recordings.registration.cluster_errors import evidence, half_widths
from radarsim.recordings.registration.matched_plots import (
    COEFFICIENTS,
    ERRORS,
    SensorError,
    coefficient_indices,
    fitted_indices,
    fixed_values,
)
from radarsim.recordings.registration.robust_fit import RobustFit, robust_fit

FALSE_ALARMS = 1e-3  # of all tests of a recording together
WITHOUT_ONE = 0.01  # of each test that leaves out an aircraft
DISTINCT = 0.01  # of an error, given another that would explain the same
POSSIBLE = 0.2  # of an error that may be there: the fit is better by about as much as Akaike's criterion asks
MAX_VARIANCE_INFLATION = 100.0  # of a coefficient by the others, from which they cannot be distinguished
MAX_RIVAL_INFLATION = 1e6  # the same, of an error beside another that would explain the same
TRIAL_TOLERANCE = 1e-3  # of the last step of a fit, in standard errors
MIN_MOVEMENT_M = 1.0  # of a plot by an error: positions are no better
MAX_ERRORS = 4  # that are fitted together
FIXED_TOLERANCE = 2.5  # half widths of its interval from the one value that a coefficient can have


RANGE_SCALE = COEFFICIENTS.index("range_scale")


class ModelCheck(NamedTuple):
    """The named errors that the plots show, with those that explain the same as well; the errors without a name that
    remain; intervals (coefficients, 2) that allow for what is possible, to be joined with those of the fit."""

    causes: tuple[SensorError, ...]
    rivals: dict[str, tuple[SensorError, ...]]
    unexplained: tuple[SensorError, ...]
    allowance: np.ndarray


class _Trial(NamedTuple):
    """A fit with one more error: the fit, its coefficients, how likely the error is by chance, and how far it moves a
    plot at most."""

    fit: RobustFit
    is_used: np.ndarray
    probability: float
    probability_without_one: float
    movement_m: float

    def is_certain(self, tests: int, spread: float) -> bool:
        """Whether the error is no chance in so many tests, nor one aircraft's, and leaves less than the spread."""
        is_proven = self.probability * tests < FALSE_ALARMS and self.probability_without_one < WITHOUT_ONE
        return is_proven and self.movement_m > MIN_MOVEMENT_M and self.fit.spread < spread


class ModelChecker:
    """Tests of further errors around a fit of the biases, in which plots move linearly with every coefficient."""

    def __init__(self, fit: RobustFit, is_used: np.ndarray, clusters: np.ndarray, smallest: np.ndarray):
        self.fit, self.is_used, self.clusters, self.smallest = fit, is_used, clusters, smallest
        self.target = fit.errors + fit.slopes @ fit.values
        self.metres = np.stack([np.ones(len(clusters)), fit.slopes[:, 0, RANGE_SCALE]], axis=1)  # of range and bearing
        design = (fit.slopes / fit.sigma[:, None]).reshape(-1, len(COEFFICIENTS))
        size = np.linalg.norm(design, axis=0)
        design /= np.where(size > 0, size, 1.0)
        self.gram = design.T @ design  # cosines between the movements of plots by the coefficients
        self.tests = len(COEFFICIENTS) - len(BIASES)

    def check(self) -> ModelCheck:
        """What the biases do not hold."""
        causes: list[SensorError] = []
        trials, spread = self._trials(causes, ERRORS), self.fit.spread
        competitors: dict[str, list[SensorError]] = {}
        for _ in range(MAX_ERRORS):
            certain = {error: trial for error, trial in trials.items() if trial.is_certain(self.tests, spread)}
            candidates = [error for error in certain if error.name and self._is_possible(error, certain[error])]
            if not candidates:
                break
            best = min(candidates, key=lambda error: certain[error].fit.spread)
            spread = certain[best].fit.spread
            competitors[best.name] = [error for error in candidates if error is not best]
            causes.append(best)
            causes = [error for error in causes if error is best or self._is_distinct(error, causes)]
            trials = self._trials(causes, [error for error in ERRORS if error not in causes])
        rivals, allowance = {}, self._allowance(trials)
        for cause in causes:
            competing = [error for error in competitors[cause.name] if error not in causes]
            rivals[cause.name] = tuple(error for error in competing if not self._is_distinct(cause, [*causes, error]))
            for rival in rivals[cause.name]:
                trial = self._trial([error for error in causes if error is not cause], rival)
                allowance = _joined(allowance, self._interval(trial)) if trial else allowance
        unexplained = tuple(
            error for error, trial in trials.items() if not error.name and trial.is_certain(self.tests, spread)
        )
        return ModelCheck(tuple(causes), rivals, unexplained, allowance)

    def _trials(self, causes: Sequence[SensorError], errors: Sequence[SensorError]) -> dict[SensorError, _Trial]:
        trials = {error: self._trial(causes, error) for error in errors}
        return {error: trial for error, trial in trials.items() if trial}

    def _trial(
        self, causes: Sequence[SensorError], error: SensorError, max_inflation: float = MAX_VARIANCE_INFLATION
    ) -> _Trial | None:
        """The fit with an error besides these causes; None where it moves the plots as they and the biases do."""
        is_used, indices = self.is_used.copy(), coefficient_indices(error)
        is_used[fitted_indices(causes)] = True
        if any(self._variance_inflation(is_used, indices, k) > max_inflation for k in indices):
            return None
        is_used[indices] = True
        columns = self.fit.slopes[..., is_used]
        target = self.target - self.fit.slopes @ fixed_values(causes)
        fit = robust_fit(
            lambda values: (target - columns @ values, columns),
            self.fit.values[is_used],
            np.ones(columns.shape[-1], dtype=bool),
            self.smallest,
            TRIAL_TOLERANCE,
        )
        values = np.zeros(len(is_used))
        values[is_used] = fit.values
        fit = RobustFit(values, fit.sigma, fit.errors, self.fit.slopes)
        tests = [evidence(fit, self.clusters, is_used, k) for k in indices]
        best = min(tests)
        moves = np.abs(self.fit.slopes[..., indices] @ values[indices]) * self.metres
        return _Trial(fit, is_used, best.probability, best.probability_without_one, float(moves.max()))

    def _variance_inflation(self, is_used: np.ndarray, indices: Sequence[int], index: int) -> float:
        """The variance inflation of a coefficient by those used and the others of its error."""
        columns = [k for k in range(len(is_used)) if (is_used[k] or k in indices) and k != index]
        if self.gram[index, index] == 0:
            return np.inf
        likeness = self.gram[columns, index]
        shares = np.linalg.lstsq(self.gram[np.ix_(columns, columns)], likeness, rcond=1e-12)[0]
        return 1 / max(1 - float(likeness @ shares), 1e-12)

    def _is_possible(self, error: SensorError, trial: _Trial) -> bool:
        """Whether a coefficient that can have one value alone has it."""
        if math.isnan(error.fixed):
            return True
        (k,) = coefficient_indices(error)
        half_width = half_widths(trial.fit, self.clusters, trial.is_used)[k]
        return bool(abs(trial.fit.values[k] - error.fixed) < FIXED_TOLERANCE * half_width)

    def _is_distinct(self, error: SensorError, causes: Sequence[SensorError]) -> bool:
        """Whether an error shows beside the other causes."""
        trial = self._trial([cause for cause in causes if cause is not error], error, MAX_RIVAL_INFLATION)
        return trial is not None and trial.probability < DISTINCT

    def _allowance(self, trials: dict[SensorError, _Trial]) -> np.ndarray:
        """The hull of the intervals with each error that is possible but not certain."""
        hull = np.tile([np.inf, -np.inf], (len(COEFFICIENTS), 1))
        for error, trial in trials.items():
            if error.widens and trial.probability < POSSIBLE:
                hull = _joined(hull, self._interval(trial))
        return hull

    def _interval(self, trial: _Trial) -> np.ndarray:
        width = half_widths(trial.fit, self.clusters, trial.is_used)
        return np.stack([trial.fit.values - width, trial.fit.values + width], axis=1)


def _joined(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The hulls of pairs of intervals (n, 2)."""
    return np.stack([np.minimum(first[:, 0], second[:, 0]), np.maximum(first[:, 1], second[:, 1])], axis=1)
