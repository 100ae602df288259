"""Means of P, S and E of `error_recursion.Errors` over the patterns of plots and missed plots, eight at a time."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra, lanes
from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.lane_matrices import get3, get6, put3, put6
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, where_greater
from radarsim.studies.range_doppler.kernels.pattern_merging import (
    EXTRA_ROWS,
    FIRST_FRACTION,
    PIECE_PATTERNS,
    blocks_of,
    height,
    merge,
    pad,
    pattern_start,
)

NEGLIGIBLE_PROBABILITY = 1e-18  # probability of a pattern that is left out
FILTER_MEANS, COMPANION_MEANS = 14, 6  # means of a scan: of the filter, and of each one beside it
FIRST_PLOT_PROBABILITY = 11  # of the probabilities of a plot alone


class World(NamedTuple):
    """The plots of a filter over K scans, and the results wanted."""

    defect: np.ndarray  #: (K, 3, C) of the truth at every scan from the one before, as `error_recursion.defects` has it
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


@kernel_part
def predict(rows, n, columns, dt, Q, defect):
    """Go to the next scan, in place."""
    high, F, noise = height(columns), kalman_algebra.constant_acceleration(dt), (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5])
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        put6(p, 0, kalman_algebra.predict_covariance(get6(p, 0), F, noise))
        put6(p, 6, kalman_algebra.predict_covariance(get6(p, 6), F, kalman_algebra.NO_NOISE))
        for c in range(columns):
            r, v, a = kalman_algebra.predict_state(get3(p, 12 + c, columns), F)
            put3(p, 12 + c, (r + defect[0, c], v + defect[1, c], a + defect[2, c]), columns)


@inline
def move_columns(p, gain, columns, inputs, m):
    """The columns of E with their share of the plot's error of number m."""
    for c in range(columns):
        e = inputs[m, c] - get(p, 12 + m * columns + c)
        put3(p, 12 + c, kalman_algebra.add_scaled(get3(p, 12 + c, columns), e, gain), columns)


@kernel_part
def update(rows, n, columns, world):
    """Give every pattern the scan's plot, in place, one number after the other: the noises are independent."""
    high, p_detected, enough = height(columns), world.detection, full(float(world.enough))
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        S, R = get6(p, 6), world.R[0]
        P, gain, _ = kalman_algebra.take_value(get6(p, 0), R, 1.0)
        S = kalman_algebra.correct_value(S, R, gain)
        move_columns(p, gain, columns, world.inputs, 0)
        if world.observes == 2:
            R = world.R[1]
            P, gain, _ = kalman_algebra.take_rate(P, R, 1.0)
            S = kalman_algebra.correct_rate(S, R, gain)
            move_columns(p, gain, columns, world.inputs, 1)
        put6(p, 0, P)
        put6(p, 6, S)
        last = high - EXTRA_ROWS
        put(p, last, get(p, last) * p_detected)
        count = get(p, last + 1) + 1.0
        put(p, last + 1, where_greater(count, enough, enough, count))
        put(p, last + 2, full(1.0))


@kernel_part
def branch(rows, n, columns, world):
    """Each of n patterns without the next scan's plot, and with it; how many there are then."""
    high, width = height(columns), blocks_of(n)
    if world.detection == 1.0 or n == 0:
        update(rows, n, columns, world)
        return n
    last = high - EXTRA_ROWS
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
        to, source = pattern_start(n + b, high), pattern_start(width * WIDTH + n - 1 - b, high)
        for i in range(high):
            rows[to + i * WIDTH] = rows[source + i * WIDTH]
    pad(rows, 2 * n, high)
    return 2 * n


