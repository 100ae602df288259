"""The share of bursts that an efficient estimator would keep within 3 σ at every window.

An efficient estimator's errors over growing windows are a Gaussian process: with J_k = Φ_k + R_pr⁻¹ the information of
window k, J_k e_k = J_{k−1} e_{k−1} + w, w ~ N(0, Φ_k − Φ_{k−1}). No closed form is known for the share of such paths
that stay within bounds; it is drawn, to 10⁻³."""

from functools import lru_cache

import numpy as np

from radarsim.bursts.burst import Burst, balanced_inverse, sample_times
from radarsim.bursts.fisher import sensitivities

DRAWS = 1 << 18
SEED = 2010


@lru_cache(maxsize=16)
def share_within_bounds(
    burst: Burst,
    pulses: tuple[int, ...],
    prior_sigma: tuple[float, ...],
    factor: float = 3.0,
    noise_factor: float = 1.0,
) -> float:
    """Share of bursts of which every error stays under `factor` posterior σ at every window, these long in pulses.

    prior_sigma (size,) in the units of θ. noise_factor: σ of the true noise over that of the burst, which the
    estimator believes. Standard error under 10⁻³."""
    random = np.random.Generator(np.random.Philox(SEED))
    root = np.diag(1.0 / np.asarray(prior_sigma, dtype=float))
    information = root**2
    score = random.standard_normal((DRAWS, len(root))) @ root  # information times error: a sum of independent parts
    inside = np.ones(DRAWS, dtype=bool)
    for first, last in zip((0, *pulses[:-1]), pulses, strict=True):
        root = _root(burst, first, last, len(prior_sigma))
        information = information + root.T @ root
        score += noise_factor * random.standard_normal((DRAWS, len(root))) @ root
        covariance = balanced_inverse(information)
        inside &= (np.abs(score @ covariance) < factor * np.sqrt(np.diag(covariance))).all(axis=1)
    return float(inside.mean())


def _root(burst: Burst, first: int, last: int, size: int) -> np.ndarray:
    """The upper triangle R (size, size), RᵀR the information of pulses first … last − 1, with a positive diagonal. Of
    the samples themselves and not of their sums, which are too ill conditioned for a root."""
    t = sample_times(burst, last)[:, first:]
    rows = sensitivities(size, burst.duration_s) * (t.ravel()[:, None] / burst.duration_s) ** np.arange(size)
    level = burst.amplitude**2 / burst.noise_variance * (1.0 if burst.complex_samples else 0.5)
    scale = np.sqrt(np.square(rows).sum(axis=0))
    triangle = np.linalg.qr(rows / scale, mode="r")
    return np.sqrt(level) * np.sign(np.diag(triangle))[:, None] * triangle * scale
