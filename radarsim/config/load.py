"""YAML to checked experiments. The only file that imports yaml: it reads text, with line and column of every value.

`radarsim new`: a user's own config, from a known one, each key with its description beside it."""

import copy
import json
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

import yaml
from pydantic_core import PydanticUndefined

from radarsim.config.cases import Expander, Setting, changes_included, no_such_config
from radarsim.config.check import models_in
from radarsim.config.document import (
    RESERVED,
    Document,
    Faults,
    KeyPath,
    Origin,
    config_file,
    is_reserved,
    is_stem,
    one_line,
    short,
)
from radarsim.config.experiment import Experiment
from radarsim.config.fields import DEEPEST, Model, NotFinite, from_python, from_text, in_radians
from radarsim.config.schema import COMMON_KEYS, Common, Studies
from radarsim.errors import ConfigError, argument

# ---- load ------------------------------------------------------------------------------------------------------------
LARGEST_FILE = 256_000  # bytes
OPTIONS = ("realisations", "seed")  # overrides that are options of their own on the command line
WHOLE = {"kind", "minimise"}  # a mapping with one of these is a value, not keys to be changed one by one
Overrides = Mapping[str, Any] | Iterable[str]
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same events and marks, ten times faster


def load(source: str | os.PathLike[str] | Mapping[str, Any], overrides: Overrides, studies: Studies) -> Experiment:
    """The experiment that a config describes, fully checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), or a mapping like the YAML; for overrides
    see `texts`. Raises ConfigError, one line for each fault."""
    faults = Faults()
    settings = [setting for text in texts(overrides) if (setting := _setting(text, faults))]
    document: Document | None = None
    if isinstance(source, Mapping):
        document = _from_mapping(source, faults)
    elif isinstance(source, str | bytes | os.PathLike):
        document = _from_user(source, studies, faults)
    else:
        faults.add(Origin("config"), (), f"must be a path, a name or a mapping, got {repr(source)[:60]}")
    experiment = None
    if document is not None:
        by_path = not isinstance(source, Mapping) and document.file == Path(os.fsdecode(source))
        path = document.file if by_path else None
        experiment = Expander(read, settings, faults, studies, path).experiment(document)
    if document is not None and changes_included(document):
        faults.beside(document.origin(()).source)
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


def _from_user(source: str | bytes | os.PathLike[str], studies: Studies, faults: Faults) -> Document | None:
    """The config that the user gave by path or stem."""
    name = os.fsdecode(source)
    # A file without suffix and with a config's name does not hide it.
    found = config_file(name) if is_stem(name) else None
    by_path = os.path.isfile(name) and (bool(Path(name).suffix) or found is None)
    file = None if by_path else found
    if file is None and is_stem(name) and not by_path and not Path(name).suffix:
        faults.add(Origin(name), (), no_such_config(name, studies, known=True))
        return None
    file = file or Path(name)
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


def texts(overrides: Overrides) -> tuple[str, ...]:
    """Overrides as texts `dotted.key=value`, the value in YAML, as `--set` takes them.

    Or a mapping from keys, dotted or nested, to Python values: an inner mapping changes the keys in it, unless it is a
    complete value: a target with its `kind`. Raises ConfigError.

    >>> texts({"scans": 20, "radar": {"sigma_range_m": 300.0, "name": "mine"}})
    ('scans=20', 'radar.sigma_range_m=300.0', 'radar.name=mine')
    """
    if isinstance(overrides, Mapping):
        faults = Faults()
        found = tuple(_texts(overrides, "", faults))
        keys = [text.partition("=")[0] for text in found]
        for i, key in enumerate(keys):
            if other := next((one for one in keys[:i] if f"{one}.".startswith(f"{key}.")), None):
                faults.add(given(key), (), "is given twice" if other == key else f"overwrites {other}, given before it")
        faults.raise_if_any()
        return found
    if isinstance(overrides, str | bytes) or not isinstance(overrides, Iterable):
        example = '{"radar.sigma_range_m": 300}'
        raise ConfigError(f"overrides: must be a mapping such as {example}, or texts KEY=VALUE, got {overrides!r}")
    return tuple(map(str, overrides))


