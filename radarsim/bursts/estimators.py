"""How accurately a burst can be measured at all: Fisher matrices, potential spreads, what they mean for the motion.

Uss, Baryshev, Djavad 2010: the Fisher matrix below (6), the potential accuracy after (7), T_min (17). Matrices are in
the units of θ = (φ₀, f₀, …), rad, Hz, Hz/s, ….

Arrays for the estimator's kernels: the burst cut into blocks, each estimator's windows and step matrices."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from radarsim.bursts.burst import (
    Burst,
    Designer,
    balanced_inverse,
    handover_directions,
    phase_turns,
    sample_times,
    signal,
    turns_per_parameter,
)
from radarsim.bursts.kernels.scoring import PHYSICS, SIZE, Z0, block_table
from radarsim.bursts.kernels.sequence import OPTIONS, WINDOW


# ---- fisher ----------------------------------------------------------------------------------------------------------
def energy_ratio(burst: Burst, duration_s: float) -> float:
    """μ = A² T t_p / (4 σ² Δt T_p); twice that for complex samples, each of which is two numbers."""
    samples = burst.samples_per_pulse * duration_s / burst.pulse_period_s
    return (2 if burst.complex_samples else 1) * burst.amplitude**2 * samples / (4.0 * burst.noise_variance)


def shortest_window(burst: Burst, least_ratio: float = 5.0) -> float:
    """T_min (17) in s: where μ reaches μ_min."""
    return least_ratio * burst.pulse_period_s / energy_ratio(burst, burst.pulse_period_s)


def sensitivities(size: int, duration_s: float) -> np.ndarray:
    """k(t) at the end of a window, (size,): its value at τT is this times τ^j."""
    factors = np.array([2.0 * math.pi * duration_s**j / math.factorial(j) for j in range(size)])
    factors[0] = 1.0
    return factors


def fisher(burst: Burst, size: int, duration_s: float) -> np.ndarray:
    """Fisher matrix (size, size) in closed form, 2μ c_i c_j T^{i+j} / (i + j + 1)."""
    c, order = sensitivities(size, duration_s), np.arange(size)
    return 2.0 * energy_ratio(burst, duration_s) * np.outer(c, c) / (order[:, None] + order + 1.0)


def fisher_sums(burst: Burst, size: int, windows: list[int], theta: np.ndarray | None = None) -> list[np.ndarray]:
    """Fisher matrices (size, size) of the samples up to each window (in pulses), from running sums of powers of time.
    With the true θ the sums are exact; without, sin² of the phase is replaced by its mean ½, as in the closed form."""
    t = sample_times(burst, max(windows))
    x = t / burst.duration_s
    weight = np.full(t.shape, 1.0 if burst.complex_samples else 0.5)
    if theta is not None and not burst.complex_samples:
        turns = phase_turns(theta, t)
        weight = np.sin(2.0 * math.pi * (turns - np.rint(turns))) ** 2
    moments = running_moments(weight, x, windows, 2 * size - 1)
    c, order = sensitivities(size, burst.duration_s), np.arange(size)
    level = burst.amplitude**2 / burst.noise_variance
    return [level * np.outer(c, c) * moments[order[:, None] + order, w] for w in range(len(windows))]


def running_moments(weight: np.ndarray, x: np.ndarray, windows: list[int], count: int) -> np.ndarray:
    """Sums (count, K) of weight · x^j, j = 0 … count − 1, over the samples up to each window (in pulses).

    weight and x are (samples per pulse, pulses)."""
    ends, moments = np.array(windows) - 1, []
    for _ in range(count):
        moments.append(np.cumsum(weight.sum(axis=0))[ends])
        weight = weight * x  # products are the same on every processor, powers are not
    return np.array(moments)


def image_bias(burst: Burst, sigma: np.ndarray, windows: list[int], turns: np.ndarray) -> np.ndarray:
    """How far real samples' estimates of each window (K,) lie off where the image is left out, in standard deviations.

    That is √(gᵀ (Φ_θ + R_pr⁻¹)⁻¹ g), no less than the bias of any component over its spread with the prior. At the
    truth the image in Re Σ u e^{-jψ} has the gradient g = (A²/2σ²) Σ sin 2ψ k, which the second sum of (5) takes away.
    It is the same in every burst, so estimates without that sum are biased, by the more of their spreads the larger
    A/σ is. sigma (size,) is the prior's, turns (samples per pulse, pulses) the true phase."""
    x, size = sample_times(burst, max(windows)) / burst.duration_s, len(sigma)
    turns = turns[:, : max(windows)]
    sums = running_moments(np.sin(4.0 * math.pi * (turns - np.rint(turns))), x, windows, size)
    level = burst.amplitude**2 / (2.0 * burst.noise_variance)
    gradients = level * sensitivities(size, burst.duration_s)[:, None] * sums
    known = np.diag(phase_prior(sigma))
    covariances = [balanced_inverse(data + known) for data in fisher_sums(burst, size, windows)]
    return np.sqrt([max(g @ R @ g, 0.0) for g, R in zip(gradients.T, covariances, strict=True)])


