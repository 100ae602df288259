"""The log posterior of eight bursts at a time.

The true phase is the reference, so an estimate is its deviation from the truth. Each window has blocks, each of a whole
number of the blocks that are drawn. Everything about a block except its sums Z₀ and Z₁ is the same for all bursts and
stands in a table, with times s from its centre in units of their rms: then the phase difference is d + D s, with d = Σ
b_j M_j and D = 2π Σ b_j S_j."""

import math

from radarsim.bursts.kernels.scoring import SIZE, TURN
from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import WIDTH, full, get, nearest, put, where_greater
from radarsim.kernels.polynomials import sine_cosine_polynomial

# Columns of a window's block in the table: M₁ … M₅; S₁ … S₅; real and imaginary parts of Z₂ without noise, W₀, W₁, W₂;
# how many blocks drawn are in it and all before it.
M, S, Z2, W0, W1, W2, END, COLUMNS = 0, 5, 10, 12, 14, 16, 18, 19
# Of a block drawn in a window: one over the rms of s in the window's block, and from centre to centre in that unit.
RATIO, SHIFT, WEIGHTS = 0, 1, 2
# Rows of the work array: estimate and forecast in turns over the burst; estimate in turns over the window; L, coherent
# sum and gradient; 1 where the window is not yet done; passes; squared step; what a search keeps.
X, PRIOR, B, VALUE, COHERENT, SLOPES, LIVE, PASSES, SQUARED = 0, 6, 12, 18, 19, 20, 26, 27, 28
BEST, BEST_POINT, START, BEST_ESTIMATE, ALONG, ROWS = 29, 30, 31, 37, 43, 49


@inline
def fraction(turns):
    """Turns, less the nearest whole number of them."""
    return turns - nearest(turns)


@inline
def sine_cosine(turns):
    """sin and cos of lanes of turns."""
    quarter = 4.0 * turns
    quarters = nearest(quarter)
    s, c = sine_cosine_polynomial((quarter - quarters) * (0.5 * math.pi))
    quadrant = quarters - 4.0 * nearest(0.25 * quarters)  # −2 … 2
    square = quadrant * quadrant
    sign, off_axis = 1.0 - 0.5 * square, square - 1.0
    off_axis, half = off_axis * off_axis, full(0.5)
    return where_greater(off_axis, half, sign * s, quadrant * c), where_greater(
        off_axis, half, sign * c, -1.0 * quadrant * s
    )


@inline
def phase_series(c, s, slope, z, z2):
    """Σ u e^{-j(d + Ds)} and its derivatives by d and D, up to the factor −j: real and imaginary part, slope's part.

    z holds the real and imaginary parts of Z₀ and Z₁, z2 those of Z₂."""
    zr, zi, z1r, z1i = z
    z2r, z2i = z2
    zr, zi = zr + slope * (z1i - 0.5 * slope * z2r), zi - slope * (z1r + 0.5 * slope * z2i)
    return c * zr + s * zi, c * zi - s * zr, (c * z1i - s * z1r) - slope * (c * z2r + s * z2i)


