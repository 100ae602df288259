"""Figures drawn with Matplotlib, as files or for a page.

The bytes of an SVG depend only on the data and on the versions of Matplotlib and its fonts."""

import gc
import io
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Annotation

from radarsim.errors import ConfigError
from radarsim.language.translate import tr
from radarsim.report.drawing.crowded_panels import with_names_at_ends
from radarsim.report.drawing.legend_placement import LegendPlan, at_width, longest_name, plan_legends
from radarsim.report.drawing.line_names import draw_legend, draw_legend_below, name_line_ends, separate_names
from radarsim.report.drawing.marks import common_map_colours, draw_panel
from radarsim.report.drawing.model import GREY, Figure, Line, Mark, Panel, Reference
from radarsim.report.drawing.narrow_panels import fit_rows, stack_top_notes
from radarsim.report.drawing.page_figure import HEADLINE_ID, DrawnFigure
from radarsim.report.drawing.page_values import headline_height_pt, value_marks
from radarsim.report.drawing.style import (
    END_LETTER_MM,
    HEADLINE_LETTERS_PER_MM,
    HEADLINE_MM,
    LABELS_MM,
    MM,
    PNG_DPI,
    SIDE_MM,
    STYLE,
    TITLE_LETTERS_PER_MM,
    wrap,
    wrap_label,
)
from radarsim.report.drawing.word_overlaps import overlapping_words
from radarsim.report.math_text import plain_text, with_formulas
from radarsim.report.wording import with_unbroken_units

FILE_STYLE: Any = {name: STYLE[name] for name in ("pdf.fonttype", "ps.fonttype", "svg.fonttype")}
WIDTH_STEP_MM = 5.0  # by which a width is increased at which something would be cut, or the figure taller than a page
MAX_BESIDE_SHARE = 0.45  # of a figure's width, for a legend beside its panel
A4_HEIGHT_MM = 297.0
LEAST_PANEL_MM = 15.0  # width of its axes
ROUNDING_INCHES = 1e-3
CACHED_METHODS = ("_update_ticks", "_get_ticklabel_bboxes")  # of Matplotlib's axes; arguments: none; ticks, renderer


class PrintableFigure(Canvas):
    """A figure of Matplotlib that embeds fonts in its files as the command does, however it is saved."""

    def savefig(self, *arguments: Any, **options: Any) -> None:
        """Save the figure; see Matplotlib."""
        with matplotlib.rc_context(FILE_STYLE):
            super().savefig(*arguments, **options)


def render(figure: Figure) -> Canvas:
    """Draw a figure with Matplotlib, laid out at its size in millimetres."""
    with matplotlib.rc_context(STYLE), _ignore_missing_glyphs():
        figure = with_names_at_ends(fit_rows(figure))
        return _layout(figure, plan_legends(figure))


def save(
    figure: Figure, formats: Iterable[str] = ("svg",), width_mm: float | None = None, made_by: str = ""
) -> dict[str, bytes]:
    """Return the bytes of the figure in each format ("svg", "png" at 200 dpi, "pdf"), the same for the same data.

    At another width its letters keep their size; a width at which they would be cut is increased. Title, caption and
    made_by (sources and versions) are in each file's metadata."""
    with _no_garbage_collection():
        figure, canvas = render_at(figure, width_mm)
        with _cache_ticks(canvas):
            return {kind: _encode(canvas, kind, figure, made_by) for kind in formats}


def draw(
    figure: Figure, formats: Iterable[str] = ("svg",), width_mm: float | None = None, made_by: str = ""
) -> DrawnFigure:
    """Draw a figure once: its files as `save` returns them, and what a page shows of the same drawing.

    The width of the figure that is returned is that of the drawing."""
    kinds = list(formats)
    with _no_garbage_collection():
        figure, canvas = render_at(figure, width_mm)
        with _cache_ticks(canvas):
            encoded = {kind: _encode(canvas, kind, figure, made_by) for kind in dict.fromkeys((*kinds, "svg"))}
    panels = [panel for panel in figure.panels if panel.marks]
    groups = {n: value_marks(axes, panel) for n, (axes, panel) in enumerate(zip(canvas.axes, panels, strict=False))}
    values = [(plain_text(panels[n].title), tuple(marks)) for n, marks in groups.items() if marks]
    files = {kind: encoded[kind] for kind in kinds}
    return DrawnFigure(figure, files, encoded["svg"], tuple(values), headline_height_pt(canvas))


