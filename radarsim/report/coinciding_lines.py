"""Curves that coincide in all panels are drawn once, with both names."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radarsim.report.drawing.model import Figure, Line, Mark
from radarsim.report.panel_layout import holding

SAME_FRACTION = 0.01  # of a value
HALF_LINE_WIDTH = 0.004  # of a panel's height: half the width of a line


def join_coinciding_lines(figure: Figure) -> Figure:
    """The figure with lines that coincide in all its panels drawn once, their names joined by "=".

    Lines that have a name of their own, in a legend or at their ends; not those that dash and shade distinguish."""
    named_lines = [
        {name: mark for mark in panel.marks if (name := _curve_name(mark, figure))} for panel in figure.panels
    ]
    groups: dict[str, list[str]] = {}
    for name in dict.fromkeys(name for lines in named_lines for name in lines):
        first = next((first for first in groups if _coincide(first, name, named_lines, figure)), name)
        groups.setdefault(first, []).append(name)
    duplicates = {name for names in groups.values() for name in names[1:]}
    if not duplicates:
        return figure
    joined_names = {first: _joined_name(names) for first, names in groups.items()}

    def rename(mark: Mark) -> Mark:
        name = _curve_name(mark, figure)
        if not (name and isinstance(mark, Line)):
            return mark
        return replace(mark, label=mark.label and joined_names[name], name=mark.name and joined_names[name])

    panels = tuple(
        replace(
            panel,
            marks=tuple(rename(mark) for mark in panel.marks if _curve_name(mark, figure) not in duplicates),
            keys=tuple((joined_names.get(key, key), style) for key, style in panel.keys if key not in duplicates),
        )
        for panel in figure.panels
    )
    return replace(figure, panels=panels, has_joined_names=True)


def _joined_name(names: Sequence[str]) -> str:
    """Names of one curve: "nearest = PDA"; a swept value that they share once, at the end."""
    heads, tails = zip(*((head, tail) for head, _, tail in (name.partition(", ") for name in names)), strict=True)
    if len(set(tails)) == 1 and "=" in tails[0]:
        return f"{' = '.join(heads)}, {tails[0]}"
    return " = ".join(names)


def _curve_name(mark: Mark, figure: Figure) -> str:
    """The name of a curve that has one of its own, at its end or in a legend; empty for any other mark."""
    if not isinstance(mark, Line) or mark.style.dash is None or len(mark.x) < 2:
        return ""
    if mark.label:
        return mark.label if mark.name in ("", mark.label) else ""
    return mark.name if any(mark.name == key for panel in figure.panels for key, _ in panel.keys) else ""


def _coincide(name: str, other_name: str, named_lines: Sequence[Mapping[str, Mark]], figure: Figure) -> bool:
    """Whether two curves cannot be distinguished in any panel where they are drawn."""
    is_drawn = False
    for marks, panel in zip(named_lines, figure.panels, strict=True):
        line, other_line = marks.get(name), marks.get(other_name)
        if line is None and other_line is None:
            continue
        if not (isinstance(line, Line) and isinstance(other_line, Line)) or not np.array_equal(line.x, other_line.x):
            return False
        is_log = panel.y.scale == "log"
        visible = [mark for mark in marks.values() if isinstance(mark, Line) and _has_points(mark, is_log)]
        if not visible:
            continue
        is_drawn |= _has_points(line, is_log)
        low, high = holding(visible, panel.y)
        height = np.log10(high) - np.log10(low) if is_log else high - low
        pairs = (
            (line.y, other_line.y),
            (line.lo, other_line.lo),
            (line.hi, other_line.hi),
            (line.exact, other_line.exact),
        )
        if not all(_values_coincide(*pair, height, is_log) for pair in pairs):
            return False
    return is_drawn


def _has_points(line: Line, is_log: bool) -> bool:
    return bool((line.y > 0 if is_log else np.isfinite(line.y)).any())


def _values_coincide(values: np.ndarray | None, other_values: np.ndarray | None, height: float, is_log: bool) -> bool:
    """Whether two columns of a curve are nearer to each other than half a line's width, and than a per cent.

    height: of the panel, in units of the axis, or of its logarithm"""
    if values is None or other_values is None:
        return values is other_values
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (np.log10(column) if is_log else np.asarray(column, float) for column in (values, other_values))
        tolerance = (
            np.log10(1 + SAME_FRACTION)
            if is_log
            else SAME_FRACTION * np.abs(first) + SAME_FRACTION * HALF_LINE_WIDTH * height
        )
        is_near = np.abs(first - second) <= np.minimum(HALF_LINE_WIDTH * height, tolerance)
    return bool((is_near | (first == second) | (np.isnan(first) & np.isnan(second))).all())
