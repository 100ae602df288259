"""Intervals of Poisson rates, of ratios of sums, and of the mean time of counted events."""

import numpy as np

from radarsim.report import statistics
from radarsim.report.statistics import Z95, Estimate, Values


def poisson_rate(count: Values, exposure: Values) -> Estimate:
    """The rate of Poisson events over an exposure with Garwood's 95 % interval, approximated by Wilson and Hilferty."""
    count = np.asarray(count, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = count * np.maximum(1 - 1 / (9 * count) - Z95 / (3 * np.sqrt(count)), 0) ** 3
        high = (count + 1) * (1 - 1 / (9 * (count + 1)) + Z95 / (3 * np.sqrt(count + 1))) ** 3
        return Estimate(count / exposure, np.where(count > 0, low, 0.0) / exposure, high / exposure)


def ratio_of_sums(sums: np.ndarray, n: int) -> Estimate:
    """The ratio Σa/Σb with its 95 % interval, from sums (5,) Σa, Σa², Σb, Σb², Σab over n realisations.

    The interval is that of the logarithm, from the spread of a − R b over realisations (the delta method). Without any
    event it is that of a Poisson number; without exposure it is NaN."""
    a, aa, b, bb, ab = (float(number) for number in sums)
    if b <= 0:
        return Estimate(np.nan, np.nan, np.nan)
    if a <= 0 or n < 2:
        return Estimate(*(float(number) for number in poisson_rate(a, b)))
    value = a / b
    spread = np.sqrt(max(aa - 2 * value * ab + value**2 * bb, 0.0) * n / (n - 1)) / b
    factor = float(np.exp(statistics.student(n - 1) * spread / value))
    return Estimate(value, value / factor, value * factor)


def mean_event_time(times: np.ndarray, counts: np.ndarray) -> Estimate:
    """The mean time of events with counts (K,) at times (K,), with its 95 % interval."""
    n = counts.sum()
    if n < 1:
        return Estimate(np.nan, np.nan, np.nan)
    mean = float(times @ counts / n)
    half = (
        float(statistics.student(n - 1) * np.sqrt((times - mean) ** 2 @ counts / n / max(n - 1, 1)))
        if n > 1
        else np.inf
    )
    return Estimate(mean, mean - half, mean + half)
