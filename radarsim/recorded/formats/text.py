"""Read tables of positions or of plots, row by row, in our quantities and units; read CSV as a table.

Times are seconds from 1970 (or thousandths and less of them, seen by their size), times of day (unwrapped after
midnight, or of the day in a column `date`), dates as `20.11.2026 10:00:00,01` or ISO 8601, with or without a zone
(default UTC). The time is that of the measurement, if the file has several. Assumptions are in `notes`.

Cells of CSV are separated by commas, semicolons or tabs, whichever is most frequent in the header; with a separator
other than a comma, numbers may have a decimal comma.

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
    default_unit: str = ""


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
UNITLESS = ("t_s", "date", "track")  # what a bracket says of these is no unit: Time (UTC)
EARTH_COLUMNS = ("latitude_deg", "longitude_deg")
PLOT_COLUMNS = ("range_m", "bearing_rad")
JOINT_POSITION = "position"  # latitude and longitude in one cell, parted by a comma
AVIATION_NAMES = (  # names without a unit
    *("gs", "groundspeed", "ground_speed", "alt", "alt_baro", "alt_geom", "direction", "mode_c", "modec"),
)
AVIATION_UNITS = {"altitude_m": "ft", "barometric_m": "ft", "speed_mps": "kn", "up_mps": "fpm"}
MARITIME_NAMES = ("sog", "cog", "mmsi")  # names of AIS
HEADING_NAME = "heading"
MARITIME_UNITS = {"speed_mps": "kn"}
UNIT_PATTERN = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]$")


class Column(NamedTuple):
    """A column of a file: its index, its name, what its numbers are multiplied by; its unit, and whether that is
    assumed."""

    position: int
    name: str
    factor: float
    unit: str
    is_assumed: bool


def split_unit(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case, and its unit: `Range [km]` and `range_km` are (range, km)."""
    name = name.strip().lower()
    if match := UNIT_PATTERN.match(name):
        return re.sub(r"\s+", "_", match[1].strip()), match[2].strip()
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

    def __init__(self, path: str, names: list[str], assigned: Mapping[str, str]):
        self.path, self.names = path, [_printable(name) for name in names]
        self.stems = [split_unit(name) for name in self.names]
        self.maritime = any(stem in MARITIME_NAMES for stem, _ in self.stems)
        self.aviation = any((name, "") in self.stems for name in AVIATION_NAMES)
        self.customary_units = AVIATION_UNITS if self.aviation else MARITIME_UNITS if self.maritime else {}
        self.columns: dict[str, Column] = {}
        self._assign_columns(assigned)
        has_positions = all(self._has(ours) or JOINT_POSITION in dict(self.stems) for ours in EARTH_COLUMNS)
        self.reads_positions = has_positions and not any(ours in self.columns for ours in PLOT_COLUMNS)
        self._find_columns(has_positions)
        places = self._column_indices()
        identity_columns = {
            kind: [places[name] for name in names if name in places] for kind, names in IDENTITIES.items()
        }
        self.identities = {kind: indices[0] for kind, indices in identity_columns.items() if indices}
        if "track" in self.columns and not self.identities:
            self.identities["address"] = self.columns["track"].position  # one's own name of it
        self._check()

    def _has(self, ours: str) -> bool:
        """Whether a quantity has been assigned, or has a known name."""
        return ours in self.columns or any(stem in QUANTITIES[ours].names for stem, _ in self.stems)

    def _assign_columns(self, assigned: Mapping[str, str]) -> None:
        """Assign the columns that the user names."""
        stems = {split_unit(ours)[0]: ours for ours in QUANTITIES}
        for name, theirs in assigned.items() if self.names else ():
            stem, unit = split_unit(name)
            ours = name if name in QUANTITIES else stems.get(stem, "")
            theirs = _printable(theirs)
            if not ours or theirs not in self.names:
                allowed = (
                    f"a column of {', '.join(self.names)}" if ours else f"one of {', '.join(QUANTITIES)}, in any unit"
                )
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must name {allowed}")
            stated_unit = split_unit(theirs)[1]
            if unit and stated_unit and name != ours and unit != stated_unit:
                raise ConfigError(
                    f"{self.path}:1: column {name}={theirs}: must have the unit of its own name, {stated_unit}"
                )
            self.columns[ours] = self._column(ours, self.names.index(theirs), stated_unit or unit)

    def _column_indices(self) -> dict[str, int]:
        """The index of each name, of the first column that has it."""
        return {stem: i for i, (stem, _) in reversed(list(enumerate(self.stems)))}

    def _find_columns(self, has_positions: bool) -> None:
        """Find the other columns by their known names."""
        indices = self._column_indices()
        left_out = (
            (*PLOT_COLUMNS, "velocity_mps", "span_mps")
            if self.reads_positions
            else ("speed_mps", "course_deg", *EARTH_COLUMNS)
        )
        # beside a position it is the speed over ground
        excluded = {("velocity_mps", "velocity")} if has_positions else set()
        excluded |= {("course_deg", HEADING_NAME)} if self.maritime else set()
        used_indices = {column.position for column in self.columns.values()}
        for ours, quantity in QUANTITIES.items():
            candidates = [
                name
                for name in quantity.names
                if (ours, name) not in excluded and indices.get(name) not in used_indices
            ]
            match = next((name for name in candidates if name in indices), None)
            if match and ours not in self.columns and ours not in left_out:
                self.columns[ours] = self._column(ours, indices[match], self.stems[indices[match]][1])
                used_indices.add(indices[match])
        if self.reads_positions and JOINT_POSITION in indices:
            for ours in set(EARTH_COLUMNS) - set(self.columns):
                self.columns[ours] = self._column(ours, indices[JOINT_POSITION], "")

    def _column(self, ours: str, index: int, unit: str) -> Column:
        """A column in its unit; '' where neither its name nor the user states one."""
        name, quantity = self.names[index], QUANTITIES[ours]
        if self.names.count(name) > 1:
            raise ConfigError(f"{self.path}:1: {name}: must be the name of one column; several have it")
        is_known = unit in quantity.units or ours in UNITLESS
        if unit and not is_known:
            raise ConfigError(
                f"{self.path}:1: {name}: the unit must be one of {', '.join(quantity.units)}; got {unit!r}"
            )
        unit_or_default = unit or self.customary_units.get(ours, quantity.default_unit)
        is_assumed = not unit and ours not in UNITLESS and quantity.units is not DEGREES
        return Column(index, name, quantity.units.get(unit_or_default, 1.0), unit_or_default, is_assumed)

    def _check(self) -> None:
        """Raise ConfigError for missing columns, and for units that must be stated."""
        required = ("t_s", *EARTH_COLUMNS) if self.reads_positions else ("t_s", "range_m")
        if missing := [name for name in required if name not in self.columns]:
            hints = "; ".join(f"{name}: {', '.join(QUANTITIES[name].names)}" for name in missing)
            got = ", ".join(self.names)[:200] or "nothing"
            needed = "columns of time, and of latitude and longitude or of range (name them: --column OURS=THEIRS)"
            raise ConfigError(f"{self.path}:1: must have {needed}; missing ({hints}); got {got}")
        if columns_without_unit := {
            ours: column.name for ours, column in self.columns.items() if not column.unit and ours not in UNITLESS
        }:
            cures = []
            for ours, name in columns_without_unit.items():
                by_factor: dict[float, str] = {}
                for unit, factor in QUANTITIES[ours].units.items():
                    by_factor.setdefault(factor, f"{split_unit(ours)[0]}_{unit}")
                first, *alternatives = by_factor.values()
                cures.append(f"--column {first}={shlex.quote(name)} (or {', '.join(alternatives)})")
            names = ", ".join(columns_without_unit.values())
            raise ConfigError(f"{self.path}:1: {names}: must have a unit in the name; where it has none, "
                              f"{', '.join(cures)} states it")  # fmt: skip

    def notes(self) -> list[str]:
        """Notes on assumptions, and on columns that are not used."""
        assumed = [column for column in self.columns.values() if column.is_assumed and column.unit]
        unit_texts = ", ".join(tr("{name} in {unit}", name=column.name, unit=column.unit) for column in assumed)
        lines = [tr("assumed because the name has no unit: {units}", units=unit_texts)] if unit_texts else []
        time = self.columns["t_s"].name
        names_by_stem = {stem: name for (stem, _), name in zip(self.stems, self.names, strict=True)}
        used = {column.name for column in self.columns.values()}
        unused = [
            names_by_stem[stem]
            for stem in names_by_stem
            if stem in QUANTITIES["t_s"].names and names_by_stem[stem] not in used
        ]
        if unused:
            lines.append(tr("times are {time}; not used: {others}", time=time, others=", ".join(unused)))
        if (
            self.maritime
            and self.reads_positions
            and HEADING_NAME in names_by_stem
            and "course_deg" not in self.columns
        ):
            lines.append(
                tr("no speeds: {heading} is where the bow points, not the course", heading=names_by_stem[HEADING_NAME])
            )
        ranges = [names_by_stem[stem] for stem in names_by_stem if stem in QUANTITIES["range_m"].names]
        if self.reads_positions and ranges:
            column = f"--column range_UNIT={shlex.quote(ranges[0])}"
            lines.append(tr("positions are read, not plots; for these: {column}", column=column))
        return lines


