"""Folders of results: of one config, whole files of one run, its numbers, and the command that repeats it."""

import json
import os
import subprocess
import sys
import threading
import unicodedata

import pytest

import radarsim
from radarsim.api import load_experiments, repeat_command, stored_runs
from radarsim.api.configs import load
from radarsim.api.maintenance import doctor
from radarsim.api.new_configs import write_new_config
from radarsim.config.find_files import SHIPPED
from radarsim.errors import ConfigError, StoreError
from radarsim.report import atomic_files, index_page
from tests.program import command, csv_bytes, record

TEXT = (SHIPPED / "configs" / "rls2.yaml").read_text()


def config(folder, name="mine.yaml", text=TEXT):
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("second", ["mine.yaml", "Mine.yaml"])
def test_two_configs_of_one_name_are_refused_together(tmp_path, second):
    one, other = config(tmp_path / "a"), config(tmp_path / "b", second)
    with pytest.raises(ConfigError, match="its results would overwrite those of") as caught:
        load_experiments.load_all([one, other])
    assert str(other) in str(caught.value)
    assert len(load_experiments.load_all([one, one])) == 2


def test_a_config_of_the_same_name_does_not_replace_the_results_of_another(tmp_path):
    one = config(tmp_path / "a")
    other = config(tmp_path / "b", text=TEXT.replace("sigma_range_m: 250", "sigma_range_m: 260"))
    radarsim.run(one, realisations=2000, out=tmp_path / "o", figures=False)
    with pytest.raises(ConfigError, match=r"of other settings: radar\.sigma_range_m 250, not 260"):
        radarsim.run(other, realisations=2000, out=tmp_path / "o", figures=False)
    assert not radarsim.run(other, realisations=2000, out=tmp_path / "o", figures=False, replace=True).warnings


def test_a_moved_config_of_the_same_content_is_no_other(tmp_path):
    for folder in ("a", "b"):
        ran = radarsim.run(config(tmp_path / folder), realisations=2000, out=tmp_path / "o", figures=False)
    assert not ran.warnings


def test_tables_that_were_altered_are_not_written(tmp_path):
    result = radarsim.run("rls2", realisations=2000)
    result.write(tmp_path / "before", figures=False)
    for table, column in ((result.curves, "sigma"), (result.gains, "gain_percent"), (result.tables["curves"], "bias")):
        table.loc[:, column] = -1
    result.tables.clear()
    with pytest.raises(ValueError, match="read-only"):
        result.cases[0].sums["error"][:] = 0
    result.write(tmp_path / "after", figures=False)
    for path in (tmp_path / "before" / "rls2").glob("*.csv"):
        assert (tmp_path / "after" / "rls2" / path.name).read_bytes() == path.read_bytes()
    table = result.written.tables["curves"]
    table.loc[:, "sigma"] = -1
    assert result.curves["sigma"].min() > 0


@pytest.mark.slow_cases_except("options1*")
@pytest.mark.parametrize(
    ("options", "ending"),
    [
        ({}, "rls2"),
        ({"realisations": 3000, "overrides": ["scans=12"], "seed": 5}, "rls2 --set scans=12 -n 3000 --seed 5"),
        ({"realisations": 50_000, "precision": 5}, "rls2 -n 2000"),
    ],
)
def test_the_command_of_a_result_repeats_it(tmp_path, monkeypatch, options, ending):
    monkeypatch.chdir(tmp_path)
    radarsim.run("rls2", out="results", figures=False, **options)
    told = record(tmp_path / "results" / "rls2")["command"]
    assert told == f"radarsim run {ending}"
    before = csv_bytes(tmp_path / "results" / "rls2")
    command(*told.split()[1:], "--out", "again", "--no-figures", "-q")
    assert csv_bytes(tmp_path / "again" / "rls2") == before


def test_the_command_of_a_report_is_of_what_is_reported(tmp_path):
    radarsim.run("rls2", realisations=2000, out=tmp_path, figures=False)
    stored_runs.stored_result("rls2", out=tmp_path).write(tmp_path, figures=False)
    assert record(tmp_path / "rls2")["command"] == "radarsim run rls2 -n 2000"


def test_cases_that_a_precision_ends_at_several_numbers_are_repeated_with_it():
    asked = load("rls2_manoeuvres", ["realisations=64000"])
    done = {case.name: 2000 * (1 + i) for i, case in enumerate(asked.cases)}
    told = repeat_command.repeat_command(asked, done, ["realisations=64000"], (1.3, "sigma"))
    assert told == "radarsim run rls2_manoeuvres -n 64000 --precision 1.3"
    assert repeat_command.repeat_command(
        asked, dict.fromkeys(done, 64_000), ["realisations=64000"], (1.3, "sigma")
    ).endswith("-n 64000")


