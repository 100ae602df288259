"""The note of a table's row: why its interval covers less than 95 %, or what the interval leaves out.

In memory a note is a record, as rules depend on it; files and public tables have its text, made at the end. An empty
text is no note. A user study may bring texts in place of records: such a note concerns every interval of its row."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class RowNote:
    """A note: its kind, by which rules know it; its text; and how the names of the intervals that it concerns begin.

    Without such a beginning it concerns all intervals of its row."""

    kind: str
    text: str
    interval: str = ""

    def __str__(self) -> str:
        return f"{self.interval}: {self.text}" if self.interval else self.text

    def about(self, interval: str) -> "RowNote":
        """The same note on the intervals of the row whose names begin so: `gain` on `gain_lo` and `gain_hi`."""
        return replace(self, interval=interval)


def notes_where(mask: np.ndarray, note: RowNote, otherwise: "np.ndarray | str" = "") -> np.ndarray:
    """Notes (rows,): this one where the mask holds, elsewhere the others, by default none."""
    notes = np.full(np.shape(mask), "", dtype=object)
    notes[...] = otherwise
    notes[mask] = note
    return notes


def notes_about(notes: np.ndarray, interval: str) -> np.ndarray:
    """Notes (rows,), each of them on the intervals whose names begin so; no note stays none."""
    return np.array([note.about(interval) if note else "" for note in notes], dtype=object)


def note_kinds(table: "pd.DataFrame") -> np.ndarray:
    """The kind of each row's note, (rows,); empty where a row has no note, or one of a user study."""
    notes = table["note"] if "note" in table else [""] * len(table)
    return np.array([note.kind if isinstance(note, RowNote) else "" for note in notes], dtype=object)


def has_note(table: "pd.DataFrame") -> np.ndarray:
    """Which rows of a table, (rows,), have a note."""
    return table["note"].ne("").to_numpy() if "note" in table else np.full(len(table), False)


def concerns(note: object, interval: str) -> bool:
    """Whether a row's note, if it has one, concerns its interval of this name.

    >>> heavy = RowNote("heavy_tails", "heavy tails")
    >>> [concerns(note, "sigma") for note in (heavy, heavy.about("sigma"), heavy.about("gain"), "")]
    [True, True, False, False]
    """
    return bool(note) and (not isinstance(note, RowNote) or interval.startswith(note.interval))


def with_note_texts(table: "pd.DataFrame") -> "pd.DataFrame":
    """A copy of the table with the texts of its notes, as files have them."""
    if "note" not in table or table["note"].dtype != object:
        return table.copy()
    return table.assign(note=note_texts(table))


def note_texts(table: "pd.DataFrame") -> list[str]:
    """The texts of the notes of a table's rows; none where it has no such column."""
    notes = table["note"].tolist() if "note" in table else []
    texts: list[str] = []
    previous, text = None, ""
    for note in notes:
        if note is not previous:  # a few notes in thousands of rows, most of them in a row
            previous, text = note, str(note) if isinstance(note, RowNote) else note
        texts.append(text)
    return texts
