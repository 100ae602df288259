"""Filters in Cartesian coordinates by plots in range, bearing and folded radial velocity, for floats, arrays and lanes.

Errors of plots are a record or tuple with sigma (3,), rho, their correlation of range and velocity, and span, the
unambiguous velocity interval. m: how many numbers of a plot a filter uses, 2 or 3. States and laws as in
`radarsim.kernels.gaussian_filters`."""

import math
from collections.abc import Sequence
from typing import Any

from radarsim.kernels.formula_functions import cos, sin, wrap_angle
from radarsim.kernels.gaussian_filters import Law, State, linearised_law, take, take_plot, unscented_law
from radarsim.kernels.packed_matrices import add
from radarsim.kernels.polar_plots import converted, errors_covariance, fold, law_of_position, polar, polar_rows
from radarsim.kernels.small_matrices import dot, times, update
from radarsim.kernels.tracing import minimum, where

# Standard deviations of a predicted velocity in the unambiguous interval: with fewer its fold is not known. ±5 σ, so
# that a fold is wrong 6e-7 times a scan. At ±3 σ it is once in 370 scans, and one lost track in 200 outweighs the gain.
RESOLVED = 10


def is_fold_known(variance: Any, span: Any) -> Any:
    """Whether a predicted velocity of this variance tells the fold of a measured one."""
    return variance * RESOLVED**2 < span * span


def plot_difference(z: Sequence[Any], mean: Sequence[Any], span: Any) -> tuple[Any, ...]:
    """A plot less another, or less the expected one, whose numbers are those in use."""
    position = z[0] - mean[0], wrap_angle(z[1] - mean[1])
    return (*position, fold(z[2] - mean[2], span)) if len(mean) == 3 else position


def law_of_plot(state: State, errors: Any, m: int, unscented: bool) -> Law:
    """The law of a plot under a state, by its derivatives or by sigma points; it says nothing of the velocity where
    that does not tell its fold."""
    if unscented:
        mean, S, C = unscented_law(state, lambda x: polar(x)[:m], lambda a, b: plot_difference(a, b, errors.span))
    else:
        mean, S, C = linearised_law(state[1], polar(state[0])[:m], polar_rows(state[0])[:m])
    R = errors_covariance(errors.sigma, errors.rho)
    if m == 2:
        return mean, add(S, (R[0], R[1], R[3])), C
    S = add(S, R)
    with_r, with_b, *with_state = where(is_fold_known(S[5], errors.span), (S[2], S[4], *C[2]), (0.0,) * (2 + len(C[2])))
    variance = minimum(S[5], errors.span * errors.span / math.tau)  # the peak is no lower than an even density
    return mean, (S[0], S[1], with_r, S[3], with_b, variance), (C[0], C[1], tuple(with_state))


def take_converted_plot(state: State, z: Sequence[Any], errors: Any, m: int, unbiased: bool, linear: bool) -> State:
    """A state after a plot that is converted to x and y, then after its radial velocity: linear, along the measured
    bearing, else linearised at the state with that position."""
    sigma, rho = errors.sigma, errors.rho
    position, R = converted(z, sigma, unbiased)
    law = law_of_position(state, position, R)
    e = position[0] - state[0][0], position[1] - state[0][1]
    x, P = take(state, law, take_plot(e, law[1]))
    if m == 2:
        return x, P
    north, east, v = cos(z[1]), sin(z[1]), sigma[2]
    if linear:
        h = 0.0, 0.0, north, east, *(0.0,) * (len(x) - 4)
        across = x[3] * north - x[2] * east
        e, variance = z[2] - dot(h, x), v * v + (across * sigma[1]) ** 2
    else:
        h, e, variance = polar_rows(x)[2], z[2] - polar(x)[2], v * v
    is_known = is_fold_known(dot(h, times(P, h)) + variance, errors.span)
    # Less what the error of the range tells of that of the velocity, both are independent.
    share = rho * v / sigma[0]
    e = fold(e, errors.span) - share * (north * (position[0] - x[0]) + east * (position[1] - x[1]))
    h = h[0] - share * north, h[1] - share * east, *h[2:]
    return where(is_known, update(x, P, h, e, variance - (rho * v) ** 2), (x, P))
