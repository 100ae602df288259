"""Tasks on a Dask cluster: processes of this machine, or the workers of a scheduler. The only file that uses Dask.

A task travels as the pickled work (a case: a few kilobytes) and the piece; the worker prepares a work once and keeps
it. Workers may come and go: Dask hands the tasks of a dead one to another. They must have the same sources, which the
identity of the work shows.

Credentials are Dask's: those of `Security.temporary` for the processes that a run starts, the user's own settings for a
scheduler. All of it reaches workers as Dask's settings, in their environment, which other users cannot read."""

import contextlib
import ipaddress
import logging
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import time
from functools import lru_cache
from itertools import count
from queue import Empty, SimpleQueue
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, Self

from radarsim.engine.blocks import Node, Partial, Work
from radarsim.engine.executors import Outcome, run_task
from radarsim.errors import ClusterError, ConfigError, Interruption, argument
from radarsim.system.private_files import distrust_reason

if TYPE_CHECKING:
    from distributed import Future, LocalCluster

CONNECT_S = 10
WORKERS_S = 30  # how long a scheduler may have no worker
MAX_WORKER_DEATHS = 20  # of workers running one task, after which it is taken as their cause
RESULT_S = 60  # how long the sums of a block may take from a worker
HOLDER_S = 5  # the same on this machine before checking whether the worker lives
LOOK_S = 1.0
STEP_S = 30  # by which the clock of this machine may be set back between two looks
SCHEMES = ("tcp", "tls")
LOOPBACK = "127.0.0.1"  # servers started on this machine listen only here
HINT = "--workers and --scheduler need Dask: pip install 'radarsim[cluster]'"
QUIET = ("distributed", "distributed.nanny", "distributed.worker", "distributed.scheduler", "distributed.comm")
SETTINGS = {
    "distributed.scheduler.allowed-failures": MAX_WORKER_DEATHS,
    "distributed.comm.timeouts.connect": f"{CONNECT_S}s",
}
TLS = "distributed.comm.tls"


def _dask() -> ModuleType:
    try:
        import distributed
    except ImportError as error:
        raise ConfigError(f"{HINT} ({error})") from error
    return distributed


def scheduler_warning(address: str) -> str | None:
    """A note on the trust that the scheduler at an address requires, in one line; None for one of this machine."""
    host = address.partition("://")[2] or address
    host = host.rpartition(":")[0].strip("[]")
    if host == "localhost" or _is_loopback(host):
        return None
    if address.startswith("tls://"):
        return f"{address}: whoever holds a certificate of its authority may run programs on its workers"
    return (
        f"{address}: neither encrypted nor authenticated: whoever reaches it may run programs on its workers and give "
        "this run false sums; on a network that you do not trust use tls:// (docs/scale.md)"
    )


