"""The windows of many versions of a burst and of (14)–(16) at once: arrays of noise, threshold, prior and the rest.

`bursts/burst.py` does it for one burst, in every option of a config; this does it for real samples, one a pulse, in the
options that the paper leaves open. The tests hold the one against the other."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from radarsim.bursts.schedule_design import MAX_WINDOWS

Phase = Literal["left out of the form", "left out of the problem", "kept"]
Curvature = Literal["next", "as printed", "before"]
Rounding = Literal["nearest", "up", "down"]
Sum = Literal["closed form", "pulse by pulse"]
BERNOULLI = {2: 1 / 6, 4: -1 / 30, 6: 1 / 42, 8: -1 / 30}
Excess = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of which versions, at lengths in pulses
MAX_ROOT_STEPS = 60  # of the search for a root, at most
ROOT_TOLERANCE_PULSES = 1e-7  # pulses


class Version(NamedTuple):
    """One way to take the burst and (14)–(16).

    sigma: the forecast's spreads, (size,), rad, Hz, …; None: `multiples` of the Cramér–Rao bounds. curvature: which
    window H of (16) belongs to. The phase is that of the first window's problem (15)."""

    noise_variance: float
    threshold: float
    factor: float
    sigma: tuple[float, ...] | None
    phase: Phase
    rounding: Rounding
    curvature: Curvature
    pulses: int
    sum: Sum


@dataclass(frozen=True)
class Burst:
    """What all versions share: pulse period, s, and the multiples of the Cramér–Rao bounds of the forecast, (size,)."""

    period_s: float
    multiples: tuple[float, ...]
    amplitude: float = 1.0

    @property
    def size(self) -> int:
        return len(self.multiples)


BURST = Burst(1e-5, (100.0, 150.0, 500.0, 1000.0, 2000.0))  # of the paper's example
PRINTED_PRIOR = (6.1, 67.5, 6.1e3, 183.38e3, 2.426e6)  # rad, Hz, Hz/s, Hz/s², Hz/s³
MIN_ENERGY_RATIO = 5.0  # μ_min


def first_windows(burst: Burst, versions: Sequence[Version]) -> np.ndarray:
    """The first windows of versions in pulses, (B,); 0 where (15) has no root."""
    return _Problem(burst, versions).first()


@dataclass(frozen=True)
class Windows:
    """Of B versions: the Cramér–Rao bounds (B, size), and the window lengths in pulses, none where there is no root."""

    spreads: np.ndarray
    windows: list[list[int] | None]


def design_windows(burst: Burst, versions: Sequence[Version]) -> Windows:
    """Cramér–Rao bounds and windows of versions."""
    problem = _Problem(burst, versions)
    first = problem.first()
    sequence = [[int(n)] if n else None for n in first]
    active = np.flatnonzero(first)
    current = first.copy()
    for _ in range(MAX_WINDOWS):
        active = active[current[active] < problem.pulses[active]]
        if not active.size:
            break
        current[active] = problem.following(active, current[active])
        for i in active:
            lengths = sequence[i]
            assert lengths is not None  # only versions with a first window are active
            lengths.append(int(current[i]))
    return Windows(problem.spreads(), sequence)


def handover_weights(burst: Burst, version: Version, windows: Sequence[int]) -> list[np.ndarray]:
    """The weights (size,) of Z, a sum of χ²₁, at each hand-over from one of these windows, in pulses, to the next. H is
    that of the window that is handed to, as the paper defines it, whichever (16) was solved with."""
    problem = _Problem(burst, [version])
    information, H = problem.posterior(np.zeros(len(windows), dtype=int), np.array(windows, dtype=float))
    covariance = _inverse(information)
    roots = np.linalg.cholesky(H[1:])
    error = covariance[:-1] - covariance[1:]
    return list(np.maximum(np.linalg.eigvalsh(roots.transpose(0, 2, 1) @ error @ roots), 0.0))


