"""Terminal output in general: progress, labelled lines, warnings."""

import re
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

from radarsim.language import numeral, plural, term, tr
from radarsim.report.wording import clock, labelled, printable, unbroken
from radarsim.threads import forbidden

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bar
    from rich.progress import TaskID


SILENT_S = 0.7  # a run shorter than this shows no progress
REFRESH_S = 0.1
STEADY = 1.5  # factor between the latest rate and that since the beginning, beyond which no time left is known
Report = tuple[float, int, int | None]  # when, computed, of how many
PIPED_WIDTH = 10_000  # whatever reads it wraps it, or not
COLUMNS = (  # of tables
    *(term("case"), term("filter"), term("component"), term("at"), term("sigma"), term("exact"), term("gain")),
    *(term("95 % of gain"), term("of"), term("change"), term("filters"), term("scans")),
    *(term("realisations"), term("one thread"), term("known from"), term("last to get there"), term("claim")),
    *(term("statement"), term("place"), term("measured and expected"), term("class"), term("config"), term("key")),
    *(term("RMS error"), term("unit"), term("of own σ"), term("estimates"), term("number"), term("plots"), term("NIS")),
    *(term("95 % from"), term("95 % to"), term("stated σ"), term("stated"), term("tuned")),
    *(term("value"), term("name"), term("what it is"), term("paper and question"), term("study"), term("keys")),
)
TITLES = (term("reading"), term("writing"), term("tracking"), term("judging"), term("fitting"))  # of Counter
WHAT = (term("likelihoods"), term("realisations"), term("records"), term("rows"))  # of Counter


def console(stream: TextIO) -> "Console":
    """A rich console; plain text of a fixed width where the stream is no terminal."""
    from rich.console import Console

    width = None if stream.isatty() else PIPED_WIDTH
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False, soft_wrap=not stream.isatty())


class Progress:
    """Finished work and the time left, on stderr if that is a terminal, once it has lasted most of a second.

    Until the first report, while kernels are compiled, the bar moves without a number; by a thread, so where threads
    are forbidden it begins with that report. The rate is that of computations since then: neither compilation nor
    stored results count."""

    shares = True  # the share of a whole is known, and shown by a bar
    first: Report = (0.0, 0, None)
    last: Report = first
    whole = False  # nothing follows after the last report

    def __init__(self, title: str, quiet: bool = False):
        self.title, self.quiet = title, quiet
        self.started = self.due = time.monotonic()
        self.bar: Bar | None = None
        self.task: TaskID
        self.lock = threading.Lock()
        self.timer = threading.Timer(SILENT_S, self._begin)
        self.timer.daemon = True

    def __enter__(self) -> Self:
        if not self.quiet and not forbidden() and sys.stderr.isatty():
            self.timer.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.timer.cancel()
        with self.lock:
            self.quiet = True  # a timer that has just run out begins nothing
            if self.bar is not None:
                self.bar.stop()

    def _begin(self) -> None:
        with self.lock:
            if self.bar is None and not self.quiet:
                self.bar = self._begun()

    def update(self, done: int, total: int | None = None, from_store: int = 0) -> None:
        """How many are done, of how many, and how many of them were read from the store."""
        rate, now = self.rate(done - from_store, total), time.monotonic()
        early = now < self.started + SILENT_S or (now < self.due and done != total)  # the end is always shown
        if self.quiet or early or not sys.stderr.isatty():
            return
        self.due = now + REFRESH_S
        self._begin()
        assert self.bar is not None  # it has just begun
        told = self._told(done, total, rate)
        self.bar.update(self.task, total=total, completed=self.completed(done, total), told=told, refresh=forbidden())

    def completed(self, done: int, total: int | None) -> float:
        """How many of the total the bar shows."""
        return done

    def rate(self, computed: int, total: int | None) -> float:
        """How many are computed in a second, on average since the last report of none or of another total; 0 if
        unknown."""
        now = time.monotonic()
        if total != self.last[2] or computed < self.last[1] or not computed:
            self.first = now, computed, total
        self.last = now, computed, total
        return (computed - self.first[1]) / (now - self.first[0]) if now > self.first[0] else 0.0

    def _told(self, done: int, total: int | None, rate: float) -> str:
        """The share that is done and the time left."""
        assert total is not None
        share = self.completed(done, total) / max(total, 1)
        told = tr("{share} %", share=numeral(f"{100 * share:5.1f}"))
        if done >= total:
            told += tr("  the results follow")
        elif rate > 0:
            told += tr("  {left} left", left=clock((total - done) / rate))
            told += "" if self.whole else tr(", then the results")
        return told

    def _begun(self) -> "Bar":
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        told = TextColumn("{task.fields[told]}")
        columns = (TextColumn("{task.description}"), BarColumn(), told) if self.shares else (told,)
        bar = Bar(*columns, console=console(sys.stderr), transient=True, auto_refresh=not forbidden())
        self.task = bar.add_task(self.title, total=None, told=tr("begins"))
        bar.start()
        return bar


def _between(begin: Report, end: Report) -> float:
    """The rate between two reports, a second."""
    return (end[1] - begin[1]) / max(end[0] - begin[0], 1e-9)


