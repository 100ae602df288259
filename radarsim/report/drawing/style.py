"""Type, sizes, dashes and markers of figures.

Every figure is legible in grey: the colours are steps of lightness, and dash and marker make the same distinction."""

import re
from dataclasses import replace
from typing import Any

import matplotlib
from matplotlib.colors import to_hex, to_rgb

from radarsim.report.drawing import colours
from radarsim.report.drawing.model import GREY, Style
from radarsim.report.drawing.model import Axis as AxisSpec
from radarsim.report.math_text import letters_in

ROW_MM, LETTER_MM, SAMPLE_MM = 3.5, 1.45, 12.0  # of a legend: a row, a letter, the sample of a line with its gaps
MM = 1 / 25.4  # inches
PNG_DPI = 200
DASHES = ("-", (0, (5, 1.8)), (0, (1.3, 1.3)), (0, (6, 1.6, 1.3, 1.6)), (0, (9, 2.5)), (0, (3, 1.2, 1, 1.2, 1, 1.2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", "h", ">", "d", "p")  # no multiple of the colours
TITLE_LETTERS_PER_MM = 0.45  # of a panel's cell with its axis, in the bold of titles
HEADLINE_LETTERS_PER_MM, HEADLINE_MM = 0.64, 3.6  # of a figure's width; height of a line
LABEL_LETTERS_PER_MM = 0.62  # of an axis, in the letters of labels
AXIS_MM = 9.0  # of the ticks and the label of an axis of x
LABELS_MM = 11.0  # of the ticks and the label of an axis of y
SIDE_MM = 14.0  # of those of an axis of y, with the gap to the next panel
LETTER_EM = 0.62  # mean width of a digit, in its size
NAME_LETTER_MM, NAME_LINE_MM = 1.32, 3.4  # of names above rows and panels: a letter, a line
END_LETTER_MM = 1.45  # of names at the ends of lines
TOP_NOTE_PT = 14.0  # from a panel to its title, where notes stand along its top
TOP_ROW_PT = 9.0  # between two rows of such notes
TICK_GAP_PT = 3.0  # between numbers of ticks
SYMBOL = re.compile(r"\$\\?\w+\$")  # a label that is one letter stands upright: on its side Λ would read as <
UPRIGHT: dict[str, Any] = {"rotation": 0, "ha": "right", "va": "center"}
EXACT: dict[str, Any] = {
    "linestyle": "none",
    "marker": "+",
    "color": "black",
    "markersize": 4.2,
    "markeredgewidth": 0.6,
}
AXIS_BREAK: dict[str, Any] = {  # two strokes across an axis that does not begin at zero
    "marker": ((-1, -0.9), (1, -0.1), (-1, 0.1), (1, 0.9)),
    "color": "black",
    "markersize": 5,
    "markerfacecolor": "none",
    "markeredgewidth": 0.6,
    "clip_on": False,
    "zorder": 5,
}
BEST_CELL: dict[str, Any] = {"fill": False, "edgecolor": "#d62828", "linewidth": 1.8, "zorder": 4}
ROUGH: dict[str, Any] = {"linewidth": 0.5, "alpha": 0.6, "markeredgewidth": 0.5, "mfc": "white"}
ROUGH_KEY = Style(GREY, 0, 0, width_pt=0.5)
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
    "pdf.fonttype": 42,  # fonts that a publisher can use
    "ps.fonttype": 42,
}


def wrap_label(axis: AxisSpec, length_mm: float) -> AxisSpec:
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


def style_colour(style: Style) -> str | tuple[float, float, float, float]:
    """Matplotlib's colour of a style: one of the palette, grey, or a shade of a colour map."""
    if isinstance(style.colour, float):
        red, green, blue, alpha = matplotlib.colormaps["viridis"](0.72 * style.colour)
        return red, green, blue, alpha
    return colours.NEUTRAL if style.colour == GREY else colours.COLOURS[style.colour % len(colours.COLOURS)]


def line_options(style: Style) -> dict[str, Any]:
    """Matplotlib's keywords for a style."""
    marker = None if style.marker is None else MARKERS[style.marker % len(MARKERS)]
    dash = "none" if style.dash is None else DASHES[style.dash % len(DASHES)]
    colour = style_colour(style)
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
