"""Cells and lines of a table as spreadsheets, data bases and logs export them."""

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from tests.recordings.formats.example_files import SITE, imported, refused

N = 24
T = 4.0 * np.arange(N)
R, V, B = 30_000 + 95 * T, np.full(N, 95.0), 45 + 0.1 * np.arange(N)
NAMES = ("time", "track", "range_m", "bearing_deg", "velocity_mps")
AT = Options(site=SITE)


def rows(time="{:g}", r="{:.1f}", b="{:.2f}", v="{:.2f}", scale=(1.0, 1.0)):
    """The cells of the rows of a table, in these forms."""
    return [
        [time.format(a), "7", r.format(b_ * scale[0]), b.format(c), v.format(d * scale[1])]
        for a, b_, c, d in zip(T, R, B, V, strict=True)
    ]


def text(lines, separator=","):
    return "\n".join(line if isinstance(line, str) else separator.join(line) for line in lines).encode()


def check(tmp_path, data, skipped=(), notes=None):
    done, columns, _ = imported(tmp_path, data)
    np.testing.assert_allclose(columns["t_s"], T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(columns["range_m"], R, rtol=0, atol=1)
    np.testing.assert_allclose(columns["bearing_rad"], np.radians(B), rtol=0, atol=1e-6)
    np.testing.assert_allclose(columns["velocity_mps"], V, rtol=0, atol=0.01)
    assert done.skipped == list(skipped)
    assert notes is None or done.notes == notes


MISSING = [
    "--",
    "***",
    "?",
    "n.a.",
    "ND",
    "нет",
    "kein Wert",
    "1.#QNAN",
    "#DIV/0!",
    "#ЗНАЧ!",
    "\\N",
    "<NA>",
    ".",
    "ERR",
]


@pytest.mark.parametrize("cell", MISSING)
def test_cells_that_stand_for_no_value(tmp_path, cell):
    table = rows()
    for row in (3, 9, 20):
        table[row][4] = cell
    done, columns, _ = imported(tmp_path, text([NAMES, *table]))
    assert np.flatnonzero(np.isnan(columns["velocity_mps"])).tolist() == [3, 9, 20]
    assert done.notes == done.skipped == []


@pytest.mark.parametrize(
    ("names", "forms"),
    [
        (NAMES, {"r": "{:.0f} m", "b": "{:.2f}°", "v": "{:.2f} m/s"}),
        (("time", "track", "range", "bearing", "velocity"), {"r": "{:.3f} km", "b": "{:.2f} deg", "v": "{:.2f} м/с"}),
        (NAMES, {"r": "'{:.1f}", "v": "{:.2f}"}),
        (NAMES, {"time": "{:g} s"}),
    ],
)
def test_units_and_marks_in_the_cells(tmp_path, names, forms):
    scale = (1e-3 if "km" in forms.get("r", "") else 1.0, 1.0)
    check(tmp_path, text([names, *rows(**forms, scale=scale)]), notes=[])


def test_a_minus_that_is_typeset(tmp_path):
    table = [[*row[:4], f"−{row[4]}"] for row in rows()]
    _, columns, _ = imported(tmp_path, text([NAMES, *table]))
    np.testing.assert_array_equal(columns["velocity_mps"], -V)


@pytest.mark.parametrize("unit_row", [["s", "", "km", "deg", "kn"], ["[s]", "[-]", "[km]", "[deg]", "[kn]"]])
def test_a_line_of_units_below_the_header(tmp_path, unit_row):
    names = ("time", "track", "range", "bearing", "velocity")
    check(tmp_path, text([names, unit_row, *rows(r="{:.4f}", v="{:.4f}", scale=(1e-3, 3600 / 1852))]), notes=[])


def test_units_below_names_of_other_units_are_asked_for(tmp_path):
    table = text([NAMES, ["s", "", "km", "deg", "m/s"], *rows(r="{:.4f}", scale=(1e-3, 1.0))])
    (line,) = refused(tmp_path, table)
    assert line.endswith("perhaps --column range_km='range_m [km]'")
    _, columns, _ = imported(tmp_path, table, Options(columns={"range_km": "range_m [km]"}))
    np.testing.assert_allclose(columns["range_m"], R, rtol=0, atol=1)


HEADER = ",".join(NAMES)
END = "lines at the end that are no rows, or cut off (1)"


@pytest.mark.parametrize(
    ("edit", "skipped"),
    [
        (lambda x: [HEADER, *x[:9], HEADER, *x[9:15], "", HEADER, *x[15:]], ["headers repeated within the table (2)"]),
        (lambda x: [HEADER, *x[:9], "# restart", *x[9:]], ["lines of comment (1)"]),
        (lambda x: [HEADER, *x, "", "(24 rows affected)"], [END]),
        (lambda x: [HEADER, *x, "END"], [END]),
        (lambda x: [HEADER, *x, "96,7,39"], [END]),
        (lambda x: ["Log of 28.11.2026", "Station: North; by A, B", "", HEADER, *x], []),
        (lambda x: ["sep=,", HEADER, *x], []),
        (lambda x: [line.replace(",", "\t") for line in ["sep=\t", HEADER, *x]], []),
        (lambda x: [line.replace(",", "  ") for line in [HEADER, *x]], []),
        (lambda x: ["# " + HEADER.replace(",", " "), *(line.replace(",", " ") for line in x)], []),
        (lambda x: [line.replace(",", " | ") for line in [HEADER, "---,---,---,---,---", *x]], []),
        (lambda x: [f"| {line.replace(',', ' | ')} |" for line in [HEADER, ":-:,---,---,---,---", *x]], []),
        (lambda x: [line.replace(",", " | ") for line in [HEADER, "-+-", *x]] + ["(24 rows)"], [END]),
    ],
)
def test_lines_that_are_no_rows(tmp_path, edit, skipped):
    lines = [",".join(row) for row in rows()]
    check(tmp_path, text(edit(lines)), skipped, notes=[])


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (lambda x: [HEADER, *x[:9], HEADER.replace("range_m", "range_km"), *x[9:]], ":11: must be a row of the table"),
        (lambda x: [HEADER, *x[:9], "restart", *x[9:]], ":11: must have 5 cells as the header, got 1"),
        (lambda x: x, ":1: must name the columns; the first line has numbers alone"),
        (lambda x: [HEADER, *x[:2], "8,7,12. Mai,45,95", *x[3:]], "a spreadsheet has made a date of a number"),
        (lambda x: [HEADER, *x, "\0" * 40], "it has bytes of zero"),
    ],
)
def test_lines_that_must_be_mended(tmp_path, lines, expected):
    (line,) = refused(tmp_path, text(lines([",".join(row) for row in rows()])))
    assert expected in line


