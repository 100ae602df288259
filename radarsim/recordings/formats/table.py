"""Positions or plots from a table, row by row, in our quantities and units.

Times are seconds from 1970 (or thousandths and less of them, seen by their size), times of day (unwrapped after
midnight, or of the day in a column `date`), dates as `20.11.2026 10:00:00,01`, `2026/11/20` or ISO 8601, with or
without a zone (default UTC), or, where the user says so, day numbers. The time is that of the measurement, if the file
has several. Assumptions are in `notes`."""

import math
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.translate import term, tr
from radarsim.recordings.fill_values import FILL_NUMBERS, fill_notes
from radarsim.recordings.formats import cell_times, columns, records, table_checks
from radarsim.recordings.formats.cell_numbers import (
    LARGEST_NUMBER,
    CellNumbers,
    has_decimal_commas,
    hemisphere_sign,
    is_missing,
    spoiled_number_cure,
    ungrouped,
    ungrouped_cells,
)
from radarsim.recordings.formats.cell_times import TIME_FORMATS
from radarsim.recordings.formats.column_suggestions import cell_number
from radarsim.recordings.formats.columns import EARTH_COLUMNS, QUANTITIES, Header
from radarsim.recordings.formats.sheet import Sheet
from radarsim.recordings.formats.units import (
    CLOCK_DIGITS,
    DAYS,
    DAYS_1904,
    DEGREES,
    EARTH_DEGREES,
    KNOT_MPS,
    MINUTE_CLOCK,
    TIME_UNITS,
    TURNS,
    degrees_of_minutes,
    turn_of,
)
from radarsim.recordings.row_faults import Faults
from radarsim.recordings.time_spans import HOUR_S

LARGEST_DEGREES, LARGEST_DDMM, MINUTES_OF_DEGREE = 360.0, 36_000.0, 60  # of coordinates as degrees and minutes, 5236.5
COMMENT_MARKS = frozenset("#%;!/")  # with which a line of comment begins
MAX_FOOTER_ROWS = 3  # below the table, as sums
BLANKS = " \t\ufeff"  # about a name, with the mark at the beginning of a file that another was added to
RowReader = Callable[[list[str]], tuple[float, ...]]  # a row of numbers from the cells of a line
MAX_SPEED_MPS, UNKNOWN_COURSE_DEG = 102.2 * KNOT_MPS, 360.0  # of AIS: what is not below them means missing
UNKNOWN_POSITION = (91.0, 181.0)  # of AIS
UNKNOWN_DEGREES = tuple(number for number in FILL_NUMBERS if number > LARGEST_DEGREES)
MIDNIGHT_S = 3600.0  # a falling time of day has passed midnight if both are as near it; else a file is sorted by track
STILL_MPS = 1.0  # below it a position may stay the same
MAX_CELL_VALUES = 10_000  # different cells in a column that may name aircraft
MAX_LIKELY_TURNS = 3  # units of bearings that are named
NOISE_TURNS = 1 + 10 / 360  # up to which a bearing beyond north is noise
MAX_ALTITUDE_M = 20_000.0  # of an aircraft; higher altitudes are feet
GROUPED_CELL = re.compile(r"[-+]?[1-9]\d{0,2}\.\d{3}")  # whose point may separate thousands
METRES_OF_GROUPS = 100.0  # of a unit of ranges that have rarely three decimals
LOSSY_PATTERN = re.compile(r"[-+]?\d(?:[.,]\d{0,8})?[eE]\+?(?:0?[4-9]|1\d)")
SHORT_YEAR_PATTERN = re.compile(r"\d{1,2}([./-])\d{1,2}\1\d{2}(?!\d)")
MAX_LISTED = 5  # sensors
NO_ROW_REASON = term("lines at the end that are no rows, or cut off")
NAME_CURE = "if this is not {0}, name the column: --column {0}=THEIRS"
LEAP_SECOND_REASON = term("rows in a leap second (23:59:60), which seconds from 1970 do not count")


