"""What a paper leaves open, as data: choices with their alternatives, and interpretations, which take one of each.

An alternative is equivalent to the print in every respect (E), one of what the paper does not say (U), or against its
print (N). The first alternative of a choice is what the shipped configs take. A verdict is robust if it is the same
in all E and U interpretations; N shows what would have to be changed.

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

Verdicts on a claim under every interpretation of its paper: the table interpretations.csv, and what the claim depends
on."""

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


# ---- interpretations
# --------------------------------------------------------------------------------------------------------
KINDS = (EQUIVALENT, UNSTATED, AGAINST)  # an interpretation is of the last kind among its alternatives
DEFAULT = "as shipped"


class Unreadable(Exception):
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
        return next(one for one in self.alternatives if one.name == name)

    def bears_on(self, claim: str) -> bool:
        """Whether this choice may change the verdict on a claim."""
        return not self.claims or claim in self.claims


@dataclass(frozen=True)
class Interpretation:
    """One alternative of each choice of a paper, by the choice's key, in the order of the choices."""

    taken: tuple[tuple[str, str], ...]

    def __getitem__(self, key: str) -> str:
        return dict(self.taken)[key]


class PaperInterpretations(ABC):
    """The interpretations of a paper, and how its claims are measured under one. A study with exact numbers gives
    evidence without a run; any other changes the cases of a claim's config, which are then run, and reads their sums
    like those of the paper's own."""

    paper: str  # P1
    choices: tuple[Choice, ...]
    realisations: int = 1000  # of each run, by default
    most: int = 16_000  # of a run that is to decide a claim, by default

    def open(self, claim: Claim) -> bool:
        """Whether the paper leaves anything open that affects a claim of its own."""
        return not claim.extension and any(choice.bears_on(claim.id) for choice in self.choices)

    # ---- the interpretations
    # --------------------------------------------------------------------------------------------
    def declared(self) -> Sequence[Interpretation]:
        """The interpretations to judge, the default first: all combinations of E and U, and each N alone."""
        return list(dict.fromkeys([*self.combined(self.choices), *self.against_print()]))

    def combined(self, choices: Iterable[Choice]) -> Iterator[Interpretation]:
        """All combinations of the E and U alternatives of these choices, all others at their default."""
        varied = list(choices)
        allowed = [[one.name for one in choice.alternatives if one.kind != AGAINST] for choice in varied]
        for names in itertools.product(*allowed):
            yield self.interpretation(**dict(zip((choice.key for choice in varied), names, strict=True)))

    def against_print(self) -> Iterator[Interpretation]:
        """Each alternative against the print, all else at its default."""
        for choice in self.choices:
            for one in choice.alternatives:
                if one.kind == AGAINST:
                    yield self.interpretation(**{choice.key: one.name})

    def interpretation(self, **taken: str) -> Interpretation:
        """The interpretation of these alternatives, the others at their default."""
        return Interpretation(tuple((choice.key, taken.get(choice.key, choice.default)) for choice in self.choices))

    def of_claim(self, claim: str) -> list[Interpretation]:
        """The declared interpretations that differ for a claim: choices that do not affect it stay at their default."""
        bears = [choice.bears_on(claim) for choice in self.choices]
        firsts: dict[tuple[tuple[str, str], ...], Interpretation] = {}
        for one in self._declared:
            firsts.setdefault(tuple(itertools.compress(one.taken, bears)), one)
        return [self.bearing(one, claim) for one in firsts.values()]

    @cached_property
    def _declared(self) -> Sequence[Interpretation]:
        return self.declared()

    def bearing(self, interpretation: Interpretation, claim: str) -> Interpretation:
        """An interpretation with the choices that do not affect a claim at their default."""
        pairs = zip(interpretation.taken, self.choices, strict=True)
        return Interpretation(tuple((key, name if one.bears_on(claim) else one.default) for (key, name), one in pairs))

    def kind(self, interpretation: Interpretation) -> str:
        """E, U or N: the last of the kinds of its alternatives that are not the default; E for the default itself."""
        kinds = [choice[interpretation[choice.key]].kind for choice in self._other(interpretation)]
        return max(kinds, key=KINDS.index, default=EQUIVALENT)

    def name(self, interpretation: Interpretation) -> str:
        """How an interpretation differs from the shipped configs."""
        words = [f"{choice.key}: {interpretation[choice.key]}" for choice in self._other(interpretation)]
        return "; ".join(words) or DEFAULT

    def said(self, interpretation: Interpretation) -> str:
        """How an interpretation differs from the shipped configs, for people."""
        return in_words({choice.key: interpretation[choice.key] for choice in self._other(interpretation)}, self.asks)

    @cached_property
    def asks(self) -> Mapping[str, str]:
        """The choices by key, in words."""
        return {choice.key: choice.asks for choice in self.choices}

    def asked(self, keys: Iterable[str]) -> str:
        """Choices within a sentence."""
        return listed([tr(self.asks[key]) for key in keys])

    def sets(self, interpretation: Interpretation) -> dict[str, Any]:
        """The settings of an interpretation's alternatives."""
        return {key: value for one in self.choices for key, value in one[interpretation[one.key]].sets.items()}

    def _other(self, interpretation: Interpretation) -> list[Choice]:
        return [choice for choice in self.choices if interpretation[choice.key] != choice.default]

    # ---- a claim under an interpretation
    # -----------------------------------------------------------------------------------
    def parts(self, claim: Claim, interpretation: Interpretation) -> Sequence[Part]:
        """The parts of a claim to judge under an interpretation. Default: all."""
        return claim.parts

    def changed(self, claim: Claim, case: "Case", interpretation: Interpretation) -> "Case | None":
        """A case of a claim's config changed for an interpretation; None where the claim does not need it. Raises
        Unreadable where it is impossible to fly or design."""
        return None

    def evidence(
        self, claim: Claim, interpretation: Interpretation, seen: "Seen | None", of: PaperClaims
    ) -> "Evidence":
        """The evidence for a claim under an interpretation; seen: the results of its cases, None where all is exact.

        of: the paper's claims. Default: their evidence, over `seen`."""
        assert seen is not None  # a paper with exact values gives its own evidence
        return of.evidence(seen.results, seen.tables, seen.places)

    def exact(self, claim: Claim, interpretation: Interpretation) -> bool:
        """Whether the evidence for a claim is exact under an interpretation, so that nothing is run. Default: no."""
        return False


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
    interpretation: str = ""
    reading: str = ""  # the key's name in earlier versions
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
    """The open points of a paper, the file interpretations.yaml."""

    paper: Name
    names: dict[str, Anything] = {}  # noqa: RUF012
    choices: tuple[ChoiceKeys, ...]


