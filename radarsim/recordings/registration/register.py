"""Find a radar's biases in range, bearing and time against positions of the same aircraft.

`bias_fit` has the model of the biases, the robust fit, and its sources."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.current import use_language
from radarsim.language.translate import plural, tr
from radarsim.recordings.aircraft_match import (
    KINDS,
    AircraftMatch,
    AircraftPaths,
    are_far,
    assign_owner,
    distance_text,
    median_offsets,
    range_bearing_offsets,
)
from radarsim.recordings.formats.records import DAY_S
from radarsim.recordings.formats.sites import Site
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.registration.bias_fit import fit_biases
from radarsim.recordings.registration.matched_plots import MatchedPlots
from radarsim.recordings.registration.read_recording import (
    PLOT_CHOICES,
    POSITION_CHOICES,
    UNKNOWN_ZERO,
    Recording,
    read_recording,
)
from radarsim.recordings.registration.result import Adjustment, AircraftResiduals, Registration
from radarsim.recordings.time_spans import TimeSpan, meeting_text

MIN_PLOTS = 20
MAX_DEVIATION_M = 100.0  # of an interpolated position from the straight line


class _Matching(NamedTuple):
    """Plots (n,) matched with aircraft: which are used, their offsets (n, 2), the distances (n,) of interpolated
    positions from straight lines, the names of the aircraft, and why the other plots are not used."""

    match: AircraftMatch
    is_used: np.ndarray
    offsets: np.ndarray
    deviations: np.ndarray
    names: list[str]
    unmatched_count: int
    distant_aircraft: list[tuple[str, tuple[float, float]]]
    bent_count: int


def register_radar(radar: str, positions_file: str) -> Registration:
    """Find the biases of a radar's plots against positions of the same aircraft, both as `radarsim import` writes them.

    positions_file: `[ID=]FILE`, with the track, address, callsign or code of the plots to which all positions in the
    file belong, for a receiver that does not know them. Raises ConfigError if too few plots have a position, or if the
    plots lie too far from the positions."""
    from radarsim.recordings.formats.import_options import parse_truth

    path, owner = parse_truth(positions_file)
    plots, positions = read_recording(radar, PLOT_CHOICES), read_recording(str(path), POSITION_CHOICES)
    if owner:
        positions.identity["address"] = [owner] * len(positions.tracks)
    paths, t = AircraftPaths(), plots.columns["t_s"]
    if plots.zero != positions.zero:
        t = t + _clock_difference(plots.zero, positions.zero, radar, str(path))
        paths.period_s = math.inf if plots.zero[1] == positions.zero[1] else DAY_S
    paths.add(_fixes_in_axes(plots, positions), positions.tracks, positions.identity)
    r = plots.columns["range_m"]
    b = plots.columns.get("bearing_rad", np.full(len(r), np.nan))
    matching = _match_plots(paths, t, r, b, assign_owner(owner, plots.tracks, plots.identity))
    is_used, path_numbers = matching.is_used, matching.match.path_numbers[matching.is_used]
    if is_used.sum() < MIN_PLOTS:
        raise _too_few_plots(radar, str(path), matching, meeting_text(_time_span(plots), _time_span(positions)))
    adjustment = fit_biases(MatchedPlots(t[is_used], r[is_used], b[is_used], path_numbers, paths.states))
    counts_by_kind = Counter(KINDS[k] for k in matching.match.kind_numbers[is_used].tolist())
    return Registration(
        adjustment=adjustment,
        aircraft=_aircraft_residuals(adjustment, path_numbers, matching.names),
        plots=len(t),
        matched=int(is_used.sum()),
        counts_by_kind=dict(counts_by_kind),
        median_offsets=median_offsets(matching.offsets[is_used]),
        left_out=tuple(_excluded_plots(matching, str(path))),
        bent_m=float(np.quantile(matching.deviations[is_used], 0.95)),
    )


def _clock_difference(zero: tuple[float, str], other_zero: tuple[float, str], radar: str, other_file: str) -> float:
    """The difference of the zeros of two clocks, s; raises ConfigError if it is unknown."""
    (zero_s, since), (other_zero_s, other_since) = zero, other_zero
    if since != other_since and UNKNOWN_ZERO in (since, other_since):
        fault = f"t_s counts from {since}, in {other_file} from {other_since}"
        raise ConfigError(f"{radar}: {fault}: both must be dated, as times of day or from 1970, by radarsim import")
    return zero_s - other_zero_s


def _fixes_in_axes(plots: Recording, positions: Recording) -> np.ndarray:
    """Times and positions (n, 4) of a recording in the local axes of the plots' radar."""
    fixes = np.stack([positions.columns[name] for name in POSITION_CHOICES[0]], axis=1)
    if plots.site and positions.site and plots.site != positions.site:
        states = np.pad(fixes[:, 1:], ((0, 0), (0, 3)))
        fixes[:, 1:] = Site(*plots.site).rotate_states(Site(*positions.site), states)[:, :3]
    return fixes


