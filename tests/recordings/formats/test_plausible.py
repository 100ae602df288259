"""Recordings whose numbers no target has: wrong units, zeros of time, signs, swapped columns, single wild rows."""

import struct

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.sites import Site
from tests.recordings.formats.example_files import SITE, block, imported, refused, specified
from tests.recordings.formats.test_logs import gpx

AT = Options(site=SITE)
N = 40
FEET_M = 0.3048


def positions(rows, header="time,track,lat,lon"):
    return "\n".join([header, *rows, ""]).encode()


def path(k):
    """Degrees of a target that goes north at 222 m/s, seen every 5 s."""
    return 52.5 + 0.01 * k, 4.9


@pytest.mark.parametrize(
    ("header", "first", "step", "whose"),
    [
        ("Datum", 46_354.5, 2 / 86_400, "day numbers, as of a spreadsheet"),
        ("timestamp", 739_595.25, 4 / 86_400, "day numbers, as of Matlab"),
        ("t", 2_461_373.0, 4 / 86_400, "day numbers, as of Julian days"),
        ("date", 61_372.5, 4 / 86_400, "day numbers, as of modified Julian days"),
        ("Time", 0.25, 4 / 86_400, "fractions of a day"),
    ],
)
def test_day_numbers_are_never_seconds(tmp_path, header, first, step, whose):
    """A target at 120 m/s; the option that the refusal names reads them."""
    t = first + step * np.arange(N)
    text = f"{header},track,range_m\n" + "".join(
        f"{t[k]:.9f},7,{2e4 + 120 * 86_400 * step * k:.1f}\n" for k in range(N)
    )
    (line,) = refused(tmp_path, text.encode())
    assert f"{t[0]:.9f}' and the others are {whose}: --column t_days={header}" in line
    _, columns, _ = imported(tmp_path, text.encode(), Options(columns={"t_days": header}))
    digit = 86_400 * (1e-9 + np.spacing(first))
    np.testing.assert_allclose(columns["t_s"], 86_400 * step * np.arange(N), rtol=0, atol=digit)


def clock_digits(t):
    """12:00:06 as 120006, of seconds of the day."""
    return 10_000 * (t // 3600) + 100 * (t // 60 % 60) + t % 60


def test_a_time_of_day_as_a_number_is_never_seconds(tmp_path):
    t = 43_140 + 4 * np.arange(N)  # over noon
    text = "Time,track,range_m\n" + "".join(f"{clock_digits(t[k])},7,{20_000 + 900 * k}\n" for k in range(N))
    (line,) = refused(tmp_path, text.encode())
    assert line.endswith("'115900' and the others are times of day, HHMMSS: --column t_hhmmss=Time")
    done, columns, _ = imported(tmp_path, text.encode(), Options(columns={"t_hhmmss": "Time"}))
    np.testing.assert_array_equal(columns["t_s"], 4 * np.arange(N))
    assert done.notes == []


@pytest.mark.parametrize("step", [1, 2.5, 4, 10, 12, 20, 50, 60, 100])
@pytest.mark.parametrize("first", [0, 100, 36_000])
def test_seconds_are_not_taken_for_a_time_of_day(tmp_path, step, first):
    t = first + step * np.arange(80)
    text = "Time,track,range_m\n" + "".join(f"{t[k]},7,{20_000 + 9 * step * k}\n" for k in range(80))
    _, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], t - t[0])


def test_a_date_and_time_without_separators(tmp_path):
    text = "Time,range_m\n20261128235958.5,5\n20261129000002.75,6\n"
    _, columns, _ = imported(tmp_path, text.encode(), Options(zero=1_795_824_000.0))
    np.testing.assert_array_equal(columns["t_s"], [86_398.5, 86_402.75])


@pytest.mark.parametrize(("per_second", "unit", "name"), [(1e3, "ms", "ms"), (1e6, "µs", "us")])
def test_plots_that_no_radar_sees_so_seldom_may_have_a_smaller_unit(tmp_path, per_second, unit, name):
    """From zero on; in seconds they would be a minute's or a day's plots apart."""
    text = "Time,track,range_m\n" + "".join(f"{4 * per_second * k:.0f},7,{20_000 + 480 * k}\n" for k in range(N))
    done, *_ = imported(tmp_path, text.encode())
    expected = f"{4 * per_second:g} s from row to row; if they are {unit}: --column t_{name}=Time"
    assert any(note.replace("·10⁶", "e+06").endswith(expected) for note in done.notes)


