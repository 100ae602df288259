"""Draws report/drawing.py's figures in this project's style. The only file that uses Matplotlib.

Lines are named at their ends where names fit, else once for each figure, below the panels; a legend never covers
curves. Panels with different lines of the same style keep their own legends. Legible in grey: colours are steps of
lightness, and dash and marker carry the same distinction. The bytes of an SVG depend only on the data and on the
versions of Matplotlib and its fonts."""

import gc
import io
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm, Normalize, to_hex, to_rgb
from matplotlib.figure import Figure as Canvas
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.ticker import FuncFormatter, Locator, NullFormatter
from matplotlib.transforms import ScaledTranslation

from radarsim.errors import ConfigError
from radarsim.language import tr
from radarsim.report import chart
from radarsim.report.chart import Scale, Scans, at_scans, contrast, scans_of, tick_text
from radarsim.report.drawing import GREY, Bars, Figure, Heat, Line, Note, Panel, Reference, Style
from radarsim.report.drawing import Axis as Ends
from radarsim.report.wording import formulas, letters_in, number, spoken

# ---- legends ---------------------------------------------------------------------------------------------------------
LONGEST_AT_END = 28  # letters of a name at a line's end
NAMES_SHARE = 0.3  # maximum share of a panel's cell for names at the ends of its lines
AT_ENDS_MM = 4.4  # of a panel's height for each name at a line's end
ROW_MM, LETTER_MM, SAMPLE_MM = 3.5, 1.45, 12.0  # of a legend: a row, a letter, the sample of a line with its gaps
LEAST_PANEL_MM = 55.0  # width, in a figure of a chosen width
MOST_BESIDE = 16  # names in one column beside a panel

Keys = Mapping[str, Style | None]  # words and the look that they explain; None for the crosses of exact values


@dataclass(frozen=True)
class Legend:
    """Names and styles of a legend, with a title."""

    keys: Keys
    title: str = ""

    def columns(self, width_mm: float) -> int:
        """How many columns of names fit into a width."""
        longest = max(len(spoken(words)) for words in self.keys)
        return max(1, min(len(self.keys), int(width_mm / (LETTER_MM * longest + SAMPLE_MM))))

    def height_mm(self, width_mm: float) -> float:
        """Its height at a width."""
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
    """Plan how the lines of a figure are named."""
    panels = tuple(panel for panel in figure.panels if panel.marks)
    cell = figure.width_mm / min(figure.columns, max(1, len(panels)))
    narrow = any(LETTER_MM * _longest(panel) > NAMES_SHARE * cell for panel in panels if panel.direct)
    at_ends = tuple(not narrow and _fits(panel, figure.panel_height_mm) for panel in panels)
    crossed: set[str] = set()
    keys = [_keys(panel, ends, crossed) for panel, ends in zip(panels, at_ends, strict=True)]
    apart = [dict(panel.keys) for panel in figure.panels if not panel.marks]
    titled = [_key_title(panel, ends) for panel, ends in zip(panels, at_ends, strict=True)]
    titles = {title for title in titled if title} | {
        one.key_title for one in figure.panels if not one.marks and one.key_title
    }
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
        own = [Legend(one, title) if one else None for one, title in zip(keys, titled, strict=True)]
        return Named(panels, at_ends, tuple(own), None, False)
    beside = len(panels) == 1 and panels[0].legend == "right" and len(merged) <= MOST_BESIDE
    ordered = dict(sorted(merged.items(), key=lambda one: one[1] is None))  # what explains all curves stands last
    return Named(panels, at_ends, none, Legend(ordered, next(iter(titles), "")) if merged else None, beside)


