"""The commands on a design: solve, tune, sensitivity, chart. Heavy imports are inside the commands."""

import functools
import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from radarsim.cli import command_group, options

if TYPE_CHECKING:
    from radarsim.report.quantities import Quantity

QUANTITY_PREFIX = "of_"  # of the parameters' names that quantities' options have


class NameOption(click.ParamType):
    """A name after an option; never the next option, which click would accept and then fail on the rest."""

    def __init__(self, metavar: str):
        self.name = metavar

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        text = str(value)
        if text.startswith("--"):
            filters = ", of the filter itself, without --filter" if self.name == "NAME" else ""
            self.fail(f"must be followed by a {self.name}{filters}, got {text}", param, ctx)
        return text


class QuantityCommand(click.Command):
    """A command with an option for each quantity that a study measures, shipped or installed."""

    @functools.cached_property
    def quantity_options(self) -> dict[str, click.Option]:
        """Those options, by the quantity's name."""
        from radarsim.studies import registry

        studies_by_quantity: dict[str, dict[str, Quantity]] = {}
        quantities_by_study = registry.call_studies(lambda study: registry.study_quantities(study, None))
        for study_name, quantities in quantities_by_study.items():
            for quantity in quantities:
                studies_by_quantity.setdefault(quantity.name, {})[study_name] = quantity
        study_count = len(registry.study_names())
        return {name: _option(by_study, len(by_study) == study_count) for name, by_study in studies_by_quantity.items()}

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        return [*super().get_params(ctx), *self.quantity_options.values()]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, params in (("Quantities", self.quantity_options.values()), ("Options", super().get_params(ctx))):
            with formatter.section(title):
                options = [param for param in params if isinstance(param, click.Option)]
                formatter.write_dl([record for option in options if (record := option.get_help_record(ctx))])


def _option(by_study: "Mapping[str, Quantity]", in_all_studies: bool) -> click.Option:
    """The option of a quantity, by the studies that measure it."""
    first_quantity = next(iter(by_study.values()))
    (metavar, *other_metavars) = dict.fromkeys(quantity.per.upper() or "NAME" for quantity in by_study.values())
    metavar = "NAME" if other_metavars else metavar
    studies: dict[str, list[str]] = {}
    for study, quantity in by_study.items():
        unit = quantity.shown_unit("in the component's unit" if quantity.per == "component" else "")
        studies.setdefault(unit and f", {unit}", []).append(study)
    unit_texts = [
        unit if in_all_studies and len(studies) == 1 else f"{unit} ({', '.join(names)})"
        for unit, names in studies.items()
    ]
    words = (
        first_quantity.words[0].upper() + first_quantity.words[1:]
        if first_quantity.words[0].isascii()
        else first_quantity.words
    )
    text = f"{words}{''.join(unit_texts)}."
    return click.Option(
        [first_quantity.option, f"{QUANTITY_PREFIX}{first_quantity.name}"],
        type=NameOption(metavar),
        metavar=metavar,
        help=text,
    )


at_options = (
    click.option("--at", "at_s", type=float, metavar="S", help="Time, s; default: the last scan."),
    click.option("--at-k", type=click.IntRange(1), metavar="K", help="Scan, counted from 1, instead of --at."),
)


