"""The studies there are: those shipped here, and those that installed packages offer.

A package offers a study by an entry point of the group `radarsim.studies`: its name is the value of `study:` in YAML,
its target the declared object, see `radarsim.studies.interface.Study`.
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from radarsim.config.fields import Study as Keys
from radarsim.errors import ConfigError
from radarsim.studies.interface import Study

GROUP = "radarsim.studies"
SHIPPED = {  # in the order of the papers
    "range_doppler": "radarsim.studies.range_doppler",
    "multimodel": "radarsim.studies.multimodel",
    "sonar": "radarsim.studies.sonar",
    "discriminator": "radarsim.studies.discriminator",
}


@cache
def offered() -> Mapping[str, EntryPoint]:
    """The studies of installed packages by name; a name that is shipped here is not taken over."""
    return {entry.name: entry for entry in entry_points(group=GROUP) if entry.name not in SHIPPED}


def names() -> tuple[str, ...]:
    """The values that `study:` may have."""
    return (*SHIPPED, *sorted(offered()))


def has(name: str) -> bool:
    """Whether there is a study of that name; looks at installed packages only where it is not shipped here."""
    return name in SHIPPED or name in offered()


@cache
def study(name: str) -> Study:
    """The study of a name. Raises KeyError where there is none, ConfigError where a package's cannot be loaded."""
    if name in SHIPPED:
        return import_module(SHIPPED[name]).STUDY
    entry = offered()[name]
    try:
        found = entry.load()
    except Exception as error:  # a package may fail in any way of its own
        fault = f"cannot be loaded: {type(error).__name__}: {error}"
        raise ConfigError(f"study {name}: {_package(entry)} {fault}") from error
    if not isinstance(found, Study):
        kind = type(found).__name__
        raise ConfigError(f"study {name}: {_package(entry)} must offer a radarsim.studies.interface.Study, got {kind}")
    if found.name != name:
        raise ConfigError(f"study {name}: {_package(entry)} offers it under this name, but it is called {found.name}")
    return found


def _package(entry: EntryPoint) -> str:
    return f"the package {entry.dist.name if entry.dist else entry.value}"


def keys(name: str) -> type[Keys]:
    """The schema of a study's YAML keys."""
    return study(name).keys()


def folders() -> tuple[Path, ...]:
    """Folders with `configs/` and `scenarios/` that packages ship, whose configs are found by stem."""
    found = []
    for name in offered():
        try:
            folder = study(name).shipped()
        except ConfigError:  # reported when the study itself is requested
            continue
        if folder is not None:
            found.append(folder)
    return tuple(found)
