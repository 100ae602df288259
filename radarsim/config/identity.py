"""What of a checked configuration changes its numbers, as plain JSON-able data."""

import hashlib
import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from radarsim.config.fields import Added, DataFile, Design, Display, NameIn


def digest(value: object) -> str:
    """SHA-256 in hexadecimal of a JSON-able value; numbers by their shortest exact form, keys sorted."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def canonical(spec: BaseModel) -> dict[str, Any]:
    """All that changes a number, defaults filled, in SI units; display names are left out."""
    return _plain(spec, (Display,))


def world(spec: BaseModel) -> dict[str, Any]:
    """What is observed, without the filters and the number of scans: cases of one world share their noise."""
    return _plain(spec, (Display, Design))


def complete(spec: BaseModel) -> dict[str, Any]:
    """Every key that has a value, names too: reads back as the same configuration."""
    return _plain(spec, ())


def _plain(value: object, leave_out: tuple[type, ...]) -> Any:
    if isinstance(value, BaseModel):
        return {
            name: _plain(_without_names(value, name, info) if leave_out else getattr(value, name), leave_out)
            for name, info in type(value).model_fields.items()
            if not any(isinstance(mark, leave_out) for mark in info.metadata)
            and not (_at_its_default(value, name, info) if leave_out else getattr(value, name) is None)
        }
    if isinstance(value, tuple | list):
        return [_plain(item, leave_out) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain(item, leave_out) for key, item in value.items()}
    return value


def _at_its_default(model: BaseModel, name: str, info: FieldInfo) -> bool:
    """Whether a field is one that earlier versions did not have, and does what they did."""
    return any(isinstance(mark, Added) for mark in info.metadata) and getattr(model, name) == info.default


def _without_names(model: BaseModel, name: str, info: FieldInfo) -> object:
    """The value of a field, without the names in it.

    For the name of a member of a list the member's place, 0 where none is named; for a file of data its content's hash.
    """
    value = getattr(model, name)
    for mark in info.metadata:
        if isinstance(mark, NameIn):
            return 0 if value is None else [member.name for member in getattr(model, mark.field)].index(value)
        if isinstance(mark, DataFile) and value is not None:
            return hashlib.sha256(Path(value).read_bytes()).hexdigest()
    return value
