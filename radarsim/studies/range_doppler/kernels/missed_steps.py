"""One scan of filters whose covariance differs from realisation to realisation.

Realisations lie in chunks that stay in cache, scans outermost; eight of them go through a formula at once. Where a plot
is missed a filter extrapolates. It starts with as many plots as its least-squares start takes; before, its estimates
are the plots that come, of what it observes, and at a scan without one it has none.

Covariances are packed, p = (00, 01, 02, 11, 12, 22).

A filter's start is in the making as the sums of its normal equations, in units of the scan period and with time counted
from the realisation's first plot, so that they are well conditioned however late that comes."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra, lane_matrices, lanes
from radarsim.kernels.compiler import aligned_zeros, inline, kernel_part
from radarsim.kernels.lane_matrices import get3, get6, put3, put6
from radarsim.kernels.lanes import address, full, get, row, where_greater

CHUNK = 512  # realisations; a row is 4 KB; fewer, and the calls of its parts cost as much as their work
EIGHTS = CHUNK // lanes.WIDTH


class Workspace(NamedTuple):
    """Arrays of one chunk of n realisations, or, inside the kernels, their addresses."""

    plots: np.ndarray  #: (2, n) range and velocity
    detected: np.ndarray  #: (n,) 1 where the scan has a plot
    other: np.ndarray  #: (n,) for the pair of numbers drawn with it
    count: np.ndarray  #: (n,) plots so far
    first: np.ndarray  #: (n,) scan of the first
    offset: np.ndarray  #: (2, n) biases
    state: np.ndarray  #: (3, n) drawn difference of the truth, moved on
    shift: np.ndarray  #: (6, n) displacement that is drawn of a flight
    x: np.ndarray  #: (F, 3, n) states of filters that have started
    p: np.ndarray  #: (F, 6, n) their covariances
    normal: np.ndarray  #: (F, 9, n) sums of the starts in the making: six of the matrix, three of the right-hand side
    e: np.ndarray  #: (F, 3, n) errors, zero where there is no estimate
    has: np.ndarray  #: (F, 3, n) 1 where there is one


def make_workspace(filters: int) -> Workspace:
    """Arrays of one chunk."""
    rows = ((2,), (), (), (), (), (2,), (3,), (6,), (filters, 3), (filters, 6), (filters, 9), *[(filters, 3)] * 2)
    return Workspace(*(aligned_zeros(*row, CHUNK) for row in rows))


@inline
def addresses(arrays):
    """The addresses of the work arrays: parts that are called with arrays count references to each, at every call."""
    return Workspace(
        address(arrays.plots),
        address(arrays.detected),
        address(arrays.other),
        address(arrays.count),
        address(arrays.first),
        address(arrays.offset),
        address(arrays.state),
        address(arrays.shift),
        address(arrays.x),
        address(arrays.p),
        address(arrays.normal),
        address(arrays.e),
        address(arrays.has),
    )


@inline
def filter_rows_address(rows, f, rows_per_filter):
    """The address of a filter's rows in those of all filters (F, rows_per_filter, n)."""
    return row(rows, f * rows_per_filter * EIGHTS)


def scan_of(observes):
    """The kernel of one scan of a filter that observes the range (1), or range and velocity (2)."""

    @kernel_part
    def scan(x, p, plots, detected, dt, Q, R):
        """One scan, in place: addresses of x (3, n), p (6, n), plots, detected; Q (6,), R (2,)."""
        F, noise = kalman_algebra.constant_acceleration(dt), (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5])
        R_range, R_velocity = R[0], R[1]
        for i in range(EIGHTS):
            state, present = kalman_algebra.predict_state(get3(x, i, EIGHTS), F), get(detected, i)
            P, gain, _ = kalman_algebra.take_value(
                kalman_algebra.predict_covariance(get6(p, i, EIGHTS), F, noise), R_range, present
            )
            state = kalman_algebra.add_scaled(state, get(plots, i) - state[0], gain)
            if observes == 2:  # one number after the other
                P, gain, _ = kalman_algebra.take_rate(P, R_velocity, present)
                state = kalman_algebra.add_scaled(state, get(plots, EIGHTS + i) - state[1], gain)
            put3(x, i, state, EIGHTS)
            put6(p, i, P, EIGHTS)

    return scan


scan_range, scan_range_velocity = scan_of(1), scan_of(2)


