"""The engine's front: collect the sums of a work, read what is stored, compute a share of the blocks.

One run: stored and missing blocks, tasks dispatched, outcomes collected, and the resulting sums.

Reasons to stop a run: a stop condition is called between tasks and gives None or the reason as text.

Executors run tasks: they take (work, piece) and return outcomes in any order."""

import contextlib
import math
import os
import select
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, NoReturn, Protocol

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, Work, added, gaps, share_of, simulated, widest
from radarsim.engine.machine import available_cores, platform_name
from radarsim.engine.results import Sums
from radarsim.engine.store.store import Store, mixture
from radarsim.engine.store.writer import StoreWriter
from radarsim.errors import Interrupted, StoreError
from radarsim.threads import forbidden, limited

# ---- stopping --------------------------------------------------------------------------------------------------------
Stop = Callable[[], str | None]


class TimeLimit:
    """Stop when that many seconds have passed from `begun`, by default now; `less` earlier, for work afterwards."""

    def __init__(self, seconds: float, begun: float | None = None, less: float = 0.0) -> None:
        self.seconds = seconds
        self.begun = time.monotonic() if begun is None else begun
        self._end = self.begun + seconds - less

    def __call__(self) -> str | None:
        return f"time limit of {self.seconds:g} s" if time.monotonic() >= self._end else None

    @property
    def left(self) -> float:
        """Seconds until then, at least 0."""
        return max(0.0, self._end - time.monotonic())

    def reserving(self, seconds: float) -> "TimeLimit":
        """The limit reduced by so many seconds, by at most half of the rest."""
        return TimeLimit(self.seconds, self.begun, min(seconds, 0.5 * self.left))


class Either:
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
    are forbidden the handlers do it, with an alarm for the 1.5 s: delayed by compiled code."""

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

    inside = False  # whether one is entered

    def __enter__(self) -> "Signals":
        Signals.inside = True
        self._alone = forbidden()
        if self._alone:
            self._before = {number: signal.signal(number, self._handle) for number in (*self.numbers, signal.SIGALRM)}
            return self
        self._pipe, self._write_end = os.pipe()
        os.set_blocking(self._write_end, False)
        self._wakeup_before = signal.set_wakeup_fd(self._write_end, warn_on_full_buffer=False)
        self._before = {number: signal.signal(number, _noted) for number in self.numbers}
        self._watcher = threading.Thread(target=self._watch, name="signals", daemon=True)
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        Signals.inside = False
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
        if self.received is not None:
            self._end(self.received, 0 if number == signal.SIGALRM else number)
        self.received = number
        signal.setitimer(signal.ITIMER_REAL, self.limit_s)

    def _watch(self) -> None:
        self.received = self._next(None)
        if self.received is not None and (second := self._next(self.limit_s)) is not None:
            self._end(self.received, second)

    @staticmethod
    def _end(first: int, second: int) -> NoReturn:
        with contextlib.suppress(OSError):
            os.write(2, f"{Interrupted(first)}\n".encode())
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


def _noted(number: int, frame: object) -> None:
    """The pipe has it already."""


def _of_a_fork() -> None:
    """A process that somebody's code forks is ended by its signals, of which this one does not learn."""
    if Signals.inside:
        signal.set_wakeup_fd(-1)
        for number in Signals.numbers:
            signal.signal(number, signal.SIG_DFL)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_of_a_fork)


# ---- executors -------------------------------------------------------------------------------------------------------
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

    def finished(self, timeout_s: float) -> list[Outcome]:
        """Outcomes since the last call, waiting at most timeout_s for the first."""

    def cancel(self) -> int:
        """Drop the tasks not yet started; their number."""

    def forget(self) -> None:
        """At the end of the run, however it ended: drop all tasks, and never return the outcome of a running one."""

    def close(self) -> None:
        """Release the workers without waiting for running tasks."""


