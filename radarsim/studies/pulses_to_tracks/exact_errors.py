"""Exact errors of range alone and of every idealisation, and those that a lost burst leaves."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from radarsim.bursts.burst import Burst
from radarsim.bursts.fisher import energy_ratio
from radarsim.kernels import kalman_algebra
from radarsim.physics.motion import process_noise
from radarsim.studies.pulses_to_tracks.window_menu import start_scans


def has_exact_errors(options: Any) -> bool:
    """Whether a filter's errors are known exactly: its estimates always lock, or it takes none."""
    return options.takes == 0 or options.estimator == "fisher_bound"


def locked_errors(spec: Any, options: Any, sigma: np.ndarray, defects: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance (K, 3), (K, 3, 3) of the errors of a filter whose estimates always lock.

    sigma (K, 2) of velocity and acceleration; defects (K, 3) of the model, see `model_defects`. The filter's
    covariance P gives the gains; that of the errors, S, has no manoeuvre noise."""
    F, S, mean = kalman_algebra.constant_acceleration(spec.radar.scan_period_s), designation(spec), (0.0, 0.0, 0.0)
    means, covariances = np.zeros((len(defects), 3)), np.zeros((len(defects), 6))
    for k, corrections in enumerate(corrections_by_scan(spec, options, sigma)):
        if k > 0:
            S = kalman_algebra.predict_covariance(S, F, kalman_algebra.NO_NOISE)
            mean = kalman_algebra.add_scaled(kalman_algebra.predict_state(mean, F), 1.0, defects[k])
        for c, gain, variance in corrections:
            S, mean = kalman_algebra.CORRECT[c](S, variance, gain), kalman_algebra.add_scaled(mean, -mean[c], gain)
        means[k], covariances[k] = mean, S
    return means, kalman_algebra.unpack(covariances.T)


def designation(spec: Any) -> tuple[float, ...]:
    """The packed covariance after the first range, with the prior of velocity and acceleration."""
    variances = spec.radar.sigma_range_m**2, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2
    return variances[0], 0.0, 0.0, variances[1], 0.0, variances[2]


def corrections_by_scan(spec: Any, options: Any, sigma: np.ndarray) -> Iterator[list[tuple[int, Any, float]]]:
    """For each scan the numbers that a filter takes: component, gain (3,), variance. sigma as in `locked_errors`."""
    dt = spec.radar.scan_period_s
    F, Q = (
        kalman_algebra.constant_acceleration(dt),
        kalman_algebra.pack(process_noise(options.process_noise, options.manoeuvre_variance, dt)),
    )
    P = designation(spec)
    for k in range(len(sigma)):
        if k > 0:
            P = kalman_algebra.predict_covariance(P, F, Q if k >= start_scans(options) else kalman_algebra.NO_NOISE)
        corrections = []
        for c in range(0 if k else 1, options.takes + 1):
            variance = float(spec.radar.sigma_range_m**2 if c == 0 else sigma[k, c - 1] ** 2)
            P, gain, _ = kalman_algebra.TAKE[c](P, variance, 1.0)
            corrections.append((c, gain, variance))
        yield corrections


def lost_burst_errors(spec: Any, options: Any, sigma: np.ndarray) -> np.ndarray:
    """The mean squares (K, 3) that lost bursts add to a filter's errors, divided by the probability of a loss.

    This is the mean square of the response to a lost burst, summed over the bursts up to a scan. A lost estimate is
    uniform over the span (the acceleration over one that sweeps it), and is taken as measured; if the next forecast
    depends on it, it confirms itself from scan to scan. A gate, a mixture or hypotheses respond less."""
    F, scans = kalman_algebra.constant_acceleration(spec.radar.scan_period_s), len(sigma)
    size = np.array([spec.span_mps, spec.span_mps / spec.burst_s]) / math.sqrt(12.0)
    responses, squares = np.zeros((3, scans, 2)), np.zeros((scans, 3))  # to a unit error in each burst
    for k, corrections in enumerate(corrections_by_scan(spec, options, sigma)):
        responses = np.array(kalman_algebra.predict_state(responses, F))
        is_answered = np.arange(scans) <= k if options.forecast == "track" else np.arange(scans) == k
        for c, gain, _ in corrections:
            responses = np.array(kalman_algebra.add_scaled(responses, -responses[c], gain))
            if c:
                responses[:, is_answered, c - 1] += np.array(gain)[:, None]
        squares[k] = np.einsum("xjc,c->x", responses**2, size**2)
    return squares


def max_loss_probability(bursts: Sequence[Burst], options: Any) -> float:
    """An upper bound of the probability that a burst is lost: for a spectrum from its energy, else one.

    A line of noise is higher than the signal's with probability exp(−E/2)/2, where E is the energy over the noise's
    density (Rife & Boorstyn 1974), if the two lines are orthogonal. With lines at half that distance the signal's is
    reduced to sinc²(1/4) at worst, and a side lobe of it, 0.217 of its height, adds to the other one."""
    if options.estimator != "spectrum":
        return 1.0
    min_ratio = min(energy_ratio(burst, burst.duration_s) for burst in dict.fromkeys(bursts))
    energy = np.sinc(0.25) ** 2 * (1.0 - 0.217) * min_ratio
    return float(min(1.0, bursts[0].pulses * math.exp(-0.5 * energy)))
