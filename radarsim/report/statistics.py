"""Numbers with their 95 % intervals, from sums alone. NumPy only; every function takes arrays of any shape.

The intervals are those of a mean of independent realisations and assume nothing Gaussian: the spread of e² comes from
the fourth moment. tests/report and tests/trust simulate the coverage; docs/trust.md gives it."""

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

EQUAL_KURTOSIS = 1e-9  # of κ − 1: errors that differ by no more are the same but for rounding

Values = Any  # a number or an array of numbers: NumPy computes with both alike, which its types cannot express
Z95 = 1.959963984540054
# Where less than this stands behind a 95 % interval, its coverage was measured to leave 93.6 … 96.4 %
# (tests/trust/test_statistics.py).
MIN_TRUSTED_REALISATIONS = (
    200  # realisations of a run: of Gaussian errors paired gains cover 93.6 % at 30, means of products 93.2 at 100
)
MIN_EVENTS = 20  # rare errors, or weighted events, behind an interval that they decide


class Estimate(NamedTuple):
    """A value and the ends of its 95 % interval; numbers, or arrays of one shape."""

    value: Values
    lo: Values
    hi: Values


class ErrorStatistics(NamedTuple):
    """Of an error e: rms about the truth with its interval, mean with its standard error, standard deviation."""

    sigma: Estimate
    bias: np.ndarray
    bias_se: np.ndarray
    spread: np.ndarray


def student(freedom: Values) -> Values:
    """The 0.975 quantile of Student's t (Abramowitz & Stegun 26.7.5), to 4·10⁻⁴ from 4 degrees of freedom on. Used to
    widen intervals whose spread is itself estimated; infinite where there is no degree of freedom."""
    z = Z95
    nu = np.asarray(freedom, dtype=float)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    with np.errstate(divide="ignore"):
        return np.where(nu > 0, z + sum(c / np.abs(nu) ** (i + 1) for i, c in enumerate(terms)), np.inf)


