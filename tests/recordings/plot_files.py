"""Files of plots, and tracks over them, all at once."""

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recordings import csv_rows, read_plots, track_rows
from radarsim.recordings import track as recordings_track
from radarsim.report.atomic_files import Writer


def read(path, choices):
    parts = [piece.columns for piece in read_plots.pieces(path, choices)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def track(experiment, source):
    parts = []
    followed = recordings_track.track_plots(experiment, source, lambda track, name: parts.append(track))
    if len(followed.tracks) > 1:
        raise ConfigError(f"{source}: one track wanted, got {len(followed.tracks)}")
    return followed.case, track_rows.join_tracks(parts)


def write(track, path):
    with Writer(path) as file:
        file.write([csv_rows.track_header(track), *csv_rows.track_rows(track)])
