"""Clocks that were set back or forward within a recording, in each format, and rows that only look so."""

import numpy as np
import pytest

from radarsim.recordings.formats.forward_steps import find_set_forward
from radarsim.recordings.formats.import_options import Options
from tests.recordings.formats.example_files import SITE, block, imported, plot_048
from tests.recordings.formats.test_logs import sentence

AT = Options(site=SITE)
N = 40
FIRST_S = 1_700_000_000
SPEED_MPS = 190.0


def set_back(times, size_s, at=20):
    """Times whose clock is set back at that row."""
    return [t - size_s * (k >= at) for k, t in enumerate(times)]


def table(times, noise_m=0.0, header="time,track,range_m"):
    rng = np.random.default_rng(4)
    rows = (f"{t:.3f},7,{30_000 + SPEED_MPS * 5 * k + rng.normal(0, noise_m):.3f}" for k, t in enumerate(times))
    return "\n".join([header, *rows, ""]).encode()


@pytest.mark.parametrize("size_s", [5, 6.5, 18, 37, 400])
@pytest.mark.parametrize("noise_m", [0, 30])
def test_a_clock_that_is_set_back_is_named_and_undone(tmp_path, size_s, noise_m):
    """By one scan the time stands still once."""
    times = 5.0 * np.arange(N)
    done, columns, _ = imported(tmp_path, table(set_back(FIRST_S + times, size_s), noise_m))
    np.testing.assert_allclose(columns["t_s"], times, rtol=0, atol=1e-6)
    (note,) = done.notes
    assert note.startswith(f"the clock was set back by {size_s:g} s at 22:14:55: the 20 rows before are taken as that")
    assert done.skipped == []


def test_two_set_backs_are_undone_and_one_to_another_time_zone_is_named(tmp_path):
    times = 5.0 * np.arange(N)
    done, columns, _ = imported(tmp_path, table(set_back(set_back(FIRST_S + times, 7), 3 * 3600, at=30)))
    np.testing.assert_array_equal(columns["t_s"], times)
    assert done.notes[0].startswith("the clock was set back by 7 s at 22:14:55: the 20 rows before")
    assert done.notes[1].startswith(
        "the clock was set back by 3 hours at 22:15:38, as to another time zone: the 30 rows"
    )


def test_a_second_that_is_counted_twice_is_a_leap_second(tmp_path):
    """As clocks that count from 1970 do, of one and of four rows in a second."""
    for step_s in (1, 0.25):
        times = step_s * np.arange(N)
        end_s = 1_483_228_800 - step_s * 20  # of 2016
        done, columns, _ = imported(tmp_path, table(set_back(end_s + times, 1)))
        np.testing.assert_array_equal(columns["t_s"], times)
        (note,) = done.notes
        assert note.startswith(
            "the clock counts a second twice at the end of 2016-12-31, as in a leap second: the 20 rows"
        )
        (tmp_path / "plots.csv").unlink()


@pytest.mark.parametrize("by_track", [False, True])
def test_the_clock_of_several_targets_is_one(tmp_path, by_track):
    """In the order of the records, and track by track; the last track ends before."""
    rows = [(FIRST_S + 5 * k + number, number, 30_000 + 950 * k * (-1) ** number)
            for k in range(N) for number in range(4) if number < 3 or k < 15]  # fmt: skip
    rows = [(t - 12 * (t >= FIRST_S + 100), *row) for t, *row in rows]
    if by_track:
        rows.sort(key=lambda row: row[1])
    text = "time,track,range_m\n" + "".join(f"{t},{number},{r}\n" for t, number, r in rows)
    done, columns, _ = imported(tmp_path, text.encode())
    assert np.unique(columns["t_s"] % 5).tolist() == [0, 1, 2, 3]
    assert columns["t_s"].max() == 5 * (N - 1) + 2
    assert done.notes[0].startswith("the clock was set back by 12 s at ")
    assert "the 75 rows before" in done.notes[0]


@pytest.mark.parametrize("size_s", [1.2, 2.5, 4.9, -1.5])
@pytest.mark.parametrize("noise_m", [0, 30])
def test_a_clock_that_is_set_by_less_than_a_scan_is_named_and_undone(tmp_path, size_s, noise_m):
    """The times then rise, but by no whole scan."""
    times = 5.0 * np.arange(N)
    done, columns, _ = imported(tmp_path, table(set_back(FIRST_S + times, size_s), noise_m))
    np.testing.assert_allclose(columns["t_s"], times, rtol=0, atol=1e-6)
    (note,) = done.notes
    assert note.startswith(
        f"the clock was set {'back' if size_s > 0 else 'forward'} by {abs(size_s):g} s at 22:14:55: the 20"
    )
    assert done.skipped == []


