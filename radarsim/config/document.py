"""A config as plain data in which every value still knows where it was written."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from radarsim.config.faults import ABSENT, Origin, Path


@dataclass(frozen=True)
class Document:
    """Plain data, and the origins of values and keys by key path.

    data of a config or a scenario is a mapping, of an override any value. source is the file as the user named it; file
    is where it lies (None for a dictionary).
    """

    data: Any
    source: str
    file: FilePath | None = None
    values: Mapping[Path, Origin] = field(default_factory=dict)
    keys: Mapping[Path, Origin] = field(default_factory=dict)

    def origin(self, path: Path) -> Origin:
        """Where the value at a path was written; of a value that is not there, the nearest one around it."""
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Origin(self.source))

    def key_origin(self, path: Path) -> Origin:
        """Where the key of a path was written."""
        return self.keys.get(path) or self.origin(path)

    def get(self, path: Path) -> object:
        """The value at a path, or ABSENT."""
        value: object = self.data
        for step in path:
            value = child(value, step)
        return value

    def only(self, keys: Collection[str]) -> "Document":
        """The document with some of its top-level keys."""
        return self.with_data((), {key: value for key, value in self.data.items() if key in keys})

    def without(self, keys: Collection[str]) -> "Document":
        """The document without some of its top-level keys."""
        return self.with_data((), {key: value for key, value in self.data.items() if key not in keys})

    def with_data(self, path: Path, value: object) -> "Document":
        """The document with other data at a path, where every value still has the origin it had."""
        return replace(self, data=_with(self.data, path, value))

    def graft(self, path: Path, value: object, origin: Origin) -> "Document":
        """A document with another value at a path; containers on the way must exist, or become mappings."""
        return self._replaced(path, value, {path: origin}, {})

    def graft_document(self, path: Path, other: "Document") -> "Document":
        """A document with another file's content at a path; faults below it are reported under that file's own keys."""

        def moved(origins: Mapping[Path, Origin]) -> dict[Path, Origin]:
            return {(*path, *below): origin._replace(prefix=len(path)) for below, origin in origins.items()}

        whole = {path: Origin(other.source, prefix=len(path))}
        return self._replaced(path, other.data, whole | moved(other.values), moved(other.keys))

    def _replaced(self, path: Path, value: object, values: dict[Path, Origin], keys: dict[Path, Origin]) -> "Document":
        depth = len(path)
        made = {path[:n]: values[path] for n in range(1, depth) if not isinstance(self.get(path[:n]), dict | list)}
        kept = {p: o for p, o in self.values.items() if p[:depth] != path}
        kept_keys = {p: o for p, o in self.keys.items() if p[:depth] != path}
        data = _with(self.data, path, value)
        return replace(self, data=data, values=kept | made | values, keys=kept_keys | keys)


def child(value: object, step: str | int) -> object:
    """What stands under a key or an index, or ABSENT."""
    if isinstance(value, dict):
        return value.get(step, ABSENT)
    if isinstance(value, list) and isinstance(step, int) and 0 <= step < len(value):
        return value[step]
    return ABSENT


def _with(container: object, path: Path, value: object) -> object:
    """A copy of a container with another value at a path; only the containers on the way are copied."""
    if not path:
        return value
    first, *rest = path
    below = child(container, first)
    inner = _with({} if below is ABSENT else below, tuple(rest), value)
    if isinstance(container, list) and isinstance(first, int):
        return [*container[:first], inner, *container[first + 1 :]]
    return {**(container if isinstance(container, dict) else {}), first: inner}
