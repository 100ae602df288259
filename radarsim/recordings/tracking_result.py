"""The result of filters over recorded plots: counts, gaps, innovation tests, errors against the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from radarsim.config.experiment import Case
from radarsim.recordings.positions import PlotPositions, ThinnedRows
from radarsim.recordings.rows_by_track import join_tracks, select_rows
from radarsim.recordings.study_part import recording_interface
from radarsim.studies.plot_arrays import estimate_errors, true_column
from radarsim.studies.recording_interface import Track

GAP_INTERVALS = 3.0  # in median intervals
START_ESTIMATES = 10  # of a filter, which are not compared with the truth
SAMPLE_ROWS, BLOCK_ROWS = 5000, 100  # rows of a track kept for the advice, and rows of a block of them


@dataclass
class InnovationTally:
    """The number of tests of a filter's innovations, and the sum of their normalised squares."""

    filter: str
    name: str
    freedom: int
    count: int = 0
    total: float = 0.0

    @property
    def mean(self) -> float:
        """The mean for each degree of freedom: 1 for a consistent filter."""
        return self.total / (self.count * self.freedom) if self.count else np.nan


@dataclass
class ErrorSums:
    """A filter's errors against the truth in one component: number, sum of squares, and sum of squares over the
    filter's variances. The first START_ESTIMATES estimates are left out."""

    filter: str
    component: str
    unit: str
    estimates_so_far: int = 0
    count: int = 0
    squares: float = 0.0
    normalised_squares: float = 0.0

    def add(self, error: np.ndarray, sigma: np.ndarray) -> None:
        """Count errors (n,) with the filter's standard deviations (n,); not-a-number where it gives none."""
        skipped = max(0, START_ESTIMATES - self.estimates_so_far)
        self.estimates_so_far += len(error)
        error, sigma = error[skipped:], sigma[skipped:]
        self.count += len(error)
        self.squares += float((error**2).sum())
        self.normalised_squares += float(((error / sigma) ** 2).sum())

    @property
    def rms(self) -> float:
        """Root of the mean square error, in the component's unit."""
        return (self.squares / self.count) ** 0.5 if self.count else np.nan

    @property
    def ratio(self) -> float:
        """Root of the mean square error in the filter's standard deviations: 1 for a consistent filter."""
        return (self.normalised_squares / self.count) ** 0.5 if self.count else np.nan


