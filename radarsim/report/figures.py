"""Draw the figures that report/drawing.py describes, with Matplotlib. No other file uses it.

Lines are named at their ends where the names fit, else in one legend of the figure, which never covers curves. Panels
in which the same style means different lines have a legend each. Every figure is legible in grey: the colours are steps
of lightness, and dash and marker make the same distinction. The bytes of an SVG depend only on the data and on the
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
from matplotlib.transforms import Bbox, ScaledTranslation

from radarsim.errors import ConfigError
from radarsim.language import tr
from radarsim.report import colours, scales
from radarsim.report.drawing import GREY, Bars, Figure, Heat, Line, Mark, Note, Panel, Reference, Style
from radarsim.report.drawing import Axis as AxisSpec
from radarsim.report.page_figure import HEADLINE_ID, DrawnFigure, ValueMark, cell_text, value_text
from radarsim.report.scales import Scale, Scans, scans_of, tick_text
from radarsim.report.wording import formulas, letters_in, number, spoken

# ---- legends ---------------------------------------------------------------------------------------------------------
MAX_END_NAME_LETTERS = 28  # of a name at a line's end
MAX_END_NAMES_SHARE = 0.3  # of a panel's cell, for names at the ends of its lines
END_NAME_MM = 4.4  # of a panel's height for each name at a line's end
ROW_MM, LETTER_MM, SAMPLE_MM = 3.5, 1.45, 12.0  # of a legend: a row, a letter, the sample of a line with its gaps
MIN_PANEL_MM = 55.0  # width, in a figure of a chosen width
MAX_NAMES_BESIDE = 16  # in one column beside a panel

LegendKeys = Mapping[str, Style | None]  # names and the styles that they explain; None for the crosses of exact values


@dataclass(frozen=True)
class Legend:
    """Names and styles of a legend, with a title."""

    keys: LegendKeys
    title: str = ""

    def columns(self, width_mm: float) -> int:
        """Number of columns of names that fit into a width."""
        longest = max(len(spoken(name)) for name in self.keys)
        return max(1, min(len(self.keys), int(width_mm / (LETTER_MM * longest + SAMPLE_MM))))

    def height_mm(self, width_mm: float) -> float:
        """Height of the legend at a width."""
        rows = -(-len(self.keys) // self.columns(width_mm)) + bool(self.title)
        return ROW_MM * rows + 2.0


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
    too_wide = any(LETTER_MM * _longest_name(panel) > MAX_END_NAMES_SHARE * cell_mm for panel in panels if panel.direct)
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
    ordered = dict(sorted(merged.items(), key=lambda key: key[1] is None))  # crosses explain all curves: they come last
    common = Legend(ordered, next(iter(all_titles), "")) if merged else None
    return LegendPlan(panels, at_ends, (None,) * len(panels), common, stands_beside)


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


def _longest_name(panel: Panel) -> int:
    return max((len(spoken(line.label)) for line in named_lines(panel)), default=0)


def _names_fit(panel: Panel, height_mm: float) -> bool:
    """Whether the lines of a panel can be named at their ends."""
    lines = named_lines(panel)
    short = all(len(line.label) <= MAX_END_NAME_LETTERS for line in lines)
    connected = all(line.style.dash is not None for line in lines)
    return panel.direct and short and connected and len(lines) <= height_mm / END_NAME_MM


def _legend_keys(panel: Panel, at_ends: bool, explained_crosses: set[str]) -> LegendKeys:
    """The styles of a panel that a legend explains; crosses of exact values once for each name in a figure."""
    keys: dict[str, Style | None] = {}
    if panel.legend != "none":
        keys |= {line.label: line.style for line in named_lines(panel) if not at_ends}
        keys |= dict(panel.keys)
    has_exact = any(isinstance(m, Line) and m.exact is not None and np.isfinite(m.exact).any() for m in panel.marks)
    name = panel.crosses or tr("exact")
    if has_exact and name not in explained_crosses:
        explained_crosses.add(name)
        keys[name] = None
    return keys


def at_width(figure: Figure, width_mm: float | None) -> Figure:
    """The figure at a width, with as many columns as leave enough width for a panel; unchanged without a width."""
    if width_mm is None or width_mm == figure.width_mm:
        return figure
    return replace(figure, width_mm=width_mm, columns=max(1, min(figure.columns, int(width_mm // MIN_PANEL_MM))))


# ---- figures ---------------------------------------------------------------------------------------------------------
MapColours = dict[str, Normalize]  # colour scales of maps, by the label of their bar
MM = 1 / 25.4  # inches
PNG_DPI = 200
DASHES = ("-", (0, (5, 1.8)), (0, (1.3, 1.3)), (0, (6, 1.6, 1.3, 1.6)), (0, (9, 2.5)), (0, (3, 1.2, 1, 1.2, 1, 1.2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", "h", ">", "d", "p")  # no multiple of the colours
MAX_POINTS = 2000  # of a line; longer ones are drawn at every n-th scan
TITLE_LETTERS_PER_MM = 0.45  # of a panel's cell with its axis, in the bold of titles
HEADLINE_LETTERS_PER_MM, HEADLINE_MM = 0.64, 3.6  # of a figure's width; height of a line
LABEL_LETTERS_PER_MM = 0.62  # of an axis, in the letters of labels
AXIS_MM = 9.0  # of the ticks and the label of an axis of x
SIDE_MM = 14.0  # of those of an axis of y, with the gap to the next panel
LETTER_EM = 0.62  # mean width of a digit, in its size
TOP_NOTE_PT = 14.0  # from a panel to its title, where notes stand along its top
TICK_GAP_PT = 3.0  # between numbers of ticks
CACHED_METHODS = ("_update_ticks", "_get_ticklabel_bboxes")  # of Matplotlib's axes; arguments: none; ticks, renderer
BEYOND_ARROWS = ("↓", "↑")  # after the name of a line that ends below or above its axis
MAX_MARKERS = 16  # about so many markers or crosses a line
MAX_VALUE_MARKS = 160  # scattered points of a line that can be read on a page
MAX_WRITTEN_CELLS = 100  # of a map, whose values are written in
MAX_VALUE_CELLS = 400  # of a map, whose values can be read on a page
SHARE_LIMITS = (0, 1)
SYMBOL = re.compile(r"\$\\?\w+\$")  # a label that is one letter stands upright: on its side Λ would read as <
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
    """Draw a figure with Matplotlib, laid out at its size in millimetres."""
    with matplotlib.rc_context(STYLE), _ignore_missing_glyphs():
        return _layout(figure, plan_legends(figure))


def save(
    figure: Figure, formats: Iterable[str] = ("svg",), width_mm: float | None = None, made_by: str = ""
) -> dict[str, bytes]:
    """Return the bytes of the figure in each format ("svg", "png" at 200 dpi, "pdf"), the same for the same data.

    At another width its letters keep their size. Title, caption and made_by (sources and versions) are in each file's
    metadata."""
    with _no_garbage_collection():
        canvas = render(at_width(figure, width_mm))
        with _cache_ticks(canvas):
            return {kind: _encode(canvas, kind, figure, made_by) for kind in formats}


def draw(
    figure: Figure, formats: Iterable[str] = ("svg",), width_mm: float | None = None, made_by: str = ""
) -> DrawnFigure:
    """Draw a figure once: its files as `save` returns them, and what a page shows of the same drawing."""
    figure = at_width(figure, width_mm)
    kinds = list(formats)
    with _no_garbage_collection():
        canvas = render(figure)
        with _cache_ticks(canvas):
            encoded = {kind: _encode(canvas, kind, figure, made_by) for kind in dict.fromkeys((*kinds, "svg"))}
    panels = [panel for panel in figure.panels if panel.marks]
    groups = {n: _value_marks(axes, panel) for n, (axes, panel) in enumerate(zip(canvas.axes, panels, strict=False))}
    values = [(spoken(panels[n].title), tuple(marks)) for n, marks in groups.items() if marks]
    files = {kind: encoded[kind] for kind in kinds}
    return DrawnFigure(figure, files, encoded["svg"], tuple(values), _headline_height_pt(canvas))


def draw_on(figure: Figure, axes: Any, label: str = "") -> Canvas:
    """Draw the panels of a figure on existing axes, one each, beside what these hold, and return the axes' figure.

    label is put before the names of the curves, whose colours and markers follow those of curves already there."""
    panels = [panel for panel in figure.panels if panel.marks]
    targets = [item for item in np.atleast_1d(np.asarray(axes, dtype=object)).ravel() if isinstance(item, Axes)]
    if len(targets) != len(panels):
        raise ConfigError(f"ax: figure {figure.name!r} takes {len(panels)} Matplotlib axes, got {len(targets)}")
    if curved := [target.name for target in targets if target.name != "rectilinear"]:
        raise ConfigError(f"ax: figure {figure.name!r} takes plane rectangular Matplotlib axes, got {curved[0]}")
    map_colours = common_map_colours(panels)
    with matplotlib.rc_context(STYLE), _ignore_missing_glyphs():
        for target, panel in zip(targets, panels, strict=True):
            crosses = panel.crosses or tr("exact")
            names = set(target.get_legend_handles_labels()[1]) - {crosses}
            target.autoscale(True)  # earlier limits hold for earlier curves alone
            _draw_panel(target, _additional_panel(panel, len(names), label), map_colours)
            if keys := dict(zip(*reversed(target.get_legend_handles_labels()), strict=True)):
                ordered = sorted(keys, key=lambda name: name == crosses)  # crosses explain all curves: they come last
                target.legend([keys[name] for name in ordered], ordered)
    canvas: Canvas = targets[0].figure.canvas.figure  # the whole figure, for axes in a subfigure too
    return canvas


def _additional_panel(panel: Panel, curve_count: int, label: str) -> Panel:
    """A panel for axes that hold so many curves: its curves get the next colours, and the label before their names.

    Grey lines are left out: they would be taken for those of the other curves."""
    marks: list[Mark] = []
    for mark in panel.marks:
        if isinstance(mark, Line) and mark.style.colour == GREY and mark.style.marker is None:
            continue
        if isinstance(mark, Line) and (mark.label or mark.name):
            style, name = mark.style, ", ".join(filter(None, (label, mark.label or mark.name)))
            if isinstance(style.colour, int) and style.colour >= 0:
                marker = None if style.marker is None else style.marker + curve_count
                style = replace(style, colour=style.colour + curve_count, marker=marker)
            marks.append(replace(mark, label=name, name=name, style=style))
        elif not (curve_count and isinstance(mark, Reference)):
            marks.append(mark)
    return replace(panel, marks=tuple(marks), title="" if curve_count else panel.title)


@contextmanager
def _ignore_missing_glyphs() -> Iterator[None]:
    """Suppress the warning for letters that the font lacks: they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        yield


