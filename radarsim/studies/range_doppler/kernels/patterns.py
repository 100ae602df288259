"""Patterns of plots that are alike made one: where they lie by their believed covariances, and the groups of them.

Means over the patterns of plots that came and that did not: P, S and E of `filters.Errors` for each, eight at a time.

Patterns lie in blocks of eight. A block holds the rows of its patterns one after the other, each of eight numbers:
P (6) and S (6) packed, E (3 C), their probability, plots so far, and whether the last scan had one. What is beyond the
last pattern has no probability. Patterns in which the filter has not started are few; they lie one by one."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import algebra, lanes
from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, get3, get6, put, put3, put6, root, row, where_greater

# ---- merging ---------------------------------------------------------------------------------------------------------
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


def room(max_patterns: int, columns: int, waiting: int, scans: int) -> Room:
    """Arrays for `max_patterns` patterns of so many columns of E, which double at a scan, and for those that wait."""
    high = 12 + 3 * columns + FURTHER
    count = (2 * max_patterns + waiting + 4 * WIDTH) // WIDTH * WIDTH
    cells = 1 << (2 * count).bit_length()
    places = aligned_zeros(count * (PLACES + 1))
    group, lighter = np.zeros((2, count), dtype=np.int64)
    table, owner = np.zeros((2, cells), dtype=np.int64)
    waiting_rows, following = np.zeros((2, waiting + 1, 6 + 3 * columns + FURTHER))
    rows, spare = aligned_zeros(count * high), aligned_zeros(count * high)
    pieces, (size, scan) = aligned_zeros((scans + 1) * 2 * PIECE * high), np.zeros((2, scans + 1), dtype=np.int64)
    labels = group, lighter, table, owner
    return Room(rows, spare, places, places.view(np.int64), *labels, waiting_rows, following, pieces, size, scan)


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
    rho, tiny = p / root(q * r), full(1e-15)
    return (1.0 + rho + tiny) / (1.0 - rho + tiny)


@part
def locate(room, rows, n, high):
    """Where the believed covariances lie, and how probable the patterns are."""
    places, max_bits = address(room.places), 0
    for j in range(blocks_of(n)):
        p, to = row(rows, j * high), row(places, j * PLACES)
        p0, p3, p5 = get(p, 0), get(p, 3), get(p, 5)
        put3(to, 0, (p0, p3, p5))
        put(to, 3, root(likeness(get(p, 1), p0, p3)))
        put(to, 4, root(likeness(get(p, 2), p0, p5)))
        put(to, 5, root(likeness(get(p, 4), p3, p5)))
    weight_bits = room.bits[PLACES * len(room.group) :]
    for b in range(n):
        room.places[PLACES * len(room.group) + b] = rows[at(b, high) + (high - FURTHER) * WIDTH]
        max_bits = max(max_bits, weight_bits[b])
    for b in range(n):
        powers_below = (max_bits - weight_bits[b]) * OF_BITS
        room.lighter[b] = NONE if powers_below > NEGLIGIBLE else int(powers_below / LIGHTER + 0.5)


@part
def grouped(room, rows, n, high, fraction):
    """Number the groups of patterns that agree to a fraction, by the order of their first; how many there are."""
    table, mask, groups = room.table, len(room.table) - 1, 0
    table[:] = NONE
    for b in range(n):
        lighter = room.lighter[b]
        if lighter == NONE:
            room.group[b] = NONE
            continue
        first, scale = at(b, PLACES), LN_2 * OF_BITS / (fraction * float(1 << lighter))
        cell = lighter * 2147483647 + int(rows[at(b, high) + (high - FURTHER + 1) * WIDTH]) * 104395303
        for i in range(PLACES):
            value = float(room.bits[first + i * WIDTH] - ONE_S_BITS) * scale
            cell = cell * 1000003 + int(np.floor(value))
        cell = (cell ^ (cell >> 29)) & 0x7FFFFFFFFFFFFFFF
        slot = (cell * 0x1E3779B97F4A7C15 >> 20) & mask
        while table[slot] != NONE and table[slot] != cell:
            slot = (slot + 1) & mask
        if table[slot] == NONE:
            table[slot], room.owner[slot] = cell, groups
            groups += 1
        room.group[b] = room.owner[slot]
    return groups


@part
def weigh(rows, n, columns, direction):
    """Blocks of patterns from S to second moments, all times their probability (direction 1), or from sums of these
    back (−1), in place."""
    high = height(columns)
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        w = get(p, high - FURTHER)
        scale = w if direction == 1 else 1.0 / w
        if direction == -1:
            for i in range(high - FURTHER):
                put(p, i, get(p, i) * scale)
        for c in range(columns):
            put6(p, 6, algebra.add_outer(get6(p, 6), float(direction), get3(p, 12 + c, columns)))
        if direction == 1:
            for i in range(high - FURTHER):
                put(p, i, get(p, i) * scale)


@part
def merge(room, rows, spare, n, columns, max_patterns, fraction):
    """Merge similar patterns into `spare`, until `max_patterns` are left; returns their number and the fraction.

    A group has the mean of its members' P and the first two moments of their errors. fraction: the first to try."""
    high = height(columns)
    locate(room, rows, n, high)
    groups = grouped(room, rows, n, high, fraction)
    while groups > max_patterns:
        fraction *= min(max(LEAST_STEP, np.sqrt(groups / max_patterns)), MOST_STEP)
        groups = grouped(room, rows, n, high, fraction)
    weigh(rows, n, columns, 1)
    for i in range(blocks_of(groups) * WIDTH * high):
        spare[i] = 0.0
    for b in range(n):
        if room.group[b] != NONE:
            to, source = at(room.group[b], high), at(b, high)
            for i in range(high - FURTHER + 1):
                spare[to + i * WIDTH] += rows[source + i * WIDTH]
            spare[to + (high - FURTHER + 1) * WIDTH] = rows[source + (high - FURTHER + 1) * WIDTH]
    pad(spare, groups, high)
    for b in range(groups, blocks_of(groups) * WIDTH):  # whatever is divided by
        spare[at(b, high) + (high - FURTHER) * WIDTH] = 1.0
    weigh(spare, groups, columns, -1)
    pad(spare, groups, high)
    return groups, max(ALIKE, fraction * max(0.5, np.sqrt(groups / (FILLED * max_patterns))))


