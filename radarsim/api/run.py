"""One experiment from config to written results, for the command and Python."""

import os
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from typing import TYPE_CHECKING, Any

from radarsim.api import arguments
from radarsim.api.configs import Config, Overrides, load
from radarsim.api.executor import open_executor
from radarsim.api.load_experiments import combine_overrides
from radarsim.api.progress import Progress
from radarsim.api.repeat_command import repeat_command
from radarsim.api.replacement import earlier_result, with_counts
from radarsim.api.run_facts import run_facts
from radarsim.api.simulate_cases import RunOptions, Shares, compute_shares, missing_pieces, simulate, works_by_identity
from radarsim.api.stored_runs import config_filter_warnings, make_result
from radarsim.config.experiment import Experiment
from radarsim.engine import stop_conditions
from radarsim.engine.executors import Executor
from radarsim.engine.machine import available_cores
from radarsim.engine.stop_conditions import Signals, Stop
from radarsim.errors import ConfigError, TargetUnmet
from radarsim.extensions import StopRule, stop_rule
from radarsim.system.threads import ThreadLimit

if TYPE_CHECKING:
    from radarsim.api.result import Result


MIN_MEASURED_LIMIT_S = 20.0  # a shorter time limit would mostly go on measuring the time of tables and figures


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
    runs: str | None = None,
    replace: bool = False,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> "Result":
    """Run an experiment and return its result; writes nothing unless `out` names a directory.

    config is a path, the name of a shipped config, a dict as YAML would give it, or an Experiment loaded with these
    overrides. overrides change keys of it: `{"radar": {"sigma_range_m": 300}}`, the same with dotted keys,
    `{"radar.sigma_range_m": 300}`, or texts, `["radar.sigma_range_m=300"]`.

    With a precision, in per cent, a case ends at the first of 2000, 4000, 8000 …, N realisations at which the 95 %
    half-width of every σ is below it; `of` names another quantity of the study (gain, lock, …), or is a phrase as in
    `solve`; for the long run the cases last until their filters have settled. If errors are not known to be Gaussian, σ
    and gains are not judged before 64,000, or before 512,000 after large errors. decide: all cases end at the first of
    these numbers at which every claim of the config is decided. time_limit is in seconds, including tables and figures,
    or a condition that is already running. `result.unmet` names the targets that were not reached. workers: number of
    processes on this machine; scheduler: address of a Dask scheduler; executor: one that is already open. width_mm:
    width of the figures, instead of their own. replace: whether tables of other settings or another seed, or of more
    realisations, may be replaced in the folder of the result; otherwise ConfigError is raised before anything is
    computed, and of more realisations the stored ones are shown. runs: scans, `2:60` or `all`, for the table `runs` of
    each run's root-mean-square error over them (`Result.add_runs_table`), in place of those of the config. progress is
    called with the realisations that are done, are to be done, and were stored, where cases are weighed by their time.

    Raises ConfigError for an invalid config, StoreError for a disk fault, NonFiniteError for a filter that diverged,
    TargetUnmet if the time did not suffice for a single block, and Interrupted on a signal; finished blocks are then
    stored. Raises DisagreementError, after writing everything, if measured and exact values differ by more than chance
    explains: one of them is wrong. Its `result` is the result that would have been returned.

    >>> result = run("rls2", realisations=2000)
    >>> len(result.curves) > 50
    True
    """
    checked_arguments: dict[str, Any] = {
        "threads": threads,
        "workers": workers,
        "precision": precision,
        "time_limit": time_limit,
    }
    checked_arguments |= {"executor": executor, "out": out, "figures": figures, "width_mm": width_mm}
    overrides = combine_overrides(arguments.check_arguments(overrides, **checked_arguments), realisations, seed)
    experiment = load(config, overrides)
    if runs is not None:
        from radarsim.api.runs_table import parse_span

        parse_span(runs)
        experiment = experiment.with_runs(runs)
    if precision is not None:
        from radarsim.api import precision_target

        precision_target.check_precision([experiment], precision, of)
        (experiment,), of = precision_target.with_long_run([experiment], of)
    rule = required_stop_rule() if decide else None
    if rule is not None:
        rule.check(experiment)
    limit = time_limit if time_limit is None or callable(time_limit) else stop_conditions.TimeLimit(time_limit)
    at_least: Mapping[str, int] = {}
    requested = experiment
    if out is not None and not replace:
        earlier = earlier_result(experiment, out)
        earlier.check_replacement()
        at_least = earlier.counts
        if precision is None and not decide:
            experiment = with_counts(experiment, earlier.larger_counts())
    started, writing_s = time.perf_counter(), None
    filter_warnings = config_filter_warnings(experiment)
    if out is not None and isinstance(limit, stop_conditions.TimeLimit) and limit.remaining_s >= MIN_MEASURED_LIMIT_S:
        from radarsim.api.writing_time import writing_seconds

        limit = limit.with_reserve(writing_s := writing_seconds(experiment, figures, width_mm))
    with open_executor(workers, scheduler) if executor is None else nullcontext(executor) as pool:
        threads = pool.workers if pool else available_cores() if threads is None else int(threads)
        options = RunOptions(out, threads, stop_conditions.AnyStop(stop, limit), pool, at_least)
        if rule is not None:
            simulated = rule.simulate(experiment, options, progress)
        else:
            simulated = simulate(experiment, options, progress=progress, precision=precision, quantity_name=of)
        if stop is not None:
            stop.raise_if_received()
    if not simulated.cases:
        raise TargetUnmet(f"{experiment.stem}: {simulated.stopped}: nothing was finished by then")
    with ThreadLimit(threads):
        facts = run_facts(simulated, threads, time.perf_counter() - started)
    if writing_s is not None:
        facts["seconds_kept_for_writing"] = writing_s
    if rule is not None:
        undecided = rule.unmet(experiment, simulated)
        facts |= {"unmet": [*facts["unmet"], *undecided], "stop": "; ".join((*facts["unmet"], *undecided)) or "done"}
    reached_precision = None if simulated.stopped or precision is None else (precision, of)
    repeat = repeat_command(requested, simulated.done, overrides, reached_precision)
    facts["asked"] = {case.name: case.realisations for case in requested.cases}
    result = make_result(experiment, simulated, facts, repeat)
    run_warnings = (line for case in experiment.cases for member in case.user_filters for line in member.warnings())
    result.facts["warnings"] += dict.fromkeys((*filter_warnings, *run_warnings))
    if experiment.runs:
        with ThreadLimit(threads):
            result.add_runs_table(experiment.runs)
    if out is None:
        result.check()
    else:
        result.write(out, figures, width_mm, replace=replace)
    return result


def required_stop_rule() -> StopRule:
    """The rule of `decide`. Raises ConfigError where no extension has one."""
    if (rule := stop_rule()) is None:
        raise ConfigError("decide: no installed part of radarsim has a rule that ends a run")
    return rule


def run_share(
    experiment: Experiment,
    share: tuple[int, int],
    *,
    out: str | os.PathLike[str],
    threads: int | None = None,
    executor: Executor | None = None,
    time_limit: Stop | None = None,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> Shares:
    """Compute a share of every case, such as (2, 3) for the second of three, into the store under out. See `run`."""
    options = RunOptions(out, threads, stop_conditions.AnyStop(stop, time_limit), executor)
    works = dict(works_by_identity(experiment))
    if stop is not None:
        stop.missing = partial(missing_pieces, works, share, out)
    shares = compute_shares(experiment.stem, works, share, options, progress=progress)
    if stop is not None:
        stop.raise_if_received()
    return shares
