"""What the reference pages are read off: descriptions of keys with units, docstrings, columns of result files."""

import ast
import inspect
import re
from collections import defaultdict
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from making import commands, generated, keys, modules, tables

import radarsim
from radarsim.api.judge import judge
from radarsim.api.run import run
from radarsim.cli.command_group import main
from radarsim.config.json_schema import json_schema
from radarsim.studies import registry
from tests.trust.cases import CASES, MORE, Small

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted(path.relative_to(ROOT) for path in (ROOT / "examples").iterdir() if path.is_dir())
UNITS = {
    "m": r"\bm\b",
    "s": r"\bs\b",
    "mps": "m/s",
    "mps2": "m/s²",
    "mps3": "m/s³",
    "rad": r"\brad\b",
    "radps": "rad/s",
    "deg": "in degrees",
    "degps": "in degrees",
    "hz": r"\bHz\b",
    "g": "standard gravities",
    "kgpm2": "kg/m²",
}
# Of a number whose key has no unit: the units of its parts, or the word that says it has none.
PURE = r"m/s|Hz|\bs\b|\bm\b|rad\b|probabilit|correlation|factor|ratio|standard (?:dev|err)|samples' unit|km²|no unit"
DEFINITIONS = json_schema(registry)["$defs"]
KEYS = [(name, key) for name, model in DEFINITIONS.items() for key in model.get("properties", {})]


def takes_a_number(part):
    """Whether a key's value is a number that need not be whole, or holds such."""
    inner = [part.get("items"), part.get("additionalProperties"), *part.get("prefixItems", ())]
    inner += [*part.get("anyOf", ()), *part.get("oneOf", ())]
    return part.get("type") == "number" or any(takes_a_number(one) for one in inner if isinstance(one, dict))


def test_every_key_is_described_with_its_unit():
    for name, key in KEYS:
        part = DEFINITIONS[name]["properties"][key]
        about = part["description"]
        suffix = key.rpartition("_")[2] if "_" in key else ""
        if suffix in UNITS or takes_a_number(part):
            assert re.search(UNITS.get(suffix, PURE), about), (name, key)


def test_every_public_function_says_what_it_does():
    for module in modules.every_module():
        assert module.__doc__, module
        assert not [name for name, thing in modules.public(module) if not thing.__doc__], module


def test_public_names_are_seen():
    from radarsim.kernels import second_order
    from radarsim.studies.range_doppler import error_recursion

    seen = {name for name, _ in modules.public(error_recursion)}
    assert {"error_recursion", "start_errors"} <= seen
    assert not {"np", "pack"} & seen  # imported
    assert "simulate_block" in dict(modules.public(second_order))  # compiled ones too


@pytest.mark.slow
def test_arrays_are_told_with_their_shapes():
    """Of what is public in the floors that work on arrays: a docstring that names shapes, where arrays come or go."""
    silent = []
    shown = ("study", "track", "scene", "sums", "tables", "figures", "words", "claims", "measures")
    for floor in ("physics", "studies"):
        for module in modules.every_module():
            if module.__name__.startswith(f"radarsim.{floor}.") and module.__name__.split(".")[-1] not in shown:
                for name, thing in modules.public(module):
                    hints = getattr(thing, "__annotations__", {})
                    has_arrays = any(np.ndarray is hint for hint in hints.values())
                    text = thing.__doc__ + " ".join(re.findall("#: .*", inspect.getsource(thing)))  # of fields
                    if has_arrays and not re.search(r"\([^)]*,[^)]*\)|any shape|per |×|\[|see `", text):
                        silent.append(f"{module.__name__}.{name}")
    assert silent == []


def test_reference_holds_every_key_and_every_command():
    text = keys.markdown()
    assert not [key for _, key in KEYS if f"`{key}`" not in text]
    assert text.count("\n## study: ") == len(registry.study_names())
    made = commands.markdown()
    assert not [name for name in main.list_commands(None) if f"## radarsim {name}\n" not in made]
    assert made.count("\n  -h, --help ") == len(main.list_commands(None)) + 1  # as in the terminal


def test_marks_are_replaced_and_unknown_ones_refused():
    source = ["a\n\n<!-- generated: commands -->\n"]
    generated.fill(None, "page", source)
    assert "## radarsim run" in source[0]
    with pytest.raises(KeyError):
        generated.fill(None, "page", ["<!-- generated: nothing -->"])


