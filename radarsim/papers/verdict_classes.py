"""The class of a claim over all interpretations that its paper allows, beside its class as shipped.

It is computed in one place, `ClaimVerdicts.outcome`, when `radarsim interpretations` judges a claim under each of them,
and kept as a row of classes.csv. Everything else that shows a class looks it up."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from radarsim.config.identity import digest
from radarsim.language.translate import term, tr
from radarsim.papers.claim import Claim
from radarsim.papers.claim_sources import measure_calls, package_sources, plain_data
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN
from radarsim.papers.interpretations import OpenChoices
from radarsim.papers.verdict_rule import CLASSES, CONTRADICTORY, DEPENDS, FIXED_CLASSES, REFUTED, UNDECIDED

CLASS_FILE_COLUMNS = ("claim", "class", "holds", "of", "depends_on", "needed", "declared")
CLASS_COLUMNS = ("class", "overall", "holds", "of", "depends_on", "needed")  # columns of claims.csv
DEPENDS_ON = term("depends on {choices}")
SHIPPED_AND_OVERALL = term("{own} as shipped; {over}")
REFUTED_AND_DEPENDS = term("refuted as shipped; true only with other choices of {choices}")
OVERALL = term("{kind} over all interpretations")
ONLY_SHIPPED = term("{own} as shipped; other interpretations not judged")


@dataclass(frozen=True)
class VerdictClass:
    """A claim over all its interpretations: its class, in how many interpretations it is true, the choices that flip
    it.

    needed: realisations that would decide it if undecided, else NaN. declared: a mark of its declaration."""

    claim: str
    kind: str
    holds_in: int
    interpretation_count: int
    depends_on: str
    needed: float
    declaration_digest: str

    def as_row(self) -> dict[str, Any]:
        """The row of classes.csv."""
        needed = "" if math.isnan(self.needed) else int(self.needed)
        values = (
            self.claim,
            self.kind,
            self.holds_in,
            self.interpretation_count,
            self.depends_on,
            needed,
            self.declaration_digest,
        )
        return dict(zip(CLASS_FILE_COLUMNS, values, strict=True))

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> "VerdictClass":
        """From a row of classes.csv. Raises ValueError or LookupError for an invalid one."""
        if row["class"] not in CLASSES:
            raise ValueError(row["class"])
        needed = float(row["needed"]) if row["needed"] else math.nan
        holds, count = int(row["holds"]), int(row["of"])
        return cls(row["claim"], row["class"], holds, count, row["depends_on"], needed, row["declared"])


# For each claim that depends on an open choice: its class over all interpretations, None where unknown.
KnownClasses = Mapping[str, VerdictClass | None]


def declaration_digest(choices: OpenChoices | None, claim: Claim) -> str:
    """A mark of all that a verdict follows from: a claim's assertions and what measures them, and the choices that
    affect it, with what they set (None: its paper leaves nothing open); see `claim_sources`. A changed mark means
    another claim."""
    part_declarations = [
        [
            *(part.what, part.unit, part.statement, part.number, part.variant, part.against_print, part.asserted),
            *(repr(end) for end in (part.expected.lo, part.expected.hi, part.expected.margin)),
            part.expected.kind,
            plain_data(part.cases),
            measure_calls(part),
        ]
        for part in claim.parts
    ]
    choice_declarations = [
        [
            *(choice.key, choice.contradicts),
            *(
                [alternative.name, alternative.kind, plain_data(alternative.sets)]
                for alternative in choice.alternatives
            ),
        ]
        for choice in (choices.choices if choices else ())
        if choice.affects(claim.id)
    ]
    sources = package_sources(claim, choices.module if choices else "")
    return digest([part_declarations, claim.judging_options, choice_declarations, sources])[:16]


def add_classes(rows: Sequence[Mapping[str, Any]], classes: KnownClasses) -> list[dict[str, Any]]:
    """Rows of claims.csv with the class over all interpretations in place of that as shipped, which moves to
    `as_shipped`. Rows that were not judged stay as they are."""
    return [dict(row) | _class_columns(row, classes) for row in rows]


def _class_columns(row: Mapping[str, Any], classes: KnownClasses) -> dict[str, Any]:
    as_shipped = row["as_shipped"]
    if as_shipped in (NOT_RUN, NOT_JUDGED):
        return {}
    overall = classes.get(str(row["claim"]))
    if overall is None:
        columns: dict[str, Any] = {"class": as_shipped, "holds": math.nan, "of": math.nan, "depends_on": ""}
        is_unknown = str(row["claim"]) in classes and as_shipped not in FIXED_CLASSES
        return columns | {"overall": ONLY_SHIPPED.format(own=as_shipped) if is_unknown else as_shipped}
    needed = {} if as_shipped == UNDECIDED else {"needed": overall.needed}
    columns_of_class = {
        "class": overall.kind,
        "holds": overall.holds_in,
        "of": overall.interpretation_count,
        "depends_on": overall.depends_on,
    }
    return columns_of_class | needed | {"overall": class_words(overall.kind, as_shipped, overall.depends_on)}


def rows_in_words(rows: Iterable[Mapping[str, Any]], papers: Iterable[OpenChoices | None]) -> list[dict[str, Any]]:
    """Rows of claims.csv for people: what a claim depends on is in the words of its paper's interpretations."""
    by_paper = {paper.paper: paper for paper in papers if paper is not None}
    records = [dict(row) for row in rows]
    for row in records:
        if row["depends_on"]:
            row["depends_on"] = by_paper[row["claim"].partition(".")[0]].list_choices(row["depends_on"].split(", "))
    return records


def is_judged_only_as_shipped(row: Mapping[str, Any]) -> bool:
    """Whether a claim was judged only as shipped, though open choices may change its verdict."""
    return bool(row["overall"] == ONLY_SHIPPED.format(own=row["as_shipped"]))


def verdict_words(row: Mapping[str, Any]) -> str:
    """The verdict on a claim of claims.csv, as a phrase in the current language."""
    if is_judged_only_as_shipped(row):
        return tr(ONLY_SHIPPED, own=term(row["as_shipped"]))
    if (row["class"], row["as_shipped"]) == (DEPENDS, REFUTED) and row["depends_on"]:
        return tr(REFUTED_AND_DEPENDS, choices=row["depends_on"])
    return class_words(row["class"], row["as_shipped"], row["depends_on"], tr)


def class_words(kind: str, as_shipped: str, depends_on: str = "", fill: Callable[..., str] = str.format) -> str:
    """The verdict on a claim as a phrase: its class, and the one as shipped if it differs.

    say: puts values into a message, as `translate.tr` does; default: in English."""
    overall: str = fill(DEPENDS_ON, choices=depends_on) if kind == DEPENDS and depends_on else fill(kind)
    if as_shipped == kind:
        return overall
    if kind not in (DEPENDS, CONTRADICTORY):
        overall = fill(OVERALL, kind=overall)
    return fill(SHIPPED_AND_OVERALL, own=term(as_shipped), over=overall)
