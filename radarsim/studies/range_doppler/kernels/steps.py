"""One chunk of realisations, each with filters of its own covariances: its arrays, and their rows as eight lanes.

Covariances are packed, p = (00, 01, 02, 11, 12, 22).

Filters with a covariance to each realisation: a Kalman scan, and the least-squares start while plots are missed.

A filter's start is in the making as the sums of its normal equations, in units of the scan period and with time
counted from the realisation's first plot, so that they are well conditioned however late that comes.

What is drawn of a scan: which realisations have their plot, its noise, biases, and a target's own motion.

Errors of filters with a covariance to each realisation, and their sums over a chunk."""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels import algebra, lanes
from radarsim.kernels.compile import aligned_zeros, inline, part
from radarsim.kernels.lanes import add_totals, address, full, get, get3, get6, put, put3, put6, row, where_greater
from radarsim.kernels.random import fill_normal_pairs

# ---- chunk -----------------------------------------------------------------------------------------------------------
CHUNK = 512  # realisations; a row is 4 KB; fewer, and the calls of its parts cost as much as their work
EIGHTS = CHUNK // lanes.WIDTH


class Work(NamedTuple):
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


def work(filters: int) -> Work:
    """Arrays of one chunk."""
    rows = ((2,), (), (), (), (), (2,), (3,), (6,), (filters, 3), (filters, 6), (filters, 9), *[(filters, 3)] * 2)
    return Work(*(aligned_zeros(*row, CHUNK) for row in rows))


@inline
def places(made):
    """The addresses of the work arrays: parts that are called with arrays count references to each, at every call."""
    return Work(
        address(made.plots),
        address(made.detected),
        address(made.other),
        address(made.count),
        address(made.first),
        address(made.offset),
        address(made.state),
        address(made.shift),
        address(made.x),
        address(made.p),
        address(made.normal),
        address(made.e),
        address(made.has),
    )


@inline
def of_filter(rows, f, each):
    """The address of filter f's rows (each, n) in those of all filters (F, each, n)."""
    return row(rows, f * each * EIGHTS)


# ---- steps -----------------------------------------------------------------------------------------------------------
def scan_of(observes):
    """The kernel of one scan of a filter that observes the range (1), or range and velocity (2)."""

    @part
    def scan(x, p, plots, detected, dt, Q, R):
        """One scan, in place: addresses of x (3, n), p (6, n), plots, detected; Q (6,), R (2,)."""
        F, noise = algebra.constant_acceleration(dt), (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5])
        R_range, R_velocity = R[0], R[1]
        for i in range(EIGHTS):
            state, here = algebra.predicted(get3(x, i, EIGHTS), F), get(detected, i)
            P, gain, _ = algebra.take_value(algebra.predicted_covariance(get6(p, i, EIGHTS), F, noise), R_range, here)
            state = algebra.add_scaled(state, get(plots, i) - state[0], gain)
            if observes == 2:  # one number after the other
                P, gain, _ = algebra.take_rate(P, R_velocity, here)
                state = algebra.add_scaled(state, get(plots, EIGHTS + i) - state[1], gain)
            put3(x, i, state, EIGHTS)
            put6(p, i, P, EIGHTS)

    return scan


scan_range, scan_range_velocity = scan_of(1), scan_of(2)


@inline
def gathered(sums, right, u, weights, plots):
    """The normal equations sums (6) and right-hand side (3) with one plot more, u scan periods after the first.

    The unknowns are range, velocity dt and acceleration dt² at the realisation's first plot; weights are the inverse
    variances of the range and of the velocity times dt, zero where there is none; plots the range and velocity times
    dt."""
    of_range, of_velocity = (1.0, u, 0.5 * u * u), (0.0, 1.0, u)
    sums = algebra.add_outer(algebra.add_outer(sums, weights[0], of_range), weights[1], of_velocity)
    right = algebra.add_scaled(right, weights[0] * plots[0], of_range)
    return sums, algebra.add_scaled(right, weights[1] * plots[1], of_velocity)


@inline
def solved(sums, right, u, dt):
    """State and packed covariance, u scan periods after the first plot, of the normal equations."""
    P, F = algebra.inverse(sums), algebra.constant_acceleration(u)
    r, v, a = algebra.predicted(algebra.times(P, right), F)
    c0, c1, c2, c3, c4, c5 = algebra.predicted_covariance(P, F, algebra.NO_NOISE)
    return (r, v / dt, a / (dt * dt)), (c0, c1 / dt, c2 / dt**2, c3 / dt**2, c4 / dt**3, c5 / dt**4)


