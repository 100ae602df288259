"""Marks behind exact values while an answer is composed, by which headlines find the values that a sentence quotes.

Readers see none of them: a simulated value shows its interval, an exact one shows none, and `convention` says so once
an answer."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from radarsim.language.translate import tr

MARK = "\N{INVISIBLE SEPARATOR}"
_is_marking: ContextVar[bool] = ContextVar("is_marking", default=False)


@contextmanager
def marking() -> Iterator[None]:
    """A context in which exact values are marked."""
    token = _is_marking.set(True)
    try:
        yield
    finally:
        _is_marking.reset(token)


def exact_text(text: str) -> str:
    """The text of an exact value, with its mark where values are marked."""
    return f"{text}{MARK}" if _is_marking.get() else text


def without_marks(text: str) -> str:
    """A text as readers see it."""
    return text.replace(MARK, "")


def convention(texts: Iterable[str]) -> str:
    """How to tell exact values of these sentences from simulated ones; empty where none is exact."""
    text = " ".join(texts)
    if MARK not in text:
        return ""
    if "[" not in text:
        return tr("These values are exact.")
    return tr("Values with a 95 % interval are simulated, the others exact.")
