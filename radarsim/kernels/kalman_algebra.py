"""The algebra of Kalman filters with three states a coordinate, for plain numbers, arrays and lanes.

Python calls functions marked `inline` as they are, and kernels have them copied into them. This module loads no
compiler; `radarsim.kernels.compiler` says how kernels take them.

A coordinate's state is the triple (value, rate, second rate), x, v, a. Its covariance is packed symmetric, P = (xx, xv,
xa, vv, va, aa); a block between two coordinates is full, row by row: c = (xx, xv, xa, vx, vv, va, ax, av, aa). Packing
keeps a covariance symmetric by construction: `P - K S K'` on full storage drifts and diverges silently. A transition is
F = (f01, f02, f11, f12, f22) of [[1, f01, f02], [0, f11, f12], [0, 0, f22]]. Differences are written term by term, `p -
g0*h0 - g1*h1 - g2*h2`: each is one fused instruction; `p - dot(g, h)` is not.

The book is Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), ch. 5."""

import functools
from collections.abc import Callable

import numpy as np

ROWS, COLUMNS = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)  # of the elements of a packed matrix
COLUMN = ((0, 1, 2), (1, 3, 4), (2, 4, 5))  # where a packed matrix has its columns
NO_NOISE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Formula:
    """A function of Python, to which `radarsim.kernels.compiler` gives a compiled twin where a kernel calls it."""

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self.function = function

    def __call__(self, *arguments):
        return self.function(*arguments)


inline = Formula


def pack(matrix: np.ndarray) -> tuple[np.ndarray, ...]:
    """The packed form of symmetric matrices (…, 3, 3): six arrays (…)."""
    return tuple(matrix[..., i, j] for i, j in zip(ROWS, COLUMNS, strict=True))


def unpack(packed) -> np.ndarray:
    """Matrices (…, 3, 3) of their packed form."""
    return np.stack([np.stack([packed[n] for n in column], axis=-1) for column in COLUMN], axis=-2)


def pack_transition(F: np.ndarray) -> tuple[float, ...]:
    """The five numbers of transition matrices (…, 3, 3)."""
    return F[..., 0, 1], F[..., 0, 2], F[..., 1, 1], F[..., 1, 2], F[..., 2, 2]


@inline
def constant_acceleration(dt):
    """F over a time dt of a state with constant second rate."""
    return dt, 0.5 * dt * dt, 1.0, dt, 1.0


@inline
def predict_state(x, F):
    """F x of a state."""
    return x[0] + F[0] * x[1] + F[1] * x[2], F[2] * x[1] + F[3] * x[2], F[4] * x[2]


@inline
def predict_covariance(P, F, Q):
    """F P F' + Q, all packed; without noise Q is NO_NOISE."""
    x0 = P[0] + F[0] * P[1] + F[1] * P[2]
    x1 = P[1] + F[0] * P[3] + F[1] * P[4]
    x2 = P[2] + F[0] * P[4] + F[1] * P[5]
    v1 = F[2] * P[3] + F[3] * P[4]
    v2 = F[2] * P[4] + F[3] * P[5]
    return (
        x0 + F[0] * x1 + F[1] * x2 + Q[0],
        F[2] * x1 + F[3] * x2 + Q[1],
        F[4] * x2 + Q[2],
        F[2] * v1 + F[3] * v2 + Q[3],
        F[4] * v2 + Q[4],
        F[4] * (F[4] * P[5]) + Q[5],
    )


@inline
def predict_cross(c, F):
    """F c F' of a block between two coordinates, whose noises are independent."""
    a0, a1, a2 = predict_state((c[0], c[3], c[6]), F)
    b0, b1, b2 = predict_state((c[1], c[4], c[7]), F)
    d0, d1, d2 = predict_state((c[2], c[5], c[8]), F)
    return predict_state((a0, b0, d0), F) + predict_state((a1, b1, d1), F) + predict_state((a2, b2, d2), F)


@inline
def predict_information(Y, dt):
    """F⁻ᵀ Y F⁻¹ of a packed information Y over a time dt of constant second rate, without noise. With the order of the
    states reversed F⁻ᵀ is F of the time -dt."""
    F = constant_acceleration(-dt)
    y5, y4, y2, y3, y1, y0 = predict_covariance((Y[5], Y[4], Y[2], Y[3], Y[1], Y[0]), F, NO_NOISE)
    return y0, y1, y2, y3, y4, y5


