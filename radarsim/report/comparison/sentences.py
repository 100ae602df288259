"""Sentences on a comparison: both values at the end, their change, and how they are paired."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from radarsim.language.translate import plural, tr
from radarsim.report import tables
from radarsim.report.comparison.table import MEANING
from radarsim.report.quantities import COMMON, Quantity
from radarsim.report.wording import interval, significant_digits
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd


MAX_SENTENCES = 12  # the table has all


def sentences(comparison: "pd.DataFrame", measured: Iterable[Quantity] = COMMON) -> list[str]:
    """Both values and their difference at the last common time, for the first component of `summary_quantities`."""
    last = final_rows(comparison)
    lines: list[str] = []
    for quantity in summary_quantities(comparison, measured):
        rows = last[last["quantity"] == quantity.value]
        if not len(rows):
            continue
        first = tables.select_rows(rows, component=rows["component"].iloc[0], model=rows["model"].iloc[0])
        lines += [_sentence(quantity.words, row) for row in first.to_dict("records")]
    omitted_count = len(lines) - MAX_SENTENCES
    if omitted_count <= 0:
        return lines
    remark = plural(
        "{count} further comparison: in comparison.csv.",
        "{count} further comparisons: in comparison.csv.",
        omitted_count,
    )
    return [*lines[:MAX_SENTENCES], remark]


def summary_quantities(comparison: "pd.DataFrame", measured: Iterable[Quantity]) -> list[Quantity]:
    """The quantities in sentences: the first, and those that neither follow from it (gains) nor list many shares."""
    compared_quantities = [quantity for quantity in measured if (comparison["quantity"] == quantity.value).any()]
    return [
        quantity
        for n, quantity in enumerate(compared_quantities)
        if not n or (not quantity.paired and quantity.per in ("", "component"))
    ]


def final_rows(comparison: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of the last common time of each line, of those with a value on both sides."""
    keys = ["quantity", "label", "against_label", "filter", "component", "model"]
    last = comparison.groupby(keys, sort=False).tail(1)
    return last[last["value"].notna() & last["against"].notna()]


def _sentence(words: str, row: dict[Any, Any]) -> str:
    symbol = str(row["component"] or row["model"])
    unit = tr(unit_of(row["unit"]))
    partner = f"{row['against_label']}" + (
        "" if row["against_filter"] == row["filter"] else f", {row['against_filter']}"
    )
    subject = tr("{quantity} of {symbol}", quantity=tr(words), symbol=symbol) if symbol else tr(words)
    change, exact = change_texts(row)
    if row["t_s"] == row["t_s"]:
        subject = tr("{what} at {t_s:g} s", what=subject, t_s=row["t_s"])
    return tr(
        "{label}, {filter}: {what} {value} against {against} of {other}: {change}.",
        label=row["label"],
        filter=row["filter"],
        what=subject,
        value=_value(row, "value", "exact", unit),
        against=_value(row, "against", "against_exact", unit),
        other=partner,
        change=tr("{value} (exact)", value=exact) if exact else change,
    )


def _value(row: dict[Any, Any], measured: str, exact: str, unit: str) -> str:
    """The exact value of a side where both have one, as their difference then is; else the measured one."""
    if row["exact"] == row["exact"] and row["against_exact"] == row["against_exact"]:
        return tr("{value} (exact)", value=f"{value_text(row[exact])} {unit}".rstrip())
    return f"{value_text(row[measured])} {unit}".rstrip()


def change_texts(row: dict[Any, Any]) -> tuple[str, str]:
    """The difference of a value, with its interval; and the exact difference where known beside a sample."""
    if row["percent"] != row["percent"]:
        text = f"{signed(row['difference'])} {tr(unit_of(row['unit']))}".rstrip()
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
    return f"{signed(value, '.3g')} %"


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
        tr("{count:,} of {total:,} differences of σ: {words}", count=count, total=len(kinds), words=tr(meaning))
        for meaning, count in counts.items()
        if count
    ]
