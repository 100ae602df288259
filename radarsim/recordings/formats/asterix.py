"""Read ASTERIX: plots of a radar (048, 001), tracks of a centre (062), ADS-B positions (021)."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import BinaryIO

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.translate import NUMBER_PLACEHOLDER, term, tr
from radarsim.recordings.formats import asterix_layout, captures
from radarsim.recordings.formats import records as formats_records
from radarsim.recordings.formats.asterix_categories import Category, Category001, RecordStore
from radarsim.recordings.formats.asterix_decode import (
    MARK_TEXTS,
    MARKS,
    NO_AIRCRAFT,
    Columns,
    name_values,
    plots_048,
    reports_021,
    sensor_name,
    tracks_062,
)
from radarsim.recordings.formats.asterix_layout import DamagedRecord, Profile
from radarsim.recordings.formats.asterix_survey import survey_radars
from radarsim.recordings.track_names import TrackNames

MAX_RECENT_BLOCKS = 4096  # data blocks; one that comes again among them is the double of a second network
READ_CATEGORIES = (1, 2, 21, 34, 48, 62)
RADAR_CATEGORIES = {1, 48}
TRUNCATED_TIMES = "category 001 states times within 512 s only, and no sector messages (category 002) the others"
TEXT_COLUMNS = ("address", "mode_3a", "callsign", "report", "marks")  # columns of text


class Asterix:
    """A file of ASTERIX, as layout.blocks reads it."""

    of_day = True

    def __init__(self, path: str, file: BinaryIO, truth: bool = False, keep: bool = False):
        """truth: only positions are decoded, of other categories only the blocks are followed. keep: records that are
        of no aircraft, by MARKS, are in tracks too."""
        self.path, self.file, self.truth, self.keep = path, file, truth, keep
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.marked: Counter[str] = Counter()
        self.plots_001 = Category001()
        categories = (
            Category(48, plots_048, formats_records.PLOTS, "140", "040", "020 070 090 220 240 161 120"),
            self.plots_001,
            Category(62, tracks_062, formats_records.POSITIONS, "070", "105", "130 136 185 040 060 080 245 380"),
            # The time for which a position holds, else that of its reception; the finer position.
            Category(
                21,
                reports_021,
                formats_records.POSITIONS,
                "071 073",
                "131 130",
                "140 145 160 157 155 161 080 070 170 040",
            ),
        )
        self.records_by_category = {category.number: RecordStore(category) for category in categories}
        self.sector_profile = Profile(2, ("030",))
        self.clock = formats_records.UnrolledClock(formats_records.DAY_S)
        self.tracks = {kind: TrackNames() for kind in (formats_records.PLOTS, formats_records.POSITIONS)}
        self.joined_numbers = 0  # that were used again only as the clock was set forward
        self.has_plots = False  # whether there are plots beside the truth
        self.recent_blocks: dict[bytes, None] = {}
        self.survey = survey_radars(path)
        self.plots_001.full = self.survey.second
        # As truth ADS-B comes before the tracks that a centre has smoothed.
        self.trusted_categories = {21} if 21 in self.survey.categories else {21, 62}

    @property
    def lacks_full_times(self) -> bool:
        """Whether plots of category 001 have only the last 512 s of their times, as far as the file has been read."""
        return self.plots_001.full is None and (
            1 in self.survey.categories or self.plots_001.unrolled_clock.last is not None
        )

    def batches(self) -> Iterator[formats_records.Batch]:
        """The records in batches; raises ConfigError where a block or record violates the specification."""
        try:
            for category, begin, data in captures.blocks(self.path, self.file, self.skipped):
                if category == 34:  # which `surveyed` reads
                    continue
                records = self.records_by_category.get(category)
                if self.truth and category not in self.trusted_categories:
                    self.has_plots |= category in RADAR_CATEGORIES
                elif records is not None and self._is_repeated(data):
                    self.skipped[term("data blocks that came twice")] += 1
                else:
                    self._read_block(category, begin, data, records)
                    if records is not None and len(records) >= formats_records.BATCH_ROWS:
                        yield self._take_batch(records)
        except ConfigError as fault:
            raise ConfigError(*(f"{line}; {self.records} records were read before" for line in fault.lines)) from fault
        for number in (62, 21, 48, 1):
            if len(self.records_by_category[number]):
                yield self._take_batch(self.records_by_category[number])

    def notes(self, radars: Iterable[str]) -> list[str]:
        """The marked reports, and the facts on these radars, in words."""
        lines = self.clock.notes()
        if self.lacks_full_times:
            lines.append(tr("category 001 states times within 512 s only, and no sector messages (category 002) the "
                            "others: t_s counts from an unknown time"))  # fmt: skip
        turns = [(radar, self.survey.turns[radar]) for radar in radars if radar in self.survey.turns]
        if turns:
            turn_texts = ", ".join(tr("{radar} {turn:.4g} s", radar=radar, turn=turn) for radar, turn in turns)
            lines.append(tr("a turn of the antenna (I034/041) takes: {each}", each=turn_texts))
        for mark, count in self.marked.items():
            if mark not in NO_AIRCRAFT:
                consequence = tr("; it is not used")
            else:
                consequence = "" if self.keep else tr("; in no track and no truth: --keep-marked keeps them there")
            if count:
                lines.append(tr("records marked “{mark}”: {count}", mark=mark, count=count) + consequence)
        if (reused := sum(names.reused_numbers for names in self.tracks.values()) - self.joined_numbers) > 0:
            lines.append(tr("track numbers given again to another aircraft, NUMBER-2 and so on: {count}", count=reused))
        if shared := sum(len(names.shared_codes) for names in self.tracks.values()):
            codes = term("Mode 3/A codes of several aircraft or of one seen again, ACODE-2 and so on: {count}")
            lines.append(tr(codes, count=shared))
        return lines

    def _is_repeated(self, data: bytes) -> bool:
        if data in self.recent_blocks:
            return True
        self.recent_blocks[data] = None
        if len(self.recent_blocks) > MAX_RECENT_BLOCKS:
            del self.recent_blocks[next(iter(self.recent_blocks))]
        return False

    def _read_block(self, category: int, begin: int, data: bytes, records: RecordStore | None) -> None:
        try:
            if records is not None:
                self._read_records(data, records)
            elif category == 2:
                self._read_sectors(data)
            else:
                self.skipped[term("data blocks of category #").replace(NUMBER_PLACEHOLDER, f"{category:03d}")] += 1
        except DamagedRecord as fault:
            edition = f"{category:03d} in edition {asterix_layout.edition_number(category)}, which is taken for granted"
            raise ConfigError(f"{self.path}: byte {begin + fault.offset}, record {self.records + 1}: not ASTERIX of "
                              f"category {edition}: {fault.fault}") from fault  # fmt: skip

    def _read_records(self, data: bytes, records: RecordStore) -> None:
        category, offset, clock = records.category, 3, self.clock
        while offset < len(data):
            offsets, offset = category.find_items(data, offset)
            self.records += 1
            time_offset = next((offsets[i] for i in category.time_items if offsets[i] >= 0), -1)
            if time_offset < 0 or all(offsets[i] < 0 for i in category.position_items):
                self.skipped[formats_records.NO_TIME_OR_POSITION] += 1
                continue
            records.offsets.extend(offsets)
            records.block_starts.append(records.size)
            records.times.append(
                clock(
                    category.time_of_day(int.from_bytes(data[time_offset : time_offset + category.time_bytes], "big"))
                )
            )
        if records.block_starts and records.block_starts[-1] == records.size:  # there is a record of this block
            records.blocks.append(data)
            records.size += len(data)

    def _read_sectors(self, data: bytes) -> None:
        """The full time of day, which category 001 leaves to the sector messages of its radar."""
        start = 3
        while start < len(data):
            (offset,), start = self.sector_profile.offsets(data, start)
            if offset >= 0:
                self.plots_001.full = int.from_bytes(data[offset : offset + 3], "big") / 128

    def _take_batch(self, records: RecordStore) -> formats_records.Batch:
        kind = records.category.kind
        t, fields = records.take_fields()
        columns, texts, marks = records.category.read(fields)
        source, empty = fields.offsets["010"], [""] * len(t)
        radars = name_values(fields.data[source].astype(int) << 8 | fields.data[source + 1], source >= 0, sensor_name)
        texts = {name: texts.get(name, empty) for name in ("track", *TEXT_COLUMNS)} | {
            "marks": [MARK_TEXTS[bits] for bits in marks]
        }
        for i, mark in enumerate(MARKS):
            self.marked[mark] += int((marks >> i & 1).sum())
        is_excluded = (marks & ((1 << len(NO_AIRCRAFT)) - 1) > 0) & (not self.keep)
        tracks = self._name_tracks(kind, t, columns, radars, texts, is_excluded)
        del texts["track"]
        names = formats_records.PLOT_COLUMNS if kind == formats_records.PLOTS else formats_records.POSITION_COLUMNS
        columns = {name: t if name == "t_s" else columns.get(name, np.full(len(t), np.nan)) for name in names}
        batch = formats_records.Batch(kind, tracks, texts.pop("address"), radars, columns, texts)
        return (
            batch.rows(np.flatnonzero(~is_excluded).tolist())
            if self.truth and kind == formats_records.POSITIONS
            else batch
        )

    def _name_tracks(self, kind: str, t: np.ndarray, columns: Columns, radars: list[str], texts: dict[str, list[str]],
               excluded: np.ndarray) -> list[str]:  # fmt: skip
        """The track of each record."""
        tracks, tracks_of_rows = self.tracks[kind], []
        north, east = np.zeros((2, len(t)))
        codes = [""] * len(t)
        if kind == formats_records.PLOTS:
            north = columns["range_m"] * np.cos(columns["bearing_rad"])
            east = columns["range_m"] * np.sin(columns["bearing_rad"])
            codes = texts["mode_3a"]
        numbers = (column.tolist() for column in (t, north, east, excluded))
        rows = zip(radars, texts["track"], texts["address"], codes, *numbers, strict=True)
        for radar, number, address, code, t_s, north_m, east_m, is_excluded in rows:
            if is_excluded or not (number or address or code):
                tracks_of_rows.append("")
            elif number:
                tracks_of_rows.append(tracks.name_by_number(radar, number, address, t_s))
            else:
                tracks_of_rows.append(
                    tracks.with_sensor(radar, address)
                    if address
                    else tracks.name_by_code(radar, code, t_s, north_m, east_m)
                )
        return tracks_of_rows


def looks_like(head: bytes) -> bool:
    """Whether a file with this beginning may be ASTERIX: a data block of a category that radars send, or blocks of any
    category one after the other."""
    is_block = len(head) >= 4 and head[0] in (*READ_CATEGORIES, 8, 20) and int.from_bytes(head[1:3], "big") >= 4
    return is_block or captures.is_chain(head) or captures.is_capture(head) or captures.is_final(head)
