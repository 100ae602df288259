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
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from string import Template
from types import ModuleType, NoneType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin

from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList
from radarsim.config.error_text import KeyPath, quoted_value
from radarsim.config.find_files import did_you_mean
from radarsim.config.key_types import Anything, Flag, Name, Stem
from radarsim.config.model import Model
from radarsim.config.validate import validate
from radarsim.config.yaml_io import parse_yaml, read_document
from radarsim.errors import AUTHOR_ERRORS, ConfigError, MeasureError, RadarsimError
from radarsim.papers import expected_ranges
from radarsim.papers.claim import Claim, Part
from radarsim.papers.evidence import Evidence, MissingEvidence, UnknownName, exact_number, has_interval
from radarsim.papers.interpretations import (
    LEADING_COLUMNS,
    TRAILING_COLUMNS,
    Alternative,
    Choice,
    ImpossibleInterpretation,
)
from radarsim.report.statistics import Estimate
from radarsim.user_code import errors as user_code_errors

KeysModel = TypeVar("KeysModel", bound=Model)
Declaration = TypeVar("Declaration", Claim, Choice)
# The last is the name of a column of interpretations.csv in earlier versions.
RESERVED_CHOICE_KEYS = (*LEADING_COLUMNS, *TRAILING_COLUMNS, "reading")
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


class OwnFileKeys(FileKeys):
    """Claims of a user on a config that is named elsewhere, or on a table."""

    config: Stem | None = None  # type: ignore[assignment]


@dataclass(frozen=True)
class MeasureCall:
    """A function by name, or a method of the evidence where function is None, with its cases and arguments."""

    name: str
    function: Callable[..., Any] | None
    cases: tuple
    arguments: Mapping[str, Any]
    source: str = field(default="", compare=False)  # where it is written, for messages

    def __call__(self, evidence: Any) -> Estimate:
        """The measured value; a plain number is without noise. Raises MeasureError where the function fails."""
        try:
            if self.function is None:
                value = getattr(evidence, self.name)(*self.cases, **self.arguments)
            else:
                value = self.function(evidence, *self.cases, **self.arguments)
        except AUTHOR_ERRORS as error:
            is_our_error = isinstance(error, RadarsimError) and not isinstance(error, ConfigError)
            if is_our_error or (
                isinstance(error, MissingEvidence | ImpossibleInterpretation) and not self._misspelt(error)
            ):
                raise
            raise MeasureError(f"{self.source}: {self.name}: {user_code_errors.error_summary(error)}") from error
        if isinstance(value, Estimate):
            return value
        with suppress(TypeError, ValueError):
            if not isinstance(value, str | bytes):
                return exact_number(value)
        raise MeasureError(f"{self.source}: {self.name}: must give an Estimate or a number, got {quoted_value(value)}")

    def _misspelt(self, error: Exception) -> bool:
        """Whether a function of a package asks for a name that the paper's own case does not have."""
        of_a_package = self.function is not None and not self.function.__module__.startswith("radarsim.")
        return of_a_package and isinstance(error, UnknownName)

    def number(self, evidence: Any) -> float:
        """Its value alone."""
        return float(self(evidence).value)

    def exact_number(self, evidence: Any) -> float:
        """Its value where that is exact, else NaN."""
        estimate = self(evidence)
        return math.nan if has_interval(estimate) else float(estimate.value)


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
    faults = ErrorList()
    return _declarations(
        read_document(file, faults), faults, FileKeys, lambda keys, reader: reader.claims(keys), measures
    )


@cache
def parse_claims(text: str, source: str, *measures: ModuleType) -> tuple[tuple[Claim, ...], tuple[Choice, ...]]:
    """The claims, and the choices if any, of a text like claims.yaml; source: its file, for faults. Empty lines before
    the text align the line numbers of faults with that file."""
    faults = ErrorList()
    document = parse_yaml(text, source, faults)
    claims = _declarations(document, faults, FileKeys, lambda keys, reader: reader.claims(keys), measures)
    return claims, _declarations(document, faults, FileKeys, lambda keys, reader: reader.choices(keys))


def parse_own_claims(text: str, source: str, *measures: ModuleType) -> tuple[Claim, ...]:
    """The claims of a user's text like claims.yaml, whose config may be left open: it is then empty."""
    faults = ErrorList()
    document = parse_yaml(text, source, faults)

    def convert(keys: OwnFileKeys, reader: _Reader) -> Iterator[Claim]:
        if keys.choices:
            reader.fault(
                ("choices",), "need runs of a study in a package: `radarsim interpretations` judges under each"
            )
        yield from reader.claims(keys)

    return _declarations(document, faults, OwnFileKeys, convert, measures)


def load_choices(file: Path) -> tuple[Choice, ...]:
    """The open points of a paper, from a file interpretations.yaml; raises ConfigError, one line for each fault."""
    faults = ErrorList()
    return _declarations(read_document(file, faults), faults, ChoicesKeys, lambda keys, reader: reader.choices(keys))