# ---- patterns --------------------------------------------------------------------------------------------------------
NEGLIGIBLE_PROBABILITY = 1e-18  # probability of a pattern that is left out
OWN, BESIDE = 14, 6  # means of a scan: of the filter, and of each one beside it
FIRST = 11  # of the probabilities of a plot alone


class World(NamedTuple):
    """The plots of a filter over K scans, and the results wanted."""

    defect: np.ndarray  #: (K, 3, C) of the truth at every scan from the one before, as `filters.defects` has it
    Q: np.ndarray  #: (6,) covariance that a scan adds, packed
    R: np.ndarray  #: (2,) variances of the plots
    inputs: np.ndarray  #: (2, C) what the plots add to the columns of E
    of_plot: np.ndarray  #: (2, 2) mean error and mean square error of a plot alone, of range and velocity
    others: np.ndarray  #: (G, 2) of G filters beside it: what they observe, plots in their starts
    detection: float  #: probability that a scan has its plot
    dt: float  #: scan period, s
    observes: int  #: 1: the filter observes the range alone; 2: range and velocity
    start: int  #: plots in its least-squares start
    enough: int  #: plots with which all filters have started
    most: int  #: patterns that are kept, or
    whole: bool  #: beyond which they are followed to the end piece by piece, none merged
    from_k: int  #: scan, counted from 1, from which means are taken


@part
def predict(rows, n, columns, dt, Q, defect):
    """Go to the next scan, in place."""
    high, F, noise = height(columns), algebra.constant_acceleration(dt), (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5])
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        put6(p, 0, algebra.predicted_covariance(get6(p, 0), F, noise))
        put6(p, 6, algebra.predicted_covariance(get6(p, 6), F, algebra.NO_NOISE))
        for c in range(columns):
            r, v, a = algebra.predicted(get3(p, 12 + c, columns), F)
            put3(p, 12 + c, (r + defect[0, c], v + defect[1, c], a + defect[2, c]), columns)


