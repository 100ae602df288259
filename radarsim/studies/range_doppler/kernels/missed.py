"""P1's filters where plots may be missed or biased, or the target's start is drawn: a covariance to each realisation.

Realisations lie in chunks that stay in cache, scans outermost; eight of them go through a formula at once. Where a plot
is missed a filter extrapolates. It starts with as many plots as its least-squares start takes; before, its estimates
are the plots that come, of what it observes, and at a scan without one it has none.

Covariances are packed, p = (00, 01, 02, 11, 12, 22).

A filter's start is in the making as the sums of its normal equations, in units of the scan period and with time
counted from the realisation's first plot, so that they are well conditioned however late that comes."""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels import algebra, lanes
from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.lanes import add_totals, address, full, get, get3, get6, put, put3, put6, row, where_greater
from radarsim.kernels.linear import CROSSED, as_taken, fill_plots
from radarsim.kernels.random import fill_normal_pairs, fill_uniform_pairs

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
def places(arrays):
    """The addresses of the work arrays: parts that are called with arrays count references to each, at every call."""
    return Work(
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
def of_filter(rows, f, rows_per_filter):
    """The address of a filter's rows in those of all filters (F, rows_per_filter, n)."""
    return row(rows, f * rows_per_filter * EIGHTS)


# ---- steps -----------------------------------------------------------------------------------------------------------
def scan_of(observes):
    """The kernel of one scan of a filter that observes the range (1), or range and velocity (2)."""

    @part
    def scan(x, p, plots, detected, dt, Q, R):
        """One scan, in place: addresses of x (3, n), p (6, n), plots, detected; Q (6,), R (2,)."""
        F, noise = algebra.constant_acceleration(dt), (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5])
        R_range, R_velocity = R[0], R[1]
        for i in range(EIGHTS):
            state, present = algebra.predicted(get3(x, i, EIGHTS), F), get(detected, i)
            P, gain, _ = algebra.take_value(
                algebra.predicted_covariance(get6(p, i, EIGHTS), F, noise), R_range, present
            )
            state = algebra.add_scaled(state, get(plots, i) - state[0], gain)
            if observes == 2:  # one number after the other
                P, gain, _ = algebra.take_rate(P, R_velocity, present)
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
    range_row, velocity_row = (1.0, u, 0.5 * u * u), (0.0, 1.0, u)
    sums = algebra.add_outer(algebra.add_outer(sums, weights[0], range_row), weights[1], velocity_row)
    right = algebra.add_scaled(right, weights[0] * plots[0], range_row)
    return sums, algebra.add_scaled(right, weights[1] * plots[1], velocity_row)


@inline
def solved(sums, right, u, dt):
    """State and packed covariance, u scan periods after the first plot, of the normal equations."""
    P, F = algebra.inverse(sums), algebra.constant_acceleration(u)
    r, v, a = algebra.predicted(algebra.times(P, right), F)
    c0, c1, c2, c3, c4, c5 = algebra.predicted_covariance(P, F, algebra.NO_NOISE)
    return (r, v / dt, a / (dt * dt)), (c0, c1 / dt, c2 / dt**2, c3 / dt**2, c4 / dt**3, c5 / dt**4)


@part
def make_starts(memory, f, k, start, weights, dt):
    """Scan k of filter f's starts in the making; those whose last plot has come begin. True where none waited."""
    x, p, normal = of_filter(memory.x, f, 3), of_filter(memory.p, f, 6), of_filter(memory.normal, f, 9)
    right, last_start_plot, ones, zeros = row(normal, 6 * EIGHTS), full(start - 0.5), full(1.0), full(0.0)
    all_run = True
    for i in range(EIGHTS):
        present, count = get(memory.detected, i), get(memory.count, i)
        if lanes.any_greater(last_start_plot, count - present):
            all_run = False
            u = float(k) - get(memory.first, i)
            plot_weights = weights[0] * present, weights[1] * present
            plots = get(memory.plots, i), get(memory.plots, EIGHTS + i) * dt
            sums, y = gathered(get6(normal, i, EIGHTS), get3(right, i, EIGHTS), u, plot_weights, plots)
            put6(normal, i, sums, EIGHTS)
            put3(right, i, y, EIGHTS)
            begins = where_greater(count, last_start_plot, ones, zeros) * where_greater(
                last_start_plot, count - present, ones, zeros
            )
            if lanes.any_greater(begins, full(0.5)):
                s0, s1, s2, s3, s4, s5 = sums
                continues = 1.0 - begins  # makes the matrices of the others regular
                new, covariance = solved((s0 + continues, s1, s2, s3 + continues, s4, s5 + continues), y, u, dt)
                half = full(0.5)
                put3(x, i, lanes.choose3(begins, half, new, get3(x, i, EIGHTS)), EIGHTS)
                put6(p, i, lanes.choose6(begins, half, covariance, get6(p, i, EIGHTS)), EIGHTS)
    return all_run


