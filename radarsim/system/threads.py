"""Whether threads may be started: `--threads 0` and `threads=0` forbid it, for a whole call."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from typing import Any

_forbidden: ContextVar[bool] = ContextVar("forbidden", default=False)


def forbidden() -> bool:
    """Whether everything must be done in the calling thread."""
    return _forbidden.get()


class ThreadLimit(AbstractContextManager[None]):
    """While entered no thread is started, if the count is 0.

    No generator: one that a usage error leaves open would be ended in the context of whoever collects it."""

    def __init__(self, count: int | None) -> None:
        self._count = count

    def __enter__(self) -> None:
        self._token = _forbidden.set(forbidden() or self._count == 0)

    def __exit__(self, *_: object) -> None:
        _forbidden.reset(self._token)


@contextmanager
def mapping(count: int | None = None) -> Iterator[Callable[..., Iterator[Any]]]:
    """`map`, in so many threads (default: Python's number), or in this one where threads are forbidden."""
    if forbidden() or count == 0:
        yield map
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(count) as pool:
        yield pool.map
