"""Every kind of interval that is printed covers its truth as often as it says, at the sizes that no note stands at."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from radarsim.report import statistics
from tests.tolerances import mean_error, rounding

REPETITIONS, MANY = 2000, 8000  # many: so that the bounds are five standard errors away
GAUSSIAN, HEAVY = (0.936, 0.964), (0.925, 1.0)
FEW_HEAVY = 1000  # realisations from which heavy tails cover so: σ 92.6 % at 500, 90.7 at 100


def gaussian(rng, *shape):
    return rng.normal(size=shape)


def student5(rng, *shape):
    """Student's t with five degrees of freedom, brought to variance 1: the fourth power has a mean and no variance."""
    return rng.standard_t(5, size=shape) / math.sqrt(5 / 3)


def moments(e):
    """Sums of e … e⁴ over the last axis."""
    return np.stack([(e**p).sum(axis=-1) for p in (1, 2, 3, 4)], axis=-1)


def sigma(draw, rng, repetitions, n):
    return statistics.errors(moments(draw(rng, repetitions, n)), n).sigma, 1.0


def bias(draw, rng, repetitions, n):
    of = statistics.errors(moments(2 + draw(rng, repetitions, n)), n)
    half = statistics.Z95 * of.bias_se
    return statistics.Estimate(of.bias, of.bias - half, of.bias + half), 2.0


def pair(draw, rng, repetitions, n):
    """Errors of a baseline and of a filter with 0.7 of its σ, correlated to 0.8."""
    base, other = draw(rng, repetitions, n), draw(rng, repetitions, n)
    return base, 0.7 * (0.8 * base + 0.6 * other)


def paired_gain(draw, rng, repetitions, n):
    base, own = pair(draw, rng, repetitions, n)
    a, b = moments(own), moments(base)
    cross = (own**2 * base**2).sum(axis=-1)
    return statistics.gain(a[:, 1], a[:, 3], b[:, 1], b[:, 3], cross, n), 30.0


def difference(draw, rng, repetitions, n):
    one, other = (scale * draw(rng, repetitions, n) for scale in (1.0, 0.5))
    return statistics.difference(*(statistics.errors(moments(e), n).sigma for e in (one, other))), 0.5


def normalised(draw, rng, repetitions, n):
    """NEES or NIS of three components."""
    q = np.square(draw(rng, repetitions, n, 3)).mean(axis=-1)
    return statistics.mean_square(q.sum(axis=-1), np.square(q).sum(axis=-1), n), 1.0


def product(draw, rng, repetitions, n):
    """The mean of a product of two errors, as of value and rate."""
    base, own = pair(draw, rng, repetitions, n)
    p = base * own
    return statistics.mean(p.sum(axis=-1), np.square(p).sum(axis=-1), n), 0.56


KINDS = (sigma, bias, paired_gain, difference, normalised, product)


def coverage(kind, draw, n, repetitions=REPETITIONS):
    """Share of intervals that hold the truth, a few hundred repetitions at a time."""
    rng, inside, step = np.random.default_rng([n, KINDS.index(kind)]), 0, max(1, 2_000_000 // n)
    for done in range(0, repetitions, step):
        of, truth = kind(draw, rng, min(step, repetitions - done), n)
        inside += np.sum((of.lo <= truth) & (truth <= of.hi))
    return inside / repetitions


def slack(repetitions):
    """Four standard errors of a coverage of 95 %."""
    return 4 * math.sqrt(0.95 * 0.05 / repetitions)


@pytest.mark.parametrize("kind", KINDS)
def test_coverage_at_the_least_sizes_without_a_note(kind):
    low, high = GAUSSIAN
    assert (
        low - slack(500) / 2
        <= coverage(kind, gaussian, statistics.MIN_TRUSTED_REALISATIONS, 500)
        <= high + slack(500) / 2
    )
    assert coverage(kind, student5, FEW_HEAVY, 500) >= HEAVY[0] - slack(500) / 2


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 5, 25])
@pytest.mark.parametrize("kind", KINDS)
def test_gaussian_coverage_over_two_thousand_repetitions(kind, n):
    low, high = GAUSSIAN
    assert low <= coverage(kind, gaussian, n * statistics.MIN_TRUSTED_REALISATIONS, MANY) <= high


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 3, 10])
@pytest.mark.parametrize("kind", KINDS)
def test_heavy_tailed_coverage_over_two_thousand_repetitions(kind, n):
    """A product of two errors needs twice as many; the one table of them, smoothing_gains, is of Gaussian errors."""
    low, high = HEAVY
    n *= FEW_HEAVY * (2 if kind is product else 1)
    assert low <= coverage(kind, student5, n, MANY) <= high


@pytest.mark.parametrize("n", [100, 1000, 100_000])
def test_rates_cover_exactly(n):
    """No simulation: Wilson's coverage is a sum of binomial chances, at every rate whose expected count is no few."""
    count = np.arange(n + 1)
    of = statistics.rate(count, n)
    for p in np.linspace(statistics.MIN_EVENTS / n, min(0.5, 200 / n), 300):
        near = slice(max(0, int(n * p) - 400), int(n * p) + 400)
        chance = binom.pmf(count[near], n, p)
        covered = chance[(of.lo[near] <= p) & (p <= of.hi[near])].sum()
        assert GAUSSIAN[0] - 5e-4 <= covered <= GAUSSIAN[1]


