"""Read ASTERIX: plots of a radar (category 048, 001), tracks of a surveillance centre (062) and ADS-B positions (021).

Category 034 states the position of a radar and the time of its turn; category 002 also does, and has the full time of
day, of which category 001 keeps only the last part."""

import os
import string
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, BinaryIO

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language import ANY, term, tr
from radarsim.recorded.formats import layout, sites
from radarsim.recorded.formats.layout import DamagedRecord, Profile
from radarsim.recorded.identity import TrackNames

NAUTICAL_MILE_M, FOOT_M = 1852.0, 0.3048
FLIGHT_LEVEL_M = 100 * FOOT_M
WRAP_001_S = 512.0  # of the truncated time of day of category 001
MAX_RECENT_BLOCKS = 4096  # data blocks; one that comes again among them is the double of a second network
SURVEY_BLOCKS = 50_000  # data blocks at the beginning of a file in which radars say where they stand
READ_CATEGORIES = (1, 2, 21, 34, 48, 62)
RADAR_CATEGORIES = {1, 48}
REPORTS = ("", "PSR", "SSR", "SSR+PSR", "Mode S", "Mode S", "Mode S+PSR", "Mode S+PSR")  # by the type of item 048/020
NO_AIRCRAFT = ("test target", "simulated", "field monitor", "coasted")
MARKS = (*NO_AIRCRAFT, "garbled code", "garbled height")
MARK_TEXTS = ["; ".join(mark for i, mark in enumerate(MARKS) if bits >> i & 1) for bits in range(1 << len(MARKS))]
CALLSIGN_LETTERS = ["", *string.ascii_uppercase, *5 * [""], " ", *15 * [""], *string.digits, *6 * [""]]  # of six bits
WORDS = ("address", "mode_3a", "callsign", "report", "marks")  # columns of text
Columns = dict[str, np.ndarray]
Texts = dict[str, list[str]]


@dataclass(frozen=True)
class RecordFields:
    """Items of many records of a category: its specification, all bytes, and the offsets (n,) of each item in them."""

    spec: Any
    data: np.ndarray
    offsets: Columns

    def number(self, item: str, *path: str) -> np.ndarray:
        """A field (n,) as numbers; NaN if a record does not have it."""
        return layout.locate_field(self.spec, item, *path).values(self.data, self.offsets[item])

    def text(self, name_of: Callable[[int], str], item: str, *path: str) -> list[str]:
        """A field (n,) as texts, named by its number; '' if a record does not have it."""
        return name_values(
            layout.locate_field(self.spec, item, *path).integers(self.data, self.offsets[item]),
            self.offsets[item] >= 0,
            name_of,
        )

    def flag(self, item: str, name: str) -> np.ndarray:
        """Bits (n,) in an item of several bytes; 0 if a record does not have them."""
        return layout.locate_flag(self.spec, item, name).values(self.data, self.offsets[item])

    def tests(self, item: str) -> np.ndarray:
        """Marks (n,) of reports that are of no aircraft."""
        flags = (("test target", "TST"), ("simulated", "SIM"), ("field monitor", "RAB"))
        return np.bitwise_or.reduce([mark_bits(mark, self.flag(item, name)) for mark, name in flags])

    def code(self, item: str) -> tuple[list[str], np.ndarray]:
        """Valid Mode 3/A codes that are not garbled, and marks (n,) of garbled ones."""
        garbled = self.number(item, "G") == 1
        is_valid = (self.number(item, "V") == 0) & ~garbled
        codes = layout.locate_field(self.spec, item, "MODE3A").integers(self.data, self.offsets[item])
        return name_values(codes, is_valid, OCTAL), mark_bits("garbled code", garbled)

    def height(self, geometric: str, level: str) -> np.ndarray:
        """The height (n,) in m, from the flight level where there is no other."""
        height = self.number(geometric) * FOOT_M
        return np.where(np.isnan(height), self.number(level) * FLIGHT_LEVEL_M, height)


OCTAL, HEXADECIMAL = "{:04o}".format, "{:06x}".format


def name_values(values: np.ndarray, is_present: np.ndarray, name_of: Callable[[int], str]) -> list[str]:
    """The names of integers (n,); '' where there is none."""
    names = {value: name_of(value) for value in set(values[is_present].tolist())}
    return [
        names[value] if present else "" for value, present in zip(values.tolist(), is_present.tolist(), strict=True)
    ]


