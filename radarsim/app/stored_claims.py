"""Claims as a run has stored them: the table is read only if it is the one that run.json records."""

import csv  # and not pandas, which takes half a second to load
import hashlib
import io
import json
import time
from pathlib import Path
from typing import Any

from radarsim.errors import StoreError
from radarsim.report import files

LOOKS, PAUSE_S = 5, 0.1  # at a table that fits no record: a run beside us may be writing both just now


def stored(path: Path) -> list[dict[str, Any]] | None:
    """The rows of a stored claims.csv, numbers as such; None if there is none.

    Raises StoreError where it cannot be read, is no such table, or is another one than run.json beside it records.
    """
    for look in range(LOOKS):
        content = _read(path)
        if content is None:
            return None
        recorded = _recorded(path)
        if recorded is None or hashlib.sha256(content).hexdigest() == recorded:
            return _rows(path, content)
        if look < LOOKS - 1:
            time.sleep(PAUSE_S)
    raise StoreError(f"{path}: altered since it was written; `radarsim report` makes it again")


def _read(path: Path) -> bytes | None:
    try:
        return files.read(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error


def _recorded(path: Path) -> str | None:
    """The SHA-256 of the file that run.json beside it records; None where there is no run.json or it names no such."""
    record = path.with_name("run.json")
    content = _read(record)
    try:
        digest = None if content is None else json.loads(content)["outputs"].get(path.name)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise StoreError(f"{record}: is no record of a run; `radarsim report` makes it again") from error
    return digest


def _rows(path: Path, content: bytes) -> list[dict[str, Any]]:
    from radarsim.report.claims import CLAIMED, NUMBERS

    try:
        table = csv.DictReader(io.StringIO(content.decode("utf-8"), newline=""), strict=True)
        rows, names = list(table), set(table.fieldnames or ())
    except (ValueError, csv.Error) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    try:
        if set(CLAIMED) <= names:
            return [row | {name: float(row[name]) if row[name] else "" for name in NUMBERS} for row in rows]
    except (LookupError, TypeError, ValueError):
        pass  # reported like any other damaged table
    raise StoreError(f"{path}: is no table of claims; `radarsim report` makes it again")
