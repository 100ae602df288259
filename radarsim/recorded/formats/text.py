"""Tables of positions or of plots: what a `Sheet` holds, row by row, in our quantities and units; CSV as a sheet.

Times are seconds from 1970 (or thousandths and less of them, seen by their size), times of day (unwrapped after
midnight, or of the day in a column `date`), dates as `20.11.2026 10:00:00,01` or ISO 8601, with or without a zone
(default UTC). The time is that of the measurement, if the file has several. Assumptions are in `notes`.

Cells of CSV are separated by commas, semicolons or tabs, whichever is most frequent in the header; with a separator
other than a comma, numbers may have a decimal comma.

What columns of recordings hold: the quantities, the names that files give them, and their units.

A column is found by its name, whatever the case and the spaces; a unit may stand at the end of it (`range_km`,
`Altitude [ft]`, `Latitude_degrees`). A name without a unit means SI and degrees; but positions with names from aviation
(`gs`, `alt_baro`, …) are in feet, knots and feet a minute, and speeds of ships in knots, like the exports that use
them. Ranges and bearings have no such custom: their units must be stated."""

import csv
import itertools
import math
import re
import shlex
import types
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TextIO

from radarsim.errors import ConfigError
from radarsim.language import term, tr
from radarsim.recorded.formats import sites
from radarsim.recorded.formats.sites import KNOT_MPS
from radarsim.recorded.plots import Faults

# ---- columns ---------------------------------------------------------------------------------------------------------
LENGTHS = {"m": 1.0, "km": 1e3, "ft": 0.3048, "feet": 0.3048, "nm": 1852.0, "nmi": 1852.0}
HEIGHTS, FLIGHT_LEVELS = {**LENGTHS, "fl": 30.48}, ("fl", "flight_level")  # of 100 ft; names that are this unit
SPEEDS = {
    **dict.fromkeys(("mps", "m/s", "ms"), 1.0), **dict.fromkeys(("kn", "kt", "kts", "knots"), KNOT_MPS),
    **dict.fromkeys(("kmh", "km/h"), 1 / 3.6), **dict.fromkeys(("fpm", "ft/min"), 0.3048 / 60),
}  # fmt: skip
DEGREES = {**dict.fromkeys(("deg", "degree", "degrees", "°"), 1.0), "rad": 180 / math.pi}
RADIANS = {unit: math.radians(factor) for unit, factor in DEGREES.items()}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "dmy": 1.0, "mdy": 1.0}  # dmy, mdy: the order in 1/2/2024


class Quantity(NamedTuple):
    """The names of a quantity in files, in lower case without spaces and units, those that count first before others;
    its units, as multiples of ours; the unit of a name that has none, '' where it must be stated."""

    names: tuple[str, ...]
    units: Mapping[str, float] = types.MappingProxyType({})
    plain: str = ""


