"""Claims as a run has stored them: the table is read only if it is the one that run.json records."""

import hashlib
import json
import time
from pathlib import Path
from typing import Any

from radarsim.app.stored_tables import AGAIN, content, rows
from radarsim.errors import StoreError

LOOKS, PAUSE_S = 5, 0.1  # at a table that fits no record: a run beside us may be writing both just now


def stored(path: Path) -> list[dict[str, Any]] | None:
    """The rows of a stored claims.csv, numbers as such; None if there is none.

    Raises StoreError where it cannot be read, is no such table, or is another one than run.json beside it records.
    """
    from radarsim.report.claims import CLAIMED, NUMBERS

    for look in range(LOOKS):
        text = content(path)
        if text is None:
            return None
        recorded = _recorded(path)
        if recorded is None or hashlib.sha256(text).hexdigest() == recorded:

            def numbered(row: dict[str, Any]) -> dict[str, Any]:
                return row | {name: float(row[name]) if row[name] else "" for name in NUMBERS}

            return rows(path, text, CLAIMED, numbered, f"table of claims; {AGAIN}")
        if look < LOOKS - 1:
            time.sleep(PAUSE_S)
    raise StoreError(f"{path}: altered since it was written; {AGAIN}")


def _recorded(path: Path) -> str | None:
    """The SHA-256 of the file that run.json beside it records; None where there is no run.json or it names no such."""
    record = path.with_name("run.json")
    text = content(record)
    try:
        return None if text is None else json.loads(text)["outputs"].get(path.name)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise StoreError(f"{record}: is no record of a run; {AGAIN}") from error
