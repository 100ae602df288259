"""Logs of receivers and programs that are no CSV: JSON, Parquet, GPX, NMEA 0183, gzipped; made here, and read back."""

import gzip
import io
import json

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options, parse_truth
from tests.recordings.formats.example_files import EARTH_M, PLACE, SITE, fuzz, imported, refused
from tests.recordings.formats.test_importing import NM, local
from tests.tolerances import assert_rounded

KN, FT = NM / 3600, 0.3048
AT = Options(site=SITE)
STEP = 300 * KN * 10 / 111_260  # degrees that 300 kn north take in 10 s


def places(columns):
    return np.stack([columns[name] for name in ("x_m", "y_m", "z_m")], axis=-1)


# ---- JSON ------------------------------------------------------------------------------------------------------------


def trace():
    """Six entries: one stale, one on the ground, one without a geometric altitude, one whose altitude is geometric."""
    return {"icao": "4ca1fa", "r": "EI-ABC", "timestamp": 1609275898.5, "trace": [
        [0, 52.6, 4.76, 30000, 300.0, 0.0, 0, 0, {"flight": "X"}, "adsb_icao", 30500, 0, None, None],
        [10.0, 52.6 + STEP, 4.76, 30000, 300.0, 0.0, 4, 64, None, "adsb_icao", 30500, 64, 280, None],
        [30.0, 52.6 + STEP, 4.76, 30000, 300.0, 0.0, 1, 0, None, "adsb_icao", 30500, 0, None, None],
        [40.0, 52.6 + 4 * STEP, 4.76, 30000, 300.0, 0.0, 2, None, None, "mlat", None, None, None, None],
        [50.0, 52.6 + 5 * STEP, 4.76, 30500, 300.0, 0.0, 8, 0, None],
        [900.0, 52.3, 4.75, "ground", 5.0, 90.0, 0, None, None],
    ]}  # fmt: skip


@pytest.mark.parametrize("packed", [False, True])
def test_a_trace_of_readsb(tmp_path, packed):
    data = json.dumps(trace()).encode()
    done, columns, tracks = imported(tmp_path, gzip.compress(data) if packed else data, AT)
    assert (done.format, set(tracks)) == ("json", {"4ca1fa"})
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 40, 50, 900])
    assert_rounded(columns["altitude_m"], [30500 * FT, 30500 * FT, 30000 * FT, 30500 * FT, np.nan])
    assert_rounded(places(columns)[1], local(52.6 + STEP, 4.76, 30500 * FT), **PLACE)
    assert 299 * KN > columns["velocity_mps"][0] > 250 * KN
    assert np.isnan(columns["velocity_mps"][4])  # on the ground the course is where the nose points
    assert done.skipped == ["positions marked as stale (1)"]
    assert "barometric altitudes, where the geometric one is missing: 1" in done.notes
    assert "positions without altitude, placed at sea level: 1 of 5" in done.notes


