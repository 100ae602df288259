"""Which module may import which, checked for every module of radarsim: rooms, roles inside a study, and no circles.

A module's name says what it is: its room and, inside a study, its role. The tables below list what a room or a role
may import of radarsim; anything else is refused. Foreign libraries that are slow to load or that shape an interface
may be imported by a few files only.
"""

import ast
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "radarsim"

STUDIES = sorted(path.parent.name for path in PACKAGE.glob("studies/*/config.py"))
TEMPLATE_FOLDERS = "api/maintenance/one_file", "api/maintenance/one_step"  # what `radarsim new-study` copies

# An entry names one module, or a room: the modules of that package, without those of its rooms in this table.
BASICS = ("errors", "system")  # any other room may import them
SUMS = ("engine.results", "engine.sums")  # the engine's plain data, which studies fill
CASE = ("config.experiment", "config.radial_keys", "config.rare_event_keys")
SCHEMA = (
    *("config.cross_checks", "config.value_text", "config.key_types", "config.marks", "config.model"),
    *("config.quantity_phrase", "config.radial_keys", "config.rare_event_keys", "config.study_keys"),
)
ROOMS = {
    "errors": (),
    "system": (),
    "constants": (),
    "user_code": (),
    "language": (),
    "extensions": ("api", "config", "engine.results", "report.drawing"),  # for a type checker alone
    "config": ("constants", "extensions"),
    "engine": ("engine.store",),
    "engine.store": ("engine.blocks", "engine.machine", "engine.sums"),
    "kernels": ("user_code.files", "user_code.module_sources"),
    "physics": ("constants",),
    "bursts": ("bursts.kernels",),
    "bursts.kernels": ("kernels",),
    "report": ("config", "engine.results", "extensions", "language", "report.drawing"),
    "report.drawing": ("language", "report.math_text", "report.wording"),
    "report.comparison": ("language", "report", "report.drawing"),
    "report.user_filters": ("config.experiment", "engine.results", "language", "report", "report.drawing"),
    "studies": (),
    "studies.noise": ("config.experiment", "config.identity", "kernels.random"),
    "studies.radial_truth": ("config.radial_keys", "constants", "physics"),
    "studies.random_numbers": ("kernels.random",),
    "studies.error_law": (),
    "studies.missed_scans": (),
    "studies.gross_errors": (),
    "studies.plot_arrays": ("studies.random_numbers",),
    "studies.recording_interface": ("config.experiment", "studies.error_law", "studies.plot_arrays"),
    "studies.floors": ("engine.results", "report", "studies.interface"),
    "studies.counted_scans": ("config.experiment", "engine.results", "studies.interface"),
    "studies.long_run": ("config.experiment", "studies.counted_scans", "studies.interface"),
    "studies.best_gain_answer": ("language", "report"),
    "studies.process_noise_answer": (
        *("config.study_keys", "engine.results", "language", "report", "studies.best_gain_answer"),
        *("studies.counted_scans", "studies.interface"),
    ),
    "studies.process_noise_remedy": (
        *("config.experiment", "config.study_keys", "engine.results", "language", "report", "studies.counted_scans"),
        "studies.interface",
    ),
    "studies.interface": (
        *("config.experiment", "config.model", "config.study_keys", *SUMS, "report", "report.drawing"),
        *("studies.counted_scans", "studies.floors", "studies.long_run", "studies.recording_interface"),
    ),
    "studies.onefile": (
        *("config.experiment", "config.model", "config.study_keys", *SUMS, "language", "report", "report.drawing"),
        *("studies.interface", "studies.onefile_recordings", "studies.plot_arrays", "studies.recording_interface"),
        *("studies.process_noise_answer", "studies.process_noise_remedy", "user_code.errors"),
    ),
    "studies.onefile_recordings": (
        *("config.experiment", "studies.onefile", "studies.plot_arrays", "studies.recording_interface"),
    ),
    "studies.linear": (
        *("config.experiment", *SUMS, "kernels", "physics", "report.quantities", "studies.floors"),
        *("studies.linear_design", "studies.linear_exact", "studies.linear_problem", "studies.linear_recordings"),
        *("studies.onefile", "studies.plot_arrays", "studies.recording_interface"),
    ),
    "studies.linear_design": (),
    "studies.linear_exact": ("studies.linear_design",),
    "studies.linear_problem": ("config.experiment", "kernels", "studies.linear_design", "studies.noise"),
    "studies.linear_recordings": (
        *("kernels", "studies.error_law", "studies.gross_errors", "studies.linear", "studies.linear_design"),
        *("studies.missed_scans", "studies.recording_interface"),
    ),
    "studies.stepwise": (
        *("config.experiment", "config.study_keys", "engine.results", "kernels", "report", "report.drawing"),
        *("studies.onefile", "studies.plot_arrays", "studies.recording_interface", "studies.step_blocks"),
        *("studies.step_likelihood", "studies.step_plan", "studies.step_plots", "studies.step_tables"),
        *("studies.step_tracker", "user_code.errors"),
    ),
    "studies.step_blocks": (
        *("kernels", "studies.step_plan", "studies.step_plots", "studies.step_tracker", "studies.stepwise"),
    ),
    "studies.step_checks": ("kernels", "user_code.errors"),
    "studies.step_clutter": (
        *("config.experiment", "engine.results", "language", "report", "report.drawing"),
        *("studies.step_checks", "studies.step_plan", "studies.step_programs", "studies.stepwise"),
    ),
    "studies.step_likelihood": (
        *("kernels", "studies.error_law", "studies.gross_errors", "studies.missed_scans"),
        *("studies.recording_interface", "studies.step_checks", "studies.step_laws"),
        *("studies.step_likelihood_programs", "studies.step_programs", "studies.stepwise", "user_code.errors"),
    ),
    "studies.step_laws": ("kernels", "studies.error_law"),
    "studies.step_likelihood_programs": (
        *("kernels", "studies.step_checks", "studies.step_programs", "studies.stepwise", "user_code.errors"),
    ),
    "studies.step_plan": (
        *("config.experiment", *SUMS, "kernels", "studies.noise", "studies.step_checks", "studies.step_programs"),
        *("studies.stepwise", "user_code.errors"),
    ),
    "studies.step_plots": ("kernels", "studies.plot_arrays", "studies.step_plan", "studies.stepwise"),
    "studies.step_programs": ("kernels", "studies.step_checks", "studies.stepwise"),
    "studies.step_tables": ("engine.results", "report", "studies.stepwise"),
    "studies.planar": (
        *("config.experiment", "config.planar_keys", "engine.results", "kernels", "report", "report.drawing"),
        *("studies.floors", "studies.onefile", "studies.planar_tables", "studies.step_clutter"),
    ),
    "studies.planar_tables": (
        *("config.experiment", "engine.results", "kernels", "language", "report", "report.drawing", "studies.planar"),
    ),
    "studies.plane": (
        *("config.cross_checks", "config.key_types", "config.radial_keys", "config.study_keys", "kernels", "language"),
        *("studies.planar", "studies.stepwise"),
    ),
    "studies.step_tracker": (
        *("kernels.tracing", "studies.missed_scans", "studies.recording_interface", "studies.step_checks"),
        *("studies.stepwise", "user_code.errors"),
    ),
    "studies.user_filters": (
        *("config", *SUMS, "language", "studies.interface", "studies.noise", "studies.plot_arrays"),
        *("studies.random_numbers", "user_code"),
    ),
    "studies.authoring": (
        *("config.cross_checks", "config.key_types", "config.marks", "config.model", "config.radial_keys"),
        *("config.study_keys", "kernels", "physics", "report", "studies.interface", "studies.linear"),
        *("studies.onefile", "studies.plot_arrays", "studies.stepwise"),
    ),
    "studies.registry": (
        *("config", "extensions", "report.quantities", "studies.interface", "studies.user_filters"),
        "user_code.errors",
    ),
    "studies.sources": ("config", "studies.registry", "user_code"),
    "studies.identity": ("config", "engine.blocks", "kernels.random", "studies.registry", "studies.sources"),
    "api": (
        *("api.design", "config", "engine", "engine.store", "extensions", "language"),
        *("report", "report.comparison", "report.drawing", "report.user_filters", "studies.floors"),
        *("studies.identity", "studies.interface", "studies.plot_arrays", "studies.registry", "studies.user_filters"),
    ),
    "api.design": (
        *("api", "config", "engine", "language", "report", "report.drawing", "report.user_filters"),
        *("studies.counted_scans", "studies.registry"),
    ),
    "api.maintenance": (
        *("api", "config", "engine", "engine.store", "extensions", "kernels.cache", "report"),
        *("studies.identity", "studies.registry", "user_code.errors"),
    ),
    "recordings": (
        *("recordings.fit", "recordings.formats", "recordings.registration", "recordings.report"),
        *("api", "cli", "config", "extensions", "language", "report"),
        *("studies.error_law", "studies.plot_arrays", "studies.recording_interface", "studies.registry"),
        "studies.user_filters",
    ),
    "recordings.formats": (
        *(
            "constants",
            "recordings",
            "recordings.fit.folded_doppler",
            "recordings.fit.velocity_faults",
            "language",
            "physics",
        ),
        "report",
    ),
    "recordings.fit": (
        *("recordings", "config", "language", "report", "studies.error_law", "studies.missed_scans"),
        "studies.recording_interface",
    ),
    "recordings.registration": ("constants", "recordings", "recordings.formats", "language", "report"),
    "recordings.report": (
        *("recordings", "recordings.fit", "config", "language", "report", "report.drawing"),
        *("studies.error_law", "studies.recording_interface"),
    ),
    "papers": (  # adds itself by `extensions`; only the names for users import it
        *("api", "bursts", "cli", "config", "engine", "extensions", "kernels", "language", "physics"),
        *("report", "report.drawing", "report.user_filters"),
        *("studies.interface", "studies.onefile", "studies.registry", "studies.sources", "user_code.errors"),
    ),
    "cli": (
        *("__init__", "api", "api.design", "api.maintenance", "config", "engine", "extensions", "language"),
        *("report", "studies.registry"),
    ),
    "__init__": ("api", "api.design", "papers", "recordings.python"),  # the names that users import
    "__main__": ("cli",),
}

