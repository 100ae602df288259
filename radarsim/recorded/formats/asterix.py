"""ASTERIX: plots of a radar (category 048, 001), tracks of a surveillance centre (062) and ADS-B positions (021).

Category 034 says where a radar stands and how fast it turns; category 002 this too, and the time of day that category
001 cuts off.
"""

import os
import string
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import BinaryIO

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recorded.formats import captures, layout, sites
from radarsim.recorded.formats.layout import Damaged, Profile
from radarsim.recorded.formats.numbering import Tracks

NAUTICAL_MILE_M, FOOT_M = 1852.0, 0.3048
FLIGHT_LEVEL_M = 100 * FOOT_M
WRAP_001_S = 512.0  # of the truncated time of day of category 001
RECENT = 4096  # data blocks; one that comes again among them is the double of a second network
SURVEYED = 50_000  # data blocks at the beginning of a file in which radars say where they stand
READ = (1, 2, 21, 34, 48, 62)
OF_RADARS = {1, 48}
NOWHERE = "records without time or position"
REPORTS = ("", "PSR", "SSR", "SSR+PSR", "Mode S", "Mode S", "Mode S+PSR", "Mode S+PSR")  # by the type of item 048/020
NO_AIRCRAFT = ("test target", "simulated", "field monitor", "coasted")
MARKS = (*NO_AIRCRAFT, "garbled code", "garbled height")
MARKED = ["; ".join(mark for i, mark in enumerate(MARKS) if bits >> i & 1) for bits in range(1 << len(MARKS))]
LETTERS = ["", *string.ascii_uppercase, *5 * [""], " ", *15 * [""], *string.digits, *6 * [""]]  # of six bits
WORDS = ("address", "mode_3a", "callsign", "report", "marks")  # columns of text
Columns = dict[str, np.ndarray]


class _Category:
    """What is read of a category's records.

    items: those of which fields are cut out; times, places: of which the first that a record has counts.
    """

    number, kind = 0, sites.PLOTS
    variant: str | None = None
    time_bytes = 3
    items: tuple[str, ...] = ()
    times: tuple[str, ...] = ()
    places: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.profile = Profile(self.number, self.items, self.variant)
        self.spec = self.profile.spec
        self.when, self.where = ([self.items.index(name) for name in own] for own in (self.times, self.places))

    def found(self, data: bytes, at: int) -> tuple[list[int], int]:
        """The places of the items of a record, -1 of those it has not, and its end."""
        return self.profile.places(data, at)

    def time(self, whole: int) -> float:
        """Time of day in s of a number in the time's item."""
        return whole / 128

    def columns(self, data: np.ndarray, at: Columns) -> tuple[Columns, dict[str, list[str]], np.ndarray]:
        """Of many records, from the places (n,) of their items: numbers (n,), text, and bits (n,) of MARKS."""
        raise NotImplementedError

    def field(self, item: str, *path: str) -> layout.Field:
        return layout.field(self.spec, item, *path)

    def flag(self, item: str, name: str) -> layout.Flag:
        return layout.flag(self.spec, item, name)


def _texts(values: np.ndarray, there: np.ndarray, said: Callable[[int], str]) -> list[str]:
    """What integers (n,) are called; '' where there is none."""
    names = {value: said(value) for value in set(values[there].tolist())}
    return [names[value] if known else "" for value, known in zip(values.tolist(), there.tolist(), strict=True)]


def _callsign(whole: int) -> str:
    """Eight characters of six bits (ICAO Annex 10)."""
    return "".join(LETTERS[whole >> shift & 63] for shift in range(42, -1, -6)).strip()


def _sensor(whole: int) -> str:
    return f"{whole >> 8}/{whole & 255}"


def _marks(**flags: np.ndarray) -> np.ndarray:
    """Bits of MARKS, from flags (n,) by their names without spaces."""
    bits = [np.asarray(one, dtype=np.int64) << MARKS.index(name.replace("_", " ")) for name, one in flags.items()]
    return np.bitwise_or.reduce(bits)


