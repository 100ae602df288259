"""One experiment from config to written results, for the command and Python: its cases are collected one after the
other, to a number of realisations or to a precision.

The time that tables, figures and report of an experiment take, measured on a few of its realisations."""

import json
import math
import os
import sys
import tempfile
import time
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.app import configs
from radarsim.app.ahead import Progress, Weighed
from radarsim.app.case_work import CaseWork
from radarsim.app.configs import Config, Overrides, command, load, repeated
from radarsim.config.experiment import Case, Experiment
from radarsim.config.load import texts
from radarsim.engine import run as stopping
from radarsim.engine.machine import available_cores
from radarsim.engine.results import CaseResult
from radarsim.engine.run import Collected, Executor, Shared, Signals, Stop, collect, share, stored
from radarsim.engine.store.inventory import Inventory, take_inventory
from radarsim.engine.store.store import Store
from radarsim.errors import ConfigError, StoreError, TargetUnmet
from radarsim.extensions import StopRule, stop_rule
from radarsim.language import few, tr
from radarsim.report import files
from radarsim.report.quantities import GAIN, SIGMA, Quantity
from radarsim.studies import registry
from radarsim.studies.registry import study
from radarsim.threads import limited

if TYPE_CHECKING:
    from radarsim.app.result import Result
    from radarsim.report.precision import Cell, Table


# ---- simulation ------------------------------------------------------------------------------------------------------
@dataclass
class SimulatedCases:
    """For each case with a finished realisation, in the experiment's order, its work and sums.

    stopped: why not all is done; precision: the target, if any; cells: the widest interval of each case looked at."""

    cases: list[tuple[Case, CaseWork, Collected]] = field(default_factory=list)
    precision: float | None = None
    cells: "dict[str, Cell]" = field(default_factory=dict)
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
    """Result of computing share `number` of `of`, by case name; cases of one identity appear once."""

    config: str
    number: int
    of: int
    cases: dict[str, Shared]

    @property
    def unmet(self) -> list[str]:
        """Why the share is incomplete."""
        return list(dict.fromkeys(one.stopped for one in self.cases.values() if one.stopped))

    @property
    def warnings(self) -> list[str]:
        """Damaged and mixed blocks."""
        return list(dict.fromkeys(warning for one in self.cases.values() for warning in one.warnings))


@dataclass(frozen=True)
class RunOptions:
    """How an experiment is computed: no option changes a number.

    out is the results directory, None for none; executor replaces the threads; stop is called between tasks."""

    out: str | os.PathLike[str] | None = None
    threads: int | None = None
    stop: Stop | None = None
    executor: Executor | None = None


def simulate(
    experiment: Experiment,
    options: RunOptions,
    *,
    progress: Progress | None = None,
    precision: float | None = None,
    of: str = "sigma",
) -> SimulatedCases:
    """Collect every case in turn, cases of one identity once; progress(done, total, from_store) is over all of them, in
    realisations of mean length.

    precision is in per cent: a case ends at the first look at which every quantity `of` that kind is known to that
    precision, and large errors would have been seen (all report.precision). Raises ConfigError where a case has none.
    """
    made: dict[tuple[str, int], tuple[Collected, Cell | None]] = {}
    simulation, works = SimulatedCases(precision=precision), keyed(experiment)
    weighed = Weighed(progress, {key: (work, key[1]) for key, work in works})
    with ExitStack() as stack:
        if precision is not None and options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        for case, (key, work) in zip(experiment.cases, works, strict=True):
            if key not in made:
                collector = _collector(work, options, weighed.of(key), collect)
                wanted = None
                if precision is not None:
                    quantity = registry.quantity(of, case)
                    wanted = Wanted(precision, quantity, table_of(case, quantity), tailed(work, quantity))
                made[key] = _collected(case, work, wanted, collector)
            collected, cell = made[key]
            if collected.count:
                simulation.cases.append((case, work, collected))
            if cell is not None:
                simulation.cells[case.name] = replace(cell, case=case.name)
            if collected.stopped:
                simulation.stopped = collected.stopped
                break
    return simulation


