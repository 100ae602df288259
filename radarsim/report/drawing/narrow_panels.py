"""Words of a panel that do not fit side by side, set one above the other.

The name of a row stands above it where the figure is too narrow for names at the left; notes along the top that would
meet stand in several rows."""

from dataclasses import replace

import numpy as np

from radarsim.report.drawing.model import Figure, Line, Note, Panel
from radarsim.report.drawing.style import LETTER_MM, NAME_LETTER_MM, NAME_LINE_MM, wrap
from radarsim.report.math_text import letters_in

MIN_PANEL_MM = 40.0  # between the names of its rows and the values beside it
RIM_MM = 3.0  # of a figure's width, free of names
NAME_GAP_MM = 0.4  # for each further line of a name
NAME_ROOM = 0.9  # of a row, above the highest one
LABEL_SHARE = 1.0  # of a panel, that its label may take


def fit_rows(figure: Figure) -> Figure:
    """The figure with the names of rows above these, in panels that would be too narrow beside them."""
    if figure.columns > 1:
        return figure
    return replace(figure, panels=tuple(_fit_panel(panel, figure.width_mm) for panel in figure.panels))


def _fit_panel(panel: Panel, width_mm: float) -> Panel:
    names = [text for _, text in panel.y.ticks]
    values = [mark.text for mark in panel.marks if isinstance(mark, Note) and mark.place == "e"]
    values_mm = LETTER_MM * max(map(letters_in, values), default=0.0)
    names_mm = LETTER_MM * max(map(letters_in, names), default=0.0)
    if not names or panel.height_mm is None or width_mm - values_mm - names_mm >= MIN_PANEL_MM:
        return panel
    wrapped = [wrap(name, (width_mm - RIM_MM) / NAME_LETTER_MM, " ") for name in names]
    lines = max(name.count("\n") + 1 for name in wrapped)
    notes = [Note(0.0, y, name, "row") for (y, _), name in zip(panel.y.ticks, wrapped, strict=True)]
    first, last = float(panel.y.limits[0] or 0.0), min(y for y, _ in panel.y.ticks) - NAME_ROOM
    return replace(
        panel,
        x=replace(panel.x, label=wrap(panel.x.label, LABEL_SHARE * (width_mm - values_mm) / LETTER_MM, " ")),
        y=replace(panel.y, ticks=tuple((value, "") for value, _ in panel.y.ticks), limits=(first, last)),
        marks=(*panel.marks, *notes),
        height_mm=panel.height_mm + (NAME_LINE_MM * lines + NAME_GAP_MM * (lines - 1)) * abs(last - first),
    )


def stack_top_notes(panel: Panel, length_mm: float) -> Panel:
    """The panel, its axis of x so long, with each note along its top in the lowest row where it meets no other."""
    notes = [mark for mark in panel.marks if isinstance(mark, Note) and mark.place == "top"]
    lines = [np.asarray(mark.x, float) for mark in panel.marks if isinstance(mark, Line) and len(mark.x)]
    if len(notes) < 2 or not lines:
        return panel
    x = np.concatenate(lines)
    low, high = np.nanmin(x), np.nanmax(x)
    scale_mm = length_mm / (high - low or 1.0)
    row_ends: list[float] = []
    rows: dict[Note, int] = {}
    for note in sorted(notes, key=lambda note: note.x):
        centre, half_mm = scale_mm * (note.x - low), NAME_LETTER_MM * (letters_in(note.text) + 1) / 2
        row = next((n for n, end in enumerate(row_ends) if end <= centre - half_mm), len(row_ends))
        row_ends[row : row + 1] = [centre + half_mm]
        rows[note] = row
    marks = (replace(mark, row=rows[mark]) if isinstance(mark, Note) and mark in rows else mark for mark in panel.marks)
    return replace(panel, marks=tuple(marks))
