"""Where the names of lines stand: at their ends, in a panel's legend, or in a common one.

Lines are named at their ends where the names fit, otherwise in one legend of the figure, which never covers curves.
Panels in which the same style means different lines have a legend each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.language.translate import tr
from radarsim.report.drawing.line_points import rough_points
from radarsim.report.drawing.model import Figure, Line, Panel, Style
from radarsim.report.drawing.style import LETTER_MM, ROUGH_KEY, ROW_MM, SAMPLE_MM, wrap
from radarsim.report.math_text import plain_text
from radarsim.report.wording import with_unbroken_units

MAX_END_NAME_LETTERS = 28  # of a name at a line's end
MAX_END_NAMES_SHARE = 0.3  # of a panel's cell, for names at the ends of its lines
END_NAME_MM = 4.4  # of a panel's height for each name at a line's end
MIN_PANEL_MM = 55.0  # width, in a figure of a chosen width
MAX_FIGURE_MM, MIN_PANEL_HEIGHT_MM = 245.0, 40.0  # of panels together, under the height of A4; of each
MAX_NAMES_BESIDE = 16  # in one column beside a panel

LegendKeys = Mapping[str, Style | None]  # names and the styles that they explain; None for the crosses of exact values


@dataclass(frozen=True)
class Legend:
    """Names and styles of a legend, with a title."""

    keys: LegendKeys
    title: str = ""

    def columns(self, width_mm: float) -> int:
        """Number of columns of names that fit into a width."""
        longest = max((len(plain_text(name)) for name in self.keys), default=0)
        return max(1, min(len(self.keys), int(width_mm / (LETTER_MM * longest + SAMPLE_MM))))

    def names(self, width_mm: float) -> list[str]:
        """The names, those that are longer than a width broken into rows."""
        letters = (width_mm - SAMPLE_MM) / LETTER_MM
        return [wrap(with_unbroken_units(name), letters, " ") for name in self.keys]

    def height_mm(self, width_mm: float) -> float:
        """Height of the legend at a width."""
        lines = sum(name.count("\n") + 1 for name in self.names(width_mm))
        return ROW_MM * (-(-lines // self.columns(width_mm)) + bool(self.title)) + 2.0


@dataclass(frozen=True)
class LegendPlan:
    """How the lines of a figure are named.

    panels: those with marks; at_ends: which of them name lines at their ends; panel_legends: a legend for each panel,
    or None; common: the figure's legend, or None; stands_beside: the figure's
    legend stands beside its only panel."""

    panels: tuple[Panel, ...]
    at_ends: tuple[bool, ...]
    panel_legends: tuple[Legend | None, ...]
    common: Legend | None
    stands_beside: bool


def plan_legends(figure: Figure) -> LegendPlan:
    """Decide for a figure which lines are named at their ends, and which legends explain the others."""
    panels = tuple(panel for panel in figure.panels if panel.marks)
    cell_mm = figure.width_mm / min(figure.columns, max(1, len(panels)))
    too_wide = any(LETTER_MM * longest_name(panel) > MAX_END_NAMES_SHARE * cell_mm for panel in panels if panel.direct)
    at_ends = tuple(not too_wide and _names_fit(panel, figure.panel_height_mm) for panel in panels)
    explained_crosses: set[str] = set()
    keys = [_legend_keys(panel, ends, explained_crosses) for panel, ends in zip(panels, at_ends, strict=True)]
    titles = [_key_title(panel, ends) for panel, ends in zip(panels, at_ends, strict=True)]
    key_panels = [panel for panel in figure.panels if not panel.marks]
    all_titles = {title for title in titles if title} | {panel.key_title for panel in key_panels if panel.key_title}
    merged = _merge_keys([*keys, *(dict(panel.keys) for panel in key_panels)])
    if merged is None or len(all_titles) > 1:
        legends = [Legend(own_keys, title) if own_keys else None for own_keys, title in zip(keys, titles, strict=True)]
        return LegendPlan(panels, at_ends, tuple(legends), None, False)
    stands_beside = len(panels) == 1 and panels[0].legend == "right" and len(merged) <= MAX_NAMES_BESIDE
    ranks = _end_ranks(panels)

    def place(key: tuple[str, Style | None]) -> tuple[bool, bool, float]:
        """Lines from the highest to the lowest; rough points and crosses are of all of them."""
        name, style = key
        return style is None, style == ROUGH_KEY, ranks.get(name, float(len(ranks)))

    ordered = dict(sorted(merged.items(), key=place))
    common = Legend(ordered, next(iter(all_titles), "")) if merged or all_titles else None
    return LegendPlan(panels, at_ends, (None,) * len(panels), common, stands_beside)


def _end_ranks(panels: Sequence[Panel]) -> dict[str, float]:
    """The mean place of each named line among the lines of its panels, from the highest at its end to the lowest.

    Empty for points, and for lines that a panel draws for each value of a key."""
    ranks: dict[str, list[int]] = {}
    for panel in panels:
        lines = named_lines(panel)
        if any(isinstance(line.style.colour, float) or line.style.dash is None for line in lines):
            return {}
        ends = {line.label: float(line.y[np.isfinite(line.y)][-1]) for line in lines}
        for rank, name in enumerate(sorted(ends, key=lambda name: -ends[name])):
            ranks.setdefault(name, []).append(rank)
    return {name: float(np.mean(places)) for name, places in ranks.items()}


def _merge_keys(panel_keys: Sequence[LegendKeys]) -> LegendKeys | None:
    """The keys of all panels in one legend; None where a name has two styles, or a style two names."""
    merged: dict[str, Style | None] = {}
    for keys in panel_keys:
        two_styles = any(not _look_alike(merged.get(name, style), style) for name, style in keys.items())
        two_names = any(
            _look_alike(style, merged_style) and merged_name not in keys
            for merged_name, merged_style in merged.items()
            for style in keys.values()
        )
        if two_styles or two_names:
            return None
        merged |= keys
    return merged


def _key_title(panel: Panel, at_ends: bool) -> str:
    """The title of a panel's legend."""
    if panel.key_title or not panel.line_title:
        return panel.key_title
    return tr("at the lines: {key}", key=panel.line_title) if at_ends else panel.line_title


