"""Figures of a comparison: each quantity of all sides on common axes, and beside it the differences."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from radarsim.language import term, tr
from radarsim.report import seen
from radarsim.report.compare.sides import SERIES, Series, Side
from radarsim.report.compare.table import filters_of
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Mark, Panel, Reference, Style
from radarsim.report.panels import MOST, left_out, letter, line, literal, time_axis, with_unit

if TYPE_CHECKING:
    import pandas as pd

HEIGHT_MM = 70.0


def figures(sides: Sequence[Side], made: "pd.DataFrame") -> dict[str, Figure]:
    """A figure for each quantity and component that two sides share: values on the left, differences on the right.

    made is table.compared's. Of more than eight sides the first eight are drawn, and the caption says so.
    """
    drawn = {}
    for (quantity, component, model), rows in made.groupby(["quantity", "component", "model"], sort=False):
        series = next(one for one in SERIES if one.value == quantity)
        component, model = str(component), str(model)
        if rows["t_s"].nunique() < 2:
            continue
        parts = [series.value.removesuffix("_percent"), component, f"model{model}" if model else ""]
        name = "_".join(filter(None, parts))
        drawn[name] = _figure(name, series, sides, rows, component, model)
    return drawn


def _figure(
    name: str, series: Series, sides: Sequence[Side], rows: "pd.DataFrame", component: str, model: str
) -> Figure:
    taking_part = {*rows["label"], *rows["against_label"]}
    every = [side for side in sides if side.label in taking_part]
    some = every[:MOST]
    filters = list(dict.fromkeys(f for side in some for f in filters_of(side)))
    unit = rows["unit"].iloc[0]
    symbol = letter(component) if component else model
    what = f"{tr(series.words)} {symbol}".strip()
    if series.value in ("sigma", "gain_percent"):
        words = {"sigma": term("$\\sigma$ of {symbol}"), "gain_percent": term("gain in $\\sigma$ of {symbol}")}
        what = tr(words[series.value], symbol=symbol)
    values = [mark for n, side in enumerate(some) for mark in _values(series, side, n, filters, component, model)]
    apart = _apart(series, some, rows, filters)
    keys = [(literal(side.label), Style(n, 0)) for n, side in enumerate(some)]
    keys += [(literal(f), Style(0, n, n)) for n, f in enumerate(filters)] if len(filters) > 1 else []
    low = None if series.value == "gain_percent" else 0.0
    y = Axis(with_unit(what, unit), limits=(low, None))
    of = term("change") if series.ratio else term("difference")
    against = rows["against_label"].iloc[0] if rows["against_label"].nunique() == 1 else tr("the first")
    difference = Axis(with_unit(tr("{of} against {name}", of=of, name=literal(against)), "%" if series.ratio else unit))
    panels = (
        Panel(time_axis(), y, tuple(values), direct=False, legend="none"),
        Panel(time_axis(), difference, (Reference(0), *apart), keys=tuple(keys), legend="right"),
    )
    caption = (
        tr(
            "Left: {words} of {value} on common axes. Right: the {of} against {against} at common times. "
            "Bands: 95 % intervals.",
            words=series.words,
            value=", ".join(side.label for side in some),
            of=of,
            against=against,
        )
    ) + left_out([side.label for side in every], [side.label for side in some])
    figure = Figure(name, tr("{what} side by side", what=what), caption, panels, 2, PAGE_MM, HEIGHT_MM)
    told = seen.at_the_end(replace(figure, panels=panels[1:]))
    return seen.crossed(seen.begun(figure, tr("Right: {told}", told=told[0].lower() + told[1:]) if told else ""))


def _values(series: Series, side: Side, n: int, filters: Sequence[str], component: str, model: str) -> list[Mark]:
    """A line for each filter of a side."""
    table, marks = side.tables.get(series.table), list[Mark]()
    if table is None:
        return marks
    for i, f in enumerate(filters):
        own = table[table["filter"] == f]
        own = own[own["component"] == component] if component else own
        own = own[own["model"] == model] if "model" in own and model else own
        if len(own):
            columns = ["t_s", series.value, series.lo, series.hi, *([series.exact] if series.exact else [])]
            marks.append(line(own, columns, "", Style(n, i, i), f"{literal(side.label)}, {literal(f)}"))
    return marks


def _apart(series: Series, sides: Sequence[Side], rows: "pd.DataFrame", filters: Sequence[str]) -> list[Mark]:
    """A line for each filter of each side that is compared with another."""
    value, exact = ("percent", "exact_percent") if series.ratio else ("difference", "")
    numbers, marks = {side.label: n for n, side in enumerate(sides)}, list[Mark]()
    several = rows["against_label"].nunique() > 1
    for key, own in rows.groupby(["label", "against_label", "filter"], sort=False):
        label, against, f = map(str, key)
        if label not in numbers or against not in numbers:
            continue
        name = f"{literal(label)}, {literal(f)}" + (f" against {literal(against)}" if several else "")
        i = filters.index(f)
        columns = ["t_s", value, f"{value}_lo", f"{value}_hi", *([exact] if exact else [])]
        marks.append(line(own, columns, "", Style(numbers[label], i, i), name))
    return marks
