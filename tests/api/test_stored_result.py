"""`radarsim.load` of a folder, from blocks or from tables alone, and what a result gives to other programs."""

import shutil

import numpy as np
import pandas as pd
import pytest
from scipy.io import netcdf_file

import radarsim
from radarsim.api import dataset
from radarsim.errors import ConfigError, StoreError
from radarsim.report import column_units
from tests.program import command

xarray = pytest.importorskip("xarray")


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    return radarsim.run("rls2", overrides=["radar.sigma_range_m=200"], realisations=2000, out=out, figures=False)


@pytest.fixture(params=["blocks", "tables"])
def folder(ran, request, tmp_path):
    """The folder of a result, with its blocks beside it or without."""
    if request.param == "blocks":
        return ran.written.folder
    shutil.copytree(ran.written.folder, tmp_path / "moved")
    return tmp_path / "moved"


def test_a_folder_suffices(ran, folder):
    loaded = radarsim.load(folder)
    assert {name: len(table) for name, table in loaded.tables.items() if len(table)} == {
        name: len(table) for name, table in ran.tables.items() if len(table)
    }
    assert loaded.curves.equals(ran.curves)
    assert loaded.gains.equals(ran.gains)
    assert loaded.last_scan.equals(ran.last_scan)
    assert (loaded.answer, loaded.question, loaded.config) == (ran.answer, ran.question, ran.config)
    assert [(case.name, case.count) for case in loaded.cases] == [("rls2", 2000)]
    assert repr(loaded) == repr(ran)
    assert "<table" in loaded._repr_html_()


def test_a_link_of_another_name_leads_to_the_blocks(ran, tmp_path):
    (tmp_path / "latest").symlink_to(ran.written.folder)
    assert radarsim.load(tmp_path / "latest").figure("sigma_r")


def test_a_name_needs_no_overrides(ran):
    with pytest.warns(UserWarning, match="not the shipped config"):
        loaded = radarsim.load("rls2", out=ran.written.folder.parent)
    assert loaded.curves.equals(ran.curves)
    assert loaded.figure("sigma_r")


def test_a_name_is_of_the_given_directory_before_one_here(ran, tmp_path, monkeypatch):
    shutil.copytree(ran.written.folder, tmp_path / "rls2")
    monkeypatch.chdir(tmp_path)
    out = ran.written.folder.parent
    with pytest.warns(UserWarning, match=rf"rls2 is the result in {out}/rls2, not \./rls2 and the shipped config"):
        assert radarsim.load("rls2", out=out).figure("sigma_r")
    assert radarsim.load("./rls2", out=out).figures == ()
    with pytest.warns(UserWarning, match="rls2 is the result in rls2, not the shipped config"):
        assert radarsim.load("rls2").figures == ()


def test_every_reader_takes_the_same_result_of_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder, sigma in (("results", 100), (".", 200)):
        command(
            "run", "rls2", "--set", f"radar.sigma_range_m={sigma}", "-n", 500, "--out", folder, "-q", "--no-figures"
        )
    words = "rls2 is the result in results/rls2, not ./rls2"
    both = f"note: {words} and the shipped config\n"
    assert command("report", "rls2", "--no-figures").stderr == both
    assert command("export", "rls2", "--netcdf", "a.nc").stderr == both
    assert words in command("compare", "rls2", "./rls2", "--no-figures").stderr
    assert "sigma_range_m: 100" in radarsim.load("results/rls2").config
    assert command("report", "./rls2", "--out", ".", "--no-figures").stderr == ""
    assert "sigma_range_m: 200" in radarsim.load("./rls2").config


def test_without_blocks_figures_and_writing_say_what_they_need(ran, tmp_path):
    shutil.copytree(ran.written.folder, tmp_path / "moved")
    loaded = radarsim.load(tmp_path / "moved")
    assert loaded.figures == ()
    with pytest.raises(ConfigError, match="figures need the stored blocks"):
        loaded.figure("sigma_r")
    with pytest.raises(ConfigError, match="copy the folder"):
        loaded.write(tmp_path)


def test_an_altered_table_is_refused(ran, tmp_path):
    shutil.copytree(ran.written.folder, tmp_path / "moved")
    with open(tmp_path / "moved" / "gains.csv", "a") as file:
        file.write("\n")
    with pytest.raises(StoreError, match="altered since it was written"):
        radarsim.load(tmp_path / "moved").gains  # noqa: B018


def test_tables_say_their_units_seed_and_config(folder):
    attributes = radarsim.load(folder).gains.attrs
    percentages = ("gain_percent", "gain_lo", "gain_hi", "exact_percent")
    assert attributes["units"] == {"t_s": "s", **dict.fromkeys(percentages, "%")}
    assert attributes["seed"] == 2017
    assert "sigma_range_m: 200" in attributes["config"]


