"""Recordings whose rows are out of the order of time, or whose clocks were set back."""

import random

import numpy as np
import pytest

from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.records import UnrolledClock
from tests.recordings.formats.example_files import SITE, block, imported, plot_048, refused
from tests.recordings.formats.test_logs import fixes, sentence

N = 40
SORTED = "rows that were earlier than one before of their track: {} of {}; they are sorted by time"


def table(order, header="time,track,range_m", row="{t},7,{r}"):
    """One target that leaves at 190 m/s, seen every 5 s; its rows in this order."""
    rows = (row.format(t=5 * k, r=30_000 + 950 * k) for k in order)
    return (header + "\n" + "\n".join(rows) + "\n").encode()


def orders():
    shuffled = list(range(N))
    random.Random(11).shuffle(shuffled)
    return {
        "newest first": range(N - 1, -1, -1),
        "swapped": [k ^ 1 for k in range(N)],
        "one late": [*range(20), 21, 22, 20, *range(23, N)],
        "shuffled": shuffled,
    }


@pytest.mark.parametrize("name", orders())
def test_no_row_is_lost_for_its_place_in_the_file(tmp_path, name):
    order = list(orders()[name])
    late = sum(k < max(order[: i + 1]) for i, k in enumerate(order))
    done, columns, _ = imported(tmp_path, table(order))
    np.testing.assert_array_equal(columns["t_s"], 5.0 * np.arange(N))
    np.testing.assert_array_equal(columns["range_m"], 30_000 + 950.0 * np.arange(N))
    assert done.notes == [SORTED.format(late, N)]
    assert done.skipped == []


def test_a_table_of_one_target_without_its_name_may_be_newest_first(tmp_path):
    """Its column of quality might name targets, but the times only fall."""
    text = table(range(N - 1, -1, -1), "time,range_m,quality", "{t},{r},3")
    _, columns, _ = imported(tmp_path, text)
    np.testing.assert_array_equal(columns["t_s"], 5.0 * np.arange(N))


def test_the_newest_may_come_first_over_midnight(tmp_path):
    clocks = [f"{t // 3600:02}:{t % 3600 // 60:02}:{t % 60:02}" for t in ((86_300 + 5 * k) % 86_400 for k in range(N))]
    rows = [f"{clock},7,{30_000 + 950 * k}" for k, clock in enumerate(clocks)]
    _, columns, _ = imported(tmp_path, "\n".join(["time,track,range_m", *reversed(rows)]).encode())
    np.testing.assert_array_equal(columns["t_s"], 5.0 * np.arange(N))


def test_a_clock_turns_back_with_rows_out_of_order():
    unrolled = UnrolledClock(60.0)
    assert [unrolled(t) for t in (1, 59, 2, 30, 59, 1)] == [1, -1, 2, 30, 59, 61]


def test_tracks_of_asterix_are_sorted_too(tmp_path):
    times = (100, 104, 112, 108, 116)
    records = [plot_048(t, 12800 + 10 * t, track=1) for t in times]
    done, columns, _ = imported(tmp_path, block(48, *records))
    np.testing.assert_array_equal(columns["t_s"], [0, 4, 8, 12, 16])
    assert (np.diff(columns["range_m"]) > 0).all()
    assert SORTED.format(1, 5) in done.notes


def test_rows_sent_again_are_no_loss_and_others_of_their_time_are(tmp_path):
    """Half of the rows come twice; of as many others two have the same time but another place."""
    twice = table([k for k in range(N) for _ in range(2)])
    done, columns, _ = imported(tmp_path, twice)
    assert len(columns["t_s"]) == N
    assert done.skipped == [f"rows sent again, with the same time and values ({N})"]
    (tmp_path / "plots.csv").unlink()
    several = "time,track,range_m\n" + "".join(f"{5 * (k // 2)},7,{30_000 + 475 * k}\n" for k in range(N))
    (line,) = refused(tmp_path, several.encode())
    assert f"{N // 2} of {N} rows would be left out: rows of the same time as one before of their track (20)" in line
    assert line.endswith("--allow-loss imports the others")
    done, columns, _ = imported(tmp_path, several.encode(), Options(allow_loss=True))
    assert len(columns["t_s"]) == N // 2


