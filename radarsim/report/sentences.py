"""Sentences of an answer, each with the measured intervals that it rests on.

A sentence rests on the intervals that it gives, and on those by which it calls something larger or good enough if a
wider interval would change that. `report.answer_warnings` warns where one of them is too narrow. Of a plain text, which
the `answer` of a user study may return, nothing is known: it is taken to rest on σ and gain of every filter at the
end."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

    Rows: TypeAlias = pd.DataFrame | pd.Series


class MeasuredInterval(NamedTuple):
    """An interval of a table: the table's name, the row's label in it, and the interval's name, `gain` of `gain_lo`."""

    table: str
    row: int
    name: str


@dataclass(frozen=True)
class Sentence:
    """A sentence, or a part of one, with the intervals that it rests on."""

    text: str
    intervals: tuple[MeasuredInterval, ...] = ()

    def __str__(self) -> str:
        return self.text

    @property
    def sources(self) -> tuple[str, ...]:
        """The tables of its intervals; of the first, which its first statement is about, the column too."""
        return tuple(f"{i.table}.{i.name}" if n == 0 else i.table for n, i in enumerate(self.intervals))

    def with_text(self, text: str) -> "Sentence":
        """Another text on the same intervals."""
        return Sentence(text, self.intervals)


def intervals(table: str, name: str, *rows: "Rows") -> tuple[MeasuredInterval, ...]:
    """The intervals of a name in rows of a table; a Series is one row."""
    labels: Iterable[Any] = (label for part in rows for label in ([part.name] if part.ndim == 1 else part.index))
    return tuple(MeasuredInterval(table, int(label), name) for label in labels)


def compose(text: str, parts: Iterable[Sentence]) -> Sentence:
    """A sentence with this text that rests on the intervals of its parts."""
    return Sentence(text, tuple(interval for part in parts for interval in part.intervals))


def join(separator: str, parts: Iterable[Sentence]) -> Sentence:
    """The texts of the parts joined by a separator, as one sentence."""
    parts = list(parts)
    return compose(separator.join(part.text for part in parts), parts)


def would_exceed(limit: float, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which intervals, (rows,), reach over a limit that they are below if they are twice as wide."""
    return (high <= limit) & (high + (high - low) / 2 > limit)


def as_sentence(sentence: "str | Sentence", tables: "Mapping[str, pd.DataFrame]") -> Sentence:
    """The sentence itself; of a plain text one that rests on σ and gain at the last scan of every filter."""
    if isinstance(sentence, Sentence):
        return sentence
    final_rows = {name: _final_rows(tables[name]) for name in ("curves", "gains") if name in tables}
    names = {"curves": "sigma", "gains": "gain"}
    return Sentence(
        sentence, tuple(i for table, rows in final_rows.items() for i in intervals(table, names[table], rows))
    )


def _final_rows(table: "pd.DataFrame") -> "pd.DataFrame":
    keys = [key for key in ("case", "filter", "baseline", "component") if key in table]
    return table.groupby(keys, sort=False).tail(1) if len(table) else table
