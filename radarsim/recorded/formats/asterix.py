"""ASTERIX: plots of a radar (category 048, 001), tracks of a surveillance centre (062) and ADS-B positions (021).

Category 034 says where a radar stands and how fast it turns; category 002 this too, and the time of day that category
001 cuts off."""

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
from radarsim.recorded.formats.layout import Damaged, Profile
from radarsim.recorded.identity import Tracks

NAUTICAL_MILE_M, FOOT_M = 1852.0, 0.3048
FLIGHT_LEVEL_M = 100 * FOOT_M
WRAP_001_S = 512.0  # of the truncated time of day of category 001
RECENT = 4096  # data blocks; one that comes again among them is the double of a second network
SURVEYED = 50_000  # data blocks at the beginning of a file in which radars say where they stand
READ = (1, 2, 21, 34, 48, 62)
OF_RADARS = {1, 48}
REPORTS = ("", "PSR", "SSR", "SSR+PSR", "Mode S", "Mode S", "Mode S+PSR", "Mode S+PSR")  # by the type of item 048/020
NO_AIRCRAFT = ("test target", "simulated", "field monitor", "coasted")
MARKS = (*NO_AIRCRAFT, "garbled code", "garbled height")
MARKED = ["; ".join(mark for i, mark in enumerate(MARKS) if bits >> i & 1) for bits in range(1 << len(MARKS))]
LETTERS = ["", *string.ascii_uppercase, *5 * [""], " ", *15 * [""], *string.digits, *6 * [""]]  # of six bits
WORDS = ("address", "mode_3a", "callsign", "report", "marks")  # columns of text
Columns = dict[str, np.ndarray]
Words = dict[str, list[str]]


@dataclass(frozen=True)
class Cut:
    """Items of many records of a category: its specification, all bytes, and the places (n,) of each item in them."""

    spec: Any
    data: np.ndarray
    at: Columns

    def number(self, item: str, *path: str) -> np.ndarray:
        """A field (n,); NaN where the record has it not."""
        return layout.field(self.spec, item, *path).of(self.data, self.at[item])

    def text(self, said: Callable[[int], str], item: str, *path: str) -> list[str]:
        """What the number in a field is called; '' where the record has it not."""
        return named(layout.field(self.spec, item, *path).whole(self.data, self.at[item]), self.at[item] >= 0, said)

    def flag(self, item: str, name: str) -> np.ndarray:
        """Bits (n,) in an item that may go on; 0 where the record has them not."""
        return layout.flag(self.spec, item, name).of(self.data, self.at[item])

    def tests(self, item: str) -> np.ndarray:
        """Which reports (n,) are of no aircraft."""
        flags = (("test target", "TST"), ("simulated", "SIM"), ("field monitor", "RAB"))
        return np.bitwise_or.reduce([mark(what, self.flag(item, name)) for what, name in flags])

    def code(self, item: str) -> tuple[list[str], np.ndarray]:
        """Mode 3/A codes that are valid and not garbled, and marks (n,) of those that are."""
        garbled = self.number(item, "G") == 1
        known = (self.number(item, "V") == 0) & ~garbled
        codes = layout.field(self.spec, item, "MODE3A").whole(self.data, self.at[item])
        return named(codes, known, OCTAL), mark("garbled code", garbled)

    def height(self, geometric: str, level: str) -> np.ndarray:
        """The height (n,) in m, from the flight level where there is no other."""
        height = self.number(geometric) * FOOT_M
        return np.where(np.isnan(height), self.number(level) * FLIGHT_LEVEL_M, height)


OCTAL, HEXADECIMAL = "{:04o}".format, "{:06x}".format


def named(values: np.ndarray, there: np.ndarray, said: Callable[[int], str]) -> list[str]:
    """What integers (n,) are called; '' where there is none."""
    names = {value: said(value) for value in set(values[there].tolist())}
    return [names[value] if known else "" for value, known in zip(values.tolist(), there.tolist(), strict=True)]


def callsign(whole: int) -> str:
    """Eight characters of six bits (ICAO Annex 10)."""
    return "".join(LETTERS[whole >> shift & 63] for shift in range(42, -1, -6)).strip()


def sensor(whole: int) -> str:
    """SAC/SIC."""
    return f"{whole >> 8}/{whole & 255}"


def mark(what: str, flags: np.ndarray) -> np.ndarray:
    """Bits (n,) of MARKS."""
    return np.asarray(flags, dtype=np.int64) << MARKS.index(what)


Read = tuple[Columns, Words, np.ndarray]  # columns (n,) of numbers and of text, and bits (n,) of MARKS