@part
def make_starts(at, f, k, start, weights, dt):
    """Scan k of filter f's starts in the making; those whose last plot has come begin. True where none waited."""
    x, p, normal = of_filter(at.x, f, 3), of_filter(at.p, f, 6), of_filter(at.normal, f, 9)
    right, last, one, none = row(normal, 6 * EIGHTS), full(start - 0.5), full(1.0), full(0.0)
    all_run = True
    for i in range(EIGHTS):
        here, count = get(at.detected, i), get(at.count, i)
        if lanes.any_greater(last, count - here):
            all_run = False
            u = float(k) - get(at.first, i)
            of_plot = weights[0] * here, weights[1] * here
            plots = get(at.plots, i), get(at.plots, EIGHTS + i) * dt
            sums, y = gathered(get6(normal, i, EIGHTS), get3(right, i, EIGHTS), u, of_plot, plots)
            put6(normal, i, sums, EIGHTS)
            put3(right, i, y, EIGHTS)
            now = where_greater(count, last, one, none) * where_greater(last, count - here, one, none)
            if lanes.any_greater(now, full(0.5)):
                s0, s1, s2, s3, s4, s5 = sums
                rest = 1.0 - now  # makes the matrices of the others regular
                new, made = solved((s0 + rest, s1, s2, s3 + rest, s4, s5 + rest), y, u, dt)
                half = full(0.5)
                put3(x, i, lanes.choose3(now, half, new, get3(x, i, EIGHTS)), EIGHTS)
                put6(p, i, lanes.choose6(now, half, made, get6(p, i, EIGHTS)), EIGHTS)
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


@part
def advance_given(at, f, dt, gain, believed):
    """The same of a filter whose gain (3, 2), and packed covariance (6,) after it, are given."""
    x, p, F = of_filter(at.x, f, 3), of_filter(at.p, f, 6), algebra.constant_acceleration(dt)
    of_range, of_velocity = (gain[0, 0], gain[1, 0], gain[2, 0]), (gain[0, 1], gain[1, 1], gain[2, 1])
    P = full(believed[0]), full(believed[1]), full(believed[2]), full(believed[3]), full(believed[4]), full(believed[5])
    for i in range(EIGHTS):
        state = algebra.predicted(get3(x, i, EIGHTS), F)
        r, v = get(at.plots, i) - state[0], get(at.plots, EIGHTS + i) - state[1]
        put3(x, i, algebra.add_scaled(algebra.add_scaled(state, r, of_range), v, of_velocity), EIGHTS)
        put6(p, i, P, EIGHTS)


# ---- draws -----------------------------------------------------------------------------------------------------------
@part
def count_plots(at, k, detection, n):
    """Which of the first n realisations have a plot at scan k, by uniform numbers, counted.

    Two scans share a pair of numbers: those of an even scan lie in `detected`, those of the next in `other`."""
    detected, one, none = at.detected, full(1.0), full(0.0)
    if detection == 1.0:
        for i in range(EIGHTS):
            put(detected, i, one)
    else:
        drawn = detected if k % 2 == 0 else at.other
        for i in range(EIGHTS):
            put(detected, i, where_greater(full(detection), get(drawn, i), one, none))
    for i in range(n, CHUNK):
        detected[i] = 0.0
    for i in range(EIGHTS):
        here, count = get(detected, i), get(at.count, i)
        first_one = here * where_greater(one, count, one, none)
        put(at.first, i, where_greater(first_one, none, full(float(k)), get(at.first, i)))
        put(at.count, i, count + here)


@part
def draw_once(keys, first, made, bias, sigma_bias, sigma_flight):
    """Biases and the flight's displacement of realisations first, first + 1, …"""
    fill_normal_pairs(keys[2], first, 0, made.offset[0], made.offset[1])
    for m in range(2):
        for i in range(made.other.size):
            made.offset[m, i] = bias[m] + sigma_bias[m] * made.offset[m, i]
    for c in range(3):
        fill_normal_pairs(keys[2], first, 3 + c, made.shift[2 * c], made.shift[2 * c + 1])
    for c in range(6):
        for i in range(made.other.size):
            made.shift[c, i] = sigma_flight[c] * made.shift[c, i]


@part
def displace(made, flight, truth, t):
    """The difference of the truth (3,) at a time t (s) that the displacement of its flight (9,) makes, into state."""
    shift, state = made.shift, made.state
    for i in range(made.other.size):
        vx, vy, vz = flight[1] + shift[3, i], flight[4] + shift[4, i], flight[7] + shift[5, i]
        x = flight[0] + shift[0, i] + t * shift[3, i]
        y = flight[3] + shift[1, i] + t * shift[4, i]
        z = flight[6] + shift[2, i] + t * shift[5, i]
        r = math.sqrt(x * x + y * y + z * z)
        v = (x * vx + y * vy + z * vz) / r
        pull = x * flight[2] + y * flight[5] + z * flight[8]
        state[0, i], state[1, i] = r - truth[0], v - truth[1]
        state[2, i] = (vx * vx + vy * vy + vz * vz + pull - v * v) / r - truth[2]


