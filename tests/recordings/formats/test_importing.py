"""Recordings become plots: files made here byte by byte from the specifications, and read back to the last step."""

import csv
import functools
import math
import operator
import struct

import numpy as np
import pytest

from radarsim.errors import ConfigError
from radarsim.recordings.formats.import_options import Options, check_encoding
from radarsim.recordings.formats.import_recording import import_recording
from radarsim.recordings.formats.records import UnrolledClock
from radarsim.recordings.formats.sites import HEIGHT_ACCURACY_M, Antenna, Site, antenna_angles, position_columns
from radarsim.recordings.formats.units import split_unit
from tests.recordings.formats.example_files import (
    CLOCK_S,
    EARTH_M,
    PLACE,
    PLAIN,
    SITE,
    block,
    fuzz,
    imported,
    plot_048,
    position_062,
    refused,
    refused_again,
    specified,
)
from tests.tolerances import assert_rounded

pytest.importorskip("asterix.base", reason="libasterix is not installed")
NM, STEP = 1852.0, 2 * math.pi / 65536


# ---- ASTERIX ---------------------------------------------------------------------------------------------------------


def test_category_048_to_the_last_step(tmp_path):
    rng = np.random.default_rng(1)
    rho, theta = rng.integers(1, 65536, 200), rng.integers(0, 65536, 200)
    time, level = np.sort(rng.integers(1, 2**23, 200)) / 128, rng.integers(-40, 2000, 200)
    speed, span = rng.integers(-400, 400, 200), rng.integers(1, 900, 200)
    records = [
        plot_048(float(t), int(r), int(a), level=int(f), address=0x4CA123 + i, track=i, raw=(int(v), int(d), 2800))
        for i, (t, r, a, f, v, d) in enumerate(zip(time, rho, theta, level, speed, span, strict=True))
    ]
    data = b"".join(block(48, *records[i : i + 7]) for i in range(0, 200, 7))
    done, columns, tracks = imported(tmp_path, data, Options(zero="midnight"))
    assert (done.format, done.records, done.rows) == ("asterix", 200, 200)
    np.testing.assert_array_equal(columns["t_s"], time)
    np.testing.assert_array_equal(columns["range_m"], rho * NM / 256)
    assert_rounded(columns["bearing_rad"], theta * STEP, operations=2)
    assert_rounded(columns["altitude_m"], level * 25 * 0.3048, operations=2)
    np.testing.assert_array_equal(columns["velocity_mps"], speed)
    np.testing.assert_array_equal(columns["span_mps"], span)
    assert tracks == [str(i) for i in range(200)]


def test_category_048_what_is_silent_is_empty(tmp_path):
    records = [
        plot_048(1, track=1),
        plot_048(2, track=1, level=400, invalid=1, calculated=-300),
        plot_048(3, track=1, calculated=200, doubtful=1),
        plot_048(4, track=1, calculated=511, raw=(7, 30, 1000)),
        plot_048(5, address=0xABCDEF),
    ]
    _, columns, tracks = imported(tmp_path, block(48, *records))
    np.testing.assert_array_equal(columns["velocity_mps"], [np.nan, -300, np.nan, 7, np.nan])
    np.testing.assert_array_equal(columns["span_mps"], [np.nan, np.nan, np.nan, 30, np.nan])
    assert np.isnan(columns["altitude_m"]).all()
    assert tracks == ["1", "1", "1", "1", "abcdef"]
    np.testing.assert_array_equal(columns["t_s"], np.arange(5))


def test_midnight_passes_and_other_categories_are_passed_over(tmp_path):
    data = block(8, b"\x80\x19\x0a") + block(48, plot_048(86399.5, track=1)) + block(48, plot_048(3.5, track=1))
    done, columns, _ = imported(tmp_path, data)
    np.testing.assert_array_equal(columns["t_s"], [0, 4])
    assert done.skipped == ["data blocks of category 008 (1)"]


def test_category_001_takes_its_time_from_the_sectors(tmp_path):
    """Plots carry 16 bits of 1/128 s, sector messages of category 002 the whole time of day."""

    def plot(time, kind, **more):
        items = {1: b"\x19\x0a", 2: bytes([kind << 7])}
        place, truncated = struct.pack(">HH", 128 * 100, 8192), struct.pack(">H", round(time * 128) % 65536)
        if kind:  # a track
            return specified(items | {3: struct.pack(">H", more["track"]), 4: place, 9: truncated, 12: b"\xfe"})
        return specified(items | {3: place, 7: truncated})

    def sector(time):
        return block(2, specified({1: b"\x19\x0a", 2: b"\x02", 4: round(time * 128).to_bytes(3, "big")}))

    data = (
        block(1, plot(39999.5, 1, track=6))
        + sector(40000.0)
        + block(1, plot(40001.0, 1, track=5), plot(40001.5, 0))
        + sector(40448.0)
    )
    data += block(1, plot(40449.25, 1, track=5))
    done, columns, tracks = imported(tmp_path, data, Options(zero="midnight"))
    np.testing.assert_array_equal(columns["t_s"], [39999.5, 40001.0, 40001.5, 40449.25])
    assert tracks == ["6", "5", "", "5-2"]  # 448 s without a plot
    np.testing.assert_array_equal(columns["velocity_mps"], np.array([-2, -2, np.nan, -2]) * NM / 256)
    assert any("plots of no track" in note for note in done.notes)