def _declarations(
    document: Document | None,
    faults: ErrorList,
    model: type[KeysModel],
    convert: "Callable[[KeysModel, _Reader], Iterator[Declaration]]",
    measures: Sequence[ModuleType] = (),
) -> tuple[Declaration, ...]:
    """The objects made of a checked document."""
    keys = None if document is None else validate(model, document, faults)
    declarations = () if document is None or keys is None else tuple(convert(keys, _Reader(document, faults, measures)))
    faults.raise_if_any()
    return declarations


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

    def __init__(self, document: Document, faults: ErrorList, measures: Sequence[ModuleType]):
        self.document, self.faults = document, faults
        self.functions: dict[str, Callable[..., Any]] = {}
        methods: dict[str, Callable[..., Any]] = {}
        for module in measures:
            functions = {name: function for name, function in vars(module).items() if inspect.isfunction(function)}
            self.functions |= {
                name: function
                for name, function in functions.items()
                if next(iter(_parameters_of(function)), "") == "evidence"
            }
            members = inspect.getmembers(getattr(module, "Evidence", Evidence), inspect.isfunction)
            methods |= {name: function for name, function in members if not hasattr(Evidence, name)}
        measures_by_name = methods | self.functions
        self.measures = {name: function for name, function in measures_by_name.items() if not name.startswith("_")}
        self.ranges: dict[str, Callable[..., Any]] = {
            name: getattr(expected_ranges, name) for name in expected_ranges.RANGE_NAMES
        }

    def fault(self, path: KeyPath, message: str) -> None:
        """Note a fault of the text as a whole."""
        self.faults.add(self.document.origin(path), path, message)

    def claims(self, keys: FileKeys) -> Iterator[Claim]:
        """The claims in their order."""
        names = self._read_names(keys.names)
        parts: dict[str, list[Part]] = {}
        for i, claim_keys in enumerate(keys.claims):
            if f"{keys.paper}.{claim_keys.id}" in parts:
                self._add(("claims", i, "id"), "stands there already", claim_keys.id)
            claim_parts = parts[f"{keys.paper}.{claim_keys.id}"] = [
                part_keys
                for name in claim_keys.parts_of
                for part_keys in self._parts_of(name, parts, ("claims", i, "parts_of"))
            ]
            for j, part_keys in enumerate(claim_keys.parts):
                claim_parts += self._parts(part_keys, names, ("claims", i, "parts", j))
            fields = claim_keys.model_dump(exclude={"id", "config", "parts", "parts_of", "reading"})
            fields["interpretation"] = claim_keys.interpretation or claim_keys.reading
            fields["source"] = self._source(("claims", i, "config") if claim_keys.config else ("config",))
            yield Claim(
                f"{keys.paper}.{claim_keys.id}",
                parts=tuple(claim_parts),
                config=claim_keys.config or keys.config or "",
                **fields,
            )

    def choices(self, keys: ChoicesKeys | FileKeys) -> Iterator[Choice]:
        """The choices in their order."""
        names = self._read_names(keys.names)
        earlier_keys: set[str] = set()
        for i, choice_keys in enumerate(keys.choices):
            if choice_keys.key in RESERVED_CHOICE_KEYS:
                columns = ", ".join(RESERVED_CHOICE_KEYS)
                message = f"is a column of interpretations.csv already; not allowed: {columns}"
                self._add(("choices", i, "key"), message, choice_keys.key)
            if choice_keys.key in earlier_keys:
                self._add(("choices", i, "key"), "stands there already", choice_keys.key)
            earlier_keys.add(choice_keys.key)
            claims = self._filled(choice_keys.claims, names, ("choices", i, "claims"))
            claim_ids = [
                claim_id
                for alternative_keys in claims
                for claim_id in (alternative_keys if isinstance(alternative_keys, tuple) else (alternative_keys,))
            ]
            yield Choice(
                *(choice_keys.key, choice_keys.asks, choice_keys.original, choice_keys.english or choice_keys.original),
                tuple(
                    Alternative(**alternative_keys.model_dump(), source=self._source(("choices", i, "alternatives", j)))
                    for j, alternative_keys in enumerate(choice_keys.alternatives)
                ),
                tuple(f"{keys.paper}.{claim_id}" for claim_id in claim_ids),
                choice_keys.contradicts,
            )

    def _read_names(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The values under `names`; each may use those before it."""
        names: dict[str, Any] = {}
        for name, value in values.items():
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
        for key, values in each.items():
            variables, rows = [name.strip() for name in key.split(",")], self._filled(values, names, (*path, key))
            rows = rows if len(variables) > 1 or not isinstance(rows, tuple) else tuple((row,) for row in rows)
            if not isinstance(rows, tuple) or not all(
                isinstance(row, tuple) and len(row) == len(variables) for row in rows
            ):
                self._add(
                    (*path, key),
                    "must be a list" + (f" of lists of {len(variables)}" if len(variables) > 1 else ""),
                    values,
                )
                raise _UnknownNameError
            axes.append([dict(zip(variables, row, strict=True)) for row in rows])
        for combination in itertools.product(*axes):
            yield {name: value for row in combination for name, value in row.items()}

    def _part(self, keys: PartKeys, names: Mapping[str, Any], path: KeyPath) -> Part:
        fields: dict[str, Any] = {
            key: self._filled(value, names, (*path, key)) for key, value in keys.model_dump(exclude={"each"}).items()
        }
        cases = fields.pop("of")
        if not isinstance(cases, tuple):
            self._add((*path, "of"), "must be a list of cases", keys.of)
            raise _UnknownNameError
        measure = self._call(fields.pop("measure"), self.measures, cases, (*path, "measure"))
        words = fields.pop("expected")
        expected = self._call(expected_ranges.with_further_arguments(words), self.ranges, (), (*path, "expected"))
        for key in ("scale", "ceiling"):
            if fields[key] is not None:
                fields[key] = self._call(fields[key], self.measures, cases, (*path, key)).number
        exactly = self.functions.get(f"exact_{measure.name}")
        exact = replace(measure, name=f"exact_{measure.name}", function=exactly).exact_number if exactly else None
        assert expected.function
        try:
            expected_range = expected.function(**expected.arguments)
        except ValueError as error:
            self._add((*path, "expected"), f"{expected.name}: {error}", words)
            raise _UnknownNameError from None
        if not (expected_range.lo <= expected_range.hi and expected_range.margin > 0):
            self._add((*path, "expected"), "must be a range from low to high with a margin > 0", expected_range.words)
            raise _UnknownNameError
        return Part(cases, measure=measure, expected=expected_range, exact=exact, **fields)

    def _filled(self, value: Any, names: Mapping[str, Any], path: KeyPath) -> Any:
        """A value with `$name` replaced, and tuples in place of lists."""
        if isinstance(value, dict):
            return {key: self._filled(item, names, (*path, key)) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return tuple(self._filled(item, names, (*path, i)) for i, item in enumerate(value))
        if not isinstance(value, str) or "$" not in value:
            return value
        try:
            text = Template(value)
            (name, *other_names) = text.get_identifiers()
            is_only_name = not other_names and value in (f"${name}", f"${{{name}}}")
            return names[name] if is_only_name else text.substitute(names)
        except ValueError:
            self._add(path, "must name a value after each $", value)
        except KeyError as error:
            self._add(
                path, f"${error.args[0]} is not given under names or each{_allowed_names(error.args[0], names)}", value
            )
        raise _UnknownNameError

    def _call(
        self, value: Any, functions: Mapping[str, Callable[..., Any]], cases: tuple, path: KeyPath
    ) -> MeasureCall:
        """The call of `name` or `{name: arguments}`: arguments by name, or, for a range, in their order."""
        name, arguments = next(iter(value.items())) if isinstance(value, dict) and len(value) == 1 else (value, {})
        if not isinstance(name, str) or name not in functions:
            self._add(path, f"must be one of them{_allowed_names(str(name), functions)}", value)
            raise _UnknownNameError
        function, path = functions[name], (*path, name) if value is not name else path
        parameters = _parameters_of(function)
        names = list(parameters)[0 if functions is self.ranges else 1 :]
        if not isinstance(arguments, dict):
            if functions is not self.ranges:
                self._add(path, "must have its arguments by name", arguments)
                raise _UnknownNameError
            arguments = dict(zip(names, arguments if isinstance(arguments, tuple) else (arguments,), strict=False))
        try:
            positional = () if functions is self.ranges else (None, *cases)
            inspect.signature(function).bind(*positional, **arguments)
        except TypeError as error:
            self._add(path, f"{name}({', '.join(names)}): {error}", value)
            raise _UnknownNameError from None
        for key, argument in arguments.items():
            wrong_type = _wrong_type(parameters[key].annotation, argument) if key in parameters else ""
            if wrong_type:
                hint = "; its ends must rise" if functions is self.ranges and _has_falling_ends(arguments) else ""
                self._add((*path, key), f"must be {wrong_type}{hint}", argument)
                raise _UnknownNameError
        called = self.functions.get(name) if functions is self.measures else function
        return MeasureCall(name, called, cases, arguments, self._source(path))

    def _source(self, path: KeyPath) -> str:
        return str(self.document.origin(path))

    def _add(self, path: KeyPath, message: str, got: object) -> None:
        self.faults.add(self.document.origin(path), path, message, got)


@cache
def _parameters_of(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(function).parameters


def _allowed_names(name: str, names: Mapping[str, Any]) -> str:
    return f"{did_you_mean(name, list(names)) or ';'} allowed: {', '.join(names)}"


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
        members = [member for member in get_args(annotation) if value is None or member is not NoneType]
        wrong_types = [_wrong_type(member, value) for member in members]
        return "" if not all(wrong_types) else " or ".join(wrong_types)
    if annotation not in TYPE_WORDS:
        return ""
    types = (int, float) if annotation is float else annotation
    fits = isinstance(value, types) and isinstance(value, bool) == (annotation is bool)
    return "" if fits else TYPE_WORDS[annotation]
