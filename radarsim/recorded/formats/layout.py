"""Where the items of an ASTERIX record lie: their lengths, and the places and units of their fields.

The specification is that of the library libasterix. Decoding a record into its objects takes 0.3 ms, so only the
lengths of items are followed here; the fields needed are cut out of many records at a time.

A data block is its category (1 byte), its length (2 bytes, these three included) and records; a record is a field
specification (7 bits a byte, the eighth says that another byte follows) and the items that it names.

Data blocks of ASTERIX out of files: one after the other, in frames of a recorder, or in the datagrams of a network
capture.

A capture is a pcap or a pcapng file. Of its packets those of UDP over IPv4 or IPv6 are read; all others, fragments and
packets of which the capture kept only the beginning, are counted. A datagram holds blocks, perhaps with a few bytes of
the network's after them, or frames of a recorder. Sources: the Internet drafts draft-ietf-opsawg-pcap and -pcapng, RFC
791, 8200 and 768; the frames as CroatiaControlLtd/asterix describes them."""

import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language import ANY, term
from radarsim.recorded.formats import sites

base: Any
try:
    from asterix import base
except ImportError:
    base = None  # `newest` says so

Skip = Callable[[bytes, int], int]  # data and start of an item: its end


class Damaged(ValueError):
    """Bytes that the specification does not allow: where they are, and what is wrong."""

    def __init__(self, at: int, what: str):
        super().__init__(what)
        self.at, self.what = at, what


