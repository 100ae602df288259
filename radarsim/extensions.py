"""What optional parts of radarsim add to studies, runs, reports and commands: one interface, and the parts installed.

An optional part, such as the papers' claims, is a package that nothing else imports. Its module `extension` declares
`EXTENSION`, an object of a class derived from `Extension`; without the package radarsim works, and lacks its part."""

from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup

    from radarsim.api.result import Result
    from radarsim.api.simulate_cases import RunOptions, SimulatedCases
    from radarsim.config.experiment import Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure

MODULES = ("radarsim.papers.extension", "radarsim.recordings.extension")

Tables = Mapping[str, "pd.DataFrame"]


class ReportSection(NamedTuple):
    """A section of a result's page, as HTML: its body, an explanation at the end of the page, and links by figure."""

    body: "Markup"
    explanation: "Markup"
    links: Mapping[str, "Markup"]


class IndexEntry(NamedTuple):
    """What the index of results says of a run: a column's heading and text, marks with counts, and the run's group."""

    heading: str
    text: str
    marks: Mapping[str, int]
    group: str


class StopRule(Protocol):
    """A rule that ends a run by its results: `radarsim run --decide`."""

    help: str

    def check(self, experiment: "Experiment") -> None:
        """Raise ConfigError for an experiment that the rule cannot end."""

    def simulate(self, experiment: "Experiment", options: "RunOptions", progress: Any) -> "SimulatedCases":
        """The cases at the first look at which the rule is met, or at the last one."""

    def unmet(self, experiment: "Experiment", simulated: "SimulatedCases") -> list[str]:
        """A line for each respect in which the rule is not met."""


class Extension:
    """An optional part of radarsim; a derived class overrides what it adds."""

    command_sections: Mapping[str, Mapping[str, str]] = {}  # of `radarsim --help`: commands, and modules that add them
    figure_names: Sequence[str] = ()  # figures that it adds to results of any study
    table_names: Sequence[str] = ()  # tables that it adds, which its section of the report shows
    columns_from_elsewhere: Mapping[str, Sequence[str]] = {}  # of its tables: not of the result's own sums
    stop_rule: StopRule | None = None

    def study_label(self, study: Any) -> str:
        """A short label of a study for lists of configs; empty if it has none."""
        return ""

    def check_study(self, study: Any) -> None:
        """Raise ConfigError for faults in what a package's study declares for this extension."""

    def study_faults(self, study: Any, shipped: Any) -> Sequence[str]:
        """Faults in what a package's study declares for this extension, a line each.

        shipped: a function from the stem of a shipped config to its cases, None where there is none."""
        return ()

    def tables(
        self, results: "Sequence[CaseResult]", measured: Tables, user_filters: Tables, stem: str
    ) -> "dict[str, pd.DataFrame]":
        """The tables that it adds to a result.

        measured: the study's tables; user_filters: those of user filters; stem: of the shipped config, else empty."""
        return {}

    def updated_tables(self, tables: Tables, study_name: str, out: Path) -> "dict[str, pd.DataFrame]":
        """Its tables of a result, brought up to date with what is stored under `out`."""
        return {}

    def stored_tables(self, tables: Tables, study_name: str) -> "dict[str, pd.DataFrame]":
        """Its tables of a stored result, without what no longer follows from the code that is here."""
        return {}

    def figures(self, tables: Tables) -> "dict[str, Figure]":
        """The figures that it adds to a result, from the result's tables."""
        return {}

    def disagreements(self, tables: Tables) -> Sequence[str]:
        """Differences between its exact and measured values that chance does not explain, a line each."""
        return ()

    def author_errors(self, tables: Tables) -> Sequence[str]:
        """Errors in the code that a study's author gave to this extension, a line each."""
        return ()

    def report_section(
        self,
        tables: Tables,
        titles: Mapping[str, str],
        sources: Mapping[str, Sequence[str]],
        written: Collection[str],
        study_name: str,
    ) -> ReportSection | None:
        """Its section of a result's page.

        titles and sources: of each figure its title and the tables behind it; written: the tables that are files."""
        return None

    def index_entry(self, folder: Path) -> IndexEntry | None:
        """What the index of results says of the run in a folder."""
        return None

    def result_document(self, result: "Result") -> dict[str, Any]:
        """What `--json` says of a result."""
        return {}

    def result_lines(self, result: "Result") -> Sequence[tuple[str, str]]:
        """What a command prints of a result: labels and texts."""
        return ()

    def result_summary(self, result: "Result") -> str:
        """One short line on a result."""
        return ""

    def overall_summary(self, out: str) -> Sequence[str]:
        """Closing lines on all results under `out`."""
        return ()


@cache
def extensions() -> tuple[Extension, ...]:
    """The extensions that are installed."""
    return tuple(import_module(name).EXTENSION for name in MODULES if _is_installed(name))


def _is_installed(module: str) -> bool:
    return find_spec(module.rpartition(".")[0]) is not None and find_spec(module) is not None


def extension_figures() -> tuple[str, ...]:
    """The names of the figures that extensions add to results of any study."""
    return tuple(name for extension in extensions() for name in extension.figure_names)


def extension_tables() -> tuple[str, ...]:
    """The names of the tables that extensions add to results."""
    return tuple(name for extension in extensions() for name in extension.table_names)


def stop_rule() -> StopRule | None:
    """The rule of `radarsim run --decide`; None where no extension has one."""
    return next((extension.stop_rule for extension in extensions() if extension.stop_rule is not None), None)
