"""Errors of a user's own code, in one line with file and line number.

The place is the deepest line of an installed package that offers studies or filters. If none of these led to the error,
it is the deepest line of any code that is neither radarsim's nor a library's, such as a notebook or a test."""

import functools
import inspect
import os
import re
import sysconfig
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

from radarsim.errors import AUTHOR_ERRORS, ConfigError, RadarsimError

LIBRARIES = (*(sysconfig.get_path(name) for name in ("stdlib", "platstdlib")), str(Path(__file__).parents[1]))
COMPILER_NOISE = re.compile(r"Failed in |-+$|\[\d\] |During: ")  # lines of a compiler's message that say where it was
ARRAY_UFUNC = "__array_ufunc__"  # in NumPy's error about the sine of eight realisations
MAX_MESSAGE_LENGTH = 300  # characters of a message
NO_CODE_VARIABLE = "RADARSIM_NO_CODE"  # in the environment, so that processes of a run keep to it: none of it may run
MAX_FRAMES = 8  # of an author's code that are shown

_owner: ContextVar[str] = ContextVar("_of", default="")
study_folders: Callable[[], Iterable[Path]] = (
    tuple  # the folders, or single files, of packages that offer studies or filters
)


class CodeLocation(NamedTuple):
    """A line of code."""

    file: str
    line: int
    function: str = ""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


def locate(error: BaseException, installed: bool = False, function: Any = None) -> CodeLocation | None:
    """The line to blame for an error. installed: of an installed package that offers studies or filters, or None.

    function: the author's function; other code in its folder is the author's too.
    """
    code = _code(function)
    user_folders = (*study_folders(), *([Path(os.path.realpath(code.co_filename)).parent] if code else []))
    places = list(_locations(error))
    user_lines = [line for line in places if any(map(Path(os.path.realpath(line.file)).is_relative_to, user_folders))]
    if not user_lines and not installed:
        user_lines = [line for line in places if not _is_library(line.file)]
    return user_lines[-1] if user_lines else None


def _locations(error: BaseException) -> Iterator[CodeLocation]:
    """The lines that led to an error, the deepest last; for uncompilable code, the line named."""
    for frame, line in traceback.walk_tb(error.__traceback__):
        yield CodeLocation(frame.f_code.co_filename, line, frame.f_code.co_qualname.rpartition("<locals>.")[2])
    if isinstance(error, SyntaxError) and error.filename:
        yield CodeLocation(error.filename, error.lineno or 1)
    elif match := re.search(r'File "([^"]+)", line (\d+)', _message(error)):
        yield CodeLocation(match[1], int(match[2]))


def _code(function: Any) -> CodeType | None:
    """The code of a function; None if it is not written in Python."""
    while isinstance(function, functools.partial):
        function = function.func
    return getattr(inspect.unwrap(function) if callable(function) else function, "__code__", None)


def _is_library(file: str) -> bool:
    return file.startswith(("<", *LIBRARIES)) or "site-packages" in file


def user_frames(error: BaseException, folder: str) -> list[str]:
    """The last lines of an author's files, in a folder, that led to an error, the deepest last."""
    user_frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename).is_relative_to(folder)
    ]
    user_frames = [frame for frame in user_frames if not _is_library(os.path.relpath(frame.filename, folder))]
    return [f"  {frame.filename}:{frame.lineno}, in {frame.name}: {frame.line}" for frame in user_frames[-MAX_FRAMES:]]


def value_text(error: BaseException) -> str:
    """An error in one line: its kind, and the first non-empty line of its message."""
    message = str(error.msg) if isinstance(error, SyntaxError) else _message(error)
    lines = [line.strip() for line in message.splitlines() if line.strip() and not COMPILER_NOISE.match(line)]
    line = lines[0][:MAX_MESSAGE_LENGTH] if lines else ""
    if ARRAY_UFUNC in message:
        return "a number of a realisation is none of NumPy's: radarsim.kernels.formula_functions has exp, sin, … for it"
    is_complete = isinstance(error, RadarsimError) or getattr(error, "for_the_author", False)
    kind = "" if is_complete else type(error).__name__
    return ": ".join(filter(None, (kind, line)))


def _message(error: BaseException) -> str:
    try:
        return str(error)
    except AUTHOR_ERRORS:
        return "its __str__ fails"


def error_summary(error: BaseException) -> str:
    """An error in one line, with its place in brackets."""
    location = locate(error)
    return f"{value_text(error)} ({location})" if location else value_text(error)


@contextmanager
def study_context(name: str) -> Iterator[None]:
    """Functions named by `call` and `fault` within it belong to this study."""
    token = _owner.set(f"study {name}: ")
    try:
        yield
    finally:
        _owner.reset(token)


def is_code_forbidden() -> bool:
    """Whether no code of the user may run."""
    return bool(os.environ.get(NO_CODE_VARIABLE))


@contextmanager
def code_allowed(trusted: bool) -> Iterator[None]:
    """While entered no code of users runs, here and in processes started here, unless it is trusted."""
    before = os.environ.get(NO_CODE_VARIABLE)
    if not trusted:
        os.environ[NO_CODE_VARIABLE] = "1"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(NO_CODE_VARIABLE, None)
        else:
            os.environ[NO_CODE_VARIABLE] = before


def call_user_function(function: Callable[..., Any], *arguments: Any, owner: str = "") -> Any:
    """The value of an author's function; ConfigError with its file and line where it fails.

    owner: what the function belongs to, if its name does not show it; by default from `study_context`.
    """
    try:
        return function(*arguments)
    except ConfigError:
        raise
    except AUTHOR_ERRORS as error:
        location = locate(error, function=function)
        if location is None:
            raise user_code_error(function, value_text(error), owner=owner) from error
        raise ConfigError(f"{location}: {owner or _owner.get()}{location.function}: {value_text(error)}") from error


def user_code_error(function: Any, message: str, name: str = "", owner: str = "") -> ConfigError:
    """An error that names a function by its file and line."""
    code = _code(function)
    location = f"{code.co_filename}:{code.co_firstlineno}: " if code else ""
    function_name = getattr(function, "__qualname__", "").rpartition("<locals>.")[2]
    return ConfigError(f"{location}{owner or _owner.get()}{name or function_name or repr(function)[:40]}: {message}")
