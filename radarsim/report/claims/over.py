"""What a paper leaves open, as data: choices with their alternatives, and readings, which take one of each.

An alternative is equivalent to the print in every respect (E), one of what the paper does not say (U), or against its
print (N). The first alternative of a choice is what the shipped configs take. A verdict is robust if it is the same
in all E and U readings; N shows what would have to be changed.

The joint search: which readings of a paper give most of the numbers that it prints.

Every number is computed under every combination of the choices' values. A number comes out under the strict rule if it
rounds to what is printed, and under the granular one if it is as near as the print's own steps allow.

Claims as they are written in YAML beside a study: statement, place, and what is measured by which function.

    - id: 4
      place: section 2
      statement: The gain lies between 10 and 50 %
      original: Der Gewinn liegt zwischen 10 und 50 %
      parts:
      - {of: [1], each: {pick: [least, largest]}, what: $pick gain, unit: "%",
         measure: {gain: {component: r, pick: $pick}}, expected: {between: ["10", "50"]}}

`measure` names a function of the study's measures, or a method of its evidence; it is called with the evidence, the
cases under `of`, and the arguments that are given by name. `expected` names a function of `claims.rule`. `$name` is
a value of `names:`, or of `each:`, which makes a part of every combination of its values; `"a, b":` takes several at
once. An argument that is none of the function's is a fault with file and line, as in a config.

Verdicts on a claim under every reading of its paper: the table readings.csv, and what the claim depends on.

The joint search over declared readings: under which of them most of what a paper prints comes out.

What is counted is every number, limit or comparison that the claims assert, once each: of variants of a number one
suffices. Under the strict rule it comes out if its interval, or its exact value, lies in the range that the print
rounds to, under the granular one if it lies within the margin of its words."""

import inspect
import itertools
import math
import re
from abc import ABC
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from string import Template
from types import ModuleType, UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin

import numpy as np

from radarsim import failures
from radarsim.config.check import check
from radarsim.config.document import Document, Faults, did_you_mean, shown
from radarsim.config.document import KeyPath as Keys
from radarsim.config.fields import Anything, Flag, Model, Name, Stem
from radarsim.config.load import parse, read
from radarsim.engine.results import CaseResult
from radarsim.errors import OF_AUTHORS, ConfigError, MeasureError, RadarsimError
from radarsim.language import listed, numeral, term, tr
from radarsim.report.claims import rule
from radarsim.report.claims.declared import (
    Claim,
    Evidence,
    Missing,
    NoSuchName,
    NoSuchScans,
    PaperClaims,
    Part,
    certain,
)
from radarsim.report.claims.judge import exact as known
from radarsim.report.claims.judge import weighed
from radarsim.report.claims.rule import AGAINST, EQUIVALENT, UNSTATED, Judged, Outcome
from radarsim.report.statistics import Estimate

if TYPE_CHECKING:
    from radarsim.config.experiment import Case


# ---- readings --------------------------------------------------------------------------------------------------------
KINDS = (EQUIVALENT, UNSTATED, AGAINST)  # a reading is of the last kind among its alternatives
DEFAULT = "as shipped"


class Unreadable(Exception):
    """A reading that is impossible to fly or design, and why."""


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
        return next(one for one in self.alternatives if one.name == name)

    def bears_on(self, claim: str) -> bool:
        """Whether this choice may change the verdict on a claim."""
        return not self.claims or claim in self.claims


@dataclass(frozen=True)
class Reading:
    """One alternative of each choice of a paper, by the choice's key, in the order of the choices."""

    taken: tuple[tuple[str, str], ...]

    def __getitem__(self, key: str) -> str:
        return dict(self.taken)[key]


