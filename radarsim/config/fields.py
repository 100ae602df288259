"""Parts that the schemas of all studies are made of: the frozen model, numbers with their limits, and marks on fields.

A key carries its unit (`_m`, `_s`, `_mps`, `_mps2`, `_hz`, `_rad`). Wherever a key ends in `_rad`, its twin in `_deg`
is understood as well (and `_degps` for `_radps`); the checked object holds radians only.
"""

import math
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from types import FunctionType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Protocol, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    StringConstraints,
    TypeAdapter,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

T = TypeVar("T")
V = TypeVar("V")
Check = TypeVar("Check", bound=Callable[[Any], "Iterator[At]"])
LARGEST = 1e18  # of any number; far beyond any sea, sky or signal, and its square and cube are still finite
SMALLEST = 1e-18


class Display:
    """Mark of a field that changes no number (a display name): left out of a case's identity and of its noise."""


class Design:
    """Mark of a field that designs filters or says how long to look: no part of the world nor of its noise's key."""


class Added:
    """Mark of a key that earlier versions did not have, and did as its default says.

    At its default it is left out of a case's identity and of its noise's key, so that the noise is what it was.
    """


@dataclass(frozen=True)
class NameIn:
    """Mark of a field that names a member of a list; in a case's identity its place in the list stands for it."""

    field: str


class DataFile:
    """Mark of a text field that names a file of data, from the folder of the YAML file in which it stands.

    The checked object holds a path that can be opened; in a case's identity the file's content stands for it.
    """


class Scenario:
    """Mark of a study's field that may name a file in scenarios/ by its stem."""

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        inline = handler(core_schema)
        return {"anyOf": [{"type": "string", "description": "stem of a file in scenarios/"}, inline]}


@dataclass(frozen=True)
class Only:
    """Mark of a key that belongs to some values of keys beside it, such as a kind: {"kind": ("adaptive", "imm")}.

    default: its value there, where it is not given; needed: it has to be given. Elsewhere it must be left out.
    """

    where: Mapping[str, tuple[str, ...]]
    default: Any = None
    needed: bool = False


class NotRead(Exception):
    """A field that a cross-check reads has a fault of its own, so the check cannot be made."""


class At(NamedTuple):
    """A fault that a cross-check finds: at which key, dotted if deeper, and what is required."""

    key: str
    message: str


def at(key: str, message: str) -> At:
    """A fault for a cross-check to yield: `yield at("scans", "must be >= 3")`."""
    return At(key, message)


_CROSS_CHECKS: set[Callable[[Any], Iterator[At]]] = set()


def cross_check(method: Check) -> Check:
    """Mark of a model's method that yields faults of fields that do not go together.

    All cross-checks of a model are run, in order. Where some fields have faults of their own they are run as well, on
    what could be read: there one that touches an unread field ends at once, so what is independent stands apart.
    """
    _CROSS_CHECKS.add(method)
    return method


def of_each(members: Iterable[T], check: Callable[[int, T], Iterator[At]]) -> Iterator[At]:
    """The faults of every member of a list, `check(i, member)`; what is unread in one does not stop the others."""
    for i, member in enumerate(members):
        with suppress(NotRead):
            yield from check(i, member)


def readable(members: Iterable[T], value: Callable[[T], V]) -> list[V]:
    """The value of every member of which it could be read."""
    values = []
    for member in members:
        with suppress(NotRead):
            values.append(value(member))
    return values


