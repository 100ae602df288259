"""What is to be seen in a figure, in a sentence with which its caption begins; and what its crosses are.

Read off the marks that are drawn, so that it is true of every run. Lines whose intervals overlap are told together.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radarsim.language import listed, tr
from radarsim.report import text
from radarsim.report.chart_text import spoken
from radarsim.report.drawing import Figure, Heat, Line, Panel

DIGITS = 3
MOST_NAMES = 3  # told of those that share a place


def begun(figure: Figure, sentence: str) -> Figure:
    """The figure whose caption begins with a sentence, where there is one."""
    return replace(figure, caption=f"{sentence} {figure.caption}") if sentence else figure


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

    A line whose interval is not known at its end is neither.
    """
    ending = ([line for line in _ending(panel) if all(np.isfinite(_interval(line)))] for panel in figure.panels)
    drawn = [lines for lines in ending if len(lines) > 1]
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


def over(figure: Figure, unit: str = "") -> str:
    """The least and the largest value of all maps or lines of a figure."""
    values = [np.ravel(m.values) for panel in figure.panels for m in panel.marks if isinstance(m, Heat)]
    values = values or [m.y for panel in figure.panels[:1] for m in panel.marks if isinstance(m, Line)]
    found = np.concatenate([np.zeros(0), *values])
    found = found[np.isfinite(found)]
    if not found.size:
        return ""
    low, high = text.number(float(found.min()), DIGITS), _valued(found[[found.argmax()]], unit)
    return tr("From {low} to {high}.", low=low, high=high)


def _has_crosses(panel: Panel) -> bool:
    lines = (mark for mark in panel.marks if isinstance(mark, Line))
    return any(line.exact is not None and np.isfinite(line.exact).any() for line in lines)


def _ending(panel: Panel) -> list[Line]:
    """The lines of a panel that have a name and a last point."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line) and _name(mark)]
    return [line for line in lines if len(line.y) and np.isfinite(line.y[-1])]


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
