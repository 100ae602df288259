"""Import a recording as a CSV file of plots in our columns, with several tracks in one file.

Records are read, placed and written in batches, so that memory does not grow with the file; only the truth is kept in
memory, to be looked up by time. The file is written completely or not at all."""

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
    antenna_angles,
    position_columns,
    skip_counts,
    utc_s,
)
from radarsim.recorded.formats.text import Sheet, Table, read_csv
from radarsim.recorded.identity import (
    KINDS,
    MAX_BEARING_OFFSET_RAD,
    MAX_GAP_S,
    MAX_RANGE_OFFSET_M,
    AircraftPaths,
    are_far,
    assign_owner,
    distance,
    median_offsets,
    range_bearing_offsets,
)
from radarsim.recorded.plots import column_texts, rows_by_name
from radarsim.report.files import Writer

Format = Literal["asterix", "opensky", "ais", "csv", "json", "parquet", "gpx", "nmea"]
FORMATS: tuple[Format, ...] = get_args(Format)
SHEET_READERS: dict[Format, Callable[[str, io.BufferedReader], Sheet]] = {
    "json": logs.read_json,
    "parquet": logs.read_parquet,
    "gpx": logs.read_gpx,
    "nmea": logs.read_nmea,
}
HEAD_BYTES = 4096  # bytes used to detect the format
GZIP_MAGIC = b"\x1f\x8b"  # how gzip begins
MAX_LISTED = 12
MAX_SITE_DISTANCE_M = 100.0  # of two places of a radar; a geoid is that far from the ellipsoid
NOT_LATER_REASON = term("rows not later than the one before of their track")
UNKNOWN_RADAR_REASON = term("rows of radar #/#, whose place neither it nor --at says")
OTHER_KIND_REASONS = {PLOTS: term("plots beside positions"), POSITIONS: term("positions beside plots")}
SEA_LEVEL_NOTE = term("positions without altitude, placed at sea level: {count} of {all}")
NO_HEIGHT_NOTE = term(
    "plots without height, or with one that their range cannot have: {count} of {all}; x_m, y_m, z_m are empty there"
)
BEHIND_ANTENNA_NOTE = term(
    "plots behind the antenna or without height: {count} of {all}; elevation_rad and azimuth_rad are empty there"
)
NO_TRACK_NOTE = term("plots of no track, which `radarsim track` skips: {count} of {all}")
MIN_DATED_S = 1e8  # since 1970; smaller times count from anywhere
MAX_BIAS = dict(zip(BIASES, (1e6, 0.5, math.pi, DAY_S), strict=True))  # in size
DOPPLER_ROWS, MIN_DOPPLER_ROWS = 3000, 20  # rows on which sign and folding of the Doppler speed are tested
DOPPLER_COLUMNS = ("t_s", "range_m", "velocity_mps")
MEASURED_COLUMNS = ("range_m", "bearing_rad", "velocity_mps")
LOCAL_COLUMNS = ("x_m", "y_m", "z_m")
VELOCITY_COLUMNS = ("vx_mps", "vy_mps", "vz_mps")


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
    owner: str = ""
    towards: bool = False
    columns: Mapping[str, str] = field(default_factory=dict)
    encoding: str = ""
    keep_marked: bool = False
    biases: Mapping[str, float] = field(default_factory=dict)

    @property
    def only_site(self) -> Site | None:
        """The site of the radar, if there is only one."""
        return next(iter(self.sites.values())) if len(self.sites) == 1 else self.site


@dataclass
class ImportResult:
    """Result of an import: format, records read, rows written, rows by track, skipped records, notes."""

    format: Format
    records: int = 0
    rows: int = 0
    tracks: dict[str, int] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    columns: tuple[str, ...] = ()


UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
ENCODING_NAMES = {  # as spreadsheets write them
    **dict.fromkeys(("utf-16", "utf-16-le", "utf-16-be"), "UTF-16"),
    **{"utf-8-sig": "UTF-8", "cp1252": "Windows-1252"},
}


def detect_encoding(path: str | os.PathLike, fallback: str) -> str:
    """The encoding of a text file: UTF-16 by its mark or zeros, else UTF-8; if it is not UTF-8, the fallback."""
    if not os.path.isfile(path):  # a stream is read once
        return fallback or "utf-8-sig"
    with open_unzipped(path) as file:
        head = file.peek(HEAD_BYTES)[:HEAD_BYTES]
        if head[:2] in UTF16_MARKS:
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
            return fallback or "cp1252"
    return "utf-8-sig"


