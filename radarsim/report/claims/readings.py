"""What a paper leaves open, as data: choices with their alternatives, and readings, which take one of each.

An alternative is equivalent to the print in every respect (E), one of what the paper does not say (U), or against its
print (N). The first alternative of a choice is what the shipped configs take. A verdict is robust if it is the same
in all E and U readings; N shows what would have to be changed.
"""

import itertools
from abc import ABC
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.report.claims.declared import Claim, PaperClaims, Part
from radarsim.report.claims.rule import AGAINST, EQUIVALENT, UNSTATED

if TYPE_CHECKING:
    from radarsim.config.experiment import Case
    from radarsim.report.claims.evidence import Evidence
    from radarsim.report.claims.search import Search

KINDS = (EQUIVALENT, UNSTATED, AGAINST)  # a reading is of the last kind among its alternatives
DEFAULT = "as shipped"


class Unreadable(Exception):
    """A reading that cannot be flown or designed, and why."""


@dataclass(frozen=True)
class Alternative:
    """One way to take a choice: its name in tables, its kind (E, U or N), why it is one, and what it sets."""

    name: str
    kind: str
    reason: str
    sets: Mapping[str, Any] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class Choice:
    """Something that a paper leaves open: the column of the table, what is open, and the paper's sentence on it.

    original is the sentence in the paper's language, english in English; both say "nothing" where it is silent. The
    first alternative is the default. claims: the ids of those on which it bears; empty: all of the paper. contradicts:
    the print has more than one of the alternatives.
    """

    key: str
    asks: str
    original: str
    english: str
    alternatives: tuple[Alternative, ...]
    claims: tuple[str, ...] = ()
    contradicts: bool = False

    @property
    def default(self) -> str:
        """The name of what the shipped configs take."""
        return self.alternatives[0].name

    def __getitem__(self, name: str) -> Alternative:
        return next(one for one in self.alternatives if one.name == name)

    def bears_on(self, claim: str) -> bool:
        """Whether a claim may come out otherwise by this choice."""
        return not self.claims or claim in self.claims


@dataclass(frozen=True)
class Reading:
    """One alternative of each choice of a paper, by the choice's key, in the order of the choices."""

    taken: tuple[tuple[str, str], ...]

    def __getitem__(self, key: str) -> str:
        return dict(self.taken)[key]


class PaperReadings(ABC):
    """The readings of a paper, and how its claims are measured under one.

    A study whose numbers are known exactly gives evidence without a run; any other changes the cases of a claim's
    config, which are then run, and reads their sums as it reads those of the paper's own.
    """

    paper: str  # P1
    choices: tuple[Choice, ...]
    realisations: int = 1000  # of each run, where none are asked for
    most: int = 16_000  # of a run that is to decide a claim, where none are asked for

    def open(self, claim: Claim) -> bool:
        """Whether the paper leaves anything open on which a claim of its own may hang."""
        return not claim.extension and any(choice.bears_on(claim.id) for choice in self.choices)

    # ---- the readings --------------------------------------------------------------------------------------------
    def declared(self) -> Sequence[Reading]:
        """The readings that are judged, the default first: all combinations of E and U, and each N alone."""
        return list(dict.fromkeys([*self.combined(self.choices), *self.against_print()]))

    def combined(self, choices: Iterable[Choice]) -> Iterator[Reading]:
        """All combinations of the E and U alternatives of these choices, all others at their default."""
        varied = list(choices)
        allowed = [[one.name for one in choice.alternatives if one.kind != AGAINST] for choice in varied]
        for names in itertools.product(*allowed):
            yield self.reading(**dict(zip((choice.key for choice in varied), names, strict=True)))

    def against_print(self) -> Iterator[Reading]:
        """Each alternative against the print, all else at its default."""
        for choice in self.choices:
            for one in choice.alternatives:
                if one.kind == AGAINST:
                    yield self.reading(**{choice.key: one.name})

    def reading(self, **taken: str) -> Reading:
        """The reading of these alternatives, the others at their default."""
        return Reading(tuple((choice.key, taken.get(choice.key, choice.default)) for choice in self.choices))

    def of_claim(self, claim: str) -> list[Reading]:
        """The declared readings that differ for a claim: what does not bear on it is left at its default."""
        return list(dict.fromkeys(self.bearing(one, claim) for one in self._declared))

    @cached_property
    def _declared(self) -> Sequence[Reading]:
        return self.declared()

    def bearing(self, reading: Reading, claim: str) -> Reading:
        """A reading with what does not bear on a claim left at its default."""
        pairs = zip(reading.taken, self.choices, strict=True)
        return Reading(tuple((key, name if one.bears_on(claim) else one.default) for (key, name), one in pairs))

    def kind(self, reading: Reading) -> str:
        """E, U or N: the last of the kinds of its alternatives that are not the default; E of the default itself."""
        kinds = [choice[reading[choice.key]].kind for choice in self._other(reading)]
        return max(kinds, key=KINDS.index, default=EQUIVALENT)

    def name(self, reading: Reading) -> str:
        """What a reading takes otherwise than the shipped configs."""
        words = [f"{choice.key}: {reading[choice.key]}" for choice in self._other(reading)]
        return "; ".join(words) or DEFAULT

    def sets(self, reading: Reading) -> dict[str, Any]:
        """The values that the alternatives of a reading set."""
        return {key: value for one in self.choices for key, value in one[reading[one.key]].sets.items()}

    def _other(self, reading: Reading) -> list[Choice]:
        return [choice for choice in self.choices if reading[choice.key] != choice.default]

    # ---- a claim under a reading -----------------------------------------------------------------------------------
    def parts(self, claim: Claim, reading: Reading) -> Sequence[Part]:
        """The parts of a claim that a reading is asked for. Default: all."""
        return claim.parts

    def changed(self, claim: Claim, case: "Case", reading: Reading) -> "Case | None":
        """A case of a claim's config as a reading takes it; None where the claim needs no such case.

        Raises Unreadable where it cannot be flown or designed.
        """
        return None

    def evidence(self, claim: Claim, reading: Reading, seen: "Seen | None", of: PaperClaims) -> "Evidence":
        """What a claim is measured by under a reading; seen: what its cases gave, None where all is exact.

        of: the paper's claims. Default: the evidence of these, over what was seen.
        """
        assert seen is not None  # a paper whose values are exact gives evidence of its own
        return of.evidence(seen.results, seen.tables, seen.places)

    def exact(self, claim: Claim, reading: Reading) -> bool:
        """Whether the evidence of a claim is exact under a reading, so that nothing is run. Default: no."""
        return False

    def search(self) -> "Search | None":
        """The printed numbers of the paper under many readings at once. Default: none."""
        return None


@dataclass(frozen=True)
class Seen:
    """What the changed cases of a config gave, under the names and keys that the config gives them.

    results (in the order of the config) have the sums and axes of what was run and the keys of the paper's own case,
    by which claims find it; ran has them with the keys that were run. tables and places are as `claims.Evidence` takes
    them.
    """

    results: Sequence[CaseResult]
    ran: Sequence[CaseResult]
    tables: Mapping[str, Any]
    places: Mapping[str, Mapping[str, set[int]]]
