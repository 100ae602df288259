"""Where the lines of a figure are named: at their ends where names fit, else once a figure, below the panels.

A legend never lies on curves. Panels that name different things alike keep legends of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from radarsim.language import tr
from radarsim.report.chart_text import spoken
from radarsim.report.drawing import Figure, Line, Panel, Style

LONGEST_AT_END = 28  # letters of a name that may stand at a line's end
NAMES_SHARE = 0.3  # of a panel's cell that names at the ends of its lines may take
AT_ENDS_MM = 4.4  # of a panel's height for each name at a line's end
ROW_MM, LETTER_MM, SAMPLE_MM = 3.5, 1.45, 12.0  # of a legend: a row, a letter, the sample of a line with its gaps
LEAST_PANEL_MM = 55.0  # wide, of a figure whose width is chosen
WIDTHS_MM = (85, 120, 175)  # of a journal's page: one column, one and a half, two
MOST_BESIDE = 16  # names in one column beside a panel

Keys = Mapping[str, Style | None]  # words and the look that they explain; None for the crosses of exact values


@dataclass(frozen=True)
class Legend:
    """Names and the looks that they explain, with a title."""

    keys: Keys
    title: str = ""

    def columns(self, width_mm: float) -> int:
        """How many columns of names fit into a width."""
        longest = max(len(spoken(words)) for words in self.keys)
        return max(1, min(len(self.keys), int(width_mm / (LETTER_MM * longest + SAMPLE_MM))))

    def height_mm(self, width_mm: float) -> float:
        """How tall it is at a width."""
        rows = -(-len(self.keys) // self.columns(width_mm)) + bool(self.title)
        return ROW_MM * rows + 2.0


@dataclass(frozen=True)
class Named:
    """The panels that have marks; which of them name lines at their ends; the legends of panels, and the figure's."""

    panels: tuple[Panel, ...]
    at_ends: tuple[bool, ...]
    own: tuple[Legend | None, ...]
    common: Legend | None
    beside: bool


def named(figure: Figure) -> Named:
    """How the lines of a figure are named."""
    panels = tuple(panel for panel in figure.panels if panel.marks)
    cell = figure.width_mm / min(figure.columns, max(1, len(panels)))
    narrow = any(LETTER_MM * _longest(panel) > NAMES_SHARE * cell for panel in panels if panel.direct)
    at_ends = tuple(not narrow and _fits(panel, figure.panel_height_mm) for panel in panels)
    crossed: set[str] = set()
    keys = [_keys(panel, ends, crossed) for panel, ends in zip(panels, at_ends, strict=True)]
    apart = [dict(panel.keys) for panel in figure.panels if not panel.marks]
    titles = {panel.key_title for panel in figure.panels if panel.key_title}
    merged: dict[str, Style | None] = {}
    clash = len(titles) > 1
    for one in (*keys, *apart):
        clash |= any(not _alike(merged.get(words, look), look) for words, look in one.items())
        clash |= any(
            _alike(look, other) and words not in one for words, other in merged.items() for look in one.values()
        )
        merged |= one
    none: tuple[Legend | None, ...] = (None,) * len(panels)
    if clash:
        own = [Legend(one, panel.key_title) if one else None for one, panel in zip(keys, panels, strict=True)]
        return Named(panels, at_ends, tuple(own), None, False)
    beside = len(panels) == 1 and panels[0].legend == "right" and len(merged) <= MOST_BESIDE
    return Named(panels, at_ends, none, Legend(merged, next(iter(titles), "")) if merged else None, beside)


def _alike(one: Style | None, other: Style | None) -> bool:
    if one is None or other is None:
        return one is other
    return replace(one, width_pt=0, size_pt=0) == replace(other, width_pt=0, size_pt=0)


def lines(panel: Panel) -> list[Line]:
    """The lines of a panel that have a name and a point."""
    return [m for m in panel.marks if isinstance(m, Line) and m.label and np.isfinite(m.y).any()]


def _longest(panel: Panel) -> int:
    return max((len(spoken(line.label)) for line in lines(panel)), default=0)


def _fits(panel: Panel, height_mm: float) -> bool:
    """Whether a panel's lines are named at their ends."""
    own = lines(panel)
    short = all(len(m.label) <= LONGEST_AT_END for m in own)
    return panel.direct and short and all(m.style.dash is not None for m in own) and len(own) <= height_mm / AT_ENDS_MM


def _keys(panel: Panel, at_ends: bool, crossed: set[str]) -> Keys:
    """What of a panel a legend explains; exact crosses of each kind once a figure."""
    found: dict[str, Style | None] = {}
    if panel.legend != "none":
        found |= {m.label: m.style for m in lines(panel) if not at_ends}
        found |= dict(panel.keys)
    exact = any(isinstance(m, Line) and m.exact is not None and np.isfinite(m.exact).any() for m in panel.marks)
    called = panel.crosses or tr("exact")
    if exact and called not in crossed:
        crossed.add(called)
        found[called] = None
    return found


def at_width(figure: Figure, width_mm: float | None) -> Figure:
    """The figure at a width: as many columns as leave a panel its room. Without a width as it is."""
    if width_mm is None or width_mm == figure.width_mm:
        return figure
    return replace(figure, width_mm=width_mm, columns=max(1, min(figure.columns, int(width_mm // LEAST_PANEL_MM))))
