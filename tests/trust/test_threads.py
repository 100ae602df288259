"""Where no thread can be started, `--threads 0` does all, to the same bytes; without it a line says so."""

import pytest

import radarsim
from radarsim.system.threads import ThreadLimit, forbidden, mapping
from tests.program import command

BARRED = """
import sys, threading, _thread

def refuse(*_, **__):
    raise RuntimeError("can't start new thread")

threading.Thread.start = threading._start_new_thread = _thread.start_new_thread = refuse
"""
COMMAND = "from radarsim.cli import entry; entry()"
BUSY = (
    "from radarsim.engine.store import writer; writer.PERIOD_S = 0; "  # it writes after every task, not once a second
)
NATIVE = "print(*(line.split()[1] for line in open('/proc/self/status') if line.startswith('Threads:')))"


@pytest.fixture
def barred(libraries):
    """What a program prints to both streams in a process that starts no thread, and its exit code."""

    def ended(program, *arguments):
        done = libraries.run(*arguments, code=f"{BARRED}{program}")
        return done.stdout + done.stderr, done.returncode

    return ended


def test_run_and_track_without_a_thread_give_the_same_bytes(barred, tmp_path):
    few = ("-n", 3000, "--no-figures", "--threads", 0)
    told, code = barred(BUSY + COMMAND, "run", "rls2", *few, "--out", tmp_path / "none")
    assert (code, "Traceback" in told) == (0, False), told
    radarsim.run("rls2", realisations=3000, threads=2, out=tmp_path / "two", figures=False)
    tables = sorted((tmp_path / "two/rls2").glob("*.csv"))
    assert len(tables) > 3
    for table in tables:
        assert (tmp_path / "none/rls2" / table.name).read_bytes() == table.read_bytes()
    plots, tracks = tmp_path / "plots.csv", [tmp_path / "none.csv", tmp_path / "all.csv"]
    radarsim.simulate("rls2").to_csv(plots, index=False)
    told, code = barred(COMMAND, "track", "rls2", plots, "-o", tracks[0], "--threads", 0)
    assert code == 0, told
    command("track", "rls2", plots, "-o", tracks[1])
    assert tracks[0].read_bytes() == tracks[1].read_bytes()


@pytest.mark.slow
def test_python_runs_without_a_thread_where_updates_are_timed_and_interpretations_known_exactly(barred):
    """`multimodel` measures an update's cost, and P1's interpretations take a radar each, in threads where they may."""
    ran = (
        "import radarsim; radarsim.run('multimodel', realisations=20, threads=0); "
        "radarsim.interpretations('P1.4', threads=0)"
    )
    told, code = barred(f"{ran}\n{NATIVE}")
    before, _ = barred(f"import pandas\n{NATIVE}")  # pandas imports pyarrow where it is there, which starts one
    assert (code, told.split()[-1]) == (0, before.strip()), told


def test_a_command_that_lacks_its_threads_says_what_does_without(barred):
    told, code = barred(COMMAND, "solve", "rls2", "radar.sigma_velocity_mps", "--gain", "r", "--at-k", 3, "--equals", 9)
    assert code == 0, told  # in closed form: no thread is asked for
    told, code = barred(COMMAND, "run", "rls2", "-n", 10)
    assert code == 2
    assert told == "no thread can be started here; --threads 0 needs none\n"


def test_what_is_forbidden_within_is_allowed_after():
    with ThreadLimit(0):
        assert forbidden()
        with ThreadLimit(2), mapping() as mapped:
            assert forbidden()
            assert mapped is map
    assert not forbidden()
    with pytest.raises(KeyError), ThreadLimit(0):
        raise KeyError
    assert not forbidden()
