"""Remarks in the captions of figures: their number in the paper, the meaning of crosses, names of lines.

A caption says what is drawn; the numbers are in the answer, and in the titles of the marks."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from radarsim.language.translate import join_names, shorten_names, tr
from radarsim.report.drawing.model import Figure, Line, Panel
from radarsim.report.math_text import plain_text

MAX_NAMES = 3  # in a remark


def with_figure_number(figure: Figure, number: str) -> Figure:
    """The figure with its number in the paper in the caption."""
    return replace(figure, caption=f"{figure.caption} {tr('Figure {number} of the paper.', number=number)}")


def with_meaning_of_crosses(figure: Figure) -> Figure:
    """The figure with the meaning of its crosses, if any, in the caption."""
    meanings = [panel.crosses or tr("exact values") for panel in figure.panels if _has_crosses(panel)]
    if not meanings:
        return figure
    remark = tr("Crosses: {called}.", called=join_names(list(dict.fromkeys(meanings))))
    return replace(figure, caption=f"{figure.caption} {remark}")


def _has_crosses(panel: Panel) -> bool:
    lines = (mark for mark in panel.marks if isinstance(mark, Line))
    return any(line.exact is not None and np.isfinite(line.exact).any() for line in lines)


def lines_below(figure: Figure, limit: float) -> str:
    """The names of the lines that go below a value anywhere, with their panels' titles where there are several."""
    panels = [panel for panel in figure.panels if _named_lines(panel)]
    names = [
        ", ".join(dict.fromkeys(filter(None, ((len(panels) > 1) * _title(panel), plain_text(line.name or line.label)))))
        for panel in panels
        for line in _named_lines(panel)
        if np.nanmin(np.asarray(line.y, float)) < limit
    ]
    return join_few_names(names, 1 if len(panels) > 1 else MAX_NAMES)


def _named_lines(panel: Panel) -> list[Line]:
    """The lines of a panel that have a name and a point."""
    lines = (mark for mark in panel.marks if isinstance(mark, Line) and plain_text(mark.name or mark.label))
    return [line for line in lines if np.isfinite(line.y).any()]


def _title(panel: Panel) -> str:
    return plain_text(panel.title).replace("\n", " ")


def join_few_names(names: Iterable[str], max_names: int = MAX_NAMES) -> str:
    """Names in a sentence, each once; of many the first."""
    return shorten_names(list(dict.fromkeys(names)), max_names)
