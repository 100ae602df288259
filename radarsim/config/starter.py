"""The text of a new config, each key with its description from the schema."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic_core import PydanticUndefined

from radarsim.config.common_keys import COMMON_KEYS, CommonKeys
from radarsim.config.model import Model, in_radians
from radarsim.config.validate import models_in
from radarsim.config.yaml_text import one_line_yaml

COMMENT_COLUMN = 44  # at which comments begin
LINE_WIDTH = 110
DEGREE_UNITS = {"rad": "degrees", "rad/s": "degrees per second"}


def starter_text(data: Mapping[str, Any], study_keys: type[Model], name: str, like: str) -> str:
    """The YAML of a config under a new name, each key with its description from the schema.

    data: as read, with keys as written. Missing optional keys follow as comments, with their defaults."""
    lines = [
        f"# {name}.yaml — like {like}: change the numbers, then `radarsim run {name}.yaml`",
        "# Units stand in the keys: _m, _s, _mps (m/s), _mps2 (m/s²), _hz, _rad; _deg is taken wherever _rad is.",
    ]
    common_data = {key: value for key, value in data.items() if key in COMMON_KEYS}
    study_data = {key: value for key, value in data.items() if key not in COMMON_KEYS}
    # The display name of a radar or sensor becomes the config's name.
    named_parts = {key: value for key, value in study_data.items() if isinstance(value, Mapping) and "name" in value}
    study_data |= {key: {**value, "name": name} for key, value in named_parts.items()}
    for key in ("study", "include"):
        if key in common_data:
            lines += _key_lines(key, common_data.pop(key), CommonKeys, "")
    if study_data:  # keys laid over an included config need not be complete
        lines += _mapping_lines(study_data, study_keys, "", optional="include" not in data)
    lines += [line for key, value in common_data.items() for line in _key_lines(key, value, CommonKeys, "")]
    missing_keys = [key for key in ("sweep", "realisations", "seed") if key not in data]
    samples = {"sweep": "{some_key: [1, 2, 3]}", "realisations": "1e5", "seed": "1"}
    lines += [_with_comment(f"# {key}: {samples[key]}", _description(CommonKeys, key)) for key in missing_keys]
    return "\n".join(lines) + "\n"


def _mapping_lines(data: Mapping[str, Any], model: type[Model] | None, indent: str, optional: bool) -> list[str]:
    """The lines of a mapping, and comments for the optional keys that it lacks."""
    lines = [line for key, value in data.items() for line in _key_lines(key, value, model, indent, optional)]
    if optional and model is not None:
        given_keys = {in_radians(key) or key for key in data} | set(data)
        for key, field in model.model_fields.items():
            default = field.default
            if key not in given_keys and default is not PydanticUndefined:
                value = (
                    "…"
                    if default is None or isinstance(default, Model) or default in ((), {})
                    else one_line_yaml(default)
                )
                lines.append(_with_comment(f"{indent}# {key}: {value}", _description(model, key)))
    return lines


def _key_lines(key: str, value: object, model: type[Model] | None, indent: str, optional: bool = True) -> list[str]:
    """The lines of one key: a short value beside it, a mapping or a list of mappings below."""
    description, inner_model = _description(model, key), _inner_model(model, key, value)
    if isinstance(value, Mapping) and inner_model is not None and key != "sweep":
        return [
            _with_comment(f"{indent}{key}:", description),
            *_mapping_lines(value, inner_model, indent + "  ", optional),
        ]
    if isinstance(value, list) and value and all(isinstance(member, Mapping) for member in value):
        lines = [_with_comment(f"{indent}{key}:", description)]
        if inner_model is not None:
            used_keys = list(dict.fromkeys(name for member in value for name in member))
            lines += [
                f"{indent}  # {name}: {_description(inner_model, name)}"
                for name in used_keys
                if _description(inner_model, name)
            ]
        return [*lines, *(line for member in value for line in _item_lines(member, indent))]
    return [_with_comment(f"{indent}{key}: {one_line_yaml(value)}", description)]


def _item_lines(mapping: Mapping[str, Any], indent: str) -> Iterator[str]:
    """A mapping in a list: on one line if it fits, else one key per line."""
    line = f"{indent}  - {one_line_yaml(mapping)}"
    if len(line) <= LINE_WIDTH:
        yield line
        return
    for index, (key, value) in enumerate(mapping.items()):
        yield f"{indent}  {'-' if index == 0 else ' '} {key}: {one_line_yaml(value)}"


def _with_comment(text: str, comment: str) -> str:
    """A line of YAML with a comment, if there is one."""
    return f"{text:<{COMMENT_COLUMN}}  # {comment}" if comment else text


def _description(model: type[Model] | None, key: str) -> str:
    """The description of a key in its schema; of a key in degrees with that unit."""
    if model is None:
        return ""
    name = key if key in model.model_fields else in_radians(key)
    if name is None or name not in model.model_fields:
        return ""
    description = " ".join((model.model_fields[name].description or "").split())
    if name != key:
        for unit, degree_unit in sorted(DEGREE_UNITS.items(), reverse=True):
            description = re.sub(rf"(?<=, ){re.escape(unit)}(?![\w/])", degree_unit, description)
    return description


def _inner_model(model: type[Model] | None, key: str, value: object) -> type[Model] | None:
    """The schema of a key's mapping or of its list's members; among several, the first with the same keys and kind."""
    if model is None or key not in model.model_fields:
        return None
    members = value if isinstance(value, list) else [value]
    matching = [
        candidate
        for candidate in models_in(model.model_fields[key].annotation)
        if all(isinstance(member, Mapping) and _has_keys_of(candidate, member) for member in members)
    ]
    return matching[0] if matching else None


def _has_keys_of(model: type[Model], data: Mapping[str, Any]) -> bool:
    """Whether a schema has all keys of a mapping, and its kind."""
    kind = model.model_fields.get("kind")
    if kind is not None and "kind" in data and data["kind"] not in get_args(kind.annotation):
        return False
    return all((in_radians(key) or key) in model.model_fields or key in model.model_fields for key in data)
