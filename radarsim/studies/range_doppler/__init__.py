"""P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."""

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.report.quantities import COMMON, FLOORS, Quantity
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import Axes, CaseResult
    from radarsim.report.drawing.model import Chart, Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.counted_scans import CountedScans
    from radarsim.studies.floors.bound import Floor
    from radarsim.studies.range_doppler.config import Keys
    from radarsim.studies.range_doppler.package_filters import GivenGains
    from radarsim.studies.range_doppler.recorded_plots import RangeDopplerRecordedPlots
    from radarsim.studies.range_doppler.study import Plan


class RangeDoppler(Study):
    """P1, as `study: range_doppler`."""

    name = "range_doppler"
    about = "P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."
    filters = {
        "observes: [range]": "Kalman filter of the second order on range, started by least squares on three scans",
        "observes: [range, velocity]": "the same on range and radial velocity, started on two scans",
        "kind: NAME": "a filter of an installed package (entry points radarsim.filters), by its gains at every scan",
    }

    def keys(self) -> "type[Keys]":
        from radarsim.studies.range_doppler.config import Keys

        return Keys

    def own_filters(self) -> "type[GivenGains]":
        from radarsim.studies.range_doppler.package_filters import package_filter_class

        return package_filter_class()

    def quantities(self, spec: "Keys | None" = None) -> tuple[Quantity, ...]:
        return (*COMMON, *FLOORS)

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.range_doppler import study

        return study.prepare(case)

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        modules = f"{__name__}.config", f"{__name__}.study", f"{__name__}.package_filters"
        return (*modules, f"{__name__}.recorded_plots") if plots else modules

    def simulate(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.range_doppler import study

        return study.simulate(plan, first, count)

    def errors(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.range_doppler import study

        return study.errors(plan, first, count)

    def shortened(self, case: "Case", at_s: float | None, at_k: int | None) -> "Case":
        from radarsim.studies.range_doppler import study

        return study.shorten_case(case, at_s, at_k)

    def counted_scans(self, case: "Case", component: str | None = None, axes: "Axes | None" = None) -> "CountedScans":
        from radarsim.studies.range_doppler import long_run

        return long_run.counted_scans(case, component)

    def in_the_long_run(self, case: "Case", filter_names: "Collection[str] | None" = None) -> "Case":
        from radarsim.studies.range_doppler import long_run

        return long_run.in_the_long_run(case)

    def steady_sigma(self, case: "Case") -> "np.ndarray | None":
        from radarsim.studies.range_doppler import long_run

        return long_run.steady_sigma(case)

    def exact_but_for(self, case: "Case") -> str:
        from radarsim.studies.range_doppler import study

        return study.exact_but_for(case)

    def costly(self, case: "Case") -> bool:
        from radarsim.studies.range_doppler import study

        return study.is_costly(case)

    def floor(self, spec: "Keys", axes: "Axes") -> "Floor | None":
        from radarsim.studies.range_doppler import floor

        return floor.floor(spec, axes)

    def seconds_at_most(self, plan: "Plan") -> float:
        from radarsim.studies.range_doppler import cost

        return cost.seconds_at_most(plan)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.range_doppler import tables

        return tables.tables(results)

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.studies.range_doppler import tables

        return tables.curves(results)

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.studies.range_doppler import tables

        return tables.inputs(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.studies.range_doppler import figures

        return figures.figures(results, tables, experiment)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.range_doppler import figures

        return figures.DRAWN_FROM

    def question(self, experiment: "Experiment") -> str:
        from radarsim.studies.range_doppler import answer

        return answer.question(experiment)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.process_noise_remedy import remedy_sentence
        from radarsim.studies.range_doppler import answer

        return [*answer.answer(results, tables), *remedy_sentence(self, results, tables, answer.alternatives)]

    def recording_interface(self) -> "RangeDopplerRecordedPlots":
        from radarsim.studies.range_doppler.recorded_plots import RangeDopplerRecordedPlots

        return RangeDopplerRecordedPlots()

    def chart(self, cases: "Sequence[Case]", references: "Sequence[Case]") -> "Chart":
        from radarsim.studies.range_doppler import doppler_gain

        return doppler_gain.chart(cases, references)


STUDY = RangeDoppler()
