"""Times as clocks, spreadsheets and programs write them: zones, minutes, ticks, day numbers of 1904."""

import datetime

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from tests.recordings.formats.example_files import CLOCK_S, imported, refused

N = 60
T = 4.0 * np.arange(N)
START = datetime.datetime(2026, 11, 28, 12, tzinfo=datetime.UTC)
FROM_START = Options(zero=START.timestamp())


def table(times, name="time", rows_per_time=1):
    rows = (f"{t},7,{30_000 + 95 * T[i]:.1f},{95 + 0.5 * (-1) ** i}" for i, t in enumerate(times))
    return "\n".join([f"{name},track,range_m,velocity_mps", *rows]).encode()


def clocks(form, hours=0.0):
    return [(START + datetime.timedelta(hours=hours, seconds=t)).strftime(form) for t in T]


@pytest.mark.parametrize(
    ("zone", "hours"),
    [(" CET", 1), (" MEZ", 1), (" CEST", 2), (" MSK", 3), (" мск", 3), ("Z+3", 3), (" UTC+3", 3), (" GMT-05:30", -5.5),
     (" UTC", 0), ("Z", 0), (" (UTC)", 0), (" +0300", 3)],
)  # fmt: skip
@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%H:%M:%S"])
def test_zones_after_a_time(tmp_path, form, zone, hours):
    options = Options(zero="midnight") if "Y" not in form else FROM_START
    _, columns, _ = imported(tmp_path, table([clock + zone for clock in clocks(form, hours)]), options)
    np.testing.assert_array_equal(columns["t_s"], T + 43_200 * ("Y" not in form))


@pytest.mark.parametrize("zone", ["EST", "IST", "Europe/Berlin"])
def test_zones_with_several_meanings_are_asked_for(tmp_path, zone):
    (line,) = refused(tmp_path, table([f"{clock} {zone}" for clock in clocks("%Y-%m-%d %H:%M:%S")]))
    assert line.endswith(f"a zone is stated by its offset, as +03:00 in place of {zone}")


@pytest.mark.parametrize(
    ("name", "unit_s"),
    [
        ("time [min]", 60),
        ("Zeit, Stunden", 3600),
        ("t_h", 3600),
        ("Время, мин", 60),
        ("time_min", 60),
        ("t (hours)", 3600),
    ],
)
def test_minutes_and_hours(tmp_path, name, unit_s):
    _, columns, _ = imported(tmp_path, table([f"{t / unit_s!r}" for t in T.tolist()], f'"{name}"'))
    np.testing.assert_allclose(columns["t_s"], T, rtol=1e-12)


def test_a_spreadsheet_shows_minutes_and_seconds(tmp_path):
    """Past the full hour; without decimals they are asked for, or named by the velocities."""
    late = T + 3480
    _, columns, _ = imported(tmp_path, table([f"{t // 60 % 60:02.0f}:{t % 60:04.1f}" for t in late]))
    np.testing.assert_array_equal(columns["t_s"], T)
    (tmp_path / "plots.csv").unlink()
    whole = table([f"{t // 60 % 60:02.0f}:{t % 60:02.0f}" for t in late])
    (line,) = refused(tmp_path, whole)
    assert line.endswith("minutes and seconds are stated by --column t_mmss=time")
    _, columns, _ = imported(tmp_path, whole, Options(columns={"t_mmss": "time"}))
    np.testing.assert_array_equal(columns["t_s"], T)
    (tmp_path / "plots.csv").unlink()
    done, _, _ = imported(tmp_path, table([f"{t // 60:02.0f}:{t % 60:02.0f}" for t in T]))
    assert "minutes and seconds, read as hours and minutes (--column t_mmss=NAME)" in done.notes[0]


@pytest.mark.parametrize(("origin", "first"), [("0001-01-01", 639_154_000), ("1601-01-01", 134_000_000)])
def test_tenths_of_microseconds(tmp_path, origin, first):
    """Of .NET and of Windows."""
    since = START.replace(tzinfo=None) - datetime.datetime.fromisoformat(origin)
    ticks = (since.days * 86_400 + since.seconds) * 10_000_000
    assert ticks > first * 1_000_000_000
    done, columns, _ = imported(tmp_path, table([ticks + int(t) * 10_000_000 for t in T]), FROM_START)
    np.testing.assert_allclose(columns["t_s"], T, rtol=0, atol=2e-5 + CLOCK_S)
    assert done.notes == ["times are so large that they are read in units of 10⁻⁷ s"]


def test_day_numbers_of_1904_are_named(tmp_path):
    days = [f"{44_892.5 + t / 86_400:.9f}" for t in T]
    (line,) = refused(tmp_path, table(days, "Date"))
    assert line.endswith(
        ": --column t_days=Date (2022-11-27); if they count from 1904 (2026-11-28): --column t_days1904=Date"
    )
    _, columns, _ = imported(
        tmp_path, table(days, "Date"), Options(columns={"t_days1904": "Date"}, zero=START.timestamp())
    )
    np.testing.assert_allclose(columns["t_s"], T, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("form", "unit"), [("%Y-%m-%d %H:%M", "minutes: their seconds"), ("10:00:%S", "seconds: their")]
)
def test_times_without_seconds_are_the_cause_of_a_loss(tmp_path, form, unit):
    steps = [START + datetime.timedelta(seconds=t * (0.06 if "10" in form else 1)) for t in T]
    (line,) = refused(tmp_path, table([step.strftime(form) for step in steps]))
    assert f"; times are whole {unit}" in line


def test_frequencies_are_no_speeds(tmp_path):
    data = table([f"{t:g}" for t in T]).replace(b"velocity_mps", b"Doppler [Hz]")
    (line,) = refused(tmp_path, data)
    assert "Doppler [Hz]: must be a speed" in line
    r = 30_000 + 95 * T + 0.1 * T**2
    rows = (f"{t},7,{a:.1f},{20 * (95 + 0.2 * t):.1f}" for t, a in zip(T, r, strict=True))
    done, _, _ = imported(tmp_path, "\n".join(["time,track,range_m,velocity_mps", *rows]).encode())
    assert done.notes[-1].endswith("(as Hz, at a wavelength of 0.1 m), or a column is swapped")
