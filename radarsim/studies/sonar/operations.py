"""How many operations a scan of P3's filters takes: their formulas run on numbers that count.

The paper's formulas for one coordinate and degree 1, written out for one plot; nothing is reckoned twice. Claims on
cost are judged by these counts, never by a clock.
"""

from dataclasses import dataclass


@dataclass
class Tally:
    """What was counted."""

    products: int = 0
    sums: int = 0

    @property
    def total(self) -> int:
        """All operations."""
        return self.products + self.sums


class Number:
    """A number that counts what is done with it; a division counts as a product, a zero costs like any other number."""

    def __init__(self, value: float, tally: Tally):
        self.value, self.tally = value, tally

    def _done(self, value: float, kind: str) -> "Number":
        setattr(self.tally, kind, getattr(self.tally, kind) + 1)
        return Number(value, self.tally)

    def __add__(self, other):
        return self._done(self.value + other.value, "sums")

    def __sub__(self, other):
        return self._done(self.value - other.value, "sums")

    def __mul__(self, other):
        return self._done(self.value * other.value, "products")

    def __truediv__(self, other):
        return self._done(self.value / other.value, "products")


def line_step(memory, estimate, u, w, step):
    """One scan of (12)-(14): memory (f, g, h, K), estimate (r, v), plot u, weight w, interval `step`, unit period."""
    f, g, h, K = memory
    r, v = estimate
    way = f * step
    h = h + (g + g + way) * step
    g = g + way
    f, K = f + w, K + w * h
    per = w / K
    r = r + v * step
    residual = u - r
    return (f, g, h, K), (r + h * per * residual, v + g * per * residual)


def batch(times, plots, weights):
    """Weighted least squares (2) on all plots anew: five sums and Cramer's rule; the estimate at the last time."""
    zero = plots[0] - plots[0]
    s0 = s1 = s2 = b0 = b1 = zero
    for t, u, w in zip(times, plots, weights, strict=True):
        wt = w * t
        s0, s1, s2 = s0 + w, s1 + wt, s2 + wt * t
        b0, b1 = b0 + w * u, b1 + wt * u
    determinant = s0 * s2 - s1 * s1
    r, v = (s2 * b0 - s1 * b1) / determinant, (s0 * b1 - s1 * b0) / determinant
    return r + v * times[-1], v


def product(A, B):
    """Matrix product of lists of rows."""
    out = []
    for row in A:
        line = []
        for j in range(len(B[0])):
            total = row[0] * B[0][j]
            for a, b in zip(row[1:], B[1:], strict=True):
                total = total + a * b[j]
            line.append(total)
        out.append(line)
    return out


def kalman_step(F, H, Q, R, x, P, u):
    """One scan of (11) in matrices, one plot: F and P (s, s), H (1, s), Q (s, s), R a number, x (s, 1), u the plot."""
    size = len(x)
    x = product(F, x)
    P = product(product(F, P), [list(column) for column in zip(*F, strict=True)])
    if Q is not None:
        P = [[p + q for p, q in zip(row, more, strict=True)] for row, more in zip(P, Q, strict=True)]
    column = product(P, [[H[0][j]] for j in range(size)])
    S = product(H, column)[0][0]
    if R is not None:
        S = S + R
    K = [[row[0] / S] for row in column]
    residual = u - product(H, x)[0][0]
    x = [[row[0] + gain[0] * residual] for row, gain in zip(x, K, strict=True)]
    P = [[P[i][j] - K[i][0] * column[j][0] for j in range(size)] for i in range(size)]
    return x, P


def recursion() -> Tally:
    """A scan of the recursion (12)-(14), whatever the number of plots."""
    tally = Tally()
    one = Number(1.0, tally)
    line_step((one,) * 4, (one, one), one, one, one)
    return tally


def batch_of(n: int) -> Tally:
    """Least squares on n plots anew."""
    tally = Tally()
    row = [Number(float(i + 1), tally) for i in range(n)]
    batch(row, row, row)
    return tally


def kalman_of(size: int) -> Tally:
    """A scan of (11) with a state of that size and white errors."""
    return _kalman(size, noise=False, measured=True)


def augmented() -> Tally:
    """A scan of the augmented filter: line and error, three states, exact plots, new noise in the error."""
    return _kalman(3, noise=True, measured=False)


def differenced() -> Tally:
    """A scan of the differenced filter: two states, and the difference u - ρ u' to be made beforehand."""
    tally = _kalman(2, noise=False, measured=True)
    one = Number(1.0, tally)
    _ = one - one * one
    return tally


def _kalman(size: int, noise: bool, measured: bool) -> Tally:
    tally = Tally()
    one = Number(1.0, tally)
    square = [[Number(float(i == j) + 0.5, tally) for j in range(size)] for i in range(size)]
    H = [[one] * size]
    kalman_step(square, H, square if noise else None, one if measured else None, [[one]] * size, square, one)
    return tally
