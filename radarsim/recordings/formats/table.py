"""Positions or plots from a table, row by row, in our quantities and units.

Times are seconds from 1970 (or thousandths and less of them, seen by their size), times of day (unwrapped after
midnight, or of the day in a column `date`), dates as `20.11.2026 10:00:00,01` or ISO 8601, with or without a zone
(default UTC). The time is that of the measurement, if the file has several. Assumptions are in `notes`."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping

from radarsim.errors import ConfigError
from radarsim.language.translate import term, tr
from radarsim.recordings.formats import columns, records
from radarsim.recordings.formats.columns import EARTH_COLUMNS, Header
from radarsim.recordings.formats.sheet import Sheet
from radarsim.recordings.row_faults import Faults

LARGEST_NUMBER = 1e15
RowReader = Callable[[list[str]], tuple[float, ...]]  # a row of numbers from the cells of a line
MAX_SPEED_MPS, UNKNOWN_COURSE_DEG = 102.2 * columns.KNOT_MPS, 360.0  # of AIS: what is not below them means missing
MISSING_TEXTS = ("nan", "null", "none", "na", "n/a", "#n/a")
THOUSANDS_PATTERN = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")  # a number that may be a thousand or a decimal
MIDNIGHT_S = 3600.0  # a falling time of day has passed midnight if both are as near it; else a file is sorted by track
STILL_MPS = 1.0  # below it a position may stay the same
MAX_CELL_VALUES = 10_000  # different cells in a column that may name aircraft
MAX_ALTITUDE_M = 20_000.0  # of an aircraft; higher altitudes are feet
MAX_TIME_S = 1e11  # greater times are thousandths of seconds, or thousandths of these
CLOCK_PATTERN = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,:](\d+))?)?")
DATE_PATTERN = re.compile(r"(\d{1,2})([./])(\d{1,2})\2(\d{4})(?:[ T]+(\S+))?")
TIME_FORMATS = "a time of day, ISO 8601 or DD.MM.YYYY and a time"


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
        self.kind = records.POSITIONS if self.header.reads_positions else records.PLOTS
        self.clock = records.UnrolledClock(records.DAY_S, near_s=MIDNIGHT_S)
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

    def batches(self) -> Iterator[records.Batch]:
        """The rows in batches; raises ConfigError with all faults, each with its line and column."""
        names = records.POSITION_COLUMNS if self.kind == records.POSITIONS else records.PLOT_COLUMNS
        row_of: RowReader = self._position if self.kind == records.POSITIONS else self._plot
        builder = records.BatchBuilder(self.kind, names, tuple(self.text_indices))
        try:
            for line, cells in self.sheet.rows:
                self.line = line
                self._add_row(cells, builder, row_of)
                if len(builder) >= records.BATCH_ROWS:
                    yield builder.take_batch()
        except ConfigError as error:
            raise ConfigError(*self.faults.lines(), *error.lines) from error
        if self.faults:
            raise ConfigError(*self.faults.lines())
        if len(builder):
            yield builder.take_batch()

    def _add_row(self, cells: list[str], builder: records.BatchBuilder, row_of: RowReader) -> None:
        self.records += 1
        if len(cells) != self.width:
            self.faults.add(self.line, "", f"must have {self.width} cells as the header", len(cells))
            return
        row = row_of(cells)
        if self.faults:  # the rest is only read for further ones
            return
        if any(math.isnan(row[i]) for i in ((0, 1, 2) if self.kind == records.POSITIONS else (0, 1))):
            self.skipped[records.NO_TIME_OR_POSITION] += 1
            return
        for index, values in self.cell_values.items():
            if len(values) < MAX_CELL_VALUES:
                values.add(cells[index].strip())
        name = cells[self.columns["track"].position].strip() if "track" in self.columns else "1"
        if self.kind == records.POSITIONS:
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
            return self._date_time_of_day(t, cells) if 0 <= t < records.DAY_S else self._scale_time(t)
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
            return records.utc_s(text.removesuffix("UTC").rstrip())
        day_of, sign, month, year, clock = match.groups(default="0:00")
        if not (time := CLOCK_PATTERN.fullmatch(clock)):
            raise ValueError(text)
        if sign == "/" and self._is_month_first(int(day_of), int(month), text):
            day_of, month = month, day_of
        return records.utc_s(f"{year}-{int(month):02}-{int(day_of):02}") + _second_of_day(time)

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
