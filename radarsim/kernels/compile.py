"""How every kernel is compiled. Where its machine code is kept: radarsim.kernels.cache.

LLVM prefers registers of 256 bits on Intel processors that have 512, for the sake of programs that rarely use vectors.
Kernels ask for 512 one by one, in an attribute of the LLVM function; elsewhere it changes nothing. Measured on a
Cascade Lake: sums over samples 1.7 times faster, normals 1.3 times. Numba's CPU_FEATURES would do the same for the
whole process, but only where no other user of Numba came first, and the order of sums would depend on who did.

Numba optimises every function together with all that it calls and makes machine code of it, so that what is called at
the fifth level is translated five times. What kernels call (`inline`, `part`) has no compiled entry from Python and is
kept untranslated until the kernel is compiled: the nine-state filters take two thirds of the time, and run at the same
speed. A kernel that another calls is compiled for it apart, without an entry and without machine code. Python calls an
`inline` function as the plain function that it is, see `radarsim.kernels.formula`; a `part` it cannot call.
"""

import ctypes
import functools
import math
from collections.abc import Callable

import numpy as np
from llvmlite.binding import Linkage
from numba import _dynfunc, njit
from numba.core import cgutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering
from numba.extending import typeof_impl
from numba.np.arrayobj import make_array

from radarsim.kernels import cache
from radarsim.kernels.formula import Formula
from radarsim.kernels.resolving import resolving

# No `reassoc` (part of fastmath=True): it folds rounding tricks such as (x + M) - M and changes the order of sums.
FLAGS = frozenset({"contract", "arcp", "nsz", "nnan", "ninf"})


class Linked(JITCodeLibrary):
    """Code that is only ever linked into a kernel's: here it is not made machine code."""

    def _finalize_final_module(self):
        self._finalized = True


class Untranslated(Linked):
    """A function without an entry, to be optimised in the kernel that calls it."""

    def _optimize_final_module(self):
        # Functions that are not inlined are optimised in the kernel as they would have been alone.
        if self.inlined:
            super()._optimize_final_module()


class Called(Linked):
    """A kernel as other kernels link it: optimised as it is alone, so that its numbers are the same."""


class SelfContained(JITCodeLibrary):
    """A kernel's machine code, in which all that it calls is its own.

    Numba leaves the functions of a kernel weak: where another kernel has a function of that name in memory, its code is
    run instead. Which there are depends on what this process has compiled, and what it has read from the cache; they
    differ in the order of their sums, as each is optimised with its callers. So the last bits were others in the
    process that compiled.
    """

    def _finalize_final_module(self):
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()


# Where Python lands when it calls a function without an entry: it raises TypeError instead of crashing. Not a number,
# which would be another in each process and part of what kernels are kept by.
NO_ENTRY = ctypes.cast(ctypes.pythonapi.PyObject_Call, ctypes.c_void_p)


def holds_arrays(kind: types.Type) -> bool:
    """Whether a value of a type is an array or a tuple with one in it."""
    return isinstance(kind, types.Array) or any(map(holds_arrays, getattr(kind, "types", ())))