LARGEST_NUMBER = 1e15
RowReader = Callable[[list[str]], tuple[float, ...]]  # a row of numbers from the cells of a line
MAX_SPEED_MPS, UNKNOWN_COURSE_DEG = 102.2 * sites.KNOT_MPS, 360.0  # of AIS: what is not below them means missing
MISSING_TEXTS = ("nan", "null", "none", "na", "n/a", "#n/a")
THOUSANDS_PATTERN = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")  # a number that may be a thousand or a decimal
MIDNIGHT_S = 3600.0  # a falling time of day has passed midnight if both are as near it; else a file is sorted by track
STILL_MPS = 1.0  # below it a position may stay the same
MAX_CELL_VALUES = 10_000  # different cells in a column that may name aircraft
MAX_ALTITUDE_M = 20_000.0  # of an aircraft; higher altitudes are feet
MAX_TIME_S = 1e11  # greater times are thousandths of seconds, or thousandths of these
DELIMITERS = ",;\t"
CLOCK_PATTERN = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,:](\d+))?)?")
DATE_PATTERN = re.compile(r"(\d{1,2})([./])(\d{1,2})\2(\d{4})(?:[ T]+(\S+))?")
TIME_FORMATS = "a time of day, ISO 8601 or DD.MM.YYYY and a time"


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


