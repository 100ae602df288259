"""Formulas of one realisation that become a kernel of eight: plain Python, run once on numbers that record it.

A function that adds, multiplies and calls what is here (`sqrt`, `sin`, `where`, …) works on floats as it stands. Run
on a `Lane` in place of a float it leaves in a `Trace` the operations that it made, in order; `radarsim.kernels.lanes`
translates these into instructions on eight realisations at once. So whatever Python does with whole structures may be
used: helper functions, loops over tuples, named records. What depends on a number of a realisation may not: it has
eight values. An `if` on one raises `OneForAll`, and the innermost line of the traceback is the author's.

This module loads no compiler."""

import functools
import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np


class Unfit(TypeError):
    """An operation that no formula of a realisation may contain; the message is for the author of the formula."""

    for_the_author = True


class OneForAll(Unfit):
    """Python needs a single value where there are eight."""


class Lane:
    """A number of each of eight realisations, as the index of an operation in a trace."""

    __array_ufunc__ = None  # NumPy's numbers leave arithmetic to the methods here
    __hash__ = None  # type: ignore[assignment]
    __slots__ = ("index", "trace")

    def __init__(self, trace: "Trace", index: int):
        self.trace, self.index = trace, index

    def __neg__(self):
        return 0.0 - self

    def __pos__(self):
        return self

    def __abs__(self):
        return where(self > 0.0, self, -self)

    def __pow__(self, power):
        if isinstance(power, int) and power > 0:
            return functools.reduce(lambda done, _: done * self, range(power - 1), self)
        raise OneForAll(f"** {power!r} of a number of a realisation: a whole power from 1 on, or exp and log")

    def _refuse(self, *_: Any) -> Any:
        raise OneForAll(
            "a number that each realisation has its own of has no one value: write where(condition, yes, no) in place "
            "of if, and, or, not, min, max, and the functions of radarsim.kernels.traced in place of those of math"
        )

    __bool__ = __float__ = __int__ = __index__ = __iter__ = __round__ = __floor__ = __ceil__ = _refuse
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __rpow__ = _refuse


class Mask(Lane):
    """The result of comparing lanes: true or false, lane by lane. `&`, `|` and `~` combine masks and truth values.

    In arithmetic it is 1 where it is true, else 0, as in Python."""

    __hash__ = None  # type: ignore[assignment]
    __slots__ = ()

    def __and__(self, other):
        return self.trace.put("and", self, other)

    def __or__(self, other):
        return self.trace.put("or", self, other)

    def __invert__(self):
        return self.trace.put("not", self)

    __rand__, __ror__ = __and__, __or__


ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "truediv": "fdiv"}
COMPARED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}


def _method(op: str, turned: bool = False) -> Callable:
    def method(self, other):
        if not isinstance(other, Lane | int | float | np.number):
            return NotImplemented
        return self.trace.put(op, *((other, self) if turned else (self, other)))

    return method


for _name, _op in ARITHMETIC.items():
    setattr(Lane, f"__{_name}__", _method(_op))
    setattr(Lane, f"__r{_name}__", _method(_op, turned=True))
for _name, _op in COMPARED.items():
    setattr(Lane, f"__{_name}__", _method(_op))