def test_moments_of_readsb_one_a_line(tmp_path):
    """aircraft.json: each position is as old as it says; one that is repeated is no plot."""
    lines = []
    for k in range(4):
        one = {"hex": "4ca1fa", "flight": "EIN1 ", "alt_baro": 30000, "alt_geom": 30500, "gs": 300,
               "track": 0, "geom_rate": 0, "lat": 52.6 + STEP * (k // 2 * 2), "lon": 4.76,
               "seen_pos": 0.5 + 10 * (k % 2) + k // 2}  # fmt: skip
        silent = {"hex": "~3c6444", "seen": 1.0}
        lines.append(json.dumps({"now": 1.7e9 + 10 * k, "messages": 5, "aircraft": [one, silent]}))
    done, columns, tracks = imported(tmp_path, "\n".join(lines).encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], [0, 19])
    assert set(tracks) == {"4ca1fa"}
    skipped = ["records without time or position (4)", "rows that repeat the position before them (2)"]
    assert sorted(done.skipped) == skipped
    _, alone, _ = imported(tmp_path, json.dumps(json.loads(lines[0]), indent=1).encode(), AT)
    np.testing.assert_array_equal(places(alone), places(columns)[:1])


RECORDS = [
    {"timestamp": 1_527_693_698_000 + 10_000 * k, "icao24": "4ca1fa", "callsign": "EIN1", "latitude": 52.6 + STEP * k,
     "longitude": 4.76, "altitude": 30000.0, "groundspeed": 300.0, "track": 0.0, "vertical_rate": 0.0}
    for k in range(5)
]  # fmt: skip
SHAPES = {
    "records": lambda: json.dumps(RECORDS),
    "lines": lambda: "\n".join(json.dumps(record) for record in RECORDS),
    "columns": lambda: json.dumps({name: {str(i): one[name] for i, one in enumerate(RECORDS)} for name in RECORDS[0]}),
    "lists": lambda: json.dumps({name: [one[name] for one in RECORDS] for name in RECORDS[0]}),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_data_frames_written_as_json(tmp_path, shape):
    """As the library `traffic` writes them: names of aviation, times in ms."""
    done, columns, tracks = imported(tmp_path, gzip.compress(SHAPES[shape]().encode()), AT)
    assert set(tracks) == {"4ca1fa"}
    np.testing.assert_array_equal(columns["t_s"], 10 * np.arange(5))
    assert_rounded(places(columns)[3], local(52.6 + 3 * STEP, 4.76, 30000 * FT), **PLACE)
    assert "times are so large that they are read in units of 0.001 s" in done.notes
    assert any("altitude in ft, groundspeed in kn, vertical_rate in fpm" in note for note in done.notes)


def test_states_of_the_interface_of_opensky(tmp_path):
    states = [["4ca1fa", "EIN1", "Ireland", 1.7e9 + 10 * k, 1.7e9 + 60, 4.76, 52.6 + STEP * k, 9000.0, False, 154.3,
               0.0, 0.0, None, 9100.0, "2000", False, 0] for k in range(3)]  # fmt: skip
    _, columns, tracks = imported(tmp_path, json.dumps({"time": 1_700_000_060, "states": states}).encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 20])
    np.testing.assert_array_equal(columns["altitude_m"], 9100)
    assert set(tracks) == {"4ca1fa"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{"icao": "a", "trace": [', "recording:1: must be JSON: Expecting value"),
        ('{"trace":\n []}', "recording: has no plots; 0 records were read"),
        ('{"x": 3}', "must have columns of time, and of latitude and longitude or of range"),
        ("[1, 2]", "must be a trace or aircraft.json"),
        ("[" * 100_000, "must be JSON"),
        (json.dumps({**trace(), "timestamp": None}), "recording: has no plots; 5 records were read"),
    ],
)
def test_json_that_is_none(tmp_path, text, expected):
    (line,) = refused(tmp_path, text.encode(), AT)
    assert expected in line


# ---- Parquet ---------------------------------------------------------------------------------------------------------


def parquet(columns, **more):
    """The bytes of a Parquet file."""
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    file = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), file, **more)
    return file.getvalue()


def test_parquet_reads_as_the_same_table_in_csv(tmp_path):
    """Moments with and without a zone, numbers that are missing, a nested column; several groups of rows."""
    pa = pytest.importorskip("pyarrow")
    n = 50
    seconds = 1_527_693_698 + 10 * np.arange(n)
    columns = {
        "icao24": pa.array(["4ca1fa"] * n).dictionary_encode(),
        "latitude": 52.6 + STEP * np.arange(n),
        "longitude": np.full(n, 4.76),
        "altitude": pa.array([30000.0 if k % 7 else None for k in range(n)]),
        "nested": [[1, 2]] * n,
    }
    for unit, zone in (("s", None), ("ms", "UTC"), ("us", "Europe/Berlin"), ("ns", "UTC")):
        size = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
        columns["timestamp"] = pa.array(seconds * size, pa.timestamp(unit, zone))
        done, found, tracks = imported(tmp_path, parquet(columns, row_group_size=7), AT)
        assert (done.format, done.rows, set(tracks)) == ("parquet", n, {"4ca1fa"})
        np.testing.assert_array_equal(found["t_s"], 10 * np.arange(n))
    text = "timestamp,icao24,latitude,longitude,altitude\n" + "".join(
        f"{t},4ca1fa,{52.6 + STEP * k!r},4.76,{30000 if k % 7 else ''}\n" for k, t in enumerate(seconds)
    )
    _, wanted, _ = imported(tmp_path, text.encode(), AT)
    for name, column in wanted.items():
        np.testing.assert_array_equal(found[name], column)


def test_damaged_parquet(tmp_path):
    data = parquet({"time": np.arange(5.0), "range_m": np.arange(5.0) + 1})
    (line,) = refused(tmp_path, data[:-10])
    assert line.startswith("recording: must be a Parquet file: ")


# ---- GPX -------------------------------------------------------------------------------------------------------------


def gpx(points, name="<name>Ferry</name>", version="1/1"):
    text = f'<?xml version="1.0"?>\n<gpx xmlns="http://www.topografix.com/GPX/{version}"><metadata><name>x</name></metadata>'
    return f"{text}<trk>{name}<trkseg>{''.join(points)}</trkseg></trk></gpx>".encode()


def point(k, more=""):
    return (f'<trkpt lat="{52.6 + STEP * k!r}" lon="4.76"><ele>20.5</ele><time>2024-05-01T10:00:{10 * k:02}.5Z</time>'
            f"{more}</trkpt>")  # fmt: skip


