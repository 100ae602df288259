"""Where machine code is kept: a directory for each set of sources, so that no edit goes unnoticed.

Numba's cache on disk looks at the file of the compiled function alone: an edit of a function that it calls, in another
file, goes unnoticed and gives silently wrong results. So the directory of a kernel is named after a hash of the sources
that its module rests on, wherever they lie. An edit in one study's kernels leaves those of the others as they are.

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
import tempfile
import uuid
from collections.abc import Callable
from pathlib import Path

import llvmlite
import numba
from numba.core.caching import Cache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from radarsim.kernels import sources

SOURCES = "sources.json"  # what is known of source files; see `sources.remember`
SUFFIX = ".kernel"
DIGEST = 32

troubles: dict[str, str] = {}  # lines for the user, by kind: one each in a process


def kept(function: Callable) -> Callable:
    """A compiled function whose machine code is kept on disk; plain Python, and what has no file, stay as they are."""
    if hasattr(function, "targetctx"):
        function.compile = without_collection(function.compile)
        if (path := directory(function.__module__)) is not None:
            function._cache = KernelCache(function.py_func, path)
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

    def __init__(self, function: Callable, path: Path):
        self._py_func = function
        self._path = path
        name = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")[-80:]
        self._name = f"{name}-{function.__code__.co_firstlineno}"
        self.enable()

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
        return self._path.name, self._name, *self._index_key(sig, codegen)

    def _entry(self, key: tuple) -> Path:
        return self._path / f"{self._name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}{SUFFIX}"


def _note(kind: str, line: str) -> None:
    troubles.setdefault(kind, f"kernel cache: {line}")


@functools.cache
def directory(module: str) -> Path | None:
    """Where the kernels of a module are kept, by all that it compiles: itself and what it imports of kernels.

    None for a module without a file: nobody could notice an edit.
    """
    package = module.partition(".")[0]
    try:
        found = sources.closure(
            [module], lambda name: name.split(".")[0] in (package, "radarsim") and name not in sources.APART
        )
    except LookupError:
        return None
    sources.remember(ROOT / SOURCES)
    text = f"{numba.__version__} {llvmlite.__version__} {found.digest()}"
    return ROOT / f"kernels-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


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
sources.remembered(ROOT / SOURCES)
