"""Faults of a config: where, what, what is allowed; collected, so that the user sees all of them at once."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from radarsim.errors import ConfigError

Path = tuple[str | int, ...]
ABSENT = object()
LONGEST = 60  # characters of a value shown in a message
ZEROS = 7  # at the end of a whole number, from which on they are counted
LONGEST_SOURCE = 500  # characters of the place


class Origin(NamedTuple):
    """Where a value was written: a file with line and column from 1, `--set KEY`, `--seed`, or `config`: a dictionary.

    prefix counts the leading keys of a path that do not stand in that file: a scenario's own keys begin below `target`.
    """

    source: str
    line: int = 0
    column: int = 0
    prefix: int = 0

    def __str__(self) -> str:
        return f"{self.source}:{self.line}:{self.column}" if self.line else self.source


class Faults:
    """A growing list of faults; each is one line of the ConfigError."""

    def __init__(self) -> None:
        self._lines: dict[str, tuple[int, int, int, int]] = {}
        self._sources: list[str] = []
        self._spoiled: set[tuple[Origin, Path]] = set()

    def __len__(self) -> int:
        return len(self._lines)

    def add(self, origin: Origin, path: Path, message: str, got: object = ABSENT) -> None:
        """Note a fault at a key path; `got` is the value as the user wrote it."""
        key = dotted(path[origin.prefix :])
        parts = [one_line(str(origin))[-LONGEST_SOURCE:]]
        if key and not _names(origin, key):
            parts.append(one_line(key))
        parts.append(message if got is ABSENT else f"{message}, got {shown(got)}")
        if origin.source not in self._sources:
            self._sources.append(origin.source)
        rank = self._sources.index(origin.source)
        self._lines.setdefault(": ".join(parts), (rank, origin.line, origin.column, len(self._lines)))

    def spoil(self, origin: Origin, path: Path, message: str, got: object = ABSENT) -> None:
        """Note a fault that makes the value at this place unusable: no further fault of it is reported."""
        self.add(origin, path, message, got)
        self._spoiled.add((origin._replace(prefix=0), path[origin.prefix :]))

    def spoiled(self, origin: Origin, path: Path) -> bool:
        """Whether the value at this place has been reported as unusable."""
        return (origin._replace(prefix=0), path[origin.prefix :]) in self._spoiled

    def raise_if_any(self) -> None:
        """Raise ConfigError with every fault, file by file, from the top of each downwards."""
        if self._lines:
            raise ConfigError(*sorted(self._lines, key=self._lines.__getitem__))


def _names(origin: Origin, key: str) -> bool:
    """Whether the origin, `--set KEY` or `--KEY`, names the key already; a bare filter key is the end of the full."""
    option, _, given = origin.source.partition(" ")
    return origin.source == f"--{key}" or (option == "--set" and (key == given or key.endswith(f".{given}")))


def dotted(path: Path) -> str:
    """A key path as the user writes it: `filters.0.name`."""
    return ".".join(map(str, path))


def shown(value: object) -> str:
    """A value as it is quoted in a message: one line of at most 60 characters, control characters escaped."""
    text = short(value) if isinstance(value, float | int) and not isinstance(value, bool) else _literal(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def _literal(value: object, room: int = LONGEST) -> str:
    """Like repr, with YAML's true and false, and without formatting more than is shown."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case float() | int():
            return short(value)
        case str():
            return ascii_controls(repr(value[: room + 1]))
        case dict():
            inside = (f"{one_line(str(k)[:room])}: {_literal(v, room // 2)}" for k, v in list(value.items())[:room])
            return "{" + ", ".join(_until(inside, room)) + "}"
        case list() | tuple():
            return "[" + ", ".join(_until((_literal(v, room // 2) for v in value[:room]), room)) + "]"
    return one_line(type(value).__name__)


def _until(parts: Iterable[str], room: int) -> Iterator[str]:
    """The first parts, up to a little more than fits."""
    length = 0
    for part in parts:
        yield part
        length += len(part) + 2
        if length > room:
            return


def short(number: float | int) -> str:
    """A short text that reads back as the same number: 0.001, 1e-5, 100000, 1e12."""
    if isinstance(number, int) and abs(number) >= 10**30:
        return "a number of more than 30 digits"
    text = repr(number).replace("e-0", "e-").replace("e+", "e").removesuffix(".0")
    digits = text.rstrip("0")
    zeros = len(text) - len(digits)
    return f"{digits}e{zeros}" if zeros >= ZEROS and digits.lstrip("-").isdigit() else text


def one_line(text: str) -> str:
    """Text without line breaks and control characters, which are escaped."""
    return ascii_controls(text)


def ascii_controls(text: str) -> str:
    """Escapes what is not printable, the way repr does."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