def test_a_dataset_has_the_numbers_of_the_tables(ran, folder):
    dataset = radarsim.load(folder).to_xarray()
    for row in ran.curves.sample(20, random_state=1).to_dict("records"):
        cell = dataset.sel({name: row[name] for name in ("case", "filter", "component", "k")})
        assert float(cell["sigma"]) == row["sigma"]
        assert (float(cell["t_s"]), str(cell["unit"].values)) == (row["t_s"], row["unit"])
    assert dataset["gain_percent"].attrs == {"units": "%"}
    assert dataset.attrs["seed"] == "2017"
    assert dataset["gain_percent"].count() == len(ran.gains)


def test_the_netcdf_file_is_the_dataset(ran, folder, tmp_path):
    command("export", folder, "--netcdf", tmp_path / "a.nc")
    with xarray.open_dataset(tmp_path / "a.nc", engine="scipy") as read:
        xarray.testing.assert_identical(read.load().drop_attrs(), ran.to_xarray().drop_attrs())
        assert read.attrs["config"] == ran.config
    with netcdf_file(tmp_path / "a.nc", mmap=False) as file:
        assert np.array_equal(file.variables["t_s"][0], 10.0 * np.arange(15))
        assert b"".join(file.variables["unit"][1]).rstrip(b"\0") == b"m/s"


def test_export_of_nothing_says_where_it_looked(tmp_path):
    fault = command("export", "rls2", "--out", tmp_path, "--netcdf", tmp_path / "a.nc", code=2).stderr
    assert f"no result: there is no run.json in {tmp_path / 'rls2'}, nor in rls2" in fault
    assert not (tmp_path / "a.nc").exists()


@pytest.mark.slow_cases("ps")  # by the code that writes eps
@pytest.mark.parametrize("kind", ["pdf", "ps", "eps"])
def test_a_saved_figure_embeds_true_type_fonts(ran, kind, tmp_path):
    path = tmp_path / f"a.{kind}"
    ran.figure("sigma_r").savefig(path)
    data = path.read_bytes()
    assert (b"/FontType 42" if kind != "pdf" else b"/CIDFontType2") in data
    assert b"/Type3" not in data
    assert b"/FontType 3" not in data


def test_arrays_of_any_table_read_back_the_same(tmp_path):
    """Text in a column, missing values, a case without times of another, letters beyond ASCII; and no row at all."""
    curves = pd.DataFrame(
        {
            "case": ["a", "a", "β"],
            "filter": "r",
            "component": ["b", "b", "r"],
            "unit": ["rad", "rad", "m"],
            "k": [1, 2, 2],
            "t_s": [0.5, 1.0, 3.0],
            "n": [7, 7, 8],
            "sigma": [1.0, np.nan, 3.0],
            "azimuth_rad": [0.25, 0.5, np.nan],
            "looks": ["good", None, "schön"],
            "is_lost": [True, False, True],
        }
    )
    for table in (curves, curves[:0]):
        arrays = dataset.labelled_arrays(table, table[["case", "k"]][:0], {"seed": "1"})
        dataset.write_netcdf(tmp_path / "a.nc", arrays)
        with xarray.open_dataset(tmp_path / "a.nc", engine="scipy") as read:
            again, made = read.load(), dataset.to_xarray(arrays)
            xarray.testing.assert_identical(again.drop_attrs(), made.drop_attrs())
    arrays = dataset.to_xarray(dataset.labelled_arrays(curves, curves[:0], {}))
    cell = arrays.sel(case="β", filter="r", component="r", k=2)
    assert (float(cell["sigma"]), str(cell["looks"].values), float(cell["t_s"])) == (3.0, "schön", 3.0)
    assert arrays["azimuth_rad"].attrs == {"units": "rad"}
    with pytest.raises(ConfigError, match="several rows of one table are of case a, filter r, component b, k 1"):
        dataset.labelled_arrays(pd.concat([curves, curves]), curves[:0], {})


@pytest.mark.parametrize(
    ("columns", "units"),
    [
        ("unit exact_bias steady_sigma last_sigma last_sigma_lo posterior_crb", [column_units.UNIT_COLUMN] * 5),
        ("excess_over_oracle_percent excess_over_oracle_percent_lo gain_percent gain_hi", ["%"] * 4),
        ("bearing_rad bearing_rad_lo course_deg energy_db", ["rad", "rad", "°", "dB"]),
        ("k n lock_rate_3sigma right_lo nees sigma", []),
    ],
)
def test_columns_have_the_unit_of_their_name(columns, units):
    assert [*column_units.column_units(columns.split()).values()] == units