class Table:
    """The reader of a sheet of positions or of plots; `assigned` holds the columns that --column names."""

    def __init__(self, sheet: Sheet, assigned: Mapping[str, str] | None = None):
        self.path, self.sheet, self.skipped = sheet.path, sheet, sheet.skipped
        self.line = 0
        self.footer_rows: list[tuple[int, str]] = []  # lines and cells of words in place of times, if the last ones
        self.cut_row: tuple[int, ...] = ()  # line and number of cells of the last row, if it has too few
        self.records, self.highest_m, self.barometric_count, self.silent_count = 0, 0.0, 0, 0
        self.of_day = False  # known after the first rows
        self.numbers = CellNumbers(sheet.decimal_comma)
        self.faults = Faults(self.path)
        self.width = len(sheet.header)
        try:
            self.header = Header(self.path, sheet.header, assigned or {}, sheet.sample)
        except ConfigError as error:
            if sheet.encoding == "UTF-8" or "".join(sheet.header).isascii():
                raise
            encoding = f"the text is read as {sheet.encoding}; for another: --encoding NAME"
            raise ConfigError(*error.lines[:-1], f"{error.lines[-1]}; {encoding}") from error
        self.columns, self.numbers.o_sign = self.header.columns, self.header.o_sign
        self._remove_grouping_points()
        self.kind = records.POSITIONS if self.header.reads_positions else records.PLOTS
        self.time_index = self.columns["t_s"].position
        self.time_name = sheet.header[self.time_index]
        self.clock = records.UnrolledClock(records.DAY_S, near_s=MIDNIGHT_S)
        self.minute_clock = records.UnrolledClock(HOUR_S)
        self.day_s = math.nan  # of the date read last
        self.unit_s = 1.0  # of times that are too great for seconds
        self.is_leap_second = False  # of the row
        self.has_clock_times = False  # times of day or dates were read
        self.is_checked = False  # whether the first batch has been looked at
        self.long_step: tuple[float, str] | None = None  # from row to row, if longer than a scan, and the likely unit
        self.unknown_bearing_count = 0
        self.largest_bearing = 0.0  # of those beyond a turn, in the unit of its column
        self.flight_level_column = ""  # whose numbers were taken as hundreds of feet
        self.slashed_dates: dict[str, str] = {}  # the first date of 1/2/2024 by what it shows: the order, or nothing
        used_indices = {column.position for column in self.columns.values()}
        sensor = self.header.sensor_index
        self.sensor_index = -1 if sensor is None or self.kind == records.POSITIONS or sensor in used_indices else sensor
        self.sensors: Counter[str] = Counter()
        self.last_positions: dict[str, tuple[float, ...]] = {}  # the last position of each track
        self.has_joint_position = (
            len({self.columns[ours].position for ours in EARTH_COLUMNS if ours in self.columns}) == 1
        )
        self.text_indices = {kind: index for kind, index in self.header.identities.items() if kind != "address"}
        candidates = [] if "track" in self.columns else [i for i in range(self.width) if i not in used_indices]
        self.cell_values: dict[int, set[str]] = {i: set() for i in candidates}  # of columns that may name the aircraft

    def _remove_grouping_points(self) -> None:
        """Take the points out of numbers as 30.004 if other numbers of the table have decimal commas."""
        sheet = self.sheet
        places = {column.position for ours, column in self.columns.items() if ours not in ("date", "track")}
        cells = [row[i] for row in sheet.sample for i in places if i < len(row)]
        if sheet.decimal_comma and has_decimal_commas(cells) and any(ungrouped(cell) != cell for cell in cells):
            sheet.rows = ((line, ungrouped_cells(row, places)) for line, row in sheet.rows)
            sheet.sample = [ungrouped_cells(row, places) for row in sheet.sample]

    def notes(self, radars: Iterable[str] = ()) -> list[str]:
        """Notes on assumed units and times, and on signs against them."""
        lines = [*self.clock.notes(), *self.header.notes(), *self.sheet.notes, *self._digit_notes()]
        if (encoding := self.sheet.encoding) != "UTF-8":
            lines.append(
                tr("the text is read as {name}, as it is not UTF-8; for another: --encoding NAME", name=encoding)
            )
        if (doubtful := self.numbers.doubtful) and not self.numbers.has_decimal_comma:
            value = float(doubtful.replace(",", "."))
            lines.append(tr("commas are decimal: {text} is read as {value:g}", text=doubtful, value=value))
        if self.unit_s < 1:
            lines.append(tr("times are so large that they are read in units of {unit:g} s", unit=self.unit_s))
        if "" in self.slashed_dates and len(self.slashed_dates) == 1:
            option = f"--column t_mdy={self.columns['t_s'].name}"
            message = term("{date} is read as day and month; if the month stands first: {cure}")
            lines.append(tr(message, date=self.slashed_dates[""], cure=option))
        lines += fill_notes({"bearing_rad": self.unknown_bearing_count}, self.records)
        if self.barometric_count:
            lines.append(
                tr("barometric altitudes, where the geometric one is missing: {count}", count=self.barometric_count)
            )
        if self.silent_count and "course_deg" in self.columns:
            message = term("reports without speed or course: {count} of {all}")
            lines.append(tr(message, count=self.silent_count, all=self.records))
        if self.long_step is not None:
            step, unit = self.long_step
            option = f"--column t_{unit}={shlex.quote(self.columns['t_s'].name)}"
            message = term("the times are read as s, {step:g} s from row to row; if they are {unit}: {cure}")
            lines.append(tr(message, step=step, unit="µs" if unit == "us" else unit, cure=option))
        if self.flight_level_column:
            name = self.flight_level_column
            cure = f"--column altitude_ft={shlex.quote(name)}"
            message = term("{name} is read in hundreds of feet: in feet the targets would lie below the horizon; if "
                           "they do: {cure}")  # fmt: skip
            lines.append(tr(message, name=name, cure=cure))
        if self.highest_m > MAX_ALTITUDE_M and not self.header.aviation:
            name = (self.columns.get("altitude_m") or self.columns["barometric_m"]).name
            message = term("altitudes up to {highest:.0f} m: if {name} is in feet, name it {name}_ft")
            lines.append(tr(message, highest=self.highest_m, name=name))
        bearing = self.columns.get("bearing_rad")
        is_in_degrees = bearing is not None and bearing.unit in DEGREES and bearing.unit != "rad"
        if bearing is not None and is_in_degrees and 360 * NOISE_TURNS < self.largest_bearing <= TURNS["gon"]:
            option = f"--column bearing_gon={shlex.quote(bearing.name)}"
            message = term("bearings up to {largest:.1f}° are read as beyond a turn; if they are in gon: {option}")
            lines.append(tr(message, largest=self.largest_bearing, option=option))
        if sensors_note := self._sensors_note():
            lines += sensors_note
        elif likely := self._likely_track_columns():
            lines.append(tr("no column identifies the tracks, all rows are taken as one; if a column does, "
                            "--column track=THEIRS; it may be: {likely}", likely=likely))  # fmt: skip
        return lines

    def _digit_notes(self) -> list[str]:
        """Notes on numbers that have lost digits, or whose points may separate thousands."""
        lines = []
        if cell := self.lost_digits("range_m"):
            message = term("{name} has lost digits, as {cell} shows: export the column as numbers")
            lines.append(tr(message, name=self.columns["range_m"].name, cell=cell))
        column = self.columns.get("range_m")
        cells = [row[column.position].strip() for row in self.sheet.sample if column and column.position < len(row)]
        is_grouped = self.sheet.decimal_comma and len(cells) > 1 and all(map(GROUPED_CELL.fullmatch, cells))
        if column and is_grouped and column.factor < METRES_OF_GROUPS:
            message = term("points are decimal: {cell} is read as {value:g}; if they separate thousands, take them out")
            lines.append(tr(message, cell=cells[0], value=float(cells[0])))
        return lines

    def _sensors_note(self) -> list[str]:
        """A note on a column of sensors that is not used, if it has several values."""
        if len(self.sensors) < 2:
            return []
        name, first = self.header.names[self.sensor_index], next(iter(self.sensors))
        listed = ", ".join(f"{sensor or '-'} ({count})" for sensor, count in self.sensors.most_common(MAX_LISTED))
        if "track" in self.columns:
            message = term("plots of several sensors, by {name} (rows): {listed}; their tracks of one name are taken "
                           "as one: import each sensor from a file of its own")  # fmt: skip
            return [tr(message, name=name, listed=listed)]
        option = f"--column track={shlex.quote(name)}"
        message = term("plots of several sensors, by {name} (rows): {listed}; they are taken as one track: {option} "
                       "makes one of each, with --track {first} of that alone")  # fmt: skip
        return [tr(message, name=name, listed=listed, option=option, first=shlex.quote(first))]

    def _likely_track_columns(self) -> str:
        """The columns that may identify the aircraft, if none is known: each value is in two rows on average."""
        likely = [(i, len(cells)) for i, cells in self.cell_values.items() if 1 < len(cells) <= self.records / 2]
        names = self.header.names
        return ", ".join(tr("{name} ({count} different)", name=names[i], count=count) for i, count in likely)

    @property
    def is_one_track(self) -> bool:
        """Whether rows without the name of their track are of one track, as no column may tell several apart."""
        return "track" in self.columns or self.sheet.is_one_track

    def track_question(self, late_count: int) -> str | None:
        """The question which column identifies the aircraft, if one may, and rows are out of order in time."""
        if not late_count or self.is_one_track or not (candidates := self._likely_track_columns()):
            return None
        rows = "1 row is" if late_count == 1 else f"{late_count} rows are"
        return (
            f"{self.path}: track: no column identifies the tracks, and {rows} not later than the one before; "
            f"name the column, --column track=THEIRS; it may be: {candidates}"
        )

    def lost_digits(self, ours: str) -> str:
        """A cell of a column whose numbers have lost digits, as those of a spreadsheet do that are shown as 1.7E+09; ''
        where they have not."""
        column = self.columns.get(ours)
        cells = [row[column.position].strip() for row in self.sheet.sample if column and column.position < len(row)]
        cells = [cell for cell in cells if cell]
        is_lossy = bool(cells) and all(map(LOSSY_PATTERN.fullmatch, cells))
        return cells[0] if is_lossy else ""

    def batches(self) -> Iterator[records.Batch]:
        """The rows in batches; raises ConfigError with all faults, each with its line and column."""
        names = records.POSITION_COLUMNS if self.kind == records.POSITIONS else records.PLOT_COLUMNS
        row_of: RowReader = self._position if self.kind == records.POSITIONS else self._plot
        builder = records.BatchBuilder(self.kind, names, tuple(self.text_indices))
        try:
            for line, cells in self.sheet.rows:
                self.line = line
                self._add_row(cells, builder, row_of)
                if len(builder) >= records.BATCH_ROWS and not self.faults:
                    yield self._checked_batch(builder.take_batch())
        except ConfigError as error:
            raise ConfigError(*self.faults.lines(), *error.lines) from error
        if self.cut_row and not self.faults and (self.is_checked or len(builder)):
            self.skipped[NO_ROW_REASON] += 1
        elif self.cut_row:
            self._add_width_fault(*self.cut_row)
        if not self.is_checked and not len(builder):
            self._add_footer_faults()
        self.skipped[records.NO_TIME_OR_POSITION] -= len(self.footer_rows)
        self.skipped[NO_ROW_REASON] += len(self.footer_rows)
        if self.faults:
            raise ConfigError(*self.faults.lines())
        if len(builder):
            yield self._checked_batch(builder.take_batch())

    def _checked_batch(self, batch: records.Batch) -> records.Batch:
        """A batch; the first one shows by its numbers whether times are day numbers, and altitudes flight levels."""
        if not self.is_checked:
            self.is_checked = True
            time = self.columns["t_s"]
            if time.unit not in (DAYS, DAYS_1904, CLOCK_DIGITS) and not self.has_clock_times:
                first_cell = next((row[time.position] for row in self.sheet.sample), f"{batch.columns['t_s'][0]:.15g}")
                table_checks.refuse_clock_digits(batch, self.path, time.name, first_cell)
                table_checks.refuse_day_numbers(batch, self.path, time.name, "date" in self.columns, first_cell)
                self.long_step = table_checks.long_step(batch)
            if "bearing_rad" in self.columns and "bearing_rad" not in self.header.user_units:
                table_checks.refuse_wrapped_bearings(batch, self.path, self.columns["bearing_rad"])
            if factor := table_checks.flight_level_factor(batch, self.columns):
                (self.flight_level_column,) = table_checks.assumed_altitude(self.columns)
                ours = "altitude_m" if "altitude_m" in self.columns else "barometric_m"
                self.columns[ours] = self.columns[ours]._replace(
                    factor=self.columns[ours].factor * factor, unit="FL", is_assumed=False
                )
                batch.columns["altitude_m"] *= factor
        return batch

    def _add_row(self, cells: list[str], builder: records.BatchBuilder, row_of: RowReader) -> None:
        self.records += 1
        if self.cut_row:  # it was not the last one
            self._add_width_fault(*self.cut_row)
            self.cut_row = ()
        if len(cells) != self.width or cells[0][:1] in COMMENT_MARKS:
            self._check_other_line(cells)
            return
        time_cell = cells[self.time_index]
        if time_cell.endswith(self.time_name) and time_cell.strip(BLANKS) == self.time_name.strip(BLANKS):
            self._check_second_header(cells)
            return
        row = row_of(cells)
        if self.footer_rows and not math.isnan(row[0]):  # they were not the last ones
            self._add_footer_faults()
        if self.faults:  # the rest is only read for further ones
            return
        if self.is_leap_second:
            self.skipped[LEAP_SECOND_REASON] += 1
            return
        if math.isnan(sum(row[: 3 if self.kind == records.POSITIONS else 2])):  # a time and a place
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
        if self.sensor_index >= 0 and len(self.sensors) < MAX_CELL_VALUES:
            self.sensors[cells[self.sensor_index].strip()] += 1
        address_index = self.header.identities.get("address")
        address = "" if address_index is None else cells[address_index].strip().lower()
        texts = tuple(cells[index].strip() for index in self.text_indices.values()) if self.text_indices else ()
        builder.add(name, address, row, texts)

    def _check_other_line(self, cells: list[str]) -> None:
        """Count a comment; any other line that is no row of the table is a fault, unless it is the last."""
        if cells[0].lstrip()[:1] in COMMENT_MARKS:
            self.skipped[term("lines of comment")] += 1
        elif self.time_name.strip(BLANKS) in (cell.strip(BLANKS) for cell in cells):
            self._add_other_header_fault(cells)
        elif len(cells) < self.width:
            self.cut_row = (self.line, len(cells))
        else:
            self._add_width_fault(self.line, len(cells))

    def _add_width_fault(self, line: int, width: int) -> None:
        self.faults.add(line, "", f"must have {self.width} cells as the header", width)

    def _check_second_header(self, cells: list[str]) -> None:
        """Count a row that repeats the header; one with other columns is a fault."""
        names = zip(cells, self.sheet.header, strict=True)
        if other_names := [name for name, own in names if name.strip(BLANKS) != own.strip(BLANKS)]:
            self._add_other_header_fault(other_names)
        else:
            self.skipped[term("headers repeated within the table")] += 1

    def _add_other_header_fault(self, names: list[str]) -> None:
        must = "must be a row of the table, not the header of another: import that from a file of its own"
        self.faults.add(self.line, "", must, ", ".join(name.strip() for name in names))

    def _position(self, cells: list[str]) -> tuple[float, ...]:
        """POSITION_COLUMNS of a row."""
        speed, course = self._parse_number(cells, "speed_mps"), self._parse_number(cells, "course_deg")
        if self.header.maritime and not (0 <= speed <= MAX_SPEED_MPS and 0 <= course < UNKNOWN_COURSE_DEG):
            speed = math.nan
            self.silent_count += 1
        course = math.radians(course)
        t, up = self._time(cells), self._parse_number(cells, "up_mps")
        lat, lon = self._parse_number(cells, "latitude_deg"), self._parse_number(cells, "longitude_deg")
        if (lat, lon) == UNKNOWN_POSITION or abs(lat) in UNKNOWN_DEGREES or abs(lon) in UNKNOWN_DEGREES:
            lat = lon = math.nan
        lat, lon = self._coordinate("latitude_deg", lat, 90, cells), self._coordinate("longitude_deg", lon, 360, cells)
        return t, lat, lon, self._altitude(cells), speed * math.sin(course), speed * math.cos(course), up

    def _coordinate(self, name: str, value: float, limit: int, cells: list[str]) -> float:
        """A coordinate, degrees, with the sign of its hemisphere, which may stand in a column of its own."""
        column = self.columns[name]
        if column.unit == "ddmm":
            value = float(degrees_of_minutes(np.array(value)))
        if abs(value) > limit:
            must = f"must be from -{limit} to {limit} degrees"
            self._add_fault(name, must, f"{value:g}", self._coordinate_cure(name, value, limit))
        if name in self.header.hemispheres:
            sign = hemisphere_sign(cells[self.header.hemispheres[name]], name, self.numbers.o_sign)
            return value if math.isnan(sign) else sign * abs(value)
        return value

    def _coordinate_cure(self, name: str, value: float, limit: int) -> str:
        """The units in which a coordinate that is too large may be; '' where there is none."""
        size, theirs = abs(value), shlex.quote(self.columns[name].name)
        likely = [unit for unit in ("e6", "e7") if LARGEST_DDMM < size <= limit / EARTH_DEGREES[unit]]
        likely += ["ddmm"] if LARGEST_DEGREES < size <= 100 * limit and size % 100 < MINUTES_OF_DEGREE else []
        stem = name.removesuffix("_deg")
        grid = "; metres of a map grid are not read" if size > LARGEST_DDMM else ""
        return " or ".join(f"--column {stem}_{unit}={theirs}" for unit in likely) + grid

    def _plot(self, cells: list[str]) -> tuple[float, ...]:
        """PLOT_COLUMNS of a row."""
        t, r = self._time(cells), self._parse_number(cells, "range_m")
        velocity, span = self._parse_number(cells, "velocity_mps"), self._parse_number(cells, "span_mps")
        return t, r, self._bearing(cells), velocity, span, self._altitude(cells)

    def _bearing(self, cells: list[str]) -> float:
        """The bearing, rad; beyond a full turn by noise it is turned back."""
        bearing, column = self._parse_number(cells, "bearing_rad"), self.columns.get("bearing_rad")
        if column is not None and abs(bearing) > 2 * math.pi:
            number = bearing / column.factor
            if round(abs(number), 6) in UNKNOWN_DEGREES and round(abs(number), 6) > turn_of(column.unit):
                self.unknown_bearing_count += 1
                return math.nan
            most = 4 * math.pi if not column.unit.startswith("acp") else 2 * math.pi  # counts have no noise
            if not -2 * math.pi <= bearing <= most:
                must = f"must be within a turn, in {column.unit}"
                cure = f"if it counts {self._likely_turns(column, number)}" if number > 0 else ""
                self._add_fault("bearing_rad", must, repr(cells[column.position].strip()[:60]), cure)
            self.largest_bearing = max(self.largest_bearing, number)
            return bearing % (2 * math.pi)
        return bearing

    def _likely_turns(self, column: columns.Column, number: float) -> str:
        """The units, at most MAX_LIKELY_TURNS, in which a number and those of the sample are within a turn."""
        sample = [cell_number(row[column.position]) for row in self.sheet.sample if column.position < len(row)]
        largest = max([number, *(value for value in sample if not math.isnan(value))])
        turns = {"deg": 360, **TURNS} if column.unit == "rad" else TURNS
        name = shlex.quote(column.name)
        likely = [
            f"{turn} a turn: --column bearing_{unit}={name}"
            for unit, turn in sorted(turns.items(), key=lambda item: item[1])
            if largest <= turn and column.unit != unit
        ]
        return ", ".join(likely[:MAX_LIKELY_TURNS])

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
        self.is_leap_second = False
        if not text:
            return math.nan
        try:
            try:
                t = self.numbers.number(text) * column.factor
            except ValueError:
                if is_missing(text):
                    return math.nan
                value = self.numbers.unit_cell(text, TIME_UNITS)
                if value is None:
                    return self._parse_time(text, cells)
                t = value
            if math.isnan(t):
                return t
            if column.unit == CLOCK_DIGITS:
                return self._at_date(cell_times.clock_digits_s(t), cells)
            if (date := cell_times.digits_date_s(text)) is not None:
                return date
            if column.unit in (DAYS, DAYS_1904):
                is_time_of_day, shift = 0 <= t < 1, cell_times.DAYS_TO_1904 * (column.unit == DAYS_1904)
                return self._at_date(t * records.DAY_S, cells) if is_time_of_day else cell_times.day_number_s(t + shift)
            return self._at_date(t, cells) if 0 <= t < records.DAY_S else self._scale_time(t)
        except ValueError:
            if text.replace(" ", "").isalpha() and len(self.footer_rows) < MAX_FOOTER_ROWS:
                self.footer_rows.append((self.line, text))
            else:
                self._add_time_fault(self.line, text)
            return math.nan

    def _add_time_fault(self, line: int, text: str) -> None:
        column = self.columns["t_s"]
        cure = self._time_cure(text)
        self.faults.add(line, f"{column.position + 1}: {column.name}:", f"must be a time in s, {TIME_FORMATS}",
                        repr(text[:60]), cure or NAME_CURE.format("t_s"), bool(cure))  # fmt: skip

    def _add_footer_faults(self) -> None:
        """Count words in place of times as faults, since rows follow."""
        for line, text in self.footer_rows:
            self._add_time_fault(line, text)
        self.footer_rows = []

    def _time_cure(self, text: str) -> str:
        """What helps with the cell of a time that cannot be read; '' where that is not known."""
        if SHORT_YEAR_PATTERN.match(text):
            return "years have four digits"
        zone = re.search(r"[^\W\d_]+(?:/\w+)?$", text)
        if zone and ":" in text and zone[0].lower() not in ("am", "pm"):
            return f"a zone is stated by its offset, as +03:00 in place of {zone[0]}"
        if cell_times.minute_clock_s(text) is not None:
            return f"minutes and seconds are stated by --column t_mmss={shlex.quote(self.columns['t_s'].name)}"
        return ""

    def _at_date(self, t: float, cells: list[str]) -> float:
        """A time of day, s, at the date beside it or before it; unrolled where the table has no date."""
        if "date" not in self.columns:
            return self.clock(t)
        if date := cells[self.columns["date"].position].strip():
            try:
                self.day_s = self._parse_date(date, cells)
            except ValueError:
                must = "must be a date, as DD.MM.YYYY, YYYY/MM/DD or ISO 8601"
                self._add_fault("date", must, repr(date[:60]))
                self.day_s = math.nan
        return self.day_s + t

    def _parse_date(self, text: str, cells: list[str]) -> float:
        """Seconds from 1970 of a date, which a spreadsheet may have as a day number; raises ValueError."""
        try:
            days = self.numbers.number(text)
        except ValueError:
            return self._parse_time(text, cells)
        if cell_times.day_numbers_of(days) in ("", cell_times.FRACTIONS_OF_DAY):
            return self._parse_time(text, cells)  # 20261120
        return cell_times.day_number_s(math.floor(days))

    def _scale_time(self, t: float) -> float:
        """A time that may be in ms, µs or ns; one that is none of 1990 to 2100 is a fault."""
        scaled = cell_times.scaled_time(t)
        if scaled is None:
            name = shlex.quote(self.columns["t_s"].name)
            cure = f"its unit is stated by --column t_ms={name}, t_us={name} or t_ns={name}"
            must = "must be a time in s, or in ms, µs or ns from 1970"
            self._add_fault("t_s", must, f"{t:.15g}", cure)
            return math.nan
        self.unit_s = min(self.unit_s, scaled[1])
        return scaled[0]

    def _parse_time(self, text: str, cells: list[str]) -> float:
        """Seconds of a time of day, a date, or both, which a zone may follow; raises ValueError."""
        try:
            return self._parse_plain_time(text, cells)
        except ValueError:
            zoned = cell_times.split_zone(text)
            if zoned is None:
                raise
        return self._parse_plain_time(zoned[0], cells) - zoned[1]

    def _parse_plain_time(self, text: str, cells: list[str]) -> float:
        """Seconds of a time of day, a date, or both, `20.11.2026 10:00:00` or ISO 8601; raises ValueError."""
        self.has_clock_times = True
        if cell_times.LEAP_SECOND_PATTERN.search(text):
            self.is_leap_second = True
            return math.nan
        is_in_minutes = self.columns["t_s"].unit == MINUTE_CLOCK or cell_times.TENTHS_PATTERN.fullmatch(text)
        if is_in_minutes and (time := cell_times.minute_clock_s(text)) is not None:
            return self.minute_clock(time)
        if (time := cell_times.clock_s(text)) is not None:
            self.of_day = "date" not in self.columns
            return self._at_date(time, cells)
        if match := cell_times.YEAR_FIRST_PATTERN.fullmatch(text):
            year, _, month, day_of, clock = match.groups(default="0:00")
            return cell_times.date_s(year, month, day_of, clock)
        if (named_date := cell_times.named_date_s(text)) is not None:
            return named_date
        if not (match := cell_times.DATE_PATTERN.fullmatch(text)):
            return records.utc_s(text.removesuffix("UTC").rstrip())
        day_of, sign, month, year, clock = match.groups(default="0:00")
        if sign != "." and self._is_month_first(int(day_of), int(month), text):
            day_of, month = month, day_of
        return cell_times.date_s(year, month, day_of, clock)

    def _is_month_first(self, first: int, second: int, text: str) -> bool:
        """Whether the first number of a date with slashes is the month: where no date tells, it is the day, unless a
        time with AM or PM makes the month as likely."""
        unit = self.columns["t_s"].unit
        if unit in ("dmy", "mdy"):
            return unit == "mdy"
        evidence = "day" if first > 12 else "month" if second > 12 else ""
        self.slashed_dates.setdefault(evidence, text)
        name = self.columns["t_s"].name
        cure = f"the order is stated by --column t_mdy={shlex.quote(name)} or t_dmy={shlex.quote(name)}"
        if next(iter(self.slashed_dates)) == "" and cell_times.MERIDIEM_PATTERN.search(text):
            self._add_fault("t_s", "must show whether the day or the month stands first", repr(text[:60]), cure)
        elif evidence == "month" and next(iter(self.slashed_dates)) != "month":
            must = f"must have day and month in the order of {next(iter(self.slashed_dates.values()))!r}"
            self._add_fault("t_s", must, repr(text[:60]), cure)
        return "month" in self.slashed_dates

    def _parse_number(self, cells: list[str], name: str) -> float:
        column = self.columns.get(name)
        if column is None:
            return math.nan
        text = cells[column.position].strip()
        if self.has_joint_position and name in EARTH_COLUMNS:
            text = text.partition(",")[2 * (name == "longitude_deg")]
        if not text:
            return math.nan
        try:
            if abs(value := float(text)) <= LARGEST_NUMBER:
                return value * column.factor
        except ValueError:  # the reader of all other cells says what is wrong
            pass
        try:
            return self.numbers.quantity(text, name, column.factor, QUANTITIES[name].units)
        except ValueError:
            cure = spoiled_number_cure(text) or self._missing_cure(text, column.position)
            self._add_fault(name, "must be a number", repr(text[:60]), cure)
            return math.nan

    def _missing_cure(self, text: str, index: int) -> str:
        """What helps with a word among the numbers of a column; '' of any other text."""
        numbers = [cell_number(row[index]) for row in self.sheet.sample if index < len(row)]
        is_word = not any(letter.isdigit() for letter in text)
        is_rare = sum(map(math.isnan, numbers)) < len(numbers) / 2
        return "if it stands for no value, leave such cells empty" if is_rare and is_word else ""

    def _add_fault(self, ours: str, must: str, got: str, cure: str = "") -> None:
        column, always = self.columns[ours], bool(cure)
        cure = cure or NAME_CURE.format(ours)
        self.faults.add(self.line, f"{column.position + 1}: {column.name}:", must, got, cure, always)
