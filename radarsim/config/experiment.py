"""What a checked config is: an experiment of cases."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any

from radarsim.config.faults import one_line, short
from radarsim.config.identity import complete


@dataclass(frozen=True)
class Case:
    """One configuration to be run: a study's checked keys, how often, and with which seed.

    name is the stem of its config with ` key=value` for each swept key. spec holds the study's own keys, an object of
    its subclass of `radarsim.config.fields.Study`. noise_of, where given, are the keys of another case, whose noise
    this one shares although its world is another: common random numbers.
    asked_from_k: exact σ and gains are asked for from this scan on, counted from 1; 0: every exact value. roughly: what
    is long to compute may be off by a thousandth, as where a search only looks about.
    """

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

    def resolved(self) -> dict[str, Any]:
        """The case as plain JSON-able data, names included."""
        common = {"case": self.name, "swept": dict(self.swept), "realisations": self.realisations, "seed": self.seed}
        return common | complete(self.spec)


@dataclass(frozen=True)
class Experiment:
    """What a config asks for; figures holds, for a figure, names or patterns of the cases that it shows."""

    stem: str
    study: str
    path: str | None
    cases: tuple[Case, ...]
    realisations: int
    seed: int
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def resolved(self) -> dict[str, Any]:
        """The whole experiment as plain JSON-able data, defaults filled and in SI units, for the record."""
        return {
            "config": self.stem,
            "study": self.study,
            "figures": {figure: list(patterns) for figure, patterns in self.figures.items()},
            "cases": [case.resolved() for case in self.cases],
        }

    def shown_in(self, figure: str) -> tuple[Case, ...]:
        """The cases that a figure shows: all of them, where the config does not say."""
        if figure not in self.figures:
            return self.cases
        return tuple(case for case in self.cases if any(matches(case.name, p) for p in self.figures[figure]))


def matches(name: str, pattern: str) -> bool:
    """Whether a pattern of `figures` means a case: its very name, or with * and ? for what may differ."""
    return name == pattern or fnmatchcase(name, pattern.replace("[", "[[]"))


def in_name(value: object) -> str:
    """A swept value as it stands in a case's name: numbers at their shortest, text plain, lists without blanks."""
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