class PaperReadings(ABC):
    """The readings of a paper, and how its claims are measured under one. A study with exact numbers gives evidence
    without a run; any other changes the cases of a claim's config, which are then run, and reads their sums like those
    of the paper's own."""

    paper: str  # P1
    choices: tuple[Choice, ...]
    realisations: int = 1000  # of each run, by default
    most: int = 16_000  # of a run that is to decide a claim, by default

    def open(self, claim: Claim) -> bool:
        """Whether the paper leaves anything open that affects a claim of its own."""
        return not claim.extension and any(choice.bears_on(claim.id) for choice in self.choices)

    # ---- the readings --------------------------------------------------------------------------------------------
    def declared(self) -> Sequence[Reading]:
        """The readings to judge, the default first: all combinations of E and U, and each N alone."""
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
        """The declared readings that differ for a claim: choices that do not affect it stay at their default."""
        bears = [choice.bears_on(claim) for choice in self.choices]
        firsts: dict[tuple[tuple[str, str], ...], Reading] = {}
        for one in self._declared:
            firsts.setdefault(tuple(itertools.compress(one.taken, bears)), one)
        return [self.bearing(one, claim) for one in firsts.values()]

    @cached_property
    def _declared(self) -> Sequence[Reading]:
        return self.declared()

    def bearing(self, reading: Reading, claim: str) -> Reading:
        """A reading with the choices that do not affect a claim at their default."""
        pairs = zip(reading.taken, self.choices, strict=True)
        return Reading(tuple((key, name if one.bears_on(claim) else one.default) for (key, name), one in pairs))

    def kind(self, reading: Reading) -> str:
        """E, U or N: the last of the kinds of its alternatives that are not the default; E for the default itself."""
        kinds = [choice[reading[choice.key]].kind for choice in self._other(reading)]
        return max(kinds, key=KINDS.index, default=EQUIVALENT)

    def name(self, reading: Reading) -> str:
        """How a reading differs from the shipped configs."""
        words = [f"{choice.key}: {reading[choice.key]}" for choice in self._other(reading)]
        return "; ".join(words) or DEFAULT

    def said(self, reading: Reading) -> str:
        """How a reading differs from the shipped configs, for people."""
        return in_words({choice.key: reading[choice.key] for choice in self._other(reading)}, self.asks)

    @cached_property
    def asks(self) -> Mapping[str, str]:
        """The choices by key, in words."""
        return {choice.key: choice.asks for choice in self.choices}

    def asked(self, keys: Iterable[str]) -> str:
        """Choices within a sentence."""
        return listed([tr(self.asks[key]) for key in keys])

    def sets(self, reading: Reading) -> dict[str, Any]:
        """The settings of a reading's alternatives."""
        return {key: value for one in self.choices for key, value in one[reading[one.key]].sets.items()}

    def _other(self, reading: Reading) -> list[Choice]:
        return [choice for choice in self.choices if reading[choice.key] != choice.default]

    # ---- a claim under a reading -----------------------------------------------------------------------------------
    def parts(self, claim: Claim, reading: Reading) -> Sequence[Part]:
        """The parts of a claim to judge under a reading. Default: all."""
        return claim.parts

    def changed(self, claim: Claim, case: "Case", reading: Reading) -> "Case | None":
        """A case of a claim's config changed for a reading; None where the claim does not need it. Raises Unreadable
        where it is impossible to fly or design."""
        return None

    def evidence(self, claim: Claim, reading: Reading, seen: "Seen | None", of: PaperClaims) -> "Evidence":
        """The evidence for a claim under a reading; seen: the results of its cases, None where all is exact.

        of: the paper's claims. Default: their evidence, over `seen`."""
        assert seen is not None  # a paper with exact values gives its own evidence
        return of.evidence(seen.results, seen.tables, seen.places)

    def exact(self, claim: Claim, reading: Reading) -> bool:
        """Whether the evidence for a claim is exact under a reading, so that nothing is run. Default: no."""
        return False

    def search(self) -> "Search | None":
        """The printed numbers of the paper under many readings at once. Default: none."""
        return None


def in_words(taken: Mapping[str, str], asks: Mapping[str, str]) -> str:
    """What is taken of choices in place of the default, for people."""
    words = [f"{tr(asks.get(key, key))}: {alternative(name)}" for key, name in taken.items()]
    return "; ".join(words) or tr(DEFAULT)


def alternative(name: str) -> str:
    """The name of an alternative, for people."""
    return tr(spaced(name)) if re.search("[a-zA-Z]", name) else numeral(name)


def spaced(name: str) -> str:
    """A name with its words apart; σ_a stays."""
    return re.sub("(?<=[a-z])_(?=[a-z])", " ", name)


@dataclass(frozen=True)
class Seen:
    """Results of the changed cases of a config, under the names and keys of that config.

    results (in the order of the config) have the sums and axes of the run and the keys of the paper's own case, by
    which claims find it; ran has them with the keys of the run. tables and places are as in `claims.Evidence`."""

    results: Sequence[CaseResult]
    ran: Sequence[CaseResult]
    tables: Mapping[str, Any]
    places: Mapping[str, Mapping[str, set[int]]]


# ---- search ----------------------------------------------------------------------------------------------------------
TO_THE_DIGIT = term("as shipped {count} of {of} match to the printed digit")
TO_THE_STEPS = term("as shipped {count} of {of} match to the steps of the print")


@dataclass(frozen=True)
class Printed:
    """A number that a paper prints: its claim, its description, and the values that count as equal to it."""

    claim: str
    what: str
    unit: str
    printed: str
    strict: tuple[float, float]
    granular: tuple[float, float]


@dataclass(frozen=True)
class Fine:
    """The strict rule on a finer grid of one choice, all others as shipped: values (m) and strict (n, m)."""

    values: Sequence[float]
    strict: np.ndarray


