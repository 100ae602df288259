"""Sums of errors where each realisation has its own plots: over those that have an estimate, eight at a time.

Rows of the arrays are of one chunk, as in `sonar_steps`; used (CHUNK,) is 1 for a realisation that counts and 0 for
one that only fills a partial chunk up. The lanes are added at the end, always in the same order.
"""

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.lanes import address, full, get, total, where_greater
from radarsim.studies.sonar.kernels.steps import GROUPS, inverse, six


@kernel
def component_sums(x, y, j, shift, truth, count, used, out):
    """Of component j: how many have it, Σe, Σe², Σe³, Σe⁴, and Σe²f², f the error of the filter beside, into out (6,).

    x and y (4, CHUNK) estimates of this filter and the one beside; shift (CHUNK,) the deviation from truth, a number.
    """
    ax, ay, moved, ac, au, zero = address(x), address(y), address(shift), address(count), address(used), full(0.0)
    need, s0, s1, s2, s3, s4, s5 = full(j + 0.5), zero, zero, zero, zero, zero, zero
    for i in range(GROUPS):
        known = where_greater(get(ac, i), need, get(au, i), zero)
        place = truth + get(moved, i)
        e, f = known * (get(ax, j * GROUPS + i) - place), get(ay, j * GROUPS + i) - place
        ee = e * e
        s0, s1, s2, s3, s4, s5 = s0 + known, s1 + e, s2 + ee, s3 + ee * e, s4 + ee * ee, s5 + ee * (f * f)
    out[0], out[1], out[2], out[3], out[4], out[5] = total(s0), total(s1), total(s2), total(s3), total(s4), total(s5)


@inline
def nominal(x, shift, truth, i, period, sigma):
    """Errors of group i in nominal plots and periods."""
    per = 1.0 / sigma
    return (
        per * (get(x, i) - truth[0] - get(shift, i)),
        (period * per) * (get(x, GROUPS + i) - truth[1] - get(shift, GROUPS + i)),
        (period * period * per) * (get(x, 2 * GROUPS + i) - truth[2]),
    )


@kernel
def joint_sums(x, P, shift, truth, count, used, size, period, sigma, out):
    """Σ of the diagonal of P where there are plots for it, and Σq, Σq², Σp, Σp² where the state is complete: out (7,).

    q = eᵀP⁻¹e and p the product of the errors in value and rate. x (4, CHUNK), P (6, CHUNK) in nominal plots and
    periods, as the first three sums; shift (3, CHUNK), truth (3,).
    """
    ax, ap, moved, ac, au = address(x), address(P), address(shift), address(count), address(used)
    zero, one, two, three = full(0.0), full(0.5), full(1.5), full(2.5)
    need, most = full(size - 0.5), full(float(size))
    s0, s1, s2, q1, q2, r1, r2 = zero, zero, zero, zero, zero, zero, zero
    to_units = sigma * sigma / period
    for i in range(GROUPS):
        n, u = get(ac, i), get(au, i)
        p = six(ap, i)
        s0 = s0 + where_greater(n, one, u, zero) * p[0]
        s1 = s1 + where_greater(n, two, u, zero) * p[3]
        s2 = s2 + where_greater(n, three, u, zero) * p[5]
        y = inverse(p, where_greater(n, need, most, zero))
        e0, e1, e2 = nominal(ax, moved, truth, i, period, sigma)
        q = e0 * (y[0] * e0 + 2.0 * (y[1] * e1 + y[2] * e2)) + e1 * (y[3] * e1 + 2.0 * y[4] * e2) + y[5] * e2 * e2
        complete = where_greater(n, need, u, zero)
        q, r = complete * q, complete * (to_units * (e0 * e1))
        q1, q2, r1, r2 = q1 + q, q2 + q * q, r1 + r, r2 + r * r
    out[0], out[1], out[2] = total(s0), total(s1), total(s2)
    out[3], out[4], out[5], out[6] = total(q1), total(q2), total(r1), total(r2)


@kernel
def ahead_sums(x, shift, truth, dt, count, used, size, out):
    """Σe, Σe², Σe³, Σe⁴ of the value extrapolated by dt, where the state was complete, into out (4,)."""
    ax, moved, ac, au, zero = address(x), address(shift), address(count), address(used), full(0.0)
    half, need, s1, s2, s3, s4 = 0.5 * dt * dt, full(size - 0.5), zero, zero, zero, zero
    for i in range(GROUPS):
        known = where_greater(get(ac, i), need, get(au, i), zero)
        there = get(ax, i) + dt * get(ax, GROUPS + i) + half * get(ax, 2 * GROUPS + i)
        e = known * (there - truth - get(moved, i))
        ee = e * e
        s1, s2, s3, s4 = s1 + e, s2 + ee, s3 + ee * e, s4 + ee * ee
    out[0], out[1], out[2], out[3] = total(s1), total(s2), total(s3), total(s4)


@kernel
def add_sums(size, unit, period, x, beside, paired, P, shift, truth, count, used, f, k, c, out, sums):
    """Add the errors of filter f in coordinate c at scan k; unit is the nominal σ, out (7,) scratch.

    beside is the filter that gains are against, paired how many components it has.
    """
    for j in range(size):
        component_sums(x, beside, j, shift[j], truth[j], count, used, out)
        sums.estimates[f, k, c, j] += out[0]
        for q in range(4):
            sums.error[f, k, c, j, q] += out[1 + q]
        if j < paired:
            sums.paired[f, k, c, j] += out[5]
    joint_sums(x, P, shift, truth, count, used, size, period, unit, out)
    for j in range(size):
        sums.believed[f, k, c, j] += out[j] * unit * unit / period ** (2 * j)
    for q in range(4):
        sums.joint[f, k, c, q] += out[3 + q]


@kernel
def add_ahead(sizes, x, shift, truth, count, used, k, dt, out, sums):
    """Add the errors at scan k of what was extrapolated from scan k - 1; x (F, C, 4, CHUNK), count before scan k."""
    for f in range(x.shape[0]):
        for c in range(x.shape[1]):
            ahead_sums(x[f, c], shift[c, 0], truth[c, 0], dt, count[c], used, sizes[f], out)
            for q in range(4):
                sums.ahead[f, k - 1, c, q] += out[q]
