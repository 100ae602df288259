"""Draws report/drawing.py's figures for the page: small SVGs, one for each panel, and the numbers for the pointer's
readout.

Its parts: words with their little mathematical text, marked up for a page; colours, dashes and markers for a light and
a dark page; axes with limits and ticks; paths, samples of lines, text.

Every colour has a contrast of 3 : 1 at least with its page (WCAG 2.2, 1.4.11); dash and marker distinguish curves in
grey. Panels are separate so that a narrow screen can stack them. Colours come from the page's style sheet in a light
and a dark form. Text is escaped here; nothing else from outside gets into the markup. The page's script redraws a panel
of lines when zoomed; the data for that beyond the numbers (limits, which ticks, places of references and notes) are
kept with them and in attributes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import ArrayLike

from radarsim.language import power_of_ten, tr
from radarsim.report.drawing import GREY, Axis, Bars, Figure, Heat, Line, Mark, Note, Panel, Reference, Style
from radarsim.report.wording import number, spoken, subscripts

# ---- chart text ------------------------------------------------------------------------------------------------------
RISE = {"sub": (0.25, 0.75), "sup": (-0.4, 0.75)}  # of the size: how far down, how large


def html(text: str) -> Markup:
    """The text for a page: <i>, <sub>, <sup>; everything else escaped."""
    return Markup("").join(
        Markup("<{0}>{1}</{0}>").format(Markup(kind), part) if kind else escape(part) for part, kind in subscripts(text)
    )


def tspans(text: str, size: float) -> Markup:
    """The text for an SVG, of one line: subscripts lowered, letters of formulas slanted; everything else escaped."""
    made, low = Markup(""), 0.0
    for part, kind in subscripts(text.replace("\n", " ")):
        down, scale = RISE.get(kind, (0.0, 1.0))
        shift = down * size - low
        low = down * size
        look = Markup(' dy="{:.1f}"').format(shift) if shift else Markup("")
        look += Markup(' font-size="{:.1f}"').format(scale * size) if scale != 1 else Markup("")
        look += Markup(' font-style="italic"') if kind == "i" else Markup("")
        made += Markup("<tspan{}>{}</tspan>").format(look, part) if look else escape(part)
    return made


# ---- chart look ------------------------------------------------------------------------------------------------------
# Ten even steps of lightness, on a light page and on a dark one, with hues found by search so that every two are told
# apart in grey and under protanopia, deuteranopia and tritanopia (CIEDE2000; tests/report/test_colours.py).
LADDER = (
    *(("#2d0257", "#fefa41"), ("#5c0126", "#beefad"), ("#0810ba", "#6de1fd"), ("#881800", "#cebeca")),
    *(("#074dae", "#27cba1"), ("#7d0af9", "#c4a50d"), ("#437a04", "#829bc7"), ("#756cd8", "#a78662")),
    *(("#109b4d", "#598783"), ("#fe5292", "#6c753e")),
)
COLOURS = tuple(LADDER[i] for i in (0, 6, 3, 9, 4, 8, 1, 7, 2, 5))  # in the order of use: few curves lie far apart
NEUTRAL = ("#6b6b6b", "#a9a9a9")  # of anything but a curve of its own
SHADES = (  # of an ordered scale, least to most
    ("#440154", "#3b528b", "#2a788e", "#1f9a6e", "#4f8a10"),
    ("#8c8cf0", "#4fa3e0", "#35b7a0", "#7ad151", "#fde725"),
)
HEAT = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
DASHES = ("", "6 2.5", "1.8 2", "7 2.5 1.8 2.5", "11 3.5", "4 2 1.5 2 1.5 2")
MARKERS = (  # paths about a point, moved to by "M x y" before
    "m-2.6 0a2.6 2.6 0 1 0 5.2 0a2.6 2.6 0 1 0-5.2 0",
    "m-2.4-2.4h4.8v4.8h-4.8z",
    "m0-3.1l3 5.4h-6z",
    "m0-3.4l3 3.4l-3 3.4l-3-3.4z",
    "m0 3.1l3-5.4h-6z",
    "m-1-3h2v2h2v2h-2v2h-2v-2h-2v-2h2z",
    "m-2.9-1.5l1.4-1.4l1.5 1.5l1.5-1.5l1.4 1.4l-1.5 1.5l1.5 1.5l-1.4 1.4l-1.5-1.5l-1.5 1.5l-1.4-1.4l1.5-1.5z",
    "m0-4.4l1.1 3h3.2l-2.6 1.9l1 3.1l-2.7-1.9l-2.7 1.9l1-3.1l-2.6-1.9h3.2z",
    "m-3.1 0l5.4-3v6z",
    "m0-3l2.6 1.5v3l-2.6 1.5l-2.6-1.5v-3z",
    "m3.1 0l-5.4-3v6z",
    "m0-3.6l1.8 3.6l-1.8 3.6l-1.8-3.6z",
    "m0-3l2.9 2.1l-1.1 3.4h-3.6l-1.1-3.4z",
)
CROSS = "m-3 0h6m-3-3v6"


def ink_colours(style: Style) -> tuple[str, str]:
    """The colour of a style on a light and on a dark page."""
    if isinstance(style.colour, float):
        return mixed(SHADES[0], style.colour), mixed(SHADES[1], style.colour)
    if style.colour == GREY:
        return NEUTRAL
    return COLOURS[style.colour % len(COLOURS)]


def mixed(stops: tuple[str, ...], share: float) -> str:
    """A colour between stops at equal distances, share from 0 to 1."""
    at = np.clip(share, 0.0, 1.0) * (len(stops) - 1)
    low = min(int(at), len(stops) - 2)
    a, b = ([int(stop[i : i + 2], 16) for i in (1, 3, 5)] for stop in stops[low : low + 2])
    return "#" + "".join(f"{round(x + (at - low) * (y - x)):02x}" for x, y in zip(a, b, strict=True))


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one: str, other: str) -> float:
    """Contrast of two colours, 1 to 21 (WCAG 2.2)."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


