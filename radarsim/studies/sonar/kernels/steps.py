"""One scan of the sonar filters whose gains differ between realisations, eight realisations at a time.

The letters of this file and of those that use it (tuples; a number in them is a lane of eight realisations, and where
Python designs a filter an array over patterns of plots):

    x    (4)   state: value, rate, acceleration, and the error e carried over from the last plot
    P    (6)   covariance of value, rate and acceleration, packed as in `kernels.algebra`
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
chunk of realisations: `get(address(a), j * GROUPS + i)` is group i of row j."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import algebra, lanes
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, choose3, choose6, full, get, get4, put, put4, put6, where_greater

CHUNK = 512  # realisations, as in `shared_gains`
GROUPS = CHUNK // WIDTH
PITCH = GROUPS + 1  # of the rows of recent plots: rows 4 KiB apart would all use the same few lines of the cache
ROW = PITCH * WIDTH
KALMAN_GAIN = (0.0, 0.0, 0.0)  # instead of a fixed gain
NOTHING_NEW = 1e-12  # of a plot's variance: less is rounding


class Model(NamedTuple):
    """The model of a recursive filter for one coordinate and scan."""

    size: int  #: of the state, 2 or 3
    start: int  #: number of plots up to which the filter is least squares
    c: float  #: correlation
    q: float  #: manoeuvre variance
    gain: tuple[float, float, float]  #: of a filter of fixed gain, else KALMAN_GAIN


class Filters(NamedTuple):
    """What F filters in C coordinates store from scan to scan, for a chunk."""

    x: np.ndarray  #: (F, C, 4, CHUNK) state
    Y: np.ndarray  #: (F, C, 8, CHUNK) information
    #: (F, C, >= 10, CHUNK) rows by kind of filter: here the joint covariance J; see `detector.update_adaptive`,
    #: `detector.update_imm`
    kind_rows: np.ndarray
    P: np.ndarray  #: (6, CHUNK) of the filter that was updated last


class Plots(NamedTuple):
    """Plots of a chunk at a scan, each (C, CHUNK)."""

    z: np.ndarray
    weight: np.ndarray
    n: np.ndarray  #: number of plots before the scan
    n_now: np.ndarray  #: up to it
    recent: np.ndarray  #: (C, 3, L, ROW) the last plots: plot, age, weight
    T: np.ndarray  #: (D, G, CHUNK) statistics of the detectors


# ---- small matrices -----------------------------------------------------------------------------------------------
@inline
def leading_inverse(Y, rank):
    """Inverse of the leading block of size rank (0 to 3) of a packed matrix; zero outside."""
    y00, y01, y02, y11, y12, y22 = Y
    ones, zeros = full(1.0), full(0.0)
    above_0, above_1, above_2 = full(0.5), full(1.5), full(2.5)
    c0, c1, c2 = y11 * y22 - y12 * y12, y02 * y12 - y01 * y22, y01 * y12 - y02 * y11  # cofactors of the first row
    minor = y00 * y11 - y01 * y01
    determinant = where_greater(rank, above_1, minor, where_greater(rank, above_0, y00, ones))
    scale = 1.0 / where_greater(rank, above_2, y00 * c0 + y01 * c1 + y02 * c2, determinant)  # divisions are expensive
    p00 = where_greater(rank, above_1, y11, where_greater(rank, above_0, ones, zeros))
    return (
        scale * where_greater(rank, above_2, c0, p00),
        scale * where_greater(rank, above_2, c1, where_greater(rank, above_1, zeros - y01, zeros)),
        scale * where_greater(rank, above_2, c2, zeros),
        scale * where_greater(rank, above_2, y00 * y22 - y02 * y02, where_greater(rank, above_1, y00, zeros)),
        scale * where_greater(rank, above_2, y01 * y02 - y00 * y12, zeros),
        scale * where_greater(rank, above_2, minor, zeros),
    )


@inline
def normal_equations(recent, length, longest, i, origin, half):
    """Normal equations Y x = b of a polynomial through the last `length` plots of group i, at present: Y (6), b (3).

    recent is the address of the recent plots, at most `longest`; they are taken relative to origin. half is
    0.5 for a parabola and 0 for a straight line."""
    zero = full(0.0)
    Y, b = (zero, zero, zero, zero, zero, zero), (zero, zero, zero)
    for j in range(length):
        slot = j * PITCH + i
        z = get(recent, slot) - origin
        age, w = get(recent, longest * PITCH + slot), get(recent, 2 * longest * PITCH + slot)
        h = (1.0, zero - age, half * age * age)
        Y, b = algebra.add_outer(Y, w, h), algebra.add_scaled(b, w * z, h)
    return Y, b


@part
def copy_row(source, target):
    """Copy a row (CHUNK,); an assignment to a slice has Numba compile texts of errors for seconds."""
    for i in range(target.size):
        target[i] = source[i]


@inline
def manoeuvre_covariance(q, tau, size):
    """Q (6) of a random derivative of order `size` and variance q, constant over tau."""
    half = 0.5 * tau * tau
    g = (half, tau, 0.0) if size == 2 else (tau * half / 3.0, half, tau)
    return algebra.add_outer(algebra.NO_NOISE, q, g)


# ---- least squares in information form ----------------------------------------------------------------------------
@inline
def least_squares(Y, n, w, tau, c, size):
    """Recursive least squares of one scan on differences of plots: information Y (8), gain K (4), covariance P (6).

    The observation is the plot less c times the last one (after P3 eq. 15), c to the power of their distance, with the
    row H = H₀ - c H₀ F(-age) and R = 1 - c²; with c = 0 it is the plot itself. With fewer plots than unknowns a
    polynomial of lower degree is determined. A plot at the very time of the last one contains nothing new of an error
    that is correlated."""
    ones, zeros = full(1.0), full(0.0)
    age, c_last = Y[6] + tau, Y[7] * c
    new = 1.0 - c_last * c_last
    w_new = where_greater(new, full(NOTHING_NEW), w / new, zeros)
    second = -0.5 if size == 3 else 0.0
    H = (1.0 - c_last, c_last * age, second * (c_last * age) * age)
    Y = algebra.add_outer(algebra.predicted_information(Y[:6], tau), w_new, H)
    rank, full_rank = n + where_greater(w, zeros, ones, zeros), full(float(size))
    P = leading_inverse(Y, where_greater(rank, full_rank, full_rank, rank))
    k0, k1, k2 = algebra.times(P, (w_new * H[0], w_new * H[1], w_new * H[2]))
    carried = 1.0 if c != 0.0 else 0.0
    k3 = carried * where_greater(w_new, zeros, 1.0 - k0, zeros)
    age, c_last = where_greater(w, zeros, zeros, age), where_greater(w, zeros, ones, c_last)
    return (*Y, age, c_last), (k0, k1, k2, k3), P


# ---- Kalman filter of state and carried error ---------------------------------------------------------------------
@inline
def predicted_joint(J, w, tau, model):
    """Predict the joint covariance: F J Fᵀ + Q; the error stays stationary, with variance 1 / w."""
    ones, zeros, c, F = full(1.0), full(0.0), model.c, algebra.constant_acceleration(tau)
    P = algebra.predicted_covariance(J[:6], F, manoeuvre_covariance(model.q, tau, model.size))
    e = algebra.predicted(J[6:9], F)
    return (*P, c * e[0], c * e[1], c * e[2], c * c * J[9] + (1.0 - c * c) / where_greater(w, zeros, w, ones))


@inline
def joint_gain(J, w, fixed):
    """Gain K (4), J Hᵀ (4) and S of an exact observation of value plus error, H = (1, 0, 0, 1); K is zero where missed.

    fixed (3) is the gain of a filter of fixed gain, or KALMAN_GAIN. Where value plus error is known already, a plot
    contains nothing new."""
    zeros, ones = full(0.0), full(1.0)
    h = (J[0] + J[6], J[1] + J[7], J[2] + J[8], J[6] + J[9])
    S = h[0] + h[3]
    detected = where_greater(w, zeros, where_greater(S, full(NOTHING_NEW), ones, zeros), zeros)
    per = detected / where_greater(S, full(NOTHING_NEW), S, ones)
    K = (h[0] * per, h[1] * per, h[2] * per, h[3] * per)
    if fixed[0] > 0.0:
        K = (fixed[0] * detected, fixed[1] * detected, fixed[2] * detected, zeros)
    return K, h, S


@inline
def updated_joint(J, K, h, S):
    """J - h Kᵀ - K hᵀ + K S Kᵀ with h = J Hᵀ, which is valid for any gain."""
    r = (K[0] * S - h[0], K[1] * S - h[1], K[2] * S - h[2], K[3] * S - h[3])
    e = (J[6] + K[0] * r[3] - h[0] * K[3], J[7] + K[1] * r[3] - h[1] * K[3], J[8] + K[2] * r[3] - h[2] * K[3])
    return (*algebra.corrected(J[:6], h, K, S), *e, J[9] + K[3] * r[3] - h[3] * K[3])


@inline
def kalman(J, start, n, w, tau, model):
    """Update the Kalman filter with one scan: joint covariance J (10), gain K (4) and covariance P (6).

    start (K (4), P (6)) are those of least squares, which apply up to the model's start. Just after a plot its value
    plus error is known exactly, so the covariances of the error are those of the state with opposite sign. The paper's
    step 4 lacks a plus."""
    zero, first, carried = full(0.0), full(float(model.start)), 1.0 if model.c != 0.0 else 0.0
    K_start, P_start = start
    J = predicted_joint(J, w, tau, model)
    K, h, S = joint_gain(J, w, model.gain)
    J = updated_joint(J, K, h, S)
    P = choose6(first, n, P_start, J[:6])
    e = choose3(first, n, (zero - P[0], zero - P[1], zero - P[2]), J[6:9])
    ee = where_greater(first, n, P[0], J[9])
    K_new = choose3(first, n, K_start[:3], K[:3])
    return (*P, *e, ee), (*K_new, where_greater(first, n, K_start[3], carried * K[3])), P


@inline
def updated_state(x, z, K, dt, period, c):
    """State x (4) after an interval dt and a plot z: F x + K (z - H F x), in m or rad, and s."""
    per, twice = 1.0 / period, 1.0 / (period * period)
    r, v, a = algebra.predicted((x[0], x[1], x[2]), algebra.constant_acceleration(dt))
    e = c * x[3]
    innovation = z - r - e
    return (r + K[0] * innovation, v + per * K[1] * innovation, a + twice * K[2] * innovation, e + K[3] * innovation)


@inline
def memory_addresses(filters, plots, f, c):
    """Addresses of a filter's x, Y, rows of its kind and P, then of its coordinate's z, weight and n.

    The arrays must outlive the addresses.
    Numba would count a reference to each array wherever it is passed on."""
    x, Y, kind_rows, P = filters.x[f, c], filters.Y[f, c], filters.kind_rows[f, c], filters.P
    z, w, n = plots.z[c], plots.weight[c], plots.n[c]
    return address(x), address(Y), address(kind_rows), address(P), address(z), address(w), address(n)


@inline
def get_information(a, i):
    """Y (8) of group i."""
    return get4(a, i, GROUPS) + get4(a, 4 * GROUPS + i, GROUPS)


@inline
def put_information(a, i, Y):
    """Write Y (8) of group i."""
    put4(a, i, Y, GROUPS)
    put4(a, 4 * GROUPS + i, Y[4:], GROUPS)


@inline
def update_recursive(filters, plots, f, c, by_covariance, model, dt, period):
    """Update the memory of a recursive filter with one scan, in place.

    by_covariance: after the model's start the filter switches from information to the joint covariance."""
    ax, ay, aj, ap, az, aw, an = memory_addresses(filters, plots, f, c)
    tau = dt / period
    for i in range(GROUPS):
        w, n = get(aw, i), get(an, i)
        Y, K, P = least_squares(get_information(ay, i), n, w, tau, model.c, model.size)
        put_information(ay, i, Y)
        if by_covariance:
            J = lanes.get6(aj, i, GROUPS) + get4(aj, 6 * GROUPS + i, GROUPS)
            J, K, P = kalman(J, (K, P), n, w, tau, model)
            put6(aj, i, J, GROUPS)
            put4(aj, 6 * GROUPS + i, J[6:], GROUPS)
        put6(ap, i, P, GROUPS)
        put4(ax, i, updated_state(get4(ax, i, GROUPS), get(az, i), K, dt, period, model.c), GROUPS)


