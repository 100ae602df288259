"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors.

The paper asks three questions, each with a part here. The files of this folder answer the first, smoothing, and hold
what all parts have; the folders `manoeuvre` and `clutter` have files of the same names for cases that ask the others.
A table may have no rows, a figure be None."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from radarsim.language.translate import term
from radarsim.report.quantities import COMMON, FLOORS, Component, Quantity
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.floors.bound import Floor
    from radarsim.studies.interface import Plan
    from radarsim.studies.plot_arrays import DrawPlots
    from radarsim.studies.recording_interface import RecordingInterface, Tracker
    from radarsim.studies.sonar.config import Keys

TRACKING = (  # quantities of a tracker among false plots
    Quantity("loss", term("ends of a track an hour"), "tracking", "ends_per_hour", unit=term("/h")),
    Quantity("false_tracks", term("false tracks an hour"), "tracking", "false_tracks_per_hour", unit=term("/h")),
)
CaseOrResult = TypeVar("CaseOrResult", "Case", "CaseResult")


class Part(ABC):
    """One of the paper's three questions, and how cases that ask it are computed and shown."""

    name: str
    package: str

    @abstractmethod
    def prepare(self, case: "Case") -> "Plan":
        """The plan of a case, which simulates."""

    @abstractmethod
    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        """The part's own tables."""

    @abstractmethod
    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "Mapping[str, Figure | None]":
        """The part's own figures."""

    @abstractmethod
    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        """As `Study.drawn_from`."""

    @abstractmethod
    def question(self, specs: "Sequence[Keys]") -> str:
        """The question of cases with these keys."""

    @abstractmethod
    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        """The answer to it."""

    @abstractmethod
    def drawing(self, case: "Case") -> "DrawPlots":
        """As `RecordingInterface.drawing`."""

    @abstractmethod
    def tracker(self, case: "Case") -> "Tracker":
        """As `RecordingInterface.tracker`."""


