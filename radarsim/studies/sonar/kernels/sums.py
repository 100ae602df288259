"""Sums of errors over the realisations that have an estimate, where plots differ between them; eight at a time.

Letters as in `steps`, and

    e    error of the estimate, x - truth
    f    error of the filter that gains are against (its baseline)
    n    number of plots up to this scan
    s…   sums over realisations, in lanes until `total` adds the lanes, always in the same order

Arrays hold a chunk, as in `steps`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import address, full, get, total, where_greater
from radarsim.studies.sonar.kernels.steps import GROUPS, inverse, six


class Estimate(NamedTuple):
    """A filter's estimate in one coordinate: x (4, CHUNK), covariance P (6, CHUNK), size of the state.

    x_base (4, CHUNK) is the baseline's estimate and size_base its size, 0 where no gain is needed.
    """

    x: np.ndarray
    P: np.ndarray
    size: int
    x_base: np.ndarray
    size_base: int


class Course(NamedTuple):
    """The targets' states in one coordinate, or (C, …) in all: truth (3,) and the shift (3, CHUNK) of each from it."""

    truth: np.ndarray
    shift: np.ndarray


class Counted(NamedTuple):
    """Which realisations count: n (CHUNK,) plots of each so far, or (C, CHUNK) of all coordinates; used (CHUNK,) is 1
    for a realisation of the block and 0 for one that only fills up the last chunk.
    """

    n: np.ndarray
    used: np.ndarray


@part
def component_sums(j, x, x_base, course, counted, out):
    """Write the number of estimates, Σe, Σe², Σe³, Σe⁴ and Σe²f² of component j to out (6,); x, x_base (4, CHUNK)."""
    ax, ab, moved, zero = address(x), address(x_base), address(course.shift[j]), full(0.0)
    an, au, truth = address(counted.n), address(counted.used), course.truth[j]
    need, s0, s1, s2, s3, s4, s5 = full(j + 0.5), zero, zero, zero, zero, zero, zero
    for i in range(GROUPS):
        known = where_greater(get(an, i), need, get(au, i), zero)
        place = truth + get(moved, i)
        e, f = known * (get(ax, j * GROUPS + i) - place), get(ab, j * GROUPS + i) - place
        ee = e * e
        s0, s1, s2, s3, s4, s5 = s0 + known, s1 + e, s2 + ee, s3 + ee * e, s4 + ee * ee, s5 + ee * (f * f)
    out[0], out[1], out[2], out[3], out[4], out[5] = total(s0), total(s1), total(s2), total(s3), total(s4), total(s5)


@inline
def nominal_errors(x, shift, truth, i, units):
    """Errors (3) of group i in units of the nominal σ and of the period; units (σ, period)."""
    sigma, period = units
    per = 1.0 / sigma
    return (
        per * (get(x, i) - truth[0] - get(shift, i)),
        (period * per) * (get(x, GROUPS + i) - truth[1] - get(shift, GROUPS + i)),
        (period * period * per) * (get(x, 2 * GROUPS + i) - truth[2]),
    )


@inline
def quadratic_form(Y, e):
    """eᵀ Y e."""
    return (
        e[0] * (Y[0] * e[0] + 2.0 * (Y[1] * e[1] + Y[2] * e[2]))
        + e[1] * (Y[3] * e[1] + 2.0 * Y[4] * e[2])
        + Y[5] * e[2] * e[2]
    )


@part
def joint_sums(x, P, size, course, counted, units, out):
    """Write Σ of the diagonal of P, where estimated, and Σq, Σq², Σp, Σp², where the state is complete, to out (7,).

    q = eᵀ P⁻¹ e and p is the product of the errors in value and rate. x (4, CHUNK); P (6, CHUNK) and the first three
    sums are in nominal units; units (σ, period).
    """
    ax, ap, moved, truth = address(x), address(P), address(course.shift), course.truth
    an, au, (sigma, period) = address(counted.n), address(counted.used), units
    zero, one, two, three = full(0.0), full(0.5), full(1.5), full(2.5)
    need, most = full(size - 0.5), full(float(size))
    s0, s1, s2, q1, q2, p1, p2 = zero, zero, zero, zero, zero, zero, zero
    to_units = sigma * sigma / period
    for i in range(GROUPS):
        n, used, P_now = get(an, i), get(au, i), six(ap, i)
        s0 = s0 + where_greater(n, one, used, zero) * P_now[0]
        s1 = s1 + where_greater(n, two, used, zero) * P_now[3]
        s2 = s2 + where_greater(n, three, used, zero) * P_now[5]
        Y = inverse(P_now, where_greater(n, need, most, zero))
        e = nominal_errors(ax, moved, truth, i, units)
        complete = where_greater(n, need, used, zero)
        q, p = complete * quadratic_form(Y, e), complete * (to_units * (e[0] * e[1]))
        q1, q2, p1, p2 = q1 + q, q2 + q * q, p1 + p, p2 + p * p
    out[0], out[1], out[2] = total(s0), total(s1), total(s2)
    out[3], out[4], out[5], out[6] = total(q1), total(q2), total(p1), total(p2)


@part
def ahead_sums(x, size, course, counted, dt, out):
    """Write Σe, Σe², Σe³, Σe⁴ of the value extrapolated by dt, where the state was complete, to out (4,)."""
    ax, moved, truth = address(x), address(course.shift), course.truth[0]
    an, au, zero = address(counted.n), address(counted.used), full(0.0)
    half, need, s1, s2, s3, s4 = 0.5 * dt * dt, full(size - 0.5), zero, zero, zero, zero
    for i in range(GROUPS):
        known = where_greater(get(an, i), need, get(au, i), zero)
        predicted = get(ax, i) + dt * get(ax, GROUPS + i) + half * get(ax, 2 * GROUPS + i)
        e = known * (predicted - truth - get(moved, i))
        ee = e * e
        s1, s2, s3, s4 = s1 + e, s2 + ee, s3 + ee * e, s4 + ee * ee
    out[0], out[1], out[2], out[3] = total(s1), total(s2), total(s3), total(s4)


@part
def add_sums(estimate, course, counted, units, at, out, sums):
    """Add the errors of one filter in one coordinate; units (σ, period), at (f, k, c), out (7,) scratch."""
    (sigma, period), (f, k, c) = units, at
    for j in range(estimate.size):
        component_sums(j, estimate.x, estimate.x_base, course, counted, out)
        sums.estimates[f, k, c, j] += out[0]
        for power in range(4):
            sums.error[f, k, c, j, power] += out[1 + power]
        if j < estimate.size_base:
            sums.paired[f, k, c, j] += out[5]
    joint_sums(estimate.x, estimate.P, estimate.size, course, counted, units, out)
    for j in range(estimate.size):
        sums.believed[f, k, c, j] += out[j] * sigma * sigma / period ** (2 * j)
    for power in range(4):
        sums.joint[f, k, c, power] += out[3 + power]


@part
def add_ahead(sizes, x, course, counted, k, dt, out, sums):
    """Add the errors at scan k of values extrapolated from scan k - 1, for all filters and coordinates.

    x (F, C, 4, CHUNK); course and counted of all coordinates, n of plots before scan k.
    """
    for f in range(x.shape[0]):
        for c in range(x.shape[1]):
            own = Course(course.truth[c], course.shift[c])
            ahead_sums(x[f, c], sizes[f], own, Counted(counted.n[c], counted.used), dt, out)
            for power in range(4):
                sums.ahead[f, k - 1, c, power] += out[power]