def _match_plots(
    paths: AircraftPaths, t: np.ndarray, r: np.ndarray, b: np.ndarray, identity: Mapping[str, Sequence[str]]
) -> _Matching:
    """Match plots (n,) with aircraft, without distant aircraft and without turns that positions do not resolve."""
    match, names = paths.find(t, r, b, identity), paths.names()
    offsets, is_used = range_bearing_offsets(match.states, r, b), match.path_numbers >= 0
    unmatched_count = int((~is_used).sum())
    distant_aircraft, deviations = [], np.zeros(len(t))
    for number, rows in rows_by_name(match.path_numbers.tolist()).items():
        if number < 0:
            continue
        if are_far(offsets[rows], r[rows]):
            distant_aircraft.append((names[number], median_offsets(offsets[rows])))
            is_used[rows] = False
        deviations[rows] = paths.deviations_m(number, t[rows])
    bent_count = int((is_used & (deviations > MAX_DEVIATION_M)).sum())
    is_used &= deviations <= MAX_DEVIATION_M
    return _Matching(match, is_used, offsets, deviations, names, unmatched_count, distant_aircraft, bent_count)


def _aircraft_residuals(
    adjustment: Adjustment, path_numbers: np.ndarray, names: Sequence[str]
) -> tuple[AircraftResiduals, ...]:
    """The residuals of the plots of each aircraft, whose path numbers (n,) are given."""
    aircraft = []
    for number, rows in rows_by_name(path_numbers.tolist()).items():
        range_m, bearing_rad = (_finite_median(adjustment.residuals[rows, k]) for k in range(2))
        lag = adjustment.lags[number]
        aircraft.append(AircraftResiduals(names[number], len(rows), range_m, bearing_rad, *lag))
    return tuple(aircraft)


def _time_span(recording: Recording) -> TimeSpan:
    """The times that a recording covers, by its own clock."""
    (zero_s, since), t = recording.zero, recording.columns["t_s"]
    return TimeSpan(zero_s + float(t.min()), zero_s + float(t.max()), since != UNKNOWN_ZERO)


def _too_few_plots(radar: str, positions_file: str, matching: _Matching, times: str) -> ConfigError:
    with use_language("en"):  # as all faults
        reasons = "".join(f"; left out: {reason}" for reason in _excluded_plots(matching, positions_file))
    counts = f"{matching.is_used.sum()} of {len(matching.is_used)} plots"
    return ConfigError(f"{radar}: {counts} have a position of their aircraft in {positions_file}, by address, callsign "
                       f"or Mode 3/A code and time; needs {MIN_PLOTS}{reasons}{times}")  # fmt: skip


def _excluded_plots(matching: _Matching, positions_file: str) -> list[str]:
    """The plots that are not used, and why: of no aircraft in the file, of another aircraft, or in turns."""
    reasons = [
        tr("the plots of {name}, which lie {away} away: it is another", name=name, away=distance_text(*median))
        for name, median in matching.distant_aircraft
    ]
    if matching.unmatched_count:
        plot_count = plural("{count} plot", "{count} plots", matching.unmatched_count)
        reasons.insert(0, tr("{of} that no aircraft in {file} has at that time", of=plot_count, file=positions_file))
    if matching.bent_count:
        plot_count = plural("{count} plot", "{count} plots", matching.bent_count)
        text = tr("{of} in turns, where positions are too far apart to {most:g} m", of=plot_count, most=MAX_DEVIATION_M)
        reasons.append(text)
    return reasons


def _finite_median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else math.nan