def test_category_062_is_the_truth_of_the_plots_beside_it(tmp_path):
    """An aircraft that flies straight north at 250 m/s, seen by a radar to its south."""
    data, degree, step = b"", 111_250.0, EARTH_M * math.radians(180 / 2**25)
    for k in range(30):
        data += block(62, position_062(4.0 * k, 53 + 1000.0 * k / degree, 4.76, address=0xA1, track=7, height_ft=30000))
        if k % 2:
            data += block(48, plot_048(4.0 * k - 1.5, 10750 + 137 * k, 40, address=0xA1, track=3, level=1200))
    done, columns, tracks = imported(tmp_path, data, Options(site=SITE))
    assert tracks == ["3"] * 15
    miss = np.median(np.abs(columns["range_m"] - columns["true_r_m"]))
    of = "truth: of 15 of 15 plots (100 %; by address 15), which lie"
    assert done.notes[-1] == f"{of} {miss:.3g} m and 0.22° from it (median)"
    height = 30000 * 0.3048
    t = columns["t_s"] + 2.5
    for half, names in ((0.0, ("x_m", "y_m", "z_m")), (2.0, ("vx_mps", "vy_mps", "vz_mps"))):
        ends = [[local(53 + 250 * (s + sign * half) / degree, 4.76, height) for s in t] for sign in (-1, 1)]
        wanted = np.subtract(*ends[::-1]) / (2 * half) if half else np.array(ends[0])
        found = np.stack([columns[f"true_{name}"] for name in names], axis=-1)
        # Latitudes are rounded to steps of the file; speeds are differences of two in 4 s. The chord of a scan's way
        # lies that much below its arc.
        allowed = (step / 4) if half else step / 2 + (4 * 250) ** 2 / 8 / EARTH_M
        np.testing.assert_allclose(found, wanted, rtol=0, atol=allowed)
    assert np.abs(np.sin(columns["true_b_rad"])).max() < step / 2 / columns["true_r_m"].min()


def test_the_tracks_of_two_radars_stay_apart(tmp_path):
    """Both count their tracks from 1; the plots of each are placed from where it stands."""
    places = {"25/12": SITE, "25/13": Site(51.0, 3.0, 0.0)}
    records = [plot_048(2 * k + n, 6000 * (n + 1), radar=(25, 12 + n), track=1, level=800)
               for k in range(1, 5) for n in range(2)]  # fmt: skip
    done, columns, tracks = imported(tmp_path, block(48, *records))
    assert tracks == ["1", "25/13:1"] * 4
    assert done.skipped == []
    assert any("plots of several radars, SAC/SIC (rows): 25/12 (4), 25/13 (4)" in note for note in done.notes)
    assert [line.split(",")[2] for line in (tmp_path / "plots.csv").read_text().splitlines()[-2:]] == ["25/12", "25/13"]
    (line,) = refused_again(tmp_path, block(48, *records), Options(site=SITE))
    assert "must say where each radar stands" in line
    assert line.endswith("has plots of 2: 25/12, 25/13")
    _, columns, _ = imported(tmp_path, block(48, *records), Options(sites=places))
    for n, site in enumerate(places.values()):
        alone = site.local_positions(
            np.full(4, 6000.0 * (n + 1) * NM / 256), np.full(4, 5000 * STEP), np.full(4, 20_000 * 0.3048)
        )
        np.testing.assert_array_equal(np.stack([columns[name][n::2] for name in ("x_m", "y_m", "z_m")], -1), alone)
    done, _, tracks = imported(tmp_path, block(48, *records), Options(sites={"25/13": places["25/13"]}))
    assert set(tracks) == {"25/13:1"}
    assert done.skipped == ["rows of radar 25/12, whose place neither it nor --at says (4)"]
    (line,) = refused_again(tmp_path, block(48, *records), Options(sites={"25/99": SITE}))
    assert line.endswith("; left out: rows of radar 25/12, whose place neither it nor --at says (4), rows of radar "
                         "25/13, whose place neither it nor --at says (4)")  # fmt: skip


def flights(*names, speed=250.0, count=30, step=4.0):
    """Positions (category 062) of aircraft that fly north side by side, 1° of longitude apart; '' has no address."""
    for k in range(count):
        for i, name in enumerate(names):
            address = {"address": int(name, 16)} if name else {}
            yield position_062(step * k, 53 + speed * step * k / 111_250, 4.76 + i, track=i, height_ft=0, **address)


def test_truth_is_never_another_aircraft(tmp_path):
    """Plots of a1 and of one without address; positions of a1, of another, of several without an address."""
    plots = block(48, *(plot_048(4.0 * k, 10766 + 138 * k, 0, track=3, address=0xA1, level=0) for k in range(1, 30)))
    plots += block(48, *(plot_048(4.0 * k + 1, 10766 + 138 * k, 0, track=4, level=0) for k in range(1, 30)))
    truth, options = tmp_path / "truth", Options(site=SITE, truth=str(tmp_path / "truth"))
    for names in (("0000a1", "0000b2"), ("0000a1",), ("0000a1", "", "")):
        truth.write_bytes(block(62, *flights(*names)))
        _, columns, tracks = imported(tmp_path, plots, options)
        known = np.isfinite(columns["true_r_m"])
        assert known.sum() == 29
        assert {track for track, one in zip(tracks, known, strict=True) if one} == {"3"}
        # Whole steps of range lose 2 m a scan on the aircraft; the next one is 67 km away.
        np.testing.assert_allclose(columns["range_m"][known], columns["true_r_m"][known], rtol=0, atol=100)
    for names, expected in (
        (
            ("0000b2",),
            "truth: no plot has the address, the callsign or the code of an aircraft in it at that time and "
            "place; it has 0000b2, the plots 0000a1",
        ),
        (
            ("", ""),
            "must have positions on the earth of aircraft with an address, a callsign or a code of their own; "
            "has 60 without",
        ),
    ):
        truth.write_bytes(block(62, *flights(*names)))
        (line,) = refused_again(tmp_path, plots, options)
        assert expected in line
    truth.write_bytes(block(62, *flights("0000a1")))
    (line,) = refused_again(tmp_path, plots, Options(site=Site(52.3, 6.76, 0.0), truth=str(truth)))
    assert line.startswith("truth: the plots of 0000a1 lie ")
    assert "(median), allowed are 5000 m, and in bearing 2° more than these make: it is another aircraft" in line


