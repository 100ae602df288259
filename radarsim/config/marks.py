"""Marks on the fields of schemas: their part in the identity of a case, and what they refer to."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler


class DisplayMark:
    """Marks a field that changes no number (a display name): it is no part of a case's identity nor of its noise."""


class DesignMark:
    """Marks a field that designs filters or limits the observation: it is no part of the world nor of its noise."""


class ProcessNoiseMark:
    """Marks a key of filters for the manoeuvre that they allow for. Of several values the answer names the best."""


class LaterKeyMark:
    """Marks a key that earlier versions lacked. At its default, which keeps their behaviour, it is no part of a case's
    identity nor of its noise, so that both stay the same."""


class ColumnsOfOne:
    """Marks a field of rows of probabilities whose columns sum to one."""


@dataclass(frozen=True)
class NameIn:
    """Marks a field that names a member of a list; a case's identity has its index in the list instead."""

    field: str


class DataFile:
    """Marks a text field that names a data file, relative to the folder of its YAML file. The checked object holds a
    readable path; a case's identity has the content of the file instead."""


class Scenario:
    """Marks a field of a study that may name a file in scenarios/ by its stem."""

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        inline = handler(core_schema)
        return {"anyOf": [{"type": "string", "description": "stem of a file in scenarios/"}, inline]}


@dataclass(frozen=True)
class OnlyForMark:
    """Marks a key that exists only for some values of other keys, such as a kind: {"kind": ("adaptive", "imm")}.

    default: its value there, if it is not given; needed: whether it is required there. Elsewhere it is refused."""

    allowed_values: Mapping[str, tuple[str, ...]]
    default: Any = None
    is_required: bool = False
