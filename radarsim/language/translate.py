"""Sentences and terms in the language in use: `tr`, `plural`, `term`.

`tr("…")` gives a sentence, `plural` one with a count, `term` marks a word for later translation. A sentence is
translated as a whole, with named placeholders:

>>> tr("σ of the {quantity} is {value:.4g} m", quantity=term("range"), value=1234.5)
'σ of the range is 1234 m'

Numbers that are put into a sentence are written as its language writes them (`numerals`). A word (`term`) may have
several forms: where a translation says `{quantity:genitive}`, the word is looked up under the context "genitive".

Names in shipped configs (filters, radars, scenarios) are in radarsim's catalogue under the context "label":
`translate_names` translates them in a text. Typed text and CSV files stay as in the config.

Tables are the same in every language, and so are messages on faults of a config: neither may import this package."""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from gettext import NullTranslations
from numbers import Real
from string import Formatter
from types import FrameType
from typing import Any

from radarsim.language import current
from radarsim.language.current import ENGLISH, RADARSIM, current_language, messages, translations
from radarsim.language.numerals import numeral

LABEL = "label"  # context of names in shipped configs
NUMBER_PLACEHOLDER = "#"  # stands in a catalogue for a number, where messages differ in their numbers alone
WORDS = re.compile(r", |\b[a-z]{3,}\b")  # in a name: what a sentence would take for its own words
NUMBERS = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.]*\w)")  # in a message, none that belongs to a name


class Term(str):
    """A word or sentence in a package's catalogues; put into another sentence it is translated."""

    __slots__ = ("package",)
    package: str


def term(message: str, package: str = "") -> Term:
    """Mark a message for later translation; of the calling package, unless another one is named."""
    marked = Term(message)
    marked.package = package or _top_package(sys._getframe(1))
    return marked


def tr(message: str, /, **values: Any) -> str:
    """A message in the current language, with its placeholders filled."""
    catalogue_of_message = (
        _catalogue(message, sys._getframe(1)) if message else None
    )  # an empty one is a catalogue's header
    sentence = (
        catalogue_of_message.gettext(message)
        if catalogue_of_message
        else _translate_by_pattern(message, sys._getframe(1))
    )
    return _MessageFormatter().vformat(sentence, (), values) if values else str(sentence)


def plural(singular: str, plural_form: str, count: int, /, **values: Any) -> str:
    """A message with a count, `{count}`, in the language's plural form."""
    translations_of_message = _catalogue(singular, sys._getframe(1)) or NullTranslations()
    return _MessageFormatter().vformat(
        translations_of_message.ngettext(singular, plural_form, count), (), {"count": count, **values}
    )


def inflect(word: Term, context: str) -> str:
    """A word in one of its forms; without a form unchanged."""
    if context and (translations_of_word := _catalogue(word, sys._getframe(), context)):
        return translations_of_word.pgettext(context, word)
    return tr(word)


def _translate_by_pattern(message: str, caller: FrameType) -> str:
    """A message whose catalogue entry stands for all its numbers; else unchanged."""
    if current_language() == ENGLISH or "{" in message or not NUMBERS.search(message):
        return message
    pattern = term(NUMBERS.sub(NUMBER_PLACEHOLDER, message), getattr(message, "package", "") or _top_package(caller))
    if (translations_of_pattern := _catalogue(pattern, caller)) is None:
        return message
    numbers = iter(NUMBERS.findall(message))
    return re.sub(NUMBER_PLACEHOLDER, lambda _: numeral(next(numbers)), translations_of_pattern.gettext(pattern))


def translate_names(text: str, names: frozenset[str] = frozenset()) -> str:
    """A text with known names from configs translated; without names the whole text is one.

    Unknown names stay, and so does a known one within them.
    """
    labels = _labels(current_language())
    if not names or not labels:
        return labels.get(text, text)
    return _pattern_of_names(names).sub(lambda match: _translate_name(match[0], labels), text)


def _translate_name(name: str, labels: Mapping[str, str]) -> str:
    in_one_line = name.replace("\n", " ")  # of a tick in several lines
    return (
        labels[in_one_line].replace(" ", "\n")
        if in_one_line != name and in_one_line in labels
        else labels.get(name, name)
    )


@cache
def _labels(code: str) -> Mapping[str, str]:
    return {entry.id: entry.translations[0] for entry in messages(code) if entry.context == LABEL}


@cache
def _pattern_of_names(names: frozenset[str]) -> re.Pattern[str]:
    """Any of names as a word of its own, the longest first: none within a path, a key or its value."""
    alternatives = "|".join(re.escape(name).replace(r"\ ", r"[ \n]") for name in sorted(names, key=len, reverse=True))
    return re.compile(rf"(?<![\w.=/-])(?:{alternatives})(?![\w=/]|[.-]\w)")


def _catalogue(message: str, caller: FrameType, context: str = "") -> NullTranslations | None:
    """The catalogue with a message: its package's or its caller's, else the first one with it; None without any."""
    code = current_language()
    if code == ENGLISH:
        return None
    package = getattr(message, "package", "") or _top_package(caller)
    candidates = (
        [package]
        if package != RADARSIM and package in current.packages()
        else [RADARSIM, *(candidate for candidate in current.packages() if candidate in sys.modules)]
    )
    return next(
        (
            translations(code, candidate)
            for candidate in candidates
            if (context, message) in _translated_keys(code, candidate)
        ),
        None,
    )


def _top_package(frame: FrameType) -> str:
    """The outermost package of the code that a frame runs."""
    return str(frame.f_globals.get("__name__", RADARSIM)).partition(".")[0]


@cache
def _translated_keys(code: str, package: str) -> frozenset[tuple[str, str]]:
    return frozenset(entry.key for entry in messages(code, package) if entry.is_translated)


def join_names(names: Sequence[str]) -> str:
    """Names in a sentence: a, b and c."""
    if len(names) < 2:
        return "".join(names)
    return tr("{first} and {last}", first=", ".join(names[:-1]), last=names[-1])


def quote_name(name: str) -> str:
    """A filter's name in a sentence: in quotes if it contains ordinary words or a comma.

    >>> quote_name("cured, gated"), quote_name("r+Vr"), quote_name("Kalman-2")
    ('“cured, gated”', 'r+Vr', 'Kalman-2')
    """
    return _in_quotes(name) if WORDS.search(name) else name


def _in_quotes(name: str) -> str:
    return tr("“{name}”", name=name)


def shorten_names(names: Sequence[str], limit: int = 4) -> str:
    """Names in a sentence; of too many the first ones and the number of the others.

    In a list, names that contain a comma are quoted.
    """
    opening = _in_quotes("")[0]
    names = [
        _in_quotes(name) if ", " in name and len(names) > 1 and not name.startswith(opening) else name for name in names
    ]
    if len(names) <= limit + 1:
        return join_names(names)
    first = ", ".join(names[:limit])
    return plural("{first} and {count} more", "{first} and {count} more", len(names) - limit, first=first)


def list_filters(names: Iterable[str], limit: int = 4) -> str:
    """Names of filters in a sentence, each as `quote_name` writes it; of too many the first ones."""
    return shorten_names([*map(quote_name, names)], limit)


class _MessageFormatter(Formatter):
    """Fills placeholders: numbers in the language's notation, words translated, in the requested form."""

    def format_field(self, value: Any, spec: str) -> str:
        if isinstance(value, Term):
            return inflect(value, spec)
        if isinstance(value, str):
            return value  # a name of the user's has no forms
        text = format(value, spec)
        return numeral(text) if isinstance(value, Real) and not isinstance(value, bool) else text