@dataclass(frozen=True)
class Program:
    """Operations on eight realisations, in order, each on the results of earlier ones by their numbers.

    ("number", x), ("row", array, r) and ("plain", array, r) begin: a constant, row r of lanes of an array, and its
    plain number r in all lanes. outputs are (array, row, number of the operation); sums are the operations whose
    results are added up over all eights."""

    ops: tuple[tuple, ...]
    outputs: tuple[tuple[int, int, int], ...]
    sums: tuple[int, ...] = ()

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of the operations: an edit that changes none of them leaves compiled kernels valid."""
        return hashlib.sha256(repr((self.ops, self.outputs, self.sums)).encode()).hexdigest()


class Trace:
    """The operations that a function applies to lanes, in order; a repeated operation is recorded once.

    The compiler assumes that all numbers are finite, and makes anything of others: a formula that gives one is Unfit.
    """

    def __init__(self) -> None:
        self._indices: dict[tuple, int] = {}
        self.outputs: list[tuple[int, int, int]] = []
        self.sums: list[int] = []
        self.constants: dict[int, float] = {}  # the values of operations that are the same in every case
        self.case_values: dict[int, float] = {}  # these, and those that follow from the keys of this case

    def put(self, op: str, *operands: Any) -> Lane:
        """An operation on lanes and numbers. Raises Unfit where it can give no number."""
        if op in ("and", "or", "not"):
            indices = tuple(map(self.holds, operands))
        elif op == "where":
            indices = operands[0].index, *map(self.place, operands[1:])
        else:
            indices = tuple(map(self.place, operands))
        if op in ("==", "!=") and indices[0] == indices[1]:
            raise Unfit("a test for NaN cannot be made; test what would make it, e.g. where(z >= 0, …)")
        value = _value(op, indices, self.constants)
        in_this_case = value if value is not None else _value(op, indices, self.case_values)
        if value is not None and not math.isfinite(value):
            raise Unfit(f"gives {value:g} in every realisation: it divides by zero, or goes beyond all numbers")
        index = self._index(op, *indices)
        if value is not None:
            self.constants[index] = value
        if in_this_case is not None:
            self.case_values[index] = in_this_case
        return (Mask if op in COMPARED.values() or op in ("and", "or", "not") else Lane)(self, index)

    def place(self, value: Any) -> int:
        """The number of the operation that a lane comes from, or that of a constant. Raises Unfit where it is none."""
        if isinstance(value, Mask):
            return self.put("where", value, 1.0, 0.0).index
        if isinstance(value, Lane):
            return value.index
        number = float(value)
        if not math.isfinite(number):
            raise Unfit(f"{number} is not finite, and no number to calculate with")
        index = self._index("number", number)
        self.constants[index] = self.case_values[index] = number
        return index

    def holds(self, value: Any) -> int:
        """The number of the operation that a mask comes from, or that of a truth value. Raises Unfit of others."""
        if isinstance(value, bool | np.bool_):
            value = self.put("<", 0.0, float(value))
        if not isinstance(value, Mask):
            raise Unfit(f"& and | join comparisons, got {'a number' if isinstance(value, Lane) else repr(value)[:40]}")
        return value.index

    def _index(self, *operation: Any) -> int:
        return self._indices.setdefault(operation, len(self._indices))

    def rows(self, array: int, like: Any, first: int = 0) -> Any:
        """A structure like another, whose numbers stand in the rows of an array from `first` on."""
        places = iter(range(first, first + count(like)))
        return mapped(lambda _: Lane(self, self._index("row", array, next(places))), like)

    def plain(self, array: int, like: Any, stated: bool = False) -> Any:
        """A structure like another, whose numbers stand in an array, the same for all realisations.

        stated: those of the other are the numbers of this case."""
        places = iter(range(count(like)))

        def lane(number: Any) -> Lane:
            index = self._index("plain", array, next(places))
            if stated:
                self.case_values[index] = float(number)
            return Lane(self, index)

        return mapped(lane, like)

    def write(self, array: int, value: Any, first: int = 0) -> None:
        """Write the numbers of a structure into the rows of an array, from `first` on."""
        for row, number in enumerate(leaves(value), first):
            self.outputs.append((array, row, self.place(number)))

    def add(self, value: Any) -> None:
        """Add the numbers of a structure to the sums."""
        self.sums += map(self.place, leaves(value))

    def program(self) -> Program:
        """The recorded operations as a program."""
        return Program(tuple(self._indices), tuple(self.outputs), tuple(self.sums))


CALCULATED: dict[str, Callable] = {
    **{instruction: getattr(np, {"truediv": "true_divide", "sub": "subtract", "mul": "multiply"}.get(op, op))
       for op, instruction in ARITHMETIC.items()},
    "sqrt": np.sqrt,
}  # fmt: skip


def _value(op: str, indices: tuple[int, ...], values_by_index: dict[int, float]) -> float | None:
    """The value of an operation if it follows from the known values of its operands, else None."""
    values = [values_by_index.get(index) for index in indices]
    if op == "fsub" and indices[0] == indices[1]:
        return 0.0
    if op == "fdiv" and values[1] == 0:
        return math.nan
    if (op == "fmul" and 0 in values) or (op == "fdiv" and values[0] == 0):
        return 0.0
    if op not in CALCULATED or None in values:
        return None
    with np.errstate(all="ignore"):
        return float(CALCULATED[op](*values))


def stated(x: Any) -> float | None:
    """The value of a number if it is known and the same in all realisations of a case, else None."""
    if isinstance(x, Lane):
        return x.trace.case_values.get(x.index)
    return float(x) if isinstance(x, int | float) else None


# ---- structures: tuples and named records of numbers; text, None, truth values and whole numbers are none --------
def mapped(function: Callable, *values: Any) -> Any:
    """Apply a function to the numbers of structures of the same shape, place by place."""
    first = values[0]
    if isinstance(first, tuple):
        parts = [mapped(function, *each) for each in zip(*values, strict=True)]
        return type(first)(*parts) if hasattr(first, "_fields") else tuple(parts)
    return function(*values) if is_number(first) else first


def is_number(value: Any) -> bool:
    """Whether a value of a structure is a number of a realisation: a whole number is not, nor a truth value."""
    return isinstance(value, Lane | float | np.floating)


def leaves(value: Any) -> Iterator[Any]:
    """The numbers of a structure, from left to right."""
    if isinstance(value, tuple):
        for part in value:
            yield from leaves(part)
    elif is_number(value):
        yield value


def count(value: Any) -> int:
    """How many numbers a structure has."""
    return sum(1 for _ in leaves(value))


# ---- functions of numbers: floats, arrays of NumPy, lanes --------
def where(condition: Any, yes: Any, no: Any) -> Any:
    """yes where a condition holds, else no: numbers, or tuples and records of one shape, place by place."""
    if isinstance(yes, tuple):
        return mapped(lambda *pair: where(condition, *pair), numbered(yes), numbered(no))
    if isinstance(condition, Mask):
        return condition.trace.put("where", condition, yes, no)
    if isinstance(condition, int) and condition < 0:
        condition &= 1  # ~True is -2 in Python, ~False -1; joined by & and | with others the last bit says it still
    return np.where(condition, yes, no) if isinstance(condition, np.ndarray) else yes if condition else no


def numbered(value: Any) -> Any:
    """A structure with its whole numbers as floats, so that they count as numbers of a realisation."""
    if isinstance(value, tuple):
        parts = [numbered(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def least(x: Any, y: Any) -> Any:
    """The lesser of two numbers."""
    return where(x < y, x, y)


def greatest(x: Any, y: Any) -> Any:
    """The greater of two numbers."""
    return where(x > y, x, y)


def _recorded(op: str, x: Any, library: Callable) -> Any:
    return x.trace.put(op, x) if isinstance(x, Lane) else library(x)


def sqrt(x: Any) -> Any:
    """The square root."""
    return _recorded("sqrt", x, np.sqrt)


def nearest(x: Any) -> Any:
    """The nearest whole number, ties to even."""
    return _recorded("nearest", x, np.rint)


def power_of_two(x: Any) -> Any:
    """2**x for whole numbers x from -1022 to 1023."""
    return _recorded("power_of_two", x, lambda n: np.ldexp(1.0, np.asarray(n).astype(int)))


def exp(x: Any) -> Any:
    """exp x for x from -700 to 700; of lanes to 3 units in the last place, below -700 as at -700."""
    if not isinstance(x, Lane):
        return np.exp(x)
    from radarsim.kernels.lanes import exponential

    return exponential(x)


def log(x: Any) -> Any:
    """Natural logarithm of a positive normal number; of lanes to 3 units in the last place."""
    if not isinstance(x, Lane):
        return np.log(x)
    from radarsim.kernels.random import log_series

    return log_series(x.trace.put("mantissa", x), x.trace.put("exponent", x))


HALF_PI = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21)  # of 33 bits each, the rest


def sine_cosine(x: Any) -> tuple[Any, Any]:
    """sin x and cos x; of lanes for x from -10⁵ to 10⁵, to 2·10⁻¹⁶ of 1."""
    if not isinstance(x, Lane):
        return np.sin(x), np.cos(x)
    from radarsim.kernels.random import sine_cosine_polynomial

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
        return np.arctan2(y + 0.0, x + 0.0)  # -0.0 is 0.0, as of lanes
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


def wrapped(angle: Any) -> Any:
    """An angle less whole turns, from -π to π."""
    return angle - nearest(angle * (1 / math.tau)) * math.tau


# ---- small matrices: rows as tuples; a symmetric one packed row by row from its diagonal on --------
def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Scalar product of two rows."""
    return functools.reduce(lambda done, pair: done + pair[0] * pair[1], zip(a[1:], b[1:], strict=True), a[0] * b[0])