# ---- chart scale -----------------------------------------------------------------------------------------------------
MARGIN = {"x": 0.02, "y": 0.06}  # of the span of the data, on either side
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
TICK_DIGITS = 6
WIDE = 20.0  # ratio of values from which the colours of maps are logarithmic
FEWEST_SCANS, LAST_APART = 5, 0.5  # scans from which ticks stand at them; of an interval, before the last tick
FURTHER = 3  # ticks more than wanted that a logarithmic axis may have
MOST_DECADES = 7  # labelled on a logarithmic axis


@dataclass(frozen=True)
class Scale:
    """A linear or logarithmic axis from `low` to `high` over the places `start` to `end`."""

    log: bool
    low: float
    high: float
    start: float
    end: float

    def place(self, values: ArrayLike) -> np.ndarray:
        """Places of values; NaN where a value has none."""
        v = np.asarray(values, dtype=float)
        low, high = self.low, self.high
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                v = np.log10(np.where(v > 0, v, np.nan))
            low, high = math.log10(low), math.log10(high)
        return self.start + (self.end - self.start) * (v - low) / (high - low)

    def ticks(self, wanted: int) -> list[tuple[float, str]]:
        """About `wanted` round values inside the axis, with their text."""
        if self.log and self.high / self.low >= 10:
            return decades(self.low, self.high, wanted)
        return [(v, tick_text(v)) for v in steps(self.low, self.high, wanted)]


def scale(axis: Axis, values: Sequence[np.ndarray], which: str, start: float, end: float) -> Scale:
    """The scale of an axis for the data of its panel: limits where given, else the data with a margin."""
    log = axis.scale == "log"
    parts = [np.ravel(np.asarray(v, dtype=float)) for v in values]
    v = np.concatenate(parts) if parts else np.zeros(0)
    v = v[np.isfinite(v) & ((v > 0) | (not log))]
    low, high = (float(v.min()), float(v.max())) if v.size else ((1.0, 10.0) if log else (0.0, 1.0))
    a, b = (math.log10(low), math.log10(high)) if log else (low, high)
    pad = MARGIN[which] * (b - a)
    if pad == 0:
        pad = 0.5 if log else 0.5 * abs(a) or 0.5
    a, b = a - pad, b + pad
    low, high = (10.0**a, 10.0**b) if log else (a, b)
    given = axis.limits
    low, high = low if given[0] is None else given[0], high if given[1] is None else given[1]
    if not low < high:
        high = low + 1.0 if not log else 10.0 * low
    return Scale(log, low, high, start, end)


