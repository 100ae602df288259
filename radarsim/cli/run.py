"""The commands run and check."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import click

from radarsim.cli import command_group, hand_over, options
from radarsim.errors import ClusterError, ConfigError, DisagreementError, MeasureError, TargetUnmet
from radarsim.extensions import stop_rule
from radarsim.language.translate import tr

if TYPE_CHECKING:
    from radarsim.api.result import Result
    from radarsim.api.simulate_cases import Shares
    from radarsim.config.experiment import Experiment


STOP_RULE = stop_rule()


@command_group.main.command()
@options.configs_argument
@options.realisations_option
@options.seed_option
@options.set_option
@options.precision_option
@options.quantity_option
@options.phrase_of_precision_option
@click.option("--decide", is_flag=True, help=STOP_RULE.help if STOP_RULE else None, hidden=STOP_RULE is None)
@options.time_limit_option
@click.option("--shard", type=options.Share(), metavar="i/n", help="Compute only this share of the blocks; no tables.")
@options.threads_option
@click.option("--workers", type=click.IntRange(1, 1024), metavar="N", help="Worker processes on this machine (Dask).")
@click.option("--scheduler", metavar="ADDR", help="Address of a Dask scheduler whose workers compute: tcp://host:8786.")
@options.out_option
@options.replace_option
@options.drawing_options
@click.option("--runs", metavar="K1:K2|all", help="Also write runs.csv: each run's rms error over scans K1 to K2.")
@click.option("-q", "--quiet", is_flag=True, help="Print only errors.")
@hand_over.trust_code_option
@options.json_option
def run(
    configs: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    precision: float | None,
    of: str,
    phrase: str | None,
    decide: bool,
    time_limit: float | None,
    shard: tuple[int, int] | None,
    threads: int | None,
    workers: int | None,
    scheduler: str | None,
    out: str,
    replace: bool,
    drawing: options.Drawing,
    runs: str | None,
    quiet: bool,
    trust_code: bool,
    as_json: bool,
) -> None:
    """Run experiments, or continue stopped ones.

    CONFIG is a YAML file, or the name of a shipped experiment (`radarsim list`). Finished blocks are kept under
    DIR/.blocks: a stopped run and a larger N continue from them, an edited config or filter starts afresh. If a time
    limit ends the run, or the precision is not reached, tables of the finished part are written and the exit code is 3.
    A smaller N shows what is stored; tables of other settings or another seed need --replace. CONFIG may also be the
    folder of a result, or a study.zip of `radarsim pack`: these are computed again from their own config, and the
    tables compared with those in study.zip.

    \b
    Examples
      radarsim run configs/rls2.yaml
      radarsim run range_doppler -n 1e6 --threads 2
      radarsim run rls2 --set radar.sigma_range_m=300 --set filters.0.manoeuvre_variance=1e-4
      radarsim run rls2 -n 1e7 --precision 0.5          until every σ is known to ± 0.5 %
      radarsim run rls2 -n 1e7 --precision 0.5 --of gain   every gain to ± 0.5 points
      radarsim run discriminator_rare -n 1e6 --precision 10 --of lost   every rate of lost locks to ± 10 % of it
      radarsim run multimodel -n 1e5 --time-limit 600   for ten minutes; repeat it to continue
      radarsim run discriminator_paper -n 1e6 --decide  names undecided claims and the N that they need: exit code 3
      radarsim run rls2 -n 1e8 --shard 2/3              on the second of three machines
      radarsim run rls2 -n 1e8 --workers 8              or --scheduler tcp://host:8786
      radarsim run rls2 --runs 3:15                     with each run's rms error over scans 3 to 15
      radarsim run study.zip                            what somebody handed over, in results/
      radarsim run rls2 --json | jq '.[0].last_scan[0].sigma'
    """
    _refuse_incompatible(shard, precision, workers or scheduler, threads)
    of = phrase or of
    refuse_quantity_without_precision(of, precision)
    if decide and (shard or precision):
        raise click.UsageError("--decide goes with neither --shard nor --precision: claims are judged on all blocks")
    if shard and runs:
        raise click.UsageError("--shard and --runs do not go together: a share has no tables")
    if workers and scheduler:
        raise click.UsageError("--workers and --scheduler do not go together: give one of them")
    from radarsim.engine import stop_conditions

    limit = stop_conditions.TimeLimit(time_limit) if time_limit else None
    with stop_conditions.Signals() as stop, hand_over.loadable(configs, trust_code) as sources:
        from radarsim.api import executor, load_experiments
        from radarsim.api import run as api_run

        overrides = load_experiments.combine_overrides(overrides, realisations, seed)
        names = [name for name, _ in sources]
        loaded, of = _load_experiments(names, overrides, precision, of, decide, quiet or as_json)
        loaded = hand_over.named_by_results(loaded, sources, out)
        if not quiet:
            hand_over.print_large_runs(loaded, sources)
        if not (shard or replace):
            ends_early = precision is not None or decide
            check_replacements(loaded, out, quiet, ends_early)
        if not trust_code:
            _print_user_code(loaded, quiet)
        if scheduler and not quiet and (line := executor.scheduler_warning(scheduler)):
            click.echo(f"note: {line}", err=True)
        with executor.open_executor(workers, scheduler) as pool:
            compute_arguments: dict[str, Any] = {"out": out, "threads": threads, "executor": pool}
            compute_arguments |= {"time_limit": limit, "stop": stop}
            compute: Callable[..., Result | Shares]
            run_and_draw = partial(api_run.run, runs=runs, **drawing.arguments)
            targets: dict[str, Any] = {"precision": precision, "of": of, "decide": decide}
            compute = partial(run_and_draw, overrides=overrides, replace=replace, **targets)
            if shard:
                compute = partial(api_run.run_share, share=shard)
            compute_each(loaded, partial(compute, **compute_arguments), out, quiet, as_json, gaps=not (shard or quiet))
        if not (overrides or shard or precision or decide):
            hand_over.compare_with_archives(loaded, sources, out, quiet or as_json)


def check_replacements(loaded: "list[Experiment]", out: str, quiet: bool, ends_early: bool = False) -> None:
    """Check before any runs that none replaces tables of something else, and say where stored realisations are shown
    in place of fewer, or a table of runs is removed. ends_early: whether a run may end before its number of
    realisations. Raises ConfigError."""
    from radarsim.api import replacement
    from radarsim.cli import console

    faults: list[str] = []
    for experiment in loaded:
        try:
            earlier = replacement.earlier_result(experiment, out)
            earlier.check_replacement()
            larger = {} if ends_early else earlier.larger_counts()
        except ConfigError as error:
            faults += error.lines
            continue
        if larger and not quiet:
            note = replacement.larger_counts_note(experiment, larger, out)
            console.print_error_line(tr("note: {words}", words=note))
    if faults:
        raise ConfigError(*faults)


def refuse_quantity_without_precision(quantity: str, precision: float | None) -> None:
    """Raises UsageError for a quantity of a precision without a precision."""
    if quantity != "sigma" and precision is None:
        raise click.UsageError("--of and --for apply to --precision: give --precision too")


def _refuse_incompatible(shard: object, precision: object, cluster: object, threads: object) -> None:
    """Raises UsageError for incompatible options."""
    if shard and precision:
        raise click.UsageError("--shard and --precision do not go together: a precision is judged on all blocks")
    if threads is not None and cluster:
        raise click.UsageError("--threads and a cluster do not go together: its workers compute, not this process")


def _load_experiments(
    configs: Sequence[str], overrides: tuple[str, ...], precision: float | None, of: str, decide: bool, quiet: bool
) -> "tuple[list[Experiment], str]":
    """The experiments, all checked, with the quantities that their claims and a precision need; and what that is of."""
    from radarsim.api import load_experiments
    from radarsim.api import run as api_run

    loaded = load_experiments.load_all(configs, overrides)
    if precision is not None:
        from radarsim.api import long_experiment, precision_target
        from radarsim.cli import console

        precision_target.check_precision(loaded, precision, of)
        of_config = of
        loaded, of = precision_target.with_long_run(loaded, of)
        for line in long_experiment.long_run_notes(loaded) if of != of_config and not quiet else ():
            console.print_error_line(tr("note: {words}", words=line))
    for experiment in loaded if decide else ():
        api_run.required_stop_rule().check(experiment)
    return loaded, of


def _print_user_code(loaded: "list[Experiment]", quiet: bool) -> None:
    """Import the user's own code that experiments run, before any runs, and say which it is."""
    from radarsim.api import load_experiments

    for line in load_experiments.user_code_lines(loaded):
        if not quiet:
            click.echo(f"note: runs code of yours: {line}", err=True)