@inline
def add_to_normal_equations(sums, right, u, weights, plots):
    """The normal equations sums (6) and right-hand side (3) with one plot more, u scan periods after the first.

    The unknowns are range, velocity dt and acceleration dt² at the realisation's first plot; weights are the inverse
    variances of the range and of the velocity times dt, zero where there is none; plots the range and velocity times
    dt."""
    range_row, velocity_row = (1.0, u, 0.5 * u * u), (0.0, 1.0, u)
    sums = kalman_algebra.add_outer(kalman_algebra.add_outer(sums, weights[0], range_row), weights[1], velocity_row)
    right = kalman_algebra.add_scaled(right, weights[0] * plots[0], range_row)
    return sums, kalman_algebra.add_scaled(right, weights[1] * plots[1], velocity_row)


@inline
def solve_start(sums, right, u, dt):
    """State and packed covariance, u scan periods after the first plot, of the normal equations."""
    P, F = kalman_algebra.inverse(sums), kalman_algebra.constant_acceleration(u)
    r, v, a = kalman_algebra.predict_state(kalman_algebra.times(P, right), F)
    c0, c1, c2, c3, c4, c5 = kalman_algebra.predict_covariance(P, F, kalman_algebra.NO_NOISE)
    return (r, v / dt, a / (dt * dt)), (c0, c1 / dt, c2 / dt**2, c3 / dt**2, c4 / dt**3, c5 / dt**4)


@kernel_part
def make_starts(memory, f, k, start, weights, dt):
    """Scan k of filter f's starts in the making; those whose last plot has come begin. True where none waited."""
    x, p, normal = (
        filter_rows_address(memory.x, f, 3),
        filter_rows_address(memory.p, f, 6),
        filter_rows_address(memory.normal, f, 9),
    )
    right, last_start_plot, ones, zeros = row(normal, 6 * EIGHTS), full(start - 0.5), full(1.0), full(0.0)
    all_run = True
    for i in range(EIGHTS):
        present, count = get(memory.detected, i), get(memory.count, i)
        if lanes.any_greater(last_start_plot, count - present):
            all_run = False
            u = float(k) - get(memory.first, i)
            plot_weights = weights[0] * present, weights[1] * present
            plots = get(memory.plots, i), get(memory.plots, EIGHTS + i) * dt
            sums, y = add_to_normal_equations(get6(normal, i, EIGHTS), get3(right, i, EIGHTS), u, plot_weights, plots)
            put6(normal, i, sums, EIGHTS)
            put3(right, i, y, EIGHTS)
            begins = where_greater(count, last_start_plot, ones, zeros) * where_greater(
                last_start_plot, count - present, ones, zeros
            )
            if lanes.any_greater(begins, full(0.5)):
                s0, s1, s2, s3, s4, s5 = sums
                continues = 1.0 - begins  # makes the matrices of the others regular
                new, covariance = solve_start((s0 + continues, s1, s2, s3 + continues, s4, s5 + continues), y, u, dt)
                half = full(0.5)
                put3(x, i, lane_matrices.choose3(begins, half, new, get3(x, i, EIGHTS)), EIGHTS)
                put6(p, i, lane_matrices.choose6(begins, half, covariance, get6(p, i, EIGHTS)), EIGHTS)
    return all_run


@kernel_part
def advance(memory, f, dt, design, R):
    """One scan of filter f's estimates, in place; design: what it observes and its packed Q."""
    observes, Q = design
    x, p = filter_rows_address(memory.x, f, 3), filter_rows_address(memory.p, f, 6)
    if observes == 1:
        scan_range(x, p, memory.plots, memory.detected, dt, Q, R)
    else:
        scan_range_velocity(x, p, memory.plots, memory.detected, dt, Q, R)


@kernel_part
def advance_by_gains(memory, f, dt, gain, believed):
    """The same of a filter whose gain (3, 2), and packed covariance (6,) after it, are given."""
    x, p, F = (
        filter_rows_address(memory.x, f, 3),
        filter_rows_address(memory.p, f, 6),
        kalman_algebra.constant_acceleration(dt),
    )
    range_gain, velocity_gain = (gain[0, 0], gain[1, 0], gain[2, 0]), (gain[0, 1], gain[1, 1], gain[2, 1])
    P = full(believed[0]), full(believed[1]), full(believed[2]), full(believed[3]), full(believed[4]), full(believed[5])
    for i in range(EIGHTS):
        state = kalman_algebra.predict_state(get3(x, i, EIGHTS), F)
        r, v = get(memory.plots, i) - state[0], get(memory.plots, EIGHTS + i) - state[1]
        put3(x, i, kalman_algebra.add_scaled(kalman_algebra.add_scaled(state, r, range_gain), v, velocity_gain), EIGHTS)
        put6(p, i, P, EIGHTS)
