"""The package's modules as Markdown: what each is, and its public names for autodoc to describe."""

import inspect
import pkgutil
import re
import textwrap
from importlib import import_module
from types import ModuleType

from pydantic import BaseModel

import radarsim
from making import tables

FLOORS = ("constants", "physics", "kernels", "bursts", "studies", "engine", "report", "config", "recordings", "api")


def markdown() -> str:
    """A heading for each floor of the house, a heading for each module on it."""
    parts = []
    for floor in FLOORS:
        package = import_module(f"radarsim.{floor}")
        room = hasattr(package, "__path__")
        parts += [f"## {floor}", (inspect.getdoc(package) or "") if room else ""]
        names = [info.name for info in pkgutil.walk_packages(package.__path__, f"radarsim.{floor}.")] if room else []
        for module in map(import_module, names or [package.__name__]):
            if not (holds_keys(module) or module.__name__.endswith(".authoring")):  # names of other modules
                parts += [f"### {module.__name__}", described(module)]
    return "\n\n".join(parts)


def holds_keys(module: ModuleType) -> bool:
    """Whether a module is a part of the schema, which has a page of its own."""
    return bool(keys_in(module)) and not module.__name__.startswith("radarsim.report.")


def keys_in(module: ModuleType) -> list[str]:
    """The names of its classes of keys."""
    return [name for name, value in public(module) if inspect.isclass(value) and issubclass(value, BaseModel)]


def plain(app, kind: str, name: str, thing: object, options: dict, lines: list[str]) -> None:
    """Docstrings are prose: columns stay columns, bars and stars are magnitudes and products, no markup."""
    paragraphs = "\n".join(lines).strip("\n").split("\n\n")
    lines[:] = [*"\n\n".join(map(paragraph, paragraphs)).split("\n"), ""]


def paragraph(text: str) -> str:
    """One paragraph for Sphinx: examples as they are, what stands in columns as it stands, prose without markup."""
    if not text.startswith("    - ") and text.lstrip().startswith((">>>", "* ", "- ")):
        return text
    if re.search(r"\S   ?\S|\n +\S", text) or tables.LINE.match(text):
        return "::\n\n" + textwrap.indent(text, "    ")
    return re.sub(r"([|*\\]|_(?=\W|$))", r"\\\1", text)


def described(module: ModuleType) -> str:
    """Autodoc's directives for a module and its public names, in the order of the file."""
    left_out = f"   :exclude-members: {', '.join(keys)}\n" if (keys := keys_in(module)) else ""
    return f"```{{eval-rst}}\n.. automodule:: {module.__name__}\n   :members:\n   :undoc-members:\n{left_out}```"


def public(module: ModuleType) -> list[tuple[str, object]]:
    """Functions, kernels and classes that a module defines, without those that begin with an underscore."""
    members = []
    for name, value in vars(module).items():
        inner = getattr(value, "py_func", value)
        is_ours = (getattr(inner, "__module__", None), getattr(inner, "__name__", None)) == (module.__name__, name)
        if not name.startswith("_") and is_ours and (inspect.isfunction(inner) or inspect.isclass(inner)):
            members.append((name, inner))
    return members


def every_module() -> list[ModuleType]:
    """All modules of the package but its `python -m` entry."""
    names = [info.name for info in pkgutil.walk_packages(radarsim.__path__, "radarsim.")]
    return [radarsim, *(import_module(name) for name in names if name != "radarsim.__main__")]
