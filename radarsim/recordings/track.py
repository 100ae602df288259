"""Run the filters of a config over a file of recorded plots."""

import os
import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from numpy.linalg import LinAlgError

from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError, PlotFault
from radarsim.recordings import read_plots
from radarsim.recordings.rounding_guard import RoundingGuard, gap_message
from radarsim.recordings.rows_by_track import split_by_track
from radarsim.recordings.study_part import recording_interface, refuse_inherited_part, single_case
from radarsim.recordings.tracking_result import ErrorSums, InnovationTally, TrackingResult
from radarsim.studies.recording_interface import Track
from radarsim.system.threads import mapping

if TYPE_CHECKING:
    from radarsim.recordings.rows_by_track import TrackRows


class TrackFollower:
    """The filters of a case over one track of a file of plots."""

    def __init__(self, case: Case, source: str | os.PathLike, name: str | None):
        interface = recording_interface(case)
        self.source, self.name = source, name
        self.tracker, self.followed = interface.tracker(case), TrackingResult(case)
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
            message = gap_message(self.rounding_guard.gap_s)
            raise ConfigError(f"{self._row_location(self.rounding_guard.gap_row)}: t_s: {message}")
        self.followed.add(columns, track)
        self.followed.add_errors(track, columns["t_s"], rows.truth)
        self.followed.positions.add(columns["t_s"], rows.positions)
        return track

    def _row_location(self, row: int) -> str:
        if self.name is None:
            return read_plots.row_location(self.source, row)
        return f"{self.source}: {self._track_prefix()}row {row + 1} of it"

    def _track_prefix(self) -> str:
        return "" if self.name is None else f"track {self.name}: "


def track_plots(
    experiment: Experiment,
    source: str | os.PathLike,
    sink: Callable[[Track, str | None], None] = lambda track, name: None,
    threads: int | None = None,
    progress: Callable[[int], None] = lambda rows: None,
) -> TrackingResult:
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
    size = tracker.most_rows or read_plots.CHUNK_ROWS
    followers: dict[str | None, TrackFollower] = {}
    trackless_rows = row_count = reused_numbers = doubles = 0
    fills: Mapping[str, int] = {}
    with mapping(os.cpu_count() or 1 if threads is None else threads) as mapped:
        choices, any_origin = interface.columns(case.spec), interface.from_any_origin
        for piece in read_plots.pieces(source, choices, size, tracker.several, any_origin):
            if followers and tracker.most_rows:
                raise ConfigError(f"{source}: must be of at most {size} rows for the study {case.study}")
            reused_numbers, doubles, fills = piece.reused_numbers, piece.doubles, piece.fills
            track_pieces = [track_piece for track_piece in split_by_track(piece) if track_piece.name != ""]
            trackless_rows += len(piece.columns["t_s"]) - sum(track_piece.rows for track_piece in track_pieces)
            for track_piece in track_pieces:
                if track_piece.name not in followers:
                    followers[track_piece.name] = TrackFollower(case, source, track_piece.name)
            tracks = mapped(lambda track_piece: followers[track_piece.name].process_rows(track_piece), track_pieces)
            for track_piece, track in zip(track_pieces, tracks, strict=True):
                sink(track, track_piece.name)
                row_count += track_piece.rows
                progress(row_count)
    if not followers:
        raise ConfigError(f"{source}: track: must name the track of some rows, all {trackless_rows} are empty")
    results = {name: follower.followed for name, follower in followers.items()}
    if None in results:
        return replace(results[None], fills=fills)
    combined = combine_tracks(case, results, trackless_rows)
    return replace(combined, reused_numbers=reused_numbers, doubles=doubles, fills=fills)


def combine_tracks(case: Case, results: Mapping[str | None, TrackingResult], passed_over: int) -> TrackingResult:
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
