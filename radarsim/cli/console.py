"""What the terminal shows: progress with rate and time left, tables of the answer, where things were written."""

import math
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from radarsim.report.text import clock, known, plural, printable, significant_digits

SILENT_S = 2.0  # a run shorter than this shows no progress
PIPED_WIDTH = 10_000  # whatever reads it wraps it, or not
ROOMY = 110  # columns of a terminal from which claims are told with place and config
MOST_ROWS = 36  # of the last scan's table; a larger experiment speaks by its answer and files


def console(stderr: bool = False):
    """A rich console; plain text of a fixed width where the stream is no terminal."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else PIPED_WIDTH
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False, soft_wrap=not stream.isatty())


class Progress:
    """What is done, its rate and the time left, on stderr if that is a terminal, once it has lasted two seconds."""

    def __init__(self, title: str, quiet: bool, what: str = "realisations"):
        self.title, self.quiet, self.what = title, quiet, what
        self.started, self.bar = time.monotonic(), None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.stop()

    def update(self, done: int, total: int, from_store: int) -> None:
        """How many are done, of how many, and how many of them were read from the store."""
        elapsed = time.monotonic() - self.started
        if self.quiet or elapsed < SILENT_S or not sys.stderr.isatty():
            return
        if self.bar is None:
            self._begin(total)
        rate = (done - from_store) / elapsed
        left = clock((total - done) / rate) if rate > 0 else "–"
        self.bar.update(self.task, completed=done, rate=rate, left=left)

    def _begin(self, total: int) -> None:
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn(
                "{task.percentage:5.1f} %  {task.fields[rate]:,.0f} " + f"{self.what}/s  {{task.fields[left]}} left"
            ),
        )
        self.bar = Bar(*columns, console=console(stderr=True), transient=True)
        self.task = self.bar.add_task(self.title, total=total, rate=0.0, left="–")
        self.bar.start()


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
    """Print one line, never wrapped."""
    sys.stdout.write(printable(line) + "\n")


def print_result(result) -> None:
    """The answer of a run, σ at the last scan, the verdicts, and where everything lies."""
    written = result.written
    for line in written.answer:
        say(line)
    show_last_scan(result.last_scan)
    verdicts = result.verdicts()
    if verdicts:
        for verdict, names in verdicts.items():
            say(f"claims   {len(names)} {verdict}: {', '.join(names)}")
        say(f"         `radarsim claims {result.experiment.stem}` says what each of them is")
    drawn = [Path(name) for name in written.files if name.startswith("figures/")]
    say(f"tables   {written.folder / 'curves.csv'} and {sum(n.endswith('.csv') for n in written.files) - 1} more there")
    if drawn:
        kinds = " and ".join(sorted({path.suffix[1:].upper() for path in drawn}, reverse=True))
        say(f"figures  {written.folder / 'figures'} ({len({path.stem for path in drawn})}, each as {kinds})")
    say(f"report   {written.folder / 'report.html'}")
    print_warnings(result.warnings)


def print_warnings(warnings: Iterable[str]) -> None:
    """One line each, on the error stream."""
    for warning in warnings:
        sys.stderr.write(f"warning: {printable(warning)}\n")


def show_last_scan(last) -> None:
    """σ with interval, exact σ and gain of each case, filter and component at the last scan, unless too many."""
    if not 0 < len(last) <= MOST_ROWS:
        return
    rows = [
        (
            *(row.case, row.filter, row.component, f"{row.t_s:g} s"),
            f"{significant_digits(row.sigma)} {row.unit.replace('s2', 's²')}",
            f"{significant_digits(row.sigma_lo)} … {significant_digits(row.sigma_hi)}",
            known(row.exact_sigma),
            known(row.gain_percent, ".2f", " %"),
            known(row.gain_lo, ".2f", " … ") + known(row.gain_hi, ".2f"),
        )
        for row in last.itertuples()
    ]
    columns = ("case", "filter", "component", "at", "sigma", "95 %", "exact", "gain", "95 % of gain")
    show("", columns, rows, right=columns[3:], spare=("95 % of gain", "exact", "95 %", "gain"))


def print_outlook(experiment, outlook) -> None:
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


def print_needs(experiment, outlook) -> None:
    """How many realisations a precision takes, and whether the run may do so many."""
    asked = {case.name: case.realisations for case in experiment.cases}
    needs = {case.name: case.need for case in outlook.cases}
    rows = [
        (name, "out of reach" if need.realisations is None else f"{need.realisations:,}", need.known_by, need.last)
        for name, need in needs.items()
    ]
    columns = ("case", f"for ± {outlook.precision:g} %", "known from", "last to get there")
    show("", columns, rows, right=columns[1:2], spare=columns[3:])
    short = [name for name, need in needs.items() if need.realisations is None or need.realisations > asked[name]]
    if short:
        most = max((need.realisations or math.inf) for need in needs.values())
        cure = f"; -n {most} would do" if math.isfinite(most) else ""
        say(f"precision not within reach of {plural(len(short), 'case')}: {', '.join(short[:3])}{cure}")


def print_share(share, out) -> None:
    """What a share of an experiment came to, and what to do with it."""
    done = sum(one.done for one in share.cases.values())
    held = sum(one.from_store for one in share.cases.values())
    say(f"share    {share.number} of {share.of} of {share.config}: {done:,} realisations, {held:,} were stored before")
    say(f"blocks   {Path(out) / '.blocks'}; copy all shares into one, and `radarsim run` finds them")
    print_warnings(share.warnings)


def print_facts(facts: Mapping[str, str]) -> None:
    """Labels and what there is to say of them, a line each."""
    width = max(map(len, facts))
    for label, words in facts.items():
        say(f"{label:<{width}}  {words}")


def print_inspection(found) -> None:
    """What a look over a result found; its faults are told as errors."""
    say(f"{found.folder}: {plural(found.outputs, 'output')} and {plural(found.pieces, 'stored piece')} checked")
    if found.recomputed:
        pieces = plural(len(found.recomputed), "piece")
        say(f"computed again: {pieces}, {found.realisations:,} realisations")
    for note in found.notes:
        say(f"note: {note}")
    say("all whole" if not found.faults else f"{plural(len(found.faults), 'fault')} found")


def print_cleaned(cleaned, dry_run: bool) -> None:
    """How much was dropped, or would be."""
    what = f"{plural(cleaned.files, 'file')} of {plural(cleaned.identities, 'case')}, {cleaned.size / 1e6:.1f} MB"
    say(f"{'would drop' if dry_run else 'dropped'} {what} in {cleaned.path}")


def print_claims(rows: Sequence[dict]) -> None:
    """Each claim with its verdict, and below it what was measured, or the command that would judge it.

    On a terminal a table; where it is piped, lines that can be searched.
    """
    from radarsim.report.claims import page

    if sys.stdout.isatty():
        cells = []
        for claim in dict.fromkeys(row["claim"] for row in rows):
            own = [row for row in rows if row["claim"] == claim]
            first, done = own[0], own[0]["overall"] != "not run"
            told = "\n".join(page.measured(row) for row in own) if done else f"radarsim run {first['config']}"
            cells.append((claim, first["statement"], first["place"], told, first["overall"], first["config"]))
        columns = ("claim", "statement", "place", "measured", "verdict", "config")
        show("", columns, cells, spare=() if console().width >= ROOMY else ("place", "config"))
    else:
        _print_claim_lines(rows, page.measured)
    say(page.counted(rows) or "no claims are judged by this")
    if rows and all(row["overall"] == "not run" for row in rows):
        say("nothing is run here: `make reproduce-figures` runs it all, docs/claims.md has what came out at full size")


def _print_claim_lines(rows: Sequence[dict], measured: Callable[[Mapping], str]) -> None:
    last = None
    for row in rows:
        if row["claim"] != last:
            last = row["claim"]
            say(f"{last:<6} {row['overall']:<20} {row['statement']}  [{row['paper']}, {row['place']}]")
            if row["overall"] == "not run":
                say(f"       radarsim run {row['config']}")
        if row["overall"] != "not run":
            words = f"{row['case']}: {row['what']} {measured(row)}; expected {row['expected']}"
            say(f"       {row['verdict']:<20} {words}")


def print_inventory(inventory) -> None:
    """Configs, scenarios, studies and filters, with a line of what each is."""
    for title, columns, rows in inventory:
        show(title, columns, rows)
        say("")
