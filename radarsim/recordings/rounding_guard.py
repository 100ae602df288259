"""Detect estimates that a long gap has reduced to rounding errors.

To detect estimates after a long gap that are only rounding errors, the same plots are filtered again with times
stretched by 10⁻¹⁰. A covariance extrapolated over a gap can be so much larger than that of a plot that the covariance
of the estimate, their difference, has no digit left: σ is wrong, zero or missing. Stretched times change correct values
in the tenth digit, and rounding errors completely. Only the rows after a gap are compared, since a multiple-model
filter that has lost its target magnifies any difference by itself."""

import numpy as np

from radarsim.studies.recording_interface import Track, Tracker

TIME_STRETCH = 1 + 2.0**-33
# permitted changes by stretched times: of σ, in σ, in probability
MAX_SIGMA_CHANGE = 1e-5
MAX_ESTIMATE_CHANGE = 1e-3
MAX_PROBABILITY_CHANGE = 1e-3
LOSS_GAP_INTERVALS, LOSS_GAP_PERIODS = 30.0, 1000.0  # a gap in median intervals so far, or in the config's scan periods
ROWS_AFTER_GAP = 100  # rows compared after a gap
LENGTH_UNITS = ("m", "rad")  # units of measured numbers, which are never known exactly
DAY_S = 86400.0


def gap_message(gap_s: float) -> str:
    """The fault that estimates after a gap are only rounding errors, and why."""
    days = f" ({gap_s / DAY_S:.3g} days)" if gap_s >= DAY_S else ""
    return (
        f"after a gap of {gap_s:g} s{days} the target may be so far away that a filter's numbers are lost in rounding: "
        "split the file here"
    )


class RoundingGuard:
    """A second tracker with stretched times, which shows when the first has lost its digits in a gap."""

    def __init__(self, tracker: Tracker, period_s: float):
        self.tracker, self.period_s, self.takes_whole_track = tracker, period_s, tracker.most_rows is not None
        self.origin: float | None = None  # the first time
        self.last_times: list[float] = []  # the last time of each measured number
        self.max_interval_s = np.inf  # the longest interval that is no gap
        self.rows, self.pending_rows, self.gap_s, self.gap_row = 0, 0, 0.0, 0

    def has_lost_digits(self, columns: dict[str, np.ndarray], track: Track) -> bool:
        """Whether the first tracker's track over the next rows has lost its digits.

        Then `gap_s` is the longest interval so far, and `gap_row` the row, from 0, that ends it."""
        t, *measured = columns.values()
        if self.origin is None:
            self.origin, self.last_times = float(t[0]), [float(t[0])] * len(measured)
            rises = np.diff(t)[np.diff(t) > 0]
            self.max_interval_s = min(
                LOSS_GAP_INTERVALS * np.median(rises) if rises.size else np.inf, LOSS_GAP_PERIODS * self.period_s
            )
        intervals = self._intervals(t, measured)
        is_compared = self._is_after_gap(intervals > self.max_interval_s)
        is_lost = np.zeros(len(track.t_s), dtype=bool)
        if is_compared.any() or not self.takes_whole_track:
            with np.errstate(all="ignore"):
                stretched_track = self.tracker.feed(columns | {"t_s": (t - self.origin) * TIME_STRETCH})
            # Several plots of one time make one row of the track.
            is_lost = differing_rows(track, stretched_track) & np.isin(track.t_s, t[is_compared])
        last_index = np.searchsorted(t, track.t_s[is_lost.argmax()], side="right") if is_lost.any() else len(t)
        longest_index = int(intervals[:last_index].argmax())
        if intervals[longest_index] > self.gap_s:
            self.gap_s, self.gap_row = float(intervals[longest_index]), self.rows + longest_index
        self.rows += len(t)
        return bool(is_lost.any())

    def _intervals(self, t: np.ndarray, measured: list[np.ndarray]) -> np.ndarray:
        """Times (n,) since the last row with the same numbers: the longest over them, zero if a row has none."""
        intervals = np.zeros(len(t))
        for j, column in enumerate(measured):
            is_present = np.isfinite(column)
            last_seen = np.maximum.accumulate(np.where(is_present, t, self.last_times[j]))
            previous = np.concatenate([[self.last_times[j]], last_seen[:-1]])
            intervals = np.maximum(intervals, np.where(is_present, t - previous, 0.0))
            self.last_times[j] = float(last_seen[-1])
        return intervals

    def _is_after_gap(self, is_gap: np.ndarray) -> np.ndarray:
        """Whether rows (n,) are among the ROWS_AFTER_GAP rows after a gap."""
        n = len(is_gap)
        end_rows = np.maximum.accumulate(np.where(is_gap, np.arange(n) + ROWS_AFTER_GAP, self.pending_rows))
        self.pending_rows = int(end_rows[-1]) - n
        return np.arange(n) < end_rows


def differing_rows(track: Track, stretched_track: Track) -> np.ndarray:
    """Whether rows (n,) of two tracks differ by more than permitted, or hold an impossible σ."""
    if track.estimate.shape != stretched_track.estimate.shape:
        return np.ones(len(track.t_s), dtype=bool)
    has_estimate, sigma = np.isfinite(track.estimate), track.sigma
    is_length = np.array([unit in LENGTH_UNITS for _, unit in track.components])
    with np.errstate(all="ignore"):
        differs = has_estimate & (~np.isfinite(sigma) | (is_length & (sigma <= 0)))
        differs |= has_estimate != np.isfinite(stretched_track.estimate)
        # NaN differs from every number: hence "not within" in place of "beyond".
        differs |= has_estimate & ~(np.abs(sigma - stretched_track.sigma) <= MAX_SIGMA_CHANGE * sigma)
        differs |= (
            has_estimate
            & (sigma > 0)
            & ~(np.abs(track.estimate - stretched_track.estimate) <= MAX_ESTIMATE_CHANGE * sigma)
        )
        differing = differs.any(axis=(0, 2))
        if track.probability is not None and stretched_track.probability is not None:
            is_close = np.isclose(
                track.probability, stretched_track.probability, rtol=0, atol=MAX_PROBABILITY_CHANGE, equal_nan=True
            )
            differing |= ~is_close.all(axis=(0, 2))
    return differing
