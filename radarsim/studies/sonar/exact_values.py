"""Exact values of P3's experiments: the true errors of every linear filter, averaged over all patterns of misses."""

from collections.abc import Sequence

import numpy as np

from radarsim.studies.sonar import exact
from radarsim.studies.sonar.banks import FilterDesign
from radarsim.studies.sonar.scene import Scene
from radarsim.studies.sonar.world import error_covariance, step_correlations


def true_errors(scene: Scene, design: FilterDesign, c: int) -> tuple[np.ndarray, np.ndarray]:
    """Bias (M, K, 3) and covariance (M, K, 3, 3) of the errors of a filter in coordinate c."""
    t, scans, known = design.plots.t, len(design.plots.t), design.known
    truth, sigma = scene.truth[:scans, c], scene.sigma[:scans, c]
    sigma = np.where(np.isfinite(sigma), sigma, 0.0)
    recursion = design.recursion
    if recursion is not None:
        steps = step_correlations(scene.rho[c], t, scene.period)
        return exact.recursive_errors(recursion.gain, recursion.carry, t, truth, steps, sigma, scene.walk[c])
    bias, covariance = np.zeros((len(known), scans, 3)), np.zeros((len(known), scans, 3, 3))
    for k, (first, weights) in enumerate(design.window_rows):
        C = error_covariance(sigma[first : k + 1], scene.rho[c], t[first : k + 1], scene.period)
        origin = first if known[:, k].min() >= design.spec.size else 0
        bias[:, k], covariance[:, k] = exact.weighted_errors(weights, first, t, truth, C, scene.walk[c], origin)
    return bias, covariance


def exact_values(
    scene: Scene, designs: Sequence[Sequence[FilterDesign]], probability: np.ndarray, size: int
) -> dict[str, np.ndarray]:
    """Exact sigma and bias (F, K, C, size), and (F, K, C) σ one scan ahead and expected NEES; NaN where not known.

    designs are those of each filter in each coordinate, for M patterns of plots in the first scans, and probability
    (M,) is that of each pattern: the values are means over the patterns. Nothing is known of a filter without designs,
    and the NEES only for a single pattern.
    """
    F, K, C = len(designs), len(scene.t), scene.truth.shape[1]
    values = {name: np.full((F, K, C, size), np.nan) for name in ("sigma", "bias")}
    values |= {name: np.full((F, K, C), np.nan) for name in ("ahead", "nees")}
    for f, c in np.ndindex(F, C):
        if not designs[f]:
            continue
        design = designs[f][c]
        bias, S = true_errors(scene, design, c)
        known, n = design.known, design.spec.size
        reach = known.shape[1]
        for j in range(n):
            share = probability[:, None] * (known > j)
            with np.errstate(invalid="ignore", divide="ignore"):
                square = (share * (S[:, :, j, j] + bias[:, :, j] ** 2)).sum(axis=0) / share.sum(axis=0)
                values["sigma"][f, :reach, c, j] = np.sqrt(square)
                values["bias"][f, :reach, c, j] = (share * bias[:, :, j]).sum(axis=0) / share.sum(axis=0)
        values["ahead"][f, :reach, c] = _ahead(scene, c, bias, S, probability[:, None] * (known >= n))
        if probability.size == 1:
            complete = np.flatnonzero(known[0] >= n)
            believed, true = design.covariance[0, complete, :n, :n], S[0, complete, :n, :n]
            values["nees"][f, complete, c] = _nees(believed, bias[0, complete, :n], true)
    return values


def _nees(believed: np.ndarray, bias: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Expected NEES (n,), computed in units of the believed σ, so that the matrices are well conditioned."""
    unit = np.sqrt(np.diagonal(believed, axis1=1, axis2=2))
    units = unit[:, :, None] * unit[:, None, :]
    return exact.consistency(believed / units, bias / unit, S / units)


def _ahead(scene: Scene, c: int, bias: np.ndarray, S: np.ndarray, share: np.ndarray) -> np.ndarray:
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
