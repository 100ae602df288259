"""Signals and kills of the command itself, in every way of running: answered in time, resumable, little lost."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from radarsim import studies
from radarsim.config.load import load
from radarsim.engine.blocks import Node
from radarsim.engine.store import Store
from radarsim.selftest import KNOWN

ROOT = Path(__file__).parents[2]
CONFIG = str(KNOWN / "range_doppler.yaml")
PLENTY = "1e10"  # realisations, some minutes of them
MODES = {
    "threads": [],
    "precision": ["--precision", "0.0001"],
    "time limit": ["--time-limit", "500"],
    "share": ["--shard", "1/2"],
    "workers": ["--workers", "2"],
}


def started(out, *options):
    """The command under way, in a session of its own."""
    program = [sys.executable, "-m", "radarsim", "run", CONFIG, "-n", PLENTY, "--quiet", "--out", str(out), *options]
    return subprocess.Popen(program, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)


def held(out):
    """Realisations that are stored without a gap, and whether every stored file is whole."""
    (case,) = load(CONFIG).cases
    store = Store(out, studies.CaseWork(case))
    forest = store.forest(2**40)
    return forest.total().count, store.warnings == []


def until_stored(process, out):
    """Wait until a block is stored; to a precision, the first looks are cut blocks."""
    end = time.monotonic() + 60
    while not list(out.rglob("L*.sums")):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.05)


def answered(process, *numbers):
    """Send signals, a tenth of a second apart; seconds from the last until the process was gone, and its status."""
    for number in numbers:
        time.sleep(0.1)
        process.send_signal(number)
    since = time.perf_counter()
    status = process.wait(timeout=20)
    seconds = time.perf_counter() - since
    process.communicate()
    return seconds, status


@pytest.mark.parametrize("mode", ["precision", "workers"])
def test_a_signal_is_answered_in_time_and_leaves_what_was_done(tmp_path, mode):
    process = started(tmp_path, *MODES[mode])
    until_stored(process, tmp_path)
    seconds, status = answered(process, signal.SIGINT)
    assert (seconds < 2, status) == (True, 130)
    count, whole = held(tmp_path)
    assert count > 0
    assert whole


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_fifty_signals_at_any_moment_are_answered_in_time(tmp_path, mode):
    """Ten in each way of running: while it starts, while it runs, and when it goes on with what is stored."""
    draw = random.Random(mode)
    for turn, number in enumerate((signal.SIGINT, signal.SIGTERM) * 5):
        process = started(tmp_path, *MODES[mode])
        if turn == 5:
            until_stored(process, tmp_path)
        time.sleep(draw.uniform(0.5, 8.0))
        seconds, status = answered(process, number)
        assert (seconds < 2, status) == (True, 128 + number)
        assert held(tmp_path)[1]
    assert held(tmp_path)[0] > 0


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_second_signal_ends_it_at_once(tmp_path, mode):
    for wait_s in (1.0, 5.0):
        process = started(tmp_path, *MODES[mode])
        time.sleep(wait_s)
        seconds, status = answered(process, signal.SIGINT, signal.SIGTERM)
        assert seconds < 0.5
        assert status in (130, 143)
        assert held(tmp_path)[1]


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_kill_loses_less_than_ten_seconds_of_work(tmp_path, mode):
    """What is stored is looked at every second; at the kill it is no older than ten."""
    process = started(tmp_path, *MODES[mode])
    until_stored(process, tmp_path)
    seen = []
    for _ in range(16):
        time.sleep(1)
        seen.append(sum(piece.realisations(4096)[1] for piece in nodes(tmp_path)))
    process.kill()
    process.communicate()
    assert seen[-1] > seen[-10] > 0
    assert held(tmp_path)[1]


def nodes(out):
    """The stored nodes."""
    (case,) = load(CONFIG).cases
    return [piece for piece in Store(out, studies.CaseWork(case)).pieces() if isinstance(piece, Node)]


@pytest.mark.slow
def test_workers_of_a_killed_run_end_by_themselves(tmp_path):
    process = started(tmp_path, *MODES["workers"])
    until_stored(process, tmp_path)
    process.kill()
    process.communicate()
    end = time.monotonic() + 20
    while time.monotonic() < end:
        if not running_workers():
            return
        time.sleep(0.5)
    raise AssertionError(f"still there: {running_workers()}")


def running_workers():
    """Worker processes whose parent is gone."""
    listed = subprocess.run(["ps", "-eo", "ppid,args"], capture_output=True, text=True, check=True).stdout
    return [line for line in listed.splitlines() if "distributed.cli.dask_worker" in line and line.split()[0] == "1"]
