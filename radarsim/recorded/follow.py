"""Run the filters of an experiment over recorded plots, and simulate plots to try them on.

To detect estimates after a long gap that are only rounding errors, the same plots are filtered again with times
stretched by 10⁻¹⁰. A covariance extrapolated over a gap can be so much larger than that of a plot that the covariance
of the estimate, their difference, has no digit left: σ is wrong, zero or missing. Stretched times change correct values
in the tenth digit, and rounding errors completely. Only the rows after a gap are compared, since a multiple-model
filter that has lost its target magnifies any difference by itself.

The plots of many realisations are written as arrays of NumPy (.npz), or with one row for each plot as Parquet or CSV.
Memory does not grow with their number."""

import os
import shlex
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.linalg import LinAlgError

from radarsim.config.case_choice import case_choice
from radarsim.config.experiment import Case, Experiment
from radarsim.config.fields import unknown_to
from radarsim.config.schema import LARGEST_REALISATIONS
from radarsim.engine.results import Track
from radarsim.errors import ConfigError, PlotFault, argument
from radarsim.recorded import plots
from radarsim.recorded.plots import PlotPositions, ThinnedRows, column_texts
from radarsim.report.files import Writer
from radarsim.studies import outside
from radarsim.studies.interface import Drawn, RecordedPlots, Tracker, true_column
from radarsim.studies.registry import module as home_of
from radarsim.studies.registry import study
from radarsim.threads import mapping

# ---- rounding --------------------------------------------------------------------------------------------------------
TIME_STRETCH = 1 + 2.0**-33
# permitted changes by stretched times: of σ, in σ, in probability
MAX_SIGMA_CHANGE = 1e-5
MAX_ESTIMATE_CHANGE = 1e-3
MAX_PROBABILITY_CHANGE = 1e-3
LOSS_GAP_INTERVALS, LOSS_GAP_PERIODS = 30.0, 1000.0  # a gap in median intervals so far, or in the config's scan periods
ROWS_AFTER_GAP = 100  # rows compared after a gap
LENGTH_UNITS = ("m", "rad")  # units of measured numbers, which are never known exactly


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


# ---- follow ----------------------------------------------------------------------------------------------------------
GAP_INTERVALS = 3.0  # in median intervals
START_ESTIMATES = 10  # of a filter, which are not compared with the truth
SAMPLE_ROWS, BLOCK_ROWS = 5000, 100  # rows of a track kept for the advice, and rows of a block of them
ROW_ARRAYS = ("estimate", "sigma", "probability", "residual", "nis", "score", "residual_sigma")  # arrays (F, n, …)


def recording_interface(case: Case) -> RecordedPlots:
    """The recorded-plots interface of a case's study, which `one_case` has checked for."""
    interface = study(case.study).recording_interface()
    assert interface is not None
    return interface


InterfacePart = Literal["tracker", "simulated", "drawing", "likelihood"]


def unknown_inherited_keys(case: Case, part: InterfacePart) -> list[str]:
    """The keys of a case, dotted, that an inherited part of its study's interface does not know.

    That happens where the keys of a study extend those of the study from which it inherits."""
    interface = recording_interface(case)
    module = getattr(interface, part).__module__
    if module == RecordedPlots.__module__ or interface.of_any_keys:  # the default of no study
        return []
    if f"{module}.".startswith(f"{home_of(case.study)}."):  # of the study itself
        return []
    packages = module.split(".")
    return unknown_to(case.spec, ".".join(packages[:3] if packages[0] == "radarsim" else packages[:1]))


def refuse_inherited_part(case: Case, part: InterfacePart) -> None:
    """Raise ConfigError if an inherited part of a study's interface would ignore keys that it does not know."""
    if keys := unknown_inherited_keys(case, part):
        module = getattr(recording_interface(case), part).__module__
        raise ConfigError(
            f"study {case.study}: its part `{part}` of recorded plots is that of {module}, which does not know "
            f"{', '.join(keys)}: it must have one of its own"
        )


def single_case(experiment: Experiment, purpose: str, command: str) -> Case:
    """The only case of an experiment, of a study with plots; raises ConfigError.

    purpose and command are for the message, which lists the choices; {} in the command is the config."""
    config_name = experiment.path or experiment.stem
    if len(experiment.cases) > 1:
        count = len(experiment.cases)
        choices = case_choice(experiment, command)
        raise ConfigError(f"{config_name}: must be one case to {purpose}, got {count}; {choices}")
    (case,) = experiment.cases
    if study(case.study).recording_interface() is None:
        if purpose == "simulate":
            raise ConfigError(f"{config_name}: study: {case.study} draws no plots: its filters take bursts of pulses")
        raise ConfigError(f"{config_name}: study: {case.study} has no filters for recorded plots")
    return case