QUANTITIES = {
    "t_s": Quantity(
        (
            *("lastposupdate", "last_position", "time_position"),  # of the position; the following may be of a query
            *("t", "time", "timestamp", "t_s", "datetime", "date_time", "basedatetime", "base_date_time", "utc"),
            "date",
        ),
        TIME_UNITS,
        "s",
    ),
    "date": Quantity(("date", "day")),  # of a time of day
    "track": Quantity(
        ("icao24", "icao", "hex", "mmsi", "track_id", "address", "callsign", "flight", "id", "track", "name")
    ),
    "latitude_deg": Quantity(("lat", "latitude"), DEGREES, "deg"),
    "longitude_deg": Quantity(("lon", "lng", "long", "longitude"), DEGREES, "deg"),
    "altitude_m": Quantity(
        ("geoaltitude", "geo_altitude", "alt_geom", "altitude", "alt", "height", "ele"), HEIGHTS, "m"
    ),
    "barometric_m": Quantity(
        ("baroaltitude", "baro_altitude", "alt_baro", "mode_c", "modec", *FLIGHT_LEVELS), HEIGHTS, "m"
    ),
    "speed_mps": Quantity(("velocity", "groundspeed", "ground_speed", "gs", "speed", "sog"), SPEEDS, "m/s"),
    # Of a ship the heading is where its bow points; aircraft have their course under this name too.
    "course_deg": Quantity(
        ("true_track", "course", "cog", "track_angle", "direction", "heading", "track"), DEGREES, "deg"
    ),
    "up_mps": Quantity(
        ("vertrate", "vertical_rate", "vert_rate", "geom_rate", "baro_rate", "climb"), SPEEDS, "m/s"
    ),
    "range_m": Quantity(("range", "slant_range", "distance", "rho"), LENGTHS),
    "bearing_rad": Quantity(("bearing", "azimuth", "az", "theta"), RADIANS),
    "velocity_mps": Quantity(("radial_velocity", "doppler", "radial_speed", "range_rate", "velocity"), SPEEDS, "m/s"),
    "span_mps": Quantity(("span", "ambiguity", "doppler_span"), SPEEDS, "m/s"),
}  # fmt: skip
IDENTITIES = {  # what identifies an aircraft or a ship, by the names of columns
    "address": ("icao24", "icao", "hex", "mmsi", "address"),
    "callsign": ("callsign", "flight"),
    "mode_3a": ("squawk", "mode_3a", "mode3a", "ssr"),
}
UNITS = {unit for quantity in QUANTITIES.values() for unit in quantity.units if unit}
UNNAMED = ("t_s", "date", "track")  # what a bracket says of these is no unit: Time (UTC)
ON_EARTH = ("latitude_deg", "longitude_deg")
MEASURED = ("range_m", "bearing_rad")
POSITION = "position"  # latitude and longitude in one cell, parted by a comma
AVIATION = (  # names without a unit
    *("gs", "groundspeed", "ground_speed", "alt", "alt_baro", "alt_geom", "direction", "mode_c", "modec"),
)
AVIATION_UNITS = {"altitude_m": "ft", "barometric_m": "ft", "speed_mps": "kn", "up_mps": "fpm"}
MARITIME = ("sog", "cog", "mmsi")  # names of AIS
BOW = "heading"
MARITIME_UNITS = {"speed_mps": "kn"}
UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]$")


class Column(NamedTuple):
    """A column of a file: its index, its name, what its numbers are multiplied by; its unit, and whether that is
    assumed."""

    place: int
    name: str
    factor: float
    unit: str
    assumed: bool