class Model(BaseModel):
    """A frozen mapping of known keys; `_deg` twins are turned into radians before anything is checked."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @model_validator(mode="before")
    @classmethod
    def _radians(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        twins = {in_degrees(name): name for name in cls.model_fields if in_degrees(name)}
        if not any(key in twins for key in data):
            return data
        return {twins.get(key, key): radians(value) if key in twins else value for key, value in data.items()}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        found = list(self.misfits())
        if found:
            raise PydanticCustomError("at", "fields that do not go together", {"faults": found})
        return self

    @model_validator(mode="after")
    def _completed_by_kind(self) -> Self:
        missing = [name for name in conditions(type(self)) if getattr(self, name) is None]
        found = {name: value for name in missing if (value := self._settled(name)) is not None}
        return self.model_copy(update=found) if found else self

    def _settled(self, name: str) -> Any:
        """The value of a key, or the default that it has where it belongs."""
        value, only = getattr(self, name), conditions(type(self)).get(name)
        if value is not None or only is None:
            return value
        belongs = all(self._settled(key) in values for key, values in only.where.items())
        return only.default if belongs else None

    def _of_kind(self, name: str, only: Only) -> Iterator[At]:
        """The fault of a key that does not belong to the kind that there is, or is needed by it."""
        value, kinds = getattr(self, name), {key: self._settled(key) for key in only.where}
        other = next((key for key, values in only.where.items() if kinds[key] not in values), None)
        if value is not None and other is not None:
            own = "" if kinds[other] is None else f", not {kinds[other]}"
            yield at(name, f"belongs to {other}: {' or '.join(only.where[other])}{own}")
        elif value is None and other is None and only.needed:
            yield at(name, "is needed by " + ", ".join(f"{key}: {kind}" for key, kind in kinds.items()))

    def misfits(self) -> Iterator[At]:
        """What all cross-checks find; those that need an unread field end there."""
        for name, only in conditions(type(self)).items():
            with suppress(NotRead):
                yield from self._of_kind(name, only)
        seen: dict[str, Callable[[Any], Iterator[At]]] = {}
        for klass in reversed(type(self).__mro__):
            methods = {name: one for name, one in vars(klass).items() if isinstance(one, FunctionType)}
            seen |= {name: one for name, one in methods.items() if one in _CROSS_CHECKS}
        for check in seen.values():
            with suppress(NotRead):
                yield from check(self)

    if not TYPE_CHECKING:  # a type checker would take any name for an attribute

        def __getattr__(self, name):
            if name in type(self).model_fields:  # only of a model read in part
                raise NotRead(name)
            return super().__getattr__(name)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler.resolve_ref_schema(handler(core_schema))
        for name in [name for name in schema.get("properties", {}) if in_degrees(name)]:
            twin = in_degrees(name)
            about = schema["properties"][name].get("description", "")
            schema["properties"][twin] = {"description": f"in degrees, in place of {name}: {about}"}
            if name in schema.get("required", ()):
                schema["required"].remove(name)
                schema.setdefault("allOf", []).append({"oneOf": [{"required": [name]}, {"required": [twin]}]})
        return schema


@cache
def conditions(model: type[Model]) -> dict[str, Only]:
    """The keys of a model that belong to some kinds only, by name."""
    marks = {name: [m for m in info.metadata if isinstance(m, Only)] for name, info in model.model_fields.items()}
    return {name: own[0] for name, own in marks.items() if own}


def unknown_to(spec: Model, home: str) -> list[str]:
    """The keys of a config, dotted, that code of a package cannot know: those that a model derived elsewhere adds to
    the package's, and values that it allows beyond."""
    return list(_unknown(spec, home, ""))


def _unknown(spec: Model, home: str, above: str) -> Iterator[str]:
    lineage = type(spec).__mro__
    own = next((one for one in lineage if issubclass(one, Model) and _known(one.__module__, home)), Model)
    for name in type(spec).model_fields:
        value, key = getattr(spec, name), f"{above}{name}"
        info = own.model_fields.get(name)
        if info is None or not (own is lineage[0] or _allowed(info, value)):
            yield key
            continue
        members = enumerate(value) if isinstance(value, tuple) else [(None, value)]
        for i, one in members:
            if isinstance(one, Model):
                yield from _unknown(one, home, f"{key}." if i is None else f"{key}.{i}.")


def _known(module: str, home: str) -> bool:
    """Whether a module is one of a package, or one that it stands on: radarsim, of a study of radarsim its keys."""
    ours = "radarsim.config." if home.startswith("radarsim.") else "radarsim."
    return f"{module}.".startswith((f"{home}.", ours))


def _allowed(info: FieldInfo, value: Any) -> bool:
    """Whether a field of a model takes a value that another model has taken."""
    allowed: Any = Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
    try:
        TypeAdapter(allowed).validate_python(value)
    except ValidationError:
        return False
    return True


def in_degrees(key: str) -> str | None:
    """The twin in degrees of a key in radians; None for any other key."""
    return _unit_changed(key, "rad", "deg")


def in_radians(key: str) -> str | None:
    """The twin in radians of a key in degrees; None for any other key."""
    return _unit_changed(key, "deg", "rad")


def _unit_changed(key: str, unit: str, other: str) -> str | None:
    found = re.fullmatch(rf"(.*)_{unit}(|ps|ps2)", key)
    return f"{found[1]}_{other}{found[2]}" if found else None


