"""ASTERIX: plots of a radar (category 048, 001) and tracks of a surveillance centre (062), from raw data blocks.

The specification is that of the library libasterix: the items of a category, their lengths, the places and units of
their fields. Decoding a record into its objects takes 0.3 ms, so only the lengths of items are followed here, and the
few fields needed cut out, which takes a hundredth of it.

A data block is its category (1 byte), its length (2 bytes, these three included) and records; a record is a field
specification (7 bits a byte, the eighth says that another byte follows) and the items that it names.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from types import ModuleType
from typing import Any, BinaryIO, NamedTuple

from radarsim.errors import ConfigError
from radarsim.recorded.formats import sites

NAUTICAL_MILE_M, FOOT_M = 1852.0, 0.3048
FLIGHT_LEVEL_M = 100 * FOOT_M
WRAP_001_S = 512.0  # of the truncated time of day of category 001
READ = (1, 2, 48, 62)

Skip = Callable[[bytes, int], int]  # data and start of an item: its end


class Damaged(ValueError):
    """Bytes that the specification does not allow: where they are, and what is wrong."""

    def __init__(self, at: int, what: str):
        super().__init__(what)
        self.at, self.what = at, what


class Field(NamedTuple):
    """A number in an item: its first byte, the bits after it, bytes it spans, bits, sign, resolution."""

    first: int
    shift: int
    size: int
    bits: int
    signed: bool
    step: float

    def of(self, data: bytes, at: int) -> float:
        """Its value in the item that begins at `at`."""
        whole = int.from_bytes(data[at + self.first : at + self.first + self.size], "big") >> self.shift
        whole &= (1 << self.bits) - 1
        if self.signed and whole >> (self.bits - 1):
            whole -= 1 << self.bits
        return whole * self.step


def _library() -> tuple[ModuleType, ModuleType]:
    """The modules `base` and `generated` of libasterix; raises ConfigError where it is not installed."""
    try:
        from asterix import base, generated
    except ImportError as error:
        raise sites.needs("libasterix", "asterix") from error
    return base, generated


@cache
def specification(category: int) -> Any:
    """The newest edition of a category in libasterix: its class of user application profiles."""
    _, generated = _library()
    return max(generated.manifest["CATS"][category], key=lambda edition: edition.cv_edition).cv_uap


@cache
def record(category: int, variant: str | None = None) -> Any:
    """The profile of a category's records; category 001 has one for a plot and one for a track."""
    profile = specification(category)
    return profile.cv_uaps[variant] if variant else profile.cv_record


def field(spec: Any, item: str, *path: str) -> Field:
    """The place of a field in an item of a record; path leads through groups, by the names of libasterix."""
    return field_in(spec.cv_items_dict[item].cv_rule.cv_variation, *path)


def field_in(variation: Any, *path: str) -> Field:
    """The same in a given element or group."""
    base, _ = _library()
    offset = 0
    for name in path:
        for part, size in variation.cv_items_list:
            if issubclass(part, base.Item) and part.cv_non_spare.cv_name == name:
                variation = part.cv_non_spare.cv_rule.cv_variation
                break
            offset += size
        else:
            raise KeyError(name)
    return _placed(base, variation, offset)