def seen_by_radar(cut: Cut, level: str, report: str) -> Read:
    """What plots of categories 048 and 001 have in common; level, report: what these fields are called."""
    codes, marks = cut.code("070")
    garbled = cut.number("090", "G") == 1
    height = np.where((cut.number("090", "V") == 0) & ~garbled, cut.number("090", level) * FLIGHT_LEVEL_M, np.nan)
    columns = {
        "range_m": cut.number("040", "RHO") * NAUTICAL_MILE_M,
        "bearing_rad": np.radians(cut.number("040", "THETA")),
        "altitude_m": height,
    }
    reports = named(cut.flag("020", report), cut.at["020"] >= 0, REPORTS.__getitem__)
    words = {"mode_3a": codes, "report": reports}
    return columns, words, marks | cut.tests("020") | mark("garbled height", garbled)


def plots_048(cut: Cut) -> Read:
    """Plots and tracks of a radar."""
    columns, words, marks = seen_by_radar(cut, "FL", "TYP")
    columns["velocity_mps"], columns["span_mps"] = doppler_048(cut)
    words |= {
        "track": cut.text(str, "161", "TRN"),
        "address": cut.text(HEXADECIMAL, "220"),
        "callsign": cut.text(callsign, "240"),
    }
    forecast = (cut.at["020"] >= 0) & (cut.flag("020", "TYP") == 0)  # no detection: the radar's own forecast
    return columns, words, marks | mark("coasted", forecast)


def doppler_048(cut: Cut) -> tuple[np.ndarray, np.ndarray]:
    """The first raw Doppler speed and its span, both m/s (n,); else the calculated one, which is not folded."""
    data, at = cut.data, cut.at["120"]
    variation = cut.spec.cv_items_dict["120"].cv_rule.cv_variation
    rules = {one.cv_name: one.cv_rule.cv_variation for one in variation.cv_items_list if one}
    calculated, raw = rules["CAL"], rules["RDS"].cv_variation
    parts = np.where(at < 0, 0, data[at])
    first = np.where(parts & 0x80, at + 1, -1)
    doubtful = layout.field_in(calculated, "D").of(data, first) == 1
    velocity = np.where(doubtful, np.nan, layout.field_in(calculated, "CAL").of(data, first))
    count = np.where(parts & 0x40, np.where(parts & 0x80, at + 3, at + 1), -1)
    second = np.where((count >= 0) & (data[count] > 0), count + 1, -1)
    # The specification names no sign; no target has 32 km/s, so the upper half is taken as negative.
    folded = layout.field_in(raw, "DOP")._replace(signed=True).of(data, second)
    span = layout.field_in(raw, "AMB").of(data, second)
    return np.where(second < 0, velocity, folded), span


def plots_001(cut: Cut) -> Read:
    """The same of the older category."""
    columns, words, marks = seen_by_radar(cut, "HGT", "SSRPSR")
    columns["velocity_mps"] = cut.number("120") * NAUTICAL_MILE_M
    return columns, words | {"track": cut.text(str, "161")}, marks


def tracks_062(cut: Cut) -> Read:
    """Tracks of a surveillance centre."""
    columns = {
        "latitude_deg": cut.number("105", "LAT"),
        "longitude_deg": cut.number("105", "LON"),
        "altitude_m": cut.height("130", "136"),
        "east_mps": cut.number("185", "VX"),
        "north_mps": cut.number("185", "VY"),
    }
    codes, marks = cut.code("060")
    words = {
        "track": cut.text(str, "040"),
        "address": address_062(cut),
        "mode_3a": codes,
        "callsign": cut.text(callsign, "245", "CHR"),
    }
    marks |= mark("simulated", cut.flag("080", "SIM")) | mark("coasted", cut.flag("080", "CST"))
    return columns, words, marks


def address_062(cut: Cut) -> list[str]:
    """The address, which is the first part of an item of many, after up to four bytes that name these."""
    data, at = cut.data, cut.at["380"]
    there = (at >= 0) & (data[at] & 0x80 > 0)
    for _ in range(3):
        at = np.where(data[at] & 1 == 1, at + 1, at)
    (address, *_) = cut.spec.cv_items_dict["380"].cv_rule.cv_variation.cv_items_list
    return named(layout.field_in(address.cv_rule.cv_variation).whole(data, at + 1), there, HEXADECIMAL)


