"""The group of commands `radarsim`: their sections in the help, their modules, and how they end.

A module of commands is imported when one of its commands is called or shown."""

import functools
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click

import radarsim
from radarsim.cli.early_end import NO_THREAD, fail, file_error, stop_on_signals
from radarsim.cli.options import language_option
from radarsim.errors import AUTHOR_ERRORS, ON_COMMAND_LINE, ConfigError, RadarsimError
from radarsim.extensions import extensions
from radarsim.language import current

CREATE, DESIGN, HAND_OVER = "radarsim.cli.create", "radarsim.cli.design", "radarsim.cli.hand_over"
MAINTENANCE, RESULTS, RUN = "radarsim.cli.maintenance", "radarsim.cli.results", "radarsim.cli.run"
SECTIONS: Mapping[str, Mapping[str, str]] = {  # of `radarsim --help`: commands and their modules; extensions add theirs
    "A question": {
        "list": MAINTENANCE,
        "check": RUN,
        "run": RUN,
        "report": RESULTS,
        "compare": RESULTS,
        "pack": HAND_OVER,
        "export": RESULTS,
    },
    "Your own radar": {
        "new": CREATE,
        "solve": DESIGN,
        "tune": DESIGN,
        "sensitivity": DESIGN,
        "chart": DESIGN,
        "new-study": CREATE,
    },
    "Your own data": {"judge": RESULTS},
    "Upkeep": {"doctor": MAINTENANCE},
}
UNLISTED = dict.fromkeys(("compile", "schema", "clean"), MAINTENANCE)  # named in one line below the sections
OLD_NAMES = {"readings": "interpretations"}  # names of commands in earlier versions, which still work
SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


@functools.cache
def command_sections() -> dict[str, Mapping[str, str]]:
    """Titles of the sections of `radarsim --help`, with commands and their modules: those of extensions come first."""
    sections = dict(SECTIONS)
    for extension in extensions():
        for title, modules in extension.command_sections.items():
            sections[title] = {**modules, **sections.get(title, {})}
    return sections


@functools.cache
def command_modules() -> dict[str, str]:
    """All commands, in the order of `radarsim --help`, with the module that registers each when it is imported."""
    return {name: module for part in (*command_sections().values(), UNLISTED) for name, module in part.items()}


class Commands(click.Group):
    """Commands in the order of their use; faults become lines on stderr and an exit code, never a traceback."""

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Every command takes the language, as the group does."""
        super().add_command(language_option(cmd), name)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if (new_name := OLD_NAMES.get(cmd_name)) is not None:
            click.echo(f"note: `radarsim {cmd_name}` is called `radarsim {new_name}`", err=True)
            cmd_name = new_name
        if (module := command_modules().get(cmd_name)) is not None:
            import_module(module)
        return super().get_command(ctx, cmd_name)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(command_modules())

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(map(len, command_modules()))
        for title, names in command_sections().items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                formatter.write_dl(
                    [(name.ljust(width), command.get_short_help_str(100)) for name, command in commands if command]
                )
        formatter.write_paragraph()
        formatter.write_text(f"Also: {', '.join(UNLISTED)}; `radarsim COMMAND --help` describes each.")

    def invoke(self, ctx: click.Context) -> Any:
        token = ON_COMMAND_LINE.set(True)
        try:
            with stop_on_signals():
                return super().invoke(ctx)
        except RadarsimError as error:
            fail(error)
        except OSError as error:
            fail(file_error(error))
        except AUTHOR_ERRORS as error:
            if error.args == (NO_THREAD,):
                fail(ConfigError("no thread can be started here; --threads 0 needs none"))
            from radarsim.studies.registry import package_error

            if (fault := package_error(error)) is None:
                raise
            fail(fault)
        finally:
            ON_COMMAND_LINE.reset(token)
            for line in current.faults:
                click.echo(line, err=True)
            current.faults.clear()


@click.group(cls=Commands, context_settings=SETTINGS)
@click.version_option(radarsim.__version__, prog_name="radarsim")
@language_option
def main() -> None:
    """Monte-Carlo experiments on radar and sonar track processing.

    An experiment is a YAML file: a sensor, a target, and the filters to compare. radarsim runs 10⁵ and more
    realisations of it and writes σ(k), relative gains with 95 % intervals, figures, a report, and a verdict on the
    papers' claims.

    \b
    Examples
      radarsim run rls2                          the first paper's decimetre radar
      radarsim run rls2 --set radar.sigma_velocity_mps=5 -n 1e6
      radarsim claims                            the papers' claims and their verdicts
      radarsim new mine --like rls2              a radar of your own
      radarsim solve rls2 radar.sigma_velocity_mps --gain r --at 60 --equals 30

    NO_COLOR=1 switches off colours. Tab completes commands, options and configs after `eval
    "$(_RADARSIM_COMPLETE=bash_source radarsim)"` (bash; or zsh_source, fish_source).
    """
