"""`radarsim new` and `new-study`: a config and a study of the user's own. Heavy imports are inside the commands."""

import click

from radarsim.cli.command_group import main
from radarsim.cli.options import complete_config
from radarsim.language.translate import tr


@main.command()
@click.argument("name", metavar="NAME")
@click.option(
    "--like",
    required=True,
    metavar="CONFIG",
    shell_complete=complete_config,
    help="The config to start from; `radarsim list` lists them.",
)
@click.option(
    "--target",
    metavar="TARGET",
    help="A target in place of CONFIG's, with the scans and the manoeuvre variance that fit it and the radar: "
    "airliner, boat, drone, helicopter, missile or ship.",
)
def new(name: str, like: str, target: str | None) -> None:
    """Write a commented config of your own: ./NAME.yaml.

    The file repeats CONFIG, with the unit and meaning of every key, and lists the optional keys as comments. An
    existing file is never overwritten.

    \b
    Examples
      radarsim new mine --like rls2
      radarsim new harbour --like rls4 --target boat
    """
    from radarsim.api import configs, fitted_target, new_configs
    from radarsim.cli import console

    path = new_configs.write_new_config(name, like, target=target)
    console.print_field("config", str(path))
    console.print_field(
        "", tr("edit its values, then `radarsim check {path}` and `radarsim run {path}`", path=str(path))
    )
    console.print_warnings(fitted_target.short_run_warnings(configs.load(path).cases))


@main.command(name="new-study")
@click.argument("name", metavar="NAME")
@click.option("--step", is_flag=True, help="For nonlinear filters: you write the step of one realisation.")
def new_study(name: str, step: bool) -> None:
    """Write a package with a small study to edit: ./NAME.

    It compares two filters on a random walk: one file with keys, matrices, claims and a reading, from which kernel,
    exact values, tables, figures and recorded plots follow; a config; a test. With --step the filters are functions of
    one plot and may be nonlinear. Comments `Yours: …` mark the places to edit. Once installed, the study works like
    the shipped ones, which are examples of studies in several files. Nothing is ever overwritten.

    \b
    Example
      radarsim new-study my_paper
      pip install -e my_paper
      radarsim run my_paper
    """
    from radarsim.api.maintenance.new_study import new_study as write
    from radarsim.cli import console

    path = write(name, form="step" if step else "linear")
    values = {"path": str(path), "name": name, "guide": str(path / "src" / name / "__init__.py")}
    console.print_field("package", str(path))
    console.print_field(
        "", tr("`pip install -e {path}`, then `radarsim run {name}`; {guide} explains what to edit", **values)
    )
