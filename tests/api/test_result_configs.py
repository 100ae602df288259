"""config.yaml of a result: complete, in the user's words, without paths of the machine, and enough to run it again."""

import html
import shutil
from pathlib import Path

import pytest
import yaml

import radarsim
from radarsim.api import configs
from radarsim.api.result_config import config_files, config_text
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.errors import ConfigError
from tests.program import command, csv_bytes, record

N = 2000
MINE = """\
study: range_doppler
radar: {name: mine, band: X, wavelength_m: 0.032, sigma_range_m: 15, sigma_velocity_mps: 0.8, scan_period_s: 2.5}
target: near
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: r+Vr, observes: [range, velocity], manoeuvre_variance: 1e-3}
scans: 12
realisations: 2000
"""
NEAR = "{kind: polynomial, coefficients: [8e3, -12]}\n"
BOAT = """\
include: [mine]
target: {kind: turn, range_m: 8e3, speed_mps: 12, aspect_deg: 180, start_s: 10, acceleration_g: 0.2, duration_s: 18}
sweep: {manoeuvre_variance: [1e-3, 1e-1]}
"""
SCENES = """\
include: [mine]
sweep: {target: [near, turn], radar.name: ["1e5", "a: b #c"]}
seed: 7
"""
CODE = """\
from pathlib import Path


def echo(plots, order=1, table=""):
    return plots["range_m"] * float(Path(table).read_text())
"""


@pytest.fixture(params=["boat", "scenes"])
def config(request, tmp_path):
    """A config that includes another, which names a scenario beside it."""
    folder = tmp_path / "author"
    folder.mkdir()
    for name, text in (("mine", MINE), ("near", NEAR), ("boat", BOAT), ("scenes", SCENES)):
        (folder / f"{name}.yaml").write_text(text)
    return folder / f"{request.param}.yaml"


def files_of(folder):
    """The bytes of a result but for what says when and how it was computed."""
    files = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return {name: data for name, data in files.items() if name.name not in ("run.json", "report.html")}


def test_a_result_is_computed_again_from_its_folder_alone(config, tmp_path, monkeypatch):
    drawn = config.stem == "boat"
    overrides = ["radar.sigma_range_m=20", "figures=[sigma_r]"]
    ran = radarsim.run(config, overrides=overrides, seed=5, out=tmp_path / "out", figures=drawn)
    moved = tmp_path / "elsewhere" / "a folder"
    shutil.copytree(ran.written.folder, moved)
    shutil.rmtree(config.parent)
    monkeypatch.chdir(moved.parent)
    options = [] if drawn else ["--no-figures"]
    command("run", "a folder", "--out", "one", "-q", *options)
    command("run", Path("a folder", CONFIG_FILE), "--out", "other", "-q", *options)
    assert files_of(Path("one", config.stem)) == files_of(Path("other", config.stem)) == files_of(moved)
    assert record(Path("one", config.stem))["identities"] == record(moved)["identities"]


def test_no_file_of_a_result_names_folders_of_the_author(config, tmp_path):
    ran = radarsim.run(config, overrides=["figures=[sigma_r]"], out=tmp_path / "out", figures=config.stem == "boat")
    for path in ran.written.folder.rglob("*"):
        assert path.is_dir() or str(tmp_path).encode() not in path.read_bytes(), path


def test_the_report_shows_the_config(config, tmp_path):
    ran = radarsim.run(config, out=tmp_path, figures=False)
    text = (ran.written.folder / CONFIG_FILE).read_text()
    assert text == ran.config
    assert text in html.unescape((ran.written.folder / "report.html").read_text())


@pytest.mark.parametrize("stem", ["rls2", "range_doppler", "multimodel_trajectories", "discriminator_maps", "orders"])
def test_a_shipped_config_reads_back_as_itself(stem, tmp_path):
    experiment = configs.load(stem)
    (tmp_path / CONFIG_FILE).write_text(config_text(experiment))
    again = configs.load(tmp_path)
    assert (again.resolved, again.seed, again.realisations) == (
        experiment.resolved,
        experiment.seed,
        experiment.realisations,
    )
    assert [case.swept_values for case in again.cases] == [case.swept_values for case in experiment.cases]
    assert configs.shipped_stem(again) == stem
    assert config_text(again) == config_text(experiment)


def test_values_keep_the_words_and_units_of_the_user(tmp_path):
    boat = {"kind": "turn", "range_m": 8e3, "speed_mps": 12, "aspect_deg": 180, "start_s": 10, "acceleration_g": 0.2}
    keys = yaml.safe_load(MINE.replace("1e-3", "0.001")) | {"target": {**boat, "duration_s": 18}}
    text = yaml.safe_load(config_text(configs.load(keys)))
    assert text["target"]["aspect_deg"] == 180
    assert text["radar"] == keys["radar"]
    assert text["filters"] == keys["filters"]


