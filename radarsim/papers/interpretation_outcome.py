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


def outcome_over_interpretations(own: ClaimOutcome, interpretations: Sequence[InterpretationOutcome]) -> ClaimOutcome:
    """The outcome of a claim from that of the default interpretation and those of all: only E and U count. Confirmed
    only if true in all of them, refuted only if false in all, else it depends on the choices. Some outcomes hold under
    every interpretation: a print that contradicts itself, a statement that cannot be judged."""
    counted = [one for one in interpretations if one.kind in (EQUIVALENT, UNSTATED) and one.outcome]
    if not counted:
        return own
    said = Counter(one.outcome for one in counted)
    holds = said[CONFIRMED]
    kind: str = own.kind
    on: tuple[str, ...] = ()
    if own.kind not in FIXED_CLASSES:
        if len(said) == 1:
            (kind,) = said
        elif set(said) == {CONFIRMED, IMMATERIAL}:
            kind = own.kind
        elif set(said) <= {CONFIRMED, IMMATERIAL, UNDECIDED} or set(said) == {REFUTED, UNDECIDED}:
            kind = UNDECIDED
        else:
            kind, on = DEPENDS, decisive_choices(counted)
    return replace(own, kind=kind, depends_on=on, holds_in=holds, interpretations=len(counted))


def decisive_choices(interpretations: Sequence[InterpretationOutcome]) -> tuple[str, ...]:
    """The choices that change the outcome, the strongest first, equal ones in their order.

    A choice is one of them if two interpretations that differ in it alone have different outcomes. Where no two
    interpretations differ in one choice alone: those by whose values the interpretations differ most in the share that
    holds; where none holds, in the share that is refuted."""
    asked = CONFIRMED if any(one.outcome == CONFIRMED for one in interpretations) else REFUTED
    choices = list(dict.fromkeys(key for one in interpretations for key in one.choices))
    found: Counter[str] = Counter()
    alone = False
    for choice in choices:
        for own in _grouped_by_other_choices(choice, choices, interpretations).values():
            held = [sum(one.outcome == asked for one in alike) for alike in own.values()]
            missed = [len(alike) - count for alike, count in zip(own.values(), held, strict=True)]
            found[choice] += sum(held) * sum(missed) - sum(a * b for a, b in zip(held, missed, strict=True))
            alone = alone or len(own) > 1
    if alone and +found:
        return tuple(name for name, _ in (+found).most_common())
    spread = {name: _share_spread(name, interpretations, asked) for name in choices}
    most = max(spread.values(), default=0.0)
    return tuple(name for name, one in spread.items() if one and math.isclose(one, most))


def _grouped_by_other_choices(
    choice: str, choices: Sequence[str], interpretations: Sequence[InterpretationOutcome]
) -> dict[tuple[str | None, ...], dict[str | None, list[InterpretationOutcome]]]:
    """Interpretations grouped by all their other choices, then by their alternative of this one."""
    found: dict[tuple[str | None, ...], dict[str | None, list[InterpretationOutcome]]] = {}
    for one in interpretations:
        rest = tuple(one.choices.get(key) for key in choices if key != choice)
        found.setdefault(rest, {}).setdefault(one.choices.get(choice), []).append(one)
    return found


def _share_spread(choice: str, interpretations: Sequence[InterpretationOutcome], asked: str) -> float:
    """Largest less least share of interpretations with this outcome, over the values of a choice."""
    shares: dict[str, list[bool]] = {}
    for one in interpretations:
        shares.setdefault(one.choices.get(choice, ""), []).append(one.outcome == asked)
    held = [sum(own) / len(own) for own in shares.values()]
    return max(held) - min(held)
