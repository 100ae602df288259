"""The burst of each scan, and the defects of the filters' model of the target.

All errors are relative to the truth: for a polynomial of the second degree, which the model follows, nothing else
matters. Doppler frequency is f = 2V/λ, positive for a target that recedes; over a burst the acceleration is
constant."""

import math
from typing import Any

import numpy as np

from radarsim.bursts.burst import LIGHT_MPS, Burst
from radarsim.bursts.fisher import fisher_sums
from radarsim.physics.motion import transition
from radarsim.studies import radial_truth


def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².

    Raises ConfigError, with the name of the case, for an impossible target."""
    return radial_truth.checked_truth(target, t, case)


def bursts(spec: Any, truth: np.ndarray) -> list[Burst]:
    """The burst of every scan; truth (K, 3) gives the range, on which the echo's power depends, and the velocity.

    The amplitude is one; the noise in each part of a complex sample has half the power over the ratio. Ratios are
    rounded to a hundredth of a decibel, so that scans share designs."""
    burst_keys, wavelength = spec.burst, spec.radar.wavelength_m
    doppler = 2.0 * truth[:, 1] / wavelength
    power_db = burst_keys.snr_db + 20.0 * np.log10(np.abs(np.sinc(burst_keys.pulse_length_s * doppler)))
    if burst_keys.snr_range_m is not None:
        power_db = power_db + 40.0 * np.log10(burst_keys.snr_range_m / truth[:, 0])
    return [
        Burst(
            carrier_hz=LIGHT_MPS / wavelength,
            pulse_period_s=1.0 / burst_keys.repetition_rate_hz,
            pulse_length_s=burst_keys.pulse_length_s,
            sampling_period_s=burst_keys.pulse_length_s,
            pulses=spec.pulses,
            amplitude=1.0,
            noise_variance=0.5 * 10.0 ** (-0.1 * float(ratio_db)),
            complex_samples=True,
        )
        for ratio_db in np.round(power_db, 2)
    ]


def burst_centre(burst: Burst) -> float:
    """The middle of the samples as a fraction of the burst: there velocity and acceleration are independent."""
    return 0.5 * (burst.pulses - 1) / burst.pulses


def centre_row(burst: Burst, size: int, order: int) -> np.ndarray:
    """The row (size,) that maps θ to the velocity (order 1) or the acceleration (2) at the middle, m/s or m/s²."""
    t = burst_centre(burst) * burst.duration_s
    powers = [t ** (j - order) / math.factorial(j - order) if j >= order else 0.0 for j in range(size)]
    return 0.5 * burst.wavelength_m * np.array(powers)


def fisher_bounds(burst: Burst, size: int) -> tuple[float, float]:
    """The Cramér–Rao bound of a burst's velocity and acceleration at its middle, m/s, m/s²; infinite if not estimated.

    size is the number of parameters: phase, frequency, its derivatives."""
    (information,) = fisher_sums(burst, size, [burst.pulses])
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    rows = [centre_row(burst, size, order) for order in (1, 2)]
    velocity, acceleration = (float(np.sqrt(row @ inverse @ row)) if row.any() else math.inf for row in rows)
    return velocity, acceleration


def model_defects(truth: np.ndarray, period_s: float) -> np.ndarray:
    """The errors F x(k − 1) − x(k) of the model's predictions (K, 3), from the truth (K, 3); the first is zero."""
    defects = np.zeros_like(truth)
    defects[1:] = truth[:-1] @ transition(period_s).T - truth[1:]
    return defects