def reports_021(cut: Cut) -> Read:
    """ADS-B: positions that aircraft report."""
    speed = np.where(cut.number("160", "RE") == 0, cut.number("160", "GS") * NAUTICAL_MILE_M, np.nan)
    course = np.radians(cut.number("160", "TA"))
    climbs = [np.where(cut.number(item, "RE") == 0, cut.number(item, name) * FOOT_M / 60, np.nan)
              for item, name in (("157", "GVR"), ("155", "BVR"))]  # fmt: skip
    coarse = cut.at["131"] < 0
    columns = {
        "latitude_deg": np.where(coarse, cut.number("130", "LAT"), cut.number("131", "LAT")),
        "longitude_deg": np.where(coarse, cut.number("130", "LON"), cut.number("131", "LON")),
        "altitude_m": cut.height("140", "145"),
        "east_mps": speed * np.sin(course),
        "north_mps": speed * np.cos(course),
        "up_mps": np.where(np.isnan(climbs[0]), climbs[1], climbs[0]),
    }
    addresses, tracks = cut.text(HEXADECIMAL, "080"), cut.text(str, "161", "TRNUM")
    words = {
        "track": ["" if address else track for address, track in zip(addresses, tracks, strict=True)],
        "address": addresses,
        "mode_3a": cut.text(OCTAL, "070", "MODE3A"),
        "callsign": cut.text(callsign, "170"),
    }
    return columns, words, cut.tests("040")


class _Category:
    """What is read of a category's records: the items of which fields are cut out; the first of times and of places
    that a record has counts."""

    time_bytes = 3

    def __init__(self, number: int, read: Callable[[Cut], Read], kind: str, times: str, places: str, others: str,
                 variant: str | None = None):  # fmt: skip
        self.number, self.read, self.kind = number, read, kind
        self.items = ("010", *times.split(), *places.split(), *others.split())
        self.profile = Profile(number, self.items, variant)
        self.when, self.where = ([self.items.index(name) for name in own.split()] for own in (times, places))

    def found(self, data: bytes, at: int) -> tuple[list[int], int]:
        """The places of the items of a record, -1 of those it has not, and its end."""
        return self.profile.places(data, at)

    def time(self, whole: int) -> float:
        """Time of day in s of a number in the time's item."""
        return whole / 128


class _Category001(_Category):
    """Category 001, whose records are plots or tracks, with truncated times."""

    time_bytes = 2

    def __init__(self) -> None:
        super().__init__(1, plots_001, sites.PLOTS, "141", "040", "020 070 090 161 120", "track")
        self.plot = Profile(1, self.items, "plot")
        self.full: float | None = None  # time of day of the last sector message of category 002
        self.unrolled = sites.Unrolled(WRAP_001_S)

    def found(self, data: bytes, at: int) -> tuple[list[int], int]:
        """The profile depends on the first bit of item 020, the second item of both; item 010 has two bytes."""
        kind = layout.after_specification(data, at) + 2
        return (self.profile if kind < len(data) and data[kind] & 0x80 else self.plot).places(data, at)

    def time(self, whole: int) -> float:
        """The time of day next to the last sector's; without sectors the truncated one, unwrapped."""
        truncated = whole / 128
        if self.full is None:
            return self.unrolled(truncated)
        return truncated + WRAP_001_S * round((self.full - truncated) / WRAP_001_S)


