"""The cases of an experiment simulated one after the other, to a number of realisations or to a precision."""

import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.progress import Progress, WeightedProgress
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.collect import collect, compute_share, read_stored
from radarsim.engine.dispatch import CollectedSums, ShareResult
from radarsim.engine.executors import Executor
from radarsim.engine.results import CaseResult
from radarsim.engine.stop_conditions import Stop
from radarsim.engine.store.inventory import take_inventory

if TYPE_CHECKING:
    from radarsim.api.precision_target import PrecisionTarget
    from radarsim.report.precision import WidestInterval


@dataclass
class SimulatedCases:
    """For each case with a finished realisation, in the experiment's order, its work and sums.

    stopped: why not all is done; precision: the target, if any; cells: the widest interval by case name."""

    cases: list[tuple[Case, CaseWork, CollectedSums]] = field(default_factory=list)
    precision: float | None = None
    cells: "dict[str, WidestInterval]" = field(default_factory=dict)
    stopped: str | None = None

    @property
    def done(self) -> dict[str, int]:
        """Finished realisations, by case name."""
        return {case.name: collected.count for case, _, collected in self.cases}

    @property
    def unmet(self) -> list[str]:
        """The targets of time and precision that were not reached, a text for each, with the widest interval of all."""
        reasons = [] if self.stopped is None else [self.stopped]
        if self.precision is None:
            return reasons
        wide = [cell for cell in self.cells.values() if cell.percent >= self.precision]
        cases = f" in {len(wide)} of {len(self.cells)} cases" if len(self.cells) > 1 else ""
        if wide:
            worst = max(wide, key=lambda cell: cell.percent)
            reasons.append(
                f"precision of {self.precision:g} {worst.of.half_width_unit} not reached{cases}; worst: {worst}"
            )
        return reasons


@dataclass(frozen=True)
class Shares:
    """Result of computing share `number` of `of`, by case name; cases of one identity appear once.

    pieces: the blocks of all cases in the share, of which some are missing after an early end."""

    config: str
    number: int
    of: int
    cases: dict[str, ShareResult]
    pieces: int = 0
    missing_pieces: int = 0

    @property
    def unmet(self) -> list[str]:
        """Why the share is incomplete, and how much of it is missing."""
        reasons = [share.stopped for share in self.cases.values() if share.stopped]
        missing = missing_pieces_text((self.number, self.of), self.pieces, self.missing_pieces)
        return [f"{stopped}; {missing}" for stopped in dict.fromkeys(reasons)]

    @property
    def warnings(self) -> list[str]:
        """Damaged and mixed blocks."""
        return list(dict.fromkeys(warning for share in self.cases.values() for warning in share.warnings))


@dataclass(frozen=True)
class RunOptions:
    """How an experiment is computed: no option changes a number.

    out is the results directory, None for none; executor replaces the threads; stop is called between tasks. at_least:
    the realisations of cases, by name, of which all that are stored are used even if fewer are needed."""

    out: str | os.PathLike[str] | None = None
    threads: int | None = None
    stop: Stop | None = None
    executor: Executor | None = None
    at_least: Mapping[str, int] = field(default_factory=dict)


def simulate(
    experiment: Experiment,
    options: RunOptions,
    *,
    progress: Progress | None = None,
    precision: float | None = None,
    quantity_name: str = "sigma",
) -> SimulatedCases:
    """Collect every case in turn, cases of one identity once; progress(done, total, from_store) is over all of them, in
    realisations of mean length.

    precision is in per cent: a case ends at the first look at which every quantity of this name is known to that
    precision, and large errors would have occurred (see report.precision). Raises ConfigError where a case has none.
    """
    collected_by_key: dict[tuple[str, int], tuple[CollectedSums, WidestInterval | None]] = {}
    simulation, works = SimulatedCases(precision=precision), works_by_identity(experiment)
    weighted_progress = WeightedProgress(progress, {key: (work, key[1]) for key, work in works})
    with ExitStack() as stack:
        if precision is not None and options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        for case, (key, work) in zip(experiment.cases, works, strict=True):
            if key not in collected_by_key:
                collector = _collector(work, options, weighted_progress.case_callback(key), collect)
                target = None
                if precision is not None:
                    from radarsim.api.precision_target import precision_target

                    target = precision_target(work, precision, quantity_name)
                collected_by_key[key] = _collect_case(case, work, target, collector, _stored_count(work, case, options))
            collected, cell = collected_by_key[key]
            if collected.count:
                simulation.cases.append((case, work, collected))
            if cell is not None:
                simulation.cells[case.name] = replace(cell, case=case.name)
            if collected.stopped:
                simulation.stopped = collected.stopped
                simulation.cases += _stored_rest(experiment, len(simulation.cases), options)
                break
    return simulation


