"""Stored results: run.json and its tables, read only if they are the ones that it records.

Stored results of `radarsim interpretations`: rows of its tables under a directory, and the shipped classes. classes.csv
beside this module is that of the shipped configs, copied by `make interpretations-pages`; a claim judged in a directory
of results takes its class from there."""

import csv
import hashlib
import io
import json
import time
from collections.abc import Callable, Collection, Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from radarsim.errors import StoreError
from radarsim.report import files, tables
from radarsim.report.claims.declared import PaperClaims
from radarsim.report.claims.over import PaperInterpretations
from radarsim.report.claims.page import COLUMNS, Class, Known, declared

if TYPE_CHECKING:
    import pandas as pd


# ---- stored tables ---------------------------------------------------------------------------------------------------
AGAIN = "`radarsim report` makes it again"
Row = TypeVar("Row")


def content(path: Path) -> bytes | None:
    """The bytes of a file; None where there is none. Raises StoreError where it cannot be read."""
    try:
        return files.read(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error


def rows(
    path: Path, text: bytes, needed: Collection[str], made: Callable[[dict[str, Any]], Row], kind: str
) -> list[Row]:
    """The result of `made` for each row of a CSV file with the required columns; StoreError, with kind, for any other
    file."""
    try:
        table = csv.DictReader(io.StringIO(text.decode("utf-8"), newline=""), strict=True)
        table.fieldnames = [OLD_COLUMNS.get(name, name) for name in table.fieldnames or ()]
        read, names = list(table), set(table.fieldnames)
    except (ValueError, csv.Error) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    try:
        if names >= set(needed):
            return [made(row) for row in read]
    except (LookupError, TypeError, ValueError):
        pass  # reported like any other damaged table
    raise StoreError(f"{path}: is no {kind}")


def record(folder: Path) -> dict[str, Any] | None:
    """The run.json of a folder; None where there is none. Raises StoreError where it is damaged."""
    path = folder / "run.json"
    if (text := content(path)) is None:
        return None
    try:
        found = json.loads(text)
        files.to_json(found)  # ValueError for content that no run writes, such as NaN or half a character
        if all(isinstance(found[key], dict) for key in ("cases", "outputs", "resolved")):
            return dict(found)
    except (ValueError, LookupError, TypeError, RecursionError):
        pass
    raise StoreError(f"{path}: is no record of a run; {AGAIN}")


def table(folder: Path, name: str, outputs: "dict[str, str]") -> "pd.DataFrame | None":
    """A table of a folder whose run.json records these outputs; None where the run wrote none of this name. Raises
    StoreError where it cannot be read or differs from the record."""
    path = folder / f"{name}.csv"
    if path.name not in outputs:
        return None
    try:
        text = files.read(path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}; {AGAIN}") from error
    if hashlib.sha256(text).hexdigest() != outputs[path.name]:
        raise StoreError(f"{path}: altered since it was written; {AGAIN}")
    try:
        return tables.from_csv(text)
    except ValueError as error:
        raise StoreError(f"{path}: is no table; {AGAIN}") from error


# ---- stored claims ---------------------------------------------------------------------------------------------------
LOOKS, PAUSE_S = 5, 0.1  # of a table that fits no record: another run may be writing both just now


def stored(path: Path) -> list[dict[str, Any]] | None:
    """The rows of a stored claims.csv, numbers as such; None if there is none. Raises StoreError where it cannot be
    read, is no such table, or differs from the record in run.json."""
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
    """The SHA-256 of the file in run.json beside it; None where there is no run.json or it does not name the file."""
    record = path.with_name("run.json")
    text = content(record)
    try:
        return None if text is None else json.loads(text)["outputs"].get(path.name)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise StoreError(f"{record}: is no record of a run; {AGAIN}") from error


# ---- stored interpretations
# -------------------------------------------------------------------------------------------------
PLACE, CLASSES = Path("interpretations", "interpretations.csv"), Path("interpretations", "classes.csv")
NEEDED = {"claim", "interpretation", "kind", "outcome"}
OLD_FILES = {  # names in results of earlier versions, read where the new file is not there
    PLACE: Path("readings", "readings.csv"),
    CLASSES: Path("readings", "classes.csv"),
}
OLD_COLUMNS = {"reading": "interpretation"}
SHIPPED = Path(__file__).with_name("classes.csv")


def stored_interpretations(out: Path) -> list[dict[str, Any]]:
    """The rows of interpretations.csv under `out`; none where there is no such file. Raises StoreError for a damaged
    one."""
    return _rows(_existing(out, PLACE), NEEDED, dict)


def stored_classes(out: Path | None) -> list[Class]:
    """The classes of claims judged under `out`. Raises StoreError for a damaged file."""
    return _rows(_existing(out, CLASSES), set(COLUMNS), Class.of_row) if out else []


def _existing(out: Path, file: Path) -> Path:
    """The path of a file under `out`, by its name in earlier versions where only that one is there."""
    return out / file if (out / file).exists() or not (out / OLD_FILES[file]).exists() else out / OLD_FILES[file]


@cache
def shipped_classes() -> tuple[Class, ...]:
    """The classes that radarsim ships."""
    return tuple(_rows(SHIPPED, set(COLUMNS), Class.of_row))


def classes_of(papers: Iterable[tuple[PaperInterpretations, PaperClaims]], out: Path | None) -> Known:
    """The class over all interpretations of each claim that depends on an open choice of its paper; None where it is
    not known.

    A class from other words, numbers or choices than the claim has now does not count."""
    found = {(one.claim, one.declared): one for one in (*shipped_classes(), *stored_classes(out))}
    return {
        claim.id: found.get((claim.id, declared(interpretations, claim)))
        for interpretations, claims in papers
        for claim in claims.claims
        if interpretations.open(claim)
    }


def _rows(path: Path, needed: set[str], made: Callable[[dict[str, Any]], Row]) -> list[Row]:
    text = content(path)
    kind = "table of interpretations; remove it, `radarsim interpretations` makes it again"
    return [] if text is None else rows(path, text, needed, made, kind)
