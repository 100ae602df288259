"""Plots in range, bearing and radial velocity of a state in the plane, for floats, arrays and lanes.

A state begins with x north, y east, m, and their rates; a bearing is from north to the east, rad.

LXYKB: Longbin, Xiaoquan, Yiyu, Kang & Bar-Shalom, IEEE Trans. AES 34 (1998), 1074."""

import math
from collections.abc import Sequence
from typing import Any

from radarsim.kernels.formula_functions import atan2, cos, exp, sin, wrap_angle
from radarsim.kernels.gaussian_filters import Law, State
from radarsim.kernels.packed_matrices import add
from radarsim.kernels.small_matrices import row_of
from radarsim.kernels.tracing import sqrt


def fold(velocity: Any, span: Any) -> Any:
    """A velocity folded into the unambiguous interval about zero."""
    return wrap_angle(velocity * (math.tau / span)) * (span / math.tau)


def polar(x: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Range, bearing and radial velocity of a state."""
    r = sqrt(x[0] * x[0] + x[1] * x[1])
    return r, atan2(x[1], x[0]), (x[0] * x[2] + x[1] * x[3]) / r


def polar_rows(x: Sequence[Any]) -> tuple[tuple[Any, ...], ...]:
    """Their derivatives by the state, rows (3, n)."""
    r, _, v = polar(x)
    north, east, rest = x[0] / r, x[1] / r, (0.0,) * (len(x) - 4)
    along = (x[2] - v * north) / r, (x[3] - v * east) / r
    return (north, east, 0.0, 0.0, *rest), (-east / r, north / r, 0.0, 0.0, *rest), (*along, north, east, *rest)


def speed_and_course_rows(x: Sequence[Any]) -> tuple[tuple[Any, ...], ...]:
    """The derivatives of speed and course by a state that moves, rows (2, n)."""
    speed, rest = sqrt(x[2] * x[2] + x[3] * x[3]), (0.0,) * (len(x) - 4)
    north, east = x[2] / speed, x[3] / speed
    return (0.0, 0.0, north, east, *rest), (0.0, 0.0, -east / speed, north / speed, *rest)


def errors_covariance(sigma: Sequence[Any], correlation: Any) -> tuple[Any, ...]:
    """The packed covariance of errors in range, bearing and radial velocity, the first and last of them correlated."""
    r, b, v = sigma
    return r * r, 0.0, correlation * r * v, b * b, 0.0, v * v


def state_of_plot(
    plot: Sequence[Any], velocity: Any, sigma: Sequence[Any], correlation: Any, sigma_across: Any, rest: Sequence[Any]
) -> State:
    """The state with a plot's position and a radial velocity of the standard deviation sigma[2]; across the line of
    sight the velocity is zero with that of `sigma_across`, and what follows it with those of `rest`."""
    s, o, n = sin(plot[1]), cos(plot[1]), 4 + len(rest)
    along, across = (sigma[0] ** 2, sigma[2] ** 2), ((plot[0] * sigma[1]) ** 2, sigma_across**2)
    joint = correlation * sigma[0] * sigma[2]
    P = [[0.0] * n for _ in range(n)]
    for i, (a, d) in enumerate(zip(along, across, strict=True)):
        P[2 * i][2 * i], P[2 * i + 1][2 * i + 1] = a * o * o + d * s * s, a * s * s + d * o * o
        P[2 * i][2 * i + 1] = (a - d) * s * o
    P[0][2], P[1][3], P[0][3], P[1][2] = (joint * a for a in (o * o, s * s, s * o, s * o))
    for i, sigma_of_rest in enumerate(rest, 4):
        P[i][i] = sigma_of_rest * sigma_of_rest
    packed = tuple(P[i][j] for i in range(n) for j in range(i, n))
    return (plot[0] * o, plot[0] * s, velocity * o, velocity * s, *(0.0,) * len(rest)), packed


def converted(plot: Sequence[Any], sigma: Sequence[Any], unbiased: bool) -> tuple[tuple[Any, Any], tuple[Any, ...]]:
    """x and y of a plot, and their packed covariance: LXYKB eq. 10 and 11 if unbiased, else linearised at the plot."""
    s, o, (r, b) = sin(plot[1]), cos(plot[1]), sigma[:2]
    if not unbiased:
        along, across = r * r, (plot[0] * b) ** 2
        R = along * o * o + across * s * s, (along - across) * s * o, along * s * s + across * o * o
        return (plot[0] * o, plot[0] * s), R
    shrink, twice = exp(-b * b / 2), exp(-2 * b * b)
    square, both = plot[0] * plot[0] * (1 / (shrink * shrink) - 2), (plot[0] * plot[0] + r * r) / 2
    varying = both * twice * (o * o - s * s)
    R = square * o * o + both + varying, (square + 2 * both * twice) * s * o, square * s * s + both - varying
    return (plot[0] * o / shrink, plot[0] * s / shrink), R


def law_of_position(state: State, position: Sequence[Any], R: Sequence[Any]) -> Law:
    """The law of a position, x and y, with errors of the packed covariance R."""
    (x, P), n = state, len(state[0])
    rows = row_of(P, n, 0), row_of(P, n, 1)
    return (x[0], x[1]), add((rows[0][0], rows[0][1], rows[1][1]), R), rows
