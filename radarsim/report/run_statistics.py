"""Each run's root mean square over a span of scans, and its statistics over the runs: the table `runs`.

The number of a run that tracking papers print: √(mean over the scans of e²), of which they give the mean and the
variance over the runs. It is no function of σ(k), which is a mean over the runs at each scan."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.report.statistics import Estimate, mean, student

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


class ScanSpan(NamedTuple):
    """Scans first to last, both included, by their number."""

    first: int
    last: int

    def indices(self, k: np.ndarray) -> np.ndarray:
        """Where these scans stand among the scans k (K,)."""
        return np.flatnonzero((k >= self.first) & (k <= self.last))

    def is_among(self, k: np.ndarray) -> bool:
        """Whether the scans k (K,) reach from its first to its last, with one of them at least."""
        return bool(k[0] <= self.first and self.last <= k[-1] and self.indices(k).size)


def run_rms(errors: np.ndarray) -> np.ndarray:
    """Root mean squares (...) over the scans of errors (..., K): of the scans with an estimate, NaN where none has
    one."""
    present = np.isfinite(errors)
    count = present.sum(axis=-1)
    square = np.square(np.where(present, errors, 0.0)).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(np.where(count, square / count, np.nan))


def mean_of_runs(values: np.ndarray) -> Estimate:
    """The mean of the runs' numbers (n,), with its 95 % interval; of the runs that have one."""
    x = values[np.isfinite(values)]
    return Estimate(*(float(end) for end in mean(x.sum(), np.square(x).sum(), x.size)))


def variance_of_runs(values: np.ndarray) -> Estimate:
    """Their variance (divisor n − 1); its interval from their fourth moment, as of a mean of squares."""
    x = values[np.isfinite(values)]
    n = x.size
    if n < 2:
        return Estimate(np.nan, np.nan, np.nan)
    square = np.square(x - x.mean())
    value = square.sum() / (n - 1)
    half = float(student(n - 1)) * square.std() / np.sqrt(n - 1)
    return Estimate(float(value), float(max(value - half, 0.0)), float(value + half))


def median_of_runs(values: np.ndarray) -> Estimate:
    """Their median; the ends of its interval are order statistics, which cover 95 % whatever the law."""
    x = np.sort(values[np.isfinite(values)])
    n = x.size
    if not n:
        return Estimate(np.nan, np.nan, np.nan)
    from scipy.stats import binom

    below = int(binom.ppf(0.025, n, 0.5))  # P(fewer than this many of n lie below the median) ≤ 2.5 %
    ends = (x[below - 1], x[n - below]) if below else (-np.inf, np.inf)
    return Estimate(float(np.median(x)), *(float(end) for end in ends))


STATISTICS = {"mean": mean_of_runs, "variance": variance_of_runs, "median": median_of_runs}


def statistics_row(values: np.ndarray) -> Mapping[str, float]:
    """The statistics of a filter's runs (n,), as columns of the table `runs`.

    n: the runs that have an estimate
    mean, variance, median: of their root mean squares, each with its 95 % interval
    quantile_05 … quantile_95: below which so many of a hundred runs lie"""
    columns: dict[str, float] = {"n": int(np.isfinite(values).sum())}
    for name, statistic in STATISTICS.items():
        columns |= dict(zip((name, f"{name}_lo", f"{name}_hi"), statistic(values), strict=True))
    x = values[np.isfinite(values)]
    quantiles: Sequence[float] = np.quantile(x, QUANTILES) if x.size else [np.nan] * len(QUANTILES)
    return columns | {f"quantile_{100 * q:02.0f}": float(x) for q, x in zip(QUANTILES, quantiles, strict=True)}
