"""Recorded plots: one track from a CSV file, and the estimates over it back to one.

A plots file has a header, before which lines beginning with `#` may stand; `t_s` must rise from row to row (or, for
studies that take several plots at a time, not fall), an empty cell means missing, other columns are ignored.

Places of plots in the plane, for the plan view, as far as the file has them: north and east from the radar, or whatever
stands at the origin."""

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
MOST = 2000  # rows of a track that are kept for figures


def in_plane(places: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """North, east and range (n, 3), m, from columns (n,) of a file; None where it has none that say where plots are.
    From x_m (north) and z_m (east) as `radarsim import` writes them; else from range and bearing, with the slant range
    in place of the ground range; else the range alone."""
    if {"x_m", "y_m", "z_m"} <= set(places):
        x, y, z = (places[name] for name in ("x_m", "y_m", "z_m"))
        r = places.get("range_m", np.sqrt(x**2 + y**2 + z**2))
        return np.stack([x, z, r], axis=1)
    if "range_m" not in places:
        return None
    r = places["range_m"]
    b = places.get("bearing_rad", np.full(len(r), np.nan))
    return np.stack([r * np.cos(b), r * np.sin(b), r], axis=1)


@dataclass(kw_only=True)
class Thinned:
    """Rows of a track, spread over its whole time: when there are more than most, every second block of them is
    dropped. number (n,): of each row that is held."""

    most: int = MOST
    block: int = 1
    number: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    seen: int = 0
    stride: int = 1

    def kept(self, more: int) -> np.ndarray:
        """Which of the rows held (n,), and of so many more, are held from now on: (n + more,)."""
        number = np.concatenate([self.number, self.seen + np.arange(more)])
        while (kept := number // self.block % self.stride == 0).sum() > self.most:
            self.stride *= 2
        self.number, self.seen = number[kept], self.seen + more
        return kept


@dataclass
class Places(Thinned):
    """Times (n,) and places (n, 3) of a track's plots, north, east and range in m."""

    t_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    places: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def add(self, t_s: np.ndarray, places: Mapping[str, np.ndarray]) -> None:
        """Add plots; those without any place are left out."""
        found = in_plane(places)
        if found is None:
            return
        there = np.isfinite(found).any(axis=1)
        kept = self.kept(int(there.sum()))
        self.t_s = np.concatenate([self.t_s, t_s[there]])[kept]
        self.places = np.concatenate([self.places, found[there]])[kept]


# ---- numbers of tracks -----------------------------------------------------------------------------------------------
USED_AGAIN, USED_AGAIN_S = 30.0, 60.0  # usual intervals and time after which a number is that of another track
SAME_SCAN = 0.5  # of the usual interval: plots of one track that are nearer than that are of one scan
REGULAR, NEARLY = 0.75, 0.1  # share of intervals that are whole scans, but for this part of one, of a turning antenna
LEAST_STEPS, MOST_STEPS = 5, 100  # between the last plots of a track, which tell its usual interval


@dataclass
class _Seen:
    """A track so far: under which name, how often its number began one, its last two plots (time and place), the last
    intervals, the usual one, and the time within which a further plot is of the same scan."""

    name: str
    times: int = 1
    last: list[tuple[float, np.ndarray]] = field(default_factory=list)
    steps: np.ndarray = field(default_factory=lambda: np.zeros(0))
    usual_s: float = math.nan
    scan_s: float = 0.0

    def tidied(self, t: np.ndarray, where: np.ndarray, kept: np.ndarray, names: np.ndarray) -> None:
        """Which of the next plots, at times (n,) and places (n, 3), are kept, and their names: changed in place."""
        steps = np.diff(t, prepend=self.last[-1][0] if self.last else t[0])
        self._timed(steps if self.last else steps[1:])
        gap = max(USED_AGAIN * self.usual_s, USED_AGAIN_S)  # without a usual interval: not-a-number, and no gap
        close = (steps <= 0) | (steps < self.scan_s)
        close[:1] &= bool(self.last)
        if self.times == 1 and not (steps > gap).any() and not close.any():
            self.last = [*self.last, *zip(t[-2:].tolist(), where[-2:], strict=True)][-2:]
            return
        i = 0
        while i < len(t):
            before = self.last[-1][0] if self.last else -math.inf
            if self.last and t[i] - before > gap:
                self.times, self.last = self.times + 1, []
            end = i + 1
            if self.last and (t[i] <= before or t[i] - before < self.scan_s):
                kept[i] = False  # the rest of a scan that the rows before have begun
            else:
                while end < len(t) and (t[end] == t[i] or t[end] - t[i] < self.scan_s):
                    end += 1
                best = i + self._nearest(t[i:end], where[i:end])
                kept[i:end] = np.arange(i, end) == best
                names[best] = self.name if self.times == 1 else f"{self.name} ({self.times})"
                self.last = [*self.last, (float(t[best]), where[best])][-2:]
            i = end

    def _timed(self, steps: np.ndarray) -> None:
        """The usual interval of a track, and whether it is that of a turning antenna."""
        self.steps = steps = np.concatenate([self.steps, steps[steps > 0]])[-MOST_STEPS:]
        if steps.size < LEAST_STEPS:
            return
        self.usual_s = float(np.median(steps))
        scans = steps / self.usual_s
        whole = (np.abs(scans - np.rint(scans)) < NEARLY) & (scans > SAME_SCAN)
        self.scan_s = SAME_SCAN * self.usual_s if whole.mean() >= REGULAR else 0.0

    def _nearest(self, t: np.ndarray, where: np.ndarray) -> int:
        """Which of the plots of one scan is nearest to where the last two lead; the first where that is not known."""
        if len(t) == 1 or not self.last:
            return 0
        led = np.tile(self.last[-1][1], (len(t), 1))
        if len(self.last) == 2:
            (t0, first), (t1, second) = self.last
            led = second + np.outer((t - t1) / (t1 - t0), second - first)
        off = (where - led)[:, :2] if np.isfinite(where[:, :2]).all() and np.isfinite(led[:, :2]).all() else where - led
        far = np.nansum(off**2, axis=1)
        return int(far.argmin()) if np.isfinite(off).any(axis=1).all() else 0


class Numbers:
    """The numbers of tracks over time. One that is used again after a gap is that of another track, with a name of its
    own: every tracker has dropped the first by then. Of several plots of a track in a scan (equal times; with a turning
    antenna, times that are no scan apart) the one nearest to where the track leads is kept: the others are reflections,
    or the same plot once more."""

    def __init__(self) -> None:
        self._tracks: dict[str, _Seen] = {}
        self.doubles = 0

    @property
    def again(self) -> int:
        """How many numbers were used again."""
        return sum(one.times - 1 for one in self._tracks.values())

    def tidied(self, t: np.ndarray, names: list[str], places: Mapping[str, np.ndarray]) -> tuple[np.ndarray, list[str]]:
        """Which of the next rows (n,) are kept, and their tracks; places: columns (n,)."""
        kept, called, found = np.ones(len(t), dtype=bool), np.array(names, dtype=object), in_plane(places)
        where = np.full((len(t), 3), np.nan) if found is None else found
        for name, rows in grouped(names).items():
            if name:
                some, own = kept[rows], called[rows]
                self._tracks.setdefault(name, _Seen(name)).tidied(t[rows], where[rows], some, own)
                kept[rows], called[rows] = some, own
        self.doubles += int((~kept).sum())
        return kept, called[kept].tolist()


# ---- plots -----------------------------------------------------------------------------------------------------------
NAMED = 3  # rows listed of those with the same fault
LARGEST = 1e18  # of any number, as in configs
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?")
TRACK = "track"  # the column that distinguishes several tracks of a file
PLACES = ("range_m", "bearing_rad", "x_m", "y_m", "z_m")  # columns of a plot's place: for figures alone
CHUNK = 20_000  # rows read, filtered and written at a time


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
        for first, cure, (_, *more) in self.kinds.values():
            if not more:
                yield first
                continue
            named = ", ".join(map(str, more[:NAMED])) + (", …" if len(more) > NAMED else "")
            yield f"{first} (and {len(more)} more, in {'lines' if len(more) > 1 else 'line'} {named}){cure}"


class Piece(NamedTuple):
    """Some rows of a file of plots: the measured columns (n,); the track of each row, none where the file has no
    tracks; the columns (n,) of the truth, `true_…`; those of the plots' places, of PLACES; texts, of those asked for
    that the file has; so far, how many numbers of tracks were used again, and how many further plots of a scan were
    left out."""

    columns: dict[str, np.ndarray]
    tracks: list[str] | None
    truth: dict[str, np.ndarray]
    places: dict[str, np.ndarray]
    texts: dict[str, list[str]]
    again: int = 0
    doubles: int = 0


def pieces(
    path: str | os.PathLike,
    choices: Sequence[Sequence[str]],
    size: int = CHUNK,
    several: bool = False,
    any_origin: bool = False,
    texts: Sequence[str] | None = None,
) -> Iterator[Piece]:
    """The columns of a file, of the first of `choices` that it has, `size` rows at a time, so that memory does not grow
    with the file: `t_s` first; NaN where a cell is empty.

    Times rise, within each track; several: rows may have the time of the row before. Else the rows of tracks with
    names are those that `Numbers` keeps, with its names. any_origin: ranges may be negative. texts: further columns;
    times may then have any order, and all rows are kept.

    After the first fault no more rows come: the rest is checked for faults, and ConfigError raised at the end with all
    of them, each `file:row's line:column: name: what is wrong`."""
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            reader = _Reader(str(path), csv.reader(file, strict=True), choices, several, any_origin, texts)
            yield from reader.chunks(size)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text; other recordings: {_imported(str(path))}") from error


def place_of(path: str | os.PathLike, row: int) -> str:
    """Where a row of numbers, counted from 0, ends: `file:line`; in a stream, which is read once, `file: row`."""
    if os.path.isfile(path):
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file, strict=True)
            numbers = (rows.line_num for cells in itertools.dropwhile(_comment, rows) if cells)
            if line := next(itertools.islice(numbers, row + 1, None), None):
                return f"{path}:{line}"
    return f"{path}: row {row + 1} after the header"


class _Reader:
    """Header, then numbers, then the order of the times; faults are collected."""

    def __init__(
        self,
        path: str,
        rows: "_csv.Reader",
        choices: Sequence[Sequence[str]],
        several: bool,
        any_origin: bool,
        texts: Sequence[str] | None,
    ):
        self.any_order = texts is not None
        self.several, self.any_origin = several, any_origin
        self.path, self.rows, self.measured = path, rows, False
        self.faults = Faults(path)
        try:
            header = [name.strip() for name in next((row for row in rows if not _comment(row)), [])]
        except csv.Error as error:
            raise ConfigError(f"{path}:{rows.line_num}: not a CSV row: {error}") from error
        self.wanted = _chosen(path, header, choices)
        self.width, self.places = len(header), [header.index(name) for name in self.wanted]
        self.track = header.index(TRACK) if TRACK in header else None
        # Columns that the filters do not take: anything but a number is missing.
        self.beside = {name: place for place, name in enumerate(header) if name.startswith(TRUE) or name in PLACES}
        self.texts = {name: header.index(name) for name in texts or () if name in header}
        self.last: dict[str, float] = {}
        self.numbers = Numbers()

    def chunks(self, size: int) -> Iterator[Piece]:
        """The wanted columns, the rows' tracks and their truth, `size` rows at a time."""
        any_row = False
        while True:
            lines, values, tracks, texts = self._some(size)
            if not lines:
                break
            any_row = True
            table = np.array(values, dtype=float).reshape(-1, len(self.wanted) + len(self.beside))
            array = table[:, : len(self.wanted)]
            beside = dict(zip(self.beside, table[:, len(self.wanted) :].T.copy(), strict=True))
            self._judge(array, lines)
            if not self.any_order:
                self._in_order(array[:, 0], lines, tracks)
            if not self.faults:
                tables = [
                    dict(zip(self.wanted, array.T.copy(), strict=True)),
                    {name: column for name, column in beside.items() if name.startswith(TRUE)},
                    {name: column for name, column in beside.items() if name in PLACES},
                ]
                if self.track is not None and not self.several and not self.any_order:
                    kept, tracks = self.numbers.tidied(array[:, 0], tracks, tables[2])
                    if not kept.all():
                        tables = [{name: column[kept] for name, column in one.items()} for one in tables]
                columns, true, places = tables
                named = None if self.track is None else tracks
                yield Piece(columns, named, true, places, texts, self.numbers.again, self.numbers.doubles)
        if self.faults:
            raise ConfigError(*self.faults.lines())
        if not any_row:
            raise ConfigError(f"{self.path}: has no rows")
        if not self.measured:
            raise ConfigError(f"{self.path}: has no measured value in {', '.join(self.wanted[1:])}")

    def _some(self, size: int) -> tuple[list[int], list[list[float]], list[str], dict[str, list[str]]]:
        """Line numbers, numbers, tracks and texts of the next rows."""
        lines: list[int] = []
        values: list[list[float]] = []
        tracks: list[str] = []
        texts: dict[str, list[str]] = {name: [] for name in self.texts}
        try:
            for row in self.rows:
                if row:
                    line = self.rows.line_num
                    lines.append(line)
                    values.append(self._numbers(row, line))
                    whole = self.track is not None and len(row) == self.width
                    tracks.append(row[self.track].strip() if whole and self.track is not None else "")
                    for name, place in self.texts.items():
                        texts[name].append(row[place].strip() if place < len(row) else "")
                if len(lines) == size:
                    break
        except csv.Error as error:
            fault = f"{self.path}:{self.rows.line_num}: not a CSV row: {error}"
            raise ConfigError(*self.faults.lines(), fault) from error
        return lines, values, tracks, texts

    def _judge(self, array: np.ndarray, lines: list[int]) -> None:
        """Note values that no sensor can have measured."""
        self.measured |= bool(np.isfinite(array[:, 1:]).any())
        for i, j in np.argwhere(impossible(array, self.wanted, self.any_origin)):
            name = self.wanted[j]
            must = "must be in radians, from -2 pi to 2 pi" if name.endswith("_rad") else "must be > 0"
            degrees = f"if these are degrees, name it bearing_deg and {_imported(self.path)}"
            cure = degrees if name == "bearing_rad" else ""
            self.faults.add(lines[i], self._where(j), must, f"{array[i, j]:g}", cure)

    def _in_order(self, t: np.ndarray, lines: list[int], tracks: list[str]) -> None:
        """Note times that do not rise from row to row of a track; rows of no track may have any."""
        for name, rows in grouped(tracks).items():
            if self.track is not None and not name:
                continue
            own = np.append(self.last.get(name, math.nan), t[rows])
            rises = np.diff(own) >= 0 if self.several or name else np.diff(own) > 0
            for i in np.flatnonzero(~rises & np.isfinite(own[:-1]) & np.isfinite(own[1:])):
                must = f"must {'not be earlier' if self.several or name else 'be later'} than the row before"
                got = f"{own[i + 1]:g} after {own[i]:g}{f' in track {name}' if name else ''}"
                cure = "" if name else f"if there are several tracks, name their column {TRACK}"
                self.faults.add(lines[rows[i]], self._where(0), must, got, cure)
            self.last[name] = own[-1]

    def _numbers(self, row: list[str], line: int) -> list[float]:
        """The wanted numbers of a row; faults are noted and become NaN."""
        if len(row) != self.width:
            self.faults.add(line, "", f"must have {self.width} cells as the header", len(row))
            return [math.nan] * (len(self.wanted) + len(self.beside))
        measured = [self._number(row[place].strip(), line, j) for j, place in enumerate(self.places)]
        return [*measured, *(_number_or_missing(row[place]) for place in self.beside.values())]

    def _number(self, text: str, line: int, j: int) -> float:
        if not text and j:
            return math.nan
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST or "_" in text:
            hint = " with a decimal point, not a comma" if DECIMAL_COMMA.fullmatch(text) else ""
            cure = "" if j else f"for times of day and dates, {_imported(self.path)}"
            self.faults.add(line, self._where(j), f"must be a finite number{hint}", repr(text[:60]), cure)
            return math.nan
        return value

    def _where(self, j: int) -> str:
        """The faulty column, as `Faults` names it."""
        return f"{self.places[j] + 1}: {self.wanted[j]}:"


def _imported(path: str) -> str:
    """The command that converts other programs' files to our columns."""
    return f"radarsim import {shlex.quote(path)} -o imported.csv"


def _number_or_missing(text: str) -> float:
    """A number of a column that is only compared with; NaN where it is none."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if abs(value) <= LARGEST else math.nan


def grouped(names: "Sequence[Name]") -> "dict[Name, np.ndarray]":
    """The rows of each name, in the order in which the names first appear."""
    if len(set(names)) == 1:
        return {names[0]: np.arange(len(names))}
    rows: dict[Name, list[int]] = {}
    for i, name in enumerate(names):
        rows.setdefault(name, []).append(i)
    return {name: np.array(own) for name, own in rows.items()}


def _comment(row: list[str]) -> bool:
    """Whether a row before the header is a comment on the file."""
    return bool(row) and row[0].startswith("#")


def impossible(array: np.ndarray, names: list[str], any_origin: bool = False) -> np.ndarray:
    """Which values (n, columns) no sensor can have measured: ranges not positive, unless they count from any origin,
    spans not positive, and angles beyond a turn (degrees?)."""
    wrong = np.zeros(array.shape, dtype=bool)
    for j, name in enumerate(names):
        if name == "span_mps" or (name == "range_m" and not any_origin):
            wrong[:, j] = array[:, j] <= 0
        elif name.endswith("_rad"):
            wrong[:, j] = np.abs(array[:, j]) > 2 * np.pi
    return wrong


def _chosen(path: str, header: list[str], choices: Sequence[Sequence[str]]) -> list[str]:
    """The first choice of columns that the header holds, each once."""
    for choice in choices:
        if set(choice) <= set(header):
            twice = [name for name in choice if header.count(name) > 1]
            if twice:
                raise ConfigError(*(f"{path}:1: the column {name} is there twice" for name in twice))
            return list(choice)
    allowed = " or ".join(", ".join(choice) for choice in choices)
    given = "".join(c if c.isprintable() else "�" for c in ", ".join(header)[:200])
    hint = f"; ranges and positions with other names, separators or units: {_imported(path)}" if given else ""
    raise ConfigError(f"{path}:1: must have the columns {allowed}; got {given or 'nothing'}{hint}")


def header_of(track: Track, named: bool = False) -> tuple[str, ...]:
    """The columns of a track; named: preceded by the name of the recorded track."""
    models = 0 if track.probability is None else track.probability.shape[2]
    names = ("t_s", "filter", "component", "unit", "estimate", "sigma")
    more = () if track.numbers is None else ("track", "score")
    recorded = ("recorded_track",) if named else ()
    return (*recorded, *names, *(f"probability_{m + 1}" for m in range(models)), *more)


def rows_of(track: Track, name: str | None = None) -> Iterator[tuple[str, ...]]:
    """Rows of a track: t_s, filter, component, unit, estimate, sigma, the models' probabilities, number and score.

    name: of the recorded track, put first."""
    recorded = () if name is None else (name,)
    for i, t in enumerate(track.t_s.tolist()):
        for f, filter_name in enumerate(track.filters):
            shares: tuple[str, ...] = ()
            if track.probability is not None:
                shares = tuple(map(_cell, track.probability[f, i].tolist()))
            if track.numbers is not None and track.score is not None:
                shares = (*shares, str(track.numbers[f]), _cell(float(track.score[f, i])))
            numbers = zip(track.estimate[f, i].tolist(), track.sigma[f, i].tolist(), track.components, strict=True)
            for estimate, sigma, (component, unit) in numbers:
                if not math.isnan(estimate):
                    yield (*recorded, repr(t), filter_name, component, unit, repr(estimate), _cell(sigma), *shares)


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(value)


def cells(column: np.ndarray) -> Iterator[str]:
    """Numbers (n,) as text, nothing for not-a-number."""
    if column.dtype.kind != "f":
        return map(str, column.tolist())
    missing = np.isnan(column)
    if missing.all():
        return itertools.repeat("", len(column))
    return map(_cell if missing.any() else repr, column.tolist())


def write_columns(
    columns: Mapping[str, np.ndarray], path: str | os.PathLike, config: str | os.PathLike | None = None
) -> None:
    """Write columns (n,) of numbers as CSV, an empty cell for NaN, never over the config; errors as of `Writer`."""
    with Writer(path, {"the config": config}) as file:
        file.write([tuple(columns)])
        file.write(zip(*map(cells, columns.values()), strict=True))
