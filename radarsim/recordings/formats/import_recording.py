"""Import a recording as a CSV file of plots (`radarsim import`).

Records are read, placed and written in batches, so that memory does not grow with the file; only the truth is kept in
memory, to be looked up by time. A recording whose rows are out of order, or jump, is read again as a whole and sorted.
The file is written completely or not at all."""

import datetime
import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.current import use_language
from radarsim.language.translate import term, tr
from radarsim.recordings import target_speed, track_jumps
from radarsim.recordings.csv_output import column_texts
from radarsim.recordings.fill_values import FILL_NOTES, remove_fills
from radarsim.recordings.formats import asterix, asterix_decode, row_order
from radarsim.recordings.formats.aircraft_truth import LOCAL_COLUMNS, MAX_LISTED, AircraftTruth
from radarsim.recordings.formats.asterix import Asterix
from radarsim.recordings.formats.clock_steps import may_be_small_step
from radarsim.recordings.formats.course_check import CourseCheck
from radarsim.recordings.formats.doppler_check import DopplerCheck
from radarsim.recordings.formats.forward_steps import GapWatch
from radarsim.recordings.formats.import_options import Format, Options
from radarsim.recordings.formats.open_recording import open_recording
from radarsim.recordings.formats.records import BATCH_ROWS, BIASES, DAY_S, PLOTS, POSITIONS, Batch, Reader, skip_counts
from radarsim.recordings.formats.row_order import SAME_TIME_REASON, LaterRows, NeedsAllRows
from radarsim.recordings.formats.site_distance import NO_FIX_REASON, SiteDistance, without_no_fix
from radarsim.recordings.formats.sites import Site, antenna_angles, position_columns
from radarsim.recordings.formats.table import Table
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.target_speed import FastestLegs, TrackPositions
from radarsim.recordings.time_spans import MIN_DATED_S
from radarsim.recordings.track_jumps import CourseFault
from radarsim.report.atomic_files import OutputFile

MAX_SITE_DISTANCE_M = 100.0  # of two places of a radar; a geoid is that far from the ellipsoid
NO_SITE_FAULT = (
    "at: must say where the radar stands, LAT,LON,HEIGHT: the recording has positions on the earth, not ranges"
)
MAX_LOSS = 0.1  # of the rows that may be left out because of others
MAX_STANDING_TRACKS = 20  # whose times stand still once, for which a recording is read again
UNREACHABLE_REASON = term("rows that no target reaches from neighbouring rows")
FILL_REASONS = {
    "range_m": term("rows whose range stands for none, as 65535 again and again"),
    "latitude_deg": term("rows whose latitude stands for none, as 0 again and again"),
    "longitude_deg": term("rows whose longitude stands for none, as 0 again and again"),
}
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
MEASURED_COLUMNS = ("range_m", "bearing_rad", "velocity_mps")


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


def import_recording(
    source: str | os.PathLike,
    output: str | os.PathLike,
    options: Options,
    progress: Callable[[int], None] = lambda records: None,
) -> ImportResult:
    """Read a recording and write it as plots; raises ConfigError, StoreError, and then leaves no file.

    progress is called from time to time with the number of records read."""
    path = os.fspath(source)
    try:
        return _import_rows(path, output, options, progress, not os.path.isfile(path))  # a stream is read once
    except NeedsAllRows:
        return _import_rows(path, output, options, progress, True)


def _import_rows(
    path: str, output: str | os.PathLike, options: Options, progress: Callable[[int], None], all_at_once: bool
) -> ImportResult:
    """Import a recording, batch by batch or all at once; raises NeedsAllRows where that is needed."""
    with open_recording(path, options) as (format_, reader):
        options, contradictions = add_stated_sites(options, reader)
        if options.truth and not (options.site or options.sites):
            raise ConfigError("truth: needs the place of the radar, --at LAT,LON,HEIGHT")
        has_truth = bool(options.site or options.sites) and (options.truth or not _lacks_full_times(reader))
        truth = AircraftTruth(path, options) if has_truth else None
        work = _Import(format_, reader, options, truth, all_at_once)
        with OutputFile(output, {"the recording": path, "the truth": options.truth}) as file:
            first = True
            for rows in work.rows():
                if first:
                    file.write([(line,) for line in work.comment()])
                    file.write([work.result.columns])
                    first = False
                file.write(rows)
                progress(reader.records)
            with use_language("en"):  # as all faults
                if faults := work.faults() if work.result.rows else [work.no_rows_fault()]:
                    raise ConfigError(*faults)
    result = work.finish()
    result.notes = contradictions + result.notes
    return result