def radians(value: Any) -> Any:
    """Degrees to radians, also within lists; what is no number is left for the check to refuse."""
    if isinstance(value, list):
        return [radians(item) for item in value]
    return math.radians(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _moderate(value: float) -> float:
    if abs(value) > LARGEST:
        raise PydanticCustomError("size", "must be at most 1e18 in size")
    if 0 < abs(value) < SMALLEST:
        raise PydanticCustomError("size", "must be at least 1e-18 in size")
    return value + 0.0  # no negative zero, which would be another identity


def _whole(value: Any) -> Any:
    """1e5 is a whole number too; what is not one is left for the check to refuse."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _printable(value: str) -> str:
    if not value.isprintable() or value != value.strip():
        raise PydanticCustomError("text", "must be printable text on one line, without blanks around it")
    return value


def _no_formula(value: str) -> str:
    """A name that no spreadsheet takes for a formula when it opens a table of results."""
    if value.startswith(("=", "+", "-", "@")):
        raise PydanticCustomError("text", "must not begin with = + - or @: a spreadsheet takes that for a formula")
    return value


Number = Annotated[float, Strict(), AfterValidator(_moderate)]
Positive = Annotated[float, Strict(), Field(gt=0), AfterValidator(_moderate)]
NonNegative = Annotated[float, Strict(), Field(ge=0), AfterValidator(_moderate)]
Probability = Annotated[float, Strict(), Field(ge=0, le=1), AfterValidator(_moderate)]
Correlation = Annotated[float, Strict(), Field(gt=-1, lt=1), AfterValidator(_moderate)]
Flag = Annotated[bool, Strict()]
Label = Annotated[str, Strict(), StringConstraints(min_length=1, max_length=64), AfterValidator(_printable)]
Name = Annotated[Label, AfterValidator(_no_formula)]
Stem = Annotated[str, Strict(), StringConstraints(min_length=1, max_length=100)]
Anything = Annotated[Any, WithJsonSchema({})]


@dataclass(frozen=True)
class Whole:
    """Mark of a whole number between bounds, which may be written as 1e5: `scans: Annotated[int, Whole(3, 100)]`."""

    least: int
    most: int

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        bounded = core_schema.int_schema(strict=True, ge=self.least, le=self.most)
        return core_schema.no_info_before_validator_function(_whole, bounded)


def whole(least: int, most: int) -> Any:
    """A whole number between bounds; 1e5 is one."""
    return Annotated[int, Whole(least, most)]


def key(
    title: str,
    about: str,
    default: Any = ...,
    *,
    symbol: str | None = None,
    unit: str | None = None,
    only: Mapping[str, str | tuple[str, ...]] | None = None,
    **limits: Any,
) -> Any:
    """A key: what people call it, what it means with its unit, its default (none: it must be given), and its letter.

    unit: of the value, where the key does not end in it. only: values of keys beside it that it belongs to, and its
    default is of; the key may be None then. limits: what `pydantic.Field` takes beside.
    """
    extra: Any = {name: text for name, text in (("symbol", symbol), ("unit", unit)) if text is not None}
    given = default if only is None else None
    field = Field(given, title=title, description=about, json_schema_extra=extra or None, **limits)
    if only is not None:
        where = {name: (values,) if isinstance(values, str) else values for name, values in only.items()}
        field.metadata.append(Only(where, None if default is ... else default, default is ...))
    return field


class Study(Model):
    """A study's own top-level keys, beside the common ones.

    bare_keys names the list whose members a bare key of `sweep` and `--set` speaks to. figure_names are all figures
    that the study's report may draw, with * for what depends on the config; None: not known here, and names under
    `figures` go unchecked. in_place_of names the key, by its dotted name, that a key beside it stands in place of:
    where an override or a sweep sets the one, the other goes.
    """

    bare_keys: ClassVar[str] = "filters"
    figure_names: ClassVar[tuple[str, ...] | None] = None
    in_place_of: ClassVar[Mapping[str, str]] = {}

    @property
    def device(self) -> str | None:
        """The display name of what measures: of the first part of the config that has a name."""
        parts = (getattr(self, key) for key in type(self).model_fields)
        names = (dict(part).get("name") for part in parts if isinstance(part, Model))
        return next(filter(None, names), None)

    @property
    def members(self) -> tuple[Any, ...]:
        """The list that `bare_keys` names: the filters of a case."""
        return getattr(self, self.bare_keys)

    @cross_check
    def _names_exist(self) -> Iterator[At]:
        for field, info in type(self).model_fields.items():
            for mark in info.metadata:
                if isinstance(mark, NameIn) and getattr(self, field) is not None:
                    names = [member.name for member in getattr(self, mark.field)]
                    if getattr(self, field) not in names:
                        one = mark.field.removesuffix("s")
                        yield at(field, f"must be the name of a {one}: {', '.join(names)}")


class Named(Protocol):
    """A member of a list that is referred to by its name."""

    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=Named)


def unique_names(members: tuple[N, ...]) -> tuple[N, ...]:
    """Check that no two members of a list have the same name; for AfterValidator."""
    seen: set[str] = set()
    for member in members:
        name = unicodedata.normalize("NFC", member.name)  # what looks the same is the same
        if name in seen:
            raise PydanticCustomError("unique", "names must differ: {name} is there twice", {"name": member.name})
        seen.add(name)
    return members


# Of most studies: the list of what is compared, and the name of the one that gains are against; its own name.
Members = Annotated[tuple[N, ...], Field(min_length=1, max_length=16), AfterValidator(unique_names), Design()]
Baseline = Annotated[Name | None, Design(), NameIn("filters")]
