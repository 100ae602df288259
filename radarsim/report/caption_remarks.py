"""Remarks in the captions of figures: their number in the paper, unusual crosses, names; and what holds in all.

A caption says what is drawn; the numbers are in the answer, and in the titles of the marks."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from radarsim.language.translate import join_names, quote_name, shorten_names, term, tr
from radarsim.report.drawing.line_points import rough_points
from radarsim.report.drawing.model import Figure, Line, Panel
from radarsim.report.math_text import plain_text

MAX_NAMES = 3  # in a remark


def with_figure_number(figure: Figure, number: str) -> Figure:
    """The figure with its number in the paper in the caption."""
    message = term("Figures {number} of the paper.") if "–" in number else term("Figure {number} of the paper.")
    return replace(figure, caption=f"{figure.caption} {tr(message, number=number)}")


def with_meaning_of_crosses(figure: Figure) -> Figure:
    """The figure with the meaning of its crosses in the caption, if that is another than exact values."""
    meanings = [panel.crosses for panel in figure.panels if _has_crosses(panel) and panel.crosses]
    if not meanings:
        return figure
    remark = tr("Crosses: {called}.", called=join_names(list(dict.fromkeys(meanings))))
    return replace(figure, caption=f"{figure.caption} {remark}")


def conventions(figures: Iterable[Figure]) -> str:
    """What holds in all figures and their captions do not repeat, as far as any of these figures needs it."""
    described = list(figures)
    panels = [panel for figure in described for panel in figure.panels]
    lines = [line for panel in panels for line in _lines(panel)]
    banded = [panel for panel in panels if _has_bands(panel)]
    sentences = []
    if banded and all(panel.has_intervals for panel in banded):
        sentences.append(tr("Bands and whiskers: 95 % intervals."))
    elif any(panel.has_intervals for panel in banded):
        sentences.append(tr("Bands and whiskers: 95 % intervals, unless a legend says otherwise."))
    if any(rough_points(line).any() for line in lines):
        sentences.append(tr("Thin lines and open points: rough, as a note in the table says."))
    if any(_has_crosses(panel) and not panel.crosses for panel in panels):
        sentences.append(tr("Crosses: exact values."))
    if any(figure.has_joined_names for figure in described):
        sentences.append(tr("“=” joins the names of coinciding curves."))
    if any(_has_zeros(panel) for panel in panels):
        sentences.append(tr("Logarithmic axes show no zeros."))
    return " ".join(sentences)


def _lines(panel: Panel) -> list[Line]:
    return [mark for mark in panel.marks if isinstance(mark, Line)]


def _has_crosses(panel: Panel) -> bool:
    return any(line.exact is not None and np.isfinite(line.exact).any() for line in _lines(panel))


def _has_bands(panel: Panel) -> bool:
    return any(line.lo is not None and np.isfinite(line.lo).any() for line in _lines(panel))


def _has_zeros(panel: Panel) -> bool:
    """Whether a line lacks points since they are zero on a logarithmic axis."""
    return panel.y.scale == "log" and any((np.asarray(line.y) == 0).any() for line in _lines(panel))


def lines_below(figure: Figure, limit: float) -> str:
    """The names of the lines that go below a value anywhere, with their panels' titles where there are several."""
    panels = [panel for panel in figure.panels if _named_lines(panel)]
    names = [
        _line_name(panel if len(panels) > 1 else None, line)
        for panel in panels
        for line in _named_lines(panel)
        if np.nanmin(np.asarray(line.y, float)) < limit
    ]
    return join_few_names(names, 1 if len(panels) > 1 else MAX_NAMES)


def _line_name(panel: Panel | None, line: Line) -> str:
    """The name of a line, after that of its panel."""
    name = plain_text(line.name or line.label)
    title = "" if panel is None else _title(panel)
    return ", ".join(dict.fromkeys(filter(None, (title, name)))) if title else quote_name(name)


def _named_lines(panel: Panel) -> list[Line]:
    """The lines of a panel that have a name and a point."""
    lines = (line for line in _lines(panel) if plain_text(line.name or line.label))
    return [line for line in lines if np.isfinite(line.y).any()]


def _title(panel: Panel) -> str:
    return plain_text(panel.title).replace("\n", " ")


def join_few_names(names: Iterable[str], max_names: int = MAX_NAMES) -> str:
    """Names in a sentence, each once; of many the first."""
    return shorten_names(list(dict.fromkeys(names)), max_names)
