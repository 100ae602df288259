"""Scalars of a config: what a plain word of YAML means here, and which Python values stand for it.

Stricter than YAML 1.1 where that surprises (yes, 1:30, 010 and 1_000 are text), wider where it does (1e5 is a number).

Parts that the schemas of all studies are made of: the frozen model, numbers with their limits, and marks on fields.

A key carries its unit (`_m`, `_s`, `_mps`, `_mps2`, `_hz`, `_rad`). Wherever a key ends in `_rad`, its twin in `_deg`
is understood as well (and `_degps` for `_radps`); the checked object holds radians only.

The numeric keys of a checked config: where each stands, its value, and what it may be.

Keys that studies of range and radial velocity share: a radar's accuracies, and targets in range.

Keys of rare events that several studies share: realisations drawn where an event is frequent, weighted back."""

import math
import re
import typing
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from types import FunctionType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Protocol, Self, TypeVar, cast, get_args

import pydantic
from pydantic import AfterValidator, BaseModel, Field, GetJsonSchemaHandler, Strict, StringConstraints, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from radarsim.config.document import Faults, KeyPath, Origin, did_you_mean, dotted, short
from radarsim.constants import STANDARD_GRAVITY_MPS2, Band, outside_band
from radarsim.errors import ConfigError

# ---- values ----------------------------------------------------------------------------------------------------------
NUMBER = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
CONSTANTS = {"true": True, "false": False, "": None, "~": None, "null": None}
NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
DEEPEST = 50


class NotFinite(ValueError):
    """A number that is infinite or not-a-number."""


def from_text(text: str) -> object:
    """The value of a plain (unquoted) word: number, true, false, null, or the text itself."""
    if text in CONSTANTS:
        return CONSTANTS[text]
    if NOT_FINITE.fullmatch(text):
        raise NotFinite(text)
    if not NUMBER.fullmatch(text):
        return text
    number = float(text)
    if not math.isfinite(number):
        raise NotFinite(text)
    return int(text) if text.lstrip("+-").isdigit() else number


def from_python(value: object, path: KeyPath, origin: Origin, faults: Faults) -> object:
    """A Python dictionary converted as if from YAML; NumPy scalars and arrays become plain values."""
    if len(path) > DEEPEST:
        faults.spoil(origin, path[:3], f"nested more than {DEEPEST} deep")
        return None
    if hasattr(value, "tolist") and not isinstance(value, type):
        value = value.tolist()
    match value:
        case bool() | str():
            return value
        case int() | float():
            return _finite(value, path, origin, faults)
        case None:
            faults.spoil(origin, path, "has no value")
            return None
        case Mapping():
            return {str(k): from_python(v, (*path, str(k)), origin, faults) for k, v in value.items()}
        case list() | tuple():
            return [from_python(v, (*path, i), origin, faults) for i, v in enumerate(value)]
    faults.spoil(origin, path, "must be text, a number, true or false, a list or a mapping", value)
    return None


def _finite(value: float | int, path: KeyPath, origin: Origin, faults: Faults) -> float | int | None:
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond the largest float
        finite = False
    if not finite:
        faults.spoil(origin, path, "must be a finite number", value)
        return None
    return value


# ---- fields ----------------------------------------------------------------------------------------------------------
T = TypeVar("T")
V = TypeVar("V")
Check = TypeVar("Check", bound=Callable[[Any], "Iterator[At]"])
LARGEST = 1e18  # of any number; far beyond any sea, sky or signal, and its square and cube are still finite
SMALLEST = 1e-18


class Display:
    """Mark of a field that changes no number (a display name): excluded from a case's identity and from its noise."""


class Design:
    """Mark of a field that designs filters or limits the observation: no part of the world nor of its noise's key."""


class Added:
    """Mark of a key that earlier versions lacked, behaving as its default. At its default it is excluded from a case's
    identity and from its noise's key, so that the noise stays the same."""


class ColumnsOfOne:
    """Mark of a field of rows of probabilities whose columns sum to one."""


@dataclass(frozen=True)
class NameIn:
    """Mark of a field that names a member of a list; a case's identity has its place in the list instead."""

    field: str


