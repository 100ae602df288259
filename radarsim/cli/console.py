"""What the terminal shows: progress with rate and time left, tables of the answer, where files were written."""

import math
import os
import re
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

from radarsim.language import Term, few, listed, numeral, plural, term, tr
from radarsim.report.text import clock, known, labelled, printable, significant_digits, unbroken
from radarsim.report.text import unit as unit_of

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
    from radarsim.app.outlook import Need, Outlook
    from radarsim.app.readings import Done
    from radarsim.app.result import Result
    from radarsim.app.simulation import Shares
    from radarsim.config.experiment import Experiment

SILENT_S = 0.7  # a run shorter than this shows no progress
PIPED_WIDTH = 10_000  # whatever reads it wraps it, or not
ROOMY = 110  # columns of a terminal from which claims are shown with place and config
COLUMNS = (  # of tables
    *(term("case"), term("filter"), term("component"), term("at"), term("sigma"), term("exact"), term("gain")),
    *(term("95 % of gain"), term("of"), term("σ against"), term("change"), term("filters"), term("scans")),
    *(term("realisations"), term("one thread"), term("known from"), term("last to get there"), term("claim")),
    *(term("statement"), term("place"), term("measured and expected"), term("class"), term("config"), term("key")),
    *(term("value"), term("name"), term("what it is"), term("paper and question"), term("study"), term("keys")),
)
TITLES = (term("reading"), term("tracking"), term("judging"), term("fitting"))  # of what has no known end
WHAT = (
    term("likelihoods"),
    term("realisations"),
    term("cases"),
    term("values"),
    term("keys"),
    term("records"),
    term("rows"),
)
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
        self.title, self.quiet, self.what = title, quiet, tr(what)
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
        share, speed = numeral(f"{100 * done / max(total, 1):5.1f}"), numeral(f"{rate:,.0f}")
        told = tr("{share} %  {rate} {what}/s  {left} left", share=share, rate=speed, what=self.what, left=left)
        self.bar.update(self.task, total=total, completed=done, told=told)

    def _begun(self) -> "Bar":
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[told]}"))
        bar = Bar(*columns, console=console(stderr=True), transient=True)
        self.task = bar.add_task(self.title, total=None, told=tr("begins"))
        bar.start()
        return bar


class Counter:
    """How much is done of what has no known end, on stderr if that is a terminal, once it has lasted two seconds."""

    def __init__(self, title: str, what: str):
        self.title, self.what, self.started = tr(title), tr(what), time.monotonic()
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
        self.status.update(
            tr(
                "{title}: {done:,} {what}, {rate:,.0f}/s",
                title=self.title,
                done=done,
                what=self.what,
                rate=done / elapsed,
            )
        )


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
    shown = fitting(columns, cells, spare, screen.width, [tr(name) for name in columns])
    terminal = sys.stdout.isatty()
    style: dict[str, Any] = {"box": box.SIMPLE_HEAD, "padding": (0, 1, 0, 0)} if terminal else {"box": None}
    table = Table(title=title or None, title_justify="left", pad_edge=False, **style)
    for i in shown:
        table.add_column(tr(columns[i]), justify="right" if columns[i] in right else "left", no_wrap=not terminal)
    for row in cells:
        table.add_row(*(Text(row[i]) for i in shown))
    with screen.capture() as captured:
        screen.print(table)
    for line in captured.get().rstrip("\n").split("\n"):
        sys.stdout.write(line.rstrip() + "\n")
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
    """The places of the columns that fit into a width, the spare ones left out one by one; heads: as they are shown."""
    wide = [
        max(len(line) for text in (name, *(row[i] for row in cells)) for line in text.split("\n"))
        for i, name in enumerate(heads or columns)
    ]
    places, leave = list(range(len(columns))), list(spare)
    while leave and sum(wide[i] + 2 for i in places) > width:
        places.remove(list(columns).index(leave.pop(0)))
    return places


def say(line: str) -> None:
    """Print one line: to a terminal in as many as its width takes, broken between words; else never broken."""
    for part in broken(printable(line), sys.stdout):
        sys.stdout.write(part + "\n")


