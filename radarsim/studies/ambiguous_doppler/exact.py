"""What is known without sampling: errors of the filters that fold nothing, and how often the nearest fold is right."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from radarsim.physics import targets
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.ambiguous_doppler.filters import Member


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
    believed: np.ndarray


def gains(one: Member, prior: Any, sigma: np.ndarray, dt: float, scans: int) -> Gains:
    """The Kalman filter of a member; sigma (2,) of the plots."""
    F, Q = filters.model(one.order, one.manoeuvre_variance, dt)
    P = np.diag([0.0, *filters.prior_variances(one.order, prior)])
    of_range, of_velocity = np.zeros((scans, 3)), np.zeros((scans, 3))
    variance, believed = np.zeros(scans), np.zeros((scans, 3, 3))
    for k in range(scans):
        if k == 0:
            P[0, 0] = sigma[0] ** 2
        else:
            P = F @ P @ F.T + Q
            P, of_range[k], _ = _taken(P, 0, sigma[0])
        variance[k] = P[1, 1] + sigma[1] ** 2
        if one.doppler != "none":
            P, of_velocity[k], _ = _taken(P, 1, sigma[1])
        believed[k] = P
    return Gains(F, of_range, of_velocity, variance, believed)


def _taken(P: np.ndarray, component: int, sigma: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Covariance after a measured component, its gain (3,), and the innovation's variance (Joseph's form)."""
    S = P[component, component] + sigma**2
    gain = P[:, component] / S
    kept = np.eye(3)
    kept[:, component] -= gain
    return kept @ P @ kept.T + sigma**2 * np.outer(gain, gain), gain, S


def errors(of: Sequence[Gains], motions: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What I filters whose folds are right make of given motions (M, K, 3), and of the noise of plots of sigma (2,).

    Errors (M, I, K, 3) without noise, and covariances (K, I, 3, I, 3) of the errors by noise, between the filters too.
    The error is linear in all of these: e⁺ = (I − h eᵥᵀ)(I − g eᵣᵀ)(F e + F x − x⁺) + noise runs for each motion, and
    for the noise's covariance with all filters' states one below the other.
    """
    count, scans = len(of), motions.shape[1]
    bias, noise = np.zeros((len(motions), count, scans, 3)), np.zeros((scans, 3 * count, 3 * count))
    A, of_range, of_velocity = np.zeros((3 * count, 3 * count)), np.zeros(3 * count), np.zeros(3 * count)
    for k in range(scans):
        for i, one in enumerate(of):
            own = slice(3 * i, 3 * i + 3)
            take = np.eye(3) - np.outer(one.velocity[k], [0, 1, 0])
            g = one.range[k] if k else np.array([1.0, 0, 0])  # the first range is taken as it is
            A[own, own] = step = take @ (np.eye(3) - np.outer(g, [1, 0, 0])) @ (one.F if k else np.eye(3))
            of_range[own], of_velocity[own] = take @ g, one.velocity[k]
            if k == 0:
                bias[:, i, 0] = (motions[:, 0] * [0, -1, -1]) @ take.T
            else:
                kept = take @ (np.eye(3) - np.outer(g, [1, 0, 0]))
                defect = motions[:, k - 1] @ one.F.T - motions[:, k]
                bias[:, i, k] = bias[:, i, k - 1] @ step.T + defect @ kept.T
        before = A @ noise[k - 1] @ A.T if k else np.zeros_like(A)
        noise[k] = before + sigma[0] ** 2 * np.outer(of_range, of_range)
        noise[k] += sigma[1] ** 2 * np.outer(of_velocity, of_velocity)
    return bias, noise.reshape(scans, count, 3, count, 3)


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


def all_right(of: Gains, spans: np.ndarray) -> np.ndarray:
    """Probability (K,) that the nearest folds are right up to each scan: ∏ [2Φ(D/2√S) − 1], spans D (K,).

    Exact where the filter's model and prior are the truth's: its innovations are then independent, N(0, S). (Integer
    bootstrapping: Teunissen, Journal of Geodesy 72, 1998, 606-612.)
    """
    normal = NormalDist()
    each = [2 * normal.cdf(D / 2 / S**0.5) - 1 for D, S in zip(spans, of.variance, strict=True)]
    return np.cumprod(each)
