"""False plots of a whole sector, of which only the parts that are looked at are drawn, and what a gate makes of them.

The sector is cut into cells of equal area, uniform in q = r²/2 and in the bearing. Poisson processes on disjoint cells
are independent, so the number in each cell (by inversion of the distribution function) and the places of its plots are
functions of key, realisation, scan and cell: the field is all there, the same for every filter, and a gate costs the
cells that it touches.
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.lanes import address
from radarsim.kernels.random import U, threefry, uniform

DRAW_BITS = 12  # of a draw's number: the draw in its cell
HALF = U(0xFFFFFFFF)
SCORED = 1e-9  # per m²: the least density a score reckons with; without false plots it would be infinite
OPEN = 1e30  # χ² of a gate that lets everything in
CLOSEST = 1.0  # m: the least range that densities and gates are reckoned at, should a track pass through the sonar
TURN = 2.0 * math.pi
LEAST = 1e-300  # likelihood that counts: the reciprocal of a smaller one may be infinite
NEAREST, PDA, KNOWN = range(3)


class Field(NamedTuple):
    """Cells from q0 and b0 (m², rad), dq by db in size, nq by nb of them; ring: they close to a full circle.

    key (2,) of the noise; share (J,) the distribution function of the number in a cell, up to 1; density per m².
    """

    key: np.ndarray
    share: np.ndarray
    q0: float
    dq: float
    nq: int
    b0: float
    db: float
    nb: int
    ring: bool
    density: float


class Rule(NamedTuple):
    """How a tracker chooses among the plots in its gate: association, gate (χ² of two), detection P_D and gate P_G.

    density is what it takes false plots to have, per m².
    """

    association: int
    gate: float
    detection: float
    inside: float
    density: float


@inline
def number_in(share, u):
    """How many plots a cell holds, of a uniform number: the first place where the distribution function passes it.

    share is the address of that function; its last value is 1.
    """
    n = 0
    while u >= share[n]:
        n += 1
    return n


@inline
def cell_words(k0, k1, realisation, cell, draw):
    """Two words: of draw 0 the first tells how many plots a cell holds, every further word is the place of one.

    Cells are numbered through all scans.
    """
    return threefry(U(realisation), (U(cell) << U(DRAW_BITS)) + U(draw), k0, k1)


@inline
def place_in(word):
    """Place in a cell, each way from 0 to 1: the two halves of a word."""
    return np.float64(word >> U(32)) * 2.0**-32 + 2.0**-33, np.float64(word & HALF) * 2.0**-32 + 2.0**-33


@inline
def cells(low, high, least, step, count):
    """First and last of `count` cells of size step from `least` on that low … high touches.

    Floors as floating numbers: an open gate reaches further than an integer does.
    """
    first = min(max(np.floor((low - least) / step), 0.0), count - 1.0)
    last = min(max(np.floor((high - least) / step), -1.0), count - 1.0)
    return int(first), int(last)


# ---- the gate -----------------------------------------------------------------------------------------------------
@inline
def inverse_two(rr, rb, bb):
    """Inverse and determinant of a symmetric matrix of two."""
    det = rr * bb - rb * rb
    per = 1.0 / det
    return bb * per, -rb * per, rr * per, det


@inline
def nothing_seen():
    """No plot yet: plots in the gate and false ones of them; distance of the nearest, it and whether it is false; sum
    of the likelihoods and of those of false plots, their mean (2) and scatter (3).
    """
    return 0.0, 0.0, OPEN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@inline
def seen(so_far, r, b, false, irr, irb, ibb, gate):
    """What is known of the plots in a gate once the innovation (r, b) of one more has been looked at.

    The weighted mean and scatter grow plot by plot (West 1979): of one plot alone the scatter is exactly zero.
    """
    count, wrong, least, nr, nb, false_one, weight, astray, mr, mb, rr, rb, bb = so_far
    d = irr * r * r + 2.0 * irb * r * b + ibb * b * b
    if d > gate:
        return so_far
    count, wrong = count + 1.0, wrong + false
    if d < least:
        least, nr, nb, false_one = d, r, b, false
    e = math.exp(-0.5 * d)
    if e > LEAST:
        weight, astray = weight + e, astray + e * false
        share, r_off, b_off = e / weight, r - mr, b - mb
        mr, mb = mr + share * r_off, mb + share * b_off
        rr, rb, bb = rr + e * (r_off * (r - mr)), rb + e * (r_off * (b - mb)), bb + e * (b_off * (b - mb))
    return count, wrong, least, nr, nb, false_one, weight, astray, mr, mb, rr, rb, bb


@inline
def false_plots(k0, k1, share, grid, realisation, scan, gate, place, S, so_far):
    """Look at the false plots in a gate about place (r, b) with innovation covariance S (rr, rb, bb).

    A field without its arrays, references to which would be counted at each call: the key, the address of its share,
    and grid (q0, dq, nq, b0, db, nb, ring).
    """
    irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
    r, b = place
    q0, dq, nq, b0, db, nb, ring = grid
    wide, high = math.sqrt(gate * S[0]), math.sqrt(gate * S[2])
    near, far = max(r - wide, 0.0), r + wide
    least, most = 0.5 * near * near, 0.5 * far * far
    i_first, i_last = cells(least, most, q0, dq, nq)
    if ring:
        high = min(high, 0.5 * nb * db)
        j_first, j_last = math.floor((b - high - b0) / db), math.floor((b + high - b0) / db)
        j_last = min(j_last, j_first + nb)  # the same column at both ends of a full turn: half a turn to either side
    else:
        b -= TURN * np.floor((b - b0) / TURN - 0.5 * nb * db / TURN + 0.5)  # whole turns off the sector's middle
        j_first, j_last = cells(b - high, b + high, b0, db, nb)
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            column = j if 0 <= j < nb else j % nb
            cell = (scan * nq + i) * nb + column
            u, word = cell_words(k0, k1, realisation, cell, 0)
            spare = word
            for n in range(number_in(share, uniform(u))):
                if n > 0:
                    if n % 2 == 1:
                        word, spare = cell_words(k0, k1, realisation, cell, (n + 1) // 2)
                    else:
                        word = spare
                u_q, u_b = place_in(word)
                q, off = q0 + dq * (i + u_q), b0 + db * (j + u_b) - b
                if least <= q <= most and abs(off) <= high:  # roots are slow
                    so_far = seen(so_far, math.sqrt(2.0 * q) - r, off, 1.0, irr, irb, ibb, gate)
    return so_far


@inline
def decided(so_far, rule, r, S, settled):
    """From the plots in a gate: innovation (2), extra scatter (3), whether any plot was taken, the weight of false
    ones in it, and the score's increment.

    Bar-Shalom's parametric filter (Bar-Shalom, Daum, Huang 2009): with b = λ 2π √|S| (1 - P_D P_G) / P_D no plot is
    the target's with probability β₀ = b / (b + Σe). The covariance grows by K (β₀ S + scatter) Kᵀ from that of a
    certain plot. λ is the density in range and bearing, that per m² times the range. The score is the logarithm of the
    likelihood ratio of all plots in the gate, target against none. A track of one plot (not settled) takes the nearest.
    """
    count, _, _, nr, nb, false_one, weight, astray, mr, mb, rr, rb, bb = so_far
    r = max(r, CLOSEST)
    density, root = rule.density * r, 2.0 * math.pi * math.sqrt(S[0] * S[2] - S[1] * S[1])
    missed = 1.0 - rule.detection * rule.inside
    ratio = missed + rule.detection * weight / (root * max(density, SCORED * r))
    score = math.log(max(ratio, 1e-12))
    if count == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, score
    none = density * root * missed / rule.detection
    if rule.association != PDA or not settled or none + weight == 0.0:
        return nr, nb, 0.0, 0.0, 0.0, 1.0, false_one, score
    none = none / (none + weight)
    some, per = 1.0 - none, 1.0 / weight if weight > 0.0 else 0.0  # of an open gate all may lie out of all likelihood
    return (
        some * mr,
        some * mb,
        none * S[0] + some * (rr * per + none * (mr * mr)),
        none * S[1] + some * (rb * per + none * (mr * mb)),
        none * S[2] + some * (bb * per + none * (mb * mb)),
        1.0,
        astray * per,
        score,
    )


@kernel
def weighed(rule, settled, r, rr, rb, bb, innovations_r, innovations_b):
    """`decided` of given innovations (n,) of one track at range r, with innovation covariance (rr, rb, bb)."""
    irr, irb, ibb, _ = inverse_two(rr, rb, bb)
    so_far = nothing_seen()
    for i in range(innovations_r.size):
        so_far = seen(so_far, innovations_r[i], innovations_b[i], 0.0, irr, irb, ibb, rule.gate)
    return decided(so_far, rule, r, (rr, rb, bb), settled)


@kernel
def whole_field(field, realisation, scan, r, b):
    """All false plots of a scan into r and b (n,); how many there are, even if more than fit."""
    total, share, of_all = 0, address(field.share), field.nq * field.nb
    k0, k1 = field.key[0], field.key[1]
    for cell in range(of_all):
        i, j = cell // field.nb, cell % field.nb
        u, word = cell_words(k0, k1, realisation, scan * of_all + cell, 0)
        spare = word
        for n in range(number_in(share, uniform(u))):
            if n > 0:
                if n % 2 == 1:
                    word, spare = cell_words(k0, k1, realisation, scan * of_all + cell, (n + 1) // 2)
                else:
                    word = spare
            u_q, u_b = place_in(word)
            if total < r.size:
                r[total] = math.sqrt(2.0 * (field.q0 + field.dq * (i + u_q)))
                b[total] = field.b0 + field.db * (j + u_b)
            total += 1
    return total
