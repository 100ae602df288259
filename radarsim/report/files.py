"""Files are written completely or not at all.

A regular file is written under a temporary name beside it and renamed, so that a reader, a full disk or a kill never
leaves half of it. Who may read it stays as it was, of a new one as the umask has it; nobody but the user may write to
it. A link stays, and its target is replaced. A stream (a terminal, a pipe, /dev/null) is written directly. Directories
and disks are refused.

run.json: the request, the software, and the outcome. Times are here and in the report, never in a CSV."""

import csv
import errno
import hashlib
import io
import json
import os
import platform
import stat
import threading
import time
import unicodedata
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO, Self

from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError, StoreError
from radarsim.language import numeral, plural, tr
from radarsim.private_files import create_readable_file, make_readable_folder

if TYPE_CHECKING:
    from radarsim.engine.results import CaseResult


# ---- files -----------------------------------------------------------------------------------------------------------
fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # not a POSIX system: nothing is locked
    fcntl = None

WAIT_S, LOOK_S = 60.0, 0.02


def read(path: str | os.PathLike) -> bytes:
    """The content of a regular file. OSError, without waiting, for a pipe, a device or a directory in its place."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))  # or a pipe would wait for a writer
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "is no regular file", str(path))
        return file.read()


def replace_all(
    folder: Path, contents: Mapping[str, bytes], stale: Callable[[Path], Iterable[str]] = lambda folder: ()
) -> None:
    """Write contents (relative path: bytes) below folder: all under temporary names first, then renamed in their order.

    So a full disk leaves the outputs of an earlier run unchanged. Renaming is done under a lock, so that of two writers
    of one folder only the last one's files remain. Paths returned by `stale` below the folder, and not among the
    contents, are removed. Raises StoreError."""
    folder = Path(folder)
    _refuse_twins(folder, contents)
    written: dict[Path, Path] = {}
    try:
        try:
            for name, data in contents.items():
                temporary = written[folder / name] = beside(folder / name)
                make_readable_folder(temporary.parent)
                with create_readable_file(temporary) as file:
                    file.write(data)
            with locked(folder):
                gone = set(stale(folder)) - set(contents)
                for path, temporary in written.items():
                    _refuse_special(path)
                    rename(temporary, path)
                for name in gone:
                    if not Path(name).is_absolute() and ".." not in Path(name).parts:
                        (folder / name).unlink(missing_ok=True)
        finally:
            for temporary in written.values():
                temporary.unlink(missing_ok=True)
    except OSError as error:
        meant = {str(temporary): path for path, temporary in written.items()}  # what was to be made of it
        named = meant.get(str(error.filename), error.filename or folder)
        raise StoreError(f"{named}: cannot be written: {error.strerror or error}") from error


def create(path: Path, data: bytes) -> None:
    """Write a new file, completely or not at all. Raises FileExistsError where the name is taken, StoreError."""
    temporary = beside(path)
    try:
        try:
            with create_readable_file(temporary) as file:
                file.write(data)
            create_readable_file(path).close()  # takes the name, if it is free
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except FileExistsError:
        raise
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder for this thread: others, of any process of this machine, wait until it is free. The lock leaves no
    file and ends with its process. Where the file system has none, nobody waits. A thread may lock a folder twice.
    Raises StoreError where it is not free within WAIT_S."""
    key = _key(folder)
    held = _held.__dict__.setdefault("keys", set())
    if fcntl is None or key is None or key in held:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        _wait_for(descriptor, folder)
        held.add(key)
        yield
    finally:
        held.discard(key)
        os.close(descriptor)


_held = threading.local()


def _key(folder: Path) -> tuple[int, int] | None:
    try:
        status = os.stat(folder)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _wait_for(descriptor: int, folder: Path) -> None:
    assert fcntl is not None  # or nobody waits, see `locked`
    end = time.monotonic() + WAIT_S
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > end:
                raise StoreError(f"{folder}: another process has been writing there for {WAIT_S:g} s") from None
            time.sleep(LOOK_S)
        except OSError:  # a file system without locks
            return


def _refuse_twins(folder: Path, names: Iterable[str]) -> None:
    """StoreError for names that are one file on a case-insensitive file system."""
    seen: dict[str, str] = {}
    for name in names:
        first = seen.setdefault(unicodedata.normalize("NFC", name).casefold(), name)
        if first != name:
            raise StoreError(f"{folder}: {first} and {name} are the same file on some file systems; nothing is written")


