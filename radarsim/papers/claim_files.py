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
from dataclasses import replace
from functools import cache
from pathlib import Path
from string import Template
from types import ModuleType, NoneType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin

from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList
from radarsim.config.find_files import did_you_mean
from radarsim.config.model import Model
from radarsim.config.validate import validate
from radarsim.config.value_text import KeyPath
from radarsim.config.yaml_io import parse_yaml, read_document
from radarsim.errors import count_text
from radarsim.papers import expected_ranges
from radarsim.papers.claim import Claim, Part
from radarsim.papers.claim_keys import ChoiceKeys, ChoicesKeys, ClaimKeys, FileKeys, OwnFileKeys, PartKeys
from radarsim.papers.evidence import Evidence
from radarsim.papers.interpretations import LEADING_COLUMNS, TRAILING_COLUMNS, Alternative, Choice
from radarsim.papers.measure_call import MeasureCall

KeysModel = TypeVar("KeysModel", bound=Model)
Declaration = TypeVar("Declaration", Claim, Choice)
# The last is the name of a column of interpretations.csv in earlier versions.
RESERVED_CHOICE_KEYS = (*LEADING_COLUMNS, *TRAILING_COLUMNS, "reading")
MAX_PARTS = 10_000  # that a part of the text makes by `each`
TYPE_WORDS = {str: "text", float: "a number", int: "a whole number", bool: "true or false"}


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
            claim_id = f"{keys.paper}.{claim_keys.id}"
            if claim_id in parts:
                self._add(("claims", i, "id"), "stands there already", claim_keys.id)
            parts[claim_id] = self._parts_of_claim(claim_keys, names, parts, ("claims", i))
            yield self._claim(claim_id, claim_keys, keys.config, tuple(parts[claim_id]), ("claims", i))

    def _parts_of_claim(
        self, keys: ClaimKeys, names: Mapping[str, Any], earlier: Mapping[str, list[Part]], path: KeyPath
    ) -> list[Part]:
        """The parts of a claim, those of earlier claims that it names first."""
        parts = [part for name in keys.parts_of for part in self._parts_of(name, earlier, (*path, "parts_of"))]
        for j, part_keys in enumerate(keys.parts):
            parts += self._parts(part_keys, names, (*path, "parts", j))
        if not (keys.parts or keys.parts_of or keys.unstated):
            self.fault((*path, "parts"), "must hold at least 1: what is measured, and what is expected")
        return parts

    def _claim(
        self, claim_id: str, keys: ClaimKeys, config: str | None, parts: tuple[Part, ...], path: KeyPath
    ) -> Claim:
        fields = keys.model_dump(exclude={"id", "config", "parts", "parts_of", "reading"})
        fields["interpretation"] = keys.interpretation or keys.reading
        fields["source"] = self._source((*path, "config") if keys.config else ("config",))
        return Claim(claim_id, parts=parts, config=keys.config or config or "", **fields)

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
            claim_ids = self._claim_ids(choice_keys, names, ("choices", i, "claims"))
            yield Choice(
                *(choice_keys.key, choice_keys.asks, choice_keys.original, choice_keys.english or choice_keys.original),
                tuple(self._alternatives(choice_keys, ("choices", i, "alternatives"))),
                tuple(f"{keys.paper}.{claim_id}" for claim_id in claim_ids),
                choice_keys.contradicts,
            )

    def _alternatives(self, keys: ChoiceKeys, path: KeyPath) -> Iterator[Alternative]:
        """The alternatives of a choice, whose names must differ."""
        names: set[str] = set()
        for j, alternative_keys in enumerate(keys.alternatives):
            if alternative_keys.name in names:
                self._add((*path, j, "name"), "stands there already", alternative_keys.name)
            names.add(alternative_keys.name)
            yield Alternative(**alternative_keys.model_dump(), source=self._source((*path, j)))

    def _claim_ids(self, keys: ChoiceKeys, names: Mapping[str, Any], path: KeyPath) -> list[Any]:
        """The numbers of the claims that a choice affects; a name among them may stand for several."""
        try:
            values = self._filled(keys.claims, names, path)
        except _UnknownNameError:
            return []
        lists = (
            [value if isinstance(value, tuple) else (value,) for value in values] if isinstance(values, tuple) else []
        )
        claim_ids = [claim_id for members in lists for claim_id in members]
        if not isinstance(values, tuple) or not all(isinstance(claim_id, int | str) for claim_id in claim_ids):
            self._add(path, "must be a list of claims, by their id without the paper", keys.claims)
            return []
        return claim_ids

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
        if not 1 <= (count := math.prod(map(len, axes))) <= MAX_PARTS:
            self._add(path, f"makes {count_text(count)} parts; allowed: 1 to {count_text(MAX_PARTS)}", each)
            raise _UnknownNameError
        for combination in itertools.product(*axes):
            yield {name: value for row in combination for name, value in row.items()}

    def _part(self, keys: PartKeys, names: Mapping[str, Any], path: KeyPath) -> Part:
        fields: dict[str, Any] = {
            key: self._filled(value, names, (*path, key)) for key, value in keys.model_dump(exclude={"each"}).items()
        }
        cases = fields.pop("of")
        if not isinstance(cases, tuple) or not cases:
            message = "must hold at least 1 case" if cases == () else "must be a list of cases"
            self._add((*path, "of"), message, keys.of)
            raise _UnknownNameError
        measure = self._call(fields.pop("measure"), self.measures, cases, (*path, "measure"))
        expected_range = self._expected_range(fields.pop("expected"), (*path, "expected"))
        for key in ("scale", "ceiling"):
            if fields[key] is not None:
                fields[key] = self._call(fields[key], self.measures, cases, (*path, key)).number
        exactly = self.functions.get(f"exact_{measure.name}")
        exact = replace(measure, name=f"exact_{measure.name}", function=exactly).exact_number if exactly else None
        return Part(cases, measure=measure, expected=expected_range, exact=exact, **fields)

    def _expected_range(self, words: Any, path: KeyPath) -> expected_ranges.ExpectedRange:
        """The range that words stand for."""
        call = self._call(expected_ranges.with_further_arguments(words), self.ranges, (), path)
        assert call.function  # a range is no method of evidence
        try:
            expected_range: expected_ranges.ExpectedRange = call.function(**call.arguments)
        except ValueError as error:
            self._add(path, f"{call.name}: {error}", words)
            raise _UnknownNameError from None
        if not (expected_range.lo <= expected_range.hi and expected_range.margin > 0):
            self._add(path, "must be a range from low to high with a margin > 0", expected_range.words)
            raise _UnknownNameError
        return expected_range

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
        names = list(_parameters_of(function))[0 if functions is self.ranges else 1 :]
        if not isinstance(arguments, dict):
            if functions is not self.ranges:
                self._add(path, "must have its arguments by name", arguments)
                raise _UnknownNameError
            arguments = dict(zip(names, arguments if isinstance(arguments, tuple) else (arguments,), strict=False))
        positional = () if functions is self.ranges else (None, *cases)
        try:
            inspect.signature(function).bind(*positional, **arguments)
        except TypeError as error:
            case_count = f"; of has {len(cases)} cases" if functions is self.measures and len(cases) > 1 else ""
            self._add(path, f"{name}({', '.join(names)}): {error}{case_count}", value)
            raise _UnknownNameError from None
        self._check_types(function, arguments, path, functions is self.ranges and _has_falling_ends(arguments))
        called = self.functions.get(name) if functions is self.measures else function
        return MeasureCall(name, called, cases, arguments, self._source(path))

    def _check_types(
        self, function: Callable[..., Any], arguments: Mapping[str, Any], path: KeyPath, falls: bool
    ) -> None:
        """Note arguments of a wrong type. falls: they are the ends of a range, in falling order."""
        parameters = _parameters_of(function)
        for key, argument in arguments.items():
            wrong_type = _wrong_type(parameters[key].annotation, argument) if key in parameters else ""
            if wrong_type:
                self._add((*path, key), f"must be {wrong_type}{'; its ends must rise' if falls else ''}", argument)
                raise _UnknownNameError

    def _source(self, path: KeyPath) -> str:
        return str(self.document.origin(path))

    def _add(self, path: KeyPath, message: str, got: object) -> None:
        self.faults.add(self.document.origin(path), path, message, got)


@cache
def _parameters_of(function: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(function).parameters


def _allowed_names(name: str, names: Mapping[str, Any]) -> str:
    return f"{did_you_mean(name, list(names)) or ';'} allowed: {', '.join(names) or 'none'}"


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