def _look_alike(a: Style | None, b: Style | None) -> bool:
    """Whether two styles differ at most in size."""
    if a is None or b is None:
        return a is b
    return replace(a, width_pt=0, size_pt=0) == replace(b, width_pt=0, size_pt=0)


def named_lines(panel: Panel) -> list[Line]:
    """The lines of a panel that have a label and a point."""
    return [m for m in panel.marks if isinstance(m, Line) and m.label and np.isfinite(m.y).any()]


def longest_name(panel: Panel) -> int:
    """Letters of the longest row of the names of a panel's lines."""
    rows = (plain_text(row) for line in named_lines(panel) for row in line.label.split("\n"))
    return max(map(len, rows), default=0)


def name_rows(panel: Panel) -> int:
    """Rows of the names of a panel's lines, one above the other."""
    return sum(line.label.count("\n") + 1 for line in named_lines(panel))


def _names_fit(panel: Panel, height_mm: float) -> bool:
    """Whether the lines of a panel can be named at their ends."""
    lines = named_lines(panel)
    is_short = longest_name(panel) <= MAX_END_NAME_LETTERS
    connected = all(line.style.dash is not None for line in lines)
    return panel.direct and is_short and connected and name_rows(panel) <= height_mm / END_NAME_MM


def _legend_keys(panel: Panel, at_ends: bool, explained_crosses: set[str]) -> LegendKeys:
    """The styles of a panel that a legend explains; crosses of exact values once for each name in a figure."""
    keys: dict[str, Style | None] = {}
    if panel.legend != "none":
        keys |= {line.label: line.style for line in named_lines(panel) if not at_ends}
        keys |= dict(panel.keys)
    if any(isinstance(mark, Line) and rough_points(mark).any() for mark in panel.marks):
        keys[tr("rough")] = ROUGH_KEY
    has_exact = any(isinstance(m, Line) and m.exact is not None and np.isfinite(m.exact).any() for m in panel.marks)
    name = panel.crosses or tr("exact")
    if has_exact and name not in explained_crosses:
        explained_crosses.add(name)
        keys[name] = None
    return keys


def at_width(figure: Figure, width_mm: float | None) -> Figure:
    """The figure at a width, with as many columns as leave enough width for a panel, and no taller than a page; without
    a width, at its own."""
    is_own = width_mm is None or width_mm == figure.width_mm
    width_mm = figure.width_mm if width_mm is None else width_mm
    columns = figure.columns if is_own else max(1, min(figure.columns, int(width_mm // MIN_PANEL_MM)))
    rows = -(-sum(bool(panel.marks) for panel in figure.panels) // columns)
    height = min(figure.panel_height_mm, max(MIN_PANEL_HEIGHT_MM, MAX_FIGURE_MM / max(rows, 1)))
    return replace(figure, width_mm=width_mm, columns=columns, panel_height_mm=height)
