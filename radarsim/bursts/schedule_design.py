"""Which windows an estimator runs through, and how often a hand-over fails.

Uss, Baryshev, Djavad 2010, equations 8–17.

A window of length T catches a start with error covariance R_Δ when Z = Δθᵀ H Δθ, H = (Φ + R_pr⁻¹)/2μ, stays below the
main-lobe threshold c with probability P_Δ. Z is a sum of χ²₁ with the eigenvalues of R_Δ H as weights; the paper takes
the Gaussian of the same two moments (14), `tail_probability` the sum itself."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from radarsim.bursts.burst import Burst, balanced_inverse

Tail = Literal["gaussian", "exact"]
PAPER_PROBABILITY, PAPER_FACTOR = 0.99, 3.0
MAX_WINDOWS = 200
NODES = 600  # of the tail integral: 10⁻¹² is reached from about 300 on


class NoSchedule(ValueError):
    """No sequence of windows follows from the burst and the forecast."""


@dataclass(frozen=True)
class Condition:
    """When a hand-over counts as safe: P_Δ, threshold c, and the law taken for the quadratic form."""

    probability: float = PAPER_PROBABILITY
    threshold: float = 1.0
    tail: Tail = "gaussian"


def spread_factor(probability: float) -> float:
    """Standard deviations that (14) asks for at P_Δ: the normal quantile in the proportion that makes it 3 at 0.99. The
    paper pairs 0.99 with 3, where a one-sided normal quantile would be 2.33."""
    from scipy.special import ndtri

    return float(PAPER_FACTOR * ndtri(probability) / ndtri(PAPER_PROBABILITY))


def tail_probability(weights: np.ndarray, threshold: float) -> float:
    """P(Σ wᵢ χ²₁ > c) for weights (n,) ≥ 0, to about 10⁻¹². Laplace inversion of the moment generating function Π(1 −
    2wᵢs)^(−½) along a parabola that starts between the pole at 0 and the first branch point and bends around the cut,
    where exp(−sc) makes the integrand vanish like a Gaussian."""
    weights = np.asarray(weights, dtype=float)
    weights = weights[weights > 1e-14 * weights.max()]
    edge = 0.5 / weights.max()
    # The start balances the pole against the edge: near the edge for a small tail.
    start = edge * max(0.5, 1.0 - 1.0 / (1.0 + threshold * edge))
    reach = math.asinh(math.sqrt(40.0 / (threshold * start)))
    w = (np.arange(NODES) + 0.5) * (reach / NODES)
    v = np.sinh(w)  # fine near the poles, far out to where the integrand has vanished
    s = start * (1.0 + v**2) + 1j * start * v
    ds = start * (2.0 * v + 1j) * np.cosh(w)
    logarithm = -0.5 * np.log(1.0 - 2.0 * weights[:, None] * s).sum(axis=0) - s * threshold
    return float(np.sum((np.exp(logarithm) / s * ds).imag) * (w[1] - w[0]) / math.pi)


def excess(weights: np.ndarray, condition: Condition) -> float:
    """Negative where a hand-over with weights (n,) is safe: the left side of (14) less c, or the tail's excess."""
    if condition.tail == "exact":
        return tail_probability(weights, condition.threshold) - (1.0 - condition.probability)
    spread = math.sqrt(2.0 * float(np.sum(weights**2)))
    return float(weights.sum()) + spread_factor(condition.probability) * spread - condition.threshold


class Form:
    """The quadratic form R_Δ H: its eigenvalues (size,), ascending."""

    def __init__(self, covariance: np.ndarray, curvature: np.ndarray):
        self._scale = np.sqrt(np.diag(curvature))
        balance = self._scale[:, None] * self._scale
        self._root = np.linalg.cholesky(curvature / balance)
        values, self._vectors = np.linalg.eigh(self._root.T @ (covariance * balance) @ self._root)
        self.values = np.maximum(values, 0.0)

    def leading(self) -> np.ndarray:
        """The direction (size,) of the largest eigenvalue, one σ long; its largest element, balanced, is positive."""
        direction = np.linalg.solve(self._root.T, self._vectors[:, -1] * np.sqrt(self.values[-1]))
        # An eigenvector's sign is LAPACK's choice.
        return direction * np.sign(direction[np.argmax(np.abs(direction))]) / self._scale