def row_of(P: Sequence[Any], n: int, i: int) -> tuple[Any, ...]:
    """Row i of a packed symmetric matrix of n rows."""
    return tuple(P[min(i, j) * n - min(i, j) * (min(i, j) + 1) // 2 + max(i, j)] for j in range(n))


def times(P: Sequence[Any], h: Sequence[Any]) -> tuple[Any, ...]:
    """P h of a packed symmetric P."""
    return tuple(dot(row_of(P, len(h), i), h) for i in range(len(h)))


def congruent(J: Sequence[Sequence[Any]], P: Sequence[Any]) -> tuple[Any, ...]:
    """J P J', packed, of a packed P and the rows of J."""
    moved = [times(P, row) for row in J]
    return tuple(dot(J[i], moved[j]) for i in range(len(J)) for j in range(i, len(J)))


def updated(x: Sequence[Any], P: Sequence[Any], h: Sequence[Any], e: Any, R: Any) -> tuple[tuple, tuple]:
    """A state and its packed covariance after a number with row h, innovation e and an error of variance R."""
    variance = stated(R)
    if variance is not None and variance <= 0:
        raise Unfit(f"updated: R, the variance of the error of a number, must be positive, got {variance:g}")
    g = times(P, h)
    S = dot(h, g) + R
    n = len(x)
    shrunk = [row_of(P, n, i)[j] - g[i] * g[j] / S for i in range(n) for j in range(i, n)]
    return tuple(a + b / S * e for a, b in zip(x, g, strict=True)), tuple(shrunk)


def normalised(P: Sequence[Any], e: Sequence[Any]) -> Any:
    """e' P⁻¹ e of a positive packed P."""
    return elimination(P, e)[0]


def elimination(P: Sequence[Any], e: Sequence[Any]) -> tuple[Any, Any]:
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
    return functools.reduce(lambda a, b: a + b, sums), functools.reduce(least, pivots)
