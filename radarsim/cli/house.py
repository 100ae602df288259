"""Commands about the house itself. Heavy imports wait inside the commands."""

import click

from radarsim.cli.group import json_option, main


@main.command(name="list")
@json_option
def list_(as_json):
    """Configs, scenarios, studies and filters at hand.

    \b
    Examples
      radarsim list
      radarsim list --json | jq -r '.configs[].name'
    """
    from radarsim import console, documents, overview

    if as_json:
        click.echo(documents.text(documents.inventory(overview.inventory())))
    else:
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
