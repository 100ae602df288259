"""What a filter believes of its errors against what they are, with the same columns and words in every study.

`believed.csv` compares standard deviations, component by component: `ratio` is the true σ over the believed one.
`consistency.csv` compares whole states and residuals by normalised squares, per degree of freedom: NEES eᵀP⁻¹e of the
error e, NIS νᵀS⁻¹ν of the innovation ν, P and S the covariances that the filter believes. Both are 1 for a filter that
is right about itself. Over 1 the filter is optimistic, its errors are larger than it believes; under 1 it is
pessimistic. (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 5.4.)
"""

from collections.abc import Mapping

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import statistics, tables
from radarsim.report.statistics import Estimate, Values

OPTIMISTIC, CONSISTENT, PESSIMISTIC = "optimistic", "consistent", "pessimistic"
BELIEVED = (
    *("case", "filter", "component", "unit", "k", "t_s", "n"),
    *("sigma", "believed_sigma", "ratio", "ratio_lo", "ratio_hi"),
)


def believed(result: CaseResult, sigma: np.ndarray) -> dict[str, np.ndarray]:
    """Columns BELIEVED of one case: the measured σ beside sigma (F, K, C), the σ that the filters believe.

    Rows stand where a filter has an estimate, as in `tables.curves`. The interval of the ratio is that of the measured
    σ alone. Where the believed one hangs on the plots (missed ones, filters that adapt) its mean has a chance of its
    own, which is small beside: rows of `sonar_manoeuvre` and of a radar that misses plots cover 94 … 95 %.
    """
    axes, at = result.axes, tables.shown(result)
    f, k, c = at
    n = tables.realisations(result)[at]
    true, claimed = statistics.errors(np.asarray(result.sums["error"])[at], n).sigma, sigma[at]
    return {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": tables.names(axes.filters, f),
        "component": tables.names([name for name, _ in axes.components], c),
        "unit": tables.names([unit for _, unit in axes.components], c),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
        "n": n.astype(np.int64),
        **ratio_columns(true, claimed),
    }


def ratio_columns(true: Estimate, claimed: np.ndarray) -> dict[str, np.ndarray]:
    """`sigma`, `believed_sigma` and their `ratio` with its interval, of estimates (n,) of σ and believed ones (n,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = [end / claimed for end in true]
    names = ("ratio", "ratio_lo", "ratio_hi")
    return {"sigma": true.value, "believed_sigma": claimed, **dict(zip(names, ratios, strict=True))}


def columns(quantity: str, *, exact: bool = False) -> tuple[str, ...]:
    """The columns of `nees` or `nis` in consistency.csv; `exact_…` where a study knows its expectation."""
    between = (f"exact_{quantity}",) if exact else ()
    ends = (f"{quantity}{end}" for end in ("", "_lo", "_hi"))
    return (*ends, *between, *(f"{quantity}_{end}" for end in ("bound_lo", "bound_hi", "verdict")))


def normalised(
    quantity: str, mean: Estimate, bounds: tuple[np.ndarray, np.ndarray], exact: np.ndarray | None = None
) -> Mapping[str, np.ndarray]:
    """Columns of `nees` or `nis`, arrays of one shape: the mean with its interval, the bounds, and the verdict.

    In 95 % of runs all means of a filter that is right about itself lie between their bounds. Where the expectation is
    known, it is judged by them in place of the mean.
    """
    known = () if exact is None else (exact,)
    decides = mean.value if exact is None else np.where(np.isnan(exact), mean.value, exact)
    values = (*mean, *known, *bounds, verdict(decides, *bounds))
    return dict(zip(columns(quantity, exact=exact is not None), values, strict=True))


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
