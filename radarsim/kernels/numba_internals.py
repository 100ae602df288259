"""How kernels are compiled and kept by the private half of Numba: in half the time, to the same bytes everywhere.

No documentation describes most of what is used here; a release of Numba may change it. `radarsim.kernels.compiler` then
compiles with public options alone (`radarsim.kernels.numba_options`), which has the same three functions.

The type of an operation is found once: half of what Numba takes to infer types. For each `a * b` Numba tries some ten
ways to multiply, most of them of sets, strings and arrays, until one fits the types; a kernel has thousands of such
places and a few types. What was found is kept here, by function and types. Not kept is what Numba compiles on the way
(other kernels, and operations that are written in Python): it depends on the options of who calls.

LLVM prefers registers of 256 bits on Intel processors that have 512, for the sake of programs that rarely use vectors.
Kernels ask for 512 one by one, in an attribute of the LLVM function; elsewhere it changes nothing. Measured on a
Cascade Lake: sums over samples 1.7 times faster, normals 1.3 times. Numba's CPU_FEATURES would do the same for the
whole process, but only where no other user of Numba came first, and the order of sums would depend on who did.

Numba optimises every function together with all that it calls and makes machine code of it, so that what is called at
the fifth level is translated five times. What kernels call (`inline`, `kernel_part`) has no compiled entry from Python
and is kept untranslated until the kernel is compiled: the nine-state filters take two thirds of the time, and run at
the same speed. A kernel that another calls is compiled for it apart, without an entry and without machine code."""

import ctypes
import functools
import gc
import pickle
from collections.abc import Callable

import llvmlite
import numba
from llvmlite.binding import Linkage
from numba import _dynfunc, njit, types
from numba.core import cgutils
from numba.core.caching import Cache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.extending import _Intrinsic
from numba.core.lowering import Lower
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.core.typed_passes import NativeLowering
from numba.core.typing import Context
from numba.np.arrayobj import make_array

from radarsim.kernels.cache import KernelEntries
from radarsim.user_code.module_sources import module_digest


class KernelCache(Cache):
    """Numba's view of the entries of one kernel: one for each signature and processor."""

    def __init__(self, function: Callable):
        self._py_func = function
        self.entries = KernelEntries(function, f"{numba.__version__} {llvmlite.__version__}")
        self.enable()

    @property
    def cache_path(self) -> str:
        """The folder of the entries."""
        return str(self.entries.folder)

    def flush(self) -> None:
        """Remove the entries of this kernel."""
        self.entries.remove()

    def load_overload(self, sig, target_context):
        """The compiled function of a signature; None where there is no such entry, or one that is damaged."""
        # What an entry needs of Numba. What it takes to compile (`refresh`: SciPy among it, 0.3 s) its compiler loads.
        rtsys.initialize(target_context)
        key = self._key(sig, target_context.codegen())
        content = self.entries.read(key)
        if content is None:
            return None
        try:
            stored_key, payload = pickle.loads(content)
            return CompileResult._rebuild(target_context, *payload) if stored_key == key else None
        except Exception as error:  # unpickling may raise anything
            self.entries.report_damage(key, error)
            return None

    def save_overload(self, sig, data) -> None:
        """Keep a compiled function, unless it holds addresses of this process."""
        if not data.library.has_dynamic_globals and not data.lifted:
            key = self._key(sig, data.codegen)
            self.entries.write(key, dumps((key, data._reduce())))

    def _key(self, sig, codegen) -> tuple:
        return self.entries.folder.name, self.entries.name, sig, codegen.magic_tuple()


class RememberingContext(Context):
    """A typing context that shares all that another has, and remembers. To Numba's own caches the two are the same."""

    __slots__ = ("_context", "_signatures")

    def __init__(self, context: Context):
        self.__dict__ = context.__dict__
        self._context = context
        self._signatures: dict = {}

    def __eq__(self, other) -> bool:
        return other is self or other is self._context

    def __hash__(self) -> int:
        return hash(self._context)

    def resolve_function_type(self, func, args, kws):
        """The signature of a call; that of an operation is remembered."""
        function = func if isinstance(func, types.Function) else self._lookup_global(func)
        if kws or not isinstance(function, types.Function):
            return super().resolve_function_type(func, args, kws)
        try:
            known_function, signature = self._signatures.get((func, args), (None, None))
        except TypeError:  # the bounds of a slice, in some versions of Python
            return super().resolve_function_type(func, args, kws)
        if known_function is function:  # another knows no implementation for these types yet
            return signature
        signature = super().resolve_function_type(func, args, kws)
        if signature is not None and _is_translated(function, signature):
            self._signatures[func, args] = function, signature
        return signature


def _is_translated(function: types.Function, signature) -> bool:
    """Whether Numba translates the call itself, so that nothing was compiled to find its type."""
    key = function.typing_key
    return isinstance(key, _Intrinsic) or function.get_impl_key(signature) is key


@functools.cache
def remembering_context(context: Context) -> RememberingContext:
    """The context with a memory that goes with one of Numba's."""
    return RememberingContext(context)


class LinkedLibrary(JITCodeLibrary):
    """Code that is only ever linked into a kernel's: here it is not made machine code."""

    def _finalize_final_module(self):
        self._finalized = True


class UntranslatedLibrary(LinkedLibrary):
    """A function without an entry, to be optimised in the kernel that calls it."""

    def _optimize_final_module(self):
        # Functions that are not inlined are optimised in the kernel as they would have been alone.
        if self.inlined:
            super()._optimize_final_module()


