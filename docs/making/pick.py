"""Picking from result tables: rows by their values, parts of claims by their words."""

from collections.abc import Callable

import pandas as pd

from making.numbers import Results, signed, with_bounds


def rows(results: Results, stem: str, name: str, **wanted) -> pd.DataFrame:
    """The rows of a table with these values; `case` by its end. KeyError where there is none."""
    table = results.table(stem, name)
    for column, value in wanted.items():
        held = table[column]
        table = table[held.str.endswith(value) if column == "case" else held == value]
    if table.empty:
        raise KeyError(f"{stem}/{name}.csv has no row with {wanted}")
    return table


def bounded(row, name: str, stem: str | None = None, scale: float = 1) -> str:
    """A column's value with its interval, of the columns `STEM_lo` and `STEM_hi`."""
    stem = name if stem is None else stem
    return with_bounds(*(scale * row[column] for column in (name, f"{stem}_lo", f"{stem}_hi")))


def value(stem: str, name: str, column: str, bounds: str | None = None, scale: float = 1, unit: str = "", **wanted):
    """The one value of a table's column in the row picked, with its interval, times `scale`."""

    def made(results: Results) -> str:
        return bounded(rows(results, stem, name, **wanted).iloc[-1], column, bounds, scale) + unit

    return made


def part(stem: str, claim: str, what: str, unit: str = " %") -> Callable[[Results], str]:
    """The measured value of one part of a claim."""

    def made(results: Results) -> str:
        row = rows(results, stem, "claims", claim=claim, what=what).iloc[0]
        exact = row["lo"] == row["hi"]
        said = signed(f"{row['measured']:.3g}") if exact else with_bounds(row["measured"], row["lo"], row["hi"])
        return said + unit

    return made
