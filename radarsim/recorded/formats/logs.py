"""Read JSON, Parquet, GPX and the sentences of a satellite receiver as tables.

Each becomes a `Sheet` whose header states the units, so that `Table` reads it like any CSV."""

import contextlib
import datetime
import io
import itertools
import json
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO
from xml.etree import ElementTree

from radarsim.errors import ConfigError
from radarsim.language import term, tr
from radarsim.recorded.formats import sites
from radarsim.recorded.formats.text import Sheet

# ---- JSON ------------------------------------------------------------------------------------------------------------
READSB_HEADER = [
    "time",
    "icao24",
    "lat",
    "lon",
    "alt_geom [ft]",
    "alt_baro [ft]",
    "gs [kn]",
    "track [deg]",
    "climb [fpm]",
]
OPENSKY_COLUMNS = {  # of OpenSky's interface: our names for the places of its lists
    "icao24": 0, "callsign": 1, "time_position": 3, "lon": 5, "lat": 6, "baroaltitude [m]": 7, "velocity [m/s]": 9,
    "true_track": 10, "vertrate [m/s]": 11, "geoaltitude [m]": 13,
}  # fmt: skip
STALE_FLAG, GEOMETRIC_FLAG = 1, 8  # flags of a trace


def read_json(path: str, file: BinaryIO) -> Sheet:
    """JSON documents, one in the file or one a line: traces and `aircraft.json` of readsb and tar1090, states of
    OpenSky, lists of records and tables of columns as data frames are written. A document is held in memory."""
    sheet = Sheet(path, [], iter(()))
    documents = _documents(path, file)
    rows = (row for document in documents for row in _document_rows(document, sheet))
    first = next(rows, None)
    if first is not None:
        sheet.rows = enumerate(itertools.chain([first], rows), start=1)
    if not sheet.header:
        must = "a trace or aircraft.json of readsb, states of OpenSky, or records with time, latitude and longitude"
        raise ConfigError(f"{path}: must be {must}")
    return sheet


def _documents(path: str, file: BinaryIO) -> Iterator[Any]:
    first = file.readline()
    try:
        yield json.loads(first)
    except (ValueError, RecursionError):
        lines: Any = [first + file.read()]  # a document over many lines
        start = 1
    else:
        lines, start = file, 2
    for number, line in enumerate(lines, start):
        if line.strip():
            try:
                yield json.loads(line)
            except (ValueError, RecursionError) as error:
                line_number = number + getattr(error, "lineno", 1) - 1
                raise ConfigError(f"{path}:{line_number}: must be JSON: {getattr(error, 'msg', error)}") from error


def _document_rows(document: Any, sheet: Sheet) -> Iterator[list[str]]:
    """The rows of a document; the first one gives the sheet its header."""
    if not isinstance(document, dict):
        rows = _record_rows(document, sheet) if isinstance(document, list) else iter(())
    elif isinstance(document.get("trace"), list):
        rows = _trace_rows(document, sheet)
    elif isinstance(document.get("aircraft"), list):
        rows = _aircraft_rows(document, sheet)
    elif isinstance(document.get("states"), list):
        rows = _state_rows(document, sheet)
    elif document and all(isinstance(column, dict | list) for column in document.values()):
        columns = [column.values() if isinstance(column, dict) else column for column in document.values()]
        rows = _record_rows([dict(zip(document, row, strict=True)) for row in zip(*columns, strict=False)], sheet)
    else:
        rows = _record_rows([document], sheet)
    return rows


def _trace_rows(document: dict[str, Any], sheet: Sheet) -> Iterator[list[str]]:
    """A trace of readsb: lists of seconds after its time, latitude, longitude, altitude, speed, course, flags, climb,
    aircraft, source, geometric altitude (README-json of readsb)."""
    sheet.header = READSB_HEADER
    start, name = finite_number(document.get("timestamp")), cell_text(document.get("icao"))
    for entry in document["trace"]:
        entry = entry if isinstance(entry, list) else []
        dt, lat, lon, altitude, speed, course, flags, climb, _, _, geometric = [*entry, *[None] * 11][:11]
        flags = flags if isinstance(flags, int) else 0
        if flags & STALE_FLAG:
            sheet.skipped[term("positions marked as stale")] += 1
            continue
        if altitude == "ground":  # then the course is where the nose points
            altitude = course = None
        if geometric is None and flags & GEOMETRIC_FLAG:
            geometric, altitude = altitude, None
        cells = (start + finite_number(dt), name, lat, lon, geometric, altitude, speed, course, climb)
        yield [*map(cell_text, cells)]


