"""Exact errors of filters whose folds are right, and the probability that the nearest fold is right."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels.kalman_algebra import pack, pack_transition, predict_covariance, take_rate, take_value, unpack
from radarsim.physics import targets
from radarsim.studies.ambiguous_doppler.filter_design import Member, model, prior_variances

INTEGRAL_SIGMAS = 8.5  # standard deviations at which an integral is cut: 2e-17 of it is lost
INTERVAL_SIGMAS = 2.0  # half width of the intervals that the smoothest order has to meet: 95 % of Gaussian errors
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(12)  # over one standard deviation: exact to rounding


@dataclass(frozen=True)
class Gains:
    """A filter's gains over K scans without missed plots; the range is taken first, the velocity second."""

    F: np.ndarray  #: (3, 3) its motion
    range: np.ndarray  #: (K, 3) zero at the first scan
    velocity: np.ndarray  #: (K, 3) zero where it takes no velocity
    variance: np.ndarray  #: (K,) of the velocity's innovation, (m/s)²
    range_variance: np.ndarray  #: (K,) of the range's innovation, m²; one at the first scan
    covariance: np.ndarray  #: (K, 3, 3) after the plot, in m, m/s, m/s²


def kalman_gains(member: Member, prior: Any, sigma: np.ndarray, dt: float, scans: int) -> Gains:
    """The gains of a member over all scans; sigma (2,) of the plots."""
    F, Q = model(member.order, member.manoeuvre_variance, dt)
    f, q, (prior_v, prior_a) = pack_transition(F), pack(Q), prior_variances(member.order, prior)
    P: Any = (sigma[0] ** 2, 0.0, 0.0, prior_v, 0.0, prior_a)
    range_gains, velocity_gains = np.zeros((scans, 3)), np.zeros((scans, 3))
    variance, range_variance, covariances = np.zeros(scans), np.ones(scans), np.zeros((scans, 6))
    for k in range(scans):
        if k > 0:
            P, range_gains[k], range_variance[k] = take_value(predict_covariance(P, f, q), sigma[0] ** 2, 1.0)
        updated_P, gain, variance[k] = take_rate(P, sigma[1] ** 2, 1.0)
        if member.doppler != "none" and (k > 0 or member.doppler != "remainder"):  # a remainder needs two scans
            P, velocity_gains[k] = updated_P, gain
        covariances[k] = P
    return Gains(F, range_gains, velocity_gains, variance, range_variance, unpack(covariances.T))


