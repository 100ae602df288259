"""The maximum of a likelihood over all its keys, and the profile interval of each.

An interval consists of the values of a key at which the largest log-likelihood over all other keys is within half the
95 % point of chi-square of the maximum (profile likelihood)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.recordings.fit.likelihood_slice import (
    IMPOSSIBLE_LOG_LIKELIHOOD,
    ROUGH_ACCURACY,
    Progress,
    single_explanations,
    starting_values,
)
from radarsim.recordings.fit.newton_steps import FIRST_STEP, TOLERANCE, Curvature, polish_maximum
from radarsim.studies.error_law import NEAR, NEAR_WIDTH, OUTLIERS, ErrorLaw
from radarsim.studies.recording_interface import Likelihood

# likelihood evaluations of a key to the maximum and to an end; of an explanation
MAXIMUM_EVALUATIONS = 130
END_EVALUATIONS = 15
EXPLANATION_EVALUATIONS = 60

HALF_CHI2_95 = 1.9207294103470  # half the 95 % point of chi-square with one degree of freedom
ROUGH_TOLERANCE = 1e-4
INTERVAL_REACH = 1e4  # ratio to the estimate up to which an end of an interval is searched
MAX_NEWTON_STEPS = 40
SIMPLEX_EVALUATIONS = (50, 100, 200)  # evaluations of a simplex before Newton steps are tried again
TRIAL_FALLS = np.array([2.0, 4.0, 6.0])  # below these a key that may be zero is clearly not zero, in that logarithm
TRIAL_RISES = np.arange(1.0, 16.0)  # above what counts as zero: where a key at zero is tried
NEAR_ZERO_LOG = 7.0  # above the value that counts as zero, in that logarithm: zero is tried
SMALL_GAIN_FACTOR = 300.0  # times the accuracy: a Newton step that gains no more ends the search
MIN_OUTLIER_SHARE = 1e-6  # of near or far outliers; fewer are none
# Of near and far outliers. More of those near would make the sound plots a minority: all plots as outliers of a third
# of the σ are as likely as none.
MAX_OUTLIER_SHARES = np.array([0.2, 0.4])
FIRST_OUTLIER_SHARE = 0.03  # where the search of either begins
MIN_NEAR_WIDTH, MAX_NEAR_WIDTH = 2.5, 100.0  # of near outliers, in σ
NEAR_WIDTH_STARTS = (3.0, 10.0)
NO_ZERO = -1e3  # below the logarithm of a number that has no zero
NEAR_MAXIMUM_EVALUATIONS = 30  # as MAXIMUM_EVALUATIONS, from near the maximum
# factor on the value that counts as zero where the likelihood jumps by more there
ZERO_REFINEMENT = 1e-3
LIKELIHOOD_LEAP = 0.01


@dataclass(frozen=True)
class FittedKey:
    """One key: the best value, its 95 % interval, and whether the plots distinguish it from all other values.

    lo is 0 where the key may be zero, hi infinite where it has no upper end."""

    key: str
    stated: float
    value: float
    lo: float
    hi: float
    identifiable: bool


class _ProfilePoint(NamedTuple):
    """A point of a profile: the logarithm of the key held, the largest likelihood there, and its coordinates."""

    log_key: float
    value: float
    point: np.ndarray


class LikelihoodSearch:
    """The maximum of a likelihood, and its profile along each key. Coordinates are logarithms of the keys, and the
    logits of the shares of near and far outliers, and the logarithm of the width of near ones."""

    def __init__(self, likelihood: Likelihood, robust: bool, progress: Progress, start_point: np.ndarray | None = None):
        self.likelihood, self.robust, self.progress, self.evaluations = likelihood, robust, progress, 0
        self.end_count, self.ends_started_at = 0, 0
        start, self.lowest = np.log(starting_values(likelihood)), np.log(likelihood.zero_limits)
        self.highest = start + math.log(INTERVAL_REACH)
        if robust:
            start, self.lowest, self.highest = (
                np.append(keys, np.log(shares / (1 - shares)))
                for keys, shares in (
                    (start, np.full(2, FIRST_OUTLIER_SHARE)),
                    (self.lowest, np.full(2, MIN_OUTLIER_SHARE)),
                    (self.highest, MAX_OUTLIER_SHARES),
                )
            )
            start = np.append(start, math.log(NEAR_WIDTH_STARTS[0]))
            self.lowest, self.highest = np.append(self.lowest, NO_ZERO), np.append(self.highest, np.log(MAX_NEAR_WIDTH))
        self.maximum_cost = (MAXIMUM_EVALUATIONS if start_point is None else NEAR_MAXIMUM_EVALUATIONS) * start.size
        self.curvature_model = Curvature(self._log_likelihood)
        self.best, self.top = self._climb(start if start_point is None else start_point, None, ROUGH_TOLERANCE)
        # A second start far away: the likelihood of manoeuvre and plot errors may have two maxima.
        for climb_count, factor in enumerate((0.1, 10.0) if start_point is None else (), 1):
            self.maximum_cost = max(self.maximum_cost, self.evaluations * 3 // climb_count)
            shifted = np.where(self.best > self.lowest, self.best, start)
            shifted[: len(likelihood.stated)] += math.log(factor)
            candidate, value = self._climb(shifted, None, ROUGH_ACCURACY, SIMPLEX_EVALUATIONS[:1])
            if value > self.top - ROUGH_ACCURACY and np.abs(candidate - self.best).max() > FIRST_STEP:
                candidate, value = self._climb(candidate, None, ROUGH_TOLERANCE)
            if value > self.top + 1e-6:
                self.best, self.top = candidate, value
        if robust and start_point is None:
            self._try_near_widths()
        self.top = -math.inf
        self._polish(self.best)
        self.raise_zero_keys()

    def _try_near_widths(self) -> None:
        """Search from several widths of near outliers: few of one size and many of a smaller one may both be maxima."""
        for width in NEAR_WIDTH_STARTS:
            start = self.best.copy()
            start[-3], start[-1] = math.log(FIRST_OUTLIER_SHARE / (1 - FIRST_OUTLIER_SHARE)), math.log(width)
            candidate, value = self._climb(start, None, ROUGH_ACCURACY, SIMPLEX_EVALUATIONS[:1])
            if value > self.top + ROUGH_ACCURACY:
                self.best, self.top = self._climb(candidate, None, ROUGH_TOLERANCE)

    def _polish(self, start: np.ndarray) -> bool:
        """Take the maximum near a point as the best if it is higher, and return whether it is."""
        point = polish_maximum(self._log_likelihood, self._climb(start, None, TOLERANCE)[0])
        value = self._log_likelihood(point)
        if is_higher := value > self.top:
            self.best, self.top = point, value
        return is_higher

    def raise_zero_keys(self) -> None:
        """Raise keys from zero where that makes the plots likelier, then compute the curvature at the maximum."""
        while (start := self._raised_point()) is not None and self._polish(start):
            pass
        self.curvature_model = Curvature(self._log_likelihood)
        self.curvature_model.step(self.best, self.top, np.arange(self.best.size))
        self.curvature = self.curvature_model.H
        may_be_zero = [i for i in range(self.best.size) if self.lowest[i] > NO_ZERO and self._may_be_zero(i)]
        self.raised_keys = {i: self._raised_log(i) for i in may_be_zero}
        self.ends_started_at = self.evaluations

    def _raised_point(self) -> np.ndarray | None:
        """The likeliest point above the maximum with a single key raised from zero; None if there is none."""
        unit_moves = np.eye(self.best.size)
        zero_keys = np.flatnonzero((self.best <= self.lowest)[: len(self.likelihood.keys)])
        trials = [
            self.best + (self.lowest[i] + rise - self.best[i]) * unit_moves[i]
            for i in zero_keys
            for rise in TRIAL_RISES
        ]
        candidates = [(self._log_likelihood(point), point) for point in trials]
        value, point = max(candidates, key=lambda candidate: candidate[0], default=(-math.inf, self.best))
        return point if value > self.top + TOLERANCE else None

    def to_values(self, point: np.ndarray) -> np.ndarray:
        """The keys, and the shares of near and far outliers and the width of near ones at the end if allowed for."""
        count = len(self.likelihood.stated)
        keys = np.exp(np.clip(point[:count], -200, 200))
        keys = np.where(keys <= self.likelihood.zero_limits, 0.0, keys)
        if not self.robust:
            return keys
        shares = 1 / (1 + np.exp(-point[count:-1]))
        shares = np.where(shares <= MIN_OUTLIER_SHARE, 0.0, np.minimum(shares, MAX_OUTLIER_SHARES))
        width = math.exp(min(max(point[-1], math.log(MIN_NEAR_WIDTH)), math.log(MAX_NEAR_WIDTH)))
        return np.concatenate([keys, shares, [width]])

    def outliers(self, point: np.ndarray) -> dict[str, float]:
        """The share of outliers, the part of them that is near and the width of these; empty if not allowed for."""
        if not self.robust:
            return {}
        near, far, width = self.to_values(point)[-3:].tolist()
        part = near / (near + far) if near + far else ErrorLaw.near
        return {OUTLIERS: near + far, NEAR: part, NEAR_WIDTH: width}

    def law(self, point: np.ndarray) -> ErrorLaw:
        """The law of errors at a point."""
        return ErrorLaw(**self.outliers(point))

    def _log_likelihood(self, point: np.ndarray) -> float:
        values = self.to_values(point)
        self.evaluations += 1
        self.progress(self.evaluations, self._expected_evaluations())
        count = len(self.likelihood.stated)
        result = self.likelihood(values[:count], self.law(point))
        return result if math.isfinite(result) else IMPOSSIBLE_LOG_LIKELIHOOD

    def _expected_evaluations(self) -> int:
        """Expected number of evaluations: the maximum and each end at their usual cost, or at that of those found so
        far."""
        end_count, size = 2 * len(self.likelihood.keys), self.lowest.size
        explanation_cost = EXPLANATION_EVALUATIONS * (len(single_explanations(self.likelihood)) - self.robust)
        maximum_cost = self.ends_started_at or max(self.maximum_cost, self.evaluations)
        end_cost = (
            (self.evaluations - self.ends_started_at) / self.end_count if self.end_count else END_EVALUATIONS * size
        )
        return max(round(maximum_cost + end_cost * end_count), self.evaluations) + explanation_cost

    def _climb(
        self,
        start: np.ndarray,
        fixed_index: int | None,
        tolerance: float,
        simplex_evaluations: Sequence[int] = SIMPLEX_EVALUATIONS,
    ) -> tuple[np.ndarray, float]:
        """The maximum reached from a start, one coordinate held or none, and the log-likelihood there: by Newton steps,
        until one gains less than `tolerance`; where they fail, by a simplex for a while. A likelihood over lists of
        hypotheses jumps where one is dropped: a simplex that gains next to nothing shows that no step can."""
        free = np.array([i for i in range(len(start)) if i != fixed_index])
        point, value = start, self._log_likelihood(start)
        curvature = self.curvature_model if fixed_index is not None else Curvature(self._log_likelihood)
        for max_evaluations in simplex_evaluations:
            point, value, is_maximum = self._climb_by_newton(point, value, free, tolerance, curvature)
            if is_maximum:
                return point, value
            value_before = value
            point, value = self._climb_by_simplex(point, free, tolerance, max_evaluations)
            if value - value_before < ROUGH_ACCURACY:
                return point, value
            curvature = Curvature(self._log_likelihood)
        return point, value

    def _climb_by_newton(
        self, point: np.ndarray, value: float, free: np.ndarray, tolerance: float, curvature: Curvature
    ) -> tuple[np.ndarray, float, bool]:
        """As `_climb`, by Newton steps alone: where they end, and whether that is the maximum."""
        for _ in range(MAX_NEWTON_STEPS):
            point, value = self._set_zero(point, value, free)
            moving = free[point[free] > self.lowest[free]]
            if not moving.size:
                return point, value, True
            step, predicted_gain = curvature.step(point, value, moving)
            if not predicted_gain >= 0:
                break
            if predicted_gain < tolerance / 10:
                return point, value, True
            for fraction in (1.0, 0.5, 0.1, 0.01):
                trial_value = self._log_likelihood(point + fraction * step)
                if trial_value > value:
                    point, value = point + fraction * step, trial_value
                    break
                if predicted_gain < SMALL_GAIN_FACTOR * tolerance:
                    return point, value, True
            else:
                return point, value, predicted_gain < ROUGH_ACCURACY
            if predicted_gain < SMALL_GAIN_FACTOR * tolerance:
                return point, value, True
            if fraction < 1 or predicted_gain > ROUGH_ACCURACY:
                curvature = Curvature(self._log_likelihood)
        return point, value, False

    def _set_zero(self, point: np.ndarray, value: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """A point and its likelihood, with free coordinates near zero set to zero, where that is no worse: the
        likelihood is flat in their logarithm there, and steps would never end."""
        for j in free:
            if self.lowest[j] < point[j] < self.lowest[j] + NEAR_ZERO_LOG:
                trial = point.copy()
                trial[j] = self.lowest[j] - FIRST_STEP
                if (trial_value := self._log_likelihood(trial)) >= value:
                    point, value = trial, trial_value
        return point, value

    def _climb_by_simplex(
        self, start: np.ndarray, free: np.ndarray, tolerance: float, max_evaluations: int
    ) -> tuple[np.ndarray, float]:
        """As `_climb`, by a simplex, until it stands still within `close` or has taken `most` likelihoods."""
        from scipy.optimize import minimize

        point = start.copy()

        def cost(free_coordinates: np.ndarray) -> float:
            point[free] = free_coordinates
            return -self._log_likelihood(point)

        simplex = np.concatenate([start[None, free], start[free] + FIRST_STEP * np.eye(free.size)])
        options: Any = {
            "initial_simplex": simplex,
            "xatol": tolerance,
            "fatol": tolerance / 10,
            "maxfev": max_evaluations,
        }
        result = minimize(cost, start[free], method="Nelder-Mead", options=options)
        point[free] = result.x
        return point, -float(result.fun)

    def _profile(self, i: int, log_key: float, neighbour: np.ndarray) -> tuple[float, np.ndarray]:
        """The largest likelihood with key i held at the logarithm `at`, and its coordinates; others that are zero rise
        from there if that makes the plots likelier."""
        start = neighbour.copy()
        start[i] = log_key
        point, value = self._climb(start, i, TOLERANCE)
        for j, raised_log in self.raised_keys.items():
            if j != i and point[j] <= self.lowest[j]:
                for trial_log in (raised_log, *(raised_log - TRIAL_FALLS)):
                    start = point.copy()
                    start[j] = trial_log
                    if self._log_likelihood(start) > value:
                        point, value = self._climb(start, i, TOLERANCE)
                        break
        return value, point

    def refine_zero(self) -> bool:
        """Lower the values that count as zero where the likelihood leaps there; return whether any was lowered."""
        limits_before = self.likelihood.zero_limits
        while leaping_keys := [i for i in range(len(self.likelihood.keys)) if self._has_leap_at_zero(i)]:
            is_zero = self.best <= self.lowest
            self.likelihood.zero_limits = np.array(self.likelihood.zero_limits)
            self.likelihood.zero_limits[leaping_keys] *= ZERO_REFINEMENT
            self.lowest[leaping_keys] += math.log(ZERO_REFINEMENT)
            self.best[is_zero] = self.lowest[is_zero] - FIRST_STEP
            self.top = self._log_likelihood(self.best)
        return self.likelihood.zero_limits is not limits_before

    def _has_leap_at_zero(self, i: int) -> bool:
        """Whether the likelihood leaps at zero of a key, and is near the top there."""
        above, zero = (self._value_along(i, self.lowest[i] + sign * TOLERANCE) for sign in (1, -1))
        is_relevant = min(above, zero) > IMPOSSIBLE_LOG_LIKELIHOOD and max(above, zero) > self.top - HALF_CHI2_95
        return is_relevant and abs(above - zero) > LIKELIHOOD_LEAP

    def _may_be_zero(self, i: int) -> bool:
        """Whether the plots hardly distinguish a key, or the share of outliers, from zero: near zero its logarithm has
        no slope, on which a search stalls, though it must rise where another one is held too low. Tested a little above
        zero, since no filter has σ = 0."""
        return self._value_along(i, self.lowest[i] + TOLERANCE) > self.top - HALF_CHI2_95

    def _raised_log(self, i: int) -> float:
        """The logarithm of such a key at which a search has a slope: the likelihood has fallen from the maximum."""
        log = max(float(self.best[i]), float(self.lowest[i]))
        while self._value_along(i, log) > self.top - HALF_CHI2_95 and log < self.highest[i]:
            log += 1.0
        return log

    def _value_along(self, i: int, log: float) -> float:
        """The log-likelihood with one key changed and all others at the maximum."""
        point = self.best.copy()
        point[i] = log
        return self._log_likelihood(point)

    def interval(self, i: int) -> FittedKey:
        """The 95 % profile interval of key i."""
        limit = self.top - HALF_CHI2_95
        lo, hi = (self._interval_end(i, direction, limit) for direction in (-1, 1))
        value = float(self.to_values(self.best)[i])
        lowest = self.lowest[i]
        bounds = (0.0 if lo is None or lo <= lowest else math.exp(lo), math.inf if hi is None else math.exp(hi))
        stated = float(self.likelihood.stated[i])
        return FittedKey(self.likelihood.keys[i], stated, value, *bounds, bounds[0] > 0 and math.isfinite(bounds[1]))

    def _interval_end(self, i: int, direction: int, limit: float) -> float | None:
        """The logarithm of key i at which the profile falls to a limit; None if not within INTERVAL_REACH."""
        lowest = float(self.lowest[i])
        home = max(float(self.best[i]), float(self.lowest[i]))
        step = self._end_distance(i)
        # from zero the end may be farther than INTERVAL_REACH: up to there it is not
        if direction > 0 and i in self.raised_keys:
            home, step = max(home, self.raised_keys[i] - 1.0), 0.1
        inside = _ProfilePoint(home, self._value_along(i, home), self.best)
        while abs(inside.log_key - home) < math.log(INTERVAL_REACH):
            log_key = inside.log_key + direction * step
            outside = _ProfilePoint(log_key, *self._profile(i, log_key, inside.point))
            if outside.value < limit:
                self.end_count += 1
                return self._find_crossing(i, inside, outside, limit)
            if log_key < lowest:
                return None
            inside, step = outside, 2 * step
        return None

    def _find_crossing(self, i: int, inside: "_ProfilePoint", outside: "_ProfilePoint", limit: float) -> float:
        """The logarithm of key i at which the profile crosses a limit between two points: by secants of the square root
        of its fall from the maximum, which is nearly a straight line (Illinois method)."""

        def height(point: _ProfilePoint) -> float:
            fall = self.top - point.value
            return math.sqrt(2 * (self.top - limit)) - math.copysign(math.sqrt(2 * abs(fall)), fall)

        ends, values, replaced = [inside, outside], [height(inside), height(outside)], None
        while True:
            fraction, width = values[0] / (values[0] - values[1]), ends[1].log_key - ends[0].log_key
            log_key = ends[0].log_key + fraction * width
            trial = _ProfilePoint(
                log_key, *self._profile(i, log_key, ends[0].point + fraction * (ends[1].point - ends[0].point))
            )
            trial_height = height(trial)
            side = int(trial_height <= 0)
            if (
                abs(trial_height * width) < TOLERANCE * abs(values[0] - values[1])
                or abs(log_key - ends[side].log_key) < TOLERANCE
            ):
                return log_key
            ends[side], values[side] = trial, trial_height
            if side == replaced:
                values[1 - side] /= 2
            replaced = side

    def _end_distance(self, i: int) -> float:
        """A little more than the distance of an end from the maximum, if the likelihood were a parabola."""
        H = -self.curvature
        try:
            spread = float(np.linalg.inv(H)[i, i])
        except (np.linalg.LinAlgError, IndexError):  # IndexError: no curvature, where neighbours are impossible
            return 0.1
        return min(1.2 * math.sqrt(2 * HALF_CHI2_95 * spread), 1.0) if 0 < spread < math.inf else 0.1