def _is_loopback(host: str) -> bool:
    """Whether a host is an address of this machine alone; 127.example.com is a name, and may be anywhere."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _temporary(distributed: ModuleType) -> dict[str, object]:
    """Dask's settings for a certificate and its key that exist for one run, in memory. ConfigError without the package
    `cryptography`, by which Dask makes them."""
    try:
        security = distributed.Security.temporary()
    except ImportError as error:
        raise ConfigError(f"{HINT} ({error})") from error
    parts = [(role, part) for role in ("client", "scheduler", "worker") for part in ("cert", "key")]
    roles = {f"{TLS}.{role}.{part}": getattr(security, f"tls_{role}_{part}") for role, part in parts}
    return {"distributed.comm.require-encryption": True, f"{TLS}.ca-file": security.tls_ca_file, **roles}


def _check_credentials(distributed: ModuleType) -> None:
    """ConfigError where Dask's own settings for tls:// name no authority, a file that cannot be read, or one in which
    another user may have a hand."""
    hint = f"tls:// needs Dask's settings {TLS} (ca-file, client.cert, client.key), see docs/scale.md"
    security = distributed.Security()
    key = security.tls_client_key or security.tls_client_cert  # a key may stand in the file of its certificate
    try:
        for text in filter(None, {security.tls_ca_file, security.tls_client_cert, key}):
            if "\n" not in text and (reason := distrust_reason(text) or (text == key and _key_exposure(text))):
                raise ConfigError(f"{argument('scheduler')}: {text}: {reason}")
        context = security.get_connection_args("client").get("ssl_context")
    except (OSError, ValueError, TypeError) as error:
        raise ConfigError(f"{argument('scheduler')}: {hint}: {error}") from error
    if context is None:
        raise ConfigError(f"{argument('scheduler')}: {hint}")


def _key_exposure(key: str) -> str | None:
    """Why a file is no place for a private key, as a phrase that follows its name; None where it is one."""
    if not hasattr(os, "geteuid"):
        return None
    status = os.stat(key)
    foreign_access = 0o077 if status.st_uid == os.geteuid() else 0o007  # root may let a group read its keys
    return "holds a private key and can be read by other users: chmod 600" if status.st_mode & foreign_access else None


def _check(distributed: ModuleType, address: str) -> None:
    """ConfigError for an invalid address: a Client that cannot read it takes half a minute to report it."""
    scheme, separator, _ = address.partition("://")
    if separator and scheme not in SCHEMES:
        raise ConfigError(
            f"{argument('scheduler')}: must be an address such as tcp://host:8786, got {address!r}: only tcp and tls"
        )
    try:
        distributed.comm.resolve_address(address)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"{argument('scheduler')}: must be an address such as tcp://host:8786, got {address!r}: {error}"
        ) from error
    if scheme == "tls":
        _check_credentials(distributed)


class Cluster:
    """The workers of a Dask scheduler, as an executor; to be entered, and left when all runs are done."""

    shortest_s = 0.05
    longest_s = 0.5

    def __init__(self, workers: int | None = None, scheduler: str | None = None):
        """So many worker processes on this machine, or the workers of the scheduler at an address. Raises ConfigError
        where Dask is missing, the address is wrong, or no worker appears within half a minute."""
        distributed = _dask()
        import dask

        for name in QUIET:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._killed_worker = distributed.scheduler.KilledWorker
        self._done: SimpleQueue[Future] = SimpleQueue()
        self._tasks: dict[str, tuple[Future, Work, Node | Partial]] = {}  # by key
        self._running: set[str] = set()  # after a cancel: those that may finish
        self._numbers = count()
        self._last_look_s = self._last_worker_s = time.monotonic()
        self._time_of_day = time.time()
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._scheduler: LocalCluster | None = None
        self._processes: _Processes | None = None
        self._address = scheduler or "this machine"
        settings = SETTINGS
        if scheduler is None:
            # Dask imports from its scratch folders before all others; the usual one may be another user's.
            self._folder = tempfile.TemporaryDirectory(prefix="radarsim-", ignore_cleanup_errors=True)
            settings = {**SETTINGS, **_temporary(distributed), "temporary-directory": self._folder.name}
        with dask.config.set(settings):
            if scheduler is not None:
                _check(distributed, scheduler)
                address = scheduler
            else:
                options = {"host": LOOPBACK, "protocol": "tls", "dashboard_address": f"{LOOPBACK}:0"}
                self._scheduler = distributed.LocalCluster(
                    n_workers=0, processes=False, silence_logs=logging.CRITICAL, **options
                )
                address = self._scheduler.scheduler_address
            try:
                self._client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
            except OSError as error:
                raise ConfigError(
                    f"{argument('scheduler')}: no Dask scheduler answers at {scheduler}: {error}"
                ) from error
        if workers is not None:
            self._processes = _Processes(workers, address, str(dask.config.serialize(settings)))
        self._wait_for_workers(workers or 1)

    def _wait_for_workers(self, required: int) -> None:
        end = time.monotonic() + WORKERS_S
        while self._count() < required:
            if time.monotonic() > end:
                self.close()
                raise ConfigError(
                    f"{argument('scheduler')}: no worker is connected to {self._address}; `dask worker` starts one"
                )
            time.sleep(0.1)

    def _count(self) -> int:
        self.workers = sum(self._client.nthreads().values())
        self.depth = 2 * self.workers + 2
        return self.workers

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: BaseException | TracebackType | None) -> None:
        if kind is Interruption:  # whose process ends at once; an orderly end would take two seconds
            self._kill()
        else:
            self.close()

    def _kill(self) -> None:
        """End the workers of this machine, with what they wrote."""
        if self._processes is not None:
            self._processes.kill()
        if self._folder is not None:
            self._folder.cleanup()

    def submit(self, work: Work, piece: Node | Partial) -> None:
        """Submit a task; returns at once."""
        number = next(self._numbers)
        key = f"radarsim-{work.identity[:16]}-{piece.name}-{number}"
        arguments = (pickle.dumps(work), work.identity, piece)
        future = self._client.submit(_run_task, *arguments, key=key, pure=False, priority=-number)
        self._tasks[key] = future, work, piece
        future.add_done_callback(self._done.put)

    def take_outcomes(self, timeout_s: float) -> list[Outcome]:
        """Outcomes since the last call, waiting at most timeout_s for the first. Raises ClusterError when the scheduler
        or all workers are gone, or a task cannot run there at all."""
        outcomes: list[Outcome] = []
        with contextlib.suppress(Empty):
            outcomes += self._outcomes_of(self._done.get(timeout=timeout_s))
            while True:
                outcomes += self._outcomes_of(self._done.get_nowait())
        self._look()
        return outcomes

    def _outcomes_of(self, future: "Future") -> list[Outcome]:
        key = str(future.key)
        task = self._tasks.pop(key, None)
        if task is None:  # cancelled before
            return []
        self._running.discard(key)
        if future.status == "finished":
            try:
                return [self._sums(future)]
            except TimeoutError as late:
                raise ClusterError(
                    f"{self._address}: a worker does not send its sums within {RESULT_S} s; what was finished is stored"
                ) from late
            except Exception:  # the worker died before it was reached: retry
                pass
            self.submit(*task[1:])
            return []
        if future.status == "cancelled":
            raise self._scheduler_lost_error()
        error = future.exception()
        if isinstance(error, self._killed_worker):
            raise ClusterError(
                f"{self._address}: {MAX_WORKER_DEATHS} workers died under the same blocks; what was finished is stored"
            )
        if isinstance(error, ConfigError):
            raise error
        raise ClusterError(f"{self._address}: a worker cannot run the blocks: {type(error).__name__}: {error}")

    def _sums(self, future: "Future") -> Outcome:
        """The result of a task. Raises TimeoutError after RESULT_S. If all its holders have died, others compute it
        again; on this machine these have to be started."""
        end = time.monotonic() + RESULT_S
        while self._processes is not None:
            try:
                return future.result(timeout=HOLDER_S)
            except TimeoutError:
                if time.monotonic() > end:
                    raise
                self._processes.replace()
        return future.result(timeout=RESULT_S)

    def _look(self) -> None:
        """About once a second: check the clock, the scheduler and which workers are connected."""
        now_s = time.monotonic()
        if now_s < self._last_look_s + LOOK_S:
            return
        time_of_day = time.time()
        set_back_s = now_s - self._last_look_s - (time_of_day - self._time_of_day)
        self._last_look_s, self._time_of_day = now_s, time_of_day
        if set_back_s > STEP_S:  # Dask sends no message before the time of day at which it was due
            raise ClusterError(
                f"{self._address}: its clock was set back by {set_back_s:.0f} s, for which Dask would wait; what was "
                "finished is stored, run again to continue"
            )
        if self._processes is not None:
            self._processes.replace()
        if self._client.status != "running":
            raise self._scheduler_lost_error()
        try:
            working = self._count()
        except Exception as error:
            raise self._scheduler_lost_error() from error
        if working:
            self._last_worker_s = now_s
        elif now_s > self._last_worker_s + WORKERS_S:
            raise ClusterError(f"{self._address}: no worker for {WORKERS_S} s; what was finished is stored")

    def _scheduler_lost_error(self) -> ClusterError:
        return ClusterError(
            f"{self._address}: the scheduler went away; what was finished is stored, run again to continue"
        )

    def cancel(self) -> int:
        """Drop the tasks not yet started; their number."""
        waiting = self._tasks.keys() - self._running
        if not waiting:
            return 0
        try:
            stacks = self._client.call_stack(keys=list(waiting)) if self._client.status == "running" else {}
            started = {str(key) for tasks in stacks.values() for key in tasks}
        except Exception:  # whatever Dask raises, nothing is then known to run
            started = set()
        self._running |= waiting & started
        dropped = [self._tasks.pop(key)[0] for key in waiting - started]
        with contextlib.suppress(Exception):
            self._client.cancel(dropped, force=True)
        return len(dropped)

    def forget(self) -> None:
        """Drop all tasks, also running ones."""
        futures = [future for future, _, _ in self._tasks.values()]
        self._tasks.clear()
        self._running.clear()
        self._done = SimpleQueue()
        if futures:
            with contextlib.suppress(Exception):
                self._client.cancel(futures, force=True)

    def close(self) -> None:
        """Release the workers without waiting for running tasks; those of this machine end."""
        self._kill()
        logging.disable(logging.CRITICAL)  # complaints of a cluster that is torn down under its tasks
        try:
            with contextlib.suppress(Exception):
                self._client.close(timeout=1)
            with contextlib.suppress(Exception):
                if self._scheduler is not None:
                    self._scheduler.close(timeout=1)
        finally:
            logging.disable(logging.NOTSET)


class _Processes:
    """Worker processes on this machine, in sessions of their own: Ctrl-C in a terminal reaches only the run. They are
    new processes, not forks of a process with live threads. One that dies is replaced; all end when the scheduler, and
    so this process, is gone."""

    def __init__(self, workers: int, address: str, settings: str):
        options = ["--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--death-timeout", "10"]
        # Without the latter a worker serves HTTP to the whole network even with --no-dashboard.
        closed = ["--host", LOOPBACK, "--no-dashboard", "--dashboard-address", f"{LOOPBACK}:0"]
        # -P: modules of the working directory, which may be anybody's, are not imported.
        self._command = [sys.executable, "-P", "-m", "distributed.cli.dask_worker", address, *options, *closed]
        path = os.pathsep.join(filter(None, sys.path))
        self._environment = os.environ | {"PYTHONPATH": path, "DASK_INTERNAL_INHERIT_CONFIG": settings}
        self._running = [self._start() for _ in range(workers)]

    def _start(self) -> subprocess.Popen[bytes]:
        null = subprocess.DEVNULL
        return subprocess.Popen(
            self._command, env=self._environment, start_new_session=True, stdin=null, stdout=null, stderr=null
        )

    def replace(self) -> None:
        """Start a new process for each that has died."""
        self._running = [process if process.poll() is None else self._start() for process in self._running]

    def kill(self) -> None:
        """End them all at once."""
        for process in self._running:
            process.kill()
        for process in self._running:
            process.wait()
        self._running = []


_preparation_lock = threading.Lock()


@lru_cache(maxsize=4)
def _prepare_work(pickled: bytes) -> Work:
    work = pickle.loads(pickled)
    work.block  # noqa: B018  (prepares it)
    return work


def _run_task(pickled: bytes, identity: str, piece: Node | Partial) -> Outcome:
    """Run one task on a worker. ConfigError if the worker would compute other numbers than the run expects."""
    with _preparation_lock:
        work = _prepare_work(pickled)
    if work.identity != identity:
        raise ConfigError("--scheduler: a worker has other sources than this machine; install the same radarsim there")
    return run_task(work, piece)
