"""Whether estimates after a long gap are more than rounding: the same plots followed again, times stretched by 10⁻¹⁰.

A covariance extrapolated over a gap can be so much larger than a plot's that the difference of the two, which is the
estimate's, has no digit left: σ comes out wrong, zero or not at all. Stretched times change what is right in the tenth
digit, and what is rounding altogether. Only the rows after a gap are compared: a filter of several models that has lost
its target magnifies any difference by itself.
"""

import numpy as np

from radarsim.engine.results import Track
from radarsim.studies.interface import Tracker

STRETCH = 1 + 2.0**-33
SIGMA, ESTIMATE, CHANCE = 1e-5, 1e-3, 1e-3  # that stretched times may change: of σ, in σ, in probability
WIDE, PERIODS = 30.0, 1000.0  # a gap in median intervals so far, or in the config's scan periods
AFTER = 100  # rows compared after a gap
LENGTHS = ("m", "rad")  # units of what is measured, and so never known exactly


class Twin:
    """A second tracker beside the first, and where the longest interval before the first loss was."""

    def __init__(self, tracker: Tracker, period_s: float):
        self.tracker, self.period_s, self.whole = tracker, period_s, tracker.most_rows is not None
        self.origin: float | None = None  # the first time
        self.seen: list[float] = []  # the last time of each measured number
        self.usual = np.inf  # the longest interval that is no gap
        self.rows, self.compared, self.gap_s, self.gap_row = 0, 0, 0.0, 0

    def lost(self, columns: dict[str, np.ndarray], track: Track) -> bool:
        """Whether the track (of the first tracker) over the next rows has lost its digits.

        Then `gap_s` is the longest interval up to there and `gap_row` the row, from 0, that ends it.
        """
        t, *measured = columns.values()
        if self.origin is None:
            self.origin, self.seen = float(t[0]), [float(t[0])] * len(measured)
            rises = np.diff(t)[np.diff(t) > 0]
            self.usual = min(WIDE * np.median(rises) if rises.size else np.inf, PERIODS * self.period_s)
        steps = self._steps(t, measured)
        compared = self._after(steps > self.usual)
        bad = np.zeros(len(track.t_s), dtype=bool)
        if compared.any() or not self.whole:
            with np.errstate(all="ignore"):
                other = self.tracker.feed(columns | {"t_s": (t - self.origin) * STRETCH})
            # Of several plots of a time the track has one row.
            bad = unlike(track, other) & np.isin(track.t_s, t[compared])
        first = np.searchsorted(t, track.t_s[bad.argmax()], side="right") if bad.any() else len(t)
        longest = int(steps[:first].argmax())
        if steps[longest] > self.gap_s:
            self.gap_s, self.gap_row = float(steps[longest]), self.rows + longest
        self.rows += len(t)
        return bool(bad.any())

    def _steps(self, t: np.ndarray, measured: list[np.ndarray]) -> np.ndarray:
        """The time (n,) since the row that last had what a row has: the longest of its numbers, zero where none."""
        longest = np.zeros(len(t))
        for j, column in enumerate(measured):
            present = np.isfinite(column)
            until = np.maximum.accumulate(np.where(present, t, self.seen[j]))
            before = np.concatenate([[self.seen[j]], until[:-1]])
            longest, self.seen[j] = np.maximum(longest, np.where(present, t - before, 0.0)), float(until[-1])
        return longest

    def _after(self, wide: np.ndarray) -> np.ndarray:
        """Which rows (n,) are among those after a gap."""
        n = len(wide)
        ends = np.maximum.accumulate(np.where(wide, np.arange(n) + AFTER, self.compared))
        self.compared = int(ends[-1]) - n
        return np.arange(n) < ends


def unlike(track: Track, other: Track) -> np.ndarray:
    """Which rows (n,) of two tracks differ by more than they may, or hold a σ that cannot be."""
    if track.estimate.shape != other.estimate.shape:
        return np.ones(len(track.t_s), dtype=bool)
    known, sigma = np.isfinite(track.estimate), track.sigma
    length = np.array([unit in LENGTHS for _, unit in track.components])
    with np.errstate(all="ignore"):
        bad = known & (~np.isfinite(sigma) | (length & (sigma <= 0)))
        bad |= known != np.isfinite(other.estimate)
        bad |= known & (np.abs(sigma - other.sigma) > SIGMA * sigma)
        bad |= known & (sigma > 0) & (np.abs(track.estimate - other.estimate) > ESTIMATE * sigma)
        rows = bad.any(axis=(0, 2))
        if track.probability is not None and other.probability is not None:
            rows |= (np.abs(track.probability - other.probability) > CHANCE).any(axis=(0, 2))
    return rows
