"""NMEA 0183 as a sheet: positions of a satellite receiver, or the targets that a ship's radar tracks."""

import contextlib
import io
import math
import re
from collections.abc import Iterator
from typing import Any, BinaryIO

from radarsim.language.translate import term
from radarsim.recordings.formats import ais, records
from radarsim.recordings.formats.cell_text import cell_text, finite_number
from radarsim.recordings.formats.sheet import Sheet

NMEA_COLUMNS = {"lat": "lat", "lon": "lon", "speed": "speed [kn]", "course": "course [deg]", "altitude": "altitude [m]"}
TARGET_COLUMNS = {  # of targets by their distance and bearing (TTM), and by their place (TLL)
    b"TTM": {"track": "track", "range": "range [m]", "bearing": "bearing [deg]", "altitude": "altitude [m]"},
    b"TLL": {"track": "track", "lat": "lat", "lon": "lon", "altitude": "altitude [m]"},
}
SENTENCE_PATTERN = re.compile(rb"\$[A-Z]{2}(?:GGA|RMC|ZDA|TTM|TLL|GLL),[^\r\n]*")
ANY_SENTENCE_PATTERN = re.compile(rb"^[$!][A-Z]{2,3}([A-Z]{3}),", re.MULTILINE)
PREFIX_CLOCK_PATTERN = re.compile(rb"([01]\d|2[0-3]):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")  # of a logger, before a sentence
TARGET_PATTERN = re.compile(rb"\$[A-Z]{2}(TTM|TLL),[^\r\n]*")
HEADING_PATTERN = re.compile(rb"\$[A-Z]{2}(?:HDT,([\d.]+),T|THS,([\d.]+),A)[^\r\n]*")
DISTANCE_UNITS_M = {"N": 1852.0, "K": 1000.0, "S": 1609.344}
FIRST_SECOND_OF_MINUTE = 60.0
LEAP_SECOND_REASON = term("sentences in a leap second (23:59:60), which seconds from 1970 do not count")
NO_CLOCK_REASON = term("targets whose time neither they nor sentences RMC, GGA or ZDA state")
DATED_SENTENCE = re.compile(rb"\$[A-Z]{2}(?:RMC,[^,]*,A(?:,[^,]*){6},\d{6}|ZDA,\d{6}[^,]*,\d\d,\d\d,\d{4})")
CLOCK_PATTERN = re.compile(r"([01]\d|2[0-3])([0-5]\d)([0-6]\d(?:\.\d+)?)")


def read_nmea(path: str, file: BinaryIO, only_positions: bool = False) -> Sheet:
    """Positions by a satellite receiver, NMEA 0183: RMC (place, speed, course, date) and GGA (place, height), of any
    talker, those of one time as one row. Heights are above the ellipsoid where GGA has that of the geoid. Where the
    first sentences have targets of a radar (TTM, else TLL), these are read instead, unless only positions are wanted.

    Where no RMC or ZDA stands among the first sentences, dates are left alone: times are of the day."""
    head = file.peek(io.DEFAULT_BUFFER_SIZE)  # type: ignore[attr-defined]
    has_dates = bool(DATED_SENTENCE.search(head))
    if (kinds := set(TARGET_PATTERN.findall(head))) and not only_positions:
        return _read_targets(path, file, has_dates, max(kinds))
    sheet = Sheet(path, ["time", *NMEA_COLUMNS.values()], iter(()), is_one_track=True)
    has_better = {b"RMC", b"GGA"} & set(ANY_SENTENCE_PATTERN.findall(head))  # than GLL, of the same fixes

    def rows() -> Iterator[tuple[int, list[str]]]:
        fix: dict[str, float] = {}  # the numbers of all sentences of one time
        places: dict[bytes, tuple[float, float]] = {}  # of these by talker and kind; another place is of another time
        number, dates = 0, _Dates()
        for number, line in enumerate(file, start=1):
            sentence = _parse_fix(line, sheet, not has_better) if line.strip() else {}
            if sentence and "lat" not in sentence:  # ZDA
                dates.time(sentence["clock"], sentence.get("midnight"))
                continue
            head, place = line.lstrip()[:6], (sentence.get("lat", math.nan), sentence.get("lon", math.nan))
            if fix and sentence and (sentence["clock"] != fix["clock"] or places.get(head, place) != place):
                yield number - 1, _fix_cells(fix)
                fix, places = {}, {}
            if sentence:
                places[head] = place
                if has_dates:
                    sentence["time"] = dates.time(sentence["clock"], sentence.pop("midnight", None))
                fix |= sentence
        if fix:
            yield number, _fix_cells(fix)

    sheet.rows = rows()
    return sheet


