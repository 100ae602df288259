"""Tables that all parts of P3 have: extrapolation, believed, consistency, operations; and how tables are composed.

The columns of a table have the order of the mapping that is made for one case.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency, statistics
from radarsim.report import tables as common
from radarsim.report.tables import interval, leading
from radarsim.studies.sonar import operations as counted
from radarsim.studies.sonar.axes import SonarAxes

if TYPE_CHECKING:
    import pandas as pd

Columns = Mapping[str, np.ndarray]
Index = tuple[np.ndarray, ...]


def tables(results: Sequence[CaseResult[SonarAxes]]) -> "dict[str, pd.DataFrame]":
    """The tables of these cases in addition to curves and gains."""
    return {
        "extrapolation": stacked(_extrapolation(result) for result in results),
        "believed": stacked(_believed(result) for result in results),
        "consistency": stacked(_normalised_errors(result) for result in results),
        "operations": operations(),
    }


# ---- parts of tables ----------------------------------------------------------------------------------------------
def stacked(parts: Iterable[Columns]) -> "pd.DataFrame":
    """One table of the columns of several cases, without those that have no rows."""
    filled = [part for part in parts if any(len(values) for values in part.values())]
    return common.joined(filled, tuple(filled[0]) if filled else ())


def of_coordinates(result: CaseResult[SonarAxes], mask: np.ndarray) -> tuple[Index, dict[str, np.ndarray]]:
    """Where mask (F, K, C) is true: indices (filter, scan, coordinate), each (n,), and the first columns of these rows.

    Rows are ordered by filter, coordinate, scan.
    """
    f, c, k = np.nonzero(np.moveaxis(mask, 1, 2))
    names, units = zip(*result.axes.coordinates, strict=True)
    return (f, k, c), leading(result, f, k, component=common.names(names, c), unit=common.names(units, c))


# ---- tables -------------------------------------------------------------------------------------------------------
def complete(result: CaseResult[SonarAxes]) -> np.ndarray:
    """The number of realisations (F, K, C) in which the state of a filter is complete in a coordinate."""
    counts = np.asarray(result.sums["estimates"])
    split = counts.reshape(*counts.shape[:2], len(result.axes.coordinates), -1)
    return np.take_along_axis(split, (result.axes.sizes - 1)[:, None, None, None], axis=3)[..., 0]


def _extrapolation(result: CaseResult[SonarAxes]) -> Columns:
    """σ of each coordinate extrapolated by one scan, in the row of the scan that it is extrapolated from."""
    n = complete(result)
    mask = n > 0
    mask[:, -1] = False
    at, columns = of_coordinates(result, mask)
    of = statistics.errors(result.sums["ahead"][at], n[at])
    return {
        **columns,
        "n": n[at].astype(np.int64),
        **interval("sigma", of.sigma),
        "bias": of.bias,
        "bias_se": of.bias_se,
        "exact_sigma": result.axes.exact_ahead[at],
    }


def _believed(result: CaseResult[SonarAxes]) -> Columns:
    """The measured σ beside the σ that the filter believes, the root of its mean variance."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return consistency.believed(result, np.sqrt(result.sums["believed"] / common.realisations(result)))


def _normalised_errors(result: CaseResult[SonarAxes]) -> Columns:
    """NEES eᵀP⁻¹e of the state in a coordinate, per component, where the state is complete.

    For a consistent filter the means of all its scans are within their bounds in 95 % of runs.
    """
    n = complete(result)
    at, columns = of_coordinates(result, n > 0)
    looks = np.sum(n > 0, axis=1)[at[0], at[2]]
    size, n = result.axes.sizes[at[0]], n[at]
    joint = result.sums["joint"][at]
    mean = statistics.mean_square(joint[:, 0] / size, joint[:, 1] / size**2, n)
    bounds = statistics.normalised_bounds(size * n, looks)
    nees = consistency.normalised("nees", mean, bounds, result.axes.exact_nees[at] / size)
    return {**columns, "n": n.astype(np.int64), **nees}


def operations() -> "pd.DataFrame":
    """Operations of one scan in one coordinate, degree 1, by algorithm, and the numbers that each keeps."""
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