def callsign_text(bits: int) -> str:
    """Eight characters of six bits (ICAO Annex 10)."""
    return "".join(CALLSIGN_LETTERS[bits >> shift & 63] for shift in range(42, -1, -6)).strip()


def sensor_name(number: int) -> str:
    """SAC/SIC."""
    return f"{number >> 8}/{number & 255}"


def mark_bits(mark: str, flags: np.ndarray) -> np.ndarray:
    """Bits (n,) of MARKS."""
    return np.asarray(flags, dtype=np.int64) << MARKS.index(mark)


RecordContents = tuple[Columns, Texts, np.ndarray]  # columns (n,) of numbers and of text, and bits (n,) of MARKS


def radar_plots(fields: RecordFields, level: str, report: str) -> RecordContents:
    """The common contents of plots of categories 048 and 001; level, report: the names of these fields."""
    codes, marks = fields.code("070")
    garbled = fields.number("090", "G") == 1
    height = np.where((fields.number("090", "V") == 0) & ~garbled, fields.number("090", level) * FLIGHT_LEVEL_M, np.nan)
    columns = {
        "range_m": fields.number("040", "RHO") * NAUTICAL_MILE_M,
        "bearing_rad": np.radians(fields.number("040", "THETA")),
        "altitude_m": height,
    }
    reports = name_values(fields.flag("020", report), fields.offsets["020"] >= 0, REPORTS.__getitem__)
    texts = {"mode_3a": codes, "report": reports}
    return columns, texts, marks | fields.tests("020") | mark_bits("garbled height", garbled)


def plots_048(fields: RecordFields) -> RecordContents:
    """Plots and tracks of a radar."""
    columns, texts, marks = radar_plots(fields, "FL", "TYP")
    columns["velocity_mps"], columns["span_mps"] = doppler_048(fields)
    texts |= {
        "track": fields.text(str, "161", "TRN"),
        "address": fields.text(HEXADECIMAL, "220"),
        "callsign": fields.text(callsign_text, "240"),
    }
    # no detection: the radar's own forecast
    is_forecast = (fields.offsets["020"] >= 0) & (fields.flag("020", "TYP") == 0)
    return columns, texts, marks | mark_bits("coasted", is_forecast)


def doppler_048(fields: RecordFields) -> tuple[np.ndarray, np.ndarray]:
    """The first raw Doppler speed and its span, both m/s (n,); else the calculated one, which is not folded."""
    data, offset = fields.data, fields.offsets["120"]
    variation = fields.spec.cv_items_dict["120"].cv_rule.cv_variation
    rules = {part.cv_name: part.cv_rule.cv_variation for part in variation.cv_items_list if part}
    calculated, raw = rules["CAL"], rules["RDS"].cv_variation
    part_bits = np.where(offset < 0, 0, data[offset])
    calculated_offset = np.where(part_bits & 0x80, offset + 1, -1)
    doubtful = layout.locate_field_in(calculated, "D").values(data, calculated_offset) == 1
    velocity = np.where(doubtful, np.nan, layout.locate_field_in(calculated, "CAL").values(data, calculated_offset))
    count_offset = np.where(part_bits & 0x40, np.where(part_bits & 0x80, offset + 3, offset + 1), -1)
    raw_offset = np.where((count_offset >= 0) & (data[count_offset] > 0), count_offset + 1, -1)
    # The specification names no sign; no target has 32 km/s, so the upper half is taken as negative.
    folded = layout.locate_field_in(raw, "DOP")._replace(signed=True).values(data, raw_offset)
    span = layout.locate_field_in(raw, "AMB").values(data, raw_offset)
    return np.where(raw_offset < 0, velocity, folded), span


def plots_001(fields: RecordFields) -> RecordContents:
    """Plots and tracks of a radar in the older category."""
    columns, texts, marks = radar_plots(fields, "HGT", "SSRPSR")
    columns["velocity_mps"] = fields.number("120") * NAUTICAL_MILE_M
    return columns, texts | {"track": fields.text(str, "161")}, marks


