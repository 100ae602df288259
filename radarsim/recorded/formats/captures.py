"""Data blocks of ASTERIX out of files: one after the other, in frames of a recorder, or in the datagrams of a network
capture.

A capture is a pcap or a pcapng file. Of its packets those of UDP over IPv4 or IPv6 are read; all others, fragments and
packets of which the capture kept only the beginning, are counted. A datagram holds blocks, perhaps with a few bytes of
the network's after them, or frames of a recorder. Sources: the Internet drafts draft-ietf-opsawg-pcap and -pcapng, RFC
791, 8200 and 768; the frames as CroatiaControlLtd/asterix describes them.
"""

import struct
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from radarsim.errors import ConfigError

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
FRAGMENTS = "fragments of datagrams, which are not put together"
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
    after = Counter[int]()
    for begin, link, data, whole in _packets(path, file, left):
        if not whole:
            left["packets of which the capture kept the beginning only"] += 1
            continue
        place = _datagram(data, link, left)
        if place is None:
            continue
        start, end = place
        found, more = content(data[start:end])
        if not found:
            left["datagrams without ASTERIX"] += 1
        elif more:
            after[more] += 1
        yield from ((category, begin + start + at, block) for category, at, block in found)
    for count, times in after.items():
        left[f"tails of {count} bytes after the data blocks of datagrams"] = times


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
            left["packets cut off by the end of the file"] += 1
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
            left["packets cut off by the end of the file"] += 1
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
        left[f"packets of the kind of link {link}, which is not read"] += 1
        return None
    while data[max(at - 2, 0) : at] in VLAN:
        at += 4
    version = {4: _ipv4, 6: _ipv6}.get(data[at] >> 4 if at < len(data) else 0)
    place = version(data, at) if version else None
    if isinstance(place, tuple) and place[1] <= len(data):
        return place[0] + 8, place[1]  # after ports, length and check sum
    left[place if isinstance(place, str) else "packets other than UDP"] += 1
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