def steps(low: float, high: float, wanted: int) -> list[float]:
    """Multiples of a round step between low and high."""
    rough = (high - low) / max(wanted, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s for s in STEPS if s * power >= rough * (1 - 1e-9)) * power
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [n * step for n in range(first, last + 1)]


def decades(low: float, high: float, wanted: int) -> list[tuple[float, str]]:
    """Powers of ten, and 2 and 5 times these if that gives not many more than wanted."""
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    stride = max(1, -(-(last - first + 1) // MOST_DECADES))
    ticks = list(
        zip((10.0**n for n in range(first, last + 1, stride)), powers(range(first, last + 1, stride)), strict=True)
    )
    fine = [m * 10.0**n for n in range(first - 1, last + 1) for m in (2, 5) if low <= m * 10.0**n <= high]
    if stride > 1 or len(ticks) + len(fine) > wanted + FURTHER:
        return ticks
    return sorted([*ticks, *((v, tick_text(v)) for v in fine)])


def powers(exponents: Sequence[int]) -> list[str]:
    """Powers of ten, all in figures where each is short, else all raised except 1 and 10."""
    short = all(-4 <= n <= 4 for n in exponents)
    return [tick_text(10.0**n) if short or n in (0, 1) else power_of_ten(n) for n in exponents]


def tick_text(value: float) -> str:
    """A tick's number: at most six digits, a true minus, powers of ten raised."""
    return number(value, TICK_DIGITS)


def heat_scale(parts: Sequence[np.ndarray]) -> tuple[float, float, bool]:
    """Least and largest of the values of maps side by side, and whether their colours are logarithmic."""
    values = np.concatenate([np.zeros(0), *map(np.ravel, parts)])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    return low, high, bool(low > 0 and high > WIDE * low)


def equal(x: Scale, y: Scale) -> tuple[Scale, Scale]:
    """Two linear scales with as many units to a place each: the one with the smaller span is extended to both sides."""
    per_place = max((one.high - one.low) / abs(one.end - one.start) for one in (x, y))

    def widened(one: Scale) -> Scale:
        more = (per_place * abs(one.end - one.start) - (one.high - one.low)) / 2
        return replace(one, low=one.low - more, high=one.high + more)

    return widened(x), widened(y)


# ---- chart pieces ----------------------------------------------------------------------------------------------------
SIZE = 12.0  # of the letters, in units of the SVG
DIGITS = ".5g"  # of the pointer's readout


def sample(style: Style) -> Markup:
    """A short piece of a line for the legend."""
    parts = Markup('<path class="l" d="M1 7h28"{}/>').format(dashed(style)) if style.dash is not None else Markup("")
    if style.marker is not None:
        parts += markers([(15.0, 7.0)], style)
    return Markup('<svg class="k" viewBox="0 0 30 14" aria-hidden="true"{}>{}</svg>').format(ink(style), parts)


def ink(style: Style) -> Markup:
    """The colours of a light and of a dark page, as an attribute."""
    return Markup(' style="--c:{};--d:{}"').format(*ink_colours(style))


def dashed(style: Style) -> Markup:
    """The dash, as an attribute; nothing for a whole line and for none."""
    if style.dash is None:
        return Markup("")
    dash = DASHES[style.dash % len(DASHES)]
    return Markup(' stroke-dasharray="{}"').format(dash) if dash else Markup("")


def markers(places: Sequence[tuple[float, float]], style: Style) -> Markup:
    """A style's marker at each place, all as one path; nothing without a marker."""
    if style.marker is None:
        return Markup("")
    shape = MARKERS[style.marker % len(MARKERS)]
    full = "f" if style.dash is None else "m"
    path = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in places)
    return Markup('<path class="{}" d="{}"/>').format(full, path)


def extent_of(mark: Mark, log: bool) -> tuple[np.ndarray, np.ndarray]:
    """The extent of a mark in x and y, for the limits; points that an axis of y (logarithmic or not) lacks are out."""
    none = np.zeros(0)
    match mark:
        case Line():
            y = np.asarray(mark.y, float)
            ends = [np.asarray(part, float) for part in (mark.lo, mark.hi) if part is not None]
            return np.asarray(mark.x, float)[np.isfinite(y) & ((y > 0) | (not log))], np.concatenate([y, *ends])
        case Reference():
            return (none, np.array([mark.value])) if mark.across == "y" else (np.array([mark.value]), none)
        case Bars():
            ends = [part for part in (mark.lo, mark.hi) if part is not None]
            return np.array([-0.5, len(mark.names) - 0.5]), np.concatenate([[0.0], mark.values, *ends])
        case Heat():
            return np.array([-0.5, len(mark.x) - 0.5]), np.array([-0.5, len(mark.y) - 0.5])
    return none, none


class Scans(NamedTuple):
    """Even values from zero to the last."""

    step: float
    last: float


def scans_of(panel: Panel) -> Scans | None:
    """Step and last of even values from zero on (scans) on which all lines of a panel lie; None where not."""
    every = [np.asarray(mark.x, float) for mark in panel.marks if isinstance(mark, Line)]
    x = np.unique(np.concatenate(every or [np.zeros(0)]))
    if panel.x.scale == "log" or len(x) < FEWEST_SCANS or x[0] < 0:
        return None
    step = float(x[-1] / np.round(x[-1] / np.diff(x).min()))
    even = np.abs(x / step - np.round(x / step)).max() < 1e-6 and x[0] <= FEWEST_SCANS * step
    said = abs(float(f"{step:.3g}") - step) < 1e-9 * step  # by few digits
    return Scans(step, float(x[-1])) if even and said else None


def at_scans(scans: Scans, intervals: int) -> list[tuple[float, str]]:
    """Ticks at every few scans from zero, about so many intervals, and at the last scan. One interval more, or down to
    half as many, if all intervals are then equally long."""
    count = round(scans.last / scans.step)
    every = [m * 10**p for p in range(9) for m in (1, 2, 3, 4, 5)]
    whole = [n for n in every if count % n == 0 and intervals / 2 <= count / n <= intervals + 1]
    chosen = (whole or [n for n in every if count / n <= intervals])[0]
    found = list(range(0, count + 1, chosen))
    if rest := count - found[-1]:
        found = [*(found[:-1] if rest < LAST_APART * chosen and len(found) > 1 else found), count]
    return [(n * scans.last / count, tick_text(n * scans.last / count)) for n in found]


def by_number(panel: Panel) -> Panel:
    """Whether it is a panel of bars or of a map: its places are numbers of columns and rows, whatever their values."""
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
    """A polyline through the finite points, in tenths of a unit, restarted after a gap."""
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


def unbroken(there: np.ndarray) -> list[np.ndarray]:
    """The places of each unbroken run of true values."""
    places = np.flatnonzero(there)
    return [part for part in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if part.size]


def short(values: np.ndarray) -> list[float | None]:
    """Numbers for the pointer: five digits, empty where not finite."""
    return [float(format(v, DIGITS)) if np.isfinite(v) else None for v in np.asarray(values, dtype=float).tolist()]


def text_at(x: float, y: float, text: str, anchor: str, css: str = "", data: tuple[str, float] | None = None) -> Markup:
    """Text at a place, a line below the other; data: the axis and value of a tick."""
    named = Markup(' class="{}"').format(css) if css else Markup("")
    named += Markup(' data-{}="{:.9g}"').format(Markup(data[0]), data[1]) if data else Markup("")
    return Markup("").join(
        Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="{}"{}>{}</text>').format(
            x, y + 1.15 * n * SIZE, anchor, named, tspans(line, SIZE)
        )
        for n, line in enumerate(text.split("\n"))
    )


