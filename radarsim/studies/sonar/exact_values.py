"""Exact values of P3's experiments: true errors of every linear filter, over all patterns of misses where there
are few.
"""

import numpy as np

from radarsim.studies.sonar import banks, exact
from radarsim.studies.sonar import world as models
from radarsim.studies.sonar.scene import Scene


def true_errors(seen: Scene, one: banks.FilterDesign, c: int) -> tuple[np.ndarray, ...]:
    """Bias (M, K, 3), covariance (M, K, 3, 3) and number of plots (M, K) of one filter in one coordinate."""
    plots, scans = one.plots, len(one.plots.t)
    t, truth, sigma = plots.t, seen.truth[:scans, c], seen.sigma[:scans, c]
    sigma = np.where(np.isfinite(sigma), sigma, 0.0)
    count = one.known
    if one.recursion is not None:
        steps = models.step_correlations(seen.rho[c], t, seen.period)
        errors = exact.recursive_errors(one.recursion.gain, one.recursion.carry, t, truth, steps, sigma, seen.walk[c])
        return *errors, count
    bias, covariance = np.zeros((len(count), scans, 3)), np.zeros((len(count), scans, 3, 3))
    for k, (first, weights) in enumerate(one.window_rows):
        C = models.error_covariance(sigma[first : k + 1], seen.rho[c], t[first : k + 1], seen.period)
        origin = first if count[:, k].min() >= one.spec.size else 0
        bias[:, k], covariance[:, k] = exact.weighted_errors(weights, first, t, truth, C, seen.walk[c], origin)
    return bias, covariance, count


def exact_values(
    seen: Scene, designs: list[list[banks.FilterDesign]], probability: np.ndarray, size: int
) -> dict[str, np.ndarray]:
    """Exact σ and bias (F, K, C, size), σ one scan ahead and normalised error (F, K, C); not-a-number where not known.

    designs are of each filter in each coordinate, for M patterns of plots in the first scans, with their probability
    (M,): the values are means over these. Of a filter without designs nothing is known.
    """
    F, K, C = len(designs), len(seen.t), seen.truth.shape[1]
    found = {name: np.full((F, K, C, size), np.nan) for name in ("sigma", "bias")}
    found |= {name: np.full((F, K, C), np.nan) for name in ("ahead", "nees")}
    for f, c in np.ndindex(F, C):
        if not designs[f]:
            continue
        one = designs[f][c]
        bias, S, plots = true_errors(seen, one, c)
        reach = plots.shape[1]
        for j in range(one.spec.size):
            share = probability[:, None] * (plots > j)
            with np.errstate(invalid="ignore", divide="ignore"):
                square = (share * (S[:, :, j, j] + bias[:, :, j] ** 2)).sum(axis=0) / share.sum(axis=0)
                found["sigma"][f, :reach, c, j] = np.sqrt(square)
                found["bias"][f, :reach, c, j] = (share * bias[:, :, j]).sum(axis=0) / share.sum(axis=0)
        found["ahead"][f, :reach, c] = _ahead(seen, c, bias, S, probability[:, None] * (plots >= one.spec.size))
        if probability.size == 1:
            ready, n = np.flatnonzero(plots[0] >= one.spec.size), one.spec.size
            found["nees"][f, ready, c] = _nees(
                one.covariance[0, ready, :n, :n], bias[0, ready, :n], S[0, ready, :n, :n]
            )
    return found


def _nees(believed: np.ndarray, bias: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Expected normalised error squared (n,), in units of the believed σ for the sake of the solver."""
    unit = np.sqrt(np.diagonal(believed, axis1=1, axis2=2))
    both = unit[:, :, None] * unit[:, None, :]
    return exact.consistency(believed / both, bias / unit, S / both)


def _ahead(seen: Scene, c: int, bias: np.ndarray, S: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Exact σ (K',) of the value extrapolated to the next scan; not-a-number for the last."""
    reach = S.shape[1]
    out = np.full(reach, np.nan)
    for k in range(min(reach, len(seen.t) - 1)):
        dt = seen.t[k + 1] - seen.t[k]
        row = np.array([1.0, dt, dt**2 / 2])
        variance = np.einsum("i,mij,j->m", row, S[:, k], row) + (seen.walk[c] * dt**2 / 2) ** 2
        mean = bias[:, k] @ row + row @ seen.truth[k, c] - seen.truth[k + 1, c, 0]
        total = share[:, k].sum()
        if total > 0:
            out[k] = np.sqrt((share[:, k] * (variance + mean**2)).sum() / total)
    return out
