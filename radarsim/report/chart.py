"""Draws report/drawing.py's figures for the page: small SVGs, one a panel, and the numbers that a pointer reads off.

Panels stand apart so that a narrow screen can set them one below the other. Colours come from the page's style sheet
in a light and a dark form. Text is escaped here; nothing else from outside gets into the markup. A panel of lines is
drawn again by the page's script where a reader looks closer: what that needs beside the numbers (limits, what ticks,
references and notes stand at) is kept with them and in attributes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from radarsim.language import tr
from radarsim.report import chart_look as look
from radarsim.report import chart_pieces as pieces
from radarsim.report.chart_pieces import SIZE
from radarsim.report.chart_scale import Scale, equal, heat_scale, scale, tick_text
from radarsim.report.chart_text import html, spoken
from radarsim.report.drawing import Bars, Figure, Heat, Line, Mark, Note, Panel, Reference, Style

WIDTH, HEIGHT = 440.0, 280.0  # of a panel, in units of the SVG
LETTER = 0.62 * SIZE  # mean width of one
RIGHT, BOTTOM = 12.0, 44.0
MARKED = 16  # at most about so many markers or crosses a line
FEWER = 6  # points of a line for each marker, at least: where lines are drawn of few points, for a small page
POINTS = 400  # of a line; a panel is as many units wide
Heats = dict[str, tuple[float, float, bool]]  # of maps with the same words: least, largest value, logarithmic or not
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
    """A figure for the page."""

    panels: tuple[Drawn, ...]
    switches: tuple[Switch, ...]
    wide: bool


def chart(figure: Figure, points: int = POINTS) -> Chart:
    """The figure's panels and the switches of its curves; lines of more than `points` points are thinned."""
    shown = [panel for panel in figure.panels if panel.marks]
    groups: dict[str, Style] = {}
    for mark in (m for panel in shown for m in panel.marks if isinstance(m, Line) and named(m)):
        groups.setdefault(named(mark), mark.style)
    numbers = {name: n for n, name in enumerate(groups)}
    maps = [mark for panel in shown for mark in panel.marks if isinstance(mark, Heat)]
    heats = {one.label: heat_scale([m.values for m in maps if m.label == one.label]) for one in maps}
    panels = tuple(_panel(figure, panel, numbers, points, heats) for panel in shown)
    switches = tuple(Switch(n, html(name), pieces.sample(groups[name])) for name, n in numbers.items())
    return Chart(panels, switches, len(panels) > 1)


def named(line: Line) -> str:
    """What a line is called: its name, else its label."""
    return line.name or line.label


def _panel(figure: Figure, panel: Panel, numbers: dict[str, int], points: int, heats: Heats) -> Drawn:
    frame = _Frame(panel, heats)
    marks = Markup("").join(frame.draw(mark, numbers, points) for mark in panel.marks)
    whole = " – ".join(filter(None, (spoken(figure.title), spoken(panel.title))))
    axes = tr("{y} against {x}", y=spoken(panel.y.label), x=spoken(panel.x.label))
    svg = Markup(
        '<svg class="chart" viewBox="0 0 {:g} {:g}" role="img" tabindex="0" aria-label="{}: {}">{}'
        '<svg x="{:g}" y="{:g}" width="{:g}" height="{:g}" viewBox="{:g} {:g} {:g} {:g}">{}</svg>'
        '<g class="cursor"></g></svg>'
    ).format(WIDTH, HEIGHT, whole, axes, frame.axes(), *(2 * frame.inside()), marks)
    remark = Markup("<br>").join(html(line) for line in panel.remark.split("\n")) if panel.remark else Markup("")
    return Drawn(html(panel.title), remark, svg, frame.data)


