"""Tables whose columns, or rows, are of several targets or sensors."""

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from tests.recordings.formats.example_files import imported, refused

N = 40


def wide_table(header, rows=N):
    """Times, then numbers that rise, from 10,000 on, in each further column."""
    width = header.count(",") + 1
    lines = (",".join([f"{4 * k}", *(f"{10_000 * j + 50 * k}" for j in range(1, width))]) for k in range(rows))
    return "\n".join([header, *lines, ""]).encode()


@pytest.mark.parametrize(
    ("header", "names", "ways"),
    [
        ("time,R1,R2", "R1, R2", "--column range_m=R1; --column range_m=R2"),
        ("time,range_1_km,range_2_km", "range_1_km, range_2_km", "--column range_km=range_1_km; "),
        ("t,range_m,range2_m", "range_m, range2_m", "--column range_m=range_m; --column range_m=range2_m"),
        ("t,T1 range (km),T2 range (km)", "T1 range (km), T2 range (km)", "--column range_km='T1 range (km)'; "),
        ("t,R_A,V_A,R_B,V_B", "R_A, R_B", "--column range_m=R_A --column velocity_mps=V_A; --column range_m=R_B --"),
        ("t,north_range,south_range", "north_range, south_range", "--column range_m=north_range; "),
        ("time,дальность1,дальность2", "дальность1, дальность2", "--column range_m='дальность1'; "),
        (
            "time,lat1,lon1,lat2,lon2",
            "lat1, lon1, lat2, lon2",
            "--column latitude_deg=lat1 --column longitude_deg=lon1; ",
        ),
    ],
)
def test_columns_of_several_targets_are_refused_with_the_options_for_each(tmp_path, header, names, ways):
    (line,) = refused(tmp_path, wide_table(header))
    assert f"{names} are of several: import each by itself, " in line
    assert ways in line


def test_one_of_several_targets_is_read(tmp_path):
    _, columns, _ = imported(tmp_path, wide_table("t,R1,R2"), Options(columns={"range_m": "R2"}))
    np.testing.assert_array_equal(columns["range_m"], 20_000 + 50 * np.arange(N))


@pytest.mark.parametrize(
    "header",
    [
        *("t,range_m,true_range_m", "t,range_m,range_std", "t,range_m,range_2_sigma", "t,range_m,d1,d2"),
        *("t,range_m,min_range,max_range", "t,range_m,range_km", "t,range_m,quality_1,quality_2"),
    ],
)
def test_further_columns_of_one_target_are_no_wide_table(tmp_path, header):
    _, columns, _ = imported(tmp_path, wide_table(header))
    assert len(columns["range_m"]) == N


@pytest.mark.parametrize(("has_tracks", "values"), [(False, "AB"), (True, "AB"), (False, "A")])
def test_a_column_of_sensors_is_named_if_there_are_several(tmp_path, has_tracks, values):
    head = "time,Sensor,track,range_m" if has_tracks else "time,Sensor,range_m"
    rows = (f"{4 * k},{values[k % len(values)]}{',7' * has_tracks},{30_000 + 380 * k}" for k in range(N))
    done, columns, _ = imported(tmp_path, "\n".join([head, *rows]).encode())
    assert len(columns["range_m"]) == N
    expected = {
        (False, "AB"): "by Sensor (rows): A (20), B (20); they are taken as one track: --column track=Sensor makes one",
        (True, "AB"): "by Sensor (rows): A (20), B (20); their tracks of one name are taken as one",
    }.get((has_tracks, values))
    assert sum("plots of several sensors" in note for note in done.notes) == bool(expected)
    assert not expected or any(expected in note for note in done.notes)
