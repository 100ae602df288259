"""Progress on the terminal."""

import sys
import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from radarsim.cli.console import rich_console
from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report.output_labels import clock
from radarsim.system.threads import forbidden

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID


SILENT_S = 0.7  # a run shorter than this shows no progress
REFRESH_S = 0.1
STEADY_RATIO = 1.5  # factor between the latest rate and that since the beginning, beyond which no time left is known
Report = tuple[float, int, int | None]  # when, computed, of how many
TITLES = (term("reading"), term("writing"), term("tracking"), term("judging"), term("fitting"))  # of Counter
UNITS_OF_WORK = (term("likelihoods"), term("realisations"), term("records"), term("rows"))  # of Counter


class Progress:
    """Finished work and the time left, on stderr if that is a terminal, once it has lasted most of a second.

    Until the first report, while kernels are compiled, the bar moves without a number; by a thread, so where threads
    are forbidden it begins with that report. The rate is that of computations since then: neither compilation nor
    stored results count."""

    shows_share = True  # the share of a whole is known, and shown by a bar
    first: Report = (0.0, 0, None)
    last: Report = first
    includes_results = False  # nothing follows after the last report

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
                self.bar = self._start_bar()

    def update(self, done: int, total: int | None = None, from_store: int = 0) -> None:
        """How many are done, of how many, and how many of them were read from the store."""
        rate, now = self.rate(done - from_store, total), time.monotonic()
        early = now < self.started + SILENT_S or (now < self.due and done != total)  # the end is always shown
        if self.quiet or early or not sys.stderr.isatty():
            return
        self.due = now + REFRESH_S
        self._begin()
        assert self.bar is not None  # it has just begun
        text = self._text(done, total, rate)
        self.bar.update(self.task, total=total, completed=self.completed(done, total), text=text, refresh=forbidden())

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

    def _text(self, done: int, total: int | None, rate: float) -> str:
        """The share that is done and the time left."""
        assert total is not None
        share = self.completed(done, total) / max(total, 1)
        text = tr("{share} %", share=numeral(f"{100 * share:5.1f}"))
        if done >= total:
            text += tr("  the results follow")
        elif rate > 0:
            text += tr("  {left} left", left=clock((total - done) / rate))
            text += "" if self.includes_results else tr(", then the results")
        return text

    def _start_bar(self) -> "Bar":
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        text_column = TextColumn("{task.fields[text]}")
        columns = (TextColumn("{task.description}"), BarColumn(), text_column) if self.shows_share else (text_column,)
        bar = Bar(*columns, console=rich_console(sys.stderr), transient=True, auto_refresh=not forbidden())
        self.task = bar.add_task(self.title, total=None, text=tr("begins"))
        bar.start()
        return bar


def _between(begin: Report, end: Report) -> float:
    """The rate between two reports, a second."""
    return (end[1] - begin[1]) / max(end[0] - begin[0], 1e-9)


class TimedProgress(Progress):
    """Progress in milliseconds, of those that all is expected to take, the results included. The share shown never goes
    back: where more is expected than before, it waits."""

    includes_results = True
    share = 0.0

    def rate(self, computed: int, total: int | None) -> float:
        """How many pass in a second."""
        return 1000.0

    def completed(self, done: int, total: int | None) -> float:
        """The largest share so far, of the total."""
        assert total is not None
        self.share = max(self.share, done / max(total, 1))
        return self.share * total


class CountedProgress(Progress):
    """Progress of work without a known end, on stderr if that is a terminal, once it has lasted most of a second."""

    shows_share = False
    previous: Report = (
        0.0,
        0,
        None,
    )  # the report before the last; here they are those since which the time has doubled

    def __init__(self, title: str, unit: str):
        super().__init__(title)
        self.unit = tr(unit)

    def rate(self, computed: int, total: int | None) -> float:
        """How many are done in a second, on average since the first report: before it files are read, kernels made."""
        now = time.monotonic(), computed, total
        if not self.first[1]:
            self.first = self.last = self.previous = now
        if now[0] - self.first[0] >= 2 * (self.last[0] - self.first[0]):
            self.previous, self.last = self.last, now
        return _between(self.first, now)

    def _text(self, done: int, total: int | None, rate: float) -> str:
        text = tr("{title}: {done:,} {what}, {rate:,.0f}/s", title=tr(self.title), done=done, what=self.unit, rate=rate)
        recent_rate = _between(
            self.previous, (time.monotonic(), done, total)
        )  # over the last half of the time, or more
        if total is None or not rate / STEADY_RATIO < recent_rate < rate * STEADY_RATIO:
            return text
        return text + "  " + tr("about {left} left", left=clock((total - done) / rate))
