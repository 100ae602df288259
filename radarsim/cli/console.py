"""What the terminal shows: progress with rate and time left, tables of the answer, where files were written."""

import math
import os
import re
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from radarsim.report.text import clock, known, plural, printable, significant_digits

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console
    from rich.progress import Progress as Bar
    from rich.progress import TaskID
    from rich.status import Status

    from radarsim.app.clean import Cleaned
    from radarsim.app.compare import Compared
    from radarsim.app.doctor import Inspection
    from radarsim.app.inventory import Inventory
    from radarsim.app.outlook import Outlook
    from radarsim.app.readings import Done
    from radarsim.app.result import Result
    from radarsim.app.simulation import Shares
    from radarsim.config.experiment import Experiment

SILENT_S = 0.7  # a run shorter than this shows no progress
PIPED_WIDTH = 10_000  # whatever reads it wraps it, or not
ROOMY = 110  # columns of a terminal from which claims are shown with place and config
MOST_ROWS = 36  # of the last scan's table; of a larger experiment the answer and the files are enough


def console(stderr: bool = False) -> "Console":
    """A rich console; plain text of a fixed width where the stream is no terminal."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else PIPED_WIDTH
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False, soft_wrap=not stream.isatty())


class Progress:
    """What is done, its rate and the time left, on stderr if that is a terminal, once it has lasted most of a second.

    Until the first report, while kernels are compiled, the bar moves without saying how much.
    """

    def __init__(self, title: str, quiet: bool, what: str = "realisations"):
        self.title, self.quiet, self.what = title, quiet, what
        self.started = time.monotonic()
        self.bar: Bar | None = None
        self.task: TaskID
        self.lock = threading.Lock()
        self.timer = threading.Timer(SILENT_S, self._begin)
        self.timer.daemon = True

    def __enter__(self) -> Self:
        if not self.quiet and sys.stderr.isatty():
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

    def update(self, done: int, total: int, from_store: int) -> None:
        """How many are done, of how many, and how many of them were read from the store."""
        elapsed = time.monotonic() - self.started
        if self.quiet or elapsed < SILENT_S or not sys.stderr.isatty():
            return
        self._begin()
        assert self.bar is not None  # it has just begun
        rate = (done - from_store) / elapsed
        left = clock((total - done) / rate) if rate > 0 else "–"
        told = f"{done / max(total, 1):6.1%}  {rate:,.0f} {self.what}/s  {left} left".replace("%", " %", 1)
        self.bar.update(self.task, total=total, completed=done, told=told)

    def _begun(self) -> "Bar":
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[told]}"))
        bar = Bar(*columns, console=console(stderr=True), transient=True)
        self.task = bar.add_task(self.title, total=None, told="begins")
        bar.start()
        return bar


class Counter:
    """How much is done of what has no known end, on stderr if that is a terminal, once it has lasted two seconds."""

    def __init__(self, title: str, what: str):
        self.title, self.what, self.started = title, what, time.monotonic()
        self.status: Status | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self.status is not None:
            self.status.stop()

    def update(self, done: int) -> None:
        """How many are done."""
        elapsed = time.monotonic() - self.started
        if elapsed < SILENT_S or not sys.stderr.isatty():
            return
        if self.status is None:
            self.status = console(stderr=True).status("")
            self.status.start()
        self.status.update(f"{self.title}: {done:,} {self.what}, {done / elapsed:,.0f}/s")


def show(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    right: Sequence[str] = (),
    spare: Sequence[str] = (),
) -> None:
    """Print one table; columns in `right` are aligned right, those in `spare` left out on a narrow terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    screen = console()
    cells = [["\n".join(map(printable, str(cell).split("\n"))) for cell in row] for row in rows]
    shown = fitting(columns, cells, spare, screen.width)
    terminal = sys.stdout.isatty()
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD if terminal else None, pad_edge=False)
    for i in shown:
        table.add_column(columns[i], justify="right" if columns[i] in right else "left", no_wrap=not terminal)
    for row in cells:
        table.add_row(*(Text(row[i]) for i in shown))
    with screen.capture() as captured:
        screen.print(table)
    for line in captured.get().rstrip("\n").split("\n"):
        sys.stdout.write(line.rstrip() + "\n")
    if missing := [columns[i] for i in range(len(columns)) if i not in shown]:
        say(f"         left out at {screen.width} columns: {', '.join(missing)}")