def _refuse_special(path: Path) -> None:
    """OSError where an output's path is a pipe, a device or a socket; a link is replaced, never followed."""
    try:
        kind = os.lstat(path).st_mode
    except OSError:
        return
    if not (stat.S_ISREG(kind) or stat.S_ISLNK(kind)):
        raise OSError(errno.EINVAL, "is no regular file", str(path))


def beside(path: Path) -> Path:
    """A unique name for a temporary file, in the folder of its destination."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")


def rename(temporary: Path, path: Path) -> None:
    """Rename a finished temporary file to its destination. Of an existing file it keeps who may read it."""
    try:
        mode = stat.S_IMODE(os.stat(path).st_mode)
    except OSError:
        pass
    else:
        os.chmod(temporary, mode & ~0o022)
    os.replace(temporary, path)


def same_file(one: str | os.PathLike, other: str | os.PathLike) -> bool:
    """Whether two paths are one file, also by links or by another case of their letters."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return False


class Writer:
    """A file at a path given by the user, CSV or bytes: written completely or not at all, or a stream, directly.

    sources: files that are read, by their names in messages; a path to one of them raises ConfigError, and so does a
    path to neither a file nor a stream. Disk faults become StoreError."""

    def __init__(self, path: str | os.PathLike, sources: Mapping[str, str | os.PathLike | None] = MappingProxyType({})):
        self.path = Path(path)
        try:
            kind = os.stat(self.path).st_mode
        except OSError:
            kind = stat.S_IFREG
        if stat.S_ISDIR(kind) or stat.S_ISBLK(kind):
            raise ConfigError(f"{self.path}: must be a file, got a {'directory' if stat.S_ISDIR(kind) else 'disk'}")
        self._stream = not stat.S_ISREG(kind)
        for name, source in sources.items():
            if source is not None and not self._stream and same_file(path, source):
                raise ConfigError(f"{self.path}: must be another file than {name}, which would be lost")

    def __enter__(self) -> Self:
        self._target = Path(os.path.realpath(self.path))
        self._temporary = None if self._stream else beside(self._target)
        try:
            opened = create_readable_file(self._temporary) if self._temporary else open(self.path, "wb")
        except OSError as error:
            raise self._fault(error) from error
        self._file = io.TextIOWrapper(opened, encoding="utf-8", newline="")
        self._rows = csv.writer(self._file, lineterminator="\n")
        return self

    @property
    def binary(self) -> BinaryIO:
        """The file for bytes, in place of rows."""
        return self._file.buffer

    def write(self, rows: Iterable[Sequence[str]]) -> None:
        """Write rows of text."""
        try:
            self._rows.writerows(rows)
        except OSError as error:
            raise self._fault(error) from error

    def __exit__(self, kind: type[BaseException] | None, raised: BaseException | None, *_: object) -> None:
        try:
            if isinstance(raised, OSError):
                raise raised
            self._file.close()
            if kind is None and self._temporary is not None:
                rename(self._temporary, self._target)
        except OSError as error:
            raise self._fault(error) from error
        finally:
            if self._temporary is not None:
                self._temporary.unlink(missing_ok=True)

    def _fault(self, error: OSError) -> StoreError:
        return StoreError(f"{self.path}: cannot be written: {error.strerror or error}")


# ---- provenance ------------------------------------------------------------------------------------------------------
MOST_SEEDS = 5  # named in a line
PACKAGES = ("radarsim", "numpy", "numba", "llvmlite", "scipy", "pandas", "matplotlib", "pydantic", "pyyaml")


def record(
    experiment: Experiment,
    results: "Sequence[CaseResult]",
    run: Mapping[str, Any],
    contents: Mapping[str, bytes],
    answer: Sequence[str],
    machine: Mapping[str, object],
) -> dict[str, Any]:
    """All of run.json except the report's own hash.

    run: the facts of the run (stop reason, threads, times, warnings, identities …), copied; contents: the outputs, by
    path; machine: its description. Realisations requested and done are sums over the cases, which may differ in both.
    """
    facts = dict(run)
    stop = facts.pop("stop", "done")
    done = {result.name: result.count for result in results}
    return {
        "config": experiment.stem,
        "config_path": path_of(experiment),
        "study": experiment.study,
        "answer": list(answer),
        "realisations_asked": sum(case.realisations for case in experiment.cases),
        "realisations_done": sum(done.get(case.name, 0) for case in experiment.cases),
        "cases": {
            case.name: {"asked": case.realisations, "done": done.get(case.name, 0), "seed": case.seed}
            for case in experiment.cases
        },
        "stop": stop,
        "seed": experiment.seed,
        "resolved": experiment.resolved,
        "resolved_sha256": asked(experiment),
        **facts,
        "versions": versions(),
        "machine": dict(machine),
        "outputs": {path: hashlib.sha256(data).hexdigest() for path, data in sorted(contents.items())},
    }


