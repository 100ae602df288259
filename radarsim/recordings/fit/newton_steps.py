"""Newton steps to the maximum of a likelihood."""

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from radarsim.recordings.fit.likelihood_slice import IMPOSSIBLE_LOG_LIKELIHOOD

# step of a search at its start, and its end before a restart, in the same logarithms
FIRST_STEP = 0.3
# Accuracy of a maximum and of an interval's end, in the logarithm of a key; of the likelihood a tenth of that. Far
# finer than printed digits, since the path of a search depends on last digits, and these differ between processors.
TOLERANCE = 1e-6


class StepSizes(NamedTuple):
    """The accuracy of a search, and its differences for a slope, and for slope and curvature, in the logarithm of a
    key."""

    tolerance: float
    slope: float
    curvature: float


SMOOTH_STEPS = StepSizes(TOLERANCE, 1e-3, 1e-2)
LEAP_STEPS = StepSizes(1e-4, 1e-2, 3e-2)  # of a likelihood that leaps, by 1e-3, where hypotheses are merged or dropped
# Where these fail, differences are widened until the likelihood falls by so much, beside which leaps are small.
WIDE_FALL, WIDENING, MAX_DIFFERENCE = 0.5, 2.0, 0.5
# curvature that counts as none, and the longest Newton step, in that logarithm
MIN_CURVATURE = 1e-3
MAX_NEWTON_STEP = 1.5
MAX_CORRELATION = 0.999  # of the correlation of two keys


def polish_maximum(
    log_likelihood_at: Callable[[np.ndarray], float],
    point: np.ndarray,
    steps: StepSizes = SMOOTH_STEPS,
    moving: np.ndarray | None = None,
) -> np.ndarray:
    """The maximum of a likelihood near the result of a search, by two Newton steps of its moving coordinates; default:
    of all.

    A search by comparison stalls at the root of the last digits. They make a difference over 10⁻³ wrong by 10⁻⁷, and
    the maximum as well."""
    curvature, start = Curvature(log_likelihood_at, steps), point
    start_value, moving = log_likelihood_at(point), np.arange(point.size) if moving is None else moving
    if not moving.size or not math.isfinite(curvature.step(point, start_value, moving)[1]):
        return start
    moves = steps.slope * np.eye(point.size)[moving]
    for _ in range(2):
        rises = [log_likelihood_at(point + move) - log_likelihood_at(point - move) for move in moves]
        point = point.copy()
        point[moving] += curvature.newton_step(np.array(rises) / (2 * steps.slope))
    return (
        point
        if log_likelihood_at(point) >= start_value - steps.tolerance and np.abs(point - start).max() < FIRST_STEP
        else start
    )


class Curvature:
    """Curvature of a likelihood near a point, for Newton steps: along each coordinate it is computed anew at each step,
    from the differences that give the slope; cross terms between coordinates, (n, n), are kept from before.

    differences: of all coordinates, to be widened in place; None: those of the steps, as they are."""

    def __init__(
        self, log_likelihood_at: Callable[[np.ndarray], float], steps: StepSizes, differences: np.ndarray | None = None
    ):
        self.log_likelihood_at, self.steps, self.differences = log_likelihood_at, steps, differences
        self.correlations: np.ndarray | None = None
        self.H = np.zeros((0, 0))  # the curvature at the last step, of the coordinates free then

    def step(self, point: np.ndarray, value: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """An ascending step from `at`, of the free coordinates alone, and its predicted gain."""
        sizes, above, below = self._differences(point, value, free)
        if not (np.isfinite(value) and min(above.min(), below.min(), value) > IMPOSSIBLE_LOG_LIKELIHOOD):
            return np.zeros(point.size), math.nan
        slope, curvature = (above - below) / (2 * sizes), (above - 2 * value + below) / sizes**2
        moves = sizes[:, None] * np.eye(point.size)[free]
        scale = np.sqrt(np.maximum(np.abs(curvature), MIN_CURVATURE))
        if self.correlations is None:
            self.correlations = np.eye(point.size)
            for i, j in itertools.combinations(range(free.size), 2):
                cross = self.log_likelihood_at(point + moves[i] + moves[j]) - above[i] - above[j] + value
                correlation = float(
                    np.clip(cross / (sizes[i] * sizes[j]) / (scale[i] * scale[j]), -MAX_CORRELATION, MAX_CORRELATION)
                )
                self.correlations[free[i], free[j]] = self.correlations[free[j], free[i]] = correlation
        self.H = H = self.correlations[np.ix_(free, free)] * np.outer(scale, scale)
        np.fill_diagonal(H, np.where(np.abs(curvature) < MIN_CURVATURE, -MIN_CURVATURE, curvature))
        step = np.zeros(point.size)
        step[free] = self.newton_step(slope)
        return step, float(step[free] @ slope)

    def _differences(self, point: np.ndarray, value: float, free: np.ndarray) -> tuple[np.ndarray, ...]:
        """The differences in the free coordinates, and the likelihoods above and below by these, (n,) each."""
        sizes = np.full(free.size, self.steps.curvature) if self.differences is None else self.differences[free]
        values = np.empty((2, free.size))
        for k, move in enumerate(np.eye(point.size)[free]):
            while True:
                values[:, k] = [self.log_likelihood_at(point + sign * sizes[k] * move) for sign in (1, -1)]
                if self.differences is None:
                    break
                fall = abs(value - values[:, k].mean())
                if not fall < WIDE_FALL or sizes[k] >= MAX_DIFFERENCE:
                    if fall > WIDE_FALL * WIDENING**3:
                        self.differences[free[k]] = max(sizes[k] / WIDENING, self.steps.curvature)
                    break
                sizes[k] = self.differences[free[k]] = min(WIDENING * sizes[k], MAX_DIFFERENCE)
        return sizes, *values

    def newton_step(self, slope: np.ndarray) -> np.ndarray:
        """The Newton step up a slope (n,), at most MAX_NEWTON_STEP along any axis of the curvature."""
        sizes, axes = np.linalg.eigh(self.H)
        coordinates = axes.T @ slope / np.maximum(np.abs(sizes), MIN_CURVATURE)
        return axes @ np.clip(coordinates, -MAX_NEWTON_STEP, MAX_NEWTON_STEP)