def phase_offsets(burst: Burst, version: Version, windows: Sequence[int]) -> np.ndarray:
    """How far the best phase lies from the start's, rad, one σ (K,): from the forecast, then at hand-overs.

    windows (K,) in pulses. Of all parameters but the phase the start's stay: what a search over it alone would find."""
    problem = _Problem(burst, [version])
    information, _ = problem.posterior(np.zeros(len(windows), dtype=int), np.array(windows, dtype=float))
    covariance = _inverse(information)
    error = np.concatenate([np.diag(1 / problem.prior[0])[None], covariance[:-1]]) - covariance
    row = information[:, 0] / information[:, :1, 0]
    return np.sqrt(np.einsum("wi,wij,wj->w", row, error, row))


class _Problem:
    """Information matrices of B versions in units in which all are of one size: parameters over the whole burst."""

    def __init__(self, burst: Burst, versions: Sequence[Version]):
        self.size, order = burst.size, np.arange(burst.size)
        self.pulses = np.array([version.pulses for version in versions])
        self._level = burst.amplitude**2 / (2 * np.array([version.noise_variance for version in versions]))
        self._exact = np.array([version.sum == "pulse by pulse" for version in versions])
        duration = self.pulses * burst.period_s
        factorial = np.array([math.factorial(j) for j in order], dtype=float)
        self._unit = 2 * np.pi * duration[:, None] ** order / factorial
        self._unit[:, 0] = 1.0
        sigma = np.array([version.sigma or (np.nan,) * self.size for version in versions])
        multiples = np.array(burst.multiples) * self.spreads()
        self.prior = (np.where(np.isfinite(sigma), sigma, multiples) * self._unit) ** -2.0  # of R_pr⁻¹, its diagonal
        self._threshold = np.array([version.threshold for version in versions])
        self._factor = np.array([version.factor for version in versions])
        self._phase = np.array([version.phase for version in versions])
        self._curvature = np.array([version.curvature for version in versions])
        self._rounding = np.array([version.rounding for version in versions])

    def spreads(self) -> np.ndarray:
        """Cramér–Rao bounds (B, size) of the whole burst."""
        indices = np.arange(len(self.pulses))
        variance = np.diagonal(_inverse(self._fisher(indices, self.pulses.astype(float))), axis1=1, axis2=2)
        return np.sqrt(variance) / self._unit

    def _fisher(self, indices: np.ndarray, n: np.ndarray) -> np.ndarray:
        """Φ (len(indices), size, size) of the first n pulses, any real number of them: Σ l^(i+j) for l = 0 … n − 1."""
        x = n / self.pulses[indices]
        moments = []
        for p in range(2 * self.size - 1):
            total = x ** (p + 1) / (p + 1)
            if p:  # Faulhaber: what the sum has beyond the integral
                beyond = -(x**p) / (2 * self.pulses[indices])
                falling = float(p)
                for k, number in BERNOULLI.items():
                    if k > p:
                        break
                    beyond += number / math.factorial(k) * falling * x ** (p + 1 - k) / self.pulses[indices] ** k
                    falling *= (p - k + 1) * (p - k)
                total = total + np.where(self._exact[indices], beyond, 0.0)
            moments.append(total * self.pulses[indices])
        order = np.arange(self.size)
        return self._level[indices, None, None] * np.array(moments)[order[:, None] + order].transpose(2, 0, 1)

    def posterior(self, indices: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Φ + R_pr⁻¹ and H = (Φ + R_pr⁻¹)/2μ, of which Φ's first element is 2μ."""
        fisher = self._fisher(indices, n)
        information = fisher + self.prior[indices, None, :] * np.eye(self.size)
        return information, information / fisher[:, :1, :1]

    def _excess(self, indices: np.ndarray, R: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """The left side of (14) less c, with H of the first and of the second term."""
        spread = np.einsum("bij,bji->b", second @ R, second @ R)
        trace = np.einsum("bij,bji->b", R, first)
        return trace + self._factor[indices] * np.sqrt(2 * np.maximum(spread, 0)) - self._threshold[indices]

    def _first_excess(self, indices: np.ndarray, n: np.ndarray) -> np.ndarray:
        """(15) of each version, with the phase as it says."""
        information, H = self.posterior(indices, n)
        prior = 1 / self.prior[indices, None, :] * np.eye(self.size)
        excess = np.empty(len(indices))
        for phase in np.unique(self._phase[indices]):
            has_phase = self._phase[indices] == phase
            A, h, R = information[has_phase], H[has_phase], prior[has_phase]
            if phase == "left out of the problem":
                A = A[:, 1:, 1:]
            inverse = _inverse(A)
            if phase == "left out of the form":
                inverse = inverse[:, 1:, 1:]
            if phase != "kept":
                h, R = h[:, 1:, 1:], R[:, 1:, 1:]
            excess[has_phase] = self._excess(indices[has_phase], R - inverse, h, h)
        return excess

    def first(self) -> np.ndarray:
        """The first window in pulses (B,); 0 where (15) has no root."""
        indices = np.arange(len(self.pulses))
        fewest = np.full(len(indices), float(self.size))
        has_root = self._first_excess(indices, fewest) <= 0
        lengths = np.zeros(len(indices), dtype=int)
        lengths[has_root] = self._longest(indices[has_root], fewest[has_root], self._first_excess)
        return lengths

    def following(self, indices: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """The windows after those of these lengths, in pulses."""
        information, H_before = self.posterior(indices, lengths.astype(float))
        covariance = _inverse(information)
        place = {int(i): k for k, i in enumerate(indices)}

        def excess(subset: np.ndarray, n: np.ndarray) -> np.ndarray:
            positions = [place[int(i)] for i in subset]
            after, H = self.posterior(subset, n)
            curvature = self._curvature[subset, None, None]
            first = np.where(curvature == "next", H, H_before[positions])
            second = np.where(curvature == "before", H_before[positions], H)
            return self._excess(subset, covariance[positions] - _inverse(after), first, second)

        return np.maximum(self._longest(indices, lengths * (1 + 1e-9), excess), lengths + 1)

    def _longest(self, indices: np.ndarray, low: np.ndarray, excess: Excess) -> np.ndarray:
        """Pulses of the longest windows with no excess: their roots, rounded as each version says."""
        burst_lengths = self.pulses[indices].astype(float)
        lengths = burst_lengths.copy()
        shorter = np.flatnonzero(excess(indices, burst_lengths) > 0)
        lengths[shorter] = _roots(
            lambda subset, n: excess(indices[shorter][subset], n), low[shorter].copy(), burst_lengths[shorter]
        )
        rounding = self._rounding[indices]
        rounded = np.where(
            rounding == "up", np.ceil(lengths), np.where(rounding == "down", np.floor(lengths), np.rint(lengths))
        )
        return np.minimum(np.maximum(rounded, self.size), self.pulses[indices]).astype(int)


def _roots(excess: Excess, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Roots (m,) of functions that rise through zero between low and high; excess(indices, lengths) gives the values.

    Regula falsi in the logarithm of the length; the value at the unchanged end is halved, so that both ends move
    (Illinois)."""
    indices = np.arange(len(low))
    a, b = np.log(low), np.log(high)
    fa, fb = excess(indices, low), excess(indices, high)
    root = np.where(fa >= 0, low, high)
    live = np.flatnonzero((fa < 0) & (fb > 0))
    for _ in range(MAX_ROOT_STEPS):
        if not live.size:
            break
        m = (a[live] * fb[live] - b[live] * fa[live]) / (fb[live] - fa[live])
        value = excess(indices[live], np.exp(m))
        is_above = value > 0
        up, down = live[is_above], live[~is_above]
        fa[up] /= 2
        fb[down] /= 2
        b[up], fb[up] = m[is_above], value[is_above]
        a[down], fa[down] = m[~is_above], value[~is_above]
        root[live] = np.exp(m)
        done = (np.exp(b[live]) - np.exp(a[live]) < ROOT_TOLERANCE_PULSES) | (abs(value) < 1e-13)
        live = live[~done]
    return root


def _inverse(A: np.ndarray) -> np.ndarray:
    """Inverses (B, n, n) of positive definite matrices, balanced."""
    scale = 1 / np.sqrt(np.diagonal(A, axis1=1, axis2=2))
    balance = scale[:, :, None] * scale[:, None, :]
    return np.linalg.inv(A * balance) * balance
