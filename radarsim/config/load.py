"""YAML to checked experiments. The only file that imports yaml: it reads text, with line and column of every value."""

import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any

import yaml

from radarsim.config.cases import Expander, Setting
from radarsim.config.document import Document
from radarsim.config.experiment import Experiment
from radarsim.config.faults import Faults, Origin, Path
from radarsim.config.lookup import RESERVED, config_file, did_you_mean, is_reserved, is_stem, stems
from radarsim.config.schema import Studies
from radarsim.config.values import DEEPEST, NotFinite, from_python, from_text

LARGEST_FILE = 256_000  # bytes
OPTIONS = ("realisations", "seed")  # overrides that are options of their own on the command line
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same events and marks, ten times faster


def load(source: str | os.PathLike[str] | Mapping[str, Any], overrides: Iterable[str], studies: Studies) -> Experiment:
    """The experiment that a config describes, all of it checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), or a mapping as YAML would give it;
    overrides are texts `dotted.key=value`, the value in YAML. Raises ConfigError, one line for each fault of the whole.
    """
    faults = Faults()
    settings = [setting for text in overrides if (setting := _setting(str(text), faults))]
    document: Document | None = None
    if isinstance(source, Mapping):
        document = _from_mapping(source, faults)
    elif isinstance(source, str | bytes | os.PathLike):
        document = _from_user(source, faults)
    else:
        faults.add(Origin("config"), (), f"must be a path, a name or a mapping, got {repr(source)[:60]}")
    experiment = None if document is None else Expander(read, settings, faults, studies).experiment(document)
    faults.raise_if_any()
    assert experiment is not None  # without one there is a fault
    return experiment


def as_yaml(value: Mapping[str, Any]) -> str:
    """Plain data as YAML text, keys in their order, short lists in one line."""
    text: str = yaml.dump(value, Dumper=_Plain, sort_keys=False, allow_unicode=True, width=110, default_flow_style=None)
    return text


