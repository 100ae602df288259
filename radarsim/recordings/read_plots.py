"""Read a CSV file of plots, piece by piece, and check its rows.

A plots file has a header, before which lines beginning with `#` may stand. `t_s` must rise from row to row; for studies
that take several plots at a time it must not fall. An empty cell is a missing value; other columns are ignored."""

import csv
import itertools
import math
import os
import re
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recordings import fill_values
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.row_faults import Faults
from radarsim.recordings.track_numbers import TrackNumbers
from radarsim.studies.plot_arrays import TRUTH_PREFIX

if TYPE_CHECKING:
    import _csv


LARGEST_NUMBER = 1e18  # of any number, as in configs
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?")
TRACK_COLUMN = "track"  # the column that distinguishes several tracks of a file
POSITION_COLUMNS = ("range_m", "bearing_rad", "x_m", "y_m", "z_m")  # columns of a plot's place: for figures alone
CHUNK_ROWS = 20_000  # rows read, filtered and written at a time


class Piece(NamedTuple):
    """Some rows of a file of plots.

    The measured columns (n,); the track of each row, None if the file has no tracks; the columns (n,) of the truth,
    `true_…`; the POSITION_COLUMNS that the file has; the requested texts that it has; the counts so far of track
    numbers used again, of further plots of a scan that were left out, and of numbers that stand for none."""

    columns: dict[str, np.ndarray]
    tracks: list[str] | None
    truth: dict[str, np.ndarray]
    positions: dict[str, np.ndarray]
    texts: dict[str, list[str]]
    reused_numbers: int = 0
    doubles: int = 0
    fills: Mapping[str, int] = MappingProxyType({})  # by column


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


def row_location(path: str | os.PathLike, row: int) -> str:
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
        self.track_index = header.index(TRACK_COLUMN) if TRACK_COLUMN in header else None
        # Columns that the filters do not take: anything but a number is missing.
        self.extra_indices = {
            name: index
            for index, name in enumerate(header)
            if name.startswith(TRUTH_PREFIX) or name in POSITION_COLUMNS
        }
        self.text_indices = {name: header.index(name) for name in texts or () if name in header}
        self.last_times: dict[str, float] = {}
        self.track_numbers = TrackNumbers()
        self.fills = Counter[str]()

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
                    {name: column for name, column in extra_columns.items() if name.startswith(TRUTH_PREFIX)},
                    {name: column for name, column in extra_columns.items() if name in POSITION_COLUMNS},
                ]
                if self.track_index is not None and not self.equal_times and not self.any_order:
                    retained, tracks = self.track_numbers.select(array[:, 0], tracks, tables[2])
                    if not retained.all():
                        tables = [{name: column[retained] for name, column in numbers.items()} for numbers in tables]
                columns, truth, places = tables
                row_tracks = None if self.track_index is None else tracks
                if not self.equal_times and not self.any_order:
                    names = ["1"] * len(columns["t_s"]) if row_tracks is None else row_tracks
                    self.fills.update(fill_values.remove_fills(columns, names))
                counts = self.track_numbers.reused, self.track_numbers.doubles, self.fills.copy()
                yield Piece(columns, row_tracks, truth, places, texts, *counts)
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
            if "unexpected end" in str(error) and lines:
                must = "must have pairs of quotation marks; one is open to the end of the file"
                fault = f"{self.path}:{lines[-1] + 1}: {must}"
            raise ConfigError(*self.faults.lines(), fault) from error
        return lines, values, tracks, texts

    def _check_values(self, array: np.ndarray, lines: list[int]) -> None:
        """Collect values that no sensor can have measured as faults."""
        self.has_measurement |= bool(np.isfinite(array[:, 1:]).any())
        for i, j in np.argwhere(impossible_values(array, self.names, self.any_origin)):
            name = self.names[j]
            must = "must be in radians, from -2 pi to 2 pi" if name.endswith("_rad") else "must be > 0"
            cures = {
                "bearing_rad": f"if these are degrees, name it bearing_deg and {import_command(self.path)}",
                "range_m": f"plots without a range are left out by {import_command(self.path)}",
            }
            label, cure = self._column_label(j), cures.get(name, "")
            self.faults.add(lines[i], label, must, f"{array[i, j]:g}", cure, always=name == "range_m")

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
                cure = self._order_cure(name, bool(times[i + 1] == times[i]))
                self.faults.add(lines[rows[i]], self._column_label(0), must, got, cure)
            self.last_times[name] = times[-1]

    def _order_cure(self, track: str, is_equal: bool) -> str:
        """What helps where the times of a track, '' where there is one alone, do not rise, or are equal."""
        cures = ["of several plots of a scan keep that of the target"] if is_equal else []
        cures += [] if track else [f"if there are several tracks, name their column {TRACK_COLUMN}"]
        if "range_m" in self.names:
            cures.append(f"rows are sorted by {import_command(self.path)}")
        return "; ".join(cures)

    def _row_numbers(self, row: list[str], line: int) -> list[float]:
        """The numbers of a row; faulty ones become NaN."""
        if len(row) != self.width:
            cure = f"comments, cut lines and empty cells at the end are left out by {import_command(self.path)}"
            cure = cure if "range_m" in self.names else ""
            self.faults.add(line, "", f"must have {self.width} cells as the header", len(row), cure, always=bool(cure))
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
            what = "cells that stand for none" if j else "times of day, dates, and lines that are no rows"
            cure = f"for {what}, {import_command(self.path)}" if not j or "range_m" in self.names else ""
            must = f"must be a finite number{hint}"
            self.faults.add(
                line, self._column_label(j), must, repr(text[:60]), cure, always=bool(cure) and "range_m" in self.names
            )
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


def _is_comment(row: list[str]) -> bool:
    """Whether a row before the header is a comment."""
    return bool(row) and row[0].startswith("#")


def impossible_values(array: np.ndarray, names: list[str], any_origin: bool = False) -> np.ndarray:
    """Whether values (n, columns) are such that no sensor can have measured them.

    Ranges that are not positive, unless they count from any origin; spans that are not positive; angles beyond a full
    turn, which may be degrees."""
    impossible = np.zeros(array.shape, dtype=bool)
    for j, name in enumerate(names):
        if name == "span_mps" or (name == "range_m" and not any_origin):
            impossible[:, j] = array[:, j] <= 0
        elif name.endswith("_rad"):
            impossible[:, j] = np.abs(array[:, j]) > 2 * np.pi
    return impossible


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
