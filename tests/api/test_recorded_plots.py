"""Recorded plots from Python: the same as the commands give, from a table or from a file."""

import pandas as pd
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.recordings import csv_output, simulate_plots


@pytest.fixture(scope="module")
def table():
    return radarsim.simulate("rls2", 2, ["scans=40"])


def test_simulate_gives_the_plots_of_the_command(table):
    config = load("rls2", ["scans=40"])
    for name, column in simulate_plots.simulate_realisation(config, 2).items():
        assert (table[name] == column).all()


def test_a_table_is_tracked_and_fitted_as_its_file_is(table, tmp_path):
    path = tmp_path / "plots.csv"
    csv_output.write_columns({name: table[name].to_numpy() for name in table}, path)
    pd.testing.assert_frame_equal(radarsim.read_plots(path), table)
    for act in (radarsim.track, radarsim.fit):
        pd.testing.assert_frame_equal(act("rls2", table), act("rls2", path))


def test_several_tracks_keep_their_names(table):
    both = pd.concat([table.assign(track="a"), table.assign(track="b")])
    found = radarsim.track("rls2", both)
    alone = radarsim.track("rls2", table)
    for name in ("a", "b"):
        own = found[found["recorded_track"] == name].drop(columns="recorded_track").reset_index(drop=True)
        pd.testing.assert_frame_equal(own, alone)


def test_faults_are_those_of_the_command(table, tmp_path):
    with pytest.raises(radarsim.ConfigError, match=r"^the table:1: must have the columns t_s, range_m, velocity_mps"):
        radarsim.track("rls2", table.drop(columns="range_m"))
    with pytest.raises(radarsim.ConfigError, match="cannot be read"):
        radarsim.read_plots(tmp_path / "none.csv")
    (path := tmp_path / "plots.csv").write_text("# made\nt_s,range_m,bearing_rad\n0,1,\n1,2,unknown\n2,x,unknown\n")
    with pytest.raises(radarsim.ConfigError) as caught:
        radarsim.read_plots(path)
    assert caught.value.lines == (
        f"{path}:5:2: range_m: must be a number or empty, got 'x'",
        f"{path}:4:3: bearing_rad: must be a number or empty, got 'unknown'",
    )
