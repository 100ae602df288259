"""The outcome of a claim from the verdicts on its parts; the rule is in docs/verdicts.md."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from radarsim.papers.verdict_rule import (
    CONFIRMED,
    CONTRADICTORY,
    DEPENDS,
    IMMATERIAL,
    REFUTED,
    UNDECIDED,
    UNJUDGEABLE,
    VOID,
    JudgedPart,
    is_within_margins,
    miss_in_margins,
    needed_realisations,
    part_verdict,
)


@dataclass(frozen=True)
class ClaimOutcome:
    """The outcome of a claim: its class, the words, how many numbers held and failed, and the worst miss in margins.

    needed: realisations that would decide it, if undecided; None: no number would."""

    kind: str
    numbers_held: int
    numbers_failed: int
    number_count: int
    miss: float
    needed: int | None = None
    depends_on: tuple[str, ...] = ()
    holds_in: int | None = None
    interpretations: int | None = None

    @property
    def words(self) -> str:
        """The class, and its dependence on choices."""
        return f"{self.kind} {', '.join(self.depends_on)}".rstrip() if self.kind == DEPENDS else self.kind


# For variants of a number the first of these that one has; CONTRADICTORY where only one against the print holds.
BEST_FIRST = (CONFIRMED, IMMATERIAL, UNDECIDED, CONTRADICTORY, REFUTED)
# For the sentences of a claim the first of these that one has.
WORST_FIRST = (REFUTED, CONTRADICTORY, UNDECIDED, UNJUDGEABLE, IMMATERIAL, CONFIRMED)


def claim_outcome(
    parts: Sequence[JudgedPart], *, unstated: bool = False, joint: bool = False, internal: bool = False
) -> ClaimOutcome:
    """The outcome of a claim with these parts; of an extension without asserted parts, as if all were.

    unstated: the paper omits what the statement is about, so that it cannot be judged. joint: one variant has to
    give every number; where each is reproduced in some variant and no variant gives all, the print contradicts itself.
    internal: both sides are printed; where they differ, the print contradicts itself."""
    asserted = [part for part in parts if part.asserted] or list(parts)
    sampled_parts = sum(part.is_sampled and not part.is_void for part in asserted)
    if joint:
        return _joint_outcome(asserted, sampled_parts)
    numbers = _parts_by_number(asserted)
    verdicts = {name: _number_verdict(variants, sampled_parts) for name, variants in numbers.items()}
    kind = UNJUDGEABLE if unstated else _claim_class(numbers, verdicts, sampled_parts)
    if internal and kind == REFUTED:
        kind = CONTRADICTORY
    misses = [
        min(miss_in_margins(part) for part in variants) for name, variants in numbers.items() if verdicts[name] != VOID
    ]
    undecided = [part for name, variants in numbers.items() if verdicts[name] == UNDECIDED for part in variants]
    return ClaimOutcome(
        kind,
        numbers_held=sum(verdict in (CONFIRMED, IMMATERIAL) for verdict in verdicts.values()),
        numbers_failed=sum(verdict in (REFUTED, CONTRADICTORY) for verdict in verdicts.values()),
        number_count=sum(verdict != VOID for verdict in verdicts.values()),
        miss=max(misses, default=math.nan),
        needed=largest_needed(needed_realisations(part, sampled_parts) for part in undecided)
        if kind == UNDECIDED
        else None,
    )


def _parts_by_number(parts: Sequence[JudgedPart]) -> dict[tuple[str, str], list[JudgedPart]]:
    """Parts by statement and number; a part without number stands for itself."""
    numbers: dict[tuple[str, str], list[JudgedPart]] = {}
    for i, part in enumerate(parts):
        numbers.setdefault((part.statement, part.number or f"#{i}"), []).append(part)
    return numbers


def _number_verdict(variants: Sequence[JudgedPart], sampled_parts: int) -> str:
    """The verdict on a number from those on its variants."""
    verdicts = []
    for part in variants:
        verdict = part_verdict(part, sampled_parts)
        if part.against_print and verdict in (CONFIRMED, IMMATERIAL):
            verdict = CONTRADICTORY
        if verdict != VOID:
            verdicts.append(REFUTED if part.against_print and verdict == UNDECIDED else verdict)
    return min(verdicts, key=BEST_FIRST.index) if verdicts else VOID


def _claim_class(
    numbers: Mapping[tuple[str, str], Sequence[JudgedPart]], verdicts: Mapping[tuple[str, str], str], sampled_parts: int
) -> str:
    sentences = []
    for sentence in dict.fromkeys(name for name, _ in numbers):
        number_verdicts = {key: verdicts[key] for key in numbers if key[0] == sentence and verdicts[key] != VOID}
        harmless = all(
            is_within_margins(part, sampled_parts)
            for key, verdict in number_verdicts.items()
            if verdict == UNDECIDED
            for part in numbers[key]
        )
        sentences.append(_sentence_verdict(list(number_verdicts.values()), harmless))
    return min(sentences, key=WORST_FIRST.index) if sentences else UNJUDGEABLE


def _sentence_verdict(verdicts: Sequence[str], harmless: bool) -> str:
    """The verdict on a sentence: one material miss refutes it, immaterial ones neither refute nor confirm."""
    for bad in (REFUTED, CONTRADICTORY):
        if bad in verdicts:
            return bad
    if UNDECIDED in verdicts and not (harmless and CONFIRMED in verdicts):
        return UNDECIDED
    if CONFIRMED in verdicts:
        return CONFIRMED
    return IMMATERIAL if verdicts else UNJUDGEABLE


def largest_needed(realisations: Iterable[int | None]) -> int | None:
    """The largest number of realisations; None where there is none, or one is None."""
    numbers = list(realisations)
    return None if not numbers or None in numbers else max(number for number in numbers if number is not None)


def round_up(n: float) -> int:
    """A number of realisations rounded for people: up to two digits, never fewer."""
    step = 10 ** max(len(str(math.ceil(n))) - 2, 0)
    return math.ceil(n / step) * step


def _joint_outcome(parts: Sequence[JudgedPart], sampled_parts: int) -> ClaimOutcome:
    by_variant: dict[str, list[str]] = {}
    by_number: dict[str, list[str]] = {}
    for part in parts:
        verdict = part_verdict(part, sampled_parts)
        by_variant.setdefault(part.variant, []).append(verdict)
        by_number.setdefault(part.number, []).append(verdict)
    reproduced = {
        name: sum(number_verdict in (CONFIRMED, IMMATERIAL) for number_verdict in verdict)
        for name, verdict in by_variant.items()
    }
    best = max(reproduced, key=lambda name: reproduced[name])
    if reproduced[best] == len(by_number):
        kind = CONFIRMED
    elif any(UNDECIDED in verdict and REFUTED not in verdict for verdict in by_variant.values()):
        kind = UNDECIDED
    else:
        kind = CONTRADICTORY if all(CONFIRMED in verdict for verdict in by_number.values()) else REFUTED
    worst = max(miss_in_margins(part) for part in parts if part.variant == best)
    return ClaimOutcome(kind, reproduced[best], len(by_number) - reproduced[best], len(by_number), worst)