class _Frame:
    """A panel's axes, and the marks put into them."""

    def __init__(self, panel: Panel, heats: Heats):
        self.heats = heats
        self.panel, extent = panel, [pieces.extent(mark) for mark in panel.marks]
        if any(isinstance(mark, Heat | Bars) for mark in panel.marks):
            panel = self.panel = pieces.by_number(panel)
        above = len(panel.y.label.split("\n"))
        self.top = 8.0 + 1.3 * SIZE * above
        ys = scale(panel.y, [y for _, y in extent], "y", HEIGHT - BOTTOM, self.top)
        self.y_ticks = list(panel.y.ticks) or ys.ticks(5)
        self.y = ys
        widest = max((len(line) for _, text in self.y_ticks for line in text.split("\n")), default=1)
        self.left = max(30.0, 12.0 + LETTER * min(widest, 22))
        self.x: Scale = scale(panel.x, [x for x, _ in extent], "x", self.left, WIDTH - RIGHT)
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
        """What the page's script needs to draw the panel with other limits: those given, whether ticks are given and
        whether both axes have one scale."""
        limits = [panel.x.limits, panel.y.limits]
        return {"lim": limits, "ticks": [bool(panel.x.ticks), bool(panel.y.ticks)], "equal": panel.equal}

    def inside(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of the plot, a little wider than the axes for markers at their ends."""
        return self.left - 4, self.top - 4, WIDTH - RIGHT - self.left + 8, HEIGHT - BOTTOM - self.top + 8

    def axes(self) -> Markup:
        """Grid, axes, ticks and labels."""
        left, right, top, bottom = self.left, WIDTH - RIGHT, self.top, HEIGHT - BOTTOM
        xs = [(float(self.x.place(v)), text, v) for v, text in self.x_ticks]
        ys = [(float(self.y.place(v)), text, v) for v, text in self.y_ticks]
        xs = [(x, text, v) for x, text, v in xs if left - 1 <= x <= right + 1]
        ys = [(y, text, v) for y, text, v in ys if top - 1 <= y <= bottom + 1]
        grid = "".join(f"M{x:.1f} {top:.1f}V{bottom:.1f}" for x, _, _ in xs)
        grid += "".join(f"M{left:.1f} {y:.1f}H{right:.1f}" for y, _, _ in ys)
        made = Markup('<path class="grid" d="{}"/>').format(grid)
        made += Markup('<path class="axis" d="M{:.1f} {:.1f}V{:.1f}H{:.1f}"/>').format(left, top, bottom, right)
        for x, text, v in xs:
            made += pieces.text(x, bottom + 1.25 * SIZE, text, "middle", data=("x", v))
        for y, text, v in ys:
            made += pieces.text(left - 5, y + 0.35 * SIZE, text, "end", data=("y", v))
        deep = max((len(text.split("\n")) for _, text, _ in xs), default=1)
        made += pieces.text(
            (left + right) / 2, bottom + (1.4 + 1.05 * deep) * SIZE, self.panel.x.label, "middle", "lab"
        )
        return made + pieces.text(2, SIZE + 1, self.panel.y.label, "start", "lab")

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
        whole = pieces.thinned(line, points)
        group = numbers.get(named(line), -1)
        self._keep(spoken(named(line)), whole, group, line.style)
        x, y = self.x.place(whole["x"]), self.y.place(whole["y"])
        made = Markup("")
        if "lo" in whole and "hi" in whole:
            made += self._interval(x, y, whole, line.style)
        if line.style.dash is not None:
            made += Markup('<path class="l" d="{}"{}/>').format(pieces.path(x, y), pieces.dashed(line.style))
        step = 1 if line.style.dash is None else max(1, -(-len(x) // min(MARKED, max(1, points // FEWER))))
        if line.style.marker is not None:
            made += pieces.markers(pieces.places(x[::step], y[::step]), line.style)
        if "exact" in whole:
            first = 0 if step == 1 else step // 2  # of many, markers and crosses by turns
            known = pieces.places(x[first::step], self.y.place(whole["exact"])[first::step])
            made += Markup('<path class="x" d="{}"/>').format(
                "".join(f"M{a:.1f} {b:.1f}{look.CROSS}" for a, b in known)
            )
        return Markup('<g data-g="{}"{}>{}</g>').format(group, pieces.ink(line.style), made)

    def _interval(self, x: np.ndarray, y: np.ndarray, whole: dict[str, np.ndarray], style: Style) -> Markup:
        """A band where it can be seen, whiskers of single points; nothing where neither end is known."""
        known = np.isfinite(whole["lo"]) | np.isfinite(whole["hi"])
        edge = 10 * HEIGHT  # an end that is infinite is beyond the panel
        with np.errstate(invalid="ignore"):
            lo = np.clip(np.nan_to_num(self.y.place(whole["lo"]), nan=edge, posinf=edge, neginf=edge), -edge, edge)
            hi = np.clip(np.nan_to_num(self.y.place(whole["hi"]), nan=-edge, posinf=-edge, neginf=-edge), -edge, edge)
        there = np.isfinite(x) & np.isfinite(y) & known
        if style.dash is None:
            parts = [f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(x[there], lo[there], hi[there], strict=True)]
            return Markup('<path class="w" d="{}"/>').format("".join(parts))
        if not there.any() or np.max(lo[there] - hi[there]) < 2 * SEEN:
            return Markup("")
        d = ""
        for run in pieces.runs(there):
            outline = np.concatenate([hi[run], lo[run][::-1]])
            d += pieces.path(np.concatenate([x[run], x[run][::-1]]), outline) + "z"
        return Markup('<path class="b" d="{}"/>').format(d)

    def _keep(self, name: str, whole: dict[str, np.ndarray], group: int, style: Style) -> None:
        """Numbers for the pointer; times that curves share are kept once."""
        x = pieces.short(whole["x"])
        if x not in self.data["xs"]:
            self.data["xs"].append(x)
        kept = {"n": name, "g": group, "c": look.ink(style), "x": self.data["xs"].index(x)}
        if style.dash is None:
            kept["p"] = 1
        for key, column in (("y", "y"), ("l", "lo"), ("h", "hi"), ("e", "exact")):
            if column in whole:
                kept[key] = pieces.short(whole[column])
        self.data["lines"].append(kept)

    def _reference(self, mark: Reference) -> Markup:
        left, right, top, bottom = self.left, WIDTH - RIGHT, self.top, HEIGHT - BOTTOM
        if mark.across == "y":
            y = float(self.y.place(mark.value))
            made = Markup('<path class="ref" d="M{:.1f} {:.1f}H{:.1f}"/>').format(left, y, right)
            made += pieces.text(right - 3, y - 3, mark.label, "end", "soft") if mark.label else Markup("")
        else:
            x = float(self.x.place(mark.value))
            made = Markup('<path class="ref" d="M{:.1f} {:.1f}V{:.1f}"/>').format(x, bottom, top)
            made += pieces.text(x - 3, bottom - 4, mark.label, "end", "soft") if mark.label else Markup("")
        return Markup('<g data-{}="{:.9g}">{}</g>').format(Markup(mark.across), mark.value, made)

    def _bars(self, bars: Bars) -> Markup:
        where, zero = np.arange(float(len(bars.names))), float(self.y.place(0.0))
        made, x, y = Markup(""), self.x.place(where), self.y.place(bars.values)
        half = 0.33 * float(self.x.place(1.0) - self.x.place(0.0))
        boxes = "".join(
            f"M{a - half:.1f} {zero:.1f}V{b:.1f}h{2 * half:.1f}V{zero:.1f}z" for a, b in pieces.places(x, y)
        )
        made += Markup('<path class="f" d="{}"/>').format(boxes)
        whole = {"x": where, "y": bars.values}
        if bars.lo is not None and bars.hi is not None:
            whole |= {"lo": bars.lo, "hi": bars.hi}
            made += self._interval(x, y, whole, Style(dash=None))
        self._keep("", whole, -1, Style(bars.style.colour, None))
        return Markup("<g{}>{}</g>").format(pieces.ink(bars.style), made)

    def _heat(self, heat: Heat) -> Markup:
        low, high, log = self.heats[heat.label]
        shades = Scale(log, low, high if high > low else low + 1, 0.0, 1.0).place(heat.values)
        wide, deep = abs(self.x.place(1.0) - self.x.place(0.0)), abs(self.y.place(1.0) - self.y.place(0.0))
        few, made = heat.values.size <= 60, Markup("")
        for (i, j), value in np.ndenumerate(heat.values):
            if not np.isfinite(value):
                continue
            colour = look.mixed(look.HEAT, float(shades[i, j]))
            x, y = float(self.x.place(j)), float(self.y.place(i))
            made += Markup('<path fill="{}" d="M{:.1f} {:.1f}h{:.1f}v{:.1f}h{:.1f}z"/>').format(
                colour, x - wide / 2, y - deep / 2, wide, deep, -wide
            )
            if few:
                on = "#ffffff" if look.contrast(colour, "#ffffff") > look.contrast(colour, "#000000") else "#000000"
                made += Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="middle" style="fill:{}">{}</text>').format(
                    x, y + 0.35 * SIZE, on, tick_text(float(f"{value:.3g}"))
                )
        values = [pieces.short(row) for row in heat.values]
        ticks = ([text for _, text in self.x_ticks], [text for _, text in self.y_ticks])
        self.data["heat"] = {"v": values, "l": spoken(heat.label), "x": ticks[0], "y": ticks[1]}
        return made

    def _note(self, note: Note) -> Markup:
        x, y = float(self.x.place(note.x)), float(self.y.place(note.y))
        right = "e" in note.place
        place = (x + (5 if right else -5), y - 5 if "n" in note.place else y + SIZE)
        text = pieces.text(*place, note.text, "start" if right else "end")
        return Markup('<g data-x="{:.9g}" data-y="{:.9g}">{}</g>').format(note.x, note.y, text)