@dataclass(frozen=True)
class Search:
    """Printed numbers (n) under all combinations of the values of some choices.

    axes: key of a choice → its values, the shipped one given by `shipped`. strict and granular (n, *lengths of axes):
    whether a number is reproduced; `values`: the numbers. fine: for choices whose values are numbers without steps.
    read_as: strict and granular in words. asks: the choices in words, by key; of a study, its further ones."""

    printed: Sequence[Printed]
    axes: Mapping[str, Sequence[str]]
    shipped: Mapping[str, str]
    strict: np.ndarray
    granular: np.ndarray
    values: np.ndarray
    fine: Mapping[str, Fine] = field(default_factory=dict)
    read_as: str = ""
    asks: Mapping[str, str] = field(default_factory=dict)

    @property
    def readings(self) -> int:
        """The number of combinations."""
        return int(self.strict[0].size)

    @cached_property
    def place(self) -> tuple[int, ...]:
        """The index of the shipped combination."""
        return tuple(list(values).index(self.shipped[key]) for key, values in self.axes.items())

    def count(self, granular: bool) -> np.ndarray:
        """How many printed numbers are reproduced, for every combination."""
        return (self.granular if granular else self.strict).sum(axis=0)

    def best(self, granular: bool) -> tuple[int, ...]:
        """The combination with most numbers; of several, most under the other rule, then nearest the shipped."""
        own, other = self.count(granular), self.count(not granular)
        score = own.astype(np.int64) * (len(self.printed) + 1) + other
        tied = np.argwhere(score == score.max())
        changed = (tied != np.array(self.place)).sum(axis=1)
        return tuple(int(i) for i in tied[np.argmin(changed)])

    def taken(self, place: tuple[int, ...]) -> dict[str, str]:
        """The values of the choices in a combination."""
        return {key: values[i] for (key, values), i in zip(self.axes.items(), place, strict=True)}

    def measured(self, place: tuple[int, ...]) -> np.ndarray:
        """The numbers (n,) in a combination."""
        return np.moveaxis(self.values, 0, -1)[place]

    def sentence(self) -> str:
        """The result of the search."""
        of, place = len(self.printed), self.place
        parts = []
        for granular, sentence in ((False, TO_THE_DIGIT), (True, TO_THE_STEPS)):
            count = self.count(granular)
            best = int(count.max())
            own = int(count[place])
            words = tr(sentence, count=own, of=of)
            if best > own:
                words += tr(", {count} with {name}", count=best, name=self.words(self.best(granular)))
            else:
                words += tr(", and no reading gives more")
            parts.append(words)
        return tr("{count:,} readings: {said}.", count=self.readings, said="; ".join(parts))

    def words(self, place: tuple[int, ...]) -> str:
        """How a combination differs from the shipped one."""
        other = {key: value for key, value in self.taken(place).items() if value != self.shipped[key]}
        return in_words(other, self.asks)

    def windows(self, key: str) -> list[str]:
        """The values of one choice, all others as shipped, at which each number equals the printed digits."""
        if key in self.fine:
            fine = self.fine[key]
            return [_intervals(fine.values, row) for row in fine.strict]
        axis = list(self.axes).index(key)
        place: list[int | slice] = list(self.place)
        place[axis] = slice(None)
        values = self.axes[key]
        rows = self.strict[(slice(None), *place)]
        return [_listed_numbers(values, row) for row in rows]


def _intervals(values: Sequence[float], held: np.ndarray) -> str:
    """Runs of a grid in which something holds: `0.00083 … 0.001`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(int), [0]])))
    runs = [(values[a], values[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return ", ".join(f"{a:.3g}" if a == b else f"{a:.3g} … {b:.3g}" for a, b in runs) or "none"


def _listed_numbers(values: Sequence[str], held: np.ndarray) -> str:
    if held.all():
        return "all"
    try:
        return _intervals([float(value) for value in values], held)
    except ValueError:
        return ", ".join(value for value, holds in zip(values, held, strict=True) if holds) or "none"


# ---- written ---------------------------------------------------------------------------------------------------------
RANGES = (
    *("printed", "between", "about", "above", "below", "at_most", "at_least", "greater", "less", "within", "same"),
    *("kept", "on_grid"),
)
Keyed = TypeVar("Keyed", bound=Model)
Written = TypeVar("Written", Claim, Choice)
TYPES = {str: "text", float: "a number", int: "a whole number", bool: "true or false"}


class PartKeys(Model):
    """A part of a claim; see `declared.Part`."""

    what: str
    of: Anything
    measure: Anything
    expected: Anything
    unit: str = ""
    scale: Anything = None
    ceiling: Anything = None
    statement: str = ""
    number: str = ""
    variant: str = ""
    against_print: Anything = False
    asserted: Flag = True
    each: dict[str, Anything] = {}  # noqa: RUF012  (pydantic copies it)


class ClaimKeys(Model):
    """A claim; see `declared.Claim`. parts_of: the claims whose parts it has too."""

    id: Anything
    place: str
    statement: str
    reading: str = ""
    config: Stem | None = None
    original: str = ""
    extension: Flag = False
    reported: Flag = False
    unstated: str = ""
    joint: Flag = False
    internal: Flag = False
    parts_of: tuple[str, ...] = ()
    parts: tuple[PartKeys, ...] = ()


class AlternativeKeys(Model):
    """A way to take a choice; see `Alternative`."""

    name: str
    kind: Literal["E", "U", "N"]
    reason: str
    sets: dict[str, Anything] = {}  # noqa: RUF012


class ChoiceKeys(Model):
    """An open point of a paper; see `Choice`. claims: without the paper; english: where the paper is not silent."""

    key: Stem
    asks: str
    original: str
    english: str = ""
    claims: Anything = ()
    contradicts: Flag = False
    alternatives: tuple[AlternativeKeys, ...]


class ChoicesKeys(Model):
    """The open points of a paper, the file readings.yaml."""

    paper: Name
    names: dict[str, Anything] = {}  # noqa: RUF012
    choices: tuple[ChoiceKeys, ...]


class FileKeys(Model):
    """The claims of a paper in one file; config: of those that name none. choices: as in readings.yaml."""

    paper: Name
    config: Stem
    names: dict[str, Anything] = {}  # noqa: RUF012
    claims: tuple[ClaimKeys, ...]
    choices: tuple[ChoiceKeys, ...] = ()


@dataclass(frozen=True)
class Call:
    """A function by name, or a method of the evidence where function is None, with its cases and arguments."""

    name: str
    function: Callable[..., Any] | None
    cases: tuple
    arguments: Mapping[str, Any]
    source: str = field(default="", compare=False)  # where it is written, for messages

    def __call__(self, seen: Any) -> Estimate:
        """The measured value; a plain number is without noise. Raises MeasureError where the function fails."""
        try:
            if self.function is None:
                found = getattr(seen, self.name)(*self.cases, **self.arguments)
            else:
                found = self.function(seen, *self.cases, **self.arguments)
        except OF_AUTHORS as error:
            other = isinstance(error, RadarsimError) and not isinstance(error, ConfigError)
            if other or (isinstance(error, Missing | Unreadable) and not self._misspelt(error)):
                raise
            raise MeasureError(f"{self.source}: {self.name}: {failures.summary(error)}") from error
        if isinstance(found, Estimate):
            return found
        with suppress(TypeError, ValueError):
            if not isinstance(found, str | bytes):
                return certain(found)
        raise MeasureError(f"{self.source}: {self.name}: must give an Estimate or a number, got {shown(found)}")

    def _misspelt(self, error: Exception) -> bool:
        """Whether a function of a package asks for a name that the paper's own case does not have."""
        of_a_package = self.function is not None and not self.function.__module__.startswith("radarsim.")
        return of_a_package and isinstance(error, NoSuchName)

    def number(self, seen: Any) -> float:
        """Its value alone."""
        return float(self(seen).value)


