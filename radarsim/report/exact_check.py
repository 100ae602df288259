"""Exact values against measured ones, in every table and every run.

A column `exact_NAME` of a table holds the exact value of its column NAME, or gain_NAME; `exact` alone that of the
column whose ends are `lo` and `hi`. The two columns after the measured one are the ends of its 95 % interval; for a
mean the one after it, `…_se`, is its standard error. So a study with these column names is checked against its own
exact values without further declarations. Each measured value must lie within `statistics.ERROR_OF_PROGRAM` standard
errors, or within more where there are so many values that one of them would be farther off by chance.

The standard errors are the sample's own where the errors of a filter are Gaussian at every scan, judged by their κ.
Where they are not, for example where plots are missed, rare events may contribute much to a mean of squares and be
absent from a sample, and so from its standard error. Then σ is only checked for being too large, which missing events
never cause. A bias may lack as much as `UNSEEN` of n realisations can contribute, σ √(UNSEEN/n) (Cauchy and Schwarz); a
gain is not checked."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.language.translate import tr
from radarsim.report import tables
from radarsim.report.quantities import Quantity
from radarsim.report.statistics import (
    ERROR_OF_PROGRAM,
    MIN_TRUSTED_REALISATIONS,
    Z95,
    Estimate,
    largest_by_chance,
    standard_errors,
)

if TYPE_CHECKING:
    import pandas as pd


COLUMNS = ("case", "filter", "component", "unit", "scans", "inside_percent", "largest_difference_percent", "at_k")
ALMOST = 2e-4  # of a value for which `Study.exact_but_for` gives a qualification
ROUNDING = 1e-9  # of a value
UNSEEN = 18.0  # realisations of n that are all missing in one sample of 6·10⁷
STRAYS = 5.0  # standard errors by which κ of Gaussian errors may lie off theirs
ROW_LABELS = ("case", "filter", "component")
SQUARES = ("sigma", "nees", "nis")  # measured columns of means of squares, in any table


class ExactColumn(NamedTuple):
    """A measured column, its interval, and the column with its exact value.

    low and high are one column where it is the standard error."""

    value: str
    low: str
    high: str
    exact: str


def exact_columns(table: "pd.DataFrame") -> Iterator[ExactColumn]:
    """The measured columns of a table that have an exact one.

    exact: the measured value, known without sampling, empty where not; `exact_NAME` of the column NAME or gain_NAME"""
    columns = [str(name) for name in table.columns]
    for exact in (name for name in columns if name == "exact" or name.startswith("exact_")):
        stem = exact.removeprefix("exact").removeprefix("_")
        for value, low, high in zip(columns, columns[1:], columns[2:], strict=False):
            is_measured = value in (stem, f"gain_{stem}") if stem else (low, high) == ("lo", "hi")
            if is_measured and low == f"{value}_se":
                yield ExactColumn(value, low, low, exact)
            elif is_measured and low.endswith("lo") and high.endswith("hi"):
                yield ExactColumn(value, low, high, exact)


def measured_values(table: "pd.DataFrame", column: ExactColumn) -> Estimate:
    """The measured values (rows,) of a column with their 95 % intervals."""
    value, low, high = (table[name].to_numpy(dtype=float) for name in column[:3])
    if column.low == column.high:
        return Estimate(value, value - Z95 * low, value + Z95 * high)
    return Estimate(value, low, high)


def standardised_errors(
    tables_by_name: "Mapping[str, pd.DataFrame]",
    name: str,
    column: ExactColumn,
    approximate_cases: Collection[str] = (),
    quantities: Sequence[Quantity] = (),
) -> np.ndarray:
    """Standard errors (rows,) by which the measured values of a column differ from the exact ones.

    name: that of the column's table; approximate_cases: those whose exact values are accurate to `ALMOST` only. 0 where
    missing rare events may explain the difference, see above. NaN where no exact value is known, or fewer than
    `MIN_TRUSTED_REALISATIONS` realisations measured it."""
    table = tables_by_name[name]
    (value, low, high), exact = measured_values(table, column), table[column.exact].to_numpy(dtype=float)
    size, unseen = _size_and_unseen(table, name, column.value, value, exact, quantities)
    tolerance = size * np.where(table["case"].isin(list(approximate_cases)), ALMOST, ROUNDING)
    tolerance = tolerance + np.where(_gaussian(tables_by_name, table), 0.0, unseen)
    with np.errstate(invalid="ignore"):  # an infinite gain, against a σ of zero, has no distance from another
        is_close = np.abs(exact - value) <= tolerance
        nearest = np.where(is_close, value, exact - np.sign(exact - value) * np.where(is_close, 0.0, tolerance))
    n = table["n"] if "n" in table else table["case"].map(tables_by_name["curves"].groupby("case")["n"].min())
    enough = (n.to_numpy(dtype=float) >= MIN_TRUSTED_REALISATIONS) & ~np.isnan(exact)
    return np.where(enough, standard_errors(Estimate(value, low, high), nearest), np.nan)


def _size_and_unseen(
    table: "pd.DataFrame", name: str, column: str, value: np.ndarray, exact: np.ndarray, quantities: Sequence[Quantity]
) -> tuple[np.ndarray, np.ndarray]:
    """The size (rows,) of which a tolerance is a fraction, and how much rare events that are missing may make."""
    size, unseen = np.abs(exact), np.zeros(len(table))
    of_squares = [(quantity.table, quantity.value) for quantity in quantities if quantity.squares]
    if column == "bias":
        size = np.fmax(size, table["sigma"].to_numpy(dtype=float))
        unseen = size * np.sqrt(UNSEEN / np.fmax(table["n"].to_numpy(dtype=float), 1.0))  # n = 0: no row is judged
    elif column.endswith("_percent"):  # of a ratio of two σ
        size = np.abs(100 - exact)
        unseen[:] = np.inf
    elif column in SQUARES or (name, column) in of_squares:
        unseen[value < exact] = np.inf
    return size, unseen


def _gaussian(tables_by_name: "Mapping[str, pd.DataFrame]", table: "pd.DataFrame") -> np.ndarray:
    """Whether errors are Gaussian, (rows,), of the filter of each row, and of the one it is compared with."""
    curves = tables_by_name.get("curves")
    if curves is None or not len(curves):
        return np.zeros(len(table), dtype=bool)
    n, n_eff, sigma, bias, spread = (
        curves[column].to_numpy(dtype=float) for column in ("n", "n_eff", "sigma", "bias", "spread")
    )
    square, variance = sigma**2, spread**2
    with np.errstate(divide="ignore", invalid="ignore"):
        kurtosis = 1 + n / n_eff
        gaussian_kurtosis = (bias**4 + 6 * bias**2 * variance + 3 * variance**2) / square**2
        error = np.sqrt((96 * bias**2 * variance**3 + 24 * variance**4) / n) / square**2
        strays = np.abs(kurtosis - gaussian_kurtosis) > STRAYS * error + ROUNDING
    not_gaussian = set(zip(curves["case"][strays], curves["filter"][strays], strict=True))
    roles = [role for role in ("filter", "baseline") if role in table]
    is_gaussian = np.ones(len(table), bool)
    for role in roles if not_gaussian else ():
        pairs = zip(table["case"].tolist(), table[role].tolist(), strict=True)
        is_gaussian &= [pair not in not_gaussian for pair in pairs]
    return is_gaussian


def disagreements(
    tables_by_name: "Mapping[str, pd.DataFrame]",
    approximate_cases: Collection[str] = (),
    unchecked: Collection[str] = ("claims",),
    quantities: Sequence[Quantity] = (),
) -> list[str]:
    """A line for each column that is further off its exact values than chance explains: its furthest row.

    tables_by_name, approximate_cases, quantities: as for `standardised_errors`; unchecked: tables without exact values
    of the measured quantities, whatever their columns."""
    errors_by_column = {
        (name, column): standardised_errors(tables_by_name, name, column, approximate_cases, quantities)
        for name, table in tables_by_name.items()
        if name not in unchecked and "case" in table and len(table)
        for column in exact_columns(table)
    }
    count = sum(int((~np.isnan(errors)).sum()) for errors in errors_by_column.values())
    limit = max(ERROR_OF_PROGRAM, largest_by_chance(count))
    return [
        _disagreement(tables_by_name[name], name, column, errors, limit, count)
        for (name, column), errors in errors_by_column.items()
        if (errors > limit).any()
    ]


def _disagreement(
    table: "pd.DataFrame", name: str, column: ExactColumn, errors: np.ndarray, limit: float, count: int
) -> str:
    """The line on a column with errors (rows,) over the limit, the most that chance explains among `count`."""
    index = int(np.nanargmax(errors))
    row = table.iloc[index]
    scan = f"k = {row['k']:g}" + (f" ({row['t_s']:g} s)" if "t_s" in row else "") if "k" in row else ""
    return tr(
        "{table}.csv: {place}: {column} measured {measured:.6g}, exactly {exact:.6g}: "
        "{apart:.3g} standard errors apart; {count:,} of {rows:,} rows of this column exceed "
        "{bound:.3g}, the most that chance explains in {many:,}: the simulation or the exact value is "
        "wrong",
        table=name,
        place=", ".join(filter(None, (*(str(row[key]) for key in ROW_LABELS if key in row), scan))),
        column=column.value,
        measured=float(row[column.value]),
        exact=float(row[column.exact]),
        apart=float(errors[index]),
        bound=limit,
        many=count,
        count=int((errors > limit).sum()),
        rows=int((~np.isnan(errors)).sum()),
    )


def agreement_table(curves: "pd.DataFrame") -> "pd.DataFrame | None":
    """A row for each case, filter and component of curves.csv whose exact σ is known; None where none is."""
    exact_rows = curves[
        np.isfinite(curves["exact_sigma"]) & (curves["exact_sigma"] > 0) & np.isfinite(curves["sigma_lo"])
    ]
    if not len(exact_rows):
        return None
    exact, sigma = exact_rows["exact_sigma"], exact_rows["sigma"]
    exact_rows = exact_rows.assign(
        inside=(exact_rows["sigma_lo"] <= exact) & (exact <= exact_rows["sigma_hi"]),
        difference=100 * (sigma / exact - 1),
    )
    rows = []
    for keys, scans in exact_rows.groupby(["case", "filter", "component"], sort=False):
        worst = scans.loc[scans["difference"].abs().idxmax()]
        share = 100 * float(scans["inside"].mean())
        rows.append((*keys, worst["unit"], len(scans), round(share, 1), float(worst["difference"]), int(worst["k"])))
    return tables.frame({name: [row[i] for row in rows] for i, name in enumerate(COLUMNS)})
