"""Files that are there whole or not at all.

A regular file is written under a temporary name beside it and renamed, so that a reader, a full disk or a kill never
meets half of it. It keeps the mode it had; a new one has what the umask leaves. A link stays, and what it leads to is
replaced. A stream (a terminal, a pipe, /dev/null) has nothing to replace and is written through. Directories and disks
are refused.
"""

import csv
import io
import os
import stat
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from radarsim.errors import ConfigError, StoreError


def replace_all(folder: Path, contents: Mapping[str, bytes], stale: Iterable[str] = ()) -> None:
    """Write contents (relative path: bytes) below folder: all under temporary names first, then renamed in their order.

    So a full disk leaves the outputs of an earlier run as they were. Of the paths in `stale`, those below folder and
    not among the contents are removed. Raises StoreError.
    """
    folder = Path(folder)
    written: dict[Path, Path] = {}
    try:
        try:
            for path, data in contents.items():
                written[folder / path] = beside(folder / path)
                written[folder / path].parent.mkdir(parents=True, exist_ok=True)
                written[folder / path].write_bytes(data)
            for path, temporary in written.items():
                rename(temporary, path)
        finally:
            for temporary in written.values():
                temporary.unlink(missing_ok=True)
        for path in set(stale) - set(contents):
            if not Path(path).is_absolute() and ".." not in Path(path).parts:
                (folder / path).unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(f"{error.filename or folder}: cannot be written: {error.strerror or error}") from error


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

    source is a file that is read meanwhile and must not be the same: ConfigError. So is a path to no file or stream.
    Faults of the disk become StoreError.
    """

    def __init__(self, path: str | os.PathLike, source: str | os.PathLike | None = None):
        self.path = Path(path)
        try:
            kind = os.stat(self.path).st_mode
        except OSError:
            kind = stat.S_IFREG
        if stat.S_ISDIR(kind) or stat.S_ISBLK(kind):
            raise ConfigError(f"{self.path}: must be a file, got a {'directory' if stat.S_ISDIR(kind) else 'disk'}")
        self._stream = not stat.S_ISREG(kind)
        if source is not None and not self._stream and same_file(path, source):
            raise ConfigError(f"{self.path}: must be another file than the plots, which would be lost")

    def __enter__(self):
        self._target = Path(os.path.realpath(self.path))
        self._temporary = None if self._stream else beside(self._target)
        try:
            opened = open(self._temporary or self.path, "xb" if self._temporary else "wb")
        except OSError as error:
            raise self._fault(error) from error
        self._file = io.TextIOWrapper(opened, encoding="utf-8", newline="")
        self._rows = csv.writer(self._file, lineterminator="\n")
        return self

    def write(self, rows: Iterable[Sequence]) -> None:
        """Write rows of text."""
        try:
            self._rows.writerows(rows)
        except OSError as error:
            raise self._fault(error) from error

    def __exit__(self, kind: type | None, *_: object) -> None:
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