def command(label: str, text: str) -> None:
    """Print a command under a label, in one line, however long, so that it can be copied."""
    sys.stdout.write(printable(labelled(label, text)) + "\n")


def broken(text: str, stream: TextIO) -> list[str]:
    """A line as a stream takes it: of a terminal in as many lines as its width asks for; else whole."""
    return wrapped(text, shutil.get_terminal_size().columns) if stream.isatty() else [text]


def say_aside(line: str) -> None:
    """Print one line on the error stream, to a terminal broken between words."""
    for part in broken(printable(line), sys.stderr):
        sys.stderr.write(part + "\n")


def field(label: str, text: str) -> None:
    """Print a line under a label; without one it stands under the line before."""
    say(labelled(label, text))


def wrapped(line: str, width: int) -> list[str]:
    """A line broken between words, a unit kept with its number; what follows stands under its first words."""
    label = re.match(r"(\S+( \S+)?)? {2,}|", line)
    indent = " " * len(label[0]) if label and len(label[0]) < width // 2 else ""
    kept = unbroken(line)
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
        from radarsim.report.claims import reasons

        for verdict, names in verdicts.items():
            field("claims", tr("{count} {kind}: {names}", count=len(names), kind=Term(verdict), names=", ".join(names)))
        for reason, names in result.unjudged().items():
            field("", tr("not judged: {names}: {reason}", names=", ".join(names), reason=reasons.said(reason)))
        if alone := result.as_shipped():
            every = tr(
                "as shipped: {names}; `radarsim readings {paper}` judges under all that the paper allows",
                names=_in_a_row(alone),
                paper=alone[0].partition(".")[0],
            )
            field("", every)
        field("", tr("`radarsim claims {stem}` says what each of them is", stem=result.experiment.stem))
    drawn = [Path(name) for name in written.files if name.startswith("figures/") and not name.endswith(".md")]
    others = sum(name.endswith(".csv") for name in written.files) - 1
    field("tables", tr("{file} and {count} more there", file=str(written.folder / "curves.csv"), count=others))
    if drawn:
        kinds = listed(sorted({path.suffix[1:].upper() for path in drawn}, reverse=True))
        told = {"folder": str(written.folder / "figures"), "count": len({path.stem for path in drawn}), "kinds": kinds}
        field("figures", tr("{folder} ({count}, each as {kinds})", **told))
    field("report", str(written.folder / "report.html"))
    if written.removed:
        gone = few(written.removed, 3)
        field("removed", tr("of an earlier run, not made by this one: {names}", names=gone))
    print_warnings(result.warnings)


def print_warnings(warnings: Iterable[str]) -> None:
    """One line each, on the error stream."""
    for warning in warnings:
        say_aside(tr("warning: {words}", words=printable(warning)))


def show_last_scan(last: "pd.DataFrame") -> None:
    """σ with interval, exact σ and gain of each case, filter and component at the last scan, unless too many."""
    if not 0 < len(last) <= MOST_ROWS:
        return
    found: Iterable[Any] = last.itertuples()  # named by column, which pandas' stubs do not know
    rows = [
        (
            *(row.case, row.filter, row.component, tr("{t_s:g} s", t_s=row.t_s)),
            f"{significant_digits(row.sigma)} {tr(unit_of(row.unit))}",
            f"{significant_digits(row.sigma_lo)} … {significant_digits(row.sigma_hi)}" + too_narrow(row, "note"),
            known(row.exact_sigma),
            known(row.gain_percent, ".2f", " %"),
            known(row.gain_lo, ".2f", " … ") + known(row.gain_hi, ".2f") + too_narrow(row, "gain_note"),
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
            *(row["component"] or str(row["model"]), tr("{t_s:g} s", t_s=row["t_s"])),
            *(f"{words.value(row[key])} {tr(unit_of(row['unit']))}" for key in ("value", "against")),
            words.change(row),
        )
        for row in compared.last
        if row["quantity"] == compared.last[0]["quantity"]
    ]
    if len(rows) <= MOST_ROWS:
        against = {row["against_label"] for row in compared.last}
        columns = (
            "",
            "of",
            "at",
            "σ",
            tr("σ of {name}", name=against.pop()) if len(against) == 1 else "σ against",
            "change",
        )
        show("", columns, rows, right=columns[2:5], spare=("at",))
    for line in compared.sentences if len(rows) > MOST_ROWS else ():
        say(line)
    for line in compared.notes:
        field("note", line)
    field("table", str(compared.folder / "comparison.csv"))
    if drawn := {Path(n).stem for n in compared.files if n.startswith("figures/") and not n.endswith(".md")}:
        field("figures", f"{compared.folder / 'figures'} ({len(drawn)})")
    field("page", str(compared.folder / "compare.html"))
    print_warnings(compared.warnings)