def phase_prior(sigma: np.ndarray) -> np.ndarray:
    """Prior precisions (size,) of θ as the estimator uses them: a phase known no better than π is not known at all."""
    precision = np.asarray(sigma, dtype=float) ** -2.0
    if sigma[0] > math.pi:
        precision[0] = 0.0
    return precision


def spreads(information: np.ndarray) -> np.ndarray:
    """Potential standard deviations (size,) that an information matrix allows; infinite where it is singular."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.diag(balanced_inverse(information))
    except np.linalg.LinAlgError:
        return np.full(len(information), np.inf)
    return np.sqrt(np.where(variance > 0.0, variance, np.inf))


def derivative_spread(covariance: np.ndarray, order: int, t_s: float) -> float:
    """Spread of the frequency's derivative of this order at time t within the burst, from the covariance (n, n) of θ.

    The beginning of the burst, where θ is defined, is the worst place: in the middle it is known many times better."""
    size = len(covariance)
    row = np.array([t_s ** (j - 1 - order) / math.factorial(j - 1 - order) if j > order else 0.0 for j in range(size)])
    return float(np.sqrt(row @ covariance @ row))


# ---- estimators ------------------------------------------------------------------------------------------------------
Blocks = Callable[[int], tuple[int, int, int]]
# The sum at twice the frequency is left out of the likelihood where it is less of every window's samples than this, and
# where that biases no estimate by more than this in its standard deviations: then no σ is over 2 % too large.
IMAGE_SHARE, IMAGE_BIAS = 0.02, 0.2


@dataclass(frozen=True)
class Design:
    """One estimator: window lengths in pulses, and how it starts, steps and searches; see `sequence.OPTIONS`."""

    windows: tuple[int, ...]
    phases: int = 0
    steps: int = 40
    tolerance: float = 1e-3
    coherent: bool = False
    search: int = 0
    spacing: float = 0.8
    margin: float = 3.0
    from_truth: bool = False
    amplitude: int = 0
    forecast: bool = True  # whether the prior is used


@dataclass(frozen=True)
class World:
    """The burst for the kernels, see `kernels.sequence.estimate_block`."""

    physics: np.void
    edges: np.ndarray
    clean: np.ndarray
    mean: np.ndarray
    factor: np.ndarray

    @property
    def sums(self) -> np.ndarray:
        """Means (blocks, 4) of Z₀ and Z₁, of which factor (blocks, 10) is the covariance root."""
        return np.ascontiguousarray(self.mean[Z0 : Z0 + 4, : len(self.factor)].T)


def has_image(burst: Burst, sigma: np.ndarray, windows: list[int], truth_turns: np.ndarray) -> bool:
    """Whether the sum at twice the frequency counts in any window, of forecasts of standard deviations sigma (size,).
    Phases (samples per pulse, pulses) are in turns."""
    if burst.complex_samples:
        return False
    ends = np.array(windows)
    doubled = np.cumsum(np.exp(-4j * math.pi * (truth_turns - np.rint(truth_turns))).sum(axis=0))[ends - 1]
    shares = np.abs(doubled) / (burst.samples_per_pulse * ends)
    return bool(shares.max() > IMAGE_SHARE or image_bias(burst, sigma, windows, truth_turns).max() > IMAGE_BIAS)


def world(
    burst: Burst, mode: int, edges: np.ndarray, image: bool, truth_turns: np.ndarray, reference_turns: np.ndarray
) -> World:
    """Arrays of a burst; phases (samples per pulse, pulses) in turns, the same unless the truth is no polynomial."""
    physics = np.zeros(1, PHYSICS)
    physics[0] = (
        mode,
        burst.complex_samples,
        image,
        burst.pulses,
        burst.samples_per_pulse,
        burst.amplitude,
        math.sqrt(burst.noise_variance),
        1.0 / burst.pulses,
        burst.sampling_period_s / burst.duration_s,
    )
    clean = signal(burst, truth_turns)
    mean, factor = block_table(physics[0], edges, reference_turns, clean)
    rows = [clean.real.ravel(), clean.imag.ravel()] if burst.complex_samples else [clean.ravel()]
    return World(physics[0], edges.astype(np.int64), np.stack(rows), mean, factor)


def step_root(data: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows v (size, size) with Σ v vᵀ = (Φ + P)⁻¹ and vᵀ Φ v = share (size,): Φ the data's, P the prior's information.
    Then (ρΦ + P)⁻¹ = Σ v vᵀ / (1 − (1 − ρ) share) for any coherence ρ."""
    information = data + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(information))
    lower = np.linalg.cholesky(information * np.outer(scale, scale))
    white = np.linalg.solve(lower, np.linalg.solve(lower, data * np.outer(scale, scale)).T)
    share, vectors = np.linalg.eigh(0.5 * (white + white.T))
    return (np.linalg.solve(lower.T, vectors) * scale[:, None]).T, np.clip(share, 0.0, 1.0)


