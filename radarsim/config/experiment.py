"""What a checked config is: an experiment of cases."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from radarsim.config.faults import one_line, short
from radarsim.config.fields import Model
from radarsim.config.identity import complete


@dataclass(frozen=True)
class Case:
    """One configuration to be run: a study's checked keys, how often, and with which seed.

    name is the stem of its config with ` key=value` for each swept key.
    """

    name: str
    stem: str
    study: str
    spec: Model
    swept: tuple[tuple[str, object], ...]
    realisations: int
    seed: int


@dataclass(frozen=True)
class Experiment:
    """What a config asks for.

    figures holds, for a figure, names or patterns of the cases that it shows; resolved is the whole experiment as plain
    JSON-able data, defaults filled and in SI units.
    """

    stem: str
    study: str
    path: str | None
    cases: tuple[Case, ...]
    realisations: int
    seed: int
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    resolved: dict = field(default_factory=dict)

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


def resolved(stem: str, cases: Sequence[Case], figures: Mapping[str, tuple[str, ...]]) -> dict:
    """The experiment as plain data, for the record."""
    return {
        "config": stem,
        "study": cases[0].study,
        "figures": {figure: list(patterns) for figure, patterns in figures.items()},
        "cases": [
            {
                "case": case.name,
                "swept": dict(case.swept),
                "realisations": case.realisations,
                "seed": case.seed,
                **complete(case.spec),
            }
            for case in cases
        ],
    }