class DataFile:
    """Mark of a text field that names a file of data, relative to the folder of its YAML file. The checked object holds
    a readable path; a case's identity has the file's content instead."""


class Scenario:
    """Mark of a study's field that may name a file in scenarios/ by its stem."""

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        inline = handler(core_schema)
        return {"anyOf": [{"type": "string", "description": "stem of a file in scenarios/"}, inline]}


@dataclass(frozen=True)
class Only:
    """Mark of a key that belongs to some values of keys beside it, such as a kind: {"kind": ("adaptive", "imm")}.

    default: its value there, if it is not given; needed: it is required. Elsewhere it must be left out."""

    where: Mapping[str, tuple[str, ...]]
    default: Any = None
    needed: bool = False


class NotRead(Exception):
    """A field that a cross-check reads has a fault of its own, so the check cannot be made."""


class At(NamedTuple):
    """A fault from a cross-check: the key, dotted if deeper, and the requirement."""

    key: str
    message: str


def at(key: str, message: str) -> At:
    """A fault for a cross-check to yield: `yield at("scans", "must be >= 3")`."""
    return At(key, message)


_CROSS_CHECKS: set[Callable[[Any], Iterator[At]]] = set()


def cross_check(method: Check) -> Check:
    """Mark of a model's method that yields faults of incompatible fields.

    All cross-checks of a model are run, in order. Where some fields have faults of their own they run as well, on the
    valid fields: one that touches an invalid field ends at once, so that independent checks are separate methods."""
    _CROSS_CHECKS.add(method)
    return method


def of_each(members: Iterable[T], check: Callable[[int, T], Iterator[At]]) -> Iterator[At]:
    """The faults of every member of a list, `check(i, member)`; an invalid field in one does not stop the others."""
    for i, member in enumerate(members):
        with suppress(NotRead):
            yield from check(i, member)


def readable(members: Iterable[T], value: Callable[[T], V]) -> list[V]:
    """The value of every member for which it is valid."""
    values = []
    for member in members:
        with suppress(NotRead):
            values.append(value(member))
    return values


