"""Figures as data: panels of marks, independent of how they are drawn (report/drawing/canvas.py)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


COLUMN_MM = 85.0  # one column of a journal page
PAGE_MM = 175.0  # two columns
MAX_PANEL_LINES = 6  # that a panel can hold; if more, they are named at their ends
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
    """The look that distinguishes a mark, in grey too: each number picks from a list of its own.

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
    """A series y (n,) over x (n,), with its 95 % band lo … hi and its exact values (small crosses) where known.

    The label is written at the line's end where labels fit, else in a legend. dash None draws markers without a line
    (scatter), with whiskers for lo … hi. name identifies the line where the label leaves that to keys or to another
    panel. has_band: whether lo … hi is drawn as a band; a page shows it in any case."""

    x: np.ndarray
    y: np.ndarray
    label: str = ""
    style: Style = field(default_factory=Style)
    lo: np.ndarray | None = None
    hi: np.ndarray | None = None
    exact: np.ndarray | None = None
    name: str = ""
    has_band: bool = True


@dataclass(frozen=True)
class Reference:
    """A thin line across the panel at a value of x or y (`axis_name` says which), with a label."""

    value: float
    axis_name: str = "y"
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
    """A map of values (len(y), len(x)) over the centres of its cells, with the label of its colour bar.

    Where there are few values, they are written into the cells, with half the widths of their intervals if known. Maps
    of a figure with the same label and group share their colours. is_error: the least value is the best, and has
    a frame."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    label: str
    group: str = ""
    half_widths: np.ndarray | None = None
    is_error: bool = False


@dataclass(frozen=True)
class Note:
    """Text near a point of the data: above or below it ("n", "s"), to its right or left ("e", "w").

    "on": upon the point, which interrupts its line. "e" alone: to its right, outside the panel too. "top": along the
    panel's top, whatever y. "row": above y from the panel's left edge on, whatever x."""

    x: float
    y: float
    text: str
    place: str = "ne"
    row: int = 0  # of those along the top, from the panel upwards


Mark = Line | Reference | Bars | Heat | Note
MARK_TEXTS = ("label", "name", "text")  # fields of marks that hold text


@dataclass(frozen=True)
class Panel:
    """One pair of axes. keys explain styles (not single lines) in a small legend: (text, style), under key_title.

    direct: lines are named at their ends where the names fit, else in a legend; not direct: always in a legend. legend:
    "right" puts it beside a single panel, "none" leaves the names to another panel. line_title: what these names are. A
    remark is above the panel, at its right. A panel without marks adds its keys to the legend. crosses: the name of the
    exact values' crosses; empty: exact. has_intervals: bands are 95 % intervals, else what a name in the legend says.
    equal: x and y have one scale, as on a map. height_mm: instead of the figure's, in a figure of one column."""

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
    has_intervals: bool = True
    equal: bool = False
    height_mm: float | None = None


@dataclass(frozen=True)
class Figure:
    """A figure of one or more panels in rows of `columns`; the caption describes content and marks.

    headline is the run's answer in a sentence of plain text, which its first figure bears. has_joined_names: whether
    "=" joins names of coinciding curves."""

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1
    width_mm: float = COLUMN_MM
    panel_height_mm: float = 62.0
    share_y: bool = False
    headline: str = ""
    has_joined_names: bool = False


def reworded(figure: Figure, translate: Callable[[str], str]) -> Figure:
    """The figure with every text replaced by what a function makes of it."""
    panels = tuple(
        replace(
            _translated(panel, translate, "title", "key_title", "line_title", "remark", "crosses"),
            x=_translated_axis(panel.x, translate),
            y=_translated_axis(panel.y, translate),
            marks=tuple(_translated_mark(mark, translate) for mark in panel.marks),
            keys=tuple((translate(text), style) for text, style in panel.keys),
        )
        for panel in figure.panels
    )
    return replace(_translated(figure, translate, "title", "caption"), panels=panels)


def _translated(item: Any, translate: Callable[[str], str], *fields: str) -> Any:
    return replace(item, **{name: translate(getattr(item, name)) for name in fields if hasattr(item, name)})


def _translated_mark(mark: Mark, translate: Callable[[str], str]) -> Mark:
    if isinstance(mark, Bars):
        return replace(mark, names=tuple(map(translate, mark.names)))
    translated: Mark = _translated(mark, translate, *MARK_TEXTS)
    return translated


def _translated_axis(axis: Axis, translate: Callable[[str], str]) -> Axis:
    ticks = tuple((value, translate(text)) for value, text in axis.ticks)
    return replace(axis, label=translate(axis.label), ticks=ticks)


@dataclass(frozen=True)
class Chart:
    """The chart of a study for all radars: figures by their name, a table, a sentence for each case, a page with
    sliders.

    page is the text of one self-contained HTML file."""

    figures: Mapping[str, Figure]
    table: "pd.DataFrame"
    sentences: tuple[str, ...]
    page: str
