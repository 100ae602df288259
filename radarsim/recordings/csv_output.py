"""Tracks and columns of numbers as rows of CSV."""

import itertools
import math
import os
from collections.abc import Iterator, Mapping

import numpy as np

from radarsim.report.atomic_files import OutputFile
from radarsim.studies.recording_interface import Track


def track_header(track: Track, has_track_name: bool = False) -> tuple[str, ...]:
    """The columns of a track; has_track_name: preceded by the name of the recorded track."""
    models = 0 if track.probability is None else track.probability.shape[2]
    columns = ("t_s", "filter", "component", "unit", "estimate", "sigma")
    score_columns = () if track.numbers is None else ("track", "score")
    name_column = ("recorded_track",) if has_track_name else ()
    return (*name_column, *columns, *(f"probability_{m + 1}" for m in range(models)), *score_columns)


def track_lines(track: Track, name: str | None = None) -> Iterator[tuple[str, ...]]:
    """Rows of a track: t_s, filter, component, unit, estimate, sigma, the models' probabilities, number and score.

    name: of the recorded track, put first."""
    name_cell = () if name is None else (name,)
    for i, t in enumerate(track.t_s.tolist()):
        for f, filter_name in enumerate(track.filters):
            further_cells: tuple[str, ...] = ()
            if track.probability is not None:
                further_cells = tuple(map(number_text, track.probability[f, i].tolist()))
            if track.numbers is not None and track.score is not None:
                further_cells = (*further_cells, str(track.numbers[f]), number_text(float(track.score[f, i])))
            numbers = zip(track.estimate[f, i].tolist(), track.sigma[f, i].tolist(), track.components, strict=True)
            for estimate, sigma, (component, unit) in numbers:
                if not math.isnan(estimate):
                    yield (
                        *name_cell,
                        repr(t),
                        filter_name,
                        component,
                        unit,
                        repr(estimate),
                        number_text(sigma),
                        *further_cells,
                    )


def number_text(value: float) -> str:
    """A number as text, '' for NaN."""
    return "" if math.isnan(value) else repr(value)


def column_texts(column: np.ndarray) -> Iterator[str]:
    """Numbers (n,) as texts, '' for NaN."""
    if column.dtype.kind != "f":
        return map(str, column.tolist())
    missing = np.isnan(column)
    if missing.all():
        return itertools.repeat("", len(column))
    return map(number_text if missing.any() else repr, column.tolist())


def write_columns(
    columns: Mapping[str, np.ndarray], path: str | os.PathLike, config: str | os.PathLike | None = None
) -> None:
    """Write columns (n,) of numbers as CSV, an empty cell for NaN, never over the config; errors as of `OutputFile`."""
    with OutputFile(path, {"the config": config}) as file:
        file.write([tuple(columns)])
        file.write(zip(*map(column_texts, columns.values()), strict=True))