@inline
def move_columns(p, gain, columns, inputs, m):
    """The columns of E with their share of the plot's error of number m."""
    for c in range(columns):
        e = inputs[m, c] - get(p, 12 + m * columns + c)
        put3(p, 12 + c, algebra.add_scaled(get3(p, 12 + c, columns), e, gain), columns)


@part
def update(rows, n, columns, world):
    """Give every pattern the scan's plot, in place, one number after the other: the noises are independent."""
    high, p_detected, enough = height(columns), world.detection, full(float(world.enough))
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        S, R = get6(p, 6), world.R[0]
        P, gain, _ = algebra.take_value(get6(p, 0), R, 1.0)
        S = algebra.correct_value(S, R, gain)
        move_columns(p, gain, columns, world.inputs, 0)
        if world.observes == 2:
            R = world.R[1]
            P, gain, _ = algebra.take_rate(P, R, 1.0)
            S = algebra.correct_rate(S, R, gain)
            move_columns(p, gain, columns, world.inputs, 1)
        put6(p, 0, P)
        put6(p, 6, S)
        last = high - FURTHER
        put(p, last, get(p, last) * p_detected)
        count = get(p, last + 1) + 1.0
        put(p, last + 1, where_greater(count, enough, enough, count))
        put(p, last + 2, full(1.0))


@part
def branch(rows, n, columns, world):
    """Each of n patterns without the next scan's plot, and with it; how many there are then."""
    high, width = height(columns), blocks_of(n)
    if world.detection == 1.0 or n == 0:
        update(rows, n, columns, world)
        return n
    last = high - FURTHER
    for j in range(width):
        p, q = row(rows, j * high), row(rows, (width + j) * high)
        for i in range(last):
            put(q, i, get(p, i))
        put(q, last, get(p, last) * (1.0 - world.detection))
        put(q, last + 1, get(p, last + 1))
        put(q, last + 2, full(0.0))
    update(rows, n, columns, world)
    missing = width * WIDTH - n  # places of the last block with a plot that hold none: filled from the end
    for b in range(min(missing, n)):
        to, source = at(n + b, high), at(width * WIDTH + n - 1 - b, high)
        for i in range(high):
            rows[to + i * WIDTH] = rows[source + i * WIDTH]
    pad(rows, 2 * n, high)
    return 2 * n


@part
def refer(L, columns, dt, defect):
    """Refer a start in the making to the next scan, in place: L ← F⁻ᵀ L F⁻¹; Y gains L times the defect."""
    information = algebra.predicted_information((L[0], L[1], L[2], L[3], L[4], L[5]), dt)
    L[0], L[1], L[2], L[3], L[4], L[5] = information
    for c in range(columns):
        y0, y1, y2 = L[6 + c], L[6 + columns + c], L[6 + 2 * columns + c]
        moved = y0, y1 - dt * y0, y2 - dt * y1 + 0.5 * dt * dt * y0
        defect_share = algebra.times(information, (defect[0, c], defect[1, c], defect[2, c]))
        for i in range(3):
            L[6 + i * columns + c] = moved[i] + defect_share[i]


@part
def begin(rows, n, L, columns):
    """A pattern more, the n-th, which starts with the sums L."""
    high, P = height(columns), algebra.inverse((L[0], L[1], L[2], L[3], L[4], L[5]))
    first = at(n, high)
    for i in range(6):
        rows[first + i * WIDTH] = rows[first + (6 + i) * WIDTH] = P[i]
    for c in range(columns):
        e = algebra.times(P, (L[6 + c], L[6 + columns + c], L[6 + 2 * columns + c]))
        for i in range(3):
            rows[first + (12 + i * columns + c) * WIDTH] = e[i]
    for i in range(FURTHER):
        rows[first + (high - FURTHER + i) * WIDTH] = L[6 + 3 * columns + i]


