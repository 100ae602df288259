"""The cases of an experiment collected one after the other, to a number of realisations or to a precision."""

import os
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.app.work import CaseWork
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.collect import collect, share
from radarsim.engine.executors import Executor
from radarsim.engine.results import CaseResult
from radarsim.engine.run import Collected, Shared
from radarsim.engine.stopping import Stop
from radarsim.errors import ConfigError
from radarsim.studies.registry import study

if TYPE_CHECKING:
    from radarsim.report.precision import Cell, Table

Progress = Callable[[int, int, int], None]


@dataclass
class SimulatedCases:
    """Of each case that has a realisation done, in the experiment's order, its work and sums.

    stopped is why not all is done; precision is what was asked for, cells hold the widest interval of each case that
    was looked at.
    """

    cases: list[tuple[Case, CaseWork, Collected]] = field(default_factory=list)
    precision: float | None = None
    cells: "dict[str, Cell]" = field(default_factory=dict)
    stopped: str | None = None

    @property
    def done(self) -> dict[str, int]:
        """Realisations done, by the name of the case."""
        return {case.name: collected.count for case, _, collected in self.cases}

    @property
    def unmet(self) -> list[str]:
        """The targets of time and precision that were not reached, a text each, with the widest interval of all."""
        reasons = [] if self.stopped is None else [self.stopped]
        if self.precision is None:
            return reasons
        from radarsim.report.precision import OF

        wide = [cell for cell in self.cells.values() if cell.percent >= self.precision]
        cases = f" in {len(wide)} of {len(self.cells)} cases" if len(self.cells) > 1 else ""
        if wide:
            worst = max(wide, key=lambda cell: cell.percent)
            unit = "%" if OF[worst.of].relative else "points"
            reasons.append(f"precision of {self.precision:g} {unit} not reached{cases}; worst: {worst}")
        return reasons


@dataclass(frozen=True)
class Shares:
    """What computing share `number` of `of` came to, by the name of the case; cases of one identity stand once."""

    config: str
    number: int
    of: int
    cases: dict[str, Shared]

    @property
    def unmet(self) -> list[str]:
        """Why not all of it is done."""
        return list(dict.fromkeys(one.stopped for one in self.cases.values() if one.stopped))

    @property
    def warnings(self) -> list[str]:
        """Damage and mixtures that were met."""
        return list(dict.fromkeys(warning for one in self.cases.values() for warning in one.warnings))


@dataclass(frozen=True)
class RunOptions:
    """How an experiment is computed: no option changes a number.

    out is the results directory, None for none; executor, where given, replaces the threads; stop is called between
    tasks.
    """

    out: str | os.PathLike[str] | None = None
    threads: int | None = None
    stop: Stop | None = None
    executor: Executor | None = None


def simulated(
    experiment: Experiment,
    options: RunOptions,
    *,
    progress: Progress | None = None,
    precision: float | None = None,
    of: str = "sigma",
) -> SimulatedCases:
    """Collect every case in turn, cases of one identity once; progress(done, total, from_store) is over all of them.

    precision is in per cent: a case ends at the first look at which every quantity `of` that kind is known so well, and
    large errors would have been seen (all report.precision). Raises ConfigError where a case has none of that kind.
    """
    total = sum(case.realisations for case in experiment.cases)
    made: dict[tuple[str, int], tuple[CaseWork, Collected, Cell | None]] = {}
    simulation, done, held = SimulatedCases(precision=precision), 0, 0

    def over_all(case_done: int, _: int, case_held: int) -> None:
        if progress is not None:
            progress(done + case_done, total, held + case_held)

    with ExitStack() as stack:
        if precision is not None and options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        for case in experiment.cases:
            work = CaseWork(case)
            key = (work.identity, case.realisations)
            if key not in made:
                collector = _collector(work, options, over_all, collect)
                wanted = None
                if precision is not None:
                    wanted = Wanted(precision, of, table_of(experiment, of), tailed(work, of))
                made[key] = work, *_collected(case, work, wanted, collector)
            work, collected, cell = made[key]
            if collected.count:
                simulation.cases.append((case, work, collected))
            if cell is not None:
                simulation.cells[case.name] = replace(cell, case=case.name)
            done += collected.count
            held += collected.from_store
            if collected.stopped:
                simulation.stopped = collected.stopped
                break
    return simulation


def _collector(work: CaseWork, options: RunOptions, progress: Progress, of: Callable[..., Any]) -> Callable[..., Any]:
    """The engine's `collect` or `share`, by `of`, for a work, as a function of the number of realisations."""
    means = {"threads": options.threads, "stop": options.stop, "executor": options.executor}
    return partial(of, work, store=options.out, progress=progress, **means)


class Wanted(NamedTuple):
    """A precision in per cent, of which kind of quantity, the table that holds it, and that of curves if `tailed`."""

    percent: float
    of: str
    table: "Table"
    curves: "Table | None"


