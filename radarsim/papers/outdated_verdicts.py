"""Stored verdicts on claims that have been edited since: they count as not run.

A row of claims.csv has in `declared` the mark of all that its verdict follows from; see `declaration_digest`."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from radarsim.papers.claim import PaperClaims
from radarsim.papers.claims_table import not_run_row
from radarsim.papers.paper_keys import has_shipped_claims
from radarsim.papers.study_claims import choices_of, claims_of
from radarsim.papers.verdict_classes import declaration_digest
from radarsim.studies.interface import Study

Marks = Mapping[str, Collection[str]]  # for each claim the marks with which a stored verdict holds


def current_marks(study: Study) -> dict[str, Collection[str]]:
    """The marks of a study's claims as they are declared now. Versions before 0.3 wrote none: those of shipped claims,
    which nobody edits, hold without."""
    paper, choices = claims_of(study), choices_of(study)
    unmarked = ("",) if has_shipped_claims(study) else ()
    claims = paper.claims if paper else ()
    return {claim.id: (declaration_digest(choices, claim), *unmarked) for claim in claims}


def current_rows(
    rows: Iterable[Mapping[str, Any]], papers: Sequence[PaperClaims], marks: Marks
) -> list[dict[str, Any]]:
    """Stored rows of claims.csv, with one row, as not run, for each claim that has been edited since; claims that are
    gone have none."""
    claims = {claim.id: (paper.paper, claim) for paper in papers for claim in paper.claims}
    current: dict[Any, dict[str, Any]] = {}
    for number, row in enumerate(rows):
        name = row["claim"]
        mark = row.get("declared", "")
        if (mark if isinstance(mark, str) else "") in marks.get(name, ()):  # NaN in a table without any
            current[number] = dict(row)
        elif name in claims:
            paper, claim = claims[name]
            current.setdefault(name, not_run_row(claim, paper))
    return list(current.values())
