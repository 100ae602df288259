"""The command `radarsim`: parse, call one function, print. Heavy imports wait inside the commands."""

import os
import signal
import sys

import click

import radarsim
from radarsim.errors import Interrupted, RadarsimError, StoreError

SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


class Commands(click.Group):
    """Commands in the order of their definition; faults become lines on stderr and an exit code, never a traceback."""

    def list_commands(self, ctx):
        return list(self.commands)

    def invoke(self, ctx):
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except RadarsimError as error:
            fail(error)
        except KeyboardInterrupt:
            fail(Interrupted(signal.SIGINT))
        except BrokenPipeError:
            # The reader of our output has seen enough (`| head`): no fault of anybody's.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            sys.exit(0)
        except OSError as error:
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            fail(StoreError(f"{error.filename or 'output'}: cannot be written: {error.strerror or error}"))


def fail(error: RadarsimError) -> None:
    """Tell a fault, a line each, and leave with its exit code."""
    for line in dict.fromkeys(error.lines):
        click.echo(line, err=True)
    if isinstance(error, Interrupted):
        # The interpreter's orderly end takes most of a second, which whoever sent the signal need not wait for.
        os._exit(error.exit_code)
    sys.exit(error.exit_code)


class Count(click.ParamType):
    """A whole number that may be written 1e5."""

    name = "N"

    def convert(self, value, param, ctx):
        text = str(value)
        try:
            number = float(text) if text.isascii() and "_" not in text else float("nan")
        except ValueError:
            number = float("nan")
        if not number.is_integer() or number < 0:
            self.fail(f"must be a whole number such as 1000 or 1e5, got {value!r}", param, ctx)
        return int(text) if text.isdigit() else int(number)


def entry():
    """The console script: `main` with streams that are there and can hold every character."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    main()


@click.group(cls=Commands, context_settings=SETTINGS)
@click.version_option(radarsim.__version__, prog_name="radarsim")
def main():
    """Monte-Carlo experiments on radar and sonar track processing.

    An experiment is a YAML file: a sensor, a target, the filters compared. radarsim runs 10⁵ and more realisations
    of it and writes σ(k), relative gains with 95 % intervals, figures, a report, and a verdict on the papers' claims.

    \b
    Examples
      radarsim run rls2                          the first paper's decimetre radar
      radarsim run rls2 --set radar.sigma_velocity_mps=5 -n 1e6
      radarsim claims                            what the papers claim, and what came out
    """


configs_argument = click.argument("configs", nargs=-1, required=True, metavar="CONFIG…")
out_option = click.option("--out", default="results", show_default=True, metavar="DIR", help="Where results are kept.")
set_option = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key by its dotted path; repeatable."
)
realisations_option = click.option(
    "-n", "--realisations", type=Count(), metavar="N", help="Realisations, overrides the config; 1e5 is a number."
)
seed_option = click.option("--seed", type=Count(), metavar="S", help="Seed, overrides the config.")
figures_option = click.option("--no-figures", is_flag=True, help="Draw no figures; tables and report only.")


@main.command()
@configs_argument
@realisations_option
@seed_option
@set_option
@click.option("--threads", type=click.IntRange(1, 1024), metavar="T", help="Threads; default: all cores.")
@out_option
@figures_option
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def run(configs, realisations, seed, overrides, threads, out, no_figures, quiet):
    """Run experiments; resumes by itself.

    CONFIG is a YAML file, or the name of a shipped experiment (`radarsim list`). Finished blocks are kept under
    DIR/.blocks: a run that was stopped continues, a larger N continues, an edited config starts anew.

    \b
    Examples
      radarsim run configs/rls2.yaml
      radarsim run range_doppler -n 1e6 --threads 2
      radarsim run rls2 --set radar.sigma_range_m=300 --set filters.0.manoeuvre_variance=1e-4
    """
    from radarsim.engine.stopping import Signals

    with Signals() as stop:
        from radarsim import console, experiment

        overrides = experiment.merged(overrides, realisations, seed)
        for one in experiment.load_all(configs, overrides):
            with console.Progress(one.stem, quiet=quiet) as progress:
                result = experiment.run(
                    one,
                    overrides=overrides,
                    threads=threads,
                    out=out,
                    figures=not no_figures,
                    progress=progress.update,
                    stop=stop,
                )
            if not quiet:
                console.print_result(result)


@main.command()
@configs_argument
@realisations_option
@seed_option
@set_option
def check(configs, realisations, seed, overrides):
    """Validate configs; say what would run: cases, filters, realisations, time, memory.

    \b
    Example
      radarsim check configs/range_doppler.yaml -n 1e7
    """
    from radarsim import console, experiment, overview

    for one in experiment.load_all(configs, experiment.merged(overrides, realisations, seed)):
        console.print_outlook(one, overview.outlook(one))


@main.command()
@configs_argument
@realisations_option
@seed_option
@set_option
@out_option
@figures_option
def report(configs, realisations, seed, overrides, out, no_figures):
    """Tables, figures and report from what is stored; computes nothing.

    \b
    Example
      radarsim report rls2
    """
    from radarsim import console, experiment

    overrides = experiment.merged(overrides, realisations, seed)
    for one in experiment.load_all(configs, overrides):
        console.print_result(experiment.report(one, out=out, overrides=overrides, figures=not no_figures))


@main.command()
@click.argument("configs", nargs=-1, metavar="[CONFIG…]")
@out_option
def claims(configs, out):
    """The papers' claims: stated, measured with interval, verdict; computes nothing.

    Without CONFIG all claims of all papers; those without stored results are listed as not run, with the command that
    would judge them.

    \b
    Example
      radarsim claims range_doppler
    """
    from radarsim import console, experiment

    console.print_claims(experiment.claims(configs, out))


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
    from radarsim import experiment
    from radarsim import plots as files

    (loaded,) = experiment.load_all([config], overrides)
    _, estimates = experiment.track(loaded, plots)
    if output is None:
        for row in files.rows_of(estimates):
            click.echo(",".join(row))
    else:
        files.write(estimates, output)
        click.echo(f"track    {output}")


@main.command(name="list")
def list_():
    """Configs, scenarios, studies and filters at hand.

    \b
    Example
      radarsim list
    """
    from radarsim import console, overview

    console.print_inventory(overview.inventory())


@main.command()
def schema():
    """JSON Schema of the YAML, for editors and other programs.

    \b
    Example
      radarsim schema > schema.json
    """
    from radarsim.config.json_schema import schema_json

    click.echo(schema_json(), nl=False)


if __name__ == "__main__":
    entry()
