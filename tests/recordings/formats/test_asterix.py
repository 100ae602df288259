"""Radar networks as they are recorded: captures, several radars, monitors, ADS-B; all made here byte by byte."""

import csv
import math
import struct

import numpy as np
import pytest

from radarsim.recordings.formats import captures
from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.sites import Site
from radarsim.recordings.track_names import TrackNames
from tests.program import command
from tests.recordings.formats.example_files import (
    EARTH_M,
    SITE,
    block,
    fuzz,
    imported,
    plot_048,
    position_021,
    position_062,
    refused,
    service_034,
    specified,
)

pytest.importorskip("asterix.base", reason="libasterix is not installed")
NM = 1852.0


def texts(tmp_path, *names):
    """Columns of text of what was written."""
    lines = (tmp_path / "plots.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    return [[row[name] for row in rows] for name in names]


# ---- captures --------------------------------------------------------------------------------------------------------
BLOCKS = [block(48, plot_048(k, 6000 + k, track=1, level=400)) for k in range(1, 4)] + [
    block(8, b"\x80\x19\x0a"),
    block(48, plot_048(5, 6100, track=1)),
]


def udp(data):
    return struct.pack(">HHHH", 4000, 5000, len(data) + 8, 0) + data


def ipv4(data, protocol=17, fragment=0, options=b""):
    size = 20 + len(options)
    head = struct.pack(">BBHHHBBH", 0x40 | size // 4, 0, size + len(data), 7, fragment, 1, protocol, 0)
    return head + bytes(8) + options + data


def ipv6(data, after=17, extension=b""):
    return struct.pack(">IHBB", 6 << 28, len(extension) + len(data), after, 1) + bytes(32) + extension + data


def ethernet(data, kind=0x0800, tags=b""):
    return bytes(12) + tags + struct.pack(">H", kind) + data + bytes(max(0, 46 - len(data)))  # padded, as it must be


def pcap(packets, order="<", magic=0xA1B2C3D4, link=1, cut=0):
    """cut: bytes of each packet that the capture did not keep."""
    whole = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    for k, data in enumerate(packets):
        whole += struct.pack(order + "IIII", 1_700_000_000 + k, 0, len(data) - cut, len(data)) + data[: len(data) - cut]
    return whole


def pcapng(packets, order="<", link=1, simple=False):
    """A section with an interface of another kind before the one that is used, where packets name it."""

    def one(kind, body):
        body += bytes(-len(body) % 4)
        return struct.pack(order + "II", kind, len(body) + 12) + body + struct.pack(order + "I", len(body) + 12)

    whole = one(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    for own in (link,) if simple else (147, link):
        whole += one(1, struct.pack(order + "HHI", own, 0, 0) + struct.pack(order + "HHI", 9, 1, 6))
    whole += one(4, bytes(4))  # names of hosts
    for data in packets:
        head = struct.pack(order + "IIIII", 1, 0, 0, len(data), len(data))
        whole += one(3, struct.pack(order + "I", len(data)) + data) if simple else one(6, head + data)
    return whole


def oradis(*blocks):
    """One frame of a recorder for each block: how long it is, and when."""
    return b"".join(struct.pack(">HI", len(one) + 6, 45_000_000) + one for one in blocks)


def final(*blocks):
    data = b"".join(blocks)
    return struct.pack(">HBBBBH", len(data) + 12, 1, 2, 3, 4, 5) + data + b"\xa5\xa5\xa5\xa5"


PLAINLY = [ethernet(ipv4(udp(one))) for one in BLOCKS]


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(pcap(PLAINLY), marks=pytest.mark.slow),
        pcap(PLAINLY, ">"),
        pcap(PLAINLY, "<", 0xA1B23C4D),  # nanoseconds
        pcapng(PLAINLY),
        pcapng(PLAINLY, ">"),
        pcapng(PLAINLY, simple=True),
        pcapng(PLAINLY[:2], ">") + pcapng(PLAINLY[2:], simple=True),  # two sections
        pcap([ethernet(ipv4(udp(one)), tags=b"\x81\x00\x00\x05") for one in BLOCKS]),
        pcap([ethernet(ipv4(udp(one)), tags=b"\x88\xa8\x00\x05\x81\x00\x00\x06") for one in BLOCKS]),
        pcap([bytes(14) + b"\x08\x00" + ipv4(udp(one)) for one in BLOCKS], link=113),
        pcap([b"\x08\x00" + bytes(18) + ipv4(udp(one)) for one in BLOCKS], link=276),
        pcap([ipv4(udp(one), options=bytes(8)) for one in BLOCKS], link=101),
        pcap([b"\x02\x00\x00\x00" + ipv4(udp(one)) for one in BLOCKS], link=0),
        pcap([ethernet(ipv6(udp(one)), 0x86DD) for one in BLOCKS]),
        pcap([ipv6(udp(one), 0, b"\x11\x00" + bytes(6)) for one in BLOCKS], link=229),  # an extension before it
        pcap([ethernet(ipv4(udp(b"".join(BLOCKS))))]),
        pcap([ethernet(ipv4(udp(oradis(*BLOCKS))))]),
        pcap([ethernet(ipv4(udp(final(*BLOCKS[:2]) + final(*BLOCKS[2:]))))]),
        final(*BLOCKS[:2]) + final(*BLOCKS[2:]),
    ],
)
def test_a_capture_holds_what_the_radar_sent(tmp_path, data):
    done, columns, _ = imported(tmp_path, data)
    assert (done.format, done.rows) == ("asterix", 4)
    assert done.skipped == ["data blocks of category 008 (1)"]
    np.testing.assert_array_equal(columns["t_s"], [0, 1, 2, 4])
    np.testing.assert_array_equal(columns["range_m"], np.array([6001, 6002, 6003, 6100]) * NM / 256)


def test_what_a_capture_has_besides_is_counted(tmp_path):
    after = [ethernet(ipv4(udp(one + bytes(8)))) for one in BLOCKS]
    others = [
        *(ethernet(ipv4(udp(BLOCKS[0]), fragment=one)) for one in (0x2000, 0x0010)),
        ethernet(ipv6(udp(BLOCKS[0]), 44), 0x86DD),
        ethernet(ipv4(bytes(40), 6)),  # TCP
        ethernet(bytes(28), 0x0806),  # ARP
        ethernet(ipv4(udp(b"\x12\x34\x01\x00" + bytes(30)))),  # a question to DNS
        b"",
    ]
    done, columns, _ = imported(tmp_path, pcap([*others, *after])[:-1])
    np.testing.assert_array_equal(columns["t_s"], [0, 1, 2])
    assert sorted(done.skipped) == [
        "data blocks of category 008 (1)",
        "datagrams without ASTERIX (1)",
        "fragments of datagrams, which are not put together (3)",
        "packets cut off by the end of the file (1)",
        "packets other than UDP (3)",
        "tails of a few bytes after the data blocks of datagrams (4)",
    ]
    assert refused_alone(tmp_path, pcap(PLAINLY, cut=1)).endswith("; left out: packets cut short by the capture (5)")
    assert "packets of the kind of link 147, which is not read (5)" in refused_alone(tmp_path, pcap(PLAINLY, link=147))


def refused_alone(tmp_path, data):
    for path in tmp_path.iterdir():
        path.unlink()
    (line,) = refused(tmp_path, data)
    return line


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (pcap(PLAINLY)[:20], "byte 4: must be the header of a pcap file, 24 bytes; it ends after 20"),
        (pcap([])[:24] + struct.pack("<IIII", 0, 0, 1 << 30, 9), "byte 24: must be a packet of at most 16777216 bytes"),
        (
            pcapng([])[:28] + b"\1\0\0\0\2\0\0\0" + bytes(8),
            "byte 28: must be a block of a pcapng file; got 01 00 00 00",
        ),
        (pcapng([]) + struct.pack("<IIIIIIII", 6, 32, 9, 0, 0, 0, 0, 32), "must be a packet of an interface described"),
        (final(BLOCKS[0]) + final(BLOCKS[1])[:-1] + b"\0", "must be a frame: two bytes that count it, 6 more"),
        (
            pcap([ethernet(ipv4(udp(block(48, b"\xff" + bytes(9)))))]),
            "byte 101, record 1: not ASTERIX of category 048 in edition 1.32, which is taken for granted",
        ),
    ],
)
def test_a_damaged_capture_is_refused_with_its_place(tmp_path, data, said):
    assert said in refused_alone(tmp_path, data)


