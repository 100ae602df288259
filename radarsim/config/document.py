"""A config as plain data in which every value keeps its place of origin.

Faults of a config: place, fault, allowed values; collected, so that the user sees all of them at once.

Where configs and scenarios are found by their stem, and suggestions when they are not."""

import difflib
import re
import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from radarsim.errors import ConfigError

# ---- faults ----------------------------------------------------------------------------------------------------------
KeyPath = tuple[str | int, ...]
ABSENT = object()
LONGEST = 60  # characters of a value shown in a message
ZEROS = 7  # at the end of a whole number, from which on they are counted
LONGEST_SOURCE = 500  # characters of the place


class Origin(NamedTuple):
    """Where a value was written: a file with line and column from 1, an argument, or `config`: a dictionary.

    prefix counts the leading keys of a path that are not in that file: a scenario's own keys begin below `target`. key:
    the key that an argument such as `--set KEY` names itself, possibly a bare filter key."""

    source: str
    line: int = 0
    column: int = 0
    prefix: int = 0
    key: str = ""

    def __str__(self) -> str:
        return f"{self.source}:{self.line}:{self.column}" if self.line else self.source


class Faults:
    """A growing list of faults; each is one line of the ConfigError."""

    def __init__(self) -> None:
        self._lines: dict[str, tuple[int, int, int, int]] = {}
        self._sources: list[str] = []
        self._spoiled: set[tuple[Origin, KeyPath]] = set()
        self._of_arguments = False

    def __len__(self) -> int:
        return len(self._lines)

    def add(self, origin: Origin, path: KeyPath, message: str, got: object = ABSENT) -> None:
        """Note a fault at a key path; `got` is the value as the user wrote it."""
        key = dotted(path[origin.prefix :])
        parts = [one_line(str(origin))[-LONGEST_SOURCE:]]
        if key and not _names(origin, key):
            parts.append(one_line(key))
        parts.append(message if got is ABSENT else f"{message}, got {shown(got)}")
        self._of_arguments |= bool(origin.key)
        if origin.source not in self._sources:
            self._sources.append(origin.source)
        rank = self._sources.index(origin.source)
        self._lines.setdefault(": ".join(parts), (rank, origin.line, origin.column, len(self._lines)))

    def spoil(self, origin: Origin, path: KeyPath, message: str, got: object = ABSENT) -> None:
        """Note a fault that makes the value at this place unusable: further faults of it are not reported."""
        self.add(origin, path, message, got)
        self._spoiled.add((origin._replace(prefix=0), path[origin.prefix :]))

    def spoiled(self, origin: Origin, path: KeyPath) -> bool:
        """Whether the value at this place is reported as unusable."""
        return (origin._replace(prefix=0), path[origin.prefix :]) in self._spoiled

    def beside(self, source: str) -> None:
        """Name the file whose keys are laid over others, where faults are attributed to the others alone."""
        if source not in self._sources and not self._of_arguments:
            self._lines = {f"{line} (with the keys of {source} over it)": rank for line, rank in self._lines.items()}

    def raise_if_any(self) -> None:
        """Raise ConfigError with every fault, file by file, from the top of each downwards."""
        if self._lines:
            raise ConfigError(*sorted(self._lines, key=self._lines.__getitem__))


def _names(origin: Origin, key: str) -> bool:
    """Whether the origin, an argument, names the key already; a bare filter key is the end of the full."""
    return bool(origin.key) and (key == origin.key or key.endswith(f".{origin.key}"))


def dotted(path: KeyPath) -> str:
    """A key path as the user writes it: `filters.0.name`."""
    return ".".join(map(str, path))


