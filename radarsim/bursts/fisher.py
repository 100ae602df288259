"""Fisher matrix, spreads and prior of a burst's phase.

Uss, Baryshev, Djavad 2010: the Fisher matrix below (6), the potential accuracy after (7), T_min (17). Matrices are in
the units of θ = (φ₀, f₀, …), rad, Hz, Hz/s, …."""

import math

import numpy as np

from radarsim.bursts.burst import Burst, balanced_inverse, phase_turns, sample_times


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
    prior_precision = np.diag(phase_prior(sigma))
    covariances = [balanced_inverse(data + prior_precision) for data in fisher_sums(burst, size, windows)]
    return np.sqrt([max(g @ R @ g, 0.0) for g, R in zip(gradients.T, covariances, strict=True)])


def phase_prior(sigma: np.ndarray) -> np.ndarray:
    """Prior precisions (size,) of θ as the estimator uses them: a phase known no better than π is not known at all."""
    precision = np.asarray(sigma, dtype=float) ** -2.0
    if sigma[0] > math.pi:
        precision[0] = 0.0
    return precision


def spreads(information: np.ndarray) -> np.ndarray:
    """Cramér–Rao bounds (size,) that an information matrix allows; infinite where it is singular."""
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
