"""Values and keys of configs: scalars, the models and fields of all schemas, and keys that studies share.

Plain words of YAML: stricter than YAML 1.1 where that surprises (yes, 1:30, 010 and 1_000 are text), and wider where
that does (1e5 is a number).

A key carries its unit (`_m`, `_s`, `_mps`, `_mps2`, `_hz`, `_rad`). Wherever a key ends in `_rad`, its twin in `_deg`
is accepted as well (and `_degps` for `_radps`); the checked object holds radians only."""

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
    """The value of an unquoted word: a number, true, false, null, or the text itself."""
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
    """Convert a Python value as if it came from YAML; NumPy scalars and arrays become plain values."""
    if len(path) > DEEPEST:
        faults.spoil(origin, path[:3], f"nested more than {DEEPEST} deep")
        return None
    if hasattr(value, "tolist") and not isinstance(value, type):
        value = value.tolist()
    match value:
        case bool() | str():
            return value
        case int() | float():
            return _finite_number(value, path, origin, faults)
        case None:
            faults.spoil(origin, path, "has no value")
            return None
        case Mapping():
            return {str(k): from_python(v, (*path, str(k)), origin, faults) for k, v in value.items()}
        case list() | tuple():
            return [from_python(v, (*path, i), origin, faults) for i, v in enumerate(value)]
    faults.spoil(origin, path, "must be text, a number, true or false, a list or a mapping", value)
    return None


def _finite_number(value: float | int, path: KeyPath, origin: Origin, faults: Faults) -> float | int | None:
    """The number; None, with an error added, if it is not finite."""
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond the largest float
        finite = False
    if not finite:
        faults.spoil(origin, path, "must be a finite number", value)
        return None
    return value


# ---- fields ----------------------------------------------------------------------------------------------------------
ItemType = TypeVar("ItemType")
Value = TypeVar("Value")
CheckMethod = TypeVar("CheckMethod", bound=Callable[[Any], "Iterator[At]"])
LARGEST = 1e18  # of any number; far beyond any sea, sky or signal, and its square and cube are still finite
SMALLEST = 1e-18


class Display:
    """Marks a field that changes no number (a display name): it is no part of a case's identity nor of its noise."""


class Design:
    """Marks a field that designs filters or limits the observation: it is no part of the world nor of its noise."""


class Added:
    """Marks a key that earlier versions lacked. At its default, which keeps their behaviour, it is no part of a case's
    identity nor of its noise, so that both stay the same."""


class ColumnsOfOne:
    """Marks a field of rows of probabilities whose columns sum to one."""


@dataclass(frozen=True)
class NameIn:
    """Marks a field that names a member of a list; a case's identity has its index in the list instead."""

    field: str


class DataFile:
    """Marks a text field that names a data file, relative to the folder of its YAML file. The checked object holds a
    readable path; a case's identity has the content of the file instead."""


class Scenario:
    """Marks a field of a study that may name a file in scenarios/ by its stem."""

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        inline = handler(core_schema)
        return {"anyOf": [{"type": "string", "description": "stem of a file in scenarios/"}, inline]}


@dataclass(frozen=True)
class Only:
    """Marks a key that exists only for some values of other keys, such as a kind: {"kind": ("adaptive", "imm")}.

    default: its value there, if it is not given; needed: whether it is required there. Elsewhere it is refused."""

    where: Mapping[str, tuple[str, ...]]
    default: Any = None
    needed: bool = False


class NotRead(Exception):
    """A cross-check reads a field that is itself invalid, so that the check is impossible."""


class At(NamedTuple):
    """An error that a cross-check finds: the key, dotted if deeper, and the requirement."""

    key: str
    message: str


def at(key: str, message: str) -> At:
    """An error that a cross-check yields: `yield at("scans", "must be >= 3")`."""
    return At(key, message)


_CROSS_CHECK_METHODS: set[Callable[[Any], Iterator[At]]] = set()


def cross_check(method: CheckMethod) -> CheckMethod:
    """Marks a method of a model that yields the errors of fields that do not fit together.

    All cross-checks of a model run, in order, even if some fields are invalid: a check ends when it reads one of these.
    So independent checks are separate methods."""
    _CROSS_CHECK_METHODS.add(method)
    return method