FIRST = block(48, plot_048(1, track=1), plot_048(2, track=1, comment=2))
SECOND = block(48, plot_048(3, track=1), plot_048(4, track=1))
MUST = "must be a data block: category, length from 4 on, and as many bytes; got category 48"


@pytest.mark.parametrize(
    ("second", "place", "expected"),
    [
        (SECOND[:-4], len(FIRST), f"{MUST}, length {len(SECOND)}, {len(SECOND) - 4} bytes"),
        (b"\x30\x00\x02" + SECOND[3:], len(FIRST), f"{MUST}, length 2, 3 bytes"),
        (
            block(48, b"\x01\x01\x01\x01\x80" + bytes(9)),
            len(FIRST) + 3,
            "an item of number 29, which the category has not",
        ),
        (block(48, plot_048(3, track=1)[:-1]), len(FIRST) + 3, "item 161 ends after the data block"),
        (block(48, b"\xff"), len(FIRST) + 3, "a field specification that does not end"),
    ],
)
def test_a_damaged_file_is_refused_with_its_place(tmp_path, second, place, expected):
    (line,) = refused(tmp_path, FIRST + second)
    assert line.startswith(f"recording: byte {place}")
    assert expected in line
    assert line.endswith("; 2 records were read before")
    assert refused(tmp_path, FIRST + second, Options(site=SITE)) == [line]  # the truth is looked for first


def test_every_length_of_item_is_followed(tmp_path):
    """Extended, repeated, compound and explicit items before the one that is read."""
    items = {
        1: b"\x19\x0a", 2: b"\x00\x32\x00", 3: b"\x21\x01\x00", 4: b"\x10\x00\x10\x00",
        7: b"\xfe" + bytes(7),
        10: b"\x02" + bytes(16), 11: b"\x00\x2a", 16: b"\x03\x05\x02", 20: b"\x40\x01" + bytes(6),
        28: b"\x04\x01\x02\x03",
    }  # fmt: skip
    _, columns, tracks = imported(tmp_path, block(48, specified(items), plot_048(200, 4096, 0, track=9)))
    assert tracks == ["42", "9"]
    np.testing.assert_array_equal(columns["range_m"], 4096 * NM / 256)


def test_a_clock_that_turns():
    unrolled = UnrolledClock(60.0)
    assert [unrolled(t) for t in (50, 58, 3, 59, 4, 30, 59, 1)] == [50, 58, 63, 59, 64, 90, 119, 121]


# ---- positions -------------------------------------------------------------------------------------------------------

ADSB = """time,icao24,lat,lon,velocity,heading,vertrate,callsign,onground,geoaltitude
1700000000,a1b2c3,52.6,4.76,200,0,0,KLM1,False,9000
1700000010,a1b2c3,52.618,4.76,200,0,0,KLM1,False,9000
1700000010,0000ff,52.3,5.5,,,,,False,
"""


def cartesian(latitude_deg, longitude_deg, height_m):
    """Earth-fixed coordinates, by the ellipsoid of WGS 84: a textbook's, apart from the library."""
    a, f = 6378137.0, 1 / 298.257223563
    e2, lat, lon = f * (2 - f), math.radians(latitude_deg), math.radians(longitude_deg)
    n = a / math.sqrt(1 - e2 * math.sin(lat) ** 2)
    flat = (n + height_m) * math.cos(lat)
    return np.array([flat * math.cos(lon), flat * math.sin(lon), (n * (1 - e2) + height_m) * math.sin(lat)])


def axes(latitude_deg, longitude_deg):
    """North, up and east at a place, as rows."""
    lat, lon = math.radians(latitude_deg), math.radians(longitude_deg)
    up = [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)]
    east = [-math.sin(lon), math.cos(lon), 0.0]
    return np.array([np.cross(up, east), up, east])


def local(*place):
    """North, up and east of the radar."""
    return axes(*SITE.coordinates[:2]) @ (cartesian(*place) - cartesian(*SITE.coordinates))


def radial(latitude_deg, longitude_deg, height_m, north_mps):
    """The radial velocity of one that moves north."""
    line = cartesian(latitude_deg, longitude_deg, height_m) - cartesian(*SITE.coordinates)
    return north_mps * axes(latitude_deg, longitude_deg)[0] @ line / np.linalg.norm(line)


