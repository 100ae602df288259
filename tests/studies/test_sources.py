"""Which modules compute the numbers of a case: all that run while blocks are made, and none that only shows them."""

import ast
import json
import os
import py_compile
import sys
from pathlib import Path
from py_compile import PycInvalidationMode

import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.studies import registry, sources
from radarsim.user_code import module_sources

PACKAGE = Path(radarsim.__file__).parent
CONFIGS = {
    "range_doppler": ["rls2", "rls3"],
    "multimodel": ["multimodel"],
    "sonar": ["sonar_smoothing", "sonar_manoeuvre", "sonar_clutter_rare", "sonar_clutter_ends"],
    "discriminator": ["discriminator", "discriminator_rare"],
    "ambiguous_doppler": ["ambiguous_rls4", "ambiguous_rare"],
    "pulses_to_tracks": ["pulses"],
    "plane": ["plane_clutter"],
}
COMPUTE = """
import json, sys
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.engine.collect import collect
from radarsim.studies import sources
modules = set()
for config in json.loads(sys.argv[1]):
    case = load(config).cases[0]
    modules |= sources.computing_modules(sources._first_modules(case))
    collect(CaseWork(case), 2, store=sys.argv[2], threads=0)
loaded = [name for name in sys.modules if name.startswith("radarsim")]
print(json.dumps([loaded, sorted(modules)]))
"""
# What reads a config, or says what is wrong or shown, changes no number.
READ_AND_SHOW = (
    *("radarsim.api.configs", "radarsim.config", "radarsim.errors", "radarsim.extensions", "radarsim.language"),
    *("radarsim.papers", "radarsim.recordings.extension", "radarsim.report"),
)
USER_FILTER = """
import numpy as np

def last_range(plots):
    return next(iter(plots.columns.values()))[:, :, None]
"""


def is_within(name, packages):
    return any(f"{name}.".startswith(f"{package}.") for package in packages)


def with_user_filter(config, folder):
    """A shipped config with a filter of a user's in a folder."""
    (folder / "mine.py").write_text(USER_FILTER)
    case = load(config).cases[0]
    members = [*case.keys["filters"], {"name": "mine", "python": "mine.py:last_range"}]
    return {"study": case.study, "realisations": 2, **case.keys, "filters": members}