def of_each(members: Iterable[ItemType], check: Callable[[int, ItemType], Iterator[At]]) -> Iterator[At]:
    """The errors of each member of a list, `check(i, member)`; an invalid field of one does not stop the others."""
    for i, member in enumerate(members):
        with suppress(NotRead):
            yield from check(i, member)


def readable(members: Iterable[ItemType], value: Callable[[ItemType], Value]) -> list[Value]:
    """The values of those members whose value is valid."""
    values = []
    for member in members:
        with suppress(NotRead):
            values.append(value(member))
    return values


class Model(BaseModel):
    """A frozen mapping of known keys; `_deg` twins are converted to radians before the check."""

    model_config = pydantic.ConfigDict(frozen=True, extra="forbid")

    def __init_subclass__(cls, **settings: Any) -> None:
        """Copy the class's keys before pydantic collects them.

        Several classes may share a key object. Before 2.11.7 pydantic adds the marks of each class to that object, so
        that a class would have the marks of all classes defined before it, and with them another identity."""
        super().__init_subclass__(**settings)
        plain_bases = (base for base in reversed(cls.__mro__) if base is cls or not issubclass(base, BaseModel))
        attributes = {name: value for base in plain_bases for name, value in vars(base).items()}
        for name, value in attributes.items():
            if isinstance(value, FieldInfo):
                setattr(cls, name, deepcopy(value, {id(value.default): value.default}))  # the default is kept as it is

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Raise ConfigError if a key is bound to values that no other key can have."""
        for name, mark in only_marks(cls).items():
            for key_beside, values in mark.where.items():
                error_start = f"{cls.__name__}.{name}: only: "
                if key_beside not in cls.model_fields:
                    raise ConfigError(
                        f"{error_start}no key {key_beside!r} is beside it; there are {', '.join(cls.model_fields)}"
                    )
                allowed = _allowed_texts(cls.model_fields[key_beside].annotation)
                if impossible_values := [value for value in values if allowed and value not in allowed]:
                    raise ConfigError(
                        f"{error_start}{key_beside} is one of {', '.join(allowed)}, got {', '.join(impossible_values)}"
                    )

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
    def _run_cross_checks(self) -> Self:
        misfits = list(self.misfits())
        if misfits:
            raise PydanticCustomError("at", "fields that do not go together", {"faults": misfits})
        return self

    @model_validator(mode="after")
    def _fill_defaults_of_kind(self) -> Self:
        missing_names = [name for name in only_marks(type(self)) if getattr(self, name) is None]
        defaults = {name: value for name in missing_names if (value := self._value_or_default(name)) is not None}
        return self.model_copy(update=defaults) if defaults else self

    def _value_or_default(self, name: str) -> Any:
        """The value of a key, or its default if the other keys call for it."""
        value, mark = getattr(self, name), only_marks(type(self)).get(name)
        if value is not None or mark is None:
            return value
        is_used = all(self._value_or_default(key) in values for key, values in mark.where.items())
        return mark.default if is_used else None

    def _check_kind(self, name: str, mark: Only) -> Iterator[At]:
        """The error of a key that the given kind refuses, or requires."""
        value, given_kinds = getattr(self, name), {key: self._value_or_default(key) for key in mark.where}
        wrong_key = next((key for key, values in mark.where.items() if given_kinds[key] not in values), None)
        if value is not None and wrong_key is not None:
            given_kind = "" if given_kinds[wrong_key] is None else f", not {given_kinds[wrong_key]}"
            yield at(name, f"belongs to {wrong_key}: {' or '.join(mark.where[wrong_key])}{given_kind}")
        elif value is None and wrong_key is None and mark.needed:
            yield at(name, "is needed by " + ", ".join(f"{key}: {kind}" for key, kind in given_kinds.items()))

    def misfits(self) -> Iterator[At]:
        """The errors of all cross-checks; a check that reads an invalid field ends there."""
        for name, mark in only_marks(type(self)).items():
            with suppress(NotRead):
                yield from self._check_kind(name, mark)
        for check in cross_check_methods(type(self)):
            with suppress(NotRead):
                yield from check(self)

    if not TYPE_CHECKING:  # a type checker would take any name for an attribute

        def __getattr__(self, name):
            if name in type(self).model_fields:  # a model without its invalid fields, see `check`
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
def only_marks(model: type[Model]) -> dict[str, Only]:
    """The marks of a model's keys that exist only for some kinds, by name."""
    marks = {
        name: [mark for mark in info.metadata if isinstance(mark, Only)] for name, info in model.model_fields.items()
    }
    return {name: marks_of_key[0] for name, marks_of_key in marks.items() if marks_of_key}


