"""A config of one's own to begin with: a known one written again, each key with its meaning beside it."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic_core import PydanticUndefined

from radarsim.config.check import models_in
from radarsim.config.faults import short
from radarsim.config.fields import Model, in_radians
from radarsim.config.schema import COMMON_KEYS, Common

PLAIN = re.compile(r"[A-Za-z_][\w+ .*-]*")  # text that YAML reads as text without quotes
RESERVED = {"true", "false", "null", "yes", "no", "on", "off", "none"}
COLUMN = 44  # at which comments begin
WIDTH = 110
DEGREES = {"rad": "degrees", "rad/s": "degrees per second"}


def starter(data: Mapping[str, Any], study_keys: type[Model], name: str, like: str) -> str:
    """YAML of a config's data (as read, keys as written) under a new name, each key with the schema's description.

    Optional keys that are not given follow, commented out, with their defaults.
    """
    lines = [
        f"# {name}.yaml — like {like}: change the numbers, then `radarsim run {name}.yaml`",
        "# Units stand in the keys: _m, _s, _mps (m/s), _mps2 (m/s²), _hz, _rad; _deg is taken wherever _rad is.",
    ]
    common = {key: value for key, value in data.items() if key in COMMON_KEYS}
    own = {key: value for key, value in data.items() if key not in COMMON_KEYS}
    # What has a display name (a radar, a sensor) is called as the config is.
    named = {key: value for key, value in own.items() if isinstance(value, Mapping) and "name" in value}
    own |= {key: {**value, "name": name} for key, value in named.items()}
    for key in ("study", "include"):
        if key in common:
            lines += _entry(key, common.pop(key), Common, "")
    if own:
        lines += _mapping(own, study_keys, "", optional=True)
    lines += [line for key, value in common.items() for line in _entry(key, value, Common, "")]
    missing = [key for key in ("sweep", "realisations", "seed") if key not in data]
    samples = {"sweep": "{some_key: [1, 2, 3]}", "realisations": "1e5", "seed": "1"}
    lines += [_line(f"# {key}: {samples[key]}", _about(Common, key)) for key in missing]
    return "\n".join(lines) + "\n"


def _mapping(data: Mapping[str, Any], model: type[Model] | None, indent: str, optional: bool) -> list[str]:
    """The lines of a mapping, and of the optional keys it lacks."""
    lines = [line for key, value in data.items() for line in _entry(key, value, model, indent)]
    if optional and model is not None:
        given = {in_radians(key) or key for key in data} | set(data)
        for key, field in model.model_fields.items():
            default = field.default
            if key not in given and default is not PydanticUndefined:
                value = "…" if default is None or isinstance(default, Model) or default in ((), {}) else flow(default)
                lines.append(_line(f"{indent}# {key}: {value}", _about(model, key)))
    return lines


def _entry(key: str, value: object, model: type[Model] | None, indent: str) -> list[str]:
    """The lines of one key: short values beside it, mappings and lists of mappings below."""
    about, inner = _about(model, key), _inner(model, key, value)
    if isinstance(value, Mapping) and inner is not None and key != "sweep":
        return [_line(f"{indent}{key}:", about), *_mapping(value, inner, indent + "  ", optional=True)]
    if isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
        lines = [_line(f"{indent}{key}:", about)]
        if inner is not None:
            used = list(dict.fromkeys(name for one in value for name in one))
            lines += [f"{indent}  # {name}: {_about(inner, name)}" for name in used if _about(inner, name)]
        return [*lines, *(line for one in value for line in _item(one, indent))]
    return [_line(f"{indent}{key}: {flow(value)}", about)]


def _item(one: Mapping[str, Any], indent: str) -> Iterator[str]:
    """A mapping of a list: in one line where it fits, else a key a line."""
    whole = f"{indent}  - {flow(one)}"
    if len(whole) <= WIDTH:
        yield whole
        return
    for n, (key, value) in enumerate(one.items()):
        yield f"{indent}  {'-' if n == 0 else ' '} {key}: {flow(value)}"


def _line(text: str, about: str) -> str:
    return f"{text:<{COLUMN}}  # {about}" if about else text


def _about(model: type[Model] | None, key: str) -> str:
    """The schema's description of a key; of one in degrees with that unit."""
    if model is None:
        return ""
    name = key if key in model.model_fields else in_radians(key)
    if name is None or name not in model.model_fields:
        return ""
    about = " ".join((model.model_fields[name].description or "").split())
    if name != key:
        for unit, degrees in sorted(DEGREES.items(), reverse=True):
            about = re.sub(rf"(?<=, ){re.escape(unit)}(?![\w/])", degrees, about)
    return about


def _inner(model: type[Model] | None, key: str, value: object) -> type[Model] | None:
    """The model of a key's mapping, or of the members of its list: of several the one whose keys and kind fit."""
    if model is None or key not in model.model_fields:
        return None
    members = value if isinstance(value, list) else [value]
    found = [
        one
        for one in models_in(model.model_fields[key].annotation)
        if all(isinstance(member, Mapping) and _fits(one, member) for member in members)
    ]
    return found[0] if found else None


def _fits(model: type[Model], data: Mapping[str, Any]) -> bool:
    kind = model.model_fields.get("kind")
    if kind is not None and "kind" in data and data["kind"] not in get_args(kind.annotation):
        return False
    return all((in_radians(key) or key) in model.model_fields or key in model.model_fields for key in data)


def flow(value: object) -> str:
    """A value as YAML in one line; numbers at their shortest."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return short(value)
        case list() | tuple():
            return "[" + ", ".join(map(flow, value)) + "]"
        case Mapping():
            return "{" + ", ".join(f"{key}: {flow(one)}" for key, one in value.items()) + "}"
    text = str(value)
    return text if PLAIN.fullmatch(text) and text == text.strip() and text.lower() not in RESERVED else json.dumps(text)