def linear_errors(
    filter_gains: Sequence[Gains], motions: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of I filters whose folds are right: for motions (M, K, 3), and for the noise of plots of sigma (2,).

    Returns errors (M, I, K, 3) without noise, and covariances (K, I, 3, I, 3) of the errors by noise, also between
    filters. The error is linear in motion and noise: e⁺ = (I − h eᵥᵀ)(I − g eᵣᵀ)(F e + F x − x⁺) + noise runs for each
    motion, and for the covariance of the noise with the states of all filters stacked."""
    count, scans = len(filter_gains), motions.shape[1]
    bias, noise = np.zeros((len(motions), count, scans, 3)), np.zeros((scans, 3 * count, 3 * count))
    for k in range(scans):
        if k == 0:  # the first range is taken as it is
            steps = [
                Step(np.eye(3), np.array([1.0, 0, 0]), gains_of_filter.velocity[0]) for gains_of_filter in filter_gains
            ]
            start = np.zeros((len(motions), count, 3)), np.zeros((3 * count, 3 * count))
            bias[:, :, 0], noise[0] = advance_errors(*start, np.zeros((len(motions), 3)), motions[:, 0], steps, sigma)
        else:
            steps = [
                Step(gains_of_filter.F, gains_of_filter.range[k], gains_of_filter.velocity[k])
                for gains_of_filter in filter_gains
            ]
            previous = bias[:, :, k - 1], noise[k - 1]
            bias[:, :, k], noise[k] = advance_errors(*previous, motions[:, k - 1], motions[:, k], steps, sigma)
    return bias, noise.reshape(scans, count, 3, count, 3)


class Step(NamedTuple):
    """A filter's scan: its motion F (3, 3) since the previous one, and its gains (3,) of range and velocity."""

    F: np.ndarray
    range: np.ndarray
    velocity: np.ndarray


def advance_errors(
    bias: np.ndarray,
    noise: np.ndarray,
    previous_motions: np.ndarray,
    current_motions: np.ndarray,
    steps: Sequence[Step],
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of I filters one scan later: without noise (M, I, 3), and the covariance by noise (3 I, 3 I).

    previous_motions, current_motions (M, 3) are those at the two scans; sigma (2,) of the plots."""
    count = len(steps)
    A, range_noise, velocity_noise = np.zeros((3 * count, 3 * count)), np.zeros(3 * count), np.zeros(3 * count)
    errors = np.empty_like(bias)
    for i, (F, g, h) in enumerate(steps):
        block = slice(3 * i, 3 * i + 3)
        velocity_update = np.eye(3) - np.outer(h, [0, 1, 0])
        update = velocity_update @ (np.eye(3) - np.outer(g, [1, 0, 0]))
        A[block, block], range_noise[block], velocity_noise[block] = update @ F, velocity_update @ g, h
        errors[:, i] = bias[:, i] @ (update @ F).T + (previous_motions @ F.T - current_motions) @ update.T
    covariance = A @ noise @ A.T + sigma[0] ** 2 * np.outer(range_noise, range_noise)
    return errors, covariance + sigma[1] ** 2 * np.outer(velocity_noise, velocity_noise)


def interval_widths(bias: np.ndarray, noise: np.ndarray, members: Sequence[Member], prior: Any) -> np.ndarray:
    """Half widths (K, I, 3) of intervals of INTERVAL_SIGMAS; zero where a filter has no estimate.

    bias (2, I, K, 3) for a unit velocity and a unit acceleration, noise (K, I, 3, I, 3). The motion that the prior
    allows is no manoeuvre: a velocity, and an acceleration if the model has one."""
    models = np.array([member.order > 1 for member in members])[:, None, None]
    estimated = np.array([member.components for member in members])
    variance = np.einsum("kixix->ikx", noise) + bias[0] ** 2 * prior.sigma_velocity_mps**2
    variance += bias[1] ** 2 * prior.sigma_acceleration_mps2**2 * models
    return INTERVAL_SIGMAS * np.sqrt(variance).swapaxes(0, 1) * estimated


def joint_moments(bias: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The joint second moments E_ij = b_i b_j + C_ij of the errors of I filters by scan and component (K, 3, I, I).

    bias (M, I, K, 3) of M motions whose squares are weighted by weight (M,); noise (K, I, 3, I, 3)."""
    return np.einsum("mikx,mjkx,m->kxij", bias, bias, weight) + np.einsum("kixjx->kxij", noise)


def best_shares(E: np.ndarray, estimated: np.ndarray) -> np.ndarray:
    """Shares (K, I, 3) of the linear combination with the smallest error: E⁻¹1/(1ᵀE⁻¹1); they may be negative.

    E (K, 3, I, I); estimated (I, 3): which filter estimates which component. The shares add up to one, or are all zero
    where no filter estimates the component."""
    shares = np.zeros((E.shape[0], E.shape[2], 3))
    for c in range(3):
        estimating = np.flatnonzero(estimated[:, c])
        if estimating.size:
            shares[:, estimating, c] = _min_error_shares(E[:, c][:, estimating][:, :, estimating])
    return shares


def _min_error_shares(E: np.ndarray) -> np.ndarray:
    """E⁻¹1/(1ᵀE⁻¹1) of matrices (K, I, I): (K, I)."""
    variances = np.diagonal(E, axis1=1, axis2=2)
    scale = 1 / np.sqrt(np.where(variances > 0, variances, 1.0))
    solved = np.linalg.pinv(E * scale[:, :, None] * scale[:, None, :], rcond=1e-12, hermitian=True)
    raw = scale * np.einsum("kij,kj->ki", solved, scale)
    share_sum = raw.sum(axis=1, keepdims=True)
    error_free = (variances == 0).any(axis=1)[:, None]  # a filter without error has the whole share
    share_sum = np.where(error_free, 1.0, share_sum)
    return np.where(error_free, np.eye(E.shape[1])[variances.argmin(axis=1)], raw / share_sum)


def manoeuvre_motions(manoeuvres: Any, t: np.ndarray) -> np.ndarray:
    """Motions (K, K, 3) that a class of manoeuvres adds at times t (K,), one for each scan at which it may begin."""
    size, length = manoeuvres.acceleration_mps2, manoeuvres.duration_s
    return np.stack([targets.acceleration_pulse((0.0,), size, start_s, length, t) for start_s in t])


def remainder_probability(
    mean: np.ndarray, spread: np.ndarray, t: np.ndarray, sigma: float, spans: np.ndarray, joint: np.ndarray
) -> np.ndarray:
    """Probability (K,) that the Chinese remainder of a scan and the previous one gives the right fold.

    mean (K,) velocities at times t (K,); spread (2,) of the random velocity and acceleration; sigma of a measured
    velocity; spans D (K,); joint (K,) span L of a scan and the previous one, m/s, zero: they have none.
    The fold is right if the velocity lies in ± L/2, and its difference δ from the previous velocity, folded by the
    previous span, is the smallest of all that the two spans leave, which are d = D D′/L apart: |δ − i D′| < d/2 for a
    whole i. The joint normal law of both is known for any target."""
    right = np.zeros(len(t))
    normal = np.vectorize(NormalDist().cdf, otypes=[float])
    for k in range(1, len(t)):
        if joint[k] == 0:
            continue
        dt, step, previous_span = t[k] - t[k - 1], spans[k] * spans[k - 1] / joint[k], spans[k - 1]
        delta_variance, u_variance = (
            spread[1] ** 2 * dt**2 + 2 * sigma**2,
            spread[0] ** 2 + spread[1] ** 2 * t[k] ** 2 + sigma**2,
        )
        covariance = spread[1] ** 2 * dt * t[k] + sigma**2
        centre, reach = mean[k] - mean[k - 1], INTEGRAL_SIGMAS * delta_variance**0.5
        first, last = (math.floor((centre + side * reach) / previous_span + 0.5) for side in (-1, 1))
        for i in range(first, last + 1):
            low, high = (
                max(i * previous_span - step / 2, centre - reach),
                min(i * previous_span + step / 2, centre + reach),
            )
            if low >= high:
                continue
            pieces = math.ceil((high - low) / delta_variance**0.5)
            edges = np.linspace(low, high, pieces + 1)
            half = np.diff(edges)[:, None] / 2
            delta = edges[:-1, None] + half * (1 + NODES)
            density = np.exp(-((delta - centre) ** 2) / (2 * delta_variance)) / np.sqrt(2 * np.pi * delta_variance)
            u, off = (
                mean[k] + covariance / delta_variance * (delta - centre),
                (u_variance - covariance**2 / delta_variance) ** 0.5,
            )
            probability = normal((joint[k] / 2 - u) / off) - normal((-joint[k] / 2 - u) / off)
            right[k] += float(np.sum(half * NODE_WEIGHTS * density * probability))
    return right


def nearest_fold_probability(gains: Gains, spans: np.ndarray) -> np.ndarray:
    """Probability (K,) that the nearest folds are right up to each scan: ∏ [2Φ(D/2√S) − 1], spans D (K,).

    Exact if the filter's model and prior are those of the truth: its innovations are then independent, N(0, S).
    (Integer bootstrapping: Teunissen, Journal of Geodesy 72, 1998, 606-612.)"""
    normal = NormalDist()
    probabilities = [2 * normal.cdf(D / 2 / S**0.5) - 1 for D, S in zip(spans, gains.variance, strict=True)]
    return np.cumprod(probabilities)
