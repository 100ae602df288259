"""The first sentence of a figure's caption, from its content; and the meaning of its crosses.

Read from the drawn marks, of every named line and every panel. Lines with overlapping intervals share a sentence; a
line whose interval has too little behind it is "about"."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from radarsim.language import few, listed, plural, term, tr
from radarsim.report import wording
from radarsim.report.drawing import Figure, Heat, Line, Panel
from radarsim.report.wording import spoken

DIGITS = 3
MOST_PANELS = 4  # named by their titles; of more, the number is given
MOST_NAMES = 3  # named of those that share a place


class Seen(NamedTuple):
    """A line for a sentence: its name and its panel's title, its points (n,), and the interval of the last."""

    name: str
    panel: str
    x: np.ndarray
    y: np.ndarray
    lo: float
    hi: float

    @property
    def last(self) -> float:
        return float(self.y[-1])

    @property
    def rough(self) -> bool:
        """Whether its last interval is unknown."""
        return bool(np.isnan(self.lo) or np.isnan(self.hi))

    @property
    def ends(self) -> tuple[float, float]:
        """The interval of its last point: the point itself where none is known."""
        return (self.last, self.last) if self.rough else (self.lo, self.hi)


def begun(figure: Figure, sentence: str) -> Figure:
    """The figure with a sentence at the beginning of its caption, if there is one."""
    return replace(figure, caption=f"{sentence} {figure.caption}") if sentence else figure


def all_begun(
    drawn: Mapping[str, Figure | None], by: Mapping[str, Callable[[Figure], str]]
) -> dict[str, Figure | None]:
    """Figures by name, those in `by` with the sentence of their function; the others unchanged."""
    return {name: begun(one, by[name](one)) if one and name in by else one for name, one in drawn.items()}


def numbered(figure: Figure, number: str) -> Figure:
    """The figure with the paper's number of it in its caption."""
    return replace(figure, caption=f"{figure.caption} {tr('Figure {number} of the paper.', number=number)}")


def crossed(figure: Figure) -> Figure:
    """The figure with the meaning of its crosses, if any, in its caption."""
    called = [panel.crosses or tr("exact values") for panel in figure.panels if _has_crosses(panel)]
    if not called:
        return figure
    words = tr("Crosses: {called}.", called=listed(list(dict.fromkeys(called))))
    return replace(figure, caption=f"{figure.caption} {words}")


class Way(NamedTuple):
    """The sentences on lines that end lowest, or highest; sign is 1 or −1."""

    sign: int
    one: str
    every: str
    some: str


LOWEST = Way(
    1,
    term("At the end lowest: {lowest} ({low}); highest: {highest} ({high})."),
    term("At the end lowest in every panel: {names}."),
    term("At the end lowest: {told}."),
)
HIGHEST = Way(
    -1,
    term("At the end highest: {highest} ({high}); lowest: {lowest} ({low})."),
    term("At the end highest in every panel: {names}."),
    term("At the end highest: {told}."),
)


def at_the_end(figure: Figure, way: Way = LOWEST) -> str:
    """Which lines end lowest and highest of all; for several panels the lowest of each, or the highest. A panel of a
    single line has nothing to compare: for such panels, and for several quantities, the extremes are given."""
    drawn = [lines for panel in _drawn(figure) if (lines := _lines(panel))]
    if len({panel.y.label for panel in _drawn(figure)}) > 1 or not any(len(lines) > 1 for lines in drawn):
        return extremes(figure)
    unit = _unit(_drawn(figure)[0].y.label)
    every = [line for lines in drawn for line in lines]
    several = len(drawn) > 1
    if all(_level(lines) for lines in drawn) and (not several or all(len(lines) > 1 for lines in drawn)):
        return tr("At the end all are within each other's intervals.")
    both = {
        **{"lowest": _names(_foremost(every, 1, several), several), "low": _ending(_foremost(every, 1), unit)},
        **{"highest": _names(_foremost(every, -1, several), several), "high": _ending(_foremost(every, -1), unit)},
    }
    if not several:
        return tr(way.one, **both)
    found = [_names(_foremost(lines, way.sign)) for lines in drawn]
    if len(set(found)) == 1:
        first = tr(way.every, names=found[0])
    else:
        first = tr(way.some, told=_by_panel(found, [lines[0].panel for lines in drawn]))
    return f"{first} {tr(OF_ALL, **both)}"