# Inside a study: what each role may import of the rooms, and of its own study's roles.
NUMBERS = (
    *("errors", "user_code.errors", "system.threads", "constants", "kernels", "physics", "bursts", "bursts.kernels"),
    *(*CASE, *SUMS, "studies.counted_scans", "studies.long_run"),
)
DISPLAY = ("config.experiment", "engine.results", "kernels", "report", "studies.counted_scans")
DESIGN = ("kernels", "config", "design")
COMPUTED = (*DESIGN, "study")
DISPLAYED = (*COMPUTED, "cost", "tables", "figures")
ROLES = {
    "kernels": (("kernels", "bursts.kernels"), ("kernels",)),
    "config": (("constants", *SCHEMA), ("config",)),
    "design": ((*NUMBERS, "studies.noise", "studies.radial_truth"), DESIGN),  # all that prepares numbers
    "study": ((*NUMBERS, "studies.noise"), COMPUTED),
    "floor": ((*NUMBERS, "studies.floors"), COMPUTED),
    "cost": (("kernels", "system.threads"), COMPUTED),
    "tables": ((*DISPLAY, "bursts"), DISPLAYED),
    "figures": ((*DISPLAY, "report.drawing", "language"), DISPLAYED),
    "answer": (
        (*DISPLAY, "language", "studies.best_gain_answer", "studies.process_noise_answer"),
        (*DISPLAYED, "answer"),
    ),
    "chart": ((*DISPLAY, "report.drawing", "language"), (*COMPUTED, "figures")),
    "tracking": (
        (*NUMBERS, "studies.missed_scans", "studies.noise", "studies.plot_arrays", "studies.recording_interface"),
        (*COMPUTED, "tracking"),
    ),
    "plot_likelihood": (
        (*NUMBERS, "studies.error_law", "studies.gross_errors", "studies.recording_interface"),
        (*COMPUTED, "tracking"),
    ),
    "recorded_plots": (
        ("config.experiment", "constants", "studies.plot_arrays", "studies.recording_interface"),
        (*COMPUTED, "tracking", "plot_likelihood", "recorded_plots"),
    ),
    "__init__": (
        (
            *("config.experiment", "engine.results", "language", "report", "report.drawing", "studies.floors"),
            *("studies.counted_scans", "studies.interface", "studies.plot_arrays", "studies.radial_truth"),
            *("studies.process_noise_answer", "studies.process_noise_remedy", "studies.recording_interface"),
        ),
        (*DISPLAYED, "answer", "chart", "floor", "recorded_plots", "tracking"),
    ),
}
ROLE_BY_LAST_WORD = {"answer": "answer", "keys": "config", "figure": "figures", "figures": "figures"}  # `gain_answer`
ROLE_BY_NAME = {  # modules whose names do not say their role
    "components": "figures",
    "doppler_gain": "chart",
    "hypothesis_fan": "figures",
    "intervals": "tables",
    "one_burst": "study",
    "radar_on_chart": "study",
    "stage_ranking": "figures",
    "turn_errors": "recorded_plots",
}
STUDIES_WITH_PARTS = {"studies.sonar"}  # these modules choose among the parts of a study

