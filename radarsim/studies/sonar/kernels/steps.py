"""One scan of the sonar filters that go along with each realisation's own plots, eight realisations at a time.

Rows of the arrays are of one chunk; `get(a, j * GROUPS + i)` is group i of row j. Times are in periods, weights
relative to the nominal plot, zero where it is missed.
"""

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.lanes import WIDTH, address, full, get, put, where_greater
from radarsim.kernels.linear import extrapolated

CHUNK = 512  # realisations, as in `sonar`
GROUPS = CHUNK // WIDTH


@inline
def inverse(y, rank):
    """Inverse, packed by rows, of the leading block of size rank (0 to 3) of a symmetric matrix y (6); zero outside."""
    y00, y01, y02, y11, y12, y22 = y
    one, zero = full(1.0), full(0.0)
    least, half, most = full(0.5), full(1.5), full(2.5)
    c0, c1, c2 = y11 * y22 - y12 * y12, y02 * y12 - y01 * y22, y01 * y12 - y02 * y11
    minor = y00 * y11 - y01 * y01
    determinant = where_greater(rank, half, minor, where_greater(rank, least, y00, one))
    scale = 1.0 / where_greater(rank, most, y00 * c0 + y01 * c1 + y02 * c2, determinant)  # divisions are what costs
    p00 = where_greater(rank, half, y11, where_greater(rank, least, one, zero))
    return (
        scale * where_greater(rank, most, c0, p00),
        scale * where_greater(rank, most, c1, where_greater(rank, half, zero - y01, zero)),
        scale * where_greater(rank, most, c2, zero),
        scale * where_greater(rank, most, y00 * y22 - y02 * y02, where_greater(rank, half, y00, zero)),
        scale * where_greater(rank, most, y01 * y02 - y00 * y12, zero),
        scale * where_greater(rank, most, minor, zero),
    )


@inline
def times(p, h):
    """p h of a symmetric matrix p (6) and a vector h (3)."""
    return (
        p[0] * h[0] + p[1] * h[1] + p[2] * h[2],
        p[1] * h[0] + p[3] * h[1] + p[4] * h[2],
        p[2] * h[0] + p[4] * h[1] + p[5] * h[2],
    )


@inline
def informed(y, before, w, tau, carry, size):
    """One scan of `filters.sonar.differenced`: information y (8), gains (4) and covariance P (6).

    The last two of y are age and correlation of the last plot; before counts the plots so far.
    """
    one, zero = full(1.0), full(0.0)
    y00, y01, y02, y11, y12, y22 = y[0], y[1], y[2], y[3], y[4], y[5]
    half = 0.5 * tau * tau
    # F⁻ᵀ Y F⁻¹ over the interval tau.
    u0, u1, u2 = half * y00 - tau * y01 + y02, half * y01 - tau * y11 + y12, half * y02 - tau * y12 + y22
    y11, y01 = tau * (tau * y00 - 2.0 * y01) + y11, y01 - tau * y00
    y02, y12, y22 = u0, u1 - tau * u0, half * u0 - tau * u1 + u2
    age, c = y[6] + tau, y[7] * carry
    new = w / (1.0 - c * c)
    second = -0.5 if size == 3 else 0.0
    h0, h1, h2 = 1.0 - c, c * age, second * (c * age) * age
    y00, y01, y02 = y00 + new * h0 * h0, y01 + new * h0 * h1, y02 + new * h0 * h2
    y11, y12, y22 = y11 + new * h1 * h1, y12 + new * h1 * h2, y22 + new * h2 * h2
    rank, most = before + where_greater(w, zero, one, zero), full(float(size))
    P = inverse((y00, y01, y02, y11, y12, y22), where_greater(rank, most, most, rank))
    g0, g1, g2 = times(P, (new * h0, new * h1, new * h2))
    carried = 1.0 if carry != 0.0 else 0.0
    g3 = carried * where_greater(w, zero, 1.0 - g0, zero)
    age, c = where_greater(w, zero, zero, age), where_greater(w, zero, one, c)
    return (y00, y01, y02, y11, y12, y22, age, c), (g0, g1, g2, g3), P