def highest_at_the_end(figure: Figure) -> str:
    """`at_the_end` where more is better, or for shares that add up to one: the highest first."""
    return at_the_end(figure, HIGHEST)


OF_ALL = term("Of all panels lowest {low} ({lowest}), highest {high} ({highest}).")


def _by_panel(found: Sequence[str], titles: Sequence[str]) -> str:
    """The first names in each panel: by the panels' titles, or, with many panels, how often."""
    by_names = {names: [title for own, title in zip(found, titles, strict=True) if own == names] for names in found}
    if len(found) <= MOST_PANELS and all(titles):
        return "; ".join(f"{named(of)}: {names}" for names, of in by_names.items())
    ranked = sorted(by_names, key=lambda names: -len(by_names[names]))
    told = [tr("{names} in {count}", names=names, count=len(by_names[names])) for names in ranked[:MOST_NAMES]]
    if rest := sum(len(by_names[names]) for names in ranked[MOST_NAMES:]):
        told.append(tr("others in {count}", count=rest))
    return tr("{told} of {panels} panels", told="; ".join(told), panels=len(found))


def most(figure: Figure) -> str:
    """The highest point of all lines, %, its line and time, and where that line ends."""
    lines = [line for panel in _drawn(figure) for line in _lines(panel)]
    if not lines:
        return ""
    several = len(_drawn(figure)) > 1
    line = max(lines, key=lambda one: float(one.y.max()))
    at = int(line.y.argmax())
    told = {"most": _valued(line.y[at], "%"), "name": _names([line], several)}
    if at == len(line.y) - 1:
        return tr("At most {most} ({name}), at the end.", **told)
    return tr(
        "At most {most} ({name}, at {t_s:g} s); {last} at the end.",
        **told,
        **{"t_s": float(line.x[at]), "last": _ending([line], "%")},
    )


def below(figure: Figure, least: float) -> str:
    """The lines that go below a value anywhere, by their names."""
    lines = [line for panel in _drawn(figure) for line in _lines(panel) if line.y.min() < least]
    return _names(lines, len(_drawn(figure)) > 1)


def extremes(figure: Figure) -> str:
    """The highest and the lowest point of all named lines and maps, with their names, for every quantity drawn."""
    found: dict[str, list[Seen]] = {}
    for panel in _drawn(figure):
        for label, line in _shown(panel):
            found.setdefault(label, []).append(line)
    several = len({line.panel for lines in found.values() for line in lines}) > 1
    return " ".join(_extremes(_quantity(figure, label), _unit(label), of, several) for label, of in found.items())


def _extremes(quantity: str, unit: str, lines: Sequence[Seen], several: bool) -> str:
    high, low = max(line.y.max() for line in lines), min(line.y.min() for line in lines)
    told = {"quantity": quantity, "high": _valued(high, unit), "low": _valued(low, unit)}
    top = _names([line for line in lines if _valued(line.y.max(), unit) == told["high"]], several)
    if told["high"] == told["low"]:  # of all points that are drawn, which may be few
        return tr("{quantity}: {high} ({name}).", name=top, **told)
    bottom = _names([line for line in lines if _valued(line.y.min(), unit) == told["low"]], several)
    if top == bottom:
        return tr("{quantity}: from {low} to {high} ({name}).", name=top, **told)
    return tr("{quantity}: highest {high} ({name}), lowest {low} ({other}).", name=top, other=bottom, **told)


def _unit(label: str) -> str:
    """The unit at the end of an axis' label, or nothing: after a comma in brackets there is none."""
    _, comma, tail = label.rpartition(", ")
    return tail if comma and tail.count("(") == tail.count(")") else ""


def _quantity(figure: Figure, label: str) -> str:
    """The quantity on an axis, without unit, as a sentence begins; for an axis without label the figure's title."""
    words = spoken(label.removesuffix(f", {_unit(label)}") or figure.title)
    return words if "α" <= words[:1] <= "ω" else words[:1].upper() + words[1:]


