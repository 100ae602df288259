"""Recorded plots: what is read, what is refused and where, what is written."""

import os
import stat

import numpy as np
import pytest

from radarsim.errors import ConfigError, StoreError
from radarsim.recordings import csv_output, read_plots
from radarsim.report.atomic_files import OutputFile
from radarsim.studies.recording_interface import Track
from tests.recordings import plot_files

CHOICES = (("t_s", "range_m", "bearing_rad"), ("t_s", "x_m", "y_m"))


def read(tmp_path, text):
    path = tmp_path / "plots.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return plot_files.read(path, CHOICES)


def faults(tmp_path, text):
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, text)
    return [line.replace(f"{tmp_path}/", "") for line in caught.value.lines]


def test_columns_in_any_order_unknown_ones_ignored_empty_cells_missing(tmp_path):
    columns = read(tmp_path, "\ufeffnote,bearing_rad,t_s,range_m\nfirst,0.5,0,1e3\n,,2.5,990\n\nlast,0.4,3,\n")
    assert list(columns) == ["t_s", "range_m", "bearing_rad"]
    np.testing.assert_array_equal(columns["t_s"], [0, 2.5, 3])
    np.testing.assert_array_equal(columns["range_m"], [1000, 990, np.nan])
    np.testing.assert_array_equal(columns["bearing_rad"], [0.5, np.nan, 0.4])


def test_the_second_choice_of_columns(tmp_path):
    assert list(read(tmp_path, "y_m,x_m,t_s\n1,2,3\n")) == ["t_s", "x_m", "y_m"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "plots.csv:1: must have the columns t_s, range_m, bearing_rad or t_s, x_m, y_m; got nothing"),
        (
            "t_s,x_m\n",
            "plots.csv:1: must have the columns t_s, range_m, bearing_rad or t_s, x_m, y_m; got t_s, x_m"
            "; ranges and positions with other names, separators or units: radarsim import plots.csv -o imported.csv",
        ),
        ("t_s,x_m,y_m\n", "plots.csv: has no rows"),
        ("t_s,x_m,y_m,x_m\n", "plots.csv:1: the column x_m is there twice"),
        ("t_s,x_m,y_m\n0,1,2\n1,abc,2\n", "plots.csv:3:2: x_m: must be a finite number, got 'abc'"),
        ("t_s,x_m,y_m\n0,1,inf\n", "plots.csv:2:3: y_m: must be a finite number, got 'inf'"),
        ("t_s,x_m,y_m\n0,1,nan\n", "plots.csv:2:3: y_m: must be a finite number, got 'nan'"),
        ("t_s,x_m,y_m\n0,1_0,1\n", "plots.csv:2:2: x_m: must be a finite number, got '1_0'"),
        ("t_s,x_m,y_m\n,1,1\n", "plots.csv:2:1: t_s: must be a finite number, got ''"),
        ("t_s,x_m,y_m\n0,1\n", "plots.csv:2: must have 3 cells as the header, got 2"),
        ("t_s,x_m,y_m\n0,1,1\n2,1,1\n1,1,1\n", "plots.csv:4:1: t_s: must be later than the row before, got 1 after 2"),
        ("t_s,x_m,y_m\n5,1,1\n5,1,1\n", "plots.csv:3:1: t_s: must be later than the row before, got 5 after 5"),
        ('t_s,x_m,y_m\n0,"1,1\n', "plots.csv:2: not a CSV row: unexpected end of data"),
        ("t_s,x_m,y_m\n0,,\n1,,\n", "plots.csv: has no measured value in x_m, y_m"),
        (
            "t_s,range_m,bearing_rad\n0,100,45\n",
            "plots.csv:2:3: bearing_rad: must be in radians, from -2 pi to 2 pi, got 45",
        ),
        (
            "t_s,range_m,bearing_rad\n0,-100,1\n",
            "plots.csv:2:2: range_m: must be > 0, got -100; plots without a range are left out by radarsim import "
            "plots.csv -o imported.csv",
        ),
        (
            b"t_s,x_m,y_m\n0,\xff,1\n",
            "plots.csv: is not UTF-8 text; other recordings: radarsim import plots.csv -o imported.csv",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, text, expected):
    assert faults(tmp_path, text) == [expected]