def _texts(values: Mapping[Any, Any], above: str, faults: Faults) -> Iterator[str]:
    for name, value in values.items():
        key = f"{above}{name}"
        if key.count(".") > DEEPEST:
            faults.add(given(".".join(key.split(".")[:3])), (), f"nested more than {DEEPEST} deep")
            return
        if isinstance(value, Mapping) and value and not WHOLE & value.keys():
            yield from _texts(value, f"{key}.", faults)
            continue
        plain = from_python(value, (), origin := given(key), faults)
        if not faults.spoiled(origin, ()):
            yield f"{key}={_literal(plain)}"


def _literal(value: object) -> str:
    """A plain value as YAML in one line."""
    if isinstance(value, str) and PLAIN.fullmatch(value) and from_text(value) == value == value.strip():
        return value
    return json.dumps(value, ensure_ascii=False)


def given(key: str) -> Origin:
    """The argument that gives an override: one of its own, or one of several."""
    return Origin(argument(key) if key in OPTIONS else argument(f"overrides[{key!r}]", f"--set {key}"), key=key)


def _setting(text: str, faults: Faults) -> Setting | None:
    """An override `key=value`, its value read as YAML."""
    key, equals, value = text.partition("=")
    key = key.strip()
    origin = given(key)
    if not equals or not key or not all(key.split(".")):
        faults.add(given(text), (), "must be KEY=VALUE, with a dotted KEY")
        return None
    read_value = parse(value, origin.source, faults, plain_origin=origin)
    return None if read_value is None else Setting(key, read_value.data, origin)


def read(file: Path, faults: Faults) -> Document | None:
    """The document in a file; None, with a fault noted, if there is none."""
    shown = str(file)
    try:
        kind = file.stat().st_mode  # from Python 3.14 on, Path.is_file returns False without access
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
    """YAML text as a document; None, with a fault noted, if it is not YAML of the plain kind accepted here."""
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
        pass  # the fault is noted; nothing after it can be understood
    else:
        return Document(data, source, None, reader.values, reader.keys)
    return None


class _Refused(Exception):
    """The rest of the text is unreadable."""


class _Reader:
    """Builds plain data from the events of the YAML parser, no deeper than allowed, and notes the origins."""

    def __init__(self, source: str, faults: Faults, plain_origin: Origin | None):
        self.source, self.faults, self.plain_origin = source, faults, plain_origin
        self.values: dict[KeyPath, Origin] = {}
        self.keys: dict[KeyPath, Origin] = {}

    def origin(self, mark: "yaml.Mark | yaml._yaml.Mark | None") -> Origin:
        """The origin of a mark; in an override, the override."""
        if self.plain_origin or mark is None:
            return self.plain_origin or Origin(self.source)
        return Origin(self.source, mark.line + 1, mark.column + 1)

    def document(self, events: Iterable[yaml.Event]) -> object:
        """The data of the one document that must be there."""
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

    def _node(self, event: yaml.NodeEvent, path: KeyPath) -> object:
        origin = self.values[path] = self.origin(event.start_mark)
        if len(path) > DEEPEST:
            self.faults.add(origin, (), f"nested more than {DEEPEST} deep")
            raise _Refused
        if isinstance(event, yaml.AliasEvent):
            self.faults.spoil(origin, path, f"aliases (*{event.anchor}) are not read: write the value out")
            return None
        if event.anchor is not None:
            self.faults.add(origin, path, f"anchors (&{event.anchor}) are not read")
        assert isinstance(event, yaml.CollectionStartEvent | yaml.ScalarEvent)  # besides aliases there is nothing else
        if event.tag is not None:
            self.faults.spoil(origin, path, f"tags ({event.tag}) are not read")
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(path)
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, path, origin)
        return self._mapping(path)

    def _sequence(self, path: KeyPath) -> list[object]:
        items: list[object] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            items.append(self._node(event, (*path, len(items))))
        return items

    def _mapping(self, path: KeyPath) -> dict[str, object]:
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

    def _skip(self, path: KeyPath, key: str) -> None:
        """Skip an unwanted value, without touching the origins of the wanted one."""
        values, keys = self.values, self.keys
        self.values, self.keys = {}, {}
        self._node(next(self.events), (*path, key))
        self.values, self.keys = values, keys

    def _scalar(self, event: yaml.ScalarEvent, path: KeyPath, origin: Origin) -> object:
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


