"""What is found by following imports, in every form that Python has for them, and what hashes see of a source."""

import json
import zipfile

import pytest

from radarsim.kernels import sources, trees
from radarsim.studies import identity

FILES = {
    "fifth/__init__.py": "SIZE = 2\n",
    "fifth/study.py": "",
    "fifth/inner/__init__.py": "",
    "fifth/inner/deep.py": "VALUE = 1\n",
    "fifth/inner/other.py": "VALUE = 1\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Writes the package `fifth` with another study.py, and gives the modules that are followed from it, by hash."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sources, "_known", {})

    def followed(study, more=None):
        for name, text in (FILES | {"fifth/study.py": study} | (more or {})).items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return found(("fifth.study",))

    yield followed
    monkeypatch.undo()
    sources.forget()


def found(roots):
    sources.forget()
    own = {root.partition(".")[0] for root in roots}
    return sources.closure(roots, lambda module: identity.follows(module, own)).hashes


@pytest.mark.parametrize(
    "statement",
    [
        "import fifth.inner.deep",
        "import fifth.inner.deep as name",
        "from fifth.inner import deep",
        "from fifth.inner.deep import VALUE",
        "from fifth.inner.deep import *",
        "from .inner import deep",
        "from . import inner\nvalue = inner.deep.VALUE",
        "from .inner.deep import VALUE as name",
        "import fifth\nvalue = fifth.inner.deep.VALUE",
        "import fifth.inner as name\ndef value():\n    return name.deep.VALUE",
        "def value():\n    from fifth.inner import deep\n    return deep.VALUE",
        "class Value:\n    def value(self):\n        if self:\n            import fifth.inner.deep",
        "try:\n    from fifth.inner.deep import VALUE\nexcept ImportError:\n    pass",
        "from importlib import import_module\nvalue = import_module('fifth.inner.deep')",
        "import importlib\nvalue = importlib.import_module('.inner.deep', 'fifth')",
        "value = __import__('fifth.inner.deep')",
    ],
)
def test_every_form_of_import_is_followed(package, statement):
    hashes = package(f"{statement}\n")
    assert "fifth.inner.deep" in hashes
    assert "fifth.inner.other" not in hashes


def test_an_import_by_a_computed_name_may_mean_any_module(package):
    hashes = package(
        "from importlib import import_module\ndef value(name):\n    return import_module(f'fifth.{name}')\n"
    )
    assert {"fifth.inner.deep", "fifth.inner.other"} <= hashes.keys()


def test_a_name_of_the_package_itself(package):
    assert "fifth" in package("from fifth import SIZE\n")
    assert "fifth" not in package("from fifth import inner\n")


def test_a_star_takes_what_all_names(package):
    hashes = package("from fifth.inner import *\n", {"fifth/inner/__init__.py": "__all__ = ['deep']\n"})
    assert {"fifth.inner", "fifth.inner.deep"} <= hashes.keys()
    assert "fifth.inner.other" not in hashes


def test_what_only_type_checkers_read_is_not_followed(package):
    hashes = package("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from fifth.inner import deep\n")
    assert "fifth.inner.deep" not in hashes


def test_a_file_of_data_beside_a_module_counts_with_its_content(package, tmp_path):
    (tmp_path / "fifth" / "data").mkdir(parents=True)
    table, notes = tmp_path / "fifth" / "data" / "gains.csv", tmp_path / "fifth" / "notes.txt"
    table.write_text("1\n")
    notes.write_text("some\n")
    before = package("from pathlib import Path\nGAINS = (Path(__file__).parent / 'data' / 'gains.csv').read_text()\n")
    notes.write_text("others\n")
    assert found(("fifth.study",)) == before
    table.write_text("2\n")
    assert found(("fifth.study",)) != before


def test_a_package_without_init_and_in_two_places(tmp_path, monkeypatch):
    for place, name in (("one", "study"), ("two", "filters")):
        (tmp_path / place / "spread").mkdir(parents=True)
        (tmp_path / place / "spread" / f"{name}.py").write_text("from spread import filters\n")
        monkeypatch.syspath_prepend(tmp_path / place)
    assert found(("spread.study",)).keys() >= {"spread.study", "spread.filters"}


