"""Which modules compute the numbers of a case, and one hash of their sources.

The list follows the imports, from the modules that a study names (`Study.computing_modules`), those of the filters'
keys, and those that take a case through the engine. Imports within functions count; those for a type checker alone do
not, nor does what only shows results. A user's package counts with its files of data, with the packages of the user's
that it imports, and as a whole where it imports by names that are computed; the versions of all installed packages
count then as well, as it may use any."""

import ast
import contextlib
import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import distributions, packages_distributions
from pathlib import Path
from typing import NamedTuple

from radarsim.config.experiment import Case
from radarsim.config.model import Model
from radarsim.studies.registry import FILTERS, entry_points_by_name, study
from radarsim.user_code.files import is_user_module
from radarsim.user_code.imports import imports_in
from radarsim.user_code.module_sources import module_digest, module_source, module_spec, note_loaded_modules

RADARSIM = __package__.partition(".")[0]
ENGINE = "radarsim.api.case_work", "radarsim.engine.collect"  # what takes a case through the engine
SHIPPED = "shipped"  # the folder of a package with what is for users, such as configs
SHOW_RESULTS = "radarsim.report", "radarsim.language", "radarsim.papers", "radarsim.extensions"

_COMMENT = re.compile(r"#.*")
_TYPE_CHECKING = re.compile(r"^if TYPE_CHECKING:\n(?:[ \t]+.*\n|\n)+", re.MULTILINE)
_IMPORT = re.compile(
    r"^(?P<before>[ \t]*|.*[;:][ \t]*)"
    r"(?:from[ \t]+(?P<base>[.\w]+)[ \t]+import[ \t]*(?P<names>\([^)]*\)|(?:[^\n;\\]|\\\n)+)"
    r"|import[ \t]+(?P<modules>(?:[^\n;\\]|\\\n)+))",
    re.MULTILINE,
)
_NAME = re.compile(r"(\w[\w.]*)(?:\s+as\s+\w+)?")
_COMPUTED_IMPORT = re.compile(
    rb"\b(?:importlib|import_module|__import__|pkgutil|runpy|lazy_loader|exec|eval)\b|\bimport[ \t]*\*"
)


def sources_digest(case: Case) -> str:
    """SHA-256 of the sources that compute a case's numbers, in hexadecimal."""
    note_loaded_modules(RADARSIM)
    digests = {name: module_digest(name) for name in computing_modules(_first_modules(case))}
    user_packages = _user_packages(digests)
    for top in user_packages:
        digests |= {f"{top}: {name}": digest for name, digest in _data_digests(top).items()}
    versions = _installed_versions() if user_packages else []
    return hashlib.sha256(repr((sorted(digests.items()), versions)).encode()).hexdigest()


def _user_packages(modules: Iterable[str]) -> list[str]:
    """The top-level packages of modules that are not radarsim's."""
    return sorted({name.partition(".")[0] for name in modules} - {RADARSIM})


class UserPackage(NamedTuple):
    """An installed package of the user's that computes a case: its version, and the SHA-256 of its sources."""

    version: str
    sha256: str


def computing_packages(case: Case) -> dict[str, UserPackage]:
    """The packages of the user's that compute a case, by the names under which they are installed."""
    modules = computing_modules(_first_modules(case))
    if not (tops := _user_packages(modules)):
        return {}
    groups = entry_points_by_name(), entry_points_by_name(FILTERS)
    entries = [entry for group in groups for by_package in group.values() for entry in by_package.values()]
    names = {top: libraries[0] for top, libraries in packages_distributions().items()}
    names |= {entry.module.partition(".")[0]: entry.dist.name for entry in entries if entry.dist}
    packages = {}
    for top in tops:
        digests = {name: module_digest(name) for name in modules if name.partition(".")[0] == top}
        digest = hashlib.sha256(repr(sorted((digests | _data_digests(top)).items())).encode()).hexdigest()
        name = names.get(top, top)
        packages[name] = UserPackage(dict(_installed_versions()).get(name, ""), digest)
    return packages


def _first_modules(case: Case) -> tuple[str, ...]:
    """The modules from which the imports are followed."""
    members = getattr(case.spec, case.spec.bare_keys, ())
    kinds = {base.__module__ for member in members for base in type(member).__mro__ if issubclass(base, Model)}
    return (*ENGINE, *study(case.study).computing_modules(case.spec, bool(case.user_filters)), *sorted(kinds))