def _placed(base: ModuleType, variation: Any, offset: int) -> Field:
    content = variation.cv_rule.cv_content
    quantity = issubclass(content, base.ContentQuantity)
    signed = quantity and issubclass(content.cv_signedness, base.Signed)
    bits = variation.cv_bit_size
    count = (offset % 8 + bits + 7) // 8
    return Field(offset // 8, 8 * count - offset % 8 - bits, count, bits, signed, content.cv_lsb if quantity else 1.0)


def variation_of(rule: Any) -> Any:
    """The variation behind a rule of libasterix; of one that depends on another item the default."""
    return getattr(rule, "cv_variation", None) or rule.cv_default_variation


def size_in_bits(base: ModuleType, variation: Any) -> int:
    """How many bits an element or a group has."""
    if not issubclass(variation, base.Element | base.Group):
        raise TypeError(variation)
    return int(variation.cv_bit_size)


@cache
def skip(variation: Any) -> Skip:
    """A function that finds the end of an item of a libasterix variation."""
    base, _ = _library()
    if issubclass(variation, base.Element | base.Group):
        size = size_in_bits(base, variation) // 8
        return lambda data, at: at + size
    if issubclass(variation, base.Extended):
        return _extended(variation)
    if issubclass(variation, base.Repetitive):
        return _repetitive(base, variation)
    if issubclass(variation, base.Explicit):
        return _explicit
    if issubclass(variation, base.Compound):
        return _compound(variation)
    raise TypeError(variation)


def _extended(variation: Any) -> Skip:
    parts = [(sum(one[1] if one else 1 for one in part) // 8, part[-1] is None) for part in variation.cv_items_list]

    def end(data: bytes, at: int) -> int:
        for size, extends in parts:
            at += size
            if not (extends and at <= len(data) and data[at - 1] & 1):
                return at
        raise Damaged(at - 1, "an item goes on after its last part")

    return end


def _repetitive(base: ModuleType, variation: Any) -> Skip:
    counted, inner = variation.cv_rep_bytes, variation.cv_variation
    bits = size_in_bits(base, inner)

    def by_count(data: bytes, at: int) -> int:
        return at + counted + int.from_bytes(data[at : at + counted], "big") * (bits // 8)

    def by_bit(data: bytes, at: int) -> int:
        at += (bits + 1) // 8
        while at <= len(data) and data[at - 1] & 1:
            at += (bits + 1) // 8
        return at

    return by_count if counted else by_bit


def _explicit(data: bytes, at: int) -> int:
    if at < len(data) and data[at] == 0:
        raise Damaged(at, "an item of length 0")
    return at + data[at] if at < len(data) else at + 1


def _compound(variation: Any) -> Skip:
    parts = [one and skip(variation_of(one.cv_rule)) for one in variation.cv_items_list]

    def end(data: bytes, at: int) -> int:
        begin = at
        numbers, at = _named(data, at)
        for number in numbers:
            part = parts[number] if number < len(parts) else None
            if part is None:
                raise Damaged(begin, f"a part {number + 1} that the item has not")
            at = part(data, at)
        return at

    return end


def _named(data: bytes, at: int) -> tuple[list[int], int]:
    """The numbers, from 0, in a field specification, and its end."""
    begin, numbers = at, []
    while True:
        if at >= len(data):
            raise Damaged(begin, "a field specification that does not end")
        byte = data[at]
        numbers += [7 * (at - begin) + bit for bit in range(7) if byte >> (7 - bit) & 1]
        at += 1
        if not byte & 1:
            return numbers, at


def _source(data: bytes, at: int) -> str:
    """SAC/SIC of the record at `at`: item 010, the first of every category that is read; '' where it has none."""
    begin = _after_specification(data, at)
    return f"{data[begin]}/{data[begin + 1]}" if data[at] & 0x80 else ""


def _after_specification(data: bytes, at: int) -> int:
    """The end of a field specification, whatever it names; beyond the data if it does not end."""
    while at < len(data) and data[at] & 1:
        at += 1
    return at + 1


class _Profile:
    """Places of the wanted items of a category's records; the plan of each field specification is made once."""

    def __init__(self, category: int, wanted: tuple[str, ...], variant: str | None = None):
        base, _ = _library()
        self.wanted = wanted
        self.spec = record(category, variant)
        self.items = [
            (one.cv_non_spare.cv_name, skip(variation_of(one.cv_non_spare.cv_rule)))
            if issubclass(one, base.UapItem)
            else None
            for one in self.spec.cv_items_list
        ]
        self.plans: dict[bytes, list[tuple[int, str, Skip]]] = {}

    def places(self, data: bytes, at: int) -> tuple[list[int], int]:
        """The start of each wanted item, -1 where it is absent, and the end of the record."""
        begin, at = at, _after_specification(data, at)
        plan = self.plans.get(data[begin:at])
        if plan is None:
            plan = self._plan(data, begin)
        places = [-1] * len(self.wanted)
        for index, name, end in plan:
            if index >= 0:
                places[index] = at
            at = end(data, at)
            if at > len(data):
                raise Damaged(begin, f"item {name} ends after the data block")
        return places, at

    def _plan(self, data: bytes, begin: int) -> list[tuple[int, str, Skip]]:
        numbers, at = _named(data, begin)
        plan = []
        for number in numbers:
            item = self.items[number] if number < len(self.items) else None
            if item is None:
                raise Damaged(begin, f"an item of number {number + 1}, which the category has not")
            index = self.wanted.index(item[0]) if item[0] in self.wanted else -1
            plan.append((index, *item))
        if not plan:
            raise Damaged(begin, "a record without items")
        self.plans[data[begin:at]] = plan
        return plan


class _Plots048:
    """Plots and tracks of a radar: time, slant range, azimuth, flight level, address, track, Doppler speed."""

    def __init__(self) -> None:
        self.profile = _Profile(48, ("140", "040", "090", "220", "161", "120"))
        spec = self.profile.spec
        self.time = field(spec, "140")
        self.rho, self.theta = field(spec, "040", "RHO"), field(spec, "040", "THETA")
        self.level, self.invalid = field(spec, "090", "FL"), field(spec, "090", "V")
        self.address, self.number = field(spec, "220"), field(spec, "161", "TRN")
        doppler = spec.cv_items_dict["120"].cv_rule.cv_variation
        parts = {one.cv_name: one.cv_rule.cv_variation for one in doppler.cv_items_list if one}
        calculated, raw = parts["CAL"], parts["RDS"].cv_variation
        self.doubtful, self.calculated = (field_in(calculated, name) for name in ("D", "CAL"))
        # The specification names no sign; no target has 32 km/s, so the upper half is taken as negative.
        self.doppler = field_in(raw, "DOP")._replace(signed=True)
        self.span = field_in(raw, "AMB")

    def row(self, data: bytes, at: int) -> tuple[str, str, tuple[float, ...] | None, int]:
        """Track, address and PLOT_COLUMNS of the record at `at`, none where it has no position; its end."""
        (time, place, level, address, number, doppler), end = self.profile.places(data, at)
        if time < 0 or place < 0:
            return "", "", None, end
        velocity, span = self._velocity(data, doppler) if doppler >= 0 else (math.nan, math.nan)
        known = level >= 0 and not self.invalid.of(data, level)
        row = (
            self.time.of(data, time),
            self.rho.of(data, place) * NAUTICAL_MILE_M,
            math.radians(self.theta.of(data, place)),
            velocity,
            span,
            self.level.of(data, level) * FLIGHT_LEVEL_M if known else math.nan,
        )
        named = f"{int(self.address.of(data, address)):06x}" if address >= 0 else ""
        return str(int(self.number.of(data, number))) if number >= 0 else named, named, row, end

    def _velocity(self, data: bytes, at: int) -> tuple[float, float]:
        """The first raw Doppler speed and its span, both m/s; else the calculated one, which is not folded."""
        parts, at = data[at], at + 1
        found = math.nan
        if parts & 0x80:
            found = math.nan if self.doubtful.of(data, at) else self.calculated.of(data, at)
            at += 2
        if parts & 0x40 and data[at]:
            span = self.span.of(data, at + 1)
            return self.doppler.of(data, at + 1), span or math.nan
        return found, math.nan


class _Plots001:
    """The same of the older category 001, whose records are plots or tracks, with truncated times."""

    def __init__(self) -> None:
        self.plot = _Profile(1, ("141", "040", "090", "120"), "plot")
        self.tracked = _Profile(1, ("141", "040", "090", "120", "161"), "track")
        spec = self.tracked.spec
        self.time, self.doppler = field(spec, "141"), field(spec, "120")
        self.rho, self.theta = field(spec, "040", "RHO"), field(spec, "040", "THETA")
        self.level, self.invalid = field(spec, "090", "HGT"), field(spec, "090", "V")
        self.number = field(spec, "161")
        self.full: float | None = None  # time of day of the last sector message of category 002
        self.unrolled = sites.Unrolled(WRAP_001_S)

    def row(self, data: bytes, at: int) -> tuple[str, str, tuple[float, ...] | None, int]:
        """As for category 048; the profile depends on the first bit of item 020, the second item of both."""
        kind = _after_specification(data, at) + 2  # item 010 has two bytes
        tracked = kind < len(data) and bool(data[kind] & 0x80)
        places, end = (self.tracked if tracked else self.plot).places(data, at)
        time, place, level, doppler, *number = places
        if time < 0 or place < 0:
            return "", "", None, end
        known = level >= 0 and not self.invalid.of(data, level)
        row = (
            self._time(self.time.of(data, time)),
            self.rho.of(data, place) * NAUTICAL_MILE_M,
            math.radians(self.theta.of(data, place)),
            self.doppler.of(data, doppler) * NAUTICAL_MILE_M if doppler >= 0 else math.nan,
            math.nan,
            self.level.of(data, level) * FLIGHT_LEVEL_M if known else math.nan,
        )
        track = str(int(self.number.of(data, number[0]))) if number and number[0] >= 0 else ""
        return track, "", row, end

    def _time(self, truncated: float) -> float:
        """The time of day next to the last sector's; without sectors the truncated one, unwrapped."""
        if self.full is None:
            return self.unrolled(truncated)
        return truncated + WRAP_001_S * round((self.full - truncated) / WRAP_001_S)


class _Tracks062:
    """Tracks of a surveillance centre: time, position on the earth, height, velocity, track number, address."""

    def __init__(self) -> None:
        self.profile = _Profile(62, ("070", "105", "130", "136", "185", "040", "380"))
        spec = self.profile.spec
        self.time, self.number = field(spec, "070"), field(spec, "040")
        self.latitude, self.longitude = field(spec, "105", "LAT"), field(spec, "105", "LON")
        self.height, self.level = field(spec, "130"), field(spec, "136")
        self.east, self.north = field(spec, "185", "VX"), field(spec, "185", "VY")

    def row(self, data: bytes, at: int) -> tuple[str, str, tuple[float, ...] | None, int]:
        """Track, address and POSITION_COLUMNS of the record at `at`; its end."""
        (time, place, height, level, speed, number, derived), end = self.profile.places(data, at)
        if time < 0 or place < 0:
            return "", "", None, end
        altitude = self.height.of(data, height) * FOOT_M if height >= 0 else math.nan
        if height < 0 <= level:
            altitude = self.level.of(data, level) * FLIGHT_LEVEL_M
        row = (
            self.time.of(data, time),
            self.latitude.of(data, place),
            self.longitude.of(data, place),
            altitude,
            self.east.of(data, speed) if speed >= 0 else math.nan,
            self.north.of(data, speed) if speed >= 0 else math.nan,
            math.nan,
        )
        named = ""
        if derived >= 0 and data[derived] & 0x80:  # the address is the first part of the item
            _, begin = _named(data, derived)
            named = data[begin : begin + 3].hex()
        return str(int(self.number.of(data, number))) if number >= 0 else named, named, row, end


class Asterix:
    """A file of ASTERIX data blocks."""

    of_day = True

    def __init__(self, path: str, file: BinaryIO, truth: bool = False):
        """truth: only positions are decoded, of other categories only the blocks are followed."""
        self.path, self.file, self.truth = path, file, truth
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.decoders: dict[int, Any] = {48: _Plots048(), 1: _Plots001(), 62: _Tracks062()}
        self.sectors = _Profile(2, ("030",))
        self.sector_time = field(self.sectors.spec, "030")
        self.clock = sites.Unrolled(sites.DAY_S)
        self.sources: dict[str, str] = {}  # the first sensor of plots and the first of positions, SAC/SIC
        self.plots = False  # whether there are plots beside the truth

    def batches(self) -> Iterator[sites.Batch]:
        """The records in batches; raises ConfigError where a block or record violates the specification."""
        plots, positions = (
            sites.Gathered(sites.PLOTS, sites.PLOT_COLUMNS),
            sites.Gathered(sites.POSITIONS, sites.POSITION_COLUMNS),
        )
        for category, begin, data in self._blocks():
            gathered = positions if category == 62 else plots
            try:
                self._block(category, data, gathered)
            except Damaged as fault:
                place = f"{self.path}: byte {begin + fault.at}, record {self.records + 1}"
                raise ConfigError(f"{place}: not ASTERIX of category {category:03d}: {fault.what}; "
                                  f"{self.records} records were read before") from fault  # fmt: skip
            if len(gathered) >= sites.BATCH:
                yield gathered.taken()
        for gathered in (positions, plots):
            if len(gathered):
                yield gathered.taken()

    def _blocks(self) -> Iterator[tuple[int, int, bytes]]:
        """Category, first byte and bytes of each data block, its header included."""
        at = 0
        while head := self.file.read(3):
            length = int.from_bytes(head[1:3], "big")
            data = head + self.file.read(max(length - 3, 0))
            if len(head) < 3 or length < 4 or len(data) < length:
                expected = "must be a data block: category, length from 4 on, and as many bytes"
                got = (
                    f"category {head[0]}, length {length}, {len(data)} bytes"
                    if len(head) == 3
                    else f"{len(head)} bytes"
                )
                raise ConfigError(f"{self.path}: byte {at}: {expected}; got {got}; "
                                  f"{self.records} records were read before")  # fmt: skip
            yield head[0], at, data
            at += length

    def _block(self, category: int, data: bytes, gathered: sites.Gathered) -> None:
        if self.truth and category != 62:
            self.plots |= category in (1, 48)
            return
        if category == 2:
            self._sectors(data)
            return
        decoder, at = self.decoders.get(category), 3
        if decoder is None:
            self.skipped[f"data blocks of category {category:03d}"] += 1
            return
        while at < len(data):
            begin = at
            track, address, row, at = decoder.row(data, begin)
            self.records += 1
            if row is None:
                self.skipped["records without time or position"] += 1
            else:
                radar = _source(data, begin)
                if track and radar != self.sources.setdefault(gathered.kind, radar):
                    track = f"{radar}:{track}"  # two sensors number their tracks independently
                gathered.add(track, address, (self.clock(row[0]), *row[1:]), radar)

    def _sectors(self, data: bytes) -> None:
        """The full time of day, which category 001 leaves to the sector messages of its radar."""
        at = 3
        while at < len(data):
            (place,), at = self.sectors.places(data, at)
            if place >= 0:
                self.decoders[1].full = self.sector_time.of(data, place)


def looks_like(head: bytes) -> bool:
    """Whether a file with this beginning may be ASTERIX: at least one data block, of a category that radars send."""
    return len(head) >= 4 and head[0] in (*READ, 8, 20, 21, 34) and int.from_bytes(head[1:3], "big") >= 4
