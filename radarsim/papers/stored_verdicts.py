"""Verdicts from files: a result's claims.csv, the tables of `radarsim interpretations`, and the shipped classes.

classes.csv beside this module has the classes of the shipped configs, copied by `make interpretations-pages`; a claim
judged in a directory of results takes its class from there."""

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from radarsim.errors import StoreError
from radarsim.papers.claim import PaperClaims
from radarsim.papers.claims_table import COLUMNS, NUMBER_COLUMNS
from radarsim.papers.interpretations import OpenChoices
from radarsim.papers.verdict_classes import CLASS_FILE_COLUMNS, KnownClasses, VerdictClass, declaration_digest
from radarsim.report.stored_tables import HOW_TO_REMAKE, RECORD, TableKind, find_files, read_content, read_rows

Row = TypeVar("Row")

FILE = "claims.csv"
TABLE = Path("interpretations", "interpretations.csv")
CLASSES = Path("interpretations", "classes.csv")
REQUIRED_COLUMNS = {"claim", "interpretation", "kind", "outcome"}
OLD_FILES = {  # names in results of earlier versions, read where the new file is not there
    TABLE: Path("readings", "readings.csv"),
    CLASSES: Path("readings", "classes.csv"),
}
OLD_COLUMNS = {"reading": "interpretation"}
NEW_COLUMNS = {"declared"}  # of claims.csv, which earlier versions wrote without
CLAIMS_TABLE = TableKind("table of claims", [name for name in COLUMNS if name not in NEW_COLUMNS], OLD_COLUMNS)
SHIPPED_CLASSES = Path(__file__).with_name("classes.csv")


def stored_claims(folder: Path) -> list[dict[str, Any]] | None:
    """The rows of the claims.csv of a result, numbers as such; None if it has none. Raises StoreError where it is not
    as recorded in run.json, or no such table."""
    content = recorded_claims(folder)
    return None if content is None else read_rows(folder / FILE, content, CLAIMS_TABLE, _with_numbers)


def recorded_claims(folder: Path) -> bytes | None:
    """The claims.csv of a result; None if it has none. Raises StoreError where it is not as recorded in run.json."""
    files = find_files(folder, lambda name: name == FILE)
    content = None if files is None else files.content(FILE)
    if content is None and (folder / FILE).exists():
        raise StoreError(f"{folder / FILE}: no {RECORD} beside it names it; {HOW_TO_REMAKE}")
    return content


def _with_numbers(row: dict[str, Any]) -> dict[str, Any]:
    return row | {name: float(row[name]) if row[name] else "" for name in NUMBER_COLUMNS}


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


def known_classes(
    papers: Iterable[tuple[OpenChoices, PaperClaims]], out: Path | None, marks: Mapping[str, str] | None = None
) -> KnownClasses:
    """The class over all interpretations of each claim that depends on an open choice of its paper; None where it is
    not known.

    A class from other words, numbers or choices than the claim has now does not count. marks: of claims, see
    `declaration_digest`, where they are at hand."""
    marks = marks or {}
    classes = {
        (verdict.claim, verdict.declaration_digest): verdict for verdict in (*shipped_classes(), *stored_classes(out))
    }
    return {
        claim.id: classes.get((claim.id, marks.get(claim.id) or declaration_digest(choices, claim)))
        for choices, paper in papers
        for claim in paper.claims
        if choices.leaves_open(claim)
    }


def _existing_file(out: Path, file: Path) -> Path:
    """The path of a file under `out`, by its name in earlier versions where only that one is there."""
    old_path = out / OLD_FILES[file]
    return old_path if old_path.exists() and not (out / file).exists() else out / file


def _rows(path: Path, columns: set[str], convert: Callable[[dict[str, Any]], Row]) -> list[Row]:
    content = read_content(path)
    remedy = "remove it, `radarsim interpretations` makes it again"
    kind = TableKind("table of interpretations", columns, OLD_COLUMNS, remedy)
    return [] if content is None else read_rows(path, content, kind, convert)
