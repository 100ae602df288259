"""Logs of a ship's bridge: sentences GLL, targets without a time, AIS beside them."""

import numpy as np

from radarsim.recordings.formats.import_options import Options
from tests.recordings.formats.example_files import SITE, imported, refused
from tests.recordings.formats.test_logs import sentence

N = 30
AT = Options(site=SITE)
TARGET = "RATTM,01,{:.2f},{:.1f},T,12.0,45.0,T,0.5,10,N,TGT1,T,,,A"
AIS = "!AIVDM,1,1,,A,13aEOK?P00PD2wVMdLDRhgvL289?,0*26\r\n"


def clock(k):
    return f"10{4 * k // 60:02}{4 * k % 60:02}.00"


def places(kinds):
    """A log with a place of these kinds at each time."""
    bodies = {
        "GLL": "GPGLL,{0:.4f},N,00445.6000,E,{1},A,A",
        "GGA": "GPGGA,{1},{0:.4f},N,00445.6000,E,1,08,0.9,5.0,M,,M,,",
    }
    lines = (sentence(bodies[kind].format(5230 + k / 10, clock(k))) for k in range(N) for kind in kinds)
    return "".join(lines).encode()


def test_places_of_gll_are_read_where_nothing_else_is(tmp_path):
    done, columns, _ = imported(tmp_path, places(["GLL"]), AT)
    np.testing.assert_array_equal(columns["t_s"], 4.0 * np.arange(N))
    (tmp_path / "plots.csv").unlink()
    both, _, _ = imported(tmp_path, places(["GGA", "GLL"]), AT)
    assert done.rows == both.rows == N
    assert both.skipped == [f"other lines ({N})"]


def test_a_target_without_time_has_that_of_the_logger(tmp_path):
    stamps = (f"2026-11-28 10:{4 * k // 60:02}:{4 * k % 60:02}.250;" for k in range(N))
    lines = [stamp + sentence(TARGET.format(10 + 0.05 * k, 45 + 0.1 * k)) for k, stamp in enumerate(stamps)]
    _, columns, _ = imported(tmp_path, "".join(lines).encode(), Options(zero="midnight"))
    np.testing.assert_array_equal(columns["t_s"], 36_000.25 + 4.0 * np.arange(N))


def test_what_is_not_read_is_named(tmp_path):
    log = "".join(sentence(TARGET.format(10, 45)) + AIS for _ in range(N)).encode()
    done, _, _ = imported(tmp_path, log, Options(site=SITE, allow_loss=True))
    assert f"targets of a radar in addition to AIS: {N} ($RATTM or $RATLL; --from nmea reads them)" in done.notes
    (tmp_path / "plots.csv").unlink()
    (line,) = refused(tmp_path, sentence("GPGSV,1,1,04,01,40,083,46").encode() * 9)
    assert line.endswith("RMC, GGA, GLL, TTM, TLL or VDM; it begins with GSV")
