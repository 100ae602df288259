"""The result of `radarsim interpretations`: verdicts by paper, their table and figures."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.api.display import Displayable
from radarsim.language.translate import tr
from radarsim.papers.open_papers import OpenPaper
from radarsim.papers.specification_curve import specification_curve
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts, verdict_columns, verdict_rows
from radarsim.report.csv_text import read_rows
from radarsim.report.drawing.model import Figure

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class PaperVerdicts:
    """Verdicts over the interpretations of a paper."""

    paper: OpenPaper
    claims: list[ClaimVerdicts]


@dataclass(repr=False)
class InterpretationVerdicts(Displayable):
    """Result of `interpretations`: for each paper, and the files written, by their path under `folder`.

    undecided_messages: a line for each claim that stayed undecided although `decide` was set. outdated: configs whose
    stored claims have another class."""

    papers: list[PaperVerdicts]
    folder: Path
    files: tuple[str, ...] = field(default=())
    undecided_messages: tuple[str, ...] = field(default=())
    outdated: tuple[str, ...] = field(default=())

    @property
    def claims(self) -> list[ClaimVerdicts]:
        """The claims, each with its verdicts."""
        return [claim for paper in self.papers for claim in paper.claims]

    @property
    def table(self) -> "pd.DataFrame":
        """The rows of interpretations.csv for these claims: one for each claim, interpretation and part."""
        columns = verdict_columns(paper.paper.interpretations for paper in self.papers)
        rows = [
            row
            for claim in self.claims
            for verdict in claim.verdicts
            for row in verdict_rows(verdict, columns, claim.outcome)
        ]
        return read_rows(rows, columns)

    @property
    def _figures_by_name(self) -> dict[str, Figure]:
        claims = (claim for claim in self.claims if len(claim.verdicts) > 1 and claim.outcome is not None)
        return {claim.claim.id: specification_curve(claim) for claim in claims}

    def _answer_lines(self) -> list[str]:
        return [
            f"{claim.claim.id} {tr(claim.outcome.kind)}: {claim.sentence()}" for claim in self.claims if claim.outcome
        ]
