"""How values, key paths and texts are written in messages."""

from collections.abc import Iterable, Iterator

KeyPath = tuple[str | int, ...]
MAX_SHOWN_CHARACTERS = 60  # of a value in a message
MIN_COUNTED_ZEROS = 7  # at the end of a whole number: from so many on it is written with an exponent


def dotted(path: KeyPath) -> str:
    """A key path as the user writes it: `filters.0.name`."""
    return ".".join(map(str, path))


def quoted_value(value: object) -> str:
    """A value as quoted in a message: one line of at most 60 characters, with control characters escaped."""
    text = short_number(value) if isinstance(value, float | int) and not isinstance(value, bool) else _text_of(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[: MAX_SHOWN_CHARACTERS - 1] + "…"


def _text_of(value: object, max_characters: int = MAX_SHOWN_CHARACTERS) -> str:
    """The text of a value as in YAML, formatted no further than it is shown."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case float() | int():
            return short_number(value)
        case str():
            return ascii_controls(repr(value[: max_characters + 1]))
        case dict():
            pairs = list(value.items())[:max_characters]
            items = (f"{one_line(str(k)[:max_characters])}: {_text_of(v, max_characters // 2)}" for k, v in pairs)
            return "{" + ", ".join(_first_that_fit(items, max_characters)) + "}"
        case list() | tuple():
            items = (_text_of(v, max_characters // 2) for v in value[:max_characters])
            return "[" + ", ".join(_first_that_fit(items, max_characters)) + "]"
    return one_line(type(value).__name__)


def _first_that_fit(items: Iterable[str], max_characters: int) -> Iterator[str]:
    """The first items, up to a little more than fits."""
    length = 0
    for item in items:
        yield item
        length += len(item) + 2
        if length > max_characters:
            return


def short_number(number: float | int) -> str:
    """A short text that reads back as the same number: 0.001, 1e-5, 100000, 1e12."""
    if isinstance(number, int) and abs(number) >= 10**30:
        return "a number of more than 30 digits"
    text = repr(number).replace("e-0", "e-").replace("e+", "e").removesuffix(".0")
    digits = text.rstrip("0")
    zeros = len(text) - len(digits)
    return f"{digits}e{zeros}" if zeros >= MIN_COUNTED_ZEROS and digits.lstrip("-").isdigit() else text


def one_line(text: str) -> str:
    """Text without line breaks and control characters, which are escaped."""
    return ascii_controls(text)


def ascii_controls(text: str) -> str:
    """Escapes unprintable characters, as repr does."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
