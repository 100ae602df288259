"""Open a recording with the reader of its format."""

import codecs
import gzip
import io
import os
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, cast

from radarsim.errors import ConfigError
from radarsim.recordings.formats import ais, asterix, gpx, json_rows, nmea, parquet_rows
from radarsim.recordings.formats.ais import Ais
from radarsim.recordings.formats.asterix import Asterix
from radarsim.recordings.formats.import_options import FORMATS, Format, Options
from radarsim.recordings.formats.records import Reader
from radarsim.recordings.formats.sheet import Sheet, read_csv
from radarsim.recordings.formats.table import Table

SHEET_READERS: dict[Format, Callable[[str, io.BufferedReader], Sheet]] = {
    "json": json_rows.read_json,
    "parquet": parquet_rows.read_parquet,
    "gpx": gpx.read_gpx,
}
HEAD_BYTES = 4096  # bytes used to detect the format
GZIP_MAGIC = b"\x1f\x8b"  # how gzip begins
OTHER_FILES = {  # how files begin that are none, and what helps
    b"PK": "a workbook of a spreadsheet, or an archive: save the sheet as CSV, or unpack it",
    b"\xd0\xcf\x11\xe0": "a workbook of an old spreadsheet: save the sheet as CSV",
    b"SQLite format 3": "a data base: export the table as CSV",
    b"\x89HDF": "HDF5, or a file of Matlab: export the table as CSV",
    b"MATLAB": "a file of Matlab: export the table as CSV (writetable)",
    b"\x93NUMPY": "an array of NumPy: save it as CSV with a header",
    b"%PDF": "a document: export the table as CSV",
    b"7z\xbc\xaf": "an archive: unpack it",
    b"Rar!": "an archive: unpack it",
    b"BZh": "compressed by bzip2: unpack it",
    b"\xfd7zXZ": "compressed by xz: unpack it",
    b"\x28\xb5\x2f\xfd": "compressed by Zstandard: unpack it",
    b"<": "a page or another file of markup: export the table as CSV, or the track as GPX",
}
CELL_BREAK = re.compile(rb"[,;\t|]|(?<=\S)[ ]+(?=\S)")

CUT_REASON = "unexpected end of data"  # of a decoder, where a text ends within a letter
UTF32_MARKS = (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)
UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
ENCODING_NAMES = {  # as spreadsheets write them
    "utf-32": "UTF-32",
    **dict.fromkeys(("utf-16", "utf-16-le", "utf-16-be"), "UTF-16"),
    **{"utf-8-sig": "UTF-8", "cp1252": "Windows-1252", "cp1251": "Windows-1251", "koi8-r": "KOI8-R", "cp866": "CP866"},
}
CYRILLIC_ENCODINGS = ("cp1251", "koi8-r", "cp866")
MIN_CYRILLIC_SHARE = 0.7  # of the letters beyond ASCII
CYRILLIC_WORD = re.compile(r"[А-ЯЁ]?[а-яё]{2,}|[А-ЯЁ]{2,}")  # words have small letters, or are of capitals


def detect_encoding(path: str | os.PathLike, fallback: str) -> str:
    """The encoding of a text file: UTF-16 by its mark or zeros, else UTF-8; if it is not UTF-8, the fallback, or a
    Cyrillic one whose words are found, or Windows-1252."""
    if not os.path.isfile(path):  # a stream is read once
        return fallback or "utf-8-sig"
    with open_unzipped(path) as file:
        head = file.peek(HEAD_BYTES)[:HEAD_BYTES]
        if encoding := _wide_encoding(head):
            return encoding
        decoder = codecs.getincrementaldecoder("utf-8")()
        try:
            while piece := file.read(1 << 20):
                decoder.decode(piece)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError as error:
            if CUT_REASON in error.reason:
                return fallback or "utf-8-sig"
            return fallback or _detect_code_page(head)
    return "utf-8-sig"


def _wide_encoding(head: bytes) -> str:
    """UTF-16 by its mark or zeros, UTF-32 by its mark; '' of another text."""
    if head[:4] in UTF32_MARKS:
        return "utf-32"
    if head[:2] in UTF16_MARKS:
        return "utf-16"
    even, odd = head[::2].count(0), head[1::2].count(0)
    if max(even, odd) > max(10 * min(even, odd), len(head) / 10):  # for digits and commas one byte of two is zero
        return "utf-16-le" if odd > even else "utf-16-be"
    return ""


def _detect_code_page(head: bytes) -> str:
    """The 8-bit encoding of a text: Cyrillic where almost all of its letters beyond ASCII are in Cyrillic words."""
    shares = {}
    for encoding in CYRILLIC_ENCODINGS:
        text = head.decode(encoding, "replace")
        foreign = sum(not letter.isascii() for letter in text)
        shares[encoding] = sum(len(word) for word in CYRILLIC_WORD.findall(text)) / max(foreign, 1)
    best = max(shares, key=shares.__getitem__)
    return best if shares[best] > MIN_CYRILLIC_SHARE else "cp1252"


