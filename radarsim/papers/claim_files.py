"""Claims and choices as they are written in YAML: statement, place, and what is measured by which function.

    - id: 4
      place: section 2
      statement: The gain lies between 10 and 50 %
      original: Der Gewinn liegt zwischen 10 und 50 %
      parts:
      - {of: [1], each: {pick: [least, largest]}, what: $pick gain, unit: "%",
         measure: {gain: {component: r, pick: $pick}}, expected: {between: ["10", "50"]}}

`measure` names a function of the study's measures, or a method of its evidence; it is called with the evidence, the
cases under `of`, and the arguments that are given by name. `expected` names a function of `papers.expected_ranges`.
`$name` is a value of `names:`, or of `each:`, which makes a part of every combination of its values; `"a, b":` takes
several at once. An unknown argument is a fault with file and line, as in a config."""

import inspect
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from string import Template
from types import ModuleType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin

from radarsim import failures
from radarsim.config.check import check
from radarsim.config.document import Document, Faults, KeyPath, did_you_mean, shown
from radarsim.config.fields import Anything, Flag, Model, Name, Stem
from radarsim.config.load import parse, read
from radarsim.errors import OF_AUTHORS, ConfigError, MeasureError, RadarsimError
from radarsim.papers import expected_ranges
from radarsim.papers.claim import Claim, Part
from radarsim.papers.evidence import Evidence, MissingEvidence, UnknownName, exact_number
from radarsim.papers.interpretations import Alternative, Choice, ImpossibleInterpretation
from radarsim.report.statistics import Estimate

RANGE_NAMES = (
    *("printed", "between", "about", "above", "below", "at_most", "at_least", "greater", "less", "within", "same"),
    *("kept", "on_grid"),
)
KeysModel = TypeVar("KeysModel", bound=Model)
Declaration = TypeVar("Declaration", Claim, Choice)
TYPE_WORDS = {str: "text", float: "a number", int: "a whole number", bool: "true or false"}


class PartKeys(Model):
    """A part of a claim; see `claim.Part`."""

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
    """A claim; see `claim.Claim`. parts_of: the claims whose parts it has too."""

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
class MeasureCall:
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
            if other or (isinstance(error, MissingEvidence | ImpossibleInterpretation) and not self._misspelt(error)):
                raise
            raise MeasureError(f"{self.source}: {self.name}: {failures.summary(error)}") from error
        if isinstance(found, Estimate):
            return found
        with suppress(TypeError, ValueError):
            if not isinstance(found, str | bytes):
                return exact_number(found)
        raise MeasureError(f"{self.source}: {self.name}: must give an Estimate or a number, got {shown(found)}")

    def _misspelt(self, error: Exception) -> bool:
        """Whether a function of a package asks for a name that the paper's own case does not have."""
        of_a_package = self.function is not None and not self.function.__module__.startswith("radarsim.")
        return of_a_package and isinstance(error, UnknownName)

    def number(self, seen: Any) -> float:
        """Its value alone."""
        return float(self(seen).value)


def claims_of(file: Callable[[str], ModuleType]) -> Sequence[Claim]:
    """The claims of a study: of claims.yaml beside its measures, or `CLAIMS` of its module claims; or of this file."""
    measures = file("measures")
    written = Path(str(measures.__file__)).with_name("claims.yaml")
    if written.is_file():
        return load_claims(written, measures)
    claims: Sequence[Claim] = file("claims").CLAIMS
    return claims


@cache
def load_claims(file: Path, *measures: ModuleType) -> tuple[Claim, ...]:
    """The claims of a file, measured by functions of these modules; raises ConfigError, one line for each fault."""
    faults = Faults()
    return _declarations(read(file, faults), faults, FileKeys, lambda keys, reader: reader.claims(keys), measures)