def keyed(experiment: Experiment) -> list[tuple[tuple[str, int], CaseWork]]:
    """For each case its identity and number of realisations, and the work of the first case that has both."""
    found: dict[tuple[str, int], CaseWork] = {}
    works = [CaseWork(case) for case in experiment.cases]
    keys = [(work.identity, work.case.realisations) for work in works]
    return [(key, found.setdefault(key, work)) for key, work in zip(keys, works, strict=True)]


def _collector(work: CaseWork, options: RunOptions, progress: Progress, of: Callable[..., Any]) -> Callable[..., Any]:
    """The engine's `collect`, or `share` if `of` is given, for a work, as a function of the number of realisations."""
    means = {"threads": options.threads, "stop": options.stop, "executor": options.executor}
    return partial(of, work, store=options.out, progress=progress, **means)


class Wanted(NamedTuple):
    """A precision in per cent, its quantity, the table that holds it, and that of curves if `tailed`."""

    percent: float
    of: Quantity
    table: "Table"
    curves: "Table | None"


def tailed(work: CaseWork, of: Quantity) -> "Table | None":
    """The table of a case's curves where rare large errors may decide a quantity; None where they do not."""
    if not of.squares or (work.plan.gaussian and not work.case.outside):
        return None
    return _with_outside(work.case, "curves", study(work.case.study).curves)


def _with_outside(case: Case, name: str, table: "Table") -> "Table":
    """A table of a study with the rows of filters from outside, where a case has such."""
    if not case.outside:
        return table
    from radarsim.report import outside

    return outside.beside(name, table)


def table_of(case: Case, of: Quantity) -> "Table":
    """The table of a case's study that holds a quantity, from results; empty where it makes none."""
    from radarsim.report import tables

    own = study(case.study)
    if of == GAIN:
        from radarsim.app.result import gains_of

        return _with_outside(case, of.table, gains_of(own))

    def table(results: Sequence[CaseResult]) -> Any:
        return tables.frame({}) if (made := own.table(of.table, results, of.value)) is None else made

    return _with_outside(case, of.table, table)


def _collected(
    case: Case, work: CaseWork, wanted: Wanted | None, collector: Callable[[int], Collected]
) -> "tuple[Collected, Cell | None]":
    """The sums of a case, and the cell of its widest interval where a precision is set."""
    if wanted is None:
        return collector(case.realisations), None
    from radarsim.report.precision import FIRST, FLOOR, least, looks, worst

    looked: list[Collected] = []
    best, cell = None, None
    for n in looks(case.realisations, FLOOR if wanted.curves else FIRST):
        looked.append(collector(n))
        # A run stopped before a look may hold fewer without a gap than at the look before.
        if best is None or looked[-1].count > best.count:
            best = looked[-1]
            cell = worst(case_result(case, work, best), wanted.table, wanted.of) if best.count else None
            if cell is None and best.count and wanted.of != SIGMA:
                raise ConfigError(unknown(case, wanted.of))
        if looked[-1].stopped or cell is None:
            break
        if cell.percent < wanted.percent and n >= least(case_result(case, work, best), wanted.curves):
            break
    assert best is not None  # there is a look at every number of realisations that check_precision accepts
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


def unknown(case: Case, of: Quantity) -> str:
    """The line for a case that has no row of a quantity."""
    return f"{case.name}: of: must be what the case has, got {of.name}: no {of.words}"


