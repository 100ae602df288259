"""The class of a claim over all interpretations that its paper allows, beside its class as shipped.

It is computed in one place, `ClaimVerdicts.outcome`, when `radarsim interpretations` judges a claim under each of them,
and kept as a row of classes.csv. Everything else that shows a class looks it up."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from radarsim.config.experiment import digest
from radarsim.language import term, tr
from radarsim.papers.claim import Claim
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN
from radarsim.papers.interpretations import PaperInterpretations
from radarsim.papers.verdict_rule import CLASSES, CONTRADICTORY, DEPENDS, FIXED_CLASSES, UNDECIDED
from radarsim.papers.verdicts_by_interpretation import DEPENDS_ON, ClaimVerdicts

CLASS_FILE_COLUMNS = ("claim", "class", "holds", "of", "depends_on", "needed", "declared")
CLASS_COLUMNS = ("class", "overall", "holds", "of", "depends_on", "needed")  # columns of claims.csv
SHIPPED_AND_OVERALL = term("{own} as shipped; {over}")
OVERALL = term("{kind} over all interpretations")
ONLY_SHIPPED = term("{own} as shipped; other interpretations not judged")


@dataclass(frozen=True)
class VerdictClass:
    """A claim over all its interpretations: its class, in how many interpretations it is true, the choices that flip
    it.

    needed: realisations that would decide it if undecided, else NaN. declared: a mark of its declaration."""

    claim: str
    kind: str
    holds: int
    of: int
    depends_on: str
    needed: float
    declared: str

    def as_row(self) -> dict[str, Any]:
        """The row of classes.csv."""
        needed = "" if math.isnan(self.needed) else int(self.needed)
        values = (self.claim, self.kind, self.holds, self.of, self.depends_on, needed, self.declared)
        return dict(zip(CLASS_FILE_COLUMNS, values, strict=True))

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> "VerdictClass":
        """From a row of classes.csv. Raises ValueError or LookupError for an invalid one."""
        if row["class"] not in CLASSES:
            raise ValueError(row["class"])
        needed = float(row["needed"]) if row["needed"] else math.nan
        holds, of = int(row["holds"]), int(row["of"])
        return cls(row["claim"], row["class"], holds, of, row["depends_on"], needed, row["declared"])


# For each claim that depends on an open choice: its class over all interpretations, None where unknown.
KnownClasses = Mapping[str, VerdictClass | None]


def declaration_digest(of: PaperInterpretations, claim: Claim) -> str:
    """A mark of a claim's assertions and of the open choices that affect it: a changed mark means another claim."""
    parts = [
        [
            *(part.what, part.unit, part.statement, part.number, part.variant, part.against_print, part.asserted),
            *(repr(end) for end in (part.expected.lo, part.expected.hi, part.expected.margin)),
            part.expected.kind,
        ]
        for part in claim.parts
    ]
    choices = [
        [choice.key, choice.contradicts, *([one.name, one.kind] for one in choice.alternatives)]
        for choice in of.choices
        if choice.bears_on(claim.id)
    ]
    return digest([parts, claim.how, choices])[:16]


def verdict_class(over: ClaimVerdicts) -> VerdictClass | None:
    """The class of a claim over its interpretations; None where it could not be judged."""
    found = over.outcome
    if found is None or found.interpretations is None or found.holds_in is None:
        return None
    needed, on = float(found.needed or math.nan), ", ".join(found.depends_on)
    return VerdictClass(
        over.claim.id,
        found.kind,
        found.holds_in,
        found.interpretations,
        on,
        needed,
        declaration_digest(over.of, over.claim),
    )


def add_classes(rows: Sequence[Mapping[str, Any]], known: KnownClasses) -> list[dict[str, Any]]:
    """Rows of claims.csv with the class over all interpretations in place of that as shipped, which moves to
    `as_shipped`. Rows that were not judged stay as they are."""
    return [dict(row) | _class_columns(row, known) for row in rows]


def _class_columns(row: Mapping[str, Any], known: KnownClasses) -> dict[str, Any]:
    own = row["as_shipped"]
    if own in (NOT_RUN, NOT_JUDGED):
        return {}
    found = known.get(str(row["claim"]))
    if found is None:
        nothing: dict[str, Any] = {"class": own, "holds": math.nan, "of": math.nan, "depends_on": ""}
        lost = str(row["claim"]) in known and own not in FIXED_CLASSES
        return nothing | {"overall": ONLY_SHIPPED.format(own=own) if lost else own}
    needed = {} if own == UNDECIDED else {"needed": found.needed}
    every = {"class": found.kind, "holds": found.holds, "of": found.of, "depends_on": found.depends_on}
    return every | needed | {"overall": class_words(found.kind, own, found.depends_on)}


def rows_in_words(
    rows: Iterable[Mapping[str, Any]], every: Iterable[PaperInterpretations | None]
) -> list[dict[str, Any]]:
    """Rows of claims.csv for people: what a claim depends on is in the words of its paper's interpretations."""
    of = {one.paper: one for one in every if one is not None}
    found = [dict(row) for row in rows]
    for row in found:
        if row["depends_on"]:
            row["depends_on"] = of[row["claim"].partition(".")[0]].asked(row["depends_on"].split(", "))
    return found


def is_judged_only_as_shipped(row: Mapping[str, Any]) -> bool:
    """Whether a claim was judged only as shipped, though open choices may change its verdict."""
    return bool(row["overall"] == ONLY_SHIPPED.format(own=row["as_shipped"]))


def verdict_words(row: Mapping[str, Any]) -> str:
    """The verdict on a claim of claims.csv, as a phrase in the current language."""
    if is_judged_only_as_shipped(row):
        return tr(ONLY_SHIPPED, own=term(row["as_shipped"]))
    return class_words(row["class"], row["as_shipped"], row["depends_on"], tr)


def class_words(kind: str, own: str, depends_on: str = "", say: Callable[..., str] = str.format) -> str:
    """The verdict on a claim as a phrase: its class, and the one as shipped if it differs.

    say: puts values into a message, as `language.tr` does; default: in English."""
    over: str = say(DEPENDS_ON, choices=depends_on) if kind == DEPENDS and depends_on else say(kind)
    if own == kind:
        return over
    if kind not in (DEPENDS, CONTRADICTORY):
        over = say(OVERALL, kind=over)
    return say(SHIPPED_AND_OVERALL, own=term(own), over=over)
