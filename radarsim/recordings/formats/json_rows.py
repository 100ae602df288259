"""Positions from JSON documents, as a sheet."""

import itertools
import json
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

from radarsim.errors import ConfigError
from radarsim.language.translate import term
from radarsim.recordings.formats.cell_text import cell_text, finite_number
from radarsim.recordings.formats.sheet import Sheet

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
    if isinstance(document, dict) and str(document.get("type", "")).startswith("Feature"):
        raise ConfigError(f"{sheet.path}: must be positions with times; it is GeoJSON: export the track as CSV or GPX")
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
