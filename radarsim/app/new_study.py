"""`radarsim new-study`: a package with a small whole study, written once and never over anything.

It is a copy of radarsim/app/template under another name. The template is a package that works as it stands: the same
linter reads it as all else, and tests run it.
"""

import os
import re
import sys
from importlib.metadata import packages_distributions
from keyword import iskeyword, issoftkeyword
from pathlib import Path

from radarsim.app.configs import lookup
from radarsim.config.faults import one_line
from radarsim.errors import ConfigError, StoreError
from radarsim.studies import registry

TEMPLATE = Path(__file__).parent / "template"
MODULE = "random_walk"  # the name that the template has
SUFFIXES = (".md", ".py", ".toml", ".yaml")
PLAIN = re.compile(r"[a-z][a-z0-9_]{0,39}")


def new_study(name: str, folder: str | os.PathLike = ".") -> Path:
    """Write the package folder/NAME with a study called NAME; its path.

    Raises ConfigError for a name that cannot be a new module's, and where there is anything of that name already;
    StoreError where it cannot be written.
    """
    if fault := unfit(name):
        raise ConfigError(f"{one_line(name)}: {fault}")
    path = Path(folder) / name
    try:
        path.mkdir()
    except FileExistsError:
        raise ConfigError(f"{path}: is there already and is never overwritten; choose another name") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    for file in files():
        _write(path / renamed(file.relative_to(TEMPLATE).as_posix(), name), renamed(file.read_text("utf-8"), name))
    return path


def unfit(name: str) -> str | None:
    """Why a name cannot be that of a new study, its package and its first config; None where it can."""
    if not PLAIN.fullmatch(name) or iskeyword(name) or issoftkeyword(name):
        return "must be a module's name: a small letter, then at most 39 small letters, digits and _; no word of Python"
    if name in registry.names():
        return "there is a study of this name already; choose another"
    if name in sys.stdlib_module_names or name == "tests" or name in packages_distributions():
        return "there is a Python module of this name already; choose another"
    if found := lookup.config_file(name):
        return f"there is a config of this name already, {found}; choose another"
    return None


def files() -> list[Path]:
    """The files of the template, in order."""
    return sorted(file for file in TEMPLATE.rglob("*") if file.suffix in SUFFIXES)


def renamed(text: str, name: str) -> str:
    """A text of the template for a study of another name."""
    return text.replace(MODULE, name)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
