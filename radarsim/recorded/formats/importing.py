"""`radarsim import`: a recording into a CSV of plots in our columns, with several tracks in one file.

Records are read, placed and written in batches, so that memory does not grow with the file; only the truth is held, for
lookup by time. The file is written completely or not at all."""

import codecs
import datetime
import gzip
import io
import math
import os
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, cast, get_args

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language import speaking, term, tr
from radarsim.recorded import fit
from radarsim.recorded.formats import asterix, logs
from radarsim.recorded.formats import sites as ais
from radarsim.recorded.formats.asterix import Asterix
from radarsim.recorded.formats.sites import (
    BIASES,
    DAY_S,
    PLOTS,
    POSITIONS,
    Ais,
    Antenna,
    Batch,
    Reader,
    Site,
    biconical,
    counted,
    described,
    utc_s,
)
from radarsim.recorded.formats.text import Sheet, Table, comma_separated
from radarsim.recorded.identity import (
    FARTHEST_M,
    FARTHEST_RAD,
    KINDS,
    LONGEST_GAP_S,
    Paths,
    apart,
    are_far,
    distance,
    offsets,
    owned,
)
from radarsim.recorded.plots import cells, grouped
from radarsim.report.files import Writer

Format = Literal["asterix", "opensky", "ais", "csv", "json", "parquet", "gpx", "nmea"]
FORMATS: tuple[Format, ...] = get_args(Format)
SHEETS: dict[Format, Callable[[str, io.BufferedReader], Sheet]] = {
    "json": logs.from_json,
    "parquet": logs.from_parquet,
    "gpx": logs.from_gpx,
    "nmea": logs.from_nmea,
}
HEAD = 4096  # bytes used to detect the format
ZIPPED = b"\x1f\x8b"  # how gzip begins
MOST_LISTED = 12
CONTRADICTS_M = 100.0  # of two places of a radar; a geoid is that far from the ellipsoid
NOT_LATER = term("rows not later than the one before of their track")
ELSEWHERE = term("rows of radar #/#, whose place neither it nor --at says")
BESIDE = {PLOTS: term("plots beside positions"), POSITIONS: term("positions beside plots")}
AT_SEA_LEVEL = term("positions without altitude, placed at sea level: {count} of {all}")
UNPLACED = term(
    "plots without height, or with one that their range cannot have: {count} of {all}; x_m, y_m, z_m are empty there"
)
BEHIND = term(
    "plots behind the antenna or without height: {count} of {all}; elevation_rad and azimuth_rad are empty there"
)
UNNAMED = term("plots of no track, which `radarsim track` skips: {count} of {all}")
LEAST_DATED_S = 1e8  # since 1970; smaller times count from anywhere
MOST_BIAS = dict(zip(BIASES, (1e6, 0.5, math.pi, DAY_S), strict=True))  # in size
DOPPLER_TESTS, LEAST_TESTS = 3000, 20  # rows on which sign and folding of the Doppler speed are tested
DOPPLER = ("t_s", "range_m", "velocity_mps")
PLACED = ("range_m", "bearing_rad", "velocity_mps")
LOCAL = ("x_m", "y_m", "z_m")
SPEEDS = ("vx_mps", "vy_mps", "vz_mps")


@dataclass(frozen=True)
class Options:
    """How to read a recording.

    format: detected from the content where None. site: place of the radar; sites: place of each radar of a recording of
    several, by SAC/SIC, others are left out. antenna: its normal, for the angles that `multimodel` takes. tracks: those
    to write, all where empty. zero: origin of t_s, "first" (record), "midnight" (of the first record's day, UTC) or s
    from 1970. truth: a second recording, of positions. towards: Doppler speeds are positive where the range falls.
    columns: of a CSV, theirs by ours. encoding: of text that is neither UTF-8 nor UTF-16, Windows-1252 where none is
    named. keep_marked: records of no aircraft (asterix.NO_AIRCRAFT) are in tracks and truth too. whose: the track,
    address, callsign or code of the plots whose truth is the one path of the second recording, for receivers that know
    nothing of these. biases: of plots, by BIASES, to be subtracted."""

    format: Format | None = None
    site: Site | None = None
    sites: Mapping[str, Site] = field(default_factory=dict)
    antenna: Antenna | None = None
    tracks: tuple[str, ...] = ()
    zero: str | float = "first"
    truth: str | None = None
    whose: str = ""
    towards: bool = False
    columns: Mapping[str, str] = field(default_factory=dict)
    encoding: str = ""
    keep_marked: bool = False
    biases: Mapping[str, float] = field(default_factory=dict)

    @property
    def only_site(self) -> Site | None:
        """The place of the radar, if it is one."""
        return next(iter(self.sites.values())) if len(self.sites) == 1 else self.site


