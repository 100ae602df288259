"""Positions of aircraft and plots in CSV: transponder data (OpenSky and the like) and users' spreadsheets.

Columns are found by their names, whatever the case and the spaces; a unit may stand at the end of a name (`range_km`,
`Altitude [ft]`). Times are seconds from 1970, times of day (unwrapped after midnight), dates as `20.11.2026
10:00:00,01` or ISO 8601, with or without a zone (default UTC). Cells are separated by commas, semicolons or tabs,
whichever is most frequent in the header; with a separator other than a comma, numbers may have a decimal comma.

A name without unit means SI; but positions with names from aviation (`gs`, `groundspeed`, `alt`, …) are in feet, knots
and feet a minute, and speeds of ships (`sog`) in knots, like the exports that use them. Assumptions are in `notes`. The
time is that of the measurement, if the file has several.
"""

import csv
import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TextIO

from radarsim.errors import ConfigError
from radarsim.recorded.formats import sites
from radarsim.recorded.plots import Faults

LARGEST = 1e15
RowOf = Callable[[list[str]], tuple[float, ...]]  # a row of numbers from the cells of a line
UNITS = {
    "": 1.0, "m": 1.0, "s": 1.0, "mps": 1.0, "m/s": 1.0, "deg": 1.0, "degrees": 1.0, "rad": 1.0, "°": 1.0,
    "km": 1e3, "ft": 0.3048, "feet": 0.3048, "nm": 1852.0, "nmi": 1852.0, "kn": 1852 / 3600, "kt": 1852 / 3600,
    "kts": 1852 / 3600, "knots": 1852 / 3600, "kmh": 1 / 3.6, "km/h": 1 / 3.6, "ms": 1e-3, "fpm": 0.3048 / 60,
    "ft/min": 0.3048 / 60,
}  # fmt: skip
# Our name of a quantity: the names it has in files, in lower case without spaces and units.
NAMES = {
    "t_s": (
        *("lastposupdate", "last_position", "time_position"),  # of the position; the following may be of a query
        *("t", "time", "timestamp", "t_s", "datetime", "date_time", "basedatetime", "base_date_time", "utc"),
    ),
    "track": ("icao24", "icao", "hex", "mmsi", "track_id", "address", "callsign", "flight", "id", "track", "name"),
    "latitude_deg": ("lat", "latitude"),
    "longitude_deg": ("lon", "lng", "long", "longitude"),
    "altitude_m": (
        *("geoaltitude", "geo_altitude", "alt_geom", "altitude", "alt", "height"),
        *("baroaltitude", "baro_altitude", "alt_baro"),
    ),
    "speed_mps": ("velocity", "groundspeed", "ground_speed", "gs", "speed", "sog"),
    # Of a ship the heading is where its bow points; aircraft have their course under this name too.
    "course_deg": ("true_track", "course", "cog", "track_angle", "direction", "heading", "track"),
    "up_mps": ("vertrate", "vertical_rate", "vert_rate", "geom_rate", "baro_rate", "climb"),
    "range_m": ("range", "slant_range", "distance", "rho"),
    "bearing_rad": ("bearing", "azimuth", "az", "theta"),
    "velocity_mps": ("radial_velocity", "doppler", "radial_speed", "range_rate", "velocity"),
    "span_mps": ("span", "ambiguity", "doppler_span"),
}
ON_EARTH = ("latitude_deg", "longitude_deg")
POSITION = "position"  # latitude and longitude in one cell, parted by a comma
AVIATION = ("gs", "groundspeed", "ground_speed", "alt", "alt_baro", "alt_geom", "direction")  # names without a unit
AVIATION_UNITS = {"altitude_m": "ft", "speed_mps": "kn", "up_mps": "fpm"}
MARITIME = ("sog", "cog", "mmsi")  # names of AIS: speeds without a unit are in knots, and these values mean missing:
NO_SPEED_KN, NO_COURSE_DEG = 102.2, 360.0
THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")  # a number that may be a thousand or a decimal
MIDNIGHT_S = 3600.0  # a falling time of day has passed midnight if both are as near it; else a file is sorted by track
STILL_MPS = 1.0  # below it a position may stay the same
NAMES_AT_MOST = 10_000  # different cells in a column that may name aircraft
HIGHEST_M = 20_000.0  # of an aircraft; higher altitudes are feet
DELIMITERS = ",;\t"
OF_DAY = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,:](\d+))?)?")
DATED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})[ T]+(\S+)")
TIMES = "a time of day, ISO 8601 or DD.MM.YYYY and a time"
UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]$")


