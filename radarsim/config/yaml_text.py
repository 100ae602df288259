"""The text of a value as YAML on one line."""

import json
import re
from collections.abc import Callable, Mapping

from radarsim.config.value_text import short_number

PLAIN_TEXT = re.compile(r"[A-Za-z_][\w+ .*-]*")  # text that YAML reads as text without quotes
MIN_COUNTED_ZEROS = 3  # at the end of a number, to be written as a power of ten
RESERVED_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "none"}


def one_line_yaml(value: object, write_number: Callable[[int | float], str] = short_number) -> str:
    """A value as YAML on one line, numbers as short as possible."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return write_number(value)
        case list() | tuple():
            return "[" + ", ".join(one_line_yaml(item, write_number) for item in value) + "]"
        case Mapping():
            items = (f"{_text_yaml(str(key))}: {one_line_yaml(item, write_number)}" for key, item in value.items())
            return "{" + ", ".join(items) + "}"
    return _text_yaml(str(value))


def exact_yaml(value: object) -> str:
    """A value as YAML on one line, read back as the same value: a whole number stays one, 1e5 does not become one."""
    return one_line_yaml(value, _exact_number)


def _exact_number(number: int | float) -> str:
    if isinstance(number, int):
        return str(number)
    text = short_number(number)
    if not text.lstrip("-").isdigit():
        return text
    digits = text.rstrip("0")
    zeros = len(text) - len(digits)
    return f"{digits}e{zeros}" if zeros >= MIN_COUNTED_ZEROS else f"{text}.0"


def _text_yaml(text: str) -> str:
    is_plain = PLAIN_TEXT.fullmatch(text) and text == text.strip() and text.lower() not in RESERVED_WORDS
    if is_plain:
        return text
    quoted = json.dumps(text, ensure_ascii=False)
    return "".join(letter if letter.isprintable() else f"\\U{ord(letter):08x}" for letter in quoted)
