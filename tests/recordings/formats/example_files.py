"""Recordings made byte by byte from the specifications, and what `import` makes of them."""

import csv
import io
import struct

import numpy as np
import pytest

from radarsim.errors import ConfigError
from radarsim.recordings.formats.asterix import TEXT_COLUMNS
from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.import_recording import import_recording
from radarsim.recordings.formats.sites import Site

PLAIN = Options()
SITE = Site(52.3, 4.76, 12.0)
EARTH_M = 6.4e6  # places are differences of coordinates of that size; an angle of latitude times it is a way, at most
PLACE = {"size": EARTH_M, "operations": 12}  # a rotation of such a difference, each coordinate of four operations
CLOCK_S = np.spacing(1.8e9)  # the last place of a time from 1970


def block(category, *records):
    """A data block: category, length, records."""
    data = b"".join(records)
    return bytes([category]) + struct.pack(">H", len(data) + 3) + data


def plot_048(time=100.0, rho=12800, theta=5000, radar=(25, 10), **more):
    """A record of category 048: field specification and items 010, 140, 020, 040, then those that are given.

    time in s; rho in 1/256 NM and theta in 2**-16 turns as they stand in the file; kind: item 020; code: Mode 3/A with
    its bits; level in 1/4 flight levels; address, callsign, track; calculated Doppler speed and (raw speed, span, MHz).
    """
    items = {
        1: bytes(radar),
        2: round(time * 128).to_bytes(3, "big"),
        3: more.get("kind", b"\x21\x00"),
        4: struct.pack(">HH", rho, theta),
    }
    if "code" in more:
        items[5] = struct.pack(">H", more["code"])
    if "level" in more:
        items[6] = struct.pack(
            ">H", more["level"] & 0x3FFF | more.get("invalid", 0) << 15 | more.get("garbled", 0) << 14
        )
    if "address" in more:
        items[8] = more["address"].to_bytes(3, "big")
    if "callsign" in more:
        items[9] = letters(more["callsign"])
    if "comment" in more:  # item 250: a number of blocks of eight bytes, here of zeros
        items[10] = bytes([more["comment"]]) + bytes(8 * more["comment"])
    if "track" in more:
        items[11] = struct.pack(">H", more["track"])
    if "calculated" in more:
        items[20] = b"\x80" + struct.pack(">H", more["calculated"] & 0x3FF | more.get("doubtful", 0) << 15)
    if "raw" in more:
        first = items.get(20, b"")[1:]
        parts = 0xC0 if first else 0x40
        items[20] = bytes([parts]) + first + b"\x01" + struct.pack(">hHH", *more["raw"])
    return specified(items)


def specified(items):
    """Items by their numbers, after the field specification that names them."""
    size = (max(items) + 6) // 7
    bits = [[number in items for number in range(7 * i + 1, 7 * i + 8)] for i in range(size)]
    head = bytes(sum(bit << (7 - j) for j, bit in enumerate(own)) | (i < size - 1) for i, own in enumerate(bits))
    return head + b"".join(items[number] for number in sorted(items))


def letters(text):
    """Eight characters of six bits."""
    whole = 0
    for one in text.ljust(8):
        whole = whole << 6 | ord(one) & 63
    return whole.to_bytes(6, "big")


def service_034(radar, place=None, turn_s=None):
    """A north marker: 010, 000, and the time of a turn and the place of the radar (degrees, degrees, m)."""
    items = {1: bytes(radar), 2: b"\x01"}
    if turn_s:
        items[5] = struct.pack(">H", round(128 * turn_s))
    if place:
        lat, lon, height = place
        angles = b"".join(round(one * 2**23 / 180).to_bytes(3, "big", signed=True) for one in (lat, lon))
        items[11] = struct.pack(">h", height) + angles
    return specified(items)


def position_021(time, latitude, longitude, **more):
    """A report of ADS-B: 010, 040, 073 (time of reception), 080, 131 (fine position), and what is given; items: bytes
    by number, in place of these."""
    items = {
        1: b"\x19\x63",
        2: more.get("kind", b"\x00"),
        7: struct.pack(">ii", round(latitude * 2**30 / 180), round(longitude * 2**30 / 180)),
        12: round(time * 128).to_bytes(3, "big"),
    }
    if "address" in more:
        items[11] = more["address"].to_bytes(3, "big")
    if "height_ft" in more:
        items[16] = struct.pack(">h", round(more["height_ft"] / 6.25))
    if "applies" in more:  # the time for which the position holds
        items[5] = round(more["applies"] * 128).to_bytes(3, "big")
    if "ground" in more:  # speed in NM/s, course in degrees
        speed, course = more["ground"]
        items[26] = struct.pack(">HH", round(speed * 2**14), round(course * 2**16 / 360))
    if "climb_ft_min" in more:
        items[25] = struct.pack(">H", round(more["climb_ft_min"] / 6.25) & 0x7FFF)
    if "callsign" in more:
        items[29] = letters(more["callsign"])
    if "code" in more:
        items[19] = struct.pack(">H", more["code"])
    items |= more.get("items", {})
    return specified({number: item for number, item in items.items() if item})