@cache
def cross_check_methods(model: type) -> tuple[Callable[[Any], Iterator[At]], ...]:
    """The cross-checks of a model, beginning with those of its base classes."""
    methods_by_name: dict[str, Callable[[Any], Iterator[At]]] = {}
    for base in reversed(model.__mro__):
        methods = {name: method for name, method in vars(base).items() if isinstance(method, FunctionType)}
        methods_by_name |= {name: method for name, method in methods.items() if method in _CROSS_CHECK_METHODS}
    return tuple(methods_by_name.values())


def _allowed_texts(annotation: Any) -> tuple[str, ...]:
    """The allowed texts of a key with listed values; empty for other keys."""
    values = [value for part in get_args(annotation) for value in (get_args(part) or (part,))]
    return tuple(value for value in values if isinstance(value, str))


def unknown_to(spec: Model, home: str) -> list[str]:
    """The dotted keys of a config that the code of a package cannot know: keys and values that a derived model of
    another package adds.

    home: the name of the package."""
    return list(_unknown_keys(spec, home, ""))


def _unknown_keys(spec: Model, home: str, prefix: str) -> Iterator[str]:
    """Those of `unknown_to` in a mapping whose own path is the prefix."""
    bases = type(spec).__mro__
    known_model = next(
        (item for item in bases if issubclass(item, Model) and _is_known_module(item.__module__, home)), Model
    )
    for name in type(spec).model_fields:
        value, key = getattr(spec, name), f"{prefix}{name}"
        info = known_model.model_fields.get(name)
        if info is None or not (known_model is bases[0] or _accepts(info, value)):
            yield key
            continue
        members = enumerate(value) if isinstance(value, tuple) else [(None, value)]
        for i, item in members:
            if isinstance(item, Model):
                yield from _unknown_keys(item, home, f"{key}." if i is None else f"{key}.{i}.")


def _is_known_module(module: str, home: str) -> bool:
    """Whether a package knows a module: its own, or radarsim's (for a study of radarsim that of the common keys)."""
    known_prefix = "radarsim.config." if home.startswith("radarsim.") else "radarsim."
    return f"{module}.".startswith((f"{home}.", known_prefix))


def _accepts(info: FieldInfo, value: Any) -> bool:
    """Whether a field accepts the value that another model has."""
    annotation: Any = Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
    try:
        pydantic.TypeAdapter(annotation).validate_python(value)
    except pydantic.ValidationError:
        return False
    return True


def in_degrees(key: str) -> str | None:
    """The twin in degrees of a key in radians; None for any other key."""
    return _unit_changed(key, "rad", "deg")


def in_radians(key: str) -> str | None:
    """The twin in radians of a key in degrees; None for any other key."""
    return _unit_changed(key, "deg", "rad")


def _unit_changed(key: str, unit: str, other_unit: str) -> str | None:
    match = re.fullmatch(rf"(.*)_{unit}(|ps|ps2)", key)
    return f"{match[1]}_{other_unit}{match[2]}" if match else None


