"""Formulas of one realisation that become a kernel of eight: plain Python, run once on numbers that record it.

A function that adds, multiplies and calls the functions here or in `formula_functions` (`sqrt`, `where`, `sin`, …)
works on floats as it stands. Run on a `Lane` in place of a float it leaves in a `Trace` the operations that it made, in
order; `radarsim.kernels.lane_programs` translates these into instructions on eight realisations at once. So whatever
Python does with whole structures may be used: helper functions, loops over tuples, named records. What depends on a
number of a realisation may not: it has eight values. An `if` on one raises `NeedsOneValue`, and the innermost line of
the traceback is the author's.

This module loads no compiler, and NumPy only when a formula is computed."""

import functools
import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any


class UnsupportedFormula(TypeError):
    """An operation that no formula of a realisation may contain; the message is for the author of the formula."""

    for_the_author = True


class NeedsOneValue(UnsupportedFormula):
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
        raise NeedsOneValue(f"** {power!r} of a number of a realisation: a whole power from 1 on, or exp and log")

    def _refuse(self, *_: Any) -> Any:
        raise NeedsOneValue(
            "a number that each realisation has its own of has no one value: write where(condition, yes, no) in place "
            "of if, and, or, not, min, max, and the functions of radarsim.kernels.formula_functions in place of those "
            "of math"
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
COMPARISONS = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}


def _method(op: str, turned: bool = False) -> Callable:
    def method(self, other):
        if not isinstance(other, Lane | int | float | Real):
            return NotImplemented
        return self.trace.put(op, *((other, self) if turned else (self, other)))

    return method


for _name, _op in ARITHMETIC.items():
    setattr(Lane, f"__{_name}__", _method(_op))
    setattr(Lane, f"__r{_name}__", _method(_op, turned=True))
for _name, _op in COMPARISONS.items():
    setattr(Lane, f"__{_name}__", _method(_op))


@dataclass(frozen=True)
class Program:
    """Operations on eight realisations, in order, each on the results of earlier ones by their numbers.

    ("number", x), ("row", array, r) and ("plain", array, r) begin: a constant, row r of lanes of an array, and its
    plain number r in all lanes. Those of loops are in `radarsim.kernels.lane_loops`. outputs are (array, row, number of
    the operation); sums are the operations whose results are added up over all eights."""

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
        self.ops: list[tuple] = []
        self.indices: dict[tuple, int] = {}  # of those that a formula may use
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
            raise UnsupportedFormula("a test for NaN cannot be made; test what would make it, e.g. where(z >= 0, …)")
        value = _value(op, indices, self.constants)
        in_this_case = value if value is not None else _value(op, indices, self.case_values)
        if value is not None and not math.isfinite(value):
            raise UnsupportedFormula(
                f"gives {value:g} in every realisation: it divides by zero, or goes beyond all numbers"
            )
        index = self.index(op, *indices)
        if value is not None:
            self.constants[index] = value
        if in_this_case is not None:
            self.case_values[index] = in_this_case
        return (Mask if op in COMPARISONS.values() or op in ("and", "or", "not") else Lane)(self, index)

    def place(self, value: Any) -> int:
        """The number of the operation that a lane comes from, or that of a constant. Raises Unfit where it is none."""
        if isinstance(value, Mask):
            return self.put("where", value, 1.0, 0.0).index
        if isinstance(value, Lane):
            return value.index
        number = float(value)
        if not math.isfinite(number):
            raise UnsupportedFormula(f"{number} is not finite, and no number to calculate with")
        index = self.index("number", number)
        self.constants[index] = self.case_values[index] = number
        return index

    def holds(self, value: Any) -> int:
        """The number of the operation that a mask comes from, or that of a truth value. Raises Unfit of others."""
        import numpy as np

        if isinstance(value, bool | np.bool_):
            value = self.put("<", 0.0, float(value))
        if not isinstance(value, Mask):
            raise UnsupportedFormula(
                f"& and | join comparisons, got {'a number' if isinstance(value, Lane) else repr(value)[:40]}"
            )
        return value.index

    def index(self, *operation: Any) -> int:
        """The number of an operation, which is recorded where it is new."""
        index = self.indices.setdefault(operation, len(self.ops))
        if index == len(self.ops):
            self.ops.append(operation)
        return index

    def forget(self, first: int) -> None:
        """Forget the operations from a number on."""
        del self.ops[first:]
        self.indices = {operation: index for operation, index in self.indices.items() if index < first}
        for values in (self.constants, self.case_values):
            for index in [index for index in values if index >= first]:
                del values[index]

    def rows(self, array: int, like: Any, first: int = 0) -> Any:
        """A structure like another, whose numbers stand in the rows of an array from `first` on."""
        places = iter(range(first, first + count_numbers(like)))
        return map_numbers(lambda _: Lane(self, self.index("row", array, next(places))), like)

    def plain(self, array: int, like: Any, stated: bool = False) -> Any:
        """A structure like another, whose numbers stand in an array, the same for all realisations.

        stated: those of the other are the numbers of this case."""
        places = iter(range(count_numbers(like)))

        def lane(number: Any) -> Lane:
            index = self.index("plain", array, next(places))
            if stated:
                self.case_values[index] = float(number)
            return Lane(self, index)

        return map_numbers(lane, like)

    def write(self, array: int, value: Any, first: int = 0) -> None:
        """Write the numbers of a structure into the rows of an array, from `first` on."""
        for row, number in enumerate(leaves(value), first):
            self.outputs.append((array, row, self.place(number)))

    def add(self, value: Any) -> None:
        """Add the numbers of a structure to the sums."""
        self.sums += map(self.place, leaves(value))

    def program(self) -> Program:
        """The recorded operations as a program."""
        return Program(tuple(self.ops), tuple(self.outputs), tuple(self.sums))