def simulated(experiment: Experiment, realisation: int = 0) -> dict[str, np.ndarray]:
    """The plots of one realisation of an experiment's one case, exactly those of a run, and the truth as true_….
    Columns have equal length, with NaN where a plot is missed. Raises ConfigError for a realisation that no run has."""
    if not 0 <= realisation < LARGEST_REALISATIONS:
        raise ConfigError(f"realisation: must be from 0 to {LARGEST_REALISATIONS - 1}, got {realisation}")
    case = case_with_plots(experiment)
    return dict(recording_interface(case).simulated(case, realisation))


def case_with_plots(experiment: Experiment) -> Case:
    """The only case of an experiment, of a study that draws plots; raises ConfigError."""
    case = single_case(experiment, "simulate", "radarsim simulate {} -o PLOTS.csv")
    refuse_inherited_part(case, "simulated")
    refuse_inherited_part(case, "drawing")
    return case


def batches(experiment: Experiment, n: int, first: int = 0, chunk: int | None = None) -> Iterator[Drawn]:
    """The plots of n realisations of an experiment's one case from number `first` on, chunk by chunk, in flat memory.
    Raises ConfigError, at once, for realisations that no run has."""
    counts = {"n": (n, 1), "first": (first, 0), "chunk": (n if chunk is None else chunk, 1)}
    n, first, size = (_whole_number(name, *count) for name, count in counts.items())
    if first + n > LARGEST_REALISATIONS:
        argument_name = argument("first + n", "--realisations: STOP")
        raise ConfigError(f"{argument_name}: must be at most {LARGEST_REALISATIONS}, got {first + n}")
    case = case_with_plots(experiment)
    plots, last, case_study = recording_interface(case), first + n, study(case.study)
    world = cache(
        lambda: outside.world_of(
            case_study, case, plots.drawn(case, first, 1), case_study.prepare(case).axes.components
        )
    )
    shared_fields: dict[str, Any] = {"seed": case.seed, "known": world}
    return (replace(plots.drawn(case, i, min(size, last - i)), **shared_fields) for i in range(first, last, size))


def _whole_number(name: str, value: Any, minimum: int) -> int:
    """A value as a whole number, which may be given as a float; raises ConfigError."""
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not is_number or not float(value).is_integer() or value < minimum:
        raise ConfigError(f"{name}: must be a whole number >= {minimum}, got {value!r}")
    return int(value)


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
class Followed:
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
    tracks: dict[str, "Followed"] = field(default_factory=dict)  # by name, where the file has several
    trackless_rows: int = 0  # rows of no track
    reused_numbers: int = 0  # track numbers used again for another track
    doubles: int = 0  # further plots of a track in a scan, left out
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
            error = track.estimate[:, :, c] - column[rows]
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


def select_rows(track: Track, rows: np.ndarray) -> Track:
    """Select rows of a track, as copies."""
    arrays: dict[str, Any] = {
        name: getattr(track, name)[:, rows] for name in ROW_ARRAYS if getattr(track, name) is not None
    }
    return replace(track, t_s=track.t_s[rows], **arrays)


def join_tracks(tracks: list[Track]) -> Track:
    """Join the pieces of a track."""
    first = tracks[0]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(track, name) for track in tracks], axis=1)
        for name in ROW_ARRAYS
        if getattr(first, name) is not None
    }
    return replace(first, t_s=np.concatenate([track.t_s for track in tracks]), **arrays)


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


class TrackFollower:
    """The filters of a case over one track of a file of plots."""

    def __init__(self, case: Case, source: str | os.PathLike, name: str | None):
        interface = recording_interface(case)
        self.source, self.name = source, name
        self.tracker, self.followed = interface.tracker(case), Followed(case)
        self.rounding_guard = RoundingGuard(interface.tracker(case), interface.scan_period_s(case.spec))

    def process_rows(self, rows: "TrackRows") -> Track:
        """The estimates over the next rows of the track; raises ConfigError where they are only rounding errors, or a
        filter cannot take a row.

        The estimates are compared with the truth where its names match the components."""
        columns = rows.columns
        try:
            track = self.tracker.feed(columns)
            is_lost = self.rounding_guard.has_lost_digits(columns, track)
        except LinAlgError as error:
            message = "intervals so different leave a filter's equations without solution"
            raise ConfigError(f"{self.source}: {self._track_prefix()}t_s: {message}") from error
        except PlotFault as fault:
            raise ConfigError(f"{self._row_location(self.rounding_guard.rows + fault.row)}: {fault}") from fault
        if is_lost:
            gap = f"{self.rounding_guard.gap_s:g} s"
            message = f"after a gap of {gap} a filter's numbers are lost in rounding: split the file here"
            raise ConfigError(f"{self._row_location(self.rounding_guard.gap_row)}: t_s: {message}")
        self.followed.add(columns, track)
        self.followed.add_errors(track, columns["t_s"], rows.truth)
        self.followed.positions.add(columns["t_s"], rows.positions)
        return track

    def _row_location(self, row: int) -> str:
        if self.name is None:
            return plots.place_of(self.source, row)
        return f"{self.source}: {self._track_prefix()}row {row + 1} of it"

    def _track_prefix(self) -> str:
        return "" if self.name is None else f"track {self.name}: "