@part
def displace_plots(at):
    """Add what was drawn of the truth, and the biases, to the plots."""
    for i in range(2 * EIGHTS):
        put(at.plots, i, get(at.plots, i) + get(at.state, i) + get(at.offset, i))


# ---- scores ----------------------------------------------------------------------------------------------------------
OWN, PAIRED = 24, 24  # numbers that `score` and `pair` add to, of a filter and scan; of the latter 18 are in use


@part
def score(at, f, start, observes, truth, R, found):
    """Errors of filter f, zero where it has no estimate, where it has one, and their sums, added from `found` on.

    e, e², e³, e⁴ of each component; the three products of two; how many have started, q = eᵀP⁻¹e / 3, q²; how many
    have each component; the three believed variances. By the factors L D Lᵀ of P, with one division:
    D = (p₀, m/p₀, w/(p₀m)), m and w the leading minors, w times p₀. All by addresses; truth (3,), R (2,) are arrays."""
    x, p, e, has = of_filter(at.x, f, 3), of_filter(at.p, f, 6), of_filter(at.e, f, 3), of_filter(at.has, f, 3)
    last, one, none = full(start - 0.5), full(1.0), full(0.0)
    of_velocity = 1.0 if observes == 2 else 0.0
    truth_r, truth_v, truth_a, R_r, R_v = truth[0], truth[1], truth[2], R[0], R[1]
    r1 = r2 = r3 = r4 = v1 = v2 = v3 = v4 = a1 = a2 = a3 = a4 = none
    rv = ra = va = started = total = square = have_r = have_v = own_r = own_v = own_a = none
    for i in range(EIGHTS):
        runs = where_greater(get(at.count, i), last, one, none)
        waits = (1.0 - runs) * get(at.detected, i)
        waits_v = of_velocity * waits
        r, v, a = get3(x, i, EIGHTS)
        state_r, state_v, state_a = get3(at.state, i, EIGHTS)
        has_r, has_v = runs + waits, runs + waits_v
        r = runs * r + waits * get(at.plots, i) - has_r * (truth_r + state_r)
        v = runs * v + waits_v * get(at.plots, EIGHTS + i) - has_v * (truth_v + state_v)
        a = runs * (a - (truth_a + state_a))
        put3(e, i, (r, v, a), EIGHTS)
        put3(has, i, (has_r, has_v, runs), EIGHTS)
        rr, vv, aa = r * r, v * v, a * a
        r1, v1, a1 = r1 + r, v1 + v, a1 + a
        r2, v2, a2 = r2 + rr, v2 + vv, a2 + aa
        r3, v3, a3 = r3 + r * rr, v3 + v * vv, a3 + a * aa
        r4, v4, a4 = r4 + rr * rr, v4 + vv * vv, a4 + aa * aa
        rv, ra, va = rv + r * v, ra + r * a, va + v * a
        p0, p1, p2, p3, p4, p5 = get6(p, i, EIGHTS)
        minor, m = p0 * p3 - p1 * p1, p0 * p4 - p1 * p2
        whole = minor * (p0 * p5 - p2 * p2) - m * m
        scale = runs / where_greater(runs, full(0.5), p0 * minor * whole, one)
        b = p0 * v - p1 * r
        c = minor * (p0 * a - p2 * r) - m * b
        q = scale * (whole * (minor * rr + b * b) + c * c) / 3.0
        started, total, square = started + runs, total + q, square + q * q
        have_r, have_v = have_r + has_r, have_v + has_v
        own_r, own_v = own_r + (runs * p0 + waits * R_r), own_v + (runs * p3 + waits_v * R_v)
        own_a = own_a + runs * p5
    add_totals(found, 0, r1, r2, r3, r4)
    add_totals(found, 4, v1, v2, v3, v4)
    add_totals(found, 8, a1, a2, a3, a4)
    add_totals(found, 12, rv, ra, va, started)
    add_totals(found, 16, total, square, have_r, have_v)
    add_totals(found, 20, started, own_r, own_v, own_a)


@part
def pair(at, f, baseline, found):
    """Sums where both filters have a component, added from `found` on: how many, e_f², e_f⁴, e_b², e_b⁴, e_f² e_b²."""
    e, has = of_filter(at.e, f, 3), of_filter(at.has, f, 3)
    e_b, has_b = of_filter(at.e, baseline, 3), of_filter(at.has, baseline, 3)
    none = full(0.0)
    for c in range(3):
        count = own = own_4 = base = base_4 = product = none
        for i in range(c * EIGHTS, (c + 1) * EIGHTS):
            here, here_b, of_f, of_b = get(has, i), get(has_b, i), get(e, i), get(e_b, i)
            one, other = of_f * of_f * here_b, of_b * of_b * here
            count, own, base, product = count + here * here_b, own + one, base + other, product + one * other
            own_4, base_4 = own_4 + one * one, base_4 + other * other
        add_totals(found, 6 * c, count, own, own_4, base)
        add_totals(found, 6 * c + 4, base_4, product, none, none)
