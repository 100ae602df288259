"""Files written completely or not at all, under a lock.

A regular file is written under a temporary name in the same folder and then renamed, so that a reader, a full disk or a
kill never leaves half of it. An existing file keeps its permissions to read, a new one has those of the umask; nobody
but the user may write to it. A link is kept, and its target replaced. A stream (a terminal, a pipe, /dev/null) is
written directly. Directories and disks are refused."""

import csv
import errno
import io
import json
import os
import shutil
import stat
import threading
import time
import unicodedata
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import BinaryIO, Self

from radarsim.errors import ConfigError, StoreError
from radarsim.private_files import create_readable_file, make_readable_folder

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # not a POSIX system: nothing is locked
    fcntl = None

WAIT_S, LOOK_S = 60.0, 0.02
PENDING, ORDER = ".pending", ".order.json"  # folder of files that are being moved into place; which, in their order


def read(path: str | os.PathLike) -> bytes:
    """The content of a regular file. OSError, without waiting, for a pipe, a device or a directory in its place."""
    _finish_replacement(Path(path).parent)
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))  # or a pipe would wait for a writer
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "is no regular file", str(path))
        return file.read()


def replace_all(
    folder: Path, contents: Mapping[str, bytes], stale: Callable[[Path], Iterable[str]] = lambda folder: ()
) -> None:
    """Write contents (relative path: bytes) below folder: all into a temporary folder first, then moved into place.

    So a full disk leaves the outputs of an earlier run unchanged, and a process that ends at any moment leaves either
    these or all of the new ones: moves that it had begun are finished by whoever next reads or writes the folder.
    Moving is done under a lock, so that of two writers of one folder only the last one's files remain. Paths returned
    by `stale` below the folder, and not among the contents, are removed. Raises StoreError."""
    folder = Path(folder)
    _refuse_twins(folder, contents)
    staging = temporary_path(folder / PENDING.strip("."))
    try:
        try:
            make_readable_folder(folder)
            for name, data in contents.items():
                make_readable_folder((folder / name).parent)
                make_readable_folder((staging / name).parent)
                with create_readable_file(staging / name) as file:
                    file.write(data)
            with folder_lock(folder):
                _finish_replacement(folder)
                for name in contents:
                    _refuse_special(folder / name)
                removed = sorted(set(stale(folder)) - set(contents))
                with create_readable_file(staging / ORDER) as file:
                    file.write(json.dumps({"moved": list(contents), "removed": removed}).encode())
                os.rename(staging, folder / PENDING)
                _finish_replacement(folder)
        finally:
            shutil.rmtree(staging, ignore_errors=True)
    except OSError as error:
        file_name = str(error.filename or folder).replace(f"{staging.name}{os.sep}", "")
        raise StoreError(f"{file_name}: cannot be written: {error.strerror or error}") from error


def _finish_replacement(folder: Path) -> None:
    """Move the files of a replacement that was begun into their places, if there is one."""
    pending = folder / PENDING
    if not pending.is_dir():
        return
    with folder_lock(folder):
        try:
            order = json.loads((pending / ORDER).read_bytes())
        except FileNotFoundError:  # all is moved already
            shutil.rmtree(pending, ignore_errors=True)
            return
        for name in filter(_is_inside, order["moved"]):
            if (pending / name).is_file():
                rename(pending / name, folder / name)
        for name in filter(_is_inside, order["removed"]):
            (folder / name).unlink(missing_ok=True)
        (pending / ORDER).unlink()
        shutil.rmtree(pending)


def _is_inside(name: str) -> bool:
    """Whether a path from a folder leads nowhere outside it."""
    return not Path(name).is_absolute() and ".." not in Path(name).parts


def create(path: Path, data: bytes) -> None:
    """Write a new file, completely or not at all. Raises FileExistsError where the name is taken, StoreError."""
    temporary = temporary_path(path)
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
def folder_lock(folder: Path) -> Iterator[None]:
    """Lock a folder for this thread: others, of any process of this machine, wait until it is free. The lock leaves no
    file and ends with its process. Where the file system has none, nobody waits. A thread may lock a folder twice.
    Raises StoreError where it is not free within WAIT_S."""
    key = _key(folder)
    locked_keys = _held.__dict__.setdefault("keys", set())
    if fcntl is None or key is None or key in locked_keys:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        _wait_for(descriptor, folder)
        locked_keys.add(key)
        yield
    finally:
        locked_keys.discard(key)
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
    first_names: dict[str, str] = {}
    for name in names:
        first = first_names.setdefault(unicodedata.normalize("NFC", name).casefold(), name)
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


def temporary_path(path: Path) -> Path:
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


def same_file(path: str | os.PathLike, other_path: str | os.PathLike) -> bool:
    """Whether two paths lead to the same file, also through links or where only the case of letters differs."""
    try:
        return os.path.samefile(path, other_path)
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
        self._temporary = None if self._stream else temporary_path(self._target)
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