class Foretold(Progress):
    """Progress in milliseconds, of those that all is expected to take, the results included. The share shown never goes
    back: where more is expected than before, it waits."""

    whole = True
    share = 0.0

    def rate(self, computed: int, total: int | None) -> float:
        """How many pass in a second."""
        return 1000.0

    def completed(self, done: int, total: int | None) -> float:
        """The largest share so far, of the total."""
        assert total is not None
        self.share = max(self.share, done / max(total, 1))
        return self.share * total


class Counter(Progress):
    """Progress of work without a known end, on stderr if that is a terminal, once it has lasted most of a second."""

    shares = False
    before: Report = (0.0, 0, None)  # the report before the last; here they are those since which the time has doubled

    def __init__(self, title: str, what: str):
        super().__init__(title)
        self.what = tr(what)

    def rate(self, computed: int, total: int | None) -> float:
        """How many are done in a second, on average since the first report: before it files are read, kernels made."""
        now = time.monotonic(), computed, total
        if not self.first[1]:
            self.first = self.last = self.before = now
        if now[0] - self.first[0] >= 2 * (self.last[0] - self.first[0]):
            self.before, self.last = self.last, now
        return _between(self.first, now)

    def _told(self, done: int, total: int | None, rate: float) -> str:
        words = tr(
            "{title}: {done:,} {what}, {rate:,.0f}/s", title=tr(self.title), done=done, what=self.what, rate=rate
        )
        lately = _between(self.before, (time.monotonic(), done, total))  # over the last half of the time, or more
        if total is None or not rate / STEADY < lately < rate * STEADY:
            return words
        return words + "  " + tr("about {left} left", left=clock((total - done) / rate))


def show(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    right: Sequence[str] = (),
    spare: Sequence[str] = (),
    stream: TextIO | None = None,
) -> None:
    """Print one table, by default to stdout; columns in `right` are aligned right, those in `spare` left out on a
    narrow terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    stream = stream or sys.stdout
    screen = console(stream)
    cells = [["\n".join(map(printable, str(cell).split("\n"))) for cell in row] for row in rows]
    shown = fitting(columns, cells, spare, screen.width, [tr(name) for name in columns])
    terminal = stream.isatty()
    style: dict[str, Any] = {"box": box.SIMPLE_HEAD, "padding": (0, 1, 0, 0)} if terminal else {"box": None}
    table = Table(title=title or None, title_justify="left", pad_edge=False, **style)
    for i in shown:
        table.add_column(tr(columns[i]), justify="right" if columns[i] in right else "left", no_wrap=not terminal)
    for row in cells:
        table.add_row(*(Text(row[i]) for i in shown))
    with screen.capture() as captured:
        screen.print(table)
    for line in captured.get().rstrip("\n").split("\n"):
        stream.write(line.rstrip() + "\n")
    if missing := [columns[i] for i in range(len(columns)) if i not in shown]:
        said = ", ".join(map(tr, missing))
        field("", tr("left out at {width} columns: {columns}", width=screen.width, columns=said))


def fitting(
    columns: Sequence[str],
    cells: Sequence[Sequence[str]],
    spare: Sequence[str],
    width: int,
    heads: Sequence[str] | None = None,
) -> list[int]:
    """The indices of the columns that fit into a width, the spare ones left out one by one; heads: as shown."""
    wide = [
        max(len(line) for text in (name, *(row[i] for row in cells)) for line in text.split("\n"))
        for i, name in enumerate(heads or columns)
    ]
    places, leave = list(range(len(columns))), [name for name in spare if name in columns]
    while leave and sum(wide[i] + 2 for i in places) > width:
        places.remove(list(columns).index(leave.pop(0)))
    return places


def say(line: str) -> None:
    """Print one line: to a terminal broken between words at its width; else never broken."""
    for part in broken(printable(line), sys.stdout):
        sys.stdout.write(part + "\n")


def command(label: str, text: str) -> None:
    """Print a command under a label, in one line, however long, for copying."""
    sys.stdout.write(printable(labelled(label, text)) + "\n")


def broken(text: str, stream: TextIO) -> list[str]:
    """A line for a stream: for a terminal broken at its width; else whole."""
    return wrapped(text, shutil.get_terminal_size().columns) if stream.isatty() else [text]


def say_aside(line: str) -> None:
    """Print one line on the error stream, to a terminal broken between words."""
    for part in broken(printable(line), sys.stderr):
        sys.stderr.write(part + "\n")


def field(label: str, text: str) -> None:
    """Print a line under a label; without one it stands under the line before."""
    say(labelled(label, text))


def wrapped(line: str, width: int) -> list[str]:
    """A line broken between words, a unit kept with its number; further lines are indented to its last column."""
    columns = [gap.end() for gap in re.finditer(r"(^| ) +(?=\S)", line) if gap.end() < width // 2]
    indent = " " * max(columns, default=0)
    kept = unbroken(line)
    broken = textwrap.wrap(
        kept, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False, drop_whitespace=True
    )
    return [part.replace("\N{NO-BREAK SPACE}", " ") for part in broken] or [""]


def print_warnings(warnings: Iterable[str]) -> None:
    """One line each, on the error stream."""
    for warning in warnings:
        say_aside(tr("warning: {words}", words=printable(warning)))


def counted_cases(count: int) -> str:
    """1 case, 2 cases."""
    return plural("{count} case", "{count} cases", count)


def print_facts(facts: Mapping[str, str]) -> None:
    """Labels and their facts, a line each."""
    width = max(len(tr(label)) for label in facts)
    for label, fact in facts.items():
        say(f"{tr(label):<{width}}  {fact}")