def test_a_second_network_brings_nothing_twice(tmp_path):
    """Plots without track, each block on two networks, the second late and in another order."""
    sent = [block(48, plot_048(k / 10, 6000 + 40 * k)) for k in range(100)]
    both = [one for k in range(0, 100, 10) for one in (*sent[k : k + 10], *reversed(sent[max(k - 5, 0) : k + 5]))]
    done, columns, _ = imported(tmp_path, pcap([ethernet(ipv4(udp(one))) for one in both]))
    assert len(np.unique(columns["t_s"])) == done.rows == 100
    assert done.skipped == [f"data blocks that came twice ({len(both) - 100})"]


# ---- radars ----------------------------------------------------------------------------------------------------------


def test_radars_stand_where_they_say(tmp_path):
    """Two radars say where they stand and how fast they turn, a third does not; all see tracks 77."""
    places = {(25, 12): (45.70, 16.00, 100), (25, 13): (44.0, 15.3, 780)}
    services = [service_034(radar, place, 4.0 + radar[1] / 64) for radar, place in places.items()]
    plots = [plot_048(4 * k + n / 4, 9000 * (n + 1), radar=(25, 12 + n), track=77, level=1000)
             for k in range(5) for n in range(3)]  # fmt: skip
    data = block(48, *plots) + block(34, services[0]) + block(34, services[1])  # said after the plots
    done, columns, tracks = imported(tmp_path, data)
    assert tracks == ["77", "25/13:77"] * 5
    assert done.skipped == ["rows of radar 25/14, whose place neither it nor --at says (5)"]
    assert "a turn of the antenna (I034/041) takes: 25/12 4.188 s, 25/13 4.203 s" in done.notes
    at = np.stack([columns[name] for name in ("x_m", "y_m", "z_m")], -1)
    for n, place in enumerate(places.values()):
        steps = [round(one * 2**23 / 180) * 180 / 2**23 for one in place[:2]]
        polar = (
            np.full(5, 9000 * (n + 1) * NM / 256),
            np.full(5, 5000 * 2 * math.pi / 65536),
            np.full(5, 25e3 * 0.3048),
        )
        np.testing.assert_array_equal(at[n::2], Site(*steps, place[2]).local_positions(*polar))
    assert not any("--at" in note for note in done.notes)
    moved = Site(45.70, 16.01, 100)
    given = {"25/12": moved, "25/14": SITE}
    done, columns, _ = imported(tmp_path, data, Options(sites=given))
    assert done.rows == 15
    place = "45.69999,16.00000,100 (I034/120); --at is taken"
    assert done.notes[0] == f"--at puts radar 25/12 779 m from where it says it stands, {place}"
    one = block(34, services[0]) + block(48, *(record for k, record in enumerate(plots) if k % 3 == 0))
    again, alone, _ = imported(tmp_path, one, Options(site=moved))
    assert again.notes[0] == done.notes[0]
    np.testing.assert_array_equal(alone["x_m"], columns["x_m"][::3])


