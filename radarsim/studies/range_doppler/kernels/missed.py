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
    each = (filters, scans, 3)
    return {
        "error": (*each, 4),
        "estimates": each,
        "cross": (filters, scans, len(CROSSED)),
        "paired": each,
        "both": (*each, 5),
        "believed": each,
        "nees": each,
    }


@part
def begin_chunk(keys, first, made, bias, sigma_bias, sigma_flight):
    """A new chunk: nothing has come yet, and what is drawn once a realisation is drawn; whether anything is."""
    drawn = np.any(sigma_bias > 0.0) or np.any(sigma_flight > 0.0)
    made.count[:] = 0.0
    made.first[:] = 0.0
    made.x[:] = 0.0
    made.p[:] = 0.0
    made.normal[:] = 0.0
    made.state[:] = 0.0
    for m in range(2):
        made.offset[m, :] = bias[m]
    if drawn:
        draw_once(keys, first, made, bias, sigma_bias, sigma_flight)
    return drawn


@part
def keep_errors(e, has, each):
    """Errors e (F, 3, CHUNK) into each (F, 3, n), not-a-number where there is no estimate."""
    for f in range(each.shape[0]):
        for c in range(3):
            for i in range(each.shape[2]):
                each[f, c, i] = e[f, c, i] if has[f, c, i] > 0.0 else np.nan


@kernel
def add_block(made, first, count, problem, found, each):
    """`simulate_block` for a plain problem, with a chunk's work arrays, into found (F, K, OWN + PAIRED), `errors`
    into each (F, K, 3, count or 0)."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    observes, start, Q, baseline, given, gains, believed = problem[9:]
    filters, scans, R, at, sums = observes.size, truth.shape[0], sigma * sigma, places(made), address(found)
    detected, other, next_word = made.detected, made.other, np.empty(CHUNK, np.uint64)
    running = np.zeros(filters, dtype=np.bool_)  # filters that have started in every realisation of the chunk
    for done in range(0, count, CHUNK):
        # A partial chunk is computed whole, with no plots beyond its end, so each realisation goes through the same
        # instructions.
        n = min(CHUNK, count - done)
        drawn = begin_chunk(keys, first + done, made, bias, sigma_bias, sigma_flight)
        displaced = drawn or np.any(bias != 0.0)
        running[:] = False
        for k in range(scans):
            if drawn and flight.shape[0] > 0:
                displace(made, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, made.plots[0], made.plots[1])
            if displaced:
                displace_plots(at)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, detected, other)
            count_plots(at, k, detection, n)
            for f in range(filters):
                if k > 0 and given[f] == 1:
                    advance_given(at, f, dt, gains[f, k], believed[f, k])
                elif k > 0:
                    advance(at, f, dt, (observes[f], Q[f]), R)
                if not running[f]:
                    weights = 1.0 / R[0], 1.0 / (R[1] * dt * dt) if observes[f] == 2 else 0.0
                    running[f] = make_starts(at, f, k, start[f], weights, dt)
                score(at, f, start[f], observes[f], truth[k], R, row(sums, (f * scans + k) * ROWS))
            for f in range(filters):
                if f != baseline:
                    pair(at, f, baseline, row(sums, (f * scans + k) * ROWS + OWN // lanes.WIDTH))
            if each.shape[3] > 0:
                keep_errors(made.e, made.has, each[:, k, :, done : done + n])


@kernel
def fill_simulated(made, first, problem, plots, displacement):
    """`simulate_plots` into plots (2, K, n); displacement (3, K, n or 0) of the truth; made: work arrays."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    at, next_word = places(made), np.empty(CHUNK, np.uint64)
    for done in range(0, plots.shape[2], CHUNK):
        n = min(CHUNK, plots.shape[2] - done)
        drawn = begin_chunk(keys, first + done, made, bias, sigma_bias, sigma_flight)
        displaced = drawn or np.any(bias != 0.0)
        for k in range(plots.shape[1]):
            if drawn and flight.shape[0] > 0:
                displace(made, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, made.plots[0], made.plots[1])
            if displaced:
                displace_plots(at)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, made.detected, made.other)
            count_plots(at, k, detection, n)
            for m in range(2):
                for i in range(n):
                    plots[m, k, done + i] = made.plots[m, i] if made.detected[i] > 0.0 else np.nan
            if displacement.shape[2] > 0:
                for m in range(displacement.shape[0]):
                    for i in range(n):
                        displacement[m, k, done + i] = made.state[m, i]


