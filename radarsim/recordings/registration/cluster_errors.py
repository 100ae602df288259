"""Standard errors by clusters, so that errors may be correlated within an aircraft.

Both work on the linear model that has the pseudo-residuals of a robust estimate as its errors (Huber 1981, Robust
statistics, sec. 7.6). `half_widths` lets errors differ between aircraft: variance and degrees of freedom of Bell and
McCaffrey (2002, Survey Methodology 28, 169). `evidence` asks whether a coefficient is there at all, where few aircraft
may show it: it takes the errors of aircraft as alike but no better than independent ones. One aircraft that differs
raises the common variance by as much as the coefficient, so it cannot be evidence alone."""

from typing import NamedTuple

import numpy as np

from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.registration.robust_fit import BIWEIGHT_LIMIT, RobustFit

MAX_LEFT_OUT = 20  # clusters that are left out one after the other
NO_EVIDENCE = 0.01  # of a coefficient, from which leaving out clusters cannot matter
MIN_DEGREES = 0.5  # of freedom, below which clusters show nothing


class Evidence(NamedTuple):
    """How likely a coefficient as large arises by chance: from all clusters, and at most without any one of them."""

    probability: float
    probability_without_one: float


def half_widths(fit: RobustFit, clusters: np.ndarray, is_used: np.ndarray) -> np.ndarray:
    """Half the width of the 95 % interval of each coefficient, 0 of those that are not used."""
    from scipy.stats import t as student

    design, errors = _linear_model(fit, is_used)
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    design = design / size
    inverse = np.linalg.inv(np.einsum("nki,nkj->ij", design, design))
    variance, lengths, projections = np.zeros_like(inverse), [], []
    for rows in rows_by_name(clusters.tolist()).values():
        q, basis = np.linalg.qr(design[rows].reshape(-1, len(size)))
        leverage, axes = np.linalg.eigh(np.eye(len(basis)) - basis @ inverse @ basis.T)
        spread = basis.T @ (axes * np.where(leverage > 1e-9, leverage, np.inf) ** -0.5) @ axes.T
        score = spread @ (q.T @ errors[rows].ravel())
        variance += np.outer(score, score)
        influence = spread.T @ inverse
        lengths.append((influence**2).sum(axis=0))
        projections.append(basis.T @ influence)
    length, projection = np.array(lengths), np.array(projections)  # (clusters, biases), (clusters, biases, biases)
    cross_terms = np.einsum("gij,ik,gkj->gj", projection, inverse, projection)
    products = np.einsum("gij,gkj->jik", projection, projection)
    trace = (length - cross_terms).sum(axis=0)
    square = (length**2 - 2 * length * cross_terms).sum(axis=0)
    square += np.einsum("ik,jkl,lm,jmi->j", inverse, products, inverse, products)
    widths = np.zeros(len(is_used))
    widths[is_used] = student.ppf(0.975, trace**2 / square) * np.sqrt(np.diag(inverse @ variance @ inverse)) / size
    return widths


def evidence(fit: RobustFit, clusters: np.ndarray, is_used: np.ndarray, index: int) -> Evidence:
    """The evidence for the coefficient of an index."""
    design, errors = _linear_model(fit, is_used)
    column = int(is_used[:index].sum())
    values = fit.values[is_used]
    probability, influential = _equal_clusters_test(design, errors, values[column], clusters, column)
    target, most = errors + design @ values, probability
    for cluster in influential[:MAX_LEFT_OUT] if probability < NO_EVIDENCE else ():
        is_kept = clusters != cluster
        size = np.sqrt((design[is_kept] ** 2).sum(axis=(0, 1)))
        if not size.all():
            return Evidence(probability, 1.0)
        flat = (design[is_kept] / size).reshape(-1, len(size))
        values = np.linalg.lstsq(flat.T @ flat, flat.T @ target[is_kept].ravel(), rcond=1e-12)[0] / size
        errors = target[is_kept] - design[is_kept] @ values
        most = max(most, _equal_clusters_test(design[is_kept], errors, values[column], clusters[is_kept], column)[0])
    return Evidence(probability, most)


def _linear_model(fit: RobustFit, is_used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (n, 2, used) and pseudo-residuals (n, 2), in σ."""
    u = fit.errors / fit.sigma
    v = np.where(np.isfinite(u), np.minimum((u / BIWEIGHT_LIMIT) ** 2, 1.0), 1.0)
    mean_slope = np.sqrt(((1 - v) * (1 - 5 * v)).sum(axis=0) / np.maximum(np.isfinite(u).sum(axis=0), 1))
    mean_slope = np.where(mean_slope > 0, mean_slope, 1.0)  # of bearings, where there are none
    slopes = fit.slopes[..., is_used] / fit.sigma[:, None]
    return slopes * mean_slope[:, None], np.nan_to_num(u) * (1 - v) ** 2 / mean_slope


def _equal_clusters_test(
    design: np.ndarray, errors: np.ndarray, value: float, clusters: np.ndarray, column: int
) -> tuple[float, np.ndarray]:
    """How likely a value as large is by chance, and the clusters, that with most influence on it first."""
    from scipy.stats import t as student

    size = np.sqrt((design**2).sum(axis=(0, 1)))
    x = design / size
    inverse = np.linalg.pinv(np.einsum("nki,nkj->ij", x, x))
    influence = x @ inverse[:, column]  # (n, 2): the value is the sum of these times the plots
    numbers, cluster_index = np.unique(clusters, return_inverse=True)
    length, score = (
        np.bincount(cluster_index, (influence * factor).sum(axis=1), len(numbers)) for factor in (influence, errors)
    )
    moments = np.stack(
        [np.bincount(cluster_index, column_sum, len(numbers)) for column_sum in np.einsum("nk,nkj->jn", influence, x)],
        axis=1,
    )
    influential = numbers[np.argsort(-length)]
    is_informative = length > 0
    unfitted = length - np.einsum(
        "gi,ij,gj->g", moments, inverse, moments
    )  # of the variance, as the fit has taken a part
    degrees = float((unfitted[is_informative] / length[is_informative]).sum())
    if degrees < MIN_DEGREES:
        return 1.0, influential
    independent = float((errors**2).sum()) / max(int(np.count_nonzero(errors)) - len(size), 1)
    common = float((score[is_informative] ** 2 / length[is_informative]).sum()) / degrees
    error = np.sqrt(max(common, independent) * inverse[column, column]) / size[column]
    probability = 2 * float(student.sf(abs(value) / error, degrees)) if error > 0 else float(value == 0)
    return probability, influential
