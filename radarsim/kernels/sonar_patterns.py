"""Sonar filters where every realisation has its own pattern of missed plots, or weights: gains go along with it.

The same filters as in `sonar`, with what `filters.sonar` reckons once now reckoned for each realisation, in chunks.
All but the windows take least squares in information form (`inform`) up to their start; growing memory and the
differenced filter go on with it, the Kalman filters and those of fixed gain go over to covariances (`believe`).
Inside, times are in periods and weights relative to the nominal plot; a weight of zero is a missed plot.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, summing
from radarsim.kernels.linear import extrapolated
from radarsim.kernels.random import U, uniforms
from radarsim.kernels.sonar import CHUNK, move_and_measure, powers

INFORMATION, COVARIANCE, FIXED, WINDOW = range(4)
PLACED = 8.0  # as models.sonar.PLACED


class Sight(NamedTuple):
    """Which plots come, and how they are turned into what the filters take.

    misses (2,) is the key of the stream of detections; certain (K,) is 1 where the plot always comes, 0 where never,
    else -1: with `probability`. weight (K, C) of a plot that comes; period in s and nominal sigma (C,) make gains
    physical. frame is 0 for coordinates as measured, 1 for the plain conversion of the first two, 2 for the unbiased
    one; measured (K, 2) then holds the true range and bearing and spread (2,) their standard deviations.
    """

    misses: np.ndarray
    certain: np.ndarray
    probability: float
    weight: np.ndarray
    period: float
    sigma: np.ndarray
    frame: int
    measured: np.ndarray
    spread: np.ndarray


class Bank(NamedTuple):
    """F filters: kind (F,), size (F,) of the state, length (F,) of a window or of the start of a fixed filter.

    carry (F, K, C) correlation that the filter assumes, manoeuvre (F, C) variance in nominal plots and periods, settled
    (F, C, 3) gains of a fixed filter, likewise.
    """

    kind: np.ndarray
    size: np.ndarray
    length: np.ndarray
    carry: np.ndarray
    manoeuvre: np.ndarray
    settled: np.ndarray


# ---- plots --------------------------------------------------------------------------------------------------------
@kernel
def detect(sight, first, k, seen):
    """Whether the plot of scan k came, 1 or 0, in seen (n,)."""
    k0, k1, start, limit = sight.misses[0], sight.misses[1], U(first), sight.probability
    if sight.certain[k] >= 0:
        seen[:] = float(sight.certain[k])
        return
    for i in range(seen.size):
        a, _ = uniforms(k0, k1, start + U(i), k)
        seen[i] = 1.0 if a < limit else 0.0


@kernel
def weigh(sight, k, plots, seen, place, z, weight):
    """Plots z (C, n) and their weights (C, n) from what was measured: plots (C', 4, n), rows 0 and 1.

    place (3, n) holds mean range and bearing of the last plots, and how many they are. The plain conversion has its
    weights from the plot itself; the unbiased one from the plots before, lest a weight go with the error of its own
    plot, which would be a bias again (the decorrelation of Bordonaro, Willett and Bar-Shalom 2014, who take the
    predicted place). See `models.sonar.places`.
    """
    for c in range(z.shape[0]):
        w = sight.weight[k, c]
        for i in range(seen.size):
            z[c, i] = plots[c, 0, i]
            weight[c, i] = w * seen[i]
    if sight.frame == 0:
        return
    sr, sb = sight.spread[0] ** 2, sight.spread[1] ** 2
    nominal_x, nominal_y = sight.sigma[0] ** 2, sight.sigma[1] ** 2
    grow = np.exp(sb) if sight.frame == 2 else 1.0
    root, shrink = np.sqrt(grow), np.exp(-2.0 * sb)
    for i in range(seen.size):
        r, b = sight.measured[k, 0] + plots[0, 1, i], sight.measured[k, 1] + plots[1, 1, i]
        co, si = np.cos(b), np.sin(b)
        z[0, i], z[1, i] = root * r * co, root * r * si
        if sight.frame == 1:
            across = r * r * sb
            xx, yy = sr * co * co + across * si * si, sr * si * si + across * co * co
        else:
            r_now, b_now = r, b
            if place[2, i] > 0.0:
                r, b = place[0, i], place[1, i]
                co, si = np.cos(b), np.sin(b)
            if seen[i] > 0.0:
                place[2, i] = min(place[2, i] + 1.0, PLACED)
                place[0, i] += (r_now - place[0, i]) / place[2, i]
                place[1, i] += (b_now - place[1, i]) / place[2, i]
            power, twice = 0.5 * grow * (r * r + sr), shrink * (co * co - si * si)
            xx, yy = power * (1.0 + twice) - r * r * co * co, power * (1.0 - twice) - r * r * si * si
        weight[0, i], weight[1, i] = seen[i] * nominal_x / xx, seen[i] * nominal_y / yy


# ---- least squares so far -----------------------------------------------------------------------------------------
@inline
def inverse(y00, y01, y02, y11, y12, y22, rank):
    """Inverse, packed by rows, of the leading block of size rank (0 to 3) of a symmetric matrix; zero outside."""
    one = 1.0 / (y00 if rank >= 1.0 else 1.0)
    two = 1.0 / (y00 * y11 - y01 * y01 if rank >= 2.0 else 1.0)
    c0, c1, c2 = y11 * y22 - y12 * y12, y02 * y12 - y01 * y22, y01 * y12 - y02 * y11
    three = 1.0 / (y00 * c0 + y01 * c1 + y02 * c2 if rank >= 3.0 else 1.0)
    full, half, least = rank >= 3.0, rank >= 2.0, rank >= 1.0
    p00 = c0 * three if full else (y11 * two if half else (one if least else 0.0))
    p01 = c1 * three if full else (-y01 * two if half else 0.0)
    p11 = (y00 * y22 - y02 * y02) * three if full else (y00 * two if half else 0.0)
    p02 = c2 * three if full else 0.0
    p12 = (y01 * y02 - y00 * y12) * three if full else 0.0
    p22 = (y00 * y11 - y01 * y01) * three if full else 0.0
    return p00, p01, p02, p11, p12, p22


@kernel
def inform(y, before, weight, tau, carry, size, gain, P):
    """One scan of `filters.sonar.differenced`: information y (8, n), its gains (4, n) and covariance P (6, n).

    Rows 6 and 7 of y are age and correlation of the last plot; before (n,) counts the plots so far.
    """
    second = 1.0 if size == 3 else 0.0
    carried = 1.0 if carry != 0.0 else 0.0
    half = 0.5 * tau * tau
    for i in range(weight.size):
        y00, y01, y02, y11, y12, y22 = y[0, i], y[1, i], y[2, i], y[3, i], y[4, i], y[5, i]
        # F⁻ᵀ Y F⁻¹ over the interval tau.
        u0, u1, u2 = half * y00 - tau * y01 + y02, half * y01 - tau * y11 + y12, half * y02 - tau * y12 + y22
        y11, y01 = tau * (tau * y00 - 2.0 * y01) + y11, y01 - tau * y00
        y02, y12, y22 = u0, u1 - tau * u0, half * u0 - tau * u1 + u2
        age, c, w = y[6, i] + tau, y[7, i] * carry, weight[i]
        new = w / (1.0 - c * c)
        h0, h1, h2 = 1.0 - c, c * age, -0.5 * second * c * age * age
        y00, y01, y02 = y00 + new * h0 * h0, y01 + new * h0 * h1, y02 + new * h0 * h2
        y11, y12, y22 = y11 + new * h1 * h1, y12 + new * h1 * h2, y22 + new * h2 * h2
        seen = w > 0.0
        rank = min(before[i] + (1.0 if seen else 0.0), float(size))
        p00, p01, p02, p11, p12, p22 = inverse(y00, y01, y02, y11, y12, y22, rank)
        g0 = new * (p00 * h0 + p01 * h1 + p02 * h2)
        gain[0, i] = g0
        gain[1, i] = new * (p01 * h0 + p11 * h1 + p12 * h2)
        gain[2, i] = new * (p02 * h0 + p12 * h1 + p22 * h2)
        gain[3, i] = carried * (1.0 - g0 if seen else 0.0)
        y[0, i], y[1, i], y[2, i], y[3, i], y[4, i], y[5, i] = y00, y01, y02, y11, y12, y22
        y[6, i], y[7, i] = (0.0 if seen else age), (1.0 if seen else c)
        P[0, i], P[1, i], P[2, i], P[3, i], P[4, i], P[5, i] = p00, p01, p02, p11, p12, p22


@kernel
def believe(s, before, weight, tau, carry, size, start, manoeuvre, settled, gain, P):
    """Covariance s (10, n) of state and carried error by one scan; replaces gain (4, n) and P (6, n) after `start`.

    start counts plots. Rows of s: the six of P, then the three covariances with the error and its variance. settled
    (3,) are fixed gains, all zero for the Kalman gain; P S is taken off in the form that holds for any gain.
    """
    half, fixed = 0.5 * tau * tau, settled[0] > 0.0
    m0, m1, m2 = (half, tau, 0.0) if size == 2 else (tau * half / 3.0, half, tau)
    t0, t1, t2 = settled[0], settled[1], settled[2]
    for i in range(weight.size):
        p00, p01, p02, p11, p12, p22 = s[0, i], s[1, i], s[2, i], s[3, i], s[4, i], s[5, i]
        q0, q1, q2, e = s[6, i], s[7, i], s[8, i], s[9, i]
        # F P Fᵀ + Q; the error's variance stays what it is in a stationary process.
        a0, a1, a2 = p00 + tau * p01 + half * p02, p01 + tau * p11 + half * p12, p02 + tau * p12 + half * p22
        b1, b2 = p11 + tau * p12, p12 + tau * p22
        p00, p01, p02 = a0 + tau * a1 + half * a2 + manoeuvre * m0 * m0, a1 + tau * a2 + manoeuvre * m0 * m1, a2
        p02 += manoeuvre * m0 * m2
        p11, p12, p22 = b1 + tau * b2 + manoeuvre * m1 * m1, b2 + manoeuvre * m1 * m2, p22 + manoeuvre * m2 * m2
        q0, q1, q2 = carry * (q0 + tau * q1 + half * q2), carry * (q1 + tau * q2), carry * q2
        seen = weight[i] > 0.0
        fresh = 1.0 / (weight[i] if seen else 1.0)
        e = carry * carry * e + (1.0 - carry * carry) * fresh
        k0, k1, k2, k3 = p00 + q0, p01 + q1, p02 + q2, q0 + e
        S = k0 + k3
        per = (1.0 if seen else 0.0) / S
        g0, g1, g2, g3 = k0 * per, k1 * per, k2 * per, k3 * per
        if fixed:
            taken = 1.0 if seen else 0.0
            g0, g1, g2, g3 = t0 * taken, t1 * taken, t2 * taken, 0.0
        p00 += g0 * (g0 * S - 2.0 * k0)
        p01 += g0 * (g1 * S - k1) - k0 * g1
        p02 += g0 * (g2 * S - k2) - k0 * g2
        p11 += g1 * (g1 * S - 2.0 * k1)
        p12 += g1 * (g2 * S - k2) - k1 * g2
        p22 += g2 * (g2 * S - 2.0 * k2)
        q0 += g0 * (g3 * S - k3) - k0 * g3
        q1 += g1 * (g3 * S - k3) - k1 * g3
        q2 += g2 * (g3 * S - k3) - k2 * g3
        e += g3 * (g3 * S - 2.0 * k3)
        early = before[i] < start
        s[0, i] = P[0, i] if early else p00
        s[1, i] = P[1, i] if early else p01
        s[2, i] = P[2, i] if early else p02
        s[3, i] = P[3, i] if early else p11
        s[4, i] = P[4, i] if early else p12
        s[5, i] = P[5, i] if early else p22
        # Right after a plot H x + e is known: the error's covariances are those of the state, negative.
        s[6, i] = -P[0, i] if early else q0
        s[7, i] = -P[1, i] if early else q1
        s[8, i] = -P[2, i] if early else q2
        s[9, i] = P[0, i] if early else e
        gain[0, i] = gain[0, i] if early else g0
        gain[1, i] = gain[1, i] if early else g1
        gain[2, i] = gain[2, i] if early else g2
        gain[3, i] = gain[3, i] if early else g3 * (1.0 if carry != 0.0 else 0.0)
    for j in range(6):
        P[j] = s[j]


@kernel
def scan(x, z, dt, carry, period, gain):
    """One scan, in place, with gains of each realisation's own: x (4, n), z (n,), gain (4, n) per period."""
    one, two = 1.0 / period, 1.0 / (period * period)
    for i in range(z.size):
        p, q, s = extrapolated(x[0, i], x[1, i], x[2, i], dt)
        foreseen = carry * x[3, i]
        residual = z[i] - p - foreseen
        x[0, i], x[1, i] = p + gain[0, i] * residual, q + one * gain[1, i] * residual
        x[2, i], x[3, i] = s + two * gain[2, i] * residual, foreseen + gain[3, i] * residual


# ---- window -------------------------------------------------------------------------------------------------------
@kernel
def remember(memory, z, weight, tau):
    """Enter the plots of a scan into memory (3, L, n) of the last L: plot, age, weight, the newest first."""
    length = memory.shape[1]
    for q in range(length - 1, -1, -1):
        for i in range(z.size):
            seen = weight[i] > 0.0
            older = q - 1 if q > 0 else 0
            memory[0, q, i] = (memory[0, older, i] if q > 0 else z[i]) if seen else memory[0, q, i]
            memory[1, q, i] = (memory[1, older, i] + tau if q > 0 else 0.0) if seen else memory[1, q, i] + tau
            memory[2, q, i] = (memory[2, older, i] if q > 0 else weight[i]) if seen else memory[2, q, i]


@kernel
def fit(x, memory, length, size, period, count, scratch, P):
    """Least squares on the last `length` plots in memory: x (4, n), P (6, n); scratch (8, n)."""
    second = 1.0 if size == 3 else 0.0
    scratch[:] = 0.0
    for q in range(length):
        for i in range(x.shape[1]):
            w, age, z = memory[2, q, i], memory[1, q, i], memory[0, q, i]
            one, two = -age, 0.5 * second * age * age
            scratch[0, i] += w
            scratch[1, i] += w * one
            scratch[2, i] += w * two
            scratch[3, i] += w * one * one
            scratch[4, i] += w * one * two
            scratch[5, i] += w * two * two
            scratch[6, i] += w * z
            scratch[7, i] += w * one * z
            x[3, i] = (x[3, i] if q > 0 else 0.0) + w * two * z
    for i in range(x.shape[1]):
        rank = min(count[i], float(size))
        y = scratch
        p00, p01, p02, p11, p12, p22 = inverse(y[0, i], y[1, i], y[2, i], y[3, i], y[4, i], y[5, i], rank)
        b0, b1, b2 = y[6, i], y[7, i], x[3, i]
        x[0, i] = p00 * b0 + p01 * b1 + p02 * b2
        x[1, i] = (p01 * b0 + p11 * b1 + p12 * b2) / period
        x[2, i] = (p02 * b0 + p12 * b1 + p22 * b2) / (period * period)
        P[0, i], P[1, i], P[2, i], P[3, i], P[4, i], P[5, i] = p00, p01, p02, p11, p12, p22


# ---- sums ---------------------------------------------------------------------------------------------------------
@summing
def error_sums(x, y, shift, truth, count, need, n):
    """Seven sums over those of the first n with `need` plots or more: their number, e, e², e³, e⁴, e² f², f of filter
    y.
    """
    s0 = s1 = s2 = s3 = s4 = s5 = 0.0
    for i in range(n):
        known = 1.0 if count[i] >= need else 0.0
        moved = truth + shift[i]
        e, ee, eee, eeee = powers(known * (x[i] - moved))
        f = y[i] - moved
        s0, s1, s2, s3, s4, s5 = s0 + known, s1 + e, s2 + ee, s3 + eee, s4 + eeee, s5 + ee * (f * f)
    return s0, s1, s2, s3, s4, s5


@summing
def believed_sums(x, P, shift, truth, count, size, period, sigma, n):
    """Sums of P's diagonal where there are plots for it, and of q and q² where the state is complete.

    P in nominal units.
    """
    s0 = s1 = s2 = q1 = q2 = r1 = r2 = 0.0
    one = 1.0 / sigma
    for i in range(n):
        s0 += P[0, i] if count[i] >= 1.0 else 0.0
        s1 += P[3, i] if count[i] >= 2.0 else 0.0
        s2 += P[5, i] if count[i] >= 3.0 else 0.0
        full = count[i] >= size
        e0, e1 = (x[0, i] - truth[0] - shift[0, i]) * one, (x[1, i] - truth[1] - shift[1, i]) * (period * one)
        e2 = (x[2, i] - truth[2]) * (period * period * one)
        y00, y01, y02, y11, y12, y22 = inverse(
            P[0, i], P[1, i], P[2, i], P[3, i], P[4, i], P[5, i], size if full else 0.0
        )
        q = e0 * (y00 * e0 + 2.0 * (y01 * e1 + y02 * e2)) + e1 * (y11 * e1 + 2.0 * y12 * e2) + y22 * e2 * e2
        ab = (x[0, i] - truth[0] - shift[0, i]) * (x[1, i] - truth[1] - shift[1, i]) if full else 0.0
        q1, q2, r1, r2 = q1 + q, q2 + q * q, r1 + ab, r2 + ab * ab
    return (s0, s1, s2), (q1, q2, r1, r2)


@kernel
def add_sums(bank, sight, x, P, shift, truth, count, c, f, k, n, baseline, sums):
    """Add the errors of one filter and coordinate at scan k: x (F, C, 4, CHUNK), P (6, CHUNK), shift (3, CHUNK), last
    zero.
    """
    unit = sight.sigma[c] ** 2
    for j in range(bank.size[f]):
        # Where the filter beside has no such component it is all zeros: its product is not used.
        s = error_sums(x[f, c, j], x[baseline, c, j], shift[j], truth[j], count, float(j + 1), n)
        sums.estimates[f, k, c, j] += s[0]
        for q in range(4):
            sums.error[f, k, c, j, q] += s[1 + q]
        if j < bank.size[baseline]:
            sums.paired[f, k, c, j] += s[5]
    size = float(bank.size[f])
    claimed, joint = believed_sums(x[f, c], P, shift, truth, count, size, sight.period, sight.sigma[c], n)
    for j in range(bank.size[f]):
        sums.believed[f, k, c, j] += claimed[j] * unit / sight.period ** (2 * j)
    for q in range(4):
        sums.joint[f, k, c, q] += joint[q]


@summing
def ahead_sums(x, shift, truth, dt, count, size, n):
    """Sums of e, e², e³, e⁴ over the first n of the value extrapolated by dt, where the state was complete."""
    half = 0.5 * dt * dt
    s1 = s2 = s3 = s4 = 0.0
    for i in range(n):
        known = 1.0 if count[i] >= size else 0.0
        e, ee, eee, eeee = powers(known * (x[0, i] + dt * x[1, i] + half * x[2, i] - truth - shift[i]))
        s1, s2, s3, s4 = s1 + e, s2 + ee, s3 + eee, s4 + eeee
    return s1, s2, s3, s4


@kernel
def add_ahead(bank, x, shift, truth, count, k, dt, n, sums):
    """Add the errors at scan k of what was extrapolated from scan k - 1; count (C, CHUNK) before scan k."""
    for f in range(x.shape[0]):
        for c in range(x.shape[1]):
            found = ahead_sums(x[f, c], shift[c, 0], truth[c, 0], dt, count[c], float(bank.size[f]), n)
            for q in range(4):
                sums.ahead[f, k - 1, c, q] += found[q]


@kernel
def filter_scan(bank, sight, f, c, k, dt, x, y, s, memory, z, weight, before, count, gain, P):
    """Scan k of filter f in coordinate c, in place: x (4, n), y (8, n), s (10, n), memory (3, L, n).

    Leaves P (6, n).
    """
    tau, size, carry = dt / sight.period, bank.size[f], bank.carry[f, k, c]
    if bank.kind[f] == WINDOW:
        fit(x, memory, bank.length[f], size, sight.period, count, y, P)
        return
    inform(y, before, weight, tau, carry, size, gain, P)
    if bank.kind[f] != INFORMATION:
        believe(
            s,
            before,
            weight,
            tau,
            carry,
            size,
            max(size, bank.length[f]),
            bank.manoeuvre[f, c],
            bank.settled[f, c],
            gain,
            P,
        )
    scan(x, z, dt, carry, sight.period, gain)


@kernel
def simulate_block(world, sight, bank, first, total, baseline, sums):
    """Add the sums of realisations first … first + total - 1.

    A partial chunk is computed in full and summed in part.
    """
    filters, scans, coordinates = bank.carry.shape
    x, y = np.empty((filters, coordinates, 4, CHUNK)), np.empty((filters, coordinates, 8, CHUNK))
    s = np.empty((filters, coordinates, 10, CHUNK))
    memory = np.empty((coordinates, 3, np.where(bank.kind == WINDOW, bank.length, 0).max(), CHUNK))
    plots, shift = np.empty((world.walk.size, 4, CHUNK)), np.zeros((coordinates, 3, CHUNK))
    z, weight, seen = np.empty((coordinates, CHUNK)), np.empty((coordinates, CHUNK)), np.empty(CHUNK)
    place, before, count = np.empty((3, CHUNK)), np.empty((coordinates, CHUNK)), np.empty((coordinates, CHUNK))
    gain, P = np.empty((4, CHUNK)), np.empty((filters, 6, CHUNK))
    for done in range(0, total, CHUNK):
        x[:], y[:], s[:], memory[:], plots[:], count[:], place[:] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        n = min(CHUNK, total - done)
        for k in range(scans):
            dt, truth = world.dt[k], world.truth[k]
            move_and_measure(world, first + done, k, plots)
            detect(sight, first + done, k, seen)
            weigh(sight, k, plots, seen, place, z, weight)
            shift[:, :2] = plots[:coordinates, 2:]
            if k > 0:
                add_ahead(bank, x, shift, truth, count, k, dt, n, sums)
            before[:] = count
            for c in range(coordinates):
                if memory.shape[2] > 0:
                    remember(memory[c], z[c], weight[c], dt / sight.period)
                for i in range(CHUNK):
                    count[c, i] += 1.0 if weight[c, i] > 0.0 else 0.0
                for f in range(filters):
                    filter_scan(
                        *(bank, sight, f, c, k, dt, x[f, c], y[f, c], s[f, c], memory[c], z[c], weight[c]),
                        *(before[c], count[c], gain, P[f]),
                    )
                for f in range(filters):
                    add_sums(bank, sight, x, P[f], shift[c], truth[c], count[c], c, f, k, n, baseline, sums)
