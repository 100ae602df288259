"""The cost of an experiment before it is run: seconds, memory, and the realisations that a precision needs."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, SupportsIndex

import numpy as np

from radarsim.api import arguments, configs
from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import Config, Overrides
from radarsim.api.display import Displayable
from radarsim.api.load_experiments import combine_overrides
from radarsim.api.precision_target import (
    asked_phrase,
    asked_table,
    check_precision,
    heavy_tailed_table,
    unknown_quantity,
    with_long_run,
)
from radarsim.api.progress import seconds_each
from radarsim.engine.collect import collect
from radarsim.engine.machine import available_cores
from radarsim.engine.store.inventory import Inventory, take_inventory
from radarsim.errors import ConfigError
from radarsim.language.translate import plural, term, tr
from radarsim.report.output_labels import clock
from radarsim.report.quantities import SIGMA, Quantity
from radarsim.report.tables import frame
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


TOTAL = term(
    "{cases}, {realisations}, {seconds} on {threads}, {memory:.0f} MB; figures and tables take some seconds more"
)
PILOT_S = 0.3  # of all cases together, unless single realisations take longer
MAX_UNTIMED_S, MAX_UNTIMED_ESTIMATES = (
    1.0,
    1000,
)  # CPU time of all cases, estimates of a case: below both nothing is timed
PRECISION_PILOT_S, MIN_PILOT_REALISATIONS, MAX_PILOT_REALISATIONS = (
    1.0,
    256,
    16_384,
)  # realisations of the pilot for a precision


@dataclass(frozen=True)
class RequiredRealisations:
    """What a precision takes: realisations (None if unattainable), from `exact` values or a `pilot` of that many, and
    the name of the quantity that reaches it last; below: upper bound of its rate if the pilot had no such event."""

    realisations: int | None
    known_by: str
    last: str
    below: float | None = None


@dataclass(frozen=True)
class CaseCost:
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
    need: RequiredRealisations | None = None
    stock: Inventory | None = None


@dataclass(frozen=True, repr=False)
class CostEstimate(Displayable):
    """The cost of an experiment, or of a share of it such as (2, 3), on `threads` threads."""

    cases: tuple[CaseCost, ...]
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
        realisations = sum(case.realisations for case in self.cases)
        counts = {
            "cases": plural("{count} case", "{count} cases", len(self.cases)),
            "realisations": plural("{count:,} realisation", "{count:,} realisations", realisations),
            "threads": plural("{count} thread", "{count} threads", self.threads),
        }
        stored, seconds = sum(case.stock.stored for case in self.cases if case.stock), rough_time(self.seconds)
        if stored:
            counts["realisations"] = tr("{stored:,} of {realisations} stored", stored=stored, **counts)
            is_complete = stored == realisations
            seconds = tr("nothing left to compute") if is_complete else tr("the rest {seconds}", seconds=seconds)
        return tr(TOTAL, **counts, seconds=seconds, memory=self.memory_mb)

    def _answer_lines(self) -> tuple[str, ...]:
        return (self.total,)


def rough_time(seconds: float) -> str:
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
) -> CostEstimate:
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
    overrides = arguments.check_arguments(overrides, threads=threads, precision=precision, out=out)
    if share is not None and not (arguments.is_pair(share, SupportsIndex) and 1 <= share[0] <= share[1]):
        raise ConfigError(f"share: must be two whole numbers i, n with 1 ≤ i ≤ n, got {share!r}")
    experiment = configs.load(config, combine_overrides(overrides, realisations, seed))
    threads = available_cores() if threads is None else max(threads, 1)
    if precision is not None:
        check_precision([experiment], precision, of)
        (experiment,), of = with_long_run([experiment], of)
    cases: list[CaseCost] = []
    quantity = SIGMA if precision is None else registry.quantity(asked_phrase(of).name, experiment.cases[0])
    largest_size, preparation_s = 0, 0.0
    study = registry.study(experiment.study)
    study.prepare(experiment.cases[0])  # imports are not to be timed
    for done, case in enumerate(experiment.cases, 1):
        work, started = CaseWork(case), time.perf_counter()
        axes = work.plan.axes
        preparation_s += time.perf_counter() - started
        labels = (
            case.name,
            ", ".join((*axes.filters, *(user_filter.name for user_filter in case.user_filters))),
            len(axes.k),
        )
        stored_inventory = partial(take_inventory, work, store=out, part=share or (1, 1))
        case_cost = None
        if precision is None:
            case_cost = _untimed_cost(work, labels, MAX_UNTIMED_S / len(experiment.cases), stored_inventory)
        if case_cost is None:
            case_cost = measure_cost(work, labels, PILOT_S / len(experiment.cases), stored_inventory, precision, of)
            largest_size = max(largest_size, work.size)
        cases.append(case_cost if out is not None else replace(case_cost, stock=None))
        if progress is not None:
            progress(done, len(experiment.cases), 0)
    # Vectors of sums in flight: two for each thread, one for each level of the tree; plus interpreter and libraries.
    memory = 200 + 8e-6 * largest_size * (2 * threads + 32)
    seconds = preparation_s + sum(c.seconds for c in cases) / threads
    return CostEstimate(
        tuple(cases), threads, seconds, memory, precision, quantity, tuple(study.warnings(experiment)), share
    )


def _untimed_cost(
    work: CaseWork, labels: tuple[str, str, int], max_s: float, stored_inventory: Callable[[int], Inventory]
) -> CaseCost | None:
    """The cost of a case that is surely short, from the study's upper bound; else None."""
    seconds = short_case_seconds(work, max_s)
    if seconds is None:
        return None
    stock = stored_inventory(work.case.realisations)
    seconds *= (stock.requested - stock.stored) / work.case.realisations
    return CaseCost(*labels, stock.requested, seconds, timed=False, stock=stock)


