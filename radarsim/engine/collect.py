"""The engine's front: collect the sums of a work, read what is stored, compute a share of the blocks."""

import os
from collections.abc import Callable

from radarsim.engine.blocks import Work
from radarsim.engine.executors import Executor, Serial, Threads
from radarsim.engine.run import Collected, Dispatch, Run, Share, Shared
from radarsim.engine.stopping import Stop
from radarsim.errors import StoreError


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

    store is the results directory: what it holds of this work is used, what is computed is kept there. threads defaults
    to all cores; 0 runs everything in the calling thread. progress(done, total, from_store) is called at most ten times
    a second, and at the end. stop() is asked between tasks; once it gives a reason, no task starts, those that run are
    finished (for at most stop.grace_s, if it has that), and the result is of the blocks done without a gap.

    Whatever ends a run, what it has done is stored. NonFiniteError names the first realisations whose sums are
    not finite, which are not stored; StoreError the file that cannot be written.
    """
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
    """Put a part of the blocks of N realisations into the store, and nothing else: (2, 3) is the second of three.

    Shares are runs of blocks, as equal as blocks can be cut; the last holds the cut block. Stores in which all shares
    are done are united by copying: `collect` then finds every block. The other arguments are those of `collect`.
    """
    run = Share(work, realisations, part, store, progress)
    return run.finished(None if run.restored() else _computed(run, threads, stop, executor))


def _computed(run: Dispatch, threads: int | None, stop: Stop | None, executor: Executor | None) -> str | None:
    """Compute what a run lacks; the reason, if it was stopped. Whatever ends it, what is done is stored."""
    pool = executor or (Serial() if threads == 0 else Threads(threads))
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
    """What collect would give, if all of it is stored; else None. Computes and writes nothing, but sets damage aside.

    Every N that collect has returned, in whatever way it ended, is there to be read, also after larger runs.
    """
    run = Run(work, realisations, store, None)
    return run.result(None) if run.restored() else None