@contextmanager
def open_unzipped(path: str | os.PathLike) -> Iterator["io.BufferedReader[Any]"]:
    """Open a file of bytes; a gzipped one is unzipped."""
    with open(path, "rb") as file:
        if file.peek(2)[:2] != GZIP_MAGIC:
            yield file
        else:
            with io.BufferedReader(cast(io.RawIOBase, gzip.open(file))) as inside:
                yield inside


@contextmanager
def open_recording(path: str, options: Options, truth: bool = False) -> Iterator[tuple[Format, Reader]]:
    """Open a recording with the reader of the given format, or of the detected one; raises ConfigError.

    truth: only the positions of an ASTERIX file are needed."""
    encoding = "utf-8-sig"
    try:
        with open_unzipped(path) as file:
            head = file.peek(HEAD_BYTES)[:HEAD_BYTES]
            format_ = options.format or detect_format(path, head)
            if format_ == "asterix":
                yield format_, Asterix(path, file, truth, options.keep_marked)
            elif format_ == "ais":
                yield format_, Ais(path, file)
            elif format_ in SHEET_READERS:
                yield format_, Table(SHEET_READERS[format_](path, file), options.columns)
            else:
                encoding = detect_encoding(path, options.encoding)
                text = io.TextIOWrapper(file, encoding=encoding, newline="")
                yield format_, Table(read_csv(path, text, ENCODING_NAMES.get(encoding, encoding)), options.columns)
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"{path}: is not {ENCODING_NAMES.get(encoding, encoding)} text: --encoding NAME names it"
        ) from error
    except (EOFError, zlib.error) as error:
        raise ConfigError(f"{path}: is damaged: {error}") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error


def detect_format(path: str, head: bytes) -> Format:
    """Detect the format of a file from its first bytes; raises ConfigError."""
    if not head:
        raise ConfigError(f"{path}: is empty")
    if head[:2] in UTF16_MARKS:
        head = head.decode("utf-16", "ignore").encode()
    if ais.SENTENCE_PATTERN.search(head):
        return "ais"
    if logs.SENTENCE_PATTERN.search(head):
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
) -> ImportResult:
    """Read a recording and write it as plots; raises ConfigError, StoreError, and then leaves no file.

    progress is called from time to time with the number of records read."""
    path = os.fspath(source)
    with open_recording(path, options) as (format_, reader):
        options, contradictions = add_stated_sites(options, reader)
        if options.truth and not (options.site or options.sites):
            raise ConfigError("truth: needs the place of the radar, --at LAT,LON,HEIGHT")
        truth = AircraftTruth(path, options) if options.site or options.sites else None
        work = _Import(format_, reader, options, truth)
        with Writer(output, {"the recording": path, "the truth": options.truth}) as file:
            first = True
            for rows in work.rows():
                if first:
                    file.write([(line,) for line in work.comment()])
                    file.write([work.result.columns])
                    first = False
                file.write(rows)
                progress(reader.records)
            with speaking("en"):  # as all faults
                if faults := work.faults() if work.result.rows else [work.no_rows_fault()]:
                    raise ConfigError(*faults)
    result = work.finish()
    result.notes = contradictions + result.notes
    return result


def add_stated_sites(options: Options, reader: Reader) -> tuple[Options, list[str]]:
    """Add the sites of radars that the recording states to the options; also notes where --at contradicts it."""
    stated_places = reader.survey.positions if isinstance(reader, Asterix) else {}
    sites, notes = {name: Site(*place) for name, place in stated_places.items()}, []
    given_sites = {next(iter(sites)): options.site} if options.site and len(sites) == 1 else options.sites
    for name, site in given_sites.items():
        if name in sites and (distance_m := site.distance_m(sites[name])) > MAX_SITE_DISTANCE_M:
            lat, lon, height = stated_places[name]
            fields = {"name": name, "far": distance_m, "place": f"{lat:.5f},{lon:.5f},{height:.0f}"}
            notes.append(tr("--at puts radar {name} {far:.0f} m from where it says it stands, {place} (I034/120); "
                           "--at is taken", **fields))  # fmt: skip
    return (options if options.site else replace(options, sites=sites | dict(options.sites))), notes


