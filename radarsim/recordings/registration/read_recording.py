"""Read a file of `radarsim import` with its identities, site and zero of time."""

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recordings import read_plots
from radarsim.recordings.aircraft_match import KINDS

SITE_LINE = re.compile(r"# radar(?: \S+)? \(WGS 84\): (\S+) deg (\S+) deg (\S+) m;")
ZERO_LINE = re.compile(r"# t_s: seconds from .*\((\S+) s after (1970|midnight|the start of its clock)\);")
PLOT_CHOICES = (("t_s", "range_m", "bearing_rad"), ("t_s", "range_m"))
UNKNOWN_ZERO = "the start of its clock"
POSITION_CHOICES = (("t_s", "x_m", "y_m", "z_m"),)


@dataclass(frozen=True)
class Recording:
    """A file of `radarsim import`: columns (n,), tracks, identities by KINDS; the place of its radar, degrees and m,
    where it says so; the zero of its times, s, and what that counts from."""

    columns: dict[str, np.ndarray]
    tracks: list[str]
    identity: dict[str, list[str]]
    site: tuple[float, float, float] | None
    zero: tuple[float, str]


def read_recording(path: str, choices: Sequence[Sequence[str]]) -> Recording:
    """A file of `radarsim import`, with the first of the choices of columns that it has; rows without these are left
    out, and those that are marked as of no aircraft, which have no track. Raises ConfigError."""
    pieces = list(read_plots.pieces(path, choices, texts=(*KINDS, "radar", "marks")))
    columns = {name: np.concatenate([part.columns[name] for part in pieces]) for name in pieces[0].columns}
    tracks = [name for part in pieces for name in part.tracks or [""] * len(part.columns["t_s"])]
    texts = {name: [text for part in pieces for text in part.texts[name]] for name in pieces[0].texts}
    is_used = np.isfinite([columns[name] for name in list(columns)[:2]]).all(axis=0)
    if texts.pop("marks", None):
        is_used &= np.array(tracks) != ""
    radars, (sites, zero) = set(texts.pop("radar", [""])), _read_comments(path)
    if choices == PLOT_CHOICES and len(radars) > 1:
        fault = "must hold plots of one radar, by `radarsim import --at SAC/SIC=LAT,LON,HEIGHT`"
        raise ConfigError(f"{path}: {fault}; has {', '.join(sorted(radars))}")
    if len(sites) > 1:
        raise ConfigError(f"{path}: must count x_m, y_m, z_m from one place, has {len(sites)} radars")
    if "address" not in texts:
        texts["address"] = tracks
    rows = np.flatnonzero(is_used).tolist()
    return Recording(
        {name: column[rows] for name, column in columns.items()},
        [tracks[i] for i in rows],
        {name: [column[i] for i in rows] for name, column in texts.items()},
        next(iter(sites), None),
        zero,
    )


def _read_comments(path: str) -> tuple[set[tuple[float, float, float]], tuple[float, str]]:
    """The places of radars and the zero of times in the first lines of a file."""
    sites, zero = set(), (0.0, UNKNOWN_ZERO)
    with open(path, encoding="utf-8-sig") as file:
        for line in itertools.takewhile(lambda line: line.startswith("#"), file):
            is_valid = True
            try:
                if match := SITE_LINE.match(line):
                    lat, lon, height = map(float, match.groups())
                    sites.add((lat, lon, height))
                    is_valid = abs(lat) <= 90 and math.isfinite(lon + height)
                if match := ZERO_LINE.match(line):
                    zero = (float(match[1]), match[2])
                    is_valid = math.isfinite(zero[0])
            except ValueError:
                is_valid = False
            if not is_valid:
                fault = "must be as radarsim import writes it, with finite numbers"
                raise ConfigError(f"{path}: {fault}; got {line.rstrip()[:120]!r}")
    return sites, zero
