"""A number that is eight: compiled code that reads like the textbook and runs eight realisations with one instruction.

`lanes` is a Numba type that stands for LLVM's <8 x double>. `+ - * /` work on it lane by lane, also with plain floats,
so the step of one realisation is the step of eight, with no loop over lanes and no dependence on the vectoriser (which
refuses run-time alias checks in loops of fewer than 16 passes, and so leaves a loop over 8 lanes scalar, four times
slower).

Small matrices are tuples of lanes, passed through functions that are inlined. What lives between steps lies in a flat
float64 array: row r holds the eight lanes of one quantity, at r * WIDTH … r * WIDTH + 7; `rows` makes such an array.
"""

import functools
import inspect
import operator
from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from radarsim.kernels import tracing
from radarsim.kernels.compiler import inline

WIDTH = 8
ROOT_HALF = 0x3FE6A09E667F3BCD  # √½ as its bits: a number is m 2**e with m from there to √2
VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
INTEGERS = ir.VectorType(ir.IntType(64), WIDTH)


class LanesType(types.Type):
    """Eight float64 numbers in one register."""

    def __init__(self):
        super().__init__("lanes")


lanes = LanesType()
OPERANDS = LanesType, types.Float, types.Integer


@register_model(LanesType)
class LanesModel(models.PrimitiveModel):
    """Lanes as a plain LLVM vector."""

    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, VECTOR)


def rows(count: int) -> np.ndarray:
    """Zeros (count * WIDTH,) on a 64-byte boundary, one row a cache line: unaligned rows cost a tenth of the speed."""
    raw = np.zeros(count * WIDTH + WIDTH)
    skip = (-raw.ctypes.data // 8) % WIDTH
    return raw[skip : skip + count * WIDTH]


def broadcast(builder, number):
    """A float in every lane."""
    first = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, ir.Constant(VECTOR, ir.Undefined), everywhere)


def constant_lanes(number):
    """A whole number in every lane."""
    return ir.Constant(INTEGERS, [number] * WIDTH)


def lanes_power_of_two(builder, x):
    """2 to the power of each lane, a whole number, by its bits."""
    exponent = builder.add(builder.fptosi(x, INTEGERS), constant_lanes(1023))
    return builder.bitcast(builder.shl(exponent, constant_lanes(52)), VECTOR)


def call_llvm(builder, name, value):
    """Call a function of LLVM on the lanes."""
    function = builder.module.globals.get(name) or ir.Function(builder.module, ir.FunctionType(VECTOR, [VECTOR]), name)
    return builder.call(function, [value])


def members(builder, pack):
    """The members of an LLVM aggregate."""
    return [builder.extract_value(pack, i) for i in range(len(pack.type.elements))]


def _arithmetic(op, instruction):
    def generate(context, builder, sig, args):
        values = (v if t == lanes else broadcast(builder, v) for v, t in zip(args, sig.args, strict=True))
        return getattr(builder, instruction)(*values)

    for left_type, right_type in ((lanes, lanes), (lanes, types.float64), (types.float64, lanes)):
        lower_builtin(op, left_type, right_type)(generate)

    @type_callable(op)
    def type_operation(context):
        def resolve(left_type, right_type):
            if lanes in (left_type, right_type) and all(isinstance(kind, OPERANDS) for kind in (left_type, right_type)):
                return lanes(*(kind if kind == lanes else types.float64 for kind in (left_type, right_type)))
            return None

        return resolve


for _op, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _arithmetic(_op, _instruction)


class LaneOperation:
    """An operation that kernels apply to lanes; Python calls `plain` in its place, on arrays or single numbers."""

    def __init__(self, plain: Callable, generate: Callable):
        functools.update_wrapper(self, generate)
        self.plain = plain

    def __call__(self, *arguments):
        return self.plain(*arguments)


def lane_operation(plain: Callable, signature):
    """A decorator of what translates an operation of this signature to LLVM."""

    def decorate(generate: Callable) -> LaneOperation:
        operation = LaneOperation(plain, generate)
        lower_builtin(operation, *signature.args)(generate)

        @type_callable(operation)
        def type_operation(context):
            def resolve(*arguments):
                return signature

            resolve.__signature__ = inspect.signature(plain)
            return resolve

        return operation

    return decorate


@lane_operation(lambda x, y, yes, no: tracing.where(x > y, yes, no), lanes(lanes, lanes, lanes, lanes))
def where_greater(context, builder, sig, args):
    """Lane by lane: yes where x > y, else no. Every choice (maximum, minimum, a merging rule) is made of it."""
    return builder.select(builder.fcmp_ordered(">", args[0], args[1]), args[2], args[3])


