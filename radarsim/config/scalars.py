"""Scalars of a config: the value of a plain word of YAML, and the Python values that stand for it.

Stricter than YAML 1.1 where that surprises (yes, 1:30, 010 and 1_000 are text), and wider where that does (1e5 is a
number)."""

import math
import re
from collections.abc import Mapping

from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.value_text import KeyPath

NUMBER = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
CONSTANTS = {"true": True, "false": False, "": None, "~": None, "null": None}
NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
DEEPEST = 50


class NotFinite(ValueError):
    """A number that is infinite or not-a-number."""


def from_text(text: str) -> object:
    """The value of an unquoted word: a number, true, false, null, or the text itself."""
    if text in CONSTANTS:
        return CONSTANTS[text]
    if NOT_FINITE.fullmatch(text):
        raise NotFinite(text)
    if not NUMBER.fullmatch(text):
        return text
    number = float(text)
    if not math.isfinite(number):
        raise NotFinite(text)
    return int(text) if text.lstrip("+-").isdigit() else number


def from_python(value: object, path: KeyPath, origin: Origin, faults: ErrorList) -> object:
    """Convert a Python value as if it came from YAML; NumPy scalars and arrays become plain values."""
    if len(path) > DEEPEST:
        faults.mark_unusable(origin, path[:3], f"nested more than {DEEPEST} deep")
        return None
    if hasattr(value, "tolist") and not isinstance(value, type):
        value = value.tolist()
    match value:
        case bool() | str():
            return value
        case int() | float():
            return _finite_number(value, path, origin, faults)
        case None:
            faults.mark_unusable(origin, path, "has no value")
            return None
        case Mapping():
            return {str(k): from_python(v, (*path, str(k)), origin, faults) for k, v in value.items()}
        case list() | tuple():
            return [from_python(v, (*path, i), origin, faults) for i, v in enumerate(value)]
    faults.mark_unusable(origin, path, "must be text, a number, true or false, a list or a mapping", value)
    return None


def _finite_number(value: float | int, path: KeyPath, origin: Origin, faults: ErrorList) -> float | int | None:
    """The number; None, with an error added, if it is not finite."""
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond the largest float
        finite = False
    if not finite:
        faults.mark_unusable(origin, path, "must be a finite number", value)
        return None
    return value