def tracks_062(fields: RecordFields) -> RecordContents:
    """Tracks of a surveillance centre."""
    columns = {
        "latitude_deg": fields.number("105", "LAT"),
        "longitude_deg": fields.number("105", "LON"),
        "altitude_m": fields.height("130", "136"),
        "east_mps": fields.number("185", "VX"),
        "north_mps": fields.number("185", "VY"),
    }
    codes, marks = fields.code("060")
    texts = {
        "track": fields.text(str, "040"),
        "address": address_062(fields),
        "mode_3a": codes,
        "callsign": fields.text(callsign_text, "245", "CHR"),
    }
    marks |= mark_bits("simulated", fields.flag("080", "SIM")) | mark_bits("coasted", fields.flag("080", "CST"))
    return columns, texts, marks


def address_062(fields: RecordFields) -> list[str]:
    """The addresses: the first subitem of item 380, after up to four bytes that say which subitems are present."""
    data, offset = fields.data, fields.offsets["380"]
    has_address = (offset >= 0) & (data[offset] & 0x80 > 0)
    for _ in range(3):
        offset = np.where(data[offset] & 1 == 1, offset + 1, offset)
    (address, *_) = fields.spec.cv_items_dict["380"].cv_rule.cv_variation.cv_items_list
    return name_values(
        layout.locate_field_in(address.cv_rule.cv_variation).integers(data, offset + 1), has_address, HEXADECIMAL
    )


def reports_021(fields: RecordFields) -> RecordContents:
    """ADS-B: positions that aircraft report."""
    speed = np.where(fields.number("160", "RE") == 0, fields.number("160", "GS") * NAUTICAL_MILE_M, np.nan)
    course = np.radians(fields.number("160", "TA"))
    climbs = [np.where(fields.number(item, "RE") == 0, fields.number(item, name) * FOOT_M / 60, np.nan)
              for item, name in (("157", "GVR"), ("155", "BVR"))]  # fmt: skip
    is_coarse = fields.offsets["131"] < 0
    columns = {
        "latitude_deg": np.where(is_coarse, fields.number("130", "LAT"), fields.number("131", "LAT")),
        "longitude_deg": np.where(is_coarse, fields.number("130", "LON"), fields.number("131", "LON")),
        "altitude_m": fields.height("140", "145"),
        "east_mps": speed * np.sin(course),
        "north_mps": speed * np.cos(course),
        "up_mps": np.where(np.isnan(climbs[0]), climbs[1], climbs[0]),
    }
    addresses, tracks = fields.text(HEXADECIMAL, "080"), fields.text(str, "161", "TRNUM")
    texts = {
        "track": ["" if address else track for address, track in zip(addresses, tracks, strict=True)],
        "address": addresses,
        "mode_3a": fields.text(OCTAL, "070", "MODE3A"),
        "callsign": fields.text(callsign_text, "170"),
    }
    return columns, texts, fields.tests("040")


class Category:
    """What is read of a category's records: the items of which fields are cut out; the first of times and of offsets
    that a record has counts."""

    time_bytes = 3

    def __init__(
        self,
        number: int,
        read: Callable[[RecordFields], RecordContents],
        kind: str,
        time_names: str,
        position_names: str,
        other_items: str,
        variant: str | None = None,
    ):
        self.number, self.read, self.kind = number, read, kind
        self.items = ("010", *time_names.split(), *position_names.split(), *other_items.split())
        self.profile = Profile(number, self.items, variant)
        self.time_items, self.position_items = (
            [self.items.index(name) for name in names.split()] for names in (time_names, position_names)
        )

    def find_items(self, data: bytes, start: int) -> tuple[list[int], int]:
        """The offsets of the items of a record, -1 of those it has not, and its end."""
        return self.profile.offsets(data, start)

    def time_of_day(self, number: int) -> float:
        """Time of day in s of a number in the time's item."""
        return number / 128


class Category001(Category):
    """Category 001, whose records are plots or tracks, with truncated times."""

    time_bytes = 2

    def __init__(self) -> None:
        super().__init__(1, plots_001, sites.PLOTS, "141", "040", "020 070 090 161 120", "track")
        self.plot = Profile(1, self.items, "plot")
        self.full: float | None = None  # time of day of the last sector message of category 002
        self.unrolled_clock = sites.UnrolledClock(WRAP_001_S)

    def find_items(self, data: bytes, start: int) -> tuple[list[int], int]:
        """The profile depends on the first bit of item 020, the second item of both; item 010 has two bytes."""
        kind_offset = layout.specification_end(data, start) + 2
        return (self.profile if kind_offset < len(data) and data[kind_offset] & 0x80 else self.plot).offsets(
            data, start
        )

    def time_of_day(self, number: int) -> float:
        """The time of day next to the last sector's; without sectors the truncated one, unwrapped."""
        truncated = number / 128
        if self.full is None:
            return self.unrolled_clock(truncated)
        return truncated + WRAP_001_S * round((self.full - truncated) / WRAP_001_S)