def short_case_seconds(work: CaseWork, max_s: float) -> float | None:
    """Upper bound on one thread's seconds for all realisations of a case that is surely short, with sums that are small
    beside the interpreter; else None."""
    if work.plan.axes.available.size > MAX_UNTIMED_ESTIMATES or work.case.user_filters:
        return None
    realisation_s = registry.study(work.case.study).seconds_at_most(work.plan)
    if realisation_s is None or realisation_s * work.case.realisations > max_s:
        return None
    return realisation_s * work.case.realisations


def measure_cost(
    work: CaseWork,
    labels: tuple[str, str, int],
    pilot_s: float,
    stored_inventory: Callable[[int], Inventory],
    precision: float | None,
    quantity_name: str,
) -> CaseCost:
    """The cost of a case from a few timed realisations; stored_inventory says how many of a number are stored."""
    case = work.case
    work.simulate(0, 1)
    realisation_s = seconds_each(work, case.realisations, pilot_s)
    need = None if precision is None else required_realisations(work, precision, realisation_s, quantity_name)
    stock = stored_inventory(case.realisations if need is None else last_look_count(need, case.realisations))
    return CaseCost(*labels, stock.requested, realisation_s * (stock.requested - stock.stored), True, need, stock)


def required_realisations(
    work: CaseWork, percent: float, seconds_each: float, quantity_name: str
) -> RequiredRealisations:
    """The number of realisations that a precision takes: from exact σ where errors are Gaussian, else from a pilot.

    Raises ConfigError where the case has no such quantity."""
    from radarsim.report import precision

    quantity = registry.quantity(asked_phrase(quantity_name).name, work.case)
    exact, table = work.plan.gaussian and quantity == SIGMA, asked_table(work.case, quantity_name)
    count = (
        MIN_PILOT_REALISATIONS
        if exact
        else min(max(MIN_PILOT_REALISATIONS, int(PRECISION_PILOT_S / seconds_each)), MAX_PILOT_REALISATIONS)
    )
    result = case_result(work.case, work, collect(work, count))
    if exact:
        result = precision.with_gaussian_sums(result)
        axes = result.axes
        exact = bool(np.isfinite(axes.exact_sigma[axes.available]).all())
    n = precision.needed_realisations(
        result, percent, table, quantity, work.case.realisations, heavy_tailed_table(work, quantity)
    )
    cell = precision.widest_cell(result, table, quantity)
    if cell is None and quantity != SIGMA:
        raise ConfigError(unknown_quantity(work.case, quantity))
    last_reached = tr("no sigma in this case") if cell is None else cell.last()
    below = None if cell is None else cell.below
    return RequiredRealisations(n, tr("exact") if exact else tr("pilot of {count:,}", count=count), last_reached, below)


def last_look_count(need: RequiredRealisations, max_realisations: int) -> int:
    """Realisations at which a run to a precision would end: where it is reached, or at N."""
    from radarsim.report import precision

    return max(
        n for n in precision.look_counts(max_realisations) if need.realisations is None or n <= need.realisations
    )
