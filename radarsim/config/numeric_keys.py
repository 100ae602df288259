"""The numeric keys of a checked config: their places, values and limits."""

import math
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from radarsim.config.find_files import did_you_mean
from radarsim.config.key_types import WholeNumber
from radarsim.config.model import Model, annotation_parts, in_degrees, in_radians
from radarsim.config.study_keys import StudyKeys
from radarsim.config.value_text import dotted
from radarsim.errors import ConfigError

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
    is_whole: bool


def numeric_keys(spec: StudyKeys) -> list[NumericKey]:
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
        if isinstance(part, WholeNumber):
            low, high, is_whole = max(low, part.minimum), min(high, part.maximum), True
        low = max([low, *_limits_named(part, "gt", "ge")])
        high = min([high, *_limits_named(part, "lt", "le")])
    return low, high, is_whole


def _limits_named(part: Any, *names: str) -> list[float]:
    """The limits with these names in a mark."""
    limits = [getattr(part, name, None) for name in names]
    return [float(limit) for limit in limits if isinstance(limit, int | float)]


def find_numeric_keys(spec: StudyKeys, name: str) -> tuple[NumericKey, ...]:
    """The numeric keys that a name means: one for a full path, one in each filter that has it for a bare filter key.

    A `_deg` name means its `_rad` twin, with value and bounds in degrees. Raises ConfigError with the nearest name."""
    known_keys = numeric_keys(spec)
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
    return NumericKey(path, value, math.degrees(key.low), math.degrees(key.high), key.is_whole)


def _unknown_key_message(name: str, spec: StudyKeys, known_names: list[str]) -> str:
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
