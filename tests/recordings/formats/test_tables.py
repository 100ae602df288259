"""Tables as people and programs write them: each is made here, and read or refused with the option that cures it."""

import math

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.sites import Site
from tests.recordings.formats.example_files import CLOCK_S, EARTH_M, SITE, imported, refused
from tests.recordings.formats.test_importing import local
from tests.tolerances import assert_rounded

NM, KN = 1852.0, 1852 / 3600
SOUTH = Options(site=Site(52.3, 4.76, 0.0))  # of ships, which then leave radially


def test_ranges_and_angles_without_units_are_asked_for(tmp_path):
    text = b"TIME(s),RHO,THETA\n1,18.79,350\n2,18.80,351\n"
    assert refused(tmp_path, text) == [
        "recording:1: RHO, THETA: must have a unit in the name; where it has none, --column range_m=RHO (or range_km, "
        "range_ft, range_nm, range_yd), --column bearing_deg=THETA (or bearing_rad, bearing_acp, bearing_gon, "
        "bearing_mil) states it"
    ]
    _, columns, _ = imported(tmp_path, text, Options(columns={"range_nm": "RHO", "bearing_deg": "THETA"}))
    assert_rounded(columns["range_m"], [18.79 * NM, 18.80 * NM])
    assert_rounded(columns["bearing_rad"], np.radians([350, 351]))


def test_a_table_in_order_of_time_says_that_its_rows_are_taken_as_one_track(tmp_path):
    """Two aircraft in turn, by a name that is not known: no row is late, and none is left out."""
    rows = "".join(f"{k},{k % 2},{20 + k},{k}\n" for k in range(1, 9))
    text = f"time,Target No,range_km,Quality\n{rows}".encode()
    done, _, tracks = imported(tmp_path, text)
    assert tracks == ["1"] * 8
    said = (
        "no column identifies the tracks, all rows are taken as one; if a column does, --column track=THEIRS; it may be"
    )
    assert f"{said}: Target No (2 different)" in done.notes
    done, _, tracks = imported(tmp_path, text, Options(columns={"track": "Target No"}))
    assert tracks == ["1", "0"] * 4
    assert not [note for note in done.notes if note.startswith(said)]


@pytest.mark.parametrize(
    ("unit", "east"),
    [("[deg]", math.sin(math.radians(1.5))), ("[rad]", math.sin(1.5)), ("", math.sin(math.radians(1.5)))],
)
def test_units_are_those_of_the_quantity(tmp_path, unit, east):
    """A course in radians is no number of degrees; `ms` is a time and a speed."""
    text = f"time_ms,lat_rad,lon [°],speed_ms,course {unit}\n0,0.9,4,100,1.5\n5000,0.9001,4,100,1.5\n".encode()
    _, columns, _ = imported(tmp_path, text, Options(site=Site(math.degrees(0.9), 3.9, 0.0)))
    np.testing.assert_array_equal(columns["t_s"], [0, 5])
    # To the east but for half the angle between the meridians.
    assert columns["velocity_mps"][0] == pytest.approx(100 * east, rel=0, abs=100 * math.radians(0.1) / 2)
    (tmp_path / "plots.csv").unlink()
    assert "range [deg]: the unit must be one of m, km" in refused(tmp_path, b"time,range [deg]\n1,2\n")[0]


def test_plots_and_positions_in_one_table_are_both_to_be_had(tmp_path):
    """RHO and THETA of a radar, the place by WGS 84 beside them."""
    text = b"time;TA;RHO;THETA;LAT;LON;velocity\n" + b"1;a;20,5;90;52,3;5,3;200\n5;a;20,6;90;52,3;5,31;200\n"
    done, columns, _ = imported(tmp_path, text, Options(site=SITE, columns={"track": "TA"}))
    assert "positions are read, not plots; for these: --column range_UNIT=RHO" in done.notes
    assert columns["range_m"][0] > 35e3
    asked = Options(columns={"track": "TA", "range_km": "RHO", "bearing_deg": "THETA"})
    _, columns, _ = imported(tmp_path, text, asked)
    assert_rounded(columns["range_m"], [20.5e3, 20.6e3])
    assert np.isnan(columns["velocity_mps"]).all()  # over ground, not radial


