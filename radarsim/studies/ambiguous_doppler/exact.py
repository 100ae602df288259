"""What is known without sampling: errors of the filters that fold nothing, and how often the nearest fold is right."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels.algebra import pack, pack_transition, predicted_covariance, take_rate, take_value, unpack
from radarsim.physics import targets
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.ambiguous_doppler.filters import Member

FARTHEST = 8.5  # standard deviations that an integral goes to: beyond lie 2e-17
INTERVAL_SIGMAS = 2.0  # half width of the intervals that the smoothest order has to meet: 95 % of a Gaussian's errors
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(12)  # over one standard deviation: exact to rounding


@dataclass(frozen=True)
class Gains:
    """A filter's gains over K scans without missed plots, of innovations that are taken range first, velocity after.

    F (3, 3) its motion; range (K, 3) and velocity (K, 3) the gains, the range's of the first scan zero, velocity's zero
    where it takes none; variance (K,) of the velocity's innovation, (m/s)²; believed (K, 3, 3) the covariance after the
    plot, in m, m/s, m/s².
    """

    F: np.ndarray
    range: np.ndarray
    velocity: np.ndarray
    variance: np.ndarray
    range_variance: np.ndarray
    believed: np.ndarray


def gains(one: Member, prior: Any, sigma: np.ndarray, dt: float, scans: int) -> Gains:
    """The Kalman filter of a member; sigma (2,) of the plots."""
    F, Q = filters.model(one.order, one.manoeuvre_variance, dt)
    f, q, (before_v, before_a) = pack_transition(F), pack(Q), filters.prior_variances(one.order, prior)
    P: Any = (sigma[0] ** 2, 0.0, 0.0, before_v, 0.0, before_a)
    of_range, of_velocity = np.zeros((scans, 3)), np.zeros((scans, 3))
    variance, range_variance, believed = np.zeros(scans), np.ones(scans), np.zeros((scans, 6))
    for k in range(scans):
        if k > 0:
            P, of_range[k], range_variance[k] = take_value(predicted_covariance(P, f, q), sigma[0] ** 2, 1.0)
        after, gain, variance[k] = take_rate(P, sigma[1] ** 2, 1.0)
        if one.doppler != "none" and (k > 0 or one.doppler != "remainder"):  # a remainder needs two scans
            P, of_velocity[k] = after, gain
        believed[k] = P
    return Gains(F, of_range, of_velocity, variance, range_variance, unpack(believed.T))


def errors(of: Sequence[Gains], motions: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What I filters whose folds are right make of given motions (M, K, 3), and of the noise of plots of sigma (2,).

    Errors (M, I, K, 3) without noise, and covariances (K, I, 3, I, 3) of the errors by noise, between the filters too.
    The error is linear in all of these: e⁺ = (I − h eᵥᵀ)(I − g eᵣᵀ)(F e + F x − x⁺) + noise runs for each motion, and
    for the noise's covariance with all filters' states one below the other.
    """
    count, scans = len(of), motions.shape[1]
    bias, noise = np.zeros((len(motions), count, scans, 3)), np.zeros((scans, 3 * count, 3 * count))
    for k in range(scans):
        if k == 0:  # the first range is taken as it is
            steps = [Step(np.eye(3), np.array([1.0, 0, 0]), one.velocity[0]) for one in of]
            began = np.zeros((len(motions), count, 3)), np.zeros((3 * count, 3 * count))
            bias[:, :, 0], noise[0] = advanced(*began, np.zeros((len(motions), 3)), motions[:, 0], steps, sigma)
        else:
            steps = [Step(one.F, one.range[k], one.velocity[k]) for one in of]
            before = bias[:, :, k - 1], noise[k - 1]
            bias[:, :, k], noise[k] = advanced(*before, motions[:, k - 1], motions[:, k], steps, sigma)
    return bias, noise.reshape(scans, count, 3, count, 3)


class Step(NamedTuple):
    """What a filter does at a scan: motion F (3, 3) since the last, gains (3,) of range and of velocity."""

    F: np.ndarray
    range: np.ndarray
    velocity: np.ndarray