class Smoothing(Part):
    """How well a track is smoothed and extrapolated."""

    name, package = "smoothing", __name__

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.sonar import study

        return study.prepare(case)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.sonar import tables

        return tables.tables(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "Mapping[str, Figure | None]":
        from radarsim.studies.sonar import figures

        return figures.figures(results, tables, experiment)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.sonar import figures

        return figures.TABLES_OF_FIGURES

    def question(self, specs: "Sequence[Keys]") -> str:
        from radarsim.studies.sonar import answer

        return answer.question(specs)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.counted_scans import result_scans
        from radarsim.studies.process_noise_answer import best_noise
        from radarsim.studies.sonar import answer

        scans = {result.name: result_scans(STUDY, result) for result in results}
        return [*best_noise(STUDY, results, tables).sentences, *answer.answer(results, tables, scans)]

    def drawing(self, case: "Case") -> "DrawPlots":
        from radarsim.studies.sonar import tracking

        return tracking.simulated_plots(case)

    def tracker(self, case: "Case") -> "Tracker":
        from radarsim.studies.sonar import tracking

        return tracking.Tracker(case)


class Manoeuvre(Part):
    """How soon a manoeuvre is detected, how filters respond to it, and what a track is used for."""

    name, package = "manoeuvre", f"{__name__}.manoeuvre"

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.sonar.manoeuvre import study

        return study.prepare(case)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.sonar.manoeuvre import tables

        return tables.tables(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "Mapping[str, Figure | None]":
        from radarsim.studies.sonar.manoeuvre import figures

        return figures.figures(results, tables)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.sonar.manoeuvre import figures

        return figures.TABLES_OF_FIGURES

    def question(self, specs: "Sequence[Keys]") -> str:
        from radarsim.studies.sonar.manoeuvre import answer

        return answer.question(specs)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.sonar.manoeuvre import answer

        return answer.answer(results, tables)

    def drawing(self, case: "Case") -> "DrawPlots":
        from radarsim.studies.sonar.manoeuvre import tracking

        return tracking.simulated_plots(case)

    def tracker(self, case: "Case") -> "Tracker":
        from radarsim.studies.sonar.manoeuvre import tracking

        return tracking.Tracker(case)


class Clutter(Part):
    """How a target is tracked among false plots."""

    name, package = "clutter", f"{__name__}.clutter"

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.sonar.clutter import study

        return study.prepare(case)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.sonar.clutter import tables

        return tables.tables(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "Mapping[str, Figure | None]":
        from radarsim.studies.sonar.clutter import figures

        return figures.figures(results, tables)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.sonar.clutter import figures

        return figures.TABLES_OF_FIGURES

    def question(self, specs: "Sequence[Keys]") -> str:
        from radarsim.studies.sonar.clutter import answer

        return answer.question(specs)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.sonar.clutter import answer

        return answer.answer(results, tables)

    def drawing(self, case: "Case") -> "DrawPlots":
        from radarsim.studies.sonar.clutter import tracking

        return tracking.simulated_plots(case)

    def tracker(self, case: "Case") -> "Tracker":
        from radarsim.studies.sonar.clutter import tracking

        return tracking.Tracker(case)


SMOOTHING = Smoothing()
# A part comes after those whose questions are asked of its cases too.
PARTS: Mapping[str, Part] = {part.name: part for part in (SMOOTHING, Manoeuvre(), Clutter())}


class Sonar(Study):
    """P3, as `study: sonar`."""

    name = "sonar"
    about = "P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors."
    filters = {
        "kind: growing_memory": "least squares on all plots so far, the recursion (12)-(14)",
        "kind: window": "least squares on the last `plots` plots",
        "kind: kalman": "Kalman-Bucy (11), with manoeuvre_variance or without",
        "kind: fixed_gain": "α-β (degree 1) or α-β-γ (degree 2) with steady-state gains",
        "kind: kalman_augmented": "Kalman filter of the state and the plot's error, for correlated errors",
        "kind: kalman_differenced": "differences of neighbouring plots, for correlated errors",
        "kind: adaptive": "growing memory restarted by a manoeuvre detector (3), at a higher degree or with few plots",
        "association: nearest": "a tracker among false plots: the nearest plot in the gate; of kind kalman, degree 1",
        "association: pda": "a tracker with probabilistic data association",
        "association: known": "a filter that knows the target's plots, for comparison",
        "kind: imm": "two interacting Kalman filters, steady and manoeuvring",
    }

    def keys(self) -> "type[Keys]":
        from radarsim.studies.sonar.config import Keys

        return Keys

    def quantities(self, spec: "Keys | None" = None) -> tuple[Quantity, ...]:
        if spec is None:
            return COMMON + TRACKING + FLOORS
        return COMMON + (TRACKING if "clutter" in spec.parts else FLOORS)

    def manoeuvre_start_s(self, spec: "Keys") -> float | None:
        from radarsim.studies.sonar.manoeuvre.phases import manoeuvre_times

        times = manoeuvre_times(spec.target)
        return None if times is None else times[0]

    def prepare(self, case: "Case") -> "Plan":
        return last_part(case.spec).prepare(case)

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        package = last_part(spec).package
        tracking = (f"{__name__}.recorded_plots", f"{package}.tracking") if plots else ()
        return f"{__name__}.config", f"{package}.study", *tracking

    def simulate(self, plan: Any, first: int, count: int) -> "np.ndarray":
        sums: np.ndarray = plan.simulate(first, count)
        return sums

    def errors(self, plan: Any, first: int, count: int) -> "np.ndarray":
        errors: np.ndarray = plan.errors(first, count)
        return errors

    def floor(self, spec: "Keys", axes: Any) -> "Floor | None":
        from radarsim.studies.sonar import floor

        return None if "clutter" in spec.parts else floor.floor(spec, axes)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        tables = SMOOTHING.tables(results)
        for part, members in by_part(results):
            tables |= {} if part is SMOOTHING else part.tables(members)
        return {name: table for name, table in tables.items() if len(table)}

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.studies.sonar import tables

        return tables.curves(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        figures: dict[str, Figure | None] = {}
        for part, members in reversed(by_part(results)):  # first what answers the question, which is the last part's
            figures |= {} if part is SMOOTHING else part.figures(members, tables, experiment)
        figures |= SMOOTHING.figures(results, tables, experiment)
        return {name: figure for name, figure in figures.items() if figure}

    def user_filter_components(self) -> "Sequence[Component]":
        from radarsim.studies.sonar import components

        return components.COMPONENTS

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        return {name: tables for part in PARTS.values() for name, tables in part.drawn_from().items()}

    def question(self, experiment: "Experiment") -> str:
        part, cases = by_part(experiment.cases)[-1]
        return part.question([case.spec for case in cases])

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        answers = (part.answer(members, tables) for part, members in reversed(by_part(results)))
        return [sentence for answer in answers for sentence in answer]

    def recording_interface(self) -> "RecordingInterface":
        from radarsim.studies.sonar.recorded_plots import RecordedSonarPlots

        return RecordedSonarPlots(last_part)


def last_part(spec: "Keys") -> Part:
    """The part whose plan, filters and plots a case with these keys has."""
    return PARTS[spec.parts[-1]]


def by_part(cases: Sequence[CaseOrResult]) -> list[tuple[Part, list[CaseOrResult]]]:
    """The cases, or results, of each part whose questions some of them ask."""
    members = [(part, [case for case in cases if name in case.spec.parts]) for name, part in PARTS.items()]
    return [(part, chosen) for part, chosen in members if chosen]


STUDY = Sonar()
