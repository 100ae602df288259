"""Random numbers by counter: word = f(seed, stream, realisation, draw), so realisation i is the same in any block.

Threefry2x64-20 (Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11) and a Box-Muller
transform with polynomials for log, sin and cos, because nothing vectorises the library's. The key is (seed, hash of the
stream's name), the counter (realisation, pair number); one call gives two words, hence a pair of normals or uniforms.
LAYOUT is the version of that layout: results carry it, and a change of it starts new results.
"""

import hashlib
import math

import numpy as np

from radarsim.kernels.compile import inline, kernel

LAYOUT = 1
LANE_BITS = 3
LANES = 1 << LANE_BITS  # realisations side by side in the strips, as many as a register of 512 bits holds
U = np.uint64


def stream(seed: int, name: str) -> np.ndarray:
    """Key (2,) uint64 of the stream `name` under a seed from 0 to 2**64 - 1; the name counts, never its position."""
    return np.array([seed, int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")], dtype=np.uint64)


@inline
def rotated(x, n):
    return (x << U(n)) | (x >> U(64 - n))


@inline
def four_rounds(x0, x1, a, b, c, d):
    x0 += x1
    x1 = rotated(x1, a) ^ x0
    x0 += x1
    x1 = rotated(x1, b) ^ x0
    x0 += x1
    x1 = rotated(x1, c) ^ x0
    x0 += x1
    x1 = rotated(x1, d) ^ x0
    return x0, x1


@inline
def threefry(x0, x1, k0, k1):
    """Threefry2x64 with 20 rounds: counter (x0, x1) and key (k0, k1) to two words, all uint64."""
    k2 = U(0x1BD11BDAA9FC1A22) ^ k0 ^ k1  # Skein's parity constant
    x0, x1 = x0 + k0, x1 + k1
    x0, x1 = four_rounds(x0, x1, 16, 42, 12, 31)
    x0, x1 = x0 + k1, x1 + k2 + U(1)
    x0, x1 = four_rounds(x0, x1, 16, 32, 24, 21)
    x0, x1 = x0 + k2, x1 + k0 + U(2)
    x0, x1 = four_rounds(x0, x1, 16, 42, 12, 31)
    x0, x1 = x0 + k0, x1 + k1 + U(3)
    x0, x1 = four_rounds(x0, x1, 16, 32, 24, 21)
    x0, x1 = x0 + k1, x1 + k2 + U(4)
    x0, x1 = four_rounds(x0, x1, 16, 42, 12, 31)
    return x0 + k2, x1 + k0 + U(5)


@inline
def log_polynomial(x):
    """Natural logarithm of a positive normal number, to 2 units in the last place: atanh series on √½ … √2."""
    b = np.float64(x).view(np.int64)
    e = (b - np.int64(0x3FE6A09E667F3BCD)) >> np.int64(52)
    m = np.int64(b - (e << np.int64(52))).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    q = s * s
    p = q * (2.0 / 17.0) + 2.0 / 15.0
    p = p * q + 2.0 / 13.0
    p = p * q + 2.0 / 11.0
    p = p * q + 2.0 / 9.0
    p = p * q + 2.0 / 7.0
    p = p * q + 2.0 / 5.0
    p = p * q + 2.0 / 3.0
    return np.float64(e) * 0.69314718055994531 + (s * (p * q) + 2.0 * s)


@inline
def sine_cosine_polynomial(x):
    """sin x and cos x for |x| <= pi/4 by their Taylor series, to 1 unit in the last place."""
    q = x * x
    s = q * (1.0 / 6227020800.0) - 1.0 / 39916800.0
    s = s * q + 1.0 / 362880.0
    s = s * q - 1.0 / 5040.0
    s = s * q + 1.0 / 120.0
    s = s * q - 1.0 / 6.0
    c = q * (-1.0 / 87178291200.0) + 1.0 / 479001600.0
    c = c * q - 1.0 / 3628800.0
    c = c * q + 1.0 / 40320.0
    c = c * q - 1.0 / 720.0
    c = c * q + 1.0 / 24.0
    return x * q * s + x, q * q * c + (1.0 - 0.5 * q)


@inline
def uniform(word):
    """A word as a number in (0, 1), never 0 or 1: the centre of one of 2**53 cells."""
    return np.float64(word >> U(11)) * 2.0**-53 + 2.0**-54


@inline
def normal_pair(x, y):
    """Two independent unit normals of two words (Box-Muller): x gives the radius, y the angle."""
    radius = math.sqrt(-2.0 * log_polynomial(uniform(x)))
    # An angle in [-pi/4, pi/4) of 52 bits; the two lowest bits choose the quadrant, by swapping and by the signs.
    turn = U((y >> U(12)) | U(0x3FF0000000000000)).view(np.float64) - 1.5
    s, c = sine_cosine_polynomial(turn * 1.5707963267948966)
    swap = U(0) - (y & U(1))
    sign = (y & U(2)) << U(62)
    si, ci = np.float64(s).view(np.uint64), np.float64(c).view(np.uint64)
    a = (ci & ~swap) | (si & swap)
    b = (si & ~swap) | (ci & swap)
    return radius * U(a ^ sign).view(np.float64), radius * U(b ^ sign).view(np.float64)


@inline
def normals(k0, k1, realisation, pair):
    """The two unit normals of draw pair `pair` of one realisation, under the key (k0, k1)."""
    x, y = threefry(U(realisation), U(pair), k0, k1)
    return normal_pair(x, y)


@inline
def uniforms(k0, k1, realisation, pair):
    """The two uniform numbers in (0, 1) of draw pair `pair` of one realisation, under the key (k0, k1)."""
    x, y = threefry(U(realisation), U(pair), k0, k1)
    return uniform(x), uniform(y)


@kernel
def fill_normal_pairs(key, first, pair, a, b):
    """Unit normals of realisations first, first + 1, … into a (n,) and b (n,): the two numbers of draw pair `pair`."""
    k0, k1, start = key[0], key[1], U(first)
    for i in range(a.size):
        a[i], b[i] = normals(k0, k1, start + U(i), pair)


@kernel
def fill_uniform_pairs(key, first, pair, a, b):
    """Uniform numbers in (0, 1), as `fill_normal_pairs`."""
    k0, k1, start = key[0], key[1], U(first)
    for i in range(a.size):
        a[i], b[i] = uniforms(k0, k1, start + U(i), pair)


@kernel
def fill_normal_strip(key, first, pair, a, b):
    """Unit normals of LANES realisations over several draw pairs, into flat a and b of pairs × LANES numbers.

    Element j * LANES + l belongs to realisation first + l and draw pair `pair` + j. One loop over the whole strip (16
    pairs are enough) vectorises; a loop over eight lanes alone does not.
    """
    k0, k1, start, origin = key[0], key[1], U(first), U(pair)
    for i in range(a.size):
        a[i], b[i] = normals(k0, k1, start + (U(i) & U(LANES - 1)), origin + (U(i) >> U(LANE_BITS)))


@kernel
def fill_uniform_strip(key, first, pair, a, b):
    """Uniform numbers in (0, 1), as `fill_normal_strip`."""
    k0, k1, start, origin = key[0], key[1], U(first), U(pair)
    for i in range(a.size):
        a[i], b[i] = uniforms(k0, k1, start + (U(i) & U(LANES - 1)), origin + (U(i) >> U(LANE_BITS)))
