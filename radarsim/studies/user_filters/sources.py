"""What the code of a user filter is made of, as far as it is known before any of it runs; and the hashes of its files.

Of the module, and of all modules from its folder that it imports (of an installed package, from that package), the
syntax trees count, without comments and docstrings; of each file that a text in them names from there the content.

What runs adds to this: see `radarsim.studies.user_filters.recording`."""

import ast
import contextlib
import hashlib
import os
import stat
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from radarsim.config.identity import digest
from radarsim.errors import ConfigError
from radarsim.user_code import errors as user_code_errors
from radarsim.user_code.files import is_program_file
from radarsim.user_code.imports import imports_in
from radarsim.user_code.module_sources import INSTALLED

MAX_NAME = 255  # characters of the name of a file
MIN_AGE_NS = 100_000_000  # file systems count in steps of milliseconds: of two writes in one step the times are equal
MODIFIED = 4  # the place of the time of the last write in a signature

Kind = Literal["code", "content", "names"]  # syntax of a .py file, bytes of any file, names of the files in a folder
Signature = tuple[int, ...]


@dataclass(frozen=True)
class Sources:
    """The user's modules by name, the first one first, with their files; each file that counts, by its kind; and the
    folders that they are in: of an installed package that of the package."""

    modules: dict[str, str]
    files: tuple[tuple[str, Kind], ...]
    folders: tuple[str, ...]

    @property
    def digest(self) -> str:
        """SHA-256 of the modules, as far as their syntax goes."""
        return digest([(name, digest_of(file, _kind(file))) for name, file in self.modules.items()])


def _kind(file: str) -> Kind:
    return "code" if file.endswith(".py") else "content"


def file_of(folder: str, module: str) -> Path | None:
    """The file of a module in a folder: of a package before that of a module, as Python has it."""
    path = Path(folder, *module.split("."))
    files = (path / "__init__.py", *(path.with_name(path.name + suffix) for suffix in (".py", *EXTENSION_SUFFIXES)))
    return next((file for file in files if file.is_file()), None)


def home_folder(module: str, config_folder: str) -> str:
    """The folder from which a module is imported: that of the config if it is there, else where it is installed."""
    if file_of(config_folder, module) is None:
        with contextlib.suppress(ImportError, ValueError):
            spec = find_spec(module.partition(".")[0])  # of the outermost module, of which nothing runs for it
            for location in [] if spec is None else spec.submodule_search_locations or [spec.origin or ""]:
                return os.path.dirname(os.path.abspath(location))
    return config_folder


def is_installed(folder: str) -> bool:
    """Whether a folder is one of installed packages."""
    return bool(INSTALLED & set(Path(folder).parts))


def sources(folder: str, module: str) -> Sources:
    """What a module depends on, by its text alone. Raises ConfigError for a module that is no Python."""
    homes: dict[str, str] = {module.partition(".")[0]: folder}
    installed = is_installed(folder)  # its package counts, and not what is beside
    modules: dict[str, str] = {}
    files: dict[tuple[str, Kind], None] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop(0)
        first = name.partition(".")[0]
        if first not in homes:
            homes[first] = "" if first == "radarsim" else _home_of_users(first, folder)
        file = file_of(homes[first], name) if homes[first] else None
        if name in modules or file is None:
            continue
        modules[name] = str(file)
        files[str(file), _kind(str(file))] = None
        imported, texts = _names_in(file, name)
        waiting += [name.rpartition(".")[0], *imported] if "." in name else imported
        files |= {(os.path.abspath(data), "content"): None for text in texts if (data := data_file(file.parent, text))}
    folders = {os.path.join(home, first) for first, home in homes.items() if home and (home != folder or installed)}
    return Sources(modules, tuple(files), tuple(sorted(folders if installed else {folder, *folders})))


def _home_of_users(first: str, folder: str) -> str:
    """The folder of an outermost module that a module in a folder imports; empty where it is none of the user's: a
    library, or beside an installed package."""
    if file_of(folder, first) is not None or Path(folder, first).is_dir():
        return "" if is_installed(folder) else folder
    home = home_folder(first, folder)
    return "" if is_program_file(home) or file_of(home, first) is None else home  # of a package installed to be edited


def data_file(folder: str | Path, text: object) -> Path | None:
    """The file, other than one of Python, that a text with a suffix names from a folder; None where it names none."""
    file = named_file(folder, text)
    return None if file is None or file.suffix == ".py" else file