class _Records:
    """Records of a category, of which the fields are cut out together."""

    def __init__(self, category: _Category):
        self.category = category
        self._empty()

    def _empty(self) -> None:
        self.blocks: list[bytes] = []
        self.size = 0
        self.places, self.begins, self.times = array("q"), array("q"), array("d")

    def __len__(self) -> int:
        return len(self.times)

    def taken(self) -> tuple[np.ndarray, Cut]:
        """Times (n,) and items; the collection is emptied."""
        data = np.frombuffer(b"".join([*self.blocks, bytes(16)]), np.uint8)
        places = np.array(self.places).reshape(len(self), -1)
        places = np.where(places < 0, -1, places + np.array(self.begins)[:, None])
        t = np.array(self.times)
        self._empty()
        return t, Cut(self.category.profile.spec, data, dict(zip(self.category.items, places.T, strict=True)))


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
        self.plots_001 = _Category001()
        categories = (
            _Category(48, plots_048, sites.PLOTS, "140", "040", "020 070 090 220 240 161 120"),
            self.plots_001,
            _Category(62, tracks_062, sites.POSITIONS, "070", "105", "130 136 185 040 060 080 245 380"),
            # The time for which a position holds, else that of its reception; the finer position.
            _Category(
                21, reports_021, sites.POSITIONS, "071 073", "131 130", "140 145 160 157 155 161 080 070 170 040"
            ),
        )
        self.held = {one.number: _Records(one) for one in categories}
        self.sectors = Profile(2, ("030",))
        self.clock = sites.Unrolled(sites.DAY_S)
        self.tracks = {kind: Tracks() for kind in (sites.PLOTS, sites.POSITIONS)}
        self.plots = False  # whether there are plots beside the truth
        self.recent: dict[bytes, None] = {}
        self.survey = surveyed(path)
        self.plots_001.full = self.survey.second
        # As truth ADS-B comes before the tracks that a centre has smoothed.
        self.trusted = {21} if 21 in self.survey.categories else {21, 62}

    def batches(self) -> Iterator[sites.Batch]:
        """The records in batches; raises ConfigError where a block or record violates the specification."""
        try:
            for category, begin, data in layout.blocks(self.path, self.file, self.skipped):
                if category == 34:  # which `surveyed` reads
                    continue
                held = self.held.get(category)
                if self.truth and category not in self.trusted:
                    self.plots |= category in OF_RADARS
                elif held is not None and self._again(data):
                    self.skipped[term("data blocks that came twice")] += 1
                else:
                    self._block(category, begin, data, held)
                    if held is not None and len(held) >= sites.BATCH:
                        yield self._batch(held)
        except ConfigError as fault:
            raise ConfigError(*(f"{line}; {self.records} records were read before" for line in fault.lines)) from fault
        for number in (62, 21, 48, 1):
            if len(self.held[number]):
                yield self._batch(self.held[number])

    def notes(self, radars: Iterable[str]) -> list[str]:
        """The marked reports, and the facts on these radars, in words."""
        found = self.clock.notes()
        turns = [(radar, self.survey.turns[radar]) for radar in radars if radar in self.survey.turns]
        if turns:
            each = ", ".join(tr("{radar} {turn:.4g} s", radar=radar, turn=turn) for radar, turn in turns)
            found.append(tr("a turn of the antenna (I034/041) takes: {each}", each=each))
        for mark, count in self.marked.items():
            if mark not in NO_AIRCRAFT:
                kept = tr("; it is not used")
            else:
                kept = "" if self.keep else tr("; in no track and no truth: --keep-marked keeps them there")
            if count:
                found.append(tr("records marked “{mark}”: {count}", mark=mark, count=count) + kept)
        if again := sum(one.again for one in self.tracks.values()):
            found.append(tr("track numbers given again to another aircraft, NUMBER-2 and so on: {count}", count=again))
        if shared := sum(len(one.shared) for one in self.tracks.values()):
            codes = term("Mode 3/A codes of several aircraft or of one seen again, ACODE-2 and so on: {count}")
            found.append(tr(codes, count=shared))
        return found

    def _again(self, data: bytes) -> bool:
        if data in self.recent:
            return True
        self.recent[data] = None
        if len(self.recent) > RECENT:
            del self.recent[next(iter(self.recent))]
        return False

    def _block(self, category: int, begin: int, data: bytes, held: _Records | None) -> None:
        try:
            if held is not None:
                self._records(data, held)
            elif category == 2:
                self._sectors(data)
            else:
                self.skipped[term("data blocks of category #").replace(ANY, f"{category:03d}")] += 1
        except Damaged as fault:
            edition = f"{category:03d} in edition {layout.edition(category)}, which is taken for granted"
            raise ConfigError(f"{self.path}: byte {begin + fault.at}, record {self.records + 1}: not ASTERIX of "
                              f"category {edition}: {fault.what}") from fault  # fmt: skip

    def _records(self, data: bytes, held: _Records) -> None:
        category, at, clock = held.category, 3, self.clock
        while at < len(data):
            places, at = category.found(data, at)
            self.records += 1
            when = next((places[i] for i in category.when if places[i] >= 0), -1)
            if when < 0 or all(places[i] < 0 for i in category.where):
                self.skipped[sites.NOWHERE] += 1
                continue
            held.places.extend(places)
            held.begins.append(held.size)
            held.times.append(clock(category.time(int.from_bytes(data[when : when + category.time_bytes], "big"))))
        if held.begins and held.begins[-1] == held.size:  # there is a record of this block
            held.blocks.append(data)
            held.size += len(data)

    def _sectors(self, data: bytes) -> None:
        """The full time of day, which category 001 leaves to the sector messages of its radar."""
        at = 3
        while at < len(data):
            (place,), at = self.sectors.places(data, at)
            if place >= 0:
                self.plots_001.full = int.from_bytes(data[place : place + 3], "big") / 128

    def _batch(self, held: _Records) -> sites.Batch:
        kind = held.category.kind
        t, cut = held.taken()
        columns, words, marks = held.category.read(cut)
        source, none = cut.at["010"], [""] * len(t)
        radars = named(cut.data[source].astype(int) << 8 | cut.data[source + 1], source >= 0, sensor)
        words = {name: words.get(name, none) for name in ("track", *WORDS)} | {"marks": [MARKED[one] for one in marks]}
        for i, mark in enumerate(MARKS):
            self.marked[mark] += int((marks >> i & 1).sum())
        out = (marks & ((1 << len(NO_AIRCRAFT)) - 1) > 0) & (not self.keep)
        tracks = self._named(kind, t, columns, radars, words, out)
        del words["track"]
        names = sites.PLOT_COLUMNS if kind == sites.PLOTS else sites.POSITION_COLUMNS
        columns = {name: t if name == "t_s" else columns.get(name, np.full(len(t), np.nan)) for name in names}
        batch = sites.Batch(kind, tracks, words.pop("address"), radars, columns, words)
        return batch.rows(np.flatnonzero(~out).tolist()) if self.truth and kind == sites.POSITIONS else batch

    def _named(self, kind: str, t: np.ndarray, columns: Columns, radars: list[str], words: dict[str, list[str]],
               excluded: np.ndarray) -> list[str]:  # fmt: skip
        """The track of each record."""
        tracks, found = self.tracks[kind], []
        north, east = np.zeros((2, len(t)))
        codes = [""] * len(t)
        if kind == sites.PLOTS:
            north = columns["range_m"] * np.cos(columns["bearing_rad"])
            east = columns["range_m"] * np.sin(columns["bearing_rad"])
            codes = words["mode_3a"]
        numbers = (one.tolist() for one in (t, north, east, excluded))
        rows = zip(radars, words["track"], words["address"], codes, *numbers, strict=True)
        for radar, number, address, code, when, x, y, out in rows:
            if out or not (number or address or code):
                found.append("")
            elif number:
                found.append(tracks.by_number(radar, number, address, when))
            else:
                found.append(tracks.of(radar, address) if address else tracks.by_code(radar, code, when, x, y))
        return found