class Model(BaseModel):
    """A frozen mapping of known keys; `_deg` twins are turned into radians before anything is checked."""

    model_config = pydantic.ConfigDict(frozen=True, extra="forbid")

    def __init_subclass__(cls, **settings: Any) -> None:
        """Give the class keys of its own before pydantic collects them.

        A key object may serve several classes. Before 2.11.7 pydantic adds the marks of each class to that object, so
        that a class would have the marks of all that were defined before it, and with them another identity."""
        super().__init_subclass__(**settings)
        outside = (base for base in reversed(cls.__mro__) if base is cls or not issubclass(base, BaseModel))
        attributes = {name: value for base in outside for name, value in vars(base).items()}
        for name, value in attributes.items():
            if isinstance(value, FieldInfo):
                setattr(cls, name, deepcopy(value, {id(value.default): value.default}))  # the default is kept as it is

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Raises ConfigError where a key belongs to values that no key beside it may have."""
        for name, only in conditions(cls).items():
            for beside, values in only.where.items():
                about = f"{cls.__name__}.{name}: only: "
                if beside not in cls.model_fields:
                    raise ConfigError(f"{about}no key {beside!r} is beside it; there are {', '.join(cls.model_fields)}")
                allowed = _literals(cls.model_fields[beside].annotation)
                if unknown := [value for value in values if allowed and value not in allowed]:
                    raise ConfigError(f"{about}{beside} is one of {', '.join(allowed)}, got {', '.join(unknown)}")

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
        """The value of a key, or its default where it belongs."""
        value, only = getattr(self, name), conditions(type(self)).get(name)
        if value is not None or only is None:
            return value
        belongs = all(self._settled(key) in values for key, values in only.where.items())
        return only.default if belongs else None

    def _of_kind(self, name: str, only: Only) -> Iterator[At]:
        """The fault of a key that does not belong to the given kind, or is required by it."""
        value, kinds = getattr(self, name), {key: self._settled(key) for key in only.where}
        other = next((key for key, values in only.where.items() if kinds[key] not in values), None)
        if value is not None and other is not None:
            own = "" if kinds[other] is None else f", not {kinds[other]}"
            yield at(name, f"belongs to {other}: {' or '.join(only.where[other])}{own}")
        elif value is None and other is None and only.needed:
            yield at(name, "is needed by " + ", ".join(f"{key}: {kind}" for key, kind in kinds.items()))

    def misfits(self) -> Iterator[At]:
        """Faults from all cross-checks; those that need an invalid field end there."""
        for name, only in conditions(type(self)).items():
            with suppress(NotRead):
                yield from self._of_kind(name, only)
        for check in cross_checks(type(self)):
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
    """The keys of a model that belong only to some kinds, by name."""
    marks = {name: [m for m in info.metadata if isinstance(m, Only)] for name, info in model.model_fields.items()}
    return {name: own[0] for name, own in marks.items() if own}


@cache
def cross_checks(model: type[Model]) -> tuple[Callable[[Any], Iterator[At]], ...]:
    """The cross-checks of a model, those of its bases first."""
    seen: dict[str, Callable[[Any], Iterator[At]]] = {}
    for klass in reversed(model.__mro__):
        methods = {name: one for name, one in vars(klass).items() if isinstance(one, FunctionType)}
        seen |= {name: one for name, one in methods.items() if one in _CROSS_CHECKS}
    return tuple(seen.values())


def _literals(annotation: Any) -> tuple[str, ...]:
    """The permitted texts of a key with listed values; nothing for other keys."""
    every = [one for part in get_args(annotation) for one in (get_args(part) or (part,))]
    return tuple(one for one in every if isinstance(one, str))


def unknown_to(spec: Model, home: str) -> list[str]:
    """The keys of a config, dotted, that a package's code cannot know: those that a model derived elsewhere adds to the
    package's, and additional values."""
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
    """Whether a module belongs to a package or one that it builds on: radarsim, or for a radarsim study its keys."""
    ours = "radarsim.config." if home.startswith("radarsim.") else "radarsim."
    return f"{module}.".startswith((f"{home}.", ours))