@cache
def parse_claims(text: str, source: str, *measures: ModuleType) -> tuple[tuple[Claim, ...], tuple[Choice, ...]]:
    """The claims, and the choices if any, of a text like claims.yaml; source: its file, for faults. Empty lines before
    the text align the line numbers of faults with that file."""
    faults = Faults()
    document = parse(text, source, faults)
    claims = _declarations(document, faults, FileKeys, lambda keys, reader: reader.claims(keys), measures)
    return claims, _declarations(document, faults, FileKeys, lambda keys, reader: reader.choices(keys))


def load_choices(file: Path) -> tuple[Choice, ...]:
    """The open points of a paper, from a file interpretations.yaml; raises ConfigError, one line for each fault."""
    faults = Faults()
    return _declarations(read(file, faults), faults, ChoicesKeys, lambda keys, reader: reader.choices(keys))


def _declarations(
    document: Document | None,
    faults: Faults,
    model: type[KeysModel],
    make: "Callable[[KeysModel, _Reader], Iterator[Declaration]]",
    measures: Sequence[ModuleType] = (),
) -> tuple[Declaration, ...]:
    """The objects made of a checked document."""
    keys = None if document is None else check(model, document, faults)
    made = () if document is None or keys is None else tuple(make(keys, _Reader(document, faults, measures)))
    faults.raise_if_any()
    return made


def with_cases(part: Part, *cases: Any) -> Part:
    """A part from YAML with other cases."""
    assert isinstance(part.measure, MeasureCall)
    return replace(part, cases=cases, measure=replace(part.measure, cases=cases))


def with_arguments(part: Part, **arguments: Any) -> Part:
    """A part from YAML with other arguments."""
    assert isinstance(part.measure, MeasureCall)
    return replace(part, measure=replace(part.measure, arguments={**part.measure.arguments, **arguments}))


class _UnknownNameError(Exception):
    """A name in the text is unknown; the fault is noted."""