@pytest.mark.slow
def test_what_no_command_repeats_says_so(tmp_path):
    looks = iter([None] * 40)
    result = radarsim.run(
        "rls2_manoeuvre_variance",
        realisations=1e6,
        threads=1,
        time_limit=lambda: next(looks, "stopped"),
        out=tmp_path,
        figures=False,
    )
    assert record(tmp_path / result.experiment.stem)["command"].startswith("none: the run was stopped")


@pytest.mark.parametrize("name", ["index.html", "INDEX.html", "README.md"])
def test_a_config_is_not_named_as_a_file_among_the_results(tmp_path, name):
    path = config(tmp_path, f"{name}.yaml")
    with pytest.raises(ConfigError, match="must have another name: there is a file of that name among the results"):
        load(path)
    with pytest.raises(ConfigError, match="must have another name"):
        write_new_config(name, "rls2", tmp_path)


def test_one_name_written_in_two_ways_is_one(tmp_path):
    composed, apart = (unicodedata.normalize(form, "é1") for form in ("NFC", "NFD"))
    text = TEXT.replace("name: r,", f"name: {composed},").replace("name: r+Vr,", f"name: {apart},")
    with pytest.raises(ConfigError, match="names must differ"):
        load(config(tmp_path / "names", text=text))
    one, other = config(tmp_path / "a", f"{composed}.yaml"), config(tmp_path / "b", f"{apart}.yaml")
    assert load(other).stem == load(one).stem == composed
    with pytest.raises(ConfigError, match="would overwrite"):
        load_experiments.load_all([one, other])


