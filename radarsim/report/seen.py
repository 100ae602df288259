"""What is to be seen in a figure, in a sentence with which its caption begins; and what its crosses are.

Read off the marks that are drawn, so that it is true of every run. Lines whose intervals overlap are told together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from radarsim.language import listed, tr
from radarsim.report import text
from radarsim.report.chart_text import spoken
from radarsim.report.drawing import Figure, Heat, Line, Panel

DIGITS = 3
MOST_PANELS = 4  # told one by one
MOST_NAMES = 3  # told of those that share a place


def begun(figure: Figure, sentence: str) -> Figure:
    """The figure whose caption begins with a sentence, where there is one."""
    return replace(figure, caption=f"{sentence} {figure.caption}") if sentence else figure


def all_begun(
    drawn: Mapping[str, Figure | None], by: Mapping[str, Callable[[Figure], str]]
) -> dict[str, Figure | None]:
    """Figures by name, each that `by` names with the sentence of its function; the others as they are."""
    return {name: begun(one, by[name](one)) if one and name in by else one for name, one in drawn.items()}


def numbered(figure: Figure, number: str) -> Figure:
    """The figure whose caption says which of the paper's it is."""
    return replace(figure, caption=f"{figure.caption} {tr('Figure {number} of the paper.', number=number)}")


def crossed(figure: Figure) -> Figure:
    """The figure whose caption says what its crosses are, where it has any."""
    called = [panel.crosses or tr("exact values") for panel in figure.panels if _has_crosses(panel)]
    if not called:
        return figure
    words = tr("Crosses: {called}.", called=listed(list(dict.fromkeys(called))))
    return replace(figure, caption=f"{figure.caption} {words}")


def at_the_end(figure: Figure, unit: str = "") -> str:
    """Which line ends lowest and which highest, of each panel; nothing for a figure without two lines.

    A line whose interval is not known at its end is neither; where that leaves a panel less than two, the extremes of
    the figure are told.
    """
    every = [lines for panel in figure.panels if len(lines := _ending(panel)) > 1]
    drawn = [[line for line in lines if all(np.isfinite(_interval(line)))] for lines in every]
    if any(len(known) < 2 or _alike(known, lines) for known, lines in zip(drawn, every, strict=True)):
        return extremes(figure, unit)
    if len(drawn) == 1:
        low, high = _lowest(drawn[0], 1), _lowest(drawn[0], -1)
        if len(low) == len(drawn[0]):
            return tr("At the end all are within each other's intervals.")
        return tr(
            "At the end lowest: {lowest} ({low}); highest: {highest} ({high}).",
            **{"lowest": _listed(low), "low": _valued(low[0].y, unit)},
            **{"highest": _listed(high), "high": _valued(high[0].y, unit)},
        )
    if not drawn:
        return ""
    found = [_listed(_lowest(lines, 1)) for lines in drawn]
    counted = sorted(dict.fromkeys(found), key=lambda names: -found.count(names))
    if len(counted) == 1:
        return tr("At the end lowest in every panel: {lowest}.", lowest=counted[0])
    told = [tr("{names} in {count}", names=names, count=found.count(names)) for names in counted[:MOST_NAMES]]
    return tr("At the end lowest: {lowest} of {panels} panels.", lowest=listed(told), panels=len(drawn))


def most(figure: Figure, unit: str = "%") -> str:
    """The highest point of all lines, which line's and when, and where that line ends."""
    lines = [line for panel in figure.panels for line in _ending(panel)]
    if not lines:
        return ""
    line = max(lines, key=lambda one: float(np.nanmax(one.y)))
    at = int(np.nanargmax(line.y))
    return tr(
        "At most {most} ({name}, at {t_s:g} s); {last} at the end.",
        **{"name": _name(line), "t_s": float(line.x[at])},
        **{"most": _valued(line.y[at : at + 1], unit), "last": _valued(line.y, unit)},
    )


def highest_at_the_end(figure: Figure) -> str:
    """Which line ends highest, of each panel: of what adds up to one."""
    drawn = [(panel, lines) for panel in figure.panels if len(lines := _ending(panel)) > 1]
    found = [(_title(panel), _listed(_lowest(lines, -1))) for panel, lines in drawn]
    if not found:
        return ""
    if len({names for _, names in found}) == 1:
        return tr("At the end highest: {highest}.", highest=found[0][1])
    return tr("At the end highest: {highest}.", highest="; ".join(map(": ".join, found[:MOST_PANELS])))


def extremes(figure: Figure, unit: str = "") -> str:
    """The highest and the lowest point of all named lines, whose they are, of the quantity of the first panel."""
    found = [(panel, line) for panel in figure.panels for line in _named(panel)]
    if not found:
        return ""
    axis = found[0][0].y.label
    several = len({panel.title for panel in figure.panels if panel.y.label == axis}) > 1
    found = [pair for pair in found if pair[0].y.label == axis]
    top = max(found, key=lambda pair: float(np.nanmax(pair[1].y)))
    bottom = min(found, key=lambda pair: float(np.nanmin(pair[1].y)))
    high, low = np.nanmax(top[1].y), np.nanmin(bottom[1].y)
    unit = unit or _unit(axis)
    return tr(
        "{quantity}: highest {high} ({name}), lowest {low} ({other}).",
        quantity=_quantity(figure, axis),
        **{"high": _valued(np.array([high]), unit), "name": _whose(*top, several)},
        **{"low": _valued(np.array([low]), unit), "other": _whose(*bottom, several)},
    )