def _aircraft_rows(document: dict[str, Any], sheet: Sheet) -> Iterator[list[str]]:
    """A moment of readsb: the state of each aircraft, and its age."""
    sheet.header = [*READSB_HEADER, "callsign", "squawk"]
    time_now = finite_number(document.get("now"))
    for aircraft in document["aircraft"]:
        aircraft = aircraft if isinstance(aircraft, dict) else {}
        time = time_now - finite_number(aircraft.get("seen_pos"))
        is_on_ground = aircraft.get("alt_baro") == "ground"
        names = (
            "lat",
            "lon",
            "alt_geom",
            *(("",) * is_on_ground or ("alt_baro",)),
            "gs",
            *(("",) * is_on_ground or ("track",)),
        )
        climb = aircraft.get("geom_rate", aircraft.get("baro_rate"))
        cells = (time, *map(aircraft.get, ("hex", *names)), climb, aircraft.get("flight"), aircraft.get("squawk"))
        yield [*map(cell_text, cells)]


def _state_rows(document: dict[str, Any], sheet: Sheet) -> Iterator[list[str]]:
    sheet.header = [*OPENSKY_COLUMNS]
    for state in document["states"]:
        state = [*state, *[None] * 14] if isinstance(state, list) else [None] * 14
        yield [cell_text(state[place]) for place in OPENSKY_COLUMNS.values()]


def _record_rows(document: Sequence[Any], sheet: Sheet) -> Iterator[list[str]]:
    for record in document:
        if isinstance(record, dict):
            sheet.header = sheet.header or list(record)
            yield [cell_text(record.get(name)) for name in sheet.header]
        else:
            sheet.skipped[term("entries that are no records")] += 1


def finite_number(value: Any) -> float:
    """A value as a float; NaN where it is no number or implausibly large."""
    return float(value) if isinstance(value, int | float) and abs(value) < 1e18 else math.nan


def cell_text(value: Any) -> str:
    """A value as a cell: numbers to the last digit, moments in ISO 8601, '' for any other value."""
    if isinstance(value, str):
        return value
    if isinstance(value, datetime.datetime | datetime.date):
        return value.isoformat()
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300 else ""


# ---- Parquet ---------------------------------------------------------------------------------------------------------
def read_parquet(path: str, file: BinaryIO) -> Sheet:
    """The columns of a Parquet file that are numbers, text or moments."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise sites.missing_package("pyarrow", "parquet") from error
    try:
        table = parquet.ParquetFile(file)
        flat = [field.name for field in table.schema_arrow if not pyarrow.types.is_nested(field.type)]
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise ConfigError(f"{path}: must be a Parquet file: {_one_line(error)}") from error

    def rows() -> Iterator[tuple[int, list[str]]]:
        number = itertools.count(1)
        try:
            for batch in table.iter_batches(batch_size=sites.BATCH_ROWS, columns=flat):
                columns = [map(cell_text, column.to_pylist()) for column in batch.columns]
                yield from zip(number, map(list, zip(*columns, strict=True)), strict=False)
        except (pyarrow.ArrowException, OSError, ValueError, OverflowError) as error:
            raise ConfigError(f"{path}: is damaged at row {next(number)} or after: {_one_line(error)}") from error

    return Sheet(path, flat, rows())


def _one_line(error: Exception) -> str:
    return "".join(c for c in " ".join(str(error).split())[:200] if c.isprintable())


# ---- GPX -------------------------------------------------------------------------------------------------------------
GPX_COLUMNS = {  # what a point and its track have, by the columns of a sheet
    **{"time": "time", "track": "track_id", "lat": "lat", "lon": "lon"},
    **{"ele": "ele [m]", "speed": "speed [m/s]", "course": "course [deg]"},
}


def read_gpx(path: str, file: BinaryIO) -> Sheet:
    """The points of the tracks of a GPX file, each under its track's name or its number."""

    def rows() -> Iterator[tuple[int, list[str]]]:
        name, tracks, number, segment = "", 0, 0, ElementTree.Element("")
        try:
            for event, element in ElementTree.iterparse(file, ("start", "end")):
                tag = _local_name(element)
                if event == "start":
                    if tag == "trk":
                        tracks, name = tracks + 1, ""
                    segment = element if tag == "trkseg" else segment
                elif tag == "name" and not name and tracks:
                    name = (element.text or "").strip()
                elif tag == "trkpt":
                    number += 1
                    values = {_local_name(child): (child.text or "").strip() for child in element.iter()}
                    values |= {"track": name or str(tracks), **element.attrib}
                    yield number, [values.get(cell, "") for cell in GPX_COLUMNS]
                    segment.clear()  # so that memory does not grow
        except ElementTree.ParseError as error:
            raise ConfigError(f"{path}:{error.position[0]}: must be GPX: {error}; {number} points were read") from error

    note = tr("altitudes are as the file has them, mostly above the sea, not the ellipsoid")
    return Sheet(path, [*GPX_COLUMNS.values()], rows(), notes=[note])


def _local_name(element: ElementTree.Element) -> str:
    """A name without its namespace."""
    return str(element.tag).rpartition("}")[2]


