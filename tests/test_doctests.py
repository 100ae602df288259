"""The examples in docstrings run and give what they say."""

import doctest
import pkgutil
from importlib import import_module

import radarsim

MODULES = sorted(
    {"radarsim", *(m.name for m in pkgutil.walk_packages(radarsim.__path__, "radarsim."))} - {"radarsim.__main__"}
)


def test_examples():
    assert [name for name in MODULES if doctest.testmod(import_module(name)).failed] == []


def test_there_are_examples():
    assert sum(len(one.examples) for one in doctest.DocTestFinder().find(radarsim)) >= 4
