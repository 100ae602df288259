"""Files that are there whole or not at all."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from radarsim.errors import StoreError


def replace_all(folder: Path, contents: Mapping[str, bytes], stale: Iterable[str] = ()) -> None:
    """Write contents (relative path: bytes) below folder, each by a temporary file and a rename.

    Of the paths in `stale`, those below folder and not among the contents are removed. Raises StoreError.
    """
    folder = Path(folder)
    try:
        for path, data in contents.items():
            write(folder / path, data)
        for path in set(stale) - set(contents):
            if not Path(path).is_absolute() and ".." not in Path(path).parts:
                (folder / path).unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(f"{error.filename or folder}: cannot be written: {error.strerror or error}") from error


def write(path: Path, data: bytes) -> None:
    """Write one file by a temporary one beside it; raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
