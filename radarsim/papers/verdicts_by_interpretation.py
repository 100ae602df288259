"""Verdicts on a claim under every interpretation of its paper: rows of interpretations.csv, and a summary."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from radarsim.errors import MeasureError
from radarsim.language.numerals import numeral
from radarsim.language.translate import tr
from radarsim.papers.claim import Claim, Part
from radarsim.papers.claim_outcome import ClaimOutcome, claim_outcome, largest_needed, round_up
from radarsim.papers.claims_table import NO_NUMBER, judged_part, lacks_number
from radarsim.papers.claims_table import exact_value as known
from radarsim.papers.evidence import Evidence, MissingEvidence, UnknownScans, has_interval
from radarsim.papers.interpretation_outcome import InterpretationOutcome, outcome_over_interpretations
from radarsim.papers.interpretations import (
    DEFAULT,
    LEADING_COLUMNS,
    TRAILING_COLUMNS,
    Interpretation,
    PaperInterpretations,
)
from radarsim.papers.reasons import translate_reason
from radarsim.papers.verdict_classes import DEPENDS_ON, VerdictClass, declaration_digest
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

NOTHING_TO_MEASURE = "there is nothing to measure it with"


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

    def as_outcome(self) -> InterpretationOutcome:
        """The input of the rule."""
        outcome = self.outcome.kind if self.outcome else ""
        return InterpretationOutcome(self.name, self.kind, dict(self.interpretation.alternatives), outcome)


def judge_claim(
    interpretations: PaperInterpretations, claim: Claim, interpretation: Interpretation, evidence: Evidence, n: int = 0
) -> InterpretationVerdict:
    """Judge a claim by the evidence of an interpretation with n realisations; 0 where nothing was run."""
    name, kind = interpretations.name(interpretation), interpretations.kind(interpretation)
    try:
        parts = tuple(
            (part, _judge_part(part, evidence, interpretations.is_exact(claim, interpretation), n, name == DEFAULT))
            for part in interpretations.parts(claim, interpretation)
        )
    except MissingEvidence as missing:
        return InterpretationVerdict(claim, interpretation, name, kind, why=missing.why or NOTHING_TO_MEASURE)
    except MeasureError as error:
        if name == DEFAULT or not isinstance(error.__cause__, UnknownScans):  # an interpretation may have fewer scans
            raise
        return InterpretationVerdict(claim, interpretation, name, kind, why=error.__cause__.why)
    outcome = claim_outcome([judged for _, judged in parts], **claim.judging_options)
    if lacks_number(outcome, [judged for _, judged in parts]):
        return InterpretationVerdict(claim, interpretation, name, kind, why=NO_NUMBER)
    return InterpretationVerdict(claim, interpretation, name, kind, parts, outcome)


def _judge_part(part: Part, evidence: Evidence, exact: bool, n: int, shipped: bool) -> JudgedPart:
    """A part with its numbers; the interpretation gives its variant and whether that is against the print.

    exact: whether all evidence is exact. Otherwise the exact value is known where the run knows it; a part's own
    formula is of the shipped interpretation."""
    measured, nothing = part.measure(evidence), Estimate(*(math.nan,) * 3)
    exact = exact and not has_interval(measured)
    default_part = replace(part, variant="", against_print=False)
    value = measured.value if exact else known(part if shipped else replace(part, exact=None), evidence, measured)
    return replace(judged_part(default_part, evidence, nothing if exact else measured, n), exact=float(value))


@dataclass(frozen=True)
class ClaimVerdicts:
    """A claim over all interpretations of its paper, the default one first."""

    interpretations: PaperInterpretations
    claim: Claim
    verdicts: tuple[InterpretationVerdict, ...]

    @cached_property
    def outcome(self) -> ClaimOutcome | None:
        """The verdict of the rule; None where the default interpretation was not judged."""
        default_outcome = self.verdicts[0].outcome
        if default_outcome is None:
            return None
        outcome = outcome_over_interpretations(default_outcome, [verdict.as_outcome() for verdict in self.verdicts])
        printed_twice = any(part.against_print for part in self.claim.parts)
        contradictory = printed_twice and any(
            verdict.contradicts and verdict.key in outcome.depends_on for verdict in self.interpretations.choices
        )
        contradictory = contradictory or (self.claim.joint and self._each_somewhere())
        if contradictory:
            return replace(outcome, kind=CONTRADICTORY)
        return replace(outcome, needed=self._needed() if outcome.kind == UNDECIDED else None)

    def _needed(self) -> int | None:
        """Realisations that would decide every undecided interpretation; None where a value lies on a border."""
        return largest_needed(verdict.outcome.needed for verdict in self.undecided if verdict.outcome)

    def _each_somewhere(self) -> bool:
        """Whether every number of a joint claim is reproduced under some interpretation, though no interpretation gives
        all."""
        verdicts = [verdict for verdict in self.verdicts if verdict.counted]
        reproduced = {
            part.number for verdict in verdicts for part, judged in verdict.parts if part_verdict(judged) == CONFIRMED
        }
        numbers = {part.number for verdict in verdicts for part, _ in verdict.parts}
        return reproduced == numbers and not any(
            verdict.outcome.kind == CONFIRMED for verdict in verdicts if verdict.outcome
        )

    @property
    def against_print(self) -> list[InterpretationVerdict]:
        """The interpretations against the print with another verdict than the default one."""
        default_outcome = self.verdicts[0].outcome
        verdicts = [verdict for verdict in self.verdicts if verdict.kind == AGAINST and verdict.outcome]
        return [
            verdict
            for verdict in verdicts
            if default_outcome and verdict.outcome and verdict.outcome.kind != default_outcome.kind
        ]

    @property
    def undecided(self) -> list[InterpretationVerdict]:
        """The interpretations that the paper allows and that are undecided."""
        return [
            verdict
            for verdict in self.verdicts
            if verdict.counted and verdict.outcome and verdict.outcome.kind == UNDECIDED
        ]

    @property
    def fewest_realisations(self) -> int:
        """The fewest realisations of an undecided interpretation; 0 where all are decided."""
        return min((judged.n for verdict in self.undecided for _, judged in verdict.parts), default=0)

    @property
    def impossible(self) -> list[InterpretationVerdict]:
        """The interpretations that were not judged, with their reasons."""
        return [verdict for verdict in self.verdicts if verdict.outcome is None]

    def sentence(self) -> str:
        """One line: in how many interpretations it holds, on what it depends, what would have to be changed."""
        outcome = self.outcome
        if outcome is None:
            return tr("not judged: {why}", why=translate_reason(self.verdicts[0].why))
        clauses = [
            tr("holds in {holds} of {of} interpretations", holds=outcome.holds_in or 0, of=outcome.interpretations or 0)
        ]
        if self.undecided_sentence():
            clauses.append(self.undecided_sentence())
        if outcome.depends_on:
            clauses.append(tr(DEPENDS_ON, choices=self.interpretations.list_choices(outcome.depends_on)))
        confirmed = [verdict for verdict in self.against_print if verdict.outcome and verdict.outcome.kind == CONFIRMED]
        if confirmed and outcome.holds_in == 0:
            names = " | ".join(self.interpretations.describe(verdict.interpretation) for verdict in confirmed)
            clauses.append(tr("it holds, against the print, with {interpretations}", interpretations=names))
        if self.impossible:
            clauses.append(tr("{count} not possible", count=len(self.impossible)))
        return "; ".join(clauses)

    def undecided_sentence(self) -> str:
        """For an undecided claim, how many interpretations are undecided, and the realisations they need; else
        nothing."""
        if self.outcome is None or self.outcome.kind != UNDECIDED:
            return ""
        values, needed = (
            {"count": len(self.undecided), "n": numeral(str(self.fewest_realisations))},
            self.outcome.needed,
        )
        if needed is None:
            return tr(
                "{count} open at {n} realisations: a value lies on a border, and more realisations would not decide",
                **values,
            )
        return tr(
            "{count} open at {n} realisations, about {needed} would decide",
            **values,
            needed=numeral(str(round_up(needed))),
        )


def verdict_class(verdicts: ClaimVerdicts) -> VerdictClass | None:
    """The class of a claim over its interpretations; None where it could not be judged."""
    outcome = verdicts.outcome
    if outcome is None or outcome.interpretations is None or outcome.holds_in is None:
        return None
    needed, depends_on = float(outcome.needed or math.nan), ", ".join(outcome.depends_on)
    return VerdictClass(
        verdicts.claim.id,
        outcome.kind,
        outcome.holds_in,
        outcome.interpretations,
        depends_on,
        needed,
        declaration_digest(verdicts.interpretations, verdicts.claim),
    )


def verdict_columns(papers: Iterable[PaperInterpretations]) -> tuple[str, ...]:
    """The columns of interpretations.csv: one for each choice of these papers."""
    choices = dict.fromkeys(choice.key for paper in papers for choice in paper.choices)
    return (*LEADING_COLUMNS, *choices, *TRAILING_COLUMNS)


def verdict_rows(
    verdict: InterpretationVerdict, columns: Sequence[str], overall_outcome: ClaimOutcome | None = None
) -> list[dict[str, Any]]:
    """Rows of interpretations.csv: one for each part; a single one with the reason where it was not judged.

    overall_outcome: that over all interpretations, whose class is in each row."""
    choices = dict(verdict.interpretation.alternatives)
    row: dict[str, Any] = dict.fromkeys(columns, "") | {
        "claim": verdict.claim.id,
        "interpretation": verdict.name,
        "kind": verdict.kind,
    }
    row |= {key: value for key, value in choices.items() if key in columns}
    row["over"] = overall_outcome.kind if overall_outcome else ""
    if verdict.outcome is None:
        return [row | {"verdict": "not possible", "reason": verdict.why}]
    sampled_parts = sum(judged.is_sampled for _, judged in verdict.parts)
    return [
        row
        | {
            **{
                name: _table_value(getattr(judged, name), allow_infinite=True)
                for name in ("measured", "lo", "hi", "exact")
            },
            **{name: _table_value(getattr(judged, name)) for name in ("expected_lo", "expected_hi", "margin")},
            **{
                "part": number,
                "quantity": part.what,
                "unit": part.unit,
                "verdict": part_verdict(judged, sampled_parts),
            },
            **{"outcome": verdict.outcome.kind, "miss": _table_value(miss_in_margins(judged)), "n": judged.n or ""},
            "needed": verdict.outcome.needed or "",
        }
        for number, (part, judged) in enumerate(verdict.parts, 1)
    ]


def _table_value(value: float, allow_infinite: bool = False) -> float | str:
    """A number for the table: twelve digits, empty for NaN; allow_infinite: `inf` for a settling time that is never
    reached."""
    if allow_infinite and math.isinf(value):
        return value
    return float(f"{value:.12g}") if math.isfinite(value) else ""


def worst_distance(verdict: InterpretationVerdict) -> tuple[float, float, float]:
    """How far the worst part is from the words, in margins, with the ends of its interval.

    Negative inside: the distance to the nearest end."""
    distances = [_distance(judged) for _, judged in verdict.parts if judged.asserted and not judged.is_void]
    return max(distances, default=(math.nan,) * 3, key=lambda ends: ends[0])


def _distance(judged: JudgedPart) -> tuple[float, float, float]:
    """The same of a part."""

    def distance(value: float) -> float:
        return max(judged.expected_lo - value, value - judged.expected_hi) / judged.margin

    ends = judged_interval(judged)
    distances = [distance(value) for value in (*ends, judged.value)]
    return distance(judged.value), min(distances), max(distances)
