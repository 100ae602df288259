"""Conditions that stop a run before its end: a time limit, and signals.

A stop condition is called between tasks and gives None, or the reason as text. The end of a run by its precision is in
`radarsim.api.run_to_precision`."""

import contextlib
import math
import os
import select
import signal
import threading
import time
from collections.abc import Callable
from typing import NoReturn

from radarsim.errors import Interruption
from radarsim.system.threads import forbidden

Stop = Callable[[], str | None]


class TimeLimit:
    """Stop when that many seconds have passed from `begun`, by default now; `less` earlier, for work afterwards."""

    def __init__(self, seconds: float, begun: float | None = None, less: float = 0.0) -> None:
        self.seconds = seconds
        self.start_s = time.monotonic() if begun is None else begun
        self._end = self.start_s + seconds - less

    def __call__(self) -> str | None:
        return f"time limit of {self.seconds:g} s" if time.monotonic() >= self._end else None

    @property
    def remaining_s(self) -> float:
        """Seconds until then, at least 0."""
        return max(0.0, self._end - time.monotonic())

    def with_reserve(self, seconds: float) -> "TimeLimit":
        """Time limit minus a reserve, at most half of what remains."""
        return TimeLimit(self.seconds, self.start_s, min(seconds, 0.5 * self.remaining_s))


class AnyStop:
    """The first of several conditions to give a reason; `grace_s` is then that one's."""

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
    """While entered, SIGINT and SIGTERM request a stop; calling it shows whether one came.

    The main thread of a process may enter it. A run that checks it between tasks ends by itself. If the process still
    exists 1.5 s after the signal, or if a second signal comes, it exits at once with status 128 + signal: files appear
    by renaming only, so none is ever half written.

    Python runs handlers between two bytecodes of the main thread, which may be in compiled code for long. So handlers
    do nothing here, and a separate thread waits for the numbers that the interpreter writes to a pipe. Where threads
    are forbidden the handlers do it, with an alarm for the 1.5 s: delayed by compiled code.

    missing: says what a stopped run has not done, for the error."""

    grace_s = 1.0
    limit_s = 1.5
    numbers = (signal.SIGINT, signal.SIGTERM)

    def __init__(self) -> None:
        self.received_signal: int | None = None
        self.missing: Callable[[], str] = str

    def __call__(self) -> str | None:
        return None if self.received_signal is None else f"signal {self.received_signal}"

    def raise_if_received(self) -> None:
        """Raise `Interruption` if a signal came."""
        if self.received_signal is not None:
            raise self._interruption(self.received_signal)

    def _interruption(self, number: int) -> Interruption:
        """The error of a signal, with what is missing as far as that can be said."""
        missing = ""
        with contextlib.suppress(Exception):  # of a store that can no longer be read
            missing = self.missing()
        return Interruption(number, missing=missing)

    is_entered = False  # whether one is entered

    def __enter__(self) -> "Signals":
        Signals.is_entered = True
        self._alone = forbidden()
        if self._alone:
            self._before = {number: signal.signal(number, self._handle) for number in (*self.numbers, signal.SIGALRM)}
            return self
        self._pipe, self._write_end = os.pipe()
        os.set_blocking(self._write_end, False)
        self._wakeup_before = signal.set_wakeup_fd(self._write_end, warn_on_full_buffer=False)
        self._before = {number: signal.signal(number, _note_signal) for number in self.numbers}
        self._watcher = threading.Thread(target=self._watch, name="signals", daemon=True)
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        Signals.is_entered = False
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._alone:
            signal.setitimer(signal.ITIMER_REAL, 0)
            return
        signal.set_wakeup_fd(self._wakeup_before)
        os.close(self._write_end)
        self._watcher.join()
        os.close(self._pipe)

    def _handle(self, number: int, frame: object) -> None:
        if self.received_signal is not None:
            self._end(self.received_signal, 0 if number == signal.SIGALRM else number)
        self.received_signal = number
        signal.setitimer(signal.ITIMER_REAL, self.limit_s)

    def _watch(self) -> None:
        self.received_signal = self._next(None)
        if self.received_signal is not None and (second := self._next(self.limit_s)) is not None:
            self._end(self.received_signal, second)

    def _end(self, first: int, second: int) -> NoReturn:
        with contextlib.suppress(OSError):
            os.write(2, f"{self._interruption(first)}\n".encode())
        os._exit(128 + (second or first))

    def _next(self, patience_s: float | None) -> int | None:
        """The next of our signals, 0 when patience runs out first, None when the context is left."""
        end = None if patience_s is None else time.monotonic() + patience_s
        while True:
            remaining = None if end is None else max(0.0, end - time.monotonic())
            if not select.select([self._pipe], [], [], remaining)[0]:
                return 0
            number = os.read(self._pipe, 1)
            if not number:
                return None
            if number[0] in self.numbers:
                return number[0]


def _note_signal(number: int, frame: object) -> None:
    """The pipe has it already."""


_fork = threading.local()  # mask: the signals that a thread blocked before it began to fork


def _block_in_fork() -> None:
    """Until its handlers are reset, a signal in a new process would write to the pipe of this one."""
    if Signals.is_entered:
        _fork.mask = signal.pthread_sigmask(signal.SIG_BLOCK, Signals.numbers)


def _unblock_after_fork() -> None:
    if (mask := vars(_fork).pop("mask", None)) is not None:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _reset_in_fork() -> None:
    """A process that somebody's code forks is ended by its signals, of which this one does not learn."""
    if Signals.is_entered:
        signal.set_wakeup_fd(-1)
        for number in Signals.numbers:
            signal.signal(number, signal.SIG_DFL)
    _unblock_after_fork()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_block_in_fork, after_in_parent=_unblock_after_fork, after_in_child=_reset_in_fork)