def too_narrow(row: Any, column: str) -> str:
    """A mark behind an interval, of a row of `last_scan`, by the column that says where it rests on too little."""
    from radarsim.report import notes

    note = getattr(row, column, "")
    if not isinstance(note, str):  # of a gain that a row does not have
        return ""
    if note == notes.THIN and row.n_eff < notes.FEW_EFFECTIVE:  # of a gain the baseline may have fewer
        return tr(" ({n_eff:.0f} effective)", n_eff=row.n_eff)
    if note in notes.HEAVY:
        return tr(" (heavy tails)")
    return tr(" (marked)") if note else ""


def print_outlook(experiment: "Experiment", outlook: "Outlook") -> None:
    """What a run would do."""
    say(tr("{config}: valid", config=str(experiment.path or experiment.stem)))
    rows = [
        (
            case.name,
            case.filters,
            str(case.scans),
            numeral(f"{case.realisations:,}"),
            tr("{t_s:.3g} s", t_s=case.seconds) if case.timed else tr("under {t_s:.2g} s", t_s=case.seconds),
        )
        for case in outlook.cases
    ]
    columns = ("case", "filters", "scans", "realisations", "one thread")
    show("", columns, rows, right=columns[2:], spare=("scans",))
    if outlook.precision is not None:
        print_needs(experiment, outlook)
    short = outlook.seconds < 1
    seconds = tr("under a second") if short else tr("about {time}", time=clock(outlook.seconds))
    told = {
        "cases": counted_cases(len(outlook.cases)),
        "realisations": plural(
            "{count:,} realisation", "{count:,} realisations", sum(case.realisations for case in outlook.cases)
        ),
        "threads": plural("{count} thread", "{count} threads", outlook.threads),
    }
    words = tr(
        "{cases}, {realisations}, {seconds} on {threads}, {memory:.0f} MB; figures and tables take some seconds more",
        **told,
        seconds=seconds,
        memory=outlook.memory_mb,
    )
    field("total", words)
    print_warnings(outlook.warnings)


def print_needs(experiment: "Experiment", outlook: "Outlook") -> None:
    """How many realisations a precision takes, and whether the run may do so many."""
    asked = {case.name: case.realisations for case in experiment.cases}
    needs = {case.name: need for case in outlook.cases if (need := case.controlled or case.need) is not None}
    ways = [("", case.need, case.seconds_plain, case.name) for case in outlook.cases]
    ways += [(tr(", control variate"), case.controlled, case.seconds_controlled, case.name) for case in outlook.cases]
    rows = [
        (
            f"{name}{way}",
            numeral(f"{need.realisations:,}") if need.realisations is not None else _unreached(need),
            tr("{t_s:.3g} s", t_s=float(seconds or 0)),
            need.known_by,
            need.last,
        )
        for way, need, seconds, name in ways
        if need is not None
    ]
    unit = tr("points") if outlook.of == "gain" else "%"
    wanted = tr("for ± {percent:g} {unit}", percent=outlook.precision, unit=unit)
    columns = ("case", wanted, "one thread", "known from", "last to get there")
    show("", columns, rows, right=columns[1:3], spare=columns[4:])
    short = [name for name, need in needs.items() if need.realisations is None or need.realisations > asked[name]]
    if short:
        most = max((need.realisations or math.inf) for need in needs.values())
        cure = tr("; -n {most} would do", most=str(most)) if math.isfinite(most) else ""
        cases = counted_cases(len(short))
        say(
            tr(
                "precision not within reach of {cases}: {names}{cure}",
                cases=cases,
                names=", ".join(short[:3]),
                cure=cure,
            )
        )