def check_precision(experiments: Sequence[Experiment], percent: float, of: str = "sigma") -> None:
    """ConfigError for an invalid precision, an unmeasured quantity, or too few realisations for a look."""
    from radarsim.report.precision import FIRST

    for case in (case for experiment in experiments for case in experiment.cases):
        registry.quantity(of, case)
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
    """Put a share of every case, as (2, 3) the second of three, into the store under options.out. Stops early on
    `stop`."""
    assert options.out is not None  # a share is only what it stores
    works = dict(keyed(experiment))
    weighed = Weighed(progress, {key: (work, -(-key[1] // part[1])) for key, work in works.items()})
    shares: dict[str, Shared] = {}
    for key, work in works.items():
        one = _collector(work, options, weighed.of(key), share)(key[1], part)
        shares[work.case.name] = one
        if one.stopped:
            break
    return Shares(experiment.stem, *part, shares)


def case_result(case: Case, work: CaseWork, collected: Collected) -> CaseResult:
    """A case with its sums and their labels; display names are the case's own."""
    values = collected.values.view()
    values.flags.writeable = False  # tables and figures are made of them on demand
    count, seconds, found = collected.count, collected.kernel_seconds, []
    unpacked = list(work.unpacked(values))
    for plan, of, sums in zip(work.plans, (case, *case.companions), unpacked, strict=False):
        # Cases that differ in display names alone share their work.
        axes = plan.axes if work.case == case else study(case.study).relabelled(plan.axes, of)
        found.append(CaseResult(of.name, of.study, of.spec, of.swept, count, sums, axes, seconds))
    whole = replace(found[0], against=tuple(found[1:]))
    if not case.outside:
        return whole
    from radarsim.studies import outside

    beside: Any = work.plans[-1]
    return replace(whole, outside=outside.result(beside, whole, unpacked[-1]))


# ---- writing ---------------------------------------------------------------------------------------------------------
REALISATIONS = 2  # the time of tables and figures does not depend on their number
SPARE = 1.25  # for the report, for files and for what one case's figure does not show


def seconds(experiment: Experiment, figures: bool | str | Sequence[str], width_mm: float | None) -> float:
    """Estimated seconds for writing: the tables of the first case, times the cases, and one figure of each kind, times
    their number, measured here."""
    from radarsim.app import result as output

    case = experiment.cases[0]
    work = CaseWork(case)
    result = case_result(case, work, collect(work, REALISATIONS))
    output.case_tables([result])  # its imports are not to be counted for every case
    started = time.perf_counter()
    made = output.case_tables([result], configs.shipped_stem(experiment))
    tables = (time.perf_counter() - started) * len(experiment.cases)
    formats = configs.formats(figures)
    described = output.case_figures([result], made, experiment) if formats else {}
    if not described:
        return SPARE * tables
    from radarsim.report.figures import draw

    names = experiment.drawn(described) or list(described)
    started = time.perf_counter()
    for name in dict.fromkeys((names[0], names[-1])):
        draw(described[name], formats, width_mm)
    each = (time.perf_counter() - started) / len(dict.fromkeys((names[0], names[-1])))
    return SPARE * (tables + each * (len(experiment.figures) or len(names)))


# ---- run -------------------------------------------------------------------------------------------------------------
WORTH_MEASURING_S = 20.0  # of a time limit: below it, measuring the time of tables and figures would take most of it


def load_all(sources: Sequence[str | os.PathLike[str]], overrides: Sequence[str] = ()) -> list[Experiment]:
    """Every config checked before any runs; raises one ConfigError with the faults of all."""
    loaded: list[Experiment] = []
    faults: list[str] = []
    for source in sources:
        try:
            loaded.append(load(source, overrides))
        except ConfigError as error:
            faults += error.lines
    faults += namesakes(loaded)
    if faults:
        raise ConfigError(*faults)
    return loaded


def codes(experiments: Sequence[Experiment]) -> list[str]:
    """The user's own code in experiments, a line each; imports it. Raises ConfigError where it cannot be imported."""
    every = [one for experiment in experiments for case in experiment.cases for one in case.outside if one.written]
    filters = {f"{one.object_name} in {one.file}": one for one in every}
    for one in filters.values():
        one.target  # noqa: B018  (imports it)
    return list(filters)


def namesakes(experiments: Sequence[Experiment]) -> list[str]:
    """A line for each config whose results would overwrite those of another: folders have the config's name. Names that
    differ in case or in Unicode composition are one name to some file systems."""
    seen: dict[str, str] = {}
    faults = []
    for one in experiments:
        name = unicodedata.normalize("NFC", one.stem).casefold()
        first = seen.setdefault(name, str(one.path))
        if first != str(one.path) and not files.same_file(first, str(one.path)):
            faults.append(f"{one.path}: its results would overwrite those of {first}: rename one, or run them apart")
    return faults


def run(
    config: Config,
    *,
    realisations: float | None = None,
    seed: int | None = None,
    overrides: Overrides = (),
    precision: float | None = None,
    of: str = "sigma",
    decide: bool = False,
    time_limit: float | Stop | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> "Result":
    """Run an experiment and return its result; writes nothing unless `out` names a directory.

    config is a path, the name of a shipped config, a dict as YAML would give it, or an Experiment loaded with these
    overrides. overrides change keys of it: `{"radar": {"sigma_range_m": 300}}`, the same with dotted keys,
    `{"radar.sigma_range_m": 300}`, or texts, `["radar.sigma_range_m=300"]`.

    With a precision, in per cent, a case ends at the first of 2000, 4000, 8000 …, N realisations at which the 95 %
    half-width of every σ is below it; `of` names another quantity of the study (gain, lock, …). If errors are not known
    to be Gaussian, σ and gains are not judged before 64,000, or before 512,000 after large errors. decide: all cases
    end at the first of these numbers at which every claim of the config is decided. time_limit is in seconds, including
    tables and figures, or a condition that is already running. `result.unmet` names the targets that were not reached.
    workers: number of processes on this machine; scheduler: address of a Dask scheduler; executor: one that is already
    open. width_mm: width of the figures, instead of their own. progress is called with the realisations that are done,
    are to be done, and were stored, where cases are weighed by their time.

    Raises ConfigError for an invalid config, StoreError for a disk fault, NonFiniteError for a filter that diverged,
    TargetUnmet if the time did not suffice for a single block, and Interrupted on a signal; finished blocks are then
    stored. Raises DisagreementError, after writing everything, if measured and exact values differ by more than chance
    explains: one of them is wrong. Its `result` is the result that would have been returned.

    >>> result = run("rls2", realisations=2000)
    >>> len(result.curves) > 50
    True
    """

    checked: dict[str, Any] = {"threads": threads, "workers": workers, "precision": precision, "time_limit": time_limit}
    checked |= {"executor": executor, "out": out, "figures": figures, "width_mm": width_mm}
    overrides = merged(configs.check(overrides, **checked), realisations, seed)
    experiment = load(config, overrides)
    if precision is not None:
        check_precision([experiment], precision, of)
    rule = required_stop_rule() if decide else None
    if rule is not None:
        rule.check(experiment)
    limit = time_limit if time_limit is None or callable(time_limit) else stopping.TimeLimit(time_limit)
    started, kept, warned = time.perf_counter(), None, list[str]()
    if codes([experiment]):
        from radarsim.app.judge import tried

        every = [(case, one) for case in experiment.cases for one in case.outside if one.written]
        warned += dict.fromkeys(line for case, one in every for line in tried(case, one))
    if out is not None and isinstance(limit, stopping.TimeLimit) and limit.left >= WORTH_MEASURING_S:
        limit = limit.reserving(kept := seconds(experiment, figures, width_mm))
    with cluster(workers, scheduler) if executor is None else nullcontext(executor) as pool:
        threads = pool.workers if pool else available_cores() if threads is None else int(threads)
        options = RunOptions(out, threads, stopping.Either(stop, limit), pool)
        if rule is not None:
            simulated = rule.simulate(experiment, options, progress)
        else:
            simulated = simulate(experiment, options, progress=progress, precision=precision, of=of)
        if stop is not None:
            stop.raise_if_received()
    if not simulated.cases:
        raise TargetUnmet(f"{experiment.stem}: {simulated.stopped}: nothing was finished by then")
    with limited(threads):
        facts = facts_of(simulated, threads, time.perf_counter() - started)
    if kept is not None:
        facts["seconds_kept_for_writing"] = kept
    if rule is not None:
        left = rule.unmet(experiment, simulated)
        facts |= {"unmet": [*facts["unmet"], *left], "stop": "; ".join((*facts["unmet"], *left)) or "done"}
    ended_by = None if simulated.stopped or precision is None else (precision, of)
    result = result_of(experiment, simulated, facts, repeated(experiment, simulated.done, overrides, ended_by))
    noticed = (line for case in experiment.cases for one in case.outside for line in one.warnings())
    result.facts["warnings"] += dict.fromkeys((*warned, *noticed))
    if out is None:
        result.check()
    else:
        result.write(out, figures, width_mm)
    return result


def required_stop_rule() -> StopRule:
    """The rule of `decide`. Raises ConfigError where no extension has one."""
    if (rule := stop_rule()) is None:
        raise ConfigError("decide: no installed part of radarsim has a rule that ends a run")
    return rule


def run_share(
    experiment: Experiment,
    part: tuple[int, int],
    *,
    out: str | os.PathLike[str],
    threads: int | None = None,
    executor: Executor | None = None,
    time_limit: Stop | None = None,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> Shares:
    """Compute a part of every case, as (2, 3) the second of three, into the store under out; no tables. See `run`."""
    options = RunOptions(out, threads, stopping.Either(stop, time_limit), executor)
    done = shared(experiment, part, options, progress=progress)
    if stop is not None:
        stop.raise_if_received()
    return done


def cluster(workers: int | None, scheduler: str | None) -> AbstractContextManager[Executor | None]:
    """The executor of these workers or of this scheduler, to be entered; None where neither is given."""
    if workers is None and scheduler is None:
        return nullcontext()
    from radarsim.engine.cluster import Cluster

    return Cluster(workers, scheduler)


def trust(scheduler: str) -> str | None:
    """A warning on the trust that a scheduler on another machine requires, in one line."""
    from radarsim.engine.cluster import trust as line

    return line(scheduler)


def merged(overrides: Overrides, realisations: float | None = None, seed: int | None = None) -> tuple[str, ...]:
    """Overrides as texts, with realisations and seed, if given, as two more."""
    given = {"realisations": realisations, "seed": seed}
    return (*texts(overrides), *(f"{key}={value}" for key, value in given.items() if value is not None))


def stored_result(
    config: Config, *, out: str | os.PathLike[str] = configs.RESULTS, overrides: Overrides = ()
) -> "Result":
    """Load the stored result of an experiment from `out`; computes and writes nothing.

    config and overrides as for `run`; of as many realisations as the last run reported, unless overrides say. `write`
    of the result makes tables, figures and report, as `radarsim report` does. Raises ConfigError, with the command to
    run, if something is missing.

    >>> import radarsim, tempfile
    >>> with tempfile.TemporaryDirectory() as out:
    ...     ran = radarsim.run("rls2", realisations=2000, out=out, figures=False)
    ...     loaded = radarsim.load("rls2", out=out)
    >>> loaded.curves.equals(ran.curves)
    True
    """
    configs.directory(out)
    overrides = merged(overrides)
    experiment = asked = load(config, overrides)
    if not any(override.split("=")[0].strip() == "realisations" for override in overrides):
        experiment = as_last_run(experiment, Path(out))
    held, missing = SimulatedCases(), []
    for case in experiment.cases:
        work = CaseWork(case)
        if not case.realisations:  # the last run was stopped before it came to this case
            continue
        collected = stored(work, case.realisations, out)
        if collected is None:
            missing.append(lack(case.name, take_inventory(work, case.realisations, out), Store(out, work)))
        else:
            held.cases.append((case, work, collected))
    if missing:
        counts = {case.realisations for case in experiment.cases}
        if experiment is not asked and counts != {case.realisations for case in asked.cases} and len(counts) == 1:
            overrides = merged(overrides, counts.pop(), None)
        raise ConfigError(*missing, f"`{command(asked, overrides, out)}` computes them")
    return result_of(experiment, held, facts_of(held, 0, 0.0), repeated(asked, held.done, overrides, None))


def lack(name: str, held: Inventory, store: Store) -> str:
    """The line of a case that is not completely stored: how much of it is and what is missing, or why nothing is."""
    out = store.path.parent.parent
    if not held.stored:
        reasons = [*store.warnings, *(["those there are of other sources, as before an edit"] * store.superseded())]
        return "; ".join([f"{name}: {held.asked:,} realisations are not stored in {out}", *reasons])
    from radarsim.app.outlook import missing

    return f"{name}: {held.stored:,} of {held.asked:,} realisations are stored in {out}; missing: {missing(held)}"


def result_of(experiment: Experiment, simulated: SimulatedCases, facts: dict[str, Any], again: str) -> "Result":
    """The result, with `again`, the command that repeats it, and the warnings on the config."""
    from radarsim.app.result import Result

    facts["warnings"] += [*configs.shadows(experiment), *registry.study(experiment.study).warnings(experiment)]
    return Result(experiment, finished(simulated), facts | {"command": again})


def as_last_run(experiment: Experiment, out: Path) -> Experiment:
    """The experiment with each case's realisations as in the run.json under `out`, if there is one."""
    try:
        done = json.loads(files.read(out / experiment.stem / "run.json"))["cases"]
        numbers = {name: int(case["done"]) for name, case in done.items()}
    except FileNotFoundError:
        return experiment
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or "damaged"
        raise StoreError(
            f"{out / experiment.stem / 'run.json'}: cannot be read: {reason}; `radarsim run` makes it again, "
            "and so does `radarsim report` with -n"
        ) from error
    cases = tuple(replace(case, realisations=numbers.get(case.name, case.realisations)) for case in experiment.cases)
    return replace(experiment, cases=cases, realisations=max(case.realisations for case in cases))


def finished(simulated: SimulatedCases) -> list[CaseResult]:
    """Cases with their sums and the labels of these."""
    return [case_result(*one) for one in simulated.cases]


def facts_of(simulated: SimulatedCases, threads: int, seconds: float) -> dict[str, Any]:
    """The facts of a run for run.json: stop reason, threads, times, warnings, identities, precision reached."""
    collected = [c for _, _, c in simulated.cases]
    facts: dict[str, Any] = {
        "stop": "; ".join(simulated.unmet) or "done",
        "unmet": simulated.unmet,
        "threads": threads,
        "seconds": seconds,
        "kernel_seconds": sum(c.kernel_seconds for c in collected),
        "realisations_computed": sum(c.computed for c in collected),
        "realisations_from_store": sum(c.from_store for c in collected),
        "warnings": [
            *dict.fromkeys(warning for c in collected for warning in c.warnings),
            *superseded_blocks([case.name for case, _, c in simulated.cases if c.superseded]),
            *cache_troubles(),
        ],
        "identities": {case.name: work.identity for case, work, _ in simulated.cases},
    }
    if measured := seconds_per_update(work for _, work, _ in simulated.cases):
        facts["seconds_per_update"] = measured
    if simulated.precision is None:
        return facts
    widest = {
        name: asdict(cell) | {"percent": finite(cell.percent), "of": cell.of.name}
        for name, cell in simulated.cells.items()
    }
    return facts | {"precision": {"asked_percent": simulated.precision, "widest": widest}}


MAX_NAMED_CASES = 3  # in a line


def superseded_blocks(cases: Sequence[str]) -> list[str]:
    """A line on stored blocks of these cases that other sources made; nothing without such."""
    if not cases:
        return []
    return [
        tr(
            "stored blocks of {cases} were made by other sources, as before an edit, and are not used; "
            "`radarsim clean CONFIG --other-sources` removes them",
            cases=few(list(dict.fromkeys(cases)), MAX_NAMED_CASES),
        )
    ]


def cache_troubles() -> list[str]:
    """Faults of the compiler and its cache in this process, a line for each kind. A kernel that could not be read or
    kept was compiled, as on a new machine."""
    cache = sys.modules.get("radarsim.kernels.cache")  # nothing is compiled where it is not loaded
    return list(cache.troubles.values()) if cache else []


def seconds_per_update(works: Iterable[CaseWork]) -> dict[str, dict[str, float]]:
    """CPU seconds of one update of one realisation, by case and filter, in studies that measure it; never in a CSV."""
    every = {work.case.name: dict(registry.study(work.case.study).seconds_per_update(work.plan)) for work in works}
    return {name: seconds for name, seconds in every.items() if seconds}


def finite(value: float) -> float | None:
    """The number, or None where JSON cannot hold it."""
    return value if math.isfinite(value) else None
