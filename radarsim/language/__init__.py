"""The language of figures, reports, answers and claims: English, or another with a catalogue here.

`tr("…")` gives a sentence in the language chosen, `plural` one with a count, `term` marks a word for later translation.
A sentence is translated as a whole, with named placeholders:

>>> tr("σ of the {quantity} is {value:.4g} m", quantity=term("range"), value=1234.5)
'σ of the range is 1234 m'

A catalogue is one file, `<code>.po`, in gettext's format. Numbers that are put into a sentence are written as its
language writes them: the catalogue says how under the context "number". A word (`term`) may have several forms: where a
translation says `{quantity:genitive}`, the word is looked up under the context "genitive".

A package with a study of its own has its own catalogues, `PACKAGE/language/<code>.po`: messages of its code, names of
its keys and its terms are looked up there and nowhere else. Messages about it from radarsim's code, such as its claims,
are looked up in radarsim's catalogue first, then in those of the packages.

Names in shipped configs (filters, radars, scenarios) are in radarsim's catalogue under the context "label": `called`
translates them in a text. Typed text and CSV files stay as in the config.

Tables are the same in every language, and so are messages on faults of a config: neither may import this package.
"""

import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from gettext import GNUTranslations, NullTranslations
from importlib import resources
from numbers import Real
from pathlib import Path
from string import Formatter
from types import FrameType
from typing import Any

from radarsim.errors import ConfigError
from radarsim.language import catalogue

ENGLISH = "en"
VARIABLE = "RADARSIM_LANGUAGE"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
POWER = re.compile(r"(?P<mantissa>\d[\d.,]*)e(?P<exponent>[+-]\d+)")  # of a number in Python's form
NUMBER = "number"  # context of the point and of the separator of thousands
LABEL = "label"  # context of names in shipped configs
ANY = "#"  # stands in a catalogue for a number, where messages differ in their numbers alone
NUMBERS = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.]*\w)")  # in a message, none that belongs to a name


class Term(str):
    """A word or sentence in a package's catalogues; put into another sentence it is translated."""

    __slots__ = ("package",)
    package: str


OURS = "radarsim"


def no_packages() -> tuple[str, ...]:
    """Packages with studies of their own, by module name: none, but see radarsim.app.configs."""
    return ()


packages: Callable[[], tuple[str, ...]] = no_packages
_chosen: list[str] = []  # the last one counts
faults: list[str] = []  # a line for each catalogue of a package that cannot be read


@cache
def known() -> tuple[str, ...]:
    """The codes of the languages: English, and those with a catalogue."""
    files = resources.files(__name__).iterdir()
    return (ENGLISH, *sorted(file.name.removesuffix(".po") for file in files if file.name.endswith(".po")))


def current() -> str:
    """The current language: the chosen one, else that of RADARSIM_LANGUAGE, else English. Raises ConfigError."""
    return _chosen[-1] if _chosen else checked(os.environ.get(VARIABLE) or ENGLISH, VARIABLE)


def checked(code: str, source: str) -> str:
    """A language's code from an option or a variable. Raises ConfigError for an unknown one."""
    if code not in known():
        raise ConfigError(f"{source}: must be one of {', '.join(known())}, got {code!r}")
    return code


@contextmanager
def speaking(code: str) -> Iterator[None]:
    """Use a language within a context. Raises ConfigError for an unknown one."""
    _chosen.append(checked(code, "language"))
    try:
        yield
    finally:
        _chosen.pop()


def messages(code: str, package: str = OURS) -> tuple[catalogue.Entry, ...]:
    """The catalogue of a package, which is imported, in a language; English needs none, another package may have none.

    Raises ConfigError where radarsim's file is not a catalogue; another package's is then left out, see `faults`.
    """
    return _read(code, package)[0]


def translations(code: str, package: str = OURS) -> NullTranslations:
    """The same as the standard library reads it."""
    return _read(code, package)[1]


@cache
def _read(code: str, package: str) -> tuple[tuple[catalogue.Entry, ...], NullTranslations]:
    folders = getattr(sys.modules.get(package), "__path__", ())
    files = [file for folder in folders if (file := Path(folder, "language", f"{code}.po")).is_file()]
    if code == ENGLISH or not files:
        return (), NullTranslations()
    try:
        entries = tuple(catalogue.entries(files[0].read_text(encoding="utf-8")))
        return entries, GNUTranslations(catalogue.compiled(entries))
    except (OSError, ValueError, LookupError) as error:  # the last one of an unknown character set
        reason = (error.strerror if isinstance(error, OSError) else "") or str(error)
        if package == OURS:
            raise ConfigError(f"{files[0]}: {reason}") from error
        faults.append(f"package {package} speaks English: {files[0]}: {reason}")
        return (), NullTranslations()


def term(message: str, package: str = "") -> Term:
    """Mark a message for later translation; of the calling package, unless another one is named."""
    marked = Term(message)
    marked.package = package or _top(sys._getframe(1))
    return marked