def render_at(figure: Figure, width_mm: float | None) -> tuple[Figure, Canvas]:
    """The figure at a width, or at the next larger one at which nothing is cut and no words meet, and its drawing.

    A figure has fewer columns rather than a larger width."""
    narrow = at_width(figure, width_mm)
    panel_count = sum(bool(panel.marks) for panel in figure.panels)
    while narrow.width_mm < figure.width_mm:
        for columns in range(narrow.columns, 0, -1):
            fewer_columns = at_width(replace(figure, columns=columns), narrow.width_mm)
            if -(-panel_count // columns) * fewer_columns.panel_height_mm > A4_HEIGHT_MM:
                break
            canvas = render(fewer_columns)
            if _is_whole(canvas, panel_count):
                return fewer_columns, canvas
        narrow = at_width(figure, min(narrow.width_mm + WIDTH_STEP_MM, figure.width_mm))
    return narrow, render(narrow)


def _is_whole(canvas: Canvas, panel_count: int) -> bool:
    """Whether all that is drawn lies within the figure, no words meet, its panels have room, and it is no taller than
    a page."""
    box, page = canvas.get_tightbbox(), canvas.bbox_inches
    if page.height > A4_HEIGHT_MM * MM:
        return False
    is_inside = min(box.x0, box.y0, page.x1 - box.x1, page.y1 - box.y1) > -ROUNDING_INCHES
    has_room = all(axes.bbox.width / canvas.dpi > LEAST_PANEL_MM * MM for axes in canvas.axes[:panel_count])
    return is_inside and has_room and not overlapping_words(canvas)


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
            draw_panel(target, _additional_panel(panel, len(names), label), map_colours)
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


def _layout(figure: Figure, plan: LegendPlan) -> Canvas:
    """Draw all panels and legends of a figure, and fix their positions."""
    columns = min(figure.columns, len(plan.panels))
    rows = -(-len(plan.panels) // columns)
    heights = [panel.height_mm or figure.panel_height_mm for panel in plan.panels[::columns]]
    headline = wrap(with_formulas(with_unbroken_units(figure.headline)), HEADLINE_LETTERS_PER_MM * figure.width_mm, " ")
    in_cell = _legend_fits_cell(figure, plan, rows, columns)
    height_mm = sum(heights) + _legends_height_mm(figure, plan, rows, columns, in_cell)
    height_mm += HEADLINE_MM * (headline.count("\n") + 1) if headline else 0.0
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0.04, hspace=0.05)
    canvas = PrintableFigure(figsize=(figure.width_mm * MM, height_mm * MM), dpi=PNG_DPI, layout=layout)
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
        separate_names(names)
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
    cell_mm = figure.width_mm / columns - LABELS_MM
    return height + rows * max([legend.height_mm(cell_mm) for legend in legends], default=0.0)


def _fill_grid(figure: Figure, plan: LegendPlan, grid: np.ndarray, columns: int) -> list[list[Annotation]]:
    """Draw each panel in its cell; the names at the ends of its lines, to be moved apart when the layout is final."""
    end_names: list[list[Annotation]] = []
    cell_mm = figure.width_mm / columns
    map_colours = common_map_colours(plan.panels)
    for n, (axes, panel) in enumerate(zip(grid.flat, plan.panels, strict=False)):
        x, y = wrap_label(panel.x, cell_mm), wrap_label(panel.y, figure.panel_height_mm - 5)
        y = replace(y, label="") if figure.share_y and n % columns else y
        title = wrap(with_unbroken_units(panel.title), TITLE_LETTERS_PER_MM * cell_mm)
        length_mm = cell_mm - SIDE_MM - (END_LETTER_MM * longest_name(panel) if plan.at_ends[n] else 0.0)
        draw_panel(axes, stack_top_notes(replace(panel, title=title, x=x, y=y), length_mm), map_colours)
        end_names.append(name_line_ends(axes, panel) if plan.at_ends[n] else [])
        draw_legend_below(axes, plan.panel_legends[n], cell_mm - LABELS_MM)
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
        width_mm = MAX_BESIDE_SHARE * figure.width_mm
        draw_legend(grid.flat[0], plan.common, width_mm, 1, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    elif in_cell:
        draw_legend(grid.flat[len(plan.panels)], plan.common, figure.width_mm / columns - SIDE_MM, loc="center")
    else:
        draw_legend(canvas, plan.common, figure.width_mm, loc="outside lower center")


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


def _encode(canvas: Canvas, kind: str, figure: Figure, made_by: str) -> bytes:
    """The bytes of a drawn figure in a format, with its title, caption and origin as metadata."""
    title, caption, origin = plain_text(figure.title) or None, plain_text(figure.caption) or None, made_by or None
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Title": title, "Description": caption, "Creator": origin, "Date": None},
        "pdf": {"Title": title, "Subject": caption, "Keywords": origin, "CreationDate": None},
        "png": {"Title": title, "Description": caption, "Software": origin},
    }
    out = io.BytesIO()
    with matplotlib.rc_context(STYLE | {"svg.hashsalt": figure.name}), _ignore_missing_glyphs():
        canvas.savefig(out, format=kind, dpi=PNG_DPI, metadata=metadata[kind])
    return out.getvalue()