class RecordStore:
    """Records of a category, of which the fields are cut out together."""

    def __init__(self, category: Category):
        self.category = category
        self._clear()

    def _clear(self) -> None:
        self.blocks: list[bytes] = []
        self.size = 0
        self.offsets, self.block_starts, self.times = array("q"), array("q"), array("d")

    def __len__(self) -> int:
        return len(self.times)

    def take_fields(self) -> tuple[np.ndarray, RecordFields]:
        """Times (n,) and items; the collection is emptied."""
        data = np.frombuffer(b"".join([*self.blocks, bytes(16)]), np.uint8)
        offsets = np.array(self.offsets).reshape(len(self), -1)
        offsets = np.where(offsets < 0, -1, offsets + np.array(self.block_starts)[:, None])
        t = np.array(self.times)
        self._clear()
        return t, RecordFields(self.category.profile.spec, data, dict(zip(self.category.items, offsets.T, strict=True)))


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
            Category(48, plots_048, sites.PLOTS, "140", "040", "020 070 090 220 240 161 120"),
            self.plots_001,
            Category(62, tracks_062, sites.POSITIONS, "070", "105", "130 136 185 040 060 080 245 380"),
            # The time for which a position holds, else that of its reception; the finer position.
            Category(21, reports_021, sites.POSITIONS, "071 073", "131 130", "140 145 160 157 155 161 080 070 170 040"),
        )
        self.records_by_category = {category.number: RecordStore(category) for category in categories}
        self.sector_profile = Profile(2, ("030",))
        self.clock = sites.UnrolledClock(sites.DAY_S)
        self.tracks = {kind: TrackNames() for kind in (sites.PLOTS, sites.POSITIONS)}
        self.has_plots = False  # whether there are plots beside the truth
        self.recent_blocks: dict[bytes, None] = {}
        self.survey = survey_radars(path)
        self.plots_001.full = self.survey.second
        # As truth ADS-B comes before the tracks that a centre has smoothed.
        self.trusted_categories = {21} if 21 in self.survey.categories else {21, 62}

    def batches(self) -> Iterator[sites.Batch]:
        """The records in batches; raises ConfigError where a block or record violates the specification."""
        try:
            for category, begin, data in layout.blocks(self.path, self.file, self.skipped):
                if category == 34:  # which `surveyed` reads
                    continue
                records = self.records_by_category.get(category)
                if self.truth and category not in self.trusted_categories:
                    self.has_plots |= category in RADAR_CATEGORIES
                elif records is not None and self._is_repeated(data):
                    self.skipped[term("data blocks that came twice")] += 1
                else:
                    self._read_block(category, begin, data, records)
                    if records is not None and len(records) >= sites.BATCH_ROWS:
                        yield self._take_batch(records)
        except ConfigError as fault:
            raise ConfigError(*(f"{line}; {self.records} records were read before" for line in fault.lines)) from fault
        for number in (62, 21, 48, 1):
            if len(self.records_by_category[number]):
                yield self._take_batch(self.records_by_category[number])

    def notes(self, radars: Iterable[str]) -> list[str]:
        """The marked reports, and the facts on these radars, in words."""
        lines = self.clock.notes()
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
        if reused := sum(names.reused_numbers for names in self.tracks.values()):
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
                self.skipped[term("data blocks of category #").replace(ANY, f"{category:03d}")] += 1
        except DamagedRecord as fault:
            edition = f"{category:03d} in edition {layout.edition_number(category)}, which is taken for granted"
            raise ConfigError(f"{self.path}: byte {begin + fault.offset}, record {self.records + 1}: not ASTERIX of "
                              f"category {edition}: {fault.fault}") from fault  # fmt: skip

    def _read_records(self, data: bytes, records: RecordStore) -> None:
        category, offset, clock = records.category, 3, self.clock
        while offset < len(data):
            offsets, offset = category.find_items(data, offset)
            self.records += 1
            time_offset = next((offsets[i] for i in category.time_items if offsets[i] >= 0), -1)
            if time_offset < 0 or all(offsets[i] < 0 for i in category.position_items):
                self.skipped[sites.NO_TIME_OR_POSITION] += 1
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

    def _take_batch(self, records: RecordStore) -> sites.Batch:
        kind = records.category.kind
        t, fields = records.take_fields()
        columns, texts, marks = records.category.read(fields)
        source, empty = fields.offsets["010"], [""] * len(t)
        radars = name_values(fields.data[source].astype(int) << 8 | fields.data[source + 1], source >= 0, sensor_name)
        texts = {name: texts.get(name, empty) for name in ("track", *WORDS)} | {
            "marks": [MARK_TEXTS[bits] for bits in marks]
        }
        for i, mark in enumerate(MARKS):
            self.marked[mark] += int((marks >> i & 1).sum())
        is_excluded = (marks & ((1 << len(NO_AIRCRAFT)) - 1) > 0) & (not self.keep)
        tracks = self._name_tracks(kind, t, columns, radars, texts, is_excluded)
        del texts["track"]
        names = sites.PLOT_COLUMNS if kind == sites.PLOTS else sites.POSITION_COLUMNS
        columns = {name: t if name == "t_s" else columns.get(name, np.full(len(t), np.nan)) for name in names}
        batch = sites.Batch(kind, tracks, texts.pop("address"), radars, columns, texts)
        return batch.rows(np.flatnonzero(~is_excluded).tolist()) if self.truth and kind == sites.POSITIONS else batch

    def _name_tracks(self, kind: str, t: np.ndarray, columns: Columns, radars: list[str], texts: dict[str, list[str]],
               excluded: np.ndarray) -> list[str]:  # fmt: skip
        """The track of each record."""
        tracks, tracks_of_rows = self.tracks[kind], []
        north, east = np.zeros((2, len(t)))
        codes = [""] * len(t)
        if kind == sites.PLOTS:
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


