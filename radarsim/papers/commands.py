"""The commands `claims` and `interpretations`. Heavy imports are inside the commands."""

from typing import Any

import click

from radarsim.cli import command_group, options


@command_group.main.command()
@click.argument("names", nargs=-1, metavar="[CONFIG | CLAIM | PAPER …]", shell_complete=options.complete_config)
@options.out_option
@click.option("--also", metavar="FILE", help="Also judge claims of yours, in YAML, on the stored run of each CONFIG.")
@options.json_option
@click.option("--markdown", is_flag=True, help="Print the page of claims in Markdown instead of text.")
@click.option("--parts", is_flag=True, help="Also print what was measured for each claim.")
@click.option(
    "--figure",
    metavar="FILE",
    help="Also draw the claims to this file, as distances from the papers' words in margins.",
)
def claims(
    names: tuple[str, ...], out: str, also: str | None, as_json: bool, markdown: bool, figure: str | None, parts: bool
) -> None:
    """List the papers' claims with their verdicts.

    Computes nothing. For a CLAIM (P1.3), prints its full text and what was measured. PAPER is P1, P2, P3 or P4; without
    an argument, all claims are listed. For claims without results, prints the command that would judge them. For a
    CONFIG that is not a paper's experiment, lists the claims that it cannot judge, and why.

    How they are judged stands in docs/verdicts.md: exact values first, each number with a margin, and over every
    interpretation that the paper allows. "refuted as shipped; depends on how the filter starts": false with the choices
    that the config takes where the paper leaves them open, and true with another start.

    \b
    Examples
      radarsim claims range_doppler
      radarsim claims P1                      a line each
      radarsim claims P1.3                    in full, with what was measured
      radarsim claims rls2 --also my_claims.yaml
      radarsim claims --json
      radarsim claims --figure claims.svg
    """
    from radarsim.api import json_output
    from radarsim.papers import list_claims, print_claims

    listed = list_claims.claims(*names, out=out, also=also)
    if figure is not None:
        listed.draw(figure)
    if as_json:
        click.echo(json_output.text(listed.rows))
    elif markdown:
        from radarsim.papers.claims_page import claims_page
        from radarsim.papers.study_claims import paper_claims

        click.echo(claims_page(listed.in_words, {paper.paper: paper.page for paper in paper_claims()}), nl=False)
    else:
        detailed_names = (*names, *listed.own_claims)
        detailed = {row["claim"] for row in listed.rows if parts or row["claim"] in detailed_names}
        print_claims.print_claims(listed.in_words, detailed, out, names)


@command_group.main.command()
@click.argument("names", nargs=-1, metavar="[CLAIM | PAPER …]")
@options.realisations_option
@click.option(
    "--decide",
    is_flag=True,
    help="Extend the runs, up to N realisations, until each claim is decided over all interpretations.",
)
@options.threads_option
@options.time_limit_option
@options.out_option
@options.figures_option
@click.option("-q", "--quiet", is_flag=True, help="Print only errors.")
@options.json_option
@click.option(
    "--markdown", is_flag=True, help="Print the pages docs/interpretations_….md of these papers instead of text."
)
def interpretations(
    names: tuple[str, ...],
    time_limit: float | None,
    no_figures: bool,
    quiet: bool,
    as_json: bool,
    markdown: bool,
    **options: Any,
) -> None:
    """Judge claims under every interpretation of the paper.

    A paper leaves choices open: how a filter starts, which flight, which of two printed numbers. Each claim is judged
    under all of them: exactly where possible, otherwise by small runs, which are stored and can be continued. E and U
    interpretations (equivalent, unstated) decide how robust a verdict is; N (against the print) shows what would have
    to change. PAPER is P1, P2, P3 or P4; default: all. Writes DIR/interpretations/interpretations.csv and a
    specification curve for each claim.

    \b
    Examples
      radarsim interpretations P1
      radarsim interpretations P1.4                          with every interpretation of this claim
      radarsim interpretations P2 -n 200 --threads 2         a quick look; a larger N continues it
      radarsim interpretations P2 --decide -n 3.2e4          up to 32 000 realisations; undecided claims: exit code 3
      radarsim interpretations P1 --json | jq '.[] | select(.depends_on != [])'
    """
    from radarsim.engine import stop_conditions
    from radarsim.errors import TargetUnmet

    limit = stop_conditions.TimeLimit(time_limit) if time_limit else None
    with stop_conditions.Signals() as stop:
        from radarsim.api import json_output
        from radarsim.cli import progress as cli_progress
        from radarsim.papers import interpretation_files, judge_interpretations, print_claims

        options |= {"time_limit": limit, "figures": not no_figures, "stop": stop}
        with cli_progress.TimedProgress("interpretations", quiet=quiet or as_json or markdown) as progress:
            verdicts = judge_interpretations.interpretations(*names, progress=progress.update, **options)
        if as_json:
            click.echo(json_output.text(interpretation_files.json_documents(verdicts)))
        elif markdown:
            click.echo(interpretation_files.markdown_pages(verdicts), nl=False)
        elif not quiet:
            print_claims.print_interpretations(verdicts, detailed=any("." in name for name in names))
        if verdicts.undecided_messages:
            raise TargetUnmet(*verdicts.undecided_messages)
