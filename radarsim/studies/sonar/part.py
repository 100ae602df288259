"""The interface of the sonar's parts; each part is one of the paper's three questions.

A part has cases of its own, which its module `study` computes: `prepare(case)` makes a plan whose `simulate(first,
count)` makes the sums of a block. The interface here is for showing the results, in addition to what all parts have in
common, and for recorded plots. It calls functions of the same names in the part's files, as in
`radarsim.studies.folder`.
"""

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from radarsim.studies.folder import part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np

    from radarsim.config.experiment import Case
    from radarsim.report.claims import Claim
    from radarsim.studies.interface import Tracker

COMMON = __name__.rpartition(".")[0]


@dataclass(frozen=True)
class SonarPart:
    """A part.

    package is its folder as Python imports it. claimed: whether the paper makes claims about it. answers_with_sigma:
    whether the figures of σ answer its question, so that they come before its own. tracker_in and simulated_in are the
    packages whose module `track` contains its `Tracker` and its `simulated`.

    `tables(results)` and `figures(results, made)` are those of cases that ask this part's questions, in addition to
    common ones; a table may have no rows, a figure be None. `question(specs)` and `answer(results, made)` are
    sentences.
    """

    package: str
    claimed: bool = True
    answers_with_sigma: bool = False
    tracker_in: str = COMMON
    simulated_in: str = COMMON

    tables, figures = part("tables"), part("figures")
    question, answer = part("words"), part("words")

    def file(self, name: str) -> ModuleType:
        """A module of the part's folder."""
        return import_module(f"{self.package}.{name}")

    def drawn_from(self) -> "Mapping[str, Sequence[str]]":
        """The tables that its figures are drawn from, by how the figure's name begins."""
        return getattr(self.file("figures"), "DRAWN_FROM", {})

    def claims(self) -> "Sequence[Claim]":
        """The paper's claims about it."""
        from radarsim.report.claims.over import claims_of

        return claims_of(self.file) if self.claimed else ()

    def simulated(self, case: "Case", realisation: int) -> "Mapping[str, np.ndarray]":
        """The plots of one realisation, and the truth."""
        return import_module(f"{self.simulated_in}.track").simulated(case, realisation)

    def tracker(self, case: "Case") -> "Tracker":
        """The filters of a case over recorded plots, before their first plot."""
        return import_module(f"{self.tracker_in}.track").Tracker(case)