# ---- starter ---------------------------------------------------------------------------------------------------------
PLAIN = re.compile(r"[A-Za-z_][\w+ .*-]*")  # text that YAML reads as text without quotes
RESERVED_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "none"}
COLUMN = 44  # at which comments begin
WIDTH = 110
DEGREES = {"rad": "degrees", "rad/s": "degrees per second"}


def starter(data: Mapping[str, Any], study_keys: type[Model], name: str, like: str) -> str:
    """YAML of a config's data (as read, keys as written) under a new name, each key with the schema's description.
    Missing optional keys follow, commented out, with their defaults."""
    lines = [
        f"# {name}.yaml — like {like}: change the numbers, then `radarsim run {name}.yaml`",
        "# Units stand in the keys: _m, _s, _mps (m/s), _mps2 (m/s²), _hz, _rad; _deg is taken wherever _rad is.",
    ]
    common = {key: value for key, value in data.items() if key in COMMON_KEYS}
    own = {key: value for key, value in data.items() if key not in COMMON_KEYS}
    # A display name (of a radar, a sensor) becomes the config's name.
    named = {key: value for key, value in own.items() if isinstance(value, Mapping) and "name" in value}
    own |= {key: {**value, "name": name} for key, value in named.items()}
    for key in ("study", "include"):
        if key in common:
            lines += _entry(key, common.pop(key), Common, "")
    if own:  # what lies over an included config says nothing of the keys that it does not name
        lines += _mapping(own, study_keys, "", optional="include" not in data)
    lines += [line for key, value in common.items() for line in _entry(key, value, Common, "")]
    missing = [key for key in ("sweep", "realisations", "seed") if key not in data]
    samples = {"sweep": "{some_key: [1, 2, 3]}", "realisations": "1e5", "seed": "1"}
    lines += [_line(f"# {key}: {samples[key]}", _about(Common, key)) for key in missing]
    return "\n".join(lines) + "\n"


def _mapping(data: Mapping[str, Any], model: type[Model] | None, indent: str, optional: bool) -> list[str]:
    """The lines of a mapping, and of the optional keys it lacks."""
    lines = [line for key, value in data.items() for line in _entry(key, value, model, indent, optional)]
    if optional and model is not None:
        given = {in_radians(key) or key for key in data} | set(data)
        for key, field in model.model_fields.items():
            default = field.default
            if key not in given and default is not PydanticUndefined:
                value = "…" if default is None or isinstance(default, Model) or default in ((), {}) else flow(default)
                lines.append(_line(f"{indent}# {key}: {value}", _about(model, key)))
    return lines


def _entry(key: str, value: object, model: type[Model] | None, indent: str, optional: bool = True) -> list[str]:
    """The lines of one key: short values beside it, mappings, with the optional keys they lack, and lists below."""
    about, inner = _about(model, key), _inner(model, key, value)
    if isinstance(value, Mapping) and inner is not None and key != "sweep":
        return [_line(f"{indent}{key}:", about), *_mapping(value, inner, indent + "  ", optional)]
    if isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
        lines = [_line(f"{indent}{key}:", about)]
        if inner is not None:
            used = list(dict.fromkeys(name for one in value for name in one))
            lines += [f"{indent}  # {name}: {_about(inner, name)}" for name in used if _about(inner, name)]
        return [*lines, *(line for one in value for line in _item(one, indent))]
    return [_line(f"{indent}{key}: {flow(value)}", about)]


def _item(one: Mapping[str, Any], indent: str) -> Iterator[str]:
    """A mapping of a list: in one line where it fits, else a key a line."""
    whole = f"{indent}  - {flow(one)}"
    if len(whole) <= WIDTH:
        yield whole
        return
    for n, (key, value) in enumerate(one.items()):
        yield f"{indent}  {'-' if n == 0 else ' '} {key}: {flow(value)}"


def _line(text: str, about: str) -> str:
    return f"{text:<{COLUMN}}  # {about}" if about else text


def _about(model: type[Model] | None, key: str) -> str:
    """The schema's description of a key; in degrees with that unit."""
    if model is None:
        return ""
    name = key if key in model.model_fields else in_radians(key)
    if name is None or name not in model.model_fields:
        return ""
    about = " ".join((model.model_fields[name].description or "").split())
    if name != key:
        for unit, degrees in sorted(DEGREES.items(), reverse=True):
            about = re.sub(rf"(?<=, ){re.escape(unit)}(?![\w/])", degrees, about)
    return about


