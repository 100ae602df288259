"""Match plots with the aircraft of recorded positions, by identity, time and position.

A plot belongs to the aircraft that has the same address, callsign or Mode 3/A code at that time, or to none.

An address belongs to one aircraft. Callsigns and codes are used again, so exactly one aircraft that has it must be
close to the plot. Codes that end in 00 are given to many at once (ICAO Doc 4444, 8.5.2.2) and identify none."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.language.translate import join_names, tr
from radarsim.recordings.grouping import rows_by_name
from radarsim.report.wording import number

KINDS = ("address", "callsign", "mode_3a")  # of identity, the strongest first
SHARED_CODE_ENDING = "00"  # the end of codes that are given to many
MAX_GAP_S = 60.0  # over which positions are not interpolated
MAX_RANGE_OFFSET_M = 5000.0  # of a plot from its aircraft in range: 20 s of an airliner
# In bearing, in addition to what MAX_RANGE_OFFSET_M makes: of a radar badly aligned with north.
MAX_BEARING_OFFSET_RAD = math.radians(2.0)

StateFunction = Callable[[np.ndarray], np.ndarray]  # position and speed (n, 6), m and m/s, at times (n,)


class AircraftMatch(NamedTuple):
    """The aircraft of plots: position and speed (n, 6), NaN where there is none; the number of its path and the number
    in KINDS of what identified it (n,), -1 where there is none."""

    states: np.ndarray
    path_numbers: np.ndarray
    kind_numbers: np.ndarray


class AircraftPath:
    """Positions of one aircraft, and what identifies it, with the first and last time of each."""

    def __init__(self) -> None:
        self.fixes: list[np.ndarray] = []
        self.identity_times: dict[tuple[str, str], tuple[float, float]] = {}
        self.state_function: StateFunction | None = None  # computed when it is first needed

    def contradicts(self, values: Sequence[str]) -> bool:
        """Whether the aircraft has other identities than these, in the order of KINDS; '' is unknown."""
        kinds = {kind for kind, _ in self.identity_times}
        pairs = zip(KINDS, values, strict=False)
        return any(value and kind in kinds and (kind, value) not in self.identity_times for kind, value in pairs)


class AircraftPaths:
    """Positions of many aircraft, found by identity."""

    def __init__(self) -> None:
        self.period_s = math.inf  # of the clock by which all times are taken
        self.paths: list[AircraftPath] = []
        self.numbers_by_key: dict[str, int] = {}
        self.numbers_by_identity: dict[tuple[str, str], list[int]] = {}
        self.addresses_by_track: dict[str, str] = {}  # by track
        self.unidentified = 0  # fixes that nothing identifies
        # identities by KINDS of the plots that `find` was asked for
        self.searched_identities: set[tuple[str, ...]] = set()

    def names(self) -> list[str]:
        """The strongest identity of each aircraft."""
        return [min(path.identity_times, key=lambda identity: KINDS.index(identity[0]))[1] for path in self.paths]

    def add(self, fixes: np.ndarray, track: Sequence[str], identity: Mapping[str, Sequence[str]]) -> None:
        """Add fixes (n, 4), time and position, each of a track and with identities by KINDS."""
        columns = clean_identities(identity, len(fixes))
        keys = [self._key(name, values) for name, *values in zip(track, *columns, strict=True)]
        for key, rows in rows_by_name(keys).items():
            if not key:
                self.unidentified += len(rows)
                continue
            number = self.numbers_by_key.setdefault(key, len(self.paths))
            if number == len(self.paths):
                self.paths.append(AircraftPath())
            path, t = self.paths[number], fixes[rows, 0]
            path.fixes.append(fixes[rows])
            path.state_function = None
            for kind, column in zip(KINDS, columns, strict=True):
                for value, rows_with_value in rows_by_name([column[i] for i in rows.tolist()]).items():
                    if value:
                        if (kind, value) not in path.identity_times:
                            self.numbers_by_identity.setdefault((kind, value), []).append(number)
                        first, last = path.identity_times.get((kind, value), (math.inf, -math.inf))
                        path.identity_times[kind, value] = (
                            min(first, t[rows_with_value].min()),
                            max(last, t[rows_with_value].max()),
                        )

    def _key(self, track: str, values: list[str]) -> str:
        """The key of a fix's path: its address, or the address that its track had before."""
        address, *codes = values
        if address:
            self.addresses_by_track[track] = address
            return address
        if not any(codes):
            return ""
        address_before = self.addresses_by_track.get(track)
        number = self.numbers_by_key.get(self.addresses_by_track.get(track, ""))
        if track and address_before and (number is None or not self.paths[number].contradicts(values)):
            return address_before
        return f"track {track or codes}"

    def find(
        self,
        t: np.ndarray,
        range_m: np.ndarray,
        bearing_rad: np.ndarray,
        identity: Mapping[str, Sequence[str]],
        rotate: Callable[[np.ndarray], np.ndarray] = lambda states: states,
    ) -> AircraftMatch:
        """Match plots (n,) with aircraft, by identities and KINDS; rotate: states into the axes of their radar."""
        match = AircraftMatch(np.full((len(t), 6), np.nan), np.full(len(t), -1), np.full(len(t), -1))
        for values, rows in rows_by_name(list(zip(*clean_identities(identity, len(t)), strict=True))).items():
            self.searched_identities.add(values)
            for k, (kind, value) in enumerate(zip(KINDS, values, strict=True)):
                candidates = [
                    i
                    for i in self.numbers_by_identity.get((kind, value), ())
                    if not self.paths[i].contradicts(values[:k])
                ]
                if not candidates:
                    continue
                open_rows = rows[match.path_numbers[rows] < 0]
                states = rotate(
                    np.stack([self._states_with_identity(i, (kind, value), t[open_rows]) for i in candidates])
                )
                is_possible = np.isfinite(states[..., 0])
                if k:
                    is_possible &= are_compatible(
                        range_bearing_offsets(states, range_m[open_rows], bearing_rad[open_rows]), range_m[open_rows]
                    )
                is_unique = is_possible.sum(axis=0) == 1  # exactly one candidate is possible
                candidate_index = is_possible.argmax(axis=0)[is_unique]
                match.states[open_rows[is_unique]] = states[candidate_index, np.flatnonzero(is_unique)]
                match.path_numbers[open_rows[is_unique]] = np.array(candidates)[candidate_index]
                match.kind_numbers[open_rows[is_unique]] = k
        return match

    def _states_with_identity(self, number: int, identity: tuple[str, str], t: np.ndarray) -> np.ndarray:
        """Position and speed (n, 6) of an aircraft at the times at which it has this identity."""
        first, last = self._clock_times(np.array(self.paths[number].identity_times[identity]))
        clock_times = self._clock_times(t)
        has_identity = (clock_times >= first - MAX_GAP_S) & (clock_times <= last + MAX_GAP_S) | (last < first)
        return np.where(has_identity[:, None], self.states(number, t), np.nan)

    def states(self, number: int, t: np.ndarray) -> np.ndarray:
        """Position and speed (n, 6) of an aircraft at times (n,)."""
        path = self.paths[number]
        if path.state_function is None:
            path.state_function = interpolate_states(self.fixes(number))
        return path.state_function(self._clock_times(t))

    def deviations_m(self, number: int, t: np.ndarray) -> np.ndarray:
        """Distances (n,) of an aircraft's interpolated positions from straight lines between its fixes, m."""
        fixes = self.fixes(number)
        fixes = fixes[np.unique(fixes[:, 0], return_index=True)[1]]
        straight = [np.interp(self._clock_times(t), fixes[:, 0], column) for column in fixes.T[1:]]
        return np.linalg.norm(self.states(number, t)[:, :3] - np.stack(straight, axis=1), axis=1)

    def fixes(self, number: int) -> np.ndarray:
        """Times and positions (n, 4) of an aircraft, in the order in which they came."""
        fixes = np.concatenate(self.paths[number].fixes)
        return np.column_stack([self._clock_times(fixes[:, 0]), fixes[:, 1:]])

    def _clock_times(self, t: np.ndarray) -> np.ndarray:
        return t % self.period_s if math.isfinite(self.period_s) else t