def test_positions_are_seen_from_the_radar(tmp_path):
    done, columns, tracks = imported(tmp_path, ADSB.encode(), Options(site=SITE))
    assert (done.format, tracks) == ("opensky", ["a1b2c3", "a1b2c3", "0000ff"])
    for i, place in enumerate([(52.6, 4.76, 9000), (52.618, 4.76, 9000), (52.3, 5.5, 0)]):
        wanted = local(*place)
        found, r = [columns[name][i] for name in ("x_m", "y_m", "z_m")], np.linalg.norm(wanted)
        assert_rounded(found, wanted, **PLACE)
        assert_rounded(columns["range_m"][i], r, **PLACE)
        assert_rounded(columns["level_elevation_rad"][i], math.asin(wanted[1] / r), EARTH_M / r, operations=12)
    wanted = [radial(52.6, 4.76, 9000, 200), radial(52.618, 4.76, 9000, 200)]
    turned = 200 * EARTH_M / columns["range_m"][:2]  # of the direction, as of the angles
    assert_rounded(columns["velocity_mps"][:2], wanted, turned, operations=12)
    assert np.isnan(columns["velocity_mps"][2])
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 10])


def test_a_ship_beyond_the_horizon_is_below_the_level(tmp_path):
    _, columns, _ = imported(tmp_path, ADSB.encode(), Options(site=SITE, tracks=("0000ff",)))
    r = columns["range_m"][0]
    # The ellipsoid's radii of curvature are 6375 and 6392 km here.
    assert columns["y_m"][0] == pytest.approx(-(r**2) / (2 * 6.3835e6) - 12, rel=8.5 / 6383.5)


def test_a_plot_of_known_height_is_placed_where_that_height_is():
    """There and back, out to 400 km, from below the radar to 20 km."""
    rng = np.random.default_rng(2)
    n = 500
    columns = {
        "latitude_deg": rng.uniform(49.5, 55, n), "longitude_deg": rng.uniform(0, 9, n),
        "altitude_m": rng.uniform(-50, 20e3, n), **{name: np.zeros(n) for name in ("east_mps", "north_mps", "up_mps")},
    }  # fmt: skip
    seen = SITE.measure(columns)
    local = SITE.local_positions(seen["range_m"], seen["bearing_rad"], columns["altitude_m"])
    np.testing.assert_allclose(
        local, np.stack([seen[name] for name in ("x_m", "y_m", "z_m")], axis=-1), rtol=0, atol=HEIGHT_ACCURACY_M
    )
    impossible = SITE.local_positions(np.array([1000.0, 1000.0]), np.zeros(2), np.array([5000.0, np.nan]))
    assert np.isnan(impossible[:, 1]).all()


def test_the_angles_of_an_antenna_are_those_that_multimodel_takes(tmp_path):
    antenna = Antenna(math.radians(10), math.radians(5))
    local = np.array([[50e3, 4e3, 9e3], [-50e3, 4e3, 9e3]])
    angles = antenna_angles(local, antenna)
    normal = np.array(
        [math.cos(antenna[1]) * math.cos(antenna[0]), math.sin(antenna[1]), math.cos(antenna[1]) * math.sin(antenna[0])]
    )
    right = np.array([-math.sin(antenna[0]), 0, math.cos(antenna[0])])
    unit = local[0] / np.linalg.norm(local[0])
    wanted = [math.asin(unit @ right), math.asin(unit @ np.cross(right, normal))]
    # The sine is a sum of three products of three factors.
    assert_rounded([angles["azimuth_rad"][0], angles["elevation_rad"][0]], wanted, size=1, operations=9)
    assert np.isnan(angles["azimuth_rad"][1])
    _, columns, _ = imported(tmp_path, ADSB.encode(), Options(site=SITE, antenna=antenna))
    assert np.isfinite(columns["azimuth_rad"]).all()
    done, columns, _ = imported(tmp_path, ADSB.encode(), Options(site=SITE, antenna=Antenna(math.pi / 2 + 0.1, 0.0)))
    assert np.isnan(columns["azimuth_rad"]).tolist() == [True, True, False]
    assert any("plots behind the antenna or without height: 2 of 3;" in note for note in done.notes)


def test_ships_by_ais(tmp_path):
    pyais = pytest.importorskip("pyais")
    lines = []
    for k in range(5):
        report = {
            "msg_type": 1,
            "mmsi": 244660000,
            "lat": 52.4 + 0.001 * k,
            "lon": 4.3,
            "speed": 12.0,
            "course": 0.0,
            "second": (50 + 10 * k) % 60,
        }
        (sentence,) = pyais.encode_dict(report, talker_id="AI")
        lines.append(sentence)
    stamped = [f"\\s:r3669961,c:{1700000000 + 10 * k}*00\\{line}" for k, line in enumerate(lines)]
    dated = [f"2023-11-14T22:13:{20 + 7 * k}Z {line}" for k, line in enumerate(lines)]
    after = [f"{line},{1700000000 + 8 * k}" for k, line in enumerate(lines)]
    for text, step in ((lines, 10), (stamped, 10), (dated, 7), (after, 8)):
        done, columns, tracks = imported(tmp_path, "\n".join(text).encode(), Options(site=SITE))
        assert (done.format, set(tracks)) == ("ais", {"244660000"})
        np.testing.assert_array_equal(columns["t_s"], step * np.arange(5))
        turned = 12 * NM / 3600 * EARTH_M / columns["range_m"][0]
        assert_rounded(columns["velocity_mps"][0], radial(52.4, 4.3, 0, 12 * NM / 3600), turned, operations=12)
    imported(
        tmp_path,
        b"\n".join([lines[0].encode(), b"!AIVDM,1,1,,A,broken,0*00", *(x.encode() for x in lines[1:])]),
        Options(site=SITE),
    )
    (tmp_path / "plots.csv").unlink()
    (line,) = refused(tmp_path, b"!AIVDM,1,1,,A,broken,0*00\nnothing\n", Options(site=SITE))
    assert "must be AIS sentences" in line


