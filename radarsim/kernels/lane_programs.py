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

COUNT = ir.IntType(64)


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
    results, loops = [], LoopBlocks(builder, pointers)
    for op, *operands in program.ops:
        if op in ("row", "plain"):
            results.append(_read(builder, op, pointers[operands[0]], operands[1]))
        elif op == "number":
            results.append(ir.Constant(VECTOR, [operands[0]] * WIDTH))
        elif op in LoopBlocks.OPERATIONS:
            results.append(getattr(loops, f"emit_{op}")(results, *operands))
        else:
            results.append(_operation(builder, op, [results[index] for index in operands]))
    for array, number, index in program.outputs:
        _write(builder, results[index], pointers[array], ir.Constant(COUNT, number))
    return results


class LoopBlocks:
    """The blocks of the loops of a program (`radarsim.kernels.lane_loops`): a head that tests, a pass, what follows."""

    OPERATIONS = "loop", "carry", "while", "pass_row", "store", "repeat", "result"

    def __init__(self, builder, pointers):
        self.builder, self.pointers = builder, pointers
        self.heads = {}  # by the loop's number: its first block, its pass from 0 on, its carried numbers
        self.open = []  # those that have not ended, and where they go on

    def emit_loop(self, results, *starts):
        before, head = self.builder.block, self.builder.append_basic_block("loop")
        self.builder.branch(head)
        self.builder.position_at_end(head)
        number, carried = self.builder.phi(COUNT), [self.builder.phi(VECTOR) for _ in starts]
        number.add_incoming(ir.Constant(COUNT, 0), before)
        for phi, start in zip(carried, starts, strict=True):
            phi.add_incoming(results[start], before)
        self.heads[len(results)] = head, number, carried
        self.open.append(len(results))

    def emit_carry(self, results, loop, j):
        return self.heads[loop][2][j]

    emit_result = emit_carry

    def emit_while(self, results, mask, most):
        builder, (_, number, _) = self.builder, self.heads[self.open[-1]]
        lanes_that_go_on = builder.bitcast(results[mask], ir.IntType(WIDTH))
        goes_on = builder.icmp_unsigned("!=", lanes_that_go_on, ir.Constant(ir.IntType(WIDTH), 0))
        goes_on = builder.and_(goes_on, builder.icmp_unsigned("<", number, ir.Constant(COUNT, most)))
        one_pass, following = (builder.append_basic_block(name) for name in ("pass", "following"))
        builder.cbranch(goes_on, one_pass, following)
        builder.position_at_end(one_pass)
        self.open.append(following)

    def emit_pass_row(self, results, loop, array, first, stride):
        return _load(self.builder, self.pointers[array], self._pass_index(loop, first, stride))

    def emit_store(self, results, loop, value, array, first, stride):
        _write(self.builder, results[value], self.pointers[array], self._pass_index(loop, first, stride))

    def _pass_index(self, loop, first, stride):
        step = self.builder.mul(self.heads[loop][1], ir.Constant(COUNT, stride))
        return self.builder.add(step, ir.Constant(COUNT, first))

    def emit_repeat(self, results, loop, *afters):
        following, (head, number, carried) = self.open.pop(), self.heads[self.open.pop()]
        number.add_incoming(self.builder.add(number, ir.Constant(COUNT, 1)), self.builder.block)
        for phi, after in zip(carried, afters, strict=True):
            phi.add_incoming(results[after], self.builder.block)
        self.builder.branch(head)
        self.builder.position_at_end(following)


def _read(builder, op, pointer, number):
    index = ir.Constant(COUNT, number)
    if op == "plain":
        return broadcast(builder, builder.load(builder.gep(pointer, [index])))
    return _load(builder, pointer, index)


def _load(builder, pointer, index):
    value = builder.load(row_pointer(builder, pointer, index))
    value.align = 8
    return value


def _write(builder, value, pointer, index):
    builder.store(value, row_pointer(builder, pointer, index)).align = 8


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