def test_every_part_that_is_generated_stands_in_a_page():
    pages = [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
    found = [name for page in pages for name in generated.MARK.findall(page.read_text(encoding="utf-8"))]
    assert sorted(found) == sorted(generated.PARTS)


# As few small cases as write every table and column that any shipped config writes.
WRITING = [
    *(CASES[name] for name in ("range_doppler", "multimodel", "sonar_manoeuvre")),
    *(MORE[name] for name in ("rare_folds", "rare_losses", "rare_tracks", "plane_clutter")),
    *(Small(*of, 200, 0) for of in (("sonar_smoothing", ("scans=8",)), ("sonar_conversion", ("scans=3",)))),
    Small("pulses_folds", ("scans=3",), 20, 0),
]


@pytest.fixture(scope="module")
def written():
    """Columns that runs write, by study and table."""
    found = defaultdict(set)
    judged = judge("rls2", lambda plots: (plots["range_m"], np.full((plots.n, 15, 1, 1), 250.0**2)), realisations=20)
    for result in (judged, *(run(small.loaded(20)) for small in WRITING)):
        for table, rows in result.tables.items():
            found[result.experiment.study, table] |= set(rows.columns)
    return found


@pytest.fixture(scope="module")
def declared():
    """Columns that docstrings declare, by study and table; None: of every table, of every study."""
    found = defaultdict(set)
    for one in (*tables.SHARED, *(one for functions in tables.SEVERAL.values() for one in functions)):
        found[None, None] |= own_names(one)
    for study in registry.SHIPPED:
        for module in tables.modules(study):
            found[study, None] |= own_names(module)
            for name, (function, _) in module.table.makers.items():
                found[study, name] |= own_names(function)
    return found


def own_names(thing):
    return {name for column in tables.read(thing)[1] for name in column.names}


def test_every_column_that_a_run_writes_is_declared(written, declared):
    for (study, table), names in written.items():
        known = declared[None, None] | declared[study, None] | declared[study, table]
        assert table == "claims" or not {one for one in names - known if not one.startswith("exact_")}, (study, table)


def test_every_declared_column_is_written(written, declared):
    for (study, table), names in declared.items():
        rows = [own for at, own in written.items() if study in (at[0], None) and table in (at[1], None)]
        assert not names - set().union(*rows), (study, table)


def test_a_line_that_declares_nothing_is_refused():
    def table():
        """A table.

        rate ± lock: of bursts
        and what they are
        """

    with pytest.raises(ValueError, match="table: a line of columns must be `name: meaning`"):
        tables.read(table)
    assert tables.with_ends("rate ± lock") == ("rate", "lock_lo", "lock_hi")
    assert tables.with_ends("rate ±") == ("rate", "rate_lo", "rate_hi")
    assert tables.units(("t_s", "gain_percent")) == "s, %"


def test_files_and_claims_stand_among_the_result_files(tmp_path):
    result = run("rls2", realisations=50, out=tmp_path, figures=False)
    told = (ROOT / "docs/results.md").read_text(encoding="utf-8") + tables.markdown()
    words = set(re.findall(r"\w+", " ".join(re.findall(r"`[^`]+`", told))))
    assert not [file.name for file in (tmp_path / "rls2").iterdir() if file.is_file() and file.stem not in words]
    assert not set(result.tables["claims"].columns) - words


def stable_names():
    """By module, the names on the page of stable names."""
    rows = re.findall(
        r"^\| `([\w.]+)` \| (.+) \|$", (ROOT / "docs/reference/stability.md").read_text(encoding="utf-8"), re.M
    )
    return {module: re.findall(r"`(\w+)`", names) for module, names in rows}


def test_stable_names_exist_and_are_all_that_the_package_exports():
    stable = stable_names()
    missing = [
        (module, name) for module in stable for name in stable[module] if not hasattr(import_module(module), name)
    ]
    assert missing == []
    assert stable["radarsim"] == sorted(radarsim.__all__)


@pytest.mark.parametrize(
    "folder", ["radarsim/api/maintenance/one_file", "radarsim/api/maintenance/one_step", *map(str, EXAMPLES)]
)
def test_packages_that_users_start_from_import_only_stable_names(folder):
    stable = stable_names()
    files = [file for file in sorted((ROOT / folder).rglob("*.py")) if "tests" not in file.parts]
    imports = [node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
    used = {(node.module, name.name) for node in imports if isinstance(node, ast.ImportFrom) for name in node.names}
    ours = {(module, name) for module, name in used if module and module.split(".")[0] == "radarsim"}
    assert ours
    assert [(module, name) for module, name in sorted(ours) if name not in stable.get(module, ())] == []
