"""From YAML text to documents, with line and column of each value, and from plain data to YAML.

Only this file imports yaml."""

import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.scalars import DEEPEST, NotFinite, from_text
from radarsim.config.value_text import KeyPath

MAX_FILE_BYTES = 256_000  # bytes
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same events and marks, ten times faster


def as_yaml(value: Mapping[str, Any]) -> str:
    """Plain data as YAML text: keys in their order, short lists on one line."""
    text: str = yaml.dump(
        value, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=110, default_flow_style=None
    )
    return text


class _PlainDumper(yaml.SafeDumper):
    """Writes equal values twice and never as an alias, which `parse_yaml` refuses."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def read_document(file: Path, faults: ErrorList) -> Document | None:
    """The document in a file; None, with an error added, if it cannot be read."""
    name = str(file)
    content = _read_bytes(file, faults)
    if content is None:
        return None
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        faults.add(Origin(name, line, column), (), "is not UTF-8 text")
        return None
    document = parse_yaml(text, name, faults)
    if document is None:
        return None
    if not isinstance(document.data, dict):
        if not faults.is_unusable(document.origin(()), ()):
            faults.add(document.origin(()), (), "must be a mapping of keys", document.data)
        return None
    return Document(document.data, name, file, document.values, document.keys)


def _read_bytes(file: Path, faults: ErrorList) -> bytes | None:
    """The content of a regular file of at most MAX_FILE_BYTES; None, with an error added, for anything else."""
    name = str(file)
    try:
        mode = file.stat().st_mode  # from Python 3.14 on, Path.is_file returns False without access
        if not stat.S_ISREG(mode):
            faults.add(Origin(name), (), "is a directory" if stat.S_ISDIR(mode) else "is not a regular file")
            return None
        with file.open("rb") as stream:
            content = stream.read(MAX_FILE_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError):
        faults.add(Origin(name), (), "no such file")
        return None
    except (OSError, ValueError) as error:
        faults.add(Origin(name), (), f"cannot be read: {getattr(error, 'strerror', None) or error}")
        return None
    if len(content) > MAX_FILE_BYTES:
        faults.add(Origin(name), (), f"larger than {MAX_FILE_BYTES // 1000} kB")
        return None
    return content


def parse_yaml(text: str, source: str, faults: ErrorList, plain_origin: Origin | None = None) -> Document | None:
    """YAML text as a document; None, with an error added, if it is not YAML of the plain kind accepted here."""
    reader = _YamlReader(source, faults, plain_origin)
    try:
        data = reader.document(yaml.parse(text, Loader=LOADER))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = " ".join(filter(None, (error.context, error.problem)))
        faults.add(reader.origin(mark), (), f"not valid YAML: {problem}")
    except yaml.reader.ReaderError as error:
        position = min(error.position, len(text))
        line = text.count("\n", 0, position)
        column = position - (text.rfind("\n", 0, position) + 1)
        faults.add(plain_origin or Origin(source, line + 1, column + 1), (), f"not valid YAML: {error.reason}")
    except UnicodeEncodeError:
        faults.add(plain_origin or Origin(source), (), "is not UTF-8 text")
    except _UnreadableError:
        pass  # its error is added; what follows cannot be understood
    else:
        return Document(data, source, None, reader.values, reader.keys)
    return None


class _UnreadableError(Exception):
    """What follows in the text cannot be read."""


class _YamlReader:
    """Builds plain data from the events of the YAML parser, down to DEEPEST levels, and keeps the origins of values."""

    def __init__(self, source: str, faults: ErrorList, plain_origin: Origin | None):
        self.source, self.faults, self.plain_origin = source, faults, plain_origin
        self.values: dict[KeyPath, Origin] = {}
        self.keys: dict[KeyPath, Origin] = {}

    def origin(self, mark: "yaml.Mark | yaml._yaml.Mark | None") -> Origin:
        """The origin of a mark; within an override, that of the override."""
        if self.plain_origin or mark is None:
            return self.plain_origin or Origin(self.source)
        return Origin(self.source, mark.line + 1, mark.column + 1)

    def document(self, events: Iterable[yaml.Event]) -> object:
        """The data of the text, which must hold exactly one document."""
        self.events: Iterator[Any]  # of yaml.Event; which kind follows is known from the one before
        self.events = (e for e in events if not isinstance(e, yaml.StreamStartEvent | yaml.DocumentEndEvent))
        if isinstance(next(self.events), yaml.StreamEndEvent):
            self.faults.add(self.plain_origin or Origin(self.source), (), "is empty")
            raise _UnreadableError
        data = self._read_node(next(self.events), ())
        extra = next(self.events)
        if not isinstance(extra, yaml.StreamEndEvent):
            self.faults.add(self.origin(extra.start_mark), (), "there must be one YAML document, here begins another")
        return data

    def _read_node(self, event: yaml.NodeEvent, path: KeyPath) -> object:
        origin = self.values[path] = self.origin(event.start_mark)
        if len(path) > DEEPEST:
            self.faults.add(origin, (), f"nested more than {DEEPEST} deep")
            raise _UnreadableError
        if isinstance(event, yaml.AliasEvent):
            self.faults.mark_unusable(origin, path, f"aliases (*{event.anchor}) are not read: write the value out")
            return None
        if event.anchor is not None:
            self.faults.add(origin, path, f"anchors (&{event.anchor}) are not read")
        assert isinstance(event, yaml.CollectionStartEvent | yaml.ScalarEvent)  # besides aliases there is nothing else
        if event.tag is not None:
            self.faults.mark_unusable(origin, path, f"tags ({event.tag}) are not read")
        if isinstance(event, yaml.SequenceStartEvent):
            return self._read_sequence(path)
        if isinstance(event, yaml.ScalarEvent):
            return self._read_scalar(event, path, origin)
        return self._read_mapping(path)

    def _read_sequence(self, path: KeyPath) -> list[object]:
        items: list[object] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            items.append(self._read_node(event, (*path, len(items))))
        return items

    def _read_mapping(self, path: KeyPath) -> dict[str, object]:
        mapping: dict[str, object] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            origin = self.origin(event.start_mark)
            if not isinstance(event, yaml.ScalarEvent) or event.anchor or event.tag:
                self.faults.add(origin, path, "a key must be a plain word")
                raise _UnreadableError
            key = event.value
            if key in mapping:
                first_origin = self.keys[(*path, key)]
                first_place = f", first in line {first_origin.line}" if first_origin.line else ""
                self.faults.add(origin, (*path, key), f"duplicate key{first_place}")
                self._skip_value(path, key)
                continue
            mapping[key] = None
            self.keys[(*path, key)] = origin
            mapping[key] = self._read_node(next(self.events), (*path, key))
        return mapping

    def _skip_value(self, path: KeyPath, key: str) -> None:
        """Skip the value of a duplicate key, and keep the origins of the first one."""
        values, keys = self.values, self.keys
        self.values, self.keys = {}, {}
        self._read_node(next(self.events), (*path, key))
        self.values, self.keys = values, keys

    def _read_scalar(self, event: yaml.ScalarEvent, path: KeyPath, origin: Origin) -> object:
        if not event.implicit[0]:  # quoted, or a block of text
            return event.value
        try:
            value = from_text(event.value)
        except NotFinite:
            self.faults.mark_unusable(origin, path, "must be a finite number", event.value)
            return None
        if value is None:
            self.faults.mark_unusable(origin, path, "has no value")
        return value