@dataclass
class Imported:
    """Result of an import: format, records read, rows written, rows by track, counts of skipped records."""

    format: Format
    records: int = 0
    rows: int = 0
    tracks: dict[str, int] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    columns: tuple[str, ...] = ()


MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
NAMED = {  # as spreadsheets write them
    **dict.fromkeys(("utf-16", "utf-16-le", "utf-16-be"), "UTF-16"),
    **{"utf-8-sig": "UTF-8", "cp1252": "Windows-1252"},
}


def encoding_of(path: str | os.PathLike, named: str) -> str:
    """The encoding of a text file: UTF-16 by its mark or zeros, else UTF-8, or the one named where it is not UTF-8."""
    if not os.path.isfile(path):  # a stream is read once
        return named or "utf-8-sig"
    with unzipped(path) as file:
        head = file.peek(HEAD)[:HEAD]
        if head[:2] in MARKS:
            return "utf-16"
        even, odd = head[::2].count(0), head[1::2].count(0)
        if max(even, odd) > max(10 * min(even, odd), len(head) / 10):  # for digits and commas one byte of two is zero
            return "utf-16-le" if odd > even else "utf-16-be"
        decoder = codecs.getincrementaldecoder("utf-8")()
        try:
            while piece := file.read(1 << 20):
                decoder.decode(piece)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return named or "cp1252"
    return "utf-8-sig"


@contextmanager
def unzipped(path: str | os.PathLike) -> Iterator["io.BufferedReader[Any]"]:
    """The bytes of a file, of a gzipped one those inside."""
    with open(path, "rb") as file:
        if file.peek(2)[:2] != ZIPPED:
            yield file
        else:
            with io.BufferedReader(cast(io.RawIOBase, gzip.open(file))) as inside:
                yield inside


@contextmanager
def opened(path: str, options: Options, truth: bool = False) -> Iterator[tuple[Format, Reader]]:
    """The reader of a recording, by the given format or the one that its first bytes show; raises ConfigError.

    truth: only the positions of an ASTERIX file are needed."""
    encoding = "utf-8-sig"
    try:
        with unzipped(path) as file:
            head = file.peek(HEAD)[:HEAD]
            kind = options.format or found(path, head)
            if kind == "asterix":
                yield kind, Asterix(path, file, truth, options.keep_marked)
            elif kind == "ais":
                yield kind, Ais(path, file)
            elif kind in SHEETS:
                yield kind, Table(SHEETS[kind](path, file), options.columns)
            else:
                encoding = encoding_of(path, options.encoding)
                text = io.TextIOWrapper(file, encoding=encoding, newline="")
                yield kind, Table(comma_separated(path, text, NAMED.get(encoding, encoding)), options.columns)
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not {NAMED.get(encoding, encoding)} text: --encoding NAME names it") from error
    except (EOFError, zlib.error) as error:
        raise ConfigError(f"{path}: is damaged: {error}") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error


