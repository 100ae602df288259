"""Open a recording with the reader of its format."""

import codecs
import gzip
import io
import os
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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

UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
ENCODING_NAMES = {  # as spreadsheets write them
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
        if head[:2] in UTF16_MARKS:
            return "utf-16"
        even, odd = head[::2].count(0), head[1::2].count(0)
        if max(even, odd) > max(10 * min(even, odd), len(head) / 10):  # for digits and commas one byte of two is zero
            return "utf-16-le" if odd > even else "utf-16-be"
        decoder = codecs.getincrementaldecoder("utf-8")()
        try:
            while piece := file.read(1 << 20):
                decoder.decode(piece)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return fallback or _detect_code_page(head)
    return "utf-8-sig"


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
    with open(path, "rb") as file:
        if file.peek(2)[:2] != GZIP_MAGIC:
            yield file
        else:
            with io.BufferedReader(cast(io.RawIOBase, gzip.open(file))) as inside:
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
    if head[:2] in UTF16_MARKS:
        head = head.decode("utf-16", "ignore").encode()
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
    text = b"\0" not in head and sum(byte < 9 or 13 < byte < 32 for byte in head) == 0
    lines = [line for line in head.splitlines() if line.strip() and not line.startswith(b"#")]
    if text and lines and any(sign in lines[0] for sign in (b",", b";", b"\t")):
        names = lines[0].lower()
        return "opensky" if b"icao24" in names and b"lat" in names else "csv"
    if not text and asterix.looks_like(head):
        return "asterix"
    raise ConfigError(f"{path}: must be a recording in one of {', '.join(FORMATS)}; its first bytes are of none: "
                      f"{head[:16].hex(' ')}; if it is one: --from FORMAT")  # fmt: skip
