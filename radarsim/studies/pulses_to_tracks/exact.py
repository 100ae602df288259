"""What is known without sampling: the errors of range alone, and of every idealisation."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from radarsim.bursts.burst import Burst
from radarsim.bursts.fisher import energy_ratio
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
    F, scans = transition(spec.radar.scan_period_s), len(missed)
    S = np.diag([0.0, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2])
    mean, means, covariances = np.zeros(3), np.zeros((scans, 3)), np.zeros((scans, 3, 3))
    for k, taken in enumerate(gains(spec, one, sigma)):
        if k == 0:
            S = S + np.diag([spec.radar.sigma_range_m**2, 0.0, 0.0])
        else:
            S, mean = F @ S @ F.T, F @ mean + missed[k]
        for c, gain, variance in taken:
            left = kept(c, gain)
            S, mean = left @ S @ left.T + variance * np.outer(gain, gain), left @ mean
        means[k], covariances[k] = mean, S
    return means, covariances


def gains(spec: Any, one: Any, sigma: np.ndarray) -> Iterator[list[tuple[int, np.ndarray, float]]]:
    """By scan what a filter takes as measured: number of the component, gain (3,), variance. sigma as in `errors`."""
    dt = spec.radar.scan_period_s
    F, Q = transition(dt), process_noise(one.process_noise, one.manoeuvre_variance, dt)
    P = np.diag([0.0, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2])
    for k in range(len(sigma)):
        if k == 0:
            P = P + np.diag([spec.radar.sigma_range_m**2, 0.0, 0.0])
        else:
            P = F @ P @ F.T + (Q if k >= start_scans(one) else 0.0)
        taken = []
        for c in range(0 if k else 1, one.takes + 1):
            variance = float(spec.radar.sigma_range_m**2 if c == 0 else sigma[k, c - 1] ** 2)
            gain = P[:, c] / (P[c, c] + variance)
            P = kept(c, gain) @ P @ kept(c, gain).T + variance * np.outer(gain, gain)
            taken.append((c, gain, variance))
        yield taken


def kept(c: int, gain: np.ndarray) -> np.ndarray:
    """I − g e' (3, 3), what an update of component c leaves of an error."""
    left = np.eye(3)
    left[:, c] -= gain
    return left


def of_losses(spec: Any, one: Any, sigma: np.ndarray) -> np.ndarray:
    """What lost bursts add to the mean squares (K, 3) of a filter's errors, over the probability that one is lost.

    It is the mean square of the answer to a burst, summed over those up to a scan. A lost estimate is uniform over the
    span (the acceleration over what sweeps the rate), and taken as measured; one that the next forecast rests on
    confirms itself from scan to scan. A gate, a mixture or hypotheses answer less.
    """
    F, scans = transition(spec.radar.scan_period_s), len(sigma)
    size = np.array([spec.span_mps, spec.span_mps / spec.burst_s]) / math.sqrt(12.0)
    answers, found = np.zeros((scans, 3, 2)), np.zeros((scans, 3))  # of the bursts so far to errors of one
    for k, taken in enumerate(gains(spec, one, sigma)):
        answers = np.einsum("xy,jyc->jxc", F, answers)
        begun = np.arange(scans) <= k if one.forecast == "track" else np.arange(scans) == k
        for c, gain, _ in taken:
            answers = np.einsum("xy,jyc->jxc", kept(c, gain), answers)
            if c:
                answers[begun, :, c - 1] += gain
        found[k] = np.einsum("jxc,c->x", answers**2, size**2)
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