def ship(second, north=0.0, mmsi=244660000):
    """A report of a ship at 52.4 + north degrees at a second of the minute."""
    pyais = pytest.importorskip("pyais")
    report = {"msg_type": 1, "mmsi": mmsi, "lat": 52.4 + north, "lon": 4.3, "speed": 12.0, "course": 0.0}
    (sentence,) = pyais.encode_dict({**report, "second": second}, talker_id="AI")
    return sentence


@pytest.mark.parametrize(
    ("lines", "times", "note"),
    [
        (  # of a Gatehouse receiver: the line before each sentence
            [f"$PGHP,1,{time},0,0,0,1,2C*5B\n{ship(8)}" for time in ("2020,12,31,23,59,58,239", "2021,1,1,0,0,9,7")],
            [0, 10.768],
            "",
        ),
        ([f"{ship(8)},{1630526400 + t},{1630526402 + t}" for t in (0, 10)], [0, 10], ""),  # received, and logged
        ([f"\\c:{1700000000 + t}.{5 * t}0,s:a*00\\{ship(8)}" for t in (0, 5)], [0, 5.25], ""),
        (
            [ship(50), ship(10), "$GPZDA,1,2*00", ship(15)],
            [0, 20, 25],
            "reports that state no time: 3; the seconds of their minute run on",
        ),
        (  # some have a time, and 1700000000 is 20 s past the minute
            [f"\\c:1700000000*00\\{ship(19)}", ship(18, mmsi=2), ship(25), ship(50), ship(5)],
            [0, -2, 5, 30, 45],
            "reports that state no time: 4; they get the nearest with their second",
        ),
    ],
)  # fmt: skip
def test_times_of_ships(tmp_path, lines, times, note):
    done, columns, _ = imported(tmp_path, "\n".join(lines).encode(), Options(site=SITE))
    np.testing.assert_allclose(columns["t_s"], times, rtol=0, atol=CLOCK_S)
    assert [one for one in done.notes if "state no time" in one] == ([note] if note else [])
    assert done.skipped == (["sentences other than AIS (1)"] if "ZDA" in "".join(lines) else [])


def test_a_report_in_two_sentences_has_the_time_of_the_first(tmp_path):
    """The second comes later."""
    lines = []
    for k in range(3):
        *_, payload, rest = ship(7, 0.001 * k).split(",")
        bodies = f"AIVDM,2,1,{k},A,{payload[:20]},0", f"AIVDM,2,2,{k},A,{payload[20:]},{rest[0]}"
        first, second = (f"!{body}*{functools.reduce(operator.xor, body.encode()):02X}" for body in bodies)
        lines += [
            f"\\g:1-2-{k},s:r1,c:{1_700_000_000 + 20 * k}*00\\{first}",
            f"\\g:2-2-{k},c:{1_700_000_009 + 21 * k}*00\\{second}",
        ]
    done, columns, _ = imported(tmp_path, "\n".join(lines).encode(), Options(site=SITE))
    np.testing.assert_array_equal(columns["t_s"], [0, 20, 40])
    assert not done.notes


# ---- tables ----------------------------------------------------------------------------------------------------------


def test_a_spreadsheet_with_its_own_names_and_units(tmp_path):
    text = "Time,Slant Range [km],Azimuth (deg),Radial_velocity_kn,flight\n"
    text += "2024-05-01T12:00:00Z,50,90,100,A\n2024-05-01T14:00:10+02:00,49.5,90,,A\n"
    done, columns, tracks = imported(tmp_path, text.encode())
    assert (done.format, tracks) == ("csv", ["A", "A"])
    assert_rounded(columns["range_m"], [50e3, 49.5e3])
    assert_rounded(columns["bearing_rad"], [math.pi / 2] * 2)
    assert_rounded(columns["velocity_mps"], [100 * NM / 3600, np.nan], operations=2)
    np.testing.assert_array_equal(columns["t_s"], [0, 10])


def test_names_and_units():
    assert [split_unit(name) for name in ("Range [km]", "range_km", "Azimuth (deg)", "time", "slant range", "t_s")] == [
        ("range", "km"), ("range", "km"), ("azimuth", "deg"), ("time", ""), ("slant_range", ""), ("t", "s"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a,b\n1,2\n", "recording:1: must have columns of time, and of latitude and longitude or of range"),
        ("time,range_m\n1,x\n2,3\n3,y\n", "recording:2:2: range_m: must be a number, got 'x'"),
        (
            "time,range_m\nnoon,5\n",
            "recording:2:1: time: must be a time in s, a time of day, ISO 8601 or DD.MM.YYYY and a time, got 'noon'",
        ),
        ("time,range_m\n1\n", "recording:2: must have 2 cells as the header, got 1"),
        ("time,range_parsec\n1,2\n", "recording:1: must have columns of time"),
        ("time,range [parsec]\n1,2\n", "; got 'parsec'; it is stated by --column range_km='range [parsec]'"),
        ("time,lat,lon\n1,95,4\n", "recording:2:2: lat: must be from -90 to 90 degrees, got 95"),
        ("time,range_m\n,\n", "has no plots; 1 records were read; left out: records without time or position (1)"),
        ("", "recording: is empty"),
        ("hello\n", "must be a recording in one of asterix, opensky, ais, csv"),
    ],
)
def test_faults_of_tables(tmp_path, text, expected):
    assert expected in refused(tmp_path, text.encode(), Options(site=SITE))[0]