def test_the_clock_of_several_targets_is_set_by_less_than_a_scan(tmp_path):
    rng = np.random.default_rng(4)
    rows = [(FIRST_S + 4 * k + number - 1.5 * (k >= 20), number, 60_000 + (-1) ** number * 760 * k + rng.normal(0, 30))
            for k in range(N) for number in range(3)]  # fmt: skip
    text = "time,track,range_m\n" + "".join(f"{t},{number},{r:.1f}\n" for t, number, r in rows)
    done, columns, _ = imported(tmp_path, text.encode())
    assert done.notes[0].startswith("the clock was set back by 1.5 s at ")
    assert "the 60 rows before" in done.notes[0]
    assert np.unique(columns["t_s"] % 4).tolist() == [0, 1, 2]


@pytest.mark.parametrize("kind", ["a plot between scans", "the antenna stops", "jitter"])
def test_steps_that_are_no_scans_are_no_clock(tmp_path, kind):
    """Where the places agree with the times."""
    times = 4.0 * np.arange(N)
    times = {
        "a plot between scans": np.sort([*times, 81.5]),
        "the antenna stops": times + 1.5 * (times >= 80),
        "jitter": times + np.random.default_rng(1).uniform(0, 3, N),
    }[kind]
    noise = np.random.default_rng(2).normal(0, 30, times.size)
    rows = (f"{t},7,{30_000 + 190 * t + e:.1f}" for t, e in zip(times, noise, strict=True))
    done, columns, _ = imported(tmp_path, "\n".join(["time,track,range_m", *rows]).encode())
    assert done.notes == []
    np.testing.assert_allclose(columns["t_s"], times - times[0], rtol=0, atol=1e-9)


def late_rows():
    k = list(range(N))
    return {
        "a block": k[:20] + k[25:30] + k[20:25] + k[30:],
        "halves swapped": k[20:] + k[:20],
        "a part sent again": k[:20] + k[15:20] + k[20:],
    }


@pytest.mark.parametrize("name", late_rows())
def test_rows_out_of_order_are_no_clock_set_back(tmp_path, name):
    order = late_rows()[name]
    rng = np.random.default_rng(4)
    ranges = 30_000 + 950 * np.arange(N) + rng.normal(0, 30, N)
    text = "time,track,range_m\n" + "".join(f"{FIRST_S + 5 * k},7,{ranges[k]:.3f}\n" for k in order)
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], 5.0 * np.arange(N))
    assert [note.partition(":")[0] for note in done.notes] == ["rows that were earlier than one before of their track"]


def test_two_recordings_of_a_target_that_overlap_are_sorted(tmp_path):
    """By the places it is where both say."""
    times = [*range(0, 100, 5), *range(82, 182, 5)]
    text = "time,track,range_m\n" + "".join(f"{t},7,{30_000 + 190 * t}\n" for t in times)
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], sorted(times))
    assert done.notes[0].endswith("they are sorted by time")


FORWARD = {  # sizes, s, and how they are said
    5: "by 5 s", 18: "by 18 s", 400: "by 400 s", 3600: "by an hour", 3 * 3600: "by 3 hours", 86_400: "by 1 day",
    7 * 86_400: "by 7 days",
}  # fmt: skip


@pytest.mark.parametrize("size_s", FORWARD)
@pytest.mark.parametrize("noise_m", [0, 30])
def test_a_clock_that_is_set_forward_is_named_and_undone(tmp_path, size_s, noise_m):
    times = 5.0 * np.arange(N)
    done, columns, _ = imported(tmp_path, table(set_back(FIRST_S + times, -size_s), noise_m))
    np.testing.assert_array_equal(columns["t_s"], times)
    (note,) = done.notes
    assert note.startswith(f"the clock was set forward {FORWARD[size_s]} at 22:14:55")
    assert "the 20 rows before are taken as" in note
    assert done.skipped == []


def test_a_clock_that_is_set_forward_twice_and_back_once_runs_on(tmp_path):
    times = 5.0 * np.arange(2 * N)
    recorded = FIRST_S + times + 3600.0 * (times >= 100) - 3600.0 * (times >= 200) + 60.0 * (times >= 300)
    done, columns, _ = imported(tmp_path, table(recorded))
    np.testing.assert_array_equal(columns["t_s"], times)
    assert len(done.notes) == 3


def true_course(kind, rng):
    """Where a target is, m north and east, at times (n,): one that moves on during a gap, or stands."""
    speed, heading, rate = rng.choice([15.0, 90.0, 250.0]), rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0.5, 3))
    north, east = rng.uniform(-60e3, 60e3, 2)
    if kind == "stands":
        return lambda t: (north + 0 * t, east + 0 * t)
    if kind == "turns":
        radius = speed / rate
        return lambda t: (north + radius * np.sin(rate * t), east + radius * np.cos(rate * t))
    return lambda t: (north + speed * np.cos(heading) * t, east + speed * np.sin(heading) * t)


