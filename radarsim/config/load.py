"""From YAML to checked experiments. Only this file imports yaml: it reads text, with line and column of each value.

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
MAX_FILE_BYTES = 256_000  # bytes
OVERRIDES_WITH_OPTION = ("realisations", "seed")  # overrides that are options of their own on the command line
KEYS_OF_WHOLE_VALUES = {"kind", "minimise"}  # a mapping with one of these is a value, not keys to be changed one by one
Overrides = Mapping[str, Any] | Iterable[str]
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same events and marks, ten times faster


def load(source: str | os.PathLike[str] | Mapping[str, Any], overrides: Overrides, studies: Studies) -> Experiment:
    """The experiment that a config describes, fully checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), or a mapping like the YAML; for overrides
    see `texts`. Raises ConfigError, one line for each fault."""
    faults = Faults()
    settings = [setting for text in texts(overrides) if (setting := parse_setting(text, faults))]
    document: Document | None = None
    if isinstance(source, Mapping):
        document = _from_mapping(source, faults)
    elif isinstance(source, str | bytes | os.PathLike):
        document = _find_config(source, studies, faults)
    else:
        faults.add(Origin("config"), (), f"must be a path, a name or a mapping, got {repr(source)[:60]}")
    experiment = None
    if document is not None:
        is_path = not isinstance(source, Mapping) and document.file == Path(os.fsdecode(source))
        path = document.file if is_path else None
        experiment = Expander(read, settings, faults, studies, path).experiment(document)
    if document is not None and changes_included(document):
        faults.name_overlaying_file(document.origin(()).source)
    faults.raise_if_any()
    assert experiment is not None  # without one there is a fault
    return experiment


def as_yaml(value: Mapping[str, Any]) -> str:
    """Plain data as YAML text: keys in their order, short lists on one line."""
    text: str = yaml.dump(
        value, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=110, default_flow_style=None
    )
    return text


class _PlainDumper(yaml.SafeDumper):
    """Writes equal values twice and never as an alias, which `read` refuses."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _from_mapping(source: Mapping[str, Any], faults: Faults) -> Document:
    origin = Origin("config")
    return Document(from_python(source, (), origin, faults), "config", None, {(): origin})


def _find_config(source: str | bytes | os.PathLike[str], studies: Studies, faults: Faults) -> Document | None:
    """The config that the user gave by its path or stem; None, with an error added, if there is none."""
    name = os.fsdecode(source)
    # A file without suffix and with a config's name does not hide it.
    config_path = config_file(name) if is_stem(name) else None
    is_path = os.path.isfile(name) and (bool(Path(name).suffix) or config_path is None)
    file = None if is_path else config_path
    if file is None and is_stem(name) and not is_path and not Path(name).suffix:
        faults.add(Origin(name), (), no_such_config(name, studies, list_names=True))
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
    """Overrides as texts `dotted.key=value`, with the value in YAML, as `--set` takes them.

    A mapping from keys, dotted or nested, to Python values is converted. An inner mapping changes the keys in it,
    unless it is a complete value, such as a target with its `kind`. Raises ConfigError.

    >>> texts({"scans": 20, "radar": {"sigma_range_m": 300.0, "name": "mine"}})
    ('scans=20', 'radar.sigma_range_m=300.0', 'radar.name=mine')
    """
    if isinstance(overrides, Mapping):
        faults = Faults()
        override_texts = tuple(_override_texts(overrides, "", faults))
        keys = [text.partition("=")[0] for text in override_texts]
        for i, key in enumerate(keys):
            if overlapping_key := next(
                (earlier_key for earlier_key in keys[:i] if f"{earlier_key}.".startswith(f"{key}.")), None
            ):
                faults.add(
                    given(key),
                    (),
                    "is given twice" if overlapping_key == key else f"overwrites {overlapping_key}, given before it",
                )
        faults.raise_if_any()
        return override_texts
    if isinstance(overrides, str | bytes) or not isinstance(overrides, Iterable):
        example = '{"radar.sigma_range_m": 300}'
        raise ConfigError(f"overrides: must be a mapping such as {example}, or texts KEY=VALUE, got {overrides!r}")
    return tuple(map(str, overrides))


