"""Signals and kills of the command itself, in every way of running: answered in time, resumable, little lost."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.engine.blocks import Node
from radarsim.engine.store.store import Store

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.alone
PLENTY = "1e9"  # realisations, some minutes of them
MODES = {
    "threads": [],
    "precision": ["--precision", "0.0001"],
    "time limit": ["--time-limit", "500"],
    "share": ["--shard", "1/2"],
    "workers": ["--workers", "2"],
}
# Config and one value of its sweep. Blocks take 0.3 ms, 0.2 s, 30 ms, 0.3 s, 0.6 s, 0.6 s.
LONG = {
    "range_doppler": ("rls2",),
    "multimodel": ("multimodel",),
    "sonar": ("sonar_missed", "sweep.sensor.detection_probability=[0.5]"),
    "sonar_manoeuvre": ("sonar_manoeuvre", "sweep.target.acceleration_mps2=[0.4]"),
    "sonar_clutter": ("sonar_clutter", "sweep.sensor.false_plots_per_km2=[4]"),
    "discriminator": ("discriminator_rival", "sweep.burst.noise_variance=[18]"),
}


def started(out, study, mode):
    """The command under way, in a session of its own."""
    config, *overrides = LONG[study]
    options = [word for override in overrides for word in ("--set", override)]
    program = [sys.executable, "-m", "radarsim", "run", config, *options, "-n", PLENTY, "--quiet", "--out", str(out)]
    program += MODES[mode]
    return subprocess.Popen(program, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)


def store_of(out, study):
    """The store of the only case."""
    config, *overrides = LONG[study]
    (case,) = load(config, overrides).cases
    return Store(out, CaseWork(case))


def held(out, study="range_doppler"):
    """Realisations that are stored without a gap, and whether every stored file is whole."""
    store = store_of(out, study)
    forest = store.forest(2**40)
    return forest.total().count, store.warnings == []


def until_stored(process, out):
    """Wait until the first block is stored; to a precision, the first looks are cut blocks."""
    end = time.monotonic() + 60
    while not list(out.rglob("L*-0.sums")):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.05)


def answered(process, *numbers):
    """Send signals, a tenth of a second apart; seconds from the last until the process was gone, and its status."""
    for number in numbers:
        time.sleep(0.1)
        process.send_signal(number)
    since = time.perf_counter()
    status = process.wait(timeout=60)
    seconds = time.perf_counter() - since
    process.communicate()
    return seconds, status


@pytest.mark.parametrize("mode", ["precision", "workers"])
def test_a_signal_is_answered_and_leaves_what_was_done(tmp_path, mode):
    process = started(tmp_path, "range_doppler", mode)
    until_stored(process, tmp_path)
    _, status = answered(process, signal.SIGINT)
    assert status == 130
    count, whole = held(tmp_path)
    assert count > 0
    assert whole


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_fifty_signals_at_any_moment_are_answered_in_time(tmp_path, mode, record_property):
    """Ten in each way of running, studies in turn: at its start, within it, and when it goes on with what is stored."""
    draw, slowest = random.Random(mode), 0.0
    for turn in range(10):
        number, study = (signal.SIGINT, signal.SIGTERM)[turn % 2], list(LONG)[turn % len(LONG)]
        out = tmp_path / study
        process = started(out, study, mode)
        if turn >= len(LONG):
            until_stored(process, out)
        time.sleep(draw.uniform(0.5, 8.0))
        seconds, status = answered(process, number)
        slowest = max(slowest, seconds)
        assert (seconds < 2, status) == (True, 128 + number), (study, turn)
        assert held(out, study)[1]
        assert turn < len(LONG) or held(out, study)[0] > 0
    record_property("slowest_answer_s", slowest)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_second_signal_ends_it_at_once(tmp_path, mode, record_property):
    slowest = 0.0
    for study in LONG:
        for wait_s in (1.0, 5.0):
            process = started(tmp_path / study, study, mode)
            time.sleep(wait_s)
            seconds, status = answered(process, signal.SIGINT, signal.SIGTERM)
            slowest = max(slowest, seconds)
            assert seconds < 0.5, (study, wait_s)
            assert status in (130, 143)
            assert held(tmp_path / study, study)[1]
    record_property("slowest_answer_s", slowest)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("study", "mode"), [("range_doppler", mode) for mode in MODES] + [(study, "threads") for study in list(LONG)[1:]]
)
def test_a_kill_loses_less_than_ten_seconds_of_work(tmp_path, study, mode, record_property):
    """What is stored is looked at every half second: at any moment it is what was done less than ten before."""
    process = started(tmp_path, study, mode)
    until_stored(process, tmp_path)
    grown, most, longest = time.monotonic(), 0, 0.0
    end = grown + 15
    while (now := time.monotonic()) < end:
        stored = realisations(tmp_path, study)
        longest = max(longest, now - grown)
        if stored > most:
            grown, most = now, stored
        time.sleep(0.5)
    process.kill()
    process.communicate()
    record_property("longest_without_growth_s", longest)
    assert longest < 9
    assert held(tmp_path, study)[1]


def realisations(out, study):
    """How many are stored, with gaps or without."""
    store = store_of(out, study)
    pieces = [piece for piece in store.pieces() if isinstance(piece, Node)]
    return sum(1 << piece.level for piece in pieces)


@pytest.mark.slow
def test_workers_of_a_killed_run_end_by_themselves(tmp_path):
    process = started(tmp_path, "range_doppler", "workers")
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
