"""A config as plain data in which each value keeps its origin, the errors of a config, and the files of configs.

Errors name place, mistake and allowed values. They are collected, so that the user sees all of them at once.

Configs and scenarios are found by their stems; for an unknown one the nearest name is suggested."""

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


class Faults:
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
        parts.append(message if got is ABSENT else f"{message}, got {shown(got)}")
        self._has_argument |= bool(origin.key)
        if origin.source not in self._sources:
            self._sources.append(origin.source)
        source_index = self._sources.index(origin.source)
        self._lines.setdefault(": ".join(parts), (source_index, origin.line, origin.column, len(self._lines)))

    def spoil(self, origin: Origin, path: KeyPath, message: str, got: object = ABSENT) -> None:
        """Add an error that makes the value at this place unusable: its other errors are not reported."""
        self.add(origin, path, message, got)
        self._spoiled.add((origin._replace(prefix=0), path[origin.prefix :]))

    def spoiled(self, origin: Origin, path: KeyPath) -> bool:
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


def shown(value: object) -> str:
    """A value as quoted in a message: one line of at most 60 characters, with control characters escaped."""
    text = short(value) if isinstance(value, float | int) and not isinstance(value, bool) else _text_of(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[: MAX_SHOWN_CHARACTERS - 1] + "…"


def _text_of(value: object, max_characters: int = MAX_SHOWN_CHARACTERS) -> str:
    """The text of a value as in YAML, formatted no further than it is shown."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case float() | int():
            return short(value)
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


def short(number: float | int) -> str:
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


# ---- lookup ----------------------------------------------------------------------------------------------------------
SHIPPED = Path(__file__).parent.parent / "shipped"
STEM = re.compile(r"\w[\w+=-]*(?:\.[\w+=-]+)*")


RESULT_FILES = ("index.html", "readme.md")  # stand beside the folders of results, which have the names of configs
RESERVED = "a config must have another name: there is a file of that name among the results"


def no_folders() -> tuple[Path, ...]:
    """The further folders with configs/ and scenarios/: none, unless radarsim.app.configs sets `further_folders`."""
    return ()


further_folders: Callable[[], tuple[Path, ...]] = no_folders


def config_file(name: str, including_file: Path | None = None) -> Path | None:
    """The file of a config: beside the including one (or here), in ./configs, or shipped; None if there is none."""
    folders = [Path(), Path("configs")] if including_file is None else [including_file.parent, Path("configs")]
    return _first_file(name, [*folders, SHIPPED / "configs"]) or _first_file(name, _further_subfolders("configs"))


def scenario_file(name: str, config: Path | None) -> Path | None:
    """The file of a scenario: beside the config, in scenarios/ next to its folder or here, or shipped. A config of that
    name beside the config is not a scenario."""
    folders = [] if config is None else [config.parent, next_to(config.parent) / "scenarios"]
    file = _first_file(name, [*folders, Path("scenarios"), SHIPPED / "scenarios"], is_refused=_is_config)
    return file or _first_file(name, _further_subfolders("scenarios"), is_refused=_is_config)


def _further_subfolders(kind: str) -> list[Path]:
    """The folders configs/ or scenarios/ of user packages."""
    return [folder / kind for folder in further_folders()]


def next_to(folder: Path) -> Path:
    """The folder around a folder, written as the user did if possible."""
    return folder.parent if folder.name not in ("", "..") else folder / ".."


def _first_file(name: str, folders: list[Path], is_refused: Callable[[Path], bool] = lambda file: False) -> Path | None:
    for folder in folders:
        file = folder / f"{name}.yaml"
        if file.is_file() and not is_refused(file):
            return file
    return None


def _is_config(file: Path) -> bool:
    """Whether a file has a key that only configs have. An unreadable file has none: whoever reads it reports it."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(("study:", "include:")) for line in text)
    except OSError:
        return False


def stems(kind: str) -> tuple[str, ...]:
    """The stems of the available configs or scenarios: in the working directory, shipped, and in user packages."""
    folders = (Path(kind), SHIPPED / kind, *_further_subfolders(kind))
    return tuple(sorted({file.stem for folder in folders for file in folder.glob("*.yaml")}))


def is_stem(name: str) -> bool:
    """Whether a name is a plain file stem, without separators, drive, `..` or leading dot."""
    return len(name) <= 100 and STEM.fullmatch(composed(name)) is not None


def composed(name: str) -> str:
    """A name with letters and accents composed (Unicode's NFC), so that equal looks are equal names."""
    return unicodedata.normalize("NFC", name)


def is_reserved(stem: str) -> bool:
    """Whether the folder of a config's results would have the name of a file beside it, in any case of letters."""
    return stem.casefold() in RESULT_FILES


def did_you_mean(name: str, known_names: Iterable[str]) -> str:
    """`; did you mean X?` for the nearest known name, or nothing."""
    name, known_names = str(name)[:100], list(known_names)
    beginnings = [full for full in known_names if len(name) > 2 and full.lower().startswith(name.lower())]
    matches = beginnings or difflib.get_close_matches(name, known_names, n=1, cutoff=0.6)
    return f"; did you mean {matches[0]}?" if matches else ""


# ---- document --------------------------------------------------------------------------------------------------------
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
