"""Files written completely or not at all, under a lock.

A regular file is written under a temporary name in the same folder and then renamed, so that a reader, a full disk or a
kill never leaves half of it. An existing file keeps its permissions to read, a new one has those of the umask; nobody
but the user may write to it. A link is kept, and its target replaced. A stream (a terminal, a pipe, /dev/null) is
written directly. Directories and disks are refused.

Several files of a folder are replaced together: a journal, .replacing.json, names them once all new ones are safely on
disk. If the process is killed before, the old files stay; after that, whoever next reads or writes in the folder by
this module finishes the work."""

import csv
import errno
import glob
import io
import json
import os
import re
import stat
import threading
import time
import unicodedata
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import BinaryIO, NamedTuple, Self

from radarsim.errors import ConfigError, StoreError
from radarsim.system.private_files import (
    create_readable_file,
    foreign_owner,
    is_stale,
    make_readable_folder,
    write_private_file,
)
from radarsim.system.threads import mapping

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # not a POSIX system: nothing is locked
    fcntl = None

WAIT_S, LOOK_S = 60.0, 0.02
JOURNAL = ".replacing.json"
MAX_THREADS = 8


def read(path: str | os.PathLike) -> bytes:
    """The content of a regular file. OSError, without waiting, for a pipe, a device or a directory in its place.

    A replacement in its folder that was interrupted is finished first."""
    finish_replacement(Path(path).parent)
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))  # or a pipe would wait for a writer
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "is no regular file", str(path))
        return file.read()


def replace_all(
    folder: Path, contents: Mapping[str, bytes], stale: Callable[[Path], Iterable[str]] = lambda folder: ()
) -> None:
    """Write contents (relative path: bytes) below folder: all under temporary names first, then renamed in their order.

    So a full disk leaves the outputs of an earlier run unchanged; a kill or a power cut leaves all old files or all new
    ones, see `finish_replacement`. Renaming is done under a lock, so that of two writers of one folder only the last
    one's files remain. Paths returned by `stale` below the folder, and not among the contents, are removed. Raises
    StoreError."""
    folder = Path(folder)
    _refuse_twins(folder, contents)
    token = uuid.uuid4().hex
    try:
        try:
            for name, data in contents.items():
                temporary = temporary_path(folder / name, token)
                make_readable_folder(temporary.parent)
                with create_readable_file(temporary) as file:
                    file.write(data)
            _synchronise_all([temporary_path(folder / name, token) for name in contents])
            with folder_lock(folder):
                _finish(folder)
                for name in contents:
                    _refuse_special(folder / name)
                removed = [name for name in sorted({*stale(folder)} - {*contents}) if _is_inside(name)]
                _replace(folder, Replacement(token, tuple(contents), tuple(removed)))
                for name in contents:
                    sweep(folder / name)
        finally:
            for name in contents:
                temporary_path(folder / name, token).unlink(missing_ok=True)
    except OSError as error:
        file_name = str(error.filename or folder).removesuffix(f".{token}.tmp")
        path = Path(file_name)
        if file_name != str(error.filename or folder):
            path = path.with_name(path.name.removeprefix("."))  # the destination of a temporary file
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error


class Replacement(NamedTuple):
    """Files of a folder that are replaced together, by their paths in it, and files to be removed. The token is in the
    names of the temporary files."""

    token: str
    files: tuple[str, ...]
    removed: tuple[str, ...]


def finish_replacement(folder: Path) -> None:
    """Finish the replacement of files in a folder whose process was killed in the middle of it.

    Where the folder cannot be written, or the journal is of another user, nothing happens."""
    if not os.path.lexists(folder / JOURNAL):
        return
    with suppress(OSError), folder_lock(folder):
        _finish(folder)


def _replace(folder: Path, replacement: Replacement) -> None:
    """Replace files that are all written under temporary names."""
    several = len(replacement.files) + len(replacement.removed) > 1
    try:
        if several:
            write_private_file(folder / JOURNAL, json.dumps(replacement._asdict()).encode(), durable=True)
            synchronise(folder)
        _carry_out(folder, replacement)
    except OSError:
        (folder / JOURNAL).unlink(missing_ok=True)
        raise
    except BaseException:  # a signal: what began is finished
        if several and os.path.lexists(folder / JOURNAL):
            _carry_out(folder, replacement)
        raise


