"""Coordinates whose sign, unit or minutes are lost: named by --at, by distance and by courses."""

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.sites import Site
from radarsim.recordings.time_spans import TimeSpan, meeting_text
from tests.recordings.formats.example_files import imported, refused

N = 40
K = np.arange(N)
LAT, LON = 0.004 * K, 0.006 * K
HEADER = "time,icao24,{},geoaltitude_m"


def table(lat, lon, names="lat,lon", form="{:.6f},{:.6f}", more=("", lambda k: "")):
    rows = (f"{4 * k},4ca1fa,{form.format(lat[k], lon[k])},9000{more[1](k)}" for k in K)
    return "\n".join([HEADER.format(names) + more[0], *rows]).encode()


def courses(lat, east=1.0, north=1.0):
    """Columns of speed and course of the way of these positions, turned by axis."""
    way = np.array([0.004 * 111_195, 0.006 * 111_195 * np.cos(np.radians(lat))]) / 4
    course = np.degrees(np.arctan2(east * way[1], north * way[0]))
    return ",velocity_mps,heading", lambda k: f",{np.hypot(*way):.2f},{course:.2f}"


@pytest.mark.parametrize("lost", ["longitude", "latitude"])
def test_a_lost_sign_is_named_by_the_horizon(tmp_path, lost):
    """At less than 1000 km, which an aircraft at 9 km has its horizon within."""
    lat, lon = (52.6 + LAT, -4.9 + LON) if lost == "longitude" else (-3.2 + LAT, 40.1 + LON)
    at = Options(site=Site(52.3, -4.76, 12) if lost == "longitude" else Site(-3.1, 40, 12))
    imported(tmp_path, table(lat, lon), at)
    (tmp_path / "plots.csv").unlink()
    (line,) = refused(tmp_path, table(np.abs(lat), np.abs(lon)), at)
    assert "below its horizon" in line
    assert line.endswith(f"km if the {lost} has the other sign, in the recording or in --at")


@pytest.mark.parametrize(
    ("east", "north", "cause"), [(1, 1, ""), (-1, 1, "longitudes"), (1, -1, "latitudes"), (-1, -1, "both")]
)
def test_a_lost_sign_is_named_by_the_courses(tmp_path, east, north, cause):
    """Too near to the zero of the coordinate for its distance to tell."""
    data = table(0.6 + LAT, 0.9 + LON, more=courses(0.6, east, north))
    done, _, _ = imported(tmp_path, data, Options(site=Site(0.6, 0.9, 12)))
    expected = ["positions move against their courses: "] * bool(cause)
    assert [note[: len(expected[0])] for note in done.notes] == expected if cause else done.notes == []
    assert all(cause in note for note in done.notes)


@pytest.mark.parametrize("names", ["lat,lat_dir,lon,lon_dir", "lat,N/S,lon,E/W", "lat,ns,lon,ew"])
def test_hemispheres_in_columns_of_their_own(tmp_path, names):
    lat, lon, at = -33.5 - LAT, -70.6 - LON, Options(site=Site(-33.4, -70.5, 500))
    _, expected, _ = imported(tmp_path, table(lat, lon), at)
    (tmp_path / "plots.csv").unlink()
    _, columns, _ = imported(tmp_path, table(-lat, -lon, names, "{:.6f},S,{:.6f},W"), at)
    np.testing.assert_array_equal(columns["range_m"], expected["range_m"])


