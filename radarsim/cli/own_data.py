"""Commands for one's own data and one's own radar. Heavy imports wait inside the commands."""

from typing import TYPE_CHECKING

import click

from radarsim.cli.group import Count, completed, config_argument, main, set_option

if TYPE_CHECKING:
    from radarsim.engine.results import Track


@main.command()
@click.argument("name", metavar="NAME")
@click.option(
    "--like",
    required=True,
    metavar="CONFIG",
    shell_complete=completed,
    help="The config to begin from: `radarsim list` names them.",
)
def new(name: str, like: str) -> None:
    """A commented config of one's own: ./NAME.yaml.

    It repeats CONFIG, with the unit and the meaning of every key beside it, and adds the optional keys as comments.
    An existing file is never overwritten.

    \b
    Example
      radarsim new mine --like rls2
    """
    from radarsim.app import configs

    path = configs.new(name, like)
    click.echo(f"config   {path}")
    click.echo(f"         change its numbers, then `radarsim check {path}` and `radarsim run {path}`")


@main.command(name="new-study")
@click.argument("name", metavar="NAME")
def new_study(name: str) -> None:
    """A package with a small whole study, to be made one's own: ./NAME.

    It compares two filters on a random walk: keys, kernel, exact values, tables, figures, a claim, recorded plots,
    configs and a test, and in each file a comment `Yours: …` where one's own goes. Installed beside radarsim it is a
    study like those shipped here. Nothing is ever overwritten.

    \b
    Example
      radarsim new-study my_paper
      pip install -e my_paper
      radarsim run my_paper
    """
    from radarsim.app.new_study import new_study as write

    path = write(name)
    click.echo(f"package  {path}")
    click.echo(f"         `pip install -e {path}`, then `radarsim run {name}`; {path / 'README.md'} says what is where")


@main.command()
@config_argument
@click.option("-o", "--output", required=True, metavar="PLOTS.csv", help="Where the plots are written.")
@click.option("-i", "--realisation", type=Count(), default=0, show_default=True, help="Which realisation, from 0.")
@set_option
def simulate(config: str, output: str, realisation: int, overrides: tuple[str, ...]) -> None:
    """One realisation's measurements, with the truth in columns true_….

    The plots are those that a run of CONFIG draws in this realisation, number for number: `radarsim track` over them
    gives the errors that the run adds up. A missed plot is an empty cell.

    \b
    Example
      radarsim simulate rls2 -o plots.csv
      radarsim track rls2 plots.csv -o track.csv
    """
    from radarsim.app import run as experiment
    from radarsim.cli import console
    from radarsim.track import follow as recorded
    from radarsim.track import plots

    (loaded,) = experiment.load_all([config], overrides)
    columns = recorded.simulated(loaded, realisation)
    plots.write_columns(columns, output, loaded.path)
    count = len(next(iter(columns.values())))
    click.echo(f"plots    {output} ({count} rows: {', '.join(columns)})")
    console.print_warnings(experiment.cache_troubles())


@main.command()
@config_argument
@click.argument("plots", metavar="PLOTS.csv")
@click.option("-o", "--output", metavar="TRACK.csv", help="Where the track is written; default: to the terminal.")
@click.option("--figures", metavar="DIR", help="Draw track, residuals and probabilities of the models into DIR.")
@click.option("-q", "--quiet", is_flag=True, help="Report neither gaps nor how well the accuracies fit.")
@set_option
def track(
    config: str, plots: str, output: str | None, figures: str | None, quiet: bool, overrides: tuple[str, ...]
) -> None:
    """The config's filters over recorded measurements.

    PLOTS.csv has a header and one row a plot, its times rising at any spacing; an empty cell is a missing value, other
    columns are ignored. Its columns are t_s and what the study's sensor measures, as `radarsim simulate` writes them:
    `range_m, velocity_mps` (range_doppler), `range_m, bearing_rad` (sonar), `range_m, elevation_rad, azimuth_rad` or
    `x_m, y_m, z_m` (multimodel).

    Also reported: gaps and missing values, and whether the accuracies that the config states fit the plots: the
    filters' own innovations are tested (NIS, 1 for a filter that is right about its errors). A gap so long that
    a filter's numbers after it would be only rounding errors is a fault, reported with its line: split the file there.

    \b
    Example
      radarsim track sonar_smoothing plots.csv -o track.csv --figures figures
    """
    import contextlib

    from radarsim.app import run as experiment
    from radarsim.cli import console, findings
    from radarsim.report.files import Writer
    from radarsim.track import accuracy
    from radarsim.track import follow as recorded
    from radarsim.track import plots as files

    (loaded,) = experiment.load_all([config], overrides)
    read = {"the plots": plots, "the config": loaded.path}
    started = False

    def sink(piece: "Track") -> None:
        nonlocal started
        if not started:
            write([files.header_of(piece)])
            started = True
        write(files.rows_of(piece))

    with contextlib.ExitStack() as stack:
        write = stack.enter_context(Writer(output, read)).write if output else findings.echo
        followed = recorded.follow(loaded, plots, sink)
    drawn = recorded.draw(followed, figures, [plots, *([loaded.path] if loaded.path else [])]) if figures else []
    if not quiet:
        findings.report(followed, accuracy.judged(followed), stderr=output is None)
    if output:
        click.echo(f"track    {output}")
    if drawn:
        click.echo(f"figures  {figures} ({', '.join(drawn)})")
    console.print_warnings(experiment.cache_troubles())
