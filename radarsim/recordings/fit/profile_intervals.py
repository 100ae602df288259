"""The profile interval of each key of a likelihood.

An interval consists of the values of a key at which the largest log-likelihood over all other keys is within half the
95 % point of chi-square of the maximum (profile likelihood)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.recordings.fit.profile_search import HALF_CHI2_95, INTERVAL_REACH, ROUGH_TOLERANCE, LikelihoodSearch

TRIAL_FALLS = np.array([2.0, 4.0, 6.0])  # below these a key that may be zero is clearly not zero, in that logarithm
OUTSIDE_STEP = 0.05  # beyond an end, in the logarithm of a key: where other near outliers are tried
MAX_CLIMB_GAIN = 5.0  # of the log-likelihood, from there: starts that are lower are not searched
CROSSING_POINTS = 4  # of a profile, from which an end is interpolated
MAX_INTERPOLATIONS = 8  # of an end, before its bracket is halved: usual are 2 to 5
MIN_FRACTION = 0.1  # of a bracket, by which it shrinks where a straight line is taken


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


class ProfilePoint(NamedTuple):
    """A point of a profile: the logarithm of the key held, the largest likelihood there, and its coordinates."""

    log_key: float
    value: float
    point: np.ndarray


class ProfileIntervals:
    """The intervals of the keys of a likelihood around the maximum that a search has found."""

    def __init__(self, search: LikelihoodSearch):
        self.search = search

    def interval(self, i: int) -> FittedKey:
        """The 95 % profile interval of key i."""
        search = self.search
        limit = max(search.top, min(search.rival_top, search.top + HALF_CHI2_95 / 2)) - HALF_CHI2_95
        lo, hi = (self._interval_end(i, direction, limit) for direction in (-1, 1))
        value = float(search.to_values(search.best)[i])
        lowest = search.lowest[i]
        bounds = (0.0 if lo is None or lo <= lowest else math.exp(lo), math.inf if hi is None else math.exp(hi))
        stated = float(search.likelihood.stated[i])
        return FittedKey(search.likelihood.keys[i], stated, value, *bounds, bounds[0] > 0 and math.isfinite(bounds[1]))

    def _interval_end(self, i: int, direction: int, limit: float) -> float | None:
        """The logarithm of key i at which the profile falls to a limit; None if not within INTERVAL_REACH."""
        search = self.search
        lowest = float(search.lowest[i])
        point = search.best
        if search.rival_top >= limit and direction * (search.rival[i] - point[i]) > 0:
            point = search.rival
        home = max(float(point[i]), lowest)
        step = float(search.end_distances[i])
        # from zero the end may be farther than INTERVAL_REACH: up to there it is not
        if direction > 0 and i in search.raised_keys:
            home, step = max(home, search.raised_keys[i] - 1.0), 0.1
        inside = ProfilePoint(home, search.value_along(i, home, point), point)
        while abs(inside.log_key - home) < math.log(INTERVAL_REACH):
            outside = self._profile(i, inside.log_key + direction * step, inside.point)
            if outside.value < limit:
                end = self._find_crossing(i, inside, outside, limit)
                farther = self._farther_point(i, direction, end, limit)
                if farther is None:
                    search.end_count += 1
                    return end.log_key
                outside, step = farther, OUTSIDE_STEP / 2
            if outside.log_key < lowest:
                return None
            inside, step = outside, 2 * step
        return None

    def _farther_point(self, i: int, direction: int, end: ProfilePoint, limit: float) -> ProfilePoint | None:
        """A point of the interval of key i beyond the end of it so far, where something that is zero rises, or where
        near outliers of another kind make the plots likely enough; None if there is none."""
        raised = self._with_raised_zeros(i, end)
        if raised.value > limit + ROUGH_TOLERANCE:
            return raised
        start = end.point.copy()
        start[i] = log_key = end.log_key + direction * OUTSIDE_STEP
        for j in self.search.near_starts:
            point, value = self.search.climb_to_near_outliers(start, j, i, limit - MAX_CLIMB_GAIN)
            if value > limit:
                return ProfilePoint(log_key, value, point)
        return None

    def _find_crossing(self, i: int, inside: ProfilePoint, outside: ProfilePoint, limit: float) -> ProfilePoint:
        """Where the profile of key i crosses a limit between two points.

        The key and all coordinates are nearly straight lines as functions of the square root of the fall from the
        maximum. So they are interpolated by polynomials in it, through the points nearest to the limit; where these
        fail, by a straight line through the ends of the bracket, and last by its middle: the likelihood has few digits
        where plots are far from what the keys allow."""

        def height(point: ProfilePoint) -> float:
            fall = self.search.top - point.value
            return math.copysign(math.sqrt(2 * abs(fall)), fall)

        wanted = math.sqrt(2 * (self.search.top - limit))
        bracket, points, last_change = [inside, outside], [inside, outside], abs(outside.log_key - inside.log_key)
        interpolations = 0
        while True:
            points = sorted(points, key=lambda point: abs(height(point) - wanted))[:CROSSING_POINTS]
            low, high = sorted(point.log_key for point in bracket)
            end = self._interpolate(points, _polynomial_weights([height(point) for point in points], wanted))
            if interpolations >= MAX_INTERPOLATIONS:
                end = self._interpolate(bracket, (0.5, 0.5))
            elif not low < end.log_key < high:
                end = self._interpolate(bracket, _line_weights([height(point) for point in bracket], wanted))
            change = abs(end.log_key - points[0].log_key)
            if (
                change * min(1.0, change / last_change) < self.search.steps.tolerance
                or high - low < self.search.steps.tolerance
            ):
                return end._replace(value=limit)
            last_change, interpolations = change, interpolations + 1
            point = self._profile(i, end.log_key, end.point)
            bracket[int(point.value < limit)] = point
            points.append(point)

    def _interpolate(self, points: Sequence[ProfilePoint], weights: Sequence[float]) -> ProfilePoint:
        """The sum of points by weights; coordinates that are zero in one of them are those of the first."""
        log_key = sum(weight * point.log_key for weight, point in zip(weights, points, strict=True))
        coordinates = np.sum([weight * point.point for weight, point in zip(weights, points, strict=True)], axis=0)
        is_zero = np.any([point.point <= self.search.lowest for point in points], axis=0)
        return ProfilePoint(log_key, math.nan, np.where(is_zero, points[0].point, coordinates))

    def _profile(self, i: int, log_key: float, neighbour: np.ndarray) -> ProfilePoint:
        """The point of the profile with key i held at a logarithm, reached from a neighbour; what is zero there stays
        so."""
        start = neighbour.copy()
        start[i] = log_key
        point, value = self.search.climb(start, i, self.search.steps.tolerance)
        return ProfilePoint(log_key, value, point)

    def _with_raised_zeros(self, i: int, end: ProfilePoint) -> ProfilePoint:
        """A point of the profile with other keys and shares raised from zero where that makes the plots likelier."""
        for j, raised_log in self.search.raised_keys.items():
            if j != i and end.point[j] <= self.search.lowest[j]:
                for trial_log in (raised_log, *(raised_log - TRIAL_FALLS)):
                    start = end.point.copy()
                    start[j] = trial_log
                    if self.search.log_likelihood(start) > end.value:
                        end = self._profile(i, end.log_key, start)
                        break
        return end


def _polynomial_weights(heights: Sequence[float], wanted: float) -> list[float]:
    """The weights of points in the polynomial through them, at a height; not-a-number where two have the same."""
    if len(set(heights)) < len(heights):
        return [math.nan] * len(heights)
    return [
        math.prod((wanted - other) / (own - other) for k, other in enumerate(heights) if k != j)
        for j, own in enumerate(heights)
    ]


def _line_weights(heights: Sequence[float], wanted: float) -> tuple[float, float]:
    """The weights of the two ends of a bracket, where a straight line has a height, or nearly: it must shrink."""
    fraction = (wanted - heights[0]) / (heights[1] - heights[0])
    fraction = min(max(fraction, MIN_FRACTION), 1 - MIN_FRACTION)
    return 1 - fraction, fraction