@inline
def believed(s, g, P, before, w, tau, carry, size, start, manoeuvre, settled):
    """Covariance s (10) of state and carried error by one scan; gains (4) and P (6) of it after `start` plots, else
    g, P.

    s: the six of P, then the three covariances with the error and its variance. settled (3) are fixed gains, all
    zero for the Kalman gain; P S is taken off in the form that holds for any gain.
    """
    one, zero = full(1.0), full(0.0)
    half = 0.5 * tau * tau
    m0, m1, m2 = (half, tau, 0.0) if size == 2 else (tau * half / 3.0, half, tau)
    p00, p01, p02, p11, p12, p22, q0, q1, q2, e = s
    # F P Fᵀ + Q; the error's variance stays what it is in a stationary process.
    a0, a1, a2 = p00 + tau * p01 + half * p02, p01 + tau * p11 + half * p12, p02 + tau * p12 + half * p22
    b1, b2 = p11 + tau * p12, p12 + tau * p22
    p00, p01 = a0 + tau * a1 + half * a2 + manoeuvre * m0 * m0, a1 + tau * a2 + manoeuvre * m0 * m1
    p02, p11 = a2 + manoeuvre * m0 * m2, b1 + tau * b2 + manoeuvre * m1 * m1
    p12, p22 = b2 + manoeuvre * m1 * m2, p22 + manoeuvre * m2 * m2
    q0, q1, q2 = carry * (q0 + tau * q1 + half * q2), carry * (q1 + tau * q2), carry * q2
    e = carry * carry * e + (1.0 - carry * carry) / where_greater(w, zero, w, one)
    k0, k1, k2, k3 = p00 + q0, p01 + q1, p02 + q2, q0 + e
    S, seen = k0 + k3, where_greater(w, zero, one, zero)
    per = seen / S
    g0, g1, g2, g3 = k0 * per, k1 * per, k2 * per, k3 * per
    if settled[0] > 0.0:
        g0, g1, g2, g3 = settled[0] * seen, settled[1] * seen, settled[2] * seen, zero
    r0, r1, r2, r3 = g0 * S - k0, g1 * S - k1, g2 * S - k2, g3 * S - k3
    p00, p01, p02 = p00 + g0 * r0 - k0 * g0, p01 + g0 * r1 - k0 * g1, p02 + g0 * r2 - k0 * g2
    p11, p12, p22 = p11 + g1 * r1 - k1 * g1, p12 + g1 * r2 - k1 * g2, p22 + g2 * r2 - k2 * g2
    q0, q1, q2 = q0 + g0 * r3 - k0 * g3, q1 + g1 * r3 - k1 * g3, q2 + g2 * r3 - k2 * g3
    e = e + g3 * r3 - k3 * g3
    # Before the start all comes from least squares; right after a plot H x + e is known, so the error's covariances
    # are those of the state, negative.
    first, carried = full(float(start)), 1.0 if carry != 0.0 else 0.0
    P = (
        where_greater(first, before, P[0], p00),
        where_greater(first, before, P[1], p01),
        where_greater(first, before, P[2], p02),
        where_greater(first, before, P[3], p11),
        where_greater(first, before, P[4], p12),
        where_greater(first, before, P[5], p22),
    )
    q0, q1 = where_greater(first, before, zero - P[0], q0), where_greater(first, before, zero - P[1], q1)
    q2, e = where_greater(first, before, zero - P[2], q2), where_greater(first, before, P[0], e)
    g0, g1 = where_greater(first, before, g[0], g0), where_greater(first, before, g[1], g1)
    g2, g3 = where_greater(first, before, g[2], g2), where_greater(first, before, g[3], carried * g3)
    return (P[0], P[1], P[2], P[3], P[4], P[5], q0, q1, q2, e), (g0, g1, g2, g3), P


@inline
def six(a, i):
    """Six rows of group i."""
    return (
        get(a, i),
        get(a, GROUPS + i),
        get(a, 2 * GROUPS + i),
        get(a, 3 * GROUPS + i),
        get(a, 4 * GROUPS + i),
        get(a, 5 * GROUPS + i),
    )


@inline
def eight(a, i):
    """Eight rows of group i."""
    y0, y1, y2, y3, y4, y5 = six(a, i)
    return y0, y1, y2, y3, y4, y5, get(a, 6 * GROUPS + i), get(a, 7 * GROUPS + i)


@inline
def put_six(a, i, values):
    """Write six rows of group i."""
    put(a, i, values[0])
    put(a, GROUPS + i, values[1])
    put(a, 2 * GROUPS + i, values[2])
    put(a, 3 * GROUPS + i, values[3])
    put(a, 4 * GROUPS + i, values[4])
    put(a, 5 * GROUPS + i, values[5])


