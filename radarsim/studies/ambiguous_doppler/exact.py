"""What is known without sampling: errors of the filters that fold nothing, and how often the nearest fold is right."""

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from radarsim.studies.ambiguous_doppler import filters


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


def gains(one: Any, prior: Any, sigma: np.ndarray, dt: float, scans: int) -> Gains:
    """The Kalman filter of one filter's options; sigma (2,) of the plots."""
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


def errors(
    of: Gains, truth: np.ndarray, drawn: np.ndarray, spread: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bias (K, 3) and covariance (K, 3, 3) of the error of a filter whose folds are right, of any truth.

    truth (K, 3) is the mean motion, drawn (M, K, 3) the motions that a realisation adds with normal factors of standard
    deviations spread (M,), sigma (2,) of the plots. The error is linear in all of these: the recursion
    e⁺ = (I − h eᵥᵀ)(I − g eᵣᵀ)(F e + F x − x⁺) + noise runs for each motion, and for the noise's covariance.
    """
    motions = np.concatenate([truth[None], drawn])
    bias, noise = np.zeros_like(motions), np.zeros((len(truth), 3, 3))
    R, R_v = sigma**2
    for k in range(len(truth)):
        take_v = np.eye(3) - np.outer(of.velocity[k], [0, 1, 0])
        if k == 0:
            bias[:, 0] = (motions[:, 0] * [0, -1, -1]) @ take_v.T
            before, g = np.zeros((3, 3)), np.array([1.0, 0, 0])
            A = take_v
        else:
            g = of.range[k]
            A = take_v @ (np.eye(3) - np.outer(g, [1, 0, 0]))
            defect = motions[:, k - 1] @ of.F.T - motions[:, k]
            bias[:, k] = (bias[:, k - 1] @ of.F.T + defect) @ A.T
            before = of.F @ noise[k - 1] @ of.F.T
        g, h = take_v @ g, of.velocity[k]
        noise[k] = A @ before @ A.T + R * np.outer(g, g) + R_v * np.outer(h, h)
    random = np.einsum("mki,mkj,m->kij", bias[1:], bias[1:], spread**2)
    return bias[0], noise + random


def all_right(of: Gains, spans: np.ndarray) -> np.ndarray:
    """Probability (K,) that the nearest folds are right up to each scan: ∏ [2Φ(D/2√S) − 1], spans D (K,).

    Exact where the filter's model and prior are the truth's: its innovations are then independent, N(0, S). (Integer
    bootstrapping: Teunissen, Journal of Geodesy 72, 1998, 606-612.)
    """
    normal = NormalDist()
    each = [2 * normal.cdf(D / 2 / S**0.5) - 1 for D, S in zip(spans, of.variance, strict=True)]
    return np.cumprod(each)
