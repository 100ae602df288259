"""Rows of one track: of its plots, and of its estimates."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from radarsim.recordings import grouping, read_plots
from radarsim.studies.recording_interface import Track

ROW_ARRAYS = ("estimate", "sigma", "probability", "residual", "nis", "score", "residual_sigma")  # arrays (F, n, …)


def select_rows(track: Track, rows: np.ndarray) -> Track:
    """Select rows of a track, as copies."""
    arrays: dict[str, Any] = {
        name: getattr(track, name)[:, rows] for name in ROW_ARRAYS if getattr(track, name) is not None
    }
    return replace(track, t_s=track.t_s[rows], **arrays)


def join_tracks(tracks: list[Track]) -> Track:
    """Join the pieces of a track."""
    first = tracks[0]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(track, name) for track in tracks], axis=1)
        for name in ROW_ARRAYS
        if getattr(first, name) is not None
    }
    return replace(first, t_s=np.concatenate([track.t_s for track in tracks]), **arrays)


class TrackRows(NamedTuple):
    """The rows of one track in a piece of a file: its name, None where tracks are not distinguished, and columns (n,)
    as in `read_plots.Piece`."""

    name: str | None
    columns: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]
    positions: dict[str, np.ndarray]

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(self.columns["t_s"])


def split_by_track(piece: read_plots.Piece) -> list[TrackRows]:
    """The rows of each track, in the order in which the tracks first appear."""
    tables = (piece.columns, piece.truth, piece.positions)
    if piece.tracks is None:
        return [TrackRows(None, *tables)]
    return [
        TrackRows(name, *({key: column[rows] for key, column in columns.items()} for columns in tables))
        for name, rows in grouping.rows_by_name(piece.tracks).items()
    ]
