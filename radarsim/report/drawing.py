"""Figures as data: panels of marks. Independent of how they are drawn (report/figures.py)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

COLUMN_MM = 85.0  # one column of a journal page
PAGE_MM = 175.0  # two columns
GREY = -1  # the colour of marks that are not curves: guides, crowds of points


@dataclass(frozen=True)
class Axis:
    """Label with unit, "linear" or "log", limits (either end None: fitted to the data), ticks where not automatic."""

    label: str
    scale: str = "linear"
    limits: tuple[float | None, float | None] = (None, None)
    ticks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Style:
    """How a mark is distinguished, in grey too: each number picks from a list of its own.

    colour: an int picks a distinct colour, GREY none of these, a float from 0 to 1 a shade of an ordered scale. dash
    and marker: ints, None for no line or no marker. flat: a line ends where its data end, like a bar, however wide."""

    colour: int | float = 0
    dash: int | None = 0
    marker: int | None = None
    width_pt: float = 1.1
    size_pt: float = 3.2
    flat: bool = False


@dataclass(frozen=True)
class Line:
    """A series y (n,) over x (n,), with its 95 % band lo … hi and its exact values (small crosses) where known. The
    label is written at the line's end where labels fit, else in a legend. dash None leaves markers alone (scatter),
    with whiskers for lo … hi. name identifies the line where the label leaves that to keys or to another panel."""

    x: np.ndarray
    y: np.ndarray
    label: str = ""
    style: Style = field(default_factory=Style)
    lo: np.ndarray | None = None
    hi: np.ndarray | None = None
    exact: np.ndarray | None = None
    name: str = ""


@dataclass(frozen=True)
class Reference:
    """A thin line across the panel at a value of x or y ("across" says which), with words beside it."""

    value: float
    across: str = "y"
    label: str = ""


@dataclass(frozen=True)
class Bars:
    """Bars of values (n,) with whiskers lo … hi, one for each name."""

    names: tuple[str, ...]
    values: np.ndarray
    lo: np.ndarray | None = None
    hi: np.ndarray | None = None
    style: Style = field(default_factory=Style)


@dataclass(frozen=True)
class Heat:
    """A map of values (len(y), len(x)) over the cells' centres, with its colour bar's label. Values are written in if
    few."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    label: str


@dataclass(frozen=True)
class Note:
    """Words near a point of the data: above or below it ("n", "s"), to its right or left ("e", "w").

    "on": upon it, which interrupts its line. "e" alone: beside it, and be it outside the panel. "top": along the
    panel's top, whatever y."""

    x: float
    y: float
    text: str
    place: str = "ne"


Mark = Line | Reference | Bars | Heat | Note
MARKED = ("label", "name", "text")  # words of marks


@dataclass(frozen=True)
class Panel:
    """One pair of axes. keys explain styles (not single lines) in a small legend: (words, style), under key_title.

    direct: lines are named at their ends where the names fit; else always in the figure's legend, below the panels;
    "right": beside a single panel; "none": they are named in another panel. line_title: what these names are. A remark
    is above the panel, at its right.
    A panel without marks adds its keys to the legend. crosses: the name of the exact values' crosses; empty: exact.
    equal: x and y have one scale, as on a map. height_mm: other than the figure's, in a figure of one column."""

    x: Axis
    y: Axis
    marks: tuple[Mark, ...]
    title: str = ""
    keys: tuple[tuple[str, Style], ...] = ()
    key_title: str = ""
    line_title: str = ""
    direct: bool = True
    legend: str = "best"
    remark: str = ""
    crosses: str = ""
    equal: bool = False
    height_mm: float | None = None


@dataclass(frozen=True)
class Figure:
    """A figure of one or more panels in rows of `columns`; the caption describes content and marks.

    headline is the run's answer in a sentence of plain text, above its first figure."""

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1
    width_mm: float = COLUMN_MM
    panel_height_mm: float = 62.0
    share_y: bool = False
    headline: str = ""


def reworded(figure: Figure, said: Callable[[str], str]) -> Figure:
    """The figure with every text replaced by a function."""

    def with_words(one: Any, *names: str) -> Any:
        return replace(one, **{name: said(getattr(one, name)) for name in names if hasattr(one, name)})

    def mark(one: Mark) -> Mark:
        return replace(one, names=tuple(map(said, one.names))) if isinstance(one, Bars) else with_words(one, *MARKED)

    def axis(one: Axis) -> Axis:
        return replace(one, label=said(one.label), ticks=tuple((value, said(words)) for value, words in one.ticks))

    panels = tuple(
        replace(
            with_words(panel, "title", "key_title", "line_title", "remark", "crosses"),
            **{"x": axis(panel.x), "y": axis(panel.y), "marks": tuple(map(mark, panel.marks))},
            keys=tuple((said(words), style) for words, style in panel.keys),
        )
        for panel in figure.panels
    )
    return replace(with_words(figure, "title", "caption"), panels=panels)


@dataclass(frozen=True)
class Chart:
    """One chart for all radars of a study: figures by their name, a table, a sentence for each case, a live page.

    page is the text of one self-contained HTML file."""

    figures: Mapping[str, Figure]
    table: "pd.DataFrame"
    sentences: tuple[str, ...]
    page: str
