"""Commands that run experiments, and read, compare and judge their results. Heavy imports are inside the commands."""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import click

from radarsim.cli import group
from radarsim.errors import ClusterError, DisagreementError, MeasureError, TargetUnmet
from radarsim.extensions import stop_rule
from radarsim.language import tr

if TYPE_CHECKING:
    from radarsim.app.result import Result
    from radarsim.app.run import Shares
    from radarsim.config.experiment import Experiment


STOP_RULE = stop_rule()


@group.main.command()
@group.configs_argument
@group.realisations_option
@group.seed_option
@group.set_option
@group.precision_option
@group.of_option
@click.option("--decide", is_flag=True, help=STOP_RULE.help if STOP_RULE else None, hidden=STOP_RULE is None)
@group.time_limit_option
@click.option("--shard", type=group.Share(), metavar="i/n", help="Compute only this share of the blocks; no tables.")
@group.threads_option
@click.option("--workers", type=click.IntRange(1, 1024), metavar="N", help="Worker processes on this machine (Dask).")
@click.option("--scheduler", metavar="ADDR", help="Address of a Dask scheduler whose workers compute: tcp://host:8786.")
@group.out_option
@group.drawing_options
@click.option("-q", "--quiet", is_flag=True, help="Print only errors.")
@group.json_option
def run(
    configs: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    precision: float | None,
    of: str,
    decide: bool,
    time_limit: float | None,
    shard: tuple[int, int] | None,
    threads: int | None,
    workers: int | None,
    scheduler: str | None,
    out: str,
    drawing: group.Drawing,
    quiet: bool,
    as_json: bool,
) -> None:
    """Run experiments, or continue stopped ones.

    CONFIG is a YAML file, or the name of a shipped experiment (`radarsim list`). Finished blocks are kept under
    DIR/.blocks: a stopped run and a larger N continue from them, an edited config or filter starts afresh. If a time
    limit ends the run, or the precision is not reached, tables of the finished part are written and the exit code is 3.

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
      radarsim run rls2 --json | jq '.[0].last_scan[0].sigma'
    """
    _refuse_together(shard, precision, workers or scheduler, threads)
    _refuse_of_nothing(of, precision)
    if decide and (shard or precision):
        raise click.UsageError("--decide goes with neither --shard nor --precision: claims are judged on all blocks")
    if workers and scheduler:
        raise click.UsageError("--workers and --scheduler do not go together: give one of them")
    from radarsim.engine import run as stopping

    limit = stopping.TimeLimit(time_limit) if time_limit else None
    with stopping.Signals() as stop:
        from radarsim.app import run as simulation

        overrides = simulation.merged(overrides, realisations, seed)
        loaded = _loaded(configs, overrides, None if precision is None else (precision, of), decide)
        _say_code(loaded, quiet)
        if scheduler and not quiet and (line := simulation.trust(scheduler)):
            click.echo(f"note: {line}", err=True)
        with simulation.cluster(workers, scheduler) as pool:
            means: dict[str, Any] = {"out": out, "threads": threads, "executor": pool}
            means |= {"time_limit": limit, "stop": stop}
            compute: Callable[..., Result | Shares]
            draw = partial(simulation.run, **drawing.arguments)
            compute = partial(draw, overrides=overrides, precision=precision, of=of, decide=decide)
            if shard:
                compute = partial(simulation.run_share, part=shard)
            _compute_each(loaded, partial(compute, **means), out, quiet, as_json, gaps=not (shard or quiet))


def _refuse_of_nothing(of: str, precision: float | None) -> None:
    """Raises UsageError for a quantity of a precision without a precision."""
    if of != "sigma" and precision is None:
        raise click.UsageError("--of applies to --precision: give --precision too")


def _refuse_together(shard: object, precision: object, cluster: object, threads: object) -> None:
    """Raises UsageError for incompatible options."""
    if shard and precision:
        raise click.UsageError("--shard and --precision do not go together: a precision is judged on all blocks")
    if threads is not None and cluster:
        raise click.UsageError("--threads and a cluster do not go together: its workers compute, not this process")


def _loaded(
    configs: tuple[str, ...], overrides: tuple[str, ...], precision: tuple[float, str] | None, decide: bool
) -> "list[Experiment]":
    """The experiments, all checked, with the quantities that their claims and a precision need."""
    from radarsim.app import run as simulation

    loaded = simulation.load_all(configs, overrides)
    if precision is not None:
        simulation.check_precision(loaded, *precision)
    for one in loaded if decide else ():
        simulation.required_stop_rule().check(one)
    return loaded


def _say_code(loaded: "list[Experiment]", quiet: bool) -> None:
    """Import the user's own code that experiments run, before any runs, and say which it is."""
    from radarsim.app import run as simulation

    for line in simulation.codes(loaded):
        if not quiet:
            click.echo(f"note: runs code of yours: {line}", err=True)