def shown(value: object) -> str:
    """A value quoted in a message: one line of at most 60 characters, control characters escaped."""
    text = short(value) if isinstance(value, float | int) and not isinstance(value, bool) else _literal(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def _literal(value: object, room: int = LONGEST) -> str:
    """Like repr, with YAML's true and false, and without formatting more than shown."""
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
    """Escapes unprintable characters, as repr does."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


# ---- lookup ----------------------------------------------------------------------------------------------------------
SHIPPED = Path(__file__).parent.parent / "shipped"
STEM = re.compile(r"\w[\w+=-]*(?:\.[\w+=-]+)*")


FILES_OF_RESULTS = ("index.html", "readme.md")  # stand where the folder of a config's results would
RESERVED = "a config must have another name: there is a file of that name among the results"


def no_folders() -> tuple[Path, ...]:
    """Folders with configs/ and scenarios/ besides the shipped one: none, but see radarsim.app.configs."""
    return ()


further_folders: Callable[[], tuple[Path, ...]] = no_folders


def config_file(name: str, beside: Path | None = None) -> Path | None:
    """The file of a config: beside the including one (or here), in ./configs, among the shipped; None if nowhere."""
    folders = [Path(), Path("configs")] if beside is None else [beside.parent, Path("configs")]
    return _first(name, [*folders, SHIPPED / "configs"]) or _first(name, _further("configs"))


def scenario_file(name: str, config: Path | None) -> Path | None:
    """The file of a scenario: beside the config, in scenarios/ next to its folder or here, among the shipped. A config
    of that name beside the config is not a scenario."""
    folders = [] if config is None else [config.parent, next_to(config.parent) / "scenarios"]
    found = _first(name, [*folders, Path("scenarios"), SHIPPED / "scenarios"], refused=_is_config)
    return found or _first(name, _further("scenarios"), refused=_is_config)


def _further(kind: str) -> list[Path]:
    return [folder / kind for folder in further_folders()]


def next_to(folder: Path) -> Path:
    """The folder around a folder, in the user's own notation if it has one."""
    return folder.parent if folder.name not in ("", "..") else folder / ".."


def _first(name: str, folders: list[Path], refused: Callable[[Path], bool] = lambda file: False) -> Path | None:
    for folder in folders:
        file = folder / f"{name}.yaml"
        if file.is_file() and not refused(file):
            return file
    return None


def _is_config(file: Path) -> bool:
    """Whether a file has a key that only configs have; an unreadable file is left to its reader."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(("study:", "include:")) for line in text)
    except OSError:
        return False


def stems(kind: str) -> tuple[str, ...]:
    """Stems of available configs or scenarios: those of the working directory and the shipped ones."""
    folders = (Path(kind), SHIPPED / kind, *_further(kind))
    return tuple(sorted({file.stem for folder in folders for file in folder.glob("*.yaml")}))


def is_stem(name: str) -> bool:
    """Whether a name is a plain file stem: no separators, no drive, no `..`, no leading dot."""
    return len(name) <= 100 and STEM.fullmatch(composed(name)) is not None


def composed(name: str) -> str:
    """A name with its letters and accents composed: the same for every way of writing it (Unicode's NFC)."""
    return unicodedata.normalize("NFC", name)


def is_reserved(stem: str) -> bool:
    """Whether a config's results would have the name of a file written beside them, in letters of any case."""
    return stem.casefold() in FILES_OF_RESULTS


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean X?` for the nearest known name, or nothing."""
    name, known = str(name)[:100], list(known)
    begun = [full for full in known if len(name) > 2 and full.lower().startswith(name.lower())]
    near = begun or difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]}?" if near else ""


# ---- document --------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Document:
    """Plain data, and the origins of values and keys by key path.

    data of a config or a scenario is a mapping, of an override any value. source is the file as the user named it; file
    is where it lies (None for a dictionary)."""

    data: Any
    source: str
    file: Path | None = None
    values: Mapping[KeyPath, Origin] = field(default_factory=dict)
    keys: Mapping[KeyPath, Origin] = field(default_factory=dict)

    def origin(self, path: KeyPath) -> Origin:
        """Where the value at a path was written; if there is no value, the nearest one around it."""
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Origin(self.source))

    def key_origin(self, path: KeyPath) -> Origin:
        """Where the key of a path was written."""
        return self.keys.get(path) or self.origin(path)

    def get(self, path: KeyPath) -> object:
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

    def with_data(self, path: KeyPath, value: object) -> "Document":
        """The document with other data at a path, where every value keeps its origin."""
        return replace(self, data=_with(self.data, path, value))

    def graft(self, path: KeyPath, value: object, origin: Origin) -> "Document":
        """A document with another value at a path; containers on the way must exist, or become mappings."""
        return self._replaced(path, value, {path: origin}, {})

    def graft_document(self, path: KeyPath, other: "Document") -> "Document":
        """A document with another file's content at a path; faults below it are reported under that file's own keys."""

        def moved(origins: Mapping[KeyPath, Origin]) -> dict[KeyPath, Origin]:
            return {(*path, *below): origin._replace(prefix=len(path)) for below, origin in origins.items()}

        whole = {path: Origin(other.source, prefix=len(path))}
        return self._replaced(path, other.data, whole | moved(other.values), moved(other.keys))

    def laid(self, path: KeyPath, over: "Document") -> "Document":
        """The document with another one's value and origins at a path, replacing its own."""

        def of(origins: Mapping[KeyPath, Origin]) -> dict[KeyPath, Origin]:
            return {below: origin for below, origin in origins.items() if below[: len(path)] == path}

        values, keys = {path: over.origin(path)} | of(over.values), {path: over.key_origin(path)} | of(over.keys)
        return self._replaced(path, over.get(path), values, keys)

    def _replaced(
        self, path: KeyPath, value: object, values: dict[KeyPath, Origin], keys: dict[KeyPath, Origin]
    ) -> "Document":
        depth = len(path)
        made = {path[:n]: values[path] for n in range(1, depth) if not isinstance(self.get(path[:n]), dict | list)}
        kept = {p: o for p, o in self.values.items() if p[:depth] != path}
        kept_keys = {p: o for p, o in self.keys.items() if p[:depth] != path}
        data = _with(self.data, path, value)
        return replace(self, data=data, values=kept | made | values, keys=kept_keys | keys)


def child(value: object, step: str | int) -> object:
    """The value under a key or an index, or ABSENT."""
    if isinstance(value, dict):
        return value.get(step, ABSENT)
    if isinstance(value, list) and isinstance(step, int) and 0 <= step < len(value):
        return value[step]
    return ABSENT


def _with(container: object, path: KeyPath, value: object) -> object:
    """A copy of a container with another value at a path; only the containers on the way are copied."""
    if not path:
        return value
    first, *rest = path
    below = child(container, first)
    inner = _with({} if below is ABSENT else below, tuple(rest), value)
    if isinstance(container, list) and isinstance(first, int):
        return [*container[:first], inner, *container[first + 1 :]]
    return {**(container if isinstance(container, dict) else {}), first: inner}
