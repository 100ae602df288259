"""Single cells and rows of a table that stand for no value, or in which a unit changes."""

import numpy as np
import pytest

from tests.recordings.formats.example_files import imported, refused

N = 60
T = 5.0 * np.arange(N)
FILLED = "velocities that stand for none, as 0 or -999 among others: {} of 60; they are left out"
JUMPS = "positions jump as no target does (rows: 1), first in track 7 from"
UNITS = {"velocity_mps": 1.0, "velocity_kn": 1852 / 3600, "velocity_kmh": 1 / 3.6}


def courses(acceleration=0.0):
    """Ranges (n,) of a target that leaves at 95 m/s, with errors of 30 m, and its velocities (n,), of 1 m/s."""
    rng = np.random.default_rng(4)
    r, v = 30_000 + 95 * T + 0.5 * acceleration * T**2, 95 + acceleration * T
    return r + rng.normal(0, 30, N), v + rng.normal(0, 1, N)


def table(r, velocities, header="velocity_mps"):
    rows = (f"{t},7,{a:.1f},{b}" for t, a, b in zip(T, r, velocities, strict=True))
    return "\n".join([f"time,track,range_m,{header}", *rows, ""]).encode()


@pytest.mark.parametrize("header", UNITS)
@pytest.mark.parametrize("fills", [{10: 0, 20: -999, 30: 9999}, dict.fromkeys(range(0, N, 3), 0), {0: -999, 59: 999.9}])
def test_velocities_that_stand_for_none_are_left_out(tmp_path, header, fills):
    r, v = courses()
    texts = [str(fills.get(i, f"{x / UNITS[header]:.2f}")) for i, x in enumerate(v)]
    done, columns, _ = imported(tmp_path, table(r, texts, header))
    assert done.notes == [FILLED.format(len(fills))]
    assert np.flatnonzero(np.isnan(columns["velocity_mps"])).tolist() == sorted(fills)
    assert len(columns["range_m"]) == N


COLUMNS = {"range_m": 1, "azimuth_deg": 2, "altitude_m": 3}
FILLS = [
    *(("range_m", number, 12) for number in ("65535", "99999", "32767", "9999.99", "4711.5")),
    *(("azimuth_deg", number, 12) for number in ("0", "-1", "200", "999", "65535")),
    *(("altitude_m", number, 12) for number in ("0", "32767", "-1000")),
    *(("range_m", "99999", 2), ("range_m", "4711", 3)),
]


def plots(fills, column, number):
    """Lines of plots, in some rows of which a number stands in a column, for no value."""
    r = courses()[0] + 5000
    rng = np.random.default_rng(5)
    rows = [[f"{t}", f"{a:.1f}", f"{60 + 0.01 * t + rng.normal(0, 0.1):.3f}", f"{9000 + rng.normal(0, 5):.0f}"]
            for t, a in zip(T, r, strict=True)]  # fmt: skip
    for row in fills:
        rows[row][COLUMNS[column]] = number
    return "\n".join(["time,range_m,azimuth_deg,altitude_m", *map(",".join, rows), ""]).encode()


@pytest.mark.parametrize(("column", "number", "count"), FILLS)
def test_numbers_that_stand_for_none_are_left_out_of_each_column(tmp_path, column, number, count):
    fills = range(3, 3 + 4 * count, 4)
    done, columns, _ = imported(tmp_path, plots(fills, column, number))
    if column == "range_m":
        assert done.skipped == [f"rows whose range stands for none, as 65535 again and again ({count})"]
        np.testing.assert_array_equal(columns["t_s"], np.delete(T, fills))
    else:
        name = {"azimuth_deg": "bearing_rad"}.get(column, column)
        assert np.flatnonzero(np.isnan(columns[name])).tolist() == list(fills)
        assert any(f"again and again: {count} of 60; they are left out" in note for note in done.notes)