def test_a_track_in_gpx(tmp_path):
    """Speeds as version 1.0 has them, and as extensions of 1.1."""
    own = "<speed>154.333</speed><course>0</course>"
    extended = ('<extensions><g:TrackPointExtension xmlns:g="http://www.garmin.com/xmlschemas/TrackPointExtension/v2">'
                "<g:speed>154.333</g:speed><g:course>0</g:course></g:TrackPointExtension></extensions>")  # fmt: skip
    for more in ("", own, extended):
        done, columns, tracks = imported(tmp_path, gpx([point(k, more) for k in range(4)]), AT)
        assert (done.format, set(tracks)) == ("gpx", {"Ferry"})
        np.testing.assert_array_equal(columns["t_s"], [0, 10, 20, 30])
        assert_rounded(places(columns)[2], local(52.6 + 2 * STEP, 4.76, 20.5), **PLACE)
        assert np.isfinite(columns["velocity_mps"]).all() == bool(more)
        assert any("above the sea" in note for note in done.notes)
    _, _, tracks = imported(tmp_path, gpx([point(k) for k in range(4)], name=""), AT)
    assert set(tracks) == {"1"}


def test_damaged_gpx(tmp_path):
    whole = gpx([point(k) for k in range(4)])
    (line,) = refused(tmp_path, whole[:-60], AT)
    assert line.startswith("recording:2: must be GPX: ")
    assert line.endswith("3 points were read")
    (line,) = refused(tmp_path, whole.replace(b'lat="52.6"', b'lat="152.6"'), AT)
    assert "recording:1:3: lat: must be from -90 to 90 degrees, got 152.6" in line
    bomb = b'<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa">' + b"".join(
        b'<!ENTITY %c "%s">' % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9)
    )
    (line,) = refused(tmp_path, bomb + b"]><gpx><trk><name>&j;</name></trk></gpx>", AT)
    assert "must be GPX" in line


# ---- NMEA 0183 -------------------------------------------------------------------------------------------------------


def sentence(body):
    total = 0
    for letter in body.encode():
        total ^= letter
    return f"${body}*{total:02X}\r\n"


def fixes(count=4, talker="GP", kinds=("RMC", "GGA"), start=86385.0, day="310124"):
    """A receiver that goes north at 300 kn, 47 m above the ellipsoid; midnight passes."""
    text = ""
    for k in range(count):
        t, lat = start + 10 * k, 52.6 + STEP * k
        clock = t % 86400
        hms = f"{int(clock // 3600):02}{int(clock % 3600 // 60):02}{clock % 60:05.2f}"
        place = f"{int(lat):02}{lat % 1 * 60:.6f},N,00445.600000,E"
        date = day if t < 86400 else "010224"
        if "RMC" in kinds:
            text += sentence(f"{talker}RMC,{hms},A,{place},300.0,0.0,{date},,,A")
        if "GGA" in kinds:
            text += sentence(f"{talker}GGA,{hms},{place},1,08,0.9,5.0,M,42.0,M,,")
    return text


@pytest.mark.parametrize("kinds", [("RMC", "GGA"), ("GGA",), ("RMC",)])
@pytest.mark.parametrize("talker", ["GP", "GN", "GL"])
def test_a_satellite_receiver(tmp_path, kinds, talker):
    noise = "$GPGSV,3,1,11*7F\r\n\r\n" + sentence("GPRMC,235930.00,V,,,,,,,310124,,,N")
    done, columns, _ = imported(tmp_path, (noise + fixes(kinds=kinds, talker=talker)).encode(), AT)
    assert done.format == "nmea"
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 20, 30])
    height = 47.0 if "GGA" in kinds else 0.0
    digit = EARTH_M * np.radians(1e-6 / 60)  # the last one of a sentence's minutes
    np.testing.assert_allclose(places(columns)[1], local(52.6 + STEP, 4.76, height), rtol=0, atol=digit / 2)
    assert np.isfinite(columns["velocity_mps"]).all() == ("RMC" in kinds)
    assert sorted(done.skipped) == ["other lines (1)", "sentences without a fix (1)"]
    dated = Options(site=SITE, zero=1_706_659_200.0)  # 2024-01-31
    _, columns, _ = imported(tmp_path, fixes(kinds=kinds).encode(), dated)
    assert columns["t_s"][0] == 86385


def test_midnight_passes_between_the_dates_of_a_receiver(tmp_path):
    """RMC, which has the date, comes seldom."""
    _, columns, _ = imported(tmp_path, (fixes(2, start=86375.0) + fixes(kinds=("GGA",), start=86395.0)).encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], 10 * np.arange(6))


def test_a_damaged_sentence_is_left_out(tmp_path):
    lines = fixes(kinds=("RMC",)).splitlines(keepends=True)
    lines[1] = lines[1].replace("5236", "5336")
    done, columns, _ = imported(tmp_path, "".join(lines).encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], [0, 20, 30])
    assert done.skipped == ["damaged sentences (1)"]