def radians(value: Any) -> Any:
    """Convert degrees to radians, also within lists; what is no number is left for the check to refuse."""
    if isinstance(value, list):
        return [radians(item) for item in value]
    return math.radians(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _moderate(value: float) -> float:
    """A number whose size is between SMALLEST and LARGEST, or zero."""
    if abs(value) > LARGEST:
        raise PydanticCustomError("size", "must be at most 1e18 in size")
    if 0 < abs(value) < SMALLEST:
        raise PydanticCustomError("size", "must be at least 1e-18 in size")
    return value + 0.0  # no negative zero, which would be another identity


def _to_whole(value: Any) -> Any:
    """Convert a whole number written as 1e5; what is not whole is left for the check to refuse."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _printable(value: str) -> str:
    """Text that is printable on one line."""
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
Anything = Annotated[Any, pydantic.WithJsonSchema({})]


@dataclass(frozen=True)
class Whole:
    """Marks a whole number between bounds, which may be written as 1e5: `scans: Annotated[int, Whole(3, 100)]`."""

    least: int
    most: int

    def __get_pydantic_core_schema__(self, source: object, handler: pydantic.GetCoreSchemaHandler) -> CoreSchema:
        bounded = core_schema.int_schema(strict=True, ge=self.least, le=self.most)
        return core_schema.no_info_before_validator_function(_to_whole, bounded)


def whole(least: int, most: int) -> Any:
    """The type of a whole number between bounds, which may be written as 1e5."""
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
    """A key: its title, its description with unit, its default (without one it is required), and its symbol.

    unit: that of the value, if the name does not end in it. only: the values of other keys for which this key exists
    and its default holds; for others it is None. limits: further arguments of `pydantic.Field`."""
    extra: Any = {name: text for name, text in (("symbol", symbol), ("unit", unit)) if text is not None}
    field_default = default if only is None else None
    field = Field(field_default, title=title, description=about, json_schema_extra=extra or None, **limits)
    if only is not None:
        where = {name: (values,) if isinstance(values, str) else values for name, values in only.items()}
        field.metadata.append(Only(where, None if default is ... else default, default is ...))
    return field


class Study(Model):
    """The top-level keys of a study, beside the common ones.

    bare_keys: the list in whose members `sweep` and `--set` look for a bare key. figure_names: all figures that the
    report may draw, with * for what depends on the config; None if unknown: names under `figures` go unchecked.
    in_place_of: for each key, by its dotted name, the key that it replaces: where an override or a sweep sets the one,
    the other is removed.
    """

    bare_keys: ClassVar[str] = "filters"
    figure_names: ClassVar[tuple[str, ...] | None] = None
    in_place_of: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def carried(cls, study: str, data: Mapping[str, Any]) -> dict[str, Any] | None:
        """Convert the keys of another study's config, as read, to this study's: the same experiment as far as possible.

        Keys that this study lacks stay as they are, so that the check refuses them. None if it cannot convert."""
        return None

    @property
    def device(self) -> str | None:
        """The display name of the sensor: that of the first mapping with a name."""
        parts = (getattr(self, key) for key in type(self).model_fields)
        names = (dict(part).get("name") for part in parts if isinstance(part, Model))
        return next(filter(None, names), None)

    @property
    def members(self) -> tuple[Any, ...]:
        """The list of `bare_keys`: the filters of a case."""
        return getattr(self, self.bare_keys)

    @cross_check
    def _check_names(self) -> Iterator[At]:
        for field_name, field in type(self).model_fields.items():
            for mark in field.metadata:
                if isinstance(mark, NameIn) and getattr(self, field_name) is not None:
                    names = [member.name for member in getattr(self, mark.field)]
                    if getattr(self, field_name) not in names:
                        member_word = mark.field.removesuffix("s")
                        yield at(field_name, f"must be the name of a {member_word}: {', '.join(names)}")


def kinds_of(keys: type[Model]) -> tuple[str, ...]:
    """The allowed values of a model's key `kind`; for the keys of a study, those of its filters."""
    if issubclass(keys, Study):
        members = [
            member for member in annotation_parts(keys.model_fields[keys.bare_keys].annotation) if _is_model(member)
        ]
        return tuple(kind for member in members for kind in kinds_of(member))
    return get_args(keys.model_fields["kind"].annotation) if "kind" in keys.model_fields else ()


def _is_model(part: Any) -> bool:
    return isinstance(part, type) and issubclass(part, Model)


def widened(
    keys: type[Study],
    further_models: Mapping[str, type[Model]],
    unusable_reasons: Mapping[str, str],
    rebuild_arguments: tuple[Callable[[str], type[Study]], str],
) -> type[Study]:
    """The keys of a study whose filters may be of further kinds; a filter without a kind is the study's own.

    unusable_reasons: for each unusable kind the reason. rebuild_arguments: a function and its argument that return the
    same keys, by which a config is pickled."""
    info = keys.model_fields[keys.bare_keys]
    (own_model, _) = get_args(info.annotation)
    kinds = dict.fromkeys(kinds_of(own_model), own_model) | dict(further_models)
    first = next(iter(kinds))

    def kind_of(data: Any) -> Any:
        return data.get("kind", first) if isinstance(data, dict) else getattr(data, "kind", first)

    def check_kind(data: Any) -> Any:
        if (kind := kind_of(data)) not in list(kinds):  # which may compare something other than text
            reason = f"; {unusable_reasons[kind]}" if isinstance(kind, str) and kind in unusable_reasons else ""
            error_context = {"kinds": ", ".join(kinds), "reason": reason, "discriminator": "kind"}
            raise PydanticCustomError("no_such_kind", "must be one of {kinds}{reason}", error_context)
        return data

    tagged_models = tuple(Annotated[model, pydantic.Tag(f"kind: {kind}")] for kind, model in kinds.items())
    union: Any = typing.Union[tagged_models]  # noqa: UP007
    choice: Any = Annotated[
        union, pydantic.Discriminator(lambda data: f"kind: {kind_of(data)}"), pydantic.BeforeValidator(check_kind)
    ]
    members: Any = (tuple[choice, ...], info)
    new_keys: Any = pydantic.create_model(
        keys.__name__, __base__=keys, __module__=keys.__module__, __doc__=keys.__doc__, **{keys.bare_keys: members}
    )
    new_keys.__reduce__ = lambda self: (_rebuild_keys, (*rebuild_arguments, dict(self), self.model_fields_set))
    return cast(type[Study], new_keys)


def _rebuild_keys(find: Callable[..., type[Study]], name: str, values: dict[str, Any], given_names: set[str]) -> Study:
    return find(name).model_construct(given_names, **values)


class HasName(Protocol):
    """A member of a list with a name."""

    @property
    def name(self) -> str: ...


NamedMember = TypeVar("NamedMember", bound=HasName)


def unique_names(members: tuple[NamedMember, ...]) -> tuple[NamedMember, ...]:
    """Check that the members of a list have different names; for AfterValidator."""
    names: set[str] = set()
    for member in members:
        name = unicodedata.normalize("NFC", member.name)  # names that look alike are equal
        if name in names:
            raise PydanticCustomError("unique", "names must differ: {name} is there twice", {"name": member.name})
        names.add(name)
    return members


# For most studies: the filters that are compared, and the name of the one that gains are relative to.
Members = Annotated[tuple[NamedMember, ...], Field(min_length=1, max_length=16), AfterValidator(unique_names), Design()]
Baseline = Annotated[Name | None, Design(), NameIn("filters")]
BASELINE = key(
    "baseline filter", "filter against which gains are computed, or a list of several; default: the first", None
)
# For `Lasting` studies: the length of a run.
SCANS = key("number of scans", "number of scans; or give duration_s", None)
DURATION = key(
    "duration", "time from the first scan to the last, s, in place of scans: to the last scan within it", None
)


class Member(Model):
    """A member of a list whose members differ by their names."""

    name: Annotated[Name, Display()] = key("name", "label; every filter has its own")


def keys_of(
    name: str, module: str, parts: Mapping[str, type[Model]], filters: type[Member], max_scans: int
) -> type[Study]:
    """The keys of a study: these mappings by name, and `filters`, `baseline` and `scans`.

    name, module: those of the class."""
    descriptions = {name: (part.__doc__ or name).strip().partition("\n")[0].rstrip(".") for name, part in parts.items()}
    fields: Any = {name: (part, key(name.replace("_", " "), descriptions[name])) for name, part in parts.items()}
    fields |= {
        "filters": (Members[filters], key("filters", "the filters; all see the same world")),  # type: ignore[valid-type]
        "baseline": (Baseline, BASELINE),
        "scans": (Annotated[int, Whole(2, max_scans), Design()], key("number of scans", "number of plots")),
    }
    study_keys: type[Study] = pydantic.create_model(name, __base__=Study, __module__=module, **fields)
    return study_keys


# ---- numeric ---------------------------------------------------------------------------------------------------------
MAX_SUGGESTED_KEYS = 5  # that begin with an unknown name: all are suggested


@dataclass(frozen=True)
class NumericKey:
    """A key with a number, as `--set` names it.

    value: None if the key is optional and not given. low, high: the limits that the schema sets, in the key's unit
    (infinite if there is none). whole: whether only whole numbers are allowed."""

    path: str
    value: float | None
    low: float
    high: float
    whole: bool


def keys(spec: Study) -> list[NumericKey]:
    """All numeric keys of a case, in the order of its schema, with items of lists by index."""
    return list(_keys_within(spec, ()))


def _keys_within(model: Model, path: tuple[str | int, ...]) -> Iterator[NumericKey]:
    """The numeric keys of a mapping at a path."""
    for name, info in type(model).model_fields.items():
        yield from _keys_at(getattr(model, name), (*path, name), [info.annotation, *info.metadata])


def _keys_at(value: Any, path: tuple[str | int, ...], allowed: Any) -> Iterator[NumericKey]:
    """The numeric keys at and below a value; allowed: its annotation with its marks."""
    if isinstance(value, Model):
        yield from _keys_within(value, path)
    elif isinstance(value, tuple | list):
        for i, item in enumerate(value):
            yield from _keys_at(item, (*path, i), allowed)
    elif (_is_number(value) and not _is_choice(allowed)) or (value is None and _takes_numbers(allowed)):
        low, high, is_whole = _bounds(allowed)
        yield NumericKey(dotted(path), value, low, high, is_whole)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def annotation_parts(annotation: Any) -> Iterator[Any]:
    """An annotation and all its parts: the members of a choice, the items of a list, the marks."""
    yield annotation
    for inner in annotation if isinstance(annotation, list) else get_args(annotation):
        yield from annotation_parts(inner)
    yield from getattr(annotation, "metadata", ()) if not isinstance(annotation, type) else ()


def _is_choice(allowed: Any) -> bool:
    """Whether only listed values are allowed."""
    return any(typing.get_origin(part) is Literal for part in annotation_parts(allowed))


def _takes_numbers(allowed: Any) -> bool:
    """Whether numbers are allowed."""
    return any(part in (int, float) for part in annotation_parts(allowed))


def _bounds(allowed: Any) -> tuple[float, float, bool]:
    """Lower and upper bound of an annotation, and whether it allows only whole numbers."""
    low, high, is_whole = -math.inf, math.inf, False
    for part in annotation_parts(allowed):
        if isinstance(part, Whole):
            low, high, is_whole = max(low, part.least), min(high, part.most), True
        low = max([low, *_limits_named(part, "gt", "ge")])
        high = min([high, *_limits_named(part, "lt", "le")])
    return low, high, is_whole


def _limits_named(part: Any, *names: str) -> list[float]:
    """The limits with these names in a mark."""
    limits = [getattr(part, name, None) for name in names]
    return [float(limit) for limit in limits if isinstance(limit, int | float)]


def find(spec: Study, name: str) -> tuple[NumericKey, ...]:
    """The numeric keys that a name means: one for a full path, one in each filter that has it for a bare filter key.

    A `_deg` name means its `_rad` twin, with value and bounds in degrees. Raises ConfigError with the nearest name."""
    known_keys = keys(spec)
    path, _, last_part = name.rpartition(".")
    radian_name = in_radians(last_part)
    wanted_path = f"{path}.{radian_name}".removeprefix(".") if radian_name else name
    member_prefix = f"{type(spec).bare_keys}."
    matching_keys = [key for key in known_keys if key.path == wanted_path] or [
        key for key in known_keys if key.path.startswith(member_prefix) and key.path.split(".", 2)[-1] == wanted_path
    ]
    if not matching_keys:
        paths = [key.path for key in known_keys]
        bare_names = [path.split(".", 2)[-1] for path in paths if path.startswith(member_prefix)]
        degree_names = [
            f"{stem}{degree_name}" for path in paths for stem, degree_name in [_split_degrees(path)] if degree_name
        ]
        raise ConfigError(
            f"{name}: {_unknown_key_message(name, spec, list(dict.fromkeys([*paths, *bare_names, *degree_names])))}"
        )
    if radian_name:
        matching_keys = [_key_in_degrees(key, name) for key in matching_keys]
    return tuple(matching_keys)


def _split_degrees(path: str) -> tuple[str, str | None]:
    """The path before the last key, and the twin in degrees of that key, if it has one."""
    head, dot, last = path.rpartition(".")
    return head + dot, in_degrees(last)


def _key_in_degrees(key: NumericKey, name: str) -> NumericKey:
    """A key in radians under its name in degrees."""
    value = None if key.value is None else math.degrees(key.value)
    head = key.path.rpartition(".")[0]
    path = f"{head}.{name.rpartition('.')[2]}".removeprefix(".")
    return NumericKey(path, value, math.degrees(key.low), math.degrees(key.high), key.whole)


def _unknown_key_message(name: str, spec: Study, known_names: list[str]) -> str:
    """The message that a name is no numeric key, with what may be meant."""
    value: Any = spec
    for step in name.split("."):
        if isinstance(value, Model) and step in type(value).model_fields:
            value = getattr(value, step)
        elif isinstance(value, tuple) and step.isdecimal() and int(step) < len(value):
            value = value[int(step)]
        else:
            suggestion = _suggest_by_beginning(name, known_names) or did_you_mean(name, known_names)
            suggestion = suggestion or _suggest_by_last_part(name, known_names)
            group = "" if suggestion and "." not in name else _keys_in_group(name, known_names)
            return f"unknown key{suggestion}{group}"
    return "holds no number, and only a number can be solved for"


def _suggest_by_beginning(name: str, known_names: list[str]) -> str:
    """Suggest all keys that begin with a name, if they are few."""
    matching_names = [path for path in known_names if len(name) > 2 and path.startswith(name)]
    return f"; did you mean {' or '.join(matching_names)}?" if 1 < len(matching_names) <= MAX_SUGGESTED_KEYS else ""


def _keys_in_group(name: str, known_names: list[str]) -> str:
    """List the keys of the group that a name begins with, or else all groups and single keys."""
    group = name.rpartition(".")[0]
    while group and not any(path.startswith(f"{group}.") for path in known_names):
        group = group.rpartition(".")[0]
    names_inside = [
        path[len(group) + 1 if group else 0 :] for path in known_names if not group or path.startswith(f"{group}.")
    ]
    parts = dict.fromkeys(f"{path.partition('.')[0]}." if "." in path else path for path in names_inside)
    return f"; {group or 'there'} {'has' if group else 'are'} {', '.join(parts)}"


def _suggest_by_last_part(name: str, known_names: list[str]) -> str:
    """Suggest a key whose last part is that of the name or nearly so: the path before it is wrong or missing."""
    paths_by_last_part = {path.rpartition(".")[2]: path for path in reversed(known_names)}
    suggestion = did_you_mean(name.rpartition(".")[2], list(paths_by_last_part))
    suggestion = suggestion.removeprefix("; did you mean ").removesuffix("?")
    return f"; did you mean {paths_by_last_part[suggestion]}?" if suggestion else ""


# ---- radial ----------------------------------------------------------------------------------------------------------
MOST_SCANS = 100_000
FARTHEST_M = 1e15  # the largest range at which double precision resolves a metre
RESOLVED = 1e-4 * 2.0**52  # range over accuracy at which rounding is a ten-thousandth of the accuracy
NEAREST_M = 100.0  # a target that flies over the radar has no radial motion that a filter could follow
FASTEST_MPS = 12_000.0  # the escape velocity from the Earth
HARDEST_MPS2 = 1000.0  # about 100 g, more than any missile reaches

Coefficients = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]
COEFFICIENTS = "derivatives of range at the first plot: m, m/s, m/s², … (the sum of c_i t^i / i!)"