@part
def advance(memory, f, dt, design, R):
    """One scan of filter f's estimates, in place; design: what it observes and its packed Q."""
    observes, Q = design
    x, p = of_filter(memory.x, f, 3), of_filter(memory.p, f, 6)
    if observes == 1:
        scan_range(x, p, memory.plots, memory.detected, dt, Q, R)
    else:
        scan_range_velocity(x, p, memory.plots, memory.detected, dt, Q, R)


@part
def advance_given(memory, f, dt, gain, believed):
    """The same of a filter whose gain (3, 2), and packed covariance (6,) after it, are given."""
    x, p, F = of_filter(memory.x, f, 3), of_filter(memory.p, f, 6), algebra.constant_acceleration(dt)
    range_gain, velocity_gain = (gain[0, 0], gain[1, 0], gain[2, 0]), (gain[0, 1], gain[1, 1], gain[2, 1])
    P = full(believed[0]), full(believed[1]), full(believed[2]), full(believed[3]), full(believed[4]), full(believed[5])
    for i in range(EIGHTS):
        state = algebra.predicted(get3(x, i, EIGHTS), F)
        r, v = get(memory.plots, i) - state[0], get(memory.plots, EIGHTS + i) - state[1]
        put3(x, i, algebra.add_scaled(algebra.add_scaled(state, r, range_gain), v, velocity_gain), EIGHTS)
        put6(p, i, P, EIGHTS)


# ---- draws -----------------------------------------------------------------------------------------------------------
@part
def count_plots(memory, k, detection, n):
    """Which of the first n realisations have a plot at scan k, by uniform numbers, counted.

    Two scans share a pair of numbers: those of an even scan lie in `detected`, those of the next in `other`."""
    detected, ones, zeros = memory.detected, full(1.0), full(0.0)
    if detection == 1.0:
        for i in range(EIGHTS):
            put(detected, i, ones)
    else:
        uniforms = detected if k % 2 == 0 else memory.other
        for i in range(EIGHTS):
            put(detected, i, where_greater(full(detection), get(uniforms, i), ones, zeros))
    for i in range(n, CHUNK):
        detected[i] = 0.0
    for i in range(EIGHTS):
        present, count = get(detected, i), get(memory.count, i)
        is_first = present * where_greater(ones, count, ones, zeros)
        put(memory.first, i, where_greater(is_first, zeros, full(float(k)), get(memory.first, i)))
        put(memory.count, i, count + present)


@part
def draw_once(keys, first, arrays, bias, sigma_bias, sigma_flight):
    """Biases and the flight's displacement of realisations first, first + 1, …"""
    fill_normal_pairs(keys[2], first, 0, arrays.offset[0], arrays.offset[1])
    for m in range(2):
        for i in range(arrays.other.size):
            arrays.offset[m, i] = bias[m] + sigma_bias[m] * arrays.offset[m, i]
    for c in range(3):
        fill_normal_pairs(keys[2], first, 3 + c, arrays.shift[2 * c], arrays.shift[2 * c + 1])
    for c in range(6):
        for i in range(arrays.other.size):
            arrays.shift[c, i] = sigma_flight[c] * arrays.shift[c, i]


@part
def displace(arrays, flight, truth, t):
    """The difference of the truth (3,) at a time t (s) that the displacement of its flight (9,) makes, into state."""
    shift, state = arrays.shift, arrays.state
    for i in range(arrays.other.size):
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
def displace_plots(memory):
    """Add what was drawn of the truth, and the biases, to the plots."""
    for i in range(2 * EIGHTS):
        put(memory.plots, i, get(memory.plots, i) + get(memory.state, i) + get(memory.offset, i))


