"""Values put at the keys that overrides and sweeps name, and scenarios put in the place of their stems."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path as FilePath

from radarsim.config.check import allowed_keys, model_at, models_in, unknown_key
from radarsim.config.document import Document
from radarsim.config.faults import ABSENT, Faults, Origin, Path, shown
from radarsim.config.fields import DataFile, Model, Scenario, Study, in_degrees, in_radians
from radarsim.config.lookup import did_you_mean, is_stem, scenario_file, stems

Read = Callable[[FilePath, Faults], Document | None]


@dataclass(frozen=True)
class Setting:
    """A value to be put at a key, from an override or a sweep."""

    key: str
    value: object
    origin: Origin


class NoSuchKey(ValueError):
    """A key that the config has no place for; its text is the message."""


def place(document: Document, model: type[Study], setting: Setting, read: Read, faults: Faults) -> Document:
    """The document with a setting's value at the places its key means. Raises NoSuchKey."""
    first = setting.key.split(".")[0]
    if "." in setting.key and isinstance(document.data.get(first), str):
        document = scenarios_inlined(document, model, read, faults, only=first)
        if isinstance(document.data.get(first), str):
            return document  # no scenario, as noted, or a key without scenarios, as the check will report
    for path in key_paths(document, model, setting.key):
        document = _without_twin(document, path, model).graft(path, setting.value, setting.origin)
    return document


def key_paths(document: Document, model: type[Study], key: str, missing_ok: bool = False) -> list[Path]:
    """The places that a key of `sweep` or `--set` means: one, or for a bare filter key one in every filter that has it.

    Raises NoSuchKey, or gives none at all with missing_ok.
    """
    try:
        if "." in key or key in allowed_keys(model):
            return [_dotted(document, key)]
        return _in_every_member(document, model, key)
    except NoSuchKey:
        if missing_ok:
            return []
        raise


def _dotted(document: Document, key: str) -> Path:
    path: Path = ()
    for text in key.split("."):
        holder = document.get(path)
        if isinstance(holder, list):
            if not text.isdecimal() or int(text) >= len(holder):
                raise NoSuchKey(f"{'.'.join(map(str, path))} is a list: its items are 0 to {len(holder) - 1}")
            path = (*path, int(text))
        elif isinstance(holder, dict) or holder is ABSENT:
            path = (*path, text)
        elif isinstance(holder, str) and len(path) == 1:  # a scenario's stem; inlined before anything is put there
            return tuple(key.split("."))
        else:
            raise NoSuchKey(f"{'.'.join(map(str, path))} has no keys of its own")
    return path


def _in_every_member(document: Document, model: type[Study], key: str) -> list[Path]:
    members = document.data.get(model.bare_keys)
    known: list[str] = []
    paths: list[Path] = []
    for i in range(len(members) if isinstance(members, list) else 0):
        schema = model_at(model, document.data, (model.bare_keys, i))
        keys = allowed_keys(schema) if schema else []
        known += [k for k in keys if k not in known]
        if key in keys:
            paths.append((model.bare_keys, i, key))
    if not paths:
        raise NoSuchKey(unknown_key(key, [*allowed_keys(model), *known]))
    return paths


def _without_twin(document: Document, path: Path, model: type[Study]) -> Document:
    """The document without what the new value replaces: the same quantity in the other unit, or said another way."""
    twin = in_degrees(str(path[-1])) or in_radians(str(path[-1]))
    twin = twin or model.in_place_of.get(".".join(map(str, path)), "").rpartition(".")[2]
    if not twin or document.get((*path[:-1], twin)) is ABSENT:
        return document
    holder = document.get(path[:-1])
    assert isinstance(holder, dict)  # it has the twin
    return document.with_data(path[:-1], {key: value for key, value in holder.items() if key != twin})


def scenarios_inlined(
    document: Document, model: type[Study], read: Read, faults: Faults, only: str | None = None
) -> Document:
    """The document with the content of scenario files in place of their stems."""
    for field, info in model.model_fields.items():
        stem = document.data.get(field)
        wanted = only in (None, field) and any(isinstance(mark, Scenario) for mark in info.metadata)
        if not wanted or not isinstance(stem, str):
            continue
        origin, path = document.origin((field,)), (field,)
        if faults.spoiled(origin, path):
            continue
        file = scenario_file(stem, document.file) if is_stem(stem) else None
        if not is_stem(stem):
            faults.spoil(origin, path, "must be the stem of a scenario, without folder or suffix", stem)
        elif file is None:
            known = stems("scenarios")
            near = did_you_mean(stem, known) or f"; there are: {', '.join(known)}"
            faults.spoil(origin, path, f"no such scenario{near}", stem)
        elif scenario := read(file, faults):
            document = document.graft_document(path, scenario)
        else:
            faults.spoil(origin, path, "the scenario cannot be read", stem)
    return document


def data_files_found(document: Document, model: type[Study], faults: Faults) -> Document:
    """The document with a path that can be opened for each file of data, named from the folder of its own YAML file."""
    for path, value in list(_texts(document.data, ())) if _has_data_files(model) else ():
        holder = model_at(model, document.data, path[:-1])
        info = holder.model_fields.get(str(path[-1])) if holder else None
        if info is None or not any(isinstance(mark, DataFile) for mark in info.metadata):
            continue
        origin = document.origin(path)
        file = (FilePath(origin.source).parent if origin.line else FilePath()) / value
        if file.is_file():
            document = document.with_data(path, str(file))
        else:
            faults.spoil(origin, path, f"no such file: {shown(str(file))}")
    return document


@cache
def _has_data_files(model: type[Model]) -> bool:
    """Whether any field of a schema, or of those within it, names a file of data."""
    fields = model.model_fields.values()
    own = any(isinstance(mark, DataFile) for info in fields for mark in info.metadata)
    return own or any(_has_data_files(inner) for info in fields for inner in models_in(info.annotation))


def _texts(data: object, path: Path) -> Iterator[tuple[Path, str]]:
    """All texts under a key of their own, with their paths."""
    if isinstance(data, dict | list):
        for step, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from _texts(value, (*path, step))
    elif isinstance(data, str) and path and isinstance(path[-1], str):
        yield path, data