# ---- layout ----------------------------------------------------------------------------------------------------------
def _layout(figure: Figure, plan: LegendPlan) -> Canvas:
    """Draw all panels and legends of a figure, and fix their positions."""
    columns = min(figure.columns, len(plan.panels))
    rows = -(-len(plan.panels) // columns)
    heights = [panel.height_mm or figure.panel_height_mm for panel in plan.panels[::columns]]
    headline = wrap(formulas(figure.headline), HEADLINE_LETTERS_PER_MM * figure.width_mm, " ")
    in_cell = _legend_fits_cell(figure, plan, rows, columns)
    height_mm = sum(heights) + _legends_height_mm(figure, plan, rows, columns, in_cell)
    height_mm += HEADLINE_MM * (headline.count("\n") + 1) if headline else 0.0
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0.04, hspace=0.05)
    canvas = Canvas(figsize=(figure.width_mm * MM, height_mm * MM), dpi=PNG_DPI, layout=layout)
    FigureCanvasAgg(canvas)
    if headline:
        canvas.suptitle(headline, x=0.01, ha="left", fontsize=STYLE["font.size"], gid=HEADLINE_ID)
    grid = canvas.subplots(rows, columns, squeeze=False, sharey=figure.share_y, height_ratios=heights)
    end_names = _fill_grid(figure, plan, grid, columns)
    _draw_common_legend(canvas, grid, figure, plan, columns, in_cell)
    with _cache_ticks(canvas):
        layout.execute(canvas)
    canvas.set_layout_engine(None)  # not "none": an engine that does nothing still has savefig draw everything twice
    for names in end_names:
        _separate_names(names)
    return canvas