def _unreached(need: "Need") -> str:
    """Why a pilot foretells no number of realisations."""
    return tr("out of reach") if need.below is None else tr("none seen: below {rate:.2g}", rate=need.below)


def print_share(share: "Shares", out: str | os.PathLike[str]) -> None:
    """What was done of a share of an experiment, and what to do with it."""
    done = sum(one.done for one in share.cases.values())
    held = sum(one.from_store for one in share.cases.values())
    told = {"number": share.number, "of": share.of, "config": share.config, "done": done, "held": held}
    field("share", tr("{number} of {of} of {config}: {done:,} realisations, {held:,} were stored before", **told))
    folder = str(Path(out) / ".blocks")
    field("blocks", tr("{folder}; copy all shares into one, and `radarsim run` finds them", folder=folder))
    print_warnings(share.warnings)


def counted_cases(count: int) -> str:
    """1 case, 2 cases."""
    return plural("{count} case", "{count} cases", count)


def print_facts(facts: Mapping[str, str]) -> None:
    """Labels and their facts, a line each."""
    width = max(len(tr(label)) for label in facts)
    for label, fact in facts.items():
        say(f"{tr(label):<{width}}  {fact}")


def print_inspection(found: "Inspection") -> None:
    """What an inspection of a result found; its faults are reported as errors."""
    outputs = plural("{count} output", "{count} outputs", found.outputs)
    pieces = plural("{count} stored piece", "{count} stored pieces", found.pieces)
    say(tr("{folder}: {outputs} and {pieces} checked", folder=str(found.folder), outputs=outputs, pieces=pieces))
    if found.recomputed:
        pieces = plural("{count} piece", "{count} pieces", len(found.recomputed))
        say(tr("computed again: {pieces}, {count:,} realisations", pieces=pieces, count=found.realisations))
    for note in found.notes:
        say(tr("note: {words}", words=note))
    say(
        tr("all whole")
        if not found.faults
        else plural("{count} fault found", "{count} faults found", len(found.faults))
    )


def print_cleaned(cleaned: "Cleaned", dry_run: bool) -> None:
    """How much was dropped, or would be."""
    told = {
        "files": plural("{count} file", "{count} files", cleaned.files),
        "cases": counted_cases(cleaned.identities),
        "size": cleaned.size / 1e6,
        "folder": str(cleaned.path),
    }
    would, done = tr("would drop {files} of {cases}, {size:.1f} MB in {folder}", **told), tr(DROPPED, **told)
    say(would if dry_run else done)


DROPPED = term("dropped {files} of {cases}, {size:.1f} MB in {folder}")


def print_claims(rows: Sequence[dict[str, Any]]) -> None:
    """Each claim with its class, and below it what was measured, or the command that would judge it.

    On a terminal a table; where it is piped, lines that can be searched. Of experiments that are not the paper's a line
    for each reason, with the claims that cannot be judged for it.
    """
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, reasons

    stated: list[dict[str, Any]] = []
    foreign: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["class"] == NOT_JUDGED and not row["what"]:
            foreign.setdefault((row["config"], row["why"]), []).append(row["claim"])
        else:
            stated.append(row)
    if stated:
        _print_stated(stated)
    for (stem, why), names in foreign.items():
        told = {"stem": stem, "names": _in_a_row(names), "reason": reasons.said(why)}
        say(tr("{stem}: not judged: {names}: {reason}", **told))
    say(page.counted(stated) or tr("no claims are judged by this"))
    if stated and all(row["class"] == NOT_RUN for row in stated):
        say(tr(NOTHING_RUN))


NOTHING_RUN = term(
    "nothing is run here: `make reproduce-figures` runs it all, docs/claims.md has the results at full size"
)