def first_extremes(figure: Figure) -> str:
    """The highest and the lowest point of the first panel, with the unit of its axis."""
    return extremes(replace(figure, panels=figure.panels[:1]))


def _unit(label: str) -> str:
    """The unit at the end of an axis' label, or nothing: what follows a comma in brackets is none."""
    _, comma, tail = label.rpartition(", ")
    return tail if comma and tail.count("(") == tail.count(")") else ""


def _quantity(figure: Figure, label: str) -> str:
    """What an axis shows, without its unit, as a sentence begins; of an axis without a label the figure's title."""
    words = spoken(label.removesuffix(f", {_unit(label)}") or figure.title)
    return words if "α" <= words[:1] <= "ω" else words[:1].upper() + words[1:]


def reading_at(x: float) -> Callable[[Figure], str]:
    """A function that tells which line is highest and which lowest at a place of the axis."""

    def told(figure: Figure) -> str:
        found = [
            (float(np.interp(x, line.x, line.y)), panel, line)
            for panel in figure.panels
            for line in _named(panel)
            if len(line.x) > 1 and line.x[0] <= x <= line.x[-1] and panel.y.label == figure.panels[0].y.label
        ]
        if len(found) < 2:
            return extremes(figure)
        top, bottom = max(found, key=lambda one: one[0]), min(found, key=lambda one: one[0])
        several = len(figure.panels) > 1
        return tr(
            "{quantity} at {x:g}: highest {high} ({name}), lowest {low} ({other}).",
            x=x,
            quantity=_quantity(figure, figure.panels[0].y.label),
            **{"high": text.number(top[0], DIGITS), "name": _whose(*top[1:], several)},
            **{"low": text.number(bottom[0], DIGITS), "other": _whose(*bottom[1:], several)},
        )

    return told


def over(figure: Figure, unit: str = "") -> str:
    """The least and the largest value of all maps of a figure; where there is none, of the lines of its first panel."""
    values = [np.ravel(m.values) for panel in figure.panels for m in panel.marks if isinstance(m, Heat)]
    found = np.concatenate([np.zeros(0), *values])
    found = found[np.isfinite(found)]
    if not found.size:
        return extremes(replace(figure, panels=figure.panels[:1]), unit)
    low, high = text.number(float(found.min()), DIGITS), _valued(found[[found.argmax()]], unit)
    return tr("From {low} to {high}.", low=low, high=high)


def _has_crosses(panel: Panel) -> bool:
    lines = (mark for mark in panel.marks if isinstance(mark, Line))
    return any(line.exact is not None and np.isfinite(line.exact).any() for line in lines)


def _ending(panel: Panel) -> list[Line]:
    """The lines of a panel that have a name and a last point."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line) and _name(mark)]
    return [line for line in lines if len(line.y) and np.isfinite(line.y[-1])]


def _named(panel: Panel) -> list[Line]:
    """The lines of a panel that have a name and a point."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line) and _name(mark)]
    return [line for line in lines if np.isfinite(line.y).any()]


def _alike(known: Sequence[Line], lines: Sequence[Line]) -> bool:
    """Whether those of known intervals are all alike, though there are others."""
    return len(known) < len(lines) and len(_lowest(known, 1)) == len(known)


def _title(panel: Panel) -> str:
    return spoken(panel.title).replace("\n", " ")


def _whose(panel: Panel, line: Line, several: bool) -> str:
    """A line by its name, with its panel's title where there are several panels."""
    return ", ".join(dict.fromkeys(filter(None, (_title(panel) if several else "", _name(line)))))


def _lowest(lines: Sequence[Line], sign: int) -> list[Line]:
    """The line that ends lowest (sign 1) or highest (−1), and those whose intervals overlap its own."""
    first = min(lines, key=lambda line: sign * float(line.y[-1]))
    low, high = _interval(first)
    near = [line for line in lines if line is not first and _interval(line)[0] <= high and low <= _interval(line)[1]]
    return [first, *near]


def _interval(line: Line) -> tuple[float, float]:
    """The interval of a line's last point: the point where it has none, not-a-number where it is not known."""
    if line.lo is None or line.hi is None:
        return float(line.y[-1]), float(line.y[-1])
    return float(line.lo[-1]), float(line.hi[-1])


def _listed(lines: Sequence[Line]) -> str:
    names = [_name(line) for line in lines]
    if len(names) > MOST_NAMES:
        return tr("{name} and {count} more", name=names[0], count=len(names) - 1)
    return listed(names)


def _name(line: Line) -> str:
    return spoken(line.name or line.label)


def _valued(values: np.ndarray, unit: str) -> str:
    return " ".join(filter(None, (text.number(float(values[-1]), DIGITS), tr(text.unit(unit)) if unit else "")))
