"""The parts of a checked config that decide its numbers and its noise, as plain data, and their hash."""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from radarsim.config.marks import DataFile, DesignMark, DisplayMark, LaterKeyMark, NameIn


def digest(value: object) -> str:
    """The SHA-256, in hexadecimal, of plain data: numbers in their shortest exact form, keys sorted."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def identity_keys(spec: BaseModel) -> dict[str, Any]:
    """All keys that change a number, with defaults, in SI units; without display names."""
    return _plain_data(spec, (DisplayMark,))


def world_keys(spec: BaseModel) -> dict[str, Any]:
    """The keys of the observed world, without filters and number of scans: cases of one world share their noise."""
    return _plain_data(spec, (DisplayMark, DesignMark))


def all_keys(spec: BaseModel) -> dict[str, Any]:
    """All keys with a value, including names: they can be read back as the same config."""
    return _plain_data(spec, ())


def recorded_keys(spec: BaseModel) -> dict[str, Any]:
    """All keys with a value, data files by their names alone: the same on every machine."""
    keys: dict[str, Any] = _without_folders(spec, all_keys(spec))
    return keys


def _without_folders(value: object, data: Any) -> Any:
    """The plain data of a value without the folders of its data files."""
    if isinstance(value, BaseModel):
        files = {
            name
            for name, info in type(value).model_fields.items()
            if any(isinstance(mark, DataFile) for mark in info.metadata)
        }
        return {
            key: Path(item).name if key in files else _without_folders(getattr(value, key), item)
            for key, item in data.items()
        }
    if isinstance(value, tuple | list):
        return [_without_folders(item, inner) for item, inner in zip(value, data, strict=True)]
    return data


def portable_filter(keys: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a user filter without folders of this machine: its file, and all that its keys name by an absolute
    path, by name alone."""
    values = {key: _name_of_absolute(value) for key, value in keys.items()}
    return values | {"python": portable_code(str(keys["python"]))}


def portable_code(place: str) -> str:
    """Where code is, FILE.py:NAME or MODULE:NAME, without the folder of the file."""
    where, _, name = place.rpartition(":")
    return f"{os.path.basename(where)}:{name}" if where.endswith(".py") else place


def _name_of_absolute(value: object) -> object:
    return os.path.basename(value) if isinstance(value, str) and os.path.isabs(value) else value


def _plain_data(value: object, excluded_marks: tuple[type, ...]) -> Any:
    """A value as plain data, without the fields that have one of these marks. Without marks, all keys with a value."""
    if isinstance(value, BaseModel):
        return _plain_mapping(value, excluded_marks)
    if isinstance(value, tuple | list):
        return [_plain_data(item, excluded_marks) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain_data(item, excluded_marks) for key, item in value.items()}
    return value


def _plain_mapping(model: BaseModel, excluded_marks: tuple[type, ...]) -> dict[str, Any]:
    """The fields of a model as plain data, see `_plain_data`."""
    data = {}
    for name, info in type(model).model_fields.items():
        if any(isinstance(mark, excluded_marks) for mark in info.metadata):
            continue
        if excluded_marks and not _is_added_default(model, name, info):
            data[name] = _plain_data(_value_without_names(model, name, info), excluded_marks)
        elif not excluded_marks and getattr(model, name) is not None:
            data[name] = _plain_data(getattr(model, name), excluded_marks)
    return data


def _is_added_default(model: BaseModel, name: str, info: FieldInfo) -> bool:
    """Whether a field that earlier versions lacked has its default, which keeps their behaviour."""
    return any(isinstance(mark, LaterKeyMark) for mark in info.metadata) and getattr(model, name) == info.default


def _value_without_names(model: BaseModel, name: str, info: FieldInfo) -> object:
    """The value of a field, with the name of a list's member replaced by its index (0 if none is named), and a data
    file by the hash of its content."""
    value = getattr(model, name)
    for mark in info.metadata:
        if isinstance(mark, NameIn):
            return 0 if value is None else [member.name for member in getattr(model, mark.field)].index(value)
        if isinstance(mark, DataFile) and value is not None:
            return hashlib.sha256(Path(value).read_bytes()).hexdigest()
    return value
