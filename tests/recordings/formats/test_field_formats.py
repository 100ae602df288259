"""Formats of the field: a ship's radar, a receiver's port, German and Russian tables, airports' recordings."""

import re

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.open_recording import detect_format
from tests.recordings.formats.example_files import SITE, block, imported, plot_048, refused
from tests.recordings.formats.test_importing import NM
from tests.recordings.formats.test_logs import sentence

KNOT_MPS = NM / 3600
AT = Options(site=SITE)


def target(k, number=1, reference="T", bearing=200.0, unit="N", status="T", time=True):
    """A target that a ship's radar tracks, 5 + 0.05 k miles away, at 10 s a turn."""
    clock = f"1200{k:02}.50" if time else ""
    return sentence(
        f"RATTM,{number:02},{5 + 0.05 * k:.2f},{bearing:.1f},{reference},6.0,90.0,T,0.1,5.0,{unit},T{number},{status},,"
        f"{clock},A"
    )


def own(k):
    return sentence(f"GPRMC,1200{k:02}.00,A,5236.300000,N,00445.600000,E,0.0,0.0,310124,,,A")


def test_targets_of_a_ships_radar_are_its_plots(tmp_path):
    """Beside its own positions, which give the date; a lost target and a damaged sentence are left out."""
    lines = [text for k in range(20) for text in (own(k), target(k), target(k, 2, bearing=10.0 + k))]
    lines += [target(21, status="L"), target(22).replace("6.1", "6.2")]
    done, columns, tracks = imported(tmp_path, "".join(lines).encode(), Options(zero=1_706_702_400.0))
    assert (done.format, tracks) == ("nmea", ["01", "02"] * 20)
    np.testing.assert_array_equal(columns["t_s"][::2], 0.5 + np.arange(20))  # from 12:00 on 31 January 2024
    np.testing.assert_allclose(columns["range_m"][::2], NM * (5 + 0.05 * np.arange(20)), rtol=0, atol=NM * 1e-12)
    np.testing.assert_allclose(columns["bearing_rad"][1::2], np.radians(10.0 + np.arange(20)), rtol=1e-15)
    assert sorted(done.skipped) == [
        "damaged sentences (1)",
        "positions of the ship itself, beside its radar's targets (20)",
        "targets that the radar has lost (1)",
    ]


def test_bearings_from_the_bow_need_a_heading(tmp_path):
    """The heading is 350°; kilometres, and no time but that of the position before."""
    text = own(0) + target(1, reference="R", unit="K") + sentence("HEHDT,350.0,T")
    text += "".join(own(k) + target(k, reference="R", unit="K", time=False) for k in range(2, 5))
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_allclose(columns["range_m"], [5100, 5150, 5200], rtol=1e-15)
    np.testing.assert_allclose(columns["bearing_rad"], np.radians(190), rtol=1e-15)
    np.testing.assert_array_equal(columns["t_s"], [0, 1, 2])
    assert "targets by the bow, whose heading no sentence HDT states (1)" in done.skipped


def test_the_log_of_a_ship_with_a_radar_is_the_truth_of_its_own_positions(tmp_path):
    """Plots of the ship by another radar, and its log, which has targets too."""
    (tmp_path / "own.nmea").write_text("".join(own(k) + target(k) for k in range(9)))
    text = "Time,track,range [m]\n" + "".join(f"2024-01-31T12:00:{k:02}Z,7,33400\n" for k in range(1, 8))
    options = Options(site=SITE, truth=str(tmp_path / "own.nmea"), owner="7")
    _, columns, _ = imported(tmp_path, text.encode(), options)
    assert np.isfinite(columns["true_r_m"]).all()


FIELDS = (
    "MessageType,TransmissionType,SessionID,AircraftID,HexIdent,FlightID,DateMessageGenerated,TimeMessageGenerated,"
    "DateMessageLogged,TimeMessageLogged,Callsign,Altitude,GroundSpeed,Track,Latitude,Longitude,VerticalRate,Squawk,"
    "Alert,Emergency,SPI,IsOnGround\n"
)


