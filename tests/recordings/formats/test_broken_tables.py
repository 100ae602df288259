"""Tables as people and programs spoil them: what is read, and what the answer says."""

import gzip

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from tests.recordings.formats.example_files import SITE, imported, refused

N = 60
T = 4.0 * np.arange(N)
R = 30_000 + np.round(95 * T + np.random.default_rng(0).normal(0, 30, N), 1)
LINES = [f"{t:.0f},{r:.1f}" for t, r in zip(T, R, strict=True)]


def table(*lines, header="time,range_m", end="\n"):
    return end.join([header, *lines, ""]).encode()


def with_lines(lines, *places):
    """The table's lines with others before those numbers."""
    return [line for k, row in enumerate(LINES) for line in (*(lines if k in places else ()), row)]


READ = {
    "comments of other marks": table(*with_lines(["% a pause", "; later", "! on", "# one, two"], 10, 20)),
    "two marks of a file's beginning": b"\xef\xbb\xbf" * 2 + table(*LINES),
    "compressed twice": gzip.compress(gzip.compress(table(*LINES))),
    "UTF-32": table(*LINES).decode().encode("utf-32"),
    "line breaks in the header": table(*LINES, header='"time\n[s]","range\n[m]"'),
    "single quotation marks": table(
        *(line.replace(",", "','").join("''") for line in LINES), header="'time','range_m'"
    ),
    "sums below": table(*LINES, "Total,2470000.0", "Mean,41000.0"),
    "points of thousands": table(
        *(f"{t:.0f};{r / 1000:.3f};1,25" for t, r in zip(T, R, strict=True)), header="t;Entfernung [m];Vr [m/s]"
    ),
}


@pytest.mark.parametrize("name", READ)
def test_what_is_plain_is_read(tmp_path, name):
    _, columns, _ = imported(tmp_path, READ[name])
    np.testing.assert_allclose(columns["range_m"], R, rtol=0, atol=0.5)
    np.testing.assert_array_equal(columns["t_s"], T)


REFUSED = {
    "an open quotation mark": (
        table(*(f"{line},{chr(34) if k == 20 else ''}ok" for k, line in enumerate(LINES)), header="time,range_m,note"),
        "recording:22: must have pairs of quotation marks; one is open to the end of the file",
    ),
    "a header of two lines": (
        table("s,Range,Azimuth", "0,30000,45", header="Time,Target,"),
        "if the line below belongs to the header (s, Range, Azimuth), make one line of both",
    ),
    "another table below": (
        table(*LINES, "time,range_m,velocity_mps", "240,52000.0,95.0"),
        "must be a row of the table, not the header of another",
    ),
    "cut within a letter": (table(*LINES, "240,52000.0,ж", header="time,range_m")[:-2], "it ends within a letter"),
    "years of two digits": (table("20.11.26 10:00:00,30000.0"), "years have four digits"),
    "words between": (table(*with_lines(["pause,1"], 30)), "must be a time in s"),
    "digits lost by a spreadsheet": (
        table(*(f"{1.7e9 + t:.2E},{r:.1f}" for t, r in zip(T, R, strict=True))),
        "times have lost digits, as 1.70E+09 shows: export the column as numbers",
    ),
    "times of single precision": (
        table(*(f"{np.float32(1.7e9 + t):.1f},{r:.1f}" for t, r in zip(T, R, strict=True))),
        "times are multiples of 64 s, as numbers of single precision are",
    ),
    "numbers of scans": (table(*LINES, header="scan,range_m"), "a number of scans times the scan period is the time"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_is_refused_with_its_cause(tmp_path, name):
    data, expected = REFUSED[name]
    assert any(expected in line for line in refused(tmp_path, data))


BEARINGS = {
    "t,range_m,relative_bearing_deg": "relative_bearing_deg counts from the bow: add the heading to it",
    "t,range_m,bearing_deg,heading": "bearing_deg is taken from north, and heading is not used",
    "t,range_m,bearing_mag_deg": "columns that may be read too: --column bearing_deg=bearing_mag_deg",
}


@pytest.mark.parametrize("header", BEARINGS)
def test_bearings_that_may_not_count_from_north_are_named(tmp_path, header):
    rows = (f"{line},45" + ",90" * header.endswith("heading") for line in LINES)
    done, _, _ = imported(tmp_path, table(*rows, header=header))
    assert any(note.startswith(BEARINGS[header]) for note in done.notes)


def test_magnetic_bearings_are_named(tmp_path):
    rows = (f"{line},45" for line in LINES)
    done, _, _ = imported(
        tmp_path, table(*rows, header="t,range_m,bearing_mag"), Options(columns={"bearing_deg": "bearing_mag"})
    )
    assert "bearing_mag is magnetic: --bias bearing_deg=-D adds a declination of D° east" in done.notes


@pytest.mark.parametrize(
    ("factor", "expected"),
    [(3.6, "a factor of 3.6"), (-1, "have the opposite sign"), (0.3048, "the ranges are in feet"), (1, "")],
)
def test_velocities_of_one_track_alone_in_another_unit_are_named(tmp_path, factor, expected):
    """The option that cures it would spoil the other."""
    rng = np.random.default_rng(1)
    rows = []
    for t, r in zip(T, R, strict=True):
        other = 50_000 - 100 * t + rng.normal(0, 30)
        rows += [f"{t},1,{r},{95 + rng.normal():.2f}", f"{t},2,{other:.1f},{factor * (-100 + rng.normal()):.2f}"]
    done, _, _ = imported(tmp_path, table(*rows, header="t,track,range_m,velocity_mps"))
    if not expected:
        assert done.notes == []
    else:
        (note,) = done.notes
        assert note.startswith("in track 2 alone: ")
        assert expected in note


def test_coordinates_that_one_sensor_swaps_are_named(tmp_path):
    rows = (
        f"{t},{name},{','.join(f'{x:.5f}' for x in ((lat, lon) if name == 'a' else (lon, lat)))}"
        for k, t in enumerate(T)
        for name, lat, lon in (("a", 52.5 + k / 1000, 4.9), ("b", 52.4 + k / 1000, 4.7))
    )
    done, _, _ = imported(tmp_path, table(*rows, header="time,id,lat,lon"), Options(site=SITE))
    assert any(
        note.startswith("60 of 120 positions, of b, lie ") and "if latitude and longitude are swapped" in note
        for note in done.notes
    )


@pytest.mark.parametrize("names", [("7", "7.0"), ("a1", "A1"), ("07", "7")])
def test_names_that_differ_in_their_writing_alone_are_named(tmp_path, names):
    rows = (f"{line},{names[k >= 30]}" for k, line in enumerate(LINES))
    done, _, tracks = imported(tmp_path, table(*rows, header="time,range_m,track"))
    assert done.notes == [f"tracks whose names differ in their writing alone are taken as several: {', '.join(names)}"]
    assert set(tracks) == set(names)


def test_numbers_that_may_have_points_of_thousands_or_lost_digits_are_named(tmp_path):
    done, _, _ = imported(tmp_path, table(*(f"{t};30.{k:03}" for k, t in enumerate(T)), header="t;range_m"))
    assert done.notes == ["points are decimal: 30.000 is read as 30; if they separate thousands, take them out"]
    (tmp_path / "plots.csv").unlink()
    done, _, _ = imported(tmp_path, table(*(f"{t},{r:.2E}" for t, r in zip(T, R, strict=True))))
    assert done.notes == ["range_m has lost digits, as 3.00E+04 shows: export the column as numbers"]
