"""The arrows of the house, by role: which module may import which, over every module of radarsim, none exempt.

A module's name says what it is: its room, and inside a study its role. What a room or a role may import is listed
below; anything else of ours is refused. Foreign libraries that are costly or that shape an interface are fenced in.
"""

import ast
import itertools
from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "radarsim"

STUDIES = sorted(path.name for path in (PACKAGE / "studies").iterdir() if (path / "__init__.py").is_file())
ON_THE_OUTSIDE = "app/one_file", "app/one_step"  # studies in one file, which stand on what all packages may use
DATA = ("engine.results",)  # the engine's plain data, which studies fill
CASE = ("config.experiment", "config.fields")
ROOMS = {
    "errors": (),
    "failures": ("errors",),
    "language": ("errors",),
    "config": ("errors", "constants", "extensions", "private_files"),
    "extensions": ("app", "config", "engine", "report"),  # for a type checker alone
    "threads": (),
    "private_files": (),
    "module_sources": ("errors",),
    "engine": ("errors", "threads", "private_files"),
    "kernels": ("module_sources", "private_files"),
    "constants": (),
    "physics": ("constants",),
    "bursts": ("constants", "kernels", "physics"),
    "report": ("errors", "extensions", "failures", "config", "language", "private_files", *DATA),
    "studies.noise": (*CASE, "kernels.random"),
    "studies.radial": ("errors", "constants", "physics"),
    "studies.floor": (*DATA, "report", "studies.interface"),
    "studies.interface": ("errors", *CASE, *DATA, "report", "studies.floor"),
    "studies.folder": (*CASE, *DATA, "report.drawing", "report.quantities", "studies.interface"),
    "studies.onefile": ("errors", "failures", "language", *CASE, *DATA, "report", "studies.interface"),
    "studies.linear": (
        *("errors", "kernels", "physics", *CASE, *DATA),
        *("report.quantities", "studies.floor", "studies.interface", "studies.noise", "studies.onefile"),
    ),
    "studies.outside": ("errors", *CASE, *DATA, "studies.interface"),
    "studies.stepwise": (
        *("errors", "failures", *CASE, *DATA, "kernels", "report"),
        *("studies.interface", "studies.noise", "studies.onefile"),
    ),
    "studies.code": (
        *("errors", "failures", "language", "config", "studies.interface", "studies.outside"),
        *("module_sources", "studies.user_code_recording", "studies.user_code_sources"),
    ),
    "studies.user_code_recording": ("module_sources", "studies.user_code_sources"),
    "studies.user_code_sources": ("errors", "failures", "module_sources", "config.experiment"),
    "studies.registry": (
        *("errors", "extensions", "failures", "config", "report.quantities"),
        *("studies.code", "studies.interface", "studies.outside"),
    ),
    "studies.sources": ("config", "module_sources", "studies.registry", "studies.user_code_sources"),
    "studies.identity": ("config", "engine.blocks", "kernels.random", "studies.registry", "studies.sources"),
    "app": (
        *("errors", "extensions", "threads", "private_files", "config", "language", "engine", "kernels", "physics"),
        *("report", "studies", "recorded"),
    ),
    "papers": (  # above all others: it adds itself by `extensions`, and none imports it
        *(
            "errors",
            "extensions",
            "failures",
            "threads",
            "bursts",
            "config",
            "language",
            "engine",
            "kernels",
            "physics",
        ),
        *("report", "studies", "app", "cli"),
    ),
    "cli": (
        *(
            "errors",
            "extensions",
            "config",
            "language",
            "engine",
            "kernels",
            "physics",
            "report",
            "studies",
            "recorded",
            "app",
        ),
        *("__init__", "threads"),
    ),
    "__init__": ("errors", "app", "papers"),  # the names that users import
    "__main__": ("cli",),
}

# Inside a study: what of the shared rooms a role stands on, and on which roles of its own study.
GROUND = ("errors", "failures", "threads", "constants", "kernels", "physics", "bursts", *CASE)
KEYS = ("errors", "constants", "config.document", "config.fields", "physics")
DESIGN = ("kernels", "config", "design")
SUMS = (*DESIGN, "study")
SHOWN = (*SUMS, "cost", "tables", "figures")
READ = (*SHOWN, "words")
ROLES = {
    "kernels": (("kernels", "bursts.kernels"), ("kernels",)),
    "config": (KEYS, ("config",)),
    "design": (
        (*GROUND, *DATA, "studies.noise", "studies.radial"),
        DESIGN,
    ),  # world, filters, exact, and whatever else prepares numbers
    "study": ((*GROUND, *DATA, "studies.noise"), SUMS),
    "floor": ((*GROUND, *DATA, "studies.floor"), SUMS),
    "cost": ((*GROUND, *DATA), (*SUMS, "cost")),
    "tables": ((*GROUND, *DATA, "report"), SHOWN),
    "figures": ((*GROUND, *DATA, "report", "language"), (*SHOWN, "track")),  # of one realisation, followed as a record
    "words": ((*GROUND, *DATA, "report", "language"), READ),
    "measures": ((*GROUND, *DATA, "report", "papers"), READ),  # of a package; those shipped lie in the papers
    "chart": ((*GROUND, *DATA, "report", "language"), READ),
    "track": ((*GROUND, *DATA, "studies.noise", "studies.interface"), (*SUMS, "track")),
    "__init__": (
        (*CASE, *DATA, "studies.interface", "studies.floor", "language", "report.drawing", "report.quantities"),
        (*READ, "track", "chart", "floor", "__init__"),
    ),
}

