"""The errors of a config, collected with place, mistake and allowed values, so that the user sees all at once."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from radarsim.errors import ConfigError

KeyPath = tuple[str | int, ...]
ABSENT = object()
MAX_SHOWN_CHARACTERS = 60  # of a value in a message
MIN_COUNTED_ZEROS = 7  # at the end of a whole number: from so many on it is written with an exponent
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


def dotted(path: KeyPath) -> str:
    """A key path as the user writes it: `filters.0.name`."""
    return ".".join(map(str, path))


def quoted_value(value: object) -> str:
    """A value as quoted in a message: one line of at most 60 characters, with control characters escaped."""
    text = short_number(value) if isinstance(value, float | int) and not isinstance(value, bool) else _text_of(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[: MAX_SHOWN_CHARACTERS - 1] + "…"


def _text_of(value: object, max_characters: int = MAX_SHOWN_CHARACTERS) -> str:
    """The text of a value as in YAML, formatted no further than it is shown."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case float() | int():
            return short_number(value)
        case str():
            return ascii_controls(repr(value[: max_characters + 1]))
        case dict():
            pairs = list(value.items())[:max_characters]
            items = (f"{one_line(str(k)[:max_characters])}: {_text_of(v, max_characters // 2)}" for k, v in pairs)
            return "{" + ", ".join(_first_that_fit(items, max_characters)) + "}"
        case list() | tuple():
            items = (_text_of(v, max_characters // 2) for v in value[:max_characters])
            return "[" + ", ".join(_first_that_fit(items, max_characters)) + "]"
    return one_line(type(value).__name__)


def _first_that_fit(items: Iterable[str], max_characters: int) -> Iterator[str]:
    """The first items, up to a little more than fits."""
    length = 0
    for item in items:
        yield item
        length += len(item) + 2
        if length > max_characters:
            return


def short_number(number: float | int) -> str:
    """A short text that reads back as the same number: 0.001, 1e-5, 100000, 1e12."""
    if isinstance(number, int) and abs(number) >= 10**30:
        return "a number of more than 30 digits"
    text = repr(number).replace("e-0", "e-").replace("e+", "e").removesuffix(".0")
    digits = text.rstrip("0")
    zeros = len(text) - len(digits)
    return f"{digits}e{zeros}" if zeros >= MIN_COUNTED_ZEROS and digits.lstrip("-").isdigit() else text


def one_line(text: str) -> str:
    """Text without line breaks and control characters, which are escaped."""
    return ascii_controls(text)


def ascii_controls(text: str) -> str:
    """Escapes unprintable characters, as repr does."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