class _Dates:
    """The day of times of day, by the dates that sentences RMC state, and by midnight between them."""

    def __init__(self) -> None:
        self.midnight, self.previous_clock = math.nan, math.nan

    def time(self, clock: float, midnight: float | None = None) -> float:
        """Seconds from 1970 of a time of day, s; midnight: of the day that its sentence states."""
        is_next_day = clock < self.previous_clock - records.DAY_S / 2
        self.midnight = self.midnight + records.DAY_S * is_next_day if midnight is None else midnight
        self.previous_clock = clock
        return self.midnight + clock


def _read_targets(path: str, file: BinaryIO, has_dates: bool, kind: bytes) -> Sheet:
    """The targets that a ship's radar tracks, of sentences of a kind: number, place, time of day; bearings from the bow
    are turned by the heading (HDT, THS) before them. Lost targets, those of the other kind and own positions are left
    out. A target that states no time has that of the logger before its sentence, of the clock before it, or of the
    first."""
    columns = TARGET_COLUMNS[kind]
    sheet = Sheet(path, ["time", *columns.values()], iter(()))

    def rows() -> Iterator[tuple[int, list[str]]]:
        dates, heading, own_clock = _Dates(), math.nan, math.nan
        waiting: list[tuple[int, dict[str, Any]]] = []  # for the first clock

        def cells_of(target: dict[str, Any]) -> list[str]:
            clock = target["clock"]
            time = dates.time(clock) if has_dates else math.nan
            texts = (cell_text(target[name]) for name in columns)
            return [cell_text(_clock_text(clock) if math.isnan(time) else time), *texts]

        for number, line in enumerate(file, start=1):
            if match := HEADING_PATTERN.search(line):
                heading = _parse_number((match[1] or match[2]).decode("ascii"))
            elif target_match := TARGET_PATTERN.search(line):
                if target_match[1] != kind:
                    sheet.skipped[term("targets by their place, beside their plots")] += 1
                elif target := _parse_target(target_match, heading, sheet):
                    if math.isnan(target["clock"]):
                        target["clock"] = _prefix_clock(line[: target_match.start()], own_clock)
                    if math.isnan(target["clock"]):
                        waiting.append((number, target))
                    else:
                        yield number, cells_of(target)
            elif line.strip() and (fix := _parse_fix(line, sheet, reads_gll=False)):
                own_clock = fix["clock"]
                dates.time(own_clock, fix.get("midnight"))
                if "lat" in fix:
                    sheet.skipped[term("positions of the ship itself, beside its radar's targets")] += 1
                for waiting_number, target in waiting:
                    yield waiting_number, cells_of(target | {"clock": own_clock})
                waiting = []
        if waiting:
            sheet.skipped[NO_CLOCK_REASON] += len(waiting)

    sheet.rows = rows()
    return sheet


def _parse_target(match: re.Match[bytes], heading: float, sheet: Sheet) -> dict[str, Any]:
    """The values of TARGET_COLUMNS of a sentence and its `clock`, s of the day, not-a-number if it states none; empty
    where it has no place, or is of a lost target."""
    if b"*" in match[0] and not ais.has_valid_checksum(match[0]):
        sheet.skipped[term("damaged sentences")] += 1
        return {}
    _, name, *cells = [*match[0].partition(b"*")[0].decode("ascii", "replace").split(","), *[""] * 16]
    is_place = match[1] == b"TLL"
    status, time = (cells[6], cells[5]) if is_place else (cells[10], cells[12])
    clock_match = CLOCK_PATTERN.fullmatch(time.strip())
    target: dict[str, Any] = {"clock": _clock_s(clock_match) if clock_match else math.nan, "track": name}
    target["altitude"] = 0.0  # at sea
    if is_place:
        target |= {"lat": _angle_deg(*cells[0:2]), "lon": _angle_deg(*cells[2:4])}
        place = target["lat"] + target["lon"]
    else:
        angle = _parse_number(cells[1]) + (heading if cells[2] == "R" else 0.0)
        unit_m = DISTANCE_UNITS_M.get(cells[8].strip(), math.nan)
        target |= {"range": _parse_number(cells[0]) * unit_m, "bearing": angle % 360}
        place = target["range"] + (0.0 if cells[2] == "R" else angle)
    if status.strip() == "L":
        sheet.skipped[term("targets that the radar has lost")] += 1
    elif math.isnan(place):
        sheet.skipped[records.NO_TIME_OR_POSITION] += 1
    elif not is_place and math.isnan(target["bearing"]):
        sheet.skipped[term("targets by the bow, whose heading no sentence HDT states")] += 1
    else:
        return target
    return {}


