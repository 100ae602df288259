"""The outcome of a claim under all interpretations that its paper allows, and the choices on which it depends."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from radarsim.papers.claim_outcome import ClaimOutcome
from radarsim.papers.verdict_rule import (
    CONFIRMED,
    DEPENDS,
    EQUIVALENT,
    FIXED_CLASSES,
    IMMATERIAL,
    REFUTED,
    UNDECIDED,
    UNSTATED,
)


@dataclass(frozen=True)
class InterpretationOutcome:
    """A claim under one interpretation: its kind (E, U or N), its alternatives, and the class of the claim under it.

    outcome is empty where the interpretation is impossible to fly or design."""

    name: str
    kind: str
    choices: Mapping[str, str] = field(default_factory=dict)
    outcome: str = ""


def outcome_over_interpretations(
    default_outcome: ClaimOutcome, interpretations: Sequence[InterpretationOutcome]
) -> ClaimOutcome:
    """The outcome of a claim from that of the default interpretation and those of all: only E and U count. Confirmed
    only if true in all of them, refuted only if false in all, else it depends on the choices. Some outcomes hold under
    every interpretation: a print that contradicts itself, a statement that cannot be judged."""
    allowed = [
        interpretation
        for interpretation in interpretations
        if interpretation.kind in (EQUIVALENT, UNSTATED) and interpretation.outcome
    ]
    if not allowed:
        return default_outcome
    classes = Counter(interpretation.outcome for interpretation in allowed)
    confirmed = classes[CONFIRMED]
    kind: str = default_outcome.kind
    choices: tuple[str, ...] = ()
    if default_outcome.kind not in FIXED_CLASSES:
        if len(classes) == 1:
            (kind,) = classes
        elif set(classes) == {CONFIRMED, IMMATERIAL}:
            kind = default_outcome.kind
        elif set(classes) <= {CONFIRMED, IMMATERIAL, UNDECIDED} or set(classes) == {REFUTED, UNDECIDED}:
            kind = UNDECIDED
        else:
            kind, choices = DEPENDS, decisive_choices(allowed)
    return replace(default_outcome, kind=kind, depends_on=choices, holds_in=confirmed, interpretations=len(allowed))


def decisive_choices(interpretations: Sequence[InterpretationOutcome]) -> tuple[str, ...]:
    """The choices that change the outcome, the strongest first, equal ones in their order.

    A choice is one of them if two interpretations that differ in it alone have different outcomes. Where no two
    interpretations differ in one choice alone: those by whose values the interpretations differ most in the share that
    holds; where none holds, in the share that is refuted."""
    outcome = CONFIRMED if any(interpretation.outcome == CONFIRMED for interpretation in interpretations) else REFUTED
    choices = list(dict.fromkeys(key for interpretation in interpretations for key in interpretation.choices))
    flips: Counter[str] = Counter()
    has_pairs = False
    for choice in choices:
        for by_alternative in _grouped_by_other_choices(choice, choices, interpretations).values():
            with_outcome = [
                sum(interpretation.outcome == outcome for interpretation in group) for group in by_alternative.values()
            ]
            without_outcome = [
                len(group) - count for group, count in zip(by_alternative.values(), with_outcome, strict=True)
            ]
            flips[choice] += sum(with_outcome) * sum(without_outcome) - sum(
                a * b for a, b in zip(with_outcome, without_outcome, strict=True)
            )
            has_pairs = has_pairs or len(by_alternative) > 1
    if has_pairs and +flips:
        return tuple(name for name, _ in (+flips).most_common())
    spreads = {name: _share_spread(name, interpretations, outcome) for name in choices}
    largest = max(spreads.values(), default=0.0)
    return tuple(
        name for name, interpretation in spreads.items() if interpretation and math.isclose(interpretation, largest)
    )


def _grouped_by_other_choices(
    choice: str, choices: Sequence[str], interpretations: Sequence[InterpretationOutcome]
) -> dict[tuple[str | None, ...], dict[str | None, list[InterpretationOutcome]]]:
    """Interpretations grouped by all their other choices, then by their alternative of this one."""
    groups: dict[tuple[str | None, ...], dict[str | None, list[InterpretationOutcome]]] = {}
    for interpretation in interpretations:
        other_choices = tuple(interpretation.choices.get(key) for key in choices if key != choice)
        groups.setdefault(other_choices, {}).setdefault(interpretation.choices.get(choice), []).append(interpretation)
    return groups


def _share_spread(choice: str, interpretations: Sequence[InterpretationOutcome], outcome: str) -> float:
    """Largest less least share of interpretations with this outcome, over the values of a choice."""
    shares: dict[str, list[bool]] = {}
    for interpretation in interpretations:
        shares.setdefault(interpretation.choices.get(choice, ""), []).append(interpretation.outcome == outcome)
    fractions = [sum(outcomes) / len(outcomes) for outcomes in shares.values()]
    return max(fractions) - min(fractions)