def found(path: str, head: bytes) -> Format:
    """The format that the first bytes of a file show; raises ConfigError."""
    if not head:
        raise ConfigError(f"{path}: is empty")
    if head[:2] in MARKS:
        head = head.decode("utf-16", "ignore").encode()
    if ais.SENTENCE.search(head):
        return "ais"
    if logs.RECEIVER.search(head):
        return "nmea"
    if head.startswith(b"PAR1"):
        return "parquet"
    start = head.removeprefix(codecs.BOM_UTF8).lstrip()
    if start.startswith(b"<") and b"<gpx" in head:
        return "gpx"
    if start.startswith((b"{", b"[")):
        return "json"
    text = b"\0" not in head and sum(byte < 9 or 13 < byte < 32 for byte in head) == 0
    lines = [line for line in head.splitlines() if line.strip() and not line.startswith(b"#")]
    if text and lines[:1] and lines[0].startswith((b"MSG,", b"STA,", b"AIR,", b"SEL,", b"ID,", b"CLK,")):
        raise ConfigError(f"{path}:1: must have a header; lines such as MSG,3,… are those of a BaseStation port (SBS): "
                          "give them one with time, icao24, lat, lon, alt")  # fmt: skip
    if text and lines and any(sign in lines[0] for sign in (b",", b";", b"\t")):
        names = lines[0].lower()
        return "opensky" if b"icao24" in names and b"lat" in names else "csv"
    if not text and asterix.looks_like(head):
        return "asterix"
    raise ConfigError(f"{path}: must be a recording in one of {', '.join(FORMATS)}; its first bytes are of none: "
                      f"{head[:16].hex(' ')}")  # fmt: skip


def import_recording(
    source: str | os.PathLike,
    output: str | os.PathLike,
    options: Options,
    progress: Callable[[int], None] = lambda records: None,
) -> Imported:
    """Read a recording and write it as plots; raises ConfigError, StoreError, and then leaves no file.

    progress is called from time to time with the number of records read."""
    path = os.fspath(source)
    with opened(path, options) as (kind, reader):
        options, contradictions = placed(options, reader)
        if options.truth and not (options.site or options.sites):
            raise ConfigError("truth: needs the place of the radar, --at LAT,LON,HEIGHT")
        truth = _Truth(path, options) if options.site or options.sites else None
        work = _Import(kind, reader, options, truth)
        with Writer(output, {"the recording": path, "the truth": options.truth}) as file:
            first = True
            for rows in work.rows():
                if first:
                    file.write([(line,) for line in work.comment()])
                    file.write([work.done.columns])
                    first = False
                file.write(rows)
                progress(reader.records)
            with speaking("en"):  # as all faults
                if faults := work.faults() if work.done.rows else [work.nothing()]:
                    raise ConfigError(*faults)
    done = work.finished()
    done.notes = contradictions + done.notes
    return done


def placed(options: Options, reader: Reader) -> tuple[Options, list[str]]:
    """The options with the places of radars that the recording states, and where --at contradicts it."""
    stated = reader.survey.places if isinstance(reader, Asterix) else {}
    sites, said = {name: Site(*place) for name, place in stated.items()}, []
    given = {next(iter(sites)): options.site} if options.site and len(sites) == 1 else options.sites
    for name, site in given.items():
        if name in sites and (far := site.distance_m(sites[name])) > CONTRADICTS_M:
            lat, lon, height = stated[name]
            told = {"name": name, "far": far, "place": f"{lat:.5f},{lon:.5f},{height:.0f}"}
            said.append(tr("--at puts radar {name} {far:.0f} m from where it says it stands, {place} (I034/120); "
                           "--at is taken", **told))  # fmt: skip
    return (options if options.site else replace(options, sites=sites | dict(options.sites))), said


