"""Picking from result tables: rows by their values, parts of claims by their words."""

from collections.abc import Callable

import pandas as pd

from making.numbers import Results, signed, with_bounds


def select_rows(results: Results, stem: str, table_name: str, **values) -> pd.DataFrame:
    """The rows of a table with these values; `case` by its end. KeyError where there is none."""
    table = results.table(stem, table_name)
    for column, column_value in values.items():
        values = table[column]
        table = table[values.str.endswith(column_value) if column == "case" else values == column_value]
    if table.empty:
        raise KeyError(f"{stem}/{table_name}.csv has no row with {values}")
    return table


def bounded(row, name: str, stem: str | None = None, scale: float = 1) -> str:
    """A column's value with its interval, of the columns `STEM_lo` and `STEM_hi`."""
    stem = name if stem is None else stem
    return with_bounds(*(scale * row[column] for column in (name, f"{stem}_lo", f"{stem}_hi")))


def column_value(
    stem: str, name: str, column: str, interval_stem: str | None = None, scale: float = 1, unit: str = "", **values
):
    """The one value of a table's column in the row picked, with its interval, times `scale`."""

    def text(results: Results) -> str:
        return bounded(select_rows(results, stem, name, **values).iloc[-1], column, interval_stem, scale) + unit

    return text


def claim_value(stem: str, claim: str, part_name: str, unit: str = " %") -> Callable[[Results], str]:
    """The measured value of one part of a claim."""

    def text(results: Results) -> str:
        row = select_rows(results, stem, "claims", claim=claim, quantity=part_name).iloc[0]
        exact = row["lo"] == row["hi"]
        number = signed(f"{row['measured']:.3g}") if exact else with_bounds(row["measured"], row["lo"], row["hi"])
        return number + unit

    return text