# ---- windows ------------------------------------------------------------------------------------------------------
@kernel
def remember_plots(recent, z, weight, tau):
    """Add the plots of a scan to recent (3, L, ROW), the last L plots: plot, age, weight, the newest first."""
    a, az, aw, length = address(recent), address(z), address(weight), recent.shape[1]
    zero, ages, weights = full(0.0), length * PITCH, 2 * length * PITCH
    for i in range(GROUPS):
        w = get(aw, i)
        for j in range(length - 1, 0, -1):
            slot, older = j * PITCH + i, (j - 1) * PITCH + i
            put(a, slot, where_greater(w, zero, get(a, older), get(a, slot)))
            put(a, ages + slot, where_greater(w, zero, get(a, ages + older), get(a, ages + slot)) + tau)
            put(a, weights + slot, where_greater(w, zero, get(a, weights + older), get(a, weights + slot)))
        put(a, i, where_greater(w, zero, get(az, i), get(a, i)))
        put(a, ages + i, where_greater(w, zero, zero, get(a, ages + i) + tau))
        put(a, weights + i, where_greater(w, zero, w, get(a, weights + i)))


@inline
def fit_window(filters, plots, f, c, length, size, period):
    """Least squares on the last `length` of recent plots."""
    ax, _, _, ap, _, _, _ = memory_addresses(filters, plots, f, c)
    recent, n = plots.recent[c], plots.n_now[c]
    a, an, longest = address(recent), address(n), recent.shape[1]
    per, twice, half, zero = 1.0 / period, 1.0 / (period * period), 0.5 if size == 3 else 0.0, full(0.0)
    full_rank = full(float(size))
    for i in range(GROUPS):
        Y, b = normal_equations(a, length, longest, i, zero, half)
        rank = get(an, i)
        P = leading_inverse(Y, where_greater(rank, full_rank, full_rank, rank))
        r, v, acceleration = algebra.times(P, b)
        lanes.put3(ax, i, (r, per * v, twice * acceleration), GROUPS)
        put6(ap, i, P, GROUPS)
