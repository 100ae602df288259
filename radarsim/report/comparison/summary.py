"""The summary of a comparison: for each quantity one sentence and one table, of the last common time.

A case that is compared with itself, or with the same numbers, is left out unless nothing else is compared."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.errors import ConfigError, argument
from radarsim.language.translate import join_names, quote_name, term, tr
from radarsim.report.comparison.sentences import change_texts, final_rows, value_text
from radarsim.report.comparison.table import SAME
from radarsim.report.quantities import Quantity
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd


MAX_NAMED_CHANGES = 3  # in a sentence; more are counted
COUNTED_SIGNS = {-1: term("lower in {count}"), 1: term("higher in {count}"), 0: term("undecided in {count}")}
MAX_ROWS = 36  # of a table on the terminal
MAX_FILTER_COLUMNS = 2  # that fit on 80 columns, each with a change and its interval


class SummaryTable(NamedTuple):
    """A table of texts: title, headings, rows, and the columns that a narrow terminal may leave out."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    spare: tuple[str, ...] = ()


class Summary(NamedTuple):
    """The sentence and the table of one quantity."""

    sentence: str
    table: SummaryTable


def summaries(
    comparison: "pd.DataFrame", quantities: Sequence[Quantity], component: str | None = None, at_s: float | None = None
) -> list[Summary]:
    """A summary for each quantity; of one component, and of a time at_s, s, if they are given, else of the last. Raises
    ConfigError for an unknown one."""
    rows = _without_equal_cases(final_rows(comparison, at_s))
    by_quantity = [(quantity, rows[rows["quantity"] == quantity.value]) for quantity in quantities]
    _check_component(component, [name for _, of_quantity in by_quantity for name in _components(of_quantity)])
    return [
        _summary(quantity, of_quantity, component)
        for quantity, of_quantity in by_quantity
        if len(of_quantity) and (component is None or component in _components(of_quantity))
    ]


def _check_component(component: str | None, names: Sequence[str]) -> None:
    if component is not None and component not in names:
        known = ", ".join(dict.fromkeys(names))
        raise ConfigError(f"{argument('component', '--component')}: must be one of {known}, got {component!r}")


def _components(rows: "pd.DataFrame") -> list[str]:
    """The components, or models, of rows, in their order."""
    return list(dict.fromkeys(_symbols(rows)))


def _symbols(rows: "pd.DataFrame") -> list[str]:
    return [str(row["component"] or row["model"]) for row in rows.to_dict("records")]


