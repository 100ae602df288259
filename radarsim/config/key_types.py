"""The types of keys, with their limits, and the definition of a key."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

import pydantic
from pydantic import AfterValidator, BeforeValidator, Field, Strict, StringConstraints
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from radarsim.config.marks import OnlyForMark, ProcessNoiseMark

Item = TypeVar("Item")

LARGEST = 1e18  # of any number; far beyond any sea, sky or signal, and its square and cube are still finite
SMALLEST = 1e-18
PLAIN_NAME = re.compile(r"\w[\w-]*")


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


def _plain_name(value: str) -> str:
    if not PLAIN_NAME.fullmatch(value):
        raise PydanticCustomError("plain_name", "must be of letters, digits, _ and -")
    return value


def _number_or_name(value: Any) -> str:
    """A whole number as text, or a plain name."""
    text = str(value) if isinstance(value, int) and not isinstance(value, bool) else value
    if not isinstance(text, str) or not PLAIN_NAME.fullmatch(text):
        raise PydanticCustomError("plain_name", "must be a whole number, or letters and digits, as 3 or 3a")
    return text


def _one_line(value: str) -> str:
    if not value.isprintable():
        raise PydanticCustomError("text", "must be printable text on one line")
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
PlainName = Annotated[Name, AfterValidator(_plain_name)]
NumberOrName = Annotated[str, BeforeValidator(_number_or_name)]
NonEmpty = Annotated[str, Strict(), StringConstraints(min_length=1)]
Line = Annotated[str, Strict(), AfterValidator(_one_line)]
NonEmptyTuple = Annotated[tuple[Item, ...], Field(min_length=1)]
Anything = Annotated[Any, pydantic.WithJsonSchema({})]


@dataclass(frozen=True)
class WholeNumber:
    """Marks a whole number between bounds, which may be written as 1e5: `scans: Annotated[int, Whole(3, 100)]`."""

    minimum: int
    maximum: int

    def __get_pydantic_core_schema__(self, source: object, handler: pydantic.GetCoreSchemaHandler) -> CoreSchema:
        bounded = core_schema.int_schema(strict=True, ge=self.minimum, le=self.maximum)
        return core_schema.no_info_before_validator_function(_to_whole, bounded)


def whole_number(minimum: int, maximum: int) -> Any:
    """The type of a whole number between bounds, which may be written as 1e5."""
    return Annotated[int, WholeNumber(minimum, maximum)]


def key(
    title: str,
    about: str,
    default: Any = ...,
    *,
    symbol: str | None = None,
    unit: str | None = None,
    only: Mapping[str, str | tuple[str, ...]] | None = None,
    process_noise: bool = False,
    **limits: Any,
) -> Any:
    """A key: its title, its description with unit, its default (without one it is required), and its symbol.

    unit: that of the value, if the name does not end in it. only: the values of other keys for which this key exists
    and its default holds; for others it is None. process_noise: whether the answer names the best of several values,
    and what is gained with each filter at its best. limits: further arguments of `pydantic.Field`."""
    extra: Any = {name: text for name, text in (("symbol", symbol), ("unit", unit)) if text is not None}
    field_default = default if only is None else None
    field = Field(field_default, title=title, description=about, json_schema_extra=extra or None, **limits)
    if only is not None:
        where = {name: (values,) if isinstance(values, str) else values for name, values in only.items()}
        field.metadata.append(OnlyForMark(where, None if default is ... else default, default is ...))
    if process_noise:
        field.metadata.append(ProcessNoiseMark())
    return field