def test_data_files_go_with_the_config(tmp_path, monkeypatch):
    ran = radarsim.run("multimodel_recorded", realisations=20, out=tmp_path / "out", figures=False)
    assert (ran.written.folder / "recorded.csv").is_file()
    shutil.copytree(ran.written.folder, tmp_path / "copy")
    again = radarsim.run(tmp_path / "copy", out=tmp_path / "again", figures=False)
    assert csv_bytes(again.written.folder) == csv_bytes(ran.written.folder)
    assert "recorded" not in radarsim.load(tmp_path / "copy").tables


@pytest.mark.parametrize("written", ["curves.csv", "../tracks/curves.csv", "/absolute"])
def test_a_data_file_takes_the_place_of_no_table(written, tmp_path):
    track = (configs.find_files.SHIPPED / "scenarios" / "recorded.csv").read_bytes()
    (tmp_path / "tracks").mkdir()
    place = tmp_path / "tracks" / "curves.csv" if written.startswith(("/", "..")) else tmp_path / "home" / written
    place.parent.mkdir(exist_ok=True)
    place.write_bytes(track)
    named = str(place) if written.startswith("/") else written
    (tmp_path / "home").mkdir(exist_ok=True)
    (tmp_path / "home" / "flight.yaml").write_text(f"include: [multimodel_recorded]\ntarget: {{file: '{named}'}}\n")
    experiment = configs.load(tmp_path / "home" / "flight.yaml")
    files = config_files(experiment, taken_paths=["curves.csv"])
    assert files["inputs/curves.csv"] == track
    assert str(tmp_path) not in files[CONFIG_FILE].decode()


def test_user_filters_are_named_by_the_hash_of_their_code(tmp_path, monkeypatch):
    author, referee = tmp_path / "author", tmp_path / "referee"
    author.mkdir()
    (author / "mine.py").write_text(CODE)
    (author / "table.txt").write_text("1.0")
    keys = MINE.replace("near", "{kind: polynomial, coefficients: [8e3, -12]}")
    own = "  - {name: own, python: mine.py:echo, order: 100000, table: table.txt}\n"
    (author / "own.yaml").write_text(keys.replace("scans:", f"{own}scans:"))
    ran = radarsim.run(author / "own.yaml", out=tmp_path / "out", figures=False)
    shutil.copytree(ran.written.folder, referee / "own")
    monkeypatch.chdir(referee)
    with pytest.raises(ConfigError, match=r"neither beside this file nor in the working directory: mine\.py:echo"):
        radarsim.run("own")
    for name in ("mine.py", "table.txt"):
        shutil.copy(author / name, referee)
    again = radarsim.run("own", out="again", figures=False)
    assert csv_bytes(again.written.folder) == csv_bytes(ran.written.folder)
    assert record(again.written.folder)["identities"] == record(ran.written.folder)["identities"]
    (referee / "mine.py").write_text(CODE.replace("* float", "+ float"))
    with pytest.raises(ConfigError, match="is other code than that of the result"):
        radarsim.run("own")


def test_cases_of_different_numbers_keep_them(tmp_path):
    ran = radarsim.run("range_doppler", realisations=64_000, precision=3, out=tmp_path, figures=False)
    counts = {case.name: case.count for case in ran.cases}
    again = radarsim.run(ran.written.folder, out=tmp_path / "again", figures=False)
    assert {case.name: case.count for case in again.cases} == counts
    assert csv_bytes(again.written.folder) == csv_bytes(ran.written.folder)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("include: [{study: range_doppler}]\n", "include.0: needs a name"),
        ("include: [{name: a, include: [3]}]\n", "include.0"),
        ("name: a/b\ninclude: [rls2]\n", "name: must be of letters"),
        ("name: index.html\ninclude: [rls2]\n", "name: a config must have another name"),
        ("include: [rls2]\nrealisations: {rls3: 100}\n", "realisations.rls3: no case has this name; did you mean rls2"),
        ("include: [rls2]\nrealisations: {rls2: 0}\n", "realisations"),
        ("include: [rls2]\nscenarios: {here: 3}\n", "scenarios.here"),
    ],
)
def test_faults_name_their_place(content, fault, tmp_path):
    (tmp_path / "bad.yaml").write_text(content)
    with pytest.raises(ConfigError) as caught:
        configs.load(tmp_path / "bad.yaml")
    assert fault in str(caught.value)
    assert "bad.yaml:" in str(caught.value)


def test_a_folder_without_config_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"is a directory without config.yaml, so no result"):
        configs.load(tmp_path)
    (tmp_path / "run.json").touch()
    with pytest.raises(ConfigError, match=r"is a result without config.yaml, as earlier versions wrote"):
        configs.load(tmp_path)
