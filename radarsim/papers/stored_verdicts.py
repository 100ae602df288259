"""Verdicts from files: a result's claims.csv, the tables of `radarsim interpretations`, and the shipped classes.

classes.csv beside this module has the classes of the shipped configs, copied by `make interpretations-pages`; a claim
judged in a directory of results takes its class from there."""

import hashlib
import json
import time
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from radarsim.api import stored_tables
from radarsim.api.stored_tables import HOW_TO_REMAKE
from radarsim.errors import StoreError
from radarsim.papers.claim import PaperClaims
from radarsim.papers.claims_table import COLUMNS, NUMBER_COLUMNS
from radarsim.papers.interpretations import PaperInterpretations
from radarsim.papers.verdict_classes import CLASS_FILE_COLUMNS, KnownClasses, VerdictClass, declaration_digest

Row = TypeVar("Row")

MAX_ATTEMPTS, PAUSE_S = 5, 0.1  # at a table that fits no record: another run may be writing both at this moment
TABLE = Path("interpretations", "interpretations.csv")
CLASSES = Path("interpretations", "classes.csv")
REQUIRED_COLUMNS = {"claim", "interpretation", "kind", "outcome"}
OLD_FILES = {  # names in results of earlier versions, read where the new file is not there
    TABLE: Path("readings", "readings.csv"),
    CLASSES: Path("readings", "classes.csv"),
}
OLD_COLUMNS = {"reading": "interpretation"}
SHIPPED_CLASSES = Path(__file__).with_name("classes.csv")


def stored_claims(path: Path) -> list[dict[str, Any]] | None:
    """The rows of a stored claims.csv, numbers as such; None if there is none. Raises StoreError where it cannot be
    read, is no such table, or differs from the record in run.json."""
    for attempt in range(1, MAX_ATTEMPTS + 1):
        text = stored_tables.read_content(path)
        if text is None:
            return None
        recorded = _recorded_digest(path)
        if recorded is None or hashlib.sha256(text).hexdigest() == recorded:
            return stored_tables.read_rows(
                path, text, COLUMNS, _with_numbers, f"table of claims; {HOW_TO_REMAKE}", OLD_COLUMNS
            )
        if attempt < MAX_ATTEMPTS:
            time.sleep(PAUSE_S)
    raise StoreError(f"{path}: altered since it was written; {HOW_TO_REMAKE}")


def _with_numbers(row: dict[str, Any]) -> dict[str, Any]:
    return row | {name: float(row[name]) if row[name] else "" for name in NUMBER_COLUMNS}


def _recorded_digest(path: Path) -> str | None:
    """The SHA-256 of the file in run.json beside it; None where there is no run.json or it does not name the file."""
    record = path.with_name("run.json")
    text = stored_tables.read_content(record)
    try:
        return None if text is None else json.loads(text)["outputs"].get(path.name)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise StoreError(f"{record}: is no record of a run; {HOW_TO_REMAKE}") from error


def stored_interpretations(out: Path) -> list[dict[str, Any]]:
    """The rows of interpretations.csv under `out`; none where there is no such file. Raises StoreError for a damaged
    one."""
    return _rows(_existing_file(out, TABLE), REQUIRED_COLUMNS, dict)


def stored_classes(out: Path | None) -> list[VerdictClass]:
    """The classes of claims judged under `out`. Raises StoreError for a damaged file."""
    return _rows(_existing_file(out, CLASSES), set(CLASS_FILE_COLUMNS), VerdictClass.from_row) if out else []


@cache
def shipped_classes() -> tuple[VerdictClass, ...]:
    """The classes that radarsim ships."""
    return tuple(_rows(SHIPPED_CLASSES, set(CLASS_FILE_COLUMNS), VerdictClass.from_row))


def known_classes(papers: Iterable[tuple[PaperInterpretations, PaperClaims]], out: Path | None) -> KnownClasses:
    """The class over all interpretations of each claim that depends on an open choice of its paper; None where it is
    not known.

    A class from other words, numbers or choices than the claim has now does not count."""
    classes = {
        (verdict.claim, verdict.declaration_digest): verdict for verdict in (*shipped_classes(), *stored_classes(out))
    }
    return {
        claim.id: classes.get((claim.id, declaration_digest(interpretations, claim)))
        for interpretations, paper in papers
        for claim in paper.claims
        if interpretations.leaves_open(claim)
    }


def _existing_file(out: Path, file: Path) -> Path:
    """The path of a file under `out`, by its name in earlier versions where only that one is there."""
    old_path = out / OLD_FILES[file]
    return old_path if old_path.exists() and not (out / file).exists() else out / file


def _rows(path: Path, columns: set[str], convert: Callable[[dict[str, Any]], Row]) -> list[Row]:
    text = stored_tables.read_content(path)
    kind = "table of interpretations; remove it, `radarsim interpretations` makes it again"
    return [] if text is None else stored_tables.read_rows(path, text, columns, convert, kind, OLD_COLUMNS)
