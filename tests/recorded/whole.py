"""Files of plots, and tracks over them, all at once."""

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recorded import follow, plots
from radarsim.report.files import Writer


def read(path, choices):
    parts = [piece.columns for piece in plots.pieces(path, choices)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def track(experiment, source):
    parts = []
    followed = follow.follow(experiment, source, lambda track, name: parts.append(track))
    if len(followed.tracks) > 1:
        raise ConfigError(f"{source}: one track wanted, got {len(followed.tracks)}")
    return followed.case, follow.join_tracks(parts)


def write(track, path):
    with Writer(path) as file:
        file.write([plots.header_of(track), *plots.rows_of(track)])