@pytest.mark.parametrize(("names", "form"), [("lat,lon", "{:.6f} S,{:.6f} O"), ("lat,ns,lon,ew", "{:.6f},S,{:.6f},O")])
def test_an_o_may_be_ost_or_ouest(tmp_path, names, form):
    lat, at = -33.5 - LAT, {sign: Site(-33.4, sign * 70.5, 500) for sign in (1, -1)}
    data = table(-lat, 70.6 + LON, names, form)
    (line,) = refused(tmp_path, data, Options(site=at[1]))
    assert line.endswith("got 'O': for Ost --column longitude_ost=lon, for ouest or oeste --column longitude_ouest=lon")
    for sign, unit in ((1, "ost"), (-1, "ouest")):
        _, expected, _ = imported(tmp_path, table(lat, sign * (70.6 + LON)), Options(site=at[sign]))
        (tmp_path / "plots.csv").unlink()
        _, columns, _ = imported(tmp_path, data, Options(site=at[sign], columns={f"longitude_{unit}": "lon"}))
        (tmp_path / "plots.csv").unlink()
        np.testing.assert_array_equal(columns["range_m"], expected["range_m"])
        other = form.replace("O", "W" if sign == 1 else "E").format(33.5, 70.6)
        first, *rows = data.decode().splitlines()
        beside = "\n".join([first, f"-4,4ca1fb,{other},9000", *rows]).encode()
        _, columns, _ = imported(tmp_path, beside, Options(site=at[sign], tracks=("4ca1fa",)))
        (tmp_path / "plots.csv").unlink()
        np.testing.assert_array_equal(columns["range_m"], expected["range_m"])


@pytest.mark.parametrize(("south", "west"), [("sur", "Oeste"), ("Sud", "ouest"), ("ю.ш.", "з.д."), ("南", "西")])
def test_hemispheres_in_other_languages(tmp_path, south, west):
    lat, lon, at = -33.5 - LAT, -70.6 - LON, Options(site=Site(-33.4, -70.5, 500))
    _, expected, _ = imported(tmp_path, table(lat, lon), at)
    (tmp_path / "plots.csv").unlink()
    data = table(-lat, -lon, "lat,ns,lon,ew", f"{{:.6f}},{south},{{:.6f}},{west}")
    _, columns, _ = imported(tmp_path, data, at)
    np.testing.assert_array_equal(columns["range_m"], expected["range_m"])


@pytest.mark.parametrize(
    ("form", "cure"),
    [("ddmm", "--column latitude_ddmm=lat"), ("e7", "--column latitude_e7=lat"), ("e6", "--column latitude_e6=lat")],
)
def test_units_of_coordinates(tmp_path, form, cure):
    lat, lon, at = 52.6 + LAT, -4.9 + LON, Options(site=Site(52.3, -4.76, 12))
    _, expected, _ = imported(tmp_path, table(lat, lon), at)
    (tmp_path / "plots.csv").unlink()
    size = {"ddmm": lambda x: np.sign(x) * (np.abs(x) // 1 * 100 + np.abs(x) % 1 * 60)}.get(
        form, lambda x: x * float(f"1{form}")
    )
    data = table(size(lat), size(lon), form="{:.8f},{:.8f}")
    assert cure in refused(tmp_path, data, at)[0]
    columns_of = {f"latitude_{form}": "lat", f"longitude_{form}": "lon"}
    _, columns, _ = imported(tmp_path, data, Options(site=at.site, columns=columns_of))
    np.testing.assert_allclose(columns["range_m"], expected["range_m"], rtol=0, atol=0.2)


def test_minutes_in_columns_of_their_own_are_refused(tmp_path):
    (line,) = refused(tmp_path, table(52.0 + LAT, 4.0 + LON, "lat_deg,lat_min,lon_deg,lon_min", "52,{:.4f},4,{:.4f}"))
    assert line.endswith(
        "lat_min, lon_min: must be in the cells of the degrees, as 52°18.5', not in columns of their own"
    )


@pytest.mark.parametrize(
    ("offset_s", "zero"), [(2_082_844_800, "1904, as of LabVIEW"), (-315_964_782, "1980, as of GPS")]
)
def test_clocks_that_count_from_another_zero_meet(offset_s, zero):
    plots, positions = (TimeSpan(1.79e9 + t, 1.79e9 + t + 600) for t in (0, offset_s + 60))
    assert meeting_text(plots, positions).endswith(f"they meet if the times of the positions count from {zero}")
    assert meeting_text(positions, plots).endswith(f"they meet if the times of the plots count from {zero}")