def test_all_faults_of_a_table_at_once(tmp_path):
    rows = "".join(f"{k},{'x' if k % 2 else 3},{'y' if k == 7 else 1}\n" for k in range(4000))
    assert refused(tmp_path, f"time,range_m,azimuth [deg]\n{rows}".encode()) == [
        "recording:3:2: range_m: must be a number, got 'x' (and 1999 more, in lines 5, 7, 9, …); if this is not "
        "range_m, name the column: --column range_m=THEIRS",
        "recording:9:3: azimuth [deg]: must be a number, got 'y'; if it stands for no value, leave such cells empty",
    ]


def test_positions_need_a_radar(tmp_path):
    (line,) = refused(tmp_path, ADSB.encode())
    assert line.startswith("at: must say where the radar stands, LAT,LON,HEIGHT")


def test_a_column_named_by_hand(tmp_path):
    text = b"when,d1,d2\n1,100,200\n2,101,201\n"
    columns = {"t_s": "when", "range_m": "d2"}
    assert imported(tmp_path, text, Options(columns=columns))[1]["range_m"].tolist() == [200, 201]
    (line,) = refused_again(tmp_path, text, Options(columns={"range_m": "d3"}))
    assert "must name a column of when, d1, d2" in line
    columns = {"t_ms": "when", "range_km": "d2"}
    done, found, _ = imported(tmp_path, text, Options(columns=columns, zero="midnight"))
    assert (found["range_m"].tolist(), found["t_s"].tolist()) == ([200e3, 201e3], [1e-3, 2e-3])
    assert not any("assumed" in note for note in done.notes)
    (line,) = refused_again(tmp_path, text, Options(columns={"height_km": "d2"}))
    assert "column height_km=d2: must name one of t_s, date, track" in line
    (tmp_path / "plots.csv").unlink()
    done, found, _ = imported(tmp_path, b"t,d [m]\n1,2\n", Options(columns={"range_km": "d [m]"}))
    assert found["range_m"].tolist() == [2000]
    assert done.notes == ["d [m] is read in km, as --column says, not in m"]


FLIGHT = [(1_700_000_000 + 10 * k, 52.0 + 0.01 * k, 4.5 + 0.012 * k) for k in range(4)]


@pytest.mark.parametrize(
    ("header", "row", "feet"),
    [
        # OpenSky's states, which are in SI
        ("time,icao24,lat,lon,velocity,heading,vertrate,callsign,onground,baroaltitude,geoaltitude,lastposupdate",
         "{t},4ca1fa,{lat},{lon},200,90,0,KLM1,False,9900,10000,{t}", False),
        ("timestamp,lat,lon,alt,gs,heading", "{t},{lat},{lon},10000,200,90", True),
        # the course is called track
        ("timestamp,icao24,latitude,longitude,groundspeed,track,altitude", "{t},4ca1fa,{lat},{lon},200,90,10000", True),
        ("Timestamp,UTC,Callsign,Position,Altitude,Speed,Direction", '{t},x,K1,"{lat},{lon}",10000,200,90', True),
        ("time;icao24;lat;lon;velocity;heading;geoaltitude", "{t};a;{lat};{lon};200,0;90;10000,0", False),
    ],
)  # fmt: skip
def test_exports_of_positions(tmp_path, header, row, feet):
    """The altitude, and the speed to the east as seen from a radar that is far to the west."""
    west, text = Options(site=Site(52.0, 4.0, 0.0)), header + "\n"
    for t, lat, lon in FLIGHT:
        line = row.format(t=t, lat=lat, lon=lon)
        text += (line.replace(".", ",") if ";" in line else line) + "\n"
    done, columns, tracks = imported(tmp_path, text.encode(), west)
    assert len(set(tracks)) == 1
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 20, 30])
    assert_rounded(columns["altitude_m"], np.full(4, 10000 * (0.3048 if feet else 1)))
    speed = 200 * (NM / 3600 if feet else 1)
    assert 0.9 * speed < columns["velocity_mps"][0] < speed
    taken = " ".join(note for note in done.notes if note.startswith("assumed because the name has no unit"))
    assert (" in ft" in taken and " in kn" in taken) == feet


def test_altitudes_that_no_aircraft_has_are_asked_about(tmp_path):
    done, _, _ = imported(tmp_path, b"time,lat,lon,altitude\n1,52,4,36000\n", Options(site=SITE))
    assert done.notes[-1] == "altitudes up to 36,000 m: if altitude is in feet, name it altitude_ft"