def advanced(
    bias: np.ndarray, noise: np.ndarray, before: np.ndarray, now: np.ndarray, steps: Sequence[Step], sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of I filters a scan later: without noise (M, I, 3), and the noise's covariance (3 I, 3 I).

    before, now (M, 3) are the motions at the scan before and at this; sigma (2,) of the plots.
    """
    count = len(steps)
    A, of_range, of_velocity = np.zeros((3 * count, 3 * count)), np.zeros(3 * count), np.zeros(3 * count)
    moved = np.empty_like(bias)
    for i, (F, g, h) in enumerate(steps):
        own = slice(3 * i, 3 * i + 3)
        take = np.eye(3) - np.outer(h, [0, 1, 0])
        kept = take @ (np.eye(3) - np.outer(g, [1, 0, 0]))
        A[own, own], of_range[own], of_velocity[own] = kept @ F, take @ g, h
        moved[:, i] = bias[:, i] @ (kept @ F).T + (before @ F.T - now) @ kept.T
    after = A @ noise @ A.T + sigma[0] ** 2 * np.outer(of_range, of_range)
    return moved, after + sigma[1] ** 2 * np.outer(of_velocity, of_velocity)


def widths(bias: np.ndarray, noise: np.ndarray, of: Sequence[Member], prior: Any) -> np.ndarray:
    """Half widths (K, I, 3) of intervals of INTERVAL_SIGMAS; zero of what a filter does not estimate.

    bias (2, I, K, 3) of a drawn velocity and acceleration of one, noise (K, I, 3, I, 3). What is drawn from the prior
    is no manoeuvre: a velocity, and an acceleration to a model that has one.
    """
    models = np.array([one.order > 1 for one in of])[:, None, None]
    known = np.array([one.components for one in of])
    variance = np.einsum("kixix->ikx", noise) + bias[0] ** 2 * prior.sigma_velocity_mps**2
    variance += bias[1] ** 2 * prior.sigma_acceleration_mps2**2 * models
    return INTERVAL_SIGMAS * np.sqrt(variance).swapaxes(0, 1) * known


def joint(bias: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The joint second moments E_ij = b_i b_j + C_ij of the errors of I filters by scan and component (K, 3, I, I).

    bias (M, I, K, 3) of M motions whose squares are weighted by weight (M,); noise (K, I, 3, I, 3).
    """
    return np.einsum("mikx,mjkx,m->kxij", bias, bias, weight) + np.einsum("kixjx->kxij", noise)


def best_shares(E: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Shares (K, I, 3), of sum one, of the linear combination of least error: E⁻¹1/(1ᵀE⁻¹1); they may be negative.

    E (K, 3, I, I); known (I, 3) says which filter estimates which component; all zero where none does.
    """
    shares = np.zeros((E.shape[0], E.shape[2], 3))
    for c in range(3):
        own = np.flatnonzero(known[:, c])
        if own.size:
            shares[:, own, c] = _least(E[:, c][:, own][:, :, own])
    return shares


def _least(E: np.ndarray) -> np.ndarray:
    """E⁻¹1/(1ᵀE⁻¹1) of matrices (K, I, I): (K, I)."""
    spread = np.diagonal(E, axis1=1, axis2=2)
    scale = 1 / np.sqrt(np.where(spread > 0, spread, 1.0))
    solved = np.linalg.pinv(E * scale[:, :, None] * scale[:, None, :], rcond=1e-12, hermitian=True)
    raw = scale * np.einsum("kij,kj->ki", solved, scale)
    total = raw.sum(axis=1, keepdims=True)
    certain = (spread == 0).any(axis=1)[:, None]  # a filter without error: it has the whole share
    total = np.where(certain, 1.0, total)
    return np.where(certain, np.eye(E.shape[1])[spread.argmin(axis=1)], raw / total)


def expected_motions(manoeuvres: Any, t: np.ndarray) -> np.ndarray:
    """What a class of manoeuvres adds at times t (K,): motions (K, K, 3), one for each scan at which it may begin."""
    size, length = manoeuvres.acceleration_mps2, manoeuvres.duration_s
    return np.stack([targets.acceleration_pulse((0.0,), size, begin, length, t) for begin in t])


def remainders_right(
    mean: np.ndarray, spread: np.ndarray, t: np.ndarray, sigma: float, spans: np.ndarray, joint: np.ndarray
) -> np.ndarray:
    """Probability (K,) that the Chinese remainder of a scan and the one before it gives the right fold.

    mean (K,) velocities at times t (K,), spread (2,) of the velocity and acceleration drawn beside; sigma of a
    measured velocity; spans D (K,); joint (K,) span L of a scan and the one before, m/s, zero: they have none.
    Right is what lies in ± L/2 and whose difference δ from the velocity before, folded by that one's span, is the
    least of all that the two spans leave, which lie d = D D′/L apart: |δ − i D′| < d/2 for a whole i. Of both the
    joint normal law is known, on any target.
    """
    right = np.zeros(len(t))
    normal = np.vectorize(NormalDist().cdf, otypes=[float])
    for k in range(1, len(t)):
        if joint[k] == 0:
            continue
        dt, step, before = t[k] - t[k - 1], spans[k] * spans[k - 1] / joint[k], spans[k - 1]
        of_delta, of_u = spread[1] ** 2 * dt**2 + 2 * sigma**2, spread[0] ** 2 + spread[1] ** 2 * t[k] ** 2 + sigma**2
        both = spread[1] ** 2 * dt * t[k] + sigma**2
        centre, reach = mean[k] - mean[k - 1], FARTHEST * of_delta**0.5
        first, last = (math.floor((centre + side * reach) / before + 0.5) for side in (-1, 1))
        for i in range(first, last + 1):
            low, high = max(i * before - step / 2, centre - reach), min(i * before + step / 2, centre + reach)
            if low >= high:
                continue
            pieces = math.ceil((high - low) / of_delta**0.5)
            edges = np.linspace(low, high, pieces + 1)
            half = np.diff(edges)[:, None] / 2
            delta = edges[:-1, None] + half * (1 + NODES)
            density = np.exp(-((delta - centre) ** 2) / (2 * of_delta)) / np.sqrt(2 * np.pi * of_delta)
            u, off = mean[k] + both / of_delta * (delta - centre), (of_u - both**2 / of_delta) ** 0.5
            inside = normal((joint[k] / 2 - u) / off) - normal((-joint[k] / 2 - u) / off)
            right[k] += float(np.sum(half * NODE_WEIGHTS * density * inside))
    return right


def all_right(of: Gains, spans: np.ndarray) -> np.ndarray:
    """Probability (K,) that the nearest folds are right up to each scan: ∏ [2Φ(D/2√S) − 1], spans D (K,).

    Exact where the filter's model and prior are the truth's: its innovations are then independent, N(0, S). (Integer
    bootstrapping: Teunissen, Journal of Geodesy 72, 1998, 606-612.)
    """
    normal = NormalDist()
    each = [2 * normal.cdf(D / 2 / S**0.5) - 1 for D, S in zip(spans, of.variance, strict=True)]
    return np.cumprod(each)