# ---- scores ----------------------------------------------------------------------------------------------------------
OWN, PAIRED = 24, 24  # numbers that `score` and `pair` add to, of a filter and scan; of the latter 18 are in use


@part
def score(memory, f, start, observes, truth, R, sums):
    """Errors of filter f, zero where it has no estimate, where it has one, and their sums, added from `sums` on.

    e, e², e³, e⁴ of each component; the three products of two; how many have started, q = eᵀP⁻¹e / 3, q²; how many
    have each component; the three believed variances. By the factors L D Lᵀ of P, with one division:
    D = (p₀, m/p₀, w/(p₀m)), m and w the leading minors, w times p₀. All by addresses; truth (3,), R (2,) are arrays."""
    x, p, e, has = (
        of_filter(memory.x, f, 3),
        of_filter(memory.p, f, 6),
        of_filter(memory.e, f, 3),
        of_filter(memory.has, f, 3),
    )
    last_start_plot, ones, zeros = full(start - 0.5), full(1.0), full(0.0)
    observes_velocity = 1.0 if observes == 2 else 0.0
    truth_r, truth_v, truth_a, R_r, R_v = truth[0], truth[1], truth[2], R[0], R[1]
    r1 = r2 = r3 = r4 = v1 = v2 = v3 = v4 = a1 = a2 = a3 = a4 = zeros
    rv = ra = va = started = total = square = have_r = have_v = believed_r = believed_v = believed_a = zeros
    for i in range(EIGHTS):
        runs = where_greater(get(memory.count, i), last_start_plot, ones, zeros)
        waits = (1.0 - runs) * get(memory.detected, i)
        waits_v = observes_velocity * waits
        r, v, a = get3(x, i, EIGHTS)
        state_r, state_v, state_a = get3(memory.state, i, EIGHTS)
        has_r, has_v = runs + waits, runs + waits_v
        r = runs * r + waits * get(memory.plots, i) - has_r * (truth_r + state_r)
        v = runs * v + waits_v * get(memory.plots, EIGHTS + i) - has_v * (truth_v + state_v)
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
        scaled_determinant = minor * (p0 * p5 - p2 * p2) - m * m
        scale = runs / where_greater(runs, full(0.5), p0 * minor * scaled_determinant, ones)
        b = p0 * v - p1 * r
        c = minor * (p0 * a - p2 * r) - m * b
        q = scale * (scaled_determinant * (minor * rr + b * b) + c * c) / 3.0
        started, total, square = started + runs, total + q, square + q * q
        have_r, have_v = have_r + has_r, have_v + has_v
        believed_r, believed_v = believed_r + (runs * p0 + waits * R_r), believed_v + (runs * p3 + waits_v * R_v)
        believed_a = believed_a + runs * p5
    add_totals(sums, 0, r1, r2, r3, r4)
    add_totals(sums, 4, v1, v2, v3, v4)
    add_totals(sums, 8, a1, a2, a3, a4)
    add_totals(sums, 12, rv, ra, va, started)
    add_totals(sums, 16, total, square, have_r, have_v)
    add_totals(sums, 20, started, believed_r, believed_v, believed_a)


@part
def pair(memory, f, baseline, sums):
    """Sums where both filters have a component, added from `sums` on: how many, e_f², e_f⁴, e_b², e_b⁴, e_f² e_b²."""
    e, has = of_filter(memory.e, f, 3), of_filter(memory.has, f, 3)
    e_b, has_b = of_filter(memory.e, baseline, 3), of_filter(memory.has, baseline, 3)
    zeros = full(0.0)
    for c in range(3):
        count = squares = fourth_powers = base_squares = base_fourth_powers = product = zeros
        for i in range(c * EIGHTS, (c + 1) * EIGHTS):
            present, present_b, error_f, error_b = get(has, i), get(has_b, i), get(e, i), get(e_b, i)
            square, base_square = error_f * error_f * present_b, error_b * error_b * present
            count, squares, base_squares, product = (
                count + present * present_b,
                squares + square,
                base_squares + base_square,
                product + square * base_square,
            )
            fourth_powers, base_fourth_powers = (
                fourth_powers + square * square,
                base_fourth_powers + base_square * base_square,
            )
        add_totals(sums, 6 * c, count, squares, fourth_powers, base_squares)
        add_totals(sums, 6 * c + 4, base_fourth_powers, product, zeros, zeros)