@pytest.mark.parametrize("header", ["", FIELDS])
def test_a_basestation_port_is_read_as_it_is(tmp_path, header):
    lines = []
    for k in range(10):
        when = f"2024/12/31,23:59:{50 + k}.250,2025/01/01,00:59:{50 + k}.900"
        lines += [f"MSG,3,1,1,484164,1,{when},,38000,,,{52.5 + 0.002 * k:.5f},4.76,,,0,0,0,0"]
        lines += [f"MSG,4,1,1,484164,1,{when},,,400,0,,,0,,,,,", "STA,,5,179,400AE7,10103,2024/12/31,23:59:55.000,,,RM"]
    done, columns, tracks = imported(tmp_path, (header + "\n".join(lines)).encode(), AT)
    assert set(tracks) == {"484164"}
    np.testing.assert_array_equal(columns["t_s"], np.arange(10))
    np.testing.assert_allclose(columns["altitude_m"], 38_000 * 0.3048, rtol=1e-15)
    assert done.skipped == ["messages without a position (20)"]
    assert "s after 1970" in (tmp_path / "plots.csv").read_text()


def german(header):
    """A boat that comes nearer at 6 m/s, with decimal commas."""
    rows = [f"{2.5 * k};{9.0 - 0.015 * k:.3f};{45.0};{-6 / KNOT_MPS:.3f}" for k in range(30)]
    return "\n".join([header, *(row.replace(".", ",") for row in rows), ""])