@dataclass
class Survey:
    """What the beginning of a file says of its radars, by SAC/SIC: degrees, degrees and m (WGS 84), the time of a turn
    in s; the first full time of day, s; and its categories."""

    positions: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    turns: dict[str, float] = field(default_factory=dict)
    second: float | None = None
    categories: set[int] = field(default_factory=set)


def survey_radars(path: str) -> Survey:
    """The radars of a file, by its first SURVEY_BLOCKS blocks; none of a stream, which is read once."""
    survey, turns_by_radar = Survey(), dict[str, list[float]]()
    if not os.path.isfile(path):
        return survey
    services = {34: Profile(34, ("010", "041", "030", "120")), 2: Profile(2, ("010", "041", "030"))}
    turn_field, time_field = (layout.locate_field(services[34].spec, item) for item in ("041", "030"))
    position_fields = [layout.locate_field(services[34].spec, "120", name) for name in ("LAT", "LON", "HGT")]
    try:
        with open(path, "rb") as file:
            for category, _, data in islice(layout.blocks(path, file, Counter()), SURVEY_BLOCKS):
                survey.categories.add(category)
                start = 3
                while category in services and start < len(data):
                    (source, turn_offset, time_offset, *position_offset), start = services[category].offsets(
                        data, start
                    )
                    radar = f"{data[source]}/{data[source + 1]}" if source >= 0 else ""
                    if turn_offset >= 0:
                        turns_by_radar.setdefault(radar, []).append(_field_value(turn_field, data, turn_offset))
                    if time_offset >= 0 and survey.second is None:
                        survey.second = _field_value(time_field, data, time_offset)
                    if position_offset and position_offset[0] >= 0:
                        latitude, longitude, height = (
                            _field_value(field, data, position_offset[0]) for field in position_fields
                        )
                        if latitude or longitude:  # a radar that does not know sends zeros
                            survey.positions[radar] = latitude, longitude, height
    except (ConfigError, DamagedRecord):
        pass  # it is told when the records are read
    survey.turns = {radar: float(np.median(durations)) for radar, durations in turns_by_radar.items()}
    return survey


def _field_value(field: layout.Field, data: bytes, offset: int) -> float:
    return float(field.values(np.frombuffer(data, np.uint8), np.array([offset]))[0])


def looks_like(head: bytes) -> bool:
    """Whether a file with this beginning may be ASTERIX: at least one data block, of a category that radars send."""
    is_block = len(head) >= 4 and head[0] in (*READ_CATEGORIES, 8, 20) and int.from_bytes(head[1:3], "big") >= 4
    return is_block or layout.is_capture(head) or layout.is_final(head)
