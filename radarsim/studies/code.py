"""Filters of the user's own code in a config: where their sources are, what these are, and the code itself, run.

`python: my_filter.py:MyFilter` is a file beside the config; `python: my_package.my_module:MyFilter` a module that is
found there, or is installed. What its numbers depend on is known before any of it runs: the syntax trees, without
comments and docstrings, of the module and of all modules from its folder that it imports (of an installed package from
that package), and the content of each file that a text in them names from there, or a key of the filter from the
folder of the config: `weights: net.npz` is given to the class as a path that can be opened."""

import ast
import contextlib
import hashlib
import importlib
import os
import sys
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from radarsim import failures
from radarsim.config.experiment import digest
from radarsim.config.schema import OwnCode
from radarsim.errors import ConfigError
from radarsim.studies.interface import Study
from radarsim.studies.outside import Called, Outside, Plots, components_of, made_of

FORBIDDEN = "RADARSIM_NO_CODE"  # in the environment, so that processes of a run keep to it as well
INSTALLED = {"site-packages", "dist-packages"}
LONGEST = 255  # characters of the name of a file

_lock = threading.RLock()  # one thread at a time is in code of the user's, which need not know of threads
_modules: dict[tuple[str, str, str], ModuleType] = {}
_taken: set[str] = set()  # names of modules that were imported here: they may be imported anew, and from elsewhere


# ---- sources ---------------------------------------------------------------------------------------------------------
def file_of(folder: str, module: str) -> Path | None:
    """The file of a module in a folder: of a package before that of a module, as Python has it."""
    path = Path(folder, *module.split("."))
    files = (path / "__init__.py", *(path.with_name(path.name + suffix) for suffix in (".py", *EXTENSION_SUFFIXES)))
    return next((file for file in files if file.is_file()), None)


def named(folder: str | Path, text: object) -> Path | None:
    """The file that a text names from a folder, if it does."""
    if not isinstance(text, str) or len(text) > LONGEST or not Path(text).suffix or not text.isprintable():
        return None
    file = Path(folder, text)
    return file if file.is_file() and file.suffix != ".py" else None


def sources(folder: str, module: str) -> dict[str, str]:
    """SHA-256 of the user's own modules that a module imports, itself first, and of the files that they name."""
    first = module.partition(".")[0]
    only = f"{first}." if INSTALLED & set(Path(folder).parts) else ""
    found: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop(0)
        file = file_of(folder, name) if f"{name}.".startswith(only) and name.split(".")[0] != "radarsim" else None
        if name in found or file is None:
            continue
        stat = file.stat()
        found[name], imported, texts = _read(file, name, stat.st_mtime_ns, stat.st_size)
        waiting += [name.rpartition(".")[0], *imported] if "." in name else imported
        files = filter(None, (named(file.parent, text) for text in texts))
        found |= {f"{name}: {one.name}": hashlib.sha256(one.read_bytes()).hexdigest() for one in files}
    return found


def home_of(module: str, beside: str) -> str:
    """The folder from which a module is imported: that of the config if it is there, else where it is installed."""
    if file_of(beside, module) is None:
        with contextlib.suppress(ImportError, ValueError):
            spec = find_spec(module.partition(".")[0])  # of the outermost module, of which nothing runs for it
            for place in [] if spec is None else spec.submodule_search_locations or [spec.origin or ""]:
                return os.path.dirname(os.path.abspath(place))
    return beside


