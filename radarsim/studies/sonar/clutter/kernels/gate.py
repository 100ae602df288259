"""The gate of a track, and the association of the track with the plots in it.

Letters:

    r, b        range in m, bearing in rad
    nu          innovation (r, b)
    S           covariance of the innovation: rr, rb, bb
    S_inverse   S⁻¹ likewise: rr, rb, bb
    d           νᵀ S⁻¹ ν of a plot; e = exp(-d / 2), its likelihood without the constant
    beta0       probability that no plot in the gate is the target's (PDA)
    P_D, P_G    probabilities of detection, and that the gate contains the target's plot"""

import math
from typing import NamedTuple

from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.polynomials import log_polynomial

MIN_DENSITY = 1e-9  # per m², in scores: without false plots a score would be infinite
OPEN_GATE = 1e30  # χ² of a gate that contains everything; kernels are compiled without infinities
MIN_RANGE_M = 1.0  # of densities and gates, should a track pass through the sonar
MIN_LIKELIHOOD = 1e-300  # the reciprocal of a smaller likelihood may be infinite
NEAREST, PDA, KNOWN = range(3)


class AssociationRule(NamedTuple):
    """How a tracker chooses among the plots in its gate."""

    association: int  #: NEAREST, PDA or KNOWN
    chi_square: float  #: of two components, on the border of the gate
    detection: float  #: P_D
    gate_probability: float  #: P_G
    density: float  #: of false plots per m², as the tracker assumes it
    speed: float  #: of targets in m/s, which widens the gate of a track of one plot


class Gate(NamedTuple):
    """The gate of a track: predicted r and b, S (rr, rb, bb), and whether the track has two plots or more."""

    r: float
    b: float
    S: tuple[float, float, float]
    has_velocity: bool


class GatedPlots(NamedTuple):
    """The plots found in a gate so far.

    Number of plots, number of false plots; of the nearest plot d, the innovation, and 1 if it is false. Then, weighted
    with the likelihoods e: Σe, Σe of false plots, mean innovation and scatter (rr, rb, bb) about it."""

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
    """What a track takes from the plots in its gate."""

    nu_r: float  #: innovation in range
    nu_b: float  #: innovation in bearing
    rr: float  #: of the additional covariance V
    rb: float
    bb: float
    has_plot: float  #: 1 if any plot is taken, else 0
    false_share: float  #: weight of false plots among those taken
    score: float  #: increment of the track's score


@inline
def inverse_two(rr, rb, bb):
    """Inverse (rr, rb, bb) and determinant of a symmetric 2 × 2 matrix."""
    det = rr * bb - rb * rb
    per = 1.0 / det
    return bb * per, -rb * per, rr * per, det


@inline
def empty_gate():
    """A gate without plots."""
    return GatedPlots(0.0, 0.0, OPEN_GATE, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inline
def distance_squared(nu_r, nu_b, S_inverse):
    """νᵀ S⁻¹ ν."""
    return S_inverse[0] * nu_r * nu_r + 2.0 * S_inverse[1] * nu_r * nu_b + S_inverse[2] * nu_b * nu_b


@inline
def add_plot(gated_plots, nu_r, nu_b, false, S_inverse, threshold):
    """Add a plot with innovation (nu_r, nu_b) to those in a gate, if its d is at most the threshold.

    false is 1 for a false plot, else 0. The weighted mean and scatter are updated plot by plot (West 1979): the scatter
    of a single plot is exactly zero."""
    count, false_count, nearest_d, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb = gated_plots
    d = distance_squared(nu_r, nu_b, S_inverse)
    if d > threshold:
        return gated_plots
    count, false_count = count + 1.0, false_count + false
    if d < nearest_d:
        nearest_d, r, b, nearest_false = d, nu_r, nu_b, false
    e = math.exp(-0.5 * d)
    if e > MIN_LIKELIHOOD:
        weight, false_weight = weight + e, false_weight + e * false
        share, off_r, off_b = e / weight, nu_r - mean_r, nu_b - mean_b
        mean_r, mean_b = mean_r + share * off_r, mean_b + share * off_b
        rr, rb = rr + e * (off_r * (nu_r - mean_r)), rb + e * (off_r * (nu_b - mean_b))
        bb = bb + e * (off_b * (nu_b - mean_b))
    return GatedPlots(
        count, false_count, nearest_d, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb
    )


@inline
def associate_gated_plots(gated_plots, rule, r, S, has_velocity):
    """Associate a track at range r with the plots in its gate.

    This is Bar-Shalom's parametric filter (Bar-Shalom, Daum, Huang 2009). With b = λ 2π √|S| (1 - P_D P_G) / P_D, no
    plot is the target's with probability β₀ = b / (b + Σe), and the covariance exceeds that after a certain plot by
    K (β₀ S + scatter) Kᵀ. λ is the density in range and bearing: the density per m² times the range. The score is the
    logarithm of the likelihood ratio of all plots in the gate, with a target against without. A track of one plot, of
    unknown velocity, takes the nearest."""
    r = max(r, MIN_RANGE_M)
    density, root = rule.density * r, 2.0 * math.pi * math.sqrt(S[0] * S[2] - S[1] * S[1])
    miss_probability = 1.0 - rule.detection * rule.gate_probability
    ratio = miss_probability + rule.detection * gated_plots.weight / (root * max(density, MIN_DENSITY * r))
    score = log_polynomial(max(ratio, 1e-12))
    if gated_plots.count == 0.0:
        return Association(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, score)
    missed_weight = density * root * miss_probability / rule.detection
    if rule.association != PDA or not has_velocity or missed_weight + gated_plots.weight == 0.0:
        return Association(gated_plots.nu_r, gated_plots.nu_b, 0.0, 0.0, 0.0, 1.0, gated_plots.nearest_false, score)
    beta0 = missed_weight / (missed_weight + gated_plots.weight)
    # In an open gate all plots may be so far away that their likelihoods are zero.
    target_probability, per = 1.0 - beta0, 1.0 / gated_plots.weight if gated_plots.weight > 0.0 else 0.0
    mean_r, mean_b = gated_plots.mean_r, gated_plots.mean_b
    return Association(
        target_probability * mean_r,
        target_probability * mean_b,
        beta0 * S[0] + target_probability * (gated_plots.rr * per + beta0 * (mean_r * mean_r)),
        beta0 * S[1] + target_probability * (gated_plots.rb * per + beta0 * (mean_r * mean_b)),
        beta0 * S[2] + target_probability * (gated_plots.bb * per + beta0 * (mean_b * mean_b)),
        1.0,
        gated_plots.false_weight * per,
        score,
    )


@kernel
def associate_innovations(rule, has_velocity, r, S, nu_r, nu_b):
    """Associate a track at range r, with innovation covariance S (rr, rb, bb), with plots of innovations (n,)."""
    irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
    gated_plots = empty_gate()
    for i in range(nu_r.size):
        gated_plots = add_plot(gated_plots, nu_r[i], nu_b[i], 0.0, (irr, irb, ibb), rule.chi_square)
    return associate_gated_plots(gated_plots, rule, r, S, has_velocity)


@inline
def track_gate(position, S, has_velocity, reach):
    """The gate of a track; after one plot the velocity is unknown, and the target may have moved by `reach`, in m."""
    r, b = position
    if not has_velocity:
        S = (S[0] + reach * reach, S[1], S[2] + (reach / max(r, MIN_RANGE_M)) ** 2)
    return Gate(r, b, S, has_velocity)
