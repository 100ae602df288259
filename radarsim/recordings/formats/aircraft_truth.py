"""The truth of imported plots, from positions of their aircraft."""

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.translate import term, tr
from radarsim.recordings.aircraft_match import (
    KINDS,
    MAX_BEARING_OFFSET_RAD,
    MAX_RANGE_OFFSET_M,
    AircraftPaths,
    are_far,
    assign_owner,
    distance_text,
    median_offsets,
    range_bearing_offsets,
)
from radarsim.recordings.formats.asterix import Asterix
from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.open_recording import open_recording
from radarsim.recordings.formats.records import DAY_S, PLOTS, Batch, Reader
from radarsim.recordings.formats.site_distance import without_no_fix
from radarsim.recordings.formats.sites import position_columns
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.time_spans import TimeSpan, meeting_text

MAX_LISTED = 12
LOCAL_COLUMNS = ("x_m", "y_m", "z_m")
VELOCITY_COLUMNS = ("vx_mps", "vy_mps", "vz_mps")


class AircraftTruth:
    """Truth of each aircraft: positions of the second recording, or of the same one (category 062 beside 048)."""

    def __init__(self, path: str, options: Options):
        self.sites = dict(options.sites)
        self.site = options.site or next(iter(self.sites.values()))  # in whose axes the paths are kept
        self.rows = 0
        self.kind_counts: Counter[int] = Counter()  # of identity, by their number in KINDS
        self.offsets_by_path: dict[int, list[np.ndarray]] = {}  # range and bearing, and the range (n, 3), by aircraft
        self.is_same_file = options.truth is None
        self.paths = AircraftPaths()
        self.owner, self.truth_tracks = options.owner, set[str]()
        self.of_day = False
        self.times = [math.inf, -math.inf]  # the first and last of the positions, and of the plots
        self.plot_times = [math.inf, -math.inf]
        if self.is_same_file:
            self._read_own(path, options)
        else:
            assert options.truth is not None
            options_of_truth = Options(encoding=options.encoding, keep_marked=options.keep_marked)
            with open_recording(options.truth, options_of_truth, truth=True) as (_, reader):
                self._add_positions(reader)
            if not self.paths.paths:
                raise ConfigError(f"{options.truth}: must have positions on the earth of aircraft with an address, a "
                                  f"callsign or a code of their own; has {self.paths.unidentified} without (if all are "
                                  f"of one track ID of the plots: --truth ID={options.truth})")  # fmt: skip
            if self.owner and len(self.truth_tracks) > 1:
                raise ConfigError(f"{options.truth}: must be the path of one alone, as {options.owner}= says; has "
                                  f"{', '.join(sorted(self.truth_tracks)[:MAX_LISTED])}")  # fmt: skip

    def _read_own(self, path: str, options: Options) -> None:
        """The positions beside the plots of one ASTERIX file; a stream, which is read once, has none."""
        if not os.path.isfile(path):
            self.is_same_file = False
            return
        try:
            with open_recording(path, options, truth=True) as (_, reader):
                if isinstance(reader, Asterix):
                    self._add_positions(reader)
                self.is_same_file = isinstance(reader, Asterix) and reader.has_plots and bool(self.paths.paths)
        except ConfigError:
            self.is_same_file = False  # counted when the records are read, with how many there were before
        if not self.is_same_file:
            self.paths = AircraftPaths()

    def _add_positions(self, reader: Reader) -> None:
        for batch in reader.batches():
            self.of_day = reader.of_day
            if batch.kind == PLOTS:
                continue
            batch, _ = without_no_fix(batch, self.site)
            _widen(self.times, batch.columns["t_s"])
            measured = self.site.measure(batch.columns)
            table = np.stack([batch.columns["t_s"], *(measured[name] for name in LOCAL_COLUMNS)], axis=-1)
            self.truth_tracks.update(batch.track)
            self.paths.add(table, batch.track, {"address": [self.owner] * len(table)} if self.owner else batch.identity)

    def columns(self, batch: Batch, plots: Mapping[str, np.ndarray], reader: Reader) -> dict[str, np.ndarray]:
        """The truth at the times of plots (n,): range, bearing, velocity, position and speeds (n,)."""
        if not self.paths.paths:
            return {}
        if reader.of_day != self.of_day:
            self.paths.period_s = DAY_S
        _widen(self.plot_times, batch.columns["t_s"])
        states = np.empty((len(batch.track), 6))
        for radar, rows in rows_by_name(batch.radar).items():
            site, part = self.sites.get(radar, self.site), batch.rows(rows.tolist())
            t, r, b = part.columns["t_s"], plots["range_m"][rows], plots["bearing_rad"][rows]
            identity = assign_owner(self.owner, part.track, part.identity)
            match = self.paths.find(t, r, b, identity, partial(site.rotate_states, self.site))
            states[rows] = match.states
            self.kind_counts.update(match.kind_numbers[match.kind_numbers >= 0].tolist())
            offsets = np.column_stack([range_bearing_offsets(match.states, r, b), r])
            for number, path_rows in rows_by_name(match.path_numbers.tolist()).items():
                if number >= 0:
                    self.offsets_by_path.setdefault(number, []).append(offsets[path_rows])
        self.rows += len(states)
        truth = position_columns(states[:, :3])
        radial = np.einsum("ni,ni->n", states[:, :3], states[:, 3:]) / truth["range_m"]
        # Named like the components of the studies' filters.
        columns = {"r_m": truth["range_m"], "Vr_mps": radial, "b_rad": truth["bearing_rad"]}
        columns |= dict(zip((*LOCAL_COLUMNS, *VELOCITY_COLUMNS), states.T, strict=True))
        return {f"true_{name}": column for name, column in columns.items()}

    def faults(self, tracks: Sequence[str]) -> list[str]:
        """Signs that the truth is not that of the plots; tracks: some of theirs."""
        faults, names = [], self.paths.names()
        if names and not self.offsets_by_path and not self.is_same_file:
            ellipsis = " …" if len(names) > MAX_LISTED else ""
            plots = (
                tracks
                if self.owner
                else sorted(next(filter(None, identities), "") for identities in self.paths.searched_identities)
            )
            faults.append(f"truth: no plot has the address, the callsign or the code of an aircraft in it at that time "
                         f"and place; it has {', '.join(names[:MAX_LISTED])}{ellipsis}, the plots "
                         f"{', '.join(list(filter(None, plots))[:MAX_LISTED]) or 'no names'}"
                         f"{meeting_text(_time_span(self.plot_times), _time_span(self.times))}")  # fmt: skip
        for number, parts in self.offsets_by_path.items():
            offsets = np.concatenate(parts)
            if are_far(offsets[:, :2], offsets[:, 2]):
                bearing_deg = math.degrees(MAX_BEARING_OFFSET_RAD)
                limits = f"{MAX_RANGE_OFFSET_M:g} m, and in bearing {bearing_deg:g}° more than these make"
                median = distance_text(*median_offsets(offsets[:, :2]))
                faults.append(f"truth: the plots of {names[number]} lie {median} from it (median), allowed are "
                              f"{limits}: it is another aircraft or clock, or --at is wrong")  # fmt: skip
        return faults

    def notes(self) -> list[str]:
        """Notes on how many plots have a truth, and how far they are from it."""
        if not self.offsets_by_path:
            return [tr("truth: of no plot")] if self.paths.paths else []
        offsets = np.concatenate([part for parts in self.offsets_by_path.values() for part in parts])
        counts_by_kind = ", ".join(f"{KINDS[k]} {count}" for k, count in sorted(self.kind_counts.items()))
        fields = {"distance": distance_text(*median_offsets(offsets[:, :2])), "by": counts_by_kind}
        message = term(
            "truth: of {count} of {all} plots ({share:.0f} %; by {by}), which lie {distance} from it (median)"
        )
        return [tr(message, count=len(offsets), all=self.rows, share=100 * len(offsets) / self.rows, **fields)]


def _time_span(times: list[float]) -> TimeSpan:
    return TimeSpan(times[0], times[1])


def _widen(span: list[float], t: np.ndarray) -> None:
    """Widen a first and last time by times (n,), in place."""
    if len(t):
        span[:] = min(span[0], float(t.min())), max(span[1], float(t.max()))