@pytest.mark.parametrize("kind", ["stands", "cells", "two places", "lands", "levels", "gaps"])
def test_numbers_that_repeat_near_others_are_values(tmp_path, kind):
    """A target at rest, coarse cells, two targets under one name, an aircraft that lands in a gap, and a slow one in
    coarse cells that is seen for a short time between two gaps."""
    t, r, height = T, courses()[0], np.full(N, 9000.0)
    if kind == "stands":
        r = np.full(N, 5000.0)
    elif kind == "cells":
        r = 600 * np.round(r / 600)
    elif kind == "two places":
        r = np.where(np.random.default_rng(3).random(N) < 0.3, 5000.0, 7000.0)
    elif kind == "gaps":
        t = T + 1500.0 * (np.arange(N) >= 20) + 1500.0 * (np.arange(N) >= 25)
        r = 150 * np.round((20_000 + 3 * np.abs(t - 1700)) / 150)
    elif kind == "lands":
        height = np.where(T < 200, 9000.0, 0.0)
    else:
        height = np.where((T > 100) & (T < 200), 6000.0, 9000.0)
    rows = (f"{x},{a},{h}" for x, a, h in zip(t, r, height, strict=True))
    done, columns, _ = imported(tmp_path, "\n".join(["time,range_m,altitude_m", *rows]).encode())
    np.testing.assert_array_equal(columns["range_m"], r)
    np.testing.assert_array_equal(columns["altitude_m"], height)
    assert not any("stand for none" in note for note in done.notes)


@pytest.mark.parametrize("kind", ["stops", "passes", "rounded"])
def test_a_velocity_of_zero_is_one_where_the_ranges_say_so(tmp_path, kind):
    """A car that stops, a target that turns back, and one whose slow velocity is rounded."""
    r, v = courses()
    if kind == "stops":
        v = np.where((T > 100) & (T < 150), 0.0, 20.0)
        r = 5000 + np.concatenate([[0.0], np.cumsum(5.0 * v[1:])])
    elif kind == "passes":
        v = np.round(-60 + 0.4 * T)
        r = 30_000 - 60 * T + 0.2 * T**2
    else:
        v = np.where(np.arange(N) % 4 == 0, 0.0, 2.0)
        r = 5000 + 1.5 * T
    done, columns, _ = imported(tmp_path, table(r, v))
    assert done.notes == []
    np.testing.assert_array_equal(columns["velocity_mps"], v)


@pytest.mark.parametrize("change", ["kilometres", "wrap"])
def test_ranges_that_change_their_unit_are_no_swapped_velocities(tmp_path, change):
    r, v = courses()
    r = np.where(T >= 150, r / 1000, r) if change == "kilometres" else (r + 20_000) % 65_536
    done, columns, _ = imported(tmp_path, table(r, v))
    (note,) = done.notes
    assert note.startswith(JUMPS)
    assert len(columns["range_m"]) == N


@pytest.mark.parametrize("kind", ["two sensors", "errors", "cells"])
def test_two_sensors_under_one_name_are_noticed(tmp_path, kind):
    """Against errors that hide the motion, and a target at rest on the border of two range cells."""
    r, _ = courses()
    if kind == "errors":
        r = 30_000 + np.random.default_rng(1).normal(0, 500, N)
    elif kind == "cells":
        r = 30_000 + 75.0 * (np.random.default_rng(2).random(N) < 0.5)
    other = r + 5000 if kind == "two sensors" else np.roll(r, N // 2)
    rows = [f"{t + shift},7,{a:.1f}" for t, *pair in zip(T, r, other, strict=True) for shift, a in enumerate(pair)]
    done, columns, _ = imported(tmp_path, "\n".join(["time,track,range_m", *rows]).encode())
    alternates = [note.startswith("the rows of track 7 alternate between two places, 4825 m") for note in done.notes]
    assert alternates == [True] * (kind == "two sensors")
    assert len(columns["range_m"]) == 2 * N


def test_the_end_of_a_day_may_be_called_24_00(tmp_path):
    clocks = [f"{int(t // 3600):02}:{int(t % 3600 // 60):02}:{int(t % 60):02}" for t in 86_400 - 150 + T]
    clocks = [clock if clock <= "24:00:00" else "00" + clock[2:] for clock in clocks]
    text = "\n".join(["time,track,range_m", *(f"{c},7,{30_000 + 95 * t}" for c, t in zip(clocks, T, strict=True))])
    _, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], T)
    (tmp_path / "plots.csv").unlink()
    (line,) = refused(tmp_path, text.replace("24:00:00", "24:00:01").encode())
    assert "must be a time in s, a time of day" in line