def _legend_fits_cell(figure: Figure, plan: LegendPlan, rows: int, columns: int) -> bool:
    """Whether the figure's legend fits into a cell of the grid that no panel uses."""
    cell_mm = figure.width_mm / columns - SIDE_MM
    is_free = rows * columns > len(plan.panels)
    return plan.common is not None and is_free and plan.common.height_mm(cell_mm) < figure.panel_height_mm


def _legends_height_mm(figure: Figure, plan: LegendPlan, rows: int, columns: int, in_cell: bool) -> float:
    """Height that legends below the panels add to a figure."""
    height = 0.0
    if plan.common is not None and not in_cell and not plan.stands_beside:
        height += plan.common.height_mm(figure.width_mm)
    legends = [legend for legend in plan.panel_legends if legend is not None]
    return height + rows * max([legend.height_mm(figure.width_mm / columns) for legend in legends], default=0.0)


def _fill_grid(figure: Figure, plan: LegendPlan, grid: np.ndarray, columns: int) -> list[list[Annotation]]:
    """Draw each panel in its cell; the names at the ends of its lines, to be moved apart when the layout is final."""
    end_names: list[list[Annotation]] = []
    cell_mm = figure.width_mm / columns
    map_colours = common_map_colours(plan.panels)
    for n, (axes, panel) in enumerate(zip(grid.flat, plan.panels, strict=False)):
        x, y = _wrap_label(panel.x, cell_mm), _wrap_label(panel.y, figure.panel_height_mm - 5)
        y = replace(y, label="") if figure.share_y and n % columns else y
        title = wrap(panel.title, TITLE_LETTERS_PER_MM * cell_mm)
        _draw_panel(axes, replace(panel, title=title, x=x, y=y), map_colours)
        end_names.append(_name_line_ends(axes, panel) if plan.at_ends[n] else [])
        _draw_legend_below(axes, plan.panel_legends[n], cell_mm)
    for axes in grid.flat[len(plan.panels) :]:
        axes.set_axis_off()
    return end_names


