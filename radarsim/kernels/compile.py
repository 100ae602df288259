"""Where machine code is kept: a directory for all that a kernel is made from, so that no edit goes unnoticed.

Numba's cache on disk looks at the file of the compiled function alone: an edit of a function that it calls, in another
file, goes unnoticed and gives silently wrong results. So the directory of a kernel is named after a hash of the modules
that its globals come from. An edit in one study's kernels leaves those of the others as they are.

Numba keeps an index beside its entries and unpickles both as they are: an empty or altered file ends the run with
EOFError, UnpicklingError or a crash in the loaded code, and a full disk with OSError. Here an entry is a file of its
own: SHA-256, then the pickled key and machine code, written whole or not at all, so that processes need no lock. What
is not exactly that is a miss. A cache that cannot be read or written is left alone after the first time; `troubles`
then has a line for the user.

The type of an operation is found once: half of what Numba takes to infer types.

For each `a * b` Numba tries some ten ways to multiply, most of them of sets, strings and arrays, until one fits the
types; a kernel has thousands of such places and a few types. What was found is kept here, by function and types. Not
kept is what Numba compiles on the way (other kernels, and operations that are written in Python): it depends on the
options of who calls.

How every kernel is compiled. Where its machine code is kept: radarsim.kernels.compile.

LLVM prefers registers of 256 bits on Intel processors that have 512, for the sake of programs that rarely use vectors.
Kernels ask for 512 one by one, in an attribute of the LLVM function; elsewhere it changes nothing. Measured on a
Cascade Lake: sums over samples 1.7 times faster, normals 1.3 times. Numba's CPU_FEATURES would do the same for the
whole process, but only where no other user of Numba came first, and the order of sums would depend on who did.

Numba optimises every function together with all that it calls and makes machine code of it, so that what is called at
the fifth level is translated five times. What kernels call (`inline`, `part`) has no compiled entry from Python and is
kept untranslated until the kernel is compiled: the nine-state filters take two thirds of the time, and run at the same
speed. A kernel that another calls is compiled for it apart, without an entry and without machine code. Python calls an
`inline` function as the plain function that it is, see `radarsim.kernels.algebra`; a `part` it cannot call."""

import contextlib
import ctypes
import functools
import gc
import hashlib
import math
import os
import pickle
import re
import stat
import sys
import tempfile
import uuid
from collections.abc import Callable
from pathlib import Path
from types import FunctionType, ModuleType

import llvmlite
import numba
import numpy as np
from llvmlite.binding import Linkage
from numba import _dynfunc, njit
from numba.core import cgutils, types
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
from numba.extending import typeof_impl
from numba.np.arrayobj import make_array

from radarsim.kernels.algebra import Formula

# ---- cache -----------------------------------------------------------------------------------------------------------
SUFFIX = ".kernel"
DIGEST = 32

troubles: dict[str, str] = {}  # lines for the user, by kind: one each in a process


def kept(function: Callable) -> Callable:
    """A compiled function whose machine code is kept on disk; plain Python, and what has no file, stay as they are."""
    if hasattr(function, "targetctx"):
        function.compile = without_collection(function.compile)
        if file_hash(function.__module__):  # else nobody could notice an edit
            function._cache = KernelCache(function.py_func)
    return function


def without_collection(compile_kernel: Callable) -> Callable:
    """Compile without Python's search for cyclic garbage, which takes up to a seventh of the time; it runs after."""

    @functools.wraps(compile_kernel)
    def compiled(*args, **kwargs):
        if not gc.isenabled():
            return compile_kernel(*args, **kwargs)
        gc.disable()
        try:
            return compile_kernel(*args, **kwargs)
        finally:
            gc.enable()

    return compiled


class KernelCache(Cache):
    """The entries of one kernel: a file for each signature and processor."""

    def __init__(self, function: Callable):
        self._py_func = function
        name = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")[-80:]
        self._name = f"{name}-{function.__code__.co_firstlineno}"
        self.enable()

    @functools.cached_property
    def _path(self) -> Path:
        """Known at the first call: by then all that the kernel calls is imported."""
        text = f"{numba.__version__} {llvmlite.__version__} {rests_on(self._py_func)}"
        return ROOT / f"kernels-{hashlib.sha256(text.encode()).hexdigest()[:16]}"

    @property
    def cache_path(self) -> str:
        """The directory of the entries."""
        return str(self._path)

    def flush(self) -> None:
        """Remove the entries of this kernel."""
        for path in self._path.glob(f"{self._name}-*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def load_overload(self, sig, target_context):
        """The compiled function of a signature; None where there is no such entry, or one that is damaged."""
        # What an entry needs of Numba. What it takes to compile (`refresh`: SciPy among it, 0.3 s) its compiler loads.
        rtsys.initialize(target_context)
        key = self._key(sig, target_context.codegen())
        path = self._entry(key)
        try:
            raw = path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            _note("read", f"{path}: cannot be read: {error.strerror}; the kernel is compiled again")
            return None
        try:
            return self._rebuilt(raw, key, target_context)
        except Exception as error:  # unpickling may raise anything
            _note("damaged", f"{path}: damaged ({type(error).__name__}); the kernel is compiled again")
            return None

    def _rebuilt(self, raw: bytes, key: tuple, target_context):
        body = raw[DIGEST:]
        if hashlib.sha256(body).digest() != raw[:DIGEST]:
            raise ValueError("not what was written")
        held, payload = pickle.loads(body)
        return CompileResult._rebuild(target_context, *payload) if held == key else None

    def save_overload(self, sig, data) -> None:
        """Keep a compiled function, unless it holds addresses of this process."""
        if "write" in troubles or data.library.has_dynamic_globals or data.lifted:
            return
        key = self._key(sig, data.codegen)
        body = dumps((key, data._reduce()))
        path = self._entry(key)
        temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
        try:
            self._path.mkdir(parents=True, exist_ok=True)
            try:
                temporary.write_bytes(hashlib.sha256(body).digest() + body)
                os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)
        except OSError as error:
            _note("write", f"{self._path}: compiled kernels cannot be kept: {error.strerror}; each run compiles again")

    def _key(self, sig, codegen) -> tuple:
        return self._path.name, self._name, sig, codegen.magic_tuple()

    def _entry(self, key: tuple) -> Path:
        return self._path / f"{self._name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}{SUFFIX}"


