"""The language in use, and the catalogues of messages that serve it.

A catalogue is one file, `<code>.po`, in gettext's format. A package with a study of its own has its own catalogues,
`PACKAGE/language/<code>.po`: messages of its code, names of its keys and its terms are looked up there and nowhere
else. Messages about it from radarsim's code, such as its claims, are looked up in radarsim's catalogue first, then in
those of the packages."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from gettext import GNUTranslations, NullTranslations
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.errors import ConfigError

if TYPE_CHECKING:
    from radarsim.language.gettext_catalogue import Entry

ENGLISH = "en"
VARIABLE = "RADARSIM_LANGUAGE"

RADARSIM = "radarsim"


def no_packages() -> tuple[str, ...]:
    """Packages with studies of their own, by module name: none, but see radarsim.api.configs."""
    return ()


packages: Callable[[], tuple[str, ...]] = no_packages
_languages: list[str] = []  # the last one counts
faults: list[str] = []  # a line for each catalogue of a package that cannot be read


@cache
def language_codes() -> tuple[str, ...]:
    """The codes of the languages: English, and those with a catalogue."""
    files = resources.files("radarsim.language").iterdir()
    return (ENGLISH, *sorted(file.name.removesuffix(".po") for file in files if file.name.endswith(".po")))


def current_language() -> str:
    """The current language: the chosen one, else that of RADARSIM_LANGUAGE, else English. Raises ConfigError."""
    return _languages[-1] if _languages else check_language(os.environ.get(VARIABLE) or ENGLISH, VARIABLE)


def check_language(code: str, source: str) -> str:
    """A language's code from an option or a variable. Raises ConfigError for an unknown one."""
    if code not in language_codes():
        raise ConfigError(f"{source}: must be one of {', '.join(language_codes())}, got {code!r}")
    return code


@contextmanager
def use_language(code: str) -> Iterator[None]:
    """Use a language within a context. Raises ConfigError for an unknown one."""
    _languages.append(check_language(code, "language"))
    try:
        yield
    finally:
        _languages.pop()


def messages(code: str, package: str = RADARSIM) -> "tuple[Entry, ...]":
    """The catalogue of a package, which is imported, in a language; English needs none, another package may have none.

    Raises ConfigError where radarsim's file is not a catalogue; another package's is then left out, see `faults`.
    """
    return _read(code, package)[0]


def translations(code: str, package: str = RADARSIM) -> NullTranslations:
    """The same as the standard library reads it."""
    return _read(code, package)[1]


@cache
def _read(code: str, package: str) -> "tuple[tuple[Entry, ...], NullTranslations]":
    folders = getattr(sys.modules.get(package), "__path__", ())
    files = [file for folder in folders if (file := Path(folder, "language", f"{code}.po")).is_file()]
    if code == ENGLISH or not files:
        return (), NullTranslations()
    from radarsim.language import gettext_catalogue  # English needs none

    try:
        entries = tuple(gettext_catalogue.entries(files[0].read_text(encoding="utf-8")))
        return entries, GNUTranslations(gettext_catalogue.compile_catalogue(entries))
    except (OSError, ValueError, LookupError) as error:  # the last one of an unknown character set
        reason = (error.strerror if isinstance(error, OSError) else "") or str(error)
        if package == RADARSIM:
            raise ConfigError(f"{files[0]}: {reason}") from error
        faults.append(f"package {package} speaks English: {files[0]}: {reason}")
        return (), NullTranslations()
