"""Positions of aircraft and plots in CSV: transponder data (OpenSky and its like) and spreadsheets of one's own.

Columns are found by their names, whatever the case and the spaces; a unit may stand at the end of a name (`range_km`,
`Altitude [ft]`). Times are seconds from 1970, or ISO 8601 with or without a zone (UTC is taken where there is none).
"""

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TextIO

from radarsim.errors import ConfigError
from radarsim.recorded.formats.records import (
    BATCH,
    PLOT_COLUMNS,
    PLOTS,
    POSITION_COLUMNS,
    POSITIONS,
    Batch,
    Gathered,
    utc_s,
)

MOST_FAULTS = 20
LARGEST = 1e15
UNITS = {
    "": 1.0, "m": 1.0, "s": 1.0, "mps": 1.0, "m/s": 1.0, "deg": 1.0, "rad": 1.0, "°": 1.0,
    "km": 1e3, "ft": 0.3048, "feet": 0.3048, "nm": 1852.0, "nmi": 1852.0, "kn": 1852 / 3600, "kt": 1852 / 3600,
    "kts": 1852 / 3600, "knots": 1852 / 3600, "kmh": 1 / 3.6, "km/h": 1 / 3.6, "ms": 1e-3, "fpm": 0.3048 / 60,
    "ft/min": 0.3048 / 60,
}  # fmt: skip
# Our name of what is read: the names it goes by, in lower case without spaces and units.
NAMES = {
    "t_s": ("t", "time", "timestamp", "t_s", "datetime", "date_time", "utc", "time_position", "lastposupdate"),
    "track": ("track", "track_id", "icao24", "icao", "hex", "address", "callsign", "mmsi", "id", "flight", "name"),
    "latitude_deg": ("lat", "latitude"),
    "longitude_deg": ("lon", "lng", "long", "longitude"),
    "altitude_m": ("geoaltitude", "geo_altitude", "altitude", "alt", "height", "baroaltitude", "baro_altitude"),
    "speed_mps": ("velocity", "groundspeed", "ground_speed", "gs", "speed", "sog"),
    "course_deg": ("heading", "true_track", "course", "cog", "track_angle"),
    "up_mps": ("vertrate", "vertical_rate", "vert_rate", "climb"),
    "range_m": ("range", "slant_range", "distance", "rho"),
    "bearing_rad": ("bearing", "azimuth", "az", "theta"),
    "velocity_mps": ("radial_velocity", "doppler", "radial_speed", "range_rate", "velocity"),
    "span_mps": ("span", "ambiguity", "doppler_span"),
}
ON_EARTH = ("latitude_deg", "longitude_deg")
UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]$")


