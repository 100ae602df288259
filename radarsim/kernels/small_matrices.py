"""Small matrices as tuples of rows, a symmetric one packed row by row, for floats, arrays and lanes."""

import functools
from collections.abc import Sequence
from typing import Any

from radarsim.kernels.tracing import UnsupportedFormula, case_value, minimum


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Scalar product of two rows."""
    return functools.reduce(lambda done, pair: done + pair[0] * pair[1], zip(a[1:], b[1:], strict=True), a[0] * b[0])


@functools.cache
def _row_places(n: int, i: int) -> tuple[int, ...]:
    """The places of row i in a packed symmetric matrix of n rows."""
    return tuple(min(i, j) * n - min(i, j) * (min(i, j) + 1) // 2 + max(i, j) for j in range(n))


def row_of(P: Sequence[Any], n: int, i: int) -> tuple[Any, ...]:
    """Row i of a packed symmetric matrix of n rows."""
    return tuple([P[place] for place in _row_places(n, i)])


def times(P: Sequence[Any], h: Sequence[Any]) -> tuple[Any, ...]:
    """P h of a packed symmetric P."""
    return tuple(dot(row_of(P, len(h), i), h) for i in range(len(h)))


def congruence(J: Sequence[Sequence[Any]], P: Sequence[Any]) -> tuple[Any, ...]:
    """J P J', packed, of a packed P and the rows of J."""
    moved = [times(P, row) for row in J]
    return tuple(dot(J[i], moved[j]) for i in range(len(J)) for j in range(i, len(J)))


def update(x: Sequence[Any], P: Sequence[Any], h: Sequence[Any], e: Any, R: Any) -> tuple[tuple, tuple]:
    """A state and its packed covariance after a number with row h, innovation e and an error of variance R."""
    variance = case_value(R)
    if variance is not None and variance <= 0:
        raise UnsupportedFormula(
            f"updated: R, the variance of the error of a number, must be positive, got {variance:g}"
        )
    g = times(P, h)
    S = dot(h, g) + R
    n = len(x)
    shrunk = [row_of(P, n, i)[j] - g[i] * g[j] / S for i in range(n) for j in range(i, n)]
    return tuple(a + b / S * e for a, b in zip(x, g, strict=True)), tuple(shrunk)


def normalised_square(P: Sequence[Any], e: Sequence[Any]) -> Any:
    """e' P⁻¹ e of a positive packed P."""
    return eliminate(P, e)[0]


def eliminate(P: Sequence[Any], e: Sequence[Any]) -> tuple[Any, Any]:
    """e' P⁻¹ e of a packed P by its factors L D L', and the least element of D, which is positive where P is."""
    n = len(e)
    rows, rest_of_e, sums, pivots = [list(row_of(P, n, i)) for i in range(n)], list(e), [], []
    for i in range(n):
        pivots.append(rows[i][i])
        sums.append(rest_of_e[i] * rest_of_e[i] / rows[i][i])
        for j in range(i + 1, n):
            share = rows[j][i] / rows[i][i]
            rest_of_e[j] = rest_of_e[j] - share * rest_of_e[i]
            rows[j] = [a - share * b for a, b in zip(rows[j], rows[i], strict=True)]
    return functools.reduce(lambda a, b: a + b, sums), functools.reduce(minimum, pivots)
