"""Lines, tables and warnings on the terminal."""

import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from radarsim.language.translate import plural, term, tr
from radarsim.report.output_labels import labelled_line
from radarsim.report.wording import printable, with_unbroken_units

if TYPE_CHECKING:
    from rich.console import Console


PIPED_WIDTH = 10_000  # whatever reads it wraps it, or not
COLUMN_HEADINGS = (  # of tables
    *(term("case"), term("filter"), term("component"), term("at"), term("sigma"), term("exact"), term("bound")),
    *(term("gain"),),
    *(term("95 % of gain"), term("of"), term("change"), term("filters"), term("scans")),
    *(term("realisations"), term("one thread"), term("known from"), term("last to get there"), term("claim")),
    *(term("statement"), term("place"), term("measured and expected"), term("class"), term("config"), term("key")),
    *(term("RMS error"), term("unit"), term("of own σ"), term("estimates"), term("number"), term("plots"), term("NIS")),
    *(term("95 % from"), term("95 % to"), term("stated σ"), term("stated"), term("tuned")),
    *(term("value"), term("name"), term("what it is"), term("paper and question"), term("study"), term("keys")),
)


def rich_console(stream: TextIO) -> "Console":
    """A rich console; plain text of a fixed width where the stream is no terminal."""
    from rich.console import Console

    width = None if stream.isatty() else PIPED_WIDTH
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False, soft_wrap=not stream.isatty())


def print_table(
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
    screen = rich_console(stream)
    cells = [["\n".join(map(printable, str(cell).split("\n"))) for cell in row] for row in rows]
    column_indices = fitting_columns(columns, cells, spare, screen.width, [tr(name) for name in columns])
    terminal = stream.isatty()
    style: dict[str, Any] = {"box": box.SIMPLE_HEAD, "padding": (0, 1, 0, 0)} if terminal else {"box": None}
    table = Table(title=title or None, title_justify="left", pad_edge=False, **style)
    for i in column_indices:
        table.add_column(tr(columns[i]), justify="right" if columns[i] in right else "left", no_wrap=not terminal)
    for row in cells:
        table.add_row(*(Text(row[i]) for i in column_indices))
    with screen.capture() as captured:
        screen.print(table)
    for line in captured.get().rstrip("\n").split("\n"):
        stream.write(line.rstrip() + "\n")
    if missing := [columns[i] for i in range(len(columns)) if i not in column_indices]:
        missing_names = ", ".join(map(tr, missing))
        print_field("", tr("left out at {width} columns: {columns}", width=screen.width, columns=missing_names))


def fitting_columns(
    columns: Sequence[str],
    cells: Sequence[Sequence[str]],
    spare: Sequence[str],
    width: int,
    headings: Sequence[str] | None = None,
) -> list[int]:
    """The indices of the columns that fit into a width, the spare ones left out one by one; headings: as printed."""
    widths = [
        max(len(line) for text in (name, *(row[i] for row in cells)) for line in text.split("\n"))
        for i, name in enumerate(headings or columns)
    ]
    column_indices, spare_names = list(range(len(columns))), [name for name in spare if name in columns]
    while spare_names and sum(widths[i] + 2 for i in column_indices) > width:
        column_indices.remove(list(columns).index(spare_names.pop(0)))
    return column_indices


def print_line(line: str) -> None:
    """Print one line: to a terminal broken between words at its width; else never broken."""
    for broken_line in break_lines(printable(line), sys.stdout):
        sys.stdout.write(broken_line + "\n")


def print_command(label: str, text: str) -> None:
    """Print a command under a label, in one line, however long, for copying."""
    sys.stdout.write(printable(labelled_line(label, text)) + "\n")


def break_lines(text: str, stream: TextIO) -> list[str]:
    """A line for a stream: for a terminal broken at its width; else whole."""
    return wrap_line(text, shutil.get_terminal_size().columns) if stream.isatty() else [text]


def print_error_line(line: str) -> None:
    """Print one line on the error stream, to a terminal broken between words."""
    for broken_line in break_lines(printable(line), sys.stderr):
        sys.stderr.write(broken_line + "\n")


def print_field(label: str, text: str) -> None:
    """Print a line under a label; without one it stands under the line before."""
    print_line(labelled_line(label, text))


def wrap_line(line: str, width: int) -> list[str]:
    """A line broken between words, a unit kept with its number; further lines are indented to its last column."""
    columns = [gap.end() for gap in re.finditer(r"(^| ) +(?=\S)", line) if gap.end() < width // 2]
    indent = " " * max(columns, default=0)
    unbroken_line = with_unbroken_units(line)
    broken_lines = textwrap.wrap(
        unbroken_line,
        width,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
        drop_whitespace=True,
    )
    return [broken_line.replace("\N{NO-BREAK SPACE}", " ") for broken_line in broken_lines] or [""]


def print_warnings(warnings: Iterable[str]) -> None:
    """One line each, on the error stream."""
    for warning in warnings:
        print_error_line(tr("warning: {words}", words=printable(warning)))


def case_count_text(count: int) -> str:
    """1 case, 2 cases."""
    return plural("{count} case", "{count} cases", count)


def print_facts(facts: Mapping[str, str]) -> None:
    """Labels and their facts, a line each."""
    width = max(len(tr(label)) for label in facts)
    for label, fact in facts.items():
        print_line(f"{tr(label):<{width}}  {fact}")