def follow(
    experiment: Experiment,
    source: str | os.PathLike,
    sink: Callable[[Track, str | None], None] = lambda track, name: None,
    threads: int | None = None,
    progress: Callable[[int], None] = lambda rows: None,
) -> Followed:
    """The filters of an experiment's one case over the recorded plots in a CSV file, piece by piece to `sink`.

    A file with a column `track` holds several tracks: each is filtered by itself, and the sink gets its name; rows
    without a name are skipped. Tracks run in several threads (all cores where None, none where 0), and reach the sink
    in the order of the file. Memory does not grow with a track's rows where the study's filters are recursive; others
    take a limited number of rows. progress is called with the rows done.

    Raises ConfigError for an experiment of several cases, a study without recorded plots, and faults in the file."""
    plots_argument = shlex.quote(os.fspath(source)).replace("{", "{{").replace("}", "}}")
    case = single_case(experiment, "track with", f"radarsim track {{}} {plots_argument}")
    refuse_inherited_part(case, "tracker")
    interface = recording_interface(case)
    tracker = interface.tracker(case)
    size = tracker.most_rows or plots.CHUNK_ROWS
    followers: dict[str | None, TrackFollower] = {}
    trackless_rows = row_count = reused_numbers = doubles = 0
    with mapping(os.cpu_count() or 1 if threads is None else threads) as mapped:
        choices, any_origin = interface.columns(case.spec), interface.from_any_origin
        for piece in plots.pieces(source, choices, size, tracker.several, any_origin):
            if followers and tracker.most_rows:
                raise ConfigError(f"{source}: must be of at most {size} rows for the study {case.study}")
            reused_numbers, doubles = piece.reused_numbers, piece.doubles
            parts = [part for part in split_by_track(piece) if part.name != ""]
            trackless_rows += len(piece.columns["t_s"]) - sum(part.rows for part in parts)
            for part in parts:
                if part.name not in followers:
                    followers[part.name] = TrackFollower(case, source, part.name)
            tracks = mapped(lambda part: followers[part.name].process_rows(part), parts)
            for part, track in zip(parts, tracks, strict=True):
                sink(track, part.name)
                row_count += part.rows
                progress(row_count)
    if not followers:
        raise ConfigError(f"{source}: track: must name the track of some rows, all {trackless_rows} are empty")
    results = {name: follower.followed for name, follower in followers.items()}
    if None in results:
        return results[None]
    combined = combine_tracks(case, results, trackless_rows)
    return replace(combined, reused_numbers=reused_numbers, doubles=doubles)


class TrackRows(NamedTuple):
    """The rows of one track in a piece of a file: its name, None where tracks are not distinguished, and columns (n,)
    as in `plots.Piece`."""

    name: str | None
    columns: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]
    positions: dict[str, np.ndarray]

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(self.columns["t_s"])


def split_by_track(piece: plots.Piece) -> list[TrackRows]:
    """The rows of each track, in the order in which the tracks first appear."""
    tables = (piece.columns, piece.truth, piece.positions)
    if piece.tracks is None:
        return [TrackRows(None, *tables)]
    return [
        TrackRows(name, *({key: column[rows] for key, column in columns.items()} for columns in tables))
        for name, rows in plots.rows_by_name(piece.tracks).items()
    ]