def compute_each(
    loaded: "list[Experiment]",
    compute: "Callable[..., Result | Shares]",
    out: str,
    quiet: bool,
    as_json: bool,
    gaps: bool = False,
    print_finished: "Callable[[Result], None] | None" = None,
) -> None:
    """Compute experiments one by one and print the results; gaps: say before what a store with gaps lacks;
    print_finished: prints a result, by default as `run` does.

    Raises DisagreementError at the end for differences beyond chance, else MeasureError where the measure of a claim
    failed, else TargetUnmet for targets that were not reached."""
    from radarsim.api import json_output, simulate_cases
    from radarsim.api.stored_runs import store_gap_sentence
    from radarsim.cli import console, print_results
    from radarsim.cli import progress as cli_progress

    documents: list[dict[str, Any]] = []
    unmet: list[str] = []
    disagreements: list[str] = []
    unmeasured: list[str] = []
    for experiment in loaded:
        if gaps and (line := store_gap_sentence(experiment, out)) is not None:
            console.print_error_line(tr("note: {words}", words=line))
        try:
            with cli_progress.Progress(experiment.stem, quiet=quiet) as progress:
                result = compute(experiment, progress=progress.update)
        except ClusterError:
            raise  # for the other experiments too
        except TargetUnmet as error:
            unmet += error.lines
            continue
        except DisagreementError as error:  # all is written, and the other experiments stand by themselves
            disagreements += [
                line if line.startswith(f"{experiment.stem}: ") else f"{experiment.stem}: {line}"
                for line in error.lines
            ]
            documents += [json_output.result(cast("Result", error.result))] if as_json else []
            continue
        except MeasureError as error:  # all is written
            unmeasured += error.lines
            result = cast("Result", error.result)
        unmet += [f"{experiment.stem}: {reason}" for reason in result.unmet]
        if isinstance(result, simulate_cases.Shares):
            documents.append({**asdict(result), "unmet": result.unmet, "warnings": result.warnings})
            if not (quiet or as_json):
                print_results.print_share(result, out)
        else:
            documents += [json_output.result(result)] if as_json else []
            if not (quiet or as_json):
                (print_finished or print_results.print_result)(result)
    if as_json:
        click.echo(json_output.text(documents))
    if disagreements:
        raise DisagreementError(*disagreements)
    if unmeasured:
        raise MeasureError(*unmeasured)
    if unmet:
        raise TargetUnmet(*unmet)