@lru_cache(maxsize=1000)
def _read(file: Path, name: str, changed: int, size: int) -> tuple[str, list[str], list[str]]:
    """Of a module's file the hash of what it does, the modules that it may import, and its texts."""
    content = file.read_bytes()
    if file.suffix != ".py":
        return hashlib.sha256(content).hexdigest(), [], []
    try:
        tree = ast.parse(content, str(file))
    except (SyntaxError, ValueError) as error:
        raise ConfigError(f"{file}:{getattr(error, 'lineno', None) or 1}: {failures.words(error)}") from error
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [
                one for one in node.body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))
            ]
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    imported, texts = [], []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            imported += [base, *(f"{base}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            texts.append(node.value)
    return hashlib.sha256(ast.unparse(tree).encode()).hexdigest(), imported, texts


# ---- filter ----------------------------------------------------------------------------------------------------------
def coded(keys: OwnCode, place: str, baseline: bool, folder: Path) -> "Coded":
    """The filter that a config in a folder names at a place. ConfigError where there is none, or none may run."""
    if os.environ.get(FORBIDDEN):
        raise ConfigError(f"is code of yours, and --no-code runs none, got {keys.python!r}")
    where, _, made = keys.python.rpartition(":")
    if not where or not made.isidentifier():
        raise ConfigError(f"must be FILE.py:NAME or MODULE:NAME, got {keys.python!r}")
    if where.endswith(".py"):
        file = Path(os.path.abspath(folder / where))
        home, module, missing = str(file.parent), file.stem, f"no such file: {file}"
    else:
        home, module = home_of(where, os.path.abspath(folder)), where
        missing = f"no such module, neither beside the config nor installed: {where}"
    if file_of(home, module) is None:
        raise ConfigError(missing)
    given = dict(keys.model_extra or {})
    files = {key: os.path.abspath(path) for key, one in given.items() if (path := named(folder, one))}
    contents = {key: hashlib.sha256(Path(file).read_bytes()).hexdigest() for key, file in files.items()}
    written = digest(own := sources(home, module))
    identity = digest({"made": made, "one_by_one": keys.one_by_one, "keys": given, "files": contents, "sources": own})
    return Coded(keys.name, identity, keys, place, home, module, made, given | files, written, baseline)


@dataclass(frozen=True)
class Coded(Outside):
    """A class or function of the user's own, which is imported where it is first asked for estimates.

    place: where the config names it; folder, module, made: what is imported from where; given: what it is called with;
    sources: SHA-256 of what the module depends on."""

    name: str
    identity: str
    keys: OwnCode
    place: str
    folder: str
    module: str
    made: str
    given: Mapping[str, Any]
    sources: str
    baseline: bool = False

    @property
    def written(self) -> dict[str, Any]:  # type: ignore[override]
        return dict(self.keys.model_dump(exclude_defaults=True))

    @property
    def file(self) -> str:
        """The file of its module."""
        return str(file_of(self.folder, self.module))

    @property
    def components(self) -> tuple[str, ...]:  # type: ignore[override]
        return components_of(self.target)

    def estimates(self, plots: Plots) -> Any:
        target = self.target
        with self._running(f"fails in realisations {plots.first}:{plots.first + plots.n} of {plots.world.case}"):
            of = partial(made_of, self.name, target) if isinstance(target, type) else partial(partial, target)
            made = of(**self.given)
            return Called(self.name, made, alone=self.keys.one_by_one).estimates(plots)

    @property
    def target(self) -> Any:
        """The class or function. ConfigError where it cannot be imported."""
        with self._running("cannot be imported"):
            known = (self.folder, self.module, self.sources)
            if known not in _modules:
                _modules[known] = self._imported()
            module = _modules[known]
        if not callable(target := getattr(module, self.made, None)):
            made = {name: one for name, one in vars(module).items() if callable(one)}
            own = [name for name, one in made.items() if getattr(one, "__module__", "") == self.module]
            there = ", ".join(own) or "none"
            raise ConfigError(f"{self.place}: no class or function {self.made} in {self.file}; it has {there}")
        return target

    def _imported(self) -> ModuleType:
        """The module, imported afresh with all of the user's modules that it imports."""
        own = sources(self.folder, self.module)
        if digest(own) != self.sources:
            raise ConfigError(f"{self.file} is not what it was when the config was read")
        for name in {self.module, *own}.intersection(sys.modules).difference(_taken):
            file, at = file_of(self.folder, name), getattr(sys.modules[name], "__file__", None)
            if file and not (at and os.path.realpath(at) == os.path.realpath(file)):
                raise ConfigError(
                    f"{self.place}: {file}: give it another name: {name} is {at or 'of Python itself'} here"
                )
        for name in own:
            if not any(isinstance(one, Study) for one in vars(sys.modules.get(name, object)).values()):
                sys.modules.pop(name, None)  # a study stays: its keys must remain the same class
        _taken.update(own)
        importlib.invalidate_caches()
        sys.path.insert(0, self.folder)
        kept, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # nothing is written beside the user's files
        try:
            return importlib.import_module(self.module)
        finally:
            sys.dont_write_bytecode = kept
            sys.path.remove(self.folder)
            if self.folder not in sys.path:
                sys.path.append(self.folder)  # for what is imported within functions

    @contextlib.contextmanager
    def _running(self, what: str) -> Iterator[None]:
        """The user's code runs within, in one thread: its output goes to stderr, its errors are shown as its own."""
        with _lock, contextlib.redirect_stdout(sys.stderr):
            try:
                yield
            except (ConfigError, KeyboardInterrupt):
                raise
            except BaseException as error:
                line = f"{self.place}: filter {self.name}, {self.keys.python}, {what}:"
                package = self.module.partition(".")[0] if INSTALLED & set(Path(self.folder).parts) else ""
                own = os.path.join(self.folder, package)
                within = f": of a package, it is {Path(self.folder).name}.{self.module}:{self.made}"
                hint = within if "no known parent package" in failures.words(error) else ""
                raise ConfigError(line, *failures.frames(error, own), failures.words(error) + hint) from error
