r"""Common to all readers of recordings: batches of records, as columns.

A radar on the earth (WGS 84): its measurements of positions, and the places of its plots. By pymap3d. Local axes: x
north, y up, z east, with the origin at the radar. Bearings are counted from north to east. Elevations are above the
plane that is level at the radar; an aircraft far away and low lies below it.

Ships by AIS: NMEA sentences `!AIVDM…`, by pyais. A message gives only the second of its minute. The time is that of the
tag block (`\c:1577836800*..\!AIVDM…`), of a line `$PGHP,1,…`, of a number or ISO time before the sentence, or of a
number after it; without these, the seconds are unwrapped from minute to minute."""

import datetime
import functools
import math
import operator
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np

from radarsim import physics
from radarsim.errors import ConfigError
from radarsim.language import term, tr

# ---- records ---------------------------------------------------------------------------------------------------------
BATCH = 20_000  # records held at a time
DAY_S = 86400.0
PLOTS, POSITIONS = "plots", "positions"

# What a record can hold besides its track and address. Angles are counted from north to east.
PLOT_COLUMNS = ("t_s", "range_m", "bearing_rad", "velocity_mps", "span_mps", "altitude_m")
BIASES = ("range_m", "range_scale", "bearing_rad", "time_s")  # of plots, to be subtracted
POSITION_COLUMNS = ("t_s", "latitude_deg", "longitude_deg", "altitude_m", "east_mps", "north_mps", "up_mps")
NOWHERE = term("records without time or position")  # a reason to skip them


class Batch(NamedTuple):
    """Some records, in the order of the file.

    kind is PLOTS (measured by a radar: PLOT_COLUMNS) or POSITIONS (on the earth: POSITION_COLUMNS). track holds the
    track of each record, '' where it has none; address identifies the aircraft or ship everywhere (24 bits in
    hexadecimal, MMSI), '' where unknown; radar identifies the sensor (SAC/SIC), '' where the format does not; columns,
    arrays (n,), NaN where a record has no value; words: further columns of text, '' where a record has none."""

    kind: str
    track: list[str]
    address: list[str]
    radar: list[str]
    columns: dict[str, np.ndarray]
    words: Mapping[str, list[str]] = MappingProxyType({})

    @property
    def identity(self) -> dict[str, list[str]]:
        """What identifies each record, by kind of identity."""
        return {"address": self.address, **self.words}

    def rows(self, keep: list[int]) -> "Batch":
        """The rows with these indices."""
        track, address, radar, *words = (
            [column[i] for i in keep] for column in (self.track, self.address, self.radar, *self.words.values())
        )
        columns = {name: column[keep] for name, column in self.columns.items()}
        return Batch(self.kind, track, address, radar, columns, dict(zip(self.words, words, strict=True)))


class Reader(Protocol):
    """A reader of one format. Times count from midnight where `of_day`, else from 1970 (UTC), as in the format.

    path: of the file; records: number read so far; skipped: number of them skipped, by reason."""

    path: str
    of_day: bool
    records: int
    skipped: Counter[str]

    def batches(self) -> Iterator[Batch]:
        """The records in batches; raises ConfigError with file, place, expected and actual content."""

    def notes(self, radars: Iterable[str]) -> list[str]:
        """What was assumed, and what is known of the radars that have plots, in words."""


@dataclass
class Gathered:
    """Records of one kind, collected until there are enough for a batch."""

    kind: str
    names: tuple[str, ...]
    words: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self._empty()

    def _empty(self) -> None:
        self.track: list[str] = []
        self.address: list[str] = []
        self.rows: list[tuple[float, ...]] = []
        self.texts: list[tuple[str, ...]] = []

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, track: str, address: str, row: tuple[float, ...], texts: tuple[str, ...] = ()) -> None:
        """Add a record; row in the order of `names`, texts in that of `words`."""
        self.track.append(track)
        self.address.append(address)
        self.rows.append(row)
        self.texts.append(texts)

    def taken(self) -> Batch:
        """The records so far as a batch; the collection is emptied."""
        table = np.array(self.rows, dtype=float).reshape(-1, len(self.names))
        columns = dict(zip(self.names, table.T.copy(), strict=True))
        words = dict(zip(self.words, map(list, zip(*self.texts, strict=True)), strict=True))
        batch = Batch(self.kind, self.track, self.address, [""] * len(self), columns, words)
        self._empty()
        return batch


