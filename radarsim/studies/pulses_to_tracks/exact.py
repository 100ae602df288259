"""What is known without sampling: the errors of range alone, and of every idealisation."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from radarsim.bursts.burst import Burst
from radarsim.bursts.fisher import energy_ratio
from radarsim.kernels.algebra import (
    CORRECT,
    NO_NOISE,
    TAKE,
    add_scaled,
    constant_acceleration,
    pack,
    predicted,
    predicted_covariance,
    unpack,
)
from radarsim.physics.motion import process_noise
from radarsim.studies.pulses_to_tracks.filters import start_scans


def known(one: Any) -> bool:
    """Whether a filter's errors are Gaussian, and known: its estimates always lock, or there are none."""
    return one.takes == 0 or one.estimator == "fisher_bound"


def errors(spec: Any, one: Any, sigma: np.ndarray, missed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance (K, 3), (K, 3, 3) of the errors of a filter whose estimates always lock.

    sigma (K, 2) of velocity and acceleration; missed (K, 3) what the model misses, see `world.defects`. The filter's
    covariance P gives the gains; that of the errors, S, has no manoeuvre noise.
    """
    F, S, mean = constant_acceleration(spec.radar.scan_period_s), designation(spec), (0.0, 0.0, 0.0)
    means, covariances = np.zeros((len(missed), 3)), np.zeros((len(missed), 6))
    for k, taken in enumerate(gains(spec, one, sigma)):
        if k > 0:
            S = predicted_covariance(S, F, NO_NOISE)
            mean = add_scaled(predicted(mean, F), 1.0, missed[k])
        for c, gain, variance in taken:
            S, mean = CORRECT[c](S, variance, gain), add_scaled(mean, -mean[c], gain)
        means[k], covariances[k] = mean, S
    return means, unpack(covariances.T)


def designation(spec: Any) -> tuple[float, ...]:
    """The packed covariance after the first range, and what was known of velocity and acceleration before."""
    variances = spec.radar.sigma_range_m**2, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2
    return variances[0], 0.0, 0.0, variances[1], 0.0, variances[2]


def gains(spec: Any, one: Any, sigma: np.ndarray) -> Iterator[list[tuple[int, Any, float]]]:
    """By scan what a filter takes as measured: number of the component, gain (3,), variance. sigma as in `errors`."""
    dt = spec.radar.scan_period_s
    F, Q = constant_acceleration(dt), pack(process_noise(one.process_noise, one.manoeuvre_variance, dt))
    P = designation(spec)
    for k in range(len(sigma)):
        if k > 0:
            P = predicted_covariance(P, F, Q if k >= start_scans(one) else NO_NOISE)
        taken = []
        for c in range(0 if k else 1, one.takes + 1):
            variance = float(spec.radar.sigma_range_m**2 if c == 0 else sigma[k, c - 1] ** 2)
            P, gain, _ = TAKE[c](P, variance, 1.0)
            taken.append((c, gain, variance))
        yield taken


def of_losses(spec: Any, one: Any, sigma: np.ndarray) -> np.ndarray:
    """What lost bursts add to the mean squares (K, 3) of a filter's errors, over the probability that one is lost.

    It is the mean square of the answer to a burst, summed over those up to a scan. A lost estimate is uniform over the
    span (the acceleration over what sweeps the rate), and taken as measured; one that the next forecast rests on
    confirms itself from scan to scan. A gate, a mixture or hypotheses answer less.
    """
    F, scans = constant_acceleration(spec.radar.scan_period_s), len(sigma)
    size = np.array([spec.span_mps, spec.span_mps / spec.burst_s]) / math.sqrt(12.0)
    answers, found = np.zeros((3, scans, 2)), np.zeros((scans, 3))  # of the bursts so far to errors of one
    for k, taken in enumerate(gains(spec, one, sigma)):
        answers = np.array(predicted(answers, F))
        begun = np.arange(scans) <= k if one.forecast == "track" else np.arange(scans) == k
        for c, gain, _ in taken:
            answers = np.array(add_scaled(answers, -answers[c], gain))
            if c:
                answers[:, begun, c - 1] += np.array(gain)[:, None]
        found[k] = np.einsum("xjc,c->x", answers**2, size**2)
    return found


def most_lost(bursts: Sequence[Burst], one: Any) -> float:
    """A bound on the probability that a burst is lost: of a spectrum by its energy, one where none is known.

    A line of noise is higher than the signal's with a probability of exp(−E/2)/2, E the energy over the noise's density
    (Rife & Boorstyn 1974), for two lines that are orthogonal. Of lines at half their distance the signal's is down to
    sinc²(1/4) at worst, and a side lobe of it, 0.217 of its height, helps the other one.
    """
    if one.estimator != "spectrum":
        return 1.0
    least = min(energy_ratio(burst, burst.duration_s) for burst in dict.fromkeys(bursts))
    energy = np.sinc(0.25) ** 2 * (1.0 - 0.217) * least
    return float(min(1.0, bursts[0].pulses * math.exp(-0.5 * energy)))