IMPORT = "radarsim import plots.csv -o imported.csv"


@pytest.mark.parametrize("chunk", [3, read_plots.CHUNK_ROWS])
def test_equal_faults_are_one_line_with_their_cure(tmp_path, chunk):
    rows = ["10:00,1,45", "1,b,1", "10:00,-1,45", "2,1", "1,1,1", "10:00,1,45", "10:00,1,45", "10:00,c,1", "0,1,1"]
    path = tmp_path / "plots.csv"
    path.write_text("t_s,range_m,bearing_rad\n" + "\n".join(rows))
    with pytest.raises(ConfigError) as caught:
        list(read_plots.pieces(path, CHOICES, chunk))
    assert sorted(line.replace(f"{tmp_path}/", "") for line in caught.value.lines) == [
        f"plots.csv:2:1: t_s: must be a finite number, got '10:00' (and 4 more, in lines 4, 7, 8, …); for times of "
        f"day, dates, and lines that are no rows, {IMPORT}",
        f"plots.csv:2:3: bearing_rad: must be in radians, from -2 pi to 2 pi, got 45 (and 3 more, in lines 4, 7, 8); "
        f"if these are degrees, name it bearing_deg and {IMPORT}",
        f"plots.csv:3:2: range_m: must be a finite number, got 'b' (and 1 more, in line 9); for cells that stand for "
        f"none, {IMPORT}",
        f"plots.csv:4:2: range_m: must be > 0, got -1; plots without a range are left out by {IMPORT}",
        "plots.csv:5: must have 3 cells as the header, got 2; comments, cut lines and empty cells at the end are left "
        f"out by {IMPORT}",
    ]


def test_times_that_do_not_rise_may_be_of_several_tracks(tmp_path):
    assert faults(tmp_path, "t_s,x_m,y_m\n" + "0,1,1\n4,1,1\n" * 1000) == [
        "plots.csv:4:1: t_s: must be later than the row before, got 0 after 4 (and 998 more, in lines 6, 8, 10, …); "
        "if there are several tracks, name their column track"
    ]
    (line,) = faults(tmp_path, "t_s,x_m,y_m\n" + "0,1,1\n4,1,1\n4,2,2\n4,3,3\n")
    assert "got 4 after 4 (and 1 more, in line 5); of several plots of a scan keep that of the target" in line
    (line,) = faults(tmp_path, "t_s,track,range_m,bearing_rad\n" + "".join(f"{t},a,5,1\n" for t in (8, 4, 0)))
    assert line.endswith(f"got 4 after 8 in track a (and 1 more, in line 4); rows are sorted by {IMPORT}")


def test_a_missing_file(tmp_path):
    with pytest.raises(ConfigError, match=r"nothing\.csv: cannot be read: No such file"):
        plot_files.read(tmp_path / "nothing.csv", CHOICES)


def test_a_track_is_written_row_by_row(tmp_path):
    nan = np.nan
    track = Track(
        filters=("one", "two"),
        components=(("r", "m"), ("vr", "m/s")),
        t_s=np.array([0.0, 1.5]),
        estimate=np.array([[[1.0, nan], [2.0, 0.1]], [[nan, nan], [3.0, 0.3]]]),
        sigma=np.array([[[0.5, nan], [0.25, 1.0]], [[nan, nan], [0.125, 2.0]]]),
        probability=np.array([[[0.25, 0.75], [0.5, 0.5]], [[1.0, nan], [1.0, nan]]]),
    )
    path = tmp_path / "track.csv"
    plot_files.write(track, path)
    assert path.read_text() == (
        "t_s,filter,component,unit,estimate,sigma,probability_1,probability_2\n"
        "0.0,one,r,m,1.0,0.5,0.25,0.75\n"
        "1.5,one,r,m,2.0,0.25,0.5,0.5\n"
        "1.5,one,vr,m/s,0.1,1.0,0.5,0.5\n"
        "1.5,two,r,m,3.0,0.125,1.0,\n"
        "1.5,two,vr,m/s,0.3,2.0,1.0,\n"
    )
    assert [file.name for file in tmp_path.iterdir()] == ["track.csv"]