def _allowed(info: FieldInfo, value: Any) -> bool:
    """Whether a field of a model accepts a value from another model."""
    allowed: Any = Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
    try:
        pydantic.TypeAdapter(allowed).validate_python(value)
    except pydantic.ValidationError:
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
    """Degrees to radians, also within lists; anything but numbers is left for the check to refuse."""
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
    """1e5 is a whole number too; anything else is left for the check to refuse."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _printable(value: str) -> str:
    if not value.isprintable() or value != value.strip():
        raise PydanticCustomError("text", "must be printable text on one line, without blanks around it")
    return value


def _no_formula(value: str) -> str:
    """A name that no spreadsheet reads as a formula when it opens a table of results."""
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
Anything = Annotated[Any, pydantic.WithJsonSchema({})]


@dataclass(frozen=True)
class Whole:
    """Mark of a whole number between bounds, which may be written as 1e5: `scans: Annotated[int, Whole(3, 100)]`."""

    least: int
    most: int

    def __get_pydantic_core_schema__(self, source: object, handler: pydantic.GetCoreSchemaHandler) -> CoreSchema:
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
    """A key: its name, its description with unit, its default (none: it is required), and its letter.

    unit: of the value, where the key does not end in it. only: values of keys beside it that it belongs to, and for
    which its default holds; the key may then be None. limits: further arguments of `pydantic.Field`."""
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

    @classmethod
    def carried(cls, study: str, data: Mapping[str, Any]) -> dict[str, Any] | None:
        """The keys of a config of another study, as read, in this study's terms: the same experiment as far as both
        have it, what this one has not as it stands, so that the check refuses it; None where no study is taken over."""
        return None

    @property
    def device(self) -> str | None:
        """The display name of the sensor: that of the first part of the config with a name."""
        parts = (getattr(self, key) for key in type(self).model_fields)
        names = (dict(part).get("name") for part in parts if isinstance(part, Model))
        return next(filter(None, names), None)

    @property
    def members(self) -> tuple[Any, ...]:
        """The list of `bare_keys`: the filters of a case."""
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


def kinds_of(keys: type[Model]) -> tuple[str, ...]:
    """The permitted values of a model's key `kind`; for a study's keys those of its members."""
    if issubclass(keys, Study):
        members = [one for one in _parts(keys.model_fields[keys.bare_keys].annotation) if _is_model(one)]
        return tuple(kind for one in members for kind in kinds_of(one))
    return get_args(keys.model_fields["kind"].annotation) if "kind" in keys.model_fields else ()


def _is_model(part: Any) -> bool:
    return isinstance(part, type) and issubclass(part, Model)


def widened(
    keys: type[Study],
    further: Mapping[str, type[Model]],
    why_not: Mapping[str, str],
    again: tuple[Callable[[str], type[Study]], str],
) -> type[Study]:
    """The keys of a study whose members may have further kinds; an absent kind means the study's own.

    why_not: for unusable kinds the reason. again: a function and arguments that return these keys again, by which a
    config travels between processes."""
    info = keys.model_fields[keys.bare_keys]
    (own, _) = get_args(info.annotation)
    kinds = dict.fromkeys(kinds_of(own), own) | dict(further)
    first = next(iter(kinds))

    def kind_of(data: Any) -> Any:
        return data.get("kind", first) if isinstance(data, dict) else getattr(data, "kind", first)

    def known(data: Any) -> Any:
        if (kind := kind_of(data)) not in list(kinds):  # which may compare something other than text
            reason = f"; {why_not[kind]}" if isinstance(kind, str) and kind in why_not else ""
            told = {"kinds": ", ".join(kinds), "reason": reason, "discriminator": "kind"}
            raise PydanticCustomError("no_such_kind", "must be one of {kinds}{reason}", told)
        return data

    tagged: Any = typing.Union[tuple(Annotated[one, pydantic.Tag(f"kind: {kind}")] for kind, one in kinds.items())]  # noqa: UP007
    choice: Any = Annotated[
        tagged, pydantic.Discriminator(lambda data: f"kind: {kind_of(data)}"), pydantic.BeforeValidator(known)
    ]
    members: Any = (tuple[choice, ...], info)
    made: Any = pydantic.create_model(
        keys.__name__, __base__=keys, __module__=keys.__module__, __doc__=keys.__doc__, **{keys.bare_keys: members}
    )
    made.__reduce__ = lambda self: (_again, (*again, dict(self), self.model_fields_set))
    return cast(type[Study], made)


def _again(find: Callable[..., type[Study]], name: str, values: dict[str, Any], given: set[str]) -> Study:
    return find(name).model_construct(given, **values)


class Named(Protocol):
    """A member of a list that is referred to by its name."""

    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=Named)


def unique_names(members: tuple[N, ...]) -> tuple[N, ...]:
    """Check that no two members of a list have the same name; for AfterValidator."""
    seen: set[str] = set()
    for member in members:
        name = unicodedata.normalize("NFC", member.name)  # equal looks are equal names
        if name in seen:
            raise PydanticCustomError("unique", "names must differ: {name} is there twice", {"name": member.name})
        seen.add(name)
    return members


# Of most studies: the list of what is compared, and the name of the one that gains are against; its own name.
Members = Annotated[tuple[N, ...], Field(min_length=1, max_length=16), AfterValidator(unique_names), Design()]
Baseline = Annotated[Name | None, Design(), NameIn("filters")]
BASELINE = key(
    "baseline filter", "filter against which gains are computed, or a list of several; default: the first", None
)
# Of `Lasting` studies: how long a run is.
SCANS = key("number of scans", "number of scans; or give duration_s", None)
DURATION = key(
    "duration", "time from the first scan to the last, s, in place of scans: to the last scan within it", None
)


class Member(Model):
    """A member of a list whose members differ by their names."""

    name: Annotated[Name, Display()] = key("name", "label; every filter has its own")


def keys_of(
    name: str, module: str, parts: Mapping[str, type[Model]], filters: type[Member], most_scans: int
) -> type[Study]:
    """The keys of a study with these parts, by name, and `filters`, `baseline` and `scans` with their marks. The class
    has this name, and is found in this module."""
    about = {name: (one.__doc__ or name).strip().partition("\n")[0].rstrip(".") for name, one in parts.items()}
    own: Any = {name: (one, key(name.replace("_", " "), about[name])) for name, one in parts.items()}
    own |= {
        "filters": (Members[filters], key("filters", "the filters; all see the same world")),  # type: ignore[valid-type]
        "baseline": (Baseline, BASELINE),
        "scans": (Annotated[int, Whole(2, most_scans), Design()], key("number of scans", "number of plots")),
    }
    made: type[Study] = pydantic.create_model(name, __base__=Study, __module__=module, **own)
    return made


# ---- numeric ---------------------------------------------------------------------------------------------------------
MOST_NAMED = 5  # keys with the beginning of a mistaken name that are all suggested


@dataclass(frozen=True)
class NumericKey:
    """A key that holds a number, as `--set` names it.

    value is None where the key is optional and not given. low and high bound what the schema alone allows (infinite
    where it does not), in the key's unit; whole: only whole numbers are."""

    path: str
    value: float | None
    low: float
    high: float
    whole: bool


