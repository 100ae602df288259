"""Recorded formulas (`radarsim.kernels.tracing`) as instructions on eight realisations."""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from radarsim.kernels import tracing
from radarsim.kernels.lanes import (
    INTEGERS,
    ROOT_HALF,
    VECTOR,
    WIDTH,
    broadcast,
    call_llvm,
    constant_lanes,
    lanes,
    lanes_power_of_two,
    members,
    row_pointer,
)


def emit_program(program: tracing.Program):
    """An intrinsic that runs a program on eight realisations: its arrays are given by their addresses, as a tuple."""

    @intrinsic
    def run(typingctx, arrays):
        def generate(context, builder, sig, args):
            _emit_operations(program, builder, members(builder, args[0]))
            return context.get_dummy_value()

        return types.none(arrays), generate

    run.made_of = program.digest  # what a kernel with it in it is kept by
    return run


def emit_sums(program: tracing.Program):
    """The same of a program with sums: to its arrays and a tuple of lanes it gives the tuple with these added."""
    kind = types.UniTuple(lanes, len(program.sums))

    @intrinsic
    def run(typingctx, arrays, sums):
        def generate(context, builder, sig, args):
            results = _emit_operations(program, builder, members(builder, args[0]))
            sums_so_far = members(builder, args[1])
            added = [builder.fadd(a, results[index]) for a, index in zip(sums_so_far, program.sums, strict=True)]
            return context.make_tuple(builder, kind, added)

        return kind(arrays, kind), generate

    run.made_of = program.digest
    return run


def zero_lanes(count: int):
    """An intrinsic that gives a tuple of so many lanes of zero."""
    kind = types.UniTuple(lanes, count)

    @intrinsic
    def none(typingctx):
        nothing = ir.Constant(VECTOR, [0.0] * WIDTH)
        return kind(), lambda context, builder, sig, args: context.make_tuple(builder, kind, [nothing] * count)

    none.made_of = f"zeros {count}"
    return none


def _emit_operations(program, builder, pointers):
    """The results of all operations of a program, whose outputs are written."""
    results = []
    for op, *operands in program.ops:
        if op in ("row", "plain"):
            results.append(_read(builder, op, pointers[operands[0]], operands[1]))
        elif op == "number":
            results.append(ir.Constant(VECTOR, [operands[0]] * WIDTH))
        else:
            results.append(_operation(builder, op, [results[index] for index in operands]))
    for array, number, index in program.outputs:
        builder.store(
            results[index], row_pointer(builder, pointers[array], ir.Constant(ir.IntType(64), number))
        ).align = 8
    return results


def _read(builder, op, pointer, number):
    index = ir.Constant(ir.IntType(64), number)
    if op == "plain":
        return broadcast(builder, builder.load(builder.gep(pointer, [index])))
    value = builder.load(row_pointer(builder, pointer, index))
    value.align = 8
    return value


LLVM_FUNCTIONS = {"sqrt": "llvm.sqrt.v8f64", "nearest": "llvm.rint.v8f64"}


def _operation(builder, op, values):
    if op in tracing.ARITHMETIC.values():
        return getattr(builder, op)(*values)
    if op in tracing.COMPARISONS.values():
        return builder.fcmp_ordered(op, *values)
    if op in LLVM_FUNCTIONS:
        return call_llvm(builder, LLVM_FUNCTIONS[op], *values)
    if op == "where":
        return builder.select(*values)
    if op in ("and", "or"):
        return getattr(builder, f"{op}_")(*values)
    if op == "not":
        return builder.not_(*values)
    if op == "power_of_two":
        return lanes_power_of_two(builder, *values)
    bits = builder.bitcast(values[0], INTEGERS)
    power = builder.ashr(builder.sub(bits, constant_lanes(ROOT_HALF)), constant_lanes(52))
    if op == "exponent":
        return builder.sitofp(power, VECTOR)
    return builder.bitcast(builder.sub(bits, builder.shl(power, constant_lanes(52))), VECTOR)
