"""Readings as `radarsim readings` has stored them, for the claims beside them."""

import csv
import io
from pathlib import Path
from typing import Any

from radarsim.errors import StoreError
from radarsim.report import files

PLACE = Path("readings", "readings.csv")
NEEDED = {"claim", "reading", "kind", "outcome"}


def stored_readings(out: Path) -> list[dict[str, Any]]:
    """The rows of readings.csv under `out`; none where there is no such file. Raises StoreError for a damaged one."""
    path = out / PLACE
    try:
        table = csv.DictReader(io.StringIO(files.read(path).decode("utf-8"), newline=""), strict=True)
        rows, names = list(table), set(table.fieldnames or ())
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, csv.Error) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    if not names >= NEEDED:
        raise StoreError(f"{path}: is no table of readings; remove it, `radarsim readings` makes it again")
    return rows