def _stored_count(work: CaseWork, case: Case, options: RunOptions) -> int:
    """How many realisations of a case there must be at least: those of `at_least`, if they are stored."""
    count = options.at_least.get(case.name, 0)
    return count if count and options.out is not None and not take_inventory(work, count, options.out).missing else 0


def _stored_rest(experiment: Experiment, first: int, options: RunOptions) -> list[tuple[Case, CaseWork, CollectedSums]]:
    """Of the cases from this one on, which a stopped run did not reach, what is stored and must not be lost."""
    stored_results = []
    for case in experiment.cases[first:]:
        work = CaseWork(case)
        if options.out is not None and (count := _stored_count(work, case, options)):
            collected = read_stored(work, count, options.out)
            stored_results += [] if collected is None else [(case, work, collected)]
    return stored_results


def works_by_identity(experiment: Experiment) -> list[tuple[tuple[str, int], CaseWork]]:
    """For each case its identity and number of realisations, and the work of the first case that has both."""
    works_by_key: dict[tuple[str, int], CaseWork] = {}
    works = [CaseWork(case) for case in experiment.cases]
    keys = [(work.identity, work.case.realisations) for work in works]
    return [(key, works_by_key.setdefault(key, work)) for key, work in zip(keys, works, strict=True)]


def _collector(
    work: CaseWork, options: RunOptions, progress: Progress, collect_function: Callable[..., Any]
) -> Callable[..., Any]:
    """The engine's `collect` or `compute_share` for a case, as a function of the number of realisations."""
    engine_options = {"threads": options.threads, "stop": options.stop, "executor": options.executor}
    return partial(collect_function, work, store=options.out, progress=progress, **engine_options)


def _collect_case(
    case: Case,
    work: CaseWork,
    target: "PrecisionTarget | None",
    collector: Callable[[int], CollectedSums],
    at_least: int = 0,
) -> "tuple[CollectedSums, WidestInterval | None]":
    """The sums of a case, and the cell of its widest interval where a precision is set. at_least: realisations that are
    stored, and used in any case."""
    if target is not None:
        from radarsim.api.run_to_precision import collect_to_precision

        return collect_to_precision(case, work, target, collector, at_least)
    collected = collector(case.realisations)
    if collected.count < at_least:
        collected = replace(collector(at_least), stopped=collected.stopped)
    return collected, None


Works = Mapping[tuple[str, int], CaseWork]  # by identity and realisations, see `works_by_identity`


def compute_shares(
    stem: str, works: Works, share: tuple[int, int], options: RunOptions, *, progress: Progress | None = None
) -> Shares:
    """Compute a share of every work of a config, such as (2, 3) for the second of three, into the store under
    options.out.

    Ends early on `options.stop`."""
    assert options.out is not None  # a share is only what it stores
    weighted_progress = WeightedProgress(progress, {key: (work, -(-key[1] // share[1])) for key, work in works.items()})
    shares: dict[str, ShareResult] = {}
    for key, work in works.items():
        share_result = _collector(work, options, weighted_progress.case_callback(key), compute_share)(key[1], share)
        shares[work.case.name] = share_result
        if share_result.stopped:
            break
    return Shares(stem, *share, shares, *_counted_pieces(works, share, options.out))


def missing_pieces(works: Works, share: tuple[int, int], out: str | os.PathLike[str]) -> str:
    """How much of a share of works is missing from a store, as a phrase."""
    return missing_pieces_text(share, *_counted_pieces(works, share, out))


def missing_pieces_text(share: tuple[int, int], pieces: int, missing: int) -> str:
    """How many pieces of a share are missing, as a phrase."""
    return f"share {share[0]} of {share[1]}: {missing} of {pieces} pieces missing"


def _counted_pieces(works: Works, share: tuple[int, int], out: str | os.PathLike[str]) -> tuple[int, int]:
    """The pieces of a share of works, and how many of them a store lacks."""
    inventories = [take_inventory(work, realisations, out, share) for (_, realisations), work in works.items()]
    return sum(stock.blocks for stock in inventories), sum(stock.missing_blocks for stock in inventories)


def collected_results(simulated: SimulatedCases) -> list[CaseResult]:
    """The result of each simulated case."""
    return [case_result(case, work, collected) for case, work, collected in simulated.cases]