class _Radar(_Category):
    """Common to plots of categories 048 and 001."""

    places = ("040",)
    level = "FL"

    def __init__(self) -> None:
        super().__init__()
        self.rho, self.theta = self.field("040", "RHO"), self.field("040", "THETA")
        self.heights = [self.field("090", name) for name in (self.level, "V", "G")]
        self.codes = [self.field("070", name) for name in ("MODE3A", "V", "G")]
        self.tests = {name: self.flag("020", own) for name, own in (("test_target", "TST"), ("simulated", "SIM"),
                                                                     ("field_monitor", "RAB"))}  # fmt: skip

    def common(self, data: np.ndarray, at: Columns) -> tuple[Columns, list[str], np.ndarray]:
        """Range, bearing and height; the codes; the marks."""
        level, invalid, garbled = (one.of(data, at["090"]) for one in self.heights)
        code, invalid_code, garbled_code = (one.of(data, at["070"]) for one in self.codes)
        columns = {
            "range_m": self.rho.of(data, at["040"]) * NAUTICAL_MILE_M,
            "bearing_rad": np.radians(self.theta.of(data, at["040"])),
            "altitude_m": np.where(invalid + garbled > 0, np.nan, level * FLIGHT_LEVEL_M),
        }
        known = invalid_code + garbled_code == 0
        codes = _texts(np.where(known, code, 0).astype(int), known, "{:04o}".format)
        tests = {name: one.of(data, at["020"]) for name, one in self.tests.items()}
        return columns, codes, _marks(**tests, garbled_code=garbled_code == 1, garbled_height=garbled == 1)


