"""Where machine code is kept: a directory for all that a kernel is made from, so that no edit goes unnoticed.

Numba's cache on disk looks at the file of the compiled function alone: an edit of a function that it calls, in another
file, goes unnoticed and gives silently wrong results. So the directory of a kernel is named after a hash of the modules
that its globals come from. An edit in one study's kernels leaves those of the others as they are.

Numba keeps an index beside its entries and unpickles both as they are: an empty or altered file ends the run with
EOFError, UnpicklingError or a crash in the loaded code, and a full disk with OSError. Here an entry is a file of its
own: SHA-256, then the pickled key and machine code, written whole or not at all, so that processes need no lock. What
is not exactly that is a miss. A cache that cannot be read or written is left alone after the first time; `troubles`
then has a line for the user.
"""

import contextlib
import functools
import gc
import hashlib
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
from numba.core.caching import Cache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

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
    """Numbers and texts of a value as they are, functions by their names; of anything else nothing."""
    if isinstance(value, list | tuple):
        return f"({', '.join(map(described, value))})"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
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

    Where none of them can be written, the first of them: nothing is kept then, which `troubles` says.
    """
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
