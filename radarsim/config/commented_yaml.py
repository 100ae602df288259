"""Lines of YAML for a config, each key with its description from the schema."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeGuard, get_args

from pydantic_core import PydanticUndefined

from radarsim.config.model import Model, in_radians
from radarsim.config.validate import models_in
from radarsim.config.yaml_text import one_line_yaml

COMMENT_COLUMN = 44  # at which comments begin
LINE_WIDTH = 110
DEGREE_UNITS = {"rad": "degrees", "rad/s": "degrees per second"}


@dataclass(frozen=True)
class CommentedYaml:
    """How a config is written. write: a value on one line; adds_optional: whether the optional keys that are missing
    follow as comments, with their defaults; reasons: for values, by key as it is indented, after its description."""

    write: Callable[[object], str] = one_line_yaml
    adds_optional: bool = False
    reasons: Mapping[str, str] = field(default_factory=dict)

    def mapping_lines(self, data: Mapping[str, Any], model: type[Model] | None, indent: str) -> list[str]:
        """The lines of a mapping."""
        lines = [line for key, value in data.items() for line in self.key_lines(key, value, model, indent)]
        if self.adds_optional and model is not None:
            given_keys = {in_radians(key) or key for key in data} | set(data)
            for key, field in model.model_fields.items():
                default = field.default
                if key not in given_keys and default is not PydanticUndefined:
                    is_long = default is None or isinstance(default, Model) or default in ((), {})
                    value = "…" if is_long else self.write(default)
                    lines.append(with_comment(f"{indent}# {key}: {value}", description(model, key)))
        return lines

    def key_lines(self, key: str, value: object, model: type[Model] | None, indent: str) -> list[str]:
        """The lines of one key: a short value beside it, a mapping or a list of mappings below."""
        comment, inner_model = self._comment(model, key, indent), _inner_model(model, key, value)
        name = self.write(key)
        if isinstance(value, Mapping) and inner_model is not None and key != "sweep":
            lines = self.mapping_lines(value, inner_model, indent + "  ")
            return [with_comment(f"{indent}{name}:", comment), *lines]
        if _is_list_of_mappings(value):
            lines = [with_comment(f"{indent}{name}:", comment)]
            if inner_model is not None:
                used_keys = list(dict.fromkeys(name for member in value for name in member))
                comments = {name: self._comment(inner_model, name, f"{indent}  ") for name in used_keys}
                lines += [f"{indent}  # {name}: {text}" for name, text in comments.items() if text]
            return [*lines, *(line for member in value for line in self._item_lines(member, indent))]
        return [with_comment(f"{indent}{name}: {self.write(value)}", comment)]

    def _comment(self, model: type[Model] | None, key: str, indent: str) -> str:
        """The description of a key, and the reason for its value."""
        return "; ".join(filter(None, (description(model, key), self.reasons.get(f"{indent}{key}", ""))))

    def plain_lines(self, key: str, value: object, indent: str) -> list[str]:
        """The lines of one key without its description: on one line if it fits."""
        line = f"{indent}{self.write(key)}: {self.write(value)}"
        if len(line) <= LINE_WIDTH and not _is_list_of_mappings(value):
            return [line]
        head = f"{indent}{self.write(key)}:"
        if isinstance(value, Mapping):
            return [
                head,
                *(line for name, item in value.items() for line in self.plain_lines(name, item, indent + "  ")),
            ]
        if _is_list_of_mappings(value):
            return [head, *(line for member in value for line in self._item_lines(member, indent))]
        return [line]

    def _item_lines(self, mapping: Mapping[str, Any], indent: str) -> Iterator[str]:
        """A mapping in a list: on one line if it fits, else one key per line."""
        line = f"{indent}  - {self.write(mapping)}"
        if len(line) <= LINE_WIDTH:
            yield line
            return
        for index, (key, value) in enumerate(mapping.items()):
            yield f"{indent}  {'-' if index == 0 else ' '} {self.write(key)}: {self.write(value)}"


def _is_list_of_mappings(value: object) -> TypeGuard[list[Mapping[str, Any]]]:
    return isinstance(value, list) and bool(value) and all(isinstance(member, Mapping) for member in value)


def with_comment(text: str, comment: str) -> str:
    """A line of YAML with a comment, if there is one."""
    return f"{text:<{COMMENT_COLUMN}}  # {comment}" if comment else text


def description(model: type[Model] | None, key: str) -> str:
    """The description of a key in its schema; of a key in degrees with that unit."""
    if model is None:
        return ""
    name = key if key in model.model_fields else in_radians(key)
    if name is None or name not in model.model_fields:
        return ""
    text = " ".join((model.model_fields[name].description or "").split())
    if name != key:
        for unit, degree_unit in sorted(DEGREE_UNITS.items(), reverse=True):
            text = re.sub(rf"(?<=, ){re.escape(unit)}(?![\w/])", degree_unit, text)
    return text


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