def named_file(folder: str | Path, text: object) -> Path | None:
    """The file that a text with a suffix names from a folder; None where it names none."""
    if not isinstance(text, str) or len(text) > MAX_NAME or not Path(text).suffix or not text.isprintable():
        return None
    file = Path(folder, text)
    return file if file.is_file() else None


def named_folder(folder: Path, text: object) -> Path | None:
    """The folder that a text names from a folder by a slash at its end; None where it names none."""
    if not isinstance(text, str) or len(text) > MAX_NAME or not text.endswith("/") or not text.isprintable():
        return None
    path = Path(folder, text)
    return path if path.is_dir() else None


def with_paths(folder: Path, value: Any) -> tuple[Any, list[str]]:
    """The value of a key with absolute paths for texts that name files or folders, also in lists and mappings; and
    these files, with all in the folders."""
    if isinstance(value, dict):
        items, files = with_paths(folder, list(value.values()))
        return dict(zip(value, items, strict=True)), files
    if isinstance(value, list | tuple):
        pairs = [with_paths(folder, item) for item in value]
        return type(value)(item for item, _ in pairs), [file for _, files in pairs for file in files]
    if (file := named_file(folder, value)) is not None:
        return os.path.abspath(file), [os.path.abspath(file)]
    if (data_folder := named_folder(folder, value)) is not None:
        return os.path.abspath(data_folder), [os.path.abspath(file) for file in _files_below(data_folder)]
    return value, []


def _files_below(folder: Path) -> Iterator[Path]:
    """The files in a folder and below, except hidden ones, bytecode, and those in folders of results."""
    results = {path.parent for path in folder.rglob(".blocks")} - {folder}
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        hidden = any(part.startswith(".") or part == "__pycache__" for part in parts)
        if path.is_file() and not hidden and results.isdisjoint(path.parents):
            yield path


def _names_in(file: Path, name: str) -> tuple[list[str], list[str]]:
    """The modules that a module may import, and its texts."""
    if file.suffix != ".py":
        return [], []
    tree = _syntax(file.read_bytes(), str(file))
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    constants = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return imports_in(tree, package), [value for value in constants if isinstance(value, str)]


@lru_cache(maxsize=200)
def _syntax(content: bytes, file: str) -> ast.Module:
    """The syntax tree of a source, without docstrings and other constants that stand alone."""
    try:
        tree = ast.parse(content, file)
    except (SyntaxError, ValueError) as error:
        raise ConfigError(
            f"{file}:{getattr(error, 'lineno', None) or 1}: {user_code_errors.value_text(error)}"
        ) from error
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [
                line for line in node.body if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ]
    return tree


def signature(path: str) -> Signature | None:
    """What changes when a file or a folder is written: a quick sign that its hash may differ. None where none is."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    kind = stat.S_IFMT(status.st_mode)
    return kind, status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def digest_of(path: str, kind: Kind) -> str:
    """SHA-256 of what counts of a file or a folder; empty where it is gone."""
    if kind == "names":
        return _names_digest(path)
    current = signature(path)
    if current is None:
        return ""
    is_old = time.time_ns() - current[MODIFIED] > MIN_AGE_NS
    return (_file_digest if is_old else _file_digest.__wrapped__)(path, kind, current)


@lru_cache(maxsize=10_000)
def _file_digest(path: str, kind: Kind, _: Signature) -> str:
    """Of a file, kept as long as its signature is the same."""
    if kind == "code":
        return hashlib.sha256(ast.unparse(_syntax(Path(path).read_bytes(), path)).encode()).hexdigest()
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _names_digest(folder: str) -> str:
    """Of the names in a folder, except hidden ones, bytecode, copies of editors, and folders of results."""
    try:
        names = sorted(os.listdir(folder))
    except OSError:
        return ""
    names = [name for name in names if not name.startswith(".") and not name.endswith("~") and name != "__pycache__"]
    names = [name for name in names if not os.path.isdir(os.path.join(folder, name, ".blocks"))]
    return hashlib.sha256("\0".join(names).encode("utf-8", "surrogateescape")).hexdigest()


def by_relative_path(folder: str, digests: Mapping[tuple[str, Kind], str]) -> dict[str, str]:
    """Hashes of files by their kind and their path from a folder, so that a folder may be moved."""
    real = os.path.realpath(folder)
    return {
        f"{kind} {os.path.relpath(path, real if path.startswith(real + os.sep) else folder)}": digest
        for (path, kind), digest in sorted(digests.items())
    }