@dataclass(frozen=True)
class Designer:
    """Solves (15) and (16) for a burst, the prior spreads sigma (size,) of θ, and Φ_θ as a function of time in s."""

    burst: Burst
    sigma: np.ndarray
    fisher: Callable[[float], np.ndarray]
    condition: Condition

    def posterior(self, duration_s: float) -> tuple[np.ndarray, float]:
        """Φ_θ + R_pr⁻¹ of a window, and μ, of which Φ's first element is the double."""
        information = self.fisher(duration_s)
        return information + np.diag(self.sigma**-2.0), 0.5 * float(information[0, 0])

    def first_excess(self, duration_s: float) -> float:
        """Condition (15). The phase, unknown at first, is left out of the form, though not out of the estimate."""
        information, ratio = self.posterior(duration_s)
        error = np.diag(self.sigma[1:] ** 2) - balanced_inverse(information)[1:, 1:]
        return excess(Form(error, information[1:, 1:] / (2.0 * ratio)).values, self.condition)

    def handover(self, before_s: float) -> Callable[[float], Form]:
        """The error form when a window hands over to another, as a function of the latter's length (16)."""
        covariance = balanced_inverse(self.posterior(before_s)[0])

        def form(after_s: float) -> Form:
            information, ratio = self.posterior(after_s)
            return Form(covariance - balanced_inverse(information), information / (2.0 * ratio))

        return form

    def handover_excess(self, before_s: float) -> Callable[[float], float]:
        """Condition (16) on the length of the window after one of before_s."""
        form = self.handover(before_s)
        return lambda after_s: excess(form(after_s).values, self.condition)

    def longest(self, criterion: Callable[[float], float], shortest_s: float) -> int:
        """Pulses of the longest window that meets a criterion: its root, rounded to the nearest whole pulse."""
        from scipy.optimize import brentq

        if criterion(self.burst.duration_s) <= 0.0:
            return self.burst.pulses
        if criterion(shortest_s) >= 0.0:
            return self.burst.pulses_in(shortest_s)
        root = brentq(criterion, shortest_s, self.burst.duration_s, xtol=1e-4 * self.burst.pulse_period_s)
        return self.burst.pulses_in(root)

    def windows(self) -> list[int]:
        """Window lengths in pulses from T₀ (15) over (16) to the whole burst. None is shorter than there are
        parameters. Raises NoSchedule where over 200 are needed."""
        period, min_pulses = self.burst.pulse_period_s, len(self.sigma)
        sequence = [max(self.longest(self.first_excess, min_pulses * period), min_pulses)]
        while sequence[-1] < self.burst.pulses:
            if len(sequence) == MAX_WINDOWS:
                raise NoSchedule(f"it needs over {MAX_WINDOWS} windows")
            window_s = sequence[-1] * period
            next_pulses = self.longest(self.handover_excess(window_s), window_s * (1.0 + 1e-9))
            sequence.append(max(next_pulses, sequence[-1] + 1))
        return sequence


def densify(windows: list[int], density: int) -> list[int]:
    """`density` − 1 windows put between each neighbouring pair, in geometric progression."""
    dense = [windows[0]]
    for a, b in itertools.pairwise(windows):
        dense += [round(a * (b / a) ** (i / density)) for i in range(1, density)] + [b]
    return sorted(set(dense))


def handover_directions(designer: Designer, windows: list[int]) -> np.ndarray:
    """Directions (windows, size) in θ to search along before each window: the leading one of R_Δ at the hand-over. One
    direction is as long as an error of one radian rms over the window; the first window has none."""
    period = designer.burst.pulse_period_s
    directions = np.zeros((len(windows), len(designer.sigma)))
    for k in range(1, len(windows)):
        form = designer.handover(windows[k - 1] * period)(windows[k] * period)
        directions[k] = form.leading() / math.sqrt(form.values[-1])
    return directions
