"""The source files that a module's numbers rest on, found by following its imports, and their hashes.

Two things use it: the identity of stored blocks (radarsim.studies.identity) and the directory in which compiled kernels
are kept (radarsim.kernels.cache). The hash of a source is that of its syntax tree without docstrings, comments and the
descriptions of configuration keys, so that it changes when a number can change, and not when a sentence does. What the
syntax tree says is in radarsim.kernels.trees.

Modules are found as Python finds them, but not imported: in folders, namespace packages and archives. A module that is
no source (compiled, or bytecode alone) counts with its bytes.
"""

import hashlib
import json
import os
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec, resolve_name
from pathlib import Path
from pkgutil import iter_modules

from radarsim.kernels import trees
from radarsim.kernels.trees import Source

FORMAT = 2  # of the trees' hashes, and of the file that remembers them
MOST_KEPT = 2000  # sources in that file; beyond it only those of the process that writes are kept


APART = {f"radarsim.kernels.{name}" for name in ("cache", "sources", "trees")}  # they change no number


@cache
def top_spec(package: str) -> ModuleSpec | None:
    """Where a top-level module or package lies; None where there is none."""
    try:
        return find_spec(package)
    except (ImportError, ValueError):  # ValueError: __main__ has no specification
        return None


@cache
def spec_of(module: str) -> ModuleSpec | None:
    """Where a module lies; None where there is none (an attribute of a module). Nothing is imported."""
    package, _, _ = module.rpartition(".")
    if not package:
        return top_spec(module)
    above = spec_of(package)
    if above is None or above.submodule_search_locations is None:
        return None
    return PathFinder.find_spec(module, list(above.submodule_search_locations))


@cache
def content(module: str) -> bytes | None:
    """The bytes of a module's file; None for a namespace package and what is built into Python."""
    spec = spec_of(module)
    if spec is None or not spec.has_location or not hasattr(spec.loader, "get_data"):
        return None
    return spec.loader.get_data(spec.origin)


def forget() -> None:
    """Look at all files again; the syntax trees stay known."""
    for known in (top_spec, spec_of, content, source, part, data_files):
        known.cache_clear()


@dataclass
class Closure:
    """What was found by following imports: hashes by module or data file, and the modules that were not followed."""

    hashes: dict[str, str] = field(default_factory=dict)
    beyond: set[str] = field(default_factory=set)

    def digest(self) -> str:
        """SHA-256 in hexadecimal of all that was found."""
        text = "\n".join(f"{name} {value}" for name, value in sorted(self.hashes.items()))
        return hashlib.sha256(text.encode()).hexdigest()


def closure(
    roots: Iterable[str], followed: Callable[[str], bool], parts: Iterable[tuple[str, str, frozenset[str]]] = ()
) -> Closure:
    """The hashes of roots and of all that these import, directly or not, as far as `followed(module)`.

    `from package import module` counts as that module; the package's own file only where a name of its own is taken,
    and otherwise what it does when it is imported. parts are classes that count as well: the module, the name, and
    members that do not count; without roots it is their imports that are followed. Raises LookupError for a root that
    has no file.
    """
    found = Closure()
    waiting = list(roots)
    for root in waiting:
        if content(root) is None:
            raise LookupError(root)
    begins = not waiting
    for module, name, without in parts:
        one = part(module, name, without)
        found.hashes[f"{module}:{name}"] = one.tree
        if begins:
            waiting += _imported(module, one)
    while waiting:
        module = waiting.pop()
        if module in found.hashes or module in found.beyond:
            continue
        if not followed(module):
            found.beyond.add(module)
            continue
        one = source(module)
        found.hashes[module] = one.tree
        found.hashes |= data_files(module)
        waiting += _imported(module, one)
        for package in _packages(module):
            if package not in found.hashes and followed(package) and content(package) is not None:
                effects = part(package, "", frozenset())
                found.hashes[f"{package}:"] = effects.tree
                waiting += _imported(package, effects)
    return found


def _packages(module: str) -> Iterator[str]:
    """The packages that a module lies in, innermost first."""
    while module := module.rpartition(".")[0]:
        yield module