@kernel
def recur(by_covariance, size, start, dt, period, carry, manoeuvre, settled, x, y, s, z, weight, before, P):
    """One scan of a recursive filter, in place: x (4, CHUNK), y (8, CHUNK), s (10, CHUNK); leaves P (6, CHUNK).

    by_covariance: after `start` plots it goes over from information y to covariances s.
    """
    ax, ay, at, az, aw, ab, ap = (
        *(address(x), address(y), address(s), address(z)),
        *(address(weight), address(before), address(P)),
    )
    tau, gains = dt / period, (settled[0], settled[1], settled[2])
    per, twice = 1.0 / period, 1.0 / (period * period)
    for i in range(GROUPS):
        w, b = get(aw, i), get(ab, i)
        known = eight(ay, i)
        known, g, p = informed(known, b, w, tau, carry, size)
        put_six(ay, i, known)
        put(ay, 6 * GROUPS + i, known[6])
        put(ay, 7 * GROUPS + i, known[7])
        if by_covariance:
            last = (get(at, 6 * GROUPS + i), get(at, 7 * GROUPS + i), get(at, 8 * GROUPS + i), get(at, 9 * GROUPS + i))
            joint, g, p = believed(six(at, i) + last, g, p, b, w, tau, carry, size, start, manoeuvre, gains)
            put_six(at, i, joint)
            put(at, 6 * GROUPS + i, joint[6])
            put(at, 7 * GROUPS + i, joint[7])
            put(at, 8 * GROUPS + i, joint[8])
            put(at, 9 * GROUPS + i, joint[9])
        put_six(ap, i, p)
        r, v, a = extrapolated(get(ax, i), get(ax, GROUPS + i), get(ax, 2 * GROUPS + i), dt)
        foreseen = carry * get(ax, 3 * GROUPS + i)
        residual = get(az, i) - r - foreseen
        put(ax, i, r + g[0] * residual)
        put(ax, GROUPS + i, v + per * g[1] * residual)
        put(ax, 2 * GROUPS + i, a + twice * g[2] * residual)
        put(ax, 3 * GROUPS + i, foreseen + g[3] * residual)


@kernel
def remember(memory, z, weight, tau):
    """Enter the plots of a scan into memory (3, L, CHUNK) of the last L: plot, age, weight, the newest first."""
    a, az, aw, length = address(memory), address(z), address(weight), memory.shape[1]
    zero, ages, weights = full(0.0), length * GROUPS, 2 * length * GROUPS
    for i in range(GROUPS):
        w = get(aw, i)
        for q in range(length - 1, 0, -1):
            here, older = q * GROUPS + i, (q - 1) * GROUPS + i
            put(a, here, where_greater(w, zero, get(a, older), get(a, here)))
            put(a, ages + here, where_greater(w, zero, get(a, ages + older), get(a, ages + here)) + tau)
            put(a, weights + here, where_greater(w, zero, get(a, weights + older), get(a, weights + here)))
        put(a, i, where_greater(w, zero, get(az, i), get(a, i)))
        put(a, ages + i, where_greater(w, zero, zero, get(a, ages + i) + tau))
        put(a, weights + i, where_greater(w, zero, w, get(a, weights + i)))


@kernel
def fit(x, memory, length, size, period, count, P):
    """Least squares on the last `length` plots in memory: x (4, CHUNK), P (6, CHUNK); count (CHUNK,) of plots so
    far."""
    ax, a, ac, ap = address(x), address(memory), address(count), address(P)
    ages, weights = memory.shape[1] * GROUPS, 2 * memory.shape[1] * GROUPS
    per, twice, second, zero = 1.0 / period, 1.0 / (period * period), 0.5 if size == 3 else 0.0, full(0.0)
    most = full(float(size))
    for i in range(GROUPS):
        y0, y1, y2, y3, y4, y5, b0, b1, b2 = zero, zero, zero, zero, zero, zero, zero, zero, zero
        for q in range(length):
            here = q * GROUPS + i
            z, age, w = get(a, here), get(a, ages + here), get(a, weights + here)
            one, two = zero - age, second * age * age
            w1, w2 = w * one, w * two
            y0, y1, y2, y3, y4, y5 = y0 + w, y1 + w1, y2 + w2, y3 + w1 * one, y4 + w1 * two, y5 + w2 * two
            b0, b1, b2 = b0 + w * z, b1 + w1 * z, b2 + w2 * z
        rank = get(ac, i)
        p = inverse((y0, y1, y2, y3, y4, y5), where_greater(rank, most, most, rank))
        r, v, acceleration = times(p, (b0, b1, b2))
        put(ax, i, r)
        put(ax, GROUPS + i, per * v)
        put(ax, 2 * GROUPS + i, twice * acceleration)
        put_six(ap, i, p)