@inline
def take_value(P, R, present):
    """Covariance after a measured value of variance R, its gain (3), and the innovation's variance S.

    present is 1, or 0 where there is none: then P stays as it is and the gain is zero. R/S multiplies what a difference
    of large numbers would leave: P - P₀ P₀ᵀ/S has P₀₀ R/S in its first row."""
    S = P[0] + R
    use = present / S
    share_left = 1.0 - present + R * use
    g = P[0] * use, P[1] * use, P[2] * use
    return (
        (
            P[0] * share_left,
            P[1] * share_left,
            P[2] * share_left,
            P[3] - g[1] * P[1],
            P[4] - g[1] * P[2],
            P[5] - g[2] * P[2],
        ),
        g,
        S,
    )


@inline
def take_rate(P, R, present):
    """As `take_value`, of a measured rate: rate and value change places."""
    (p3, p1, p4, p0, p2, p5), (g1, g0, g2), S = take_value((P[3], P[1], P[4], P[0], P[2], P[5]), R, present)
    return (p0, p1, p2, p3, p4, p5), (g0, g1, g2), S


@inline
def take_second_rate(P, R, present):
    """As `take_value`, of a measured second rate: it and the value change places."""
    (p5, p4, p2, p3, p1, p0), (g2, g1, g0), S = take_value((P[5], P[4], P[2], P[3], P[1], P[0]), R, present)
    return (p0, p1, p2, p3, p4, p5), (g0, g1, g2), S


TAKE = take_value, take_rate, take_second_rate  # by the number of the component


# Joseph's form, (I - g h) P (I - g h)' + R g g', is true with any gain g: for errors of a filter with a wrong model.
@inline
def correct_value(P, R, g):
    """Covariance of an error after a value, with an error of variance R, was taken with the gain g (3)."""
    unweighted, d1, d2 = 1.0 - g[0], P[1] - g[1] * P[0], P[2] - g[2] * P[0]
    n0, n1, n2 = R * g[0], R * g[1], R * g[2]
    return (
        unweighted * unweighted * P[0] + n0 * g[0],
        unweighted * d1 + n0 * g[1],
        unweighted * d2 + n0 * g[2],
        P[3] - g[1] * (P[1] + d1) + n1 * g[1],
        P[4] - g[1] * P[2] - g[2] * d1 + n1 * g[2],
        P[5] - g[2] * (P[2] + d2) + n2 * g[2],
    )


@inline
def correct_rate(P, R, g):
    """As `correct_value`, of a rate."""
    p3, p1, p4, p0, p2, p5 = correct_value((P[3], P[1], P[4], P[0], P[2], P[5]), R, (g[1], g[0], g[2]))
    return p0, p1, p2, p3, p4, p5


@inline
def correct_second_rate(P, R, g):
    """As `correct_value`, of a second rate."""
    p5, p4, p2, p3, p1, p0 = correct_value((P[5], P[4], P[2], P[3], P[1], P[0]), R, (g[2], g[1], g[0]))
    return p0, p1, p2, p3, p4, p5


CORRECT = correct_value, correct_rate, correct_second_rate


@inline
def correct_covariance(P, h, g, S):
    """P - g h' - h g' + S g g': the same after any number, whose covariance with the state is h (3) and variance S."""
    d0, d1, d2 = h[0] - g[0] * S, h[1] - g[1] * S, h[2] - g[2] * S
    return (
        P[0] - g[0] * h[0] - d0 * g[0],
        P[1] - g[0] * h[1] - d0 * g[1],
        P[2] - g[0] * h[2] - d0 * g[2],
        P[3] - g[1] * h[1] - d1 * g[1],
        P[4] - g[1] * h[2] - d1 * g[2],
        P[5] - g[2] * h[2] - d2 * g[2],
    )


@inline
def add_scaled(x, w, g):
    """x + w g of triples."""
    return x[0] + w * g[0], x[1] + w * g[1], x[2] + w * g[2]


@inline
def add_outer(P, w, g):
    """P + w g g', packed."""
    w0, w1, w2 = w * g[0], w * g[1], w * g[2]
    return P[0] + w0 * g[0], P[1] + w0 * g[1], P[2] + w0 * g[2], P[3] + w1 * g[1], P[4] + w1 * g[2], P[5] + w2 * g[2]