class _Plain(yaml.SafeDumper):
    """Writes equal values twice, never as an alias, which this reader would refuse."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _from_mapping(source: Mapping[str, Any], faults: Faults) -> Document:
    origin = Origin("config")
    return Document(from_python(source, (), origin, faults), "config", None, {(): origin})


def _from_user(source: str | bytes | os.PathLike[str], faults: Faults) -> Document | None:
    """The config that the user named by path or stem."""
    name = os.fsdecode(source)
    # A file without suffix that is called as a config does not hide it.
    found = config_file(name) if is_stem(name) else None
    by_path = os.path.isfile(name) and (bool(FilePath(name).suffix) or found is None)
    file = None if by_path else found
    if file is None and is_stem(name) and not by_path and not FilePath(name).suffix:
        known = stems("configs")
        near = did_you_mean(name, known) or f"; there are: {', '.join(known)}"
        faults.add(Origin(name), (), f"no such config{near}")
        return None
    file = file or FilePath(name)
    document = read(file, faults)
    if document and not is_stem(file.stem):  # it names the folder of results
        faults.add(
            Origin(name), (), "a config's name must be of letters, digits and _ + = - . and not begin with a dot"
        )
        return None
    if document and is_reserved(file.stem):
        faults.add(Origin(name), (), RESERVED)
        return None
    return document


def _setting(text: str, faults: Faults) -> Setting | None:
    """An override `key=value`, its value read as YAML."""
    key, equals, value = text.partition("=")
    key = key.strip()
    origin = Origin(f"--{key}" if key in OPTIONS else f"--set {key}")
    if not equals or not key or not all(key.split(".")):
        faults.add(Origin(f"--set {text}"), (), "must be KEY=VALUE, with a dotted KEY")
        return None
    read_value = parse(value, origin.source, faults, plain_origin=origin)
    return None if read_value is None else Setting(key, read_value.data, origin)


def read(file: FilePath, faults: Faults) -> Document | None:
    """The document in a file; None, and a fault noted, if there is none."""
    shown = str(file)
    try:
        kind = file.stat().st_mode  # Path.is_file says no, from Python 3.14 on, of what may not be looked at
        if not stat.S_ISREG(kind):
            faults.add(Origin(shown), (), "is a directory" if stat.S_ISDIR(kind) else "is not a regular file")
            return None
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except (FileNotFoundError, NotADirectoryError):
        faults.add(Origin(shown), (), "no such file")
        return None
    except (OSError, ValueError) as error:
        faults.add(Origin(shown), (), f"cannot be read: {getattr(error, 'strerror', None) or error}")
        return None
    if len(content) > LARGEST_FILE:
        faults.add(Origin(shown), (), f"larger than {LARGEST_FILE // 1000} kB")
        return None
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        faults.add(Origin(shown, line, column), (), "is not UTF-8 text")
        return None
    document = parse(text, shown, faults)
    if document is None:
        return None
    if not isinstance(document.data, dict):
        if not faults.spoiled(document.origin(()), ()):
            faults.add(document.origin(()), (), "must be a mapping of keys", document.data)
        return None
    return Document(document.data, shown, file, document.values, document.keys)


def parse(text: str, source: str, faults: Faults, plain_origin: Origin | None = None) -> Document | None:
    """YAML text as a document; None, and a fault noted, if it is not YAML of the plain kind that is read here."""
    reader = _Reader(source, faults, plain_origin)
    try:
        data = reader.document(yaml.parse(text, Loader=LOADER))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = " ".join(filter(None, (error.context, error.problem)))
        faults.add(reader.origin(mark), (), f"not valid YAML: {what}")
    except yaml.reader.ReaderError as error:
        position = min(error.position, len(text))
        line = text.count("\n", 0, position)
        column = position - (text.rfind("\n", 0, position) + 1)
        faults.add(plain_origin or Origin(source, line + 1, column + 1), (), f"not valid YAML: {error.reason}")
    except UnicodeEncodeError:
        faults.add(plain_origin or Origin(source), (), "is not UTF-8 text")
    except _Refused:
        pass  # what was refused is noted; nothing after it can be understood
    else:
        return Document(data, source, None, reader.values, reader.keys)
    return None


class _Refused(Exception):
    """The rest of the text cannot be read."""


class _Reader:
    """Builds plain data from the events of the YAML parser, no deeper than allowed, and notes the origins."""

    def __init__(self, source: str, faults: Faults, plain_origin: Origin | None):
        self.source, self.faults, self.plain_origin = source, faults, plain_origin
        self.values: dict[Path, Origin] = {}
        self.keys: dict[Path, Origin] = {}

    def origin(self, mark: "yaml.Mark | yaml._yaml.Mark | None") -> Origin:
        """Where a mark is; in an override, the override."""
        if self.plain_origin or mark is None:
            return self.plain_origin or Origin(self.source)
        return Origin(self.source, mark.line + 1, mark.column + 1)

    def document(self, events: Iterable[yaml.Event]) -> object:
        """The data of the one document that there must be."""
        self.events: Iterator[Any]  # of yaml.Event; which kind follows is known from the one before
        self.events = (e for e in events if not isinstance(e, yaml.StreamStartEvent | yaml.DocumentEndEvent))
        if isinstance(next(self.events), yaml.StreamEndEvent):
            self.faults.add(self.plain_origin or Origin(self.source), (), "is empty")
            raise _Refused
        data = self._node(next(self.events), ())
        extra = next(self.events)
        if not isinstance(extra, yaml.StreamEndEvent):
            self.faults.add(self.origin(extra.start_mark), (), "there must be one YAML document, here begins another")
        return data

    def _node(self, event: yaml.NodeEvent, path: Path) -> object:
        origin = self.values[path] = self.origin(event.start_mark)
        if len(path) > DEEPEST:
            self.faults.add(origin, (), f"nested more than {DEEPEST} deep")
            raise _Refused
        if isinstance(event, yaml.AliasEvent):
            self.faults.spoil(origin, path, f"aliases (*{event.anchor}) are not read: write the value out")
            return None
        if event.anchor is not None:
            self.faults.add(origin, path, f"anchors (&{event.anchor}) are not read")
        assert isinstance(event, yaml.CollectionStartEvent | yaml.ScalarEvent)  # beside aliases there is nothing else
        if event.tag is not None:
            self.faults.spoil(origin, path, f"tags ({event.tag}) are not read")
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(path)
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, path, origin)
        return self._mapping(path)

    def _sequence(self, path: Path) -> list[object]:
        items: list[object] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            items.append(self._node(event, (*path, len(items))))
        return items

    def _mapping(self, path: Path) -> dict[str, object]:
        mapping: dict[str, object] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            origin = self.origin(event.start_mark)
            if not isinstance(event, yaml.ScalarEvent) or event.anchor or event.tag:
                self.faults.add(origin, path, "a key must be a plain word")
                raise _Refused
            key = event.value
            if key in mapping:
                first = self.keys[(*path, key)]
                where = f", first in line {first.line}" if first.line else ""
                self.faults.add(origin, (*path, key), f"duplicate key{where}")
                self._skip(path, key)
                continue
            mapping[key] = None
            self.keys[(*path, key)] = origin
            mapping[key] = self._node(next(self.events), (*path, key))
        return mapping

    def _skip(self, path: Path, key: str) -> None:
        """Read a value that is not wanted, without touching the origins of the one that is."""
        values, keys = self.values, self.keys
        self.values, self.keys = {}, {}
        self._node(next(self.events), (*path, key))
        self.values, self.keys = values, keys

    def _scalar(self, event: yaml.ScalarEvent, path: Path, origin: Origin) -> object:
        if not event.implicit[0]:  # quoted, or a block of text
            return event.value
        try:
            value = from_text(event.value)
        except NotFinite:
            self.faults.spoil(origin, path, "must be a finite number", event.value)
            return None
        if value is None:
            self.faults.spoil(origin, path, "has no value")
        return value