@kernel_part
def score(work, sums, table, first, blocks, image, amplitude):
    """L, the coherent sum and the gradient at B over sums, four rows a block: Z₀ and Z₁. The first is row `first` of
    the table."""
    b0, b1, b2 = get(work, B), get(work, B + 1), get(work, B + 2)
    b3, b4, b5 = get(work, B + 3), get(work, B + 4), get(work, B + 5)
    value = coherent = g0 = g1 = g2 = g3 = g4 = g5 = full(0.0)
    unit, level = full(1.0), 0.5 * amplitude
    for i in range(blocks):
        k, z = (first + i) * COLUMNS, 4 * i
        m1, m2, m3, m4, m5 = table[k], table[k + 1], table[k + 2], table[k + 3], table[k + 4]
        s1, s2, s3, s4, s5 = table[k + S], table[k + S + 1], table[k + S + 2], table[k + S + 3], table[k + S + 4]
        s, c = sine_cosine(b0 + m1 * b1 + m2 * b2 + m3 * b3 + m4 * b4 + m5 * b5)
        D = TURN * (s1 * b1 + s2 * b2 + s3 * b3 + s4 * b4 + s5 * b5)
        D = where_greater(D, unit, unit, where_greater(full(-1.0), D, full(-1.0), D))
        z01 = get(sums, z), get(sums, z + 1), get(sums, z + 2), get(sums, z + 3)
        re, e, h = phase_series(c, s, D, z01, (full(table[k + Z2]), full(table[k + Z2 + 1])))
        value, coherent = value + re, coherent + re
        if image:
            w = k + W0
            twice = full(table[w]), full(table[w + 1]), full(table[w + 2]), full(table[w + 3])
            last = full(table[w + 4]), full(table[w + 5])
            re, e2, h2 = phase_series(c * c - s * s, 2.0 * (s * c), 2.0 * D, twice, last)
            value, coherent = value - 0.5 * level * re, coherent - level * re
            e, h = e - level * e2, h - level * h2
        g0, g1, g2 = g0 + e, g1 + m1 * e + s1 * h, g2 + m2 * e + s2 * h
        g3, g4, g5 = g3 + m3 * e + s3 * h, g4 + m4 * e + s4 * h, g5 + m5 * e + s5 * h
    put(work, VALUE, value)
    put(work, COHERENT, coherent)
    put(work, SLOPES, g0)
    put(work, SLOPES + 1, g1)
    put(work, SLOPES + 2, g2)
    put(work, SLOPES + 3, g3)
    put(work, SLOPES + 4, g4)
    put(work, SLOPES + 5, g5)


@kernel_part
def merge(block_sums, table, weights, first, begin, blocks, sums):
    """Sums of a window's blocks from block_sums; its first row in the table is `first`, its first weight `begin`."""
    b = 0
    for i in range(blocks):
        zr = zi = z1r = z1i = full(0.0)
        for _ in range(int(table[(first + i) * COLUMNS + END]) - b):
            w = WEIGHTS * (begin + b)
            ratio, shift = weights[w + RATIO], weights[w + SHIFT]
            x, y = get(block_sums, 4 * b), get(block_sums, 4 * b + 1)
            zr, zi = zr + x, zi + y
            z1r = z1r + shift * x + ratio * get(block_sums, 4 * b + 2)
            z1i = z1i + shift * y + ratio * get(block_sums, 4 * b + 3)
            b += 1
        put(sums, 4 * i, zr)
        put(sums, 4 * i + 1, zi)
        put(sums, 4 * i + 2, z1r)
        put(sums, 4 * i + 3, z1i)


@inline
def prior_deviation(work, window, j):
    """Component j of forecast − estimate in turns of the window, the phase to the nearest turn."""
    d = get(work, PRIOR + j) - get(work, X + j)
    return fraction(d) if j == 0 else window.powers[j] * d


@kernel_part
def log_posterior(work, window, weight):
    """(5), up to a constant, from what `score` left; weight is A/σ²."""
    penalty = full(0.0)
    for j in range(SIZE):
        d = prior_deviation(work, window, j)
        penalty = penalty + window.precision[j] * (d * d)
    return weight * get(work, VALUE) - 0.5 * penalty


@kernel_part
def step(work, window, weight, coherent, share):
    """One step (6) of the live lanes and its squared length; share is their coherence."""
    for j in range(SIZE):
        gradient = (TURN * weight) * get(work, SLOPES + j)
        put(work, B + j, gradient + window.precision[j] * prior_deviation(work, window, j))
    squared, half, live = full(0.0), full(0.5), get(work, LIVE)
    for i in range(SIZE):
        along = full(0.0)
        for j in range(SIZE):
            along = along + window.root[i, j] * get(work, B + j)
        squared = squared + along * along
        put(work, ALONG + i, along / (1.0 - window.share[i] * (1.0 - share)) if coherent else along)
    for j in range(SIZE):
        move = full(0.0)
        for i in range(SIZE):
            move = move + window.root[i, j] * get(work, ALONG + i)
        x = get(work, X + j)
        put(work, X + j, where_greater(live, half, x + (1.0 / window.powers[j]) * move, x))
    put(work, SQUARED, squared)


@inline
def copy(work, source, target):
    """Six rows."""
    for j in range(SIZE):
        put(work, target + j, get(work, source + j))


@inline
def lane(row, number):
    """Place of one lane of a row."""
    return row * WIDTH + number
