"""Formulas that Python calls as they are and kernels have copied into them: written once, for every kind of number.

They work on whatever adds and multiplies: plain numbers, arrays of NumPy, and in kernels the lanes of
`radarsim.kernels.lanes`. This module loads no compiler; `radarsim.kernels.compile` says how kernels take them."""

import functools
from collections.abc import Callable


class Formula:
    """A function of Python, to which `radarsim.kernels.compile` gives a compiled twin where a kernel calls it.

    compiled: the type of the twin, as Numba knows it, where that is no translation of the function."""

    def __init__(self, function: Callable, compiled=None):
        functools.update_wrapper(self, function)
        self.function, self.compiled = function, compiled

    def __call__(self, *arguments):
        return self.function(*arguments)


inline = Formula