@cache
def computing_modules(first: tuple[str, ...]) -> frozenset[str]:
    """These modules, and all of radarsim and of their own packages that they import, directly or not."""
    counts = dict.fromkeys((RADARSIM, *(name.partition(".")[0] for name in first)), True)
    modules: set[str] = set()
    waiting = list(first)
    while waiting:
        name = waiting.pop()
        top = name.partition(".")[0]
        if top not in counts:
            counts[top] = is_user_module(top)
        if name in modules or not counts[top] or _is_within(name, SHOW_RESULTS):
            continue
        if (spec := module_spec(name)) is None or not spec.has_location:
            continue
        modules.add(name)
        source = module_source(name)
        is_package, parent = spec.submodule_search_locations is not None, name.rpartition(".")[0]
        package = name if is_package else parent
        waiting += [parent] if parent else []
        if top == RADARSIM:
            # Importing a module runs the packages that it lies in, but none of their functions.
            runs_functions = not is_package or name in first
            waiting += imported_modules(source.decode(), package, within_functions=runs_functions)
            continue
        waiting += _all_modules(top) if _COMPUTED_IMPORT.search(source) else []
        with contextlib.suppress(SyntaxError, ValueError):  # no Python: an extension, a template
            waiting += imports_in(ast.parse(source), package)
    return frozenset(modules)


def imported_modules(text: str, package: str, within_functions: bool = True) -> list[str]:
    """The names of modules that a source of radarsim imports, and names in them that may be modules.

    Takes 0.02 s where syntax trees take 0.2 s. It reads imports as our formatter writes them, which a test holds."""
    modules = []
    for match in _IMPORT.finditer(_TYPE_CHECKING.sub("\n", _COMMENT.sub("", text))):
        if match["before"][:1] in (" ", "\t") and not within_functions:
            continue
        if match["modules"]:
            modules += _NAME.findall(match["modules"])
            continue
        base = match["base"]
        if level := len(base) - len(base.lstrip(".")):
            above = package.split(".")[: len(package.split(".")) - level + 1]
            base = ".".join(filter(None, [*above, base.lstrip(".")]))
        modules.append(base)
        spec = module_spec(base) if base.partition(".")[0] in (RADARSIM, package.partition(".")[0]) else None
        if spec is not None and spec.submodule_search_locations is not None:
            modules += [f"{base}.{name}" for name in _NAME.findall(match["names"])]
    return modules


def _is_within(name: str, packages: tuple[str, ...]) -> bool:
    return any(f"{name}.".startswith(f"{package}.") for package in packages)


def _all_modules(top: str) -> list[str]:
    """The modules of a top-level package that lie in folders."""
    return [
        ".".join((top, *path.relative_to(folder).with_suffix("").parts)).removesuffix(".__init__")
        for folder in _folders(top)
        for path in folder.rglob("*.py")
    ]


def _data_digests(top: str) -> dict[str, str]:
    """SHA-256 of the files of a top-level package that are no sources, by their paths in it.

    What it ships for users is no part of how it computes: a config counts where it is run."""
    return {name: digest for name, digest in _file_digests(top).items() if SHIPPED not in Path(name).parts}


def _file_digests(top: str) -> dict[str, str]:
    """As `_data_digests`, with what it ships for users."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for folder in _folders(top)
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    }


def _folders(top: str) -> Iterator[Path]:
    spec = module_spec(top)
    for folder in [] if spec is None else spec.submodule_search_locations or []:
        yield Path(folder)


@cache
def _installed_versions() -> list[tuple[str, str]]:
    every_metadata = (distribution.metadata for distribution in distributions())
    return sorted({(metadata["Name"], metadata["Version"]) for metadata in every_metadata})


@cache
def package_digest(packages: tuple[str, ...], ignored_name: str, ignored_files: tuple[str, ...]) -> str:
    """SHA-256 of the code and the data of user packages and of those that they import: without comments, docstrings
    and the YAML that they ship, such as configs.

    ignored_name: of variables and attributes that do not count; ignored_files: names of data files."""
    first = [name for package in packages for name in (package, *_all_modules(package))]
    modules = sorted(name for name in computing_modules(tuple(first)) if name.partition(".")[0] != RADARSIM)
    texts = [f"{name}: {_plain_code(module_source(name), ignored_name)}" for name in modules]
    for top in sorted({name.partition(".")[0] for name in modules}):
        for name, digest in sorted(_file_digests(top).items()):
            path = Path(name)
            is_shipped_yaml = SHIPPED in path.parts and path.suffix in (".yaml", ".yml")
            if not is_shipped_yaml and path.name not in ignored_files:
                texts.append(f"{top}/{name}: {digest}")
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def _plain_code(source: bytes, ignored_name: str) -> str:
    """A module's code in one form, however it is written."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):  # no Python: an extension
        return hashlib.sha256(source).hexdigest()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [line for line in node.body if not _is_text(line) and ignored_name not in _assigned_names(line)]
    return ast.dump(tree)


def _is_text(line: ast.stmt) -> bool:
    return isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)


def _assigned_names(line: ast.stmt) -> list[str]:
    targets = line.targets if isinstance(line, ast.Assign) else [getattr(line, "target", None)]
    return [target.id for target in targets if isinstance(target, ast.Name)]