def _per_one(sums: Values, n: Values) -> Values:
    """sums / n, NaN where n is 0."""
    n = np.asarray(n, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(n > 0, sums / n, np.nan)


def root_mean_square(square: Values, fourth: Values, n: Values, looks: Values = 1) -> Estimate:
    """rms of e with its interval, from Σe² and Σe⁴ over n realisations; of `looks` at once all hold in 95 % of runs.

    The mean of e² is taken as a chi-square variable of 2/CV² degrees of freedom, CV² = (m₄/m₂² − 1)/n: exact for
    Gaussian e (n degrees), right to first order for any other, biased errors too. Its quantiles are Wilson and
    Hilferty's, with Student's t for the normal quantile; m₄/m₂² − 1 is freed of its Gaussian bias (n−1)/(n+2).
    The upper end is infinite where n is too small to bound σ."""
    n = np.asarray(n, dtype=float)
    m2, m4 = _per_one(square, n), _per_one(fourth, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.where(m2 > 0, m4 / np.square(m2) - 1, 0)
        excess = np.where(n > 1, excess * (n + 2) / np.abs(n - 1), 2)
        return _root(m2, excess / n, n, looks)


def _root(m2: Values, relative: Values, n: Values, looks: Values = 1) -> Estimate:
    """Root of a mean square m2 of relative variance `relative`, with the interval that `root_mean_square` describes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ninth = np.maximum(relative, 0) / 9  # Wilson and Hilferty's 2/(9ν)
        step = student(n - 1) * quantile(looks) / Z95 * np.sqrt(ninth)
        root = np.sqrt(m2)
        lo = root * np.maximum(1 - ninth + step, 0) ** -1.5
        base = 1 - ninth - step
        hi = np.where(base > 0, root * np.maximum(base, 1e-100) ** -1.5, np.inf)
    has_values = n > 0
    return Estimate(
        root, np.where(has_values, lo, np.nan), np.where(has_values & (m2 > 0), hi, np.where(has_values, root, np.nan))
    )


def effective(square: Values, fourth: Values, n: Values) -> Values:
    """How many realisations of n stand behind a σ: n/(κ − 1), κ = m₄/m₂² from Σe² and Σe⁴; half of n for Gaussian e.
    Twice the degrees of freedom of the chi-square variable of `root_mean_square`; infinite where all e² are equal
    within rounding, NaN where there is none."""
    m2, m4 = _per_one(square, n), _per_one(fourth, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = m4 / np.square(m2) - 1
        return np.where(excess > EQUAL_KURTOSIS, n / np.abs(excess), np.where(np.isnan(excess), np.nan, np.inf))


CHANCE_BEYOND_THREE = 0.0027  # chance of a number beyond three standard errors


def largest_by_chance(looks: Values) -> float:
    """A bound on the largest of so many differences, in standard errors, that correct programs exceed in 0.27 % of
    runs.

    For one difference 3; for several by Bonferroni, however dependent they are."""
    return NormalDist().inv_cdf(1 - CHANCE_BEYOND_THREE / 2 / max(int(looks), 1))


ERROR_OF_PROGRAM = 5.85  # standard errors between a measured and an exact value: by chance once in 2·10⁸


def standard_errors(estimate: Estimate, exact: Values) -> Values:
    """Distance of a measured value from the exact one in its standard errors, from its 95 % interval; 0 or more.

    Towards the wider side of the interval the variance is taken to grow in proportion to the distance, as it does where
    the interval is Wilson's or that of a rate: the result is then the score of the exact value. Towards the narrower
    side it stays what it is at the value. This statistic has no heavier tails than a Gaussian number: of rates however
    rare, and of σ from 200 realisations on. Infinite where a value without width is off, NaN where either is unknown.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = np.subtract(exact, estimate.value)
        up, down = np.subtract(estimate.hi, estimate.value), np.subtract(estimate.value, estimate.lo)
        growth = np.where(difference > 0, up - down, down - up)
        unbounded = np.isinf(np.where(difference > 0, estimate.hi, estimate.lo))
        variance = up * down + np.maximum(growth, 0) * np.abs(difference)
        distance = np.where((difference == 0) | unbounded, 0.0, Z95 * np.abs(difference) / np.sqrt(variance))
    return np.where(np.isnan(difference) | np.isnan(up) | np.isnan(down), np.nan, distance)


def errors(moments: Values, n: Values) -> ErrorStatistics:
    """Statistics of errors from moments (…, 4) = Σe, Σe², Σe³, Σe⁴ over n (…) realisations. The spread divides by n, so
    that sigma² = bias² + spread²; the standard error of the bias by n − 1. Where |bias| is over 10⁷ spreads the
    difference of squares is rounding; it is cut at zero."""
    moments = np.asarray(moments, dtype=float)
    n = np.asarray(n, dtype=float)
    bias = _per_one(moments[..., 0], n)
    variance = np.maximum(_per_one(moments[..., 1], n) - np.square(bias), 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        bias_se = np.where(n > 1, np.sqrt(variance / np.abs(n - 1)), np.nan)
    return ErrorStatistics(root_mean_square(moments[..., 1], moments[..., 3], n), bias, bias_se, np.sqrt(variance))


def mean(total: Values, square: Values, n: Values) -> Estimate:
    """Mean of any numbers x with its interval (Student's), from Σx and Σx² over n realisations."""
    n = np.asarray(n, dtype=float)
    value = _per_one(total, n)
    variance = np.maximum(_per_one(square, n) - np.square(value), 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.where(n > 1, student(n - 1) * np.sqrt(variance / np.abs(n - 1)), np.inf)
    return Estimate(value, value - half, value + half)


def mean_square(total: Values, square: Values, n: Values, looks: Values = 1) -> Estimate:
    """Mean of numbers q ≥ 0 that are sums of squares (NEES, NIS), from Σq and Σq² over n realisations. The interval of
    `root_mean_square`, squared: near a chi-square variable it covers better than Student's does."""
    return Estimate(*(np.square(end) for end in root_mean_square(total, square, n, looks)))


def quantile(looks: Values) -> Values:
    """The normal quantile at which all of so many intervals or bounds hold in 95 % of runs, however dependent.

    Bonferroni: the 5 % are shared among them."""
    return np.vectorize(lambda n: NormalDist().inv_cdf(1 - 0.025 / n), otypes=[float])(np.maximum(looks, 1))


def simultaneous_sizes(estimate: Estimate, looks: Values) -> Estimate:
    """Positive numbers with intervals of which so many all hold in 95 % of runs; those given hold one by one.

    For an extreme that was chosen among `looks` of them. Each end moves away in proportion on a logarithmic scale."""
    factor = quantile(looks) / Z95
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (estimate.value * np.divide(end, estimate.value) ** factor for end in estimate[1:])
    return Estimate(estimate.value, low, high)


def simultaneous_means(estimate: Estimate, looks: Values) -> Estimate:
    """`simultaneous_sizes` of numbers of either sign, as means of errors: each end moves away in proportion."""
    factor = quantile(looks) / Z95
    return Estimate(estimate.value, *(estimate.value + factor * (end - estimate.value) for end in estimate[1:]))


def simultaneous_gains(estimate: Estimate, looks: Values) -> Estimate:
    """`simultaneous_sizes` of gains in per cent, by the ratio of σ that a gain is."""
    ratio = simultaneous_sizes(Estimate(*(100 - np.asarray(end, float) for end in estimate)), looks)
    return Estimate(estimate.value, 100 - ratio.lo, 100 - ratio.hi)


def simultaneous_shares(estimate: Estimate, looks: Values) -> Estimate:
    """`simultaneous_sizes` of shares: Wilson's interval of the same number of yes-or-no trials at a larger quantile."""
    p, half = np.asarray(estimate.value, float), np.subtract(estimate.hi, estimate.lo) / 2
    linear, quadratic = 2 * half**2 - p * (1 - p), 0.25 - half**2
    with np.errstate(divide="ignore", invalid="ignore"):
        per_trial = (np.hypot(linear, 2 * half * np.sqrt(quadratic)) + linear) / (2 * quadratic)  # z² over the trials
        return _wilson(p, Z95**2 / (per_trial * np.square(quantile(looks) / Z95)))


def normalised_bounds(freedom: Values, looks: Values = 1) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the mean normalised error squared (NEES, NIS per component) of a consistent filter.

    freedom is realisations × components, of which the sum is chi-square; its quantiles are Wilson and Hilferty's. In
    95 % of runs all of the `looks` at such means lie within."""
    with np.errstate(divide="ignore"):
        ninth = 2 / (9 * np.asarray(freedom, dtype=float))
    step = quantile(looks) * np.sqrt(ninth)
    return np.maximum(1 - ninth - step, 0) ** 3, (1 - ninth + step) ** 3


def gain(
    square: Values, fourth: Values, base_square: Values, base_fourth: Values, cross: Values, n: Values
) -> Estimate:
    """Relative gain K = 100 (1 − σ/σ_base) in per cent (P1 eq. 17), paired on the same realisations.

    From Σe², Σe⁴ of both and cross = Σ e²·e_base². The interval is that of the logarithm of the ratio of mean
    squares, whose variance holds the covariance of the squares; common noise so makes it narrower. That variance is
    freed of its Gaussian bias, exact for uncorrelated errors."""
    n = np.asarray(n, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = _per_one(square, n), _per_one(base_square, n)
        variance = _per_one(fourth, n) / a**2 + _per_one(base_fourth, n) / b**2 - 2 * _per_one(cross, n) / (a * b)
        # (n + 2)/(n − 1)/n makes m₄/m₂² − 1 of a Gaussian sample the variance of its mean square over m₂².
        variance = np.maximum(variance, 0) * ((n + 2) / np.maximum(n - 1, 0) / n)
        ratio = np.sqrt(a / b)
        # One realisation shows no spread: the interval is unbounded.
        step = np.where(n > 1, 0.5 * student(n - 1) * np.sqrt(variance), np.inf)
    with np.errstate(over="ignore"):  # of two realisations
        factor = np.where((ratio == 0) & (n > 1), 1, np.exp(step))  # of errors that are all nought
    return Estimate(100 * (1 - ratio), 100 * (1 - ratio * factor), 100 * (1 - ratio / factor))


def probability(total: Values, square: Values, n: Values) -> Estimate:
    """Mean of values between 0 and 1 with its interval, from Σp and Σp² over n realisations. Wilson's score interval at
    the number of yes-or-no trials of the same variance, n·p(1−p)/var ≥ n: for zeros and ones it is Wilson's own, and it
    keeps a width where all values agree."""
    n = np.asarray(n, dtype=float)
    p = _per_one(total, n)
    variance = np.maximum(_per_one(square, n) - p**2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        trials = np.where(variance > 0, n * np.clip(p * (1 - p), 0, None) / variance, n)
        trials = np.maximum(trials, n)
    return _wilson(p, trials)


def _wilson(p: Values, trials: Values) -> Estimate:
    """A share p with Wilson's score interval, of so many yes-or-no trials."""
    with np.errstate(divide="ignore", invalid="ignore"):
        zz = Z95**2 / trials
        middle, half = (p + zz / 2) / (1 + zz), np.sqrt(np.maximum(zz * p * (1 - p), 0) + zz**2 / 4) / (1 + zz)
    # Of a share of 0 or 1 the end is the share itself: rounding must not leave it outside.
    return Estimate(p, np.clip(np.minimum(middle - half, p), 0, 1), np.clip(np.maximum(middle + half, p), 0, 1))


def weighted_rate(total: Values, square: Values, n: Values, plain: Values) -> Estimate:
    """Share of realisations in which something happens, from some that another law drew, with weights w.

    total and square are Σw and Σw² over those of n in which it happened. Wilson's interval at the number of yes-or-no
    trials with as much information, p(1 − p) over the variance of the mean. `plain` of the n were drawn from the law
    itself: where nothing happened, only they bound the rate."""
    n, plain = np.asarray(n, dtype=float), np.asarray(plain, dtype=float)
    p = np.clip(_per_one(total, n), 0, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.maximum(_per_one(square, n) - p**2, 0) / np.maximum(n - 1, 1)
        trials = p * (1 - p) / variance
    return _wilson(p, np.where((p > 0) & (p < 1) & (variance > 0), trials, plain))


def effective_events(total: Values, square: Values) -> Values:
    """How many events of equal weight a weighted share corresponds to: (Σw)²/Σw² over the events, 0 of none (Kish)."""
    total, square = np.asarray(total, dtype=float), np.asarray(square, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(square > 0, total**2 / square, 0.0)


def rate(count: Values, n: Values) -> Estimate:
    """Share of n realisations in which something happened, with Wilson's interval."""
    return probability(count, count, n)


def difference(a: Estimate, b: Estimate, correlation: Values = 0.0) -> Estimate:
    """a − b of estimates: the half-widths add in squares, each end with the ends that make it. Less twice their product
    times the correlation of the two, which is 0 of independent ones. NaN where infinite ones (a filter that never
    settles) leave it undefined. (Zou, Psychological Methods 12, 2007, 399.)"""

    def combine(width: Values, other_width: Values) -> Values:
        shared = np.where(np.equal(correlation, 0), 0.0, correlation * other_width)  # 0 · ∞ is no number
        return np.hypot(width - shared, np.sqrt(1 - np.square(correlation)) * other_width)

    with np.errstate(invalid="ignore"):
        value = np.subtract(a.value, b.value)
        down = combine(np.subtract(a.value, a.lo), np.subtract(b.hi, b.value))
        up = combine(np.subtract(a.hi, a.value), np.subtract(b.value, b.lo))
        return Estimate(value, value - down, value + up)