# ---- chart -----------------------------------------------------------------------------------------------------------
WIDTH, HEIGHT = 440.0, 280.0  # of a panel, in units of the SVG
LETTER = 0.62 * SIZE  # mean width of a letter
RIGHT, BOTTOM = 12.0, 44.0
ENDS_SHARE = 0.3  # maximum share of a panel's width for the names at the ends of its lines
ROW = 1.15 * SIZE  # height of a name in a panel
MARKED = 16  # about so many markers or crosses on a line at most
FEWER = 6  # least points of a line for each marker, where lines have few points, for a small page
POINTS = 400  # of a line; a panel is as many units wide
Heats = dict[str, tuple[float, float, bool]]  # of maps with the same words: least, largest value, logarithmic or not
REFERENCE_SHARE = 0.2  # of an axis of x: the words of a reference line nearer to its left end are right of it
SEEN = 0.7  # units from the line from which its band is drawn


@dataclass(frozen=True)
class Switch:
    """A curve's name in the legend, with a sample of it; in `group` of the markup and of the data."""

    group: int
    name: Markup
    sample: Markup


@dataclass(frozen=True)
class Drawn:
    """A panel: title and remark as HTML, the SVG, and its data for the pointer."""

    title: Markup
    remark: Markup
    svg: Markup
    data: dict


