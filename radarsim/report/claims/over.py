"""Verdicts on a claim under every reading of its paper: the table readings.csv, and what the claim depends on."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from radarsim.language import tr
from radarsim.report.claims import reasons, rule
from radarsim.report.claims.declared import Claim, Part
from radarsim.report.claims.evidence import Evidence, Missing
from radarsim.report.claims.judge import exact as known
from radarsim.report.claims.judge import weighed
from radarsim.report.claims.readings import DEFAULT, PaperReadings, Reading
from radarsim.report.claims.rule import Judged, Outcome
from radarsim.report.statistics import Estimate

NOTHING = "there is nothing to measure it by"
FIRST = ("claim", "part", "reading", "kind")
LAST = (
    *("measured", "lo", "hi", "exact", "expected_lo", "expected_hi", "margin", "verdict"),
    *("unit", "what", "outcome", "miss", "n", "needed", "reason", "over"),
)


@dataclass(frozen=True)
class Under:
    """A claim under one reading: its parts with their numbers, in the order of the claim, and what became of them.

    why says what kept it from being judged: it cannot be flown or designed, or there is nothing to measure.
    """

    claim: Claim
    reading: Reading
    name: str
    kind: str
    parts: tuple[tuple[Part, Judged], ...] = ()
    outcome: Outcome | None = None
    why: str = ""

    @property
    def counted(self) -> bool:
        """Whether the paper allows the reading."""
        return self.kind != rule.AGAINST and self.outcome is not None

    def as_rule(self) -> rule.Reading:
        """What the rule looks at."""
        outcome = self.outcome.kind if self.outcome else ""
        return rule.Reading(self.name, self.kind, dict(self.reading.taken), outcome)


def under(of: PaperReadings, claim: Claim, reading: Reading, evidence: Evidence, n: int = 0) -> Under:
    """Judge a claim by the evidence of a reading, which has n realisations; 0 where nothing was run."""
    name, kind = of.name(reading), of.kind(reading)
    try:
        parts = tuple(
            (part, _judged(part, evidence, of.exact(claim, reading), n, name == DEFAULT))
            for part in of.parts(claim, reading)
        )
    except Missing as missing:
        return Under(claim, reading, name, kind, why=missing.why or NOTHING)
    outcome = rule.claim([judged for _, judged in parts], **claim.how)
    return Under(claim, reading, name, kind, parts, outcome)


def _judged(part: Part, seen: Evidence, exact: bool, n: int, shipped: bool) -> Judged:
    """A part with its numbers; which variant it is of, and whether that is against the print, the reading says.

    exact: whether all evidence is. Of other evidence the exact value is known where the run knows it; a part's own
    formula is of the shipped reading.
    """
    found, nothing = part.measure(seen), Estimate(*(math.nan,) * 3)
    own = replace(part, variant="", against_print=False)
    value = found.value if exact else known(part if shipped else replace(part, exact=None), seen, found)
    return replace(weighed(own, seen, nothing if exact else found, n), exact=float(value))


@dataclass(frozen=True)
class Over:
    """A claim over all readings of its paper, the default one first."""

    claim: Claim
    under: tuple[Under, ...]
    contradicting: frozenset[str] = frozenset()  # the choices of which the print has several alternatives

    @cached_property
    def outcome(self) -> Outcome | None:
        """What the rule says of it; None where the default reading was not judged."""
        own = self.under[0].outcome
        if own is None:
            return None
        found = rule.over_readings(own, [one.as_rule() for one in self.under])
        printed_twice = any(part.against_print for part in self.claim.parts)
        torn = printed_twice and not self.contradicting.isdisjoint(found.depends_on)
        torn = torn or (self.claim.joint and self._each_somewhere())
        if torn:
            return replace(found, kind=rule.CONTRADICTORY)
        return replace(found, needed=self._needed() if found.kind == rule.UNDECIDED else None)

    def _needed(self) -> int | None:
        """Realisations that would decide every reading that is not; None where a value lies on a border."""
        return rule.most_needed(one.outcome.needed for one in self.undecided if one.outcome)

    def _each_somewhere(self) -> bool:
        """Whether every number of a joint claim comes out under some reading, though no reading gives all."""
        counted = [one for one in self.under if one.counted]
        held = {part.number for one in counted for part, judged in one.parts if rule.verdict(judged) == rule.CONFIRMED}
        every = {part.number for one in counted for part, _ in one.parts}
        return held == every and not any(one.outcome.kind == rule.CONFIRMED for one in counted if one.outcome)

    @property
    def against_print(self) -> list[Under]:
        """The readings against the print under which it comes out otherwise than in the default one."""
        own = self.under[0].outcome
        judged = [one for one in self.under if one.kind == rule.AGAINST and one.outcome]
        return [one for one in judged if own and one.outcome and one.outcome.kind != own.kind]

    @property
    def undecided(self) -> list[Under]:
        """The readings that the paper allows and under which it is not decided."""
        return [one for one in self.under if one.counted and one.outcome and one.outcome.kind == rule.UNDECIDED]

    @property
    def looked(self) -> int:
        """The fewest realisations of a reading that is not decided; 0 where all are."""
        return min((judged.n for one in self.undecided for _, judged in one.parts), default=0)

    @property
    def impossible(self) -> list[Under]:
        """The readings that were not judged, which say why."""
        return [one for one in self.under if one.outcome is None]

    def sentence(self) -> str:
        """One line: in how many readings it holds, on what it depends, what would have to be changed."""
        found = self.outcome
        if found is None:
            return tr("not judged: {why}", why=reasons.said(self.under[0].why))
        words = [tr("holds in {holds} of {of} readings", holds=found.holds_in or 0, of=found.readings or 0)]
        if self.still_open():
            words.append(self.still_open())
        if found.depends_on:
            words.append(tr("depends on: {choices}", choices=", ".join(found.depends_on)))
        held = [one for one in self.against_print if one.outcome and one.outcome.kind == rule.CONFIRMED]
        if held and found.holds_in == 0:
            names = " | ".join(one.name for one in held)
            words.append(tr("against the print it holds with {readings}", readings=names))
        if self.impossible:
            words.append(tr("{count} not possible", count=len(self.impossible)))
        return "; ".join(words)

    def still_open(self) -> str:
        """Of a claim that is not decided, how many readings leave it so, and what they would take; else nothing."""
        if self.outcome is None or self.outcome.kind != rule.UNDECIDED:
            return ""
        told, needed = {"count": len(self.undecided), "n": f"{self.looked:,}"}, self.outcome.needed
        if needed is None:
            return tr("{count} open at {n} realisations, a value on a border: no number would decide", **told)
        return tr(
            "{count} open at {n} realisations, about {needed} would decide", **told, needed=f"{rule.roughly(needed):,}"
        )


def columns(every: Iterable[PaperReadings]) -> tuple[str, ...]:
    """The columns of readings.csv: one for each choice of these papers."""
    choices = dict.fromkeys(choice.key for of in every for choice in of.choices)
    return (*FIRST, *choices, *LAST)


def rows(one: Under, names: Sequence[str], over: Outcome | None = None) -> list[dict[str, Any]]:
    """Rows of readings.csv: one a part; one alone with the reason where it was not judged.

    over: what the claim comes to over all its readings, the class of which stands in each row.
    """
    choices = dict(one.reading.taken)
    blank: dict[str, Any] = dict.fromkeys(names, "") | {"claim": one.claim.id, "reading": one.name, "kind": one.kind}
    blank |= {key: value for key, value in choices.items() if key in names}
    blank["over"] = over.kind if over else ""
    if one.outcome is None:
        return [blank | {"verdict": "not possible", "reason": one.why}]
    many = sum(judged.sampled for _, judged in one.parts)
    return [
        blank
        | {
            **{name: _cell(getattr(judged, name), never=True) for name in ("measured", "lo", "hi", "exact")},
            **{name: _cell(getattr(judged, name)) for name in ("expected_lo", "expected_hi", "margin")},
            **{"part": number, "what": part.what, "unit": part.unit, "verdict": rule.verdict(judged, many)},
            **{"outcome": one.outcome.kind, "miss": _cell(rule.miss(judged)), "n": judged.n or ""},
            "needed": one.outcome.needed or "",
        }
        for number, (part, judged) in enumerate(one.parts, 1)
    ]


def _cell(value: float, never: bool = False) -> float | str:
    """A number as the table holds it: at twelve digits, empty where there is none; never: `inf` of what never comes."""
    if never and math.isinf(value):
        return value
    return float(f"{value:.12g}") if math.isfinite(value) else ""


def depth(one: Under) -> tuple[float, float, float]:
    """How far the worst part lies from what the words say, in margins, with the ends of its interval.

    Negative inside: by as much as it could move before it left.
    """
    found = [_depth(judged) for _, judged in one.parts if judged.asserted and not judged.void]
    return max(found, default=(math.nan,) * 3, key=lambda ends: ends[0])


def _depth(judged: Judged) -> tuple[float, float, float]:
    def of(value: float) -> float:
        return max(judged.expected_lo - value, value - judged.expected_hi) / judged.margin

    ends = rule.ends(judged)
    every = [of(value) for value in (*ends, judged.value)]
    return of(judged.value), min(every), max(every)