def _draw_common_legend(
    canvas: Canvas, grid: np.ndarray, figure: Figure, plan: LegendPlan, columns: int, in_cell: bool
) -> None:
    """Draw the figure's legend: beside its only panel, in a free cell, or below all panels."""
    if plan.common is None:
        return
    if plan.stands_beside:
        _draw_legend(grid.flat[0], plan.common, 1, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    elif in_cell:
        cell_columns = plan.common.columns(figure.width_mm / columns - SIDE_MM)
        _draw_legend(grid.flat[len(plan.panels)], plan.common, cell_columns, loc="center")
    else:
        _draw_legend(canvas, plan.common, plan.common.columns(figure.width_mm), loc="outside lower center")


@contextmanager
def _cache_ticks(canvas: Canvas) -> Iterator[None]:
    """Place ticks, and measure their numbers, once for each position, size and resolution of a panel.

    Matplotlib places them four times for every axis that it lays out and three times for every one that it draws.
    Meanwhile caching methods replace its own; a version without these methods draws the same, only more slowly."""
    sides = [side for axes in canvas.axes for side in (axes.xaxis, axes.yaxis)]
    for side in sides:
        vars(side).update(_caching_methods(side))
    try:
        yield
    finally:
        for side in sides:
            for name in CACHED_METHODS:
                vars(side).pop(name, None)


def _caching_methods(side: Any) -> dict[str, Callable]:
    """Methods of an axis that keep their last result while its inputs stay the same."""

    def with_cache(method: Callable) -> Callable:
        last_key: tuple[Any, ...] = ()
        last_arguments: tuple[Any, ...] = ()  # kept, so that nothing else gets their ids
        last_result: Any = None

        def cached(*arguments: Any) -> Any:
            nonlocal last_key, last_arguments, last_result
            axes = side.axes
            key = (*side.get_view_interval(), *axes.bbox.bounds, axes.figure.dpi, *map(id, arguments))
            if key != last_key:
                last_key, last_arguments, last_result = key, arguments, method(*arguments)
            return last_result

        return cached

    return {name: with_cache(getattr(side, name)) for name in CACHED_METHODS if hasattr(side, name)}


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Suspend the search for cyclic garbage: a figure is full of cycles, and all of it is needed until the end."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _wrap_label(axis: AxisSpec, length_mm: float) -> AxisSpec:
    """An axis whose label is broken between words where it is longer than the axis."""
    return replace(axis, label=wrap(axis.label, LABEL_LETTERS_PER_MM * length_mm, " "))


def wrap(text: str, letters: float, separator: str = ", ") -> str:
    """Break a text into lines of at most so many letters after separators; where it has none, between words."""
    if letters_in(text) <= letters or "\n" in text:
        return text
    separator = separator if separator in text else " "
    lines: list[str] = []
    for piece in text.split(separator):
        if lines and letters_in(lines[-1]) + len(separator) + letters_in(piece) <= letters:
            lines[-1] += f"{separator}{piece}"
        else:
            lines.append(piece)
    if separator != " ":
        lines = [wrap(line, letters, " ") for line in lines]
    return f"{separator.rstrip()}\n".join(lines)


def _encode(canvas: Canvas, kind: str, figure: Figure, made_by: str) -> bytes:
    """The bytes of a drawn figure in a format, with its title, caption and origin as metadata."""
    title, caption, origin = spoken(figure.title) or None, spoken(figure.caption) or None, made_by or None
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Title": title, "Description": caption, "Creator": origin, "Date": None},
        "pdf": {"Title": title, "Subject": caption, "Keywords": origin, "CreationDate": None},
        "png": {"Title": title, "Description": caption, "Software": origin},
    }
    out = io.BytesIO()
    with matplotlib.rc_context(STYLE | {"svg.hashsalt": figure.name}), _ignore_missing_glyphs():
        canvas.savefig(out, format=kind, dpi=PNG_DPI, metadata=metadata[kind])
    return out.getvalue()


# ---- values for a page -----------------------------------------------------------------------------------------------
def _headline_height_pt(canvas: Canvas) -> float:
    """From the top of a figure to the lower edge of its headline, points; zero without one."""
    headline = next((text for text in canvas.texts if text.get_gid() == HEADLINE_ID), None)
    if headline is None:
        return 0.0
    return float(canvas.bbox.y1 - headline.get_window_extent().y0) * 72 / canvas.dpi


def _value_marks(axes: Axes, panel: Panel) -> list[ValueMark]:
    """Positions and texts of the values of a panel that a reader of a page can point at."""
    marks: list[ValueMark] = []
    for mark in panel.marks:
        if isinstance(mark, Line):
            marks += _line_values(axes, panel, mark)
        elif isinstance(mark, Bars):
            marks += _bar_values(axes, panel, mark)
        elif isinstance(mark, Heat):
            marks += _cell_values(axes, panel, mark)
    return marks


