"""The engine's front: collect the sums of a work, compute a share of its blocks, or read what is stored."""

import os
from collections.abc import Callable

from radarsim.engine.blocks import Work
from radarsim.engine.dispatch import CollectedSums, Dispatch, Run, Share, ShareResult
from radarsim.engine.executors import Executor, Serial, Threads
from radarsim.engine.stop_conditions import Stop
from radarsim.errors import StoreError
from radarsim.system.threads import ThreadLimit, forbidden


def collect(
    work: Work,
    realisations: int,
    *,
    store: str | os.PathLike | None = None,
    threads: int | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Stop | None = None,
    executor: Executor | None = None,
) -> CollectedSums:
    """Sums over realisations 0 … realisations-1 of the work; the same bytes however they are obtained.

    store is the results directory: its sums of this work are used, and computed ones are kept there. threads defaults
    to all cores; with 0 none is started, and the calling thread does everything. progress(done, total, from_store) is
    called at most ten times a second, and at the end. stop() is called between tasks; once it gives a reason, no task
    starts, running ones are finished (for at most stop.grace_s, if it has that), and the result has the blocks done
    without a gap.

    However a run ends, its finished blocks are stored. NonFiniteError names the first realisations whose sums are not
    finite, which are not stored; StoreError the file that cannot be written."""
    with ThreadLimit(threads):
        run = Run(work, realisations, store, progress)
        return run.finish(None if run.restore() else _compute_missing(run, threads, stop, executor))


def compute_share(
    work: Work,
    realisations: int,
    part: tuple[int, int],
    *,
    store: str | os.PathLike,
    threads: int | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Stop | None = None,
    executor: Executor | None = None,
) -> ShareResult:
    """Compute a part of the blocks of N realisations into the store, and nothing else: (2, 3) is the second of three.

    Shares are runs of blocks, as equal as blocks permit; the last has the partial block. Stores with all shares are
    united by copying: `collect` then finds every block. The other arguments are those of `collect`."""
    with ThreadLimit(threads):
        run = Share(work, realisations, part, store, progress)
        return run.finish(None if run.restore() else _compute_missing(run, threads, stop, executor))


def _compute_missing(run: Dispatch, threads: int | None, stop: Stop | None, executor: Executor | None) -> str | None:
    """Compute the missing blocks of a run; the reason, if stopped. However it ends, finished blocks are stored."""
    pool = executor or (Serial() if forbidden() else Threads(threads))
    try:
        return run.compute(pool, stop)
    except StoreError:
        raise
    except BaseException:
        run.store_pieces(run.pieces())
        raise
    finally:
        pool.forget()
        if executor is None:
            pool.close()


def read_stored(work: Work, realisations: int, store: str | os.PathLike) -> CollectedSums | None:
    """The result of collect, if all of it is stored; else None. Computes and writes nothing, but sets damage aside.
    Every N that collect has returned, however it ended, can be read, also after larger runs."""
    run = Run(work, realisations, store, None)
    return run.result(None) if run.restore() else None