class _Import:
    """An import in progress: batches in, rows out."""

    def __init__(self, kind: Format, reader: Reader, options: Options, truth: "_Truth | None"):
        self.reader, self.options, self.truth = reader, options, truth
        self.done = Imported(kind)
        self.kind: str | None = None  # of the rows
        self.zero: float | None = None
        self.by_track: bool | None = None  # whether tracks are addresses, and nothing else identifies an aircraft
        self.last: dict[str, float] = {}
        self.left = reader.skipped
        self.radars = Counter[str]()
        self.without = Counter[str]()  # by what a note says of these rows
        self.doppler = _Doppler()
        self.seen: set[str] = set()

    def rows(self) -> Iterator[Iterable[tuple[str, ...]]]:
        """The rows of the output, in batches."""
        for batch in self.reader.batches():
            if self.kind is None:
                plots = isinstance(self.reader, Asterix) and self.reader.survey.categories & asterix.OF_RADARS
                self.kind = PLOTS if plots else batch.kind
            if batch.kind != self.kind:
                if batch.kind == PLOTS or self.truth is None or not self.truth.own:
                    self.left[BESIDE[batch.kind]] += len(batch.track)
                continue
            kept = self._kept(self._mended(batch))
            if kept.track:
                yield self._written(kept)

    def _mended(self, batch: Batch) -> Batch:
        """A batch without the biases of the radar, with its sign of the Doppler speed turned, without spans of 0, and
        without plots that have no range."""
        biases, columns = self.options.biases, batch.columns
        if batch.kind == POSITIONS:
            if biases:
                raise ConfigError("bias: is subtracted from plots of a radar; the recording has positions")
            return batch
        if biases:
            bias, scale, turn, lag = (biases.get(name, 0.0) for name in BIASES)
            columns["t_s"] -= lag
            columns["range_m"] = (columns["range_m"] - bias) / (1 + scale)
            columns["bearing_rad"] = (columns["bearing_rad"] - turn) % (2 * math.pi)
        columns["velocity_mps"] *= -1 if self.options.towards else 1
        columns["span_mps"][columns["span_mps"] <= 0] = np.nan
        if (gone := columns["range_m"] <= 0).any():
            self.left[term("plots whose range is not above 0")] += int(gone.sum())
            return batch.rows(np.flatnonzero(~gone).tolist())
        return batch

    def _kept(self, batch: Batch) -> Batch:
        """The records of a batch that are wanted and later than their track's last."""
        wanted, keep = set(self.options.tracks), []
        times = batch.columns["t_s"].tolist()
        for i, (track, radar, t) in enumerate(zip(batch.track, batch.radar, times, strict=True)):
            if len(self.seen) < MOST_LISTED:
                self.seen.add(track)
            if self.options.sites and batch.kind == PLOTS and radar not in self.options.sites:
                self.left[ELSEWHERE.replace("#/#", radar) if radar else term("rows of a radar without a name")] += 1
            elif wanted and track not in wanted:
                self.left[term("rows of other tracks")] += 1
            elif track and t <= self.last.get(track, -math.inf):
                self.left[NOT_LATER] += 1
            else:
                keep.append(i)
                self.last[track] = t
                if batch.kind == PLOTS:
                    self.radars[radar] += 1
                self.done.tracks[track] = self.done.tracks.get(track, 0) + 1
        return batch.rows(keep)

    def _written(self, batch: Batch) -> Iterable[tuple[str, ...]]:
        """The rows of a batch, as text."""
        t = batch.columns["t_s"]
        if self.zero is None:
            self.zero = self._zero(float(t[0]))
        columns = {"t_s": t - self.zero} | self._placed(batch)
        if batch.kind == PLOTS:
            self.doppler.take(batch)
        if self.truth is not None:
            columns |= self.truth.columns(batch, columns, self.reader)
        names = {"track": batch.track}
        if isinstance(self.reader, Asterix):
            names["radar"] = batch.radar
        if self.by_track is None:
            self.by_track = not batch.words and batch.address == [track.lower() for track in batch.track]
        if not self.by_track:
            names |= batch.identity
        if not self.done.columns:
            self.done.columns = ("t_s", *names, *(name for name in columns if name != "t_s"))
        self.done.rows += len(t)
        times, *others = (cells(column) for column in columns.values())
        return zip(times, *names.values(), *others, strict=True)

    def _zero(self, first: float) -> float:
        """The origin of t_s, in the times of the recording."""
        zero = self.options.zero
        if zero == "first":
            return first
        if zero == "midnight":
            return first - first % DAY_S
        zero = float(zero)
        return zero % DAY_S if self.reader.of_day else zero

    def _placed(self, batch: Batch) -> dict[str, np.ndarray]:
        """Range, bearing, velocity and other columns that need the radar's place."""
        site, given = self.options.only_site, batch.columns
        if batch.kind == POSITIONS:
            if site is None:
                raise ConfigError("at: must say where the radar stands, LAT,LON,HEIGHT: the recording has positions "
                                  "on the earth, not ranges")  # fmt: skip
            seen = site.seen(given)
            self.without[AT_SEA_LEVEL] += int(np.isnan(given["altitude_m"]).sum())
            columns = {name: seen[name] for name in (*PLACED, "level_elevation_rad", *LOCAL)}
            return columns | {"altitude_m": given["altitude_m"]} | self._angles(columns)
        columns = {name: given[name] for name in (*PLACED, "span_mps", "altitude_m")}
        if site is None and not self.options.sites:
            return columns
        local = np.full((len(batch.radar), 3), np.nan)
        for name, own in grouped(batch.radar).items():
            place = self.options.sites.get(name) or site
            assert place is not None  # rows of other radars are left out
            local[own] = place.local(*(given[key][own] for key in ("range_m", "bearing_rad", "altitude_m")))
        self.without[UNPLACED] += int(np.isnan(local[:, 1]).sum())
        columns |= {"level_elevation_rad": described(local)["level_elevation_rad"]}
        columns |= dict(zip(LOCAL, local.T, strict=True))
        return columns | self._angles(columns)

    def _angles(self, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        if self.options.antenna is None:
            return {}
        angles = biconical(np.stack([columns[name] for name in LOCAL], axis=-1), self.options.antenna)
        self.without[BEHIND] += int(np.isnan(angles["elevation_rad"]).sum())
        return angles

    def comment(self) -> list[str]:
        """The lines before the header: the meaning of the columns."""
        sites, antenna = dict(self.options.sites), self.options.antenna
        if self.options.site:
            sites[""] = self.options.site
        named = "track: as in the recording"
        if isinstance(self.reader, Asterix):
            named = (
                "track: number or address or A and the Mode 3/A code; radar: SAC/SIC; address: hexadecimal; mode_3a: "
                f"octal; report: what saw the aircraft; marks: {' or '.join(asterix.MARKS)}"
            )
        zero, dated = self.options.zero, self.zero is not None and self.zero >= LEAST_DATED_S
        if not isinstance(zero, str):
            zero = datetime.datetime.fromtimestamp(zero, datetime.UTC).isoformat()
        origin = {"first": "the first record", "midnight": "midnight (UTC) before the first record"}.get(zero, zero)
        epoch = "midnight" if self.reader.of_day else "1970" if dated else "the start of its clock"
        lines = [
            f"# made by radarsim import from a recording in the format {self.done.format}",
            f"# t_s: seconds from {origin} ({self.zero!r} s after {epoch}); {named}",
            "# range_m: slant range; bearing_rad: from north to east; velocity_mps: radial and positive where the "
            "range grows; span_mps: what a folded velocity is ambiguous by",
        ]
        for name, site in sites.items():
            lat, lon, height = site.place
            place = f"{lat:.6f} deg {lon:.6f} deg {height:g} m; x_m north y_m up z_m east of it"
            lines.append(f"# radar{f' {name}' if name else ''} (WGS 84): {place}")
        if sites:
            lines.append("# level_elevation_rad: above the plane that is level at the radar")
        if antenna:
            degrees = " ".join(f"{math.degrees(angle):g} deg" for angle in antenna)
            lines.append(
                f"# elevation_rad and azimuth_rad: from the normal of an antenna at azimuth and elevation {degrees}"
            )
        return lines

    def nothing(self) -> str:
        """The fault of a recording without any row."""
        path, names = self.reader.path, self.options.tracks
        if names and self.seen:
            more = " …" if len(self.seen) >= MOST_LISTED else ""
            return f"{path}: track: must be one of {', '.join(sorted(self.seen))}{more}; got {', '.join(names)}"
        passed = counted(self.left)
        why = f"; left out: {', '.join(passed)}" if passed else ""
        return f"{path}: has no plots; {self.reader.records} records were read{why}"

    def faults(self) -> list[str]:
        """Faults in the rows written, known when all are read."""
        path, found = self.reader.path, []
        if len(self.radars) > 1 and self.options.site:
            names = ", ".join(self.radars)
            found.append(f"at: must say where each radar stands whose plots are wanted, --at SAC/SIC=LAT,LON,HEIGHT: "
                         f"{path} has plots of {len(self.radars)}: {names}")  # fmt: skip
        if isinstance(self.reader, Table) and (asked := self.reader.whose(self.left[NOT_LATER])):
            found.append(asked)
        if self.truth is not None:
            found += self.truth.faults(sorted(self.seen))
        return found

    def finished(self) -> Imported:
        """The result, with notes for the user."""
        done = self.done
        done.records = self.reader.records
        done.skipped = counted(self.left)
        self.without[UNNAMED] = done.tracks.get("", 0)
        done.notes += [tr(what, count=count, all=done.rows) for what, count in self.without.items() if count]
        if len(self.radars) > 1:
            each = ", ".join(f"{name} ({count})" for name, count in self.radars.items())
            done.notes.append(tr("plots of several radars, SAC/SIC (rows): {each}; the tracks of all but the first "
                                 "have its name before their number", each=each))  # fmt: skip
        done.notes += self.reader.notes(self.radars)
        if self.truth is not None:
            done.notes += self.truth.notes()
        done.notes += self.doppler.notes(self.options.towards)
        return done


class _Truth:
    """Truth of each aircraft: positions of the second recording, or of the same one (category 062 beside 048)."""

    def __init__(self, path: str, options: Options):
        self.sites = dict(options.sites)
        self.site = options.site or next(iter(self.sites.values()))  # in whose axes the paths are kept
        self.rows = 0
        self.kinds: Counter[int] = Counter()  # of identity, by their number in KINDS
        self.missed: dict[int, list[np.ndarray]] = {}  # range and bearing, and the range (n, 3), by aircraft
        self.own = options.truth is None
        self.paths = Paths()
        self.whose, self.alone = options.whose, set[str]()
        self.of_day = False
        if self.own:
            self._read_own(path, options)
        else:
            assert options.truth is not None
            own = Options(encoding=options.encoding, keep_marked=options.keep_marked)
            with opened(options.truth, own, truth=True) as (_, reader):
                self._read(reader)
            if not self.paths.paths:
                raise ConfigError(f"{options.truth}: must have positions on the earth of aircraft with an address, a "
                                  f"callsign or a code of their own; has {self.paths.unnamed} without (if all are of "
                                  f"one track ID of the plots: --truth ID={options.truth})")  # fmt: skip
            if self.whose and len(self.alone) > 1:
                raise ConfigError(f"{options.truth}: must be the path of one alone, as {options.whose}= says; has "
                                  f"{', '.join(sorted(self.alone)[:MOST_LISTED])}")  # fmt: skip

    def _read_own(self, path: str, options: Options) -> None:
        """The positions beside the plots of one ASTERIX file; a stream, which is read once, has none."""
        if not os.path.isfile(path):
            self.own = False
            return
        try:
            with opened(path, options, truth=True) as (_, reader):
                if isinstance(reader, Asterix):
                    self._read(reader)
                self.own = isinstance(reader, Asterix) and reader.plots and bool(self.paths.paths)
        except ConfigError:
            self.own = False  # counted when the records are read, with how many there were before
        if not self.own:
            self.paths = Paths()

    def _read(self, reader: Reader) -> None:
        for batch in reader.batches():
            self.of_day = reader.of_day
            if batch.kind == PLOTS:
                continue
            seen = self.site.seen(batch.columns)
            table = np.stack([batch.columns["t_s"], *(seen[name] for name in LOCAL)], axis=-1)
            self.alone.update(batch.track)
            self.paths.add(table, batch.track, {"address": [self.whose] * len(table)} if self.whose else batch.identity)

    def columns(self, batch: Batch, seen: Mapping[str, np.ndarray], reader: Reader) -> dict[str, np.ndarray]:
        """The truth at the times of plots (n,) seen there: range, bearing, velocity, place, speeds (n,)."""
        if not self.paths.paths:
            return {}
        if reader.of_day != self.of_day:
            self.paths.period_s = DAY_S
        states = np.empty((len(batch.track), 6))
        for radar, own in grouped(batch.radar).items():
            site, one = self.sites.get(radar, self.site), batch.rows(own.tolist())
            t, r, b = one.columns["t_s"], seen["range_m"][own], seen["bearing_rad"][own]
            identity = owned(self.whose, one.track, one.identity)
            found = self.paths.find(t, r, b, identity, partial(site.turned, self.site))
            states[own] = found.states
            self.kinds.update(found.kind[found.kind >= 0].tolist())
            missed = np.column_stack([offsets(found.states, r, b), r])
            for number, rows in grouped(found.path.tolist()).items():
                if number >= 0:
                    self.missed.setdefault(number, []).append(missed[rows])
        self.rows += len(states)
        true = described(states[:, :3])
        radial = np.einsum("ni,ni->n", states[:, :3], states[:, 3:]) / true["range_m"]
        # Named like the components of the studies' filters.
        columns = {"r_m": true["range_m"], "Vr_mps": radial, "b_rad": true["bearing_rad"]}
        columns |= dict(zip((*LOCAL, *SPEEDS), states.T, strict=True))
        return {f"true_{name}": column for name, column in columns.items()}

    def faults(self, tracks: Sequence[str]) -> list[str]:
        """Signs that the truth is not that of the plots; tracks: some of theirs."""
        found, names = [], self.paths.names()
        if names and not self.missed and not self.own:
            more = " …" if len(names) > MOST_LISTED else ""
            plots = tracks if self.whose else sorted(next(filter(None, one), "") for one in self.paths.asked)
            found.append(f"truth: no plot has the address, the callsign or the code of an aircraft in it at that time "
                         f"and place; it has {', '.join(names[:MOST_LISTED])}{more}, the plots "
                         f"{', '.join(list(filter(None, plots))[:MOST_LISTED]) or 'no names'}")  # fmt: skip
        for number, parts in self.missed.items():
            missed = np.concatenate(parts)
            if are_far(missed[:, :2], missed[:, 2]):
                most = f"{FARTHEST_M:g} m, and in bearing {math.degrees(FARTHEST_RAD):g}° more than these make"
                far = distance(*apart(missed[:, :2]))
                found.append(f"truth: the plots of {names[number]} lie {far} from it (median), allowed are "
                             f"{most}: it is another aircraft or clock, or --at is wrong")  # fmt: skip
        return found

    def notes(self) -> list[str]:
        """How many of the plots have a truth, and how far they are from it."""
        if not self.missed:
            return [tr("truth: of no plot")] if self.paths.paths else []
        missed = np.concatenate([one for own in self.missed.values() for one in own])
        by = ", ".join(f"{KINDS[k]} {count}" for k, count in sorted(self.kinds.items()))
        told = {"distance": distance(*apart(missed[:, :2])), "by": by}
        said = term("truth: of {count} of {all} plots ({share:.0f} %; by {by}), which lie {distance} from it (median)")
        return [tr(said, count=len(missed), all=self.rows, share=100 * len(missed) / self.rows, **told)]


class _Doppler:
    """The first rows of tracks, on which sign and folding of their Doppler speeds are tested."""

    def __init__(self) -> None:
        self.rows: dict[str, list[np.ndarray]] = {}
        self.count = 0

    def take(self, batch: Batch) -> None:
        """Keep a batch, while there are fewer than DOPPLER_TESTS rows."""
        if self.count >= DOPPLER_TESTS:
            return
        table = np.stack([batch.columns[name] for name in (*DOPPLER, "span_mps")], axis=1)
        usable = np.isfinite(table[:, :3]).all(axis=1)
        self.count += int(usable.sum())
        for name, rows in grouped(batch.track).items():
            if name:
                self.rows.setdefault(name, []).append(table[rows][usable[rows]])

    def notes(self, towards: bool) -> list[str]:
        """Notes for the user if the other sign fits the rate of the range clearly better, and of folded speeds."""
        tracks, found = [np.concatenate(parts) for parts in self.rows.values()], []
        misses = np.abs(np.concatenate([np.empty((2, 0)), *map(_misses, tracks)], axis=1))
        if misses.shape[1] >= LEAST_TESTS:
            as_is, turned = np.median(misses, axis=1).tolist()
            if turned < 0.5 * as_is:
                cure = tr("leave out --doppler-towards") if towards else tr("give --doppler-towards")
                told = {"as_is": as_is, "turned": turned, "cure": cure}
                found = [tr("the Doppler speeds miss the change of the range by {as_is:.1f} m/s (median), with the "
                            "other sign by {turned:.1f} m/s: {cure}", **told)]  # fmt: skip
        plain = [dict(zip(DOPPLER, one[np.isnan(one[:, 3]), :3].T, strict=True)) for one in tracks]
        folded = fit.folding(plain)
        return found if folded is None else [*found, fit.said(folded)]


def _misses(track: np.ndarray) -> np.ndarray:
    """By how much the speeds of a track (n, 4) and the opposite ones miss the rates of its range (2, m), m/s, but for
    whole spans."""
    (dt, dr, *_), (v, span) = np.diff(track, axis=0).T, track[1:, 2:].T
    near = (dt > 0) & (dt < LONGEST_GAP_S)
    off = np.stack([v, -v])[:, near] - dr[near] / dt[near]
    return off - np.nan_to_num(span[near] * np.rint(off / span[near]))


def zero_of(text: str) -> str | float:
    """The origin of t_s: "first", "midnight", or a date and time of ISO 8601 (UTC) as s from 1970."""
    if text in ("first", "midnight"):
        return text
    try:
        return utc_s(text)
    except ValueError:
        raise ConfigError(f"time-from: must be first, midnight or a date and time (ISO 8601), got {text!r}") from None


def truth_of(text: str | None) -> tuple[str | None, str]:
    """The file and the owner of `[ID=]FILE`."""
    whose, sign, path = (text or "").rpartition("=")
    return (text, "") if not sign or os.path.exists(text or "") else (path, whose.strip())


def encoding_named(name: str) -> str:
    """An encoding of text by its name."""
    try:
        "".encode(name or "utf-8")
    except (LookupError, ValueError):
        raise ConfigError(
            f"encoding: must be an encoding such as cp1251, iso8859-2 or mac-roman, got {name!r}"
        ) from None
    return name


def biases_of(texts: Sequence[str]) -> dict[str, float]:
    """Biases that the user states, `KEY=VALUE` each, by BIASES."""
    found, faults = {}, []
    for text in texts:
        key, _, number = text.partition("=")
        name = key.strip().replace("_deg", "_rad")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        value = math.radians(value) if key.strip().endswith("_deg") else value
        if name in found or not abs(value) <= MOST_BIAS.get(name, -1.0):
            must = "must be range_m=NUMBER, range_scale=…, bearing_deg=… or time_s=…, each once; their size is"
            faults.append(f"bias: {must} {MOST_BIAS['range_m']:g} m, {MOST_BIAS['range_scale']:g}, 180 deg and "
                          f"{MOST_BIAS['time_s']:g} s at most; got {text!r}")  # fmt: skip
        found[name] = value
    if faults:
        raise ConfigError(*faults)
    return found


def columns_of(texts: Sequence[str]) -> dict[str, str]:
    """Columns assigned by the user, `OURS=THEIRS` each."""
    faults = [text for text in texts if "=" not in text]
    if faults:
        raise ConfigError(*(f"column: must be OURS=THEIRS, got {text!r}" for text in faults))
    return {ours.strip(): theirs.strip() for ours, _, theirs in (text.partition("=") for text in texts)}
