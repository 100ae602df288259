"""A file as a table of texts, and CSV as one.

Readers of other formats (JSON, Parquet, GPX, NMEA 0183) give a `Sheet`, too, whose header states the units, so that
`table.Table` reads all of them alike.

Cells of CSV are separated by commas, semicolons or tabs, whichever is most frequent in the header; with a separator
other than a comma, numbers may have a decimal comma."""

import csv
import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TextIO

from radarsim.errors import ConfigError
from radarsim.recordings.formats.columns import QUANTITIES, split_unit

DELIMITERS = ",;\t"


@dataclass
class Sheet:
    """A file as a table: the header, then rows, each with its line or number in the file.

    decimal_comma: numbers may have one. encoding: of the file. skipped, notes: records that are no rows, by reason, and
    what was assumed in reading them."""

    path: str
    header: list[str]
    rows: Iterator[tuple[int, list[str]]]
    decimal_comma: bool = False
    encoding: str = "UTF-8"
    skipped: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)


def read_csv(path: str, file: TextIO, encoding: str) -> Sheet:
    """Read a CSV file as a sheet; lines of comment may stand before the header, which shows the separator."""
    skipped_lines, comment, text = 0, "", ""
    for text in file:
        if text.strip() and not text.startswith("#"):
            break
        skipped_lines, comment, text = skipped_lines + 1, text, ""
    delimiter = max(DELIMITERS, key=text.count)
    lines = itertools.chain([text], file)
    if _is_header(comment[1:], delimiter) and not _is_header(text, delimiter):
        lines, skipped_lines = itertools.chain([comment[1:]], lines), skipped_lines - 1
    cells = csv.reader(lines, strict=True, delimiter=delimiter)

    def rows() -> Iterator[tuple[int, list[str]]]:
        try:
            for row in cells:
                if row:
                    yield skipped_lines + cells.line_num, row
        except csv.Error as error:
            raise ConfigError(f"{path}:{skipped_lines + cells.line_num}: not a CSV row: {error}") from error

    numbered_rows = rows()
    _, header = next(numbered_rows, (0, []))
    while header and not header[-1].strip():
        header.pop()
    return Sheet(path, header, _trim_rows(numbered_rows, len(header)), delimiter != ",", encoding)


def _is_header(line: str, delimiter: str) -> bool:
    """Whether a line names a column of time."""
    return any(split_unit(name)[0] in QUANTITIES["t_s"].names for name in line.strip().split(delimiter))


def _trim_rows(rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[tuple[int, list[str]]]:
    """Remove separators after the last cell of each row."""
    for line, row in rows:
        if len(row) > width and not any(cell.strip() for cell in row[width:]):
            del row[width:]
        yield line, row