@pytest.mark.slow_cases_except("range_doppler", "sonar_missed")
@pytest.mark.parametrize("study", [*registry.SHIPPED, "rls2", "sonar_missed", "sonar_manoeuvre", "ambiguous_rls4"])
def test_every_module_that_is_loaded_while_blocks_are_made_counts(study, libraries, tmp_path):
    configs = CONFIGS.get(study) or [with_user_filter(study, tmp_path)]
    done = libraries.run(json.dumps(configs), tmp_path / "out", code=COMPUTE, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    loaded, computing = map(set, json.loads(done.stdout))
    assert {name for name in loaded - computing if not is_within(name, READ_AND_SHOW)} <= {
        "radarsim.api",
        "radarsim.recordings",
    }
    assert len(computing) > 40


@pytest.mark.parametrize("study", registry.SHIPPED)
def test_no_module_that_only_shows_results_counts(study):
    for config in CONFIGS[study]:
        modules = sources.computing_modules(sources._first_modules(load(config).cases[0]))
        of_study = {name.rpartition(".")[2] for name in modules if is_within(name, [registry.SHIPPED[study]])}
        assert of_study & {"study", "plane"}  # a study in one file is that file
        assert not of_study & {
            "tables",
            "figures",
            "answer",
            "measures",
            "interpretations",
            "recorded_plots",
            "doppler_gain",
        }


def imports_by_syntax(path):
    """The modules of ours that a source imports, by its syntax tree, without those for a type checker alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            node.body = []
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in names if is_within(name, ["radarsim"]) and module_file(name)}


def module_file(name):
    path = PACKAGE.parent.joinpath(*name.split("."))
    return next((file for file in (path / "__init__.py", path.with_suffix(".py")) if file.is_file()), None)


def test_imports_are_those_of_the_syntax_tree_in_every_module():
    for path in sorted(PACKAGE.rglob("*.py")):
        found = sources.imported_modules(path.read_text(encoding="utf-8"), "radarsim")
        assert {name for name in found if is_within(name, ["radarsim"])} >= imports_by_syntax(path), path


@pytest.mark.parametrize(
    ("text", "modules"),
    [
        ("import radarsim.physics as p, radarsim.bursts.burst", ["radarsim.physics", "radarsim.bursts.burst"]),
        ("from radarsim.config import (  # a) b\n    model,\n    load as l,\n)", ["radarsim.config.model"]),
        ("from radarsim.config import \\\n    model", ["radarsim.config.model"]),
        ("def f():\n    x = 1; from radarsim import physics", ["radarsim.physics"]),
        ("if True: import radarsim.physics", ["radarsim.physics"]),
        ("try:\n\timport radarsim.physics\nexcept ImportError: pass", ["radarsim.physics"]),
        ("from . import physics", ["radarsim.physics"]),
        ("from .config.model import Model", ["radarsim.config.model"]),
    ],
)
def test_an_import_is_seen_however_it_is_written(text, modules):
    assert set(modules) <= set(sources.imported_modules(text, "radarsim"))


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of a user's: `package(text, …)` writes its modules and gives those that compute."""
    monkeypatch.syspath_prepend(str(tmp_path))
    top = f"user_package_{tmp_path.name.replace('-', '_')}"

    def write(**files):
        for name, text in files.items():
            path = Path(tmp_path, top, *name.split("__")).with_suffix(".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            for folder in (path.parent, Path(tmp_path, top)):
                (folder / "__init__.py").touch()
            path.write_text(text)
        sources.computing_modules.cache_clear()
        modules = sources.computing_modules((f"{top}.study",))
        return {name.removeprefix(f"{top}.") for name in modules if name.startswith(f"{top}.")}

    write.folder = tmp_path / top
    yield write
    for name in [name for name in sys.modules if name.startswith(top)]:
        del sys.modules[name]


def test_a_file_that_moves_into_a_subfolder_still_counts(package):
    assert package(study="from . import design", design="", tables="") == {"study", "design"}
    moved = package(study="def prepare():\n    from .deep.below import design", deep__below__design="")
    assert {"study", "deep.below.design"} <= moved
    assert "tables" not in moved


def test_a_package_that_computes_the_names_of_its_imports_counts_as_a_whole(package):
    text = "from importlib import import_module\ndef simulate(name):\n    import_module(name)"
    assert package(study=text, other="", deep__words="") == {"study", "other", "deep", "deep.words"}


@pytest.mark.parametrize(
    "text",
    [
        "import numpy as np; from .kernel import f",
        "from.kernel import f",
        "from .import kernel",
        "from . import \\\n    kernel",
        "colour = '#fff'; from . import kernel",
        "def f():\n    from . import (  # (a comment)\n        kernel,\n    )",
        "import importlib as il\nil.import_module",
        "from .kernel import *",
    ],
)
def test_a_users_package_may_write_its_imports_in_any_way(package, text):
    assert package(study=text, kernel="") >= {"study", "kernel"}


def test_packages_of_the_users_that_a_package_imports_count(package, tmp_path):
    (tmp_path / "user_tools_a.py").write_text("import numpy.linalg, json.decoder, user_tools_b.deep")
    (tmp_path / "user_tools_b").mkdir()  # without __init__.py
    (tmp_path / "user_tools_b/deep.py").write_text("")
    package(study="from user_tools_a import f")
    first = (f"{package.folder.name}.study",)
    found = {name for name in sources.computing_modules(first) if not name.startswith(("radarsim", first[0][:12]))}
    assert found == {"user_tools_a", "user_tools_b.deep"}
    del sys.modules["user_tools_b"]


def test_files_of_data_count_by_their_paths_and_contents(package):
    package(study="")
    top = package.folder.name
    for folder in ("one", "two"):
        (package.folder / folder).mkdir()
        (package.folder / folder / "gains.npz").write_bytes(folder.encode())
    both = sources._data_digests(top)
    assert {"one/gains.npz", "two/gains.npz"} == set(both)
    (package.folder / "two/gains.npz").write_bytes(b"other")
    (package.folder / "shipped").mkdir()
    (package.folder / "shipped/walk.yaml").write_text("")
    changed = sources._data_digests(top)
    assert [name for name in changed if changed[name] != both.get(name)] == ["two/gains.npz"]


def test_a_loaded_module_keeps_the_hash_of_what_was_loaded(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("loaded_before", "loaded_later"):
        (tmp_path / f"{name}.py").write_text("x = 1")
    __import__("loaded_before")
    first = {name: module_sources.module_digest(name) for name in ("loaded_before", "loaded_later")}
    assert len(set(first.values())) == 1
    for name in first:
        (tmp_path / f"{name}.py").write_text("x = 22")
    assert module_sources.module_digest("loaded_before") == first["loaded_before"]  # the code that runs
    edited = module_sources.module_digest("loaded_later")
    assert edited != first["loaded_later"]  # the code that would be loaded
    (tmp_path / "loaded_later.py").write_text("x = 333")
    __import__("loaded_later")
    with pytest.raises(ConfigError, match=r"loaded_later: was edited while this process ran; start a new one"):
        module_sources.module_digest("loaded_later")
    for name in first:
        del sys.modules[name]
    __import__("loaded_before")  # as the modules of a user's filter are, after an edit
    assert module_sources.module_digest("loaded_before") == edited
    del sys.modules["loaded_before"]


@pytest.mark.parametrize("mode", [PycInvalidationMode.TIMESTAMP, PycInvalidationMode.UNCHECKED_HASH])
def test_bytecode_of_another_text_is_noticed(tmp_path, monkeypatch, mode):
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    name = f"compiled_{mode.name.lower()}"
    source = tmp_path / f"{name}.py"
    source.write_text("x = 1\n")
    bytecode = Path(py_compile.compile(str(source), invalidation_mode=mode))
    time = source.stat().st_mtime
    source.write_text("x = 2\n")
    os.utime(source, (time, time))  # as of an edit within a second, or of files that are unpacked with one time
    assert __import__(name).x == 1
    with pytest.raises(ConfigError, match=rf"{name}\.py: Python runs bytecode of another text: delete {bytecode}"):
        module_sources.module_digest(name)
    del sys.modules[name]
    bytecode.unlink()
    assert __import__(name).x == 2
    assert module_sources.module_digest(name)
    del sys.modules[name]


def test_bytecode_that_python_does_not_load_or_that_is_of_the_text_is_no_fault(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    source = tmp_path / "compiled_well.py"
    source.write_text("x = 1\n")
    py_compile.compile(str(source))
    source.chmod(0o600)  # the source has changed since, though not its text
    assert __import__("compiled_well").x == 1
    assert module_sources.module_digest("compiled_well")
    del sys.modules["compiled_well"]
    source.write_text("x = 20\n")
    assert __import__("compiled_well").x == 20
    assert module_sources.module_digest("compiled_well")
    del sys.modules["compiled_well"]