def test_times_are_those_of_the_positions(tmp_path):
    """A query every 10 s gives positions of other times, and old ones again."""
    text = "time,icao24,lat,lon,velocity,heading,lastposupdate\n"
    for k in range(6):
        old = 7.3 * (k // 2)
        text += f"{1.7e9 + 10 * k},a1,{52.6 + old * 200 / 111_250},4.76,200,0,{1.7e9 + 10 * k // 20 * 20 + 3.5}\n"
    done, columns, _ = imported(tmp_path, text.encode(), Options(site=SITE))
    np.testing.assert_array_equal(columns["t_s"], [0, 20, 40])
    assert done.skipped == ["rows that repeat the position before them (3)"]
    assert "times are lastposupdate; not used: time" in done.notes
    at_anchor = b"time,mmsi,lat,lon,sog,cog\n1,7,52,4,0,0\n2,7,52,4,0.1,90\n"
    assert imported(tmp_path, at_anchor, Options(site=SITE))[0].rows == 2


@pytest.mark.parametrize(
    ("row", "velocity"),
    [
        ("12.0,0.0,182", 12 * NM / 3600),  # the course counts, not where the bow points
        ("12.0,511,511", np.nan),
        ("102.3,0.0,0", np.nan),
        ("12.0,360.0,0", np.nan),
    ],
)
def test_ships_in_tables_count_in_knots_by_their_course(tmp_path, row, velocity):
    text = f"MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading\n244660000,2020-01-01T00:00:00,52.4,4.76,{row}\n"
    done, columns, _ = imported(tmp_path, text.encode(), Options(site=Site(52.3, 4.76, 0.0)))
    np.testing.assert_allclose(
        columns["velocity_mps"], velocity, rtol=math.radians(0.1) ** 2 / 4
    )  # the line dips by half of it
    assert "assumed because the name has no unit: SOG in kn" in done.notes


def test_rows_of_several_aircraft_are_asked_whose(tmp_path):
    """No known name: two aircraft in turn, twice at the same time."""
    text = "TIME(s),RHO [NM],THETA [deg],TA,MODE\n"
    text += "".join(f"{k // 2},{50 + k},{10 * (k % 2)},{'4CA1' if k % 2 else '3C64'},S{k}\n" for k in range(20))
    (line,) = refused(tmp_path, text.encode())
    assert "track: no column identifies the tracks, and 10 rows are not later than the one before" in line
    assert line.endswith("name the column, --column track=THEIRS; it may be: TA (2 different)")
    done, _, tracks = imported(tmp_path, text.encode(), Options(columns={"track": "TA"}))
    assert (done.rows, set(tracks)) == (20, {"4CA1", "3C64"})
    assert done.notes == []


def test_a_table_passes_midnight_and_may_be_sorted_by_track(tmp_path):
    text = "time,range_m,track\n" + "".join(f"{(86380 + 10 * k) % 86400},{50 + k},{k % 2}\n" for k in range(6))
    np.testing.assert_array_equal(imported(tmp_path, text.encode())[1]["t_s"], 10 * np.arange(6))
    text = "time,range_m,track\n" + "".join(f"{t},50,{n}\n" for n in range(2) for t in range(0, 60_000, 5000))
    np.testing.assert_array_equal(imported(tmp_path, text.encode())[1]["t_s"], 2 * [*range(0, 60_000, 5000)])


@pytest.mark.parametrize("sign", [";", "\t"])
def test_a_spreadsheet_with_decimal_commas(tmp_path, sign):
    rows = ["# exported", "Zeit;Time;Slant Range [NM];Azimuth [deg];Height [ft];Radial velocity [kn]"]
    rows += ["12:00;0,5;20,5;90;25000;-150,5", "12:04;4,5;20,7;90;25000;"]
    _, columns, _ = imported(tmp_path, "\n".join(rows).replace(";", sign).encode())
    assert_rounded(columns["range_m"], [20.5 * NM, 20.7 * NM])
    assert_rounded(columns["velocity_mps"], [-150.5 * NM / 3600, np.nan], operations=2)
    np.testing.assert_array_equal(columns["t_s"], [0, 4])
    rows[2] = "12:00;0,5;a;90;25000;1"
    (line,) = refused_again(tmp_path, "\n".join(rows).encode(), PLAIN, write=True)
    assert line.endswith("recording:3:3: Slant Range [NM]: must be a number, got 'a'")


# ---- all -------------------------------------------------------------------------------------------------------------


def test_an_unknown_track_names_those_there_are(tmp_path):
    (line,) = refused(tmp_path, block(48, plot_048(1, track=4), plot_048(2, track=8)), Options(tracks=("5",)))
    assert line == "recording: track: must be one of 4, 8; got 5"


def test_rows_that_are_not_later_are_left_out(tmp_path):
    done, columns, _ = imported(tmp_path, block(48, *(plot_048(t, track=1) for t in (1, 2, 2, 3))))
    np.testing.assert_array_equal(columns["t_s"], [0, 1, 2])
    assert done.skipped == ["rows sent again, with the same time and values (1)"]


@pytest.mark.parametrize("span", [0, 60])
def test_a_doppler_speed_of_the_other_sign_is_seen(tmp_path, span):
    """A target that leaves at 100 m/s, its speed counted as positive for approach; folded into 60 m/s and not."""
    speed = -100 if not span else 20
    more = {"raw": (speed, span, 3000)} if span else {"calculated": speed}
    records = [plot_048(4 * k, 12800 + round(4 * k * 100 / NM * 256), track=1, **more) for k in range(1, 60)]
    done, *_ = imported(tmp_path, block(48, *records))
    assert any("give --doppler-towards" in note for note in done.notes)
    done, columns, _ = imported(tmp_path, block(48, *records), Options(towards=True))
    assert not done.notes
    np.testing.assert_array_equal(columns["velocity_mps"], -speed)


def test_a_span_of_zero_is_none(tmp_path):
    text = "time,track,range_m,velocity,span\n" + "".join(f"{4 * k},1,{1000 + 20 * k},5,0\n" for k in range(30))
    assert np.isnan(imported(tmp_path, text.encode())[1]["span_mps"]).all()


def test_described_is_textbook():
    seen = position_columns(np.array([[3.0, 12.0, 4.0], [-1.0, 0.0, -1.0]]))
    assert_rounded(seen["range_m"], [13, math.sqrt(2)], operations=4)
    assert_rounded(seen["bearing_rad"], [math.atan2(4, 3), 1.25 * math.pi], operations=4)
    assert_rounded(seen["level_elevation_rad"], [math.asin(12 / 13), 0], 13 / 5, operations=6)  # 1/cosine


def recordings():
    """A small sound file of each format."""
    records = [plot_048(t, 12800 + t, 40, level=1200, track=3, address=0xA1, raw=(5, 60, 3000)) for t in range(1, 20)]
    positions = [position_062(t, 53 + t / 1000, 4.76, address=0xA1, track=7, height_ft=3e4) for t in range(20)]
    yield block(62, *positions) + block(48, *records)
    yield block(2, b"\x10\x00\x10\x00") + block(1, b"\x80\x19\x0a") + block(48, *records)
    yield ADSB.encode()
    yield b"time,range_km,azimuth_deg\n1,50,20\n2,51,21\n"
    yield b"!AIVDM,1,1,,A,13HOI:0P0000VOHLCnHQKwvL05Ip,0*23\n" * 3
    yield (
        b"!AIVDM,2,1,3,B,55P5TL01VIaAL@7WKO@mBplU@<PDhh000000001S;AJ::4A80?4i@E53,0*3E\n"
        b"!AIVDM,2,2,3,B,1@0000000000000,2*55\n!AIVDM,1,1,,A,13HOI:0P0000VOHLCnHQKwvL05Ip,0*23\n"
    )


def test_spoiled_files(tmp_path):
    fuzz(tmp_path, recordings(), 300, 1)


@pytest.mark.slow
def test_many_spoiled_files(tmp_path):
    fuzz(tmp_path, recordings(), 10_000, 2)


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        (("10:00:00,01", "10:00:04,51"), 4.5),
        (("23:59:58.5", "00:00:02.25"), 3.75),
        (("20.11.2026 23:59:58", "21.11.2026 00:00:02,5"), 4.5),
    ],
)
def test_times_as_people_write_them(tmp_path, times, expected):
    """A time of day runs on after midnight; a date says its day first."""
    source, plots = tmp_path / "log.csv", tmp_path / "plots.csv"
    source.write_text("Time;Range [km]\n" + "".join(f"{time};{20 + i},5\n" for i, time in enumerate(times)))
    import_recording(str(source), str(plots), Options("csv"))
    rows = list(csv.DictReader(line for line in plots.read_text().splitlines() if not line.startswith("#")))
    assert [float(row["t_s"]) for row in rows] == pytest.approx([0.0, expected], rel=0, abs=np.spacing(86400.0))