@command_group.main.command(cls=QuantityCommand)
@options.config_argument
@click.argument("key", metavar="KEY")
@options.phrase_option
@click.option("--filter", "filter_name", metavar="NAME", help="The filter, if there are several.")
@at_options[0]
@at_options[1]
@click.option("--equals", type=float, required=True, metavar="X", help="Target value; in per cent for gains and rates.")
@click.option("--between", type=(float, float), metavar="LO HI", help="Range of KEY to search.")
@click.option("--case", metavar="CASE", help="The case, if the config has several.")
@options.set_option
@options.realisations_option
@options.seed_option
@options.threads_option
@options.json_option
def solve(config: str, key: str, filter_name: str | None, as_json: bool, **values: Any) -> None:
    """Find the value of KEY at which a quantity reaches a target.

    The quantity is said by --for, or by an option of its own with --at. KEY is any key that holds a number, by its
    dotted path as for --set; a bare filter key applies to all filters. If the quantity is known exactly (linear
    filters), the answer is exact. Otherwise each value is simulated with the same noise, and the answer has a 95 %
    interval. If the target is not attainable, the nearest attainable value is printed, and that of the long run;
    the exit code is 3. A positive key is searched from a thousandth to a thousand times its value, unless --between is
    given.

    \b
    Examples
      radarsim solve rls2 radar.sigma_velocity_mps --for "gain r at 60 s" --filter r+Vr --equals 30
      radarsim solve rls2 radar.sigma_velocity_mps --for "sigma r in the long run" --filter r+Vr --equals 120
      radarsim solve rls2 radar.scan_period_s --sigma Vr --filter r --at 60 --equals 5
      radarsim solve discriminator burst.noise_variance --lock sequence --equals 95 -n 1000
      radarsim solve sonar_clutter sensor.detection_probability --loss nearest --equals 5 --between 0.6 1 \\
          --case "sonar_clutter sensor.false_plots_per_km2=1" -n 2000
    """
    from radarsim.api import json_output
    from radarsim.api.design import solve as design_solve
    from radarsim.cli import console, print_answers
    from radarsim.cli import progress as cli_progress
    from radarsim.errors import TargetUnmet

    arguments = {name.removeprefix(QUANTITY_PREFIX): value for name, value in values.items()} | {"filter": filter_name}
    with cli_progress.Progress(key, quiet=as_json) as progress:
        notify = None if as_json else console.print_error_line
        answer = design_solve.solve(config, key, progress=progress.update, notify=notify, **arguments)
    if as_json:
        click.echo(json_output.text(json_output.answer(answer)))
    elif answer.value is not None:
        print_answers.print_answer(answer)
    if answer.value is None:
        raise TargetUnmet(*answer.unattained)


@command_group.main.command()
@options.config_argument
@click.option("--filter", "filter_name", metavar="NAME", help="The filter, if there are several.")
@options.required_phrase_option
@click.option(
    "--free",
    multiple=True,
    metavar="KEY[=LOW:HIGH]",
    help="Key of the filter to tune, and its range; repeatable. Default: real numbers with an effect, not zero.",
)
@click.option(
    "--over",
    multiple=True,
    metavar="SCENARIO|KEY=VALUE",
    help="One of a family of targets; repeatable. Default: the config's cases.",
)
@click.option("--case", multiple=True, metavar="CASE", help="One of the config's cases; repeatable. Default: all.")
@options.set_option
@options.realisations_option
@options.seed_option
@options.threads_option
@click.option("--write", metavar="FILE.yaml", help="Also write a config with the tuned values.")
@options.json_option
def tune(config: str, filter_name: str | None, wanted: str, write: str | None, as_json: bool, **arguments: Any) -> None:
    """Find the best values of a filter's keys, and the gain.

    The quantity is one of `radarsim solve`. Over several cases the root of the mean of σ², or the mean of a rate, is
    brought to its best. Several searches start over the whole range. If σ is known exactly, so is the answer. Otherwise
    values are compared on the same noise, the best search is chosen on other noise, and the gain is measured on
    realisations that neither has used, with the stated and the tuned filter on the same plots. Whole numbers are tried
    one by one; elements of a transition matrix keep columns that sum to one.

    \b
    Examples
      radarsim tune rls2 --filter r+Vr --for "sigma r at 60 s" --over turn --over jerk_pulse
      radarsim tune rls2_manoeuvres --filter r+Vr --for "worst sigma r" --free initial_scans=2:7
      radarsim tune multimodel --filter MMA2-11 --for "sigma y at 60 s" --free models -n 500
    """
    from radarsim.api import json_output, new_configs
    from radarsim.api.design import tune as design_tune
    from radarsim.cli import console, print_answers
    from radarsim.cli import progress as cli_progress
    from radarsim.report import output_labels

    if write:
        new_configs.check_writable(write, config, arguments["overrides"])
    with cli_progress.Progress(config, quiet=as_json) as progress:
        notify = None if as_json else console.print_error_line
        arguments |= {"filter": filter_name, "progress": progress.update, "notify": notify}
        result = design_tune.tune(config, wanted, **arguments)
    if as_json:
        click.echo(json_output.text(json_output.tuning(result)))
    else:
        print_answers.print_tuning(result)
    if write:
        path = pathlib.Path(write)
        config_path = new_configs.write_new_config(
            path.name, config, path.parent, result.settings, arguments["overrides"]
        )
        click.echo(output_labels.labelled_line("config", str(config_path)), err=as_json)