# ---- block -----------------------------------------------------------------------------------------------------------
ROWS = (OWN + PAIRED) // lanes.WIDTH  # of what is found of a filter and scan


class Problem(NamedTuple):
    """What is simulated: the truth and its plots over K scans, and the F filters that see them."""

    keys: np.ndarray  #: (3, 2) of the streams of noise, of misses, and of what is drawn once a realisation
    truth: np.ndarray  #: (K, 3) range, radial velocity and acceleration
    sigma: np.ndarray  #: (2,) standard deviations of the plots' range and velocity
    bias: np.ndarray  #: (2,) their mean errors
    sigma_bias: np.ndarray  #: (2,) standard deviations of the errors that are drawn once a realisation
    #: (6,) standard deviations of x, y, z and of vx, vy, vz at the first scan of a flight in space, drawn once a
    #: realisation
    sigma_flight: np.ndarray
    #: (K or 0, 9) that flight, (x, vx, ax, y, …), of which truth is the motion in range; none: not drawn
    flight: np.ndarray
    detection: float  #: probability that a scan has its plot
    dt: float  #: scan period, s
    observes: np.ndarray  #: (F,) 1: the filter observes the range alone; 2: range and velocity
    start: np.ndarray  #: (F,) plots in its least-squares start
    Q: np.ndarray  #: (F, 6) covariance that a scan adds, packed
    baseline: int  #: the filter that others are compared with
    given: np.ndarray  #: (F,) 1: its gains are given, and every scan has its plot; else 0
    gains: np.ndarray  #: (F, K, 3, 2) of such a filter, not read of others
    believed: np.ndarray  #: (F, K, 6) the covariance that it believes with them, packed

    def plain(self) -> "Problem":
        """The same with arrays and numbers as the kernels take them."""
        return as_taken(self)