LIBRARIES = {  # library: the files and packages that may import it
    "yaml": {"config/yaml_io.py"},
    "matplotlib": {"report/drawing"},
    "dask": {"engine/cluster.py"},
    "distributed": {"engine/cluster.py"},
    "click": {"cli", "papers/commands.py", "recordings/commands.py"},
    "rich": {"cli/console.py", "cli/progress.py"},
    "jinja2": {"report/render_page.py"},
    "numba": {
        *("kernels/compiler.py", "kernels/lanes.py", "kernels/lane_programs.py"),
        *("kernels/numba_internals.py", "kernels/numba_options.py"),
    },
    "llvmlite": {"kernels/lanes.py", "kernels/lane_programs.py", "kernels/numba_internals.py"},
    "pydantic": {"config", "studies/*/config.py", "studies/*/*_keys.py"},
    "pydantic_core": {"config"},
    "pandas": {"report/tables.py", "api/estimate_files.py", "recordings/python.py"},
    "pyarrow": {"recordings/bulk_plots.py", "recordings/formats/parquet_rows.py"},
}


class Place(NamedTuple):
    """Where a module stands: its room; for a module of a study also the study, the part (or ""), and the role."""

    room: str
    study: str = ""
    part: str = ""
    role: str = ""


def place(module: str) -> Place:
    """The place of a module by its name without `radarsim.`: `studies.sonar.clutter.kernels.single_tracks`."""
    names = module.split(".")
    if names[0] != "studies" or len(names) == 1 or names[1] not in STUDIES:
        return Place(room(module))
    inner = names[2:]
    part = inner[0] if inner and (PACKAGE.joinpath(*names[:3]) / "study.py").is_file() else ""
    return Place("study", names[1], part, role(inner[1:] if part else inner))