def _carry_out(folder: Path, replacement: Replacement) -> None:
    """Rename the temporary files that are still there, remove files, and then the journal."""
    for name in replacement.files:
        with suppress(FileNotFoundError):  # renamed before
            rename(temporary_path(folder / name, replacement.token), folder / name)
    for name in replacement.removed:
        (folder / name).unlink(missing_ok=True)
    if os.path.lexists(folder / JOURNAL):
        for place in {(folder / name).parent for name in replacement.files}:
            synchronise(place)
        (folder / JOURNAL).unlink()


def _finish(folder: Path) -> None:
    """Carry out the journal of a folder, if there is one."""
    path = folder / JOURNAL
    replacement = _journal(path) if os.path.lexists(path) else None
    if replacement is not None:
        _carry_out(folder, replacement)


def sweep(path: Path) -> None:
    """Remove temporary files for a path that a killed process left."""
    for temporary in path.parent.glob(f".{glob.escape(path.name)}.*.tmp"):
        with suppress(OSError):
            if TEMPORARY.fullmatch(temporary.name) and is_stale(temporary):
                temporary.unlink()


def _journal(path: Path) -> Replacement | None:
    """What a journal says; None where it is not one that `replace_all` of this user wrote."""
    try:
        if path.is_symlink() or foreign_owner(path) is not None:
            return None
        replacement = Replacement(**json.loads(path.read_bytes()))
        names = (*replacement.files, *replacement.removed)
        inside = os.path.realpath(path.parent)  # which a folder that is a link might leave
        places = {os.path.realpath((path.parent / name).parent) for name in names}
        valid = (
            re.fullmatch("[0-9a-f]{32}", replacement.token)
            and all(map(_is_inside, names))
            and all(os.path.commonpath([place, inside]) == inside for place in places)
        )
    except (ValueError, TypeError, RecursionError):
        return None
    return replacement if valid else None


def _is_inside(name: str) -> bool:
    """Whether a relative path leads to no place outside the folder where it begins."""
    return not Path(name).is_absolute() and ".." not in Path(name).parts and "\0" not in name


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


TEMPORARY = re.compile(r"\..+\.[0-9a-f]{32}\.tmp")


def temporary_path(path: Path, token: str = "") -> Path:
    """A name for a temporary file, in the folder of its destination; unique, unless its token is given."""
    return path.with_name(f".{path.name}.{token or uuid.uuid4().hex}.tmp")


def rename(temporary: Path, path: Path) -> None:
    """Rename a finished temporary file to its destination. Of an existing file it keeps who may read it."""
    try:
        mode = stat.S_IMODE(os.stat(path).st_mode)
    except OSError:
        pass
    else:
        os.chmod(temporary, mode & ~0o022)
    os.replace(temporary, path)


def synchronise(folder: Path) -> None:
    """Make renames in a folder survive a power cut, where the system can."""
    if os.name == "posix":  # Windows opens no folder
        _synchronise_file(folder)


def _synchronise_all(paths: Sequence[Path]) -> None:
    """Make the contents of files survive a power cut: at once, since a disk takes as long for all as for one."""
    with mapping(min(len(paths), MAX_THREADS)) as map_in_threads:
        for _ in map_in_threads(_synchronise_file, paths):
            pass


def _synchronise_file(path: Path) -> None:
    """Make the content of a file, or the renames in a folder, survive a power cut."""
    descriptor = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def same_file(path: str | os.PathLike, other_path: str | os.PathLike) -> bool:
    """Whether two paths lead to the same file, also through links or where only the case of letters differs."""
    try:
        return os.path.samefile(path, other_path)
    except OSError:
        return False


class OutputFile:
    """A file at a path given by the user, CSV or bytes: written completely or not at all, or a stream, directly.

    sources: files that are read, by their names in messages; a path to one of them raises ConfigError, and so does a
    path to neither a file nor a stream. durable: the file survives a power cut. Disk faults become StoreError."""

    def __init__(
        self,
        path: str | os.PathLike,
        sources: Mapping[str, str | os.PathLike | None] = MappingProxyType({}),
        durable: bool = False,
    ):
        self.path, self._durable = Path(path), durable
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
            if self._durable and kind is None:
                self._file.flush()
                os.fsync(self._file.fileno())
            self._file.close()
            if kind is None and self._temporary is not None:
                rename(self._temporary, self._target)
                if self._durable:
                    synchronise(self._target.parent)
        except OSError as error:
            raise self._fault(error) from error
        finally:
            with suppress(OSError):  # it is closed already, unless something failed
                self._file.close()
            if self._temporary is not None:
                self._temporary.unlink(missing_ok=True)

    def _fault(self, error: OSError) -> StoreError:
        return StoreError(f"{self.path}: cannot be written: {error.strerror or error}")