class Sums(NamedTuple):
    """Sums over realisations of the errors e = estimate − truth, where a filter has an estimate."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴
    estimates: np.ndarray  #: (F, K, 3) how many there are
    cross: np.ndarray  #: (F, K, 3) the products of two components' errors, as in `kernels.linear`
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's e², where both have an estimate
    both: np.ndarray  #: (F, K, 3, 5) where both have one: how many, e², e⁴, and the same two of the baseline
    believed: np.ndarray  #: (F, K, 3) the variances that the filter believes
    nees: np.ndarray  #: (F, K, 3) where it has started: their number, q = eᵀP⁻¹e / 3, q²


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    rows = (filters, scans, 3)
    return {
        "error": (*rows, 4),
        "estimates": rows,
        "cross": (filters, scans, len(CROSSED)),
        "paired": rows,
        "both": (*rows, 5),
        "believed": rows,
        "nees": rows,
    }


@part
def begin_chunk(keys, first, arrays, bias, sigma_bias, sigma_flight):
    """A new chunk: nothing has come yet, and what is drawn once a realisation is drawn; whether anything is."""
    has_random_offsets = np.any(sigma_bias > 0.0) or np.any(sigma_flight > 0.0)
    arrays.count[:] = 0.0
    arrays.first[:] = 0.0
    arrays.x[:] = 0.0
    arrays.p[:] = 0.0
    arrays.normal[:] = 0.0
    arrays.state[:] = 0.0
    for m in range(2):
        arrays.offset[m, :] = bias[m]
    if has_random_offsets:
        draw_once(keys, first, arrays, bias, sigma_bias, sigma_flight)
    return has_random_offsets


@part
def keep_errors(e, has, errors):
    """Errors e (F, 3, CHUNK) into errors (F, 3, n), not-a-number where there is no estimate."""
    for f in range(errors.shape[0]):
        for c in range(3):
            for i in range(errors.shape[2]):
                errors[f, c, i] = e[f, c, i] if has[f, c, i] > 0.0 else np.nan


@kernel
def add_block(arrays, first, count, problem, block_sums, errors):
    """`simulate_block` for a plain problem, with a chunk's work arrays, into block_sums (F, K, OWN +
    PAIRED), and into errors (F, K, 3, count or 0)."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    observes, start, Q, baseline, has_given_gains, gains, believed = problem[9:]
    filters, scans, R, memory, sums = observes.size, truth.shape[0], sigma * sigma, places(arrays), address(block_sums)
    detected, second_uniforms, next_word = arrays.detected, arrays.other, np.empty(CHUNK, np.uint64)
    running = np.zeros(filters, dtype=np.bool_)  # filters that have started in every realisation of the chunk
    for done in range(0, count, CHUNK):
        # A partial chunk is computed whole, with no plots beyond its end, so each realisation goes through the same
        # instructions.
        n = min(CHUNK, count - done)
        has_random_offsets = begin_chunk(keys, first + done, arrays, bias, sigma_bias, sigma_flight)
        displaced = has_random_offsets or np.any(bias != 0.0)
        running[:] = False
        for k in range(scans):
            if has_random_offsets and flight.shape[0] > 0:
                displace(arrays, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, arrays.plots[0], arrays.plots[1])
            if displaced:
                displace_plots(memory)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, detected, second_uniforms)
            count_plots(memory, k, detection, n)
            for f in range(filters):
                if k > 0 and has_given_gains[f] == 1:
                    advance_given(memory, f, dt, gains[f, k], believed[f, k])
                elif k > 0:
                    advance(memory, f, dt, (observes[f], Q[f]), R)
                if not running[f]:
                    weights = 1.0 / R[0], 1.0 / (R[1] * dt * dt) if observes[f] == 2 else 0.0
                    running[f] = make_starts(memory, f, k, start[f], weights, dt)
                score(memory, f, start[f], observes[f], truth[k], R, row(sums, (f * scans + k) * ROWS))
            for f in range(filters):
                if f != baseline:
                    pair(memory, f, baseline, row(sums, (f * scans + k) * ROWS + OWN // lanes.WIDTH))
            if errors.shape[3] > 0:
                keep_errors(arrays.e, arrays.has, errors[:, k, :, done : done + n])


@kernel
def fill_simulated(arrays, first, problem, plots, displacement):
    """`simulate_plots` into plots (2, K, n); displacement (3, K, n or 0) of the truth; arrays: the work arrays."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    memory, next_word = places(arrays), np.empty(CHUNK, np.uint64)
    for done in range(0, plots.shape[2], CHUNK):
        n = min(CHUNK, plots.shape[2] - done)
        has_random_offsets = begin_chunk(keys, first + done, arrays, bias, sigma_bias, sigma_flight)
        displaced = has_random_offsets or np.any(bias != 0.0)
        for k in range(plots.shape[1]):
            if has_random_offsets and flight.shape[0] > 0:
                displace(arrays, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, arrays.plots[0], arrays.plots[1])
            if displaced:
                displace_plots(memory)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, arrays.detected, arrays.other)
            count_plots(memory, k, detection, n)
            for m in range(2):
                for i in range(n):
                    plots[m, k, done + i] = arrays.plots[m, i] if arrays.detected[i] > 0.0 else np.nan
            if displacement.shape[2] > 0:
                for m in range(displacement.shape[0]):
                    for i in range(n):
                        displacement[m, k, done + i] = arrays.state[m, i]


def add_found(block_sums: np.ndarray, baseline: int, sums: Sums) -> None:
    """Add the sums of `score` and `pair`, (F, K, OWN + PAIRED), to those of the problem."""
    rows = (*block_sums.shape[:2], 3)
    error = block_sums[..., :12].reshape(*rows, 4)
    estimates = block_sums[..., 18:21]
    pairs = block_sums[..., OWN : OWN + 18].reshape(*rows, 6).copy()
    squares, fourth_powers = error[baseline, ..., 1], error[baseline, ..., 3]
    pairs[baseline] = np.stack(
        [estimates[baseline], squares, fourth_powers, squares, fourth_powers, fourth_powers], axis=-1
    )
    for total, addend in zip(
        sums,
        (
            error,
            estimates,
            block_sums[..., 12:15],
            pairs[..., 5],
            pairs[..., :5],
            block_sums[..., 21:24],
            block_sums[..., 15:18],
        ),
        strict=True,
    ):
        total += addend


def simulate_block(problem: Problem, first: int, count: int, sums: Sums) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add all filters' errors to the sums. The
    arrays of sums are float64 and contiguous. Realisation i has the same plots and estimates in any block."""
    block_sums, _ = simulated(problem, first, count, 0)
    add_found(block_sums, int(problem.baseline), sums)


def errors(problem: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of `simulate_block`; NaN where a filter has no estimate."""
    return simulated(problem, first, count, count)[1].transpose(0, 3, 1, 2)


def simulated(problem: Problem, first: int, count: int, error_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums (F, K, OWN + PAIRED) of a block, and the errors (F, K, 3, error_count) of all realisations or none."""
    problem = problem.plain()
    filters, scans = len(problem.observes), len(problem.truth)
    block_sums, errors = aligned_zeros(filters, scans, OWN + PAIRED), np.empty((filters, scans, 3, error_count))
    add_block(work(filters), int(first), int(count), problem, block_sums, errors)
    return block_sums, errors


def simulate_plots(problem: Problem, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The plots (count, K, 2) that `simulate_block` draws for realisations first … first + count - 1, not-a-number
    where missed, and the truth (count, K, 3), a view that cannot be written where all have the same."""
    problem, scans = problem.plain(), len(problem.truth)
    is_random = len(problem.flight) > 0 and problem.sigma_flight.any()
    plots, displacement = np.empty((2, scans, count)), np.empty((3, scans, count if is_random else 0))
    fill_simulated(work(1), int(first), problem, plots, displacement)
    if is_random:
        displacement += problem.truth.T[:, :, None]
        return plots.transpose(2, 1, 0), displacement.transpose(2, 1, 0)
    return plots.transpose(2, 1, 0), np.broadcast_to(problem.truth, (count, scans, 3))


# ---- a recorded track, at uneven times with missing values: one row after the other ----------------------------------
@inline
def noise_over(noise, t):
    """Q, packed, over a time t (s), of the coefficients (2, 6) that `filters.noise_by_time` gives."""
    t2, a, b = t * t, noise[0], noise[1]
    t3 = t2 * t
    return (
        (a[0] + b[0] * t) * (t3 * t2),
        (a[1] + b[1] * t) * (t2 * t2),
        (a[2] + b[2] * t) * t3,
        (a[3] + b[3] * t) * t3,
        (a[4] + b[4] * t) * t2,
        (a[5] + b[5] * t) * t,
    )


@kernel
def filter_rows(x, P, dt, z, detected, variance, noise, estimate, spread, nis):
    """Go through n rows: state x (3,), its packed covariance P (6,) before the first of them, in place.

    dt (n,) s since the row before; z (n, 2) value and rate, detected (n, 2) 1 where the filter takes it, else 0;
    variance (2,) of the plots; noise (2, 6) as in `noise_over`. Out: estimate (n, 3), spread (n, 3) the believed
    standard deviations, nis (n, 2) the squared innovation over its variance, where the number came."""
    state, covariance = (x[0], x[1], x[2]), (P[0], P[1], P[2], P[3], P[4], P[5])
    for k in range(dt.size):
        F = algebra.constant_acceleration(dt[k])
        state, covariance = (
            algebra.predicted(state, F),
            algebra.predicted_covariance(covariance, F, noise_over(noise, dt[k])),
        )
        for m in range(2):
            if detected[k, m] > 0.0:
                covariance, gain, S = (
                    algebra.take_value(covariance, variance[0], 1.0)
                    if m == 0
                    else algebra.take_rate(covariance, variance[1], 1.0)
                )
                e = z[k, m] - (state[0] if m == 0 else state[1])
                state, nis[k, m] = algebra.add_scaled(state, e, gain), e * e / S
        estimate[k, 0], estimate[k, 1], estimate[k, 2] = state
        spread[k, 0], spread[k, 1], spread[k, 2] = covariance[0] ** 0.5, covariance[3] ** 0.5, covariance[5] ** 0.5
    x[0], x[1], x[2] = state
    P[0], P[1], P[2], P[3], P[4], P[5] = covariance