@intrinsic
def any_greater(typingctx, x, y):
    """True when x > y in at least one lane."""

    def generate(context, builder, sig, args):
        mask = builder.bitcast(builder.fcmp_ordered(">", args[0], args[1]), ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", mask, ir.Constant(mask.type, 0))

    return types.boolean(lanes, lanes), generate


@lane_operation(lambda number: number, lanes(types.float64))
def full(context, builder, sig, args):
    """A number as lanes."""
    return broadcast(builder, args[0])


@lane_operation(tracing.sqrt, lanes(lanes))
def square_root(context, builder, sig, args):
    """Square root, lane by lane."""
    return call_llvm(builder, "llvm.sqrt.v8f64", args[0])


@lane_operation(tracing.nearest, lanes(lanes))
def nearest(context, builder, sig, args):
    """The nearest whole number, ties to even, lane by lane."""
    return call_llvm(builder, "llvm.rint.v8f64", args[0])


@lane_operation(tracing.power_of_two, lanes(lanes))
def power_of_two(context, builder, sig, args):
    """2**x for whole numbers x from -1022 to 1023, written into the exponent."""
    return lanes_power_of_two(builder, args[0])


@intrinsic
def total(typingctx, x):
    """The sum of the eight lanes, halves first: (0+4, 1+5, …), always in the same order."""

    def generate(context, builder, sig, args):
        value, width = args[0], WIDTH
        while width > 1:
            width //= 2
            low, high = (
                builder.shuffle_vector(
                    value,
                    ir.Constant(value.type, ir.Undefined),
                    ir.Constant(ir.VectorType(ir.IntType(32), width), list(range(start, start + width))),
                )
                for start in (0, width)
            )
            value = builder.fadd(low, high)
        return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))

    return types.float64(lanes), generate


@intrinsic
def add_totals(typingctx, pointer, number, a, b, c, d):
    """Add the totals of four to four neighbouring plain numbers, from `number` on; each is summed as by `total`.

    A third of the instructions of four totals: halves are added of two at a time."""

    def generate(context, builder, sig, args):
        def paired(x, y, low, high):
            masks = (ir.Constant(ir.VectorType(ir.IntType(32), 4), places) for places in (low, high))
            return builder.fadd(*(builder.shuffle_vector(x, y, mask) for mask in masks))

        none = ir.Constant(VECTOR, ir.Undefined)
        a, b, c, d = (paired(value, none, [0, 1, 2, 3], [4, 5, 6, 7]) for value in args[2:])
        first, second = (paired(x, y, [0, 1, 4, 5], [2, 3, 6, 7]) for x, y in ((a, b), (c, d)))
        totals = paired(first, second, [0, 2, 4, 6], [1, 3, 5, 7])
        target = builder.bitcast(builder.gep(args[0], [args[1]]), totals.type.as_pointer())
        stored = builder.load(target)
        stored.align = 8
        builder.store(builder.fadd(stored, totals), target).align = 8
        return context.get_dummy_value()

    return types.none(pointer, types.intp, lanes, lanes, lanes, lanes), generate


@intrinsic
def address(typingctx, array):
    """Where a contiguous array begins, for `get`, `put` and plain indexing: the array must outlive every use.

    Passed on to functions instead of the array: Numba counts references to arrays, with locked instructions, at every
    call; that alone took a third of a filter step."""

    def generate(context, builder, sig, args):
        return context.make_array(sig.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), generate


@intrinsic
def row(typingctx, pointer, number):
    """The address of a row, counted from another."""

    def generate(context, builder, sig, args):
        return builder.gep(args[0], [builder.mul(args[1], ir.Constant(args[1].type, WIDTH))])

    return pointer(pointer, types.intp), generate


def row_pointer(builder, pointer, row):
    """The address of a row of lanes."""
    return builder.bitcast(builder.gep(pointer, [builder.mul(row, ir.Constant(row.type, WIDTH))]), VECTOR.as_pointer())


@intrinsic
def get(typingctx, pointer, row):
    """The lanes in one row, counted from the address of a float64 array."""

    def generate(context, builder, sig, args):
        value = builder.load(row_pointer(builder, *args))
        value.align = 8
        return value

    return lanes(pointer, types.intp), generate


@intrinsic
def put(typingctx, pointer, row, value):
    """Write the lanes of one row."""

    def generate(context, builder, sig, args):
        store = builder.store(args[2], row_pointer(builder, *args[:2]))
        store.align = 8
        return context.get_dummy_value()

    return types.none(pointer, types.intp, lanes), generate


@inline
def exponential(x):
    """exp x for x from -700 to 700, to 3 units in the last place; below -700 as at -700. 2**n exp r, with ln 2 in two
    parts (Cody and Waite)."""
    x = where_greater(x, full(-700.0), x, full(-700.0))
    n = nearest(x * 1.4426950408889634)
    r = x - n * 0.693147180369123816 - n * 1.90821492927058770e-10
    return exponential_series(r) * power_of_two(n)


@inline
def exponential_series(r):
    """The Taylor series of exp on |r| <= ln 2 / 2, of numbers or lanes."""
    p = r * (1.0 / 479001600.0) + 1.0 / 39916800.0
    p = p * r + 1.0 / 3628800.0
    p = p * r + 1.0 / 362880.0
    p = p * r + 1.0 / 40320.0
    p = p * r + 1.0 / 5040.0
    p = p * r + 1.0 / 720.0
    p = p * r + 1.0 / 120.0
    p = p * r + 1.0 / 24.0
    p = p * r + 1.0 / 6.0
    p = p * r + 0.5
    p = p * r + 1.0
    return p * r + 1.0
