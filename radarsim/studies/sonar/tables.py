"""Tables of any part of P3."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import notes, statistics
from radarsim.report import tables as common
from radarsim.report.tables import Columns, leading
from radarsim.studies.sonar import scene
from radarsim.studies.sonar.world import GivenPlotsAxes, SonarAxes

if TYPE_CHECKING:
    import pandas as pd

Index = tuple[np.ndarray, ...]
table = common.Tables()


# ---- parts of tables ----------------------------------------------------------------------------------------------
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


@table("extrapolation")
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
        "sigma": of.sigma,
        "bias": of.bias,
        "bias_se": of.bias_se,
        "exact_sigma": result.axes.exact_ahead[at],
    }


@table("believed")
def _believed(result: CaseResult[SonarAxes]) -> Columns:
    """As everywhere."""
    with np.errstate(invalid="ignore", divide="ignore"):
        columns = notes.believed(result, np.sqrt(result.sums["believed"] / common.realisations(result)))
    adapts = result.axes.adapts[common.shown(result)[0]] if isinstance(result.axes, GivenPlotsAxes) else False
    # An alarm changes a window's length, and what is believed by a factor: its mean over realisations is itself a draw.
    return {**columns, "note": np.where(adapts, notes.VARIES, "").astype(object)} if np.any(adapts) else columns


@table("consistency")
def _normalised_errors(result: CaseResult[SonarAxes]) -> Columns:
    """NEES of a coordinate's state, where it is complete; the bounds are shared among all scans of a filter."""
    n = complete(result)
    at, columns = of_coordinates(result, n > 0)
    looks = np.sum(n > 0, axis=1)[at[0], at[2]]
    size, n = result.axes.sizes[at[0]], n[at]
    joint = result.sums["joint"][at]
    mean = statistics.mean_square(joint[:, 0] / size, joint[:, 1] / size**2, n)
    bounds = statistics.normalised_bounds(size * n, looks)
    nees = notes.normalised("nees", mean, bounds, result.axes.exact_nees[at] / size)
    return {**columns, "n": n.astype(np.int64), **nees}


@table.whole("operations")
def _operations(results: Sequence[CaseResult[SonarAxes]]) -> "pd.DataFrame":
    """Operations of one scan of one coordinate at degree 1.

    algorithm: in words, with the equation of the paper
    numbers_kept: how many numbers are kept from scan to scan
    products, sums, operations: number of products and divisions, of sums and differences, and of both
    """
    rows = [("recursion (12)-(14)", 2, scene.recursion())]
    rows += [(f"least squares (2) on {n} plots", 2 * n, scene.batch_of(n)) for n in (2, 3, 5, 6, 10)]
    rows += [("Kalman (11), degree 1", 2, scene.kalman_of(2)), ("differenced", 3, scene.differenced())]
    rows += [("augmented", 3, scene.augmented())]
    names = ("algorithm", "numbers_kept", "products", "sums", "operations")
    columns = zip(*((name, kept, of.products, of.sums, of.total) for name, kept, of in rows), strict=True)
    return common.frame(dict(zip(names, columns, strict=True)))


tables = table.made
