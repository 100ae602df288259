"""Positions from the sentences of a satellite receiver (NMEA 0183), as a sheet."""

import contextlib
import io
import math
import re
from collections.abc import Iterator
from typing import BinaryIO

from radarsim.language.translate import term
from radarsim.recordings.formats import ais, records
from radarsim.recordings.formats.cell_text import cell_text, finite_number
from radarsim.recordings.formats.sheet import Sheet

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
                    is_next_day = sentence["clock"] < previous_clock - records.DAY_S / 2
                    midnight = sentence.pop("midnight", midnight + records.DAY_S * is_next_day)
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
    if not match or (b"*" in match[0] and not ais.has_valid_checksum(match[0])):
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
        fix["midnight"] = records.utc_s(f"{'19' if day[4:] > '79' else '20'}{day[4:]}-{day[2:4]}-{day[:2]}")
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