def _line_values(axes: Axes, panel: Panel, line: Line) -> list[ValueMark]:
    """The values at a line's markers, or where they would be; none of a crowd of points."""
    line = _thin_line(line)
    if line.style.dash is None and len(line.x) > MAX_VALUE_MARKS:
        return []
    indices = np.array(_marker_indices(line), int)
    x, y = np.asarray(line.x, float)[indices], np.asarray(line.y, float)[indices]
    with np.errstate(divide="ignore", invalid="ignore"):
        points = _page_points(axes, x, y)
    inside = _inside(axes, points)
    columns = [None if ends is None else np.asarray(ends, float)[indices] for ends in (line.lo, line.hi, line.exact)]
    marks = []
    for n in np.flatnonzero(inside):
        lo, hi, exact = (None if column is None else float(column[n]) for column in columns)
        text = value_text(line.name or line.label, panel, float(x[n]), float(y[n]), lo, hi, exact)
        marks.append(ValueMark(float(points[n, 0]), float(points[n, 1]), text))
    return marks


def _bar_values(axes: Axes, panel: Panel, bars: Bars) -> list[ValueMark]:
    tops = _page_points(axes, np.arange(len(bars.names)), np.asarray(bars.values, float))
    marks = []
    for n, name in enumerate(bars.names):
        lo, hi = (None if ends is None else float(ends[n]) for ends in (bars.lo, bars.hi))
        if np.isfinite(tops[n]).all():
            text = value_text(name, replace(panel, x=AxisSpec("")), math.nan, float(bars.values[n]), lo, hi, None)
            marks.append(ValueMark(float(tops[n, 0]), float(tops[n, 1]), text))
    return marks


