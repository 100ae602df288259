"""Nothing shrinks in silence: which results take the place of others, and what is said."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest

import radarsim
from radarsim.api import replacement
from radarsim.errors import ConfigError
from radarsim.report import stored_tables
from tests.program import command, csv_bytes, record

QUIET = ("--no-figures", "-q")


@pytest.fixture
def out(tmp_path):
    """A results directory with a run of 4000 realisations."""
    command("run", "rls2", "-n", 4000, "--out", tmp_path / "out", *QUIET)
    return tmp_path / "out"


@pytest.mark.parametrize(
    ("options", "difference"),
    [
        (("--seed", 3), "of seed 2017, not 3"),
        (("--set", "radar.sigma_range_m=100"), "of other settings: radar.sigma_range_m 250, not 100"),
        (("--set", "filters.0.manoeuvre_variance=1"), "of other settings: filters.0.manoeuvre_variance 0.001, not 1"),
        (("--set", "sweep.scans=[10,12]"), "of other settings: other cases, such as rls2 scans=10"),
        (
            ("--set", "study=ambiguous_doppler", "--set", "radar.repetition_rate_hz=1000"),
            "of study range_doppler, not ambiguous_doppler",
        ),
    ],
)
def test_other_results_need_replace(options, difference, out):
    before = csv_bytes(out / "rls2")
    fault = command("run", "rls2", *options, "--out", out, *QUIET, code=2).stderr
    assert f"{out / 'rls2'} holds tables of 4000 realisations {difference}" in fault
    assert csv_bytes(out / "rls2") == before
    back = re.search("`(.*)` brings them back", fault)[1]
    command("run", "rls2", *options, "-n", 2000, "--replace", "--out", out, *QUIET)
    assert csv_bytes(out / "rls2") != before
    command(*shlex.split(back)[1:], *QUIET)
    assert csv_bytes(out / "rls2") == before


def test_where_no_command_brings_them_back_a_copy_is_advised(tmp_path):
    config = radarsim_config(tmp_path, 250)
    command("run", config, "-n", 2000, "--out", tmp_path / "out", *QUIET)
    radarsim_config(tmp_path, 260)
    fault = command("run", config, "-n", 2000, "--out", tmp_path / "out", *QUIET, code=2).stderr
    folder = tmp_path / "out" / "mine"
    assert f"`cp -r {folder} {folder}-before` keeps them" in fault


def test_a_config_that_is_replaced_too_brings_nothing_back(out, monkeypatch):
    monkeypatch.chdir(out.parent)
    setting = ("--set", "radar.sigma_range_m=300", "-n", 2000, "--replace")
    command("run", "rls2", *setting, "--out", "out", *QUIET)
    command("run", "out/rls2/config.yaml", "--out", "out", *QUIET)
    fault = command("run", "rls2", "-n", 2000, "--out", "out", *QUIET, code=2).stderr
    assert "`cp -r out/rls2 out/rls2-before` keeps them" in fault


def test_a_table_of_runs_is_not_removed_in_silence(out):
    again = ("run", "rls2", "-n", 4000, "--no-figures", "--out", out)
    assert command(*again, "--runs", "3:10").stderr == ""
    assert command(*again, "--runs", "3:10").stderr == ""
    assert "removed" not in command(*again).stdout
    assert (out / "rls2" / "runs.csv").exists()
    removed = command(*again, "-n", 5000).stdout
    assert "left by an earlier run, not written by this one: runs.csv; to have them again: `--runs 3:10`" in removed
    assert not (out / "rls2" / "runs.csv").exists()


def test_figures_of_the_same_numbers_stay_and_others_are_named(out):
    figures, select = out / "rls2" / "figures", ("--set", "figures=[sigma_r]")

    def run(*options):
        """Run with one figure; what is printed, and the files of figures."""
        text = command("run", "rls2", "--out", out, *options).stdout
        command("doctor", out / "rls2")
        return text, {path.name for path in figures.glob("*")}

    _, files = run("-n", 4000, *select, "--format", "pdf")
    assert files == {"sigma_r.pdf", "captions.md"}
    for options in ((*select, "--format", "svg"), ("--no-figures",), ("--set", "figures=[gain_r]")):
        text, now = run("-n", 4000, *options)
        assert "removed" not in text
        assert now >= files
        files = now
    assert files == {"sigma_r.pdf", "sigma_r.svg", "gain_r.svg", "captions.md"}
    text, now = run("-n", 5000, *select, "--format", "svg")
    removed = "figures/gain_r.svg and figures/sigma_r.pdf; to have them again: `--format pdf` and `--format svg`"
    assert removed in " ".join(text.split())
    assert now == {"sigma_r.svg", "captions.md"}


def radarsim_config(folder, sigma_range_m):
    text = f"include: [rls2]\nradar: {{sigma_range_m: {sigma_range_m}}}\n"
    (folder / "mine.yaml").write_text(text)
    return folder / "mine.yaml"


@pytest.mark.parametrize(
    "options", [("-n", 2000), ("-n", 32_000, "--precision", 50), ("-n", 10**7, "--time-limit", 0.001)]
)
def test_fewer_realisations_show_those_that_are_stored(options, out):
    before = csv_bytes(out / "rls2")
    command("run", "rls2", *options, "--out", out, *QUIET, code=3 if "--time-limit" in options else 0)
    after = csv_bytes(out / "rls2")
    assert radarsim.load(out / "rls2").cases[0].count >= 4000
    assert after == before


def test_a_note_says_that_more_are_shown(out):
    note = command("run", "rls2", "-n", 2000, "--out", out, "--no-figures").stderr
    assert f"note: rls2: 4000 realisations are stored in {out} and shown in place of 2000" in note
    (case,) = record(out / "rls2")["cases"].values()
    assert (case["asked"], case["done"], record(out / "rls2")["realisations_asked"]) == (2000, 4000, 2000)
    assert "4000 realisations (stored; 2000 requested), seed 2017" in (out / "rls2" / "report.html").read_text()
    (document,) = json.loads(command("report", "rls2", "-n", 3000, "--out", out, "--no-figures", "--json").stdout)
    assert (document["cases"]["rls2"]["asked"], document["cases"]["rls2"]["done"]) == (3000, 4000)
    assert "note" not in command("run", "rls2", "-n", 4000, "--out", out, "--no-figures").stderr
    assert "4000 realisations" in command("report", "rls2", "-n", 2000, "--out", out, "--no-figures").stderr
    command("run", "rls2", "-n", 2000, "--replace", "--out", out, *QUIET)
    assert radarsim.load(out / "rls2").cases[0].count == 2000


def test_without_blocks_fewer_realisations_need_replace(out):
    before = csv_bytes(out / "rls2")
    shutil.rmtree(out / ".blocks")
    assert "whose blocks are not stored" in command("run", "rls2", "-n", 2000, "--out", out, *QUIET, code=2).stderr
    assert csv_bytes(out / "rls2") == before


def test_more_realisations_of_the_same_extend(out):
    command("run", "rls2", "-n", 6000, "--out", out, *QUIET)
    assert radarsim.load(out / "rls2").cases[0].count == 6000


def test_all_configs_are_refused_before_any_runs(out):
    command("run", "rls3", "rls2", "--seed", 5, "-n", 2000, "--out", out, *QUIET, code=2)
    assert not (out / "rls3").exists()


def test_python_asks_too(out):
    with pytest.raises(ConfigError, match=r"replace=True to replace them"):
        radarsim.run("rls2", seed=3, out=out, figures=False)
    result = radarsim.run("rls2", seed=3, realisations=2000)
    with pytest.raises(ConfigError, match="of seed 2017, not 3"):
        result.write(out, figures=False)
    result.write(out, figures=False, replace=True)
    assert radarsim.load(out / "rls2").experiment.seed == 3


def test_a_judged_filter_replaces_no_judgement_of_more(out):
    def judge(count, **options):
        radarsim.judge("rls2", lambda plots: plots["range_m"], realisations=count, out=out, figures=False, **options)

    judge(600)
    judge(700)
    with pytest.raises(ConfigError, match=r"rls2_mine holds tables of 700 realisations .* would have fewer"):
        judge(500)
    judge(500, replace=True)


def test_the_advised_study_goes_to_another_directory():
    folded = radarsim.run("rls2", overrides=["radar.repetition_rate_hz=1000"], realisations=100)
    assert any("--set study=ambiguous_doppler --out folded" in line for line in folded.answer)


KILLED = """
import os, sys
from pathlib import Path
from radarsim.report import atomic_files