@cache
def claims_in(file: Path, *measures: ModuleType) -> tuple[Claim, ...]:
    """The claims of a file, measured by functions of these modules; raises ConfigError, one line for each fault."""
    faults = Faults()
    return _made(read(file, faults), faults, FileKeys, lambda keys, reader: reader.claims(keys), measures)


@cache
def written_in(text: str, source: str, *measures: ModuleType) -> tuple[tuple[Claim, ...], tuple[Choice, ...]]:
    """The claims, and the choices if any, of a text like claims.yaml; source: its file, for faults. Empty lines before
    the text align the line numbers of faults with that file."""
    faults = Faults()
    document = parse(text, source, faults)
    claims = _made(document, faults, FileKeys, lambda keys, reader: reader.claims(keys), measures)
    return claims, _made(document, faults, FileKeys, lambda keys, reader: reader.choices(keys))


def choices_in(file: Path) -> tuple[Choice, ...]:
    """The open points of a paper, from a file readings.yaml; raises ConfigError, one line for each fault."""
    faults = Faults()
    return _made(read(file, faults), faults, ChoicesKeys, lambda keys, reader: reader.choices(keys))


def _made(
    document: Document | None,
    faults: Faults,
    model: type[Keyed],
    make: "Callable[[Keyed, _Reader], Iterator[Written]]",
    measures: Sequence[ModuleType] = (),
) -> tuple[Written, ...]:
    """The objects made of a checked document."""
    keys = None if document is None else check(model, document, faults)
    made = () if document is None or keys is None else tuple(make(keys, _Reader(document, faults, measures)))
    faults.raise_if_any()
    return made


def of_other_cases(part: Part, *cases: Any) -> Part:
    """A part from YAML with other cases."""
    assert isinstance(part.measure, Call)
    return replace(part, cases=cases, measure=replace(part.measure, cases=cases))


def with_arguments(part: Part, **arguments: Any) -> Part:
    """A part from YAML with other arguments."""
    assert isinstance(part.measure, Call)
    return replace(part, measure=replace(part.measure, arguments={**part.measure.arguments, **arguments}))


class _Unknown(Exception):
    """A name in the text is unknown; the fault is noted."""


