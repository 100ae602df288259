"""Programs of eight: what plain Python does with one number, done with eight; and what it may not do."""

import inspect
import math
import operator
import re
import traceback
from pathlib import Path

import numpy as np
import pytest

from radarsim.kernels import formula_functions, small_matrices, tracing
from radarsim.kernels.call_graph import source_hash
from radarsim.kernels.compiler import kernel
from radarsim.kernels.lane_programs import emit_program
from radarsim.kernels.lanes import WIDTH, address, row, rows
from radarsim.kernels.tracing import NeedsOneValue, Trace, where
from tests.tolerances import absolute_product, assert_rounded, rounding, units_off


def in_lanes(function, *columns):
    """A function of numbers run by lanes over columns (n,) of a multiple of eight numbers; its results, columns too."""
    trace = Trace()
    found = function(*trace.rows(0, (0.0,) * len(columns)))
    wide = isinstance(found, tuple)
    trace.write(1, found)
    many, results = columns[0].size // WIDTH, tracing.count_numbers(found)
    run = emit_program(trace.program())
    inputs = len(columns)

    @kernel
    def calculate(x, out, many):
        for n in range(many):
            run((row(address(x), n * inputs), row(address(out), n * results)))

    x, out = rows(many * inputs), rows(many * results)
    x.reshape(many, inputs, WIDTH)[:] = np.moveaxis(np.reshape(columns, (inputs, many, WIDTH)), 0, 1)
    calculate(x, out, many)
    made = np.moveaxis(out.reshape(many, results, WIDTH), 1, 0).reshape(results, -1)
    return made if wide else made[0]


RNG = np.random.default_rng(7)
SMALL = RNG.normal(size=8000)
WIDE = np.concatenate([RNG.uniform(-1e5, 1e5, 8000), np.arange(-4000, 4000) * (math.pi / 4)])
LARGE = np.exp(RNG.uniform(-600, 600, 8000))


# NumPy's own functions of float64 are off by up to four units, by the processor that computes them.
EXTENDED = pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision to compare with")


def precise(x):
    return x.astype(np.longdouble)


@EXTENDED
def test_functions_are_those_of_the_library():
    """To the units that each states."""
    assert units_off(in_lanes(formula_functions.exp, 100 * SMALL), np.exp(precise(100 * SMALL))) < 3
    near_one = np.concatenate([LARGE, 1 + 1e-3 * SMALL])
    assert units_off(in_lanes(formula_functions.log, near_one), np.log(precise(near_one))) < 3
    assert np.array_equal(in_lanes(tracing.sqrt, LARGE), np.sqrt(LARGE))
    sine, cosine = in_lanes(formula_functions.sine_cosine, WIDE)
    # Without fused multiply-adds four operations on numbers up to 1 round by half a unit, 2⁻⁵⁴, each.
    assert np.max(np.abs(sine - np.sin(precise(WIDE)))) < rounding()
    assert np.max(np.abs(cosine - np.cos(precise(WIDE)))) < rounding()
    assert np.array_equal(in_lanes(tracing.nearest, WIDE), np.rint(WIDE))


@EXTENDED
def test_angles_are_those_of_the_library():
    turns = np.concatenate([RNG.uniform(-math.pi, math.pi, 8000), np.arange(-8, 8) * (math.pi / 8)])
    size = np.exp(RNG.uniform(-100, 100, turns.size))
    x, y = size * np.cos(turns), size * np.sin(turns)
    assert units_off(in_lanes(formula_functions.atan2, y, x), np.arctan2(precise(y), precise(x))) < 3
    assert formula_functions.atan2(-0.0, -1.0) == math.pi  # zero has no sign
    assert formula_functions.atan2(0.0, -0.0) == 0.0
    zero = np.zeros(8)
    edges = in_lanes(formula_functions.atan2, np.r_[0.0, 0, 1, -1, 0, 2, -2, 2], np.r_[1.0, -1, 0, 0, 0, 2, 2, -2])
    wanted = np.r_[0, math.pi, math.pi / 2, -math.pi / 2, 0, math.pi / 4, -math.pi / 4, 0.75 * math.pi]
    assert units_off(edges, precise(wanted)) < 3
    assert np.array_equal(in_lanes(formula_functions.wrap_angle, zero + 0.5), zero + 0.5)
    assert_rounded(in_lanes(formula_functions.wrap_angle, zero + 7), zero + 7 - math.tau, size=7)


