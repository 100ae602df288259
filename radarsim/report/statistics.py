"""Numbers with their 95 % intervals, from sums alone. NumPy only; every function takes arrays of any shape.

The intervals treat what is estimated as a mean of independent realisations and nothing as Gaussian: the spread of
e² comes from the fourth moment. tests/report and tests/trust simulate the coverage; docs/trust.md gives it.
"""

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

ALIKE = 1e-9  # of κ − 1: errors that differ by no more are the same but for rounding

Values = Any  # a number or an array of numbers: NumPy computes with both alike, which its types cannot express
Z95 = 1.959963984540054
# Where less than this stands behind a 95 % interval, its coverage was measured to leave 93.6 … 96.4 %
# (tests/trust/test_statistics.py).
FEW = 200  # realisations of a run: of Gaussian errors paired gains cover 93.6 % at 30, means of products 93.2 at 100
# Effective realisations, n/(κ − 1), that controls have to leave behind a mean square for it to count.
FEW_EFFECTIVE = 200
FEW_EVENTS = 20  # rare errors, or weighted events, behind an interval that they decide


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
    """The 0.975 quantile of Student's t (Abramowitz & Stegun 26.7.5), to 4·10⁻⁴ from 4 degrees of freedom on.

    Used to widen intervals whose spread is itself estimated; infinite where there is no degree of freedom.
    """
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
    """sums / n, not-a-number where n is 0."""
    n = np.asarray(n, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(n > 0, sums / n, np.nan)


def root_mean_square(square: Values, fourth: Values, n: Values, looks: Values = 1) -> Estimate:
    """rms of e with its interval, from Σe² and Σe⁴ over n realisations; of `looks` at once all hold in 95 % of runs.

    The mean of e² is taken as a chi-square variable of 2/CV² degrees of freedom, CV² = (m₄/m₂² − 1)/n: exact for
    Gaussian e (n degrees), right to first order for any other, biased errors too. Its quantiles are Wilson and
    Hilferty's, with Student's t for the normal quantile; m₄/m₂² − 1 is freed of its Gaussian bias (n−1)/(n+2).
    The upper end is infinite where n is too small to bound σ.
    """
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
    known = n > 0
    return Estimate(root, np.where(known, lo, np.nan), np.where(known & (m2 > 0), hi, np.where(known, root, np.nan)))


def effective(square: Values, fourth: Values, n: Values) -> Values:
    """How many realisations of n stand behind a σ: n/(κ − 1), κ = m₄/m₂² from Σe² and Σe⁴; half of n for Gaussian e.

    Twice the degrees of freedom of the chi-square variable that `root_mean_square` takes the mean of e² for; infinite
    where all e² are equal within rounding, not-a-number where there is none.
    """
    m2, m4 = _per_one(square, n), _per_one(fourth, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = m4 / np.square(m2) - 1
        return np.where(excess > ALIKE, n / np.abs(excess), np.where(np.isnan(excess), np.nan, np.inf))


def controlled(
    square: Values,
    fourth: Values,
    control_square: Values,
    control_fourth: Values,
    cross: Values,
    exact_square: Values,
    n: Values,
) -> tuple[Estimate, np.ndarray]:
    """rms of e with another error c as control variate, and the factor by which that lowers the variance of the mean.

    From Σe², Σe⁴, Σc², Σc⁴, Σe²c² over n realisations and E c² = exact_square: mean e² − β (mean c² − E c²), β the
    slope of e² on c². The factor is 1/(1 − ρ²), ρ their correlation; the mean is unchanged to order 1/n. (Glasserman,
    Monte Carlo Methods in Financial Engineering, 2003, 4.1.)
    """
    n = np.asarray(n, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = _per_one(square, n), _per_one(control_square, n)
        own, other = _per_one(fourth, n) - a**2, _per_one(control_fourth, n) - b**2
        joint = _per_one(cross, n) - a * b
        left = np.maximum(1 - joint**2 / (own * other), 0)  # 1 − ρ²
        mean = np.maximum(a - joint / other * (b - exact_square), 0)
        relative = own * left / mean**2 * _freed(n) * n / np.maximum(n - 2, 1)
        return _root(mean, relative, n), 1 / left


class Controlled(NamedTuple):
    """What controls leave of a mean square: its rms with the interval, and what tells how far that may be trusted.

    factor: how many times more realisations the plain one would take; apart: by how many standard errors of their
    difference both differ; effective: as of `effective`, n/2 where what is left has the tails of a Gaussian's square.
    """

    estimate: Estimate
    factor: Values
    apart: Values
    effective: Values


GAUSSIAN_SQUARE = 14.0  # κ − 1 of the square of a Gaussian number
APART = 3.0  # standard errors between a value with and without controls, beyond which the plain one counts
TOGETHER = 0.0027  # chance of a number beyond three standard errors


def residual_mean(sums: Values, n: Values) -> tuple[Values, Values]:
    """Mean and variance of what controls leave of squares, from sums (…, 5) over n realisations.

    These are Σ level, Σ ρ, Σ ρ², Σ ρ⁴ and Σ explained², ρ what is left less a level that is known beforehand.
    """
    shift = _per_one(sums[..., 1], n)
    return _per_one(sums[..., 0], n) + shift, np.maximum(_per_one(sums[..., 2], n) - shift**2, 0)


def residual(sums: Values, square: Values, fourth: Values, n: Values) -> Controlled:
    """rms of e from the residuals of e² of controls, and Σe², Σe⁴ of the same realisations; sums as `residual_mean`."""
    n = np.asarray(n, dtype=float)
    mean, variance = residual_mean(sums, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        plain = _per_one(square, n)
        before = _per_one(fourth, n) - np.square(plain)
        taken = np.maximum(_per_one(sums[..., 4], n) - np.square(plain - mean), 0)
        alike = before <= ALIKE * np.square(plain)  # an error without noise: all else is rounding
        apart = np.where(alike | (taken <= 0), 0.0, (plain - mean) * np.sqrt(n / taken))
        tails = _per_one(sums[..., 3], n) / np.square(variance) - 1
        effective = np.where(alike | (tails <= ALIKE), np.inf, n * GAUSSIAN_SQUARE / 2 / tails)
        relative = variance / np.square(mean) / np.maximum(n - 1, 0)
        factor = np.where(alike, np.nan, before / variance)
        return Controlled(_root(np.maximum(mean, 0), relative, n), factor, apart, effective)


def residual_gain(own: Values, base: Values, pairs: Values, n: Values) -> tuple[Estimate, Values]:
    """Paired gain, %, as `gain`, from residuals of both and Σ ρ ρ₀; and the variance of the logarithm of the ratio."""
    n = np.asarray(n, dtype=float)
    (a, of_a), (b, of_b) = residual_mean(own, n), residual_mean(base, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        joint = _per_one(pairs, n) - _per_one(own[..., 1], n) * _per_one(base[..., 1], n)
        variance = np.maximum(of_a / a**2 + of_b / b**2 - 2 * joint / (a * b), 0) / np.maximum(n - 1, 0)
        return _gain(np.maximum(a, 0), b, variance, n - 1), variance


def furthest(looks: Values) -> float:
    """By how many standard errors the furthest of so many differences lies in 0.27 % of right programs at most.

    Of one difference by 3; of several by Bonferroni, however dependent they are.
    """
    return NormalDist().inv_cdf(1 - TOGETHER / 2 / max(int(looks), 1))


ERROR_OF_PROGRAM = 5.85  # standard errors between a measured and an exact value: by chance once in 2·10⁸


def standard_errors(of: Estimate, exact: Values) -> Values:
    """By how many of its standard errors a measured value lies off the exact one, from its 95 % interval; 0 or more.

    Towards the wider side of the interval the variance is taken to grow in proportion to the distance, as it does where
    the interval is Wilson's or that of a rate: what is left is then the score of the exact value. Towards the narrower
    side it stays what it is at the value. A statistic so made strays no further than a Gaussian number: of rates
    however rare, and of σ from 200 realisations on. Infinite where a value without width is off, not-a-number where
    either is not known.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.subtract(exact, of.value)
        up, down = np.subtract(of.hi, of.value), np.subtract(of.value, of.lo)
        grown = np.where(off > 0, up - down, down - up)
        unbounded = np.isinf(np.where(off > 0, of.hi, of.lo))
        variance = up * down + np.maximum(grown, 0) * np.abs(off)
        apart = np.where((off == 0) | unbounded, 0.0, Z95 * np.abs(off) / np.sqrt(variance))
    return np.where(np.isnan(off) | np.isnan(up) | np.isnan(down), np.nan, apart)


def unskewed(apart: Values, n: Values) -> Values:
    """Standard errors between two means of n values, less the most that skewness makes of them.

    A Student's t of skewed values strays further on one side: the few large ones that are not among them are missing in
    the spread too. Hall's transformation (J. R. Statist. Soc. B 54, 1992, 221) makes it a Gaussian's again; the
    skewness is that of a Gaussian's square, the largest of quadratic forms in Gaussian numbers, of either sign.
    """
    skewness = np.sqrt(8 / np.asarray(n, dtype=float))
    return (1 - np.maximum(1 - skewness * np.abs(apart) / 3, 0) ** 3) / skewness


def trusted(apart: Values, effective: Values) -> Values:
    """Where values with and without controls agree within three standard errors and enough realisations count."""
    return (np.abs(apart) <= APART) & (np.asarray(effective) >= FEW_EFFECTIVE)


def narrower(plain: Estimate, controlled: Estimate, trust: Values) -> Estimate:
    """The narrower of two estimates of the same, where the one with controls is trusted; else the plain one."""
    better = trust & (np.subtract(controlled.hi, controlled.lo) < np.subtract(plain.hi, plain.lo))
    return Estimate(*(np.where(better, ours, theirs)[()] for ours, theirs in zip(controlled, plain, strict=True)))


def errors(moments: Values, n: Values) -> ErrorStatistics:
    """Statistics of errors from moments (…, 4) = Σe, Σe², Σe³, Σe⁴ over n (…) realisations.

    The spread divides by n, so that sigma² = bias² + spread²; the standard error of the bias by n − 1. Where |bias|
    is over 10⁷ spreads the difference of squares is rounding; it is cut at zero.
    """
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
    """Mean of numbers q ≥ 0 that are sums of squares (NEES, NIS), from Σq and Σq² over n realisations.

    The interval of `root_mean_square`, squared: near a chi-square variable it covers better than Student's does.
    """
    return Estimate(*(np.square(end) for end in root_mean_square(total, square, n, looks)))


def quantile(looks: Values) -> Values:
    """The normal quantile with which all of so many intervals or bounds hold in 95 % of runs, however dependent.

    Bonferroni: the 5 % are shared among them.
    """
    return np.vectorize(lambda n: NormalDist().inv_cdf(1 - 0.025 / n), otypes=[float])(np.maximum(looks, 1))


def normalised_bounds(freedom: Values, looks: Values = 1) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the mean normalised error squared (NEES, NIS per component) of a filter that is right about itself.

    freedom is realisations × components, of which the sum is chi-square; its quantiles are Wilson and Hilferty's. In
    95 % of runs all of the `looks` at such means lie within.
    """
    with np.errstate(divide="ignore"):
        ninth = 2 / (9 * np.asarray(freedom, dtype=float))
    step = quantile(looks) * np.sqrt(ninth)
    return np.maximum(1 - ninth - step, 0) ** 3, (1 - ninth + step) ** 3


def gain(
    square: Values, fourth: Values, base_square: Values, base_fourth: Values, cross: Values, n: Values
) -> Estimate:
    """Relative gain K = 100 (1 − σ/σ_base) in per cent (P1 eq. 17), paired: both errors are of the same realisations.

    From Σe², Σe⁴ of both and cross = Σ e²·e_base². The interval is that of the logarithm of the ratio of mean
    squares, whose variance holds the covariance of the squares; common noise so makes it narrower. That variance is
    freed of its Gaussian bias, exact for uncorrelated errors.
    """
    n = np.asarray(n, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = _per_one(square, n), _per_one(base_square, n)
        return _gain(a, b, log_variance(square, fourth, base_square, base_fourth, cross, n), n - 1)


def log_variance(
    square: Values, fourth: Values, base_square: Values, base_fourth: Values, cross: Values, n: Values
) -> Values:
    """The variance of the logarithm of the ratio of two mean squares, from the sums that `gain` takes."""
    n = np.asarray(n, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = _per_one(square, n), _per_one(base_square, n)
        variance = _per_one(fourth, n) / a**2 + _per_one(base_fourth, n) / b**2 - 2 * _per_one(cross, n) / (a * b)
        return np.maximum(variance, 0) * _freed(n)


def _freed(n: Values) -> Values:
    """(n + 2) / (n − 1) / n: what makes m₄/m₂² − 1 of a Gaussian sample the variance of its mean square over m₂²."""
    n = np.asarray(n, dtype=float)
    return (n + 2) / np.maximum(n - 1, 0) / n


def _gain(mean_square: Values, base: Values, log_variance: Values, freedom: Values) -> Estimate:
    ratio = np.sqrt(mean_square / base)
    # One realisation tells nothing of its spread: the interval is all there can be.
    step = np.where(np.asarray(freedom) > 0, 0.5 * student(freedom) * np.sqrt(log_variance), np.inf)
    with np.errstate(over="ignore"):  # of two realisations
        factor = np.exp(step)
    return Estimate(100 * (1 - ratio), 100 * (1 - ratio * factor), 100 * (1 - ratio / factor))


def probability(total: Values, square: Values, n: Values) -> Estimate:
    """Mean of values between 0 and 1 with its interval, from Σp and Σp² over n realisations.

    Wilson's score interval at the number of yes-or-no trials of the same variance, n·p(1−p)/var ≥ n: for zeros and
    ones it is Wilson's own, and it keeps a width where all values agree.
    """
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
    trials that would tell as much, p(1 − p) over the variance of the mean. `plain` of the n were drawn from the law
    itself: where nothing happened, they alone say how rare it is.
    """
    n, plain = np.asarray(n, dtype=float), np.asarray(plain, dtype=float)
    p = np.clip(_per_one(total, n), 0, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.maximum(_per_one(square, n) - p**2, 0) / np.maximum(n - 1, 1)
        trials = p * (1 - p) / variance
    return _wilson(p, np.where((p > 0) & (p < 1) & (variance > 0), trials, plain))


def effective_events(total: Values, square: Values) -> Values:
    """How many events of equal weight stand behind a weighted share: (Σw)²/Σw² over the events, 0 of none (Kish)."""
    total, square = np.asarray(total, dtype=float), np.asarray(square, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(square > 0, total**2 / square, 0.0)


def rate(count: Values, n: Values) -> Estimate:
    """Share of n realisations in which something happened, with Wilson's interval."""
    return probability(count, count, n)


def difference(a: Estimate, b: Estimate, correlation: Values = 0.0) -> Estimate:
    """a − b of estimates: the half-widths add in squares, each end with the ends that make it.

    Less twice their product times the correlation of the two, which is 0 of independent ones. Not-a-number where
    infinite ones (a filter that never settles) leave nothing to be said. (Zou, Psychological Methods 12, 2007, 399.)
    """

    def joined(one: Values, other: Values) -> Values:
        shared = np.where(np.equal(correlation, 0), 0.0, correlation * other)  # 0 · ∞ is no number
        return np.hypot(one - shared, np.sqrt(1 - np.square(correlation)) * other)

    with np.errstate(invalid="ignore"):
        value = np.subtract(a.value, b.value)
        down = joined(np.subtract(a.value, a.lo), np.subtract(b.hi, b.value))
        up = joined(np.subtract(a.hi, a.value), np.subtract(b.value, b.lo))
        return Estimate(value, value - down, value + up)
