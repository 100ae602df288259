"""radarsim from Python, as the contract promises it."""

import copy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import radarsim

CONFIG = {
    "study": "range_doppler",
    "radar": {"wavelength_m": 0.15, "sigma_range_m": 250, "sigma_velocity_mps": 15, "scan_period_s": 10},
    "target": {"kind": "polynomial", "coefficients": [100e3, -250, 4]},
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
    ],
    "scans": 15,
    "realisations": 4000,
}


def test_runs_a_path_and_writes_nothing(tmp_path, monkeypatch):
    config = Path("configs/rls2.yaml").resolve()
    monkeypatch.chdir(tmp_path)
    result = radarsim.run(config, realisations=1e4)
    assert list(result.gains.columns)[:2] == ["case", "filter"]
    assert set(result.curves["n"]) == {10_000}
    assert not list(tmp_path.iterdir())


def test_runs_a_dict_and_leaves_it_alone():
    before = copy.deepcopy(CONFIG)
    result = radarsim.run(CONFIG)
    assert before == CONFIG
    assert set(result.curves["case"]) == {"config"}


def test_the_same_numbers_with_and_without_a_store(tmp_path):
    one, other = radarsim.run(CONFIG), radarsim.run(CONFIG, out=tmp_path, figures=False, threads=1)
    np.testing.assert_array_equal(one.curves["sigma"], other.curves["sigma"])
    assert (tmp_path / "config" / "curves.csv").exists()


def test_a_table_alone_is_a_copy_as_in_all_of_them():
    result = radarsim.run(CONFIG)
    for name, table in result.tables.items():
        pd.testing.assert_frame_equal(result.table(name), table)
        assert result.table(name).attrs == table.attrs
    curves = result.table("curves")
    curves["sigma"] = 0.0
    assert (result.curves["sigma"] > 0).all()


def test_figures_by_the_names_of_their_files():
    from matplotlib.figure import Figure

    result = radarsim.run(CONFIG)
    assert isinstance(result.figure("gain_r"), Figure)
    assert {"sigma_r", "sigma_Vr", "sigma_ar", "gain_r", "gain_Vr", "gain_ar"} <= set(result.figures)
    with pytest.raises(KeyError, match="gain_r"):
        result.figure("gain_x")


@pytest.mark.parametrize(("config", "overrides", "n"), [("rls2", [], 1), ("multimodel_1hz", ["report_every=40"], 2)])
def test_one_or_two_realisations_make_no_numeric_warning(config, overrides, n):
    """Here any warning is an error: intervals are infinite, and no word of NumPy's reaches the user."""
    result = radarsim.run(config, realisations=n, overrides=overrides)
    assert f"intervals from {n} realisation{'s' * (n > 1)} are rough" in result.warnings[-1]
    assert all("no filter" not in line for line in result.warnings)


def test_load_gives_what_was_run_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ran = radarsim.run("rls2", realisations=3000, out="results", figures=False)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
    loaded = radarsim.load("rls2")
    assert loaded.curves.equals(ran.curves)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()} == before
    with pytest.raises(radarsim.ConfigError, match="radarsim run rls3"):
        radarsim.load("rls3")


def test_a_notebook_shows_the_answer_and_no_markup_of_a_users():
    hostile = copy.deepcopy(CONFIG)
    hostile["filters"][1]["name"] = "<script>x</script>"
    shown = radarsim.run(hostile)._repr_html_()
    assert "<script" not in shown
    assert "&lt;script&gt;" in shown
    assert "lower than with range alone" in shown
    assert "exact_sigma" in shown


@pytest.mark.slow
def test_a_value_that_is_not_known_stays_empty_in_a_notebook():
    result = radarsim.run("sonar_missed", realisations=20)
    assert result.last_scan["exact_sigma"].isna().any()
    assert ">NaN<" not in result._repr_html_()


def test_range_alone_is_named_where_one_filter_alone_has_no_more():
    own = {"observes": ["range"], "manoeuvre_variance": 1.0}
    two = CONFIG | {"filters": [*CONFIG["filters"], own | {"name": "slow r"}]}
    assert "than with filter r" in radarsim.run(two, realisations=200).answer[0]
    assert "than with range alone" in radarsim.run(CONFIG, realisations=200).answer[0]
