"""False plots drawn more often than they occur, in a box about the gate of a track.

What is drawn at a scan is the number of false plots in a box in q and bearing about the gate, within the sector: zero
or not, with the probability h that it is not, in place of the p = 1 - exp(-μ) of a Poisson number of mean μ, and then a
Poisson number that is not zero. Positions in the box are uniform, as they are in the field; what is in the box but
outside the gate is not seen. The ratio of the laws is that of the answers "zero or not" alone, (1 - h) / (1 - p) or h /
p at each scan. Letters as in `false_plots`, and

    p, h        probability that the box contains a false plot: as it is, and as it is drawn
    ratio       a law that is drawn from over the law itself"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline
from radarsim.kernels.random import uniform
from radarsim.studies.sonar.clutter.kernels import false_plots
from radarsim.studies.sonar.clutter.kernels import gate as kernels_gate

MAX_BOX_MEAN = 16.0  # false plots in a box: with more, the gate contains some anyway, and the field is left as it is
MAX_RATIO = 1e280  # far beyond any ratio whose reciprocal counts


class Box(NamedTuple):
    """A box of size dq by db from q on and from bearing b on, relative to the track; its mean number of false plots."""

    q: float
    dq: float
    b: float
    db: float
    mean: float


@inline
def gate_box(cells, gate, threshold):
    """The box about a gate, within the sector."""
    q0, dq, nq, b0, db, nb, ring, density = cells
    half_r, half_b = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    r_min, r_max = max(gate.r - half_r, 0.0), gate.r + half_r
    q_min, q_max = max(0.5 * r_min * r_min, q0), min(0.5 * r_max * r_max, q0 + dq * nq)
    sector = nb * db
    if ring:
        half_b = min(half_b, 0.5 * sector)
        b_left, b_right = -half_b, half_b
    else:
        # As in `false_plots.add_false_plots`: without whole turns, relative to the middle of the sector.
        b = gate.b - false_plots.TURN * np.floor(
            (gate.b - b0) / false_plots.TURN - 0.5 * sector / false_plots.TURN + 0.5
        )
        b_left, b_right = max(-half_b, b0 - b), min(half_b, b0 + sector - b)
    depth, width = max(q_max - q_min, 0.0), max(b_right - b_left, 0.0)
    return Box(q_min, depth, b_left, width, density * depth * width)


@inline
def positive_poisson(mean, p, v):
    """A Poisson number that is not zero, by inversion of v; p is the probability that it is not zero."""
    n, term = 1, mean * math.exp(-mean) / p
    while v >= term and n < 200:
        v -= term
        n += 1
        term *= mean / n
    return n


@inline
def draw_plots_in_gate(keys, realisation, k, gate, threshold, box, p, h):
    """Draw the plots in a gate's box at scan k: those within the gate, and whether there is any in the box."""
    gated_plots, (irr, irb, ibb, _) = (
        kernels_gate.empty_gate(),
        kernels_gate.inverse_two(gate.S[0], gate.S[1], gate.S[2]),
    )
    u, spare = false_plots.random_words(keys[0], keys[1], realisation, k, 0)
    any_in_box = uniform(u) < h
    if any_in_box:
        for n in range(positive_poisson(box.mean, p, uniform(u) / h)):
            u_q, u_b, spare = false_plots.plot_position(keys[0], keys[1], realisation, k, n, spare)
            nu_r, nu_b = math.sqrt(2.0 * (box.q + box.dq * u_q)) - gate.r, box.b + box.db * u_b
            gated_plots = kernels_gate.add_plot(gated_plots, nu_r, nu_b, 1.0, (irr, irb, ibb), threshold)
    return gated_plots, any_in_box


@inline
def associate_in_box(keys, rule, draw_index, gate, plot, box, law_probability, drawn_probability):
    """Associate one track with plots drawn in its box.

    Returns the association, the factor of the ratio of the law that shifts the track, and whether any plot is in the
    box. draw_index: realisation and scan. plot: of the target, as in `association.associate_track`. law_probability is
    the h of that law, drawn_probability that of the law that the track is drawn from; both are raised to at least p."""
    p = -math.expm1(-box.mean)
    h = max(law_probability, p)
    gated_plots, any_in_box = draw_plots_in_gate(
        keys, draw_index[0], draw_index[1], gate, rule.chi_square, box, p, max(drawn_probability, p)
    )
    if plot[0] > 0.0:
        irr, irb, ibb, _ = kernels_gate.inverse_two(gate.S[0], gate.S[1], gate.S[2])
        gated_plots = kernels_gate.add_plot(
            gated_plots, plot[1] - gate.r, plot[2] - gate.b, 0.0, (irr, irb, ibb), rule.chi_square
        )
    association = kernels_gate.associate_gated_plots(gated_plots, rule, gate.r, gate.S, gate.has_velocity)
    return association, h / p if any_in_box else (1.0 - h) / (1.0 - p), any_in_box