class FileKeys(Model):
    """The claims of a paper in one file; config: of those that name none. choices: as in interpretations.yaml."""

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


def claims_of(file: Callable[[str], ModuleType]) -> Sequence[Claim]:
    """The claims of a study: of claims.yaml beside its measures, or `CLAIMS` of its module claims; or of this file."""
    measures = file("measures")
    written = Path(str(measures.__file__)).with_name("claims.yaml")
    if written.is_file():
        return claims_in(written, measures)
    claims: Sequence[Claim] = file("claims").CLAIMS
    return claims


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
    """The open points of a paper, from a file interpretations.yaml; raises ConfigError, one line for each fault."""
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
            given = one.model_dump(exclude={"id", "config", "parts", "parts_of", "reading"})
            given["interpretation"] = one.interpretation or one.reading
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
FIRST = ("claim", "part", "interpretation", "kind")
LAST = (
    *("measured", "lo", "hi", "exact", "expected_lo", "expected_hi", "margin", "verdict"),
    *("unit", "what", "outcome", "miss", "n", "needed", "reason", "over"),
)


@dataclass(frozen=True)
class Under:
    """A claim under one interpretation: its parts with their numbers, in the order of the claim, and the verdict.

    why: the reason if it was not judged: impossible to fly or design, or nothing to measure."""

    claim: Claim
    interpretation: Interpretation
    name: str
    kind: str
    parts: tuple[tuple[Part, Judged], ...] = ()
    outcome: Outcome | None = None
    why: str = ""

    @property
    def counted(self) -> bool:
        """Whether the paper allows the interpretation."""
        return self.kind != rule.AGAINST and self.outcome is not None

    def as_rule(self) -> rule.Interpretation:
        """The input of the rule."""
        outcome = self.outcome.kind if self.outcome else ""
        return rule.Interpretation(self.name, self.kind, dict(self.interpretation.taken), outcome)


def under(
    of: PaperInterpretations, claim: Claim, interpretation: Interpretation, evidence: Evidence, n: int = 0
) -> Under:
    """Judge a claim by the evidence of an interpretation with n realisations; 0 where nothing was run."""
    name, kind = of.name(interpretation), of.kind(interpretation)
    try:
        parts = tuple(
            (part, _judged(part, evidence, of.exact(claim, interpretation), n, name == DEFAULT))
            for part in of.parts(claim, interpretation)
        )
    except Missing as missing:
        return Under(claim, interpretation, name, kind, why=missing.why or NOTHING)
    except MeasureError as error:
        if name == DEFAULT or not isinstance(error.__cause__, NoSuchScans):  # an interpretation may have fewer scans
            raise
        return Under(claim, interpretation, name, kind, why=error.__cause__.why)
    outcome = rule.claim([judged for _, judged in parts], **claim.how)
    return Under(claim, interpretation, name, kind, parts, outcome)


