"""The type of an operation is found once: half of what Numba takes to infer types.

For each `a * b` Numba tries some ten ways to multiply, most of them of sets, strings and arrays, until one fits the
types; a kernel has thousands of such places and a few types. What was found is kept here, by function and types. Not
kept is what Numba compiles on the way (other kernels, and operations that are written in Python): it depends on the
options of who calls.
"""

import functools

from numba.core import types
from numba.core.extending import _Intrinsic
from numba.core.typing import Context


class Resolving(Context):
    """A typing context that shares all that another has, and remembers. To Numba's own caches the two are the same."""

    __slots__ = ("_known", "_of")

    def __init__(self, context: Context):
        self.__dict__ = context.__dict__
        self._of = context
        self._known: dict = {}

    def __eq__(self, other) -> bool:
        return other is self or other is self._of

    def __hash__(self) -> int:
        return hash(self._of)

    def resolve_function_type(self, func, args, kws):
        """The signature of a call; that of an operation is remembered."""
        function = func if isinstance(func, types.Function) else self._lookup_global(func)
        if kws or not isinstance(function, types.Function):
            return super().resolve_function_type(func, args, kws)
        try:
            resolved, found = self._known.get((func, args), (None, None))
        except TypeError:  # the bounds of a slice, in some versions of Python
            return super().resolve_function_type(func, args, kws)
        if resolved is function:  # another knows no implementation for these types yet
            return found
        found = super().resolve_function_type(func, args, kws)
        if found is not None and _translated(function, found):
            self._known[func, args] = function, found
        return found


def _translated(function: types.Function, signature) -> bool:
    """Whether Numba translates the call itself, so that nothing was compiled to find its type."""
    key = function.typing_key
    return isinstance(key, _Intrinsic) or function.get_impl_key(signature) is key


@functools.cache
def resolving(context: Context) -> Resolving:
    """The context with a memory that goes with one of Numba's."""
    return Resolving(context)
