"""The burst, its phase and its forecast, from the keys."""

from dataclasses import dataclass

import numpy as np

from radarsim.bursts import burst as model
from radarsim.bursts import fisher
from radarsim.studies.discriminator.config import Keys


@dataclass(frozen=True)
class Phase:
    """The echo's phase: in turns at every sample, and its parameters θ, which for a profile are the best fit."""

    turns: np.ndarray
    reference: np.ndarray
    theta: np.ndarray


def configured_burst(spec: Keys) -> model.Burst:
    """The configured burst."""
    b = spec.burst
    return model.Burst(
        b.carrier_hz,
        b.pulse_period_s,
        b.pulse_length_s,
        b.sampling_period_s,
        b.pulses,
        b.amplitude,
        b.noise_variance,
        b.samples == "complex",
    )


def true_phase(spec: Keys, burst: model.Burst) -> Phase:
    """The configured truth."""
    t, truth = model.sample_times(burst, burst.pulses), spec.truth
    if truth.doppler_derivatives is not None:
        theta = np.array([truth.phase_rad, *truth.doppler_derivatives])
        turns = model.phase_turns(theta, t)
        return Phase(turns, turns, theta)
    profile = model.VelocityProfile(truth.times_s or (), truth.velocities_mps or ())
    turns = profile.phase_turns(t, burst.wavelength_m, truth.phase_rad)
    theta = model.fitted_parameters(turns, t, truth.parameters)
    return Phase(turns, model.phase_turns(theta, t), theta)


def forecast(spec: Keys, burst: model.Burst) -> np.ndarray:
    """Standard deviations (size,) of the forecast as the estimators believe them."""
    sigma = np.array(spec.prior.standard_deviations) * spec.prior.scale
    if spec.prior.sigma is None:
        sigma = sigma * fisher.spreads(fisher.fisher(burst, len(sigma), burst.duration_s))
    return sigma
