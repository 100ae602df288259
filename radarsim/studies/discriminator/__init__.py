"""P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and its derivatives from one burst, and how often they lock."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.report.quantities import COMMON, FLOOR, LOCK, LOST, Quantity
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.discriminator.config import Keys
    from radarsim.studies.discriminator.study import Plan
    from radarsim.studies.floors.bound import Floor


class Discriminator(Study):
    """P4, as `study: discriminator`."""

    name = "discriminator"
    about = "P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and derivatives from one burst, how often they lock."
    filters = {
        "method: sequence": "discriminators over windows that grow to the whole burst, Fisher scoring in each",
        "method: ridge": "the classical rival: short-time spectrum, robust fit, unwrapping, then scoring; no prior",
    }
    exact_errors = False  # `Axes.exact_sigma` is the bound, which an estimator reaches or does not
    draws_sweeps = True  # lock is what is swept for, and has figures of its own

    def keys(self) -> "type[Keys]":
        from radarsim.studies.discriminator.config import Keys

        return Keys

    def quantities(self, spec: "Keys | None" = None) -> tuple[Quantity, ...]:
        return (*COMMON, LOCK, LOST, FLOOR)

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.discriminator import study

        return study.prepare(case)

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        return f"{__name__}.config", f"{__name__}.study"

    def simulate(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.discriminator import study

        return study.simulate(plan, first, count)

    def errors(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.discriminator import study

        return study.errors(plan, first, count)

    def floor(self, spec: "Keys", axes: Any) -> "Floor | None":
        from radarsim.studies.discriminator import floor

        return floor.floor(spec, axes)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.discriminator import tables

        return tables.tables(results)

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.studies.discriminator import tables

        return tables.curves(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.studies.discriminator import figures

        return figures.figures(results, tables, experiment)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.discriminator import figures

        return figures.DRAWN_FROM

    def question(self, experiment: "Experiment") -> str:
        from radarsim.studies.discriminator import answer

        return answer.question(experiment)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.discriminator import answer

        return answer.answer(results, tables)


STUDY = Discriminator()
