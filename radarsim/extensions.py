"""What optional parts of radarsim add to it: one interface, and the parts that are installed.

An optional part, such as recorded plots, is a package that nothing else imports. Its module `extension` declares
`EXTENSION`, an object of a class derived from `Extension`; without the package radarsim works, and lacks its part."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec

MODULES = ("radarsim.recorded.extension",)


class Extension:
    """An optional part of radarsim; a derived class overrides what it adds."""

    command_module: str = ""  # registers commands with the group of `radarsim.cli.group` when it is imported
    command_sections: Mapping[str, Sequence[str]] = {}  # titles and names of these commands in `radarsim --help`


@cache
def extensions() -> tuple[Extension, ...]:
    """The extensions that are installed."""
    return tuple(import_module(name).EXTENSION for name in MODULES if _is_installed(name))


def _is_installed(module: str) -> bool:
    return find_spec(module.rpartition(".")[0]) is not None and find_spec(module) is not None