@dataclass
class Survey:
    """What the beginning of a file says of its radars, by SAC/SIC: degrees, degrees and m (WGS 84), the time of a turn
    in s; the first full time of day, s; and its categories."""

    places: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    turns: dict[str, float] = field(default_factory=dict)
    second: float | None = None
    categories: set[int] = field(default_factory=set)


def surveyed(path: str) -> Survey:
    """The radars of a file, by its first SURVEYED blocks; of a stream, which is read once, none."""
    survey, turns = Survey(), dict[str, list[float]]()
    if not os.path.isfile(path):
        return survey
    services = {34: Profile(34, ("010", "041", "030", "120")), 2: Profile(2, ("010", "041", "030"))}
    turn, day = (layout.field(services[34].spec, item) for item in ("041", "030"))
    place = [layout.field(services[34].spec, "120", name) for name in ("LAT", "LON", "HGT")]
    try:
        with open(path, "rb") as file:
            for category, _, data in islice(layout.blocks(path, file, Counter()), SURVEYED):
                survey.categories.add(category)
                at = 3
                while category in services and at < len(data):
                    (source, turned, timed, *placed), at = services[category].places(data, at)
                    radar = f"{data[source]}/{data[source + 1]}" if source >= 0 else ""
                    if turned >= 0:
                        turns.setdefault(radar, []).append(_number(turn, data, turned))
                    if timed >= 0 and survey.second is None:
                        survey.second = _number(day, data, timed)
                    if placed and placed[0] >= 0:
                        latitude, longitude, height = (_number(one, data, placed[0]) for one in place)
                        if latitude or longitude:  # a radar that does not know sends zeros
                            survey.places[radar] = latitude, longitude, height
    except (ConfigError, Damaged):
        pass  # it is told when the records are read
    survey.turns = {radar: float(np.median(own)) for radar, own in turns.items()}
    return survey


def _number(field: layout.Field, data: bytes, at: int) -> float:
    return float(field.of(np.frombuffer(data, np.uint8), np.array([at]))[0])


def looks_like(head: bytes) -> bool:
    """Whether a file with this beginning may be ASTERIX: at least one data block, of a category that radars send."""
    whole = len(head) >= 4 and head[0] in (*READ, 8, 20) and int.from_bytes(head[1:3], "big") >= 4
    return whole or layout.is_capture(head) or layout.is_final(head)
