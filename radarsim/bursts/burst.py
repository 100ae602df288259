"""A coherent burst of pulses and the phase of its echo.

The formulas are equations 1–4 of Uss, Baryshev, Djavad 2010.

The echo's phase is k(t) θ with θ = (φ₀, f₀, f₁, …, f_n) in rad, Hz, Hz/s, … and k(t) = (1, 2πt, 2πt²/2!, …,
2πt^{n+1}/(n+1)!). Kernels count phases in turns and times in windows: p(τ) = Σ b_j τ^j with τ = t/T, b_0 = φ₀/2π and
b_j = f_{j-1} T^j / j!. A burst is sampled only inside its pulses, at l T_p + m Δt."""

import math
from dataclasses import dataclass

import numpy as np

LIGHT_MPS = 299_792_458.0


@dataclass(frozen=True)
class Burst:
    """What is sent and how it is sampled; one noise variance for each real number sampled."""

    carrier_hz: float
    pulse_period_s: float
    pulse_length_s: float
    sampling_period_s: float
    pulses: int
    amplitude: float
    noise_variance: float
    complex_samples: bool = False

    @property
    def duration_s(self) -> float:
        return self.pulses * self.pulse_period_s

    @property
    def samples_per_pulse(self) -> int:
        """Samples at 0, Δt, 2Δt, … below the pulse length, a hair of rounding forgiven."""
        return max(1, math.ceil(self.pulse_length_s / self.sampling_period_s - 1e-6))

    @property
    def wavelength_m(self) -> float:
        return LIGHT_MPS / self.carrier_hz

    def pulses_in(self, duration_s: float) -> int:
        """The nearest whole number of pulses (0.3 s / 10 µs is 29999.99…), at least one and at most all."""
        return min(max(1, round(duration_s / self.pulse_period_s)), self.pulses)


def sample_times(burst: Burst, pulses: int) -> np.ndarray:
    """Times in s of the samples of the first `pulses` pulses, (samples per pulse, pulses)."""
    offsets = np.arange(burst.samples_per_pulse) * burst.sampling_period_s
    return offsets[:, None] + np.arange(pulses) * burst.pulse_period_s


def turns_per_parameter(size: int, duration_s: float) -> np.ndarray:
    """Factors (size,) that take θ = (φ₀, f₀, …) to the coefficients b of the phase in turns over a window."""
    orders = np.arange(size)
    factors = duration_s**orders / np.array([math.factorial(j) for j in orders])
    factors[0] = 1.0 / (2.0 * math.pi)
    return factors


def phase_turns(theta: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Phase in turns of parameters θ (size,) at times t in s, any shape."""
    coefficients = np.asarray(theta, dtype=float) * turns_per_parameter(len(theta), 1.0)
    return np.polynomial.polynomial.polyval(t, coefficients)


def signal(burst: Burst, turns: np.ndarray) -> np.ndarray:
    """Noise-free samples at phases in turns, any shape: A cos (4), or A exp j where the receiver gives complex ones."""
    angle = 2.0 * math.pi * (turns - np.rint(turns))
    return burst.amplitude * (np.exp(1j * angle) if burst.complex_samples else np.cos(angle))


@dataclass(frozen=True)
class VelocityProfile:
    """Radial velocity in m/s, positive towards the radar, straight between the given instants (s)."""

    times_s: tuple[float, ...]
    velocities_mps: tuple[float, ...]

    def phase_turns(self, t: np.ndarray, wavelength_m: float, phase_rad: float) -> np.ndarray:
        """Phase in turns at times t: the exact integral of the Doppler frequency from the first instant."""
        knots, v = np.array(self.times_s), np.array(self.velocities_mps)
        steps = np.diff(knots)
        path = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
        i = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(steps) - 1)
        s = t - knots[i]
        metres = path[i] + s * (v[i] + 0.5 * s * np.diff(v)[i] / steps[i])
        return phase_rad / (2.0 * math.pi) + 2.0 / wavelength_m * metres


def fitted_parameters(turns: np.ndarray, t: np.ndarray, size: int) -> np.ndarray:
    """Parameters θ (size,) whose phase fits that given in turns at t best in least squares: the truth of a profile."""
    duration = float(np.max(t))
    powers = (t.ravel()[:, None] / duration) ** np.arange(size)
    coefficients = np.linalg.lstsq(powers, turns.ravel(), rcond=None)[0]
    return coefficients / turns_per_parameter(size, duration)


def balanced_inverse(information: np.ndarray) -> np.ndarray:
    """Inverse (n, n) of a positive definite matrix whose rows differ by many orders of magnitude, as θ's units do."""
    scale = 1.0 / np.sqrt(np.diag(information))
    return np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