def test_a_date_in_days_stands_beside_a_time_of_day(tmp_path):
    text = "Date,Time,range_m\n46354,10:00:00,5\n46354,10:00:04,6\n"  # 28 November 2026
    _, columns, _ = imported(tmp_path, text.encode(), Options(zero=1_795_824_000.0))
    np.testing.assert_array_equal(columns["t_s"], [36_000, 36_004])


def test_fast_seconds_of_a_day_stay_seconds(tmp_path):
    """Plots a millisecond apart, at half past twelve."""
    text = "t_s,track,range_m\n" + "".join(f"{45_000 + k / 1000:.3f},7,{2e4 + 0.2 * k:.2f}\n" for k in range(N))
    done, columns, _ = imported(tmp_path, text.encode())
    assert columns["t_s"][-1] == pytest.approx((N - 1) / 1000, rel=0, abs=np.spacing(45_000.0))
    assert done.notes == []


@pytest.mark.parametrize("first", [156_862_647_501, 5_000_000_000, 12_345_678_901_234])
def test_large_times_that_give_no_year_are_asked_for_their_unit(tmp_path, first):
    """µs and ns of a clock that has begun some time."""
    text = "time,track,range_m\n" + "".join(f"{first + 70_000 * k},7,{2e4 + k}\n" for k in range(N))
    (line,) = refused(tmp_path, text.encode())
    assert "t_us=time or t_ns=time" in line
    _, columns, _ = imported(tmp_path, text.encode(), Options(columns={"t_us": "time"}))
    assert columns["t_s"][1] == pytest.approx(0.07, rel=0, abs=np.spacing(float(first)) * 1e-6 + 1e-8)


def test_units_that_make_targets_too_fast_are_told(tmp_path):
    """Hours taken as seconds."""
    text = "time,track,range_m\n" + "".join(f"{5 * k / 3600:.6f},7,{2e4 + 1000 * k}\n" for k in range(N))
    (line,) = refused(tmp_path, text.encode())
    assert "the targets move at 7.2·10⁵ m/s (median), which none does" in line
    assert "200 m/s if they are in hours" in line


@pytest.mark.parametrize(
    ("row", "cause"),
    [
        (lambda k: (f"{600 + k / 15:.6f}", 20_000 + 480 * k), "120 m/s if they are in minutes"),
        (lambda k: (f"{(20_000 + 480 * k) / 1000}", 4000 * k + 8000), "or columns are swapped"),
    ],
)
def test_targets_that_are_too_near_for_their_speed_are_told(tmp_path, row, cause):
    """Minutes taken as seconds; times and ranges swapped."""
    text = "time,track,range_m\n" + "".join("{},7,{}\n".format(*row(k)) for k in range(N))
    done, *_ = imported(tmp_path, text.encode())
    (note,) = done.notes
    assert "as none so near does" in note
    assert cause in note


@pytest.mark.parametrize(
    ("row", "site", "cause"),
    [
        (lambda lat, lon: (lon, lat), SITE, "latitude and longitude are swapped"),
        (lambda lat, lon: (-lat, lon), SITE, "the latitude has the other sign"),
        (lambda lat, lon: (lat, lon - 80), Site(52.3, 75.2, 0.0), "the longitude has the other sign"),
    ],
)
def test_positions_that_no_radar_sees_are_refused_with_the_cause(tmp_path, row, site, cause):
    rows = [f"{5 * k},a,{lat:.5f},{lon:.5f}" for k in range(N) for lat, lon in [row(*path(k))]]
    (line,) = refused(tmp_path, positions(rows), Options(site=site))
    assert "none within 1000 km" in line
    assert cause in line


