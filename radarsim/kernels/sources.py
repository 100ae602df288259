"""The source files that a module's numbers rest on, found by following its imports, and their hashes.

Two things lean on it: the identity of stored blocks (radarsim.studies.identity) and the directory in which compiled
kernels are kept (radarsim.kernels.cache). The hash of a source is that of its syntax tree without docstrings, comments
and the descriptions of configuration keys, so that it changes when a number can change, and not when a sentence does.
"""

import ast
import hashlib
import json
import os
import uuid
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

FORMAT = 1  # of the trees' hashes, and of the file that remembers them
WORDS = "description"  # argument of a configuration key that only tells what it is


@dataclass(frozen=True)
class Source:
    """What is known of a file: the hash of its syntax tree, and the modules that it imports, at any depth."""

    tree: str
    imports: tuple[tuple[str, tuple[str, ...]], ...]


@cache
def root_of(package: str) -> Path | None:
    """The folder of a top-level package; None for one that is a single file or is not there."""
    spec = find_spec(package)
    places = list(spec.submodule_search_locations or ()) if spec else []
    return Path(places[0]) if places else None


def path_of(module: str) -> Path | None:
    """The file of a module; None where there is none (an attribute of a module, a compiled one)."""
    first, *rest = module.split(".")
    root = root_of(first)
    if root is None:
        spec = find_spec(first) if not rest else None
        return Path(spec.origin) if spec and spec.origin and spec.origin.endswith(".py") else None
    path = root.joinpath(*rest)
    for file in (path.with_name(f"{path.name}.py") if rest else None, path / "__init__.py"):
        if file is not None and file.is_file():
            return file
    return None


def closure(roots: Iterable[str], followed: Callable[[str], bool]) -> dict[str, Path]:
    """Files by module: of the roots, and of all that these import, directly or not, as far as `followed(module)`.

    `from package import module` counts as that module; the package's own file only where a name of its own is taken.
    """
    found: dict[str, Path] = {}
    waiting = list(roots)
    while waiting:
        module = waiting.pop()
        path = path_of(module)
        if module in found or path is None:
            continue
        found[module] = path
        for package, names in source(path).imports:
            inner = [f"{package}.{name}" for name in names]
            modules = [name for name in inner if path_of(name)]
            waiting += [name for name in modules if followed(name)]
            if len(modules) < max(1, len(inner)) and followed(package):
                waiting.append(package)
    return found


def digest(files: dict[str, Path]) -> str:
    """SHA-256 in hexadecimal of the syntax trees of modules, by name."""
    text = "\n".join(f"{module} {source(path).tree}" for module, path in sorted(files.items()))
    return hashlib.sha256(text.encode()).hexdigest()


_known: dict[str, Source] = {}
_kept: set[str] = set()  # of these, what an earlier process found out


def source(path: Path) -> Source:
    """What is known of a file, looked up by the hash of its content: trees take a tenth of a second a study."""
    content = path.read_bytes()
    key = hashlib.sha256(content).hexdigest()
    if key not in _known:
        tree = ast.parse(content)
        _known[key] = Source(hashlib.sha256(b"".join(_parts(tree))).hexdigest(), tuple(_imports(tree, path)))
    return _known[key]


def remembered(file: Path) -> None:
    """Take up what an earlier process found out, from a file; one that is not there or is damaged holds nothing."""
    with suppress(OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        held = json.loads(file.read_text(encoding="utf-8"))
        if held["format"] == FORMAT:
            for key, (tree, imports) in held["sources"].items():
                _known.setdefault(str(key), Source(str(tree), tuple((m, tuple(names)) for m, names in imports)))
                _kept.add(str(key))


def remember(file: Path) -> None:
    """Keep what is new in a file, whole or not at all; where it cannot be written, nothing is lost but time."""
    if _known.keys() <= _kept:
        return
    temporary = file.with_name(f".{file.name}.{uuid.uuid4().hex}.tmp")
    held = {key: (one.tree, one.imports) for key, one in _known.items()}
    with suppress(OSError):
        try:
            temporary.write_text(json.dumps({"format": FORMAT, "sources": held}), encoding="utf-8")
            os.replace(temporary, file)
            _kept.update(_known)
        finally:
            temporary.unlink(missing_ok=True)


def _imports(tree: ast.AST, path: Path) -> list[tuple[str, tuple[str, ...]]]:
    found: list[tuple[str, tuple[str, ...]]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, ()) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.append((node.module, tuple(alias.name for alias in node.names)))
        elif isinstance(node, ast.ImportFrom) and node.level:
            raise ValueError(f"{path}: relative imports are not followed: write the package's name out")
    return found


def _parts(node: object) -> Iterable[bytes]:
    """The syntax tree as text, equal in every version of Python: fields that are empty or new ones' defaults are left
    out, docstrings, type comments and descriptions too."""
    if isinstance(node, ast.AST):
        yield f"({type(node).__name__}".encode()
        for name in node._fields:
            value = getattr(node, name, None)
            if name == "body" and isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                value = value[1:] if value and _is_text(value[0]) else value
            elif name == "keywords":
                value = [one for one in value if one.arg != WORDS]
            elif name in ("kind", "type_comment", "ctx", "type_params"):
                continue
            if value is not None and value != []:
                yield f" {name}=".encode()
                yield from _parts(value)
        yield b")"
    elif isinstance(node, list):
        for one in node:
            yield from _parts(one)
    else:
        yield repr(node).encode()


def _is_text(statement: ast.AST) -> bool:
    """Whether a statement is a mere text: a docstring."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and (isinstance(statement.value.value, str))
    )
