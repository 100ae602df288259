"""The text of a value as YAML on one line."""

import json
import re
from collections.abc import Mapping

from radarsim.config.error_text import short_number

PLAIN_TEXT = re.compile(r"[A-Za-z_][\w+ .*-]*")  # text that YAML reads as text without quotes
RESERVED_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "none"}


def one_line_yaml(value: object) -> str:
    """A value as YAML on one line, numbers as short as possible."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return short_number(value)
        case list() | tuple():
            return "[" + ", ".join(map(one_line_yaml, value)) + "]"
        case Mapping():
            return "{" + ", ".join(f"{key}: {one_line_yaml(item)}" for key, item in value.items()) + "}"
    text = str(value)
    is_plain = PLAIN_TEXT.fullmatch(text) and text == text.strip() and text.lower() not in RESERVED_WORDS
    return text if is_plain else json.dumps(text)