class Unrolled:
    """Times of a clock with period `period_s`, unwrapped. Records out of order by half of it are taken as they are; so
    are times that fall from, or to, more than near_s from the clock's turn."""

    def __init__(self, period_s: float, near_s: float = math.inf):
        self.period_s, self.near_s, self.turns = period_s, near_s, 0
        self.last: float | None = None

    def __call__(self, t: float) -> float:
        """Unwrapped time of a clock time t (s)."""
        if self.last is not None:
            near = max(t, self.last) >= self.period_s - self.near_s and min(t, self.last) <= self.near_s
            if near and t < self.last - self.period_s / 2:
                self.turns += 1
            elif near and t > self.last + self.period_s / 2 and self.turns:
                return t + (self.turns - 1) * self.period_s
        self.last = t
        return t + self.turns * self.period_s

    def notes(self) -> list[str]:
        """How often midnight has passed on a clock of a day."""
        return [tr("the times of day pass midnight: t_s runs on ({turns} × 24 h)", turns=self.turns)] * (self.turns > 0)


def utc_s(text: str) -> float:
    """Seconds from 1970 of a date and time in ISO 8601, in UTC where it names no zone; raises ValueError."""
    moment = datetime.datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)).timestamp()


def needs(module: str, extra: str) -> ConfigError:
    """The fault of a library that one of our extras installs."""
    return ConfigError(f"{module} is not installed, which this needs: pip install 'radarsim[{extra}]'")


def counted(skipped: Mapping[str, int]) -> list[str]:
    """Numbers of skipped records, in words."""
    return [f"{tr(what)} ({count})" for what, count in skipped.items() if count]


# ---- site ------------------------------------------------------------------------------------------------------------
try:
    import pymap3d
except ImportError:
    pymap3d = None

CLOSE_M = 0.01  # accuracy of the height when the elevation of a plot is computed
ROUNDS = 20


class Antenna(NamedTuple):
    """The normal of an antenna: azimuth from north to east, elevation above the level, both in rad."""

    azimuth_rad: float
    elevation_rad: float


