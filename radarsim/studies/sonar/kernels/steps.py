"""One scan of the sonar filters whose gains differ between realisations, eight realisations at a time.

The letters of this file and of those that use it (tuples of lanes; a lane is one number of eight realisations):

    x    (4)   state: value, rate, acceleration, and the error e carried over from the last plot
    P    (6)   covariance of value, rate and acceleration, packed by rows: 00, 01, 02, 11, 12, 22
    J    (10)  joint covariance of x: P, then the covariances of the three with e, then the variance of e
    Y    (6)   information, the inverse of P, packed likewise; (8) with age and correlation of the last plot's error
    H    (3)   observation row
    K    (4)   gain
    S          variance of the innovation
    z, w       plot, and its weight 1 / R, zero where it is missed
    n          number of plots before this scan
    rank       number of components that the plots determine: the size of the state, or fewer at the start
    tau        interval since the previous scan, in periods (dt: in s)
    c          correlation of the error with that of the previous scan
    q          manoeuvre variance: of the derivative of order `size`, constant over an interval

P, J, Y, R, S and q are in units of a nominal plot's σ and of the period; x is in m or rad, and s. An array contains one
chunk of realisations: `get(address(a), j * GROUPS + i)` is group i of row j.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, where_greater
from radarsim.kernels.linear import extrapolated

CHUNK = 512  # realisations, as in `shared_gains`
GROUPS = CHUNK // WIDTH
PITCH = GROUPS + 1  # of the rows of recent plots: rows 4 KiB apart would all use the same few lines of the cache
ROW = PITCH * WIDTH
KALMAN_GAIN = (0.0, 0.0, 0.0)  # instead of a fixed gain


class Model(NamedTuple):
    """The model of a recursive filter for one coordinate and scan.

    size of the state, 2 or 3; start: number of plots up to which the filter is least squares; correlation c and
    manoeuvre variance q; gain (3,) of a filter of fixed gain, else KALMAN_GAIN.
    """

    size: int
    start: int
    c: float
    q: float
    gain: tuple[float, float, float]


class Memory(NamedTuple):
    """What a filter stores for one coordinate from scan to scan.

    x (4, CHUNK) state, Y (8, CHUNK) information, and further rows (>= 10, CHUNK) whose meaning depends on the kind of
    filter: here the joint covariance J; for others see `detector.adapt` and `imm.interact`.
    """

    x: np.ndarray
    Y: np.ndarray
    further: np.ndarray


class Plot(NamedTuple):
    """Plots of one coordinate at one scan, (CHUNK,) each: z, weight w, number n of plots before."""

    z: np.ndarray
    w: np.ndarray
    n: np.ndarray


# ---- small matrices -----------------------------------------------------------------------------------------------
@inline
def inverse(Y, rank):
    """Inverse, packed by rows, of the leading block of size rank (0 to 3) of a symmetric matrix Y (6); zero outside."""
    y00, y01, y02, y11, y12, y22 = Y
    one, zero = full(1.0), full(0.0)
    least, half, most = full(0.5), full(1.5), full(2.5)
    c0, c1, c2 = y11 * y22 - y12 * y12, y02 * y12 - y01 * y22, y01 * y12 - y02 * y11  # cofactors of the first row
    minor = y00 * y11 - y01 * y01
    determinant = where_greater(rank, half, minor, where_greater(rank, least, y00, one))
    scale = 1.0 / where_greater(rank, most, y00 * c0 + y01 * c1 + y02 * c2, determinant)  # divisions are expensive
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
def times(P, h):
    """P h of a symmetric matrix P (6) and a vector h (3)."""
    return (
        P[0] * h[0] + P[1] * h[1] + P[2] * h[2],
        P[1] * h[0] + P[3] * h[1] + P[4] * h[2],
        P[2] * h[0] + P[4] * h[1] + P[5] * h[2],
    )


@inline
def normal_equations(recent, length, longest, i, origin, half):
    """Normal equations Y x = b of a polynomial through the last `length` plots of group i, at present: Y (6), b (3).

    recent is the address of the recent plots, of which `longest` are kept; they are taken relative to origin. half is
    0.5 for a parabola and 0 for a straight line.
    """
    zero = full(0.0)
    y0, y1, y2, y3, y4, y5, b0, b1, b2 = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for j in range(length):
        here = j * PITCH + i
        z = get(recent, here) - origin
        age, w = get(recent, longest * PITCH + here), get(recent, 2 * longest * PITCH + here)
        h1, h2 = zero - age, half * age * age
        w1, w2 = w * h1, w * h2
        y0, y1, y2, y3, y4, y5 = y0 + w, y1 + w1, y2 + w2, y3 + w1 * h1, y4 + w1 * h2, y5 + w2 * h2
        b0, b1, b2 = b0 + w * z, b1 + w1 * z, b2 + w2 * z
    return (y0, y1, y2, y3, y4, y5), (b0, b1, b2)


@inline
def three_where_greater(x, y, yes, no):
    """`where_greater` of three numbers."""
    return (
        where_greater(x, y, yes[0], no[0]),
        where_greater(x, y, yes[1], no[1]),
        where_greater(x, y, yes[2], no[2]),
    )


@inline
def six_where_greater(x, y, yes, no):
    """`where_greater` of six numbers."""
    return three_where_greater(x, y, yes[:3], no[:3]) + three_where_greater(x, y, yes[3:], no[3:])


# ---- rows of a chunk ----------------------------------------------------------------------------------------------
@inline
def three(a, i):
    """Three rows of group i."""
    return get(a, i), get(a, GROUPS + i), get(a, 2 * GROUPS + i)


@inline
def four(a, i):
    """Four rows of group i."""
    return get(a, i), get(a, GROUPS + i), get(a, 2 * GROUPS + i), get(a, 3 * GROUPS + i)


@inline
def six(a, i):
    """Six rows of group i."""
    return three(a, i) + three(a, 3 * GROUPS + i)


@inline
def eight(a, i):
    """Eight rows of group i."""
    return four(a, i) + four(a, 4 * GROUPS + i)


@inline
def put_three(a, i, values):
    """Write three rows of group i."""
    put(a, i, values[0])
    put(a, GROUPS + i, values[1])
    put(a, 2 * GROUPS + i, values[2])


@inline
def put_four(a, i, values):
    """Write four rows of group i."""
    put_three(a, i, values)
    put(a, 3 * GROUPS + i, values[3])


@inline
def put_six(a, i, values):
    """Write six rows of group i."""
    put_three(a, i, values)
    put_three(a, 3 * GROUPS + i, values[3:])


@inline
def put_eight(a, i, values):
    """Write eight rows of group i."""
    put_four(a, i, values)
    put_four(a, 4 * GROUPS + i, values[4:])


@part
def copy_row(source, target):
    """Copy a row (CHUNK,); an assignment to a slice has Numba compile texts of errors for seconds."""
    for i in range(target.size):
        target[i] = source[i]


# ---- least squares in information form ----------------------------------------------------------------------------
@inline
def predicted_information(Y, tau):
    """F⁻ᵀ Y F⁻¹ over the interval tau."""
    y00, y01, y02, y11, y12, y22 = Y
    half = 0.5 * tau * tau
    u0, u1, u2 = half * y00 - tau * y01 + y02, half * y01 - tau * y11 + y12, half * y02 - tau * y12 + y22
    y11, y01 = tau * (tau * y00 - 2.0 * y01) + y11, y01 - tau * y00
    return y00, y01, u0, y11, u1 - tau * u0, half * u0 - tau * u1 + u2


@inline
def with_observation(Y, H, w):
    """Y + w Hᵀ H."""
    return (
        Y[0] + w * H[0] * H[0],
        Y[1] + w * H[0] * H[1],
        Y[2] + w * H[0] * H[2],
        Y[3] + w * H[1] * H[1],
        Y[4] + w * H[1] * H[2],
        Y[5] + w * H[2] * H[2],
    )


@inline
def least_squares(Y, n, w, tau, c, size):
    """Update with one scan of `filters.differenced`: information Y (8), gain K (4) and covariance P (6).

    The observation is the plot less c times the last one, with H = H₀ - c H₀ F(-age) and R = 1 - c².
    """
    one, zero = full(1.0), full(0.0)
    age, c_last = Y[6] + tau, Y[7] * c
    w_new = w / (1.0 - c_last * c_last)
    second = -0.5 if size == 3 else 0.0
    H = (1.0 - c_last, c_last * age, second * (c_last * age) * age)
    Y = with_observation(predicted_information(Y[:6], tau), H, w_new)
    rank, most = n + where_greater(w, zero, one, zero), full(float(size))
    P = inverse(Y, where_greater(rank, most, most, rank))
    k0, k1, k2 = times(P, (w_new * H[0], w_new * H[1], w_new * H[2]))
    carried = 1.0 if c != 0.0 else 0.0
    k3 = carried * where_greater(w, zero, 1.0 - k0, zero)
    age, c_last = where_greater(w, zero, zero, age), where_greater(w, zero, one, c_last)
    return (*Y, age, c_last), (k0, k1, k2, k3), P


# ---- Kalman filter of state and carried error ---------------------------------------------------------------------
@inline
def predicted_joint(J, w, tau, model):
    """F J Fᵀ + Q; the variance of the error remains that of a stationary process, 1 / w."""
    one, zero, c, q = full(1.0), full(0.0), model.c, model.q
    half = 0.5 * tau * tau
    g0, g1, g2 = (half, tau, 0.0) if model.size == 2 else (tau * half / 3.0, half, tau)
    p00, p01, p02, p11, p12, p22, e0, e1, e2, ee = J
    a0, a1, a2 = p00 + tau * p01 + half * p02, p01 + tau * p11 + half * p12, p02 + tau * p12 + half * p22
    b1, b2 = p11 + tau * p12, p12 + tau * p22
    return (
        a0 + tau * a1 + half * a2 + q * g0 * g0,
        a1 + tau * a2 + q * g0 * g1,
        a2 + q * g0 * g2,
        b1 + tau * b2 + q * g1 * g1,
        b2 + q * g1 * g2,
        p22 + q * g2 * g2,
        c * (e0 + tau * e1 + half * e2),
        c * (e1 + tau * e2),
        c * e2,
        c * c * ee + (1.0 - c * c) / where_greater(w, zero, w, one),
    )


@inline
def joint_gain(J, w, fixed):
    """Gain K (4), J Hᵀ (4) and S of an exact observation of value plus error, H = (1, 0, 0, 1); K is zero where missed.

    fixed (3) is the gain of a filter of fixed gain, or KALMAN_GAIN.
    """
    zero = full(0.0)
    h = (J[0] + J[6], J[1] + J[7], J[2] + J[8], J[6] + J[9])
    S, detected = h[0] + h[3], where_greater(w, zero, full(1.0), zero)
    per = detected / S
    K = (h[0] * per, h[1] * per, h[2] * per, h[3] * per)
    if fixed[0] > 0.0:
        K = (fixed[0] * detected, fixed[1] * detected, fixed[2] * detected, zero)
    return K, h, S


@inline
def updated_joint(J, K, h, S):
    """J - h Kᵀ - K hᵀ + K S Kᵀ with h = J Hᵀ, which is valid for any gain."""
    r0, r1, r2, r3 = K[0] * S - h[0], K[1] * S - h[1], K[2] * S - h[2], K[3] * S - h[3]
    return (
        J[0] + K[0] * r0 - h[0] * K[0],
        J[1] + K[0] * r1 - h[0] * K[1],
        J[2] + K[0] * r2 - h[0] * K[2],
        J[3] + K[1] * r1 - h[1] * K[1],
        J[4] + K[1] * r2 - h[1] * K[2],
        J[5] + K[2] * r2 - h[2] * K[2],
        J[6] + K[0] * r3 - h[0] * K[3],
        J[7] + K[1] * r3 - h[1] * K[3],
        J[8] + K[2] * r3 - h[2] * K[3],
        J[9] + K[3] * r3 - h[3] * K[3],
    )


@inline
def kalman(J, start, n, w, tau, model):
    """Update the Kalman filter with one scan: joint covariance J (10), gain K (4) and covariance P (6).

    start (K (4), P (6)) are those of least squares, which apply up to the model's start. Just after a plot its value
    plus error is known exactly, so the covariances of the error are those of the state with opposite sign.
    """
    zero, first, carried = full(0.0), full(float(model.start)), 1.0 if model.c != 0.0 else 0.0
    K_start, P_start = start
    J = predicted_joint(J, w, tau, model)
    K, h, S = joint_gain(J, w, model.gain)
    J = updated_joint(J, K, h, S)
    P = six_where_greater(first, n, P_start, J[:6])
    e = three_where_greater(first, n, (zero - P[0], zero - P[1], zero - P[2]), J[6:9])
    ee = where_greater(first, n, P[0], J[9])
    K_new = three_where_greater(first, n, K_start[:3], K[:3])
    return (*P, *e, ee), (*K_new, where_greater(first, n, K_start[3], carried * K[3])), P


@inline
def updated_state(x, z, K, dt, period, c):
    """State x (4) after an interval dt and a plot z: F x + K (z - H F x), in m or rad, and s."""
    per, twice = 1.0 / period, 1.0 / (period * period)
    r, v, a = extrapolated(x[0], x[1], x[2], dt)
    e = c * x[3]
    innovation = z - r - e
    return (
        r + K[0] * innovation,
        v + per * K[1] * innovation,
        a + twice * K[2] * innovation,
        e + K[3] * innovation,
    )


@part
def recur(by_covariance, model, dt, period, memory, plot, P):
    """Update the memory of a recursive filter with one scan, in place, and write P (6, CHUNK).

    by_covariance: after the model's start the filter switches from information to the joint covariance.
    """
    ax, ay, aj, ap = address(memory.x), address(memory.Y), address(memory.further), address(P)
    az, aw, an = address(plot.z), address(plot.w), address(plot.n)
    tau = dt / period
    for i in range(GROUPS):
        w, n = get(aw, i), get(an, i)
        Y, K, P_now = least_squares(eight(ay, i), n, w, tau, model.c, model.size)
        put_eight(ay, i, Y)
        if by_covariance:
            J = six(aj, i) + four(aj, 6 * GROUPS + i)
            J, K, P_now = kalman(J, (K, P_now), n, w, tau, model)
            put_six(aj, i, J)
            put_four(aj, 6 * GROUPS + i, J[6:])
        put_six(ap, i, P_now)
        put_four(ax, i, updated_state(four(ax, i), get(az, i), K, dt, period, model.c))


# ---- windows ------------------------------------------------------------------------------------------------------
@kernel
def remember(recent, z, weight, tau):
    """Add the plots of a scan to recent (3, L, ROW), the last L plots: plot, age, weight, the newest first."""
    a, az, aw, length = address(recent), address(z), address(weight), recent.shape[1]
    zero, ages, weights = full(0.0), length * PITCH, 2 * length * PITCH
    for i in range(GROUPS):
        w = get(aw, i)
        for j in range(length - 1, 0, -1):
            here, older = j * PITCH + i, (j - 1) * PITCH + i
            put(a, here, where_greater(w, zero, get(a, older), get(a, here)))
            put(a, ages + here, where_greater(w, zero, get(a, ages + older), get(a, ages + here)) + tau)
            put(a, weights + here, where_greater(w, zero, get(a, weights + older), get(a, weights + here)))
        put(a, i, where_greater(w, zero, get(az, i), get(a, i)))
        put(a, ages + i, where_greater(w, zero, zero, get(a, ages + i) + tau))
        put(a, weights + i, where_greater(w, zero, w, get(a, weights + i)))


@part
def fit(x, recent, length, size, period, n, P):
    """Least squares on the last `length` of recent plots: x (4, CHUNK), P (6, CHUNK); n (CHUNK,) of plots so far."""
    ax, a, an, ap = address(x), address(recent), address(n), address(P)
    per, twice, half, zero = 1.0 / period, 1.0 / (period * period), 0.5 if size == 3 else 0.0, full(0.0)
    most = full(float(size))
    for i in range(GROUPS):
        Y, b = normal_equations(a, length, recent.shape[1], i, zero, half)
        rank = get(an, i)
        P_now = inverse(Y, where_greater(rank, most, most, rank))
        r, v, acceleration = times(P_now, b)
        put_three(ax, i, (r, per * v, twice * acceleration))
        put_six(ap, i, P_now)
