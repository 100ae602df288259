"""Filters with a covariance to each realisation: a Kalman scan, and the least-squares start while plots are missed.

A filter's start is in the making as the sums of its normal equations, in units of the scan period and with time
counted from the realisation's first plot, so that they are well conditioned however late that comes.
"""

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import any_greater, full, get, row, where_greater
from radarsim.kernels.linear import extrapolated
from radarsim.studies.range_doppler.kernels.chunk import (
    EIGHTS,
    get3,
    of_filter,
    packed,
    put3,
    put_packed,
    transported,
)


@part
def scan_range(x, p, plots, detected, dt, Q, R):
    """One scan, in place, of a filter that observes the range: addresses of x (3, n), p (6, n), plots, detected."""
    q0, q1, q2, q3, q4, q5 = Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]
    for i in range(EIGHTS):
        r, v, a = extrapolated(*get3(x, i), dt)
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
        r, v, a = extrapolated(*get3(x, i), dt)
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
        0.0 - (l10 * i1 + a * l21 * i2),
        a * i2,
        i1 + l21 * l21 * i2,
        0.0 - l21 * i2,
        i2,
    )


@inline
def gathered(sums, right, u, weights, plots):
    """The normal equations sums (6) and right-hand side (3) with one plot more, u scan periods after the first.

    The unknowns are range, velocity dt and acceleration dt² at the realisation's first plot; weights are the inverse
    variances of the range and of the velocity times dt, zero where there is none; plots the range and velocity times
    dt.
    """
    s0, s1, s2, s3, s4, s5 = sums
    y0, y1, y2 = right
    c, d = weights
    h, z, w = 0.5 * u * u, c * plots[0], d * plots[1]
    cu, ch = c * u, c * h
    sums = s0 + c, s1 + cu, s2 + ch, s3 + cu * u + d, s4 + ch * u + d * u, s5 + ch * h + d * u * u
    return sums, (y0 + z, y1 + z * u + w, y2 + z * h + w * u)


@inline
def solved(sums, right, u, dt):
    """State and packed covariance, u scan periods after the first plot, of the normal equations."""
    of = inverted(sums)
    y0, y1, y2 = right
    r = of[0] * y0 + of[1] * y1 + of[2] * y2
    v = of[1] * y0 + of[3] * y1 + of[4] * y2
    a = of[2] * y0 + of[4] * y1 + of[5] * y2
    r, v, a = extrapolated(r, v, a, u)
    c0, c1, c2, c3, c4, c5 = transported(of, u)
    return (r, v / dt, a / (dt * dt)), (c0, c1 / dt, c2 / dt**2, c3 / dt**2, c4 / dt**3, c5 / dt**4)


@inline
def chosen(now, new, old):
    """Three lanes: of the new where now is 1, else of the old."""
    half = full(0.5)
    return (
        where_greater(now, half, new[0], old[0]),
        where_greater(now, half, new[1], old[1]),
        where_greater(now, half, new[2], old[2]),
    )


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
            sums, y = gathered(packed(normal, i), get3(right, i), u, of_plot, plots)
            put_packed(normal, i, sums)
            put3(right, i, y)
            now = where_greater(count, last, one, none) * where_greater(last, count - here, one, none)
            if any_greater(now, full(0.5)):
                s0, s1, s2, s3, s4, s5 = sums
                rest = 1.0 - now  # makes the matrices of the others regular
                new, made = solved((s0 + rest, s1, s2, s3 + rest, s4, s5 + rest), y, u, dt)
                old = packed(p, i)
                put3(x, i, chosen(now, new, get3(x, i)))
                put3(p, i, chosen(now, made[:3], old[:3]))
                put3(p, 3 * EIGHTS + i, chosen(now, made[3:], old[3:]))
    return all_run


@part
def advance(at, f, dt, design, R):
    """One scan of filter f's estimates, in place; design: what it observes and its packed Q."""
    observes, Q = design
    x, p = of_filter(at.x, f, 3), of_filter(at.p, f, 6)
    if observes == 1:
        scan_range(x, p, at.plots, at.detected, dt, Q, R[0])
    else:
        scan_range_velocity(x, p, at.plots, at.detected, dt, Q, R[0], R[1])
