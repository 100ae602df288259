"""Folders that another user owns: what may be read is read, what may not be written is refused in a line, whole.

The other user is this process without the right to pass over permissions, which root has: so the tests are the same for
root and for anybody else.
"""

import contextlib
import ctypes
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.forked_programs import Start

PR_CAPBSET_DROP, PASS_OVER = 24, (1, 2)  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
NO_FIGURES = ("-n", "4000", "--no-figures")

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="rights of root are dropped as Linux does")


def drop():
    """In a process before it starts its program: permissions hold for it whoever it is."""
    if os.geteuid() == 0:
        library = ctypes.CDLL(None, use_errno=True)
        for right in PASS_OVER:
            if library.prctl(PR_CAPBSET_DROP, right, 0, 0, 0) != 0:
                raise OSError(ctypes.get_errno(), "PR_CAPBSET_DROP")


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def closed():
    """Close folders, with all that is in them, against writing; they are opened again at the end."""
    opened = []

    def close(*folders):
        for folder in folders:
            for place, _, names in os.walk(folder):
                for path in (Path(place), *(Path(place) / name for name in names)):
                    opened.append((path, path.stat().st_mode))
                    path.chmod(path.stat().st_mode & ~0o222)

    yield close
    for path, mode in reversed(opened):
        if path.exists():
            path.chmod(mode)


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """What the command answers to somebody for whom permissions hold."""

    def answer(*words, **options):
        done = start.run(*words, **options)
        assert "Traceback" not in done.stderr
        return done

    with Start(tmp_path_factory.mktemp("printed"), preexec_fn=drop) as start:
        yield answer


@pytest.fixture(scope="module")
def made(command, tmp_path_factory):
    """Results of another user."""
    out = tmp_path_factory.mktemp("another") / "results"
    assert command("run", "rls2", *NO_FIGURES, "--out", out).returncode == 0
    return out


def test_the_other_user_may_not_write(closed, tmp_path):
    """The test's own premise."""
    closed(tmp_path)
    shell = [sys.executable, "-c", f"open({str(tmp_path / 'file')!r}, 'w')"]
    done = subprocess.run(shell, capture_output=True, text=True, check=False, preexec_fn=drop)
    assert "PermissionError" in done.stderr


def test_a_run_into_a_closed_folder(command, closed, tmp_path):
    closed(tmp_path)
    done = command("run", "rls2", *NO_FIGURES, "--out", tmp_path)
    assert (done.returncode, done.stdout) == (4, "")
    (line,) = done.stderr.splitlines()
    assert str(tmp_path) in line
    assert "ermission denied" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("part", "more"), [("rls2", 5000), (".blocks", 9000), ("", 9000)])
def test_results_of_another_user_stay_whole(command, closed, made, part, more):
    """Their tables, their blocks or both: more realisations than they have cannot be stored there."""
    before = contents(made / part)
    closed(made / part)
    done = command("run", "rls2", "-n", more, "--no-figures", "--out", made)
    assert done.returncode == 4, done.stderr
    assert "ermission denied" in done.stderr
    assert contents(made / part) == before


@pytest.mark.slow
def test_they_can_be_read(command, closed, made, tmp_path):
    closed(made)
    before = contents(made)
    assert command("doctor", made / "rls2").returncode == 0
    listed = command("claims", "rls2", "--out", made)
    assert (listed.returncode, listed.stderr) == (0, "")
    assert "P1." in listed.stdout
    compared = command("compare", made / "rls2", made / "rls2", "--no-figures", "--out", tmp_path / "compared")
    assert compared.returncode == 0, compared.stderr
    loads = f"import radarsim; print(len(radarsim.load('rls2', out={str(made)!r}).curves))"
    (tmp_path / "loads.py").write_text(loads)
    done = command(module="loads", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) > 50
    assert contents(made) == before


def test_a_report_that_cannot_be_written_again(command, closed, made):
    closed(made)
    done = command("report", "rls2", "--out", made, "--no-figures")
    assert done.returncode == 4
    (line,) = done.stderr.splitlines()
    assert str(made) in line


@contextlib.contextmanager
def unreadable(path):
    """A file or folder closed to everybody for a while."""
    mode = path.stat().st_mode
    path.chmod(0)
    try:
        yield
    finally:
        path.chmod(mode)


@pytest.mark.slow
def test_results_that_may_not_be_read(command, closed, made):
    """A table closed to everybody is named, not taken for damaged."""
    with unreadable(made / "rls2/curves.csv"):
        done = command("doctor", made / "rls2")
    assert done.returncode != 0
    assert "curves.csv" in done.stdout + done.stderr
    assert "ermission denied" in done.stdout + done.stderr


def test_blocks_that_may_not_be_read_are_not_said_to_be_written(command, made):
    with unreadable(made / ".blocks"):
        done = command("doctor", made / "rls2")
    assert done.returncode == 4
    assert "ermission denied" in done.stderr
    assert "cannot be written" not in done.stderr


def test_what_may_not_be_looked_at_is_not_said_to_be_missing(command, made, tmp_path):
    """A config, and a folder of results to be cleaned: Python's own Path.is_file says no of both from 3.14 on."""
    hidden = tmp_path / "hidden"
    (hidden / "results").mkdir(parents=True)
    (hidden / "mine.yaml").write_text("study: range_doppler\n")
    with unreadable(hidden):
        refused = [command("check", hidden / "mine.yaml"), command("clean", "--out", hidden / "results")]
    for done in refused:
        assert done.returncode != 0
        assert "ermission denied" in done.stderr
        assert "no such" not in done.stderr


def test_a_record_that_may_not_be_read_is_not_taken_for_a_damaged_one(command, made, tmp_path):
    record = made / "rls2/run.json"
    with unreadable(record):
        done = command("compare", made / "rls2", made / "rls2", "--no-figures", "--out", tmp_path)
    assert done.returncode == 4
    assert done.stderr == f"{record}: cannot be read: Permission denied\n"


UNDER = "import os, sys; os.umask(int(os.environ['UMASK'], 8)); from radarsim.cli.command_group import main; main()"
WRITTEN = (
    ("run", "rls2", "-n", "2000", "--out", "results", "--set", "figures=[gain_r]"),
    ("new", "mine", "--like", "rls2"),
    ("new-study", "walk"),
    ("simulate", "rls2", "-o", "plots.csv"),
)


@pytest.mark.parametrize("umask", [0o000, pytest.param(0o077, marks=pytest.mark.slow)], ids=oct)
def test_what_is_written_others_read_as_the_umask_has_it_and_never_write(command, tmp_path, umask):
    """Tables, figures, reports, configs, studies, plots; of what was there before the right to write goes as well."""
    (tmp_path / "results/rls2").mkdir(parents=True)
    (tmp_path / "plots.csv").touch()
    (tmp_path / "plots.csv").chmod(0o646)
    before = {path: path.stat().st_mode for path in tmp_path.rglob("*") if path.is_dir()}
    for words in WRITTEN:
        done = command(*words, code=UNDER, cwd=tmp_path, UMASK=oct(umask))
        assert done.returncode == 0, done.stderr
    entries = [path for path in tmp_path.rglob("*") if ".blocks" not in path.parts and path not in before]
    assert {path.suffix for path in entries} >= {".csv", ".svg", ".html", ".json", ".yaml", ".py", ""}
    readable = 0o755 & ~umask
    for path in entries:
        bits = 0o644 if path.name == "plots.csv" else readable & (0o777 if path.is_dir() else 0o666)
        assert stat.S_IMODE(path.stat().st_mode) == bits, path
