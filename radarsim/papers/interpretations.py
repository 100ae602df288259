"""What a paper leaves open, as data: choices with their alternatives, and interpretations, which take one of each.

An alternative is equivalent to the print in every respect (E), one of what the paper does not say (U), or against its
print (N). The first alternative of a choice is what the shipped configs take. A verdict is robust if it is the same in
all E and U interpretations; N shows what would have to be changed."""

import itertools
import re
from abc import ABC
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, tr
from radarsim.papers.claim import Claim, PaperClaims, Part
from radarsim.papers.evidence import Evidence
from radarsim.papers.verdict_rule import AGAINST, EQUIVALENT, UNSTATED

if TYPE_CHECKING:
    from radarsim.config.experiment import Case


KINDS = (EQUIVALENT, UNSTATED, AGAINST)  # an interpretation is of the last kind among its alternatives
DEFAULT = "as shipped"
# Of interpretations.csv: before and after a column for each choice, by its key, which may not be called like one.
LEADING_COLUMNS = ("claim", "part", "interpretation", "kind")
TRAILING_COLUMNS = (
    *("measured", "lo", "hi", "exact", "expected_lo", "expected_hi", "margin", "verdict"),
    *("unit", "quantity", "outcome", "miss", "n", "needed", "reason", "over"),
)


class ImpossibleInterpretation(Exception):
    """An interpretation that is impossible to fly or design, and why."""


@dataclass(frozen=True)
class Alternative:
    """One way to take a choice: its name in tables, its kind (E, U or N), the reason for it, and the settings."""

    name: str
    kind: str
    reason: str
    sets: Mapping[str, Any] = field(default_factory=dict, compare=False)
    source: str = field(default="", compare=False)  # where it is written, for messages


@dataclass(frozen=True)
class Choice:
    """An open point of a paper: the column of the table, its name in a sentence, and the paper's sentence on it.

    asks: what a verdict depends on, such as "how the filter starts", without a comma. original is the sentence in the
    paper's language, english in English; both say "nothing" where it is silent. The first alternative is the default.
    claims: the ids of the claims affected; empty: all of the paper. contradicts: the print has more than one of the
    alternatives."""

    key: str
    asks: str
    original: str
    english: str
    alternatives: tuple[Alternative, ...]
    claims: tuple[str, ...] = ()
    contradicts: bool = False

    @property
    def default(self) -> str:
        """The name of the alternative in the shipped configs."""
        return self.alternatives[0].name

    def __getitem__(self, name: str) -> Alternative:
        return next(alternative for alternative in self.alternatives if alternative.name == name)

    def affects(self, claim: str) -> bool:
        """Whether this choice may change the verdict on a claim."""
        return not self.claims or claim in self.claims


@dataclass(frozen=True)
class Interpretation:
    """One alternative of each choice of a paper, by the choice's key, in the order of the choices."""

    alternatives: tuple[tuple[str, str], ...]

    def __getitem__(self, key: str) -> str:
        return dict(self.alternatives)[key]


class OpenChoices:
    """What a paper leaves open."""

    paper: str  # P1
    choices: tuple[Choice, ...]

    @property
    def module(self) -> str:
        """A module of the package that declares them, and the claims."""
        return type(self).__module__

    def leaves_open(self, claim: Claim) -> bool:
        """Whether the paper leaves anything open that affects a claim of its own."""
        return not claim.extension and any(choice.affects(claim.id) for choice in self.choices)

    @cached_property
    def choice_words(self) -> Mapping[str, str]:
        """The choices by key, in words."""
        return {choice.key: choice.asks for choice in self.choices}

    def list_choices(self, keys: Iterable[str]) -> str:
        """Choices within a sentence."""
        return join_names([tr(self.choice_words[key]) for key in keys])


class ShippedChoices(OpenChoices):
    """What a paper that radarsim ships leaves open, without the code of its interpretations."""

    def __init__(self, paper: str, choices: tuple[Choice, ...]):
        self.paper, self.choices = paper, choices


