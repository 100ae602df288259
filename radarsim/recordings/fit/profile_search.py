"""The maximum of a likelihood over all its keys and, where asked for, the laws of outliers."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from radarsim.recordings.fit.likelihood_slice import (
    IMPOSSIBLE_LOG_LIKELIHOOD,
    ROUGH_ACCURACY,
    Progress,
    single_explanations,
    starting_values,
)
from radarsim.recordings.fit.newton_steps import (
    FIRST_STEP,
    LEAP_STEPS,
    SMOOTH_STEPS,
    TOLERANCE,
    Curvature,
    polish_maximum,
)
from radarsim.studies.error_law import CLEAR_RISE, ErrorLaw, OutlierLaw
from radarsim.studies.recording_interface import Likelihood

# likelihood evaluations of a key to the maximum and to an end; of an explanation
MAXIMUM_EVALUATIONS = 70
END_EVALUATIONS = 10
EXPLANATION_EVALUATIONS = 60

HALF_CHI2_95 = 1.9207294103470  # half the 95 % point of chi-square with one degree of freedom
ROUGH_TOLERANCE = 1e-4
INTERVAL_REACH = 1e4  # ratio to the estimate up to which an end of an interval is searched
MAX_NEWTON_STEPS = 40
SIMPLEX_EVALUATIONS = (50, 100, 200)  # evaluations of a simplex before Newton steps are tried again
TRIAL_RISES = np.arange(1.0, 16.0)  # above what counts as zero: where a key at zero is tried
NEAR_ZERO_LOG = 7.0  # above the value that counts as zero, in that logarithm: zero is tried
NEAR_WIDTH_LOG = 1.0  # the same of offset and spread of near outliers
SMALL_GAIN_FACTOR = 300.0  # times the accuracy: a Newton step that gains no more ends the search
MIN_OUTLIER_SHARE = 1e-6  # of near or far outliers; fewer are none
# Of near and far outliers. More of those near would make the sound plots a minority: all plots as outliers of a third
# of the σ are as likely as none.
MAX_NEAR_SHARE, MAX_FAR_SHARE = 0.2, 0.4
# Of the exponential prior of the share of near outliers. Without a prior a hundred sound errors are always as well
# told by a fifth of outliers of 3 σ and half the σ; with 0.05, intervals hold σ too rarely where a tenth are of 3 σ.
EXPECTED_NEAR_SHARE = 0.1
FIRST_OUTLIER_SHARE = 0.03  # where the search of either begins
MAX_PLAUSIBLE_OUTLIERS = 0.3  # of numbers that may be far outliers; with more, the errors follow another law
PLAIN_PROBABILITY, MAX_PLAIN_PART = 0.9, 0.5  # of a plain outlier; of a law's outliers that are plain, else it is real
MIN_NEAR_WIDTH, MAX_NEAR_WIDTH = 3.0, 100.0  # of near outliers, in σ
MIN_NEAR_SIGMAS = 0.5  # of their offset or spread: less is none
# share, offset and spread from which near outliers are searched
NEAR_STARTS = ((0.1, 0.0, 3.0), (0.03, 0.0, 10.0), (0.1, 3.0, 0.0), (0.1, 5.0, 0.0), (0.03, 10.0, 0.0))
NEAR_START_FACTOR = 0.65  # on a key that may have been too large without them
CLEAR_NEAR_GAIN = 3.9074  # half the 95 % point of chi-square of their three numbers: less gain may be chance
NEAR_CLIMBS = 2  # searches from the likeliest of these
END_STARTS = 2  # of these that are tried with smaller keys, where an end is
LAW_SIZE = 4  # coordinates of an outlier law: the logits of its shares, the logarithms of offset and spread
COARSE_GAIN = 1000.0  # of the log-likelihood by ten times a key, from which a search begins there
# distance of an end from the maximum where curvature tells none, and the greatest that is tried first
UNKNOWN_END_DISTANCE, MAX_FIRST_DISTANCE = 0.1, 1.0
NEAR_MAXIMUM_EVALUATIONS = 30  # as MAXIMUM_EVALUATIONS, from near the maximum
# factor on the value that counts as zero where the likelihood jumps by more there
ZERO_REFINEMENT = 1e-3
LIKELIHOOD_LEAP = 0.01


class LikelihoodSearch:
    """The maximum of a likelihood. Coordinates are logarithms of the keys, and for each kind of numbers LAW_SIZE of an
    outlier law. What is at its lowest is zero. start_point: from a search of fewer rows; plain_values: of the keys, by
    a fit that allows for less."""

    def __init__(
        self,
        likelihood: Likelihood,
        robust: bool,
        progress: Progress,
        start_point: np.ndarray | None = None,
        plain_values: Sequence[float] = (),
    ):
        self.likelihood, self.robust, self.progress, self.evaluations = likelihood, robust, progress, 0
        self.end_count, self.ends_started_at = 0, 0
        self.steps = SMOOTH_STEPS if likelihood.is_smooth else LEAP_STEPS
        self.zero_limits = np.array(likelihood.zero_limits)  # refined in this search alone
        start, self.lowest = np.log(starting_values(likelihood)), np.log(self.zero_limits)
        self.highest = start + math.log(INTERVAL_REACH)
        self.zero_reach = np.full(start.size, NEAR_ZERO_LOG)
        self.law_starts = range(start.size, start.size + LAW_SIZE * len(likelihood.outlier_kinds) * robust, LAW_SIZE)
        kinds = zip(self.law_starts, likelihood.outlier_kinds, strict=False)
        self.near_starts = [i for i, kind in kinds if kind not in likelihood.far_kinds]
        for _ in self.law_starts:
            none, width = _logit(MIN_OUTLIER_SHARE), math.log(MIN_NEAR_SIGMAS)
            first = [none - FIRST_STEP, _logit(FIRST_OUTLIER_SHARE), width - FIRST_STEP, math.log(NEAR_STARTS[0][2])]
            start, self.lowest = np.append(start, first), np.append(self.lowest, [none, none, width, width])
            most = [_logit(MAX_NEAR_SHARE), _logit(MAX_FAR_SHARE), *[math.log(MAX_NEAR_WIDTH)] * 2]
            self.highest = np.append(self.highest, most)
            self.zero_reach = np.append(self.zero_reach, [NEAR_ZERO_LOG] * 2 + [NEAR_WIDTH_LOG] * 2)
        self.maximum_cost = (MAXIMUM_EVALUATIONS if start_point is None else NEAR_MAXIMUM_EVALUATIONS) * start.size
        self.curvature_model = Curvature(self.log_likelihood, self.steps)
        self.differences = np.full(start.size, self.steps.curvature)
        self.rival, self.rival_top, self.near_points = np.zeros(0), -math.inf, dict[int, np.ndarray]()
        if start_point is not None:
            # Fewer rows may have been without the outliers of all: a share that is zero has no slope.
            start[: len(likelihood.stated)] = start_point[: len(likelihood.stated)]
            start = np.where(start_point > self.lowest, start_point, start)
        if not robust:
            start = self._coarse_start(start)
        self.best, self.top = self.climb(start, None, ROUGH_TOLERANCE)
        # A second start far away: the likelihood of manoeuvre and plot errors may have two maxima.
        for climb_count, factor in enumerate((0.1, 10.0) if start_point is None else (), 1):
            self.maximum_cost = max(self.maximum_cost, self.evaluations * 3 // climb_count)
            shifted = np.where(self.best > self.lowest, self.best, start)
            shifted[: len(likelihood.stated)] += math.log(factor)
            candidate, value = self.climb(shifted, None, ROUGH_ACCURACY, SIMPLEX_EVALUATIONS[:1])
            if value > self.top - ROUGH_ACCURACY and np.abs(candidate - self.best).max() > FIRST_STEP:
                candidate, value = self.climb(candidate, None, ROUGH_TOLERANCE)
            if value > self.top + 1e-6:
                self.best, self.top = candidate, value
        if plain_values:
            self._try_plain_values(np.array(plain_values))
        self._prefer_plausible_laws()
        if robust and start_point is None:
            self._try_near_outliers()
        self.top = -math.inf
        self._polish(self.best)
        self.raise_zero_keys()

    def _try_plain_values(self, values: np.ndarray) -> None:
        """Climb from the values of a plain fit, the first of the keys, where these are likelier than the best point:
        what else is allowed for is no reason for a worse maximum."""
        start = self.lowest - FIRST_STEP
        is_known = np.arange(start.size) < values.size
        start[is_known] = np.maximum(start[is_known], np.log(np.maximum(values, np.finfo(float).tiny)))
        if self.log_likelihood(start) > self.top:
            self.best, self.top = self.climb(start, None, ROUGH_TOLERANCE)

    def _coarse_start(self, start: np.ndarray) -> np.ndarray:
        """A start with keys changed by whole powers of ten, as long as that gains much: from σ far too small, a search
        would wander through everything that may explain such plots."""
        moves = np.eye(start.size)[: len(self.likelihood.keys)]
        rises, value = np.log(10.0 ** np.arange(1, 5)), self.log_likelihood(start)
        while True:
            trials = [start + rise * move for move in moves for rise in rises]
            trial_value, best = max((self.log_likelihood(trial), i) for i, trial in enumerate(trials))
            if not trial_value > value + COARSE_GAIN:
                return start
            start, value = trials[best], trial_value

    def _prefer_plausible_laws(self) -> None:
        """Where outliers at the best point are implausibly many, but few of them plain, take the likeliest point with
        few or none, unless it is clearly less likely; the other one is a rival then.

        Folded velocities with a σ of a fifth of the span are about as likely with 40 % of outliers as with none."""
        implausible, candidates = self._doubtful_laws(), []
        none = _logit(MIN_OUTLIER_SHARE) - FIRST_STEP
        for far in (none, _logit(FIRST_OUTLIER_SHARE)) if implausible else ():
            start = self.best.copy()
            for i in implausible:
                start[i : i + 2] = none, far
            point, value = self._polished(start)
            if not any(map(follows_another_law, self.law(point).outlier_laws)):
                candidates.append((point, value))
        point, value = max(candidates, key=lambda candidate: candidate[1], default=(self.best, -math.inf))
        if value > self.top - CLEAR_RISE:
            if self.top > max(value, self.rival_top):
                self.rival, self.rival_top = self.best, self.top
            self.best, self.top = point, value

    def _doubtful_laws(self) -> list[int]:
        """The first coordinates of laws that have implausibly many outliers at the best point, few of them plain."""
        law = self.law(self.best)
        kinds = zip(self.law_starts, self.likelihood.outlier_kinds, law.outlier_laws, strict=False)
        implausible = [(i, kind, outliers.share) for i, kind, outliers in kinds if follows_another_law(outliers)]
        tracks = self.likelihood.soundness(self.to_values(self.best), law) if implausible else []
        result = []
        for i, kind, share in implausible:
            columns = (kind,) if kind else tracks[0].keys() - {"t_s"}
            numbers = np.concatenate([track[name] for track in tracks for name in columns])
            if np.mean(numbers[np.isfinite(numbers)] < 1 - PLAIN_PROBABILITY) < MAX_PLAIN_PART * share:
                result.append(i)
        return result

    def _try_near_outliers(self) -> None:
        """Take near outliers into the best point if they clearly raise the likelihood; else, as sound errors may have
        that shape by chance, keep the point as a rival, whose keys the intervals hold too."""
        for i in self.near_starts:
            candidate, value = self.climb_to_near_outliers(self.best, i, None)
            self.near_points[i] = candidate
            if value > self.top + CLEAR_NEAR_GAIN:
                self.best, self.top = self.climb(candidate, None, ROUGH_TOLERANCE)
            elif value > max(self.top, self.rival_top):
                self.rival, self.rival_top = candidate, value

    def climb_to_near_outliers(
        self, point: np.ndarray, i: int, fixed_index: int | None, min_value: float = -math.inf
    ) -> tuple[np.ndarray, float]:
        """The likeliest point reached from a point with near outliers of several kinds in the law that begins at
        coordinate i, one coordinate held or none, and its log-likelihood. Starts below min_value are not climbed."""
        starts = []
        for share, *sizes in NEAR_STARTS:
            if sizes[0] and not self.likelihood.has_offsets:
                continue
            start = point.copy()
            start[i] = _logit(share)
            start[i + 2 : i + 4] = [
                math.log(size) if size else lowest - FIRST_STEP
                for size, lowest in zip(sizes, self.lowest[i + 2 : i + 4].tolist(), strict=True)
            ]
            starts.append((self.log_likelihood(start), start))
        starts.sort(key=lambda start: -start[0])
        start_count, climb_count = (len(starts), NEAR_CLIMBS) if fixed_index is None else (END_STARTS, 1)
        starts = [self._with_smaller_keys(*start, fixed_index) for start in starts[:start_count]]
        if fixed_index is not None and i in self.near_points:
            start = self.near_points[i].copy()
            start[fixed_index] = point[fixed_index]
            for j in self.law_starts:
                if j != i:
                    start[j : j + LAW_SIZE] = point[j : j + LAW_SIZE]
            starts.append((self.log_likelihood(start), start))
        starts.sort(key=lambda start: -start[0])
        free = np.array([j for j in range(point.size) if j != fixed_index])
        candidates = [
            self._climb_by_newton(start, value, free, ROUGH_ACCURACY, Curvature(self.log_likelihood, self.steps))[:2]
            for value, start in starts[:climb_count]
            if value > min_value
        ]
        return max(candidates, key=lambda candidate: candidate[1], default=(point, -math.inf))

    def _with_smaller_keys(self, value: float, point: np.ndarray, fixed_index: int | None) -> tuple[float, np.ndarray]:
        """A point with those keys smaller that make the plots likelier so, and its log-likelihood before it."""
        for key in range(len(self.likelihood.keys)):
            trial = point.copy()
            trial[key] += math.log(NEAR_START_FACTOR)
            if key != fixed_index and (trial_value := self.log_likelihood(trial)) > value:
                point, value = trial, trial_value
        return value, point

    def _moving(self, point: np.ndarray, free: np.ndarray) -> np.ndarray:
        """The free coordinates on which the likelihood depends: what is zero stays so, and offset and spread of no near
        outliers do not count."""
        counts = point > self.lowest
        for i in self.law_starts:
            counts[i + 2 : i + 4] &= counts[i]
        return free[counts[free]]

    def _polish(self, start: np.ndarray) -> bool:
        """Take the maximum near a point as the best if it is higher, and return whether it is."""
        point, value = self._polished(start)
        if is_higher := value > self.top:
            self.best, self.top = point, value
        return is_higher

    def _polished(self, start: np.ndarray) -> tuple[np.ndarray, float]:
        """The maximum near a point, and its log-likelihood."""
        point, _ = self.climb(start, None, self.steps.tolerance)
        moving = self._moving(point, np.arange(point.size))
        point = polish_maximum(self.log_likelihood, point, self.steps, moving)
        return point, self.log_likelihood(point)

    def raise_zero_keys(self) -> None:
        """Raise keys from zero where that makes the plots likelier, then compute the curvature at the maximum."""
        while (start := self._raised_point()) is not None and self._polish(start):
            pass
        self._prefer_plausible_laws()
        self.curvature_model = Curvature(self.log_likelihood, self.steps)
        moving = self._moving(self.best, np.arange(self.best.size))
        self.curvature_model.step(self.best, self.top, moving)
        self.end_distances = self._expected_end_distances(moving)
        far_shares = [i + 1 for i in self.law_starts]
        may_be_zero = [i for i in (*range(len(self.likelihood.keys)), *far_shares) if self._may_be_zero(i)]
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
        candidates = [(self.log_likelihood(point), point) for point in trials]
        value, point = max(candidates, key=lambda candidate: candidate[0], default=(-math.inf, self.best))
        return point if value > self.top + self.steps.tolerance else None

    def to_values(self, point: np.ndarray) -> np.ndarray:
        """The values of the keys at a point."""
        keys = np.exp(np.clip(point[: len(self.likelihood.stated)], -200, 200))
        return np.where(keys <= self.zero_limits, 0.0, keys)

    def law(self, point: np.ndarray) -> ErrorLaw:
        """The law of errors at a point."""
        return ErrorLaw(outlier_laws=tuple(self._outlier_law(point[i : i + LAW_SIZE]) for i in self.law_starts))

    def _outlier_law(self, coordinates: np.ndarray) -> OutlierLaw:
        """The law of outliers of its coordinates (LAW_SIZE,)."""
        near, far = (1 / (1 + math.exp(-min(max(logit, -50.0), 50.0))) for logit in coordinates[:2].tolist())
        offset, spread = (math.exp(min(log, math.log(MAX_NEAR_WIDTH))) for log in coordinates[2:].tolist())
        offset, spread = (0.0 if size <= MIN_NEAR_SIGMAS else size for size in (offset, spread))
        width, least = math.hypot(offset, spread), math.sqrt(MIN_NEAR_WIDTH**2 - 1)
        if width < least:  # else they would be sound
            offset, spread = (offset * least / width, spread * least / width) if width else (0.0, least)
        return OutlierLaw(
            0.0 if near <= MIN_OUTLIER_SHARE else min(near, MAX_NEAR_SHARE),
            0.0 if far <= MIN_OUTLIER_SHARE else min(far, MAX_FAR_SHARE),
            offset,
            spread,
        )

    def log_likelihood(self, point: np.ndarray) -> float:
        values = self.to_values(point)
        self.evaluations += 1
        self.progress(self.evaluations, self._expected_evaluations())
        law = self.law(point)
        result = self.likelihood(values, law) - sum(kind.near for kind in law.outlier_laws) / EXPECTED_NEAR_SHARE
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

    def climb(
        self,
        start: np.ndarray,
        fixed_index: int | None,
        tolerance: float,
        simplex_evaluations: Sequence[int] = SIMPLEX_EVALUATIONS,
    ) -> tuple[np.ndarray, float]:
        """The maximum reached from a start, one coordinate held or none, and the log-likelihood there: by Newton steps,
        until one gains less than `tolerance`; where they fail, by a simplex for a while. A likelihood over lists of
        hypotheses leaps where one is dropped: a simplex that gains next to nothing shows that no step can. On a profile
        of it, steps of wide differences take the place of the simplex."""
        free = np.array([i for i in range(len(start)) if i != fixed_index])
        point, value = start, self.log_likelihood(start)
        curvature = self.curvature_model if fixed_index is not None else Curvature(self.log_likelihood, self.steps)
        for max_evaluations in simplex_evaluations:
            point, value, is_maximum = self._climb_by_newton(point, value, free, tolerance, curvature)
            if is_maximum:
                return point, value
            value_before = value
            if self.likelihood.is_smooth or fixed_index is None:
                point, value = self._climb_by_simplex(point, free, tolerance, max_evaluations)
            else:
                curvature = Curvature(self.log_likelihood, self.steps, self.differences)
                return self._climb_by_newton(point, value, free, tolerance, curvature)[:2]
            if value - value_before < ROUGH_ACCURACY:
                return point, value
            curvature = Curvature(self.log_likelihood, self.steps)
        return point, value

    def _climb_by_newton(
        self, point: np.ndarray, value: float, free: np.ndarray, tolerance: float, curvature: Curvature
    ) -> tuple[np.ndarray, float, bool]:
        """As `climb`, by Newton steps alone: where they end, and whether that is the maximum."""
        for _ in range(MAX_NEWTON_STEPS):
            point, value = self._set_zero(point, value, free)
            moving = self._moving(point, free)
            if not moving.size:
                return point, value, True
            step, predicted_gain = curvature.step(point, value, moving)
            if not predicted_gain >= 0:
                break
            if predicted_gain < tolerance / 10:
                return point, value, True
            for fraction in (1.0, 0.5, 0.1, 0.01):
                trial_value = self.log_likelihood(point + fraction * step)
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
                curvature = Curvature(self.log_likelihood, self.steps, curvature.differences)
        return point, value, False

    def _set_zero(self, point: np.ndarray, value: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """A point and its likelihood, with free coordinates near zero set to zero, where that is no worse: the
        likelihood is flat in their logarithm there, and steps would never end."""
        for j in self._moving(point, free):
            if self.lowest[j] < point[j] < self.lowest[j] + self.zero_reach[j]:
                trial = point.copy()
                trial[j] = self.lowest[j] - FIRST_STEP
                if (trial_value := self.log_likelihood(trial)) >= value:
                    point, value = trial, trial_value
        return point, value

    def _climb_by_simplex(
        self, start: np.ndarray, free: np.ndarray, tolerance: float, max_evaluations: int
    ) -> tuple[np.ndarray, float]:
        """As `climb`, by a simplex, until it stands still within `close` or has taken `most` likelihoods."""
        from scipy.optimize import minimize

        point = start.copy()

        def cost(free_coordinates: np.ndarray) -> float:
            point[free] = free_coordinates
            return -self.log_likelihood(point)

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

    def refine_zero(self) -> bool:
        """Lower the values that count as zero where the likelihood leaps there; return whether any was lowered."""
        was_refined = False
        while leaping_keys := [i for i in range(len(self.likelihood.keys)) if self._has_leap_at_zero(i)]:
            is_zero = self.best <= self.lowest
            self.zero_limits[leaping_keys] *= ZERO_REFINEMENT
            self.lowest[leaping_keys] += math.log(ZERO_REFINEMENT)
            self.best[is_zero] = self.lowest[is_zero] - FIRST_STEP
            self.top = self.log_likelihood(self.best)
            was_refined = True
        return was_refined

    def _has_leap_at_zero(self, i: int) -> bool:
        """Whether the likelihood leaps at zero of a key, and is near the top there."""
        above, zero = (self.value_along(i, self.lowest[i] + sign * TOLERANCE) for sign in (1, -1))
        is_relevant = min(above, zero) > IMPOSSIBLE_LOG_LIKELIHOOD and max(above, zero) > self.top - HALF_CHI2_95
        return is_relevant and abs(above - zero) > LIKELIHOOD_LEAP

    def _may_be_zero(self, i: int) -> bool:
        """Whether the plots hardly distinguish a key, or the share of outliers, from zero: near zero its logarithm has
        no slope, on which a search stalls, though it must rise where another one is held too low. Tested a little above
        zero, since no filter has σ = 0."""
        return self.value_along(i, self.lowest[i] + TOLERANCE) > self.top - HALF_CHI2_95

    def _raised_log(self, i: int) -> float:
        """The logarithm of such a key at which a search has a slope: the likelihood has fallen from the maximum."""
        log = max(float(self.best[i]), float(self.lowest[i]))
        while self.value_along(i, log) > self.top - HALF_CHI2_95 and log < self.highest[i]:
            log += 1.0
        return log

    def value_along(self, i: int, log: float, point: np.ndarray | None = None) -> float:
        """The log-likelihood with one key changed and all others at a point, by default the maximum."""
        point = (self.best if point is None else point).copy()
        point[i] = log
        return self.log_likelihood(point)

    def _expected_end_distances(self, moving: np.ndarray) -> np.ndarray:
        """A little more than the distance of the ends of each coordinate from the maximum, if the likelihood were a
        parabola of those that move."""
        distances, H = np.full(self.best.size, MAX_FIRST_DISTANCE), self.curvature_model.H
        if len(H) != len(moving):  # no curvature, where neighbours are impossible
            return np.full(self.best.size, UNKNOWN_END_DISTANCE)
        try:
            spreads = np.diag(np.linalg.inv(-H))
        except np.linalg.LinAlgError:
            spreads = np.full(len(moving), math.nan)
        is_known = (spreads > 0) & np.isfinite(spreads)
        found = 1.2 * np.sqrt(2 * HALF_CHI2_95 * np.where(is_known, spreads, 0.0))
        distances[moving] = np.where(is_known, np.minimum(found, MAX_FIRST_DISTANCE), UNKNOWN_END_DISTANCE)
        return distances


def follows_another_law(outliers: OutlierLaw) -> bool:
    """Whether outliers are so many and so far that the sound numbers would be too few or too alike."""
    is_limit = outliers.near >= MAX_NEAR_SHARE and outliers.near_width >= MAX_NEAR_WIDTH
    return outliers.far > MAX_PLAUSIBLE_OUTLIERS or is_limit


def _logit(share: float) -> float:
    """The logit of a share."""
    return math.log(share / (1 - share))