def _key_title(panel: Panel, at_ends: bool) -> str:
    """The title of a panel's legend."""
    if panel.key_title or not panel.line_title:
        return panel.key_title
    return tr("at the lines: {key}", key=panel.line_title) if at_ends else panel.line_title


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
    """The styles of a panel that a legend explains; exact crosses of each kind once for each figure."""
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
    """The figure at a width: as many columns as leave enough width for a panel. Unchanged without a width."""
    if width_mm is None or width_mm == figure.width_mm:
        return figure
    return replace(figure, width_mm=width_mm, columns=max(1, min(figure.columns, int(width_mm // LEAST_PANEL_MM))))


# ---- figures ---------------------------------------------------------------------------------------------------------
Colours = dict[str, Normalize]  # of maps, by the words of their bars
MM = 1 / 25.4
PNG_DPI = 200
COLOURS = tuple(light for light, _ in chart.COLOURS)
DASHES = ("-", (0, (5, 1.8)), (0, (1.3, 1.3)), (0, (6, 1.6, 1.3, 1.6)), (0, (9, 2.5)), (0, (3, 1.2, 1, 1.2, 1, 1.2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", "h", ">", "d", "p")  # no multiple of the colours
POINTS = 2000  # of a line; longer ones are drawn at every n-th scan
TITLE_LETTERS_PER_MM = 0.45  # of a panel's cell with its axis, in the bold of titles
HEADLINE_LETTERS_PER_MM, HEADLINE_MM = 0.64, 3.6  # of a figure's width; a line of it
LABEL_LETTERS_PER_MM = 0.62  # of an axis' side, in the letters of labels
AXIS_MM = 9.0  # of the ticks and the label of an axis of x
SIDE_MM = 14.0  # of those of an axis of y, with the gap to the next panel
LETTER_EM = 0.62  # of a number, in its size: how wide a figure of the font is
TOPPED_PT = 14.0  # from a panel to its title, over words along its top
TICK_GAP_PT = 3.0  # between numbers of ticks
REMEMBERED = ("_update_ticks", "_get_ticklabel_bboxes")  # methods of Matplotlib's axes: of no argument; ticks, renderer
BEYOND = ("↓", "↑")  # behind the name of a line that ends below or above its axis
MARKED = 16  # at most about so many markers or crosses a line
WHOLE = (0, 1)  # limits of a share
SYMBOL = re.compile(r"\$\\?\w+\$")  # a label that is one letter: on its side Λ would read as <
UPRIGHT: dict[str, Any] = {"rotation": 0, "ha": "right", "va": "center"}
EXACT: dict[str, Any] = {
    "linestyle": "none",
    "marker": "+",
    "color": "black",
    "markersize": 4.2,
    "markeredgewidth": 0.6,
}
STYLE: dict[Any, Any] = {  # Matplotlib names every key that it knows as a type of its own
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.labelsize": 7.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.title_fontsize": 7,
    "legend.handlelength": 2.6,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titley": 1.0,  # else every title is placed anew, by all that its panel has, each time anything is measured
    "grid.color": "#dddddd",
    "grid.linewidth": 0.4,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.markersize": 3.2,
    "lines.markeredgewidth": 0.7,
    "axes.formatter.useoffset": False,
    "svg.fonttype": "none",  # text that a journal can set and a reader can search
    "pdf.fonttype": 42,
}


def render(figure: Figure) -> Canvas:
    """A Matplotlib figure of the described one, laid out at its size in millimetres."""
    with matplotlib.rc_context(STYLE), _unknown_letters_pass():
        return _laid_out(figure)


def draw_on(figure: Figure, axes: Any, label: str = "") -> Canvas:
    """Draw the panels of a figure on existing axes, one each, besides what these hold; the figure they belong to.

    label is put before the names of its curves, whose colours and markers follow those of curves already there."""
    panels = [panel for panel in figure.panels if panel.marks]
    given = [one for one in np.atleast_1d(np.asarray(axes, dtype=object)).ravel() if isinstance(one, Axes)]
    if len(given) != len(panels):
        raise ConfigError(f"ax: figure {figure.name!r} takes {len(panels)} Matplotlib axes, got {len(given)}")
    if other := [one.name for one in given if one.name != "rectilinear"]:
        raise ConfigError(f"ax: figure {figure.name!r} takes plane rectangular Matplotlib axes, got {other[0]}")
    maps = common_colours(panels)
    with matplotlib.rc_context(STYLE), _unknown_letters_pass():
        for one, panel in zip(given, panels, strict=True):
            crosses = panel.crosses or tr("exact")
            there = set(one.get_legend_handles_labels()[1]) - {crosses}
            one.autoscale(True)  # earlier limits hold for earlier curves alone
            _draw(one, _beside(panel, len(there), label), maps)
            if keys := dict(zip(*reversed(one.get_legend_handles_labels()), strict=True)):
                ordered = sorted(keys, key=lambda name: name == crosses)  # what explains all curves stands last
                one.legend([keys[name] for name in ordered], ordered)
    canvas: Canvas = given[0].figure.canvas.figure  # of axes in a subfigure too the whole
    return canvas


def _beside(panel: Panel, after: int, label: str) -> Panel:
    """A panel drawn over so many curves: its curves with the next colours and the label before their names.

    Grey lines are left out: they would be taken for those of the other curves."""
    marks: list[Any] = []
    for mark in panel.marks:
        if isinstance(mark, Line) and mark.style.colour == GREY and mark.style.marker is None:
            continue
        if isinstance(mark, Line) and (mark.label or mark.name):
            style, name = mark.style, ", ".join(filter(None, (label, mark.label or mark.name)))
            if isinstance(style.colour, int) and style.colour >= 0:
                marker = None if style.marker is None else style.marker + after
                style = replace(style, colour=style.colour + after, marker=marker)
            marks.append(replace(mark, label=name, name=name, style=style))
        elif not (after and isinstance(mark, Reference)):
            marks.append(mark)
    return replace(panel, marks=tuple(marks), title="" if after else panel.title)


@contextmanager
def _unknown_letters_pass() -> Iterator[None]:
    """Without a warning for letters that the font lacks: they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        yield


def _laid_out(figure: Figure) -> Canvas:
    plan = named(figure)
    columns = min(figure.columns, len(plan.panels))
    rows = -(-len(plan.panels) // columns)
    heights = [panel.height_mm or figure.panel_height_mm for panel in plan.panels[::columns]]
    height = sum(heights)
    free = rows * columns > len(plan.panels)  # a cell: the legend has it, where it is large enough
    common = plan.common
    cell = figure.width_mm / columns - SIDE_MM  # the room of a legend in a panel's place
    inside = common is not None and free and common.height_mm(cell) < figure.panel_height_mm
    if common is not None and not inside and not plan.beside:
        height += common.height_mm(figure.width_mm)
    height += rows * max([one.height_mm(figure.width_mm / columns) for one in plan.own if one is not None], default=0.0)
    headline = wrapped(formulas(figure.headline), HEADLINE_LETTERS_PER_MM * figure.width_mm, " ")
    height += HEADLINE_MM * (headline.count("\n") + 1) if headline else 0.0
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0.04, hspace=0.05)
    canvas = Canvas(figsize=(figure.width_mm * MM, height * MM), dpi=PNG_DPI, layout=layout)
    FigureCanvasAgg(canvas)
    if headline:
        canvas.suptitle(headline, x=0.01, ha="left", fontsize=STYLE["font.size"])
    grid = canvas.subplots(rows, columns, squeeze=False, sharey=figure.share_y, height_ratios=heights)
    ended: list[list[Annotation]] = []
    letters = TITLE_LETTERS_PER_MM * figure.width_mm / columns
    maps = common_colours(plan.panels)
    for n, (axes, panel) in enumerate(zip(grid.flat, plan.panels, strict=False)):
        x, y = _wrapped(panel.x, figure.width_mm / columns), _wrapped(panel.y, figure.panel_height_mm - 5)
        y = replace(y, label="") if figure.share_y and n % columns else y
        fitted = replace(panel, title=wrapped(panel.title, letters), x=x, y=y)
        _draw(axes, fitted, maps)
        ended.append(_at_ends(axes, panel) if plan.at_ends[n] else [])
        _legend_below(axes, plan.own[n], figure.width_mm / columns)
    for axes in grid.flat[len(plan.panels) :]:
        axes.set_axis_off()
    if plan.beside:
        _legend(grid.flat[0], common, 1, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    elif inside and common is not None:
        _legend(grid.flat[len(plan.panels)], common, common.columns(cell), loc="center")
    elif common is not None:
        _legend(canvas, common, common.columns(figure.width_mm), loc="outside lower center")
    with _measured_once(canvas):
        layout.execute(canvas)
    canvas.set_layout_engine(None)  # not "none": an engine that does nothing still has savefig draw everything twice
    for texts in ended:
        _spread(texts)
    return canvas


@contextmanager
def _measured_once(canvas: Canvas) -> Iterator[None]:
    """Ticks are placed, and their numbers measured, once for each place, size and resolution of a panel. Matplotlib
    places them four times for every axis that it lays out and three times for every one that it draws. Caching methods
    replace its own meanwhile; a version of it without these methods draws the same, only more slowly."""
    sides = [side for axes in canvas.axes for side in (axes.xaxis, axes.yaxis)]
    for side in sides:
        vars(side).update(_remembering(side))
    try:
        yield
    finally:
        for side in sides:
            for name in REMEMBERED:
                vars(side).pop(name, None)


def _remembering(side: Any) -> dict[str, Callable]:
    """Methods of an axis that cache their last result while its inputs stay the same."""

    def remembering(method: Callable) -> Callable:
        asked: tuple[Any, ...] = ()
        held: tuple[Any, ...] = ()  # the arguments, so that nothing else gets their ids
        answer: Any = None

        def remembered(*args: Any) -> Any:
            nonlocal asked, held, answer
            axes = side.axes
            key = (*side.get_view_interval(), *axes.bbox.bounds, axes.figure.dpi, *map(id, args))
            if key != asked:
                asked, held, answer = key, args, method(*args)
            return answer

        return remembered

    return {name: remembering(getattr(side, name)) for name in REMEMBERED if hasattr(side, name)}


@contextmanager
def _without_collection() -> Iterator[None]:
    """Without Python's search for cyclic garbage: a figure is full of cycles, and all of it is needed until the end."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _wrapped(axis: Ends, side_mm: float) -> Ends:
    """An axis whose label is broken between words where it is longer than its side."""
    return replace(axis, label=wrapped(axis.label, LABEL_LETTERS_PER_MM * side_mm, " "))


def wrapped(text: str, letters: float, mark: str = ", ") -> str:
    """Words in lines of at most so many letters, broken at a mark, of text without one between words."""
    if letters_in(text) <= letters or "\n" in text:
        return text
    mark = mark if mark in text else " "
    lines: list[str] = []
    for part in text.split(mark):
        if lines and letters_in(lines[-1]) + len(mark) + letters_in(part) <= letters:
            lines[-1] += f"{mark}{part}"
        else:
            lines.append(part)
    if mark != " ":
        lines = [wrapped(line, letters, " ") for line in lines]
    return f"{mark.rstrip()}\n".join(lines)


def save(
    figure: Figure, formats: Iterable[str] = ("svg", "png"), width_mm: float | None = None, made_by: str = ""
) -> dict[str, bytes]:
    """The bytes of the figure in each format ("svg", "png" at 200 dpi, "pdf"), the same for the same data. At another
    width its letters keep their size. Title, caption and made_by (sources and versions) are in each file's metadata."""
    with _without_collection():
        canvas = render(at_width(figure, width_mm))
        with _measured_once(canvas):
            return {kind: _bytes(canvas, kind, figure, made_by) for kind in formats}


def _bytes(canvas: Canvas, kind: str, figure: Figure, made_by: str) -> bytes:
    title, caption, undated = spoken(figure.title) or None, spoken(figure.caption) or None, made_by or None
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Title": title, "Description": caption, "Creator": undated, "Date": None},
        "pdf": {"Title": title, "Subject": caption, "Keywords": undated, "CreationDate": None},
        "png": {"Title": title, "Description": caption, "Software": undated},
    }
    out = io.BytesIO()
    with matplotlib.rc_context(STYLE | {"svg.hashsalt": figure.name}), _unknown_letters_pass():
        canvas.savefig(out, format=kind, dpi=PNG_DPI, metadata=metadata[kind])
    return out.getvalue()


def _draw(axes: Axes, panel: Panel, maps: Colours) -> None:
    """Draw a panel's marks and axes."""
    axes.set_xscale(panel.x.scale)
    axes.set_yscale(panel.y.scale)
    axes.margins(x=0.02)
    for mark in panel.marks:
        match mark:
            case Line():
                _line(axes, mark, panel.crosses)
            case Reference():
                _reference(axes, mark, panel.x)
            case Bars():
                _bars(axes, mark)
            case Heat():
                _heat(axes, mark, maps)
            case Note():
                _note(axes, mark)
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label, **(UPRIGHT if SYMBOL.fullmatch(panel.y.label) else {}))
    topped = any(isinstance(mark, Note) and mark.place == "top" for mark in panel.marks)
    axes.set_title(panel.title, loc="left", fontweight="bold", pad=TOPPED_PT if topped else None)
    for limits, put in ((panel.x.limits, axes.set_xlim), (panel.y.limits, axes.set_ylim)):
        if limits != (None, None):
            put(*limits)
    if panel.equal:
        whole = (*panel.x.limits, *panel.y.limits)
        axes.set_aspect("equal", adjustable="datalim" if None in whole else "box")
    placed = any(isinstance(mark, Bars | Heat) for mark in panel.marks)
    _ticks(axes.xaxis, panel.x, placed, scans_of(panel))
    _ticks(axes.yaxis, panel.y, any(isinstance(mark, Heat) for mark in panel.marks))
    if panel.y.limits == WHOLE and panel.x.limits[1] is None:  # a share of one is drawn whole
        for line in axes.lines:
            line.set_clip_on(False)
    if panel.remark:
        axes.set_title(panel.remark, loc="right", fontsize=7)


def _ticks(side: XAxis | YAxis, axis: Ends, placed: bool, scans: Scans | None = None) -> None:
    """The ticks of an axis: given ones; those set by its bars or its map; scans, with the last; else round values."""
    if axis.ticks:
        where, labels = zip(*axis.ticks, strict=True)
        side.set_ticks(where, labels)
    elif not placed:
        chosen = Round(axis.scale == "log", 6 if side.axis_name == "x" else 5, scans)
        side.set_major_locator(chosen)
        side.set_major_formatter(FuncFormatter(lambda value, _: chosen.words.get(value, tick_text(value))))
    side.set_minor_formatter(NullFormatter())


class Round(Locator):
    """Ticks at round values, as in the page's charts (report/chart.py).

    On an axis of x at most as many as leave gaps between their numbers; where its values are scans, at these. words:
    the numbers of the last ones."""

    def __init__(self, log: bool, wanted: int, scans: Scans | None = None):
        self.log, self.wanted, self.scans = log, wanted, scans
        self.words: dict[float, str] = {}
        self._asked: tuple[float, float, float] | None = None

    def __call__(self) -> list[float]:
        assert self.axis is not None  # Matplotlib sets it before it asks
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """The ticks between two ends."""
        low, high = sorted((float(vmin), float(vmax)))
        asked = (low, high, self._length_pt())
        if asked != self._asked:  # asked for several times a drawing
            self._asked, self.words = asked, dict(self._chosen(Scale(self.log, low, high, 0.0, asked[2])))
        return list(self.words)

    def _chosen(self, scale: Scale) -> list[tuple[float, str]]:
        """As many as wanted, or fewer that stand apart."""
        if self.scans:
            every = (at_scans(self.scans, count) for count in range(self.wanted, 1, -1))
            return next((ticks for ticks in every if apart(scale, ticks)), at_scans(self.scans, 1))
        ticks = scale.ticks(self.wanted)
        for wanted in range(self.wanted - 1, 1, -1):
            if apart(scale, ticks):
                break
            ticks = scale.ticks(wanted)
        while not apart(scale, ticks):
            ticks = ticks[::2]
        return ticks

    def _length_pt(self) -> float:
        """The length of an axis of x, points; of another axis, unlimited."""
        if not isinstance(self.axis, XAxis):
            return math.inf
        axes = self.axis.axes
        return float(axes.get_window_extent().width) * 72 / axes.figure.dpi


def apart(scale: Scale, ticks: Sequence[tuple[float, str]]) -> bool:
    """Whether the numbers of ticks beside each other leave a gap; scale ends at the axis' length in points."""
    if math.isinf(scale.end):
        return True
    half = [LETTER_EM * STYLE["xtick.labelsize"] * len(words) / 2 for _, words in ticks]
    places = [float(scale.place(value)) for value, _ in ticks]
    edges = zip(pairwise(places), pairwise(half), strict=True)
    return all(after - before >= left + right + TICK_GAP_PT for (before, after), (left, right) in edges)


def _colour(style: Style) -> str | tuple[float, float, float, float]:
    if isinstance(style.colour, float):
        red, green, blue, alpha = matplotlib.colormaps["viridis"](0.72 * style.colour)
        return red, green, blue, alpha
    return chart.ink_colours(style)[0]


def _look(style: Style) -> dict[str, Any]:
    """Matplotlib's keywords for a style."""
    marker = None if style.marker is None else MARKERS[style.marker % len(MARKERS)]
    dash = "none" if style.dash is None else DASHES[style.dash % len(DASHES)]
    colour = _colour(style)
    ends = {"solid_capstyle": "butt"} if style.flat else {}
    return {
        **ends,
        **{"color": colour, "linestyle": dash, "linewidth": style.width_pt},
        **{"marker": marker, "markersize": style.size_pt, "mfc": colour if style.dash is None else "white"},
    }


def readable(colour: Any) -> str:
    """A colour for letters: darkened until it stands out from white by 4.5 : 1 (WCAG 2.2)."""
    shade, (red, green, blue) = 1.0, to_rgb(colour)
    while contrast(dark := to_hex((shade * red, shade * green, shade * blue)), "#ffffff") < 4.5:
        shade *= 0.97
    return dark


def _line(axes: Axes, line: Line, crosses: str) -> None:
    line = _thinned(line)
    if axes.get_yscale() == "log":  # zero is nowhere on it
        there = np.where(np.asarray(line.y) > 0, 1.0, np.nan)
        lo, hi = (None if end is None else end * there for end in (line.lo, line.hi))
        line = replace(line, y=line.y * there, lo=lo, hi=hi)
    scattered = line.style.dash is None
    step = 1 if scattered else max(1, -(-len(line.x) // MARKED))
    every = step if line.exact is None or step == 1 else 2 * step  # of many, markers and crosses by turns
    alone = [run[0] for run in chart.unbroken(np.isfinite(line.y)) if len(run) == 1]  # no line and no band shows it
    marked = sorted({*range(0, len(line.x), every), *alone}) if alone else every
    axes.plot(line.x, line.y, markevery=marked, zorder=3, label=line.label or line.name or None, **_look(line.style))
    if line.lo is not None and line.hi is not None:
        if line.style.dash is None:
            axes.vlines(line.x, line.lo, line.hi, color=_colour(line.style), linewidth=0.8, zorder=2.8)
        else:
            axes.fill_between(line.x, line.lo, line.hi, color=_colour(line.style), alpha=0.25, linewidth=0, zorder=2)
            axes.vlines(line.x[alone], line.lo[alone], line.hi[alone], color=_colour(line.style), linewidth=0.8)
    if line.exact is not None:
        first = 0 if step == 1 else step
        axes.plot(line.x[first::every], line.exact[first::every], zorder=4, label=crosses or tr("exact"), **EXACT)


def _thinned(line: Line) -> Line:
    stride = -(-len(line.x) // POINTS)
    if stride <= 1:
        return line
    parts = {name: getattr(line, name) for name in ("x", "y", "lo", "hi", "exact")}
    return replace(line, **{name: part[::stride] for name, part in parts.items() if part is not None})


def _reference(axes: Axes, mark: Reference, x: Ends) -> None:
    look: dict[str, Any] = {"color": "#555555", "linewidth": 0.7, "linestyle": (0, (2, 2)), "zorder": 1.5}
    text: dict[str, Any] = {"s": f" {mark.label} ", "ha": "right", "va": "bottom", "color": "#555555"}
    if mark.across == "y":
        axes.axhline(mark.value, **look)
        axes.text(0.99, mark.value, transform=axes.get_yaxis_transform(), **text)
    else:
        axes.axvline(mark.value, **look)
        low, high = x.limits
        if low is not None and high is not None:
            share = Scale(x.scale == "log", low, high, 0.0, 1.0).place(mark.value)
            text["ha"] = "left" if share < chart.REFERENCE_SHARE else "right"  # else its words would lie upon the axis
        axes.text(mark.value, 0.02, transform=axes.get_xaxis_transform(), **text)


def _bars(axes: Axes, bars: Bars) -> None:
    where = np.arange(len(bars.names))
    axes.bar(where, bars.values, color=_colour(bars.style), alpha=0.75, width=0.65, zorder=2)
    if bars.lo is not None and bars.hi is not None:
        axes.vlines(where, bars.lo, bars.hi, color="black", linewidth=0.9, zorder=3)
    axes.set_xticks(where, bars.names)
    axes.grid(False, axis="x")


def common_colours(panels: Sequence[Panel]) -> Colours:
    """The colours of maps: one scale for all maps of a figure whose bars have the same words."""
    scales = chart.heats_of(panels).items()
    return {label: LogNorm(low, high) if log else Normalize(low, high) for label, (low, high, log) in scales}


def _heat(axes: Axes, heat: Heat, maps: Colours) -> None:
    norm = maps[heat.label]
    where = np.arange(len(heat.x)), np.arange(len(heat.y))
    drawn = axes.pcolormesh(*where, heat.values, cmap="viridis", norm=norm, shading="nearest")
    axes.set_xticks(np.arange(len(heat.x)), [tick_text(float(v)) for v in heat.x])
    axes.set_yticks(np.arange(len(heat.y)), [tick_text(float(v)) for v in heat.y])
    axes.grid(False)
    bar = axes.figure.colorbar(drawn, ax=axes, label=heat.label)
    _ticks(bar.ax.yaxis, Ends("", "log" if isinstance(norm, LogNorm) else "linear"), False)
    if heat.values.size <= 100:
        for (i, j), value in np.ndenumerate(heat.values):
            if np.isfinite(value):
                ink = "white" if norm(value) < 0.5 else "black"
                axes.text(j, i, number(float(value), 3), ha="center", va="center", color=ink, fontsize=7)


def _note(axes: Axes, note: Note) -> None:
    if note.place == "top":
        grey: dict[str, Any] = {"color": "#555555", "fontsize": 7, "ha": "center", "va": "bottom"}
        axes.annotate(note.text, (note.x, 1.0), (0, 1.5), axes.get_xaxis_transform(), "offset points", **grey)
        return
    if note.place == "on":
        behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        axes.text(note.x, note.y, note.text, ha="center", va="center", fontsize=7, zorder=3.5, bbox=behind)
        return
    up, right, level = "n" in note.place, "e" in note.place, note.place == "e"
    look: dict[str, Any] = {"ha": "left" if right else "right", "va": "bottom" if up else "top", "fontsize": 7}
    look |= {"va": "center", "annotation_clip": False} if level else {}
    shift = (3 if right else -3, 0 if level else 3 if up else -3)
    axes.annotate(note.text, (note.x, note.y), xytext=shift, textcoords="offset points", **look)


def _at_ends(axes: Axes, panel: Panel) -> list[Annotation]:
    """The names of a panel's lines, written at their ends; to be moved apart when the layout is final."""
    texts = []
    for m in lines(panel):
        last = np.flatnonzero(np.isfinite(m.y))[-1]
        low, high = sorted(axes.get_ylim())
        y = float(np.clip(m.y[last], low, high))  # a line may end beyond an axis that is cut
        texts.append(
            axes.annotate(
                f"{m.label} {BEYOND[int(m.y[last] > high)]}" if y != m.y[last] else m.label,
                (m.x[last], y),
                xytext=(1.015, y),
                textcoords=axes.get_yaxis_transform(),
                va="center",
                color=readable(_colour(m.style)),
                annotation_clip=False,
            )
        )
    return texts


def _legend(where: Axes | Canvas, legend: Legend | None, columns: int, **place: Any) -> None:
    """Names and styles, including the exact crosses, in so many columns."""
    if legend is None:
        return
    handles = [Line2D([], [], **(EXACT if look is None else _look(look))) for look in legend.keys.values()]
    room: dict[str, Any] = {"ncols": columns, "borderaxespad": 0.3, "labelspacing": 0.3, "columnspacing": 1.2}
    drawn = where.legend(handles, list(legend.keys), title=legend.title or None, alignment="left", **place, **room)
    # Inside a panel it may not push it to nothing; beside it, it takes its room.
    drawn.set_in_layout(isinstance(where, Canvas) or "bbox_to_anchor" in place)


def _legend_below(axes: Axes, legend: Legend | None, width_mm: float) -> None:
    """A legend of a panel's own, below its axis, no wider than its cell."""
    if legend is None:
        return
    place = axes.transAxes + ScaledTranslation(0, -AXIS_MM * MM, axes.figure.dpi_scale_trans)
    columns = legend.columns(width_mm)
    _legend(axes, legend, columns, loc="upper left", bbox_to_anchor=(0.0, 0.0), bbox_transform=place)


def _spread(texts: list[Annotation]) -> None:
    """Move labels at line ends apart, up and down, keeping their order; within the panel where they fit."""
    if not texts:
        return
    axes = texts[0].axes
    assert axes is not None  # every name is written into a panel
    box = axes.get_window_extent()
    step = 1.2 * STYLE["font.size"] * axes.figure.dpi / 72
    wanted = [axes.transData.transform(text.xy)[1] for text in texts]
    order = np.argsort(wanted, kind="stable")
    placed = separated(np.array(wanted)[order], step, box.y0 + step / 2, box.y1 - step / 2)
    for i, y in zip(order, placed, strict=True):
        texts[i].set_position((1.015, axes.transAxes.inverted().transform((0, y))[1]))
        texts[i].xyann = (1.015, axes.transAxes.inverted().transform((0, y))[1])
        texts[i].anncoords = "axes fraction"


def separated(wanted: np.ndarray, step: float, low: float, high: float) -> np.ndarray:
    """Rising positions at least `step` apart, nearest to the wanted ones (rising) in squares, inside low … high.
    Pool-adjacent-violators on positions less their own multiple of the step."""
    offsets = step * np.arange(len(wanted))
    groups: list[list[float]] = []
    for value in np.clip(wanted, low, high) - offsets:
        groups.append([value])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    free = np.concatenate([np.full(len(group), np.mean(group)) for group in groups])
    return np.clip(free, low, max(low, high - offsets[-1])) + offsets
