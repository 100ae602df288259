"""The interface of the sonar's parts; each part is one of the paper's three questions.

A part has cases of its own, which its module `study` computes: `prepare(case)` makes a plan whose `simulate(first,
count)` makes the sums of a block. The interface here is for showing the results, in addition to what all parts have in
common, and for recorded plots. It calls functions of the same names in the part's files, as in
`radarsim.studies.folder`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case
    from radarsim.engine.results import CaseResult
    from radarsim.report.claims import Claim
    from radarsim.report.drawing import Figure
    from radarsim.studies.interface import Tracker

COMMON = __name__.rpartition(".")[0]


@dataclass(frozen=True)
class SonarPart:
    """A part.

    package is its folder as Python imports it. claimed: whether the paper makes claims about it. answers_with_sigma:
    whether the figures of σ answer its question, so that they come before its own. tracker_in and simulated_in are the
    packages whose module `track` contains its `Tracker` and its `simulated`.
    """

    package: str
    claimed: bool = True
    answers_with_sigma: bool = False
    tracker_in: str = COMMON
    simulated_in: str = COMMON

    def file(self, name: str) -> ModuleType:
        """A module of the part's folder."""
        return import_module(f"{self.package}.{name}")

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        """The tables of cases that ask this part's questions, in addition to common ones; some may have no rows."""
        return self.file("tables").tables(results)

    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]"
    ) -> "dict[str, Figure | None]":
        """The figures of such cases, in addition to common ones; None where there is nothing to draw."""
        return self.file("figures").figures(results, made)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        """The tables that its figures are drawn from, by how the figure's name begins."""
        return getattr(self.file("figures"), "DRAWN_FROM", {})

    def question(self, specs: Sequence[Any]) -> str:
        """The question of such cases, in one sentence."""
        return self.file("words").question(specs)

    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> list[str]:
        """The answer: sentences with numbers and 95 % intervals."""
        return self.file("words").answer(results, made)

    def claims(self) -> "tuple[Claim, ...]":
        """The paper's claims about it."""
        return self.file("claims").CLAIMS if self.claimed else ()

    def simulated(self, case: "Case", realisation: int) -> "Mapping[str, np.ndarray]":
        """The plots of one realisation, and the truth."""
        return import_module(f"{self.simulated_in}.track").simulated(case, realisation)

    def tracker(self, case: "Case") -> "Tracker":
        """The filters of a case over recorded plots, before their first plot."""
        return import_module(f"{self.tracker_in}.track").Tracker(case)