def _in_a_row(claims: Sequence[str]) -> str:
    """Names of claims, those with numbers in a row by the first and last: `P1.1–P1.34`."""
    runs: list[list[str]] = []
    for name in claims:
        paper, _, number = name.rpartition(".")
        follows = runs and number.isdecimal() and runs[-1][-1] == f"{paper}.{int(number) - 1}"
        runs[-1].append(name) if follows else runs.append([name])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def _print_stated(rows: Sequence[dict[str, Any]]) -> None:
    """Claims with what was measured."""
    from radarsim.report.claims import page

    if sys.stdout.isatty():
        cells = []
        for own in page.grouped(rows):
            first, done = own[0], own[0]["class"] != "not run"
            beside = "" if page.extension(own) else f" ({tr(page.NOT_COUNTED)})"
            lines = [_measured(row) + (beside if page.extension([row]) else "") for row in own]
            measured = "\n".join(lines) if done else f"radarsim run {first['config']}"
            said = tr(first["statement"]) + (f"\n«{first['original']}»" if first["original"] else "")
            verdict = page.verdict_of(own).replace("*", "")
            cells.append((first["claim"], said, tr(first["place"]), measured, verdict, first["config"]))
        columns = ("claim", "statement", "place", "measured and expected", "class", "config")
        show("", columns, cells, spare=() if console().width >= ROOMY else ("place", "config"))
    else:
        for own in page.grouped(rows):
            _print_claim(own)


def _measured(row: Mapping[str, Any]) -> str:
    """What was measured for a part of a claim: its name, its value, what was expected."""
    from radarsim.report.claims import page

    expected = tr("; expected {words}", words=page.expected(row["expected"])) if row["expected"] else ""
    return f"{_named(row)}: {page.shown(row)}{expected}"


def _named(row: Mapping[str, Any]) -> str:
    """What a part of a claim measures, in which case."""
    return ": ".join(filter(None, (str(row["case"]), tr(str(row["what"])))))


def _print_claim(parts: Sequence[Mapping[str, Any]]) -> None:
    """A claim in lines: its class, statement and original sentence, and a line a part."""
    from radarsim.report.claims import page, reasons

    first = parts[0]
    verdict = page.verdict_of(parts).replace("*", "")
    place = f"{tr(first['paper'])}, {tr(first['place'])}"
    say(f"{first['claim']:<6} {verdict:<20} {tr(first['statement'])}  [{place}]")
    if first["original"]:
        say(f"       «{first['original']}»")
    if first["class"] == "not run":
        say(f"       radarsim run {first['config']}")
        return
    for row in parts:
        said = [_named(row)]
        if page.number(row["measured"]) is not None:
            said.append(page.measured(row) + tr("; expected {words}", words=page.expected(row["expected"])))
        if (exact := page.number(row["exact"])) is not None:
            said.append(tr("exactly {value}", value=page.plain(exact)))
        if (missed := page.number(row["miss"])) is not None and missed:
            said.append(tr("off by {miss:.3g} margins", miss=missed))
        if row["verdict"] == "not judged here":
            said.append(reasons.said(row["why"]))
        if page.extension([row]) and not page.extension(parts):
            said.append(tr(page.NOT_COUNTED))
        say(f"       {tr(row['verdict']):<20} {'; '.join(said)}")


def print_readings(done: "Done", detailed: bool) -> None:
    """A line a claim, of single claims a line a reading too, and what the joint search came to."""
    from radarsim.report.claims import reasons

    for read in done.read:
        for over in read.over:
            if detailed:
                for one in over.under:
                    outcome = (
                        tr(one.outcome.kind) if one.outcome else tr("not possible: {why}", why=reasons.said(one.why))
                    )
                    say(f"       {one.kind}  {outcome:<24} {one.name}")
            found = over.outcome
            words = tr(found.kind) if found else tr("not judged")  # on what it depends, the sentence says
            say(f"{over.claim.id:<6} {words:<28} {over.sentence()}")
        if read.counted is not None:
            say(f"{read.paper.readings.paper}: {read.counted.sentence()}")
    if done.files:
        drawn = plural("{count} figure drawn again", "{count} figures drawn again", len(done.files) - 1)
        field("table", tr("{file}; curves: {drawn}", file=str(done.folder / "readings.csv"), drawn=drawn))


def print_inventory(inventory: "Inventory") -> None:
    """Filters, studies, scenarios and configs, with a line on each: what is asked for most stands last."""
    for n, (title, columns, rows) in enumerate(reversed(inventory)):
        if n:
            say("")
        show(tr(title), columns, [(*row[:-1], tr(row[-1])) for row in rows])
