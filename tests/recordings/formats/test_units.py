"""Units and names of columns as people write them, and bearings whose numbers belong to another unit."""

import shlex

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.units import split_unit
from tests.recordings.formats.example_files import imported, refused

N = 60
NM = 1852.0


def plots(header, separator=";", range_unit_m=1.0, bearing=lambda k: 45.0):
    """A target that leaves at 120 m/s, in numbers with decimal commas."""
    rows = (f"{4 * k};{(20_000 + 480 * k) / range_unit_m:.4f};{bearing(k):.4f};120.0;7" for k in range(N))
    return "\n".join([header, *(row.replace(";", separator).replace(".", ",") for row in rows), ""]).encode()


@pytest.mark.parametrize(
    "header",
    [
        "Zeit [s];Entfernung [m];Azimut [°];Radialgeschw. [m/s];Spur-Nr.",
        "Zeit in s;Schrägentfernung in m;Peilung in Grad;Radialgeschwindigkeit in m/s;Ziel-Nr",
        "UTC-Zeit;Schrägdistanz (Meter);Seitenwinkel (°);Doppler (m/s);Ziel",
        "Messzeit [Sek.];Zielentfernung [m];Peilwinkel [Grad];Vrad, m/s;Zielnr.",
        "Zeit/s;Entfernung/m;Azimut/°;Vr/(m/s);Spur",
        "Datum/Uhrzeit;Distanz [m];Azimut, Grad;V_r [m/s];Objekt",
        "Время (с);Наклонная дальность (м);Азимут (град.);Скорость радиальная (м/с);№ трассы",
        "Время локации, сек;Дальность до цели, м;Пеленг, град;Допл. скорость, м/с;Цель №",
        "Время измерения [с];Расстояние [метров];Аз. [градусы];Радиальная скорость [м/сек];Номер цели",
        "Дата и время;Дальность в м;Азимут в градусах;Доплеровская скорость в м/с;Борт",
    ],
)
@pytest.mark.parametrize("separator", [";", "\t"])
def test_headers_of_german_and_russian_tables(tmp_path, header, separator):
    done, columns, tracks = imported(tmp_path, plots(header.replace(";", separator), separator))
    assert set(tracks) == {"7"}
    np.testing.assert_allclose(columns["range_m"], 20_000 + 480.0 * np.arange(N), rtol=1e-14)
    np.testing.assert_allclose(columns["bearing_rad"], np.pi / 4, rtol=1e-15)
    np.testing.assert_array_equal(columns["velocity_mps"], 120)
    assert done.notes + done.skipped == []


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        ("kyd", 914.4),
        ("data miles", 1828.8),
        ("nautical miles", NM),
        ("yd", 0.9144),
        ("hft", 30.48),
        ("морские мили", NM),
    ],
)
def test_units_of_ranges(tmp_path, unit, metres):
    _, columns, _ = imported(
        tmp_path, plots(f"Time;Range [{unit}];Azimuth [deg];Doppler [m/s];track", range_unit_m=metres)
    )
    np.testing.assert_allclose(columns["range_m"], 20_000 + 480.0 * np.arange(N), rtol=0, atol=metres * 1e-4)


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("Rng. [km]", ("rng", "km")),
        ("Datum/Uhrzeit", ("datum/uhrzeit", "")),
        ("height in use", ("height_in_use", "")),
        ("time (UTC)", ("time", "utc")),
        ("Vr/(m/s)", ("vr", "m/s")),
    ],
)
def test_units_at_the_end_of_names(name, parts):
    assert split_unit(name) == parts


def options_in(line):
    """The options --column of a message."""
    words = shlex.split(line.partition("--column")[2].replace(",", " "))
    return dict([words[0].split("=", 1)])


def test_the_user_overrules_the_unit_of_a_header(tmp_path):
    text = plots("Time;Range [m];Azimuth [deg];Doppler [m/s];track", range_unit_m=1000)
    done, columns, _ = imported(tmp_path, text, Options(columns={"range_km": "Range [m]"}))
    assert columns["range_m"][0] == 20_000
    assert done.notes == ["Range [m] is read in km, as --column says, not in m"]
    (tmp_path / "plots.csv").unlink()
    text = plots("Time;Range (slant);Azimuth [deg];Doppler [m/s];track", range_unit_m=1000)
    (line,) = refused(tmp_path, text)
    assert options_in(line) == {"range_km": "Range (slant)"}
    _, columns, _ = imported(tmp_path, text, Options(columns=options_in(line)))
    assert columns["range_m"][0] == 20_000


def test_columns_that_look_like_velocities_and_bearings_are_named(tmp_path):
    text = plots("Time;Range [m];Kurs zum Ziel [°];Annäherungsgeschw. [m/s];track")
    done, *_ = imported(tmp_path, text)
    option = "--column bearing_deg='Kurs zum Ziel [°]' --column velocity_mps='Annäherungsgeschw. [m/s]'"
    assert done.notes == [f"columns that may be read too: {option}"]
    (tmp_path / "plots.csv").unlink()
    assert imported(tmp_path, plots("Time;Range [m];course [deg];speed [m/s];track"))[0].notes == []


def passing(turn):
    """A bearing that passes north, from 340° to 18°, in numbers of a full turn."""
    return lambda k: (340 + 0.65 * k) % 360 / 360 * turn


@pytest.mark.parametrize(
    ("header", "turn", "unit"),
    [("deg", 2 * np.pi, "radian"), ("gon", 360, "deg"), ("mil", 360, "deg"), ("mil", 4096, "acp"), ("acp", 360, "deg")],
)
def test_bearings_that_jump_by_another_turn_are_of_its_unit(tmp_path, header, turn, unit):
    text = plots(f"Time;Range [m];Azimuth [{header}];Doppler [m/s];track", bearing=passing(turn))
    (line,) = refused(tmp_path, text)
    option = {f"bearing_{unit}": f"Azimuth [{header}]"}
    assert options_in(line) == option
    _, columns, _ = imported(tmp_path, text, Options(columns=option))
    expected = np.radians((340 + 0.65 * np.arange(N)) % 360)
    np.testing.assert_allclose(columns["bearing_rad"], expected, rtol=0, atol=2 * np.pi / turn * 1e-4)
    (tmp_path / "plots.csv").unlink()
    sound = plots(
        f"Time;Range [m];Azimuth [{unit.replace('radian', 'rad')}];Doppler [m/s];track", bearing=passing(turn)
    )
    assert imported(tmp_path, sound)[0].notes == []


def test_gon_that_are_called_degrees_are_told_and_noise_beyond_north_is_not(tmp_path):
    text = plots("Time;Range [m];Azimuth [deg];Doppler [m/s];track", bearing=passing(400))
    done, *_ = imported(tmp_path, text)
    assert "if they are in gon: --column bearing_gon='Azimuth [deg]'" in done.notes[0]
    (tmp_path / "plots.csv").unlink()
    noisy = plots("Time;Range [m];Azimuth [deg];Doppler [m/s];track", bearing=lambda k: 359.9 + 0.3 * (k % 5 > 2))
    assert imported(tmp_path, noisy)[0].notes == []
