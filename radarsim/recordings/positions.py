"""Positions of plots in the plane, thinned for figures.

North and east are counted from the radar, or from whatever stands at the origin."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

MAX_FIGURE_ROWS = 2000  # rows of a track that are retained for figures


def plane_positions(columns: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """North, east and range (n, 3) of plots, m, from columns (n,) of a file; None without positions and ranges.

    From x_m (north) and z_m (east) as `radarsim import` writes them; else from range and bearing, with the slant range
    instead of the ground range; else the range alone."""
    if {"x_m", "y_m", "z_m"} <= set(columns):
        x, y, z = (columns[name] for name in ("x_m", "y_m", "z_m"))
        r = columns.get("range_m", np.sqrt(x**2 + y**2 + z**2))
        return np.stack([x, z, r], axis=1)
    if "range_m" not in columns:
        return None
    r = columns["range_m"]
    b = columns.get("bearing_rad", np.full(len(r), np.nan))
    return np.stack([r * np.cos(b), r * np.sin(b), r], axis=1)


@dataclass(kw_only=True)
class ThinnedRows:
    """Rows of a track, spread over its whole time: of more than max_rows, every second block is dropped.

    row_numbers (n,): the number in the track of each retained row."""

    max_rows: int = MAX_FIGURE_ROWS
    block_rows: int = 1
    row_numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    rows_so_far: int = 0
    stride: int = 1

    def select(self, new_rows: int) -> np.ndarray:
        """Whether the retained rows (n,) and new_rows more are retained: (n + new_rows,)."""
        row_numbers = np.concatenate([self.row_numbers, self.rows_so_far + np.arange(new_rows)])
        while (retained := row_numbers // self.block_rows % self.stride == 0).sum() > self.max_rows:
            self.stride *= 2
        self.row_numbers, self.rows_so_far = row_numbers[retained], self.rows_so_far + new_rows
        return retained


@dataclass
class PlotPositions(ThinnedRows):
    """Times (n,) and positions (n, 3) of a track's plots: north, east and range in m."""

    t_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    positions: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def add(self, t_s: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Add plots; those without any position are left out."""
        positions = plane_positions(columns)
        if positions is None:
            return
        has_position = np.isfinite(positions).any(axis=1)
        retained = self.select(int(has_position.sum()))
        self.t_s = np.concatenate([self.t_s, t_s[has_position]])[retained]
        self.positions = np.concatenate([self.positions, positions[has_position]])[retained]