def test_a_radar_that_does_not_know_where_it_stands_sends_zeros(tmp_path):
    data = block(34, service_034((25, 10), (0, 0, 0))) + block(48, plot_048(1, track=1, level=400))
    assert "x_m" not in imported(tmp_path, data)[1]


def test_an_address_of_two_radars_is_two_tracks(tmp_path):
    records = [plot_048(k, radar=(25, 10 + k % 2), address=0x4CA1FA) for k in range(4)]
    done, _, tracks = imported(tmp_path, block(48, *records, plot_048(5, rho=0, address=0x4CA1FA)))
    assert tracks == ["4ca1fa", "25/11:4ca1fa"] * 2
    assert done.skipped == ["plots whose range is not above 0 (1)"]


def test_truth_of_the_radar_that_says_where_it_stands(tmp_path):
    data = block(34, service_034((25, 10), (52.3, 4.76, 12)))
    for k in range(30):
        data += block(62, position_062(4.0 * k, 53 + k / 111.25, 4.76, address=0xA1, track=7, height_ft=30000))
        data += block(48, plot_048(4.0 * k, 10750 + 137 * k, 40, address=0xA1, track=3, level=1200))
    done, columns, _ = imported(tmp_path, data)
    assert done.notes[-1].startswith("truth: of 30 of 30 plots (100 %; by address 30)")
    assert np.isfinite(columns["true_r_m"]).all()


