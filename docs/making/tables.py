"""Result tables as Markdown, from the docstrings of what makes them: see `radarsim.report.tables.TableMakers`."""

import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from types import ModuleType
from typing import NamedTuple

from radarsim.report import consistency_tables, exact_check, interval_notes, rare_events
from radarsim.report import tables as common
from radarsim.report.user_filters import tables as user_filters_tables
from radarsim.studies import planar_tables, registry, step_tables
from radarsim.studies.floors import floor_columns
from radarsim.studies.onefile import OneFile

SHARED = (
    common.label_columns,
    common.component_columns,
    common.realisation_counts,
    common.interval_columns,
    exact_check.exact_columns,
    interval_notes.add_notes,
)
SEVERAL = {  # tables that studies have in common
    "curves": (common.curves, floor_columns.with_floors),
    "gains": (common.gains,),
    "consistency": (consistency_tables.normalised_square_columns,),
    "last": (OneFile.last_columns,),
    "tracks": (step_tables.track_columns,),
    "position": (planar_tables.position_columns,),
    "rare": (rare_events.rate_columns,),
    "failures": (user_filters_tables.failure_columns,),
    "nees": (user_filters_tables.nees_columns, consistency_tables.normalised_square_columns),
}
UNITS = {  # by how a name ends
    **{"_s": "s", "_m": "m", "_mps": "m/s", "_mps2": "m/s²", "_rad": "rad", "_hz": "Hz", "_db": "dB"},
    **{"_percent": "%", "_turns": "turns"},
}
NAME = r"\w+(?: ±(?: \w+)?)?"
LINE = re.compile(rf"(?P<names>{NAME}(?:, {NAME})*)(?: \[(?P<unit>[^\]]+)\])?: (?P<meaning>\S.*)")


class Column(NamedTuple):
    """One column or several of one meaning, with the ends of their intervals."""

    names: tuple[str, ...]
    unit: str
    meaning: str


def read(thing: Callable | ModuleType) -> tuple[str, list[Column]]:
    """What a docstring says of a table, and the columns that it declares."""
    prose, columns = [], []
    for paragraph in (inspect.getdoc(thing) or "").split("\n\n"):
        if not LINE.match(paragraph):
            prose.append(paragraph)
            continue
        for line in re.sub(r"\n +", " ", paragraph).splitlines():
            match = LINE.fullmatch(line)
            if match is None:
                raise ValueError(f"{thing.__name__}: a line of columns must be `name: meaning`, is {line!r}")
            names = tuple(name for name in match["names"].split(", ") for name in with_ends(name))
            columns.append(Column(names, match["unit"] or units(names), match["meaning"]))
    return "\n\n".join(prose), columns


def with_ends(name: str) -> tuple[str, ...]:
    """The names of an estimate `name ± stem` and of its ends; a name without a mark by itself."""
    value, marked, stem = (part.strip() for part in name.partition("±"))
    return (value, f"{stem or value}_lo", f"{stem or value}_hi") if marked else (value,)


def units(names: tuple[str, ...]) -> str:
    """The units that names end in; nothing where they end in none."""
    return ", ".join(dict.fromkeys(unit for name in names for ending, unit in UNITS.items() if name.endswith(ending)))


def modules(study: str) -> Iterator[ModuleType]:
    """The modules of a study that declare tables, that of the whole study first."""
    package = import_module(registry.SHIPPED[study])
    names = [module.name for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]
    for module_name in sorted(names, key=lambda module_name: module_name.count(".")):
        if module_name.endswith(".tables"):
            yield import_module(module_name)


def markdown() -> str:
    """All tables: those of several studies, and each study's own."""
    return "\n\n".join([common_tables(), *(own_tables(study) for study in with_own_tables())])


def with_own_tables() -> list[str]:
    """The shipped studies that declare tables of their own; those of a study in one file stand in SEVERAL."""
    return [study for study in registry.SHIPPED if any(modules(study))]


def common_tables() -> str:
    """Columns that mean the same everywhere, and tables of several studies."""
    shared = [column for function in SHARED for column in read(function)[1]]
    parts = ["Columns that mean the same everywhere:", listed(shared), "## Tables of several studies"]
    for name, functions in SEVERAL.items():
        parts += [f"### `{name}.csv`", *described(*functions)]
    return "\n\n".join(filter(None, parts))


def own_tables(study: str) -> str:
    """The tables of one study, as they are made."""
    parts = []
    for module in modules(study):
        parts += described(module)
        for name, (function, _) in module.table.makers.items():
            parts += [f"### `{name}.csv`", *described(function)]
    return "\n\n".join(filter(None, parts))


def described(*things: Callable | ModuleType) -> list[str]:
    """What the first says, of a table or of all of a module, and the columns that all of them declare."""
    docstrings = [read(thing) for thing in things]
    return [linked(docstrings[0][0]), listed([column for _, columns in docstrings for column in columns])]


def linked(prose: str) -> str:
    """Prose in which pages that are named are links."""
    return re.sub(r"\bdocs/([\w/]+\.md)", r"[\1](../\1)", prose)


def listed(columns: list[Column]) -> str:
    """Columns as a table; nothing of none."""
    unit_words = {"unit": "that of `unit`"}
    rows = [
        (", ".join(f"`{name}`" for name in column.names), unit_words.get(column.unit, column.unit), column.meaning)
        for column in columns
    ]
    lines = [" | ".join(cell.replace("|", "\\|") for cell in row) for row in rows]
    head = ["| column | unit | meaning |", "|---|---|---|"]
    return "\n".join([*head, *(f"| {line} |" for line in lines)]) if lines else ""
