"""A sample of the rows of tracks, in stretches spread over the whole time."""

from collections.abc import Mapping, Sequence

import numpy as np

MIN_TRACK_ROWS = 10  # of a track; shorter ones carry almost no information
ROUGH_ROWS = 600  # on which the maximum is searched before all rows are used
MAX_STRETCH_ROWS, MIN_STRETCH_ROWS = 100, 25  # rows of a stretch of a track, if not all are used


def sample_rows(tracks: Sequence[Mapping[str, np.ndarray]], max_rows: int) -> list[Mapping[str, np.ndarray]]:
    """About `most` rows of tracks, columns (n,) each, spread over all tracks and their whole time: stretches of rows
    that follow each other; the tracks themselves where they have no more rows. Of very many tracks only some."""
    row_count = sum(len(track["t_s"]) for track in tracks)
    if row_count <= max_rows:
        return list(tracks)
    length = min(max(max_rows // len(tracks), MIN_STRETCH_ROWS), MAX_STRETCH_ROWS)
    stretches = [
        {name: column[start : start + length] for name, column in track.items()}
        for track in tracks
        for start in _stretch_starts(len(track["t_s"]), length)
    ]
    stretch_count = min(max(round(max_rows / length), 1), len(stretches))
    return [stretches[(2 * i + 1) * len(stretches) // (2 * stretch_count)] for i in range(stretch_count)]


def _stretch_starts(rows: int, length: int) -> list[int]:
    """The first rows of as many stretches of a length as fit into a track, spread evenly."""
    return np.rint(np.linspace(0, max(rows - length, 0), max(rows // length, 1))).astype(int).tolist()
