"""The class of a claim over all readings that its paper allows, beside the one that it has as shipped.

It is worked out in one place, `over.Over.outcome`, when `radarsim readings` judges a claim under each of them, and
kept as a row of classes.csv. Everything else that shows a class looks it up.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from radarsim.config.identity import digest
from radarsim.language import term, tr
from radarsim.report.claims import rule
from radarsim.report.claims.declared import Claim
from radarsim.report.claims.judge import NOT_JUDGED, NOT_RUN
from radarsim.report.claims.over import Over
from radarsim.report.claims.readings import PaperReadings

COLUMNS = ("claim", "class", "holds", "of", "depends_on", "needed", "declared")
OVER = ("class", "overall", "holds", "of", "depends_on", "needed")  # columns of claims.csv
DEPENDS_ON = term("depends on {keys}")
BOTH = term("{own} as shipped; {over}")
OVER_ALL = term("{kind} over all readings")
ALONE = term("{own} as shipped; other readings not judged")


@dataclass(frozen=True)
class Class:
    """A claim over all its readings: its class, in how many of how many it is true, what flips it.

    needed: realisations that would decide it where it is not, else not-a-number. declared: of what it was judged.
    """

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
        return dict(zip(COLUMNS, values, strict=True))

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> "Class":
        """From a row of classes.csv. Raises ValueError or LookupError for one that is none."""
        if row["class"] not in rule.CLASSES:
            raise ValueError(row["class"])
        needed = float(row["needed"]) if row["needed"] else math.nan
        holds, of = int(row["holds"]), int(row["of"])
        return cls(row["claim"], row["class"], holds, of, row["depends_on"], needed, row["declared"])


# Of each claim of which its paper leaves something open: its class over all readings, None where it is not known.
Known = Mapping[str, Class | None]


def declared(of: PaperReadings, claim: Claim) -> str:
    """A mark of what a claim asserts and of what its paper leaves open of it: another one, another claim."""
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


def of_over(of: PaperReadings, over: Over) -> Class | None:
    """The class of a claim that was judged under its readings; None where it could not be."""
    found = over.outcome
    if found is None or found.readings is None or found.holds_in is None:
        return None
    needed, on = float(found.needed or math.nan), ", ".join(found.depends_on)
    return Class(over.claim.id, found.kind, found.holds_in, found.readings, on, needed, declared(of, over.claim))


def with_classes(rows: Sequence[Mapping[str, Any]], known: Known) -> list[dict[str, Any]]:
    """Rows of claims.csv with the class over all readings in place of that as shipped, which stands in `as_shipped`.

    What was not judged stays as it is.
    """
    return [dict(row) | _over(row, known) for row in rows]


def _over(row: Mapping[str, Any], known: Known) -> dict[str, Any]:
    own = row["as_shipped"]
    if own in (NOT_RUN, NOT_JUDGED):
        return {}
    found = known.get(str(row["claim"]))
    if found is None:
        nothing: dict[str, Any] = {"class": own, "holds": math.nan, "of": math.nan, "depends_on": ""}
        lost = str(row["claim"]) in known and own not in rule.NO_READING_MENDS
        return nothing | {"overall": ALONE.format(own=own) if lost else own}
    needed = {} if own == rule.UNDECIDED else {"needed": found.needed}
    every = {"class": found.kind, "holds": found.holds, "of": found.of, "depends_on": found.depends_on}
    return every | needed | {"overall": words(found.kind, own, found.depends_on)}


def alone(row: Mapping[str, Any]) -> bool:
    """Whether a claim was judged as shipped alone, though its paper leaves open what may turn it."""
    return bool(row["overall"] == ALONE.format(own=row["as_shipped"]))


def said(row: Mapping[str, Any]) -> str:
    """How far a claim of claims.csv stands, in a phrase in the language spoken."""
    if alone(row):
        return tr(ALONE, own=term(row["as_shipped"]))
    return words(row["class"], row["as_shipped"], row["depends_on"], tr)


def words(kind: str, own: str, depends_on: str = "", say: Callable[..., str] = str.format) -> str:
    """How far a claim stands, in a phrase: its class, and the one as shipped where this is another.

    say: puts values into a message, as `language.tr` does; default: in English.
    """
    over: str = say(DEPENDS_ON, keys=depends_on) if kind == rule.DEPENDS and depends_on else say(kind)
    if own == kind:
        return over
    if kind not in (rule.DEPENDS, rule.CONTRADICTORY):
        over = say(OVER_ALL, kind=over)
    return say(BOTH, own=term(own), over=over)
