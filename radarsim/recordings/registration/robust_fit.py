"""Robust least squares for plots: Huber's function, then Tukey's biweight (Huber 1981, Robust statistics, ch. 7)."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

HUBER_LIMIT, BIWEIGHT_LIMIT = 1.345, 4.685  # of 95 % efficiency for normal errors
MAD_TO_SIGMA = 1.4826  # σ of normal errors over their median absolute value
MAX_ROUNDS, CONVERGENCE_STEP = 60, 1e-6

Linearisation = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class RobustFit(NamedTuple):
    """Coefficients (k,), of which those not fitted are as they were; σ (2,) of range and bearing; residuals (n, 2), NaN
    where there is none; how these fall with each coefficient (n, 2, k)."""

    values: np.ndarray
    sigma: np.ndarray
    errors: np.ndarray
    slopes: np.ndarray

    @property
    def spread(self) -> float:
        """n log σ, summed over range and bearing: the lower, the better the fit."""
        counts = np.isfinite(self.errors).sum(axis=0)
        return float((counts[counts > 0] * np.log(self.sigma[counts > 0])).sum())


def robust_fit(
    linearise: Linearisation,
    start: np.ndarray,
    is_used: np.ndarray,
    smallest: np.ndarray,
    tolerance: float = CONVERGENCE_STEP,
) -> RobustFit:
    """Fit the coefficients that are used; smallest (2,): the least σ; tolerance: the last step, in standard errors."""
    values = start
    for _ in range(MAX_ROUNDS):
        errors, slopes = linearise(values)
        sigma = np.array([robust_sigma(errors[:, k], smallest[k]) for k in range(2)])
        u = np.abs(errors / sigma)
        weights = np.where(u > HUBER_LIMIT, HUBER_LIMIT / np.maximum(u, HUBER_LIMIT), 1.0)
        step, length = _step(errors, slopes, sigma, weights, is_used)
        values = values + step
        if length < tolerance:
            break
    errors, _ = linearise(values)
    sigma = np.maximum([_biweight_sigma(errors[:, k]) for k in range(2)], smallest)
    for _ in range(MAX_ROUNDS):
        errors, slopes = linearise(values)
        step, length = _step(errors, slopes, sigma, biweight_weights(errors / sigma), is_used)
        values = values + step
        if length < tolerance:
            break
    return RobustFit(values, sigma, *linearise(values))


def robust_sigma(errors: np.ndarray, smallest: float) -> float:
    """σ of normal errors by their median absolute value; infinite if there are none."""
    finite = errors[np.isfinite(errors)]
    return max(MAD_TO_SIGMA * float(np.median(np.abs(finite))), smallest) if len(finite) else math.inf


def biweight_weights(u: np.ndarray) -> np.ndarray:
    """Weights of errors in σ."""
    return np.where(np.abs(u) < BIWEIGHT_LIMIT, (1 - (u / BIWEIGHT_LIMIT) ** 2) ** 2, 0.0)


def _biweight_sigma(errors: np.ndarray) -> float:
    """σ of normal errors, of which some may be outliers, by the biweight midvariance (Lax 1985, JASA 80, 736)."""
    finite = errors[np.isfinite(errors)]
    limit = 9 * float(np.median(np.abs(finite))) if len(finite) else math.inf
    inner = finite[np.abs(finite) < limit]
    if not len(inner):
        return limit  # there are none, or most are zero
    v = (inner / limit) ** 2
    return math.sqrt(len(finite) * float((inner**2 * (1 - v) ** 4).sum())) / float(((1 - v) * (1 - 5 * v)).sum())


def _step(
    errors: np.ndarray, slopes: np.ndarray, sigma: np.ndarray, weights: np.ndarray, is_used: np.ndarray
) -> tuple[np.ndarray, float]:
    """Change of the coefficients by weighted least squares, and the largest in standard errors of it alone."""
    design = (slopes[..., is_used] * (np.sqrt(weights) / sigma)[..., None]).reshape(errors.size, -1)
    target = (np.where(np.isfinite(errors), errors, 0.0) * np.sqrt(weights) / sigma).ravel()
    size = np.sqrt(np.einsum("ij,ij->j", design, design))
    size[size == 0] = 1.0
    design /= size
    scaled = np.linalg.lstsq(design.T @ design, design.T @ target, rcond=1e-12)[0]
    step = np.zeros(len(is_used))
    step[is_used] = scaled / size
    return step, float(np.abs(scaled).max())
