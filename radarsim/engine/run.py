"""One run: what is stored, what is missing, tasks dispatched, outcomes collected, and the resulting sums."""

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, Work, added, gaps, share_of, widest
from radarsim.engine.executors import Executor, Outcome
from radarsim.engine.keeper import Keeper
from radarsim.engine.moments import Sums
from radarsim.engine.stopping import Stop
from radarsim.engine.store import Store, mixture

SHARES = 4
POLL_S = 0.05
PROGRESS_S = 0.1


@dataclass(frozen=True)
class Collected(Sums):
    """The sums of realisations 0 … count-1, and how they were obtained.

    count is what was asked for unless `stopped` says why it is less. from_store and computed are realisations: those
    read, and those simulated in this call. kernel_seconds is the time inside tasks, summed over the workers; kept_as
    the identity under which the store has them, None without a store.
    """

    asked: int
    from_store: int
    computed: int
    seconds: float
    kernel_seconds: float
    stopped: str | None
    warnings: tuple[str, ...]
    kept_as: str | None


@dataclass(frozen=True)
class Shared:
    """What computing a share came to, in realisations; `stopped` says why `done` is less than `asked`."""

    asked: int
    done: int
    from_store: int
    computed: int
    seconds: float
    kernel_seconds: float
    stopped: str | None
    warnings: tuple[str, ...]


class Pace:
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
        workers = max(self._executor.workers, 1)  # none are there while dead ones are replaced
        share = self._block_s * blocks_left / (workers * SHARES)
        fair = math.floor(math.log2(min(share, self._executor.longest_s) / self._block_s))
        worthwhile = math.ceil(math.log2(self._executor.shortest_s / self._block_s))
        return max(0, fair, worthwhile)


class Dispatch:
    """Tasks over realisations 0 … N-1, of which blocks first … stop-1 and the cut one are to be done here."""

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
        self._keeper = None if store is None else Keeper(Store(store, work))
        self._progress, self._progress_due = progress, 0.0
        self._fault: tuple[Node | Partial, Exception] | None = None  # the leftmost, and what it raised

    def _read_pieces(self, keeper: Keeper) -> None:
        self.forest = keeper.store.forest(self.full)
        keeper.found(self.forest.nodes)
        if self.rest:
            self.partial = keeper.store.read(Partial(self.full, self.rest))

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
            if self._keeper is not None:
                self._keeper.offer(self.forest.nodes)
        if self._fault is not None:
            raise self._fault[1]
        return stopped

    def missing(self) -> list[tuple[int, int]]:
        """Runs (first, stop) of its blocks that are not done."""
        return gaps(self.forest.nodes, self.stop, self.first)

    def _tasks(self, pace: Pace) -> Iterator[Node | Partial]:
        missing = self.missing()
        left = sum(stop - first for first, stop in missing)
        for first, stop in missing:
            while first < stop:
                node = widest(first, stop, pace.level(left))
                yield node
                first = node.stop
                left -= 1 << node.level
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
        if self._keeper is not None:
            self._keeper.store.platforms.add(outcome.platform)
            self._keeper.store.mark(outcome.piece, sums)
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
        """What is done, as it is stored."""
        pieces: dict[Piece, Sums] = {}
        for node, sums in self.forest.nodes.items():
            pieces[node] = sums
        if self.partial is not None:
            pieces[Partial(self.full, self.rest)] = self.partial
        return pieces

    def keep(self, pieces: Mapping[Piece, Sums]) -> None:
        """Put these into the store, if there is one."""
        if self._keeper is not None:
            self._keeper.finish(pieces)

    def _warnings(self) -> tuple[str, ...]:
        if self._keeper is None:
            return ()
        store = self._keeper.store
        if len(store.platforms) < 2:
            return tuple(store.warnings)
        return (*store.warnings, mixture(store.platforms))


class Run(Dispatch):
    """One call of collect."""

    total: Sums | None = None

    def restored(self) -> bool:
        """Read what is stored; whether that is all."""
        if self._keeper is None:
            return False
        self.total = self._keeper.store.read(Total(self.asked))
        if self.total is None:
            self._read_pieces(self._keeper)
        held = [self.total] if self.total is not None else self.pieces().values()
        self.from_store = sum(sums.count for sums in held)
        return self.from_store == self.asked

    def finished(self, stopped: str | None) -> Collected:
        """The result, once all that it rests on is stored, and itself as a total."""
        result = self.result(stopped)
        if self.total is None:
            pieces = self.pieces()
            if result.count:
                pieces[Total(result.count)] = Sums(result.count, result.values)
            self.keep(pieces)
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
            kept_as=None if self._keeper is None else self._keeper.store.path.name,
        )


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
        self._keeper: Keeper = Keeper(Store(store, work))
        self.first, self.stop, self.rest = share_of(realisations, work.block, part)
        self.asked = (self.stop - self.first) * work.block + self.rest

    def restored(self) -> bool:
        """Read what is stored; whether that is all of the share."""
        self._read_pieces(self._keeper)
        self.from_store = self.done()
        return self.from_store == self.asked

    def done(self) -> int:
        """Realisations of the share that are done."""
        missing = sum(stop - first for first, stop in self.missing()) * self.work.block
        return self.asked - missing - (self.rest if self.partial is None else 0)

    def finished(self, stopped: str | None) -> Shared:
        """What was done, once it is stored; without a block an empty directory, to be copied too."""
        self._keeper.store.make()
        self.keep(self.pieces())
        self._report(last=True)
        done = self.done()
        return Shared(
            asked=self.asked,
            done=done,
            from_store=self.from_store,
            computed=self.computed,
            seconds=time.perf_counter() - self.started,
            kernel_seconds=self.kernel_seconds,
            stopped=stopped if done < self.asked else None,
            warnings=self._warnings(),
        )
