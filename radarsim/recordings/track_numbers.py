"""Track numbers over time: numbers used again, and several plots of one scan."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.positions import plane_positions

# Usual intervals, and time, after which a number belongs to another track.
REUSE_GAP_INTERVALS = 30.0
MIN_REUSE_GAP_S = 60.0
SAME_SCAN_SHARE = 0.5  # of the usual interval: plots of one track that are nearer than that are of one scan
# Share of intervals that are whole scans of a turning antenna, within this part of a scan.
MIN_REGULAR_SHARE = 0.75
SCAN_TOLERANCE = 0.1
MIN_INTERVALS, MAX_INTERVALS = 5, 100  # between the last plots of a track, from which its usual interval follows


@dataclass
class _TrackHistory:
    """The history of a track number.

    Its name, how many tracks it has named, the last two plots (time and position) of the current track, the last
    intervals, their median, and the time within which another plot is of the same scan."""

    name: str
    uses: int = 1
    last_plots: list[tuple[float, np.ndarray]] = field(default_factory=list)
    intervals: np.ndarray = field(default_factory=lambda: np.zeros(0))
    usual_interval_s: float = math.nan
    same_scan_s: float = 0.0

    def select_plots(self, t: np.ndarray, positions: np.ndarray, retained: np.ndarray, names: np.ndarray) -> None:
        """Select the next plots, at times (n,) and positions (n, 3): retained and names are changed in place."""
        intervals = np.diff(t, prepend=self.last_plots[-1][0] if self.last_plots else t[0])
        self._update_intervals(intervals if self.last_plots else intervals[1:])
        # without a usual interval it is NaN, and there is no gap
        gap = max(REUSE_GAP_INTERVALS * self.usual_interval_s, MIN_REUSE_GAP_S)
        is_same_scan = (intervals <= 0) | (intervals < self.same_scan_s)
        is_same_scan[:1] &= bool(self.last_plots)
        if self.uses == 1 and not (intervals > gap).any() and not is_same_scan.any():
            self.last_plots = [*self.last_plots, *zip(t[-2:].tolist(), positions[-2:], strict=True)][-2:]
            return
        i = 0
        while i < len(t):
            last_time = self.last_plots[-1][0] if self.last_plots else -math.inf
            if self.last_plots and t[i] - last_time > gap:
                self.uses, self.last_plots = self.uses + 1, []
            end = i + 1
            if self.last_plots and (t[i] <= last_time or t[i] - last_time < self.same_scan_s):
                retained[i] = False  # the rest of a scan that began in the previous rows
            else:
                while end < len(t) and (t[end] == t[i] or t[end] - t[i] < self.same_scan_s):
                    end += 1
                best = i + self._nearest(t[i:end], positions[i:end])
                retained[i:end] = np.arange(i, end) == best
                names[best] = self.name if self.uses == 1 else f"{self.name} ({self.uses})"
                self.last_plots = [*self.last_plots, (float(t[best]), positions[best])][-2:]
            i = end

    def _update_intervals(self, intervals: np.ndarray) -> None:
        """Update the usual interval of a track, and whether it is that of a turning antenna."""
        self.intervals = intervals = np.concatenate([self.intervals, intervals[intervals > 0]])[-MAX_INTERVALS:]
        if intervals.size < MIN_INTERVALS:
            return
        self.usual_interval_s = float(np.median(intervals))
        scans = intervals / self.usual_interval_s
        is_whole = (np.abs(scans - np.rint(scans)) < SCAN_TOLERANCE) & (scans > SAME_SCAN_SHARE)
        self.same_scan_s = SAME_SCAN_SHARE * self.usual_interval_s if is_whole.mean() >= MIN_REGULAR_SHARE else 0.0

    def _nearest(self, t: np.ndarray, positions: np.ndarray) -> int:
        """The index of the plot of one scan that is nearest to the extrapolated track; the first if that is unknown."""
        if len(t) == 1 or not self.last_plots:
            return 0
        expected = np.tile(self.last_plots[-1][1], (len(t), 1))
        if len(self.last_plots) == 2:
            (t0, first), (t1, second) = self.last_plots
            expected = second + np.outer((t - t1) / (t1 - t0), second - first)
        offsets = (
            (positions - expected)[:, :2]
            if np.isfinite(positions[:, :2]).all() and np.isfinite(expected[:, :2]).all()
            else positions - expected
        )
        squared_distances = np.nansum(offsets**2, axis=1)
        return int(squared_distances.argmin()) if np.isfinite(offsets).any(axis=1).all() else 0


class TrackNumbers:
    """The numbers of tracks over time.

    A number that is used again after a gap belongs to another track, which gets a name of its own: every tracker has
    dropped the first track by then. Of several plots of a track in a scan (equal times; with a turning antenna, times
    less than a scan apart) the one nearest to the extrapolated track is retained: the others are reflections, or the
    same plot repeated."""

    def __init__(self) -> None:
        self._tracks: dict[str, _TrackHistory] = {}
        self.doubles = 0

    @property
    def reused(self) -> int:
        """How often a number was used again for another track."""
        return sum(track.uses - 1 for track in self._tracks.values())

    def select(self, t: np.ndarray, names: list[str], places: Mapping[str, np.ndarray]) -> tuple[np.ndarray, list[str]]:
        """Select the next rows (n,), and name their tracks; places: columns (n,)."""
        retained = np.ones(len(t), dtype=bool)
        track_names = np.array(names, dtype=object)
        all_positions = plane_positions(places)
        positions = np.full((len(t), 3), np.nan) if all_positions is None else all_positions
        for name, rows in rows_by_name(names).items():
            if name:
                track_retained, new_names = retained[rows], track_names[rows]
                self._tracks.setdefault(name, _TrackHistory(name)).select_plots(
                    t[rows], positions[rows], track_retained, new_names
                )
                retained[rows], track_names[rows] = track_retained, new_names
        self.doubles += int((~retained).sum())
        return retained, track_names[retained].tolist()
