"""The commands judge, report and compare."""

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from radarsim.cli import command_group, options
from radarsim.cli.run import check_replacements, compute_each, refuse_quantity_without_precision
from radarsim.language.translate import tr

if TYPE_CHECKING:
    from radarsim.api.result import Result
    from radarsim.config.experiment import Experiment


@command_group.main.command()
@options.config_argument
@click.argument("estimates", metavar="ESTIMATES")
@click.option("--name", default="mine", show_default=True, metavar="NAME", help="What the filter is called.")
@click.option(
    "--against",
    type=click.Choice(["tuned"]),
    help="Also judge it against the config's filters as `radarsim tune` tunes them.",
)
@options.phrase_option
@options.realisations_option
@options.seed_option
@options.set_option
@options.precision_option
@options.quantity_option
@options.threads_option
@options.out_option
@options.replace_option
@options.drawing_options
@click.option("--all", "print_all", is_flag=True, help="Print every sentence of the answer, not only the judgement.")
@click.option("-q", "--quiet", is_flag=True, help="Print only errors.")
@options.json_option
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
    replace: bool,
    drawing: options.Drawing,
    print_all: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Judge a filter of your own: is it better than the config's?

    ESTIMATES contains your filter's estimates for the plots that `radarsim simulate CONFIG --realisations 0:N` wrote.
    The config's filters are run on the same plots; gains of your filter against every one of them are paired, with
    95 % intervals. Results are in DIR/CONFIG_NAME. From Python, `radarsim.judge` also takes a function or an object.

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
    refuse_quantity_without_precision(of, precision)
    from radarsim.engine import stop_conditions

    with stop_conditions.Signals() as stop:
        from radarsim.api import judge as api_judge
        from radarsim.api import load_experiments, precision_target
        from radarsim.cli import print_results

        (loaded,) = load_experiments.load_all([config], load_experiments.combine_overrides(overrides, None, seed))
        tuned: dict[str, Any] = {"against": against, "wanted": wanted}
        option_words = [
            word for option, value in (("--against", against), ("--for", wanted)) if value for word in (option, value)
        ]
        experiment, warnings = api_judge.add_user_filter(loaded, estimates, name, realisations=realisations, **tuned)
        if precision is not None:
            precision_target.check_precision([experiment], precision, of)
        repeat_command = api_judge.command(
            loaded, estimates, name, load_experiments.combine_overrides(overrides, realisations, seed), option_words
        )
        compute_arguments: dict[str, Any] = {"precision": precision, "of": of, "threads": threads, "stop": stop}
        compute_arguments |= {"replace": replace, "command": repeat_command, **drawing.arguments}
        compute = partial(api_judge.run_judged_experiment, warnings=warnings, out=out, **compute_arguments)
        print_finished = print_results.print_result if print_all else print_results.print_judgement
        compute_each([experiment], compute, out, quiet, as_json, print_finished=print_finished)


@command_group.main.command()
@options.configs_argument
@options.realisations_option
@options.seed_option
@options.set_option
@options.out_option
@options.replace_option
@options.drawing_options
@options.json_option
def report(
    configs: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    out: str,
    replace: bool,
    drawing: options.Drawing,
    as_json: bool,
) -> None:
    """Write tables, figures and report of stored runs.

    Computes nothing. A name means the result in DIR, with the settings that it has; the path of a config means this
    config.

    \b
    Examples
      radarsim report rls2
      radarsim report rls2 --json --no-figures
    """
    from radarsim.api import load_experiments, replacement, result_folder, stored_runs
    from radarsim.cli import console

    overrides = load_experiments.combine_overrides(overrides, realisations, seed)

    def write_stored_result(experiment: "Experiment", progress: object) -> "Result":
        counts = {} if replace or realisations is None else replacement.earlier_result(experiment, out).larger_counts()
        stored_experiment = replacement.with_counts(experiment, counts)
        result = stored_runs.stored_result(stored_experiment, out=out, overrides=overrides)
        if counts:
            result.facts["asked"] = {case.name: case.realisations for case in experiment.cases}
        result.write(out, replace=replace, **drawing.arguments)
        return result

    sources = [(name, "") if overrides else result_folder.config_to_report(name, out) for name in configs]
    for note in [] if as_json else filter(None, dict(sources).values()):
        console.print_error_line(tr("note: {words}", words=note))
    loaded = load_experiments.load_all([source for source, _ in sources], overrides)
    if not replace:
        check_replacements(loaded, out, as_json, ends_early=realisations is None)
    compute_each(loaded, write_stored_result, out, False, as_json)


@command_group.main.command()
@click.argument("result", metavar="RESULT", shell_complete=options.complete_config)
@click.option("--netcdf", required=True, metavar="FILE", help="Write σ, bias, spread and gains to a netCDF file.")
@options.out_option
def export(result: str, netcdf: str, out: str) -> None:
    """Export a stored result for other programs.

    RESULT is the folder of a result, or the name of one in DIR. The arrays lie over case, filter, component and scan,
    with times, units, seed and the whole config. Nothing is computed.

    \b
    Example
      radarsim export results/rls2 --netcdf rls2.nc
    """
    from radarsim.api import result_folder, stored_result
    from radarsim.cli import console

    stored, note = result_folder.result_of(result, out)
    if note:
        console.print_error_line(tr("note: {words}", words=note))
    stored_result.read_result(stored).write_netcdf(netcdf)
    console.print_field("netcdf", netcdf)


@command_group.main.command()
@click.argument("sources", nargs=-1, required=True, metavar="A B…", shell_complete=options.complete_config)
@click.option("--component", metavar="NAME", help="The component of the summary, such as y or Vr; default: the first.")
@click.option(
    "--for", "wanted", metavar="TEXT", help="What the summary is of: 'sigma y at 60 s', 'gain of Vr at the end'."
)
@options.out_option
@options.drawing_options
@options.json_option
def compare(sources: tuple[str, ...], as_json: bool, drawing: options.Drawing, **arguments: Any) -> None:
    """Compare stored runs: differences with intervals.

    Each of A, B, … is a config with a stored result in DIR, or the folder of a result: two radars, two configs, or two
    versions of one. Nothing is computed. All are compared with the first. If two runs use the same measurements (study,
    seed, target, sensor) and the same baseline filter, the difference is paired. Writes DIR/compare/comparison.csv,
    compare.html and figures.

    \b
    Examples
      radarsim compare rls2 rls4
      radarsim compare rls2.yaml mine.yaml --json
      radarsim compare multimodel multimodel_1hz --for "sigma y at 60 s"
      radarsim compare results/rls2 results-before/rls2
    """
    from radarsim.api import compare as api_compare
    from radarsim.api import json_output
    from radarsim.cli import print_results

    if len(sources) < 2:
        raise click.UsageError(f"compare takes two results or more, got {len(sources)}")
    compared = api_compare.compare(*sources, **arguments, **drawing.arguments)
    if as_json:
        click.echo(json_output.text(json_output.comparison(compared)))
    else:
        print_results.print_comparison(compared)