def _override_texts(values: Mapping[Any, Any], prefix: str, faults: Faults) -> Iterator[str]:
    for name, value in values.items():
        key = f"{prefix}{name}"
        if key.count(".") > DEEPEST:
            faults.add(given(".".join(key.split(".")[:3])), (), f"nested more than {DEEPEST} deep")
            return
        if isinstance(value, Mapping) and value and not KEYS_OF_WHOLE_VALUES & value.keys():
            yield from _override_texts(value, f"{key}.", faults)
            continue
        plain_value = from_python(value, (), origin := given(key), faults)
        if not faults.spoiled(origin, ()):
            yield f"{key}={_yaml_literal(plain_value)}"


def _yaml_literal(value: object) -> str:
    """A plain value as YAML on one line."""
    if isinstance(value, str) and PLAIN_TEXT.fullmatch(value) and from_text(value) == value == value.strip():
        return value
    return json.dumps(value, ensure_ascii=False)


def given(key: str) -> Origin:
    """The argument that gives an override: an option of its own, or one of the overrides."""
    return Origin(
        argument(key) if key in OVERRIDES_WITH_OPTION else argument(f"overrides[{key!r}]", f"--set {key}"), key=key
    )


def parse_setting(text: str, faults: Faults) -> Setting | None:
    """An override `key=value`, with its value read as YAML; None, with an error added, if it is not one."""
    key, equals_sign, value = text.partition("=")
    key = key.strip()
    origin = given(key)
    if not equals_sign or not key or not all(key.split(".")):
        faults.add(given(text), (), "must be KEY=VALUE, with a dotted KEY")
        return None
    document = parse(value, origin.source, faults, plain_origin=origin)
    return None if document is None else Setting(key, document.data, origin)


def read(file: Path, faults: Faults) -> Document | None:
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
    document = parse(text, name, faults)
    if document is None:
        return None
    if not isinstance(document.data, dict):
        if not faults.spoiled(document.origin(()), ()):
            faults.add(document.origin(()), (), "must be a mapping of keys", document.data)
        return None
    return Document(document.data, name, file, document.values, document.keys)


def _read_bytes(file: Path, faults: Faults) -> bytes | None:
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


def parse(text: str, source: str, faults: Faults, plain_origin: Origin | None = None) -> Document | None:
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

    def __init__(self, source: str, faults: Faults, plain_origin: Origin | None):
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
            self.faults.spoil(origin, path, f"aliases (*{event.anchor}) are not read: write the value out")
            return None
        if event.anchor is not None:
            self.faults.add(origin, path, f"anchors (&{event.anchor}) are not read")
        assert isinstance(event, yaml.CollectionStartEvent | yaml.ScalarEvent)  # besides aliases there is nothing else
        if event.tag is not None:
            self.faults.spoil(origin, path, f"tags ({event.tag}) are not read")
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
            self.faults.spoil(origin, path, "must be a finite number", event.value)
            return None
        if value is None:
            self.faults.spoil(origin, path, "has no value")
        return value


# ---- starter ---------------------------------------------------------------------------------------------------------
PLAIN_TEXT = re.compile(r"[A-Za-z_][\w+ .*-]*")  # text that YAML reads as text without quotes
RESERVED_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "none"}
COMMENT_COLUMN = 44  # at which comments begin
LINE_WIDTH = 110
DEGREE_UNITS = {"rad": "degrees", "rad/s": "degrees per second"}


