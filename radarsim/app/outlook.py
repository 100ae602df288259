"""The cost of an experiment before it is run: seconds, memory, and the realisations that a precision needs."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np

from radarsim.app import configs
from radarsim.app.ahead import seconds_each
from radarsim.app.case_work import CaseWork
from radarsim.app.configs import Config, Overrides
from radarsim.app.run import case_result, check_precision, merged, table_of, tailed, unknown
from radarsim.app.shown import Shown
from radarsim.config.experiment import Experiment
from radarsim.engine.blocks import Total
from radarsim.engine.machine import available_cores
from radarsim.engine.run import collect
from radarsim.engine.store.inventory import Inventory, take_inventory
from radarsim.engine.store.store import Store
from radarsim.errors import ConfigError
from radarsim.language import few, listed, plural, term, tr
from radarsim.report.quantities import SIGMA, Quantity
from radarsim.report.tables import frame
from radarsim.report.wording import clock
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd

TOTAL = term(
    "{cases}, {realisations}, {seconds} on {threads}, {memory:.0f} MB; figures and tables take some seconds more"
)
PILOT_S = 0.3  # of all cases together, unless single realisations take longer
SURELY_SHORT_S, SURELY_SMALL = 1.0, 1000  # CPU time of all cases, estimates of a case: below these nothing is timed
PILOT_OF_PRECISION_S, LEAST, MOST = 1.0, 256, 16_384  # realisations of the pilot for a precision


@dataclass(frozen=True)
class Need:
    """What a precision takes: realisations (None if unattainable), from `exact` values or a `pilot` of that many, and
    the name of the quantity that reaches it last; below: upper bound of its rate if the pilot had no such event."""

    realisations: int | None
    known_by: str
    last: str
    below: float | None = None


@dataclass(frozen=True)
class CaseOutlook:
    """The cost of a case: labels, counts, seconds of one thread.

    stock: what a results directory already holds; seconds then cover the missing realisations only. timed: whether a
    few realisations were timed; otherwise the seconds are an upper bound, which is short. need: what a precision takes.
    """

    name: str
    filters: str
    scans: int
    realisations: int
    seconds: float
    timed: bool = True
    need: Need | None = None
    stock: Inventory | None = None


@dataclass(frozen=True, repr=False)
class Outlook(Shown):
    """The cost of an experiment, or of a share of it such as (2, 3), on `threads` threads."""

    cases: tuple[CaseOutlook, ...]
    threads: int
    seconds: float
    memory_mb: float
    precision: float | None = None
    of: Quantity = SIGMA
    warnings: tuple[str, ...] = ()
    share: tuple[int, int] | None = None

    @property
    def table(self) -> "pd.DataFrame":
        """A row for each case: filters, scans, realisations, seconds of one thread, stored part, what a precision
        takes."""
        return frame(
            {
                **{"case": [case.name for case in self.cases], "filters": [case.filters for case in self.cases]},
                **{name: [getattr(case, name) for case in self.cases] for name in ("scans", "realisations", "seconds")},
                "stored": [case.stock.stored if case.stock else None for case in self.cases],
                "needed": [case.need.realisations if case.need else None for case in self.cases],
            }
        )

    @property
    def total(self) -> str:
        """Cases, realisations, seconds and memory in total, in words."""
        asked = sum(case.realisations for case in self.cases)
        told = {
            "cases": plural("{count} case", "{count} cases", len(self.cases)),
            "realisations": plural("{count:,} realisation", "{count:,} realisations", asked),
            "threads": plural("{count} thread", "{count} threads", self.threads),
        }
        stored, seconds = sum(case.stock.stored for case in self.cases if case.stock), about(self.seconds)
        if stored:
            told["realisations"] = tr("{stored:,} of {realisations} stored", stored=stored, **told)
            seconds = tr("nothing left to compute") if stored == asked else tr("the rest {seconds}", seconds=seconds)
        return tr(TOTAL, **told, seconds=seconds, memory=self.memory_mb)

    def _said(self) -> tuple[str, ...]:
        return (self.total,)


def about(seconds: float) -> str:
    """A predicted duration, in words."""
    return tr("under a second") if seconds < 1 else tr("about {time}", time=clock(seconds))


def check(
    config: Config,
    *,
    overrides: Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    precision: float | None = None,
    of: str = "sigma",
    share: tuple[int, int] | None = None,
    threads: int | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, int], None] | None = None,
) -> Outlook:
    """Forecast a run: cases, filters, realisations, seconds on one thread, memory in MB.

    The arguments are those of `run`. share: the share of one of several machines, such as (2, 3) for the second of
    three. out: a directory whose stored blocks are not counted. With a precision a case ends when that is reached, or
    at its N. A few realisations are timed after compilation, unless the study knows that all are short; then the
    compiler is not loaded. progress(done, total, 0) is called after each case. Raises ConfigError for a wrong config or
    argument.

    >>> outlook = check("range_doppler", realisations=1e4)
    >>> outlook.table.columns.tolist()[:4]
    ['case', 'filters', 'scans', 'realisations']
    """
    overrides = configs.check(overrides, threads=threads, precision=precision, out=out)
    if share is not None and not (configs.is_pair(share, SupportsIndex) and 1 <= share[0] <= share[1]):
        raise ConfigError(f"share: must be two whole numbers i, n with 1 ≤ i ≤ n, got {share!r}")
    experiment = configs.load(config, merged(overrides, realisations, seed))
    threads = available_cores() if threads is None else max(threads, 1)
    if precision is not None:
        check_precision([experiment], precision, of)
    cases: list[CaseOutlook] = []
    quantity = SIGMA if precision is None else registry.quantity(of, experiment.cases[0])
    largest, preparing = 0, 0.0
    study = registry.study(experiment.study)
    study.prepare(experiment.cases[0])  # imports are not to be timed
    for done, case in enumerate(experiment.cases, 1):
        work, started = CaseWork(case), time.perf_counter()
        axes = work.plan.axes
        preparing += time.perf_counter() - started
        labels = case.name, ", ".join((*axes.filters, *(one.name for one in case.outside))), len(axes.k)
        stocked = partial(take_inventory, work, store=out, part=share or (1, 1))
        short = None if precision is not None else surely_short(work, SURELY_SHORT_S / len(experiment.cases))
        if short is not None:
            held = stocked(case.realisations)
            short *= (held.asked - held.stored) / case.realisations
            cases.append(CaseOutlook(*labels, held.asked, short, timed=False, stock=None if out is None else held))
        else:
            one = measured(work, labels, PILOT_S / len(experiment.cases), stocked, precision, of)
            cases.append(one if out is not None else replace(one, stock=None))
            largest = max(largest, work.size)
        if progress is not None:
            progress(done, len(experiment.cases), 0)
    # Vectors of sums in flight: two for each thread, one for each level of the tree; plus interpreter and libraries.
    memory = 200 + 8e-6 * largest * (2 * threads + 32)
    seconds = preparing + sum(c.seconds for c in cases) / threads
    return Outlook(
        tuple(cases), threads, seconds, memory, precision, quantity, tuple(study.warnings(experiment)), share
    )


def surely_short(work: CaseWork, most_s: float) -> float | None:
    """Upper bound on one thread's seconds for all realisations of a case, where it is surely short and the sums are
    small beside the interpreter; else None."""
    if work.plan.axes.available.size > SURELY_SMALL or work.case.outside:
        return None
    each = registry.study(work.case.study).seconds_at_most(work.plan)
    return None if each is None or each * work.case.realisations > most_s else each * work.case.realisations


def measured(
    work: CaseWork,
    labels: tuple[str, str, int],
    pilot_s: float,
    stocked: Callable[[int], Inventory],
    precision: float | None,
    of: str,
) -> CaseOutlook:
    """The outlook of a case by timing a few realisations; stocked returns what is stored of a number of them."""
    case = work.case
    work.simulate(0, 1)
    each = seconds_each(work, case.realisations, pilot_s)
    need = None if precision is None else needed(work, precision, each, of)
    held = stocked(case.realisations if need is None else ending(need, case.realisations))
    return CaseOutlook(*labels, held.asked, each * (held.asked - held.stored), True, need, held)


def needed(work: CaseWork, percent: float, seconds_each: float, of: str) -> Need:
    """How many realisations a precision takes. From exact σ where errors are Gaussian, else from a pilot. Raises
    ConfigError where the case has no such quantity."""
    from radarsim.report import precision

    quantity = registry.quantity(of, work.case)
    exact, table = work.plan.gaussian and quantity == SIGMA, table_of(work.case, quantity)
    count = LEAST if exact else min(max(LEAST, int(PILOT_OF_PRECISION_S / seconds_each)), MOST)
    result = case_result(work.case, work, collect(work, count))
    if exact:
        result = precision.gaussian(result)
        axes = result.axes
        exact = bool(np.isfinite(axes.exact_sigma[axes.available]).all())
    n = precision.needed(result, percent, table, quantity, work.case.realisations, tailed(work, quantity))
    cell = precision.worst(result, table, quantity)
    if cell is None and quantity != SIGMA:
        raise ConfigError(unknown(work.case, quantity))
    last = tr("no sigma in this case") if cell is None else cell.last()
    below = None if cell is None else cell.below
    return Need(n, tr("exact") if exact else tr("pilot of {count:,}", count=count), last, below)


def ending(need: Need, most: int) -> int:
    """Realisations at which a run to a precision would end: where it is reached, or at N."""
    from radarsim.report import precision

    return max(n for n in precision.looks(most) if need.realisations is None or n <= need.realisations)


def lacking(experiment: Experiment, out: str | os.PathLike[str]) -> str | None:
    """The realisations that a store with gaps lacks, in words; None without gaps, as of cases with nothing stored."""
    found: dict[str, tuple[CaseWork, Inventory]] = {}
    for case in experiment.cases:
        work = CaseWork(case)
        pieces = Store(out, work).pieces()
        if pieces and Total(case.realisations) not in pieces:
            held = take_inventory(work, case.realisations, out)
            if held.loose and held.missing:
                found.setdefault(work.identity, (work, held))
    if not found:
        return None
    (work, held), *others = found.values()
    told: dict[str, Any] = {"config": experiment.stem, "case": work.case.name, "count": len(found)}
    told |= {name: sum(getattr(one, name) for _, one in found.values()) for name in ("asked", "stored")}
    told["missing"] = missing(held)
    words = tr("{config}: {stored:,} of {asked:,} realisations are stored; missing: {missing}", **told)
    return words + (tr(" (of {case}, the first of {count} such cases)", **told) if others else "")


def missing(held: Inventory) -> str:
    """Which realisations a store lacks, and which shares these look like."""
    runs = few([tr("{first:,} to {last:,}", first=first, last=last) for first, last in held.missing], 3)
    if held.shares is None:
        return tr("realisations {runs}", runs=runs)
    numbers, of = held.shares
    share = tr("share {number} of {of}", number=listed([str(number) for number in numbers]), of=of)
    return tr("realisations {runs}; perhaps {share} was not copied", runs=runs, share=share)