def _judged(part: Part, seen: Evidence, exact: bool, n: int, shipped: bool) -> Judged:
    """A part with its numbers; the interpretation gives its variant and whether that is against the print.

    exact: whether all evidence is exact. Otherwise the exact value is known where the run knows it; a part's own
    formula is of the shipped interpretation."""
    found, nothing = part.measure(seen), Estimate(*(math.nan,) * 3)
    own = replace(part, variant="", against_print=False)
    value = found.value if exact else known(part if shipped else replace(part, exact=None), seen, found)
    return replace(weighed(own, seen, nothing if exact else found, n), exact=float(value))


@dataclass(frozen=True)
class Over:
    """A claim over all interpretations of its paper, the default one first."""

    of: PaperInterpretations
    claim: Claim
    under: tuple[Under, ...]

    @cached_property
    def outcome(self) -> Outcome | None:
        """The verdict of the rule; None where the default interpretation was not judged."""
        own = self.under[0].outcome
        if own is None:
            return None
        found = rule.over_interpretations(own, [one.as_rule() for one in self.under])
        printed_twice = any(part.against_print for part in self.claim.parts)
        torn = printed_twice and any(one.contradicts and one.key in found.depends_on for one in self.of.choices)
        torn = torn or (self.claim.joint and self._each_somewhere())
        if torn:
            return replace(found, kind=rule.CONTRADICTORY)
        return replace(found, needed=self._needed() if found.kind == rule.UNDECIDED else None)

    def _needed(self) -> int | None:
        """Realisations that would decide every undecided interpretation; None where a value lies on a border."""
        return rule.most_needed(one.outcome.needed for one in self.undecided if one.outcome)

    def _each_somewhere(self) -> bool:
        """Whether every number of a joint claim is reproduced under some interpretation, though no interpretation gives
        all."""
        counted = [one for one in self.under if one.counted]
        held = {part.number for one in counted for part, judged in one.parts if rule.verdict(judged) == rule.CONFIRMED}
        every = {part.number for one in counted for part, _ in one.parts}
        return held == every and not any(one.outcome.kind == rule.CONFIRMED for one in counted if one.outcome)

    @property
    def against_print(self) -> list[Under]:
        """The interpretations against the print with another verdict than the default one."""
        own = self.under[0].outcome
        judged = [one for one in self.under if one.kind == rule.AGAINST and one.outcome]
        return [one for one in judged if own and one.outcome and one.outcome.kind != own.kind]

    @property
    def undecided(self) -> list[Under]:
        """The interpretations that the paper allows and that are undecided."""
        return [one for one in self.under if one.counted and one.outcome and one.outcome.kind == rule.UNDECIDED]

    @property
    def looked(self) -> int:
        """The fewest realisations of an undecided interpretation; 0 where all are decided."""
        return min((judged.n for one in self.undecided for _, judged in one.parts), default=0)

    @property
    def impossible(self) -> list[Under]:
        """The interpretations that were not judged, with their reasons."""
        return [one for one in self.under if one.outcome is None]

    def sentence(self) -> str:
        """One line: in how many interpretations it holds, on what it depends, what would have to be changed."""
        found = self.outcome
        if found is None:
            return tr("not judged: {why}", why=rule.said(self.under[0].why))
        words = [
            tr("holds in {holds} of {of} interpretations", holds=found.holds_in or 0, of=found.interpretations or 0)
        ]
        if self.still_open():
            words.append(self.still_open())
        if found.depends_on:
            words.append(tr(DEPENDS_ON, choices=self.of.asked(found.depends_on)))
        held = [one for one in self.against_print if one.outcome and one.outcome.kind == rule.CONFIRMED]
        if held and found.holds_in == 0:
            names = " | ".join(self.of.said(one.interpretation) for one in held)
            words.append(tr("it holds, against the print, with {interpretations}", interpretations=names))
        if self.impossible:
            words.append(tr("{count} not possible", count=len(self.impossible)))
        return "; ".join(words)

    def still_open(self) -> str:
        """For an undecided claim, how many interpretations are undecided, and the realisations they need; else
        nothing."""
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


def columns(every: Iterable[PaperInterpretations]) -> tuple[str, ...]:
    """The columns of interpretations.csv: one for each choice of these papers."""
    choices = dict.fromkeys(choice.key for of in every for choice in of.choices)
    return (*FIRST, *choices, *LAST)


def rows(one: Under, names: Sequence[str], over: Outcome | None = None) -> list[dict[str, Any]]:
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
