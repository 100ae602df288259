"""One experiment from config to written results: the wiring that the command and Python share."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from radarsim import studies
from radarsim.config.load import Case, Experiment, load
from radarsim.engine.collect import collect
from radarsim.engine.store import Store
from radarsim.errors import ConfigError


def load_all(sources: Sequence, overrides: Sequence[str] = ()) -> list[Experiment]:
    """Every config checked before any runs; raises one ConfigError with the faults of all."""
    loaded, faults = [], []
    for source in sources:
        try:
            loaded.append(load(source, overrides))
        except ConfigError as error:
            faults += error.lines
    if faults:
        raise ConfigError(*faults)
    return loaded


@dataclass(frozen=True)
class CaseOutlook:
    """What running a case would take: labels, counts, seconds of one thread's work."""

    name: str
    filters: str
    scans: int
    realisations: int
    seconds: float


@dataclass(frozen=True)
class Outlook:
    """What running an experiment would take, on `threads` threads."""

    cases: tuple[CaseOutlook, ...]
    threads: int
    seconds: float
    memory_mb: float


def outlook(experiment: Experiment, threads: int | None = None) -> Outlook:
    """Time one block of every case, compiled beforehand, and say what the whole would take."""
    threads = threads or os.cpu_count() or 1
    cases, largest = [], 0
    for case in experiment.cases:
        work = studies.CaseWork(case)
        count = min(work.block, case.realisations)
        work.simulate(0, count)
        started = time.perf_counter()
        work.simulate(0, count)
        seconds = (time.perf_counter() - started) / count * case.realisations
        axes = work.plan.axes
        cases.append(CaseOutlook(case.name, ", ".join(axes.filters), len(axes.k), case.realisations, seconds))
        largest = max(largest, work.size)
    # Vectors of sums in flight: two a thread, one a level of the tree; beside them the interpreter with NumPy, Numba and pandas.
    memory = 200 + 8e-6 * largest * (2 * threads + 32)
    return Outlook(tuple(cases), threads, sum(c.seconds for c in cases) / threads, memory)
