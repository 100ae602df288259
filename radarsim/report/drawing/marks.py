"""A panel's marks, drawn on Matplotlib's axes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import FuncNorm, LogNorm, Normalize
from matplotlib.patches import Rectangle

from radarsim.language.translate import tr
from radarsim.report.drawing import scales
from radarsim.report.drawing.line_points import lone_points, marker_indices, marker_stride, rough_points, thin_line
from radarsim.report.drawing.model import Axis as AxisSpec
from radarsim.report.drawing.model import Bars, Heat, Line, Mark, Note, Panel, Reference
from radarsim.report.drawing.scales import Scale, scans_of, tick_text
from radarsim.report.drawing.style import (
    AXIS_BREAK,
    BEST_CELL,
    EXACT,
    ROUGH,
    SYMBOL,
    TOP_NOTE_PT,
    TOP_ROW_PT,
    UPRIGHT,
    line_options,
    style_colour,
)
from radarsim.report.drawing.ticks import set_ticks
from radarsim.report.wording import number

MapColours = dict[tuple[str, str], Normalize]  # colour scales of maps, by the label of their bar and their group
MAX_WRITTEN_CELLS = 100  # of a map, whose values are written in
SHARE_LIMITS = (0, 1)
MARGIN, WHISKER_MARGIN = 0.02, 0.06  # of an axis of x, beside its marks


def draw_panel(axes: Axes, panel: Panel, map_colours: MapColours) -> None:
    """Draw the marks and axes of a panel."""
    axes.set_xscale(panel.x.scale)
    axes.set_yscale(panel.y.scale)
    axes.margins(x=_side_margin(panel))
    for mark in panel.marks:
        _draw_mark(axes, mark, panel, map_colours)
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label, **(UPRIGHT if SYMBOL.fullmatch(panel.y.label) else {}))
    top_rows = 1 + max((mark.row for mark in panel.marks if isinstance(mark, Note) and mark.place == "top"), default=-1)
    title_pad = TOP_NOTE_PT + TOP_ROW_PT * (top_rows - 1) if top_rows else None
    axes.set_title(panel.title, loc="left", fontweight="bold", pad=title_pad)
    for limits, set_limits in ((panel.x.limits, axes.set_xlim), (panel.y.limits, axes.set_ylim)):
        if limits != (None, None):
            set_limits(*limits)
    if panel.equal:
        is_limited = None not in (*panel.x.limits, *panel.y.limits)
        axes.set_aspect("equal", adjustable="box" if is_limited else "datalim")
    has_cells = any(isinstance(mark, Heat) for mark in panel.marks)
    has_bars = any(isinstance(mark, Bars) for mark in panel.marks)
    set_ticks(axes.xaxis, panel.x, has_bars or has_cells, scans_of(panel))
    set_ticks(axes.yaxis, panel.y, has_cells)
    if panel.y.limits == SHARE_LIMITS and panel.x.limits[1] is None:  # a share of one is drawn whole
        for line in axes.lines:
            line.set_clip_on(False)
    if panel.y.scale == "linear" and axes.get_ylim()[0] > 0 and not (panel.y.ticks or has_cells or panel.equal):
        axes.plot([0], [0.03], transform=axes.transAxes, **AXIS_BREAK)
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


def _side_margin(panel: Panel) -> float:
    """The share of an axis of x beside its marks; more where the whiskers of a lone point would lie upon the axis."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line)]
    x = [float(x) for line in lines for x in line.x if np.isfinite(x)]
    ends = (min(x), max(x)) if x else ()
    has_whiskers = any(line.lo is not None and line.x[i] in ends for line in lines for i in lone_points(line))
    return WHISKER_MARGIN if has_whiskers else MARGIN


def _draw_line(axes: Axes, line: Line, crosses: str) -> None:
    line = thin_line(line)
    if axes.get_yscale() == "log":  # which has no zero
        positive = np.where(np.asarray(line.y) > 0, 1.0, np.nan)
        lo, hi = (None if end is None else end * positive for end in (line.lo, line.hi))
        line = replace(line, y=line.y * positive, lo=lo, hi=hi)
    rough = rough_points(line)
    if rough.any():
        _draw_rough_points(axes, line, rough)
        line = replace(line, y=np.where(rough, np.nan, line.y))
    colour, lone = style_colour(line.style), lone_points(line)
    label = line.label or line.name or None
    axes.plot(line.x, line.y, markevery=marker_indices(line), zorder=3, label=label, **line_options(line.style))
    if line.lo is not None and line.hi is not None:
        if line.style.dash is None:
            axes.vlines(line.x, line.lo, line.hi, color=colour, linewidth=0.8, zorder=2.8)
        else:
            if line.has_band:
                axes.fill_between(line.x, line.lo, line.hi, color=colour, alpha=0.25, linewidth=0, zorder=2)
            axes.vlines(line.x[lone], line.lo[lone], line.hi[lone], color=colour, linewidth=0.8)
    if line.exact is not None:
        stride = marker_stride(line)
        first = 0 if stride == 1 else stride // 2  # markers and crosses alternate
        label = crosses or tr("exact")
        axes.plot(line.x[first::stride], line.exact[first::stride], zorder=4, label=label, **EXACT)


def _draw_rough_points(axes: Axes, line: Line, rough: np.ndarray) -> None:
    """Draw the points that a note marks as unreliable, and the line to their neighbours: thin, with open markers."""
    near = rough | np.append(rough[1:], False) | np.append(False, rough[:-1])
    indices = [i for i in marker_indices(line) if rough[i]]
    options = line_options(line.style) | ROUGH
    axes.plot(line.x, np.where(near, line.y, np.nan), markevery=indices, zorder=2.9, **options)


REFERENCE_SHARE = 0.2  # of an axis of x: the words of a reference line nearer to its left end stand right of it