def split(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case, and its unit: `Range [km]` and `range_km` are (range, km)."""
    name = name.strip().lower()
    if found := UNIT.match(name):
        return re.sub(r"\s+", "_", found[1].strip()), found[2].strip()
    name = re.sub(r"\s+", "_", name)
    stem, _, last = name.rpartition("_")
    return (stem, last) if stem and last in UNITS else (name, "fl" if name in FLIGHT_LEVELS else "")


def _printable(name: str) -> str:
    """A name as a terminal can show it."""
    return "".join(c if c.isprintable() else "�" for c in " ".join(name.split()))


class Header:
    """The columns of a file by our names, those assigned by the user first; raises ConfigError.

    columns: by name of the quantity; identities: the indices of those in
    IDENTITIES; on_earth: whether positions are read, not plots; aviation, maritime: whether
    names follow their customs."""

    def __init__(self, path: str, names: list[str], given: Mapping[str, str]):
        self.path, self.names = path, [_printable(name) for name in names]
        self.stems = [split(name) for name in self.names]
        self.maritime = any(stem in MARITIME for stem, _ in self.stems)
        self.aviation = any((name, "") in self.stems for name in AVIATION)
        self.custom = AVIATION_UNITS if self.aviation else MARITIME_UNITS if self.maritime else {}
        self.columns: dict[str, Column] = {}
        self._given(given)
        earth = all(self._has(ours) or POSITION in dict(self.stems) for ours in ON_EARTH)
        self.on_earth = earth and not any(ours in self.columns for ours in MEASURED)
        self._found(earth)
        places = self._places()
        named = {kind: [places[name] for name in names if name in places] for kind, names in IDENTITIES.items()}
        self.identities = {kind: found[0] for kind, found in named.items() if found}
        if "track" in self.columns and not self.identities:
            self.identities["address"] = self.columns["track"].place  # one's own name of it
        self._judge()

    def _has(self, ours: str) -> bool:
        """Whether a quantity was named, or has a known name."""
        return ours in self.columns or any(stem in QUANTITIES[ours].names for stem, _ in self.stems)

    def _given(self, given: Mapping[str, str]) -> None:
        """The columns that the user names."""
        stems = {split(ours)[0]: ours for ours in QUANTITIES}
        for name, theirs in given.items() if self.names else ():
            stem, unit = split(name)
            ours = name if name in QUANTITIES else stems.get(stem, "")
            theirs = _printable(theirs)
            if not ours or theirs not in self.names:
                allowed = (
                    f"a column of {', '.join(self.names)}" if ours else f"one of {', '.join(QUANTITIES)}, in any unit"
                )
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must name {allowed}")
            own = split(theirs)[1]
            if unit and own and name != ours and unit != own:
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must have the unit of its own name, {own}")
            self.columns[ours] = self._column(ours, self.names.index(theirs), own or unit)

    def _places(self) -> dict[str, int]:
        """The index of each name, of the first column that has it."""
        return {stem: i for i, (stem, _) in reversed(list(enumerate(self.stems)))}

    def _found(self, earth: bool) -> None:
        """The other columns, by the names that are known; earth: whether there are positions."""
        places = self._places()
        left_out = (*MEASURED, "velocity_mps", "span_mps") if self.on_earth else ("speed_mps", "course_deg", *ON_EARTH)
        passed = {("velocity_mps", "velocity")} if earth else set()  # beside a position it is the speed over ground
        passed |= {("course_deg", BOW)} if self.maritime else set()
        taken = {column.place for column in self.columns.values()}
        for ours, quantity in QUANTITIES.items():
            known = [name for name in quantity.names if (ours, name) not in passed and places.get(name) not in taken]
            one = next((name for name in known if name in places), None)
            if one and ours not in self.columns and ours not in left_out:
                self.columns[ours] = self._column(ours, places[one], self.stems[places[one]][1])
                taken.add(places[one])
        if self.on_earth and POSITION in places:
            for ours in set(ON_EARTH) - set(self.columns):
                self.columns[ours] = self._column(ours, places[POSITION], "")

    def _column(self, ours: str, place: int, unit: str) -> Column:
        """A column in its unit; '' where neither its name nor the user states one."""
        name, quantity = self.names[place], QUANTITIES[ours]
        if self.names.count(name) > 1:
            raise ConfigError(f"{self.path}:1: {name}: must be the name of one column; several have it")
        stated = unit in quantity.units or ours in UNNAMED
        if unit and not stated:
            raise ConfigError(
                f"{self.path}:1: {name}: the unit must be one of {', '.join(quantity.units)}; got {unit!r}"
            )
        taken = unit or self.custom.get(ours, quantity.plain)
        assumed = not unit and ours not in UNNAMED and quantity.units is not DEGREES
        return Column(place, name, quantity.units.get(taken, 1.0), taken, assumed)

    def _judge(self) -> None:
        """Raise ConfigError for what is missing, and for units that must be stated."""
        wanted = ("t_s", *ON_EARTH) if self.on_earth else ("t_s", "range_m")
        if missing := [name for name in wanted if name not in self.columns]:
            hints = "; ".join(f"{name}: {', '.join(QUANTITIES[name].names)}" for name in missing)
            got = ", ".join(self.names)[:200] or "nothing"
            what = "columns of time, and of latitude and longitude or of range (name them: --column OURS=THEIRS)"
            raise ConfigError(f"{self.path}:1: must have {what}; missing ({hints}); got {got}")
        if open_ := {ours: one.name for ours, one in self.columns.items() if not one.unit and ours not in UNNAMED}:
            cures = []
            for ours, name in open_.items():
                by_factor: dict[float, str] = {}
                for unit, factor in QUANTITIES[ours].units.items():
                    by_factor.setdefault(factor, f"{split(ours)[0]}_{unit}")
                first, *others = by_factor.values()
                cures.append(f"--column {first}={shlex.quote(name)} (or {', '.join(others)})")
            raise ConfigError(f"{self.path}:1: {', '.join(open_.values())}: must have a unit in the name; where it has "
                              f"none, {', '.join(cures)} states it")  # fmt: skip

    def notes(self) -> list[str]:
        """What was assumed, and what was not used."""
        assumed = [one for one in self.columns.values() if one.assumed and one.unit]
        taken = ", ".join(tr("{name} in {unit}", name=one.name, unit=one.unit) for one in assumed)
        found = [tr("assumed because the name has no unit: {units}", units=taken)] if taken else []
        time = self.columns["t_s"].name
        known = {stem: name for (stem, _), name in zip(self.stems, self.names, strict=True)}
        used = {one.name for one in self.columns.values()}
        others = [known[stem] for stem in known if stem in QUANTITIES["t_s"].names and known[stem] not in used]
        if others:
            found.append(tr("times are {time}; not used: {others}", time=time, others=", ".join(others)))
        if self.maritime and self.on_earth and BOW in known and "course_deg" not in self.columns:
            found.append(tr("no speeds: {heading} is where the bow points, not the course", heading=known[BOW]))
        ranges = [known[stem] for stem in known if stem in QUANTITIES["range_m"].names]
        if self.on_earth and ranges:
            column = f"--column range_UNIT={shlex.quote(ranges[0])}"
            found.append(tr("positions are read, not plots; for these: {column}", column=column))
        return found


LARGEST = 1e15
RowOf = Callable[[list[str]], tuple[float, ...]]  # a row of numbers from the cells of a line
NO_SPEED_MPS, NO_COURSE_DEG = 102.2 * sites.KNOT_MPS, 360.0  # of AIS: what is not below them means missing
MISSING = ("nan", "null", "none", "na", "n/a", "#n/a")
THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")  # a number that may be a thousand or a decimal
MIDNIGHT_S = 3600.0  # a falling time of day has passed midnight if both are as near it; else a file is sorted by track
STILL_MPS = 1.0  # below it a position may stay the same
NAMES_AT_MOST = 10_000  # different cells in a column that may name aircraft
HIGHEST_M = 20_000.0  # of an aircraft; higher altitudes are feet
LATEST_S = 1e11  # greater times are thousandths of seconds, or thousandths of these
DELIMITERS = ",;\t"
OF_DAY = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,:](\d+))?)?")
DATED = re.compile(r"(\d{1,2})([./])(\d{1,2})\2(\d{4})(?:[ T]+(\S+))?")
TIMES = "a time of day, ISO 8601 or DD.MM.YYYY and a time"


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


def comma_separated(path: str, file: TextIO, encoding: str) -> Sheet:
    """The sheet of a CSV file: its header, before which lines of comment may stand, tells the separator."""
    before, comment, text = 0, "", ""
    for text in file:
        if text.strip() and not text.startswith("#"):
            break
        before, comment, text = before + 1, text, ""
    delimiter = max(DELIMITERS, key=text.count)
    lines = itertools.chain([text], file)
    if _is_header(comment[1:], delimiter) and not _is_header(text, delimiter):
        lines, before = itertools.chain([comment[1:]], lines), before - 1
    cells = csv.reader(lines, strict=True, delimiter=delimiter)

    def rows() -> Iterator[tuple[int, list[str]]]:
        try:
            for row in cells:
                if row:
                    yield before + cells.line_num, row
        except csv.Error as error:
            raise ConfigError(f"{path}:{before + cells.line_num}: not a CSV row: {error}") from error

    found = rows()
    _, header = next(found, (0, []))
    while header and not header[-1].strip():
        header.pop()
    return Sheet(path, header, _trimmed(found, len(header)), delimiter != ",", encoding)


def _is_header(line: str, delimiter: str) -> bool:
    """Whether a line names a column of time."""
    return any(split(name)[0] in QUANTITIES["t_s"].names for name in line.strip().split(delimiter))


def _trimmed(rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[tuple[int, list[str]]]:
    """The rows without separators after the last cell."""
    for line, row in rows:
        if len(row) > width and not any(cell.strip() for cell in row[width:]):
            del row[width:]
        yield line, row


class Table:
    """The reader of a sheet, of positions or of plots; --column gives columns by hand."""

    def __init__(self, sheet: Sheet, given: Mapping[str, str] | None = None):
        self.path, self.sheet, self.skipped = sheet.path, sheet, sheet.skipped
        self.line = 0
        self.records, self.highest, self.barometric, self.silent = 0, 0.0, 0, 0
        self.of_day = False  # known after the first rows
        self.doubtful = ""  # the first number whose comma may separate thousands
        self.decimal = False  # a comma that cannot has been read
        self.faults = Faults(self.path)
        self.width = len(sheet.header)
        self.header = Header(self.path, sheet.header, given or {})
        self.columns = self.header.columns
        self.kind = sites.POSITIONS if self.header.on_earth else sites.PLOTS
        self.clock = sites.Unrolled(sites.DAY_S, near_s=MIDNIGHT_S)
        self.day_s = math.nan  # of the date read last
        self.unit_s = 1.0  # of times that are too great for seconds
        self.slashed: dict[str, str] = {}  # the first date of 1/2/2024 by what it shows: the order, or nothing
        self.before_it: dict[str, tuple[float, ...]] = {}  # the last position of each track
        self.joint = len({self.columns[ours].place for ours in ON_EARTH if ours in self.columns}) == 1
        self.words = {kind: place for kind, place in self.header.identities.items() if kind != "address"}
        taken = {column.place for column in self.columns.values()}
        free = [] if "track" in self.columns else [i for i in range(self.width) if i not in taken]
        self.cells: dict[int, set[str]] = {i: set() for i in free}  # of columns that may name the aircraft

    def notes(self, radars: Iterable[str] = ()) -> list[str]:
        """Assumptions on units and times, and signs against them."""
        found = [*self.clock.notes(), *self.header.notes(), *self.sheet.notes]
        if (encoding := self.sheet.encoding) != "UTF-8":
            found.append(
                tr("the text is read as {name}, as it is not UTF-8; for another: --encoding NAME", name=encoding)
            )
        if self.doubtful and not self.decimal:
            value = float(self.doubtful.replace(",", "."))
            found.append(tr("commas are decimal: {text} is read as {value:g}", text=self.doubtful, value=value))
        if self.unit_s < 1:
            found.append(tr("times are so large that they are read in units of {unit:g} s", unit=self.unit_s))
        if "" in self.slashed and len(self.slashed) == 1:
            cure = f"--column t_mdy={self.columns['t_s'].name}"
            words = term("{date} is read as day and month; if the month stands first: {cure}")
            found.append(tr(words, date=self.slashed[""], cure=cure))
        if self.barometric:
            found.append(tr("barometric altitudes, where the geometric one is missing: {count}", count=self.barometric))
        if self.silent and "course_deg" in self.columns:
            words = term("reports without speed or course: {count} of {all}")
            found.append(tr(words, count=self.silent, all=self.records))
        if self.highest > HIGHEST_M and not self.header.aviation:
            name = (self.columns.get("altitude_m") or self.columns["barometric_m"]).name
            words = term("altitudes up to {highest:.0f} m: if {name} is in feet, name it {name}_ft")
            found.append(tr(words, highest=self.highest, name=name))
        if likely := self._likely():
            found.append(tr("no column identifies the tracks, all rows are taken as one; if a column does, "
                            "--column track=THEIRS; it may be: {likely}", likely=likely))  # fmt: skip
        return found

    def _likely(self) -> str:
        """The columns that may name the aircraft, where none is known to: each value in two rows or more on average."""
        likely = [(i, len(cells)) for i, cells in self.cells.items() if 1 < len(cells) <= self.records / 2]
        names = self.header.names
        return ", ".join(tr("{name} ({count} different)", name=names[i], count=count) for i, count in likely)

    def whose(self, late: int) -> str | None:
        """The question which column names the aircraft, where none does and so many rows are out of time order."""
        if not late or "track" in self.columns:
            return None
        named = self._likely() or "none: each has too many different values"
        rows = "1 row is" if late == 1 else f"{late} rows are"
        return (
            f"{self.path}: track: no column identifies the tracks, and {rows} not later than the one before; "
            f"name the column, --column track=THEIRS; it may be: {named}"
        )

    def batches(self) -> Iterator[sites.Batch]:
        """The rows in batches; raises ConfigError with all faults, each with its line and column."""
        names = sites.POSITION_COLUMNS if self.kind == sites.POSITIONS else sites.PLOT_COLUMNS
        row_of: RowOf = self._position if self.kind == sites.POSITIONS else self._plot
        gathered = sites.Gathered(self.kind, names, tuple(self.words))
        try:
            for line, cells in self.sheet.rows:
                self.line = line
                self._take(cells, gathered, row_of)
                if len(gathered) >= sites.BATCH:
                    yield gathered.taken()
        except ConfigError as error:
            raise ConfigError(*self.faults.lines(), *error.lines) from error
        if self.faults:
            raise ConfigError(*self.faults.lines())
        if len(gathered):
            yield gathered.taken()

    def _take(self, cells: list[str], gathered: sites.Gathered, row_of: RowOf) -> None:
        self.records += 1
        if len(cells) != self.width:
            self.faults.add(self.line, "", f"must have {self.width} cells as the header", len(cells))
            return
        row = row_of(cells)
        if self.faults:  # the rest is only read for further ones
            return
        if any(math.isnan(row[i]) for i in ((0, 1, 2) if self.kind == sites.POSITIONS else (0, 1))):
            self.skipped[sites.NOWHERE] += 1
            return
        for place, seen in self.cells.items():
            if len(seen) < NAMES_AT_MOST:
                seen.add(cells[place].strip())
        name = cells[self.columns["track"].place].strip() if "track" in self.columns else "1"
        if self.kind == sites.POSITIONS:
            stands = math.hypot(row[4], row[5]) <= STILL_MPS
            if self.before_it.get(name) == row[1:3] and not stands:
                self.skipped[term("rows that repeat the position before them")] += 1
                return
            self.before_it[name] = row[1:3]
        whose = self.header.identities.get("address")
        address = "" if whose is None else cells[whose].strip().lower()
        gathered.add(name, address, row, tuple(cells[place].strip() for place in self.words.values()))

    def _position(self, cells: list[str]) -> tuple[float, ...]:
        """POSITION_COLUMNS of a row."""
        speed, course = self._number(cells, "speed_mps"), self._number(cells, "course_deg")
        if self.header.maritime and not (0 <= speed <= NO_SPEED_MPS and 0 <= course < NO_COURSE_DEG):
            speed = math.nan
            self.silent += 1
        course = math.radians(course)
        t, up = self._time(cells), self._number(cells, "up_mps")
        lat, lon = self._number(cells, "latitude_deg"), self._number(cells, "longitude_deg")
        for name, value, most in (("latitude_deg", lat, 90), ("longitude_deg", lon, 360)):
            if abs(value) > most:
                self._fault(name, f"must be from -{most} to {most} degrees", f"{value:g}")
        return t, lat, lon, self._altitude(cells), speed * math.sin(course), speed * math.cos(course), up

    def _plot(self, cells: list[str]) -> tuple[float, ...]:
        """PLOT_COLUMNS of a row."""
        names = ("range_m", "bearing_rad", "velocity_mps", "span_mps")
        return (self._time(cells), *(self._number(cells, name) for name in names), self._altitude(cells))

    def _altitude(self, cells: list[str]) -> float:
        """The geometric altitude, m; where there is none the barometric one; of a ship 0."""
        if self.header.maritime and not {"altitude_m", "barometric_m"} & set(self.columns):
            return 0.0
        altitude = self._number(cells, "altitude_m")
        if math.isnan(altitude) and not math.isnan(altitude := self._number(cells, "barometric_m")):
            self.barometric += "altitude_m" in self.columns
        self.highest = max(self.highest, altitude)  # NaN is not larger
        return altitude

    def _time(self, cells: list[str]) -> float:
        """Seconds from 1970; of a time of day without a date, from the first midnight."""
        column = self.columns["t_s"]
        text = cells[column.place].strip()
        if not text or text.lower() in MISSING:
            return math.nan
        try:
            try:
                t = float(self._pointed(text)) * column.factor
            except ValueError:
                return self._written(text, cells)
            return self._of_day(t, cells) if 0 <= t < sites.DAY_S else self._scaled(t)
        except ValueError:
            self._fault("t_s", f"must be a time in s, {TIMES}", repr(text[:60]))
            return math.nan

    def _of_day(self, t: float, cells: list[str]) -> float:
        """A time of day, s, at the date beside it or before it; unrolled where the table has no date."""
        if "date" not in self.columns:
            return self.clock(t)
        if date := cells[self.columns["date"].place].strip():
            self.day_s = self._written(date, cells)
        return self.day_s + t

    def _scaled(self, t: float) -> float:
        """A time that may be in ms, µs or ns; raises ValueError for one that is none."""
        if abs(t) < LATEST_S:
            return t
        unit = next((unit for unit in (1e-3, 1e-6, 1e-9) if abs(t * unit) < LATEST_S), None)
        if unit is None:
            raise ValueError(t)
        self.unit_s = min(self.unit_s, unit)
        return t * unit

    def _written(self, text: str, cells: list[str]) -> float:
        """Seconds of a time of day, a date, or both, `20.11.2026 10:00:00` or ISO 8601; raises ValueError."""
        if day := OF_DAY.fullmatch(text):
            self.of_day = "date" not in self.columns
            return self._of_day(_second_of_day(day), cells)
        if not (found := DATED.fullmatch(text)):
            return sites.utc_s(text.removesuffix("UTC").rstrip())
        day_of, sign, month, year, clock = found.groups(default="0:00")
        if not (time := OF_DAY.fullmatch(clock)):
            raise ValueError(text)
        if sign == "/" and self._month_first(int(day_of), int(month), text):
            day_of, month = month, day_of
        return sites.utc_s(f"{year}-{int(month):02}-{int(day_of):02}") + _second_of_day(time)

    def _month_first(self, one: int, other: int, text: str) -> bool:
        """Whether the first number of a date with slashes is the month: where no date tells, it is the day."""
        unit = self.columns["t_s"].unit
        if unit in ("dmy", "mdy"):
            return unit == "mdy"
        shows = "day" if one > 12 else "month" if other > 12 else ""
        self.slashed.setdefault(shows, text)
        if shows == "month" and next(iter(self.slashed)) != "month":
            name = self.columns["t_s"].name
            must = f"must have day and month in the order of {next(iter(self.slashed.values()))!r}"
            self._fault("t_s", must, repr(text[:60]), f"the order is stated by --column t_mdy={name} or t_dmy={name}")
        return "month" in self.slashed

    def _number(self, cells: list[str], name: str) -> float:
        column = self.columns.get(name)
        text = cells[column.place].strip() if column else ""
        if self.joint and name in ON_EARTH:
            text = text.partition(",")[2 * (name == "longitude_deg")]
        if not column or not text or text.lower() in MISSING:
            return math.nan
        try:
            value = float(self._pointed(text))
        except ValueError:
            value = math.inf
        if not abs(value) <= LARGEST:
            self._fault(name, "must be a number", repr(text[:60]))
            return math.nan
        return value * column.factor

    def _pointed(self, text: str) -> str:
        """A number with a decimal point."""
        if not self.sheet.decimal_comma or text.count(",") != 1 or "." in text:
            return text
        if THOUSANDS.fullmatch(text):
            self.doubtful = self.doubtful or text
        else:
            self.decimal = True
        return text.replace(",", ".")

    def _fault(self, ours: str, must: str, got: str, cure: str = "") -> None:
        column = self.columns[ours]
        cure = cure or f"if this is not {ours}, name the column: --column {ours}=THEIRS"
        self.faults.add(self.line, f"{column.place + 1}: {column.name}:", must, got, cure)


def _second_of_day(found: re.Match) -> float:
    """A time matched by OF_DAY, s after midnight; raises ValueError for an impossible one."""
    hours, minutes, seconds, fraction = found.groups(default="0")
    if int(hours) > 23 or int(minutes) > 59 or int(seconds) > 60:
        raise ValueError(found[0])
    return 3600 * int(hours) + 60 * int(minutes) + float(f"{int(seconds)}.{fraction}")
