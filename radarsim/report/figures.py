"""Draws report/drawing.py's figures in the one style of this project. The only file that knows Matplotlib.

Legible in grey: colours fall in lightness, and dash and marker tell the same apart. The bytes of an SVG depend on the
data and on the versions of Matplotlib and its fonts alone.
"""

import io
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.ticker import NullFormatter

from radarsim.report.drawing import Bars, Figure, Heat, Line, Note, Panel, Reference, Style

MM = 1 / 25.4
PNG_DPI = 200
COLOURS = ("#14213d", "#0a6ebd", "#c8440b", "#1b8a5a", "#a65fa8", "#c98a00", "#4aa3c7", "#8a8a8a")
DASHES = ("-", (0, (5, 1.8)), (0, (1.3, 1.3)), (0, (6, 1.6, 1.3, 1.6)), (0, (9, 2.5)), (0, (3, 1.2, 1, 1.2, 1, 1.2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", "h", ">", "d", "p")  # no multiple of the colours
POINTS = 2000  # of a line; longer ones are drawn at every n-th scan
LONGEST_AT_END = 28  # letters of a name that may stand at a line's end
TITLE_LETTERS_PER_MM = 0.49  # of a panel's cell with its axis, in the bold of titles
MOST_IN_COLUMN = 10  # names in one column of a legend
MARKED = 16  # at most about so many markers or crosses a line
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
    "grid.color": "#dddddd",
    "grid.linewidth": 0.4,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.markersize": 3.2,
    "lines.markeredgewidth": 0.7,
    "axes.formatter.useoffset": False,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}


def render(figure: Figure) -> Canvas:
    """A Matplotlib figure of the described one, laid out at its size in millimetres."""
    with matplotlib.rc_context(STYLE), _unknown_letters_pass():
        return _laid_out(figure)


@contextmanager
def _unknown_letters_pass() -> Iterator[None]:
    """Letters that the font lacks are drawn as boxes, without a warning for each."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        yield


def _laid_out(figure: Figure) -> Canvas:
    rows = -(-len(figure.panels) // figure.columns)
    size = (figure.width_mm * MM, rows * figure.panel_height_mm * MM)
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0.04, hspace=0.05)
    canvas = Canvas(figsize=size, dpi=PNG_DPI, layout=layout)
    FigureCanvasAgg(canvas)
    grid = canvas.subplots(rows, figure.columns, squeeze=False, sharey=figure.share_y)
    ended: list[list[Annotation]] = []
    explained = False  # crosses are explained once a figure
    letters = TITLE_LETTERS_PER_MM * figure.width_mm / figure.columns
    for axes, panel in zip(grid.flat, figure.panels, strict=False):
        panel = replace(panel, title=wrapped(panel.title, letters))
        crosses = not explained and any(isinstance(m, Line) and m.exact is not None for m in panel.marks)
        explained |= crosses
        if panel.marks:
            ended.append(_draw(axes, panel, crosses))
        else:
            _legend(axes, panel, list(panel.keys), False)
    for axes in grid.flat[len(figure.panels) :]:
        axes.set_visible(False)
    layout.execute(canvas)
    canvas.set_layout_engine(None)  # not "none": an engine that does nothing still has savefig draw everything twice
    for texts in ended:
        _spread(texts)
    return canvas


def wrapped(title: str, letters: float) -> str:
    """A title in lines of at most so many letters, broken after commas alone."""
    lines: list[str] = []
    for part in title.split(", "):
        if lines and len(lines[-1]) + 2 + len(part) <= letters:
            lines[-1] += f", {part}"
        else:
            lines.append(part)
    return ",\n".join(lines)


def save(figure: Figure, formats: Iterable[str] = ("svg", "png")) -> dict[str, bytes]:
    """The bytes of the figure in each format ("svg", "png" at 200 dpi, "pdf"), the same for the same data."""
    canvas = render(figure)
    return {kind: _bytes(canvas, kind, figure.name) for kind in formats}


def _bytes(canvas: Canvas, kind: str, name: str) -> bytes:
    undated: dict[str, Any]
    undated = {"svg": {"Date": None, "Creator": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
    out = io.BytesIO()
    with matplotlib.rc_context(STYLE | {"svg.hashsalt": name}), _unknown_letters_pass():
        canvas.savefig(out, format=kind, dpi=PNG_DPI, metadata=undated[kind])
    return out.getvalue()


def _draw(axes: Axes, panel: Panel, crosses: bool) -> list[Annotation]:
    """Draw a panel, with a key to exact crosses or not.

    The texts written at line ends come back, to be moved apart once the layout stands.
    """
    axes.set_xscale(panel.x.scale)
    axes.set_yscale(panel.y.scale)
    axes.margins(x=0.02)
    for mark in panel.marks:
        match mark:
            case Line():
                _line(axes, mark)
            case Reference():
                _reference(axes, mark)
            case Bars():
                _bars(axes, mark)
            case Heat():
                _heat(axes, mark)
            case Note():
                _note(axes, mark)
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label)
    axes.set_title(panel.title, loc="left", fontweight="bold")
    for limits, axis, put in ((panel.x.limits, panel.x, axes.set_xlim), (panel.y.limits, panel.y, axes.set_ylim)):
        if limits != (None, None):
            put(*limits)
        if axis.ticks:
            where, labels = zip(*axis.ticks, strict=True)
            (axes.set_xticks if axis is panel.x else axes.set_yticks)(where, labels)
            (axes.xaxis if axis is panel.x else axes.yaxis).set_minor_formatter(NullFormatter())
    if panel.remark:
        axes.set_title(panel.remark, loc="right", fontsize=7)
    return _name(axes, panel, crosses)


def _colour(style: Style) -> str | tuple[float, float, float, float]:
    if isinstance(style.colour, float):
        red, green, blue, alpha = matplotlib.colormaps["viridis"](0.72 * style.colour)
        return red, green, blue, alpha
    return COLOURS[style.colour % len(COLOURS)]


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


def _line(axes: Axes, line: Line) -> None:
    line = _thinned(line)
    step = 1 if line.style.dash is None else max(1, -(-len(line.x) // MARKED))
    scattered = line.style.dash is None
    every = step if line.exact is None or scattered else 2 * step  # markers and crosses by turns
    axes.plot(line.x, line.y, markevery=every, zorder=3, **_look(line.style))
    if line.lo is not None and line.hi is not None:
        if line.style.dash is None:
            axes.vlines(line.x, line.lo, line.hi, color=_colour(line.style), linewidth=0.8, zorder=2.8)
        else:
            axes.fill_between(line.x, line.lo, line.hi, color=_colour(line.style), alpha=0.25, linewidth=0, zorder=2)
    if line.exact is not None:
        first = 0 if scattered else step
        axes.plot(line.x[first::every], line.exact[first::every], zorder=4, **EXACT)


def _thinned(line: Line) -> Line:
    stride = -(-len(line.x) // POINTS)
    if stride <= 1:
        return line
    parts = {name: getattr(line, name) for name in ("x", "y", "lo", "hi", "exact")}
    return replace(line, **{name: part[::stride] for name, part in parts.items() if part is not None})


def _reference(axes: Axes, mark: Reference) -> None:
    look: dict[str, Any] = {"color": "#555555", "linewidth": 0.7, "linestyle": (0, (2, 2)), "zorder": 1.5}
    text: dict[str, Any] = {"s": f" {mark.label} ", "ha": "right", "va": "bottom", "color": "#555555"}
    if mark.across == "y":
        axes.axhline(mark.value, **look)
        axes.text(0.99, mark.value, transform=axes.get_yaxis_transform(), **text)
    else:
        axes.axvline(mark.value, **look)
        axes.text(mark.value, 0.02, transform=axes.get_xaxis_transform(), **text)


def _bars(axes: Axes, bars: Bars) -> None:
    where = np.arange(len(bars.names))
    axes.bar(where, bars.values, color=_colour(bars.style), alpha=0.75, width=0.65, zorder=2)
    if bars.lo is not None and bars.hi is not None:
        axes.vlines(where, bars.lo, bars.hi, color="black", linewidth=0.9, zorder=3)
    axes.set_xticks(where, bars.names)
    axes.grid(False, axis="x")


def _heat(axes: Axes, heat: Heat) -> None:
    drawn = axes.pcolormesh(
        np.arange(len(heat.x)), np.arange(len(heat.y)), heat.values, cmap="viridis", shading="nearest"
    )
    axes.set_xticks(np.arange(len(heat.x)), [f"{v:g}" for v in heat.x])
    axes.set_yticks(np.arange(len(heat.y)), [f"{v:g}" for v in heat.y])
    axes.grid(False)
    axes.figure.colorbar(drawn, ax=axes, label=heat.label)
    if heat.values.size <= 100:
        middle = (np.nanmin(heat.values) + np.nanmax(heat.values)) / 2
        for (i, j), value in np.ndenumerate(heat.values):
            axes.text(j, i, f"{value:.3g}", ha="center", va="center", color="white" if value < middle else "black")


def _note(axes: Axes, note: Note) -> None:
    up, right = "n" in note.place, "e" in note.place
    look: dict[str, Any] = {"ha": "left" if right else "right", "va": "bottom" if up else "top", "fontsize": 7}
    shift = (3 if right else -3, 3 if up else -3)
    axes.annotate(note.text, (note.x, note.y), xytext=shift, textcoords="offset points", **look)


def _name(axes: Axes, panel: Panel, crosses: bool) -> list[Annotation]:
    """Name the lines, at their ends where there are few enough, else in a legend, and explain the styles in a legend.

    Gives the names at line ends.
    """
    lines = [m for m in panel.marks if isinstance(m, Line) and m.label and np.isfinite(m.y).any()]
    handles = list(panel.keys)
    short = all(len(m.label) <= LONGEST_AT_END for m in lines)
    direct = panel.direct and short and all(m.style.dash is not None for m in lines) and len(lines) <= _fitting(axes)
    if not direct:
        handles = [(m.label, m.style) for m in lines] + handles
    _legend(axes, panel, handles if panel.legend != "none" else [], crosses)
    if not direct:
        return []
    texts = []
    for m in lines:
        last = np.flatnonzero(np.isfinite(m.y))[-1]
        texts.append(
            axes.annotate(
                m.label,
                (m.x[last], m.y[last]),
                xytext=(1.015, m.y[last]),
                textcoords=axes.get_yaxis_transform(),
                va="center",
                color=_colour(m.style),
                annotation_clip=False,
            )
        )
    return texts


def _legend(axes: Axes, panel: Panel, handles: list[tuple[str, Style]], crosses: bool) -> None:
    """A legend of names and styles, with the exact crosses where asked; of a panel without marks in its middle."""
    look = [Line2D([], [], **_look(style)) for _, style in handles] + [Line2D([], [], **EXACT)] * crosses
    names = [name for name, _ in handles] + [panel.crosses] * crosses
    if not names:
        return
    place: dict[str, Any] = {"loc": "best" if panel.legend == "none" else panel.legend}
    if not panel.marks:
        axes.set_axis_off()
        place = {"loc": "center"}
    elif panel.legend == "right":
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
    room: dict[str, Any] = {"ncols": -(-len(names) // MOST_IN_COLUMN), "borderaxespad": 0.3, "labelspacing": 0.3}
    legend = axes.legend(look, names, title=panel.key_title or None, alignment="left", **place, **room)
    # Inside the panel it may not push it to nothing; beside it, it takes its room.
    legend.set_in_layout(panel.legend == "right")


def _fitting(axes: Axes) -> int:
    """How many labels of one line fit one below the other beside a panel."""
    canvas, place = axes.figure, axes.get_subplotspec()
    assert isinstance(canvas, Canvas)  # and no part of one
    assert place is not None  # every panel is a cell of its figure
    height = canvas.get_size_inches()[1] / place.get_gridspec().nrows
    return int(0.75 * height * 72 / (1.25 * STYLE["font.size"]))


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

    Pool-adjacent-violators on positions less their own multiple of the step.
    """
    offsets = step * np.arange(len(wanted))
    groups: list[list[float]] = []
    for value in np.clip(wanted, low, high) - offsets:
        groups.append([value])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    free = np.concatenate([np.full(len(group), np.mean(group)) for group in groups])
    return np.clip(free, low, max(low, high - offsets[-1])) + offsets
