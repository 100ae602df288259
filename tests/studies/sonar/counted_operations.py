"""The operations of P3's filters in a scan, counted by running their formulas on numbers that count.

The formulas are the paper's, for one coordinate, degree 1 and one plot, with no intermediate result computed twice.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass
class Tally:
    """The operations counted so far."""

    products: int = 0
    sums: int = 0

    @property
    def total(self) -> int:
        """All operations."""
        return self.products + self.sums


class Number:
    """A number that counts its operations; a division counts as a product, and zeros count like any other number."""

    def __init__(self, value: float, tally: Tally):
        self.value, self.tally = value, tally

    def _sum(self, value: float) -> "Number":
        self.tally.sums += 1
        return Number(value, self.tally)

    def _product(self, value: float) -> "Number":
        self.tally.products += 1
        return Number(value, self.tally)

    def __add__(self, other: "Number") -> "Number":
        return self._sum(self.value + other.value)

    def __sub__(self, other: "Number") -> "Number":
        return self._sum(self.value - other.value)

    def __mul__(self, other: "Number") -> "Number":
        return self._product(self.value * other.value)

    def __truediv__(self, other: "Number") -> "Number":
        return self._product(self.value / other.value)


Matrix = Sequence[Sequence[Number]]


def line_step(
    memory: Sequence[Number], estimate: Sequence[Number], u: Number, w: Number, step: Number
) -> tuple[Sequence[Number], Sequence[Number]]:
    """One scan of (12)-(14): memory (f, g, h, K), estimate (r, v), plot u, weight w, interval `step`, unit period."""
    f, g, h, K = memory
    r, v = estimate
    f_step = f * step
    h = h + (g + g + f_step) * step
    g = g + f_step
    f, K = f + w, K + w * h
    per = w / K
    r = r + v * step
    residual = u - r
    return (f, g, h, K), (r + h * per * residual, v + g * per * residual)


def batch(times: Sequence[Number], plots: Sequence[Number], weights: Sequence[Number]) -> tuple[Number, Number]:
    """Weighted least squares (2) on all plots: five sums and Cramer's rule; the estimate at the last time."""
    zero = plots[0] - plots[0]
    s0 = s1 = s2 = b0 = b1 = zero
    for t, u, w in zip(times, plots, weights, strict=True):
        wt = w * t
        s0, s1, s2 = s0 + w, s1 + wt, s2 + wt * t
        b0, b1 = b0 + w * u, b1 + wt * u
    determinant = s0 * s2 - s1 * s1
    r, v = (s2 * b0 - s1 * b1) / determinant, (s0 * b1 - s1 * b0) / determinant
    return r + v * times[-1], v


def product(A: Matrix, B: Matrix) -> list[list[Number]]:
    """Matrix product of lists of rows."""
    return [[_dot(row, column) for column in zip(*B, strict=True)] for row in A]


def _dot(row: Sequence[Number], column: Sequence[Number]) -> Number:
    total = row[0] * column[0]
    for a, b in zip(row[1:], column[1:], strict=True):
        total = total + a * b
    return total


def kalman_step(
    F: Matrix, H: Matrix, Q: Matrix | None, R: Number | None, x: Matrix, P: Matrix, u: Number
) -> tuple[Matrix, Matrix]:
    """One scan of (11) in matrices, one plot: F and P (s, s), H (1, s), Q (s, s), R a number, x (s, 1), u the plot."""
    size = len(x)
    x = product(F, x)
    P = product(product(F, P), list(zip(*F, strict=True)))
    if Q is not None:
        P = [[p + q for p, q in zip(row, more, strict=True)] for row, more in zip(P, Q, strict=True)]
    column = product(P, [[element] for element in H[0]])
    S = product(H, column)[0][0]
    if R is not None:
        S = S + R
    K = [[row[0] / S] for row in column]
    residual = u - product(H, x)[0][0]
    x = [[row[0] + gain[0] * residual] for row, gain in zip(x, K, strict=True)]
    P = [[P[i][j] - K[i][0] * column[j][0] for j in range(size)] for i in range(size)]
    return x, P


def recursion() -> Tally:
    """A scan of the recursion (12)-(14), for any number of plots."""
    tally = Tally()
    one = Number(1.0, tally)
    line_step((one,) * 4, (one, one), one, one, one)
    return tally


def batch_of(n: int) -> Tally:
    """Least squares on n plots from scratch."""
    tally = Tally()
    row = [Number(float(i + 1), tally) for i in range(n)]
    batch(row, row, row)
    return tally


def kalman_of(size: int, noise: bool = False, measured: bool = True) -> Tally:
    """A scan of (11) with a state of this size; noise: Q is added; measured: R is added."""
    tally = Tally()
    one = Number(1.0, tally)
    square = [[Number(float(i == j) + 0.5, tally) for j in range(size)] for i in range(size)]
    H = [[one] * size]
    kalman_step(square, H, square if noise else None, one if measured else None, [[one]] * size, square, one)
    return tally


def augmented() -> Tally:
    """A scan of the augmented filter: line and error, three states, exact plots, new noise in the error."""
    return kalman_of(3, noise=True, measured=False)


def differenced() -> Tally:
    """A scan of the differenced filter: two states, and the difference u - ρ u' that is formed in advance."""
    tally = kalman_of(2)
    one = Number(1.0, tally)
    _ = one - one * one
    return tally