def clean_identities(identity: Mapping[str, Sequence[str]], n: int) -> list[list[str]]:
    """The identities (n,) by KINDS in the form that is compared, without codes given to many aircraft."""
    address, callsign, code = (identity.get(kind) or [""] * n for kind in KINDS)
    codes = [text.strip().zfill(4) if text.strip() else "" for text in code]
    return [
        [text.strip().lower() for text in address],
        [text.strip().upper() for text in callsign],
        ["" if text.endswith(SHARED_CODE_ENDING) else text for text in codes],
    ]


def assign_owner(
    owner: str, track: Sequence[str], identity: Mapping[str, Sequence[str]]
) -> Mapping[str, Sequence[str]]:
    """The identities (n,) by KINDS of plots.

    owner: the track, address, callsign or code of the plots to which the only path belongs; it becomes
    their address."""
    if not owner:
        return identity
    names_by_row = (map(str.lower, names_by_row) for names_by_row in zip(track, *identity.values(), strict=True))
    return {"address": [owner * (owner.lower() in plot_names) for plot_names in names_by_row]}


def range_bearing_offsets(states: np.ndarray, range_m: np.ndarray, bearing_rad: np.ndarray) -> np.ndarray:
    """Offsets (…, n, 2) in range and bearing of plots (n,) from aircraft with states (…, n, 6)."""
    r, b = np.linalg.norm(states[..., :3], axis=-1), np.arctan2(states[..., 2], states[..., 0])
    return np.stack([range_m - r, wrap_angle(bearing_rad - b)], axis=-1)