def test_truth_of_each_of_several_radars(tmp_path):
    """An aircraft between two radars, 200 km apart; each has the truth in its own axes."""
    sites = {"25/10": Site(52.3, 4.76, 12), "25/11": Site(54.1, 4.76, 300)}
    truth, plots, height = b"", [], 30000 * 0.3048
    for k in range(30):
        at = 53 + k / 111.25
        truth += block(62, position_062(4.0 * k, at, 4.9, address=0xA1, track=7, height_ft=30000))
        for site in sites.values():
            given = dict.fromkeys(("east_mps", "north_mps", "up_mps"), np.zeros(1))
            place = dict(
                zip(("latitude_deg", "longitude_deg", "altitude_m"), np.array([[at], [4.9], [height]]), strict=True)
            )
            seen = site.measure(given | place)
            own = polar(float(seen["range_m"][0] * np.cos(seen["bearing_rad"][0])),
                        float(seen["range_m"][0] * np.sin(seen["bearing_rad"][0])))  # fmt: skip
            number = 10 + (site is sites["25/11"])
            plots.append(plot_048(4.0 * k, *own, radar=(25, number), address=0xA1, track=3, level=1200))
    done, columns, _ = imported(tmp_path, truth + block(48, *plots), Options(sites=sites))
    assert done.notes[-1].startswith("truth: of 60 of 60 plots (100 %; by address 60)")
    # Half a step of each number that the file has: range, bearing, latitude.
    step = EARTH_M * math.radians(180 / 2**25)
    along, across = NM / 512 + step / 2, columns["range_m"].max() * math.pi / 65536
    for name in "xyz":
        np.testing.assert_allclose(columns[f"{name}_m"], columns[f"true_{name}_m"], rtol=0, atol=along + across)
    np.testing.assert_allclose(columns["true_r_m"], columns["range_m"], rtol=0, atol=along)
    # A degree has 111.28 km here, and more at that height; 1° away the level is another's.
    speed, level = 111.28 / 111.25 * 250 * (1 + height / EARTH_M), 250 * math.radians(1.1) ** 2 / 2
    np.testing.assert_allclose(
        np.hypot(columns["true_vx_mps"], columns["true_vz_mps"]), speed, rtol=0, atol=step / 4 + level
    )
    assert (columns["true_vx_mps"] > 200).all()
    assert (columns["true_Vr_mps"][::2] > 200).all()
    assert (columns["true_Vr_mps"][1::2] < -200).all()


# ---- whose plots -----------------------------------------------------------------------------------------------------


def test_what_is_known_of_a_plot_is_kept(tmp_path):
    records = [
        plot_048(1, track=1, kind=b"\xa0", code=0o7421, callsign="KLM12A", address=0x4CA1FA, level=400),
        plot_048(2, 6000, kind=b"\x40", code=0o0012),
        plot_048(3, track=1, kind=b"\x20", code=0x4000 | 0o1234, garbled=1, level=400),  # code and height garbled
        plot_048(4, track=1, kind=b"\x60", code=0x8000 | 0o1234),  # a code not validated
        plot_048(5, track=1, kind=b"\x00"),  # no detection
        plot_048(6, track=1, kind=b"\xa2"),  # RAB
        plot_048(7, track=1, kind=b"\x51\x80"),  # SIM, TST
        plot_048(8, track=1, kind=b"\xe0"),
    ]
    done, columns, tracks = imported(tmp_path, block(48, *records))
    radar, address, code, callsign, report, marks = texts(
        tmp_path, "radar", "address", "mode_3a", "callsign", "report", "marks"
    )
    assert set(radar) == {"25/10"}
    assert address == ["4ca1fa", *7 * [""]]
    assert code == ["7421", "0012", *6 * [""]]
    assert callsign == ["KLM12A", *7 * [""]]
    assert report == ["Mode S", "SSR", "PSR", "SSR+PSR", "", "Mode S", "SSR", "Mode S+PSR"]
    assert marks == [
        "",
        "",
        "garbled code; garbled height",
        "",
        "coasted",
        "field monitor",
        "test target; simulated",
        "",
    ]
    np.testing.assert_array_equal(columns["altitude_m"], [3048, *7 * [np.nan]])
    assert tracks == ["1", "A0012", "1", "1", "", "", "", "1"]
    out, unused = "; in no track and no truth: --keep-marked keeps them there", "; it is not used"
    kinds = dict.fromkeys(("test target", "simulated", "field monitor", "coasted"), out)
    kinds |= dict.fromkeys(("garbled code", "garbled height"), unused)
    assert sorted(done.notes) == [
        "plots of no track, which `radarsim track` skips: 3 of 8",
        *sorted(f"records marked “{mark}”: 1{rest}" for mark, rest in kinds.items()),
    ]
    command("import", tmp_path / "recording", "-o", tmp_path / "plots.csv", "--keep-marked")
    assert texts(tmp_path, "track") == [["1", "A0012", *6 * ["1"]]]


