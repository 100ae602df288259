"""The joint search over declared readings: under which of them most of what a paper prints comes out.

What is counted is every number, limit or comparison that the claims assert, once each: of variants of a number one
suffices. Under the strict rule it comes out if its interval, or its exact value, lies in the range that the print
rounds to, under the granular one if it lies within the margin of its words.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from radarsim.language import term, tr
from radarsim.report.claims import rule
from radarsim.report.claims.declared import Part
from radarsim.report.claims.over import Over, Under
from radarsim.report.claims.readings import PaperReadings, Reading
from radarsim.report.claims.rule import Judged

Key = tuple[str, str]  # the claim, and the number within it

TO_THE_PRINT = term("to the print {count} of {of} numbers come out as shipped")
WITHIN = term("within the margins of the words {count} of {of} numbers come out as shipped")


@dataclass(frozen=True)
class Outcome:
    """What came of a printed number under a reading: its value, and by which rule it comes out.

    open: its interval is too wide to say whether it lies within the margin.
    """

    value: float
    strict: bool
    granular: bool
    open: bool


@dataclass(frozen=True)
class Asserted:
    """A number that a paper prints: its claim, what it is, the words and the unit."""

    claim: str
    what: str
    words: str
    unit: str


@dataclass(frozen=True)
class Together:
    """A reading with the claims that hold and were judged under it, and what came of every number."""

    reading: Reading
    name: str
    kind: str
    held: tuple[str, ...]
    judged: tuple[str, ...]
    outcomes: Mapping[Key, Outcome]

    def count(self, granular: bool) -> int:
        """How many numbers come out."""
        return sum(one.granular if granular else one.strict for one in self.outcomes.values())

    @property
    def open(self) -> int:
        """Of how many it cannot be said whether they lie within their margin."""
        return sum(one.open for one in self.outcomes.values())


@dataclass(frozen=True)
class Joint:
    """What a paper prints, under all readings that are declared: the readings, and the numbers by their keys."""

    of: PaperReadings
    every: tuple[Together, ...]
    numbers: Mapping[Key, Asserted]

    @property
    def shipped(self) -> Together:
        """The reading that the shipped configs take."""
        return self._of(self.of.reading())

    def best(self, granular: bool) -> Together:
        """That with most numbers; of several that with most under the other rule, then nearest the shipped."""
        allowed = [one for one in self.every if one.kind != rule.AGAINST]
        return max(
            allowed, key=lambda one: (one.count(granular), one.count(not granular), -changed(self.of, one.reading))
        )

    def _of(self, reading: Reading) -> Together:
        return next(one for one in self.every if one.reading == reading)

    def sentence(self) -> str:
        """What the search comes to."""
        said = []
        for granular, words in ((False, TO_THE_PRINT), (True, WITHIN)):
            own, best = self.shipped, self.best(granular)
            text = tr(words, count=own.count(granular), of=len(own.outcomes))
            if best.count(granular) > own.count(granular):
                text += tr(
                    ", {count} of {of} with {name}", count=best.count(granular), of=len(best.outcomes), name=best.name
                )
            else:
                text += tr(", and no reading that the paper allows gives more")
            said.append(text)
        return tr("{count:,} readings: {said}.", count=len(self.every), said="; ".join(said))

    def windows(self, key: str) -> dict[Key, str]:
        """The alternatives of a choice, all others as shipped, under which each number comes out to the print."""
        choice = next(one for one in self.of.choices if one.key == key)
        names = [one.name for one in choice.alternatives]
        alone = {name: self.of.reading(**{key: name}) for name in names}
        known = {one.reading: one for one in self.every}
        found = {}
        for number in self.numbers:
            tried = {name: known[of].outcomes.get(number) for name, of in alone.items() if of in known}
            found[number] = _listed({name: outcomes.strict for name, outcomes in tried.items() if outcomes is not None})
        return found


def _listed(held: Mapping[str, bool]) -> str:
    yes = [name for name, holds in held.items() if holds]
    no = [name for name, holds in held.items() if not holds]
    if not no:
        return "all"
    if not yes:
        return "none"
    return f"all but {', '.join(no)}" if len(no) < len(yes) else ", ".join(yes)


def joint(of: PaperReadings, over: Sequence[Over]) -> Joint:
    """The joint search of a paper over its claims' readings, those that give most numbers first.

    The readings are those that are declared for a claim, and all combinations of E and U under which every claim was
    judged: as under the reading that takes what bears on it.
    """
    over = [one for one in over if one.claim.counted]
    claims = [{one.reading: _Own(one) for one in claim.under if one.outcome is not None} for claim in over]
    declared = dict.fromkeys(one.reading for claim in over for one in claim.under)
    varied = [choice for choice in of.choices if any(choice.bears_on(claim.claim.id) for claim in over)]
    found = []
    for reading in dict.fromkeys([*declared, *of.combined(varied)]):
        at = [own.get(of.bearing(reading, claim.claim.id)) for claim, own in zip(over, claims, strict=True)]
        own = [one for one in at if one is not None]
        if len(own) < len(at) and reading not in declared:
            continue
        held = tuple(one.under.claim.id for one in own if one.held)
        outcomes = {key: value for one in own for key, value in one.outcomes.items()}
        judged = tuple(one.under.claim.id for one in own)
        found.append(Together(reading, of.name(reading), of.kind(reading), held, judged, outcomes))
    found.sort(key=lambda one: (-one.count(False), -one.count(True), -len(one.held), changed(of, one.reading)))
    numbers: dict[Key, Asserted] = {}
    for key, asserted in (item for own in claims for one in own.values() for item in one.numbers.items()):
        numbers.setdefault(key, asserted)  # a number has the name that it has as shipped, of the first reading
    return Joint(of, tuple(found), numbers)


def changed(of: PaperReadings, reading: Reading) -> int:
    """How many choices a reading takes otherwise than the shipped configs."""
    return sum(reading[choice.key] != choice.default for choice in of.choices)


class _Own:
    """A claim under one reading: whether it holds, its numbers, and what came of them."""

    def __init__(self, under: Under):
        self.under = under
        self.held = under.outcome is not None and under.outcome.kind == rule.CONFIRMED
        parts = _numbers(under)
        self.outcomes = {key: _outcome(under, own) for key, own in parts.items()}
        self.numbers = {
            key: Asserted(under.claim.id, part.what, part.expected.words, part.unit)
            for key, ((part, _), *_) in parts.items()
        }


def _numbers(one: Under) -> dict[Key, list[tuple[Part, Judged]]]:
    """The parts that the paper asserts, by the number that they are of; a void one tests nothing."""
    found: dict[Key, list[tuple[Part, Judged]]] = {}
    for place, (part, judged) in enumerate(one.parts):
        if part.asserted and not judged.void:
            number = f"{part.statement}: {part.number}" if part.number else f"#{place}"
            found.setdefault((one.claim.id, number), []).append((part, judged))
    return found


def _outcome(one: Under, parts: Sequence[tuple[Part, Judged]]) -> Outcome:
    many = sum(judged.sampled for _, judged in one.parts)
    return max(
        (_one(part, judged, many) for part, judged in parts), key=lambda outcomes: (outcomes.strict, outcomes.granular)
    )


def _one(part: Part, judged: Judged, many: int) -> Outcome:
    lo, hi = rule.ends(judged, many)
    low, high = judged.expected_lo - judged.margin, judged.expected_hi + judged.margin
    slack = rule.ROUNDING * judged.margin
    strict = part.expected.strict[0] - slack <= lo and hi <= part.expected.strict[1] + slack
    granular = low - slack <= lo and hi <= high + slack
    return Outcome(judged.value, strict, granular, not granular and not (hi < low or lo > high))