def estimators(
    designs: list[Design],
    blocks: Blocks,
    burst: Burst,
    sigma: np.ndarray,
    information: Mapping[int, np.ndarray],
    designer: Designer,
) -> tuple[np.ndarray, np.ndarray]:
    """Records of the windows (F, K) and options (F,) of a case's estimators.

    blocks gives a window's place in the table of blocks, in that of weights, and its number of blocks, see `Tables`;
    information is Φ_θ by window in the units of θ, sigma (size,) is the prior. Unused windows stay zero."""
    size, whole = len(sigma), turns_per_parameter(len(sigma), burst.duration_s)
    windows = np.zeros((len(designs), max(len(d.windows) for d in designs)), WINDOW)
    options = np.zeros(len(designs), OPTIONS)
    for e, design in enumerate(designs):
        for name in OPTIONS.names or ():
            options[e][name] = len(design.windows) if name == "windows" else getattr(design, name)
        directions = handover_directions(designer, list(design.windows)) if design.search else None
        for k, pulses in enumerate(design.windows):
            window = windows[e, k]
            window["pulses"] = pulses
            window["table"], window["weights"], window["blocks"] = blocks(pulses)
            window["powers"] = (pulses / burst.pulses) ** np.arange(SIZE)
            turns = whole * window["powers"][:size]
            if design.forecast:
                window["precision"][:size] = phase_prior(sigma) / turns**2
            root, share = step_root(information[pulses] / np.outer(turns, turns), window["precision"][:size])
            window["root"][:size, :size], window["share"][:size] = root, share
            if directions is not None:
                window["direction"][:size] = directions[k] * whole
    return windows, options
