"""What a comparison says in sentences."""

from typing import TYPE_CHECKING, Any

from radarsim.language import plural, tr
from radarsim.report import tables as common
from radarsim.report.compare.sides import SERIES
from radarsim.report.compare.table import MEANING
from radarsim.report.text import UNITS, interval, significant_digits

if TYPE_CHECKING:
    import pandas as pd

MOST = 12  # sentences; the table has all


def sentences(made: "pd.DataFrame") -> list[str]:
    """At the last common time, of the first component of each quantity: both values, and by how much they differ."""
    last = at_the_end(made)
    lines = []
    for quantity, rows in last.groupby("quantity", sort=False):
        series = next(one for one in SERIES if one.value == quantity)
        first = common.where(rows, component=rows["component"].iloc[0], model=rows["model"].iloc[0])
        lines += [_sentence(series.words, row) for row in first.to_dict("records")]
        if series.ratio:
            break  # gains and shares of the same filters stand in the table
    left = len(lines) - MOST
    return lines[:MOST] + (
        [
            plural(
                "{count} further comparison: in comparison.csv.",
                "{count} further comparisons: in comparison.csv.",
                left,
            )
        ]
        if left > 0
        else []
    )


def at_the_end(made: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of the last common time of each line."""
    keys = ["quantity", "label", "against_label", "filter", "component", "model"]
    return made.groupby(keys, sort=False).tail(1)


def _sentence(words: str, row: dict[Any, Any]) -> str:
    of = str(row["component"] or row["model"])
    unit = tr(UNITS.get(row["unit"], row["unit"]))
    other = f"{row['against_label']}" + ("" if row["against_filter"] == row["filter"] else f", {row['against_filter']}")
    return tr(
        "{label}, {filter}: {what} at {t_s:g} s {value} against {against} of {other}: {change}.",
        label=row["label"],
        filter=row["filter"],
        what=tr("{quantity} of {symbol}", quantity=tr(words), symbol=of) if of else tr(words),
        t_s=row["t_s"],
        value=f"{value(row['value'])} {unit}".rstrip(),
        against=f"{value(row['against'])} {unit}".rstrip(),
        other=other,
        change=change(row),
    )


def change(row: dict[Any, Any]) -> str:
    """By how much a value differs, with its interval, and the exact change where it is known."""
    if row["percent"] != row["percent"]:
        text = f"{signed(row['difference'])} {tr(UNITS.get(row['unit'], row['unit']))}".rstrip()
        return f"{text} {interval(signed(row['difference_lo']), signed(row['difference_hi']))}"
    exact = row["exact_percent"]
    known = tr(", exactly {value}", value=percent(exact)) if exact == exact else ""
    return f"{percent(row['percent'])} {interval(percent(row['percent_lo']), percent(row['percent_hi']))}{known}"


def percent(value: float) -> str:
    """A change in per cent with its sign; from four times on as a multiple."""
    if value >= 300:
        return tr("{factor} times", factor=significant_digits(1 + value / 100, ".3g"))
    return f"{signed(value, '.3g')} %"


def signed(value: float, form: str = ".3g") -> str:
    """A number with its sign."""
    text = significant_digits(value, form)
    return text if text.startswith("−") or value == 0 else f"+{text}"


def value(number: float) -> str:
    """A number at four digits."""
    return significant_digits(number)


def pairings(made: "pd.DataFrame") -> list[str]:
    """How the differences are paired, a line each kind."""
    kinds = made.loc[made["quantity"] == "sigma", "pairing"].tolist()
    counts = {words: kinds.count(kind) for kind, words in MEANING.items()}
    return [
        tr("{count:,} of {total:,} differences of σ: {words}", count=count, total=len(kinds), words=tr(words))
        for words, count in counts.items()
        if count
    ]