def test_single_impossible_positions_are_left_out_and_counted(tmp_path):
    """No fix, swapped columns, and one plot 60 km too far."""
    rows = [f"{5 * k},a,{path(k)[0]:.5f},{path(k)[1]:.5f}" for k in range(N)]
    rows[7], rows[20] = "35,a,0.0,0.0", f"100,a,{path(20)[1]:.5f},{path(20)[0]:.5f}"
    done, columns, _ = imported(tmp_path, positions(rows), AT)
    assert columns["range_m"].max() < 1e5
    assert done.skipped == [
        "positions at 0°, 0°, which stand for no fix (1)",
        "rows that no target reaches from neighbouring rows (1)",
    ]
    (tmp_path / "plots.csv").unlink()
    fix = '<trkpt lat="{}" lon="{}"><time>2026-07-24T13:45:{:02}Z</time></trkpt>'
    points = "".join(fix.format(*((0, 0) if k == 3 else (52.6 + k / 10_000, 4.76)), k) for k in range(9))
    done, columns, _ = imported(tmp_path, gpx([points]), AT)
    assert len(columns["t_s"]) == 8
    (tmp_path / "plots.csv").unlink()
    ranges = [2e4 + 800 * k + 60_000 * (k in (0, 25)) for k in range(N)]
    text = "time,track,range_m\n" + "".join(f"{4 * k},7,{r}\n" for k, r in enumerate(ranges))
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], 4.0 * np.array([k for k in range(1, N) if k != 25]) - 4)
    assert done.skipped == ["rows that no target reaches from neighbouring rows (2)"]
    (tmp_path / "plots.csv").unlink()
    text = "time,quality,range_m\n" + "".join(f"{4 * k},{k % 3},{r}\n" for k, r in enumerate(ranges))
    assert imported(tmp_path, text.encode())[0].skipped == done.skipped  # no column names the track


def test_fast_and_rough_recordings_lose_nothing(tmp_path):
    """A satellite; plots of 60 m every 5 ms; two targets far apart in turn."""
    rng = np.random.default_rng(3)
    cases = {
        "satellite": [(2 * k, 4e5 + abs(k - 20) * 14_000) for k in range(N)],
        "fast": [(0.005 * k, 2e4 + rng.normal(0, 60)) for k in range(200)],
    }
    for rows in cases.values():
        text = "time,track,range_m\n" + "".join(f"{t},7,{r:.1f}\n" for t, r in rows)
        done, columns, _ = imported(tmp_path, text.encode())
        assert len(columns["t_s"]) == len(rows)
        assert done.notes + done.skipped == []
        (tmp_path / "plots.csv").unlink()
    text = "time,track,range_m\n" + "".join(f"{k},{k % 2},{2e4 + 1e5 * (k % 2) + 90 * k}\n" for k in range(N))
    assert imported(tmp_path, text.encode())[0].skipped == []


def test_bearings_may_be_missing_anywhere(tmp_path):
    """In the second batch of rows only, and in the first."""
    for empty in (20_003, 5):
        rows = (f"{4 * k},7,{20_000 + k},{'' if k == empty else 45}\n" for k in range(20_010))
        done, columns, _ = imported(tmp_path, ("time,track,range_m,azimuth_deg\n" + "".join(rows)).encode())
        assert np.flatnonzero(np.isnan(columns["bearing_rad"])).tolist() == [empty]
        assert done.skipped == []
        (tmp_path / "plots.csv").unlink()


def test_azimuths_just_beyond_a_turn_are_turned_back_and_counts_are_told(tmp_path):
    text = "time,track,range_m,azimuth [deg]\n0,7,5000,359.9\n4,7,5000,360.15\n8,7,5000,0.2\n"
    _, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_allclose(columns["bearing_rad"], np.radians([359.9, 0.15, 0.2]), rtol=0, atol=4 * np.spacing(7.0))
    (tmp_path / "plots.csv").unlink()
    text = "time,track,range_m,Azimuth\n" + "".join(f"{4 * k},7,5000,{1024 + k}\n" for k in range(5))
    (line,) = refused(tmp_path, text.encode(), Options(columns={"bearing_deg": "Azimuth"}))
    assert "got '1024'" in line
    assert "--column bearing_acp=Azimuth" in line
    _, columns, _ = imported(tmp_path, text.encode(), Options(columns={"bearing_acp": "Azimuth"}))
    np.testing.assert_allclose(columns["bearing_rad"], np.pi / 2 + 2 * np.pi / 4096 * np.arange(5), rtol=4e-16)