def read_csv(path: str, file: TextIO, encoding: str) -> Sheet:
    """Read a CSV file as a sheet; lines of comment may stand before the header, which shows the separator."""
    skipped_lines, comment, text = 0, "", ""
    for text in file:
        if text.strip() and not text.startswith("#"):
            break
        skipped_lines, comment, text = skipped_lines + 1, text, ""
    delimiter = max(DELIMITERS, key=text.count)
    lines = itertools.chain([text], file)
    if _is_header(comment[1:], delimiter) and not _is_header(text, delimiter):
        lines, skipped_lines = itertools.chain([comment[1:]], lines), skipped_lines - 1
    cells = csv.reader(lines, strict=True, delimiter=delimiter)

    def rows() -> Iterator[tuple[int, list[str]]]:
        try:
            for row in cells:
                if row:
                    yield skipped_lines + cells.line_num, row
        except csv.Error as error:
            raise ConfigError(f"{path}:{skipped_lines + cells.line_num}: not a CSV row: {error}") from error

    numbered_rows = rows()
    _, header = next(numbered_rows, (0, []))
    while header and not header[-1].strip():
        header.pop()
    return Sheet(path, header, _trim_rows(numbered_rows, len(header)), delimiter != ",", encoding)


def _is_header(line: str, delimiter: str) -> bool:
    """Whether a line names a column of time."""
    return any(split_unit(name)[0] in QUANTITIES["t_s"].names for name in line.strip().split(delimiter))