class Column:
    """A column of the file: its index and the conversion to our units."""

    def __init__(self, place: int, name: str, factor: float, unit: str):
        """unit: the assumed one, where the name has none."""
        self.place, self.name, self.factor, self.unit = place, name, factor, unit


def _second_of_day(found: re.Match) -> float:
    """A time matched by OF_DAY, s after midnight; raises ValueError for an impossible one."""
    hours, minutes, seconds, fraction = found.groups(default="0")
    if int(hours) > 23 or int(minutes) > 59 or int(seconds) > 60:
        raise ValueError(found[0])
    return 3600 * int(hours) + 60 * int(minutes) + float(f"{int(seconds)}.{fraction}")


def _written_s(text: str) -> float:
    """Seconds from 1970 of a date and time, `20.11.2026 10:00:00` or ISO 8601; raises ValueError."""
    if not (found := DATED.fullmatch(text)):
        return sites.utc_s(text)
    day, month, year, clock = found.groups()
    if not (time := OF_DAY.fullmatch(clock)):
        raise ValueError(text)
    return sites.utc_s(f"{year}-{int(month):02}-{int(day):02}") + _second_of_day(time)


def split(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case, and its unit: `Range [km]` and `range_km` are (range, km)."""
    name = name.strip().lower()
    if found := UNIT.match(name):
        return re.sub(r"\s+", "_", found[1].strip()), found[2].strip()
    name = re.sub(r"\s+", "_", name)
    stem, _, last = name.rpartition("_")
    return (stem, last) if stem and last in UNITS else (name, "")


class Table:
    """A CSV file with a header, of positions or of plots."""

    of_day = False

    def __init__(self, path: str, file: TextIO, given: Mapping[str, str] | None = None, encoding: str = "UTF-8"):
        """encoding: of the file."""
        self.path, self.records, self.highest, self.encoding = path, 0, 0.0, encoding
        self.doubtful = ""  # the first number whose comma may separate thousands
        self.decimal = False  # a comma that cannot has been read
        self.skipped: Counter[str] = Counter()
        self.faults = Faults(path)
        header = self._opened(file)
        self.width = len(header)
        names = {split(name) for name in header}
        self.aviation = any((name, "") in names for name in AVIATION)
        self.maritime = any(name in MARITIME for name, _ in names)
        self.clock = sites.Unrolled(sites.DAY_S, near_s=MIDNIGHT_S)
        self.before_it: dict[str, tuple[float, ...]] = {}  # the last position of each track
        self.stated: set[str] = set()  # columns whose unit --column states
        self.columns = self._found(header, given or {})
        self.kind = sites.POSITIONS if set(ON_EARTH) <= set(self.columns) else sites.PLOTS
        self._complete(header)
        taken = {column.place for column in self.columns.values()}
        free = [] if "track" in self.columns else [i for i in range(self.width) if i not in taken]
        self.cells: dict[int, set[str]] = {i: set() for i in free}  # of columns that may name the aircraft
        self.header = [name.strip() for name in header]

    def _opened(self, file: TextIO) -> list[str]:
        """Read the header; the rows are then split by its separator."""
        before, text = 0, ""
        for text in file:
            if text.strip() and not text.startswith("#"):
                break
            before, text = before + 1, ""
        delimiter = max(DELIMITERS, key=text.count)
        self.decimal_comma = delimiter != ","
        self.rows = csv.reader(itertools.chain([text], file), strict=True, delimiter=delimiter)
        self.before = before
        try:
            return next(self.rows, [])
        except csv.Error as error:
            raise ConfigError(f"{self.path}:{self.line}: not a CSV row: {error}") from error

    @property
    def line(self) -> int:
        """The line of the file that was read last."""
        return self.before + self.rows.line_num

    def notes(self) -> list[str]:
        """Assumptions on units, and signs against them."""
        plain = {ours: c.name for ours, c in self.columns.items() if ours not in self.stated and not split(c.name)[1]}
        units = {"range_m": "m", "bearing_rad": "degrees", "velocity_mps": "m/s", "span_mps": "m/s", "altitude_m": "m"}
        units |= {"speed_mps": "m/s", "up_mps": "m/s"} | {ours: c.unit for ours, c in self.columns.items() if c.unit}
        taken = ", ".join(f"{name} in {units[ours]}" for ours, name in plain.items() if ours in units)
        found = [f"assumed because the name has no unit: {taken}"] if taken else []
        if self.encoding != "UTF-8":
            found.append(f"the text is read as {self.encoding}, as it is not UTF-8; for another: --encoding NAME")
        if self.doubtful and not self.decimal:
            value = float(self.doubtful.replace(",", "."))
            found.append(f"commas are decimal: {self.doubtful} is read as {value:g}")
        time = self.columns["t_s"].name
        if others := [name for name in self.header if split(name)[0] in NAMES["t_s"] and name != time]:
            found.append(f"times are {time}; not used: {', '.join(others)}")
        if not self.aviation and self.highest > HIGHEST_M:
            name = self.columns["altitude_m"].name
            found.append(f"altitudes up to {self.highest:.0f} m: if {name} is in feet, name it {name}_ft")
        return found

    def whose(self, late: int) -> str | None:
        """The question which column names the aircraft, where none does and so many rows are out of time order."""
        if not late or "track" in self.columns:
            return None
        likely = [(i, len(cells)) for i, cells in self.cells.items() if 1 < len(cells) <= self.records / 2]
        named = (
            ", ".join(f"{self.header[i]} ({count} different)" for i, count in likely)
            or "none: each has too many different values"
        )
        rows = "1 row is" if late == 1 else f"{late} rows are"
        return (
            f"{self.path}: track: no column identifies the tracks, and {rows} not later than the one before; "
            f"name the column, --column track=THEIRS; it may be: {named}"
        )

    def _found(self, header: list[str], given: Mapping[str, str]) -> dict[str, Column]:
        """Our columns in the header; those assigned by the user first."""
        found: dict[str, Column] = {}
        names = [name.strip() for name in header]
        stems = {split(ours)[0]: ours for ours in NAMES}
        for name, theirs in given.items() if header else ():
            stem, unit = split(name)
            ours = name if name in NAMES else stems.get(stem, "")
            if not ours or theirs not in names:
                allowed = f"a column of {', '.join(names)}" if ours else f"one of {', '.join(NAMES)}, in any unit"
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must name {allowed}")
            unit, own = "" if name == ours else unit, split(theirs)[1]
            if unit and own and unit != own:
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must have the unit of its own name, {own}")
            self.stated |= {ours} if unit else set()
            found[ours] = self._column(ours, names.index(theirs), header, unit)
        earth = any(split(name)[0] in (*NAMES["latitude_deg"], POSITION) for name in header)
        places = {split(name)[0]: i for i, name in reversed(list(enumerate(header)))}
        for ours, known in NAMES.items():
            if ours in found or (ours == "velocity_mps" and earth) or (ours == "speed_mps" and not earth):
                continue
            taken = {column.place for column in found.values()}
            if one := next((name for name in known if name in places and places[name] not in taken), None):
                found[ours] = self._column(ours, places[one], header)
        if POSITION in places and not set(ON_EARTH) & set(found):
            found |= {ours: self._column(ours, places[POSITION], header) for ours in ON_EARTH}
        return found

    def _column(self, ours: str, place: int, header: list[str], given: str = "") -> Column:
        """given: the unit that --column gives it, where its own name has none."""
        name, unit = header[place].strip(), split(header[place])[1] or given
        if [one.strip() for one in header].count(name) > 1:
            raise ConfigError(f"{self.path}:1: {name}: must be the name of one column; several have it")
        taken = ""
        if not unit and self.aviation:
            unit = taken = AVIATION_UNITS.get(ours, "")
        if not unit and self.maritime and ours == "speed_mps":
            unit = taken = "kn"
        if unit not in UNITS and ours not in ("track", "t_s"):
            raise ConfigError(f"{self.path}:1: {name}: the unit must be one of "
                              f"{', '.join(name for name in UNITS if name)}; got {unit!r}")  # fmt: skip
        angle = ours == "bearing_rad"
        factor = math.pi / 180 if angle and unit != "rad" else UNITS.get(unit, 1.0)
        return Column(place, name, factor, taken)

    def _complete(self, header: list[str]) -> None:
        wanted = ("t_s", *ON_EARTH) if self.kind == sites.POSITIONS else ("t_s", "range_m")
        if missing := [name for name in wanted if name not in self.columns]:
            hints = "; ".join(f"{name}: {', '.join(NAMES[name])}" for name in missing)
            got = ", ".join(name.strip() for name in header)[:200] or "nothing"
            what = "columns of time, and of latitude and longitude or of range (name them: --column OURS=THEIRS)"
            raise ConfigError(f"{self.path}:1: must have {what}; missing ({hints}); got {got}")

    def batches(self) -> Iterator[sites.Batch]:
        """The rows in batches; raises ConfigError with all faults, each with its line and column."""
        names = sites.POSITION_COLUMNS if self.kind == sites.POSITIONS else sites.PLOT_COLUMNS
        row_of: RowOf = self._position if self.kind == sites.POSITIONS else self._plot
        gathered = sites.Gathered(self.kind, names)
        try:
            for cells in self.rows:
                if cells:
                    self._take(cells, gathered, row_of)
                if len(gathered) >= sites.BATCH and not self.faults:
                    yield gathered.taken()
        except csv.Error as error:
            raise ConfigError(*self.faults.lines(), f"{self.path}:{self.line}: not a CSV row: {error}") from error
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
        if any(math.isnan(row[i]) for i in ((0, 1, 2) if self.kind == sites.POSITIONS else (0, 1))):
            self.skipped["records without time or position"] += 1
            return
        for place, seen in self.cells.items():
            if len(seen) < NAMES_AT_MOST:
                seen.add(cells[place].strip())
        name = cells[self.columns["track"].place].strip() if "track" in self.columns else "1"
        if self.kind == sites.POSITIONS:
            stands = math.hypot(row[4], row[5]) <= STILL_MPS
            if self.before_it.get(name) == row[1:3] and not stands:
                self.skipped["rows that repeat the position before them"] += 1
                return
            self.before_it[name] = row[1:3]
        gathered.add(name, name.lower(), row)

    def _position(self, cells: list[str]) -> tuple[float, ...]:
        """POSITION_COLUMNS of a row."""
        speed, course = self._number(cells, "speed_mps"), math.radians(self._number(cells, "course_deg"))
        if self.maritime and not (speed <= NO_SPEED_KN * UNITS["kn"] and course < math.radians(NO_COURSE_DEG)):
            speed = math.nan
        t, up = self._time(cells), self._number(cells, "up_mps")
        lat, lon = self._number(cells, "latitude_deg"), self._number(cells, "longitude_deg")
        for name, value, most in (("latitude_deg", lat, 90), ("longitude_deg", lon, 360)):
            if abs(value) > most:
                self._fault(name, f"must be from -{most} to {most} degrees", f"{value:g}")
        altitude = self._number(cells, "altitude_m")
        self.highest = max(self.highest, altitude)  # NaN is not larger
        return t, lat, lon, altitude, speed * math.sin(course), speed * math.cos(course), up

    def _plot(self, cells: list[str]) -> tuple[float, ...]:
        """PLOT_COLUMNS of a row."""
        t, names = self._time(cells), ("range_m", "bearing_rad", "velocity_mps", "span_mps", "altitude_m")
        return (t, *(self._number(cells, name) for name in names))

    def _time(self, cells: list[str]) -> float:
        column = self.columns["t_s"]
        text = cells[column.place].strip()
        try:
            t = float(self._pointed(text)) * column.factor if text else math.nan
            return self.clock(t) if 0 <= t < sites.DAY_S else t
        except ValueError:
            pass
        try:
            if day := OF_DAY.fullmatch(text):
                return self.clock(_second_of_day(day))
            return _written_s(text)
        except ValueError:
            self._fault("t_s", f"must be a time in s, {TIMES}", repr(text[:60]))
            return math.nan

    def _number(self, cells: list[str], name: str) -> float:
        column = self.columns.get(name)
        text = cells[column.place].strip() if column else ""
        if column and split(column.name)[0] == POSITION:
            text = text.partition(",")[2 * (name == "longitude_deg")]
        if not column or not text or text.lower() in ("nan", "null", "none", "na"):
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
        if not self.decimal_comma or text.count(",") != 1 or "." in text:
            return text
        if THOUSANDS.fullmatch(text):
            self.doubtful = self.doubtful or text
        else:
            self.decimal = True
        return text.replace(",", ".")

    def _fault(self, ours: str, must: str, got: str) -> None:
        column = self.columns[ours]
        cure = f"if this is not {ours}, name the column: --column {ours}=THEIRS"
        self.faults.add(self.line, f"{column.place + 1}: {column.name}:", must, got, cure)
