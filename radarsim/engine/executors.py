"""Executors run tasks: they take (work, piece) and return outcomes in any order."""

import threading
import time
from collections import deque
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Protocol

from radarsim.engine.blocks import Node, Partial, Work, simulate_piece
from radarsim.engine.machine import available_cores, platform_name
from radarsim.engine.sums import Sums


@dataclass(frozen=True)
class Outcome:
    """A finished task: its sums or its exception, the seconds, and the platform."""

    piece: Node | Partial
    result: Sums | Exception
    seconds: float
    platform: str


class Executor(Protocol):
    """`workers` tasks run at once, `depth` are worth submitting in advance, and one should last from `shortest_s` to
    `longest_s`. Tasks must start in the order of submit, so that a stopped run has finished its leftmost ones."""

    workers: int
    depth: int
    shortest_s: float
    longest_s: float

    def submit(self, work: Work, piece: Node | Partial) -> None:
        """Submit a task; returns at once."""

    def take_outcomes(self, timeout_s: float) -> list[Outcome]:
        """Outcomes since the last call, waiting at most timeout_s for the first."""

    def cancel(self) -> int:
        """Drop the tasks not yet started; their number."""

    def forget(self) -> None:
        """At the end of the run, however it ended: drop all tasks, and never return the outcome of a running one."""

    def close(self) -> None:
        """Release the workers without waiting for running tasks."""


def run_task(work: Work, piece: Node | Partial) -> Outcome:
    """Run one task; a top-level function of small arguments, so that it also travels to other processes."""
    started = time.perf_counter()
    result: Sums | Exception
    try:
        result = simulate_piece(work, piece)
    except Exception as error:
        result = error
    except SystemExit as error:  # it would end this thread alone, and the run would wait for its outcome
        result = RuntimeError(f"SystemExit: {error}").with_traceback(error.__traceback__)
    return Outcome(piece, result, time.perf_counter() - started, platform_name())


class Threads:
    """Pool threads of this process; kernels release the interpreter's lock.

    Even one thread is a pool thread: on the main thread the time of a kernel depends on the address of its stack. They
    are daemons, so that a task that overruns its time at a stop does not keep the process alive."""

    shortest_s = 3e-3
    longest_s = 0.1

    def __init__(self, workers: int | None = None):
        self.workers = workers or available_cores()
        self.depth = 2 * self.workers
        self._tasks: SimpleQueue[tuple[SimpleQueue[Outcome], Work, Node | Partial] | None] = SimpleQueue()
        self._outcomes: SimpleQueue[Outcome] = SimpleQueue()
        for number in range(self.workers):
            threading.Thread(target=self._serve, name=f"block worker {number}", daemon=True).start()

    def _serve(self) -> None:
        while (task := self._tasks.get()) is not None:
            outcomes, work, piece = task
            outcomes.put(run_task(work, piece))

    def submit(self, work: Work, piece: Node | Partial) -> None:
        """Submit a task; returns at once."""
        self._tasks.put((self._outcomes, work, piece))

    def take_outcomes(self, timeout_s: float) -> list[Outcome]:
        """Outcomes since the last call, waiting at most timeout_s for the first."""
        outcomes = []
        try:
            outcomes.append(self._outcomes.get(timeout=timeout_s))
            while True:
                outcomes.append(self._outcomes.get_nowait())
        except Empty:
            return outcomes

    def cancel(self) -> int:
        """Drop the tasks not yet started; their number."""
        dropped = 0
        try:
            while True:
                self._tasks.get_nowait()
                dropped += 1
        except Empty:
            return dropped

    def forget(self) -> None:
        """Drop all tasks; the outcome of a running one is ignored."""
        self.cancel()
        self._outcomes = SimpleQueue()

    def close(self) -> None:
        """Let the threads end after their present task, without waiting for them."""
        for _ in range(self.workers):
            self._tasks.put(None)


class Serial:
    """Everything in the calling thread, one task at a time: for debuggers, profilers, and if threads are forbidden."""

    workers, depth, shortest_s, longest_s = 1, 1, Threads.shortest_s, Threads.longest_s

    def __init__(self) -> None:
        self._tasks: deque[tuple[Work, Node | Partial]] = deque()

    def submit(self, work: Work, piece: Node | Partial) -> None:
        """Keep a task until the next call of finished."""
        self._tasks.append((work, piece))

    def take_outcomes(self, timeout_s: float) -> list[Outcome]:
        """Run the oldest task; the timeout has no effect."""
        return [run_task(*self._tasks.popleft())] if self._tasks else []

    def cancel(self) -> int:
        """Drop the kept tasks; their number."""
        dropped = len(self._tasks)
        self._tasks.clear()
        return dropped

    def forget(self) -> None:
        """Drop all tasks."""
        self.cancel()

    def close(self) -> None:
        """Nothing is held."""