@command_group.main.command()
@options.configs_argument
@options.realisations_option
@options.seed_option
@options.set_option
@options.precision_option
@options.quantity_option
@options.phrase_of_precision_option
@click.option("--shard", "share", type=options.Share(), metavar="i/n", help="Forecast only this share of the blocks.")
@click.option(
    "--out", type=options.Directory(), metavar="DIR", help="Also report what is stored there and what is missing."
)
@click.option(
    "--recompute", "pieces", type=options.Count(), metavar="K", help="Of a study.zip: pieces of each case; default: 2."
)
@hand_over.trust_code_option
@options.json_option
def check(
    configs: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    pieces: int | None,
    trust_code: bool,
    as_json: bool,
    **arguments: Any,
) -> None:
    """Validate configs and estimate the time; verify a study.zip.

    Also prints cases, filters, realisations and memory. A few realisations are timed, unless all take less than a
    second. With --out the time covers what the results directory lacks, with --shard one share.

    With --precision, it also estimates the number of realisations and the time: from exact values where the filters are
    linear, otherwise from a pilot run of a second or two.

    Of a study.zip that `radarsim pack` wrote it checks every hash, computes K stored pieces of each case again, makes
    the tables from the sums, and says how much that was. What could not be checked is said last, with exit code 3.

    \b
    Examples
      radarsim check configs/range_doppler.yaml -n 1e7
      radarsim check multimodel --precision 1
      radarsim check discriminator_rare -n 1e6 --precision 10 --of lost
      radarsim check multimodel -n 1e8 --shard 1/3        how long the first of three machines takes
      radarsim check multimodel -n 1e8 --out results      what is stored there, and what is missing
      radarsim check study.zip --recompute 5              of `radarsim pack`: its hashes, 5 pieces of each case, tables
    """
    if hand_over.are_archives(configs):
        hand_over.refuse_options(configs, {"-n": realisations, "--seed": seed, "--set": overrides, **arguments})
        hand_over.check_archives(configs, pieces, trust_code, as_json)
        return
    if pieces is not None or trust_code:
        raise click.UsageError("--recompute and --trust-code apply to a study.zip")
    _refuse_incompatible(arguments["share"], arguments["precision"], None, None)
    arguments["of"] = arguments.pop("phrase") or arguments["of"]
    refuse_quantity_without_precision(arguments["of"], arguments["precision"])
    from radarsim.api import cost_estimate, fitted_target, json_output, load_experiments
    from radarsim.cli import console, print_cost, progress

    documents = []
    loaded = load_experiments.load_all(configs, load_experiments.combine_overrides(overrides, realisations, seed))
    _print_user_code(loaded, as_json)
    for experiment in loaded:
        with progress.Progress(experiment.stem, quiet=as_json) as bar:
            outlook = cost_estimate.check(experiment, progress=bar.update, **arguments)
        documents.append(json_output.cost(experiment, outlook))
        if not as_json:
            print_cost.print_cost(experiment, outlook)
            console.print_warnings(fitted_target.short_run_warnings(experiment.cases))
    if as_json:
        click.echo(json_output.text(documents))