class CalledLibrary(LinkedLibrary):
    """A kernel as other kernels link it: optimised as it is alone, so that its numbers are the same."""


class SelfContainedLibrary(JITCodeLibrary):
    """A kernel's machine code, in which all that it calls is its own.

    Numba leaves the functions of a kernel weak: where another kernel has a function of that name in memory, its code is
    run instead. Which there are depends on what this process has compiled, and what it has read from the cache; they
    differ in the order of their sums, as each is optimised with its callers. So the last bits were others in the
    process that compiled."""

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


def without_references(lower: Lower, kind: types.Type, value):
    """An argument whose arrays are not counted: whoever called the kernel keeps them until it returns. Numba counts
    references to an array wherever it is passed on or cut, with locked instructions."""
    if isinstance(kind, types.Array):
        array = make_array(kind)(lower.context, lower.builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        for i, member in enumerate(kind.types):
            if holds_arrays(member):
                uncounted = without_references(lower, member, lower.builder.extract_value(value, i))
                value = lower.builder.insert_value(value, uncounted, i)
    return value


class WideLower(Lower):
    """Numba's translation to LLVM, with the attribute that lets loops use registers of 512 bits."""

    def extract_function_arguments(self):
        arguments = super().extract_function_arguments()
        # What is returned is counted: it outlives the call.
        if isinstance(self.library, SelfContainedLibrary) and not holds_arrays(self.fndesc.restype):
            pairs = zip(self.fndesc.argtypes, arguments, strict=True)
            arguments = [without_references(self, kind, argument) for kind, argument in pairs]
            self.fnargs = arguments
        return arguments

    def setup_function(self, fndesc):
        super().setup_function(fndesc)
        # llvmlite's attribute set admits only the names it knows, but prints all it holds.
        set.add(self.function.attributes, '"prefer-vector-width"="512"')
        if isinstance(self.library, UntranslatedLibrary) and not fndesc.inline:
            self.function.attributes.add("noinline")


@register_pass(mutates_CFG=True, analysis_only=False)
class WideLowering(NativeLowering):
    """The pass that runs it, and leaves functions without an entry from Python untranslated."""

    _name = "wide_native_lowering"
    lowering_class = WideLower

    def run_pass(self, state):
        if not state.flags.no_cpython_wrapper:
            state.library = SelfContainedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            return super().run_pass(state)
        state.library = state.pipeline.linked(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.inlined = state.flags.forceinline
        state.flags.no_compile = True
        mutated = super().run_pass(state)
        # Numba knows a compiled function by an object that Python can call.
        result = state["cr"]
        descriptor = result.fndesc
        name = descriptor.qualname.split(".")[-1]
        entry = _dynfunc.make_function(
            descriptor.lookup_module(), name, name, NO_ENTRY.value, result.env, (state.library,)
        )
        state.targetctx.insert_user_function(entry, descriptor, [state.library])
        state["cr"] = result._replace(cfunc=entry)
        return mutated


class WideCompiler(CompilerBase):
    """Numba's ordinary pipeline but for that pass, with a memory for the types of operations."""

    linked = UntranslatedLibrary  # what becomes of a function without an entry

    def __init__(self, typingctx, *rest):
        super().__init__(typingctx, *rest)
        self.state.typingctx = remembering_context(typingctx)

    def define_pipelines(self):
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state, "wide")
        manager.passes = [(WideLowering if step is NativeLowering else step, name) for step, name in manager.passes]
        manager.finalize()
        return [manager]


class CalledCompiler(WideCompiler):
    """The same for a kernel that another calls."""

    linked = CalledLibrary


# Nobody takes a kernel's C address; its wrapper is a tenth of the time to compile.
COMMON = {"error_model": "numpy", "pipeline_class": WideCompiler, "no_cfunc_wrapper": True}


def compile_inline(function: Callable, flags: frozenset[str]):
    """A function that is copied into the kernels that call it."""
    return njit(fastmath=set(flags), forceinline=True, no_cpython_wrapper=True, **COMMON)(function)


def compile_part(function: Callable, flags: frozenset[str]):
    """A function that kernels call and Python cannot."""
    return njit(fastmath=set(flags), no_cpython_wrapper=True, **COMMON)(function)


def compile_kernel(function: Callable, flags: frozenset[str]):
    """A function that Python and other kernels call, kept in our own cache; other users of Numba keep theirs."""
    options = {"fastmath": set(flags), "nogil": True}
    kernel = njit(**COMMON, **options)(function)
    if numba.config.DISABLE_JIT:  # it is the function itself
        return kernel
    kernel.compile = without_collection(kernel.compile)
    if module_digest(function.__module__):  # else nobody could notice an edit
        kernel._cache = KernelCache(function)

    @functools.cache
    def called_kernel():
        return njit(**COMMON | {"pipeline_class": CalledCompiler}, no_cpython_wrapper=True, **options)(function)

    # What Numba asks of a function that a kernel calls.
    kernel.get_call_template = lambda *types: called_kernel().get_call_template(*types)
    kernel.get_overload = lambda types: called_kernel().get_overload(types)
    return kernel


def without_collection(compile_function: Callable) -> Callable:
    """Compile without Python's search for cyclic garbage, which takes up to a seventh of the time; it runs after."""

    @functools.wraps(compile_function)
    def compile_uncollected(*args, **kwargs):
        if not gc.isenabled():
            return compile_function(*args, **kwargs)
        gc.disable()
        try:
            return compile_function(*args, **kwargs)
        finally:
            gc.enable()

    return compile_uncollected