def tailed(work: CaseWork, of: str) -> "Table | None":
    """The table of a case's curves where rare large errors may decide a kind of quantity; None where they do not."""
    from radarsim.report.precision import OF

    return study(work.case.study).curves if OF[of].squares and not work.plan.gaussian else None


def table_of(experiment: Experiment, of: str) -> "Table":
    """The table of a study that holds a kind of quantity, from results; empty where the study makes none."""
    from radarsim.report import tables
    from radarsim.report.precision import OF

    own = study(experiment.study)
    if of not in ("sigma", "gain"):
        return lambda results: own.tables(results).get(OF[of].table, tables.frame({}))
    return own.gains if of == "gain" else own.curves


def _collected(
    case: Case, work: CaseWork, wanted: Wanted | None, collector: Callable[[int], Collected]
) -> "tuple[Collected, Cell | None]":
    """The sums of a case, and the cell of its widest interval where a precision is asked for."""
    if wanted is None:
        return collector(case.realisations), None
    from radarsim.report.precision import FIRST, FLOOR, least, looks, worst

    looked: list[Collected] = []
    best, cell = None, None
    for n in looks(case.realisations, FLOOR if wanted.curves else FIRST):
        looked.append(collector(n))
        # Stopped on the way to a look, a run may hold less without a gap than at the look before.
        if best is None or looked[-1].count > best.count:
            best = looked[-1]
            cell = worst(result_of(case, work, best), wanted.table, wanted.of) if best.count else None
            if cell is None and best.count and wanted.of != "sigma":
                raise ConfigError(unknown(case, wanted.of))
        if looked[-1].stopped or cell is None:
            break
        if cell.percent < wanted.percent and n >= least(result_of(case, work, best), wanted.curves):
            break
    assert best is not None  # there is a look at every number of realisations that check_precision lets pass
    computed = sum(one.computed for one in looked)
    whole = replace(
        best,
        asked=case.realisations,
        computed=computed,
        from_store=max(0, best.count - computed),
        kernel_seconds=sum(one.kernel_seconds for one in looked),
        seconds=sum(one.seconds for one in looked),
        stopped=looked[-1].stopped,
        warnings=tuple(dict.fromkeys(warning for one in looked for warning in one.warnings)),
    )
    return whole, cell


def unknown(case: Case, of: str) -> str:
    """The line for a case that has no quantity of a kind."""
    from radarsim.report.precision import OF

    return f"{case.name}: of: must be what the case has, got {of}: no {OF[of].words} in {OF[of].table}.csv"


def check_precision(experiments: Sequence[Experiment], percent: float, of: str = "sigma") -> None:
    """ConfigError for an invalid precision, and for every case of too few realisations ever to be looked at."""
    from radarsim.report.precision import FIRST, OF

    if of not in OF:
        raise ConfigError(f"of: must be one of {', '.join(OF)}, got {of!r}")

    if not 0 < percent <= 100:
        raise ConfigError(f"precision: must be > 0 and ≤ 100 %, got {percent:g}")
    faults = [
        f"{experiment.path or experiment.stem}: realisations: must be at least {FIRST} for a precision ({FIRST}, "
        f"{2 * FIRST}, {4 * FIRST}, … and the last are looked at), got {case.realisations} in {case.name}"
        for experiment in experiments
        for case in experiment.cases
        if case.realisations < FIRST
    ]
    if faults:
        raise ConfigError(*faults)


def shared(
    experiment: Experiment, part: tuple[int, int], options: RunOptions, *, progress: Progress | None = None
) -> Shares:
    """Put a part of every case, as (2, 3) the second of three, into the store under options.out.

    It ends early where it is stopped.
    """
    assert options.out is not None  # a share is nothing but what it stores
    total = sum(case.realisations for case in experiment.cases) // part[1]
    made: set[tuple[str, int]] = set()
    shares: dict[str, Shared] = {}
    done = held = 0

    def over_all(case_done: int, _: int, case_held: int) -> None:
        if progress is not None:
            progress(done + case_done, max(total, done + case_done), held + case_held)

    for case in experiment.cases:
        work = CaseWork(case)
        if (key := (work.identity, case.realisations)) in made:
            continue
        one = _collector(work, options, over_all, share)(case.realisations, part)
        made.add(key)
        shares[case.name] = one
        done += one.done
        held += one.from_store
        if one.stopped:
            break
    return Shares(experiment.stem, *part, shares)


def result_of(case: Case, work: CaseWork, collected: Collected) -> CaseResult:
    """A case with its sums and the labels that say what these are; display names are the case's own."""
    plan = work.plan
    # Cases that differ in display names alone share their work.
    axes = plan.axes if work.case == case else study(case.study).relabelled(plan.axes, case)
    values = collected.values.view()
    values.flags.writeable = False  # tables and figures are made of them when they are asked for
    sums = plan.layout.unpack(values)
    seconds = collected.kernel_seconds
    return CaseResult(case.name, case.study, case.spec, case.swept, collected.count, sums, axes, seconds)
