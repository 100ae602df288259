"""SHA-256 of a module's source as this process has loaded it.

A hash must name the code that runs, not what an editor has written since: stored blocks and compiled kernels are kept
by it. So a module that is loaded keeps the hash that was taken first, and is hashed as early as possible; one that is
not loaded yet is read again each time. A module that is imported anew, as those of a user's filter are, is another."""

import contextlib
import hashlib
import marshal
import os
import sys
import weakref
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import MAGIC_NUMBER, find_spec
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from radarsim.errors import ConfigError

INSTALLED = {"site-packages", "dist-packages"}

BYTECODE_HEADER = 16  # bytes: the number of Python's version, flags, time and size of the source

_loaded: weakref.WeakKeyDictionary[ModuleType, str] = weakref.WeakKeyDictionary()  # hashes of modules as they run
_expected: dict[str, str] = {}  # hashes that were taken before the module was loaded


def module_spec(name: str) -> ModuleSpec | None:
    """Where a module comes from; None if there is no such module. Its parent packages are imported."""
    if name in sys.modules:
        return getattr(sys.modules[name], "__spec__", None)
    try:
        return find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None


def module_source(name: str) -> bytes:
    """The content of a module's file, also within an archive; empty where it has none."""
    spec = module_spec(name)
    loader: Any = None if spec is None else spec.loader
    if spec is None or not spec.has_location or not hasattr(loader, "get_data"):
        return b""
    content: bytes = loader.get_data(spec.origin)
    return content


def module_digest(name: str) -> str:
    """SHA-256 of a module's source, in hexadecimal; empty where it has no file.

    Raises ConfigError where the file was edited while this process ran, so that nobody knows which one is loaded, and
    where Python has loaded bytecode of another text."""
    module = sys.modules.get(name)
    if module is not None and module in _loaded:
        return _loaded[module]
    content = module_source(name)
    digest = hashlib.sha256(content).hexdigest() if content else ""
    if module is None:
        _expected[name] = digest
        return digest
    if digest != _expected.get(name, digest):
        raise ConfigError(f"{name}: was edited while this process ran; start a new one")
    _expected.pop(name, None)
    check_bytecode(module)
    _loaded[module] = digest
    return digest


def check_bytecode(module: ModuleType) -> None:
    """Raise ConfigError where a module that was just loaded does not run the text of its file.

    Python takes bytecode for that of a source by its size and the whole seconds of its time. An edit within a second,
    or sources that are all unpacked with one time, may leave it to run bytecode of another text."""
    spec = getattr(module, "__spec__", None)
    if spec is None or type(spec.loader) is not SourceFileLoader or not spec.origin or not spec.cached:
        return
    if INSTALLED & set(Path(spec.origin).parts):
        return  # nobody edits it, and to compile all of radarsim takes half a second
    with contextlib.suppress(OSError, ValueError, EOFError, TypeError):  # none, or none that Python would load
        source, bytecode = os.stat(spec.origin), os.stat(spec.cached)
        if bytecode.st_mtime_ns > source.st_ctime_ns:
            return  # written after the last change of the source
        content = Path(spec.cached).read_bytes()
        flags = int.from_bytes(content[4:8], "little")  # 0: by time and size; 1: unchecked; 3: by a hash of the source
        numbers = int(source.st_mtime) & 0xFFFFFFFF, source.st_size & 0xFFFFFFFF
        times = b"".join(number.to_bytes(4, "little") for number in numbers)
        if content[:4] != MAGIC_NUMBER or flags == 3 or (flags == 0 and content[8:BYTECODE_HEADER] != times):
            return
        if marshal.loads(content[BYTECODE_HEADER:]) != _compile_source(spec.origin):
            raise ConfigError(f"{spec.origin}: Python runs bytecode of another text: delete {spec.cached}")


def _compile_source(source: str) -> CodeType | None:
    """The bytecode of a source; None where it is no Python."""
    try:
        return compile(Path(source).read_bytes(), source, "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return None


def note_loaded_modules(top: str) -> None:
    """Take the hashes of the modules of a top-level package that are loaded by now."""
    for name in [name for name in sys.modules if name.partition(".")[0] == top]:
        module_digest(name)