@kernel_part
def refer(L, columns, dt, defect):
    """Refer a start in the making to the next scan, in place: L ← F⁻ᵀ L F⁻¹; Y gains L times the defect."""
    information = kalman_algebra.predict_information((L[0], L[1], L[2], L[3], L[4], L[5]), dt)
    L[0], L[1], L[2], L[3], L[4], L[5] = information
    for c in range(columns):
        y0, y1, y2 = L[6 + c], L[6 + columns + c], L[6 + 2 * columns + c]
        moved = y0, y1 - dt * y0, y2 - dt * y1 + 0.5 * dt * dt * y0
        defect_share = kalman_algebra.times(information, (defect[0, c], defect[1, c], defect[2, c]))
        for i in range(3):
            L[6 + i * columns + c] = moved[i] + defect_share[i]


@kernel_part
def begin(rows, n, L, columns):
    """A pattern more, the n-th, which starts with the sums L."""
    high, P = height(columns), kalman_algebra.inverse((L[0], L[1], L[2], L[3], L[4], L[5]))
    first = pattern_start(n, high)
    for i in range(6):
        rows[first + i * WIDTH] = rows[first + (6 + i) * WIDTH] = P[i]
    for c in range(columns):
        e = kalman_algebra.times(P, (L[6 + c], L[6 + columns + c], L[6 + 2 * columns + c]))
        for i in range(3):
            rows[first + (12 + i * columns + c) * WIDTH] = e[i]
    for i in range(EXTRA_ROWS):
        rows[first + (high - EXTRA_ROWS + i) * WIDTH] = L[6 + 3 * columns + i]


@kernel_part
def wait(workspace, rows, n, waiting_count, world, defect):
    """Take the patterns that have not started through a scan: those with all their plots begin.

    Returns how many have started then, and how many wait."""
    columns, still_waiting = defect.shape[1], 0
    last = 6 + 3 * columns
    for b in range(waiting_count):
        current = workspace.waiting[b]
        refer(current, columns, world.dt, defect)
        weight, count = current[last], current[last + 1]
        if weight * (1.0 - world.detection) > NEGLIGIBLE_PROBABILITY:
            next_row = workspace.following[still_waiting]
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
                    workspace.following[still_waiting, c] = current[c]
                still_waiting += 1
    for b in range(still_waiting):
        for c in range(workspace.waiting.shape[1]):
            workspace.waiting[b, c] = workspace.following[b, c]
    pad(rows, n, height(columns))
    return n, still_waiting


@inline
def normalised_square(P, M):
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
        S = kalman_algebra.add_outer(S, 1.0, get3(p, 12 + c, columns))
    return S


@kernel_part
def add_started(rows, n, columns, world, sums):
    """Add to the means of a scan, sums (OWN + G BESIDE,): those of the patterns in which the filter has started. Their
    probability, NEES, bias (3), e² (3), believed variance (3), each times the probability; of each filter beside it the
    probability (3) that it has an estimate too, and e² there (3)."""
    high, zeros = height(columns), full(0.0)
    last = high - EXTRA_ROWS
    w0 = q0 = b0 = b1 = b2 = m0 = m1 = m2 = v0 = v1 = v2 = zeros
    for j in range(blocks_of(n)):
        p = row(rows, j * high)
        w, P, M = get(p, last), get6(p, 0), second_moment(p, columns)
        w0, q0 = w0 + w, q0 + w * normalised_square(P, M)
        b0, b1, b2 = b0 + w * get(p, 12), b1 + w * get(p, 12 + columns), b2 + w * get(p, 12 + 2 * columns)
        m0, m1, m2 = m0 + w * M[0], m1 + w * M[3], m2 + w * M[5]
        v0, v1, v2 = v0 + w * P[0], v1 + w * P[3], v2 + w * P[5]
    for i, sum_of in enumerate((w0, q0, b0, b1, b2, m0, m1, m2, v0, v1, v2)):
        sums[i] += lanes.total(sum_of)
    for g in range(len(world.others)):
        add_companion(rows, n, columns, world.others[g], sums[FILTER_MEANS + g * COMPANION_MEANS :])


@kernel_part
def add_companion(rows, n, columns, companion, sums):
    """Of the started patterns those in which another filter has an estimate as well: probabilities (3), e² (3)."""
    high, zeros, ones = height(columns), full(0.0), full(1.0)
    last, enough = high - EXTRA_ROWS, full(companion[1] - 0.5)
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