class Field(NamedTuple):
    """A number in items: its first byte, the bits after it, bytes it spans, bits, sign, resolution."""

    first: int
    shift: int
    size: int
    bits: int
    signed: bool
    step: float

    def whole(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The bits as integers (n,) in the items that begin at `at` (n,); of no meaning where there is no item."""
        found = np.zeros(len(at), dtype=np.int64)
        for i in range(self.size):
            found = found << 8 | data[at + (self.first + i)]
        found = found >> self.shift & ((1 << self.bits) - 1)
        return found - (found >> (self.bits - 1) << self.bits) if self.signed else found

    def of(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The values (n,) in the items that begin at `at` (n,); NaN where that is negative, as there is no item."""
        return np.where(at < 0, np.nan, self.whole(data, at) * self.step)


class Flag(NamedTuple):
    """Bits in an item that goes on while the last bit of a byte says so: their byte, the bits after them, how many."""

    byte: int
    shift: int
    bits: int

    def of(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Their values (n,); 0 where there is no item, or it ends before them."""
        there = at >= 0
        for i in range(self.byte):
            there = there & (data[at + i] & 1 == 1)
        return np.where(there, data[at + self.byte] >> self.shift & (1 << self.bits) - 1, 0)


@cache
def newest(category: int) -> Any:
    """The newest edition of a category in libasterix."""
    try:
        from asterix import generated
    except ImportError as error:
        raise sites.needs("libasterix", "asterix") from error
    manifest: Any = generated.manifest
    return max(manifest["CATS"][category], key=lambda edition: edition.cv_edition)


def edition(category: int) -> str:
    """The number of the edition that is read."""
    return ".".join(map(str, newest(category).cv_edition))


@cache
def record(category: int, variant: str | None = None) -> Any:
    """The profile of a category's records; category 001 has one for a plot and one for a track."""
    profile = newest(category).cv_uap
    return profile.cv_uaps[variant] if variant else profile.cv_record


def field(spec: Any, item: str, *path: str) -> Field:
    """The place of a field in an item of a record; path leads through groups, by the names of libasterix."""
    return field_in(spec.cv_items_dict[item].cv_rule.cv_variation, *path)


def field_in(variation: Any, *path: str) -> Field:
    """The same in a given element or group."""
    offset = 0
    for name in path:
        for part, size in variation.cv_items_list:
            if issubclass(part, base.Item) and part.cv_non_spare.cv_name == name:
                variation = part.cv_non_spare.cv_rule.cv_variation
                break
            offset += size
        else:
            raise KeyError(name)
    content, bits = variation.cv_rule.cv_content, variation.cv_bit_size
    quantity = issubclass(content, base.ContentQuantity)
    signed = quantity and issubclass(content.cv_signedness, base.Signed)
    count = (offset % 8 + bits + 7) // 8
    return Field(offset // 8, 8 * count - offset % 8 - bits, count, bits, signed, content.cv_lsb if quantity else 1.0)


def flag(spec: Any, item: str, name: str) -> Flag:
    """The place of a flag in an item of parts of one byte."""
    for byte, part in enumerate(spec.cv_items_dict[item].cv_rule.cv_variation.cv_items_list):
        shift = 8
        for one, bits in (entry for entry in part if entry):
            shift -= bits
            if issubclass(one, base.Item) and one.cv_non_spare.cv_name == name:
                return Flag(byte, shift, bits)
    raise KeyError(name)


def variation_of(rule: Any) -> Any:
    """The variation behind a rule of libasterix; of one that depends on another item the default."""
    return getattr(rule, "cv_variation", None) or rule.cv_default_variation


@cache
def skip(variation: Any) -> Skip:
    """A function that finds the end of an item of a libasterix variation."""
    if issubclass(variation, base.Element | base.Group):
        size = variation.cv_bit_size // 8
        return lambda data, at: at + size
    kinds = ((base.Extended, _extended), (base.Repetitive, _repetitive), (base.Compound, _compound))
    (make,) = (make for kind, make in (*kinds, (base.Explicit, lambda _: _explicit)) if issubclass(variation, kind))
    return make(variation)


def _extended(variation: Any) -> Skip:
    parts = [(sum(one[1] if one else 1 for one in part) // 8, part[-1] is None) for part in variation.cv_items_list]

    def end(data: bytes, at: int) -> int:
        for size, extends in parts:
            at += size
            if not (extends and at <= len(data) and data[at - 1] & 1):
                return at
        raise Damaged(at - 1, "an item goes on after its last part")

    return end


def _repetitive(variation: Any) -> Skip:
    counted, inner = variation.cv_rep_bytes, variation.cv_variation
    bits = inner.cv_bit_size

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


def after_specification(data: bytes, at: int) -> int:
    """The end of a field specification, whatever it names; beyond the data if it does not end."""
    while at < len(data) and data[at] & 1:
        at += 1
    return at + 1


class Step(NamedTuple):
    """A stretch of items of fixed length: the wanted ones and where in it they begin; its length; then an item of any
    length, which may be wanted too (-1: no)."""

    wanted: list[tuple[int, int]]
    size: int
    last: int
    end: Skip | None


class Profile:
    """Places of the wanted items of a category's records; the plan of each field specification is made once."""

    def __init__(self, category: int, wanted: Sequence[str], variant: str | None = None):
        self.wanted = wanted
        self.spec = record(category, variant)
        self.items = [
            (one.cv_non_spare.cv_name, variation_of(one.cv_non_spare.cv_rule))
            if issubclass(one, base.UapItem)
            else None
            for one in self.spec.cv_items_list
        ]
        self.plans: dict[bytes, list[Step]] = {}

    def places(self, data: bytes, at: int) -> tuple[list[int], int]:
        """The start of each wanted item, -1 where it is absent, and the end of the record."""
        begin, at = at, after_specification(data, at)
        plan = self.plans.get(data[begin:at])
        if plan is None:
            plan = self._plan(data, begin)
        places = [-1] * len(self.wanted)
        for wanted, size, last, end in plan:
            for one, offset in wanted:
                places[one] = at + offset
            at += size
            if end is not None:
                if last >= 0:
                    places[last] = at
                at = end(data, at)
            if at > len(data):
                raise Damaged(begin, f"item {self._cut(data, begin)} ends after the data block")
        return places, at

    def _plan(self, data: bytes, begin: int) -> list[Step]:
        numbers, at = _named(data, begin)
        plan: list[Step] = []
        fixed: list[tuple[int, int]] = []
        size = 0
        for name, variation in self._of(numbers, begin):
            index = self.wanted.index(name) if name in self.wanted else -1
            if issubclass(variation, base.Element | base.Group):
                fixed += [(index, size)] if index >= 0 else []
                size += variation.cv_bit_size // 8
            else:
                plan.append(Step(fixed, size, index, skip(variation)))
                fixed, size = [], 0
        plan += [Step(fixed, size, -1, None)] if size else []
        if not plan:
            raise Damaged(begin, "a record without items")
        self.plans[data[begin:at]] = plan
        return plan

    def _of(self, numbers: list[int], begin: int) -> Iterator[tuple[str, Any]]:
        """The items of these numbers."""
        for number in numbers:
            item = self.items[number] if number < len(self.items) else None
            if item is None:
                raise Damaged(begin, f"an item of number {number + 1}, which the category has not")
            yield item

    def _cut(self, data: bytes, begin: int) -> str:
        """The first item of a record that ends after the data."""
        numbers, at = _named(data, begin)
        for name, variation in self._of(numbers, begin):
            at = skip(variation)(data, at)
            if at > len(data):
                return name
        raise AssertionError("a record that ends in the data")


# ---- captures --------------------------------------------------------------------------------------------------------
CHUNK = 1 << 20
MOST_AFTER = 16  # bytes of a network's own after the blocks of a datagram
LARGEST_PACKET = 1 << 24  # more is a damaged file
CATEGORIES = {*range(1, 35), 48, *range(61, 66), 129, 150, 204, 205, *range(238, 242), 247, 252}  # that are in use
Block = tuple[int, int, bytes]  # category, place in the file, bytes with the header


class Frame(NamedTuple):
    """Bytes before the blocks of a frame, of which the first two count it all, and bytes after them."""

    before: int
    after: bytes


FINAL, ORADIS = Frame(8, b"\xa5\xa5\xa5\xa5"), Frame(6, b"")

# Capture files
PCAP = {magic: order for order in "<>" for magic in (struct.pack(order + "I", one) for one in (0xA1B2C3D4, 0xA1B23C4D))}
PCAPNG, ORDER = b"\x0a\x0d\x0d\x0a", {struct.pack(order + "I", 0x1A2B3C4D): order for order in "<>"}
INTERFACE, OLD_PACKET, SIMPLE_PACKET, PACKET = 1, 2, 3, 6  # of pcapng
LINKS = {1: 14, 113: 16, 276: 20, 12: 0, 14: 0, 101: 0, 228: 0, 229: 0, 0: 4, 108: 4}  # bytes before a packet of IP
VLAN, UDP = (b"\x81\x00", b"\x88\xa8", b"\x91\x00"), 17  # the type before a tag
FRAGMENTS = term("fragments of datagrams, which are not put together")
CUT_OFF = term("packets cut off by the end of the file")
EXTENSIONS, FRAGMENT = (0, 43, 60), 44  # headers of IPv6 before the datagram


def blocks(path: str, file: BinaryIO, left: Counter[str]) -> Iterator[Block]:
    """The data blocks of a file; what a capture has besides is counted in `left`. ConfigError for a damaged file."""
    head = file.peek(CHUNK)  # type: ignore[attr-defined]
    if is_capture(head):
        yield from _captured(path, file, left)
    elif is_final(head):
        yield from _framed(path, file)
    else:
        yield from _bare(path, file)


def is_capture(head: bytes) -> bool:
    """Whether a file with this beginning is a network capture."""
    return head[:4] in PCAP or (head[:4] == PCAPNG and head[8:12] in ORDER)


def is_final(head: bytes) -> bool:
    """Whether a file with this beginning has frames of the kind FINAL."""
    count = int.from_bytes(head[:2], "big")
    return len(head) >= count and _frame(head[:count], FINAL) is not None


def _bare(path: str, file: BinaryIO) -> Iterator[Block]:
    data, begin = file.read(CHUNK), 0
    while data:
        at, size = 0, len(data)
        while at + 3 <= size:
            end = at + (data[at + 1] << 8 | data[at + 2])
            if not at + 4 <= end <= size:
                break
            yield data[at], begin + at, data[at:end]
            at = end
        begin, left, more = begin + at, data[at:], file.read(CHUNK)
        data = left + more
        length = int.from_bytes(data[1:3], "big")
        if left and (not more or length < 4):
            left = left[: max(length, 3)]
            got = f"category {left[0]}, length {length}, {len(left)} bytes" if len(left) > 2 else f"{len(left)} bytes"
            raise ConfigError(f"{path}: byte {begin}: must be a data block: category, length from 4 on, and as many "
                              f"bytes; got {got}")  # fmt: skip


def _framed(path: str, file: BinaryIO) -> Iterator[Block]:
    begin = 0
    while head := file.read(2):
        data = head + file.read(max(int.from_bytes(head, "big") - 2, 0))
        found = _frame(data, FINAL)
        if found is None:
            raise ConfigError(f"{path}: byte {begin}: must be a frame: two bytes that count it, 6 more, data blocks, "
                              f"A5 A5 A5 A5; got {data[:12].hex(' ')} and {max(len(data) - 12, 0)} bytes")  # fmt: skip
        yield from ((category, begin + at, block) for category, at, block in found)
        begin += len(data)


def _frame(data: bytes, kind: Frame) -> list[Block] | None:
    """The blocks of one frame; none where it is not of this kind."""
    count = int.from_bytes(data[:2], "big")
    if count != len(data) or count < kind.before + 4 or not data.endswith(kind.after):
        return None
    found, end = _chain(data, kind.before, count - len(kind.after))
    return found if end == count - len(kind.after) else None


def _chain(data: bytes, at: int, end: int) -> tuple[list[Block], int]:
    """The blocks one after the other from a byte on, and the end of the last."""
    found = []
    while at + 4 <= end and data[at] in CATEGORIES:
        length = int.from_bytes(data[at + 1 : at + 3], "big")
        if length < 4 or at + length > end:
            break
        found.append((data[at], at, data[at : at + length]))
        at += length
    return found, at


def content(data: bytes) -> tuple[list[Block], int]:
    """The blocks of a datagram, with their places in it, and how many bytes stand after them."""
    found, end = _chain(data, 0, len(data))
    if found and len(data) - end <= MOST_AFTER:
        return found, len(data) - end
    found, at = [], 0
    while at < len(data):
        count = int.from_bytes(data[at : at + 2], "big")
        one = next(filter(None, (_frame(data[at : at + count], kind) for kind in (FINAL, ORADIS))), None)
        if not one:
            return [], 0
        found += [(category, at + place, block) for category, place, block in one]
        at += count
    return found, 0


def _captured(path: str, file: BinaryIO, left: Counter[str]) -> Iterator[Block]:
    for begin, link, data, whole in _packets(path, file, left):
        if not whole:
            left[term("packets cut short by the capture")] += 1
            continue
        place = _datagram(data, link, left)
        if place is None:
            continue
        start, end = place
        found, more = content(data[start:end])
        if not found:
            left[term("datagrams without ASTERIX")] += 1
        elif more:
            left[term("tails of a few bytes after the data blocks of datagrams")] += 1
        yield from ((category, begin + start + at, block) for category, at, block in found)


def _packets(path: str, file: BinaryIO, left: Counter[str]) -> Iterator[tuple[int, int, bytes, bool]]:
    """Place in the file, kind of link and bytes of each packet, and whether these are all that it had."""
    head = file.read(4)
    yield from (_pcap if head in PCAP else _pcapng)(path, file, head, left)


def _pcap(path: str, file: BinaryIO, magic: bytes, left: Counter[str]) -> Iterator[tuple[int, int, bytes, bool]]:
    order, at = PCAP[magic], 24
    rest = file.read(20)
    if len(rest) < 20:
        raise ConfigError(f"{path}: byte 4: must be the header of a pcap file, 24 bytes; it ends after {4 + len(rest)}")
    link = struct.unpack_from(order + "I", rest, 16)[0] & 0xFFFF  # the upper half: how long a check sum is
    header = struct.Struct(order + "8xII")
    while head := file.read(16):
        size, had = header.unpack(head) if len(head) == 16 else (0, 0)
        if size > LARGEST_PACKET:
            raise ConfigError(f"{path}: byte {at}: must be a packet of at most {LARGEST_PACKET} bytes; got {size}")
        data = file.read(size)
        if len(head) < 16 or len(data) < size:
            left[CUT_OFF] += 1
            return
        yield at + 16, link, data, size >= had
        at += 16 + size


def _pcapng(path: str, file: BinaryIO, magic: bytes, left: Counter[str]) -> Iterator[tuple[int, int, bytes, bool]]:
    at, order, head = 0, "<", magic + file.read(8)
    links: list[int] = []
    while head:
        if head[:4] == PCAPNG:  # a section, which says its own order of bytes
            order, links = ORDER.get(head[8:12], ""), []
        kind, size = struct.unpack(order + "II", head[:8]) if order and len(head) == 12 else (0, 0)
        if len(head) == 12 and not (12 <= size <= LARGEST_PACKET and size % 4 == 0):
            raise ConfigError(f"{path}: byte {at}: must be a block of a pcapng file; got {head.hex(' ')}")
        body = head[8:] + file.read(size - 12) if size else b""
        if len(head) < 12 or len(body) < size - 8:
            left[CUT_OFF] += 1
            return
        body = body[:-4]  # the size stands once more behind it
        if kind == INTERFACE and len(body) >= 2:
            links.append(struct.unpack_from(order + "H", body)[0])
        elif kind in (PACKET, OLD_PACKET, SIMPLE_PACKET):
            yield _packet(path, order, kind, body, links, at)
        at += size
        head = file.read(12)


def _packet(path: str, order: str, kind: int, body: bytes, links: list[int], at: int) -> tuple[int, int, bytes, bool]:
    """A packet of a pcapng file."""
    form = {PACKET: "I8xII", OLD_PACKET: "H10xII", SIMPLE_PACKET: "I"}[kind]
    start = struct.calcsize(order + form)
    numbers = struct.unpack_from(order + form, body) if len(body) >= start else (len(links), 0, 0)
    number, size, had = numbers if kind != SIMPLE_PACKET else (0, min(numbers[0], len(body) - start), numbers[0])
    if number >= len(links) or start + size > len(body):
        raise ConfigError(f"{path}: byte {at}: must be a packet of an interface described before; got interface "
                          f"{number}, {size} of {len(body)} bytes")  # fmt: skip
    return at + 8 + start, links[number], body[start : start + size], size >= had


def _datagram(data: bytes, link: int, left: Counter[str]) -> tuple[int, int] | None:
    """Where the content of a packet's datagram of UDP begins and ends; none where it has none, which is counted."""
    at = LINKS.get(link)
    if at is None:
        left[term("packets of the kind of link #, which is not read").replace(ANY, str(link))] += 1
        return None
    while data[max(at - 2, 0) : at] in VLAN:
        at += 4
    version = {4: _ipv4, 6: _ipv6}.get(data[at] >> 4 if at < len(data) else 0)
    place = version(data, at) if version else None
    if isinstance(place, tuple) and place[1] <= len(data):
        return place[0] + 8, place[1]  # after ports, length and check sum
    left[place if isinstance(place, str) else term("packets other than UDP")] += 1
    return None


def _ipv4(data: bytes, at: int) -> tuple[int, int] | str | None:
    """Begin and end of a datagram of UDP in a packet of IPv4; what it is instead."""
    if len(data) < at + 20 or data[at + 9] != UDP:
        return None
    if int.from_bytes(data[at + 6 : at + 8], "big") & 0x3FFF:  # more to come, or not the first
        return FRAGMENTS
    return at + 4 * (data[at] & 15), at + int.from_bytes(data[at + 2 : at + 4], "big")


def _ipv6(data: bytes, at: int) -> tuple[int, int] | str | None:
    """The same for IPv6, over the headers that may stand between."""
    if len(data) < at + 40:
        return None
    end = at + 40 + int.from_bytes(data[at + 4 : at + 6], "big")
    after, at = data[at + 6], at + 40
    while after in EXTENSIONS and at + 8 <= len(data):
        after, at = data[at], at + 8 + 8 * data[at + 1]
    if after == FRAGMENT:
        return FRAGMENTS
    return (at, end) if after == UDP else None
