"""Sums, inverses and roots of symmetric matrices that are packed row by row, for floats, arrays and lanes."""

from collections.abc import Sequence
from typing import Any

from radarsim.kernels.small_matrices import row_of
from radarsim.kernels.tracing import sqrt


def add(P: Sequence[Any], Q: Sequence[Any]) -> tuple[Any, ...]:
    """The sum of two packed matrices."""
    return tuple(a + b for a, b in zip(P, Q, strict=True))


def outer_square(e: Sequence[Any]) -> tuple[Any, ...]:
    """e e', packed."""
    return tuple(e[i] * e[j] for i in range(len(e)) for j in range(i, len(e)))


def invert(S: Sequence[Any], n: int) -> tuple[tuple[Any, ...], Any]:
    """The inverse of a packed matrix of 2 or 3 rows, and its determinant."""
    if n == 2:
        determinant = S[0] * S[2] - S[1] * S[1]
        return (S[2] / determinant, -S[1] / determinant, S[0] / determinant), determinant
    a, b, d, e, f, g = S
    first = e * g - f * f, d * f - b * g, b * f - d * e
    determinant = a * first[0] + b * first[1] + d * first[2]
    rest = a * g - d * d, b * d - a * f, a * e - b * b
    return tuple(cofactor / determinant for cofactor in (*first, *rest)), determinant


def cholesky(P: Sequence[Any], n: int) -> list[list[Any]]:
    """The rows of lower triangular L, L L' = P, of growing length, of a positive packed P."""
    rows: list[list[Any]] = []
    for i in range(n):
        row: list[Any] = []
        for j in range(i):
            rest = row_of(P, n, j)[i] - sum(row[k] * rows[j][k] for k in range(j))
            row.append(rest / rows[j][j])
        row.append(sqrt(row_of(P, n, i)[i] - sum(a * a for a in row)))
        rows.append(row)
    return rows
