"""False plots of a whole sector, of which only the parts that are looked at are drawn, and how a gate weighs them.

The sector is cut into cells of equal area, uniform in q = r²/2 and in the bearing. Poisson processes on disjoint cells
are independent, so the number in each cell (by inversion of the distribution function) and the places of its plots are
functions of key, realisation, scan and cell: the field is the same for every filter, and a gate costs only the cells
that it touches. The letters, plain numbers here:

    r, b        range in m, bearing in rad
    q           r² / 2, m²: uniform where plots are uniform in area
    nu          innovation (r, b)
    S           covariance of the innovation: rr, rb, bb
    S_inverse   S⁻¹ likewise: rr, rb, bb
    d           νᵀ S⁻¹ ν of a plot; e = exp(-d / 2), its likelihood without the constant
    beta0       probability that no plot in the gate is the target's (PDA)
    P_D, P_G    probabilities of detection, and that the target's plot lies in the gate
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.lanes import address
from radarsim.kernels.random import U, threefry, uniform

DRAW_BITS = 12  # of a draw's number: the draw in its cell
HALF = U(0xFFFFFFFF)
LEAST_DENSITY = 1e-9  # per m², in scores: without false plots a score would be infinite
OPEN = 1e30  # χ² of a gate that lets everything in
CLOSEST = 1.0  # m: the least range that densities and gates are computed at, should a track pass through the sonar
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


class Grid(NamedTuple):
    """A field without its arrays, references to which would be counted at each call: the key's two words and the
    address of the distribution function; the rest as in Field.
    """

    k0: int
    k1: int
    share: int
    q0: float
    dq: float
    nq: int
    b0: float
    db: float
    nb: int
    ring: bool
    density: float


class Rule(NamedTuple):
    """How a tracker chooses among the plots in its gate.

    association is NEAREST, PDA or KNOWN; gate the χ² of two components; detection P_D and inside P_G; density of false
    plots that it assumes, per m²; speed of targets, m/s, which widens the gate of a track of one plot.
    """

    association: int
    gate: float
    detection: float
    inside: float
    density: float
    speed: float


class Gate(NamedTuple):
    """Where a track looks for its plot: predicted r and b, S (rr, rb, bb), and whether it is settled (two plots)."""

    r: float
    b: float
    S: tuple[float, float, float]
    settled: bool


class Gated(NamedTuple):
    """Plots in a gate so far: how many, and how many false; the nearest one's d, innovation and whether it is false.

    Then, with the likelihoods e as weights, Σe, Σe of false plots, mean innovation and scatter about it.
    """

    count: float
    false_count: float
    d: float
    nu_r: float
    nu_b: float
    nearest_false: float
    weight: float
    false_weight: float
    mean_r: float
    mean_b: float
    rr: float
    rb: float
    bb: float


class Association(NamedTuple):
    """What a track takes of the plots in its gate.

    Innovation in r and b, further covariance V of it (rr, rb, bb), whether any plot is taken (1 or 0), the weight of
    false plots in it, and the increment of the track's score.
    """

    nu_r: float
    nu_b: float
    rr: float
    rb: float
    bb: float
    taken: float
    false_share: float
    score: float


@inline
def grid_of(field):
    """The grid of a field, which must outlive it."""
    return Grid(
        field.key[0],
        field.key[1],
        address(field.share),
        field.q0,
        field.dq,
        field.nq,
        field.b0,
        field.db,
        field.nb,
        field.ring,
        field.density,
    )


@inline
def number_in(share, u):
    """Number of plots in a cell from a uniform number u: the first place where the distribution function exceeds it.

    share is the address of that function; its last value is 1.
    """
    n = 0
    while u >= share[n]:
        n += 1
    return n


@inline
def cell_words(k0, k1, realisation, cell, draw):
    """Two random words of a cell: the first of draw 0 gives the number of plots, every further word the place of one.

    Cells are numbered through all scans.
    """
    return threefry(U(realisation), (U(cell) << U(DRAW_BITS)) + U(draw), k0, k1)


@inline
def place_in(word):
    """Place in a cell, each coordinate from 0 to 1: the two halves of a word."""
    return np.float64(word >> U(32)) * 2.0**-32 + 2.0**-33, np.float64(word & HALF) * 2.0**-32 + 2.0**-33


@inline
def cells(low, high, least, step, count):
    """First and last of `count` cells of size step from `least` on that low … high touches.

    Floors are floating-point numbers: an open gate reaches further than an integer can.
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
def empty_gate():
    """A gate without plots."""
    return Gated(0.0, 0.0, OPEN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inline
def distance_squared(nu_r, nu_b, S_inverse):
    """νᵀ S⁻¹ ν."""
    return S_inverse[0] * nu_r * nu_r + 2.0 * S_inverse[1] * nu_r * nu_b + S_inverse[2] * nu_b * nu_b


@inline
def with_plot(gated, nu_r, nu_b, false, S_inverse, threshold):
    """The plots in a gate after one more of innovation (nu_r, nu_b), which counts up to the threshold of d.

    The weighted mean and scatter grow plot by plot (West 1979): of one plot alone the scatter is exactly zero.
    """
    count, false_count, least, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb = gated
    d = distance_squared(nu_r, nu_b, S_inverse)
    if d > threshold:
        return gated
    count, false_count = count + 1.0, false_count + false
    if d < least:
        least, r, b, nearest_false = d, nu_r, nu_b, false
    e = math.exp(-0.5 * d)
    if e > LEAST:
        weight, false_weight = weight + e, false_weight + e * false
        share, off_r, off_b = e / weight, nu_r - mean_r, nu_b - mean_b
        mean_r, mean_b = mean_r + share * off_r, mean_b + share * off_b
        rr, rb = rr + e * (off_r * (nu_r - mean_r)), rb + e * (off_r * (nu_b - mean_b))
        bb = bb + e * (off_b * (nu_b - mean_b))
    return Gated(count, false_count, least, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb)


@inline
def with_false_plots(gated, grid, realisation, scan, gate, threshold):
    """The plots in a gate after all false ones of a scan in it."""
    irr, irb, ibb, _ = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    r, b, q0, dq, nq, b0, db, nb = gate.r, gate.b, grid.q0, grid.dq, grid.nq, grid.b0, grid.db, grid.nb
    wide, high = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    near, far = max(r - wide, 0.0), r + wide
    least, most = 0.5 * near * near, 0.5 * far * far
    i_first, i_last = cells(least, most, q0, dq, nq)
    if grid.ring:
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
            u, word = cell_words(grid.k0, grid.k1, realisation, cell, 0)
            spare = word
            for n in range(number_in(grid.share, uniform(u))):
                if n > 0:
                    if n % 2 == 1:
                        word, spare = cell_words(grid.k0, grid.k1, realisation, cell, (n + 1) // 2)
                    else:
                        word = spare
                u_q, u_b = place_in(word)
                q, off = q0 + dq * (i + u_q), b0 + db * (j + u_b) - b
                if least <= q <= most and abs(off) <= high:  # roots are slow
                    gated = with_plot(gated, math.sqrt(2.0 * q) - r, off, 1.0, (irr, irb, ibb), threshold)
    return gated


@inline
def associated(gated, rule, r, S, settled):
    """The Association of a track at range r from the plots in its gate.

    Bar-Shalom's parametric filter (Bar-Shalom, Daum, Huang 2009): with b = λ 2π √|S| (1 - P_D P_G) / P_D no plot is
    the target's with probability β₀ = b / (b + Σe). The covariance grows by K (β₀ S + scatter) Kᵀ from that of a
    certain plot. λ is the density in range and bearing, that per m² times the range. The score is the logarithm of the
    likelihood ratio of all plots in the gate, target against none. A track of one plot (not settled) takes the nearest.
    """
    r = max(r, CLOSEST)
    density, root = rule.density * r, 2.0 * math.pi * math.sqrt(S[0] * S[2] - S[1] * S[1])
    missed = 1.0 - rule.detection * rule.inside
    ratio = missed + rule.detection * gated.weight / (root * max(density, LEAST_DENSITY * r))
    score = math.log(max(ratio, 1e-12))
    if gated.count == 0.0:
        return Association(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, score)
    none = density * root * missed / rule.detection
    if rule.association != PDA or not settled or none + gated.weight == 0.0:
        return Association(gated.nu_r, gated.nu_b, 0.0, 0.0, 0.0, 1.0, gated.nearest_false, score)
    beta0 = none / (none + gated.weight)
    # Of an open gate all plots may be so far away that their likelihoods are zero.
    some, per = 1.0 - beta0, 1.0 / gated.weight if gated.weight > 0.0 else 0.0
    mean_r, mean_b = gated.mean_r, gated.mean_b
    return Association(
        some * mean_r,
        some * mean_b,
        beta0 * S[0] + some * (gated.rr * per + beta0 * (mean_r * mean_r)),
        beta0 * S[1] + some * (gated.rb * per + beta0 * (mean_r * mean_b)),
        beta0 * S[2] + some * (gated.bb * per + beta0 * (mean_b * mean_b)),
        1.0,
        gated.false_weight * per,
        score,
    )


@kernel
def associate_innovations(rule, settled, r, S, nu_r, nu_b):
    """The Association of one track at range r with innovation covariance S (rr, rb, bb), of innovations (n,) given."""
    irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
    gated = empty_gate()
    for i in range(nu_r.size):
        gated = with_plot(gated, nu_r[i], nu_b[i], 0.0, (irr, irb, ibb), rule.gate)
    return associated(gated, rule, r, S, settled)


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
