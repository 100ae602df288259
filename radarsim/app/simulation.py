"""The cases of an experiment collected one after the other, to a number of realisations or to a precision."""

import os
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace

from radarsim.app.work import CaseWork
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.collect import collect, share
from radarsim.engine.results import CaseResult
from radarsim.engine.run import Collected, Shared
from radarsim.errors import ConfigError
from radarsim.studies.registry import study

Progress = Callable[[int, int, int], None]
NO_CONTROL = "control_variate: no filter beside a baseline whose sigma is known exactly: no controlled.csv"


@dataclass
class Gathered:
    """What simulating gave: of each case that has a realisation done, in the experiment's order, its work and sums.

    stopped is why not all is done; precision is what was asked for, cells are the widest σ of each case looked at.
    """

    cases: list[tuple[Case, CaseWork, Collected]] = field(default_factory=list)
    precision: float | None = None
    cells: dict = field(default_factory=dict)
    stopped: str | None = None

    @property
    def done(self) -> dict[str, int]:
        """Realisations done, by the name of the case."""
        return {case.name: collected.count for case, _, collected in self.cases}

    @property
    def unmet(self) -> list[str]:
        """What of time and precision was not reached, in words, with the widest σ of all."""
        wide = [cell for cell in self.cells.values() if cell.percent >= self.precision]
        cases = f" in {len(wide)} of {len(self.cells)} cases" if len(self.cells) > 1 else ""
        told = [] if self.stopped is None else [self.stopped]
        if wide:
            worst = max(wide, key=lambda cell: cell.percent)
            told.append(f"precision of {self.precision:g} % not reached{cases}; worst: {worst}")
        return told


@dataclass(frozen=True)
class Shares:
    """What computing share `number` of `of` came to, by the name of the case; cases of one identity stand once."""

    config: str
    number: int
    of: int
    cases: dict[str, Shared]

    @property
    def unmet(self) -> list[str]:
        """Why not all of it is done, in words."""
        return list(dict.fromkeys(one.stopped for one in self.cases.values() if one.stopped))

    @property
    def warnings(self) -> list[str]:
        """Damage and mixtures that were met."""
        return list(dict.fromkeys(warning for one in self.cases.values() for warning in one.warnings))


@dataclass(frozen=True)
class Means:
    """How an experiment is computed: nothing of it changes a number.

    out is the results directory, None for none; executor, where given, stands in for threads; stop is asked between
    tasks.
    """

    out: str | os.PathLike | None = None
    threads: int | None = None
    stop: Callable[[], str | None] | None = None
    executor: object = None

    def options(self) -> dict:
        """As the engine takes them."""
        return {"store": self.out, "threads": self.threads, "stop": self.stop, "executor": self.executor}


def simulated(
    experiment: Experiment, means: Means, *, progress: Progress | None = None, precision: float | None = None
) -> Gathered:
    """Collect every case in turn, cases of one identity once; progress(done, total, from_store) is over all of them.

    precision is in per cent: a case ends at the first look (report.precision) at which every σ is known so well.
    """
    total = sum(case.realisations for case in experiment.cases)
    made: dict[tuple[str, int], tuple] = {}
    gathered, done, held = Gathered(precision=precision), 0, 0

    def over_all(case_done: int, _: int, case_held: int) -> None:
        if progress is not None:
            progress(done + case_done, total, held + case_held)

    with ExitStack() as stack:
        if precision is not None and means.out is None:
            means = replace(means, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        for case in experiment.cases:
            work = CaseWork(case)
            key = (work.identity, case.realisations)
            if key not in made:
                options = means.options() | {"progress": over_all}
                made[key] = work, *_collected(case, work, precision, options)
            work, collected, cell = made[key]
            if collected.count:
                gathered.cases.append((case, work, collected))
            if cell is not None:
                gathered.cells[case.name] = replace(cell, case=case.name)
            done += collected.count
            held += collected.from_store
            if collected.stopped:
                gathered.stopped = collected.stopped
                break
    return gathered


def _collected(case: Case, work: CaseWork, precision: float | None, options: dict):
    """The sums of a case, and the cell of its widest σ where a precision is asked for."""
    if precision is None:
        return collect(work, case.realisations, **options), None
    from radarsim.report.precision import looks, worst

    looked, best, cell = [], None, None
    for n in looks(case.realisations):
        looked.append(collect(work, n, **options))
        # Stopped on the way to a look, a run may hold less without a gap than at the look before.
        if best is None or looked[-1].count > best.count:
            best = looked[-1]
            cell = worst(result_of(case, work, best), study(case.study).curves) if best.count else None
        if looked[-1].stopped or cell is None or cell.percent < precision:
            break
    computed = sum(one.computed for one in looked)
    facts = {
        "asked": case.realisations,
        "computed": computed,
        "from_store": max(0, best.count - computed),
        "kernel_seconds": sum(one.kernel_seconds for one in looked),
        "seconds": sum(one.seconds for one in looked),
        "stopped": looked[-1].stopped,
        "warnings": tuple(dict.fromkeys(warning for one in looked for warning in one.warnings)),
    }
    return replace(best, **facts), cell


def check_precision(experiments: Sequence[Experiment], percent: float) -> None:
    """ConfigError for a precision that is none, and for every case of too few realisations ever to be looked at."""
    from radarsim.report.precision import FIRST

    if not 0 < percent <= 100:
        raise ConfigError(f"precision: must be > 0 and ≤ 100 %, got {percent:g}")
    faults = [
        f"{experiment.path or experiment.stem}: realisations: must be at least {FIRST} for a precision ({FIRST}, "
        f"{2 * FIRST}, {4 * FIRST}, … are looked at), got {case.realisations} in {case.name}"
        for experiment in experiments
        for case in experiment.cases
        if case.realisations < FIRST
    ]
    if faults:
        raise ConfigError(*faults)


def shared(experiment: Experiment, number: int, of: int, means: Means, *, progress: Progress | None = None) -> Shares:
    """Put share `number` of `of` of every case into the store under means.out; ends early where it is stopped."""
    total = sum(case.realisations for case in experiment.cases) // of
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
        one = share(work, case.realisations, number, of, **means.options() | {"progress": over_all})
        made.add(key)
        shares[case.name] = one
        done += one.done
        held += one.from_store
        if one.stopped:
            break
    return Shares(experiment.stem, number, of, shares)


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
