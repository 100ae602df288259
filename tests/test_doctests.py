"""The examples in docstrings run and give what they say."""

import doctest
from importlib import import_module
from pathlib import Path

import radarsim

ROOT = Path(radarsim.__file__).parent


def test_examples():
    with_examples = [path for path in sorted(ROOT.rglob("*.py")) if ">>> " in path.read_text(encoding="utf-8")]
    names = [".".join(("radarsim", *path.relative_to(ROOT).with_suffix("").parts)) for path in with_examples]
    modules = [import_module(name.removesuffix(".__init__")) for name in names]
    assert [module.__name__ for module in modules if doctest.testmod(module).failed] == []


def test_there_are_examples():
    assert sum(len(one.examples) for one in doctest.DocTestFinder().find(radarsim)) >= 4
