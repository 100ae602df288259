"""Exact values: the true errors of any linear filter, averaged over all patterns of missed plots.

Everything is for one coordinate; its state (value, rate, acceleration) has `size` 2 or 3 components, for degree 1 or 2.
"""

from collections.abc import Sequence

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.sonar.filter_design import FilterDesign
from radarsim.studies.sonar.plot_errors import error_covariance, step_correlations
from radarsim.studies.sonar.scene import Scene


def recursive_errors(
    gain: np.ndarray,
    carry: np.ndarray,
    t: np.ndarray,
    truth: np.ndarray,
    steps: np.ndarray,
    sigma: np.ndarray,
    walk: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Bias (M, K, 3) and covariance (M, K, 3, 3) of a recursive filter's error, for M patterns of missed plots at once.

    gain (M, K, 4) for value, rate, acceleration and the carried error; carry (K,) the correlation that the filter
    assumes from scan to scan; truth (K, 3); steps (K,) the true correlation of neighbouring errors; sigma (K,) of the
    plots; walk the standard deviation of a random acceleration, constant over each interval. The error of the estimate
    (3), the carried error and the true error of the plot are propagated jointly: the linear recursion reads nothing
    else."""
    patterns, scans = gain.shape[:2]
    mean, S = np.zeros((patterns, 5)), np.zeros((patterns, 5, 5))
    mean[:, :3] = -truth[0]
    bias, covariance = np.zeros((patterns, scans, 3)), np.zeros((patterns, scans, 3, 3))
    for k in range(scans):
        a, defect = steps[k], np.zeros(3)
        A, Q = np.zeros((5, 5)), np.zeros((5, 5))
        A[:3, :3] = np.eye(3)
        if k:
            dt = t[k] - t[k - 1]
            A[:3, :3] = transition(dt)
            pushed = np.array([dt**2 / 2, dt, 0.0]) * walk
            Q[:3, :3] = np.outer(pushed, pushed)
            defect = A[:3, :3] @ truth[k - 1] - truth[k]
        A[3, 3] = carry[k]
        A[4, 4] = a  # σ may differ between sensors; errors are then uncorrelated and a is 0
        Q[4, 4] = sigma[k] ** 2 * (1 - a * a)
        U = np.tile(np.eye(5), (patterns, 1, 1))
        U[:, :4] += gain[:, k, :, None] * np.array([-1.0, 0.0, 0.0, -1.0, 1.0])
        T = U @ A
        mean = np.einsum("mij,mj->mi", T, mean) + U[:, :, :3] @ defect
        S = T @ S @ T.transpose(0, 2, 1) + U @ Q @ U.transpose(0, 2, 1)
        bias[:, k], covariance[:, k] = mean[:, :3], S[:, :3, :3]
    return bias, covariance


def weighted_errors(
    weights: np.ndarray, first: int, t: np.ndarray, truth: np.ndarray, C: np.ndarray, walk: float, origin: int
) -> tuple[np.ndarray, np.ndarray]:
    """Bias (M, 3) and covariance (M, 3, 3) of an estimate with weights (M, 3, n) of the plots first … first + n - 1.

    The estimate is that of the state at the last of these scans. C (n, n) is the covariance of the plots; a random
    acceleration `walk`, if any, acts from scan `origin` on (earlier effects cancel once the estimate reproduces
    straight lines)."""
    n = weights.shape[2]
    last = first + n - 1
    bias = weights @ truth[first : last + 1, 0] - truth[last]
    covariance = weights @ C @ weights.transpose(0, 2, 1)
    for i in range(origin + 1, last + 1) if walk else ():
        dt = t[i] - t[i - 1]
        pushed = np.array([dt**2 / 2, dt, 0.0]) * walk
        since = t[first : last + 1] - t[i]
        moved = np.where(since >= -1e-9 * dt, pushed[0] + pushed[1] * since, 0.0)
        effect = weights @ moved - transition(t[last] - t[i]) @ pushed
        covariance = covariance + effect[:, :, None] * effect[:, None, :]
    return bias, covariance


def consistency(believed: np.ndarray, bias: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """The expected normalised squared error tr(P⁻¹(S + m mᵀ)) (…,).

    It equals the size of the state for a consistent filter, and is larger for an optimistic one."""
    moment = covariance + bias[..., :, None] * bias[..., None, :]
    return np.trace(np.linalg.solve(believed, moment), axis1=-2, axis2=-1)


def true_errors(scene: Scene, design: FilterDesign, c: int) -> tuple[np.ndarray, np.ndarray]:
    """Bias (M, K, 3) and covariance (M, K, 3, 3) of the errors of a filter in coordinate c."""
    t, scans, estimated_sizes = design.plots.t, len(design.plots.t), design.estimated_sizes
    truth, sigma = scene.truth[:scans, c], scene.sigma[:scans, c]
    sigma = np.where(np.isfinite(sigma), sigma, 0.0)
    recursion = design.recursion
    if recursion is not None:
        steps = step_correlations(scene.rho[c], t, scene.period)
        return recursive_errors(recursion.gain, recursion.carry, t, truth, steps, sigma, scene.walk[c])
    bias, covariance = np.zeros((len(estimated_sizes), scans, 3)), np.zeros((len(estimated_sizes), scans, 3, 3))
    for k, (first, weights) in enumerate(design.window_rows):
        C = error_covariance(sigma[first : k + 1], scene.rho[c], t[first : k + 1], scene.period)
        origin = first if estimated_sizes[:, k].min() >= design.spec.size else 0
        bias[:, k], covariance[:, k] = weighted_errors(weights, first, t, truth, C, scene.walk[c], origin)
    return bias, covariance


def exact_values(
    scene: Scene, designs: Sequence[Sequence[FilterDesign]], probability: np.ndarray, size: int
) -> dict[str, np.ndarray]:
    """Exact sigma and bias (F, K, C, size), and (F, K, C) σ one scan ahead and expected NEES; NaN where not known.

    designs are those of each filter in each coordinate, for M patterns of plots in the first scans, and probability
    (M,) is that of each pattern: the values are means over the patterns. Nothing is known of a filter without designs,
    and the NEES only for a single pattern."""
    F, K, C = len(designs), len(scene.t), scene.truth.shape[1]
    values = {name: np.full((F, K, C, size), np.nan) for name in ("sigma", "bias")}
    values |= {name: np.full((F, K, C), np.nan) for name in ("ahead", "nees")}
    for f, c in np.ndindex(F, C):
        if not designs[f]:
            continue
        design = designs[f][c]
        bias, S = true_errors(scene, design, c)
        estimated_sizes, n = design.estimated_sizes, design.spec.size
        reach = estimated_sizes.shape[1]
        for j in range(n):
            share = probability[:, None] * (estimated_sizes > j)
            with np.errstate(invalid="ignore", divide="ignore"):
                square = (share * (S[:, :, j, j] + bias[:, :, j] ** 2)).sum(axis=0) / share.sum(axis=0)
                values["sigma"][f, :reach, c, j] = np.sqrt(square)
                values["bias"][f, :reach, c, j] = (share * bias[:, :, j]).sum(axis=0) / share.sum(axis=0)
        values["ahead"][f, :reach, c] = _extrapolated_sigma(
            scene, c, bias, S, probability[:, None] * (estimated_sizes >= n)
        )
        if probability.size == 1:
            complete = np.flatnonzero(estimated_sizes[0] >= n)
            believed, true = design.covariance[0, complete, :n, :n], S[0, complete, :n, :n]
            values["nees"][f, complete, c] = _expected_nees(believed, bias[0, complete, :n], true)
    return values


def _expected_nees(believed: np.ndarray, bias: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Expected NEES (n,), computed in units of the believed σ, so that the matrices are well conditioned."""
    unit = np.sqrt(np.diagonal(believed, axis1=1, axis2=2))
    units = unit[:, :, None] * unit[:, None, :]
    return consistency(believed / units, bias / unit, S / units)


def _extrapolated_sigma(scene: Scene, c: int, bias: np.ndarray, S: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Exact σ (K',) of the value extrapolated to the next scan; NaN for the last scan."""
    reach = S.shape[1]
    out = np.full(reach, np.nan)
    for k in range(min(reach, len(scene.t) - 1)):
        dt = scene.t[k + 1] - scene.t[k]
        row = np.array([1.0, dt, dt**2 / 2])
        variance = np.einsum("i,mij,j->m", row, S[:, k], row) + (scene.walk[c] * dt**2 / 2) ** 2
        mean = bias[:, k] @ row + row @ scene.truth[k, c] - scene.truth[k + 1, c, 0]
        total = share[:, k].sum()
        if total > 0:
            out[k] = np.sqrt((share[:, k] * (variance + mean**2)).sum() / total)
    return out
