"""Data blocks of ASTERIX from bare files, recorder frames and network captures.

Data blocks follow each other in a file, or lie in frames of a recorder, or in the datagrams of a network capture.

A capture is a pcap or a pcapng file. Its UDP packets over IPv4 or IPv6 are read. Others are counted, and so are
fragments, and packets of which the capture has only the beginning. A datagram holds blocks, perhaps followed by a few
bytes of the network, or frames of a recorder. Sources: the Internet drafts draft-ietf-opsawg-pcap and -pcapng, RFC 791,
8200 and 768; the frames as CroatiaControlLtd/asterix describes them."""

import struct
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from radarsim.errors import ConfigError
from radarsim.language.translate import NUMBER_PLACEHOLDER, term

CHUNK_BYTES = 1 << 20
MIN_CHAIN_BLOCKS = 2  # of any category, one after the other, by which a file without frames is known
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


def is_chain(head: bytes) -> bool:
    """Whether a file with this beginning has data blocks of any category, one after the other.

    The last may go beyond the beginning; of a category that is in use a single one is enough."""
    offset, count, categories = 0, 0, set[int]()
    while offset + 4 <= len(head):
        length = int.from_bytes(head[offset + 1 : offset + 3], "big")
        if length < 4 or not head[offset]:
            return False
        categories.add(head[offset])
        offset, count = offset + length, count + 1
    return count >= MIN_CHAIN_BLOCKS or (count == 1 and categories <= USED_CATEGORIES)


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
        skipped[term("packets of the kind of link #, which is not read").replace(NUMBER_PLACEHOLDER, str(link))] += 1
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