def asked(experiment: Experiment) -> str:
    """SHA-256 of a resolved config in hexadecimal."""
    return hashlib.sha256(to_json(experiment.resolved)).hexdigest()


def with_output(made: dict, path: str, data: bytes) -> dict:
    """The record with one more output."""
    return {**made, "outputs": {**made["outputs"], path: hashlib.sha256(data).hexdigest()}}


def earlier(folder: Path, name: str = "run.json") -> dict:
    """The record of an earlier run in a folder; empty where none can be read."""
    try:
        record = json.loads(read(folder / name))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}


def outputs(folder: Path, name: str = "run.json") -> list[str]:
    """The outputs that an earlier record of the folder names; none where there is no such record."""
    named = earlier(folder, name).get("outputs")
    return [path for path in named if isinstance(path, str)] if isinstance(named, dict) else []


def replaced(folder: Path, experiment: Experiment) -> list[str]:
    """A warning where a folder holds the results of another config of the same name."""
    record = earlier(folder)
    before, now = record.get("config_path"), path_of(experiment)
    if not isinstance(before, str) or before == now or is_of(folder, experiment):
        return []
    return [f"{folder}: held the results of another config of this name, {before}; they are replaced"]


def is_of(folder: Path, experiment: Experiment) -> bool:
    """Whether a folder holds the results of an experiment, with any seed and number of realisations."""
    return _asked(earlier(folder).get("resolved")) == _asked(experiment.resolved)


def path_of(experiment: Experiment) -> str:
    """The file of a config, as printable text."""
    if experiment.path is None:
        return "a mapping in Python"
    return os.fsencode(os.path.abspath(experiment.path)).decode("utf-8", "backslashreplace")


def _asked(resolved: Any) -> object:
    """A resolved config without its number of realisations and seed."""
    try:
        cases = [{key: case[key] for key in case if key not in ("realisations", "seed")} for case in resolved["cases"]]
    except (LookupError, TypeError):
        return None
    return json.loads(to_json(cases))


def extent(record: Mapping) -> str:
    """Realisations of a case and the seeds in words; the requested number only where a case is short of it."""
    cases = record["cases"].values()
    done, asked, seeds = (sorted({case[key] for case in cases}) for key in ("done", "asked", "seed"))
    most, said = max(done, default=0), {"done": span(done), "asked": span(asked)}
    short = any(case["done"] < case["asked"] for case in cases)
    if len(cases) > 1 and short:
        words = plural(
            "{done} realisation a case of {asked} requested",
            "{done} realisations a case of {asked} requested",
            most,
            **said,
        )
    elif len(cases) > 1:
        words = plural("{done} realisation a case", "{done} realisations a case", most, **said)
    elif short:
        words = plural(
            "{done} realisation of {asked} requested", "{done} realisations of {asked} requested", most, **said
        )
    else:
        words = plural("{done} realisation", "{done} realisations", most, **said)
    named = ", ".join(map(str, seeds[:MOST_SEEDS])) + (", …" if len(seeds) > MOST_SEEDS else "")
    return plural("{words}, seed {seeds}", "{words}, seeds {seeds}", len(seeds), words=words, seeds=named)


def span(counts: Sequence[int]) -> str:
    """Counts in words: a single one, or the least to the largest."""
    low, high = min(counts, default=0), max(counts, default=0)
    return numeral(f"{low:,}") if low == high else tr("{low:,} to {high:,}", low=low, high=high)


def in_all(counts: Sequence[int]) -> str:
    """The span of numbers of realisations, with the noun."""
    return plural("{done} realisation", "{done} realisations", max(counts, default=0), done=span(counts))


def to_json(value: object) -> bytes:
    """JSON as written to files: readable, keys in their order, without NaN."""
    return (json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


@cache  # a tenth of a small run's time, asked for several times
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that affect numbers or figures."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