class Column:
    """A column of the file: its place, and what makes its numbers into our units."""

    def __init__(self, place: int, name: str, factor: float, angle: bool):
        self.place, self.name, self.factor, self.angle = place, name, factor, angle


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

    def __init__(self, path: str, file: TextIO, given: Mapping[str, str] | None = None):
        self.path = path
        self.rows = csv.reader(file, strict=True)
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.faults: list[str] = []
        try:
            header = next((row for row in self.rows if row and not row[0].startswith("#")), [])
        except csv.Error as error:
            raise ConfigError(f"{path}:{self.rows.line_num}: not a CSV row: {error}") from error
        self.width = len(header)
        self.columns = self._found(header, given or {})
        self.kind = POSITIONS if set(ON_EARTH) <= set(self.columns) else PLOTS
        self._complete(header)

    def _found(self, header: list[str], given: Mapping[str, str]) -> dict[str, Column]:
        """Which of our columns the header has; those that were given by name first."""
        found: dict[str, Column] = {}
        names = [name.strip() for name in header]
        for ours, theirs in given.items():
            if ours not in NAMES or theirs not in names:
                allowed = f"one of {', '.join(NAMES)}" if ours not in NAMES else f"a column of {', '.join(names)}"
                raise ConfigError(f"{self.path}:1: column {ours}={theirs}: must name {allowed}")
            found[ours] = self._column(ours, names.index(theirs), header)
        earth = any(split(name)[0] in NAMES["latitude_deg"] for name in header)
        for ours, known in NAMES.items():
            if ours in found or (ours == "velocity_mps" and earth) or (ours == "speed_mps" and not earth):
                continue
            places = {split(name)[0]: i for i, name in reversed(list(enumerate(header)))}
            if one := next((name for name in known if name in places), None):
                found[ours] = self._column(ours, places[one], header)
        return found

    def _column(self, ours: str, place: int, header: list[str]) -> Column:
        unit = split(header[place])[1]
        if unit not in UNITS and ours not in ("track", "t_s"):
            raise ConfigError(f"{self.path}:1: {header[place].strip()}: the unit must be one of "
                              f"{', '.join(name for name in UNITS if name)}; got {unit!r}")  # fmt: skip
        angle = ours == "bearing_rad"
        factor = math.pi / 180 if angle and unit != "rad" else UNITS.get(unit, 1.0)
        return Column(place, header[place].strip(), factor, angle)

    def _complete(self, header: list[str]) -> None:
        wanted = ("t_s", *ON_EARTH) if self.kind == POSITIONS else ("t_s", "range_m")
        if missing := [name for name in wanted if name not in self.columns]:
            hints = "; ".join(f"{name}: {', '.join(NAMES[name])}" for name in missing)
            got = ", ".join(name.strip() for name in header)[:200] or "nothing"
            what = "columns of time, and of latitude and longitude or of range"
            raise ConfigError(f"{self.path}:1: must have {what}; missing ({hints}); got {got}")

    def batches(self) -> Iterator[Batch]:
        """The rows, some at a time; raises ConfigError with all faults, each with its line and column."""
        names = POSITION_COLUMNS if self.kind == POSITIONS else PLOT_COLUMNS
        row_of: Callable[[list[str]], tuple[float, ...]] = self._position if self.kind == POSITIONS else self._plot
        gathered = Gathered(self.kind, names)
        try:
            for cells in self.rows:
                if cells:
                    self._take(cells, gathered, row_of)
                if len(gathered) >= BATCH and not self.faults:
                    yield gathered.taken()
        except csv.Error as error:
            self.faults.append(f"{self.path}:{self.rows.line_num}: not a CSV row: {error}")
        if self.faults:
            raise ConfigError(*self.faults)
        if len(gathered):
            yield gathered.taken()

    def _take(self, cells: list[str], gathered: Gathered, row_of: Callable[[list[str]], tuple[float, ...]]) -> None:
        if len(self.faults) >= MOST_FAULTS:
            raise ConfigError(*self.faults, f"{self.path}: more faults may follow")
        self.records += 1
        if len(cells) != self.width:
            line = self.rows.line_num
            self.faults.append(f"{self.path}:{line}: must have {self.width} cells as the header, got {len(cells)}")
            return
        row = row_of(cells)
        if any(math.isnan(row[i]) for i in ((0, 1, 2) if self.kind == POSITIONS else (0, 1))):
            self.skipped["records without time or position"] += 1
            return
        name = cells[self.columns["track"].place].strip() if "track" in self.columns else "1"
        gathered.add(name, name.lower(), row)

    def _position(self, cells: list[str]) -> tuple[float, ...]:
        """POSITION_COLUMNS of a row."""
        speed, course = self._number(cells, "speed_mps"), math.radians(self._number(cells, "course_deg"))
        t, up = self._time(cells), self._number(cells, "up_mps")
        lat, lon = self._number(cells, "latitude_deg"), self._number(cells, "longitude_deg")
        for name, value, most in (("latitude_deg", lat, 90), ("longitude_deg", lon, 360)):
            if abs(value) > most:
                self._fault(name, f"must be from -{most} to {most} degrees, got {value:g}")
        return t, lat, lon, self._number(cells, "altitude_m"), speed * math.sin(course), speed * math.cos(course), up

    def _plot(self, cells: list[str]) -> tuple[float, ...]:
        """PLOT_COLUMNS of a row."""
        t, names = self._time(cells), ("range_m", "bearing_rad", "velocity_mps", "span_mps", "altitude_m")
        return (t, *(self._number(cells, name) for name in names))

    def _time(self, cells: list[str]) -> float:
        column = self.columns["t_s"]
        text = cells[column.place].strip()
        try:
            return float(text) * column.factor if text else math.nan
        except ValueError:
            pass
        try:
            return utc_s(text)
        except ValueError:
            self._fault("t_s", f"must be a time in s or ISO 8601, got {text[:60]!r}")
            return math.nan

    def _number(self, cells: list[str], name: str) -> float:
        column = self.columns.get(name)
        text = cells[column.place].strip() if column else ""
        if not column or not text or text.lower() in ("nan", "null", "none", "na"):
            return math.nan
        try:
            value = float(text)
        except ValueError:
            value = math.inf
        if not abs(value) <= LARGEST:
            self._fault(name, f"must be a number, got {text[:60]!r}")
            return math.nan
        return value * column.factor

    def _fault(self, name: str, what: str) -> None:
        column = self.columns[name]
        self.faults.append(f"{self.path}:{self.rows.line_num}:{column.place + 1}: {column.name}: {what}")
