"""The commands on stored results beside one another, and on the papers' claims under every reading."""

from typing import Any

import click

from radarsim.cli import group


@group.main.command()
@click.argument("sources", nargs=-1, required=True, metavar="A B…", shell_complete=group.completed)
@group.out_option
@group.drawing_options
@group.json_option
def compare(sources: tuple[str, ...], out: str, drawing: group.Drawing, as_json: bool) -> None:
    """Stored runs side by side: differences with intervals.

    Each of A, B, … is a config, whose stored result is read from DIR, or the folder of a result: two radars, two
    configs, two versions of one. Nothing is computed. The first is what the others are compared with. Where both are of
    the same measurements (study, seed, target, sensor) and share their baseline filter, the difference is paired.
    Writes DIR/compare/comparison.csv, compare.html and figures.

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
    "--only", "only", multiple=True, metavar="CHOICE=VALUE", help="Readings that take this alone; writes no file."
)
@click.option(
    "--decide",
    is_flag=True,
    help="Longer runs, of at most N realisations, until each claim is decided over all readings.",
)
@group.threads_option
@group.time_limit_option
@group.out_option
@group.figures_option
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@group.json_option
@click.option("--markdown", is_flag=True, help="The pages docs/readings_….md of these papers, in place of text.")
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
    """A verdict under every reading that the paper allows.

    A paper leaves choices open: how a filter starts, which flight, which of two printed numbers. Each claim is judged
    under all of them, exactly where that is possible, else by small runs that are stored and continued. E and U
    readings (equivalent, unstated) decide how robust a verdict is; N (against the print) shows what would have to be
    changed. PAPER is P1, P2, P3 or P4; without any, all. Writes DIR/readings/readings.csv and a specification curve a
    claim; of whole papers it also searches for the choices that give most of the printed numbers.

    \b
    Examples
      radarsim readings P1
      radarsim readings P1.4                          with every reading of this claim
      radarsim readings P2 -n 200 --threads 2         a quick look; the same with more continues
      radarsim readings P2 --decide -n 3.2e4          as long as it takes, up to 32 000; what is left: exit code 3
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
