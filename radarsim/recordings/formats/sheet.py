"""A file as a table of texts, and CSV as one.

Readers of other formats (JSON, Parquet, GPX, NMEA 0183) give a `Sheet`, too, whose header states the units, so that
`table.Table` reads all of them alike.

Cells of CSV are separated by commas, semicolons or tabs: by the separator that parts header and rows into equally many
cells, else by the most frequent in the header. With a separator other than a comma, numbers may have a decimal comma.

The lines of a BaseStation port (SBS) have no header, or that of their fields; messages without a position are left
out."""

import csv
import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TextIO

from radarsim.errors import ConfigError
from radarsim.language.translate import term
from radarsim.recordings.formats.columns import QUANTITIES, known_names
from radarsim.recordings.formats.units import split_unit

DELIMITERS = ",;\t"
SAMPLE_LINES = 20  # lines after the header that show the separator, and what the columns hold
BASESTATION_STARTS = ("MSG,", "STA,", "AIR,", "SEL,", "ID,", "CLK,")
BASESTATION_HEADER = (  # of the fields of such a port; what is meant by a name that has no unit is fixed
    *("MessageType", "TransmissionType", "SessionID", "AircraftID", "HexIdent", "FlightID", "DateMessageGenerated"),
    *("TimeMessageGenerated", "DateMessageLogged", "TimeMessageLogged", "Callsign", "Altitude [ft]"),
    *("GroundSpeed [kn]", "Track [deg]", "Latitude", "Longitude", "VerticalRate [fpm]", "Squawk", "Alert", "Emergency"),
    *("SPI", "IsOnGround"),
)


@dataclass
class Sheet:
    """A file as a table: the header, then rows, each with its line or number in the file.

    decimal_comma: numbers may have one. encoding: of the file. sample: some rows, for guesses. is_one_track: whether
    the rows are known to be of one target. skipped, notes: records that are no rows, by reason, and what was assumed in
    reading them."""

    path: str
    header: list[str]
    rows: Iterator[tuple[int, list[str]]]
    decimal_comma: bool = False
    encoding: str = "UTF-8"
    sample: list[list[str]] = field(default_factory=list)
    is_one_track: bool = False
    skipped: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)


def read_csv(path: str, file: TextIO, encoding: str) -> Sheet:
    """Read a CSV file as a sheet; lines of comment may stand before the header, which shows the separator."""
    skipped_lines, comment, text = 0, "", ""
    for text in file:
        if text.strip() and not text.startswith("#"):
            break
        skipped_lines, comment, text = skipped_lines + 1, text, ""
    sample = list(itertools.islice(file, SAMPLE_LINES))
    delimiter = _find_delimiter(text, sample)
    lines = itertools.chain([text], sample, file)
    if text.startswith(BASESTATION_STARTS):
        lines, skipped_lines = itertools.chain([",".join(BASESTATION_HEADER) + "\n"], lines), skipped_lines - 1
    elif _is_header(comment[1:], delimiter) and not _is_header(text, delimiter):
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
    sample_rows = [row for row in (_split(line, delimiter) for line in sample) if len(row) >= len(header)]
    sheet = Sheet(path, header, iter(()), delimiter != ",", encoding, sample_rows)
    sheet.rows = _trim_rows(numbered_rows, len(header))
    if [split_unit(name)[0] for name in header[:5]] == [split_unit(name)[0] for name in BASESTATION_HEADER[:5]]:
        sheet.rows = _basestation_rows(numbered_rows, sheet)
    return sheet


def _find_delimiter(header: str, sample: list[str]) -> str:
    """The separator that parts the header and the lines after it into equally many cells: rather semicolons or tabs,
    since commas may stand in names and numbers, unless commas part off more known names; where none does, the most
    frequent in the header."""
    frequent = max(DELIMITERS, key=header.count)
    lines = [line for line in sample if line.strip()]
    for delimiter in ("\t", ";") if frequent == "," and lines else ():
        width = len(_split(header, delimiter))
        if _known_count(header, delimiter) < _known_count(header, ","):
            continue
        if width > 1 and all(1 < len(_split(line, delimiter)) <= width for line in lines):
            return delimiter
    return frequent


def _known_count(header: str, delimiter: str) -> int:
    """How many names of a header are those of quantities."""
    stems = {split_unit(name)[0] for name in _split(header, delimiter)}
    return sum(not stems.isdisjoint(known_names(ours)) for ours in QUANTITIES)


def _split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without empty ones at its end; none of a line that is no CSV."""
    try:
        cells = next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return []
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


def _basestation_rows(rows: Iterator[tuple[int, list[str]]], sheet: Sheet) -> Iterator[tuple[int, list[str]]]:
    """The messages of a BaseStation port that have a position; those on the ground have no altitude."""
    stems = [split_unit(name)[0] for name in sheet.header]
    width, latitude = len(stems), stems.index("latitude") if "latitude" in stems else -1
    for line, row in rows:
        row += [""] * (width - len(row))
        if row[0].strip() != "MSG" or not row[latitude].strip():
            sheet.skipped[term("messages without a position")] += 1
        else:
            yield line, row[:width]


def _is_header(line: str, delimiter: str) -> bool:
    """Whether a line names a column of time."""
    return any(split_unit(name)[0] in known_names("t_s") for name in line.strip().split(delimiter))


def _trim_rows(rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[tuple[int, list[str]]]:
    """Remove separators after the last cell of each row."""
    for line, row in rows:
        if len(row) > width and not any(cell.strip() for cell in row[width:]):
            del row[width:]
        yield line, row