class Site:
    """Place of a radar: latitude and longitude in degrees, height above the ellipsoid in m."""

    def __init__(self, latitude_deg: float, longitude_deg: float, height_m: float):
        if pymap3d is None:
            raise needs("pymap3d", "recordings")
        self.place = (latitude_deg, longitude_deg, height_m)

    def distance_m(self, other: "Site") -> float:
        """The distance to another place."""
        return math.dist(pymap3d.geodetic2ecef(*self.place), pymap3d.geodetic2ecef(*other.place))

    def _axes(self) -> np.ndarray:
        """North, up and east (3, 3) in the axes of the earth."""
        units = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))  # each east, north, up
        return np.array([pymap3d.enu2uvw(*one, *self.place[:2]) for one in units])

    def turned(self, other: "Site", states: np.ndarray) -> np.ndarray:
        """Positions and speeds (…, 6) in this site's local axes, of those in the other's."""
        turn = other._axes() @ self._axes().T
        between = np.subtract(pymap3d.geodetic2ecef(*other.place), pymap3d.geodetic2ecef(*self.place)) @ self._axes().T
        return np.concatenate([states[..., :3] @ turn + between, states[..., 3:] @ turn], axis=-1)

    def seen(self, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Range, bearing, elevation, local position and, where speeds are known, radial velocity of positions (n,). An
        unknown height is taken as 0, sea level."""
        lat, lon = columns["latitude_deg"], columns["longitude_deg"]
        height = np.nan_to_num(columns["altitude_m"], nan=0.0)
        east, north, up = pymap3d.geodetic2enu(lat, lon, height, *self.place)
        local = np.stack([north, up, east], axis=-1)
        return described(local) | {"velocity_mps": self._radial(columns, lat, lon, height)}

    def _radial(self, columns: dict[str, np.ndarray], lat: np.ndarray, lon: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Radial velocities (n,) in m/s, positive where the range grows: speeds over ground, seen along the line."""
        up = np.nan_to_num(columns["up_mps"], nan=0.0)
        speed = np.stack(pymap3d.enu2uvw(columns["east_mps"], columns["north_mps"], up, lat, lon), axis=-1)
        target = np.stack(pymap3d.geodetic2ecef(lat, lon, h), axis=-1)
        line = target - np.stack(pymap3d.geodetic2ecef(*self.place))
        return np.einsum("ni,ni->n", speed, line) / np.linalg.norm(line, axis=-1)

    def local(self, range_m: np.ndarray, bearing_rad: np.ndarray, altitude_m: np.ndarray) -> np.ndarray:
        """Local positions (n, 3) of plots of slant range and bearing at a height (n,), all in m and rad. NaN where the
        height is unknown, or where no point of that range has it."""
        sine = np.zeros_like(range_m)
        bearing = np.degrees(bearing_rad)
        with np.errstate(invalid="ignore"):
            for _ in range(ROUNDS):
                height = pymap3d.aer2geodetic(bearing, np.degrees(np.arcsin(sine)), range_m, *self.place)[2]
                miss = altitude_m - height
                # A step of the sine lifts the point by nearly that part of the range.
                sine = np.clip(sine + miss / range_m, -1.0, 1.0)
                if not np.any(np.abs(miss[np.isfinite(miss)]) > CLOSE_M):
                    break
            sine = np.where(np.abs(miss) <= 10 * CLOSE_M, sine, np.nan)
        flat = range_m * np.sqrt(1 - sine**2)
        return np.stack([flat * np.cos(bearing_rad), range_m * sine, flat * np.sin(bearing_rad)], axis=-1)


def described(local: np.ndarray) -> dict[str, np.ndarray]:
    """Range, bearing, elevation above the level and the coordinates of local positions (n, 3) in m."""
    x, y, z = local.T
    r = np.linalg.norm(local, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        elevation = np.arcsin(y / r)
    return {
        "range_m": r,
        "bearing_rad": np.arctan2(z, x) % (2 * math.pi),
        "level_elevation_rad": elevation,
        "x_m": x,
        "y_m": y,
        "z_m": z,
    }


def biconical(local: np.ndarray, antenna: Antenna) -> dict[str, np.ndarray]:
    """The angles to an antenna's axes of local positions (n, 3), rad; not-a-number behind the antenna."""
    placed = physics.to_antenna(local, physics.rotation(*antenna), 0.0)
    r = np.linalg.norm(placed, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        angles = np.arcsin(placed[:, 1:] / r[:, None])
    angles[~(placed[:, 0] > 0)] = np.nan
    return {"elevation_rad": angles[:, 0], "azimuth_rad": angles[:, 1]}


def site_of(text: str) -> Site:
    """The site of `LAT,LON,HEIGHT` (degrees, degrees, m); raises ConfigError."""
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"at: must be LATITUDE,LONGITUDE,HEIGHT in degrees, degrees, m; got {text!r}") from None
    limits = (("latitude", -90, 90, "degrees"), ("longitude", -180, 360, "degrees"), ("height", -500, 100_000, "m"))
    places = zip(limits, (latitude, longitude, height), strict=True)
    if wrong := [(*one, value) for one, value in places if not one[1] <= value <= one[2]]:
        raise ConfigError(*("at: the {} must be from {} to {} {}, got {:g}".format(*one) for one in wrong))
    return Site(latitude, longitude, height)


def sites_of(texts: Sequence[str]) -> tuple[Site | None, dict[str, Site]]:
    """The site of the one radar, `LAT,LON,HEIGHT`, or of each of several, `SAC/SIC=LAT,LON,HEIGHT`."""
    named = {name.strip(): site_of(place) for name, sign, place in (text.partition("=") for text in texts) if sign}
    plain = [text for text in texts if "=" not in text]
    if len(plain) > 1 or (plain and named) or len(plain) + len(named) < len(texts):
        must = "must be one LAT,LON,HEIGHT, or SAC/SIC=LAT,LON,HEIGHT of each radar, once"
        raise ConfigError(f"at: {must}; got {' '.join(texts)}")
    if faults := [name for name in named if not re.fullmatch(r"\d{1,3}/\d{1,3}", name)]:
        raise ConfigError(*(f"at: SAC/SIC must be two numbers, as 25/12; got {name!r}" for name in faults))
    return (site_of(plain[0]) if plain else None), named


def antenna_of(text: str) -> Antenna:
    """The antenna of `AZIMUTH,ELEVATION` in degrees; raises ConfigError."""
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"antenna: must be AZIMUTH,ELEVATION in degrees, got {text!r}") from None
    if not (-360 <= azimuth <= 360 and -90 <= elevation <= 90):
        raise ConfigError(
            f"antenna: must be an azimuth from -360 to 360 and an elevation from -90 to 90 degrees, got {text!r}"
        )
    return Antenna(math.radians(azimuth), math.radians(elevation))


# ---- ais -------------------------------------------------------------------------------------------------------------
pyais: ModuleType | None
try:
    import pyais
    from pyais.exceptions import AISBaseException
except ImportError:
    pyais = None

KNOT_MPS = 1852 / 3600
SENTENCE = re.compile(rb"![A-Z]{2}VD[MO],[^\r\n]*")
TAG_TIME = re.compile(rb"[\\,]c:(\d{9,13})")
AFTER = re.compile(rb"\*[0-9A-Fa-f]{2}[,; \t]+(\d{9,13}(?:\.\d+)?)\s*$")
GATEHOUSE = re.compile(rb"\$PGHP,1,(\d{4})" + 5 * rb",(\d\d?)" + rb",(\d{1,3}),")  # the time of the next sentence
PARTS = re.compile(rb"![A-Z]{2}VD[MO],(\d),(\d),(\d?),")
NO_SPEED, NO_COURSE, NO_SECOND = 102.2, 360.0, 60
MOST_OPEN = 100  # incomplete messages kept
LEAST_GOOD = 0.5  # of the sentences; a file with fewer is not AIS


def sound(sentence: bytes) -> bool:
    """Whether a sentence has the checksum stated after its asterisk: the exclusive or of all its characters."""
    body, star, stated = sentence[1:].partition(b"*")
    return bool(star) and stated[:2].upper() == b"%02X" % functools.reduce(operator.xor, body, 0)


class Ais:
    """A file of AIS sentences; position reports of class A and B are read, all others skipped."""

    of_day = False

    def __init__(self, path: str, file: BinaryIO):
        if pyais is None:
            raise needs("pyais", "ais")
        self.path, self.file = path, file
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.open: dict[bytes, list[tuple[bytes, float]]] = {}
        self.minute = Unrolled(60.0)
        self.stamp = math.nan  # the last time that a line stated, or that follows from it
        self.ahead = math.nan  # that of a line of time before the next sentence
        self.untimed = 0  # reports whose minute none states

    def notes(self, radars: Iterable[str] = ()) -> list[str]:
        """How times were found where the lines do not state them."""
        if not self.untimed:
            return []
        if math.isnan(self.stamp):
            return [tr("reports that state no time: {count}; the seconds of their minute run on", count=self.untimed)]
        return [tr("reports that state no time: {count}; they get the nearest with their second", count=self.untimed)]

    def batches(self) -> Iterator[Batch]:
        """The position reports in batches; raises ConfigError where most sentences are damaged."""
        gathered, damaged, first = Gathered(POSITIONS, POSITION_COLUMNS), 0, ""
        for number, line in enumerate(self.file, start=1):
            sentence = SENTENCE.search(line)
            if not sentence and (not line.strip() or line.lstrip().startswith((b"#", b"$", b"\\"))):
                self._passed(line)
                continue
            try:
                if not sentence or not sound(sentence[0]):
                    raise AISBaseException
                stated, self.ahead = self._stated(line, sentence.start(), number), math.nan
                message, t = self._decoded(sentence[0], stated)
            except AISBaseException:
                damaged, first = damaged + 1, first or f"{self.path}:{number}"
                continue
            self.stamp = self.stamp if math.isnan(t) else t
            if message is not None:
                self._take(message, t, gathered)
            if len(gathered) >= BATCH:
                yield gathered.taken()
        if damaged and damaged >= LEAST_GOOD * (self.records + damaged):
            raise ConfigError(f"{first}: must be AIS sentences (!AIVDM,…); {damaged} lines are not, or are damaged; "
                              f"{self.records} messages were read")  # fmt: skip
        if damaged:
            self.skipped[term("damaged lines")] = damaged
        if len(gathered):
            yield gathered.taken()

    def _passed(self, line: bytes) -> None:
        """A line without an AIS sentence: some state the time of the next one."""
        if found := GATEHOUSE.search(line):
            try:
                year, month, day, hour, minute, second, thousandths = map(int, found.groups())
                moment = datetime.datetime(year, month, day, hour, minute, second, 1000 * thousandths, datetime.UTC)
                self.ahead = moment.timestamp()
            except ValueError:
                self.skipped[term("damaged lines of time")] += 1
        elif line.lstrip().startswith(b"$"):
            self.skipped[term("sentences other than AIS")] += 1

    def _decoded(self, sentence: bytes, stated: float) -> tuple[Any, float]:
        """The message that a sentence completes, none while further sentences of it are to come; the first time that
        they state, s from 1970."""
        assert pyais is not None  # `__init__` has checked it
        parts, whole = PARTS.match(sentence), [(sentence, stated)]
        if parts and parts[1] != b"1":
            held = self.open.setdefault(parts[3], [])
            if parts[2] == b"1":
                held.clear()
            held += whole
            if len(self.open) > MOST_OPEN:
                self.open.pop(next(iter(self.open)))
            if parts[2] != parts[1]:
                return None, math.nan
            whole = self.open.pop(parts[3])
        self.records += 1
        times = [t for _, t in whole if not math.isnan(t)]
        return pyais.decode(*(one for one, _ in whole)), times[0] if times else math.nan

    def _stated(self, line: bytes, before: int, number: int) -> float:
        """The time stated for a sentence, s from 1970; NaN where there is none."""
        if not math.isnan(self.ahead):
            return self.ahead
        head = line[:before]
        if found := TAG_TIME.search(head) or AFTER.search(line):
            stamp = float(found[1])
            return stamp / 1000 if stamp > 1e11 else stamp
        text = head.decode("ascii", "replace").strip(" \t,;\\")
        if not text or "*" in text:
            return math.nan
        try:
            return float(text)
        except ValueError:
            pass
        try:
            return utc_s(text)
        except ValueError:
            must = "the sentence must follow a time in s from 1970 or ISO 8601, or a tag block"
            read = f"{self.records} messages were read"
            raise ConfigError(f"{self.path}:{number}: {must}; got {text[:60]!r}; {read}") from None

    def _take(self, message: Any, stated: float, gathered: Gathered) -> None:
        latitude, longitude = getattr(message, "lat", None), getattr(message, "lon", None)
        if latitude is None or longitude is None or message.msg_type not in (1, 2, 3, 18, 19):
            self.skipped[term("messages other than ships' positions")] += 1
            return
        if None in (message.second, message.speed, message.course):
            self.skipped[term("messages cut short")] += 1
            return
        second = int(message.second)
        if abs(latitude) > 90 or abs(longitude) > 180 or (math.isnan(stated) and second >= NO_SECOND):
            self.skipped[NOWHERE] += 1
            return
        t = stated
        if math.isnan(t):
            self.untimed += 1
            near = self.stamp + (second - self.stamp + 30) % 60 - 30  # the nearest time with that second
            if math.isnan(near):
                t = self.minute(second)
            else:
                t = self.stamp = near
        speed, course = float(message.speed), math.radians(float(message.course))
        known = speed <= NO_SPEED and float(message.course) < NO_COURSE
        east, north = (speed * KNOT_MPS * part(course) if known else math.nan for part in (math.sin, math.cos))
        gathered.add(str(message.mmsi), str(message.mmsi), (t, latitude, longitude, 0.0, east, north, 0.0))
