"""The tornado figure of a sensitivity."""

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.labels import Label
from radarsim.language.translate import join_names, shorten_names, term, tr
from radarsim.report import key_labels
from radarsim.report.drawing.model import PAGE_MM, Axis, Figure, Line, Mark, Panel, Reference, Style
from radarsim.report.quantities import Quantity

if TYPE_CHECKING:
    from radarsim.api.design.sensitivity import Sensitivity


Row = Mapping[Hashable, Any]  # of sensitivity.csv

MAX_BARS, MIN_BAR = 16, 0.01  # of a tornado; shortest visible bar, as a share of the longest
LOWERED = ", −10 %"  # after a key that is lowered


def key_effect(rows: Sequence[Row], path: str, leading: str, change: str) -> tuple[float, float]:
    """The largest change in this column that a key makes: of the leading component, and of any component."""
    key_rows = [row for row in rows if row["key"] == path]
    groups = [[row for row in key_rows if row["component"] == leading], key_rows]
    leading_effect, largest_effect = (max((abs(row[change]) for row in group), default=0.0) for group in groups)
    return leading_effect, largest_effect


def tornado(result: "Sensitivity") -> Figure:
    """Bars of the changes of the leading component by key: each quantity of each filter."""
    rows = [row for row in result.rows if row["component"] == result.leading]
    definitions = [
        definition for definition in result.of if any(math.isfinite(row[definition.changes[0]]) for row in rows)
    ]
    changed_keys = list(dict.fromkeys(row["key"] for row in rows))
    visible_keys = [key for key in changed_keys if _is_visible(key, rows, definitions)]
    keys = visible_keys[:MAX_BARS][::-1]
    small_keys = [key for key in changed_keys if key not in visible_keys]
    key_names = [key_tick_label(result.labels[key]) + LOWERED * (key in result.lowered) for key in keys]
    filter_names = list(dict.fromkeys(row["filter"] for row in rows))
    panels = []
    for n, definition in enumerate(definitions):
        ticks = tuple((float(j), text if n == 0 else "") for j, text in enumerate(key_names))
        y_axis = Axis("", limits=(-0.6, len(keys) - 0.4), ticks=ticks)
        marks: list[Mark] = [Reference(0.0, "x")]
        for i, filter_name in enumerate(filter_names):
            rows_by_key = {row["key"]: row for row in rows if row["filter"] == filter_name}
            marks += _bars(definition, keys, rows_by_key, i, len(filter_names))
        legend_entries = [
            (key_labels.escape_dollars(filter_name), Style(i, 0, width_pt=4.0, flat=True))
            for i, filter_name in enumerate(filter_names)
        ]
        styles = tuple(legend_entries) if n == len(definitions) - 1 else ()
        words = tr("change of {quantity}, {unit}", quantity=term(definition.words), unit=tr(definition.changed_unit))
        panels.append(Panel(Axis(words), y_axis, tuple(marks), keys=styles, direct=False, legend="right"))
    caption = _caption(result, rows, definitions, keys, small_keys)
    title = tr("Effect of +10 % of each key, {stem}", stem=result.stem)
    height = 24 + 6.5 * max(3, len(keys))
    return Figure("tornado", title, caption, tuple(panels), len(panels), PAGE_MM, height)


def _bars(
    definition: Quantity, keys: Sequence[str], rows_by_key: Mapping[str, Row], filter_index: int, filter_count: int
) -> list[Mark]:
    """The bars of a filter, one for each key that changes the quantity; and a thin line for a sampled interval."""
    change, *bounds = definition.changes
    marks: list[Mark] = []
    for j, key in enumerate(keys):
        if key not in rows_by_key or not math.isfinite(rows_by_key[key][change]):
            continue
        row = rows_by_key[key]
        bar_y = j - 0.7 * ((filter_index + 0.5) / filter_count - 0.5)
        x, y = np.array([0.0, row[change]]), np.array([bar_y, bar_y])
        name = f"{row['filter']}, {key}"
        bar_style = Style(filter_index, 0, width_pt=9.0 / filter_count, flat=True)
        marks.append(Line(x, y, "", bar_style, name=name))
        if not row["exact"]:
            ends = np.array([row[bound] for bound in bounds])
            marks.append(Line(ends, y, "", Style(filter_index, 0, width_pt=1.0, flat=True), name=f"{name}, 95 %"))
    return marks


def _caption(
    result: "Sensitivity",
    rows: Sequence[Row],
    definitions: Sequence[Quantity],
    keys: Sequence[str],
    small_keys: Sequence[str],
) -> str:
    """The caption: what is drawn, which keys are lowered, what the thin lines are, and which keys are too small."""
    subject = join_names([tr(definition.words) for definition in definitions])
    if result.leading:
        subject = tr("{quantity} of {symbol}", quantity=subject, symbol=result.of[0].place(result.leading, tr))
    caption = tr(
        "Change of {quantity} when each key grows by 10 %, largest first.",
        quantity=" ".join(filter(None, (subject, result.at))),
    )
    if set(keys) & set(result.lowered):
        caption += " " + tr("Keys with −10 % cannot grow and fall instead.")
    if not all(row["exact"] for row in rows):
        caption += " " + tr("Thin lines: 95 % intervals.")
    if small_keys:
        names = [key_labels.without_markup(result.labels[key].text) for key in small_keys]
        caption += " " + tr("Too small to be drawn: {keys}.", keys=shorten_names(names))
    return caption


def _is_visible(key: str, rows: Sequence[Row], definitions: Sequence[Quantity]) -> bool:
    """Whether the bar of a key is long enough to be seen beside the longest, for any quantity."""
    for change in (definition.changes[0] for definition in definitions):
        sizes = [(abs(row[change]), row["key"]) for row in rows if math.isfinite(row[change])]
        longest = max((size for size, _ in sizes), default=0.0)
        if any(size >= MIN_BAR * longest and row_key == key for size, row_key in sizes):
            return True
    return False


def key_tick_label(name: Label) -> str:
    """Label of a key beside its bars: name, symbol and unit."""
    words = key_labels.escape_dollars(name.text)
    return key_labels.label_with_unit(" ".join(filter(None, (words, key_labels.math_symbol(name.symbol)))), name.unit)
