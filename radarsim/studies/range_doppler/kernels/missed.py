"""P1's filters where plots may be missed or biased, or the target's start is drawn: a covariance to each realisation.

Realisations lie in chunks that stay in cache, scans outermost, one plain loop over the chunk per formula, as in
`kernels.linear`. Where a plot is missed a filter extrapolates. It starts with as many plots as its least-squares start
takes; before, its estimates are the plots that come, of what it observes, and at a scan without one it has none.

A filter's start is in the making as the sums of its normal equations, in units of the scan period and with time
counted from the realisation's first plot, so that they are well conditioned however late that comes.

Covariances are packed, p = (00, 01, 02, 11, 12, 22).
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel, part, summing
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, where_greater
from radarsim.kernels.linear import CROSSED, extrapolated, fill_plots, moments, plain, products_of_squares
from radarsim.kernels.random import fill_normal_pairs, fill_uniform_pairs

CHUNK = 1024  # realisations; a row is 8 KB; fewer, and the calls of its parts cost as much as their work
EIGHTS = CHUNK // WIDTH  # the vectoriser gives up on so many rows at once, so they go by lanes


class Problem(NamedTuple):
    """What is simulated: the truth and its plots over K scans, and the F filters that see them.

    keys         (3, 2)        of the streams of noise, of misses, and of what is drawn once a realisation
    truth        (K, 3)        range, radial velocity and acceleration
    sigma        (2,)          standard deviations of the plots' range and velocity
    bias         (2,)          their mean errors
    sigma_bias   (2,)          standard deviations of the errors that are drawn once a realisation
    sigma_state  (3,)          standard deviations of the differences from the truth's first range, velocity and
                               acceleration, drawn once a realisation
    sigma_flight (6,)          standard deviations of x, y, z and of vx, vy, vz at the first scan of a flight in space,
                               drawn once a realisation
    flight       (K or 0, 9)   that flight, (x, vx, ax, y, …), of which truth is the motion in range; none: not drawn
    detection                  probability that a scan has its plot
    dt                         scan period, s
    observes     (F,)          1: the filter observes the range alone; 2: range and velocity
    start        (F,)          plots in its least-squares start
    Q            (F, 6)        covariance that a scan adds, packed
    baseline                   the filter that others are compared with
    """

    keys: np.ndarray
    truth: np.ndarray
    sigma: np.ndarray
    bias: np.ndarray
    sigma_bias: np.ndarray
    sigma_state: np.ndarray
    sigma_flight: np.ndarray
    flight: np.ndarray
    detection: float
    dt: float
    observes: np.ndarray
    start: np.ndarray
    Q: np.ndarray
    baseline: int

    def plain(self) -> "Problem":
        """The same with arrays and numbers as the kernels take them."""
        filters, scans = len(self.observes), len(self.truth)
        return Problem(
            plain(self.keys, 3, 2, dtype=np.uint64),
            plain(self.truth, scans, 3),
            plain(self.sigma, 2),
            plain(self.bias, 2),
            plain(self.sigma_bias, 2),
            plain(self.sigma_state, 3),
            plain(self.sigma_flight, 6),
            plain(self.flight, len(self.flight), 9),
            float(self.detection),
            float(self.dt),
            plain(self.observes, filters, dtype=np.int64),
            plain(self.start, filters, dtype=np.int64),
            plain(self.Q, filters, 6),
            int(self.baseline),
        )


class Sums(NamedTuple):
    """Sums over realisations of the errors e = estimate − truth, where a filter has an estimate.

    error      (F, K, 3, 4)  e, e², e³, e⁴
    estimates  (F, K, 3)     how many there are
    cross      (F, K, 3)     the products of two components' errors, as in `kernels.linear`
    paired     (F, K, 3)     e² times the baseline's e², where both have an estimate
    both       (F, K, 3, 5)  where both have one: how many, e², e⁴, and the same two of the baseline
    believed   (F, K, 3)     the variances that the filter believes
    nees       (F, K, 3)     where it has started: their number, q = eᵀP⁻¹e / 3, q²
    """

    error: np.ndarray
    estimates: np.ndarray
    cross: np.ndarray
    paired: np.ndarray
    both: np.ndarray
    believed: np.ndarray
    nees: np.ndarray


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


class Work(NamedTuple):
    """Arrays of one chunk of n realisations.

    plots (2, n) range and velocity; detected (n,) 1 where the scan has a plot; other (n,) for the pair of numbers drawn
    with it; count (n,) plots so far; first (n,) the scan of the first; offset (2, n) the biases; state (3, n) the drawn
    difference of the truth, moved on; shift (6, n) the displacement that is drawn of a flight; x (F, 3, n) and
    p (F, 6, n) of filters that have started; normal (F, 9, n) the sums of the starts in the making, six of the matrix
    and three of the right-hand side; e (F, 3, n) errors, zero where there is no estimate; has (F, 3, n) 1 where there
    is one, v (F, 3, n) its believed variance.
    """

    plots: np.ndarray
    detected: np.ndarray
    other: np.ndarray
    count: np.ndarray
    first: np.ndarray
    offset: np.ndarray
    state: np.ndarray
    shift: np.ndarray
    x: np.ndarray
    p: np.ndarray
    normal: np.ndarray
    e: np.ndarray
    has: np.ndarray
    v: np.ndarray


def work(filters: int) -> Work:
    """Arrays of one chunk."""
    rows = ((2,), (), (), (), (), (2,), (3,), (6,), (filters, 3), (filters, 6), (filters, 9), *[(filters, 3)] * 3)
    return Work(*(aligned_zeros(*row, CHUNK) for row in rows))


@inline
def inverted(p):
    """The inverse of a symmetric positive 3 x 3 matrix, both packed, by its factors L D Lᵀ.

    Scaled rows and columns give the same digits, so that units do not matter.
    """
    l10, l20 = p[1] / p[0], p[2] / p[0]
    d1 = p[3] - l10 * p[1]
    m = p[4] - l10 * p[2]
    l21 = m / d1
    d2 = p[5] - l20 * p[2] - l21 * m
    i0, i1, i2 = 1.0 / p[0], 1.0 / d1, 1.0 / d2
    a = l10 * l21 - l20  # L⁻¹ = [[1, 0, 0], [−l10, 1, 0], [a, −l21, 1]]
    return (
        i0 + l10 * l10 * i1 + a * a * i2,
        -l10 * i1 - a * l21 * i2,
        a * i2,
        i1 + l21 * l21 * i2,
        -l21 * i2,
        i2,
    )


@inline
def transported(p, dt):
    """F P Fᵀ of a packed P over a time dt."""
    h = 0.5 * dt * dt
    a0, a1, a2 = p[0] + dt * p[1] + h * p[2], p[1] + dt * p[3] + h * p[4], p[2] + dt * p[4] + h * p[5]
    b1, b2 = p[3] + dt * p[4], p[4] + dt * p[5]
    return a0 + dt * a1 + h * a2, a1 + dt * a2, a2, b1 + dt * b2, b2, p[5]


@part
def count_plots(keys, first, k, detection, detected, other, count, first_plot):
    """Draw which realisations have a plot at scan k, and count it: two scans share a pair of uniform numbers."""
    n = detected.size
    if detection == 1.0:
        detected[:] = 1.0
    elif k % 2 == 0:
        fill_uniform_pairs(keys[1], first, k // 2, detected, other)
        for i in range(n):
            detected[i] = 1.0 if detected[i] < detection else 0.0
    else:
        for i in range(n):
            detected[i] = 1.0 if other[i] < detection else 0.0
    for i in range(n):
        first_plot[i] = float(k) if count[i] == 0.0 and detected[i] == 1.0 else first_plot[i]
        count[i] += detected[i]


@part
def scan_range(x, p, plots, detected, dt, Q, R):
    """One scan, in place, of a filter that observes the range: addresses of x (3, n), p (6, n), plots and came."""
    q0, q1, q2, q3, q4, q5 = Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]
    for i in range(EIGHTS):
        r, v, a = extrapolated(get(x, i), get(x, EIGHTS + i), get(x, 2 * EIGHTS + i), dt)
        c0, c1, c2, c3, c4, c5 = transported(packed(p, i), dt)
        c0, c1, c2, c3, c4, c5 = c0 + q0, c1 + q1, c2 + q2, c3 + q3, c4 + q4, c5 + q5
        here = get(detected, i)
        weight = here / (c0 + R)
        left = 1.0 - here + R * weight  # c0 − c0²/(c0 + R) would cancel
        e = get(plots, i) - r
        g0, g1, g2 = c0 * weight, c1 * weight, c2 * weight
        put3(x, i, (r + g0 * e, v + g1 * e, a + g2 * e))
        put_packed(p, i, (c0 * left, c1 * left, c2 * left, c3 - g1 * c1, c4 - g1 * c2, c5 - g2 * c2))


@part
def scan_range_velocity(x, p, plots, detected, dt, Q, R, R_velocity):
    """One scan, in place, of a filter that observes range and velocity, one number after the other; as above."""
    q0, q1, q2, q3, q4, q5 = Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]
    for i in range(EIGHTS):
        r, v, a = extrapolated(get(x, i), get(x, EIGHTS + i), get(x, 2 * EIGHTS + i), dt)
        c0, c1, c2, c3, c4, c5 = transported(packed(p, i), dt)
        c0, c1, c2, c3, c4, c5 = c0 + q0, c1 + q1, c2 + q2, c3 + q3, c4 + q4, c5 + q5
        here = get(detected, i)
        weight = here / (c0 + R)
        left = 1.0 - here + R * weight
        e = get(plots, i) - r
        g1, g2 = c1 * weight, c2 * weight
        r, v, a = r + c0 * weight * e, v + g1 * e, a + g2 * e
        c3, c4, c5 = c3 - g1 * c1, c4 - g1 * c2, c5 - g2 * c2
        c0, c1, c2 = c0 * left, c1 * left, c2 * left
        weight = here / (c3 + R_velocity)
        left = 1.0 - here + R_velocity * weight
        e = get(plots, EIGHTS + i) - v
        g0, g2 = c1 * weight, c4 * weight
        put3(x, i, (r + g0 * e, v + c3 * weight * e, a + g2 * e))
        put_packed(p, i, (c0 - g0 * c1, c1 * left, c2 - g0 * c4, c3 * left, c4 * left, c5 - g2 * c4))


@inline
def packed(p, i):
    """Eight packed matrices of p (6, n)."""
    return (
        *(get(p, i), get(p, EIGHTS + i), get(p, 2 * EIGHTS + i)),
        *(get(p, 3 * EIGHTS + i), get(p, 4 * EIGHTS + i), get(p, 5 * EIGHTS + i)),
    )


@inline
def put3(x, i, value):
    """Write eight states of x (3, n)."""
    put(x, i, value[0])
    put(x, EIGHTS + i, value[1])
    put(x, 2 * EIGHTS + i, value[2])


@inline
def put_packed(p, i, value):
    """Write eight packed matrices of p (6, n)."""
    put3(p, i, value[:3])
    put3(p, 3 * EIGHTS + i, value[3:])


@part
def gather(normal, plots, detected, k, first_plot, weights, observes):
    """Add the plots that came at scan k to the starts' normal equations, normal (9, n); all by their addresses.

    The unknowns are range, velocity dt and acceleration dt² at the realisation's first plot; weights are the inverse
    variances of the range and of the velocity times dt, and dt.
    """
    a, b, dt = weights
    b = b if observes == 2 else 0.0
    for i in range(EIGHTS):
        u, here = float(k) - get(first_plot, i), get(detected, i)
        h, c, d = 0.5 * u * u, a * here, b * here
        z, w = c * get(plots, i), d * get(plots, EIGHTS + i) * dt
        s0, s1, s2, s3, s4, s5 = packed(normal, i)
        cu, ch = c * u, c * h
        put_packed(normal, i, (s0 + c, s1 + cu, s2 + ch, s3 + cu * u + d, s4 + ch * u + d * u, s5 + ch * h + d * u * u))
        right = row(normal, 6 * EIGHTS)
        y0, y1, y2 = get(right, i), get(right, EIGHTS + i), get(right, 2 * EIGHTS + i)
        put3(right, i, (y0 + z, y1 + z * u + w, y2 + z * h + w * u))


@part
def begin(made, f, k, start, dt):
    """Start filter f where the last plot of its start has come at scan k, in place."""
    x, p, normal, first_plot = made.x[f], made.p[f], made.normal[f], made.first
    for i in range(CHUNK):
        if made.detected[i] == 1.0 and made.count[i] == start:
            of = inverted((normal[0, i], normal[1, i], normal[2, i], normal[3, i], normal[4, i], normal[5, i]))
            y0, y1, y2 = normal[6, i], normal[7, i], normal[8, i]
            r = of[0] * y0 + of[1] * y1 + of[2] * y2
            v = of[1] * y0 + of[3] * y1 + of[4] * y2
            a = of[2] * y0 + of[4] * y1 + of[5] * y2
            u = float(k) - first_plot[i]
            r, v, a = extrapolated(r, v, a, u)
            c0, c1, c2, c3, c4, c5 = transported(of, u)
            x[0, i], x[1, i], x[2, i] = r, v / dt, a / (dt * dt)
            p[0, i], p[1, i], p[2, i] = c0, c1 / dt, c2 / dt**2
            p[3, i], p[4, i], p[5, i] = c3 / dt**2, c4 / dt**3, c5 / dt**4


@part
def compare(made, f, start, observes, truth, R):
    """Filter f: its errors, zero where there is no estimate, where there is one, and its believed variance; R (2,)."""
    x, p, e, has = address(made.x[f]), address(made.p[f]), address(made.e[f]), address(made.has[f])
    v, plots, detected, count = address(made.v[f]), address(made.plots), address(made.detected), address(made.count)
    state = address(made.state)
    for c in range(3):
        of_plot = 1.0 if c < observes else 0.0
        variance, measured, R_c = (0, 3, 5)[c], min(c, 1), R[min(c, 1)]
        for i in range(EIGHTS):
            at = c * EIGHTS + i
            runs = where_greater(get(count, i), full(start - 0.5), full(1.0), full(0.0))
            waits = (1.0 - runs) * of_plot * get(detected, i)
            there = runs + waits
            value = runs * get(x, at) + waits * get(plots, measured * EIGHTS + i)
            put(e, at, value - there * (truth[c] + get(state, at)))
            put(has, at, there)
            put(v, at, runs * get(p, variance * EIGHTS + i) + waits * R_c)


@part
def compare_whole(x, e, state, truth):
    """Errors e (3, n) where all have started."""
    for c in range(3):
        x_c, e_c, state_c, truth_c = x[c], e[c], state[c], truth[c]
        for i in range(x_c.size):
            e_c[i] = x_c[i] - (truth_c + state_c[i])


@summing
def totals(values, n):
    """Sums (3,) of the first n of values (3, n)."""
    a = b = c = 0.0
    for i in range(n):
        a, b, c = a + values[0, i], b + values[1, i], c + values[2, i]
    return a, b, c


@summing
def paired(e, has, f, b, c, n):
    """Sums where both filters f and b have component c: how many, e_f², e_f⁴, e_b², e_b⁴, e_f² e_b²."""
    count = own = own_4 = base = base_4 = product = 0.0
    for i in range(n):
        there = has[f, c, i] * has[b, c, i]
        one, other = e[f, c, i] * e[f, c, i] * there, e[b, c, i] * e[b, c, i] * there
        count, own, base, product = count + there, own + one, base + other, product + one * other
        own_4, base_4 = own_4 + one * one, base_4 + other * other
    return count, own, own_4, base, base_4, product


@summing
def normalised(e, p, count, start, n):
    """Sums over those that have started: how many, q = eᵀP⁻¹e / 3, q², and the three believed variances.

    By the factors L D Lᵀ of P, with one division: D = (p₀, m/p₀, w/(p₀m)), m and w the leading minors, w times p₀.
    """
    started = total = square = own0 = own1 = own2 = 0.0
    for i in range(n):
        runs = 1.0 if count[i] >= start else 0.0
        p0, p1, p2, p3, p4, p5 = p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i]
        minor, m = p0 * p3 - p1 * p1, p0 * p4 - p1 * p2
        whole = minor * (p0 * p5 - p2 * p2) - m * m
        all_three = p0 * minor * whole
        scale = runs / (all_three if runs == 1.0 else 1.0)
        e0 = e[0, i]
        a = p0 * e[1, i] - p1 * e0
        b = minor * (p0 * e[2, i] - p2 * e0) - m * a
        q = scale * (whole * (minor * e0 * e0 + a * a) + b * b) / 3.0
        started, total, square = started + runs, total + q, square + q * q
        own0, own1, own2 = own0 + runs * p0, own1 + runs * p3, own2 + runs * p5
    return started, total, square, own0, own1, own2


@part
def add_sums(made, n, k, start, baseline, whole, sums):
    """Add scan k over the first n realisations of the chunk to the sums; whole: all filters have started in all."""
    error, estimates, cross, squared, both, believed, nees = sums
    zero = np.zeros(3)
    base = moments(made.e, baseline, n, zero)
    for f in range(made.e.shape[0]):
        own = base if f == baseline else moments(made.e, f, n, zero)
        of_whole = normalised(made.e[f], made.p[f], made.count, start[f], n)
        has, variances = (float(n), float(n), float(n)), of_whole[3:]
        squares = own[3], own[7], own[11]
        if not whole:
            has, variances = totals(made.has[f], n), totals(made.v[f], n)
        elif f != baseline:
            squares = products_of_squares(made.e, f, baseline, n, zero)
        for c in range(3):
            for power in range(4):
                error[f, k, c, power] += own[4 * c + power]
            cross[f, k, c] += own[12 + c]
            estimates[f, k, c] += has[c]
            believed[f, k, c] += variances[c]
            nees[f, k, c] += of_whole[c]
            found = has[c], own[4 * c + 1], own[4 * c + 3], base[4 * c + 1], base[4 * c + 3], squares[c]
            if not whole:
                found = paired(made.e, made.has, f, baseline, c, n)
            for j in range(5):
                both[f, k, c, j] += found[j]
            squared[f, k, c] += found[5]


@part
def draw_once(keys, first, made, bias, sigma_bias, sigma_state, sigma_flight):
    """Biases, the start's difference and the flight's displacement of realisations first, first + 1, …"""
    fill_normal_pairs(keys[2], first, 0, made.offset[0], made.offset[1])
    fill_normal_pairs(keys[2], first, 1, made.state[0], made.state[1])
    fill_normal_pairs(keys[2], first, 2, made.state[2], made.other)
    for m in range(2):
        for i in range(made.other.size):
            made.offset[m, i] = bias[m] + sigma_bias[m] * made.offset[m, i]
    for c in range(3):
        for i in range(made.other.size):
            made.state[c, i] = sigma_state[c] * made.state[c, i]
    for c in range(3):
        fill_normal_pairs(keys[2], first, 3 + c, made.shift[2 * c], made.shift[2 * c + 1])
    for c in range(6):
        for i in range(made.other.size):
            made.shift[c, i] = sigma_flight[c] * made.shift[c, i]


@part
def advance_state(state, dt):
    """The drawn difference of the truth one scan later, in place: a square of the time; by its address."""
    for i in range(EIGHTS):
        put3(state, i, extrapolated(get(state, i), get(state, EIGHTS + i), get(state, 2 * EIGHTS + i), dt))


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
def move_truth(made, k, dt, flight, truth):
    """What is drawn of the truth (K, 3), in state, brought to scan k."""
    if flight.shape[0] > 0:
        displace(made, flight[k], truth[k], k * dt)
    elif k > 0:
        advance_state(address(made.state), dt)


@part
def observe(keys, first, k, made, truth, sigma):
    """The plots of scan k: the truth, what was drawn of it and of the biases, and noise."""
    fill_plots(keys[0], first, k, truth, sigma, made.plots[0], made.plots[1])
    plots, state, offset = address(made.plots), address(made.state), address(made.offset)
    for i in range(2 * EIGHTS):
        put(plots, i, get(plots, i) + get(state, i) + get(offset, i))


@summing
def begun(count, detected, start):
    """How many realisations have started before this scan."""
    number = 0.0
    for i in range(count.size):
        number += 1.0 if count[i] - detected[i] >= start else 0.0
    return number


@part
def advance(made, f, k, dt, observes, start, Q, R):
    """Scan k of filter f, in place: those that have started, then those that are to start; True where all had."""
    if k > 0:
        at = address(made.x[f]), address(made.p[f]), address(made.plots), address(made.detected)
        if observes == 1:
            scan_range(*at, dt, Q, R[0])
        else:
            scan_range_velocity(*at, dt, Q, R[0], R[1])
    if begun(made.count, made.detected, start) == float(CHUNK):
        return True
    weights = 1.0 / R[0], 1.0 / (R[1] * dt * dt), dt
    sums_at, plots_at, came_at = address(made.normal[f]), address(made.plots), address(made.detected)
    gather(sums_at, plots_at, came_at, k, address(made.first), weights, observes)
    begin(made, f, k, start, dt)
    return False


@part
def begin_chunk(keys, first, made, bias, sigma_bias, sigma_state, sigma_flight):
    """A new chunk: nothing has come yet, and what is drawn once a realisation is drawn; whether anything is."""
    drawn = np.any(sigma_bias > 0.0) or np.any(sigma_state > 0.0) or np.any(sigma_flight > 0.0)
    made.count[:] = 0.0
    made.first[:] = 0.0
    made.x[:] = 0.0
    made.p[:] = 0.0
    made.normal[:] = 0.0
    made.state[:] = 0.0
    for m in range(2):
        made.offset[m, :] = bias[m]
    if drawn:
        draw_once(keys, first, made, bias, sigma_bias, sigma_state, sigma_flight)
    return drawn


@kernel
def add_block(made, first, count, problem, sums):
    """`simulate_block` for a plain problem, with the work arrays of one chunk."""
    keys, truth, sigma, bias, sigma_bias, sigma_state, sigma_flight, flight, detection, dt = problem[:10]
    observes, start, Q, baseline = problem[10:]
    R = sigma * sigma
    for done in range(0, count, CHUNK):
        # A partial chunk is computed whole and summed in part, so each realisation goes through the same instructions.
        n = min(CHUNK, count - done)
        drawn = begin_chunk(keys, first + done, made, bias, sigma_bias, sigma_state, sigma_flight)
        for k in range(truth.shape[0]):
            if drawn:
                move_truth(made, k, dt, flight, truth)
            observe(keys, first + done, k, made, truth[k], sigma)
            count_plots(keys, first + done, k, detection, made.detected, made.other, made.count, made.first)
            whole = True
            for f in range(observes.size):
                whole &= advance(made, f, k, dt, observes[f], start[f], Q[f], R)
            for f in range(observes.size):
                if whole:
                    compare_whole(made.x[f], made.e[f], made.state, truth[k])
                else:
                    compare(made, f, start[f], observes[f], truth[k], R)
            add_sums(made, n, k, start, baseline, whole, sums)


@kernel
def fill_simulated(made, first, problem, plots, detected, truth):
    """Realisation `first`: plots (K, 2), came (K,) 1 where there is one, truth (K, 3); made: work arrays."""
    spread = problem.sigma_bias, problem.sigma_state, problem.sigma_flight
    drawn = begin_chunk(problem.keys, first, made, problem.bias, *spread)
    for k in range(plots.shape[0]):
        if drawn:
            move_truth(made, k, problem.dt, problem.flight, problem.truth)
        observe(problem.keys, first, k, made, problem.truth[k], problem.sigma)
        count_plots(problem.keys, first, k, problem.detection, made.detected, made.other, made.count, made.first)
        plots[k, 0], plots[k, 1], detected[k] = made.plots[0, 0], made.plots[1, 0], made.detected[0]
        for c in range(3):
            truth[k, c] = problem.truth[k, c] + made.state[c, 0]


def simulate_block(problem: Problem, first: int, count: int, sums: Sums) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add all filters' errors to the sums.

    The arrays of sums are float64 and contiguous. Realisation i has the same plots and estimates in any block.
    """
    problem = problem.plain()
    add_block(work(len(problem.observes)), int(first), int(count), problem, sums)


def simulate_plots(problem: Problem, realisation: int) -> tuple[np.ndarray, np.ndarray]:
    """A realisation's plots (K, 2) as `simulate_block` draws them, not-a-number where missed, and its truth (K, 3)."""
    problem, scans = problem.plain(), len(problem.truth)
    plots, detected, truth = np.empty((scans, 2)), np.empty(scans), np.empty((scans, 3))
    fill_simulated(work(len(problem.observes)), int(realisation), problem, plots, detected, truth)
    return np.where(detected[:, None] == 1, plots, np.nan), truth