def starter(data: Mapping[str, Any], study_keys: type[Model], name: str, like: str) -> str:
    """The YAML of a config under a new name, each key with its description from the schema.

    data: as read, with keys as written. Missing optional keys follow as comments, with their defaults."""
    lines = [
        f"# {name}.yaml — like {like}: change the numbers, then `radarsim run {name}.yaml`",
        "# Units stand in the keys: _m, _s, _mps (m/s), _mps2 (m/s²), _hz, _rad; _deg is taken wherever _rad is.",
    ]
    common_data = {key: value for key, value in data.items() if key in COMMON_KEYS}
    study_data = {key: value for key, value in data.items() if key not in COMMON_KEYS}
    # The display name of a radar or sensor becomes the config's name.
    named_parts = {key: value for key, value in study_data.items() if isinstance(value, Mapping) and "name" in value}
    study_data |= {key: {**value, "name": name} for key, value in named_parts.items()}
    for key in ("study", "include"):
        if key in common_data:
            lines += _key_lines(key, common_data.pop(key), Common, "")
    if study_data:  # keys laid over an included config need not be complete
        lines += _mapping_lines(study_data, study_keys, "", optional="include" not in data)
    lines += [line for key, value in common_data.items() for line in _key_lines(key, value, Common, "")]
    missing_keys = [key for key in ("sweep", "realisations", "seed") if key not in data]
    samples = {"sweep": "{some_key: [1, 2, 3]}", "realisations": "1e5", "seed": "1"}
    lines += [_with_comment(f"# {key}: {samples[key]}", _description(Common, key)) for key in missing_keys]
    return "\n".join(lines) + "\n"


def _mapping_lines(data: Mapping[str, Any], model: type[Model] | None, indent: str, optional: bool) -> list[str]:
    """The lines of a mapping, and comments for the optional keys that it lacks."""
    lines = [line for key, value in data.items() for line in _key_lines(key, value, model, indent, optional)]
    if optional and model is not None:
        given_keys = {in_radians(key) or key for key in data} | set(data)
        for key, field in model.model_fields.items():
            default = field.default
            if key not in given_keys and default is not PydanticUndefined:
                value = "…" if default is None or isinstance(default, Model) or default in ((), {}) else flow(default)
                lines.append(_with_comment(f"{indent}# {key}: {value}", _description(model, key)))
    return lines


def _key_lines(key: str, value: object, model: type[Model] | None, indent: str, optional: bool = True) -> list[str]:
    """The lines of one key: a short value beside it, a mapping or a list of mappings below."""
    description, inner_model = _description(model, key), _inner_model(model, key, value)
    if isinstance(value, Mapping) and inner_model is not None and key != "sweep":
        return [
            _with_comment(f"{indent}{key}:", description),
            *_mapping_lines(value, inner_model, indent + "  ", optional),
        ]
    if isinstance(value, list) and value and all(isinstance(member, Mapping) for member in value):
        lines = [_with_comment(f"{indent}{key}:", description)]
        if inner_model is not None:
            used_keys = list(dict.fromkeys(name for member in value for name in member))
            lines += [
                f"{indent}  # {name}: {_description(inner_model, name)}"
                for name in used_keys
                if _description(inner_model, name)
            ]
        return [*lines, *(line for member in value for line in _item_lines(member, indent))]
    return [_with_comment(f"{indent}{key}: {flow(value)}", description)]


def _item_lines(mapping: Mapping[str, Any], indent: str) -> Iterator[str]:
    """A mapping in a list: on one line if it fits, else one key per line."""
    line = f"{indent}  - {flow(mapping)}"
    if len(line) <= LINE_WIDTH:
        yield line
        return
    for index, (key, value) in enumerate(mapping.items()):
        yield f"{indent}  {'-' if index == 0 else ' '} {key}: {flow(value)}"


def _with_comment(text: str, comment: str) -> str:
    """A line of YAML with a comment, if there is one."""
    return f"{text:<{COMMENT_COLUMN}}  # {comment}" if comment else text


def _description(model: type[Model] | None, key: str) -> str:
    """The description of a key in its schema; of a key in degrees with that unit."""
    if model is None:
        return ""
    name = key if key in model.model_fields else in_radians(key)
    if name is None or name not in model.model_fields:
        return ""
    description = " ".join((model.model_fields[name].description or "").split())
    if name != key:
        for unit, degree_unit in sorted(DEGREE_UNITS.items(), reverse=True):
            description = re.sub(rf"(?<=, ){re.escape(unit)}(?![\w/])", degree_unit, description)
    return description