def room(module: str) -> str:
    """The room of a module: the longest name in ROOMS that contains it, else its package."""
    return max((name for name in ROOMS if lies_in(module, name)), key=len, default=module.split(".")[0])


def role(inner: list[str]) -> str:
    """The role of a module by its path inside a study or a part of one."""
    name = inner[0] if inner else "__init__"
    named_role = name if name in ROLES else ROLE_BY_NAME.get(name)
    return named_role or ROLE_BY_LAST_WORD.get(name.rpartition("_")[2], "design")


def lies_in(module: str, package: str) -> bool:
    """Whether a module is this package or module, or lies in it."""
    return f"{module}.".startswith(f"{package}.")


def fault(importing: str, imported: str) -> str:
    """What is wrong with an import between two modules of radarsim; empty if it is allowed."""
    source, target = place(importing), place(imported)
    if target.room == "papers" and source.room not in ("papers", "__init__"):
        return "nothing else imports the papers"
    if source.room == "papers" and target.room == "study":
        return "" if paper_study(importing) == target.study else "a paper imports its own study alone"
    if source.room != "study":
        if target.room == "study":
            return "no room imports a study"
        allowed = ROOMS[source.room] if source.room in BASICS else (*BASICS, *ROOMS[source.room])
        if source.room == target.room or imported in allowed or target.room in allowed:
            return ""
        return f"{source.room} may import {', '.join(allowed) or 'nothing of radarsim'}"
    rooms, roles = ROLES[source.role]
    if target.room != "study":
        return "" if imported in rooms or target.room in rooms else f"{source.role} may import {', '.join(rooms)}"
    if source.study != target.study:
        return "no study imports another"
    if target.part and source.part != target.part and importing not in STUDIES_WITH_PARTS:
        return "only the study itself imports its parts"
    return "" if target.role in roles else f"{source.role} may import {', '.join(roles)} of its study"