def _imported(module: str, one: Source) -> Iterator[str]:
    """The modules that a source imports, by their full names."""
    spec = spec_of(module)
    package = module if spec.submodule_search_locations is not None else module.rpartition(".")[0]
    for name in one.imports:
        with suppress(ImportError):  # beyond the top-level package
            full = resolve_name(name, package)
            if full == trees.COMPUTED:
                yield from _beneath(package)
            elif full.endswith(".*"):
                yield from _with_all(full.removesuffix(".*"))
            elif (innermost := _module_in(full)) is not None:
                yield innermost


def _module_in(name: str) -> str | None:
    """The longest beginning of a dotted name that is a module; of a module outside any folder, its top-level name."""
    while name and spec_of(name) is None:
        name = name.rpartition(".")[0]
    return name or None


def _with_all(package: str) -> Iterator[str]:
    """What `from package import *` imports: the package, and the modules that its __all__ names."""
    if (module := _module_in(package)) is None:
        return
    yield module
    names = (f"{module}.{name}" for name in source(module).exports)
    yield from (name for name in names if spec_of(name) is not None)


def _beneath(package: str) -> Iterator[str]:
    """Every module of a package: an import by a name that is computed may mean any."""
    spec = spec_of(package)
    for found in iter_modules(list(spec.submodule_search_locations or ()) if spec else ()):
        yield f"{package}.{found.name}"
        if found.ispkg:
            yield from _beneath(f"{package}.{found.name}")


_known: dict[str, Source] = {}
_kept: set[str] = set()  # of these, what an earlier process found
_used: set[str] = set()


@cache
def source(module: str) -> Source:
    """What is known of a module's file; of a namespace package, that it has none."""
    return _looked_up(module, None, frozenset())


@cache
def part(module: str, name: str, without: frozenset[str]) -> Source:
    """What is known of one class or function of a module and of all in its file that this uses; see `trees.part`."""
    return _looked_up(module, name, without)


def _looked_up(module: str, name: str | None, without: frozenset[str]) -> Source:
    """Looked up by the hash of the content: trees take a tenth of a second a study."""
    held = content(module)
    if held is None:
        return Source("none")
    plain = spec_of(module).origin.endswith(".py")
    asked = "" if name is None else f" {name} {','.join(sorted(without))}"
    key = hashlib.sha256(held).hexdigest() + asked + ("" if plain else " binary")
    _used.add(key)
    if key not in _known:
        _known[key] = trees.read(held, name, without) if plain else Source(hashlib.sha256(held).hexdigest())
    return _known[key]


@cache
def data_files(module: str) -> dict[str, str]:
    """Hashes of the files beside a module, or in folders there, whose names stand in its source, by module and path."""
    names = {os.path.basename(name) for name in source(module).files}
    found: dict[str, str] = {}
    if names:
        folder = Path(spec_of(module).origin).parent
        for path in sorted(folder.rglob("*")):
            if path.name in names and path.suffix not in (".py", ".pyc") and path.is_file():
                found[f"{module} {path.relative_to(folder)}"] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def remembered(file: Path) -> None:
    """Take up what an earlier process found, from a file; one that is not there or is damaged holds nothing."""
    with suppress(OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        held = json.loads(file.read_text(encoding="utf-8"))
        if held["format"] == FORMAT:
            for key, (tree, *lists) in held["sources"].items():
                imports, exports, files = (tuple(map(str, names)) for names in lists)
                _known.setdefault(str(key), Source(str(tree), imports, exports, files))
                _kept.add(str(key))


def remember(file: Path) -> None:
    """Keep what is new in a file, whole or not at all; where it cannot be written, nothing is lost but time."""
    if _known.keys() <= _kept:
        return
    temporary = file.with_name(f".{file.name}.{uuid.uuid4().hex}.tmp")
    kept = _known if len(_known) <= MOST_KEPT else {key: _known[key] for key in _used}
    held = {key: (one.tree, one.imports, one.exports, one.files) for key, one in kept.items()}
    with suppress(OSError):
        try:
            temporary.write_text(json.dumps({"format": FORMAT, "sources": held}), encoding="utf-8")
            os.replace(temporary, file)
            _kept.update(_known)
        finally:
            temporary.unlink(missing_ok=True)