@pytest.mark.parametrize(
    ("start", "expected"),
    [(b"PK\x03\x04\0\0", "workbook"), (b"\xd0\xcf\x11\xe0\xa1", "workbook"), (b"SQLite format 3\0\x10", "data base"),
     (b"\x89HDF\r\n\x1a\n", "HDF5"), (b"%PDF-1.4\n%\xe2", "document"), (b"BZh91AY", "bzip2"), (b"<kml>", "markup")],
)  # fmt: skip
def test_files_of_other_programs_are_named(tmp_path, start, expected):
    (line,) = refused(tmp_path, start + b"\0\1\2" * 40 if start != b"<kml>" else start)
    assert expected in line


@pytest.mark.parametrize(
    "form", ["{}{:.5f}", "{} {:.5f}", "{1:.5f}{0}", "{1:.5f} {0}", "{1:.5f}° {0}", "dms", "dm", "blanks"]
)
def test_coordinates_with_their_hemispheres(tmp_path, form):
    """South and east, in degrees, with minutes and seconds."""

    def cell(angle, side):
        minutes = angle % 1 * 60
        if form == "dms":
            return f"{int(angle)}°{int(minutes):02}'{minutes % 1 * 60:06.3f}″{side}"
        if form in ("dm", "blanks"):
            return f"{int(angle)}{'° ' if form == 'dm' else ' '}{minutes:08.5f}{chr(39) * (form == 'dm')} {side}"
        return form.format(side, angle)

    rows_ = [f"{4 * k};4ca1fa;{cell(33.5 + 0.01 * k, 'S')};{cell(151.1 + 0.01 * k, 'E')};9000" for k in range(N)]
    header = "time;icao24;lat;lon;geoaltitude_m"
    plain = [f"{4 * k};4ca1fa;{-33.5 - 0.01 * k:.5f};{151.1 + 0.01 * k:.5f};9000" for k in range(N)]
    at = Options(site=type(SITE)(-33.6, 151.0, 10.0))
    _, columns, _ = imported(tmp_path, text([header, *rows_]), at)
    (tmp_path / "plots.csv").unlink()
    _, expected, _ = imported(tmp_path, text([header, *plain]), at)
    np.testing.assert_allclose(columns["range_m"], expected["range_m"], rtol=0, atol=1)


