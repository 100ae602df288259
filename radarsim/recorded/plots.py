"""Read recorded plots from a CSV file, name their tracks, and write tracks and columns as CSV.

A plots file has a header, before which lines beginning with `#` may stand. `t_s` must rise from row to row; for studies
that take several plots at a time it must not fall. An empty cell is a missing value; other columns are ignored.

Positions of plots in the plane, for the plan view, count north and east from the radar, or from whatever stands at the
origin."""

import csv
import itertools
import math
import os
import re
import shlex
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.report.files import Writer
from radarsim.studies.interface import TRUE

if TYPE_CHECKING:
    import _csv

Name = TypeVar("Name", bound=Hashable)


# ---- places ----------------------------------------------------------------------------------------------------------
MAX_FIGURE_ROWS = 2000  # rows of a track that are retained for figures


def plane_positions(columns: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """North, east and range (n, 3) of plots, m, from columns (n,) of a file; None without positions and ranges.

    From x_m (north) and z_m (east) as `radarsim import` writes them; else from range and bearing, with the slant range
    instead of the ground range; else the range alone."""
    if {"x_m", "y_m", "z_m"} <= set(columns):
        x, y, z = (columns[name] for name in ("x_m", "y_m", "z_m"))
        r = columns.get("range_m", np.sqrt(x**2 + y**2 + z**2))
        return np.stack([x, z, r], axis=1)
    if "range_m" not in columns:
        return None
    r = columns["range_m"]
    b = columns.get("bearing_rad", np.full(len(r), np.nan))
    return np.stack([r * np.cos(b), r * np.sin(b), r], axis=1)


@dataclass(kw_only=True)
class ThinnedRows:
    """Rows of a track, spread over its whole time: of more than max_rows, every second block is dropped.

    row_numbers (n,): the number in the track of each retained row."""

    max_rows: int = MAX_FIGURE_ROWS
    block_rows: int = 1
    row_numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    rows_so_far: int = 0
    stride: int = 1

    def select(self, new_rows: int) -> np.ndarray:
        """Whether the retained rows (n,) and new_rows more are retained: (n + new_rows,)."""
        row_numbers = np.concatenate([self.row_numbers, self.rows_so_far + np.arange(new_rows)])
        while (retained := row_numbers // self.block_rows % self.stride == 0).sum() > self.max_rows:
            self.stride *= 2
        self.row_numbers, self.rows_so_far = row_numbers[retained], self.rows_so_far + new_rows
        return retained


@dataclass
class PlotPositions(ThinnedRows):
    """Times (n,) and positions (n, 3) of a track's plots: north, east and range in m."""

    t_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    positions: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def add(self, t_s: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Add plots; those without any position are left out."""
        positions = plane_positions(columns)
        if positions is None:
            return
        has_position = np.isfinite(positions).any(axis=1)
        retained = self.select(int(has_position.sum()))
        self.t_s = np.concatenate([self.t_s, t_s[has_position]])[retained]
        self.positions = np.concatenate([self.positions, positions[has_position]])[retained]


# ---- numbers of tracks -----------------------------------------------------------------------------------------------
# Usual intervals, and time, after which a number belongs to another track.
REUSE_GAP_INTERVALS = 30.0
MIN_REUSE_GAP_S = 60.0
SAME_SCAN_SHARE = 0.5  # of the usual interval: plots of one track that are nearer than that are of one scan
# Share of intervals that are whole scans of a turning antenna, within this part of a scan.
MIN_REGULAR_SHARE = 0.75
SCAN_TOLERANCE = 0.1
MIN_INTERVALS, MAX_INTERVALS = 5, 100  # between the last plots of a track, from which its usual interval follows


@dataclass
class _TrackHistory:
    """The history of a track number.

    Its name, how many tracks it has named, the last two plots (time and position) of the current track, the last
    intervals, their median, and the time within which another plot is of the same scan."""

    name: str
    uses: int = 1
    last_plots: list[tuple[float, np.ndarray]] = field(default_factory=list)
    intervals: np.ndarray = field(default_factory=lambda: np.zeros(0))
    usual_interval_s: float = math.nan
    same_scan_s: float = 0.0

    def select_plots(self, t: np.ndarray, positions: np.ndarray, retained: np.ndarray, names: np.ndarray) -> None:
        """Select the next plots, at times (n,) and positions (n, 3): retained and names are changed in place."""
        intervals = np.diff(t, prepend=self.last_plots[-1][0] if self.last_plots else t[0])
        self._update_intervals(intervals if self.last_plots else intervals[1:])
        # without a usual interval it is NaN, and there is no gap
        gap = max(REUSE_GAP_INTERVALS * self.usual_interval_s, MIN_REUSE_GAP_S)
        is_same_scan = (intervals <= 0) | (intervals < self.same_scan_s)
        is_same_scan[:1] &= bool(self.last_plots)
        if self.uses == 1 and not (intervals > gap).any() and not is_same_scan.any():
            self.last_plots = [*self.last_plots, *zip(t[-2:].tolist(), positions[-2:], strict=True)][-2:]
            return
        i = 0
        while i < len(t):
            last_time = self.last_plots[-1][0] if self.last_plots else -math.inf
            if self.last_plots and t[i] - last_time > gap:
                self.uses, self.last_plots = self.uses + 1, []
            end = i + 1
            if self.last_plots and (t[i] <= last_time or t[i] - last_time < self.same_scan_s):
                retained[i] = False  # the rest of a scan that began in the previous rows
            else:
                while end < len(t) and (t[end] == t[i] or t[end] - t[i] < self.same_scan_s):
                    end += 1
                best = i + self._nearest(t[i:end], positions[i:end])
                retained[i:end] = np.arange(i, end) == best
                names[best] = self.name if self.uses == 1 else f"{self.name} ({self.uses})"
                self.last_plots = [*self.last_plots, (float(t[best]), positions[best])][-2:]
            i = end

    def _update_intervals(self, intervals: np.ndarray) -> None:
        """Update the usual interval of a track, and whether it is that of a turning antenna."""
        self.intervals = intervals = np.concatenate([self.intervals, intervals[intervals > 0]])[-MAX_INTERVALS:]
        if intervals.size < MIN_INTERVALS:
            return
        self.usual_interval_s = float(np.median(intervals))
        scans = intervals / self.usual_interval_s
        is_whole = (np.abs(scans - np.rint(scans)) < SCAN_TOLERANCE) & (scans > SAME_SCAN_SHARE)
        self.same_scan_s = SAME_SCAN_SHARE * self.usual_interval_s if is_whole.mean() >= MIN_REGULAR_SHARE else 0.0

    def _nearest(self, t: np.ndarray, positions: np.ndarray) -> int:
        """The index of the plot of one scan that is nearest to the extrapolated track; the first if that is unknown."""
        if len(t) == 1 or not self.last_plots:
            return 0
        expected = np.tile(self.last_plots[-1][1], (len(t), 1))
        if len(self.last_plots) == 2:
            (t0, first), (t1, second) = self.last_plots
            expected = second + np.outer((t - t1) / (t1 - t0), second - first)
        offsets = (
            (positions - expected)[:, :2]
            if np.isfinite(positions[:, :2]).all() and np.isfinite(expected[:, :2]).all()
            else positions - expected
        )
        squared_distances = np.nansum(offsets**2, axis=1)
        return int(squared_distances.argmin()) if np.isfinite(offsets).any(axis=1).all() else 0


class TrackNumbers:
    """The numbers of tracks over time.

    A number that is used again after a gap belongs to another track, which gets a name of its own: every tracker has
    dropped the first track by then. Of several plots of a track in a scan (equal times; with a turning antenna, times
    less than a scan apart) the one nearest to the extrapolated track is retained: the others are reflections, or the
    same plot repeated."""

    def __init__(self) -> None:
        self._tracks: dict[str, _TrackHistory] = {}
        self.doubles = 0

    @property
    def reused(self) -> int:
        """How often a number was used again for another track."""
        return sum(track.uses - 1 for track in self._tracks.values())

    def select(self, t: np.ndarray, names: list[str], places: Mapping[str, np.ndarray]) -> tuple[np.ndarray, list[str]]:
        """Select the next rows (n,), and name their tracks; places: columns (n,)."""
        retained = np.ones(len(t), dtype=bool)
        track_names = np.array(names, dtype=object)
        all_positions = plane_positions(places)
        positions = np.full((len(t), 3), np.nan) if all_positions is None else all_positions
        for name, rows in rows_by_name(names).items():
            if name:
                track_retained, new_names = retained[rows], track_names[rows]
                self._tracks.setdefault(name, _TrackHistory(name)).select_plots(
                    t[rows], positions[rows], track_retained, new_names
                )
                retained[rows], track_names[rows] = track_retained, new_names
        self.doubles += int((~retained).sum())
        return retained, track_names[retained].tolist()


# ---- plots -----------------------------------------------------------------------------------------------------------
MAX_NAMED_LINES = 3  # rows listed of those with the same fault
LARGEST_NUMBER = 1e18  # of any number, as in configs
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?")
TRACK = "track"  # the column that distinguishes several tracks of a file
POSITION_COLUMNS = ("range_m", "bearing_rad", "x_m", "y_m", "z_m")  # columns of a plot's place: for figures alone
CHUNK_ROWS = 20_000  # rows read, filtered and written at a time


class Faults:
    """Faults in the rows of a file: one line for each kind of fault, with its first place, further rows that have it,
    and a remedy for all."""

    def __init__(self, path: str):
        self.path = path
        self.kinds: dict[str, tuple[str, str, list[int]]] = {}

    def __bool__(self) -> bool:
        return bool(self.kinds)

    def add(self, line: int, where: str, must: str, got: object, cure: str = "") -> None:
        """where: the column's number and name with their separator, or nothing."""
        first = f"{self.path}:{line}:{where} {must}, got {got}"
        self.kinds.setdefault(where + must, (first, cure and f"; {cure}", []))[2].append(line)

    def lines(self) -> Iterator[str]:
        for first, cure, (_, *further_lines) in self.kinds.values():
            if not further_lines:
                yield first
                continue
            line_numbers = ", ".join(map(str, further_lines[:MAX_NAMED_LINES])) + (
                ", …" if len(further_lines) > MAX_NAMED_LINES else ""
            )
            noun = "lines" if len(further_lines) > 1 else "line"
            yield f"{first} (and {len(further_lines)} more, in {noun} {line_numbers}){cure}"


class Piece(NamedTuple):
    """Some rows of a file of plots.

    The measured columns (n,); the track of each row, None if the file has no tracks; the columns (n,) of the truth,
    `true_…`; the POSITION_COLUMNS that the file has; the requested texts that it has; the counts so far of track
    numbers used again, and of further plots of a scan that were left out."""

    columns: dict[str, np.ndarray]
    tracks: list[str] | None
    truth: dict[str, np.ndarray]
    positions: dict[str, np.ndarray]
    texts: dict[str, list[str]]
    reused_numbers: int = 0
    doubles: int = 0


def pieces(
    path: str | os.PathLike,
    choices: Sequence[Sequence[str]],
    size: int = CHUNK_ROWS,
    equal_times: bool = False,
    any_origin: bool = False,
    texts: Sequence[str] | None = None,
) -> Iterator[Piece]:
    """The columns of a file, of the first of `choices` that it has, `size` rows at a time, so that memory does not grow
    with the file: `t_s` first; NaN where a cell is empty.

    Times rise, within each track; equal_times: rows may have the time of the previous row. Else the rows of tracks
    with names are those that `TrackNumbers` selects, with its names. any_origin: ranges may be negative. texts: further
    columns; times may then have any order, and all rows are kept.

    After the first fault no more rows come: the rest is checked for faults, and ConfigError raised at the end with all
    of them, each `file:row's line:column: name: what is wrong`."""
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            reader = _Reader(str(path), csv.reader(file, strict=True), choices, equal_times, any_origin, texts)
            yield from reader.chunks(size)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text; other recordings: {import_command(str(path))}") from error


def place_of(path: str | os.PathLike, row: int) -> str:
    """The location of a row of numbers, counted from 0: `file:line`; in a stream, which is read once, `file: row`."""
    if os.path.isfile(path):
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file, strict=True)
            numbers = (rows.line_num for cells in itertools.dropwhile(_is_comment, rows) if cells)
            if line := next(itertools.islice(numbers, row + 1, None), None):
                return f"{path}:{line}"
    return f"{path}: row {row + 1} after the header"


class _Reader:
    """Reads the header, then numbers, and checks values and the order of times; faults are collected."""

    def __init__(
        self,
        path: str,
        rows: "_csv.Reader",
        choices: Sequence[Sequence[str]],
        equal_times: bool,
        any_origin: bool,
        texts: Sequence[str] | None,
    ):
        self.any_order = texts is not None
        self.equal_times, self.any_origin = equal_times, any_origin
        self.path, self.rows, self.has_measurement = path, rows, False
        self.faults = Faults(path)
        try:
            header = [name.strip() for name in next((row for row in rows if not _is_comment(row)), [])]
        except csv.Error as error:
            raise ConfigError(f"{path}:{rows.line_num}: not a CSV row: {error}") from error
        self.names = _choose_columns(path, header, choices)
        self.width, self.indices = len(header), [header.index(name) for name in self.names]
        self.track_index = header.index(TRACK) if TRACK in header else None
        # Columns that the filters do not take: anything but a number is missing.
        self.extra_indices = {
            name: index for index, name in enumerate(header) if name.startswith(TRUE) or name in POSITION_COLUMNS
        }
        self.text_indices = {name: header.index(name) for name in texts or () if name in header}
        self.last_times: dict[str, float] = {}
        self.track_numbers = TrackNumbers()

    def chunks(self, size: int) -> Iterator[Piece]:
        """The columns, tracks, truth and positions of the rows, `size` rows at a time."""
        any_row = False
        while True:
            lines, values, tracks, texts = self._read_rows(size)
            if not lines:
                break
            any_row = True
            numbers = np.array(values, dtype=float).reshape(-1, len(self.names) + len(self.extra_indices))
            array = numbers[:, : len(self.names)]
            extra_columns = dict(zip(self.extra_indices, numbers[:, len(self.names) :].T.copy(), strict=True))
            self._check_values(array, lines)
            if not self.any_order:
                self._check_times(array[:, 0], lines, tracks)
            if not self.faults:
                tables = [
                    dict(zip(self.names, array.T.copy(), strict=True)),
                    {name: column for name, column in extra_columns.items() if name.startswith(TRUE)},
                    {name: column for name, column in extra_columns.items() if name in POSITION_COLUMNS},
                ]
                if self.track_index is not None and not self.equal_times and not self.any_order:
                    retained, tracks = self.track_numbers.select(array[:, 0], tracks, tables[2])
                    if not retained.all():
                        tables = [{name: column[retained] for name, column in numbers.items()} for numbers in tables]
                columns, truth, places = tables
                row_tracks = None if self.track_index is None else tracks
                yield Piece(
                    columns, row_tracks, truth, places, texts, self.track_numbers.reused, self.track_numbers.doubles
                )
        if self.faults:
            raise ConfigError(*self.faults.lines())
        if not any_row:
            raise ConfigError(f"{self.path}: has no rows")
        if not self.has_measurement:
            raise ConfigError(f"{self.path}: has no measured value in {', '.join(self.names[1:])}")

    def _read_rows(self, size: int) -> tuple[list[int], list[list[float]], list[str], dict[str, list[str]]]:
        """Line numbers, numbers, tracks and texts of the next rows."""
        lines: list[int] = []
        values: list[list[float]] = []
        tracks: list[str] = []
        texts: dict[str, list[str]] = {name: [] for name in self.text_indices}
        try:
            for row in self.rows:
                if row:
                    line = self.rows.line_num
                    lines.append(line)
                    values.append(self._row_numbers(row, line))
                    has_all_cells = self.track_index is not None and len(row) == self.width
                    tracks.append(
                        row[self.track_index].strip() if has_all_cells and self.track_index is not None else ""
                    )
                    for name, index in self.text_indices.items():
                        texts[name].append(row[index].strip() if index < len(row) else "")
                if len(lines) == size:
                    break
        except csv.Error as error:
            fault = f"{self.path}:{self.rows.line_num}: not a CSV row: {error}"
            raise ConfigError(*self.faults.lines(), fault) from error
        return lines, values, tracks, texts

    def _check_values(self, array: np.ndarray, lines: list[int]) -> None:
        """Collect values that no sensor can have measured as faults."""
        self.has_measurement |= bool(np.isfinite(array[:, 1:]).any())
        for i, j in np.argwhere(impossible_values(array, self.names, self.any_origin)):
            name = self.names[j]
            must = "must be in radians, from -2 pi to 2 pi" if name.endswith("_rad") else "must be > 0"
            degrees = f"if these are degrees, name it bearing_deg and {import_command(self.path)}"
            cure = degrees if name == "bearing_rad" else ""
            self.faults.add(lines[i], self._column_label(j), must, f"{array[i, j]:g}", cure)

    def _check_times(self, t: np.ndarray, lines: list[int], tracks: list[str]) -> None:
        """Collect times that do not rise from row to row of a track as faults; rows of no track may have any time."""
        for name, rows in rows_by_name(tracks).items():
            if self.track_index is not None and not name:
                continue
            times = np.append(self.last_times.get(name, math.nan), t[rows])
            rises = np.diff(times) >= 0 if self.equal_times or name else np.diff(times) > 0
            for i in np.flatnonzero(~rises & np.isfinite(times[:-1]) & np.isfinite(times[1:])):
                must = f"must {'not be earlier' if self.equal_times or name else 'be later'} than the row before"
                got = f"{times[i + 1]:g} after {times[i]:g}{f' in track {name}' if name else ''}"
                cure = "" if name else f"if there are several tracks, name their column {TRACK}"
                self.faults.add(lines[rows[i]], self._column_label(0), must, got, cure)
            self.last_times[name] = times[-1]

    def _row_numbers(self, row: list[str], line: int) -> list[float]:
        """The numbers of a row; faulty ones become NaN."""
        if len(row) != self.width:
            self.faults.add(line, "", f"must have {self.width} cells as the header", len(row))
            return [math.nan] * (len(self.names) + len(self.extra_indices))
        measured = [self._parse_number(row[index].strip(), line, j) for j, index in enumerate(self.indices)]
        return [*measured, *(_number_or_nan(row[index]) for index in self.extra_indices.values())]

    def _parse_number(self, text: str, line: int, j: int) -> float:
        if not text and j:
            return math.nan
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST_NUMBER or "_" in text:
            hint = " with a decimal point, not a comma" if DECIMAL_COMMA.fullmatch(text) else ""
            cure = "" if j else f"for times of day and dates, {import_command(self.path)}"
            self.faults.add(line, self._column_label(j), f"must be a finite number{hint}", repr(text[:60]), cure)
            return math.nan
        return value

    def _column_label(self, j: int) -> str:
        """The faulty column, as `Faults` names it."""
        return f"{self.indices[j] + 1}: {self.names[j]}:"


def import_command(path: str) -> str:
    """The command that converts other programs' files to our columns."""
    return f"radarsim import {shlex.quote(path)} -o imported.csv"


def _number_or_nan(text: str) -> float:
    """A number of a column that filters do not take; NaN for any other text."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if abs(value) <= LARGEST_NUMBER else math.nan


def rows_by_name(names: "Sequence[Name]") -> "dict[Name, np.ndarray]":
    """The indices of the rows of each name, in the order in which the names first appear."""
    if len(set(names)) == 1:
        return {names[0]: np.arange(len(names))}
    rows: dict[Name, list[int]] = {}
    for i, name in enumerate(names):
        rows.setdefault(name, []).append(i)
    return {name: np.array(indices) for name, indices in rows.items()}


def _is_comment(row: list[str]) -> bool:
    """Whether a row before the header is a comment."""
    return bool(row) and row[0].startswith("#")


def impossible_values(array: np.ndarray, names: list[str], any_origin: bool = False) -> np.ndarray:
    """Whether values (n, columns) are such that no sensor can have measured them.

    Ranges that are not positive, unless they count from any origin; spans that are not positive; angles beyond a full
    turn, which may be degrees."""
    wrong = np.zeros(array.shape, dtype=bool)
    for j, name in enumerate(names):
        if name == "span_mps" or (name == "range_m" and not any_origin):
            wrong[:, j] = array[:, j] <= 0
        elif name.endswith("_rad"):
            wrong[:, j] = np.abs(array[:, j]) > 2 * np.pi
    return wrong


def _choose_columns(path: str, header: list[str], choices: Sequence[Sequence[str]]) -> list[str]:
    """The first choice of columns that the header has; raises ConfigError if it has one of them twice."""
    for choice in choices:
        if set(choice) <= set(header):
            repeated = [name for name in choice if header.count(name) > 1]
            if repeated:
                raise ConfigError(*(f"{path}:1: the column {name} is there twice" for name in repeated))
            return list(choice)
    allowed = " or ".join(", ".join(choice) for choice in choices)
    header_text = "".join(c if c.isprintable() else "�" for c in ", ".join(header)[:200])
    hint = (
        f"; ranges and positions with other names, separators or units: {import_command(path)}" if header_text else ""
    )
    raise ConfigError(f"{path}:1: must have the columns {allowed}; got {header_text or 'nothing'}{hint}")


def header_of(track: Track, has_track_name: bool = False) -> tuple[str, ...]:
    """The columns of a track; has_track_name: preceded by the name of the recorded track."""
    models = 0 if track.probability is None else track.probability.shape[2]
    columns = ("t_s", "filter", "component", "unit", "estimate", "sigma")
    score_columns = () if track.numbers is None else ("track", "score")
    name_column = ("recorded_track",) if has_track_name else ()
    return (*name_column, *columns, *(f"probability_{m + 1}" for m in range(models)), *score_columns)


def rows_of(track: Track, name: str | None = None) -> Iterator[tuple[str, ...]]:
    """Rows of a track: t_s, filter, component, unit, estimate, sigma, the models' probabilities, number and score.

    name: of the recorded track, put first."""
    name_cell = () if name is None else (name,)
    for i, t in enumerate(track.t_s.tolist()):
        for f, filter_name in enumerate(track.filters):
            further_cells: tuple[str, ...] = ()
            if track.probability is not None:
                further_cells = tuple(map(number_text, track.probability[f, i].tolist()))
            if track.numbers is not None and track.score is not None:
                further_cells = (*further_cells, str(track.numbers[f]), number_text(float(track.score[f, i])))
            numbers = zip(track.estimate[f, i].tolist(), track.sigma[f, i].tolist(), track.components, strict=True)
            for estimate, sigma, (component, unit) in numbers:
                if not math.isnan(estimate):
                    yield (
                        *name_cell,
                        repr(t),
                        filter_name,
                        component,
                        unit,
                        repr(estimate),
                        number_text(sigma),
                        *further_cells,
                    )


def number_text(value: float) -> str:
    """A number as text, '' for NaN."""
    return "" if math.isnan(value) else repr(value)


def column_texts(column: np.ndarray) -> Iterator[str]:
    """Numbers (n,) as texts, '' for NaN."""
    if column.dtype.kind != "f":
        return map(str, column.tolist())
    missing = np.isnan(column)
    if missing.all():
        return itertools.repeat("", len(column))
    return map(number_text if missing.any() else repr, column.tolist())


def write_columns(
    columns: Mapping[str, np.ndarray], path: str | os.PathLike, config: str | os.PathLike | None = None
) -> None:
    """Write columns (n,) of numbers as CSV, an empty cell for NaN, never over the config; errors as of `Writer`."""
    with Writer(path, {"the config": config}) as file:
        file.write([tuple(columns)])
        file.write(zip(*map(column_texts, columns.values()), strict=True))
