"""Real processes, really interrupted: signals answered in time, kills that cost about a second of work, and no byte."""

import hashlib
import random
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from radarsim.engine.blocks import Node
from radarsim.engine.collect import collect, read_stored
from radarsim.engine.stop_conditions import Signals
from radarsim.engine.store.store import Store
from radarsim.errors import Interruption
from radarsim.system.threads import ThreadLimit
from tests.engine.fake import Fake, textbook

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.alone
WORK = Fake()
PATIENCE_S = 40  # less than the 60 s that a stuck task or a main thread that lingers takes


@contextmanager
def started(store, realisations, *options):
    """A process that runs the fake work, once it says that it is under way."""
    command = [sys.executable, "-m", "tests.engine.fake", str(store), str(realisations), *map(str, options)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "running\n"
            yield process
        finally:
            process.kill()


def ended(process):
    """Seconds until the process is gone, and its exit status."""
    since = time.perf_counter()
    status = process.wait(timeout=10)
    return time.perf_counter() - since, status


def whole(store, realisations):
    """A run with this store gives the textbook's bytes; how much of it was found there."""
    result = collect(WORK, realisations, store=store)
    assert result.count == realisations
    assert result.values.tobytes() == textbook(WORK, realisations).tobytes()
    assert result.warnings == ()
    return result.from_store


@pytest.mark.parametrize(("number", "threads"), [(signal.SIGINT, 2), (signal.SIGTERM, 2), (signal.SIGINT, 0)])
def test_a_signal_stops_the_run_and_all_it_did_is_stored(tmp_path, number, threads):
    with started(tmp_path, 16 * 4_000, "--pause", 1e-3, "--threads", threads) as process:
        time.sleep(0.3)
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == 128 + number
        said = process.stdout.read().split()
    count = int(said[0])
    assert 0 < count < 16 * 4_000
    assert said[1] == hashlib.sha256(textbook(WORK, count).tobytes()).hexdigest()
    assert read_stored(WORK, count, tmp_path).from_store == count
    assert whole(tmp_path, 16 * 4_000) == count


def test_a_stuck_task_does_not_hold_up_the_stop(tmp_path):
    with started(tmp_path, 16 * 4_000, "--pause", 1e-3, "--stuck-at", 16 * 900) as process:
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 130
        count = int(process.stdout.read().split()[0])
    assert 16 * 300 < count <= 16 * 900
    assert whole(tmp_path, 16 * 4_000) >= count


@pytest.mark.parametrize("threads", [2, 0])
def test_a_main_thread_that_never_asks_is_ended(tmp_path, threads):
    with started(tmp_path, 1, "--linger", "--threads", threads) as process:
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 143
        assert "stopped by SIGTERM" in process.stderr.read()


@pytest.mark.parametrize(
    "options", [["--linger"], ["--linger", "--threads", 0], ["--pause", 1e-3, "--stuck-at", 16 * 900]]
)
def test_a_second_signal_ends_it_on_the_spot(tmp_path, options):
    """The exit code is the second signal's: the first alone would have ended it later, with its own."""
    with started(tmp_path, 16 * 4_000, *options) as process:
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 143


@pytest.mark.parametrize("threads", [None, 0])
def test_other_signals_are_left_alone_and_the_handlers_put_back(threads):
    numbers = *Signals.numbers, signal.SIGALRM
    before = [signal.getsignal(number) for number in numbers]
    other = signal.signal(signal.SIGUSR1, lambda *_: None)
    try:
        with ThreadLimit(threads), Signals() as signals:
            signal.raise_signal(signal.SIGUSR1)
            time.sleep(0.1)
            assert signals() is None
            signals.raise_if_received()
    finally:
        signal.signal(signal.SIGUSR1, other)
    assert [signal.getsignal(number) for number in numbers] == before
    assert signal.set_wakeup_fd(-1) == -1
    assert signal.getitimer(signal.ITIMER_REAL) == (0, 0)


@pytest.mark.parametrize("threads", [None, 0])
def test_a_signal_is_told_as_a_reason_and_as_an_exception(threads):
    with ThreadLimit(threads), Signals() as signals:
        signal.raise_signal(signal.SIGTERM)
        while signals() is None:
            time.sleep(0.01)
        assert signals() == "signal 15"
    with pytest.raises(Interruption) as caught:
        signals.raise_if_received()
    assert caught.value.exit_code == 143


def killed_until_done(store, realisations, pause, period, draw, kills):
    """SIGKILL at random moments, each run on the store that the last one left; how much was stored after each."""
    found = []
    for _ in range(kills):
        with started(store, realisations, "--pause", pause, "--period", period) as process:
            time.sleep(draw.uniform(0.0, 0.6))
            process.kill()
        nodes = [piece for piece in Store(store, WORK).pieces() if isinstance(piece, Node)]
        found.append(sum(16 << node.level for node in nodes))
    return found


def test_kills_at_random_moments_lose_no_byte(tmp_path):
    found = killed_until_done(tmp_path, 16 * 2_500 + 5, 1e-3, 0.05, random.Random(1), kills=2)
    assert found[-1] > 0
    assert whole(tmp_path, 16 * 2_500 + 5) > 0


@pytest.mark.parametrize("copies", [2])
def test_processes_on_one_store_at_once(tmp_path, copies):
    sizes = [16 * 600 + copy for copy in range(copies)]
    command = [sys.executable, "-m", "tests.engine.fake", "--pause", "1e-3", "--period", "0.0", str(tmp_path)]
    running = [subprocess.Popen([*command, str(size)], cwd=ROOT, stdout=subprocess.PIPE, text=True) for size in sizes]
    for process, size in zip(running, sizes, strict=True):
        said, _ = process.communicate(timeout=60)
        digest = hashlib.sha256(textbook(WORK, size).tobytes()).hexdigest()
        assert said.split() == ["running", str(size), digest]
    for size in sizes:
        assert read_stored(WORK, size, tmp_path).count == size


@pytest.mark.slow
def test_a_real_full_disk_in_a_file_system_of_its_own(tmp_path):
    """Needs the right to mount; a disk of 64 kB on which a run of 1 MB vectors does not fit, and a small one stays."""
    script = f"""set -e
        mount -t tmpfs -o size=64k tmpfs {tmp_path}
        {sys.executable} -m tests.engine.fake {tmp_path} 1000
        sha256sum {tmp_path}/.blocks/ab12/* > /tmp/before.$$
        head -c 1M /dev/zero > {tmp_path}/filler || true
        {sys.executable} -m tests.engine.fake {tmp_path} 100000 2> /tmp/error.$$ && exit 1
        grep -q 'StoreError: {tmp_path}/.blocks/ab12/.*No space left on device' /tmp/error.$$
        sha256sum --check --quiet /tmp/before.$$
        rm {tmp_path}/filler /tmp/before.$$ /tmp/error.$$
        {sys.executable} -m tests.engine.fake {tmp_path} 100000
    """
    if subprocess.run(["unshare", "--mount", "true"], check=False, capture_output=True).returncode:
        pytest.skip("no right to mount")
    done = subprocess.run(
        ["unshare", "--mount", "bash", "-c", script], cwd=ROOT, check=True, capture_output=True, text=True
    )
    digest = hashlib.sha256(textbook(WORK, 100_000).tobytes()).hexdigest()
    assert done.stdout.split()[-3:] == ["running", "100000", digest]


def test_a_signal_to_a_process_as_it_is_forked_is_not_one_to_the_run():
    script = """if True:
        import os, signal, time
        os.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), signal.SIGTERM))  # before that of radarsim
        from radarsim.engine.stop_conditions import Signals
        with Signals() as signals:
            child = os.fork()
            if not child:
                os._exit(0)
            print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
            time.sleep(0.3)
            print(signals())
    """
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["-15", "None"]