def combine_tracks(case: Case, results: Mapping[str | None, Followed], passed_over: int) -> Followed:
    """Combine the results of several tracks: sums over all, figures and checks of the longest."""
    longest = max(results.values(), key=lambda result: result.rows)
    combined = replace(longest, tallies={}, missing={}, filters_with_estimate=set(), rows=0, gaps=0, errors={})
    combined.trackless_rows = passed_over
    combined.tracks = {str(name): result for name, result in results.items()}
    for result in results.values():
        combined.rows += result.rows
        combined.gaps += result.gaps
        combined.first_s, combined.last_s = min(combined.first_s, result.first_s), max(combined.last_s, result.last_s)
        if result.longest_gap_s > combined.longest_gap_s:
            combined.longest_gap_s, combined.longest_gap_at_s = result.longest_gap_s, result.longest_gap_at_s
        combined.filters_with_estimate |= result.filters_with_estimate
        for name, count in result.missing.items():
            combined.missing[name] = combined.missing.get(name, 0) + count
        for key, tally in result.tallies.items():
            sums = combined.tallies.setdefault(key, InnovationTally(tally.filter, tally.name, tally.freedom))
            sums.count, sums.total = sums.count + tally.count, sums.total + tally.total
        for key, errors in result.errors.items():
            total = combined.errors.setdefault(key, ErrorSums(errors.filter, errors.component, errors.unit))
            total.count, total.squares = total.count + errors.count, total.squares + errors.squares
            total.normalised_squares += errors.normalised_squares
    return combined


# ---- bulk ------------------------------------------------------------------------------------------------------------
NUMBERS_PER_DRAW = 200_000  # drawn at a time: what fits into the caches of a processor
PlotSource = Callable[[], Iterator[Drawn]]  # draws the plots again at each call


def write_many(
    experiment: Experiment, n: int, first: int, path: str | os.PathLike, progress: Callable[[int, int], object]
) -> Drawn:
    """Write the plots of n realisations of an experiment's one case from number `first` on, in the format that the
    path's ending names, CSV by default. Returns those of the first ones.

    Raises ConfigError as `batches`, or where a format's package is missing; errors of `Writer`."""
    write = FORMATS.get(Path(path).suffix.lower(), write_csv)
    first_plots = next(batches(experiment, n, first, chunk=2))
    size = max(8, NUMBERS_PER_DRAW // sum(array[0].size for array in first_plots.arrays().values()))

    def parts() -> Iterator[Drawn]:
        for part in batches(experiment, n, first, size):
            yield part
            progress(part.first - first + part.n, n)

    with Writer(path, {"the config": experiment.path}) as file:
        write(file, first_plots, parts, n)
    return first_plots


def write_npz(file: Writer, first_plots: Drawn, parts: PlotSource, n: int) -> None:
    """`seed`, `t_s` (K,), `realisation` (n,), and each array (n, K) or (n, K, M); (1, K) where all have the same. One
    array after the other, so that the plots are drawn as often as there are arrays."""
    widest = max(array.shape[2] for part in parts() for array in part.columns.values()) if first_plots.several else 0
    arrays = {"realisation": np.arange(first_plots.n), **first_plots.arrays()}
    single_arrays = {"t_s": first_plots.t_s, "seed": np.array(first_plots.seed)}
    single_arrays |= {name: array[:1] for name, array in arrays.items() if array.strides[0] == 0}
    with zipfile.ZipFile(file.binary, "w") as archive:
        for name, array in (arrays | single_arrays).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                if name in single_arrays:
                    np.lib.format.write_array(member, np.asarray(array, order="C"))
                    continue
                shape = (n, *array.shape[1:2], *[widest] * (array.ndim - 2))
                header = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member, header)
                for part in parts():
                    values = part.arrays().get(name, np.arange(part.first, part.first + part.n))
                    if values.ndim == 3:
                        padding = widest - values.shape[2]
                        values = np.pad(values, ((0, 0), (0, 0), (0, padding)), constant_values=np.nan)
                    member.write(values.tobytes())


def write_csv(file: Writer, first_plots: Drawn, parts: PlotSource, n: int) -> None:
    """The rows of all realisations, with the number of each in the column `realisation`."""
    file.write([tuple(first_plots.table())])
    for part in parts():
        file.write(zip(*map(column_texts, part.table().values()), strict=True))


def write_parquet(file: Writer, first_plots: Drawn, parts: PlotSource, n: int) -> None:
    """The same rows as numbers."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        need = "Parquet needs pyarrow (pip install 'radarsim[parquet]'); .npz and .csv do not"
        raise ConfigError(f"{file.path}: {need}") from error
    schema = pyarrow.table(first_plots.table()).schema
    with parquet.ParquetWriter(file.binary, schema) as writer:
        for part in parts():
            writer.write_table(pyarrow.table(part.table(), schema))


FORMATS = {".npz": write_npz, ".parquet": write_parquet}  # beside CSV