class InBand(Model):
    """What lies in a wave band: its wavelength must."""

    if TYPE_CHECKING:
        band: Band | None
        wavelength_m: float

    @cross_check
    def _check_band(self) -> Iterator[At]:
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
        """The number of scans: as given, or up to the last scan within the duration."""
        if self.duration_s is None:
            if self.scans is None:
                raise NotRead("scans")
            return self.scans
        return int(self.duration_s / self.radar.scan_period_s * (1 + 1e-12)) + 1

    @cross_check
    def _check_length(self) -> Iterator[At]:
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
        """The shortest distance to the radar up to a time t (s), over both straight legs and the arc between them."""
        turn_start, turn_end = min(self.start_s, t), min(self.start_s + self.duration_s, t)
        rate = self.acceleration_g * STANDARD_GRAVITY_MPS2 / self.speed_mps
        x, y, heading = self.range_m, 0.0, self.aspect_rad
        nearest, x, y = straight_leg(x, y, heading, self.speed_mps * turn_start)
        if rate == 0:
            return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - turn_start))[0])
        radius = self.speed_mps / rate
        centre = (x - radius * math.sin(heading), y + radius * math.cos(heading))
        # The direction, from the centre of the circle, of its point nearest to the radar.
        nearest_direction = math.atan2(-centre[1] / radius, -centre[0] / radius)
        turned_angle = (math.copysign(1.0, rate) * (nearest_direction + math.pi / 2 - heading)) % (2 * math.pi)
        if turned_angle <= abs(rate) * (turn_end - turn_start):
            nearest = min(nearest, abs(math.hypot(*centre) - abs(radius)))
        heading += rate * (turn_end - turn_start)
        x, y = centre[0] + radius * math.sin(heading), centre[1] - radius * math.cos(heading)
        return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - turn_end))[0])


