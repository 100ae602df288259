"""Options and parameter types that commands share."""

import contextlib
import functools
import math
import os
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from radarsim.cli.early_end import fail
from radarsim.errors import ConfigError
from radarsim.language import current
from radarsim.system.threads import ThreadLimit

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


class Count(click.ParamType):
    """A whole number that may be written 1e5."""

    name = "N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        text = str(value)
        try:
            number = float(text) if text.isascii() and "_" not in text else float("nan")
        except ValueError:
            number = float("nan")
        if not number.is_integer() or number < 0:
            self.fail(f"must be a whole number such as 1000 or 1e5, got {value!r}", param, ctx)
        return int(text) if text.isdigit() else int(number)


class Span(click.ParamType):
    """Two whole numbers FIRST:STOP; STOP is one beyond the last."""

    name = "FIRST:STOP"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        first, _, stop = str(value).partition(":")
        try:
            span = Count().convert(first, None, None), Count().convert(stop, None, None)
        except click.BadParameter:
            span = 0, 0
        if span[0] >= span[1]:
            self.fail(f"must be FIRST:STOP with FIRST < STOP, such as 0:1000, got {value!r}", param, ctx)
        return span


class Positive(click.ParamType):
    """A finite number above zero, and up to `maximum`."""

    def __init__(self, name: str, maximum: float = math.inf):
        self.name, self.maximum = name, maximum

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (0 < number <= self.maximum and math.isfinite(number)):
            bound = f" and ≤ {self.maximum:g}" if math.isfinite(self.maximum) else ""
            self.fail(f"must be a number > 0{bound}, got {value!r}", param, ctx)
        return number


class Directory(click.ParamType):
    """The name of a directory, which need not exist; an empty name would mean the working directory."""

    name = "DIR"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        if not value:
            self.fail("must name a directory, got ''", param, ctx)
        return str(value)


class Share(click.ParamType):
    """Which share of how many: 2/3."""

    name = "i/n"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", value, re.ASCII)
        if not match or not 1 <= int(match[1]) <= int(match[2]):
            self.fail(f"must be i/n with i from 1 to n, such as 2/3, got {value!r}", param, ctx)
        return int(match[1]), int(match[2])


