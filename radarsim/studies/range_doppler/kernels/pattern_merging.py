"""Patterns of missed plots that are nearly alike are merged.

Patterns lie in blocks of eight. A block holds the rows of its patterns one after the other, each of eight numbers: P
(6) and S (6) packed, E (3 C), their probability, plots so far, and whether the last scan had one. What is beyond the
last pattern has no probability. Patterns in which the filter has not started are few; they lie one by one."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import aligned_zeros, inline, kernel_part
from radarsim.kernels.lane_matrices import get3, get6, put3, put6
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, square_root

EXTRA_ROWS = 3  # rows of a block after those of the errors
POSITION_NUMBERS = 6  # numbers that say where a pattern's P lies
FIRST_FRACTION = 1e-4  # fraction by which the covariances of merged patterns may differ, to begin with
LIGHTER_POWER = 4.0  # patterns 2 to this power less probable may differ twice as much
TARGET_FILL = 0.9  # of the patterns that are kept, about which their number is held
MIN_STEP, MAX_STEP = 1.05, 2.0  # by which the fraction grows where patterns are still too many
NO_GROUP = -1
PIECE_PATTERNS = 128  # patterns that are followed to the end side by side: with as many again they stay in cache
NEGLIGIBLE_POWERS = 60.0  # powers of two, by which a pattern that is left out is less probable than the most probable
LN_2 = 0.6931471805599453
# A double's bits as a whole number, less those of 1, times this: its logarithm to two, to within a twelfth.
OF_BITS, ONE_S_BITS = 2.0**-52, 0x3FF0000000000000


class Workspace(NamedTuple):
    """Work arrays for N patterns, N a multiple of 8, in blocks of L rows, and for V that have not started."""

    rows: np.ndarray  #: (N L,) blocks of patterns
    spare: np.ndarray  #: (N L,) likewise
    places: np.ndarray  #: (7 N,) where each P lies, in blocks as well, and then the patterns' probabilities
    bits: np.ndarray  #: (7 N,) the same memory as whole numbers
    group: np.ndarray  #: (N,) of each pattern
    lighter: np.ndarray  #: (N,) how much less probable it is than the most probable, in powers of 2 ** LIGHTER
    table: np.ndarray  #: (T,) cells, T a power of two
    owner: np.ndarray  #: (T,) their groups
    #: (V, 9 + 3 C) information (6) packed, its products Y (3 C), probability, plots, whether one came
    waiting: np.ndarray
    following: np.ndarray  #: (V, 9 + 3 C) likewise
    pieces: np.ndarray  #: (D M,) blocks of the patterns that are followed to the end piece by piece, D pieces
    size: np.ndarray  #: (D,) how many patterns a piece has
    scan: np.ndarray  #: (D,) after which scan


def make_workspace(max_patterns: int, columns: int, waiting: int, scans: int) -> Workspace:
    """Arrays for `max_patterns` patterns of so many columns of E, which double at a scan, and for those that wait."""
    high = 12 + 3 * columns + EXTRA_ROWS
    count = (2 * max_patterns + waiting + 4 * WIDTH) // WIDTH * WIDTH
    cells = 1 << (2 * count).bit_length()
    places = aligned_zeros(count * (POSITION_NUMBERS + 1))
    group, lighter = np.zeros((2, count), dtype=np.int64)
    table, owner = np.zeros((2, cells), dtype=np.int64)
    waiting_rows, following = np.zeros((2, waiting + 1, 6 + 3 * columns + EXTRA_ROWS))
    rows, spare = aligned_zeros(count * high), aligned_zeros(count * high)
    pieces, (size, scan) = (
        aligned_zeros((scans + 1) * 2 * PIECE_PATTERNS * high),
        np.zeros((2, scans + 1), dtype=np.int64),
    )
    labels = group, lighter, table, owner
    return Workspace(rows, spare, places, places.view(np.int64), *labels, waiting_rows, following, pieces, size, scan)


@inline
def height(columns):
    """Rows of a block."""
    return 12 + 3 * columns + EXTRA_ROWS


@inline
def blocks_of(n):
    """Blocks that n patterns take."""
    return (n + WIDTH - 1) // WIDTH


@inline
def pattern_start(b, high):
    """Where pattern b begins among blocks of `high` rows."""
    return (b // WIDTH) * high * WIDTH + b % WIDTH


@kernel_part
def pad(rows, n, high):
    """Make what is beyond the last of n patterns a copy of the first, without probability."""
    for b in range(n, blocks_of(n) * WIDTH):
        for i in range(high):
            rows[pattern_start(b, high) + i * WIDTH] = rows[i * WIDTH]
        rows[pattern_start(b, high) + (high - EXTRA_ROWS) * WIDTH] = 0.0


@inline
def likeness(p, q, r):
    """(1 + ρ) / (1 − ρ) of a correlation: where it is near ±1 it is 1 − |ρ| that must agree."""
    rho, tiny = p / square_root(q * r), full(1e-15)
    return (1.0 + rho + tiny) / (1.0 - rho + tiny)


@kernel_part
def locate(workspace, rows, n, high):
    """Where the believed covariances lie, and how probable the patterns are."""
    places, max_bits = address(workspace.places), 0
    for j in range(blocks_of(n)):
        p, to = row(rows, j * high), row(places, j * POSITION_NUMBERS)
        p0, p3, p5 = get(p, 0), get(p, 3), get(p, 5)
        put3(to, 0, (p0, p3, p5))
        put(to, 3, square_root(likeness(get(p, 1), p0, p3)))
        put(to, 4, square_root(likeness(get(p, 2), p0, p5)))
        put(to, 5, square_root(likeness(get(p, 4), p3, p5)))
    weight_bits = workspace.bits[POSITION_NUMBERS * len(workspace.group) :]
    for b in range(n):
        workspace.places[POSITION_NUMBERS * len(workspace.group) + b] = rows[
            pattern_start(b, high) + (high - EXTRA_ROWS) * WIDTH
        ]
        max_bits = max(max_bits, weight_bits[b])
    for b in range(n):
        powers_below = (max_bits - weight_bits[b]) * OF_BITS
        workspace.lighter[b] = NO_GROUP if powers_below > NEGLIGIBLE_POWERS else int(powers_below / LIGHTER_POWER + 0.5)


@kernel_part
def number_groups(workspace, rows, n, high, fraction):
    """Number the groups of patterns that agree to a fraction, by the order of their first; how many there are."""
    table, mask, groups = workspace.table, len(workspace.table) - 1, 0
    table[:] = NO_GROUP
    for b in range(n):
        lighter = workspace.lighter[b]
        if lighter == NO_GROUP:
            workspace.group[b] = NO_GROUP
            continue
        first, scale = pattern_start(b, POSITION_NUMBERS), LN_2 * OF_BITS / (fraction * float(1 << lighter))
        cell = lighter * 2147483647 + int(rows[pattern_start(b, high) + (high - EXTRA_ROWS + 1) * WIDTH]) * 104395303
        for i in range(POSITION_NUMBERS):
            value = float(workspace.bits[first + i * WIDTH] - ONE_S_BITS) * scale
            cell = cell * 1000003 + int(np.floor(value))
        cell = (cell ^ (cell >> 29)) & 0x7FFFFFFFFFFFFFFF
        slot = (cell * 0x1E3779B97F4A7C15 >> 20) & mask
        while table[slot] != NO_GROUP and table[slot] != cell:
            slot = (slot + 1) & mask
        if table[slot] == NO_GROUP:
            table[slot], workspace.owner[slot] = cell, groups
            groups += 1
        workspace.group[b] = workspace.owner[slot]
    return groups


@kernel_part
def weigh(rows, n, columns, direction):
    """Blocks of patterns from S to second moments, all times their probability (direction 1), or from sums of these
    back (−1), in place."""
    high = height(columns)
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        w = get(p, high - EXTRA_ROWS)
        scale = w if direction == 1 else 1.0 / w
        if direction == -1:
            for i in range(high - EXTRA_ROWS):
                put(p, i, get(p, i) * scale)
        for c in range(columns):
            put6(p, 6, kalman_algebra.add_outer(get6(p, 6), float(direction), get3(p, 12 + c, columns)))
        if direction == 1:
            for i in range(high - EXTRA_ROWS):
                put(p, i, get(p, i) * scale)


@kernel_part
def merge(workspace, rows, spare, n, columns, max_patterns, fraction):
    """Merge similar patterns into `spare`, until `max_patterns` are left; returns their number and the fraction.

    A group has the mean of its members' P and the first two moments of their errors. fraction: the first to try."""
    high = height(columns)
    locate(workspace, rows, n, high)
    groups = number_groups(workspace, rows, n, high, fraction)
    while groups > max_patterns:
        fraction *= min(max(MIN_STEP, np.sqrt(groups / max_patterns)), MAX_STEP)
        groups = number_groups(workspace, rows, n, high, fraction)
    weigh(rows, n, columns, 1)
    for i in range(blocks_of(groups) * WIDTH * high):
        spare[i] = 0.0
    for b in range(n):
        if workspace.group[b] != NO_GROUP:
            to, source = pattern_start(workspace.group[b], high), pattern_start(b, high)
            for i in range(high - EXTRA_ROWS + 1):
                spare[to + i * WIDTH] += rows[source + i * WIDTH]
            spare[to + (high - EXTRA_ROWS + 1) * WIDTH] = rows[source + (high - EXTRA_ROWS + 1) * WIDTH]
    pad(spare, groups, high)
    for b in range(groups, blocks_of(groups) * WIDTH):  # whatever is divided by
        spare[pattern_start(b, high) + (high - EXTRA_ROWS) * WIDTH] = 1.0
    weigh(spare, groups, columns, -1)
    pad(spare, groups, high)
    return groups, max(FIRST_FRACTION, fraction * max(0.5, np.sqrt(groups / (TARGET_FILL * max_patterns))))