def _compute_each(
    loaded: "list[Experiment]",
    compute: "Callable[..., Result | Shares]",
    out: str,
    quiet: bool,
    as_json: bool,
    gaps: bool = False,
) -> None:
    """Compute experiments one by one and print the results; gaps: say before what a store with gaps lacks. Raises
    DisagreementError at the end for differences beyond chance, else MeasureError where the measure of a claim failed,
    else TargetUnmet for targets that were not reached."""
    from radarsim.app import run as simulation
    from radarsim.app import shown
    from radarsim.app.outlook import lacking
    from radarsim.cli import console, outcomes

    made: list[dict[str, Any]] = []
    unmet: list[str] = []
    wrong: list[str] = []
    unmeasured: list[str] = []
    for one in loaded:
        if gaps and (line := lacking(one, out)) is not None:
            console.say_aside(tr("note: {words}", words=line))
        try:
            with console.Progress(one.stem, quiet=quiet) as progress:
                done = compute(one, progress=progress.update)
        except ClusterError:
            raise  # for the other experiments too
        except TargetUnmet as error:
            unmet += error.lines
            continue
        except DisagreementError as error:  # all is written, and the other experiments stand by themselves
            wrong += [line if line.startswith(f"{one.stem}: ") else f"{one.stem}: {line}" for line in error.lines]
            made.append(shown.result(cast("Result", error.result)))
            continue
        except MeasureError as error:  # all is written
            unmeasured += error.lines
            done = cast("Result", error.result)
        unmet += [f"{one.stem}: {reason}" for reason in done.unmet]
        if isinstance(done, simulation.Shares):
            made.append({**asdict(done), "unmet": done.unmet, "warnings": done.warnings})
            if not (quiet or as_json):
                outcomes.print_share(done, out)
        else:
            made.append(shown.result(done))
            if not (quiet or as_json):
                outcomes.print_result(done)
    if as_json:
        click.echo(shown.text(made))
    if wrong:
        raise DisagreementError(*wrong)
    if unmeasured:
        raise MeasureError(*unmeasured)
    if unmet:
        raise TargetUnmet(*unmet)


@group.main.command()
@group.config_argument
@click.argument("estimates", metavar="ESTIMATES")
@click.option("--name", default="mine", show_default=True, metavar="NAME", help="What the filter is called.")
@click.option(
    "--against",
    type=click.Choice(["tuned"]),
    help="Also judge it against the config's filters as `radarsim tune` tunes them.",
)
@click.option("--for", "wanted", metavar="TEXT", help="What they are tuned for; default: σ of the first component.")
@group.realisations_option
@group.seed_option
@group.set_option
@group.precision_option
@group.of_option
@group.threads_option
@group.out_option
@group.drawing_options
@click.option("-q", "--quiet", is_flag=True, help="Print only errors.")
@group.json_option
def judge(
    config: str,
    estimates: str,
    name: str,
    against: str | None,
    wanted: str | None,
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    precision: float | None,
    of: str,
    threads: int | None,
    out: str,
    drawing: group.Drawing,
    quiet: bool,
    as_json: bool,
) -> None:
    """Judge a filter of your own: is it better than the config's?

    ESTIMATES holds what your filter made of the plots that `radarsim simulate CONFIG --realisations 0:N` wrote. The
    config's filters are run on the same plots; gains of your filter against every one of them are paired, with 95 %
    intervals. Results are in DIR/CONFIG_NAME. From Python, `radarsim.judge` also takes a function or an object.

    \b
    .npz            estimates (n, K, d): realisations 0 … n - 1, the scans, the leading d
                    components of the state; if you have them covariances (n, K, d, d),
                    components (names, if not the leading ones), realisation (n,), as in the file
                    of the plots, and seed; both are checked
    .csv, .parquet  a row for each realisation and scan: realisation, k or t_s, and a column
                    for each component, such as r and Vr (or r_m and Vr_mps)

    Where the filter has no estimate yet a value is NaN, or a cell empty. NaN after an estimate, and errors over a
    hundred times the largest of the config's filters, are failures: their share is in the first sentence of the report.

    \b
    Example
      radarsim simulate rls2 --realisations 0:10000 -o plots.npz
      radarsim judge rls2 estimates.npz --name mine
      radarsim judge rls2 estimates.npz --against tuned --for "sigma r at 60 s"
    """
    _refuse_of_nothing(of, precision)
    from radarsim.engine import run as stopping

    with stopping.Signals() as stop:
        from radarsim.app import judge as judging
        from radarsim.app import run as simulation

        (loaded,) = simulation.load_all([config], simulation.merged(overrides, None, seed))
        tuned: dict[str, Any] = {"against": against, "wanted": wanted}
        options = [word for one in ((against, "--against"), (wanted, "--for")) if one[0] for word in (one[1], one[0])]
        made, warnings = judging.judged(loaded, estimates, name, realisations=realisations, **tuned)
        if precision is not None:
            simulation.check_precision([made], precision, of)
        again = judging.command(loaded, estimates, name, simulation.merged(overrides, realisations, seed), options)
        asked: dict[str, Any] = {"precision": precision, "of": of, "threads": threads, "stop": stop}
        asked |= {"command": again, **drawing.arguments}
        compute = partial(judging.finished, warnings=warnings, out=out, **asked)
        _compute_each([made], compute, out, quiet, as_json)