LIBRARIES = {  # library: the files and rooms that may import it
    "yaml": {"config/load.py"},
    "matplotlib": {"report/figures.py"},
    "dask": {"engine/cluster.py"},
    "distributed": {"engine/cluster.py"},
    "click": {"cli", "papers/commands.py"},
    "rich": {"cli/console.py"},
    "jinja2": {"report/html.py"},
    "numba": {"kernels/compile.py", "kernels/lanes.py", "kernels/numba_internals.py", "kernels/numba_options.py"},
    "llvmlite": {"kernels/lanes.py", "kernels/numba_internals.py"},
    "pydantic": {"config", "studies/*/config.py"},
    "pydantic_core": {"config/check.py", "config/fields.py", "config/load.py"},
    "pandas": {"report/tables.py", "report/precision.py", "app/judge.py", "recorded/python.py"},
}


class Place(NamedTuple):
    """Where a module stands: its room; of a study's module the study, the variant (or ""), and the role."""

    room: str
    study: str = ""
    variant: str = ""
    role: str = ""


def place(module: str) -> Place:
    """The place of a module by its name without `radarsim.`: `studies.sonar.clutter.kernels.tracker`."""
    parts = module.split(".")
    if parts[0] != "studies" or len(parts) == 1:
        return Place(parts[0])
    if parts[1] not in STUDIES:
        return Place(".".join(parts[:2]))
    inner = parts[2:]
    variants = [inner[0]] if inner and (PACKAGE.joinpath(*parts[:3]) / "study.py").is_file() else []
    return Place("study", parts[1], "".join(variants), role(inner[len(variants) :]))


def role(inner: list[str]) -> str:
    """The role of a module by its path inside a study or a variant of one."""
    name = inner[0] if inner else "__init__"
    return name if name in ROLES else "design"


def under(module: str, homes) -> bool:
    """Whether a module is one of these, or lies in one of these rooms."""
    return any(f"{module}.".startswith(f"{home}.") for home in homes)


def fault(importing: str, imported: str) -> str:
    """What is wrong with an import between modules of ours; nothing, if it is allowed."""
    here, there = place(importing), place(imported)
    if there.room == "papers" and here.room not in ("papers", "__init__") and not importing.startswith("template."):
        return "the core knows no papers"
    if here.room == "papers" and there.room == "study":
        return "" if paper_study(importing) == there.study else "a paper knows its own study alone"
    if here.room != "study":
        if there.room == "study":
            return "no shared room knows a study"
        if here.room == there.room or under(imported, ROOMS[here.room]):
            return ""
        return f"{here.room} stands on {', '.join(ROOMS[here.room]) or 'nothing of ours'}"
    ground, own = ROLES[here.role]
    if there.room != "study":
        return "" if under(imported, ground) else f"a study's {here.role} stands on {', '.join(ground)}"
    if here.study != there.study:
        return "no study knows another"
    if there.variant and here.variant != there.variant and importing not in CHOOSE:
        return "a variant is known to itself and where it is chosen"
    return "" if there.role in own else f"a study's {here.role} stands on its {', '.join(own)}"


def paper_study(module: str) -> str:
    """The study whose claims a module of the papers has; empty for one that all papers share."""
    return module.split(".")[1] if len(module.split(".")) > 2 or module.split(".")[-1] in STUDIES else ""


CHOOSE = {"studies.sonar"}  # where the variants of a study are chosen


def modules() -> dict[str, Path]:
    """Every module, by its name without `radarsim.`."""
    found = {named(path.relative_to(PACKAGE)): path for path in sorted(PACKAGE.rglob("*.py"))}
    apart = tuple(f"{PACKAGE / place}/" for place in ON_THE_OUTSIDE)
    return {name: path for name, path in found.items() if not str(path).startswith(apart)}


def named(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


MODULES = modules()


class Imports(NamedTuple):
    """The modules that a source imports: at any depth, and without what is for a type checker alone."""

    all: frozenset[str]
    running: frozenset[str]


@cache
def imports(text: str) -> Imports:
    """Every module that a source imports, relative imports excluded."""
    body = ast.parse(text).body
    typed = [node for node in body if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)]
    running = imported(node for node in body if node not in typed)
    return Imports(running | imported(typed), running)


