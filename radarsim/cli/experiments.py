"""Commands that run experiments and read their results. Heavy imports wait inside the commands."""

import click

from radarsim.cli.group import (
    configs_argument,
    figures_option,
    main,
    out_option,
    realisations_option,
    seed_option,
    set_option,
)


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