def test_a_package_of_one_file(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "lonely.py").write_text("VALUE = 1\n")
    before = found(("lonely",))
    (tmp_path / "lonely.py").write_text("VALUE = 2\n")
    assert before.keys() == {"lonely"}
    assert found(("lonely",)) != before


def test_a_package_in_an_archive(tmp_path, monkeypatch):
    archive = tmp_path / "packed.zip"
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("packed/__init__.py", "")
        file.writestr("packed/study.py", "from packed.filters import VALUE\n")
        file.writestr("packed/filters.py", "VALUE = 1\n")
    monkeypatch.syspath_prepend(archive)
    assert found(("packed.study",)).keys() >= {"packed.study", "packed.filters"}


def test_a_module_that_is_no_source_counts_with_its_bytes(tmp_path, monkeypatch):
    import py_compile

    (tmp_path / "compiled.py").write_text("VALUE = 1\n")
    py_compile.compile(str(tmp_path / "compiled.py"), cfile=str(tmp_path / "compiled.pyc"))
    (tmp_path / "compiled.py").unlink()
    monkeypatch.syspath_prepend(tmp_path)
    before = found(("compiled",))
    assert before["compiled"] != "none"


def test_a_neighbour_that_is_not_installed_is_followed_and_an_installed_one_counts_with_its_version(package, tmp_path):
    hashes = package("import neighbour\nimport numpy\nimport pytest\n", {"neighbour.py": "VALUE = 1\n"})
    assert "neighbour" in hashes
    beyond = sources.closure(("fifth.study",), lambda module: identity.follows(module, {"fifth"})).beyond
    assert {"numpy", "pytest"} <= beyond
    assert identity.versions(beyond) == {"pytest": pytest.__version__}


def test_a_root_that_is_not_there_is_refused():
    with pytest.raises(LookupError, match="no_such"):
        found(("radarsim.no_such",))


def tree(text):
    return trees.read(text.encode()).tree


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        ("def f():\n    'a'\n    return 1\n", "def f():\n    'b'  # c\n\n    return (1)\n", True),
        ("x = Field(1, description='a')\n", "x = Field(1, description='b' 'c')\n", True),
        ("x = Field(1)\n", "x = Field(1, title='a', json_schema_extra={'symbol': 'b'})\n", True),
        ("x = key('a', 'b', 1, gt=0)\n", "x = key('a', 'c' 'd', 1, symbol='e', unit='f', gt=0)\n", True),
        ("x = key('a', 'b', 1)\n", "x = key('a', 'b', 2)\n", False),
        ("x = key('a', 'b', 1, gt=0)\n", "x = key('a', 'b', 1, gt=1)\n", False),
        ("x = Field(1, gt=0)\n", "x = Field(1, gt=1)\n", False),
        ("x = f(1, description='a')\n", "x = f(1, description='b')\n", False),
        ("x: int = 1\n'of x'\n", "x: int = 1\n", True),
        ("x = 1\n", "x = 1.0\n", False),
        ("x = [None, 1]\n", "x = [1]\n", False),
        ("f(*a)\n", "f(**a)\n", False),
        ("x = 'a'\n", "x = 'b'\n", False),
    ],
)
def test_what_a_hash_sees_of_a_source(one, other, equal):
    assert (tree(one) == tree(other)) == equal


def test_what_is_known_of_sources_is_kept_and_damage_forgotten(tmp_path, monkeypatch):
    file = tmp_path / "sources.json"
    monkeypatch.setattr(sources, "_known", {"key": trees.Source("tree", ("a",), ("b",), ("c.csv",))})
    monkeypatch.setattr(sources, "_kept", set())
    sources.remember(file)
    held = file.read_text()
    for text in ("", "{", "[]", json.dumps({"format": 2, "sources": {"key": 1}}), "[" * 100_000, held):
        monkeypatch.setattr(sources, "_known", {})
        file.write_text(text)
        sources.remembered(file)
        assert sources._known == ({"key": trees.Source("tree", ("a",), ("b",), ("c.csv",))} if text == held else {})
