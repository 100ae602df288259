"""What a figure shows, as data: figures of panels of marks.

Nothing here knows how it is drawn (report/figures.py does).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

COLUMN_MM = 85.0  # one column of a journal page
PAGE_MM = 175.0  # two columns
GREY = -1  # the colour of what is no curve of its own: guides, crowds of points


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
    and marker: ints, None for no line or no marker. flat: a line ends where its data end, as a bar does, however wide.
    """

    colour: int | float = 0
    dash: int | None = 0
    marker: int | None = None
    width_pt: float = 1.1
    size_pt: float = 3.2
    flat: bool = False


@dataclass(frozen=True)
class Line:
    """A series y (n,) over x (n,), with its 95 % band lo … hi and its exact values (small crosses) where known.

    The label is written at the line's end where labels fit, else into a legend. dash None leaves markers alone
    (scatter), with whiskers for lo … hi. name says which line it is where the label leaves that to keys or to another
    panel.
    """

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
    """A map of values (len(y), len(x)) over the cells' centres, with its colour bar's label.

    Values are written in if few.
    """

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    label: str


@dataclass(frozen=True)
class Note:
    """Words near a point of the data: above or below it ("n", "s"), to its right or left ("e", "w")."""

    x: float
    y: float
    text: str
    place: str = "ne"


Mark = Line | Reference | Bars | Heat | Note
MARKED = ("label", "name", "text")  # words of marks


@dataclass(frozen=True)
class Panel:
    """One pair of axes. keys explain styles (not single lines) in a small legend: (words, style).

    direct: lines are named at their ends where the names fit; else always in the figure's legend, which stands below
    the panels; "right": beside a single panel; "none": they are named in another panel. A remark stands above the
    panel, at its right. Without marks a panel adds its keys to the legend. crosses is what the crosses of exact values
    are called; empty: exact. equal: x and y are drawn at one scale, as a map.
    """

    x: Axis
    y: Axis
    marks: tuple[Mark, ...]
    title: str = ""
    keys: tuple[tuple[str, Style], ...] = ()
    key_title: str = ""
    direct: bool = True
    legend: str = "best"
    remark: str = ""
    crosses: str = ""
    equal: bool = False


@dataclass(frozen=True)
class Figure:
    """A figure of one or more panels in rows of `columns`; the caption says what is drawn and what the marks mean.

    headline is the run's answer in a sentence of plain text, over its first figure.
    """

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
    """The figure with every text of it put into other words."""

    def with_words(one: Any, *names: str) -> Any:
        return replace(one, **{name: said(getattr(one, name)) for name in names if hasattr(one, name)})

    def mark(one: Mark) -> Mark:
        return replace(one, names=tuple(map(said, one.names))) if isinstance(one, Bars) else with_words(one, *MARKED)

    def axis(one: Axis) -> Axis:
        return replace(one, label=said(one.label), ticks=tuple((value, said(words)) for value, words in one.ticks))

    panels = tuple(
        replace(
            with_words(panel, "title", "key_title", "remark", "crosses"),
            **{"x": axis(panel.x), "y": axis(panel.y), "marks": tuple(map(mark, panel.marks))},
            keys=tuple((said(words), style) for words, style in panel.keys),
        )
        for panel in figure.panels
    )
    return replace(with_words(figure, "title", "caption"), panels=panels)


@dataclass(frozen=True)
class Chart:
    """One chart for every device of a study: figures by their name, a table, a sentence for each case, a live page.

    page is the text of one self-contained HTML file.
    """

    figures: Mapping[str, Figure]
    table: "pd.DataFrame"
    sentences: tuple[str, ...]
    page: str