def polar(north, east):
    """rho and theta of plot_048 of a place in m."""
    return round(math.hypot(north, east) / NM * 256), round(math.atan2(east, north) / (2 * math.pi) * 65536) % 65536


def test_a_code_used_twice_is_two_aircraft(tmp_path):
    """Two fly past each other 8 km apart; one comes back after 100 s and one appears far away."""
    flown = []
    for k in range(40):
        flown.append((4.0 * k, (-20e3 + 250 * 4 * k, 30e3), "A7000"))
        flown.append((4.0 * k + 0.5, (20e3 - 250 * 4 * k, 38e3), "A7000-2"))
    flown += [(260 + 4.0 * k, (30e3, 30e3 + 1000 * k), "A7000-3") for k in range(5)]
    flown += [(262 + 4.0 * k, (30e3, -50e3 + 1000 * k), "A7000-4") for k in range(5)]
    flown.sort()
    records = [plot_048(t, *polar(*place), code=0o7000) for t, place, _ in flown]
    done, _, tracks = imported(tmp_path, block(48, *records))
    assert tracks == [name for _, _, name in flown]
    assert "Mode 3/A codes of several aircraft or of one seen again, ACODE-2 and so on: 1" in done.notes


def test_a_code_is_that_of_the_aircraft_that_flies_there():
    """Two pass each other 1 km apart, and fly three times as far between plots."""
    tracks, rng = TrackNames(), np.random.default_rng(4)
    for k in range(40):
        for name, north, east in (("A7000", 250 * 12 * (k - 20), 0), ("A7000-2", 250 * 12 * (20.5 - k), 1000)):
            north, east = (float(one + rng.normal(0, 50)) for one in (north, east))
            assert tracks.name_by_code("1/1", "7000", 12.0 * k, north, east) == name


def test_codes_that_cross(tmp_path):
    """40 aircraft of one code at random, 4 s apart: no track has plots of two as long as they keep 5 km apart."""
    rng = np.random.default_rng(3)
    places, speeds = rng.uniform(-150e3, 150e3, (40, 2)), rng.uniform(-200, 200, (40, 2))
    tracks, of, close = TrackNames(), {}, set()
    for k in range(100):
        now = places + 4 * k * speeds
        far = np.linalg.norm(now[:, None] - now[None], axis=-1) + 1e9 * np.eye(40)
        close |= set(np.argwhere(far < 5e3).ravel().tolist())
        for i, (north, east) in enumerate((now + rng.normal(0, 100, now.shape)).tolist()):
            of.setdefault(tracks.name_by_code("1/1", "7000", 4 * k + i / 20, north, east), set()).add(i)
    assert all(len(own) == 1 for own in of.values() if not own & close)
    assert len(of) - 40 <= len(close)
    assert len(close) < 20


@pytest.mark.parametrize(
    ("pause", "addresses", "tracks"),
    [
        (3500, (None, None, None, None), ["77", "77", "77-2", "77-2"]),
        (3500, (0xA1, 0xA1, 0xA1, 0xA1), ["77", "77", "77", "77"]),
        (3500, (0xA1, None, None, None), ["77", "77", "77-2", "77-2"]),
        (4, (0xA1, 0xA1, 0xB2, None), ["77", "77", "77-2", "77-2"]),
        (4, (0xA1, None, 0xB2, 0xB2), ["77", "77", "77-2", "77-2"]),
        (4, (0xA1, None, 0xA1, None), ["77", "77", "77", "77"]),
    ],
)
def test_a_number_given_again_is_another_track(tmp_path, pause, addresses, tracks):
    """After a pause without a plot, or at once where the address is another."""
    records = [plot_048(t, 9000, track=77, **({"address": own} if own else {}))
               for t, own in zip((1, 5, 5 + pause, 9 + pause), addresses, strict=True)]  # fmt: skip
    done, _, found = imported(tmp_path, block(48, *records))
    assert found == tracks
    assert ("track numbers given again to another aircraft, NUMBER-2 and so on: 1" in done.notes) == ("77-2" in tracks)


