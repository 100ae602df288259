"""The exceptions that reach the user, each with the exit code of the command."""

from contextvars import ContextVar

ON_COMMAND_LINE = ContextVar("ON_COMMAND_LINE", default=False)  # whether a command gave the arguments, not Python


def argument(name: str, option: str = "") -> str:
    """The name of an argument for its giver: the name in Python; on the command line its option, else `--NAME`.

    >>> argument("at_s", "--at")
    'at_s'
    """
    return (option or f"--{name}") if ON_COMMAND_LINE.get() else name


def count_text(count: float) -> str:
    """A whole number in a message, as answers write it: in groups of three from five digits on.

    >>> count_text(4000), count_text(12000)
    ('4000', '12,000')
    """
    return f"{count:,.0f}" if abs(count) >= 10_000 else f"{count:.0f}"


AUTHOR_ERRORS = Exception, SystemExit  #: what code that is not radarsim's may raise: a package may call sys.exit


class RadarsimError(Exception):
    """Any fault that is reported to the user; `lines` are printed one to a line."""

    exit_code = 1

    def __init__(self, *lines: str):
        super().__init__("\n".join(lines))
        self.lines = lines

    def __reduce__(self) -> tuple[type["RadarsimError"], tuple[object, ...]]:
        return type(self), self.lines


class ConfigError(RadarsimError):
    """The user's input is wrong: a config, an override, an argument, a file of plots."""

    exit_code = 2


class UnknownConfig(ConfigError):
    """No config has this name; the api words it in the language in use.

    meant: the name that is meant, or empty; nearest: else the nearest ones, of so many."""

    def __init__(self, name: str, meant: str, nearest: tuple[str, ...], count: int):
        others = f"the nearest: {', '.join(nearest)}; `radarsim list configs` has all {count}"
        super().__init__(f"{name}: no such config; {f'did you mean {meant}?' if meant else others}")
        self.name, self.meant, self.nearest, self.count = name, meant, nearest, count

    def __reduce__(self) -> tuple[type[RadarsimError], tuple[object, ...]]:
        return type(self), (self.name, self.meant, self.nearest, self.count)


class PlotFault(ConfigError):
    """A row of recorded plots that a filter cannot take, and why; row counts from 0 in the columns that were fed."""

    row = 0


class TargetUnmet(RadarsimError):
    """A precision or time limit ended the run before its target was met."""

    exit_code = 3


class NotChecked(RadarsimError):
    """What was to be checked could not be; nothing else was found wrong."""

    exit_code = 3


class ClusterError(TargetUnmet):
    """The cluster was lost during the run: what was done is stored, the rest is not done."""


class StoreError(RadarsimError):
    """The disk, or results on it, are damaged or cannot be written."""

    exit_code = 4


class DisagreementError(RadarsimError):
    """An exact value and its simulation differ by more than chance allows: one of the two is computed wrongly.

    `result` holds the tables with both, where `radarsim.run` raised it.
    """

    exit_code = 4
    result: object = None


class StudyError(RadarsimError):
    """The code of an installed package failed where its study was used."""


class MeasureError(StudyError):
    """The measure of a claim failed, or gave no number; the tables do not depend on it."""

    result: object = None


class NonFiniteError(RadarsimError):
    """A filter gave numbers that are not finite."""

    exit_code = 5


class Interruption(RadarsimError):
    """A signal stopped the run; finished blocks are stored, and a further run continues. missing: what is not done."""

    def __init__(self, signal_number: int, goes_on: bool = True, missing: str = ""):
        name = {2: "Ctrl-C", 15: "SIGTERM"}.get(signal_number, f"signal {signal_number}")
        next_step = "run the same command again to continue" if goes_on else ""
        super().__init__("; ".join(filter(None, (f"stopped by {name}", missing, next_step))))
        self.signal_number, self.goes_on, self.missing = signal_number, goes_on, missing
        self.exit_code = 128 + signal_number

    def __reduce__(self) -> tuple[type[RadarsimError], tuple[object, ...]]:
        return type(self), (self.signal_number, self.goes_on, self.missing)
