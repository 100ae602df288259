"""Whose plot it is: of the aircraft that has the same address, callsign or Mode 3/A code at that time, or of none.

An address belongs to one aircraft. Callsigns and codes are used again, so just one aircraft that has it must be near
the plot. Codes that end in 00 are given to many at once (ICAO Doc 4444, 8.5.2.2) and identify none.

Which track a record of a sensor belongs to: by its track number, its address or its Mode 3/A code.

A track number is a sensor's own, and is given again when its aircraft has gone. A code is given to several aircraft at
a time. So both name a track only together with time, and a code with place too."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.language import listed, tr
from radarsim.recorded.plots import grouped
from radarsim.report.wording import number

KINDS = ("address", "callsign", "mode_3a")  # of identity, the strongest first
OF_MANY = "00"  # the end of codes that are given to many
LONGEST_GAP_S = 60.0  # over which positions are not interpolated
FARTHEST_M = 5000.0  # of a plot from its aircraft in range: 20 s of an airliner
FARTHEST_RAD = math.radians(2.0)  # in bearing, besides what FARTHEST_M makes: of a radar badly aligned with north

At = Callable[[np.ndarray], np.ndarray]  # position and speed (n, 6), m and m/s, at times (n,)


class Found(NamedTuple):
    """The aircraft of plots: position and speed (n, 6), NaN where there is none; the number of its path and the number
    in KINDS of what identified it (n,), -1 where there is none."""

    states: np.ndarray
    path: np.ndarray
    kind: np.ndarray


class Path:
    """Positions of one aircraft, and what identifies it, with the first and last time of each."""

    def __init__(self) -> None:
        self.fixes: list[np.ndarray] = []
        self.worn: dict[tuple[str, str], tuple[float, float]] = {}
        self.at: At | None = None  # made when it is first needed

    def is_another(self, values: Sequence[str]) -> bool:
        """Whether it has an identity other than these, in the order of KINDS; '' is unknown."""
        kinds = {kind for kind, _ in self.worn}
        pairs = zip(KINDS, values, strict=False)
        return any(value and kind in kinds and (kind, value) not in self.worn for kind, value in pairs)


class Paths:
    """Positions of many aircraft, found by identity."""

    def __init__(self) -> None:
        self.period_s = math.inf  # of the clock by which all times are taken
        self.paths: list[Path] = []
        self.numbers: dict[str, int] = {}
        self.wearers: dict[tuple[str, str], list[int]] = {}
        self.addresses: dict[str, str] = {}  # by track
        self.unnamed = 0  # fixes that nothing identifies
        self.asked: set[tuple[str, ...]] = set()  # identities by KINDS of the plots that `find` was asked for

    def names(self) -> list[str]:
        """What identifies each aircraft best."""
        return [min(path.worn, key=lambda one: KINDS.index(one[0]))[1] for path in self.paths]

    def add(self, fixes: np.ndarray, track: Sequence[str], identity: Mapping[str, Sequence[str]]) -> None:
        """Add fixes (n, 4), time and position, each of a track and with identities by KINDS."""
        columns = cleaned(identity, len(fixes))
        keys = [self._key(name, values) for name, *values in zip(track, *columns, strict=True)]
        for key, rows in grouped(keys).items():
            if not key:
                self.unnamed += len(rows)
                continue
            number = self.numbers.setdefault(key, len(self.paths))
            if number == len(self.paths):
                self.paths.append(Path())
            path, t = self.paths[number], fixes[rows, 0]
            path.fixes.append(fixes[rows])
            path.at = None
            for kind, column in zip(KINDS, columns, strict=True):
                for value, own in grouped([column[i] for i in rows.tolist()]).items():
                    if value:
                        if (kind, value) not in path.worn:
                            self.wearers.setdefault((kind, value), []).append(number)
                        lo, hi = path.worn.get((kind, value), (math.inf, -math.inf))
                        path.worn[kind, value] = (min(lo, t[own].min()), max(hi, t[own].max()))

    def _key(self, track: str, values: list[str]) -> str:
        """What the path of a fix is kept by: the address that it has, or that its track had before."""
        address, *others = values
        if address:
            self.addresses[track] = address
            return address
        if not any(others):
            return ""
        known, number = self.addresses.get(track), self.numbers.get(self.addresses.get(track, ""))
        if track and known and (number is None or not self.paths[number].is_another(values)):
            return known
        return f"track {track or others}"

    def find(
        self,
        t: np.ndarray,
        range_m: np.ndarray,
        bearing_rad: np.ndarray,
        identity: Mapping[str, Sequence[str]],
        turned: Callable[[np.ndarray], np.ndarray] = lambda states: states,
    ) -> Found:
        """The aircraft of plots (n,) with identities by KINDS; turned: states in the axes of their radar."""
        found = Found(np.full((len(t), 6), np.nan), np.full(len(t), -1), np.full(len(t), -1))
        for values, rows in grouped(list(zip(*cleaned(identity, len(t)), strict=True))).items():
            self.asked.add(values)
            for k, (kind, value) in enumerate(zip(KINDS, values, strict=True)):
                wearers = [i for i in self.wearers.get((kind, value), ()) if not self.paths[i].is_another(values[:k])]
                if not wearers:
                    continue
                rest = rows[found.path[rows] < 0]
                states = turned(np.stack([self._at(i, (kind, value), t[rest]) for i in wearers]))
                may = np.isfinite(states[..., 0])
                if k:
                    may &= near(offsets(states, range_m[rest], bearing_rad[rest]), range_m[rest])
                one = may.sum(axis=0) == 1  # just one of them may be its own
                which = may.argmax(axis=0)[one]
                found.states[rest[one]] = states[which, np.flatnonzero(one)]
                found.path[rest[one]] = np.array(wearers)[which]
                found.kind[rest[one]] = k
        return found

    def _at(self, number: int, name: tuple[str, str], t: np.ndarray) -> np.ndarray:
        """Position and speed (n, 6) of an aircraft at the times at which it has this identity."""
        lo, hi = self._clock(np.array(self.paths[number].worn[name]))
        clock = self._clock(t)
        worn = (clock >= lo - LONGEST_GAP_S) & (clock <= hi + LONGEST_GAP_S) | (hi < lo)
        return np.where(worn[:, None], self.at(number, t), np.nan)

    def at(self, number: int, t: np.ndarray) -> np.ndarray:
        """Position and speed (n, 6) of an aircraft at times (n,)."""
        path = self.paths[number]
        if path.at is None:
            path.at = interpolated(self.fixes(number))
        return path.at(self._clock(t))

    def bent(self, number: int, t: np.ndarray) -> np.ndarray:
        """How far (n,) an aircraft's interpolated position is from the straight line between its fixes, m."""
        fixes = self.fixes(number)
        fixes = fixes[np.unique(fixes[:, 0], return_index=True)[1]]
        straight = [np.interp(self._clock(t), fixes[:, 0], column) for column in fixes.T[1:]]
        return np.linalg.norm(self.at(number, t)[:, :3] - np.stack(straight, axis=1), axis=1)

    def fixes(self, number: int) -> np.ndarray:
        """Times and positions (n, 4) of an aircraft, in the order in which they came."""
        fixes = np.concatenate(self.paths[number].fixes)
        return np.column_stack([self._clock(fixes[:, 0]), fixes[:, 1:]])

    def _clock(self, t: np.ndarray) -> np.ndarray:
        return t % self.period_s if math.isfinite(self.period_s) else t