@dataclass(frozen=True)
class Chart:
    """A figure for the page; direct: every curve has its name at its end in some panel."""

    panels: tuple[Drawn, ...]
    switches: tuple[Switch, ...]
    wide: bool
    direct: bool


def chart(figure: Figure, points: int = POINTS) -> Chart:
    """The figure's panels and the switches of its curves; lines of more than `points` points are thinned."""
    shown = [panel for panel in figure.panels if panel.marks]
    groups: dict[str, Style] = {}
    for mark in (m for panel in shown for m in panel.marks if isinstance(m, Line) and named(m)):
        groups.setdefault(named(mark), mark.style)
    numbers = {name: n for n, name in enumerate(groups)}
    heats = heats_of(shown)
    panels = tuple(_panel(figure, panel, numbers, points, heats) for panel in shown)
    switches = tuple(Switch(n, html(name), sample(groups[name])) for name, n in numbers.items())
    direct = set(groups) == {name for panel in shown for name in at_ends(panel)}
    return Chart(panels, switches, len(panels) > 1, direct)


def heats_of(panels: Sequence[Panel]) -> Heats:
    """The colour scales of maps: one for all maps of a figure that have the same words."""
    maps = [mark for panel in panels for mark in panel.marks if isinstance(mark, Heat)]
    return {one.label: heat_scale([m.values for m in maps if m.label == one.label]) for one in maps}


def named(line: Line) -> str:
    """The name of a line: its name, else its label."""
    return line.name or line.label


def at_ends(panel: Panel) -> list[str]:
    """The names at the ends of a panel's lines, as in the files; none where not all of them fit."""
    lines = [m for m in panel.marks if isinstance(m, Line) and m.label and np.isfinite(m.y).any()]
    names = [named(line) for line in lines]
    short = max((len(spoken(name)) for name in names), default=0) * LETTER <= ENDS_SHARE * WIDTH
    drawn = all(line.style.dash is not None for line in lines) and not any(isinstance(m, Heat) for m in panel.marks)
    fits = panel.direct and short and drawn and len(names) * ROW <= HEIGHT - BOTTOM - 3 * SIZE
    return names if fits else []


def _panel(figure: Figure, panel: Panel, numbers: dict[str, int], points: int, heats: Heats) -> Drawn:
    frame = _Frame(panel, heats)
    ordered = sorted(panel.marks, key=lambda mark: isinstance(mark, Note) and mark.place == "top")  # over the lines
    marks = Markup("").join(frame.draw(mark, numbers, points) for mark in ordered)
    whole = " – ".join(filter(None, (spoken(figure.title), spoken(panel.title))))
    axes = tr("{y} against {x}", y=spoken(panel.y.label), x=spoken(panel.x.label))
    svg = Markup(
        '<svg class="chart" viewBox="0 0 {:g} {:g}" role="img" tabindex="0" aria-label="{}: {}">{}'
        '<svg x="{:g}" y="{:g}" width="{:g}" height="{:g}" viewBox="{:g} {:g} {:g} {:g}">{}</svg>'
        '{}<g class="cursor"></g></svg>'
    ).format(WIDTH, HEIGHT, whole, axes, frame.axes(), *(2 * frame.inside()), marks, frame.ends)
    remark = Markup("<br>").join(html(line) for line in panel.remark.split("\n")) if panel.remark else Markup("")
    return Drawn(html(panel.title), remark, svg, frame.data)