class _Reader:
    """Makes claims of checked keys, and notes unknown names."""

    def __init__(self, document: Document, faults: Faults, measures: Sequence[ModuleType]):
        self.document, self.faults = document, faults
        self.functions: dict[str, Callable[..., Any]] = {}
        methods: dict[str, Callable[..., Any]] = {}
        for module in measures:
            own = {name: one for name, one in vars(module).items() if inspect.isfunction(one)}
            self.functions |= {name: one for name, one in own.items() if next(iter(_parameters_of(one)), "") == "seen"}
            of = inspect.getmembers(getattr(module, "Evidence", Evidence), inspect.isfunction)
            methods |= {name: one for name, one in of if not hasattr(Evidence, name)}
        known = methods | self.functions
        self.measures = {name: one for name, one in known.items() if not name.startswith("_")}
        self.ranges: dict[str, Callable[..., Any]] = {name: getattr(expected_ranges, name) for name in RANGE_NAMES}

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
            with suppress(_UnknownNameError):
                names[name] = self._filled(value, names, ("names", name))
        return names

    def _parts_of(self, name: str, parts: Mapping[str, list[Part]], path: KeyPath) -> list[Part]:
        if name not in parts:
            self._add(path, f"must be of the claims before it{_allowed_names(name, parts)}", name)
        return parts.get(name, [])

    def _parts(self, keys: PartKeys, names: Mapping[str, Any], path: KeyPath) -> Iterator[Part]:
        """A part for each combination of what varies."""
        try:
            for values in self._varied(keys.each, names, (*path, "each")):
                yield self._part(keys, {**names, **values}, path)
        except _UnknownNameError:
            return

    def _varied(self, each: Mapping[str, Any], names: Mapping[str, Any], path: KeyPath) -> Iterator[dict[str, Any]]:
        axes = []
        for key, given in each.items():
            of, rows = [name.strip() for name in key.split(",")], self._filled(given, names, (*path, key))
            rows = rows if len(of) > 1 or not isinstance(rows, tuple) else tuple((row,) for row in rows)
            if not isinstance(rows, tuple) or not all(isinstance(row, tuple) and len(row) == len(of) for row in rows):
                self._add((*path, key), "must be a list" + (f" of lists of {len(of)}" if len(of) > 1 else ""), given)
                raise _UnknownNameError
            axes.append([dict(zip(of, row, strict=True)) for row in rows])
        for combination in itertools.product(*axes):
            yield {name: value for row in combination for name, value in row.items()}

    def _part(self, keys: PartKeys, names: Mapping[str, Any], path: KeyPath) -> Part:
        given: dict[str, Any] = {
            key: self._filled(value, names, (*path, key)) for key, value in keys.model_dump(exclude={"each"}).items()
        }
        cases = given.pop("of")
        if not isinstance(cases, tuple):
            self._add((*path, "of"), "must be a list of cases", keys.of)
            raise _UnknownNameError
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
            raise _UnknownNameError
        return Part(cases, measure=measure, expected=found, exact=exact, **given)

    def _filled(self, value: Any, names: Mapping[str, Any], path: KeyPath) -> Any:
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
            self._add(
                path, f"${error.args[0]} is not given under names or each{_allowed_names(error.args[0], names)}", value
            )
        raise _UnknownNameError

    def _call(self, value: Any, known: Mapping[str, Callable[..., Any]], cases: tuple, path: KeyPath) -> MeasureCall:
        """The call of `name` or `{name: arguments}`: arguments by name, or, for a range, in their order."""
        name, given = next(iter(value.items())) if isinstance(value, dict) and len(value) == 1 else (value, {})
        if name not in known:
            self._add(path, f"must be one of them{_allowed_names(str(name), known)}", value)
            raise _UnknownNameError
        function, path = known[name], (*path, name) if value is not name else path
        parameters = _parameters_of(function)
        free = list(parameters)[0 if known is self.ranges else 1 :]
        if not isinstance(given, dict):
            if known is not self.ranges:
                self._add(path, "must have its arguments by name", given)
                raise _UnknownNameError
            given = dict(zip(free, given if isinstance(given, tuple) else (given,), strict=False))
        try:
            leading = () if known is self.ranges else (None, *cases)
            inspect.signature(function).bind(*leading, **given)
        except TypeError as error:
            self._add(path, f"{name}({', '.join(free)}): {error}", value)
            raise _UnknownNameError from None
        for key, one in given.items():
            wanted = _wrong_type(parameters[key].annotation, one) if key in parameters else ""
            if wanted:
                words = "; its ends must rise" if known is self.ranges and _has_falling_ends(given) else ""
                self._add((*path, key), f"must be {wanted}{words}", one)
                raise _UnknownNameError
        used = self.functions.get(name) if known is self.measures else function
        return MeasureCall(name, used, cases, given, self._source(path))

    def _source(self, path: KeyPath) -> str:
        return str(self.document.origin(path))

    def _add(self, path: KeyPath, message: str, got: object) -> None:
        self.faults.add(self.document.origin(path), path, message, got)


@cache
def _parameters_of(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(function).parameters


def _allowed_names(name: str, known: Mapping[str, Any]) -> str:
    return f"{did_you_mean(name, list(known)) or ';'} allowed: {', '.join(known)}"


def _has_falling_ends(ends: Mapping[str, Any]) -> bool:
    """Whether the ends of a range are plain numbers in falling order."""
    low, high = ends.get("low"), ends.get("high")
    return isinstance(low, int | float) and isinstance(high, int | float) and low > high


def _wrong_type(annotation: Any, value: Any) -> str:
    """The type that an argument must have, where it has not: plain types and literals only."""
    if get_origin(annotation) is Literal:
        allowed = get_args(annotation)
        return "" if value in allowed else f"one of {', '.join(map(str, allowed))}"
    if isinstance(annotation, UnionType):
        every = [_wrong_type(one, value) for one in get_args(annotation)]
        return "" if not all(every) else " or ".join(every)
    if annotation not in TYPE_WORDS:
        return ""
    of = (int, float) if annotation is float else annotation
    fits = isinstance(value, of) and isinstance(value, bool) == (annotation is bool)
    return "" if fits else TYPE_WORDS[annotation]
