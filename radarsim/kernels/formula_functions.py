"""exp, log, sin, cos and atan2 for floats, arrays and lanes."""

import functools
import math
from typing import Any

from radarsim.kernels.tracing import Lane, nearest, plain, where


def exp(x: Any) -> Any:
    """exp x for x from -700 to 700; of lanes to 3 units in the last place, below -700 as at -700."""
    if not isinstance(x, Lane):
        return plain("exp", x)
    from radarsim.kernels.lanes import exponential

    return exponential(x)


def log(x: Any) -> Any:
    """Natural logarithm of a positive normal number; of lanes to 3 units in the last place."""
    if not isinstance(x, Lane):
        return plain("log", x)
    from radarsim.kernels.polynomials import log_series

    return log_series(x.trace.put("mantissa", x), x.trace.put("exponent", x))


HALF_PI = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21)  # of 33 bits each, the rest


def sine_cosine(x: Any) -> tuple[Any, Any]:
    """sin x and cos x; of lanes for x from -10⁵ to 10⁵, to 2·10⁻¹⁶ of 1."""
    if not isinstance(x, Lane):
        return plain("sin", x), plain("cos", x)
    from radarsim.kernels.polynomials import sine_cosine_polynomial

    n = nearest(x * (2 / math.pi))
    s, c = sine_cosine_polynomial(x - n * HALF_PI[0] - n * HALF_PI[1] - n * HALF_PI[2])
    quarter = n * 0.25 - nearest(n * 0.25)  # 0, ±1/4, ±1/2: of n modulo 4
    odd = abs(quarter) == 0.25
    s, c = where(odd, c, s), where(odd, s, c)
    return (
        where((quarter == -0.25) | (abs(quarter) == 0.5), -s, s),
        where((quarter == 0.25) | (abs(quarter) == 0.5), -c, c),
    )


def sin(x: Any) -> Any:
    """sin x; of lanes as `sine_cosine`."""
    return sine_cosine(x)[0]


def cos(x: Any) -> Any:
    """cos x; of lanes as `sine_cosine`."""
    return sine_cosine(x)[1]


# Of least greatest error (Remez's algorithm in 60 digits) for (atan t / t - 1) / t², t to tan(π/8): 3.4e-17 of atan t.
ATAN = (
    *(0.021278694907295097, -0.04360708638931716, 0.056931249673770265, -0.0664123876781761, 0.07690082512695902),
    *(-0.09090783470576942, 0.11111106701158656, -0.1428571419647109, 0.1999999999910404, -0.3333333333333022),
)


def atan2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y) from the axis of x, from -π to π, at (0, 0) zero; of lanes to 3 units in the last
    place."""
    if not isinstance(x, Lane) and not isinstance(y, Lane):
        return plain("arctan2", y + 0.0, x + 0.0)  # -0.0 is 0.0, as of lanes
    a, b = abs(x), abs(y)
    steep = b > a
    low, high = where(steep, a, b), where(steep, b, a)
    is_over_eighth = low > high * (math.sqrt(2) - 1)  # π/4 less the angle of (high - low, high + low)
    numerator, denominator = where(is_over_eighth, high - low, low), where(is_over_eighth, high + low, high)
    t = numerator / where(denominator > 0.0, denominator, 1.0)
    u = t * t
    angle = t + t * u * functools.reduce(lambda p, c: p * u + c, ATAN)
    angle = where(is_over_eighth, math.pi / 4 - angle, angle)
    angle = where(steep, math.pi / 2 - angle, angle)
    angle = where(x < 0.0, math.pi - angle, angle)
    return where(y < 0.0, -angle, angle)


def wrap_angle(angle: Any) -> Any:
    """An angle less whole turns, from -π to π."""
    return angle - nearest(angle * (1 / math.tau)) * math.tau