class _Frame:
    """A panel's axes, and the marks put into them."""

    def __init__(self, panel: Panel, heats: Heats):
        self.heats = heats
        self.panel, extent = panel, [extent_of(mark, panel.y.scale == "log") for mark in panel.marks]
        if any(isinstance(mark, Heat | Bars) for mark in panel.marks):
            panel = self.panel = by_number(panel)
        elif not panel.x.ticks and (scans := scans_of(panel)):
            panel = self.panel = replace(panel, x=replace(panel.x, ticks=tuple(at_scans(scans, 6))))
        above = len(panel.y.label.split("\n"))
        self.top = 8.0 + 1.3 * SIZE * above
        ys = scale(panel.y, [y for _, y in extent], "y", HEIGHT - BOTTOM, self.top)
        self.y_ticks = list(panel.y.ticks) or ys.ticks(5)
        self.y = ys
        widest = max((len(line) for _, text in self.y_ticks for line in text.split("\n")), default=1)
        self.left = max(30.0, 16.0 + LETTER * min(widest, 22))
        self.names, self.ends = at_ends(panel), Markup("")
        self.right = WIDTH - RIGHT - max((1.1 * LETTER * len(spoken(name)) for name in self.names), default=0.0)
        self.x: Scale = scale(panel.x, [x for x, _ in extent], "x", self.left, self.right)
        if panel.equal:
            self.x, self.y = equal(self.x, self.y)
            self.y_ticks = list(panel.y.ticks) or self.y.ticks(5)
        self.x_ticks = list(panel.x.ticks) or self.x.ticks(6)
        ends = [[s.log, *(float(f"{v:.9g}") for v in (s.low, s.high, s.start, s.end))] for s in (self.x, self.y)]
        labels = {"xl": spoken(panel.x.label), "yl": spoken(panel.y.label)}
        self.data: dict[str, Any] = {"x": ends[0], "y": ends[1], **labels, "xs": [], "lines": []}
        if any(isinstance(mark, Line) for mark in panel.marks) and not any(
            isinstance(mark, Heat | Bars) for mark in panel.marks
        ):
            self.data["draw"] = self._redrawn(panel)

    def _redrawn(self, panel: Panel) -> dict[str, Any]:
        """Data for the page's script to draw the panel with other limits: those given, whether ticks are given and
        whether both axes have one scale."""
        limits = [panel.x.limits, panel.y.limits]
        return {"lim": limits, "ticks": [bool(panel.x.ticks), bool(panel.y.ticks)], "equal": panel.equal}

    def inside(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of the plot, a little wider than the axes for markers at their ends."""
        return self.left - 4, self.top - 4, self.right - self.left + 8, HEIGHT - BOTTOM - self.top + 8

    def axes(self) -> Markup:
        """Grid, axes, ticks and labels."""
        left, right, top, bottom = self.left, self.right, self.top, HEIGHT - BOTTOM
        xs = [(float(self.x.place(v)), text, v) for v, text in self.x_ticks]
        ys = [(float(self.y.place(v)), text, v) for v, text in self.y_ticks]
        xs = [(x, text, v) for x, text, v in xs if left - 1 <= x <= right + 1]
        ys = [(y, text, v) for y, text, v in ys if top - 1 <= y <= bottom + 1]
        grid = "".join(f"M{x:.1f} {top:.1f}V{bottom:.1f}" for x, _, _ in xs)
        grid += "".join(f"M{left:.1f} {y:.1f}H{right:.1f}" for y, _, _ in ys)
        made = Markup('<path class="grid" d="{}"/>').format(grid)
        made += Markup('<path class="axis" d="M{:.1f} {:.1f}V{:.1f}H{:.1f}"/>').format(left, top, bottom, right)
        for x, text, v in xs:
            made += text_at(x, bottom + 1.25 * SIZE, text, "middle", data=("x", v))
        for y, text, v in ys:
            made += text_at(left - 5, y + 0.35 * SIZE, text, "end", data=("y", v))
        deep = max((len(text.split("\n")) for _, text, _ in xs), default=1)
        made += text_at((left + right) / 2, bottom + (1.4 + deep) * SIZE, self.panel.x.label, "middle", "lab")
        return made + text_at(2, SIZE + 1, self.panel.y.label, "start", "lab")

    def draw(self, mark: Mark, numbers: dict[str, int], points: int) -> Markup:
        """The markup of a mark; the numbers of curves, bars and maps are kept for the pointer."""
        match mark:
            case Line():
                return self._line(mark, numbers, points)
            case Reference():
                return self._reference(mark)
            case Bars():
                return self._bars(mark)
            case Heat():
                return self._heat(mark)
            case Note():
                return self._note(mark)
        raise TypeError(f"no such mark: {mark!r}")

    def _line(self, line: Line, numbers: dict[str, int], points: int) -> Markup:
        whole = thinned(line, points)
        group = numbers.get(named(line), -1)
        if self.names and line.label:
            end = '<g class="end" display="none" data-n="{}" data-group="{}"{}><path class="l"{}/><text>{}</text></g>'
            words = tspans(named(line), SIZE)
            self.ends += Markup(end).format(len(self.data["lines"]), group, ink(line.style), dashed(line.style), words)
        self._keep(spoken(named(line)), whole, group, line.style)
        x, y = self.x.place(whole["x"]), self.y.place(whole["y"])
        made = Markup("")
        if "lo" in whole and "hi" in whole:
            made += self._interval(x, y, whole, line.style)
        if line.style.dash is not None:
            made += Markup('<path class="l" d="{}"{}/>').format(path(x, y), dashed(line.style))
        step = 1 if line.style.dash is None else max(1, -(-len(x) // min(MARKED, max(1, points // FEWER))))
        if line.style.marker is not None:
            alone = [run[0] for run in unbroken(np.isfinite(x) & np.isfinite(y)) if len(run) == 1]
            shown = np.union1d(np.arange(0, len(x), step), np.array(alone, int))
            made += markers(places(x[shown], y[shown]), line.style)
        if "exact" in whole:
            first = 0 if step == 1 else step // 2  # of many, markers and crosses by turns
            known = places(x[first::step], self.y.place(whole["exact"])[first::step])
            made += Markup('<path class="x" d="{}"/>').format("".join(f"M{a:.1f} {b:.1f}{CROSS}" for a, b in known))
        return Markup('<g data-g="{}"{}>{}</g>').format(group, ink(line.style), made)

    def _interval(self, x: np.ndarray, y: np.ndarray, whole: dict[str, np.ndarray], style: Style) -> Markup:
        """A band where visible, whiskers on single points; nothing where neither end is known."""
        known = np.isfinite(whole["lo"]) | np.isfinite(whole["hi"])
        edge = 10 * HEIGHT  # an end that is infinite is beyond the panel
        with np.errstate(invalid="ignore"):
            lo = np.clip(np.nan_to_num(self.y.place(whole["lo"]), nan=edge, posinf=edge, neginf=edge), -edge, edge)
            hi = np.clip(np.nan_to_num(self.y.place(whole["hi"]), nan=-edge, posinf=-edge, neginf=-edge), -edge, edge)
        there = np.isfinite(x) & np.isfinite(y) & known
        runs = unbroken(there)
        alone = there if style.dash is None else [run[0] for run in runs if len(run) == 1]
        bars = "".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(x[alone], lo[alone], hi[alone], strict=True))
        made = Markup('<path class="w" d="{}"/>').format(bars) if bars else Markup("")
        wide = [run for run in runs if len(run) > 1 and style.dash is not None]
        if not wide or np.max(lo[there] - hi[there]) < 2 * SEEN:
            return made
        outlines = ((np.append(x[run], x[run][::-1]), np.append(hi[run], lo[run][::-1])) for run in wide)
        return made + Markup('<path class="b" d="{}"/>').format("".join(path(*ends) + "z" for ends in outlines))

    def _keep(self, name: str, whole: dict[str, np.ndarray], group: int, style: Style) -> None:
        """Numbers for the pointer; times shared by curves are kept once."""
        x = short(whole["x"])
        if x not in self.data["xs"]:
            self.data["xs"].append(x)
        kept = {"n": name, "g": group, "c": ink_colours(style), "x": self.data["xs"].index(x)}
        if style.dash is None:
            kept["p"] = 1
        for key, column in (("y", "y"), ("l", "lo"), ("h", "hi"), ("e", "exact")):
            if column in whole:
                kept[key] = short(whole[column])
        self.data["lines"].append(kept)

    def _reference(self, mark: Reference) -> Markup:
        left, right, top, bottom = self.left, self.right, self.top, HEIGHT - BOTTOM
        if mark.across == "y":
            y = float(self.y.place(mark.value))
            made = Markup('<path class="ref" d="M{:.1f} {:.1f}H{:.1f}"/>').format(left, y, right)
            made += text_at(right - 3, y - 3, mark.label, "end", "soft") if mark.label else Markup("")
        else:
            x = float(self.x.place(mark.value))
            made = Markup('<path class="ref" d="M{:.1f} {:.1f}V{:.1f}"/>').format(x, bottom, top)
            near = x - left < REFERENCE_SHARE * (right - left)
            place = (x + 3, "start") if near else (x - 3, "end")
            made += text_at(place[0], bottom - 4, mark.label, place[1], "soft") if mark.label else Markup("")
        return Markup('<g data-{}="{:.9g}">{}</g>').format(Markup(mark.across), mark.value, made)

    def _bars(self, bars: Bars) -> Markup:
        where, zero = np.arange(float(len(bars.names))), float(self.y.place(0.0))
        made, x, y = Markup(""), self.x.place(where), self.y.place(bars.values)
        half = 0.33 * float(self.x.place(1.0) - self.x.place(0.0))
        boxes = "".join(f"M{a - half:.1f} {zero:.1f}V{b:.1f}h{2 * half:.1f}V{zero:.1f}z" for a, b in places(x, y))
        made += Markup('<path class="f" d="{}"/>').format(boxes)
        whole = {"x": where, "y": bars.values}
        if bars.lo is not None and bars.hi is not None:
            whole |= {"lo": bars.lo, "hi": bars.hi}
            made += self._interval(x, y, whole, Style(dash=None))
        self._keep("", whole, -1, Style(bars.style.colour, None))
        return Markup("<g{}>{}</g>").format(ink(bars.style), made)

    def _heat(self, heat: Heat) -> Markup:
        low, high, log = self.heats[heat.label]
        shades = Scale(log, low, high if high > low else low + 1, 0.0, 1.0).place(heat.values)
        wide, deep = abs(self.x.place(1.0) - self.x.place(0.0)), abs(self.y.place(1.0) - self.y.place(0.0))
        few, made = heat.values.size <= 60, Markup("")
        for (i, j), value in np.ndenumerate(heat.values):
            if not np.isfinite(value):
                continue
            colour = mixed(HEAT, float(shades[i, j]))
            x, y = float(self.x.place(j)), float(self.y.place(i))
            made += Markup('<path fill="{}" d="M{:.1f} {:.1f}h{:.1f}v{:.1f}h{:.1f}z"/>').format(
                colour, x - wide / 2, y - deep / 2, wide, deep, -wide
            )
            if few:
                on = "#ffffff" if contrast(colour, "#ffffff") > contrast(colour, "#000000") else "#000000"
                made += Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="middle" style="fill:{}">{}</text>').format(
                    x, y + 0.35 * SIZE, on, tick_text(float(f"{value:.3g}"))
                )
        values = [short(row) for row in heat.values]
        ticks = ([text for _, text in self.x_ticks], [text for _, text in self.y_ticks])
        self.data["heat"] = {"v": values, "l": spoken(heat.label), "x": ticks[0], "y": ticks[1]}
        return made

    def _note(self, note: Note) -> Markup:
        x, y = float(self.x.place(note.x)), float(self.y.place(note.y))
        if note.place == "top":
            text = text_at(x, self.top + 0.7 * SIZE, note.text, "middle", "soft on")
            return Markup('<g data-x="{:.9g}">{}</g>').format(note.x, text)
        if note.place == "on":
            text = text_at(x, y + 0.35 * SIZE, note.text, "middle", "on")
            return Markup('<g data-x="{:.9g}" data-y="{:.9g}">{}</g>').format(note.x, note.y, text)
        right = "e" in note.place
        below = 0.35 * SIZE if note.place == "e" else -5 if "n" in note.place else SIZE
        place = (x + (5 if right else -5), y + below)
        text = text_at(*place, note.text, "start" if right else "end")
        return Markup('<g data-x="{:.9g}" data-y="{:.9g}">{}</g>').format(note.x, note.y, text)