@part
def wait(room, rows, n, waiting_count, world, defect):
    """Take the patterns that have not started through a scan: those with all their plots begin.

    Returns how many have started then, and how many wait."""
    columns, still_waiting = defect.shape[1], 0
    last = 6 + 3 * columns
    for b in range(waiting_count):
        current = room.waiting[b]
        refer(current, columns, world.dt, defect)
        weight, count = current[last], current[last + 1]
        if weight * (1.0 - world.detection) > NEGLIGIBLE_PROBABILITY:
            next_row = room.following[still_waiting]
            for c in range(next_row.size):
                next_row[c] = current[c]
            next_row[last], next_row[last + 2] = weight * (1.0 - world.detection), 0.0
            still_waiting += 1
        if weight * world.detection > NEGLIGIBLE_PROBABILITY:
            for m in range(world.observes):
                current[3 * m] += 1.0 / world.R[m]  # of 00, 01, 02, 11, …
                for c in range(columns):
                    current[6 + m * columns + c] += world.inputs[m, c] / world.R[m]
            current[last], current[last + 1], current[last + 2] = weight * world.detection, count + 1.0, 1.0
            if count + 1.0 == world.start:
                begin(rows, n, current, columns)
                n += 1
            else:
                for c in range(current.size):
                    room.following[still_waiting, c] = current[c]
                still_waiting += 1
    for b in range(still_waiting):
        for c in range(room.waiting.shape[1]):
            room.waiting[b, c] = room.following[b, c]
    pad(rows, n, height(columns))
    return n, still_waiting


@inline
def normalised(P, M):
    """tr(P⁻¹ M) / 3 of packed P and M, by the factors L D Lᵀ of P, whose digits no scale of the rows changes."""
    l10, l20 = P[1] / P[0], P[2] / P[0]
    d1, m = P[3] - l10 * P[1], P[4] - l10 * P[2]
    l21 = m / d1
    d2, a = P[5] - l20 * P[2] - l21 * m, l10 * l21 - l20  # L⁻¹ = [[1, 0, 0], [−l10, 1, 0], [a, −l21, 1]]
    second = M[3] - l10 * (2.0 * M[1] - l10 * M[0])
    third = M[5] + a * (a * M[0] + 2.0 * M[2]) - l21 * (2.0 * M[4] + 2.0 * a * M[1] - l21 * M[3])
    return (M[0] / P[0] + second / d1 + third / d2) / 3.0


@inline
def second_moment(p, columns):
    """S + E Eᵀ, packed, of a block."""
    S = get6(p, 6)
    for c in range(columns):
        S = algebra.add_outer(S, 1.0, get3(p, 12 + c, columns))
    return S


@part
def note_started(rows, n, columns, world, sums):
    """Add to the means of a scan, sums (OWN + G BESIDE,): those of the patterns in which the filter has started. Their
    probability, NEES, bias (3), e² (3), believed variance (3), each times the probability; of each filter beside it the
    probability (3) that it has an estimate too, and e² there (3)."""
    high, zeros = height(columns), full(0.0)
    last = high - FURTHER
    w0 = q0 = b0 = b1 = b2 = m0 = m1 = m2 = v0 = v1 = v2 = zeros
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        w, P, M = get(p, last), get6(p, 0), second_moment(p, columns)
        w0, q0 = w0 + w, q0 + w * normalised(P, M)
        b0, b1, b2 = b0 + w * get(p, 12), b1 + w * get(p, 12 + columns), b2 + w * get(p, 12 + 2 * columns)
        m0, m1, m2 = m0 + w * M[0], m1 + w * M[3], m2 + w * M[5]
        v0, v1, v2 = v0 + w * P[0], v1 + w * P[3], v2 + w * P[5]
    for i, sum_of in enumerate((w0, q0, b0, b1, b2, m0, m1, m2, v0, v1, v2)):
        sums[i] += lanes.total(sum_of)
    for g in range(len(world.others)):
        note_beside(rows, n, columns, world.others[g], sums[OWN + g * BESIDE :])


