"""Dask workers: the same bytes, also when workers die; what goes wrong is told in words."""

import contextlib
import datetime
import json
import os
import pickle
import random
import signal
import stat
import subprocess
import sys
import textwrap
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from radarsim.engine import cluster
from radarsim.engine.blocks import Node
from radarsim.engine.cluster import Cluster
from radarsim.engine.collect import collect
from radarsim.engine.store import writer as store_writer
from radarsim.errors import ClusterError, ConfigError, NonFiniteError
from tests.engine.fake import WORK, Fake, N, same, textbook

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two worker processes, for all tests of this file.

    They are started with a umask of 0, in a folder where anybody may have put a module by the name of Dask's."""
    folder, before, umask = tmp_path_factory.mktemp("anybody"), Path.cwd(), os.umask(0)
    (folder / "distributed.py").write_text(f"open({str(folder / 'executed')!r}, 'w')")
    os.chdir(folder)
    try:
        workers = Cluster(2)
    finally:
        os.umask(umask)
        os.chdir(before)
    with workers:
        yield workers
    assert [path.name for path in folder.iterdir()] == ["distributed.py"]
    assert not Path(workers._folder.name).exists()


def scratch(dask_worker):
    """The folder in which a worker writes, and from which Dask lets it import."""
    return dask_worker.local_directory


def test_workers_write_where_nobody_else_may(two):
    private = Path(two._folder.name)
    assert stat.S_IMODE(private.stat().st_mode) == 0o700
    folders = [*two._client.run(scratch).values(), two._scheduler.scheduler.local_directory]
    assert len(folders) == 3
    assert all(private in Path(folder).parents for folder in folders)


def alive(workers):
    """The processes of a cluster."""
    return [process.pid for process in workers._processes._running]


def test_workers_give_the_bytes_of_the_textbook(two, tmp_path):
    assert two.workers == 2
    for realisations in (1, 16, N):
        assert same(collect(WORK, realisations, executor=two), realisations)
    assert same(collect(WORK, N, executor=two, store=tmp_path))
    assert collect(WORK, N, executor=two, store=tmp_path).computed == 0


def test_nothing_listens_beyond_this_machine(two):
    """A worker runs what it is sent: RPC and HTTP, of workers and scheduler, are for this machine alone."""
    collect(WORK, N, executor=two)
    listening = [
        connection.laddr.ip
        for pid in (*alive(two), os.getpid())
        for connection in psutil.Process(pid).net_connections(kind="inet")
        if connection.status == psutil.CONN_LISTEN
    ]
    assert len(listening) >= 2 + 2 + 1  # each worker's RPC and HTTP, the scheduler
    assert set(listening) == {"127.0.0.1"}


@pytest.mark.slow
def test_a_stop_leaves_the_workers_fit_for_the_next_run(two, tmp_path):
    asked = iter([None] * 20)
    slow = Fake(pause_s=1e-2)
    cut = collect(slow, 16 * 10_000, executor=two, store=tmp_path, stop=lambda: next(asked, "enough"))
    assert cut.stopped == "enough"
    assert 0 < cut.count < 16 * 10_000
    assert cut.values.tobytes() == textbook(WORK, cut.count).tobytes()
    assert same(collect(WORK, N, executor=two))


def test_dead_workers_are_replaced_and_no_byte_is_lost(two):
    killed = []

    def kill():
        draw = random.Random(5)
        for _ in range(2):
            time.sleep(0.7)
            killed.append(draw.choice(alive(two)))
            os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    result = collect(Fake(pause_s=2e-2), N, executor=two)
    killer.join()
    assert same(result)
    assert len(killed) == 2
    assert set(killed).isdisjoint(alive(two))


@pytest.mark.slow
def test_sums_whose_holders_die_before_they_are_asked_for_are_computed_again(two, monkeypatch):
    """All workers at once: while one waits for the sums, new ones have to come."""
    monkeypatch.setattr(cluster, "RESULT_S", 20)
    monkeypatch.setattr(cluster, "HOLDER_S", 0.5)
    two.submit(WORK, Node(0, 0))
    future = next(iter(two._tasks.values()))[0]
    end = time.monotonic() + 20
    while future.status != "finished" and time.monotonic() < end:
        time.sleep(0.01)
    for process in alive(two):
        os.kill(process, signal.SIGKILL)
    outcomes = []
    while not outcomes and time.monotonic() < end + 20:
        outcomes = two.take_outcomes(1.0)
    assert len(outcomes) == 1


def test_numbers_that_are_not_finite_are_named_from_afar(two):
    with pytest.raises(NonFiniteError, match="realisations 992 to 1007"):
        collect(Fake(bad=1_000), N, executor=two)
    assert same(collect(WORK, N, executor=two))


@dataclass(frozen=True)
class Elsewhere(Fake):
    """A work that has another identity where it arrives: the sources there are others."""

    def __reduce__(self):
        return Fake, ("cd34",)