def position_062(time, latitude, longitude, **more):
    """A record of category 062: 010, 070, 105, and speeds, track, address, geometric height (ft)."""
    items = {
        1: b"\x19\x01",
        4: round(time * 128).to_bytes(3, "big"),
        5: struct.pack(">ii", round(latitude * 2**25 / 180), round(longitude * 2**25 / 180)),
    }
    if "speeds" in more:
        items[7] = struct.pack(">hh", *(round(4 * speed) for speed in more["speeds"]))
    if "address" in more:
        items[11] = b"\x80" + more["address"].to_bytes(3, "big")
    if "track" in more:
        items[12] = struct.pack(">H", more["track"])
    if "height_ft" in more:
        items[18] = struct.pack(">h", round(more["height_ft"] / 6.25))
    if "coasted" in more:
        items[13] = b"\x01\x01\x01\x80"
    return specified(items | more.get("items", {}))


def imported(tmp_path, data, options=PLAIN, name="recording"):
    """What was done, and the columns that were written: numbers, and the tracks' names."""
    source, output = tmp_path / name, tmp_path / "plots.csv"
    source.write_bytes(data)
    done = import_recording(source, output, options)
    lines = output.read_text().splitlines()
    rows = list(csv.DictReader(io.StringIO("\n".join(line for line in lines if not line.startswith("#")))))
    numbers = [key for key in rows[0] if key not in ("track", "radar", *TEXT_COLUMNS)]
    columns = {key: np.array([float(row[key] or "nan") for row in rows]) for key in numbers}
    return done, columns, [row["track"] for row in rows]


def refused(tmp_path, data, options=PLAIN, beside=()):
    """The lines of the fault; nothing is written beside what is there."""
    source, output = tmp_path / "recording", tmp_path / "plots.csv"
    source.write_bytes(data)
    with pytest.raises(ConfigError) as caught:
        import_recording(source, output, options)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["recording", *beside])
    return [line.replace(f"{tmp_path}/", "") for line in caught.value.lines]


def refused_again(tmp_path, data, options, write=False):
    """As `refused`, in a folder that holds an earlier output, which stays; write: the recording is another."""
    if write:
        (tmp_path / "recording").write_bytes(data)
    before = (tmp_path / "plots.csv").read_bytes()
    with pytest.raises(ConfigError) as caught:
        import_recording(tmp_path / "recording", tmp_path / "plots.csv", options)
    assert (tmp_path / "plots.csv").read_bytes() == before
    return list(caught.value.lines)


def spoiled(rng, data):
    """The data with some bytes changed, cut out or doubled."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(len(data)))
        match rng.integers(4):
            case 0:
                data[at] = rng.integers(256)
            case 1:
                del data[at : at + int(rng.integers(1, 20))]
            case 2:
                data[at:at] = data[at : at + int(rng.integers(1, 20))]
            case _:
                data[at:at] = bytes(rng.integers(0, 256, int(rng.integers(1, 8))).tolist())
        if not data:
            return b"0"
    return bytes(data)


def fault_of(source, output):
    """The fault that a recording is refused with; none of a sound one."""
    try:
        import_recording(source, output, Options(site=SITE))
    except ConfigError as fault:
        return fault
    return None


def fuzz(tmp_path, sound, count, seed):
    """Spoiled files, of sound ones in turn: a fault in one line or a file that is whole, never anything else."""
    rng, source, output = np.random.default_rng(seed), tmp_path / "recording", tmp_path / "plots.csv"
    sound, refusals = list(sound), 0
    for i in range(count):
        source.write_bytes(spoiled(rng, sound[i % len(sound)]))
        output.unlink(missing_ok=True)
        fault = fault_of(source, output)
        if fault:
            refusals += 1
            assert all(line.isprintable() for line in fault.lines), fault.lines
            assert not output.exists()
        else:
            with output.open(newline="") as file:
                header, *rows = csv.reader(line for line in file if not line.startswith("#"))
            assert {len(row) for row in rows} == {len(header)}
            assert not {"nan", "inf", "-inf"} & {row[0] for row in rows}
        assert len(list(tmp_path.iterdir())) <= 2
    assert 0 < refusals < count