@dataclass
class TrackingResult:
    """The result of filters over a file of plots: rows, time, gaps, missing values, tests, data for figures."""

    case: Case
    rows: int = 0
    first_s: float = np.nan
    last_s: float = np.nan
    missing: dict[str, int] = field(default_factory=dict)
    gaps: int = 0
    longest_gap_s: float = 0.0
    longest_gap_at_s: float = np.nan
    tallies: dict[tuple[str, str], InnovationTally] = field(default_factory=dict)
    filters_with_estimate: set[str] = field(default_factory=set)
    figure_track: Track | None = None  # thinned for figures
    figure_rows: ThinnedRows = field(default_factory=ThinnedRows)
    sample: "RowSample" = field(default_factory=lambda: RowSample())
    median_s: float = np.nan
    tracks: dict[str, "TrackingResult"] = field(default_factory=dict)  # by name, where the file has several
    trackless_rows: int = 0  # rows of no track
    reused_numbers: int = 0  # track numbers used again for another track
    doubles: int = 0  # further plots of a track in a scan, left out
    fills: Mapping[str, int] = field(default_factory=dict)  # numbers that stand for none, left out, by column
    errors: dict[tuple[str, str], ErrorSums] = field(default_factory=dict)  # by filter and component, with truth
    positions: PlotPositions = field(default_factory=PlotPositions)  # of the plots, for the plan view

    def add(self, columns: Mapping[str, np.ndarray], track: Track) -> None:
        """Count one more piece of the file."""
        t = columns["t_s"]
        self._count_gaps(np.unique(t))
        estimates = np.isfinite(track.estimate).any(axis=(1, 2))
        self.filters_with_estimate |= {
            name for name, has_estimate in zip(track.filters, estimates, strict=True) if has_estimate
        }
        for name, column in list(columns.items())[1:]:
            self.missing[name] = self.missing.get(name, 0) + int(np.isnan(column).sum())
        nis = np.empty((len(track.filters), len(t), 0)) if track.nis is None else track.nis
        for q, (name, freedom) in enumerate(track.tested):
            for f, filter_name in enumerate(track.filters):
                values = nis[f, :, q]
                values = values[np.isfinite(values)]
                tally = self.tallies.setdefault((filter_name, name), InnovationTally(filter_name, name, freedom))
                tally.count, tally.total = tally.count + values.size, tally.total + float(values.sum())
        self.sample.add(columns)
        retained = self.figure_rows.select(len(track.t_s))
        self.figure_track = select_rows(
            join_tracks([self.figure_track, track]) if self.figure_track else track, np.flatnonzero(retained)
        )
        self.rows += len(t)

    def add_errors(self, track: Track, t_s: np.ndarray, truth: Mapping[str, np.ndarray]) -> None:
        """Count the errors of a piece of the track; truth: columns (n,) `true_COMPONENT_UNIT` at times t_s (n,)."""
        rows = np.searchsorted(t_s, track.t_s)  # several plots of one time make one row of the track
        for c, (component, unit) in enumerate(track.components):
            column = truth.get(true_column(component, unit))
            if column is None:
                continue
            estimate = track.estimate[:, :, c : c + 1]
            error = estimate_errors(estimate, column[rows, None], [(component, unit)])[..., 0]
            for f, name in enumerate(track.filters):
                is_counted = np.isfinite(error[f]) & ~(track.sigma[f, :, c] <= 0)
                sums = self.errors.setdefault((name, component), ErrorSums(name, component, unit))
                sums.add(error[f, is_counted], track.sigma[f, is_counted, c])

    @property
    def filters_without_estimate(self) -> list[str]:
        """The filters of the config that never had an estimate."""
        return [member.name for member in self.case.spec.members if member.name not in self.filters_with_estimate]

    @property
    def filters_without_test(self) -> list[str]:
        """The filters with estimates whose innovations cannot be tested, since they give no covariance of them."""
        tested = {name for (name, _), tally in self.tallies.items() if tally.count}
        return [member.name for member in self.case.spec.members if member.name in self.filters_with_estimate - tested]

    @property
    def filters_without_plots(self) -> dict[str, list[str]]:
        """The filters that took no plot, with the columns that they need and the file has not."""
        interface, spec = recording_interface(self.case), self.case.spec
        needed = {member.name: list(interface.columns_of(spec, member)) for member in spec.members}
        return {name: names for name, names in needed.items() if names and self.sample.columns.keys().isdisjoint(names)}

    def _count_gaps(self, t: np.ndarray) -> None:
        if self.rows == 0:
            self.first_s = self.last_s = float(t[0])
            self.median_s = float(np.median(np.diff(t))) if len(t) > 1 else np.nan
        intervals = np.diff(t, prepend=self.last_s)
        is_gap = intervals > GAP_INTERVALS * self.median_s
        self.gaps += int(is_gap.sum())
        if is_gap.any() and intervals.max() > self.longest_gap_s:
            self.longest_gap_s, longest_index = float(intervals.max()), int(intervals.argmax())
            self.longest_gap_at_s = float(t[longest_index] - intervals[longest_index])
        self.last_s = float(t[-1])


@dataclass
class RowSample(ThinnedRows):
    """Rows of a track, columns (n,), in blocks that follow each other."""

    max_rows: int = SAMPLE_ROWS
    block_rows: int = BLOCK_ROWS
    columns: dict[str, np.ndarray] = field(default_factory=dict)

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """Add the next rows."""
        retained = self.select(len(columns["t_s"]))
        previous = self.columns or {name: column[:0] for name, column in columns.items()}
        self.columns = {name: np.concatenate([previous[name], column])[retained] for name, column in columns.items()}

    def stretches(self) -> list[dict[str, np.ndarray]]:
        """The sampled rows in stretches without gaps: the whole track if no block was dropped."""
        ends = np.flatnonzero(np.diff(self.row_numbers) > 1) + 1
        parts = {name: np.split(column, ends) for name, column in self.columns.items()}
        return [{name: parts[name][i] for name in parts} for i in range(len(ends) + 1)]