# ---- positions -------------------------------------------------------------------------------------------------------


def test_category_021_to_the_last_step(tmp_path):
    rng = np.random.default_rng(5)
    n = 50
    lat, lon, height = rng.uniform(52, 53, n), rng.uniform(4, 6, n), 6.25 * rng.integers(100, 6000, n)
    speed, course, climb = (
        rng.integers(1, 9000, n) / 2**14,
        rng.integers(0, 65536, n) * 360 / 65536,
        rng.integers(-300, 300, n),
    )
    records = [
        position_021(100 + k, lat[k], lon[k], address=0x4CA100 + k, height_ft=height[k], ground=(speed[k], course[k]),
                     climb_ft_min=6.25 * climb[k], callsign=f"KLM{k}", code=0o1000 + k, applies=99.5 + k)
        for k in range(n)
    ]  # fmt: skip
    _, columns, tracks = imported(tmp_path, block(21, *records), Options(site=SITE, zero="midnight"))
    np.testing.assert_array_equal(columns["t_s"], 99.5 + np.arange(n))  # for which the position holds
    assert tracks == texts(tmp_path, "address")[0] == [f"{0x4CA100 + k:06x}" for k in range(n)]
    assert texts(tmp_path, "callsign", "mode_3a") == [
        [f"KLM{k}" for k in range(n)],
        [f"{0o1000 + k:04o}" for k in range(n)],
    ]
    given = {
        "latitude_deg": np.round(lat * 2**30 / 180) * 180 / 2**30,
        "longitude_deg": np.round(lon * 2**30 / 180) * 180 / 2**30,
        "altitude_m": height * 0.3048,
        "east_mps": speed * NM * np.sin(np.radians(course)),
        "north_mps": speed * NM * np.cos(np.radians(course)),
        "up_mps": 6.25 * climb * 0.3048 / 60,
    }
    for name, column in SITE.measure(given).items():
        np.testing.assert_array_equal(columns[name], column)


def test_category_021_what_else_it_may_say(tmp_path):
    """A coarse position alone; a climb by the barometer; speed and climb beyond what the fields hold."""
    coarse = {7: None, 6: b"".join(round(one * 2**23 / 180).to_bytes(3, "big") for one in (52.5, 4.76))}
    records = [
        position_021(1, 0, 0, items=coarse),
        position_021(2, 52.5, 4.76, ground=(820 / 2**14, 0), items={24: struct.pack(">h", 320)}),
        position_021(3, 52.5, 4.76, ground=(820 / 2**14, 0), items={24: struct.pack(">H", 0x8000 | 320)}),
        position_021(4, 52.5, 4.76, items={26: b"\xff\xff\x00\x00"}),
    ]
    _, columns, _ = imported(tmp_path, block(21, *records), Options(site=SITE))
    half = EARTH_M * np.radians(180 / np.array([2**24, 2**31]))  # a step of each kind of latitude
    np.testing.assert_allclose(columns["range_m"], columns["range_m"][1], rtol=0, atol=half.sum())
    moved = {"latitude_deg": 52.5, "longitude_deg": 4.76, "altitude_m": np.nan, "east_mps": 0.0}
    moved |= {"north_mps": 820 / 2**14 * NM, "up_mps": 2000 * 0.3048 / 60}
    level = moved | {"up_mps": np.nan}
    speeds = [
        SITE.measure({name: np.array([one]) for name, one in own.items()})["velocity_mps"][0] for own in (moved, level)
    ]
    expected = [np.nan, *speeds, np.nan]
    turned = speeds[0] * half[1] / columns["range_m"][1]  # by the fine step
    np.testing.assert_allclose(columns["velocity_mps"], expected, rtol=0, atol=turned)