class PaperInterpretations(OpenChoices, ABC):
    """The interpretations of a paper, and how its claims are measured under one. A study with exact numbers gives
    evidence without a run; any other changes the cases of a claim's config, which are then run, and reads their sums
    like those of the paper's own."""

    realisations: int = 1000  # of each run, by default
    max_realisations: int = 16_000  # of a run that is to decide a claim, by default

    def declared_interpretations(self) -> Sequence[Interpretation]:
        """The interpretations to judge, the default first: all combinations of E and U, and each N alone."""
        return list(dict.fromkeys([*self.combinations(self.choices), *self.against_print()]))

    def combinations(self, choices: Iterable[Choice]) -> Iterator[Interpretation]:
        """All combinations of the E and U alternatives of these choices, all others at their default."""
        varied = list(choices)
        allowed = [
            [alternative.name for alternative in choice.alternatives if alternative.kind != AGAINST]
            for choice in varied
        ]
        for names in itertools.product(*allowed):
            yield self.interpretation(**dict(zip((choice.key for choice in varied), names, strict=True)))

    def against_print(self) -> Iterator[Interpretation]:
        """Each alternative against the print, all else at its default."""
        for choice in self.choices:
            for alternative in choice.alternatives:
                if alternative.kind == AGAINST:
                    yield self.interpretation(**{choice.key: alternative.name})

    def interpretation(self, **taken: str) -> Interpretation:
        """The interpretation of these alternatives, the others at their default."""
        return Interpretation(tuple((choice.key, taken.get(choice.key, choice.default)) for choice in self.choices))

    def for_claim(self, claim: str) -> list[Interpretation]:
        """The declared interpretations that differ for a claim: choices that do not affect it stay at their default."""
        bears = [choice.affects(claim) for choice in self.choices]
        firsts: dict[tuple[tuple[str, str], ...], Interpretation] = {}
        for interpretation in self._declared:
            firsts.setdefault(tuple(itertools.compress(interpretation.alternatives, bears)), interpretation)
        return [self.restricted_to(interpretation, claim) for interpretation in firsts.values()]

    @cached_property
    def _declared(self) -> Sequence[Interpretation]:
        return self.declared_interpretations()

    def restricted_to(self, interpretation: Interpretation, claim: str) -> Interpretation:
        """An interpretation with the choices that do not affect a claim at their default."""
        pairs = zip(interpretation.alternatives, self.choices, strict=True)
        return Interpretation(
            tuple((key, name if choice.affects(claim) else choice.default) for (key, name), choice in pairs)
        )

    def kind(self, interpretation: Interpretation) -> str:
        """E, U or N: the last of the kinds of its alternatives that are not the default; E for the default itself."""
        kinds = [choice[interpretation[choice.key]].kind for choice in self._changed_choices(interpretation)]
        return max(kinds, key=KINDS.index, default=EQUIVALENT)

    def name(self, interpretation: Interpretation) -> str:
        """How an interpretation differs from the shipped configs."""
        words = [f"{choice.key}: {interpretation[choice.key]}" for choice in self._changed_choices(interpretation)]
        return "; ".join(words) or DEFAULT

    def describe(self, interpretation: Interpretation) -> str:
        """How an interpretation differs from the shipped configs, for people."""
        return describe_choices(
            {choice.key: interpretation[choice.key] for choice in self._changed_choices(interpretation)},
            self.choice_words,
        )

    def settings(self, interpretation: Interpretation) -> dict[str, Any]:
        """The settings of an interpretation's alternatives."""
        return {key: value for choice in self.choices for key, value in choice[interpretation[choice.key]].sets.items()}

    def _changed_choices(self, interpretation: Interpretation) -> list[Choice]:
        return [choice for choice in self.choices if interpretation[choice.key] != choice.default]

    def parts(self, claim: Claim, interpretation: Interpretation) -> Sequence[Part]:
        """The parts of a claim to judge under an interpretation. Default: all."""
        return claim.parts

    def changed_case(self, claim: Claim, case: "Case", interpretation: Interpretation) -> "Case | None":
        """A case of a claim's config changed for an interpretation; None where the claim does not need it. Raises
        ImpossibleInterpretation where it is impossible to fly or design."""
        return None

    def evidence(
        self,
        claim: Claim,
        interpretation: Interpretation,
        changed_results: "ChangedResults | None",
        paper_claims: PaperClaims,
    ) -> "Evidence":
        """The evidence for a claim under an interpretation; changed_results: the results of its cases, None where
        all is exact.

        paper_claims: the claims of the paper. Default: their evidence, over the changed results."""
        assert changed_results is not None  # a paper with exact values gives its own evidence
        return paper_claims.evidence(changed_results.results, changed_results.tables, changed_results.places)

    def is_exact(self, claim: Claim, interpretation: Interpretation) -> bool:
        """Whether the evidence for a claim is exact under an interpretation, so that nothing is run. Default: no."""
        return False


def describe_choices(alternatives: Mapping[str, str], asks: Mapping[str, str]) -> str:
    """The alternatives in place of the default, by the key of the choice, for people."""
    words = [f"{tr(asks.get(key, key))}: {alternative_words(name)}" for key, name in alternatives.items()]
    return "; ".join(words) or tr(DEFAULT)


def alternative_words(name: str) -> str:
    """The name of an alternative, for people."""
    return tr(with_spaces(name)) if re.search("[a-zA-Z]", name) else numeral(name)


def with_spaces(name: str) -> str:
    """A name with its words apart; σ_a stays."""
    return re.sub("(?<=[a-z])_(?=[a-z])", " ", name)


@dataclass(frozen=True)
class ChangedResults:
    """Results of the changed cases of a config, under the names and keys of that config.

    results (in the order of the config) are those of the run, each with the keys of the paper's own case, by which
    claims find it (`evidence.InterpretedCase`); run_results are without these. tables and places are as in
    `evidence.Evidence`."""

    results: Sequence[CaseResult]
    run_results: Sequence[CaseResult]
    tables: Mapping[str, Any]
    places: Mapping[str, Mapping[str, set[int]]]
