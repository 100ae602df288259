"""P3's tables that all its parts have: extrapolation, believed, consistency, operations."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency, statistics
from radarsim.report import tables as common
from radarsim.studies.sonar import operations as counted
from radarsim.studies.sonar.axes import SonarAxes

if TYPE_CHECKING:
    import pandas as pd


def tables(results: Sequence[CaseResult[SonarAxes]]) -> "dict[str, pd.DataFrame]":
    """The tables of these cases beside curves and gains."""
    return {
        "extrapolation": common.joined([_extrapolation(result) for result in results], EXTRAPOLATION),
        "believed": common.joined([_believed(result) for result in results], consistency.BELIEVED),
        "consistency": common.joined([_normalised_errors(result) for result in results], CONSISTENCY),
        "operations": operations(),
    }


def coordinate_rows(result: CaseResult[SonarAxes], mask: np.ndarray):
    """The leading columns of a coordinate's rows, and where mask (F, K, C) has them.

    Returns indices (filter, scan, coordinate), each (n,), ordered filter, coordinate, scan; and the columns by name.
    """
    axes = result.axes
    f, c, k = np.nonzero(np.moveaxis(mask, 1, 2))
    coordinates = axes.coordinates
    columns = {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": common.names(axes.filters, f),
        "component": common.names([name for name, _ in coordinates], c),
        "unit": common.names([unit for _, unit in coordinates], c),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
    }
    return (f, k, c), columns


def complete(result: CaseResult[SonarAxes]) -> np.ndarray:
    """Realisations (F, K, C) in which a filter's state is complete in a coordinate."""
    sizes, counts = result.axes.sizes, np.asarray(result.sums["estimates"])
    size = counts.shape[2] // len(result.axes.coordinates)
    split = counts.reshape(*counts.shape[:2], -1, size)
    return np.take_along_axis(split, (sizes - 1)[:, None, None, None], axis=3)[..., 0]


EXTRAPOLATION = (
    *("case", "filter", "component", "unit", "k", "t_s", "n"),
    *("sigma", "sigma_lo", "sigma_hi", "bias", "bias_se", "exact_sigma"),
)


def _extrapolation(result: CaseResult[SonarAxes]) -> dict:
    """σ of each coordinate extrapolated by one scan, in the row of the scan that it was extrapolated from."""
    n = complete(result)
    mask = n > 0
    mask[:, -1] = False
    at, columns = coordinate_rows(result, mask)
    of = statistics.errors(result.sums["ahead"][at], n[at])
    return columns | {
        "n": n[at].astype(np.int64),
        "sigma": of.sigma.value,
        "sigma_lo": of.sigma.lo,
        "sigma_hi": of.sigma.hi,
        "bias": of.bias,
        "bias_se": of.bias_se,
        "exact_sigma": result.axes.exact_ahead[at],
    }


def _believed(result: CaseResult[SonarAxes]) -> dict[str, np.ndarray]:
    """σ beside the one that the filter believes, the root of its mean variance."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return consistency.believed(result, np.sqrt(result.sums["believed"] / common.realisations(result)))


CONSISTENCY = ("case", "filter", "component", "unit", "k", "t_s", "n", *consistency.columns("nees", exact=True))


def _normalised_errors(result: CaseResult[SonarAxes]) -> dict:
    """NEES eᵀP⁻¹e of a coordinate's state per component, where it is complete.

    In 95 % of runs of a filter that is right about itself all its scans' means over as many realisations lie within
    their bounds.
    """
    n = complete(result)
    at, columns = coordinate_rows(result, n > 0)
    looks = np.sum(n > 0, axis=1)[at[0], at[2]]
    size, n = result.axes.sizes[at[0]], n[at]
    joint = result.sums["joint"][at]
    mean = statistics.mean_square(joint[:, 0] / size, joint[:, 1] / size**2, n)
    bounds = statistics.normalised_bounds(size * n, looks)
    nees = consistency.normalised("nees", mean, bounds, result.axes.exact_nees[at] / size)
    return columns | {"n": n.astype(np.int64), **nees}


def operations() -> "pd.DataFrame":
    """Operations of a scan of one coordinate, degree 1: the recursion, least squares anew, Kalman, and for correlated
    errors.
    """
    rows = [("recursion (12)-(14)", 2, counted.recursion())]
    rows += [(f"least squares (2) on {n} plots", 2 * n, counted.batch_of(n)) for n in (2, 3, 5, 6, 10)]
    rows += [("Kalman (11), degree 1", 2, counted.kalman_of(2)), ("differenced", 3, counted.differenced())]
    rows += [("augmented", 3, counted.augmented())]
    return common.frame(
        {
            "algorithm": [name for name, _, _ in rows],
            "numbers_kept": [kept for _, kept, _ in rows],
            "products": [tally.products for _, _, tally in rows],
            "sums": [tally.sums for _, _, tally in rows],
            "operations": [tally.total for _, _, tally in rows],
        }
    )
