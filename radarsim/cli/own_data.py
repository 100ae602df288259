"""Commands for one's own data and one's own radar. Heavy imports wait inside the commands."""

import click

from radarsim.cli.group import main, set_option


@main.command()
@click.argument("config", metavar="CONFIG")
@click.argument("plots", metavar="PLOTS.csv")
@click.option("-o", "--output", metavar="TRACK.csv", help="Where the track is written; default: to the terminal.")
@set_option
def track(config, plots, output, overrides):
    """The config's filters over recorded measurements.

    PLOTS.csv has a header and one row a plot, its times rising at any spacing; an empty cell is a missing value. Its
    columns are t_s and what the study's sensor measures: `range_m, bearing_rad` (sonar), `range_m, elevation_rad,
    azimuth_rad` or `x_m, y_m, z_m` (multimodel).

    \b
    Example
      radarsim track sonar_smoothing plots.csv -o track.csv
    """
    from radarsim import experiment, recorded
    from radarsim import plots as files

    (loaded,) = experiment.load_all([config], overrides)
    _, estimates = recorded.track(loaded, plots)
    if output is None:
        for row in files.rows_of(estimates):
            click.echo(",".join(row))
    else:
        files.write(estimates, output)
        click.echo(f"track    {output}")
