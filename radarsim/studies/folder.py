"""A study as a folder with the usual files: each part of the interface is a function of the same name in one of them.

A study that follows this declares an object and writes no class:

    STUDY = StudyFolder(
        package=__name__,
        name="random_walk",
        about="Random walk: a Kalman filter against a fixed gain.",
        filters={"kind: kalman": "Kalman filter", "kind: fixed_gain": "exponential smoothing"},
        paper=Paper("Kalman 1960"),
        offers=("recorded",),
    )

| part | is |
|---|---|
| `keys` | the class `config.Keys` |
| `prepare`, `simulate` | functions of `study` |
| `tables`; if offered `curves`, `gains`, `inputs`, `cost` | functions of `tables` |
| `figures` | the function of `figures` |
| `drawn_from` | `figures.DRAWN_FROM`, where there is one |
| `question`, `answer` | functions of `words` |
| `warnings`, if offered | the function of `words` |
| `claims`, if there is a paper | `claims.CLAIMS`, judged by `measures.Evidence` |
| `seconds_per_update`, `seconds_at_most`, if offered | functions of `cost` |
| `shortened`, `exact_but_for`, `costly`, if offered | functions of `study` |
| `readings`, if offered | an object of the class `readings.Readings` |
| `recorded`, if offered | an object of the class `track.Recorded` |
| `chart`, if offered | the function of `chart` |
| `shipped`, if offered | the folder `shipped` |

A file is imported when a part of it is first asked for, so that `radarsim list` loads no kernels.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, get_args

from radarsim.studies.interface import OptionalPart, Paper, Plan, RecordedPlots, Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.config.fields import Study as Keys
    from radarsim.engine.results import CaseResult
    from radarsim.report.claims import PaperClaims
    from radarsim.report.claims.readings import PaperReadings
    from radarsim.report.drawing import Chart, Figure


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyFolder(Study):
    """A study whose parts are the functions of the files of a folder.

    package is the folder as Python imports it, `__name__` in its `__init__.py`. paper is whose claims it judges. offers
    are the optional parts that it has; rate_tables what `Study.rates` says. The others are as in `Study`.
    """

    package: str
    name: str
    about: str
    filters: Mapping[str, str]
    paper: Paper | None = None
    offers: tuple[OptionalPart, ...] = ()
    exact_errors: bool = True
    draws_sweeps: bool = False
    rate_tables: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if unknown := set(self.offers) - set(get_args(OptionalPart)):
            allowed = ", ".join(get_args(OptionalPart))
            raise ValueError(f"study {self.name}: offers {', '.join(sorted(unknown))}, must be of {allowed}")

    def file(self, name: str) -> ModuleType:
        """A module of the folder."""
        return import_module(f"{self.package}.{name}")

    # ---- what is asked, and numbers ------------------------------------------------------------------------------
    def keys(self) -> "type[Keys]":
        return self.file("config").Keys

    def computes_in(self, spec: Any) -> tuple[str, ...]:
        return f"{self.package}.study", f"{self.package}.config"

    def prepare(self, case: "Case") -> Plan:
        return self.file("study").prepare(case)

    def simulate(self, plan: Any, first: int, count: int) -> "np.ndarray":
        return self.file("study").simulate(plan, first, count)

    def shortened(self, case: "Case", at_s: float | None, at_k: int | None) -> "Case":
        offered = "shortened" in self.offers
        return self.file("study").shortened(case, at_s, at_k) if offered else super().shortened(case, at_s, at_k)

    def exact_but_for(self, case: "Case") -> str:
        offered = "exact_but_for" in self.offers
        return self.file("study").exact_but_for(case) if offered else super().exact_but_for(case)

    def costly(self, case: "Case") -> bool:
        return self.file("study").costly(case) if "costly" in self.offers else super().costly(case)

    def rates(self, spec: Any) -> tuple[str, ...] | None:
        return self.rate_tables

    def seconds_per_update(self, plan: Any) -> Mapping[str, float]:
        offered = "seconds_per_update" in self.offers
        return self.file("cost").seconds_per_update(plan) if offered else super().seconds_per_update(plan)

    def seconds_at_most(self, plan: Any) -> float | None:
        offered = "seconds_at_most" in self.offers
        return self.file("cost").seconds_at_most(plan) if offered else super().seconds_at_most(plan)

    # ---- what is shown -------------------------------------------------------------------------------------------
    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        return self.file("tables").tables(results)

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        return self.file("tables").curves(results) if "curves" in self.offers else super().curves(results)

    def gains(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        return self.file("tables").gains(results) if "gains" in self.offers else super().gains(results)

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame | None":
        return self.file("tables").inputs(results) if "inputs" in self.offers else super().inputs(results)

    def cost(self, made: "Mapping[str, pd.DataFrame]", run: Mapping[str, Any]) -> "pd.DataFrame | None":
        return self.file("tables").cost(made, run) if "cost" in self.offers else super().cost(made, run)

    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        return self.file("figures").figures(results, made, experiment)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        return getattr(self.file("figures"), "DRAWN_FROM", {})

    def question(self, experiment: "Experiment") -> str:
        return self.file("words").question(experiment)

    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> Sequence[str]:
        return self.file("words").answer(results, made)

    def warnings(self, experiment: "Experiment") -> Sequence[str]:
        return self.file("words").warnings(experiment) if "warnings" in self.offers else super().warnings(experiment)

    def claims(self) -> "PaperClaims | None":
        if self.paper is None:
            return super().claims()
        from radarsim.report.claims import PaperClaims

        return PaperClaims(self.file("claims").CLAIMS, self.file("measures").Evidence, *self.paper)

    def readings(self) -> "PaperReadings | None":
        return self.file("readings").Readings() if "readings" in self.offers else super().readings()

    # ---- beside --------------------------------------------------------------------------------------------------
    def recorded(self) -> RecordedPlots | None:
        return self.file("track").Recorded() if "recorded" in self.offers else super().recorded()

    def chart(self, cases: "Sequence[Case]", references: "Sequence[Case]") -> "Chart | None":
        return (
            self.file("chart").chart(cases, references) if "chart" in self.offers else super().chart(cases, references)
        )

    def shipped(self) -> Path | None:
        (folder,) = import_module(self.package).__path__
        return Path(folder) / "shipped" if "shipped" in self.offers else super().shipped()