def test_the_end_of_summer_time_is_named_and_undone(tmp_path):
    """Local times from 2:55:00, which fall to 2:00 after 2:59:55."""
    seconds = [10_500 + 5 * k - 3600 * (k >= 60) for k in range(120)]
    rows = [f"2026-10-25 {t // 3600:02}:{t % 3600 // 60:02}:{t % 60:02},{j},{30_000 + 950 * k}" for k, t in
            enumerate(seconds) for j in range(2)]  # fmt: skip
    done, columns, _ = imported(tmp_path, "\n".join(["time,track,range_m", *rows]).encode())
    np.testing.assert_array_equal(columns["t_s"], np.repeat(5.0 * np.arange(120), 2))
    (note,) = done.notes
    assert note.startswith("times fall by an hour, as local times do at the end of summer time: the 120 rows")


@pytest.mark.parametrize(
    ("fall_s", "first", "expected"),
    [(43_200, 46_700, "by 12 hours, as those of a clock without AM and PM do"),
     (604_800, 604_700, "by a week, as seconds of the week do when it ends")],
)  # fmt: skip
def test_clocks_that_begin_again_are_named_and_run_on(tmp_path, fall_s, first, expected):
    times = [t - fall_s * (t >= 100 + first) for t in range(first, first + 200, 5)]
    text = "time,track,range_m\n" + "".join(f"{t},7,{30_000 + 950 * k}\n" for k, t in enumerate(times))
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], 5.0 * np.arange(40))
    assert done.notes[0].startswith(f"times fall {expected}: the 20 rows")


AT = Options(site=SITE)


def test_seconds_that_a_receiver_sends_again_are_counted(tmp_path):
    text = fixes(20, kinds=("RMC",), start=36_000.0).splitlines(keepends=True)
    again = "".join([*text[:10], *text[7:10], *text[10:]])
    done, columns, _ = imported(tmp_path, again.encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], 10 * np.arange(20))
    assert "rows sent again, with the same time and values (3)" in done.skipped


def test_a_leap_second_is_named(tmp_path):
    leap = sentence("GPRMC,235960.00,A,5236.300000,N,00445.600000,E,300.0,0.0,310124,,,A")
    text = fixes(2, kinds=("RMC",), start=86_380.0) + leap + fixes(3, kinds=("RMC",), start=86_400.0)
    done, columns, _ = imported(tmp_path, text.encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], [0, 10, 20, 30, 40])
    assert done.skipped == ["sentences in a leap second (23:59:60), which seconds from 1970 do not count (1)"]
    (tmp_path / "plots.csv").unlink()
    rows = "2016-12-31T23:59:59Z,5\n2016-12-31T23:59:60Z,6\n2017-01-01T00:00:00Z,7\n"
    done, columns, _ = imported(tmp_path, f"time,range_m\n{rows}".encode())
    assert columns["range_m"].tolist() == [5, 7]
    assert done.skipped == ["rows in a leap second (23:59:60), which seconds from 1970 do not count (1)"]


def test_a_missed_rollover_of_the_weeks_of_gps_is_named_and_undone(tmp_path):
    """31 January 2024 less 1024 weeks, until the receiver knows better."""
    text = fixes(6, kinds=("RMC",), start=36_000.0, day="160604") + fixes(9, kinds=("RMC",), start=36_060.0)
    done, columns, _ = imported(tmp_path, text.encode(), AT)
    np.testing.assert_array_equal(columns["t_s"], 10 * np.arange(15))
    assert any(note.startswith("dates step by 1024 weeks") and "the 6 rows before" in note for note in done.notes)


@pytest.mark.parametrize(
    ("name", "unit_s", "span"), [("t_ms", 1e-3, 65_536), ("time_s", 1.0, 512), ("t_us", 1e-6, 2**24)]
)
def test_times_of_a_counter_that_begins_anew_run_on(tmp_path, name, unit_s, span):
    step = round(span / 13.3)
    first = 0.8 * span
    rows = [(first + k * step + j * step / 3, j, 30_000 + 95 * k) for k in range(N) for j in (1, 2)]
    text = "\n".join([f"{name},track,range_m", *(f"{round(t) % span},{j},{r}" for t, j, r in rows)])
    done, columns, _ = imported(tmp_path, text.encode())
    expected = np.array([round(t) * unit_s for t, *_ in rows])
    np.testing.assert_allclose(columns["t_s"], expected - expected[0], rtol=0, atol=1e-6)
    assert done.notes == [
        f"times fall by {span * unit_s:.9g} s again and again, as those of a counter that begins anew do: they run on"
    ]


def test_tracks_one_after_the_other_are_no_counter(tmp_path):
    rows = [f"{5 * k},{j},{30_000 + 95 * k}" for j in range(6) for k in range(103)]
    done, columns, _ = imported(tmp_path, "\n".join(["time,track,range_m", *rows]).encode())
    assert columns["t_s"].max() == 510
    assert done.notes == []
