"""Verdicts on a claim under every interpretation of its paper: rows of interpretations.csv, and a summary."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from radarsim.errors import MeasureError
from radarsim.language import term, tr
from radarsim.papers.claim import Claim, Part
from radarsim.papers.claim_outcome import ClaimOutcome, claim_outcome, largest_needed, round_up
from radarsim.papers.claims_table import exact_value as known
from radarsim.papers.claims_table import judged_part
from radarsim.papers.evidence import Evidence, MissingEvidence, UnknownScans
from radarsim.papers.interpretation_outcome import InterpretationOutcome, outcome_over_interpretations
from radarsim.papers.interpretations import DEFAULT, Interpretation, PaperInterpretations
from radarsim.papers.reasons import translate_reason
from radarsim.papers.verdict_rule import (
    AGAINST,
    CONFIRMED,
    CONTRADICTORY,
    UNDECIDED,
    JudgedPart,
    judged_interval,
    miss_in_margins,
    part_verdict,
)
from radarsim.report.statistics import Estimate

DEPENDS_ON = term("depends on {choices}")
NOTHING_TO_MEASURE = "there is nothing to measure it with"
LEADING_COLUMNS = ("claim", "part", "interpretation", "kind")
TRAILING_COLUMNS = (
    *("measured", "lo", "hi", "exact", "expected_lo", "expected_hi", "margin", "verdict"),
    *("unit", "what", "outcome", "miss", "n", "needed", "reason", "over"),
)


@dataclass(frozen=True)
class InterpretationVerdict:
    """A claim under one interpretation: its parts with their numbers, in the order of the claim, and the verdict.

    why: the reason if it was not judged: impossible to fly or design, or nothing to measure."""

    claim: Claim
    interpretation: Interpretation
    name: str
    kind: str
    parts: tuple[tuple[Part, JudgedPart], ...] = ()
    outcome: ClaimOutcome | None = None
    why: str = ""

    @property
    def counted(self) -> bool:
        """Whether the paper allows the interpretation."""
        return self.kind != AGAINST and self.outcome is not None

    def as_rule(self) -> InterpretationOutcome:
        """The input of the rule."""
        outcome = self.outcome.kind if self.outcome else ""
        return InterpretationOutcome(self.name, self.kind, dict(self.interpretation.taken), outcome)


def judge_under(
    of: PaperInterpretations, claim: Claim, interpretation: Interpretation, evidence: Evidence, n: int = 0
) -> InterpretationVerdict:
    """Judge a claim by the evidence of an interpretation with n realisations; 0 where nothing was run."""
    name, kind = of.name(interpretation), of.kind(interpretation)
    try:
        parts = tuple(
            (part, _judge_part(part, evidence, of.exact(claim, interpretation), n, name == DEFAULT))
            for part in of.parts(claim, interpretation)
        )
    except MissingEvidence as missing:
        return InterpretationVerdict(claim, interpretation, name, kind, why=missing.why or NOTHING_TO_MEASURE)
    except MeasureError as error:
        if name == DEFAULT or not isinstance(error.__cause__, UnknownScans):  # an interpretation may have fewer scans
            raise
        return InterpretationVerdict(claim, interpretation, name, kind, why=error.__cause__.why)
    outcome = claim_outcome([judged for _, judged in parts], **claim.how)
    return InterpretationVerdict(claim, interpretation, name, kind, parts, outcome)


def _judge_part(part: Part, seen: Evidence, exact: bool, n: int, shipped: bool) -> JudgedPart:
    """A part with its numbers; the interpretation gives its variant and whether that is against the print.

    exact: whether all evidence is exact. Otherwise the exact value is known where the run knows it; a part's own
    formula is of the shipped interpretation."""
    found, nothing = part.measure(seen), Estimate(*(math.nan,) * 3)
    own = replace(part, variant="", against_print=False)
    value = found.value if exact else known(part if shipped else replace(part, exact=None), seen, found)
    return replace(judged_part(own, seen, nothing if exact else found, n), exact=float(value))


@dataclass(frozen=True)
class ClaimVerdicts:
    """A claim over all interpretations of its paper, the default one first."""

    of: PaperInterpretations
    claim: Claim
    under: tuple[InterpretationVerdict, ...]

    @cached_property
    def outcome(self) -> ClaimOutcome | None:
        """The verdict of the rule; None where the default interpretation was not judged."""
        own = self.under[0].outcome
        if own is None:
            return None
        found = outcome_over_interpretations(own, [one.as_rule() for one in self.under])
        printed_twice = any(part.against_print for part in self.claim.parts)
        torn = printed_twice and any(one.contradicts and one.key in found.depends_on for one in self.of.choices)
        torn = torn or (self.claim.joint and self._each_somewhere())
        if torn:
            return replace(found, kind=CONTRADICTORY)
        return replace(found, needed=self._needed() if found.kind == UNDECIDED else None)

    def _needed(self) -> int | None:
        """Realisations that would decide every undecided interpretation; None where a value lies on a border."""
        return largest_needed(one.outcome.needed for one in self.undecided if one.outcome)

    def _each_somewhere(self) -> bool:
        """Whether every number of a joint claim is reproduced under some interpretation, though no interpretation gives
        all."""
        counted = [one for one in self.under if one.counted]
        held = {part.number for one in counted for part, judged in one.parts if part_verdict(judged) == CONFIRMED}
        every = {part.number for one in counted for part, _ in one.parts}
        return held == every and not any(one.outcome.kind == CONFIRMED for one in counted if one.outcome)

    @property
    def against_print(self) -> list[InterpretationVerdict]:
        """The interpretations against the print with another verdict than the default one."""
        own = self.under[0].outcome
        judged = [one for one in self.under if one.kind == AGAINST and one.outcome]
        return [one for one in judged if own and one.outcome and one.outcome.kind != own.kind]

    @property
    def undecided(self) -> list[InterpretationVerdict]:
        """The interpretations that the paper allows and that are undecided."""
        return [one for one in self.under if one.counted and one.outcome and one.outcome.kind == UNDECIDED]

    @property
    def looked(self) -> int:
        """The fewest realisations of an undecided interpretation; 0 where all are decided."""
        return min((judged.n for one in self.undecided for _, judged in one.parts), default=0)

    @property
    def impossible(self) -> list[InterpretationVerdict]:
        """The interpretations that were not judged, with their reasons."""
        return [one for one in self.under if one.outcome is None]

    def sentence(self) -> str:
        """One line: in how many interpretations it holds, on what it depends, what would have to be changed."""
        found = self.outcome
        if found is None:
            return tr("not judged: {why}", why=translate_reason(self.under[0].why))
        words = [
            tr("holds in {holds} of {of} interpretations", holds=found.holds_in or 0, of=found.interpretations or 0)
        ]
        if self.still_open():
            words.append(self.still_open())
        if found.depends_on:
            words.append(tr(DEPENDS_ON, choices=self.of.asked(found.depends_on)))
        held = [one for one in self.against_print if one.outcome and one.outcome.kind == CONFIRMED]
        if held and found.holds_in == 0:
            names = " | ".join(self.of.said(one.interpretation) for one in held)
            words.append(tr("it holds, against the print, with {interpretations}", interpretations=names))
        if self.impossible:
            words.append(tr("{count} not possible", count=len(self.impossible)))
        return "; ".join(words)

    def still_open(self) -> str:
        """For an undecided claim, how many interpretations are undecided, and the realisations they need; else
        nothing."""
        if self.outcome is None or self.outcome.kind != UNDECIDED:
            return ""
        told, needed = {"count": len(self.undecided), "n": f"{self.looked:,}"}, self.outcome.needed
        if needed is None:
            return tr(
                "{count} open at {n} realisations: a value lies on a border, and more realisations would not decide",
                **told,
            )
        return tr(
            "{count} open at {n} realisations, about {needed} would decide", **told, needed=f"{round_up(needed):,}"
        )


def verdict_columns(every: Iterable[PaperInterpretations]) -> tuple[str, ...]:
    """The columns of interpretations.csv: one for each choice of these papers."""
    choices = dict.fromkeys(choice.key for of in every for choice in of.choices)
    return (*LEADING_COLUMNS, *choices, *TRAILING_COLUMNS)


def verdict_rows(
    one: InterpretationVerdict, names: Sequence[str], over: ClaimOutcome | None = None
) -> list[dict[str, Any]]:
    """Rows of interpretations.csv: one for each part; a single one with the reason where it was not judged.

    over: the result over all interpretations, whose class is in each row."""
    choices = dict(one.interpretation.taken)
    blank: dict[str, Any] = dict.fromkeys(names, "") | {
        "claim": one.claim.id,
        "interpretation": one.name,
        "kind": one.kind,
    }
    blank |= {key: value for key, value in choices.items() if key in names}
    blank["over"] = over.kind if over else ""
    if one.outcome is None:
        return [blank | {"verdict": "not possible", "reason": one.why}]
    many = sum(judged.sampled for _, judged in one.parts)
    return [
        blank
        | {
            **{name: _table_value(getattr(judged, name), never=True) for name in ("measured", "lo", "hi", "exact")},
            **{name: _table_value(getattr(judged, name)) for name in ("expected_lo", "expected_hi", "margin")},
            **{"part": number, "what": part.what, "unit": part.unit, "verdict": part_verdict(judged, many)},
            **{"outcome": one.outcome.kind, "miss": _table_value(miss_in_margins(judged)), "n": judged.n or ""},
            "needed": one.outcome.needed or "",
        }
        for number, (part, judged) in enumerate(one.parts, 1)
    ]


def _table_value(value: float, never: bool = False) -> float | str:
    """A number for the table: twelve digits, empty for NaN; never: `inf` for a settling time that is never reached."""
    if never and math.isinf(value):
        return value
    return float(f"{value:.12g}") if math.isfinite(value) else ""


def worst_distance(one: InterpretationVerdict) -> tuple[float, float, float]:
    """How far the worst part is from the words, in margins, with the ends of its interval.

    Negative inside: the distance to the nearest end."""
    found = [_distance(judged) for _, judged in one.parts if judged.asserted and not judged.void]
    return max(found, default=(math.nan,) * 3, key=lambda ends: ends[0])


def _distance(judged: JudgedPart) -> tuple[float, float, float]:
    def of(value: float) -> float:
        return max(judged.expected_lo - value, value - judged.expected_hi) / judged.margin

    ends = judged_interval(judged)
    every = [of(value) for value in (*ends, judged.value)]
    return of(judged.value), min(every), max(every)