def borrowed(lower: Lower, kind: types.Type, value):
    """An argument whose arrays are not counted: whoever called the kernel keeps them until it returns.

    Numba counts references to an array wherever it is passed on or cut, with locked instructions.
    """
    if isinstance(kind, types.Array):
        array = make_array(kind)(lower.context, lower.builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        for i, one in enumerate(kind.types):
            if holds_arrays(one):
                fewer = borrowed(lower, one, lower.builder.extract_value(value, i))
                value = lower.builder.insert_value(value, fewer, i)
    return value


class WideLower(Lower):
    """Numba's translation to LLVM, with the attribute that lets loops use registers of 512 bits."""

    def extract_function_arguments(self):
        arguments = super().extract_function_arguments()
        # What is returned is counted: it outlives the call.
        if isinstance(self.library, SelfContained) and not holds_arrays(self.fndesc.restype):
            kinds = self.fndesc.argtypes
            arguments = [borrowed(self, kind, one) for kind, one in zip(kinds, arguments, strict=True)]
            self.fnargs = arguments
        return arguments

    def setup_function(self, fndesc):
        super().setup_function(fndesc)
        # llvmlite's attribute set admits only the names it knows, but prints all it holds.
        set.add(self.function.attributes, '"prefer-vector-width"="512"')
        if isinstance(self.library, Untranslated) and not fndesc.inline:
            self.function.attributes.add("noinline")


@register_pass(mutates_CFG=True, analysis_only=False)
class WideLowering(NativeLowering):
    """The pass that runs it, and leaves functions without an entry from Python untranslated."""

    _name = "wide_native_lowering"
    lowering_class = WideLower

    def run_pass(self, state):
        if not state.flags.no_cpython_wrapper:
            state.library = SelfContained(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            return super().run_pass(state)
        state.library = state.pipeline.linked(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.inlined = state.flags.forceinline
        state.flags.no_compile = True
        mutated = super().run_pass(state)
        # Numba knows a compiled function by an object that Python can call.
        made = state["cr"]
        name = made.fndesc.qualname.split(".")[-1]
        known = _dynfunc.make_function(
            made.fndesc.lookup_module(), name, name, NO_ENTRY.value, made.env, (state.library,)
        )
        state.targetctx.insert_user_function(known, made.fndesc, [state.library])
        state["cr"] = made._replace(cfunc=known)
        return mutated


class WideCompiler(CompilerBase):
    """Numba's ordinary pipeline but for that pass, with a memory for the types of operations."""

    linked = Untranslated  # what becomes of a function without an entry

    def __init__(self, typingctx, *rest):
        super().__init__(typingctx, *rest)
        self.state.typingctx = resolving(typingctx)

    def define_pipelines(self):
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state, "wide")
        manager.passes = [(WideLowering if step is NativeLowering else step, name) for step, name in manager.passes]
        manager.finalize()
        return [manager]


class CalledCompiler(WideCompiler):
    """The same for a kernel that another calls."""

    linked = Called


def compiler(**options) -> Callable:
    """A decorator that compiles with `options`, cached in our own directory; other users of Numba keep theirs."""

    def decorated(function: Callable) -> Callable:
        kernel = cache.kept(njit(**COMMON, **options)(function))
        if hasattr(kernel, "targetctx"):  # not plain Python

            @functools.cache
            def called():
                return njit(**COMMON | {"pipeline_class": CalledCompiler}, no_cpython_wrapper=True, **options)(function)

            # What Numba asks of a function that a kernel calls.
            kernel.get_call_template = lambda *types: called().get_call_template(*types)
            kernel.get_overload = lambda types: called().get_overload(types)
        return kernel

    return decorated


# Nobody takes a kernel's C address; its wrapper is a tenth of the time to compile.
COMMON = {"error_model": "numpy", "pipeline_class": WideCompiler, "no_cfunc_wrapper": True}
# What kernels call: copied into its caller, or a function of its own in each kernel.
inline = Formula
part = njit(fastmath=set(FLAGS), no_cpython_wrapper=True, **COMMON)
kernel = compiler(fastmath=set(FLAGS), nogil=True)
# Reassociation is allowed only where it lets independent sums run in vector registers; the code fixes their order.
summing = compiler(fastmath=set(FLAGS | {"reassoc"}), nogil=True)


@typeof_impl.register(Formula)
def _type_of_formula(formula: Formula, context) -> types.Type:
    return formula.compiled or types.Dispatcher(twin(formula))


@functools.cache
def twin(formula: Formula):
    """The compiled twin of a formula, as kernels call it."""
    return njit(fastmath=set(FLAGS), forceinline=True, no_cpython_wrapper=True, **COMMON)(formula.function)


def aligned_zeros(*shape: int) -> np.ndarray:
    """A work array of zeros on a 64-byte boundary: no eight numbers of a register lie across two cache lines."""
    room = np.zeros(math.prod(shape) + 8)
    skip = -(room.ctypes.data // room.itemsize) % 8
    return room[skip : skip + math.prod(shape)].reshape(shape)
