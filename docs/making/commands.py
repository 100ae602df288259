"""Every command as Markdown, from click's own help."""

import click

from radarsim.cli.command_group import main

WIDTH = 110


def markdown() -> str:
    """A heading and the help of the command and of each of its commands, in the order of `radarsim --help`."""
    context = main.make_context("radarsim", [], resilient_parsing=True, terminal_width=WIDTH)
    parts = ["## radarsim", fenced(main.get_help(context))]
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        inner = click.Context(command, info_name=name, parent=context, terminal_width=WIDTH)
        parts += [f"## radarsim {name}", fenced(command.get_help(inner))]
    return "\n\n".join(parts)


def fenced(text: str) -> str:
    """Help as it stands in the terminal."""
    return f"```text\n{text}\n```"