def attempted(work: Work, piece: Node | Partial) -> Outcome:
    """Run one task; a top-level function of small arguments, so that it also travels to other processes."""
    started = time.perf_counter()
    result: Sums | Exception
    try:
        result = simulated(work, piece)
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
            outcomes.put(attempted(work, piece))

    def submit(self, work: Work, piece: Node | Partial) -> None:
        """Submit a task; returns at once."""
        self._tasks.put((self._outcomes, work, piece))

    def finished(self, timeout_s: float) -> list[Outcome]:
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

    def finished(self, timeout_s: float) -> list[Outcome]:
        """Run the oldest task; the timeout has no effect."""
        return [attempted(*self._tasks.popleft())] if self._tasks else []

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


# ---- run -------------------------------------------------------------------------------------------------------------
SHARES = 4
POLL_S = 0.05
PROGRESS_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How realisations were obtained: those asked for, those read, those simulated in this call.

    kernel_seconds is the time inside tasks, summed over the workers; stopped says why there are fewer than wanted."""

    asked: int
    from_store: int
    computed: int
    seconds: float
    kernel_seconds: float
    stopped: str | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Collected(Progress, Sums):
    """The sums of realisations 0 … count-1, and how they were obtained.

    superseded: whether the store had blocks of the same request only from other sources, which are not used."""

    superseded: bool = False


@dataclass(frozen=True, kw_only=True)
class Shared(Progress):
    """Result of computing a share, of which `done` realisations are there."""

    done: int


class Pace:
    """The number of blocks in a task, from their duration. It changes no number: sums merge in the same tree."""

    def __init__(self, executor: Executor):
        self._executor = executor
        self._block_s = math.inf

    def note(self, blocks: int, seconds: float) -> None:
        """The least time counts: the first tasks may include compilation."""
        self._block_s = min(self._block_s, max(seconds, 1e-7) / blocks)

    def level(self, blocks_left: int) -> int:
        """log2 of the blocks of the next task: long enough to be worth submitting, short enough to end together."""
        if math.isinf(self._block_s):
            return 0
        workers = max(self._executor.workers, 1)  # none are there while dead ones are replaced
        share = self._block_s * blocks_left / (workers * SHARES)
        fair = math.floor(math.log2(min(share, self._executor.longest_s) / self._block_s))
        worthwhile = math.ceil(math.log2(self._executor.shortest_s / self._block_s))
        return max(0, fair, worthwhile)


class Dispatch:
    """Tasks over realisations 0 … N-1, of which blocks first … stop-1 and the partial one are to be done here."""

    def __init__(
        self,
        work: Work,
        realisations: int,
        store: str | os.PathLike[str] | None,
        progress: Callable[[int, int, int], None] | None,
    ):
        self.work, self.asked = work, realisations
        self.full, self.rest = divmod(realisations, work.block)
        self.first, self.stop = 0, self.full
        self.forest = Forest(work.block, work.size)
        self.partial: Sums | None = None
        self.from_store = self.computed = 0
        self.kernel_seconds = 0.0
        self.started = time.perf_counter()
        self._writer = None if store is None else StoreWriter(Store(store, work))
        self._superseded = self._writer is not None and self._writer.store.superseded()
        self._progress, self._progress_due = progress, 0.0
        self._fault: tuple[Node | Partial, Exception] | None = None  # the leftmost, and what it raised

    def _read_pieces(self, writer: StoreWriter) -> None:
        self.forest = writer.store.forest(self.full)
        writer.note_stored(self.forest.nodes)
        if self.rest:
            self.partial = writer.store.read(Partial(self.full, self.rest))

    def compute(self, executor: Executor, stop: Stop | None) -> str | None:
        """Dispatch what is missing and collect the outcomes; the reason, if stop gave one."""
        pace = Pace(executor)
        tasks = self._tasks(pace)
        waiting, stopped, give_up = 0, None, math.inf
        while True:
            if stopped is None and stop is not None and (stopped := stop()) is not None:
                give_up = time.perf_counter() + getattr(stop, "grace_s", math.inf)
            if stopped is not None or self._fault is not None:
                waiting -= executor.cancel()
            else:
                while waiting < executor.depth and (piece := next(tasks, None)) is not None:
                    executor.submit(self.work, piece)
                    waiting += 1
            if waiting == 0 or time.perf_counter() > give_up:
                break
            for outcome in executor.finished(POLL_S):
                waiting -= 1
                self._take(outcome, pace)
            self._report()
            if self._writer is not None:
                self._writer.offer(self.forest.nodes)
        if self._fault is not None:
            raise self._fault[1]
        return stopped

    def missing(self) -> list[tuple[int, int]]:
        """Runs (first, stop) of its missing blocks."""
        return gaps(self.forest.nodes, self.stop, self.first)

    def _tasks(self, pace: Pace) -> Iterator[Node | Partial]:
        missing = self.missing()
        blocks_left = sum(stop - first for first, stop in missing)
        for first, stop in missing:
            while first < stop:
                node = widest(first, stop, pace.level(blocks_left))
                yield node
                first = node.stop
                blocks_left -= 1 << node.level
        if self.rest and self.partial is None:
            yield Partial(self.full, self.rest)

    def _take(self, outcome: Outcome, pace: Pace) -> None:
        self.kernel_seconds += outcome.seconds
        sums = outcome.result
        if isinstance(sums, Exception):
            if self._fault is None or outcome.piece.first < self._fault[0].first:
                self._fault = outcome.piece, sums
            return
        self.computed += sums.count
        if self._writer is not None:
            self._writer.store.platforms.add(outcome.platform)
        if isinstance(outcome.piece, Partial):
            self.partial = sums
        else:
            pace.note(1 << outcome.piece.level, outcome.seconds)
            self.forest.add(outcome.piece, sums)

    def _report(self, *, last: bool = False) -> None:
        now = time.perf_counter()
        if self._progress is not None and (last or now >= self._progress_due):
            self._progress(self.from_store + self.computed, self.asked, self.from_store)
            self._progress_due = now + PROGRESS_S

    def pieces(self) -> dict[Piece, Sums]:
        """Finished pieces, as stored."""
        pieces: dict[Piece, Sums] = {}
        for node, sums in self.forest.nodes.items():
            pieces[node] = sums
        if self.partial is not None:
            pieces[Partial(self.full, self.rest)] = self.partial
        return pieces

    def keep(self, pieces: Mapping[Piece, Sums]) -> None:
        """Put these into the store, if there is one."""
        if self._writer is not None:
            self._writer.finish(pieces)

    def _progressed(self, stopped: str | None) -> dict[str, Any]:
        """The fields of `Progress`."""
        warnings: tuple[str, ...] = ()
        if self._writer is not None:
            platforms = self._writer.store.platforms
            warnings = (*self._writer.store.warnings, *([mixture(platforms)] if len(platforms) > 1 else []))
        seconds, stopped_by = time.perf_counter() - self.started, {"stopped": stopped, "warnings": warnings}
        counts = {"asked": self.asked, "from_store": self.from_store, "computed": self.computed}
        return counts | {"seconds": seconds, "kernel_seconds": self.kernel_seconds} | stopped_by


class Run(Dispatch):
    """One call of collect."""

    total: Sums | None = None

    def restored(self) -> bool:
        """Read stored pieces; whether these are all."""
        if self._writer is None:
            return False
        self.total = self._writer.store.read(Total(self.asked))
        if self.total is None:
            self._read_pieces(self._writer)
        sums_read = [self.total] if self.total is not None else self.pieces().values()
        self.from_store = sum(sums.count for sums in sums_read)
        return self.from_store == self.asked

    def finished(self, stopped: str | None) -> Collected:
        """The result, once it and all its pieces are stored."""
        result = self.result(stopped)
        if self.total is None:
            pieces = self.pieces()
            if result.count:
                pieces[Total(result.count)] = Sums(result.count, result.values)
            self.keep(pieces)
        self._report(last=True)
        return result

    def result(self, stopped: str | None) -> Collected:
        """The sums of the finished blocks from realisation 0 on without a gap."""
        sums = self.total or self.forest.total()
        if self.total is None and self.partial is not None and sums.count == self.full * self.work.block:
            sums = added(sums, self.partial, 0) if self.full else self.partial
        short = stopped if sums.count < self.asked else None
        return Collected(count=sums.count, values=sums.values, superseded=self._superseded, **self._progressed(short))


class Share(Dispatch):
    """One call of share. Its sums go into the store as nodes; it makes no total."""

    def __init__(
        self,
        work: Work,
        realisations: int,
        part: tuple[int, int],
        store: str | os.PathLike[str],
        progress: Callable[[int, int, int], None] | None,
    ):
        super().__init__(work, realisations, None, progress)
        self._writer: StoreWriter = StoreWriter(Store(store, work))
        if not self._writer.store.trusted:
            raise StoreError(*self._writer.store.warnings)
        self.first, self.stop, self.rest = share_of(realisations, work.block, part)
        self.asked = (self.stop - self.first) * work.block + self.rest

    def restored(self) -> bool:
        """Read stored pieces; whether these are all of the share."""
        self._read_pieces(self._writer)
        self.from_store = self.done()
        return self.from_store == self.asked

    def done(self) -> int:
        """Finished realisations of the share."""
        missing = sum(stop - first for first, stop in self.missing()) * self.work.block
        return self.asked - missing - (self.rest if self.partial is None else 0)

    def finished(self, stopped: str | None) -> Shared:
        """The result, once it is stored; without a block an empty directory, to be copied too."""
        self._writer.store.make_folder()
        self.keep(self.pieces())
        self._report(last=True)
        done = self.done()
        return Shared(done=done, **self._progressed(stopped if done < self.asked else None))


# ---- collect ---------------------------------------------------------------------------------------------------------
def collect(
    work: Work,
    realisations: int,
    *,
    store: str | os.PathLike | None = None,
    threads: int | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Stop | None = None,
    executor: Executor | None = None,
) -> Collected:
    """Sums over realisations 0 … realisations-1 of the work; the same bytes however they are obtained.

    store is the results directory: its sums of this work are used, and computed ones are kept there. threads defaults
    to all cores; with 0 none is started, and the calling thread does everything. progress(done, total, from_store) is
    called at most ten times a second, and at the end. stop() is called between tasks; once it gives a reason, no task
    starts, running ones are finished (for at most stop.grace_s, if it has that), and the result has the blocks done
    without a gap.

    However a run ends, its finished blocks are stored. NonFiniteError names the first realisations whose sums are not
    finite, which are not stored; StoreError the file that cannot be written."""
    with limited(threads):
        run = Run(work, realisations, store, progress)
        return run.finished(None if run.restored() else _computed(run, threads, stop, executor))


def share(
    work: Work,
    realisations: int,
    part: tuple[int, int],
    *,
    store: str | os.PathLike,
    threads: int | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Stop | None = None,
    executor: Executor | None = None,
) -> Shared:
    """Compute a part of the blocks of N realisations into the store, and nothing else: (2, 3) is the second of three.

    Shares are runs of blocks, as equal as blocks permit; the last has the partial block. Stores with all shares are
    united by copying: `collect` then finds every block. The other arguments are those of `collect`."""
    with limited(threads):
        run = Share(work, realisations, part, store, progress)
        return run.finished(None if run.restored() else _computed(run, threads, stop, executor))


def _computed(run: Dispatch, threads: int | None, stop: Stop | None, executor: Executor | None) -> str | None:
    """Compute the missing blocks of a run; the reason, if stopped. However it ends, finished blocks are stored."""
    pool = executor or (Serial() if forbidden() else Threads(threads))
    try:
        return run.compute(pool, stop)
    except StoreError:
        raise
    except BaseException:
        run.keep(run.pieces())
        raise
    finally:
        pool.forget()
        if executor is None:
            pool.close()


def stored(work: Work, realisations: int, store: str | os.PathLike) -> Collected | None:
    """The result of collect, if all of it is stored; else None. Computes and writes nothing, but sets damage aside.
    Every N that collect has returned, however it ended, can be read, also after larger runs."""
    run = Run(work, realisations, store, None)
    return run.result(None) if run.restored() else None