@kernel_part
def add_waiting(waiting, waiting_count, columns, world, sums):
    """As above, for tracks not yet started: the plot itself is the estimate."""
    last = 6 + 3 * columns
    for b in range(waiting_count):
        if waiting[b, last + 2] == 1.0:
            w, count = waiting[b, last], waiting[b, last + 1]
            for m in range(world.observes):
                sums[FIRST_PLOT_PROBABILITY + m] += w
                sums[2 + m] += w * world.of_plot[m, 0]
                sums[5 + m] += w * world.of_plot[m, 1]
                sums[8 + m] += w * world.R[m]
                for g in range(len(world.others)):
                    if m < world.others[g, 0] or count >= world.others[g, 1]:
                        first = FILTER_MEANS + g * COMPANION_MEANS + m
                        sums[first] += w
                        sums[first + 3] += w * world.of_plot[m, 1]


@kernel_part
def follow(workspace, rows, n, k, world, sums):
    """All patterns that n started ones become after scan k, to the last scan, their sums added as below. A
    piece of at most PIECE patterns goes on until it is larger; then its later half waits, above it, until it is
    done."""
    columns, scans = world.defect.shape[2], len(world.defect)
    high = height(columns)
    length, room_of_piece = WIDTH * high, 2 * PIECE_PATTERNS * high
    for first in range(0, n, PIECE_PATTERNS):
        level = 0
        workspace.size[0], workspace.scan[0] = min(PIECE_PATTERNS, n - first), k
        begin_at = first // WIDTH * length
        for i in range(blocks_of(workspace.size[0]) * length):
            workspace.pieces[i] = rows[begin_at + i]
        while level >= 0:
            piece, m, scan = (
                row(address(workspace.pieces), level * room_of_piece // WIDTH),
                workspace.size[level],
                workspace.scan[level] + 1,
            )
            predict(piece, m, columns, world.dt, world.Q, world.defect[scan])
            m = branch(piece, m, columns, world)
            if scan + 1 >= world.from_k:
                add_started(piece, m, columns, world, sums[scan])
            workspace.size[level], workspace.scan[level] = m, scan
            if scan == scans - 1:
                level -= 1
            elif m > PIECE_PATTERNS:
                kept_blocks = blocks_of(m) // 2
                for i in range(kept_blocks * length, blocks_of(m) * length):
                    workspace.pieces[(level + 1) * room_of_piece + i - kept_blocks * length] = workspace.pieces[
                        level * room_of_piece + i
                    ]
                workspace.size[level], workspace.size[level + 1], workspace.scan[level + 1] = (
                    kept_blocks * WIDTH,
                    m - kept_blocks * WIDTH,
                    scan,
                )
                level += 1


@kernel
def add_means(workspace, world, sums):
    """`missed_plot_patterns.mixture`: the sums of each scan (K, OWN + G BESIDE), in a workspace."""
    rows, spare, columns = address(workspace.rows), address(workspace.spare), world.defect.shape[2]
    n, waiting_count, fraction = 0, 1, FIRST_FRACTION
    workspace.waiting[0, :] = 0.0
    workspace.waiting[0, 6 + 3 * columns] = 1.0
    for k in range(len(world.defect)):
        predict(rows, n, columns, world.dt, world.Q, world.defect[k])
        n = branch(rows, n, columns, world)
        n, waiting_count = wait(workspace, rows, n, waiting_count, world, world.defect[k])
        if k + 1 >= world.from_k:
            add_started(rows, n, columns, world, sums[k])
            add_waiting(workspace.waiting, waiting_count, columns, world, sums[k])
        if n > world.most and world.whole:
            if k < len(world.defect) - 1:
                follow(workspace, rows, n, k, world, sums)
            n = 0
        elif n > world.most:
            n, fraction = merge(workspace, rows, spare, n, columns, world.most, fraction)
            rows, spare = spare, rows