def test_rates_of_few_events_cover_too():
    """So they bear no mark, which would depend on the events that came: the samples it leaves are then a choice."""
    n = 1000
    count = np.arange(n + 1)
    of = statistics.rate(count, n)
    p = np.geomspace(0.01, statistics.MIN_EVENTS, 400) / n
    share = np.array([binom.pmf(count, n, one)[(of.lo <= one) & (one <= of.hi)].sum() for one in p])
    assert share.min() > 0.83  # Wilson's dip, where the one event that came is five times too many (Brown et al. 2001)
    assert share[p * n > 0.3].min() > 0.89
    assert share[p * n > 1].min() > 0.917
    assert share.mean() > 0.94


@pytest.mark.parametrize("shape", [(2, 5), (0.2, 0.2), (0.5, 5)])
def test_mean_probabilities_are_covered(shape):
    n, rng = 400, np.random.default_rng(6)
    p = rng.beta(*shape, size=(REPETITIONS, n))
    of = statistics.probability(p.sum(axis=-1), np.square(p).sum(axis=-1), n)
    truth = shape[0] / sum(shape)
    assert n * truth > statistics.MIN_EVENTS
    assert GAUSSIAN[0] <= np.mean((of.lo <= truth) & (truth <= of.hi)) <= GAUSSIAN[1]


def test_pairing_narrows_a_gain():
    """Errors correlated to ρ: the variance of the logarithm falls by 1 - ρ², the interval by its root, 0.6."""
    n, rng = 1000, np.random.default_rng(8)
    base, own = pair(gaussian, rng, 500, n)
    a, b, cross = moments(own), moments(base), (own**2 * base**2).sum(axis=-1)
    paired = statistics.gain(a[:, 1], a[:, 3], b[:, 1], b[:, 3], cross, n)
    independent = statistics.gain(a[:, 1], a[:, 3], b[:, 1], b[:, 3], a[:, 1] * b[:, 1] / n, n)
    ratios = (paired.hi - paired.lo) / (independent.hi - independent.lo)
    # The spread of a median is √(π/2) that of a mean; what a ratio of estimates is biased by is a few 1/n.
    allowed = mean_error(len(ratios), math.sqrt(math.pi / 2) * ratios.std()) + 3 / n
    assert np.median(ratios) == pytest.approx(0.6, abs=allowed)


@pytest.mark.parametrize("looks", [1, 15, 400])
def test_bounds_for_many_looks(looks):
    """Of runs of a filter that is right, 95 % and no fewer have all their looks within; 300 realisations of 2 each."""
    freedom, rng = 600, np.random.default_rng(looks)
    low, high = statistics.normalised_bounds(freedom, looks)
    means = rng.chisquare(freedom, size=(REPETITIONS, looks)) / freedom
    kept = np.mean(((low <= means) & (means <= high)).all(axis=1))
    assert abs(kept - (1 - 0.05 / looks) ** looks) < slack(REPETITIONS)


def test_bounds_of_dependent_looks_keep_more():
    freedom, looks, rng = 600, 50, np.random.default_rng(1)
    low, high = statistics.normalised_bounds(freedom, looks)
    shared = rng.chisquare(freedom // 2, size=(REPETITIONS, 1))
    means = (shared + rng.chisquare(freedom // 2, size=(REPETITIONS, looks))) / freedom
    assert np.mean(((low <= means) & (means <= high)).all(axis=1)) > 0.95 - slack(REPETITIONS)


def test_antithetic_pairs_double_the_variance():
    """Why they are not offered: a linear filter errs on mirrored noise by the same, mirrored: one square for two."""
    from radarsim.api.configs import load
    from radarsim.kernels import second_order
    from radarsim.studies.range_doppler import study

    problem = study.prepare(load("rls2", ["scans=8"]).cases[0]).problem
    truth, plots = problem.truth, second_order.simulate_plots(problem, 0, 20_000)
    error, mirrored = (
        second_order.estimate(problem, p)[:, :, -1] - truth[-1] for p in (plots, 2 * truth[:, :2] - plots)
    )
    # Estimates, of ranges of 100 km, are rounded by ten operations a scan; a square's difference is twice the error's.
    off = rounding(operations=80) * np.abs(truth[:, 0]).max() / problem.dt.max() ** np.arange(3)
    assert (np.abs(error**2 - mirrored**2) <= 4 * np.abs(error).max(axis=0) * off).all()
    plain = np.square(error).reshape(200, 100, 2, 3).mean(axis=1).var(axis=0)
    paired = ((error**2 + mirrored**2) / 2).reshape(400, 50, 2, 3).mean(axis=1).var(axis=0)
    # Variances of 200 and 400 means: relative standard errors √(2/n); six of them.
    np.testing.assert_allclose(paired / plain, 2, rtol=5 * math.sqrt(2 / 200 + 2 / 400))