def _inner_model(model: type[Model] | None, key: str, value: object) -> type[Model] | None:
    """The schema of a key's mapping or of its list's members; among several, the first with the same keys and kind."""
    if model is None or key not in model.model_fields:
        return None
    members = value if isinstance(value, list) else [value]
    matching = [
        candidate
        for candidate in models_in(model.model_fields[key].annotation)
        if all(isinstance(member, Mapping) and _has_keys_of(candidate, member) for member in members)
    ]
    return matching[0] if matching else None


def _has_keys_of(model: type[Model], data: Mapping[str, Any]) -> bool:
    """Whether a schema has all keys of a mapping, and its kind."""
    kind = model.model_fields.get("kind")
    if kind is not None and "kind" in data and data["kind"] not in get_args(kind.annotation):
        return False
    return all((in_radians(key) or key) in model.model_fields or key in model.model_fields for key in data)


def flow(value: object) -> str:
    """A value as YAML on one line, numbers as short as possible."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return short(value)
        case list() | tuple():
            return "[" + ", ".join(map(flow, value)) + "]"
        case Mapping():
            return "{" + ", ".join(f"{key}: {flow(item)}" for key, item in value.items()) + "}"
    text = str(value)
    is_plain = PLAIN_TEXT.fullmatch(text) and text == text.strip() and text.lower() not in RESERVED_WORDS
    return text if is_plain else json.dumps(text)


# ---- own -------------------------------------------------------------------------------------------------------------
def new(
    name: str,
    like: str | os.PathLike[str],
    studies: Studies,
    values: Mapping[str, float] = MappingProxyType({}),
    overrides: Overrides = (),
) -> tuple[str, str]:
    """The file name of a new config, from NAME with or without suffix, and its text, made from a known config.

    values by dotted key replace those of the known config with its overrides; a bare key stands for that key in every
    filter. Raises ConfigError for an impossible name, and for overrides of a config with several cases."""
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
    data = _data_for_new_config(experiment, Path(experiment.path or like), values, has_overrides=bool(overrides))
    for key, value in values.items():
        _set_number(data, key, value)
    return f"{name}.yaml", starter(data, studies.keys(experiment.study), name, experiment.stem)


def _data_for_new_config(
    experiment: Experiment, file: Path, values: Mapping[str, float], has_overrides: bool
) -> dict[str, Any]:
    """The data of a config as its file has it, or of its only case as a whole where the file alone does not suffice."""
    faults = Faults()
    document = read(file, faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is an error
    data = copy.deepcopy(dict(document.data))
    # Includes that lie beside the known config are not found from here, and values have their places in the whole.
    loses_includes = any(_included_file(stem) != _included_file(stem, file) for stem in data.get("include", ()))
    needs_whole_case = "include" in data and (values or loses_includes)
    if (has_overrides or needs_whole_case) and len(experiment.cases) == 1:
        (case,) = experiment.cases
        return {"study": case.study, **case.keys, "realisations": case.realisations, "seed": case.seed}
    if "include" in data:
        for key in {key.partition(".")[0] if "." in key else "filters" for key in values}:
            first_value, *other_values = (case.keys[key] for case in experiment.cases)
            if any(value != first_value for value in other_values):
                raise ConfigError(f"{experiment.stem}: its cases differ in {key}: begin from a config that it includes")
            data[key] = copy.deepcopy(first_value)
    return data


def _included_file(name: str, including_file: Path | None = None) -> Path | None:
    """The file that a stem under `include` means, in a config or from the working directory."""
    file = config_file(name, including_file)
    return file and file.resolve()


def _set_number(data: dict[str, Any], key: str, value: float) -> None:
    """Set a number at a dotted key, or at a bare key in every filter; an angle in radians removes that in degrees."""
    *path, last_step = key.split(".")
    holders: list[Any] = data.get("filters", []) if not path else [data]
    for holder in holders:
        for step in path:
            holder = holder[int(step)] if isinstance(holder, list) else holder.setdefault(step, {})
        if last_step.endswith("_rad"):
            holder.pop(f"{last_step.removesuffix('rad')}deg", None)
        holder[int(last_step) if isinstance(holder, list) else last_step] = value
