"""`radarsim simulate --realisations`: what its files hold, and that they are there whole or not at all."""

import csv

import numpy as np
import pytest

import radarsim
from radarsim.api import load_experiments
from radarsim.recordings import bulk_plots
from tests.program import command

CLUTTER = "sweep.sensor.false_plots_per_km2=[0.03]"


@pytest.fixture
def small(monkeypatch):
    """Batches of eight, so that a few realisations are several."""
    monkeypatch.setattr(bulk_plots, "NUMBERS_PER_DRAW", 1)


@pytest.mark.parametrize(("config", "overrides"), [("rls2", ()), ("sonar_clutter", (CLUTTER,))])
def test_arrays_are_those_of_python(tmp_path, small, config, overrides):
    changes = [word for one in overrides for word in ("--set", one)]
    told = command("simulate", config, "--realisations", "5:25", "-o", tmp_path / "plots.npz", *changes).stdout
    assert "20 realisations" in told
    made = radarsim.plots(config, 20, 5, overrides)
    with np.load(tmp_path / "plots.npz") as file:
        found = dict(file)
    assert set(found) == {"realisation", "t_s", "seed", *made.arrays()}
    assert (found["seed"].shape, int(found["seed"])) == ((), made.seed)
    np.testing.assert_array_equal(found["realisation"], np.arange(5, 25))
    np.testing.assert_array_equal(found["t_s"], made.t_s)
    for name, array in made.arrays().items():
        np.testing.assert_array_equal(np.broadcast_to(found[name], array.shape), array)
    assert found["true_r_m"].shape[0] == 1  # the same in all


@pytest.mark.parametrize(("config", "overrides"), [("rls2", ()), ("sonar_clutter", (CLUTTER,))])
def test_rows_of_a_table_are_those_of_one_realisation_after_the_other(tmp_path, small, config, overrides):
    changes = [word for one in overrides for word in ("--set", one)]
    command("simulate", config, "--realisations", "5:25", "-o", tmp_path / "all.csv", *changes)
    with (tmp_path / "all.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    for i in (5, 13, 24):
        command("simulate", config, "-i", i, "-o", tmp_path / "one.csv", *changes)
        with (tmp_path / "one.csv").open(newline="") as file:
            assert [header[1:], *(row[1:] for row in rows if row[0] == str(i))] == list(csv.reader(file))


def test_parquet_has_the_same_rows_or_says_what_it_needs(tmp_path, small):
    words = "simulate", "rls2", "--realisations", "5:25", "-o", tmp_path / "plots.parquet"
    try:
        from pyarrow import parquet
    except ImportError:
        assert "Parquet needs pyarrow (pip install 'radarsim[parquet]')" in command(*words, code=2).stderr
        assert not any(tmp_path.iterdir())
        return
    command(*words)
    found = parquet.read_table(tmp_path / "plots.parquet").to_pydict()
    for name, column in radarsim.plots("rls2", 20, 5).table().items():
        np.testing.assert_array_equal(found[name], column)


@pytest.mark.parametrize("name", ["plots.npz", "plots.csv"])
def test_what_is_stopped_leaves_what_was_there(tmp_path, small, name):
    (tmp_path / name).write_text("mine")

    def stopped(done, total):
        if done > 8:
            raise KeyboardInterrupt

    (loaded,) = load_experiments.load_all(["rls2"], ())
    with pytest.raises(KeyboardInterrupt):
        bulk_plots.write_realisations(loaded, 40, 0, tmp_path / name, stopped)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, "mine")]


@pytest.mark.parametrize("given", ["5:5", "7:3", "5", ":", "a:b", "-1:3", "1.5:3"])
def test_what_are_no_realisations_is_refused(tmp_path, given):
    fault = command("simulate", "rls2", f"--realisations={given}", "-o", tmp_path / "x.npz", code=2).stderr
    assert f"must be FIRST:STOP with FIRST < STOP, such as 0:1000, got {given!r}" in fault


def test_misuse_is_told(tmp_path):
    out = "-o", tmp_path / "x.npz"
    assert "do not go together" in command("simulate", "rls2", "-i", 3, "--realisations", "0:5", *out, code=2).stderr
    fault = command("simulate", "rls2", "--realisations", "0:1e13", *out, code=2).stderr
    assert fault.startswith("--realisations: STOP: must be at most 1000000000000, got 10000000000000")
    fault = command("simulate", "range_doppler", "--realisations", "0:5", *out, code=2).stderr
    assert "must be one case to simulate, got 30; choose one of rls1" in fault
    assert not any(tmp_path.iterdir())