def fitting(columns: Sequence[str], cells: Sequence[Sequence[str]], spare: Sequence[str], width: int) -> list[int]:
    """The places of the columns that fit into a width, the spare ones left out one by one."""
    wide = [
        max(len(line) for text in (name, *(row[i] for row in cells)) for line in text.split("\n"))
        for i, name in enumerate(columns)
    ]
    places, leave = list(range(len(columns))), list(spare)
    while leave and sum(wide[i] + 2 for i in places) > width:
        places.remove(list(columns).index(leave.pop(0)))
    return places


def say(line: str) -> None:
    """Print one line: to a terminal in as many as its width takes, broken between words; else never broken."""
    text = printable(line)
    for part in wrapped(text, console().width) if sys.stdout.isatty() else [text]:
        sys.stdout.write(part + "\n")


def wrapped(line: str, width: int) -> list[str]:
    """A line broken between words, a unit kept with its number; what follows stands under its first words."""
    label = re.match(r"\S* {2,}|", line)
    indent = " " * len(label[0]) if label and len(label[0]) < width // 2 else ""
    kept = re.sub(r"(?<=\d) (?=(%|°|m|s|km|Hz|rad|m/s²?|rad/s²?)(\W|$))", "\N{NO-BREAK SPACE}", line)
    broken = textwrap.wrap(
        kept, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False, drop_whitespace=True
    )
    return [part.replace("\N{NO-BREAK SPACE}", " ") for part in broken] or [""]


def print_result(result: "Result") -> None:
    """The answer of a run, σ at the last scan, the verdicts, and where the files are."""
    written = result.written
    assert written is not None  # the commands write what they print
    for line in written.answer:
        say(line)
    show_last_scan(result.last_scan)
    verdicts = result.verdicts()
    if verdicts:
        for verdict, names in verdicts.items():
            say(f"claims   {len(names)} {verdict}: {', '.join(names)}")
        for reason, names in result.unjudged().items():
            say(f"         not judged: {', '.join(names)}: {reason}")
        say(f"         `radarsim claims {result.experiment.stem}` says what each of them is")
    drawn = [Path(name) for name in written.files if name.startswith("figures/") and not name.endswith(".md")]
    say(f"tables   {written.folder / 'curves.csv'} and {sum(n.endswith('.csv') for n in written.files) - 1} more there")
    if drawn:
        kinds = " and ".join(sorted({path.suffix[1:].upper() for path in drawn}, reverse=True))
        say(f"figures  {written.folder / 'figures'} ({len({path.stem for path in drawn})}, each as {kinds})")
    say(f"report   {written.folder / 'report.html'}")
    if written.removed:
        more = f" and {len(written.removed) - 3} more" if len(written.removed) > 3 else ""
        say(f"removed  of an earlier run, not made by this one: {', '.join(written.removed[:3])}{more}")
    print_warnings(result.warnings)


def print_warnings(warnings: Iterable[str]) -> None:
    """One line each, on the error stream."""
    for warning in warnings:
        sys.stderr.write(f"warning: {printable(warning)}\n")


def show_last_scan(last: "pd.DataFrame") -> None:
    """σ with interval, exact σ and gain of each case, filter and component at the last scan, unless too many."""
    if not 0 < len(last) <= MOST_ROWS:
        return
    found: Iterable[Any] = last.itertuples()  # named by column, which pandas' stubs do not know
    rows = [
        (
            *(row.case, row.filter, row.component, f"{row.t_s:g} s"),
            f"{significant_digits(row.sigma)} {row.unit.replace('s2', 's²')}",
            f"{significant_digits(row.sigma_lo)} … {significant_digits(row.sigma_hi)}" + too_narrow(row),
            known(row.exact_sigma),
            known(row.gain_percent, ".2f", " %"),
            known(row.gain_lo, ".2f", " … ") + known(row.gain_hi, ".2f"),
        )
        for row in found
    ]
    columns = ("case", "filter", "component", "at", "sigma", "95 %", "exact", "gain", "95 % of gain")
    show("", columns, rows, right=columns[3:], spare=("95 % of gain", "exact", "95 %", "gain"))


