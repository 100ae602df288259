"""Names at the ends of lines, and legends, drawn on Matplotlib's axes."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.transforms import ScaledTranslation

from radarsim.report.drawing.legend_placement import Legend, named_lines
from radarsim.report.drawing.model import Panel
from radarsim.report.drawing.style import AXIS_MM, EXACT, MM, STYLE, line_options, readable_colour, style_colour

BEYOND_ARROWS = ("↓", "↑")  # after the name of a line that ends below or above its axis


def name_line_ends(axes: Axes, panel: Panel) -> list[Annotation]:
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
                color=readable_colour(style_colour(line.style)),
                annotation_clip=False,
            )
        )
    return names


def draw_legend(
    target: Axes | Canvas, legend: Legend, width_mm: float, columns: int | None = None, **position: Any
) -> None:
    """Draw names and styles, and the crosses of exact values, no wider than asked, in as many columns as fit."""
    handles = [Line2D([], [], **(EXACT if style is None else line_options(style))) for style in legend.keys.values()]
    spacing: dict[str, Any] = {"borderaxespad": 0.3, "labelspacing": 0.3, "columnspacing": 1.2}
    spacing["ncols"] = columns or legend.columns(width_mm)
    names, title = legend.names(width_mm), legend.title or None
    drawn_legend = target.legend(handles, names, title=title, alignment="left", **position, **spacing)
    # Inside a panel it may not push it to nothing; beside it, it takes its room.
    drawn_legend.set_in_layout(isinstance(target, Canvas) or "bbox_to_anchor" in position)


def draw_legend_below(axes: Axes, legend: Legend | None, width_mm: float) -> None:
    """Draw the legend of a panel below its axis, no wider than asked."""
    if legend is None:
        return
    origin = axes.transAxes + ScaledTranslation(0, -AXIS_MM * MM, axes.figure.dpi_scale_trans)
    draw_legend(axes, legend, width_mm, loc="upper left", bbox_to_anchor=(0.0, 0.0), bbox_transform=origin)


def separate_names(names: list[Annotation]) -> None:
    """Move names at line ends apart, up and down, in their order; within the panel where they fit."""
    if not names:
        return
    axes = names[0].axes
    assert axes is not None  # every name is written into a panel
    box = axes.get_window_extent()
    row = 1.2 * STYLE["font.size"] * axes.figure.dpi / 72
    line_ends = [axes.transData.transform(name.xy)[1] for name in names]
    order = np.argsort(line_ends, kind="stable")
    heights = np.array([row * (names[i].get_text().count("\n") + 1) for i in order])
    steps = (heights[1:] + heights[:-1]) / 2
    low, high = box.y0 + heights[0] / 2, box.y1 - heights[-1] / 2
    positions = spread_positions(np.array(line_ends)[order], steps, low, high)
    for i, y in zip(order, positions, strict=True):
        names[i].set_position((1.015, axes.transAxes.inverted().transform((0, y))[1]))
        names[i].xyann = (1.015, axes.transAxes.inverted().transform((0, y))[1])
        names[i].anncoords = "axes fraction"


def spread_positions(targets: np.ndarray, steps: np.ndarray, low: float, high: float) -> np.ndarray:
    """Rising positions (n,) at least `steps` (n - 1,) apart, nearest to the targets (n,), rising, in squares, inside
    low … high.

    Pool-adjacent-violators on positions less the sum of the steps before them."""
    offsets = np.append(0.0, np.cumsum(steps))
    groups: list[list[float]] = []
    for value in np.clip(targets, low, high) - offsets:
        groups.append([value])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    free = np.concatenate([np.full(len(group), np.mean(group)) for group in groups])
    return np.clip(free, low, max(low, high - offsets[-1])) + offsets