def reading_at(x: float) -> Callable[[Figure], str]:
    """A function that gives the highest and the lowest line at a place of the axis, of those that reach it."""

    def told(figure: Figure) -> str:
        every = [line for panel in _drawn(figure) for line in _lines(panel)]
        there = [line for line in every if len(line.x) > 1 and line.x[0] <= x <= line.x[-1]]
        if len(there) < 2:
            return extremes(figure)
        read = [line._replace(y=np.array([np.interp(x, line.x, line.y)])) for line in there]
        label = figure.panels[0].y.label
        quantity = tr("{quantity} at {x:g}", quantity=_quantity(figure, label), x=x)
        words = _extremes(quantity, _unit(label), read, len(_drawn(figure)) > 1)
        if not (left := len(every) - len(there)):
            return words
        more = plural(
            "{count} of {all} lines does not reach it.", "{count} of {all} lines do not reach it.", left, all=len(every)
        )
        return f"{words} {more}"

    return told


def _has_crosses(panel: Panel) -> bool:
    lines = (mark for mark in panel.marks if isinstance(mark, Line))
    return any(line.exact is not None and np.isfinite(line.exact).any() for line in lines)


def _drawn(figure: Figure) -> list[Panel]:
    """The panels with named marks."""
    return [panel for panel in figure.panels if _shown(panel)]


def _shown(panel: Panel) -> list[tuple[str, Seen]]:
    """The lines and the maps of a panel, each with the label of its quantity."""
    maps = [mark for mark in panel.marks if isinstance(mark, Heat) and np.isfinite(mark.values).any()]
    title = _title(panel)
    heats = [(m.label, Seen("", title, np.zeros(0), m.values[np.isfinite(m.values)], np.nan, np.nan)) for m in maps]
    return [*((panel.y.label, line) for line in _lines(panel)), *heats]


def _lines(panel: Panel) -> list[Seen]:
    """The lines of a panel that have a name and a point, by their known points."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line) and _name(mark)]
    return [_line(line, _title(panel)) for line in lines if np.isfinite(line.y).any()]


def _line(line: Line, title: str) -> Seen:
    known = np.flatnonzero(np.isfinite(line.y))
    x, y = np.asarray(line.x, float)[known], np.asarray(line.y, float)[known]
    lo, hi = (float(y[-1] if end is None else end[known[-1]]) for end in (line.lo, line.hi))
    return Seen(_name(line), title, x, y, lo, hi)


def _title(panel: Panel) -> str:
    return spoken(panel.title).replace("\n", " ")


def _level(lines: Sequence[Seen]) -> bool:
    """Whether the intervals at the end of all lines have a value in common."""
    return max(line.ends[0] for line in lines) <= min(line.ends[1] for line in lines)


def _foremost(lines: Sequence[Seen], sign: int, ranked: bool = False) -> list[Seen]:
    """The line that ends lowest (sign 1) or highest (−1), and those whose intervals overlap its own. In drawing order,
    for a stable sentence; by their ends if requested, and where not all will be named."""
    low, high = min(lines, key=lambda line: sign * line.last).ends
    found = [line for line in lines if line.ends[0] <= high and low <= line.ends[1]]
    return sorted(found, key=lambda line: sign * line.last) if ranked or len(found) > MOST_NAMES + 1 else found


def _names(lines: Sequence[Seen], several: bool = False) -> str:
    """Lines by their names as drawn, with their panels' titles where there are several."""
    found = [", ".join(dict.fromkeys(filter(None, (several * one.panel, one.name)))) for one in lines]
    return named(found, 1 if several else MOST_NAMES)


def named(names: Iterable[str], most: int = MOST_NAMES) -> str:
    """Names in a sentence, each once; of many the first."""
    return few(list(dict.fromkeys(names)), most)


def _name(line: Line) -> str:
    return spoken(line.name or line.label)


def _ending(lines: Sequence[Seen], unit: str) -> str:
    """The last values of lines from the least to the most, "about" it where the interval of such a one is unknown."""
    ends = [min(lines, key=lambda one: one.last), max(lines, key=lambda one: one.last)]
    said = list(dict.fromkeys(wording.number(line.last, DIGITS) for line in ends))
    value = " ".join(filter(None, ("–".join(said), unit)))
    return tr("about {value}", value=value) if any(line.rough for line in ends) else value


def _valued(value: float, unit: str) -> str:
    return " ".join(filter(None, (wording.number(float(value), DIGITS), unit)))