def test_workers_with_other_sources_are_refused(two):
    with pytest.raises(ConfigError, match="a worker has other sources than this machine"):
        collect(Elsewhere(), N, executor=two)
    assert same(collect(WORK, N, executor=two))


def test_a_worker_prepares_a_work_once(monkeypatch):
    made = []

    class Counted(Fake):
        def __reduce__(self):
            return counted, ()

    def counted():
        made.append(1)
        return WORK

    monkeypatch.setattr(sys.modules[__name__], "counted", counted, raising=False)
    counted.__module__, counted.__qualname__ = __name__, "counted"
    pickled = pickle.dumps(Counted())
    for index in range(3):
        cluster._run_task(pickled, WORK.identity, Node(0, index))
    assert made == [1]


@pytest.mark.parametrize("address", ["foo bar", "", "xyz://a:1", "tcp://no-such-host.invalid:8786"])
def test_an_address_that_is_none_is_told(address):
    with pytest.raises(ConfigError, match=r"scheduler: must be an address such as tcp://host:8786, got"):
        Cluster(scheduler=address)


def test_nobody_at_the_address(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_S", 1)
    with pytest.raises(ConfigError, match="no Dask scheduler answers at"):
        Cluster(scheduler="tcp://127.0.0.1:9")


def test_without_dask_the_hint_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError, match=r"need Dask: pip install 'radarsim\[cluster\]'"):
        Cluster(2)


LOST = """
    import sys
    from distributed import LocalCluster
    if __name__ == "__main__":
        options = {"dashboard_address": None, "host": "127.0.0.1", "processes": False, "protocol": "tcp"}
        there = LocalCluster(n_workers=1, threads_per_worker=1, **options)
        print(there.scheduler_address, flush=True)
        sys.stdin.readline()
"""


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_told_and_what_was_done_is_stored(tmp_path, monkeypatch):
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.1)
    program = [sys.executable, "-c", textwrap.dedent(LOST)]
    with subprocess.Popen(program, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as there:
        address = there.stdout.readline().strip()
        with Cluster(scheduler=address) as workers:
            threading.Timer(1.0, there.kill).start()
            with pytest.raises(ClusterError, match="went away"):
                collect(Fake(pause_s=1e-2), 16 * 10_000, executor=workers, store=tmp_path)
    resumed = collect(WORK, N, store=tmp_path)
    assert same(resumed)
    assert resumed.from_store > 0


def test_a_run_has_certificates_of_its_own(two):
    """Another user of this machine reaches the ports, but without the run's certificate no worker answers."""
    import distributed

    address = two._client.scheduler.address
    assert address.startswith("tls://127.0.0.1:")
    port = address.rpartition(":")[2]
    for stranger in (f"tcp://127.0.0.1:{port}", address):
        security = distributed.Security.temporary() if stranger.startswith("tls") else None
        with pytest.raises(OSError, match=r"imed out|handshake|CERTIFICATE|certificate|reset"):
            distributed.Client(stranger, timeout=0.5, set_as_default=False, security=security)


def test_without_cryptography_no_worker_is_started(monkeypatch):
    """Every user of this machine could send it programs to run."""
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with pytest.raises(ConfigError, match=r"cryptography.*|need Dask: pip install 'radarsim\[cluster\]'"):
        Cluster(1)


def test_a_clock_that_is_set_back_ends_the_run(two, monkeypatch, tmp_path):
    """Dask sends nothing before the time of day at which it was due, here an hour later."""
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.1)
    begun = time.monotonic()

    def time_of_day():
        return 1.8e9 + time.monotonic() - 3600 * (time.monotonic() > begun + 1)

    monkeypatch.setattr(cluster, "time", SimpleNamespace(monotonic=time.monotonic, time=time_of_day))
    two._time_of_day = time_of_day()
    two._last_look_s = time.monotonic()
    with pytest.raises(ClusterError, match="its clock was set back by 3600 s"):
        collect(Fake(pause_s=1e-2), 16 * 10_000, executor=two, store=tmp_path)
    resumed = collect(WORK, N, store=tmp_path)
    assert same(resumed)
    assert resumed.from_store > 0


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("tls://127.0.0.1:1", "tls:// needs Dask's settings distributed.comm.tls"),
        ("ucx://h:1", "got .*: only tcp and tls"),
        ("inproc://h", "got .*: only tcp and tls"),
    ],
)
def test_addresses_that_cannot_be_used_are_told_at_once(address, words):
    with pytest.raises(ConfigError, match=words):
        Cluster(scheduler=address)


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("tcp://h:8786", "neither encrypted nor authenticated"),
        ("tls://h:8786", "certificate"),
        ("h:8786", "neither"),
        ("tcp://127.example.com:8786", "neither"),
    ],
)
def test_what_a_scheduler_elsewhere_rests_on_is_told(address, words):
    assert words in cluster.scheduler_warning(address)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tcp://127.1.2.3:1", "tls://[::1]:8786", "localhost:8786"])
