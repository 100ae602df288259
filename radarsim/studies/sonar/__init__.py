"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from radarsim.language import term
from radarsim.report.quantities import COMMON, Quantity
from radarsim.studies.interface import Plan, RecordedPlots, Study
from radarsim.studies.sonar.part import SonarPart

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.claims import PaperClaims
    from radarsim.report.claims.over import PaperReadings
    from radarsim.report.drawing import Figure
    from radarsim.studies.sonar.clutter.study import Plan as ClutterPlan
    from radarsim.studies.sonar.schema import Sonar as AllKeys
    from radarsim.studies.sonar.smoothing.study import SharedPlan
    from radarsim.studies.sonar.study import RealisationPlan

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
        "kind: adaptive": "growing memory that a manoeuvre detector (3) restarts, at a higher degree or kept short",
        "association: nearest": "a tracker among false plots: the nearest plot in the gate; of kind kalman, degree 1",
        "association: pda": "a tracker with probabilistic data association",
        "association: known": "a filter that knows the target's plots, for comparison",
        "kind: imm": "two interacting Kalman filters, steady and manoeuvring",
    }

    def keys(self) -> "type[AllKeys]":
        from radarsim.studies.sonar import schema

        return schema.Sonar

    def prepare(self, case: "Case") -> Plan:
        return part_of(case.spec).file("study").prepare(case)

    def quantities(self, spec: "AllKeys | None" = None) -> tuple[Quantity, ...]:
        return COMMON + TRACKING if spec is None or "clutter" in spec.parts else COMMON

    def simulate(self, plan: "RealisationPlan | SharedPlan | ClutterPlan", first: int, count: int) -> "np.ndarray":
        return plan.simulate(first, count)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.sonar import tables

        made = tables.tables(results)
        for part, chosen in by_part(results):
            made |= part.tables(chosen)
        return {name: table for name, table in made.items() if len(table)}

    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.studies.sonar import figures

        common: dict[str, Figure | None] = {**figures.figures(results, made, experiment)}
        drawn: dict[str, Figure | None] = {}
        for part, chosen in reversed(by_part(results)):  # first what answers the question, which is the last part's
            own = part.figures(chosen, made)
            drawn |= common | own if part.answers_with_sigma else own | common
        return {name: figure for name, figure in drawn.items() if figure}

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        return {name: tables for part in parts().values() for name, tables in part.drawn_from().items()}

    def question(self, experiment: "Experiment") -> str:
        part, cases = by_part(experiment.cases)[-1]
        return part.question([case.spec for case in cases])

    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> list[str]:
        return [sentence for part, chosen in reversed(by_part(results)) for sentence in part.answer(chosen, made)]

    def claims(self) -> "PaperClaims":
        from radarsim.report.claims import PaperClaims
        from radarsim.studies.sonar.measures import Evidence

        claims = [claim for part in parts().values() for claim in part.claims()]
        claims.sort(key=lambda claim: int(claim.id.partition(".")[2]))
        of_smoothing = tuple(claim.id for claim in claims if claim.config == "sonar_smoothing")
        held_too = {"sonar_fluctuating": of_smoothing}  # which includes its cases
        return PaperClaims(claims, Evidence, "Butyrskiy", page="sonar", may_grow=("filters",), held_too=held_too)

    def readings(self) -> "PaperReadings":
        from radarsim.studies.sonar.manoeuvre.readings import Readings

        return Readings()

    def recorded(self) -> RecordedPlots:
        from radarsim.studies.sonar.track import Recorded

        return Recorded(part_of)


# ---- which part -----------------------------------------------------------------------------------------------------
def parts() -> Mapping[str, SonarPart]:
    """The parts by name; a part comes after those whose questions are asked of its cases too."""
    from radarsim.studies.sonar import clutter, manoeuvre, smoothing

    return {"smoothing": smoothing.PART, "manoeuvre": manoeuvre.PART, "clutter": clutter.PART}


def part_of(spec: "AllKeys") -> SonarPart:
    """The part that computes a case."""
    return parts()[spec.parts[-1]]


def by_part(cases: Sequence[CaseOrResult]) -> list[tuple[SonarPart, list[CaseOrResult]]]:
    """The cases, or results, of each part whose questions some of them ask."""
    chosen = [(part, [case for case in cases if name in case.spec.parts]) for name, part in parts().items()]
    return [(part, members) for part, members in chosen if members]


STUDY = Sonar()