def branching(x, y):
    """Whatever a step may do, one text for floats and lanes."""
    pair = where((x > 0.0) & ~(y > 1.0), (x, -y), (y, 1))
    inside = where((x >= -1.0) | (y != x), abs(x) ** 3, 2.0)
    return (*pair, inside, tracing.minimum(x, y), tracing.maximum(x, 0), 3 / (2 + x * x) - (+y))


def test_branches_are_taken_lane_by_lane():
    x, y = SMALL, RNG.normal(size=SMALL.size)
    wanted = np.transpose([branching(float(a), float(b)) for a, b in zip(x, y, strict=True)])
    # The last of them is a difference, of 3/2 and y at most; cubes are two products.
    assert_rounded(in_lanes(branching, x, y), wanted, size=np.abs(wanted) + 1.5 + np.abs(y), operations=4)


def joined(x, y):
    """Comparisons joined, with truth values too, and as numbers."""
    neither = where(~(x > 0.0) & ~(y > 0.0), 1.0, 0.0)
    either = where(~(x > 0.0) | ~(y > 0.0), 1.0, 0.0)
    by_key = where((x > 0.0) & True, 1.0, 0.0), where(False | ~(x > 0.0), 1.0, 0.0), where(False & (x > y), 1.0, 0.0)
    counted = (x > 0.0) * y + sum([x > 0.0, y > 0.0]) - (x > y) ** 2, abs(-(x > 0.0))
    return neither, either, *by_key, *counted, where((x > 0.0) == (y > 0.0), x, y)


def test_comparisons_are_joined_and_counted_as_in_python():
    x, y = SMALL, RNG.normal(size=SMALL.size)
    wanted = np.transpose([joined(float(a), float(b)) for a, b in zip(x, y, strict=True)])
    np.testing.assert_array_equal(in_lanes(joined, x, y), wanted)
    assert set(np.unique(wanted[:5])) == {0, 1}
    np.testing.assert_array_equal(wanted[0], (x <= 0) & (y <= 0))
    for number in (Trace().rows(0, 0.0), 1, 2.0):
        with pytest.raises(tracing.UnsupportedFormula, match="join comparisons, got"):
            (Trace().rows(0, 0.0) > 0.0) & number


@pytest.mark.parametrize("n", [2, 4])
def test_small_matrices_are_those_of_the_textbook(n):
    A = RNG.normal(size=(n, n))
    P, J, h, x = A @ A.T + np.eye(n), RNG.normal(size=(n, n)), RNG.normal(size=n), RNG.normal(size=n)
    upper = np.triu_indices(n)

    def unpacked(packed):
        return np.array([small_matrices.row_of(packed, n, i) for i in range(n)])

    packed = tuple(P[upper])
    assert_rounded(
        unpacked(small_matrices.congruence(J, packed)), J @ P @ J.T, absolute_product(J, P, J.T), operations=2 * n
    )
    assert_rounded(
        small_matrices.normalised_square(packed, tuple(x)),
        x @ np.linalg.solve(P, x),
        condition=np.linalg.cond(P),
        operations=n**2,
    )
    K = P @ h / (h @ P @ h + 0.3)
    mean, shrunk = small_matrices.update(tuple(x), packed, tuple(h), 1.7, 0.3)
    S = absolute_product(h, P, h) + 0.3
    cancelled = S / (h @ P @ h + 0.3)  # S is a sum whose terms have signs, and K is divided by it
    size = absolute_product(P, h) * cancelled / (h @ P @ h + 0.3)
    assert_rounded(mean, x + 1.7 * K, np.abs(x) + 1.7 * size, operations=3 * n)
    assert_rounded(
        unpacked(shrunk), P - np.outer(K, h @ P), np.abs(P) + np.outer(size, absolute_product(h, P)), operations=3 * n
    )


