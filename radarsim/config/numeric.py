"""The numeric keys of a checked config: where each stands, its value, and what it may be."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from radarsim.config.faults import dotted
from radarsim.config.fields import Model, Study, Whole, in_degrees, in_radians
from radarsim.config.lookup import did_you_mean
from radarsim.errors import ConfigError

MOST_NAMED = 5  # keys that begin as a mistaken name does and are all suggested


@dataclass(frozen=True)
class NumericKey:
    """A key that holds a number, as `--set` names it.

    value is None where the key is optional and not given. low and high bound what the schema alone allows (infinite
    where it does not), in the key's unit; whole: only whole numbers are.
    """

    path: str
    value: float | None
    low: float
    high: float
    whole: bool


def keys(spec: Study) -> list[NumericKey]:
    """Every key of a case that holds a number, in the order of its schema, items of lists by their place."""
    return list(_within(spec, ()))


def _within(model: Model, path: tuple[str | int, ...]) -> Iterator[NumericKey]:
    for name, info in type(model).model_fields.items():
        yield from _at(getattr(model, name), (*path, name), [info.annotation, *info.metadata])


def _at(value: Any, path: tuple[str | int, ...], allowed: Any) -> Iterator[NumericKey]:
    """The keys at and below a value, of which `allowed` is the annotation and its marks."""
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
    """An annotation and all that it is made of: members of a choice, items of a list, marks."""
    yield annotation
    for inner in annotation if isinstance(annotation, list) else get_args(annotation):
        yield from _parts(inner)
    yield from getattr(annotation, "metadata", ()) if not isinstance(annotation, type) else ()


def _is_choice(allowed: Any) -> bool:
    """Whether only listed values are allowed, numbers though they are."""
    return any(get_origin(part) is Literal for part in _parts(allowed))


def _takes_numbers(allowed: Any) -> bool:
    return any(part in (int, float) for part in _parts(allowed))


def _bounds(allowed: Any) -> tuple[float, float, bool]:
    """Least and greatest value, and whether only whole ones, that the marks of an annotation allow."""
    low, high, whole = -math.inf, math.inf, False
    for part in _parts(allowed):
        if isinstance(part, Whole):
            low, high, whole = max(low, part.least), min(high, part.most), True
        low = max([low, *_limits(part, "gt", "ge")])
        high = min([high, *_limits(part, "lt", "le")])
    return low, high, whole


def _limits(part: Any, *names: str) -> list[float]:
    """The limits of these names that a mark holds."""
    held = [getattr(part, name, None) for name in names]
    return [float(one) for one in held if isinstance(one, int | float)]


def find(spec: Study, name: str) -> tuple[NumericKey, ...]:
    """The numeric keys that a name means: one by its full path; of a bare filter key one in every filter that has it.

    A `_deg` name means its `_rad` twin, value and bounds in degrees. Raises ConfigError, with the nearest known name.
    """
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
    """Why a name means no numeric key."""
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
    """A suggestion of all the keys that begin as a name does, where they are a few."""
    begun = [path for path in known if len(name) > 2 and path.startswith(name)]
    return f"; did you mean {' or '.join(begun)}?" if 1 < len(begun) <= MOST_NAMED else ""


def _in_group(name: str, known: list[str]) -> str:
    """What there is in the group of a name, or which groups and single keys there are."""
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
