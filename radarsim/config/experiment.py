"""A checked config: an experiment of cases.

The part of a checked config that changes its numbers, as plain JSON-able data."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from radarsim.config.document import one_line, short
from radarsim.config.fields import Added, DataFile, Design, Display, NameIn


# ---- identity --------------------------------------------------------------------------------------------------------
def digest(value: object) -> str:
    """SHA-256 in hexadecimal of a JSON-able value; numbers by their shortest exact form, keys sorted."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def canonical(spec: BaseModel) -> dict[str, Any]:
    """All that changes a number, defaults filled in, in SI units; display names are left out."""
    return _plain(spec, (Display,))


def world(spec: BaseModel) -> dict[str, Any]:
    """The observed world, without the filters and the number of scans: cases of one world share their noise."""
    return _plain(spec, (Display, Design))


def complete(spec: BaseModel) -> dict[str, Any]:
    """Every key that has a value, including names: reads back as the same configuration."""
    return _plain(spec, ())


def _plain(value: object, leave_out: tuple[type, ...]) -> Any:
    if isinstance(value, BaseModel):
        return {
            name: _plain(_without_names(value, name, info) if leave_out else getattr(value, name), leave_out)
            for name, info in type(value).model_fields.items()
            if not any(isinstance(mark, leave_out) for mark in info.metadata)
            and not (_at_its_default(value, name, info) if leave_out else getattr(value, name) is None)
        }
    if isinstance(value, tuple | list):
        return [_plain(item, leave_out) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain(item, leave_out) for key, item in value.items()}
    return value


def _at_its_default(model: BaseModel, name: str, info: FieldInfo) -> bool:
    """Whether a field that earlier versions lacked has the value that keeps their behaviour."""
    return any(isinstance(mark, Added) for mark in info.metadata) and getattr(model, name) == info.default


def _without_names(model: BaseModel, name: str, info: FieldInfo) -> object:
    """The value of a field, without the names in it. A name of a list's member is replaced by its place, 0 where none
    is named; a file of data by its content's hash."""
    value = getattr(model, name)
    for mark in info.metadata:
        if isinstance(mark, NameIn):
            return 0 if value is None else [member.name for member in getattr(model, mark.field)].index(value)
        if isinstance(mark, DataFile) and value is not None:
            return hashlib.sha256(Path(value).read_bytes()).hexdigest()
    return value


# ---- experiment ------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Case:
    """One configuration to run: a study's checked keys, the number of realisations, and the seed.

    name is the stem of its config with ` key=value` for each swept key. spec holds the study's own keys, an object of
    its subclass of `radarsim.config.fields.Study`. noise_of, where given, are the keys of another case, whose noise
    this one shares although its world is another: common random numbers.
    against: names of further filters that gains are against, beside the spec's `baseline`; of each there is a
    companion, the same case but for that key, computed on the same noise.
    asked_from_k: exact σ and gains are asked for from this scan on, counted from 1; 0: every exact value. roughly: what
    is long to compute may be off by a thousandth, as where a search only looks about.
    outside: filters of somebody else beside the study's own, see `radarsim.studies.outside`."""

    name: str
    stem: str
    study: str
    spec: Any
    swept: tuple[tuple[str, object], ...]
    realisations: int
    seed: int
    noise_of: Any = None
    asked_from_k: int = 0
    roughly: bool = False
    against: tuple[str, ...] = ()
    outside: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        bound = tuple(member.bound_to(self) for member in self.outside)  # what such a filter reads depends on the case
        object.__setattr__(self, "outside", bound)

    def __repr__(self) -> str:
        filters = ", ".join(member.name for member in (*self.spec.members, *self.outside))
        count = f"{self.realisations:,} realisation{'s' * (self.realisations != 1)}"
        return f"<case {self.name}: {count}, seed {self.seed}; filters {filters}>"

    @property
    def companions(self) -> "tuple[Case, ...]":
        """The case with each further baseline in place of its own."""
        return tuple(
            replace(self, spec=self.spec.model_copy(update={"baseline": name}), against=(), outside=())
            for name in self.against
        )

    @property
    def keys(self) -> dict[str, Any]:
        """Its keys as plain data, including names: all baselines where there are several."""
        keys, members = complete(self.spec), self.spec.bare_keys
        if further := [*self.against, *(one.name for one in self.outside if one.baseline)]:
            keys["baseline"] = [*filter(None, [keys.get("baseline")]), *further]
        if codes := [one.written for one in self.outside if one.written]:
            keys[members] = [*keys[members], *codes]
        return keys

    def resolved(self) -> dict[str, Any]:
        """The case as plain JSON-able data, names included."""
        common = {"case": self.name, "swept": dict(self.swept), "realisations": self.realisations, "seed": self.seed}
        return common | self.keys


@dataclass(frozen=True)
class Experiment:
    """The experiment of a config; figures holds, for each figure to draw, names or patterns of its cases.

    changes_included: keys of the study stand beside `include`, so that a case differs from the config of its stem."""

    stem: str
    study: str
    path: str | None
    cases: tuple[Case, ...]
    realisations: int
    seed: int
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    changes_included: bool = False

    def __repr__(self) -> str:
        return (
            f"<experiment {self.stem} of study {self.study}: cases {', '.join(case.name for case in self.cases)[:120]}>"
        )

    @cached_property
    def resolved(self) -> dict[str, Any]:
        """The whole experiment as plain JSON-able data, defaults filled in and in SI units, for the record."""
        return {
            "config": self.stem,
            "study": self.study,
            "figures": {figure: list(patterns) for figure, patterns in self.figures.items()},
            "cases": [case.resolved() for case in self.cases],
        }

    def shown_in(self, figure: str) -> tuple[Case, ...]:
        """The cases in a figure: all of them, unless the config selects some."""
        if figure not in self.figures:
            return self.cases
        return tuple(case for case in self.cases if any(matches(case.name, p) for p in self.figures[figure]))

    def drawn(self, figures: Iterable[str]) -> list[str]:
        """Those of the figures that the config selects, in its order; all of them, where it selects none."""
        every = list(figures)
        wanted = [name for pattern in self.figures for name in every if matches(name, pattern)]
        return list(dict.fromkeys(wanted)) if self.figures else every


DRAWN_FOR_ALL = ("sweep_*",)  # figures that no study names


def matches(name: str, pattern: str) -> bool:
    """Whether a pattern of `figures` matches a case: its exact name, or with * and ?."""
    return name == pattern or fnmatchcase(name, pattern.replace("[", "[[]"))


def in_name(value: object) -> str:
    """A swept value in a case's name: numbers at their shortest, text plain, lists without blanks."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return short(value)
        case list():
            return "[" + ",".join(map(in_name, value)) + "]"
        case dict():
            return "{" + ",".join(f"{key}:{in_name(item)}" for key, item in value.items()) + "}"
    return one_line(str(value))