def branches_by_python(x):
    if x > 0.0:  # the line that is meant
        return x
    return -x


@pytest.mark.parametrize(
    "function",
    [
        branches_by_python,
        lambda x: max(x, 1.0),
        lambda x: 0.0 < x < 1.0,
        lambda x: math.sin(x),
        lambda x: x % 2.0,
        lambda x: x**0.5,
        lambda x: not x,
    ],
)
def test_what_needs_one_value_is_refused_with_its_line(function):
    with pytest.raises(NeedsOneValue) as caught:
        function(Trace().rows(0, 0.0))
    frames = traceback.extract_tb(caught.value.__traceback__)
    own = [frame for frame in frames if frame.filename == __file__][-1]
    assert own.lineno == function.__code__.co_firstlineno + (function is branches_by_python)


def test_a_kernel_is_kept_by_what_its_programs_do():
    def kernel_of(function):
        trace = Trace()
        trace.write(1, function(trace.rows(0, 0.0)))
        run = emit_program(trace.program())
        return lambda x, out: run((address(x), address(out)))

    kept = [source_hash(kernel_of(one)) for one in (lambda x: x * 2.0, lambda y: y * 2, lambda x: x * 3.0)]
    assert kept[0] == kept[1] != kept[2]


def test_a_number_of_numpy_leaves_arithmetic_to_the_lane():
    assert isinstance(np.float64(2.0) * Trace().rows(0, 0.0), tracing.Lane)


def test_what_is_done_twice_stands_once_and_words_change_no_program():
    def made(function):
        trace = Trace()
        trace.write(1, function(trace.rows(0, 0.0)))
        return trace.program()

    program = made(lambda x: (x + 1.0) * (x + 1.0))
    assert len(program.ops) == 4
    assert program.digest == made(lambda y: (y + 1) * (y + 1)).digest
    assert program.digest != made(lambda x: (x + 1.0) * (x + 1.0000001)).digest


# ---- what authors may use, as the how-to has it ----
PAGE = (Path(__file__).parents[2] / "docs/howto/own_study.md").read_text(encoding="utf-8")
INNER = {
    "plain",  # of the program
    *("case_value", "count_numbers", "eliminate", "is_number", "leaves"),
    *("map_numbers", "power_of_two", "with_float_numbers"),
}


OPERATORS = {
    **{"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv},
    **{"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne},
}


def test_the_page_lists_every_function_of_numbers_with_its_docstring():
    wanted, names = {}, set()
    for module in (tracing, formula_functions, small_matrices):
        functions = {name for name in vars(module) if inspect.isfunction(vars(module)[name]) and name[0] != "_"}
        names |= functions
        for name in functions - INNER:
            function = getattr(module, name)
            if function.__module__ == module.__name__:
                text = " ".join(str(function.__doc__).split("\n\n")[0].split())
                wanted[name] = f"({', '.join(inspect.signature(function).parameters)})` | {text}"
    rows = re.findall(r"^\| `(\w+)(\(.*\)` \| .*) \|$", PAGE, re.MULTILINE)
    assert {name: row for name, row in rows if name in names} == wanted


def test_the_operations_that_the_page_names_are_those_that_lanes_have():
    (line,) = [one for one in PAGE.splitlines() if one.startswith("On numbers of a realisation work ")]
    named = set(" ".join(re.findall("`([^`]+)`", line)).split())
    assert named - {"n"} == {*OPERATORS, "abs", "**", "&", "|", "~"}
    x, y = Trace().rows(0, (0.0, 0.0))
    assert all(isinstance(one(x, y), tracing.Lane) for one in OPERATORS.values())
    assert isinstance((x > y) & (x < y) | ~(x == y), tracing.Mask)
    assert isinstance(abs(x) ** 2, tracing.Lane)
    for other in (operator.mod, operator.floordiv, operator.matmul, operator.lshift):
        with pytest.raises(TypeError):
            other(x, y)
