"""How kernels are compiled: `kernel`, `careful_kernel`, `summing_kernel` for Python, `inline`, `kernel_part`,
`careful_part` for other kernels.

Kernels are compiled by `numba_internals` where Numba's private half is the one that is known, otherwise by
`numba_options`; then `troubles` has a line for the user. Python calls an `inline` function as the plain function that
it is, see `radarsim.kernels.kalman_algebra`; a `kernel_part` need not be callable from Python."""

import functools
import math
import re
from collections.abc import Callable
from types import ModuleType

import numba
import numpy as np
from numba.extending import typeof_impl

from radarsim.kernels import cache, numba_options
from radarsim.kernels.kalman_algebra import Formula

# Releases whose private half gave the known numbers, first and last.
KNOWN_RELEASES = (0, 60), (0, 68)
# No `reassoc` (part of fastmath=True): it folds rounding tricks such as (x + M) - M and changes the order of sums.
FAST_MATH_FLAGS = frozenset({"contract", "arcp", "nsz", "nnan", "ninf"})
FLAGS_OF_ANY_NUMBER = FAST_MATH_FLAGS - {"nnan", "ninf"}

inline = Formula  # copied into each kernel that calls it


def kernel_part(function: Callable):
    """A decorator of what kernels call: a function of its own in each of them."""
    return COMPILER.compile_part(function, FAST_MATH_FLAGS)


def kernel(function: Callable):
    """A decorator of what Python calls."""
    return COMPILER.compile_kernel(function, FAST_MATH_FLAGS)


def careful_kernel(function: Callable):
    """As `kernel`, of numbers that need not be finite."""
    return COMPILER.compile_kernel(function, FLAGS_OF_ANY_NUMBER)


def careful_part(function: Callable):
    """As `kernel_part`, of numbers that need not be finite."""
    return COMPILER.compile_part(function, FLAGS_OF_ANY_NUMBER)


def summing_kernel(function: Callable):
    """As `kernel`, of a kernel that may add in another order than it is written.

    Only where that lets independent sums run in vector registers; the code fixes their order."""
    return COMPILER.compile_kernel(function, FAST_MATH_FLAGS | {"reassoc"})


def aligned_zeros(*shape: int) -> np.ndarray:
    """A work array of zeros on a 64-byte boundary: no eight numbers of a register lie across two cache lines."""
    room = np.zeros(math.prod(shape) + 8)
    skip = -(room.ctypes.data // room.itemsize) % 8
    return room[skip : skip + math.prod(shape)].reshape(shape)


@typeof_impl.register(Formula)
def _type_of_formula(formula: Formula, context) -> numba.types.Type:
    return numba.typeof(_compiled_twin(formula))


@functools.cache
def _compiled_twin(formula: Formula):
    """A formula as kernels call it."""
    return COMPILER.compile_inline(formula.function, FAST_MATH_FLAGS)


def choose_compiler() -> ModuleType:
    """The module that compiles: by Numba's private half, or by public options alone where anything of that half fails.

    A release that is not known compiles a small kernel first; later processes find it in the cache."""
    try:
        from radarsim.kernels import numba_internals

        first, last = KNOWN_RELEASES
        if not first <= release(numba.__version__) <= last:
            check_compiler(numba_internals)
    except Exception as error:  # whatever another release makes of it
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        cache.troubles["compiler"] = (
            f"Numba {numba.__version__} differs inside from the releases that radarsim knows ({reason}): kernels take "
            "longer to compile, none is kept for the next run, and numbers differ by rounding"
        )
        return numba_options
    return numba_internals


def release(version: str) -> tuple[int, ...]:
    """The first two numbers of a version.

    >>> release("0.69.0rc1")
    (0, 69)
    """
    return tuple(int(number) for number in re.findall(r"\d+", version)[:2])


def check_compiler(compiler: ModuleType) -> None:
    """Compile and run a small kernel that calls every kind of function; raises where that fails or is wrong."""

    def double(x):
        return 2.0 * x

    def weighted(pair, i):
        return pair[0][i] + compiled_double(pair[1][i])

    def total(pair):
        result = 0.0
        for i in range(pair[0].size):
            result += compiled_weighted(pair, i)
        return result

    def total_and_one(pair):
        return compiled_total(pair) + 1.0

    compiled_double = compiler.compile_inline(double, FAST_MATH_FLAGS)
    compiled_weighted = compiler.compile_part(weighted, FAST_MATH_FLAGS)
    compiled_total = compiler.compile_kernel(total, FAST_MATH_FLAGS)
    value = compiler.compile_kernel(total_and_one, FAST_MATH_FLAGS)((np.arange(3.0), np.ones(3)))
    if value != 10.0:
        raise ValueError(f"a kernel gave {value}, not 10.0")


COMPILER = choose_compiler()
