"""Sonar filters whose gains all realisations share (P3, fixed pattern of plots).

Chunks of realisations stay in cache, scans are outermost, and each formula is one plain loop. A state has four rows:
value, rate, acceleration and the carried error of the last plot. Coordinates (range, bearing, depth) are filtered
separately, each with its own schedule of gains. A window applies weights to a ring of the last plots. Where the pattern
of plots differs between realisations, the filters of `realisation_gains` are used instead."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part, summing_kernel
from radarsim.kernels.kalman_algebra import constant_acceleration, predict_state
from radarsim.studies.sonar.kernels.chunks import copy_row
from radarsim.studies.sonar.kernels.world import move_and_measure

CHUNK = 512


class SharedBank(NamedTuple):
    """Schedules of F filters, the same for all realisations."""

    gain: np.ndarray  #: (F, K, C, 4) of a recursive filter
    carry: np.ndarray  #: (F, K, C) of a recursive filter
    carries: np.ndarray  #: (F,) whether it carries an error
    length: np.ndarray  #: (F,) plots of a window, 0 for a recursive filter
    #: (F, K, C, 3, L) of a window for the slots of a ring, which plot number n enters at slot n modulo L
    weights: np.ndarray
    slot: np.ndarray  #: (K, C) of a scan's plot, -1 where there is none
    estimated_sizes: np.ndarray  #: (F, K, C) estimated components
    size: np.ndarray  #: (F,) of the state
    inverse: np.ndarray  #: (F, K, C, 6) of the believed covariance


class Sums(NamedTuple):
    """Sums over realisations; `sonar.study` describes them."""

    error: np.ndarray  #: (F, K, C, 3, 4)
    paired: np.ndarray  #: (F, K, C, 3)
    joint: np.ndarray  #: (F, K, C, 4)
    ahead: np.ndarray  #: (F, K, C, 4)
    believed: np.ndarray  #: (F, K, C, 3)
    estimates: np.ndarray  #: (F, K, C, 3)


@kernel_part
def scan_value(x, z, dt, gain):
    """Update a filter that assumes white errors with one scan, in place: x (>= 3, n), plots z (n,), gain (>= 3,)."""
    (r, v, a), F = (x[0], x[1], x[2]), constant_acceleration(dt)
    g0, g1, g2 = gain[0], gain[1], gain[2]
    for i in range(z.size):
        p, q, s = predict_state((r[i], v[i], a[i]), F)
        residual = z[i] - p
        r[i], v[i], a[i] = p + g0 * residual, q + g1 * residual, s + g2 * residual


@kernel_part
def scan_carried(x, z, dt, carry, gain):
    """Update a filter that assumes correlated errors with one scan, in place: x (4, n), the last row is the error."""
    (r, v, a, e), F = (x[0], x[1], x[2], x[3]), constant_acceleration(dt)
    g0, g1, g2, g3 = gain[0], gain[1], gain[2], gain[3]
    for i in range(z.size):
        p, q, s = predict_state((r[i], v[i], a[i]), F)
        carried = carry * e[i]
        residual = z[i] - p - carried
        r[i], v[i], a[i] = p + g0 * residual, q + g1 * residual, s + g2 * residual
        e[i] = carried + g3 * residual


@kernel_part
def window(x, ring, weights):
    """Estimates x (>= 3, n) as weights (3, L) of the plots in the ring (L, n)."""
    for j in range(3):
        x[j, :] = 0.0
        for q in range(ring.shape[0]):
            weight = weights[j, q]
            if weight != 0.0:
                for i in range(x.shape[1]):
                    x[j, i] += weight * ring[q, i]


@kernel_part
def advance(bank, x, ring, plots, k, dt):
    """Update all filters in all coordinates with scan k, in place.

    x (F, C, 4, n), zero before scan 0; ring (C, L, n), plots (C, 4, n)."""
    for c in range(x.shape[1]):
        if bank.slot[k, c] >= 0 and ring.shape[1] > 0:
            copy_row(plots[c, 0], ring[c, bank.slot[k, c]])
    for f in range(x.shape[0]):
        for c in range(x.shape[1]):
            if bank.length[f] > 0:
                window(x[f, c], ring[c], bank.weights[f, k, c])
            elif bank.carries[f]:
                scan_carried(x[f, c], plots[c, 0], dt, bank.carry[f, k, c], bank.gain[f, k, c])
            else:
                scan_value(x[f, c], plots[c, 0], dt, bank.gain[f, k, c])


@inline
def powers(e):
    """e, e², e³, e⁴."""
    ee = e * e
    return e, ee, e * ee, ee * ee


@summing_kernel
def error_sums(x, y, shift, truth, inverse, n):
    """Sums over the first n realisations of the errors of a state x (>= 3, n).

    For value, rate and acceleration: e, e², e³, e⁴, and e² f² with the error f of filter y; then q, q², p, p² of
    q = eᵀ P⁻¹ e, with the inverse (6,) packed by rows, and of p, the product of the errors in value and rate. shift
    (2, n) is the deviation of value and rate from the truth (3,)."""
    t0, t1, t2 = truth[0], truth[1], truth[2]
    y00, y01, y02, y11, y12, y22 = inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5]
    a1 = a2 = a3 = a4 = b1 = b2 = b3 = b4 = c1 = c2 = c3 = c4 = 0.0
    p0 = p1 = p2 = q1 = q2 = r1 = r2 = 0.0
    for i in range(n):
        m0, m1 = t0 + shift[0, i], t1 + shift[1, i]
        e0, e1, e2 = x[0, i] - m0, x[1, i] - m1, x[2, i] - t2
        f0, f1, f2 = y[0, i] - m0, y[1, i] - m1, y[2, i] - t2
        _, aa, aaa, aaaa = powers(e0)
        _, bb, bbb, bbbb = powers(e1)
        _, cc, ccc, cccc = powers(e2)
        a1, a2, a3, a4 = a1 + e0, a2 + aa, a3 + aaa, a4 + aaaa
        b1, b2, b3, b4 = b1 + e1, b2 + bb, b3 + bbb, b4 + bbbb
        c1, c2, c3, c4 = c1 + e2, c2 + cc, c3 + ccc, c4 + cccc
        p0, p1, p2 = p0 + aa * (f0 * f0), p1 + bb * (f1 * f1), p2 + cc * (f2 * f2)
        ab = e0 * e1
        q = y00 * aa + y11 * bb + y22 * cc + 2.0 * (y01 * ab + y02 * e0 * e2 + y12 * e1 * e2)
        q1, q2, r1, r2 = q1 + q, q2 + q * q, r1 + ab, r2 + ab * ab
    return (a1, a2, a3, a4, b1, b2, b3, b4, c1, c2, c3, c4), (p0, p1, p2), (q1, q2, r1, r2)


@summing_kernel
def ahead_sums(x, shift, truth, dt, n):
    """Sums over the first n realisations of e, e², e³, e⁴ of the value extrapolated by dt, against the truth then."""
    half = 0.5 * dt * dt
    s1 = s2 = s3 = s4 = 0.0
    for i in range(n):
        e, ee, eee, eeee = powers(x[0, i] + dt * x[1, i] + half * x[2, i] - truth - shift[0, i])
        s1, s2, s3, s4 = s1 + e, s2 + ee, s3 + eee, s4 + eeee
    return s1, s2, s3, s4


@kernel_part
def add_sums(bank, x, plots, truth, k, n, baseline, sums):
    """Add the errors at scan k: x (F, C, 4, CHUNK), plots (C, 4, CHUNK), truth (C, 3)."""
    for f in range(x.shape[0]):
        for c in range(x.shape[1]):
            powers_of_error, paired, joint = error_sums(
                x[f, c], x[baseline, c], plots[c, 2:], truth[c], bank.inverse[f, k, c], n
            )
            size = bank.estimated_sizes[f, k, c]
            for j in range(size):
                for q in range(4):
                    sums.error[f, k, c, j, q] += powers_of_error[4 * j + q]
                if j < bank.estimated_sizes[baseline, k, c]:
                    sums.paired[f, k, c, j] += paired[j]
            if size == bank.size[f]:
                for q in range(4):
                    sums.joint[f, k, c, q] += joint[q]


@kernel_part
def add_ahead(bank, x, plots, truth, k, dt, n, sums):
    """Add the errors at scan k of values extrapolated from scan k - 1, where the state was complete."""
    for f in range(x.shape[0]):
        for c in range(x.shape[1]):
            if bank.estimated_sizes[f, k - 1, c] == bank.size[f]:
                powers_of_error = ahead_sums(x[f, c], plots[c, 2:], truth[c, 0], dt, n)
                for q in range(4):
                    sums.ahead[f, k - 1, c, q] += powers_of_error[q]


@kernel_part
def keep_errors(x, plots, truth, errors):
    """Write the errors of x (F, C, 4, CHUNK) to errors (F, C, S, n)."""
    for f in range(errors.shape[0]):
        for c in range(errors.shape[1]):
            for j in range(errors.shape[2]):
                for i in range(errors.shape[3]):
                    true = truth[c, j] + plots[c, 2 + j, i] if j < 2 else truth[c, j]
                    errors[f, c, j, i] = x[f, c, j, i] - true


@kernel
def simulate_block(world, bank, first, count, baseline, sums, errors):
    """Add the sums of realisations first … first + count - 1; gains refer to filter `baseline`.

    errors (F, K, C, S, count or 0) takes the errors of all realisations. The last chunk is always computed in full, but
    only the requested realisations are summed."""
    filters, scans, coordinates = bank.gain.shape[:3]
    x = np.empty((filters, coordinates, 4, CHUNK))
    ring = np.empty((coordinates, bank.weights.shape[4], CHUNK))
    plots = np.empty((world.walk.size, 4, CHUNK))
    for done in range(0, count, CHUNK):
        x[:], ring[:], plots[:] = 0.0, 0.0, 0.0
        n = min(CHUNK, count - done)
        for k in range(scans):
            move_and_measure(world, first + done, k, plots)
            if k > 0:
                add_ahead(bank, x, plots, world.truth[k], k, world.dt[k], n, sums)
            advance(bank, x, ring, plots, k, world.dt[k])
            add_sums(bank, x, plots, world.truth[k], k, n, baseline, sums)
            if errors.shape[4] > 0:
                keep_errors(x, plots, world.truth[k], errors[:, k, :, :, done : done + n])