def test_a_scheduler_of_this_machine_takes_no_trust(address):
    assert cluster.scheduler_warning(address) is None


def certificates(folder):
    """An authority, and a certificate of it for everybody at 127.0.0.1: the paths of both and of the key."""
    x509 = pytest.importorskip("cryptography.x509")
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    def named(name):
        return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])

    def certificate(subject, key, root):
        now, day = datetime.datetime.now(datetime.UTC), datetime.timedelta(days=1)
        made = x509.CertificateBuilder(named("authority"), named(subject), key.public_key())
        made = made.serial_number(x509.random_serial_number()).not_valid_before(now - day).not_valid_after(now + day)
        made = made.add_extension(x509.BasicConstraints(ca=key is root, path_length=None), critical=True)
        return made.sign(root, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)

    root, key = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))
    private = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    contents = {
        "authority.pem": certificate("authority", root, root),
        "own.pem": certificate("127.0.0.1", key, root),
        "own-key.pem": key.private_bytes(*private),
    }
    folder.mkdir()
    for name, content in contents.items():
        (folder / name).write_bytes(content)
        (folder / name).chmod(0o600)
    return [str(folder / name) for name in contents]


@contextlib.contextmanager
def encrypted(authority, own, key, place):
    """The address of a scheduler with one worker that talk TLS alone, started as docs/scale.md has it."""
    tls = ["--tls-ca-file", authority, "--tls-cert", own, "--tls-key", key, "--host", "127.0.0.1"]
    closed = ["--dashboard-address", "127.0.0.1:0"]
    port = ["--port", "0", "--protocol", "tls", "--scheduler-file", str(place)]
    cli, null = [sys.executable, "-m"], {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT}
    with subprocess.Popen([*cli, "distributed.cli.dask_scheduler", *port, *tls, *closed], **null) as there:
        while not (place.is_file() and (text := place.read_text())):
            assert there.poll() is None
            time.sleep(0.05)
        address = json.loads(text)["address"]
        one = ["--no-nanny", "--nthreads", "1", "--death-timeout", "10"]
        with subprocess.Popen([*cli, "distributed.cli.dask_worker", address, *one, *tls, *closed], **null) as worker:
            try:
                yield address
            finally:
                worker.kill()
                there.kill()


def settings(authority, own, key):
    """Dask's own, as in ~/.config/dask/distributed.yaml."""
    comm, client = "distributed.comm", "distributed.comm.tls.client"
    given = {f"{comm}.tls.ca-file": authority, f"{client}.cert": own, f"{client}.key": key}
    return {f"{comm}.require-encryption": True, **given}


@pytest.mark.parametrize(
    ("name", "mode", "words"),
    [
        ("own-key.pem", 0o640, "holds a private key and can be read by other users: chmod 600"),
        ("own-key.pem", 0o604, "holds a private key and can be read by other users: chmod 600"),
        ("own-key.pem", 0o602, "can be written by every user"),
        ("own.pem", 0o646, "can be written by every user"),
        ("authority.pem", 0o666, "can be written by every user"),
        ("own.pem", 0o644, "no Dask scheduler answers"),
    ],
)
def test_credentials_in_which_others_have_a_hand_are_refused(tmp_path, monkeypatch, name, mode, words):
    import dask
    import distributed  # noqa: F401  # whose defaults have to be there before they are set

    monkeypatch.setattr(cluster, "CONNECT_S", 0.1)
    ours = certificates(tmp_path / "ours")
    file = tmp_path / "ours" / name
    file.chmod(mode)
    with dask.config.set(settings(*ours)), pytest.raises(ConfigError, match=words) as error:
        Cluster(scheduler="tls://127.0.0.1:9")
    (line,) = error.value.lines
    assert line.startswith(f"scheduler: {file}: " if "answers" not in words else "scheduler: ")


@pytest.mark.slow
def test_a_scheduler_with_certificates_of_ones_own(tmp_path, monkeypatch):
    """The same sums over tls://; a certificate of another authority opens nothing."""
    import dask
    import distributed  # noqa: F401  # whose defaults have to be there before they are set

    ours, theirs = certificates(tmp_path / "ours"), certificates(tmp_path / "theirs")
    with encrypted(*ours, tmp_path / "scheduler.json") as address:
        assert address.startswith("tls://127.0.0.1:")
        with dask.config.set(settings(*ours)), Cluster(scheduler=address) as workers:
            assert same(collect(WORK, N, executor=workers))
        monkeypatch.setattr(cluster, "CONNECT_S", 1)
        monkeypatch.setitem(cluster.SETTINGS, "distributed.comm.timeouts.connect", "1s")
        with dask.config.set(settings(*theirs)), pytest.raises(ConfigError, match="no Dask scheduler answers"):
            Cluster(scheduler=address)