class _Plots048(_Radar):
    number = 48
    items = ("010", "140", "020", "040", "070", "090", "220", "240", "161", "120")
    times = ("140",)

    def __init__(self) -> None:
        super().__init__()
        self.report = self.flag("020", "TYP")
        self.address, self.track, self.callsign = self.field("220"), self.field("161", "TRN"), self.field("240")
        doppler = self.spec.cv_items_dict["120"].cv_rule.cv_variation
        parts = {one.cv_name: one.cv_rule.cv_variation for one in doppler.cv_items_list if one}
        calculated, raw = parts["CAL"], parts["RDS"].cv_variation
        self.doubtful, self.calculated = (layout.field_in(calculated, name) for name in ("D", "CAL"))
        # The specification names no sign; no target has 32 km/s, so the upper half is taken as negative.
        self.doppler = layout.field_in(raw, "DOP")._replace(signed=True)
        self.span = layout.field_in(raw, "AMB")

    def columns(self, data: np.ndarray, at: Columns) -> tuple[Columns, dict[str, list[str]], np.ndarray]:
        columns, codes, marks = self.common(data, at)
        velocity, span = self._velocity(data, at["120"])
        report, reported = self.report.of(data, at["020"]), at["020"] >= 0
        words = {
            "track": _texts(self.track.whole(data, at["161"]), at["161"] >= 0, str),
            "address": _texts(self.address.whole(data, at["220"]), at["220"] >= 0, "{:06x}".format),
            "mode_3a": codes,
            "callsign": _texts(self.callsign.whole(data, at["240"]), at["240"] >= 0, _callsign),
            "report": _texts(report, reported, REPORTS.__getitem__),
        }
        marks |= _marks(coasted=reported & (report == 0))  # no detection: the radar's own forecast
        return columns | {"velocity_mps": velocity, "span_mps": span}, words, marks

    def _velocity(self, data: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The first raw Doppler speed and its span, both m/s (n,); else the calculated one, which is not folded."""
        parts = np.where(at < 0, 0, data[at])
        calculated = np.where(parts & 0x80, at + 1, -1)
        doubtful = self.doubtful.of(data, calculated) == 1
        velocity = np.where(doubtful, np.nan, self.calculated.of(data, calculated))
        count = np.where(parts & 0x40, np.where(parts & 0x80, at + 3, at + 1), -1)
        raw = np.where((count >= 0) & (data[count] > 0), count + 1, -1)
        span = self.span.of(data, raw)
        return np.where(raw < 0, velocity, self.doppler.of(data, raw)), np.where(span > 0, span, np.nan)


class _Plots001(_Radar):
    """The older category 001, whose records are plots or tracks, with truncated times."""

    number = 1
    items = ("010", "141", "020", "040", "070", "090", "161", "120")
    times = ("141",)
    level, variant, time_bytes = "HGT", "track", 2

    def __init__(self) -> None:
        super().__init__()
        self.plot = Profile(1, self.items, "plot")
        self.report = self.flag("020", "SSRPSR")
        self.track, self.doppler = self.field("161"), self.field("120")
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

    def columns(self, data: np.ndarray, at: Columns) -> tuple[Columns, dict[str, list[str]], np.ndarray]:
        columns, codes, marks = self.common(data, at)
        empty = np.full(len(codes), np.nan)
        words = {
            "track": _texts(self.track.whole(data, at["161"]), at["161"] >= 0, str),
            "mode_3a": codes,
            "report": _texts(self.report.of(data, at["020"]), at["020"] >= 0, REPORTS.__getitem__),
        }
        velocity = self.doppler.of(data, at["120"]) * NAUTICAL_MILE_M
        return columns | {"velocity_mps": velocity, "span_mps": empty}, words, marks


class _Tracks062(_Category):
    number, kind = 62, sites.POSITIONS
    items = ("010", "070", "105", "130", "136", "185", "040", "060", "080", "245", "380")
    times, places = ("070",), ("105",)

    def __init__(self) -> None:
        super().__init__()
        self.latitude, self.longitude = self.field("105", "LAT"), self.field("105", "LON")
        self.height, self.flight_level = self.field("130"), self.field("136")
        self.east, self.north = self.field("185", "VX"), self.field("185", "VY")
        self.track, self.callsign = self.field("040"), self.field("245", "CHR")
        self.codes = [self.field("060", name) for name in ("MODE3A", "V", "G")]
        self.simulated, self.coasted = self.flag("080", "SIM"), self.flag("080", "CST")
        (address, *_) = self.spec.cv_items_dict["380"].cv_rule.cv_variation.cv_items_list
        self.address = layout.field_in(address.cv_rule.cv_variation)

    def columns(self, data: np.ndarray, at: Columns) -> tuple[Columns, dict[str, list[str]], np.ndarray]:
        height, level = self.height.of(data, at["130"]) * FOOT_M, self.flight_level.of(data, at["136"])
        columns = {
            "latitude_deg": self.latitude.of(data, at["105"]),
            "longitude_deg": self.longitude.of(data, at["105"]),
            "altitude_m": np.where(np.isnan(height), level * FLIGHT_LEVEL_M, height),
            "east_mps": self.east.of(data, at["185"]),
            "north_mps": self.north.of(data, at["185"]),
            "up_mps": np.full(len(height), np.nan),
        }
        derived = at["380"].copy()
        derived[(derived >= 0) & (data[derived] & 0x80 == 0)] = -1  # the address is the first part of the item
        part = derived.copy()
        for _ in range(4):  # bytes of its own specification
            part = np.where((part >= 0) & (data[part] & 1 == 1), part + 1, part)
        address = np.where(derived >= 0, part + 1, -1)
        code, invalid, garbled = (one.of(data, at["060"]) for one in self.codes)
        known = invalid + garbled == 0
        words = {
            "track": _texts(self.track.whole(data, at["040"]), at["040"] >= 0, str),
            "address": _texts(self.address.whole(data, address), address >= 0, "{:06x}".format),
            "mode_3a": _texts(np.where(known, code, 0).astype(int), known, "{:04o}".format),
            "callsign": _texts(self.callsign.whole(data, at["245"]), at["245"] >= 0, _callsign),
        }
        flags = {"simulated": self.simulated.of(data, at["080"]), "coasted": self.coasted.of(data, at["080"])}
        return columns, words, _marks(**flags, garbled_code=garbled == 1)


class _Reports021(_Category):
    """ADS-B: the time is that for which the position holds, else that of its reception."""

    number, kind = 21, sites.POSITIONS
    items = ("010", "071", "073", "131", "130", "140", "145", "160", "157", "155", "161", "080", "070", "170", "040")
    times, places = ("071", "073"), ("131", "130")

    def __init__(self) -> None:
        super().__init__()
        self.where_it_is = [[self.field(item, name) for item in self.places] for name in ("LAT", "LON")]
        self.height, self.flight_level = self.field("140"), self.field("145")
        self.speed, self.course, self.beyond = (self.field("160", name) for name in ("GS", "TA", "RE"))
        self.climbs = [(item, self.field(item, name), self.field(item, "RE"))
                       for item, name in (("157", "GVR"), ("155", "BVR"))]  # fmt: skip
        self.address, self.track, self.callsign = self.field("080"), self.field("161", "TRNUM"), self.field("170")
        self.code = self.field("070", "MODE3A")
        self.tests = {name: self.flag("040", own) for name, own in (("test_target", "TST"), ("simulated", "SIM"),
                                                                     ("field_monitor", "RAB"))}  # fmt: skip

    def columns(self, data: np.ndarray, at: Columns) -> tuple[Columns, dict[str, list[str]], np.ndarray]:
        fine, coarse = (at[item] for item in self.places)
        places = [np.where(fine < 0, rough.of(data, coarse), exact.of(data, fine)) for exact, rough in self.where_it_is]
        height, level = self.height.of(data, at["140"]) * FOOT_M, self.flight_level.of(data, at["145"])
        speed = np.where(self.beyond.of(data, at["160"]) == 1, np.nan, self.speed.of(data, at["160"]) * NAUTICAL_MILE_M)
        course, up = np.radians(self.course.of(data, at["160"])), np.full(len(height), np.nan)
        for item, climb, beyond in self.climbs:
            known = beyond.of(data, at[item]) == 0
            up = np.where(np.isnan(up) & known, climb.of(data, at[item]) * FOOT_M / 60, up)
        columns = {
            "latitude_deg": places[0],
            "longitude_deg": places[1],
            "altitude_m": np.where(np.isnan(height), level * FLIGHT_LEVEL_M, height),
            "east_mps": speed * np.sin(course),
            "north_mps": speed * np.cos(course),
            "up_mps": up,
        }
        words = {
            "track": _texts(self.track.whole(data, at["161"]), (at["161"] >= 0) & (at["080"] < 0), str),
            "address": _texts(self.address.whole(data, at["080"]), at["080"] >= 0, "{:06x}".format),
            "mode_3a": _texts(self.code.whole(data, at["070"]), at["070"] >= 0, "{:04o}".format),
            "callsign": _texts(self.callsign.whole(data, at["170"]), at["170"] >= 0, _callsign),
        }
        return columns, words, _marks(**{name: one.of(data, at["040"]) for name, one in self.tests.items()})


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

    def taken(self) -> tuple[np.ndarray, np.ndarray, Columns]:
        """Times (n,), all bytes, and the places (n,) of each item in them; the collection is emptied."""
        data = np.frombuffer(b"".join([*self.blocks, bytes(16)]), np.uint8)
        places = np.array(self.places).reshape(len(self), -1)
        places = np.where(places < 0, -1, places + np.array(self.begins)[:, None])
        t = np.array(self.times)
        self._empty()
        return t, data, dict(zip(self.category.items, places.T, strict=True))


class Asterix:
    """A file of ASTERIX, as captures.blocks reads it."""

    of_day = True

    def __init__(self, path: str, file: BinaryIO, truth: bool = False, keep: bool = False):
        """truth: only positions are decoded, of other categories only the blocks are followed. keep: records that are
        of no aircraft, by MARKS, are in tracks too."""
        self.path, self.file, self.truth, self.keep = path, file, truth, keep
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.marked: Counter[str] = Counter()
        self.plots_001 = _Plots001()
        categories = (_Plots048(), self.plots_001, _Tracks062(), _Reports021())
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
            for category, begin, data in captures.blocks(self.path, self.file, self.skipped):
                if category == 34:  # which `surveyed` reads
                    continue
                held = self.held.get(category)
                if self.truth and category not in self.trusted:
                    self.plots |= category in OF_RADARS
                elif held is not None and self._again(data):
                    self.skipped["data blocks that came twice"] += 1
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
        """What was marked, and what is known of these radars, in words."""
        found = []
        turns = [f"{radar} {self.survey.turns[radar]:.4g} s" for radar in radars if radar in self.survey.turns]
        if turns:
            found.append(f"a turn of the antenna (I034/041) takes: {', '.join(turns)}")
        for mark in NO_AIRCRAFT:
            if count := self.marked[mark]:
                kept = "" if self.keep else ": in no track and no truth; --keep-marked keeps them there"
                found.append(f"{count} records are marked {mark}{kept}")
        if garbled := [f"{self.marked[mark]} with a {mark}" for mark in MARKS[4:] if self.marked[mark]]:
            found.append(f"{' and '.join(garbled)}, which is not used")
        if again := sum(one.again for one in self.tracks.values()):
            found.append(f"track numbers are given again to another aircraft {again} times: NUMBER-2 and so on")
        if shared := sum(len(one.shared) for one in self.tracks.values()):
            found.append(f"{shared} Mode 3/A codes are of several aircraft or of one seen again: ACODE-2 and so on")
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
                self.skipped[f"data blocks of category {category:03d}"] += 1
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
                self.skipped[NOWHERE] += 1
                continue
            held.places.extend(places)
            held.begins.append(held.size)
            held.times.append(clock(category.time(int.from_bytes(data[when : when + category.time_bytes], "big"))))
        if held.begins and held.begins[-1] == held.size:
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
        t, data, at = held.taken()
        columns, words, marks = held.category.columns(data, at)
        source = at["010"]
        radars = _texts(data[source].astype(int) << 8 | data[source + 1], source >= 0, _sensor)
        none = [""] * len(t)
        words = {name: words.get(name, none) for name in ("track", *WORDS)} | {"marks": [MARKED[one] for one in marks]}
        for i, mark in enumerate(MARKS):
            self.marked[mark] += int((marks >> i & 1).sum())
        out = (marks & ((1 << len(NO_AIRCRAFT)) - 1) > 0) & (not self.keep)
        tracks = self._named(kind, t, columns, radars, words, out)
        del words["track"]
        names = sites.PLOT_COLUMNS if kind == sites.PLOTS else sites.POSITION_COLUMNS
        columns = {name: t if name == "t_s" else columns[name] for name in names}
        batch = sites.Batch(kind, tracks, words.pop("address"), radars, columns, words)
        if kind == sites.PLOTS:
            nowhere = columns["range_m"] == 0
            self.skipped[NOWHERE] += int(nowhere.sum())
            return batch.rows(np.flatnonzero(~nowhere).tolist()) if nowhere.any() else batch
        return batch.rows(np.flatnonzero(~out).tolist()) if self.truth else batch

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
        rows = zip(t.tolist(), radars, words["track"], words["address"], codes, excluded.tolist(), strict=True)
        for i, (when, radar, number, address, code, out) in enumerate(rows):
            if out:
                found.append("")
            elif number:
                found.append(tracks.by_number(radar, number, address, when))
            elif address:
                found.append(tracks.of(radar, address))
            elif code:
                found.append(tracks.by_code(radar, code, when, float(north[i]), float(east[i])))
            else:
                found.append("")
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
            for category, _, data in islice(captures.blocks(path, file, Counter()), SURVEYED):
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
    return whole or captures.is_capture(head) or captures.is_final(head)
