"""The frozen model that all schemas derive from.

A key carries its unit (`_m`, `_s`, `_mps`, `_mps2`, `_hz`, `_rad`). Wherever a key ends in `_rad`, its twin in `_deg`
is accepted as well (and `_degps` for `_radps`); the checked object holds radians only."""

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from functools import cache
from typing import TYPE_CHECKING, Any, Self, get_args

import pydantic
from pydantic import BaseModel, GetJsonSchemaHandler, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from radarsim.config.cross_checks import CheckError, InvalidFieldError, check_error, cross_check_methods
from radarsim.config.marks import OnlyForMark
from radarsim.errors import ConfigError


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
            for key_beside, values in mark.allowed_values.items():
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
            raise PydanticCustomError("cross_check", "fields that do not go together", {"faults": misfits})
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
        is_used = all(self._value_or_default(key) in values for key, values in mark.allowed_values.items())
        return mark.default if is_used else None

    def _check_kind(self, name: str, mark: OnlyForMark) -> Iterator[CheckError]:
        """The error of a key that the given kind refuses, or requires."""
        value, given_kinds = getattr(self, name), {key: self._value_or_default(key) for key in mark.allowed_values}
        wrong_key = next((key for key, values in mark.allowed_values.items() if given_kinds[key] not in values), None)
        if value is not None and wrong_key is not None:
            given_kind = "" if given_kinds[wrong_key] is None else f", not {given_kinds[wrong_key]}"
            yield check_error(
                name, f"belongs to {wrong_key}: {' or '.join(mark.allowed_values[wrong_key])}{given_kind}"
            )
        elif value is None and wrong_key is None and mark.is_required:
            yield check_error(name, "is needed by " + ", ".join(f"{key}: {kind}" for key, kind in given_kinds.items()))

    def misfits(self) -> Iterator[CheckError]:
        """The errors of all cross-checks; a check that reads an invalid field ends there."""
        for name, mark in only_marks(type(self)).items():
            with suppress(InvalidFieldError):
                yield from self._check_kind(name, mark)
        for check in cross_check_methods(type(self)):
            with suppress(InvalidFieldError):
                yield from check(self)

    if not TYPE_CHECKING:  # a type checker would take any name for an attribute

        def __getattr__(self, name):
            if name in type(self).model_fields:  # a model without its invalid fields, see `check`
                raise InvalidFieldError(name)
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
def only_marks(model: type[Model]) -> dict[str, OnlyForMark]:
    """The marks of a model's keys that exist only for some kinds, by name."""
    marks = {
        name: [mark for mark in info.metadata if isinstance(mark, OnlyForMark)]
        for name, info in model.model_fields.items()
    }
    return {name: marks_of_key[0] for name, marks_of_key in marks.items() if marks_of_key}


def _allowed_texts(annotation: Any) -> tuple[str, ...]:
    """The allowed texts of a key with listed values; empty for other keys."""
    values = [value for part in get_args(annotation) for value in (get_args(part) or (part,))]
    return tuple(value for value in values if isinstance(value, str))


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


def annotation_parts(annotation: Any) -> Iterator[Any]:
    """An annotation and all its parts: the members of a choice, the items of a list, the marks."""
    yield annotation
    for inner in annotation if isinstance(annotation, list) else get_args(annotation):
        yield from annotation_parts(inner)
    yield from getattr(annotation, "metadata", ()) if not isinstance(annotation, type) else ()