def cleaned(identity: Mapping[str, Sequence[str]], n: int) -> list[list[str]]:
    """The identities (n,) by KINDS as they are compared; codes of many are no identity."""
    address, callsign, code = (identity.get(kind) or [""] * n for kind in KINDS)
    codes = [text.strip().zfill(4) if text.strip() else "" for text in code]
    return [
        [text.strip().lower() for text in address],
        [text.strip().upper() for text in callsign],
        ["" if text.endswith(OF_MANY) else text for text in codes],
    ]


def owned(whose: str, track: Sequence[str], identity: Mapping[str, Sequence[str]]) -> Mapping[str, Sequence[str]]:
    """The identities (n,) by KINDS of plots; where all that is known is whose track, address, callsign or code the one
    path has, that of the plots with it."""
    if not whose:
        return identity
    names = (map(str.lower, one) for one in zip(track, *identity.values(), strict=True))
    return {"address": [whose * (whose.lower() in own) for own in names]}


def offsets(states: np.ndarray, range_m: np.ndarray, bearing_rad: np.ndarray) -> np.ndarray:
    """How far plots (n,) lie from aircraft there, (…, n, 6), in range and bearing: (…, n, 2)."""
    r, b = np.linalg.norm(states[..., :3], axis=-1), np.arctan2(states[..., 2], states[..., 0])
    return np.stack([range_m - r, wrapped(bearing_rad - b)], axis=-1)


