"""A checked config, an experiment of cases, and the parts of it that decide its numbers, as plain data."""

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
    """The SHA-256, in hexadecimal, of plain data: numbers in their shortest exact form, keys sorted."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def canonical(spec: BaseModel) -> dict[str, Any]:
    """All keys that change a number, with defaults, in SI units; without display names."""
    return _plain_data(spec, (Display,))


def world(spec: BaseModel) -> dict[str, Any]:
    """The keys of the observed world, without filters and number of scans: cases of one world share their noise."""
    return _plain_data(spec, (Display, Design))


def complete(spec: BaseModel) -> dict[str, Any]:
    """All keys with a value, including names: they can be read back as the same config."""
    return _plain_data(spec, ())


def _plain_data(value: object, excluded_marks: tuple[type, ...]) -> Any:
    """A value as plain data, without the fields that have one of these marks. Without marks, all keys with a value."""
    if isinstance(value, BaseModel):
        return _plain_mapping(value, excluded_marks)
    if isinstance(value, tuple | list):
        return [_plain_data(item, excluded_marks) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain_data(item, excluded_marks) for key, item in value.items()}
    return value


def _plain_mapping(model: BaseModel, excluded_marks: tuple[type, ...]) -> dict[str, Any]:
    """The fields of a model as plain data, see `_plain_data`."""
    data = {}
    for name, info in type(model).model_fields.items():
        if any(isinstance(mark, excluded_marks) for mark in info.metadata):
            continue
        if excluded_marks and not _is_added_default(model, name, info):
            data[name] = _plain_data(_value_without_names(model, name, info), excluded_marks)
        elif not excluded_marks and getattr(model, name) is not None:
            data[name] = _plain_data(getattr(model, name), excluded_marks)
    return data


def _is_added_default(model: BaseModel, name: str, info: FieldInfo) -> bool:
    """Whether a field that earlier versions lacked has its default, which keeps their behaviour."""
    return any(isinstance(mark, Added) for mark in info.metadata) and getattr(model, name) == info.default


def _value_without_names(model: BaseModel, name: str, info: FieldInfo) -> object:
    """The value of a field, with the name of a list's member replaced by its index (0 if none is named), and a data
    file by the hash of its content."""
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
    """One configuration to run: the checked keys of a study, the number of realisations, and the seed.

    name: the stem of its config, with ` key=value` for each swept key. spec: the keys of the study, an object of its
    subclass of `radarsim.config.fields.Study`. noise_of: the keys of another case whose noise this one shares, although
    its world differs (common random numbers); None for noise of its own.
    against: further baselines, beside that of the spec. For each there is a companion: the same case with that
    baseline, computed on the same noise.
    asked_from_k: the scan, counted from 1, from which on exact σ and gains are needed; 0: all exact values. roughly:
    what takes long to compute may be wrong by a thousandth, as for the first steps of a search.
    outside: user filters beside those of the study, see `radarsim.studies.outside`."""

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
        """The case with each further baseline in place of that of the spec."""
        return tuple(
            replace(self, spec=self.spec.model_copy(update={"baseline": baseline}), against=(), outside=())
            for baseline in self.against
        )

    @property
    def keys(self) -> dict[str, Any]:
        """The keys as plain data, including names, and all baselines if there are several."""
        keys, members = complete(self.spec), self.spec.bare_keys
        user_baselines = (user_filter.name for user_filter in self.outside if user_filter.baseline)
        if further_baselines := [*self.against, *user_baselines]:
            keys["baseline"] = [*filter(None, [keys.get("baseline")]), *further_baselines]
        if code_filters := [user_filter.written for user_filter in self.outside if user_filter.written]:
            keys[members] = [*keys[members], *code_filters]
        return keys

    def resolved(self) -> dict[str, Any]:
        """The case as plain JSON-able data, names included."""
        common = {"case": self.name, "swept": dict(self.swept), "realisations": self.realisations, "seed": self.seed}
        return common | self.keys


@dataclass(frozen=True)
class Experiment:
    """The experiment of a config.

    figures: for each figure to draw, the names or patterns of its cases. changes_included: whether keys of the study
    stand beside `include`, so that a case differs from the config of its stem."""

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
        """The whole experiment as plain data, with defaults, in SI units: what run.json records."""
        return {
            "config": self.stem,
            "study": self.study,
            "figures": {figure: list(patterns) for figure, patterns in self.figures.items()},
            "cases": [case.resolved() for case in self.cases],
        }

    def shown_in(self, figure: str) -> tuple[Case, ...]:
        """The cases in a figure: all, unless the config selects some."""
        if figure not in self.figures:
            return self.cases
        return tuple(case for case in self.cases if any(matches(case.name, p) for p in self.figures[figure]))

    def drawn(self, figures: Iterable[str]) -> list[str]:
        """The figures that the config selects, in its order; all if it selects none."""
        figure_names = list(figures)
        selected = [name for pattern in self.figures for name in figure_names if matches(name, pattern)]
        return list(dict.fromkeys(selected)) if self.figures else figure_names


DRAWN_FOR_ALL = ("sweep_*",)  # figures that no study names


def matches(name: str, pattern: str) -> bool:
    """Whether a pattern under `figures` matches a name: exactly, or with * and ?."""
    return name == pattern or fnmatchcase(name, pattern.replace("[", "[[]"))


def in_name(value: object) -> str:
    """The text of a swept value in the name of a case: short numbers, plain text, lists without blanks."""
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
