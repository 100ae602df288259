"""Parts that the schemas of all studies are made of: the frozen model, numbers with their limits, and marks on fields.

A key carries its unit (`_m`, `_s`, `_mps`, `_mps2`, `_hz`, `_rad`). Wherever a key ends in `_rad`, its twin in `_deg`
is understood as well (and `_degps` for `_radps`); the checked object holds radians only.
"""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    Strict,
    StringConstraints,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

LARGEST = 1e18  # of any number; far beyond any sea, sky or signal, and its square and cube are still finite
SMALLEST = 1e-18


class Display:
    """Mark of a field that changes no number (a display name): left out of a case's identity and of its noise."""


class Design:
    """Mark of a field that designs filters or says how long to look: no part of the world nor of its noise's key."""


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

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: GetJsonSchemaHandler) -> dict:
        inline = handler(core_schema)
        return {"anyOf": [{"type": "string", "description": "stem of a file in scenarios/"}, inline]}


def at(key: str, message: str) -> PydanticCustomError:
    """A fault to raise in a model's validator about a key, dotted if deeper: `raise at("scans", "must be >= 3")`."""
    return PydanticCustomError("at", "{message}", {"key": key, "message": message})


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

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict:
        schema = handler.resolve_ref_schema(handler(core_schema))
        for name in [name for name in schema.get("properties", {}) if in_degrees(name)]:
            twin = in_degrees(name)
            about = schema["properties"][name].get("description", "")
            schema["properties"][twin] = {"description": f"in degrees, in place of {name}: {about}"}
            if name in schema.get("required", ()):
                schema["required"].remove(name)
                schema.setdefault("allOf", []).append({"oneOf": [{"required": [name]}, {"required": [twin]}]})
        return schema


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


Number = Annotated[float, Strict(), AfterValidator(_moderate)]
Positive = Annotated[float, Strict(), Field(gt=0), AfterValidator(_moderate)]
NonNegative = Annotated[float, Strict(), Field(ge=0), AfterValidator(_moderate)]
Probability = Annotated[float, Strict(), Field(ge=0, le=1), AfterValidator(_moderate)]
Correlation = Annotated[float, Strict(), Field(gt=-1, lt=1), AfterValidator(_moderate)]
Flag = Annotated[bool, Strict()]
Name = Annotated[str, Strict(), StringConstraints(min_length=1, max_length=64), AfterValidator(_printable)]
Stem = Annotated[str, Strict(), StringConstraints(min_length=1, max_length=100)]
Anything = Annotated[Any, WithJsonSchema({})]


def whole(least: int, most: int) -> Any:
    """A whole number between bounds; 1e5 is one."""
    return Annotated[int, Strict(), Field(ge=least, le=most), BeforeValidator(_whole)]


class Study(Model):
    """A study's own top-level keys, beside the common ones.

    bare_keys names the list whose members a bare key of `sweep` and `--set` speaks to.
    """

    bare_keys: ClassVar[str] = "filters"


def unique_names(members: tuple[Any, ...]) -> tuple[Any, ...]:
    """Check that no two members of a list have the same name; for AfterValidator."""
    seen: set[str] = set()
    for member in members:
        if member.name in seen:
            raise PydanticCustomError("unique", "names must differ: {name} is there twice", {"name": member.name})
        seen.add(member.name)
    return members
