"""Find the fields of ASTERIX records, and the data blocks of a file.

The library libasterix has the specification. It decodes a record into objects in 0.3 ms, so this module only follows
the lengths of items; the fields needed are read from many records at a time.

A data block is its category (1 byte), its length (2 bytes, these three included) and records; a record is a field
specification (7 bits a byte, the eighth says that another byte follows) and the items that it names.

Data blocks follow each other in a file, or lie in frames of a recorder, or in the datagrams of a network capture.

A capture is a pcap or a pcapng file. Its UDP packets over IPv4 or IPv6 are read. Others are counted, and so are
fragments, and packets of which the capture has only the beginning. A datagram holds blocks, perhaps followed by a few
bytes of the network, or frames of a recorder. Sources: the Internet drafts draft-ietf-opsawg-pcap and -pcapng, RFC 791,
8200 and 768; the frames as CroatiaControlLtd/asterix describes them."""

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

ItemEnd = Callable[[bytes, int], int]  # data and start of an item: its end


class DamagedRecord(ValueError):
    """Bytes that the specification does not allow: their offset, and the fault."""

    def __init__(self, offset: int, fault: str):
        super().__init__(fault)
        self.offset, self.fault = offset, fault


class Field(NamedTuple):
    """A number in items: its first byte, the bits after it, bytes it spans, bits, sign, resolution."""

    first: int
    shift: int
    size: int
    bits: int
    signed: bool
    step: float

    def integers(self, data: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """The bits as integers (n,) in the items that begin at `starts` (n,); meaningless where there is no item."""
        bits = np.zeros(len(starts), dtype=np.int64)
        for i in range(self.size):
            bits = bits << 8 | data[starts + (self.first + i)]
        bits = bits >> self.shift & ((1 << self.bits) - 1)
        return bits - (bits >> (self.bits - 1) << self.bits) if self.signed else bits

    def values(self, data: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """The values (n,) in the items that begin at `starts` (n,); NaN where that is negative, as there is no item."""
        return np.where(starts < 0, np.nan, self.integers(data, starts) * self.step)


class Flag(NamedTuple):
    """Bits in an item that goes on while the last bit of a byte says so: their byte, the bits after them, how many."""

    byte: int
    shift: int
    bits: int

    def values(self, data: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Their values (n,); 0 where there is no item, or it ends before them."""
        is_present = starts >= 0
        for i in range(self.byte):
            is_present = is_present & (data[starts + i] & 1 == 1)
        return np.where(is_present, data[starts + self.byte] >> self.shift & (1 << self.bits) - 1, 0)


@cache
def newest_edition(category: int) -> Any:
    """The newest edition of a category in libasterix."""
    try:
        from asterix import generated
    except ImportError as error:
        raise sites.missing_package("libasterix", "asterix") from error
    manifest: Any = generated.manifest
    return max(manifest["CATS"][category], key=lambda edition: edition.cv_edition)


def edition_number(category: int) -> str:
    """The number of the newest edition, by which records are read."""
    return ".".join(map(str, newest_edition(category).cv_edition))


@cache
def record_profile(category: int, variant: str | None = None) -> Any:
    """The profile of a category's records; category 001 has one for a plot and one for a track."""
    profile = newest_edition(category).cv_uap
    return profile.cv_uaps[variant] if variant else profile.cv_record


def locate_field(spec: Any, item: str, *path: str) -> Field:
    """The offset of a field in an item of a record; path leads through groups, by the names of libasterix."""
    return locate_field_in(spec.cv_items_dict[item].cv_rule.cv_variation, *path)


def locate_field_in(variation: Any, *path: str) -> Field:
    """The offset of a field in an element or group."""
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


def locate_flag(spec: Any, item: str, name: str) -> Flag:
    """The offset of a flag in an item whose parts have one byte each."""
    for byte, parts in enumerate(spec.cv_items_dict[item].cv_rule.cv_variation.cv_items_list):
        shift = 8
        for part, bits in (entry for entry in parts if entry):
            shift -= bits
            if issubclass(part, base.Item) and part.cv_non_spare.cv_name == name:
                return Flag(byte, shift, bits)
    raise KeyError(name)


def variation_of(rule: Any) -> Any:
    """The variation of a rule of libasterix; the default if it depends on another item."""
    return getattr(rule, "cv_variation", None) or rule.cv_default_variation


@cache
def item_end_function(variation: Any) -> ItemEnd:
    """A function that finds the end of an item of a libasterix variation."""
    if issubclass(variation, base.Element | base.Group):
        size = variation.cv_bit_size // 8
        return lambda data, start: start + size
    kinds = (
        (base.Extended, _extended_item_end),
        (base.Repetitive, _repetitive_item_end),
        (base.Compound, _compound_item_end),
    )
    (make,) = (
        make for kind, make in (*kinds, (base.Explicit, lambda _: _explicit_item_end)) if issubclass(variation, kind)
    )
    return make(variation)


def _extended_item_end(variation: Any) -> ItemEnd:
    parts = [
        (sum(field[1] if field else 1 for field in part) // 8, part[-1] is None) for part in variation.cv_items_list
    ]

    def end(data: bytes, offset: int) -> int:
        for size, extends in parts:
            offset += size
            if not (extends and offset <= len(data) and data[offset - 1] & 1):
                return offset
        raise DamagedRecord(offset - 1, "an item goes on after its last part")

    return end


def _repetitive_item_end(variation: Any) -> ItemEnd:
    count_bytes, inner = variation.cv_rep_bytes, variation.cv_variation
    bits = inner.cv_bit_size

    def by_count(data: bytes, start: int) -> int:
        return start + count_bytes + int.from_bytes(data[start : start + count_bytes], "big") * (bits // 8)

    def by_bit(data: bytes, start: int) -> int:
        start += (bits + 1) // 8
        while start <= len(data) and data[start - 1] & 1:
            start += (bits + 1) // 8
        return start

    return by_count if count_bytes else by_bit


def _explicit_item_end(data: bytes, start: int) -> int:
    if start < len(data) and data[start] == 0:
        raise DamagedRecord(start, "an item of length 0")
    return start + data[start] if start < len(data) else start + 1


def _compound_item_end(variation: Any) -> ItemEnd:
    parts = [item and item_end_function(variation_of(item.cv_rule)) for item in variation.cv_items_list]

    def end(data: bytes, offset: int) -> int:
        begin = offset
        numbers, offset = _read_specification(data, offset)
        for number in numbers:
            part = parts[number] if number < len(parts) else None
            if part is None:
                raise DamagedRecord(begin, f"a part {number + 1} that the item has not")
            offset = part(data, offset)
        return offset

    return end


def _read_specification(data: bytes, offset: int) -> tuple[list[int], int]:
    """The numbers, from 0, in a field specification, and its end."""
    begin, numbers = offset, []
    while True:
        if offset >= len(data):
            raise DamagedRecord(begin, "a field specification that does not end")
        byte = data[offset]
        numbers += [7 * (offset - begin) + bit for bit in range(7) if byte >> (7 - bit) & 1]
        offset += 1
        if not byte & 1:
            return numbers, offset


def specification_end(data: bytes, offset: int) -> int:
    """The end of a field specification, whatever it names; beyond the data if it does not end."""
    while offset < len(data) and data[offset] & 1:
        offset += 1
    return offset + 1


class FixedItems(NamedTuple):
    """Items of fixed length that follow each other: the requested ones with their offsets, and the total length.

    Then an item of variable length: its index if it is requested, else -1."""

    items: list[tuple[int, int]]
    size: int
    variable_item: int
    end: ItemEnd | None


class Profile:
    """Places of the requested items of a category's records; each field specification is planned once."""

    def __init__(self, category: int, names: Sequence[str], variant: str | None = None):
        self.names = names
        self.spec = record_profile(category, variant)
        self.items = [
            (item.cv_non_spare.cv_name, variation_of(item.cv_non_spare.cv_rule))
            if issubclass(item, base.UapItem)
            else None
            for item in self.spec.cv_items_list
        ]
        self.plans: dict[bytes, list[FixedItems]] = {}

    def offsets(self, data: bytes, offset: int) -> tuple[list[int], int]:
        """The start of each requested item, -1 if it is absent, and the end of the record."""
        begin, offset = offset, specification_end(data, offset)
        plan = self.plans.get(data[begin:offset])
        if plan is None:
            plan = self._plan(data, begin)
        offsets = [-1] * len(self.names)
        for fixed_items, size, variable_item, end in plan:
            for index, item_offset in fixed_items:
                offsets[index] = offset + item_offset
            offset += size
            if end is not None:
                if variable_item >= 0:
                    offsets[variable_item] = offset
                offset = end(data, offset)
            if offset > len(data):
                raise DamagedRecord(begin, f"item {self._cut_off_item(data, begin)} ends after the data block")
        return offsets, offset

    def _plan(self, data: bytes, begin: int) -> list[FixedItems]:
        numbers, end = _read_specification(data, begin)
        plan: list[FixedItems] = []
        fixed: list[tuple[int, int]] = []
        size = 0
        for name, variation in self._numbered_items(numbers, begin):
            index = self.names.index(name) if name in self.names else -1
            if issubclass(variation, base.Element | base.Group):
                fixed += [(index, size)] if index >= 0 else []
                size += variation.cv_bit_size // 8
            else:
                plan.append(FixedItems(fixed, size, index, item_end_function(variation)))
                fixed, size = [], 0
        plan += [FixedItems(fixed, size, -1, None)] if size else []
        if not plan:
            raise DamagedRecord(begin, "a record without items")
        self.plans[data[begin:end]] = plan
        return plan

    def _numbered_items(self, numbers: list[int], begin: int) -> Iterator[tuple[str, Any]]:
        """The items of these numbers."""
        for number in numbers:
            item = self.items[number] if number < len(self.items) else None
            if item is None:
                raise DamagedRecord(begin, f"an item of number {number + 1}, which the category has not")
            yield item

    def _cut_off_item(self, data: bytes, begin: int) -> str:
        """The first item of a record that ends after the data."""
        numbers, offset = _read_specification(data, begin)
        for name, variation in self._numbered_items(numbers, begin):
            offset = item_end_function(variation)(data, offset)
            if offset > len(data):
                return name
        raise AssertionError("a record that ends in the data")


# ---- captures --------------------------------------------------------------------------------------------------------
CHUNK_BYTES = 1 << 20
MAX_TRAILING_BYTES = 16  # bytes of a network's own after the blocks of a datagram
MAX_PACKET_BYTES = 1 << 24  # more is a damaged file
USED_CATEGORIES = {*range(1, 35), 48, *range(61, 66), 129, 150, 204, 205, *range(238, 242), 247, 252}  # that are in use
Block = tuple[int, int, bytes]  # category, offset in the file, bytes with the header


class FrameFormat(NamedTuple):
    """Bytes before the blocks of a frame, of which the first two count it all, and bytes after them."""

    header_bytes: int
    trailer: bytes


FINAL, ORADIS = FrameFormat(8, b"\xa5\xa5\xa5\xa5"), FrameFormat(6, b"")

# Capture files
PCAP_ORDERS = {
    magic: order
    for order in "<>"
    for magic in (struct.pack(order + "I", number) for number in (0xA1B2C3D4, 0xA1B23C4D))
}
PCAPNG_MAGIC, PCAPNG_ORDERS = b"\x0a\x0d\x0d\x0a", {struct.pack(order + "I", 0x1A2B3C4D): order for order in "<>"}
INTERFACE, OLD_PACKET, SIMPLE_PACKET, PACKET = 1, 2, 3, 6  # of pcapng
# bytes before a packet of IP
LINK_HEADER_BYTES = {1: 14, 113: 16, 276: 20, 12: 0, 14: 0, 101: 0, 228: 0, 229: 0, 0: 4, 108: 4}
VLAN_TYPES, UDP = (b"\x81\x00", b"\x88\xa8", b"\x91\x00"), 17  # the type before a tag
FRAGMENT_REASON = term("fragments of datagrams, which are not put together")
CUT_OFF_REASON = term("packets cut off by the end of the file")
IPV6_EXTENSIONS, IPV6_FRAGMENT = (0, 43, 60), 44  # headers of IPv6 before the datagram


def blocks(path: str, file: BinaryIO, skipped: Counter[str]) -> Iterator[Block]:
    """The data blocks of a file; other contents are counted in `skipped`. Raises ConfigError if damaged."""
    head = file.peek(CHUNK_BYTES)  # type: ignore[attr-defined]
    if is_capture(head):
        yield from _capture_blocks(path, file, skipped)
    elif is_final(head):
        yield from _frame_blocks(path, file)
    else:
        yield from _bare_blocks(path, file)


def is_capture(head: bytes) -> bool:
    """Whether a file with this beginning is a network capture."""
    return head[:4] in PCAP_ORDERS or (head[:4] == PCAPNG_MAGIC and head[8:12] in PCAPNG_ORDERS)


def is_final(head: bytes) -> bool:
    """Whether a file with this beginning has frames of the kind FINAL."""
    count = int.from_bytes(head[:2], "big")
    return len(head) >= count and _blocks_of_frame(head[:count], FINAL) is not None


def _bare_blocks(path: str, file: BinaryIO) -> Iterator[Block]:
    data, chunk_start = file.read(CHUNK_BYTES), 0
    while data:
        offset, size = 0, len(data)
        while offset + 3 <= size:
            end = offset + (data[offset + 1] << 8 | data[offset + 2])
            if not offset + 4 <= end <= size:
                break
            yield data[offset], chunk_start + offset, data[offset:end]
            offset = end
        chunk_start, tail, next_bytes = chunk_start + offset, data[offset:], file.read(CHUNK_BYTES)
        data = tail + next_bytes
        length = int.from_bytes(data[1:3], "big")
        if tail and (not next_bytes or length < 4):
            tail = tail[: max(length, 3)]
            got = f"category {tail[0]}, length {length}, {len(tail)} bytes" if len(tail) > 2 else f"{len(tail)} bytes"
            raise ConfigError(f"{path}: byte {chunk_start}: must be a data block: category, length from 4 on, and as "
                              f"many bytes; got {got}")  # fmt: skip


def _frame_blocks(path: str, file: BinaryIO) -> Iterator[Block]:
    frame_start = 0
    while head := file.read(2):
        data = head + file.read(max(int.from_bytes(head, "big") - 2, 0))
        frame_blocks = _blocks_of_frame(data, FINAL)
        if frame_blocks is None:
            got = f"{data[:12].hex(' ')} and {max(len(data) - 12, 0)} bytes"
            raise ConfigError(f"{path}: byte {frame_start}: must be a frame: two bytes that count it, 6 more, data "
                              f"blocks, A5 A5 A5 A5; got {got}")  # fmt: skip
        yield from ((category, frame_start + offset, block) for category, offset, block in frame_blocks)
        frame_start += len(data)


def _blocks_of_frame(data: bytes, kind: FrameFormat) -> list[Block] | None:
    """The blocks of one frame; None if it is not of this kind."""
    count = int.from_bytes(data[:2], "big")
    if count != len(data) or count < kind.header_bytes + 4 or not data.endswith(kind.trailer):
        return None
    chain, end = _read_chain(data, kind.header_bytes, count - len(kind.trailer))
    return chain if end == count - len(kind.trailer) else None


def _read_chain(data: bytes, offset: int, end: int) -> tuple[list[Block], int]:
    """The blocks one after the other from a byte on, and the end of the last."""
    chain = []
    while offset + 4 <= end and data[offset] in USED_CATEGORIES:
        length = int.from_bytes(data[offset + 1 : offset + 3], "big")
        if length < 4 or offset + length > end:
            break
        chain.append((data[offset], offset, data[offset : offset + length]))
        offset += length
    return chain, offset


def datagram_blocks(data: bytes) -> tuple[list[Block], int]:
    """The blocks of a datagram, with their offsets in it, and how many bytes stand after them."""
    chain, end = _read_chain(data, 0, len(data))
    if chain and len(data) - end <= MAX_TRAILING_BYTES:
        return chain, len(data) - end
    chain, start = [], 0
    while start < len(data):
        count = int.from_bytes(data[start : start + 2], "big")
        frame = next(
            filter(None, (_blocks_of_frame(data[start : start + count], kind) for kind in (FINAL, ORADIS))), None
        )
        if not frame:
            return [], 0
        chain += [(category, start + offset, block) for category, offset, block in frame]
        start += count
    return chain, 0


def _capture_blocks(path: str, file: BinaryIO, skipped: Counter[str]) -> Iterator[Block]:
    for begin, link, data, is_complete in _capture_packets(path, file, skipped):
        if not is_complete:
            skipped[term("packets cut short by the capture")] += 1
            continue
        payload = _udp_payload(data, link, skipped)
        if payload is None:
            continue
        start, end = payload
        chain, trailing = datagram_blocks(data[start:end])
        if not chain:
            skipped[term("datagrams without ASTERIX")] += 1
        elif trailing:
            skipped[term("tails of a few bytes after the data blocks of datagrams")] += 1
        yield from ((category, begin + start + offset, block) for category, offset, block in chain)


def _capture_packets(path: str, file: BinaryIO, skipped: Counter[str]) -> Iterator[tuple[int, int, bytes, bool]]:
    """Place in the file, kind of link and bytes of each packet, and whether these are all that it had."""
    head = file.read(4)
    yield from (_pcap_packets if head in PCAP_ORDERS else _pcapng_packets)(path, file, head, skipped)


def _pcap_packets(
    path: str, file: BinaryIO, magic: bytes, skipped: Counter[str]
) -> Iterator[tuple[int, int, bytes, bool]]:
    order, offset = PCAP_ORDERS[magic], 24
    header_rest = file.read(20)
    if len(header_rest) < 20:
        raise ConfigError(
            f"{path}: byte 4: must be the header of a pcap file, 24 bytes; it ends after {4 + len(header_rest)}"
        )
    link = struct.unpack_from(order + "I", header_rest, 16)[0] & 0xFFFF  # the upper half: how long a check sum is
    header = struct.Struct(order + "8xII")
    while head := file.read(16):
        size, original_size = header.unpack(head) if len(head) == 16 else (0, 0)
        if size > MAX_PACKET_BYTES:
            raise ConfigError(
                f"{path}: byte {offset}: must be a packet of at most {MAX_PACKET_BYTES} bytes; got {size}"
            )
        data = file.read(size)
        if len(head) < 16 or len(data) < size:
            skipped[CUT_OFF_REASON] += 1
            return
        yield offset + 16, link, data, size >= original_size
        offset += 16 + size


def _pcapng_packets(
    path: str, file: BinaryIO, magic: bytes, skipped: Counter[str]
) -> Iterator[tuple[int, int, bytes, bool]]:
    offset, order, head = 0, "<", magic + file.read(8)
    links: list[int] = []
    while head:
        if head[:4] == PCAPNG_MAGIC:  # a section, which says its own order of bytes
            order, links = PCAPNG_ORDERS.get(head[8:12], ""), []
        kind, size = struct.unpack(order + "II", head[:8]) if order and len(head) == 12 else (0, 0)
        if len(head) == 12 and not (12 <= size <= MAX_PACKET_BYTES and size % 4 == 0):
            raise ConfigError(f"{path}: byte {offset}: must be a block of a pcapng file; got {head.hex(' ')}")
        body = head[8:] + file.read(size - 12) if size else b""
        if len(head) < 12 or len(body) < size - 8:
            skipped[CUT_OFF_REASON] += 1
            return
        body = body[:-4]  # the size stands once more behind it
        if kind == INTERFACE and len(body) >= 2:
            links.append(struct.unpack_from(order + "H", body)[0])
        elif kind in (PACKET, OLD_PACKET, SIMPLE_PACKET):
            yield _pcapng_packet(path, order, kind, body, links, offset)
        offset += size
        head = file.read(12)


def _pcapng_packet(
    path: str, order: str, kind: int, body: bytes, links: list[int], offset: int
) -> tuple[int, int, bytes, bool]:
    """A packet of a pcapng file."""
    layout = {PACKET: "I8xII", OLD_PACKET: "H10xII", SIMPLE_PACKET: "I"}[kind]
    start = struct.calcsize(order + layout)
    numbers = struct.unpack_from(order + layout, body) if len(body) >= start else (len(links), 0, 0)
    number, size, original_size = (
        numbers if kind != SIMPLE_PACKET else (0, min(numbers[0], len(body) - start), numbers[0])
    )
    if number >= len(links) or start + size > len(body):
        raise ConfigError(f"{path}: byte {offset}: must be a packet of an interface described before; got interface "
                          f"{number}, {size} of {len(body)} bytes")  # fmt: skip
    return offset + 8 + start, links[number], body[start : start + size], size >= original_size


def _udp_payload(data: bytes, link: int, skipped: Counter[str]) -> tuple[int, int] | None:
    """Begin and end of the payload of a UDP packet; None for other packets, which are counted."""
    start = LINK_HEADER_BYTES.get(link)
    if start is None:
        skipped[term("packets of the kind of link #, which is not read").replace(ANY, str(link))] += 1
        return None
    while data[max(start - 2, 0) : start] in VLAN_TYPES:
        start += 4
    find_udp = {4: _ipv4_udp, 6: _ipv6_udp}.get(data[start] >> 4 if start < len(data) else 0)
    payload = find_udp(data, start) if find_udp else None
    if isinstance(payload, tuple) and payload[1] <= len(data):
        return payload[0] + 8, payload[1]  # after ports, length and check sum
    skipped[payload if isinstance(payload, str) else term("packets other than UDP")] += 1
    return None


def _ipv4_udp(data: bytes, start: int) -> tuple[int, int] | str | None:
    """Begin and end of a UDP datagram in an IPv4 packet; else the reason why it is skipped, or None."""
    if len(data) < start + 20 or data[start + 9] != UDP:
        return None
    if int.from_bytes(data[start + 6 : start + 8], "big") & 0x3FFF:  # more to come, or not the first
        return FRAGMENT_REASON
    return start + 4 * (data[start] & 15), start + int.from_bytes(data[start + 2 : start + 4], "big")


def _ipv6_udp(data: bytes, start: int) -> tuple[int, int] | str | None:
    """Begin and end of a UDP datagram in an IPv6 packet, after its extension headers; else as `_ipv4_udp`."""
    if len(data) < start + 40:
        return None
    end = start + 40 + int.from_bytes(data[start + 4 : start + 6], "big")
    next_header, start = data[start + 6], start + 40
    while next_header in IPV6_EXTENSIONS and start + 8 <= len(data):
        next_header, start = data[start], start + 8 + 8 * data[start + 1]
    if next_header == IPV6_FRAGMENT:
        return FRAGMENT_REASON
    return (start, end) if next_header == UDP else None
