"""Filters with a covariance to each realisation: a Kalman scan, and the least-squares start while plots are missed.

A filter's start is in the making as the sums of its normal equations, in units of the scan period and with time
counted from the realisation's first plot, so that they are well conditioned however late that comes.
"""

from radarsim.kernels.algebra import (
    NO_NOISE,
    add_outer,
    add_scaled,
    constant_acceleration,
    inverse,
    predicted,
    predicted_covariance,
    take_rate,
    take_value,
    times,
)
from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import any_greater, choose3, choose6, full, get, get3, get6, put3, put6, row, where_greater
from radarsim.studies.range_doppler.kernels.chunk import EIGHTS, of_filter


def scan_of(observes):
    """The kernel of one scan of a filter that observes the range (1), or range and velocity (2)."""

    @part
    def scan(x, p, plots, detected, dt, Q, R):
        """One scan, in place: addresses of x (3, n), p (6, n), plots, detected; Q (6,), R (2,)."""
        F, noise = constant_acceleration(dt), (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5])
        R_range, R_velocity = R[0], R[1]
        for i in range(EIGHTS):
            state, here = predicted(get3(x, i, EIGHTS), F), get(detected, i)
            P, gain, _ = take_value(predicted_covariance(get6(p, i, EIGHTS), F, noise), R_range, here)
            state = add_scaled(state, get(plots, i) - state[0], gain)
            if observes == 2:  # one number after the other
                P, gain, _ = take_rate(P, R_velocity, here)
                state = add_scaled(state, get(plots, EIGHTS + i) - state[1], gain)
            put3(x, i, state, EIGHTS)
            put6(p, i, P, EIGHTS)

    return scan


scan_range, scan_range_velocity = scan_of(1), scan_of(2)


@inline
def gathered(sums, right, u, weights, plots):
    """The normal equations sums (6) and right-hand side (3) with one plot more, u scan periods after the first.

    The unknowns are range, velocity dt and acceleration dt² at the realisation's first plot; weights are the inverse
    variances of the range and of the velocity times dt, zero where there is none; plots the range and velocity times
    dt.
    """
    of_range, of_velocity = (1.0, u, 0.5 * u * u), (0.0, 1.0, u)
    sums = add_outer(add_outer(sums, weights[0], of_range), weights[1], of_velocity)
    right = add_scaled(right, weights[0] * plots[0], of_range)
    return sums, add_scaled(right, weights[1] * plots[1], of_velocity)


@inline
def solved(sums, right, u, dt):
    """State and packed covariance, u scan periods after the first plot, of the normal equations."""
    P, F = inverse(sums), constant_acceleration(u)
    r, v, a = predicted(times(P, right), F)
    c0, c1, c2, c3, c4, c5 = predicted_covariance(P, F, NO_NOISE)
    return (r, v / dt, a / (dt * dt)), (c0, c1 / dt, c2 / dt**2, c3 / dt**2, c4 / dt**3, c5 / dt**4)


@part
def make_starts(at, f, k, start, weights, dt):
    """Scan k of filter f's starts in the making; those whose last plot has come begin. True where none waited."""
    x, p, normal = of_filter(at.x, f, 3), of_filter(at.p, f, 6), of_filter(at.normal, f, 9)
    right, last, one, none = row(normal, 6 * EIGHTS), full(start - 0.5), full(1.0), full(0.0)
    all_run = True
    for i in range(EIGHTS):
        here, count = get(at.detected, i), get(at.count, i)
        if any_greater(last, count - here):
            all_run = False
            u = float(k) - get(at.first, i)
            of_plot = weights[0] * here, weights[1] * here
            plots = get(at.plots, i), get(at.plots, EIGHTS + i) * dt
            sums, y = gathered(get6(normal, i, EIGHTS), get3(right, i, EIGHTS), u, of_plot, plots)
            put6(normal, i, sums, EIGHTS)
            put3(right, i, y, EIGHTS)
            now = where_greater(count, last, one, none) * where_greater(last, count - here, one, none)
            if any_greater(now, full(0.5)):
                s0, s1, s2, s3, s4, s5 = sums
                rest = 1.0 - now  # makes the matrices of the others regular
                new, made = solved((s0 + rest, s1, s2, s3 + rest, s4, s5 + rest), y, u, dt)
                half = full(0.5)
                put3(x, i, choose3(now, half, new, get3(x, i, EIGHTS)), EIGHTS)
                put6(p, i, choose6(now, half, made, get6(p, i, EIGHTS)), EIGHTS)
    return all_run


@part
def advance(at, f, dt, design, R):
    """One scan of filter f's estimates, in place; design: what it observes and its packed Q."""
    observes, Q = design
    x, p = of_filter(at.x, f, 3), of_filter(at.p, f, 6)
    if observes == 1:
        scan_range(x, p, at.plots, at.detected, dt, Q, R)
    else:
        scan_range_velocity(x, p, at.plots, at.detected, dt, Q, R)
