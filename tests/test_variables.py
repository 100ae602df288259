"""Every environment variable that the package reads is documented, and tests clear or know all that are read."""

import ast
import os
import re
import sys
from pathlib import Path
from typing import ClassVar

import pytest

from radarsim.cli.command_group import main
from radarsim.kernels.cache import cache_root
from tests.program import Terminal
from tests.variables import CLEARED, KEPT

ROOT = Path(__file__).parents[1]
LIBRARIES = {"NO_COLOR", "_RADARSIM_COMPLETE", "TMPDIR"}  # what these read is promised to users of the command
BETWEEN = ("collections.abc", "os", "posixpath", "pathlib", "shutil")  # modules that read variables for their callers
READING = ("get", "setdefault")  # methods of os.environ


def documented():
    """The variables in the table of the reference."""
    page = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    return {name for row in re.findall(r"^\| (`[A-Z_`, ]+`) \|", page, re.M) for name in re.findall(r"\w+", row)}


def names_read(source):
    """The variables that a module reads from `os.environ` or by `os.getenv`; a name is a text or a constant of it."""
    tree = ast.parse(source)
    constants = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    asked = []
    for node in ast.walk(tree):
        match node:
            case ast.Subscript(value=ast.Attribute(attr="environ"), slice=name, ctx=ast.Load()):
                asked.append(name)
            case ast.Call(func=ast.Attribute(attr=method, value=ast.Attribute(attr="environ")), args=[name, *_]):
                asked += [name] * (method in READING)
            case ast.Call(func=ast.Attribute(attr="getenv"), args=[name, *_]):
                asked.append(name)
            case ast.Compare(left=name, comparators=[ast.Attribute(attr="environ")]):
                asked.append(name)
            case ast.ImportFrom(module="os", names=names):
                assert not {"environ", "getenv"} & {alias.name for alias in names}, "say os.environ"
    return {name.value if isinstance(name, ast.Constant) else constants[ast.unparse(name)] for name in asked}


def all_read(folder):
    """The variables that the modules of a folder read."""
    sources = (path.read_text(encoding="utf-8") for path in (ROOT / folder).rglob("*.py"))
    return set().union(*(names_read(source) for source in sources if re.search("environ|getenv", source)))


class Recorder(os._Environ):
    """An environment that notes which variables the package reads, itself or through a module of the library."""

    names: ClassVar[set[str]] = set()

    def __getitem__(self, name):
        frame = sys._getframe(1)
        while frame.f_back and frame.f_globals["__name__"] in BETWEEN:
            frame = frame.f_back
        if frame.f_globals["__name__"].startswith("radarsim."):
            self.names.add(name)
        return super().__getitem__(name)


@pytest.fixture
def seen(monkeypatch):
    """The variables that the package reads during a test."""
    monkeypatch.setattr(Recorder, "names", set())
    monkeypatch.setattr(os.environ, "__class__", Recorder)
    return Recorder.names


def test_what_a_module_reads_is_noticed():
    source = "X = 'A'\nos.environ[X]\nos.environ.get('B', 1)\nos.getenv('C')\n'D' in os.environ\nos.environ['E'] = 1"
    assert names_read(source) == {"A", "B", "C", "D"}
    with pytest.raises(KeyError):
        names_read("os.environ.get(name())")


def test_the_reference_lists_what_the_package_reads(seen, tmp_path, monkeypatch):
    """In its sources, and through the standard library while commands run."""
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    cache_root()
    for words in (["check", "rls2"], ["run", "rls2", "-n", "100", "--no-figures"], ["list"], ["import", "nothing"]):
        with monkeypatch.context() as patch:
            patch.setattr("sys.stdout", Terminal())
            patch.setattr("sys.stderr", Terminal())
            patch.chdir(tmp_path)
            with pytest.raises(SystemExit):
                main(words)
    assert {"HOME", "COLUMNS", "RADARSIM_LANGUAGE"} <= seen
    assert documented() == all_read("radarsim") | seen | LIBRARIES


def test_tests_clear_or_keep_on_purpose_all_that_is_read():
    read = documented() | all_read("tests")
    assert {*KEPT} <= read
    assert read - {*KEPT} <= {*CLEARED}
    assert not {*CLEARED} & {*KEPT}
