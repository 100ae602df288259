"""The counter-based generator: published vectors, accuracy of its polynomials, distribution, independence."""

import math

import numba
import numpy as np
import pytest
from scipy import special, stats

from radarsim.kernels import polynomials
from radarsim.kernels import random as kernels
from tests.tolerances import assert_rounded, rounding, units_off

N = 10_000_000
LAYOUT_2 = {
    42: (-1.1881634461442772, -0.5143878226319597, 0.3725056740434027, -0.14009725787622906),
    43: (-2.0406750735794215, -1.1070909479378646, -0.6049887636527357, -0.9762521042342899),
}
Z = 5.0  # standard errors allowed to each of some hundred statistics: one false alarm in two million, of fixed seeds


def entry(function):
    """A function that only kernels call, to be called from Python."""
    return numba.njit(lambda *numbers: function(*numbers))


threefry, uniform, normal_pair = entry(kernels.threefry), entry(kernels.uniform), entry(kernels.normal_pair)
log_polynomial, sine_cosine_polynomial = entry(polynomials.log_polynomial), entry(polynomials.sine_cosine_polynomial)


def normals(seed=1, name="test", first=0, pair=0, count=N // 2):
    a, b = np.empty(count), np.empty(count)
    kernels.fill_normal_pairs(kernels.stream(seed, name), first, pair, a, b)
    return a, b


@pytest.fixture(scope="module")
def sample():
    return np.concatenate(normals())


@pytest.mark.parametrize(
    ("counter", "key", "words"),
    [
        ((0, 0), (0, 0), (0xF167B032C3B480BD, 0xE91F9FEE4B7A6FB5)),
        ((2**64 - 1,) * 2, (2**64 - 1,) * 2, (0xCCDEC5C917A874B1, 0x4DF53ABCA26CEB01)),
        (
            (0x243F6A8885A308D3, 0x13198A2E03707344),
            (0xA4093822299F31D0, 0x082EFA98EC4E6C89),
            (0xC3AAC71561042993, 0x3FE7AE8801AFF316),
        ),
    ],
    ids=["zeros", "ones", "pi"],
)
def test_published_vectors(counter, key, words):
    """Threefry2x64 with 13 rounds in the file kat_vectors of Random123."""
    assert threefry(*np.array([*counter, *key], dtype=np.uint64)) == words


def test_words_are_counted_by_realisation_and_call():
    key = kernels.stream(5, "plots")
    x, y = np.empty(3, dtype=np.uint64), np.empty(3, dtype=np.uint64)
    kernels.fill_words(key, 2**40, 7, x, y)
    for i in range(3):
        assert threefry(np.uint64(2**40 + i), np.uint64(7), key[0], key[1]) == (x[i], y[i])


def test_a_word_makes_a_pair_of_normals():
    """Pair p of normals has word p, which is the first of call p / 2, or the second."""
    key, x, y, a, b = kernels.stream(5, "plots"), *np.empty((2, 3), dtype=np.uint64), *np.empty((2, 3))
    for pair in range(4):
        kernels.fill_words(key, 9, pair // 2, x, y)
        kernels.fill_normal_pairs(key, 9, pair, a, b)
        assert [normal_pair(word) for word in (x, y)[pair % 2]] == list(zip(a, b, strict=True))


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision to compare with")
def test_polynomials_against_the_library():
    rng = np.random.default_rng(1)
    for x in (rng.random(20_000), 1 - 1e-6 * rng.random(5000), 2.0 ** (-65 * rng.random(20_000))):
        assert units_off([log_polynomial(v) for v in x], np.log(x.astype(np.longdouble))) < 3
    x = (rng.random(40_000) - 0.5) * np.pi / 2
    sine, cosine = np.array([sine_cosine_polynomial(v) for v in x]).T
    # Each of the last operations rounds by half a unit: three of them with fused multiply-adds, four without.
    assert units_off(sine, np.sin(x.astype(np.longdouble))) < 2
    assert units_off(cosine, np.cos(x.astype(np.longdouble))) < 2


def test_normals_are_box_and_muller_of_the_words():
    """Radius and angle of each pair, by the library, from the words themselves."""
    x = np.random.default_rng(2).integers(0, 2**64, 2000, dtype=np.uint64)
    pairs = np.array([normal_pair(u) for u in x])
    level = -np.log(x.astype(float) * 2.0**-64)
    assert_rounded(np.hypot(*pairs.T), np.sqrt(2 * level), condition=1 + 1 / level, operations=4)  # of x and the log
    y = x * np.uint64(0x9E3779B97F4A7C15)
    turn, quadrant = y.view(np.int64).astype(float) * 2.0**-64, y & np.uint64(3)
    expected = np.pi / 2 * turn
    expected = np.where(quadrant & np.uint64(1), np.pi / 2 - expected, expected)
    expected = np.where(quadrant & np.uint64(2), expected + np.pi, expected)
    off = np.arctan2(pairs[:, 1], pairs[:, 0]) - expected
    # Angles of up to 2π, and π once more for the remainder, by a few operations on each side.
    assert np.abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi).max() <= rounding(3 * np.pi, 4)


@pytest.mark.parametrize("y", [0, 1, 2, 3, 2**63 - 1, 2**63, 2**64 - 4, 2**64 - 1])
def test_extreme_words_give_finite_normals(y):
    """Words at the ends of the radius, and those whose angle is at an end."""
    for x in (0, 1, 2**63, 2**64 - 1, y * pow(int(kernels.GOLDEN), -1, 2**64) % 2**64):
        pair = normal_pair(np.uint64(x))
        assert np.isfinite(pair).all()
        assert np.hypot(*pair) <= math.sqrt(2 * 65 * math.log(2)) * (1 + rounding(operations=4))
        assert 0.0 < uniform(np.uint64(x)) < 1.0


def test_moments(sample):
    power = np.ones(N)
    for mean, variance in ((0, 1), (1, 2), (0, 15), (3, 96), (0, 945), (15, 10170)):
        power *= sample
        assert power.mean() == pytest.approx(mean, abs=Z * math.sqrt(variance / N))


def test_distribution(sample):
    """Kolmogorov and Smirnov's distance, and chi² over 1000 equally probable cells."""
    u = np.sort(special.ndtr(sample))
    steps = np.arange(N + 1) / N
    distance = max((steps[1:] - u).max(), (u - steps[:-1]).max())
    assert stats.kstwobign.sf(distance * math.sqrt(N)) > 1e-6
    counts = np.diff(np.searchsorted(u, np.linspace(0, 1, 1001)))
    assert 1e-6 < stats.chi2.sf(((counts - N / 1000) ** 2).sum() / (N / 1000), 999) < 1 - 1e-6


@pytest.mark.parametrize("sigmas", [3.0, 4.0, 5.0])
def test_tails(sample, sigmas):
    for count in (np.count_nonzero(sample > sigmas), np.count_nonzero(sample < -sigmas)):
        expected = N * special.ndtr(-sigmas)
        assert stats.poisson.sf(count - 1, expected) > 1e-6
        assert stats.poisson.cdf(count, expected) > 1e-6


@numba.njit
def beyond(sigmas, cells, words):
    """How many of both normals lie beyond, of so many words spread over each of the first cells of 2**24 words."""
    found, step = np.zeros(2), 2**24 // words
    for cell in range(cells):
        for j in range(words):
            within = ((cell * 0x9E3779B1 + j * 0x85EBCA6B) >> 13) % step
            a, b = kernels.normal_pair(np.uint64(cell) << np.uint64(24) | np.uint64(j * step + within))
            found[0] += a > sigmas
            found[1] += b > sigmas
    return found


@pytest.mark.slow_cases("6.0-2048")
@pytest.mark.parametrize(("sigmas", "words"), [(6.0, 2**11), (7.0, 2**18), (8.0, 2**22)])
def test_tails_of_all_words_are_those_of_a_normal(sigmas, words):
    """Of the 2**64 words those whose radius reaches so far; what is sampled of them errs by 1 / sqrt(found)."""
    found = beyond(sigmas, int(2**40 * math.exp(-(sigmas**2) / 2)) + 2, words)
    expected = special.ndtr(-sigmas) * 2**40 * words
    assert found == pytest.approx(expected, abs=Z * math.sqrt(expected))


def assert_independent(a, b):
    """Correlations of the numbers, of their squares and of their signs: all within Z / sqrt(n)."""
    for f in (lambda x: x, lambda x: (x * x - 1) / math.sqrt(2), np.sign):
        assert (f(a) * f(b)).mean() == pytest.approx(0, abs=Z / math.sqrt(a.size))


def test_independence_within_a_pair(sample):
    a, b = sample[: N // 2], sample[N // 2 :]
    assert_independent(a, b)
    angle = np.floor((np.arctan2(b, a) / (2 * np.pi) + 0.5) * 256).astype(int) % 256
    counts = np.bincount(angle, minlength=256)
    assert 1e-6 < stats.chi2.sf(((counts - a.size / 256) ** 2).sum() / (a.size / 256), 255) < 1 - 1e-6


def test_independence_between_realisations(sample):
    a = sample[: N // 2]
    for lag in (1, 2, 3, 8, 512, 4096):
        assert_independent(a[:-lag], a[lag:])


@pytest.mark.parametrize(
    "other",
    [{"pair": 1}, {"pair": 2**32}, {"seed": 2}, {"seed": 2**64 - 1}, {"name": "tesu"}, {"first": 2**33}],
    ids=["next pair", "far pair", "next seed", "last seed", "name", "far realisations"],
)
def test_independence_between_draws(sample, other):
    count = 1_000_000
    for fresh in normals(count=count, **other):
        assert_independent(sample[:count], fresh)
        assert_independent(sample[N // 2 : N // 2 + count], fresh)


def test_uniforms():
    a, b = np.empty(1_000_000), np.empty(1_000_000)
    kernels.fill_uniform_pairs(kernels.stream(1, "test"), 0, 0, a, b)
    for u in (a, b):
        assert 0 < u.min() < u.max() < 1
        assert u.mean() == pytest.approx(0.5, abs=Z / math.sqrt(12 * u.size))
        counts = np.bincount((u * 1000).astype(int), minlength=1000)
        assert 1e-6 < stats.chi2.sf(((counts - 1000) ** 2 / 1000).sum(), 999) < 1 - 1e-6
    assert ((a - 0.5) * (b - 0.5)).mean() == pytest.approx(0, abs=Z / 12 / math.sqrt(a.size))


def test_a_realisation_is_itself_in_any_block():
    """Whatever the first of the block, its length and the place in it, so also vector or remainder loop."""
    whole = np.stack(normals(count=1000, first=10**12, pair=3))
    for first, count in ((0, 1), (1, 7), (8, 8), (3, 64), (500, 333), (999, 1)):
        part = np.stack(normals(count=count, first=10**12 + first, pair=3))
        np.testing.assert_array_equal(part, whole[:, first : first + count])


@pytest.mark.parametrize("pairs", [16, 15, 5])
def test_strips_hold_the_same_numbers(pairs):
    key = kernels.stream(9, "strip")
    a, b = np.empty((pairs, kernels.LANES)), np.empty((pairs, kernels.LANES))
    kernels.fill_normal_strip(key, 800, 30, a.reshape(-1), b.reshape(-1))
    c, d = np.empty(kernels.LANES), np.empty(kernels.LANES)
    for j in range(pairs):
        kernels.fill_normal_pairs(key, 800, 30 + j, c, d)
        np.testing.assert_array_equal((a[j], b[j]), (c, d))
    for j in (2, 3):
        one = entry(kernels.normals)(key[0], key[1], 805, 30 + j)
        assert one == (a[j, 5], b[j, 5])


def test_streams_by_name():
    """The key is the seed and the first eight bytes of the name's SHA-256: part of the layout, so written out here."""
    assert kernels.LAYOUT == 2
    np.testing.assert_array_equal(
        kernels.stream(7, "plots"), np.array([7, 0xDC5C1E13E6556996], dtype=np.uint64), strict=True
    )
    assert len({tuple(kernels.stream(s, n)) for s in (0, 1, 2**64 - 1) for n in ("", "a", "b", "ab")}) == 12


@pytest.mark.parametrize("pair", [42, 43])
def test_the_layout_is_unchanged(pair):
    """The very numbers of two counters: whoever changes them changes LAYOUT, so that stored results are not mixed."""
    a, b = normals(seed=1, name="layout", first=123456789, pair=pair, count=2)
    # The root of a logarithm to 3 units, times a sine or cosine to 2; none of the angles is near a zero.
    assert_rounded((*a, *b), LAYOUT_2[pair], operations=5)
