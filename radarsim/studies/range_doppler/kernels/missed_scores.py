"""Errors of a filter at one scan, and their sums, alone and in pairs with the baseline's."""

from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.lane_matrices import get3, get6, put3
from radarsim.kernels.lanes import add_totals, full, get, where_greater
from radarsim.studies.range_doppler.kernels.missed_steps import EIGHTS, filter_rows_address

FILTER_SUMS, PAIR_SUMS = (
    24,
    24,
)  # numbers that `score` and `pair` add to, of a filter and scan; of the latter 18 are in use


@kernel_part
def score(memory, f, start, observes, truth, R, sums):
    """Errors of filter f, zero where it has no estimate, where it has one, and their sums, added from `sums` on.

    e, e², e³, e⁴ of each component; the three products of two; how many have started, q = eᵀP⁻¹e / 3, q²; how many
    have each component; the three believed variances. By the factors L D Lᵀ of P, with one division:
    D = (p₀, m/p₀, w/(p₀m)), m and w the leading minors, w times p₀. All by addresses; truth (3,), R (2,) are arrays."""
    x, p, e, has = (
        filter_rows_address(memory.x, f, 3),
        filter_rows_address(memory.p, f, 6),
        filter_rows_address(memory.e, f, 3),
        filter_rows_address(memory.has, f, 3),
    )
    last_start_plot, ones, zeros = full(start - 0.5), full(1.0), full(0.0)
    observes_velocity = 1.0 if observes == 2 else 0.0
    truth_r, truth_v, truth_a, R_r, R_v = truth[0], truth[1], truth[2], R[0], R[1]
    r1 = r2 = r3 = r4 = v1 = v2 = v3 = v4 = a1 = a2 = a3 = a4 = zeros
    rv = ra = va = started = total = square = have_r = have_v = believed_r = believed_v = believed_a = zeros
    for i in range(EIGHTS):
        runs = where_greater(get(memory.count, i), last_start_plot, ones, zeros)
        waits = (1.0 - runs) * get(memory.detected, i)
        waits_v = observes_velocity * waits
        r, v, a = get3(x, i, EIGHTS)
        state_r, state_v, state_a = get3(memory.state, i, EIGHTS)
        has_r, has_v = runs + waits, runs + waits_v
        r = runs * r + waits * get(memory.plots, i) - has_r * (truth_r + state_r)
        v = runs * v + waits_v * get(memory.plots, EIGHTS + i) - has_v * (truth_v + state_v)
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
        scaled_determinant = minor * (p0 * p5 - p2 * p2) - m * m
        scale = runs / where_greater(runs, full(0.5), p0 * minor * scaled_determinant, ones)
        b = p0 * v - p1 * r
        c = minor * (p0 * a - p2 * r) - m * b
        q = scale * (scaled_determinant * (minor * rr + b * b) + c * c) / 3.0
        started, total, square = started + runs, total + q, square + q * q
        have_r, have_v = have_r + has_r, have_v + has_v
        believed_r, believed_v = believed_r + (runs * p0 + waits * R_r), believed_v + (runs * p3 + waits_v * R_v)
        believed_a = believed_a + runs * p5
    add_totals(sums, 0, r1, r2, r3, r4)
    add_totals(sums, 4, v1, v2, v3, v4)
    add_totals(sums, 8, a1, a2, a3, a4)
    add_totals(sums, 12, rv, ra, va, started)
    add_totals(sums, 16, total, square, have_r, have_v)
    add_totals(sums, 20, started, believed_r, believed_v, believed_a)


@kernel_part
def pair(memory, f, baseline, sums):
    """Sums where both filters have a component, added from `sums` on: how many, e_f², e_f⁴, e_b², e_b⁴, e_f² e_b²."""
    e, has = filter_rows_address(memory.e, f, 3), filter_rows_address(memory.has, f, 3)
    e_b, has_b = filter_rows_address(memory.e, baseline, 3), filter_rows_address(memory.has, baseline, 3)
    zeros = full(0.0)
    for c in range(3):
        count = squares = fourth_powers = base_squares = base_fourth_powers = product = zeros
        for i in range(c * EIGHTS, (c + 1) * EIGHTS):
            present, present_b, error_f, error_b = get(has, i), get(has_b, i), get(e, i), get(e_b, i)
            square, base_square = error_f * error_f * present_b, error_b * error_b * present
            count, squares, base_squares, product = (
                count + present * present_b,
                squares + square,
                base_squares + base_square,
                product + square * base_square,
            )
            fourth_powers, base_fourth_powers = (
                fourth_powers + square * square,
                base_fourth_powers + base_square * base_square,
            )
        add_totals(sums, 6 * c, count, squares, fourth_powers, base_squares)
        add_totals(sums, 6 * c + 4, base_fourth_powers, product, zeros, zeros)
