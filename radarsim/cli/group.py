"""The group of commands: the options, faults and exit codes that all share."""

import contextlib
import functools
import math
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click

import radarsim
from radarsim import language
from radarsim.errors import OF_AUTHORS, ON_COMMAND_LINE, ConfigError, Interrupted, RadarsimError, StoreError
from radarsim.extensions import extensions
from radarsim.threads import limited

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

SECTIONS = {  # of commands in `radarsim --help`; extensions add theirs
    "A question": ("list", "check", "run", "report", "compare"),
    "Your own radar": ("new", "solve", "tune", "sensitivity", "chart", "new-study"),
    "Your own data": ("judge",),
    "Upkeep": ("doctor",),
}
UNLISTED = ("compile", "schema", "clean")  # named in one line below the sections
OLD_NAMES = {"readings": "interpretations"}  # names of commands in earlier versions, which still work
NO_THREAD = "can't start new thread"  # in Python's words
PATIENCE_S = 1.0  # from a signal to the end of whatever a command is doing
SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


@functools.cache
def command_sections() -> dict[str, tuple[str, ...]]:
    """Titles of the sections of `radarsim --help`, with their commands: those of extensions come first."""
    sections = dict(SECTIONS)
    for extension in extensions():
        for title, names in extension.command_sections.items():
            sections[title] = (*names, *sections.get(title, ()))
    return sections


class Commands(click.Group):
    """Commands in the order of their use; faults become lines on stderr and an exit code, never a traceback."""

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Every command takes the language, as the group does."""
        super().add_command(language_option(cmd), name)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if (new_name := OLD_NAMES.get(cmd_name)) is not None:
            click.echo(f"note: `radarsim {cmd_name}` is called `radarsim {new_name}`", err=True)
            cmd_name = new_name
        return super().get_command(ctx, cmd_name)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*(name for names in command_sections().values() for name in names), *UNLISTED]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(map(len, self.commands))
        for title, names in command_sections().items():
            rows = [(name.ljust(width), self.commands[name].get_short_help_str(100)) for name in names]
            with formatter.section(title):
                formatter.write_dl(rows)
        formatter.write_paragraph()
        formatter.write_text(f"Also: {', '.join(UNLISTED)}; `radarsim COMMAND --help` describes each.")

    def invoke(self, ctx: click.Context) -> Any:
        before = ON_COMMAND_LINE.set(True)
        try:
            with stoppable():
                return super().invoke(ctx)
        except RadarsimError as error:
            fail(error)
        except OSError as error:
            fail(file_fault(error))
        except OF_AUTHORS as error:
            if error.args == (NO_THREAD,):
                fail(ConfigError("no thread can be started here; --threads 0 needs none"))
            from radarsim.studies.registry import fault_of

            if (fault := fault_of(error)) is None:
                raise
            fail(fault)
        finally:
            ON_COMMAND_LINE.reset(before)
            for line in language.faults:
                click.echo(line, err=True)
            language.faults.clear()


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """While entered, SIGINT and SIGTERM end a command, and files being written are removed.

    An exception from a handler may be turned into another one on its way, as by an import, or be swallowed, as by the
    finalisers that Python calls at any time; then the process ends at once a little later. Runs, which store their
    results, handle both signals themselves meanwhile. A signal that is ignored (nohup) stays so."""
    numbers = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) is not signal.SIG_IGN]
    if threading.current_thread() is not threading.main_thread():
        numbers = []

    received: list[Interrupted] = []

    def stop(number: int, frame: object) -> NoReturn:
        error = Interrupted(number, goes_on=False)
        received.append(error)
        late = threading.Timer(PATIENCE_S, fail, (error,))
        late.daemon = True
        late.start()
        raise error

    told = sys.unraisablehook

    def silent_of_it(what: "sys.UnraisableHookArgs") -> None:
        """Do not print a handler's exception that Python has to swallow: the process ends a little later."""
        if not isinstance(what.exc_value, Interrupted):
            told(what)

    before = {number: signal.signal(number, stop) for number in numbers}
    sys.unraisablehook = silent_of_it
    try:
        yield
    except Exception:
        if received:
            raise received[0] from None
        raise
    finally:
        sys.unraisablehook = told
        for number, handler in before.items():
            signal.signal(number, handler)


