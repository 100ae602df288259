"""Where recorded plots are in the plane, as far as their file says it: for the plan view.

North and east are counted from the radar, or whatever stands at the origin.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

MOST = 2000  # places of a track that are kept; of more, every second is dropped again and again


def in_plane(places: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """North, east and range (n, 3), m, of columns (n,) that say where plots are; None where they do not.

    By x_m (north) and z_m (east) as `radarsim import` writes them; else by range and bearing, where the slant range
    stands for that over ground; else with the range alone.
    """
    if {"x_m", "y_m", "z_m"} <= set(places):
        x, y, z = (places[name] for name in ("x_m", "y_m", "z_m"))
        r = places.get("range_m", np.sqrt(x**2 + y**2 + z**2))
        return np.stack([x, z, r], axis=1)
    if "range_m" not in places:
        return None
    r = places["range_m"]
    b = places.get("bearing_rad", np.full(len(r), np.nan))
    return np.stack([r * np.cos(b), r * np.sin(b), r], axis=1)


@dataclass
class Path:
    """Times (n,) and places (n, 3) of a track's plots, north, east and range in m, thinned to at most MOST."""

    t_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    places: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    seen: int = 0
    stride: int = 1

    def add(self, t_s: np.ndarray, places: Mapping[str, np.ndarray]) -> None:
        """The next plots; those without any place are left out."""
        found = in_plane(places)
        if found is None:
            return
        kept = (self.seen + np.arange(len(t_s))) % self.stride == 0
        kept &= np.isfinite(found).any(axis=1)
        self.seen += len(t_s)
        self.t_s = np.concatenate([self.t_s, t_s[kept]])
        self.places = np.concatenate([self.places, found[kept]])
        while len(self.t_s) > MOST:
            self.stride *= 2
            self.t_s, self.places = self.t_s[::2], self.places[::2]