@group.main.command()
@group.configs_argument
@group.realisations_option
@group.seed_option
@group.set_option
@group.precision_option
@group.of_option
@click.option("--shard", "share", type=group.Share(), metavar="i/n", help="Forecast only this share of the blocks.")
@click.option(
    "--out", type=group.Directory(), metavar="DIR", help="Also report what is stored there and what is missing."
)
@group.json_option
def check(
    configs: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    as_json: bool,
    **asked: Any,
) -> None:
    """Validate configs and estimate the time of a run.

    Also prints cases, filters, realisations and memory. A few realisations are timed, unless all take less than a
    second. With --out the time covers what the results directory lacks, with --shard one share.

    With --precision, it also estimates the number of realisations and the time: from exact values where the filters are
    linear, otherwise from a pilot run of a second or two.

    \b
    Examples
      radarsim check configs/range_doppler.yaml -n 1e7
      radarsim check multimodel --precision 1
      radarsim check discriminator_rare -n 1e6 --precision 10 --of lost
      radarsim check multimodel -n 1e8 --shard 1/3        how long the first of three machines takes
      radarsim check multimodel -n 1e8 --out results      what is stored there, and what is missing
    """
    _refuse_together(asked["share"], asked["precision"], None, None)
    _refuse_of_nothing(asked["of"], asked["precision"])
    from radarsim.app import outlook as overview
    from radarsim.app import run as simulation
    from radarsim.app import shown
    from radarsim.cli import console, outcomes

    made = []
    loaded = simulation.load_all(configs, simulation.merged(overrides, realisations, seed))
    _say_code(loaded, as_json)
    for one in loaded:
        with console.Progress(one.stem, quiet=as_json) as bar:
            outlook = overview.check(one, progress=bar.update, **asked)
        made.append(shown.outlook(one, outlook))
        if not as_json:
            outcomes.print_outlook(one, outlook)
    if as_json:
        click.echo(shown.text(made))


@group.main.command()
@group.configs_argument
@group.realisations_option
@group.seed_option
@group.set_option
@group.out_option
@group.drawing_options
@group.json_option
def report(
    configs: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    out: str,
    drawing: group.Drawing,
    as_json: bool,
) -> None:
    """Write tables, figures and report of stored runs.

    Computes nothing.

    \b
    Examples
      radarsim report rls2
      radarsim report rls2 --json --no-figures
    """
    from radarsim.app import run as simulation

    overrides = simulation.merged(overrides, realisations, seed)

    def written(one: "Experiment", progress: object) -> "Result":
        result = simulation.stored_result(one, out=out, overrides=overrides)
        result.write(out, **drawing.arguments)
        return result

    _compute_each(simulation.load_all(configs, overrides), written, out, False, as_json)


@group.main.command()
@click.argument("sources", nargs=-1, required=True, metavar="A B…", shell_complete=group.completed)
@group.out_option
@group.drawing_options
@group.json_option
def compare(sources: tuple[str, ...], out: str, drawing: group.Drawing, as_json: bool) -> None:
    """Compare stored runs: differences with intervals.

    Each of A, B, … is a config with a stored result in DIR, or the folder of a result: two radars, two configs, or two
    versions of one. Nothing is computed. All are compared with the first. If two runs use the same measurements (study,
    seed, target, sensor) and the same baseline filter, the difference is paired. Writes DIR/compare/comparison.csv,
    compare.html and figures.

    \b
    Examples
      radarsim compare rls2 rls4
      radarsim compare rls2.yaml mine.yaml --json
      radarsim compare results/rls2 results-before/rls2
    """
    from radarsim.app import compare as comparing
    from radarsim.app import shown
    from radarsim.cli import outcomes

    if len(sources) < 2:
        raise click.UsageError(f"compare takes two results or more, got {len(sources)}")
    compared = comparing.compare(*sources, out=out, **drawing.arguments)
    if as_json:
        click.echo(shown.text(shown.compared(compared)))
    else:
        outcomes.print_comparison(compared)