def test_a_plain_file_does_not_hide_a_config(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rls1").touch()
    assert load("rls1").stem == "rls1"
    (tmp_path / "own").write_text(TEXT)
    assert load("own").stem == "own"


def test_a_result_is_found_through_a_link_and_from_within(tmp_path, monkeypatch):
    radarsim.run("rls2", realisations=2000, out=tmp_path / "o", figures=False)
    (tmp_path / "link").symlink_to(tmp_path / "o" / "rls2")
    assert doctor.inspect_result(tmp_path / "link").pieces
    monkeypatch.chdir(tmp_path / "o" / "rls2")
    assert doctor.inspect_result(".").pieces


def test_records_of_strangers_neither_end_nor_hold_up_the_index(tmp_path):
    radarsim.run("rls2", realisations=2000, out=tmp_path, figures=False)
    strange = record(tmp_path / "rls2") | {"finished": "9999-12-31T23:59:59-14:00"}
    for name in ("year", "pipe"):
        (tmp_path / name).mkdir()
    (tmp_path / "year" / "run.json").write_text(json.dumps(strange))
    os.mkfifo(tmp_path / "pipe" / "run.json")
    os.mkfifo(tmp_path / "year" / "claims.csv")
    index_page.write_index(tmp_path)
    assert "rls2/report.html" in (tmp_path / "index.html").read_text()
    with pytest.raises(StoreError, match="is no regular file"):
        doctor.inspect_result(tmp_path / "pipe")


def test_a_pipe_in_an_outputs_place_is_refused_and_a_link_replaced(tmp_path):
    (tmp_path / "other.csv").write_text("before")
    (tmp_path / "linked.csv").symlink_to("other.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    atomic_files.replace_all(tmp_path, {"linked.csv": b"new"})
    assert (tmp_path / "other.csv").read_text() == "before"
    assert not (tmp_path / "linked.csv").is_symlink()
    with pytest.raises(StoreError, match=r"pipe\.csv: cannot be written: is no regular file"):
        atomic_files.replace_all(tmp_path, {"pipe.csv": b"new"})
    assert {path.name for path in tmp_path.iterdir()} == {"other.csv", "linked.csv", "pipe.csv"}


def test_names_that_some_file_systems_take_for_one_are_refused(tmp_path):
    with pytest.raises(StoreError, match=r"a\.csv and A\.csv are the same file"):
        atomic_files.replace_all(tmp_path, {"a.csv": b"", "A.csv": b""})
    assert not list(tmp_path.iterdir())


WRITER = """
import sys
from radarsim.report import atomic_files, provenance
for i in range(int(sys.argv[3])):
    own = f"{sys.argv[2]} {i}".encode()
    further = {f"only_{sys.argv[2]}.csv": own}
    contents = {f"{n}.csv": own for n in range(12)} | further
    record = provenance.to_json({"outputs": dict.fromkeys(contents, "")})
    atomic_files.replace_all(sys.argv[1], contents | {"run.json": record}, stale=provenance.outputs)
"""


def test_of_two_writers_of_a_folder_nothing_is_mixed(tmp_path):
    """Processes that write a folder at once; after each pair all its files are of one of them, and no others."""
    for _ in range(2):
        command = [sys.executable, "-c", WRITER, str(tmp_path)]
        running = [subprocess.Popen([*command, name, "40"]) for name in ("a", "b")]
        assert [process.wait(timeout=120) for process in running] == [0, 0]
        found = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
        assert len(set(found.values()) - {found.pop("run.json")}) == 1
        assert len(found) == 13


def test_a_reader_under_the_lock_meets_one_writer(tmp_path):
    def write(name, times=60):
        for i in range(times):
            atomic_files.replace_all(tmp_path, {f"{n}.csv": f"{name}{i}".encode() for n in range(6)})

    threads = [threading.Thread(target=write, args=(name,)) for name in "ab"]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        with atomic_files.folder_lock(tmp_path):
            assert len({path.read_bytes() for path in tmp_path.glob("[0-9].csv")}) <= 1
    for thread in threads:
        thread.join()


def test_a_folder_that_stays_locked_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic_files, "WAIT_S", 0.1)
    held = "import fcntl, os, sys; fcntl.flock(os.open(sys.argv[1], 0), fcntl.LOCK_EX); print(flush=True); input()"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", held, str(tmp_path)], **pipes) as other:
        other.stdout.readline()
        with pytest.raises(StoreError, match="another process has been writing there"):
            atomic_files.replace_all(tmp_path, {"a.csv": b""})
        other.communicate(b"\n")
    atomic_files.replace_all(tmp_path, {"a.csv": b""})


def test_a_new_config_is_whole_or_not_there(tmp_path, monkeypatch):
    path = write_new_config("mine", "rls2", tmp_path)
    before = path.read_bytes()
    with pytest.raises(ConfigError, match="never overwritten"):
        write_new_config("mine", "rls1", tmp_path)
    assert path.read_bytes() == before
    with pytest.raises(StoreError, match="cannot be written"):
        write_new_config("mine", "rls2", tmp_path / "nowhere")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic_files, "create_readable_file", full)
    with pytest.raises(StoreError, match="No space left"):
        write_new_config("other", "rls2", tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["mine.yaml"]


@pytest.mark.slow_cases("figures1-kinds1")
@pytest.mark.parametrize(
    ("figures", "kinds"), [("svg", {".svg", ".md"}), (["pdf"], {".pdf", ".md"}), (None, set()), ((), set())]
)
def test_formats_of_figures(tmp_path, figures, kinds):
    radarsim.run("rls2", realisations=200, out=tmp_path, figures=figures, overrides=["figures=[sigma_r]"])
    assert {path.suffix for path in (tmp_path / "rls2" / "figures").glob("*")} == kinds


def test_a_sweep_without_effect_is_told_as_one():
    for key, words in (("wavelength_m=[0.1, 0.2]", True), ("sigma_velocity_mps=[1, 100]", False)):
        answer = radarsim.run("rls2", realisations=2000, overrides=[f"sweep.radar.{key}"]).answer
        assert ("not significantly different" in answer[0]) is words


def test_without_the_compiler_it_is_told(monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    with pytest.raises(ConfigError, match="NUMBA_DISABLE_JIT is set"):
        radarsim.run("rls2", realisations=200)


@pytest.mark.slow
def test_a_config_of_ones_own_is_not_judged_as_the_shipped_one_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (SHIPPED / "configs" / "orders.yaml").read_text(encoding="utf-8")
    assert set(radarsim.run("orders", realisations=200).tables["claims"]["claim"]) == {"P1.E4", "P1.E5", "P1.E6"}
    (tmp_path / "orders.yaml").write_text(text.replace("sigma_range_m: 250", "sigma_range_m: 60"), encoding="utf-8")
    own = radarsim.run("orders", realisations=200)
    assert not len(own.tables["claims"])
    assert "orders.yaml: used in place of the shipped config orders" in own.warnings
    assert set(radarsim.claims("orders").table["verdict"]) == {"not judged here"}