def _set_language(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    """Choose the language of this run and of the processes that it starts; refuse one that is not known."""
    try:
        if value is not None:
            os.environ[current.VARIABLE] = current.check_language(value, "--language")
        current.current_language()
    except ConfigError as error:
        fail(error)


language_option = click.option(
    "--language",
    metavar="|".join(current.language_codes()),
    expose_value=False,
    is_eager=True,
    callback=_set_language,
    help="Language of figures, reports, answers and claims; the same as RADARSIM_LANGUAGE. Tables do not change.",
)


def complete_config(ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":
    """Completions for a config on the command line: available stems, YAML files, and folders."""
    from click.shell_completion import CompletionItem

    from radarsim.api.configs import config_stems

    folder, prefix = os.path.split(incomplete)
    completions = [CompletionItem(stem) for stem in config_stems() if not folder and stem.startswith(prefix)]
    with contextlib.suppress(OSError), os.scandir(folder or ".") as entries:
        for entry in sorted(entries, key=lambda directory_entry: directory_entry.name):
            if entry.name.startswith(prefix) and (prefix.startswith(".") or not entry.name.startswith(".")):
                path = os.path.join(folder, entry.name)
                if entry.is_dir():
                    completions.append(CompletionItem(path, type="dir"))
                elif entry.name.endswith(".yaml"):
                    completions.append(CompletionItem(path))
    return completions


def _refuse_code(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Refuse code of the user's in configs, here and in the processes that this one starts."""
    if value:
        os.environ["RADARSIM_NO_CODE"] = "1"


def config_parameter(name: str, **settings: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The argument of a command that takes configs, and the option that refuses code in them."""
    help_text = "Refuse configs with filters of your own code (`python: FILE.py:NAME`); the same as RADARSIM_NO_CODE=1."
    flag = click.option(
        "--no-code", is_flag=True, expose_value=False, is_eager=True, callback=_refuse_code, help=help_text
    )
    return lambda command: click.argument(name, shell_complete=complete_config, **settings)(flag(command))


configs_argument = config_parameter("configs", nargs=-1, required=True, metavar="CONFIG…")
config_argument = config_parameter("config", metavar="CONFIG")
out_option = click.option(
    "--out", type=Directory(), default="results", show_default=True, metavar="DIR", help="Directory of the results."
)
set_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a key, given by its dotted path; repeatable.",
)
realisations_option = click.option(
    "-n", "--realisations", type=Count(), metavar="N", help="Number of realisations, such as 1e5; overrides the config."
)
seed_option = click.option("--seed", type=Count(), metavar="S", help="Seed of the noise; overrides the config.")
precision_option = click.option(
    "--precision",
    type=Positive("PCT", maximum=100),
    metavar="PCT",
    help="Run until the 95 % half-width of every σ is under PCT %, at most N realisations. Checked at "
    "2000, 4000, 8000, …, N; where errors are not Gaussian, from 64,000 on.",
)
time_limit_option = click.option(
    "--time-limit", type=Positive("SECONDS"), metavar="SECONDS", help="Stop after this time and keep finished work."
)


def _apply_threads(context: click.Context, option: click.Parameter, count: int | None) -> int | None:
    """The number of threads, for the whole command."""
    context.with_resource(ThreadLimit(count))
    return count


threads_option = click.option(
    "--threads",
    type=click.IntRange(0, 1024),
    metavar="T",
    callback=_apply_threads,
    is_eager=True,
    help="Number of threads; default: all cores. 0: no further thread is started.",
)
PHRASE_HELP = (
    "What is asked: 'sigma r at 60 s', 'worst sigma r' (from the manoeuvre on, or once settled), 'mean sigma r from 60 "
    "s', 'sigma r in the long run', 'gain of Vr at the end', 'lock at k 6'."
)
phrase_option = click.option("--for", "wanted", metavar="TEXT", help=PHRASE_HELP)
required_phrase_option = click.option("--for", "wanted", metavar="TEXT", required=True, help=PHRASE_HELP)
quantity_option = click.option(
    "--of",
    metavar="NAME",
    default="sigma",
    help="Quantity that --precision applies to; default: sigma. Also gain (in points), or another "
    "quantity of the study, as `radarsim solve --help` lists them (lock, false_tracks).",
)
phrase_of_precision_option = click.option(
    "--for", "phrase", metavar="TEXT", help=f"What --precision applies to, in place of --of. {PHRASE_HELP}"
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of text.")
format_option = click.option(
    "--format",
    "formats",
    type=click.Choice(["svg", "png", "pdf"]),
    multiple=True,
    help="File format of the figures; repeatable; default: svg.",
)
width_option = click.option(
    "--width",
    "width_mm",
    type=click.Choice(["85", "120", "175"]),
    callback=lambda _context, _option, chosen: None if chosen is None else float(chosen),
    metavar="85|120|175",
    help="Width of the figures, mm; text keeps its size. Default: each figure's own width.",
)

replace_option = click.option(
    "--replace", is_flag=True, help="Replace tables of other settings, another seed or more realisations."
)
figures_option = click.option("--no-figures", is_flag=True, help="Draw no figures; tables and report only.")


class Drawing(NamedTuple):
    """In which formats a command draws figures, none with --no-figures, and how wide."""

    formats: tuple[str, ...]
    width_mm: float | None

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments for functions that draw."""
        return {"figures": self.formats, "width_mm": self.width_mm}


def drawing_options(command: Callable[..., None]) -> Callable[..., None]:
    """--no-figures, --format and --width, passed to the command together as `drawing`."""

    @functools.wraps(command)
    def command_with_drawing(
        no_figures: bool, formats: tuple[str, ...], width_mm: float | None, **arguments: Any
    ) -> None:
        command(drawing=Drawing(() if no_figures else formats or ("svg",), width_mm), **arguments)

    return figures_option(format_option(width_option(command_with_drawing)))
