"""What a filter believes of its errors against what they are, with the same columns and words in every study.

`believed.csv` compares standard deviations, component by component: `ratio` is the true σ over the believed one.
`consistency.csv` compares whole states and residuals by normalised squares, per degree of freedom: NEES eᵀP⁻¹e of the
error e, NIS νᵀS⁻¹ν of the innovation ν, P and S the covariances that the filter believes. Both are 1 for a filter that
is right about itself. Over 1 the filter is optimistic, its errors are larger than it believes; under 1 it is
pessimistic. (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 5.4.)
"""

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import statistics, tables
from radarsim.report.statistics import Estimate, Values

OPTIMISTIC, CONSISTENT, PESSIMISTIC = "optimistic", "consistent", "pessimistic"


def believed(result: CaseResult, sigma: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of one case: the measured σ beside sigma (F, K, C), the σ that the filters believe.

    Rows stand where a filter has an estimate, as in `tables.curves`. The interval of the ratio is that of the measured
    σ alone. Where the believed one hangs on the plots (missed ones, filters that adapt) its mean has a chance of its
    own, which is small beside: rows of `sonar_manoeuvre` and of a radar that misses plots cover 94 … 95 %.
    """
    at = f, k, c = tables.shown(result)
    n = tables.realisations(result)[at]
    true, claimed = statistics.errors(np.asarray(result.sums["error"])[at], n).sigma, sigma[at]
    return {
        **tables.leading(result, f, k, **tables.components(result, c)),
        "n": n.astype(np.int64),
        **ratio_columns(true, claimed),
    }


def ratio_columns(true: Estimate, claimed: np.ndarray) -> dict[str, np.ndarray]:
    """`sigma`, `believed_sigma` and their `ratio` with its interval, of estimates (n,) of σ and believed ones (n,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = Estimate(*(end / claimed for end in true))
    return {"sigma": true.value, "believed_sigma": claimed, **tables.interval("ratio", ratio)}


def normalised(
    quantity: str, mean: Estimate, bounds: tuple[np.ndarray, np.ndarray], exact: np.ndarray | None = None
) -> tables.Columns:
    """Columns of `nees` or `nis`, arrays of one shape: the mean with its interval, the bounds, and the verdict.

    In 95 % of runs all means of a filter that is right about itself lie between their bounds. Where the expectation is
    known, it is judged by them in place of the mean.
    """
    known = {} if exact is None else {f"exact_{quantity}": exact}
    decides = mean.value if exact is None else np.where(np.isnan(exact), mean.value, exact)
    ends = dict(zip((f"{quantity}_bound_lo", f"{quantity}_bound_hi"), bounds, strict=True))
    return {quantity: mean, **known, **ends, f"{quantity}_verdict": verdict(decides, *bounds)}


def verdict(mean: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """What a mean NEES or NIS says of a filter's covariance, by the bounds of a filter that is right about itself."""
    return np.select([mean < lo, mean > hi], [PESSIMISTIC, OPTIMISTIC], CONSISTENT).astype(object)


def bounds_from_spread(total: Values, square: Values, n: Values, looks: int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of a mean NEES or NIS of unknown law, from Σq and Σq² over n realisations.

    They stand about 1 as the interval of the mean, widened so that `looks` of them hold at once in 95 % of runs, stands
    about the mean: 1 leaves that interval where the mean leaves these bounds.
    """
    mean = statistics.mean_square(total, square, n, looks)
    with np.errstate(divide="ignore", invalid="ignore"):
        return mean.value / mean.hi, mean.value / mean.lo
