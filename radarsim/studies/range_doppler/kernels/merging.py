"""Patterns of plots that are alike made one: where they lie by their believed covariances, and the groups of them.

Blocks of eight patterns as in `kernels.patterns`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import add_outer
from radarsim.kernels.compile import aligned_zeros, inline, part
from radarsim.kernels.lanes import WIDTH, address, full, get, get3, get6, put, put3, put6, root, row

FURTHER = 3  # rows of a block after those of the errors
PLACES = 6  # numbers that say where a pattern's P lies
ALIKE = 1e-4  # fraction by which the covariances of merged patterns may differ, to begin with
LIGHTER = 4.0  # patterns 2 to this power less probable may differ twice as much
FILLED = 0.9  # of the patterns that are kept, about which their number is held
LEAST_STEP, MOST_STEP = 1.05, 2.0  # by which the fraction grows where patterns are still too many
NONE = -1
PIECE = 128  # patterns that are followed to the end side by side: with as many again they stay in cache
NEGLIGIBLE = 60.0  # powers of two, by which a pattern that is left out is less probable than the most probable
LN_2 = 0.6931471805599453
# A double's bits as a whole number, less those of 1, times this: its logarithm to two, to within a twelfth.
OF_BITS, ONE_S_BITS = 2.0**-52, 0x3FF0000000000000


class Room(NamedTuple):
    """Work arrays for N patterns, N a multiple of 8, in blocks of L rows, and for V that have not started.

    rows, spare        (N L,)        blocks of patterns
    places             (7 N,)        where each P lies, in blocks as well, and then the patterns' probabilities
    bits               (7 N,)        the same memory as whole numbers
    group              (N,)          of each pattern
    lighter            (N,)          how much less probable it is than the most probable, in powers of 2 ** LIGHTER
    table, owner       (T,)          cells and their groups, T a power of two
    waiting, following (V, 9 + 3 C)  information (6) packed, its products Y (3 C), probability, plots, whether one came
    pieces             (D M,)        blocks of the patterns that are followed to the end piece by piece, D pieces
    size, scan         (D,)          how many patterns a piece has, after which scan
    """

    rows: np.ndarray
    spare: np.ndarray
    places: np.ndarray
    bits: np.ndarray
    group: np.ndarray
    lighter: np.ndarray
    table: np.ndarray
    owner: np.ndarray
    waiting: np.ndarray
    following: np.ndarray
    pieces: np.ndarray
    size: np.ndarray
    scan: np.ndarray


def room(most: int, columns: int, waiting: int, scans: int) -> Room:
    """Arrays for `most` patterns of so many columns of E, which double at a scan, and for those that wait."""
    high = 12 + 3 * columns + FURTHER
    count = (2 * most + waiting + 4 * WIDTH) // WIDTH * WIDTH
    cells = 1 << (2 * count).bit_length()
    places = aligned_zeros(count * (PLACES + 1))
    group, lighter = np.zeros((2, count), dtype=np.int64)
    table, owner = np.zeros((2, cells), dtype=np.int64)
    held, following = np.zeros((2, waiting + 1, 6 + 3 * columns + FURTHER))
    rows, spare = aligned_zeros(count * high), aligned_zeros(count * high)
    pieces, (size, scan) = aligned_zeros((scans + 1) * 2 * PIECE * high), np.zeros((2, scans + 1), dtype=np.int64)
    labels = group, lighter, table, owner
    return Room(rows, spare, places, places.view(np.int64), *labels, held, following, pieces, size, scan)


@inline
def height(columns):
    """Rows of a block."""
    return 12 + 3 * columns + FURTHER


@inline
def blocks_of(n):
    """Blocks that n patterns take."""
    return (n + WIDTH - 1) // WIDTH


@inline
def at(b, high):
    """Where pattern b begins among blocks of `high` rows."""
    return (b // WIDTH) * high * WIDTH + b % WIDTH


@part
def pad(rows, n, high):
    """Make what is beyond the last of n patterns a copy of the first, without probability."""
    for b in range(n, blocks_of(n) * WIDTH):
        for i in range(high):
            rows[at(b, high) + i * WIDTH] = rows[i * WIDTH]
        rows[at(b, high) + (high - FURTHER) * WIDTH] = 0.0


@inline
def likeness(p, q, r):
    """(1 + ρ) / (1 − ρ) of a correlation: where it is near ±1 it is 1 − |ρ| that must agree."""
    rho, least = p / root(q * r), full(1e-15)
    return (1.0 + rho + least) / (1.0 - rho + least)


@part
def locate(room, rows, n, high):
    """Where the believed covariances lie, and how probable the patterns are."""
    places, most = address(room.places), 0
    for j in range(blocks_of(n)):
        p, to = row(rows, j * high), row(places, j * PLACES)
        p0, p3, p5 = get(p, 0), get(p, 3), get(p, 5)
        put3(to, 0, (p0, p3, p5))
        put(to, 3, root(likeness(get(p, 1), p0, p3)))
        put(to, 4, root(likeness(get(p, 2), p0, p5)))
        put(to, 5, root(likeness(get(p, 4), p3, p5)))
    of_weight = room.bits[PLACES * len(room.group) :]
    for b in range(n):
        room.places[PLACES * len(room.group) + b] = rows[at(b, high) + (high - FURTHER) * WIDTH]
        most = max(most, of_weight[b])
    for b in range(n):
        less = (most - of_weight[b]) * OF_BITS
        room.lighter[b] = NONE if less > NEGLIGIBLE else int(less / LIGHTER + 0.5)


@part
def grouped(room, rows, n, high, alike):
    """Number the groups of patterns that are alike to a fraction, by the order of their first; how many there are."""
    table, mask, made = room.table, len(room.table) - 1, 0
    table[:] = NONE
    for b in range(n):
        lighter = room.lighter[b]
        if lighter == NONE:
            room.group[b] = NONE
            continue
        first, scale = at(b, PLACES), LN_2 * OF_BITS / (alike * float(1 << lighter))
        cell = lighter * 2147483647 + int(rows[at(b, high) + (high - FURTHER + 1) * WIDTH]) * 104395303
        for i in range(PLACES):
            value = float(room.bits[first + i * WIDTH] - ONE_S_BITS) * scale
            cell = cell * 1000003 + int(np.floor(value))
        cell = (cell ^ (cell >> 29)) & 0x7FFFFFFFFFFFFFFF
        place = (cell * 0x1E3779B97F4A7C15 >> 20) & mask
        while table[place] != NONE and table[place] != cell:
            place = (place + 1) & mask
        if table[place] == NONE:
            table[place], room.owner[place] = cell, made
            made += 1
        room.group[b] = room.owner[place]
    return made


@part
def weigh(rows, n, columns, towards):
    """Blocks of patterns from S to second moments, all times their probability (towards 1), or from sums of these back
    (−1), in place."""
    high = height(columns)
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        w = get(p, high - FURTHER)
        scale = w if towards == 1 else 1.0 / w
        if towards == -1:
            for i in range(high - FURTHER):
                put(p, i, get(p, i) * scale)
        for c in range(columns):
            put6(p, 6, add_outer(get6(p, 6), float(towards), get3(p, 12 + c, columns)))
        if towards == 1:
            for i in range(high - FURTHER):
                put(p, i, get(p, i) * scale)


@part
def merge(room, rows, spare, n, columns, most, alike):
    """Patterns that are alike made one, in `spare`, so that there are at most `most`; how many, and how alike.

    A group has the mean of its members' P and the first two moments of their errors. alike: where to begin.
    """
    high = height(columns)
    locate(room, rows, n, high)
    made = grouped(room, rows, n, high, alike)
    while made > most:
        alike *= min(max(LEAST_STEP, np.sqrt(made / most)), MOST_STEP)
        made = grouped(room, rows, n, high, alike)
    weigh(rows, n, columns, 1)
    for i in range(blocks_of(made) * WIDTH * high):
        spare[i] = 0.0
    for b in range(n):
        if room.group[b] != NONE:
            to, source = at(room.group[b], high), at(b, high)
            for i in range(high - FURTHER + 1):
                spare[to + i * WIDTH] += rows[source + i * WIDTH]
            spare[to + (high - FURTHER + 1) * WIDTH] = rows[source + (high - FURTHER + 1) * WIDTH]
    pad(spare, made, high)
    for b in range(made, blocks_of(made) * WIDTH):  # whatever is divided by
        spare[at(b, high) + (high - FURTHER) * WIDTH] = 1.0
    weigh(spare, made, columns, -1)
    pad(spare, made, high)
    return made, max(ALIKE, alike * max(0.5, np.sqrt(made / (FILLED * most))))
