"""What running an experiment would take."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from radarsim.app.simulation import NO_CONTROL, check_precision, result_of, table_of, unknown
from radarsim.app.work import CaseWork
from radarsim.config.experiment import Experiment
from radarsim.engine.collect import collect
from radarsim.engine.machine import available_cores
from radarsim.engine.results import Axes
from radarsim.errors import ConfigError
from radarsim.language import tr
from radarsim.studies import registry

PILOT_S = 0.3  # of all cases together, unless single realisations take longer
LADDER, FOR_NOTHING = 8, 1.2  # so many times more realisations at a look; times as good as equal
SHORT_S = 0.01
PILOT_OF_PRECISION_S, LEAST, MOST = 1.0, 256, 16_384  # realisations that a precision is judged from


@dataclass(frozen=True)
class Need:
    """What a precision takes: realisations (None beyond all bounds), from `exact` values or a `pilot` of how many, and
    the name of what reaches it last."""

    realisations: int | None
    known_by: str
    last: str


@dataclass(frozen=True)
class CaseOutlook:
    """What running a case would take: labels, counts, seconds of one thread's work.

    need is what a precision takes by the plain intervals, controlled by those with control variates, where the config
    asks for these; beside each the seconds of one thread until then. The run ends at the earlier.
    """

    name: str
    filters: str
    scans: int
    realisations: int
    seconds: float
    need: Need | None = None
    controlled: Need | None = None
    seconds_plain: float | None = None
    seconds_controlled: float | None = None


@dataclass(frozen=True)
class Outlook:
    """What running an experiment would take, on `threads` threads."""

    cases: tuple[CaseOutlook, ...]
    threads: int
    seconds: float
    memory_mb: float
    precision: float | None = None
    of: str = "sigma"
    warnings: tuple[str, ...] = ()


def outlook(
    experiment: Experiment,
    threads: int | None = None,
    precision: float | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    of: str = "sigma",
) -> Outlook:
    """Prepare every case and time a few realisations of it, compiled beforehand, and say what the whole would take.

    With a precision, in per cent, of a kind of quantity: a case ends when that is reached, or at its N. progress(done,
    total, 0) is called after each case.
    """
    threads = threads or available_cores()
    if precision is not None:
        check_precision([experiment], precision, of)
    cases: list[CaseOutlook] = []
    largest, preparing, control = 0, 0.0, False
    registry.study(experiment.study).prepare(experiment.cases[0])  # what it loads is not to be timed
    for done, case in enumerate(experiment.cases, 1):
        work, started = CaseWork(case), time.perf_counter()
        work.plan  # noqa: B018  (prepares it)
        preparing += time.perf_counter() - started
        work.simulate(0, 1)
        each = seconds_each(work, case.realisations, PILOT_S / len(experiment.cases))
        axes, need, controlled = work.plan.axes, None, None
        study = registry.study(case.study)
        has_controls = experiment.control_variate and (study.own_controls or (study.exact_errors and controls(axes)))
        if precision is not None:
            need = needed(experiment, work, precision, each, of)
            if has_controls and (of == "sigma" or (of == "gain" and study.own_controls)):
                controlled = needed(experiment, work, precision, each, of, controls=True)
        ends = [ending(one, case.realisations) for one in (need, controlled) if one is not None]
        count = min(ends, default=case.realisations)
        taken = [None if one is None else each * one for one in (*ends, None, None)[:2]]
        labels = case.name, ", ".join(axes.filters), len(axes.k)
        cases.append(CaseOutlook(*labels, count, each * count, need, controlled, *taken))
        control |= has_controls
        largest = max(largest, work.size)
        if progress is not None:
            progress(done, len(experiment.cases), 0)
    # Vectors of sums in flight: two a thread, one a level of the tree; beside them the interpreter and its libraries.
    memory = 200 + 8e-6 * largest * (2 * threads + 32)
    seconds = preparing + sum(c.seconds for c in cases) / threads
    warnings = [*registry.study(experiment.study).warnings(experiment)]
    if experiment.control_variate and not control:
        warnings.append(NO_CONTROL)
    return Outlook(tuple(cases), threads, seconds, memory, precision, of, tuple(warnings))


def controls(axes: Axes) -> bool:
    """Whether the baseline's σ is known exactly somewhere where another filter has one too."""
    known = axes.available[axes.baseline] & np.isfinite(np.asarray(axes.exact_sigma, dtype=float)[axes.baseline])
    return bool((np.delete(axes.available, axes.baseline, axis=0) & known).any())


def needed(
    experiment: Experiment, work: CaseWork, percent: float, seconds_each: float, of: str, controls: bool = False
) -> Need:
    """How many realisations a precision takes, by plain intervals or by those with control variates.

    From exact values for σ, where errors are Gaussian with these, else from a pilot. Raises ConfigError where the case
    has no such quantity.
    """
    from radarsim.report import precision

    exact, table = work.plan.gaussian and of == "sigma" and not controls, table_of(experiment, of, controls)
    count = LEAST if exact else min(max(LEAST, int(PILOT_OF_PRECISION_S / seconds_each)), MOST)
    result = result_of(work.case, work, collect(work, count))
    if exact:
        result = precision.gaussian(result)
        axes = result.axes
        exact = bool(np.isfinite(axes.exact_sigma[axes.available]).all())
    n = precision.needed(result, percent, table, of, work.case.realisations)
    cell = precision.worst(result, table, of)
    if cell is None and of != "sigma":
        raise ConfigError(unknown(work.case, of))
    last = tr("no sigma in this case") if cell is None else cell.last()
    return Need(n, tr("exact") if exact else tr("pilot of {count:,}", count=count), last)


def ending(need: Need, most: int) -> int:
    """Realisations at which a run to a precision would end: where it is reached, or at N."""
    from radarsim.report import precision

    return max(n for n in precision.looks(most) if need.realisations is None or n <= need.realisations)


def seconds_each(work: CaseWork, realisations: int, pilot_s: float) -> float:
    """Seconds of one thread for one realisation, from ever more of them, at most a block, in about pilot_s.

    Kernels calculate whole chunks: one realisation may take as long as hundreds, and more are tried while they come for
    nothing, whatever that takes.
    """
    most, count, taken, free = min(work.block, realisations), 1, timed(work, 1), True
    while count < most and (free or LADDER * taken < pilot_s):
        more = min(LADDER * count, most)
        longer = timed(work, more)
        free = longer < FOR_NOTHING * taken
        count, taken = more, longer
    return taken / count


def timed(work: CaseWork, count: int) -> float:
    """Seconds of the processor that `count` realisations take; of short ones the lesser of two."""
    seconds: list[float] = []
    while not seconds or (len(seconds) < 2 and seconds[0] < SHORT_S):
        started = time.thread_time()
        work.simulate(0, count)
        seconds.append(time.thread_time() - started)
    return min(seconds)
