"""P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.language.translate import term
from radarsim.report.quantities import COMMON, Component, Quantity
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.multimodel.config import Keys
    from radarsim.studies.multimodel.recorded_plots import FlightRecordedPlots
    from radarsim.studies.multimodel.study import Plan

PROBABILITY = Quantity(
    *("probability", term("probability"), "probabilities", "probability"), per=term("model"), kind="share"
)


class MultiModel(Study):
    """P2, as `study: multimodel`."""

    name = "multimodel"
    about = "P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."
    filters = {
        "family": "kalman, gpb1 (MMA1), imm (MMA2), gpb2 (MMA3) with a bank of one to five motion models",
        "merge": "rule of the partial merges: moment, best, combined, modified_combined",
        "output": "rule that forms the estimate: moment, best",
        "covariance_at": "the plot's covariance at the plot or at its prediction",
    }

    def keys(self) -> "type[Keys]":
        from radarsim.studies.multimodel.config import Keys

        return Keys

    def quantities(self, spec: "Keys | None" = None) -> tuple[Quantity, ...]:
        return (*COMMON, PROBABILITY)

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.multimodel import study

        return study.prepare(case)

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        modules = f"{__name__}.config", f"{__name__}.study"
        return (*modules, f"{__name__}.recorded_plots") if plots else modules

    def simulate(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.multimodel import study

        return study.simulate(plan, first, count)

    def errors(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.multimodel import study

        return study.errors(plan, first, count)

    def seconds_per_update(self, plan: "Plan") -> Mapping[str, float]:
        from radarsim.studies.multimodel import cost

        return cost.seconds_per_update(plan)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.multimodel import tables

        return tables.tables(results)

    def cost(self, tables: "Mapping[str, pd.DataFrame]", run: Mapping[str, Any]) -> "pd.DataFrame | None":
        from radarsim.studies.multimodel.tables import cost

        return cost(tables, run)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.studies.multimodel import figures

        return figures.figures(results, tables, experiment)

    def user_filter_components(self) -> Sequence[Component]:
        from radarsim.studies.multimodel import figures

        return figures.COMPONENTS

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.multimodel import figures

        return figures.DRAWN_FROM

    def question(self, experiment: "Experiment") -> str:
        from radarsim.studies.multimodel import answer

        return answer.question(experiment)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.multimodel import answer

        return answer.answer(results, tables)

    def answer_points(self, result: "CaseResult") -> Sequence[tuple[str, float]]:
        from radarsim.studies.multimodel import answer

        return answer.answer_points(result)

    def recording_interface(self) -> "FlightRecordedPlots":
        from radarsim.studies.multimodel.recorded_plots import FlightRecordedPlots

        return FlightRecordedPlots()


STUDY = MultiModel()