def add_found(found: np.ndarray, baseline: int, sums: Sums) -> None:
    """Add what `score` and `pair` found, (F, K, OWN + PAIRED), to the sums."""
    each = (*found.shape[:2], 3)
    error = found[..., :12].reshape(*each, 4)
    estimates = found[..., 18:21]
    pairs = found[..., OWN : OWN + 18].reshape(*each, 6).copy()
    own_2, own_4 = error[baseline, ..., 1], error[baseline, ..., 3]
    pairs[baseline] = np.stack([estimates[baseline], own_2, own_4, own_2, own_4, own_4], axis=-1)
    for total, more in zip(
        sums,
        (error, estimates, found[..., 12:15], pairs[..., 5], pairs[..., :5], found[..., 21:24], found[..., 15:18]),
        strict=True,
    ):
        total += more


def simulate_block(problem: Problem, first: int, count: int, sums: Sums) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add all filters' errors to the sums. The
    arrays of sums are float64 and contiguous. Realisation i has the same plots and estimates in any block."""
    found, _ = simulated(problem, first, count, 0)
    add_found(found, int(problem.baseline), sums)


def errors(problem: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of `simulate_block`; NaN where a filter has no estimate."""
    return simulated(problem, first, count, count)[1].transpose(0, 3, 1, 2)


def simulated(problem: Problem, first: int, count: int, kept: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums (F, K, OWN + PAIRED) of a block, and the errors (F, K, 3, kept) of all its realisations or of none."""
    problem = problem.plain()
    filters, scans = len(problem.observes), len(problem.truth)
    found, each = aligned_zeros(filters, scans, OWN + PAIRED), np.empty((filters, scans, 3, kept))
    add_block(work(filters), int(first), int(count), problem, found, each)
    return found, each


def simulate_plots(problem: Problem, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The plots (count, K, 2) that `simulate_block` draws for realisations first … first + count - 1, not-a-number
    where missed, and the truth (count, K, 3), a view that cannot be written where all have the same."""
    problem, scans = problem.plain(), len(problem.truth)
    several = len(problem.flight) > 0 and problem.sigma_flight.any()
    plots, displacement = np.empty((2, scans, count)), np.empty((3, scans, count if several else 0))
    fill_simulated(work(1), int(first), problem, plots, displacement)
    if several:
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
    state, of = (x[0], x[1], x[2]), (P[0], P[1], P[2], P[3], P[4], P[5])
    for k in range(dt.size):
        F = algebra.constant_acceleration(dt[k])
        state, of = algebra.predicted(state, F), algebra.predicted_covariance(of, F, noise_over(noise, dt[k]))
        for m in range(2):
            if detected[k, m] > 0.0:
                of, gain, S = (
                    algebra.take_value(of, variance[0], 1.0) if m == 0 else algebra.take_rate(of, variance[1], 1.0)
                )
                e = z[k, m] - (state[0] if m == 0 else state[1])
                state, nis[k, m] = algebra.add_scaled(state, e, gain), e * e / S
        estimate[k, 0], estimate[k, 1], estimate[k, 2] = state
        spread[k, 0], spread[k, 1], spread[k, 2] = of[0] ** 0.5, of[3] ** 0.5, of[5] ** 0.5
    x[0], x[1], x[2] = state
    P[0], P[1], P[2], P[3], P[4], P[5] = of
