"""What `radarsim readings` came to: rows of its tables under a directory, and the classes that radarsim ships.

classes.csv beside this module is that of the shipped configs, copied by `make readings-pages`; where a directory of
results has its own, of a claim that was judged there, that one counts.
"""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

from radarsim.app.stored_tables import Row, content, rows
from radarsim.report.claims.classes import COLUMNS, Class, Known, declared
from radarsim.report.claims.declared import PaperClaims
from radarsim.report.claims.readings import PaperReadings

PLACE, CLASSES = Path("readings", "readings.csv"), Path("readings", "classes.csv")
NEEDED = {"claim", "reading", "kind", "outcome"}
SHIPPED = Path(__file__).with_name("classes.csv")


def stored_readings(out: Path) -> list[dict[str, Any]]:
    """The rows of readings.csv under `out`; none where there is no such file. Raises StoreError for a damaged one."""
    return _rows(out / PLACE, NEEDED, dict)


def stored_classes(out: Path | None) -> list[Class]:
    """The classes that were worked out under `out`. Raises StoreError for a damaged file."""
    return _rows(out / CLASSES, set(COLUMNS), Class.of_row) if out else []


@cache
def shipped_classes() -> tuple[Class, ...]:
    """The classes that radarsim ships."""
    return tuple(_rows(SHIPPED, set(COLUMNS), Class.of_row))


def classes_of(papers: Iterable[tuple[PaperReadings, PaperClaims]], out: Path | None) -> Known:
    """The class over all readings of each claim of which its paper leaves something open; None where it is not known.

    One that was worked out of other words, numbers or choices than the claim has now is none.
    """
    found = {(one.claim, one.declared): one for one in (*shipped_classes(), *stored_classes(out))}
    return {
        claim.id: found.get((claim.id, declared(readings, claim)))
        for readings, claims in papers
        for claim in claims.claims
        if readings.open(claim)
    }


def _rows(path: Path, needed: set[str], made: Callable[[dict[str, Any]], Row]) -> list[Row]:
    text = content(path)
    kind = "table of readings; remove it, `radarsim readings` makes it again"
    return [] if text is None else rows(path, text, needed, made, kind)
