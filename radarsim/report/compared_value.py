"""What sentences say of a quantity of a row: the exact value, else a paired one, else the measured one.

Answers, headlines, captions and rankings take their numbers from here, so that the sentences of one page name the same
scan and the same value. An extreme of measured values is chosen by their noise: it has an interval that holds for all
values among which it was chosen."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from radarsim.language.numerals import numeral
from radarsim.language.translate import plural, tr
from radarsim.report import exact_marks, sentences, statistics, tables, wording
from radarsim.report.quantities import GAIN, SIGMA, Quantity
from radarsim.report.statistics import Estimate

if TYPE_CHECKING:
    import pandas as pd

EQUAL = 0.01  # relative difference by which nobody would choose
Row = Any  # a row of a table: a Series, or a mapping by column
WIDEN = {
    "size": statistics.simultaneous_sizes,
    "gain": statistics.simultaneous_gains,
    "share": statistics.simultaneous_shares,
    "signed": statistics.simultaneous_means,
}


@dataclass(frozen=True)
class ComparedValue:
    """A value in sentences, with its 95 % interval unless it is exact, and the intervals of tables that it rests on."""

    estimate: Estimate
    is_exact: bool
    intervals: tuple[sentences.MeasuredInterval, ...] = ()
    looks: int = 1  # measured values among which it was chosen, for all of which its interval holds
    kind: Literal["size", "gain", "share", "signed"] = "size"

    @property
    def value(self) -> float:
        return float(self.estimate.value)

    def chosen_among(self, looks: int) -> "ComparedValue":
        """The same value as an extreme of so many measured ones; an exact one was not chosen by noise."""
        if self.is_exact or looks < 2:
            return self
        return replace(self, estimate=WIDEN[self.kind](self.estimate, looks), looks=looks)

    def mapped(self, function: Callable[[float], float]) -> "ComparedValue":
        """A monotonic function of the value, with its interval."""
        low, high = sorted(function(float(end)) for end in self.estimate[1:])
        return replace(self, estimate=Estimate(function(self.value), low, high))

    def text(self, unit: str = "", form: str = ".4g") -> str:
        """12.3 m [12.0, 12.6]; an exact value without an interval."""
        if not self.is_exact:
            return wording.estimate(self.estimate, unit, form)
        value = numeral(format(self.value, form)).replace("inf", "∞")
        return exact_marks.exact_text(" ".join(filter(None, (value, unit))))

    def choice_remark(self, together: Callable[[int], str] | None = None) -> str:
        """In brackets, for how many measured values its interval holds; empty where it was not chosen, or has none.

        together: words that say what these are, such as `filters_together`; default: `simultaneity_text`."""
        if self.looks < 2 or np.isnan(self.estimate.lo):
            return ""
        return f" ({(together or simultaneity_text)(self.looks)})"


def simultaneity_text(count: int) -> str:
    """That intervals hold for so many simulated values at once, and how surely."""
    if count == 2:
        return tr("95 % for both simulated values together")
    return plural("95 % for {count} simulated value", "95 % for all {count} simulated values together", count)


def cases_together(count: int) -> str:
    """That intervals hold for so many cases at once."""
    if count == 2:
        return tr("95 % for both cases together")
    return plural("95 % for {count} case", "95 % for all {count} cases together", count)


def filters_together(count: int) -> str:
    """That intervals hold for so many filters at once."""
    if count == 2:
        return tr("95 % for both filters together")
    return plural("95 % for {count} filter", "95 % for all {count} filters together", count)


def scans_together(count: int) -> str:
    """That intervals hold for so many scans at once."""
    if count == 2:
        return tr("95 % for both scans together")
    return plural("95 % for {count} scan", "95 % for all {count} scans together", count)


def comparisons_together(count: int) -> str:
    """That intervals hold for so many comparisons at once."""
    if count == 2:
        return tr("95 % for both comparisons together")
    return plural("95 % for {count} comparison", "95 % for all {count} comparisons together", count)


def choice_remark(values: Sequence[ComparedValue]) -> str:
    """The remark on values of one sentence that are alike in how they were chosen; empty if none has an interval."""
    return next(filter(None, (value.choice_remark() for value in values)), "")


def row_value(row: Row, quantity: Quantity = SIGMA) -> ComparedValue:
    """The exact value of a quantity in a row, else the measured one with its interval."""
    kind: Any = "gain" if quantity.paired else quantity.kind
    exact = float(row.get(quantity.exact_column, np.nan))
    if not np.isnan(exact):
        return ComparedValue(Estimate(exact, exact, exact), True, kind=kind)
    estimate = Estimate(*(float(row[name]) for name in (quantity.value, *quantity.ends)))
    rests_on = sentences.intervals(quantity.table, quantity.ends[0].removesuffix("_lo"), row) if has_label(row) else ()
    return ComparedValue(estimate, False, rests_on, kind=kind)


def largest_bias(rows: "pd.DataFrame") -> "tuple[pd.Series[Any], ComparedValue]":
    """The row of `curves` with the largest mean error of either sign, exact values first, and its value."""
    exact = rows["exact_bias"].to_numpy(dtype=float)
    row = rows.iloc[int(np.nanargmax(np.abs(tables.exact_first(rows, "bias", "exact_bias"))))]
    known, value, half = float(row["exact_bias"]), float(row["bias"]), statistics.Z95 * float(row["bias_se"])
    if not np.isnan(known):
        return row, ComparedValue(Estimate(known, known, known), True, kind="signed")
    measured = ComparedValue(Estimate(value, value - half, value + half), False, kind="signed")
    return row, measured.chosen_among(int(np.isnan(exact).sum()))


def has_label(row: Row) -> bool:
    """Whether a row knows its label in its table."""
    return getattr(row, "name", None) is not None


def paired_sigma(baseline_sigma: float, gain_row: Row) -> ComparedValue:
    """σ of a filter from the exact σ of its baseline and the paired gain over the same realisations."""
    gain = row_value(gain_row, GAIN)
    low, high = (baseline_sigma * (1 - gain.estimate[i] / 100) for i in (2, 1))
    return ComparedValue(Estimate(baseline_sigma * (1 - gain.value / 100), low, high), gain.is_exact, gain.intervals)


def sigma_value(row: Row, tables_by_name: "Mapping[str, pd.DataFrame]") -> ComparedValue:
    """σ of a row of `curves`: exact; else by the paired gain over a baseline with an exact σ, where that is known
    better and both have an estimate in the same realisations; else as measured."""
    measured = row_value(row)
    if measured.is_exact:
        return measured
    labels = {name: row[name] for name in ("case", "component", "k")}
    curves = tables.select_rows(tables_by_name["curves"], **labels).set_index("filter")
    for _, gain_row in tables.select_rows(tables_by_name["gains"], filter=row["filter"], **labels).iterrows():
        baseline = curves.loc[gain_row["baseline"]]
        if baseline.get("exact_sigma", np.nan) > 0 and baseline["n"] == row["n"]:
            paired = paired_sigma(float(baseline["exact_sigma"]), gain_row)
            if np.ptp(paired.estimate[1:]) < np.ptp(measured.estimate[1:]):
                measured = paired
    return measured


def sigma_gain(row: Row, other: Row, tables_by_name: "Mapping[str, pd.DataFrame]") -> Estimate:
    """The gain in σ of a row of `curves` over another one of the same case, component and scan, per cent.

    Exact where both are; else the narrowest of what is measured on its own and of gains over a common baseline, taken
    as independent of each other: as they are not, the interval is too wide rather than too narrow."""
    first, second = row_value(row), row_value(other)
    if first.is_exact and second.is_exact:
        gain = 100 * (1 - first.value / second.value)
        return Estimate(gain, gain, gain)
    gains = tables.select_rows(tables_by_name["gains"], **{name: row[name] for name in ("case", "component", "k")})
    with np.errstate(divide="ignore", invalid="ignore"):
        pairs = [[Estimate(*np.log(np.asarray(value.estimate, dtype=float))) for value in (first, second)]]
    for baseline in dict.fromkeys(gains["baseline"]):
        rows = {gain_row["filter"]: gain_row for _, gain_row in gains[gains["baseline"] == baseline].iterrows()}
        pairs.append([_log_ratio(each["filter"], baseline, rows) for each in (row, other)])
    differences = [statistics.difference(*pair) for pair in pairs]
    known = [difference for difference in differences if difference.hi >= difference.lo]
    if not known:
        return Estimate(np.nan, -np.inf, np.inf)
    ratio = min(known, key=lambda difference: float(difference.hi - difference.lo))
    return Estimate(*(float(-100 * np.expm1(ratio[i])) for i in (0, 2, 1)))


def _log_ratio(name: str, baseline: str, gain_rows: Mapping[str, Row]) -> Estimate:
    """The logarithm of a filter's σ over its baseline's, from rows of `gains`; not-a-number without one."""
    if name == baseline:
        return Estimate(0.0, 0.0, 0.0)
    if name not in gain_rows:
        return Estimate(np.nan, np.nan, np.nan)
    gain = row_value(gain_rows[name], GAIN).estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        return Estimate(*(float(np.log1p(-gain[i] / 100)) for i in (0, 2, 1)))


def value_ratio(value: ComparedValue, baseline: ComparedValue) -> ComparedValue:
    """The ratio of two positive values of which neither depends on the other's noise."""
    if baseline.is_exact:
        return value.mapped(lambda sigma: sigma / baseline.value)
    logs = (Estimate(*np.log(np.asarray(each.estimate, dtype=float))) for each in (value, baseline))
    ratio = Estimate(*(float(np.exp(end)) for end in statistics.difference(*logs)))
    return ComparedValue(ratio, False, (*value.intervals, *baseline.intervals))


def extreme(rows: "pd.DataFrame", quantity: Quantity, largest: bool = True) -> "tuple[pd.Series[Any], ComparedValue]":
    """The row with the largest or the smallest value, exact values first, and its value.

    Of measured values the interval is one that holds for all that were looked at."""
    exact = rows.get(quantity.exact_column, rows[quantity.value] * np.nan).to_numpy(dtype=float)
    decides = np.where(np.isnan(exact), rows[quantity.value].to_numpy(dtype=float), exact)
    row = rows.iloc[int(np.nanargmax(decides) if largest else np.nanargmin(decides))]
    return row, row_value(row, quantity).chosen_among(int(np.isnan(exact).sum()))


def is_equal(worst: ComparedValue, least: ComparedValue) -> bool:
    """Whether nobody would choose by the difference of two values: it is under 1 %, or within their noise."""
    return worst.value <= least.value * (1 + EQUAL) or not are_distinguished(worst, least)


def are_distinguished(first: ComparedValue, second: ComparedValue) -> bool:
    """Whether two values that are not paired differ by more than their noise."""
    if first.is_exact and second.is_exact:
        return first.value != second.value
    difference = statistics.difference(first.estimate, second.estimate)
    return bool(difference.lo > 0 or difference.hi < 0)
