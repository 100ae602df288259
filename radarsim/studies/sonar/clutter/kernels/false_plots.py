"""False plots of a sector: the random field, the plots in a gate, and all plots of a scan.

A gate draws only the plots that it needs.

The sector is divided into cells of equal area, uniform in q = r²/2 and in the bearing. Poisson processes on disjoint
cells are independent, so the number of plots in a cell (by inversion of the distribution function) and their positions
are functions of key, realisation, scan and cell: all filters see the same field, and a gate costs only the cells that
it touches. The letters are those of `gate`, and

    q           r² / 2, m²: uniform where plots are uniform in area"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import U, threefry, uniform, uniforms
from radarsim.studies.sonar.clutter.kernels.gate import add_plot, inverse_two

DRAW_BITS = 12  # of the number of a draw: the draw in its cell
HALF = U(0xFFFFFFFF)
TURN = 2.0 * math.pi


class Cells(NamedTuple):
    """Cells from q0 and b0 (m², rad), nq by nb of them, each dq by db."""

    q0: float
    dq: float
    nq: int
    b0: float
    db: float
    nb: int
    ring: bool  #: whether they close to a full circle
    density: float  #: of false plots per m²


class Field(NamedTuple):
    """False plots: key (2,) of the noise; share (J,) the distribution function of the number in a cell, up to 1."""

    key: np.ndarray
    share: np.ndarray
    cells: Cells


class Draws(NamedTuple):
    """A field without its arrays, because Numba would count references to them at each call.

    The two words of the key, the address of the distribution function, and the cells."""

    k0: int
    k1: int
    share: int
    cells: Cells


@inline
def field_draws(field):
    """The draws of a field; the field must outlive them."""
    return Draws(field.key[0], field.key[1], address(field.share), field.cells)


@inline
def number_of_plots(share, u):
    """The number of plots in a cell: the first index at which the distribution function exceeds the uniform number u.

    share is the address of the distribution function, whose last value is 1."""
    n = 0
    while u >= share[n]:
        n += 1
    return n


@inline
def random_words(k0, k1, realisation, cell, draw):
    """Two random words of a cell; cells are numbered through all scans.

    The first word of draw 0 gives the number of plots, each later word the position of one plot."""
    return threefry(U(realisation), (U(cell) << U(DRAW_BITS)) + U(draw), k0, k1)


@inline
def plot_position(k0, k1, realisation, cell, n, spare):
    """The position of plot n in a cell, each coordinate from 0 to 1 by half a word, and the spare word after it.

    Words are drawn in pairs: the first spare word is drawn with the word that gives the number of plots."""
    word = spare
    if n % 2 == 1:
        word, spare = random_words(k0, k1, realisation, cell, (n + 1) // 2)
    return np.float64(word >> U(32)) * 2.0**-32 + 2.0**-33, np.float64(word & HALF) * 2.0**-32 + 2.0**-33, spare


@inline
def touched_cells(low, high, start, step, count):
    """The first and the last cell that the interval low … high touches, of `count` cells of size step from `start` on.

    Floors stay floating-point numbers, because an open gate reaches farther than an integer can."""
    first = min(max(np.floor((low - start) / step), 0.0), count - 1.0)
    last = min(max(np.floor((high - start) / step), -1.0), count - 1.0)
    return int(first), int(last)


@inline
def add_false_plots(gated_plots, draws, realisation, scan, gate, threshold):
    """Add all false plots of a scan that lie in a gate."""
    irr, irb, ibb, _ = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    r, b = gate.r, gate.b
    q0, dq, nq, b0, db, nb, ring, _ = draws.cells
    half_r, half_b = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    r_min, r_max = max(r - half_r, 0.0), r + half_r
    q_min, q_max = 0.5 * r_min * r_min, 0.5 * r_max * r_max
    i_first, i_last = touched_cells(q_min, q_max, q0, dq, nq)
    if ring:
        half_b = min(half_b, 0.5 * nb * db)
        j_first, j_last = math.floor((b - half_b - b0) / db), math.floor((b + half_b - b0) / db)
        j_last = min(j_last, j_first + nb)  # the same column at both ends of a full turn: half a turn to each side
    else:
        # Without whole turns, relative to the middle of the sector.
        b -= TURN * np.floor((b - b0) / TURN - 0.5 * nb * db / TURN + 0.5)
        j_first, j_last = touched_cells(b - half_b, b + half_b, b0, db, nb)
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            column = j if 0 <= j < nb else j % nb
            cell = (scan * nq + i) * nb + column
            u, spare = random_words(draws.k0, draws.k1, realisation, cell, 0)
            for n in range(number_of_plots(draws.share, uniform(u))):
                u_q, u_b, spare = plot_position(draws.k0, draws.k1, realisation, cell, n, spare)
                q, offset = q0 + dq * (i + u_q), b0 + db * (j + u_b) - b
                if q_min <= q <= q_max and abs(offset) <= half_b:  # roots are slow
                    gated_plots = add_plot(gated_plots, math.sqrt(2.0 * q) - r, offset, 1.0, (irr, irb, ibb), threshold)
    return gated_plots


@kernel_part
def draw_uniform_positions(key, field, first, n, z):
    """Draw a position uniform over the sector in each of n realisations from `first` on; write them to z (2, ≥ n)."""
    q0, dq, nq, b0, db, nb, _, _ = field.cells
    for i in range(n):
        u, v = uniforms(key[0], key[1], first + i, 0)
        z[0, i] = np.sqrt(2.0 * (q0 + dq * nq * u))
        z[1, i] = b0 + db * nb * v


@kernel_part
def insert_plot(plot, total, scan_plots):
    """Insert a plot (r, b, 1 of the target or 0) into `total` plots in order of bearing; return their new number.

    scan_plots (3, M) takes it only if there is room."""
    if total < scan_plots.shape[1]:
        j = total
        while j > 0 and scan_plots[1, j - 1] > plot[1]:
            scan_plots[0, j] = scan_plots[0, j - 1]
            scan_plots[1, j] = scan_plots[1, j - 1]
            scan_plots[2, j] = scan_plots[2, j - 1]
            j -= 1
        scan_plots[0, j], scan_plots[1, j], scan_plots[2, j] = plot
    return total + 1


@kernel
def fill_scans(field, first, scan, target_plots, detected, plots):
    """Write all plots of n realisations from `first` on and K scans from `scan` on to plots (n, K, 3, M).

    Range, bearing and 1 for the target's plots, 0 for false ones, in order of bearing; unused places are NaN.
    target_plots (2, n, K) are valid where detected (n, K). Returns the largest number of plots in a scan, which may
    exceed M."""
    k0, k1, share, max_total = field.key[0], field.key[1], address(field.share), 0
    q0, dq, nq, b0, db, nb, _, density = field.cells
    for i in range(detected.shape[0]):
        for k in range(detected.shape[1]):
            scan_plots, total = plots[i, k], 0
            if detected[i, k]:
                total = insert_plot((target_plots[0, i, k], target_plots[1, i, k], 1.0), total, scan_plots)
            for cell in range(nq * nb if density > 0.0 else 0):  # bearing by bearing, so that little is out of order
                a, j = cell % nq, cell // nq
                number = (scan + k) * (nq * nb) + a * nb + j
                u, spare = random_words(k0, k1, first + i, number, 0)
                for n in range(number_of_plots(share, uniform(u))):
                    u_q, u_b, spare = plot_position(k0, k1, first + i, number, n, spare)
                    total = insert_plot(
                        (math.sqrt(2.0 * (q0 + dq * (a + u_q))), b0 + db * (j + u_b), 0.0), total, scan_plots
                    )
            max_total = max(max_total, total)
            scan_plots[:, total:] = np.nan
    return max_total
