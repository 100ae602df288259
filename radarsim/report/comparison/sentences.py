"""Words for a comparison: the change of a value, and how values are paired; which quantities its summary has."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.errors import ConfigError, argument
from radarsim.language.translate import tr
from radarsim.report.comparison.table import MEANING
from radarsim.report.quantities import Quantity
from radarsim.report.wording import interval, significant_digits
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd


def summary_quantities(comparison: "pd.DataFrame", measured: Iterable[Quantity]) -> list[Quantity]:
    """The quantities in the summary: the first, and those that neither follow from it (gains) nor list many shares."""
    compared_quantities = [quantity for quantity in measured if (comparison["quantity"] == quantity.value).any()]
    return [
        quantity
        for n, quantity in enumerate(compared_quantities)
        if not n or (not quantity.paired and quantity.per in ("", "component"))
    ]


def final_rows(comparison: "pd.DataFrame", at_s: float | None = None) -> "pd.DataFrame":
    """The rows of the last common time of each line, or of that at at_s, s, of those with a value on both sides. Raises
    ConfigError for a time that is not common."""
    keys = ["quantity", "label", "against_label", "filter", "component", "model"]
    if at_s is not None:
        t_s = comparison["t_s"].to_numpy(dtype=float)
        comparison = comparison[np.isclose(t_s, at_s, rtol=1e-9)]
        if not len(comparison):
            low, near, high = np.nanmin(t_s), t_s[np.nanargmin(np.abs(t_s - at_s))], np.nanmax(t_s)
            raise ConfigError(
                f"{argument('wanted', '--for')}: must be a common time, from {low:g} to {high:g} s, the nearest "
                f"{near:g} s, got {at_s:g}"
            )
    last = comparison.groupby(keys, sort=False).tail(1)
    return last[last["value"].notna() & last["against"].notna()]


def change_texts(row: dict[Any, Any]) -> tuple[str, str]:
    """The difference of a value, with its interval; and the exact difference where known beside a sample."""
    if row["percent"] != row["percent"]:
        size = signed(row["difference"])
        is_share = row["unit"] == "%"
        text = tr("{size} points", size=size) if is_share else f"{size} {tr(unit_of(row['unit']))}".rstrip()
        return f"{text} {interval(signed(row['difference_lo']), signed(row['difference_hi']))}", ""
    exact = row["exact_percent"]
    if row["lo"] == row["hi"] and row["against_lo"] == row["against_hi"] and exact == exact:
        return percent_text(exact), ""  # of a table of exact values: there is no interval
    percents = row["percent_lo"], row["percent_hi"]
    bounds = [signed(bound, "#.3g") if max(percents) < MULTIPLE else percent_text(bound) for bound in percents]
    return f"{percent_text(row['percent'])} {interval(*bounds)}", percent_text(exact) if exact == exact else ""


MULTIPLE = 300  # per cent, from which on a change is written as a multiple


def percent_text(value: float) -> str:
    """A change in per cent with its sign; from four times on as a multiple."""
    if value >= MULTIPLE:
        return tr("{factor} times", factor=significant_digits(1 + value / 100, ".3g"))
    return f"{signed(value, '#.3g' if value else '.3g')} %"


def signed(value: float, form: str = ".3g") -> str:
    """A number with its sign."""
    text = significant_digits(value, form)
    return text if text.startswith("−") or value == 0 else f"+{text}"


def value_text(number: float) -> str:
    """A number at four digits."""
    return significant_digits(number)


def pairing_lines(comparison: "pd.DataFrame") -> list[str]:
    """How the differences are paired, a line for each kind."""
    kinds = comparison.loc[comparison["quantity"] == "sigma", "pairing"].tolist()
    counts = {meaning: kinds.count(kind) for kind, meaning in MEANING.items()}
    return [
        tr(
            "{count:,} of {total:,} differences of RMS errors: {words}",
            count=count,
            total=len(kinds),
            words=tr(meaning),
        )
        for meaning, count in counts.items()
        if count
    ]