def _note(kind: str, line: str) -> None:
    troubles.setdefault(kind, f"kernel cache: {line}")


def rests_on(function: Callable) -> str:
    """SHA-256 of all that a kernel is compiled from: the files of the modules of ours that its globals come from,
    directly or not, numbers in these, and what a function made by another takes from it."""
    found: dict[str, str] = {}
    waiting: list[object] = [function]
    tops = {"radarsim", function.__module__.partition(".")[0]}
    while waiting:
        one = waiting.pop()
        one = getattr(one, "__wrapped__", one)  # compiled, or a formula
        if isinstance(one, tuple | list):
            waiting += one
        if isinstance(one, FunctionType) and one.__closure__:
            held = [cell.cell_contents for cell in one.__closure__]
            waiting += held if (text := f"{one.__module__}.{one.__qualname__} {described(held)}") not in found else []
            found[text] = ""
        name = one.__name__ if isinstance(one, ModuleType) else getattr(one, "__module__", None)
        if not isinstance(name, str) or name in found or name.partition(".")[0] not in tops:
            continue
        found[name] = file_hash(name)
        module = sys.modules.get(name)
        if module is not None and not hasattr(module, "__path__"):  # a package's names depend on what is imported
            values = [(key, value) for key, value in vars(module).items() if not key.startswith("__")]
            waiting += (value for _, value in values)
            found[name] += described(values)
    return hashlib.sha256(repr(sorted(found.items())).encode()).hexdigest()


def described(value: object) -> str:
    """Numbers and texts of a value as they are, functions and programs by their names; of anything else nothing."""
    if isinstance(value, list | tuple):
        return f"({', '.join(map(described, value))})"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(made := getattr(value, "made_of", None), str):  # what runs a program of `kernels.traced`
        return made
    value = getattr(value, "__wrapped__", value)
    if isinstance(value, FunctionType):
        return f"{value.__module__}.{value.__qualname__}"
    return repr(value) if isinstance(value, int | float | complex | str | bytes) else ""


@functools.cache
def file_hash(module: str) -> str:
    """SHA-256 of a module's file; empty where it has none."""
    spec = getattr(sys.modules.get(module), "__spec__", None)
    if spec is None or not spec.has_location or not hasattr(spec.loader, "get_data"):
        return ""
    return hashlib.sha256(spec.loader.get_data(spec.origin)).hexdigest()


def cache_root() -> Path:
    """The first writable of $RADARSIM_CACHE_DIR, $XDG_CACHE_HOME/radarsim, ~/.cache/radarsim, temporary directory.

    Where none of them can be written, the first of them: nothing is kept then, which `troubles` says."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    candidates = list(filter(None, [os.environ.get("RADARSIM_CACHE_DIR"), os.path.join(home, "radarsim")]))
    for candidate in candidates:
        try:
            Path(candidate).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=candidate):
                return Path(candidate)
        except OSError:
            continue
    try:
        return temporary_root()
    except OSError as error:
        where = ", ".join(candidates)
        _note(
            "write", f"{where}: cannot be written, nor a temporary directory: {error.strerror}; each run compiles again"
        )
        return Path(candidates[0])


def temporary_root() -> Path:
    """A directory of ours alone in the common temporary one; a new one each time where another's hand may be in it."""
    if not hasattr(os, "getuid"):
        return Path(tempfile.mkdtemp(prefix="radarsim-"))
    path = Path(tempfile.gettempdir()) / f"radarsim-{os.getuid()}"
    with contextlib.suppress(FileExistsError):
        path.mkdir(mode=0o700)
    status = path.lstat()
    ours = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022
    return path if ours else Path(tempfile.mkdtemp(prefix="radarsim-"))


ROOT = cache_root()


# ---- resolving -------------------------------------------------------------------------------------------------------
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


# ---- compile ---------------------------------------------------------------------------------------------------------
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


def borrowed(lower: Lower, kind: types.Type, value):
    """An argument whose arrays are not counted: whoever called the kernel keeps them until it returns. Numba counts
    references to an array wherever it is passed on or cut, with locked instructions."""
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
        kernel = kept(njit(**COMMON, **options)(function))
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
