"""Commands for upkeep: list, doctor, clean and the like. Heavy imports are inside the commands."""

import click

from radarsim.cli.command_group import main
from radarsim.cli.options import Count, json_option, out_option, seed_option, set_option
from radarsim.errors import NotChecked, StoreError


@main.command(name="list")
@click.argument("words", nargs=-1, metavar="[WORD…]")
@json_option
def list_(words: tuple[str, ...], as_json: bool) -> None:
    """List configs, scenarios, studies and filters.

    Prints their names on one screen. With WORD, prints a line on each match: configs, scenarios, studies or filters, a
    paper (P2), or text in a name or line. Many variants of a config share its line, unless its name is given.

    \b
    Examples
      radarsim list
      radarsim list configs
      radarsim list P2
      radarsim list sonar clutter
      radarsim list --json | jq -r '.configs[].name'
    """
    from radarsim.api.inventory import filter_inventory, fold_families, inventory

    matches = filter_inventory(inventory(), words)
    if as_json:
        from radarsim.api import json_output

        click.echo(json_output.text(json_output.inventory(matches)))
        return
    from radarsim.cli import print_inventory

    print_inventory.print_inventory(*fold_families(matches, words)) if words else print_inventory.print_names(matches)


@main.command()
def schema() -> None:
    """Print the JSON Schema of the YAML, for editors.

    \b
    Example
      radarsim schema > schema.json     editors then check what `radarsim new` writes beside it
    """
    from radarsim.api.configs import schema_json

    click.echo(schema_json(), nl=False)


@main.command(name="compile")
@click.argument("configs", nargs=-1, metavar="[CONFIG…]")
@json_option
def compile_(configs: tuple[str, ...], as_json: bool) -> None:
    """Compile kernels now, ahead of the first run.

    Without CONFIG, compiles the kernels of all shipped configs. The machine code is kept for this processor; `radarsim
    doctor` shows where. After an installation or an upgrade this takes about a minute of CPU time, otherwise almost
    none; a line for each config gives the time.

    \b
    Examples
      radarsim compile
      radarsim compile sonar_clutter
    """
    from radarsim.api import json_output
    from radarsim.api.maintenance.precompile import compile_configs

    timings = []
    for timing in compile_configs(configs):
        timings.append(timing._asdict())
        if not as_json:
            click.echo(f"{timing.config}  {timing.seconds:.1f} s")
    if as_json:
        click.echo(json_output.text(timings))


@main.command()
@click.argument("result", required=False, metavar="[RESULT]")
@click.option(
    "--recompute", type=Count(), default=0, metavar="N", help="Recompute N pieces of each case; compare tables."
)
@json_option
def doctor(result: str | None, recompute: int, as_json: bool) -> None:
    """Test this machine, or check that a stored RESULT is intact.

    RESULT is a folder such as results/rls2. Every output is checked against run.json, every stored block against its
    checksum, every total against its blocks. --recompute recomputes the N smallest pieces of each case, or a case
    without usable blocks from the config, and compares the tables. If there is damage, each file is named and the exit
    code is 4: `radarsim run` computes what is missing, `radarsim report` rewrites tables. What could not be checked is
    said last: exit code 3.

    \b
    Examples
      radarsim doctor
      radarsim doctor results/rls2 --recompute 3
    """
    if recompute and result is None:
        raise click.UsageError("--recompute needs a RESULT: a folder such as results/rls2")
    from radarsim.api import json_output, run_facts
    from radarsim.api.maintenance import doctor as maintenance_doctor
    from radarsim.api.maintenance import self_test
    from radarsim.cli import console, print_inventory, progress

    not_checked: list[str] = []
    if result is None:
        facts = maintenance_doctor.machine()
        if not as_json:
            console.print_facts(facts)
        verdicts = self_test.verdicts()
        if as_json:
            click.echo(json_output.text({**facts, "self-test": [json_output.fields(verdict) for verdict in verdicts]}))
        else:
            console.print_facts({f"self-test {verdict.study}": verdict.words for verdict in verdicts})
        console.print_warnings(run_facts.cache_troubles())
        faults = [f"self-test: {verdict.study}: {verdict.words}" for verdict in verdicts if not verdict.good]
    else:
        with progress.Progress("doctor", quiet=as_json) as bar:
            inspection = maintenance_doctor.inspect_result(result, recompute, bar.update)
        not_checked = inspection.not_checked
        if as_json:
            click.echo(json_output.text(json_output.fields(inspection)))
        else:
            print_inventory.print_inspection(inspection)
        faults = inspection.faults
    if faults:
        raise StoreError(*faults)
    if not_checked:
        raise NotChecked(f"tables agree with their record; {'; '.join(not_checked)}")


@main.command()
@click.argument("configs", nargs=-1, metavar="[CONFIG…]")
@seed_option
@set_option
@out_option
@click.option("--other-sources", is_flag=True, help="Delete only blocks that an edited or other version made.")
@click.option("--dry-run", is_flag=True, help="Delete nothing; print how much would be deleted.")
@json_option
def clean(
    configs: tuple[str, ...],
    seed: int | None,
    overrides: tuple[str, ...],
    out: str,
    other_sources: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Delete stored blocks; tables, figures and reports stay.

    Without CONFIG, deletes all blocks under DIR/.blocks, including those of older configs and versions. With
    --other-sources, deletes those that this version would compute anew, as after an edit: without CONFIG of the results
    in DIR, except where filters of your own code would have to run for it. Nothing else is changed.

    \b
    Examples
      radarsim clean --dry-run
      radarsim clean rls2 --out results
      radarsim clean --other-sources
      radarsim clean mine.yaml --other-sources
    """
    from radarsim.api import json_output, load_experiments
    from radarsim.api.maintenance import clean as maintenance_clean
    from radarsim.cli import print_inventory

    if not configs and (overrides or seed is not None):
        raise click.UsageError("--set and --seed need a CONFIG")
    chosen = (
        load_experiments.load_all(configs, load_experiments.combine_overrides(overrides, None, seed))
        if configs
        else None
    )
    cleaned = maintenance_clean.clean(out, chosen, dry_run, other_sources)
    if as_json:
        click.echo(json_output.text(json_output.fields(cleaned) | {"dry_run": dry_run}))
    else:
        print_inventory.print_removed_blocks(cleaned, dry_run)
