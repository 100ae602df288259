"""Pieces of a page's charts: paths, samples of lines, text; how far a mark reaches, and what of it is drawn."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from radarsim.report import chart_look as look
from radarsim.report.chart_scale import tick_text
from radarsim.report.chart_text import tspans
from radarsim.report.drawing import Bars, Heat, Line, Mark, Panel, Reference, Style

SIZE = 12.0  # of the letters, in units of the SVG
DIGITS = ".5g"  # of the numbers that a pointer reads off


def sample(style: Style) -> Markup:
    """A short piece of a line for the legend."""
    parts = Markup('<path class="l" d="M1 7h28"{}/>').format(dashed(style)) if style.dash is not None else Markup("")
    if style.marker is not None:
        parts += markers([(15.0, 7.0)], style)
    return Markup('<svg class="k" viewBox="0 0 30 14" aria-hidden="true"{}>{}</svg>').format(ink(style), parts)


def ink(style: Style) -> Markup:
    """The colours of a light and of a dark page, as an attribute."""
    return Markup(' style="--c:{};--d:{}"').format(*look.ink(style))


def dashed(style: Style) -> Markup:
    """The dash, as an attribute; nothing for a whole line and for none."""
    if style.dash is None:
        return Markup("")
    dash = look.DASHES[style.dash % len(look.DASHES)]
    return Markup(' stroke-dasharray="{}"').format(dash) if dash else Markup("")


def markers(places: Sequence[tuple[float, float]], style: Style) -> Markup:
    """A style's marker at each place, all as one path; nothing where it has none."""
    if style.marker is None:
        return Markup("")
    shape = look.MARKERS[style.marker % len(look.MARKERS)]
    full = "f" if style.dash is None else "m"
    path = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in places)
    return Markup('<path class="{}" d="{}"/>').format(full, path)


def extent(mark: Mark) -> tuple[np.ndarray, np.ndarray]:
    """What a mark adds to the limits of x and of y."""
    none = np.zeros(0)
    match mark:
        case Line():
            ends = [part for part in (mark.lo, mark.hi) if part is not None]
            return np.asarray(mark.x, float), np.concatenate([np.asarray(part, float) for part in (mark.y, *ends)])
        case Reference():
            return (none, np.array([mark.value])) if mark.across == "y" else (np.array([mark.value]), none)
        case Bars():
            ends = [part for part in (mark.lo, mark.hi) if part is not None]
            return np.array([-0.5, len(mark.names) - 0.5]), np.concatenate([[0.0], mark.values, *ends])
        case Heat():
            return np.array([-0.5, len(mark.x) - 0.5]), np.array([-0.5, len(mark.y) - 0.5])
    return none, none


def by_number(panel: Panel) -> Panel:
    """A panel of bars or of a map: its places are numbers of columns and rows, whatever their values."""
    mark = next(mark for mark in panel.marks if isinstance(mark, Heat | Bars))
    if isinstance(mark, Bars):
        return replace(panel, x=replace(panel.x, scale="linear", ticks=tuple(enumerate(mark.names))))
    axes = {}
    for which, values in (("x", mark.x), ("y", mark.y)):
        axis = getattr(panel, which)
        named = axis.ticks or tuple((i, tick_text(float(v))) for i, v in enumerate(values))
        axes[which] = replace(axis, scale="linear", limits=(-0.5, len(values) - 0.5), ticks=named)
    return replace(panel, **axes)


def thinned(line: Line, points: int) -> dict[str, np.ndarray]:
    """The line's columns, every n-th point of a long one, its last point always."""
    parts = {name: getattr(line, name) for name in ("x", "y", "lo", "hi", "exact")}
    kept = np.arange(len(line.x))
    if len(kept) > points:
        kept = np.unique(np.append(kept[:: -(-len(kept) // points)], len(kept) - 1))
    return {name: np.asarray(part, dtype=float)[kept] for name, part in parts.items() if part is not None}


def places(x: np.ndarray, y: np.ndarray) -> list[tuple[float, float]]:
    """The finite points."""
    return [(a, b) for a, b in zip(x.tolist(), y.tolist(), strict=True) if np.isfinite(a) and np.isfinite(b)]


def path(x: np.ndarray, y: np.ndarray) -> str:
    """A polyline through the finite points, in tenths of a unit, started again after a gap."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    there = np.isfinite(x) & np.isfinite(y)
    tenths = np.stack([np.where(there, np.round(10 * v), 0) for v in (x, np.clip(y, -1e5, 1e5))]).astype(np.int64)
    parts, before = [], None
    for a, b, here in zip(*tenths.tolist(), there.tolist(), strict=True):
        if not here:
            before = None
        elif before is None:
            parts.append(f"M{a / 10:g} {b / 10:g}")
            before = a, b
        else:
            parts.append(f"l{(a - before[0]) / 10:g} {(b - before[1]) / 10:g}")
            before = a, b
    return "".join(parts)


def runs(there: np.ndarray) -> list[np.ndarray]:
    """The places of each unbroken run of true values."""
    places = np.flatnonzero(there)
    return [part for part in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if part.size]


def short(values: np.ndarray) -> list[float | None]:
    """Numbers for the pointer: five digits, nothing where not finite."""
    return [float(format(v, DIGITS)) if np.isfinite(v) else None for v in np.asarray(values, dtype=float).tolist()]


def text(x: float, y: float, text: str, anchor: str, css: str = "", data: tuple[str, float] | None = None) -> Markup:
    """Text at a place, a line below the other; data: the axis and the value that it is the tick of."""
    named = Markup(' class="{}"').format(css) if css else Markup("")
    named += Markup(' data-{}="{:.9g}"').format(Markup(data[0]), data[1]) if data else Markup("")
    return Markup("").join(
        Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="{}"{}>{}</text>').format(
            x, y + 1.15 * n * SIZE, anchor, named, tspans(line, SIZE)
        )
        for n, line in enumerate(text.split("\n"))
    )
