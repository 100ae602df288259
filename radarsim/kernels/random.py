"""Random numbers by counter: word = f(seed, stream, realisation, number), so realisation i is the same in any block.

Threefry2x64-13 (Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11) and a Box-Muller
transform with polynomials for log, sin and cos, because nothing vectorises the library's. The key is (seed, hash of the
stream's name), the counter (realisation, call). Call c gives the words 2c and 2c + 1, of 64 bits. Pair p of normals is
made of word p alone, pair p of uniform numbers of words 2p and 2p + 1.

LAYOUT is the version of that layout: results carry it, and a change of it starts new results."""

import hashlib
import math

import numpy as np

from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.lanes import address, get, put
from radarsim.kernels.polynomials import log_polynomial, sine_cosine_polynomial

LAYOUT = 2
LANE_BITS = 3
LANES = 1 << LANE_BITS  # realisations side by side in the strips, as many as a register of 512 bits holds
U = np.uint64
GOLDEN = U(0x9E3779B97F4A7C15)  # 2**64 over the golden ratio


def stream(seed: int, name: str) -> np.ndarray:
    """Key (2,) uint64 of the stream `name` under a seed from 0 to 2**64 - 1; the name counts, never its position."""
    return np.array([seed, int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")], dtype=np.uint64)


@inline
def rotate_left(x, n):
    """A 64-bit word rotated to the left by n bits."""
    return (x << n) | (x >> (U(64) - n))


@inline
def four_rounds(x0, x1, a, b, c, d):
    """Four rounds of Threefry2x64 with these rotations (Salmon et al. 2011)."""
    x0 += x1
    x1 = rotate_left(x1, a) ^ x0
    x0 += x1
    x1 = rotate_left(x1, b) ^ x0
    x0 += x1
    x1 = rotate_left(x1, c) ^ x0
    x0 += x1
    x1 = rotate_left(x1, d) ^ x0
    return x0, x1


@inline
def threefry(x0, x1, k0, k1):
    """Threefry2x64 with 13 rounds: counter (x0, x1) and key (k0, k1) to two words, all uint64."""
    k2 = U(0x1BD11BDAA9FC1A22) ^ k0 ^ k1  # Skein's parity constant
    x0, x1 = x0 + k0, x1 + k1
    x0, x1 = four_rounds(x0, x1, U(16), U(42), U(12), U(31))
    x0, x1 = x0 + k1, x1 + k2 + U(1)
    x0, x1 = four_rounds(x0, x1, U(16), U(32), U(24), U(21))
    x0, x1 = x0 + k2, x1 + k0 + U(2)
    x0, x1 = four_rounds(x0, x1, U(16), U(42), U(12), U(31))
    x0, x1 = x0 + k0, x1 + k1 + U(3)
    x0 += x1
    return x0, rotate_left(x1, U(16)) ^ x0


@inline
def uniform(word):
    """A word as a number in (0, 1), never 0 or 1: the centre of one of 2**52 cells (one of 2**53 would round to 1)."""
    return np.float64(word >> U(12)) * 2.0**-52 + 2.0**-53


@inline
def normal_pair(word):
    """Two independent unit normals of a word (Box-Muller).

    The word over 2**64 gives the radius, GOLDEN times it the angle. The 2**64 points of the two are the most even
    lattice of the unit square: what happens with probability p, such as a tail, has some p 2**64 of them. The largest
    radius is 9.5. A rounding up to 1 is the radius 0."""
    radius = math.sqrt(-2.0 * log_polynomial(np.float64(word) * 2.0**-64 + 2.0**-65))
    # y as a signed number is the angle from -pi/4 to pi/4; its two lowest bits choose the quadrant.
    y = word * GOLDEN
    s, c = sine_cosine_polynomial(np.float64(U(y).view(np.int64)) * (math.pi / 2.0 * 2.0**-64))
    turned = (y & U(1)) != U(0)
    radius = U(np.float64(radius).view(np.uint64) ^ ((y & U(2)) << U(62))).view(np.float64)
    return radius * (s if turned else c), radius * (c if turned else s)


@inline
def normals(k0, k1, realisation, pair):
    """The two unit normals of pair `pair` of one realisation, under the key (k0, k1)."""
    x, y = threefry(U(realisation), U(pair) >> U(1), k0, k1)
    return normal_pair(y if U(pair) & U(1) else x)


@inline
def uniforms(k0, k1, realisation, pair):
    """The two uniform numbers in (0, 1) of pair `pair` of one realisation, under the key (k0, k1)."""
    x, y = threefry(U(realisation), U(pair), k0, k1)
    return uniform(x), uniform(y)


@kernel
def fill_words(key, first, call, x, y):
    """The two words of call `call` of realisations first, first + 1, … into x (n,) and y (n,) uint64."""
    k0, k1, start = key[0], key[1], U(first)
    for i in range(x.size):
        x[i], y[i] = threefry(start + U(i), U(call), k0, k1)


@kernel
def fill_normal_pairs(key, first, pair, a, b):
    """Unit normals of realisations first, first + 1, … into a (n,) and b (n,): the two numbers of pair `pair`."""
    # Two loops: in one, the chain from counter to normal is longer than the processor looks ahead (a tenth slower).
    x, y = a.view(np.uint64), b.view(np.uint64)
    fill_words(key, first, U(pair) >> U(1), x, y)
    if U(pair) & U(1):
        for i in range(x.size):
            x[i] = y[i]
    for i in range(a.size):
        a[i], b[i] = normal_pair(x[i])


@kernel
def fill_uniform_pairs(key, first, pair, a, b):
    """Uniform numbers in (0, 1), as `fill_normal_pairs`."""
    x, y = a.view(np.uint64), b.view(np.uint64)
    fill_words(key, first, pair, x, y)
    for i in range(a.size):
        a[i], b[i] = uniform(x[i]), uniform(y[i])


@kernel
def fill_normal_rows(key, realisations, calls, rows):
    """Unit normals into rows (R, m), four of each call from calls[r] on of realisation realisations[r]; both uint64."""
    k0, k1, m = key[0], key[1], rows.shape[1]
    for r in range(rows.shape[0]):
        for call in range((m + 3) >> 2):
            x, y = threefry(realisations[r], calls[r] + U(call), k0, k1)
            j = call << 2
            a, b = normal_pair(x)
            c, d = normal_pair(y)
            rows[r, j] = a
            if j + 1 < m:
                rows[r, j + 1] = b
            if j + 2 < m:
                rows[r, j + 2] = c
            if j + 3 < m:
                rows[r, j + 3] = d


@kernel
def fill_uniform_rows(key, realisations, calls, rows):
    """Uniform numbers in (0, 1) into rows (R, m), two for each call, as `fill_normal_rows`."""
    k0, k1, m = key[0], key[1], rows.shape[1]
    for r in range(rows.shape[0]):
        for call in range((m + 1) >> 1):
            x, y = threefry(realisations[r], calls[r] + U(call), k0, k1)
            rows[r, call << 1] = uniform(x)
            if (call << 1) + 1 < m:
                rows[r, (call << 1) + 1] = uniform(y)


@kernel
def words_to_normals(a, b):
    """Unit normals in place, flat a and b of pairs × LANES numbers: the words of call c stand in row c of either."""
    x, first_words, second_words = a.view(np.uint64), address(a), address(b)
    pairs = a.size >> LANE_BITS
    for call in range((pairs - 1) >> 1, -1, -1):
        even = get(first_words, call)
        if 2 * call + 1 < pairs:
            put(first_words, 2 * call + 1, get(second_words, call))
        put(first_words, 2 * call, even)
    for i in range(a.size):
        a[i], b[i] = normal_pair(x[i])


@kernel
def fill_normal_strip(key, first, pair, a, b):
    """Unit normals of LANES realisations over several pairs, into flat a and b of pairs × LANES numbers; even `pair`.
    Element j * LANES + l belongs to realisation first + l and pair `pair` + j. Loops over the whole strip (16 pairs are
    enough) vectorise; a loop over eight lanes alone does not."""
    k0, k1, start, call = key[0], key[1], U(first), U(pair) >> U(1)
    x, y = a.view(np.uint64), b.view(np.uint64)
    for i in range((a.size + LANES) >> (LANE_BITS + 1) << LANE_BITS):
        x[i], y[i] = threefry(start + (U(i) & U(LANES - 1)), call + (U(i) >> U(LANE_BITS)), k0, k1)
    words_to_normals(a, b)


@kernel
def fill_uniform_strip(key, first, pair, a, b):
    """Uniform numbers in (0, 1) of LANES realisations over several pairs, laid out as `fill_normal_strip` does."""
    k0, k1, start, call = key[0], key[1], U(first), U(pair)
    x, y = a.view(np.uint64), b.view(np.uint64)
    for i in range(a.size):
        x[i], y[i] = threefry(start + (U(i) & U(LANES - 1)), call + (U(i) >> U(LANE_BITS)), k0, k1)
    for i in range(a.size):
        a[i], b[i] = uniform(x[i]), uniform(y[i])
