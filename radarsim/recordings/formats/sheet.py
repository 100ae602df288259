"""A file as a table of texts, and CSV as one.

Readers of other formats (JSON, Parquet, GPX, NMEA 0183) give a `Sheet`, too, whose header states the units, so that
`table.Table` reads all of them alike.

Cells of CSV are separated by commas, semicolons or tabs: by the separator that parts header and rows into equally many
cells, else by the most frequent in the header; without any of these by bars or blanks. With a separator other than a
comma, numbers may have a decimal comma.

The lines of a BaseStation port (SBS) have no header, or that of their fields; messages without a position are left
out."""

import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TextIO

from radarsim.errors import ConfigError
from radarsim.language.translate import term
from radarsim.recordings.formats.columns import QUANTITIES, known_names
from radarsim.recordings.formats.units import UNITS, cell_unit, is_same_unit, split_unit

DELIMITERS = ",;\t"
CSV_DELIMITERS = {"|": "|", " ": "\t"}  # of drawn tables, and of blanks, by that of the lines which are made of them
RULE_PATTERN = re.compile(r"[-+|:=\s]*[-+=|]{2}[-+|:=\s]*")  # between the rows of a drawn table
SEPARATOR_PATTERN = re.compile(r"\"?sep=(.)\"?[,;]*", re.IGNORECASE)  # a line that states the separator
MAX_LINES_ABOVE, MIN_KNOWN_NAMES = 20, 2  # lines of text above a header; quantities that it then names
MAX_HEADER_LINES = 20  # of cells with line breaks
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
    """Read a CSV file as a sheet; lines of comment and of text may stand before the header, which shows the separator,
    and a line of units below it."""
    head = list(itertools.islice(file, MAX_LINES_ABOVE + SAMPLE_LINES))
    above, separator = _lines_above_header(head)
    last = _last_header_line(head, above)
    text, sample = "".join(head[above:last]), head[last:]
    delimiter = separator or _find_delimiter(text, sample)
    lines = itertools.chain(head[above:last], sample, file)
    comment = head[above - 1].removeprefix("#") if above and head[above - 1].startswith("#") else ""
    if text.startswith(BASESTATION_STARTS):
        lines, above = itertools.chain([",".join(BASESTATION_HEADER) + "\n"], lines), above - 1
    elif _is_header(comment, delimiter) and not _is_header(text, delimiter):
        lines, above = itertools.chain([comment], lines), above - 1
    cells = csv.reader(
        _cell_lines(lines, delimiter),
        strict=True,
        delimiter=CSV_DELIMITERS.get(delimiter, delimiter),
        quotechar="'" if text.startswith("'") and text.count("'") % 2 == 0 else '"',
    )

    def rows() -> Iterator[tuple[int, list[str]]]:
        last_line = 0
        try:
            for row in cells:
                last_line = cells.line_num
                if row:
                    yield above + last_line, row
        except csv.Error as error:
            if "unexpected end" in str(error):
                raise ConfigError(f"{path}:{above + last_line + 1}: must have pairs of quotation marks; one is open to "
                                  "the end of the file") from error  # fmt: skip
            cure = "; a quotation mark may be open" if "field limit" in str(error) else ""
            raise ConfigError(f"{path}:{above + cells.line_num}: not a CSV row: {error}{cure}") from error

    numbered_rows = rows()
    _, header = next(numbered_rows, (0, []))
    header = [name.lstrip("\ufeff") for name in header]  # the mark of a file that was put into another
    while header and not header[-1].strip():
        header.pop()
    split_rows = (_split(line, delimiter) for line in sample[:SAMPLE_LINES])
    sample_rows = [row for row in split_rows if len(row) >= len(header)]
    if sample_rows and (named_units := _with_units(header, sample_rows[0])):
        header, sample_rows = named_units, sample_rows[1:]
        next(numbered_rows)
    sheet = Sheet(path, header, iter(()), delimiter != ",", encoding, sample_rows)
    sheet.rows = _trim_rows(numbered_rows, len(header))
    if [split_unit(name)[0] for name in header[:5]] == [split_unit(name)[0] for name in BASESTATION_HEADER[:5]]:
        sheet.rows = _basestation_rows(numbered_rows, sheet)
    return sheet


def _lines_above_header(head: list[str]) -> tuple[int, str]:
    """How many lines stand before the header, empty, of comment or of text; and the separator that one of them states,
    as spreadsheets write it. Text is taken for a header unless a later line names more quantities."""
    first, separator = 0, ""
    while first < len(head) and (not (line := head[first].strip()) or line.startswith(("#", "sep=", '"sep='))):
        match = SEPARATOR_PATTERN.fullmatch(line)
        first, separator = first + 1, match[1] if match else separator
    if first == len(head):
        return first, separator
    delimiters = separator or DELIMITERS
    if not any(_known_count(head[first], delimiter) for delimiter in delimiters):
        for later, line in enumerate(head[first : first + MAX_LINES_ABOVE], start=first):
            is_header = any(_known_count(line, delimiter) >= MIN_KNOWN_NAMES for delimiter in delimiters)
            if is_header and not line.startswith("#"):
                return later, separator
    return first, separator


def _last_header_line(head: list[str], first: int) -> int:
    """The line after a header, whose cells in quotation marks may go on in further lines."""
    last = first + 1
    while "".join(head[first:last]).count('"') % 2 and last < min(len(head), first + MAX_HEADER_LINES):
        last += 1
    return last if "".join(head[first:last]).count('"') % 2 == 0 else first + 1


def _with_units(header: list[str], cells: list[str]) -> list[str]:
    """A header with the units in the cells below it, also of names that state another; empty where these are none."""
    units = [cell_unit(cell.strip().strip("[]()")) for cell in cells]
    if not any(unit in UNITS for unit in units) or any(unit not in {"", "-", *UNITS} for unit in units):
        return []
    names = []
    for name, unit in itertools.zip_longest(header, units, fillvalue=""):
        own_unit = split_unit(name)[1]
        is_stated = own_unit and (own_unit not in UNITS or is_same_unit(unit, own_unit))
        names.append(f"{name} [{unit}]" if unit in UNITS and not is_stated else name)
    return names


def _cell_lines(lines: Iterable[str], delimiter: str) -> Iterable[str]:
    """Lines whose cells are parted by one of CSV_DELIMITERS: rules between the rows of a drawn table become empty."""
    if delimiter not in CSV_DELIMITERS:
        return lines
    if delimiter == " ":
        return ("\t".join(line.split()) + "\n" for line in lines)
    return ("\n" if RULE_PATTERN.fullmatch(line) else _without_outer_bars(line.strip()) + "\n" for line in lines)


def _without_outer_bars(line: str) -> str:
    """A line without bars on both of its sides, as a table of Markdown has."""
    return line[1:].removesuffix("|") if line.startswith("|") else line


def _find_delimiter(header: str, sample: list[str]) -> str:
    """The separator that parts the header and the lines after it into equally many cells: rather semicolons or tabs,
    since commas may stand in names and numbers, unless commas part off more known names; where none does, the most
    frequent in the header."""
    if not any(map(header.count, DELIMITERS)):
        return "|" if "|" in header else " "
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
        reader = csv.reader(_cell_lines([line], delimiter), delimiter=CSV_DELIMITERS.get(delimiter, delimiter))
        cells = next(reader, [])
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
