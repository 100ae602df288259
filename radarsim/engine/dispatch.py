"""One run of the engine: stored and missing blocks, tasks dispatched, outcomes collected, and the resulting sums."""

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, Work, add_sums, gaps, share_of, widest_node
from radarsim.engine.executors import Executor, Outcome
from radarsim.engine.stop_conditions import Stop
from radarsim.engine.store.store import Store, mixture_warning
from radarsim.engine.store.writer import StoreWriter
from radarsim.engine.sums import Sums
from radarsim.errors import StoreError

SHARES = 4
POLL_S = 0.05
PROGRESS_S = 0.1


@dataclass(frozen=True, kw_only=True)
class RunCounts:
    """How realisations were obtained: those asked for, those read, those simulated in this call.

    kernel_seconds is the time inside tasks, summed over the workers; stopped says why there are fewer than wanted."""

    requested: int
    from_store: int
    computed: int
    seconds: float
    kernel_seconds: float
    stopped: str | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class CollectedSums(RunCounts, Sums):
    """The sums of realisations 0 … count-1, and how they were obtained.

    superseded: whether the store had blocks of the same request only from other sources, which are not used."""

    superseded: bool = False


@dataclass(frozen=True, kw_only=True)
class ShareResult(RunCounts):
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
        self.work, self.requested = work, realisations
        self.full_blocks, self.partial_size = divmod(realisations, work.block)
        self.first, self.stop = 0, self.full_blocks
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
        self.forest = writer.store.forest(self.full_blocks)
        writer.note_stored(self.forest.nodes)
        if self.partial_size:
            self.partial = writer.store.read(Partial(self.full_blocks, self.partial_size))

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
            for outcome in executor.take_outcomes(POLL_S):
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
                node = widest_node(first, stop, pace.level(blocks_left))
                yield node
                first = node.stop
                blocks_left -= 1 << node.level
        if self.partial_size and self.partial is None:
            yield Partial(self.full_blocks, self.partial_size)

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
            self._progress(self.from_store + self.computed, self.requested, self.from_store)
            self._progress_due = now + PROGRESS_S

    def pieces(self) -> dict[Piece, Sums]:
        """Finished pieces, as stored."""
        pieces: dict[Piece, Sums] = {}
        for node, sums in self.forest.nodes.items():
            pieces[node] = sums
        if self.partial is not None:
            pieces[Partial(self.full_blocks, self.partial_size)] = self.partial
        return pieces

    def store_pieces(self, pieces: Mapping[Piece, Sums]) -> None:
        """Put these into the store, if there is one."""
        if self._writer is not None:
            self._writer.finish(pieces)

    def _progressed(self, stopped: str | None) -> dict[str, Any]:
        """The fields of `Progress`."""
        warnings: tuple[str, ...] = ()
        if self._writer is not None:
            platforms = self._writer.store.platforms
            warnings = (*self._writer.store.warnings, *([mixture_warning(platforms)] if len(platforms) > 1 else []))
        seconds, stopped_by = time.perf_counter() - self.started, {"stopped": stopped, "warnings": warnings}
        counts = {"requested": self.requested, "from_store": self.from_store, "computed": self.computed}
        return counts | {"seconds": seconds, "kernel_seconds": self.kernel_seconds} | stopped_by


class Run(Dispatch):
    """One call of collect."""

    total: Sums | None = None

    def restore(self) -> bool:
        """Read stored pieces; whether these are all."""
        if self._writer is None:
            return False
        self.total = self._writer.store.read(Total(self.requested))
        if self.total is None:
            self._read_pieces(self._writer)
        sums_read = [self.total] if self.total is not None else self.pieces().values()
        self.from_store = sum(sums.count for sums in sums_read)
        return self.from_store == self.requested

    def finish(self, stopped: str | None) -> CollectedSums:
        """The result, once it and all its pieces are stored."""
        result = self.result(stopped)
        if self.total is None:
            pieces = self.pieces()
            if result.count:
                pieces[Total(result.count)] = Sums(result.count, result.values)
            self.store_pieces(pieces)
        self._report(last=True)
        return result

    def result(self, stopped: str | None) -> CollectedSums:
        """The sums of the finished blocks from realisation 0 on without a gap."""
        sums = self.total or self.forest.total()
        if self.total is None and self.partial is not None and sums.count == self.full_blocks * self.work.block:
            sums = add_sums(sums, self.partial, 0) if self.full_blocks else self.partial
        short = stopped if sums.count < self.requested else None
        return CollectedSums(
            count=sums.count, values=sums.values, superseded=self._superseded, **self._progressed(short)
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
        self._writer: StoreWriter = StoreWriter(Store(store, work))
        if not self._writer.store.trusted:
            raise StoreError(*self._writer.store.warnings)
        self.first, self.stop, self.partial_size = share_of(realisations, work.block, part)
        self.requested = (self.stop - self.first) * work.block + self.partial_size

    def restore(self) -> bool:
        """Read stored pieces; whether these are all of the share."""
        self._read_pieces(self._writer)
        self.from_store = self.done()
        return self.from_store == self.requested

    def done(self) -> int:
        """Finished realisations of the share."""
        missing = sum(stop - first for first, stop in self.missing()) * self.work.block
        return self.requested - missing - (self.partial_size if self.partial is None else 0)

    def finish(self, stopped: str | None) -> ShareResult:
        """The result, once it is stored; without a block an empty directory, to be copied too."""
        self._writer.store.make_folder()
        self.store_pieces(self.pieces())
        self._report(last=True)
        done = self.done()
        return ShareResult(done=done, **self._progressed(stopped if done < self.requested else None))