class _Reader:
    """Makes claims of checked keys, and notes unknown names."""

    def __init__(self, document: Document, faults: Faults, measures: Sequence[ModuleType]):
        self.document, self.faults = document, faults
        self.functions: dict[str, Callable[..., Any]] = {}
        methods: dict[str, Callable[..., Any]] = {}
        for module in measures:
            own = {name: one for name, one in vars(module).items() if inspect.isfunction(one)}
            self.functions |= {name: one for name, one in own.items() if next(iter(_parameters(one)), "") == "seen"}
            of = inspect.getmembers(getattr(module, "Evidence", Evidence), inspect.isfunction)
            methods |= {name: one for name, one in of if not hasattr(Evidence, name)}
        known = methods | self.functions
        self.measures = {name: one for name, one in known.items() if not name.startswith("_")}
        self.ranges: dict[str, Callable[..., Any]] = {name: getattr(rule, name) for name in RANGES}

    def claims(self, keys: FileKeys) -> Iterator[Claim]:
        """The claims in their order."""
        names = self._named(keys.names)
        parts: dict[str, list[Part]] = {}
        for i, one in enumerate(keys.claims):
            if f"{keys.paper}.{one.id}" in parts:
                self._add(("claims", i, "id"), "stands there already", one.id)
            own = parts[f"{keys.paper}.{one.id}"] = [
                part for name in one.parts_of for part in self._parts_of(name, parts, ("claims", i, "parts_of"))
            ]
            for j, part in enumerate(one.parts):
                own += self._parts(part, names, ("claims", i, "parts", j))
            given = one.model_dump(exclude={"id", "config", "parts", "parts_of"})
            given["source"] = self._source(("claims", i, "config") if one.config else ("config",))
            yield Claim(f"{keys.paper}.{one.id}", parts=tuple(own), config=one.config or keys.config, **given)

    def choices(self, keys: ChoicesKeys | FileKeys) -> Iterator[Choice]:
        """The choices in their order."""
        names = self._named(keys.names)
        for i, one in enumerate(keys.choices):
            claims = self._filled(one.claims, names, ("choices", i, "claims"))
            every = [own for each in claims for own in (each if isinstance(each, tuple) else (each,))]
            yield Choice(
                *(one.key, one.asks, one.original, one.english or one.original),
                tuple(
                    Alternative(**each.model_dump(), source=self._source(("choices", i, "alternatives", j)))
                    for j, each in enumerate(one.alternatives)
                ),
                tuple(f"{keys.paper}.{own}" for own in every),
                one.contradicts,
            )

    def _named(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """The values under `names`; each may use those before it."""
        names: dict[str, Any] = {}
        for name, value in given.items():
            with suppress(_Unknown):
                names[name] = self._filled(value, names, ("names", name))
        return names

    def _parts_of(self, name: str, parts: Mapping[str, list[Part]], path: Keys) -> list[Part]:
        if name not in parts:
            self._add(path, f"must be of the claims before it{_listed(name, parts)}", name)
        return parts.get(name, [])

    def _parts(self, keys: PartKeys, names: Mapping[str, Any], path: Keys) -> Iterator[Part]:
        """A part for each combination of what varies."""
        try:
            for values in self._varied(keys.each, names, (*path, "each")):
                yield self._part(keys, {**names, **values}, path)
        except _Unknown:
            return

    def _varied(self, each: Mapping[str, Any], names: Mapping[str, Any], path: Keys) -> Iterator[dict[str, Any]]:
        axes = []
        for key, given in each.items():
            of, rows = [name.strip() for name in key.split(",")], self._filled(given, names, (*path, key))
            rows = rows if len(of) > 1 or not isinstance(rows, tuple) else tuple((row,) for row in rows)
            if not isinstance(rows, tuple) or not all(isinstance(row, tuple) and len(row) == len(of) for row in rows):
                self._add((*path, key), "must be a list" + (f" of lists of {len(of)}" if len(of) > 1 else ""), given)
                raise _Unknown
            axes.append([dict(zip(of, row, strict=True)) for row in rows])
        for combination in itertools.product(*axes):
            yield {name: value for row in combination for name, value in row.items()}

    def _part(self, keys: PartKeys, names: Mapping[str, Any], path: Keys) -> Part:
        given: dict[str, Any] = {
            key: self._filled(value, names, (*path, key)) for key, value in keys.model_dump(exclude={"each"}).items()
        }
        cases = given.pop("of")
        if not isinstance(cases, tuple):
            self._add((*path, "of"), "must be a list of cases", keys.of)
            raise _Unknown
        measure = self._call(given.pop("measure"), self.measures, cases, (*path, "measure"))
        expected = self._call(given.pop("expected"), self.ranges, (), (*path, "expected"))
        for key in ("scale", "ceiling"):
            if given[key] is not None:
                given[key] = self._call(given[key], self.measures, cases, (*path, key)).number
        exactly = self.functions.get(f"exact_{measure.name}")
        exact = replace(measure, name=f"exact_{measure.name}", function=exactly).number if exactly else None
        assert expected.function
        found = expected.function(**expected.arguments)
        if not (found.lo <= found.hi and found.margin > 0):
            self._add((*path, "expected"), "must be a range from low to high with a margin > 0", found.words)
            raise _Unknown
        return Part(cases, measure=measure, expected=found, exact=exact, **given)

    def _filled(self, value: Any, names: Mapping[str, Any], path: Keys) -> Any:
        """A value with `$name` replaced, and tuples in place of lists."""
        if isinstance(value, dict):
            return {key: self._filled(one, names, (*path, key)) for key, one in value.items()}
        if isinstance(value, list | tuple):
            return tuple(self._filled(one, names, (*path, i)) for i, one in enumerate(value))
        if not isinstance(value, str) or "$" not in value:
            return value
        try:
            text = Template(value)
            (name, *others) = text.get_identifiers()
            whole = not others and value in (f"${name}", f"${{{name}}}")
            return names[name] if whole else text.substitute(names)
        except ValueError:
            self._add(path, "must name a value after each $", value)
        except KeyError as error:
            self._add(path, f"${error.args[0]} is not given under names or each{_listed(error.args[0], names)}", value)
        raise _Unknown

    def _call(self, value: Any, known: Mapping[str, Callable[..., Any]], cases: tuple, path: Keys) -> Call:
        """The call of `name` or `{name: arguments}`: arguments by name, or, for a range, in their order."""
        name, given = next(iter(value.items())) if isinstance(value, dict) and len(value) == 1 else (value, {})
        if name not in known:
            self._add(path, f"must be one of them{_listed(str(name), known)}", value)
            raise _Unknown
        function, path = known[name], (*path, name) if value is not name else path
        parameters = _parameters(function)
        free = list(parameters)[0 if known is self.ranges else 1 :]
        if not isinstance(given, dict):
            if known is not self.ranges:
                self._add(path, "must have its arguments by name", given)
                raise _Unknown
            given = dict(zip(free, given if isinstance(given, tuple) else (given,), strict=False))
        try:
            leading = () if known is self.ranges else (None, *cases)
            inspect.signature(function).bind(*leading, **given)
        except TypeError as error:
            self._add(path, f"{name}({', '.join(free)}): {error}", value)
            raise _Unknown from None
        for key, one in given.items():
            wanted = _misfit(parameters[key].annotation, one) if key in parameters else ""
            if wanted:
                words = "; its ends must rise" if known is self.ranges and _falls(given) else ""
                self._add((*path, key), f"must be {wanted}{words}", one)
                raise _Unknown
        used = self.functions.get(name) if known is self.measures else function
        return Call(name, used, cases, given, self._source(path))

    def _source(self, path: Keys) -> str:
        return str(self.document.origin(path))

    def _add(self, path: Keys, message: str, got: object) -> None:
        self.faults.add(self.document.origin(path), path, message, got)


@cache
def _parameters(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(function).parameters


def _listed(name: str, known: Mapping[str, Any]) -> str:
    return f"{did_you_mean(name, list(known)) or ';'} allowed: {', '.join(known)}"


def _falls(ends: Mapping[str, Any]) -> bool:
    """Whether the ends of a range are plain numbers in falling order."""
    low, high = ends.get("low"), ends.get("high")
    return isinstance(low, int | float) and isinstance(high, int | float) and low > high


def _misfit(annotation: Any, value: Any) -> str:
    """The type that an argument must have, where it has not: plain types and literals only."""
    if get_origin(annotation) is Literal:
        allowed = get_args(annotation)
        return "" if value in allowed else f"one of {', '.join(map(str, allowed))}"
    if isinstance(annotation, UnionType):
        every = [_misfit(one, value) for one in get_args(annotation)]
        return "" if not all(every) else " or ".join(every)
    if annotation not in TYPES:
        return ""
    of = (int, float) if annotation is float else annotation
    fits = isinstance(value, of) and isinstance(value, bool) == (annotation is bool)
    return "" if fits else TYPES[annotation]


# ---- over ------------------------------------------------------------------------------------------------------------
DEPENDS_ON = term("depends on {choices}")
NOTHING = "there is nothing to measure it with"
FIRST = ("claim", "part", "reading", "kind")
LAST = (
    *("measured", "lo", "hi", "exact", "expected_lo", "expected_hi", "margin", "verdict"),
    *("unit", "what", "outcome", "miss", "n", "needed", "reason", "over"),
)


@dataclass(frozen=True)
class Under:
    """A claim under one reading: its parts with their numbers, in the order of the claim, and the verdict.

    why: the reason if it was not judged: impossible to fly or design, or nothing to measure."""

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
        """The input of the rule."""
        outcome = self.outcome.kind if self.outcome else ""
        return rule.Reading(self.name, self.kind, dict(self.reading.taken), outcome)


def under(of: PaperReadings, claim: Claim, reading: Reading, evidence: Evidence, n: int = 0) -> Under:
    """Judge a claim by the evidence of a reading with n realisations; 0 where nothing was run."""
    name, kind = of.name(reading), of.kind(reading)
    try:
        parts = tuple(
            (part, _judged(part, evidence, of.exact(claim, reading), n, name == DEFAULT))
            for part in of.parts(claim, reading)
        )
    except Missing as missing:
        return Under(claim, reading, name, kind, why=missing.why or NOTHING)
    except MeasureError as error:
        if name == DEFAULT or not isinstance(error.__cause__, NoSuchScans):  # a reading may have fewer scans
            raise
        return Under(claim, reading, name, kind, why=error.__cause__.why)
    outcome = rule.claim([judged for _, judged in parts], **claim.how)
    return Under(claim, reading, name, kind, parts, outcome)


def _judged(part: Part, seen: Evidence, exact: bool, n: int, shipped: bool) -> Judged:
    """A part with its numbers; the reading gives its variant and whether that is against the print.

    exact: whether all evidence is exact. Otherwise the exact value is known where the run knows it; a part's own
    formula is of the shipped reading."""
    found, nothing = part.measure(seen), Estimate(*(math.nan,) * 3)
    own = replace(part, variant="", against_print=False)
    value = found.value if exact else known(part if shipped else replace(part, exact=None), seen, found)
    return replace(weighed(own, seen, nothing if exact else found, n), exact=float(value))


@dataclass(frozen=True)
class Over:
    """A claim over all readings of its paper, the default one first."""

    of: PaperReadings
    claim: Claim
    under: tuple[Under, ...]

    @cached_property
    def outcome(self) -> Outcome | None:
        """The verdict of the rule; None where the default reading was not judged."""
        own = self.under[0].outcome
        if own is None:
            return None
        found = rule.over_readings(own, [one.as_rule() for one in self.under])
        printed_twice = any(part.against_print for part in self.claim.parts)
        torn = printed_twice and any(one.contradicts and one.key in found.depends_on for one in self.of.choices)
        torn = torn or (self.claim.joint and self._each_somewhere())
        if torn:
            return replace(found, kind=rule.CONTRADICTORY)
        return replace(found, needed=self._needed() if found.kind == rule.UNDECIDED else None)

    def _needed(self) -> int | None:
        """Realisations that would decide every undecided reading; None where a value lies on a border."""
        return rule.most_needed(one.outcome.needed for one in self.undecided if one.outcome)

    def _each_somewhere(self) -> bool:
        """Whether every number of a joint claim is reproduced under some reading, though no reading gives all."""
        counted = [one for one in self.under if one.counted]
        held = {part.number for one in counted for part, judged in one.parts if rule.verdict(judged) == rule.CONFIRMED}
        every = {part.number for one in counted for part, _ in one.parts}
        return held == every and not any(one.outcome.kind == rule.CONFIRMED for one in counted if one.outcome)

    @property
    def against_print(self) -> list[Under]:
        """The readings against the print with another verdict than the default one."""
        own = self.under[0].outcome
        judged = [one for one in self.under if one.kind == rule.AGAINST and one.outcome]
        return [one for one in judged if own and one.outcome and one.outcome.kind != own.kind]

    @property
    def undecided(self) -> list[Under]:
        """The readings that the paper allows and that are undecided."""
        return [one for one in self.under if one.counted and one.outcome and one.outcome.kind == rule.UNDECIDED]

    @property
    def looked(self) -> int:
        """The fewest realisations of an undecided reading; 0 where all are decided."""
        return min((judged.n for one in self.undecided for _, judged in one.parts), default=0)

    @property
    def impossible(self) -> list[Under]:
        """The readings that were not judged, with their reasons."""
        return [one for one in self.under if one.outcome is None]

    def sentence(self) -> str:
        """One line: in how many readings it holds, on what it depends, what would have to be changed."""
        found = self.outcome
        if found is None:
            return tr("not judged: {why}", why=rule.said(self.under[0].why))
        words = [tr("holds in {holds} of {of} readings", holds=found.holds_in or 0, of=found.readings or 0)]
        if self.still_open():
            words.append(self.still_open())
        if found.depends_on:
            words.append(tr(DEPENDS_ON, choices=self.of.asked(found.depends_on)))
        held = [one for one in self.against_print if one.outcome and one.outcome.kind == rule.CONFIRMED]
        if held and found.holds_in == 0:
            names = " | ".join(self.of.said(one.reading) for one in held)
            words.append(tr("it holds, against the print, with {readings}", readings=names))
        if self.impossible:
            words.append(tr("{count} not possible", count=len(self.impossible)))
        return "; ".join(words)

    def still_open(self) -> str:
        """For an undecided claim, how many readings are undecided, and the realisations they need; else nothing."""
        if self.outcome is None or self.outcome.kind != rule.UNDECIDED:
            return ""
        told, needed = {"count": len(self.undecided), "n": f"{self.looked:,}"}, self.outcome.needed
        if needed is None:
            return tr(
                "{count} open at {n} realisations: a value lies on a border, and more realisations would not decide",
                **told,
            )
        return tr(
            "{count} open at {n} realisations, about {needed} would decide", **told, needed=f"{rule.roughly(needed):,}"
        )


def columns(every: Iterable[PaperReadings]) -> tuple[str, ...]:
    """The columns of readings.csv: one for each choice of these papers."""
    choices = dict.fromkeys(choice.key for of in every for choice in of.choices)
    return (*FIRST, *choices, *LAST)


def rows(one: Under, names: Sequence[str], over: Outcome | None = None) -> list[dict[str, Any]]:
    """Rows of readings.csv: one for each part; a single one with the reason where it was not judged.

    over: the result over all readings, whose class is in each row."""
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
    """A number for the table: twelve digits, empty for NaN; never: `inf` for a settling time that is never reached."""
    if never and math.isinf(value):
        return value
    return float(f"{value:.12g}") if math.isfinite(value) else ""


def depth(one: Under) -> tuple[float, float, float]:
    """How far the worst part is from the words, in margins, with the ends of its interval.

    Negative inside: the distance to the nearest end."""
    found = [_depth(judged) for _, judged in one.parts if judged.asserted and not judged.void]
    return max(found, default=(math.nan,) * 3, key=lambda ends: ends[0])


def _depth(judged: Judged) -> tuple[float, float, float]:
    def of(value: float) -> float:
        return max(judged.expected_lo - value, value - judged.expected_hi) / judged.margin

    ends = rule.ends(judged)
    every = [of(value) for value in (*ends, judged.value)]
    return of(judged.value), min(every), max(every)


# ---- joint -----------------------------------------------------------------------------------------------------------
Key = tuple[str, str]  # the claim, and the number within it

TO_THE_PRINT = term("as shipped {count} of {of} numbers match the print")
WITHIN = term("as shipped {count} of {of} numbers are within the margins of the words")


@dataclass(frozen=True)
class JointOutcome:
    """A printed number under a reading: its value, and by which rule it is reproduced.

    open: its interval is too wide to tell whether it lies within the margin."""

    value: float
    strict: bool
    granular: bool
    open: bool


@dataclass(frozen=True)
class Asserted:
    """A number that a paper prints: claim, description, words and unit."""

    claim: str
    what: str
    words: str
    unit: str


@dataclass(frozen=True)
class Together:
    """A reading with the claims that hold and were judged under it, and the outcome of every number."""

    reading: Reading
    name: str
    kind: str
    held: tuple[str, ...]
    judged: tuple[str, ...]
    outcomes: Mapping[Key, JointOutcome]

    def count(self, granular: bool) -> int:
        """How many numbers are reproduced."""
        return sum(one.granular if granular else one.strict for one in self.outcomes.values())

    @property
    def open(self) -> int:
        """How many numbers are not known to lie within their margin."""
        return sum(one.open for one in self.outcomes.values())


@dataclass(frozen=True)
class Joint:
    """A paper's printed numbers under all declared readings: the readings, and the numbers by key."""

    of: PaperReadings
    every: tuple[Together, ...]
    numbers: Mapping[Key, Asserted]

    @property
    def shipped(self) -> Together:
        """The reading of the shipped configs."""
        return self._of(self.of.reading())

    def best(self, granular: bool) -> Together:
        """The reading with most numbers; of several, most under the other rule, then nearest the shipped."""
        allowed = [one for one in self.every if one.kind != rule.AGAINST]
        return max(
            allowed, key=lambda one: (one.count(granular), one.count(not granular), -changed(self.of, one.reading))
        )

    def _of(self, reading: Reading) -> Together:
        return next(one for one in self.every if one.reading == reading)

    def sentence(self) -> str:
        """The result of the search."""
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
        """The alternatives of a choice, all others as shipped, under which each number is reproduced as printed."""
        choice = next(one for one in self.of.choices if one.key == key)
        names = [one.name for one in choice.alternatives]
        alone = {name: self.of.reading(**{key: name}) for name in names}
        known = {one.reading: one for one in self.every}
        found = {}
        for number in self.numbers:
            tried = {name: known[of].outcomes.get(number) for name, of in alone.items() if of in known}
            found[number] = _listed_readings(
                {name: outcomes.strict for name, outcomes in tried.items() if outcomes is not None}
            )
        return found


def _listed_readings(held: Mapping[str, bool]) -> str:
    yes = [name for name, holds in held.items() if holds]
    no = [name for name, holds in held.items() if not holds]
    if not no:
        return "all"
    if not yes:
        return "none"
    return f"all but {', '.join(no)}" if len(no) < len(yes) else ", ".join(yes)


def joint(of: PaperReadings, over: Sequence[Over]) -> Joint:
    """The joint search of a paper over its claims' readings, those with most numbers first.

    The readings are the declared ones of a claim, and all combinations of E and U under which every claim was judged:
    with the verdict of the reading restricted to the choices that affect it."""
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
        found.append(Together(reading, of.said(reading), of.kind(reading), held, judged, outcomes))
    found.sort(key=lambda one: (-one.count(False), -one.count(True), -len(one.held), changed(of, one.reading)))
    numbers: dict[Key, Asserted] = {}
    for key, asserted in (item for own in claims for one in own.values() for item in one.numbers.items()):
        numbers.setdefault(key, asserted)  # a number is named as in the first reading, the shipped one
    return Joint(of, tuple(found), numbers)


def changed(of: PaperReadings, reading: Reading) -> int:
    """In how many choices a reading differs from the shipped configs."""
    return sum(reading[choice.key] != choice.default for choice in of.choices)


class _Own:
    """A claim under one reading: whether it holds, its numbers, and their outcome."""

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
    """The parts that the paper asserts, by their number; a void one tests nothing."""
    found: dict[Key, list[tuple[Part, Judged]]] = {}
    for place, (part, judged) in enumerate(one.parts):
        if part.asserted and not judged.void:
            number = f"{part.statement}: {part.number}" if part.number else f"#{place}"
            found.setdefault((one.claim.id, number), []).append((part, judged))
    return found


def _outcome(one: Under, parts: Sequence[tuple[Part, Judged]]) -> JointOutcome:
    many = sum(judged.sampled for _, judged in one.parts)
    return max(
        (_one(part, judged, many) for part, judged in parts), key=lambda outcomes: (outcomes.strict, outcomes.granular)
    )


def _one(part: Part, judged: Judged, many: int) -> JointOutcome:
    lo, hi = rule.ends(judged, many)
    low, high = judged.expected_lo - judged.margin, judged.expected_hi + judged.margin
    slack = rule.ROUNDING * judged.margin
    strict = part.expected.strict[0] - slack <= lo and hi <= part.expected.strict[1] + slack
    granular = low - slack <= lo and hi <= high + slack
    return JointOutcome(judged.value, strict, granular, not granular and not (hi < low or lo > high))