@pytest.mark.parametrize(
    ("header", "height", "said"),
    [("Mode C [ft]", 91.44, ""), ("Mode C", 91.44, "Mode C in ft"), ("modec", 91.44, "modec in ft"),
     ("FL", 9144.0, ""), ("Flight level", 9144.0, ""), ("Altitude [FL]", 9144.0, ""), ("FL [m]", 300.0, "")],
)  # fmt: skip
def test_heights_of_a_transponder(tmp_path, header, height, said):
    text = f"Time,Range [km],{header},track\n1,20,300,a\n5,21,300,a\n"
    done, columns, _ = imported(tmp_path, text.encode())
    assert_rounded(columns["altitude_m"], [height, height], operations=2)
    assert done.notes == ([f"assumed because the name has no unit: {said}"] if said else [])


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        (("00:01:03:180", "00:01:04:680"), 1.5),
        (("23.11.2026 23:59:59", "24.11.2026 00:00:01"), 2),
        (("1/2/2024 10:00", "2/2/2024 10:00"), 86400),
        (("2024-02-01 10:00:00 UTC", "2024-02-01 10:00:02 UTC"), 2),
        (("1700000000123", "1700000002623"), 2.5),  # ms from 1970
        (("1700000000123456789", "1700000000623456789"), 0.5),
        (("N/A", "1"), None),
    ],
)
def test_times_as_programs_write_them(tmp_path, times, expected):
    text = "Time;Range [km]\n" + "".join(f"{time};{20 + i},5\n" for i, time in enumerate(times))
    _, columns, _ = imported(tmp_path, text.encode())
    if expected is None:
        assert len(columns["t_s"]) == 1
    else:
        assert columns["t_s"][1] == pytest.approx(expected, rel=0, abs=CLOCK_S)


@pytest.mark.parametrize(
    ("texts", "given", "first", "said"),
    [
        (("1/2/2024", "13/2/2024"), {}, "2024-02-01", ""),
        (("1/13/2024", "1/2/2025"), {}, "2024-01-13", ""),
        (("1/2/2024", "2/2/2024"), {}, "2024-02-01", "if the month stands first: --column t_mdy=Time"),
        (("1/2/2024", "2/2/2024"), {"t_mdy": "Time"}, "2024-01-02", ""),
    ],
)
def test_day_and_month_change_places(tmp_path, texts, given, first, said):
    text = "Time;Range [km]\n" + "".join(f"{text} 10:00:00;20\n" for text in texts)
    done, columns, _ = imported(tmp_path, text.encode(), Options(columns=given, zero=0.0))
    assert columns["t_s"][0] == (np.datetime64(first, "s").astype(int) + 36000)
    assert any(said in note for note in done.notes) == bool(said)


def test_dates_that_contradict_each_other_are_refused(tmp_path):
    (line,) = refused(tmp_path, b"Time;Range [km]\n1/2/2024 10:00;20\n1/25/2024 10:00;20\n1/26/2024 10:00;20\n")
    assert "recording:3:1: Time: must have day and month in the order of '1/2/2024 10:00', got '1/25/2024" in line
    assert "(and 1 more, in line 4)" in line
    assert line.endswith("the order is stated by --column t_mdy=Time or t_dmy=Time")


def test_a_date_stands_beside_the_time_of_day_or_once(tmp_path):
    text = (
        b"Date;Time;Range [km]\n23.11.2026;23:59:58;20\n;23:59:59,5;21\n24.11.2026;00:00:01;22\n25.11.2026;36000;22\n"
    )
    done, columns, _ = imported(tmp_path, text, Options(zero=1_795_392_000.0))  # 2026-11-23
    np.testing.assert_array_equal(columns["t_s"], [86398, 86399.5, 86401, 2 * 86400 + 36000])
    assert not done.notes


def test_times_of_day_are_matched_with_those_of_a_truth_of_that_day(tmp_path):
    """A table of times of day beside positions with dates."""
    truth = "time,icao24,lat,lon,alt\n" + "".join(
        f"2024-05-01T10:00:{4 * k:02},a1,{52.6 + k / 1000},4.76,0\n" for k in range(10)
    )
    (tmp_path / "truth.csv").write_text(truth)
    seen = [float(np.linalg.norm(local(52.6 + t / 4000, 4.76, 0.0))) for t in (6, 10)]
    text = "Time,icao24,range [m],azimuth [deg]\n" + "".join(
        f"10:00:{t:02},a1,{r:.3f},0\n" for t, r in zip((6, 10), seen, strict=True)
    )
    _, columns, _ = imported(tmp_path, text.encode(), Options(site=SITE, truth=str(tmp_path / "truth.csv")))
    # To the millimetre, and to what the chord of 4 s, 111 m, lies below the arc.
    np.testing.assert_allclose(columns["true_r_m"], columns["range_m"], rtol=0, atol=0.0005 + 112**2 / 8 / EARTH_M)


