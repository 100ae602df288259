"""The result of `radarsim interpretations`: verdicts by paper, their table and figures."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.app.shown import Shown
from radarsim.language import tr
from radarsim.papers.open_papers import OpenPaper
from radarsim.papers.specification_curve import specification_curve
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts, verdict_columns, verdict_rows
from radarsim.report.drawing import Figure
from radarsim.report.tables import read_rows

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class PaperVerdicts:
    """Verdicts over the interpretations of a paper."""

    paper: OpenPaper
    over: list[ClaimVerdicts]


@dataclass(repr=False)
class InterpretationVerdicts(Shown):
    """Result of `interpretations`: for each paper, and the files written, by their path under `folder`.

    left: a line for each claim that stayed undecided although `decide` was set. outdated: configs whose stored claims
    have another class."""

    read: list[PaperVerdicts]
    folder: Path
    files: tuple[str, ...] = field(default=())
    left: tuple[str, ...] = field(default=())
    outdated: tuple[str, ...] = field(default=())

    @property
    def over(self) -> list[ClaimVerdicts]:
        """The claims, each with its verdicts."""
        return [over for read in self.read for over in read.over]

    @property
    def table(self) -> "pd.DataFrame":
        """The rows of interpretations.csv for these claims: one for each claim, interpretation and part."""
        names = verdict_columns(read.paper.interpretations for read in self.read)
        made = [row for over in self.over for one in over.under for row in verdict_rows(one, names, over.outcome)]
        return read_rows(made, names)

    @property
    def _described(self) -> dict[str, Figure]:
        several = (over for over in self.over if len(over.under) > 1 and over.outcome is not None)
        return {over.claim.id: specification_curve(over) for over in several}

    def _said(self) -> list[str]:
        return [f"{over.claim.id} {tr(over.outcome.kind)}: {over.sentence()}" for over in self.over if over.outcome]