def _cell_values(axes: Axes, panel: Panel, heat: Heat) -> list[ValueMark]:
    """The values of a map's cells, unless they are written in, or too many."""
    if not MAX_WRITTEN_CELLS < heat.values.size <= MAX_VALUE_CELLS:
        return []
    corners = _page_points(axes, np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    width, height = np.abs(corners[1] - corners[0]).tolist()
    marks = []
    for (row, column), value in np.ndenumerate(heat.values):
        if np.isfinite(value):
            x, y = _page_points(axes, np.array([column]), np.array([row]))[0].tolist()
            marks.append(ValueMark(x, y, cell_text(panel, heat, row, column), width, height))
    return marks


def _page_points(axes: Axes, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points (n, 2) of the data as points of the SVG, from its upper left corner."""
    canvas = axes.figure
    pixels = axes.transData.transform(np.column_stack([x, y]).astype(float))
    return (pixels * [1, -1] + [0, canvas.bbox.y1]) * 72 / canvas.dpi


def _inside(axes: Axes, points: np.ndarray) -> np.ndarray:
    """Which points of the SVG lie in a panel or on its edge."""
    canvas = axes.figure
    box = Bbox(axes.get_window_extent().get_points() * 72 / canvas.dpi)
    height = canvas.bbox.y1 * 72 / canvas.dpi
    x, y = points[:, 0], height - points[:, 1]
    return (x >= box.x0 - 1) & (x <= box.x1 + 1) & (y >= box.y0 - 1) & (y <= box.y1 + 1)


# ---- panels ----------------------------------------------------------------------------------------------------------
def _draw_panel(axes: Axes, panel: Panel, map_colours: MapColours) -> None:
    """Draw the marks and axes of a panel."""
    axes.set_xscale(panel.x.scale)
    axes.set_yscale(panel.y.scale)
    axes.margins(x=0.02)
    for mark in panel.marks:
        _draw_mark(axes, mark, panel, map_colours)
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label, **(UPRIGHT if SYMBOL.fullmatch(panel.y.label) else {}))
    has_top_notes = any(isinstance(mark, Note) and mark.place == "top" for mark in panel.marks)
    axes.set_title(panel.title, loc="left", fontweight="bold", pad=TOP_NOTE_PT if has_top_notes else None)
    for limits, set_limits in ((panel.x.limits, axes.set_xlim), (panel.y.limits, axes.set_ylim)):
        if limits != (None, None):
            set_limits(*limits)
    if panel.equal:
        is_limited = None not in (*panel.x.limits, *panel.y.limits)
        axes.set_aspect("equal", adjustable="box" if is_limited else "datalim")
    has_cells = any(isinstance(mark, Heat) for mark in panel.marks)
    has_bars = any(isinstance(mark, Bars) for mark in panel.marks)
    _set_ticks(axes.xaxis, panel.x, has_bars or has_cells, scans_of(panel))
    _set_ticks(axes.yaxis, panel.y, has_cells)
    if panel.y.limits == SHARE_LIMITS and panel.x.limits[1] is None:  # a share of one is drawn whole
        for line in axes.lines:
            line.set_clip_on(False)
    if panel.remark:
        axes.set_title(panel.remark, loc="right", fontsize=7)


def _draw_mark(axes: Axes, mark: Mark, panel: Panel, map_colours: MapColours) -> None:
    match mark:
        case Line():
            _draw_line(axes, mark, panel.crosses)
        case Reference():
            _draw_reference(axes, mark, panel.x)
        case Bars():
            _draw_bars(axes, mark)
        case Heat():
            _draw_map(axes, mark, map_colours)
        case Note():
            _draw_note(axes, mark)


def _set_ticks(side: XAxis | YAxis, axis: AxisSpec, has_own_ticks: bool, scans: Scans | None = None) -> None:
    """Set the ticks of an axis: those that it declares; those of its bars or its map; at scans; else round values."""
    if axis.ticks:
        values, labels = zip(*axis.ticks, strict=True)
        side.set_ticks(values, labels)
    elif not has_own_ticks:
        locator = RoundLocator(axis.scale == "log", 6 if side.axis_name == "x" else 5, scans)
        side.set_major_locator(locator)
        side.set_major_formatter(FuncFormatter(lambda value, _: locator.texts.get(value, tick_text(value))))
    side.set_minor_formatter(NullFormatter())


class RoundLocator(Locator):
    """Ticks at round values; where all lines lie on scans, at scans.

    On an axis of x there are at most as many as leave gaps between their numbers. texts: the numbers of the last
    ticks, by their values."""

    def __init__(self, log: bool, tick_count: int, scans: Scans | None = None):
        self.log, self.tick_count, self.scans = log, tick_count, scans
        self.texts: dict[float, str] = {}
        self._last_axis: tuple[float, float, float] | None = None

    def __call__(self) -> list[float]:
        assert self.axis is not None  # Matplotlib sets it before it asks
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """The ticks between two ends."""
        low, high = sorted((float(vmin), float(vmax)))
        axis = (low, high, self._length_pt())
        if axis != self._last_axis:  # Matplotlib asks several times a drawing
            self._last_axis, self.texts = axis, dict(self._spaced_ticks(Scale(self.log, low, high, 0.0, axis[2])))
        return list(self.texts)

    def _spaced_ticks(self, scale: Scale) -> list[tuple[float, str]]:
        """As many ticks as wanted, or fewer that leave gaps between their numbers."""
        if self.scans:
            choices = (scales.scan_ticks(self.scans, count) for count in range(self.tick_count, 1, -1))
            return next((ticks for ticks in choices if has_gaps(scale, ticks)), scales.scan_ticks(self.scans, 1))
        ticks = scale.ticks(self.tick_count)
        for count in range(self.tick_count - 1, 1, -1):
            if has_gaps(scale, ticks):
                break
            ticks = scale.ticks(count)
        while not has_gaps(scale, ticks):
            ticks = ticks[::2]
        return ticks

    def _length_pt(self) -> float:
        """The length of an axis of x, points; infinite for another axis, whose numbers never meet."""
        if not isinstance(self.axis, XAxis):
            return math.inf
        axes = self.axis.axes
        return float(axes.get_window_extent().width) * 72 / axes.figure.dpi


def has_gaps(scale: Scale, ticks: Sequence[tuple[float, str]]) -> bool:
    """Whether the numbers of neighbouring ticks leave a gap; the scale ends at the axis' length in points."""
    if math.isinf(scale.end):
        return True
    half_widths = [LETTER_EM * STYLE["xtick.labelsize"] * len(text) / 2 for _, text in ticks]
    centres = [float(scale.position(value)) for value, _ in ticks]
    neighbours = zip(pairwise(centres), pairwise(half_widths), strict=True)
    return all(c - b >= half_b + half_c + TICK_GAP_PT for (b, c), (half_b, half_c) in neighbours)


def _colour(style: Style) -> str | tuple[float, float, float, float]:
    if isinstance(style.colour, float):
        red, green, blue, alpha = matplotlib.colormaps["viridis"](0.72 * style.colour)
        return red, green, blue, alpha
    return colours.NEUTRAL if style.colour == GREY else colours.COLOURS[style.colour % len(colours.COLOURS)]


def _line_options(style: Style) -> dict[str, Any]:
    """Matplotlib's keywords for a style."""
    marker = None if style.marker is None else MARKERS[style.marker % len(MARKERS)]
    dash = "none" if style.dash is None else DASHES[style.dash % len(DASHES)]
    colour = _colour(style)
    caps = {"solid_capstyle": "butt"} if style.flat else {}
    return {
        **caps,
        **{"color": colour, "linestyle": dash, "linewidth": style.width_pt},
        **{"marker": marker, "markersize": style.size_pt, "mfc": colour if style.dash is None else "white"},
    }


def readable_colour(colour: Any) -> str:
    """A colour for letters: darkened until it stands out from white by 4.5 : 1 (WCAG 2.2)."""
    shade, (red, green, blue) = 1.0, to_rgb(colour)
    while colours.contrast(dark := to_hex((shade * red, shade * green, shade * blue)), "#ffffff") < 4.5:
        shade *= 0.97
    return dark


def _draw_line(axes: Axes, line: Line, crosses: str) -> None:
    line = _thin_line(line)
    if axes.get_yscale() == "log":  # which has no zero
        positive = np.where(np.asarray(line.y) > 0, 1.0, np.nan)
        lo, hi = (None if end is None else end * positive for end in (line.lo, line.hi))
        line = replace(line, y=line.y * positive, lo=lo, hi=hi)
    colour, lone = _colour(line.style), _lone_points(line)
    label = line.label or line.name or None
    axes.plot(line.x, line.y, markevery=_marker_indices(line), zorder=3, label=label, **_line_options(line.style))
    if line.lo is not None and line.hi is not None:
        if line.style.dash is None:
            axes.vlines(line.x, line.lo, line.hi, color=colour, linewidth=0.8, zorder=2.8)
        else:
            axes.fill_between(line.x, line.lo, line.hi, color=colour, alpha=0.25, linewidth=0, zorder=2)
            axes.vlines(line.x[lone], line.lo[lone], line.hi[lone], color=colour, linewidth=0.8)
    if line.exact is not None:
        stride = _marker_stride(line)
        first = 0 if stride == 1 else stride // 2  # markers and crosses alternate
        label = crosses or tr("exact")
        axes.plot(line.x[first::stride], line.exact[first::stride], zorder=4, label=label, **EXACT)


def _marker_stride(line: Line) -> int:
    """From one marker of a line to the next, in points; twice as far where markers and crosses alternate."""
    stride = 1 if line.style.dash is None else max(1, -(-len(line.x) // MAX_MARKERS))
    return stride if line.exact is None or stride == 1 else 2 * stride


def _marker_indices(line: Line) -> list[int]:
    """The points of a line that have a marker."""
    return sorted({*range(0, len(line.x), _marker_stride(line)), *_lone_points(line)})


def _lone_points(line: Line) -> list[int]:
    """The points of a line without a neighbour: neither the line nor its band shows them."""
    return [int(run[0]) for run in unbroken_runs(np.isfinite(line.y)) if len(run) == 1]


def unbroken_runs(flags: np.ndarray) -> list[np.ndarray]:
    """The indices of each unbroken run of true values."""
    indices = np.flatnonzero(flags)
    return [run for run in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if run.size]


def _thin_line(line: Line) -> Line:
    stride = -(-len(line.x) // MAX_POINTS)
    if stride <= 1:
        return line
    columns = {name: getattr(line, name) for name in ("x", "y", "lo", "hi", "exact")}
    return replace(line, **{name: column[::stride] for name, column in columns.items() if column is not None})


REFERENCE_SHARE = 0.2  # of an axis of x: the words of a reference line nearer to its left end stand right of it


def _draw_reference(axes: Axes, mark: Reference, x: AxisSpec) -> None:
    options: dict[str, Any] = {"color": "#555555", "linewidth": 0.7, "linestyle": (0, (2, 2)), "zorder": 1.5}
    text: dict[str, Any] = {"s": f" {mark.label} ", "ha": "right", "va": "bottom", "color": "#555555"}
    if mark.across == "y":
        axes.axhline(mark.value, **options)
        axes.text(0.99, mark.value, transform=axes.get_yaxis_transform(), **text)
    else:
        axes.axvline(mark.value, **options)
        low, high = x.limits
        if low is not None and high is not None:
            share = Scale(x.scale == "log", low, high, 0.0, 1.0).position(mark.value)
            text["ha"] = "left" if share < REFERENCE_SHARE else "right"  # else its words would lie upon the axis
        axes.text(mark.value, 0.02, transform=axes.get_xaxis_transform(), **text)


def _draw_bars(axes: Axes, bars: Bars) -> None:
    positions = np.arange(len(bars.names))
    axes.bar(positions, bars.values, color=_colour(bars.style), alpha=0.75, width=0.65, zorder=2)
    if bars.lo is not None and bars.hi is not None:
        axes.vlines(positions, bars.lo, bars.hi, color="black", linewidth=0.9, zorder=3)
    axes.set_xticks(positions, bars.names)
    axes.grid(False, axis="x")


def common_map_colours(panels: Sequence[Panel]) -> MapColours:
    """The colours of maps: one scale for all maps of a figure whose bars have the same label."""
    return {
        label: LogNorm(scale.low, scale.high) if scale.log else Normalize(scale.low, scale.high)
        for label, scale in scales.heat_scales(panels).items()
    }


def _draw_map(axes: Axes, heat: Heat, map_colours: MapColours) -> None:
    norm = map_colours[heat.label]
    centres = np.arange(len(heat.x)), np.arange(len(heat.y))
    mesh = axes.pcolormesh(*centres, heat.values, cmap="viridis", norm=norm, shading="nearest")
    axes.set_xticks(centres[0], [tick_text(float(v)) for v in heat.x])
    axes.set_yticks(centres[1], [tick_text(float(v)) for v in heat.y])
    axes.grid(False)
    bar = axes.figure.colorbar(mesh, ax=axes, label=heat.label)
    _set_ticks(bar.ax.yaxis, AxisSpec("", "log" if isinstance(norm, LogNorm) else "linear"), False)
    if heat.values.size <= MAX_WRITTEN_CELLS:
        for (i, j), value in np.ndenumerate(heat.values):
            if np.isfinite(value):
                ink = "white" if norm(value) < 0.5 else "black"
                axes.text(j, i, number(float(value), 3), ha="center", va="center", color=ink, fontsize=7)


def _draw_note(axes: Axes, note: Note) -> None:
    if note.place == "top":
        grey: dict[str, Any] = {"color": "#555555", "fontsize": 7, "ha": "center", "va": "bottom"}
        axes.annotate(note.text, (note.x, 1.0), (0, 1.5), axes.get_xaxis_transform(), "offset points", **grey)
        return
    if note.place == "on":
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        axes.text(note.x, note.y, note.text, ha="center", va="center", fontsize=7, zorder=3.5, bbox=box)
        return
    up, right, level = "n" in note.place, "e" in note.place, note.place == "e"
    options: dict[str, Any] = {"ha": "left" if right else "right", "va": "bottom" if up else "top", "fontsize": 7}
    options |= {"va": "center", "annotation_clip": False} if level else {}
    shift = (3 if right else -3, 0 if level else 3 if up else -3)
    axes.annotate(note.text, (note.x, note.y), xytext=shift, textcoords="offset points", **options)


# ---- names and legends -----------------------------------------------------------------------------------------------
def _name_line_ends(axes: Axes, panel: Panel) -> list[Annotation]:
    """Write the names of a panel's lines at their ends."""
    names = []
    for line in named_lines(panel):
        last = np.flatnonzero(np.isfinite(line.y))[-1]
        low, high = sorted(axes.get_ylim())
        y = float(np.clip(line.y[last], low, high))  # a line may end beyond an axis that is cut
        names.append(
            axes.annotate(
                f"{line.label} {BEYOND_ARROWS[int(line.y[last] > high)]}" if y != line.y[last] else line.label,
                (line.x[last], y),
                xytext=(1.015, y),
                textcoords=axes.get_yaxis_transform(),
                va="center",
                color=readable_colour(_colour(line.style)),
                annotation_clip=False,
            )
        )
    return names


def _draw_legend(target: Axes | Canvas, legend: Legend, columns: int, **position: Any) -> None:
    """Draw names and styles, and the crosses of exact values, in so many columns."""
    handles = [Line2D([], [], **(EXACT if style is None else _line_options(style))) for style in legend.keys.values()]
    spacing: dict[str, Any] = {"ncols": columns, "borderaxespad": 0.3, "labelspacing": 0.3, "columnspacing": 1.2}
    names, title = list(legend.keys), legend.title or None
    drawn_legend = target.legend(handles, names, title=title, alignment="left", **position, **spacing)
    # Inside a panel it may not push it to nothing; beside it, it takes its room.
    drawn_legend.set_in_layout(isinstance(target, Canvas) or "bbox_to_anchor" in position)


def _draw_legend_below(axes: Axes, legend: Legend | None, width_mm: float) -> None:
    """Draw the legend of a panel below its axis, no wider than its cell."""
    if legend is None:
        return
    origin = axes.transAxes + ScaledTranslation(0, -AXIS_MM * MM, axes.figure.dpi_scale_trans)
    columns = legend.columns(width_mm)
    _draw_legend(axes, legend, columns, loc="upper left", bbox_to_anchor=(0.0, 0.0), bbox_transform=origin)


def _separate_names(names: list[Annotation]) -> None:
    """Move names at line ends apart, up and down, in their order; within the panel where they fit."""
    if not names:
        return
    axes = names[0].axes
    assert axes is not None  # every name is written into a panel
    box = axes.get_window_extent()
    step = 1.2 * STYLE["font.size"] * axes.figure.dpi / 72
    line_ends = [axes.transData.transform(name.xy)[1] for name in names]
    order = np.argsort(line_ends, kind="stable")
    positions = spread_positions(np.array(line_ends)[order], step, box.y0 + step / 2, box.y1 - step / 2)
    for i, y in zip(order, positions, strict=True):
        names[i].set_position((1.015, axes.transAxes.inverted().transform((0, y))[1]))
        names[i].xyann = (1.015, axes.transAxes.inverted().transform((0, y))[1])
        names[i].anncoords = "axes fraction"


def spread_positions(targets: np.ndarray, step: float, low: float, high: float) -> np.ndarray:
    """Rising positions at least `step` apart, nearest to the targets (rising) in squares, inside low … high.

    Pool-adjacent-violators on positions less their own multiple of the step."""
    offsets = step * np.arange(len(targets))
    groups: list[list[float]] = []
    for value in np.clip(targets, low, high) - offsets:
        groups.append([value])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    free = np.concatenate([np.full(len(group), np.mean(group)) for group in groups])
    return np.clip(free, low, max(low, high - offsets[-1])) + offsets
