"""Reasons to stop a run: a stop condition is called between tasks and gives None or the reason as text."""

import math
import os
import select
import signal
import threading
import time
from collections.abc import Callable

from radarsim.errors import Interrupted

Stop = Callable[[], str | None]


class TimeLimit:
    """Stop when that many seconds have passed from `begun`, by default now; `less` earlier, for what comes after."""

    def __init__(self, seconds: float, begun: float | None = None, less: float = 0.0) -> None:
        self.seconds = seconds
        self.begun = time.monotonic() if begun is None else begun
        self._end = self.begun + seconds - less

    def __call__(self) -> str | None:
        return f"time limit of {self.seconds:g} s" if time.monotonic() >= self._end else None

    @property
    def left(self) -> float:
        """Seconds until then, none after it."""
        return max(0.0, self._end - time.monotonic())

    def reserving(self, seconds: float) -> "TimeLimit":
        """The limit that leaves so many seconds of its time over, at most half of what is left of it."""
        return TimeLimit(self.seconds, self.begun, min(seconds, 0.5 * self.left))


def time_limit(seconds: float) -> TimeLimit:
    """Stop when that many seconds have passed from now."""
    return TimeLimit(seconds)


class Either:
    """Whichever of several conditions gives a reason first; `grace_s` is then that one's."""

    def __init__(self, *conditions: Stop | None) -> None:
        self._conditions = [condition for condition in conditions if condition is not None]
        self.grace_s = math.inf

    def __call__(self) -> str | None:
        for condition in self._conditions:
            if (reason := condition()) is not None:
                self.grace_s = getattr(condition, "grace_s", math.inf)
                return reason
        return None


class Signals:
    """While entered, SIGINT and SIGTERM ask for a stop; calling it says whether one came.

    The main thread of a process may enter it. A run that asks it between tasks ends by itself. If the process is still
    there 1.5 s after the signal, whatever it is doing, or if a second signal comes, it exits on the spot with status
    128 + signal: files appear by renaming only, so none is ever half written.

    Python runs handlers between two bytecodes of the main thread, which may be far away inside compiled code. So
    handlers do nothing here, and a thread of its own waits for the numbers that the interpreter writes to a pipe.
    """

    grace_s = 1.0
    limit_s = 1.5
    numbers = (signal.SIGINT, signal.SIGTERM)

    def __init__(self) -> None:
        self.received: int | None = None

    def __call__(self) -> str | None:
        return None if self.received is None else f"signal {self.received}"

    def raise_if_received(self) -> None:
        """Interrupted, if a signal came."""
        if self.received is not None:
            raise Interrupted(self.received)

    def __enter__(self) -> "Signals":
        self._pipe, self._write_end = os.pipe()
        os.set_blocking(self._write_end, False)
        self._wakeup_before = signal.set_wakeup_fd(self._write_end, warn_on_full_buffer=False)
        self._before = {number: signal.signal(number, _noted) for number in self.numbers}
        self._watcher = threading.Thread(target=self._watch, name="signals", daemon=True)
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup_before)
        os.close(self._write_end)
        self._watcher.join()
        os.close(self._pipe)

    def _watch(self) -> None:
        self.received = self._next(None)
        if self.received is not None and (second := self._next(self.limit_s)) is not None:
            os.write(2, f"{Interrupted(self.received)}\n".encode())
            os._exit(128 + (second or self.received))

    def _next(self, patience_s: float | None) -> int | None:
        """The next of our signals, 0 when patience runs out first, None when the context is left."""
        end = None if patience_s is None else time.monotonic() + patience_s
        while True:
            left = None if end is None else max(0.0, end - time.monotonic())
            if not select.select([self._pipe], [], [], left)[0]:
                return 0
            number = os.read(self._pipe, 1)
            if not number:
                return None
            if number[0] in self.numbers:
                return number[0]


def _noted(number: int, frame: object) -> None:
    """The pipe has it already."""