def straight_leg(x: float, y: float, heading: float, length: float) -> tuple[float, float, float]:
    """The shortest distance to the origin along a straight leg from (x, y), and the end of the leg."""
    along_m = min(max(-(x * math.cos(heading) + y * math.sin(heading)), 0.0), length)
    nearest_m = math.hypot(x + along_m * math.cos(heading), y + along_m * math.sin(heading))
    return nearest_m, x + length * math.cos(heading), y + length * math.sin(heading)


class FlyBy(Model):
    """Straight flight at a constant speed past the radar, at a distance."""

    kind: Literal["fly_by"] = key("kind", "straight flight past the radar")
    distance_m: Annotated[Positive, Field(ge=NEAREST_M)] = key(
        "distance of closest approach", "distance of closest approach, m"
    )
    speed_mps: Annotated[Positive, Field(le=FASTEST_MPS)] = key("speed", "speed, constant, m/s")
    start_range_m: Positive = key("range at the first plot", "range at the first plot, before closest approach, m")

    @cross_check
    def _check_start_range(self) -> Iterator[At]:
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
        """A bound on the range up to a time t (s): zero, as the content of the file is unknown here."""
        return 0.0


def within_reach(target: Any, radar: Radar, last_s: float) -> Iterator[At]:
    """The errors of a target that up to a time (s) flies too far for double precision, or over the radar."""
    smallest_sigma_m = min(radar.sigma_range_m, radar.sigma_velocity_mps * radar.scan_period_s)
    max_range_m = min(FARTHEST_M, smallest_sigma_m * RESOLVED)
    if target.reach_m(last_s) > max_range_m:
        requirement = f"must stay within {short(float(f'{max_range_m:.2g}'))} m of the radar up to the last plot"
        yield at(
            "target", f"{requirement}, at {short(last_s)} s: beyond, double precision does not resolve its accuracies"
        )
    elif isinstance(target, Turn) and target.closest_m(last_s) < NEAREST_M:
        yield at("target", f"must not fly over the radar: it comes within {short(NEAREST_M)} m of it")


# ---- rare ------------------------------------------------------------------------------------------------------------
# α_0, the share of realisations that are drawn without a shift: so no weight exceeds ten, and nine tenths are shifted.
PLAIN_SHARE = 0.1


class RareEvent(Model):
    """An event that is rare: realisations shifted towards it, and weights that make up for it."""

    @property
    def aimed_at(self) -> str | None:
        """The filter or estimator whose event is sought; None if that of all is."""
        return None
