"""A filter's predicted errors against its true ones, with the same columns and words in every study.

`believed_sigma` of `curves.csv` stands beside the true σ of each component. `consistency.csv` compares whole states and
residuals by normalised squares, per degree of freedom: NEES eᵀP⁻¹e of the error e, NIS νᵀS⁻¹ν of the innovation ν, P
and S the covariances that the filter predicts. Both are 1 for a consistent filter. Above 1 the filter is optimistic:
its errors are larger than predicted. Below 1 it is pessimistic. (Bar-Shalom, Li & Kirubarajan, Estimation with
Applications to Tracking and Navigation, 2001, 5.4.)"""

import numpy as np

from radarsim.report import statistics, tables
from radarsim.report.statistics import Estimate, Values

OPTIMISTIC, CONSISTENT, PESSIMISTIC = "optimistic", "consistent", "pessimistic"


def ratio_columns(true: Estimate, claimed: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of estimates (n,) of σ and believed ones (n,).

    believed_sigma [unit]: root of the mean variance that the filter computes
    ratio ±: true over filter-computed σ"""
    columns = tables.interval_columns("ratio", _quotient(true, claimed))
    return {"sigma": true.value, "believed_sigma": claimed, **columns}


def _quotient(true: Estimate, believed: np.ndarray) -> Estimate:
    with np.errstate(invalid="ignore", divide="ignore"):
        return Estimate(*(end / believed for end in true))


def normalised_square_columns(
    quantity: str, mean: Estimate, bounds: tuple[np.ndarray, np.ndarray], exact: np.ndarray | None = None
) -> tables.Columns:
    """Consistency of a filter's covariances with its errors (NEES) or innovations (NIS), by normalised squares.

    nees ±, nis ±: mean of `eᵀP⁻¹e`, `νᵀS⁻¹ν` per degree of freedom, P and S the filter-computed covariances
    nees_bound_lo, nees_bound_hi, nis_bound_lo, nis_bound_hi: between them lie all means of a filter that is right about
        itself in 95 % of runs (Bonferroni)
    nees_verdict, nis_verdict: consistent, optimistic or pessimistic, as the exact mean, or where it is not known the
        measured one, lies by these bounds"""
    exact_column = {} if exact is None else {f"exact_{quantity}": exact}
    decides = mean.value if exact is None else np.where(np.isnan(exact), mean.value, exact)
    ends = dict(zip((f"{quantity}_bound_lo", f"{quantity}_bound_hi"), bounds, strict=True))
    return {quantity: mean, **exact_column, **ends, f"{quantity}_verdict": consistency_verdict(decides, *bounds)}


def consistency_verdict(mean: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """The meaning of a mean NEES or NIS for a filter's covariance, by the bounds of a consistent filter."""
    return np.select([mean < lo, mean > hi], [PESSIMISTIC, OPTIMISTIC], CONSISTENT).astype(object)


def bounds_from_spread(total: Values, square: Values, n: Values, looks: int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of a mean NEES or NIS of unknown law, from Σq and Σq² over n realisations. They are the interval of the
    mean, widened so that `looks` of them hold at once in 95 % of runs, moved to 1: 1 leaves that interval where the
    mean leaves these bounds."""
    mean = statistics.mean_square(total, square, n, looks)
    with np.errstate(divide="ignore", invalid="ignore"):
        return mean.value / mean.hi, mean.value / mean.lo