@inline
def add_spread(P, w, C, d):
    """P + w (C + d d'), packed: with a part of a mixture, of weight w and covariance C, whose mean is off by d."""
    return (
        P[0] + w * (C[0] + d[0] * d[0]),
        P[1] + w * (C[1] + d[0] * d[1]),
        P[2] + w * (C[2] + d[0] * d[2]),
        P[3] + w * (C[3] + d[1] * d[1]),
        P[4] + w * (C[4] + d[1] * d[2]),
        P[5] + w * (C[5] + d[2] * d[2]),
    )


@inline
def dot(a, b):
    """Scalar product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def times(P, x):
    """P x of a packed P."""
    return dot((P[0], P[1], P[2]), x), dot((P[1], P[3], P[4]), x), dot((P[2], P[4], P[5]), x)


@inline
def inverse(P):
    """The inverse of a positive packed matrix, by its factors L D L'. Scaled rows and columns give the same digits, so
    that units do not matter."""
    l10, l20 = P[1] / P[0], P[2] / P[0]
    d1 = P[3] - l10 * P[1]
    m = P[4] - l10 * P[2]
    l21 = m / d1
    i0, i1, i2 = 1.0 / P[0], 1.0 / d1, 1.0 / (P[5] - l20 * P[2] - l21 * m)
    a = l10 * l21 - l20  # L⁻¹ = [[1, 0, 0], [-l10, 1, 0], [a, -l21, 1]]
    return (
        i0 + l10 * l10 * i1 + a * a * i2,
        0.0 - (l10 * i1 + a * l21 * i2),
        a * i2,
        i1 + l21 * l21 * i2,
        0.0 - l21 * i2,
        i2,
    )


@inline
def factorise(s):
    """L D L' of a positive packed matrix: (l10, l20, l21), 1 / D, determinant. With one division: they are slow.

    Updates of nine states go by whitened rows and not by the inverse: its rounding, of the size of the condition number
    (3·10⁶ for angles of one degree at 200 km), made covariances negative after some 600 scans."""
    minor = s[0] * s[3] - s[1] * s[1]
    m = s[0] * s[4] - s[1] * s[2]
    scaled_determinant = minor * (s[0] * s[5] - s[2] * s[2]) - m * m  # the determinant times s00
    scale = 1.0 / (s[0] * minor * scaled_determinant)
    i0, by_minor = scale * minor * scaled_determinant, scale * s[0] * scaled_determinant
    i2 = s[0] * minor * (scale * s[0] * minor)
    return (s[1] * i0, s[2] * i0, m * by_minor), (i0, s[0] * by_minor, i2), scaled_determinant * i0


@inline
def whiten(h, lower):
    """L⁻¹ h of a row h (3)."""
    y1 = h[1] - lower[0] * h[0]
    return h[0], y1, h[2] - lower[1] * h[0] - lower[2] * y1


@inline
def scale_row(y, i):
    """Row y (3) by the diagonal i (3)."""
    return y[0] * i[0], y[1] * i[1], y[2] * i[2]


@inline
def shrink(p, g, h):
    """p - g h' of one element: h a whitened row of P H', g a scaled one."""
    return p - g[0] * h[0] - g[1] * h[1] - g[2] * h[2]


@inline
def shrink_block(P, g, h):
    """A coordinate's own block after an update; g and h are its three rows."""
    return (
        shrink(P[0], g[0], h[0]),
        shrink(P[1], g[0], h[1]),
        shrink(P[2], g[0], h[2]),
        shrink(P[3], g[1], h[1]),
        shrink(P[4], g[1], h[2]),
        shrink(P[5], g[2], h[2]),
    )


@inline
def shrink_cross(c, g, h):
    """Block between two coordinates after an update: g the rows of the first, h those of the second."""
    return (
        shrink(c[0], g[0], h[0]),
        shrink(c[1], g[0], h[1]),
        shrink(c[2], g[0], h[2]),
        shrink(c[3], g[1], h[0]),
        shrink(c[4], g[1], h[1]),
        shrink(c[5], g[1], h[2]),
        shrink(c[6], g[2], h[0]),
        shrink(c[7], g[2], h[1]),
        shrink(c[8], g[2], h[2]),
    )
