"""claims.csv: verdicts on the claims that an experiment can judge."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.report import tables as common
from radarsim.report.claims.declared import Claim, PaperClaims
from radarsim.report.claims.evidence import Evidence, Missing
from radarsim.report.claims.paper import Described, Shipped, described, own_members
from radarsim.report.claims.rule import CONFIRMED, REFUTED
from radarsim.report.statistics import Estimate

if TYPE_CHECKING:
    import pandas as pd

UNCLEAR, NOT_RUN = "not distinguishable", "not run"


def verdict(of: Estimate, strict: tuple[float, float]) -> str:
    """Whether an interval lies inside a range, outside, or neither: the rule of version 0.1."""
    if not (of.lo <= of.hi):
        return UNCLEAR
    if strict[0] <= of.lo and of.hi <= strict[1]:
        return CONFIRMED
    if of.hi < strict[0] or of.lo > strict[1]:
        return REFUTED
    return UNCLEAR


def overall(verdicts: Sequence[str]) -> str:
    """Of a claim with several parts: refuted with any of them, confirmed with all."""
    if REFUTED in verdicts:
        return REFUTED
    return CONFIRMED if set(verdicts) == {CONFIRMED} else UNCLEAR


CLAIMED = (
    *("claim", "paper", "statement", "case", "measured", "lo", "hi", "expected", "verdict"),
    *("expected_lo", "expected_hi", "what", "unit", "place", "reading", "overall"),
)
NUMBERS = ("measured", "lo", "hi", "expected_lo", "expected_hi")  # of these columns; empty where there is none


def judged(
    of: PaperClaims | None, results: Sequence[CaseResult], made: "Mapping[str, pd.DataFrame]", shipped: Shipped
) -> "pd.DataFrame":
    """claims.csv: a row for each part of each claim that these results can judge, those of whole claims only.

    A claim sees only the cases that are the paper's: those of its config, which `shipped` gives by its stem.
    """
    rows: list[tuple] = []
    if of is not None:
        papers = _Papers(of, results, made, shipped)
        for claim in of.claims:
            if (evidence := papers.evidence(claim.config)) is not None:
                rows += _rows(claim, of.paper, evidence)
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(CLAIMED)})


class _Papers:
    """What of the results is the paper's, by the config of a claim."""

    def __init__(self, of: PaperClaims, results: Sequence[CaseResult], made: Mapping, shipped: Shipped):
        self._of, self._results, self._made, self._shipped = of, results, made, shipped
        self._seen: dict[str, Evidence | None] = {}

    def evidence(self, config: str) -> Evidence | None:
        """The evidence that claims of a config may see; None where no case is the paper's."""
        if config not in self._seen:
            specs = self._shipped(config)
            self._seen[config] = self._evidence([described(spec, self._of.may_grow) for spec in specs or ()])
        return self._seen[config]

    def _evidence(self, shipped: Sequence[Described]) -> Evidence | None:
        every = {result.name: own_members(result.spec, shipped, self._of.may_grow) for result in self._results}
        places = {name: own for name, own in every.items() if own is not None}
        if not places:
            return None
        made = self._made
        if len(places) < len(every):
            made = {name: _of_cases(table, set(places)) for name, table in made.items()}
        return self._of.evidence([result for result in self._results if result.name in places], made, places)


def _of_cases(table: "pd.DataFrame", names: set[str]) -> "pd.DataFrame":
    """The rows of a table that belong to cases of these names, or to none."""
    return table[table["case"].isin(names)] if "case" in table else table


def _rows(claim: Claim, paper: str, evidence: Evidence) -> list[tuple]:
    try:
        measured = [part.measure(evidence) for part in claim.parts]
        cases = [", ".join(evidence.case(key).name for key in part.cases) for part in claim.parts]
    except Missing:
        return []
    verdicts = [verdict(of, part.expected.strict) for of, part in zip(measured, claim.parts, strict=True)]
    return [
        (
            *(claim.id, paper, claim.statement, case, float(of.value), float(of.lo), float(of.hi)),
            *(part.expected.words, said, _end(part.expected.lo), _end(part.expected.hi)),
            *(part.what, part.unit, claim.place, claim.reading, overall(verdicts)),
        )
        for part, case, of, said in zip(claim.parts, cases, measured, verdicts, strict=True)
    ]


def _end(value: float) -> float:
    """An end of a range as a table holds it: at twelve digits, not-a-number where there is none."""
    return float(f"{value:.12g}") if math.isfinite(value) else math.nan


def listed(papers: Sequence[PaperClaims], stored: Mapping[str, Sequence[Mapping]]) -> list[dict]:
    """Rows of claims with the columns of claims.csv and `config`: as stored, or once as not run.

    stored: config stem → the rows of its claims.csv.
    """
    rows = []
    for paper, claim in ((of.paper, claim) for of in papers for claim in of.claims):
        own = [dict(row) for row in stored.get(claim.config, ()) if row["claim"] == claim.id]
        blank = dict.fromkeys(CLAIMED, "") | {"claim": claim.id, "paper": paper}
        blank |= {"place": claim.place, "reading": claim.reading}
        rows += own or [blank | {"statement": claim.statement, "verdict": NOT_RUN, "overall": NOT_RUN}]
        for row in rows[-max(1, len(own)) :]:
            row["config"] = claim.config
    return rows
