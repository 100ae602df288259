"""What each of the sonar's parts is: one of the paper's three questions, as the study sees it.

A part has cases of its own, which its module `study` computes: `prepare(case)` makes a plan whose `simulate(first,
count)` makes the sums of a block. What is declared here is what it shows of them, beside what all parts have in common,
and what it does with recorded plots. Methods import what they need when they are called, as those of
`radarsim.studies.interface.Study`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case
    from radarsim.engine.results import CaseResult
    from radarsim.report.claims import Claim
    from radarsim.report.drawing import Figure
    from radarsim.studies.interface import Tracker


class SonarPart(ABC):
    """A part."""

    @abstractmethod
    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        """The tables of cases of which this part is asked, beside those of all parts; some may have no rows."""

    @abstractmethod
    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]"
    ) -> "dict[str, Figure | None]":
        """The figures of such cases, beside those of all parts; None where there is nothing to draw."""

    @abstractmethod
    def question(self, specs: Sequence[Any]) -> str:
        """What is asked of such cases, in one sentence."""

    @abstractmethod
    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> list[str]:
        """The answer: sentences with numbers and 95 % intervals."""

    def claims(self) -> "tuple[Claim, ...]":
        """The paper's claims on it. Default: none."""
        return ()

    def simulated(self, case: "Case", realisation: int) -> "Mapping[str, np.ndarray]":
        """The plots of one realisation, and the truth. Default: those of a target whose plots are known."""
        from radarsim.studies.sonar import track

        return track.simulated(case, realisation)

    @abstractmethod
    def tracker(self, case: "Case") -> "Tracker":
        """The filters of a case over recorded plots, before their first plot."""
