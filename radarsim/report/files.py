"""Files that are there whole or not at all.

A regular file is written under a temporary name beside it and renamed, so that a reader, a full disk or a kill never
meets half of it. It keeps the mode it had; a new one has what the umask leaves. A link stays, and what it leads to is
replaced. A stream (a terminal, a pipe, /dev/null) has nothing to replace and is written through. Directories and disks
are refused.
"""

import csv
import errno
import io
import os
import stat
import threading
import time
import unicodedata
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Self

from radarsim.errors import ConfigError, StoreError

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

    So a full disk leaves the outputs of an earlier run as they were. The renaming is done under a lock, so that two
    writers of one folder leave the files of the last of them alone. Of the paths that `stale` gives of the folder,
    those below it and not among the contents are removed. Raises StoreError.
    """
    folder = Path(folder)
    _refuse_twins(folder, contents)
    written: dict[Path, Path] = {}
    try:
        try:
            for name, data in contents.items():
                temporary = written[folder / name] = beside(folder / name)
                temporary.parent.mkdir(parents=True, exist_ok=True)
                temporary.write_bytes(data)
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
    """Write a new file, whole or not at all. Raises FileExistsError where there is anything, StoreError."""
    temporary = beside(path)
    try:
        try:
            temporary.write_bytes(data)
            with open(path, "xb"):  # takes the name, if it is free
                pass
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except FileExistsError:
        raise
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this thread: another that asks for it, of any process of this machine, waits until it is free.

    The lock leaves no file and ends with its process. Where the file system has none, nobody waits. A thread may hold
    a folder twice. Raises StoreError where it is not free within WAIT_S.
    """
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
    """StoreError for names that are one file where letters of either case are the same."""
    seen: dict[str, str] = {}
    for name in names:
        first = seen.setdefault(unicodedata.normalize("NFC", name).casefold(), name)
        if first != name:
            raise StoreError(f"{folder}: {first} and {name} are one file to some file systems; nothing is written")


def _refuse_special(path: Path) -> None:
    """OSError where a pipe, a device or a socket stands in an output's place; a link is replaced, never followed."""
    try:
        kind = os.lstat(path).st_mode
    except OSError:
        return
    if not (stat.S_ISREG(kind) or stat.S_ISLNK(kind)):
        raise OSError(errno.EINVAL, "is no regular file", str(path))


def beside(path: Path) -> Path:
    """A name for a temporary file, of no other process or thread, in the folder of the file that it will become."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")


def rename(temporary: Path, path: Path) -> None:
    """Put a finished temporary file in the place of a file, whose mode it takes where there is one."""
    try:
        mode = stat.S_IMODE(os.stat(path).st_mode)
    except OSError:
        pass
    else:
        os.chmod(temporary, mode)
    os.replace(temporary, path)


def same_file(one: str | os.PathLike, other: str | os.PathLike) -> bool:
    """Whether two paths lead to one file, by links or by another case of their letters too."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return False


class Writer:
    """A CSV file at a path that the user gave: whole or not at all, or a stream that is written through.

    sources are files that are read, by what they are called; the path must lead to none of them: ConfigError. So is a
    path to no file or stream. Faults of the disk become StoreError.
    """

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
            opened = open(self._temporary or self.path, "xb" if self._temporary else "wb")
        except OSError as error:
            raise self._fault(error) from error
        self._file = io.TextIOWrapper(opened, encoding="utf-8", newline="")
        self._rows = csv.writer(self._file, lineterminator="\n")
        return self

    def write(self, rows: Iterable[Sequence[str]]) -> None:
        """Write rows of text."""
        try:
            self._rows.writerows(rows)
        except OSError as error:
            raise self._fault(error) from error

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            self._file.close()
            if kind is None and self._temporary is not None:
                rename(self._temporary, self._target)
        except OSError as error:
            raise self._fault(error) from error
        finally:
            if self._temporary is not None:
                self._temporary.unlink(missing_ok=True)

    def _fault(self, error: OSError) -> StoreError:
        return StoreError(f"{self.path}: cannot be written: {error.strerror}")