def _inner(model: type[Model] | None, key: str, value: object) -> type[Model] | None:
    """The model of a key's mapping, or of the members of its list: of several the one with matching keys and kind."""
    if model is None or key not in model.model_fields:
        return None
    members = value if isinstance(value, list) else [value]
    found = [
        one
        for one in models_in(model.model_fields[key].annotation)
        if all(isinstance(member, Mapping) and _fits(one, member) for member in members)
    ]
    return found[0] if found else None


def _fits(model: type[Model], data: Mapping[str, Any]) -> bool:
    kind = model.model_fields.get("kind")
    if kind is not None and "kind" in data and data["kind"] not in get_args(kind.annotation):
        return False
    return all((in_radians(key) or key) in model.model_fields or key in model.model_fields for key in data)


def flow(value: object) -> str:
    """A value as YAML in one line; numbers at their shortest."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return short(value)
        case list() | tuple():
            return "[" + ", ".join(map(flow, value)) + "]"
        case Mapping():
            return "{" + ", ".join(f"{key}: {flow(one)}" for key, one in value.items()) + "}"
    text = str(value)
    return (
        text
        if PLAIN.fullmatch(text) and text == text.strip() and text.lower() not in RESERVED_WORDS
        else json.dumps(text)
    )


# ---- own -------------------------------------------------------------------------------------------------------------
def new(
    name: str,
    like: str | os.PathLike[str],
    studies: Studies,
    values: Mapping[str, float] = MappingProxyType({}),
    overrides: Overrides = (),
) -> tuple[str, str]:
    """The name of the file of a new config, NAME with or without suffix given, and its text, from a known config.

    values by dotted key replace those of the known config, with its overrides; a bare key means that key in every
    filter. Raises ConfigError for an impossible name, and for overrides of several cases."""
    name = name.removesuffix(".yaml")
    if is_reserved(name):
        raise ConfigError(f"{name}: {RESERVED}")
    if not is_stem(name):
        raise ConfigError(
            f"{one_line(name)}: must be a plain name of letters, digits and _ + = - . without folder or suffix, that "
            "begins with a letter, a digit or _"
        )
    experiment = load(like, overrides, studies)
    if overrides and len(experiment.cases) > 1:
        where = argument("overrides", "--set")
        raise ConfigError(
            f"{where}: a config of {len(experiment.cases)} cases is written without: put it into the config"
        )
    faults = Faults()
    document = read(Path(experiment.path or like), faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is a fault
    data = copy.deepcopy(dict(document.data))
    file = Path(experiment.path or like)
    lost = any(_place(name) != _place(name, file) for name in data.get("include", ()))  # what lies beside it alone
    inherits = "include" in data and (values or lost)  # values have their places in the whole
    if (overrides or inherits) and len(experiment.cases) == 1:
        (case,) = experiment.cases
        data = {"study": case.study, **case.keys, "realisations": case.realisations, "seed": case.seed}
    elif "include" in data:
        for top in {key.partition(".")[0] if "." in key else "filters" for key in values}:
            each = [case.keys[top] for case in experiment.cases]
            if any(one != each[0] for one in each):
                raise ConfigError(f"{experiment.stem}: its cases differ in {top}: begin from a config that it includes")
            data[top] = copy.deepcopy(each[0])
    for key, value in values.items():
        _put(data, key, value)
    return f"{name}.yaml", starter(data, studies.keys(experiment.study), name, experiment.stem)


def _place(name: str, beside: Path | None = None) -> Path | None:
    """The file of a config included by a file, or from here."""
    found = config_file(name, beside)
    return found and found.resolve()


def _put(data: dict[str, Any], key: str, value: float) -> None:
    """Put a number at a dotted key, or at a bare one in every filter; an angle, rad, also replaces its twin."""
    *path, last = key.split(".")
    places: list[Any] = data.get("filters", []) if not path else [data]
    for place in places:
        for step in path:
            place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
        if last.endswith("_rad"):
            place.pop(f"{last.removesuffix('rad')}deg", None)
        place[int(last) if isinstance(place, list) else last] = value
