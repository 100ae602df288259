"""Sums of errors over the realisations that have an estimate, where plots differ between them; eight at a time.

Letters as in `steps`, and

    e    error of the estimate, x - truth
    f    error of the filter that gains are against (its baseline)
    n    number of plots up to this scan
    s…   sums over realisations, in lanes until `total` adds the lanes, always in the same order

Arrays hold a chunk, as in `steps`."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.kalman_algebra import dot, times
from radarsim.kernels.lane_matrices import get6
from radarsim.kernels.lanes import address, full, get, total, where_greater
from radarsim.studies.sonar.kernels.chunks import GROUPS
from radarsim.studies.sonar.kernels.normal_equations import leading_inverse


class Course(NamedTuple):
    """The targets' states in one coordinate, or (C, …) in all: truth (3,) and the shift (3, CHUNK) of each from it."""

    truth: np.ndarray
    shift: np.ndarray


class Rows(NamedTuple):
    """A filter's estimates in one coordinate, by addresses: Numba would count references to the arrays at each call."""

    x: int  #: (4, CHUNK)
    shift: int  #: of the targets' course
    truth: int  #: of the targets' course
    n: int  #: (CHUNK,) plots of each realisation so far
    used: int  #: (CHUNK,) 1 for a realisation of the block, 0 for one that only fills up the last chunk


@inline
def rows_of(x, course, c, n, used):
    """The rows of an estimate x in coordinate c of the course; all arrays must outlive the rows."""
    truth, shift = course.truth[c], course.shift[c]
    return Rows(address(x), address(shift), address(truth), address(n), address(used))


@kernel_part
def component_sums(j, rows, base, out):
    """Write the number of estimates, Σe, Σe², Σe³, Σe⁴ and Σe²f² of component j to out (6,).

    base is the address of the baseline's estimate, out that of an array."""
    zero, truth = full(0.0), rows.truth[j]
    need, s0, s1, s2, s3, s4, s5 = full(j + 0.5), zero, zero, zero, zero, zero, zero
    for i in range(GROUPS):
        has_estimate = where_greater(get(rows.n, i), need, get(rows.used, i), zero)
        true_value = truth + get(rows.shift, j * GROUPS + i)
        e, f = has_estimate * (get(rows.x, j * GROUPS + i) - true_value), get(base, j * GROUPS + i) - true_value
        ee = e * e
        s0, s1, s2, s3, s4, s5 = s0 + has_estimate, s1 + e, s2 + ee, s3 + ee * e, s4 + ee * ee, s5 + ee * (f * f)
    out[0], out[1], out[2], out[3], out[4], out[5] = total(s0), total(s1), total(s2), total(s3), total(s4), total(s5)


@inline
def nominal_errors(rows, i, units):
    """Errors (3) of group i in units of the nominal σ and of the period; units (σ, period)."""
    sigma, period = units
    x, shift, truth, per = rows.x, rows.shift, rows.truth, 1.0 / sigma
    return (
        per * (get(x, i) - truth[0] - get(shift, i)),
        (period * per) * (get(x, GROUPS + i) - truth[1] - get(shift, GROUPS + i)),
        (period * period * per) * (get(x, 2 * GROUPS + i) - truth[2]),
    )


@kernel_part
def joint_sums(rows, P, size, units, out):
    """Write Σ of the diagonal of P, where estimated, and Σq, Σq², Σp, Σp², where the state is complete, to out (7,).

    q = eᵀ P⁻¹ e and p is the product of the errors in value and rate. P (6, CHUNK) and the first three sums are in
    nominal units; units (σ, period). P and out are addresses."""
    sigma, period = units
    zero, need_value, need_rate, need_acceleration = full(0.0), full(0.5), full(1.5), full(2.5)
    need, full_rank = full(size - 0.5), full(float(size))
    s0, s1, s2, q1, q2, p1, p2 = zero, zero, zero, zero, zero, zero, zero
    to_units = sigma * sigma / period
    for i in range(GROUPS):
        n, used, P_now = get(rows.n, i), get(rows.used, i), get6(P, i, GROUPS)
        s0 = s0 + where_greater(n, need_value, used, zero) * P_now[0]
        s1 = s1 + where_greater(n, need_rate, used, zero) * P_now[3]
        s2 = s2 + where_greater(n, need_acceleration, used, zero) * P_now[5]
        Y = leading_inverse(P_now, where_greater(n, need, full_rank, zero))
        e = nominal_errors(rows, i, units)
        complete = where_greater(n, need, used, zero)
        q, p = complete * dot(e, times(Y, e)), complete * (to_units * (e[0] * e[1]))
        q1, q2, p1, p2 = q1 + q, q2 + q * q, p1 + p, p2 + p * p
    out[0], out[1], out[2] = total(s0), total(s1), total(s2)
    out[3], out[4], out[5], out[6] = total(q1), total(q2), total(p1), total(p2)


@kernel_part
def ahead_sums(rows, size, dt, out):
    """Write Σe, Σe², Σe³, Σe⁴ of the value extrapolated by dt, where the state was complete, to out (4,)."""
    x, truth, zero = rows.x, rows.truth[0], full(0.0)
    half, need, s1, s2, s3, s4 = 0.5 * dt * dt, full(size - 0.5), zero, zero, zero, zero
    for i in range(GROUPS):
        has_estimate = where_greater(get(rows.n, i), need, get(rows.used, i), zero)
        predicted = get(x, i) + dt * get(x, GROUPS + i) + half * get(x, 2 * GROUPS + i)
        e = has_estimate * (predicted - truth - get(rows.shift, i))
        ee = e * e
        s1, s2, s3, s4 = s1 + e, s2 + ee, s3 + ee * e, s4 + ee * ee
    out[0], out[1], out[2], out[3] = total(s1), total(s2), total(s3), total(s4)


@kernel_part
def add_sums(rows, P, size, x_base, size_base, units, index, out, sums):
    """Add the errors of one filter in one coordinate to sums at index (f, k, c); units (σ, period), out (7,) scratch.

    P (6, CHUNK) is the covariance of the filter, x_base (4, CHUNK) the estimate of the baseline and size_base its size,
    0 where no gain is needed."""
    (sigma, period), (f, k, c), base, out_address = units, index, address(x_base), address(out)
    error, paired, joint = address(sums.error[f, k, c]), address(sums.paired[f, k, c]), address(sums.joint[f, k, c])
    believed, estimates = address(sums.believed[f, k, c]), address(sums.estimates[f, k, c])
    for j in range(size):
        component_sums(j, rows, base, out_address)
        estimates[j] += out_address[0]
        for power in range(4):
            error[4 * j + power] += out_address[1 + power]
        if j < size_base:
            paired[j] += out_address[5]
    joint_sums(rows, address(P), size, units, out_address)
    for j in range(size):
        believed[j] += out_address[j] * sigma * sigma / period ** (2 * j)
    for power in range(4):
        joint[power] += out_address[3 + power]


@kernel_part
def add_ahead(rows, size, dt, scratch, sums_ahead):
    """Add the errors of the value extrapolated by dt to sums_ahead (4,); scratch is the address of an array (4,)."""
    ahead_sums(rows, size, dt, scratch)
    for power in range(4):
        sums_ahead[power] += scratch[power]