def near(missed: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """Whether plots at these ranges (n,) that miss an aircraft by (…, n, 2) may be its own; an unknown bearing may be
    any."""
    with np.errstate(divide="ignore"):
        turned = np.abs(missed[..., 1]) > FARTHEST_RAD + FARTHEST_M / range_m
    return (np.abs(missed[..., 0]) <= FARTHEST_M) & ~turned


def are_far(missed: np.ndarray, range_m: np.ndarray) -> bool:
    """Whether most of the plots (n,) that miss an aircraft by (n, 2) cannot be its own."""
    return bool(near(missed, range_m).sum() * 2 < len(range_m))


def apart(missed: np.ndarray) -> tuple[float, float]:
    """The median distance of plots that miss their aircraft by (n, 2) in range and in bearing, m and degrees, NaN where
    there are no bearings."""
    known = missed[np.isfinite(missed[:, 1]), 1]
    turn = math.degrees(np.median(np.abs(known))) if len(known) else math.nan
    return float(np.median(np.abs(missed[:, 0]))), turn


def distance(far_m: float, turn_deg: float) -> str:
    """A distance in range and, where it is known, in bearing."""
    turn = [] if math.isnan(turn_deg) else [f"{number(turn_deg, 2)}°"]
    return listed([f"{number(far_m, 3)} {tr('m')}", *turn])


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles between -π and π."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def interpolated(fixes: np.ndarray) -> At:
    """Positions and speeds (m, 6) at times (m,), from fixes (n, 4) of time and position: piecewise cubic with slopes
    from the neighbouring fixes; NaN outside, and in gaps over LONGEST_GAP_S."""
    from scipy.interpolate import CubicHermiteSpline

    times, first = np.unique(fixes[:, 0], return_index=True)
    places = fixes[first, 1:]
    if len(times) < 2:
        return lambda t: np.full((len(t), 6), np.nan)
    curve = CubicHermiteSpline(times, places, np.gradient(places, times, axis=0))
    slope = curve.derivative()

    def at(t: np.ndarray) -> np.ndarray:
        after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
        close = (t >= times[0]) & (t <= times[-1]) & (times[after] - times[after - 1] <= LONGEST_GAP_S)
        return np.where(close[:, None], np.concatenate([curve(t), slope(t)], axis=1), np.nan)

    return at


# ---- numbering -------------------------------------------------------------------------------------------------------
GONE_S = 60.0  # after which a number or a code is that of another aircraft
FASTEST_MPS, MARGIN_M = 700.0, 1500.0  # between plots of one aircraft: Mach 2, and errors in azimuth far away
SAME_TURN_S = 1.0  # within which a radar does not see an aircraft twice


@dataclass(slots=True)
class Seen:
    """A track: its name, and time, address, place (m) and velocity (m/s) of its aircraft's last record."""

    name: str
    t: float
    address: str
    north: float
    east: float
    north_mps: float = 0.0
    east_mps: float = 0.0


class Tracks:
    """Names of tracks: the number, the address, or A and the code; of another sensor than the first with its name and a
    colon before them; -2, -3, … after those of the second aircraft and further ones."""

    def __init__(self) -> None:
        self.first: str | None = None
        self.numbers: dict[tuple[str, str], Seen] = {}
        self.codes: dict[tuple[str, str], list[Seen]] = {}
        self.counts: dict[str, int] = {}
        self.again = 0  # numbers given again
        self.shared: set[str] = set()  # names of codes of several aircraft

    def by_number(self, sensor: str, number: str, address: str, t: float) -> str:
        """The track of a record with a track number; its address is '' where it has none."""
        one = self.numbers.get((sensor, number))
        if one is not None:
            known = address and one.address
            if address == one.address if known else t - one.t <= GONE_S:
                one.t, one.address = t, address or one.address
                return one.name
            self.again += 1
        one = self.numbers[sensor, number] = Seen(self._new(self.of(sensor, number)), t, address, 0.0, 0.0)
        return one.name

    def by_code(self, sensor: str, code: str, t: float, north: float, east: float) -> str:
        """The track of a record with a code, at a place in m: of the aircraft that flies nearest to it."""
        known = [one for one in self.codes.get((sensor, code), ()) if t - one.t <= GONE_S]
        nearest, found = math.inf, None
        for one in known:
            step, way = t - one.t, math.hypot(north - one.north, east - one.east)
            if step >= SAME_TURN_S and way <= FASTEST_MPS * step + MARGIN_M:
                miss = math.hypot(north - one.north - one.north_mps * step, east - one.east - one.east_mps * step)
                if miss < nearest:
                    nearest, found = miss, one
        if found is None:
            whole = self.of(sensor, f"A{code}")
            if whole in self.counts:
                self.shared.add(whole)
            found = Seen(self._new(whole), t, "", north, east)
            known.append(found)
        else:
            step = t - found.t
            found.north_mps, found.east_mps = (north - found.north) / step, (east - found.east) / step
            found.t, found.north, found.east = t, north, east
        self.codes[sensor, code] = known
        return found.name

    def of(self, sensor: str, name: str) -> str:
        """A name that is the sensor's own."""
        if self.first is None:
            self.first = sensor
        return name if sensor == self.first else f"{sensor}:{name}"

    def _new(self, name: str) -> str:
        count = self.counts[name] = self.counts.get(name, 0) + 1
        return name if count == 1 else f"{name}-{count}"