FOLDED_OPERATIONS = {"fadd": "add", "fsub": "subtract", "fmul": "multiply", "fdiv": "true_divide", "sqrt": "sqrt"}


def _value(op: str, indices: tuple[int, ...], values_by_index: dict[int, float]) -> float | None:
    """The value of an operation if it follows from the known values of its operands, else None."""
    values = [values_by_index.get(index) for index in indices]
    if op == "fsub" and indices[0] == indices[1]:
        return 0.0
    if op == "fdiv" and values[1] == 0:
        return math.nan
    if (op == "fmul" and 0 in values) or (op == "fdiv" and values[0] == 0):
        return 0.0
    if op not in FOLDED_OPERATIONS or None in values:
        return None
    import numpy as np

    with np.errstate(all="ignore"):
        return float(getattr(np, FOLDED_OPERATIONS[op])(*values))


def case_value(x: Any) -> float | None:
    """The value of a number if it is known and the same in all realisations of a case, else None."""
    if isinstance(x, Lane):
        return x.trace.case_values.get(x.index)
    return float(x) if isinstance(x, int | float) else None


def map_numbers(function: Callable, *values: Any) -> Any:
    """Apply a function to the numbers of structures of the same shape, place by place."""
    first = values[0]
    if isinstance(first, tuple):
        parts = [map_numbers(function, *elements) for elements in zip(*values, strict=True)]
        return type(first)(*parts) if hasattr(first, "_fields") else tuple(parts)
    return function(*values) if is_number(first) else first


def is_number(value: Any) -> bool:
    """Whether a value of a structure is a number of a realisation: a whole number is not, nor a truth value."""
    return isinstance(value, Lane | float) or (isinstance(value, Real) and not isinstance(value, Integral))


def leaves(value: Any) -> Iterator[Any]:
    """The numbers of a structure, from left to right."""
    if isinstance(value, tuple):
        for element in value:
            yield from leaves(element)
    elif is_number(value):
        yield value


def count_numbers(value: Any) -> int:
    """How many numbers a structure has."""
    return sum(1 for _ in leaves(value))


def where(condition: Any, yes: Any, no: Any) -> Any:
    """yes where a condition holds, else no: numbers, or tuples and records of one shape, place by place."""
    if isinstance(yes, tuple):
        return map_numbers(lambda *pair: where(condition, *pair), with_float_numbers(yes), with_float_numbers(no))
    if isinstance(condition, Mask):
        return condition.trace.put("where", condition, yes, no)
    if isinstance(condition, int):
        if condition < 0:
            condition &= 1  # ~True is -2 in Python, ~False -1; joined by & and | with others the last bit says it still
        return yes if condition else no
    import numpy as np

    return np.where(condition, yes, no) if isinstance(condition, np.ndarray) else yes if condition else no


def with_float_numbers(value: Any) -> Any:
    """A structure with its whole numbers as floats, so that they count as numbers of a realisation."""
    if isinstance(value, tuple):
        elements = [with_float_numbers(element) for element in value]
        return type(value)(*elements) if hasattr(value, "_fields") else tuple(elements)
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def minimum(x: Any, y: Any) -> Any:
    """The lesser of two numbers."""
    return where(x < y, x, y)


def maximum(x: Any, y: Any) -> Any:
    """The greater of two numbers."""
    return where(x > y, x, y)


def _record(op: str, x: Any, name: str) -> Any:
    return x.trace.put(op, x) if isinstance(x, Lane) else plain(name, x)


def plain(name: str, *x: Any) -> Any:
    """The value of one of NumPy's functions: of floats a float, whose arithmetic is faster than that of NumPy's."""
    import numpy as np

    value = getattr(np, name)(*x)
    return float(value) if all(isinstance(number, float) for number in x) else value


def sqrt(x: Any) -> Any:
    """The square root."""
    return _record("sqrt", x, "sqrt")


def nearest(x: Any) -> Any:
    """The nearest whole number, ties to even."""
    return _record("nearest", x, "rint")


def power_of_two(x: Any) -> Any:
    """2**x for whole numbers x from -1022 to 1023."""
    if isinstance(x, Lane):
        return x.trace.put("power_of_two", x)
    import numpy as np

    value = np.ldexp(1.0, np.asarray(x).astype(int))
    return float(value) if isinstance(x, float) else value