def _draw_reference(axes: Axes, mark: Reference, x: AxisSpec) -> None:
    options: dict[str, Any] = {"color": "#555555", "linewidth": 0.7, "linestyle": (0, (2, 2)), "zorder": 1.5}
    text: dict[str, Any] = {"s": f" {mark.label} ", "ha": "right", "va": "bottom", "color": "#555555"}
    if mark.axis_name == "y":
        axes.axhline(mark.value, **options)
        if mark.label:  # an empty text beyond the axis would take room too
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
    patches = axes.bar(positions, bars.values, color=style_colour(bars.style), alpha=0.75, width=0.65, zorder=2)
    if bars.lo is not None and bars.hi is not None:
        for patch, low, high in zip(patches, bars.lo, bars.hi, strict=True):
            if np.isnan(low) and np.isnan(high):  # rough
                patch.set(facecolor="none", edgecolor=style_colour(bars.style), linewidth=0.8)
        axes.vlines(positions, bars.lo, bars.hi, color="black", linewidth=0.9, zorder=3)
    axes.set_xticks(positions, bars.names)
    axes.grid(False, axis="x")


def common_map_colours(panels: Sequence[Panel]) -> MapColours:
    """The colours of maps: one scale for all maps of a figure of a group whose bars have the same label."""
    return {key: _colours(scale) for key, scale in scales.heat_scales(panels).items()}


class LossNorm(FuncNorm):
    """Colours of shares near one, by the logarithm of their difference from it."""

    def __init__(self, scale: scales.HeatScale):
        super().__init__((scale.loss_decades, scale.share), scale.low, scale.high)
        self.ticks = scale.loss_ticks()


def _colours(scale: scales.HeatScale) -> Normalize:
    if scale.least_loss:
        return LossNorm(scale)
    return LogNorm(scale.low, scale.high) if scale.log else Normalize(scale.low, scale.high)


def _draw_map(axes: Axes, heat: Heat, map_colours: MapColours) -> None:
    norm = map_colours[heat.label, heat.group]
    centres = np.arange(len(heat.x)), np.arange(len(heat.y))
    mesh = axes.pcolormesh(*centres, heat.values, cmap="viridis", norm=norm, shading="nearest")
    axes.set_xticks(centres[0], [tick_text(float(v)) for v in heat.x])
    axes.set_yticks(centres[1], [tick_text(float(v)) for v in heat.y])
    axes.grid(False)
    bar = axes.figure.colorbar(mesh, ax=axes, label=heat.label)
    ticks = norm.ticks if isinstance(norm, LossNorm) else ()
    set_ticks(bar.ax.yaxis, AxisSpec("", "log" if isinstance(norm, LogNorm) else "linear", ticks=ticks), False)
    for i, j in best_cells(heat):
        axes.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, clip_on=False, **BEST_CELL))
    if heat.values.size <= MAX_WRITTEN_CELLS:
        for (i, j), value in np.ndenumerate(heat.values):
            if np.isfinite(value):
                ink = "white" if norm(value) < 0.5 else "black"
                axes.text(j, i, _cell_text(heat, i, j), ha="center", va="center", color=ink, fontsize=7)


def _cell_text(heat: Heat, i: int, j: int) -> str:
    """A cell's value, and under it half the width of its interval where that is known; to as many places as give three
    digits of the greatest value."""
    value = float(heat.values[i, j])
    if heat.half_widths is None:
        return number(value, 3)
    greatest = float(np.nanmax(np.abs(heat.values)))
    places = max(0, 2 - math.floor(math.log10(greatest))) if greatest > 0 else 0
    half_width, unit = float(heat.half_widths[i, j]), 10.0**places
    text = number(round(value, places) + 0.0, 6)
    return text if math.isnan(half_width) else f"{text}\n±{number(math.ceil(half_width * unit) / unit, 6)}"


def best_cells(heat: Heat) -> list[tuple[int, int]]:
    """The cells of a map of errors whose value, as it is written, is the least one: row and column. None if more than
    half of the cells have it."""
    if not (heat.is_error and np.isfinite(heat.values).any()):
        return []
    written = [(cell, _cell_text(heat, *cell).partition("\n")[0]) for cell in np.ndindex(*heat.values.shape)]
    least = written[int(np.nanargmin(heat.values))][1]
    best = [cell for cell, text in written if text == least]
    return best if 2 * len(best) <= len(written) else []


def _draw_note(axes: Axes, note: Note) -> None:
    if note.place == "top":
        grey: dict[str, Any] = {"color": "#555555", "fontsize": 7, "ha": "center", "va": "bottom"}
        axes.annotate(
            note.text,
            (note.x, 1.0),
            (0, 1.5 + TOP_ROW_PT * note.row),
            axes.get_xaxis_transform(),
            "offset points",
            **grey,
        )
        return
    if note.place == "row":
        options: dict[str, Any] = {"fontsize": 7, "va": "bottom", "annotation_clip": False, "zorder": 1.8}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}
        place: dict[str, Any] = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
        axes.annotate(note.text, (0.0, note.y), xytext=(0, 4.5), bbox=box, **place, **options)
        return
    if note.place == "on":
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        axes.text(note.x, note.y, note.text, ha="center", va="center", fontsize=7, zorder=3.5, bbox=box)
        return
    up, right, level = "n" in note.place, "e" in note.place, note.place == "e"
    options = {"ha": "left" if right else "right", "va": "bottom" if up else "top", "fontsize": 7}
    options |= {"va": "center", "annotation_clip": False} if level else {}
    shift = 3.0 if right else -3.0, 0.0 if level else 3.0 if up else -3.0
    axes.annotate(note.text, (note.x, note.y), xytext=shift, textcoords="offset points", **options)
