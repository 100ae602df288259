"""Files of plots, and tracks over them, all at once."""

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recordings import csv_output, read_plots, rows_by_track
from radarsim.recordings import track as recordings_track
from radarsim.report.atomic_files import OutputFile


def read(path, choices):
    parts = [piece.columns for piece in read_plots.pieces(path, choices)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def track(experiment, source):
    parts = []
    followed = recordings_track.track_plots(experiment, source, lambda track, name: parts.append(track))
    if len(followed.tracks) > 1:
        raise ConfigError(f"{source}: one track wanted, got {len(followed.tracks)}")
    return followed.case, rows_by_track.join_tracks(parts)


def write(track, path):
    with OutputFile(path) as file:
        file.write([csv_output.track_header(track), *csv_output.track_lines(track)])
