"""The run loop: hand out blocks, gather their sums, keep them, stop when asked."""

import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, Work, added, widest
from radarsim.engine.executors import Executor, Outcome, Serial, Threads
from radarsim.engine.keeper import Keeper
from radarsim.engine.moments import Sums
from radarsim.engine.stopping import Stop
from radarsim.engine.store import Store
from radarsim.errors import StoreError

LONGEST_TASK_S = 0.1
SHARES = 4
POLL_S = 0.05
PROGRESS_S = 0.1


@dataclass(frozen=True)
class Collected(Sums):
    """The sums of realisations 0 … count-1, and how they were come by.

    count is what was asked for unless `stopped` says why it is less. from_store and computed are realisations: those
    read, and those simulated in this call. kernel_seconds is the time inside tasks, summed over the workers.
    """

    asked: int
    from_store: int
    computed: int
    seconds: float
    kernel_seconds: float
    stopped: str | None
    warnings: tuple[str, ...]


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
    """Sums over realisations 0 … realisations-1 of the work; the same bytes however they are come by.

    store is the results directory: what it holds of this work is used, what is computed is kept there. threads defaults
    to all cores; 0 runs everything in the calling thread. progress(done, total, from_store) is called at most ten times
    a second, and at the end. stop() is asked between tasks; once it gives a reason, no task starts, those that run are
    finished (for at most stop.grace_s, if it has that), and the result is of the blocks done without a gap.

    Whatever ends a run, what it has done is stored. NonFiniteError names the first realisations whose sums are
    not finite, which are not stored; StoreError the file that cannot be written.
    """
    run = _Run(work, realisations, store, progress)
    if run.restored():
        return run.finished(None)
    pool = executor or (Serial() if threads == 0 else Threads(threads))
    try:
        stopped = run.compute(pool, stop)
    except StoreError:
        raise
    except BaseException:
        run.keep(run.pieces())
        raise
    finally:
        pool.cancel()
        if executor is None:
            pool.close()
    return run.finished(stopped)


def stored(work: Work, realisations: int, store: str | os.PathLike) -> Collected | None:
    """What collect would give, if all of it is stored; else None. Computes and writes nothing, but sets damage aside.

    Every N that collect has returned, in whatever way it ended, is there to be read, also after larger runs.
    """
    run = _Run(work, realisations, store, None)
    return run.result(None) if run.restored() else None


class _Pace:
    """How many blocks make a task, from how long one takes. It never changes a number: sums merge in the same tree."""

    def __init__(self, executor: Executor):
        self._executor = executor
        self._block_s = math.inf

    def note(self, blocks: int, seconds: float) -> None:
        """The least time counts: the first tasks may contain a compilation."""
        self._block_s = min(self._block_s, max(seconds, 1e-7) / blocks)

    def level(self, blocks_left: int) -> int:
        """log2 of the blocks of the next task: long enough to be worth handing over, short enough to end together."""
        if math.isinf(self._block_s):
            return 0
        share = self._block_s * blocks_left / (self._executor.workers * SHARES)
        fair = math.floor(math.log2(min(share, LONGEST_TASK_S) / self._block_s))
        worthwhile = math.ceil(math.log2(self._executor.shortest_s / self._block_s))
        return max(0, fair, worthwhile)


