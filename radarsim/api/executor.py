"""The executor that `--workers` or `--scheduler` names."""

from contextlib import AbstractContextManager, nullcontext

from radarsim.engine.executors import Executor


def open_executor(workers: int | None, scheduler: str | None) -> AbstractContextManager[Executor | None]:
    """The executor of these workers or of this scheduler, to be entered; None where neither is given."""
    if workers is None and scheduler is None:
        return nullcontext()
    from radarsim.engine.cluster import Cluster

    return Cluster(workers, scheduler)


def scheduler_warning(scheduler: str) -> str | None:
    """A warning on the trust that a scheduler on another machine requires, in one line."""
    from radarsim.engine.cluster import scheduler_warning as line

    return line(scheduler)
