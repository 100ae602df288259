"""A checked config: an experiment of cases."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any

from radarsim.config.identity import all_keys, portable_filter, recorded_keys
from radarsim.config.value_text import one_line, short_number
from radarsim.errors import count_text


@dataclass(frozen=True)
class Case:
    """One configuration to run: the checked keys of a study, the number of realisations, and the seed.

    name: the stem of its config, with ` key=value` for each swept key. spec: the keys of the study, an object of its
    subclass of `radarsim.config.study_keys.StudyKeys`. noise_of: the keys of another case whose noise this one shares,
    although its world differs (common random numbers); None for noise of its own.
    against: further baselines, beside that of the spec. For each there is a companion: the same case with that
    baseline, computed on the same noise.
    asked_from_k: the scan, counted from 1, from which on exact σ and gains are needed; 0: all exact values. roughly:
    what takes long to compute may be wrong by a thousandth, as for the first steps of a search.
    outside: user filters beside those of the study, see `radarsim.studies.user_filters`."""

    name: str
    stem: str
    study: str
    spec: Any
    swept_values: tuple[tuple[str, object], ...]
    realisations: int
    seed: int
    noise_keys: Any = None
    asked_from_k: int = 0
    roughly: bool = False
    further_baselines: tuple[str, ...] = ()
    user_filters: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        bound = tuple(
            member.bound_to(self) for member in self.user_filters
        )  # what such a filter reads depends on the case
        object.__setattr__(self, "user_filters", bound)

    def __repr__(self) -> str:
        filters = ", ".join(member.name for member in (*self.spec.members, *self.user_filters))
        count = f"{count_text(self.realisations)} realisation{'s' * (self.realisations != 1)}"
        return f"<case {self.name}: {count}, seed {self.seed}; filters {filters}>"

    @property
    def companions(self) -> "tuple[Case, ...]":
        """The case with each further baseline in place of that of the spec."""
        return tuple(
            replace(
                self, spec=self.spec.model_copy(update={"baseline": baseline}), further_baselines=(), user_filters=()
            )
            for baseline in self.further_baselines
        )

    @property
    def keys(self) -> dict[str, Any]:
        """The keys as plain data, including names, and all baselines if there are several."""
        return self._keys_with_filters(all_keys(self.spec), lambda keys: keys)

    def _keys_with_filters(self, keys: dict[str, Any], write_filter: Callable[[Any], Any]) -> dict[str, Any]:
        """The keys of the study with those of user filters, and all baselines if there are several."""
        members = self.spec.bare_keys
        user_baselines = (user_filter.name for user_filter in self.user_filters if user_filter.baseline)
        if further_baselines := [*self.further_baselines, *user_baselines]:
            keys["baseline"] = [*filter(None, [keys.get("baseline")]), *further_baselines]
        if code_filters := [user_filter.written for user_filter in self.user_filters if user_filter.written]:
            keys[members] = [*keys[members], *map(write_filter, code_filters)]
        return keys

    def resolved(self) -> dict[str, Any]:
        """The case as plain JSON-able data, names included, without paths of this machine."""
        common = {
            "case": self.name,
            "swept": dict(self.swept_values),
            "realisations": self.realisations,
            "seed": self.seed,
        }
        return common | self._keys_with_filters(recorded_keys(self.spec), portable_filter)


@dataclass(frozen=True)
class Experiment:
    """The experiment of a config.

    figures: for each figure to draw, the names or patterns of its cases. changes_included: whether keys of the study
    stand beside `include`, so that a case differs from the config of its stem. like: the shipped config of which it is
    a version, as it says itself. runs: the scans of the table of runs, empty for none. content: the config written out
    in full, see `radarsim.config.complete_config`; None where no text describes it."""

    stem: str
    study: str
    path: str | None
    cases: tuple[Case, ...]
    realisations: int
    seed: int
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    changes_included: bool = False
    like: str = ""
    runs: str = ""
    content: Mapping[str, Any] | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        return (
            f"<experiment {self.stem} of study {self.study}: cases {', '.join(case.name for case in self.cases)[:120]}>"
        )

    def with_runs(self, span: str) -> "Experiment":
        """The experiment with a table of runs over a span of scans."""
        content = None if self.content is None else {**self.content, "runs": span}
        return replace(self, runs=span, content=content)

    @cached_property
    def resolved(self) -> dict[str, Any]:
        """The whole experiment as plain data, with defaults, in SI units: what run.json records."""
        return {
            "config": self.stem,
            "study": self.study,
            "figures": {figure: list(patterns) for figure, patterns in self.figures.items()},
            "cases": [case.resolved() for case in self.cases],
        }

    def cases_in_figure(self, figure: str) -> tuple[Case, ...]:
        """The cases in a figure: all, unless the config selects some."""
        if figure not in self.figures:
            return self.cases
        return tuple(case for case in self.cases if any(matches_pattern(case.name, p) for p in self.figures[figure]))

    def selected_figures(self, figures: Iterable[str]) -> list[str]:
        """The figures that the config selects, in its order; all if it selects none."""
        figure_names = list(figures)
        selected = [name for pattern in self.figures for name in figure_names if matches_pattern(name, pattern)]
        return list(dict.fromkeys(selected)) if self.figures else figure_names


COMMON_FIGURES = ("sweep_*",)  # figures that no study names


def matches_pattern(name: str, pattern: str) -> bool:
    """Whether a pattern under `figures` matches a name: exactly, or with * and ?."""
    return name == pattern or fnmatchcase(name, pattern.replace("[", "[[]"))


def swept_value_text(value: object) -> str:
    """The text of a swept value in the name of a case: short numbers, plain text, lists without blanks."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return short_number(value)
        case list():
            return "[" + ",".join(map(swept_value_text, value)) + "]"
        case dict():
            return "{" + ",".join(f"{key}:{swept_value_text(item)}" for key, item in value.items()) + "}"
    return one_line(str(value))
