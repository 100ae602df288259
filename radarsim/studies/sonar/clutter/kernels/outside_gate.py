"""The probability that the target's plot is outside the gate of its track."""

import math

from radarsim.kernels.compiler import inline, kernel
from radarsim.studies.sonar.clutter.kernels import gate

QUADRATURE_NODES = 48  # error under 10⁻¹³ for gates up to 60 σ² wide
MAX_SIGMAS = 8.5  # a plot is farther from its mean once in 10¹⁶


@inline
def normal_cdf(x):
    """Distribution function of the unit normal."""
    return 0.5 * math.erfc(-math.sqrt(0.5) * x)


@kernel
def probability_outside_gate(off, S, threshold, sigma):
    """c: the probability that a plot is outside a gate of covariance S (rr, rb, bb).

    off (r, b) is the plot's mean relative to the centre of the gate, sigma (r, b) its σ, in m and rad; the errors in
    range and bearing are independent. Integrates over the range the density times the probability that the bearing is
    in the gate. With the sine of an angle for the range the integrand is smooth and periodic, so that the midpoint rule
    converges exponentially."""
    (off_r, off_b), (sigma_r, sigma_b) = off, sigma
    if threshold >= gate.OPEN_GATE:
        return 0.0
    half_r, slope = math.sqrt(threshold * S[0]), S[1] / S[0]
    x_min, x_max = max(-half_r, off_r - MAX_SIGMAS * sigma_r), min(half_r, off_r + MAX_SIGMAS * sigma_r)
    if x_min >= x_max:
        return 1.0
    across = (S[2] - S[1] * slope) / S[0]
    middle, half, total = 0.5 * (x_min + x_max), 0.5 * (x_max - x_min), 0.0
    for j in range(QUADRATURE_NODES):
        angle = math.pi * ((j + 0.5) / QUADRATURE_NODES - 0.5)
        x = middle + half * math.sin(angle)
        half_chord = math.sqrt(max((half_r * half_r - x * x) * across, 0.0))
        z, centre = (x - off_r) / sigma_r, slope * x - off_b
        inside = normal_cdf((centre + half_chord) / sigma_b) - normal_cdf((centre - half_chord) / sigma_b)
        total += math.cos(angle) * math.exp(-0.5 * z * z) * inside
    share = total * half * math.pi / QUADRATURE_NODES / (sigma_r * math.sqrt(2.0 * math.pi))
    return min(max(1.0 - share, 0.0), 1.0)
