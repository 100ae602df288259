"""Files that are there whole or not at all."""

import os
import uuid
from collections.abc import Iterable, Mapping
from pathlib import Path

from radarsim.errors import StoreError


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
                os.replace(temporary, path)
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