def test_names_of_positions(tmp_path):
    """ADS-B goes by address, tracks of a centre by their number; the address is a part of a long item."""
    reports = [
        position_021(1, 52.5, 4.76, address=0xA1, items={3: b"\0\7"}),
        position_021(2, 52.5, 4.76, items={3: b"\0\7"}),
    ]
    _, _, tracks = imported(tmp_path, block(21, *reports), Options(site=SITE))
    assert tracks == ["0000a1", "7"]
    derived = (b"\x81\x01\x01\x08" + b"\x4c\xa1\xfa" + bytes(2), b"\x40" + bytes(6))
    centre = [position_062(k, 52.5, 4.76, track=5, items={11: item}) for k, item in enumerate(derived)]
    _, _, tracks = imported(tmp_path, block(62, *centre), Options(site=SITE))
    assert tracks == ["5", "5"]
    assert texts(tmp_path, "address") == [["4ca1fa", ""]]


def test_ads_b_is_the_truth_before_the_tracks_of_a_centre(tmp_path):
    """Category 021 and, 2 km beside it, 062; test targets and coasted tracks are no truth."""
    data, truth = b"", b""
    for k in range(30):
        north = 53 + k / 111.25
        truth += block(62, position_062(4.0 * k, north, 4.79, address=0xA1, track=7, height_ft=3e4))
        truth += block(21, position_021(4.0 * k + 1, north + 0.25 / 111.25, 4.76, address=0xA1, height_ft=3e4))
        data += block(48, plot_048(4.0 * k, 10750 + 137 * k, 40, address=0xA1, track=3, level=1200))
    (tmp_path / "truth").write_bytes(truth)
    _, columns, _ = imported(tmp_path, data, Options(site=SITE, truth=str(tmp_path / "truth")))
    assert np.isfinite(columns["true_r_m"]).sum() == 29
    assert np.nanmax(np.abs(columns["true_z_m"])) < EARTH_M * math.radians(180 / 2**31)  # half a step of longitude
    tested = block(21, *(position_021(4.0 * k, 53.0, 4.76, address=0xA1, kind=b"\x01\x10") for k in range(30)))
    coasted = block(62, *(position_062(4.0 * k, 53.0, 4.76, address=0xA1, track=7, coasted=1) for k in range(30)))
    plots = block(48, *(plot_048(4.0 * k, 10766, 0, address=0xA1, track=3, level=1200) for k in range(30)))
    for no_truth in (tested, coasted):
        (tmp_path / "truth").write_bytes(no_truth)
        (tmp_path / "plots.csv").unlink(missing_ok=True)
        done, columns, _ = imported(tmp_path, plots + no_truth, Options(site=SITE))
        assert "true_r_m" not in columns
        assert (done.rows, done.skipped) == (30, ["positions beside plots (30)"])
        _, columns, _ = imported(tmp_path, plots + no_truth, Options(site=SITE, keep_marked=True))
        assert np.isfinite(columns["true_r_m"]).all()


def test_an_old_edition_is_refused_by_name(tmp_path):
    """Item 390 of another length, as before 2010."""
    line = refused_alone(tmp_path, block(62, specified({1: b"\x19\x01", 4: bytes(3), 21: b"\xff\xff"})))
    assert "record 1: not ASTERIX of category 062 in edition 1.21, which is taken for granted: " in line


def test_a_datagram_that_only_begins_like_asterix_is_none():
    assert captures.datagram_blocks(BLOCKS[0] + bytes(17)) == ([], 0)
    assert captures.datagram_blocks(b"\x30\x00\x03") == ([], 0)
    assert captures.datagram_blocks(bytes([250]) + BLOCKS[0][1:]) == ([], 0)


def sound():
    """A small sound file of each format that networks bring."""
    plots = [block(48, plot_048(t, 12800 + t, 40, level=1200, code=0o1234, callsign="KLM1")) for t in range(1, 12)]
    packets = [ethernet(ipv4(udp(one))) for one in (block(34, service_034((25, 10), (52.3, 4.76, 12), 4.0)), *plots)]
    reports = [position_021(t, 53 + t / 1000, 4.76, address=0xA1, height_ft=3e4) for t in range(12)]
    return {"pcap": pcap(packets), "pcapng": pcapng(packets, ">"), "021": block(21, *reports), "FINAL": final(*plots)}


def test_spoiled_files(tmp_path):
    fuzz(tmp_path, sound().values(), 100, 1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", sound())
def test_many_spoiled_files(tmp_path, kind):
    fuzz(tmp_path, [sound()[kind]], 10_000, 2)