def _trim_rows(rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[tuple[int, list[str]]]:
    """Remove separators after the last cell of each row."""
    for line, row in rows:
        if len(row) > width and not any(cell.strip() for cell in row[width:]):
            del row[width:]
        yield line, row


class Table:
    """The reader of a sheet of positions or of plots; `assigned` holds the columns that --column names."""

    def __init__(self, sheet: Sheet, assigned: Mapping[str, str] | None = None):
        self.path, self.sheet, self.skipped = sheet.path, sheet, sheet.skipped
        self.line = 0
        self.records, self.highest_m, self.barometric_count, self.silent_count = 0, 0.0, 0, 0
        self.of_day = False  # known after the first rows
        self.doubtful = ""  # the first number whose comma may separate thousands
        self.has_decimal_comma = False  # a comma that cannot has been read
        self.faults = Faults(self.path)
        self.width = len(sheet.header)
        self.header = Header(self.path, sheet.header, assigned or {})
        self.columns = self.header.columns
        self.kind = sites.POSITIONS if self.header.reads_positions else sites.PLOTS
        self.clock = sites.UnrolledClock(sites.DAY_S, near_s=MIDNIGHT_S)
        self.day_s = math.nan  # of the date read last
        self.unit_s = 1.0  # of times that are too great for seconds
        self.slashed_dates: dict[str, str] = {}  # the first date of 1/2/2024 by what it shows: the order, or nothing
        self.last_positions: dict[str, tuple[float, ...]] = {}  # the last position of each track
        self.has_joint_position = (
            len({self.columns[ours].position for ours in EARTH_COLUMNS if ours in self.columns}) == 1
        )
        self.text_indices = {kind: index for kind, index in self.header.identities.items() if kind != "address"}
        used_indices = {column.position for column in self.columns.values()}
        candidates = [] if "track" in self.columns else [i for i in range(self.width) if i not in used_indices]
        self.cell_values: dict[int, set[str]] = {i: set() for i in candidates}  # of columns that may name the aircraft

    def notes(self, radars: Iterable[str] = ()) -> list[str]:
        """Notes on assumed units and times, and on signs against them."""
        lines = [*self.clock.notes(), *self.header.notes(), *self.sheet.notes]
        if (encoding := self.sheet.encoding) != "UTF-8":
            lines.append(
                tr("the text is read as {name}, as it is not UTF-8; for another: --encoding NAME", name=encoding)
            )
        if self.doubtful and not self.has_decimal_comma:
            value = float(self.doubtful.replace(",", "."))
            lines.append(tr("commas are decimal: {text} is read as {value:g}", text=self.doubtful, value=value))
        if self.unit_s < 1:
            lines.append(tr("times are so large that they are read in units of {unit:g} s", unit=self.unit_s))
        if "" in self.slashed_dates and len(self.slashed_dates) == 1:
            option = f"--column t_mdy={self.columns['t_s'].name}"
            message = term("{date} is read as day and month; if the month stands first: {cure}")
            lines.append(tr(message, date=self.slashed_dates[""], cure=option))
        if self.barometric_count:
            lines.append(
                tr("barometric altitudes, where the geometric one is missing: {count}", count=self.barometric_count)
            )
        if self.silent_count and "course_deg" in self.columns:
            message = term("reports without speed or course: {count} of {all}")
            lines.append(tr(message, count=self.silent_count, all=self.records))
        if self.highest_m > MAX_ALTITUDE_M and not self.header.aviation:
            name = (self.columns.get("altitude_m") or self.columns["barometric_m"]).name
            message = term("altitudes up to {highest:.0f} m: if {name} is in feet, name it {name}_ft")
            lines.append(tr(message, highest=self.highest_m, name=name))
        if likely := self._likely_track_columns():
            lines.append(tr("no column identifies the tracks, all rows are taken as one; if a column does, "
                            "--column track=THEIRS; it may be: {likely}", likely=likely))  # fmt: skip
        return lines

    def _likely_track_columns(self) -> str:
        """The columns that may identify the aircraft, if none is known: each value is in two rows on average."""
        likely = [(i, len(cells)) for i, cells in self.cell_values.items() if 1 < len(cells) <= self.records / 2]
        names = self.header.names
        return ", ".join(tr("{name} ({count} different)", name=names[i], count=count) for i, count in likely)

    def track_question(self, late_count: int) -> str | None:
        """The question which column identifies the aircraft, if none does and rows are out of order in time."""
        if not late_count or "track" in self.columns:
            return None
        candidates = self._likely_track_columns() or "none: each has too many different values"
        rows = "1 row is" if late_count == 1 else f"{late_count} rows are"
        return (
            f"{self.path}: track: no column identifies the tracks, and {rows} not later than the one before; "
            f"name the column, --column track=THEIRS; it may be: {candidates}"
        )

    def batches(self) -> Iterator[sites.Batch]:
        """The rows in batches; raises ConfigError with all faults, each with its line and column."""
        names = sites.POSITION_COLUMNS if self.kind == sites.POSITIONS else sites.PLOT_COLUMNS
        row_of: RowReader = self._position if self.kind == sites.POSITIONS else self._plot
        builder = sites.BatchBuilder(self.kind, names, tuple(self.text_indices))
        try:
            for line, cells in self.sheet.rows:
                self.line = line
                self._add_row(cells, builder, row_of)
                if len(builder) >= sites.BATCH_ROWS:
                    yield builder.take_batch()
        except ConfigError as error:
            raise ConfigError(*self.faults.lines(), *error.lines) from error
        if self.faults:
            raise ConfigError(*self.faults.lines())
        if len(builder):
            yield builder.take_batch()

    def _add_row(self, cells: list[str], builder: sites.BatchBuilder, row_of: RowReader) -> None:
        self.records += 1
        if len(cells) != self.width:
            self.faults.add(self.line, "", f"must have {self.width} cells as the header", len(cells))
            return
        row = row_of(cells)
        if self.faults:  # the rest is only read for further ones
            return
        if any(math.isnan(row[i]) for i in ((0, 1, 2) if self.kind == sites.POSITIONS else (0, 1))):
            self.skipped[sites.NO_TIME_OR_POSITION] += 1
            return
        for index, values in self.cell_values.items():
            if len(values) < MAX_CELL_VALUES:
                values.add(cells[index].strip())
        name = cells[self.columns["track"].position].strip() if "track" in self.columns else "1"
        if self.kind == sites.POSITIONS:
            is_still = math.hypot(row[4], row[5]) <= STILL_MPS
            if self.last_positions.get(name) == row[1:3] and not is_still:
                self.skipped[term("rows that repeat the position before them")] += 1
                return
            self.last_positions[name] = row[1:3]
        address_index = self.header.identities.get("address")
        address = "" if address_index is None else cells[address_index].strip().lower()
        builder.add(name, address, row, tuple(cells[index].strip() for index in self.text_indices.values()))

    def _position(self, cells: list[str]) -> tuple[float, ...]:
        """POSITION_COLUMNS of a row."""
        speed, course = self._parse_number(cells, "speed_mps"), self._parse_number(cells, "course_deg")
        if self.header.maritime and not (0 <= speed <= MAX_SPEED_MPS and 0 <= course < UNKNOWN_COURSE_DEG):
            speed = math.nan
            self.silent_count += 1
        course = math.radians(course)
        t, up = self._time(cells), self._parse_number(cells, "up_mps")
        lat, lon = self._parse_number(cells, "latitude_deg"), self._parse_number(cells, "longitude_deg")
        for name, value, limit in (("latitude_deg", lat, 90), ("longitude_deg", lon, 360)):
            if abs(value) > limit:
                self._add_fault(name, f"must be from -{limit} to {limit} degrees", f"{value:g}")
        return t, lat, lon, self._altitude(cells), speed * math.sin(course), speed * math.cos(course), up

    def _plot(self, cells: list[str]) -> tuple[float, ...]:
        """PLOT_COLUMNS of a row."""
        names = ("range_m", "bearing_rad", "velocity_mps", "span_mps")
        return (self._time(cells), *(self._parse_number(cells, name) for name in names), self._altitude(cells))

    def _altitude(self, cells: list[str]) -> float:
        """The geometric altitude, m; where there is none the barometric one; of a ship 0."""
        if self.header.maritime and not {"altitude_m", "barometric_m"} & set(self.columns):
            return 0.0
        altitude = self._parse_number(cells, "altitude_m")
        if math.isnan(altitude) and not math.isnan(altitude := self._parse_number(cells, "barometric_m")):
            self.barometric_count += "altitude_m" in self.columns
        self.highest_m = max(self.highest_m, altitude)  # NaN is not larger
        return altitude

    def _time(self, cells: list[str]) -> float:
        """Seconds from 1970; of a time of day without a date, from the first midnight."""
        column = self.columns["t_s"]
        text = cells[column.position].strip()
        if not text or text.lower() in MISSING_TEXTS:
            return math.nan
        try:
            try:
                t = float(self._with_decimal_point(text)) * column.factor
            except ValueError:
                return self._parse_time(text, cells)
            return self._date_time_of_day(t, cells) if 0 <= t < sites.DAY_S else self._scale_time(t)
        except ValueError:
            self._add_fault("t_s", f"must be a time in s, {TIME_FORMATS}", repr(text[:60]))
            return math.nan

    def _date_time_of_day(self, t: float, cells: list[str]) -> float:
        """A time of day, s, at the date beside it or before it; unrolled where the table has no date."""
        if "date" not in self.columns:
            return self.clock(t)
        if date := cells[self.columns["date"].position].strip():
            self.day_s = self._parse_time(date, cells)
        return self.day_s + t

    def _scale_time(self, t: float) -> float:
        """A time that may be in ms, µs or ns; raises ValueError for one that is none."""
        if abs(t) < MAX_TIME_S:
            return t
        unit = next((unit for unit in (1e-3, 1e-6, 1e-9) if abs(t * unit) < MAX_TIME_S), None)
        if unit is None:
            raise ValueError(t)
        self.unit_s = min(self.unit_s, unit)
        return t * unit

    def _parse_time(self, text: str, cells: list[str]) -> float:
        """Seconds of a time of day, a date, or both, `20.11.2026 10:00:00` or ISO 8601; raises ValueError."""
        if day := CLOCK_PATTERN.fullmatch(text):
            self.of_day = "date" not in self.columns
            return self._date_time_of_day(_second_of_day(day), cells)
        if not (match := DATE_PATTERN.fullmatch(text)):
            return sites.utc_s(text.removesuffix("UTC").rstrip())
        day_of, sign, month, year, clock = match.groups(default="0:00")
        if not (time := CLOCK_PATTERN.fullmatch(clock)):
            raise ValueError(text)
        if sign == "/" and self._is_month_first(int(day_of), int(month), text):
            day_of, month = month, day_of
        return sites.utc_s(f"{year}-{int(month):02}-{int(day_of):02}") + _second_of_day(time)

    def _is_month_first(self, first: int, second: int, text: str) -> bool:
        """Whether the first number of a date with slashes is the month: where no date tells, it is the day."""
        unit = self.columns["t_s"].unit
        if unit in ("dmy", "mdy"):
            return unit == "mdy"
        evidence = "day" if first > 12 else "month" if second > 12 else ""
        self.slashed_dates.setdefault(evidence, text)
        if evidence == "month" and next(iter(self.slashed_dates)) != "month":
            name = self.columns["t_s"].name
            must = f"must have day and month in the order of {next(iter(self.slashed_dates.values()))!r}"
            self._add_fault(
                "t_s", must, repr(text[:60]), f"the order is stated by --column t_mdy={name} or t_dmy={name}"
            )
        return "month" in self.slashed_dates

    def _parse_number(self, cells: list[str], name: str) -> float:
        column = self.columns.get(name)
        text = cells[column.position].strip() if column else ""
        if self.has_joint_position and name in EARTH_COLUMNS:
            text = text.partition(",")[2 * (name == "longitude_deg")]
        if not column or not text or text.lower() in MISSING_TEXTS:
            return math.nan
        try:
            value = float(self._with_decimal_point(text))
        except ValueError:
            value = math.inf
        if not abs(value) <= LARGEST_NUMBER:
            self._add_fault(name, "must be a number", repr(text[:60]))
            return math.nan
        return value * column.factor

    def _with_decimal_point(self, text: str) -> str:
        """A number with a decimal point."""
        if not self.sheet.decimal_comma or text.count(",") != 1 or "." in text:
            return text
        if THOUSANDS_PATTERN.fullmatch(text):
            self.doubtful = self.doubtful or text
        else:
            self.has_decimal_comma = True
        return text.replace(",", ".")

    def _add_fault(self, ours: str, must: str, got: str, cure: str = "") -> None:
        column = self.columns[ours]
        cure = cure or f"if this is not {ours}, name the column: --column {ours}=THEIRS"
        self.faults.add(self.line, f"{column.position + 1}: {column.name}:", must, got, cure)


def _second_of_day(match: re.Match) -> float:
    """A time matched by CLOCK_PATTERN, s after midnight; raises ValueError for an impossible one."""
    hours, minutes, seconds, fraction = match.groups(default="0")
    if int(hours) > 23 or int(minutes) > 59 or int(seconds) > 60:
        raise ValueError(match[0])
    return 3600 * int(hours) + 60 * int(minutes) + float(f"{int(seconds)}.{fraction}")
