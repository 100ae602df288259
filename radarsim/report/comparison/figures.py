"""Figures of a comparison: each quantity of all sides on common axes, and the differences beside it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from radarsim.language.translate import term, tr
from radarsim.report import caption_remarks
from radarsim.report.case_selection import MAX_CASES, left_out_remark
from radarsim.report.comparison.pairs import Side
from radarsim.report.comparison.table import comparison_rows, filters_of, shared_quantities
from radarsim.report.drawing.model import PAGE_MM, Axis, Figure, Mark, Panel, Reference, Style
from radarsim.report.figure_lines import line_from_rows
from radarsim.report.key_labels import component_symbol, escape_dollars, label_with_unit
from radarsim.report.panel_layout import time_axis
from radarsim.report.quantities import Quantity

if TYPE_CHECKING:
    import pandas as pd


HEIGHT_MM = 70.0


def figures(sides: Sequence[Side], comparison: "pd.DataFrame") -> dict[str, Figure]:
    """A figure for each quantity and component that two sides share: values on the left, differences on the right.

    made is from table.compared. Of more than eight sides the first eight are drawn, and the caption says so."""
    figures_by_name, quantities = {}, {quantity.value: quantity for quantity in shared_quantities(sides)}
    for (value_column, component, model), rows in comparison.groupby(["quantity", "component", "model"], sort=False):
        quantity = quantities[str(value_column)]
        component, model = str(component), str(model)
        if rows["t_s"].nunique() < 2:
            continue
        parts = [quantity.value.removesuffix("_percent"), component, f"model{model}" if model else ""]
        name = "_".join(filter(None, parts))
        figures_by_name[name] = _figure(name, quantity, sides, rows, component, model)
    return figures_by_name


def _figure(
    name: str, quantity: Quantity, sides: Sequence[Side], rows: "pd.DataFrame", component: str, model: str
) -> Figure:
    labels = {*rows["label"], *rows["against_label"]}
    compared_sides = [side for side in sides if side.label in labels]
    visible = compared_sides[:MAX_CASES]
    filters = list(dict.fromkeys(f for side in visible for f in filters_of(side)))
    unit = rows["unit"].iloc[0]
    symbol = component_symbol(component) if component else model
    axis_text = tr(quantity.axis, symbol=symbol) if quantity.axis else f"{tr(quantity.words)} {symbol}".strip()
    values = [mark for n, side in enumerate(visible) for mark in _values(quantity, side, n, filters, component, model)]
    changes = _change_lines(quantity, visible, rows, filters)
    keys = [(escape_dollars(side.label), Style(n, 0)) for n, side in enumerate(visible)]
    keys += [(escape_dollars(f), Style(0, n, n)) for n, f in enumerate(filters)] if len(filters) > 1 else []
    low = None if quantity.kind == "signed" else 0.0
    y = Axis(label_with_unit(axis_text, unit), limits=(low, None))
    change_name = term("change") if quantity.kind == "size" else term("difference")
    against = rows["against_label"].iloc[0] if rows["against_label"].nunique() == 1 else tr("the first")
    difference = Axis(
        label_with_unit(
            tr("{of} relative to {name}", of=change_name, name=escape_dollars(against)),
            "%" if quantity.kind == "size" else unit,
        )
    )
    panels = (
        Panel(time_axis(), y, tuple(values), direct=False, legend="none"),
        Panel(time_axis(), difference, (Reference(0), *changes), keys=tuple(keys), legend="right"),
    )
    caption = (
        tr(
            "Left: {words} of {value} on common axes. Right: the {of} relative to {against} at common times.",
            words=term(quantity.words),
            value=", ".join(side.label for side in visible),
            of=change_name,
            against=against,
        )
    ) + left_out_remark([side.label for side in compared_sides], [side.label for side in visible])
    figure = Figure(name, tr("{what} side by side", what=axis_text), caption, panels, 2, PAGE_MM, HEIGHT_MM)
    return caption_remarks.with_meaning_of_crosses(figure)


def _values(quantity: Quantity, side: Side, n: int, filters: Sequence[str], component: str, model: str) -> list[Mark]:
    """A line for each filter of a side."""
    table, marks = side.tables.get(quantity.table), list[Mark]()
    if table is None:
        return marks
    rows = comparison_rows(table, quantity)
    for i, f in enumerate(filters):
        line_rows = rows[rows["filter"] == f]
        line_rows = line_rows[line_rows["component"] == component] if component else line_rows
        line_rows = line_rows[line_rows["model"] == model] if "model" in line_rows and model else line_rows
        if len(line_rows):
            columns = ("t_s", "value", "lo", "hi", "exact")
            marks.append(
                line_from_rows(
                    line_rows, columns, "", Style(n, i, i), f"{escape_dollars(side.label)}, {escape_dollars(f)}"
                )
            )
    return marks


def _change_lines(
    quantity: Quantity, sides: Sequence[Side], rows: "pd.DataFrame", filters: Sequence[str]
) -> list[Mark]:
    """A line for each filter of each side that is compared with another."""
    value, exact = ("percent", "exact_percent") if quantity.kind == "size" else ("difference", "")
    numbers, marks = {side.label: n for n, side in enumerate(sides)}, list[Mark]()
    has_several_partners = rows["against_label"].nunique() > 1
    for key, line_rows in rows.groupby(["label", "against_label", "filter"], sort=False):
        label, against, f = map(str, key)
        if label not in numbers or against not in numbers:
            continue
        name = f"{escape_dollars(label)}, {escape_dollars(f)}"
        if has_several_partners:
            name = tr("{name} versus {other}", name=name, other=escape_dollars(against))
        i = filters.index(f)
        columns = ["t_s", value, f"{value}_lo", f"{value}_hi", *([exact] if exact else [])]
        marks.append(line_from_rows(line_rows, columns, "", Style(numbers[label], i, i), name))
    return marks
