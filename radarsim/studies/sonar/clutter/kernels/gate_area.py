"""The area of the part of a gate that lies within the surveyed sector."""

import math

import numpy as np

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.studies.sonar.clutter.kernels.false_plots import TURN


@kernel_part
def gate_area(gate, det, threshold, cells):
    """The area, m², of the part of a gate that lies within the sector; det is |S|.

    A gate that reaches over an edge is integrated as the unit disc u² + v² ≤ 1, with r = r₀ + s u, b = b₀ + c u + h v:
    over u between the edges in range, with weight r; v runs from the arc or an edge in bearing to the other one."""
    s, half_b = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    r_min, r_max = math.sqrt(2.0 * cells.q0), math.sqrt(2.0 * (cells.q0 + cells.dq * cells.nq))
    # from the middle of the sector to that of the gate, without whole turns
    half_sector = 0.5 * cells.nb * cells.db
    offset = 0.0
    if not cells.ring:
        offset = gate.b - cells.b0 - half_sector
        offset -= TURN * np.floor(offset / TURN + 0.5)
    if gate.r - s >= r_min and gate.r + s <= r_max and abs(offset) + half_b <= half_sector:
        return gate.r * np.pi * threshold * math.sqrt(det)
    c, h = s * gate.S[1] / gate.S[0], math.sqrt(threshold * det / gate.S[0])
    begin, end = (r_min - gate.r) / s, (r_max - gate.r) / s
    max_square = 0.0
    for side in (begin, end):
        for edge in (-half_sector - offset, half_sector - offset):
            max_square = max(max_square, side**2 + ((edge - c * side) / h) ** 2)
    if max_square <= 1.0:  # an ellipse that holds the corners holds the sector
        return cells.dq * cells.nq * cells.db * cells.nb
    area, u, end = 0.0, max(begin, -1.0), min(end, 1.0)
    while u < end:  # up to the next point where an edge in bearing cuts the circle
        next_cut = end
        for edge in (-half_sector - offset, half_sector - offset):
            root = half_b * half_b - edge * edge
            if root > 0.0:
                for sign in (-1.0, 1.0):
                    cut = (edge * c + sign * h * math.sqrt(root)) / (half_b * half_b)
                    next_cut = cut if u < cut < next_cut else next_cut
        middle = 0.5 * (u + next_cut)
        arc = math.sqrt(1.0 - middle * middle)
        v_min, v_max = (-half_sector - offset - c * middle) / h, (half_sector - offset - c * middle) / h
        if v_max > -arc and v_min < arc:
            weight = (gate.r, s, u, next_cut)
            area += arc_moment(weight) if v_max > arc else line_moment(weight, (half_sector - offset) / h, -c / h)
            area += arc_moment(weight) if v_min < -arc else line_moment(weight, (half_sector + offset) / h, c / h)
        u = next_cut
    return h * s * area


@inline
def arc_moment(weight):
    """The integral ∫ (r + s u) √(1 − u²) du from begin to end; weight = (r, s, begin, end)."""
    r, s, begin, end = weight
    a, b = math.sqrt(1.0 - begin * begin), math.sqrt(1.0 - end * end)
    integral = end * b - begin * a + math.asin(end) - math.asin(begin)
    return 0.5 * r * integral + s * (a * a * a - b * b * b) / 3.0


@inline
def line_moment(weight, intercept, slope):
    """The integral ∫ (r + s u) (intercept + slope u) du from begin to end; weight = (r, s, begin, end)."""
    r, s, begin, end = weight
    first, second, third = end - begin, (end**2 - begin**2) / 2.0, (end**3 - begin**3) / 3.0
    return r * intercept * first + (r * slope + s * intercept) * second + s * slope * third