SEEN = [float(np.linalg.norm(local(52.6 + STEP * (k + 0.45), 4.76, 20.5))) for k in range(4)]  # 5 s after each point
# Plots are written to the millimetre; the chord of 10 s lies below the arc, and is seen under 0.3° at most.
SEEN_M = 0.0005 + (3000 * KN) ** 2 / 8 / EARTH_M * np.sin(np.radians(0.3))


@pytest.mark.parametrize("given", ["own.gpx", "1=own.gpx", "7=own.gpx", "4CA1FA=own.gpx", "9=own.gpx"])
def test_a_log_of_the_way_is_the_truth_of_plots(tmp_path, given):
    """By the name that both use, or whose it is said to be: a track, an address."""
    (tmp_path / "own.gpx").write_bytes(gpx([point(k) for k in range(6)]))
    path, whose = parse_truth(given.replace("own.gpx", f"{tmp_path}/own.gpx"))
    header, cells = {"": ("name", "Ferry"), "7": ("track", "7"), "4CA1FA": ("track_id,icao24", "7,4ca1fa")}.get(
        whose, ("note", "x")
    )
    rows = [f"2024-05-01T10:00:{10 * k + 5:02}Z,{cells},{r:.3f},0\n" for k, r in enumerate(SEEN)]
    text = f"Time,{header},range [m],azimuth [deg]\n{''.join(rows)}".encode()
    options = Options(site=SITE, truth=path, owner=whose)
    if whose == "9":
        (line,) = refused(tmp_path, text, options, beside=["own.gpx"])
        assert "at that time and place; it has 9, the plots 1" in line
        return
    _, columns, _ = imported(tmp_path, text, options)
    np.testing.assert_allclose(columns["true_r_m"], columns["range_m"], rtol=0, atol=SEEN_M)


def test_a_log_is_of_nobody_until_that_is_said(tmp_path):
    """A receiver knows no name; a file of several tracks is not of one."""
    text, truth = b"Time,range [m]\n2024-02-01T00:00:05Z,34000\n", tmp_path / "truth"
    truth.write_text(fixes())
    (line,) = refused(tmp_path, text, Options(site=SITE, truth=str(truth)), beside=["truth"])
    assert line.endswith("has 4 without (if all are of one track ID of the plots: --truth ID=truth)")
    truth.write_bytes(gpx([point(1)]).replace(b"</gpx>", b"<trk>" + point(2).encode() + b"</trk></gpx>"))
    (line,) = refused(tmp_path, text, Options(site=SITE, truth=str(truth), owner="1"), beside=["truth"])
    assert "must be the path of one alone, as 1= says; has 2, Ferry" in line


def test_callsigns_and_codes_of_tables_identify(tmp_path):
    """Plots with a code, positions with addresses and codes: aircraft.json beside a table of a radar."""
    lines = []
    for k in range(6):
        one = {"hex": "4ca1fa", "flight": "EIN1 ", "squawk": "1234", "lat": 52.6 + STEP * k, "lon": 4.76,
               "alt_geom": 20.5 / FT, "seen_pos": 0}  # fmt: skip
        lines.append(json.dumps({"now": 1_714_557_600.5 + 10 * k, "aircraft": [one]}))
    (tmp_path / "truth").write_text("\n".join(lines))
    for header, cells in (("squawk", "1234"), ("callsign", "ein1"), ("id,squawk", "5,1234")):
        rows = [f"2024-05-01T10:00:{10 * k + 5:02}Z,{cells},{r:.3f},0\n" for k, r in enumerate(SEEN)]
        text = f"Time,{header},range [m],azimuth [deg]\n{''.join(rows)}".encode()
        _, columns, _ = imported(tmp_path, text, Options(site=SITE, truth=str(tmp_path / "truth")))
        np.testing.assert_allclose(columns["true_r_m"], columns["range_m"], rtol=0, atol=SEEN_M)


# ---- spoiled files ---------------------------------------------------------------------------------------------------


def sound():
    yield json.dumps(trace()).encode()
    yield json.dumps(RECORDS).encode()
    yield gpx([point(k) for k in range(5)])
    yield fixes().encode()
    yield gzip.compress(json.dumps(trace()).encode())
    try:
        yield parquet({"time": np.arange(9.0), "range_m": np.arange(9.0) + 1, "track": [*"aaabbbccc"]})
    except pytest.skip.Exception:
        return


def test_spoiled_logs(tmp_path):
    fuzz(tmp_path, sound(), 360, 1)


@pytest.mark.slow
def test_many_spoiled_logs(tmp_path):
    fuzz(tmp_path, sound(), 60_000, 2)