class _Run:
    """One call of collect."""

    def __init__(
        self,
        work: Work,
        realisations: int,
        store: str | os.PathLike | None,
        progress: Callable[[int, int, int], None] | None,
    ):
        self.work, self.asked = work, realisations
        self.full, self.rest = divmod(realisations, work.block)
        self.forest = Forest(work.block, work.size)
        self.partial: Sums | None = None
        self.total: Sums | None = None
        self.from_store = self.computed = 0
        self.kernel_seconds = 0.0
        self.started = time.perf_counter()
        self._keeper = None if store is None else Keeper(Store(store, work))
        self._progress, self._progress_due = progress, 0.0
        self._fault: Outcome | None = None

    def restored(self) -> bool:
        """Read what is stored; whether that is all."""
        if self._keeper is None:
            return False
        self.total = self._keeper.store.read(Total(self.asked))
        if self.total is None:
            self.forest = self._keeper.store.forest(self.full)
            self._keeper.found(self.forest.nodes)
            if self.rest:
                self.partial = self._keeper.store.read(Partial(self.full, self.rest))
        held = [self.total] if self.total is not None else self.pieces().values()
        self.from_store = sum(sums.count for sums in held)
        return self.from_store == self.asked

    def compute(self, executor: Executor, stop: Stop | None) -> str | None:
        """Hand out what is missing and take it in; the reason, if stop gave one."""
        pace = _Pace(executor)
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
            if self._keeper is not None:
                self._keeper.offer(self.forest.nodes)
        if self._fault is not None:
            raise self._fault.error
        return stopped

    def _tasks(self, pace: _Pace) -> Iterator[Node | Partial]:
        gaps = self.forest.gaps(self.full)
        left = sum(stop - first for first, stop in gaps)
        for first, stop in gaps:
            while first < stop:
                node = widest(first, stop, pace.level(left))
                yield node
                first = node.stop
                left -= 1 << node.level
        if self.rest and self.partial is None:
            yield Partial(self.full, self.rest)

    def _take(self, outcome: Outcome, pace: _Pace) -> None:
        self.kernel_seconds += outcome.seconds
        if outcome.error is not None:
            if self._fault is None or outcome.piece.first < self._fault.piece.first:
                self._fault = outcome
            return
        self.computed += outcome.sums.count
        if self._keeper is not None:
            self._keeper.store.platforms.add(outcome.instruction_set)
        if isinstance(outcome.piece, Partial):
            self.partial = outcome.sums
        else:
            pace.note(1 << outcome.piece.level, outcome.seconds)
            self.forest.add(outcome.piece, outcome.sums)

    def _report(self, *, last: bool = False) -> None:
        now = time.perf_counter()
        if self._progress is not None and (last or now >= self._progress_due):
            self._progress(self.from_store + self.computed, self.asked, self.from_store)
            self._progress_due = now + PROGRESS_S

    def pieces(self) -> dict[Piece, Sums]:
        """What is done, as it is stored."""
        cut = {} if self.partial is None else {Partial(self.full, self.rest): self.partial}
        return self.forest.nodes | cut

    def keep(self, pieces: dict[Piece, Sums]) -> None:
        """Put these into the store, if there is one."""
        if self._keeper is not None:
            self._keeper.finish(pieces)

    def finished(self, stopped: str | None) -> Collected:
        """The result, once all that it rests on is stored, and itself as a total."""
        result = self.result(stopped)
        if self.total is None:
            reported = {Total(result.count): Sums(result.count, result.values)} if result.count else {}
            self.keep(self.pieces() | reported)
        self._report(last=True)
        return result

    def result(self, stopped: str | None) -> Collected:
        """The sums of what is done from realisation 0 on without a gap."""
        sums = self.total or self.forest.total()
        if self.total is None and self.partial is not None and sums.count == self.full * self.work.block:
            sums = added(sums, self.partial, 0) if self.full else self.partial
        return Collected(
            count=sums.count,
            values=sums.values,
            asked=self.asked,
            from_store=self.from_store,
            computed=self.computed,
            seconds=time.perf_counter() - self.started,
            kernel_seconds=self.kernel_seconds,
            stopped=stopped if sums.count < self.asked else None,
            warnings=self._warnings(),
        )

    def _warnings(self) -> tuple[str, ...]:
        if self._keeper is None:
            return ()
        store = self._keeper.store
        if len(store.platforms) < 2:
            return tuple(store.warnings)
        mixed = "; ".join(sorted(store.platforms))
        return (*store.warnings, f"{store.path}: sums from several instruction sets, equal to 1e-12 only: {mixed}")