NAMES = ("a.csv", "b/c.svg", "run.json")
STATES = {"old": [*NAMES, "stale.csv"], "new": [*NAMES, "d/e.svg"]}
REAL = {name: getattr(os, name) for name in ("rename", "replace", "unlink", "mkdir", "rmdir", "open")}

def put(folder, state, stale=()):
    contents = {name: state.encode() for name in STATES[state]}
    atomic_files.replace_all(folder, contents, stale=lambda folder: stale)

def killed_before_call(n):
    calls = iter(range(n))
    def killing(function):
        def call(*arguments, **options):
            if next(calls, None) is None:
                os._exit(9)
            return function(*arguments, **options)
        return call
    for name, function in REAL.items():
        setattr(os, name, killing(function))

for n in range(200):
    folder = Path(sys.argv[1], str(n))
    put(folder, "old")
    if not (child := os.fork()):
        killed_before_call(n)
        put(folder, "new", ["stale.csv"])
        os._exit(0)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    states = {atomic_files.read(folder / name).decode() for name in NAMES}
    (state,) = states
    assert (folder / "stale.csv").exists() == (state == "old") != (folder / "d/e.svg").exists(), (n, state)
    put(folder, "new", ["stale.csv"])
    assert {path.name for path in folder.iterdir() if not path.name.endswith(".tmp")} == {"a.csv", "b", "d", "run.json"}
    print(state)
    if status == 0:
        break
"""


def test_a_kill_at_any_moment_leaves_all_of_the_old_or_all_of_the_new(tmp_path):
    script = [sys.executable, "-c", KILLED, tmp_path]
    ended = subprocess.run(script, capture_output=True, text=True, timeout=60)
    assert not ended.stderr
    states = ended.stdout.split()
    assert len(states) > 20
    assert states == sorted(states, reverse=True)
    assert set(states) == {"old", "new"}


def test_what_a_folder_holds_is_read_once_before_a_run_and_once_as_it_is_written(out, monkeypatch):
    folders = []

    def find_record(folder):
        folders.append(folder)
        return stored_tables.find_record(folder)

    monkeypatch.setattr(replacement, "stored_tables", SimpleNamespace(find_record=find_record))
    radarsim.run("rls2", realisations=4000, out=out, figures=False)
    assert folders == [out / "rls2"] * 2
