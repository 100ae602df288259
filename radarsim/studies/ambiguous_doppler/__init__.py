"""Folded Doppler velocity: filters that unfold it by hypotheses, with memory and without (P1's suggested extension)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.language.translate import term
from radarsim.report.quantities import COMMON, FLOORS, RIGHT, WRONG, Quantity
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import Axes, CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.ambiguous_doppler.config import Keys
    from radarsim.studies.ambiguous_doppler.recorded_plots import FoldedRecordedPlots
    from radarsim.studies.ambiguous_doppler.study import Plan
    from radarsim.studies.floors.bound import Floor

COLUMN = "excess_over_oracle_percent"  # against the filter that is given the true folds
ABOVE_ORACLE = Quantity(
    *("above_oracle", term("σ above the oracle's"), "gains", COLUMN, "exact_above_oracle"),
    per="component",
    kind="signed",
    unit="%",
    squares=True,
    paired=True,
)


class AmbiguousDoppler(Study):
    """Extension of P1, as `study: ambiguous_doppler`."""

    name = "ambiguous_doppler"
    about = "Beyond P1: folded Doppler, unfolded by hypotheses kept from scan to scan."
    filters = {
        "doppler: none": "Kalman filter on range alone, order 0, 1 or 2: the upper reference",
        "doppler: unfolded": "the same with the velocity unfolded by the truth: the lower reference",
        "doppler: folded": "the same, unfolded by up to `hypotheses` sequences of folds; 1: the nearest fold",
        "merge: each_scan": "the same, hypotheses merged into one each scan (GPB1): no memory",
    }

    def keys(self) -> "type[Keys]":
        from radarsim.studies.ambiguous_doppler.config import Keys

        return Keys

    def quantities(self, spec: "Keys | None" = None) -> tuple[Quantity, ...]:
        return (*COMMON, ABOVE_ORACLE, RIGHT, WRONG, *FLOORS)

    def without_manoeuvre(self, spec: "Keys") -> Mapping[str, Any]:
        from radarsim.studies.radial_truth import resting_target

        return {"target": resting_target(spec.target)}

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.ambiguous_doppler import study

        return study.prepare(case)

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        modules = f"{__name__}.config", f"{__name__}.study"
        return (*modules, f"{__name__}.recorded_plots") if plots else modules

    def simulate(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.ambiguous_doppler import study

        return study.simulate(plan, first, count)

    def errors(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.ambiguous_doppler import study

        return study.errors(plan, first, count)

    def floor(self, spec: "Keys", axes: "Axes") -> "Floor | None":
        from radarsim.studies.ambiguous_doppler import floor

        return floor.floor(spec, axes)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.ambiguous_doppler import tables

        return tables.tables(results)

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.studies.ambiguous_doppler import tables

        return tables.inputs(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.studies.ambiguous_doppler import figures

        return figures.figures(results, tables, experiment)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.ambiguous_doppler import figures

        return figures.DRAWN_FROM

    def question(self, experiment: "Experiment") -> str:
        from radarsim.studies.ambiguous_doppler import answer

        return answer.question(experiment)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.ambiguous_doppler import answer
        from radarsim.studies.counted_scans import result_scans
        from radarsim.studies.process_noise_answer import best_noise

        scans = {result.name: result_scans(self, result) for result in results if result.axes.combines.any()}
        return answer.answer(results, tables, scans, best_noise(self, results, tables))

    def warnings(self, experiment: "Experiment") -> Sequence[str]:
        from radarsim.studies.ambiguous_doppler import answer

        return answer.warnings(experiment)

    def recording_interface(self) -> "FoldedRecordedPlots":
        from radarsim.studies.ambiguous_doppler.recorded_plots import FoldedRecordedPlots

        return FoldedRecordedPlots()


STUDY = AmbiguousDoppler()
