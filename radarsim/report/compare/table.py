"""The table of a comparison: every measured value of two sides at common times, their difference with its interval.

Where both sides are of the same measurements their errors go together, and the interval of a difference needs the
correlation ρ of their mean squares. Stored results hold that of each filter with the baseline of its run. Where both
runs have the same baseline (its rows are equal to the last digit), ρ is at least ρ₁ρ₂ − √((1 − ρ₁²)(1 − ρ₂²)), since a
matrix of correlations has no negative eigenvalue: with it the interval covers 95 % or more. Where no filter links them,
ρ is taken as −1, the worst there is: the half-widths add. Sides of different noise are independent.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.language import term
from radarsim.report import tables as common
from radarsim.report.compare.sides import LABELS, SERIES, Pair, Series, Side
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
    UNLINKED: term("common noise but no common baseline filter; the interval holds whatever the correlation"),
    SAME: term("the same numbers"),
}
DIGITS = 9  # of a time, by which rows find one another


def compared(pairs: Sequence[Pair]) -> "pd.DataFrame":
    """A row for each value of a side that the other side has too."""
    parts = [part for pair in pairs for series in SERIES if (part := _part(pair, series)) is not None]
    return common.joined(parts, COLUMNS)


def filters_of(side: Side) -> list[str]:
    """The filters of a side, in their order."""
    return list(dict.fromkeys(side.tables["curves"]["filter"])) if "curves" in side.tables else []


def _part(pair: Pair, series: Series) -> dict[str, Any] | None:
    """The columns of one quantity of one pair; None where they share no row."""
    a, b = (side.tables.get(series.table) for side in pair)
    if a is None or b is None or not len(a) or not len(b):
        return None
    own, other = filters_of(pair.side), filters_of(pair.against)
    alone = len(own) == len(other) == 1 and own != other  # two lone filters answer to one another by any name
    b = b.assign(against_filter=b["filter"])
    if alone:
        b = b.assign(filter=own[0])
    keys = [name for name in (*LABELS, "unit") if name in a and name in b]
    a, b = (rows.assign(at=rows["t_s"].round(DIGITS)) for rows in (a, b))
    if not set(a["at"]) & set(b["at"]):  # no common time: the ends of both
        a, b = (rows.groupby(keys, sort=False).tail(1).assign(at=np.nan) for rows in (a, b))
    rows = a.merge(b, on=[*keys, "at"], suffixes=("", "_b"))
    return _columns(pair, series, rows) if len(rows) else None


def _columns(pair: Pair, series: Series, rows: "pd.DataFrame") -> dict[str, Any]:
    n = len(rows)
    empty, blank = np.full(n, np.nan), np.full(n, "", dtype=object)
    unit = np.full(n, series.unit, dtype=object)
    measured, other = (_estimate(rows, series, end) for end in ("", "_b"))
    rho, pairing = correlation(pair, series, rows)
    same = pairing == SAME

    def apart_of(one: Estimate, two: Estimate) -> Estimate:
        apart = difference(one, two, rho)
        return Estimate(apart.value, *(np.where(same, apart.value, end) for end in apart[1:]))

    apart = apart_of(measured, other)
    exact, against_exact = (_column(rows, f"{series.exact}{end}", empty) for end in ("", "_b"))
    percent, exact_percent = Estimate(empty, empty, empty), empty
    if series.ratio:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = apart_of(*(Estimate(*map(np.log, of)) for of in (measured, other)))
            percent = Estimate(*(100 * np.expm1(end) for end in ratio))
            exact_percent = 100 * (exact / against_exact - 1)
    return {
        "quantity": np.full(n, series.value, dtype=object),
        **{name: _column(rows, name, blank) for name in LABELS},
        "unit": _column(rows, "unit", unit),
        "t_s": rows["t_s"].to_numpy(dtype=float),
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "").items()},
        **common.interval("value", measured, ""),
        "exact": exact,
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "against_").items()},
        "against_filter": rows["against_filter"].to_numpy(),
        **common.interval("against", other),
        "against_exact": against_exact,
        **common.interval("difference", apart),
        **common.interval("percent", percent),
        "exact_percent": exact_percent,
        "pairing": pairing,
    }


def _names(pair: Pair, before: str) -> Mapping[str, str]:
    side = pair.against if before else pair.side
    return {f"{before}run": side.run, f"{before}case": side.case, f"{before}label": side.label}


def _column(rows: "pd.DataFrame", name: str, absent: np.ndarray) -> np.ndarray:
    return rows[name].to_numpy() if name in rows else absent


def _estimate(rows: "pd.DataFrame", series: Series, end: str) -> Estimate:
    return Estimate(*(rows[f"{name}{end}"].to_numpy(dtype=float) for name in (series.value, series.lo, series.hi)))


def correlation(pair: Pair, series: Series, rows: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """Of each row the correlation of both estimates, as bad as it can be, and in a word what is known of it."""
    n = len(rows)
    if not pair.common_noise:
        return np.zeros(n), np.full(n, INDEPENDENT, dtype=object)
    a, b = (_estimate(rows, series, end) for end in ("", "_b"))
    same = np.all([x == y for x, y in zip(a, b, strict=True)], axis=0)
    rho = np.full(n, -1.0)
    if series.ratio and pair.side.count == pair.against.count:
        one = _with_baseline(pair.side, rows, "filter")
        two = _with_baseline(pair.against, rows, "against_filter")
        linked = _same_baseline(pair, rows)
        with np.errstate(invalid="ignore"):
            worst = one * two - np.sqrt(np.maximum((1 - one**2) * (1 - two**2), 0))
        rho = np.where(linked & np.isfinite(worst), worst, rho)
    words = np.where(rho > -1, LINKED, UNLINKED).astype(object)
    return np.where(same, 1.0, rho), np.where(same, SAME, words)


def _with_baseline(side: Side, rows: "pd.DataFrame", column: str) -> np.ndarray:
    """The correlation of each row's mean square with the baseline's: from the widths of both σ and of their gain."""
    base, widths = baseline(side), _widths(side.tables["curves"], "sigma_lo", "sigma_hi")
    gains = side.tables["gains"]
    ratios = _widths(gains.assign(hi=100 - gains["gain_lo"], lo=100 - gains["gain_hi"]), "lo", "hi")
    found = np.full(len(rows), np.nan)
    for i, (f, c, t) in enumerate(rows[[column, "component", "t_s"]].itertuples(index=False, name=None)):
        own, other, joint = widths.get((f, c, t)), widths.get((base, c, t)), ratios.get((f, c, t))
        if f == base:
            found[i] = 1.0
        elif own and other and joint is not None:
            found[i] = np.clip((own**2 + other**2 - joint**2) / (2 * own * other), -1, 1)
    return found


def _widths(table: "pd.DataFrame", lo: str, hi: str) -> dict[tuple, float]:
    """Half the logarithm of the upper over the lower end, by filter, component and time."""
    with np.errstate(divide="ignore", invalid="ignore"):
        half = 0.5 * np.log(table[hi].to_numpy(dtype=float) / table[lo].to_numpy(dtype=float))
    keys = table[["filter", "component", "t_s"]].itertuples(index=False, name=None)
    return {key: value for key, value in zip(keys, half.tolist(), strict=True) if np.isfinite(value)}


def baseline(side: Side) -> str:
    """The filter that a side's gains are against; empty where there are no gains."""
    gains = side.tables.get("gains")
    return "" if gains is None or not len(gains) else str(gains["baseline"].iloc[0])


def _same_baseline(pair: Pair, rows: "pd.DataFrame") -> np.ndarray:
    """Whether both sides' baselines have the very same numbers at the row's component and time: the same filter."""
    known = []
    for side in pair:
        curves = side.tables["curves"]
        own = curves[curves["filter"] == baseline(side)]
        values = own[["component", "t_s", "sigma", "sigma_lo", "sigma_hi"]].itertuples(index=False, name=None)
        known.append({(c, t): rest for c, t, *rest in values})
    places = rows[["component", "t_s"]].itertuples(index=False, name=None)
    return np.array([place in known[0] and known[0][place] == known[1].get(place) for place in places], dtype=bool)