def test_separators_after_the_last_cell_and_words_for_nothing(tmp_path):
    text = b"time;range [km];azimuth [deg];height [ft];\n0;20,5;N/A;;\n4;21,5;45;#N/A;\n8;22,5;46;NULL;;\n"
    _, columns, _ = imported(tmp_path, text)
    np.testing.assert_array_equal(columns["range_m"], [20500, 21500, 22500])
    assert_rounded(columns["bearing_rad"], np.radians([np.nan, 45, 46]))
    assert np.isnan(columns["altitude_m"]).all()


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading,VesselName", "244660000,{t},{lat},4.76,12.0,0.0,511.0,ANNA"),
        ("mmsi,base_date_time,longitude,latitude,sog,cog,heading", "244660000,{t},4.76,{lat},12.0,0.0,90"),
        # the Danish authority's
        ("# Timestamp,Type of mobile,MMSI,Latitude,Longitude,SOG,COG,Heading", "{dk},A,244660000,{lat},4.76,12.0,0,9"),
        ("Timestamp,MMSI,Latitude_degrees,Longitude_degrees,SOG_knots,COG_degrees", "{t},244660000,{lat},4.76,12,0"),
    ],
)  # fmt: skip
def test_ships_of_public_archives_need_no_option(tmp_path, header, row):
    rows = []
    for k in range(3):
        clock, lat = f"00:01:{10 * k:02}", 52.4 + k * 12 * KN * 10 / 111_260
        rows.append(row.format(t=f"2020-01-14T{clock}", dk=f"14/01/2020 {clock}", lat=lat))
    _, columns, tracks = imported(tmp_path, "\n".join([header, *rows, ""]).encode(), SOUTH)
    assert set(tracks) == {"244660000"}
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 20])
    dip = math.radians(0.1) ** 2 / 4  # the line dips by half of the angle between the places
    np.testing.assert_allclose(columns["velocity_mps"], 12 * KN, rtol=dip)
    # A degree has 111 275 m here, to the metre.
    np.testing.assert_allclose(np.diff(columns["range_m"]), 120 * KN * 111_275 / 111_260, rtol=1 / 111_260 + dip)


def test_a_bow_is_no_course(tmp_path):
    text = b"MMSI,BaseDateTime,LAT,LON,SOG,Heading\n244660000,2020-01-01T00:00:00,52.4,4.76,12,182\n"
    done, columns, _ = imported(tmp_path, text, SOUTH)
    assert np.isnan(columns["velocity_mps"]).all()
    assert "no speeds: Heading is where the bow points, not the course" in done.notes


def test_speeds_that_are_not_available_are_counted(tmp_path):
    text = b"MMSI,BaseDateTime,LAT,LON,SOG,COG\n"
    cells = ("12,0", "102.3,0", "12,360", "12,511", "-0.1,0", "12,-49.6")
    rows = [f"24,2020-01-01T00:00:0{k},52.4{k},4.76,{cell}\n".encode() for k, cell in enumerate(cells)]
    done, columns, _ = imported(tmp_path, text + b"".join(rows), SOUTH)
    assert np.isfinite(columns["velocity_mps"]).tolist() == [True] + 5 * [False]
    assert "reports without speed or course: 5 of 6" in done.notes


def test_a_barometric_altitude_stands_in_where_the_geometric_one_is_missing(tmp_path):
    text = (
        b"time,icao24,lat,lon,baroaltitude,geoaltitude\n1,a,52.4,4.7,3000,3100\n2,a,52.41,4.7,3000,\n3,a,52.42,4.7,,\n"
    )
    done, columns, _ = imported(tmp_path, text, Options(site=SITE))
    np.testing.assert_array_equal(columns["altitude_m"], [3100, 3000, np.nan])
    assert "barometric altitudes, where the geometric one is missing: 1" in done.notes
    assert "positions without altitude, placed at sea level: 1 of 3" in done.notes
