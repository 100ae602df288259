"""Errors of filters with a covariance to each realisation, and their sums over a chunk."""

from radarsim.kernels.compile import part
from radarsim.kernels.lanes import add_totals, full, get, get3, get6, put3, where_greater
from radarsim.studies.range_doppler.kernels.chunk import EIGHTS, of_filter

OWN, PAIRED = 24, 24  # numbers that `score` and `pair` add to, of a filter and scan; of the latter 18 are in use


@part
def score(at, f, start, observes, truth, R, found):
    """Errors of filter f, zero where it has no estimate, where it has one, and their sums, added from `found` on.

    e, e², e³, e⁴ of each component; the three products of two; how many have started, q = eᵀP⁻¹e / 3, q²; how many
    have each component; the three believed variances. By the factors L D Lᵀ of P, with one division:
    D = (p₀, m/p₀, w/(p₀m)), m and w the leading minors, w times p₀. All by addresses; truth (3,), R (2,) are arrays.
    """
    x, p, e, has = of_filter(at.x, f, 3), of_filter(at.p, f, 6), of_filter(at.e, f, 3), of_filter(at.has, f, 3)
    last, one, none = full(start - 0.5), full(1.0), full(0.0)
    of_velocity = 1.0 if observes == 2 else 0.0
    truth_r, truth_v, truth_a, R_r, R_v = truth[0], truth[1], truth[2], R[0], R[1]
    r1 = r2 = r3 = r4 = v1 = v2 = v3 = v4 = a1 = a2 = a3 = a4 = none
    rv = ra = va = started = total = square = have_r = have_v = own_r = own_v = own_a = none
    for i in range(EIGHTS):
        runs = where_greater(get(at.count, i), last, one, none)
        waits = (1.0 - runs) * get(at.detected, i)
        waits_v = of_velocity * waits
        r, v, a = get3(x, i, EIGHTS)
        state_r, state_v, state_a = get3(at.state, i, EIGHTS)
        has_r, has_v = runs + waits, runs + waits_v
        r = runs * r + waits * get(at.plots, i) - has_r * (truth_r + state_r)
        v = runs * v + waits_v * get(at.plots, EIGHTS + i) - has_v * (truth_v + state_v)
        a = runs * (a - (truth_a + state_a))
        put3(e, i, (r, v, a), EIGHTS)
        put3(has, i, (has_r, has_v, runs), EIGHTS)
        rr, vv, aa = r * r, v * v, a * a
        r1, v1, a1 = r1 + r, v1 + v, a1 + a
        r2, v2, a2 = r2 + rr, v2 + vv, a2 + aa
        r3, v3, a3 = r3 + r * rr, v3 + v * vv, a3 + a * aa
        r4, v4, a4 = r4 + rr * rr, v4 + vv * vv, a4 + aa * aa
        rv, ra, va = rv + r * v, ra + r * a, va + v * a
        p0, p1, p2, p3, p4, p5 = get6(p, i, EIGHTS)
        minor, m = p0 * p3 - p1 * p1, p0 * p4 - p1 * p2
        whole = minor * (p0 * p5 - p2 * p2) - m * m
        scale = runs / where_greater(runs, full(0.5), p0 * minor * whole, one)
        b = p0 * v - p1 * r
        c = minor * (p0 * a - p2 * r) - m * b
        q = scale * (whole * (minor * rr + b * b) + c * c) / 3.0
        started, total, square = started + runs, total + q, square + q * q
        have_r, have_v = have_r + has_r, have_v + has_v
        own_r, own_v = own_r + (runs * p0 + waits * R_r), own_v + (runs * p3 + waits_v * R_v)
        own_a = own_a + runs * p5
    add_totals(found, 0, r1, r2, r3, r4)
    add_totals(found, 4, v1, v2, v3, v4)
    add_totals(found, 8, a1, a2, a3, a4)
    add_totals(found, 12, rv, ra, va, started)
    add_totals(found, 16, total, square, have_r, have_v)
    add_totals(found, 20, started, own_r, own_v, own_a)


@part
def pair(at, f, baseline, found):
    """Sums where both filters have a component, added from `found` on: how many, e_f², e_f⁴, e_b², e_b⁴, e_f² e_b²."""
    e, has = of_filter(at.e, f, 3), of_filter(at.has, f, 3)
    e_b, has_b = of_filter(at.e, baseline, 3), of_filter(at.has, baseline, 3)
    none = full(0.0)
    for c in range(3):
        count = own = own_4 = base = base_4 = product = none
        for i in range(c * EIGHTS, (c + 1) * EIGHTS):
            here, here_b, of_f, of_b = get(has, i), get(has_b, i), get(e, i), get(e_b, i)
            one, other = of_f * of_f * here_b, of_b * of_b * here
            count, own, base, product = count + here * here_b, own + one, base + other, product + one * other
            own_4, base_4 = own_4 + one * one, base_4 + other * other
        add_totals(found, 6 * c, count, own, own_4, base)
        add_totals(found, 6 * c + 4, base_4, product, none, none)
