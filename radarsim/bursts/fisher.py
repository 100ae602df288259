"""How accurately a burst can be measured at all: Fisher matrices, potential spreads, what they mean for the motion.

Uss, Baryshev, Djavad 2010: the Fisher matrix below (6), the potential accuracy after (7), T_min (17). Matrices are in
the units of θ = (φ₀, f₀, …), rad, Hz, Hz/s, ….
"""

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

    With the true θ the sums are exact; without, sin² of the phase is replaced by its mean ½, as in the closed form.
    """
    t = sample_times(burst, max(windows))
    x = t / burst.duration_s
    weight = np.full(t.shape, 1.0 if burst.complex_samples else 0.5)
    if theta is not None and not burst.complex_samples:
        turns = phase_turns(theta, t)
        weight = np.sin(2.0 * math.pi * (turns - np.rint(turns))) ** 2
    ends = np.array(windows) - 1
    moments = []
    for _ in range(2 * size - 1):
        moments.append(np.cumsum(weight.sum(axis=0))[ends])
        weight = weight * x  # products are the same on every processor, powers are not
    c, order = sensitivities(size, burst.duration_s), np.arange(size)
    level = burst.amplitude**2 / burst.noise_variance
    return [level * np.outer(c, c) * np.array(moments)[order[:, None] + order, w] for w in range(len(windows))]


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

    The beginning of the burst, where θ is defined, is the worst place: in the middle it is known many times better.
    """
    size = len(covariance)
    row = np.array([t_s ** (j - 1 - order) / math.factorial(j - 1 - order) if j > order else 0.0 for j in range(size)])
    return float(np.sqrt(row @ covariance @ row))