def keys(spec: Study) -> list[NumericKey]:
    """Every numeric key of a case, in the order of its schema, items of lists by index."""
    return list(_within(spec, ()))


def _within(model: Model, path: tuple[str | int, ...]) -> Iterator[NumericKey]:
    for name, info in type(model).model_fields.items():
        yield from _at(getattr(model, name), (*path, name), [info.annotation, *info.metadata])


def _at(value: Any, path: tuple[str | int, ...], allowed: Any) -> Iterator[NumericKey]:
    """The keys at and below a value; `allowed` is its annotation with marks."""
    if isinstance(value, Model):
        yield from _within(value, path)
    elif isinstance(value, tuple | list):
        for i, item in enumerate(value):
            yield from _at(item, (*path, i), allowed)
    elif (_is_number(value) and not _is_choice(allowed)) or (value is None and _takes_numbers(allowed)):
        low, high, whole = _bounds(allowed)
        yield NumericKey(dotted(path), value, low, high, whole)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _parts(annotation: Any) -> Iterator[Any]:
    """An annotation and all its parts: members of a choice, items of a list, marks."""
    yield annotation
    for inner in annotation if isinstance(annotation, list) else get_args(annotation):
        yield from _parts(inner)
    yield from getattr(annotation, "metadata", ()) if not isinstance(annotation, type) else ()


def _is_choice(allowed: Any) -> bool:
    """Whether only listed values are allowed, even though they are numbers."""
    return any(typing.get_origin(part) is Literal for part in _parts(allowed))


def _takes_numbers(allowed: Any) -> bool:
    return any(part in (int, float) for part in _parts(allowed))


def _bounds(allowed: Any) -> tuple[float, float, bool]:
    """Lower and upper bound, and whether only whole numbers, from the marks of an annotation."""
    low, high, whole = -math.inf, math.inf, False
    for part in _parts(allowed):
        if isinstance(part, Whole):
            low, high, whole = max(low, part.least), min(high, part.most), True
        low = max([low, *_limits(part, "gt", "ge")])
        high = min([high, *_limits(part, "lt", "le")])
    return low, high, whole


def _limits(part: Any, *names: str) -> list[float]:
    """The limits of these names in a mark."""
    held = [getattr(part, name, None) for name in names]
    return [float(one) for one in held if isinstance(one, int | float)]


def find(spec: Study, name: str) -> tuple[NumericKey, ...]:
    """The numeric keys that a name means: one by its full path; of a bare filter key one in every filter that has it. A
    `_deg` name means its `_rad` twin, value and bounds in degrees. Raises ConfigError, with the nearest known name."""
    known = keys(spec)
    path, _, last = name.rpartition(".")
    twin = in_radians(last)
    wanted = f"{path}.{twin}".removeprefix(".") if twin else name
    members = f"{type(spec).bare_keys}."
    found = [key for key in known if key.path == wanted] or [
        key for key in known if key.path.startswith(members) and key.path.split(".", 2)[-1] == wanted
    ]
    if not found:
        paths = [key.path for key in known]
        bare = [one.split(".", 2)[-1] for one in paths if one.startswith(members)]
        degrees = [f"{head}{other}" for one in paths for head, other in [_in_degrees(one)] if other]
        raise ConfigError(f"{name}: {_no_such(name, spec, list(dict.fromkeys([*paths, *bare, *degrees])))}")
    if twin:
        found = [_degrees(key, name) for key in found]
    return tuple(found)