# ---- NMEA 0183 -------------------------------------------------------------------------------------------------------
NMEA_COLUMNS = {"lat": "lat", "lon": "lon", "speed": "speed [kn]", "course": "course [deg]", "altitude": "altitude [m]"}
SENTENCE_PATTERN = re.compile(rb"\$[A-Z]{2}(?:GGA|RMC),[^\r\n]*")
DATED_SENTENCE = re.compile(rb"\$[A-Z]{2}RMC,[^,]*,A(?:,[^,]*){6},\d{6}")
CLOCK_PATTERN = re.compile(r"([01]\d|2[0-3])([0-5]\d)([0-6]\d(?:\.\d+)?)")


def read_nmea(path: str, file: BinaryIO) -> Sheet:
    """Positions by a satellite receiver, NMEA 0183: RMC (place, speed, course, date) and GGA (place, height), of any
    talker, those of one time as one row. Heights are above the ellipsoid where GGA has that of the geoid.

    Where no RMC stands among the first sentences, dates are left alone: times are of the day."""
    has_dates = bool(DATED_SENTENCE.search(file.peek(io.DEFAULT_BUFFER_SIZE)))  # type: ignore[attr-defined]
    sheet = Sheet(path, ["time", *NMEA_COLUMNS.values()], iter(()))

    def rows() -> Iterator[tuple[int, list[str]]]:
        fix: dict[str, float] = {}  # the numbers of all sentences of one time
        number, midnight, previous_clock = 0, math.nan, math.nan
        for number, line in enumerate(file, start=1):
            sentence = _parse_fix(line, sheet) if line.strip() else {}
            if fix and sentence and sentence["clock"] != fix["clock"]:
                yield number - 1, _fix_cells(fix)
                fix = {}
            if sentence:
                if has_dates:
                    is_next_day = sentence["clock"] < previous_clock - sites.DAY_S / 2
                    midnight = sentence.pop("midnight", midnight + sites.DAY_S * is_next_day)
                    sentence["time"] = midnight + sentence["clock"]
                previous_clock = sentence["clock"]
                fix |= sentence
        if fix:
            yield number, _fix_cells(fix)

    sheet.rows = rows()
    return sheet


def _fix_cells(fix: dict[str, float]) -> list[str]:
    """The cells of NMEA_COLUMNS; a time without a date becomes a time of day."""
    minutes, seconds = divmod(fix["clock"], 60)
    clock = f"{minutes // 60:02.0f}:{minutes % 60:02.0f}:{seconds:09.6f}"
    cells = [fix.get(name, math.nan) for name in NMEA_COLUMNS]
    return [cell_text(fix.get("time", clock)), *map(cell_text, cells)]


def _parse_fix(line: bytes, sheet: Sheet) -> dict[str, float]:
    """The numbers of a sentence by the names of NMEA_COLUMNS, `clock` in s of the day; empty without a fix."""
    match = SENTENCE_PATTERN.search(line)
    if not match or (b"*" in match[0] and not sites.has_valid_checksum(match[0])):
        sheet.skipped[term("damaged sentences") if match else term("other lines")] += 1
        return {}
    kind, clock, *cells = [*match[0].partition(b"*")[0].decode("ascii", "replace").split(","), *[""] * 12]
    time = CLOCK_PATTERN.fullmatch(clock)
    is_rmc = kind.endswith("RMC")  # the place then begins one later
    if not time or (cells[0] != "A" if is_rmc else cells[4] in ("", "0")):
        sheet.skipped[term("sentences without a fix")] += 1
        return {}
    fix = {"clock": 3600.0 * int(time[1]) + 60 * int(time[2]) + float(time[3])}
    fix |= {"lat": _angle_deg(*cells[is_rmc : 2 + is_rmc]), "lon": _angle_deg(*cells[2 + is_rmc : 4 + is_rmc])}
    if not is_rmc:
        sea, geoid = _parse_number(cells[7]), _parse_number(cells[9])
        return fix | {"altitude": sea + (0 if math.isnan(geoid) else geoid)}
    fix |= {"speed": _parse_number(cells[5]), "course": _parse_number(cells[6])}
    day = cells[7]
    with contextlib.suppress(ValueError):
        fix["midnight"] = sites.utc_s(f"{'19' if day[4:] > '79' else '20'}{day[4:]}-{day[2:4]}-{day[:2]}")
    return fix


def _angle_deg(text: str, side: str) -> float:
    """An angle in degrees from degrees and minutes, as 5236.5, and N, S, E or W."""
    degrees, minutes = divmod(_parse_number(text), 100)
    return (degrees + minutes / 60) * {"N": 1, "E": 1, "S": -1, "W": -1}.get(side, math.nan)


def _parse_number(text: str) -> float:
    try:
        return finite_number(float(text))
    except ValueError:
        return math.nan