@contextmanager
def open_unzipped(path: str | os.PathLike) -> Iterator["io.BufferedReader[Any]"]:
    """Open a file of bytes; a gzipped one is unzipped."""
    with open(path, "rb") as file, ExitStack() as stack:
        inside = cast("io.BufferedReader[Any]", file)
        while inside.peek(2)[:2] == GZIP_MAGIC:  # by some programs twice
            raw = cast(io.RawIOBase, stack.enter_context(gzip.open(inside)))
            inside = stack.enter_context(io.BufferedReader(raw))
        yield inside


@contextmanager
def open_recording(path: str, options: Options, truth: bool = False) -> Iterator[tuple[Format, Reader]]:
    """Open a recording with the reader of the given format, or of the detected one; raises ConfigError.

    truth: only the positions of an ASTERIX file, or of a ship's log, are needed."""
    encoding = "utf-8-sig"
    try:
        with open_unzipped(path) as file:
            head = file.peek(HEAD_BYTES)[:HEAD_BYTES]
            format_ = options.format or detect_format(path, head)
            if format_ == "asterix":
                yield format_, Asterix(path, file, truth, options.keep_marked)
            elif format_ == "ais":
                yield format_, Ais(path, file)
            elif format_ == "nmea":
                yield format_, Table(nmea.read_nmea(path, file, truth), options.columns)
            elif format_ in SHEET_READERS:
                yield format_, Table(SHEET_READERS[format_](path, file), options.columns)
            else:
                encoding = detect_encoding(path, options.encoding)
                text = io.TextIOWrapper(file, encoding=encoding, newline="")
                yield format_, Table(read_csv(path, text, ENCODING_NAMES.get(encoding, encoding)), options.columns)
    except UnicodeDecodeError as error:
        if error.reason in (CUT_REASON, "truncated data"):
            raise ConfigError(f"{path}: is damaged: it ends within a letter; take out the last line") from error
        raise ConfigError(
            f"{path}: is not {ENCODING_NAMES.get(encoding, encoding)} text: --encoding NAME names it"
        ) from error
    except (EOFError, zlib.error) as error:
        raise ConfigError(f"{path}: is damaged: {error}") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error


def detect_format(path: str, head: bytes) -> Format:
    """Detect the format of a file from its first bytes; raises ConfigError."""
    if not head:
        raise ConfigError(f"{path}: is empty")
    if (encoding := _wide_encoding(head)) and is_table(text := head.decode(encoding, "ignore").encode()):
        head = text
    if ais.SENTENCE_PATTERN.search(head):
        return "ais"
    if nmea.SENTENCE_PATTERN.search(head):
        return "nmea"
    if head.startswith(b"PAR1"):
        return "parquet"
    start = head.removeprefix(codecs.BOM_UTF8).lstrip()
    if start.startswith(b"<") and b"<gpx" in head:
        return "gpx"
    if start.startswith((b"{", b"[")):
        return "json"
    if kinds := sorted({kind.decode() for kind in nmea.ANY_SENTENCE_PATTERN.findall(head)}):
        allowed = "RMC, GGA, GLL, TTM, TLL or VDM"
        raise ConfigError(f"{path}: must have sentences of NMEA 0183 with positions or targets, {allowed}; it begins "
                          f"with {', '.join(kinds)}")  # fmt: skip
    if is_table(head):
        names = next(line for line in head.splitlines() if line.strip() and not line.startswith(b"#")).lower()
        return "opensky" if b"icao24" in names and b"lat" in names else "csv"
    if not _is_text(head) and asterix.looks_like(head):
        return "asterix"
    if other := next((cure for mark, cure in OTHER_FILES.items() if start.startswith(mark)), ""):
        raise ConfigError(f"{path}: must be a recording in one of {', '.join(FORMATS)}; it is {other}")
    if (zeros := head.count(0)) and is_table(head.replace(b"\0", b"")):
        raise ConfigError(f"{path}: must be text; it has bytes of zero, as a log has that was cut off: take them out "
                          f"(tr -d '\\000'); {zeros} of the first {len(head)}")  # fmt: skip
    raise ConfigError(f"{path}: must be a recording in one of {', '.join(FORMATS)}; its first bytes are of none: "
                      f"{head[:16].hex(' ')}; if it is one: --from FORMAT")  # fmt: skip


def _is_text(head: bytes) -> bool:
    """Whether a file with this beginning has no bytes that texts have not."""
    return not any(byte < 9 or 13 < byte < 32 for byte in head)


def is_table(head: bytes) -> bool:
    """Whether a file with this beginning is text of lines with several cells, none of a markup language."""
    lines = [line for line in head.splitlines() if line.strip() and not line.startswith(b"#")]
    has_cells = any(len(CELL_BREAK.split(line)) > 1 for line in lines)
    return _is_text(head) and has_cells and not lines[0].lstrip(codecs.BOM_UTF8).lstrip().startswith((b"<", b"%"))