def _in_degrees(path: str) -> tuple[str, str | None]:
    head, dot, last = path.rpartition(".")
    return head + dot, in_degrees(last)


def _degrees(key: NumericKey, name: str) -> NumericKey:
    value = None if key.value is None else math.degrees(key.value)
    head = key.path.rpartition(".")[0]
    path = f"{head}.{name.rpartition('.')[2]}".removeprefix(".")
    return NumericKey(path, value, math.degrees(key.low), math.degrees(key.high), key.whole)


def _no_such(name: str, spec: Study, known: list[str]) -> str:
    """Why a name is not a numeric key."""
    value: Any = spec
    for step in name.split("."):
        if isinstance(value, Model) and step in type(value).model_fields:
            value = getattr(value, step)
        elif isinstance(value, tuple) and step.isdecimal() and int(step) < len(value):
            value = value[int(step)]
        else:
            near = _several(name, known) or did_you_mean(name, known) or _by_last(name, known)
            return f"unknown key{near}" + ("" if near and "." not in name else _in_group(name, known))
    return "holds no number, and only a number can be solved for"


def _several(name: str, known: list[str]) -> str:
    """A suggestion of all the keys with the beginning of a name, if they are few."""
    begun = [path for path in known if len(name) > 2 and path.startswith(name)]
    return f"; did you mean {' or '.join(begun)}?" if 1 < len(begun) <= MOST_NAMED else ""


def _in_group(name: str, known: list[str]) -> str:
    """The members of a name's group, or the available groups and single keys."""
    group = name.rpartition(".")[0]
    while group and not any(path.startswith(f"{group}.") for path in known):
        group = group.rpartition(".")[0]
    inside = [path[len(group) + 1 if group else 0 :] for path in known if not group or path.startswith(f"{group}.")]
    parts = dict.fromkeys(f"{path.partition('.')[0]}." if "." in path else path for path in inside)
    return f"; {group or 'there'} {'has' if group else 'are'} {', '.join(parts)}"


def _by_last(name: str, known: list[str]) -> str:
    """A suggestion for a name whose last part alone is right or nearly so: the path before it is wrong or missing."""
    ends = {path.rpartition(".")[2]: path for path in reversed(known)}
    near = did_you_mean(name.rpartition(".")[2], list(ends)).removeprefix("; did you mean ").removesuffix("?")
    return f"; did you mean {ends[near]}?" if near else ""


# ---- radial ----------------------------------------------------------------------------------------------------------
MOST_SCANS = 100_000
FARTHEST_M = 1e15  # a range that still resolves a metre in double precision
RESOLVED = 1e-4 * 2.0**52  # range over accuracy at which rounding reaches a ten-thousandth of the accuracy
NEAREST_M = 100.0  # a target that flies over the radar has no radial motion that a filter could follow
FASTEST_MPS = 12_000.0  # escape from the Earth
HARDEST_MPS2 = 1000.0  # about 100 g, more than any missile's

Coefficients = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]
COEFFICIENTS = "derivatives of range at the first plot: m, m/s, m/s², … (the sum of c_i t^i / i!)"


class InBand(Model):
    """What lies in a wave band: its wavelength must."""

    if TYPE_CHECKING:
        band: Band | None
        wavelength_m: float

    @cross_check
    def _in_its_band(self) -> Iterator[At]:
        limits = outside_band(self.band, self.wavelength_m)
        if limits is not None:
            yield at("band", f"{self.band} is {' to '.join(map(short, limits))} m, not {short(self.wavelength_m)}")