def print_comparison(compared: "Compared") -> None:
    """What stored results differ by at the last common time, and where the files are."""
    from radarsim.report.compare import words

    rows = [
        (
            f"{row['label']}, {row['filter']}",
            *(row["component"] or str(row["model"]), f"{row['t_s']:g} s"),
            *(f"{words.value(row[key])} {row['unit'].replace('s2', 's²')}" for key in ("value", "against")),
            words.change(row),
        )
        for row in compared.last
        if row["quantity"] == compared.last[0]["quantity"]
    ]
    if len(rows) <= MOST_ROWS:
        against = {row["against_label"] for row in compared.last}
        columns = ("", "of", "at", "σ", f"σ of {against.pop()}" if len(against) == 1 else "σ against", "change")
        show("", columns, rows, right=columns[2:5], spare=("at",))
    for line in compared.sentences if len(rows) > MOST_ROWS else ():
        say(line)
    for line in compared.notes:
        say(f"note     {line}")
    say(f"table    {compared.folder / 'comparison.csv'}")
    if drawn := {Path(name).stem for name in compared.files if name.startswith("figures/")}:
        say(f"figures  {compared.folder / 'figures'} ({len(drawn)})")
    say(f"page     {compared.folder / 'compare.html'}")
    print_warnings(compared.warnings)


def too_narrow(row: Any) -> str:
    """A mark behind an interval, of a row of curves, that rests, there or nearby, on too few effective realisations."""
    from radarsim.report import notes

    marks = {notes.THIN: f" ({row.n_eff:.0f} effective)", notes.NEAR: " (heavy tails)", notes.UNSEEN: " (heavy tails)"}
    return marks.get(getattr(row, "note", ""), "")


def print_outlook(experiment: "Experiment", outlook: "Outlook") -> None:
    """What a run would do."""
    say(f"{experiment.path or experiment.stem}: valid")
    rows = [
        (case.name, case.filters, f"{case.scans}", f"{case.realisations:,}", f"{case.seconds:.3g} s")
        for case in outlook.cases
    ]
    columns = ("case", "filters", "scans", "realisations", "one thread")
    show("", columns, rows, right=columns[2:])
    if outlook.precision is not None:
        print_needs(experiment, outlook)
    seconds = "under a second" if outlook.seconds < 1 else "about " + clock(outlook.seconds)
    realisations = sum(case.realisations for case in outlook.cases)
    say(
        f"total    {plural(len(outlook.cases), 'case')}, {realisations:,} realisation{'s' * (realisations != 1)}, "
        f"{seconds} on {plural(outlook.threads, 'thread')}, {outlook.memory_mb:.0f} MB; "
        "figures and tables take some seconds more"
    )
    print_warnings(outlook.warnings)


def print_needs(experiment: "Experiment", outlook: "Outlook") -> None:
    """How many realisations a precision takes, and whether the run may do so many."""
    asked = {case.name: case.realisations for case in experiment.cases}
    needs = {case.name: need for case in outlook.cases if (need := case.controlled or case.need) is not None}
    ways = [("", case.need, case.seconds_plain, case.name) for case in outlook.cases]
    ways += [(", control variate", case.controlled, case.seconds_controlled, case.name) for case in outlook.cases]
    rows = [
        (
            f"{name}{way}",
            "out of reach" if need.realisations is None else f"{need.realisations:,}",
            f"{seconds or 0:.3g} s",
            need.known_by,
            need.last,
        )
        for way, need, seconds, name in ways
        if need is not None
    ]
    unit = "points" if outlook.of == "gain" else "%"
    columns = ("case", f"for ± {outlook.precision:g} {unit}", "one thread", "known from", "last to get there")
    show("", columns, rows, right=columns[1:3], spare=columns[4:])
    short = [name for name, need in needs.items() if need.realisations is None or need.realisations > asked[name]]
    if short:
        most = max((need.realisations or math.inf) for need in needs.values())
        cure = f"; -n {most} would do" if math.isfinite(most) else ""
        say(f"precision not within reach of {plural(len(short), 'case')}: {', '.join(short[:3])}{cure}")


def print_share(share: "Shares", out: str | os.PathLike[str]) -> None:
    """What was done of a share of an experiment, and what to do with it."""
    done = sum(one.done for one in share.cases.values())
    held = sum(one.from_store for one in share.cases.values())
    say(f"share    {share.number} of {share.of} of {share.config}: {done:,} realisations, {held:,} were stored before")
    say(f"blocks   {Path(out) / '.blocks'}; copy all shares into one, and `radarsim run` finds them")
    print_warnings(share.warnings)


def print_facts(facts: Mapping[str, str]) -> None:
    """Labels and their facts, a line each."""
    width = max(map(len, facts))
    for label, fact in facts.items():
        say(f"{label:<{width}}  {fact}")