@pytest.mark.parametrize("cell", ["(null)", "inf", "<none>", "b.d.", "sin dato"])
def test_cells_of_other_programs_that_stand_for_no_value(tmp_path, cell):
    table = rows()
    table[3][4] = table[9][4] = cell
    _, columns, _ = imported(tmp_path, text([NAMES, *table]))
    assert np.flatnonzero(np.isnan(columns["velocity_mps"])).tolist() == [3, 9]


def test_a_word_among_numbers_may_stand_for_none(tmp_path):
    table = rows()
    table[3][4] = table[9][4] = "weg"
    (line,) = refused(tmp_path, text([NAMES, *table]))
    assert line.endswith("(and 1 more, in line 11); if it stands for no value, leave such cells empty")


def test_a_bearing_that_stands_for_none_is_an_empty_cell(tmp_path):
    table = rows()
    table[3][3] = table[9][3] = "-999"
    _, columns, _ = imported(tmp_path, text([NAMES, *table]))
    assert np.flatnonzero(np.isnan(columns["bearing_rad"])).tolist() == [3, 9]


def test_files_one_after_the_other_with_their_marks(tmp_path):
    first, second = text([NAMES, *rows()[:12]]), text([NAMES, *rows()[12:]])
    data = b"\xef\xbb\xbf" + first + b"\n\xef\xbb\xbf" + second
    check(tmp_path, data, ["headers repeated within the table (1)"])


@pytest.mark.parametrize(
    ("names", "cure"),
    [
        ("time,track,range_gate,azimuth_deg", "range gates times their length is the range"),
        ("time,track,Ground range (km),azimuth_deg", "the squares of ground range and height is the slant range"),
        ("time,track,delay_us,azimuth_deg", "half the delay times the speed of light is the range"),
        ("time,track,x_km,y_km", "the root of x² + y² is the range"),
        ("hour,minute,second,range_m", "are a time in one column, HH:MM:SS"),
    ],
)
def test_columns_of_which_a_range_or_a_time_is_made_are_not_offered_as_such(tmp_path, names, cure):
    (line,) = refused(tmp_path, text([names.split(","), *(row[:4] for row in rows())]))
    assert line.endswith(f"{cure}: make such a column") or f"{cure}, the angle" in line
    assert "--column range" not in line.partition("got")[2]


@pytest.mark.parametrize("unit", ["DM", "radar miles"])
def test_miles_may_be_of_two_lengths(tmp_path, unit):
    name = f"Range ({unit})"
    (line,) = refused(tmp_path, text([["time", name], *([row[0], row[2]] for row in rows())]))
    assert line.endswith(f"--column range_nm='{name}' or --column range_dmi='{name}', of nautical or data miles")


def test_a_refused_header_names_the_encoding_that_it_was_read_in(tmp_path):
    names = ["时间", "距离(km)", "方位角(°)"]
    data = text([names, *([row[0], f"{30 + 0.1 * k:.3f}", row[3]] for k, row in enumerate(rows()))])
    (line,) = refused(tmp_path, data.decode().encode("gb18030"))
    assert line.endswith("; the text is read as Windows-1252; for another: --encoding NAME")
    given = Options(encoding="gb18030", columns={"t_s": names[0], "range_km": names[1], "bearing_deg": names[2]})
    _, columns, _ = imported(tmp_path, data.decode().encode("gb18030"), given)
    assert columns["range_m"][1] == 30_100


def test_a_route_without_times_is_called_one(tmp_path):
    points = "".join(f'<trkpt lat="{52 + k / 100}" lon="4.8"/>' for k in range(9))
    (line,) = refused(tmp_path, f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode(), AT)
    assert line.endswith("if its points have no times, it is a route: export the track that was recorded")


def test_geojson_is_called_by_its_name(tmp_path):
    (line,) = refused(tmp_path, b'{"type": "FeatureCollection", "features": []}', AT)
    assert line.endswith("it is GeoJSON: export the track as CSV or GPX")
