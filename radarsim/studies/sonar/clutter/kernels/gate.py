"""Plots in the gate of a track: which one is the nearest, how probable each is, and what the track takes of them.

The letters, plain numbers here:

    r, b        range in m, bearing in rad
    nu          innovation (r, b)
    S           covariance of the innovation: rr, rb, bb
    S_inverse   S⁻¹ likewise: rr, rb, bb
    d           νᵀ S⁻¹ ν of a plot; e = exp(-d / 2), its likelihood without the constant
    beta0       probability that no plot in the gate is the target's (PDA)
    P_D, P_G    probabilities of detection, and that the gate contains the target's plot
"""

import math
from typing import NamedTuple

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.random import log_polynomial

LEAST_DENSITY = 1e-9  # per m², in scores: without false plots a score would be infinite
OPEN = 1e30  # χ² of a gate that contains everything
CLOSEST = 1.0  # m: the least range at which densities and gates are computed, should a track pass through the sonar
LEAST = 1e-300  # least likelihood that counts: the reciprocal of a smaller one may be infinite
NEAREST, PDA, KNOWN = range(3)


class Rule(NamedTuple):
    """How a tracker chooses among the plots in its gate.

    association is NEAREST, PDA or KNOWN; gate the χ² of two components; detection P_D and inside P_G; density of false
    plots per m² as the tracker assumes it; speed of targets in m/s, which widens the gate of a track of one plot.
    """

    association: int
    gate: float
    detection: float
    inside: float
    density: float
    speed: float


class Gate(NamedTuple):
    """The gate of a track: predicted r and b, S (rr, rb, bb), and whether the track has two plots or more."""

    r: float
    b: float
    S: tuple[float, float, float]
    settled: bool


class Gated(NamedTuple):
    """Plots in a gate so far: their number, that of false ones; d and innovation of the nearest, 1 if it is false.

    Then, weighted with the likelihoods e: Σe, Σe of false plots, mean innovation and scatter (rr, rb, bb) about it.
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

    The innovation in r and b and its additional covariance V (rr, rb, bb); taken is 1 if any plot is taken, else 0;
    then the weight of false plots among them, and the increment of the track's score.
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
def inverse_two(rr, rb, bb):
    """Inverse (rr, rb, bb) and determinant of a symmetric 2 × 2 matrix."""
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
    """The plots in a gate with one more of innovation (nu_r, nu_b), if its d is at most the threshold; false 1 or 0.

    The weighted mean and scatter are updated plot by plot (West 1979): the scatter of a single plot is exactly zero.
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
def associated(gated, rule, r, S, settled):
    """The Association of a track at range r from the plots in its gate.

    This is Bar-Shalom's parametric filter (Bar-Shalom, Daum, Huang 2009). With b = λ 2π √|S| (1 - P_D P_G) / P_D, no
    plot is the target's with probability β₀ = b / (b + Σe), and the covariance exceeds that after a certain plot by
    K (β₀ S + scatter) Kᵀ. λ is the density in range and bearing: the density per m² times the range. The score is the
    logarithm of the likelihood ratio of all plots in the gate, with a target against without. A track of one plot (not
    settled) takes the nearest.
    """
    r = max(r, CLOSEST)
    density, root = rule.density * r, 2.0 * math.pi * math.sqrt(S[0] * S[2] - S[1] * S[1])
    missed = 1.0 - rule.detection * rule.inside
    ratio = missed + rule.detection * gated.weight / (root * max(density, LEAST_DENSITY * r))
    score = log_polynomial(max(ratio, 1e-12))
    if gated.count == 0.0:
        return Association(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, score)
    none = density * root * missed / rule.detection
    if rule.association != PDA or not settled or none + gated.weight == 0.0:
        return Association(gated.nu_r, gated.nu_b, 0.0, 0.0, 0.0, 1.0, gated.nearest_false, score)
    beta0 = none / (none + gated.weight)
    # In an open gate all plots may be so far away that their likelihoods are zero.
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
    """The Association of a track at range r with innovation covariance S (rr, rb, bb), from plots' innovations (n,)."""
    irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
    gated = empty_gate()
    for i in range(nu_r.size):
        gated = with_plot(gated, nu_r[i], nu_b[i], 0.0, (irr, irb, ibb), rule.gate)
    return associated(gated, rule, r, S, settled)