def imported(body: Iterable[ast.stmt]) -> frozenset[str]:
    """The modules that statements import; `from package import name` counts as package.name where that is a module."""
    found = set()
    for node in itertools.chain.from_iterable(map(ast.walk, body)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            of_modules = {name for name in inner if ours(name) in MODULES}
            found |= of_modules | ({node.module} if len(of_modules) < len(inner) else set())
    return frozenset(found)


def ours(module: str) -> str | None:
    """A module of ours by its name here; None for any other."""
    first, _, rest = module.partition(".")
    return rest or "__init__" if first == "radarsim" else None


def faults(module: str, text: str) -> list[str]:
    """The imports of ours that a module of this name and source may not have, and why."""
    wanted = sorted(name for name in map(ours, imports(text).all) if name is not None)
    return [f"{module} → {name}: {words}" for name in wanted if (words := fault(module, name))]


def text_of(module: str) -> str:
    return MODULES[module].read_text(encoding="utf-8")


def test_arrows_point_downwards():
    assert {module: found for module in MODULES if (found := faults(module, text_of(module)))} == {}


def test_every_module_is_looked_at():
    here = {PACKAGE / "__init__.py", *PACKAGE.rglob("*.py")}
    here -= {file for place in ON_THE_OUTSIDE for file in (PACKAGE / place).rglob("*.py")}
    assert set(MODULES.values()) == here
    assert {place(module).room for module in MODULES} == {*ROOMS, "studies", "study"}
    assert {place(module).role for module in MODULES if place(module).room == "study"} == set(ROLES)
    assert len(MODULES) > 150


PLANTED = [
    ("errors", "radarsim.config.fields"),
    ("config.fields", "radarsim.studies.registry"),
    ("engine.results", "radarsim.report.tables"),
    ("kernels.linear", "radarsim.physics"),
    ("report.panels", "radarsim.studies.sonar.study"),
    ("recorded.follow", "radarsim.cli.console"),
    ("app.result", "radarsim.papers.claims_table"),
    ("studies.interface", "radarsim.papers.claim"),
    ("papers.sonar.measures", "radarsim.studies.range_doppler.tables"),
    ("papers.claim", "radarsim.studies.sonar.tables"),
    ("studies.range_doppler.kernels.missed", "radarsim.studies.range_doppler.filters"),
    ("kernels.traced", "radarsim.failures"),
    ("studies.range_doppler.config", "radarsim.studies.range_doppler.filters"),
    ("studies.range_doppler.filters", "radarsim.report.tables"),
    ("studies.range_doppler.study", "radarsim.studies.range_doppler.tables"),
    ("studies.multimodel.tables", "radarsim.studies.sonar.tables"),
    ("studies.sonar.manoeuvre.study", "radarsim.studies.sonar.clutter.study"),
]


@pytest.mark.parametrize(("module", "imported"), PLANTED)
def test_a_planted_import_is_refused(module, imported):
    package, _, name = imported.rpartition(".")
    text = text_of(module)
    assert faults(module, text) == []
    for form in (f"import {imported}", f"from {package} import {name}", f"def f():\n    import {imported}"):
        assert len(faults(module, f"{text}\n{form}\n")) == 1


@cache
def users() -> dict[str, set[str]]:
    """By library, the files that import it when they run, by their path in the package."""
    found: dict[str, set[str]] = defaultdict(set)
    for module, path in MODULES.items():
        for name in imports(text_of(module)).running:
            found[name.split(".")[0]].add(path.relative_to(PACKAGE).as_posix())
    return found


def test_foreign_libraries_are_fenced_in():
    outside = {(user, name) for name, homes in LIBRARIES.items() for user in users()[name] if not at_home(user, homes)}
    assert outside == set()


def at_home(file: str, homes: set[str]) -> bool:
    """Whether a file is one of these, or lies in one of these rooms; * stands for any folders."""
    path = Path(file)
    return any(path.match(home) and file.startswith(home.partition("*")[0]) for home in homes) or under(
        file.replace("/", "."), {home for home in homes if "*" not in home and not home.endswith(".py")}
    )


@pytest.mark.parametrize(
    ("file", "library", "good"),
    [
        ("config/load.py", "yaml", True),
        ("studies/sonar/config.py", "pydantic", True),
        ("studies/sonar/study.py", "pydantic", False),
        ("kernels/lanes.py", "numba", True),
        ("kernels/linear.py", "numba", False),
    ],
)
def test_a_fence_holds(file, library, good):
    assert at_home(file, LIBRARIES[library]) is good


def test_only_the_registry_names_the_studies_modules():
    named = {
        module
        for module in MODULES
        if place(module).room != "study"
        for node in ast.walk(ast.parse(text_of(module)))
        if isinstance(node, ast.Constant)
        if isinstance(node.value, str) and any(f"studies.{study}" in node.value for study in STUDIES)
    }
    assert named == {"studies.registry"}


MOST_ARGUMENTS, LONGEST = 12, 60  # of a function of the kernels; entries from Python take arrays one by one


def too_long(text: str) -> list[str]:
    """Functions of a kernels' module that have too many arguments and are no compiled entry, or too many lines."""
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    return [
        node.name
        for node in functions
        if node.end_lineno - node.lineno >= LONGEST
        or (len(node.args.args) > MOST_ARGUMENTS and "kernel" not in [ast.unparse(by) for by in node.decorator_list])
    ]


def test_kernels_read_like_the_book():
    kernels = [module for module in MODULES if "kernels" in module.split(".")]
    assert {module: names for module in kernels if (names := too_long(text_of(module)))} == {}