def test_an_unwritable_place(tmp_path):
    track = Track(("one",), (("r", "m"),), np.zeros(1), np.zeros((1, 1, 1)), np.ones((1, 1, 1)))
    with pytest.raises(StoreError, match="cannot be written"):
        plot_files.write(track, tmp_path / "no folder" / "track.csv")


def test_intervals_that_no_filter_can_take_are_a_fault_of_the_file(tmp_path, monkeypatch):
    from numpy.linalg import LinAlgError

    from radarsim.api import load_experiments
    from radarsim.recordings import study_part

    path = tmp_path / "plots.csv"
    path.write_text("t_s,range_m,bearing_rad\n0,9000,1\n1e-6,9000,1\n1e7,9000,1\n")
    (config,) = load_experiments.load_all(["sonar_smoothing"])
    with pytest.raises(ConfigError, match=r"plots\.csv:4: t_s: after a gap of 1e\+07 s .* split the file here"):
        plot_files.track(config, path)

    def without_solution(tracker, columns):
        raise LinAlgError

    monkeypatch.setattr(
        type(study_part.recording_interface(config.cases[0]).tracker(config.cases[0])), "feed", without_solution
    )
    with pytest.raises(ConfigError, match=r"plots\.csv: t_s: intervals so different"):
        plot_files.track(config, path)


def test_an_existing_file_keeps_its_mode_and_a_new_one_heeds_the_umask(tmp_path):
    old, new = tmp_path / "old.csv", tmp_path / "new.csv"
    old.write_text("before")
    old.chmod(0o640)
    mask = os.umask(0o077)
    try:
        for path in (old, new):
            csv_output.write_columns({"t_s": np.zeros(1)}, path)
    finally:
        os.umask(mask)
    assert [stat.S_IMODE(path.stat().st_mode) for path in (old, new)] == [0o640, 0o600]


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real.csv").write_text("before")
    (tmp_path / "link.csv").symlink_to("real.csv")
    csv_output.write_columns({"t_s": np.zeros(1)}, tmp_path / "link.csv")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "t_s\n0.0\n"


def test_a_stream_is_written_through_and_stays(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    csv_output.write_columns({"t_s": np.zeros(1)}, pipe)
    assert os.read(reader, 100) == b"t_s\n0.0\n"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    csv_output.write_columns({"t_s": np.zeros(1)}, "/dev/null")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="must be a file, got a directory"):
        csv_output.write_columns({"t_s": np.zeros(1)}, tmp_path)


def test_a_fault_on_the_way_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("before")

    def interrupted():
        with OutputFile(path) as file:
            file.write([("half",)])
            raise RuntimeError

    with pytest.raises(RuntimeError):
        interrupted()
    assert {one.name: one.read_text() for one in tmp_path.iterdir()} == {"track.csv": "before"}


@pytest.mark.parametrize("name", ["plots.csv", "link.csv", "./plots.csv"])
def test_the_recorded_plots_are_never_the_output(tmp_path, name):
    source = tmp_path / "plots.csv"
    source.write_text("before")
    (tmp_path / "link.csv").symlink_to("plots.csv")
    with pytest.raises(ConfigError, match="must be another file than the plots"):
        OutputFile(tmp_path / name, {"the plots": source})
    assert source.read_text() == "before"
