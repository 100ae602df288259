"""The commands that compare stored results and judge the papers' claims under every reading."""

from typing import Any

import click

from radarsim.cli import group


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
    from radarsim.app import documents, python
    from radarsim.cli import outcomes

    if len(sources) < 2:
        raise click.UsageError(f"compare takes two results or more, got {len(sources)}")
    compared = python.compare(*sources, out=out, **drawing.arguments)
    if as_json:
        click.echo(documents.text(documents.compared(compared)))
    else:
        outcomes.print_comparison(compared)


@group.main.command()
@click.argument("names", nargs=-1, metavar="[CLAIM | PAPER …]")
@group.realisations_option
@click.option(
    "--only", "only", multiple=True, metavar="CHOICE=VALUE", help="Use only readings with this choice; writes no file."
)
@click.option(
    "--decide",
    is_flag=True,
    help="Extend the runs, up to N realisations, until each claim is decided over all readings.",
)
@group.threads_option
@group.time_limit_option
@group.out_option
@group.figures_option
@click.option("-q", "--quiet", is_flag=True, help="Print only errors.")
@group.json_option
@click.option("--markdown", is_flag=True, help="Print the pages docs/readings_….md of these papers instead of text.")
def readings(
    names: tuple[str, ...],
    realisations: int | None,
    only: tuple[str, ...],
    decide: bool,
    threads: int | None,
    time_limit: float | None,
    out: str,
    no_figures: bool,
    quiet: bool,
    as_json: bool,
    markdown: bool,
) -> None:
    """Judge claims under every reading that the paper allows.

    A paper leaves choices open: how a filter starts, which flight, which of two printed numbers. Each claim is judged
    under all of them: exactly where possible, otherwise by small runs, which are stored and can be continued. E and U
    readings (equivalent, unstated) decide how robust a verdict is; N (against the print) shows what would have to
    change. PAPER is P1, P2, P3 or P4; default: all. Writes DIR/readings/readings.csv and a specification curve for each
    claim. For whole papers it also searches for the choices that reproduce most of the printed numbers.

    \b
    Examples
      radarsim readings P1
      radarsim readings P1.4                          with every reading of this claim
      radarsim readings P2 -n 200 --threads 2         a quick look; a larger N continues it
      radarsim readings P2 --decide -n 3.2e4          up to 32 000 realisations; undecided claims: exit code 3
      radarsim readings P1.4 --only start=unweighted
      radarsim readings P1 --json | jq '.[] | select(.depends_on != [])'
    """
    from radarsim.engine import run
    from radarsim.errors import TargetUnmet

    limit = run.TimeLimit(time_limit) if time_limit else None
    with run.Signals() as stop:
        from radarsim.app import documents, python
        from radarsim.app import readings as app
        from radarsim.cli import console, verdicts

        asked: dict[str, Any] = {"only": only, "realisations": realisations, "decide": decide, "threads": threads}
        asked |= {"time_limit": limit, "out": out, "figures": not no_figures, "stop": stop}
        with console.Progress("readings", quiet=quiet or as_json or markdown) as progress:
            done = python.readings(*names, progress=progress.update, **asked)
        if as_json:
            click.echo(documents.text(app.documents(done)))
        elif markdown:
            click.echo(app.pages(done), nl=False)
        elif not quiet:
            verdicts.print_readings(done, detailed=any("." in name for name in names))
        if done.left:
            raise TargetUnmet(*done.left)
