"""Whether two CSV tables of a result are equal, or differ by no more than rounding on another machine."""

import csv
import io
import math
from collections.abc import Collection, Mapping, Sequence

from radarsim.api.maintenance.self_test import FIRST_NUMBER, distances, tolerance

OTHER_SHAPE = "has other"  # begins what is said of a table with other columns or rows
ROUNDING = 1e-6  # of the largest number of a column; differences of large sums lose half of their digits
NOTE_COLUMNS = ("note",)  # appear at a threshold, which rounding may cross


def differs(study: str, table: str, stored: bytes, computed: bytes, free_columns: Collection[str] = ()) -> str | None:
    """How a stored table differs from the computed one, as a phrase; None where they agree to rounding.

    free_columns are not compared."""
    if stored == computed:
        return None
    if table in FIRST_NUMBER and not free_columns:
        try:
            sampled, exact = distances(table, computed, stored)
        except (KeyError, ValueError):
            return f"{OTHER_SHAPE} columns"
        allowed = tolerance(study)
        if sampled <= allowed.sampled and exact <= allowed.exact:
            return None
        if math.isinf(sampled):
            return f"{OTHER_SHAPE} rows or columns"
        return f"differs by {max(sampled, exact):.1e} of σ"
    return _column_difference(_columns(stored, free_columns), _columns(computed, free_columns))


def _columns(text: bytes, free_columns: Collection[str]) -> dict[str, list[str]] | None:
    """The cells of a CSV table by column; None where it is no table."""
    try:
        names, *rows = csv.reader(io.StringIO(text.decode(), newline=""), strict=True)
        columns = dict(zip(names, (list(column) for column in zip(*rows, strict=True)), strict=bool(rows)))
    except ValueError:
        return None
    return {name: column for name, column in columns.items() if name not in (*free_columns, *NOTE_COLUMNS)}


def _column_difference(
    stored: Mapping[str, Sequence[str]] | None, computed: Mapping[str, Sequence[str]] | None
) -> str | None:
    """The first column in which two tables differ, as a phrase."""
    if stored is None or computed is None or [*stored] != [*computed]:
        return f"{OTHER_SHAPE} columns"
    for name, column in stored.items():
        cells = computed[name]
        if column == cells:
            continue
        if len(column) != len(cells):
            return f"{OTHER_SHAPE} rows"
        try:
            pairs = [(float(a), float(b)) for a, b in zip(column, cells, strict=True) if a != b]
            scale = max(abs(float(cell)) for cell in cells if cell)
        except ValueError:
            return f"differs in {name}"
        distance = max(abs(a - b) for a, b in pairs)
        if not distance <= ROUNDING * scale:
            return f"differs in {name} by {distance:.2g}"
    return None