@pytest.mark.parametrize("has_bearings", [False, True])
@pytest.mark.parametrize("kind", ["flies on", "turns", "stands"])
def test_a_true_gap_remains_a_gap(kind, has_bearings):
    for seed in range(60):
        rng = np.random.default_rng(seed)
        scan_s, noise_m, size_s = rng.choice([1.0, 4.0, 10.0]), rng.choice([0.0, 30.0]), rng.uniform(2, 3600)
        t = scan_s * np.arange(2 * N)
        t[N:] += scan_s * round(size_s / scan_s)
        places = np.stack(true_course(kind, rng)(t), axis=1)
        places = places if has_bearings else np.linalg.norm(places, axis=1)[:, None]
        places = places + rng.normal(0, noise_m, places.shape)
        assert find_set_forward(t, places, [np.arange(2 * N)]) is None, seed


def test_a_gap_of_one_of_several_targets_is_no_clock(tmp_path):
    """Though it goes on from where it was, while others are seen."""
    rows = [(FIRST_S + 5 * k + 400 * (number == 0 and k >= 20), number, 30_000 + 950 * k) for k in range(120)
            for number in range(2)]  # fmt: skip
    text = "time,track,range_m\n" + "".join(f"{t},{number},{r}\n" for t, number, r in rows)
    done, _, _ = imported(tmp_path, text.encode())
    assert not any("the clock" in note for note in done.notes)


@pytest.mark.parametrize("gap_row", [19_990, 20_000, 20_010])
def test_a_step_is_found_where_batches_of_rows_meet(tmp_path, gap_row):
    times = 1.0 * np.arange(20_100)
    ranges = 30_000 + 5 * times
    recorded = FIRST_S + times + 3600.0 * (np.arange(times.size) >= gap_row)
    text = "time,track,range_m\n" + "".join(f"{t:.0f},7,{r:.2f}\n" for t, r in zip(recorded, ranges, strict=True))
    done, columns, _ = imported(tmp_path, text.encode())
    np.testing.assert_array_equal(columns["t_s"], times)
    assert done.notes[0].startswith("the clock was set forward by an hour")


def clock_text(t):
    return f"{t // 3600 % 24:02}{t // 60 % 60:02}{t % 60:02}"


def nmea(times):
    body = "GPRMC,{}.00,A,{:09.4f},N,00445.6000,E,300.0,0.0,{},,,A"
    days = ["141123" if t >= 86_400 else "131123" for t in times]
    return "".join(sentence(body.format(clock_text(t), 5230 + k / 2, day))
                   for k, (t, day) in enumerate(zip(times, days, strict=True))).encode()  # fmt: skip


def gpx(times):
    point = '<trkpt lat="{:.5f}" lon="4.76"><time>2023-11-14T{}Z</time></trkpt>'
    stamps = (f"{t // 3600:02}:{t // 60 % 60:02}:{t % 60:02}" for t in times)
    points = "".join(point.format(52.5 + k / 100, stamp) for k, stamp in enumerate(stamps))
    return f'<gpx xmlns="http://x/1/1"><trk><name>own</name><trkseg>{points}</trkseg></trk></gpx>'.encode()


def basestation(times):
    line = "MSG,3,1,1,4CA1FA,1,2023/11/14,{0}.000,2023/11/14,{0}.000,,30000,,,{1:.5f},4.76000,,,0,0,0,0\n"
    stamps = (f"{t // 3600:02}:{t // 60 % 60:02}:{t % 60:02}" for t in times)
    return "".join(line.format(stamp, 52.5 + k / 100) for k, stamp in enumerate(stamps)).encode()


def asterix(times):
    return block(48, *(plot_048(t, 12_800 + 26 * k, track=5) for k, t in enumerate(times)))


@pytest.mark.parametrize("write", [nmea, gpx, basestation, asterix])
@pytest.mark.parametrize("size_s", [5, 18, 3600, -18, -3600])
def test_every_format_has_clocks(tmp_path, write, size_s):
    times = set_back([50_000 + 5 * k for k in range(N)], size_s)
    done, columns, tracks = imported(tmp_path, write(times), AT)
    assert len(set(tracks)) == 1  # though a radar gives a number to another aircraft after a minute
    assert not any("to another aircraft" in note for note in done.notes)
    np.testing.assert_array_equal(columns["t_s"], 5.0 * np.arange(N))
    expected = {
        3600: "times fall by an hour",
        -3600: "the clock was set forward by an hour",
        -18: "the clock was set forward by 18 s",
    }.get(size_s, f"the clock was set back by {size_s} s")
    assert sum(note.startswith(expected) for note in done.notes) == 1
