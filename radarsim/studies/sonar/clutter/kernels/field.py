"""False plots of a whole sector, of which a gate draws only those that it needs.

The sector is divided into cells of equal area, uniform in q = r²/2 and in the bearing. Poisson processes on disjoint
cells are independent, so the number of plots in a cell (by inversion of the distribution function) and their positions
are functions of key, realisation, scan and cell: all filters see the same field, and a gate costs only the cells that
it touches. The letters are those of `gate`, and

    q           r² / 2, m²: uniform where plots are uniform in area
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import U, threefry, uniform, uniforms
from radarsim.studies.sonar.clutter.kernels.gate import inverse_two, with_plot

DRAW_BITS = 12  # of the number of a draw: the draw in its cell
HALF = U(0xFFFFFFFF)
TURN = 2.0 * math.pi


class Cells(NamedTuple):
    """Cells from q0 and b0 (m², rad), nq by nb of them, each dq by db; ring: they close to a full circle.

    density of false plots per m².
    """

    q0: float
    dq: float
    nq: int
    b0: float
    db: float
    nb: int
    ring: bool
    density: float


class Field(NamedTuple):
    """False plots: key (2,) of the noise; share (J,) the distribution function of the number in a cell, up to 1."""

    key: np.ndarray
    share: np.ndarray
    cells: Cells


class Draws(NamedTuple):
    """A field without its arrays, references to which would be counted at each call.

    The two words of the key, the address of the distribution function, and the cells.
    """

    k0: int
    k1: int
    share: int
    cells: Cells


@inline
def draws_of(field):
    """The draws of a field, which must outlive them."""
    return Draws(field.key[0], field.key[1], address(field.share), field.cells)


@inline
def number_in(share, u):
    """Number of plots in a cell: the first index at which the distribution function exceeds the uniform number u.

    share is the address of the distribution function, whose last value is 1.
    """
    n = 0
    while u >= share[n]:
        n += 1
    return n


@inline
def cell_words(k0, k1, realisation, cell, draw):
    """Two random words of a cell; cells are numbered through all scans.

    The first word of draw 0 gives the number of plots, and each further word the position of one of them.
    """
    return threefry(U(realisation), (U(cell) << U(DRAW_BITS)) + U(draw), k0, k1)


@inline
def place_in(word):
    """Position in a cell, each coordinate from 0 to 1: the two halves of a word."""
    return np.float64(word >> U(32)) * 2.0**-32 + 2.0**-33, np.float64(word & HALF) * 2.0**-32 + 2.0**-33


@inline
def touched(low, high, least, step, count):
    """First and last cell that the interval low … high touches, of `count` cells of size step from `least` on.

    Floors stay floating-point numbers, because an open gate reaches further than an integer can.
    """
    first = min(max(np.floor((low - least) / step), 0.0), count - 1.0)
    last = min(max(np.floor((high - least) / step), -1.0), count - 1.0)
    return int(first), int(last)


# ---- false plots in a gate and in the whole sector ----------------------------------------------------------------
@inline
def with_false_plots(gated, draws, realisation, scan, gate, threshold):
    """The plots in a gate with all false ones of a scan in addition."""
    irr, irb, ibb, _ = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    r, b = gate.r, gate.b
    q0, dq, nq, b0, db, nb, ring, _ = draws.cells
    wide, high = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    near, far = max(r - wide, 0.0), r + wide
    least, most = 0.5 * near * near, 0.5 * far * far
    i_first, i_last = touched(least, most, q0, dq, nq)
    if ring:
        high = min(high, 0.5 * nb * db)
        j_first, j_last = math.floor((b - high - b0) / db), math.floor((b + high - b0) / db)
        j_last = min(j_last, j_first + nb)  # the same column at both ends of a full turn: half a turn to each side
    else:
        b -= TURN * np.floor(
            (b - b0) / TURN - 0.5 * nb * db / TURN + 0.5
        )  # less whole turns from the middle of the sector
        j_first, j_last = touched(b - high, b + high, b0, db, nb)
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            column = j if 0 <= j < nb else j % nb
            cell = (scan * nq + i) * nb + column
            u, spare = cell_words(draws.k0, draws.k1, realisation, cell, 0)
            for n in range(number_in(draws.share, uniform(u))):
                word = spare
                if n % 2 == 1:
                    word, spare = cell_words(draws.k0, draws.k1, realisation, cell, (n + 1) // 2)
                u_q, u_b = place_in(word)
                q, off = q0 + dq * (i + u_q), b0 + db * (j + u_b) - b
                if least <= q <= most and abs(off) <= high:  # roots are slow
                    gated = with_plot(gated, math.sqrt(2.0 * q) - r, off, 1.0, (irr, irb, ibb), threshold)
    return gated


@part
def even_places(key, field, first, n, z):
    """Write positions drawn uniformly over the sector, one a realisation from `first` on, to z (2, ≥ n)."""
    q0, dq, nq, b0, db, nb, _, _ = field.cells
    for i in range(n):
        u, v = uniforms(key[0], key[1], first + i, 0)
        z[0, i] = np.sqrt(2.0 * (q0 + dq * nq * u))
        z[1, i] = b0 + db * nb * v


@kernel
def whole_field(field, realisation, scan, r, b):
    """Write all false plots of a scan to r and b (n,); returns how many there are, even if more than fit."""
    total, k0, k1, share = 0, field.key[0], field.key[1], address(field.share)
    q0, dq, nq, b0, db, nb, _, _ = field.cells
    for cell in range(nq * nb):
        i, j, number = cell // nb, cell % nb, scan * (nq * nb) + cell
        u, spare = cell_words(k0, k1, realisation, number, 0)
        for n in range(number_in(share, uniform(u))):
            word = spare
            if n % 2 == 1:
                word, spare = cell_words(k0, k1, realisation, number, (n + 1) // 2)
            u_q, u_b = place_in(word)
            if total < r.size:
                r[total] = math.sqrt(2.0 * (q0 + dq * (i + u_q)))
                b[total] = b0 + db * (j + u_b)
            total += 1
    return total
