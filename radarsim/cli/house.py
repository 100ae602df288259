"""Commands about the house itself. Heavy imports wait inside the commands."""

import click

from radarsim.cli.group import main


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
