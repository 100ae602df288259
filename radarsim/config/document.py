"""A config as plain data in which each value keeps its origin."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from radarsim.config.error_list import ABSENT, Origin
from radarsim.config.value_text import KeyPath


@dataclass(frozen=True)
class Document:
    """Plain data, with the origins of its values and keys by key path.

    data: a mapping for a config or a scenario, any value for an override. source: the file as the user named it; file:
    its path (None for a dictionary)."""

    data: Any
    source: str
    file: Path | None = None
    values: Mapping[KeyPath, Origin] = field(default_factory=dict)
    keys: Mapping[KeyPath, Origin] = field(default_factory=dict)

    def origin(self, path: KeyPath) -> Origin:
        """Where the value at a path was written; if there is none, that of the nearest value around it."""
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Origin(self.source))

    def key_origin(self, path: KeyPath) -> Origin:
        """Where the last key of a path was written."""
        return self.keys.get(path) or self.origin(path)

    def get(self, path: KeyPath) -> object:
        """The value at a path, or ABSENT."""
        value: object = self.data
        for step in path:
            value = child(value, step)
        return value

    def with_keys(self, keys: Collection[str]) -> "Document":
        """The document with only these top-level keys."""
        return self.with_data((), {key: value for key, value in self.data.items() if key in keys})

    def without_keys(self, keys: Collection[str]) -> "Document":
        """The document without these top-level keys."""
        return self.with_data((), {key: value for key, value in self.data.items() if key not in keys})

    def below(self, path: KeyPath) -> "Document":
        """The value at a path as a document of its own; errors in it are reported with the keys of this one."""

        def inner_origins(origins: Mapping[KeyPath, Origin]) -> dict[KeyPath, Origin]:
            return {p[len(path) :]: origin for p, origin in origins.items() if p[: len(path)] == path}

        return replace(self, data=self.get(path), values=inner_origins(self.values), keys=inner_origins(self.keys))

    def with_data(self, path: KeyPath, value: object) -> "Document":
        """The document with other data at a path; all values keep their origins."""
        return replace(self, data=_with_value(self.data, path, value))

    def graft(self, path: KeyPath, value: object, origin: Origin) -> "Document":
        """The document with another value at a path; missing containers on the way become mappings."""
        return self._replaced(path, value, {path: origin}, {})

    def graft_document(self, path: KeyPath, document: "Document") -> "Document":
        """The document with another file's content at a path; errors below it are reported with that file's keys."""

        def placed_below(origins: Mapping[KeyPath, Origin]) -> dict[KeyPath, Origin]:
            return {(*path, *inner_path): origin._replace(prefix=len(path)) for inner_path, origin in origins.items()}

        root_origin = {path: Origin(document.source, prefix=len(path))}
        return self._replaced(
            path, document.data, root_origin | placed_below(document.values), placed_below(document.keys)
        )

    def with_value_of(self, path: KeyPath, overlay: "Document") -> "Document":
        """The document with the value and the origins that another one has at a path."""

        def origins_below(origins: Mapping[KeyPath, Origin]) -> dict[KeyPath, Origin]:
            return {inner_path: origin for inner_path, origin in origins.items() if inner_path[: len(path)] == path}

        values = {path: overlay.origin(path)} | origins_below(overlay.values)
        keys = {path: overlay.key_origin(path)} | origins_below(overlay.keys)
        return self._replaced(path, overlay.get(path), values, keys)

    def _replaced(
        self, path: KeyPath, value: object, values: dict[KeyPath, Origin], keys: dict[KeyPath, Origin]
    ) -> "Document":
        """The document with a value at a path, and the origins of the values and keys there."""
        depth = len(path)
        parents = (path[:n] for n in range(1, depth))
        created = {parent: values[path] for parent in parents if not isinstance(self.get(parent), dict | list)}
        remaining_values = {p: origin for p, origin in self.values.items() if p[:depth] != path}
        remaining_keys = {p: origin for p, origin in self.keys.items() if p[:depth] != path}
        data = _with_value(self.data, path, value)
        return replace(self, data=data, values=remaining_values | created | values, keys=remaining_keys | keys)


def child(value: object, step: str | int) -> object:
    """The value under a key or an index, or ABSENT."""
    if isinstance(value, dict):
        return value.get(step, ABSENT)
    if isinstance(value, list) and isinstance(step, int) and 0 <= step < len(value):
        return value[step]
    return ABSENT


def _with_value(container: object, path: KeyPath, value: object) -> object:
    """A copy of a container with another value at a path; only containers on the way are copied."""
    if not path:
        return value
    step, *inner_path = path
    old_value = child(container, step)
    new_value = _with_value({} if old_value is ABSENT else old_value, tuple(inner_path), value)
    if isinstance(container, list) and isinstance(step, int):
        return [*container[:step], new_value, *container[step + 1 :]]
    return {**(container if isinstance(container, dict) else {}), step: new_value}