def _without_equal_cases(rows: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of cases that differ from their partner anywhere; all of them where none does."""
    differs = (rows["pairing"] != SAME).groupby([rows["label"], rows["against_label"]]).transform("any")
    return rows[differs] if differs.any() else rows


def _summary(quantity: Quantity, rows: "pd.DataFrame", component: str | None) -> Summary:
    symbols = np.array(_symbols(rows))
    of_first = rows[symbols == (component or symbols[0])]
    labels = list(dict.fromkeys(rows["label"]))
    if len(labels) > 1 or component is not None or len(rows) > MAX_ROWS:
        rows = of_first
    sentence = _sentence(quantity, of_first.to_dict("records"))
    records = rows.to_dict("records")
    filters = list(dict.fromkeys(rows["filter"]))
    if len(labels) == 1:
        return Summary(sentence, _value_table(quantity, records))
    if len(filters) > MAX_FILTER_COLUMNS:
        return Summary(sentence, _list_of_changes(quantity, records))
    return Summary(sentence, _change_table(quantity, records, filters))


def _reference(records: Sequence[dict[Any, Any]]) -> str:
    """What the values are compared with, in words."""
    names = list(dict.fromkeys(row["against_label"] for row in records))
    return names[0] if len(names) == 1 else tr("the same cases of {run}", run=records[0]["against_run"])


def _subject(quantity: Quantity, row: dict[Any, Any]) -> str:
    """σ of r at 140 s."""
    symbol = str(row["component"] or row["model"])
    subject = tr("{quantity} of {symbol}", quantity=tr(quantity.words), symbol=symbol) if symbol else tr(quantity.words)
    return tr("{what} at {t_s:g} s", what=subject, t_s=row["t_s"]) if row["t_s"] == row["t_s"] else subject


def _sentence(quantity: Quantity, records: Sequence[dict[Any, Any]]) -> str:
    """What was asked: the changes where they are few; else how many are lower and higher."""
    fields = {"what": _subject(quantity, records[0]), "other": _reference(records)}
    labels = list(dict.fromkeys(row["label"] for row in records))
    if all(row["pairing"] == SAME for row in records):
        return tr("{label} and {other} have the same numbers.", label=join_names(labels), other=fields["other"])
    if len(labels) == 1 and len(records) <= MAX_NAMED_CHANGES:
        changes = join_names([f"{quote_name(row['filter'])} {_change(row)}" for row in records])
        return tr("{label} versus {other}, {what}: {changes}.", label=labels[0], changes=changes, **fields)
    signs = [_sign(row) for row in records]
    counts = [tr(words, count=signs.count(sign)) for sign, words in COUNTED_SIGNS.items() if sign in signs]
    fields |= {"counts": join_names(counts)}
    if len(labels) == 1:
        return tr(
            "{label} versus {other}, {what}: {counts} of {count} filters.",
            label=labels[0],
            count=len(records),
            **fields,
        )
    return tr(
        "Relative to {other}, {what}: {counts} of {count} pairs of case and filter.", count=len(records), **fields
    )


def _sign(row: dict[Any, Any]) -> int:
    """Whether a value is lower (−1) or higher (1) than the other, by exact values or the interval; else 0."""
    exact = row["exact_percent"]
    low, high = (exact, exact) if exact == exact else (row["difference_lo"], row["difference_hi"])
    return int(low > 0) - int(high < 0)


def _change(row: dict[Any, Any]) -> str:
    """The change in a sentence or a cell: the exact one where it is known."""
    change, exact = change_texts(row)
    return tr("{value} (exact)", value=exact) if exact else change


def _change_cells(quantity: Quantity, records: Sequence[dict[Any, Any]]) -> tuple[str, list[str]]:
    """The title of a table of changes, and the change of each row; that all are exact stands in the title."""
    title = tr("{what}, change relative to {other}", what=_subject(quantity, records[0]), other=_reference(records))
    exact = [change_texts(row)[1] for row in records]
    if all(exact):
        return tr("{value} (exact)", value=title), exact
    return title, [_change(row) for row in records]


def _change_table(quantity: Quantity, records: Sequence[dict[Any, Any]], filters: Sequence[str]) -> SummaryTable:
    """A row for each case, a column for each filter."""
    title, cells = _change_cells(quantity, records)
    changes = {(row["label"], row["filter"]): cell for row, cell in zip(records, cells, strict=True)}
    labels = dict.fromkeys(row["label"] for row in records)
    rows = tuple((label, *(changes.get((label, name), "") for name in filters)) for label in labels)
    return SummaryTable(title, ("case", *filters), rows)


def _list_of_changes(quantity: Quantity, records: Sequence[dict[Any, Any]]) -> SummaryTable:
    """A row for each case and filter."""
    title, cells = _change_cells(quantity, records)
    rows = tuple((row["label"], row["filter"], cell) for row, cell in zip(records, cells, strict=True))
    return SummaryTable(title, ("case", "filter", "change"), rows)


def _value_table(quantity: Quantity, records: Sequence[dict[Any, Any]]) -> SummaryTable:
    """A row for each filter and component of one case: both values and their change."""
    cells = [tuple(_value_cells(row)) for row in records]
    label, other = records[0]["label"], _reference(records)
    columns = ("filter", "of", "at", label, other, "change", "exact")
    has_entries = [any(row[i] for row in cells) for i in range(len(columns))]
    if len({row[2] for row in cells}) == 1:
        has_entries[2] = False  # in the title
    kept = [i for i, has_entry in enumerate(has_entries) if has_entry]
    title = tr(quantity.words)
    if records[0]["t_s"] == records[0]["t_s"] and not has_entries[2]:
        title = tr("{what} at {t_s:g} s", what=title, t_s=records[0]["t_s"])
    return SummaryTable(
        title,
        tuple(columns[i] for i in kept),
        tuple(tuple(row[i] for i in kept) for row in cells),
        spare=("exact", "at"),
    )


def _value_cells(row: dict[Any, Any]) -> Iterator[str]:
    yield row["filter"]
    yield str(row["component"] or row["model"])
    yield f"{row['t_s']:g} {tr('s')}" if row["t_s"] == row["t_s"] else ""
    for key in ("value", "against"):
        yield f"{value_text(row[key])} {tr(unit_of(row['unit']))}".rstrip()
    yield from change_texts(row)