def paper_study(module: str) -> str:
    """The study whose claims a module of the papers has; empty for one that all papers share."""
    return next((name for name in module.split(".")[1:2] if name in STUDIES), "")


def module_name(path: Path) -> str:
    """The name of the module in this file of the package, without `radarsim.`."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


def module_files() -> list[Path]:
    """Every Python file of the package, without the templates of users' packages."""
    templates = [PACKAGE / folder for folder in TEMPLATE_FOLDERS]
    return [path for path in sorted(PACKAGE.rglob("*.py")) if not any(map(path.is_relative_to, templates))]


MODULES = {module_name(path): path for path in module_files()}


class Source(NamedTuple):
    """What a source imports at any depth, what of it when it runs, not for a type checker alone, and its texts."""

    imports: frozenset[str]
    running_imports: frozenset[str]
    texts: frozenset[str]


@cache
def read_source(text: str) -> Source:
    """A source read once, for all tests."""
    imports, running_imports, texts = set(), set(), set()
    waiting: list[tuple[ast.AST, bool]] = [(ast.parse(text), True)]
    while waiting:
        node, runs = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = set(import_names([node]))
            imports |= names
            running_imports |= names if runs else set()
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            texts.add(node.value)
        runs = runs and not is_for_type_checker(node)
        waiting += [(child, runs) for child in ast.iter_child_nodes(node)]
    return Source(frozenset(imports), frozenset(running_imports), frozenset(texts))


def is_for_type_checker(node: ast.AST) -> bool:
    """Whether this is `if TYPE_CHECKING`, or an `if` that names it otherwise."""
    return isinstance(node, ast.If) and any(
        "TYPE_CHECKING" in (getattr(part, "id", ""), getattr(part, "attr", "")) for part in ast.walk(node.test)
    )


def imported_modules(body: Iterable[ast.stmt]) -> frozenset[str]:
    """The modules that statements import at any depth."""
    return frozenset(import_names(node for statement in body for node in ast.walk(statement)))