@pytest.mark.parametrize(
    "header",
    [
        "Zeit;Entf_km;Azimut [Grad];Vr_kn",
        "Zeit, s;Entfernung, km;Peilung, deg;Radialgeschwindigkeit, Knoten",
        "Время, с;Дальность, км;Азимут, град;Радиальная скорость, уз",
        "ВРЕМЯ;ДАЛЬНОСТЬ [КМ];ПЕЛЕНГ (ГРАД);Vr, уз",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1251"])
def test_tables_of_german_and_russian_engineers(tmp_path, header, encoding):
    done, columns, _ = imported(tmp_path, german(header).encode(encoding), Options())
    np.testing.assert_allclose(columns["range_m"], 9000 - 15.0 * np.arange(30), rtol=1e-15)
    np.testing.assert_allclose(columns["bearing_rad"], np.pi / 4, rtol=1e-15)
    np.testing.assert_allclose(columns["velocity_mps"], -6, rtol=0, atol=KNOT_MPS * 0.0005)
    page = [note for note in done.notes if "the text is read as" in note]
    is_cyrillic = not header.isascii()
    assert [re.findall("Windows-1251", note) for note in page] == [["Windows-1251"]] * (
        encoding == "cp1251" and is_cyrillic
    )


def test_german_umlauts_are_no_cyrillic(tmp_path):
    text = "Zeit;Entfernung [km];Höhe [m];Größe;Prüfung\n0;5,1;100;groß;süß\n4;5,2;100;mäßig;öde\n"
    done, columns, _ = imported(tmp_path, text.encode("cp1252"))
    assert columns["altitude_m"].tolist() == [100, 100]
    assert any("Windows-1252" in note for note in done.notes)


def test_commas_separate_where_semicolons_stand_in_cells(tmp_path):
    _, columns, _ = imported(tmp_path, b"time,range_m,note; remark\n0,5,a; b\n4,6,c; d\n")
    assert columns["range_m"].tolist() == [5, 6]


def test_a_refused_header_comes_with_the_options_that_read_it(tmp_path):
    """All that is missing at once; the options, copied, import the file."""
    text = "tim;dist;dop;azm\n0,0;7945,2;-6,1;44,9\n2,5;7930,1;-6,2;45,0\n5,0;7914,1;-6,2;45,0\n"
    (line,) = refused(tmp_path, text.encode())
    options = dict(re.findall(r"--column (\S+)=(\S+)", line.partition("perhaps")[2]))
    assert options == {"t_s": "tim", "range_m": "dist", "velocity_mps": "dop", "bearing_deg": "azm"}
    _, columns, _ = imported(tmp_path, text.encode(), Options(columns=options))
    assert columns["range_m"].tolist() == [7945.2, 7930.1, 7914.1]


@pytest.mark.parametrize(
    ("row", "place"),
    [("2024/19/09,12:00:00.250", "2:1: Date: must be a date"), ("2024/12/09,noon", "2:2: Time: must be a time in s")],
)
def test_the_cell_at_fault_is_blamed(tmp_path, row, place):
    (line,) = refused(tmp_path, f"Date,Time,range_m\n{row},5\n".encode())
    assert f"recording:{place}" in line
    assert line.endswith(f"got '{row.split(',')[int(place[2]) - 1]}'")


@pytest.mark.parametrize("text", ["2024/12/09 12:00:{:02}", "2024.12.09 12:00:{:02}.000", "2024/12/9 12:00:{:02}"])
def test_dates_may_begin_with_the_year(tmp_path, text):
    rows = "".join(f"{text.format(2 * k)},{5 + k}\n" for k in range(3))
    _, columns, _ = imported(tmp_path, f"time,range_m\n{rows}".encode(), Options(zero=1_733_745_600.0))
    np.testing.assert_array_equal(columns["t_s"], [0, 2, 4])


@pytest.mark.parametrize("category", [2, 7, 10, 11, 19, 23, 150, 240, 247])
def test_asterix_may_begin_with_any_category(tmp_path, category):
    data = block(category, bytes([0x80, 25, 1])) + b"".join(
        block(48, plot_048(100 + 4 * k, 12_800 + k, track=1)) for k in range(5)
    )
    if category == 2:
        data = block(2, b"\xb0\x19\x0a\x02" + (100 * 128).to_bytes(3, "big")) + data[len(block(2, b"abc")) :]
    assert detect_format("x", data) == "asterix"
    _, columns, _ = imported(tmp_path, data)
    np.testing.assert_array_equal(columns["t_s"], 4 * np.arange(5))


def test_bytes_of_no_kind_name_the_option(tmp_path):
    (line,) = refused(tmp_path, b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    assert "its first bytes are of none" in line
    assert line.endswith("if it is one: --from FORMAT")


@pytest.mark.parametrize(
    "text",
    [
        *(
            "28-Nov-2026 12:59:30",
            "28 November 2026 12:59:30",
            "Nov 28, 2026, 12:59:30 PM",
            "28. November 2026 12:59:30",
        ),
        *("28 ноября 2026 г. 12:59:30", "28 нояб. 2026 12:59:30", "28-nov-26 12:59:30", "11/28/2026 12:59:30 PM"),
        *("28-11-2026 12:59:30", "28/11/2026, 12:59:30\u202fpm", "28.11.2026 12:59:30"),
    ],
)
def test_dates_as_people_write_them(tmp_path, text):
    table = f'Time;Range [km]\n"{text}";20\n"{text.replace("59:30", "59:32")}";20.1\n'
    _, columns, _ = imported(tmp_path, table.encode(), Options(zero=0.0))
    expected = np.datetime64("2026-11-28T12:59:30", "s").astype(int)
    np.testing.assert_array_equal(columns["t_s"], [expected, expected + 2])


@pytest.mark.parametrize(
    ("month", "name"), [(3, "März"), (5, "Mai"), (10, "Okt"), (12, "Dezember"), (5, "мая"), (1, "янв"), (6, "июня")]
)
def test_months_in_german_and_russian(tmp_path, month, name):
    table = f"Time;Range [km]\n7 {name} 2026 00:00:00;20\n7 {name} 2026 00:00:01;20.1\n"
    _, columns, _ = imported(tmp_path, table.encode(), Options(zero=0.0))
    assert columns["t_s"][0] == np.datetime64(f"2026-{month:02}-07", "s").astype(int)


def test_an_order_of_day_and_month_that_no_date_shows_is_refused_beside_am_and_pm(tmp_path):
    table = b"Time,Range [km]\n12/9/2026 11:59:59 PM,20\n12/9/2026 11:59:59.5 PM,20.1\n"
    (line,) = refused(tmp_path, table)
    assert "must show whether the day or the month stands first" in line
    assert "--column t_mdy=Time or t_dmy=Time" in line
    _, columns, _ = imported(tmp_path, table, Options(columns={"t_mdy": "Time"}, zero=0.0))
    assert columns["t_s"][0] == np.datetime64("2026-12-09T23:59:59", "s").astype(int)


@pytest.mark.parametrize("text", ["13:00:00 PM", "0:30:00 AM", "31 Jun 2026", "28 Smarch 2026", "28-Nov-2026 25:00"])
def test_times_that_are_none_are_refused_with_their_cell(tmp_path, text):
    (line,) = refused(tmp_path, f"Time;Range [km]\n{text};20\n".encode())
    assert "recording:2:1: Time: must be a time in s" in line


@pytest.mark.parametrize(
    ("cell", "metres"),
    [
        *(('"1,234.5"', 1234.5), ('"12,5"', 12.5), ('"1,234,567"', 1_234_567), ('"1.234,5"', 1234.5)),
        *(("1 234.5", 1234.5), ("1\u00a0234", 1234), ("1'234.5", 1234.5), ("1234.5", 1234.5)),
    ],
)
def test_separators_of_thousands_that_can_be_nothing_else(tmp_path, cell, metres):
    _, columns, _ = imported(tmp_path, f"time,range_m\n0,{cell}\n1,{cell}\n".encode())
    np.testing.assert_array_equal(columns["range_m"], metres)


def test_a_comma_that_may_be_either_is_refused(tmp_path):
    (line,) = refused(tmp_path, b'time,range_m\n0,"1,234"\n')
    assert "range_m: must be a number, got '1,234'" in line


def target_place(k, number=1, status="T", time=True):
    """A target by its place, which goes north by 0.05′ in each of 10 s turns."""
    clock = f"1200{k:02}.50" if time else ""
    return sentence(f"RATLL,{number:02},52{36 + 0.05 * k:09.6f},N,00445.600000,E,TUG,{clock},{status},")


def test_targets_by_their_place_are_positions(tmp_path):
    """A lost target is left out; where the same targets are given by distance and bearing, these are read."""
    lines = [text for k in range(20) for text in (own(k), target_place(k))] + [target_place(21, status="L")]
    done, columns, tracks = imported(tmp_path, "".join(lines).encode(), AT)
    assert (done.format, set(tracks)) == ("nmea", {"01"})
    np.testing.assert_array_equal(columns["t_s"], np.arange(20))
    np.testing.assert_allclose(np.diff(columns["x_m"]), 0.05 * NM, rtol=0.002)
    assert "targets that the radar has lost (1)" in done.skipped
    (tmp_path / "plots.csv").unlink()
    both = "".join(own(k) + target_place(k) + target(k) for k in range(20))
    done, columns, _ = imported(tmp_path, both.encode())
    np.testing.assert_allclose(columns["range_m"], NM * (5 + 0.05 * np.arange(20)), rtol=0, atol=NM * 1e-12)
    assert "targets by their place, beside their plots (20)" in done.skipped


@pytest.mark.parametrize("write", [target, target_place])
def test_targets_without_time_have_that_of_the_clock_beside_them(tmp_path, write):
    """Of a sentence ZDA, which has a date; the first targets stand before it."""
    text = write(0, time=False) + "".join(
        sentence(f"GPZDA,1200{k:02}.00,31,01,2024,00,00") + write(k, time=False) for k in range(1, 20)
    )
    done, columns, _ = imported(tmp_path, text.encode(), Options(site=SITE, zero=1_706_702_400.0))
    assert sorted(columns["t_s"]) == [*range(1, 20)]  # the first target has the time of the second
    assert len(done.skipped) == 1
    (tmp_path / "plots.csv").unlink(missing_ok=True)
    (line,) = refused(tmp_path, "".join(write(k, time=False) for k in range(5)).encode(), AT)
    assert line.endswith("left out: targets whose time neither they nor sentences RMC, GGA or ZDA state (5)")
