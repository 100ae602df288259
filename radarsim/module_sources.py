"""SHA-256 of a module's source as this process has loaded it.

A hash must name the code that runs, not what an editor has written since: stored blocks and compiled kernels are kept
by it. So a module that is loaded keeps the hash that was taken first, and is hashed as early as possible; one that is
not loaded yet is read again each time."""

import hashlib
import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from typing import Any, NamedTuple

from radarsim.errors import ConfigError


class _Digest(NamedTuple):
    """A hash of a source, and whether its module was loaded by then."""

    sha256: str
    loaded: bool


_digests: dict[str, _Digest] = {}


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

    Raises ConfigError where the file was edited while this process ran, so that nobody knows which one is loaded."""
    earlier, loaded = _digests.get(name), name in sys.modules
    if earlier is not None and earlier.loaded:
        return earlier.sha256
    content = module_source(name)
    digest = _Digest(hashlib.sha256(content).hexdigest() if content else "", loaded)
    if earlier is not None and loaded and digest.sha256 != earlier.sha256:
        raise ConfigError(f"{name}: was edited while this process ran; start a new one")
    _digests[name] = digest
    return digest.sha256


def note_loaded_modules(top: str) -> None:
    """Take the hashes of the modules of a top-level package that are loaded by now."""
    for name in [name for name in sys.modules if name.partition(".")[0] == top]:
        module_digest(name)