def import_names(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """What nodes import; `from package import name` counts as package.name where that is a module."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield name if name_in_radarsim(name) in MODULES else str(node.module)


def name_in_radarsim(module: str) -> str | None:
    """The name of a module without `radarsim.`; None for a module of another package."""
    package, _, rest = module.partition(".")
    return rest or "__init__" if package == "radarsim" else None


imported, ours = imported_modules, name_in_radarsim  # as tests/test_lean.py calls them


def radarsim_imports(text: str, with_types: bool = True) -> set[str]:
    """The modules of radarsim that a source imports, without `radarsim.`."""
    source = read_source(text)
    names = source.imports if with_types else source.running_imports
    return {name for name in map(name_in_radarsim, names) if name is not None}


def faults(module: str, text: str) -> list[str]:
    """The imports that a module of this name and source may not have, and why."""
    pairs = [(name, fault(module, name)) for name in sorted(radarsim_imports(text))]
    return [f"{module} → {name}: {reason}" for name, reason in pairs if reason]


@cache
def text_of(module: str) -> str:
    return MODULES[module].read_text(encoding="utf-8")


def test_every_import_is_allowed():
    assert [line for module in MODULES for line in faults(module, text_of(module))] == []


def test_every_module_is_checked():
    templates = {path for folder in TEMPLATE_FOLDERS for path in (PACKAGE / folder).rglob("*.py")}
    assert set(MODULES.values()) == set(PACKAGE.rglob("*.py")) - templates
    assert len(templates) == 4
    assert {place(module).room for module in MODULES} == {*ROOMS, "study"}
    assert {place(module).role for module in MODULES if place(module).room == "study"} == set(ROLES)
    assert len(MODULES) > 500


def test_every_entry_of_the_tables_is_needed():
    uses = defaultdict(set)
    for module in MODULES:
        for name in radarsim_imports(text_of(module)):
            uses[place(module).room] |= {name, place(name).room}
    assert {name: unused for name, allowed in ROOMS.items() if (unused := set(allowed) - uses[name])} == {}
    assert {entry for rooms, _ in ROLES.values() for entry in rooms} <= uses["study"]
    in_studies = {name for module in MODULES if place(module).room == "study" for name in module.split(".")[2:]}
    assert set(ROLE_BY_NAME) <= in_studies
    assert {name for _, roles in ROLES.values() for name in roles} <= set(ROLES)


PLANTED = [
    ("errors", "radarsim.config.model"),
    ("config.model", "radarsim.studies.registry"),
    ("engine.results", "radarsim.report.tables"),
    ("engine.store.store", "radarsim.engine.collect"),
    ("kernels.linear_states", "radarsim.physics.motion"),
    ("kernels.tracing", "radarsim.user_code.errors"),
    ("report.panel_layout", "radarsim.studies.sonar.study"),
    ("report.drawing.canvas", "radarsim.report.tables"),
    ("report.tables", "radarsim.report.user_filters.tables"),
    ("recordings.track", "radarsim.papers.claim"),
    ("recordings.formats.nmea", "radarsim.recordings.registration.register"),
    ("api.result", "radarsim.papers.claims_table"),
    ("api.run", "radarsim.cli.console"),
    ("api.run", "radarsim.api.maintenance.doctor"),
    ("studies.interface", "radarsim.papers.claim"),
    ("studies.interface", "radarsim.studies.registry"),
    ("studies.user_filters.plots", "radarsim.studies.registry"),
    ("papers.sonar.measures", "radarsim.studies.range_doppler.tables"),
    ("papers.claim", "radarsim.studies.sonar.tables"),
    ("studies.range_doppler.kernels.missed_block", "radarsim.studies.range_doppler.filter_design"),
    ("studies.range_doppler.config", "radarsim.studies.range_doppler.filter_design"),
    ("studies.range_doppler.filter_design", "radarsim.report.tables"),
    ("studies.range_doppler.filter_design", "radarsim.studies.range_doppler.study"),
    ("studies.range_doppler.study", "radarsim.studies.range_doppler.tables"),
    ("studies.sonar.sensor_keys", "radarsim.studies.sonar.filter_design"),
    ("studies.multimodel.tables", "radarsim.studies.sonar.tables"),
    ("studies.sonar.manoeuvre.study", "radarsim.studies.sonar.clutter.study"),
    ("studies.sonar.study", "radarsim.studies.sonar.clutter.study"),
]


@pytest.mark.parametrize(("module", "planted"), PLANTED)
def test_a_planted_import_is_refused(module, planted):
    package, _, name = planted.rpartition(".")
    assert faults(module, text_of(module)) == []
    for form in (f"import {planted}", f"from {package} import {name}", f"def f():\n    import {planted}"):
        assert len(faults(module, form)) == 1


def import_circle(imports_by_module: Mapping[str, Iterable[str]]) -> list[str]:
    """A circle among modules that import each other, its first module also last; empty if there is none."""
    try:
        TopologicalSorter(imports_by_module).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def running_imports() -> dict[str, set[str]]:
    """What each module imports of radarsim when it runs, within functions too."""
    return {module: radarsim_imports(text_of(module), with_types=False) - {module} for module in MODULES}


def test_no_modules_import_each_other():
    assert import_circle(running_imports()) == []


@pytest.mark.parametrize(
    ("text", "length"),
    [
        ("import radarsim.report.tables", 3),
        ("def f():\n    from radarsim.report import tables", 3),
        ("if TYPE_CHECKING:\n    import radarsim.report.tables", 0),
        ("def f():\n    if typing.TYPE_CHECKING:\n        import radarsim.report.tables", 0),
    ],
)
def test_a_planted_circle_is_seen(text, length):
    """The tables import the results, and these are made to import the tables."""
    planted = radarsim_imports(text, with_types=False)
    circle = import_circle({"report.tables": {"engine.results"}, "engine.results": planted, "errors": set()})
    assert len(circle) == length
    assert set(circle) <= {"report.tables", "engine.results"}


@cache
def library_users() -> dict[str, set[str]]:
    """By library, the files that import it when they run, by their path in the package."""
    users: dict[str, set[str]] = defaultdict(set)
    for module, path in MODULES.items():
        for name in read_source(text_of(module)).running_imports:
            users[name.split(".")[0]].add(path.relative_to(PACKAGE).as_posix())
    return users


def test_foreign_libraries_are_fenced_in():
    users = {(file, library) for library in LIBRARIES for file in library_users()[library]}
    assert {(file, library) for file, library in users if not may_import(file, library)} == set()


def test_every_fence_has_a_library_behind_it():
    assert {library for library in LIBRARIES if not library_users()[library]} == set()


def may_import(file: str, library: str) -> bool:
    """Whether a file is listed for a library, or lies in a package that is; * stands for a name or a part of one."""
    path = Path(file)
    return any(path.match(home) or path.is_relative_to(home) for home in LIBRARIES[library])


@pytest.mark.parametrize(
    ("file", "library", "allowed"),
    [
        ("config/yaml_io.py", "yaml", True),
        ("config/load.py", "yaml", False),
        ("studies/sonar/config.py", "pydantic", True),
        ("studies/sonar/sensor_keys.py", "pydantic", True),
        ("studies/sonar/study.py", "pydantic", False),
        ("report/drawing/ticks.py", "matplotlib", True),
        ("report/time_figures.py", "matplotlib", False),
        ("kernels/lanes.py", "numba", True),
        ("kernels/linear_states.py", "numba", False),
    ],
)
def test_a_fence_holds(file, library, allowed):
    assert may_import(file, library) is allowed


def test_only_the_registry_names_the_studies_modules():
    modules = {
        module
        for module in MODULES
        if place(module).room != "study"
        if any(f"studies.{study}" in text for text in read_source(text_of(module)).texts for study in STUDIES)
    }
    assert modules == {"studies.registry"}


MAX_ARGUMENTS, MAX_LINES = 12, 60  # of a function of the kernels; entries from Python take arrays one by one


def long_functions(text: str) -> list[str]:
    """Functions of a kernels' module that have too many arguments and are no compiled entry, or too many lines."""
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    return [
        function.name
        for function in functions
        if line_count(function) > MAX_LINES
        or (len(function.args.args) > MAX_ARGUMENTS and "kernel" not in map(ast.unparse, function.decorator_list))
    ]


def line_count(function: ast.FunctionDef) -> int:
    """The lines of a function, without those of functions in its body, which are counted for themselves."""
    inner = sum(line_count(node) for node in function.body if isinstance(node, ast.FunctionDef))
    return function.end_lineno - function.lineno + 1 - inner


def test_kernels_read_like_the_book():
    kernels = [module for module in MODULES if "kernels" in module.split(".")]
    assert {module: names for module in kernels if (names := long_functions(text_of(module)))} == {}