def are_compatible(offsets: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """Whether plots at these ranges (n,), with offsets (…, n, 2) from an aircraft, may be its plots.

    An unknown bearing is compatible."""
    with np.errstate(divide="ignore"):
        is_turned = np.abs(offsets[..., 1]) > MAX_BEARING_OFFSET_RAD + MAX_RANGE_OFFSET_M / range_m
    return (np.abs(offsets[..., 0]) <= MAX_RANGE_OFFSET_M) & ~is_turned


def are_far(offsets: np.ndarray, range_m: np.ndarray) -> bool:
    """Whether most plots (n,), with offsets (n, 2) from an aircraft, cannot be its plots."""
    return bool(are_compatible(offsets, range_m).sum() * 2 < len(range_m))


def median_offsets(offsets: np.ndarray) -> tuple[float, float]:
    """Medians of the sizes of offsets (n, 2) in range, m, and in bearing, degrees; NaN without bearings."""
    bearing_offsets = offsets[np.isfinite(offsets[:, 1]), 1]
    bearing_deg = math.degrees(np.median(np.abs(bearing_offsets))) if len(bearing_offsets) else math.nan
    return float(np.median(np.abs(offsets[:, 0]))), bearing_deg


def distance_text(range_m: float, bearing_deg: float) -> str:
    """The text of a distance in range and, if it is known, in bearing."""
    bearing_text = [] if math.isnan(bearing_deg) else [f"{number(bearing_deg, 2)}°"]
    return join_names([f"{number(range_m, 3)} {tr('m')}", *bearing_text])


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Angles between -π and π."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def interpolate_states(fixes: np.ndarray) -> StateFunction:
    """Interpolate fixes (n, 4) of time and position: a function from times (m,) to positions and speeds (m, 6).

    Piecewise cubic with slopes from the neighbouring fixes; NaN outside, and in gaps over MAX_GAP_S."""
    from scipy.interpolate import CubicHermiteSpline

    times, first_rows = np.unique(fixes[:, 0], return_index=True)
    positions = fixes[first_rows, 1:]
    if len(times) < 2:
        return lambda t: np.full((len(t), 6), np.nan)
    curve = CubicHermiteSpline(times, positions, np.gradient(positions, times, axis=0))
    slope = curve.derivative()

    def states(t: np.ndarray) -> np.ndarray:
        next_index = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
        is_covered = (t >= times[0]) & (t <= times[-1]) & (times[next_index] - times[next_index - 1] <= MAX_GAP_S)
        return np.where(is_covered[:, None], np.concatenate([curve(t), slope(t)], axis=1), np.nan)

    return states