def fail(error: RadarsimError) -> NoReturn:
    """Report a fault, a line each, and leave with its exit code."""
    from radarsim.cli.console import broken

    for line in dict.fromkeys(error.lines):
        for part in broken(line, sys.stderr):
            click.echo(part, err=True)
    if isinstance(error, Interrupted):
        # The interpreter's orderly end takes most of a second, which whoever sent the signal need not wait for.
        os._exit(error.exit_code)
    sys.exit(error.exit_code)


def file_fault(error: OSError) -> StoreError:
    """What a user is told of a file that the system refuses."""
    return StoreError(f"{error.filename or 'a file'}: cannot be read or written: {error.strerror or error}")


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
            found = Count().convert(first, None, None), Count().convert(stop, None, None)
        except click.BadParameter:
            found = 0, 0
        if found[0] >= found[1]:
            self.fail(f"must be FIRST:STOP with FIRST < STOP, such as 0:1000, got {value!r}", param, ctx)
        return found


class Positive(click.ParamType):
    """A finite number above zero, and up to `most`."""

    def __init__(self, name: str, most: float = math.inf):
        self.name, self.most = name, most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (0 < number <= self.most and math.isfinite(number)):
            bound = f" and ≤ {self.most:g}" if math.isfinite(self.most) else ""
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


def _language(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    """Choose the language of this run and of the processes that it starts; refuse one that is not known."""
    try:
        if value is not None:
            os.environ[language.VARIABLE] = language.checked(value, "--language")
        language.current()
    except ConfigError as error:
        fail(error)


language_option = click.option(
    "--language",
    metavar="|".join(language.known()),
    expose_value=False,
    is_eager=True,
    callback=_language,
    help="Language of figures, reports, answers and claims; the same as RADARSIM_LANGUAGE. Tables do not change.",
)


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


def completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":
    """Completions for a config on the command line: available stems, YAML files, and folders."""
    from click.shell_completion import CompletionItem

    from radarsim.app.configs import document as lookup

    folder, begun = os.path.split(incomplete)
    found = [CompletionItem(stem) for stem in lookup.stems("configs") if not folder and stem.startswith(begun)]
    with contextlib.suppress(OSError), os.scandir(folder or ".") as entries:
        for entry in sorted(entries, key=lambda one: one.name):
            if entry.name.startswith(begun) and (begun.startswith(".") or not entry.name.startswith(".")):
                path = os.path.join(folder, entry.name)
                if entry.is_dir():
                    found.append(CompletionItem(path, type="dir"))
                elif entry.name.endswith(".yaml"):
                    found.append(CompletionItem(path))
    return found


def _no_code(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Refuse code of the user's in configs, here and in the processes that this one starts."""
    if value:
        os.environ["RADARSIM_NO_CODE"] = "1"


def of_configs(name: str, **settings: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The argument of a command that takes configs, and the option that refuses code in them."""
    about = "Refuse configs with filters of your own code (`python: FILE.py:NAME`); the same as RADARSIM_NO_CODE=1."
    flag = click.option("--no-code", is_flag=True, expose_value=False, is_eager=True, callback=_no_code, help=about)
    return lambda command: click.argument(name, shell_complete=completed, **settings)(flag(command))


configs_argument = of_configs("configs", nargs=-1, required=True, metavar="CONFIG…")
config_argument = of_configs("config", metavar="CONFIG")
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
    type=Positive("PCT", most=100),
    metavar="PCT",
    help="Run until the 95 % half-width of every σ is under PCT %, at most N realisations. Checked at "
    "2000, 4000, 8000, …, N; where errors are not Gaussian, from 64,000 on.",
)
time_limit_option = click.option(
    "--time-limit", type=Positive("SECONDS"), metavar="SECONDS", help="Stop after this time and keep finished work."
)


def _obeyed(context: click.Context, option: click.Parameter, count: int | None) -> int | None:
    """The number of threads, for the whole command."""
    context.with_resource(limited(count))
    return count


threads_option = click.option(
    "--threads",
    type=click.IntRange(0, 1024),
    metavar="T",
    callback=_obeyed,
    is_eager=True,
    help="Number of threads; default: all cores. 0: no further thread is started.",
)
of_option = click.option(
    "--of",
    metavar="NAME",
    default="sigma",
    help="Quantity that --precision applies to; default: sigma. Also gain (in points), or another "
    "quantity of the study, as `radarsim solve --help` lists them (lock, false_tracks).",
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
    def taking(no_figures: bool, formats: tuple[str, ...], width_mm: float | None, **others: Any) -> None:
        command(drawing=Drawing(() if no_figures else formats or ("svg",), width_mm), **others)

    return figures_option(format_option(width_option(taking)))
