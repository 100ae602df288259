"""The errors of a config, collected with place, mistake and allowed values, so that the user sees all at once."""

from typing import NamedTuple

from radarsim.config.value_text import KeyPath, dotted, one_line, quoted_value
from radarsim.errors import ConfigError

ABSENT = object()
MAX_SOURCE_CHARACTERS = 500  # of an origin in a message


class Origin(NamedTuple):
    """Where a value was written: in a file, with line and column from 1, in an argument, or in a dictionary (`config`).

    prefix: how many leading keys of a path are not in that file: the keys of a scenario begin below `target`. key: the
    key that an argument such as `--set KEY` names itself, possibly a bare filter key."""

    source: str
    line: int = 0
    column: int = 0
    prefix: int = 0
    key: str = ""

    def __str__(self) -> str:
        return f"{self.source}:{self.line}:{self.column}" if self.line else self.source


class ErrorList:
    """The errors found so far in a config, each a line of the ConfigError to be raised."""

    def __init__(self) -> None:
        self._lines: dict[str, tuple[int, int, int, int]] = {}
        self._sources: list[str] = []
        self._spoiled: set[tuple[Origin, KeyPath]] = set()
        self._has_argument = False

    def __len__(self) -> int:
        return len(self._lines)

    def add(self, origin: Origin, path: KeyPath, message: str, got: object = ABSENT) -> None:
        """Add an error at a key path; got: the value as the user wrote it."""
        key = dotted(path[origin.prefix :])
        parts = [one_line(str(origin))[-MAX_SOURCE_CHARACTERS:]]
        if key and not _names_key(origin, key):
            parts.append(one_line(key))
        parts.append(message if got is ABSENT else f"{message}, got {quoted_value(got)}")
        self._has_argument |= bool(origin.key)
        if origin.source not in self._sources:
            self._sources.append(origin.source)
        source_index = self._sources.index(origin.source)
        self._lines.setdefault(": ".join(parts), (source_index, origin.line, origin.column, len(self._lines)))

    def mark_unusable(self, origin: Origin, path: KeyPath, message: str, got: object = ABSENT) -> None:
        """Add an error that makes the value at this place unusable: its other errors are not reported."""
        self.add(origin, path, message, got)
        self._spoiled.add((origin._replace(prefix=0), path[origin.prefix :]))

    def is_unusable(self, origin: Origin, path: KeyPath) -> bool:
        """Whether the value at this place is reported as unusable."""
        return (origin._replace(prefix=0), path[origin.prefix :]) in self._spoiled

    def name_overlaying_file(self, source: str) -> None:
        """Name the file whose keys are laid over others in each error, if all are attributed to the others."""
        if source not in self._sources and not self._has_argument:
            self._lines = {f"{line} (with the keys of {source} over it)": rank for line, rank in self._lines.items()}

    def raise_if_any(self) -> None:
        """Raise ConfigError with all errors, file by file, each from top to bottom."""
        if self._lines:
            raise ConfigError(*sorted(self._lines, key=self._lines.__getitem__))


def _names_key(origin: Origin, key: str) -> bool:
    """Whether the origin is an argument that names the key, or the end of its path if it is a bare filter key."""
    return bool(origin.key) and (key == origin.key or key.endswith(f".{origin.key}"))
