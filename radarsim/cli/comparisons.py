"""The command that puts stored results side by side. Heavy imports wait inside it."""

import click

from radarsim.cli import group


@group.main.command()
@click.argument("sources", nargs=-1, required=True, metavar="A B…", shell_complete=group.completed)
@group.out_option
@group.drawing_options
@group.json_option
def compare(sources: tuple[str, ...], out: str, drawing: group.Drawing, as_json: bool) -> None:
    """Runs side by side on common axes: differences with intervals; computes nothing.

    Each of A, B, … is a config, whose stored result is read from DIR, or the folder of a result: two radars, two
    configs, two versions of one. The first is what the others are compared with. Where both are of the same
    measurements (study, seed, target, sensor) and share their baseline filter, the difference is paired. Writes
    DIR/compare/comparison.csv, compare.html and figures.

    \b
    Examples
      radarsim compare rls2 rls4
      radarsim compare rls2.yaml mine.yaml --json
      radarsim compare results/rls2 results-before/rls2
    """
    from radarsim.app import compare as comparing
    from radarsim.app import documents
    from radarsim.cli import outcomes

    if len(sources) < 2:
        raise click.UsageError(f"compare takes two results or more, got {len(sources)}")
    compared = comparing.compare(sources, out, formats=drawing.formats, width_mm=drawing.width_mm)
    if as_json:
        click.echo(documents.text(documents.fields(compared)))
    else:
        outcomes.print_comparison(compared)