class _Import:
    """An import in progress: batches in, rows out."""

    def __init__(self, format_: Format, reader: Reader, options: Options, truth: "AircraftTruth | None"):
        self.reader, self.options, self.truth = reader, options, truth
        self.result = ImportResult(format_)
        self.kind: str | None = None  # of the rows
        self.zero: float | None = None
        self.tracks_are_addresses: bool | None = (
            None  # whether tracks are addresses, and nothing else identifies an aircraft
        )
        self.last_times: dict[str, float] = {}
        self.skipped = reader.skipped
        self.radars = Counter[str]()
        self.note_counts = Counter[str]()  # by what a note says of these rows
        self.doppler = DopplerCheck()
        self.track_names: set[str] = set()

    def rows(self) -> Iterator[Iterable[tuple[str, ...]]]:
        """The rows of the output, in batches."""
        for batch in self.reader.batches():
            if self.kind is None:
                has_plots = (
                    isinstance(self.reader, Asterix) and self.reader.survey.categories & asterix.RADAR_CATEGORIES
                )
                self.kind = PLOTS if has_plots else batch.kind
            if batch.kind != self.kind:
                if batch.kind == PLOTS or self.truth is None or not self.truth.is_same_file:
                    self.skipped[OTHER_KIND_REASONS[batch.kind]] += len(batch.track)
                continue
            selected = self._select_rows(self._correct(batch))
            if selected.track:
                yield self._row_texts(selected)

    def _correct(self, batch: Batch) -> Batch:
        """A batch without the biases of the radar, with its sign of the Doppler speed turned, without spans of 0, and
        without plots that have no range."""
        biases, columns = self.options.biases, batch.columns
        if batch.kind == POSITIONS:
            if biases:
                raise ConfigError("bias: is subtracted from plots of a radar; the recording has positions")
            return batch
        if biases:
            range_bias, range_scale, bearing_bias, time_bias = (biases.get(name, 0.0) for name in BIASES)
            columns["t_s"] -= time_bias
            columns["range_m"] = (columns["range_m"] - range_bias) / (1 + range_scale)
            columns["bearing_rad"] = (columns["bearing_rad"] - bearing_bias) % (2 * math.pi)
        columns["velocity_mps"] *= -1 if self.options.towards else 1
        columns["span_mps"][columns["span_mps"] <= 0] = np.nan
        if (is_invalid := columns["range_m"] <= 0).any():
            self.skipped[term("plots whose range is not above 0")] += int(is_invalid.sum())
            return batch.rows(np.flatnonzero(~is_invalid).tolist())
        return batch

    def _select_rows(self, batch: Batch) -> Batch:
        """Select the records of a batch that are requested, and later than the last of their track."""
        requested, rows = set(self.options.tracks), []
        times = batch.columns["t_s"].tolist()
        for i, (track, radar, t) in enumerate(zip(batch.track, batch.radar, times, strict=True)):
            if len(self.track_names) < MAX_LISTED:
                self.track_names.add(track)
            if self.options.sites and batch.kind == PLOTS and radar not in self.options.sites:
                self.skipped[
                    UNKNOWN_RADAR_REASON.replace("#/#", radar) if radar else term("rows of a radar without a name")
                ] += 1
            elif requested and track not in requested:
                self.skipped[term("rows of other tracks")] += 1
            elif track and t <= self.last_times.get(track, -math.inf):
                self.skipped[NOT_LATER_REASON] += 1
            else:
                rows.append(i)
                self.last_times[track] = t
                if batch.kind == PLOTS:
                    self.radars[radar] += 1
                self.result.tracks[track] = self.result.tracks.get(track, 0) + 1
        return batch.rows(rows)

    def _row_texts(self, batch: Batch) -> Iterable[tuple[str, ...]]:
        """The rows of a batch, as text."""
        t = batch.columns["t_s"]
        if self.zero is None:
            self.zero = self._time_zero(float(t[0]))
        columns = {"t_s": t - self.zero} | self._add_places(batch)
        if batch.kind == PLOTS:
            self.doppler.add(batch)
        if self.truth is not None:
            columns |= self.truth.columns(batch, columns, self.reader)
        names = {"track": batch.track}
        if isinstance(self.reader, Asterix):
            names["radar"] = batch.radar
        if self.tracks_are_addresses is None:
            self.tracks_are_addresses = not batch.texts and batch.address == [track.lower() for track in batch.track]
        if not self.tracks_are_addresses:
            names |= batch.identity
        if not self.result.columns:
            self.result.columns = ("t_s", *names, *(name for name in columns if name != "t_s"))
        self.result.rows += len(t)
        times, *other_columns = (column_texts(column) for column in columns.values())
        return zip(times, *names.values(), *other_columns, strict=True)

    def _time_zero(self, first: float) -> float:
        """The origin of t_s, in the times of the recording."""
        zero = self.options.zero
        if zero == "first":
            return first
        if zero == "midnight":
            return first - first % DAY_S
        zero = float(zero)
        return zero % DAY_S if self.reader.of_day else zero

    def _add_places(self, batch: Batch) -> dict[str, np.ndarray]:
        """Range, bearing, velocity and other columns that need the radar's place."""
        site, batch_columns = self.options.only_site, batch.columns
        if batch.kind == POSITIONS:
            if site is None:
                raise ConfigError("at: must say where the radar stands, LAT,LON,HEIGHT: the recording has positions "
                                  "on the earth, not ranges")  # fmt: skip
            measured = site.measure(batch_columns)
            self.note_counts[SEA_LEVEL_NOTE] += int(np.isnan(batch_columns["altitude_m"]).sum())
            columns = {name: measured[name] for name in (*MEASURED_COLUMNS, "level_elevation_rad", *LOCAL_COLUMNS)}
            return columns | {"altitude_m": batch_columns["altitude_m"]} | self._antenna_angles(columns)
        columns = {name: batch_columns[name] for name in (*MEASURED_COLUMNS, "span_mps", "altitude_m")}
        if site is None and not self.options.sites:
            return columns
        local = np.full((len(batch.radar), 3), np.nan)
        for name, rows in rows_by_name(batch.radar).items():
            radar_site = self.options.sites.get(name) or site
            assert radar_site is not None  # rows of other radars are left out
            local[rows] = radar_site.local_positions(
                *(batch_columns[key][rows] for key in ("range_m", "bearing_rad", "altitude_m"))
            )
        self.note_counts[NO_HEIGHT_NOTE] += int(np.isnan(local[:, 1]).sum())
        columns |= {"level_elevation_rad": position_columns(local)["level_elevation_rad"]}
        columns |= dict(zip(LOCAL_COLUMNS, local.T, strict=True))
        return columns | self._antenna_angles(columns)

    def _antenna_angles(self, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        if self.options.antenna is None:
            return {}
        angles = antenna_angles(np.stack([columns[name] for name in LOCAL_COLUMNS], axis=-1), self.options.antenna)
        self.note_counts[BEHIND_ANTENNA_NOTE] += int(np.isnan(angles["elevation_rad"]).sum())
        return angles

    def comment(self) -> list[str]:
        """The lines before the header: the meaning of the columns."""
        sites, antenna = dict(self.options.sites), self.options.antenna
        if self.options.site:
            sites[""] = self.options.site
        track_line = "track: as in the recording"
        if isinstance(self.reader, Asterix):
            track_line = (
                "track: number or address or A and the Mode 3/A code; radar: SAC/SIC; address: hexadecimal; mode_3a: "
                f"octal; report: what saw the aircraft; marks: {' or '.join(asterix.MARKS)}"
            )
        zero, is_dated = self.options.zero, self.zero is not None and self.zero >= MIN_DATED_S
        if not isinstance(zero, str):
            zero = datetime.datetime.fromtimestamp(zero, datetime.UTC).isoformat()
        origin = {"first": "the first record", "midnight": "midnight (UTC) before the first record"}.get(zero, zero)
        epoch = "midnight" if self.reader.of_day else "1970" if is_dated else "the start of its clock"
        lines = [
            f"# made by radarsim import from a recording in the format {self.result.format}",
            f"# t_s: seconds from {origin} ({self.zero!r} s after {epoch}); {track_line}",
            "# range_m: slant range; bearing_rad: from north to east; velocity_mps: radial and positive where the "
            "range grows; span_mps: what a folded velocity is ambiguous by",
        ]
        for name, site in sites.items():
            lat, lon, height = site.coordinates
            position = f"{lat:.6f} deg {lon:.6f} deg {height:g} m; x_m north y_m up z_m east of it"
            lines.append(f"# radar{f' {name}' if name else ''} (WGS 84): {position}")
        if sites:
            lines.append("# level_elevation_rad: above the plane that is level at the radar")
        if antenna:
            degrees = " ".join(f"{math.degrees(angle):g} deg" for angle in antenna)
            lines.append(
                f"# elevation_rad and azimuth_rad: from the normal of an antenna at azimuth and elevation {degrees}"
            )
        return lines

    def no_rows_fault(self) -> str:
        """The fault of a recording without any row."""
        path, names = self.reader.path, self.options.tracks
        if names and self.track_names:
            ellipsis = " …" if len(self.track_names) >= MAX_LISTED else ""
            return (
                f"{path}: track: must be one of {', '.join(sorted(self.track_names))}{ellipsis}; got {', '.join(names)}"
            )
        reasons = skip_counts(self.skipped)
        why = f"; left out: {', '.join(reasons)}" if reasons else ""
        return f"{path}: has no plots; {self.reader.records} records were read{why}"

    def faults(self) -> list[str]:
        """Faults in the rows written, known when all are read."""
        path, faults = self.reader.path, []
        if len(self.radars) > 1 and self.options.site:
            names = ", ".join(self.radars)
            faults.append(f"at: must say where each radar stands whose plots are wanted, --at SAC/SIC=LAT,LON,HEIGHT: "
                         f"{path} has plots of {len(self.radars)}: {names}")  # fmt: skip
        if isinstance(self.reader, Table) and (question := self.reader.track_question(self.skipped[NOT_LATER_REASON])):
            faults.append(question)
        if self.truth is not None:
            faults += self.truth.faults(sorted(self.track_names))
        return faults

    def finish(self) -> ImportResult:
        """The result, with notes for the user."""
        result = self.result
        result.records = self.reader.records
        result.skipped = skip_counts(self.skipped)
        self.note_counts[NO_TRACK_NOTE] = result.tracks.get("", 0)
        result.notes += [tr(note, count=count, all=result.rows) for note, count in self.note_counts.items() if count]
        if len(self.radars) > 1:
            counts_by_radar = ", ".join(f"{name} ({count})" for name, count in self.radars.items())
            result.notes.append(tr("plots of several radars, SAC/SIC (rows): {each}; the tracks of all but the first "
                                 "have its name before their number", each=counts_by_radar))  # fmt: skip
        result.notes += self.reader.notes(self.radars)
        if self.truth is not None:
            result.notes += self.truth.notes()
        result.notes += self.doppler.notes(self.options.towards)
        return result


class AircraftTruth:
    """Truth of each aircraft: positions of the second recording, or of the same one (category 062 beside 048)."""

    def __init__(self, path: str, options: Options):
        self.sites = dict(options.sites)
        self.site = options.site or next(iter(self.sites.values()))  # in whose axes the paths are kept
        self.rows = 0
        self.kind_counts: Counter[int] = Counter()  # of identity, by their number in KINDS
        self.offsets_by_path: dict[int, list[np.ndarray]] = {}  # range and bearing, and the range (n, 3), by aircraft
        self.is_same_file = options.truth is None
        self.paths = AircraftPaths()
        self.owner, self.truth_tracks = options.owner, set[str]()
        self.of_day = False
        if self.is_same_file:
            self._read_own(path, options)
        else:
            assert options.truth is not None
            options_of_truth = Options(encoding=options.encoding, keep_marked=options.keep_marked)
            with open_recording(options.truth, options_of_truth, truth=True) as (_, reader):
                self._add_positions(reader)
            if not self.paths.paths:
                raise ConfigError(f"{options.truth}: must have positions on the earth of aircraft with an address, a "
                                  f"callsign or a code of their own; has {self.paths.unidentified} without (if all are "
                                  f"of one track ID of the plots: --truth ID={options.truth})")  # fmt: skip
            if self.owner and len(self.truth_tracks) > 1:
                raise ConfigError(f"{options.truth}: must be the path of one alone, as {options.owner}= says; has "
                                  f"{', '.join(sorted(self.truth_tracks)[:MAX_LISTED])}")  # fmt: skip

    def _read_own(self, path: str, options: Options) -> None:
        """The positions beside the plots of one ASTERIX file; a stream, which is read once, has none."""
        if not os.path.isfile(path):
            self.is_same_file = False
            return
        try:
            with open_recording(path, options, truth=True) as (_, reader):
                if isinstance(reader, Asterix):
                    self._add_positions(reader)
                self.is_same_file = isinstance(reader, Asterix) and reader.has_plots and bool(self.paths.paths)
        except ConfigError:
            self.is_same_file = False  # counted when the records are read, with how many there were before
        if not self.is_same_file:
            self.paths = AircraftPaths()

    def _add_positions(self, reader: Reader) -> None:
        for batch in reader.batches():
            self.of_day = reader.of_day
            if batch.kind == PLOTS:
                continue
            measured = self.site.measure(batch.columns)
            table = np.stack([batch.columns["t_s"], *(measured[name] for name in LOCAL_COLUMNS)], axis=-1)
            self.truth_tracks.update(batch.track)
            self.paths.add(table, batch.track, {"address": [self.owner] * len(table)} if self.owner else batch.identity)

    def columns(self, batch: Batch, plots: Mapping[str, np.ndarray], reader: Reader) -> dict[str, np.ndarray]:
        """The truth at the times of plots (n,): range, bearing, velocity, position and speeds (n,)."""
        if not self.paths.paths:
            return {}
        if reader.of_day != self.of_day:
            self.paths.period_s = DAY_S
        states = np.empty((len(batch.track), 6))
        for radar, rows in rows_by_name(batch.radar).items():
            site, part = self.sites.get(radar, self.site), batch.rows(rows.tolist())
            t, r, b = part.columns["t_s"], plots["range_m"][rows], plots["bearing_rad"][rows]
            identity = assign_owner(self.owner, part.track, part.identity)
            match = self.paths.find(t, r, b, identity, partial(site.rotate_states, self.site))
            states[rows] = match.states
            self.kind_counts.update(match.kind_numbers[match.kind_numbers >= 0].tolist())
            offsets = np.column_stack([range_bearing_offsets(match.states, r, b), r])
            for number, path_rows in rows_by_name(match.path_numbers.tolist()).items():
                if number >= 0:
                    self.offsets_by_path.setdefault(number, []).append(offsets[path_rows])
        self.rows += len(states)
        truth = position_columns(states[:, :3])
        radial = np.einsum("ni,ni->n", states[:, :3], states[:, 3:]) / truth["range_m"]
        # Named like the components of the studies' filters.
        columns = {"r_m": truth["range_m"], "Vr_mps": radial, "b_rad": truth["bearing_rad"]}
        columns |= dict(zip((*LOCAL_COLUMNS, *VELOCITY_COLUMNS), states.T, strict=True))
        return {f"true_{name}": column for name, column in columns.items()}

    def faults(self, tracks: Sequence[str]) -> list[str]:
        """Signs that the truth is not that of the plots; tracks: some of theirs."""
        faults, names = [], self.paths.names()
        if names and not self.offsets_by_path and not self.is_same_file:
            ellipsis = " …" if len(names) > MAX_LISTED else ""
            plots = (
                tracks
                if self.owner
                else sorted(next(filter(None, identities), "") for identities in self.paths.searched_identities)
            )
            faults.append(f"truth: no plot has the address, the callsign or the code of an aircraft in it at that time "
                         f"and place; it has {', '.join(names[:MAX_LISTED])}{ellipsis}, the plots "
                         f"{', '.join(list(filter(None, plots))[:MAX_LISTED]) or 'no names'}")  # fmt: skip
        for number, parts in self.offsets_by_path.items():
            offsets = np.concatenate(parts)
            if are_far(offsets[:, :2], offsets[:, 2]):
                bearing_deg = math.degrees(MAX_BEARING_OFFSET_RAD)
                limits = f"{MAX_RANGE_OFFSET_M:g} m, and in bearing {bearing_deg:g}° more than these make"
                median = distance(*median_offsets(offsets[:, :2]))
                faults.append(f"truth: the plots of {names[number]} lie {median} from it (median), allowed are "
                              f"{limits}: it is another aircraft or clock, or --at is wrong")  # fmt: skip
        return faults

    def notes(self) -> list[str]:
        """Notes on how many plots have a truth, and how far they are from it."""
        if not self.offsets_by_path:
            return [tr("truth: of no plot")] if self.paths.paths else []
        offsets = np.concatenate([part for parts in self.offsets_by_path.values() for part in parts])
        counts_by_kind = ", ".join(f"{KINDS[k]} {count}" for k, count in sorted(self.kind_counts.items()))
        fields = {"distance": distance(*median_offsets(offsets[:, :2])), "by": counts_by_kind}
        message = term(
            "truth: of {count} of {all} plots ({share:.0f} %; by {by}), which lie {distance} from it (median)"
        )
        return [tr(message, count=len(offsets), all=self.rows, share=100 * len(offsets) / self.rows, **fields)]


class DopplerCheck:
    """Check the sign and the folding of Doppler speeds on the first rows of tracks."""

    def __init__(self) -> None:
        self.rows: dict[str, list[np.ndarray]] = {}
        self.count = 0

    def add(self, batch: Batch) -> None:
        """Keep a batch, while there are fewer than DOPPLER_ROWS rows."""
        if self.count >= DOPPLER_ROWS:
            return
        table = np.stack([batch.columns[name] for name in (*DOPPLER_COLUMNS, "span_mps")], axis=1)
        usable = np.isfinite(table[:, :3]).all(axis=1)
        self.count += int(usable.sum())
        for name, rows in rows_by_name(batch.track).items():
            if name:
                self.rows.setdefault(name, []).append(table[rows][usable[rows]])

    def notes(self, towards: bool) -> list[str]:
        """Notes if the opposite sign fits the rate of the range clearly better, and if speeds are folded."""
        tracks, notes = [np.concatenate(parts) for parts in self.rows.values()], []
        offsets = np.abs(np.concatenate([np.empty((2, 0)), *map(_doppler_offsets, tracks)], axis=1))
        if offsets.shape[1] >= MIN_DOPPLER_ROWS:
            offset, opposite_offset = np.median(offsets, axis=1).tolist()
            if opposite_offset < 0.5 * offset:
                cure = tr("leave out --doppler-towards") if towards else tr("give --doppler-towards")
                fields = {"as_is": offset, "turned": opposite_offset, "cure": cure}
                notes = [tr("the Doppler speeds miss the change of the range by {as_is:.1f} m/s (median), with the "
                            "other sign by {turned:.1f} m/s: {cure}", **fields)]  # fmt: skip
        spanless_tracks = [
            dict(zip(DOPPLER_COLUMNS, track[np.isnan(track[:, 3]), :3].T, strict=True)) for track in tracks
        ]
        folding = fit.detect_folding(spanless_tracks)
        return notes if folding is None else [*notes, fit.folding_message(folding)]


def _doppler_offsets(track: np.ndarray) -> np.ndarray:
    """Differences (2, m) of a track's speeds, and of the opposite ones, from the rates of its range, m/s, without whole
    spans."""
    (dt, dr, *_), (v, span) = np.diff(track, axis=0).T, track[1:, 2:].T
    is_close = (dt > 0) & (dt < MAX_GAP_S)
    offsets = np.stack([v, -v])[:, is_close] - dr[is_close] / dt[is_close]
    return offsets - np.nan_to_num(span[is_close] * np.rint(offsets / span[is_close]))


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
    owner, sign, path = (text or "").rpartition("=")
    return (text, "") if not sign or os.path.exists(text or "") else (path, owner.strip())


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
    """Biases given by the user as `KEY=VALUE`, by BIASES."""
    biases, faults = {}, []
    for text in texts:
        key, _, number = text.partition("=")
        name = key.strip().replace("_deg", "_rad")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        value = math.radians(value) if key.strip().endswith("_deg") else value
        if name in biases or not abs(value) <= MAX_BIAS.get(name, -1.0):
            limits = "must be range_m=NUMBER, range_scale=…, bearing_deg=… or time_s=…, each once; their size is"
            faults.append(f"bias: {limits} {MAX_BIAS['range_m']:g} m, {MAX_BIAS['range_scale']:g}, 180 deg and "
                          f"{MAX_BIAS['time_s']:g} s at most; got {text!r}")  # fmt: skip
        biases[name] = value
    if faults:
        raise ConfigError(*faults)
    return biases


def columns_of(texts: Sequence[str]) -> dict[str, str]:
    """Columns assigned by the user as `OURS=THEIRS`."""
    faults = [text for text in texts if "=" not in text]
    if faults:
        raise ConfigError(*(f"column: must be OURS=THEIRS, got {text!r}" for text in faults))
    return {ours.strip(): theirs.strip() for ours, _, theirs in (text.partition("=") for text in texts)}
