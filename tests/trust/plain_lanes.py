"""Arrays of eight numbers in place of registers: `lanes` and `lane_programs` of `radarsim.kernels` without compiler.

Operations on lanes that are `LaneOperation`s work on arrays as they are. Replaced are the intrinsics, which only
compiled code can call, and programs, which are carried out operation by operation."""

import functools

import numpy as np

from radarsim.kernels.lanes import ROOT_HALF, WIDTH


class Pointer:
    """A place in a flat array, as kernels index it."""

    def __init__(self, array, start=0):
        self.array, self.start = array, start

    def __getitem__(self, i):
        return self.array[self.start + i]

    def __setitem__(self, i, value):
        self.array[self.start + i] = value

    def row(self, number):
        return slice(self.start + WIDTH * number, self.start + WIDTH * (number + 1))


def address(array):
    assert array.flags.c_contiguous  # else the pointer would be one to a copy
    return Pointer(array.reshape(-1))


def row(pointer, number):
    return Pointer(pointer.array, pointer.start + WIDTH * int(number))


def get(pointer, number):
    return pointer.array[pointer.row(int(number))].copy()


def put(pointer, number, value):
    pointer.array[pointer.row(int(number))] = value


def any_greater(x, y):
    return bool(np.any(x > y))


def total(x):
    x = np.broadcast_to(x, WIDTH)
    while len(x) > 1:
        x = x[: len(x) // 2] + x[len(x) // 2 :]
    return x[0]


def add_totals(pointer, number, *values):
    for i, value in enumerate(values):
        pointer[number + i] += total(value)


def mantissa_and_power(x):
    """m from √½ to √2 and e of x = m 2**e, by the bits."""
    bits = x.view(np.int64)
    power = (bits - ROOT_HALF) >> 52
    return (bits - (power << 52)).view(float), power.astype(float)


OPERATIONS = {
    **{"fadd": np.add, "fsub": np.subtract, "fmul": np.multiply, "fdiv": np.divide},
    **{"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal},
    **{"==": np.equal, "!=": lambda x, y: (x < y) | (x > y)},  # ordered: false of not-a-number
    **{"and": np.logical_and, "or": np.logical_or, "not": np.logical_not, "where": np.where},
    **{"sqrt": np.sqrt, "nearest": np.rint, "power_of_two": lambda x: np.ldexp(1.0, x.astype(int))},
    **{"mantissa": lambda x: mantissa_and_power(x)[0], "exponent": lambda x: mantissa_and_power(x)[1]},
}


class ProgramRun:
    """A program (`radarsim.kernels.tracing`) on arrays that are given by their addresses."""

    def __init__(self, program, pointers):
        self.ops, self.pointers = program.ops, pointers
        self.results = [None] * len(program.ops)
        self.passes = {}  # by the loop's number: its pass from 0 on, its carried numbers
        self.open = []  # loops that have not ended
        index = 0
        while index < len(self.ops):
            index = self.carry_out(index, *self.ops[index])
        for array, number, result in program.outputs:
            put(pointers[array], number, self.results[result])

    def carry_out(self, index, op, *operands):
        """Carry out an operation; the number of the next."""
        if op == "loop":
            self.passes[index] = 0, [self.results[start] for start in operands]
            self.open.append(index)
        elif op == "while":
            return self.next_of_test(index, *operands)
        elif op == "repeat":
            loop, *afters = operands
            self.passes[loop] = self.passes[loop][0] + 1, [self.results[after] for after in afters]
            return loop + 1
        else:
            self.results[index] = self.result(op, *operands)
        return index + 1

    def next_of_test(self, index, mask, most):
        loop = self.open[-1]
        if np.any(self.results[mask]) and self.passes[loop][0] < most:
            return index + 1
        self.open.pop()
        return next(n for n in range(index, len(self.ops)) if self.ops[n][:2] == ("repeat", loop)) + 1

    def result(self, op, *operands):
        if op == "number":
            return np.full(WIDTH, operands[0])
        if op == "row":
            return get(self.pointers[operands[0]], operands[1])
        if op == "plain":
            return np.full(WIDTH, self.pointers[operands[0]][operands[1]])
        if op in ("carry", "result"):
            loop, place = operands
            return self.passes[loop][1][place]
        if op == "pass_row":
            loop, array, first, stride = operands
            return get(self.pointers[array], first + stride * self.passes[loop][0])
        if op == "store":
            loop, value, array, first, stride = operands
            return put(self.pointers[array], first + stride * self.passes[loop][0], self.results[value])
        return OPERATIONS[op](*(self.results[operand] for operand in operands))


def emit_program(program):
    return functools.partial(ProgramRun, program)


def emit_sums(program):
    def run(pointers, sums):
        results = ProgramRun(program, pointers).results
        return tuple(value + results[index] for value, index in zip(sums, program.sums, strict=True))

    return run


def zero_lanes(count):
    return lambda: (np.zeros(WIDTH),) * count


LANES = {function.__name__: function for function in (address, row, get, put, any_greater, total, add_totals)}
LANE_PROGRAMS = {function.__name__: function for function in (emit_program, emit_sums, zero_lanes)}
