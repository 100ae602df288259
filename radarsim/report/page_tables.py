"""The parts of tables that a page shows."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.language.current import current_language, use_language
from radarsim.language.translate import term, tr, translate_names
from radarsim.report import wording
from radarsim.report.row_notes import note_texts
from radarsim.report.typeset import cell_text, typeset

if TYPE_CHECKING:
    import pandas as pd


NOT_SETTLED = term("not settled in the run")
MAX_ROWS = 200  # of a table shown in the page
MAX_PAGE_ROWS = 800  # of all of them together: the page stays under 1.5 MB


def row_table(name: str, rows: Sequence[Mapping[str, object]]) -> dict[str, Any]:
    """The part of a table of rows that a page shows."""
    columns = [{"name": key, "numeric": isinstance(value, int | float)} for key, value in rows[0].items()]
    cells = [[cell_text(value) for value in row.values()] for row in rows[:MAX_ROWS]]
    return {"name": name, "columns": columns, "rows": cells, "count": len(rows), "cut": len(rows) > len(cells)}


def text_table(name: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> dict[str, Any]:
    """The part of a table of texts that a page shows."""
    headings = [{"name": column, "numeric": False} for column in columns]
    return {"name": name, "columns": headings, "rows": rows[:MAX_ROWS], "count": len(rows), "cut": len(rows) > MAX_ROWS}


def _column_cell(column: str, value: object) -> str:
    """The text of a cell; an infinite settling time in words."""
    is_endless = column.startswith("settling") and isinstance(value, float) and math.isinf(value)
    return tr(NOT_SETTLED) if is_endless else cell_text(value)


def page_tables(tables: "Mapping[str, pd.DataFrame]") -> list[dict[str, Any]]:
    """The parts of tables that a page shows: long ones share the rows that short ones leave."""
    counts, max_rows = [len(table) for table in tables.values()], MAX_ROWS
    while max_rows > 10 and sum(min(count, max_rows) for count in counts) > MAX_PAGE_ROWS:
        max_rows -= 10
    with use_language(current_language()):  # the language is looked up once, not for each of ten thousand cells
        return [page_table(name, table, max_rows) for name, table in tables.items()]


def translated_table(name: str, table: "pd.DataFrame") -> dict[str, Any]:
    """A table of the page alone, in words; a table with a file of its own is shown as in the file."""
    shown_table = page_table(name, table)
    for column in shown_table["columns"]:
        column["name"] = typeset(column_heading(column["name"]))
    translations = {"unit": lambda name: tr(wording.unit(name)), "filter": translate_names, "radar": translate_names}
    for i, column in enumerate(table.columns):
        for row in shown_table["rows"] if column in translations else ():
            row[i] = translations[column](row[i])
    return shown_table


def column_heading(column: str) -> str:
    """The heading of a column of a table of the page alone; a unit is behind the last comma."""
    if column in COLUMN_NAMES or column in HEADINGS:
        return tr(COLUMN_NAMES.get(column, column))
    stage = re.fullmatch(r"σ of y, (.+), m", column)
    if stage:
        return tr("σ of y, {stage}, m", stage=tr(stage[1]))
    name, _, unit = column.rpartition(", ")
    return f"{tr(COLUMN_NAMES.get(name, name))}, {tr(unit)}" if name else column


FACTS = (  # names of facts of a run and of its machine
    *(term("system"), term("architecture"), term("processor"), term("cores"), term("byteorder"), term("threads")),
    *(term("seconds"), term("kernel seconds"), term("realisations computed"), term("realisations from store")),
)
COLUMN_NAMES = {  # of columns of tables that stand in pages alone, where these have other names
    **{"at_k": term("at scan"), "merge": term("merging rule"), "inside_percent": term("inside the interval, %")},
    "largest_difference_percent": term("largest difference, %"),
}
HEADINGS = (  # of their other columns
    *(term("SNR a pulse"), term("burst"), term("case"), term("component"), term("energy"), term("filter")),
    *(term("family"), term("key"), term("meaning"), term("measured, ns"), term("models"), term("operations")),
    *(term("pulses"), term("radar"), term("realisations"), term("scans"), term("seed"), term("unit"), term("value")),
)


def page_table(name: str, table: "pd.DataFrame", max_rows: int = MAX_ROWS) -> dict[str, Any]:
    """The part of a table that a page shows, with how many rows have which note."""
    order = list(table.columns)
    for known in [name for name in ("bound", "exact_sigma") if {name, "sigma"} <= set(order)]:  # side by side
        order.remove(known)
        order.insert(order.index("sigma") + 1, known)
    rows = table[order].head(max_rows)
    return {
        "name": name,
        "columns": [{"name": column, "numeric": table[column].dtype.kind in "iuf"} for column in order],
        "rows": [list(map(_column_cell, order, row)) for row in rows.astype(object).itertuples(index=False, name=None)],
        "count": len(table),
        "cut": len(table) > max_rows,
        "notes": Counter(filter(None, note_texts(table))),
    }