class Radar(InBand):
    """A surveillance radar: accuracies of one plot, and the period of its scans."""

    name: Annotated[Name | None, Display()] = key("name", "display name", None)
    band: Annotated[Band | None, Display()] = key(
        "wave band", "wave band, for display: by its wavelength, or by its letter (IEEE Std 521)", None
    )
    wavelength_m: Positive = key("wavelength", "wavelength, m: gives the Doppler frequency of a velocity", symbol="λ")
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_velocity_mps: Positive = key(
        "σ of the measured radial velocity", "standard deviation of a measured radial velocity, m/s", symbol="σ_V"
    )
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="Δt")


class Lasting(Study):
    """A study whose keys give the length of a run as a number of scans, or as a time in its place."""

    in_place_of: ClassVar[Mapping[str, str]] = {"scans": "duration_s", "duration_s": "scans"}
    most_scans: ClassVar[int] = MOST_SCANS

    if TYPE_CHECKING:
        radar: Any
        scans: int | None
        duration_s: float | None

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = super().__get_pydantic_json_schema__(core_schema, handler)
        length = {"oneOf": [{"required": ["scans"]}, {"required": ["duration_s"]}]}
        return schema | {"allOf": [*schema.get("allOf", []), length]}

    @property
    def plots(self) -> int:
        """How many scans there are: as given, or to the last scan within the duration."""
        if self.duration_s is None:
            if self.scans is None:
                raise NotRead("scans")
            return self.scans
        return int(self.duration_s / self.radar.scan_period_s * (1 + 1e-12)) + 1

    @cross_check
    def _length_given(self) -> Iterator[At]:
        if self.scans is None and self.duration_s is None:
            yield at("scans", "required key is missing, or duration_s in its place")
        elif self.scans is not None and self.duration_s is not None:
            yield at("duration_s", "stands in place of scans: give one of them")
        elif not 2 <= self.plots <= self.most_scans:
            yield at("duration_s", f"must be 2 to {self.most_scans} scans of radar.scan_period_s, makes {self.plots}")


class Polynomial(Model):
    """A range that is a polynomial of time; up to the second degree it fits the filters' model exactly."""

    kind: Literal["polynomial"] = key("kind", "a polynomial of any degree up to 11")
    coefficients: Coefficients = key("derivatives of the range at the first plot", COEFFICIENTS)

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return polynomial_reach_m(self.coefficients, t)


def polynomial_reach_m(coefficients: tuple[float, ...], t: float) -> float:
    """A bound on the size of a polynomial up to a time t (s)."""
    return sum(abs(c) * t**i / math.factorial(i) for i, c in enumerate(coefficients))


class Starting(Model):
    """What targets that break the model share: a moment at which they do."""

    start_s: NonNegative = key("start time", "start time, counted from the first plot, s")


class AccelerationStart(Starting):
    """A polynomial that begins to accelerate (or brake) at a moment."""

    kind: Literal["acceleration_start"] = key("kind", "a constant acceleration that starts at a given time")
    coefficients: Coefficients = key("derivatives of the range at the first plot", COEFFICIENTS)
    acceleration_mps2: Annotated[Number, Field(ge=-HARDEST_MPS2, le=HARDEST_MPS2)] = key(
        "acceleration", "radial acceleration added from the start time on, m/s²", symbol="a"
    )

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return polynomial_reach_m(self.coefficients, t) + abs(self.acceleration_mps2) * t**2 / 2