@pytest.mark.parametrize(
    ("largest", "unit", "turn"), [(9000, "acp16384", 16_384), (40_000, "acp65536", 65_536), (7000, "acp8192", 8192)]
)
def test_counts_of_finer_encoders_are_told_by_their_size(tmp_path, largest, unit, turn):
    counts = largest - np.arange(5)
    text = "time,track,range_m,Azimuth\n" + "".join(f"{4 * k},7,5000,{counts[k]}\n" for k in range(5))
    for given in ("bearing_deg", "bearing_acp"):
        (line,) = refused(tmp_path, text.encode(), Options(columns={given: "Azimuth"}))
        assert f"if it counts {turn} a turn: --column bearing_{unit}=Azimuth" in line
    _, columns, _ = imported(tmp_path, text.encode(), Options(columns={f"bearing_{unit}": "Azimuth"}))
    np.testing.assert_allclose(columns["bearing_rad"], 2 * np.pi * counts / turn, rtol=4e-16)


@pytest.mark.parametrize(("unit", "number"), [("gon", 100.0), ("mil", 1600.0), ("deg", 90.0)])
def test_angles_of_surveyors_and_gunners(tmp_path, unit, number):
    _, columns, _ = imported(tmp_path, f"time,track,range_m,bearing_{unit}\n0,7,5,{number}\n".encode())
    assert columns["bearing_rad"][0] == pytest.approx(np.pi / 2, rel=4e-16)


@pytest.mark.parametrize("unknown", ["91,181", "-999,-999", "999,999", "9999,0"])
def test_positions_that_stand_for_none_are_counted(tmp_path, unknown):
    rows = [f"{5 * k},7," + (unknown if k % 9 == 4 else "{},{}".format(*path(k))) for k in range(N)]
    done, columns, _ = imported(tmp_path, positions(rows), AT)
    assert done.skipped == ["records without time or position (4)"]
    assert columns["range_m"].max() < 1e5


def test_positions_in_radians_and_elsewhere_are_refused(tmp_path):
    for change, cause in ((np.radians, "if they are in radians"), (lambda place: (place[0] - 40, 4.9), "as far as a")):
        rows = [f"{5 * k},7,{lat},{lon}" for k in range(N) for lat, lon in [change(path(k))]]
        (line,) = refused(tmp_path, positions(rows), AT)
        assert line.startswith("at: the positions lie ")
        assert cause in line


@pytest.mark.parametrize(("km", "level"), [(120, True), (85, True), (20, False)])
def test_mode_c_in_hundreds_of_feet_is_known_by_the_horizon(tmp_path, km, level):
    """290 ft are below it at 120 km and at 85 km, and may be flown at 20 km."""
    text = "Time,Range [km],Mode C,track\n" + "".join(f"{4 * k},{km + k},290,a\n" for k in range(5))
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_allclose(columns["altitude_m"], 290 * FEET_M * (100 if level else 1), rtol=1e-15)
    assert any("Mode C is read in hundreds of feet" in note for note in done.notes) == level


def plot_001(time, rho, track=5):
    """A track of category 001 with the last 512 s of its time."""
    place, truncated = struct.pack(">HH", rho, 8192), struct.pack(">H", round(time * 128) % 65_536)
    return block(1, specified({1: b"\x19\x0a", 2: b"\x80", 3: struct.pack(">H", track), 4: place, 9: truncated}))


def test_category_001_alone_has_no_time_of_day(tmp_path):
    """Over a turn of 512 s, and over midnight."""
    times = 86_000.0 + 4 * np.arange(200)
    data = b"".join(plot_001(t % 86_400, 5000 + k) for k, t in enumerate(times))
    done, columns, _ = imported(tmp_path, data)
    np.testing.assert_array_equal(columns["t_s"], times - times[0])
    assert any("category 001 states times within 512 s only" in note for note in done.notes)
    assert "s after the start of its clock" in (tmp_path / "plots.csv").read_text()
    (tmp_path / "plots.csv").unlink()
    (line,) = refused(tmp_path, data, Options(zero="midnight"))
    assert line.startswith("time-from: recording: category 001 states times within 512 s only")