@command_group.main.command()
@click.argument("configs", nargs=-1, metavar="[CONFIG…]", shell_complete=options.complete_config)
@options.set_option
@options.out_option
@options.drawing_options
@options.json_option
def chart(configs: tuple[str, ...], drawing: options.Drawing, as_json: bool, **arguments: Any) -> None:
    """Chart the gain by Doppler for all radars, yours marked.

    Simulates nothing. Draws gains over time and in the long run against c = (σ_r/σ_V)² (D_M/σ_r²)^(1/3), the only
    parameter that matters for a short scan period, and a map that includes the period. Prints where each case of CONFIG
    lies. Also writes DIR/chart/chart.html, a page with sliders that computes σ(k) and gains of any radar.

    \b
    Examples
      radarsim chart                              the first paper's five radars
      radarsim chart rls2 --set radar.sigma_velocity_mps=5
    """
    from radarsim.api import doppler_chart, json_output
    from radarsim.cli import print_answers
    from radarsim.cli import progress as cli_progress

    with cli_progress.Progress("chart", quiet=as_json) as progress:
        result = doppler_chart.chart(*configs, progress=progress.update, **arguments, **drawing.arguments)
    if as_json:
        click.echo(json_output.text(json_output.doppler_chart(result)))
    else:
        print_answers.print_doppler_chart(result)


@command_group.main.command()
@options.config_argument
@options.phrase_option
@at_options[0]
@at_options[1]
@click.option("--of", metavar="NAME", help="Quantity (`radarsim solve --help` lists them); default: σ and gain.")
@click.option("--component", metavar="COMPONENT", help="The component shown and used for sorting; default: the first.")
@click.option("--case", metavar="CASE", help="The case, if the config has several.")
@options.set_option
@options.realisations_option
@options.seed_option
@options.out_option
@options.drawing_options
@options.json_option
def sensitivity(config: str, drawing: options.Drawing, as_json: bool, **arguments: Any) -> None:
    """Show what +10 % of each key changes, largest effect first.

    Prints changes of σ and gain, or of another quantity. Every numeric key is raised by a tenth, one at a time; whole
    numbers by at least one; a key that cannot grow, such as a probability of 1, is lowered and marked −10 %. Changes
    are exact if the quantity is known exactly; otherwise they are paired, with the same noise, and have 95 % intervals.
    All filters and components are in DIR/sensitivity/CONFIG/sensitivity.csv; tornado.svg beside it shows the first
    component.

    \b
    Examples
      radarsim sensitivity rls2
      radarsim sensitivity rls2 --for "sigma Vr at 60 s"
      radarsim sensitivity discriminator --of lock -n 2000
    """
    from radarsim.api import json_output
    from radarsim.api.design import sensitivity as design_sensitivity
    from radarsim.cli import print_answers
    from radarsim.cli import progress as cli_progress

    with cli_progress.Progress(config, quiet=as_json) as progress:
        result = design_sensitivity.sensitivity(config, progress=progress.update, **arguments, **drawing.arguments)
    if as_json:
        click.echo(json_output.text(json_output.sensitivity(result)))
    else:
        print_answers.print_sensitivity(result)