def _fix_cells(fix: dict[str, float]) -> list[str]:
    """The cells of NMEA_COLUMNS; a time without a date becomes a time of day."""
    cells = [fix.get(name, math.nan) for name in NMEA_COLUMNS]
    return [cell_text(fix.get("time", _clock_text(fix["clock"]))), *map(cell_text, cells)]


def _clock_text(clock: float) -> str:
    """A time of day, s, as hours, minutes and seconds."""
    minutes, seconds = divmod(clock, 60)
    return f"{minutes // 60:02.0f}:{minutes % 60:02.0f}:{seconds:09.6f}"


def _clock_s(match: re.Match[str]) -> float:
    """A time matched by CLOCK_PATTERN, s of the day."""
    return 3600.0 * int(match[1]) + 60 * int(match[2]) + float(match[3])


def _prefix_clock(prefix: bytes, otherwise: float) -> float:
    """The time of day, s, that a logger has written before a sentence; otherwise another."""
    match = PREFIX_CLOCK_PATTERN.search(prefix)
    if match is None:
        return otherwise
    hours, minutes, seconds = (float(text.replace(b",", b".")) for text in match.groups())
    return 3600 * hours + 60 * minutes + seconds


def _parse_fix(line: bytes, sheet: Sheet, reads_gll: bool) -> dict[str, float]:
    """The numbers of a sentence by the names of NMEA_COLUMNS, `clock` in s of the day; empty without a fix; of
    ZDA only times. reads_gll: whether sentences GLL are read."""
    match = SENTENCE_PATTERN.search(line)
    if match and match[0][3:6] == b"GLL" and not reads_gll:
        match = None
    if not match or (b"*" in match[0] and not ais.has_valid_checksum(match[0])):
        sheet.skipped[term("damaged sentences") if match else term("other lines")] += 1
        return {}
    kind, clock, *cells = [*match[0].partition(b"*")[0].decode("ascii", "replace").split(","), *[""] * 12]
    if kind.endswith("GLL"):
        (clock, status), cells = cells[3:5], [clock, *cells[:3]]
        cells += ["1" if status in ("A", "") else "0", *[""] * 8]
    time = CLOCK_PATTERN.fullmatch(clock)
    if kind.endswith("ZDA"):
        day, month, year = cells[:3]
        return {"clock": _clock_s(time), **_midnight(f"{year}-{month}-{day}")} if time else {}
    is_rmc = kind.endswith("RMC")  # the place then begins one later
    if not time or (cells[0] != "A" if is_rmc else cells[4] in ("", "0")):
        sheet.skipped[term("sentences without a fix")] += 1
        return {}
    if float(time[3]) >= FIRST_SECOND_OF_MINUTE:
        sheet.skipped[LEAP_SECOND_REASON] += 1
        return {}
    fix = {"clock": _clock_s(time)}
    fix |= {"lat": _angle_deg(*cells[is_rmc : 2 + is_rmc]), "lon": _angle_deg(*cells[2 + is_rmc : 4 + is_rmc])}
    if not is_rmc:
        sea, geoid = _parse_number(cells[7]), _parse_number(cells[9])
        return fix | {"altitude": sea + (0 if math.isnan(geoid) else geoid)}
    fix |= {"speed": _parse_number(cells[5]), "course": _parse_number(cells[6])}
    day = cells[7]
    return fix | _midnight(f"{'19' if day[4:] > '79' else '20'}{day[4:]}-{day[2:4]}-{day[:2]}")


def _midnight(date: str) -> dict[str, float]:
    """The `midnight` at which a day begins, s from 1970; empty where there is no such day."""
    with contextlib.suppress(ValueError):
        return {"midnight": records.utc_s(date)}
    return {}


def _angle_deg(text: str, side: str) -> float:
    """An angle in degrees from degrees and minutes, as 5236.5, and N, S, E or W."""
    degrees, minutes = divmod(_parse_number(text), 100)
    return (degrees + minutes / 60) * {"N": 1, "E": 1, "S": -1, "W": -1}.get(side, math.nan)


def _parse_number(text: str) -> float:
    try:
        return finite_number(float(text))
    except ValueError:
        return math.nan
