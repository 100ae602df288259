"""The table of a comparison: every measured value of two sides at common times, and their difference.

The table has every measured value of two sides at common times, and their difference with its interval. Where both
sides use the same measurements their errors are correlated, and the interval of a difference needs the correlation ρ of
their mean squares. Stored results hold that of each filter with the baseline of its run. Where both runs have the same
baseline (its rows are equal to the last digit), ρ is at least ρ₁ρ₂ − √((1 − ρ₁²)(1 − ρ₂²)), since a correlation matrix
has no negative eigenvalue: with it the interval covers 95 % or more. Where no filter links them, ρ is taken as −1, the
worst case: the half-widths add. Sides of different noise are independent."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.language.translate import term
from radarsim.report import tables
from radarsim.report.comparison.pairs import LABELS, Pair, Side
from radarsim.report.quantities import SIGMA, Quantity
from radarsim.report.statistics import Estimate, difference

if TYPE_CHECKING:
    import pandas as pd


COLUMNS = (
    *("quantity", "filter", "component", "model", "unit", "t_s", "run", "case", "value", "lo", "hi", "exact"),
    *("against_run", "against_case", "against_filter", "against", "against_lo", "against_hi", "against_exact"),
    *("difference", "difference_lo", "difference_hi", "percent", "percent_lo", "percent_hi", "exact_percent"),
    *("pairing", "label", "against_label"),
)
INDEPENDENT, LINKED, UNLINKED, SAME = "independent", "paired", "common noise", "same numbers"
MEANING = {
    INDEPENDENT: term("independent noise"),
    LINKED: term("paired on common noise through the common baseline; the interval covers 95 % or more"),
    UNLINKED: term("common noise but no common baseline filter; the interval is valid for any correlation"),
    SAME: term("the same numbers"),
}
DIGITS = 9  # of a time, when rows are matched


def comparison_table(pairs: Sequence[Pair]) -> "pd.DataFrame":
    """A row for each value of a side that the other side has too."""
    parts = [
        part for pair in pairs for quantity in shared_quantities(pair) if (part := _part(pair, quantity)) is not None
    ]
    return tables.join_columns(parts, COLUMNS)


def shared_quantities(sides: Iterable[Side]) -> list[Quantity]:
    """The quantities measured by two sides or more; the complement of a share differs by the same amount."""
    measured = [quantity for side in sides for quantity in side.measured if not quantity.is_complement]
    return [quantity for quantity in dict.fromkeys(measured) if measured.count(quantity) > 1]


def filters_of(side: Side) -> list[str]:
    """The filters of a side, in their order."""
    return list(dict.fromkeys(side.tables["curves"]["filter"])) if "curves" in side.tables else []


def _part(pair: Pair, quantity: Quantity) -> dict[str, Any] | None:
    """The columns of one quantity of one pair; None where they share no row."""
    stored = [side.tables.get(quantity.table) for side in pair]
    a, b = (None if table is None or not len(table) else comparison_rows(table, quantity) for table in stored)
    if a is None or b is None:
        return None
    filters, other_filters = filters_of(pair.side), filters_of(pair.reference)
    # Two single filters are partners whatever their names.
    are_single = len(filters) == len(other_filters) == 1 and filters != other_filters
    b = b.assign(against_filter=b["filter"])
    if are_single:
        b = b.assign(filter=filters[0])
    keys = [name for name in (*LABELS, "unit") if name in a and name in b]
    a, b = (rows.assign(at=rows["t_s"].round(DIGITS)) for rows in (a, b))
    if not set(a["at"]) & set(b["at"]):  # no common time: the ends of both
        a, b = (rows.groupby(keys, sort=False).tail(1).assign(at=np.nan) for rows in (a, b))
    rows = a.merge(b, on=[*keys, "at"], suffixes=("", "_b"))
    return _columns(pair, quantity, rows) if len(rows) else None


def comparison_rows(table: "pd.DataFrame", quantity: Quantity) -> "pd.DataFrame":
    """Rows of a quantity's table with the columns of `LABELS`, `unit`, `t_s`, `value`, `lo`, `hi` and `exact`. The
    first ones as far as it has them; without times these are not-a-number."""
    values, exact = quantity.read(table)
    labels = {"filter": "filter", quantity.per if quantity.per in LABELS else "component": quantity.per, "unit": "unit"}
    return tables.frame(
        {
            **{name: table[column].to_numpy() for name, column in labels.items() if column in table},
            "t_s": table["t_s"].to_numpy(dtype=float) if "t_s" in table else np.full(len(table), np.nan),
            **tables.interval_columns("value", values, ""),
            "exact": exact,
        }
    )


def _columns(pair: Pair, quantity: Quantity, rows: "pd.DataFrame") -> dict[str, Any]:
    n = len(rows)
    empty, blank = np.full(n, np.nan), np.full(n, "", dtype=object)
    unit = np.full(n, quantity.unit, dtype=object)
    measured, against = (_estimate(rows, end) for end in ("", "_b"))
    rho, pairing = correlation(pair, quantity, rows)
    is_same = pairing == SAME

    def difference_of(minuend: Estimate, subtrahend: Estimate) -> Estimate:
        change = difference(minuend, subtrahend, rho)
        return Estimate(change.value, *(np.where(is_same, change.value, end) for end in change[1:]))

    change = difference_of(measured, against)
    exact, against_exact = (rows[f"exact{end}"].to_numpy() for end in ("", "_b"))
    percent, exact_percent = Estimate(empty, empty, empty), empty
    if quantity.kind == "size":
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = difference_of(*(Estimate(*map(np.log, side)) for side in (measured, against)))
            is_finite = np.isfinite(ratio.value)  # not where either was never seen
            percent = Estimate(*(np.where(is_finite, 100 * np.expm1(end), np.nan) for end in ratio))
            exact_percent = 100 * (exact / against_exact - 1)
    return {
        "quantity": np.full(n, quantity.value, dtype=object),
        **{name: _column(rows, name, blank) for name in LABELS},
        "unit": _column(rows, "unit", unit),
        "t_s": rows["t_s"].to_numpy(dtype=float),
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "").items()},
        **tables.interval_columns("value", measured, ""),
        "exact": exact,
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "against_").items()},
        "against_filter": rows["against_filter"].to_numpy(),
        **tables.interval_columns("against", against),
        "against_exact": against_exact,
        **tables.interval_columns("difference", change),
        **tables.interval_columns("percent", percent),
        "exact_percent": exact_percent,
        "pairing": pairing,
    }


def _names(pair: Pair, before: str) -> Mapping[str, str]:
    side = pair.reference if before else pair.side
    return {f"{before}run": side.run, f"{before}case": side.case, f"{before}label": side.label}


def _column(rows: "pd.DataFrame", name: str, absent: np.ndarray) -> np.ndarray:
    return rows[name].to_numpy() if name in rows else absent


def _estimate(rows: "pd.DataFrame", end: str) -> Estimate:
    return Estimate(*(rows[f"{name}{end}"].to_numpy(dtype=float) for name in ("value", "lo", "hi")))


def correlation(pair: Pair, quantity: Quantity, rows: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """For each row the correlation of both estimates, in the worst case, and how it is known."""
    n = len(rows)
    if not pair.common_noise:
        return np.zeros(n), np.full(n, INDEPENDENT, dtype=object)
    a, b = (_estimate(rows, end) for end in ("", "_b"))
    is_same = np.all([x == y for x, y in zip(a, b, strict=True)], axis=0)
    rho = np.full(n, -1.0)
    if quantity == SIGMA and pair.side.count == pair.reference.count:
        rho_side = _with_baseline(pair.side, rows, "filter")
        rho_against = _with_baseline(pair.reference, rows, "against_filter")
        linked = _same_baseline(pair, rows)
        with np.errstate(invalid="ignore"):
            worst = rho_side * rho_against - np.sqrt(np.maximum((1 - rho_side**2) * (1 - rho_against**2), 0))
        rho = np.where(linked & np.isfinite(worst), worst, rho)
    pairing = np.where(rho > -1, LINKED, UNLINKED).astype(object)
    return np.where(is_same, 1.0, rho), np.where(is_same, SAME, pairing)


def _with_baseline(side: Side, rows: "pd.DataFrame", column: str) -> np.ndarray:
    """The correlation of each row's mean square with the baseline's: from the widths of both σ and of their gain."""
    baseline_name, widths = baseline_of(side), _widths(side.tables["curves"], "sigma_lo", "sigma_hi")
    gains = side.tables["gains"]
    ratios = _widths(gains.assign(hi=100 - gains["gain_lo"], lo=100 - gains["gain_hi"]), "lo", "hi")
    correlations = np.full(len(rows), np.nan)
    for i, (f, c, t) in enumerate(rows[[column, "component", "t_s"]].itertuples(index=False, name=None)):
        width, base_width, ratio_width = widths.get((f, c, t)), widths.get((baseline_name, c, t)), ratios.get((f, c, t))
        if f == baseline_name:
            correlations[i] = 1.0
        elif width and base_width and ratio_width is not None:
            correlations[i] = np.clip((width**2 + base_width**2 - ratio_width**2) / (2 * width * base_width), -1, 1)
    return correlations


def _widths(table: "pd.DataFrame", lo: str, hi: str) -> dict[tuple, float]:
    """Half the logarithm of the upper over the lower end, by filter, component and time."""
    with np.errstate(divide="ignore", invalid="ignore"):
        half = 0.5 * np.log(table[hi].to_numpy(dtype=float) / table[lo].to_numpy(dtype=float))
    keys = table[["filter", "component", "t_s"]].itertuples(index=False, name=None)
    return {key: value for key, value in zip(keys, half.tolist(), strict=True) if np.isfinite(value)}


def baseline_of(side: Side) -> str:
    """The filter that a side's gains are against; empty where there are no gains."""
    gains = side.tables.get("gains")
    return "" if gains is None or not len(gains) else str(gains["baseline"].iloc[0])


def _same_baseline(pair: Pair, rows: "pd.DataFrame") -> np.ndarray:
    """Whether both sides' baselines have equal numbers at the row's component and time: the same filter."""
    baseline_rows = []
    for side in pair:
        curves = side.tables["curves"]
        rows_of_baseline = curves[curves["filter"] == baseline_of(side)]
        values = rows_of_baseline[["component", "t_s", "sigma", "sigma_lo", "sigma_hi"]].itertuples(
            index=False, name=None
        )
        baseline_rows.append({(c, t): numbers for c, t, *numbers in values})
    points = rows[["component", "t_s"]].itertuples(index=False, name=None)
    return np.array(
        [point in baseline_rows[0] and baseline_rows[0][point] == baseline_rows[1].get(point) for point in points],
        dtype=bool,
    )