def print_inspection(found: "Inspection") -> None:
    """What an inspection of a result found; its faults are reported as errors."""
    say(f"{found.folder}: {plural(found.outputs, 'output')} and {plural(found.pieces, 'stored piece')} checked")
    if found.recomputed:
        pieces = plural(len(found.recomputed), "piece")
        say(f"computed again: {pieces}, {found.realisations:,} realisations")
    for note in found.notes:
        say(f"note: {note}")
    say("all whole" if not found.faults else f"{plural(len(found.faults), 'fault')} found")


def print_cleaned(cleaned: "Cleaned", dry_run: bool) -> None:
    """How much was dropped, or would be."""
    what = f"{plural(cleaned.files, 'file')} of {plural(cleaned.identities, 'case')}, {cleaned.size / 1e6:.1f} MB"
    say(f"{'would drop' if dry_run else 'dropped'} {what} in {cleaned.path}")


def print_claims(rows: Sequence[dict[str, Any]]) -> None:
    """Each claim with its class, and below it what was measured, or the command that would judge it.

    On a terminal a table; where it is piped, lines that can be searched.
    """
    from radarsim.report.claims import page

    if sys.stdout.isatty():
        cells = []
        for own in page.grouped(rows):
            first, done = own[0], own[0]["class"] != "not run"
            measured = "\n".join(map(_measured, own)) if done else f"radarsim run {first['config']}"
            said = first["statement"] + (f"\n«{first['original']}»" if first["original"] else "")
            cells.append((first["claim"], said, first["place"], measured, page.verdict_of(own), first["config"]))
        columns = ("claim", "statement", "place", "measured and expected", "class", "config")
        show("", columns, cells, spare=() if console().width >= ROOMY else ("place", "config"))
    else:
        for own in page.grouped(rows):
            _print_claim(own)
    say(page.counted(rows) or "no claims are judged by this")
    if rows and all(row["class"] == "not run" for row in rows):
        say("nothing is run here: `make reproduce-figures` runs it all, docs/claims.md has the results at full size")


def _measured(row: Mapping[str, Any]) -> str:
    """What was measured for a part of a claim: its name, its value, what was expected."""
    from radarsim.report.claims import page

    name = f"{row['case']}: {row['what']}" if row["case"] else str(row["what"])
    expected = f"; expected {row['expected']}" if row["expected"] else ""
    return f"{name}: {page.shown(row)}{expected}"


def _print_claim(parts: Sequence[Mapping[str, Any]]) -> None:
    """A claim in lines: its class, statement and original sentence, and a line a part."""
    from radarsim.report.claims import page

    first = parts[0]
    verdict = page.verdict_of(parts).replace("*", "")
    say(f"{first['claim']:<6} {verdict:<20} {first['statement']}  [{first['paper']}, {first['place']}]")
    if first["original"]:
        say(f"       «{first['original']}»")
    if first["class"] == "not run":
        say(f"       radarsim run {first['config']}")
        return
    for row in parts:
        said = [f"{row['case']}: {row['what']}" if row["case"] else str(row["what"])]
        if page.number(row["measured"]) is not None:
            said.append(f"{page.measured(row)}; expected {row['expected']}")
        if (exact := page.number(row["exact"])) is not None:
            said.append(f"exactly {page.plain(exact)}")
        if (missed := page.number(row["miss"])) is not None and missed:
            said.append(f"misses by {missed:.3g} margins")
        if row["verdict"] == "not judged here":
            said.append(str(row["why"]))
        say(f"       {row['verdict']:<20} {'; '.join(said)}")


def print_readings(done: "Done", detailed: bool) -> None:
    """A line a claim, of single claims a line a reading too, and what the joint search came to."""
    for read in done.read:
        for over in read.over:
            if detailed:
                for one in over.under:
                    outcome = one.outcome.kind if one.outcome else f"not possible: {one.why}"
                    say(f"       {one.kind}  {outcome:<24} {one.name}")
            found = over.outcome
            say(f"{over.claim.id:<6} {found.words if found else 'not judged':<24} {over.sentence()}")
        if read.counted is not None:
            say(f"{read.paper.readings.paper}: {read.counted.sentence()}")
    if done.files:
        say(f"table    {done.folder / 'readings.csv'}; curves: {plural(len(done.files) - 1, 'figure')} drawn again")


def print_inventory(inventory: "Inventory") -> None:
    """Filters, studies, scenarios and configs, with a line on each: what is asked for most stands last."""
    for n, (title, columns, rows) in enumerate(reversed(inventory)):
        if n:
            say("")
        show(title, columns, rows)
