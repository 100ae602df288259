"""How kernels are compiled by Numba's public options alone, where its private half is not the one that is known.

Compiling takes 1.3 to 2.1 times as long as in `radarsim.kernels.numba_internals`, a run the same; numbers agree to
rounding. Nothing is kept on disk: Numba's own cache misses edits in other files, and unpickles what it finds there."""

from collections.abc import Callable

from numba import njit


def compile_inline(function: Callable, flags: frozenset[str]):
    """A function that is copied into the kernels that call it."""
    return njit(fastmath=set(flags), forceinline=True, error_model="numpy")(function)


def compile_part(function: Callable, flags: frozenset[str]):
    """A function that kernels call."""
    return njit(fastmath=set(flags), error_model="numpy")(function)


def compile_kernel(function: Callable, flags: frozenset[str]):
    """A function that Python and other kernels call."""
    return njit(fastmath=set(flags), nogil=True, error_model="numpy")(function)