def _lacks_full_times(reader: Reader) -> bool:
    """Whether a recording is known to state only the last part of its times."""
    return isinstance(reader, Asterix) and reader.lacks_full_times


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


def _name_notes(tracks: Iterable[str]) -> list[str]:
    """A note on tracks whose names differ in their writing alone, as 7 and 7.0, or a1 and A1."""
    names_by_key: dict[str, list[str]] = {}
    for name in tracks:
        names_by_key.setdefault(name.casefold().removesuffix(".0").lstrip("0"), []).append(name)
    alike = [names for names in names_by_key.values() if len(names) > 1]
    if not alike:
        return []
    listed = "; ".join(", ".join(names) for names in alike[:MAX_LISTED])
    return [tr("tracks whose names differ in their writing alone are taken as several: {names}", names=listed)]


class _Import:
    """An import in progress: batches in, rows out."""

    def __init__(
        self, format_: Format, reader: Reader, options: Options, truth: "AircraftTruth | None", all_at_once: bool
    ):
        self.reader, self.options, self.truth, self.all_at_once = reader, options, truth, all_at_once
        self.result = ImportResult(format_)
        self.kind: str | None = None  # of the rows
        self.zero: float | None = None
        self.tracks_are_addresses: bool | None = (
            None  # whether tracks are addresses, and nothing else identifies an aircraft
        )
        self.skipped = reader.skipped
        self.later_rows = LaterRows(self.skipped, all_at_once)
        self.legs, self.gaps = FastestLegs(), GapWatch()
        self.has_bearings: bool | None = None  # all of the first batch
        self.site_distance = None if options.only_site is None else SiteDistance(options.only_site)
        self.impossible_speed: float | None = None  # of most targets, m/s
        self.jumps: CourseFault | None = None
        self.disordered_count = 0  # rows that were earlier, unless the newest came first
        self.radars = Counter[str]()
        self.note_counts = Counter[str]()  # by what a note says of these rows
        self.doppler = DopplerCheck()
        self.courses = CourseCheck()
        self.track_names: set[str] = set()

    def rows(self) -> Iterator[Iterable[tuple[str, ...]]]:
        """The rows of the output, in batches; raises NeedsAllRows."""
        for batch in self._sorted_batches() if self.all_at_once else self._requested_batches():
            selected = self.later_rows.select(batch)
            if selected.track:
                if selected.kind == PLOTS:
                    self.radars.update(selected.radar)
                for track, count in Counter(selected.track).items():
                    self.result.tracks[track] = self.result.tracks.get(track, 0) + count
                yield self._row_texts(selected)
        if not self.all_at_once and 0 < self.later_rows.lost <= min(len(self.result.tracks), MAX_STANDING_TRACKS):
            raise NeedsAllRows  # a clock that is set back by one scan stands still once in each track

    def _requested_batches(self) -> Iterator[Batch]:
        """The records of one kind that are requested, corrected, in the order of the file."""
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
            fixes, no_fix_count = without_no_fix(self._correct(batch), self.options.only_site)
            if no_fix_count:
                self.skipped[NO_FIX_REASON] += no_fix_count
            yield self._select_rows(fixes)

    def _sorted_batches(self) -> Iterator[Batch]:
        """All requested records in the order of time, without those that no target reaches."""
        batches = [batch for batch in self._requested_batches() if batch.track]
        if not batches:
            return
        batch = row_order.join_batches(batches)
        track_count = len(set(batch.track))
        batch, notes, self.disordered_count = row_order.sort_rows(batch, self._positions)
        if isinstance(self.reader, Asterix):
            self.reader.joined_numbers = track_count - len(set(batch.track))
        self.result.notes += notes
        batch = self._reachable_rows(batch)
        for first in range(0, len(batch.track), BATCH_ROWS):
            yield batch.rows(list(range(first, min(first + BATCH_ROWS, len(batch.track)))))

    def _reachable_rows(self, batch: Batch) -> Batch:
        """The rows of a whole recording without those that no target reaches; also finds where most are such."""
        positions, is_reachable = self._positions(batch), np.ones(len(batch.track), dtype=bool)
        tracks = []
        for name, rows in rows_by_name(batch.track).items():
            if name:
                track = TrackPositions(batch.columns["t_s"][rows], positions[rows])
                unreachable = target_speed.unreachable_rows(track)
                is_reachable[rows[unreachable]] = False
                tracks.append(track)
        if isinstance(self.reader, Table) and self.reader.track_question(1):  # it may be of several targets
            is_repeated = any((np.diff(track.t_s) == 0).any() for track in tracks)
            if is_repeated or (~is_reachable).mean() > MAX_LOSS:
                return batch
        self.impossible_speed = target_speed.impossible_speed(tracks)
        if (speed := target_speed.unlikely_speed(tracks)) is not None:
            self.result.notes.append(target_speed.speed_message(speed, is_possible=True))
        reached = np.flatnonzero(is_reachable)
        names, t = [batch.track[row] for row in reached], batch.columns["t_s"]
        jumps = track_jumps.recording_jumps(names, t[reached], positions[reached])
        self.jumps = track_jumps.jumps_fault(jumps, len(t))
        if not is_reachable.all():
            self.skipped[UNREACHABLE_REASON] += int((~is_reachable).sum())
            batch = batch.rows(np.flatnonzero(is_reachable).tolist())
        return batch

    def _positions(self, batch: Batch, measured: Mapping[str, np.ndarray] | None = None) -> np.ndarray:
        """Positions (n, d) of rows, m; of plots their ranges, if some of the first have no bearing; measured: of
        positions, if known."""
        if batch.kind == POSITIONS:
            if self.options.only_site is None:
                raise ConfigError(NO_SITE_FAULT)
            measured = measured or self.options.only_site.measure(batch.columns)
            return np.stack([measured[name] for name in ("x_m", "z_m")], axis=1)  # heights may be missing
        r, b = batch.columns["range_m"], batch.columns["bearing_rad"]
        if self.has_bearings is None:
            self.has_bearings = not np.isnan(b).any()
        return np.stack([r * np.cos(b), r * np.sin(b)], axis=1) if self.has_bearings else r[:, None]

    def _correct(self, batch: Batch) -> Batch:
        """A batch without the biases of the radar, with its sign of the Doppler speed turned, without spans of 0, and
        without plots that have no range."""
        biases, columns = self.options.biases, batch.columns
        if batch.kind == POSITIONS:
            if biases:
                raise ConfigError("bias: is subtracted from plots of a radar; the recording has positions")
            return self._without_fills(batch)
        if biases:
            range_bias, range_scale, bearing_bias, time_bias = (biases.get(name, 0.0) for name in BIASES)
            columns["t_s"] -= time_bias
            columns["range_m"] = (columns["range_m"] - range_bias) / (1 + range_scale)
            columns["bearing_rad"] = (columns["bearing_rad"] - bearing_bias) % (2 * math.pi)
        columns["velocity_mps"] *= -1 if self.options.towards else 1
        columns["span_mps"][columns["span_mps"] <= 0] = np.nan
        if (is_invalid := columns["range_m"] <= 0).any():
            self.skipped[term("plots whose range is not above 0")] += int(is_invalid.sum())
            batch = batch.rows(np.flatnonzero(~is_invalid).tolist())
        return self._without_fills(batch)

    def _without_fills(self, batch: Batch) -> Batch:
        """A batch without numbers that stand for none, and without rows whose place they are."""
        if not batch.track:
            return batch
        counts = remove_fills(batch.columns, batch.track)
        for name in ("bearing_rad", "altitude_m", "velocity_mps"):
            self.note_counts[FILL_NOTES[name]] += counts[name]
        if not any(counts[name] for name in FILL_REASONS):
            return batch
        is_known = np.ones(len(batch.track), dtype=bool)
        for name, reason in FILL_REASONS.items():
            self.skipped[reason] += counts[name]
            is_known &= np.isfinite(batch.columns.get(name, np.zeros(1)))
        return batch.rows(np.flatnonzero(is_known).tolist())

    def _select_rows(self, batch: Batch) -> Batch:
        """The records of a batch that are requested."""
        if len(self.track_names) < MAX_LISTED:
            self.track_names.update(batch.track)
        requested, sites = set(self.options.tracks), self.options.sites if batch.kind == PLOTS else {}
        if not requested and not sites:
            return batch
        rows = []
        for i, (track, radar) in enumerate(zip(batch.track, batch.radar, strict=True)):
            if sites and radar not in sites:
                self.skipped[
                    UNKNOWN_RADAR_REASON.replace("#/#", radar) if radar else term("rows of a radar without a name")
                ] += 1
            elif requested and track not in requested:
                self.skipped[term("rows of other tracks")] += 1
            else:
                rows.append(i)
        return batch.rows(rows)

    def _row_texts(self, batch: Batch) -> Iterable[tuple[str, ...]]:
        """The rows of a batch, as text."""
        t = batch.columns["t_s"]
        if self.zero is None:
            self.zero = self._time_zero(float(t[0]))
        columns = {"t_s": t - self.zero} | self._add_places(batch)
        if not self.all_at_once:
            positions = self._positions(batch, columns)
            if (
                self.legs.has_jump(batch.track, t, positions)
                or may_be_small_step(*self.legs.steps)
                or self.gaps.has_step(batch, positions)
            ):
                raise NeedsAllRows
        if not self.result.rows:  # the first batch of rows shows it
            self._note_alternation(batch, self._positions(batch, columns))
        if self.site_distance and batch.kind == POSITIONS:
            self.site_distance.add(batch)
            self.courses.add(batch)
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

    def _note_alternation(self, batch: Batch, positions: np.ndarray) -> None:
        """Note the first track of a batch that alternates between two places."""
        for name, rows in rows_by_name(batch.track).items():
            track = TrackPositions(batch.columns["t_s"][rows], positions[rows])
            if name and (alternation := track_jumps.find_alternation(name, track)):
                self.result.notes.append(CourseFault(alternation=alternation).message())
                return

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
                raise ConfigError(NO_SITE_FAULT)
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
                f"octal; report: what saw the aircraft; marks: {' or '.join(asterix_decode.MARKS)}"
            )
        zero, is_dated = self.options.zero, self.zero is not None and self.zero >= MIN_DATED_S
        if not isinstance(zero, str):
            zero = datetime.datetime.fromtimestamp(zero, datetime.UTC).isoformat()
        origin = {"first": "the first record", "midnight": "midnight (UTC) before the first record"}.get(zero, zero)
        is_of_day = self.reader.of_day and not _lacks_full_times(self.reader)
        epoch = "midnight" if is_of_day else "1970" if is_dated else "the start of its clock"
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
        cure = ""
        if self.result.format == "gpx" and self.reader.records:
            cure = "; if its points have no times, it is a route: export the track that was recorded"
        return f"{path}: has no plots; {self.reader.records} records were read{why}{cure}"

    def faults(self) -> list[str]:
        """Faults in the rows written, known when all are read."""
        path, faults = self.reader.path, []
        if len(self.radars) > 1 and self.options.site:
            names = ", ".join(self.radars)
            faults.append(f"at: must say where each radar stands whose plots are wanted, --at SAC/SIC=LAT,LON,HEIGHT: "
                         f"{path} has plots of {len(self.radars)}: {names}")  # fmt: skip
        disordered = self.disordered_count + self.later_rows.lost
        question = self.reader.track_question(disordered) if isinstance(self.reader, Table) else None
        if self.impossible_speed and not question:
            faults.append(f"{self.reader.path}: {target_speed.speed_message(self.impossible_speed)}")
        elif question or (question := self._loss_fault()):
            faults.append(question)
        if _lacks_full_times(self.reader) and (self.options.zero != "first" or self.options.truth):
            option = "truth" if self.options.zero == "first" else "time-from"
            faults.append(f"{option}: {path}: {asterix.TRUNCATED_TIMES}: its times cannot be compared with others")
        if self.site_distance is not None and (fault := self.site_distance.fault()):
            faults.append(fault)
        if self.truth is not None:
            faults += self.truth.faults(sorted(self.track_names))
        return faults

    def _loss_fault(self) -> str | None:
        """That more than a tenth of the rows is left out because of others, unless the user allows it."""
        counts: dict[str, int] = {
            SAME_TIME_REASON: self.later_rows.lost,
            UNREACHABLE_REASON: self.skipped[UNREACHABLE_REASON],
        }
        lost = sum(counts.values())
        if self.options.allow_loss or lost <= MAX_LOSS * (self.result.rows + lost):
            return None
        reasons = f"{', '.join(skip_counts(counts))}{self._loss_cause()}"
        return (f"{self.reader.path}: {lost} of {self.result.rows + lost} rows would be left out: {reasons}; "
                "--allow-loss imports the others")  # fmt: skip

    def _loss_cause(self) -> str:
        """Why rows have equal times, in English; '' where that is not known."""
        if self.later_rows.lost and isinstance(self.reader, Table) and (cell := self.reader.lost_digits("t_s")):
            return f"; times have lost digits, as {cell} shows: export the column as numbers"
        return self.later_rows.cause()

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
        result.notes += _name_notes(result.tracks)
        if isinstance(self.reader, Table) and self.reader.sheet.is_one_track and not self.reader.of_day:
            last_s = max(self.later_rows.last_times.values(), default=math.nan)
            result.notes += row_order.rollover_notes(self.reader.path, last_s)
        if self.truth is not None:
            result.notes += self.truth.notes()
        if self.site_distance is not None:
            result.notes += self.site_distance.notes()
        # Where a unit changes within the recording, what the velocities miss follows from that.
        result.notes += self.courses.notes()
        result.notes += [self.jumps.message()] if self.jumps else self.doppler.notes(self.options.towards)
        return result
