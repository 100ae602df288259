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
    held: int
    failed: int
    of: int
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
    many = sum(part.sampled and not part.void for part in asserted)
    if joint:
        return _joint_outcome(asserted, many)
    numbers = _parts_by_number(asserted)
    said = {name: _number_verdict(own, many) for name, own in numbers.items()}
    kind = UNJUDGEABLE if unstated else _claim_class(numbers, said, many)
    if internal and kind == REFUTED:
        kind = CONTRADICTORY
    misses = [min(miss_in_margins(part) for part in own) for name, own in numbers.items() if said[name] != VOID]
    open_ = [part for name, own in numbers.items() if said[name] == UNDECIDED for part in own]
    return ClaimOutcome(
        kind,
        held=sum(one in (CONFIRMED, IMMATERIAL) for one in said.values()),
        failed=sum(one in (REFUTED, CONTRADICTORY) for one in said.values()),
        of=sum(one != VOID for one in said.values()),
        miss=max(misses, default=math.nan),
        needed=largest_needed(needed_realisations(part, many) for part in open_) if kind == UNDECIDED else None,
    )


def _parts_by_number(parts: Sequence[JudgedPart]) -> dict[tuple[str, str], list[JudgedPart]]:
    """Parts by statement and number; a part without number stands for itself."""
    numbers: dict[tuple[str, str], list[JudgedPart]] = {}
    for i, part in enumerate(parts):
        numbers.setdefault((part.statement, part.number or f"#{i}"), []).append(part)
    return numbers


def _number_verdict(variants: Sequence[JudgedPart], many: int) -> str:
    """The verdict on a number from those on its variants."""
    said = []
    for part in variants:
        one = part_verdict(part, many)
        if part.against_print and one in (CONFIRMED, IMMATERIAL):
            one = CONTRADICTORY
        if one != VOID:
            said.append(REFUTED if part.against_print and one == UNDECIDED else one)
    return min(said, key=BEST_FIRST.index) if said else VOID


def _claim_class(
    numbers: Mapping[tuple[str, str], Sequence[JudgedPart]], said: Mapping[tuple[str, str], str], many: int
) -> str:
    sentences = []
    for sentence in dict.fromkeys(name for name, _ in numbers):
        own = {key: said[key] for key in numbers if key[0] == sentence and said[key] != VOID}
        safe = all(
            is_within_margins(part, many) for key, one in own.items() if one == UNDECIDED for part in numbers[key]
        )
        sentences.append(_sentence_verdict(list(own.values()), safe))
    return min(sentences, key=WORST_FIRST.index) if sentences else UNJUDGEABLE


def _sentence_verdict(said: Sequence[str], safe: bool) -> str:
    """The verdict on a sentence: one material miss refutes it, immaterial ones neither refute nor confirm."""
    for bad in (REFUTED, CONTRADICTORY):
        if bad in said:
            return bad
    if UNDECIDED in said and not (safe and CONFIRMED in said):
        return UNDECIDED
    if CONFIRMED in said:
        return CONFIRMED
    return IMMATERIAL if said else UNJUDGEABLE


def largest_needed(every: Iterable[int | None]) -> int | None:
    """The largest number of realisations; None where there is none, or one is None."""
    known = list(every)
    return None if not known or None in known else max(one for one in known if one is not None)


def round_up(n: float) -> int:
    """A number of realisations rounded for people: up to two digits, never fewer."""
    step = 10 ** max(len(str(math.ceil(n))) - 2, 0)
    return math.ceil(n / step) * step


def _joint_outcome(parts: Sequence[JudgedPart], many: int) -> ClaimOutcome:
    by_variant: dict[str, list[str]] = {}
    by_number: dict[str, list[str]] = {}
    for part in parts:
        said = part_verdict(part, many)
        by_variant.setdefault(part.variant, []).append(said)
        by_number.setdefault(part.number, []).append(said)
    held = {name: sum(one in (CONFIRMED, IMMATERIAL) for one in said) for name, said in by_variant.items()}
    best = max(held, key=lambda name: held[name])
    if held[best] == len(by_number):
        kind = CONFIRMED
    elif any(UNDECIDED in said and REFUTED not in said for said in by_variant.values()):
        kind = UNDECIDED
    else:
        kind = CONTRADICTORY if all(CONFIRMED in said for said in by_number.values()) else REFUTED
    worst = max(miss_in_margins(part) for part in parts if part.variant == best)
    return ClaimOutcome(kind, held[best], len(by_number) - held[best], len(by_number), worst)