@part
def note_beside(rows, n, columns, companion, sums):
    """Of the started patterns those in which another filter has an estimate as well: probabilities (3), e² (3)."""
    high, zeros, ones = height(columns), full(0.0), full(1.0)
    last, enough = high - FURTHER, full(companion[1] - 0.5)
    sees = full(1.0 if companion[0] == 2 else 0.0)
    s0 = s1 = s2 = m0 = m1 = m2 = zeros
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        w, M, hit, count = get(p, last), second_moment(p, columns), get(p, last + 2), get(p, last + 1)
        w0 = w * where_greater(count, enough, ones, hit)
        w1 = w * where_greater(count, enough, ones, sees * hit)
        w2 = w * where_greater(count, enough, ones, zeros)
        s0, s1, s2 = s0 + w0, s1 + w1, s2 + w2
        m0, m1, m2 = m0 + w0 * M[0], m1 + w1 * M[3], m2 + w2 * M[5]
    for i, sum_of in enumerate((s0, s1, s2, m0, m1, m2)):
        sums[i] += lanes.total(sum_of)


@part
def note_waiting(waiting, waiting_count, columns, world, sums):
    """The same of those that have not started: where a plot came it is the estimate, of what it holds."""
    last = 6 + 3 * columns
    for b in range(waiting_count):
        if waiting[b, last + 2] == 1.0:
            w, count = waiting[b, last], waiting[b, last + 1]
            for m in range(world.observes):
                sums[FIRST + m] += w
                sums[2 + m] += w * world.of_plot[m, 0]
                sums[5 + m] += w * world.of_plot[m, 1]
                sums[8 + m] += w * world.R[m]
                for g in range(len(world.others)):
                    if m < world.others[g, 0] or count >= world.others[g, 1]:
                        first = OWN + g * BESIDE + m
                        sums[first] += w
                        sums[first + 3] += w * world.of_plot[m, 1]


@part
def follow(room, rows, n, k, world, sums):
    """All patterns that n started ones become after scan k, to the last scan, their sums added as below. A
    piece of at most PIECE patterns goes on until it is larger; then its later half waits, above it, until it is
    done."""
    columns, scans = world.defect.shape[2], len(world.defect)
    high = height(columns)
    length, room_of_piece = WIDTH * high, 2 * PIECE * high
    for first in range(0, n, PIECE):
        level = 0
        room.size[0], room.scan[0] = min(PIECE, n - first), k
        begin_at = first // WIDTH * length
        for i in range(blocks_of(room.size[0]) * length):
            room.pieces[i] = rows[begin_at + i]
        while level >= 0:
            piece, m, scan = (
                row(address(room.pieces), level * room_of_piece // WIDTH),
                room.size[level],
                room.scan[level] + 1,
            )
            predict(piece, m, columns, world.dt, world.Q, world.defect[scan])
            m = branch(piece, m, columns, world)
            if scan + 1 >= world.from_k:
                note_started(piece, m, columns, world, sums[scan])
            room.size[level], room.scan[level] = m, scan
            if scan == scans - 1:
                level -= 1
            elif m > PIECE:
                kept_blocks = blocks_of(m) // 2
                for i in range(kept_blocks * length, blocks_of(m) * length):
                    room.pieces[(level + 1) * room_of_piece + i - kept_blocks * length] = room.pieces[
                        level * room_of_piece + i
                    ]
                room.size[level], room.size[level + 1], room.scan[level + 1] = (
                    kept_blocks * WIDTH,
                    m - kept_blocks * WIDTH,
                    scan,
                )
                level += 1


@kernel
def add_means(room, world, sums):
    """`patterns.mixture`: the sums of each scan (K, OWN + G BESIDE), in a `room`."""
    rows, spare, columns = address(room.rows), address(room.spare), world.defect.shape[2]
    n, waiting_count, fraction = 0, 1, ALIKE
    room.waiting[0, :] = 0.0
    room.waiting[0, 6 + 3 * columns] = 1.0
    for k in range(len(world.defect)):
        predict(rows, n, columns, world.dt, world.Q, world.defect[k])
        n = branch(rows, n, columns, world)
        n, waiting_count = wait(room, rows, n, waiting_count, world, world.defect[k])
        if k + 1 >= world.from_k:
            note_started(rows, n, columns, world, sums[k])
            note_waiting(room.waiting, waiting_count, columns, world, sums[k])
        if n > world.most and world.whole:
            if k < len(world.defect) - 1:
                follow(room, rows, n, k, world, sums)
            n = 0
        elif n > world.most:
            n, fraction = merge(room, rows, spare, n, columns, world.most, fraction)
            rows, spare = spare, rows