class Turn(Starting):
    """Straight flight in a plane through the radar, a turn of constant load, straight flight again."""

    kind: Literal["turn"] = key("kind", "a turn of given g between two straight legs")
    range_m: Positive = key("range", "range at the first plot, m")
    speed_mps: Annotated[Positive, Field(le=FASTEST_MPS)] = key("speed", "speed, constant, m/s")
    aspect_rad: Number = key(
        "aspect angle", "direction of flight from the line of sight outwards, rad (pi: straight in)"
    )
    acceleration_g: Annotated[Number, Field(ge=-100, le=100)] = key(
        "acceleration",
        "lateral acceleration of the turn, standard gravities; positive: to the left",
        symbol="a",
        unit="g",
    )
    duration_s: Positive = key("duration", "duration of the turn, s")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return self.range_m + self.speed_mps * t

    def closest_m(self, t: float) -> float:
        """The least distance from the radar up to a time t (s): of two straight legs and of the arc between them."""
        begin, end = min(self.start_s, t), min(self.start_s + self.duration_s, t)
        rate = self.acceleration_g * STANDARD_GRAVITY_MPS2 / self.speed_mps
        x, y, heading = self.range_m, 0.0, self.aspect_rad
        nearest, x, y = straight_leg(x, y, heading, self.speed_mps * begin)
        if rate == 0:
            return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - begin))[0])
        radius = self.speed_mps / rate
        centre = (x - radius * math.sin(heading), y + radius * math.cos(heading))
        towards = math.atan2(-centre[1] / radius, -centre[0] / radius)  # of the point of the circle nearest the radar
        turned = (math.copysign(1.0, rate) * (towards + math.pi / 2 - heading)) % (2 * math.pi)
        if turned <= abs(rate) * (end - begin):
            nearest = min(nearest, abs(math.hypot(*centre) - abs(radius)))
        heading += rate * (end - begin)
        x, y = centre[0] + radius * math.sin(heading), centre[1] - radius * math.cos(heading)
        return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - end))[0])


def straight_leg(x: float, y: float, heading: float, length: float) -> tuple[float, float, float]:
    """The least distance from the origin along a straight leg from (x, y), and the point where it ends."""
    along = min(max(-(x * math.cos(heading) + y * math.sin(heading)), 0.0), length)
    nearest = math.hypot(x + along * math.cos(heading), y + along * math.sin(heading))
    return nearest, x + length * math.cos(heading), y + length * math.sin(heading)


class FlyBy(Model):
    """Straight flight at a constant speed past the radar, at a distance."""

    kind: Literal["fly_by"] = key("kind", "straight flight past the radar")
    distance_m: Annotated[Positive, Field(ge=NEAREST_M)] = key(
        "distance of closest approach", "distance of closest approach, m"
    )
    speed_mps: Annotated[Positive, Field(le=FASTEST_MPS)] = key("speed", "speed, constant, m/s")
    start_range_m: Positive = key("range at the first plot", "range at the first plot, before closest approach, m")

    @cross_check
    def _begins_outside(self) -> Iterator[At]:
        if self.start_range_m < self.distance_m:
            yield at("start_range_m", f"must be >= distance_m, {short(self.distance_m)}")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return self.start_range_m + self.speed_mps * t


class Recorded(Model):
    """A flight recorded in a file, smoothed by a spline whose derivatives are the true velocity and acceleration."""

    kind: Literal["recorded"] = key(
        "kind", "a flight from a CSV file with columns t_s, x_m, y_m, z_m, the radar at the origin"
    )
    file: Annotated[str, DataFile()] = key("file", "path of the file, relative to this one")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s): none is known here for the content of the file."""
        return 0.0


def within_reach(target: Any, radar: Radar, last: float) -> Iterator[At]:
    """The faults of a target that goes so far up to a time `last` (s) that its accuracies drown, or flies over."""
    finest = min(radar.sigma_range_m, radar.sigma_velocity_mps * radar.scan_period_s)
    farthest = min(FARTHEST_M, finest * RESOLVED)
    if target.reach_m(last) > farthest:
        so_far = f"must stay within {short(float(f'{farthest:.2g}'))} m of the radar up to the last plot"
        yield at("target", f"{so_far}, at {short(last)} s: beyond, double precision does not resolve its accuracies")
    elif isinstance(target, Turn) and target.closest_m(last) < NEAREST_M:
        yield at("target", f"must not fly over the radar: it comes within {short(NEAREST_M)} m of it")


# ---- rare ------------------------------------------------------------------------------------------------------------
# α_0, of the realisations that are drawn as they are: no weight is over ten, and the rare part keeps nine tenths.
PLAIN_SHARE = 0.1


class RareEvent(Model):
    """An event that is rare: realisations shifted towards it, and weights that make up for it."""

    @property
    def aimed_at(self) -> str | None:
        """The name of the filter or estimator whose event is sought; None where it is sought for all."""
        return None
