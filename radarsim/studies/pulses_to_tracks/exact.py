"""What is known without sampling: the errors of range alone, and of every idealisation."""

from typing import Any

import numpy as np

from radarsim.physics.motion import process_noise, transition
from radarsim.studies.pulses_to_tracks.filters import start_scans


def known(one: Any) -> bool:
    """Whether a filter's errors are Gaussian, and known: its estimates always lock, or there are none."""
    return one.takes == 0 or one.estimator == "fisher_bound"


def errors(spec: Any, one: Any, sigma: np.ndarray, missed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance (K, 3), (K, 3, 3) of the errors of a filter whose estimates always lock.

    sigma (K, 2) of velocity and acceleration; missed (K, 3) what the model misses, see `world.defects`. The filter's
    covariance P gives the gains; that of the errors, S, has no manoeuvre noise.
    """
    dt, scans = spec.radar.scan_period_s, len(missed)
    F, Q = transition(dt), process_noise(one.process_noise, one.manoeuvre_variance, dt)
    prior = np.diag([0.0, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2])
    P, S, mean = prior, prior, np.zeros(3)
    means, covariances = np.zeros((scans, 3)), np.zeros((scans, 3, 3))
    variances = spec.radar.sigma_range_m**2, *(sigma**2).T
    for k in range(scans):
        if k == 0:
            first = np.diag([spec.radar.sigma_range_m**2, 0.0, 0.0])
            P, S = P + first, S + first
        else:
            P = F @ P @ F.T + (Q if k >= start_scans(one) else 0.0)
            S, mean = F @ S @ F.T, F @ mean + missed[k]
        for c in range(0 if k else 1, one.takes + 1):
            variance = variances[0] if c == 0 else variances[c][k]
            gain = P[:, c] / (P[c, c] + variance)
            left = np.eye(3)
            left[:, c] -= gain
            noise = variance * np.outer(gain, gain)
            P, S, mean = left @ P @ left.T + noise, left @ S @ left.T + noise, left @ mean
        means[k], covariances[k] = mean, S
    return means, covariances
