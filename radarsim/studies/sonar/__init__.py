"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors.

Its three parts are the paper's three questions. The files of this folder answer the first, smoothing, and hold what all
parts have; the folders `manoeuvre` and `clutter` have files of the same names as those of
`radarsim.studies.folder`, for cases that ask their questions. A table may have no rows, a figure be None."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from radarsim.language import term
from radarsim.report.quantities import COMMON, FLOORS, Component, Quantity
from radarsim.studies.interface import Plan, RecordedPlots, Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing import Figure
    from radarsim.studies.floor import Floor
    from radarsim.studies.sonar.config import Keys

BASE = "smoothing"
# A part comes after those whose questions are asked of its cases too.
PARTS = {BASE: __name__, "manoeuvre": f"{__name__}.manoeuvre", "clutter": f"{__name__}.clutter"}
TRACKING = (  # of a tracker among false plots
    Quantity("loss", term("ends of a track an hour"), "tracking", "ends_per_hour|ends", unit=term("/h")),
    Quantity("false_tracks", term("false tracks an hour"), "tracking", "false_tracks_per_hour|false", unit=term("/h")),
)
CaseOrResult = TypeVar("CaseOrResult", "Case", "CaseResult")


class Sonar(Study):
    """P3, as `study: sonar`."""

    name = "sonar"
    about = "P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors."
    filters = {  # noqa: RUF012
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

    def prepare(self, case: "Case") -> Plan:
        plan: Plan = file_of(case.spec.parts[-1], "study").prepare(case)
        return plan

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        part = PARTS[spec.parts[-1]]
        drawing = (f"{__name__}.track", f"{part}.track") if plots else ()
        return f"{__name__}.config", f"{part}.study", *drawing

    def simulate(self, plan: Any, first: int, count: int) -> "np.ndarray":
        sums: np.ndarray = plan.simulate(first, count)
        return sums

    def errors(self, plan: Any, first: int, count: int) -> "np.ndarray":
        found: np.ndarray = plan.errors(first, count)
        return found

    def floor(self, spec: "Keys", axes: Any) -> "Floor | None":
        return None if "clutter" in spec.parts else file_of(BASE, "floor").floor(spec, axes)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        made: dict[str, pd.DataFrame] = file_of(BASE, "tables").tables(results)
        for part, chosen in by_part(results):
            made |= file_of(part, "tables").tables(chosen) if part != BASE else {}
        return {name: table for name, table in made.items() if len(table)}

    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        drawn: dict[str, Figure | None] = {}
        for part, chosen in reversed(by_part(results)):  # first what answers the question, which is the last part's
            drawn |= file_of(part, "figures").figures(chosen, made) if part != BASE else {}
        drawn |= file_of(BASE, "figures").figures(results, made, experiment)
        return {name: figure for name, figure in drawn.items() if figure}

    def shown(self) -> "Sequence[Component]":
        shown: Sequence[Component] = file_of(BASE, "figures").COMPONENTS
        return shown

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        return {name: tables for part in PARTS for name, tables in file_of(part, "figures").DRAWN_FROM.items()}

    def question(self, experiment: "Experiment") -> str:
        part, cases = by_part(experiment.cases)[-1]
        question: str = file_of(part, "words").question([case.spec for case in cases])
        return question

    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> list[str]:
        answers = (file_of(part, "words").answer(chosen, made) for part, chosen in reversed(by_part(results)))
        return [sentence for answer in answers for sentence in answer]

    def recorded(self) -> RecordedPlots:
        from radarsim.studies.sonar.track import Recorded

        return Recorded(lambda spec: file_of(spec.parts[-1], "track"))


# ---- which part -----------------------------------------------------------------------------------------------------
def file_of(part: str, name: str) -> Any:
    """A module of a part, by the name of its file."""
    return import_module(f"{PARTS[part]}.{name}")


def by_part(cases: Sequence[CaseOrResult]) -> list[tuple[str, list[CaseOrResult]]]:
    """The cases, or results, of each part whose questions some of them ask."""
    chosen = [(part, [case for case in cases if part in case.spec.parts]) for part in PARTS]
    return [(part, members) for part, members in chosen if members]


STUDY = Sonar()
