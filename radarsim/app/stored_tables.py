"""A result as it was stored: run.json and the tables beside it, read only where they are the ones that it records."""

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.errors import StoreError
from radarsim.report import files, provenance
from radarsim.report import tables as common

if TYPE_CHECKING:
    import pandas as pd

AGAIN = "`radarsim report` makes it again"


def record(folder: Path) -> dict[str, Any] | None:
    """The run.json of a folder; None where there is none. Raises StoreError where it is damaged."""
    path = folder / "run.json"
    try:
        found = json.loads(files.read(path))
        provenance.to_json(found)  # ValueError for what no run writes, such as NaN or half a character
        if all(isinstance(found[key], dict) for key in ("cases", "outputs", "resolved")):
            return dict(found)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, LookupError, TypeError, RecursionError):
        pass
    raise StoreError(f"{path}: is no record of a run; {AGAIN}")


def table(folder: Path, name: str, outputs: "dict[str, str]") -> "pd.DataFrame | None":
    """A table of a folder whose run.json names these outputs; None where the run wrote none of this name.

    Raises StoreError where it cannot be read or is another one than recorded.
    """
    path = folder / f"{name}.csv"
    if path.name not in outputs:
        return None
    try:
        content = files.read(path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}; {AGAIN}") from error
    if hashlib.sha256(content).hexdigest() != outputs[path.name]:
        raise StoreError(f"{path}: altered since it was written; {AGAIN}")
    try:
        return common.from_csv(content)
    except ValueError as error:
        raise StoreError(f"{path}: is no table; {AGAIN}") from error