def tr(message: str, /, **values: Any) -> str:
    """A message in the current language, with its placeholders filled."""
    catalogue_of_message = (
        _catalogue(message, sys._getframe(1)) if message else None
    )  # an empty one is a catalogue's header
    sentence = catalogue_of_message.gettext(message) if catalogue_of_message else _numbered(message, sys._getframe(1))
    return _Filled().vformat(sentence, (), values) if values else str(sentence)


def plural(singular: str, plural_form: str, count: int, /, **values: Any) -> str:
    """A message with a count, `{count}`, in the language's plural form."""
    translations_of_message = _catalogue(singular, sys._getframe(1)) or NullTranslations()
    return _Filled().vformat(
        translations_of_message.ngettext(singular, plural_form, count), (), {"count": count, **values}
    )


def in_form(word: Term, context: str) -> str:
    """A word in one of its forms; without a form unchanged."""
    if context and (translations_of_word := _catalogue(word, sys._getframe(), context)):
        return translations_of_word.pgettext(context, word)
    return tr(word)


def _numbered(message: str, caller: FrameType) -> str:
    """A message whose catalogue entry stands for all its numbers; else unchanged."""
    if current() == ENGLISH or "{" in message or not NUMBERS.search(message):
        return message
    pattern = term(NUMBERS.sub(ANY, message), getattr(message, "package", "") or _top(caller))
    if (translations_of_pattern := _catalogue(pattern, caller)) is None:
        return message
    numbers = iter(NUMBERS.findall(message))
    return re.sub(ANY, lambda _: numeral(next(numbers)), translations_of_pattern.gettext(pattern))


def called(text: str, names: frozenset[str] = frozenset()) -> str:
    """A text with known names from configs translated; without names the whole text is one.

    Unknown names stay, and so does a known one within them.
    """
    labels = _labels(current())
    if not names or not labels:
        return labels.get(text, text)
    return _any_of(names).sub(lambda match: _called(match[0], labels), text)


def _called(name: str, labels: Mapping[str, str]) -> str:
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
def _any_of(names: frozenset[str]) -> re.Pattern[str]:
    """Any of names as a word of its own, the longest first: none within a path, a key or its value."""
    alternatives = "|".join(re.escape(name).replace(r"\ ", r"[ \n]") for name in sorted(names, key=len, reverse=True))
    return re.compile(rf"(?<![\w.=/-])(?:{alternatives})(?![\w=/]|[.-]\w)")


def _catalogue(message: str, caller: FrameType, context: str = "") -> NullTranslations | None:
    """The catalogue with a message: its package's or its caller's, else the first one with it; None without any."""
    code = current()
    if code == ENGLISH:
        return None
    package = getattr(message, "package", "") or _top(caller)
    candidates = (
        [package]
        if package != OURS and package in packages()
        else [OURS, *(candidate for candidate in packages() if candidate in sys.modules)]
    )
    return next(
        (
            translations(code, candidate)
            for candidate in candidates
            if (context, message) in _translated(code, candidate)
        ),
        None,
    )


def _top(frame: FrameType) -> str:
    """The outermost package of the code that a frame runs."""
    return str(frame.f_globals.get("__name__", OURS)).partition(".")[0]


@cache
def _translated(code: str, package: str) -> frozenset[tuple[str, str]]:
    return frozenset(entry.key for entry in messages(code, package) if entry.done)


def numeral(text: str) -> str:
    """An English number (1,234.5) in the current language's notation, with a true minus and raised powers of ten.

    >>> [numeral(one) for one in ("-0.5", "6.678e+09", "1e-05")]
    ['−0.5', '6.678·10⁹', '10⁻⁵']
    """
    if "e" in text:
        text = POWER.sub(_raised, text)
    if current() == ENGLISH:
        return text.replace("-", "−")
    catalogue_of_language = translations(current())
    return text.translate({ord(mark): catalogue_of_language.pgettext(NUMBER, mark) for mark in ".,"} | {ord("-"): "−"})


def power_of_ten(exponent: int) -> str:
    """10⁻³ of −3."""
    return f"10{str(exponent).translate(SUPERSCRIPT)}"


def _raised(match: re.Match[str]) -> str:
    power = power_of_ten(int(match["exponent"]))
    return power if match["mantissa"] == "1" else f"{match['mantissa']}·{power}"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: a, b and c."""
    if len(names) < 2:
        return "".join(names)
    return tr("{first} and {last}", first=", ".join(names[:-1]), last=names[-1])


def few(names: Sequence[str], limit: int = 4) -> str:
    """Names in a sentence; of too many the first ones and the number of the others.

    In a list, names that contain a comma are quoted.
    """
    names = [tr("“{name}”", name=name) if ", " in name and len(names) > 1 else name for name in names]
    if len(names) <= limit + 1:
        return listed(names)
    first = ", ".join(names[:limit])
    return plural("{first} and {count} more", "{first} and {count} more", len(names) - limit, first=first)


class _Filled(Formatter):
    """Fills placeholders: numbers in the language's notation, words translated, in the requested form."""

    def format_field(self, value: Any, spec: str) -> str:
        if isinstance(value, Term):
            return in_form(value, spec)
        if isinstance(value, str):
            return value  # a name of the user's has no forms
        text = format(value, spec)
        return numeral(text) if isinstance(value, Real) and not isinstance(value, bool) else text
