"""Measures of claims over a table of the user's own: numbers of a row, or statistics of the rows of simulated runs.

A part names rows by their cells, `of: [{filter: ekf}]`; `of: [{}]` are all of them. `value`, `ratio` and `difference`
take the number of a single row, with its interval where the table has one; `mean`, `median`, `variance` and `rms` are
of a column over the rows, each an independent run."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.translate import shorten_names
from radarsim.papers.evidence import MissingEvidence, exact_number, has_interval
from radarsim.papers.evidence import ratio as ratio_of_estimates
from radarsim.report import run_statistics, statistics
from radarsim.report.statistics import Estimate

if TYPE_CHECKING:
    import pandas as pd

MAX_NAMED_VALUES = 8  # of a column, in a message
RELATIVE_TOLERANCE = 1e-9  # of one number written in two ways


class TableRows:
    """The rows of a table for a part of a claim; count: realisations behind them, by a column `n`, or the rows."""

    def __init__(self, name: str, rows: "pd.DataFrame"):
        self.name, self.rows = name, rows
        self.count = _least_count(rows["n"]) if "n" in rows and len(rows) else len(rows) if len(rows) > 1 else 0


def _least_count(column: "pd.Series") -> int:
    """The least of a column of counts. Raises ConfigError where a cell is none."""
    for cell in column:
        if not isinstance(cell, int | float | np.number) or not 0 < cell < math.inf or cell != int(cell):
            raise ConfigError(f"column 'n' holds the realisations of a number, whole and > 0, got {cell}")
    return int(column.min())


class TableEvidence:
    """A table whose rows are evidence for claims. Nothing of it is known exactly unless it has no interval."""

    def __init__(self, table: "pd.DataFrame"):
        self.table = table
        self.tables_read: set[tuple[str, str]] = set()

    def case(self, key: Any) -> TableRows:
        """The rows with these cells. Raises ConfigError for an unknown column, or where there is no such row."""
        if not isinstance(key, Mapping):
            raise ConfigError(f"of: must name cells, {{COLUMN: VALUE}}, got {key!r}")
        rows = self.table
        if not len(rows):
            raise ConfigError("the table has no rows")
        for name, value in key.items():
            column = self.column(name, "of: ")
            rows = rows[rows[name].map(lambda cell, value=value: _is_equal(cell, value))]
            if not len(rows):
                there = shorten_names([str(cell) for cell in dict.fromkeys(column)], MAX_NAMED_VALUES)
                raise ConfigError(f"of: no row has {name} {value!r}; there are {there}")
        return TableRows(", ".join(f"{name} {value}" for name, value in key.items()), rows)

    def column(self, name: str, prefix: str = "") -> "pd.Series":
        """A column. Raises ConfigError for an unknown one."""
        if name not in self.table:
            raise ConfigError(f"{prefix}no column {name!r}; there are {', '.join(map(str, self.table.columns))}")
        return self.table[name]

    def numbers(self, key: Any, name: str) -> np.ndarray:
        """The numbers (rows,) of a column. Raises ConfigError where it has text."""
        self.column(name)
        cells = self.case(key).rows[name]
        try:
            if cells.dtype.kind in "cmM":  # complex numbers, times
                raise TypeError
            return np.asarray(cells, dtype=float)
        except (TypeError, ValueError):
            raise ConfigError(f"column {name!r} has cells that are no numbers") from None

    def number(self, key: Any, name: str) -> float:
        """The number of a column in the only row with these cells. Raises ConfigError where there are more."""
        values = self.numbers(key, name)
        if len(values) != 1:
            raise ConfigError(f"of: {len(values)} rows have {dict(key)}: name one; mean takes all of them")
        return float(values[0])

    def exactly(self) -> "TableEvidence":
        """Nothing: a table has no exact values beside the measured ones."""
        raise MissingEvidence("not known exactly")


def _is_equal(cell: Any, value: Any) -> bool:
    is_number = isinstance(cell, int | float | np.number) and isinstance(value, int | float)
    return math.isclose(cell, value, rel_tol=RELATIVE_TOLERANCE) if is_number else bool(str(cell) == str(value))


def value(evidence: TableEvidence, rows: Any, column: str, lo: str = "", hi: str = "", se: str = "") -> Estimate:
    """The number of a row. lo and hi: the columns with the ends of its 95 % interval; se: that of its standard error.

    Default: columns COLUMN_lo and COLUMN_hi, or COLUMN_se, with or without the unit at the end of COLUMN, where the
    table has them; else it is without noise."""
    number, table = evidence.number(rows, column), evidence.table
    if not math.isfinite(number):
        return exact_number(math.nan)
    if bool(lo) != bool(hi) or (lo and se):
        raise ConfigError("takes lo and hi, or se alone")
    if not (lo or se):
        stems = (column.rpartition("_")[0], column)  # rmse_se of rmse_m, where there is no rmse_m_se
        names = [(end, f"{stem}_{end}") for stem in stems if stem for end in ("lo", "hi", "se")]
        defaults = {end: name for end, name in names if name in table and name != column}
        lo, hi, se = (defaults.get(end, "") for end in ("lo", "hi", "se"))
        if bool(lo) != bool(hi):
            raise ConfigError(f"column {lo or hi!r} is one end of an interval, and the table has no other")
    if lo and hi:
        low, high = evidence.number(rows, lo), evidence.number(rows, hi)
        if not low <= number <= high:
            raise ConfigError(f"{column} {number:.6g} is not between {lo} {low:.6g} and {hi} {high:.6g}")
        return Estimate(number, low, high)
    if se:
        error = evidence.number(rows, se)
        if not 0 <= error < math.inf:
            raise ConfigError(f"{se} must be a standard error >= 0, got {error:.6g}")
        half = statistics.Z95 * error
        return Estimate(number, number - half, number + half)
    return exact_number(number)


def ratio(
    evidence: TableEvidence, rows: Any, base: Any, column: str, lo: str = "", hi: str = "", se: str = ""
) -> Estimate:
    """The number of the first row over that of the second, as of independent positive estimates."""
    first, second = (value(evidence, cells, column, lo, hi, se) for cells in (rows, base))
    quotient = ratio_of_estimates(first, second)
    return quotient if has_interval(first) or has_interval(second) else exact_number(quotient.value)


def difference(
    evidence: TableEvidence, rows: Any, less: Any, column: str, lo: str = "", hi: str = "", se: str = ""
) -> Estimate:
    """The number of the first row less that of the second, as of independent estimates."""
    first, second = (value(evidence, cells, column, lo, hi, se) for cells in (rows, less))
    gap = statistics.difference(first, second)
    return gap if has_interval(first) or has_interval(second) else exact_number(gap.value)


def mean(evidence: TableEvidence, rows: Any, column: str) -> Estimate:
    """The mean of a column over the rows."""
    return run_statistics.mean_of_runs(evidence.numbers(rows, column))


def median(evidence: TableEvidence, rows: Any, column: str) -> Estimate:
    """The median of a column over the rows."""
    return run_statistics.median_of_runs(evidence.numbers(rows, column))


def variance(evidence: TableEvidence, rows: Any, column: str) -> Estimate:
    """The variance of a column over the rows."""
    return run_statistics.variance_of_runs(evidence.numbers(rows, column))


def rms(evidence: TableEvidence, rows: Any, column: str) -> Estimate:
    """The root mean square of a column over the rows: σ of errors."""
    x = evidence.numbers(rows, column)
    x = x[np.isfinite(x)]
    ends = statistics.root_mean_square(np.square(x).sum(), np.square(np.square(x)).sum(), x.size)
    return Estimate(*(float(end) for end in ends))