@pytest.mark.parametrize(("second", "told"), [("2,000", True), ("2,50", False), ("0,500", False)])
def test_commas_that_may_part_thousands_are_told(tmp_path, second, told):
    done, columns, _ = imported(tmp_path, f"t_s;range [m]\n0;1,000\n4;{second}\n".encode(), Options("csv"))
    assert columns["range_m"][0] == 1
    assert ("commas are decimal: 1,000 is read as 1" in done.notes) == told


@pytest.mark.parametrize(
    ("encoding", "name"),
    [("utf-8", ""), ("cp1252", "Windows-1252"), ("utf-16", "UTF-16"), ("utf-16-le", "UTF-16"), ("utf-16-be", "UTF-16")],
)
def test_encodings_that_spreadsheets_write(tmp_path, encoding, name):
    text = "t_s;range [km];azimuth [°];Höhe\n0;20,5;45;1\n4;21,5;46;2\n"
    done, columns, _ = imported(tmp_path, text.encode(encoding), Options("csv"))
    assert_rounded(columns["bearing_rad"], np.radians([45, 46]))
    assert [note for note in done.notes if "read as" in note] == (
        [f"the text is read as {name}, as it is not UTF-8; for another: --encoding NAME"] if name else []
    )


def test_columns_named_in_another_code_page(tmp_path):
    """An 8-bit page is known by Cyrillic words, unless it is named; what is UTF-8 stays so."""
    text = "Время;Дальность [km]\n23:59:58;20,5\n00:00:02;21,5\n"
    named = {"t_s": "Время", "range_m": "Дальность [km]"}
    for encoding in ("cp1251", "koi8-r", "utf-8", "utf-16"):
        other = "" if encoding == "utf-16" else encoding.replace("utf-8", "cp1251")
        done, columns, _ = imported(tmp_path, text.encode(encoding), Options(None, columns=named, encoding=other))
        assert columns["t_s"].tolist() == [0, 4]
        assert columns["range_m"].tolist() == [20500, 21500]
        assert [note for note in done.notes if "midnight" in note] == [
            "the times of day pass midnight: t_s runs on (1 × 24 h)"
        ]
        (tmp_path / "plots.csv").unlink()
    done, columns, _ = imported(tmp_path, text.encode("cp1251"), Options("csv"))
    assert columns["range_m"].tolist() == [20500, 21500]
    assert "the text is read as Windows-1251, as it is not UTF-8; for another: --encoding NAME" in done.notes
    (tmp_path / "plots.csv").unlink()
    (line,) = refused(tmp_path, b"t_s,range,\x81\n0,1,2\n", Options("csv"))
    assert line.endswith("is not Windows-1252 text: --encoding NAME names it")


def test_an_unknown_encoding_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="encoding: must be an encoding such as cp1251"):
        check_encoding("base64")


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"t_s,range,range\n0,1,5\n1,2,6\n", ":1: range: must be the name of one column; several have it"),
        (b"", ":1: must have columns of time"),
        (b"\xff\xfet\x00,\x00\x00\xd8\n\x00", ": is not UTF-16 text"),
    ],
)
def test_a_table_that_is_none(tmp_path, data, line):
    (said,) = refused(tmp_path, data, Options("csv", columns={} if data else {"t_s": "t"}))
    assert line in said
